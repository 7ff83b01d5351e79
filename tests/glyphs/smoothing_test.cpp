// Smoothing on real letters, a to z of every bundled font.

#include "fontcore/edit.h"
#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

TEST_CASE("over 21 scales smoothing goes further and gets smoother on every arc of a to z, and keeps corners",
          "[smoothing][slow]") {
  int arcs = 0;  // looked at, once a scale
  for (const std::string& path : bundled_fonts()) {
    const glyphs::Font font = glyphs::load_font(path);
    for (char32_t letter = U'a'; letter <= U'z'; ++letter) {
      for (const auto& contour : compose(font, font.character_map.at(letter))) {
        const fontcore::OutlineCurve curve(contour, {.tolerance = 0.25e-3 * font.units_per_em});
        for (const auto by : {fontcore::SmoothBy::Energy, fontcore::SmoothBy::Level}) {
          fontcore::Smoothing before = smooth(curve, 0.0, by);
          REQUIRE(before.field.isZero(0.0));
          for (int k = 0; k < 21; ++k) {
            const fontcore::Smoothing now = smooth(curve, 2e-3 * font.units_per_em * std::pow(1.4, k), by);
            for (std::size_t arc = 0; arc < now.distance.size(); ++arc) {
              INFO(path << " " << static_cast<char>(letter) << " arc " << arc);
              CHECK(now.distance[arc] >= before.distance[arc] * (1.0 - 1e-9));
              CHECK(now.detail[arc] <= before.detail[arc] * (1.0 + 1e-9) + 1e-9);
              if (by == fontcore::SmoothBy::Energy) {
                REQUIRE(now.energy_after[arc] <= before.energy_after[arc] * (1.0 + 1e-9) + 1e-15);
              }
              ++arcs;
            }
            for (const int i : curve.corner_pairs()) {
              REQUIRE(now.field.row(i).isZero(0.0));
              REQUIRE(now.field.row((i + 1) % curve.size()).isZero(0.0));
            }
            before = now;
          }
        }
      }
    }
  }
  CHECK(arcs > 21 * 1500);
}
