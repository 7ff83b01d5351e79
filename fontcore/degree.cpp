#include "fontcore/degree.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "fontcore/error.h"

namespace fontcore {

namespace {

/// A point list as it grows.
class PointList {
 public:
  void add(const Point& point, PointKind kind) {
    list_.push_back(point);
    kinds_.push_back(kind);
  }
  BezierContour contour() const {
    Points points(static_cast<Eigen::Index>(list_.size()), 2);
    for (std::size_t i = 0; i < list_.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list_[i].transpose();
    return {std::move(points), kinds_};
  }

 private:
  std::vector<Point> list_;
  std::vector<PointKind> kinds_;
};

std::vector<Bezier> cut_evenly(const Bezier& cubic, int count) {
  std::vector<Bezier> pieces;
  Bezier rest = cubic;
  for (int left = count; left > 1; --left) {
    const auto parts = split(rest, 1.0 / left);
    pieces.push_back(parts[0]);
    rest = parts[1];
  }
  pieces.push_back(rest);
  return pieces;
}

/// The control point of a quadratic with a cubic's ends: where its end tangents meet, if that is between them and the
/// quadratic stays within the distance; else the mean one, of which that is known.
Point control_within(const Bezier& cubic, double distance) {
  const Point from = start_tangent(cubic);
  const Point to = end_tangent(cubic);
  const double turn = from.x() * to.y() - from.y() * to.x();
  const Point chord = cubic.end() - cubic.start();
  const double along = chord.x() * to.y() - chord.y() * to.x();
  const double back = from.x() * chord.y() - from.y() * chord.x();
  if (along * turn > 0.0 && back * turn > 0.0) {
    const Point meeting = cubic.start() + along / turn * from;
    // Two Bezier curves are at most three quarters of their largest inner control vector apart.
    const Point first = (cubic.start() + 2.0 * meeting) / 3.0 - cubic.p[1];
    const Point second = (cubic.end() + 2.0 * meeting) / 3.0 - cubic.p[2];
    if (0.75 * std::max(first.norm(), second.norm()) <= distance) return meeting;
  }
  return 0.75 * (cubic.p[1] + cubic.p[2]) - 0.25 * (cubic.start() + cubic.end());
}

}  // namespace

BezierContour raised_to_cubics(const BezierContour& contour) {
  PointList list;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier b = contour.segment(s);
    list.add(b.start(), PointKind::Node);
    if (b.degree == 2) {
      constexpr double third = 1.0 / 3.0;
      list.add(third * b.p[0] + 2 * third * b.p[1], PointKind::Cubic);
      list.add(third * b.p[2] + 2 * third * b.p[1], PointKind::Cubic);
    } else {
      for (int k = 1; k < b.degree; ++k) list.add(b.p[static_cast<std::size_t>(k)], PointKind::Cubic);
    }
  }
  return list.contour();
}

BezierContour lowered_to_quadratics(const BezierContour& contour, double distance, bool is_whole) {
  if (!(distance > 0.0)) throw InvalidInput(text("lowered_to_quadratics: the distance is ", distance));
  const auto placed = [&](const Point& p) { return is_whole ? Point((p.array() + 0.5).floor()) : p; };
  PointList list;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier b = contour.segment(s);
    list.add(placed(b.start()), PointKind::Node);
    if (b.degree == 2) list.add(placed(b.p[1]), PointKind::Quadratic);
    if (b.degree != 3) continue;
    const double bend = (b.p[3] - 3.0 * b.p[2] + 3.0 * b.p[1] - b.p[0]).norm();
    constexpr double most = 64.0;
    const double count = std::ceil(std::cbrt(std::sqrt(3.0) / 36.0 * bend / distance));
    bool is_inner = false;
    for (const Bezier& piece : cut_evenly(b, static_cast<int>(std::clamp(count, 1.0, most)))) {
      if (is_inner) list.add(placed(piece.start()), PointKind::Node);
      list.add(placed(control_within(piece, distance)), PointKind::Quadratic);
      is_inner = true;
    }
  }
  return list.contour();
}

}  // namespace fontcore
