// Time of an edit's last two stages, on letters and figures of bundled fonts: the refit of the outline's own points to
// a sweep, and its rounding. One pass over the font is one iteration; the counters are the mean of a contour and a
// glyph.

#include <benchmark/benchmark.h>

#include <string>
#include <utility>
#include <vector>

#include "fontcore/edit.h"
#include "fontcore/fit.h"
#include "fontcore/rounding.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"

namespace {

using namespace fontcore;

constexpr double move = 0.02;    // of the em
constexpr double breadth = 0.4;  // of the em

// A sweep of one contour: its leftmost stretch at half its height, outwards.
struct Swept {
  OutlineCurve curve;
  StructureEdit edit;
  std::size_t glyph;
};

std::vector<Swept> swept_contours(const std::string& path) {
  const glyphs::Font font = glyphs::load_font(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + path);
  const double em = font.units_per_em;
  const std::vector<double> zones = glyphs::alignment_zones(font);
  std::vector<Swept> all;
  std::size_t glyph_count = 0;
  for (const auto& [first, last] : {std::pair{U'a', U'z'}, std::pair{U'A', U'Z'}, std::pair{U'0', U'9'}}) {
    for (char32_t letter = first; letter <= last; ++letter) {
      const glyphs::Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.character_map.at(letter))];
      if (glyph.is_composite()) continue;
      for (const BezierContour& contour : glyph.contours) {
        if (!has_inside(contour)) continue;
        const OutlineCurve curve(contour, {.tolerance = glyphs::model_tolerance * em});
        const Box box = tight_box(contour);
        const auto at = nearest_point(contour, Point(box.low.x(), 0.5 * (box.low.y() + box.high.y())));
        StructureEdit edit;
        edit.handles = {{{at.segment, at.u}, Point(-move * em, 0.25 * move * em)}};
        edit.breadth = breadth * em;
        const Sweep sweep =
            fontcore::sweep(curve, curve.parameter(at.segment, at.u), edit.handles[0].move, edit.breadth);
        edit.field = respect_corners(curve, sweep.field);
        edit.rules.zones = zones;
        edit.area = signed_area(contour);
        all.push_back({curve, edit, glyph_count});
      }
      ++glyph_count;
    }
  }
  return all;
}

void count(benchmark::State& state, const std::vector<Swept>& contours) {
  const auto mean = [&](std::size_t of) {
    return benchmark::Counter(static_cast<double>(of),
                              benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  };
  state.counters["contour"] = mean(contours.size());
  state.counters["glyph"] = mean(contours.back().glyph + 1);
}

void refit(benchmark::State& state, const char* path) {
  const std::vector<Swept> contours = swept_contours(path);
  for (auto _ : state) {
    for (const Swept& swept : contours) benchmark::DoNotOptimize(refit_structure(swept.curve, swept.edit));
  }
  count(state, contours);
}

// Contours of a glyph are rounded together.
void round(benchmark::State& state, const char* path) {
  const std::vector<Swept> contours = swept_contours(path);
  std::vector<std::vector<Unrounded>> glyphs;
  for (const auto& [curve, edit, glyph] : contours) {
    glyphs.resize(glyph + 1);
    const double scale = std::abs(*edit.area);
    glyphs[glyph].push_back({refit_structure(curve, edit).contour,
                             curve.contour(),
                             edit.rules,
                             {.area = *edit.area, .scale = scale, .handles = {edit.handles[0].at}}});
  }
  for (auto _ : state) {
    for (const std::vector<Unrounded>& glyph : glyphs) benchmark::DoNotOptimize(round_keeping_area(glyph));
  }
  count(state, contours);
}

BENCHMARK_CAPTURE(refit, liberation_serif, "liberation-serif/LiberationSerif-Regular.ttf")
    ->Name("refit_structure/LiberationSerif")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(refit, eb_garamond, "eb-garamond/EBGaramond12-Regular.otf")
    ->Name("refit_structure/EBGaramond12")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(round, liberation_serif, "liberation-serif/LiberationSerif-Regular.ttf")
    ->Name("round_keeping_area/LiberationSerif")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(round, eb_garamond, "eb-garamond/EBGaramond12-Regular.otf")
    ->Name("round_keeping_area/EBGaramond12")
    ->Unit(benchmark::kMillisecond);

}  // namespace
