#include "fontcore/analogy.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

using Eigen::Index;
constexpr double infinity = std::numeric_limits<double>::infinity();

std::size_t at(Index index) { return static_cast<std::size_t>(index); }

Point point_at(const OutlineArcs& outline, double s) {
  const auto [segment, u] = outline.locate(s);
  return evaluate(outline.contour().segment(segment), u);
}

constexpr double looks_per_reach = 16.0;
constexpr int most_looks = 20000;
constexpr std::size_t most_corners = 4;       // of the other outline that one is compared with
constexpr double rounded = 0.05;              // what a corner costs that has become none, beside squares of shares
constexpr double weight_of_directions = 0.5;  // beside places, as shares of the reach

// How an outline runs about a place, over half the reach.
struct About {
  Point here;
  Point before;
  Point after;
};

About about(const OutlineArcs& outline, double s, double half) {
  const Point here = point_at(outline, s);
  return {here, (here - point_at(outline, s - half)) / half, (point_at(outline, s + half) - here) / half};
}

double disagreement(const About& a, const About& b, double reach) {
  return (a.here - b.here).squaredNorm() / (reach * reach) +
         weight_of_directions * ((a.before - b.before).squaredNorm() + (a.after - b.after).squaredNorm());
}

// Where an arc's start may have gone, and what that costs.
struct Candidate {
  double s;
  double cost;
};

class ArcMatcher {
 public:
  ArcMatcher(const OutlineArcs& plain, const OutlineArcs& other, double reach)
      : plain_(plain), other_(other), reach_(reach) {
    half_ = std::min({0.5 * reach, 0.25 * plain.length(), 0.25 * other.length()});
    const double wanted = std::ceil(looks_per_reach * other.length() / reach);
    const int looks = static_cast<int>(std::clamp(wanted, 64.0, static_cast<double>(most_looks)));
    for (int i = 0; i < looks; ++i) {
      places_.push_back(other.length() * i / looks);
      looks_.push_back(point_at(other, places_.back()));
    }
    if (!other.has_corner()) return;
    for (const OutlineArcs::Arc& arc : other.arcs()) corners_.push_back(arc.start);
  }

  std::vector<Stretch> match() const {
    std::vector<std::vector<Candidate>> candidates;
    for (const OutlineArcs::Arc& arc : plain_.arcs()) candidates.push_back(candidates_of(arc.start));
    std::vector<double> best;
    double least = infinity;
    for (const Candidate& first : candidates[0]) {
      const auto [cost, starts] = chain(candidates, first);
      if (cost < least) {
        least = cost;
        best = starts;
      }
    }
    if (best.empty()) throw InvalidInput("match_arcs: the corners of the two outlines come in no common order");
    std::vector<Stretch> stretches;
    for (std::size_t k = 0; k < best.size(); ++k) {
      double length = other_.length();
      if (best.size() > 1) length = forward(best[k], best[(k + 1) % best.size()]);
      stretches.push_back({best[k], length});
    }
    return stretches;
  }

 private:
  double forward(double from, double to) const {
    const double gap = to - from;
    return gap - std::floor(gap / other_.length()) * other_.length();
  }

  std::vector<Candidate> candidates_of(double s) const {
    const About own = about(plain_, s, half_);
    std::vector<Candidate> found;
    for (const double corner : corners_) {
      const About there = about(other_, corner, half_);
      if ((there.here - own.here).norm() <= 2.0 * reach_) found.push_back({corner, disagreement(own, there, reach_)});
    }
    std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
    found.resize(std::min(found.size(), plain_.has_corner() ? most_corners : 0));
    // The point that runs most alike of those near, or the nearest of all.
    Candidate nearest{0.0, infinity};
    Candidate alike{0.0, infinity};
    for (std::size_t i = 0; i < looks_.size(); ++i) {
      const double distance = (looks_[i] - own.here).norm() / reach_;
      if (distance * distance < nearest.cost) nearest = {places_[i], distance * distance};
      if (distance > 1.0) continue;
      const double cost = disagreement(own, about(other_, places_[i], half_), reach_);
      if (cost < alike.cost) alike = {places_[i], cost};
    }
    if (alike.cost == infinity) alike = nearest;
    alike.cost += plain_.has_corner() ? rounded : 0.0;
    found.push_back(alike);
    return found;
  }

