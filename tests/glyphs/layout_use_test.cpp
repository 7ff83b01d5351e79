#include "glyphs/layout_use.h"

#include <numeric>

#include "glyphs/font_file.h"
#include "glyphs/shaping.h"
#include "glyphs/ufo.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;

namespace {

/// Pairs of a letter with others, before it or behind, that HarfBuzz kerns.
std::int64_t kerned_by_harfbuzz(const Font& font, const std::u32string& letters, char32_t asked) {
  std::int64_t count = 0;
  const auto utf8 = [](char32_t c) { return std::string(1, static_cast<char>(c)); };
  for (const char32_t other : letters) {
    for (const bool is_first : {true, false}) {
      if (!is_first && other == asked) continue;
      const std::string text = is_first ? utf8(asked) + utf8(other) : utf8(other) + utf8(asked);
      const ShapedLine line = shape(font, text);
      const ShapedLine apart = shape(font, text, {.features = "-kern"});
      if (line.glyphs.back().origin != apart.glyphs.back().origin) ++count;
    }
  }
  return count;
}

}  // namespace

TEST_CASE("glyphs with anchors in GPOS are found, and kerned pairs counted", "[layout_use]") {
  const Font font = load_font(bundled_font("cabin/Cabin-Regular.otf"));
  std::vector<int> all(font.glyphs.size());
  std::iota(all.begin(), all.end(), 0);
  const LayoutUse use = layout_use(font, all);
  CHECK(use.kerning_pairs > 1000);
  CHECK(layout_use(font, {}).kerning_pairs == 0);
  CHECK(layout_use(font, {}).anchored.empty());
  // Every pair has a first and a second glyph, so no more than twice as many pairs are counted glyph by glyph.
  std::int64_t sum = 0;
  for (const int id : all) sum += layout_use(font, {id}).kerning_pairs;
  CHECK(sum >= use.kerning_pairs);
  CHECK(sum <= 2 * use.kerning_pairs);
  // Letters alone: at least the pairs that HarfBuzz kerns, T with each of them.
  const std::int64_t seen = kerned_by_harfbuzz(font, U"abcdefghijklmnopqrstuvwxyz", U'T');
  CHECK(seen > 5);
  CHECK(layout_use(font, {font.character_map.at(U'T')}).kerning_pairs >= seen);
}

TEST_CASE("kerning of a UFO is counted by its groups", "[layout_use]") {
  Folder folder = *extract_ufo(load_font(bundled_font("cabin/Cabin-Regular.otf"))).folder;
  const auto put = [&](const char* name, const std::string& dictionary) {
    const std::string text =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><plist version=\"1.0\">" + dictionary + "</plist>";
    folder[name] = Bytes(text.begin(), text.end());
  };
  put("groups.plist", "<dict><key>public.kern1.T</key><array><string>T</string><string>V</string></array></dict>");
  put("kerning.plist",
      "<dict><key>public.kern1.T</key><dict><key>a</key><integer>-40</integer><key>o</key><integer>0</integer></dict>"
      "<key>A</key><dict><key>V</key><integer>-80</integer></dict></dict>");
  const Font font = load_ufo("k.ufo", folder);
  CHECK(layout_use(font, {font.find("T")}).kerning_pairs == 1);
  CHECK(layout_use(font, {font.find("V")}).kerning_pairs == 2);
  CHECK(layout_use(font, {font.find("a")}).kerning_pairs == 2);
  CHECK(layout_use(font, {font.find("o")}).kerning_pairs == 0);
}
