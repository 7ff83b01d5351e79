#include "fontcore/linked_curve.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

/// Largest distance of two forms at equal t over an interval, at many places.
double farthest_apart(const Representation& a, const Representation& b, const Interval& interval = whole_curve) {
  const SampledSplice x = a.sample(interval, 1e-4);
  const SampledSplice y = b.sample(interval, 1e-4);
  double largest = 0.0;
  for (const SampledSplice* run : {&x, &y}) {
    for (std::size_t i = 0; i < run->samples.size(); ++i) {
      const double t = run->samples[i].t;
      largest = std::max(largest, (x.at(t) - y.at(t)).norm());
    }
  }
  return largest;
}

/// A stretch of a curve moved along a direction, fading to nothing at its ends with its slope.
SampledSplice bulged(const LinkedCurve& curve, const Interval& interval, const Point& by) {
  SampledSplice splice = curve.sample(interval);
  const SampledSplice before = splice;
  const double from = before.samples.front().t;
  const double way = length(interval);
  splice.samples.clear();
  for (int k = 0; k <= 64; ++k) {
    const double t = k == 64 ? before.samples.back().t : from + way * k / 64;
    const double x = 2.0 * k / 64 - 1.0;
    splice.samples.push_back({t, before.at(t) + (1.0 - x * x) * (1.0 - x * x) * by});
  }
  return splice;
}

bool same_bits(const Point& a, const Point& b) { return std::memcmp(a.data(), b.data(), sizeof(double) * 2) == 0; }

BezierContour letter() { return shapes::letter_a()[0]; }

}  // namespace

TEST_CASE("intervals wrap, and sets of them stay disjoint", "[linked]") {
  CHECK(length({0.9, 0.2}) == Approx(0.3));
  CHECK(length({0.3, 0.3}) == 1.0);
  CHECK(contains({0.9, 0.2}, 0.05));
  CHECK_FALSE(contains({0.9, 0.2}, 0.5));
  CHECK(overlaps({0.9, 0.2}, {0.1, 0.3}));
  CHECK_FALSE(overlaps({0.9, 0.2}, {0.2, 0.9}));
  IntervalSet set;
  set.add({0.9, 0.1});
  set.add({0.4, 0.5});
  set.add({0.5, 0.6});
  REQUIRE(set.intervals().size() == 2);
  CHECK(set.intervals()[1].from == 0.9);
  CHECK(set.intervals()[1].to == 0.1);
  CHECK(set.intervals()[0].to == 0.6);
  set.subtract({0.95, 0.45});
  REQUIRE(set.intervals().size() == 2);
  CHECK(set.intervals()[0].from == 0.45);
  CHECK(set.intervals()[1].to == 0.95);
  const auto rest = set.outside({0.5, 0.2});
  REQUIRE(rest.size() == 2);
  CHECK(rest[0].from == 0.6);
  CHECK(rest[1].from == 0.95);
  CHECK(rest[1].to == 0.2);
}

TEST_CASE("a linked curve that nothing changed is its contour, bit for bit", "[linked]") {
  for (const BezierContour& contour : {letter(), shapes::circle(300), shapes::arch(400), shapes::square(500)}) {
    const LinkedCurve curve(contour);
    CHECK(curve.bezier().contour() == contour);
    CHECK(farthest_apart(curve.bezier(), curve.polyline()) < curve.epsilon());
    CHECK(curve.bezier().contour() == contour);
  }
}

TEST_CASE("a splice changes nothing outside it by a bit", "[linked]") {
  const BezierContour contour = letter();
  const LinkedCurve before(contour);
  before.polyline();
  for (const Interval interval :
       {Interval{0.21, 0.34}, Interval{0.93, 0.08}, Interval{0.5, 0.52}, Interval{0.02, 0.97}}) {
    const LinkedCurve after = before.with_splice(bulged(before, interval, {30, 20}));
    const Interval outside{interval.to, interval.from};
    for (double t = interval.to; t < interval.to + length(outside); t += 1.0 / 4096) {
      CHECK(same_bits(after.bezier().evaluate(t), before.bezier().evaluate(t)));
    }
    for (int i = 0; i < before.polyline().size(); ++i) {
      const Sample vertex = before.polyline().vertex(i);
      if (!contains(outside, vertex.t) || !contains(outside, vertex.t + 1e-9) || !contains(outside, vertex.t - 1e-9)) {
        continue;
      }
      const Sample same = after.polyline().vertex(after.polyline().vertex_at(vertex.t));
      CHECK(same.t == vertex.t);
      CHECK(same_bits(same.p, vertex.p));
    }
    int untouched = 0;
    for (int i = 0; i < after.bezier().size(); ++i) untouched += after.bezier().piece(i).source >= 0 ? 1 : 0;
    int expected = 0;
    for (int i = 0; i < before.bezier().size(); ++i) {
      const Interval own{before.bezier().piece(i).t, before.bezier().end(i)};
      expected += overlaps(own, interval) ? 0 : 1;
    }
    CHECK(untouched == expected);
    CHECK(farthest_apart(after.bezier(), after.polyline()) < after.epsilon());
  }
}

TEST_CASE("both halves of epsilon are kept, whatever epsilon is", "[linked]") {
  const BezierContour contour = letter();
  for (const double epsilon : {0.05, 0.5, 5.0}) {
    const LinkedCurve curve(contour, {.epsilon = epsilon});
    const SampledSplice asked = bulged(curve, {0.3, 0.45}, {-25, 40});
    const auto put = curve.bezier().splice(asked, 0.5 * epsilon);
    CHECK(farthest_apart(*put, LinkedPolyline(*std::make_shared<const LinkedPolyline>(curve.polyline()))) >= 0.0);
    const SampledSplice got = put->sample(asked.interval, 1e-4 * epsilon);
    double worst = 0.0;
    for (const Sample& sample : got.samples) worst = std::max(worst, (sample.p - asked.at(sample.t)).norm());
    CHECK(worst < 0.5 * epsilon);
    const SampledSplice sampled = put->sample(asked.interval, 0.5 * epsilon);
    worst = 0.0;
    for (const Sample& sample : got.samples) worst = std::max(worst, (sample.p - sampled.at(sample.t)).norm());
    CHECK(worst < 0.5 * epsilon);
  }
}

TEST_CASE("all forms stay within epsilon of each other over many splices", "[linked]") {
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  for (const BezierContour& contour : {letter(), shapes::circle(300), shapes::square(600)}) {
    LinkedCurve curve(contour);
    for (int step = 0; step < 60; ++step) {
      const double from = uniform(0, 1);
      const Interval interval{from, wrapped(from + uniform(0.01, 0.3))};
      curve = curve.with_splice(bulged(curve, interval, {uniform(-40, 40), uniform(-40, 40)}));
      if (random() % 2 == 0) CHECK(farthest_apart(curve.bezier(), curve.polyline()) < curve.epsilon());
      if (random() % 3 == 0) CHECK(farthest_apart(curve.bezier(), curve.spline()) < curve.epsilon());
      if (random() % 3 == 0) CHECK(farthest_apart(curve.bezier(), curve.wavelet()) < curve.epsilon());
      if (random() % 3 == 0) CHECK(farthest_apart(curve.bezier(), curve.arcwise()) < curve.epsilon());
    }
    INFO("pieces " << curve.bezier().size() << ", vertices " << curve.polyline().size() << ", knots "
                   << curve.spline().size());
    CHECK(farthest_apart(curve.polyline(), curve.spline()) < curve.epsilon());
    CHECK(farthest_apart(curve.arcwise(), curve.wavelet()) < curve.epsilon());
  }
}