  // The cheapest places in order round the other outline, the first given.
  std::pair<double, std::vector<double>> chain(const std::vector<std::vector<Candidate>>& candidates,
                                               const Candidate& first) const {
    struct Reached {
      double cost;
      std::size_t from;
    };
    const std::size_t n = candidates.size();
    std::vector<std::vector<Reached>> reached(n);
    reached[0] = {{first.cost, 0}};
    const auto off = [&](std::size_t arc, double gap) {
      const double length = plain_.arcs()[arc].length;
      return std::pow((gap - length) / (reach_ + length), 2);
    };
    const auto along = [&](std::size_t k, std::size_t c) {
      return k == 0 ? 0.0 : forward(first.s, candidates[k][c].s);
    };
    for (std::size_t k = 1; k < n; ++k) {
      for (std::size_t c = 0; c < candidates[k].size(); ++c) {
        Reached best{infinity, 0};
        for (std::size_t b = 0; b < reached[k - 1].size(); ++b) {
          const double gap = along(k, c) - along(k - 1, b);
          if (gap <= 0.0 || reached[k - 1][b].cost == infinity) continue;
          const double cost = reached[k - 1][b].cost + off(k - 1, gap) + candidates[k][c].cost;
          if (cost < best.cost) best = {cost, b};
        }
        reached[k].push_back(best);
      }
    }
    std::size_t last = 0;
    double least = infinity;
    for (std::size_t c = 0; c < reached[n - 1].size(); ++c) {
      const double cost = reached[n - 1][c].cost + off(n - 1, other_.length() - along(n - 1, c));
      if (cost < least) {
        least = cost;
        last = c;
      }
    }
    if (least == infinity) return {infinity, {}};
    std::vector<double> starts(n);
    for (std::size_t k = n; k-- > 0;) {
      starts[k] = k == 0 ? first.s : candidates[k][last].s;
      last = reached[k][last].from;
    }
    return {least, starts};
  }

  const OutlineArcs& plain_;
  const OutlineArcs& other_;
  double reach_;
  double half_;
  std::vector<double> places_;
  std::vector<Point> looks_;
  std::vector<double> corners_;
};

constexpr double steps_per_scale = 128.0;
constexpr double most_steps = 10000.0;
constexpr int passes_round = 6;

Points reversed(const Points& points, bool is_closed) {
  Points result = points;
  const Index turned = points.rows() - (is_closed ? 1 : 0);
  result.bottomRows(turned) = points.bottomRows(turned).colwise().reverse();
  return result;
}

// Places of a run's points, as they stand in it, where the base has the same share of its length behind it: as an index
// and a rest.
double index_at(const DetailBase& base, double share) {
  const Eigen::VectorXd& places = base.places();
  const Index n = places.size();
  const double x = share * base.length();
  const Index above = std::upper_bound(places.data(), places.data() + n, x) - places.data();
  const Index low = std::clamp<Index>(above - 1, 0, base.is_closed() ? n - 1 : n - 2);
  const double next = low + 1 < n ? places[low + 1] : base.length();
  const double step = next - places[low];
  return static_cast<double>(low) + (step > 0.0 ? std::clamp((x - places[low]) / step, 0.0, 1.0) : 0.0);
}

