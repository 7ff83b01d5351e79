#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/measure.h"

/// What has become of segments that were to be kept.
struct KeptSegments {
  int missing = 0;            ///< not in the other contour bit for bit, in their order, with implied nodes between them
  double largest_turn = 0.0;  ///< at their ends, where the source is smooth, radians
};

/// Ends count as smooth that turn by no more than `corner_angle`; those between a kept segment and a straight run,
/// which has its own direction, that turn by no more than 1.5 degrees.
inline KeptSegments find_kept(const fontcore::BezierContour& source, const std::vector<int>& kept,
                              const fontcore::BezierContour& now, double corner_angle) {
  using fontcore::PointKind;
  KeptSegments found;
  std::vector<int> place(static_cast<std::size_t>(source.segment_count()), -1);
  const auto place_of = [&](int s) { return place[static_cast<std::size_t>(s)]; };
  const auto is_same = [&](int s, int r) {
    return source.degree(s) == now.degree(r) && source.segment(s).p == now.segment(r).p;
  };
  int last = -1;
  for (const int s : kept) {
    for (int i = 1; i <= now.segment_count() && place_of(s) < 0; ++i) {
      const int r = (last + i) % now.segment_count();
      if (is_same(s, r)) place[static_cast<std::size_t>(s)] = r;
      if (last < 0 && r + 1 == now.segment_count()) break;
    }
    if (place_of(s) < 0) ++found.missing;
    last = place_of(s) < 0 ? last : place_of(s);
  }
  // In order: once round at most.
  int rounds = 0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const int own = place_of(kept[i]);
    const int next = place_of(kept[(i + 1) % kept.size()]);
    if (kept.size() > 1 && next <= own) ++rounds;
  }
  if (rounds > 1) ++found.missing;

  const std::vector<double> was = turning_angles(source);
  const std::vector<double> is = turning_angles(now);
  constexpr double smooth = 1.5 * std::numbers::pi / 180.0;
  for (const int s : kept) {
    if (place_of(s) < 0) continue;
    const int before = place_of(source.previous(s));
    const int r = place_of(s);
    const bool is_between = before >= 0 && before == now.previous(r);
    const PointKind kind = is_between ? source.kind(source.node(s)) : now.kind(now.node(r));
    if (now.kind(now.node(r)) != kind) ++found.missing;
    for (const bool at_end : {false, true}) {
      const auto node = [&](const fontcore::BezierContour& contour, int segment) {
        return static_cast<std::size_t>(at_end ? contour.next(segment) : segment);
      };
      const int other = at_end ? now.next(r) : now.previous(r);
      if (is_same(at_end ? source.next(s) : source.previous(s), other)) continue;  // the source's own join
      const double limit = now.degree(other) == 1 ? smooth : corner_angle;
      if (std::abs(was[node(source, s)]) <= limit)
        found.largest_turn = std::max(found.largest_turn, std::abs(is[node(now, r)]));
    }
  }
  return found;
}

/// About a share of a contour's segments, in runs as often as alone.
inline std::vector<int> random_segments(const fontcore::BezierContour& contour, double share, std::mt19937& engine) {
  std::bernoulli_distribution is_in(share);
  std::bernoulli_distribution stays(0.5);
  std::vector<int> segments;
  bool was_in = false;
  for (int s = 0; s < contour.segment_count(); ++s) {
    was_in = stays(engine) ? was_in : is_in(engine);
    if (was_in) segments.push_back(s);
  }
  return segments;
}
