#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "fontcore/error.h"
#include "fontcore/profile.h"
#include "fontcore/representation.h"

namespace fontcore {

using Eigen::Index;

namespace {

constexpr double same_t = 1e-12;
constexpr Index closed_spans = 8;  // of level 0
constexpr Index open_spans = 1;
constexpr int finest = 24;  // spans of a millionth of the coarsest ones

}  // namespace

/// One arc while it is fitted.
struct LinkedWavelet::Fit {
  const LinkedWavelet& wavelet;
  Arc& arc;
  bool is_closed = wavelet.scheme() == Scheme::Orthogonal;
  int degree = fontcore::degree(wavelet.scheme());

  static double at_level(double spans, int level) { return std::ldexp(spans, level); }
  double parameter(double spans, int level) const { return at_level(spans, level) + (is_closed ? 0.5 : 0.0); }
  BasisRow row(double spans, int level) const {
    return basis_row(wavelet.scheme(), wavelet.size(level), parameter(spans, level));
  }
  Point stored(int level, Index index) const {
    const auto& entries = arc.levels[static_cast<std::size_t>(level)];
    const std::size_t at = entries.count_below(static_cast<double>(index));
    if (at < entries.size() && entries[at].t == static_cast<double>(index)) return entries[at].p;
    return Point::Zero();
  }
  Point value(double spans) const {
    Point sum = Point::Zero();
    for (int level = 0; level < static_cast<int>(arc.levels.size()); ++level) {
      const auto& entries = arc.levels[static_cast<std::size_t>(level)];
      if (entries.size() == 0) continue;
      // Fine levels are stored in few places: most have nothing here, and need no weights.
      const auto span = static_cast<Index>(std::floor(at_level(spans, level)));
      const bool is_inside = span >= 0 && span + degree < wavelet.size(level);
      const std::size_t first = is_inside ? entries.count_below(static_cast<double>(span)) : 0;
      if (is_inside && (first == entries.size() || entries[first].t > static_cast<double>(span + degree))) continue;
      const BasisRow weights = row(spans, level);
      for (std::size_t k = 0; k < static_cast<std::size_t>(weights.count); ++k) {
        sum += weights.weight[k] * stored(level, weights.index[k]);
      }
    }
    return sum;
  }
  /// Whether a level has a displacement with weight inside a stretch, in its own spans.
  bool has_weight_within(int level, double low, double high) const {
    const auto& entries = arc.levels[static_cast<std::size_t>(level)];
    if (entries.size() == 0) return false;
    const Index n = wavelet.size(level);
    auto first = static_cast<Index>(std::floor(low));
    auto last = static_cast<Index>(std::ceil(high)) + degree - 1;
    if (!is_closed) {
      first = std::max<Index>(first, 0);
      last = std::min(last, n - 1);
    }
    const auto has = [&](Index from, Index to) {
      return entries.count_below(static_cast<double>(from)) < entries.count_below(static_cast<double>(to) + 0.5);
    };
    if (!is_closed) return has(first, last);
    if (last - first + 1 >= n) return true;
    const Index from = modulo(first, n);
    const Index to = from + (last - first);
    return to < n ? has(from, to) : has(from, n - 1) || has(0, to - n);
  }
  /// The stretch of spans of level 0 where a control point has weight; closed ones may begin below 0.
  std::pair<double, double> support(int level, Index index) const {
    const double spans = static_cast<double>(detail_count(wavelet.scheme(), wavelet.size(level)));
    double low = static_cast<double>(index - degree);
    double high = static_cast<double>(index + 1);
    if (!is_closed) {
      low = std::max(low, 0.0);
      high = std::min(high, spans);
    }
    return {std::ldexp(low, -level), std::ldexp(high, -level)};
  }
  void add(int level, const std::map<Index, Point>& displacements) {
    while (static_cast<int>(arc.levels.size()) <= level) arc.levels.emplace_back();
    auto& entries = arc.levels[static_cast<std::size_t>(level)];
    auto next = displacements.begin();
    while (next != displacements.end()) {
      // Runs without long gaps are put in together.
      auto last = next;
      while (std::next(last) != displacements.end() && std::next(last)->first - last->first < 16) ++last;
      const std::size_t from = entries.count_below(static_cast<double>(next->first));
      const std::size_t to = entries.count_below(static_cast<double>(last->first) + 0.5);
      std::map<Index, Point> merged;
      for (std::size_t i = from; i < to; ++i) merged.emplace(static_cast<Index>(entries[i].t), entries[i].p);
      for (auto it = next; it != std::next(last); ++it) {
        const auto [at, is_new] = merged.emplace(it->first, it->second);
        if (!is_new) at->second += it->second;
      }
      std::vector<Displacement> by;
      for (const auto& [index, p] : merged) by.push_back({static_cast<double>(index), p});
      entries = entries.replaced(from, to, by);
      next = std::next(last);
    }
  }
  /// Displacements that lie wholly in a stretch, dropped; on level 0 set to zero.
  void clear(double low, double high) {
    for (int level = 0; level < static_cast<int>(arc.levels.size()); ++level) {
      auto& entries = arc.levels[static_cast<std::size_t>(level)];
      for (const auto& [from, to] : inside(level, low, high)) {
        const std::size_t first = entries.count_below(static_cast<double>(from));
        const std::size_t last = entries.count_below(static_cast<double>(to) + 0.5);
        std::vector<Displacement> zeros;
        if (level == 0) {
          for (Index i = from; i <= to; ++i) zeros.push_back({static_cast<double>(i), Point::Zero()});
        }
        entries = entries.replaced(first, last, zeros);
      }
    }
    while (arc.levels.size() > 1 && arc.levels.back().size() == 0) arc.levels.pop_back();
  }
  /// Indices of a level whose B-splines lie in a stretch of spans of level 0, as ranges [from, to] in [0, size).
  std::vector<std::pair<Index, Index>> inside(int level, double low, double high) const {
    const Index n = wavelet.size(level);
    const double whole = static_cast<double>(detail_count(wavelet.scheme(), wavelet.size(0)));
    constexpr double rounding = 1e-12;
    if (is_closed && high - low >= whole) return {{0, n - 1}};
    auto first = static_cast<Index>(std::ceil(at_level(low, level) - rounding)) + degree;
    auto last = static_cast<Index>(std::floor(at_level(high, level) + rounding)) - 1;
    if (!is_closed) {
      if (low <= 0.0) first = 0;
      if (high >= whole) last = n - 1;
    }
    if (last < first) return {};
    if (!is_closed) return {{first, last}};
    if (last - first + 1 >= n) return {{0, n - 1}};
    const Index from = modulo(first, n);
    const Index to = from + (last - first);
    if (to < n) return {{from, to}};
    return {{0, to - n}, {from, n - 1}};
  }

