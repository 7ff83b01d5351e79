#pragma once

#include "fontcore/contour.h"

namespace fontcore {

/// The same curve in lines and cubics, every quadratic raised: exactly, but for rounding. Every node is a point of its
/// own; the list begins with the first node.
BezierContour raised_to_cubics(const BezierContour& contour);

/// A curve of lines and quadratics within a distance, every cubic cut at even parameters into as few quadratics as a
/// bound on the distance asks for. They keep the tangents at their ends where that stays within the distance.
/// Coordinates are rounded to whole numbers on request.
///
/// Exact   within the distance before rounding: a cubic and the quadratic of the same ends and mean control point are
///         at most sqrt(3)/36 |p3 - 3 p2 + 3 p1 - p0| apart, which falls with the cube of the number of pieces.
/// Throws  InvalidInput if the distance is not positive.
BezierContour lowered_to_quadratics(const BezierContour& contour, double distance, bool is_whole);

}  // namespace fontcore
