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
  const double turn = cross(from, to);
  const Point chord = cubic.end() - cubic.start();
  const double along = cross(chord, to);
  const double back = cross(from, chord);
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

std::vector<Bezier> lowered_to_quadratics(const Bezier& cubic, double distance) {
  const double bend = (cubic.p[3] - 3.0 * cubic.p[2] + 3.0 * cubic.p[1] - cubic.p[0]).norm();
  constexpr double most = 64.0;
  const double count = std::ceil(std::cbrt(std::sqrt(3.0) / 36.0 * bend / distance));
  std::vector<Bezier> pieces;
  for (const Bezier& piece : cut_evenly(cubic, static_cast<int>(std::clamp(count, 1.0, most)))) {
    pieces.push_back({{piece.start(), control_within(piece, distance), piece.end(), Point::Zero()}, 2});
  }
  return pieces;
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
    bool is_inner = false;
    for (const Bezier& piece : lowered_to_quadratics(b, distance)) {
      if (is_inner) list.add(placed(piece.start()), PointKind::Node);
      list.add(placed(piece.p[1]), PointKind::Quadratic);
      is_inner = true;
    }
  }
  return list.contour();
}

BezierContour with_implied_nodes(const BezierContour& contour, double distance) {
  std::vector<PointKind> kinds = contour.kinds();
  Points points = contour.points();
  const auto n = static_cast<int>(kinds.size());
  for (int i = 0; i < n; ++i) {
    const int before = (i + n - 1) % n;
    const int after = (i + 1) % n;
    if (!is_node(contour.kind(i)) || contour.kind(before) != PointKind::Quadratic ||
        contour.kind(after) != PointKind::Quadratic) {
      continue;
    }
    const Point middle = 0.5 * (contour.point(before) + contour.point(after));
    // The first stays the first, but where it is the middle already.
    if ((contour.point(i) - middle).norm() > (i == 0 ? 0.0 : distance)) continue;
    points.row(i) = middle.transpose();
    kinds[static_cast<std::size_t>(i)] = PointKind::ImpliedNode;
  }
  // The list begins with a point that is one: the next node, or with none a handle.
  if (n > 0 && kinds[0] == PointKind::ImpliedNode) {
    const auto node = std::ranges::find(kinds, PointKind::Node);
    const auto first = node == kinds.end() ? 1 : static_cast<int>(node - kinds.begin());
    std::rotate(kinds.begin(), kinds.begin() + first, kinds.end());
    Points rotated(n, 2);
    rotated << points.bottomRows(n - first), points.topRows(first);
    points = std::move(rotated);
  }
  return {std::move(points), std::move(kinds)};
}

