#include "fontcore/soften.h"

#include <cmath>
#include <numbers>

#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

/// Largest turn at the joins of the arcs: at both their ends, and where two quadratics meet.
double largest_turn_at_arcs(const Softened& softened) {
  const std::vector<double> turns = turning_angles(softened.contour);
  double largest = 0.0;
  for (int s = 0; s < softened.contour.segment_count(); ++s) {
    const bool is_new = softened.came_from[static_cast<std::size_t>(softened.contour.node(s))] < 0;
    if (is_new) largest = std::max(largest, std::abs(turns[static_cast<std::size_t>(s)]));
  }
  return largest;
}

/// Largest distance from the old outline of what is not an arc.
double largest_distance_off_arcs(const Softened& softened, const BezierContour& old) {
  double largest = 0.0;
  const BezierContour& contour = softened.contour;
  for (int s = 0; s < contour.segment_count(); ++s) {
    bool is_arc = contour.degree(s) > 1;
    for (int k = 1; k < contour.degree(s); ++k) {
      is_arc = is_arc && softened.came_from[static_cast<std::size_t>(contour.point_of(s, k))] < 0;
    }
    for (double u = 0.0; !is_arc && u <= 1.0; u += 0.125) {
      largest = std::max(largest, nearest_point(old, evaluate(contour.segment(s), u)).distance);
    }
  }
  return largest;
}

double loss(const BezierContour& before, const BezierContour& after) {
  return std::abs(signed_area(before)) - std::abs(signed_area(after));
}

/// A leaf of two cubics and two corners.
BezierContour leaf() {
  return {shapes::points_of({{0, 0}, {200, -150}, {500, -100}, {600, 0}, {400, 200}, {100, 150}}),
          {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic}};
}

const std::vector<ArcKind> kinds{ArcKind::Quadratic, ArcKind::Cubic};

}  // namespace

TEST_CASE("a square loses (1 - pi/4) r^2 at every corner, as near as its arcs are circles", "[soften]") {
  for (double radius = 1.0; radius <= 300.0; radius *= 1.7) {
    const double square = radius * radius;
    const BezierContour before = shapes::square(600);
    const BezierContour cubic = soften(before, {.radius = radius}).contour;
    CHECK(std::abs(loss(before, cubic) / 4 - (1 - std::numbers::pi / 4) * square) < 3e-4 * square);
    // The triangle that the line of the handles cuts off, and a third of both control triangles.
    const double a = std::tan(std::numbers::pi / 8);
    const double b = 1 - a;
    const BezierContour quadratic = soften(before, {.radius = radius, .arcs = ArcKind::Quadratic}).contour;
    CHECK(loss(before, quadratic) / 4 == Approx((b * b / 2 + a * b / 6) * square).epsilon(1e-9));
    CHECK(quadratic.point_count() == 20);
    CHECK(cubic.point_count() == 16);
  }
}

TEST_CASE("between straight legs the arc touches its circle at both ends and in the middle", "[soften]") {
  for (const double angle : {0.2, 0.7, 1.5, 2.2, 2.9}) {
    const Point leg(-std::cos(angle), -std::sin(angle));
    const BezierContour wedge = shapes::polygon({{0, 0}, {4000, 0}, Point(4000, 0) - 4000 * leg});
    for (const ArcKind kind : kinds) {
      const Softened softened = soften(wedge, {.radius = 50, .corners = {{1}}, .arcs = kind});
      REQUIRE(softened.corners.size() == 1);
      CHECK(softened.corners[0].radius == 50);
      CHECK(softened.corners[0].cut == Approx(50 * std::tan(angle / 2)));
      const Point centre(4000 - softened.corners[0].cut, 50);
      const BezierContour& contour = softened.contour;
      const Bezier arc = contour.segment(1);
      CHECK((arc.start() - centre).norm() == Approx(50));
      const Point middle = kind == ArcKind::Cubic ? evaluate(arc, 0.5) : arc.end();
      CHECK((middle - centre).norm() == Approx(50).epsilon(1e-12));
      CHECK((contour.segment(kind == ArcKind::Cubic ? 1 : 2).end() - centre).norm() == Approx(50));
    }
  }
}

