#include "glyphs/sfnt_cff.h"

#include <algorithm>
#include <chrono>
#include <random>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/sfnt_writer.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/cff_bytes.h"

namespace {

using cff_bytes::charstring;
using cff_bytes::entry;
using cff_bytes::otf_of;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using glyphs::Bytes;
using glyphs::Font;
using glyphs::FontWriteError;
using glyphs::sfnt::CffIndex;
using glyphs::sfnt::CffTable;
using glyphs::sfnt::Charstring;
using glyphs::sfnt::encode_charstring;
using glyphs::sfnt::interpret;

Charstring read(const std::string& words) { return interpret(charstring(words), CffIndex{}, CffIndex{}); }

/// Contours as text: "0,0 100,0 (100,50) (50,100) 0,100 | ..." with handles in parentheses.
std::string drawn(const Charstring& glyph) {
  if (!glyph.trouble.empty()) return glyph.trouble;
  std::string all;
  for (const BezierContour& contour : glyph.contours) {
    if (!all.empty()) all += " |";
    for (int i = 0; i < contour.point_count(); ++i) {
      const std::string point = fontcore::text(contour.point(i).x(), ",", contour.point(i).y());
      all += (all.empty() ? "" : " ") + (contour.kind(i) == PointKind::Node ? point : "(" + point + ")");
    }
  }
  return all;
}

std::string draw(const std::string& words) { return drawn(read(words)); }

/// Font of small letters: glyph 0 empty, then the charstrings.
cff_bytes::Cff cff_of(const std::vector<std::string>& words) {
  cff_bytes::Cff font;
  font.charstrings.push_back(charstring("endchar"));
  for (const std::string& one : words) font.charstrings.push_back(charstring(one));
  return font;
}

Font load(const cff_bytes::Cff& cff) { return glyphs::load_font_bytes("small.otf", otf_of(cff)); }

std::string drawn(const Font& font, int glyph) {
  Charstring one;
  one.contours = compose(font, glyph);
  return drawn(one);
}

const std::string square = "10 20 rmoveto 100 hlineto 100 vlineto -100 hlineto endchar";

}  // namespace

TEST_CASE("lines and moves of a charstring are steps from point to point", "[sfnt_cff]") {
  CHECK(draw("10 20 rmoveto 5 6 -7 8 rlineto endchar") == "10,20 15,26 8,34");
  CHECK(draw("10 hmoveto 100 100 -100 hlineto endchar") == "10,0 110,0 110,100 10,100");
  CHECK(draw("10 vmoveto 100 100 -100 vlineto endchar") == "0,10 0,110 100,110 100,10");
  CHECK(draw("1 2 rmoveto 10 hlineto 10 vlineto 5 hmoveto 10 vlineto 10 hlineto endchar") ==
        "1,2 11,2 11,12 | 16,12 16,22 26,22");
}

TEST_CASE("curves of a charstring leave out what is nought", "[sfnt_cff]") {
  CHECK(draw("0 hmoveto 1 2 3 4 5 6 rrcurveto endchar") == "0,0 (1,2) (4,6) 9,12");
  CHECK(draw("0 hmoveto 1 2 3 4 5 6 7 8 rcurveline endchar") == "0,0 (1,2) (4,6) 9,12 16,20");
  CHECK(draw("0 hmoveto 7 8 1 2 3 4 5 6 rlinecurve endchar") == "0,0 7,8 (8,10) (11,14) 16,20");
  CHECK(draw("0 hmoveto 1 2 3 4 hhcurveto endchar") == "0,0 (1,0) (3,3) 7,3");
  CHECK(draw("0 hmoveto 9 1 2 3 4 1 2 3 4 hhcurveto endchar") == "0,0 (1,9) (3,12) 7,12 (8,12) (10,15) 14,15");
  CHECK(draw("0 hmoveto 1 2 3 4 vvcurveto endchar") == "0,0 (0,1) (2,4) 2,8");
  CHECK(draw("0 hmoveto 9 1 2 3 4 vvcurveto endchar") == "0,0 (9,1) (11,4) 11,8");
  CHECK(draw("0 hmoveto 1 2 3 4 hvcurveto endchar") == "0,0 (1,0) (3,3) 3,7");
  CHECK(draw("0 hmoveto 1 2 3 4 5 hvcurveto endchar") == "0,0 (1,0) (3,3) 8,7");
  CHECK(draw("0 hmoveto 1 2 3 4 1 2 3 4 5 hvcurveto endchar") == "0,0 (1,0) (3,3) 3,7 (3,8) (5,11) 9,16");
  CHECK(draw("0 hmoveto 1 2 3 4 5 vhcurveto endchar") == "0,0 (0,1) (2,4) 6,9");
  CHECK(draw("0 hmoveto 1 2 3 4 1 2 3 4 5 vhcurveto endchar") == "0,0 (0,1) (2,4) 6,4 (7,4) (9,7) 14,11");
}

