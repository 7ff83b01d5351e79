#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <random>
#include <set>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

const std::string liberation = "liberation-serif/LiberationSerif-Regular.ttf";

using fontcore::PointKind;
using glyphs::Bytes;
using glyphs::Font;
using glyphs::FontReadError;
using glyphs::Glyph;
using glyphs::load_font;
using glyphs::load_font_bytes;
using sfnt_bytes::composite;
using sfnt_bytes::font_of;
using sfnt_bytes::simple_glyph;
using sfnt_bytes::small_font;

const Bytes triangle = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}});

Font load_small(const std::vector<Bytes>& glyphs) { return load_font_bytes("small.ttf", font_of(small_font(glyphs))); }

const Glyph& named(const Font& font, const std::string& name) {
  return font.glyphs.at(static_cast<std::size_t>(font.find(name)));
}

/// x of the first point of what is drawn.
double first_x(const Font& font, int glyph) { return compose(font, glyph).at(0).point(0).x(); }

}  // namespace

TEST_CASE("a TrueType font gives its own points in their order", "[freetype_loader]") {
  const Font font = load_font(bundled_font(liberation));
  CHECK(font.units_per_em == 2048);
  CHECK(font.family == "Liberation Serif");
  CHECK(font.style == "Regular");
  CHECK(font.format == glyphs::OutlineFormat::TrueType);
  CHECK(font.ascender == 1825);
  CHECK(font.descender == -443);
  CHECK(font.glyphs.size() == 2602);
  CHECK(font.character_map.at(U'A') == font.find("A"));
  const Glyph& l = named(font, "l");
  REQUIRE(l.contours.size() == 1);
  CHECK(l.advance == 569);
  CHECK(l.has_instructions);
  CHECK(l.contours[0].point_count() == 10);
  CHECK_FALSE(named(font, "space").has_instructions);
  CHECK(font.find("no such glyph") == -1);
  CHECK_FALSE(font.has_outline(font.find("space")));
  CHECK(font.has_outline(font.find("Adieresis")));
}

TEST_CASE("a CFF font gives cubics in their order", "[freetype_loader]") {
  const Font font = load_font(bundled_font("cabin/Cabin-Regular.otf"));
  CHECK(font.format == glyphs::OutlineFormat::Cff);
  const Glyph& o = named(font, "o");
  REQUIRE(o.contours.size() == 2);
  for (const auto& contour : o.contours) {
    for (const PointKind kind : contour.kinds()) CHECK((kind == PointKind::Node || kind == PointKind::Cubic));
  }
}

TEST_CASE("every glyph has a name of its own", "[freetype_loader]") {
  const Font font = load_font(bundled_font(liberation));
  std::set<std::string> names;
  for (const Glyph& glyph : font.glyphs) names.insert(glyph.name);
  CHECK(names.size() == font.glyphs.size());

  // Without names in the font they come from the characters, then from the glyph's number.
  const Font nameless = load_small({{}, triangle, triangle});
  CHECK(nameless.glyphs[0].name == "gid0");
  CHECK(nameless.glyphs[1].name == "A");
  CHECK(nameless.glyphs[2].name == "B");
}

TEST_CASE("a name that another glyph has, or that cannot be printed, is replaced", "[freetype_loader]") {
  auto tables = small_font({{}, triangle, triangle, triangle});
  Bytes post;
  sfnt_bytes::put(post, 0x00020000, 4);
  post.resize(32);
  sfnt_bytes::put16(post, 4);
  for (int i = 0; i < 4; ++i) sfnt_bytes::put16(post, 258 + i);
  for (const std::string name : {"dup", "dup", "a\nb", "x"}) {
    post.push_back(static_cast<unsigned char>(name.size()));
    post.insert(post.end(), name.begin(), name.end());
  }
  tables["post"] = post;
  const Font font = load_font_bytes("names.ttf", font_of(tables));
  CHECK(font.glyphs[0].name == "dup");
  CHECK(font.glyphs[1].name == "A");
  CHECK(font.glyphs[2].name == "B");
  CHECK(font.glyphs[3].name == "x");
}

TEST_CASE("contours of one and two points are kept", "[freetype_loader]") {
  const Font font = load_small({{},
                                simple_glyph({{{10, 20}}, {{0, 0}, {100, 50}}, {{0, 0}, {300, 0}, {0, 300}}}),
                                simple_glyph({{{30, 40, false}}, {{0, 0, false}, {50, 90, false}}})});
  const Glyph& glyph = font.glyphs[1];
  REQUIRE(glyph.trouble == "");
  REQUIRE(glyph.contours.size() == 3);
  CHECK(glyph.contours[0].point_count() == 1);
  CHECK(glyph.contours[0].point(0) == fontcore::Point(10, 20));
  CHECK(glyph.contours[1].point_count() == 2);
  CHECK(glyph.contours[2].point_count() == 3);
  REQUIRE(font.glyphs[2].contours.size() == 2);
  CHECK(font.glyphs[2].contours[0].kinds() == std::vector{PointKind::Quadratic, PointKind::ImpliedNode});
  CHECK(font.glyphs[2].contours[1].point_count() == 4);
}

