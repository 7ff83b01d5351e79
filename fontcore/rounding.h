#pragma once

#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/contour.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// Whether an outline whose neighbouring whole numbers are far off its area is moved further for its sake.
enum class BeyondUnit {
  Never,
  ForArea,  ///< two unknowns of a contour that has few go up to twelve units: stems, dots
};

/// What a contour is to have in whole numbers.
struct RoundingGoal {
  double area = 0.0;   ///< wished signed area of the contour, square units
  double scale = 0.0;  ///< what relative errors are relative to: the glyph's area
  std::vector<OutlineCurve::Location> handles;
  std::vector<bool> is_new{};  ///< per point: it has no place of its own in the font to stay at; empty if all have
  BeyondUnit beyond_unit = BeyondUnit::Never;
};

/// Whole-number coordinates near an outline's, and what they cost.
struct Rounding {
  BezierContour contour;
  double area_error = 0.0;        ///< signed area minus the wished one, square units
  double plain_area_error = 0.0;  ///< the same with every coordinate rounded to its nearest whole number
  double handle_error = 0.0;      ///< largest distance of a handle from its place, font units
  int opened_joins = 0;           ///< smooth joins that turn by more than 1.5 degrees now
};

/// Rounds an edited outline so that its signed area is as near the wished one as the neighbouring whole numbers allow.
///
/// Coordinates that rules tie are one unknown. Points that have not moved from `original` stay, unless they are new;
/// what is whole already stays; every other unknown takes its floor or its ceiling. Of these the choice is the one
/// nearest to the area, and of those equally near the one nearest to the outline, with smooth joins within 1.5 degrees
/// and handles within one unit of their places. A join that no floors and ceilings of its own points close has them up
/// to a unit further, whole ones too, and there they stay; one that not even these close stays open and is counted.
///
/// Exact   the best choice where at most 14 unknowns are free; with more, one within 1e-6 of the area, relative to
///         `scale`, where a search of bounded length finds it. Never farther from the area than plain rounding where
///         that keeps the joins.
/// Throws  InvalidInput if the contours have not the same structure, or `is_new` has not one mark a point.
Rounding round_keeping_area(const BezierContour& edited, const BezierContour& original, const OutlineRules& rules,
                            const RoundingGoal& goal);

/// A contour that is rounded together with others.
struct Unrounded {
  BezierContour edited;
  BezierContour original;
  OutlineRules rules;
  RoundingGoal goal;
};
/// The same for the contours of a glyph: the sum of their areas comes as near the sum of the wished ones as can be, so
/// that one makes good what the others cannot. Relative to the largest `scale`.
std::vector<Rounding> round_keeping_area(const std::vector<Unrounded>& contours);

}  // namespace fontcore
