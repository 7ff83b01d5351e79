#include "glyphs/sfnt_writer.h"

#include <cstdlib>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using glyphs::Bytes;
using glyphs::EditedGlyphs;
using glyphs::Font;
using glyphs::FontWriteError;
using glyphs::write_sfnt;
using sfnt_bytes::composite;
using sfnt_bytes::font_of;
using sfnt_bytes::get16;
using sfnt_bytes::glyphs_of;
using sfnt_bytes::simple_glyph;
using sfnt_bytes::small_font;
using sfnt_bytes::tables_of;

const Bytes instructions{0x4F};  // one byte
const Bytes triangle = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}}, 0x40, instructions);
const Bytes rounded = simple_glyph({{{0, 0}, {300, 0, false}, {300, 300, false}, {0, 300}}});

/// The glyph's contours with every stored point mapped and implied nodes put midway again.
template <typename Map>
std::vector<BezierContour> moved(const Font& font, int glyph, Map map) {
  std::vector<BezierContour> result;
  for (const BezierContour& contour : font.glyphs.at(static_cast<std::size_t>(glyph)).contours) {
    Points points = contour.points();
    const Eigen::Index n = points.rows();
    for (Eigen::Index i = 0; i < n; ++i) {
      if (contour.kind(static_cast<int>(i)) == PointKind::ImpliedNode) continue;
      points.row(i) = map(contour.point(static_cast<int>(i))).transpose();
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      if (contour.kind(static_cast<int>(i)) != PointKind::ImpliedNode) continue;
      points.row(i) = 0.5 * (points.row((i + n - 1) % n) + points.row((i + 1) % n));
    }
    result.push_back(contour.with_points(points));
  }
  return result;
}

std::vector<BezierContour> shifted(const Font& font, int glyph, double x, double y) {
  return moved(font, glyph, [&](const Point& p) { return Point(p + Point(x, y)); });
}

Font load_small(const std::vector<Bytes>& glyphs, int bearing_shift = 0) {
  return glyphs::load_font_bytes("small.ttf", font_of(small_font(glyphs, bearing_shift)));
}

}  // namespace

TEST_CASE("an edited glyph is stored with its new points, its overlap flag and no instructions", "[sfnt_writer]") {
  const Font font = load_small({{}, triangle, rounded});
  REQUIRE(font.glyphs[1].has_instructions);
  const auto written = write_sfnt(font, {{1, shifted(font, 1, 10, -20)}});
  const auto glyph = glyphs_of(tables_of(written.data)).at(1);
  CHECK(get16(glyph, 0) == 1);
  CHECK(std::vector{get16(glyph, 2), get16(glyph, 4), get16(glyph, 6), get16(glyph, 8)} ==
        std::vector{10, -20, 310, 280});
  CHECK(get16(glyph, 10) == 2);          // the last point
  CHECK(get16(glyph, 12) == 0);          // instructions
  CHECK((glyph.at(14) & 0x41) == 0x41);  // on the curve, overlapping
  CHECK(written.dropped_instructions == std::vector{1});
  const Font read = glyphs::load_font_bytes("again.ttf", written.data);
  CHECK(read.glyphs[1].contours == shifted(font, 1, 10, -20));
  CHECK_FALSE(read.glyphs[1].has_instructions);
  CHECK(glyphs_of(tables_of(written.data)).at(2) == glyphs_of(tables_of(*font.data)).at(2));
}

TEST_CASE("flags repeat and short steps take a byte", "[sfnt_writer]") {
  sfnt_bytes::Contours zigzag(1);
  for (int i = 0; i < 600; ++i) zigzag[0].push_back({i, i % 2});
  const Font font = load_small({{}, simple_glyph(zigzag)});
  const auto written = write_sfnt(font, {{1, shifted(font, 1, 1, 1)}});
  // x steps by one (a byte each), y goes up and down; flags of two kinds take turns, so they cannot repeat. Padded
  // to 4.
  CHECK(glyphs_of(tables_of(written.data)).at(1).size() == 14 + 600 + 600 + 600 + 2);
  const auto flat = write_sfnt(font, {{1, moved(font, 1, [](const Point& p) { return Point(p.x(), 0); })}});
  CHECK(glyphs_of(tables_of(flat.data)).at(1).size() < 14 + 600 + 12);
  CHECK(glyphs::load_font_bytes("flat", flat.data).glyphs[1].contours[0].point(599) == Point(599, 0));
}

