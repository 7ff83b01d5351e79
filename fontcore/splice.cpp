#include "fontcore/splice.h"

#include <algorithm>
#include <cmath>

#include "fontcore/error.h"

namespace fontcore {

double wrapped(double t) {
  const double in = t - std::floor(t);
  return in < 1.0 ? in : 0.0;  // -1e-17 rounds up to 1
}

double unwrapped(double t, double from) {
  const double up = t + std::ceil(from - t);
  return up < from ? up + 1.0 : up;
}

double length(const Interval& interval) {
  const double way = interval.to - interval.from;
  return way > 0.0 ? std::min(way, 1.0) : way - std::ceil(way) + 1.0;
}

bool contains(const Interval& interval, double t) {
  return unwrapped(t, interval.from) <= interval.from + length(interval);
}

namespace {

/// The parts of an interval within [0, 1], in its order.
std::vector<Interval> unrolled(const Interval& interval) {
  const double way = length(interval);
  if (way >= 1.0 && interval.from == 0.0) return {{0.0, 1.0}};
  const double from = wrapped(interval.from);
  const double to = from + way;
  // A wrapped end is taken as it was given: from + way may differ by a rounding.
  const double given_to = wrapped(interval.to);
  if (to <= 1.0) return {{from, given_to > from ? given_to : 1.0}};
  if (given_to == 0.0) return {{from, 1.0}};
  return {{from, 1.0}, {0.0, given_to}};
}

/// What of a span in [0, 1] lies in others that are in order and apart.
void add_common(const Interval& span, const std::vector<Interval>& others, std::vector<Interval>& common) {
  for (const Interval& other : others) {
    const double from = std::max(span.from, other.from);
    const double to = std::min(span.to, other.to);
    if (from < to) common.push_back({from, to});
  }
}

/// Spans in order along an interval, those that touch where it runs over 0 made one.
std::vector<Interval> rolled(std::vector<Interval> spans) {
  for (std::size_t i = 0; i + 1 < spans.size(); ++i) {
    if (spans[i].to == 1.0 && spans[i + 1].from == 0.0) {
      spans[i].to = spans[i + 1].to;
      spans.erase(spans.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    }
  }
  return spans;
}

std::vector<Interval> complement(const std::vector<Interval>& spans) {
  std::vector<Interval> rest;
  double from = 0.0;
  for (const Interval& span : spans) {
    if (span.from > from) rest.push_back({from, span.from});
    from = span.to;
  }
  if (from < 1.0) rest.push_back({from, 1.0});
  return rest;
}

}  // namespace

bool overlaps(const Interval& a, const Interval& b) { return IntervalSet({a}).overlaps(b); }

void IntervalSet::add(const Interval& interval) {
  for (Interval span : unrolled(interval)) {
    const auto first =
        std::partition_point(spans_.begin(), spans_.end(), [&](const Interval& other) { return other.to < span.from; });
    auto last = first;
    for (; last != spans_.end() && last->from <= span.to; ++last) {
      span.from = std::min(span.from, last->from);
      span.to = std::max(span.to, last->to);
    }
    spans_.insert(spans_.erase(first, last), span);
  }
}

void IntervalSet::add(const IntervalSet& more) {
  for (const Interval& span : more.spans_) add(span);
}

void IntervalSet::subtract(const Interval& interval) {
  for (const Interval& span : unrolled(interval)) {
    std::vector<Interval> rest;
    for (const Interval& own : spans_) {
      if (own.from < std::min(own.to, span.from)) rest.push_back({own.from, std::min(own.to, span.from)});
      if (std::max(own.from, span.to) < own.to) rest.push_back({std::max(own.from, span.to), own.to});
    }
    spans_ = std::move(rest);
  }
}

bool IntervalSet::contains(double t) const {
  const double in = wrapped(t);
  return std::any_of(spans_.begin(), spans_.end(), [in](const Interval& span) {
    return (span.from <= in && in <= span.to) || (in == 0.0 && span.to == 1.0);
  });
}

bool IntervalSet::overlaps(const Interval& interval) const { return !within(interval).empty(); }

std::vector<Interval> IntervalSet::within(const Interval& interval) const {
  std::vector<Interval> common;
  for (const Interval& span : unrolled(interval)) add_common(span, spans_, common);
  return rolled(std::move(common));
}

std::vector<Interval> IntervalSet::outside(const Interval& interval) const {
  const std::vector<Interval> rest = complement(spans_);
  std::vector<Interval> common;
  for (const Interval& span : unrolled(interval)) add_common(span, rest, common);
  return rolled(std::move(common));
}

std::vector<Interval> IntervalSet::intervals() const {
  std::vector<Interval> result = spans_;
  if (result.size() > 1 && result.front().from == 0.0 && result.back().to == 1.0) {
    result.back().to = result.front().to;
    result.erase(result.begin());
  }
  return result;
}

bool operator==(const IntervalSet& a, const IntervalSet& b) {
  return std::equal(a.spans_.begin(), a.spans_.end(), b.spans_.begin(), b.spans_.end(),
                    [](const Interval& x, const Interval& y) { return x.from == y.from && x.to == y.to; });
}

Point SampledSplice::at(double t) const {
  if (t < samples.front().t || t > samples.back().t) {
    t = unwrapped(t, samples.front().t);
    const double past = t - samples.back().t;
    if (past > 0.0) return (past < samples.front().t + 1.0 - t ? samples.back() : samples.front()).p;
  }
  const auto after =
      std::partition_point(samples.begin(), samples.end(), [t](const Sample& sample) { return sample.t <= t; });
  if (after == samples.begin()) return samples.front().p;
  if (after == samples.end()) return samples.back().p;
  const Sample& a = after[-1];
  const double share = (t - a.t) / (after->t - a.t);
  return a.p + share * (after->p - a.p);
}

void require_valid(const char* function, const SampledSplice& splice) {
  const auto& samples = splice.samples;
  if (samples.size() < 2) throw InvalidInput(text(function, ": a splice of ", samples.size(), " samples"));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!std::isfinite(samples[i].t) || !samples[i].p.allFinite()) {
      throw InvalidInput(text(function, ": sample ", i, " is not finite"));
    }
    if (i > 0 && !(samples[i].t > samples[i - 1].t)) {
      throw InvalidInput(text(function, ": sample ", i, " at t = ", samples[i].t, " is not after the one before"));
    }
  }
  if (!std::isfinite(splice.interval.from) || !std::isfinite(splice.interval.to)) {
    throw InvalidInput(text(function, ": an interval that is not finite"));
  }
  const double way = length(splice.interval);
  if (std::abs(samples.back().t - samples.front().t - way) > 1e-9 ||
      std::abs(unwrapped(samples.front().t - splice.interval.from, -0.5)) > 1e-9) {
    throw InvalidInput(text(function, ": samples from t = ", samples.front().t, " to ", samples.back().t,
                            " for the interval from ", splice.interval.from, " to ", splice.interval.to));
  }
  std::size_t sample = 0;
  for (const Pin& pin : splice.pins) {
    while (sample < samples.size() && samples[sample].t < pin.t) ++sample;
    if (sample == samples.size() || samples[sample].t != pin.t) {
      throw InvalidInput(text(function, ": a pin at t = ", pin.t, ", where no sample is"));
    }
  }
}

SampledSplice meet(SampledSplice splice, const Point& from, const Point& to) {
  auto& samples = splice.samples;
  const double start = samples.front().t;
  const double end = samples.back().t;
  const double quarter = 0.25 * (end - start);
  // A pin stays where it is, so the difference must have gone before it.
  double first = start + quarter;
  double last = end - quarter;
  for (const Pin& pin : splice.pins) {
    if (pin.t > start) first = std::min(first, pin.t);
    if (pin.t < end) last = std::max(last, pin.t);
  }
  const Point off_start = from - samples.front().p;
  const Point off_end = to - samples.back().p;
  const bool moves_start = !off_start.isZero(0.0);
  const bool moves_end = !off_end.isZero(0.0);
  // The fading ends at samples, so that between them nothing is off by more than at them.
  for (Sample& sample : samples) {
    if (moves_start && sample.t < first) sample.p += (first - sample.t) / (first - start) * off_start;
    if (moves_end && sample.t > last) sample.p += (sample.t - last) / (end - last) * off_end;
  }
  samples.front().p = from;
  samples.back().p = to;
  return splice;
}

}  // namespace fontcore
