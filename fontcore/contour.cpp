#include "fontcore/contour.h"

#include <algorithm>
#include <cmath>

#include "fontcore/error.h"

namespace fontcore {

std::array<double, 4> bernstein(int degree, double u) {
  const double v = 1.0 - u;
  switch (degree) {
    case 1:
      return {v, u, 0.0, 0.0};
    case 2:
      return {v * v, 2.0 * u * v, u * u, 0.0};
    case 3:
      return {v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u};
    default:
      throw InvalidInput(text("bernstein: degree ", degree, " is not 1, 2 or 3"));
  }
}

Point evaluate(const Bezier& bezier, double u) {
  const auto weight = bernstein(bezier.degree, u);
  Point sum = Point::Zero();
  for (std::size_t k = 0; k <= static_cast<std::size_t>(bezier.degree); ++k) sum += weight[k] * bezier.p[k];
  return sum;
}

std::array<Bezier, 2> split(const Bezier& bezier, double u) {
  std::array<Bezier, 2> part;
  part[0].degree = part[1].degree = bezier.degree;
  const auto n = static_cast<std::size_t>(bezier.degree);
  std::array<Point, 4> q = bezier.p;
  for (std::size_t level = 0; level <= n; ++level) {
    part[0].p[level] = q[0];
    part[1].p[n - level] = q[n - level];
    for (std::size_t k = 0; k + level < n; ++k) {
      const Point between = (1.0 - u) * q[k] + u * q[k + 1];
      q[k] = (q[k].array() == q[k + 1].array()).select(q[k], between);
    }
  }
  return part;
}

Point start_tangent(const Bezier& bezier) {
  for (std::size_t k = 1; k <= static_cast<std::size_t>(bezier.degree); ++k) {
    const Point d = bezier.p[k] - bezier.p[0];
    if (d != Point::Zero()) return d.normalized();
  }
  return Point::Zero();
}

Point end_tangent(const Bezier& bezier) {
  for (auto k = static_cast<std::size_t>(bezier.degree); k-- > 0;) {
    const Point d = bezier.end() - bezier.p[k];
    if (d != Point::Zero()) return d.normalized();
  }
  return Point::Zero();
}

bool is_degenerate(const Bezier& bezier) {
  for (std::size_t k = 1; k <= static_cast<std::size_t>(bezier.degree); ++k) {
    if (bezier.p[k] != bezier.p[0]) return false;
  }
  return true;
}

namespace {

void require_finite(const Points& points) {
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    if (!points.row(i).allFinite()) throw InvalidInput(text("BezierContour: point ", i, " is not finite"));
  }
}

}  // namespace

const BezierContour::Structure BezierContour::empty;

BezierContour::BezierContour(Points points, std::vector<PointKind> kinds) : points_(std::move(points)) {
  const int n = static_cast<int>(kinds.size());
  if (n == 0 || points_.rows() != n) {
    throw InvalidInput(text("BezierContour: ", points_.rows(), " points but ", n, " kinds"));
  }
  require_finite(points_);
  Structure made{std::move(kinds), {}, {}};
  const auto kind_of = [&](int i) { return made.kinds[static_cast<std::size_t>(i)]; };
  std::vector<int>& first = made.first;
  first.reserve(static_cast<std::size_t>(std::ranges::count_if(made.kinds, is_node)));
  for (int i = 0; i < n; ++i) {
    if (is_node(kind_of(i))) first.push_back(i);
  }
  if (first.empty()) throw InvalidInput(text("BezierContour: no node among ", n, " points"));
  made.degree.reserve(first.size());
  for (std::size_t s = 0; s < first.size(); ++s) {
    const int from = first[s];
    const int to = s + 1 < first.size() ? first[s + 1] : first[0] + n;
    const int degree = to - from;
    bool fits = degree <= 3;
    for (int k = from + 1; fits && k < to; ++k)
      fits = kind_of(k % n) == (degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    if (!fits)
      throw InvalidInput(text("BezierContour: ", degree - 1, " handles after point ", from, " form no segment"));
    made.degree.push_back(degree);
  }
  structure_ = std::make_shared<const Structure>(std::move(made));
}

BezierContour BezierContour::with_points(Points points) const {
  if (points.rows() != points_.rows()) {
    throw InvalidInput(text("with_points: ", points.rows(), " points for a contour of ", points_.rows()));
  }
  require_finite(points);
  BezierContour moved;
  moved.points_ = std::move(points);
  moved.structure_ = structure_;
  return moved;
}

void BezierContour::set_point(int index, const Point& to) {
  if (!to.allFinite()) throw InvalidInput(text("set_point: point ", index, " is not finite"));
  points_.row(index) = to.transpose();
}

bool has_same_structure(const BezierContour& a, const BezierContour& b) {
  return a.structure_ == b.structure_ || a.kinds() == b.kinds();
}

bool has_same_structure(const std::vector<BezierContour>& a, const std::vector<BezierContour>& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) { return has_same_structure(x, y); });
}

