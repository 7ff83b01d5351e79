#include "glyphs/variation.h"

#include <hb-ot.h>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "glyphs/sfnt_writer.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using fontcore::Point;
using glyphs::Bytes;
using glyphs::Font;
using glyphs::FontReadError;
using glyphs::load_font_bytes;
using glyphs::Location;
using glyphs::parse_location;
using glyphs::RequestError;
using sfnt_bytes::composite;
using sfnt_bytes::font_of;
using sfnt_bytes::get16;
using sfnt_bytes::put;
using sfnt_bytes::put16;
using sfnt_bytes::simple_glyph;
using sfnt_bytes::small_font;
using sfnt_bytes::tables_of;
using Tables = std::map<std::string, Bytes>;

Bytes words(const std::vector<int>& values) {
  Bytes bytes;
  for (const int value : values) put16(bytes, value);
  return bytes;
}
Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

constexpr int one = 0x4000;  // in 2.14

/// Axis wght from 100 over 400 to 900.
Bytes weight_axis() {
  Bytes fvar = words({1, 0, 16, 2, 1, 20, 0, 8});
  fvar.insert(fvar.end(), {'w', 'g', 'h', 't'});
  for (const int value : {100, 400, 900}) put(fvar, static_cast<std::uint32_t>(value) << 16, 4);
  put16(fvar, 0);
  put16(fvar, 256);
  return fvar;
}

/// Variations of one glyph: a tuple for heavier, and its points and deltas as packed bytes.
Bytes tuple(const Bytes& packed) {
  Bytes bytes = words({1, 10, static_cast<int>(packed.size()), 0xA000, one});
  bytes.insert(bytes.end(), packed.begin(), packed.end());
  bytes.resize((bytes.size() + 1) / 2 * 2);
  return bytes;
}

Bytes gvar_of(const std::vector<Bytes>& variations) {
  const int count = static_cast<int>(variations.size());
  Bytes gvar = words({1, 0, 1, 0});
  put(gvar, 0, 4);
  put16(gvar, count);
  put16(gvar, 0);
  put(gvar, static_cast<std::uint32_t>(20 + 2 * (count + 1)), 4);
  Bytes data;
  for (const Bytes& its : variations) {
    put16(gvar, static_cast<int>(data.size() / 2));
    data.insert(data.end(), its.begin(), its.end());
  }
  put16(gvar, static_cast<int>(data.size() / 2));
  return joined({gvar, data});
}

/// A variation store of one region, heavier, and one delta.
Bytes store_of(int delta) {
  Bytes store;
  put16(store, 1);
  put(store, 12, 4);
  put16(store, 1);
  put(store, 22, 4);
  return joined({store, words({1, 1, 0, one, one}), words({1, 1, 1, 0, delta})});
}

constexpr unsigned char low(int value) { return static_cast<unsigned char>(value & 0xFF); }

