#include "fontcore/constraint.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <map>
#include <numbers>
#include <set>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr const char* axis_word[2] = {" stays vertical",
                                      " stays horizontal"};  // of the line along which coordinate 0 or 1 is constant

int variable(int point, int axis) { return 2 * point + axis; }

constexpr double degrees = 180.0 / std::numbers::pi;
constexpr double steepest_lean = 80.0 / degrees;
constexpr double whole_number_lean = 1.0;       // font units: what rounding both ends of a leaning line does to it
constexpr double largest_lean_error = 0.05236;  // radians (3 degrees): short lines are not all vertical

double lean(const char* rule, const Frame& frame) {
  if (!(std::abs(frame.italic_angle) <= steepest_lean))
    throw InvalidInput(text(rule, ": italic angle ", frame.italic_angle * degrees, " degrees is not within 80"));
  return std::tan(frame.italic_angle);
}

std::string leaning(const Frame& frame) {
  return frame.italic_angle == 0.0 ? "" : text(" at the italic angle of ", frame.italic_angle * degrees, " degrees");
}

// The name of what keeps a coordinate of the frame.
RowName name_along(const char* before, int point, const char* after, int axis, const Frame& frame) {
  if (axis == 1 || frame.italic_angle == 0.0) return RowName::of(before, point, after);
  return text(before, point, after, leaning(frame));
}

// Points p and q keep the difference of a coordinate of the frame.
void add_equal(Rows& all, const RowName& name, int p, int q, int axis, double slope = 0.0) {
  Row& row = all.emplace_back(Row{name, {}});
  row.terms = {{variable(p, axis), 1.0}, {variable(q, axis), -1.0}};
  if (axis == 0 && slope != 0.0) {
    row.terms.push_back({variable(p, 1), -slope});
    row.terms.push_back({variable(q, 1), slope});
  }
}

void require_point(const char* rule, int point, Eigen::Index count) {
  if (point < 0 || point >= count) throw InvalidInput(text(rule, ": point ", point, " of ", count));
}

void require_segment(const char* rule, const BezierContour& contour, int segment) {
  if (segment < 0 || segment >= contour.segment_count())
    throw InvalidInput(text(rule, ": segment ", segment, " of ", contour.segment_count()));
}

void require_finite(const char* rule, const std::string& what, const Point& value) {
  if (!value.allFinite()) throw InvalidInput(text(rule, ": ", what, " is (", value.x(), ", ", value.y(), ")"));
}

Point unit(const char* rule, const std::string& what, const Point& direction) {
  require_finite(rule, what, direction);
  const double size = direction.norm();
  if (size == 0.0) throw InvalidInput(text(rule, ": ", what, " has no direction"));
  return direction / size;
}

bool is_reflection(const Affine& map) { return cross(map.linear.col(0), map.linear.col(1)) < 0.0; }

// Of a line, in degrees from 0 to below 180.
double slant(const Point& direction) {
  const double angle = std::atan2(direction.y(), direction.x()) * degrees;
  return angle < 0.0 ? angle + 180.0 : angle >= 180.0 ? angle - 180.0 : angle;
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

// Coordinate of the frame that is constant along a direction: 0 for a vertical one, 1 for a horizontal one, -1 for any
// other.
int constant_axis(const Point& direction, double slope) {
  const double size = direction.norm();
  if (std::abs(direction.y()) < 1e-9 * size) return 1;
  const double upright = std::abs(direction.x() - slope * direction.y());
  if (slope == 0.0) return upright < 1e-9 * size ? 0 : -1;
  return upright <= std::min(whole_number_lean, largest_lean_error * size) ? 0 : -1;
}

double join_ratio(const BezierContour& contour, const Join& join) {
  if (contour.kind(join.node) == PointKind::ImpliedNode) return 0.5;
  const double a = (contour.point(join.node) - contour.point(join.before_point)).norm();
  const double b = (contour.point(join.after_point) - contour.point(join.node)).norm();
  return a / (a + b);
}

void add_between(Rows& all, const BezierContour& contour, const Join& join, const RowName& name, bool close) {
  const double m = join_ratio(contour, join);
  const Point offset = close ? Point((1.0 - m) * contour.point(join.before_point) +
                                     m * contour.point(join.after_point) - contour.point(join.node))
                             : Point::Zero();
  for (int axis = 0; axis < 2; ++axis) {
    Row& row = all.emplace_back(Row{name, {}});
    row.terms = {{variable(join.node, axis), 1.0},
                 {variable(join.before_point, axis), m - 1.0},
                 {variable(join.after_point, axis), -m}};
    row.value = offset[axis];
  }
}

void add_smooth_join(Rows& all, const BezierContour& contour, const Join& join, bool close) {
  add_between(all, contour, join, RowName::of("join at point ", join.node, " stays smooth"), close);
}

void add_node_on_line(Rows& all, const BezierContour& contour, const Join& join) {
  add_between(all, contour, join, RowName::of("point ", join.node, " stays on its line"), false);
}

// Whether the line is one along an axis.
bool add_axis_line(Rows& all, const BezierContour& contour, int segment, const Frame& frame, double slope) {
  const int a = contour.point_of(segment, 0);
  const int b = contour.point_of(segment, 1);
  const int axis = constant_axis(contour.point(b) - contour.point(a), slope);
  if (axis < 0) return false;
  add_equal(all, name_along("line from point ", a, axis_word[axis], axis, frame), a, b, axis, slope);
  return true;
}

void add_extremum(Rows& all, const BezierContour& contour, const Join& join, const Frame& frame, double slope) {
  const int axis = constant_axis(contour.point(join.after_point) - contour.point(join.before_point), slope);
  if (axis < 0) return;
  const RowName name = name_along("point ", join.node, " stays an extremum", axis, frame);
  add_equal(all, name, join.before_point, join.after_point, axis, slope);
  add_equal(all, name, join.node, join.after_point, axis, slope);
}

void add_zone(Rows& all, const BezierContour& contour, int node) {
  Row& row = all.emplace_back(Row{RowName::of("point ", node, " stays at zone y = ", contour.points()(node, 1)), {}});
  row.terms = {{variable(node, 1), 1.0}};
}

void add_coincident(Rows& all, int first, int second) {
  const RowName name = RowName::of("points ", first, " and ", second, " stay together");
  for (int axis = 0; axis < 2; ++axis) add_equal(all, name, first, second, axis);
}

constexpr double straight_angle = 1e-3;  // radians

void append(Rows& all, Rows more) { std::move(more.begin(), more.end(), std::back_inserter(all)); }

// The change of `sum` along a direction, as a part of a row.
struct Part {
  const WeightedSum& sum;
  Point along;
};

Row row_of(std::string name, std::initializer_list<Part> parts, double value) {
  std::map<int, double> terms;
  for (const auto& [sum, along] : parts) {
    for (const auto& [point, weight] : sum.terms) {
      for (int axis = 0; axis < 2; ++axis) {
        if (along[axis] != 0.0) terms[variable(point, axis)] += along[axis] * weight;
      }
    }
  }
  Row row{std::move(name), {}, value};
  for (const auto& [at, coefficient] : terms) {
    if (!std::isfinite(coefficient)) throw InvalidInput(text(row.name.str(), ": a weight is ", coefficient));
    if (coefficient != 0.0) row.terms.push_back({at, coefficient});
  }
  if (!std::isfinite(value)) throw InvalidInput(text(row.name.str(), ": the row asks for ", value));
  return row;
}

// A given change, in both coordinates.
Rows change_rows(const std::string& name, const WeightedSum& sum, const Point& change) {
  return {row_of(name, {{sum, Point::UnitX()}}, change.x()), row_of(name, {{sum, Point::UnitY()}}, change.y())};
}

// What is on a straight line from a to b, at fraction m of it, stays there.
Rows on_chord(const std::string& name, const WeightedSum& place, const WeightedSum& a, const WeightedSum& b, double m,
              Offset offset) {
  const Point change = offset == Offset::Closed ? Point((1.0 - m) * a.value + m * b.value - place.value) : Point(0, 0);
  const auto parts = [&](const Point& axis, double value) {
    return row_of(name, {{place, axis}, {a, (m - 1.0) * axis}, {b, -m * axis}}, value);
  };
  return {parts(Point::UnitX(), change.x()), parts(Point::UnitY(), change.y())};
}

}  // namespace

