#include "fontcore/degree.h"

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
