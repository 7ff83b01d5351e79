#include "fontcore/solve.h"

#include <Eigen/LU>
#include <random>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

Eigen::SparseMatrix<double> identity(Eigen::Index n) {
  Eigen::SparseMatrix<double> H(n, n);
  H.setIdentity();
  return H;
}

Eigen::VectorXd random_vector(Eigen::Index n, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0.0, 20.0);
  Eigen::VectorXd v(n);
  for (Eigen::Index i = 0; i < n; ++i) v[i] = normal(engine);
  return v;
}

}  // namespace

TEST_CASE("every displacement the solver can make obeys every row", "[solve]") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 engine(seed);
    std::uniform_int_distribution<int> variable(0, 39);
    std::normal_distribution<double> coefficient(0.0, 1.0);
    RowElimination rows(40);
    for (int r = 0; r < 15; ++r) {
      rows.add(Row{
          "row",
          {{variable(engine), coefficient(engine)}, {variable(engine), coefficient(engine)}, {variable(engine), 1.0}},
          3.0});
    }
    const auto [T, c] = rows.space();
    CHECK(T.cols() == 40 - 15 + rows.redundant() + static_cast<int>(rows.conflicts().size()));
    CHECK(rows.residual(T * random_vector(T.cols(), seed) + c) < 1e-9);
  }
}

TEST_CASE("redundant rows vanish and contradictions are named with the rows they contradict", "[solve]") {
  RowElimination rows(4);
  CHECK(rows.add(Row{"a and b move alike", {{0, 1.0}, {1, -1.0}}, 0.0}) == RowElimination::Outcome::Taken);
  CHECK(rows.add(Row{"b and c move alike", {{1, 1.0}, {2, -1.0}}, 0.0}) == RowElimination::Outcome::Taken);
  CHECK(rows.add(Row{"a and c move alike", {{0, 1.0}, {2, -1.0}}, 0.0}) == RowElimination::Outcome::Redundant);
  CHECK(rows.add(Row{"d is frozen", {{3, 1.0}}, 0.0}) == RowElimination::Outcome::Taken);
  CHECK(rows.add(Row{"c moves 12 from a", {{2, 1.0}, {0, -1.0}}, 12.0}) == RowElimination::Outcome::Conflicting);
  REQUIRE(rows.conflicts().size() == 1);
  CHECK(rows.conflicts()[0].rules ==
        std::vector<std::string>{"c moves 12 from a", "a and b move alike", "b and c move alike"});
  CHECK(std::abs(rows.conflicts()[0].disagreement) == Approx(12.0));
}

TEST_CASE("without an area the solution is the least change, as a dense solve finds it", "[solve]") {
  const Eigen::Index n = 12;
  RowElimination rows(static_cast<int>(n));
  rows.add(Row{"sum", {{0, 1.0}, {3, 2.0}, {5, -1.0}}, 4.0});
  rows.add(Row{"tie", {{2, 1.0}, {7, -1.0}}, 0.0});
  Eigen::MatrixXd A = Eigen::MatrixXd::Random(n, n);
  const Eigen::MatrixXd dense = A.transpose() * A + Eigen::MatrixXd::Identity(n, n);
  const Eigen::VectorXd f = random_vector(n, 3);
  Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(n + 2, n + 2);
  kkt.topLeftCorner(n, n) = dense;
  for (const auto& [row, terms] : {std::pair<Eigen::Index, std::vector<Row::Term>>{n, {{0, 1.0}, {3, 2.0}, {5, -1.0}}},
                                   std::pair<Eigen::Index, std::vector<Row::Term>>{n + 1, {{2, 1.0}, {7, -1.0}}}}) {
    for (const auto& [variable, coefficient] : terms) kkt(row, variable) = kkt(variable, row) = coefficient;
  }
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n + 2);
  right.head(n) = f;
  right[n] = 4.0;
  const Eigen::VectorXd expected = kkt.fullPivLu().solve(right).head(n);
  const Eigen::SparseMatrix<double> H = dense.sparseView();
  CHECK((LeastChange(H, rows).solve(f).displacement - expected).norm() < 1e-9);
}

