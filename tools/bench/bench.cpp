// Time per curve of the wavelet filters, 2-D doubles, beside one memcpy of the same data; and of one move of a drag.

#include <benchmark/benchmark.h>
#include <malloc.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <span>

#include "fontcore/drag.h"
#include "fontcore/wavelet.h"

namespace {

using fontcore::Coefficients;
using fontcore::Scheme;

constexpr int fewest_points = 1 << 10;
constexpr int most_points = 1 << 20;

// Numbers at a cache line's start.
struct Free {
  void operator()(double* memory) const { std::free(memory); }
};
using Buffer = std::unique_ptr<double[], Free>;
Buffer aligned_buffer(std::size_t count) {
  constexpr std::size_t line = 64;
  Buffer buffer(static_cast<double*>(std::aligned_alloc(line, (count * sizeof(double) + line - 1) / line * line)));
  for (std::size_t i = 0; i < count; ++i) buffer[i] = std::sin(0.01 * static_cast<double>(i));
  return buffer;
}

Coefficients wavy_points(Eigen::Index count) {
  Coefficients points(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double a = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(count);
    points.row(i) << 700.0 * std::cos(a) + 9.0 * std::cos(50.0 * a), 500.0 * std::sin(a) + 4.0 * std::sin(90.0 * a);
  }
  return points;
}

// N spans: as many control points, for open arcs `degree` more.
Eigen::Index points_of_spans(Scheme scheme, std::int64_t spans) {
  return fontcore::is_closed(scheme) ? spans : spans + fontcore::degree(scheme);
}

void copy(benchmark::State& state) {
  const auto numbers = static_cast<std::size_t>(2 * state.range(0));
  const Buffer from = aligned_buffer(numbers);
  const Buffer to = aligned_buffer(numbers);
  for (auto _ : state) {
    std::memcpy(to.get(), from.get(), numbers * sizeof(double));
    benchmark::ClobberMemory();
  }
}

void chaikin_analyze(benchmark::State& state) {
  const auto numbers = static_cast<std::size_t>(2 * state.range(0));
  const int levels = fontcore::most_levels(Scheme::Chaikin, state.range(0));
  const Buffer fine = aligned_buffer(numbers);
  const Buffer out = aligned_buffer(numbers);
  const Buffer scratch = aligned_buffer(numbers);
  for (auto _ : state) {
    fontcore::chaikin::analyze_into({fine.get(), numbers}, levels, {out.get(), numbers}, {scratch.get(), numbers});
    benchmark::ClobberMemory();
  }
}

void chaikin_synthesize(benchmark::State& state) {
  const auto numbers = static_cast<std::size_t>(2 * state.range(0));
  const int levels = fontcore::most_levels(Scheme::Chaikin, state.range(0));
  const Buffer coefficients = aligned_buffer(numbers);
  const Buffer fine = aligned_buffer(numbers);
  const Buffer scratch = aligned_buffer(numbers);
  for (auto _ : state) {
    fontcore::chaikin::synthesize_into({coefficients.get(), numbers}, levels, {fine.get(), numbers},
                                       {scratch.get(), numbers});
    benchmark::ClobberMemory();
  }
}

void analyze(benchmark::State& state, Scheme scheme) {
  const Coefficients fine = wavy_points(points_of_spans(scheme, state.range(0)));
  const int levels = fontcore::most_levels(scheme, fine.rows());
  for (auto _ : state) benchmark::DoNotOptimize(fontcore::decompose(scheme, fine, levels));
}

void synthesize(benchmark::State& state, Scheme scheme) {
  const Coefficients fine = wavy_points(points_of_spans(scheme, state.range(0)));
  const auto curve = fontcore::decompose(scheme, fine, fontcore::most_levels(scheme, fine.rows()));
  for (auto _ : state) benchmark::DoNotOptimize(fontcore::reconstruct(curve));
}

// A wavy spline of N points with eight corners, a quarter of it frozen, dragged opposite of that at the level that
// moves a quarter; with or without the length.
fontcore::DragSolver begin_drag(int count, bool keep_length) {
  constexpr int corners = 8;
  constexpr double moved_spans = 5.0;  // three neighbouring basis functions, each three spans wide
  fontcore::Points points = wavy_points(count);
  fontcore::Rows rows;
  for (int k = 0; k < corners; ++k) {
    const int i = (2 * k + 1) * count / (2 * corners);
    points.row(i + 1) = points.row(i);
    for (fontcore::Row& row : fontcore::rows(fontcore::CornerPair{i, count})) rows.push_back(std::move(row));
  }
  for (int i = count / 2; i < count * 3 / 4; ++i) {
    for (int axis = 0; axis < 2; ++axis) rows.push_back({"frozen", {{2 * i + axis, 1.0}}, 0.0});
  }
  const double level = std::log2(moved_spans * 4.0 / fontcore::fewest(Scheme::Chaikin));
  fontcore::DragOptions options{.level = level};
  if (keep_length) options.length = fontcore::KeptValue{};
  return {points, {{.t = 0.13 * count}}, options, rows};
}

void drag(benchmark::State& state, bool keep_length) {
  fontcore::DragSolver solver = begin_drag(static_cast<int>(state.range(0)), keep_length);
  double angle = 0.0;
  double passes = 0.0;
  for (auto _ : state) {
    angle += 0.1;
    const std::array delta = {fontcore::Point(40.0 * std::cos(angle), 25.0 * std::sin(angle))};
    passes += solver.move(delta).passes;
    benchmark::DoNotOptimize(solver.control_points().data());
  }
  state.counters["passes"] = passes / static_cast<double>(state.iterations());
}

void drag_begin(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(begin_drag(static_cast<int>(state.range(0)), false));
}

void drag_sizes(benchmark::internal::Benchmark* bench) { bench->RangeMultiplier(2)->Range(64, 4096); }
void sizes(benchmark::internal::Benchmark* bench) { bench->RangeMultiplier(2)->Range(fewest_points, most_points); }

BENCHMARK(copy)->Name("memcpy")->Apply(sizes);
BENCHMARK(chaikin_analyze)->Apply(sizes);
BENCHMARK(chaikin_synthesize)->Apply(sizes);
// Chaikin's scheme by the same interface as the others, beside its buffers above.
BENCHMARK_CAPTURE(analyze, chaikin, Scheme::Chaikin)->Name("chaikin_decompose")->Apply(sizes);
BENCHMARK_CAPTURE(synthesize, chaikin, Scheme::Chaikin)->Name("chaikin_reconstruct")->Apply(sizes);
BENCHMARK_CAPTURE(analyze, orthogonal, Scheme::Orthogonal)->Name("orthogonal_analyze")->Apply(sizes);
BENCHMARK_CAPTURE(synthesize, orthogonal, Scheme::Orthogonal)->Name("orthogonal_synthesize")->Apply(sizes);
BENCHMARK_CAPTURE(analyze, quadratic, Scheme::EndpointQuadratic)->Name("endpoint_quadratic_analyze")->Apply(sizes);
BENCHMARK_CAPTURE(synthesize, quadratic, Scheme::EndpointQuadratic)
    ->Name("endpoint_quadratic_synthesize")
    ->Apply(sizes);
BENCHMARK_CAPTURE(analyze, cubic, Scheme::EndpointCubic)->Name("endpoint_cubic_analyze")->Apply(sizes);
BENCHMARK_CAPTURE(synthesize, cubic, Scheme::EndpointCubic)->Name("endpoint_cubic_synthesize")->Apply(sizes);
BENCHMARK_CAPTURE(analyze, held, Scheme::HeldCubic)->Name("held_cubic_analyze")->Apply(sizes);
BENCHMARK_CAPTURE(synthesize, held, Scheme::HeldCubic)->Name("held_cubic_synthesize")->Apply(sizes);
BENCHMARK_CAPTURE(drag, area, false)->Name("drag")->Apply(drag_sizes);
BENCHMARK_CAPTURE(drag, length, true)->Name("drag_length")->Apply(drag_sizes);
BENCHMARK(drag_begin)->Apply(drag_sizes);

}  // namespace

int main(int argc, char** argv) {
  // Memory once used is kept, so that filters are measured and not the system handing out fresh pages.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
