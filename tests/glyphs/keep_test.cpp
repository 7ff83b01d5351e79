// What must hold does, on the outlines that are written: A to Z and a to z of every bundled font, edited at random.

#include <cmath>
#include <numbers>
#include <random>

#include "fontcore/constraint.h"
#include "fontcore/measure.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;
using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;

namespace {

// How often a feature was looked at, and how often it was gone.
struct Tally {
  int seen = 0;
  int lost = 0;
  void add(bool is_kept) {
    ++seen;
    if (!is_kept) ++lost;
  }
};
struct Tallies {
  Tally axis_lines;  // horizontal and vertical lines, after rounding
  Tally runs;        // straight runs of several lines, before rounding: within 1e-6
  Tally extrema;     // smooth nodes with both handles horizontal or vertical, after rounding
  Tally zones;       // flat and round features and apexes at the font's zones, after rounding
  Tally joins;       // turns of less than 1.5 degrees, after rounding
};

Point leaving(const Bezier& b) { return b.p[1] - b.p[0]; }
Point arriving(const Bezier& b) {
  const auto n = static_cast<std::size_t>(b.degree);
  return b.p[n] - b.p[n - 1];
}

void look(const BezierContour& before, const BezierContour& solved, const BezierContour& after,
          const std::vector<double>& zones, Tallies& tallies) {
  const auto turns_before = turning_angles(before);
  const auto turns_after = turning_angles(after);
  for (int s = 0; s < before.segment_count(); ++s) {
    const int previous = before.previous(s);
    const Bezier in = before.segment(previous);
    const Bezier out = before.segment(s);
    const Point along = leaving(out);
    if (out.degree == 1 && along != Point::Zero() && along.x() * along.y() == 0.0) {
      const Point now = leaving(after.segment(s));
      tallies.axis_lines.add(along.x() == 0.0 ? now.x() == 0.0 : now.y() == 0.0);
    }
    const double turn = std::abs(turns_before[static_cast<std::size_t>(s)]);
    if (out.degree == 1 && in.degree == 1 && turn < 1e-9) {
      const Point chord = solved.segment(s).p[1] - solved.segment(previous).p[0];
      const Point first = leaving(solved.segment(previous));
      tallies.runs.add(std::abs(chord.x() * first.y() - chord.y() * first.x()) < 1e-6 * chord.norm());
    }
    if (turn < fontcore::smooth_angle) {
      // A hair of tolerance: what turned by 1.4999 degrees may do so in other digits.
      tallies.joins.add(std::abs(turns_after[static_cast<std::size_t>(s)]) < fontcore::smooth_angle + 1e-6);
    }
    const bool is_node = before.kind(before.node(s)) == fontcore::PointKind::Node;
    for (int axis = 0; is_node && axis < 2 && in.degree > 1 && out.degree > 1; ++axis) {
      if (along[axis] != 0.0 || arriving(in)[axis] != 0.0 || along.dot(arriving(in)) <= 0.0) continue;
      tallies.extrema.add(leaving(after.segment(s))[axis] == 0.0 && arriving(after.segment(previous))[axis] == 0.0);
    }
    const double height = out.p[0].y();
    const bool at_zone = std::find(zones.begin(), zones.end(), height) != zones.end();
    if (at_zone && -arriving(in).y() * along.y() >= 0.0) {
      tallies.zones.add(after.segment(s).p[0].y() == height);
    }
  }
}

}  // namespace

TEST_CASE("with everything kept, lines, extrema, zones and joins of every letter survive random edits",
          "[restyle][slow]") {
  std::mt19937 engine(20);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const std::string& path : bundled_fonts()) {
    const Font font = load_font(path);
    const double em = font.units_per_em;
    const std::vector<double> zones = alignment_zones(font);
    CHECK(zones.size() >= 4);
    Tallies tallies;
    for (int round = 0; round < 3; ++round) {
      for (char32_t letter = U'A'; letter <= U'z'; ++letter) {
        const auto found = font.character_map.find(letter);
        if (found == font.character_map.end()) continue;
        const Glyph& glyph = font.glyphs[static_cast<std::size_t>(found->second)];
        if (glyph.contours.empty() || glyph.is_composite()) continue;
        Recipe recipe;
        const double angle = 2.0 * std::numbers::pi * uniform(engine);
        const Point move = (0.01 + 0.05 * uniform(engine)) * em * Point(std::cos(angle), std::sin(angle));
        const Point near(uniform(engine) * glyph.advance, uniform(engine) * 0.7 * em);
        const double breadth = (0.2 + 0.8 * uniform(engine)) * em;
        if (round < 2) recipe.steps = {SweepStep{.near = near, .move = move, .breadth = breadth}};
        if (round == 2) recipe.steps = {EqualizeStep{.bands = {{0.03 * em, 0.5}, {0.12 * em, 1.5}}}};
        const GlyphResult result = restyle_glyph(font, glyph.id, recipe, zones);
        INFO(path << " " << glyph.name);
        CHECK(result.report.refused.empty());
        for (std::size_t k = 0; k < glyph.contours.size(); ++k) {
          if (result.contours[k] == glyph.contours[k]) continue;
          look(glyph.contours[k], result.unrounded[k], result.contours[k], zones, tallies);
        }
      }
    }
    INFO(path);
    CHECK(tallies.axis_lines.seen > 200);
    CHECK(tallies.axis_lines.lost == 0);
    CHECK(tallies.runs.lost == 0);
    CHECK(tallies.extrema.seen > 200);
    CHECK(tallies.extrema.lost == 0);
    CHECK(tallies.zones.seen > 200);
    CHECK(tallies.zones.lost == 0);
    CHECK(tallies.joins.seen > 300);
    // Handles of four units at fractions of one have no whole-number neighbours within 1.5 degrees.
    CHECK(tallies.joins.lost <= (font.has_fractional_coordinates ? tallies.joins.seen / 1000 : 0));
  }
}
