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

TEST_CASE("samples beyond their ends are at the nearer one", "[linked]") {
  const SampledSplice splice{{0.2, 0.5}, {{0.2, {1, 0}}, {0.5, {2, 0}}}};
  CHECK(splice.at(std::nextafter(0.2, 0.0)) == Point(1, 0));
  CHECK(splice.at(std::nextafter(0.5, 1.0)) == Point(2, 0));
  CHECK(splice.at(1.1) == Point(1, 0));
  CHECK(splice.at(0.6) == Point(2, 0));
  CHECK(splice.at(1.35).x() == Approx(1.5).epsilon(1e-12));
}

TEST_CASE("the parts of a curve over a stretch and over what is left make up the whole", "[linked]") {
  const BezierContour contour = shapes::circle(300);
  const LinkedBezier bezier(contour);
  for (const Interval& interval : {Interval{0.3, 0.29}, Interval{0.29, 0.3}, Interval{0.1, 0.7}, Interval{0.4, 0.4}}) {
    double area = 0.0;
    for (const LinkedBezier::Piece& piece : bezier.pieces_within(interval)) area += signed_area(piece.bezier);
    if (length(interval) < 1.0) {
      for (const LinkedBezier::Piece& piece : bezier.pieces_within({interval.to, interval.from})) {
        area += signed_area(piece.bezier);
      }
    }
    CHECK(area == Approx(signed_area(contour)).epsilon(1e-12));
  }
}

TEST_CASE("a straight stretch takes fine detail out of every form", "[linked]") {
  for (const Interval& line : {Interval{0.30, 0.33}, Interval{0.05, 0.2}, Interval{0.9, 0.15}}) {
    LinkedCurve curve(letter());
    static_cast<void>(curve.arcwise());
    static_cast<void>(curve.wavelet());
    SampledSplice rough = curve.sample(whole_curve);
    const SampledSplice smooth = rough;
    rough.samples.clear();
    for (int k = 0; k <= 2000; ++k) {
      rough.samples.push_back({k / 2000.0, smooth.at(k / 2000.0) + 4.0 * std::sin(0.9 * k) * Point(1, -1)});
    }
    rough.samples.back().p = rough.samples.front().p;
    curve = curve.with_splice(rough);
    static_cast<void>(curve.arcwise());
    static_cast<void>(curve.wavelet());
    const Point from = curve.bezier().evaluate(line.from);
    const Point to = curve.bezier().evaluate(line.to);
    curve = curve.with_splice({line, {{line.from, from}, {line.from + length(line), to}}});
    CHECK(farthest_apart(curve.bezier(), curve.arcwise()) <= curve.epsilon());
    CHECK(farthest_apart(curve.bezier(), curve.wavelet()) <= curve.epsilon());
  }
}

