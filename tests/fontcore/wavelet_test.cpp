#include "fontcore/wavelet.h"

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/outline_curve.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

TEST_CASE("a decomposed control polygon comes back", "[wavelet]") {
  for (const int coarsest : {4, 5, 6, 7, 9}) {
    for (int levels = 0; levels <= 6; ++levels) {
      const Points fine = shapes::random_points(coarsest << levels, static_cast<unsigned>(levels));
      const MultiresCurve curve = decompose(fine, levels);
      CHECK(curve.levels() == levels);
      CHECK(curve.coarse.rows() == coarsest);
      CHECK(shapes::largest_distance(reconstruct(curve), fine) < 1e-11 * std::pow(1.25, levels));
    }
  }
}

TEST_CASE("refinement draws the same curve at the parameters of the finer level", "[wavelet]") {
  const Points coarse = shapes::random_points(6, 3);
  const Points fine = chaikin::refine(chaikin::refine(coarse));
  for (double t = -0.5; t < 24.0; t += 0.37) {
    CHECK((evaluate_spline(fine, t) - evaluate_spline(coarse, coarser_parameter(t, 2))).norm() < 1e-11);
    CHECK(finer_parameter(coarser_parameter(t, 5), 5) == Approx(t).margin(1e-12));
  }
  CHECK(limit_area(fine) == Approx(limit_area(coarse)).epsilon(1e-12));
}

TEST_CASE("what refinement adds is no detail", "[wavelet]") {
  const Points coarse = shapes::random_points(8, 4);
  const auto [again, detail] = chaikin::analyze(chaikin::refine(coarse));
  CHECK(shapes::largest_distance(again, coarse) < 1e-12);
  CHECK(detail.cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("analysis is local: a moved control point reaches two coarse points and two details", "[wavelet]") {
  Points fine = Points::Zero(32, 2);
  fine(11, 0) = 1.0;
  const auto [coarse, detail] = chaikin::analyze(fine);
  CHECK((coarse.array() != 0.0).count() == 2);
  CHECK((detail.array() != 0.0).count() == 2);
}

TEST_CASE("polygons that cannot be halved are refused with their size", "[wavelet]") {
  CHECK_THROWS_AS(chaikin::analyze(shapes::random_points(9, 1)), InvalidInput);
  CHECK_THROWS_WITH(chaikin::analyze(shapes::random_points(6, 1)),
                    "chaikin::analyze: 6 control points cannot be halved into at least 4");
  CHECK_THROWS_AS(decompose(shapes::random_points(24, 1), 3), InvalidInput);
  CHECK_THROWS_AS(chaikin::synthesize(Points::Zero(8, 2), Points::Zero(7, 2)), InvalidInput);
}
