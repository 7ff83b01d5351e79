#include "glyphs/simplify.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "fontcore/crossing.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/recipe.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/kept_segments.h"

using namespace glyphs;
using fontcore::Affine;
using fontcore::BezierContour;
using fontcore::CompactFit;
using fontcore::CompactOptions;
using fontcore::CurveKind;
using fontcore::Extrema;
using fontcore::Point;
using fontcore::PointKind;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

std::vector<BezierContour> contours_of(const Font& font, const std::string& characters) {
  std::vector<BezierContour> all;
  for (const char c : characters) {
    const auto found = font.character_map.find(static_cast<char32_t>(c));
    if (found == font.character_map.end()) continue;
    const auto& own = font.glyphs[static_cast<std::size_t>(found->second)].contours;
    all.insert(all.end(), own.begin(), own.end());
  }
  return all;
}

CompactOptions options_for(const Font& font, Extrema extrema, double tolerance = 1.0) {
  CompactOptions options;
  options.tolerance = tolerance * font.units_per_em / 1000.0;
  options.units_per_em = font.units_per_em;
  options.extrema = extrema;
  options.curve = font.format == OutlineFormat::TrueType ? CurveKind::Quadratic : CurveKind::Cubic;
  return options;
}

bool is_whole(const BezierContour& contour) {
  for (int i = 0; i < contour.point_count(); ++i) {
    if (contour.kind(i) != PointKind::ImpliedNode && contour.point(i) != Point(contour.point(i).array().round()))
      return false;
  }
  return true;
}

/// How far a curve goes beyond both its ends along an axis, at most.
double largest_overshoot(const BezierContour& contour) {
  double largest = 0.0;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const fontcore::Bezier b = contour.segment(s);
    for (int axis = 0; axis < 2; ++axis) {
      const auto [low, high] = std::minmax(b.start()[axis], b.end()[axis]);
      for (const double u : extrema(b, axis)) {
        const double value = evaluate(b, u)[axis];
        largest = std::max({largest, low - value, value - high});
      }
    }
  }
  return largest;
}

double shorter_handle(const BezierContour& contour, int segment) {
  const fontcore::Bezier in = contour.segment(contour.previous(segment));
  const fontcore::Bezier out = contour.segment(segment);
  return std::min((in.end() - in.p[static_cast<std::size_t>(in.degree - 1)]).norm(), (out.p[1] - out.start()).norm());
}

/// How far a turn is from the nearest there was, beyond 2 degrees and what one and a half units at the end of the
/// shorter handle make; three units where the source's own points had to be rounded too.
double excess_of_turn(const BezierContour& source, const BezierContour& now, int segment, double turn, double within) {
  const auto turns = turning_angles(source);
  const double own_handle = shorter_handle(now, segment);
  const double units = is_whole(source) ? 1.5 : 3.0;
  const auto excess = [&](double was, double handle) {
    return std::abs(was - turn) - 2.0 * degree - units / std::max(1.0, std::min(handle, own_handle));
  };
  double least = excess(0.0, own_handle);  // a smooth place
  for (int s = 0; s < source.segment_count(); ++s) {
    if ((source.point(source.node(s)) - now.point(now.node(segment))).norm() > within) continue;
    least = std::min(least, excess(std::abs(turns[static_cast<std::size_t>(s)]), shorter_handle(source, s)));
  }
  return least;
}

}  // namespace

