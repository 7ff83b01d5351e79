#include "glyphs/convert.h"

#include <algorithm>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/sanitizer.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using fontcore::BezierContour;
using fontcore::PointKind;
using glyphs::Bytes;
using glyphs::Font;

/// Contours as text: "0,0 100,0 (100,50) (50,100) 0,100 | ..." with handles in parentheses.
std::string drawn(const Font& font, int glyph) {
  std::string all;
  for (const BezierContour& contour : compose(font, glyph)) {
    if (!all.empty()) all += " |";
    for (int i = 0; i < contour.point_count(); ++i) {
      const std::string point = fontcore::text(contour.point(i).x(), ",", contour.point(i).y());
      all += (all.empty() ? "" : " ") + (contour.kind(i) == PointKind::Node ? point : "(" + point + ")");
    }
  }
  return all;
}

}  // namespace

TEST_CASE("a TrueType font becomes an OpenType font with its names, advances, characters and outlines", "[convert]") {
  for (const std::string name : {"liberation-serif/LiberationSerif-Regular.ttf", "open-sans/OpenSans-Regular.ttf"}) {
    INFO(name);
    const Font font = glyphs::load_font(bundled_font(name));
    for (const auto fractions : {glyphs::Fractions::Round, glyphs::Fractions::Keep}) {
      const glyphs::ConvertedFont converted = convert_outlines(font, {.tolerance = 0.0, .fractions = fractions});
      const Font read = glyphs::load_font_bytes("converted.otf", converted.font.data);
      CHECK(read.format == glyphs::OutlineFormat::Cff);
      CHECK(read.character_map == font.character_map);
      CHECK(read.family == font.family);
      int wrong = 0;
      double area_error = 0.0;
      for (const glyphs::Glyph& glyph : font.glyphs) {
        const glyphs::Glyph& back = read.glyphs[static_cast<std::size_t>(glyph.id)];
        wrong += back.name != glyph.name || back.advance != glyph.advance || back.is_composite() || back.has_hints;
        const double before = signed_area(compose(font, glyph.id));
        const double after = signed_area(back.contours);
        area_error = std::max(area_error, std::abs(after + before) / std::max(std::abs(before), 1e4));
      }
      CHECK(wrong == 0);
      const double bound = fractions == glyphs::Fractions::Round ? 1.0 : 1e-4;
      CHECK(area_error < (fractions == glyphs::Fractions::Round ? 5e-3 : 1e-6));
      CHECK(converted.deviation.at(static_cast<std::size_t>(converted.worst)) < bound);
      CHECK(std::ranges::max(converted.deviation) == converted.deviation[static_cast<std::size_t>(converted.worst)]);
      const auto before = sfnt_bytes::tables_of(*font.data);
      const auto after = sfnt_bytes::tables_of(converted.font.data);
      for (const std::string tag : {"glyf", "loca", "fpgm", "prep", "cvt "}) CHECK_FALSE(after.contains(tag));
      for (const std::string tag : {"name", "cmap", "OS/2", "GPOS", "GSUB", "GDEF", "kern", "gasp"}) {
        if (before.contains(tag)) CHECK(after.at(tag) == before.at(tag));
      }
      CHECK(after.at("maxp").size() == 6);
      CHECK(sfnt_bytes::checksum(converted.font.data) == 0xB1B0AFBA);
      CHECK(static_cast<std::ptrdiff_t>(converted.flattened.size()) ==
            std::ranges::count_if(font.glyphs, &glyphs::Glyph::is_composite));
    }
  }
}

TEST_CASE("quadratics become the same curves the other way round, from the same start", "[convert]") {
  const Bytes leaf = sfnt_bytes::simple_glyph({{{0, 0}, {0, 300, false}, {300, 300}, {300, 0, false}}});
  const Font font = glyphs::load_font_bytes("leaf.ttf", sfnt_bytes::font_of(sfnt_bytes::small_font({{}, leaf})));
  const glyphs::ConvertedFont converted = convert_outlines(font, {.tolerance = 0.0});
  CHECK(drawn(glyphs::load_font_bytes("leaf.otf", converted.font.data), 1) ==
        "0,0 (200,0) (300,100) 300,300 (100,300) (0,200)");
  CHECK(std::ranges::max(converted.deviation) < 1e-12);
  CHECK(converted.font.warnings.empty());
  for (const int anchor_format : {1, 2}) {  // a cursive attachment
    auto tables = sfnt_bytes::small_font({{}, leaf});
    for (const int value : {1, 0, 0, 0, 10, 1, 4, 3, 0, 1, 8, 1, 18, 1, 10, 0, anchor_format, 5, 5, 1, 1, 1, 1}) {
      sfnt_bytes::put16(tables["GPOS"], value);
    }
    const Font placed = glyphs::load_font_bytes("placed.ttf", sfnt_bytes::font_of(tables));
    CHECK(convert_outlines(placed, {.tolerance = 0.0}).font.warnings.size() == (anchor_format == 2 ? 1 : 0));
  }
}