TEST_CASE("left side bearings and boxes follow, so that an outline stays at its origin", "[sfnt_writer]") {
  for (const int bearing_shift : {0, 40}) {
    const Bytes user = composite({{.glyph = 1, .first = 100}, {.glyph = 2, .matrix = {0.5}}});
    const Font font = load_small({{}, triangle, rounded, user}, bearing_shift);
    const auto before = tables_of(*font.data);
    const auto written = write_sfnt(font, {{2, shifted(font, 2, -15, 5)}});
    const auto after = tables_of(written.data);
    CHECK(written.moved_composites == std::vector{3});
    CHECK(get16(after.at("hmtx"), 4 * 2 + 2) == get16(before.at("hmtx"), 4 * 2 + 2) - 15);
    const auto box = glyphs_of(after).at(3);
    // 0.5 * (-15, 5) to 0.5 * (285, 305), and the triangle at 100 to 400: rounded half up.
    CHECK(std::vector{get16(box, 2), get16(box, 4), get16(box, 6), get16(box, 8)} == std::vector{-7, 0, 400, 300});
    CHECK(Bytes(box.begin() + 10, box.end()) == [&] {
      const auto old = glyphs_of(before).at(3);
      return Bytes(old.begin() + 10, old.end());
    }());
    const Font read = glyphs::load_font_bytes("again.ttf", written.data);
    for (const int id : {1, 2, 3}) {
      CHECK(read.glyphs[static_cast<std::size_t>(id)].origin == font.glyphs[static_cast<std::size_t>(id)].origin);
    }
    CHECK(get16(after.at("head"), 36) == -15);
  }
}

TEST_CASE("offsets become long when short ones no longer reach", "[sfnt_writer]") {
  // 16896 points in one place take a flag and a count for every 256 of them; spread out they take four bytes each.
  constexpr int runs = 66;
  constexpr int count = 256 * runs;
  Bytes heap;
  for (const int value : {1, 0, 0, 0, 0, count - 1, 0}) sfnt_bytes::put16(heap, value);
  for (int i = 0; i < runs; ++i) sfnt_bytes::put16(heap, 0x39FF);
  const Font font = load_small({{}, heap, heap});
  REQUIRE(font.glyphs[1].contours.at(0).point_count() == count);
  const auto spread = [&](int glyph) {
    int index = 0;
    return moved(font, glyph, [&](const Point&) {
      ++index;
      return Point(900 * (index % 2), 900 * (index % 3));
    });
  };
  const auto one = write_sfnt(font, {{1, spread(1)}});
  CHECK(get16(tables_of(one.data).at("head"), 50) == 0);
  const auto both = write_sfnt(font, {{1, spread(1)}, {2, spread(2)}});
  CHECK(get16(tables_of(both.data).at("head"), 50) == 1);
  CHECK(tables_of(both.data).at("glyf").size() > 131070);
  CHECK(glyphs_of(tables_of(both.data)).at(0).empty());
  CHECK(glyphs::load_font_bytes("both.ttf", both.data).glyphs[2].contours == spread(2));
}

TEST_CASE("checksums are right and a version 'true' stays", "[sfnt_writer]") {
  Bytes data = font_of(small_font({{}, triangle}));
  const std::string version = "true";
  std::copy(version.begin(), version.end(), data.begin());
  const Font font = glyphs::load_font_bytes("apple.ttf", data);
  const auto written = write_sfnt(font, {{1, shifted(font, 1, 1, 0)}});
  CHECK(std::string(written.data.begin(), written.data.begin() + 4) == "true");
  CHECK(sfnt_bytes::checksum(written.data) == 0xB1B0AFBA);
  for (std::size_t i = 0; i < sfnt_bytes::get(written.data, 4, 2); ++i) {
    const std::size_t at = 12 + 16 * i;
    const auto from = written.data.begin() + sfnt_bytes::get(written.data, at + 8, 4);
    Bytes table(from, from + sfnt_bytes::get(written.data, at + 12, 4));
    if (written.data[at] == 'h' && written.data[at + 2] == 'a' && written.data[at + 3] == 'd') {
      std::fill(table.begin() + 8, table.begin() + 12, static_cast<unsigned char>(0));
    }
    CHECK(sfnt_bytes::checksum(table) == sfnt_bytes::get(written.data, at + 4, 4));
  }
}

