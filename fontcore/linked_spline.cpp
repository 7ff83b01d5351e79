#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "fontcore/error.h"
#include "fontcore/profile.h"
#include "fontcore/representation.h"

namespace fontcore {

namespace {

constexpr double same_t = 1e-12;
constexpr int most_degree = 5;
constexpr double least_span = 1e-7;  // of t: shorter ones are not cut in two
using Weights = std::array<double, most_degree + 1>;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// Weights of control points span - degree .. span on the span [knot span, knot span + 1], or of a derivative.
///
/// `knot` gives knots by index. By recurrence over the degree; the derivatives by that of the lower degree.
template <typename Knot>
Weights basis(const Knot& knot, int span, int degree, double t, int derivative) {
  Weights w{};
  if (derivative > degree) return w;
  w[at(degree)] = 1.0;  // entry degree - j belongs to control point span - j
  for (int p = 1; p <= degree; ++p) {
    const bool is_derived = p > degree - derivative;
    Weights next{};
    for (int j = 0; j < p; ++j) {
      const int i = span - j;  // of the B-spline of degree p - 1
      const double low = knot(i);
      const double high = knot(i + p);
      const double share = w[at(degree - j)] / (high - low);
      next[at(degree - j)] += is_derived ? p * share : (t - low) * share;
      next[at(degree - j - 1)] += is_derived ? -p * share : (high - t) * share;
    }
    w = next;
  }
  return w;
}

/// A stretch of a spline on plain lists: control point i belongs to knots i .. i + degree + 1.
struct Window {
  int degree = 3;
  std::vector<double> knots;
  std::vector<Point> points;

