#include "fontcore/measure.h"

#include <cmath>
#include <numbers>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

TEST_CASE("the area of a polygon is the shoelace sum", "[measure]") {
  CHECK(signed_area(shapes::square(600)) == 360000.0);
  CHECK(signed_area(reverse(shapes::square(600))) == -360000.0);
  CHECK(signed_area(shapes::polygon({{0, 0}, {300, 0}, {0, 400}})) == 60000.0);
}

TEST_CASE("the area under one arch of a quadratic is two thirds of its box, of a cubic's three fifths and a tenth",
          "[measure]") {
  // Against the chord: a quadratic encloses 2/3 of its control triangle; cubic (0,0) (0,1) (1,1) (1,0) encloses 3/5.
  const BezierContour quadratic =
      from_quadratic_points(shapes::points_of({{0, 0}, {2, 0}, {1, 3}}), {true, true, false});
  CHECK(signed_area(quadratic) == Approx(2.0 / 3.0 * 3.0).epsilon(1e-14));
  const BezierContour cubic(shapes::points_of({{1, 0}, {1, 1}, {0, 1}, {0, 0}}),
                            {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node});
  CHECK(signed_area(cubic) == Approx(0.6).epsilon(1e-14));
}

TEST_CASE("area does not depend on where a contour lies", "[measure]") {
  for (const BezierContour& contour : shapes::letter_a()) {
    const BezierContour far =
        transform(contour, {.linear = Eigen::Matrix2d::Identity(), .shift = Point(1 << 20, -(1 << 20))});
    CHECK(signed_area(far) == Approx(signed_area(contour)).epsilon(1e-15));
  }
}

TEST_CASE("the area's gradient is its central difference, exactly, since it is quadratic", "[measure]") {
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::circle(400)}) {
    const Points gradient = area_gradient(contour);
    for (int i = 0; i < contour.point_count(); ++i) {
      for (int axis = 0; axis < 2; ++axis) {
        Points up = contour.points();
        Points down = contour.points();
        up(i, axis) += 16.0;
        down(i, axis) -= 16.0;
        const double difference =
            (signed_area(contour.with_points(up)) - signed_area(contour.with_points(down))) / 32.0;
        CHECK(difference == Approx(gradient(i, axis)).margin(1e-8));
      }
    }
  }
}

TEST_CASE("the Chaikin limit of a square encloses five sixths of it", "[measure]") {
  CHECK(limit_area(shapes::square(600).points()) == Approx(5.0 / 6.0 * 600 * 600).epsilon(1e-12));
}

TEST_CASE("a uniform quadratic B-spline is the TrueType contour of its control points", "[measure]") {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Points control = shapes::random_points(5 + seed, seed);
    CHECK(limit_area(control) == Approx(signed_area(shapes::all_implied(control))).epsilon(1e-12));
  }
}

TEST_CASE("lengths agree with closed forms", "[measure]") {
  CHECK(length(shapes::square(600)) == 2400.0);
  // y = x^2 on [0, 1]: sqrt(5)/2 + asinh(2)/4.
  const Bezier parabola{{Point(0, 0), Point(0.5, 0), Point(1, 1), Point(0, 0)}, 2};
  CHECK(length(parabola) == Approx(std::sqrt(5.0) / 2 + std::asinh(2.0) / 4).epsilon(1e-10));
  // A cubic run out and back along a line passes every point twice: its length is twice the reach.
  const Bezier back{{Point(0, 0), Point(1, 0), Point(1, 0), Point(0, 0)}, 3};
  CHECK(length(back) == Approx(1.5).epsilon(1e-6));
}

TEST_CASE("arc length and its inverse undo each other", "[measure]") {
  for (const Bezier& bezier : {Bezier{{Point(0, 0), Point(500, 0), Point(500, 500), Point(0, 0)}, 2},
                               Bezier{{Point(0, 0), Point(0, 0), Point(300, 500), Point(400, 0)}, 3},
                               Bezier{{Point(0, 0), Point(30, 40), Point(0, 0), Point(0, 0)}, 1}}) {
    const ArcLength arc(bezier);
    CHECK(arc.length() == Approx(length(bezier)).epsilon(1e-10));
    for (int k = 0; k <= 20; ++k) {
      const double s = arc.length() * k / 20;
      CHECK(arc.at(arc.inverse(s)) == Approx(s).margin(1e-9 * arc.length()));
    }
    CHECK(arc.inverse(-1.0) == 0.0);
    CHECK(arc.inverse(2.0 * arc.length()) == 1.0);
  }
}

