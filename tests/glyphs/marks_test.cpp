// What a designer has marked in the source holds through every edit.

#include "fontcore/constraint.h"
#include "fontcore/measure.h"
#include "fontcore/outline_curve.h"
#include "glyphs/restyle.h"
#include "tests/catch.h"
#include "tests/glyphs/made_font.h"
#include "tests/shapes.h"

using namespace glyphs;
using fontcore::Point;

namespace {

// A circle of 600 units with the points of its node at the top: 2 handle, 3 node, 4 handle.
Font marked(const ContourMarks& marks) {
  Font font = font_of({shapes::circle(300)});
  font.glyphs[0].marks = {marks};
  return font;
}

Recipe with(const Step& step) {
  Recipe recipe;
  recipe.steps = {step};
  return recipe;
}

}  // namespace

TEST_CASE("a point marked as frozen stays where it is, and the edit goes on around it", "[restyle][marks]") {
  const Font font = marked({.frozen = {2, 3, 4}});
  const GlyphResult result =
      restyle_glyph(font, 0, with(SweepStep{.near = {212, 212}, .move = {30, 30}, .breadth = 900}));
  REQUIRE(result.report.changed);
  for (const int i : {2, 3, 4}) CHECK(result.contours[0].point(i) == font.glyphs[0].contours[0].point(i));
}

TEST_CASE("a node marked as a corner may turn where a smooth join would not", "[restyle][marks]") {
  const fontcore::OutlineCurve curve(shapes::circle(300), {.corners = {3}});
  CHECK(curve.corner_pairs().size() == 1);
  // Its right handle frozen, the left one pulled: only a corner can have both.
  Recipe recipe = with(SweepStep{.near = {-160, 260}, .move = {-40, 80}, .breadth = 600});
  recipe.keep.area = KeepArea::None;
  recipe.keep.extrema = false;
  recipe.keep.zones_auto = false;
  const auto turn_at_top = [&](const ContourMarks& marks) {
    const GlyphResult result = restyle_glyph(marked(marks), 0, recipe);
    CAPTURE(result.report.refused);
    REQUIRE(result.report.changed);
    return std::abs(turning_angles(result.contours[0])[1]);
  };
  CHECK(turn_at_top({.frozen = {3, 4}}) < fontcore::smooth_angle);
  CHECK(turn_at_top({.corners = {3}, .frozen = {3, 4}}) > 2.0 * fontcore::smooth_angle);
}

TEST_CASE("a contour marked with a scale is smoothed by it instead of the step's", "[restyle][marks]") {
  // A circle with a dent of some 60 units.
  fontcore::Points points = shapes::circle(300).points();
  points.row(2).y() -= 40;
  points.row(4).y() -= 40;
  points.row(3).y() -= 60;
  const auto smoothed = [&](std::optional<double> mark, double scale) {
    Font font = font_of({shapes::circle(300).with_points(points)});
    if (mark) font.glyphs[0].marks = {{.scale = mark}};
    Recipe recipe = with(SmoothStep{.scale = scale});
    recipe.keep.zones_auto = false;
    return restyle_glyph(font, 0, recipe).contours;
  };
  CHECK(smoothed(400.0, 50.0) == smoothed({}, 400.0));
  CHECK(smoothed(400.0, 50.0) != smoothed({}, 50.0));
  CHECK(smoothed(0.0, 400.0)[0].points() == points);
  CHECK(smoothed(400.0, 0.0)[0].points() == points);
}