/// .notdef empty; A a triangle, all points moved; B a square, of which two points move and two follow; C a composite
/// of both whose second part moves. Kerning of A and B -50, 20 less at the heaviest; the x-height 40 more.
Tables variable_tables() {
  const Bytes triangle = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}}, 0x40, {0x4F});
  const Bytes square = simple_glyph({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}});
  Tables tables =
      small_font({{}, triangle, square, composite({{.glyph = 1}, {.glyph = 2, .first = 120, .second = 7}})});
  tables["fvar"] = weight_axis();
  tables["gvar"] = gvar_of({
      tuple({1, 0, 1, 0x00, 30, 0x80}),  // point 1, the advance: wider by 30
      tuple({0, 6, low(-10), 60, 20, 0, 50, 0, 0, 6, low(-5), low(-7), 45, 0, 0, 0, 0}),
      tuple({2, 1, 0, 2, 0x01, low(-20), 80, 0x01, low(-8), 31}),
      tuple({2, 1, 1, 2, 0x01, 33, 70, 0x81}),
  });
  tables["cvt "] = words({100, 200});
  tables["cvar"] = joined({words({1, 0, 1, 14, 5, 0xA000, one}), Bytes{1, 0, 1, 0x00, 44}});
  Bytes os2(96);
  sfnt_bytes::set16(os2, 0, 4);
  sfnt_bytes::set16(os2, 4, 400);
  sfnt_bytes::set16(os2, 86, 500);
  tables["OS/2"] = os2;
  Bytes mvar = words({1, 0, 0, 8, 1, 20});
  mvar.insert(mvar.end(), {'x', 'h', 'g', 't'});
  tables["MVAR"] = joined({mvar, words({0, 0}), store_of(40)});
  Bytes gdef = words({1, 3, 0, 0, 0, 0, 0});
  put(gdef, 18, 4);
  tables["GDEF"] = joined({gdef, store_of(-20)});
  // Pairs of glyph 1 with glyph 2: a value with a number and its variation.
  const Bytes scripts = joined({words({1}), Bytes{'D', 'F', 'L', 'T'}, words({8}), words({4, 0, 0, 0xFFFF, 1, 0})});
  const Bytes features = joined({words({1}), Bytes{'k', 'e', 'r', 'n'}, words({8}), words({0, 1, 0})});
  const Bytes lookups = words({1, 4, 2, 0, 1, 8});
  const Bytes pairs =
      words({1, 12, 0x44, 0, 1, 18, 1, 1, 1, /* pair set */ 1, 2, -50, 8, /* variation */ 0, 0, 0x8000});
  const int scripts_at = 10;
  const int features_at = scripts_at + static_cast<int>(scripts.size());
  const int lookups_at = features_at + static_cast<int>(features.size());
  tables["GPOS"] = joined({words({1, 0, scripts_at, features_at, lookups_at}), scripts, features, lookups, pairs});
  return tables;
}

Bytes variable_font() { return font_of(variable_tables()); }

Font at(const Bytes& data, double weight) { return load_font_bytes("v.ttf", data, {.location = {{"wght", weight}}}); }

/// Points and widths of the variable font itself by HarfBuzz, at a weight.
struct HarfBuzz {
  HarfBuzz(const Bytes& data, double weight) {
    hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(data.data()), static_cast<unsigned>(data.size()),
                                     HB_MEMORY_MODE_DUPLICATE, nullptr, nullptr);
    hb_face_t* face = hb_face_create(blob, 0);
    hb_blob_destroy(blob);
    font = hb_font_create(face);
    hb_face_destroy(face);
    const hb_variation_t variation{HB_TAG('w', 'g', 'h', 't'), static_cast<float>(weight)};
    hb_font_set_variations(font, &variation, 1);
  }
  HarfBuzz(const HarfBuzz&) = delete;
  HarfBuzz& operator=(const HarfBuzz&) = delete;
  ~HarfBuzz() { hb_font_destroy(font); }

  double advance(unsigned glyph) const { return hb_font_get_glyph_h_advance(font, glyph); }
  hb_glyph_extents_t extents(unsigned glyph) const {
    hb_glyph_extents_t extents{};
    REQUIRE(hb_font_get_glyph_extents(font, glyph, &extents));
    return extents;
  }
  /// Advance of A before B, kerning and all.
  int kerned() const {
    hb_buffer_t* buffer = hb_buffer_create();
    hb_buffer_add_utf8(buffer, "AB", -1, 0, -1);
    hb_buffer_guess_segment_properties(buffer);
    hb_shape(font, buffer, nullptr, 0);
    unsigned count = 0;
    const int advance = hb_buffer_get_glyph_positions(buffer, &count)[0].x_advance;
    hb_buffer_destroy(buffer);
    return advance;
  }
  hb_font_t* font = nullptr;
};

}  // namespace

TEST_CASE("an instance has the outlines, widths and kerning that HarfBuzz finds in the variable font", "[variation]") {
  const Bytes data = variable_font();
  for (const double weight : {100.0, 400.0, 525.0, 650.0, 777.0, 900.0}) {
    CAPTURE(weight);
    const Font font = at(data, weight);
    CHECK_FALSE(font.is_variable);
    const HarfBuzz of_variable(data, weight);
    const HarfBuzz of_instance(*font.data, weight);
    for (unsigned glyph = 0; glyph < 4; ++glyph) {
      CHECK(font.glyphs[glyph].advance == of_variable.advance(glyph));
      if (glyph == 0) continue;
      const auto wanted = of_variable.extents(glyph);
      const auto got = of_instance.extents(glyph);
      CHECK(std::abs(got.x_bearing - wanted.x_bearing) <= 1);
      CHECK(std::abs(got.y_bearing - wanted.y_bearing) <= 1);
      CHECK(std::abs(got.width - wanted.width) <= 2);
      CHECK(std::abs(got.height - wanted.height) <= 2);
    }
    CHECK(of_instance.kerned() == of_variable.kerned());
  }
}

