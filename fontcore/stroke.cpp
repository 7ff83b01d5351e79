#include "fontcore/stroke.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace fontcore {

namespace {

constexpr double sharp_turn = 0.244346;  // radians (14 degrees): a turn by more is a corner of the stroke
constexpr double oblique = 0.5;          // of a normal's component: gaps are looked for along axes it points to by more
constexpr double upright = 0.35;         // radians off horizontal that the normal of an upright stroke may be
constexpr double opposite = 0.75;        // cosine between the sides of a stroke at least
constexpr double touching = 1e-6;        // nearer than this a ray meets the edge it starts on

}  // namespace

// Edges by the strips of the plane that they reach into: rays along an axis stay within one.
class StrokeEdges::Strips {
 public:
  struct Side {
    Point start;
    Point chord;
    int edge;
  };
  using Sides = std::vector<Side>;

  template <typename Which>
  Strips(const StrokeEdges& shape, Which&& which) : box_(shape.box()) {
    for (int i = 0; i < shape.size(); ++i) {
      if (!which(shape[i])) continue;
      const Side side{shape[i].start, shape[i].chord, i};
      all_.push_back(side);
      for (int axis = 0; axis < 2; ++axis) {
        const double a = side.start[axis];
        const double b = a + side.chord[axis];
        const std::size_t last = strip(std::max(a, b) + reach, axis);
        std::array<Sides, count>& strips = axis == 0 ? columns_ : rows_;
        for (std::size_t k = strip(std::min(a, b) - reach, axis); k <= last; ++k) strips[k].push_back(side);
      }
    }
  }
  const Sides& all() const { return all_; }
  // Those that may be met where a coordinate has a value.
  const Sides& at(double value, int axis) const { return (axis == 0 ? columns_ : rows_)[strip(value, axis)]; }

 private:
  static constexpr std::size_t count = 64;
  static constexpr double reach = 0.01;  // more than edges are met beyond their ends

  std::size_t strip(double value, int axis) const {
    const double size = box_.high[axis] - box_.low[axis];
    const double place = size > 0.0 ? (value - box_.low[axis]) / size * count : 0.0;
    return static_cast<std::size_t>(std::clamp(place, 0.0, count - 1.0));
  }

  Box box_;
  Sides all_;
  std::array<Sides, count> columns_;
  std::array<Sides, count> rows_;
};

StrokeEdges::StrokeEdges(const std::vector<BezierContour>& contours, double curve_step, double line_step) {
  double largest = 0.0;
  for (const BezierContour& contour : contours) {
    cut(contour, static_cast<int>(first_.size()) - 1, curve_step, line_step);
    first_.push_back(size());
    const double area = signed_area(contour);
    if (std::abs(area) > std::abs(largest)) largest = area;
  }
  for (const StrokeEdge& edge : edges_) box_.add(edge.start);
  orient(largest < 0.0 ? -1.0 : 1.0);
  look_across();
}

void StrokeEdges::cut(const BezierContour& contour, int index, double curve_step, double line_step) {
  const std::vector<double> turns = turning_angles(contour);
  const int first = size();
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = contour.segment(s);
    const ArcLength along(bezier);
    if (along.length() <= 0.0) continue;
    const bool is_line = bezier.degree == 1;
    const int pieces = is_line ? std::max(1, static_cast<int>(std::lround(along.length() / line_step)))
                               : std::max(2, static_cast<int>(std::lround(along.length() / curve_step)));
    for (int k = 0; k < pieces; ++k) {
      StrokeEdge edge;
      edge.contour = index;
      edge.segment = s;
      edge.u0 = k == 0 ? 0.0 : along.inverse(along.length() * k / pieces);
      edge.u1 = k + 1 == pieces ? 1.0 : along.inverse(along.length() * (k + 1) / pieces);
      edge.start = evaluate(bezier, edge.u0);
      edge.run = along.length();
      edge.is_line = is_line;
      edge.is_corner = k == 0 && std::abs(turns[static_cast<std::size_t>(s)]) > sharp_turn;
      edges_.push_back(edge);
    }
  }
  const int count = size() - first;
  for (int i = 0; i < count; ++i) {
    StrokeEdge& edge = edges_[static_cast<std::size_t>(first + i)];
    edge.previous = first + (i + count - 1) % count;
    edge.next = first + (i + 1) % count;
  }
}

