#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "fontcore/linked_curve.h"
#include "fontcore/measure.h"
#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace fontcore;

namespace {

double farthest_apart(const Representation& a, const Representation& b, double accuracy) {
  const SampledSplice x = a.sample(whole_curve, accuracy);
  const SampledSplice y = b.sample(whole_curve, accuracy);
  double largest = 0.0;
  for (const SampledSplice* run : {&x, &y}) {
    for (const Sample& sample : run->samples) largest = std::max(largest, (x.at(sample.t) - y.at(sample.t)).norm());
  }
  return largest;
}

}  // namespace

TEST_CASE("letters of the bundled fonts are linked curves: forms within epsilon, untouched segments the font's",
          "[linked]") {
  std::mt19937 random(23);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  for (const std::string& path : bundled_fonts_for_long_work()) {
    const glyphs::Font font = glyphs::load_font(path);
    const double epsilon = font.units_per_em / 1000.0;
    for (const char c : std::string("agRS8")) {
      const auto found = font.character_map.find(static_cast<char32_t>(c));
      if (found == font.character_map.end()) continue;
      for (const BezierContour& contour : font.glyphs[static_cast<std::size_t>(found->second)].contours) {
        INFO(path << ", " << c);
        LinkedCurve curve(contour, {.epsilon = epsilon});
        const double accuracy = 1e-3 * epsilon;
        CHECK(curve.bezier().contour() == contour);
        IntervalSet touched;
        for (int step = 0; step < 4; ++step) {
          if (step > 0) {
            const double from = uniform(0, 1);
            SampledSplice splice = curve.sample({from, wrapped(from + uniform(0.02, 0.15))});
            const Point by(uniform(-30, 30) * epsilon, uniform(-30, 30) * epsilon);
            for (Sample& sample : splice.samples) {
              const double way = splice.samples.back().t - splice.samples.front().t;
              const double x = 2.0 * (sample.t - splice.samples.front().t) / way - 1.0;
              sample.p += (1.0 - x * x) * (1.0 - x * x) * by;
            }
            touched.add(splice.interval);
            curve = curve.with_splice(splice);
          }
          CHECK(farthest_apart(curve.bezier(), curve.polyline(), accuracy) < epsilon);
          CHECK(farthest_apart(curve.bezier(), curve.spline(), accuracy) < epsilon);
          CHECK(farthest_apart(curve.bezier(), curve.wavelet(), accuracy) < epsilon);
          CHECK(farthest_apart(curve.bezier(), curve.arcwise(), accuracy) < epsilon);
        }
        const LinkedBezier source(contour);
        int kept = 0;
        for (int i = 0; i < curve.bezier().size(); ++i) {
          const auto piece = curve.bezier().piece(i);
          if (piece.source < 0) continue;
          ++kept;
          const Bezier own = contour.segment(piece.source);
          CHECK(piece.bezier.degree == own.degree);
          for (std::size_t k = 0; k <= static_cast<std::size_t>(own.degree); ++k) CHECK(piece.bezier.p[k] == own.p[k]);
        }
        int expected = 0;
        for (int i = 0; i < source.size(); ++i)
          expected += touched.overlaps({source.piece(i).t, source.end(i)}) ? 0 : 1;
        CHECK(kept == expected);
        const LinkedCurve compact = curve.compacted(0.5 * epsilon);
        CHECK(compact.bezier().size() <= curve.bezier().size());
        CHECK(farthest(compact.bezier().contour(), curve.bezier().contour(), 0.1 * epsilon).distance < 0.61 * epsilon);
      }
    }
  }
}
