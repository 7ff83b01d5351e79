#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/measure.h"

/// Contours with detail laid along every arc, as texture is: what a fit in few segments has most to do with.
namespace textured {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;

struct Texture {
  double wavelength = 40.0;  ///< font units; noise from 0.8 to 1.25 times it
  double amplitude = 4.0;    ///< of a sine of the same energy, font units
  unsigned seed = 1;
  double step = 4.0;  ///< between nodes, font units
};

/// A run of segments from corner to corner, over its arc length.
class Arc {
 public:
  explicit Arc(std::vector<Bezier> segments) : segments_(std::move(segments)) {
    for (std::size_t i = 0; i < segments_.size(); ++i) {
      for (int j = 0; j < parts; ++j) {
        const double u = static_cast<double>(j) / parts;
        if (!places_.empty()) length_ += (evaluate(segments_[i], u) - evaluate_at(places_.back())).norm();
        places_.push_back({static_cast<double>(i) + u, length_});
      }
    }
    length_ += (segments_.back().end() - evaluate_at(places_.back())).norm();
    places_.push_back({static_cast<double>(segments_.size()), length_});
  }
  double length() const { return length_; }
  Point at(double s) const { return evaluate_at(place_of(s)); }
  Point normal(double s) const {
    constexpr double near = 0.05;
    const Point d = at(std::min(s + near, length_)) - at(std::max(s - near, 0.0));
    return Point(-d.y(), d.x()).normalized();
  }

 private:
  static constexpr int parts = 64;
  struct Place {
    double u;
    double s;
  };
  Place place_of(double s) const {
    const auto after = std::upper_bound(places_.begin() + 1, places_.end() - 1, s,
                                        [](double value, const Place& place) { return value < place.s; });
    const Place& a = *(after - 1);
    const double share = std::clamp((s - a.s) / std::max(after->s - a.s, 1e-12), 0.0, 1.0);
    return {a.u + share * (after->u - a.u), s};
  }
  Point evaluate_at(const Place& place) const {
    const std::size_t i = std::min(static_cast<std::size_t>(place.u), segments_.size() - 1);
    return evaluate(segments_[i], place.u - static_cast<double>(i));
  }

  std::vector<Bezier> segments_;
  std::vector<Place> places_;
  double length_ = 0.0;
};

/// The contour with noise along its normals, faded at its corners, as cubics that meet with one derivative.
inline BezierContour contour(const BezierContour& base, const Texture& texture) {
  constexpr double corner = 8.0 * std::numbers::pi / 180.0;
  constexpr int waves = 6;
  const std::vector<double> turns = turning_angles(base);
  const int count = base.segment_count();
  const auto is_corner = [&](int s) { return std::abs(turns[static_cast<std::size_t>(s % count)]) > corner; };
  int begin = 0;
  while (begin < count && !is_corner(begin)) ++begin;
  const bool is_smooth = begin == count;
  if (is_smooth) begin = 0;
  std::mt19937 engine(texture.seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  for (int from = begin; from < begin + count;) {
    int to = from + 1;
    while (to < begin + count && (is_smooth || !is_corner(to))) ++to;
    std::vector<Bezier> segments;
    for (int s = from; s < to; ++s) segments.push_back(base.segment(s % count));
    const Arc arc(std::move(segments));
    from = to;
    struct Wave {
      double frequency;
      double phase;
    };
    std::vector<Wave> noise;
    for (int i = 0; i < waves; ++i) {
      const double wavelength = texture.wavelength * std::pow(1.5625, uniform(engine)) * 0.8;
      const double periods = std::max(1.0, std::round(arc.length() / wavelength));  // a closed arc's noise closes
      noise.push_back({2.0 * std::numbers::pi * periods / arc.length(), 2.0 * std::numbers::pi * uniform(engine)});
    }
    const auto place = [&](double s) -> Point {
      double size = 0.0;
      for (const Wave& wave : noise) size += std::sin(wave.frequency * s + wave.phase);
      size *= texture.amplitude / std::sqrt(waves);
      const double inside = 2.0 * std::min(s, arc.length() - s) / texture.wavelength;
      if (!is_smooth && inside < 1.0) size *= inside * inside * (3.0 - 2.0 * inside);
      return arc.at(s) + size * arc.normal(s);
    };
    const int pieces = std::max(1, static_cast<int>(std::round(arc.length() / texture.step)));
    const double step = arc.length() / pieces;
    const auto wrapped = [&](double s) { return is_smooth ? s - arc.length() * std::floor(s / arc.length()) : s; };
    const auto derivative = [&](int i) -> Point {
      constexpr double near = 0.02;
      const double low = is_smooth ? i * step - near : std::max(0.0, i * step - near);
      const double high = is_smooth ? i * step + near : std::min(arc.length(), i * step + near);
      return (place(wrapped(high)) - place(wrapped(low))) / (high - low);
    };
    for (int i = 0; i < pieces; ++i) {
      const Point start = place(wrapped(i * step));
      const Point end = place(wrapped((i + 1) * step));
      points.insert(points.end(), {start, start + step / 3.0 * derivative(i), end - step / 3.0 * derivative(i + 1)});
      kinds.insert(kinds.end(), {PointKind::Node, PointKind::Cubic, PointKind::Cubic});
    }
  }
  fontcore::Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  return {std::move(rows), std::move(kinds)};
}

}  // namespace textured