// What a stretch of another outline differs by from a run of points, at equal shares of the bases' lengths.
Points difference_along(const DetailBase& base, const Points& own, const OutlineArcs& outline, const Stretch& stretch,
                        InkSide ink, double scale) {
  const Index count = own.rows();
  const double steps = static_cast<double>(base.is_closed() ? count : count - 1);
  const auto other_at = [&](double index) {
    const double share = ink == InkSide::Right ? 1.0 - index / steps : index / steps;
    return point_at(outline, stretch.start + share * stretch.length);
  };
  Points other(count, 2);
  for (Index i = 0; i < count; ++i) other.row(i) = other_at(static_cast<double>(i));
  const DetailBase base_of_other(other, base.is_closed(), scale);
  for (Index i = 0; i < count; ++i) {
    other.row(i) = other_at(index_at(base_of_other, base.places()[i] / base.length()));
  }
  return other - own;
}

}  // namespace

std::vector<Stretch> match_arcs(const OutlineArcs& plain, const OutlineArcs& other, double reach) {
  if (!(reach > 0.0) || !std::isfinite(reach)) throw InvalidInput(text("match_arcs: reach ", reach, " is no length"));
  if (signed_area(plain.contour()) * signed_area(other.contour()) < 0.0) {
    throw InvalidInput("match_arcs: the two outlines run opposite ways");
  }
  return ArcMatcher(plain, other, reach).match();
}

std::vector<DetailSample> learn_difference(const OutlineArcs& plain, const OutlineArcs& textured, double scale,
                                           DetailFrame frame, InkSide ink, const std::string& place) {
  const std::vector<Stretch> stretches = match_arcs(plain, textured, scale);
  const bool is_closed = !plain.has_corner();
  std::vector<DetailSample> samples;
  for (std::size_t k = 0; k < plain.arcs().size(); ++k) {
    const double length = plain.arcs()[k].length;
    if (!is_closed && length < scale) continue;
    const auto steps = static_cast<Index>(std::clamp(std::ceil(length / scale * steps_per_scale), 32.0, most_steps));
    const Index count = is_closed ? steps : steps + 1;
    Points own = points_along(plain, static_cast<int>(k), count);
    if (ink == InkSide::Right) own = reversed(own, is_closed);
    const DetailBase base(own, is_closed, scale);
    Stretch stretch = stretches[k];
    Points difference = difference_along(base, own, textured, stretch, ink, scale);
    // Round a contour without corners nothing but all of it says where the textured one begins.
    for (int pass = 0; is_closed && pass < passes_round; ++pass) {
      const double ahead = difference.cwiseProduct(base.tangents()).rowwise().sum().mean();
      stretch.start += ink == InkSide::Right ? ahead : -ahead;
      difference = difference_along(base, own, textured, stretch, ink, scale);
    }
    const Eigen::VectorXd all = Eigen::VectorXd::Ones(count);
    samples.push_back(to_sample(base, base.detail_part(difference, all), frame));
    if (!place.empty()) samples.back().place = text(place, "/", k);
  }
  return samples;
}