  Weights weights(int span, double t, int derivative) const {
    return basis([this](int i) { return knots[at(i)]; }, span, degree, t, derivative);
  }
  Point value(int span, double t, int derivative = 0) const {
    const Weights w = weights(span, t, derivative);
    Point sum = Point::Zero();
    for (int j = 0; j <= degree; ++j) sum += w[at(j)] * points[at(span - degree + j)];
    return sum;
  }
  /// The last knot at or before t.
  int span_at(double t) const {
    return static_cast<int>(std::upper_bound(knots.begin(), knots.end(), t) - knots.begin()) - 1;
  }
  int multiplicity(double t) const {
    return static_cast<int>(std::upper_bound(knots.begin(), knots.end(), t) -
                            std::lower_bound(knots.begin(), knots.end(), t));
  }
  /// Knot insertion: the curve stays.
  void insert(double t) {
    const int k = span_at(t);
    std::vector<Point> inserted;
    for (int i = k - degree + 1; i <= k; ++i) {
      const double share = (t - knots[at(i)]) / (knots[at(i + degree)] - knots[at(i)]);
      inserted.push_back((1.0 - share) * points[at(i - 1)] + share * points[at(i)]);
    }
    points.insert(points.begin() + k, points[at(k)]);
    std::copy(inserted.begin(), inserted.end(), points.begin() + (k - degree + 1));
    knots.insert(knots.begin() + k + 1, t);
  }
  /// No second derivative on a span is longer: of the control points of the second derivative.
  double largest_bend(int span) const {
    if (degree < 2) return 0.0;
    double largest = 0.0;
    const auto slope = [this](int i) -> Point {  // between control points i and i + 1
      return degree * (points[at(i + 1)] - points[at(i)]) / (knots[at(i + degree + 1)] - knots[at(i + 1)]);
    };
    for (int i = span - degree; i + 2 <= span; ++i) {
      const double way = knots[at(i + degree + 1)] - knots[at(i + 2)];
      largest = std::max(largest, ((degree - 1) * (slope(i + 1) - slope(i)) / way).norm());
    }
    return largest;
  }
};

/// Moves the control points that have a variable to the least squares of the targets, all requirements met.
///
/// Variables follow the control points; if the window is closed those of its beginning come again at its end. Targets
/// ascend.
/// Throws  UnsatisfiableConstraints if the requirements cannot be met.
void fit(Window& window, const std::vector<int>& variable, int count, bool is_closed,
         const std::vector<Sample>& targets, const std::vector<LinkedSpline::Requirement>& requirements) {
  const int degree = window.degree;
  std::vector<int> first;
  for (int v = 0; v < count; ++v) first.push_back(is_closed && v + degree >= count ? 0 : std::max(0, v - degree));
  ProfileSystem system(first);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(count, 2 + 2 * static_cast<Eigen::Index>(requirements.size()));
  std::vector<Point> fixed = window.points;
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (variable[i] >= 0) fixed[i] = Point::Zero();
  }
  for (const Sample& target : targets) {
    int span = window.span_at(target.t);
    while (!(window.knots[at(span + 1)] > window.knots[at(span)]) ||
           span + degree + 1 >= static_cast<int>(window.knots.size())) {
      --span;
    }
    const Weights w = window.weights(span, target.t, 0);
    Point rest = target.p;
    for (int j = 0; j <= degree; ++j) rest -= w[at(j)] * fixed[at(span - degree + j)];
    for (int j = 0; j <= degree; ++j) {
      const int row = variable[at(span - degree + j)];
      if (row < 0) continue;
      right.row(row).head<2>() += w[at(j)] * rest;
      for (int k = 0; k <= degree; ++k) {
        const int column = variable[at(span - degree + k)];
        if (column >= 0 && column <= row) system.entry(row, column) += w[at(j)] * w[at(k)];
      }
    }
  }
  // What no target says stays near to zero change: a trace of the mean diagonal keeps the system definite.
  double trace = 0.0;
  for (int v = 0; v < count; ++v) trace += system.entry(v, v);
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if (variable[i] < 0) continue;
    const double trust = 1e-12 * trace / count;
    system.entry(variable[i], variable[i]) += trust;
    right.row(variable[i]).head<2>() += trust * window.points[i];
  }
  Eigen::MatrixXd asked(static_cast<Eigen::Index>(requirements.size()), 2);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(requirements.size()), count);
  for (std::size_t r = 0; r < requirements.size(); ++r) {
    const auto& requirement = requirements[r];
    int span = window.span_at(requirement.t);
    if (requirement.side == Side::Left) {
      span = static_cast<int>(std::lower_bound(window.knots.begin(), window.knots.end(), requirement.t) -
                              window.knots.begin()) -
             1;
    }
    const Weights w = window.weights(span, requirement.t, requirement.derivative);
    const auto row = static_cast<Eigen::Index>(r);
    asked.row(row) = requirement.value;
    for (int j = 0; j <= degree; ++j) {
      const std::size_t i = at(span - degree + j);
      asked.row(row) -= w[at(j)] * fixed[i].transpose();
      if (variable[i] >= 0) rows(row, variable[i]) += w[at(j)];
    }
  }
  if (!system.factor()) throw UnsatisfiableConstraints("LinkedSpline: knots too near to each other to fit");
  Eigen::MatrixXd x = system.solve(Eigen::MatrixXd(right.leftCols(2)));
  if (!requirements.empty()) {
    // Least change in the norm of the system: x + N^-1 C' (C N^-1 C')^-1 (y - C x), rows at equal scale.
    const Eigen::VectorXd scale = rows.rowwise().norm().cwiseMax(1e-300).cwiseInverse();
    rows = scale.asDiagonal() * rows;
    asked = scale.asDiagonal() * asked;
    const Eigen::MatrixXd lifted = system.solve(Eigen::MatrixXd(rows.transpose()));
    const auto schur = (rows * lifted).completeOrthogonalDecomposition();
    for (int pass = 0; pass < 2; ++pass) x += lifted * schur.solve(asked - rows * x);
    const double missed = (asked - rows * x).cwiseAbs().maxCoeff();
    if (!(missed < 1e-7 * (1.0 + asked.cwiseAbs().maxCoeff()))) {
      throw UnsatisfiableConstraints(
          text("LinkedSpline: ", requirements.size(), " requirements cannot all be met, one is off by ", missed));
    }
  }
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if (variable[i] >= 0) window.points[i] = x.row(variable[i]).transpose();
  }
}

