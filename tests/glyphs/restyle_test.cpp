#include "glyphs/restyle.h"

#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "fontcore/constraint.h"
#include "fontcore/crossing.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/ufo.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/made_font.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/kept_segments.h"
#include "tests/shapes.h"

using namespace glyphs;
using fontcore::Point;

namespace {

Recipe recipe_of(const SweepStep& step) {
  Recipe recipe;
  recipe.steps.push_back(step);
  return recipe;
}

SweepStep step_at(const Point& near, const Point& move, double breadth) {
  SweepStep step;
  step.near = near;
  step.move = move;
  step.breadth = breadth;
  return step;
}

// A ring with a slot cut in from the right, its two lips 20 units apart.
fontcore::BezierContour slotted() {
  return shapes::polygon({{0, 0}, {800, 0}, {800, 290}, {300, 290}, {300, 310}, {800, 310}, {800, 600}, {0, 600}});
}

int point_count(const std::vector<fontcore::BezierContour>& contours) {
  int count = 0;
  for (const auto& contour : contours) {
    for (const auto kind : contour.kinds()) count += kind == fontcore::PointKind::ImpliedNode ? 0 : 1;
  }
  return count;
}

// A sweep of its own for every letter, from a seed: somewhere in its box, up to 0.02 em, of 0.15 to 0.4 em.
struct RandomSweeps {
  std::mt19937 engine;
  double between(double low, double high) { return low + (high - low) * static_cast<double>(engine()) / 4294967296.0; }
  SweepStep operator()(const Font& font, const Glyph& glyph) {
    fontcore::Box box;
    for (const auto& contour : glyph.contours) box.add(control_box(contour));
    const double angle = between(0.0, 6.2831853);
    const double size = between(0.002, 0.02) * font.units_per_em;
    return step_at({between(box.low.x(), box.high.x()), between(box.low.y(), box.high.y())},
                   {size * std::cos(angle), size * std::sin(angle)}, between(0.15, 0.4) * font.units_per_em);
  }
};

}  // namespace

TEST_CASE("a sweep of every bundled letter keeps area, structure and crossings, and says what it did", "[restyle]") {
  int letter_count = 0;
  int unreduced = 0;
  int landed = 0;
  for (const std::string& path : bundled_ttf) {
    const Font font = load_font(path);
    RandomSweeps sweeps{std::mt19937(41)};
    for (const char letter : letters) {
      const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.character_map.at(static_cast<char32_t>(letter)))];
      if (glyph.is_composite()) continue;
      const SweepStep step = sweeps(font, glyph);
      const GlyphResult result = restyle_glyph(font, glyph.id, recipe_of(step));
      const GlyphReport& report = result.report;
      INFO(path << " " << glyph.name);
      CHECK(report.refused.empty());
      ++letter_count;
      unreduced += report.amount == 1.0 ? 1 : 0;
      CHECK(std::abs(report.area_unrounded / report.area_before - 1.0) < 1e-9);
      if (point_count(glyph.contours) >= 8) CHECK(std::abs(report.area_after / report.area_before - 1.0) < 5e-4);
      CHECK(added_crossings(find_crossings(glyph.contours), find_crossings(result.contours)) == 0);
      REQUIRE(report.steps.size() == 1);
      const StepReport& told = report.steps[0];
      const double missed = (told.handles[0].got - report.amount * told.handles[0].asked).norm();
      if (told.against.empty()) {
        ++landed;
        CHECK(missed < 1e-9);
      } else {
        CHECK((missed > 1e-9 || report.amount < 1.0 || told.against[0].starts_with("area in whole numbers")));
      }
      for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
        const auto& before = glyph.contours[k];
        const auto& after = result.contours[k];
        CHECK(after.kinds() == before.kinds());
        if (static_cast<int>(k) != told.contour) CHECK(after == before);
        int kept = 0;
        for (int s = 0; s < before.segment_count(); ++s) {
          bool same = true;
          for (int i = 0; i <= before.degree(s); ++i)
            same = same &&
                   before.segment(s).p[static_cast<std::size_t>(i)] == after.segment(s).p[static_cast<std::size_t>(i)];
          kept += same ? 1 : 0;
        }
        if (step.breadth <= 0.25 * length(before)) CHECK(2 * kept >= before.segment_count());
      }
      // Where the handle is after rounding: within one unit of its place.
      if (told.against.empty()) {
        const auto& before = glyph.contours[static_cast<std::size_t>(told.contour)];
        const auto& after = result.contours[static_cast<std::size_t>(told.contour)];
        const auto [segment, u, distance] = nearest_point(before, step.near);
        CHECK((evaluate(after.segment(segment), u) - told.handles[0].handle - told.handles[0].got).norm() <= 1.0);
      }
    }
  }
  CHECK(letter_count > 190);
  CHECK(unreduced >= 0.95 * letter_count);
  CHECK(landed > 0.3 * letter_count);
}