TEST_CASE("flexes are two curves", "[sfnt_cff]") {
  CHECK(draw("0 hmoveto 1 2 3 4 5 6 7 hflex endchar") == "0,0 (1,0) (3,3) 7,3 (12,3) (18,0) 25,0");
  CHECK(draw("0 hmoveto 1 2 3 4 5 6 7 8 9 10 11 12 50 flex endchar") == "0,0 (1,2) (4,6) 9,12 (16,20) (25,30) 36,42");
  CHECK(draw("0 hmoveto 1 2 3 4 5 6 7 8 9 hflex1 endchar") == "0,0 (1,2) (4,6) 9,6 (15,6) (22,14) 31,0");
  CHECK(draw("0 hmoveto 10 1 10 1 10 1 10 1 10 1 10 flex1 endchar") == "0,0 (10,1) (20,2) 30,3 (40,4) (50,5) 60,0");
  CHECK(draw("0 hmoveto 1 10 1 10 1 10 1 10 1 10 10 flex1 endchar") == "0,0 (1,10) (2,20) 3,30 (4,40) (5,50) 0,60");
}

TEST_CASE("hints are skipped, and noticed", "[sfnt_cff]") {
  CHECK_FALSE(read(square).has_hints);
  for (const std::string hints :
       {"1 2 hstem", "1 2 3 4 vstem", "1 2 hstemhm 3 4 hintmask #80", "1 2 vstemhm cntrmask #55",
        "1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 hstemhm hintmask #ff #80"}) {
    INFO(hints);
    CHECK(read(hints + " " + square).has_hints);
    CHECK(draw(hints + " " + square) == draw(square));
  }
}

TEST_CASE("a width may stand before the first operator that clears the stack", "[sfnt_cff]") {
  CHECK_FALSE(read(square).width);
  CHECK(read("77 endchar").width == 77);
  CHECK(read("77 " + square).width == 77);
  CHECK(read("77 1 2 hstem " + square).width == 77);
  CHECK(read("77 1 2 hintmask #80 " + square).width == 77);
  CHECK(read("77 5 hmoveto 5 hlineto endchar").width == 77);
  CHECK(read("77 5 vmoveto 5 hlineto endchar").width == 77);
  CHECK(read("-77.5 " + square).width == -77.5);
  CHECK_FALSE(read("5 hmoveto 1 2 3 rlineto endchar").width);
}

