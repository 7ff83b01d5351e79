// Writes the fuzzers' first inputs: fonts of a few glyphs out of the bundled ones, and composites made by hand.

#include <cstdio>
#include <filesystem>

#include "glyphs/safe_file.h"
#include "tests/bundled_fonts.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/glyphs/subset.h"

namespace {

using namespace sfnt_bytes;

glyphs::Bytes composites() {
  const glyphs::Bytes square = simple_glyph({{{0, 0}, {100, 0}, {100, 100}, {0, 100}}});
  const glyphs::Bytes drop =
      simple_glyph({{{0, 0, false}, {200, 0, false}, {100, 300, false}}, {{50, 50}, {90, 90}, {50, 90}}});
  return font_of(small_font({square,
                             square,
                             drop,
                             composite({{1}, {2, 30, 40}}),
                             composite({{2, 10, 20, true, 0, {0.5}},
                                        {2, 1, 2, true, 0, {0.5, -0.25}},
                                        {3, 3, 4, true, 0x200, {0.0, 1.0, -1.0, 0.0}}}),
                             composite({{1}, {2, 2, 1, false}}),
                             {}}));
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("make_seeds FOLDER: it gets sfnt/\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = std::filesystem::path(arguments[1]) / "sfnt";
  std::filesystem::create_directories(folder);
  for (const std::string& path : bundled_fonts()) {
    const std::filesystem::path from = path;
    for (const auto& [what, characters] : {std::pair{"l", U"l"}, std::pair{"oAacute", U"o\u00C1"}}) {
      const std::string file = from.stem().string() + "-" + what + from.extension().string();
      glyphs::write_file((folder / file).string(), subset_of(path, characters));
    }
  }
  glyphs::write_file((folder / "composites.ttf").string(), composites());
}