BezierContour without_short_segments(const BezierContour& contour, double length, const std::vector<bool>& stays) {
  if (static_cast<Eigen::Index>(stays.size()) != contour.point_count()) {
    throw InvalidInput(text("without_short_segments: ", stays.size(), " marks for ", contour.point_count(), " points"));
  }
  struct Piece {
    Bezier curve;
    bool holds_start;
    bool holds_end;
  };
  std::vector<Piece> pieces;
  for (int s = 0; s < contour.segment_count(); ++s) {
    pieces.push_back({contour.segment(s), stays[static_cast<std::size_t>(contour.point_of(s, 0))],
                      stays[static_cast<std::size_t>(contour.point_of(s, contour.degree(s)))]});
  }
  const auto end_of = [](Bezier& b) -> Point& { return b.p[static_cast<std::size_t>(b.degree)]; };
  for (std::size_t k = 0; k < pieces.size() && pieces.size() > 3;) {
    const auto& [curve, holds_start, holds_end] = pieces[k];
    if ((curve.end() - curve.start()).norm() >= length || (holds_start && holds_end)) {
      ++k;
      continue;
    }
    const Point one = holds_start ? curve.start()
                      : holds_end ? curve.end()
                                  : Point(0.5 * (curve.start() + curve.end()));
    const bool holds = holds_start || holds_end;
    Piece& before = pieces[k == 0 ? pieces.size() - 1 : k - 1];
    Piece& after = pieces[k + 1 == pieces.size() ? 0 : k + 1];
    end_of(before.curve) = one;
    after.curve.p[0] = one;
    before.holds_end = after.holds_start = holds;
    pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(k));
  }
  PointList list;
  for (const Piece& piece : pieces) {
    const Bezier& b = piece.curve;
    list.add(b.start(), PointKind::Node);
    for (int i = 1; i < b.degree; ++i) {
      list.add(b.p[static_cast<std::size_t>(i)], b.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
  }
  return list.contour();
}

BezierContour straightened(const BezierContour& contour, const std::vector<bool>& stays) {
  if (static_cast<Eigen::Index>(stays.size()) != contour.point_count()) {
    throw InvalidInput(text("straightened: ", stays.size(), " marks for ", contour.point_count(), " points"));
  }
  constexpr double most_turned_back = 2.0;
  const auto is_on_line = [](const Point& a, const Point& b, const Point& p) {
    const Point d = b - a;
    const Point e = p - a;
    return cross(d, e) == 0.0;
  };
  const auto stays_at = [&](int s, int k) { return stays[static_cast<std::size_t>(contour.point_of(s, k))]; };
  std::vector<Bezier> segments;
  std::vector<bool> holds_start;
  std::vector<bool> is_implied;  // its start
  const auto is_implied_at = [&](int s) { return contour.kind(contour.node(s)) == PointKind::ImpliedNode; };
  for (int s = 0; s < contour.segment_count();) {
    // From a point of its own to the next: one segment, or quadratics with implied nodes between.
    int end = s + 1;
    while (end < contour.segment_count() && is_implied_at(end)) ++end;
    const bool is_closed_run = end == contour.segment_count() && is_implied_at(0);
    const Point from = contour.segment(s).start();
    const Point to = contour.segment(end - 1).end();
    bool is_straight = contour.degree(s) > 1 && from != to && !is_implied_at(s) && !is_closed_run;
    for (int on = s; on < end; ++on) {
      for (int k = on == s ? 1 : 0; k < contour.degree(on); ++k) {
        is_straight =
            is_straight && !stays_at(on, k) && is_on_line(from, to, contour.segment(on).p[static_cast<std::size_t>(k)]);
      }
    }
    for (int on = s; on < end; ++on) {
      Bezier b = contour.segment(on);
      if (is_straight) b = Bezier{{from, to, Point::Zero(), Point::Zero()}, 1};
      segments.push_back(b);
      holds_start.push_back(stays_at(on, 0));
      is_implied.push_back(is_implied_at(on));
      if (is_straight) break;
    }
    s = end;
  }
  for (std::size_t k = 1; k < segments.size() && segments.size() > 3;) {
    Bezier& before = segments[k - 1];
    const Bezier& here = segments[k];
    const Point along = before.end() - before.start();
    const Point on = here.end() - here.start();
    const bool is_one = before.degree == 1 && here.degree == 1 && !holds_start[k] &&
                        is_on_line(before.start(), before.end(), here.end()) &&
                        (along.dot(on) > 0.0 || std::min(along.norm(), on.norm()) <= most_turned_back) &&
                        before.start() != here.end();
    if (!is_one) {
      ++k;
      continue;
    }
    before.p[1] = here.end();
    const auto gone = static_cast<std::ptrdiff_t>(k);
    segments.erase(segments.begin() + gone);
    holds_start.erase(holds_start.begin() + gone);
    is_implied.erase(is_implied.begin() + gone);
  }
  PointList list;
  for (std::size_t k = 0; k < segments.size(); ++k) {
    const Bezier& b = segments[k];
    list.add(b.start(), is_implied[k] ? PointKind::ImpliedNode : PointKind::Node);
    for (int i = 1; i < b.degree; ++i) {
      list.add(b.p[static_cast<std::size_t>(i)], b.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
  }
  return list.contour();
}

}  // namespace fontcore