TEST_CASE("a font converted is within its tolerance, by either reader, and the sanitizer takes it", "[convert][slow]") {
  for (const std::string& path : {bundled_font("open-sans/OpenSans-Bold.ttf"), bundled_font("cabin/Cabin-Bold.otf")}) {
    INFO(path);
    const Font font = glyphs::load_font(path);
    for (const double tolerance : {0.5, 1.0}) {
      const glyphs::ConvertedFont converted = convert_outlines(font, {.tolerance = tolerance});
      CHECK(is_accepted_by_sanitizer(converted.font.data));
      const Font read = glyphs::load_font_bytes("converted", converted.font.data);
      CHECK(read.format != font.format);
      CHECK(read.character_map == font.character_map);
      const double units = tolerance * font.units_per_em / 1000.0;
      int wrong = 0;
      double farthest = 0.0;
      for (const glyphs::Glyph& glyph : font.glyphs) {
        const glyphs::Glyph& back = read.glyphs[static_cast<std::size_t>(glyph.id)];
        wrong += back.name != glyph.name || back.advance != glyph.advance || back.is_composite();
        std::vector<BezierContour> before = compose(font, glyph.id);
        std::erase_if(before, [](const BezierContour& contour) { return contour.point_count() < 2; });
        REQUIRE(before.size() == back.contours.size());
        for (std::size_t c = 0; c < before.size(); ++c) {
          farthest = std::max(
              farthest, fontcore::two_sided_distance(to_polyline(before[c], 2.0), to_polyline(back.contours[c], 2.0)));
          wrong += signed_area(before[c]) * signed_area(back.contours[c]) > 0.0;
        }
      }
      CHECK(wrong == 0);
      // Cubics that are cut one by one take half of it, and whole numbers up to 0.71 units.
      const double bound = std::max(units, 0.5 * units + 0.71);
      CHECK(farthest <= bound + 0.05);
      CHECK(converted.deviation.at(static_cast<std::size_t>(converted.worst)) <= bound + 0.01);
    }
  }
}

TEST_CASE("TrueType to OpenType and back draws the same within both tolerances, with the same names", "[convert]") {
  const Font font = glyphs::load_font(bundled_font("cabin/Cabin-Regular.otf"));
  const glyphs::ConvertedFont there = convert_outlines(font);
  const Font truetype = glyphs::load_font_bytes("there.ttf", there.font.data);
  CHECK(there.font.dropped_hints.size() > 100);
  const glyphs::ConvertedFont back = convert_outlines(truetype);
  const Font read = glyphs::load_font_bytes("back.otf", back.font.data);
  int wrong = 0;
  for (const glyphs::Glyph& glyph : font.glyphs) {
    const glyphs::Glyph& now = read.glyphs[static_cast<std::size_t>(glyph.id)];
    const double area = signed_area(compose(font, glyph.id));
    wrong += now.name != glyph.name || now.advance != glyph.advance;
    wrong += std::abs(signed_area(now.contours) - area) > 0.02 * std::abs(area);
  }
  CHECK(wrong == 0);
  CHECK(back.segments_after < 1.1 * there.segments_before);
}

TEST_CASE("outlines given for the font's are converted too, points alone left out", "[convert]") {
  const Bytes leaf = sfnt_bytes::simple_glyph({{{0, 0}, {0, 300, false}, {300, 300}, {300, 0, false}}, {{500, 500}}});
  const Font font = glyphs::load_font_bytes("leaf.ttf", sfnt_bytes::font_of(sfnt_bytes::small_font({{}, leaf})));
  REQUIRE(font.glyphs[1].contours.size() == 2);
  const glyphs::ConvertedFont converted = convert_outlines(font, {}, {{1, font.glyphs[1].contours}});
  CHECK(drawn(glyphs::load_font_bytes("leaf.otf", converted.font.data), 1) ==
        "0,0 (200,0) (300,100) 300,300 (100,300) (0,200)");
}

TEST_CASE("what cannot be converted is refused in a line", "[convert]") {
  const Font otf = glyphs::load_font(bundled_font("cabin/Cabin-Regular.otf"));
  const auto refused = [&](const glyphs::ConvertOptions& options) {
    return message_of<glyphs::RequestError>([&] { convert_outlines(otf, options); });
  };
  CHECK(refused({.tolerance = 0.0}).ends_with(": cubics become quadratics within a tolerance, which is 0"));
  CHECK(
      refused({.fractions = glyphs::Fractions::Keep}).ends_with(": TrueType has whole numbers only, no --fractional"));
  CHECK(refused({.tolerance = -1.0}).ends_with(": the tolerance is -1"));
}