std::string RowName::str() const {
  if (text_) return *text_;
  std::string whole;
  const auto append = [&]<typename Any>(const Any& any) {
    if constexpr (!std::same_as<Any, std::monostate>) append_fact(whole, any);
  };
  for (const Fact& fact : facts_) std::visit(append, fact);
  return whole;
}

Rows rows(const BezierContour& contour, const FrozenPoint& rule) {
  require_point("rows(FrozenPoint)", rule.point, contour.point_count());
  const RowName name = RowName::of("point ", rule.point, " is frozen");
  return {{name, {{variable(rule.point, 0), 1.0}}, 0.0}, {name, {{variable(rule.point, 1), 1.0}}, 0.0}};
}

Rows rows(const BezierContour& contour, const SmoothJoin& rule) {
  require_segment("rows(SmoothJoin)", contour, rule.segment);
  Rows result;
  add_smooth_join(result, contour, join_at(contour, rule.segment), rule.close);
  return result;
}

Rows rows(const BezierContour& contour, const NodeOnLine& rule) {
  require_segment("rows(NodeOnLine)", contour, rule.segment);
  Rows result;
  add_node_on_line(result, contour, join_at(contour, rule.segment));
  return result;
}

Rows rows(const BezierContour& contour, const AxisLine& rule) {
  require_segment("rows(AxisLine)", contour, rule.segment);
  Rows result;
  add_axis_line(result, contour, rule.segment, rule.frame, lean("rows(AxisLine)", rule.frame));
  return result;
}

Rows rows(const BezierContour& contour, const SlantedLine& rule) {
  require_segment("rows(SlantedLine)", contour, rule.segment);
  const int a = contour.point_of(rule.segment, 0);
  WeightedSum line = edge(point_of(contour.points(), a),
                          point_of(contour.points(), contour.point_of(rule.segment, contour.degree(rule.segment))));
  line.name = text("line from point ", a);
  return rows(TangentDirection{line, {}, Tangent::Direction});
}

Rows rows(const BezierContour& contour, const Extremum& rule) {
  require_segment("rows(Extremum)", contour, rule.segment);
  Rows result;
  add_extremum(result, contour, join_at(contour, rule.segment), rule.frame, lean("rows(Extremum)", rule.frame));
  return result;
}

Rows rows(const BezierContour& contour, const Zone& rule) {
  require_segment("rows(Zone)", contour, rule.segment);
  Rows result;
  add_zone(result, contour, contour.node(rule.segment));
  return result;
}