TEST_CASE("at an end of its axis a font has its deltas whole, half way there half of them", "[variation]") {
  const Bytes data = variable_font();
  const Font heavy = at(data, 900);
  CHECK(heavy.glyphs[0].advance == 630);
  CHECK(heavy.glyphs[1].advance == 650);
  CHECK(heavy.glyphs[1].contours[0].points() == (fontcore::Points(3, 2) << -10, -5, 360, -7, 20, 345).finished());
  CHECK(heavy.glyphs[1].has_instructions);
  CHECK(heavy.glyphs[1].origin == 0);
  // Points 0 and 2 move; 1 and 3 share a side with each, and follow both.
  CHECK(heavy.glyphs[2].contours[0].points() ==
        (fontcore::Points(4, 2) << -20, -8, 380, -8, 380, 331, -20, 331).finished());
  CHECK(heavy.glyphs[3].components[1].placement.shift == Point(153, 7));
  CHECK(heavy.glyphs[3].advance == 670);
  const auto tables = tables_of(*heavy.data);
  CHECK(tables.at("cvt ") == words({100, 244}));
  CHECK(get16(tables.at("OS/2"), 86) == 540);
  CHECK(get16(tables.at("OS/2"), 4) == 900);
  CHECK(get16(tables.at("hhea"), 10) == 670);
  CHECK(get16(tables.at("head"), 36) == -20);
  for (const std::string gone : {"fvar", "gvar", "cvar", "MVAR"}) CHECK(tables.count(gone) == 0);
  CHECK(sfnt_bytes::checksum(*heavy.data) == 0xB1B0AFBA);
  const Font half = at(data, 650);
  CHECK(half.glyphs[1].contours[0].points() == (fontcore::Points(3, 2) << -5, -2, 330, -3, 10, 323).finished());
  CHECK(get16(tables_of(*half.data).at("OS/2"), 86) == 520);
  const Font light = at(data, 100);  // no tuple is about lighter weights
  CHECK(light.glyphs[1].contours == load_font_bytes("v.ttf", data).glyphs[1].contours);
}

TEST_CASE("avar bends an axis before its deltas count", "[variation]") {
  Tables tables = variable_tables();
  tables["avar"] = words({1, 0, 0, 1, 4, -one, -one, 0, 0, one / 2, one / 4, one, one});
  CHECK(at(font_of(tables), 650).glyphs[0].advance == 608);  // 600 + 30 / 4
}

TEST_CASE("a feature that stands for another at a place is that one in the instance", "[variation]") {
  Tables tables = variable_tables();
  // From half way on the feature has no lookup, so there is no kerning.
  Bytes gpos = tables["GPOS"];
  const int shift = 4;
  Bytes header = words({1, 1});
  for (std::size_t offset = 4; offset <= 8; offset += 2) put16(header, get16(gpos, offset) + shift);
  put(header, static_cast<std::uint32_t>(gpos.size() + shift), 4);
  Bytes variations = words({1, 0, 0, 1});
  put(variations, 16, 4);
  put(variations, 16 + 14, 4);
  variations = joined({variations, words({1, 0, 6, 1, 0, one / 2, one}), words({1, 0, 1, 0, 0, 12, 0, 0})});
  tables["GPOS"] = joined({header, Bytes(gpos.begin() + 10, gpos.end()), variations});
  const Bytes data = font_of(tables);
  for (const double weight : {400.0, 600.0, 700.0, 900.0}) {
    CAPTURE(weight);
    const Font font = at(data, weight);
    CHECK(font.warnings.empty());
    CHECK(HarfBuzz(*font.data, 0).kerned() == HarfBuzz(data, weight).kerned());
  }
  CHECK(HarfBuzz(*at(data, 900).data, 0).kerned() == 650);
  CHECK(HarfBuzz(*at(data, 400).data, 0).kerned() == 550);
}

