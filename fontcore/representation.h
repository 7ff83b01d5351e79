#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/measure.h"
#include "fontcore/nonuniform.h"
#include "fontcore/shared_sequence.h"
#include "fontcore/splice.h"
#include "fontcore/wavelet.h"

namespace fontcore {

// The forms that one closed curve over t in [0, 1) is kept in. Each is a value: copies share what they have in common,
// and what changes one gives a new one, with the interval that is not as it was.

/// A closed polyline as plain lists.
struct Polyline {
  std::vector<double> t;  ///< strictly ascending in [0, 1)
  Points points;          ///< n×2, n >= 3
};

/// A closed polyline over t, straight and even from vertex to vertex.
///
/// Source  [GA98] section 6.1.
class LinkedPolyline : public Representation {
 public:
  LinkedPolyline() = default;
  /// Throws  InvalidInput if there are fewer than 3 vertices, or naming the first whose t does not ascend in [0, 1) or
  ///         that is not finite.
  explicit LinkedPolyline(const Polyline& polyline);

  int size() const { return static_cast<int>(vertices_.size()); }
  Sample vertex(int index) const;
  /// The last vertex at or before t; modulo the curve.
  int vertex_at(double t) const;
  /// Vertices with t in an interval, ends included, in its order; t unwrapped.
  std::vector<Sample> vertices(const Interval& interval) const;
  Point evaluate(double t) const;
  Polyline whole() const;
  /// The stretches, vertex to vertex, whose edges' boxes meet a box; disjoint, in order.
  std::vector<Interval> near(const Box& box) const;

  /// Throws  InvalidInput if the index is out of range or the place not finite.
  Changed<LinkedPolyline> move_vertex(int index, const Point& to) const;
  /// Throws  InvalidInput if there is a vertex at t already, or t or the place is not finite.
  Changed<LinkedPolyline> add_vertex(double t, const Point& place) const;
  /// Throws  InvalidInput if the index is out of range or 3 vertices are left.
  Changed<LinkedPolyline> remove_vertex(int index) const;
  /// Every vertex of an interval dropped that the polyline without it keeps within `tolerance` of the one before, at
  /// equal t; vertices at `kept` stay.
  Changed<LinkedPolyline> merge_straight(const Interval& interval, double tolerance,
                                         const std::vector<double>& kept = {}) const;

  SampledSplice sample(const Interval& interval, double tolerance) const override;
  std::shared_ptr<const Representation> splice(const SampledSplice& samples, double tolerance) const override;
  std::size_t bytes_beyond(const Representation& other) const override;

 private:
  struct Vertex {
    double t = 0.0;
    Point p = Point::Zero();
    void add_to(Box& box) const { box.add(p); }
  };
  LinkedPolyline replaced(const Interval& interval, const std::vector<Sample>& by) const;

  SharedSequence<Vertex> vertices_;
};

/// A closed chain of lines, quadratics and cubics over t, even in every piece's own parameter.
///
/// It begins as a font's contour, t in proportion to arc length at its nodes; t = 0 stays a node. Outside changes
/// nothing changes by a bit, and pieces that nothing touched say which segment of the font they are.
class LinkedBezier : public Representation {
 public:
  LinkedBezier() = default;
  /// Throws  InvalidInput if the contour has no length.
  explicit LinkedBezier(const BezierContour& contour);

  struct Piece {
    double t = 0.0;  ///< where it begins; it ends where the next one does
    Bezier bezier{};
    int source = -1;  ///< segment of the font's contour that it is, bit for bit; -1 if none
  };
  int size() const { return static_cast<int>(pieces_.size()); }
  Piece piece(int index) const;
  /// Where a piece ends: 1 for the last.
  double end(int index) const { return node(index + 1); }
  /// The piece at t: of two, the one that begins there.
  int piece_at(double t) const;
  Point evaluate(double t) const;
  /// Unit tangent at t, arriving or leaving; zero if the piece has none.
  Point tangent(double t, Side side) const;
  /// As a contour, its segments the pieces in order; implied nodes between two of the font's segments stay implied.
  /// Exact   the font's contour, bit for bit, where nothing changed.
  BezierContour contour() const;
  /// Indices of pieces with a part inside an interval, in its order.
  std::vector<int> pieces(const Interval& interval) const;
  /// An interval replaced by pieces that begin in it (t unwrapped, the first at its beginning) and end with it. Pieces
  /// that it cuts keep what is outside.
  /// Throws  InvalidInput if there are none or t does not ascend within the interval.
  LinkedBezier replaced(const Interval& interval, const std::vector<Piece>& by) const;
  /// The pieces with a part inside an interval, cut to it; t unwrapped.
  std::vector<Piece> pieces_within(const Interval& interval) const;
  /// The stretches, piece by piece, whose control points' boxes meet a box; disjoint, in order.
  std::vector<Interval> near(const Box& box) const;