Rows rows(const BezierContour& contour, const Position& rule) {
  require_segment("rows(Position)", contour, rule.segment);
  if (!std::isfinite(rule.u)) throw InvalidInput(text("rows(Position): u = ", rule.u, " of segment ", rule.segment));
  require_finite("rows(Position)", "the displacement", rule.displacement);
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

Rows rows(const BezierContour& contour, const Coincident& rule) {
  require_point("rows(Coincident)", rule.first, contour.point_count());
  require_point("rows(Coincident)", rule.second, contour.point_count());
  Rows result;
  add_coincident(result, rule.first, rule.second);
  return result;
}

Rows rows(const BezierContour& contour, const CornerTangents& rule) {
  require_segment("rows(CornerTangents)", contour, rule.segment);
  const Join join = join_at(contour, rule.segment);
  const WeightedSum node = point_of(contour.points(), join.node);
  WeightedSum before = edge(point_of(contour.points(), join.before_point), node);
  WeightedSum after = edge(node, point_of(contour.points(), join.after_point));
  before.name = text("tangent before the corner at point ", join.node);
  after.name = text("tangent after the corner at point ", join.node);
  Rows all = rows(TangentDirection{before, {}, rule.kept});
  append(all, rows(TangentDirection{after, {}, rule.kept}));
  return all;
}

Rows rows(const CornerPair& rule) {
  require_point("rows(CornerPair)", rule.first, rule.size);
  const int next = (rule.first + 1) % rule.size;
  const RowName name = RowName::of("control points ", rule.first, " and ", next, " stay a corner");
  Rows result;
  for (int axis = 0; axis < 2; ++axis) add_equal(result, name, rule.first, next, axis);
  return result;
}

bool OutlineRules::marks_corner(int point) const {
  return std::find(corners.begin(), corners.end(), point) != corners.end();
}

Rows outline_rows(const BezierContour& contour, const OutlineRules& rules) {
  const double slope = lean("outline_rows", rules.frame);
  const std::vector<double> turns = turning_angles(contour);
  const int n = static_cast<int>(contour.point_count());
  Rows all;
  std::vector<std::pair<int, Join>> solid;  // segments that have a direction, and the joins that they start at
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (!is_degenerate(contour.segment(s))) solid.emplace_back(s, join_at(contour, s));
  }
  for (int i = 0; i < n; ++i) {
    const int next = (i + 1) % n;
    if (next != i && contour.point(i) == contour.point(next)) add_coincident(all, i, next);
  }
  if (solid.empty()) return all;
  for (const auto& [s, join] : solid) {
    if (contour.kind(join.node) == PointKind::ImpliedNode) add_smooth_join(all, contour, join, false);
  }
  if (rules.lines) {
    for (const auto& [s, join] : solid) {
      if (contour.degree(s) != 1 || add_axis_line(all, contour, s, rules.frame, slope)) continue;
      if (rules.slants) append(all, rows(contour, SlantedLine{s}));
    }
  }
  for (const auto& [s, join] : solid) {
    const double turn = std::abs(turns[static_cast<std::size_t>(s)]);
    if (turn > rules.corner_angle || rules.marks_corner(join.node)) continue;
    if (contour.degree(join.before_segment) == 1 && contour.degree(s) == 1) {
      // A longer straight run; one that is not quite straight is carried along, no further bent.
      if (rules.lines && turn < smooth_angle) add_node_on_line(all, contour, join);
      continue;
    }
    const bool close = std::find(rules.closed_joins.begin(), rules.closed_joins.end(), s) != rules.closed_joins.end();
    const bool implied = contour.kind(join.node) == PointKind::ImpliedNode;
    if (rules.smooth_joins && !implied) add_smooth_join(all, contour, join, close);
    if (rules.extrema) add_extremum(all, contour, join, rules.frame, slope);
  }
  for (const auto& [s, join] : solid) {
    const double height = contour.points()(join.node, 1);
    const bool at_zone =
        std::any_of(rules.zones.begin(), rules.zones.end(), [&](double z) { return std::abs(z - height) < 1e-9; });
    // Flat, round, or an apex: the outline does not go on through the height.
    const double before = contour.points()(join.before_point, 1) - height;
    const double after = contour.points()(join.after_point, 1) - height;
    if (at_zone && (before * after > 0.0 || std::min(std::abs(before), std::abs(after)) < 1e-9))
      add_zone(all, contour, join.node);
  }
  return all;
}

WeightedSum point_of(const Points& points, int point) {
  require_point("point_of", point, points.rows());
  return {text("point ", point), {{point, 1.0}}, points.row(point).transpose()};
}

namespace {

constexpr const char* of_the_curve[3] = {"", "tangent of ", "second derivative of "};

void require_derivative(int derivative) {
  if (derivative < 0 || derivative > 2) throw InvalidInput(text("curve_at: derivative ", derivative, " of 0, 1 or 2"));
}

// Weights of the derivative of a Bezier curve: those of the lower degree, differenced.
std::vector<double> bernstein_derivative(int degree, double u, int derivative) {
  if (derivative > degree) return std::vector<double>(static_cast<std::size_t>(degree + 1), 0.0);
  std::vector<double> weight = {1.0};
  if (degree > derivative) {
    const auto lower = bernstein(degree - derivative, u);
    weight.assign(lower.begin(), lower.begin() + degree - derivative + 1);
  }
  for (int order = degree - derivative + 1; order <= degree; ++order) {
    std::vector<double> next(static_cast<std::size_t>(order + 1), 0.0);
    for (std::size_t k = 0; k < weight.size(); ++k) {
      next[k] -= order * weight[k];
      next[k + 1] += order * weight[k];
    }
    weight = std::move(next);
  }
  return weight;
}

// Where the polynomial piece of a spline begins that t lies on, or next to if t is beyond the end of an open arc.
double piece_begin(Scheme scheme, Eigen::Index size, double t) {
  if (is_closed(scheme)) return std::floor(t + 0.5) - 0.5;
  return std::clamp(std::floor(t), 0.0, static_cast<double>(size - degree(scheme) - 1));
}

// Weights on a piece are polynomials of the scheme's degree in u: their values at degree + 1 places inside the piece
// give the derivatives at any u, its ends included, by Lagrange's formula.
BasisRow piece_row(Scheme scheme, Eigen::Index size, double begin, double u, int derivative) {
  const int p = degree(scheme);
  const auto node = [&](int k) { return (k + 0.5) / (p + 1); };
  BasisRow result;
  for (int k = 0; k <= p; ++k) {
    // Derivative at u of the product of (u - node(j)) / (node(k) - node(j)) over j other than k.
    std::array<double, 3> product{1.0, 0.0, 0.0};
    for (int j = 0; j <= p; ++j) {
      if (j == k) continue;
      const double slope = 1.0 / (node(k) - node(j));
      const double factor = (u - node(j)) * slope;
      product = {product[0] * factor, product[1] * factor + product[0] * slope,
                 product[2] * factor + 2.0 * product[1] * slope};
    }
    const BasisRow row = basis_row(scheme, size, begin + node(k));
    result.index = row.index;
    result.count = row.count;
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i)
      result.weight[i] += product[static_cast<std::size_t>(derivative)] * row.weight[i];
  }
  return result;
}