TEST_CASE("a closed form follows fine detail about the place where t begins", "[linked]") {
  for (const double width : {0.3, 0.03, 0.003}) {
    const LinkedCurve curve(shapes::circle(300));
    SampledSplice whole{whole_curve, {}};
    for (int k = 0; k <= 4000; ++k) {
      const double t = k / 4000.0;
      const double near = (t < 0.5 ? t : t - 1.0) / width;
      const Point p = curve.bezier().evaluate(t == 1.0 ? 0.0 : t);
      whole.samples.push_back({t, p * (1.0 + 0.1 * std::exp(-near * near) * std::cos(5.0 * near))});
    }
    const LinkedCurve rough = curve.with_splice(whole);
    CHECK(farthest_apart(rough.bezier(), rough.wavelet()) <= rough.epsilon());
    CHECK(farthest_apart(rough.bezier(), rough.arcwise()) <= rough.epsilon());
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

TEST_CASE("a splice that ends at a corner beside a knot by rounding leaves the knots ascending", "[linked]") {
  const LinkedSpline drawn = LinkedCurve(letter()).spline();
  std::mt19937 engine(11);
  for (int k = 0; k < 200; ++k) {
    const double start = static_cast<double>(engine()) / 4294967296.0;
    const double end = static_cast<double>(engine()) / 4294967296.0;
    if (length({start, end}) < 0.1 || length({start, end}) > 0.9) continue;
    const LinkedSpline spline = drawn.insert_knot(start).insert_knot(end);
    SampledSplice samples = spline.sample({start, std::nextafter(end, 0.0)}, 0.1);
    samples.pins = {{.t = samples.samples.back().t, .is_corner = true}};
    const auto spliced = std::dynamic_pointer_cast<const LinkedSpline>(spline.splice(samples, 0.1));
    REQUIRE(spliced);
    bool ascends = true;
    for (int i = 0; i + 1 < spliced->size(); ++i) ascends = ascends && spliced->knot(i) <= spliced->knot(i + 1);
    CHECK(ascends);
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

namespace {

/// A form that fontcore knows nothing of: Hermite cubics between nodes, with a slope on either side of each.
class HermiteForm : public Representation {
 public:
  SampledSplice sample(const Interval& interval, double tolerance) const override {
    SampledSplice result{interval, {}};
    const double from = wrapped(interval.from);
    const double to = from + length(interval);
    result.samples.push_back({from, evaluate(from)});
    for (const double turn : {0.0, 1.0}) {
      for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const double way = end(i) - nodes_[i].t;
        const double bend = 10.0 * (nodes_[i].out.norm() + nodes_[(i + 1) % nodes_.size()].in.norm()) * way;
        const int parts = 1 + static_cast<int>(std::sqrt(bend / (8.0 * tolerance)));
        for (int k = 0; k < parts; ++k) {
          const double t = nodes_[i].t + way * k / parts + turn;
          if (t > result.samples.back().t + 1e-12 && t < to - 1e-12) result.samples.push_back({t, evaluate(t)});
        }
      }
    }
    result.samples.push_back({to, evaluate(to)});
    return result;
  }
  std::shared_ptr<const Representation> splice(const SampledSplice& samples, double /*tolerance*/) const override {
    const bool is_whole = length(samples.interval) >= 1.0;
    const SampledSplice met =
        is_whole ? samples : meet(samples, evaluate(samples.interval.from), evaluate(samples.interval.to));
    auto result = std::make_shared<HermiteForm>();
    for (const Node& node : nodes_) {
      if (!contains(samples.interval, node.t)) result->nodes_.push_back(node);
    }
    for (std::size_t i = 0; i + (is_whole ? 1 : 0) < met.samples.size(); ++i) {
      const auto slope = [&](std::size_t k) -> Point {
        return (met.samples[k + 1].p - met.samples[k].p) / (met.samples[k + 1].t - met.samples[k].t);
      };
      const std::size_t last = met.samples.size() - 1;
      Node node{wrapped(met.samples[i].t), met.samples[i].p, {}, {}};
      node.in = i > 0 ? slope(i - 1) : is_whole ? slope(last - 1) : arriving(samples.interval.from);
      node.out = i < last ? slope(i) : derivative(samples.interval.to);
      result->nodes_.push_back(node);
    }
    std::sort(result->nodes_.begin(), result->nodes_.end(), [](const Node& a, const Node& b) { return a.t < b.t; });
    return result;
  }

 private:
  struct Node {
    double t;
    Point p, in, out;
  };
  double end(std::size_t i) const { return i + 1 < nodes_.size() ? nodes_[i + 1].t : nodes_[0].t + 1.0; }
  std::size_t piece(double t) const {
    std::size_t i = nodes_.size() - 1;
    while (i > 0 && nodes_[i].t > t) --i;
    return nodes_[i].t > t ? nodes_.size() - 1 : i;
  }
  Bezier bezier(std::size_t i) const {
    const Node& a = nodes_[i];
    const Node& b = nodes_[(i + 1) % nodes_.size()];
    const double way = end(i) - a.t;
    return {{a.p, a.p + way / 3.0 * a.out, b.p - way / 3.0 * b.in, b.p}, 3};
  }
  Point evaluate(double t) const {
    const double in = wrapped(t);
    const std::size_t i = piece(in);
    return fontcore::evaluate(bezier(i), (unwrapped(in, nodes_[i].t) - nodes_[i].t) / (end(i) - nodes_[i].t));
  }
  Point arriving(double t) const {
    for (const Node& node : nodes_) {
      if (node.t == wrapped(t)) return node.in;
    }
    return derivative(t);
  }
  Point derivative(double t) const {
    const double in = wrapped(t);
    const std::size_t i = piece(in);
    const double way = end(i) - nodes_[i].t;
    return fontcore::derivative(bezier(i), (unwrapped(in, nodes_[i].t) - nodes_[i].t) / way) / way;
  }

  std::vector<Node> nodes_;
};

}  // namespace

TEST_CASE("a form of one's own joins by sampling and splicing alone", "[linked]") {
  LinkedCurve curve = LinkedCurve(letter()).with_form(HermiteForm());
  CHECK(farthest_apart(curve.bezier(), curve.read<HermiteForm>()) < curve.epsilon());
  for (int step = 0; step < 20; ++step) {
    const double from = 0.37 * step - std::floor(0.37 * step);
    curve = curve.with_splice(bulged(curve, {from, wrapped(from + 0.1)}, {15.0 - step, 10.0}));
    CHECK(curve.stale<HermiteForm>().size() == 1);
    CHECK(farthest_apart(curve.bezier(), curve.read<HermiteForm>()) < curve.epsilon());
    CHECK(curve.stale<HermiteForm>().empty());
  }
  // And a tool may change it, for all the others to follow.
  const auto pushed = curve.read<HermiteForm>().splice(bulged(curve, {0.2, 0.3}, {20, 0}), 0.5 * curve.epsilon());
  curve = curve.with(dynamic_cast<const HermiteForm&>(*pushed), {{0.2, 0.3}});
  CHECK(farthest_apart(curve.read<HermiteForm>(), curve.bezier()) < curve.epsilon());
  CHECK(farthest_apart(curve.read<HermiteForm>(), curve.spline()) < curve.epsilon());
}

TEST_CASE("a thousand steps are undone bit for bit, in little memory", "[linked]") {
  Points points(1023, 2);
  std::vector<PointKind> kinds;
  for (int i = 0; i < 341; ++i) {
    const auto place = [](double a) { return Point((2000 + 30 * std::sin(40 * a)) * std::cos(a), 2000 * std::sin(a)); };
    const double step = 2.0 * std::numbers::pi / 341;
    for (int k = 0; k < 3; ++k) points.row(3 * i + k) = place((i + k / 3.0) * step);
    kinds.insert(kinds.end(), {PointKind::Node, PointKind::Cubic, PointKind::Cubic});
  }
  LinkedCurve curve(BezierContour(points, kinds), {.epsilon = 1.0});
  static_cast<void>(curve.polyline());
  std::mt19937 random(17);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  const auto fingerprint = [](const LinkedCurve& of) {
    double sum = 0.0;
    for (int i = 0; i < of.bezier().size(); ++i) {
      const auto piece = of.bezier().piece(i);
      for (const Point& p : piece.bezier.p) sum = 0.75 * sum + p.x() - 0.5 * p.y() + piece.t;
    }
    const Polyline line = of.polyline().whole();
    for (std::size_t i = 0; i < line.t.size(); ++i) {
      sum = 0.75 * sum + line.t[i] + line.points(static_cast<Eigen::Index>(i), 0);
    }
    return sum;
  };
  std::vector<LinkedCurve> history{curve};
  std::vector<double> fingerprints{fingerprint(curve)};
  std::size_t bytes = 0;
  for (int step = 0; step < 1000; ++step) {
    const double from = uniform(0, 1);
    LinkedCurve next = curve.with_splice(bulged(curve, {from, wrapped(from + 0.02)}, {uniform(-5, 5), uniform(-5, 5)}));
    fingerprints.push_back(fingerprint(next));
    bytes += next.bytes_beyond(curve);
    history.push_back(next);
    curve = next;
  }
  bool all_same = true;
  for (std::size_t i = history.size(); i-- > 0;) all_same = all_same && fingerprint(history[i]) == fingerprints[i];
  CHECK(all_same);
  INFO("bytes " << bytes);
  CHECK(bytes < (std::size_t{64} << 20));
  CHECK(history.front().bezier().contour() == BezierContour(points, kinds));
}

TEST_CASE("vertices, nodes and knots come, move and go one by one", "[linked]") {
  const LinkedCurve curve(letter());
  const LinkedPolyline& line = curve.polyline();
  const auto more = line.add_vertex(0.5 * (line.vertex(3).t + line.vertex(4).t), {123, 456});
  CHECK(more.form.size() == line.size() + 1);
  CHECK((more.form.evaluate(more.form.vertex(4).t) - Point(123, 456)).norm() == 0.0);
  CHECK(farthest_apart(more.form.remove_vertex(4).form, line) < 1e-9);
  const auto moved = line.move_vertex(7, {0, 0});
  CHECK(farthest_apart(moved.form, line, {moved.interval.to, moved.interval.from}) < 1e-9);
  CHECK(curve.with(moved).bezier().evaluate(line.vertex(7).t).norm() < curve.epsilon());
  CHECK_THROWS_AS(line.move_vertex(line.size(), {0, 0}), InvalidInput);
  CHECK_THROWS_AS(line.add_vertex(line.vertex(2).t, {0, 0}), InvalidInput);

  const LinkedBezier& bezier = curve.bezier();
  const auto cut = bezier.add_node(0.123);
  CHECK(cut.form.size() == bezier.size() + 1);
  CHECK(farthest_apart(cut.form, bezier) < 1e-9);
  CHECK(farthest_apart(cut.form.remove_node(cut.form.piece_at(0.123)).form, bezier) < 1e-6);
  const auto dragged = bezier.move_control_point(5, 1, {300, 300});
  CHECK(farthest_apart(dragged.form, bezier, {dragged.interval.to, dragged.interval.from}) < 1e-9);
  CHECK(farthest_apart(curve.with(dragged).polyline(), dragged.form) < curve.epsilon());

  for (const int degree : {1, 2, 3, 4, 5}) {
    const LinkedCurve of(letter(), {.spline_degree = degree});
    const LinkedSpline& spline = of.spline();
    CHECK(spline.degree() == degree);
    CHECK(farthest_apart(spline, of.bezier()) < of.epsilon());
    const LinkedSpline finer = spline.insert_knot(0.3217);
    CHECK(finer.size() == spline.size() + 1);
    CHECK(farthest_apart(finer, spline) < 1e-6);
    const auto without = finer.remove_knot(finer.knot_at(0.3217));
    CHECK(without.form.size() == spline.size());
    CHECK(farthest_apart(without.form, spline) < 2e-3);
    const auto pulled = spline.move_control_point(9, {0, 0});
    CHECK(farthest_apart(pulled.form, spline, {pulled.interval.to, pulled.interval.from}) < 1e-9);
    // It is the curve that nonuniform evaluates.
    for (double t = 0.0; t < 1.0; t += 0.0371) {
      const double in = spline.knot(0) + t < 1.0 ? spline.knot(0) + t : t;
      CHECK((spline.evaluate(in) - evaluate(spline.knots(), spline.control_points(), in).transpose()).norm() < 1e-9);
    }
  }
}

TEST_CASE("a constrained fit of a spline meets what is required and is nearest in what is left", "[linked]") {
  const LinkedCurve curve(shapes::circle(300));
  const LinkedSpline& spline = curve.spline();
  const SampledSplice samples = bulged(curve, {0.2, 0.5}, {10, 10});
  const std::vector<LinkedSpline::Requirement> required{
      {0.3, 0, Side::Right, {-120, 310}}, {0.35, 1, Side::Right, {-900, -1500}}, {0.4, 0, Side::Right, {-260, 190}}};
  LinkedSpline fine = spline;
  for (double t = 0.205; t < 0.5; t += 0.01) fine = fine.insert_knot(t);
  const auto fitted = fine.fitted(samples, required);
  for (const auto& one : required) {
    CHECK((fitted.form.evaluate(one.t, one.derivative) - one.value).norm() < 1e-7);
  }
  CHECK(farthest_apart(fitted.form, fine, {0.5, 0.2}) < 1e-9);
  CHECK_THROWS_AS(fine.fitted(samples, {{0.3, 0, Side::Right, {0, 0}}, {0.3, 0, Side::Right, {1, 0}}}),
                  UnsatisfiableConstraints);
}

TEST_CASE("a wavelet form is fine only where it must be, and remembers how it runs over t", "[linked]") {
  LinkedCurve curve(shapes::circle(300), {.epsilon = 0.5});
  const LinkedWavelet smooth = curve.wavelet();
  SampledSplice wiggle = curve.sample({0.4, 0.45});
  const SampledSplice before = wiggle;
  wiggle.samples.clear();
  for (int k = 0; k <= 200; ++k) {
    const double t = k == 200 ? before.samples.back().t : before.samples.front().t + 0.05 * k / 200;
    wiggle.samples.push_back({t, before.at(t) + Point(0, 10.0 * std::sin(std::numbers::pi * k / 20.0))});
  }
  curve = curve.with_splice(wiggle);
  const LinkedWavelet& rough = curve.wavelet();
  CHECK(rough.finest_level_at(0.42) > smooth.finest_level_at(0.42) + 1);
  CHECK(rough.finest_level_at(0.9) == smooth.finest_level_at(0.9));
  CHECK(rough.stored() < smooth.stored() + 400);
  for (double t = 0.46; t < 1.39; t += 0.01) CHECK(same_bits(rough.evaluate(t), smooth.evaluate(t)));
  // Even over arc length within the splice: twice the way on it takes twice the spans.
  const auto way = [&](double from, double to) {
    double sum = 0.0;
    const SampledSplice run = rough.sample({from, to}, 1e-3);
    for (std::size_t i = 1; i < run.samples.size(); ++i) sum += (run.samples[i].p - run.samples[i - 1].p).norm();
    return sum / (rough.parameter(to, 5) - rough.parameter(from, 5));
  };
  CHECK(way(0.405, 0.42) == Approx(way(0.425, 0.445)).epsilon(0.05));
  for (const double t : {0.1, 0.41, 0.77}) {
    CHECK(rough.t_of(0, rough.parameter(t, 4), 4) == Approx(t).margin(1e-9));
  }
  // Its control points of a level are those of the dense curve.
  const int level = rough.finest_level(0);
  const Points dense = rough.control_points(0, level, 0, rough.size(level));
  for (const double t : {0.05, 0.43, 0.8}) {
    const Point p = evaluate(rough.scheme(), dense, rough.parameter(t, level)).transpose();
    CHECK((p - rough.evaluate(t)).norm() < 1e-9);
  }
  const MultiresCurve coefficients = rough.multires(0, level);
  CHECK((reconstruct(coefficients) - dense).norm() < 1e-8);
}

TEST_CASE("a pull of a wavelet moves its point by the move, and a shorter stretch on a finer level", "[linked]") {
  for (const bool is_arcwise : {false, true}) {
    const LinkedCurve curve(letter());
    const LinkedWavelet& wavelet = is_arcwise ? curve.arcwise() : curve.wavelet();
    const double t = 0.4321;
    double last = 2.0;
    for (const double level : {0.0, 1.0, 1.5, 2.0, 3.25, 5.0}) {
      const auto pulled = wavelet.pull(t, level, {30, -20});
      CHECK((pulled.form.evaluate(t) - wavelet.evaluate(t) - Point(30, -20)).norm() < 1e-9);
      CHECK(length(pulled.interval) <= last);
      last = length(pulled.interval);
      const Interval outside{pulled.interval.to, pulled.interval.from};
      if (last < 0.9) CHECK(farthest_apart(pulled.form, wavelet, outside) < 1e-9);
    }
    const double wide = wavelet.level_of_breadth(t, 400);
    CHECK(wide < wavelet.level_of_breadth(t, 100));
  }
}
