#include "fontcore/linked_curve.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
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

TEST_CASE("what is frozen keeps its bits in every form, and the change meets it smoothly", "[linked]") {
  const BezierContour contour = letter();
  const Interval frozen{0.3, 0.37};
  LinkedCurve curve = LinkedCurve(contour).with_frozen(frozen);
  const LinkedCurve before = curve;
  static_cast<void>(before.polyline());
  static_cast<void>(before.spline());
  static_cast<void>(before.wavelet());
  curve = before;
  std::mt19937 random(3);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  for (int step = 0; step < 40; ++step) {
    const double from = uniform(0.1, 0.45);
    const SampledSplice splice = bulged(curve, {from, from + uniform(0.02, 0.2)}, {uniform(-30, 30), uniform(-30, 30)});
    curve = curve.with_splice(splice);
    for (const Interval& changed : curve.report().changed) CHECK_FALSE(overlaps(changed, frozen));
    static_cast<void>(curve.polyline());
    static_cast<void>(curve.spline());
    static_cast<void>(curve.wavelet());
  }
  for (int k = 0; k <= 1000; ++k) {
    const double t = frozen.from + (frozen.to - frozen.from) * k / 1000;
    CHECK(same_bits(curve.bezier().evaluate(t), before.bezier().evaluate(t)));
    CHECK((curve.spline().evaluate(t) - before.spline().evaluate(t)).norm() < 1e-9);
    CHECK(same_bits(curve.wavelet().evaluate(t), before.wavelet().evaluate(t)));
  }
  for (const Sample& vertex : before.polyline().vertices(frozen)) {
    CHECK(same_bits(curve.polyline().evaluate(vertex.t), vertex.p));
  }
  // The tangent does not jump where the frozen stretch begins.
  const Point in = curve.bezier().tangent(frozen.to, Side::Left);
  const Point out = curve.bezier().tangent(frozen.to, Side::Right);
  CHECK(in.dot(out) > std::cos(0.05));
  CHECK(curve.with_splice(bulged(curve, {0.31, 0.36}, {5, 5})).report().share == 0.0);
  CHECK(curve.without_frozen(frozen).frozen().empty());
}

TEST_CASE("outside the marks nothing changes", "[linked]") {
  const LinkedCurve curve = LinkedCurve(letter()).with_marks(Interval{0.9, 0.1});
  const LinkedCurve after = curve.with_splice(bulged(curve, {0.8, 0.2}, {20, 20}));
  REQUIRE(after.report().changed.size() == 1);
  CHECK(after.report().changed[0].from == 0.9);
  CHECK(after.report().changed[0].to == 0.1);
  for (double t = 0.1; t <= 0.9; t += 1.0 / 1024) {
    CHECK(same_bits(after.bezier().evaluate(t), curve.bezier().evaluate(t)));
  }
}

TEST_CASE("points and corners hold whatever is changed, each exactly", "[linked]") {
  const BezierContour contour = shapes::circle(300);
  LinkedCurve curve(contour);
  const double held_t = 0.2;
  const Point held = curve.bezier().evaluate(held_t);
  const Point near = curve.bezier().evaluate(0.23) + Point(5, -3);
  const Point at = curve.bezier().evaluate(0.6);
  const Point in = Point(-1, -0.2).normalized();
  const Point out = Point(0.3, -1).normalized();
  curve = curve.with_rule({"first point", HeldPoint{held_t, held}})
              .with_rule({"second point", HeldPoint{0.23, near}})
              .with_rule({"corner", HeldCorner{0.6, at, in, out}});
  std::mt19937 random(5);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  for (int step = 0; step < 60; ++step) {
    const double from = uniform(0, 1);
    const Interval interval{from, wrapped(from + uniform(0.02, 0.4))};
    curve = curve.with_splice(bulged(curve, interval, {uniform(-20, 20), uniform(-20, 20)}));
    CHECK((curve.bezier().evaluate(held_t) - held).norm() < 1e-9);
    CHECK((curve.bezier().evaluate(0.23) - near).norm() < 1e-9);
    CHECK((curve.bezier().evaluate(0.6) - at).norm() < 1e-9);
    CHECK((curve.bezier().tangent(0.6, Side::Left) - in).norm() < 1e-9);
    CHECK((curve.bezier().tangent(0.6, Side::Right) - out).norm() < 1e-9);
    CHECK((curve.polyline().evaluate(0.6) - at).norm() < 1e-9);
    CHECK((curve.spline().evaluate(0.6) - at).norm() < 1e-7);
    CHECK((curve.wavelet().evaluate(0.6) - at).norm() < curve.epsilon());
    CHECK(curve.report().rounds == 1);
  }
}