// A piece as the Bezier curve it is.
Bezier bezier_of(Scheme scheme, const Points& control_points, Eigen::Index piece) {
  const double begin = static_cast<double>(piece) - (is_closed(scheme) ? 0.5 : 0.0);
  const auto value = [&](double u, int derivative) {
    const BasisRow row = piece_row(scheme, control_points.rows(), begin, u, derivative);
    Point sum = Point::Zero();
    for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k)
      sum += row.weight[k] * control_points.row(row.index[k]).transpose();
    return sum;
  };
  const int p = degree(scheme);
  const Point start = value(0.0, 0);
  const Point end = value(1.0, 0);
  const Point second = start + value(0.0, 1) / p;
  if (p == 2) return {{start, second, end, Point::Zero()}, 2};
  return {{start, second, end - value(1.0, 1) / p, end}, 3};
}

}  // namespace

WeightedSum curve_at(const BezierContour& contour, int segment, double u, int derivative) {
  require_segment("curve_at", contour, segment);
  require_derivative(derivative);
  if (!(u >= 0.0 && u <= 1.0)) throw InvalidInput(text("curve_at: u = ", u, " of segment ", segment));
  WeightedSum sum{text(of_the_curve[derivative], "the outline at ", u, " of segment ", segment), {}, Point::Zero()};
  const std::vector<double> weight = bernstein_derivative(contour.degree(segment), u, derivative);
  for (int k = 0; k <= contour.degree(segment); ++k) {
    const int point = contour.point_of(segment, k);
    sum.terms.push_back({point, weight[static_cast<std::size_t>(k)]});
    sum.value += sum.terms.back().weight * contour.point(point);
  }
  return sum;
}

WeightedSum curve_at(Scheme scheme, const Points& control_points, double t, int derivative) {
  require_derivative(derivative);
  const Eigen::Index size = control_points.rows();
  BasisRow row = basis_row(scheme, size, t);
  if (derivative > 0) {
    const double begin = piece_begin(scheme, size, t);
    row = piece_row(scheme, size, begin, t - begin, derivative);
  }
  WeightedSum sum{text(of_the_curve[derivative], "the spline at t = ", t), {}, Point::Zero()};
  for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
    sum.terms.push_back({static_cast<int>(row.index[k]), row.weight[k]});
    sum.value += row.weight[k] * control_points.row(row.index[k]).transpose();
  }
  return sum;
}

WeightedSum edge(const WeightedSum& from, const WeightedSum& to) {
  std::map<int, double> weights;
  for (const auto& [point, weight] : to.terms) weights[point] += weight;
  for (const auto& [point, weight] : from.terms) weights[point] -= weight;
  WeightedSum sum{text("edge from ", from.name, " to ", to.name), {}, to.value - from.value};
  for (const auto& [point, weight] : weights) sum.terms.push_back({point, weight});
  return sum;
}

WeightedSum shifted(WeightedSum sum, int points_before) {
  for (auto& term : sum.terms) term.point += points_before;
  return sum;
}

Rows rows(const Pinned& rule) {
  require_finite("rows(Pinned)", "the displacement of " + rule.place.name, rule.displacement);
  Rows result;
  for (int axis = 0; axis < 2; ++axis) {
    const double by = rule.displacement[axis];
    result.push_back(row_of(text(rule.place.name, by == 0.0 ? " stays at " : " goes to ",
                                 axis == 0 ? "x = " : "y = ", rule.place.value[axis] + by),
                            {{rule.place, Point::Unit(axis)}}, by));
  }
  return result;
}

Rows rows(const Together& rule) {
  const std::string name = text(rule.first.name, " and ", rule.second.name, " stay together");
  const Point apart = rule.second.value - rule.first.value;
  return change_rows(name, edge(rule.second, rule.first), rule.offset == Offset::Closed ? apart : Point(0, 0));
}

Rows rows(const TangentDirection& rule) {
  const WeightedSum& tangent = rule.tangent;
  const Point own = unit("rows(TangentDirection)", tangent.name, tangent.value);
  const Point direction =
      rule.direction ? unit("rows(TangentDirection)", "the direction of " + tangent.name, *rule.direction) : own;
  std::string name = rule.direction ? text(tangent.name, " turns to ", slant(direction), " degrees")
                                    : text(tangent.name, " keeps its direction of ", slant(direction), " degrees");
  if (rule.kept == Tangent::Direction) {
    const double off = rule.direction ? left_of(direction).dot(tangent.value) : 0.0;
    return {row_of(std::move(name), {{tangent, left_of(direction)}}, -off)};
  }
  const double length = std::copysign(tangent.value.norm(), tangent.value.dot(direction));
  name += text(" and its length of ", std::abs(length));
  return change_rows(name, tangent, rule.direction ? Point(length * direction - tangent.value) : Point(0, 0));
}

Rows rows(const Orthogonal& rule) {
  const Point direction = unit("rows(Orthogonal)", "the direction for " + rule.tangent.name, rule.direction);
  return {row_of(text(rule.tangent.name, " is orthogonal to ", slant(direction), " degrees"),
                 {{rule.tangent, direction}}, -direction.dot(rule.tangent.value))};
}

Rows rows(const OrthogonalTangents& rule) {
  const Point first = unit("rows(OrthogonalTangents)", rule.first.name, rule.first.value);
  const Point second = unit("rows(OrthogonalTangents)", rule.second.name, rule.second.value);
  // Divided by the longer tangent, so that the row is in font units.
  const double size = std::max(rule.first.value.norm(), rule.second.value.norm());
  return {row_of(text(rule.first.name, " is orthogonal to ", rule.second.name),
                 {{rule.first, second * (rule.second.value.norm() / size)},
                  {rule.second, first * (rule.first.value.norm() / size)}},
                 -rule.first.value.dot(rule.second.value) / size)};
}

Rows rows(const StraightRun& rule) {
  if (rule.places.size() < 2) throw InvalidInput(text("rows(StraightRun): ", rule.places.size(), " places"));
  const WeightedSum& first = rule.places.front();
  const WeightedSum& last = rule.places.back();
  WeightedSum chord = edge(first, last);
  const Point along = unit("rows(StraightRun)", chord.name, chord.value);
  Rows all;
  for (std::size_t k = 1; k + 1 < rule.places.size(); ++k) {
    const WeightedSum& place = rule.places[k];
    const double m = (place.value - first.value).dot(along) / chord.value.norm();
    append(all, on_chord(text(place.name, " stays on the line from ", first.name, " to ", last.name), place, first,
                         last, m, rule.offset));
  }
  chord.name = text("line from ", first.name, " to ", last.name);
  if (rule.kept) append(all, rows(TangentDirection{chord, {}, *rule.kept}));
  return all;
}