/// Places to fit at: the samples, the knots, and degree more in every span, on the samples' polyline.
std::vector<Sample> targets_of(const SampledSplice& samples, const Window& window, int first, int last) {
  std::vector<Sample> targets = samples.samples;
  for (int span = first; span < last; ++span) {
    const double low = window.knots[at(span)];
    const double high = window.knots[at(span + 1)];
    if (!(high > low)) continue;
    for (int k = 0; k <= window.degree; ++k) {
      const double t = low + (high - low) * k / (window.degree + 1);
      targets.push_back({t, samples.at(t)});
    }
  }
  std::sort(targets.begin(), targets.end(), [](const Sample& a, const Sample& b) { return a.t < b.t; });
  targets.erase(
      std::unique(targets.begin(), targets.end(), [](const Sample& a, const Sample& b) { return a.t == b.t; }),
      targets.end());
  return targets;
}

/// Spans where the window is farther than `tolerance` from the targets' polyline somewhere. None if not: proved, as
/// for cubics.
std::vector<int> spans_too_far(const Window& window, int first, int last, const std::vector<Sample>& targets,
                               double tolerance) {
  std::vector<int> too_far;
  auto target = targets.begin();
  for (int span = first; span < last; ++span) {
    const double low = window.knots[at(span)];
    const double high = window.knots[at(span + 1)];
    if (!(high > low)) continue;
    const double bend = window.largest_bend(span);
    double before = -1.0;
    double t_before = low;
    while (target != targets.end() && target->t < low) ++target;
    for (; target != targets.end() && target->t <= high; ++target) {
      const double off = (window.value(span, target->t) - target->p).norm();
      const double step = target->t - t_before;
      const double most = std::max(off, before) + (before < 0.0 ? 0.0 : 0.125 * step * step * bend);
      if (most > tolerance && (too_far.empty() || too_far.back() != span)) too_far.push_back(span);
      before = off;
      t_before = target->t;
      if (target->t == high) break;
    }
  }
  return too_far;
}

/// What pins ask: their point, and their tangents at the speed of the samples.
std::vector<LinkedSpline::Requirement> requirements_of(const SampledSplice& samples) {
  std::vector<LinkedSpline::Requirement> requirements;
  const double from = samples.samples.front().t;
  const double to = samples.samples.back().t;
  for (const Pin& pin : samples.pins) {
    if (!(pin.t > from && pin.t < to)) continue;
    const auto found = std::partition_point(samples.samples.begin(), samples.samples.end(),
                                            [&](const Sample& sample) { return sample.t < pin.t; });
    requirements.push_back({pin.t, 0, Side::Right, found->p});
    const auto speed = [&](const Sample& other) { return ((other.p - found->p) / (other.t - found->t)).norm(); };
    if (pin.in) requirements.push_back({pin.t, 1, Side::Left, *pin.in * speed(found[-1])});
    if (pin.out && (pin.is_corner || !pin.in))
      requirements.push_back({pin.t, 1, Side::Right, *pin.out * speed(found[1])});
  }
  return requirements;
}

/// Tangents first, then points: they are met within the tolerance only.
void give_up_some(std::vector<LinkedSpline::Requirement>& requirements) {
  if (std::erase_if(requirements, [](const auto& asked) { return asked.derivative > 0; }) == 0) requirements.clear();
}

}  // namespace

LinkedSpline::LinkedSpline(int degree) : degree_(degree) {
  if (degree < 1 || degree > most_degree)
    throw InvalidInput(text("LinkedSpline: degree ", degree, " is not in [1, 5]"));
}

double LinkedSpline::knot(int index) const {
  const int n = size();
  const int in = ((index % n) + n) % n;
  return points_[at(in)].t + (index - in) / n;
}

Point LinkedSpline::control_point(int index) const {
  const int n = size();
  return points_[at(((index % n) + n) % n)].p;
}

int LinkedSpline::knot_at(double t) const {
  const double in = wrapped(t);
  auto index = static_cast<int>(points_.count_below(in));
  while (index < size() && points_[at(index)].t == in) ++index;
  return index == 0 ? size() - 1 : index - 1;
}

