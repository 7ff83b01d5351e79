#pragma once

#include <cmath>
#include <string>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/inspect.h"
#include "glyphs/restyle.h"
#include "tests/catch.h"
#include "tests/glyphs/sanitizer.h"

/// What bytes that may be no font came to.
enum class Survived { Refused, Read, Restyled };

namespace survive_detail {

inline bool is_complaint(const std::string& message, const std::string& file) {
  return message.find('\n') == std::string::npos && message.starts_with(file);
}

/// That what is written is a font, with the areas that were reported, and with no other glyph touched.
inline void check_written(const glyphs::Font& font, const glyphs::RestyleResult& result) {
  const glyphs::Font read = glyphs::load_font_bytes("written.ttf", result.font.data);
  REQUIRE(read.glyphs.size() == font.glyphs.size());
  std::vector<bool> is_changed(font.glyphs.size(), false);
  for (const glyphs::GlyphReport& report : result.glyphs) {
    if (!report.changed) continue;
    const auto id = static_cast<std::size_t>(report.glyph);
    is_changed[id] = true;
    CHECK(fontcore::signed_area(read.glyphs[id].contours) == Approx(report.area_after));
  }
  for (std::size_t id = 0; id < font.glyphs.size(); ++id) {
    CHECK(read.glyphs[id].name == font.glyphs[id].name);
    CHECK(read.glyphs[id].advance == font.glyphs[id].advance);
    if (result.font.emptied.contains(static_cast<int>(id))) {
      CHECK(read.glyphs[id].trouble.empty());
      CHECK((read.glyphs[id].contours.empty() && read.glyphs[id].components.empty()));
      continue;
    }
    // What is made of an emptied glyph may be in no trouble any more.
    if (result.font.emptied.empty()) CHECK(read.glyphs[id].trouble.empty() == font.glyphs[id].trouble.empty());
    if (!is_changed[id]) CHECK(read.glyphs[id].contours == font.glyphs[id].contours);
  }
}

}  // namespace survive_detail

/// Reads the bytes, a variable font at a place of its design space, looks at all glyphs, smooths and sweeps them with
/// their areas kept, and reads what is written.
///
/// Fails the test unless every answer is a documented one: a complaint of one line that begins with the file, or a
/// result that the OpenType Sanitizer takes; and unless the work stayed in proportion to the bytes.
inline Survived survive(const glyphs::Bytes& bytes, const glyphs::Location& location = {}) {
  using namespace survive_detail;
  const std::string file = "bad.ttf";
  glyphs::Font font;
  try {
    font = glyphs::load_font_bytes(file, bytes, {.location = location});
  } catch (const glyphs::FontReadError& error) {
    INFO(error.what());
    CHECK(is_complaint(error.what(), file));
    return Survived::Refused;
  }

  std::vector<int> drawn;
  std::ptrdiff_t stored = 0;
  std::ptrdiff_t composed = 0;  // points of composites: what a font can ask for without storing it
  for (const glyphs::Glyph& glyph : font.glyphs) {
    CHECK(glyph.trouble.find('\n') == std::string::npos);
    if (font.has_outline(glyph.id)) drawn.push_back(glyph.id);
    if (!glyph.trouble.empty()) {
      CHECK((glyph.contours.empty() && glyph.components.empty()));
      CHECK_THROWS_AS(compose(font, glyph.id), glyphs::FontReadError);
      continue;
    }
    for (const auto& contour : glyph.contours) stored += contour.point_count();
    if (!glyph.is_composite()) continue;
    std::ptrdiff_t points = 0;
    for (const auto& contour : compose(font, glyph.id)) points += glyphs::stored_points(contour);
    CHECK(points <= glyphs::max_composed_points);
    composed += points;
  }
  CHECK(composed <= glyphs::max_composed_work);
  CHECK(stored <= 4 * std::ssize(bytes) + glyphs::max_composed_points);

  std::ptrdiff_t listed = 0;
  for (const auto& facts : glyphs::inspect(font, drawn, {.jobs = 1})) {
    if (facts.trouble.empty()) CHECK(std::isfinite(facts.area));
    listed += std::ssize(facts.contours);
  }
  CHECK(listed <= 2048 + stored / 4);
  glyphs::check_crossings(font, drawn, {.jobs = 1});

  glyphs::Recipe recipe;
  recipe.steps.push_back(glyphs::SmoothStep{.scale = 0.02 * font.units_per_em});
  glyphs::SweepStep sweep;
  sweep.near = fontcore::Point(0.2, 0.3) * font.units_per_em;
  sweep.move = fontcore::Point(0.012, 0.005) * font.units_per_em;
  sweep.breadth = 0.3 * font.units_per_em;
  recipe.steps.push_back(sweep);
  try {
    const glyphs::RestyleResult result = glyphs::restyle(font, recipe, {.jobs = {.jobs = 1}});
    for (const glyphs::GlyphReport& report : result.glyphs) CHECK(report.refused.find('\n') == std::string::npos);
    if (result.changed() == 0 && result.font.emptied.empty() && result.font.data == *font.data) {
      CHECK(is_accepted_by_sanitizer(*font.data));
      return Survived::Read;
    }
    check_written(font, result);
    CHECK(is_accepted_by_sanitizer(result.font.data));
    return Survived::Restyled;
  } catch (const glyphs::FontWriteError& error) {
    INFO(error.what());
    CHECK(is_complaint(error.what(), file));
    return Survived::Read;
  }
}
