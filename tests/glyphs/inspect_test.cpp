#include "glyphs/inspect.h"

#include <atomic>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/recipe.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using glyphs::Font;

namespace {

/// A font of one glyph with the given contours, that came from no file.
Font font_of(std::vector<fontcore::BezierContour> contours) {
  Font font;
  font.path = "made.ttf";
  font.units_per_em = 1000;
  font.glyphs.resize(1);
  font.glyphs[0].name = "g";
  font.glyphs[0].contours = std::move(contours);
  return font;
}

fontcore::BezierContour polygon(const std::vector<fontcore::Point>& corners) {
  fontcore::Points points(static_cast<Eigen::Index>(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = corners[i].transpose();
  return {points, std::vector<fontcore::PointKind>(corners.size(), fontcore::PointKind::Node)};
}

}  // namespace

TEST_CASE("a square is four corners, four lines, its area and its length", "[inspect]") {
  const Font font = font_of({polygon({{0, 0}, {600, 0}, {600, 600}, {0, 600}})});
  const auto facts = glyphs::inspect(font, {0});
  REQUIRE(facts.size() == 1);
  CHECK(facts[0].area == 360000.0);
  REQUIRE(facts[0].contours.size() == 1);
  const glyphs::ContourFacts& square = facts[0].contours[0];
  CHECK(square.points == 4);
  CHECK(square.segments == 4);
  CHECK(square.corners == 4);
  CHECK(square.length == Approx(2400.0));
  CHECK(square.no_model.empty());
  CHECK(square.distance < 0.25);
  CHECK(square.control_points >= 64);
}

TEST_CASE("a contour without area has no model, and the reason is named", "[inspect]") {
  const Font font = font_of({polygon({{0, 0}, {600, 0}})});
  const auto facts = glyphs::inspect(font, {0});
  CHECK_FALSE(facts[0].contours[0].no_model.empty());
  CHECK(facts[0].trouble.empty());
}

TEST_CASE("a glyph that cannot be composed is named and does not stop the others", "[inspect]") {
  Font font = font_of({polygon({{0, 0}, {600, 0}, {600, 600}})});
  font.glyphs.resize(2);
  font.glyphs[1].id = 1;
  font.glyphs[1].name = "broken";
  font.glyphs[1].components.push_back({.glyph = 1});
  const auto facts = glyphs::inspect(font, {0, 1});
  CHECK(facts[0].trouble.empty());
  CHECK_FALSE(facts[1].trouble.empty());
  const auto json = nlohmann::json::parse(glyphs::facts_json(font, facts));
  CHECK(json["glyphs"][1]["area"].is_null());
  CHECK(json["glyphs"][1]["trouble"] == facts[1].trouble);
}

TEST_CASE("facts as JSON are one line a glyph and read back to the same numbers", "[inspect]") {
  const Font font = glyphs::load_font(bundled_otf[0]);
  const auto selected = glyphs::select_glyphs(font, "U+0041-005A");
  const auto facts = glyphs::inspect(font, selected);
  const std::string text = glyphs::facts_json(font, facts);
  CHECK(std::count(text.begin(), text.end(), '\n') == static_cast<std::ptrdiff_t>(selected.size()) + 2);
  const auto json = nlohmann::json::parse(text);
  CHECK(json["version"] == 1);
  CHECK(json["unitsPerEm"] == font.units_per_em);
  REQUIRE(json["glyphs"].size() == facts.size());
  for (std::size_t i = 0; i < facts.size(); ++i) {
    CHECK(json["glyphs"][i]["name"] == facts[i].name);
    CHECK(json["glyphs"][i]["area"].get<double>() == fontcore::signed_area(glyphs::compose(font, facts[i].glyph)));
  }
}

TEST_CASE("facts do not depend on the number of threads", "[inspect]") {
  const Font font = glyphs::load_font(bundled_otf[0]);
  const auto selected = glyphs::select_glyphs(font, "U+0041-005A");
  const auto text = [&](int jobs) { return glyphs::facts_json(font, glyphs::inspect(font, selected, {.jobs = jobs})); };
  CHECK(text(1) == text(2));
  CHECK(text(1) == text(7));
}

TEST_CASE("a figure eight and two squares that overlap are found, their clean twins are not", "[inspect]") {
  const auto square = [](double x) { return polygon({{x, 0}, {x + 100, 0}, {x + 100, 100}, {x, 100}}); };
  const Font eight = font_of({polygon({{0, 0}, {100, 100}, {100, 0}, {0, 100}})});
  const Font crossed = font_of({square(0), square(50)});
  const Font apart = font_of({square(0), square(150)});
  CHECK(glyphs::check_crossings(apart, {0})[0].crossings.empty());
  const auto in_eight = glyphs::check_crossings(eight, {0});
  REQUIRE(in_eight[0].crossings.size() == 1);
  CHECK(glyphs::describe(in_eight[0], in_eight[0].crossings[0]) == "g: contour 0 crosses itself at (50, 50)");
  const auto json_of = [](const Font& font) {
    return nlohmann::json::parse(report_json(glyphs::crossings_report(font, glyphs::check_crossings(font, {0}))));
  };
  const auto within = json_of(eight);
  CHECK(within["result"]["FAIL"] == 1);
  CHECK(within["sections"][0]["checks"][0]["result"] == "FAIL");
  CHECK(within["sections"][0]["checks"][0]["filename"] == "made.ttf");
  CHECK(within["sections"][0]["checks"][1]["result"] == "PASS");
  CHECK(json_of(crossed)["sections"][0]["checks"][1]["result"] == "FAIL");
  CHECK(json_of(apart)["result"]["PASS"] == 2);

  // Every finding with its kind, its point and both its places.
  const auto log = within["sections"][0]["checks"][0]["logs"][0];
  CHECK(log["status"] == "FAIL");
  CHECK(log["message"] == "g: contour 0 crosses itself at (50, 50)");
  CHECK(log["glyph"] == "g");
  CHECK(log["gid"] == 0);
  CHECK(log["kind"] == "crossing");
  CHECK(log["x"] == 50.0);
  CHECK(log["y"] == 50.0);
  CHECK(log["places"] == nlohmann::json::parse(R"([{"contour": 0, "segment": 0, "u": 0.5},
                                                   {"contour": 0, "segment": 2, "u": 0.5}])"));
  // What runs along another may cross it on the way; what touches does not.
  const auto between = json_of(font_of({square(0), square(100)}))["sections"][0]["checks"][1];
  CHECK(between["result"] == "FAIL");
  CHECK(between["logs"][0]["kind"] == "overlap");
  const Font corner = font_of({square(0), polygon({{100, 100}, {200, 100}, {200, 200}})});
  CHECK(json_of(corner)["sections"][0]["checks"][1]["logs"][0]["kind"] == "contact");
  CHECK(json_of(corner)["result"]["WARN"] == 1);
}

TEST_CASE("every job is done once, and progress ends complete", "[jobs]") {
  for (const int jobs : {0, 1, 3}) {
    std::vector<std::atomic<int>> calls(100);
    int last = -1;
    glyphs::run_jobs(100, {.jobs = jobs, .progress = [&](int done, int) { last = done; }},
                     [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
    CHECK(last == 100);
    for (const auto& call : calls) CHECK(call == 1);
  }
  CHECK_NOTHROW(glyphs::run_jobs(0, {}, [](int) {}));
  CHECK_THROWS_AS(glyphs::run_jobs(1, {.jobs = -1}, [](int) {}), fontcore::InvalidInput);
}

TEST_CASE("of several failing jobs the first by number is reported, for every number of threads", "[jobs]") {
  for (const int jobs : {1, 4})
    CHECK_THROWS_WITH(glyphs::run_jobs(50, {.jobs = jobs},
                                       [](int i) {
                                         if (i >= 20) throw std::runtime_error(fontcore::text("job ", i));
                                       }),
                      "job 20");
}
