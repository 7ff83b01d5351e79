#include "fontcore/stroke.h"

#include <algorithm>
#include <cmath>

namespace fontcore {

namespace {

constexpr double sharp_turn = 0.244346;  // radians (14 degrees): a turn by more is a corner of the stroke
constexpr double oblique = 0.5;          // of a normal's component: gaps are looked for along axes it points to by more
constexpr double upright = 0.35;         // radians off horizontal that the normal of an upright stroke may be
constexpr double opposite = 0.75;        // cosine between the sides of a stroke at least
constexpr double touching = 1e-6;        // nearer than this a ray meets the edge it starts on

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

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
  for (StrokeEdge& edge : edges_) {
    const Point p = edge.middle + 1e-3 * edge.normal;
    int winding = 0;
    for (const StrokeEdge& other : edges_) {
      const Point q = other.start + other.chord;
      const bool up = other.start.y() <= p.y() && q.y() > p.y();
      const bool down = other.start.y() > p.y() && q.y() <= p.y();
      if (!up && !down) continue;
      const double side = cross(other.chord, p - other.start);
      if (up && side > 0.0) ++winding;
      if (down && side < 0.0) --winding;
    }
    edge.is_visible = winding == 0 && edge.length > 0.0;
  }
}

EdgeHit StrokeEdges::first_hit(int from, const Point& direction) const {
  EdgeHit hit;
  const Point& origin = (*this)[from].middle;
  for (int i = 0; i < size(); ++i) {
    const StrokeEdge& edge = (*this)[i];
    if (i == from || !edge.is_visible) continue;
    const double turn = cross(direction, edge.chord);
    if (turn == 0.0) continue;
    const Point to = edge.start - origin;
    const double at = cross(to, direction) / turn;
    if (!(at >= -1e-9 && at <= 1.0 + 1e-9)) continue;
    const double distance = cross(to, edge.chord) / turn;
    if (distance > touching && distance < hit.distance) hit = {distance, i, at};
  }
  return hit;
}

void StrokeEdges::look_across() {
  for (int i = 0; i < size(); ++i) {
    StrokeEdge& edge = edges_[static_cast<std::size_t>(i)];
    if (!edge.is_visible) continue;
    edge.ink = first_hit(i, -edge.normal);
    if (edge.ink.exists()) edge.facing = -edge.normal.dot((*this)[edge.ink.edge].normal);
    if (std::abs(edge.normal.x()) > oblique) edge.gap_x = first_hit(i, Point(edge.normal.x() < 0.0 ? -1.0 : 1.0, 0.0));
    if (std::abs(edge.normal.y()) > oblique) edge.gap_y = first_hit(i, Point(0.0, edge.normal.y() < 0.0 ? -1.0 : 1.0));
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