TEST_CASE("components are shifted, scaled and turned as the font says, in doubles", "[freetype_loader]") {
  const Font font = load_small({{},
                                triangle,
                                composite({{.glyph = 1, .first = 10, .second = -20}}),
                                composite({{.glyph = 1, .first = 7, .second = 0, .matrix = {0.5}}}),
                                composite({{.glyph = 1, .first = 0, .second = 0, .matrix = {0, 1, -1, 0}}}),
                                composite({{.glyph = 1, .first = 100, .more_flags = 0x0800, .matrix = {0.5}}}),
                                composite({{.glyph = 3, .first = 1}, {.glyph = 1, .first = 2}})});
  for (const Glyph& glyph : font.glyphs) REQUIRE(glyph.trouble == "");
  const auto drawn = [&](int glyph, std::size_t contour, int point) {
    return fontcore::Point(compose(font, glyph).at(contour).point(point) +
                           fontcore::Point(font.glyphs[static_cast<std::size_t>(glyph)].origin, 0));
  };
  CHECK(drawn(2, 0, 1) == fontcore::Point(310, -20));
  CHECK(drawn(3, 0, 1) == fontcore::Point(157, 0));
  CHECK(drawn(4, 0, 1) == fontcore::Point(0, 300));
  CHECK(drawn(5, 0, 0) == fontcore::Point(50, 0));  // SCALED_COMPONENT_OFFSET
  CHECK(drawn(6, 0, 1) == fontcore::Point(158, 0));
  CHECK(drawn(6, 1, 1) == fontcore::Point(302, 0));
  CHECK(dependents(font, {3}) == std::vector{3, 6});
  CHECK(dependents(font, {1}) == std::vector{1, 2, 3, 4, 5, 6});
}

TEST_CASE("a matched point of a component falls on the point it is matched to", "[freetype_loader]") {
  // Point 2 of the second triangle, (0, 300), onto point 1 of the first, (300, 0).
  const Font font =
      load_small({{}, triangle, composite({{.glyph = 1}, {.glyph = 1, .first = 1, .second = 2, .is_shift = false}})});
  REQUIRE(font.glyphs[2].trouble == "");
  CHECK(font.glyphs[2].components[1].matched_parent == 1);
  CHECK(font.glyphs[2].components[1].matched_child == 2);
  const auto contours = compose(font, 2);
  CHECK(contours.at(1).point(2) == contours.at(0).point(1));
}

TEST_CASE("a glyph is drawn from its left side bearing, as every renderer does", "[freetype_loader]") {
  // The stored points begin at x = 0, the bearing says 40.
  const Bytes user = composite({{.glyph = 1, .more_flags = 0x0200}});
  const Font font = load_font_bytes("shifted.ttf", font_of(small_font({{}, triangle, user}, 40)));
  CHECK(font.glyphs[1].contours[0].point(0).x() == 0);
  CHECK(font.glyphs[1].origin == -40);
  CHECK(first_x(font, 1) == 40);
  CHECK(font.glyphs[2].origin == -40);  // USE_MY_METRICS
  CHECK(first_x(font, 2) == 40);
}

