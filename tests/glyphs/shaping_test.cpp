#include "glyphs/shaping.h"

#include <algorithm>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using glyphs::Font;
using glyphs::RequestError;
using glyphs::shape;
using glyphs::ShapedLine;

namespace {

const Font& garamond() {
  static const Font font = glyphs::load_font(bundled_font("eb-garamond/EBGaramond12-Regular.otf"));
  return font;
}
const Font& open_sans() {
  static const Font font = glyphs::load_font(bundled_font("open-sans/OpenSans-Regular.ttf"));
  return font;
}

std::vector<std::string> names(const Font& font, const ShapedLine& line) {
  std::vector<std::string> all;
  for (const auto& placed : line.glyphs) all.push_back(font.glyphs[static_cast<std::size_t>(placed.glyph)].name);
  return all;
}

std::vector<int> ids(const ShapedLine& line) {
  std::vector<int> all;
  for (const auto& placed : line.glyphs) all.push_back(placed.glyph);
  return all;
}

}  // namespace

TEST_CASE("a line without kerning is as long as the advances of its glyphs", "[shaping]") {
  for (const std::string& path : bundled_fonts()) {
    CAPTURE(path);
    const Font font = glyphs::load_font(path);
    const ShapedLine line = shape(font, "Hamburgefonstiv", {.features = "-kern,-liga"});
    REQUIRE(line.glyphs.size() == 15);
    double pen = 0.0;
    for (const auto& placed : line.glyphs) {
      CHECK(placed.origin == fontcore::Point(pen, 0.0));
      pen += font.glyphs[static_cast<std::size_t>(placed.glyph)].advance;
    }
    CHECK(line.advance == pen);
  }
}

TEST_CASE("kerning brings A and V together", "[shaping]") {
  CHECK(shape(open_sans(), "AV").advance < shape(open_sans(), "AV", {.features = "-kern"}).advance);
}

TEST_CASE("ligatures are set unless they are switched off", "[shaping]") {
  const Font& font = open_sans();
  CHECK(names(font, shape(font, "fi")) == std::vector<std::string>{"uniFB01"});
  CHECK(names(font, shape(font, "fi", {.features = "-liga"})) == std::vector<std::string>{"f", "i"});
}

TEST_CASE("a feature switched on substitutes its glyphs", "[shaping]") {
  const auto plain = ids(shape(garamond(), "small"));
  const auto small_capitals = ids(shape(garamond(), "small", {.features = "smcp"}));
  REQUIRE(small_capitals.size() == plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) CHECK(small_capitals[i] != plain[i]);
}

TEST_CASE("right to left text is given as it is seen, the last character first", "[shaping]") {
  auto forward = ids(shape(open_sans(), "abc", {.direction = "ltr"}));
  std::reverse(forward.begin(), forward.end());
  CHECK(ids(shape(open_sans(), "abc", {.direction = "rtl"})) == forward);
}

TEST_CASE("vertical text runs down, without tables too", "[shaping]") {
  Font bare = open_sans();
  bare.data.reset();
  bare.format = glyphs::OutlineFormat::Ufo;
  for (const Font& font : {open_sans(), bare}) {
    const ShapedLine line = shape(font, "ab", {.direction = "ttb"});
    REQUIRE(line.glyphs.size() == 2);
    CHECK(line.direction == glyphs::Direction::TopToBottom);
    CHECK(line.glyphs[0].origin.y() < 0.0);
    CHECK(line.glyphs[1].origin.y() < line.glyphs[0].origin.y());
    CHECK(line.advance > 0.0);
  }
}

TEST_CASE("a character the font lacks is glyph 0 in a line, and an error where glyphs are selected", "[shaping]") {
  const std::string text = "a\xE4\xB8\x80";  // U+4E00
  CHECK(shape(open_sans(), text).glyphs.back().glyph == 0);
  CHECK_THROWS_WITH(glyphs::glyphs_of_text(open_sans(), text), Catch::Contains("U+4E00"));
}

TEST_CASE("the glyphs of a text are sorted, each once, over all its lines", "[shaping]") {
  const Font& font = open_sans();
  std::vector<int> expected{font.find("n"), font.find("a"), font.find("b")};
  std::sort(expected.begin(), expected.end());
  CHECK(glyphs::glyphs_of_text(font, "banana\n\nnab\n") == expected);
}

TEST_CASE("lines end at newlines, and one at the end opens no other line", "[shaping]") {
  CHECK(glyphs::split_lines("a\n\nb\n") == std::vector<std::string>{"a", "", "b"});
  CHECK(glyphs::split_lines("").empty());
}

TEST_CASE("what cannot be set is refused by name", "[shaping]") {
  const Font& font = open_sans();
  CHECK_THROWS_AS(shape(font, ""), RequestError);
  CHECK_THROWS_AS(glyphs::glyphs_of_text(font, "\n"), RequestError);
  for (const char* broken : {"\xFF", "a\xC3", "\xC0\xAF", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "a\x80"})
    CHECK_THROWS_WITH(shape(font, broken), Catch::Contains("not UTF-8 at byte"));
  CHECK_THROWS_WITH(shape(font, "a", {.features = "smcp,zzzz"}), Catch::Contains("smcp") || Catch::Contains("zzzz"));
  CHECK_THROWS_WITH(shape(font, "a", {.features = "toolong"}), Catch::Contains("toolong"));
  CHECK_THROWS_AS(shape(font, "a", {.features = "kern,"}), RequestError);
  CHECK_NOTHROW(shape(font, "a", {.features = "-zzzz"}));
  CHECK_THROWS_WITH(shape(font, "a", {.script = "Abcd"}), Catch::Contains("Abcd"));
  CHECK_NOTHROW(shape(font, "a", {.script = "latn"}));
  CHECK_THROWS_WITH(shape(font, "a", {.direction = "left"}), Catch::Contains("left"));
  CHECK_THROWS_WITH(shape(font, "a", {.language = "d e"}), Catch::Contains("d e"));
  CHECK_NOTHROW(shape(font, "a", {.language = "de-AT"}));
}
