#pragma once

#include <cmath>
#include <initializer_list>
#include <numbers>
#include <random>
#include <vector>

#include "fontcore/contour.h"

/// Named outlines whose area, length and corners are known, in font units, counter-clockwise unless said otherwise.
namespace shapes {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;

inline Points points_of(const std::vector<Point>& list) {
  Points points(static_cast<Eigen::Index>(list.size()), 2);
  for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i];
  return points;
}

inline BezierContour polygon(const std::vector<Point>& corners) {
  return {points_of(corners), std::vector<PointKind>(corners.size(), PointKind::Node)};
}

inline BezierContour square(double side) { return polygon({{0, 0}, {side, 0}, {side, side}, {0, side}}); }

/// Four cubics round the origin; within 2.8e-4 of the radius of a circle, of area pi r^2 to 2e-4.
inline BezierContour circle(double radius) {
  const double k = 4.0 / 3.0 * (std::numbers::sqrt2 - 1.0) * radius;
  const double r = radius;
  return {
      points_of(
          {{r, 0}, {r, k}, {k, r}, {0, r}, {-k, r}, {-r, k}, {-r, 0}, {-r, -k}, {-k, -r}, {0, -r}, {k, -r}, {r, -k}}),
      {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic,
       PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic}};
}

/// A TrueType contour of quadratic handles alone: every node is implied.
inline BezierContour all_implied(const Points& handles) {
  return fontcore::from_quadratic_points(handles, std::vector<bool>(static_cast<std::size_t>(handles.rows()), false));
}

/// A half disc on a square: straight sides, smooth line-to-curve joins, corners and an extremum.
inline BezierContour arch(double side) {
  const double r = 0.5 * side;
  return fontcore::from_quadratic_points(
      points_of({{0, 0}, {side, 0}, {side, side}, {side, side + r}, {r, side + r}, {0, side + r}, {0, side}}),
      {true, true, true, false, true, false, true});
}

/// Two-storey a of a serif face: outer contour (clockwise, as TrueType has it) and counter. 2048 units per em.
inline std::vector<BezierContour> letter_a() {
  struct Entry {
    int x, y, on;
  };
  const auto contour = [](std::initializer_list<Entry> entries) {
    std::vector<Point> points;
    std::vector<bool> on_curve;
    for (const Entry& entry : entries) {
      points.emplace_back(entry.x, entry.y);
      on_curve.push_back(entry.on == 1);
    }
    return fontcore::from_quadratic_points(points_of(points), on_curve);
  };
  return {contour({{465, 961, 1}, {619, 961, 0}, {764, 835, 0}, {764, 705, 1}, {764, 70, 1},  {881, 45, 1},
                   {881, 0, 1},   {623, 0, 1},   {604, 94, 1},  {490, -20, 0}, {313, -20, 1}, {72, -20, 0},
                   {72, 260, 1},  {72, 354, 0},  {145, 477, 0}, {305, 542, 0}, {457, 545, 1}, {598, 549, 1},
                   {598, 696, 1}, {598, 793, 0}, {527, 885, 0}, {453, 885, 1}, {353, 885, 0}, {270, 838, 1},
                   {236, 721, 1}, {180, 721, 1}, {180, 926, 1}, {342, 961, 0}}),
          contour({{598, 479, 1},
                   {467, 475, 1},
                   {333, 470, 0},
                   {238, 376, 0},
                   {238, 266, 1},
                   {238, 90, 0},
                   {381, 90, 1},
                   {449, 90, 0},
                   {548, 121, 0},
                   {598, 145, 1}})};
}

inline Points random_points(Eigen::Index count, unsigned seed, double size = 1000.0) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  Points points(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) points.row(i) << uniform(engine), uniform(engine);
  return points;
}

/// Largest distance between points of the same row.
inline double largest_distance(const Points& a, const Points& b) { return (a - b).rowwise().norm().maxCoeff(); }

}  // namespace shapes
