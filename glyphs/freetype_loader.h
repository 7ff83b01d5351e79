#pragma once

#include <string>

#include "glyphs/font.h"

namespace glyphs {

/// The largest file that is read, in bytes: twice the largest collections in use.
inline constexpr std::size_t max_font_size = std::size_t{256} << 20;

/// Reads a whole file.
/// Throws  FontReadError if it cannot be read: missing, a folder, not a regular file, over `max_font_size`.
Bytes read_file(const std::string& path);

/// A TTF, OTF or one face of a collection as plain values: original points, unscaled and unhinted, composites as
/// components. A variable font gives its default.
///
/// Outlines come from FreeType. Where a CFF charstring has fractional operands FreeType truncates them, so such glyphs
/// come from HarfBuzz and `has_fractional_coordinates` says so. A glyph that cannot be read has its `trouble` named;
/// the font is still good. What would make a library loop or blow up is found before it is called.
///
/// Throws  FontReadError, one line naming the file: not a font, empty, truncated (a table reaches past the end of the
///         file), a required table missing, no such face, WOFF.
Font load_font(const std::string& path, int face_index = 0);
Font load_font(const std::string& path, Bytes data, int face_index = 0);

}  // namespace glyphs
