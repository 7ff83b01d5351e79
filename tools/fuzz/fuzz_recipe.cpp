// Bytes -> parse_recipe -> one simple glyph through it.

#include <cstdint>

#include "glyphs/recipe.h"
#include "glyphs/restyle.h"
#include "tests/glyphs/made_font.h"
#include "tests/shapes.h"
#include "tools/fuzz/documented.h"

namespace {

constexpr std::size_t most_steps = 2;  // that are tried: a recipe's cost is the sum of its steps'

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return documented("fuzzed.json", [&] {
    const glyphs::Recipe recipe =
        glyphs::parse_recipe(std::string(reinterpret_cast<const char*>(data), size), "fuzzed.json");
    // A selection may name a list in a file, and that is not what is tried here.
    if (recipe.steps.size() > most_steps || recipe.glyphs.find('@') != std::string::npos) return;
    static const glyphs::Font font = font_of({shapes::arch(600)});
    const glyphs::GlyphResult result = restyle_glyph(font, 0, recipe);
    if (result.report.refused.find('\n') != std::string::npos) broken("a refusal in one line");
    for (const auto& contour : result.contours) {
      if (!contour.points().allFinite()) broken("coordinates are finite");
    }
  });
}