  /// Places where the curve should be, by spans of level 0, ascending.
  struct Target {
    double spans = 0.0;
    Point p = Point::Zero();
  };

  /// Least squares over the control points of one level that lie in a stretch. False if there is none.
  bool fit_level(int level, double low, double high, const std::vector<Target>& targets,
                 const std::vector<Point>& off) {
    const auto ranges = inside(level, low, high);
    if (ranges.empty()) return false;
    const Index n = wavelet.size(level);
    std::vector<Index> of;  // variable -> index, along the stretch
    if (ranges.size() == 2) {
      for (Index i = ranges[1].first; i <= ranges[1].second; ++i) of.push_back(i);
    }
    for (Index i = ranges[0].first; i <= ranges[0].second; ++i) of.push_back(i);
    // Ends of arcs are met, not fitted.
    std::map<Index, Point> displacements;
    const bool holds_first = !is_closed && of.front() == 0;
    const bool holds_last = !is_closed && of.back() == n - 1;
    if (holds_first) {
      displacements[0] = off.front();
      of.erase(of.begin());
    }
    if (holds_last) {
      displacements[n - 1] = off.back();
      if (!of.empty()) of.pop_back();
    }
    const auto count = static_cast<int>(of.size());
    const bool is_cyclic = is_closed && count == n;
    if (count > 0) {
      std::map<Index, int> variable;
      for (int v = 0; v < count; ++v) variable[of[static_cast<std::size_t>(v)]] = v;
      std::vector<int> first;
      for (int v = 0; v < count; ++v) first.push_back(is_cyclic && v + degree >= count ? 0 : std::max(0, v - degree));
      ProfileSystem system(first);
      Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count, 2);
      for (std::size_t i = 0; i < targets.size(); ++i) {
        const BasisRow weights = row(targets[i].spans, level);
        Point rest = off[i];
        std::array<int, 4> at{-1, -1, -1, -1};
        for (std::size_t k = 0; k < static_cast<std::size_t>(weights.count); ++k) {
          const auto found = variable.find(weights.index[k]);
          if (found != variable.end()) at[k] = found->second;
          const auto held = displacements.find(weights.index[k]);
          if (held != displacements.end()) rest -= weights.weight[k] * held->second;
        }
        for (std::size_t k = 0; k < static_cast<std::size_t>(weights.count); ++k) {
          if (at[k] < 0) continue;
          right.row(at[k]) += weights.weight[k] * rest;
          for (std::size_t m = 0; m < static_cast<std::size_t>(weights.count); ++m) {
            if (at[m] >= 0 && at[m] <= at[k]) system.entry(at[k], at[m]) += weights.weight[k] * weights.weight[m];
          }
        }
      }
      double trace = 0.0;
      for (int v = 0; v < count; ++v) trace += system.entry(v, v);
      for (int v = 0; v < count; ++v) system.entry(v, v) += 1e-12 * trace / count + 1e-300;
      if (!system.factor()) return false;
      const Eigen::MatrixXd x = system.solve(right);
      for (int v = 0; v < count; ++v) displacements[of[static_cast<std::size_t>(v)]] = x.row(v).transpose();
    }
    add(level, displacements);
    return true;
  }

