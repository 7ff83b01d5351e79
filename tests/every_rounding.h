#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "fontcore/measure.h"
#include "fontcore/rounding.h"

/// Rounding by trying everything: what `fontcore::round_keeping_area` is measured against.
namespace every_rounding {

using namespace fontcore;

/// Coordinates 2 * point + axis that rules tie, and where they are.
struct Class {
  std::size_t contour = 0;
  std::vector<int> coordinates;
  double exact = 0.0;
  bool is_free = true;  ///< takes its floor or its ceiling; else it is `exact`
};

/// Tied coordinates of one contour. What has not moved, what a zone held there and what is whole is not free.
inline std::vector<Class> classes_of(const Unrounded& contour, std::size_t index) {
  const auto& [edited, original, rules, goal] = contour;
  std::vector<int> label(static_cast<std::size_t>(2 * edited.point_count()));
  for (std::size_t v = 0; v < label.size(); ++v) label[v] = static_cast<int>(v);
  std::set<int> held;
  for (const BezierContour& outline : {edited, original}) {
    for (const Row& row : outline_rows(outline, rules)) {
      if (row.terms.size() == 1) held.insert(row.terms[0].variable);
    }
  }
  for (const Row& row : outline_rows(edited, rules)) {
    if (row.terms.size() != 2 || row.value != 0.0) continue;
    const int from = label[static_cast<std::size_t>(row.terms[0].variable)];
    std::replace(label.begin(), label.end(), from, label[static_cast<std::size_t>(row.terms[1].variable)]);
  }
  std::vector<Class> classes;
  for (const int name : std::set<int>(label.begin(), label.end())) {
    Class one;
    one.contour = index;
    for (int v = 0; v < static_cast<int>(label.size()); ++v) {
      const int p = v / 2;
      if (label[static_cast<std::size_t>(v)] != name || edited.kind(p) == PointKind::ImpliedNode) continue;
      const double at = edited.points()(p, v % 2);
      const double before = original.points()(p, v % 2);
      if (one.coordinates.empty()) one.exact = at;
      one.coordinates.push_back(v);
      const bool is_new = !goal.is_new.empty() && goal.is_new[static_cast<std::size_t>(p)];
      if (is_new) continue;
      if (edited.point(p) == original.point(p) || (held.contains(v) && std::abs(at - before) < 1e-9)) {
        one.is_free = false;
        one.exact = before;
      }
    }
    if (one.coordinates.empty()) continue;
    if (one.is_free && std::abs(one.exact - std::round(one.exact)) < 1e-9) {
      one.is_free = false;
      one.exact = std::round(one.exact);
    }
    classes.push_back(one);
  }
  return classes;
}

inline std::vector<Class> classes_of(const std::vector<Unrounded>& contours) {
  std::vector<Class> all;
  for (std::size_t c = 0; c < contours.size(); ++c) {
    for (Class& one : classes_of(contours[c], c)) all.push_back(std::move(one));
  }
  return all;
}

inline int free_count(const std::vector<Class>& classes) {
  return static_cast<int>(std::count_if(classes.begin(), classes.end(), [](const Class& one) { return one.is_free; }));
}

/// The contours with every class at the given value.
inline std::vector<BezierContour> placed(const std::vector<Unrounded>& contours, const std::vector<Class>& classes,
                                         const std::vector<double>& values) {
  std::vector<Points> points;
  for (const Unrounded& contour : contours) points.push_back(contour.edited.points());
  for (std::size_t k = 0; k < classes.size(); ++k) {
    for (const int v : classes[k].coordinates) points[classes[k].contour](v / 2, v % 2) = values[k];
  }
  std::vector<BezierContour> result;
  for (std::size_t c = 0; c < contours.size(); ++c) {
    const auto n = points[c].rows();
    for (Eigen::Index p = 0; p < n; ++p) {
      if (contours[c].edited.kind(static_cast<int>(p)) == PointKind::ImpliedNode)
        points[c].row(p) = 0.5 * (points[c].row((p + n - 1) % n) + points[c].row((p + 1) % n));
    }
    result.push_back(contours[c].edited.with_points(points[c]));
  }
  return result;
}

/// How an outline turns at a node, from the nearest point before that is not the node to the nearest behind. A segment
/// that lost its length is no way to lose a turn.
inline double turn_at(const BezierContour& contour, int node) {
  const int n = static_cast<int>(contour.point_count());
  const auto beside = [&](int way) -> Point {
    for (int k = 1; k < n; ++k) {
      const Point off = contour.point(((node + way * k) % n + n) % n) - contour.point(node);
      if (off != Point::Zero()) return off;
    }
    return Point::Zero();
  };
  const Point a = -beside(-1);
  const Point b = beside(1);
  return std::abs(std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b)));
}
/// Nodes of smooth joins of the original that turn by more than 1.5 degrees now.
inline std::vector<int> opened_nodes(const Unrounded& contour, const BezierContour& now) {
  const std::vector<double> before = turning_angles(contour.original);
  std::vector<int> nodes;
  for (int s = 0; s < now.segment_count(); ++s) {
    const int node = now.node(s);
    if (now.kind(node) == PointKind::ImpliedNode || contour.rules.marks_corner(node)) continue;
    if (is_degenerate(contour.original.segment(s))) continue;
    if (std::abs(before[static_cast<std::size_t>(s)]) <= smooth_angle && turn_at(now, node) > smooth_angle)
      nodes.push_back(node);
  }
  return nodes;
}
inline int opened_joins(const std::vector<Unrounded>& contours, const std::vector<BezierContour>& now) {
  int count = 0;
  for (std::size_t c = 0; c < contours.size(); ++c) count += static_cast<int>(opened_nodes(contours[c], now[c]).size());
  return count;
}

