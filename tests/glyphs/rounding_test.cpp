#include "fontcore/rounding.h"

#include <filesystem>
#include <map>

#include "fontcore/error.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/every_rounding.h"

using namespace fontcore;

namespace {

constexpr double recipe_em = 2048.0;  // that the lengths of the bundled recipes are meant for
constexpr int most_tried = 14;
constexpr int many_classes = 16;

const std::string letters_and_figures = letters + "0123456789";

// The sweeps of every recipe in fonts/recipes, each alone and those of one glyph together, for any glyph.
std::vector<std::vector<glyphs::SweepStep>> bundled_sweeps(double em) {
  std::vector<std::vector<glyphs::SweepStep>> sweeps;
  std::vector<std::filesystem::path> recipes;
  for (const auto& file : std::filesystem::directory_iterator(bundled_font("recipes"))) recipes.push_back(file.path());
  std::sort(recipes.begin(), recipes.end());
  for (const auto& path : recipes) {
    std::map<std::string, std::vector<glyphs::SweepStep>> together;
    for (const glyphs::Step& step : glyphs::load_recipe(path).steps) {
      const auto* const known = std::get_if<glyphs::SweepStep>(&step);
      if (known == nullptr) continue;
      glyphs::SweepStep sweep = *known;
      sweep.glyph.clear();
      sweep.near *= em / recipe_em;
      sweep.move *= em / recipe_em;
      sweep.breadth *= em / recipe_em;
      sweeps.push_back({sweep});
      together[known->glyph].push_back(sweep);
    }
    for (const auto& [glyph, steps] : together) {
      if (steps.size() > 1) sweeps.push_back(steps);
    }
  }
  return sweeps;
}

// The contours that sweeps move, before rounding. Every second edit holds its first handle.
std::vector<Unrounded> moved_contours(const glyphs::Font& font, const glyphs::Glyph& glyph,
                                      const std::vector<glyphs::SweepStep>& sweeps, OutlineRules rules, int number) {
  glyphs::Recipe recipe;
  recipe.on_crossing = glyphs::OnCrossing::Allow;
  for (const glyphs::SweepStep& sweep : sweeps) {
    if (sweep.contour.value_or(0) < static_cast<int>(glyph.contours.size())) recipe.steps.emplace_back(sweep);
  }
  if (recipe.steps.empty()) return {};
  const glyphs::GlyphResult result = restyle_glyph(font, glyph.id, recipe, rules.zones);
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const BezierContour& contour : glyph.contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      low = std::min(low, contour.point(contour.node(s)).y());
      high = std::max(high, contour.point(contour.node(s)).y());
    }
  }
  rules.zones.insert(rules.zones.end(), {low, high});
  const double scale = std::abs(signed_area(glyph.contours));
  std::vector<Unrounded> contours;
  for (std::size_t c = 0; c < glyph.contours.size(); ++c) {
    const BezierContour& solved = result.unrounded[c];
    if (solved == glyph.contours[c]) continue;
    RoundingGoal goal{.area = signed_area(solved), .scale = scale, .handles = {}};
    if (number % 2 == 0 && contours.empty()) {
      const auto at = nearest_point(glyph.contours[c], std::get<glyphs::SweepStep>(recipe.steps[0]).near);
      goal.handles.push_back({at.segment, at.u});
    }
    contours.push_back({solved, glyph.contours[c], rules, goal});
  }
  return contours;
}

bool has_moved_curve(const std::vector<Unrounded>& contours) {
  return std::any_of(contours.begin(), contours.end(), [](const Unrounded& contour) {
    for (int s = 0; s < contour.edited.segment_count(); ++s) {
      if (contour.edited.degree(s) > 1 && contour.edited.segment(s).p != contour.original.segment(s).p) return true;
    }
    return false;
  });
}

}  // namespace