Point LinkedSpline::evaluate(double t, int derivative, Side side) const {
  const double in = wrapped(t);
  int span = knot_at(in);
  double local = in;
  if (knot(span) > in) span -= size();
  if (side == Side::Left) {
    while (!(knot(span) < local)) --span;
  }
  const Weights w = basis([this](int i) { return knot(i); }, span, degree_, local, derivative);
  Point sum = Point::Zero();
  for (int j = 0; j <= degree_; ++j) sum += w[at(j)] * control_point(span - degree_ + j);
  return sum;
}

KnotVector LinkedSpline::knots() const {
  std::vector<double> list;
  for (int i = 0; i < size(); ++i) list.push_back(knot(i));
  return closed_knots(degree_, std::move(list), 1.0);
}

Points LinkedSpline::control_points() const {
  Points points(size(), 2);
  for (int i = 0; i < size(); ++i) points.row(i) = control_point(i);
  return points;
}

Interval LinkedSpline::support(int index) const { return {wrapped(knot(index)), wrapped(knot(index + degree_ + 1))}; }

LinkedSpline LinkedSpline::with_window(int first, int count, const std::vector<double>& knots,
                                       const std::vector<Point>& points) const {
  // Unwrapping rounds; a knot that was there stays where it was, or those of a corner would get out of order.
  const auto settled = [&](double t) {
    const int k = knot_at(t);
    for (const int near : {k, k + 1}) {
      const double old = wrapped(knot(near));
      const double turn = std::floor(t);
      if (std::abs(old - (t - turn)) < same_t) return turn + old;
    }
    return t;
  };
  std::vector<Entry> entries;
  const double turn = std::floor(knots.front());
  for (std::size_t i = 0; i < points.size(); ++i) entries.push_back({settled(knots[i] - turn), points[i]});
  const int n = size();
  const int in = ((first % n) + n) % n;
  LinkedSpline result(degree_);
  if (count == n) {
    for (Entry& entry : entries) entry.t = wrapped(entry.t);
    const auto least =
        std::min_element(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.t < b.t; });
    std::rotate(entries.begin(), least, entries.end());
    result.points_ = SharedSequence<Entry>(entries);
    return result;
  }
  std::vector<Entry> tail;
  std::vector<Entry> head;
  for (Entry entry : entries) {
    if (entry.t < 1.0) {
      tail.push_back(entry);
    } else {
      head.push_back({settled(entry.t - 1.0), entry.p});
    }
  }
  const int over = std::max(0, in + count - n);
  result.points_ = points_.replaced(at(in), at(in + count - over), tail);
  result.points_ = result.points_.replaced(0, at(over), head);
  return result;
}

Changed<LinkedSpline> LinkedSpline::move_control_point(int index, const Point& to) const {
  if (index < 0 || index >= size()) throw InvalidInput(text("LinkedSpline::move_control_point: no point ", index));
  if (!to.allFinite()) throw InvalidInput("LinkedSpline::move_control_point: a place that is not finite");
  LinkedSpline result(degree_);
  result.points_ = points_.replaced(at(index), at(index) + 1, {{knot(index), to}});
  return {std::move(result), support(index)};
}

LinkedSpline LinkedSpline::insert_knot(double t) const {
  if (!std::isfinite(t)) throw InvalidInput("LinkedSpline::insert_knot: t is not finite");
  const double in = wrapped(t);
  const int span = knot(knot_at(in)) > in ? knot_at(in) - size() : knot_at(in);
  Window window{degree_, {}, {}};
  const int first = span - degree_;
  for (int i = first; i <= span + degree_ + 1; ++i) window.knots.push_back(knot(i));
  for (int i = first; i <= span; ++i) window.points.push_back(control_point(i));
  if (window.multiplicity(in) >= degree_) {
    throw InvalidInput(text("LinkedSpline::insert_knot: the knot ", in, " stands ", degree_, " times already"));
  }
  window.insert(in);
  return with_window(first, degree_ + 1, window.knots, window.points);
}