TEST_CASE("a charstring computes", "[sfnt_cff]") {
  const auto value = [](const std::string& words) {
    const Charstring glyph = read("0 hmoveto " + words + " hlineto 1 vlineto endchar");
    INFO(words << " " << glyph.trouble);
    REQUIRE(glyph.trouble == "");
    return glyph.contours.at(0).point(1).x();
  };
  CHECK(value("5 3 add") == 8);
  CHECK(value("5 3 sub") == 2);
  CHECK(value("5 3 mul") == 15);
  CHECK(value("1 3 div") == 21845.0 / 65536);
  CHECK(value("-5 abs") == 5);
  CHECK(value("5 neg") == -5);
  CHECK(value("2 sqrt") == std::round(std::sqrt(2.0) * 65536) / 65536);
  CHECK(value("7 5 drop") == 7);
  CHECK(value("7 5 exch sub") == -2);
  CHECK(value("7 dup add") == 14);
  CHECK(value("7 8 9 1 index 4 1 roll drop drop drop") == 8);
  CHECK(value("7 8 9 3 1 roll drop drop") == 9);
  CHECK(value("7 8 9 3 -1 roll drop drop") == 8);
  CHECK(value("42 3 put 3 get") == 42);
  CHECK(value("1 2 3 4 ifelse") == 1);
  CHECK(value("1 2 4 3 ifelse") == 2);
  CHECK(value("1 0 and 1 add") == 1);
  CHECK(value("1 0 or 1 add") == 2);
  CHECK(value("0 not 1 add") == 2);
  CHECK(value("3 3 eq 1 add") == 2);
  CHECK(value("random") == 0.5);
  CHECK(read("0 hmoveto 1 0.5 mul hlineto 1 vlineto endchar").has_fractions);
}

TEST_CASE("a contour ends where it began, and its start is listed once", "[sfnt_cff]") {
  CHECK(draw(square) == "10,20 110,20 110,120 10,120");
  CHECK(read(square).is_closed_by_line == std::vector{false});
  const Charstring closed = read("10 20 rmoveto 100 hlineto 100 vlineto -100 hlineto -100 vlineto endchar");
  CHECK(drawn(closed) == "10,20 110,20 110,120 10,120");
  CHECK(closed.is_closed_by_line == std::vector{true});
  CHECK(draw("0 hmoveto 0 50 50 50 50 0 rrcurveto 0 -50 -50 -50 -50 0 rrcurveto endchar") ==
        "0,0 (0,50) (50,100) 100,100 (100,50) (50,0)");
  CHECK(draw("5 hmoveto 6 hmoveto endchar") == "");  // nothing is drawn
  CHECK(draw("0 hmoveto 0 hlineto endchar") == "");
  CHECK(draw("5 hlineto 5 vlineto endchar") == "0,0 5,0 5,5");      // no move at all
  CHECK(draw("1 1 rmoveto 5 hlineto 5 vlineto") == "1,1 6,1 6,6");  // no endchar
}

TEST_CASE("fractions are exact, and coordinates end where 16 bits do", "[sfnt_cff]") {
  const Charstring glyph = read("0.25 0 rmoveto 0.0000153 hlineto 1 vlineto endchar");
  CHECK(glyph.has_fractions);
  CHECK(glyph.contours.at(0).point(1).x() == 0.25 + 1.0 / 65536);
  CHECK(draw("32767 hmoveto 1 hlineto 1 vlineto endchar") == "its charstring coordinate (32768, 0) outside 16 bits");
  CHECK(draw("32767 hmoveto 1 hmoveto -1 1 rlineto 1 hlineto endchar") ==
        "its charstring coordinate (32768, 0) outside 16 bits");
}

TEST_CASE("what is wrong with a charstring is said in one line", "[sfnt_cff]") {
  CHECK(draw("rmoveto") == "its charstring takes operands that are not there");
  CHECK(draw("0 hmoveto 1 2 3 rlineto") == "its charstring takes operands that are not there");
  CHECK(draw("#1c #00") == "its charstring ends within a number or an operator");
  CHECK(draw("#0c") == "its charstring ends within a number or an operator");
  CHECK(draw("1 2 hstem hintmask") == "its charstring ends within a mask");
  CHECK(draw("#02") == "its charstring there is no operator 2");
  CHECK(draw("1 0 div") == "its charstring divides by zero");
  CHECK(draw("5 40 put") == "its charstring there is no storage 40");
  CHECK(draw("return") == "its charstring returns from no subroutine");
  CHECK(draw("5 callsubr") == "its charstring calls subroutine 112 of 0");
  CHECK(draw("0.5 callsubr") == "its charstring 0.5 where a whole number is needed");
  std::string many;
  for (int i = 0; i < 49; ++i) many += "1 ";
  CHECK(draw(many + "rlineto") == "its charstring more than 48 operands");
}

