#include <filesystem>

#include "glyphs/recipe.h"
#include "tests/glyphs/made_font.h"
#include "tests/glyphs/survive.h"
#include "tests/shapes.h"

namespace {

/// Parses a recipe and runs it over one letter; only the documented complaints are allowed.
void survive_recipe(const std::string& json) {
  try {
    const glyphs::Recipe recipe = glyphs::parse_recipe(json, "bad.json");
    const glyphs::GlyphResult result = restyle_glyph(font_of(shapes::letter_a(), 2048), 0, recipe);
    CHECK(result.report.refused.find('\n') == std::string::npos);
    for (const auto& contour : result.contours) CHECK(contour.points().allFinite());
  } catch (const glyphs::RequestError& error) {
    INFO(error.what());
    CHECK(survive_detail::is_complaint(error.what(), "bad.json"));
  }
}

}  // namespace

TEST_CASE("what once broke a reader breaks it no more", "[found]") {
  int tried = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(GLYPHWAVE_SOURCE_DIR) + "/tests/found")) {
    const std::filesystem::path& path = entry.path();
    INFO(path.filename().string());
    const glyphs::Bytes bytes = glyphs::read_file(path.string());
    if (path.extension() == ".json") {
      survive_recipe({bytes.begin(), bytes.end()});
    } else {
      // A name that ends in "at_one_place" is of a variable font, which is edited at a place of its design space only.
      const bool is_variable = path.stem().string().ends_with("at_one_place");
      survive(bytes, is_variable ? glyphs::Location{{"wght", 650.0}} : glyphs::Location{});
    }
    ++tried;
  }
  CHECK(tried > 0);
}