Rows rows(const Stationary& rule) {
  if (rule.axis != 0 && rule.axis != 1) throw InvalidInput(text("rows(Stationary): axis ", rule.axis, " of 0 or 1"));
  const Point along = rule.axis == 0 ? Point(1.0, -lean("rows(Stationary)", rule.frame)) : Point(Point::UnitY());
  std::string name = rule.derivative.name + axis_word[rule.axis];
  if (rule.axis == 0) name += leaning(rule.frame);
  return {row_of(name + ", an extremum", {{rule.derivative, along}}, -along.dot(rule.derivative.value))};
}

Rows rows(const AtHeight& rule) {
  const double height = rule.height.value_or(rule.place.value.y());
  return {row_of(text(rule.place.name, rule.height ? " is at zone y = " : " stays at zone y = ", height),
                 {{rule.place, Point::UnitY()}}, height - rule.place.value.y())};
}

namespace {

// Across a stem from left to right, so that its width is positive.
Point across_of(const char* rule, const Stem& stem) {
  const Point across = unit(rule, text("across from ", stem.left.name, " to ", stem.right.name), stem.across);
  return across.dot(stem.right.value - stem.left.value) < 0.0 ? Point(-across) : across;
}

double width_of(const Stem& stem, const Point& across) { return across.dot(stem.right.value - stem.left.value); }

std::string name_of(const Stem& stem) { return text("stem from ", stem.left.name, " to ", stem.right.name); }

}  // namespace

Rows rows(const Stem& rule) {
  const Point across = across_of("rows(Stem)", rule);
  const double width = width_of(rule, across);
  const double wished = rule.width.value_or(width);
  return {row_of(text(name_of(rule), rule.width ? " is " : " stays ", wished, " wide"),
                 {{rule.right, across}, {rule.left, -across}}, wished - width)};
}

Rows rows(const EqualStems& rule) {
  const Point first = across_of("rows(EqualStems)", rule.first);
  const Point second = across_of("rows(EqualStems)", rule.second);
  const double wider = width_of(rule.first, first) - width_of(rule.second, second);
  const bool closed = rule.offset == Offset::Closed;
  return {row_of(
      closed ? text(name_of(rule.first), " is as wide as ", name_of(rule.second))
             : text(name_of(rule.first), " stays ", wider, " wider than ", name_of(rule.second)),
      {{rule.first.right, first}, {rule.first.left, -first}, {rule.second.right, -second}, {rule.second.left, second}},
      closed ? -wider : 0.0)};
}

Rows rows(const Symmetry& rule) {
  const bool reflects = is_reflection(rule.map);
  const std::string name =
      text(rule.image.name, " stays the ", reflects ? "mirror image" : "image", " of ", rule.place.name);
  const Point off = rule.offset == Offset::Closed ? Point(rule.map(rule.place.value) - rule.image.value) : Point(0, 0);
  Rows all;
  for (int axis = 0; axis < 2; ++axis) {
    all.push_back(row_of(name, {{rule.image, Point::Unit(axis)}, {rule.place, -rule.map.linear.row(axis).transpose()}},
                         off[axis]));
  }
  return all;
}

Rows rows(const FrozenStretch& rule) {
  Rows all;
  for (const int point : rule.points) {
    if (point < 0) throw InvalidInput(text("rows(FrozenStretch): point ", point, " of ", rule.name));
    const std::string name = text("point ", point, " is frozen with ", rule.name);
    for (int axis = 0; axis < 2; ++axis) all.push_back({name, {{variable(point, axis), 1.0}}, 0.0});
  }
  return all;
}

namespace {

void require_location(const BezierContour& contour, const OutlineCurve::Location& at) {
  require_segment("frozen_between", contour, at.segment);
  if (!(at.u >= 0.0 && at.u <= 1.0)) throw InvalidInput(text("frozen_between: u = ", at.u, " of segment ", at.segment));
}

FrozenStretch frozen_pieces(std::string name, Scheme scheme, Eigen::Index size,
                            const std::vector<Eigen::Index>& pieces) {
  std::set<int> points;
  for (const Eigen::Index piece : pieces) {
    for (int k = 0; k <= degree(scheme); ++k) {
      const Eigen::Index point = is_closed(scheme) ? (piece + size - 1 + k) % size : piece + k;
      points.insert(static_cast<int>(point));
    }
  }
  return {std::move(name), {points.begin(), points.end()}};
}

std::string name_of(const Box& box) {
  return text("the box from (", box.low.x(), ", ", box.low.y(), ") to (", box.high.x(), ", ", box.high.y(), ")");
}

void require_box(const Box& box) {
  if (box.is_empty() || !(box.low.y() <= box.high.y()))
    throw InvalidInput(text("frozen_within: ", name_of(box), " is empty"));
}

// Halves the curve until a part lies outside of the box or a point within. What only touches it counts as within.
bool passes_through(const Bezier& bezier, const Box& box, int depth = 40) {
  Box hull;
  for (int k = 0; k <= bezier.degree; ++k) hull.add(bezier.p[static_cast<std::size_t>(k)]);
  if ((hull.high.array() < box.low.array()).any() || (hull.low.array() > box.high.array()).any()) return false;
  const auto within = [&](const Point& p) {
    return (p.array() >= box.low.array()).all() && (p.array() <= box.high.array()).all();
  };
  if (within(bezier.start()) || within(bezier.end()) || depth == 0) return true;
  const auto [before, after] = split(bezier, 0.5);
  return passes_through(before, box, depth - 1) || passes_through(after, box, depth - 1);
}

}  // namespace