TEST_CASE("subroutines are called by their number less a bias, up to ten deep", "[sfnt_cff]") {
  auto font =
      cff_of({"10 20 rmoveto -107 callsubr -106 callgsubr endchar", "0 hmoveto -105 callgsubr", "-107 callsubr"});
  font.local_subroutines = {charstring("100 hlineto return"), charstring("0 callsubr")};
  font.global_subroutines = {charstring("50 vlineto"), charstring("100 vlineto -100 hlineto return"),
                             charstring("5 hlineto 5 vlineto endchar")};
  const Font loaded = load(font);
  CHECK(loaded.glyphs[1].trouble == "");
  CHECK(drawn(loaded, 1) == "10,20 110,20 110,120 10,120");
  CHECK(drawn(loaded, 2) == "0,0 5,0 5,5");
  for (const int depth : {10, 11}) {
    auto chain = cff_of({"0 hmoveto -107 callgsubr endchar"});
    for (int i = 1; i < depth; ++i)
      chain.global_subroutines.push_back(charstring(std::to_string(i - 107) + " callgsubr"));
    chain.global_subroutines.push_back(charstring("5 hlineto 5 vlineto"));
    const Font deep = load(chain);
    CHECK(deep.glyphs[1].trouble == (depth == 10 ? "" : "its charstring subroutines nest deeper than 10"));
  }
}

TEST_CASE("subroutines that call each other without end cost next to nothing", "[sfnt_cff]") {
  // Nine levels of subroutines that each call the next 2000 times; every glyph of many calls the first.
  cff_bytes::Cff font;
  for (int level = 1; level <= 9; ++level) {
    std::string calls;
    for (int i = 0; i < 2000; ++i) calls += std::to_string(level - 107) + " callgsubr ";
    font.global_subroutines.push_back(charstring(calls));
  }
  font.global_subroutines.push_back(charstring("return"));
  font.charstrings.assign(5000, charstring("-107 callgsubr endchar"));
  font.charset = {2, 0, 1, 0x13, 0x86};  // 4999 names in one range
  const auto start = std::chrono::steady_clock::now();
  const Font loaded = load(font);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  CHECK(taken.count() < 30);  // a second on an idle machine
  CHECK(loaded.glyphs.front().trouble == "its charstring takes over 1000000 steps");
  CHECK(loaded.glyphs.back().trouble == "not read: charstrings before it take too much work");
  const auto read = std::ranges::count(loaded.glyphs, loaded.glyphs.front().trouble, &glyphs::Glyph::trouble);
  CHECK(read == glyphs::sfnt::most_font_work / glyphs::sfnt::most_charstring_work);
}

TEST_CASE("an accented letter by endchar is a composite of the font's glyphs", "[sfnt_cff]") {
  // Charset: glyph 1 is A (string 34), glyph 2 acute (string 125), glyph 3 the letter.
  auto font = cff_of({square, "0 hmoveto 30 hlineto 30 vlineto endchar", "120 50 65 194 endchar", "0 0 1 2 endchar"});
  font.charset = {0, 0, 34, 0, 125, 0, 200, 0, 201};
  const Font loaded = load(font);
  REQUIRE(loaded.glyphs[3].trouble == "");
  REQUIRE(loaded.glyphs[3].components.size() == 2);
  CHECK(loaded.glyphs[3].components[0].glyph == 1);
  CHECK(drawn(loaded, 3) == drawn(loaded, 1) + " | 120,50 150,50 150,80");
  CHECK(loaded.glyphs[4].trouble == "is put together from a character 1 that the font does not have");

  SECTION("and follows an edit of its base") {
    std::vector<BezierContour> moved;
    for (const BezierContour& contour : loaded.glyphs[1].contours) {
      moved.push_back(transform(contour, {.shift = Point(-30, 40)}));
    }
    const auto written = write_sfnt(loaded, {{1, moved}});
    CHECK(written.moved_composites == std::vector{3});
    const Font again = glyphs::load_font_bytes("again.otf", written.data);
    CHECK(drawn(again, 3) == "-20,60 80,60 80,160 -20,160 | 120,50 150,50 150,80");
    const auto hmtx = sfnt_bytes::tables_of(written.data).at("hmtx");
    CHECK(sfnt_bytes::get16(hmtx, 4 * 1 + 2) == -30);
    CHECK(sfnt_bytes::get16(hmtx, 4 * 3 + 2) == -30);
  }
  SECTION("and is not edited itself") {
    CHECK(message_of<FontWriteError>([&] {
            write_sfnt(loaded, {{3, {}}});
          }) == "small.otf: " + loaded.glyphs[3].name + ": is a composite; it is edited through its components");
  }
}

