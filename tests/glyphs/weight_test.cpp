#include "glyphs/weight.h"

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/detail_library.h"
#include "glyphs/error.h"
#include "glyphs/recipe.h"
#include "glyphs/restyle.h"
#include "glyphs/reweight.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;
using fontcore::BezierContour;
using fontcore::LetterClass;
using fontcore::WeightModel;

namespace {

const std::string four = "n,o,H,O";

struct Family {
  std::string regular, bold;
};
const Family open_sans{bundled_font("open-sans/OpenSans-Regular.ttf"), bundled_font("open-sans/OpenSans-Bold.ttf")};
const Family liberation_serif{bundled_font("liberation-serif/LiberationSerif-Regular.ttf"),
                              bundled_font("liberation-serif/LiberationSerif-Bold.ttf")};
const Family cabin{bundled_font("cabin/Cabin-Regular.otf"), bundled_font("cabin/Cabin-Bold.otf")};

WeightModel model_of(const Family& family, const std::string& controls = four) {
  return learn_weight(load_font(family.regular), load_font(family.bold), controls);
}

int glyph_of(const Font& font, char letter) { return font.character_map.at(static_cast<char32_t>(letter)); }

/// The font with the outlines of all but some letters gone.
Font with_letters_only(Font font, const std::string& kept) {
  std::vector<bool> stays(font.glyphs.size(), false);
  for (const char letter : kept) stays[static_cast<std::size_t>(glyph_of(font, letter))] = true;
  for (std::size_t i = 0; i < font.glyphs.size(); ++i) {
    if (stays[i]) continue;
    font.glyphs[i].contours.clear();
    font.glyphs[i].components.clear();
  }
  return font;
}

bool is_whole(const BezierContour& contour) {
  for (int i = 0; i < contour.point_count(); ++i) {
    if (contour.kind(i) != fontcore::PointKind::ImpliedNode &&
        contour.point(i) != fontcore::Point(contour.point(i).array().round())) {
      return false;
    }
  }
  return true;
}

/// A glyph in another weight, as `reweight` has it.
std::vector<BezierContour> reweighted(const Font& font, int glyph, const WeightModel& model, double amount,
                                      ReweightedGlyph& report) {
  std::vector<std::vector<int>> came_from;
  return reweight_glyph(font, glyph, model, {.x = amount, .y = amount}, {}, report, came_from);
}

std::string refusal(const std::string& json) {
  try {
    parse_weight(json, "m.json");
  } catch (const RequestError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a weight model is learnt from the control letters alone", "[weight]") {
  for (const Family& family : {open_sans, liberation_serif, cabin}) {
    CAPTURE(family.regular);
    const std::string whole = weight_json(model_of(family));
    const WeightModel alone = learn_weight(with_letters_only(load_font(family.regular), "noHO"),
                                           with_letters_only(load_font(family.bold), "noHO"), four);
    CHECK(weight_json(alone) == whole);
  }
}

TEST_CASE("a weight model is small, names no file, and reads back as it was written", "[weight]") {
  const std::string json = weight_json(model_of(liberation_serif));
  CHECK(json.size() < 16384);
  CHECK(json.find("Liberation") == std::string::npos);
  CHECK(json.find('/') == json.find("/1000"));
  CHECK(weight_json(parse_weight(json, "m.json")) == json);
}

TEST_CASE("a weight model that is none is refused by file and key", "[weight]") {
  const nlohmann::json good = nlohmann::json::parse(weight_json(model_of(open_sans)));
  CHECK(refusal(good.dump()).empty());
  CHECK(refusal("{").starts_with("m.json: "));
  CHECK(refusal("[]") == "m.json: must be an object");
  const auto changed = [&](const auto& change) {
    nlohmann::json json = good;
    change(json);
    return refusal(json.dump());
  };
  CHECK(changed([](auto& j) { j["colour"] = 1; }) == "m.json: colour: unknown key");
  CHECK(changed([](auto& j) { j.erase("top"); }) == "m.json: top: is missing");
  CHECK(changed([](auto& j) { j["version"] = 2; }) == "m.json: format: no weight model of this version");
  CHECK(changed([](auto& j) { j["capitals"]["upright"]["thickness"] = 0; }) ==
        "m.json: capitals.upright.thickness: must be positive");
  CHECK(changed([](auto& j) { j["capitals"]["serif"] = "much"; }) ==
        "m.json: capitals.serif: must be a number of at most a million");
  CHECK(changed([](auto& j) { j["lower_case"]["correction"][1].erase(0); }) ==
        "m.json: lower_case.correction[1]: must be a list of 7");
  CHECK(changed([](auto& j) { j["widths"][0] = 21; }) == "m.json: widths: must be the places of this version");
}

TEST_CASE("letters in the learnt weight have the areas of those that were drawn", "[weight]") {
  for (const Family& family : {open_sans, liberation_serif, cabin}) {
    CAPTURE(family.regular);
    const Font regular = load_font(family.regular);
    const Font bold = load_font(family.bold);
    const WeightModel model = learn_weight(regular, bold, four);
    double sum = 0.0;
    int count = 0;
    for (const char letter : letters) {
      if (four.find(letter) != std::string::npos) continue;
      const int id = glyph_of(regular, letter);
      ReweightedGlyph report;
      const auto made = reweighted(regular, id, model, 1.0, report);
      CHECK(report.refused.empty());
      const double unit = static_cast<double>(bold.units_per_em) / regular.units_per_em;
      const double drawn = measure_ink(compose(bold, glyph_of(bold, letter))).area / (unit * unit);
      sum += std::abs(measure_ink(made).area / drawn - 1.0);
      ++count;
    }
    CHECK(sum / count < 0.035);
  }
}

TEST_CASE("letters keep their structure, counters and simplicity in every weight", "[weight]") {
  const Font font = load_font(liberation_serif.regular);
  const WeightModel model = model_of(liberation_serif);
  for (const double amount : {-0.5, 0.5, 1.0, 1.5}) {
    for (const char letter : letters) {
      CAPTURE(amount, letter);
      const int id = glyph_of(font, letter);
      const auto& before = font.glyphs[static_cast<std::size_t>(id)].contours;
      if (before.empty()) continue;
      ReweightedGlyph report;
      const auto after = reweighted(font, id, model, amount, report);
      REQUIRE(after.size() == before.size());
      for (std::size_t c = 0; c < after.size(); ++c) {
        CHECK(has_same_structure(after[c], before[c]));
        CHECK(is_whole(after[c]));
      }
      const auto crossings = find_crossings(before);
      const auto crossings_after = find_crossings(after);
      CHECK(added_crossings(crossings, crossings_after) == 0);
      const fontcore::Ink ink = measure_ink(before, crossings);
      const fontcore::Ink ink_after = measure_ink(after, crossings_after);
      CHECK(closed_counters(ink, ink_after).empty());
      CHECK((amount > 0.0 ? ink_after.area >= ink.area : ink_after.area <= ink.area));
    }
  }
}

TEST_CASE("a font at amount 0 is the file itself", "[weight]") {
  for (const Family& family : {open_sans, cabin}) {
    const Font font = load_font(family.regular);
    ReweightOptions options;
    options.strength.amount = 0.0;
    const ReweightResult result = reweight(font, model_of(family), options);
    CHECK(result.changed() == 0);
    CHECK(result.font.data == *font.data);
  }
}

TEST_CASE("a font in another weight has the same bytes for every number of threads", "[weight]") {
  const Font font = load_font(cabin.regular);
  const WeightModel model = model_of(cabin);
  ReweightOptions options;
  options.only = select_glyphs(font, "U+0041-005A,U+0061-007A");
  options.jobs.jobs = 1;
  const ReweightResult one = reweight(font, model, options);
  options.jobs.jobs = 3;
  const ReweightResult three = reweight(font, model, options);
  CHECK(one.font.data == three.font.data);
  CHECK(one.changed() == 52);
  CHECK(reweight_json(font, options, one) == reweight_json(font, options, three));
}

TEST_CASE("a step learnt in one family is put on another, in another unit", "[weight]") {
  const Font other = load_font(cabin.regular);       // 2000 units per em
  const Font source = load_font(open_sans.regular);  // 2048
  const WeightModel model = model_of(open_sans);
  const auto growth = [&](const Font& font, char letter) {
    ReweightedGlyph report;
    const auto made = reweighted(font, glyph_of(font, letter), model, 1.0, report);
    return measure_ink(made).area / measure_ink(font.glyphs[static_cast<std::size_t>(report.glyph)].contours).area;
  };
  for (const char letter : std::string("noHOaegs"))
    CHECK(growth(other, letter) == Approx(growth(source, letter)).epsilon(0.1));
}

TEST_CASE("lower case is told from capitals and figures by characters", "[weight]") {
  const Font font = load_font(open_sans.regular);
  for (const char letter : std::string("xgn"))
    CHECK(letter_class_of(font, glyph_of(font, letter)) == LetterClass::LowerCase);
  for (const char letter : std::string("XGN07"))
    CHECK(letter_class_of(font, glyph_of(font, letter)) == LetterClass::Capital);
}

TEST_CASE("control letters that a font lacks are refused by name", "[weight]") {
  const Font regular = load_font(open_sans.regular);
  const Font bold = load_font(open_sans.bold);
  const auto why = [&](const std::string& controls) -> std::string {
    try {
      learn_weight(regular, bold, controls);
    } catch (const RequestError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(why("n,nosuchglyph").ends_with("control letter nosuchglyph: there is no such glyph"));
  CHECK(why("n,space").ends_with("control letter space: it has no outline"));
  CHECK(why("") == "--control: letters are expected: n,o,H,O");
  CHECK(why("n,o").empty());
}

TEST_CASE("a prior says how single letters differ in other families, and a control letter overrules it", "[weight]") {
  const std::vector<WeightFamily> families = {
      {"Open Sans", load_font(open_sans.regular), load_font(open_sans.bold)},
      {"Cabin", load_font(cabin.regular), load_font(cabin.bold)},
      {"Liberation Serif", load_font(liberation_serif.regular), load_font(liberation_serif.bold)}};
  const WeightPrior prior = learn_prior(families, four);
  CHECK(prior.families == std::vector<std::string>{"Open Sans", "Cabin", "Liberation Serif"});
  CHECK(prior.even.contains("k"));
  CHECK_FALSE(prior.even.contains("n"));
  CHECK(prior.contrasted.empty());  // of one family nothing is known
  CHECK(prior_json(parse_prior(prior_json(prior), "p.json")) == prior_json(prior));
  CHECK(latin_prior().even.at("k") > 0.2);
  CHECK(latin_prior().contrasted.size() > 40);
  CHECK_THROWS_AS(parse_prior(R"({"format": "glyphwave weight prior"})", "p.json"), RequestError);

  const Font& font = families[0].from;
  WeightModel model = model_of(open_sans, "n,o,k");
  take_prior(model, prior);
  CHECK_FALSE(model.widening.contains("k"));
  CHECK(model.widening.contains("C"));
  CHECK(weight_json(parse_weight(weight_json(model), "m.json")) == weight_json(model));

  // Widened by a stem's growth a letter is as much wider, and its strokes are as they were.
  const auto width = [&](double widening) {
    model.widening["E"] = widening;
    ReweightedGlyph report;
    const auto made = reweighted(font, glyph_of(font, 'E'), model, 1.0, report);
    return tight_box(made[0]).high.x() - tight_box(made[0]).low.x();
  };
  const double growth = model.letters[1].upright.growth * font.units_per_em / 1000.0;
  CHECK(width(0.5) - width(0.0) == Approx(0.5 * growth).epsilon(0.3));
}

namespace {

Recipe weight_recipe(const WeightModel& model, const WeightStrength& strength = {}) {
  Recipe recipe;
  recipe.glyphs = "U+0041-005A,U+0061-007A";
  recipe.steps.emplace_back(WeightStep{.model = std::make_shared<const WeightModel>(model), .strength = strength});
  return recipe;
}

}  // namespace

TEST_CASE("a step of weight in a recipe makes the area that it is held to", "[weight]") {
  for (const Family& family : {open_sans, liberation_serif, cabin}) {
    CAPTURE(family.regular);
    const Font font = load_font(family.regular);
    const WeightModel model = model_of(family);
    const RestyleResult restyled = restyle(font, weight_recipe(model));
    CHECK(restyled.changed() == 52);
    CHECK(restyled.spacing.advances.empty());
    ReweightOptions options;
    options.only = select_glyphs(font, weight_recipe(model).glyphs);
    const ReweightResult applied = reweight(font, model, options);
    for (std::size_t k = 0; k < restyled.glyphs.size(); ++k) {
      const GlyphReport& report = restyled.glyphs[k];
      CAPTURE(report.name);
      CHECK(report.crossings_after <= report.crossings_before);
      CHECK(report.closed_counters == 0);
      CHECK(std::abs(report.area_after) > std::abs(report.area_before));
      CHECK(report.area_target == Approx(report.area_unrounded).epsilon(1e-9));
      CHECK(report.area_after == Approx(report.area_target).epsilon(3e-3));
      if (report.amount * report.steps.at(0).share == applied.glyphs[k].share) {  // both take as much of the step
        CHECK(report.area_after == Approx(applied.glyphs[k].area_after).epsilon(0.02));
      }
      CHECK(report.segments_after == report.segments_before);
      CHECK(report.steps.at(0).op == "weight");
    }
  }
}

TEST_CASE("texture rides along unthickened: a rough letter gains the ink that the plain one gains", "[weight]") {
  const Font font = load_font(open_sans.regular);
  const WeightModel model = model_of(open_sans);
  const auto gains = [&](std::optional<double> detail_scale) {
    Recipe recipe = weight_recipe(model);
    recipe.glyphs = is_sanitized ? "n,o" : "a,n,o,e,H";
    if (detail_scale) {
      CharacterStep brush;
      brush.library = load_library(bundled_font("libraries/dry_brush.json"));
      recipe.steps.insert(recipe.steps.begin(), brush);
      std::get<WeightStep>(recipe.steps.back()).detail_scale = *detail_scale;
    }
    std::vector<double> result;
    for (const GlyphReport& report : restyle(font, recipe).glyphs) {
      CHECK(report.refused.empty());
      result.push_back(std::abs(report.area_after) - std::abs(report.area_before));
    }
    return result;
  };
  const std::vector<double> plain = gains({});
  const std::vector<double> carried = gains(120.0);
  const std::vector<double> thickened = gains(0.0);
  REQUIRE(plain.size() == (is_sanitized ? 2U : 5U));
  for (std::size_t k = 0; k < plain.size(); ++k) {
    CAPTURE(k, plain[k], carried[k], thickened[k]);
    CHECK(carried[k] == Approx(plain[k]).epsilon(0.06));
    CHECK(std::abs(carried[k] - plain[k]) < std::abs(thickened[k] - plain[k]));
  }
}

TEST_CASE("a step of weight of nothing changes nothing, bit for bit", "[weight]") {
  const Font font = load_font(open_sans.regular);
  const RestyleResult result = restyle(font, weight_recipe(model_of(open_sans), {.amount = 0.0}));
  CHECK(result.changed() == 0);
  CHECK(result.font.data == *font.data);
}

TEST_CASE("steps behind a step of weight keep the area and the heights that it made", "[weight]") {
  const Font font = load_font(open_sans.regular);
  Recipe recipe = weight_recipe(model_of(open_sans));
  const int n = glyph_of(font, 'n');
  const std::vector<double> zones = alignment_zones(font);
  const GlyphResult weighed = restyle_glyph(font, n, recipe, zones);
  recipe.steps.emplace_back(SweepStep{.near = {1100, 500}, .move = {20, 0}, .breadth = 500});
  const GlyphResult swept = restyle_glyph(font, n, recipe, zones);
  REQUIRE(swept.report.refused.empty());
  CHECK(swept.contours != weighed.contours);
  CHECK(swept.report.area_target == Approx(weighed.report.area_target).epsilon(1e-9));
  CHECK(swept.report.area_unrounded == Approx(weighed.report.area_target).epsilon(1e-9));
  for (std::size_t c = 0; c < swept.contours.size(); ++c) {
    CHECK(tight_box(swept.unrounded[c]).high.y() == Approx(tight_box(weighed.unrounded[c]).high.y()).margin(1e-9));
  }
}

TEST_CASE("what is frozen stays through a step of weight", "[weight]") {
  const Font font = load_font(open_sans.regular);
  Recipe recipe = weight_recipe(model_of(open_sans));
  fontcore::Box foot;
  foot.add(fontcore::Point(0, -10));
  foot.add(fontcore::Point(500, 10));
  recipe.keep.freeze.push_back({.glyph = "n", .box = foot});
  const int n = glyph_of(font, 'n');
  const GlyphResult result = restyle_glyph(font, n, recipe);
  REQUIRE(result.report.refused.empty());
  REQUIRE(result.report.changed);
  const BezierContour& before = font.glyphs[static_cast<std::size_t>(n)].contours.at(0);
  const BezierContour& after = result.contours.at(0);
  int held = 0;
  for (int i = 0; i < before.point_count(); ++i) {
    const fontcore::Point p = before.point(i);
    if (p.x() > 500 || std::abs(p.y()) > 10) continue;
    CHECK(after.point(i) == p);
    ++held;
  }
  CHECK(held >= 2);
  CHECK(std::abs(result.report.area_after) > std::abs(result.report.area_before));
}

TEST_CASE("compact emission of a weight has fewer segments, and stays by the outline of its own points", "[weight]") {
  for (const Family& family : {open_sans, cabin}) {
    CAPTURE(family.regular);
    const Font font = load_font(family.regular);
    const WeightModel model = model_of(family);
    ReweightOptions options;
    options.only = select_glyphs(font, "U+0041-005A,U+0061-007A");
    options.emission = Emission::Compact;
    options.tolerance = 2.0;
    const ReweightResult compact = reweight(font, model, options);
    const Font after = load_font_bytes("after", compact.font.data);
    int before_count = 0;
    int after_count = 0;
    for (const ReweightedGlyph& report : compact.glyphs) {
      CAPTURE(report.name);
      CHECK(report.crossings_after <= report.crossings_before);
      CHECK(report.segments_after <= report.segments_before);
      before_count += report.segments_before;
      after_count += report.segments_after;
      ReweightedGlyph own;
      const auto& contours = after.glyphs[static_cast<std::size_t>(report.glyph)].contours;
      const auto structured = reweighted(font, report.glyph, model, 1.0, own);
      for (std::size_t c = 0; c < contours.size(); ++c) {
        // A unit for the whole numbers of either.
        CHECK(fontcore::two_sided_distance(to_polyline(contours[c], 5.0), to_polyline(structured[c], 5.0)) < 3.0);
      }
    }
    CHECK(after_count < before_count);
  }
}

TEST_CASE("stems come out as thick as wished", "[weight]") {
  const Font font = load_font(open_sans.regular);
  const WeightModel model = model_of(open_sans);
  WeightStrength strength;
  strength.stems = {.upright = 240.0, .level = 190.0};
  ReweightOptions options;
  options.strength = strength;
  options.only = select_glyphs(font, "n,o");
  const Font after = load_font_bytes("after", reweight(font, model, options).font.data);
  const fontcore::StemWidths made = fontcore::measure_stems(
      std::vector{compose(after, glyph_of(after, 'n')), compose(after, glyph_of(after, 'o'))}, after.units_per_em);
  CHECK(made.upright.value() == Approx(240.0).margin(1.5));
  CHECK(made.level.value() == Approx(190.0).margin(1.5));
  strength.stems.upright = 2000.0;
  CHECK_THROWS_AS(amounts_in(font, model, strength), RequestError);
}

TEST_CASE("a step carried to another family with its n and o drawn comes nearer than the step as it is", "[weight]") {
  const Font font = load_font(cabin.regular);
  const Font bold = load_font(cabin.bold);
  const WeightModel model = model_of(open_sans);
  const auto error = [&](const WeightModel& applied) {
    double sum = 0.0;
    for (const char letter : std::string("abdeghpqucsDBEFLPR")) {
      ReweightedGlyph report;
      const auto made = reweighted(font, glyph_of(font, letter), applied, 1.0, report);
      sum += std::abs(measure_ink(made).area / measure_ink(compose(bold, glyph_of(bold, letter))).area - 1.0);
    }
    return sum / 18;
  };
  CHECK(error(carry_weight(font, model, &bold)) < 0.04);
  CHECK(error(carry_weight(font, model, &bold)) < 0.5 * error(model));
  const WeightModel own = carry_weight(font, model);  // nothing of it is drawn
  CHECK(own.letters[0].upright.thickness == Approx(carry_weight(font, model, &bold).letters[0].upright.thickness));
}
