#pragma once

#include <string>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// One linear equation on displacements: the sum of coefficient * displacement[2 * point + axis] is `value`.
///
/// `name` says what must hold, in words a designer knows; it is what a report or a contradiction shows.
struct Row {
  struct Term {
    int variable = 0;  ///< 2 * point + axis, axis 0 for x and 1 for y
    double coefficient = 0.0;
  };
  std::string name;
  std::vector<Term> terms;
  double value = 0.0;
};
using Rows = std::vector<Row>;

// The rules, as values. Points and segments are those of a BezierContour; displacements those of its points.

/// A point that does not move.
struct FrozenPoint {
  int point = 0;
};
/// A smooth join keeps its tangency and the ratio of its handles: with a and b the points beside node p,
/// d_p = (1 - m) d_a + m d_b, m from the handle lengths (1/2 for an implied node). A line that runs smoothly into a
/// curve is the same row. A join that is only nearly smooth is carried along as it is; with `close` it is made exactly
/// smooth.
struct SmoothJoin {
  int segment = 0;  ///< the segment that starts at the join
  bool close = false;
};
/// A node between two lines that go straight on stays on their line.
struct NodeOnLine {
  int segment = 0;
};
/// A horizontal or vertical line stays so.
struct AxisLine {
  int segment = 0;
};
/// A smooth node whose tangent is horizontal or vertical stays an extremum: handles and node keep one coordinate.
struct Extremum {
  int segment = 0;
};
/// A flat or round feature at an alignment zone keeps its height.
struct Zone {
  int segment = 0;  ///< the segment that starts at the node
};
/// A point of the outline moves by a given displacement.
struct Position {
  int segment = 0;
  double u = 0.0;
  Point displacement = Point::Zero();
};
/// Neighbouring points that lie on each other stay on each other: a segment of no length, a handle drawn in.
struct Coincident {
  int first = 0;
  int second = 0;
};

Rows rows(const BezierContour& contour, const FrozenPoint& rule);
Rows rows(const BezierContour& contour, const SmoothJoin& rule);
Rows rows(const BezierContour& contour, const NodeOnLine& rule);
Rows rows(const BezierContour& contour, const AxisLine& rule);
Rows rows(const BezierContour& contour, const Extremum& rule);
Rows rows(const BezierContour& contour, const Zone& rule);
Rows rows(const BezierContour& contour, const Position& rule);
Rows rows(const BezierContour& contour, const Coincident& rule);

/// Which features of an outline are kept when its rules are gathered.
struct OutlineRules {
  bool lines = true;
  bool smooth_joins = true;
  bool extrema = true;
  std::vector<double> zones;       ///< heights of alignment zones, font units
  double corner_angle = 0.139626;  ///< a sharper turn is a corner and free, radians (8 degrees)
  std::vector<int> closed_joins;   ///< segments whose nearly smooth start is to be made exactly smooth
};

/// Every rule that the outline's own points must obey, in a fixed order: coincident points, implied nodes, lines,
/// joins, extrema, zones. Corners need no row: they are points, free to turn.
Rows outline_rows(const BezierContour& contour, const OutlineRules& rules);

/// Rows of a corner of the spline: both members of a pair (x_i, x_{i+1}) of control points move alike, so it stays a
/// corner.
struct CornerPair {
  int first = 0;
  int size = 0;  ///< number of control points
};
Rows rows(const CornerPair& rule);

}  // namespace fontcore