TEST_CASE("both ends of every arc are tangent to what is left of the old outline, and that is all on it", "[soften]") {
  std::vector<BezierContour> shapes_to_try = shapes::letter_a();
  for (const BezierContour& shape :
       {shapes::square(600), shapes::arch(500), leaf(), reverse(leaf()), reverse(shapes::arch(500))}) {
    shapes_to_try.push_back(shape);
  }
  for (const BezierContour& shape : shapes_to_try) {
    for (const double radius : {0.5, 10.0, 40.0, 120.0, 1000.0}) {
      for (const ArcKind kind : kinds) {
        const Softened softened = soften(shape, {.radius = radius, .arcs = kind});
        CHECK_FALSE(softened.corners.empty());
        CHECK(largest_turn_at_arcs(softened) < 1e-9);
        CHECK(largest_distance_off_arcs(softened, shape) < 1e-9);
        CHECK(std::signbit(signed_area(softened.contour)) == std::signbit(signed_area(shape)));
        CHECK(is_simple(softened.contour));
        for (const SoftenedCorner& corner : softened.corners) {
          CHECK(corner.radius <= radius);
          CHECK(corner.cut <= 0.5 * length(shape.segment(corner.segment)));
          CHECK(corner.cut <= 0.5 * length(shape.segment(shape.previous(corner.segment))));
        }
      }
    }
  }
}

TEST_CASE("horizontal and vertical stay so to the last bit, and what is not trimmed keeps its bits", "[soften]") {
  const BezierContour shape = transform(shapes::arch(500), {.shift = Point(0.1, 1.0 / 3.0)});
  const Softened softened = soften(shape, {.radius = 37});
  for (int s = 0; s < softened.contour.segment_count(); ++s) {
    const Bezier line = softened.contour.segment(s);
    if (line.degree > 1) continue;
    CHECK((line.p[0].x() == line.p[1].x() || line.p[0].y() == line.p[1].y()));
  }
  for (std::size_t i = 0; i < softened.came_from.size(); ++i) {
    const int from = softened.came_from[i];
    if (from >= 0) CHECK(softened.contour.point(static_cast<int>(i)) == shape.point(from));
  }
}

TEST_CASE("a corner of a counter or a notch is rounded like one outside, and adds what that takes away", "[soften]") {
  const BezierContour hole = reverse(shapes::square(300));
  CHECK(loss(hole, soften(hole, {.radius = 40}).contour) ==
        Approx(loss(shapes::square(300), soften(shapes::square(300), {.radius = 40}).contour)));
  const BezierContour notched =
      shapes::polygon({{0, 0}, {600, 0}, {600, 600}, {400, 600}, {400, 300}, {200, 300}, {200, 600}, {0, 600}});
  const Softened inner = soften(notched, {.radius = 40, .corners = {{4, 5}}});
  const Softened outer = soften(notched, {.radius = 40, .corners = {{0, 1}}});
  CHECK(loss(notched, inner.contour) == Approx(-loss(notched, outer.contour)));
}

TEST_CASE("a symmetric outline stays symmetric, and a reversed one gives the reverse", "[soften]") {
  const BezierContour shape = shapes::arch(500);
  for (const ArcKind kind : kinds) {
    const BezierContour softened = soften(shape, {.radius = 60, .arcs = kind}).contour;
    const Affine mirror{Eigen::Vector2d(-1, 1).asDiagonal().toDenseMatrix(), Point(500, 0)};
    CHECK(two_sided_distance(to_polyline(softened, 5), to_polyline(transform(reverse(softened), mirror), 5)) < 1e-2);
    const BezierContour other = soften(reverse(leaf()), {.radius = 60, .arcs = kind}).contour;
    const BezierContour turned = reverse(other);
    const BezierContour plain = soften(leaf(), {.radius = 60, .arcs = kind}).contour;
    REQUIRE(turned.point_count() == plain.point_count());
    double largest = 0.0;  // the list begins with the other end of the first arc
    for (int i = 0; i < plain.point_count(); ++i) {
      largest = std::max(largest, nearest_point(turned, plain.point(plain.node(i % plain.segment_count()))).distance);
    }
    CHECK(largest < 1e-9);
  }
}

TEST_CASE("a radius of 0 and an outline without corners change no bit", "[soften]") {
  for (const BezierContour& shape : {shapes::letter_a()[0], shapes::letter_a()[1], leaf()}) {
    CHECK(soften(shape, {}).contour == shape);
    CHECK(soften(shape, {.corners = {{0}}}).contour == shape);
  }
  const BezierContour round = shapes::all_implied(shapes::points_of({{0, 0}, {500, 0}, {500, 500}, {0, 500}}));
  CHECK(soften(round, {.radius = 50}).contour == round);
  CHECK(soften(shapes::circle(300), {.radius = 50}).contour == shapes::circle(300));
}

