#pragma once

#include <string>
#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/outline_curve.h"
#include "glyphs/font.h"
#include "glyphs/recipe.h"

namespace glyphs {

/// Why a glyph stays as it was; thrown.
struct Refusal {
  std::string reason;
};

/// What the steps on a contour, and its emission, keep to: the font's own outline, or what softening or detail made of
/// it.
struct ContourReference {
  fontcore::BezierContour contour;
  std::vector<int> came_from;  ///< per point its index in the font's contour; -1 if it is new
  fontcore::Rows frozen;
  std::vector<int> corners;  ///< points that the source marks as corners, sorted
  bool is_textured = false;  ///< by detail: short cubics, which only compact emission makes an outline of
};

/// A glyph as the steps of a recipe leave it, contour by contour. It holds what it refers to no longer than a call.
struct SolvedGlyph {
  const Font& font;
  const std::vector<fontcore::BezierContour>& original;
  const std::vector<fontcore::BezierContour>& contours;
  const std::vector<ContourReference>& references;
  const std::vector<std::vector<fontcore::OutlineCurve::Location>>& handles;  ///< that rounding must not lose
  const fontcore::OutlineRules& rules;
};

struct EmittedGlyph {
  std::vector<fontcore::BezierContour> contours;  ///< the font's own where nothing changed
  std::vector<double>
      handle_errors;  ///< per contour, how far its own points in whole numbers take a handle, font units
  std::vector<std::string> notes;
};

/// The glyph in whole numbers, within the recipe's tolerance and at the areas it has: on its contours' own points, or
/// by the recipe, and where it is textured, in the fewest segments. A texture that whole numbers are too far apart for
/// may be farther off, within fixed bounds.
///
/// Throws  Refusal if a coordinate leaves 16 bits or a texture is off by more than that.
EmittedGlyph emit(const SolvedGlyph& glyph, const Recipe& recipe);

/// True if new curves of a glyph are to be quadratics: in TrueType, and in a UFO where the glyph has curves and they
/// are.
bool has_quadratics(const Font& font, const std::vector<fontcore::BezierContour>& contours);

}  // namespace glyphs
