#include "glyphs/recipe.h"

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;

namespace {

std::string refusal(const std::string& json) {
  try {
    parse_recipe(json, "r.json");
  } catch (const RequestError& error) {
    return error.what();
  }
  return "";
}

std::string with_step(const std::string& step) { return R"({"steps": [{"op": "sweep", )" + step + "}]}"; }

const Font& serif() {
  static const Font font = load_font(bundled_ttf[0]);
  return font;
}

}  // namespace

TEST_CASE("a recipe is read as it is written", "[recipe]") {
  const Recipe recipe = parse_recipe(R"({
    "unit": "em/1000", "glyphs": "U+0061-007A,A", "seed": 7,
    "steps": [{"op": "sweep", "glyph": "a", "contour": 1, "near": [520, 300], "move": [12, -8], "breadth": 400},
              {"op": "sweep", "near": [1.5, 2], "move": [0, 0], "breadth": 10}],
    "keep": {"corners": false, "lines": false, "smooth_joins": false, "extrema": false, "zones": [0, 500.5], "area": "contour",
             "length": false, "freeze": []},
    "emit": {"mode": "structure", "tolerance": 0.75},
    "on_crossing": "refuse"})",
                                     "r.json");
  CHECK(recipe.lengths_in_thousandths);
  CHECK(recipe.glyphs == "U+0061-007A,A");
  CHECK(recipe.seed == 7);
  REQUIRE(recipe.steps.size() == 2);
  const auto& first = std::get<SweepStep>(recipe.steps[0]);
  CHECK(first.glyph == "a");
  CHECK(first.contour == 1);
  CHECK(first.near == fontcore::Point(520, 300));
  CHECK(first.move == fontcore::Point(12, -8));
  CHECK(first.breadth == 400);
  CHECK_FALSE(std::get<SweepStep>(recipe.steps[1]).contour.has_value());
  CHECK_FALSE(recipe.keep.corners);
  CHECK_FALSE(recipe.keep.zones_auto);
  CHECK(recipe.keep.zones == std::vector<double>{0.0, 500.5});
  CHECK(recipe.keep.area == KeepArea::Contour);
  CHECK(recipe.tolerance == 0.75);
  CHECK(recipe.on_crossing == OnCrossing::Refuse);
}

TEST_CASE("what a recipe leaves out has the defaults that keep most", "[recipe]") {
  const Recipe recipe = parse_recipe(R"({"steps": []})", "r.json");
  CHECK(recipe.keep.corners);
  CHECK(recipe.keep.lines);
  CHECK(recipe.keep.smooth_joins);
  CHECK(recipe.keep.extrema);
  CHECK(recipe.keep.zones_auto);
  CHECK(recipe.keep.area == KeepArea::Glyph);
  CHECK(recipe.on_crossing == OnCrossing::Reduce);
  CHECK(recipe.composites == glyphs::Composites::Refuse);
}

TEST_CASE("a recipe may let composites be decomposed", "[recipe]") {
  const auto composites = [](const std::string& what) {
    return R"({"steps": [], "emit": {"composites": ")" + what + "\"}}";
  };
  CHECK(parse_recipe(composites("decompose"), "r.json").composites == glyphs::Composites::Decompose);
  CHECK(parse_recipe(composites("refuse"), "r.json").composites == glyphs::Composites::Refuse);
  CHECK(refusal(composites("keep")) == "r.json: emit.composites: \"keep\" is not one of \"refuse\", \"decompose\"");
}