TEST_CASE("the area is met exactly, in one pass or two", "[solve]") {
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::circle(400), shapes::arch(500)}) {
    for (unsigned seed = 0; seed < 10; ++seed) {
      RowElimination rows(static_cast<int>(2 * contour.point_count()));
      rows.add(outline_rows(contour, OutlineRules{}));
      const double area = signed_area(contour) * (seed % 2 == 0 ? 1.0 : 1.03);
      const auto [displacement, report] = LeastChange(identity(2 * contour.point_count()), rows)
                                              .solve(random_vector(2 * contour.point_count(), seed), contour, area);
      CHECK(report.failed.empty());
      CHECK(report.passes <= 2);
      CHECK(std::abs(signed_area(displaced(contour, displacement)) / area - 1.0) < 1e-12);
      CHECK(report.row_residual < 1e-11);
    }
  }
}

TEST_CASE("an area that cannot be met is reported, not forced", "[solve]") {
  const BezierContour contour = shapes::square(600);
  RowElimination frozen(8);
  for (int p = 0; p < 4; ++p) frozen.add(rows(contour, FrozenPoint{p}));
  const auto [displacement, report] =
      LeastChange(identity(8), frozen).solve(Eigen::VectorXd::Zero(8), contour, 400000.0);
  CHECK(report.failed == "the rules leave nothing free to keep the area with");
  CHECK(displacement.norm() == 0.0);
}

TEST_CASE("a smooth join keeps its tangency and the ratio of its handles, whatever the displacement", "[constraint]") {
  const BezierContour contour = shapes::circle(400);
  RowElimination elimination(static_cast<int>(2 * contour.point_count()));
  for (int s = 0; s < contour.segment_count(); ++s) elimination.add(rows(contour, SmoothJoin{s}));
  const auto [T, c] = elimination.space();
  const BezierContour moved = displaced(contour, T * random_vector(T.cols(), 1) + c);
  for (const double turn : turning_angles(moved)) CHECK(std::abs(turn) < 1e-12);
  for (int s = 0; s < moved.segment_count(); ++s) {
    const Point a = moved.point(moved.point_of(moved.previous(s), 2));
    const Point p = moved.point(moved.node(s));
    const Point b = moved.point(moved.point_of(s, 1));
    CHECK((p - a).norm() / (b - p).norm() == Approx(1.0).epsilon(1e-9));
  }
}

TEST_CASE("straight runs, extrema, zones and coincident points hold under any displacement", "[constraint]") {
  const BezierContour contour = shapes::arch(500);
  RowElimination elimination(static_cast<int>(2 * contour.point_count()));
  elimination.add(outline_rows(contour, OutlineRules{.zones = {0.0, 750.0}}));
  CHECK(elimination.conflicts().empty());
  const auto [T, c] = elimination.space();
  const BezierContour moved = displaced(contour, T * random_vector(T.cols(), 2) + c);
  CHECK(moved.points()(0, 1) == 0.0);
  CHECK(moved.points()(1, 1) == 0.0);
  CHECK(moved.points()(1, 0) == Approx(moved.points()(2, 0)).margin(1e-10));  // the right side stays vertical
  CHECK(moved.points()(4, 1) == Approx(750.0).margin(1e-10));                 // the top stays at its zone
  CHECK(moved.points()(3, 1) == Approx(moved.points()(5, 1)).margin(1e-10));  // and an extremum
  const BezierContour doubled = shapes::polygon({{0, 0}, {600, 0}, {600, 0}, {600, 600}});
  RowElimination together(8);
  together.add(outline_rows(doubled, OutlineRules{.lines = false}));
  const auto space = together.space();
  const BezierContour apart = displaced(doubled, space.T * random_vector(space.T.cols(), 5));
  CHECK((apart.point(1) - apart.point(2)).norm() < 1e-12);
}