TEST_CASE("tables that an edit makes void are dropped by name, unknown ones kept", "[sfnt_writer]") {
  auto tables = small_font({{}, triangle});
  for (const std::string tag : {"DSIG", "hdmx", "LTSH", "VDMX", "zzzz", "SVG "}) tables[tag] = {1, 2, 3, 4, 5};
  const Font font = glyphs::load_font_bytes("more.ttf", font_of(tables));
  const auto written = write_sfnt(font, {{1, shifted(font, 1, 1, 0)}});
  CHECK(written.dropped_tables == std::vector<std::string>{"DSIG", "LTSH", "VDMX", "hdmx"});
  CHECK(tables_of(written.data).at("zzzz") == tables.at("zzzz"));
  CHECK(tables_of(written.data).at("SVG ") == tables.at("SVG "));
  REQUIRE(written.warnings.size() == 1);
  CHECK(written.warnings[0] ==
        "SVG: an SVG drawing, another drawing of the same glyphs, are kept as they were; edited: A");
}

TEST_CASE("the date changes with SOURCE_DATE_EPOCH alone", "[sfnt_writer]") {
  const Font font = load_small({{}, triangle});
  const EditedGlyphs edited{{1, shifted(font, 1, 1, 0)}};
  ::unsetenv("SOURCE_DATE_EPOCH");
  const auto plain = write_sfnt(font, edited);
  CHECK(plain.data == write_sfnt(font, edited).data);
  CHECK(sfnt_bytes::get(tables_of(plain.data).at("head"), 32, 4) == 0);
  ::setenv("SOURCE_DATE_EPOCH", "1700000000", 1);
  CHECK(sfnt_bytes::get(tables_of(write_sfnt(font, edited).data).at("head"), 32, 4) == 1700000000u + 2082844800u);
  ::setenv("SOURCE_DATE_EPOCH", "yesterday", 1);
  CHECK(message_of<FontWriteError>([&] { write_sfnt(font, edited); }) ==
        "small.ttf: SOURCE_DATE_EPOCH is no number of seconds: yesterday");
  ::unsetenv("SOURCE_DATE_EPOCH");
}