TEST_CASE("after the bundled recipes' sweeps, letters in whole numbers are as near their area as can be",
          "[rounding][slow]") {
  for (const std::string& path : bundled_fonts()) {
    const glyphs::Font font = glyphs::load_font(path);
    OutlineRules rules;
    rules.zones = glyphs::alignment_zones(font);
    int tried = 0;     // every choice, for comparison
    int unclosed = 0;  // edits with a join that no choice closes
    int many = 0;      // edits of many free coordinates
    int near = 0;      // of those, within 2e-5 of the area
    int farther = 0;   // than plain rounding, which opens a join there
    int edits = 0;
    for (const auto& sweeps : bundled_sweeps(font.units_per_em)) {
      for (const char letter : letters_and_figures) {
        const auto found = font.character_map.find(static_cast<char32_t>(letter));
        if (found == font.character_map.end()) continue;
        const glyphs::Glyph& glyph = font.glyphs[static_cast<std::size_t>(found->second)];
        if (glyph.is_composite()) continue;
        const auto contours = moved_contours(font, glyph, sweeps, rules, edits);
        if (contours.empty()) continue;
        ++edits;
        const std::vector<Rounding> roundings = round_keeping_area(contours);
        INFO(path << " " << glyph.name << ", edit " << edits);
        std::vector<BezierContour> now;
        double told = 0.0;
        int open = 0;
        for (const Rounding& rounding : roundings) {
          now.push_back(rounding.contour);
          told += rounding.area_error;
          open += rounding.opened_joins;
        }
        const double scale = contours[0].goal.scale;
        const double error = every_rounding::area_error(contours, now);
        CHECK(std::abs(told - error) < 1e-6);
        CHECK(open == every_rounding::opened_joins(contours, now));

        // Within one unit, tied coordinates alike, what is not free where it was.
        const auto classes = every_rounding::classes_of(contours);
        double farthest = 0.0;
        for (const auto& [contour, coordinates, exact, is_free] : classes) {
          const double first = now[contour].points()(coordinates[0] / 2, coordinates[0] % 2);
          bool is_kept = is_free ? first == std::round(first) : first == exact;
          for (const int v : coordinates) is_kept = is_kept && now[contour].points()(v / 2, v % 2) == first;
          CHECK(is_kept);
          farthest = std::max(farthest, std::abs(first - exact));
        }
        const auto plain = every_rounding::plain(contours, classes);
        const double plain_error = every_rounding::area_error(contours, plain);
        const bool plain_keeps_joins = every_rounding::opened_joins(contours, plain) == 0;
        if (std::abs(error) > std::max(std::abs(plain_error) + 1e-6, 1e-6 * scale)) {
          ++farther;
          CHECK_FALSE(plain_keeps_joins);
        }
        if (plain_keeps_joins) CHECK((open == 0 && farthest < 1.0));
        for (std::size_t c = 0; c < contours.size(); ++c) {
          if (farthest < 1.0) CHECK(every_rounding::handle_error(contours[c], now[c]) <= 1.0 + 1e-9);
        }

        const int free = every_rounding::free_count(classes);
        if (free <= most_tried) {
          ++tried;
          const auto least = every_rounding::least_error(contours, classes);
          if (!least) {
            ++unclosed;
            CHECK_FALSE(plain_keeps_joins);
          } else {
            CHECK(std::abs(error) == Approx(*least).margin(1e-6));
            CHECK(open == 0);
            CHECK(farthest < 1.0);
          }
        } else if (free >= many_classes && has_moved_curve(contours)) {
          ++many;
          if (std::abs(error) <= 2e-5 * scale) ++near;
        }
      }
    }
    INFO(path << ": " << edits << " edits, " << tried << " tried, " << unclosed << " unclosed, " << many << " many, "
              << near << " near, " << farther << " farther");
    CHECK(edits > 1000);
    CHECK(near >= 0.95 * many);
    CHECK(unclosed <= 0.01 * tried);
    CHECK(farther <= 0.01 * edits);
  }
}

TEST_CASE("joins that plain rounding of fractional coordinates opens stay smooth", "[rounding]") {
  int plainly_opened = 0;
  int left_open = 0;
  for (const char* name : {"eb-garamond/EBGaramond12-Regular.otf", "eb-garamond/EBGaramond12-Bold.otf"}) {
    const glyphs::Font font = glyphs::load_font(bundled_font(name));
    for (const char letter : letters_and_figures) {
      const glyphs::Glyph& glyph =
          font.glyphs[static_cast<std::size_t>(font.character_map.at(static_cast<char32_t>(letter)))];
      std::vector<Unrounded> contours;
      for (const BezierContour& contour : glyph.contours) {
        RoundingGoal goal{signed_area(contour), std::abs(signed_area(glyph.contours)), {}, {}};
        goal.is_new.assign(contour.kinds().size(), true);
        contours.push_back({contour, contour, {}, goal});
      }
      const auto classes = every_rounding::classes_of(contours);
      std::vector<BezierContour> now;
      for (const Rounding& rounding : round_keeping_area(contours)) now.push_back(rounding.contour);
      INFO(name << " " << glyph.name);
      for (std::size_t c = 0; c < now.size(); ++c) {
        for (const int node : every_rounding::opened_nodes(contours[c], now[c])) {
          ++left_open;  // a handle of a few units whose direction no whole numbers near have
          CHECK_FALSE(every_rounding::can_be_closed(contours[c].edited, node));
        }
      }
      const auto plain = every_rounding::plain(contours, classes);
      const int opened = every_rounding::opened_joins(contours, plain);
      plainly_opened += opened;
      if (opened == 0) {
        CHECK(std::abs(every_rounding::area_error(contours, now)) <=
              std::abs(every_rounding::area_error(contours, plain)) + 1e-6);
      }
      for (std::size_t c = 0; c < now.size(); ++c) {
        CHECK((now[c].points() - contours[c].edited.points()).cwiseAbs().maxCoeff() <= 2.0);
      }
    }
  }
  CHECK(plainly_opened == 20);
  CHECK(left_open == 1);
}
