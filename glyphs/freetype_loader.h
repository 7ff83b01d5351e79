#pragma once

#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// The bytes of a TTF, an OTF or one face of a collection as plain values: original points, unscaled and unhinted,
/// composites as components. A variable font gives its default.
///
/// Outlines of TrueType come from FreeType, those of CFF from a reader of our own: FreeType truncates fractional
/// operands and HarfBuzz gives floats, and both let a font of a few bytes keep them busy. CFF2 comes from FreeType, or
/// from HarfBuzz where it has fractions; `has_fractional_coordinates` says so. A glyph that cannot be read has its
/// `trouble` named; the font is still good. What would make a library loop or blow up is found before it is called.
///
/// Throws  FontReadError, one line naming the file: not a font, empty, truncated (a table reaches past the end of the
///         file), a required table missing, no such face.
Font load_sfnt(const std::string& path, Bytes data, int face_index = 0);

/// A CFF2 font with the outlines of a place of its design space, fractions and all; everything else is as at the
/// default. `place` has a coordinate for every axis, normalised and bent by avar, in multiples of 1/16384.
///
/// Outlines come from HarfBuzz, and FreeType has to agree; a glyph for which it does not is in trouble.
///
/// Throws  as `load_sfnt`.
Font load_cff2_at(const std::string& path, Bytes data, const std::vector<double>& place);

/// Outlines of some glyphs of a single font as FreeType reads them, to check another reader by: fractions truncated,
/// lines of no length left out.
///
/// Throws  FontReadError if it cannot read one.
std::vector<std::vector<fontcore::BezierContour>> read_by_freetype(const Bytes& data, const std::vector<int>& glyphs);

}  // namespace glyphs
