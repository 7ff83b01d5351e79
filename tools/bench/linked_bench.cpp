// One step of a gesture on a linked curve of N points, and all that must follow before it is shown: a stretch of 24
// points changes, the rules are looked at, and the Bezier form is brought up to date. The outline grows with N, the
// stretch does not.
//
//     glyphwave_bench --benchmark_filter=linked

#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "fontcore/linked_curve.h"
#include "fontcore/measure.h"

namespace {

using fontcore::Interval;
using fontcore::LinkedCurve;
using fontcore::LinkedPolyline;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using fontcore::SampledSplice;

/// A wavy ring of cubics, eight to a wave, of `count` points.
fontcore::BezierContour ring(int count) {
  const int segments = count / 3;
  const double radius = 16.0 * segments / (2.0 * std::numbers::pi);
  const double waves = segments / 8;
  const auto place = [&](double a) {
    const double r = radius + 12.0 * std::sin(waves * a);
    return Point(r * std::cos(a), r * std::sin(a));
  };
  const auto slope = [&](double a) {
    const double r = radius + 12.0 * std::sin(waves * a);
    const double dr = 12.0 * waves * std::cos(waves * a);
    return Point(dr * std::cos(a) - r * std::sin(a), dr * std::sin(a) + r * std::cos(a));
  };
  const double step = 2.0 * std::numbers::pi / segments;
  Points points(3 * segments, 2);
  std::vector<PointKind> kinds;
  for (int s = 0; s < segments; ++s) {
    const double a = s * step;
    points.row(3 * s) = place(a);
    points.row(3 * s + 1) = place(a) + step / 3.0 * slope(a);
    points.row(3 * s + 2) = place(a + step) - step / 3.0 * slope(a + step);
    kinds.insert(kinds.end(), {PointKind::Node, PointKind::Cubic, PointKind::Cubic});
  }
  return {std::move(points), std::move(kinds)};
}

/// The stretch pushed to one side; how far swings from step to step.
SampledSplice pushed(const LinkedCurve& curve, const Interval& stretch, int step) {
  SampledSplice splice = curve.sample(stretch);
  const double height = 6.0 * std::sin(0.3 * step);
  const double from = splice.samples.front().t;
  const double way = splice.samples.back().t - from;
  for (fontcore::Sample& sample : splice.samples) {
    const double x = 2.0 * (sample.t - from) / way - 1.0;
    sample.p += (1.0 - x * x) * (1.0 - x * x) * Point(height, 0.5 * height);
  }
  return splice;
}

enum class Rules { None, All };

void linked_resync(benchmark::State& state, Rules rules) {
  const auto count = static_cast<int>(state.range(0));
  const fontcore::BezierContour contour = ring(count);
  LinkedCurve start(contour);
  if (rules == Rules::All) {
    start = start.with_rule({"area", fontcore::HeldArea{fontcore::signed_area(contour)}})
                .with_rule({"simple", fontcore::NoAddedCrossing{}});
  }
  static_cast<void>(start.polyline());
  const double way = 24.0 / count;
  const Interval stretch{0.3, 0.3 + way};
  LinkedCurve curve = start;
  int step = 0;
  for (auto _ : state) {
    // As a tool on the polyline does it.
    const auto pushed_line = curve.polyline().splice(pushed(curve, stretch, step++), 0.5 * curve.epsilon());
    curve = curve.with(dynamic_cast<const LinkedPolyline&>(*pushed_line), {stretch});
    benchmark::DoNotOptimize(curve.bezier().size());
    if (step % 32 == 0) curve = start;
  }
}

void linked_sizes(benchmark::internal::Benchmark* bench) {
  bench->Arg(256)->Arg(1024)->Arg(4096)->Unit(benchmark::kMicrosecond);
}

}  // namespace

BENCHMARK_CAPTURE(linked_resync, plain, Rules::None)->Name("linked_resync")->Apply(linked_sizes);
BENCHMARK_CAPTURE(linked_resync, rules, Rules::All)->Name("linked_resync_rules")->Apply(linked_sizes);
