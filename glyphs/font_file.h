#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/jobs.h"
#include "glyphs/sfnt_writer.h"
#include "glyphs/variation.h"

namespace glyphs {

/// The largest file that is read, in bytes: twice the largest collections in use.
inline constexpr std::size_t max_font_size = std::size_t{256} << 20;

/// Reads a whole file.
/// Throws  FontReadError if it cannot be read: missing, a folder, not a regular file, over `max_font_size`.
Bytes read_file(const std::string& path);

/// The most that a folder may hold that is read.
inline constexpr std::size_t max_folder_size = std::size_t{256} << 20;  ///< bytes of all its files together
inline constexpr std::size_t max_folder_files = 500'000;
inline constexpr int max_folder_depth = 32;

/// All regular files of a folder, by their paths within it; a folder with nothing in it stands as its path and a slash.
/// The folder itself may be named by a link; no link in it is followed.
///
/// Throws  FontReadError, naming what it is about: not a folder, a link, pipe or device inside, over the limits above.
Folder read_folder(const std::string& path);

/// Which font of a file is meant.
struct LoadOptions {
  int face = 0;       ///< of a collection
  Location location;  ///< of a variable font; empty: its default
};

/// A font of any kind that is read, a folder being a UFO, as plain values: original points, unscaled and unhinted,
/// composites as components. A web font becomes the sfnt that it packs before anything else. A variable font gives its
/// default, and stays variable; at a location it gives a static font, by `instantiate`.
///
/// Throws  FontReadError, one line naming the file; with a location also for a font that is not variable, and for an
///         axis or a value that it does not have.
Font load_font(const std::string& path, const LoadOptions& options = {});
/// The same from the bytes of a file; `path` is its name.
Font load_font_bytes(const std::string& path, Bytes data, const LoadOptions& options = {});

/// What is to be written, which a path says by its ending.
enum class FileKind { TrueType, OpenType, Ufo, Svg };

/// How the path of such a file ends: ".ttf", ".otf", ".ufo", ".svg".
const char* ending_of(FileKind kind);

/// Throws  RequestError if the path ends in none of .ttf, .otf, .ufo, .svg (of a folder, before a slash).
FileKind file_kind(const std::string& path);

/// The kind that an edited font is written as: that of its outlines.
///
/// Throws  RequestError if it cannot be written: a variable font, which is edited at one place of its design space
///         only, or outlines of CFF2 that do not vary.
FileKind kind_of(const Font& font);

/// Throws  RequestError if an edited font cannot be written under that path, whose ending is not that of `kind_of`; as
///         `kind_of` and `file_kind` do.
void require_kind(const Font& font, const std::string& output);

/// The font with the given glyphs' outlines replaced and nothing else changed, by `write_sfnt` or `write_ufo`.
WrittenFont write_font(const Font& font, const EditedGlyphs& edited, const WriteOptions& options = {});

/// What became of one glyph of an edited font.
struct GlyphChange {
  int glyph = 0;
  std::string name;
  std::string refused;  ///< why the glyph stays as it was, or comes out empty, though something was asked of it
  bool changed = false;
  double area_before = 0.0;
  double area_after = 0.0;
  int crossings_before = 0;
  int crossings_after = 0;
  int segments_before = 0;
  int segments_after = 0;
  std::vector<std::string> dropped;  ///< instructions or hints, and why
  std::vector<std::string> notes;    ///< other remarks, a line each
};
/// Adds what writing the font has done to the glyph: whether it comes out empty, and what was dropped.
void add_written(const WrittenFont& written, GlyphChange& change);

/// What became of the glyphs of an edited font, by id.
template <typename Change>
struct GlyphChanges {
  std::vector<Change> glyphs;

  int changed() const { return static_cast<int>(std::ranges::count(glyphs, true, &Change::changed)); }
  int refused() const {
    return static_cast<int>(std::ranges::count_if(glyphs, [](const Change& one) { return !one.refused.empty(); }));
  }
};

/// The glyphs that stay as they were, or come out empty, though nobody asked for it: each by name and why.
template <typename Change>
std::vector<std::string> refusals(const Font& font, const WrittenFont& written, const GlyphChanges<Change>& changes) {
  const auto line = [](const std::string& name, const std::string& why) { return name + " (" + why + ")"; };
  std::vector<std::string> refused;
  for (const auto& [id, why] : written.emptied) {
    const bool is_listed = std::ranges::count(changes.glyphs, id, &Change::glyph) > 0;
    if (!is_listed) refused.push_back(line(font.glyphs[static_cast<std::size_t>(id)].name, "comes out empty: " + why));
  }
  for (const Change& change : changes.glyphs) {
    if (!change.refused.empty()) refused.push_back(line(change.name, change.refused));
  }
  return refused;
}

/// Bytes that every glyph takes in the file the font was read from, by glyph id: of its entry in `glyf`, of its
/// charstring, of its file in a UFO. 0 where there is nothing, and in fonts with other outlines.
std::vector<std::int64_t> glyph_bytes(const Font& font);
/// The same in what was written of that font with its kind of outlines kept.
std::vector<std::int64_t> glyph_bytes(const Font& font, const WrittenFont& written);

/// A UFO made of the font, by `build_ufo`.
WrittenFont extract_ufo(const Font& font);

}  // namespace glyphs