TEST_CASE("letters of every bundled font are simplified within the tolerance, on whole numbers, smooth where they were",
          "[simplify]") {
  for (const std::string& path : bundled_fonts_for_long_work()) {
    const Font font = load_font(path);
    for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
      CompactOptions options = options_for(font, extrema);
      for (const CurveKind curve : {options.curve, CurveKind::Cubic}) {
        options.curve = curve;
        int before = 0;
        int after = 0;
        for (const BezierContour& source : contours_of(font, letters)) {
          const CompactFit fit = fit_compact(source, options);
          before += source.segment_count();
          after += fit.contour.segment_count();
          if (fit.kept) {
            CHECK(fit.contour == source);
            continue;
          }
          INFO(path << ", contour at " << source.point(0).transpose());
          CHECK(fit.contour.segment_count() <= source.segment_count());
          CHECK(is_whole(fit.contour));
          CHECK(fit.deviation <= options.tolerance);
          CHECK(fontcore::two_sided_distance(to_polyline(source, 0.5), to_polyline(fit.contour, 0.5)) <=
                1.005 * options.tolerance);
          CHECK(signed_area(fit.contour) * signed_area(source) > 0.0);
          // An extremum that was inside a segment may stay so where another node would be one too many.
          if (extrema == Extrema::Keep)
            CHECK(largest_overshoot(fit.contour) <= std::max(1.0, largest_overshoot(source) + 0.75));
          const auto turns = turning_angles(fit.contour);
          for (int s = 0; s < fit.contour.segment_count(); ++s) {
            const double turn = std::abs(turns[static_cast<std::size_t>(s)]);
            if (turn <= 1.5 * degree) continue;
            INFO("at " << fit.contour.point(fit.contour.node(s)).transpose() << ": " << turn);
            CHECK(excess_of_turn(source, fit.contour, s, turn, 3.0 * options.tolerance + 1.5) <= 0.0);
          }
        }
        CHECK(after < before);
      }
    }
  }
}

TEST_CASE("kept segments of the letters of every bundled font come out bit for bit, smooth where they were",
          "[simplify]") {
  std::mt19937 engine(11);
  for (const std::string& path : bundled_fonts_for_long_work()) {
    const Font font = load_font(path);
    for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
      CompactOptions options = options_for(font, extrema);
      for (const auto coordinates : {fontcore::Coordinates::Whole, fontcore::Coordinates::Any}) {
        options.coordinates = coordinates;
        for (const BezierContour& source : contours_of(font, letters)) {
          options.kept_segments = random_segments(source, 0.3, engine);
          const CompactFit fit = fit_compact(source, options);
          INFO(path << ", contour at " << source.point(0).transpose());
          const KeptSegments kept = find_kept(source, options.kept_segments, fit.contour, options.corner_angle);
          CHECK(kept.missing == 0);
          // Curves for which there was no other keep their own shape, and rounding turns handles of fractions as it
          // may.
          const bool is_on_grid = coordinates == fontcore::Coordinates::Any || is_whole(source);
          if (is_on_grid) CHECK(kept.largest_turn <= 1.5 * degree);
          const double accuracy = 0.002 * options.tolerance;
          CHECK(fontcore::farthest(source, fit.contour, accuracy).distance <= options.tolerance + 2.0 * accuracy);
          if (coordinates == fontcore::Coordinates::Whole && is_on_grid) CHECK(is_whole(fit.contour));
        }
      }
    }
  }
}

TEST_CASE("moving a letter moves what it is simplified to, and mirroring mirrors it, bit for bit", "[simplify]") {
  for (const std::string& path : bundled_fonts_for_long_work()) {
    const Font font = load_font(path);
    for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
      const CompactOptions options = options_for(font, extrema);
      for (const BezierContour& source : contours_of(font, "aegOQRS&8")) {
        const BezierContour own = fit_compact(source, options).contour;
        for (const Point& scale : {Point(1, 1), Point(-1, 1), Point(1, -1)}) {
          const Affine map{scale.asDiagonal(), Point(-731, 4096)};
          const CompactFit fit = fit_compact(transform(source, map), options);
          INFO(path << ", contour at " << source.point(0).transpose() << ", scale " << scale.transpose());
          CHECK(fit.contour == transform(own, map));
        }
      }
    }
  }
}

TEST_CASE("with extrema kept the first node stays the first", "[simplify]") {
  for (const std::string& path : bundled_fonts()) {
    const Font font = load_font(path);
    CompactOptions options = options_for(font, Extrema::Keep);
    for (const BezierContour& source : contours_of(font, letters)) {
      if (source.kind(source.node(0)) == PointKind::ImpliedNode) continue;
      const Point first = source.point(source.node(0));
      if (first != Point(first.array().round())) continue;
      const BezierContour own = fit_compact(source, options).contour;
      CHECK(own.point(own.node(0)) == first);
    }
  }
}