TEST_CASE("a held line stays straight between its ends, wherever they go", "[linked]") {
  LinkedCurve curve(shapes::square(600));
  curve = curve.with_rule({"side", HeldLine{{0.25, 0.5}}});
  const auto bend = [](const LinkedCurve& of) {
    const Point a = of.bezier().evaluate(0.25);
    const Point b = of.bezier().evaluate(0.5);
    double off = 0.0;
    for (double t = 0.25; t < 0.5; t += 1e-3) {
      const Point p = of.bezier().evaluate(t) - a;
      off = std::max(off, std::abs(p.x() * (b - a).y() - p.y() * (b - a).x()) / (b - a).norm());
    }
    return off;
  };
  const LinkedCurve inside = curve.with_splice(bulged(curve, {0.3, 0.4}, {50, 0}));
  CHECK(bend(inside) < 1e-9);
  CHECK(farthest_apart(inside.bezier(), curve.bezier()) < 1e-9);
  SampledSplice corner = bulged(curve, {0.15, 0.35}, {50, 30});
  corner.pins.push_back({.t = corner.samples[32].t, .is_corner = true});
  const LinkedCurve moved = curve.with_splice(corner);
  CHECK(bend(moved) < 1e-9);
  CHECK((moved.bezier().evaluate(0.25) - curve.bezier().evaluate(0.25) - Point(50, 30)).norm() < 1e-9);
  CHECK((moved.bezier().evaluate(0.5) - curve.bezier().evaluate(0.5)).norm() < 1e-9);
}

TEST_CASE("a held area is the Bezier outline's, exactly, and is given back within the change", "[linked]") {
  for (const BezierContour& contour : {letter(), shapes::circle(300)}) {
    const double area = signed_area(contour);
    LinkedCurve curve = LinkedCurve(contour).with_rule({"area", HeldArea{area}});
    CHECK(curve.bezier().contour() == contour);
    std::mt19937 random(11);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
    };
    for (int step = 0; step < 50; ++step) {
      const double from = uniform(0, 1);
      const Interval interval{from, wrapped(from + uniform(0.05, 0.3))};
      const LinkedCurve before = curve;
      curve = curve.with_splice(bulged(curve, interval, {uniform(-20, 20), uniform(-20, 20)}));
      CHECK(std::abs(signed_area(curve.bezier().contour()) - area) < 1e-9 * std::abs(area));
      CHECK(same_bits(curve.bezier().evaluate(wrapped(interval.to + 0.05)),
                      before.bezier().evaluate(wrapped(interval.to + 0.05))));
      CHECK(farthest_apart(curve.bezier(), curve.polyline()) < curve.epsilon());
    }
    const LinkedCurve larger = curve.without_rule("area").with_rule({"area", HeldArea{1.02 * area}});
    CHECK(signed_area(larger.bezier().contour()) == Approx(1.02 * area).epsilon(1e-9));
  }
}