TEST_CASE("unknown and repeated keys, wrong types and what cannot be honoured are refused by name", "[recipe]") {
  const std::string step = R"("near": [1, 2], "move": [3, 4], "breadth": 5)";
  CHECK(refusal(with_step(step)).empty());
  CHECK(refusal(R"({"steps": [], "glyhps": "a"})") == "r.json: glyhps: unknown key");
  CHECK(refusal(R"({"steps": [], "steps": []})") == "r.json: steps: given twice");
  CHECK(refusal(R"({"steps": []},)") == "r.json: not JSON: error near line 1");
  CHECK(refusal("{\n\"steps\": [}") == "r.json: not JSON: error near line 2");
  CHECK(refusal("[]") == "r.json: must be an object");
  CHECK(refusal("{}") == "r.json: steps: is missing");
  CHECK(refusal(with_step(step + R"(, "bredth": 5)")) == "r.json: steps[0].bredth: unknown key");
  CHECK(refusal(with_step(R"("near": [1], "move": [3, 4], "breadth": 5)")) ==
        "r.json: steps[0].near: must be two numbers, [x, y]");
  CHECK(refusal(with_step(R"("near": [1, 2], "move": [3, 4], "breadth": 0)")) ==
        "r.json: steps[0].breadth: must be positive");
  CHECK(refusal(with_step(step + R"(, "contour": -1)")) == "r.json: steps[0].contour: must be a whole number from 0");
  CHECK(refusal(R"({"steps": [{"op": "smooth", "scale": 60, "glyph": "a"}]})").empty());
  CHECK(refusal(R"({"steps": [{"op": "smooth", "scale": -1}]})") == "r.json: steps[0].scale: must not be negative");
  CHECK(refusal(R"({"steps": [{"op": "smooth", "scale": 6, "by": "level"}], "keep": {"corners": false}})").empty());
  CHECK(refusal(R"({"steps": [{"op": "smooth", "scale": 6, "by": "eye"}]})") ==
        "r.json: steps[0].by: \"eye\" is not one of \"energy\", \"level\"");
  const auto equalize = [](const std::string& bands) {
    return refusal(R"({"steps": [{"op": "equalize", "bands": )" + bands + "}]}");
  };
  CHECK(equalize(R"({"20": 0.5, "80.5": 1.3})").empty());
  CHECK(equalize(R"({"80": 0.5, "20": 1.3})") == "r.json: steps[0].bands.20: lengths must rise");
  CHECK(equalize(R"({"20 units": 0.5})") == "r.json: steps[0].bands.20 units: a band is named by a length");
  CHECK(equalize(R"({"20": -1})") == "r.json: steps[0].bands.20: a gain is a number from 0");
  CHECK(equalize("[1]") == "r.json: steps[0].bands: must be an object: {\"20\": 0.5, \"80\": 1.3}");
  const auto weight = [](const std::string& keys) { return refusal(R"({"steps": [{"op": "weight")" + keys + "}]}"); };
  CHECK(weight(R"(, "model": "b.json")").empty());
  CHECK(
      weight(R"(, "model": "b.json", "amount_x": 1.5, "amount_y": 0.5, "amount_thin": 0, "amount_serif": -1)").empty());
  CHECK(weight(R"(, "model": "b.json", "stem_x": 120, "stem_y": 90, "advance": "sidebearings", "detail": 60)").empty());
  CHECK(weight(R"(, "model": "b.json", "detail": -1)") == "r.json: steps[0].detail: must be positive");
  CHECK(weight("") == "r.json: steps[0].model: must name a weight model");
  CHECK(weight(R"(, "model": "b.json", "amount": 2.5)") == "r.json: steps[0].amount: must be from -1 to 2");
  CHECK(weight(R"(, "model": "b.json", "stem_x": 0)") == "r.json: steps[0].stem_x: must be positive");
  CHECK(weight(R"(, "model": "b.json", "contour": 0)") == "r.json: steps[0].contour: weight is of a whole glyph");
  CHECK(weight(R"(, "model": "b.json", "advance": "wide")") ==
        "r.json: steps[0].advance: \"wide\" is not one of \"keep\", \"sidebearings\", \"scale\", \"learnt\"");
  const auto character = [](const std::string& keys) {
    return refusal(R"({"steps": [{"op": "character")" + keys + "}]}");
  };
  CHECK(character(R"(, "library": "l.json")").empty());
  CHECK(
      character(
          R"(, "library": "l.json", "gain": -0.5, "add": true, "mirror": true, "straights": "spare", "joins": "hold")")
          .empty());
  CHECK(character("") == "r.json: steps[0].library: must name a library of detail");
  CHECK(character(R"(, "library": "l.json", "gain": "much")") == "r.json: steps[0].gain: must be a number");
  CHECK(character(R"(, "library": "l.json", "scale": 60)") == "r.json: steps[0].scale: unknown key");
  CHECK(refusal(R"({"steps": [], "emit": {"points": 0}})") ==
        "r.json: emit.points: is the most that a glyph may have: a whole number from 1 to 65535");
  CHECK(refusal(R"({"steps": [{"op": "swep"}]})") ==
        "r.json: steps[0].op: \"swep\" is not one of \"sweep\", \"smooth\", \"equalize\", \"soften\", "
        "\"character\", \"repeat\", \"weight\"");
  const auto repeat = [](const std::string& keys) { return refusal(R"({"steps": [{"op": "repeat")" + keys + "}]}"); };
  CHECK(repeat(R"(, "library": "e.json")").empty());
  CHECK(repeat(R"(, "library": "e.json", "within": 9, "mirror": false, "turn": true, "sizes": [0.8, 1.2])").empty());
  CHECK(repeat("") == "r.json: steps[0].library: must name an edit");
  CHECK(repeat(R"(, "library": "e.json", "within": 0)") ==
        "r.json: steps[0].within: must be positive, and at most 1000");
  CHECK(repeat(R"(, "library": "e.json", "sizes": [2, 1])") ==
        "r.json: steps[0].sizes: must be the smallest and the largest, from 0.01 to 100");
  CHECK(repeat(R"(, "library": "e.json", "gain": 1)") == "r.json: steps[0].gain: unknown key");
  const auto soften = [](const std::string& keys) { return refusal(R"({"steps": [{"op": "soften", )" + keys + "}]}"); };
  CHECK(soften(R"("radius": 20)").empty());
  CHECK(soften(R"("radius": 20, "glyph": "a", "contour": 0, "corners": [0, 7])").empty());
  CHECK(soften(R"("glyph": "a")") == "r.json: steps[0].radius: is missing");
  CHECK(soften(R"("radius": -1)") == "r.json: steps[0].radius: must not be negative");
  CHECK(soften(R"("radius": 1, "corners": [0])") ==
        "r.json: steps[0].corners: are points of one contour; \"contour\" is missing");
  CHECK(soften(R"("radius": 1, "contour": 0, "corners": 3)") ==
        "r.json: steps[0].corners: must be a list of point numbers");
  CHECK(soften(R"("radius": 1, "contour": 0, "corners": [1.5])") ==
        "r.json: steps[0].corners: a point number is a whole number from 0");
  CHECK(soften(R"("radius": 1, "scale": 3)") == "r.json: steps[0].scale: unknown key");
  CHECK(refusal(R"({"steps": [], "keep": {"length": true, "italic_angle": 11.5}})").empty());
  CHECK(refusal(R"({"steps": [], "keep": {"italic_angle": 75}})") ==
        "r.json: keep.italic_angle: must be from -60 to 60 degrees");
  const auto sweep = [](const std::string& rest) {
    return refusal(R"({"steps": [{"op": "sweep", "breadth": 90, )" + rest + "}]}");
  };
  CHECK(sweep(R"("handles": [{"near": [1, 2], "move": [3, 4]}, {"near": [5, 6], "move": [7, 8]}])").empty());
  const auto by_level = [](const std::string& rest) {
    return refusal(R"({"steps": [{"op": "sweep", "near": [1, 2], "move": [3, 4], )" + rest + "}]}");
  };
  CHECK(by_level(R"("level": 2.5, "grip": "control point")").empty());
  CHECK(by_level(R"("level": -1)") == "r.json: steps[0].level: must not be negative");
  CHECK(by_level(R"("level": 2, "breadth": 90)") == "r.json: steps[0].breadth: unknown key");
  CHECK(by_level(R"("breadth": 90, "grip": "curve")") == "r.json: steps[0].grip: unknown key");
  CHECK(sweep(R"("handles": [])") == "r.json: steps[0].handles: must be a list of {\"near\", \"move\"}");
  CHECK(sweep(R"("handles": [{"near": [1, 2]}])") == "r.json: steps[0].handles[0].move: is missing");
  CHECK(sweep(R"("near": [1, 2], "move": [3, 4], "detail": "round")") ==
        "r.json: steps[0].detail: \"round\" is not one of \"xy\", \"tangent\", \"scaled tangent\"");
  const auto freeze = [](const std::string& entry) {
    return refusal(R"({"steps": [], "keep": {"freeze": [)" + entry + "]}}");
  };
  CHECK(freeze(R"({"glyph": "a", "contour": 0, "from": [1, 2], "to": [3, 4]})").empty());
  CHECK(freeze(R"({"box": [0, 0, 100, 200]})").empty());
  CHECK(freeze(R"({"glyph": "a"})") == "r.json: keep.freeze[0].from: is missing");
  CHECK(freeze(R"({"box": [0, 0]})") == "r.json: keep.freeze[0].box: must be four numbers, [left, bottom, right, top]");
  CHECK(freeze(R"({"box": [0, 0, 1, 1], "from": [1, 2]})") == "r.json: keep.freeze[0].from: unknown key");
  CHECK(refusal(R"({"steps": [], "keep": {"area": "all"}})") ==
        "r.json: keep.area: \"all\" is not one of \"glyph\", \"contour\", \"none\"");
  CHECK(refusal(R"({"steps": [], "keep": {"zones": 7}})") ==
        "r.json: keep.zones: must be \"auto\", false or a list of heights");
  CHECK(refusal(R"({"steps": [], "emit": {"mode": "compact"}})").empty());
  CHECK(refusal(R"({"steps": [], "emit": {"mode": "small"}})") ==
        "r.json: emit.mode: \"small\" is not one of \"structure\", \"compact\"");
  CHECK(refusal(R"({"steps": [], "seed": -1})") == "r.json: seed: must be a whole number from 0");
}

