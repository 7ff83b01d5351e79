// Detail of a hand on real letters: what is written has the texture, its area and its corners, and crosses nowhere.

#include "fontcore/character.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <set>

#include "fontcore/crossing.h"
#include "fontcore/measure.h"
#include "glyphs/detail_library.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/sanitizer.h"

using namespace glyphs;
using fontcore::BezierContour;
using fontcore::DetailLibrary;
using fontcore::InkSide;
using fontcore::Point;

namespace {

/// Roughness of wavelengths from 20 to 50 thousandths of the em.
DetailLibrary roughness(double amplitude) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  constexpr double length = 4000.0;
  fontcore::Points offsets = fontcore::Points::Zero(2400, 2);
  constexpr int first = 80;
  constexpr int last = 200;
  for (int k = first; k <= last; ++k) {
    const double start = phase(random);
    for (Eigen::Index i = 0; i < offsets.rows(); ++i) {
      offsets(i, 1) += std::sin(2.0 * std::numbers::pi * k * static_cast<double>(i) / 2400.0 + start);
    }
  }
  offsets *= amplitude * std::sqrt(2.0 / (last - first + 1));
  DetailLibrary library{.name = "roughness", .scale = 120.0};
  library.samples.push_back({.length = length, .is_closed = true, .offsets = offsets});
  return library;
}

Recipe laying(DetailLibrary library, double gain = 1.0) {
  Recipe recipe;
  recipe.steps.emplace_back(CharacterStep{.library_path = "library.json",
                                          .library = std::make_shared<const DetailLibrary>(std::move(library)),
                                          .gain = gain});
  recipe.tolerance = 1.0;
  return recipe;
}

const Glyph& glyph_of(const Font& font, char letter) {
  return font.glyphs[static_cast<std::size_t>(font.character_map.at(static_cast<char32_t>(letter)))];
}

bool has_segment(const std::vector<BezierContour>& contours, const fontcore::Bezier& wanted) {
  for (const BezierContour& contour : contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      if (contour.segment(s).degree == wanted.degree && contour.segment(s).p == wanted.p) return true;
    }
  }
  return false;
}

/// How far the bases of an outline's arcs are from those of a textured one, looked at without knowing what was laid; in
/// both its corners are the same points.
double blind_move(const BezierContour& plain, const BezierContour& textured, double scale) {
  const fontcore::OutlineArcs before = arcs_at_scale(plain, scale);
  fontcore::OutlineCurveOptions same;
  same.corner_angle = same.line_angle = 7.0;  // none but those named
  for (const auto& arc : before.arcs()) {
    const Point corner = plain.point(plain.node(arc.segments[0]));
    for (int i = 0; i < textured.point_count() && before.has_corner(); ++i) {
      if (is_node(textured.kind(i)) && textured.point(i) == corner) same.corners.push_back(i);
    }
  }
  const fontcore::OutlineArcs after(textured, same);
  if (before.arcs().size() != after.arcs().size()) return std::numeric_limits<double>::infinity();
  double most = 0.0;
  for (const auto& arc : before.arcs()) {
    if (arc.length < scale) continue;
    const auto base = [&](const fontcore::OutlineArcs& outline, const fontcore::OutlineArcs::Arc& on) {
      const auto index = static_cast<int>(&on - outline.arcs().data());
      return fontcore::DetailBase(points_along(outline, index, 1200), !outline.has_corner(), scale).points();
    };
    const Point start = plain.point(plain.node(arc.segments[0]));
    for (const auto& other : after.arcs()) {
      const Point there = textured.point(textured.node(other.segments[0]));
      if (before.has_corner() && there != start) continue;
      most = std::max(most, fontcore::two_sided_distance(base(before, arc), base(after, other)));
    }
  }
  return most;
}

}  // namespace

