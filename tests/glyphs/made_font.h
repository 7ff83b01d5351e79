#pragma once

#include <utility>
#include <vector>

#include "glyphs/font.h"

/// A TrueType font of one glyph, g, that comes from no file.
inline glyphs::Font font_of(std::vector<fontcore::BezierContour> contours, int units_per_em = 1000) {
  glyphs::Font font;
  font.path = "made";
  font.units_per_em = units_per_em;
  font.format = glyphs::OutlineFormat::TrueType;
  glyphs::Glyph glyph;
  glyph.name = "g";
  glyph.advance = 600;
  glyph.contours = std::move(contours);
  font.glyphs.push_back(std::move(glyph));
  return font;
}