Changed<LinkedSpline> LinkedSpline::remove_knot(int index) const {
  if (index < 0 || index >= size()) throw InvalidInput(text("LinkedSpline::remove_knot: no knot ", index));
  if (size() <= 3 * degree_ + 3) throw InvalidInput("LinkedSpline::remove_knot: too few knots are left");
  const Interval interval = reach_of_knot(index);
  LinkedSpline result(degree_);
  result.points_ = points_.replaced(at(index), at(index) + 1, {});
  constexpr double accuracy = 1e-3;  // of the samples that say what it was, font units
  return result.fitted(sample(interval, accuracy));
}

Changed<LinkedSpline> LinkedSpline::move_knot(int index, double to) const {
  if (index < 0 || index >= size()) throw InvalidInput(text("LinkedSpline::move_knot: no knot ", index));
  if (!(to >= 0.0 && to < 1.0) || (index > 0 && to < knot(index - 1)) || (index + 1 < size() && to > knot(index + 1))) {
    throw InvalidInput(text("LinkedSpline::move_knot: ", to, " is not between the knots beside knot ", index));
  }
  LinkedSpline result(degree_);
  result.points_ = points_.replaced(at(index), at(index) + 1, {{to, control_point(index)}});
  for (int i = index - degree_; i <= index; ++i) {
    if (result.knot(i) == result.knot(i + degree_)) {
      throw InvalidInput(text("LinkedSpline::move_knot: the knot ", to, " would stand more than ", degree_, " times"));
    }
  }
  return {std::move(result), reach_of_knot(index)};
}

Interval LinkedSpline::reach_of_knot(int index) const {
  return {wrapped(knot(index - degree_ - 1)), wrapped(knot(index + degree_ + 1))};
}

Changed<LinkedSpline> LinkedSpline::fitted(const SampledSplice& samples,
                                           const std::vector<Requirement>& requirements) const {
  require_valid("LinkedSpline::fitted", samples);
  const double from = wrapped(samples.interval.from);
  const double shift = from - samples.samples.front().t;
  const double to = from + length(samples.interval);
  // The knots of the interval, and as many more on either side as have weight in it.
  int first = knot_at(from);
  if (knot(first) > from) first -= size();
  while (knot(first) >= from) --first;
  first -= degree_;
  int last = first;
  while (knot(last) <= to) ++last;
  Window window{degree_, {}, {}};
  for (int i = first; i <= last + degree_; ++i) window.knots.push_back(knot(i));
  for (int i = first; i < last; ++i) window.points.push_back(control_point(i));
  std::vector<int> variable;
  int count = 0;
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    const bool is_inside = window.knots[i] >= from - same_t && window.knots[i + at(degree_) + 1] <= to + same_t;
    variable.push_back(is_inside ? count++ : -1);
  }
  if (count >= size()) throw InvalidInput("LinkedSpline::fitted: the interval is the whole curve");
  if (count == 0)
    throw UnsatisfiableConstraints("LinkedSpline::fitted: no control point's B-spline lies in the interval");
  SampledSplice shifted = samples;
  for (Sample& sample : shifted.samples) sample.t += shift;
  std::vector<Requirement> asked = requirements;
  for (Requirement& requirement : asked) requirement.t = unwrapped(requirement.t, from);
  std::vector<Sample> targets = targets_of(shifted, window, degree_, static_cast<int>(window.points.size()));
  std::erase_if(targets, [&](const Sample& target) { return target.t < from || target.t > to; });
  fit(window, variable, count, false, targets, asked);
  return {with_window(first, last - first, window.knots, window.points), samples.interval};
}

