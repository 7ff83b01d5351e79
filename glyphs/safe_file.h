#pragma once

#include <optional>
#include <string>

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

/// Several files, all prepared and flushed before the first is renamed, so that a full disk or a missing folder leaves
/// every old file as it was. Devices and pipes are written after the files are prepared and before they are renamed.
///
/// A folder is staged beside its place, flushed, and exchanged for what was there in one step; what was there is then
/// removed. Only a UFO (a folder with metainfo.plist) or a regular file gives way to a folder: any other folder is
/// refused, never removed. A link is followed, and the old folder's mode is kept, and of its files those that are
/// written again. Where the file system cannot exchange, the old folder is put aside for the moment between two
/// renames.
///
/// Throws  FontWriteError; also if two of the paths are one file, or one lies in a folder that is written.
struct PendingFile {
  std::string path;
  Bytes data;
  std::optional<Folder> folder = {};  ///< written instead of `data`: the path is to be a folder
};
void write_files(const std::vector<PendingFile>& files);

/// Opens descriptors 0 to 2 on /dev/null if they are closed, so that no output file can be taken for standard error.
/// To be called before anything is opened.
void secure_standard_descriptors();

}  // namespace glyphs