TEST_CASE("a move of nothing changes nothing, bit for bit", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  Recipe recipe = recipe_of(step_at({300, 300}, {0, 0}, 500));
  recipe.glyphs = "U+0041-007A";
  const RestyleResult result = restyle(font, recipe);
  CHECK(result.changed() == 0);
  CHECK(result.font.data == *font.data);
}

TEST_CASE("a sweep that would cross is reduced to the largest amount that does not, to 1 %", "[restyle]") {
  const Font font = font_of({slotted()});
  // The lower lip pushed 60 units up meets the upper one after 20.
  const SweepStep step = step_at({550, 290}, {0, 60}, 250);
  Recipe recipe = recipe_of(step);
  recipe.keep.area = KeepArea::None;
  const GlyphResult reduced = restyle_glyph(font, 0, recipe);
  CHECK(reduced.report.changed);
  CHECK(reduced.report.amount > 0.25);
  CHECK(reduced.report.amount < 0.36);
  CHECK(reduced.report.crossings_after == 0);
  REQUIRE_FALSE(reduced.report.notes.empty());
  CHECK(reduced.report.notes[0].starts_with("reduced to 0."));

  // What is a hundredth more crosses; what is less does not.
  recipe.on_crossing = OnCrossing::Allow;
  for (const double share : {0.25, 0.5, 0.75, 1.0}) {
    std::get<SweepStep>(recipe.steps[0]).move = share * reduced.report.amount * step.move;
    CHECK(find_crossings(restyle_glyph(font, 0, recipe).contours).empty());
  }
  std::get<SweepStep>(recipe.steps[0]).move = (reduced.report.amount + 0.011) * step.move;
  CHECK_FALSE(find_crossings(restyle_glyph(font, 0, recipe).contours).empty());

  recipe = recipe_of(step);
  recipe.keep.area = KeepArea::None;
  recipe.on_crossing = OnCrossing::Refuse;
  const GlyphResult refused = restyle_glyph(font, 0, recipe);
  CHECK(refused.report.refused == "crossings that the edit adds: 1");
  CHECK(refused.contours == font.glyphs[0].contours);
}

TEST_CASE("a glyph that crosses itself already may be edited as long as it crosses no more often", "[restyle]") {
  const Font font =
      font_of({shapes::square(400),
               transform(shapes::square(400), {.linear = Eigen::Matrix2d::Identity(), .shift = {200, 200}})});
  const GlyphResult result = restyle_glyph(font, 0, recipe_of(step_at({0, 200}, {-15, 0}, 1600)));
  CHECK(result.report.refused.empty());
  CHECK(result.report.amount == 1.0);
  CHECK(result.report.crossings_before == 2);
  CHECK(result.report.crossings_after == 2);
}

TEST_CASE("contours without an inside are carried through, and refused only if a step is about them", "[restyle]") {
  const auto dot = shapes::polygon({{50, 60}});
  const auto needle = shapes::polygon({{0, 0}, {10, 10}});
  const Font font = font_of({dot, shapes::arch(500), needle});
  const GlyphResult result = restyle_glyph(font, 0, recipe_of(step_at({250, 750}, {10, 0}, 700)));
  CHECK(result.report.changed);
  CHECK(result.report.steps[0].contour == 1);
  CHECK(result.contours[0] == dot);
  CHECK(result.contours[2] == needle);

  SweepStep step = step_at({0, 0}, {10, 0}, 500);
  step.contour = 2;
  CHECK(restyle_glyph(font, 0, recipe_of(step)).report.refused ==
        "contour 2: OutlineCurve: a contour of 2 points has no inside");
  step.contour = 3;
  CHECK(restyle_glyph(font, 0, recipe_of(step)).report.refused == "there is no contour 3: it has 3");
}

TEST_CASE("what fails within one glyph leaves it as it was and is its refusal, not the job's end", "[restyle]") {
  const Font font = font_of(std::vector<fontcore::BezierContour>(3000, shapes::arch(500)));
  const GlyphResult result = restyle_glyph(font, 0, recipe_of(step_at({250, 750}, {10, 0}, 700)));
  CHECK(result.report.refused == "find_crossings: too many pieces lie on each other");
  CHECK_FALSE(result.report.changed);
  CHECK(result.report.amount == 0.0);
  CHECK(result.contours == font.glyphs[0].contours);
}