  /// Levels one after the other, each where the coarser ones left the curve too far off.
  ///
  /// `places` ascend; of a closed curve that is fitted whole, `target` and `places` go half a turn beyond both ends.
  void fit(double low, double high, const std::function<Point(double)>& target, const std::vector<double>& places,
           double tolerance) {
    const bool is_cyclic = is_closed && high - low >= static_cast<double>(closed_spans);
    // Displacements that reach in over an end stayed: what each level has there is looked at by its own steps.
    std::vector<double> looked_at = places;
    const auto look_at = [&](double way) {
      if (is_cyclic || low + way >= high) return;
      looked_at.push_back(low + way);
      looked_at.push_back(high - way);
    };
    const auto levels = static_cast<int>(arc.levels.size());
    for (int level = 0; level < levels; ++level) {
      for (const double spans : {2.5, 3.0, 3.5, 4.0}) look_at(std::ldexp(spans, -level));
    }
    for (const double spans : {0.5, 1.0, 1.5, 2.0}) look_at(std::ldexp(spans, 1 - levels));
    std::sort(looked_at.begin(), looked_at.end());
    std::vector<std::pair<double, double>> stretches{{low, high}};
    for (int level = 0; level <= finest && !stretches.empty(); ++level) {
      std::vector<std::pair<double, double>> finer;
      for (const auto& [from, to] : stretches) {
        // The given places, and four in every span.
        std::vector<Target> targets;
        const double step = std::ldexp(0.25, -level);
        std::vector<double> at;
        const auto first = std::lower_bound(looked_at.begin(), looked_at.end(), from);
        const auto last = std::upper_bound(looked_at.begin(), looked_at.end(), to);
        at.assign(first, last);
        for (double s = (std::floor(from / step) + 1.0) * step; s < to; s += step) at.push_back(s);
        at.push_back(from);
        at.push_back(to);
        std::sort(at.begin(), at.end());
        at.erase(std::unique(at.begin(), at.end()), at.end());
        std::vector<Point> off;
        for (const double s : at) {
          targets.push_back({s, target(s)});
          off.push_back(targets.back().p - value(s));
        }
        if (fit_level(level, from, to, targets, off)) {
          for (std::size_t i = 0; i < targets.size(); ++i) off[i] = targets[i].p - value(targets[i].spans);
        }
        const double margin = std::ldexp(static_cast<double>(degree + 1), -level - 1);
        for (std::size_t i = 0; i < targets.size(); ++i) {
          if (off[i].norm() <= tolerance) continue;
          const double near_low = is_cyclic ? targets[i].spans - margin : std::max(low, targets[i].spans - margin);
          const double near_high = is_cyclic ? targets[i].spans + margin : std::min(high, targets[i].spans + margin);
          if (!finer.empty() && near_low <= finer.back().second) {
            finer.back().second = std::max(finer.back().second, near_high);
          } else {
            finer.emplace_back(near_low, near_high);
          }
        }
      }
      if (is_cyclic) {
        // Each begins in the one turn: targets reach half a turn beyond it and no farther.
        const double whole = high - low;
        for (auto& [from, to] : finer) {
          const double turns = std::floor((from - low) / whole) * whole;
          from -= turns;
          to = std::min(to - turns, from + whole);
        }
        std::sort(finer.begin(), finer.end());
        std::vector<std::pair<double, double>> apart;
        for (const auto& [from, to] : finer) {
          if (!apart.empty() && from <= apart.back().second) {
            apart.back().second = std::max(apart.back().second, to);
          } else {
            apart.emplace_back(from, to);
          }
        }
        finer = std::move(apart);
      }
      if (is_cyclic && finer.size() > 1 && finer.back().second - (high - low) >= finer.front().first) {
        finer.back().second = std::max(finer.back().second, finer.front().second + (high - low));
        finer.erase(finer.begin());
      }
      stretches = std::move(finer);
    }
  }

