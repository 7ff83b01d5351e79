// The papers' equations, by their numbers.

#include "fontcore/measure.h"
#include "fontcore/wavelet.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

TEST_CASE("[HBS05] eq. 7: the analysis filters on numbers worked by hand", "[papers]") {
  Points fine = Points::Zero(8, 2);
  fine.col(0) << 1, 2, 4, 8, 16, 32, 64, 128;
  const auto [coarse, detail] = chaikin::analyze(fine);
  // x_1^{n-1} = (-x_0 + 3 x_1 + 3 x_2 - x_3) / 4 and d_1 = (x_0 - 3 x_1 + 3 x_2 - x_3) / 4.
  CHECK(coarse(1, 0) == (-1 + 3 * 2 + 3 * 4 - 8) / 4.0);
  CHECK(detail(1, 0) == (1 - 3 * 2 + 3 * 4 - 8) / 4.0);
  // Indices are modulo the number of control points.
  CHECK(coarse(0, 0) == (-64 + 3 * 128 + 3 * 1 - 2) / 4.0);
}

TEST_CASE("[HBS05] eq. 8 reconstructs with a minus in its second line, and does not as printed", "[papers]") {
  const Points fine = shapes::random_points(16, 8);
  const auto [c, d] = chaikin::analyze(fine);
  const Eigen::Index m = c.rows();
  Points as_printed(2 * m, 2);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Eigen::Index next = (i + 1) % m;
    as_printed.row(2 * i) = 0.75 * (c.row(i) + d.row(i)) + 0.25 * (c.row(next) - d.row(next));
    as_printed.row(2 * i + 1) = 0.25 * (c.row(i) + d.row(i)) + 0.75 * (c.row(next) + d.row(next));
  }
  CHECK(shapes::largest_distance(as_printed, fine) > 1.0);
  CHECK(shapes::largest_distance(chaikin::synthesize(c, d), fine) < 1e-12);
}

TEST_CASE("[HBS05] eq. 9 and 11: the area of the spline is the bilinear form on its control points", "[papers]") {
  // Green's theorem by the midpoint rule on the curve itself, whose error falls with the square of the step.
  const Points control = shapes::random_points(12, 5);
  const Points polyline = to_polyline(shapes::all_implied(control), 0.5);
  CHECK(limit_area(control) == Approx(signed_area(shapes::polygon([&] {
                                 std::vector<Point> corners;
                                 for (Eigen::Index i = 0; i < polyline.rows(); ++i)
                                   corners.emplace_back(polyline.row(i));
                                 return corners;
                               }())))
                                   .epsilon(1e-5));
}