TEST_CASE("several steps on one glyph follow each other and keep the area together", "[restyle]") {
  const Font font = font_of({shapes::circle(300), reverse(shapes::circle(150))});
  Recipe recipe = recipe_of(step_at({300, 0}, {14, 0}, 900));
  recipe.steps.emplace_back(step_at({-300, 0}, {-9, 3}, 900));
  recipe.steps.emplace_back(step_at({0, 150}, {0, 8}, 500));
  const GlyphReport report = restyle_glyph(font, 0, recipe).report;
  REQUIRE(report.steps.size() == 3);
  for (const StepReport& step : report.steps) {
    if (step.against.empty()) CHECK((step.handles[0].got - step.handles[0].asked).norm() < 1e-9);
  }
  CHECK(std::abs(report.area_unrounded / report.area_before - 1.0) < 1e-9);
  CHECK(std::abs(report.area_after / report.area_before - 1.0) < 5e-4);
}

TEST_CASE("lengths may be thousandths of the em, and near is where the glyph is drawn", "[restyle]") {
  Font font = font_of({shapes::arch(1000)}, 2000);
  const GlyphResult plain = restyle_glyph(font, 0, recipe_of(step_at({500, 1500}, {30, 0}, 1200)));
  Recipe recipe = recipe_of(step_at({250, 750}, {15, 0}, 600));
  recipe.lengths_in_thousandths = true;
  CHECK(restyle_glyph(font, 0, recipe).contours == plain.contours);
  font.glyphs[0].origin = 100;
  const GlyphResult drawn = restyle_glyph(font, 0, recipe_of(step_at({400, 1500}, {30, 0}, 1200)));
  CHECK(drawn.contours == plain.contours);
  CHECK(drawn.report.steps[0].handles[0].handle == plain.report.steps[0].handles[0].handle - Point(100, 0));
}

TEST_CASE("letters are smoothed with corners, area and structure kept, and a scale of 0 or gains of 1 change nothing",
          "[restyle]") {
  for (const std::string& path : bundled_ttf) {
    const Font font = load_font(path);
    Recipe recipe;
    recipe.glyphs = "U+0061-007A";
    for (const auto by : {fontcore::SmoothBy::Energy, fontcore::SmoothBy::Level}) {
      recipe.steps = {SmoothStep{.scale = 0.0, .by = by}};
      CHECK(restyle(font, recipe).font.data == *font.data);
    }
    recipe.steps = {EqualizeStep{.bands = {{40.0, 1.0}, {80.0, 1.0}}}};
    CHECK(restyle(font, recipe).font.data == *font.data);
    recipe.steps = {EqualizeStep{.bands = {{200.0, 1.8}, {400.0, 1.4}}}};
    const RestyleResult sharpened = restyle(font, recipe);
    CHECK(sharpened.refused() <= 2);  // i and j may be composites
    CHECK(sharpened.changed() > 10);
    for (const SmoothStep& step : {SmoothStep{.scale = 60.0}, SmoothStep{.scale = 250.0},
                                   SmoothStep{.scale = 600.0, .by = fontcore::SmoothBy::Level}}) {
      recipe.steps = {step};
      for (const char letter : std::string("aegnosy")) {
        const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find(std::string(1, letter)))];
        const GlyphResult result = restyle_glyph(font, glyph.id, recipe);
        INFO(path << " " << glyph.name << " at " << step.scale);
        CHECK(result.report.refused.empty());
        CHECK(result.report.steps.size() == glyph.contours.size());
        CHECK(std::abs(result.report.area_unrounded / result.report.area_before - 1.0) < 1e-9);
        CHECK(std::abs(result.report.area_after / result.report.area_before - 1.0) < 5e-4);
        for (std::size_t k = 0; k < glyph.contours.size(); ++k) {  // corners to the last bit
          const auto turns = turning_angles(glyph.contours[k]);
          for (int s = 0; s < glyph.contours[k].segment_count(); ++s) {
            const int node = glyph.contours[k].node(s);
            if (std::abs(turns[static_cast<std::size_t>(s)]) < 0.15) continue;
            CHECK(result.contours[k].point(node) == glyph.contours[k].point(node));
          }
        }
        if (step.by == fontcore::SmoothBy::Level) continue;  // which knows nothing of energy
        for (const StepReport& done : result.report.steps) CHECK(done.energy_after <= done.energy_before);
      }
    }
  }
}

