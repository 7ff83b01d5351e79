#include "fontcore/constraint.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr const char* axis_word[2] = {"vertical",
                                      "horizontal"};  // of the line along which coordinate 0 or 1 is constant

int variable(int point, int axis) { return 2 * point + axis; }

Row equal(std::string name, int p, int q, int axis) {
  return {std::move(name), {{variable(p, axis), 1.0}, {variable(q, axis), -1.0}}, 0.0};
}

// A node with the points beside it: handles, or the other ends of lines. Segments of no length are passed over.
struct Join {
  int before_point, node, after_point;
  int before_segment, after_segment;
};

Join join_at(const BezierContour& contour, int segment) {
  int before = contour.previous(segment);
  while (before != segment && is_degenerate(contour.segment(before))) before = contour.previous(before);
  // The point beside the node that differs from it, so that a handle drawn in onto its node does not hide the tangent.
  const auto beside = [&](int s, bool from_end) {
    const int n = contour.degree(s);
    const Point node = contour.point(contour.point_of(s, from_end ? n : 0));
    for (int k = 1; k <= n; ++k) {
      const int p = contour.point_of(s, from_end ? n - k : k);
      if (contour.point(p) != node) return p;
    }
    return contour.point_of(s, from_end ? 0 : n);
  };
  return {beside(before, true), contour.node(segment), beside(segment, false), before, segment};
}

// Coordinate that is constant along a direction: 0 for a vertical one, 1 for a horizontal one, -1 for any other.
int constant_axis(const Point& direction) {
  const double size = direction.norm();
  if (std::abs(direction.x()) < 1e-9 * size) return 0;
  if (std::abs(direction.y()) < 1e-9 * size) return 1;
  return -1;
}

double join_ratio(const BezierContour& contour, const Join& join) {
  if (contour.kind(join.node) == PointKind::ImpliedNode) return 0.5;
  const double a = (contour.point(join.node) - contour.point(join.before_point)).norm();
  const double b = (contour.point(join.after_point) - contour.point(join.node)).norm();
  return a / (a + b);
}

Rows between(const BezierContour& contour, const Join& join, const std::string& name, bool close) {
  const double m = join_ratio(contour, join);
  const Point offset = close ? Point((1.0 - m) * contour.point(join.before_point) +
                                     m * contour.point(join.after_point) - contour.point(join.node))
                             : Point::Zero();
  Rows result;
  for (int axis = 0; axis < 2; ++axis) {
    result.push_back({name,
                      {{variable(join.node, axis), 1.0},
                       {variable(join.before_point, axis), m - 1.0},
                       {variable(join.after_point, axis), -m}},
                      offset[axis]});
  }
  return result;
}

constexpr double straight_angle = 1e-3;  // radians

void append(Rows& all, Rows more) { std::move(more.begin(), more.end(), std::back_inserter(all)); }

}  // namespace

Rows rows(const BezierContour&, const FrozenPoint& rule) {
  const std::string name = text("point ", rule.point, " is frozen");
  return {{name, {{variable(rule.point, 0), 1.0}}, 0.0}, {name, {{variable(rule.point, 1), 1.0}}, 0.0}};
}

Rows rows(const BezierContour& contour, const SmoothJoin& rule) {
  const Join join = join_at(contour, rule.segment);
  return between(contour, join, text("join at point ", join.node, " stays smooth"), rule.close);
}

Rows rows(const BezierContour& contour, const NodeOnLine& rule) {
  const Join join = join_at(contour, rule.segment);
  return between(contour, join, text("point ", join.node, " stays on its line"), false);
}

Rows rows(const BezierContour& contour, const AxisLine& rule) {
  const int a = contour.point_of(rule.segment, 0);
  const int b = contour.point_of(rule.segment, 1);
  const int axis = constant_axis(contour.point(b) - contour.point(a));
  if (axis < 0) return {};
  return {equal(text("line from point ", a, " stays ", axis_word[axis]), a, b, axis)};
}

Rows rows(const BezierContour& contour, const Extremum& rule) {
  const Join join = join_at(contour, rule.segment);
  const int axis = constant_axis(contour.point(join.after_point) - contour.point(join.before_point));
  if (axis < 0) return {};
  const std::string name = text("point ", join.node, " stays an extremum");
  return {equal(name, join.before_point, join.after_point, axis), equal(name, join.node, join.after_point, axis)};
}