FrozenStretch frozen_between(const BezierContour& contour, const OutlineCurve::Location& from,
                             const OutlineCurve::Location& to) {
  require_location(contour, from);
  require_location(contour, to);
  // A stretch that begins at the end of a segment, or ends at the start of one, leaves that segment alone.
  const int first = from.u == 1.0 ? contour.next(from.segment) : from.segment;
  const int last = to.u == 0.0 ? contour.previous(to.segment) : to.segment;
  const bool is_around = from.segment == to.segment && from.u >= to.u;
  std::set<int> points;
  const auto add = [&](int segment) {
    for (int k = 0; k <= contour.degree(segment); ++k) points.insert(contour.point_of(segment, k));
  };
  add(first);
  for (int s = first, steps = 0; (s != last || (is_around && steps == 0)) && steps < contour.segment_count(); ++steps) {
    s = contour.next(s);
    add(s);
  }
  return {text("the stretch from ", from.u, " of segment ", from.segment, " to ", to.u, " of segment ", to.segment),
          {points.begin(), points.end()}};
}

FrozenStretch frozen_between(Scheme scheme, Eigen::Index size, double from, double to) {
  const std::string name = text("the stretch from t = ", from, " to ", to);
  const auto fail = [&](const char* why) { throw InvalidInput(text("frozen_between: ", name, ' ', why)); };
  if (size < fewest(scheme)) fail(text("has ", size, " control points").c_str());
  if (!std::isfinite(from) || !std::isfinite(to) || !(to > from)) fail("is empty");
  const bool closed = is_closed(scheme);
  const Eigen::Index count = closed ? size : size - degree(scheme);
  if (!closed && (from < 0.0 || to > static_cast<double>(count))) fail("leaves the arc");
  const double offset = closed ? 0.5 : 0.0;  // piece i begins at i - offset
  const double begin = std::floor(from + offset);
  const double around = begin - std::floor(begin / static_cast<double>(count)) * static_cast<double>(count);
  const double most = std::min(std::ceil(to + offset) - begin, static_cast<double>(count));
  std::vector<Eigen::Index> pieces;
  for (Eigen::Index k = 0; k < static_cast<Eigen::Index>(most); ++k)
    pieces.push_back((static_cast<Eigen::Index>(around) + k) % count);
  return frozen_pieces(name, scheme, size, pieces);
}

FrozenStretch frozen_within(const BezierContour& contour, const Box& box) {
  require_box(box);
  std::set<int> points;
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (!passes_through(contour.segment(s), box)) continue;
    for (int k = 0; k <= contour.degree(s); ++k) points.insert(contour.point_of(s, k));
  }
  return {name_of(box), {points.begin(), points.end()}};
}

FrozenStretch frozen_within(Scheme scheme, const Points& control_points, const Box& box) {
  require_box(box);
  const Eigen::Index size = control_points.rows();
  if (size < fewest(scheme)) throw InvalidInput(text("frozen_within: ", size, " control points"));
  std::vector<Eigen::Index> pieces;
  for (Eigen::Index i = 0; i < (is_closed(scheme) ? size : size - degree(scheme)); ++i) {
    if (passes_through(bezier_of(scheme, control_points, i), box)) pieces.push_back(i);
  }
  return frozen_pieces(name_of(box), scheme, size, pieces);
}

namespace {

bool is_straight(const Bezier& bezier) {
  const Point chord = bezier.end() - bezier.start();
  if (chord.isZero(0.0)) return false;
  for (std::size_t k = 1; k < static_cast<std::size_t>(bezier.degree); ++k) {
    const Point handle = bezier.p[k] - bezier.start();
    const double along = handle.dot(chord) / chord.squaredNorm();
    if (std::abs(cross(chord, handle)) > straight_angle * chord.squaredNorm() || along < 0.0 || along > 1.0)
      return false;
  }
  return true;
}

}  // namespace

StraightRun straight_run(const BezierContour& contour, int segment) {
  require_segment("straight_run", contour, segment);
  if (!is_straight(contour.segment(segment)))
    throw InvalidInput(text("straight_run: segment ", segment, " is not straight"));
  const auto chord = [&](int s) { return Point(contour.segment(s).end() - contour.segment(s).start()); };
  const Point along = chord(segment);
  // A closed contour turns away somewhere, so both searches end.
  const auto goes_on = [&](int s) {
    const Point other = chord(s);
    return is_straight(contour.segment(s)) && along.dot(other) > 0.0 &&
           std::abs(cross(along, other)) < straight_angle * along.norm() * other.norm();
  };
  int first = segment;
  while (goes_on(contour.previous(first))) first = contour.previous(first);
  int last = segment;
  while (goes_on(contour.next(last))) last = contour.next(last);
  StraightRun run;
  for (int s = first;; s = contour.next(s)) {
    for (int k = s == first ? 0 : 1; k <= contour.degree(s); ++k)
      run.places.push_back(point_of(contour.points(), contour.point_of(s, k)));
    if (s == last) return run;
  }
}

std::vector<Stem> stems_between(const BezierContour& first, int a, const BezierContour& second, int b) {
  require_segment("stems_between", first, a);
  require_segment("stems_between", second, b);
  const Bezier left = first.segment(a);
  const Bezier right = second.segment(b);
  const auto refuse = [&](const char* why) {
    throw InvalidInput(text("stems_between: segments ", a, " and ", b, ' ', why));
  };
  const Point along = unit("stems_between", text("segment ", a), left.end() - left.start());
  const Point other = unit("stems_between", text("segment ", b), right.end() - right.start());
  const auto at = [&](double u, double v, const std::optional<Point>& across) {
    Stem stem{curve_at(first, a, u), curve_at(second, b, v), {}, {}};
    stem.across = across.value_or(stem.right.value - stem.left.value);
    if (stem.across.isZero(0.0)) refuse("meet");
    return stem;
  };
  if (std::abs(along.dot(other)) < std::numbers::sqrt2 / 2.0)
    refuse("are not opposite: they meet at more than 45 degrees");
  std::vector<Stem> stems;
  if (left.degree == 1 && right.degree == 1) {
    // Where both are, as lengths along the first.
    const double whole = (left.end() - left.start()).norm();
    const double begin = (right.start() - left.start()).dot(along);
    const double end = (right.end() - left.start()).dot(along);
    const double from = std::max(0.0, std::min(begin, end));
    const double to = std::min(whole, std::max(begin, end));
    if (!(to > from)) refuse("are not opposite: they do not face each other");
    for (const double s : {from, to}) {
      const double v = std::clamp((s - begin) / (end - begin), 0.0, 1.0);
      stems.push_back(at(std::clamp(s / whole, 0.0, 1.0), v, left_of(along)));
    }
    return stems;
  }
  const int n = std::max(left.degree, right.degree);
  for (int k = 0; k <= n; ++k) {
    const double u = static_cast<double>(k) / n;
    stems.push_back(at(u, along.dot(other) < 0.0 ? 1.0 - u : u, {}));
  }
  return stems;
}