TEST_CASE("corners are rounded as far as the outline's own points can follow, and the report says how far",
          "[restyle]") {
  const Font font = load_font(bundled_ttf[1]);
  Recipe recipe;
  recipe.keep.corners = recipe.keep.lines = false;
  for (const auto by : {fontcore::SmoothBy::Energy, fontcore::SmoothBy::Level}) {
    recipe.steps = {SmoothStep{.scale = 300.0, .by = by}};
    for (const char letter : std::string("agnst")) {
      const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find(std::string(1, letter)))];
      const GlyphResult result = restyle_glyph(font, glyph.id, recipe);
      INFO(glyph.name);
      CHECK(result.report.refused.empty());
      CHECK(result.report.changed);
      CHECK(std::abs(result.report.area_unrounded / result.report.area_before - 1.0) < 1e-9);
      CHECK(result.report.segments_after == result.report.segments_before);
      CHECK(result.report.steps[0].against.at(0).starts_with("the outline's own points: it ends up to "));
    }
  }
}

TEST_CASE("details that turn with a sweep keep what a sweep keeps", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find("S"))];
  SweepStep step = step_at({300, 900}, {-60, 20}, 1500);
  const GlyphResult plain = restyle_glyph(font, glyph.id, recipe_of(step));
  step.detail = fontcore::DetailFrame::Tangent;
  const GlyphResult turned = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK(turned.report.refused.empty());
  CHECK(turned.contours != plain.contours);
  CHECK(std::abs(turned.report.area_unrounded / turned.report.area_before - 1.0) < 1e-9);
  CHECK(turned.report.crossings_after == turned.report.crossings_before);
}

TEST_CASE("a frozen stretch keeps its bits, by its ends or by a box", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find("o"))];
  const fontcore::BezierContour& outer = glyph.contours[0];
  const fontcore::Box box = fontcore::control_box(outer);
  const Point middle = 0.5 * (box.low + box.high);
  Recipe recipe = recipe_of(step_at({box.high.x(), middle.y()}, {40, 0}, 4000));
  const auto kept_on_the_left = [&](const GlyphResult& result) {
    int kept = 0;
    for (int i = 0; i < outer.point_count(); ++i) {
      if (outer.point(i).x() < box.low.x() + 60 && result.contours[0].point(i) == outer.point(i)) ++kept;
    }
    return kept;
  };
  int on_the_left = 0;
  for (int i = 0; i < outer.point_count(); ++i) on_the_left += outer.point(i).x() < box.low.x() + 60 ? 1 : 0;
  REQUIRE(on_the_left >= 3);
  CHECK(kept_on_the_left(restyle_glyph(font, glyph.id, recipe)) < on_the_left);

  fontcore::Box left;
  left.add(box.low - Point(1, 1));
  left.add(Point(box.low.x() + 60, box.high.y() + 1));
  recipe.keep.freeze = {Freeze{.box = left}};
  const GlyphResult boxed = restyle_glyph(font, glyph.id, recipe);
  CHECK(boxed.report.refused.empty());
  CHECK(boxed.report.changed);
  CHECK(kept_on_the_left(boxed) == on_the_left);
  CHECK(std::abs(boxed.report.area_unrounded / boxed.report.area_before - 1.0) < 1e-9);

  // The whole contour, from a place round to itself: nothing moves.
  recipe.keep.freeze = {Freeze{.glyph = "o", .contour = 0, .stretch = std::pair{box.low, box.low}}};
  const GlyphResult whole = restyle_glyph(font, glyph.id, recipe);
  CHECK(whole.contours[0] == outer);
  recipe.keep.freeze[0].glyph = "nosuchglyph";
  CHECK_THROWS_AS(restyle(font, recipe), RequestError);
}

TEST_CASE("the length of a contour is kept beside its area", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  for (const char letter : std::string("aegnosS")) {
    const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find(std::string(1, letter)))];
    Recipe recipe = recipe_of(step_at({300, 500}, {25, -12}, 1400));
    recipe.keep.length = true;
    const GlyphResult result = restyle_glyph(font, glyph.id, recipe);
    INFO(glyph.name << " " << result.report.refused);
    REQUIRE(result.report.refused.empty());
    CHECK(result.unrounded != glyph.contours);
    for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
      const double before = fontcore::length(glyph.contours[k]);
      CHECK(std::abs(fontcore::length(result.unrounded[k]) / before - 1.0) < 1e-8);
      CHECK(std::abs(signed_area(result.unrounded[k]) / signed_area(glyph.contours[k]) - 1.0) < 1e-9);
    }
  }
}

