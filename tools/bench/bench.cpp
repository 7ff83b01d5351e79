// Time per curve of the wavelet filters, 2-D doubles, beside one memcpy of the same data; of one move of a drag; and
// per glyph of the crossing check, the ink and the compact fit, over the bundled fonts and any others named.
//
//     glyphwave_bench [--benchmark_filter=find_crossings ...] [FONT ...]
//
// Refit and rounding are in edit_bench.cpp, gestures in brush_bench.cpp.

#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <limits>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "fontcore/arcwise.h"
#include "fontcore/compact.h"
#include "fontcore/crossing.h"
#include "fontcore/drag.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/wavelet.h"
#include "glyphs/font_file.h"
#include "tests/textured.h"

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

using Outlines = std::vector<std::vector<fontcore::BezierContour>>;

// Of large fonts evenly chosen ones.
Outlines outlines_of(const std::string& path) {
  constexpr std::size_t most_glyphs = 2000;
  const glyphs::Font font = glyphs::load_font(path);
  const std::size_t step = (font.glyphs.size() + most_glyphs - 1) / most_glyphs;
  Outlines outlines;
  for (std::size_t glyph = 0; glyph < font.glyphs.size(); glyph += step) {
    try {
      outlines.push_back(glyphs::compose(font, static_cast<int>(glyph)));
    } catch (const fontcore::Error&) {
      continue;  // a glyph in trouble has no outline
    }
    if (outlines.back().empty()) outlines.pop_back();
  }
  return outlines;
}

