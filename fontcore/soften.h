#pragma once

#include <optional>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// Which pieces stand for a corner.
enum class ArcKind {
  Own,        ///< those of the contour: quadratics if it has any, else a cubic
  Quadratic,  ///< two quadratics, the node between them implied
  Cubic,      ///< one cubic
};

/// What becomes of a listed corner at which nothing can be trimmed.
enum class EmptyArc {
  Leave,  ///< it stays a corner
  Add,    ///< it gets its arc all the same, of no length: the structure hangs on the list alone
};

struct SoftenOptions {
  double radius = 0.0;                                       ///< of the arcs, font units
  double corner_angle = OutlineCurveOptions{}.corner_angle;  ///< what turns by more is a corner, radians
  /// A corner is left as it is if the quadratics of its arc had shorter handles, and of a leg as much stays between two
  /// arcs; font units. Whole numbers cannot draw what is smaller.
  double least_handle = 0.0;
  std::optional<std::vector<int>> corners;  ///< these alone, whatever they turn by: the segments that start at them
  ArcKind arcs = ArcKind::Own;
  EmptyArc empty = EmptyArc::Leave;  ///< of listed corners; with Add there is no least handle
};

/// A corner that is an arc now.
struct SoftenedCorner {
  int segment = 0;      ///< of the old contour: the one that started at the corner
  double cut = 0.0;     ///< length taken from both legs, font units
  double radius = 0.0;  ///< that it has: the one asked for, or less where a leg is short
};

struct Softened {
  BezierContour contour;
  std::vector<SoftenedCorner> corners;  ///< in the order of their segments
  std::vector<int> came_from;           ///< per point the index it had before; -1 if it belongs to an arc
};

/// Rounds corners: both legs are trimmed by the same length, and an arc tangent to what is left joins them.
///
/// The cut is what a circle of the radius takes from straight legs, radius * tan(turn / 2), but at most half of
/// either leg (less half the least handle), so that two arcs never share a stretch. On curved legs it is arc length,
/// and the arc fits the turn that is left there. An arc is one cubic, or two quadratics round an implied node; its
/// handles reach that share of the way to where the tangents meet that they have on a circular arc. Where the tangents
/// do not meet ahead, both handles are those of a circular arc over the same chord. A leg's far end stays; if it was an
/// implied node it becomes a node of its own, since its handle moves. An arc stands in the list where its corner stood:
/// a list that began with the corner begins with the arc. Corners beside a segment of no length have no leg to trim.
///
/// So with a list and EmptyArc::Add, masters of one structure stay of one structure.
///
/// Exact   what is left of a leg lies on it, to rounding, and coordinates that its points share stay shared, bit for
///         bit; both joins are tangent to 1e-9. With straight legs the quadratics touch the circle in the middle, and
///         the cubic is within 3e-4 of the radius at a right angle. Legs not trimmed keep their bits, and so does the
///         contour if there is nothing to round.
/// Throws  InvalidInput if the radius is negative or not finite, or a corner of the list is no segment.
Softened soften(const BezierContour& contour, const SoftenOptions& options);

}  // namespace fontcore
