#include "fontcore/curvature.h"

#include <cmath>
#include <numbers>

#include "fontcore/degree.h"
#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

/// y = x^2 / (2 f) from -a to a.
Bezier parabola(double f, double a) {
  const double height = a * a / (2.0 * f);
  return {{Point(-a, height), Point(0.0, -height), Point(a, height), Point::Zero()}, 2};
}

/// The curvature's integral over all combs, a trapezoid between neighbours.
double turn_of(const std::vector<std::vector<CombTooth>>& combs) {
  double turn = 0.0;
  for (const auto& comb : combs)
    for (std::size_t i = 1; i < comb.size(); ++i)
      turn += 0.5 * (comb[i - 1].curvature + comb[i].curvature) * (comb[i].foot - comb[i - 1].foot).norm();
  return turn;
}

}  // namespace

TEST_CASE("a parabola's curvature is the one in closed form, as a quadratic and raised to a cubic", "[curvature]") {
  constexpr double f = 300.0;
  constexpr double a = 450.0;
  const Bezier quadratic = parabola(f, a);
  const auto& p = quadratic.p;
  const Bezier cubic{{p[0], (p[0] + 2.0 * p[1]) / 3.0, (2.0 * p[1] + p[2]) / 3.0, p[2]}, 3};
  for (double u = 0.0; u <= 1.0; u += 0.125) {
    const double x = a * (2.0 * u - 1.0);
    const double exact = 1.0 / f / std::pow(1.0 + x * x / (f * f), 1.5);
    CHECK(curvature(quadratic, u) == Approx(exact).epsilon(1e-12));
    CHECK(curvature(cubic, u) == Approx(exact).epsilon(1e-12));
  }
  CHECK(curvature({{Point(0, 0), Point(9, 5), Point::Zero(), Point::Zero()}, 1}, 0.5) == 0.0);
}

TEST_CASE("curvature is finite at a node whose handle lies on it", "[curvature]") {
  const Bezier b{{Point(0, 0), Point(0, 0), Point(100, 50), Point(100, 200)}, 3};
  CHECK(std::isfinite(curvature(b, 0.0)));
  CHECK(curvature({{Point(3, 3), Point(3, 3), Point(3, 3), Point(3, 3)}, 3}, 0.5) == 0.0);
}

TEST_CASE("a comb turns over with the direction and shrinks as the outline grows", "[curvature]") {
  const BezierContour circle = shapes::circle(500);
  const auto comb = curvature_comb(OutlineArcs(circle), 20.0)[0];
  Affine twice;
  twice.linear *= 2.0;
  const auto grown = curvature_comb(OutlineArcs(transform(circle, twice)), 40.0)[0];
  const auto back = curvature_comb(OutlineArcs(reverse(circle)), 20.0)[0];
  REQUIRE(grown.size() == comb.size());
  for (std::size_t i = 0; i < comb.size(); ++i) {
    CHECK(comb[i].curvature == Approx(1.0 / 500.0).epsilon(0.022));  // four cubics are no better
    CHECK(grown[i].curvature == Approx(0.5 * comb[i].curvature).epsilon(1e-9));
    CHECK(comb[i].normal.dot(comb[i].foot) < 0.0);  // to the left: inwards
  }
  for (const CombTooth& tooth : back) {
    CHECK(tooth.curvature < 0.0);
    CHECK(tooth.normal.dot(tooth.foot) > 0.0);
  }
}

TEST_CASE("without corners a comb is one and ends where it begins", "[curvature]") {
  const auto combs = curvature_comb(OutlineArcs(shapes::circle(500)), 20.0);
  REQUIRE(combs.size() == 1);
  CHECK(combs[0].front().foot == combs[0].back().foot);
  CHECK(combs[0].front().curvature == combs[0].back().curvature);
}

TEST_CASE("corners break a comb, and a smooth join has the curvature of both sides on one foot", "[curvature]") {
  const OutlineArcs outline(shapes::arch(600));
  const auto combs = curvature_comb(outline, 15.0);
  CHECK(combs.size() == outline.arcs().size());
  int joins = 0;
  for (const auto& comb : combs)
    for (std::size_t i = 1; i < comb.size(); ++i) {
      CHECK((comb[i].foot - comb[i - 1].foot).norm() <= 15.0 + 1e-9);
      if (comb[i].foot != comb[i - 1].foot) continue;
      ++joins;
      CHECK((comb[i].normal - comb[i - 1].normal).norm() < 1e-9);
    }
  CHECK(joins == 3);  // line to curve, at the top, curve to line
  for (const auto& comb : curvature_comb(OutlineArcs(shapes::square(600)), 15.0))
    for (const CombTooth& tooth : comb) CHECK(tooth.curvature == 0.0);
  CHECK_THROWS_AS(curvature_comb(outline, 0.0), InvalidInput);
}

TEST_CASE("the teeth of a comb sum up to what the outline turns", "[curvature]") {
  const double full = 2.0 * std::numbers::pi;
  CHECK(turn_of(curvature_comb(OutlineArcs(shapes::circle(500)), 2.0)) == Approx(full).epsilon(1e-4));
  for (const BezierContour& contour : shapes::letter_a()) {
    const OutlineArcs outline(contour);
    double corners = 0.0;
    const std::vector<double> turns = turning_angles(contour);
    for (const double turn : turns) corners += turn;  // smooth joins too: they are so to a degree or so
    const double turned = turn_of(curvature_comb(outline, 1.0)) + corners;
    CHECK(std::abs(turned) == Approx(full).epsilon(2e-3));
  }
}