namespace {

constexpr double steps_of_scale = 8.0;  // what is compared stands an eighth of the scale apart
constexpr double weight_of_curvature = 0.25;
constexpr double most_bend = 2.0;  // curvature times the scale: more of it is no worse
constexpr double weight_of_ends = 0.5;
constexpr double jump = 0.15;  // (22 degrees)^2, over a scale

// How a stretch runs at one place.
struct Run {
  double direction;
  double bend;    // curvature times the scale
  double behind;  // to the ends of an open stretch, in scales, at most 1
  double ahead;
};

// A stretch at even steps.
struct Steps {
  double step = 0.0;
  bool is_closed = false;
  std::vector<Run> runs;
};

Steps steps_along(const Points& shape, double length, bool is_closed, double scale, double step) {
  Steps steps{step, is_closed, {}};
  const auto whole = static_cast<Index>(is_closed ? std::max(1.0, std::round(length / step)) : length / step + 1e-6);
  if (is_closed) steps.step = length / static_cast<double>(whole);
  const Index rows = shape.rows();
  for (Index i = 0; i < (is_closed ? whole : whole + 1); ++i) {
    const double x = std::min(static_cast<double>(i) * steps.step, length);
    const double row = x / length * static_cast<double>(is_closed ? rows : rows - 1);
    const Index at_row = std::clamp<Index>(static_cast<Index>(std::lround(row)), 0, rows - 1);
    steps.runs.push_back({shape(at_row, 0), shape(at_row, 1) * scale, is_closed ? 1.0 : std::min(1.0, x / scale),
                          is_closed ? 1.0 : std::min(1.0, (length - x) / scale)});
  }
  return steps;
}

double unlikeness(const Run& a, const Run& b) {
  const double bend = std::clamp(a.bend, -most_bend, most_bend) - std::clamp(b.bend, -most_bend, most_bend);
  const double behind = a.behind - b.behind;
  const double ahead = a.ahead - b.ahead;
  return 2.0 * (1.0 - std::cos(a.direction - b.direction)) + weight_of_curvature * bend * bend +
         weight_of_ends * (behind * behind + ahead * ahead);
}

// A run of a sample along the bed.
struct Taken {
  const DetailSample* sample;
  double from;  // place on the bed where it takes over
  double to;    // and where the next does
  double x;     // a place on the bed,
  double y;     // that of the sample which goes there,
  double rate;  // and how much of the sample a unit of the bed is

  Eigen::RowVector2d at(double place) const {
    const double source = y + (place - x) * rate;
    return value_at(*sample, false, sample->is_closed ? source : std::clamp(source, 0.0, sample->length));
  }
};

class ShapeMatcher {
 public:
  ShapeMatcher(const DetailLibrary& library, const DetailBed& bed) {
    const double wanted = library.scale / steps_of_scale;
    const double step = bed.length / std::max(1.0, std::round(bed.length / wanted));
    bed_ = steps_along(bed.shape, bed.length, bed.is_closed, library.scale, step);
    for (const DetailSample& sample : library.samples) {
      const Steps steps = steps_along(sample.shape, sample.length, sample.is_closed, library.scale, step);
      const auto first = static_cast<std::int32_t>(places_.size());
      const auto count = static_cast<std::int32_t>(steps.runs.size());
      for (std::int32_t i = 0; i < count; ++i) {
        const std::int32_t before = i > 0 ? first + i - 1 : sample.is_closed ? first + count - 1 : nowhere;
        places_.push_back({&sample, i * steps.step, steps.step / step, before, steps.runs[at(i)]});
      }
    }
  }

  // Runs along the bed, one after the other; of a closed bed from a place within it on, by its length.
  std::vector<Taken> match(double length) const {
    const auto n = static_cast<Index>(bed_.runs.size());
    // A closed bed is gone round twice, and the middle is taken: there the start no longer matters.
    const Index nodes = bed_.is_closed ? 2 * n : n;
    const std::vector<std::int32_t> chosen = chosen_along(nodes);
    const Index first = bed_.is_closed ? n / 2 : 0;
    const double half = 0.5 * bed_.step;
    std::vector<Taken> runs;
    for (Index j = first; j < first + n; ++j) {
      const Place& place = places_[at(chosen[at(j)])];
      const double x = static_cast<double>(j) * bed_.step;
      if (j > first && place.before == chosen[at(j - 1)]) continue;
      if (!runs.empty()) runs.back().to = x - half;
      runs.push_back({place.sample, x - half, 0.0, x, place.y, place.rate});
    }
    runs.back().to = runs.front().from + (bed_.is_closed ? length : length + 2.0 * half);
    return runs;
  }

 private:
  static constexpr std::int32_t nowhere = -1;
  struct Place {
    const DetailSample* sample;
    double y;
    double rate;
    std::int32_t before;  // the place of the same sample a step before
    Run run;
  };