TEST_CASE("a change that would make the curve cross itself is reduced or refused", "[linked]") {
  const LinkedCurve circle(shapes::circle(300));
  const SampledSplice through = bulged(circle, {0.95, 0.05}, {-900, 0});
  CHECK_FALSE(is_simple(circle.with_splice(through).bezier().contour()));
  const LinkedCurve reduced = circle.with_rule({"simple", NoAddedCrossing{}}).with_splice(through);
  CHECK(is_simple(reduced.bezier().contour()));
  CHECK(reduced.report().share > 0.5);
  CHECK(reduced.report().share < 0.7);
  CHECK(reduced.report().added_crossings == 2);
  CHECK(reduced.report().rounds <= 9);
  const LinkedCurve refused =
      circle.with_rule({"simple", NoAddedCrossing{NoAddedCrossing::Otherwise::Refuse}}).with_splice(through);
  CHECK(refused.bezier().contour() == circle.bezier().contour());
  CHECK(refused.report().share == 0.0);
  CHECK_FALSE(refused.report().refused.empty());
}

TEST_CASE("overlapping claims are refused, both named", "[linked]") {
  const LinkedCurve curve = LinkedCurve(shapes::square(600))
                                .with_rule({"stem", HeldLine{{0.25, 0.5}}})
                                .with_rule({"terminal", Frozen{{0.6, 0.7}}})
                                .with_rule({"dot", HeldPoint{0.1, {240, 0}}});
  const auto message = [&](const CurveRule& rule) {
    return message_of<UnsatisfiableConstraints>([&] { static_cast<void>(curve.with_rule(rule)); });
  };
  for (const auto& [rule, other] : {std::pair<CurveRule, std::string>{{"a", HeldPoint{0.3, {600, 0}}}, "stem"},
                                    {{"b", HeldLine{{0.4, 0.55}}}, "stem"},
                                    {{"c", HeldPoint{0.65, {0, 0}}}, "terminal"},
                                    {{"d", HeldLine{{0.65, 0.8}}}, "terminal"},
                                    {{"e", HeldCorner{0.1, {240, 0}, {1, 0}, {0, 1}}}, "dot"}}) {
    INFO(rule.name);
    CHECK(message(rule).find(other) != std::string::npos);
    CHECK(message(rule).find(rule.name + " and") != std::string::npos);
  }
  // A held point that lies where the frozen curve is asks for nothing.
  CHECK_NOTHROW(curve.with_rule({"f", HeldPoint{0.65, curve.bezier().evaluate(0.65)}}));
  CHECK_THROWS_AS(curve.with_rule({"dot", HeldPoint{0.9, {0, 100}}}), InvalidInput);
}

TEST_CASE("compaction keeps a long session from growing, and what is frozen as it is", "[linked]") {
  const Interval frozen{0.4, 0.5};
  LinkedCurve curve = LinkedCurve(shapes::circle(300), {.epsilon = 1.0}).with_frozen(frozen);
  const LinkedCurve before = curve;
  std::mt19937 random(13);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  int most = 0;
  for (int step = 0; step < 200; ++step) {
    const double from = uniform(0, 1);
    const Interval interval{from, wrapped(from + uniform(0.05, 0.2))};
    // There and back again: the shape goes nowhere.
    const Point by(uniform(-15, 15), uniform(-15, 15));
    curve = curve.with_splice(bulged(curve, interval, by));
    curve = curve.with_splice(bulged(curve, interval, -by));
    if (step % 10 == 9) {
      const LinkedCurve compact = curve.compacted(0.5 * curve.epsilon());
      CHECK(compact.bezier().size() <= curve.bezier().size());
      curve = compact;
      most = std::max(most, curve.bezier().size());
    }
  }
  CHECK(most < 60);
  CHECK(farthest_apart(curve.bezier(), curve.polyline()) < curve.epsilon());
  for (double t = frozen.from; t <= frozen.to; t += 1e-3) {
    CHECK(same_bits(curve.bezier().evaluate(t), before.bezier().evaluate(t)));
  }
}