  std::size_t course_before(double t) const {
    const std::size_t after = arc.course.count_below(t);
    const std::size_t at = after < arc.course.size() && arc.course[after].t == t ? after + 1 : after;
    return std::clamp<std::size_t>(at, 1, arc.course.size() - 1) - 1;
  }
  double course_at(double t) const {
    const double at = unwrapped(t, arc.interval.from - same_t);
    const Breakpoint& a = arc.course[course_before(at)];
    return a.from[1] + (at - a.from[0]) / (a.to[0] - a.from[0]) * (a.to[1] - a.from[1]);
  }
  double t_at(double spans) const {
    std::size_t low = 0;
    std::size_t high = arc.course.size() - 1;
    while (high - low > 1) {
      const std::size_t middle = (low + high) / 2;
      (arc.course[middle].spans <= spans ? low : high) = middle;
    }
    const Breakpoint& a = arc.course[low];
    return a.from[0] + (spans - a.from[1]) / (a.to[1] - a.from[1]) * (a.to[0] - a.from[0]);
  }

  /// Runs evenly over arc length from one t to another, unwrapped from the arc's start; ends stay.
  void spread_evenly(const SampledSplice& samples, double from, double to) {
    const double spans_from = arc.course.size() ? course_at(from) : 0.0;
    double spans_to = static_cast<double>(detail_count(wavelet.scheme(), wavelet.size(0)));
    if (arc.course.size() && to < arc.course[arc.course.size() - 1].t - same_t) spans_to = course_at(to);
    std::vector<Sample> along{{from, Point::Zero()}};
    double whole = 0.0;
    Point before = samples.at(from);
    for (const Sample& sample : samples.samples) {
      for (const double turn : {0.0, 1.0}) {
        const double t = sample.t + turn - std::floor(sample.t - from);
        if (!(t > from + same_t && t < to - same_t) || !(t > along.back().t)) continue;
        whole += (sample.p - before).norm();
        before = sample.p;
        along.push_back({t, {whole, 0.0}});
        break;
      }
    }
    whole += (samples.at(to) - before).norm();
    along.push_back({to, {whole, 0.0}});
    // A little of t itself, so that what has no length ascends too.
    std::vector<Breakpoint> points;
    for (const Sample& sample : along) {
      const double by_t = (sample.t - from) / (to - from);
      const double share = whole > 0.0 ? (sample.p.x() / whole + 1e-3 * by_t) / (1.0 + 1e-3) : by_t;
      points.push_back({sample.t, spans_from + share * (spans_to - spans_from), {}, {}});
    }
    points.back().spans = spans_to;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      points[i].from = {points[i].t, points[i].spans};
      points[i].to = {points[i + 1].t, points[i + 1].spans};
    }
    if (arc.course.size() == 0) {
      arc.course = SharedSequence<Breakpoint>(points);
      return;
    }
    const std::size_t first = arc.course.count_below(from - same_t);
    const std::size_t last = arc.course.count_below(to + same_t);
    const Breakpoint& line = arc.course[course_before(to + same_t)];
    points.back().from = line.from;
    points.back().to = line.to;
    arc.course = arc.course.replaced(first, last, points);
  }
};