Affine mirror_about(const Point& on_line, const Point& direction) {
  require_finite("mirror_about", "the point", on_line);
  const Point along = unit("mirror_about", "the line", direction);
  const Eigen::Matrix2d linear = 2.0 * along * along.transpose() - Eigen::Matrix2d::Identity();
  return {linear, on_line - linear * on_line};
}

Affine half_turn_about(const Point& centre) {
  require_finite("half_turn_about", "the centre", centre);
  return {-Eigen::Matrix2d::Identity(), 2.0 * centre};
}

std::vector<std::array<int, 2>> symmetric_pairs(const BezierContour& contour, const Affine& map, double tolerance) {
  if (!(tolerance >= 0.0)) throw InvalidInput(text("symmetric_pairs: tolerance ", tolerance));
  const int n = static_cast<int>(contour.point_count());
  const bool reflects = is_reflection(map);
  // A reflection runs the contour backwards, k to c - k; a half turn forwards, k to k + c.
  std::vector<std::array<int, 2>> best;
  double best_distance = tolerance;
  for (int c = 0; c < n; ++c) {
    if (!reflects && 2 * c % n != 0) continue;
    const auto partner = [&](int k) { return reflects ? (c - k + n) % n : (k + c) % n; };
    double worst = 0.0;
    for (int k = 0; k < n && worst <= best_distance; ++k) {
      const int l = partner(k);
      worst = contour.kind(k) == contour.kind(l) ? std::max(worst, (map(contour.point(k)) - contour.point(l)).norm())
                                                 : std::numeric_limits<double>::infinity();
    }
    if (!(worst <= best_distance) || (!best.empty() && worst == best_distance)) continue;
    best_distance = worst;
    best.clear();
    for (int k = 0; k < n; ++k) {
      if (k <= partner(k)) best.push_back({k, partner(k)});
    }
  }
  return best;
}

namespace {

constexpr double straight_turn = 1e-9;  // sine of a turn: less is rounding
constexpr double held_turn = 0.05;      // of its size, so that a hold that is a little off is on the right side

struct Turn {
  int before, point, after;
  double area;  // cross product of the legs: twice the signed area of their triangle
  double size;  // product of their lengths
};

Point point_at(const Points& points, int k) { return points.row(k).transpose(); }

Turn turn_at(const Points& points, int before, int point, int after) {
  const Point in = point_at(points, point) - point_at(points, before);
  const Point out = point_at(points, after) - point_at(points, point);
  return {before, point, after, cross(in, out), in.norm() * out.norm()};
}

// Points that lie on the one before are passed over: they have no turn of their own.
std::vector<Turn> turns_of(const char* function, const Points& points, const ConvexStretch& stretch) {
  std::vector<int> distinct;
  for (const int k : stretch.points) {
    require_point(function, k, points.rows());
    require_finite(function, text("point ", k), point_at(points, k));
    if (distinct.empty() || point_at(points, k) != point_at(points, distinct.back())) distinct.push_back(k);
  }
  const bool closed = stretch.closed;
  while (closed && distinct.size() > 1 && point_at(points, distinct.front()) == point_at(points, distinct.back()))
    distinct.pop_back();
  const std::size_t n = distinct.size();
  if (n < 3) throw InvalidInput(text(function, ": a stretch of ", n, " different points has no turn"));
  std::vector<Turn> turns;
  for (std::size_t k = closed ? 0 : 1; k < (closed ? n : n - 1); ++k)
    turns.push_back(turn_at(points, distinct[(k + n - 1) % n], distinct[k], distinct[(k + 1) % n]));
  return turns;
}

int side(const Turn& turn) { return std::abs(turn.area) <= straight_turn * turn.size ? 0 : turn.area > 0.0 ? 1 : -1; }

const Turn& turn_of(const char* function, const std::vector<Turn>& turns, int point) {
  const auto turn = std::find_if(turns.begin(), turns.end(), [&](const Turn& any) { return any.point == point; });
  if (turn == turns.end()) throw InvalidInput(text(function, ": point ", point, " is no turn of the stretch"));
  return *turn;
}

}  // namespace

std::vector<int> added_inflections(const Points& points, const ConvexStretch& stretch, const Points& displaced) {
  const std::vector<Turn> turns = turns_of("added_inflections", points, stretch);
  if (displaced.rows() != points.rows())
    throw InvalidInput(text("added_inflections: ", displaced.rows(), " displaced points of ", points.rows()));
  std::vector<int> sides;
  std::vector<Turn> now;
  for (const Turn& turn : turns) {
    sides.push_back(side(turn));
    now.push_back(turn_at(displaced, turn.before, turn.point, turn.after));
  }
  // A straight turn takes the side of the one before, the first ones that of the one after; where all are straight,
  // that of the largest turn there is now.
  const auto bent = std::find_if(sides.begin(), sides.end(), [](int s) { return s != 0; });
  int before = 0;
  if (bent != sides.end()) {
    before = *bent;
    if (stretch.closed) before = *std::find_if(sides.rbegin(), sides.rend(), [](int s) { return s != 0; });
  } else {
    before = side(*std::max_element(now.begin(), now.end(),
                                    [](const Turn& a, const Turn& b) { return std::abs(a.area) < std::abs(b.area); }));
  }
  std::vector<int> added;
  for (std::size_t k = 0; k < turns.size(); ++k) {
    if (sides[k] != 0) before = sides[k];
    if (before * side(now[k]) < 0) added.push_back(turns[k].point);
  }
  return added;
}