TEST_CASE("the place of an arc length is as near as promised on any curve", "[measure]") {
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Points control = shapes::random_points(4, seed);
    Bezier bezier{{Point(control.row(0)), Point(control.row(1)), Point(control.row(2)), Point(control.row(3))},
                  seed % 3 == 0 ? 2 : 3};
    if (seed % 5 == 1) bezier.p[1] = bezier.p[0];                                       // stands still at its start
    if (seed % 5 == 2) bezier.p[2] = bezier.p[0] + (bezier.p[1] - bezier.p[3]);         // near a cusp
    if (seed % 5 == 3) bezier.p[1] = bezier.p[0] + 1e-3 * (bezier.p[2] - bezier.p[0]);  // starts slowly
    const double bound = seed % 5 == 2 ? 1e-8 : 1e-10;
    const ArcLength arc(bezier);
    for (int k = 0; k <= 97; ++k) {
      const double s = arc.length() * k / 97;
      INFO("seed " << seed << " k " << k);
      CHECK(std::abs(arc.at(arc.inverse(s)) - s) <= bound * arc.length());
    }
  }
}

TEST_CASE("the box of a curve touches its extrema, the box of its points may be larger", "[measure]") {
  const Box tight = tight_box(shapes::circle(400));
  CHECK((tight.low - Point(-400, -400)).norm() < 1e-9);
  CHECK((tight.high - Point(400, 400)).norm() < 1e-9);
  const BezierContour leaning(shapes::points_of({{0, 0}, {200, 300}, {-100, 300}, {100, 0}}),
                              {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node});
  CHECK(tight_box(leaning).high.y() == Approx(225.0));
  CHECK(control_box(leaning).high.y() == 300.0);
}

TEST_CASE("the turns and bends of a simple contour sum to one whole turn", "[measure]") {
  double sum = 0.0;
  for (const double turn : turning_angles(shapes::polygon({{0, 0}, {500, 20}, {400, 300}, {250, 100}, {30, 400}})))
    sum += turn;
  CHECK(sum == Approx(2.0 * std::numbers::pi).epsilon(1e-14));
  for (const double turn : turning_angles(shapes::circle(300))) CHECK(std::abs(turn) < 1e-14);
}

TEST_CASE("segments of no length are passed over when a turn is measured", "[measure]") {
  const auto turns = turning_angles(shapes::polygon({{0, 0}, {100, 0}, {100, 0}, {100, 100}}));
  CHECK(turns[1] == 0.0);
  CHECK(turns[2] == Approx(std::numbers::pi / 2));
}

TEST_CASE("two squares one inside the other are a corner's diagonal apart", "[measure]") {
  const Points inner = shapes::square(100).points();
  Points outer = shapes::square(120).points();
  outer.array() -= 10.0;
  CHECK(two_sided_distance(inner, outer) == Approx(std::sqrt(200.0)).epsilon(1e-14));
  CHECK(two_sided_distance(inner, inner) == 0.0);
}

TEST_CASE("the two-sided distance agrees with trying every segment", "[measure]") {
  const auto brute = [](const Points& a, const Points& b) {
    double worst = 0.0;
    for (const auto& [from, to] : {std::pair{&a, &b}, std::pair{&b, &a}}) {
      for (Eigen::Index i = 0; i < from->rows(); ++i) {
        double best = std::numeric_limits<double>::infinity();
        for (Eigen::Index j = 0; j < to->rows(); ++j) {
          const Point p = from->row(i);
          const Point q = to->row(j);
          const Point d = to->row((j + 1) % to->rows()).transpose() - q;
          best = std::min(best, (p - q - std::clamp((p - q).dot(d) / d.squaredNorm(), 0.0, 1.0) * d).norm());
        }
        worst = std::max(worst, best);
      }
    }
    return worst;
  };
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Points a = shapes::random_points(7 + 40 * (seed % 3), seed);
    const Points b = shapes::random_points(9, seed + 100, seed % 2 == 0 ? 300.0 : 3000.0);
    CHECK(two_sided_distance(a, b) == Approx(brute(a, b)).epsilon(1e-12));
    CHECK(two_sided_distance(b, a) == Approx(brute(a, b)).epsilon(1e-12));
  }
  CHECK_THROWS_AS(two_sided_distance(Points(0, 2), shapes::random_points(3, 1)), InvalidInput);
}

