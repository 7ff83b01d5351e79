#pragma once

#include <vector>

#include "fontcore/contour.h"
#include "fontcore/inline_vector.h"
#include "fontcore/measure.h"
#include "fontcore/wavelet.h"

namespace fontcore {

/// How the spline of an outline is chosen.
struct OutlineCurveOptions {
  double tolerance = 0.25;         ///< two-sided distance allowed between outline and spline, font units
  int fewest = 64;                 ///< control points at least: an edit needs levels
  int most = 4096;                 ///< and at most
  double corner_angle = 0.139626;  ///< between curves a sharper turn is a corner, radians (8 degrees)
  double line_angle = 0.017453;    ///< and beside a line, radians (1 degree): its control points lie on the line
  std::vector<int> corners;  ///< points of the contour that are corners however little they turn; no implied nodes
};

/// A contour cut at its corners into arcs, and the arc length along them: what the outline's own parameter is made of.
///
/// An arc runs from corner to corner; a contour without corners is one arc, from the first node that lies on a knot.
/// Segments of no length belong to none.
///
/// Units   font units; s in arc length from the first arc's start.
class OutlineArcs {
 public:
  /// Of the options those that say what is a corner.
  /// Throws  InvalidInput with the numbers if the contour has fewer than 3 points or no area or length.
  explicit OutlineArcs(const BezierContour& contour, const OutlineCurveOptions& options = {});

  /// A stretch between nodes that lie on knots: the font's own, extrema and the ends of lines.
  struct Span {
    int first = 0;  ///< of the arc's segments
    int count = 0;
    double length = 0.0;
    bool is_line = false;
  };
  struct Arc {
    double start = 0.0;  ///< arc length from the first arc's start
    double length = 0.0;
    InlineVector<int, 4> segments;    ///< with length, in order
    InlineVector<double, 4> offsets;  ///< arc length within the arc where each of them starts
    InlineVector<Span, 4> spans;

    bool is_line() const { return spans.size() == 1 && spans[0].is_line; }
  };
  /// A place on the outline: a segment and its u.
  struct Location {
    int segment = 0;
    double u = 0.0;
  };

  const BezierContour& contour() const { return contour_; }
  const std::vector<Arc>& arcs() const { return arcs_; }
  double length() const { return length_; }
  bool has_corner() const { return has_corner_; }
  /// Whether a segment starts at a corner.
  bool is_corner(int segment) const { return is_corner_[static_cast<std::size_t>(segment)]; }
  /// Whether every arc is a single line.
  bool is_straight() const;
  const ArcLength& along(int segment) const { return along_[static_cast<std::size_t>(segment)]; }
  /// The arc that a segment belongs to, and the arc length within it where it starts; one of no length counts to where
  /// the next one with length does.
  int arc_of(int segment) const { return arc_of_[static_cast<std::size_t>(segment)]; }
  double offset_of(int segment) const { return offset_of_[static_cast<std::size_t>(segment)]; }
  /// The place at an arc length from the start of an arc; round a contour without corners.
  Location locate(int arc, double s) const;
  /// The place at an arc length from the first arc's start, modulo the whole length.
  Location locate(double s) const;

 private:
  BezierContour contour_;
  std::vector<Arc> arcs_;
  bool has_corner_ = false;
  double length_ = 0.0;
  std::vector<ArcLength> along_;   // per segment
  std::vector<bool> is_corner_;    // per segment
  std::vector<int> arc_of_;        // per segment
  std::vector<double> offset_of_;  // per segment
};

/// A contour and a uniform periodic quadratic B-spline over one parameter, within a measured distance of each other.
///
/// The N = D * 2^n control points x_i (D from 4 to 7) make pieces (x_{i-1} + x_i)/2, x_i, (x_i + x_{i+1})/2 over t in
/// [i - 1/2, i + 1/2]. A corner is a pair of equal neighbouring control points. Corners, line ends, the font's own
/// nodes and extrema lie on knots t = i + 1/2, and control points of straight runs on their line. Along an arc (corner
/// to corner, or the whole contour) the arc length of outline(t) is itself a quadratic B-spline of the same knots and
/// corners: its coefficients put the nodes on the knots and vary least between. So outline(t) has zero speed at corners
/// and continuous speed at smooth joins, like the spline; the two differ by the small residual.
///
/// Units   font units; t in spans of the finest level, modulo N.
/// Source  DESIGN decisions 1 and 2: a displacement D(t) edits the outline as outline(t) + D(t).
class OutlineCurve {
 public:
  /// Throws  InvalidInput with the numbers if the contour has fewer than 3 points or no area or length, or if no spline
  ///         of up to `most` control points is within the tolerance.
  explicit OutlineCurve(const BezierContour& contour, const OutlineCurveOptions& options = {});

  const BezierContour& contour() const { return outline_.contour(); }
  const OutlineArcs& outline() const { return outline_; }
  const Points& control_points() const { return control_points_; }
  int size() const { return static_cast<int>(control_points_.rows()); }
  /// How often the number of control points can be halved down to D: the finest level.
  int levels() const;
  /// Measured two-sided distance between outline and spline, font units.
  double distance() const { return distance_; }
  double length() const { return outline_.length(); }

  /// A node as the model sees it: where it lies on the parameter, and whether it is a corner.
  struct Node {
    double t = 0.0;
    bool is_corner = false;
    bool is_knot = false;  ///< t = i + 1/2 by construction
  };
  /// One for every segment: its start node.
  const std::vector<Node>& nodes() const { return nodes_; }
  /// Indices i of the corner pairs (x_i, x_{i+1}), sorted.
  const std::vector<int>& corner_pairs() const { return corner_pairs_; }

  /// Parameter t of the point at u of a segment, in [0, N).
  double parameter(int segment, double u) const;
  /// Segment and its u at parameter t.
  using Location = OutlineArcs::Location;
  Location locate(double t) const;
  Point outline_at(double t) const;
  Point spline_at(double t) const;
  /// An arc of the outline: corner to corner, or the whole contour if it has none.
  struct ArcRange {
    int first = 0;       ///< of its control points, over t in [first - 1/2, first + size - 1/2]
    int size = 0;        ///< number of them
    int segment = 0;     ///< of the outline, that it starts with
    double start = 0.0;  ///< arc length from the first arc's start
    double length = 0.0;
  };
  std::vector<ArcRange> arcs() const;
  /// The arc at parameter t, and the arc length from its start.
  std::pair<int, double> along(double t) const;
  /// Arc length of the outline from t0 forward to t1 > t0.
  double arc_length(double t0, double t1) const;

 private:
  // Control points first .. first + size - 1, over t in [first - 1/2, first + size - 1/2].
  struct Arc {
    int index = 0;  // of the outline's arcs
    int first = 0;
    int size = 0;
    double length = 0.0;
    double start = 0.0;
  };

  double fit(int size, double tolerance);
  void place_nodes(const std::vector<int>& pieces, const std::vector<std::vector<bool>>& knot_kept);
  double coefficient(const Arc& arc, int k) const;
  double arc_length_in(const Arc& arc, double t) const;
  double parameter_in(const Arc& arc, double s) const;
  const Arc& arc_at(double t) const;
  double measure_distance(double tolerance) const;

  OutlineArcs outline_;
  Points control_points_;
  Eigen::VectorXd arc_length_coefficients_;
  std::vector<Arc> arcs_;
  std::vector<Node> nodes_;
  std::vector<int> corner_pairs_;
  double distance_ = 0.0;
};

}  // namespace fontcore