LinkedWavelet::LinkedWavelet(std::vector<double> corners) {
  if (corners.size() == 1) throw InvalidInput("LinkedWavelet: one corner makes no arcs");
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (!(corners[i] >= 0.0 && corners[i] < 1.0) || (i > 0 && !(corners[i] > corners[i - 1]))) {
      throw InvalidInput(text("LinkedWavelet: corner ", i, " at t = ", corners[i]));
    }
  }
  if (corners.empty()) arcs_.push_back({whole_curve, {}, {}});
  for (std::size_t i = 0; i < corners.size(); ++i) {
    arcs_.push_back({{corners[i], corners[(i + 1) % corners.size()]}, {}, {}});
  }
}

Scheme LinkedWavelet::scheme() const { return arcs_.size() == 1 ? Scheme::Orthogonal : Scheme::HeldCubic; }

int LinkedWavelet::arc_at(double t) const {
  const double in = wrapped(t);
  for (std::size_t i = arcs_.size(); i-- > 0;) {
    if (arcs_[i].interval.from <= in) return static_cast<int>(i);
  }
  return static_cast<int>(arcs_.size()) - 1;
}

Interval LinkedWavelet::arc(int index) const { return arcs_.at(static_cast<std::size_t>(index)).interval; }

Index LinkedWavelet::size(int level) const {
  return scheme() == Scheme::Orthogonal ? closed_spans << level : (open_spans << level) + fontcore::degree(scheme());
}

int LinkedWavelet::finest_level(int arc) const {
  return static_cast<int>(arcs_.at(static_cast<std::size_t>(arc)).levels.size()) - 1;
}

int LinkedWavelet::finest_level_at(double t) const {
  Arc arc = arcs_[static_cast<std::size_t>(arc_at(t))];
  const Fit fit{*this, arc};
  const double spans = fit.course_at(t);
  int level = static_cast<int>(arc.levels.size()) - 1;
  while (level > 0) {
    const double at = Fit::at_level(spans, level);
    if (fit.has_weight_within(level, std::floor(at), std::floor(at) + 1.0)) break;
    --level;
  }
  return level;
}

Index LinkedWavelet::stored() const {
  Index rows = 0;
  for (const Arc& arc : arcs_) {
    for (const auto& level : arc.levels) rows += static_cast<Index>(level.size());
  }
  return rows;
}

double LinkedWavelet::parameter(double t, int level) const {
  Arc arc = arcs_[static_cast<std::size_t>(arc_at(t))];
  const Fit fit{*this, arc};
  return fit.parameter(fit.course_at(t), level);
}

double LinkedWavelet::t_of(int index, double parameter, int level) const {
  Arc arc = arcs_.at(static_cast<std::size_t>(index));
  const Fit fit{*this, arc};
  double spans = std::ldexp(parameter - (fit.is_closed ? 0.5 : 0.0), -level);
  const auto whole = static_cast<double>(detail_count(scheme(), size(0)));
  spans = fit.is_closed ? spans - std::floor(spans / whole) * whole : std::clamp(spans, 0.0, whole);
  return wrapped(fit.t_at(spans));
}

Point LinkedWavelet::evaluate(double t) const {
  Arc arc = arcs_[static_cast<std::size_t>(arc_at(t))];
  const Fit fit{*this, arc};
  return fit.value(fit.course_at(wrapped(t)));
}

Points LinkedWavelet::control_points(int index, int level, Index first, Index count) const {
  Arc arc = arcs_.at(static_cast<std::size_t>(index));
  const Fit fit{*this, arc};
  const Index n = size(level);
  if (level < 0 || count < 0 || (!fit.is_closed && (first < 0 || first + count > n))) {
    throw InvalidInput(text("LinkedWavelet::control_points: ", first, " to ", first + count, " of ", n));
  }
  Points points = Points::Zero(count, 2);
  if (level > 0) {
    // Columns of P that reach the rows asked for.
    const Index reach = fit.degree + 1;
    Index low = first / 2 - reach;
    Index high = (first + count) / 2 + reach;
    const Index coarse = size(level - 1);
    if (!fit.is_closed) {
      low = std::max<Index>(low, 0);
      high = std::min(high, coarse - 1);
    }
    const Points below = control_points(index, level - 1, low, high - low + 1);
    for (Index j = low; j <= high; ++j) {
      const FilterColumn column = scaling_column(scheme(), coarse, fit.is_closed ? modulo(j, coarse) : j);
      for (std::size_t k = 0; k < column.values.size(); ++k) {
        // Rows of a closed level are counted on along with the columns.
        const Index at = fit.is_closed ? 2 * j - 2 + static_cast<Index>(k) : column.first + static_cast<Index>(k);
        if (at >= first && at < first + count) points.row(at - first) += column.values[k] * below.row(j - low);
      }
    }
  }
  if (level < static_cast<int>(arc.levels.size())) {
    for (Index i = 0; i < count; ++i) points.row(i) += fit.stored(level, modulo(first + i, n)).transpose();
  }
  return points;
}

