#include "fontcore/soften.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr double parallel = 1e-9;  // sine of a turn below which tangents meet nowhere

// A segment seen from the corners at its ends.
struct Leg {
  Bezier whole;
  double length = 0.0;
  double from = 0.0;  // what is left of it, by parameter
  double to = 1.0;
  bool is_trimmed = false;

  double parameter(double s) const {
    if (!(length > 0.0)) return 0.0;
    return whole.degree == 1 ? s / length : ArcLength(whole).inverse(s);
  }
  void trim_start(double cut) {
    from = cut > 0.0 ? parameter(cut) : 0.0;
    is_trimmed = true;
  }
  void trim_end(double cut) {
    to = cut > 0.0 ? parameter(length - cut) : 1.0;
    is_trimmed = true;
  }
  Bezier rest() const {
    const double end = std::max(from, to);  // two cuts of a half may pass each other by rounding
    const Bezier upto = split(whole, end)[0];
    return end > 0.0 ? split(upto, from / end)[1] : upto;
  }
  // Tangents where it is cut, of the leg before its other end was.
  Point tangent_at_start() const { return start_tangent(split(whole, from)[1]); }
  Point tangent_at_end() const { return end_tangent(split(whole, to)[0]); }
};

// The two handles of an arc from p to q, tangent to unit vectors t and s.
std::pair<Point, Point> arc_handles(const Point& p, const Point& t, const Point& q, const Point& s, ArcKind kind) {
  const double sine = cross(t, s);
  const double turn = std::abs(std::atan2(sine, t.dot(s)));
  const Point chord = q - p;
  const bool is_cubic = kind == ArcKind::Cubic;
  if (std::abs(sine) > parallel) {
    const double ahead = cross(chord, s) / sine;  // p + ahead t = q - behind s
    const double behind = cross(t, chord) / sine;
    if (ahead > 0.0 && behind > 0.0) {
      const double quarter = std::tan(0.25 * turn);
      // On a circle of radius 1 they are 4/3 tan(turn / 4) and tan(turn / 4), of tan(turn / 2).
      const double share = (is_cubic ? 2.0 / 3.0 : 0.5) * (1.0 - quarter * quarter);
      return {p + share * ahead * t, q - share * behind * s};
    }
  }
  const double cosine = std::cos(0.25 * turn);
  const double reach = chord.norm() / ((is_cubic ? 3.0 : 4.0) * cosine * cosine);
  return {p + reach * t, q - reach * s};
}

bool has_quadratics(const BezierContour& contour) {
  return std::find(contour.kinds().begin(), contour.kinds().end(), PointKind::Quadratic) != contour.kinds().end();
}

// What the arc at the start of a segment takes from its legs; nothing if the corner is to stay.
std::optional<SoftenedCorner> cut_at(int segment, double turn, const std::vector<Leg>& legs, int previous,
                                     const SoftenOptions& options) {
  const bool is_certain = options.corners && options.empty == EmptyArc::Add;
  const double least = is_certain ? 0.0 : options.least_handle;
  const double shorter =
      std::min(legs[static_cast<std::size_t>(previous)].length, legs[static_cast<std::size_t>(segment)].length);
  const double room = std::max(0.0, 0.5 * (shorter - least));
  const double tangent = std::tan(0.5 * std::abs(turn));
  const double wished = options.radius * tangent;
  SoftenedCorner corner{segment, std::min(wished, room), wished > room ? room / tangent : options.radius};
  const double handle = corner.radius * std::tan(0.25 * std::abs(turn));
  if (is_certain || (corner.cut > 0.0 && handle >= least)) return corner;
  return {};
}

// A contour as it is put together.
struct Builder {
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  std::vector<int> came_from;