  std::vector<std::int32_t> chosen_along(Index nodes) const {
    const std::size_t count = places_.size();
    const auto n = static_cast<Index>(bed_.runs.size());
    std::vector<double> cost(count, 0.0);
    std::vector<double> next(count);
    std::vector<std::int32_t> from(count * at(nodes));
    for (Index j = 0; j < nodes; ++j) {
      const Run& run = bed_.runs[at(j % n)];
      const auto cheapest = static_cast<std::int32_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
      const double after_jump = cost[at(cheapest)] + (j > 0 ? jump : 0.0);
      for (std::size_t c = 0; c < count; ++c) {
        const std::int32_t before = places_[c].before;
        const bool goes_on = j > 0 && before != nowhere && cost[at(before)] <= after_jump;
        from[at(j) * count + c] = goes_on ? before : cheapest;
        next[c] = (goes_on ? cost[at(before)] : after_jump) + unlikeness(run, places_[c].run) / steps_of_scale;
      }
      std::swap(cost, next);
    }
    std::vector<std::int32_t> chosen(at(nodes));
    auto c = static_cast<std::int32_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
    for (Index j = nodes; j-- > 0;) {
      chosen[at(j)] = c;
      c = from[at(j) * count + at(c)];
    }
    return chosen;
  }

  Steps bed_;
  std::vector<Place> places_;
};

}  // namespace

Points lay_by_shape(const DetailLibrary& library, const DetailBed& bed, const Eigen::VectorXd& places) {
  if (library.samples.empty()) throw InvalidInput("lay_by_shape: a library without samples");
  if (!(bed.length > 0.0)) throw InvalidInput(text("lay_by_shape: a stretch of length ", bed.length));
  bool has_shape = bed.shape.rows() > 1;
  for (const DetailSample& sample : library.samples) has_shape = has_shape && sample.shape.rows() > 1;
  if (!has_shape) throw InvalidInput("lay_by_shape: the shape of the stretch or of a sample is missing");
  Points laid(places.size(), 2);
  if (const DetailSample* const own = sample_of_place(library, bed)) {
    for (Index i = 0; i < places.size(); ++i) {
      laid.row(i) = value_at(*own, false, places[i] * (own->length / bed.length));
    }
    return laid;
  }
  const std::vector<Taken> runs = ShapeMatcher(library, bed).match(bed.length);
  const double fade = 0.5 * library.scale;
  const std::size_t n = runs.size();
  const auto length_of = [](const Taken& run) { return run.to - run.from; };
  for (Index i = 0; i < places.size(); ++i) {
    double x = places[i];
    if (bed.is_closed) x -= std::floor((x - runs[0].from) / bed.length) * bed.length;
    const auto above =
        std::upper_bound(runs.begin(), runs.end(), x, [](double place, const Taken& run) { return place < run.from; });
    const auto k = at(std::max<Index>(0, above - runs.begin() - 1));
    const Taken& run = runs[k];
    laid.row(i) = run.at(x);
    // A run is whole in its middle; at either end it is as much as its neighbour is.
    const auto mix = [&](const Taken& other, double beyond, double at_other) {
      const double width = std::min({fade, length_of(run), length_of(other)});
      if (beyond >= 0.5 * width) return;
      const double share = 0.5 + 0.5 * std::sin(std::numbers::pi * beyond / width);
      laid.row(i) = share * run.at(x) + (1.0 - share) * other.at(at_other);
    };
    const bool is_first = k == 0;
    const bool is_last = k + 1 == n;
    if (x - run.from < run.to - x) {
      if (!is_first || bed.is_closed)
        mix(is_first ? runs[n - 1] : runs[k - 1], x - run.from, is_first ? x + bed.length : x);
    } else if (!is_last || bed.is_closed) {
      mix(is_last ? runs[0] : runs[k + 1], run.to - x, is_last ? x - bed.length : x);
    }
  }
  return laid;
}

}  // namespace fontcore
