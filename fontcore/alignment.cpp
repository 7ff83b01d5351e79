#include "fontcore/alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr double shortest_flat = 10e-3;  // em
constexpr double one_height = 4e-3;      // em: heights this near are one
constexpr double most_overshoot = 30e-3;
constexpr double least_share = 0.05;  // of all shapes

struct Height {
  double y = 0.0;
  int count = 0;  // shapes
};

// Heights that several shapes share; every run of near ones by the most frequent of them, the lower of two.
std::vector<Height> shared_heights(const std::map<double, std::set<std::size_t>>& at, double width, std::size_t least) {
  std::vector<Height> result;
  for (auto begin = at.begin(); begin != at.end();) {
    std::set<std::size_t> shapes;
    auto best = begin;
    auto end = begin;
    for (; end != at.end() && end->first - begin->first <= width; ++end) {
      shapes.insert(end->second.begin(), end->second.end());
      if (end->second.size() > best->second.size()) best = end;
    }
    if (shapes.size() >= least) result.push_back({best->first, static_cast<int>(shapes.size())});
    begin = end;
  }
  return result;
}

// Where ink ends upwards or downwards, by height: which shapes have such a feature.
struct Features {
  std::map<double, std::set<std::size_t>> flat, round;
};

// Features of a contour into those that end upwards [1] or downwards [0]. With the ink to the left the outline goes
// backwards (towards smaller x) along a top and forwards along a bottom.
void gather(const BezierContour& contour, bool ink_is_left, double units_per_em, std::size_t shape,
            std::array<Features, 2>& features) {
  struct Step {
    Bezier bezier;
    bool is_level;
  };
  // Pieces that rise or fall throughout, and level lines.
  std::vector<Step> steps;
  for (int s = 0; s < contour.segment_count(); ++s) {
    Bezier rest = contour.segment(s);
    if (is_degenerate(rest)) continue;
    double passed = 0.0;
    for (const double u : extrema(rest, 1)) {
      const auto [before, after] = split(rest, (u - passed) / (1.0 - passed));
      steps.push_back({before, false});
      rest = after;
      passed = u;
    }
    steps.push_back({rest, rest.degree == 1 && rest.start().y() == rest.end().y()});
  }
  const std::size_t n = steps.size();
  const auto rise = [&](std::size_t k) { return steps[k % n].bezier.end().y() - steps[k % n].bezier.start().y(); };
  for (std::size_t k = 0; k < n; ++k) {
    if (steps[k].is_level) continue;
    // The next piece that is not level, and how far the outline goes level before it.
    std::size_t next = k + 1;
    double level = 0.0;
    for (; steps[next % n].is_level && next < k + n; ++next)
      level += steps[next % n].bezier.end().x() - steps[next % n].bezier.start().x();
    if (!(rise(k) * rise(next) < 0.0)) continue;
    const bool is_highest = rise(k) > 0.0;
    const Point in = end_tangent(steps[k].bezier);
    const Point out = start_tangent(steps[next % n].bezier);
    const bool goes_back = level != 0.0 ? level < 0.0 : in.x() + out.x() < 0.0;
    if (is_highest != (goes_back == ink_is_left)) continue;  // a counter, or the inside of an arch
    Features& kind = features[is_highest ? 1 : 0];
    const double y = steps[k].bezier.end().y();
    const bool is_round = std::abs(in.y()) < 0.02 && std::abs(out.y()) < 0.02;
    if (std::abs(level) >= shortest_flat * units_per_em && !is_round) kind.flat[y].insert(shape);
    if (is_round) kind.round[y].insert(shape);
  }
}

}  // namespace

std::vector<AlignmentZone> find_zones(std::span<const std::vector<BezierContour>> shapes, double units_per_em) {
  if (!(units_per_em > 0.0) || !std::isfinite(units_per_em))
    throw InvalidInput(text("find_zones: ", units_per_em, " units to the em"));
  std::array<Features, 2> features;
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    double largest = 0.0;
    for (const BezierContour& contour : shapes[k]) {
      const double area = signed_area(contour);
      if (std::abs(area) > std::abs(largest)) largest = area;
    }
    for (const BezierContour& contour : shapes[k]) gather(contour, largest > 0.0, units_per_em, k, features);
  }
  const auto least =
      static_cast<std::size_t>(std::max(2.0, std::ceil(least_share * static_cast<double>(shapes.size()))));
  std::vector<AlignmentZone> zones;
  for (const bool is_top : {false, true}) {
    const Features& kind = features[is_top ? 1 : 0];
    const double width = one_height * units_per_em;
    const std::size_t first = zones.size();
    for (const Height& flat : shared_heights(kind.flat, width, least))
      zones.push_back({flat.y, flat.y, flat.count, 0, is_top});
    const std::size_t end = zones.size();
    for (const Height& round : shared_heights(kind.round, width, least)) {
      // The nearest flat height inside; near misses to the other side are drawing errors of a flat round.
      const auto beyond = [&](const AlignmentZone& zone) { return is_top ? round.y - zone.flat : zone.flat - round.y; };
      AlignmentZone* nearest = nullptr;
      for (std::size_t z = first; z < end; ++z) {
        if (beyond(zones[z]) < -width || beyond(zones[z]) > most_overshoot * units_per_em) continue;
        if (!nearest || std::abs(beyond(zones[z])) < std::abs(beyond(*nearest))) nearest = &zones[z];
      }
      if (!nearest) {
        zones.push_back({round.y, round.y, 0, round.count, is_top});
      } else if (round.count > nearest->round_count) {
        nearest->overshoot = round.y;
        nearest->round_count = round.count;
      }
    }
  }
  std::stable_sort(zones.begin(), zones.end(), [](const auto& a, const auto& b) { return a.flat < b.flat; });
  return zones;
}

std::vector<double> heights(const std::vector<AlignmentZone>& zones) {
  std::set<double> all;
  for (const AlignmentZone& zone : zones) all.insert({zone.flat, zone.overshoot});
  return {all.begin(), all.end()};
}

}  // namespace fontcore