TEST_CASE("a FontMatrix of a Font DICT scales its glyphs, one of the Top DICT is the em", "[sfnt_cff]") {
  const Bytes half{0x1E, 0xA0, 0x00, 0x5F, 0x8B, 0x8B, 0x1E, 0xA0, 0x00, 0x5F, 0x8B, 0x8B, 0x0C, 0x07};  // 0.0005
  cff_bytes::Cff font = cff_of({square, square});
  font.more_top = half;
  CHECK(drawn(load(font), 1) == "10,20 110,20 110,120 10,120");
  font.more_top.clear();
  font.font_dicts = {{}, {.local_subroutines = {}, .matrix = half}};
  font.selection = {0, 0, 1};
  const Font loaded = load(font);
  CHECK(drawn(loaded, 1) == "10,20 110,20 110,120 10,120");
  CHECK(drawn(loaded, 2) == "5,10 55,10 55,60 5,60");
  CHECK(message_of<FontWriteError>([&] {
          write_sfnt(loaded, {{2, {transform(loaded.glyphs[2].contours[0], {.shift = Point(1, 1)})}}});
        }).ends_with("cannot be edited: it is drawn through a FontMatrix"));
}

namespace {

/// Contours of lines and curves at random, some steps along an axis, some of no length, some fractional.
std::vector<BezierContour> random_outline(std::mt19937& random, bool has_fractions) {
  const auto coordinate = [&] {
    const int whole = static_cast<int>(random() % 2001) - 1000;
    return has_fractions && random() % 3 == 0 ? whole + static_cast<double>(random() % 65536) / 65536 : whole;
  };
  std::vector<BezierContour> contours;
  for (auto left = 1 + random() % 3; left > 0; --left) {
    std::vector<Point> list{{coordinate(), coordinate()}};
    std::vector<PointKind> kinds{PointKind::Node};
    const auto add = [&](PointKind kind) {
      Point next(coordinate(), coordinate());
      const auto along = random() % 4;  // often level with the last point, sometimes the same
      if (along != 0) next[random() % 2] = list.back()[0] == list.back()[1] ? next[0] : 0.0;
      if (along == 1) next.x() = list.back().x();
      if (along == 2) next.y() = list.back().y();
      if (random() % 16 == 0) next = list.back();
      list.push_back(next);
      kinds.push_back(kind);
    };
    const auto segments = 2 + random() % 60;
    for (std::size_t s = 0; s < segments; ++s) {
      if (random() % 2) {
        add(PointKind::Cubic);
        add(PointKind::Cubic);
        if (s + 1 < segments || random() % 2) add(PointKind::Node);  // else the curve closes the contour
      } else {
        add(PointKind::Node);
      }
    }
    if (random() % 8 == 0 && kinds.back() == PointKind::Node) list.back() = list.front();
    Points points(static_cast<Eigen::Index>(list.size()), 2);
    for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i].transpose();
    contours.emplace_back(points, kinds);
  }
  return contours;
}

}  // namespace

TEST_CASE("any outline comes back from its charstring", "[sfnt_cff]") {
  std::mt19937 random(5);
  for (int round = 0; round < 2000; ++round) {
    const auto outline = random_outline(random, round % 2 == 1);
    std::vector<bool> closed;
    for (const BezierContour& contour : outline) {
      closed.push_back(random() % 2 && contour.kinds().back() == PointKind::Node);
    }
    const bool has_width = random() % 2;
    const Bytes code = encode_charstring(outline, closed, has_width ? std::optional<double>(-123.0) : std::nullopt);
    const Charstring back = interpret(code, {}, {});
    REQUIRE(back.trouble == "");
    REQUIRE(back.contours == outline);
    CHECK(back.width.has_value() == has_width);
    for (std::size_t c = 0; c < closed.size(); ++c) CHECK((!closed[c] || back.is_closed_by_line[c]));
  }
}

