// Writes the fuzzers' first inputs: fonts of a few glyphs out of the bundled ones, composites and variable fonts made
// by hand.

#include <cstdio>
#include <filesystem>

#include "glyphs/safe_file.h"
#include "tests/bundled_fonts.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/glyphs/subset.h"
#include "tests/glyphs/variable_bytes.h"
#include "tools/fuzz/small_ufo.h"

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
    std::fputs("make_seeds FOLDER: it gets sfnt/, cff/ and ufo/\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  const auto write = [&](const char* kind, const std::string& name, const glyphs::Bytes& bytes) {
    std::filesystem::create_directories(folder / kind);
    glyphs::write_file((folder / kind / name).string(), bytes);
  };
  for (const std::string& path : bundled_fonts()) {
    const std::filesystem::path from = path;
    for (const auto& [what, characters] : {std::pair{"l", U"l"}, std::pair{"oAacute", U"o\u00C1"}}) {
      const std::string name = from.stem().string() + "-" + what;
      const glyphs::Bytes font = subset_of(path, characters);
      write("sfnt", name + from.extension().string(), font);
      const auto tables = tables_of(font);
      if (const auto cff = tables.find("CFF "); cff != tables.end()) write("cff", name + ".cff", cff->second);
    }
  }
  write("sfnt", "composites.ttf", composites());
  write("sfnt", "variable.ttf", font_of(variable_bytes::variable_tables()));
  write("sfnt", "variable.otf", variable_bytes::otto(variable_bytes::cff2_tables()));
  const glyphs::Folder ufo = small_ufo();
  unsigned char number = 0;
  for (const auto& [name, content] : ufo) {
    glyphs::Bytes bytes{number++};
    bytes.insert(bytes.end(), content.begin(), content.end());
    write("ufo", std::filesystem::path(name).filename().string(), bytes);
  }
}
