#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// Writes a file whole or not at all: a temporary file in the same folder, fsync, rename, fsync of the folder. An old
/// file keeps its mode and, where that is allowed, its owner; a link is followed to the file it names; a file that may
/// not be written is not replaced. A signal that ends the program removes the temporary file; signals that the program
/// ignores or handles itself are left to it. `path` may be the file the data was read from. Devices, pipes and what
/// lies under /dev or /proc (/dev/stdout) are written directly.
///
/// Throws  FontWriteError with the system's reason; an old file is then untouched.
void write_file(const std::string& path, const Bytes& data);
void write_file(const std::string& path, const std::string& text);

/// Where an output is to go: a file, or a folder that is a UFO.
struct Output {
  std::string path;
  bool is_folder = false;
};

/// Files and folders that are staged beside their places as they are made, and then put there all or none: staged ones
/// are flushed, so that a full disk or a missing folder leaves every old output as it was.
///
/// A file gives way as in `write_file`. A folder is staged as a whole and exchanged for what was there. Only a UFO (a
/// folder with metainfo.plist) or a regular file gives way to a folder: any other folder is refused, never removed. A
/// link is followed, and the old folder's mode is kept, and of its files those that are written again. Devices and
/// pipes are written when all else is staged, before anything is put in place.
///
/// Putting in place takes a rename for each output, one after the other. Old outputs are kept beside them until the
/// last is done: if one cannot be put in place, those before it are taken out again and the old ones put back. A signal
/// that ends the program (as in `write_file`) waits until then; earlier it removes all that is staged. If the program
/// is killed or the machine stops between two renames, some outputs are new and the others old, each of them whole;
/// what was staged or kept may stay beside them as `.glyphwave-*.tmp`. Where the file system cannot exchange two names,
/// old files are kept by a second link; where it has no links either, and for folders, they are put aside, and for the
/// moment between two renames nothing is in that place.
class OutputBatch {
 public:
  /// Throws  FontWriteError if an output cannot be written, two are one file, or one lies in a folder that is written.
  explicit OutputBatch(const std::vector<Output>& outputs);
  OutputBatch(const OutputBatch&) = delete;
  OutputBatch& operator=(const OutputBatch&) = delete;
  ~OutputBatch();  ///< what was staged and not put in place goes

  /// Of the output of that index, once. Throws  FontWriteError with the system's reason.
  void stage(std::size_t output, Bytes data);
  void stage(std::size_t output, const Folder& folder);

  /// All that is staged, once. Throws  FontWriteError; every old output is then as it was, unless the error says where
  /// one is that could not be put back.
  void put_in_place();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Several outputs at once, all or none, as an `OutputBatch`.
///
/// Throws  FontWriteError.
struct PendingFile {
  std::string path;
  Bytes data;
  std::optional<Folder> folder = {};  ///< written instead of `data`: the path is to be a folder
};
void write_files(const std::vector<PendingFile>& files);

/// A folder for outputs: made if it is missing, with those above it. What was made goes again at the end, and when a
/// signal ends the program, unless something is in it.
///
/// Throws  FontWriteError if it cannot be made, or is no folder.
class OutputFolder {
 public:
  explicit OutputFolder(const std::string& path);
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  ~OutputFolder();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Opens descriptors 0 to 2 on /dev/null if they are closed, so that no output file can be taken for standard error.
/// To be called before anything is opened.
void secure_standard_descriptors();

}  // namespace glyphs