TEST_CASE("a recipe that cannot be read is named", "[recipe]") {
  CHECK_THROWS_AS(load_recipe(std::string(GLYPHWAVE_SOURCE_DIR) + "/no such recipe.json"), RequestError);
  CHECK_THROWS_AS(load_recipe(GLYPHWAVE_SOURCE_DIR), RequestError);
}

TEST_CASE("a recipe larger than any is refused before it fills the memory", "[recipe]") {
  std::string keys;
  for (int key = 0; key < 2000; ++key) keys += fontcore::text(key ? "," : "", '"', key, "\": 0");
  for (const std::string& json : {std::string(100'000, '['), "{" + keys + "}", std::string(17'000'000, ' ')}) {
    CHECK_THROWS_AS(parse_recipe(json, "large.json"), RequestError);
  }
}

TEST_CASE("glyphs are selected by name, code point, range and glyph id, each once", "[recipe]") {
  const int a = serif().find("a");
  const int b = serif().find("b");
  CHECK(select_glyphs(serif(), "b,a, a") == std::vector<int>{a, b});
  CHECK(select_glyphs(serif(), "U+0061-0062") == std::vector<int>{a, b});
  CHECK(select_glyphs(serif(), "u+0061-U+0062,U+61") == std::vector<int>{a, b});
  CHECK(select_glyphs(serif(), "gid:" + std::to_string(a)) == std::vector<int>{a});
  CHECK(select_glyphs(serif(), "").size() > 2000);
}

TEST_CASE("a selection that finds nothing is refused with what was sought", "[recipe]") {
  for (const std::string selection :
       {"nosuchglyph", "U+E0FF", "U+110000", "U+xyz", "U+0062-0061", "gid:99999", "gid:1x", "@/no such file", ","}) {
    CHECK_THROWS_AS(select_glyphs(serif(), selection), RequestError);
  }
}