TEST_CASE("an instance is edited like any static font, and a variable font is not edited", "[variation]") {
  const Bytes data = variable_font();
  const Font variable = load_font_bytes("v.ttf", data);
  REQUIRE(variable.is_variable);
  CHECK(glyphs::write_sfnt(variable, {}).data == data);
  const glyphs::Recipe recipe = glyphs::parse_recipe(R"({"steps": [{"op": "smooth", "scale": 5}]})", "r.json");
  CHECK(message_of<glyphs::RequestError>([&] { glyphs::restyle(variable, recipe); }) ==
        "v.ttf: is variable, and edited at one place of its design space only: give a --location");
  const Font font = at(data, 900);
  CHECK(glyphs::write_sfnt(font, {}).data == *font.data);
  auto wanted = font.glyphs[1].contours;
  wanted[0] = transform(wanted[0], {.shift = Point(3, 0)});
  const auto written = glyphs::write_sfnt(font, {{1, wanted}});
  CHECK(load_font_bytes("again.ttf", written.data).glyphs[1].contours == wanted);
}

TEST_CASE("a place in the design space is read strictly", "[variation]") {
  CHECK(parse_location("wght=650") == Location{{"wght", 650.0}});
  CHECK(parse_location("wght=650,slnt=-9.5") == Location{{"slnt", -9.5}, {"wght", 650.0}});
  const auto refusal = [](const std::string& list) { return message_of<RequestError>([&] { parse_location(list); }); };
  CHECK(refusal("") == "--location : \"\" is not of the form wght=650");
  CHECK(refusal("wght") == "--location wght: \"wght\" is not of the form wght=650");
  CHECK(refusal("weight=4") == "--location weight=4: \"weight=4\" is not of the form wght=650");
  CHECK(refusal("wght=650,") == "--location wght=650,: \"\" is not of the form wght=650");
  CHECK(refusal("wght=bold") == "--location wght=bold: \"bold\" is no number");
  CHECK(refusal("wght=650x") == "--location wght=650x: \"650x\" is no number");
  CHECK(refusal("wght=nan") == "--location wght=nan: \"nan\" is no number");
  CHECK(refusal("wght=1,wght=2") == "--location wght=1,wght=2: axis wght is given twice");

  const Bytes data = variable_font();
  const auto error_at = [&](const Bytes& font, const Location& location) {
    return message_of<FontReadError>([&] { load_font_bytes("v.ttf", font, {.location = location}); });
  };
  CHECK(error_at(data, {{"wght", 950}}) == "v.ttf: axis wght has no 950; its axes are wght from 100 to 900");
  CHECK(error_at(data, {{"wdth", 100}}) == "v.ttf: has no axis wdth; its axes are wght from 100 to 900");
  CHECK(error_at(font_of(small_font({{}})), {{"wght", 400}}) ==
        "v.ttf: is not variable; it has no other place to be read at");
}

TEST_CASE("tables of variations that lie end in one line, or leave the glyph they lie about as it is", "[variation]") {
  const Tables good = variable_tables();
  int read = 0;
  int refused = 0;
  for (const std::string table : {"fvar", "gvar", "cvar", "MVAR", "GDEF", "GPOS"}) {
    for (std::size_t at_byte = 0; at_byte < good.at(table).size(); ++at_byte) {
      for (const int value : {0x00, 0x7F, 0x80, 0xFF}) {
        Tables bad = good;
        bad[table][at_byte] = static_cast<unsigned char>(value);
        try {
          const Font font = at(font_of(bad), 900);
          CHECK(font.glyphs.size() == 4);
          ++read;
        } catch (const FontReadError& error) {
          CHECK(std::string(error.what()).starts_with("v.ttf: "));
          ++refused;
        }
      }
    }
    Tables cut = good;
    while (!cut[table].empty()) {
      cut[table].pop_back();
      try {
        at(font_of(cut), 900);
      } catch (const FontReadError& error) {
        CHECK(std::string(error.what()).starts_with("v.ttf: "));
      }
    }
  }
  CHECK(read > 0);
  CHECK(refused > 0);
}
