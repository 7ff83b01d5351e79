// Ours, read again by FreeType with its own composition and by HarfBuzz: three readers, one outline.

#include <ft2build.h>
#include <hb-ot.h>
#include FT_FREETYPE_H
#include FT_OUTLINE_H

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using fontcore::BezierContour;
using fontcore::Point;

/// Every segment's control points, in order; lines of no length left out, since readers differ in drawing them, and
/// fonts whose fractions do not add up to a closed contour have lines that are nothing in floats.
struct Drawing {
  std::vector<std::vector<Point>> segments;
  std::vector<Point> start{Point::Zero()};

  void move(double x, double y) {
    start = {Point(x, y)};
    now = start[0];
  }
  void add(std::vector<Point> rest) {
    rest.insert(rest.begin(), now);
    now = rest.back();
    if (rest.size() > 2 || (rest[0] - rest[1]).norm() > shortest) segments.push_back(rest);
  }
  void close() { add({start[0]}); }
  static constexpr double shortest = 1e-3;
  Point now = Point::Zero();
};

Drawing draw(const std::vector<BezierContour>& contours) {
  Drawing drawing;
  for (const BezierContour& contour : contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      const fontcore::Bezier bezier = contour.segment(s);
      if (s == 0) drawing.move(bezier.start().x(), bezier.start().y());
      drawing.add({bezier.p.begin() + 1, bezier.p.begin() + 1 + bezier.degree});
    }
    drawing.close();
  }
  return drawing;
}

Drawing draw_by_harfbuzz(hb_font_t* font, int glyph) {
  static hb_draw_funcs_t* const pen = [] {
    hb_draw_funcs_t* made = hb_draw_funcs_create();
    hb_draw_funcs_set_move_to_func(
        made,
        [](hb_draw_funcs_t*, void* d, hb_draw_state_t*, float x, float y, void*) {
          static_cast<Drawing*>(d)->move(x, y);
        },
        nullptr, nullptr);
    hb_draw_funcs_set_line_to_func(
        made,
        [](hb_draw_funcs_t*, void* d, hb_draw_state_t*, float x, float y, void*) {
          static_cast<Drawing*>(d)->add({Point(x, y)});
        },
        nullptr, nullptr);
    hb_draw_funcs_set_quadratic_to_func(
        made,
        [](hb_draw_funcs_t*, void* d, hb_draw_state_t*, float ax, float ay, float x, float y, void*) {
          static_cast<Drawing*>(d)->add({Point(ax, ay), Point(x, y)});
        },
        nullptr, nullptr);
    hb_draw_funcs_set_cubic_to_func(
        made,
        [](hb_draw_funcs_t*, void* d, hb_draw_state_t*, float ax, float ay, float bx, float by, float x, float y,
           void*) {
          static_cast<Drawing*>(d)->add({Point(ax, ay), Point(bx, by), Point(x, y)});
        },
        nullptr, nullptr);
    hb_draw_funcs_set_close_path_func(
        made, [](hb_draw_funcs_t*, void* d, hb_draw_state_t*, void*) { static_cast<Drawing*>(d)->close(); }, nullptr,
        nullptr);
    return made;
  }();
  Drawing drawing;
#if HB_VERSION_ATLEAST(7, 0, 0)
  hb_font_draw_glyph(font, static_cast<hb_codepoint_t>(glyph), pen, &drawing);
#else
  hb_font_get_glyph_shape(font, static_cast<hb_codepoint_t>(glyph), pen, &drawing);
#endif
  return drawing;
}

/// The largest distance between control points; infinite if the segments differ in number or kind.
double distance(const Drawing& a, const Drawing& b) {
  double largest = 0.0;
  if (a.segments.size() != b.segments.size()) return HUGE_VAL;
  for (std::size_t s = 0; s < a.segments.size(); ++s) {
    if (a.segments[s].size() != b.segments[s].size()) return HUGE_VAL;
    for (std::size_t k = 0; k < a.segments[s].size(); ++k) {
      largest = std::max(largest, (a.segments[s][k] - b.segments[s][k]).cwiseAbs().maxCoeff());
    }
  }
  return largest;
}

}  // namespace

