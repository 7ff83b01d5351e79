#include "fontcore/degree.h"

#include <algorithm>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

/// A wave of cubics over a bar.
BezierContour wave() {
  Points points(10, 2);
  points << 0, 0, 100, 300, 200, -250, 300, 40, 380, 200, 420, 10, 500, 0, 500, -300, 250, -310.5, 0, -300;
  return {points,
          {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic,
           PointKind::Node, PointKind::Node, PointKind::Quadratic, PointKind::Node}};
}

}  // namespace

TEST_CASE("a raised contour is the same curve", "[degree]") {
  const BezierContour raised = raised_to_cubics(wave());
  REQUIRE(raised.segment_count() == wave().segment_count());
  for (int s = 0; s < raised.segment_count(); ++s) {
    CHECK(raised.degree(s) != 2);
    for (const double u : {0.0, 0.2, 0.5, 0.9}) {
      CHECK((evaluate(raised.segment(s), u) - evaluate(wave().segment(s), u)).norm() < 1e-12);
    }
  }
}

TEST_CASE("a lowered contour stays within its distance, and nearly has the tangents it had", "[degree]") {
  int last = 0;
  for (const double distance : {10.0, 1.0, 0.1, 0.01}) {
    const BezierContour lowered = lowered_to_quadratics(wave(), distance, false);
    CHECK(std::ranges::find(lowered.kinds(), PointKind::Cubic) == lowered.kinds().end());
    CHECK(farthest(wave(), lowered, 1e-3 * distance).distance <= distance);
    CHECK(lowered.segment_count() > last);
    last = lowered.segment_count();
    if (distance < 1.0) CHECK(start_tangent(lowered.segment(0)).dot(start_tangent(wave().segment(0))) > 1.0 - 1e-4);
  }
  const BezierContour whole = lowered_to_quadratics(wave(), 1.0, true);
  CHECK(whole.points() == Points(whole.points().array().floor()));
  CHECK_THROWS_AS(lowered_to_quadratics(wave(), 0.0, true), InvalidInput);
}

TEST_CASE("nodes midway between quadratic handles are implied", "[degree]") {
  const BezierContour all = shapes::all_implied(shapes::points_of({{0, 0}, {100, 0}, {130, 80}, {40, 120}, {-20, 60}}));
  // Every implied node made a point of its own, and back.
  const BezierContour own(all.points(), [&] {
    std::vector<PointKind> kinds = all.kinds();
    std::ranges::replace(kinds, PointKind::ImpliedNode, PointKind::Node);
    return kinds;
  }());
  const BezierContour back = with_implied_nodes(own, 0.0);
  CHECK(std::ranges::count(back.kinds(), PointKind::ImpliedNode) == 5);
  CHECK(back.kind(0) != PointKind::ImpliedNode);
  CHECK(farthest(back, all, 1e-3).distance < 2e-3);
  BezierContour moved = own;
  const int node = own.node(2);
  moved.set_point(node, own.point(node) + Point(0.3, 0.0));
  CHECK(std::ranges::count(with_implied_nodes(moved, 0.2).kinds(), PointKind::ImpliedNode) == 4);
  CHECK(std::ranges::count(with_implied_nodes(moved, 0.4).kinds(), PointKind::ImpliedNode) == 5);
}

TEST_CASE("curves whose points lie on a line become lines, and short segments nodes", "[degree]") {
  // A square with a side of quadratics that turn back by a unit, and a short side.
  const BezierContour contour = fontcore::from_quadratic_points(
      shapes::points_of({{0, 0}, {40, 0}, {39, 0}, {100, 0}, {100, 99}, {99, 100}, {0, 100}}),
      {true, false, false, true, true, true, true});
  const auto marks = [&](int stays) {
    std::vector<bool> list(static_cast<std::size_t>(contour.point_count()), false);
    if (stays >= 0) list[static_cast<std::size_t>(stays)] = true;
    return list;
  };
  const BezierContour straight = straightened(contour, marks(-1));
  CHECK(straight.segment_count() == 5);
  for (int s = 0; s < straight.segment_count(); ++s) CHECK(straight.degree(s) == 1);
  CHECK(signed_area(straight) == signed_area(contour));
  CHECK(straightened(contour, marks(1)).segment_count() == contour.segment_count());
  const int corner = contour.node(3);
  CHECK(contour.point(corner) == Point(100, 99));
  const BezierContour shorter = without_short_segments(straight, 2.0, std::vector<bool>(5, false));
  REQUIRE(shorter.segment_count() == 4);
  CHECK(shorter.point(2) == Point(99.5, 99.5));
  std::vector<bool> held(5, false);
  held[2] = true;
  CHECK(without_short_segments(straight, 2.0, held).point(2) == Point(100, 99));
  CHECK_THROWS_AS(without_short_segments(straight, 2.0, {}), InvalidInput);
  CHECK_THROWS_AS(straightened(straight, {}), InvalidInput);
}