  /// A control point moved; at a node the neighbours' end comes with it.
  /// Throws  InvalidInput if there is no such piece or control point, or the place is not finite.
  Changed<LinkedBezier> move_control_point(int piece, int k, const Point& to) const;
  /// A piece cut in two; the curve stays.
  /// Throws  InvalidInput if t is not finite.
  Changed<LinkedBezier> add_node(double t) const;
  /// The node where a piece begins dropped: one cubic in place of two pieces, the nearest over t with their tangents.
  /// Throws  InvalidInput if there is no such piece or only two.
  Changed<LinkedBezier> remove_node(int piece) const;

  SampledSplice sample(const Interval& interval, double tolerance) const override;
  std::shared_ptr<const Representation> splice(const SampledSplice& samples, double tolerance) const override;
  std::size_t bytes_beyond(const Representation& other) const override;

 private:
  // A piece that a splice cut stays the curve that it was, bit for bit: it is kept whole, over t that it had.
  struct Stretch {
    double t = 0.0;
    double from = 0.0;  // of the whole, not after t
    double to = 0.0;
    Bezier whole{};
    int source = -1;
    void add_to(Box& box) const {
      for (int k = 0; k <= whole.degree; ++k) box.add(whole.p[static_cast<std::size_t>(k)]);
    }
    double parameter(double at) const { return std::clamp((at - from) / (to - from), 0.0, 1.0); }
  };
  static Bezier part(const Stretch& stretch, double from, double to);
  const Stretch& stretch(int index) const { return pieces_[static_cast<std::size_t>(index)]; }
  double node(int index) const { return index < size() ? stretch(index).t : 1.0; }
  /// The node at t or within rounding of it; else t.
  double snapped(double t) const;
  LinkedBezier with_pieces(SharedSequence<Stretch> pieces) const;

  SharedSequence<Stretch> pieces_;  // the first begins at 0, so none runs over it
  std::shared_ptr<const BezierContour> source_;
};

/// A closed B-spline of any degree from 1 to 5 on knots of its own.
///
/// Control point i belongs to the B-spline on knots i .. i + degree + 1, knots counted on round the curve. A corner is
/// a knot of multiplicity `degree`.
///
/// Source  [GA98] section 6.2. That all polynomials outside a splice stay, which the paper asks by pinning degree + 1
///         points of each, is the same as leaving every control point whose B-spline reaches outside as it is; the
///         others are fitted by least squares.
class LinkedSpline : public Representation {
 public:
  /// Throws  InvalidInput if the degree is not in [1, 5].
  explicit LinkedSpline(int degree = 3);

  int degree() const { return degree_; }
  /// Knots of one period, and control points.
  int size() const { return static_cast<int>(points_.size()); }
  double knot(int index) const;          ///< of any period
  Point control_point(int index) const;  ///< modulo the curve
  /// The last knot at or before t.
  int knot_at(double t) const;
  Point evaluate(double t, int derivative = 0, Side side = Side::Right) const;
  KnotVector knots() const;
  Points control_points() const;
  /// Where control point i has weight.
  Interval support(int index) const;

  /// Throws  InvalidInput if the index is out of range or the place not finite.
  Changed<LinkedSpline> move_control_point(int index, const Point& to) const;
  /// A knot more; the curve stays.
  /// Throws  InvalidInput if t is not finite or stands `degree` times already.
  LinkedSpline insert_knot(double t) const;
  /// A knot less; the control points about it are the nearest to what they were.
  /// Throws  InvalidInput if the index is out of range or too few are left.
  Changed<LinkedSpline> remove_knot(int index) const;
  /// A knot moved between its neighbours, control points as they are.
  /// Throws  InvalidInput if it would leave them.
  Changed<LinkedSpline> move_knot(int index, double to) const;

  /// What must hold exactly: the curve, or a derivative by t from one side, takes a value.
  struct Requirement {
    double t = 0.0;
    int derivative = 0;
    Side side = Side::Right;
    Point value = Point::Zero();
  };
  /// The curve that meets all requirements exactly and is nearest to the samples in least squares, by the control
  /// points whose B-splines lie in the interval.
  ///
  /// Throws  UnsatisfiableConstraints if these cannot meet them all.
  /// Source  [GA98] section 6.2: Qx = y, Ax = b.
  Changed<LinkedSpline> fitted(const SampledSplice& samples, const std::vector<Requirement>& requirements = {}) const;

  SampledSplice sample(const Interval& interval, double tolerance) const override;
  std::shared_ptr<const Representation> splice(const SampledSplice& samples, double tolerance) const override;
  std::size_t bytes_beyond(const Representation& other) const override;