TEST_CASE("what cannot be composed is named at the glyph, and the font is still read", "[freetype_loader]") {
  SECTION("a cycle, and what leads to it") {
    const Font font = load_small({{}, composite({{.glyph = 2}}), composite({{.glyph = 1}}), composite({{.glyph = 1}})});
    for (const int id : {1, 2, 3}) {
      CHECK(font.glyphs[static_cast<std::size_t>(id)].trouble == "its components form a cycle, or lead to one");
      CHECK_FALSE(font.has_outline(id));
      CHECK(message_of<FontReadError>([&] {
              compose(font, id);
            }).starts_with("small.ttf: " + font.glyphs[static_cast<std::size_t>(id)].name + ": "));
    }
  }
  SECTION("nesting deeper than 32") {
    std::vector<Bytes> chain{triangle};
    for (int i = 0; i < 60; ++i) chain.push_back(composite({{.glyph = i}}));
    const Font font = load_small(chain);
    CHECK(font.glyphs[32].trouble == "");
    CHECK(compose(font, 32).size() == 1);
    CHECK(font.glyphs[33].trouble == "components nest deeper than 32");
    CHECK(font.glyphs[60].trouble.ends_with(" cannot be read"));
  }
  SECTION("parts of parts that multiply") {
    std::vector<Bytes> bomb{triangle, {}};
    for (int i = 0; i < 30; ++i) {
      bomb.push_back(composite(std::vector<sfnt_bytes::Part>(10, {.glyph = i == 0 ? 0 : i + 1})));
    }
    for (int i = 0; i < 30; ++i) {  // of nothing: no points, but ever more parts
      bomb.push_back(composite(std::vector<sfnt_bytes::Part>(10, {.glyph = i == 0 ? 1 : 31 + i})));
    }
    const Font font = load_small(bomb);
    CHECK(font.glyphs[5].trouble == "");
    CHECK(font.glyphs[6].trouble == "more than 65535 points");
    CHECK(font.glyphs[7].trouble.ends_with(" cannot be read"));
    CHECK(font.glyphs[36].trouble == "more than 65535 components");
  }
  SECTION("a component that is not in the font, a point that is not in the component") {
    const Font font = load_small({{},
                                  triangle,
                                  composite({{.glyph = 99}}),
                                  composite({{.glyph = 1}, {.glyph = 1, .first = 5, .second = 0, .is_shift = false}})});
    CHECK(font.glyphs[2].trouble != "");
    CHECK(font.glyphs[3].trouble == "component A matches its point 0 of 3 to point 5 of 3");
    CHECK(font.glyphs[1].trouble == "");
  }
  SECTION("bytes that end early, offsets that fall") {
    Bytes cut = triangle;
    cut.resize(20);
    CHECK(load_small({{}, cut, triangle}).glyphs[1].trouble.starts_with("FreeType: "));
    auto tables = small_font({{}, triangle, triangle});
    sfnt_bytes::set16(tables["loca"], 4, 0x7FFF);
    const Font font = load_font_bytes("loca.ttf", font_of(tables));
    CHECK(font.glyphs[1].trouble.starts_with("loca gives it bytes 0 to 65534"));
    CHECK(font.glyphs[0].trouble == "");
  }
}

TEST_CASE("composing checks by itself, for fonts that no loader has seen", "[freetype_loader]") {
  Font font;
  font.path = "made.ttf";
  font.glyphs.resize(2);
  font.glyphs[0].name = "a";
  font.glyphs[1].name = "b";
  font.glyphs[0].components = {{.glyph = 1, .placement = {}}};
  font.glyphs[1].components = {{.glyph = 0, .placement = {}}};
  CHECK(
      message_of<FontReadError>([&] { compose(font, 0); }).starts_with("made.ttf: a: components nest deeper than 32"));
  CHECK_FALSE(font.has_outline(0));
  CHECK(dependents(font, {0}) == std::vector{0, 1});
  font.glyphs[1].components.clear();
  font.glyphs[0].components[0].matched_parent = 3;
  CHECK(message_of<FontReadError>([&] { compose(font, 0); }) ==
        "made.ttf: a: point 3 to be matched does not exist, in a");
  CHECK(message_of<FontReadError>([&] { compose(font, 7); }) == "made.ttf: there is no glyph 7 among 2");
}

TEST_CASE("what is no font is refused in one line that names the file", "[freetype_loader]") {
  const Bytes good = font_of(small_font({{}, triangle}));
  const auto error_of = [](Bytes data) {
    return message_of<FontReadError>([&] { load_font_bytes("f.ttf", std::move(data)); });
  };
  CHECK(error_of(good) == "");
  CHECK(error_of({}) == "f.ttf: is empty");
  CHECK(error_of({0, 1}) == "f.ttf: is not a font: it has 2 bytes");
  CHECK(error_of(Bytes(100, 'x')) == "f.ttf: is not a TrueType or OpenType font");
  CHECK(error_of(Bytes{'w', 'O', 'F', 'F', 0, 0, 0, 0, 0, 0, 0, 0}) == "f.ttf: is truncated: a WOFF font of 12 bytes");
  for (const std::string tag : {"head", "hhea", "hmtx", "maxp", "loca"}) {
    auto tables = small_font({{}, triangle});
    tables.erase(tag);
    CHECK(error_of(font_of(tables)) == "f.ttf: table " + tag + " is missing");
  }
  auto tables = small_font({{}, triangle});
  tables.erase("glyf");
  CHECK(error_of(font_of(tables)) == "f.ttf: has no outlines: no table glyf, CFF or CFF2");
  tables = small_font({{}, triangle});
  tables["hmtx"].pop_back();
  CHECK(error_of(font_of(tables)) == "f.ttf: table hmtx has 7 bytes, needs 8");
  tables["loca"].pop_back();
  tables["hmtx"].push_back(0);
  CHECK(error_of(font_of(tables)) == "f.ttf: table loca has 5 bytes, needs 6");

  CHECK(message_of<FontReadError>([] { load_font("/no/such/font.ttf"); }) ==
        "/no/such/font.ttf: cannot be read: No such file or directory");
  CHECK(message_of<FontReadError>([] { load_font("/tmp"); }) ==
        "/tmp: is a folder without metainfo.plist, so it is no UFO");
  CHECK(message_of<FontReadError>([] { load_font("/dev/null"); }) == "/dev/null: is not a regular file");
  const std::string path = bundled_font(liberation);
  CHECK(message_of<FontReadError>([&] { load_font(path, {.face = 1}); }) == path + ": has 1 faces; there is no face 1");
}

