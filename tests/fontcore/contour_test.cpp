#include "fontcore/contour.h"

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

TEST_CASE("the halves of a split curve share a point and draw the same curve", "[contour]") {
  for (int degree = 1; degree <= 3; ++degree) {
    Bezier bezier{{Point(0, 0), Point(120, 340), Point(400, -80), Point(500, 200)}, degree};
    for (const double u : {0.1, 0.5, 0.83}) {
      const auto [left, right] = split(bezier, u);
      CHECK(left.end() == right.start());
      for (const double v : {0.0, 0.3, 0.7, 1.0}) {
        CHECK((evaluate(left, v) - evaluate(bezier, u * v)).norm() < 1e-11);
        CHECK((evaluate(right, v) - evaluate(bezier, u + (1 - u) * v)).norm() < 1e-11);
      }
    }
  }
}

TEST_CASE("the derivative of a curve is the limit of its chords", "[contour]") {
  const Bezier cubic{{Point(0, 0), Point(120, 340), Point(400, -80), Point(500, 200)}, 3};
  for (const double u : {0.1, 0.4, 0.9}) {
    const Point chord = (evaluate(cubic, u + 1e-5) - evaluate(cubic, u - 1e-5)) / 2e-5;
    CHECK((chord - derivative(cubic, u)).norm() < 1e-5);
  }
}

TEST_CASE("a tangent looks past handles drawn in onto their node", "[contour]") {
  const Bezier drawn_in{{Point(0, 0), Point(0, 0), Point(30, 40), Point(30, 40)}, 3};
  CHECK((start_tangent(drawn_in) - Point(0.6, 0.8)).norm() < 1e-15);
  CHECK((end_tangent(drawn_in) - Point(0.6, 0.8)).norm() < 1e-15);
  CHECK(start_tangent(Bezier{}) == Point::Zero());
}

TEST_CASE("a TrueType point list comes back when implied nodes are dropped", "[contour]") {
  const Points list = shapes::random_points(9, 1);
  const std::vector<bool> on_curve = {false, true, false, false, true, true, false, false, false};
  const BezierContour contour = from_quadratic_points(list, on_curve);
  Eigen::Index next = 0;
  for (int i = 0; i < contour.point_count(); ++i) {
    if (contour.kind(i) == PointKind::ImpliedNode) continue;
    REQUIRE(next < list.rows());
    CHECK(contour.points().row(i) == list.row(next));
    CHECK((contour.kind(i) == PointKind::Node) == on_curve[static_cast<std::size_t>(next)]);
    ++next;
  }
  CHECK(next == list.rows());
}

TEST_CASE("neighbouring segments share their end point exactly, round the whole contour", "[contour]") {
  for (const BezierContour& contour : shapes::letter_a()) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      CHECK(contour.segment(s).end() == contour.segment(contour.next(s)).start());
    }
  }
}

TEST_CASE("points that form no contour are refused with their number", "[contour]") {
  const Points three = shapes::random_points(3, 2);
  CHECK_THROWS_AS(BezierContour(three, {PointKind::Node, PointKind::Cubic, PointKind::Node}), InvalidInput);
  CHECK_THROWS_AS(BezierContour(three, {PointKind::Quadratic, PointKind::Quadratic, PointKind::Quadratic}),
                  InvalidInput);
  CHECK_THROWS_AS(BezierContour(three, {PointKind::Node}), InvalidInput);
  CHECK_THROWS_AS(BezierContour(Points(0, 2), {}), InvalidInput);
  Points broken = three;
  broken(1, 0) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(shapes::polygon({three.row(0), broken.row(1), three.row(2)}),
                    "BezierContour: point 1 is not finite");
}

TEST_CASE("one- and two-point contours are contours", "[contour]") {
  CHECK(shapes::polygon({{1, 2}}).segment_count() == 1);
  CHECK(signed_area(shapes::polygon({{1, 2}})) == 0.0);
  CHECK(shapes::polygon({{1, 2}, {3, 4}}).segment_count() == 2);
  CHECK(from_quadratic_points(shapes::points_of({{5, 6}}), {false}).segment_count() == 1);
}

TEST_CASE("reversing a contour twice gives it back, and once its negative area", "[contour]") {
  for (const BezierContour& contour : shapes::letter_a()) {
    CHECK(reverse(reverse(contour)) == contour);
    CHECK(signed_area(reverse(contour)) == Approx(-signed_area(contour)).epsilon(1e-13));
    CHECK(reverse(contour).point(0) == contour.point(0));
  }
}

TEST_CASE("a transformed contour draws the transformed curve", "[contour]") {
  Affine map;
  map.linear << 1.1, 0.3, -0.2, 0.9;
  map.shift << 20, -7;
  const BezierContour contour = shapes::letter_a()[0];
  const BezierContour moved = transform(contour, map);
  for (int s = 0; s < contour.segment_count(); ++s) {
    CHECK((evaluate(moved.segment(s), 0.3) - map(evaluate(contour.segment(s), 0.3))).norm() < 1e-10);
  }
}
