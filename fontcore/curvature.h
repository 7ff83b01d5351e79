#pragma once

#include <vector>

#include "fontcore/outline_curve.h"

namespace fontcore {

/// Signed curvature of a segment at u, positive where it turns left: 1 / radius.
///
/// Units   1 / font units.
/// Exact   to rounding where there is speed; where there is none, as at a node whose handle lies on it, taken a
///         thousandth of the segment further in.
double curvature(const Bezier& bezier, double u);

/// A tooth of a curvature comb: a place of an outline and how sharply it turns there.
struct CombTooth {
  Point foot = Point::Zero();
  Point normal = Point::Zero();  ///< unit, to the left of the way the outline runs
  double curvature = 0.0;        ///< signed, 1 / font units
};
/// The curvature along an outline: a comb for every arc, broken at corners alone.
///
/// Every segment has a tooth at either end and others between, evenly by arc length. So a smooth join has two on one
/// foot, along one normal as nearly as it is smooth, which differ by what the curvature jumps there. On a contour
/// without corners the comb ends where it begins.
///
/// Units   step in font units: neighbouring teeth are no farther apart along the outline.
/// Throws  InvalidInput if the step is not positive.
std::vector<std::vector<CombTooth>> curvature_comb(const OutlineArcs& outline, double step);

}  // namespace fontcore