TEST_CASE("charstrings are as short as their operators allow", "[sfnt_cff]") {
  const auto size = [](const std::string& words) {
    const Charstring glyph = read(words);
    return encode_charstring(glyph.contours, glyph.is_closed_by_line, glyph.width).size();
  };
  CHECK(size("10 20 rmoveto 100 100 -100 hlineto endchar") == 3 + 4 + 1);
  CHECK(size("10 hmoveto 108 1132 rlineto endchar") == 2 + 2 + 3 + 1 + 1);
  CHECK(size("10 hmoveto 1 2 3 4 5 6 7 8 rcurveline endchar") == 2 + 8 + 1 + 1);
  CHECK(size("10 hmoveto 7 8 1 2 3 4 5 6 rlinecurve endchar") == 2 + 8 + 1 + 1);
  CHECK(size("10 hmoveto 1 2 3 4 1 2 3 4 5 hvcurveto endchar") == 2 + 9 + 1 + 1);
  CHECK(size("10 hmoveto 9 1 2 3 4 1 2 3 4 hhcurveto endchar") == 2 + 9 + 1 + 1);
  CHECK(size("10 hmoveto 0.5 1 rlineto endchar") == 2 + 5 + 1 + 1 + 1);
}

TEST_CASE("what a charstring cannot hold is refused by name", "[sfnt_cff]") {
  const auto error_of = [](const std::vector<Point>& list, std::vector<PointKind> kinds) {
    Points points(static_cast<Eigen::Index>(list.size()), 2);
    for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i].transpose();
    return message_of<glyphs::sfnt::Malformed>(
        [&] { encode_charstring({BezierContour(points, std::move(kinds))}, {}, std::nullopt); });
  };
  using enum PointKind;
  CHECK(error_of({{0, 0}, {32768, 0}, {0, 9}}, {Node, Node, Node}) ==
        "contour 0, point 1: coordinate 32768 does not fit in 16 bits");
  CHECK(error_of({{-20000, 0}, {20000, 0}, {0, 9}}, {Node, Node, Node}) ==
        "contour 0, point 1: the step of 40000 to it does not fit in 16 bits");
  CHECK(error_of({{0, 0}, {1.0 / 3, 0}, {0, 9}}, {Node, Node, Node})
            .starts_with("contour 0, point 1: coordinate 0.333333"));
  CHECK(error_of({{0, 0}, {5, 0}, {0, 9}}, {Node, Quadratic, Node}) ==
        "contour 0, point 1: of a quadratic, which CFF does not have");
  CHECK(error_of({{0, 0}, {5, 0}, {0, 9}, {9, 9}}, {Cubic, Cubic, Node, Node}) == "contour 0: begins with a handle");
}

