#pragma once

#include <limits>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/measure.h"

namespace fontcore {

/// What is met first along a straight line from the middle of an edge.
struct EdgeHit {
  double distance = std::numeric_limits<double>::infinity();
  int edge = -1;    ///< -1 if nothing is met
  double at = 0.0;  ///< place on that edge, 0 its start and 1 its end

  bool exists() const { return edge >= 0; }
};

/// A short stretch of the outline of a shape, with ink on one side of it and paper on the other.
struct StrokeEdge {
  int contour = 0;
  int segment = 0;
  double u0 = 0.0;  ///< where it starts and ends on the segment
  double u1 = 1.0;
  Point start = Point::Zero();
  Point chord = Point::Zero();  ///< from its start to its end
  Point middle = Point::Zero();
  Point normal = Point::Zero();  ///< out of the ink, of length 1
  double length = 0.0;
  double run = 0.0;         ///< length of the segment it belongs to
  bool is_line = false;     ///< the segment is straight
  bool is_corner = false;   ///< the outline turns sharply at its start
  bool is_visible = false;  ///< paper on its outer side: not inside another contour's ink
  int previous = 0;
  int next = 0;
  EdgeHit ink;           ///< against the normal: the other side of the stroke
  double facing = -1.0;  ///< cosine between the normal and that of the other side reversed; 1 if they are opposite
  EdgeHit gap_x;         ///< along x or y, away from the ink: the next ink
  EdgeHit gap_y;
  double direction = 0.0;  ///< of the normal from the x axis, in [0, pi/2]

  double thickness() const { return ink.distance; }
};

/// The outline of a shape as edges, contour by contour, each with the thickness of its stroke and its distance from the
/// next ink.
///
/// Straight segments are cut every `line_step`, curves every `curve_step`, curves into two at least. What is inside is
/// decided by the non-zero rule, so contours may overlap; edges within the ink take no part. Segments of no length have
/// no edge.
///
/// Units   of the contours.
/// Exact   up to replacing curves by their chords.
class StrokeEdges {
 public:
  StrokeEdges(const std::vector<BezierContour>& contours, double curve_step, double line_step);

  const std::vector<StrokeEdge>& edges() const { return edges_; }
  const StrokeEdge& operator[](int i) const { return edges_[static_cast<std::size_t>(i)]; }
  int size() const { return static_cast<int>(edges_.size()); }
  int contour_count() const { return static_cast<int>(first_.size()) - 1; }
  /// Index of the first edge of a contour; of one past the last, the number of edges.
  int first(int contour) const { return first_[static_cast<std::size_t>(contour)]; }
  const Box& box() const { return box_; }
  /// Thickness of upright strokes, the median; `none` if there are none.
  double stem(double none) const;
  Point end(int i) const { return (*this)[(*this)[i].next].start; }
  /// True at the start of an edge that is a highest point (sign 1) or lowest one (-1) of the outline.
  bool is_extremum(int i, double sign) const;

 private:
  void cut(const BezierContour& contour, int index, double curve_step, double line_step);
  void orient(double sign);
  void look_across();
  class Strips;
  EdgeHit first_hit(int from, const Point& direction, const Strips& strips) const;

  std::vector<StrokeEdge> edges_;
  std::vector<int> first_{0};
  Box box_;
};

}  // namespace fontcore
