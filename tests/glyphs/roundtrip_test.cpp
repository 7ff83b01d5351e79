// Font to font: what is edited comes back exactly as asked, all else bit for bit.

#include <algorithm>
#include <random>
#include <set>

#include "glyphs/font_file.h"
#include "glyphs/sfnt_writer.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using fontcore::BezierContour;
using fontcore::PointKind;
using fontcore::Points;
using glyphs::Bytes;
using glyphs::EditedGlyphs;
using glyphs::Font;
using glyphs::Glyph;

const std::vector<std::string> truetype_fonts{"liberation-serif/LiberationSerif-Regular.ttf",
                                              "liberation-serif/LiberationSerif-Bold.ttf",
                                              "open-sans/OpenSans-Regular.ttf", "open-sans/OpenSans-Bold.ttf"};
const std::vector<std::string> cff_fonts{"cabin/Cabin-Regular.otf", "cabin/Cabin-Bold.otf",
                                         "eb-garamond/EBGaramond12-Regular.otf", "eb-garamond/EBGaramond12-Bold.otf"};

Font load_bundled(const std::string& name) {
  return glyphs::load_font(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name);
}

/// a-z and A-Z with every point moved by whole units, at random.
EditedGlyphs shake(const Font& font, unsigned seed) {
  std::mt19937 random(seed);
  const auto step = [&] { return static_cast<double>(random() % 41) - 20.0; };
  EditedGlyphs edited;
  for (const auto& [code, id] : font.character_map) {
    const Glyph& glyph = font.glyphs[static_cast<std::size_t>(id)];
    const bool is_letter = (code >= U'a' && code <= U'z') || (code >= U'A' && code <= U'Z');
    if (!is_letter || glyph.is_composite()) continue;
    for (const BezierContour& contour : glyph.contours) {
      Points points = contour.points();
      const Eigen::Index n = points.rows();
      for (Eigen::Index i = 0; i < n; ++i) {
        if (contour.kind(static_cast<int>(i)) == PointKind::ImpliedNode) continue;
        points(i, 0) += step();
        points(i, 1) += step();
      }
      for (Eigen::Index i = 0; i < n; ++i) {
        if (contour.kind(static_cast<int>(i)) != PointKind::ImpliedNode) continue;
        points.row(i) = 0.5 * (points.row((i + n - 1) % n) + points.row((i + 1) % n));
      }
      edited[id].push_back(contour.with_points(points));
    }
  }
  return edited;
}

std::vector<int> ids(const EditedGlyphs& edited) {
  std::vector<int> list;
  for (const auto& [id, contours] : edited) list.push_back(id);
  return list;
}

}  // namespace

TEST_CASE("a font in which nothing is edited comes back bit for bit", "[roundtrip]") {
  std::vector<std::string> all = truetype_fonts;
  all.insert(all.end(), cff_fonts.begin(), cff_fonts.end());
  for (const std::string& name : all) {
    const Font font = load_bundled(name);
    EditedGlyphs zero;
    for (const Glyph& glyph : font.glyphs) {
      if (!glyph.contours.empty()) zero[glyph.id] = glyph.contours;
    }
    for (const EditedGlyphs& edited : {EditedGlyphs{}, zero}) {
      const auto written = write_sfnt(font, edited);
      CHECK(written.data == *font.data);
      CHECK(written.changed_tables.empty());
      CHECK(written.dropped_tables.empty());
      CHECK(written.dropped_instructions.empty());
    }
  }
}