TEST_CASE("the nearest point of an outline is square to it", "[measure]") {
  const BezierContour circle = shapes::circle(400);
  for (int k = 0; k < 12; ++k) {
    const double angle = 0.1 + k * std::numbers::pi / 6;
    const Point place = 700.0 * Point(std::cos(angle), std::sin(angle));
    const auto [segment, u, distance] = nearest_point(circle, place);
    const Bezier bezier = circle.segment(segment);
    CHECK(distance == Approx(300.0).margin(0.2));
    CHECK(std::abs((evaluate(bezier, u) - place).dot(derivative(bezier, u).normalized())) < 1e-4);
  }
  const NearestPoint foot = nearest_point(shapes::square(600), Point(200, -50));
  CHECK(foot.segment == 0);
  CHECK(foot.u == Approx(1.0 / 3.0));
  CHECK(foot.distance == Approx(50.0));
}

TEST_CASE("the gradient of the length is what moving a point adds to it", "[measure]") {
  const BezierContour contour = shapes::letter_a()[0];
  const Points gradient = length_gradient(contour);
  for (int p = 0; p < contour.point_count(); ++p) {
    for (int axis = 0; axis < 2; ++axis) {
      const auto length_with = [&](double step) {
        Points points = contour.points();
        points(p, axis) += step;
        return length(contour.with_points(points));
      };
      CHECK(gradient(p, axis) == Approx((length_with(0.01) - length_with(-0.01)) / 0.02).margin(1e-5));
    }
  }
}

TEST_CASE("moments of a rectangle and of a disc are those of the textbook", "[measure]") {
  const Moments box = moments(shapes::polygon({{10, 20}, {310, 20}, {310, 120}, {10, 120}}));
  CHECK(box.area == 30000.0);
  CHECK(box.centroid().x() == Approx(160.0).epsilon(1e-14));
  CHECK(box.centroid().y() == Approx(70.0).epsilon(1e-14));
  const Moments about = box.about(box.centroid());
  CHECK(about.second[0] == Approx(100.0 * std::pow(300.0, 3) / 12.0).epsilon(1e-12));
  CHECK(about.second[1] == Approx(0.0).margin(1e-4));
  CHECK(about.second[2] == Approx(300.0 * std::pow(100.0, 3) / 12.0).epsilon(1e-12));
  const double r = 300.0;
  const Moments disc = moments(shapes::circle(r));  // by cubics, within 3e-4 of it
  CHECK(disc.second[0] == Approx(std::numbers::pi / 4.0 * std::pow(r, 4)).epsilon(1e-3));
}

TEST_CASE("moments are those of the same curves as cubics, whichever way they run and wherever they lie", "[measure]") {
  const BezierContour arch = shapes::arch(300);
  Points raised(0, 2);
  std::vector<PointKind> kinds;
  const auto add = [&](const Point& p, PointKind kind) {
    raised.conservativeResize(raised.rows() + 1, 2);
    raised.row(raised.rows() - 1) = p.transpose();
    kinds.push_back(kind);
  };
  for (int s = 0; s < arch.segment_count(); ++s) {
    const Bezier b = arch.segment(s);
    add(b.start(), PointKind::Node);
    if (b.degree == 1) continue;
    add((b.p[0] + 2.0 * b.p[1]) / 3.0, PointKind::Cubic);
    add((b.p[2] + 2.0 * b.p[1]) / 3.0, PointKind::Cubic);
  }
  const Moments quadratic = moments(arch);
  for (const Moments& other : {moments(BezierContour(raised, kinds)), -1.0 * moments(reverse(arch)),
                               moments(transform(arch, {.shift = Point(5000, -7000)})).about(Point(5000, -7000))}) {
    CHECK(other.area == Approx(quadratic.area).epsilon(1e-12));
    CHECK((other.first - quadratic.first).norm() < 1e-9 * quadratic.first.norm());
    CHECK((other.second - quadratic.second).norm() < 1e-8 * quadratic.second.norm());
  }
  CHECK(quadratic.area == Approx(signed_area(arch)).epsilon(1e-14));
}