MultiresCurve LinkedWavelet::multires(int arc, int level) const {
  return decompose(scheme(), control_points(arc, level, 0, size(level)), level);
}

Changed<LinkedWavelet> LinkedWavelet::displace(int index, int level, Index first, const Points& displacements) const {
  const Index n = size(level);
  const bool is_closed = scheme() == Scheme::Orthogonal;
  if (index < 0 || index >= arc_count() || level < 0 || level > finest || displacements.rows() < 1 ||
      displacements.rows() > n || (!is_closed && (first < 0 || first + displacements.rows() > n))) {
    throw InvalidInput(text("LinkedWavelet::displace: control points ", first, " to ", first + displacements.rows(),
                            " of ", n, " of level ", level));
  }
  if (!displacements.allFinite()) throw InvalidInput("LinkedWavelet::displace: a displacement that is not finite");
  LinkedWavelet result = *this;
  Fit fit{*this, result.arcs_[static_cast<std::size_t>(index)]};
  std::map<Index, Point> by;
  for (Index i = 0; i < displacements.rows(); ++i) by[modulo(first + i, n)] = displacements.row(i).transpose();
  fit.add(level, by);
  const double low = fit.support(level, first).first;
  const double high = fit.support(level, first + displacements.rows() - 1).second;
  const auto whole = static_cast<double>(detail_count(scheme(), size(0)));
  if (high - low >= whole) return {std::move(result), arc(index)};
  const auto around = [&](double spans) { return is_closed ? spans - std::floor(spans / whole) * whole : spans; };
  return {std::move(result), {wrapped(fit.t_at(around(low))), wrapped(fit.t_at(around(high)))}};
}

Changed<LinkedWavelet> LinkedWavelet::pull(double t, double level, const Point& move) const {
  if (!(level >= 0.0 && level <= finest) || !std::isfinite(t) || !move.allFinite()) {
    throw InvalidInput(text("LinkedWavelet::pull: level ", level, " at t = ", t));
  }
  const int arc = arc_at(t);
  const auto broad = static_cast<int>(std::floor(level));
  const double fraction = level - broad;
  const double narrow_share = fraction * fraction;  // g of [FS94]
  LinkedWavelet result = *this;
  IntervalSet changed;
  const auto add = [&](int at_level, double share) {
    if (share == 0.0) return;
    const Index n = size(at_level);
    const BasisRow row = basis_row(scheme(), n, parameter(t, at_level));
    double norm = 0.0;
    Points by = Points::Zero(row.count, 2);
    for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
      const bool is_end = scheme() != Scheme::Orthogonal && (row.index[k] == 0 || row.index[k] == n - 1);
      if (is_end) continue;
      norm += row.weight[k] * row.weight[k];
      by.row(static_cast<Index>(k)) = row.weight[k] * move.transpose();
    }
    if (!(norm > 0.0)) throw InvalidInput(text("LinkedWavelet::pull: nothing moves at the end of an arc, t = ", t));
    const auto one = result.displace(arc, at_level, row.index[0], by * (share / norm));
    result = one.form;
    changed.add(one.interval);
  };
  add(broad, 1.0 - narrow_share);
  add(broad + 1, narrow_share);
  return {std::move(result), changed.intervals().front()};
}

