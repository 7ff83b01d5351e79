#include "glyphs/variation.h"

#include <hb-ot.h>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "glyphs/sfnt_writer.h"
#include "tests/catch.h"
#include "tests/glyphs/sanitizer.h"
#include "tests/glyphs/variable_bytes.h"

namespace {

using glyphs::Font;
using glyphs::FontReadError;
using glyphs::load_font_bytes;
using glyphs::Location;
using glyphs::parse_location;
using glyphs::RequestError;
using namespace variable_bytes;

Bytes variable_font() { return font_of(variable_tables()); }

Font at(const Bytes& data, double weight) { return load_font_bytes("v.ttf", data, {.location = {{"wght", weight}}}); }

/// Points and widths of the variable font itself by HarfBuzz, at a place.
struct HarfBuzz {
  HarfBuzz(const Bytes& data, double weight) : HarfBuzz(data, Location{{"wght", weight}}) {}
  HarfBuzz(const Bytes& data, const Location& location) {
    hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(data.data()), static_cast<unsigned>(data.size()),
                                     HB_MEMORY_MODE_DUPLICATE, nullptr, nullptr);
    hb_face_t* face = hb_face_create(blob, 0);
    hb_blob_destroy(blob);
    font = hb_font_create(face);
    hb_face_destroy(face);
    std::vector<hb_variation_t> variations;
    for (const auto& [axis, value] : location) {
      variations.push_back({hb_tag_from_string(axis.c_str(), -1), static_cast<float>(value)});
    }
    hb_font_set_variations(font, variations.data(), static_cast<unsigned>(variations.size()));
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
  CHECK(heavy.glyphs[3].components[1].placement.shift == fontcore::Point(153, 7));
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
  wanted[0] = transform(wanted[0], {.shift = fontcore::Point(3, 0)});
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

// ---- CFF2

namespace {

Font cff2_at(const Tables& tables, const Location& location) {
  return load_font_bytes("v.otf", otto(tables), {.location = location});
}

fontcore::Points rectangle(double left, double bottom, double right, double top) {
  return (fontcore::Points(4, 2) << left, bottom, right, bottom, right, top, left, top).finished();
}

const std::string hints_warning = "CFF2: its hints and subroutines are gone; the outlines are CFF now";

}  // namespace

TEST_CASE("a CFF2 font at a place is a CFF font with the blends of the place, in whole numbers", "[variation][cff]") {
  const Tables tables = cff2_tables();
  const Font heavy = cff2_at(tables, {{"wght", 900}});
  CHECK(heavy.format == glyphs::OutlineFormat::Cff);
  CHECK_FALSE(heavy.is_variable);
  CHECK_FALSE(heavy.has_fractional_coordinates);
  CHECK(heavy.warnings == std::vector<std::string>{hints_warning});
  CHECK(heavy.glyphs[0].contours.empty());
  CHECK(heavy.glyphs[1].contours[0].points() == (fontcore::Points(3, 2) << -10, -5, 360, -7, 20, 345).finished());
  CHECK(heavy.glyphs[2].contours[0].points() == rectangle(30, 35, 390, 375));
  CHECK(cff2_at(tables, {{"wdth", 75}}).glyphs[2].contours[0].points() == rectangle(12, 43, 222, 363));
  const Font both = cff2_at(tables, {{"wght", 900}, {"wdth", 75}});
  CHECK(both.glyphs[2].contours[0].points() == rectangle(22, 38, 292, 398));
  const Font half = cff2_at(tables, {{"wght", 650}});
  CHECK(half.glyphs[1].contours[0].points() == (fontcore::Points(3, 2) << -5, -2, 330, -3, 10, 323).finished());
  CHECK(half.glyphs[2].contours[0].points() == rectangle(25, 38, 355, 358));
  const Font initial = load_font_bytes("v.otf", otto(tables));
  CHECK(initial.format == glyphs::OutlineFormat::Cff2);
  const Font light = cff2_at(tables, {{"wght", 100}});  // no region is about lighter weights
  for (std::size_t k = 0; k < 4; ++k) {
    CHECK(light.glyphs[k].contours == initial.glyphs[k].contours);
    if (k > 0) CHECK(light.glyphs[k].name == initial.glyphs[k].name);
  }
}

TEST_CASE("metrics of a CFF2 font follow HVAR, MVAR and the outlines of the place", "[variation][cff]") {
  const Font font = cff2_at(cff2_tables(), {{"wght", 900}, {"wdth", 75}});
  const std::vector<double> advances{630, 643, 570, 600};
  for (std::size_t k = 0; k < 4; ++k) CHECK(font.glyphs[k].advance == advances[k]);
  const Bytes& data = *font.data;
  CHECK(std::string(data.begin(), data.begin() + 4) == "OTTO");
  CHECK(checksum(data) == 0xB1B0AFBA);
  const auto tables = tables_of(data);
  for (const std::string gone : {"fvar", "CFF2", "HVAR", "MVAR"}) CHECK(tables.count(gone) == 0);
  CHECK(tables.at("maxp") == Bytes{0, 0, 0x50, 0, 0, 4});
  CHECK((get16(tables.at("head"), 16) & 2) == 2);  // bearings are xMin
  CHECK(get16(tables.at("hmtx"), 4 * 1 + 2) == -10);
  CHECK(get16(tables.at("hmtx"), 4 * 2 + 2) == 22);
  CHECK(get16(tables.at("hhea"), 10) == 643);
  CHECK(get16(tables.at("hhea"), 12) == -10);
  CHECK(get16(tables.at("head"), 36) == -10);
  CHECK(get16(tables.at("head"), 42) == 398);
  CHECK(get16(tables.at("OS/2"), 86) == 530);
  CHECK(get16(tables.at("OS/2"), 4) == 900);
  CHECK(get16(tables.at("OS/2"), 6) == 3);
}

TEST_CASE("a CFF2 font's instance has the outlines and widths that HarfBuzz finds in it", "[variation][cff]") {
  Tables tables = cff2_tables();
  tables["avar"] = words({1, 0, 0, 2, 4, -one, -one, 0, 0, one / 2, one / 3, one, one, 0});
  const Bytes data = otto(tables);
  for (const double weight : {100.0, 400.0, 525.0, 650.0, 777.0, 900.0}) {
    for (const double width : {75.0, 81.0, 100.0}) {
      CAPTURE(weight, width);
      const Location location{{"wght", weight}, {"wdth", width}};
      const Font font = load_font_bytes("v.otf", data, {.location = location});
      const HarfBuzz of_variable(data, location);
      const HarfBuzz of_instance(*font.data, Location{});
      for (unsigned glyph = 0; glyph < 4; ++glyph) {
        CHECK(font.glyphs[glyph].advance == of_variable.advance(glyph));
        CHECK(of_instance.advance(glyph) == of_variable.advance(glyph));
        if (glyph == 0) continue;
        const auto wanted = of_variable.extents(glyph);
        const auto got = of_instance.extents(glyph);
        CHECK(std::abs(got.x_bearing - wanted.x_bearing) <= 1);
        CHECK(std::abs(got.y_bearing - wanted.y_bearing) <= 1);
        CHECK(std::abs(got.width - wanted.width) <= 2);
        CHECK(std::abs(got.height - wanted.height) <= 2);
      }
    }
  }
}

TEST_CASE("glyphs find their variations by a map of either format, those behind its end by its last entry",
          "[variation][cff]") {
  Tables tables = cff2_tables();
  const std::vector<std::vector<int>> rows{{11, 0}, {22, 0}, {33, 0}};
  const auto advances = [&](const std::vector<Bytes>& maps) {
    tables["HVAR"] = varied_metrics(rows, 20, maps);
    std::vector<double> list;
    for (const glyphs::Glyph& glyph : cff2_at(tables, {{"wght", 900}}).glyphs) list.push_back(glyph.advance);
    return list;
  };
  CHECK(advances({}) == std::vector<double>{611, 622, 633, 600});  // no row for glyph 3
  const Bytes short_map{0, 0x01, 0, 3, 2, 0, 1};                   // entries of a byte, inner numbers of two bits
  CHECK(advances({short_map}) == std::vector<double>{633, 611, 622, 622});
  const Bytes long_map{1, 0x13, 0, 0, 0, 4, 0, 1, 0, 1, 0, 2, 0xFF, 0xFF};  // of two, inner ones of four bits
  CHECK(advances({long_map}) == std::vector<double>{622, 622, 633, 600});
  tables.erase("HVAR");
  CHECK(cff2_at(tables, {{"wght", 900}}).glyphs[1].advance == 600);
}

TEST_CASE("a CFF2 font's vertical metrics follow VVAR from its vertical origins", "[variation][cff]") {
  Tables tables = cff2_tables();
  Bytes vhea = tables["hhea"];
  set16(vhea, 34, 1);
  tables["vhea"] = vhea;
  tables["vmtx"] = words({1000, 0, 500, 540, 600});  // heights of 1000; top side bearings
  const auto tops = [&] {
    const auto written = tables_of(*cff2_at(tables, {{"wght", 900}, {"wdth", 75}}).data);
    const std::size_t longs = get(written.at("vhea"), 34, 2);
    std::vector<int> list;
    for (std::size_t k = 0; k < 4; ++k) {
      list.push_back(get16(written.at("vmtx"), k < longs ? 4 * k + 2 : 4 * longs + 2 * (k - longs)));
    }
    return list;
  };
  // Tops go from 300 to 345 and from 340 to 398; that of C goes from 200 to 290.
  CHECK(tops() == std::vector<int>{0, 500 - 45, 540 - 58, 600 + 200 - 290});
  SECTION("by VVAR's rows for top side bearings, where there are some") {
    const Bytes zero_map{0, 0x01, 0, 1, 0};
    tables["VVAR"] = varied_metrics({{25, 5}}, 24, {zero_map, zero_map});
    CHECK(tops() == std::vector<int>{30, 530, 570, 630});
  }
  SECTION("from VORG, which moves along") {
    tables["VORG"] = words({1, 0, 880, 1, 2, 900});
    CHECK(tops() == std::vector<int>{0, 880 - 345, 900 - 398, 880 - 290});
    tables["VVAR"] = varied_metrics({{40, -20}, {0, 1}}, 24, {{}, {}, {}, Bytes{0, 0x01, 0, 2, 0, 1}});
    CHECK(tops() == std::vector<int>{0, 881 - 345, 901 - 398, 881 - 290});
    const Font font = cff2_at(tables, {{"wght", 900}, {"wdth", 75}});
    CHECK(tables_of(*font.data).at("VORG") == words({1, 0, 881, 2, 0, 900, 2, 901}));
    CHECK(get16(tables_of(*font.data).at("vmtx"), 0) == 1020);
  }
}

TEST_CASE("an instance of a CFF2 font is restyled to a font that sanitizers take", "[variation][cff]") {
  const Bytes data = otto(cff2_tables());
  const glyphs::Recipe recipe = glyphs::parse_recipe(
      R"({"steps": [{"op": "sweep", "near": [200, 300], "move": [12, 5], "breadth": 300}]})", "r.json");
  CHECK(message_of<RequestError>([&] { glyphs::restyle(load_font_bytes("v.otf", data), recipe); }) ==
        "v.otf: is variable, and edited at one place of its design space only: give a --location");
  for (const double weight : {100.0, 650.0, 900.0}) {
    const Font font = load_font_bytes("v.otf", data, {.location = {{"wght", weight}}});
    CHECK(is_accepted_by_sanitizer(*font.data));
    const auto result = glyphs::restyle(font, recipe);
    CHECK(result.changed() > 0);
    CHECK(is_accepted_by_sanitizer(result.font.data));
  }
}

TEST_CASE("a charstring that is no program comes out empty at a place, and is named", "[variation][cff]") {
  Tables tables = cff2_tables();
  tables["CFF2"] = cff2_table({.charstrings = {{},
                                               cff_bytes::charstring("10 20 30 2 blend rmoveto"),
                                               cff_bytes::charstring("0 0 rmoveto 100 hlineto 100 vlineto"),
                                               cff_bytes::charstring("-107 callsubr")},
                               .store = variation_store(heavier_and_narrower, {{{0}, {}}})});
  const Font font = cff2_at(tables, {{"wght", 900}});
  REQUIRE(font.warnings.size() == 2);
  CHECK(font.warnings[1].starts_with("CFF2: 2 glyphs are empty now; the first is gid:1: "));
  CHECK(font.glyphs[1].contours.empty());
  CHECK(font.glyphs[1].advance == 650);
  CHECK(font.glyphs[2].contours.size() == 1);
}

TEST_CASE("variations of CFF2 that would keep a reader busy are refused", "[variation][cff]") {
  Tables tables = cff2_tables();
  const auto error = [&](const Location& location) {
    return message_of<FontReadError>([&] { cff2_at(tables, location); });
  };
  tables["CFF2"] = cff2_table({.charstrings = std::vector<Bytes>(4),
                               .store = variation_store(heavier_and_narrower, {{std::vector<int>(513, 0), {}}})});
  const std::string too_many = "v.otf: table CFF2: a list of 513 regions, more than a charstring can blend by";
  CHECK(error({}) == too_many);
  CHECK(error({{"wght", 900}}) == too_many);
  tables.erase("CFF2");
  tables["CFF "] = cff_bytes::table({.charstrings = std::vector<Bytes>(4, cff_bytes::charstring("endchar"))});
  CHECK(error({{"wght", 900}}) ==
        "v.otf: is variable, but neither TrueType nor CFF2; only those are read at a place of their design space");
}