TEST_CASE("a library is what its file says", "[character]") {
  const Font font = load_font(bundled_ttf[0]);
  for (const auto frame :
       {fontcore::DetailFrame::Fixed, fontcore::DetailFrame::Tangent, fontcore::DetailFrame::ScaledTangent}) {
    for (const bool by_shape : {false, true}) {
      const ExtractOptions options{.scale = 200, .frame = frame, .by_shape = by_shape, .name = "own \"hand\""};
      const DetailLibrary library = extract_library(font, {glyph_of(font, 'o').id, glyph_of(font, 's').id}, options);
      const std::string json = library_json(library);
      const DetailLibrary back = parse_library(json, "l.json");
      CHECK(library_json(back) == json);
      CHECK(back.name == library.name);
      CHECK(back.scale == 200.0);
      CHECK(back.units_per_em == 2048.0);
      CHECK(back.frame == frame);
      REQUIRE(back.samples.size() == library.samples.size());
      for (std::size_t k = 0; k < back.samples.size(); ++k) {
        CHECK(back.samples[k].place == library.samples[k].place);
        CHECK(back.samples[k].is_closed == library.samples[k].is_closed);
        CHECK((back.samples[k].offsets - library.samples[k].offsets).cwiseAbs().maxCoeff() <= 0.51e-4);
      }
    }
  }
}

TEST_CASE("a library's file is read whole or refused", "[character]") {
  const auto refusal = [](const std::string& json) {
    try {
      parse_library(json, "l.json");
    } catch (const RequestError& error) {
      return std::string(error.what());
    }
    return std::string("read");
  };
  const std::string head = R"({"version": 1, "kind": "detail", "unitsPerEm": 1000, "scale": 120, "samples": )";
  const std::string rows = R"("length": 80, "closed": true, "offsets": [[0,0],[0,1],[0,0],[0,-1]])";
  CHECK(refusal(head + "[{" + rows + "}]}") == "read");
  CHECK(refusal(head + "[{" + rows + R"(, "color": 1}]})") == "l.json: samples[0].color: unknown key");
  CHECK(refusal(head + "[]}") == "l.json: samples: must be a list of at least one");
  CHECK(refusal(head + R"([{"length": 80, "offsets": [[0,0]]}]})") ==
        "l.json: samples[0].offsets: has 1 rows, must have from 4 to 1000000");
  CHECK(refusal(head + R"([{"length": -1, "offsets": []}]})") ==
        "l.json: samples[0].length: must be positive, and at most 1000000");
  CHECK(refusal(R"({"version": 2})") == "l.json: version: is 2; this version of glyphwave reads 1");
  CHECK(refusal(R"({"version": 1, "kind": "weight"})") ==
        "l.json: kind: must be \"detail\": this is no library of detail");
  CHECK(refusal("[") == "l.json: not JSON: error near line 1");
}

TEST_CASE("textured letters keep area and corners and cross nowhere", "[character][slow]") {
  for (const std::string& path : bundled_fonts()) {
    const Font font = load_font(path);
    const double em = font.units_per_em;
    const Recipe recipe = laying(roughness(2.0));
    for (const char letter : std::string("aegnosMRS&8")) {
      const Glyph& glyph = glyph_of(font, letter);
      if (glyph.is_composite()) continue;
      const GlyphResult result = restyle_glyph(font, glyph.id, recipe);
      const GlyphReport& report = result.report;
      INFO(path << " " << glyph.name << " " << report.refused);
      CHECK(report.refused.empty());
      CHECK(report.amount == 1.0);
      CHECK(report.largest_displacement > 2.0 * em / 1000.0);
      CHECK(report.largest_displacement < 16.0 * em / 1000.0);
      CHECK(added_crossings(find_crossings(glyph.contours), find_crossings(result.contours)) == 0);
      CHECK(std::abs(report.area_unrounded - report.area_before) < 1e-9 * std::abs(report.area_before));
      CHECK(std::abs(report.area_after - report.area_before) < 1e-3 * std::abs(report.area_before));
      CHECK(report.deviation < std::max(2.0, 1.5e-3 * em));
      for (const StepReport& step : report.steps) CHECK(step.base_move < 0.05 * em / 1000.0);
      // Corners are the font's own points still.
      std::set<std::pair<double, double>> points;
      for (const BezierContour& contour : result.contours) {
        for (int i = 0; i < contour.point_count(); ++i) points.emplace(contour.point(i).x(), contour.point(i).y());
      }
      for (const BezierContour& contour : glyph.contours) {
        const fontcore::OutlineArcs outline = arcs_at_scale(contour, 0.12 * em);
        const fontcore::OutlineArcs own(contour);
        for (const auto& arc : outline.arcs()) {
          if (!own.is_corner(arc.segments[0])) continue;
          const Point corner = contour.point(contour.node(arc.segments[0]));
          CHECK(points.contains({corner.x(), corner.y()}));
        }
      }
    }
  }
}