SampledSplice LinkedSpline::sample(const Interval& interval, double tolerance) const {
  SampledSplice result{interval, {}};
  const double from = wrapped(interval.from);
  const double to = from + length(interval);
  result.samples.push_back({from, evaluate(from)});
  int span = knot_at(from);
  if (knot(span) > from) span -= size();
  Window window{degree_, {}, {}};
  for (; knot(span) < to - same_t; ++span) {
    const double low = knot(span);
    const double high = knot(span + 1);
    if (!(high > low)) continue;
    window.knots.clear();
    window.points.clear();
    for (int i = span - degree_; i <= span + degree_ + 1; ++i) window.knots.push_back(knot(i));
    for (int i = span - degree_; i <= span; ++i) window.points.push_back(control_point(i));
    const double bend = window.largest_bend(degree_);
    const int parts = std::max(1, static_cast<int>(std::ceil((high - low) * std::sqrt(bend / (8.0 * tolerance)))));
    for (int k = 1; k <= parts; ++k) {
      const double t = k == parts ? high : low + (high - low) * k / parts;
      if (t > result.samples.back().t + same_t && t < to - same_t) {
        result.samples.push_back({t, window.value(degree_, t)});
      }
    }
  }
  result.samples.push_back({to, evaluate(to)});
  return result;
}