TEST_CASE("every glyph of the bundled fonts is what HarfBuzz draws", "[agreement]") {
  for (const std::string& path : bundled_fonts()) {
    const glyphs::Font font = glyphs::load_font(path);
    hb_blob_t* blob = hb_blob_create_from_file(font.path.c_str());
    hb_face_t* face = hb_face_create(blob, 0);
    hb_font_t* reader = hb_font_create(face);
    hb_font_set_scale(reader, font.units_per_em, font.units_per_em);
    double largest = 0.0;
    std::string worst;
    for (const glyphs::Glyph& glyph : font.glyphs) {
      const double apart = distance(draw(compose(font, glyph.id)), draw_by_harfbuzz(reader, glyph.id));
      if (apart > largest) worst = glyph.name;
      largest = std::max(largest, apart);
      if (hb_font_get_glyph_h_advance(reader, static_cast<hb_codepoint_t>(glyph.id)) != glyph.advance) {
        FAIL(path << ": advance of " << glyph.name);
      }
    }
    INFO(path << ": worst glyph " << worst);
    CHECK(largest < 1e-3);  // HarfBuzz computes in floats
    hb_font_destroy(reader);
    hb_face_destroy(face);
    hb_blob_destroy(blob);
  }
}

TEST_CASE(
    "every glyph of the bundled fonts is what FreeType composes, up to its rounding of scaled parts and fractions",
    "[agreement]") {
  FT_Library library = nullptr;
  REQUIRE(FT_Init_FreeType(&library) == 0);
  for (const std::string& path : bundled_fonts()) {
    const glyphs::Font font = glyphs::load_font(path);
    FT_Face face = nullptr;
    REQUIRE(FT_New_Face(library, font.path.c_str(), 0, &face) == 0);
    double largest = 0.0;
    std::string worst;
    for (const glyphs::Glyph& glyph : font.glyphs) {
      REQUIRE(FT_Load_Glyph(face, static_cast<FT_UInt>(glyph.id), FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING) == 0);
      const FT_Outline& outline = face->glyph->outline;
      std::vector<Point> ours;  // FreeType lists no implied nodes
      for (const BezierContour& contour : compose(font, glyph.id)) {
        for (int i = 0; i < contour.point_count(); ++i) {
          if (contour.kind(i) != fontcore::PointKind::ImpliedNode) ours.push_back(contour.point(i));
        }
      }
      // Truncated ends that meet the start are dropped there, one a contour at most.
      const std::size_t theirs = static_cast<std::size_t>(outline.n_points);
      if (font.has_fractional_coordinates && theirs != ours.size()) {
        CHECK(ours.size() - theirs <= static_cast<std::size_t>(outline.n_contours));
        continue;
      }
      REQUIRE(theirs == ours.size());
      for (std::size_t i = 0; i < theirs; ++i) {
        const Point p(static_cast<double>(outline.points[i].x), static_cast<double>(outline.points[i].y));
        const double apart = (p - ours[i]).cwiseAbs().maxCoeff();
        if (apart > largest) worst = glyph.name;
        largest = std::max(largest, apart);
      }
    }
    INFO(path << ": worst glyph " << worst);
    CHECK(largest <= 1.0);
    FT_Done_Face(face);
  }
  FT_Done_FreeType(library);
}

TEST_CASE("a font with softened letters is what HarfBuzz and FreeType read, composites too", "[agreement]") {
  FT_Library library = nullptr;
  REQUIRE(FT_Init_FreeType(&library) == 0);
  for (const std::string& path : bundled_ttf) {
    const glyphs::Font font = glyphs::load_font(path);
    glyphs::Recipe recipe;
    recipe.glyphs = "U+0041-005A,U+0061-007A";
    recipe.steps = {glyphs::SoftenStep{.radius = 40}};
    const glyphs::RestyleResult result = glyphs::restyle(font, recipe);
    CHECK(result.refused() == 0);
    const glyphs::Font written = glyphs::load_font_bytes("softened.ttf", result.font.data);
    const glyphs::Bytes& data = result.font.data;
    hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(data.data()), static_cast<unsigned>(data.size()),
                                     HB_MEMORY_MODE_READONLY, nullptr, nullptr);
    hb_face_t* face = hb_face_create(blob, 0);
    hb_font_t* reader = hb_font_create(face);
    hb_font_set_scale(reader, font.units_per_em, font.units_per_em);
    FT_Face other = nullptr;
    REQUIRE(FT_New_Memory_Face(library, data.data(), static_cast<FT_Long>(data.size()), 0, &other) == 0);
    for (const glyphs::Glyph& glyph : written.glyphs) {
      INFO(path << " " << glyph.name);
      CHECK(distance(draw(compose(written, glyph.id)), draw_by_harfbuzz(reader, glyph.id)) < 1e-3);
      CHECK(FT_Load_Glyph(other, static_cast<FT_UInt>(glyph.id), FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING) == 0);
      Eigen::Index points = 0;
      for (const BezierContour& contour : compose(written, glyph.id)) {
        points += contour.point_count() - std::ranges::count(contour.kinds(), fontcore::PointKind::ImpliedNode);
      }
      CHECK(other->glyph->outline.n_points == points);
    }
    FT_Done_Face(other);
    hb_font_destroy(reader);
    hb_face_destroy(face);
    hb_blob_destroy(blob);
  }
  FT_Done_FreeType(library);
}

