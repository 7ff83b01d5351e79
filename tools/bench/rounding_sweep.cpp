// Rounding after the sweeps of a recipe, each of them on every letter and figure: how near the area comes, what plain
// rounding would do, and what it costs.
//
//     rounding_sweep RECIPE.json FONT ...
//
// A line a font: edits; of those with 16 or more free coordinate classes whose curves moved ("many"), how many end
// within 2e-5 of the area, relative to the glyph's, and the 95th percentile, beside that of plain rounding; edits that
// end further off than plain rounding; smooth joins that plain rounding opens, and that are open in the end; edits with
// a coordinate further than a unit from its place; microseconds of rounding a glyph.

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iomanip>
#include <iostream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "fontcore/measure.h"
#include "fontcore/rounding.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"

namespace {

using namespace fontcore;

constexpr double recipe_em = 2048.0;  // that the recipe's lengths are meant for
constexpr int many_classes = 16;
constexpr double near_area = 2e-5;

// Every sweep of the recipe alone, and all of a glyph's together, for any glyph.
std::vector<std::vector<glyphs::Step>> edits_of(const glyphs::Recipe& recipe, double em) {
  std::vector<std::vector<glyphs::Step>> edits;
  std::map<std::string, std::vector<glyphs::Step>> together;
  for (const glyphs::Step& step : recipe.steps) {
    const auto* const known = std::get_if<glyphs::SweepStep>(&step);
    if (known == nullptr) continue;
    glyphs::SweepStep sweep = *known;
    sweep.glyph.clear();
    sweep.near *= em / recipe_em;
    sweep.move *= em / recipe_em;
    sweep.breadth *= em / recipe_em;
    edits.push_back({sweep});
    together[known->glyph].push_back(sweep);
  }
  for (const auto& [glyph, steps] : together) {
    if (steps.size() > 1) edits.push_back(steps);
  }
  return edits;
}

struct Tally {
  int edits = 0;
  int refused = 0;
  std::vector<double> many;
  std::vector<double> many_plain;
  int farther = 0;
  int plain_opened = 0;
  int opened = 0;
  int beyond = 0;
  double seconds = 0.0;
};

double percentile(std::vector<double> of, double part) {
  if (of.empty()) return 0.0;
  std::sort(of.begin(), of.end());
  return of[static_cast<std::size_t>(part * static_cast<double>(of.size() - 1) + 0.5)];
}

// Coordinates tied by rules count once; those that end on whole numbers already do not count.
int free_classes(const BezierContour& moved, const BezierContour& original, const OutlineRules& rules) {
  std::map<int, int> parent;
  const auto root = [&](int v) {
    while (parent.contains(v)) v = parent[v];
    return v;
  };
  for (const Row& row : outline_rows(moved, rules)) {
    if (row.terms.size() != 2) continue;
    const int a = root(row.terms[0].variable);
    const int b = root(row.terms[1].variable);
    if (a != b) parent[a] = b;
  }
  std::set<int> all;
  std::set<int> held;
  for (int p = 0; p < moved.point_count(); ++p) {
    if (moved.kind(p) == PointKind::ImpliedNode) continue;
    for (int axis = 0; axis < 2; ++axis) {
      const double at = moved.points()(p, axis);
      all.insert(root(2 * p + axis));
      if (moved.point(p) == original.point(p) || std::abs(at - std::round(at)) < 1e-9) held.insert(root(2 * p + axis));
    }
  }
  return static_cast<int>(all.size() - held.size());
}

int opened_joins(const BezierContour& now, const std::vector<double>& before) {
  const std::vector<double> after = turning_angles(now);
  int count = 0;
  for (int s = 0; s < now.segment_count(); ++s) {
    const auto k = static_cast<std::size_t>(s);
    if (now.kind(now.node(s)) != PointKind::ImpliedNode && std::abs(before[k]) <= smooth_angle &&
        std::abs(after[k]) > smooth_angle)
      ++count;
  }
  return count;
}

BezierContour plainly_rounded(const BezierContour& contour) {
  Points points = (contour.points().array() + 0.5).floor();
  const auto n = contour.point_count();
  for (int p = 0; p < n; ++p) {
    if (contour.kind(p) == PointKind::ImpliedNode) {
      points.row(p) = 0.5 * (points.row((p + n - 1) % n) + points.row((p + 1) % n));
    }
  }
  return contour.with_points(points);
}

void look(const glyphs::Glyph& glyph, const glyphs::GlyphResult& result, OutlineRules rules, Tally& tally) {
  Box box;
  for (const BezierContour& contour : glyph.contours) {
    for (int s = 0; s < contour.segment_count(); ++s) box.add(contour.point(contour.node(s)));
  }
  rules.zones.insert(rules.zones.end(), {box.low.y(), box.high.y()});
  const double scale = std::abs(signed_area(glyph.contours));
  int classes = 0;
  double plain_error = 0.0;
  bool has_moved_curve = false;
  bool is_beyond = false;
  for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
    const BezierContour& before = glyph.contours[k];
    const BezierContour& solved = result.unrounded[k];
    if (solved == before) continue;
    for (int s = 0; s < before.segment_count(); ++s) {
      if (before.degree(s) > 1 && solved.segment(s).p != before.segment(s).p) has_moved_curve = true;
    }
    classes += free_classes(solved, before, rules);
    const BezierContour plain = plainly_rounded(solved);
    plain_error += signed_area(plain) - signed_area(solved);
    const std::vector<double> turns = turning_angles(before);
    tally.plain_opened += opened_joins(plain, turns);
    tally.opened += opened_joins(result.contours[k], turns);
    for (int p = 0; p < solved.point_count(); ++p) {
      if (solved.kind(p) != PointKind::ImpliedNode &&
          (result.contours[k].point(p) - solved.point(p)).cwiseAbs().maxCoeff() > 1.0)
        is_beyond = true;
    }
    const RoundingGoal goal{.area = signed_area(solved), .scale = scale};
    const auto begin = std::clock();
    const Rounding rounding = round_keeping_area(solved, before, rules, goal);
    tally.seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (rounding.contour.point_count() != solved.point_count()) throw std::logic_error("points were lost");
  }
  ++tally.edits;
  const double off = std::abs(result.report.area_after - result.report.area_target) / scale;
  const double plain_off = std::abs(plain_error) / scale;
  if (off > std::max(plain_off + 1e-9, 1e-6)) ++tally.farther;
  if (is_beyond) ++tally.beyond;
  if (classes >= many_classes && has_moved_curve) {
    tally.many.push_back(off);
    tally.many_plain.push_back(plain_off);
  }
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) throw std::runtime_error("usage: rounding_sweep RECIPE.json FONT ...");
  const glyphs::Recipe recipe = glyphs::load_recipe(argv[1]);
  std::cout << "edits  many  within 2e-5    p95     plain p95  farther  joins opened plainly  in the end  beyond a unit"
               "  us a glyph\n";
  for (const std::string& path : std::vector<std::string>(argv + 2, argv + argc)) {
    const glyphs::Font font = glyphs::load_font(path);
    OutlineRules rules;
    rules.zones = glyphs::alignment_zones(font);
    Tally tally;
    for (const auto& steps : edits_of(recipe, font.units_per_em)) {
      for (const auto& [first, last] : {std::pair{U'a', U'z'}, std::pair{U'A', U'Z'}, std::pair{U'0', U'9'}}) {
        for (char32_t letter = first; letter <= last; ++letter) {
          const auto found = font.character_map.find(letter);
          if (found == font.character_map.end()) continue;
          const glyphs::Glyph& glyph = font.glyphs[static_cast<std::size_t>(found->second)];
          if (glyph.is_composite() || glyph.contours.empty()) continue;
          glyphs::Recipe own = recipe;
          own.steps.clear();
          own.on_crossing = glyphs::OnCrossing::Allow;
          for (const glyphs::Step& step : steps) {
            auto sweep = std::get<glyphs::SweepStep>(step);
            if (sweep.contour.value_or(0) >= static_cast<int>(glyph.contours.size())) continue;
            own.steps.emplace_back(sweep);
          }
          if (own.steps.empty()) continue;
          const glyphs::GlyphResult result = restyle_glyph(font, glyph.id, own, rules.zones);
          if (!result.report.refused.empty()) {
            ++tally.refused;
          } else if (result.report.changed) {
            look(glyph, result, rules, tally);
          }
        }
      }
    }
    const auto near = std::count_if(tally.many.begin(), tally.many.end(), [](double off) { return off <= near_area; });
    std::cout << std::setw(5) << tally.edits << std::setw(6) << tally.many.size() << std::setw(12)
              << std::setprecision(4) << 100.0 * static_cast<double>(near) / static_cast<double>(tally.many.size())
              << " %" << std::setw(11) << std::setprecision(2) << percentile(tally.many, 0.95) << std::setw(11)
              << percentile(tally.many_plain, 0.95) << std::setw(9) << tally.farther << std::setw(22)
              << tally.plain_opened << std::setw(12) << tally.opened << std::setw(15) << tally.beyond << std::setw(12)
              << std::setprecision(4) << 1e6 * tally.seconds / tally.edits << "  "
              << path.substr(path.find_last_of('/') + 1) << ", " << tally.refused << " refused\n";
  }
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
