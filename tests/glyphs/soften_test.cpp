// Corners of real letters made round: what is written is tangent where it should be, crosses nowhere, and has its area.

#include "fontcore/soften.h"

#include <cmath>

#include "fontcore/constraint.h"
#include "fontcore/crossing.h"
#include "fontcore/measure.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/made_font.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/shapes.h"

using namespace glyphs;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;

namespace {

Recipe softening(double radius) {
  Recipe recipe;
  recipe.steps = {SoftenStep{.radius = radius}};
  return recipe;
}

bool is_whole(const BezierContour& contour) {
  for (int i = 0; i < contour.point_count(); ++i) {
    if (contour.kind(i) == PointKind::ImpliedNode) continue;
    if (contour.point(i) != contour.point(i).array().floor().matrix()) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("softened letters are whole numbers with their softened area, and cross nowhere", "[soften][slow]") {
  struct Tally {
    int joins = 0;
    int opened = 0;
  };
  Tally small;
  Tally large;
  for (const std::string& path : bundled_ttf) {
    const Font font = load_font(path);
    for (const double radius : {10.0, 40.0, 120.0}) {
      for (const char letter : letters) {
        const int id = font.character_map.at(static_cast<char32_t>(letter));
        const Glyph& glyph = font.glyphs[static_cast<std::size_t>(id)];
        if (glyph.is_composite()) continue;
        const GlyphResult result = restyle_glyph(font, id, softening(radius));
        const GlyphReport& report = result.report;
        INFO(path << " " << glyph.name << ", radius " << radius);
        CHECK(report.refused.empty());
        CHECK(added_crossings(find_crossings(glyph.contours), find_crossings(result.contours)) == 0);
        REQUIRE(result.contours.size() == glyph.contours.size());
        CHECK(report.area_unrounded == Approx(report.area_target).epsilon(1e-12));
        // The handles of a small arc on a slanted line have few directions in whole numbers, and hold the line's ends.
        const double area_error = std::abs(report.area_after / report.area_target - 1.0);
        CHECK(area_error < (radius < 40.0 ? 1e-2 : 5e-4));
        if (area_error > 5e-4) CHECK(report.notes.size() >= 2);
        CHECK(report.segments_after >= report.segments_before);
        for (std::size_t k = 0; k < result.contours.size(); ++k) {
          const BezierContour& solved = result.unrounded[k];
          const BezierContour& after = result.contours[k];
          CHECK(is_whole(after));
          REQUIRE(after.kinds() == solved.kinds());
          if (after == glyph.contours[k]) continue;
          const auto turns_solved = turning_angles(solved);
          const auto turns_after = turning_angles(after);
          for (std::size_t s = 0; s < turns_solved.size(); ++s) {
            if (std::abs(turns_solved[s]) > fontcore::smooth_angle) continue;
            Tally& tally = radius < 40.0 ? small : large;
            ++tally.joins;
            CHECK(std::abs(turns_after[s]) < 1.0);  // no spike, however small the arc
            tally.opened += std::abs(turns_after[s]) > fontcore::smooth_angle + 1e-6 ? 1 : 0;
          }
        }
      }
    }
  }
  // What is open is beside handles of two or three units: of arcs on legs as short as that, or of radius 10.
  CHECK(large.joins > 10000);
  CHECK(large.opened < large.joins / 500);
  CHECK(small.opened < small.joins / 50);
}

TEST_CASE("a square of the font loses at every corner what two quadratics take", "[soften]") {
  const Font font = font_of({reverse(shapes::square(600))});
  const GlyphResult result = restyle_glyph(font, 0, softening(100));
  CHECK(result.contours[0].point_count() == 20);
  const double a = std::tan(std::acos(-1.0) / 8);
  const double taken = 4 * ((1 - a) * (1 - a) / 2 + a * (1 - a) / 6) * 100 * 100;
  CHECK(result.report.area_target == Approx(-(600 * 600 - taken)).epsilon(1e-12));
  CHECK(std::abs(result.report.area_after / result.report.area_target - 1.0) < 1e-4);
  REQUIRE(result.report.notes.size() == 1);
  CHECK(result.report.notes[0].starts_with("softening takes 8480."));
  REQUIRE(result.report.steps.size() == 1);
  CHECK(result.report.steps[0].corners == 4);
  CHECK(result.report.steps[0].least_radius == 100);
  CHECK(result.report.segments_before == 4);
  CHECK(result.report.segments_after == 12);
  // The ends of the sides stay on them.
  CHECK(control_box(result.contours[0]).high == Point(600, 600));
  CHECK(control_box(result.contours[0]).low == Point(0, 0));
}

TEST_CASE("a radius is in the recipe's unit, and one of 0 changes nothing", "[soften]") {
  const Font font = load_font(bundled_ttf[3]);
  const int id = font.find("a");
  Recipe recipe = softening(0);
  const GlyphResult still = restyle_glyph(font, id, recipe);
  CHECK(still.contours == font.glyphs[static_cast<std::size_t>(id)].contours);
  CHECK_FALSE(still.report.changed);
  recipe.glyphs = "a,b";
  CHECK(restyle(font, recipe).font.data == *font.data);
  Recipe in_thousandths = softening(20);
  in_thousandths.lengths_in_thousandths = true;
  CHECK(restyle_glyph(font, id, in_thousandths).contours ==
        restyle_glyph(font, id, softening(20 * font.units_per_em / 1000.0)).contours);
}

TEST_CASE("listed corners alone become arcs, by the numbers of the font, also where a master has none", "[soften]") {
  const BezierContour drop = fontcore::from_quadratic_points(
      shapes::points_of({{0, 0}, {300, -200}, {700, -200}, {900, 0}, {900, 400}, {0, 400}}),
      {true, false, false, true, true, true});
  Recipe recipe;
  recipe.steps = {SoftenStep{.contour = 0, .radius = 50, .corners = {{3, 4}}}};
  const GlyphResult result = restyle_glyph(font_of({drop}), 0, recipe);
  CHECK(result.report.steps.at(0).corners == 2);
  CHECK(result.contours[0].point_count() == drop.point_count() + 8);
  fontcore::Points straight = drop.points();
  straight.row(5) << 1000, 200;  // at 4 the outline goes straight on now, from 3 to 5
  straight.row(4) << 950, 0;
  straight.row(6) << 1050, 400;
  const GlyphResult other = restyle_glyph(font_of({drop.with_points(straight)}), 0, recipe);
  CHECK(other.contours[0].kinds() == result.contours[0].kinds());
  const auto refusal = [&](int point) {
    recipe.steps = {SoftenStep{.contour = 0, .radius = 50, .corners = {{3}}},
                    SoftenStep{.contour = 0, .radius = 50, .corners = {{point}}}};
    return restyle_glyph(font_of({drop}), 0, recipe).report.refused;
  };
  CHECK(refusal(4).empty());
  CHECK(refusal(3) == "contour 0: point 3 is an arc already");
  CHECK(refusal(1) == "contour 0: point 1 is no node");
  CHECK(refusal(6) == "contour 0: there is no point 6: it has 6");
}

TEST_CASE("frozen corners stay, and what else is frozen keeps its place through later steps", "[soften]") {
  const Font font = load_font(bundled_ttf[0]);
  const int id = font.find("H");
  const auto& contours = font.glyphs[static_cast<std::size_t>(id)].contours;
  fontcore::Box box = control_box(contours[0]);
  box.low.y() = 0.5 * (box.low.y() + box.high.y()) + 150;
  Recipe recipe = softening(30);
  recipe.steps.push_back(SweepStep{.near = {0, 100}, .move = {8, 0}, .breadth = 3000});
  recipe.keep.freeze = {Freeze{.box = box}};
  const GlyphResult result = restyle_glyph(font, id, recipe);
  CHECK(result.report.refused.empty());
  REQUIRE(result.report.steps.size() == 2);
  CHECK(result.report.steps[0].corners > 0);
  CHECK(result.report.steps[0].against.size() == 1);
  const fontcore::FrozenStretch frozen = frozen_within(contours[0], box);
  CHECK(frozen.points.size() > 8);
  for (const int point : frozen.points) {
    const auto row = contours[0].points().row(point);
    CHECK((result.contours[0].points().rowwise() - row).rowwise().norm().minCoeff() == 0.0);
  }
}

TEST_CASE("later steps keep the softened area, whatever came before", "[soften]") {
  const Font font = load_font(bundled_ttf[2]);
  const int id = font.find("r");
  Recipe recipe = softening(40);
  recipe.steps.insert(recipe.steps.begin(), SweepStep{.near = {300, 900}, .move = {15, 10}, .breadth = 900});
  recipe.steps.push_back(SweepStep{.near = {300, 0}, .move = {-10, 0}, .breadth = 900});
  const GlyphResult result = restyle_glyph(font, id, recipe);
  CHECK(result.report.refused.empty());
  CHECK(std::abs(result.report.area_target) < std::abs(result.report.area_before));
  CHECK(result.report.area_unrounded == Approx(result.report.area_target).epsilon(1e-9));
  CHECK(std::abs(result.report.area_after / result.report.area_target - 1.0) < 5e-4);
  CHECK(is_whole(result.contours[0]));
}

TEST_CASE("a glyph whose points a composite matches by number keeps its corners, and the others go on", "[soften]") {
  using sfnt_bytes::composite;
  const auto square = sfnt_bytes::simple_glyph({{{0, 0}, {0, 500}, {500, 500}, {500, 0}}});
  const Font font = load_font_bytes(
      "small.ttf", sfnt_bytes::font_of(sfnt_bytes::small_font(
                       {{}, square, square, composite({{.glyph = 1}, {.glyph = 1, .first = 2, .is_shift = false}})})));
  Recipe recipe = softening(50);
  recipe.glyphs = "A,B";
  const RestyleResult result = restyle(font, recipe);
  REQUIRE(result.glyphs.size() == 2);
  CHECK(result.glyphs[0].refused == "its points would be other ones, and C matches its parts by point numbers");
  CHECK(result.glyphs[1].changed);
  CHECK(load_font_bytes("again.ttf", result.font.data).glyphs[2].contours[0].point_count() == 20);
}
