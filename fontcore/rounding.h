#pragma once

#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/contour.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// Whole-number coordinates near an outline's, and what they cost.
struct Rounding {
  BezierContour contour;
  double area_error = 0.0;        ///< signed area minus the wished one, square units
  double plain_area_error = 0.0;  ///< the same with every coordinate rounded to its nearest whole number
  double handle_error = 0.0;      ///< largest distance of a handle from its place, font units
  int opened_joins = 0;           ///< smooth joins that turn by more than 1.5 degrees now
};

/// Rounds an edited outline so that its signed area is as near `area` as the neighbouring whole numbers allow.
///
/// Coordinates that rules tie are one unknown; points that have not moved from `original` stay, unless they are new.
/// Every other unknown
/// takes its floor or its ceiling, one further if the area is still off;
/// an outline of few unknowns is searched further, for the area before the handle. Smooth joins stay
/// within 1.5 degrees where that can be; handles, if given, end within one unit of their places.
///
/// Exact   joins smooth before stay within 1.5 degrees where whole numbers up to a unit further allow; with them
/// closed,
///         never farther from the area than plain rounding unless within 1e-6 of it, relative to `scale`.
/// Throws  InvalidInput if the contours have not the same structure.
struct RoundingGoal {
  double area = 0.0;   ///< wished signed area of the contour, square units
  double scale = 0.0;  ///< what relative errors are relative to: the glyph's area
  std::vector<OutlineCurve::Location> handles;
  std::vector<bool> is_new{};  ///< per point: it has no place of its own in the font to stay at; empty if all have
};
Rounding round_keeping_area(const BezierContour& edited, const BezierContour& original, const OutlineRules& rules,
                            const RoundingGoal& goal);

}  // namespace fontcore
