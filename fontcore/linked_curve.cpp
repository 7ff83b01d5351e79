#include "fontcore/linked_curve.h"

#include <algorithm>
#include <cmath>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

struct LinkedCurve::Rules {
  LinkedOptions options;
  std::vector<CurveRule> rules;
  IntervalSet frozen;
  std::vector<double> corners;  // ascending in [0, 1)
  std::optional<Interval> marks;
};

namespace {

/// Two parameters nearer to each other than this are one.
constexpr double same_t = 1e-12;
/// Corners and held places that one means by t, typed or computed.
constexpr double same_place = 1e-9;

enum SlotNumber : std::size_t { bezier_slot, polyline_slot, spline_slot, wavelet_slot, arcwise_slot };

/// The t of the sample at a parameter, which is put in if there is none; nothing if the splice does not reach there.
std::optional<double> sample_at(SampledSplice& splice, double t) {
  auto& samples = splice.samples;
  const double at = unwrapped(t, samples.front().t - same_t);
  if (at > samples.back().t + same_t) return std::nullopt;
  const auto after = std::partition_point(samples.begin(), samples.end(),
                                          [at](const Sample& sample) { return sample.t < at - same_t; });
  if (after != samples.end() && after->t <= at + same_t) return after->t;
  const Point p = splice.at(at);
  samples.insert(after, {at, p});
  return at;
}

void add_pin(SampledSplice& splice, const Pin& pin) {
  const auto at =
      std::partition_point(splice.pins.begin(), splice.pins.end(), [&](const Pin& other) { return other.t < pin.t; });
  if (at == splice.pins.end() || at->t != pin.t) {
    splice.pins.insert(at, pin);
    return;
  }
  at->is_corner = at->is_corner || pin.is_corner;
  if (pin.in) at->in = pin.in;
  if (pin.out) at->out = pin.out;
}

/// The part of a splice over an interval within it.
SampledSplice part(const SampledSplice& splice, const Interval& interval) {
  SampledSplice result{interval, {}};
  const double from = unwrapped(interval.from, splice.samples.front().t - same_t);
  const double to = from + length(interval);
  result.samples.push_back({from, splice.at(from)});
  for (const Sample& sample : splice.samples) {
    if (sample.t > from + same_t && sample.t < to - same_t) result.samples.push_back(sample);
  }
  result.samples.push_back({to, splice.at(to)});
  for (const Pin& pin : splice.pins) {
    if (pin.t > from + same_t && pin.t < to - same_t) result.pins.push_back(pin);
  }
  return result;
}

/// Samples of two splices over the same interval mixed: weight(t) of `second`, the rest of `first`.
template <typename Weight>
SampledSplice mixed(const SampledSplice& first, const SampledSplice& second, const Weight& weight) {
  SampledSplice result{second.interval, {}, second.pins};
  auto a = first.samples.begin();
  auto b = second.samples.begin();
  const double shift = second.samples.front().t - first.samples.front().t;
  while (a != first.samples.end() || b != second.samples.end()) {
    const double ta = a != first.samples.end() ? a->t + shift : second.samples.back().t + 1.0;
    const double tb = b != second.samples.end() ? b->t : ta + 1.0;
    const double t = std::min(ta, tb);
    const bool is_second = tb <= ta + same_t;
    if (is_second) {
      const double w = weight(b->t);
      result.samples.push_back({b->t, w == 1.0 ? b->p : Point(first.at(b->t - shift) * (1.0 - w) + w * b->p)});
      ++b;
      if (ta <= tb + same_t) ++a;
    } else {
      const double w = weight(t);
      if (w < 1.0 && t < second.samples.back().t - same_t) {
        result.samples.push_back({t, w == 0.0 ? a->p : Point(a->p * (1.0 - w) + w * second.at(t))});
      }
      ++a;
    }
  }
  return result;
}

/// From 0 to 1 with slope 0 at both.
double smooth_step(double x) {
  const double in = std::clamp(x, 0.0, 1.0);
  return in * in * (3.0 - 2.0 * in);
}

std::vector<double> corners_of(const BezierContour& contour, const LinkedBezier& bezier, double corner_angle) {
  std::vector<double> corners;
  const std::vector<double> turns = turning_angles(contour);
  for (int i = 0; i < bezier.size(); ++i) {
    if (std::abs(turns[static_cast<std::size_t>(i)]) > corner_angle) corners.push_back(bezier.piece(i).t);
  }
  return corners;
}

void require_options(const LinkedOptions& options) {
  if (!(options.epsilon > 0.0) || !std::isfinite(options.epsilon)) {
    throw InvalidInput(text("LinkedCurve: epsilon ", options.epsilon, " is not positive"));
  }
  if (options.spline_degree < 1 || options.spline_degree > 5) {
    throw InvalidInput(text("LinkedCurve: spline degree ", options.spline_degree, " is not in [1, 5]"));
  }
}

IntervalSet everything() { return IntervalSet({whole_curve}); }

}  // namespace