Rows rows(const BezierContour& contour, const Zone& rule) {
  const int p = contour.node(rule.segment);
  return {{text("point ", p, " stays at zone y = ", contour.points()(p, 1)), {{variable(p, 1), 1.0}}, 0.0}};
}

Rows rows(const BezierContour& contour, const Position& rule) {
  const auto weight = bernstein(contour.degree(rule.segment), rule.u);
  Rows result;
  for (int axis = 0; axis < 2; ++axis) {
    Row row{text("the handle moves by ", rule.displacement[axis], axis == 0 ? " in x" : " in y"),
            {},
            rule.displacement[axis]};
    for (int k = 0; k <= contour.degree(rule.segment); ++k) {
      row.terms.push_back({variable(contour.point_of(rule.segment, k), axis), weight[static_cast<std::size_t>(k)]});
    }
    result.push_back(std::move(row));
  }
  return result;
}

Rows rows(const BezierContour&, const Coincident& rule) {
  const std::string name = text("points ", rule.first, " and ", rule.second, " stay together");
  return {equal(name, rule.first, rule.second, 0), equal(name, rule.first, rule.second, 1)};
}

Rows rows(const CornerPair& rule) {
  const int next = (rule.first + 1) % rule.size;
  const std::string name = text("control points ", rule.first, " and ", next, " stay a corner");
  return {equal(name, rule.first, next, 0), equal(name, rule.first, next, 1)};
}

Rows outline_rows(const BezierContour& contour, const OutlineRules& rules) {
  const std::vector<double> turns = turning_angles(contour);
  Rows all;
  std::vector<int> solid;
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (!is_degenerate(contour.segment(s))) solid.push_back(s);
  }
  const int n = static_cast<int>(contour.point_count());
  for (int i = 0; i < n; ++i) {
    const int next = (i + 1) % n;
    if (next != i && contour.point(i) == contour.point(next)) append(all, rows(contour, Coincident{i, next}));
  }
  if (solid.empty()) return all;
  for (const int s : solid) {
    if (contour.kind(contour.node(s)) == PointKind::ImpliedNode) append(all, rows(contour, SmoothJoin{s}));
  }
  if (rules.lines) {
    for (const int s : solid) {
      if (contour.degree(s) == 1) append(all, rows(contour, AxisLine{s}));
    }
  }
  for (const int s : solid) {
    const Join join = join_at(contour, s);
    if (std::abs(turns[static_cast<std::size_t>(s)]) > rules.corner_angle) continue;
    const bool line_before = contour.degree(join.before_segment) == 1;
    const bool line_after = contour.degree(s) == 1;
    if (line_before && line_after) {
      // A longer straight run, told apart from a bend of two lines by what a coordinate's rounding can do.
      if (rules.lines && std::abs(turns[static_cast<std::size_t>(s)]) < straight_angle)
        append(all, rows(contour, NodeOnLine{s}));
      continue;
    }
    const bool close = std::find(rules.closed_joins.begin(), rules.closed_joins.end(), s) != rules.closed_joins.end();
    const bool implied = contour.kind(join.node) == PointKind::ImpliedNode;
    if (rules.smooth_joins && !implied) append(all, rows(contour, SmoothJoin{s, close}));
    if (rules.extrema) append(all, rows(contour, Extremum{s}));
  }
  for (const int s : solid) {
    const Join join = join_at(contour, s);
    const double height = contour.points()(join.node, 1);
    const bool at_zone =
        std::any_of(rules.zones.begin(), rules.zones.end(), [&](double z) { return std::abs(z - height) < 1e-9; });
    const bool level_before = std::abs(contour.points()(join.before_point, 1) - height) < 1e-9;
    const bool level_after = std::abs(contour.points()(join.after_point, 1) - height) < 1e-9;
    const bool flat =
        (level_before && contour.degree(join.before_segment) == 1) || (level_after && contour.degree(s) == 1);
    if (at_zone && (flat || (level_before && level_after))) append(all, rows(contour, Zone{s}));
  }
  return all;
}

}  // namespace fontcore