bool operator==(const BezierContour& a, const BezierContour& b) {
  return has_same_structure(a, b) && a.points() == b.points();
}

int segment_count(const std::vector<BezierContour>& contours) {
  int count = 0;
  for (const BezierContour& contour : contours) count += contour.segment_count();
  return count;
}

int equal_segments(const BezierContour& a, const BezierContour& b) {
  if (!has_same_structure(a, b)) throw InvalidInput("equal_segments: the contours differ in structure");
  int equal = 0;
  for (int s = 0; s < a.segment_count(); ++s) {
    bool same = true;
    for (int k = 0; same && k <= a.degree(s); ++k) same = a.point(a.point_of(s, k)) == b.point(b.point_of(s, k));
    equal += same ? 1 : 0;
  }
  return equal;
}

BezierContour from_quadratic_points(const Points& points, const std::vector<bool>& on_curve) {
  const auto n = static_cast<Eigen::Index>(on_curve.size());
  std::vector<PointKind> kinds;
  std::vector<Point> list;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index j = (i + 1) % n;
    list.emplace_back(points.row(i));
    kinds.push_back(on_curve[static_cast<std::size_t>(i)] ? PointKind::Node : PointKind::Quadratic);
    if (!on_curve[static_cast<std::size_t>(i)] && !on_curve[static_cast<std::size_t>(j)]) {
      list.emplace_back(0.5 * (points.row(i) + points.row(j)));
      kinds.push_back(PointKind::ImpliedNode);
    }
  }
  Points all(static_cast<Eigen::Index>(list.size()), 2);
  for (Eigen::Index i = 0; i < all.rows(); ++i) all.row(i) = list[static_cast<std::size_t>(i)];
  return {std::move(all), std::move(kinds)};
}

BezierContour transform(const BezierContour& contour, const Affine& map) {
  Points moved = (contour.points() * map.linear.transpose()).rowwise() + map.shift.transpose();
  return contour.with_points(std::move(moved));
}

BezierContour reverse(const BezierContour& contour) {
  const Eigen::Index n = contour.point_count();
  Points points(n, 2);
  std::vector<PointKind> kinds(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index j = (n - i) % n;
    points.row(i) = contour.points().row(j);
    kinds[static_cast<std::size_t>(i)] = contour.kind(static_cast<int>(j));
  }
  return {std::move(points), std::move(kinds)};
}

Points to_polyline(const BezierContour& contour, double step) {
  if (!(step > 0.0)) throw InvalidInput(text("to_polyline: step ", step, " is not positive"));
  std::vector<Point> list;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = contour.segment(s);
    double polygon = 0.0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(bezier.degree); ++k)
      polygon += (bezier.p[k + 1] - bezier.p[k]).norm();
    const int pieces = std::max(1, static_cast<int>(std::ceil(polygon / step)));
    for (int k = 0; k < pieces; ++k) list.push_back(evaluate(bezier, static_cast<double>(k) / pieces));
  }
  Points polyline(static_cast<Eigen::Index>(list.size()), 2);
  for (Eigen::Index i = 0; i < polyline.rows(); ++i) polyline.row(i) = list[static_cast<std::size_t>(i)];
  return polyline;
}

}  // namespace fontcore