TEST_CASE("composites of every kind are what HarfBuzz draws", "[agreement]") {
  using sfnt_bytes::composite;
  constexpr int scaled_offset = 0x0800;
  constexpr int use_my_metrics = 0x0200;
  const sfnt_bytes::Bytes base = sfnt_bytes::simple_glyph({{{20, 0}, {300, 0, false}, {300, 300, false}, {20, 300}}});
  const std::vector<sfnt_bytes::Bytes> glyphs{
      {},
      base,
      composite({{.glyph = 1, .first = 10, .second = -20}}),
      composite({{.glyph = 1, .first = 7, .matrix = {0.5}}, {.glyph = 2, .second = 400}}),
      composite({{.glyph = 1, .first = 100, .second = 50, .more_flags = scaled_offset, .matrix = {0.5, -0.25}}}),
      composite({{.glyph = 1, .first = 100, .second = 50, .more_flags = scaled_offset, .matrix = {0, 1, -1, 0.5}}}),
      composite({{.glyph = 1, .first = 100, .second = 50, .matrix = {0.75, 0.5, -0.5, 0.75}}}),
      composite({{.glyph = 1}, {.glyph = 1, .first = 1, .second = 3, .is_shift = false}}),
      composite({{.glyph = 3}, {.glyph = 1, .first = 5, .second = 2, .is_shift = false, .matrix = {0.5}}}),
      composite({{.glyph = 2, .more_flags = use_my_metrics}, {.glyph = 1, .first = 400}})};
  for (const int bearing_shift : {0, 30}) {
    const sfnt_bytes::Bytes data = sfnt_bytes::font_of(sfnt_bytes::small_font(glyphs, bearing_shift));
    const glyphs::Font font = glyphs::load_font_bytes("small.ttf", data);
    hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(data.data()), static_cast<unsigned>(data.size()),
                                     HB_MEMORY_MODE_READONLY, nullptr, nullptr);
    hb_face_t* face = hb_face_create(blob, 0);
    hb_font_t* reader = hb_font_create(face);
    hb_font_set_scale(reader, font.units_per_em, font.units_per_em);
    for (const glyphs::Glyph& glyph : font.glyphs) {
      INFO("glyph " << glyph.id << ", bearings shifted by " << bearing_shift << " " << glyph.trouble);
      CHECK(distance(draw(compose(font, glyph.id)), draw_by_harfbuzz(reader, glyph.id)) < 1e-3);
    }
    hb_font_destroy(reader);
    hb_face_destroy(face);
    hb_blob_destroy(blob);
  }
}

TEST_CASE("fractional CFF coordinates are kept, where FreeType would truncate them", "[agreement]") {
  CHECK(glyphs::load_font(bundled_font("eb-garamond/EBGaramond12-Bold.otf")).has_fractional_coordinates);
  CHECK_FALSE(glyphs::load_font(bundled_font("cabin/Cabin-Bold.otf")).has_fractional_coordinates);
  const glyphs::Font font = glyphs::load_font(bundled_font("eb-garamond/EBGaramond12-Bold.otf"));
  const glyphs::Glyph& dollar = font.glyphs[static_cast<std::size_t>(font.find("dollar"))];
  bool has_fraction = false;
  for (const BezierContour& contour : dollar.contours) {
    for (int i = 0; i < contour.point_count(); ++i) {
      has_fraction = has_fraction || contour.point(i) != contour.point(i).array().floor().matrix();
    }
  }
  CHECK(has_fraction);
}