TEST_CASE("a leg that is too short gives half of itself, and shorter handles than the least leave the corner",
          "[soften]") {
  const BezierContour stem = shapes::polygon({{0, 0}, {30, 0}, {30, 700}, {0, 700}});
  const Softened all = soften(stem, {.radius = 100});
  REQUIRE(all.corners.size() == 4);
  for (const SoftenedCorner& corner : all.corners) {
    CHECK(corner.cut == 15);
    CHECK(corner.radius == Approx(15));
  }
  // Two units stay between the arcs, and the handles of radius 14 are 5.8 units long.
  const Softened roomy = soften(stem, {.radius = 100, .least_handle = 2});
  REQUIRE(roomy.corners.size() == 4);
  CHECK(roomy.corners[0].cut == 14);
  CHECK(soften(stem, {.radius = 4.8, .least_handle = 2}).contour == stem);
  CHECK(soften(stem, {.radius = 4.9, .least_handle = 2}).corners.size() == 4);
}

TEST_CASE("a list of corners gives one structure, whatever the coordinates and the radius", "[soften]") {
  const BezierContour light = shapes::letter_a()[0];
  std::vector<int> corners;
  for (const SoftenedCorner& corner : soften(light, {.radius = 10}).corners) corners.push_back(corner.segment);
  REQUIRE(corners.size() > 5);
  for (const ArcKind kind : kinds) {
    const BezierContour softened =
        soften(light, {.radius = 20, .corners = corners, .arcs = kind, .empty = EmptyArc::Add}).contour;
    for (const double radius : {0.0, 3.0, 4000.0}) {
      // Another master: other coordinates, one corner gone straight, one leg without length.
      Points points = light.points() + shapes::random_points(light.point_count(), 7, 12.0);
      points.row(light.point_of(corners[1], 1)) = points.row(light.point_of(corners[1], 0));
      const BezierContour heavy = light.with_points(points);
      const BezierContour other =
          soften(heavy, {.radius = radius, .corners = corners, .arcs = kind, .empty = EmptyArc::Add}).contour;
      CHECK(other.kinds() == softened.kinds());
    }
    Points points = light.points();
    for (Eigen::Index i = 0; i < points.rows(); ++i) points(i, 0) *= 1.15;
    const BezierContour wide =
        soften(light.with_points(points), {.radius = 35, .corners = corners, .arcs = kind, .empty = EmptyArc::Add})
            .contour;
    const BezierContour middle = wide.with_points(0.5 * (wide.points() + softened.points()));
    CHECK(is_simple(middle));
  }
}

TEST_CASE("the arc stands in the list where its corner stood, and neighbours that were implied become nodes",
          "[soften]") {
  const Softened first = soften(shapes::square(100), {.radius = 10, .corners = {{0}}});
  CHECK(first.came_from == std::vector<int>{-1, -1, -1, -1, 1, 2, 3});
  CHECK((first.contour.point(0) - Point(0, 10)).norm() < 1e-12);
  CHECK((first.contour.point(3) - Point(10, 0)).norm() < 1e-12);
  const BezierContour drop =
      from_quadratic_points(shapes::points_of({{0, 0}, {300, 0}, {300, 300}, {0, 300}}), {true, false, false, false});
  const Softened softened = soften(drop, {.radius = 30});
  REQUIRE(softened.corners.size() == 1);
  for (std::size_t i = 0; i < softened.came_from.size(); ++i) {
    if (softened.came_from[i] < 0) continue;
    CHECK(softened.contour.kind(static_cast<int>(i)) != PointKind::ImpliedNode);
  }
}

TEST_CASE("a radius that is no length and a corner that is no segment are refused", "[soften]") {
  CHECK(message_of<InvalidInput>([] { soften(shapes::square(100), {.radius = -1}); }) ==
        "soften: radius -1 is not a length");
  CHECK(message_of<InvalidInput>([] { soften(shapes::square(100), {.radius = 1, .corners = {{4}}}); }) ==
        "soften: corner 4 of a contour of 4 segments");
}