TEST_CASE("a letter gets its own detail back", "[character]") {
  for (const std::string& path : {bundled_ttf[0], bundled_otf[2]}) {
    const Font font = load_font(path);
    const double scale = 0.15 * font.units_per_em;
    for (const char letter : std::string("oagS&")) {
      const Glyph& glyph = glyph_of(font, letter);
      DetailLibrary library;
      try {
        library = parse_library(library_json(extract_library(font, {glyph.id}, {.scale = scale})), "l.json");
      } catch (const RequestError&) {
        continue;  // no arc of it is as long as the scale
      }
      const GlyphResult result = restyle_glyph(font, glyph.id, laying(library));
      INFO(path << " " << letter);
      REQUIRE(result.report.refused.empty());
      for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
        if (result.unrounded[k] == glyph.contours[k]) continue;
        CHECK(farthest(result.unrounded[k], glyph.contours[k], 0.002).distance < 0.05e-3 * font.units_per_em);
      }
    }
  }
}

TEST_CASE("frozen stretches and spared straights of a textured letter stay bit for bit", "[character]") {
  for (const std::string& path : {bundled_ttf[2], bundled_otf[0]}) {
    const Font font = load_font(path);
    const Glyph& glyph = glyph_of(font, 'n');
    Recipe recipe = laying(roughness(2.0));
    std::get<CharacterStep>(recipe.steps[0]).spares_lines = true;
    const GlyphResult spared = restyle_glyph(font, glyph.id, recipe);
    REQUIRE(spared.report.changed);
    const double half_scale = 0.06 * font.units_per_em;
    int lines = 0;
    int curves = 0;
    for (const BezierContour& contour : glyph.contours) {
      for (int s = 0; s < contour.segment_count(); ++s) {
        const fontcore::Bezier segment = contour.segment(s);
        if (segment.degree > 1) curves += has_segment(spared.contours, segment) ? 0 : 1;
        if (segment.degree != 1 || (segment.end() - segment.start()).norm() < half_scale) continue;
        ++lines;
        CHECK(has_segment(spared.contours, segment));
      }
    }
    CHECK(lines > 4);
    CHECK(curves > 2);

    // Half of the letter is frozen.
    Recipe freezing = laying(roughness(2.0));
    const fontcore::Box box = control_box(glyph.contours[0]);
    Freeze freeze;
    freeze.box.emplace();
    freeze.box->add(Point(box.low.x() - 1, box.low.y() - 1));
    freeze.box->add(Point(0.5 * (box.low.x() + box.high.x()), box.high.y() + 1));
    freezing.keep.freeze.push_back(freeze);
    const GlyphResult frozen = restyle_glyph(font, glyph.id, freezing);
    REQUIRE(frozen.report.changed);
    int inside = 0;
    for (int s = 0; s < glyph.contours[0].segment_count(); ++s) {
      const fontcore::Bezier segment = glyph.contours[0].segment(s);
      if (std::max({segment.p[0].x(), segment.p[1].x(), segment.end().x()}) > freeze.box->high.x()) continue;
      if (segment.degree == 3 && segment.p[2].x() > freeze.box->high.x()) continue;
      ++inside;
      CHECK(has_segment(frozen.contours, segment));
    }
    CHECK(inside > 3);
  }
}

TEST_CASE("a glyph may have so many points and no more", "[character]") {
  const Font font = load_font(bundled_otf[2]);
  const int id = glyph_of(font, 'S').id;
  Recipe recipe = laying(roughness(2.0));
  const auto points = [](const GlyphResult& result) {
    std::ptrdiff_t sum = 0;
    for (const BezierContour& contour : result.contours) sum += contour.point_count();
    return sum;
  };
  const GlyphResult all = restyle_glyph(font, id, recipe);
  CHECK(points(all) > 250);
  recipe.most_points = 200;
  const GlyphResult few = restyle_glyph(font, id, recipe);
  REQUIRE(few.report.changed);
  CHECK(points(few) <= 200);
  CHECK(few.report.steps[0].finest > 0.0);
  CHECK(few.report.notes[0].find("are left out") != std::string::npos);
  recipe.most_points = 5;
  CHECK(restyle_glyph(font, id, recipe).report.refused.find("more than 5") != std::string::npos);
}

