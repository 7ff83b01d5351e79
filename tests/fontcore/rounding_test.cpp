#include "fontcore/rounding.h"

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/soften.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

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
    CHECK((p - contour.point(i)).cwiseAbs().maxCoeff() < 2.0);
  }
  CHECK(control_box(rounding.contour).low == Point(0, 0));
  CHECK(control_box(rounding.contour).high == Point(600, 600));
  CHECK(std::abs(rounding.area_error) < 1e-5 * std::abs(area));
  CHECK(rounding.opened_joins == 0);
  goal.is_new.pop_back();
  CHECK_THROWS_AS(round_keeping_area(contour, contour, {}, goal), InvalidInput);
}
