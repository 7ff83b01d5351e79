#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// A term weight * cross(p_i, p_j) of the area that a segment sweeps seen from the origin.
struct AreaTerm {
  std::size_t i, j;
  double weight;
};
/// All of them for a segment of degree 1, 2 or 3: the area is bilinear in the x and the y of its control points.
/// Source  Green's theorem on Bernstein polynomials; [HBS05] eq. 9.
std::span<const AreaTerm> area_terms(int degree);

/// Exact signed area that a segment sweeps seen from the origin; summed over a contour, its enclosed area.
/// Source  Green's theorem on Bernstein polynomials; [HBS05] eq. 9.
double signed_area(const Bezier& bezier);

/// Exact signed area, positive counter-clockwise. A sum of cross products of points, so quadratic in every
/// displacement.
///
/// Exact   to rounding; taken about the contour's first point, so that it does not depend on where the contour lies.
double signed_area(const BezierContour& contour);
/// Whether there is anything to model: three points or more, and an area that is not 0.
bool has_inside(const BezierContour& contour);
double signed_area(const std::vector<BezierContour>& contours);

/// Area and moments of what contours enclose, about the origin: integrals of 1, of x and y, and of xx, xy and yy.
struct Moments {
  double area = 0.0;                                 ///< square font units
  Point first = Point::Zero();                       ///< font units to the third
  Eigen::Vector3d second = Eigen::Vector3d::Zero();  ///< xx, xy, yy; font units to the fourth

  Moments& operator+=(const Moments& other);
  /// Point of balance; not finite if the area is 0.
  Point centroid() const { return first / area; }
  /// The same region's, seen from another origin.
  Moments about(const Point& origin) const;
};
inline Moments operator*(double factor, const Moments& moments) {
  return {factor * moments.area, factor * moments.first, factor * moments.second};
}

/// Exact moments, with the sign of the area.
///
/// Exact   to rounding: Gauss-Legendre rules that integrate polynomials of these degrees exactly, taken about the
///         contour's first point.
/// Source  Green's theorem: the integral of a form f of degree n is that of f(p) cross(p, dp) / (n + 2) round the edge.
Moments moments(const BezierContour& contour);

/// Gradient of the signed area with respect to every point; implied nodes count as points of their own.
///
/// Shape   n×2 like the contour's points.
/// Units   font units: a length.
Points area_gradient(const BezierContour& contour);

/// Gradient of the length with respect to every point; implied nodes count as points of their own.
///
/// Shape   n×2 like the contour's points.
/// Exact   lines; curves by eight Gauss points each, 1e-6 and better where a segment turns by less than a right angle.
Points length_gradient(const BezierContour& contour);

/// Area enclosed by the uniform quadratic B-spline with these control points.
/// Source  [HBS05] eq. 9 to 11 at the finest level: 2A = sum x_i (5/6 (y_{i+1} - y_{i-1}) + 1/12 (y_{i+2} - y_{i-2})).
double limit_area(const Points& control_points);

/// Arc length of a segment.
/// Exact   relative error below 1e-10 but at cusps, by Gauss-Legendre quadrature on halves until two agree.
double length(const Bezier& bezier);
double length(const BezierContour& contour);

/// An axis-parallel box; empty until something is added.
struct Box {
  Point low = Point::Constant(std::numeric_limits<double>::infinity());
  Point high = Point::Constant(-std::numeric_limits<double>::infinity());

  bool is_empty() const { return !(low.x() <= high.x()); }
  void add(const Point& point);
  void add(const Box& box);
};
/// Whether two boxes share a point.
bool overlap(const Box& a, const Box& b);
/// Box of points, and of all that is no farther from them along an axis than the margin.
Box box_around(const Points& points, double margin = 0.0);
/// Box of all control points.
Box control_box(const Bezier& bezier);
Box control_box(const BezierContour& contour);
Box control_box(const std::vector<BezierContour>& contours);
/// Box of the curve itself.
Box tight_box(const Bezier& bezier);
Box tight_box(const BezierContour& contour);
Box tight_box(const std::vector<BezierContour>& contours);

/// Parameters strictly inside (0, 1) where a coordinate (axis 0: x, 1: y) is stationary, sorted.
std::vector<double> extrema(const Bezier& bezier, int axis);

/// Angle turned at the start node of a segment, in [-pi, pi], positive to the left; 0 beside a segment of no length
/// only if no neighbour with length is left. Segments of no length are passed over.
///
/// Shape   one angle a segment.
std::vector<double> turning_angles(const BezierContour& contour);

/// Arc length along one segment as a table with exact ends: s(u) and its inverse.
///
/// Exact   s at the table's nodes as `length`; between them, and the inverse by Newton, to 1e-10 of the length, 1e-8
///         beside a cusp.
class ArcLength {
 public:
  explicit ArcLength(const Bezier& bezier);
  double length() const { return s_[intervals_]; }
  double at(double u) const;       ///< s of u
  double inverse(double s) const;  ///< u of s; s is clamped to [0, length]

 private:
  static constexpr std::size_t most_intervals = 16;

  Bezier bezier_;
  std::size_t intervals_ = 1;                       // of u, of equal size; a line is one
  std::array<double, most_intervals + 1> s_{};      // at their ends
  std::array<double, most_intervals + 1> speed_{};  // ds/du there
};

/// Largest distance of a point of one closed polyline from the other, in both directions (Hausdorff), point to segment.
///
/// Exact   for the vertices given; sample finely. If `give_up_above` is met, the search ends early with a larger value.
double two_sided_distance(const Points& a, const Points& b,
                          double give_up_above = std::numeric_limits<double>::infinity());

/// The point of two contours that is farthest from the other one.
///
/// Exact   the distance, to twice the accuracy; it is taken between polylines within the accuracy of the curves.
/// Throws  InvalidInput if the accuracy is not positive.
struct Farthest {
  double distance = 0.0;  ///< font units
  Point where = Point::Zero();
};
Farthest farthest(const BezierContour& a, const BezierContour& b, double accuracy);

/// The two-sided distance of two contours of one structure that lie close to each other: of every segment from that of
/// the other contour and its neighbours.
///
/// Exact   never too small at the places it looks at: the ends of lines, 16 places of a curve. Too large only where the
///         outline comes nearer to other parts of itself than that.
/// Throws  InvalidInput if the contours have not the same structure.
double two_sided_distance(const BezierContour& a, const BezierContour& b);

/// The point of a contour nearest to a place; the first in segment order if several are equally near.
///
/// Exact   u to 1e-8 where the distance has one minimum between samples 1/32 apart.
struct NearestPoint {
  int segment = 0;
  double u = 0.0;
  double distance = 0.0;
};
NearestPoint nearest_point(const BezierContour& contour, const Point& place);

}  // namespace fontcore