TEST_CASE("several handles are dragged at once, each to its own place", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find("o"))];
  const fontcore::Box box = fontcore::control_box(glyph.contours[0]);
  const double middle = 0.5 * (box.low + box.high).y();
  SweepStep step = step_at({box.high.x(), middle}, {30, 0}, 1000);
  step.more = {SweepHandle{.near = {box.low.x(), middle}, .move = {-12, 0}}};
  const GlyphResult result = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK(result.report.refused.empty());
  REQUIRE(result.report.steps[0].handles.size() == 2);
  CHECK((result.report.steps[0].handles[0].got - Point(30, 0)).norm() < 1e-9);
  CHECK((result.report.steps[0].handles[1].got - Point(-12, 0)).norm() < 1e-9);
  CHECK(std::abs(result.report.area_unrounded / result.report.area_before - 1.0) < 1e-9);
  step.more[0].near = step.near;  // the same place cannot go two ways
  CHECK_THAT(restyle_glyph(font, glyph.id, recipe_of(step)).report.refused, Catch::Contains("too near to each other"));
}

TEST_CASE("a sweep by level moves as one by its breadth, and may drag a control point of the level", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find("o"))];
  const fontcore::Box box = fontcore::control_box(glyph.contours[0]);
  SweepStep step = step_at({box.high.x(), 0.5 * (box.low + box.high).y()}, {30, 0}, 0);
  step.level = 1.2;
  const GlyphResult curve = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK(curve.report.steps[0].level == 1.2);
  CHECK((curve.report.steps[0].handles[0].got - Point(30, 0)).norm() < 1e-9);
  step.grip = fontcore::Grip::ControlPoint;
  const GlyphResult control = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK(control.report.refused.empty());
  CHECK(control.contours != curve.contours);
  // The outline follows its control points part of the way.
  CHECK(control.report.steps[0].handles[0].got.x() > 3.0);
  CHECK(control.report.steps[0].handles[0].got.x() < 30.0);
  step.level = 40.0;
  CHECK_THAT(restyle_glyph(font, glyph.id, recipe_of(step)).report.refused,
             Catch::Contains("level 40 of a curve with levels 0 to "));
}

TEST_CASE("a pinned handle lands, or its glyph is refused with the rules that stand against it", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(font.find("o"))];
  const fontcore::Box box = fontcore::control_box(glyph.contours[0]);
  const Point right(box.high.x(), 0.5 * (box.low + box.high).y());
  SweepStep step = step_at(right, {35, 0}, 2500);
  step.pin = true;
  const GlyphResult landed = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK(landed.report.refused.empty());
  CHECK((landed.report.steps[0].handles[0].got - Point(35, 0)).norm() < 1e-9);

  // The top of an o lies at a zone.
  const fontcore::BezierContour& outer = glyph.contours[0];
  for (int i = 0; i < outer.point_count(); ++i) {
    if (outer.kind(i) == fontcore::PointKind::Node && outer.point(i).y() == box.high.y()) step.near = outer.point(i);
  }
  step.move = {0, 30};
  const GlyphResult refused = restyle_glyph(font, glyph.id, recipe_of(step));
  CHECK_THAT(refused.report.refused,
             Catch::Contains("against the pinned handle stands: ") && Catch::Contains("stays at zone y = "));
  CHECK(refused.contours == glyph.contours);
}

TEST_CASE("a composite is decomposed and edited if the recipe says so, and named", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  const int id = font.find("aacute");
  REQUIRE(font.glyphs[static_cast<std::size_t>(id)].is_composite());
  const Recipe recipe = parse_recipe(
      R"({"glyphs": "aacute,a", "steps": [{"op": "sweep", "glyph": "aacute", "near": [400, 900], "move": [0, 12],
          "breadth": 400}], "emit": {"composites": "decompose"}})",
      "r.json");
  const RestyleResult result = restyle(font, recipe);
  CHECK(result.refused() == 0);
  CHECK(result.changed() == 1);
  CHECK(result.font.decomposed == std::vector{id});
  const Font after = glyphs::load_font_bytes("after.ttf", result.font.data);
  const glyphs::Glyph& edited = after.glyphs[static_cast<std::size_t>(id)];
  CHECK_FALSE(edited.is_composite());
  CHECK(edited.contours.size() == glyphs::compose(font, id).size());
  CHECK(edited.advance == font.glyphs[static_cast<std::size_t>(id)].advance);
  CHECK(after.glyphs[static_cast<std::size_t>(font.find("a"))].contours ==
        font.glyphs[static_cast<std::size_t>(font.find("a"))].contours);
  const auto* report = &result.glyphs[0];
  if (report->glyph != id) ++report;
  REQUIRE_FALSE(report->notes.empty());
  CHECK(report->notes[0].starts_with("decomposed: it is a simple glyph now, of the outlines that its parts had: a, "));
  CHECK(glyphs::report_json(font, result).find("\"decomposed\": [\n    \"aacute\"\n  ]") != std::string::npos);
}

