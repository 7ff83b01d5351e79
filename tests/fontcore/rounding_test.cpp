#include "fontcore/rounding.h"

#include "fontcore/edit.h"
#include "fontcore/error.h"
#include "fontcore/fit.h"
#include "fontcore/measure.h"
#include "fontcore/soften.h"
#include "tests/catch.h"
#include "tests/every_rounding.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr double em = 2048.0;

// What a sweep of the outline near a place makes of it, at its area; the handle is to stay in place.
Unrounded swept(const BezierContour& contour, const Point& near, const Point& move, double breadth) {
  const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
  const auto [segment, u, distance] = nearest_point(contour, near);
  StructureEdit edit;
  edit.field = respect_corners(curve, sweep(curve, curve.parameter(segment, u), move, breadth).field);
  edit.handles = {{{segment, u}, move}};
  edit.breadth = breadth;
  edit.area = signed_area(contour);
  edit.rules.zones = {-20.0, 961.0};
  return {refit_structure(curve, edit).contour,
          contour,
          edit.rules,
          {.area = *edit.area, .scale = std::abs(*edit.area), .handles = {{segment, u}}}};
}

// An outline stretched and shifted by fractions.
Unrounded stretched(const BezierContour& contour, double sx, double sy, const Point& shift) {
  Affine map;
  map.linear << sx, 0, 0, sy;
  map.shift = shift;
  const BezierContour moved = transform(contour, map);
  const double area = signed_area(moved);
  return {moved, contour, {}, {.area = area, .scale = std::abs(area), .handles = {{0, 0.3}}}};
}

// The contours rounded, and every choice of floors and ceilings tried.
void check_against_every_choice(const std::vector<Unrounded>& contours) {
  std::vector<BezierContour> now;
  for (const Rounding& rounding : round_keeping_area(contours)) now.push_back(rounding.contour);
  const auto classes = every_rounding::classes_of(contours);
  REQUIRE(every_rounding::free_count(classes) <= 14);
  const auto least = every_rounding::least_error(contours, classes);
  REQUIRE(least);
  CHECK(std::abs(every_rounding::area_error(contours, now)) == Approx(*least).margin(1e-6));
  CHECK(every_rounding::opened_joins(contours, now) == 0);
  for (std::size_t c = 0; c < contours.size(); ++c) {
    CHECK(every_rounding::handle_error(contours[c], now[c]) <= 1.0);
    CHECK(shapes::largest_distance(now[c].points(), contours[c].edited.points()) < std::sqrt(2.0));
  }
}

}  // namespace

TEST_CASE("of few free coordinates the choice is the best of all", "[rounding]") {
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Points by = shapes::random_points(3, seed, 1.0);
    INFO("seed " << seed);
    check_against_every_choice(
        {stretched(shapes::circle(297.0), 1.0 + 0.02 * by(0, 0), 1.0 + 0.02 * by(0, 1), Point(by(1, 0), 0))});
    check_against_every_choice({stretched(shapes::arch(601.0), 1.003, 1.0 + 0.02 * by(0, 1), by.row(1).transpose())});
    // Corners that move each on their own.
    const BezierContour square = shapes::square(600.0);
    const BezierContour bent = square.with_points(square.points() + shapes::random_points(4, seed, 20.0));
    check_against_every_choice({{bent, square, {}, {.area = 363000.0 + by(2, 0), .scale = 363000.0, .handles = {}}}});
  }
}

TEST_CASE("the contours of a glyph make good for each other what one alone cannot", "[rounding]") {
  // A stem has one edge to round, which is 700 square units a unit; its dot takes what that leaves.
  for (const double edge : {0.5, 0.3, 0.11, 0.77}) {
    const BezierContour stem = shapes::polygon({{0, 0}, {100, 0}, {100, 700}, {0, 700}});
    Points points = stem.points();
    points(1, 0) = points(2, 0) = 100.0 + edge;
    const double area = (100.0 + edge) * 700.0;
    const Unrounded moved{stem.with_points(points), stem, {}, {.area = area, .scale = 1e5, .handles = {}}};
    const Unrounded dot = stretched(shapes::circle(61.0), 1.03, 0.98, Point(0, 850));
    check_against_every_choice({moved});
    check_against_every_choice({moved, dot});
    const Rounding stem_alone = round_keeping_area(moved.edited, moved.original, moved.rules, moved.goal);
    const Rounding dot_alone = round_keeping_area(dot.edited, dot.original, dot.rules, dot.goal);
    double together = 0.0;
    for (const Rounding& rounding : round_keeping_area({moved, dot})) together += rounding.area_error;
    CHECK(std::abs(together) < std::abs(stem_alone.area_error + dot_alone.area_error));
    CHECK(std::abs(together) < std::abs(stem_alone.area_error));
  }
}