TEST_CASE("a textured font is one that others take, the same for every number of threads", "[character][slow]") {
  for (const std::string& path : {bundled_ttf[0], bundled_otf[0]}) {
    const Font font = load_font(path);
    Recipe recipe = laying(roughness(2.0));
    recipe.glyphs = "U+0041-005A,U+0061-007A";
    RestyleOptions one;
    one.jobs.jobs = 1;
    RestyleOptions three;
    three.jobs.jobs = 3;
    const RestyleResult result = restyle(font, recipe, one);
    CHECK(result.refused() == 0);
    CHECK(restyle(font, recipe, three).font.data == result.font.data);
    CHECK(is_accepted_by_sanitizer(result.font.data));
    recipe.seed = 2;
    CHECK(restyle(font, recipe, one).font.data != result.font.data);
  }
}

TEST_CASE("steps before and after a texture work on the outline as it stands", "[character]") {
  const Font font = load_font(bundled_otf[0]);
  const int id = glyph_of(font, 'a').id;
  Recipe recipe = laying(roughness(2.0));
  const Step character = recipe.steps[0];
  recipe.steps = {SweepStep{.near = {300, 300}, .move = {12, -8}, .breadth = 400}, character, SmoothStep{.scale = 20}};
  const GlyphResult result = restyle_glyph(font, id, recipe);
  CHECK(result.report.refused.empty());
  CHECK(result.report.changed);
  CHECK(std::abs(result.report.area_after - result.report.area_before) < 1e-3 * std::abs(result.report.area_before));
}

TEST_CASE("ink is on the left of PostScript contours and on the right of TrueType ones", "[character]") {
  for (const std::string& path : bundled_fonts()) {
    const Font font = load_font(path);
    const InkSide wanted = font.format == OutlineFormat::TrueType ? InkSide::Right : InkSide::Left;
    for (const char letter : std::string("aegoB8&")) {
      const Glyph& glyph = glyph_of(font, letter);
      for (std::size_t k = 0; k < glyph.contours.size(); ++k) CHECK(ink_side(glyph.contours, k) == wanted);
    }
  }
}

TEST_CASE("every bundled library is one that fonts can be given", "[character]") {
  const Font font = load_font(bundled_otf[0]);
  for (const char* name : {"dry_brush", "ink", "scallop", "garamond"}) {
    INFO(name);
    const auto library = load_library(bundled_font(std::string("libraries/") + name + ".json"));
    CHECK(library->name.find(std::string(name).substr(0, 3)) == 0);
    for (const char letter : std::string("oH")) {
      const GlyphResult result = restyle_glyph(font, glyph_of(font, letter).id, laying(*library));
      CHECK(result.report.refused.empty());
      CHECK(result.report.changed);
      CHECK(result.report.crossings_after == 0);
    }
  }
}

TEST_CASE("composites of textured parts cross no more than before", "[character]") {
  const Font font = load_font(bundled_ttf[0]);
  Recipe recipe = laying(*load_library(bundled_font("libraries/dry_brush.json")));
  recipe.glyphs = "A,ring";
  const RestyleResult result = restyle(font, recipe);
  CHECK(result.changed() == 2);
  const Font after = load_font_bytes("after.ttf", result.font.data);
  for (const char* name : {"Aring", "Aringacute"}) {
    const int id = font.find(name);
    const auto before = find_crossings(compose(font, id));
    CHECK(added_crossings(before, find_crossings(compose(after, id))) == 0);
  }
}

TEST_CASE("a texture looked at anew has the base of the plain outline", "[character]") {
  for (const char* name : {"dry_brush", "ink", "scallop"}) {
    const auto library = load_library(bundled_font(std::string("libraries/") + name + ".json"));
    const Recipe recipe = laying(*library);
    for (const std::string& path : bundled_fonts_for_long_work()) {
      const Font font = load_font(path);
      const double em = font.units_per_em;
      for (const char letter : std::string(is_sanitized ? "aoR" : "aegosR&")) {
        const Glyph& glyph = glyph_of(font, letter);
        if (glyph.is_composite()) continue;
        const GlyphResult result = restyle_glyph(font, glyph.id, recipe);
        REQUIRE(result.report.refused.empty());
        for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
          if (result.unrounded[k] == glyph.contours[k]) continue;
          INFO(name << " on " << path << " " << glyph.name << " " << k);
          CHECK(blind_move(glyph.contours[k], result.unrounded[k], 1e-3 * library->scale * em) < 1.5e-3 * em);
        }
      }
    }
  }
}