TEST_CASE("composites are refused with the parts to edit instead", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  Recipe recipe = recipe_of(step_at({300, 300}, {20, 0}, 500));
  recipe.glyphs = "U+00E4";
  const RestyleResult result = restyle(font, recipe);
  REQUIRE(result.refused() == 1);
  CHECK(result.glyphs[0].refused.starts_with("it is a composite; edit its parts: a, "));
  CHECK(result.glyphs[0].amount == 0.0);
  CHECK(result.font.data == *font.data);
}

TEST_CASE("a step about a glyph or a contour that is not there is a slip of the recipe", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  SweepStep step = step_at({300, 300}, {20, 0}, 500);
  step.glyph = "nosuchglyph";
  CHECK_THROWS_AS(restyle(font, recipe_of(step)), RequestError);
  step.glyph = "o";
  step.contour = 2;
  CHECK_THROWS_WITH(restyle(font, recipe_of(step)),
                    Catch::Contains("o: steps[0].contour: there is no contour 2, it has 2"));
  step.contour = 1;
  Recipe recipe = recipe_of(step);
  recipe.glyphs = "a,b";
  CHECK_THROWS_WITH(restyle(font, recipe), "steps[0].glyph: \"o\" is not among the recipe's glyphs");
}

TEST_CASE("the same recipe gives the same font and report for every number of threads", "[restyle]") {
  const Font font = load_font(bundled_ttf[2]);
  Recipe recipe = recipe_of(step_at({400, 400}, {18, -11}, 700));
  recipe.glyphs = "U+0041-007A";
  RestyleOptions one;
  one.jobs.jobs = 1;
  RestyleOptions three;
  three.jobs.jobs = 3;
  const RestyleResult a = restyle(font, recipe, one);
  const RestyleResult b = restyle(font, recipe, three);
  CHECK(a.changed() > 40);
  CHECK(a.font.data == b.font.data);
  CHECK(report_json(font, a) == report_json(font, b));
}

TEST_CASE("a font whose glyphs all draw one huge outline takes no more work than it stores points for", "[restyle]") {
  Font font = load_font(bundled_font("cabin/Cabin-Regular.otf"));
  std::vector<Point> gear;
  for (int k = 0; k < 2000; ++k) {
    const double angle = 1e-3 * std::numbers::pi * k;
    gear.emplace_back((k % 2 == 0 ? 4000.0 : 3950.0) * Point(std::cos(angle), std::sin(angle)));
  }
  int last = -1;
  for (Glyph& glyph : font.glyphs) {
    if (glyph.contours.empty()) continue;
    glyph.contours = {shapes::polygon(gear)};
    last = glyph.id;
  }
  const std::vector<int> first = first_alike(font);
  CHECK(first[static_cast<std::size_t>(last)] < last);
  CHECK(font.glyphs[static_cast<std::size_t>(first[static_cast<std::size_t>(last)])].contours ==
        font.glyphs[static_cast<std::size_t>(last)].contours);
  CHECK(drawn_points(font, first) == 2000);
  Recipe recipe;
  recipe.steps.push_back(SmoothStep{.scale = 60});
  recipe.keep.zones_auto = false;
  const RestyleResult once = restyle(font, recipe, {.jobs = {.jobs = 1}});
  const RestyleResult again = restyle(font, recipe, {.jobs = {.jobs = 3}});
  const auto report = std::ranges::find(once.glyphs, last, &GlyphReport::glyph);
  REQUIRE(report != once.glyphs.end());
  CHECK_THAT(report->refused, Catch::Contains("the work of the job is spent"));
  CHECK(once.glyphs.front().refused.find("the work of the job") == std::string::npos);
  CHECK(report_json(font, once) == report_json(font, again));
}

TEST_CASE("a step after another leaves whole numbers on every point", "[restyle]") {
  // Smoothing bends what was flat at a zone, and the sweep after it may then move it off.
  const Font font = load_font(bundled_ttf[0]);
  Recipe recipe;
  recipe.steps = {SmoothStep{.scale = 40}, SweepStep{.near = {300, 300}, .move = {15, 10}, .breadth = 400}};
  const std::vector<double> zones = alignment_zones(font);
  for (int id = 760; id < 800; ++id) {
    const GlyphResult result = restyle_glyph(font, id, recipe, zones);
    CAPTURE(result.report.name);
    for (const fontcore::BezierContour& contour : result.contours) {
      for (int i = 0; i < contour.point_count(); ++i) {
        if (contour.kind(i) == fontcore::PointKind::ImpliedNode) continue;
        CHECK(contour.point(i) == contour.point(i).array().round().matrix());
      }
    }
  }
}