TEST_CASE("what cannot be stored is refused with file, glyph and numbers", "[sfnt_writer]") {
  const Font font = load_small({{}, triangle, rounded, composite({{.glyph = 1}})});
  const auto refused = [&](int glyph, std::vector<BezierContour> contours) {
    return message_of<FontWriteError>([&] { write_sfnt(font, {{glyph, std::move(contours)}}); });
  };
  const auto at_first = [&](int glyph, double x, double y) {
    auto contours = font.glyphs[static_cast<std::size_t>(glyph)].contours;
    Points points = contours[0].points();
    points.row(0) << x, y;
    contours[0] = contours[0].with_points(points);
    return contours;
  };
  CHECK(refused(1, at_first(1, 0.5, 0)) == "small.ttf: A: contour 0, point 0: coordinate 0.5 is no whole number");
  CHECK(refused(1, at_first(1, 0, 40000)) ==
        "small.ttf: A: contour 0, point 0: coordinate 40000 does not fit in 16 bits");
  CHECK(refused(1, at_first(1, -32768, 0)) ==
        "small.ttf: A: contour 0: the step from (-32768, 0) to (300, 0) does not fit in 16 bits");
  CHECK(refused(1, {}) == "small.ttf: A: 0 contours for the font's 1");
  const BezierContour cubic(Points::Zero(3, 2), {PointKind::Node, PointKind::Cubic, PointKind::Cubic});
  CHECK(refused(1, {cubic}) == "small.ttf: A: contour 0, point 1: a handle of a cubic, which TrueType does not have");
  CHECK(refused(3, {}) == "small.ttf: C: is a composite; it is edited through its components");
  CHECK(refused(9, {}) == "small.ttf: glyph 9 is no glyph of the font, which has 4");
  auto implied = font.glyphs[2].contours;
  Points points = implied[0].points();
  REQUIRE(implied[0].kind(2) == PointKind::ImpliedNode);
  points(2, 0) += 1;
  CHECK(refused(2, {implied[0].with_points(points)}).starts_with("small.ttf: B: contour 0, point 2: an implied"));

  const Font cff = glyphs::load_font(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/cabin/Cabin-Bold.otf");
  CHECK(message_of<FontWriteError>([&] {
          write_sfnt(cff, {{cff.find("a"), shifted(cff, cff.find("a"), 40000, 0)}});
        }).starts_with(cff.path + ": a: contour 0, point 0: coordinate 40"));
  CHECK(write_sfnt(cff, {}).data == *cff.data);
}

TEST_CASE("contours of one and two points survive an edit beside them", "[sfnt_writer]") {
  const Font font = load_small({{}, simple_glyph({{{10, 20}}, {{0, 0}, {100, 50}}, {{0, 0}, {300, 0}, {0, 300}}})});
  const auto wanted = shifted(font, 1, 3, 4);
  const Font read = glyphs::load_font_bytes("again.ttf", write_sfnt(font, {{1, wanted}}).data);
  REQUIRE(read.glyphs[1].contours.size() == 3);
  CHECK(read.glyphs[1].contours == wanted);
}

namespace {

/// Contours of a font that was never in a file, as a TrueType point list has them.
std::vector<BezierContour> of_points(const sfnt_bytes::Contours& contours) {
  std::vector<BezierContour> result;
  for (const auto& contour : contours) {
    Points points(static_cast<Eigen::Index>(contour.size()), 2);
    std::vector<bool> on_curve;
    for (std::size_t i = 0; i < contour.size(); ++i) {
      points.row(static_cast<Eigen::Index>(i)) << contour[i].x, contour[i].y;
      on_curve.push_back(contour[i].on_curve);
    }
    result.push_back(fontcore::from_quadratic_points(points, on_curve));
  }
  return result;
}

}  // namespace

TEST_CASE("a glyph may come back with other points, and maxima, boxes and overlap flag follow", "[sfnt_writer]") {
  const Font font = load_small({{}, triangle, rounded, composite({{.glyph = 1, .first = 100}, {.glyph = 2}})});
  const auto wanted = of_points({{{0, 10}, {0, 0, false}, {10, 0}, {310, 0}, {150, 200, false}, {50, 300, false}}});
  const auto written = write_sfnt(font, {{1, wanted}});
  const auto tables = tables_of(written.data);
  const auto glyph = glyphs_of(tables).at(1);
  CHECK(get16(glyph, 10) == 5);          // the last point
  CHECK((glyph.at(14) & 0x40) == 0x40);  // overlapping
  CHECK(get16(tables.at("maxp"), 6) >= 6);
  CHECK(get16(tables.at("maxp"), 10) >= 10);
  CHECK(written.dropped_instructions == std::vector{1});
  CHECK(written.moved_composites == std::vector{3});
  CHECK(get16(glyphs_of(tables).at(3), 6) == 410);
  const Font read = glyphs::load_font_bytes("again.ttf", written.data);
  CHECK(read.glyphs[1].contours == wanted);
  CHECK(read.glyphs[2].contours == font.glyphs[2].contours);
  CHECK(write_sfnt(read, {{1, font.glyphs[1].contours}}).data != written.data);
}

TEST_CASE("other points in a glyph take the instructions of composites that count them", "[sfnt_writer]") {
  constexpr int has_instructions = 0x0100;
  Bytes user = composite({{.glyph = 1, .first = 100}, {.glyph = 2, .more_flags = has_instructions}});
  const Bytes plain = composite({{.glyph = 1, .first = 100}, {.glyph = 2}});
  const Bytes program{0, 1, 0x4F};
  user.insert(user.end(), program.begin(), program.end());
  const Font font = load_small({{}, triangle, rounded, user});
  REQUIRE(font.glyphs[3].has_instructions);
  const auto moved_alone = write_sfnt(font, {{1, shifted(font, 1, 1, 0)}});
  CHECK(moved_alone.dropped_instructions == std::vector{1});
  const auto written = write_sfnt(font, {{1, of_points({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}})}});
  CHECK(written.dropped_instructions == std::vector{1, 3});
  const Bytes stored = glyphs_of(tables_of(written.data)).at(3);
  REQUIRE(stored.size() >= plain.size());
  CHECK(Bytes(stored.begin() + 10, stored.begin() + static_cast<std::ptrdiff_t>(plain.size())) ==
        Bytes(plain.begin() + 10, plain.end()));
  CHECK_FALSE(glyphs::load_font_bytes("again.ttf", written.data).glyphs[3].has_instructions);
}