TEST_CASE("a stem goes further than a unit for its area only where that is asked for", "[rounding]") {
  const BezierContour stem = shapes::polygon({{0, 0}, {100, 0}, {100, 660}, {0, 660}});
  Points points = stem.points();
  points.rightCols(1).array() += 0.4;
  points(1, 0) = points(2, 0) = 100.5;
  const BezierContour moved = stem.with_points(points);
  RoundingGoal goal{.area = 100.5 * 660.0, .scale = 100.5 * 660.0, .handles = {}};
  const Rounding near = round_keeping_area(moved, stem, {}, goal);
  CHECK(shapes::largest_distance(near.contour.points(), points) < std::sqrt(2.0));
  CHECK(std::abs(near.area_error) > 1e-3 * goal.scale);
  goal.beyond_unit = BeyondUnit::ForArea;
  const Rounding far = round_keeping_area(moved, stem, {}, goal);
  CHECK(std::abs(far.area_error) <= 4e-4 * goal.scale);
  CHECK(shapes::largest_distance(far.contour.points(), points) < 18.0);
}

TEST_CASE("of many free coordinates the choice is within a millionth of the area", "[rounding]") {
  const BezierContour contour = shapes::letter_a()[0];
  for (unsigned seed = 0; seed < 8; ++seed) {
    const Point place = shapes::random_points(1, seed, 400.0).row(0).transpose() + Point(400, 450);
    const Unrounded moved = swept(contour, place, Point(11.3, -7.7), 600.0);
    const auto& [edited, original, rules, goal] = moved;
    const Rounding rounding = round_keeping_area(edited, original, rules, goal);
    const auto classes = every_rounding::classes_of({moved});
    const auto plain = every_rounding::plain({moved}, classes);
    INFO("seed " << seed << ", " << every_rounding::free_count(classes) << " free");
    CHECK(rounding.plain_area_error == Approx(every_rounding::area_error({moved}, plain)).margin(1e-6));
    CHECK(std::abs(rounding.area_error) <= std::max(std::abs(rounding.plain_area_error), 1e-6 * goal.scale));
    if (every_rounding::free_count(classes) > 14) CHECK(std::abs(rounding.area_error) <= 1e-6 * goal.scale);
    CHECK(signed_area(rounding.contour) - goal.area == Approx(rounding.area_error).margin(1e-6));
    CHECK(rounding.opened_joins == 0);
    CHECK(rounding.handle_error <= 1.0);
    CHECK(shapes::largest_distance(rounding.contour.points(), edited.points()) < std::sqrt(2.0));
    for (int i = 0; i < contour.point_count(); ++i) {
      const Point p = rounding.contour.point(i);
      if (contour.kind(i) == PointKind::ImpliedNode) continue;
      CHECK(p == Point(std::round(p.x()), std::round(p.y())));
      if (edited.point(i) == contour.point(i)) CHECK(p == contour.point(i));
    }
  }
}

TEST_CASE("the same outline is rounded to the same whole numbers", "[rounding]") {
  const Unrounded moved = swept(shapes::letter_a()[0], Point(100, 250), Point(-21.3, 3.7), 700.0);
  const Rounding once = round_keeping_area(moved.edited, moved.original, moved.rules, moved.goal);
  const Rounding again = round_keeping_area(moved.edited, moved.original, moved.rules, moved.goal);
  CHECK(once.contour == again.contour);
}

TEST_CASE("what lies on whole numbers already is not rounded to others", "[rounding]") {
  const BezierContour contour = shapes::letter_a()[1];
  const Rounding rounding =
      round_keeping_area(contour, contour, {}, {.area = signed_area(contour), .scale = 1.0, .handles = {}});
  CHECK(rounding.contour == contour);
  CHECK(rounding.area_error == 0.0);
  CHECK_THROWS_AS(round_keeping_area(contour, shapes::square(600), {}, {}), InvalidInput);
}

TEST_CASE("what a zone holds is where it was, whatever the solver left on it", "[rounding]") {
  const BezierContour before = shapes::square(600);
  fontcore::Points points = before.points();
  points.row(1) << 610.3, 4.6e-18;  // moved along the zone
  const Rounding rounding =
      round_keeping_area(before.with_points(points), before, {.zones = {0.0, 600.0}}, {.area = 363000, .scale = 1.0});
  CHECK(rounding.contour.point(1).y() == 0.0);
}

TEST_CASE("points that are new are rounded though they have not moved, whole ones of the font stay", "[rounding]") {
  const Softened softened = soften(reverse(shapes::square(600)), {.radius = 33.3, .arcs = ArcKind::Quadratic});
  const BezierContour& contour = softened.contour;
  const double area = signed_area(contour);
  RoundingGoal goal{.area = area, .scale = std::abs(area)};
  CHECK(round_keeping_area(contour, contour, {}, goal).contour == contour);
  for (const int from : softened.came_from) goal.is_new.push_back(from < 0);
  const Rounding rounding = round_keeping_area(contour, contour, {.zones = {0.0, 600.0}}, goal);
  for (int i = 0; i < contour.point_count(); ++i) {
    const Point p = rounding.contour.point(i);
    if (contour.kind(i) == PointKind::ImpliedNode) continue;
    CHECK(p == Point(std::round(p.x()), std::round(p.y())));
    CHECK((p - contour.point(i)).cwiseAbs().maxCoeff() < 1.0);
  }
  CHECK(control_box(rounding.contour).low == Point(0, 0));
  CHECK(control_box(rounding.contour).high == Point(600, 600));
  CHECK(std::abs(rounding.area_error) < 1e-5 * std::abs(area));
  CHECK(rounding.opened_joins == 0);
  goal.is_new.pop_back();
  CHECK_THROWS_AS(round_keeping_area(contour, contour, {}, goal), InvalidInput);
}
