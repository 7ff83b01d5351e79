#pragma once

#include <vector>

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
/// One cubic, as there before rounding.
std::vector<Bezier> lowered_to_quadratics(const Bezier& cubic, double distance);

/// The outline without points that it does not need: a node within a distance of the middle between two quadratic
/// handles is implied by them, and goes there. The first point stays, unless it is just in the middle.
BezierContour with_implied_nodes(const BezierContour& contour, double distance);

/// The outline without segments shorter than a length: their ends become one node, in the middle, or where one of them
/// is to stay, there; both that stay, stay.
///
/// Shape   stays one mark a point. Kinds of nodes: all points of their own.
/// Throws  InvalidInput if it has another number.
BezierContour without_short_segments(const BezierContour& contour, double length, const std::vector<bool>& stays);

/// The outline with a line for every curve whose control points lie exactly on one, as rounding to whole numbers makes
/// them, whose handles may turn back on it; and one line for two that follow each other so, though the second turned
/// back by up to two units. Points that are to stay do.
///
/// Shape   stays one mark a point.
/// Throws  InvalidInput if it has another number.
BezierContour straightened(const BezierContour& contour, const std::vector<bool>& stays);

}  // namespace fontcore
