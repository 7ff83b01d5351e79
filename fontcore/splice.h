#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// A stretch of the parameter t, which is counted modulo 1: from `from` forward to `to`. It wraps where `to` is not
/// above `from`; from a place to itself is the whole curve.
struct Interval {
  double from = 0.0;
  double to = 0.0;
};
constexpr Interval whole_curve{0.0, 1.0};

/// t in [0, 1).
double wrapped(double t);
/// t plus the whole number that brings it into [from, from + 1).
double unwrapped(double t, double from);
/// In (0, 1].
double length(const Interval& interval);
/// Whether t lies in it, ends included.
bool contains(const Interval& interval, double t);
/// Whether they share more than an end.
bool overlaps(const Interval& a, const Interval& b);

/// Stretches that are disjoint, in order, ends in [0, 1]; one at most wraps. Touching ones are merged.
class IntervalSet {
 public:
  IntervalSet() = default;
  explicit IntervalSet(const std::vector<Interval>& intervals) {
    for (const Interval& interval : intervals) add(interval);
  }

  bool empty() const { return spans_.empty(); }
  void add(const Interval& interval);
  void add(const IntervalSet& more);
  void subtract(const Interval& interval);
  bool contains(double t) const;
  bool overlaps(const Interval& interval) const;
  /// What of an interval is in the set, in the interval's order.
  std::vector<Interval> within(const Interval& interval) const;
  /// What of an interval is not in the set, in the interval's order.
  std::vector<Interval> outside(const Interval& interval) const;
  /// In order of `from`; the one that runs over 0, if any, as one, last.
  std::vector<Interval> intervals() const;

  friend bool operator==(const IntervalSet& a, const IntervalSet& b);

 private:
  std::vector<Interval> spans_;  // 0 <= from < to <= 1, in order, apart
};

/// A point of a curve at a parameter.
struct Sample {
  double t = 0.0;
  Point p = Point::Zero();
};

/// A sample that the curve passes exactly, as far as a representation can.
struct Pin {
  double t = 0.0;              ///< that of the sample
  bool is_corner = false;      ///< the curve may turn here
  std::optional<Point> in{};   ///< unit direction in which it arrives
  std::optional<Point> out{};  ///< and leaves
};

/// A stretch of a curve as a polyline over t: what representations tell each other.
///
/// The first sample is at `interval.from`, the last at its end; t ascends strictly along the interval, so that it may
/// exceed 1 (never by more than the interval's length). Pins ascend too.
struct SampledSplice {
  Interval interval;
  std::vector<Sample> samples;
  std::vector<Pin> pins{};

  /// The polyline at t, which is brought into the interval by whole numbers; beyond its ends, the nearer one.
  Point at(double t) const;
};
/// Throws  InvalidInput, naming the function and the sample, if there are fewer than two, t does not ascend or does not
///         begin and end with the interval, or something is not finite; or if a pin is at no sample.
void require_valid(const char* function, const SampledSplice& splice);

/// The splice with its ends moved to where a curve enters and leaves it; the differences fade out linearly over a
/// quarter of the interval on either side, at pins to nothing.
SampledSplice meet(SampledSplice splice, const Point& from, const Point& to);

/// What a sample may be away from the curve at the same t for samples that are to be fitted: a share of the half of
/// epsilon that sampling has, so that a fit is measured against the curve and not against its chords.
constexpr double sampling_share = 0.125;
/// Share of the other half that built-in representations use when they fit: the rest is for the ends, where a curve
/// that is to stay as it is may be off by as much as it was.
constexpr double fitting_share = 0.5;

/// A closed curve over t in [0, 1) in some form of its own, as a value.
///
/// To add one to a LinkedCurve these two are all that it takes; nothing else knows of it.
///
/// Source  [GA98] section 4.2.
class Representation {
 public:
  virtual ~Representation() = default;

  /// The curve over an interval, as a polyline nowhere farther than `tolerance` from the curve's point at the same t.
  virtual SampledSplice sample(const Interval& interval, double tolerance) const = 0;
  /// The curve with an interval replaced: there within `tolerance` of the samples at every t but near the ends, where
  /// it goes on from what stays (see `meet`); outside it does not change.
  ///
  /// An interval from a place to itself replaces everything, so an empty representation can be made from samples.
  virtual std::shared_ptr<const Representation> splice(const SampledSplice& samples, double tolerance) const = 0;
  /// Bytes that it holds and the other, an older value of the same type, does not.
  virtual std::size_t bytes_beyond(const Representation& /*other*/) const { return 0; }

 protected:
  Representation() = default;
  Representation(const Representation&) = default;
  Representation(Representation&&) = default;
  Representation& operator=(const Representation&) = default;
  Representation& operator=(Representation&&) = default;
};

/// A changed representation, and where it differs from what it was.
template <typename Form>
struct Changed {
  Form form;
  Interval interval;
};

}  // namespace fontcore