TEST_CASE("other points in a glyph whose points a composite matches by number are refused", "[sfnt_writer]") {
  const auto matches = [](int first, int second) {
    return composite({{.glyph = first}, {.glyph = second, .first = 1, .second = 2, .is_shift = false}});
  };
  const Font font = load_small({{}, triangle, rounded, matches(1, 2), composite({{.glyph = 3}, {.glyph = 1}})});
  const auto four = of_points({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}});
  for (const int glyph : {1, 2}) {
    CHECK(glyphs::matched_in(font, glyph) == 3);
    const std::string name = font.glyphs[static_cast<std::size_t>(glyph)].name;
    CHECK(message_of<FontWriteError>([&] {
            write_sfnt(font, {{glyph, four}});
          }) == "small.ttf: " + name + ": its points are other ones now, and C matches its parts by point numbers");
    CHECK_NOTHROW(write_sfnt(font, {{glyph, shifted(font, glyph, 1, 0)}}));
  }
  // What stands behind all matches is counted by none.
  const Font behind =
      load_small({{},
                  triangle,
                  rounded,
                  rounded,
                  composite({{.glyph = 1}, {.glyph = 2, .first = 1, .second = 2, .is_shift = false}, {.glyph = 3}})});
  CHECK(glyphs::matched_in(behind, 2) == 4);
  CHECK(glyphs::matched_in(behind, 3) == -1);
}

namespace {

/// Two fonts in one file that share the bytes of their outlines.
Bytes collection_of(const std::map<std::string, Bytes>& first, const std::map<std::string, Bytes>& second) {
  Bytes file{'t', 't', 'c', 'f', 0, 1, 0, 0, 0, 0, 0, 2};
  const std::size_t directory = 12 + 16 * first.size();
  sfnt_bytes::put(file, 20, 4);
  sfnt_bytes::put(file, static_cast<std::uint32_t>(20 + directory), 4);
  std::map<std::string, std::size_t> placed;  // by their bytes
  Bytes body;
  for (const auto* tables : {&first, &second}) {
    const Bytes single = font_of(*tables);
    file.insert(file.end(), single.begin(), single.begin() + 12);
    for (const auto& [tag, bytes] : *tables) {
      const auto [found, is_new] = placed.emplace(std::string(bytes.begin(), bytes.end()), body.size());
      if (is_new) {
        body.insert(body.end(), bytes.begin(), bytes.end());
        body.resize((body.size() + 3) / 4 * 4);
      }
      file.insert(file.end(), tag.begin(), tag.end());
      sfnt_bytes::put(file, sfnt_bytes::checksum(bytes), 4);
      sfnt_bytes::put(file, static_cast<std::uint32_t>(20 + 2 * directory + found->second), 4);
      sfnt_bytes::put(file, static_cast<std::uint32_t>(bytes.size()), 4);
    }
  }
  file.insert(file.end(), body.begin(), body.end());
  return file;
}

Bytes without_adjustment(Bytes head) {
  std::fill(head.begin() + 8, head.begin() + 12, static_cast<unsigned char>(0));
  return head;
}

}  // namespace

TEST_CASE("a face of a collection comes out as a single font with all its tables", "[sfnt_writer]") {
  auto first = small_font({{}, triangle, rounded});
  auto second = first;
  second["name"] = {0, 0, 0, 0, 0, 6};
  first["name"] = {0, 0, 0, 0, 0, 6, 7, 7};
  const Bytes file = collection_of(first, second);
  for (const int face : {0, 1}) {
    const Font font = glyphs::load_font_bytes("both.ttc", file, {.face = face});
    REQUIRE(font.is_collection);
    const auto plain = write_sfnt(font, {});
    auto wanted = face == 0 ? first : second;
    auto tables = tables_of(plain.data);
    tables["head"] = without_adjustment(tables["head"]);
    CHECK(tables == wanted);
    CHECK(sfnt_bytes::checksum(plain.data) == 0xB1B0AFBA);
    CHECK_FALSE(glyphs::load_font_bytes("one.ttf", plain.data).is_collection);
    const auto edited = write_sfnt(font, {{1, shifted(font, 1, 10, -20)}});
    CHECK(glyphs::load_font_bytes("one.ttf", edited.data).glyphs[1].contours == shifted(font, 1, 10, -20));
    CHECK(tables_of(edited.data).at("name") == wanted["name"]);
    CHECK(sfnt_bytes::checksum(edited.data) == 0xB1B0AFBA);
  }
}

