#include "fontcore/tensor.h"

#include <cmath>

#include "fontcore/error.h"
#include "tests/catch.h"

using namespace fontcore;

namespace {

// 24 control points round a contour by 11 masters along an axis, three coordinates.
Grid wavy_grid() {
  Grid grid(3, Eigen::MatrixXd(24, 11));
  for (int i = 0; i < 24; ++i) {
    for (int j = 0; j < 11; ++j) {
      grid[0](i, j) = 300.0 * std::cos(0.26 * i) + 7.0 * j;
      grid[1](i, j) = 400.0 * std::sin(0.26 * i) * (1.0 + 0.01 * j);
      grid[2](i, j) = 10.0 * std::sin(i * 1.7) * std::cos(j * 2.3);
    }
  }
  return grid;
}

MultiresPatch wavy_patch() { return decompose(Scheme::Orthogonal, Scheme::EndpointCubic, wavy_grid(), 2, 3); }

double largest_difference(const Grid& a, const Grid& b) {
  double largest = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) largest = std::max(largest, (a[k] - b[k]).cwiseAbs().maxCoeff());
  return largest;
}

}  // namespace

TEST_CASE("a surface comes back from its levels, whichever schemes it has", "[tensor]") {
  for (const Scheme u : {Scheme::Chaikin, Scheme::Orthogonal}) {
    for (const Scheme v : {Scheme::EndpointCubic, Scheme::HeldCubic}) {
      CHECK(largest_difference(reconstruct(decompose(u, v, wavy_grid(), 2, 3)), wavy_grid()) < 1e-9);
    }
  }
}

TEST_CASE("the order of the two directions makes no difference", "[tensor]") {
  Grid turned;
  for (const Eigen::MatrixXd& coordinate : wavy_grid()) turned.emplace_back(coordinate.transpose());
  const MultiresPatch other = decompose(Scheme::EndpointCubic, Scheme::Orthogonal, turned, 3, 2);
  const MultiresPatch patch = wavy_patch();
  for (std::size_t k = 0; k < turned.size(); ++k) {
    CHECK((other.coefficients[k].transpose() - patch.coefficients[k]).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("a product of two curves has the product of their levels", "[tensor]") {
  const Eigen::MatrixXd all = wavy_grid()[0];
  const Eigen::VectorXd a = all.col(0);
  const Eigen::VectorXd b = all.row(3).transpose();
  const MultiresPatch patch = decompose(Scheme::Orthogonal, Scheme::EndpointCubic, {a * b.transpose()}, 2, 3);
  const MultiresCurve curve_a = decompose(Scheme::Orthogonal, a, 2);
  const MultiresCurve curve_b = decompose(Scheme::EndpointCubic, b, 3);
  for (const double level_u : {0.0, 0.6, 2.0}) {
    for (const double level_v : {0.0, 1.3, 2.9}) {
      const Eigen::MatrixXd expected = fractional(curve_a, level_u) * fractional(curve_b, level_v).transpose();
      const Grid got = fractional(patch, level_u, level_v);
      REQUIRE(got[0].rows() == expected.rows());
      CHECK((got[0] - expected).cwiseAbs().maxCoeff() < 1e-8);
    }
  }
}

TEST_CASE("a dragged point of a surface goes where it is asked, broadly one way and narrowly the other", "[tensor]") {
  const MultiresPatch patch = wavy_patch();
  const Eigen::RowVector3d move(30.0, -10.0, 4.0);
  const double u = 9.2;
  const double v = 3.7;
  const auto moved = [&](double level_u, double level_v) {
    Grid change = reconstruct(drag(patch, u, v, move, level_u, level_v));
    for (std::size_t k = 0; k < change.size(); ++k) change[k] -= wavy_grid()[k];
    CHECK((evaluate(patch.scheme_u, patch.scheme_v, change, u, v) - move).norm() < 1e-9);
    return change;
  };
  for (const double level_u : {0.0, 0.7, 2.0}) {
    for (const double level_v : {0.0, 1.4, 3.0}) moved(level_u, level_v);
  }
  // Narrow round the contour, the same in all masters; and one master alone, all round.
  const auto spread = [](const Eigen::MatrixXd& change, bool along_v) {
    const Eigen::VectorXd size = along_v ? Eigen::VectorXd(change.cwiseAbs().colwise().maxCoeff().transpose())
                                         : Eigen::VectorXd(change.cwiseAbs().rowwise().maxCoeff());
    return (size.array() > 0.2 * size.maxCoeff()).count();
  };
  const Eigen::MatrixXd feature = moved(2.0, 0.0)[0];
  CHECK(spread(feature, true) >= 8);
  CHECK(spread(feature, false) <= 5);
  const Eigen::MatrixXd master = moved(0.0, 3.0)[0];
  CHECK(spread(master, true) <= 5);
  CHECK(spread(master, false) >= 8);
}

TEST_CASE("grids that do not fit are refused", "[tensor]") {
  CHECK(message_of<InvalidInput>([] { decompose(Scheme::Chaikin, Scheme::Chaikin, Grid(), 0, 0); }) ==
        "decompose: a grid without coordinates");
  CHECK(message_of<InvalidInput>([] {
          decompose(Scheme::Chaikin, Scheme::Chaikin, {Eigen::MatrixXd::Zero(8, 8), Eigen::MatrixXd::Zero(8, 4)}, 0, 0);
        }) == "decompose: coordinates of 8×8 and 8×4 control points");
  Grid grid = wavy_grid();
  grid[1](3, 4) = std::nan("");
  CHECK_THROWS_AS(decompose(Scheme::Chaikin, Scheme::EndpointCubic, grid, 1, 1), InvalidInput);
  CHECK_THROWS_AS(decompose(Scheme::Chaikin, Scheme::EndpointCubic, wavy_grid(), 9, 1), InvalidInput);
  CHECK_THROWS_AS(fractional(wavy_patch(), 2.5, 0.0), InvalidInput);
  CHECK_THROWS_AS(drag(wavy_patch(), 1.0, 1.0, Eigen::RowVector2d(1.0, 1.0), 1.0, 1.0), InvalidInput);
}