TEST_CASE("an edited glyph of a CID-keyed font is rewritten, all others keep their bytes", "[sfnt_cff]") {
  cff_bytes::Cff font = cff_of({});
  font.font_dicts = {
      {.local_subroutines = {charstring("100 hlineto 100 vlineto return")}, .matrix = {}},
      {.local_subroutines = {charstring("50 vlineto 50 hlineto return"), charstring("return")}, .matrix = {}},
      {.local_subroutines = {}, .matrix = {}}};
  font.between = {1, 2, 3, 4, 5};
  for (int id = 1; id < 60; ++id) {
    font.charstrings.push_back(charstring(
        fontcore::text(id, " 10 20 rmoveto -107 ", id % 3 == 2 ? "drop 7 8 9" : "callsubr -7", " hlineto endchar")));
  }
  for (int id = 0; id < 60; ++id) font.selection.push_back(id % 3);
  const Font loaded = load(font);
  for (const glyphs::Glyph& glyph : loaded.glyphs) REQUIRE(glyph.trouble == "");
  const auto before = sfnt_bytes::tables_of(*loaded.data);
  // One glyph grows over the offset size of the INDEX, another one shrinks.
  Points points(20000, 2);
  for (int i = 0; i < 20000; ++i) points.row(i) << 200 * (i % 7), 300 * (i % 5);
  for (const bool is_large : {false, true}) {
    glyphs::EditedGlyphs edited{{4, {transform(loaded.glyphs[4].contours[0], {.shift = Point(3, -5)})}}};
    if (is_large) edited[31] = {BezierContour(points, std::vector<PointKind>(20000, PointKind::Node))};
    const auto written = write_sfnt(loaded, edited);
    const auto after = sfnt_bytes::tables_of(written.data);
    const CffTable old_table(before.at("CFF "), 1000);
    const CffTable new_table(after.at("CFF "), 1000);
    CHECK(new_table.is_cid_keyed());
    for (int id = 0; id < 60; ++id) {
      const auto old_bytes = old_table.charstrings().object(id);
      const auto new_bytes = new_table.charstrings().object(id);
      if (!edited.contains(id)) CHECK(std::ranges::equal(old_bytes, new_bytes));
      CHECK(new_table.read(id).width == old_table.read(id).width);
    }
    CHECK(new_table.charstrings().offset_size == (is_large ? 3 : 2));
    CHECK(std::ranges::search(after.at("CFF "), font.between).size() == 5);
    for (const std::string tag : {"cmap", "maxp", "post"}) CHECK(after.at(tag) == before.at(tag));
    const Font again = glyphs::load_font_bytes("again.otf", written.data);
    for (const auto& [id, contours] : edited) CHECK(again.glyphs[static_cast<std::size_t>(id)].contours == contours);
  }
}

TEST_CASE("every glyph of the bundled CFF fonts comes back from another size, and all tables but the outlines' stay",
          "[sfnt_cff]") {
  for (const std::string name : {"cabin/Cabin-Regular.otf", "cabin/Cabin-Bold.otf",
                                 "eb-garamond/EBGaramond12-Regular.otf", "eb-garamond/EBGaramond12-Bold.otf"}) {
    INFO(name);
    const Font font = glyphs::load_font(bundled_font(name));
    glyphs::EditedGlyphs edited;
    for (const glyphs::Glyph& glyph : font.glyphs) {
      for (const BezierContour& contour : glyph.contours) {
        edited[glyph.id].push_back(
            transform(contour, {.linear = 3 * Eigen::Matrix2d::Identity(), .shift = Point(1, 1)}));
      }
    }
    const auto written = write_sfnt(font, edited);
    const Font again = glyphs::load_font_bytes("again.otf", written.data);
    for (const auto& [id, contours] : edited) CHECK(again.glyphs[static_cast<std::size_t>(id)].contours == contours);
    const auto before = sfnt_bytes::tables_of(*font.data);
    const auto after = sfnt_bytes::tables_of(written.data);
    for (const auto& [tag, bytes] : after) {
      const bool may_change = tag == "CFF " || tag == "head" || tag == "hhea" || tag == "hmtx";
      CHECK((may_change || bytes == before.at(tag)));
    }
    CHECK(sfnt_bytes::checksum(written.data) == 0xB1B0AFBA);
  }
}

TEST_CASE("top side bearings follow, so that an outline stays at its vertical origin", "[sfnt_cff]") {
  const cff_bytes::Cff cff = cff_of({square, square});
  Bytes vhea = sfnt_bytes::small_font({{}}).at("hhea");
  sfnt_bytes::set16(vhea, 34, 1);  // one advance for all
  Bytes vmtx;
  for (const int value : {1000, 0, 780, 780}) sfnt_bytes::put16(vmtx, value);
  const Font font =
      glyphs::load_font_bytes("tall.otf", otf_of(cff_bytes::table(cff), 3, {{"vhea", vhea}, {"vmtx", vmtx}}));
  const auto written = write_sfnt(font, {{2, {transform(font.glyphs[2].contours[0], {.shift = Point(0, 25)})}}});
  const auto after = sfnt_bytes::tables_of(written.data);
  CHECK(sfnt_bytes::get16(after.at("vmtx"), 4) == 780);
  CHECK(sfnt_bytes::get16(after.at("vmtx"), 6) == 755);
  CHECK(sfnt_bytes::get16(after.at("vhea"), 12) == 755);                          // the least top side bearing
  CHECK(sfnt_bytes::get16(after.at("vhea"), 16) == sfnt_bytes::get16(vhea, 16));  // 880, as before
  CHECK(written.changed_tables == std::vector<std::string>{"CFF", "head", "vhea", "vmtx"});
}

