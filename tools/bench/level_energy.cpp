// Bending energy of the arcs of a to z at their integer levels, for the fonts named: a table to look at. By level it
// need not fall; smoothing by energy does that.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "fontcore/edit.h"
#include "glyphs/font_file.h"

int main(int argc, char** argv) {
  std::printf("%-34s %5s %6s %14s %14s %10s\n", "font", "down", "arcs", "energy", "distance", "rises on");
  for (int k = 1; k < argc; ++k) {
    const glyphs::Font font = glyphs::load_font(argv[k]);
    struct Row {
      int arcs = 0;         // that have so many levels
      int rising = 0;       // of them, with more energy than a level up
      double energy = 0.0;  // summed
      double distance = 0.0;
    };
    std::vector<Row> rows;
    for (char32_t letter = U'a'; letter <= U'z'; ++letter) {
      const auto found = font.character_map.find(letter);
      if (found == font.character_map.end()) continue;
      for (const auto& contour : compose(font, found->second)) {
        if (!has_inside(contour)) continue;
        const fontcore::OutlineCurve outline(contour, {.tolerance = glyphs::model_tolerance * font.units_per_em});
        const fontcore::ArcwiseCurve arcs(outline, {.tolerance = glyphs::model_tolerance * font.units_per_em});
        for (const auto& arc : arcs.arcs()) {
          const auto& base = arc.curve.base();
          const double h = arc.span_length();
          const fontcore::Coefficients fine = reconstruct(base);
          double before = 0.0;
          for (int down = 0; down <= base.levels(); ++down) {
            fontcore::Coefficients points = arc.at_level(base.levels() - down);
            const double span = h * (1 << down);
            const double energy = fontcore::energy({points, {}, base.scheme}, 0) / (span * span * span);
            for (int up = 0; up < down; ++up) points = refine(base.scheme, points);
            const fontcore::Coefficients gap = points - fine;
            const auto mass = fontcore::mother_matrix(fontcore::Form::Product, base.scheme, fine.rows());
            if (rows.size() <= static_cast<std::size_t>(down)) rows.emplace_back();
            Row& row = rows[static_cast<std::size_t>(down)];
            ++row.arcs;
            row.energy += energy;
            row.distance += std::sqrt(std::max(0.0, h * gap.cwiseProduct(mass * gap).sum()));
            if (down > 0 && energy > before * (1.0 + 1e-9)) ++row.rising;
            before = energy;
          }
        }
      }
    }
    for (std::size_t down = 0; down < rows.size(); ++down) {
      const Row& row = rows[down];
      std::printf("%-34s %5zu %6d %14.6g %14.6g %10d\n", font.family.c_str(), down, row.arcs, row.energy, row.distance,
                  row.rising);
    }
  }
}