TEST_CASE("a font at tolerance 0 is the font itself, bit for bit", "[simplify]") {
  for (const std::string& path : bundled_fonts()) {
    const Font font = load_font(path);
    CHECK(simplify(font, {.tolerance = 0.0}).font.data == *font.data);
  }
}

TEST_CASE("a simplified font has no crossing that it had not, whatever the number of threads", "[simplify]") {
  for (const std::string& path : {bundled_ttf[0], bundled_otf[3]}) {
    const Font font = load_font(path);
    SimplifyOptions options;
    options.tolerance = 2.0;
    options.only = select_glyphs(font, "U+0041-005A,U+0061-007A,U+0030-0039,U+00BC-00BE");
    options.jobs.jobs = 1;
    const SimplifyResult one = simplify(font, options);
    options.jobs.jobs = 3;
    CHECK(simplify(font, options).font.data == one.font.data);
    CHECK(one.changed() > 0);
    const Font after = load_font_bytes("simplified", one.font.data);
    for (const SimplifiedGlyph& report : one.glyphs) {
      const auto id = static_cast<std::size_t>(report.glyph);
      const auto& before = font.glyphs[id].contours;
      const auto& now = after.glyphs[id].contours;
      if (!report.changed) CHECK(now == before);
      CHECK(added_crossings(find_crossings(before), find_crossings(now)) == 0);
      CHECK(report.deviation <= 2e-3 * font.units_per_em);
    }
    const auto json = nlohmann::json::parse(simplify_json(font, options, one));
    CHECK(json["glyphs"].size() == one.glyphs.size());
    CHECK(json["changed"] == one.changed());
    CHECK(json["segments_after"] < json["segments_before"]);
  }
}

TEST_CASE("TrueType outlines simplified to cubics make an OpenType font of all glyphs", "[simplify]") {
  const Font font = load_font(bundled_ttf[0]);
  SimplifyOptions options;
  options.curve = SimplifiedCurve::Cubic;
  options.only = select_glyphs(font, "a,g,aacute");
  REQUIRE(simplified_kind(font, options.curve) == FileKind::OpenType);
  const SimplifyResult result = simplify(font, options);
  CHECK(result.refused() == 0);
  const Font after = load_font_bytes("cubic.otf", result.font.data);
  REQUIRE(after.format == OutlineFormat::Cff);
  REQUIRE(after.glyphs.size() == font.glyphs.size());
  for (const SimplifiedGlyph& report : result.glyphs) {
    CHECK(report.changed);
    CHECK(report.segments_after < report.segments_before);
    const auto before = compose(font, report.glyph);
    const auto& now = after.glyphs[static_cast<std::size_t>(report.glyph)].contours;
    REQUIRE(now.size() == before.size());
    for (std::size_t c = 0; c < now.size(); ++c) {
      CHECK(fontcore::two_sided_distance(to_polyline(before[c], 1.0), to_polyline(now[c], 1.0)) <= 2.07);
      CHECK(signed_area(now[c]) * signed_area(before[c]) < 0.0);  // PostScript runs the other way round
    }
  }
  // A glyph not selected is converted segment by segment.
  const auto b = static_cast<std::size_t>(font.find("b"));
  CHECK(after.glyphs[b].contours[0].segment_count() == font.glyphs[b].contours[0].segment_count());
}

TEST_CASE("cubics of a font file do not become quadratics", "[simplify]") {
  const Font font = load_font(bundled_otf[0]);
  CHECK_THROWS_AS(simplify(font, {.curve = SimplifiedCurve::Quadratic}), RequestError);
  CHECK_THROWS_AS(simplify(font, {.tolerance = -1.0}), fontcore::InvalidInput);
}

TEST_CASE("refusals name glyphs that come out empty, selected or not", "[simplify]") {
  Font font;
  font.glyphs.resize(3);
  font.glyphs[2].name = "yen";
  SimplifyResult result;
  result.font.emptied = {{1, "no end"}, {2, "no points"}};
  result.glyphs.resize(1);
  result.glyphs[0].glyph = 1;
  result.glyphs[0].name = "a";
  result.glyphs[0].refused = "comes out empty: no end";
  CHECK(refusals(font, result.font, result) ==
        std::vector<std::string>{"yen (comes out empty: no points)", "a (comes out empty: no end)"});
}