  void add(const Point& point, PointKind kind, int from) {
    points.push_back(point);
    kinds.push_back(kind);
    came_from.push_back(from);
  }
  void add_arc(const Point& p, const std::pair<Point, Point>& handles, const Point& q, ArcKind kind) {
    const PointKind handle = kind == ArcKind::Cubic ? PointKind::Cubic : PointKind::Quadratic;
    add(p, PointKind::Node, -1);
    add(handles.first, handle, -1);
    if (kind != ArcKind::Cubic) add(0.5 * (handles.first + handles.second), PointKind::ImpliedNode, -1);
    add(handles.second, handle, -1);
    add(q, PointKind::Node, -1);
  }
  BezierContour contour() const {
    Points all(static_cast<Eigen::Index>(points.size()), 2);
    for (Eigen::Index i = 0; i < all.rows(); ++i) all.row(i) = points[static_cast<std::size_t>(i)];
    return {std::move(all), kinds};
  }
};

}  // namespace

Softened soften(const BezierContour& contour, const SoftenOptions& options) {
  if (!(options.radius >= 0.0) || !std::isfinite(options.radius)) {
    throw InvalidInput(text("soften: radius ", options.radius, " is not a length"));
  }
  const int count = contour.segment_count();
  const std::vector<double> turns = turning_angles(contour);
  std::vector<bool> is_wanted(static_cast<std::size_t>(count), false);
  if (options.corners) {
    for (const int s : *options.corners) {
      if (s < 0 || s >= count) throw InvalidInput(text("soften: corner ", s, " of a contour of ", count, " segments"));
      is_wanted[static_cast<std::size_t>(s)] = true;
    }
  } else {
    std::transform(turns.begin(), turns.end(), is_wanted.begin(),
                   [&](double turn) { return std::abs(turn) > options.corner_angle; });
  }

  std::vector<Leg> legs;
  for (int s = 0; s < count; ++s) {
    const Bezier whole = contour.segment(s);
    legs.push_back({whole, length(whole)});
  }
  Softened result;
  std::vector<bool> is_arc(static_cast<std::size_t>(count), false);
  for (int s = 0; s < count; ++s) {
    const auto k = static_cast<std::size_t>(s);
    if (!is_wanted[k]) continue;
    const auto corner = cut_at(s, turns[k], legs, contour.previous(s), options);
    if (!corner) continue;
    is_arc[k] = true;
    legs[static_cast<std::size_t>(contour.previous(s))].trim_end(corner->cut);
    legs[k].trim_start(corner->cut);
    result.corners.push_back(*corner);
  }

  const ArcKind kind = options.arcs != ArcKind::Own ? options.arcs
                       : has_quadratics(contour)    ? ArcKind::Quadratic
                                                    : ArcKind::Cubic;
  std::vector<Bezier> rest;
  for (const Leg& leg : legs) rest.push_back(leg.is_trimmed ? leg.rest() : leg.whole);
  std::vector<std::pair<int, int>> place(static_cast<std::size_t>(contour.point_count()));  // segment, control point
  for (int s = 0; s < count; ++s) {
    for (int k = 0; k < contour.degree(s); ++k) place[static_cast<std::size_t>(contour.point_of(s, k))] = {s, k};
  }
  Builder built;
  for (int i = 0; i < contour.point_count(); ++i) {
    const auto [segment, control] = place[static_cast<std::size_t>(i)];
    const auto s = static_cast<std::size_t>(segment);
    const auto before = static_cast<std::size_t>(contour.previous(segment));
    if (control > 0) {
      built.add(rest[s].p[static_cast<std::size_t>(control)], contour.kind(i), i);
    } else if (is_arc[s]) {
      const Point& p = rest[before].end();
      const Point& q = rest[s].start();
      built.add_arc(p, arc_handles(p, legs[before].tangent_at_end(), q, legs[s].tangent_at_start(), kind), q, kind);
    } else {
      const bool is_free = legs[before].is_trimmed || legs[s].is_trimmed;
      built.add(contour.point(i), is_free && is_node(contour.kind(i)) ? PointKind::Node : contour.kind(i), i);
    }
  }
  result.contour = built.contour();
  result.came_from = std::move(built.came_from);
  return result;
}

}  // namespace fontcore