// Mean per glyph; and the 99th percentile of the glyphs' own times, each the least of five.
template <typename Work>
void per_glyph(benchmark::State& state, const Outlines& outlines, const Work& work) {
  if (outlines.empty()) {
    state.SkipWithError("no glyph has an outline");
    return;
  }
  for (auto _ : state)
    for (const auto& contours : outlines) work(contours);
  std::vector<double> seconds;
  for (const auto& contours : outlines) {
    double least = std::numeric_limits<double>::infinity();
    for (int run = 0; run < 5; ++run) {
      const auto begin = std::chrono::steady_clock::now();
      work(contours);
      least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    seconds.push_back(least);
  }
  std::sort(seconds.begin(), seconds.end());
  state.counters["glyphs"] = static_cast<double>(outlines.size());
  state.counters["mean"] =
      benchmark::Counter(static_cast<double>(outlines.size()),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["p99"] = seconds[seconds.size() * 99 / 100];
}

void register_fonts(std::vector<std::string> fonts) {
  for (const char* name :
       {"cabin/Cabin-Regular.otf", "eb-garamond/EBGaramond12-Bold.otf", "eb-garamond/EBGaramond12-Regular.otf",
        "liberation-serif/LiberationSerif-Regular.ttf", "open-sans/OpenSans-Regular.ttf"})
    fonts.push_back(std::string(GLYPHWAVE_SOURCE_DIR "/fonts/") + name);
  for (const std::string& path : fonts) {
    const std::string name = path.substr(path.find_last_of('/') + 1);
    // Read when first asked for: a filter may leave it out.
    const auto outlines = [path, kept = std::make_shared<Outlines>()]() -> const Outlines& {
      if (kept->empty()) *kept = outlines_of(path);
      return *kept;
    };
    benchmark::RegisterBenchmark(("find_crossings/" + name).c_str(), [outlines](benchmark::State& state) {
      per_glyph(state, outlines(),
                [](const auto& contours) { benchmark::DoNotOptimize(fontcore::find_crossings(contours)); });
    });
    benchmark::RegisterBenchmark(("measure_ink/" + name).c_str(), [outlines](benchmark::State& state) {
      per_glyph(state, outlines(),
                [](const auto& contours) { benchmark::DoNotOptimize(fontcore::measure_ink(contours)); });
    });
  }
}

void drag_sizes(benchmark::internal::Benchmark* bench) { bench->RangeMultiplier(2)->Range(64, 4096); }
void sizes(benchmark::internal::Benchmark* bench) { bench->RangeMultiplier(2)->Range(fewest_points, most_points); }

// The contours of a-z A-Z 0-9.
struct Letters {
  std::vector<fontcore::BezierContour> contours;
  int count = 0;
  double units_per_em = 0.0;
};
Letters letters_of(const std::string& name) {
  const glyphs::Font font = glyphs::load_font(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name);
  Letters letters{.units_per_em = static_cast<double>(font.units_per_em)};
  for (char32_t c = U'0'; c <= U'z'; ++c) {
    const bool is_meant = c <= U'9' || (c >= U'A' && c <= U'Z') || c >= U'a';
    const auto found = font.character_map.find(c);
    if (!is_meant || found == font.character_map.end()) continue;
    const auto own = glyphs::compose(font, found->second);
    letters.contours.insert(letters.contours.end(), own.begin(), own.end());
    ++letters.count;
  }
  return letters;
}

void report(benchmark::State& state, const Letters& letters, std::size_t segments) {
  state.counters["glyph"] =
      benchmark::Counter(letters.count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["segments"] = static_cast<double>(segments);
}

// At 1/1000 em as cubics: seconds a glyph, and segments in sum.
void fit_font(benchmark::State& state, const std::string& name, fontcore::Extrema extrema) {
  const Letters letters = letters_of(name);
  fontcore::CompactOptions options;
  options.tolerance = letters.units_per_em / 1000.0;
  options.units_per_em = letters.units_per_em;
  options.extrema = extrema;
  std::size_t segments = 0;
  for (auto _ : state) {
    segments = 0;
    for (const auto& contour : letters.contours)
      segments += static_cast<std::size_t>(fit_compact(contour, options).contour.segment_count());
  }
  report(state, letters, segments);
}

// Texture laid along some letters, within half a unit: milliseconds a thousand units of outline, and segments in sum.
void fit_textured(benchmark::State& state, fontcore::Extrema extrema, fontcore::Coordinates coordinates) {
  std::vector<fontcore::BezierContour> contours;
  double length = 0.0;
  const auto font = glyphs::load_font(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/cabin/Cabin-Regular.otf");
  for (const char32_t letter : {U'o', U'S', U'M', U'.', U'&'}) {
    for (const auto& own : glyphs::compose(font, font.character_map.at(letter))) {
      contours.push_back(textured::contour(own, {}));
      length += fontcore::length(contours.back());
    }
  }
  const fontcore::CompactOptions options{.tolerance = 0.5, .extrema = extrema, .coordinates = coordinates};
  std::size_t segments = 0;
  for (auto _ : state) {
    segments = 0;
    for (const auto& contour : contours)
      segments += static_cast<std::size_t>(fit_compact(contour, options).contour.segment_count());
  }
  state.counters["thousand_units"] =
      benchmark::Counter(length / 1000.0, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["segments"] = static_cast<double>(segments);
}

// What there was before, [FS94] scan conversion: spans of every arc's levels within the same distance.
void compress_font(benchmark::State& state, const std::string& name) {
  const Letters letters = letters_of(name);
  const double tolerance = letters.units_per_em / 1000.0;
  constexpr double of_the_arcs = 0.25;  // of the tolerance: their own distance from the outline
  std::size_t segments = 0;
  for (auto _ : state) {
    segments = 0;
    for (const auto& contour : letters.contours) {
      const fontcore::OutlineArcs outline(contour);
      for (const auto& arc : fit_arcs(outline, {.tolerance = of_the_arcs * tolerance})) {
        const auto curve = decompose(arc.scheme, arc.points, arc.levels);
        segments += arc.is_line ? 1 : compress(curve, (1.0 - of_the_arcs) * tolerance).pieces.size();
      }
    }
  }
  report(state, letters, segments);
}

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
BENCHMARK_CAPTURE(compress_font, cabin, "cabin/Cabin-Regular.otf")
    ->Name("compress/Cabin-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, cabin, "cabin/Cabin-Regular.otf", fontcore::Extrema::Keep)
    ->Name("fit_compact/Cabin-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, cabin_free, "cabin/Cabin-Regular.otf", fontcore::Extrema::Free)
    ->Name("fit_compact/Cabin-Regular/free")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(compress_font, eb_garamond, "eb-garamond/EBGaramond12-Regular.otf")
    ->Name("compress/EBGaramond12-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, eb_garamond, "eb-garamond/EBGaramond12-Regular.otf", fontcore::Extrema::Keep)
    ->Name("fit_compact/EBGaramond12-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, eb_garamond_free, "eb-garamond/EBGaramond12-Regular.otf", fontcore::Extrema::Free)
    ->Name("fit_compact/EBGaramond12-Regular/free")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(compress_font, liberation_serif, "liberation-serif/LiberationSerif-Regular.ttf")
    ->Name("compress/LiberationSerif-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, liberation_serif, "liberation-serif/LiberationSerif-Regular.ttf", fontcore::Extrema::Keep)
    ->Name("fit_compact/LiberationSerif-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, liberation_serif_free, "liberation-serif/LiberationSerif-Regular.ttf",
                  fontcore::Extrema::Free)
    ->Name("fit_compact/LiberationSerif-Regular/free")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(compress_font, open_sans, "open-sans/OpenSans-Regular.ttf")
    ->Name("compress/OpenSans-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, open_sans, "open-sans/OpenSans-Regular.ttf", fontcore::Extrema::Keep)
    ->Name("fit_compact/OpenSans-Regular")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_font, open_sans_free, "open-sans/OpenSans-Regular.ttf", fontcore::Extrema::Free)
    ->Name("fit_compact/OpenSans-Regular/free")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_textured, keep, fontcore::Extrema::Keep, fontcore::Coordinates::Any)
    ->Name("fit_compact/textured")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_textured, free, fontcore::Extrema::Free, fontcore::Coordinates::Any)
    ->Name("fit_compact/textured/free")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fit_textured, whole, fontcore::Extrema::Free, fontcore::Coordinates::Whole)
    ->Name("fit_compact/textured/free/whole")
    ->Unit(benchmark::kMillisecond);

}  // namespace

int main(int argc, char** argv) {
  // Memory once used is kept, so that filters are measured and not the system handing out fresh pages.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  benchmark::Initialize(&argc, argv);
  const std::vector<std::string> fonts(argv + 1, argv + argc);
  if (std::any_of(fonts.begin(), fonts.end(), [](const std::string& one) { return one.starts_with("-"); })) {
    benchmark::ReportUnrecognizedArguments(argc, argv);
    return 1;
  }
  register_fonts(fonts);
  try {
    benchmark::RunSpecifiedBenchmarks();
  } catch (const fontcore::Error& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