TEST_CASE("an edited composite becomes a simple glyph where it may", "[sfnt_writer]") {
  constexpr int overlap_compound = 0x0400;
  constexpr int has_instructions = 0x0100;
  const Bytes plain = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}});
  Bytes pair = composite({{.glyph = 1, .first = 100}, {.glyph = 2, .more_flags = has_instructions, .matrix = {0.5}}});
  const Bytes program{0, 1, 0x4F};
  pair.insert(pair.end(), program.begin(), program.end());
  const Bytes over = composite({{.glyph = 1, .more_flags = overlap_compound}, {.glyph = 2, .first = 31}});
  const Bytes user = composite({{.glyph = 3, .first = 7}, {.glyph = 1}});
  const Font font = load_small({{}, plain, rounded, pair, over, user});
  const glyphs::WriteOptions decompose{.composites = glyphs::Composites::Decompose};

  auto wanted = glyphs::decompose(font, 3);
  REQUIRE(wanted.size() == 2);
  CHECK(wanted[1].point(3) == Point(150, 150));
  CHECK(write_sfnt(font, {{3, wanted}}, decompose).data == *font.data);  // nothing is edited
  Points points = wanted[0].points();
  points.row(0) << 90, -10;
  wanted[0] = wanted[0].with_points(points);
  const auto written = write_sfnt(font, {{3, wanted}}, decompose);
  CHECK(written.decomposed == std::vector{3});
  CHECK(written.moved_composites == std::vector{5});
  CHECK(written.dropped_instructions == std::vector{3});
  const Font read = glyphs::load_font_bytes("again.ttf", written.data);
  CHECK(read.glyphs[3].contours == wanted);
  CHECK_FALSE(read.glyphs[3].is_composite());
  CHECK(read.glyphs[3].advance == font.glyphs[3].advance);
  CHECK(read.glyphs[3].origin == font.glyphs[3].origin);
  CHECK(get16(tables_of(written.data).at("hmtx"), 4 * 3 + 2) == get16(glyphs_of(tables_of(written.data)).at(3), 2));
  CHECK((glyphs_of(tables_of(written.data)).at(3).at(16) & 0x40) == 0);  // after header, two ends and no instructions
  CHECK(compose(read, 5).at(0).point(0) == Point(97, -10));
  CHECK(get16(glyphs_of(tables_of(written.data)).at(5), 4) == -10);

  // Its parts say that they overlap, so it does.
  auto moved_over = glyphs::decompose(font, 4);
  for (BezierContour& contour : moved_over) contour = transform(contour, {.shift = Point(1, 0)});
  const auto one = write_sfnt(font, {{4, moved_over}}, decompose);
  CHECK((glyphs_of(tables_of(one.data)).at(4).at(16) & 0x40) == 0x40);

  // What is edited together with a part has what it is given, not what became of the part.
  const auto both = write_sfnt(font, {{1, shifted(font, 1, 40, 0)}, {3, wanted}}, decompose);
  const Font again = glyphs::load_font_bytes("again.ttf", both.data);
  CHECK(again.glyphs[3].contours == wanted);
  CHECK(compose(again, 4).at(0).point(0) == Point(40, 0));
}

TEST_CASE("a decomposed glyph keeps the origin that a part lent it, and matched points", "[sfnt_writer]") {
  constexpr int use_my_metrics = 0x0200;
  const Bytes plain = simple_glyph({{{20, 0}, {320, 0}, {20, 300}}});
  const Bytes lent = composite({{.glyph = 1, .more_flags = use_my_metrics}, {.glyph = 2, .first = -90}});
  const Bytes matched = composite({{.glyph = 3}, {.glyph = 1, .first = 4, .second = 0, .is_shift = false}});
  const Font font = load_small({{}, plain, rounded, lent, matched}, 15);
  REQUIRE(font.glyphs[3].origin == -15);
  auto wanted = glyphs::decompose(font, 3);
  for (BezierContour& contour : wanted) contour = transform(contour, {.shift = Point(0, 8)});
  const auto written = write_sfnt(font, {{3, wanted}}, {.composites = glyphs::Composites::Decompose});
  const Font read = glyphs::load_font_bytes("again.ttf", written.data);
  CHECK(read.glyphs[3].origin == -15);
  CHECK(compose(read, 3) == [&] {
    auto drawn = compose(font, 3);
    for (BezierContour& contour : drawn) contour = transform(contour, {.shift = Point(0, 8)});
    return drawn;
  }());
  const auto before = compose(font, 4);
  const auto after = compose(read, 4);
  REQUIRE(after.size() == before.size());
  for (std::size_t c = 0; c < after.size(); ++c) {
    CHECK(after[c] == transform(before[c], {.shift = Point(0, 8)}));
  }
}