void StrokeEdges::orient(double sign) {
  for (StrokeEdge& edge : edges_) {
    edge.chord = (*this)[edge.next].start - edge.start;
    edge.length = edge.chord.norm();
    edge.middle = edge.start + 0.5 * edge.chord;
    if (edge.length > 0.0) edge.normal = sign / edge.length * Point(edge.chord.y(), -edge.chord.x());
    edge.direction = std::atan2(std::abs(edge.normal.y()), std::abs(edge.normal.x()));
  }
  // Paper on the outer side: the winding number there is 0.
  const Strips strips(*this, [](const StrokeEdge&) { return true; });
  for (StrokeEdge& edge : edges_) {
    const Point p = edge.middle + 1e-3 * edge.normal;
    int winding = 0;
    for (const Strips::Side& side : strips.at(p.y(), 1)) {
      const double end = side.start.y() + side.chord.y();
      const bool up = side.start.y() <= p.y() && end > p.y();
      const bool down = side.start.y() > p.y() && end <= p.y();
      if (!up && !down) continue;
      const double turn = cross(side.chord, p - side.start);
      if (up && turn > 0.0) ++winding;
      if (down && turn < 0.0) --winding;
    }
    edge.is_visible = winding == 0 && edge.length > 0.0;
  }
}

EdgeHit StrokeEdges::first_hit(int from, const Point& direction, const Strips& strips) const {
  EdgeHit hit;
  const Point& origin = (*this)[from].middle;
  const Strips::Sides& sides = direction.y() == 0.0   ? strips.at(origin.y(), 1)
                               : direction.x() == 0.0 ? strips.at(origin.x(), 0)
                                                      : strips.all();
  for (const Strips::Side& side : sides) {
    const Point to = side.start - origin;
    const double turn = cross(direction, side.chord);
    const double ahead = cross(to, direction);
    // Most lie wholly on one side of the ray.
    const double slack = 1e-6 * std::abs(turn);
    if (ahead * turn < 0.0 ? std::abs(ahead) > slack : std::abs(ahead) > std::abs(turn) + slack) continue;
    if (turn == 0.0 || side.edge == from) continue;
    const double at = ahead / turn;
    if (!(at >= -1e-9 && at <= 1.0 + 1e-9)) continue;
    const double distance = cross(to, side.chord) / turn;
    if (distance > touching && distance < hit.distance) hit = {distance, side.edge, at};
  }
  return hit;
}

void StrokeEdges::look_across() {
  const Strips strips(*this, [](const StrokeEdge& edge) { return edge.is_visible; });
  for (int i = 0; i < size(); ++i) {
    StrokeEdge& edge = edges_[static_cast<std::size_t>(i)];
    if (!edge.is_visible) continue;
    const auto hit = [&](const Point& direction) { return first_hit(i, direction, strips); };
    edge.ink = hit(-edge.normal);
    if (edge.ink.exists()) edge.facing = -edge.normal.dot((*this)[edge.ink.edge].normal);
    if (std::abs(edge.normal.x()) > oblique) edge.gap_x = hit(Point(edge.normal.x() < 0.0 ? -1.0 : 1.0, 0.0));
    if (std::abs(edge.normal.y()) > oblique) edge.gap_y = hit(Point(0.0, edge.normal.y() < 0.0 ? -1.0 : 1.0));
  }
}

double StrokeEdges::stem(double none) const {
  std::vector<double> widths;
  for (const StrokeEdge& edge : edges_) {
    if (edge.ink.exists() && edge.facing > opposite && edge.direction < upright && edge.thickness() < 2.0 * none) {
      widths.push_back(edge.thickness());
    }
  }
  if (widths.empty()) return none;
  std::ranges::sort(widths);
  const std::size_t half = widths.size() / 2;
  return widths.size() % 2 == 1 ? widths[half] : 0.5 * (widths[half - 1] + widths[half]);
}

bool StrokeEdges::is_extremum(int i, double sign) const {
  const StrokeEdge& after = (*this)[i];
  const StrokeEdge& before = (*this)[after.previous];
  return sign * before.chord.y() >= 0.0 && sign * after.chord.y() <= 0.0 &&
         (sign * after.normal.y() > 0.8 || sign * before.normal.y() > 0.8);
}

}  // namespace fontcore
