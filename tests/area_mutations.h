#pragma once

// Changes to outlines that a check of areas has to find, and those it has to let pass.

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "fontcore/measure.h"
#include "glyphs/font.h"

namespace area_mutations {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using Outline = std::vector<BezierContour>;

/// The font with every glyph drawn by contours of its own.
inline glyphs::Font flattened(glyphs::Font font) {
  std::vector<Outline> outlines;
  for (const glyphs::Glyph& glyph : font.glyphs) {
    outlines.push_back(glyph.trouble.empty() ? glyphs::compose(font, glyph.id) : Outline{});
  }
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    font.glyphs[i].contours = std::move(outlines[i]);
    font.glyphs[i].components.clear();
    font.glyphs[i].origin = 0.0;
  }
  return font;
}

// What is neutral -----------------------------------------------------------------------------------------------------

/// The same contour from another point; as it is where its list of points may not begin there.
inline BezierContour restarted(const BezierContour& contour, int from) {
  const int n = contour.point_count() > 0 ? static_cast<int>(contour.point_count()) : 1;
  while (from < n && !is_node(contour.kind(from))) ++from;
  from %= n;
  Points points(n, 2);
  std::vector<PointKind> kinds;
  for (int i = 0; i < n; ++i) {
    points.row(i) = contour.points().row((i + from) % n);
    kinds.push_back(contour.kind((i + from) % n));
  }
  return is_node(kinds.front()) ? BezierContour(points, kinds) : contour;
}

inline Outline with_other_starts(Outline outline) {
  for (BezierContour& contour : outline) contour = restarted(contour, static_cast<int>(contour.point_count() / 2));
  return outline;
}
inline Outline in_other_order(Outline outline) {
  std::rotate(outline.begin(), outline.begin() + static_cast<std::ptrdiff_t>(outline.size() / 2), outline.end());
  std::reverse(outline.begin(), outline.begin() + static_cast<std::ptrdiff_t>(outline.size() / 2));
  return outline;
}
inline Outline the_other_way(Outline outline) {
  for (BezierContour& contour : outline) contour = reverse(contour);
  return outline;
}

// What is to be found -------------------------------------------------------------------------------------------------

/// Gradient of the area where implied nodes follow their handles.
inline Points free_gradient(const BezierContour& contour) {
  Points gradient = fontcore::area_gradient(contour);
  const Points raw = gradient;
  const int n = static_cast<int>(contour.point_count());
  for (int i = 0; i < n; ++i) {
    if (contour.kind(i) != PointKind::ImpliedNode) continue;
    gradient.row((i + 1) % n) += 0.5 * raw.row(i);
    gradient.row((i + n - 1) % n) += 0.5 * raw.row(i);
    gradient.row(i).setZero();
  }
  return gradient;
}

inline BezierContour moved(const BezierContour& contour, const Points& by) {
  Points points = contour.points() + by;
  const int n = static_cast<int>(contour.point_count());
  for (int i = 0; i < n; ++i) {
    if (contour.kind(i) == PointKind::ImpliedNode)
      points.row(i) = 0.5 * (points.row((i + 1) % n) + points.row((i + n - 1) % n));
  }
  return contour.with_points(points);
}

/// One contour scaled about its centre, so that the area of the whole changes by this share.
inline std::optional<Outline> with_other_area(Outline outline, double share, std::mt19937& random) {
  const double area = fontcore::signed_area(outline);
  BezierContour& contour = outline[random() % outline.size()];
  const double own = fontcore::signed_area(contour);
  if (own == 0.0) return {};
  const double factor = std::sqrt(1.0 + share * area / own);
  if (!(factor > 0.5 && factor < 2.0)) return {};
  const Point centre = fontcore::moments(contour).centroid();
  contour = transform(contour, {.linear = factor * Eigen::Matrix2d::Identity(), .shift = (1.0 - factor) * centre});
  return outline;
}

enum class LocalMove {
  Node,        ///< a node with its handles, along the outline's chord
  Nodes,       ///< a node with its handles, and another that gives the area back
  Lone,        ///< a point alone, node or handle, along the chord
  LoneAndNode  ///< a point alone, and a node that gives the area back
};
constexpr std::array<LocalMove, 4> local_moves{LocalMove::Node, LocalMove::Nodes, LocalMove::Lone,
                                               LocalMove::LoneAndNode};

/// The outline with a part of it moved so that it lies `distance` off, both ways, and its area stays; none if the
/// choice at random leads to no such move.
inline std::optional<Outline> locally_moved(Outline outline, LocalMove how, double distance, std::mt19937& random) {
  BezierContour& contour = outline[random() % outline.size()];
  const int n = static_cast<int>(contour.point_count());
  if (n < 3) return {};
  const Points gradient = free_gradient(contour);
  const bool takes_handles = how == LocalMove::Node || how == LocalMove::Nodes;
  const int chosen = static_cast<int>(random() % static_cast<unsigned>(n));
  if (contour.kind(chosen) == PointKind::ImpliedNode || (takes_handles && contour.kind(chosen) != PointKind::Node))
    return {};
  std::vector<int> part{chosen};
  if (takes_handles) {
    for (const int beside : {(chosen + 1) % n, (chosen + n - 1) % n})
      if (!is_node(contour.kind(beside)) && part.back() != beside) part.push_back(beside);
  }
  Eigen::RowVector2d slope = Eigen::RowVector2d::Zero();
  for (const int i : part) slope += gradient.row(i);
  if (slope.norm() == 0.0) return {};
  Points by = Points::Zero(n, 2);
  if (how == LocalMove::Node || how == LocalMove::Lone) {
    const Eigen::RowVector2d along = Eigen::RowVector2d(-slope.y(), slope.x()).normalized();
    for (const int i : part) by.row(i) = random() % 2 == 0 ? along : Eigen::RowVector2d(-along);
  } else {
    const int other = static_cast<int>(random() % static_cast<unsigned>(n));
    if (contour.kind(other) != PointKind::Node || std::find(part.begin(), part.end(), other) != part.end()) return {};
    const Eigen::RowVector2d back = gradient.row(other);
    if (back.norm() == 0.0) return {};
    const double angle = static_cast<double>(random() % 628) / 100.0;
    const Eigen::RowVector2d to(std::cos(angle), std::sin(angle));
    for (const int i : part) by.row(i) = to;
    by.row(other) -= to.dot(slope) / back.squaredNorm() * back;
  }
  const auto off = [&](double amount) {
    return fontcore::farthest(contour, moved(contour, amount * by), 5e-3 * distance).distance;
  };
  double low = 0.0;
  double high = distance;
  for (int step = 0; step < 6 && off(high) < distance; ++step) high *= 2.0;
  if (off(high) < distance) return {};
  for (int step = 0; step < 12; ++step) {
    const double middle = 0.5 * (low + high);
    (off(middle) < distance ? low : high) = middle;
  }
  const double before = fontcore::signed_area(contour);
  const double whole = std::abs(fontcore::signed_area(outline));
  contour = moved(contour, high * by);
  // Two parts that share a segment change the area a little after all.
  if (std::abs(fontcore::signed_area(contour) - before) > 5e-4 * whole) return {};
  return outline;
}

}  // namespace area_mutations