 private:
  struct Entry {
    double t = 0.0;  // knot
    Point p = Point::Zero();
    void add_to(Box& box) const { box.add(p); }
  };
  Interval reach_of_knot(int index) const;  // where B-splines have weight that have the knot
  /// Entries first .. first + count - 1 (of any period) replaced by a window's, of which there is a knot for each.
  LinkedSpline with_window(int first, int count, const std::vector<double>& knots,
                           const std::vector<Point>& points) const;

  int degree_;
  SharedSequence<Entry> points_;
};

/// A closed multiresolution curve that is fine only where it needs to be.
///
/// Periodic, one quadratic B-spline of [HBS05]'s spaces across corners; or arcwise, a cubic one with ends held for
/// every arc between given corners, as [FS94] has them. Level j has `size(arc, 0)` spans doubled j times; beside the
/// coarsest level only those displacements of control points are stored that a stretch asked for, so that levels are
/// added there and nowhere else, and nothing outside a stretch changes: a displacement belongs to a stretch if its
/// whole B-spline lies in it. Details by wavelets are taken from control points of one level when asked for.
///
/// The curve's own parameter is spread evenly over arc length wherever a splice replaced it; how it runs over t is
/// recorded, piecewise linear, so that t stays shared.
///
/// Source  [GA98] section 6.3, with the sparse form it asks for; hierarchical B-splines [FB88].
class LinkedWavelet : public Representation {
 public:
  /// Arcwise between corners (two or more, ascending in [0, 1)), or periodic if there are none.
  /// Throws  InvalidInput if corners are not ascending in [0, 1), or there is one only.
  explicit LinkedWavelet(std::vector<double> corners = {});

  int arc_count() const { return static_cast<int>(arcs_.size()); }
  int arc_at(double t) const;
  Interval arc(int index) const;
  /// Orthogonal, or HeldCubic.
  Scheme scheme() const;
  /// The finest level stored anywhere on an arc.
  int finest_level(int arc) const;
  /// The finest level stored whose control points have weight at t.
  int finest_level_at(double t) const;
  /// Control points of a level.
  Eigen::Index size(int level) const;
  /// Rows of numbers stored, of all arcs and levels.
  Eigen::Index stored() const;

  /// The arc's own parameter of a level at t, as for `basis_row`, and back.
  double parameter(double t, int level) const;
  double t_of(int arc, double parameter, int level) const;
  Point evaluate(double t) const;
  /// Control points first .. first + count - 1 of a level (closed: indices modulo its size), all coarser levels and its
  /// own displacements included.
  Points control_points(int arc, int level, Eigen::Index first, Eigen::Index count) const;
  /// One arc as wavelet coefficients, seen from the coarsest level; details finer than `level` are left out.
  MultiresCurve multires(int arc, int level) const;

  /// Control points of a level displaced; finer ones ride along.
  /// Throws  InvalidInput if they are out of range or not finite.
  Changed<LinkedWavelet> displace(int arc, int level, Eigen::Index first, const Points& displacements) const;
  /// Direct manipulation: the curve's point at t moves by `move`, with a broad pull at the whole level below and a
  /// narrow one at the next, mixed by the square of the fraction. Ends of arcs do not take part. Throws  InvalidInput
  /// if the level is negative, t or the move is not finite, or nothing that may move has weight at
  ///         t: the end of an arc.
  /// Source  [FS94] editing at fractional levels.
  Changed<LinkedWavelet> pull(double t, double level, const Point& move) const;
  /// The fractional level at which `pull` moves about `breadth` of arc length.
  double level_of_breadth(double t, double breadth) const;

  SampledSplice sample(const Interval& interval, double tolerance) const override;
  std::shared_ptr<const Representation> splice(const SampledSplice& samples, double tolerance) const override;
  std::size_t bytes_beyond(const Representation& other) const override;

 private:
  struct Displacement {
    double t = 0.0;  // index of the control point
    Point p = Point::Zero();
    void add_to(Box& box) const { box.add(p); }
  };
  // Where the course over t turns. It runs on from here on a line of its own, which a cut does not change by a bit.
  struct Breakpoint {
    double t = 0.0;                // unwrapped from the arc's start
    double spans = 0.0;            // of level 0, from the arc's start
    std::array<double, 2> from{};  // t and spans where the line begins, not after the breakpoint
    std::array<double, 2> to{};    // and ends
    void add_to(Box& /*box*/) const {}
  };
  struct Arc {
    Interval interval;
    SharedSequence<Breakpoint> course;                 // from 0 spans to all
    std::vector<SharedSequence<Displacement>> levels;  // level 0 whole, further ones where needed
  };
  struct Fit;

  std::vector<Arc> arcs_;
};

}  // namespace fontcore