LinkedCurve::LinkedCurve(const BezierContour& contour, const LinkedOptions& options) {
  require_options(options);
  auto bezier = std::make_shared<const LinkedBezier>(contour);
  rules_ =
      std::make_shared<const Rules>(Rules{options, {}, {}, corners_of(contour, *bezier, options.corner_angle), {}});
  slots_.push_back({std::move(bezier), {}});
  slots_.push_back({std::make_shared<const LinkedPolyline>(), everything()});
  add_slots();
  current_ = bezier_slot;
}

LinkedCurve::LinkedCurve(const Polyline& polyline, const LinkedOptions& options) {
  require_options(options);
  auto form = std::make_shared<const LinkedPolyline>(polyline);
  std::vector<double> corners;
  const Eigen::Index n = polyline.points.rows();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Point in = (polyline.points.row(i) - polyline.points.row((i + n - 1) % n)).transpose();
    const Point out = (polyline.points.row((i + 1) % n) - polyline.points.row(i)).transpose();
    const double turn = std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out));
    if (std::abs(turn) > options.corner_angle) corners.push_back(polyline.t[static_cast<std::size_t>(i)]);
  }
  rules_ = std::make_shared<const Rules>(Rules{options, {}, {}, std::move(corners), {}});
  slots_.push_back({std::make_shared<const LinkedBezier>(), everything()});
  slots_.push_back({std::move(form), {}});
  add_slots();
  current_ = polyline_slot;
}

void LinkedCurve::add_slots() {
  slots_.push_back({std::make_shared<const LinkedSpline>(rules_->options.spline_degree), everything()});
  slots_.push_back({std::make_shared<const LinkedWavelet>(), everything()});
  slots_.push_back({nullptr, everything()});  // arcwise: made when it is read
}

const LinkedWavelet& LinkedCurve::wavelet() const {
  return dynamic_cast<const LinkedWavelet&>(read_slot(wavelet_slot));
}

const LinkedWavelet& LinkedCurve::arcwise() const {
  return dynamic_cast<const LinkedWavelet&>(read_slot(arcwise_slot));
}

LinkedCurve LinkedCurve::with_wavelet(const Changed<LinkedWavelet>& changed) const {
  return with_changed(wavelet_slot, std::make_shared<const LinkedWavelet>(changed.form), {changed.interval});
}

LinkedCurve LinkedCurve::with_arcwise(const Changed<LinkedWavelet>& changed) const {
  return with_changed(arcwise_slot, std::make_shared<const LinkedWavelet>(changed.form), {changed.interval});
}

double LinkedCurve::epsilon() const { return rules_->options.epsilon; }
const LinkedOptions& LinkedCurve::options() const { return rules_->options; }
const std::vector<CurveRule>& LinkedCurve::rules() const { return rules_->rules; }
const std::optional<Interval>& LinkedCurve::marks() const { return rules_->marks; }
std::vector<Interval> LinkedCurve::frozen() const { return rules_->frozen.intervals(); }
std::vector<double> LinkedCurve::corners() const { return rules_->corners; }

std::size_t LinkedCurve::slot_of(const std::type_info& type) const {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i == arcwise_slot) continue;  // of the type of the periodic one
    const Representation& form = *slots_[i].form;
    if (typeid(form) == type) return i;
  }
  throw InvalidInput(text("LinkedCurve: no form of the type ", type.name()));
}

SampledSplice LinkedCurve::sample(const Interval& interval, double tolerance) const {
  return slots_[current_].form->sample(interval, tolerance);
}

SampledSplice LinkedCurve::handed_over(const Interval& interval) const {
  SampledSplice splice = sample(interval, 0.5 * sampling_share * epsilon());
  for (const double corner : rules_->corners) {
    if (const auto at = sample_at(splice, corner)) add_pin(splice, {.t = *at, .is_corner = true});
  }
  return splice;
}

const Representation& LinkedCurve::read_slot(std::size_t slot) const {
  Slot& own = slots_[slot];
  if (!own.form) {
    own.form =
        std::make_shared<const LinkedWavelet>(rules_->corners.size() > 1 ? rules_->corners : std::vector<double>{});
  }
  if (!own.stale.empty()) {
    for (const Interval& interval : own.stale.intervals()) {
      own.form = own.form->splice(handed_over(interval), 0.5 * epsilon());
    }
    own.stale = {};
  }
  return *own.form;
}

LinkedCurve LinkedCurve::with_slot(std::shared_ptr<const Representation> empty) const {
  LinkedCurve result = *this;
  result.slots_.push_back({std::move(empty), everything()});
  return result;
}

