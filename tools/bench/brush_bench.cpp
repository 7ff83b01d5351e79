// One step of a gesture on a curve of N cubics, 30 units each, with the displayed Bezier form brought up to date: the
// stretch that is touched is the same for every N.

#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "fontcore/brush.h"

namespace {

using namespace fontcore;

constexpr double spacing = 30.0;
constexpr int steps = 32;  // of a gesture, which then begins anew

Points points_of(const std::vector<Point>& list) {
  Points points(static_cast<Eigen::Index>(list.size()), 2);
  for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i];
  return points;
}

/// A wavy ring; its first node is on the x axis.
BezierContour ring(std::int64_t nodes) {
  const double radius = spacing * static_cast<double>(nodes) / (2.0 * std::numbers::pi);
  const double waves = static_cast<double>(nodes) / 16.0;
  const auto place = [&](double node) {
    const double a = 2.0 * std::numbers::pi * node / static_cast<double>(nodes);
    return Point((radius + 12.0 * std::sin(waves * a)) * Point(std::cos(a), std::sin(a)));
  };
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  for (std::int64_t i = 0; i < nodes; ++i) {
    const auto at = static_cast<double>(i);
    points.push_back(place(at));
    points.push_back(place(at) + (place(at + 1.0) - place(at - 1.0)) / 6.0);
    points.push_back(place(at + 1.0) - (place(at + 2.0) - place(at)) / 6.0);
    kinds.insert(kinds.end(), {PointKind::Node, PointKind::Cubic, PointKind::Cubic});
  }
  return {points_of(points), kinds};
}

/// With all forms up to date, as in an editor that shows them.
LinkedCurve curve_of(std::int64_t nodes) {
  LinkedCurve curve(ring(nodes), {.epsilon = 0.5});
  curve.polyline();
  curve.spline();
  curve.wavelet();
  return curve;
}

void spatula(benchmark::State& state) {
  const LinkedCurve start = curve_of(state.range(0));
  const Point place = start.bezier().evaluate(0.0);
  const Tip tip(Circle{40.0});
  LinkedCurve curve = start;
  int step = 0;
  for (auto _ : state) {
    if (step == steps) {
      curve = start;
      step = 0;
    }
    const double way = 2.0 * step++ - 60.0;
    curve = push(curve, tip, points_of({place + Point(way, 0.0), place + Point(way + 2.0, 0.0)}));
    benchmark::DoNotOptimize(curve.bezier().size());
  }
}

void sketch(benchmark::State& state) {
  const LinkedCurve start = curve_of(state.range(0));
  const auto nodes = static_cast<double>(state.range(0));
  std::vector<Points> strokes;
  for (int step = 0; step < steps; ++step) {
    std::vector<Point> drawn;
    for (int i = 0; i <= 60; ++i) {
      const double x = i / 60.0;
      const Point on = start.polyline().evaluate((2.0 + 10.0 * x) / nodes);
      drawn.push_back(on + (20.0 + step) * std::sin(std::numbers::pi * x) * Point(1.0, 0.2));
    }
    strokes.push_back(points_of(drawn));
  }
  std::size_t step = 0;
  for (auto _ : state) {
    const LinkedCurve curve = sketch_over(start, {strokes[step++ % steps]});
    benchmark::DoNotOptimize(curve.bezier().size());
  }
}

void corner(benchmark::State& state) {
  const double control = 5.0 / static_cast<double>(state.range(0));
  const LinkedCurve start = make_corner(curve_of(state.range(0)), 2.0 * control, control);
  const CornerHandle handle = corner_handles(start).front();
  LinkedCurve curve = start;
  int step = 0;
  for (auto _ : state) {
    if (step == steps) {
      curve = start;
      step = 0;
    }
    curve = move_corner(curve, handle.name, handle.corner.p + 2.0 * ++step * Point(1.0, 0.3));
    benchmark::DoNotOptimize(curve.bezier().size());
  }
}

void direct(benchmark::State& state) {
  const LinkedCurve start = curve_of(state.range(0));
  const double t = 10.0 / static_cast<double>(state.range(0));
  int step = 0;
  for (auto _ : state) {
    step = step % steps + 1;
    const LinkedCurve curve = pull(start, t, step * Point(1.5, 0.5), 400.0);
    benchmark::DoNotOptimize(curve.bezier().size());
  }
}

void sizes(benchmark::internal::Benchmark* one) {
  for (const std::int64_t nodes : {256, 1024, 4096}) one->Arg(nodes);
  one->Unit(benchmark::kMicrosecond);
}
BENCHMARK(spatula)->Apply(sizes);
BENCHMARK(sketch)->Apply(sizes);
BENCHMARK(corner)->Apply(sizes);
BENCHMARK(direct)->Apply(sizes);

}  // namespace