inline double handle_error(const Unrounded& contour, const BezierContour& now) {
  double worst = 0.0;
  for (const auto& [segment, u] : contour.goal.handles) {
    worst = std::max(worst, (evaluate(now.segment(segment), u) - evaluate(contour.edited.segment(segment), u)).norm());
  }
  return worst;
}

inline double area_error(const std::vector<Unrounded>& contours, const std::vector<BezierContour>& now) {
  double error = 0.0;
  for (std::size_t c = 0; c < contours.size(); ++c) error += signed_area(now[c]) - contours[c].goal.area;
  return error;
}

/// Every coordinate at its nearest whole number.
inline std::vector<BezierContour> plain(const std::vector<Unrounded>& contours, const std::vector<Class>& classes) {
  std::vector<double> values;
  for (const Class& one : classes) values.push_back(one.is_free ? std::floor(one.exact + 0.5) : one.exact);
  return placed(contours, classes, values);
}

/// The least area error of all floors and ceilings that keep smooth joins within 1.5 degrees and handles within a unit
/// of their places; none if no choice does.
inline std::optional<double> least_error(const std::vector<Unrounded>& contours, const std::vector<Class>& classes) {
  std::vector<double> values;
  std::vector<std::size_t> free;
  for (std::size_t k = 0; k < classes.size(); ++k) {
    values.push_back(classes[k].exact);
    if (classes[k].is_free) free.push_back(k);
  }
  std::optional<double> least;
  for (std::size_t choice = 0; choice < std::size_t{1} << free.size(); ++choice) {
    for (std::size_t b = 0; b < free.size(); ++b) {
      const double exact = classes[free[b]].exact;
      values[free[b]] = (choice >> b & 1U) != 0U ? std::ceil(exact) : std::floor(exact);
    }
    const std::vector<BezierContour> now = placed(contours, classes, values);
    const double error = std::abs(area_error(contours, now));
    if ((least && error >= *least) || opened_joins(contours, now) > 0) continue;
    bool keeps_handles = true;
    for (std::size_t c = 0; c < contours.size(); ++c) {
      keeps_handles = keeps_handles && handle_error(contours[c], now[c]) <= 1.0;
    }
    if (keeps_handles) least = error;
  }
  return least;
}

/// Whether whole numbers up to a unit beyond floor and ceiling close the smooth join at a node, by its own point and
/// the one on either side; coordinates that are equal stay equal.
inline bool can_be_closed(const BezierContour& contour, int node) {
  const int n = static_cast<int>(contour.point_count());
  const std::array<int, 3> points{(node + n - 1) % n, node, (node + 1) % n};
  for (int choice = 0; choice < 1 << 12; ++choice) {
    BezierContour tried = contour;
    bool is_kept = true;
    for (int k = 0; k < 3; ++k) {
      Point at;
      for (int axis = 0; axis < 2; ++axis) {
        const double exact = contour.point(points[static_cast<std::size_t>(k)])[axis];
        at[axis] = std::floor(exact) - 1.0 + (choice >> (4 * k + 2 * axis) & 3);
        is_kept = is_kept && at[axis] <= std::ceil(exact) + 1.0;
      }
      tried.set_point(points[static_cast<std::size_t>(k)], at);
    }
    for (int axis = 0; axis < 2; ++axis) {
      for (const auto& [a, b] : {std::pair{points[0], points[1]}, std::pair{points[1], points[2]}}) {
        if (contour.point(a)[axis] == contour.point(b)[axis])
          is_kept = is_kept && tried.point(a)[axis] == tried.point(b)[axis];
      }
    }
    if (is_kept && turn_at(tried, node) <= smooth_angle) return true;
  }
  return false;
}

}  // namespace every_rounding
