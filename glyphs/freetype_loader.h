#pragma once

#include <string>

#include "glyphs/font.h"

namespace glyphs {

/// The bytes of a TTF, an OTF or one face of a collection as plain values: original points, unscaled and unhinted,
/// composites as components. A variable font gives its default.
///
/// Outlines come from FreeType. Where a CFF charstring has fractional operands FreeType truncates them, so such glyphs
/// come from HarfBuzz and `has_fractional_coordinates` says so. A glyph that cannot be read has its `trouble` named;
/// the font is still good. What would make a library loop or blow up is found before it is called.
///
/// Throws  FontReadError, one line naming the file: not a font, empty, truncated (a table reaches past the end of the
///         file), a required table missing, no such face.
Font load_sfnt(const std::string& path, Bytes data, int face_index = 0);

}  // namespace glyphs