std::shared_ptr<const Representation> LinkedSpline::splice(const SampledSplice& samples, double tolerance) const {
  require_valid("LinkedSpline::splice", samples);
  const double within = fitting_share * tolerance;
  constexpr int most_rounds = 40;  // a span halved so often is below the resolution of t
  const auto spread = [&](double low, double high, int parts, std::vector<double>& knots) {
    for (int k = 1; k < parts; ++k) knots.push_back(low + (high - low) * k / parts);
  };
  // About one control point for every eight samples to begin with.
  const auto parts_of = [&](double low, double high) {
    const auto count = std::count_if(samples.samples.begin(), samples.samples.end(),
                                     [&](const Sample& sample) { return sample.t > low && sample.t < high; });
    return std::max(1, static_cast<int>(count / 8));
  };

  if (length(samples.interval) >= 1.0) {
    SampledSplice closed = samples;
    closed.samples.back().p = closed.samples.front().p;
    const double start = closed.samples.front().t;
    std::vector<double> breaks{start};
    std::vector<bool> is_corner{false};
    for (const Pin& pin : closed.pins) {
      if (!pin.is_corner) continue;
      if (pin.t == start || pin.t == start + 1.0) {
        is_corner.front() = true;
      } else {
        breaks.push_back(pin.t);
        is_corner.push_back(true);
      }
    }
    breaks.push_back(start + 1.0);
    std::vector<double> knots;
    for (std::size_t b = 0; b + 1 < breaks.size(); ++b) {
      knots.insert(knots.end(), is_corner[b] ? at(degree_) : 1, breaks[b]);
      spread(breaks[b], breaks[b + 1], std::max(degree_ + 1, parts_of(breaks[b], breaks[b + 1])), knots);
    }
    std::vector<Requirement> requirements = requirements_of(closed);
    for (int round = 0;; ++round) {
      const auto n = static_cast<int>(knots.size());
      Window window{degree_, {}, {}};
      std::vector<int> variable;
      for (int i = -degree_; i <= n + degree_; ++i) {
        const int in = (i + n) % n;
        window.knots.push_back(knots[at(in)] + (i < 0 ? -1.0 : i >= n ? 1.0 : 0.0));
      }
      for (int i = -degree_; i < n; ++i) {
        variable.push_back((i + n) % n);
        const double greville = window.knots[at(i + degree_ + 1)];
        window.points.push_back(closed.at(greville));
      }
      const std::vector<Sample> targets = targets_of(closed, window, degree_, n + degree_);
      try {
        fit(window, variable, n, true, targets, requirements);
      } catch (const UnsatisfiableConstraints&) {
        if (requirements.empty()) throw;
        give_up_some(requirements);
        continue;
      }
      const std::vector<int> too_far = spans_too_far(window, degree_, n + degree_, targets, within);
      if (too_far.empty() || round == most_rounds) {
        auto result = std::make_shared<LinkedSpline>(degree_);
        std::vector<Entry> entries;
        for (int i = 0; i < n; ++i) entries.push_back({wrapped(knots[at(i)]), window.points[at(i + degree_)]});
        const auto least =
            std::min_element(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.t < b.t; });
        std::rotate(entries.begin(), least, entries.end());
        result->points_ = SharedSequence<Entry>(entries);
        return result;
      }
      for (const int span : too_far) {
        if (window.knots[at(span + 1)] - window.knots[at(span)] < least_span) continue;
        knots.push_back(0.5 * (window.knots[at(span)] + window.knots[at(span + 1)]));
      }
      std::sort(knots.begin(), knots.end());
    }
  }

  const SampledSplice met = meet(samples, evaluate(samples.samples.front().t), evaluate(samples.samples.back().t));
  // A knot at either end, and beyond them enough that the window does not meet itself.
  LinkedSpline cut = *this;
  const auto with_knot = [&](double t) {
    const int k = cut.knot_at(t);
    if (std::abs(unwrapped(t - cut.knot(k), -0.5)) < same_t) return wrapped(cut.knot(k));
    if (std::abs(unwrapped(t - cut.knot(k + 1), -0.5)) < same_t) return wrapped(cut.knot(k + 1));
    cut = cut.insert_knot(t);
    return wrapped(t);
  };
  const double start = with_knot(wrapped(samples.interval.from));
  const double end = with_knot(wrapped(samples.interval.to));
  const int beyond = 2 * degree_ + 1;
  while (true) {
    int outside = 0;
    double widest = 0.0;
    double middle = 0.0;
    int k = cut.knot_at(end);
    for (double t = unwrapped(end, 0.0); outside <= 2 * beyond; ++outside) {
      const double next = unwrapped(end, 0.0) + unwrapped(cut.knot(k + 1) - end, 0.0);
      const double way = next - t;
      if (way > widest) {
        widest = way;
        middle = t + 0.5 * way;
      }
      if (std::abs(unwrapped(cut.knot(k + 1) - start, -0.5)) < same_t) break;
      t = next;
      ++k;
    }
    if (outside > 2 * beyond) break;
    cut = cut.insert_knot(middle);
  }

  // The window: knots of the interval and those beyond that have a part in its B-splines.
  int first = cut.knot_at(start);
  if (cut.knot(first) > start) first -= cut.size();
  while (cut.knot(first) >= start) --first;
  first -= beyond - 1;
  Window window{degree_, {}, {}};
  const double from = start;
  const double to = unwrapped(end, std::nextafter(from, 2.0));
  int last = first;
  while (cut.knot(last) < to + same_t) ++last;
  last += degree_ + 1;
  for (int i = first; i <= last + degree_; ++i) window.knots.push_back(cut.knot(i));
  for (int i = first; i < last; ++i) window.points.push_back(cut.control_point(i));
  // Unwrapping rounds: the ends are where they are.
  double from_knot = from;
  double to_knot = to;
  for (const double knot : window.knots) {
    if (std::abs(knot - from) < same_t) from_knot = knot;
    if (std::abs(knot - to) < same_t) to_knot = knot;
  }
  SampledSplice local = met;
  const double shift = from_knot - local.samples.front().t;
  for (Sample& sample : local.samples) sample.t += shift;
  for (Pin& pin : local.pins) pin.t += shift;
  local.samples.front().t = from_knot;
  local.samples.back().t = to_knot;
  for (Pin& pin : local.pins) {
    if (pin.t < from_knot + same_t) pin.t = from_knot;
    if (pin.t > to_knot - same_t) pin.t = to_knot;
  }

  // Knots within reach of B-splines that go on outside are only ever added to; between them, new ones.
  const auto inner = [&] {
    const auto low = std::upper_bound(window.knots.begin(), window.knots.end(), from_knot);
    const auto high = std::lower_bound(window.knots.begin(), window.knots.end(), to_knot);
    return std::pair(static_cast<int>(low - window.knots.begin()), static_cast<int>(high - window.knots.begin()));
  };
  while (inner().second - inner().first < 2 * degree_) {
    int widest = inner().first - 1;
    for (int k = widest; k < inner().second; ++k) {
      if (window.knots[at(k + 1)] - window.knots[at(k)] > window.knots[at(widest + 1)] - window.knots[at(widest)])
        widest = k;
    }
    window.insert(0.5 * (window.knots[at(widest)] + window.knots[at(widest + 1)]));
  }
  const auto [low, high] = inner();
  const double free_from = window.knots[at(low + degree_ - 1)];
  const double free_to = window.knots[at(high - degree_)];
  std::vector<double> fresh;
  if (free_to > free_from) {
    double before = free_from;
    for (const Pin& pin : local.pins) {
      if (!pin.is_corner || !(pin.t > free_from && pin.t < free_to)) continue;
      spread(before, pin.t, parts_of(before - shift, pin.t - shift), fresh);
      fresh.insert(fresh.end(), at(degree_), pin.t);
      before = pin.t;
    }
    spread(before, free_to, parts_of(before - shift, free_to - shift), fresh);
  }
  const int kept_low = low + degree_;
  const int kept_high = high - degree_;
  window.knots.erase(window.knots.begin() + kept_low, window.knots.begin() + kept_high);
  window.points.erase(window.points.begin() + kept_low, window.points.begin() + kept_high);
  window.knots.insert(window.knots.begin() + kept_low, fresh.begin(), fresh.end());
  window.points.insert(window.points.begin() + kept_low, fresh.size(), Point::Zero());
  // Control points in between are free; they begin on the samples.
  const auto is_free = [&](std::size_t i) {
    return window.knots[i] >= from_knot && window.knots[i + at(degree_) + 1] <= to_knot;
  };
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if (is_free(i)) window.points[i] = local.at(window.knots[i + at(degree_ + 1) / 2]);
  }
  for (const Pin& pin : local.pins) {
    if (!pin.is_corner || !(pin.t > from_knot && pin.t < to_knot)) continue;
    while (window.multiplicity(pin.t) < degree_) window.insert(pin.t);
  }
  // A corner at an end: the tangent may jump there, and what is outside does not depend on what is inside.
  for (const Pin& pin : local.pins) {
    if (!pin.is_corner || (pin.t != from_knot && pin.t != to_knot)) continue;
    while (window.multiplicity(pin.t) < degree_) window.insert(pin.t);
  }
  std::vector<Requirement> requirements = requirements_of(local);
  constexpr int tries = 6;
  int unmet = 0;
  for (int round = 0; round < most_rounds; ++round) {
    const auto [inside, outside] = inner();
    std::vector<int> variable;
    int count = 0;
    for (std::size_t i = 0; i < window.points.size(); ++i) variable.push_back(is_free(i) ? count++ : -1);
    const std::vector<Sample> targets = targets_of(local, window, inside - 1, outside);
    std::vector<int> wide;  // spans to be cut in two
    bool is_met = true;
    try {
      fit(window, variable, count, false, targets, requirements);
      wide = spans_too_far(window, inside - 1, outside, targets, within);
    } catch (const UnsatisfiableConstraints&) {
      // Too few control points are free about them: more, at the ends and where something is asked; tangents, and then
      // points, are given up where that does not help.
      is_met = false;
      if (++unmet % tries == 0) give_up_some(requirements);
      wide = {inside - 1, outside - 1};
      for (const Requirement& asked : requirements) {
        const int span = window.span_at(asked.t);
        wide.insert(wide.end(), {span - window.multiplicity(asked.t), span});
      }
      std::sort(wide.begin(), wide.end());
      wide.erase(std::unique(wide.begin(), wide.end()), wide.end());
    }
    std::vector<double> more;
    for (const int span : wide) {
      const double middle = 0.5 * (window.knots[at(span)] + window.knots[at(span + 1)]);
      if (span >= inside - 1 && span < outside && window.knots[at(span + 1)] - window.knots[at(span)] >= least_span) {
        more.push_back(middle);
      }
    }
    if (more.empty() && is_met) break;
    for (const double knot : more) window.insert(knot);
  }
  return std::make_shared<const LinkedSpline>(cut.with_window(first, last - first, window.knots, window.points));
}

std::size_t LinkedSpline::bytes_beyond(const Representation& other) const {
  return points_.bytes_beyond(dynamic_cast<const LinkedSpline&>(other).points_);
}

}  // namespace fontcore