TEST_CASE("an edited CFF glyph loses its hints by name, and keeps its width", "[sfnt_cff]") {
  const Font font = load(cff_of({"77 1 2 hstem " + square, square}));
  CHECK(font.glyphs[1].has_hints);
  CHECK_FALSE(font.glyphs[2].has_hints);
  glyphs::EditedGlyphs edited;
  for (const int id : {1, 2}) {
    const Point shift(0.25, -1.0 / 3);
    edited[id] = {transform(font.glyphs[static_cast<std::size_t>(id)].contours[0], {.shift = shift})};
  }
  const auto written = write_sfnt(font, edited);
  CHECK(written.dropped_hints == std::vector{1});
  CHECK(written.changed_tables == std::vector<std::string>{"CFF", "head", "hhea"});
  const auto tables = sfnt_bytes::tables_of(written.data);  // the table looks into them
  const CffTable table(tables.at("CFF "), 1000);
  CHECK(table.read(1).width == 77);
  CHECK_FALSE(table.read(2).width);
  const Point corner = table.read(1).contours.at(0).point(0);
  CHECK(corner.x() == 10.25);
  CHECK(corner.y() == std::round((20 - 1.0 / 3) * 65536) / 65536);
}

TEST_CASE("a new table tells names and widths in few bytes, and reads back", "[sfnt_cff]") {
  const std::vector<BezierContour> outline = read(square).contours;
  glyphs::sfnt::NewCff made{.name = "Small", .units_per_em = 2048, .box = {10, 20, 110, 120}};
  made.names = {".notdef", "A", "B", "own", "other", "C"};
  made.outlines = {{}, outline, outline, outline, {}, outline};
  made.advances = {500, 600, 600, 650, 30000, 600};
  const Bytes bytes = build_cff(made);
  const CffTable table(bytes, 2048);
  CHECK_FALSE(table.is_cid_keyed());
  CHECK_FALSE(table.font_dict(1).is_scaled);
  CHECK_FALSE(table.read(1).width);  // the usual one
  CHECK(table.read(3).width);
  CHECK(drawn(table.read(3)) == drawn(read(square)));
  CHECK(table.standard_glyphs()['A'] == 1);
  CHECK(table.standard_glyphs()['C'] == 5);
  CHECK(table.standard_glyphs()['D'] == -1);
  const Font font = glyphs::load_font_bytes("made.otf", otf_of(bytes, 6));
  for (std::size_t id = 0; id < made.names.size(); ++id) CHECK(font.glyphs[id].name == made.names[id]);
  CHECK(font.glyphs[5].contours == outline);
  made.advances.pop_back();
  CHECK_THROWS_AS(build_cff(made), glyphs::sfnt::Malformed);
}

TEST_CASE("a new table of more names than there are numbers for is keyed by glyph ids", "[sfnt_cff]") {
  constexpr int count = 65535;
  glyphs::sfnt::NewCff made{.name = "Large"};
  for (int id = 0; id < count; ++id) made.names.push_back("g" + std::to_string(id));
  made.outlines.resize(count);
  made.outlines[1] = made.outlines[count - 1] = read(square).contours;
  made.advances.assign(count, 600);
  const Bytes bytes = build_cff(made);
  const CffTable table(bytes, 1000);
  CHECK(table.is_cid_keyed());
  CHECK(table.glyph_count() == count);
  CHECK(drawn(table.read(count - 1)) == drawn(read(square)));
  const Font font = glyphs::load_font_bytes("made.otf", otf_of(bytes, count));
  CHECK(font.glyphs[count - 1].contours == made.outlines[1]);
}