Rows held_turns(const Points& points, const ConvexStretch& stretch, const Points& displaced,
                const std::vector<int>& turns) {
  const std::vector<Turn> all = turns_of("held_turns", points, stretch);
  Rows result;
  for (const int point : turns) {
    const Turn& turn = turn_of("held_turns", all, point);
    const Point in = point_at(displaced, turn.point) - point_at(displaced, turn.before);
    const Point out = point_at(displaced, turn.after) - point_at(displaced, turn.point);
    const double size = in.norm() + out.norm();
    if (!(size > 0.0)) throw InvalidInput(text("held_turns: the legs at point ", point, " have no length"));
    // d cross(in, out) = cross(d in, out) + cross(in, d out), divided by the legs so that the row is in font units.
    const Point by_before = left_of(out) / size;
    const Point by_after = left_of(in) / size;
    const Point by_point = -by_before - by_after;
    const double wished = held_turn * turn.area;
    Row row{text("the turn at point ", point, " stays to the ", turn.area < 0.0 ? "right" : "left", ": ", wished,
                 " square units"),
            {},
            (wished - cross(in, out)) / size};
    for (const auto& [k, by] : {std::pair{turn.before, by_before}, {turn.point, by_point}, {turn.after, by_after}}) {
      for (int axis = 0; axis < 2; ++axis) {
        row.terms.push_back({variable(k, axis), by[axis]});
        row.value += by[axis] * (displaced(k, axis) - points(k, axis));
      }
    }
    result.push_back(std::move(row));
  }
  return result;
}

Rows kept_turns(const Points& points, const ConvexStretch& stretch, const std::vector<int>& turns) {
  const std::vector<Turn> all = turns_of("kept_turns", points, stretch);
  Rows result;
  for (const int point : turns) {
    const Turn& turn = turn_of("kept_turns", all, point);
    const WeightedSum in = edge(point_of(points, turn.before), point_of(points, turn.point));
    const WeightedSum out = edge(point_of(points, turn.point), point_of(points, turn.after));
    // out = W in with W a turn and a ratio: the cross product is |in|^2 times its sine part, whatever `in` becomes.
    const double cosine = in.value.dot(out.value) / in.value.squaredNorm();
    const double sine = turn.area / in.value.squaredNorm();
    const std::string name = text("the turn at point ", point, " stays ",
                                  std::atan2(turn.area, in.value.dot(out.value)) * degrees, " degrees");
    result.push_back(row_of(name, {{out, Point::UnitX()}, {in, Point(-cosine, sine)}}, 0.0));
    result.push_back(row_of(name, {{out, Point::UnitY()}, {in, Point(-sine, -cosine)}}, 0.0));
  }
  return result;
}

ConvexSolution keep_convex(const Points& points, const std::vector<ConvexStretch>& stretches,
                           const std::function<Points(const Rows&)>& solve, int linear_tries) {
  ConvexSolution solution{solve({}), {}, {}, 1};
  std::vector<std::map<int, int>> strikes(stretches.size());  // per stretch: turns, and how often they left their side
  while (true) {
    solution.left.clear();
    bool can_hold_more = false;
    for (std::size_t k = 0; k < stretches.size(); ++k) {
      for (const int turn : added_inflections(points, stretches[k], solution.displaced)) {
        solution.left.push_back(turn);
        can_hold_more = ++strikes[k][turn] <= linear_tries + 1 || can_hold_more;
      }
    }
    if (!can_hold_more) return solution;
    solution.rows.clear();
    for (std::size_t k = 0; k < stretches.size(); ++k) {
      std::vector<int> held, kept;
      for (const auto& [turn, times] : strikes[k]) (times <= linear_tries ? held : kept).push_back(turn);
      append(solution.rows, kept_turns(points, stretches[k], kept));
      append(solution.rows, held_turns(points, stretches[k], solution.displaced, held));
    }
    solution.displaced = solve(solution.rows);
    ++solution.solves;
  }
}

namespace {

constexpr double vanishing_term = 1e-15;    // of the largest of a row
constexpr std::size_t rows_at_a_time = 32;  // filtered together: bounds the dense matrix

}  // namespace

Rows at_level(const Rows& fine, Scheme scheme, Eigen::Index size, int levels, Details details) {
  if (levels < 0 || levels > most_levels(scheme, size))
    throw InvalidInput(text("at_level: ", levels, " levels below ", size, " control points"));
  Rows result;
  for (std::size_t begin = 0; begin < fine.size(); begin += rows_at_a_time) {
    const std::size_t end = std::min(fine.size(), begin + rows_at_a_time);
    Coefficients weights = Coefficients::Zero(size, static_cast<Eigen::Index>(2 * (end - begin)));
    for (std::size_t r = begin; r < end; ++r) {
      for (const auto& [at, coefficient] : fine[r].terms) {
        if (at < 0 || at >= 2 * size)
          throw InvalidInput(text("at_level: ", fine[r].name.str(), ": variable ", at, " of ", 2 * size));
        weights(at / 2, static_cast<Eigen::Index>(2 * (r - begin)) + at % 2) += coefficient;
      }
    }
    MultiresCurve coefficients{std::move(weights), {}, scheme};
    for (int down = 0; down < levels; ++down) {
      Split split = adjoint(scheme, coefficients.coarse);
      coefficients.coarse = std::move(split.coarse);
      coefficients.details.insert(coefficients.details.begin(), std::move(split.detail));
    }
    const Coefficients stacked = details == Details::Moved ? stack(coefficients) : coefficients.coarse;
    for (std::size_t r = begin; r < end; ++r) {
      const auto both = stacked.middleCols<2>(static_cast<Eigen::Index>(2 * (r - begin)));
      const double least = vanishing_term * both.cwiseAbs().maxCoeff();
      Row row{fine[r].name, {}, fine[r].value};
      for (Eigen::Index i = 0; i < both.rows(); ++i) {
        for (int axis = 0; axis < 2; ++axis) {
          if (std::abs(both(i, axis)) > least)
            row.terms.push_back({variable(static_cast<int>(i), axis), both(i, axis)});
        }
      }
      result.push_back(std::move(row));
    }
  }
  return result;
}

}  // namespace fontcore