TEST_CASE("a directory that lies is refused", "[freetype_loader]") {
  const Bytes good = font_of(small_font({{}, triangle}));
  const auto with = [&](std::size_t at, int value) {
    Bytes data = good;
    sfnt_bytes::set16(data, at, value);
    return message_of<FontReadError>([&] { load_font_bytes("f.ttf", data); });
  };
  CHECK(with(4, 0) == "f.ttf: is not a font: it has no tables");
  CHECK(with(4, 0xFFFF).starts_with("f.ttf: is truncated: the directory of 65535 tables"));
  CHECK(with(12 + 8, 0x7FFF).starts_with("f.ttf: is truncated: table OS/2 ends at"));
  CHECK(with(12 + 14, 0x7FFF).starts_with("f.ttf: is truncated: table OS/2 ends at"));
  CHECK(with(12 + 10, 4) == "f.ttf: table OS/2 lies at 4, inside the directory");
  const int glyf = static_cast<int>(sfnt_bytes::get(good, 12 + 2 * 16 + 8, 4));
  CHECK(with(12 + 10, glyf) == "f.ttf: tables OS/2 and glyf overlap");
}

TEST_CASE("faces of a collection are read by their number", "[freetype_loader]") {
  // Two faces over two whole fonts, offsets moved by the header.
  const Bytes font = font_of(small_font({{}, triangle}));
  Bytes data{'t', 't', 'c', 'f', 0, 1, 0, 0, 0, 0, 0, 2};
  const auto header = static_cast<std::uint32_t>(20);
  sfnt_bytes::put(data, header, 4);
  sfnt_bytes::put(data, header + static_cast<std::uint32_t>(font.size()), 4);
  for (std::uint32_t base : {header, header + static_cast<std::uint32_t>(font.size())}) {
    Bytes face = font;
    for (std::size_t i = 0; i < sfnt_bytes::get(font, 4, 2); ++i) {
      const std::size_t at = 12 + 16 * i + 8;
      Bytes moved;
      sfnt_bytes::put(moved, sfnt_bytes::get(font, at, 4) + base, 4);
      std::copy(moved.begin(), moved.end(), face.begin() + static_cast<std::ptrdiff_t>(at));
    }
    data.insert(data.end(), face.begin(), face.end());
  }
  for (const int face : {0, 1}) {
    const Font read = load_font_bytes("two.ttc", data, {.face = face});
    CHECK(read.is_collection);
    CHECK(read.face_index == face);
    CHECK(read.glyphs.size() == 2);
    CHECK(compose(read, 1).size() == 1);
  }
  CHECK(message_of<FontReadError>([&] { load_font_bytes("two.ttc", data, {.face = 2}); }) ==
        "two.ttc: has 2 faces; there is no face 2");
  CHECK(message_of<FontReadError>([&] { load_font_bytes("two.ttc", data, {.face = -1}); }) ==
        "two.ttc: has 2 faces; there is no face -1");
}

TEST_CASE("a truncated font is refused or read, never a crash", "[freetype_loader]") {
  for (const std::string name : {"open-sans/OpenSans-Regular.ttf", "cabin/Cabin-Regular.otf"}) {
    const Bytes whole = glyphs::read_file(bundled_font(name));
    for (std::size_t length = 0; length < whole.size(); length += length < 400 ? 7 : 1 + whole.size() / 97) {
      const std::string error = message_of<FontReadError>(
          [&] { load_font_bytes("cut", Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length))); });
      CHECK(error.starts_with("cut: "));
      CHECK(std::count(error.begin(), error.end(), '\n') == 0);
    }
  }
}

TEST_CASE("a font with random bytes is refused or read, never a crash", "[freetype_loader]") {
  std::mt19937 random(1);
  const Bytes whole = glyphs::read_file(bundled_font("open-sans/OpenSans-Regular.ttf"));
  for (int round = 0; round < 60; ++round) {
    Bytes data = whole;
    for (int i = 0; i < 200; ++i) data[random() % data.size()] = static_cast<unsigned char>(random());
    const std::string error = message_of<FontReadError>([&] {
      const Font font = load_font_bytes("noise", data);
      for (const Glyph& glyph : font.glyphs) {
        if (glyph.trouble.empty()) compose(font, glyph.id);
      }
    });
    CHECK((error.empty() || error.starts_with("noise: ")));
  }
}