double LinkedWavelet::level_of_breadth(double t, double breadth) const {
  if (!(breadth > 0.0))
    throw InvalidInput(text("LinkedWavelet::level_of_breadth: breadth ", breadth, " is not positive"));
  Arc arc = arcs_[static_cast<std::size_t>(arc_at(t))];
  const Fit fit{*this, arc};
  const double at = fit.course_at(t);
  const auto whole = static_cast<double>(detail_count(scheme(), size(0)));
  // The arc length of all spans that degree + 1 neighbouring control points move.
  const auto moved = [&](int level) {
    const double half = std::ldexp(fit.degree + 0.5, -level);
    double low = at - half;
    double high = at + half;
    if (!fit.is_closed) {
      low = std::max(low, 0.0);
      high = std::min(high, whole);
    } else if (high - low > whole) {
      low = at - 0.5 * whole;
      high = at + 0.5 * whole;
    }
    constexpr int parts = 32;
    double length = 0.0;
    Point before = fit.value(low);
    for (int k = 1; k <= parts; ++k) {
      const Point next = fit.value(low + (high - low) * k / parts);
      length += (next - before).norm();
      before = next;
    }
    return length;
  };
  if (breadth >= moved(0)) return 0.0;
  // The finest level that moves more, from where one in the middle says that it is: what that takes hardly grows with
  // the curve.
  const int middle = finest / 2;
  int level = middle + static_cast<int>(std::floor(std::log2(std::max(moved(middle), 1e-300) / breadth)));
  level = std::clamp(level, 0, finest - 1);
  while (level > 0 && breadth >= moved(level)) --level;
  while (level < finest - 1 && breadth < moved(level + 1)) ++level;
  if (level == finest - 1) return level;
  const double above = moved(level);
  return level + (above - breadth) / std::max(above - moved(level + 1), 1e-300);
}

SampledSplice LinkedWavelet::sample(const Interval& interval, double tolerance) const {
  SampledSplice result{interval, {}};
  const double from = wrapped(interval.from);
  const double to = from + length(interval);
  result.samples.push_back({from, evaluate(from)});
  for (double t = from; t < to - same_t;) {
    Arc arc = arcs_[static_cast<std::size_t>(arc_at(wrapped(t + same_t)))];
    const Fit fit{*this, arc};
    const double start = unwrapped(arc.interval.from, t + same_t - 1.0);  // of the arc, at t or before
    const double end = std::min(to, start + length(arc.interval));
    const double shift = start - arc.interval.from;
    const auto add = [&](double at, const Point& p) {
      if (at > result.samples.back().t + same_t && at < to - same_t) result.samples.push_back({at, p});
    };
    const double low = fit.course_at(t - shift);
    const double high = end < start + length(arc.interval) - same_t ? fit.course_at(end - shift)
                                                                    : arc.course[arc.course.size() - 1].spans;
    // Spans of a level, cut in two where a finer one has weight: a polynomial each.
    const std::function<void(int, double)> add_span = [&](int level, double span) {
      const double a = std::ldexp(span, -level);
      const double b = std::ldexp(span + 1.0, -level);
      if (b <= low || a >= high) return;
      for (int finer = level + 1; finer < static_cast<int>(arc.levels.size()); ++finer) {
        if (!fit.has_weight_within(finer, std::ldexp(a, finer), std::ldexp(b, finer))) continue;
        add_span(level + 1, 2.0 * span);
        add_span(level + 1, 2.0 * span + 1.0);
        return;
      }
      // The second derivative from equal steps: of a cubic it is largest at an end.
      std::array<Point, 4> p;
      for (std::size_t k = 0; k < 4; ++k) {
        const double share = static_cast<double>(k) / 3.0;
        p[k] = fit.value(k == 3 ? std::nextafter(b, a) : a + share * (b - a));
      }
      const Point x = p[0] - 2.0 * p[1] + p[2];
      const Point y = p[1] - 2.0 * p[2] + p[3];
      const double bend = 9.0 * std::max((2.0 * x - y).norm(), (2.0 * y - x).norm());
      const int parts = std::max(1, static_cast<int>(std::ceil(std::sqrt(bend / (8.0 * tolerance)))));
      // Where the course over t turns is a sample too.
      std::vector<double> spans;
      for (int k = 0; k <= parts; ++k) spans.push_back(a + (b - a) * k / parts);
      for (std::size_t i = arc.course.count_below(fit.t_at(std::max(a, low))); i < arc.course.size(); ++i) {
        if (arc.course[i].spans >= std::min(b, high)) break;
        if (arc.course[i].spans > a) spans.push_back(arc.course[i].spans);
      }
      std::sort(spans.begin(), spans.end());
      for (const double s : spans) {
        if (s > low && s < high) add(fit.t_at(s) + shift, fit.value(s));
      }
    };
    for (double span = std::floor(low); span < high; span += 1.0) add_span(0, span);
    if (end < to - same_t) add(end, evaluate(wrapped(end)));
    t = end;
  }
  result.samples.push_back({to, evaluate(to)});
  return result;
}