LinkedCurve LinkedCurve::with_changed(std::size_t slot, std::shared_ptr<const Representation> form,
                                      const std::vector<Interval>& changed) const {
  read_slot(slot);
  const IntervalSet stretches(changed);
  const bool is_free = std::none_of(changed.begin(), changed.end(), [&](const Interval& interval) {
    return rules_->frozen.overlaps(interval) || rules_->marks.has_value();
  });
  if (!is_free || !rules_->rules.empty()) {
    std::vector<SampledSplice> splices;
    for (const Interval& interval : stretches.intervals()) {
      SampledSplice splice = form->sample(interval, 0.5 * sampling_share * epsilon());
      for (const double corner : rules_->corners) {
        if (const auto at = sample_at(splice, corner)) add_pin(splice, {.t = *at, .is_corner = true});
      }
      splices.push_back(std::move(splice));
    }
    return with_splices(std::move(splices));
  }
  LinkedCurve result = *this;
  result.report_ = {};
  result.report_.changed = stretches.intervals();
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i != slot) result.slots_[i].stale.add(stretches);
  }
  result.slots_[slot].form = std::move(form);
  result.current_ = slot;
  return result;
}

LinkedCurve LinkedCurve::with_splices(std::vector<SampledSplice> splices) const {
  LinkedCurve result = *this;
  result.report_ = {};
  for (const SampledSplice& splice : splices) {
    require_valid("LinkedCurve::with_splices", splice);
    result = result.with_change(splice);
  }
  return result;
}

LinkedCurve LinkedCurve::with_change(const SampledSplice& asked) const {
  LinkedCurve result = *this;
  const auto rules = std::make_shared<Rules>(*rules_);
  IntervalSet held = rules_->frozen;
  if (rules_->marks) {
    for (const Interval& outside : IntervalSet({*rules_->marks}).outside(whole_curve)) held.add(outside);
  }
  result.read_slot(bezier_slot);
  IntervalSet changed;
  for (const Interval& interval : held.outside(asked.interval)) {
    SampledSplice splice = asked;
    if (length(interval) < length(asked.interval)) {
      splice = part(asked, interval);
      const SampledSplice before = sample(interval);
      const double from = splice.samples.front().t;
      const double to = splice.samples.back().t;
      const double quarter = 0.25 * (to - from);
      // Where what is held cut it off, the change sets in smoothly.
      const bool is_cut_before = from > asked.samples.front().t + same_t;
      const bool is_cut_after = to < asked.samples.back().t - same_t;
      splice = mixed(before, splice, [&](double t) {
        return (is_cut_before ? smooth_step((t - from) / quarter) : 1.0) *
               (is_cut_after ? smooth_step((to - t) / quarter) : 1.0);
      });
    }
    std::erase_if(rules->corners, [&](double corner) {
      const double at = unwrapped(corner, splice.samples.front().t);
      return at > splice.samples.front().t + same_t && at < splice.samples.back().t - same_t;
    });
    for (const Pin& pin : splice.pins) {
      if (pin.is_corner) rules->corners.push_back(wrapped(pin.t));
    }
    std::sort(rules->corners.begin(), rules->corners.end());
    rules->corners.erase(
        std::unique(rules->corners.begin(), rules->corners.end(), [](double a, double b) { return b - a < same_t; }),
        rules->corners.end());
    Slot& bezier = result.slots_[bezier_slot];
    bezier.form = bezier.form->splice(splice, 0.5 * epsilon());
    changed.add(interval);
  }
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i != bezier_slot) result.slots_[i].stale.add(changed);
  }
  result.current_ = bezier_slot;
  result.rules_ = rules;
  IntervalSet all(result.report_.changed);
  all.add(changed);
  result.report_.changed = all.intervals();
  return result;
}

LinkedCurve LinkedCurve::with_frozen(const Interval& interval) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->frozen.add(interval);
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::without_frozen(const Interval& interval) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->frozen.subtract(interval);
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::with_corner(double t) const {
  if (!std::isfinite(t)) throw InvalidInput("LinkedCurve::with_corner: t is not finite");
  LinkedCurve result = without_corner(t);
  auto rules = std::make_shared<Rules>(*result.rules_);
  rules->corners.insert(std::lower_bound(rules->corners.begin(), rules->corners.end(), wrapped(t)), wrapped(t));
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::without_corner(double t) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  std::erase_if(rules->corners, [t](double corner) { return std::abs(unwrapped(corner - t, -0.5)) < same_place; });
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::with_marks(std::optional<Interval> marks) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->marks = marks;
  result.rules_ = std::move(rules);
  return result;
}

std::size_t LinkedCurve::bytes_beyond(const LinkedCurve& older) const {
  std::size_t bytes = sizeof(LinkedCurve) + slots_.capacity() * sizeof(Slot);
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (!slots_[i].form || i >= older.slots_.size() || slots_[i].form == older.slots_[i].form) continue;
    bytes += slots_[i].form->bytes_beyond(older.slots_[i].form ? *older.slots_[i].form : *slots_[i].form);
  }
  return bytes;
}

}  // namespace fontcore