TEST_CASE("a glyph that loca gives no bytes comes out empty, and its neighbours can be edited", "[sfnt_writer]") {
  const Bytes square = simple_glyph({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}});
  struct Damage {
    std::size_t entry;
    int value;
    std::vector<int> lost;
  };
  const auto tables = small_font({{}, triangle, square, rounded, square, triangle});
  const int size = static_cast<int>(tables.at("glyf").size());
  for (const Damage& damage : {Damage{3, 0xFFFE, {2, 3}}, Damage{3, 0, {2}}, Damage{6, 0xFFFF, {5}},
                               Damage{1, size, {1}}, Damage{5, 2, {4}}}) {
    auto damaged = tables;
    sfnt_bytes::set16(damaged["loca"], 2 * damage.entry, damage.value);
    const Font font = glyphs::load_font_bytes("hurt.ttf", font_of(damaged));
    const int edited = damage.lost[0] == 1 || damage.lost[0] == 2 ? 4 : 1;
    CAPTURE(damage.entry, damage.value);
    for (const int lost : damage.lost) REQUIRE_FALSE(font.glyphs[static_cast<std::size_t>(lost)].trouble.empty());
    REQUIRE(font.glyphs[static_cast<std::size_t>(edited)].trouble.empty());
    const auto written = write_sfnt(font, {{edited, shifted(font, edited, 5, 5)}});
    const Font read = glyphs::load_font_bytes("hurt.ttf", written.data);
    for (const glyphs::Glyph& glyph : font.glyphs) {
      const glyphs::Glyph& now = read.glyphs[static_cast<std::size_t>(glyph.id)];
      CHECK(now.trouble.empty());
      CHECK((glyph.trouble.empty() || written.emptied.contains(glyph.id)));
      CHECK(now.contours == (glyph.id == edited ? shifted(font, edited, 5, 5) : glyph.contours));
    }
    CHECK(write_sfnt(font, {}).data == *font.data);
  }
}

TEST_CASE("a glyph whose bytes are broken comes out empty when another is edited", "[sfnt_writer]") {
  Bytes broken = triangle;
  broken.resize(13);
  broken[11] = 40;  // more points than there are bytes
  const Font font = load_small({{}, triangle, broken, rounded, composite({{.glyph = 2}})});
  REQUIRE_FALSE(font.glyphs[2].trouble.empty());
  REQUIRE_FALSE(font.glyphs[4].trouble.empty());
  const auto written = write_sfnt(font, {{1, shifted(font, 1, 5, 5)}});
  CHECK(written.emptied.size() == 1);
  CHECK(written.emptied.at(2).find("reach past the end") != std::string::npos);
  CHECK(glyphs_of(tables_of(written.data)).at(2).empty());
  for (const std::size_t id : {3u, 4u}) {
    CHECK(glyphs_of(tables_of(written.data)).at(id) == glyphs_of(tables_of(*font.data)).at(id));
  }
  CHECK(glyphs::load_font_bytes("again.ttf", written.data).glyphs[4].trouble.empty());
  CHECK(write_sfnt(font, {}, {.is_checked = true}).emptied == written.emptied);
  CHECK(write_sfnt(font, {}).data == *font.data);
}

TEST_CASE("a glyph that overlaps itself now is given the flag that says so", "[sfnt_writer]") {
  const Font font = load_small({{}, simple_glyph({{{0, 0}, {300, 0}, {0, 300}}})});
  const auto flag = [&](const glyphs::WriteOptions& options) {
    return glyphs_of(tables_of(write_sfnt(font, {{1, shifted(font, 1, 5, 5)}}, options).data)).at(1).at(14) & 0x40;
  };
  CHECK(flag({}) == 0);
  CHECK(flag({.overlapping = {1}}) == 0x40);
}