std::shared_ptr<const Representation> LinkedWavelet::splice(const SampledSplice& samples, double tolerance) const {
  require_valid("LinkedWavelet::splice", samples);
  auto result = std::make_shared<LinkedWavelet>(*this);
  const bool is_whole = length(samples.interval) >= 1.0;
  const auto spans_of_all = static_cast<double>(detail_count(scheme(), size(0)));
  const SampledSplice met =
      is_whole ? samples : meet(samples, evaluate(samples.samples.front().t), evaluate(samples.samples.back().t));
  for (Arc& arc : result->arcs_) {
    Fit fit{*this, arc};
    const std::vector<Interval> parts =
        fit.is_closed ? std::vector<Interval>{samples.interval} : IntervalSet({samples.interval}).within(arc.interval);
    for (const Interval& part : parts) {
      if (length(part) < same_t) continue;  // the end of an arc that the next one begins at, but for rounding
      const double from = unwrapped(part.from, arc.interval.from - same_t);
      const double to = from + length(part);
      const double arc_end = arc.interval.from + length(arc.interval);
      const bool runs_over = to > arc_end + same_t;  // round a closed arc
      double low = 0.0;
      double high = spans_of_all;
      if (arc.levels.empty()) {
        arc.levels.emplace_back();
        std::map<Index, Point> zeros;
        for (Index i = 0; i < size(0); ++i) zeros[i] = Point::Zero();
        fit.add(0, zeros);
        fit.spread_evenly(met, from, to);
      } else if (runs_over) {
        fit.spread_evenly(met, from, arc_end);
        fit.spread_evenly(met, arc.interval.from, to - 1.0);
        low = fit.course_at(from);
        high = fit.course_at(to - 1.0) + spans_of_all;
      } else {
        fit.spread_evenly(met, from, to);
        if (from > arc.interval.from + same_t) low = fit.course_at(from);
        if (to < arc_end - same_t) high = fit.course_at(to);
      }
      fit.clear(low, high);
      const auto t_at = [&](double spans) {
        if (spans < 0.0) return fit.t_at(spans + spans_of_all) - 1.0;
        return spans > spans_of_all ? fit.t_at(spans - spans_of_all) + 1.0 : fit.t_at(spans);
      };
      std::vector<double> places;
      for (const Sample& sample : met.samples) {
        const double t = unwrapped(sample.t, from);
        if (t > to) continue;
        const double in = t > arc_end ? fit.course_at(t - 1.0) + spans_of_all : fit.course_at(t);
        if (in > low && in < high) places.push_back(in);
      }
      if (is_whole && fit.is_closed) {
        const std::size_t once = places.size();
        for (std::size_t i = 0; i < once; ++i) {
          places.push_back(places[i] + (places[i] < 0.5 * spans_of_all ? spans_of_all : -spans_of_all));
        }
      }
      std::sort(places.begin(), places.end());
      fit.fit(
          low, high, [&](double spans) { return met.at(t_at(spans)); }, places, 0.5 * fitting_share * tolerance);
    }
  }
  return result;
}

std::size_t LinkedWavelet::bytes_beyond(const Representation& other) const {
  const auto& older = dynamic_cast<const LinkedWavelet&>(other);
  std::size_t bytes = 0;
  for (std::size_t a = 0; a < arcs_.size(); ++a) {
    const Arc& own = arcs_[a];
    const Arc none{};
    const Arc& theirs = a < older.arcs_.size() ? older.arcs_[a] : none;
    bytes += sizeof(Arc) + own.course.bytes_beyond(theirs.course);
    for (std::size_t level = 0; level < own.levels.size(); ++level) {
      bytes += own.levels[level].bytes_beyond(level < theirs.levels.size() ? theirs.levels[level]
                                                                           : SharedSequence<Displacement>());
    }
  }
  return bytes;
}

}  // namespace fontcore