TEST_CASE("compact emission has fewer segments, within its tolerance and with its area", "[restyle]") {
  for (const std::string& path : {bundled_ttf[2], bundled_otf[2]}) {
    const Font font = load_font(path);
    Recipe recipe;
    recipe.glyphs = "U+0041-005A,U+0061-007A";
    recipe.steps = {SmoothStep{.scale = 0.03 * font.units_per_em}};
    recipe.tolerance = 0.001 * font.units_per_em;
    const RestyleResult own = restyle(font, recipe);
    recipe.emission = glyphs::Emission::Compact;
    const RestyleResult compact = restyle(font, recipe);
    int before = 0;
    int after = 0;
    int off_area = 0;  // few points are moved by whole units
    for (std::size_t k = 0; k < own.glyphs.size(); ++k) {
      const GlyphReport& glyph = compact.glyphs[k];
      CAPTURE(path, glyph.name);
      before += own.glyphs[k].segments_after;
      after += glyph.segments_after;
      CHECK(glyph.segments_after <= own.glyphs[k].segments_after);
      CHECK(glyph.deviation <= std::max(recipe.tolerance + 0.02, own.glyphs[k].deviation));
      CHECK(glyph.crossings_after <= glyph.crossings_before);
      if (glyph.changed) {
        const double off = std::abs(glyph.area_after - glyph.area_target) / std::abs(glyph.area_target);
        CHECK(off < 2e-3);
        off_area += off > 5e-4 ? 1 : 0;
      }
    }
    CHECK(off_area <= 2);
    CHECK(after < 0.9 * before);
    recipe.steps = {SmoothStep{.scale = 0.0}};
    CHECK(restyle(font, recipe).font.data == *font.data);
  }
}

TEST_CASE("compact emission leaves frozen segments as they are in the font, bit for bit", "[restyle]") {
  int fewer = 0;
  for (const std::string& path : {bundled_ttf[0], bundled_ttf[2], bundled_otf[0], bundled_otf[2]}) {
    const Font font = load_font(path);
    Recipe recipe;
    recipe.steps = {SmoothStep{.scale = 0.03 * font.units_per_em}};
    recipe.tolerance = 0.001 * font.units_per_em;
    for (const char letter : letters) {
      const int id = font.character_map.at(static_cast<char32_t>(letter));
      const auto& own = font.glyphs[static_cast<std::size_t>(id)].contours;
      const fontcore::Box all = control_box(own[0]);
      fontcore::Box left;
      left.add(all.low - Point(1, 1));
      left.add(Point(all.low.x() + 0.3 * (all.high - all.low).x(), all.high.y() + 1));
      recipe.keep.freeze = {Freeze{.box = left}};
      recipe.emission = glyphs::Emission::Structure;
      const GlyphResult structure = restyle_glyph(font, id, recipe);
      recipe.emission = glyphs::Emission::Compact;
      const GlyphResult compact = restyle_glyph(font, id, recipe);
      CAPTURE(path, letter, compact.report.refused);
      REQUIRE(compact.contours.size() == own.size());
      for (std::size_t k = 0; k < own.size(); ++k) {
        const auto frozen = fontcore::frozen_within(own[k], left).points;
        std::vector<int> segments;
        for (int s = 0; s < own[k].segment_count(); ++s) {
          bool is_in = true;
          for (int i = 0; i <= own[k].degree(s); ++i)
            is_in = is_in && std::ranges::count(frozen, own[k].point_of(s, i)) > 0;
          if (is_in) segments.push_back(s);
        }
        CHECK(find_kept(own[k], segments, compact.contours[k], 0.0).missing == 0);
        fewer += structure.contours[k].segment_count() - compact.contours[k].segment_count();
      }
      CHECK(compact.report.deviation <= std::max(recipe.tolerance + 0.02, structure.report.deviation));
      if (compact.report.changed) CHECK(compact.report.area_after == Approx(compact.report.area_target).epsilon(2e-3));
    }
  }
  CHECK(fewer > 200);
}