TEST_CASE("edited letters come back exactly, all else as it was", "[roundtrip]") {
  std::vector<std::string> all = truetype_fonts;
  all.insert(all.end(), cff_fonts.begin(), cff_fonts.end());
  for (const std::string& name : all) {
    INFO(name);
    const Font font = load_bundled(name);
    const EditedGlyphs edited = shake(font, 1);
    REQUIRE(edited.size() == 52);
    const auto written = write_sfnt(font, edited);
    const Font read = glyphs::load_font_bytes("again.ttf", written.data);

    int wrong = 0;
    for (const Glyph& glyph : font.glyphs) {
      const Glyph& back = read.glyphs.at(static_cast<std::size_t>(glyph.id));
      const auto at = edited.find(glyph.id);
      wrong += back.contours != (at == edited.end() ? glyph.contours : at->second);
      wrong += back.name != glyph.name || back.advance != glyph.advance || back.origin != glyph.origin;
      wrong += back.components.size() != glyph.components.size();
    }
    CHECK(wrong == 0);
    CHECK(read.character_map == font.character_map);

    // By the bytes: tables, glyphs, advances.
    const auto before = sfnt_bytes::tables_of(*font.data);
    const auto after = sfnt_bytes::tables_of(written.data);
    const std::set<std::string> may_change{"CFF ", "glyf", "head", "hhea", "hmtx", "loca", "maxp"};
    const std::set<std::string> may_go{"DSIG", "LTSH", "VDMX", "hdmx"};
    for (const auto& [tag, bytes] : before) {
      INFO(tag);
      CHECK(after.contains(tag) != may_go.contains(tag));
      if (!may_change.contains(tag) && !may_go.contains(tag)) CHECK(after.at(tag) == bytes);
      const bool is_listed = std::ranges::count(written.changed_tables, tag == "CFF " ? "CFF" : tag) > 0;
      if (after.contains(tag)) CHECK(is_listed == (after.at(tag) != bytes));
    }
    CHECK(after.size() + written.dropped_tables.size() == before.size());
    CHECK(sfnt_bytes::checksum(written.data) == 0xB1B0AFBA);
    if (font.format == glyphs::OutlineFormat::Cff) continue;
    const auto old_glyphs = sfnt_bytes::glyphs_of(before);
    const auto new_glyphs = sfnt_bytes::glyphs_of(after);
    const std::vector<int> reached = dependents(font, ids(edited));
    int changed = 0;
    for (std::size_t id = 0; id < old_glyphs.size(); ++id) {
      if (!std::binary_search(reached.begin(), reached.end(), static_cast<int>(id))) {
        changed += new_glyphs[id] != old_glyphs[id];
      } else if (font.glyphs[id].is_composite()) {  // all but its box
        changed += !std::equal(new_glyphs[id].begin() + 10, new_glyphs[id].end(), old_glyphs[id].begin() + 10,
                               old_glyphs[id].end());
      }
      changed += id < sfnt_bytes::get(before.at("hhea"), 34, 2) &&
                 sfnt_bytes::get(after.at("hmtx"), 4 * id, 2) != sfnt_bytes::get(before.at("hmtx"), 4 * id, 2);
    }
    CHECK(changed == 0);
  }
}

TEST_CASE("an edit taken back gives the first outlines again", "[roundtrip]") {
  const Font font = load_bundled(truetype_fonts[2]);
  const EditedGlyphs edited = shake(font, 7);
  EditedGlyphs original;
  for (const auto& [id, contours] : edited) original[id] = font.glyphs[static_cast<std::size_t>(id)].contours;
  const Font there = glyphs::load_font_bytes("there.ttf", write_sfnt(font, edited).data);
  const auto back = write_sfnt(there, original);
  const Font again = glyphs::load_font_bytes("back.ttf", back.data);
  for (const Glyph& glyph : font.glyphs) {
    if (again.glyphs[static_cast<std::size_t>(glyph.id)].contours != glyph.contours) FAIL(glyph.name);
  }
  // Boxes, bearings and everything derived are as they were.
  const auto before = sfnt_bytes::tables_of(*font.data);
  const auto after = sfnt_bytes::tables_of(back.data);
  for (const std::string tag : {"hmtx", "hhea", "maxp"}) CHECK(after.at(tag) == before.at(tag));
  CHECK(Bytes(after.at("head").begin() + 12, after.at("head").end()) ==
        Bytes(before.at("head").begin() + 12, before.at("head").end()));
}

TEST_CASE("the same edit gives the same bytes", "[roundtrip]") {
  const Font font = load_bundled(truetype_fonts[0]);
  CHECK(write_sfnt(font, shake(font, 3)).data == write_sfnt(font, shake(font, 3)).data);
}
