#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

namespace fontcore {

using Point = Eigen::Vector2d;
using Points = Eigen::Matrix<double, Eigen::Dynamic, 2>;  ///< one point per row

/// Twice the signed area of the triangle of two directions: positive if b lies to the left of a.
inline double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }
/// From one direction to another, in [-pi, pi], positive to the left.
inline double angle(const Point& a, const Point& b) { return std::atan2(cross(a, b), a.dot(b)); }
/// A direction turned to the left by a right angle.
inline Point left_of(const Point& direction) { return {-direction.y(), direction.x()}; }

/// What a point of a contour is. An implied node is the midpoint of the two quadratic handles beside it, not a point of
/// its own (TrueType): it is listed so that every segment has its ends, and it follows its handles.
enum class PointKind : std::uint8_t { Node, ImpliedNode, Quadratic, Cubic };

constexpr bool is_node(PointKind kind) { return kind == PointKind::Node || kind == PointKind::ImpliedNode; }

/// One line (degree 1), quadratic (2) or cubic (3): `degree + 1` control points.
struct Bezier {
  std::array<Point, 4> p{Point::Zero(), Point::Zero(), Point::Zero(), Point::Zero()};
  int degree = 1;

  const Point& start() const { return p[0]; }
  const Point& end() const { return p[static_cast<std::size_t>(degree)]; }
};

/// Bernstein weights of the `degree + 1` control points at u; the others are 0.
std::array<double, 4> bernstein(int degree, double u);
Point evaluate(const Bezier& bezier, double u);
inline Point derivative(const Bezier& bezier, double u) {
  const double v = 1.0 - u;
  const auto& p = bezier.p;
  switch (bezier.degree) {
    case 1:
      return p[1] - p[0];
    case 2:
      return 2.0 * (v * (p[1] - p[0]) + u * (p[2] - p[1]));
    default:
      return 3.0 * (v * v * (p[1] - p[0]) + 2.0 * u * v * (p[2] - p[1]) + u * u * (p[3] - p[2]));
  }
}
/// The two parts before and after u, by de Casteljau; their common end is the same point, bit for bit. Coordinates
/// that all control points share stay as they are.
std::array<Bezier, 2> split(const Bezier& bezier, double u);
/// Unit tangent at an end, from the first control point that differs from it; zero if none does.
Point start_tangent(const Bezier& bezier);
Point end_tangent(const Bezier& bezier);
/// True if all control points are the same point.
bool is_degenerate(const Bezier& bezier);

/// An affine map x -> linear x + shift.
struct Affine {
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Point shift = Point::Zero();

  Point operator()(const Point& x) const { return linear * x + shift; }
};

/// A closed contour of lines, quadratics and cubics; neighbouring segments share their end point exactly.
///
/// Every point stands once, in the order of the font, as a cyclic list: nodes, and between them no handle (a line), one
/// quadratic handle or two cubic ones. The list may begin with a handle; segments are counted from the first node.
class BezierContour {
 public:
  BezierContour() = default;

  /// Shape   points n×2, kinds n, n >= 1.
  /// Throws  InvalidInput, naming the point, if the handles between two nodes form no segment, if there is no node, or
  ///         if a coordinate is not finite.
  BezierContour(Points points, std::vector<PointKind> kinds);

  const Points& points() const { return points_; }
  const std::vector<PointKind>& kinds() const { return structure().kinds; }
  Eigen::Index point_count() const { return points_.rows(); }
  Point point(int index) const { return points_.row(index).transpose(); }
  PointKind kind(int index) const { return kinds()[static_cast<std::size_t>(index)]; }

  int segment_count() const { return static_cast<int>(structure().first.size()); }
  int degree(int segment) const { return structure().degree[static_cast<std::size_t>(segment)]; }
  /// Index of control point k (0 to degree) of a segment; the last is the first of the next segment.
  int point_of(int segment, int k) const {
    const int index = node(segment) + k;
    const int n = static_cast<int>(points_.rows());
    return index < n ? index : index - n;
  }
  /// The start node of a segment.
  int node(int segment) const { return structure().first[static_cast<std::size_t>(segment)]; }
  Bezier segment(int index) const {
    Bezier bezier;
    bezier.degree = degree(index);
    for (int k = 0; k <= bezier.degree; ++k) bezier.p[static_cast<std::size_t>(k)] = point(point_of(index, k));
    return bezier;
  }
  int previous(int segment) const { return segment == 0 ? segment_count() - 1 : segment - 1; }
  int next(int segment) const { return segment + 1 == segment_count() ? 0 : segment + 1; }

  /// The same structure with other coordinates.
  /// Throws  InvalidInput if the shape differs or a coordinate is not finite.
  BezierContour with_points(Points points) const;
  /// Throws  InvalidInput if a coordinate is not finite.
  void set_point(int index, const Point& to);

  friend bool has_same_structure(const BezierContour& a, const BezierContour& b);

 private:
  struct Structure {
    std::vector<PointKind> kinds;
    std::vector<int> first;   // start node of every segment
    std::vector<int> degree;  // degree of every segment
  };
  static const Structure empty;
  const Structure& structure() const { return structure_ ? *structure_ : empty; }

  Points points_;
  std::shared_ptr<const Structure> structure_;  // never changed: contours moved from one another share it
};

/// Whether two contours have the same kinds of points in the same order.
bool has_same_structure(const BezierContour& a, const BezierContour& b);
bool has_same_structure(const std::vector<BezierContour>& a, const std::vector<BezierContour>& b);

/// Bit for bit the same points and kinds.
bool operator==(const BezierContour& a, const BezierContour& b);

/// Of all contours together.
int segment_count(const std::vector<BezierContour>& contours);

/// How many segments of two contours of one structure are the same, bit for bit.
int equal_segments(const BezierContour& a, const BezierContour& b);

/// The contour of a TrueType point list: on-curve points and quadratic handles, implied nodes added between two
/// handles. The order is kept, so dropping the implied nodes gives the list back.
///
/// Shape   points n×2, on_curve n, n >= 1.
BezierContour from_quadratic_points(const Points& points, const std::vector<bool>& on_curve);

/// Every point mapped. Implied nodes stay midpoints.
BezierContour transform(const BezierContour& contour, const Affine& map);
/// The same outline run the other way, from the same start point.
BezierContour reverse(const BezierContour& contour);
/// The closed polyline through points at most `step` of control polygon length apart, nodes included; its last point
/// is not the first again.
Points to_polyline(const BezierContour& contour, double step);

}  // namespace fontcore