TEST_CASE("a counter that an edit closes is counted and named", "[restyle]") {
  const Font font = font_of({shapes::polygon({{0, 0}, {0, 600}, {600, 600}, {600, 0}}),
                             shapes::polygon({{200, 200}, {400, 200}, {400, 400}, {200, 400}})});
  Recipe recipe = recipe_of(step_at({400, 300}, {-260, 0}, 400));
  recipe.keep.area = KeepArea::None;
  recipe.on_crossing = OnCrossing::Allow;
  const GlyphReport turned = restyle_glyph(font, 0, recipe, {}).report;
  CHECK(turned.closed_counters == 1);
  CHECK(turned.changed_windings == std::vector<int>{1});
  REQUIRE(turned.notes.size() >= 2);
  CHECK(turned.notes[0] == "a counter is closed: the one from (200, 200) to (400, 400)");
  recipe.steps = {step_at({400, 300}, {-100, 0}, 400)};
  const GlyphReport narrowed = restyle_glyph(font, 0, recipe, {}).report;
  CHECK(narrowed.changed);
  CHECK(narrowed.closed_counters == 0);
  CHECK(narrowed.changed_windings.empty());
}

TEST_CASE("the report has the keys that others rely on, a line a glyph", "[restyle]") {
  const Font font = load_font(bundled_ttf[0]);
  Recipe recipe = recipe_of(step_at({300, 300}, {20, 0}, 500));
  recipe.glyphs = "a,s,adieresis";
  const std::string text = report_json(font, restyle(font, recipe));
  const auto json = nlohmann::json::parse(text);
  CHECK(json.at("version") == 1);
  REQUIRE(json.at("glyphs").size() == 3);
  for (const auto& glyph : json.at("glyphs")) {
    for (const char* key : {"name", "area_before", "area_target", "area_after", "amount", "crossings_before",
                            "crossings_after", "segments_before", "segments_after", "deviation", "dropped"}) {
      CHECK(glyph.contains(key));
    }
  }
  CHECK(json["glyphs"][0]["dropped"].size() == 1);
  CHECK(text.find("\n    {\"name\":\"s\"") != std::string::npos);
}

TEST_CASE("the report counts points and bytes as they are in the files, and what was added", "[restyle]") {
  for (const std::string& path : {bundled_ttf[2], bundled_otf[2]}) {
    CAPTURE(path);
    const Font font = load_font(path);
    Recipe recipe;
    recipe.steps = {SmoothStep{.scale = 0.03 * font.units_per_em}};
    recipe.emission = glyphs::Emission::Compact;
    recipe.tolerance = 0.001 * font.units_per_em;
    recipe.glyphs = "U+0041-005A,eacute";
    const RestyleResult result = restyle(font, recipe);
    const Font after = glyphs::load_font_bytes("after", result.font.data);
    for (const GlyphReport& glyph : result.glyphs) {
      CAPTURE(glyph.name);
      const auto id = static_cast<std::size_t>(glyph.glyph);
      CHECK(glyph.size.points_before == point_count(font.glyphs[id].contours));
      CHECK(glyph.size.points_after == point_count(after.glyphs[id].contours));
    }
    // All that the table loses is in the font's count: also what composites lose, whose instructions go.
    const auto table = [&](const glyphs::Bytes& file) {
      return static_cast<double>(
          sfnt_bytes::tables_of(file).at(font.format == glyphs::OutlineFormat::Cff ? "CFF " : "glyf").size());
    };
    constexpr double offsets = 8.0;  // of CFF
    CHECK(result.size.points_after < result.size.points_before);
    CHECK(static_cast<double>(result.size.bytes_after - result.size.bytes_before) ==
          Approx(table(result.font.data) - table(*font.data)).margin(offsets));
    const auto json = nlohmann::json::parse(report_json(font, result));
    CHECK(json.at("points_before") == result.size.points_before);
    CHECK(json.at("bytes_after") == result.size.bytes_after);
    for (std::size_t k = 0; k < result.glyphs.size(); ++k) {
      CHECK(json.at("glyphs").at(k).at("bytes_after") == result.glyphs[k].size.bytes_after);
    }
  }
  const glyphs::WrittenFont ufo = glyphs::extract_ufo(load_font(bundled_ttf[0]));
  const Font font = glyphs::load_ufo("u.ufo", *ufo.folder);
  Recipe recipe = recipe_of(step_at({300, 300}, {20, 0}, 500));
  recipe.glyphs = "a,s";
  const RestyleResult result = restyle(font, recipe);
  CHECK(result.glyphs[0].size.bytes_before == static_cast<std::int64_t>(ufo.folder->at("glyphs/a.glif").size()));
  CHECK(result.glyphs[0].size.bytes_after == static_cast<std::int64_t>(result.font.folder->at("glyphs/a.glif").size()));
  CHECK(result.size.points_after == result.size.points_before);
}
