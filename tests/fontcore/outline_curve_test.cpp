#include "fontcore/outline_curve.h"

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

std::vector<BezierContour> specimens() {
  std::vector<BezierContour> all = shapes::letter_a();
  all.push_back(shapes::square(600));
  all.push_back(shapes::circle(400));
  all.push_back(shapes::arch(500));
  all.push_back(shapes::all_implied(shapes::points_of({{0, 0}, {700, -100}, {800, 500}, {300, 900}, {-200, 500}})));
  return all;
}

constexpr double em = 2048.0;
constexpr OutlineCurveOptions usual{.tolerance = 0.25e-3 * em};

}  // namespace

TEST_CASE("outline and spline lie within the tolerance of each other, however fine it is", "[outline_curve]") {
  for (const BezierContour& contour : specimens()) {
    int before = 0;
    for (const double tolerance : {4.0, 1.0, 0.25, 0.06}) {
      const OutlineCurve curve(contour, {.tolerance = tolerance});
      CHECK(curve.distance() <= tolerance);
      CHECK(curve.size() >= before);
      before = curve.size();
      // Measured again, by more samples than the model looked at.
      const int per_piece = 64;
      Points spline(curve.size() * per_piece, 2);
      for (Eigen::Index k = 0; k < spline.rows(); ++k)
        spline.row(k) = curve.spline_at(static_cast<double>(k) / per_piece - 0.5);
      CHECK(two_sided_distance(to_polyline(contour, 0.5), spline) <= 1.05 * tolerance);
    }
  }
}

TEST_CASE("the number of control points is D * 2^n, D from 4 to 7, at least 64", "[outline_curve]") {
  for (const BezierContour& contour : specimens()) {
    const OutlineCurve curve(contour, usual);
    CHECK(curve.size() >= 64);
    const int coarsest = curve.size() >> curve.levels();
    CHECK(coarsest << curve.levels() == curve.size());
    CHECK(coarsest >= 4);
    CHECK(coarsest <= 7);
  }
}

TEST_CASE("every node of a font lies on a knot, and every corner is a pair of equal control points",
          "[outline_curve]") {
  for (const BezierContour& contour : specimens()) {
    const OutlineCurve curve(contour, usual);
    int corners = 0;
    for (int s = 0; s < contour.segment_count(); ++s) {
      const OutlineCurve::Node& node = curve.nodes()[static_cast<std::size_t>(s)];
      const bool implied = contour.kind(contour.node(s)) == PointKind::ImpliedNode;
      if (!implied) CHECK(node.is_knot);
      if (node.is_knot) CHECK(node.t + 0.5 == std::round(node.t + 0.5));
      if (!node.is_corner) continue;
      ++corners;
      const int i = (static_cast<int>(node.t - 0.5) + curve.size()) % curve.size();
      const int next = (i + 1) % curve.size();
      CHECK(curve.control_points().row(i) == curve.control_points().row(next));
      CHECK(curve.spline_at(node.t) == contour.point(contour.node(s)));
    }
    CHECK(corners == static_cast<int>(curve.corner_pairs().size()));
  }
}

TEST_CASE("control points of a straight run lie on its line, and the one beyond a smooth end too", "[outline_curve]") {
  const BezierContour contour = shapes::arch(500);
  const OutlineCurve curve(contour, usual);
  const Points& x = curve.control_points();
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (contour.degree(s) != 1) continue;
    const Bezier line = contour.segment(s);
    const Point normal(-(line.p[1] - line.p[0]).y(), (line.p[1] - line.p[0]).x());
    const auto first = static_cast<int>(std::ceil(curve.parameter(s, 0.0) + 0.5)) - 1;
    const auto last = static_cast<int>(std::floor(curve.parameter(s, 1.0) + 0.5)) % curve.size();
    for (int i = (first + curve.size()) % curve.size();; i = (i + 1) % curve.size()) {
      CHECK(std::abs((Point(x.row(i)) - line.p[0]).dot(normal.normalized())) < 1e-9);
      if (i == last) break;
    }
  }
}

TEST_CASE("parameter and place on the outline are each other's inverse", "[outline_curve]") {
  for (const BezierContour& contour : specimens()) {
    const OutlineCurve curve(contour, usual);
    for (int s = 0; s < contour.segment_count(); ++s) {
      for (const double u : {0.001, 0.2, 0.5, 0.97}) {
        const double t = curve.parameter(s, u);
        CHECK(t >= -0.5);
        CHECK(t < curve.size() - 0.5);
        CHECK((curve.outline_at(t) - evaluate(contour.segment(s), u)).norm() < 1e-6);
      }
    }
    CHECK(curve.arc_length(-0.5, curve.size() - 0.5) == Approx(length(contour)).epsilon(1e-12));
    CHECK(curve.arc_length(3.0, 9.0) + curve.arc_length(9.0, 3.0 + curve.size()) ==
          Approx(length(contour)).epsilon(1e-12));
  }
}

TEST_CASE("outline and spline run the same way: equal parameters are near each other", "[outline_curve]") {
  // The residual that an edit carries along; a few tolerances where the two slip along the tangent.
  for (const BezierContour& contour : specimens()) {
    const OutlineCurve curve(contour, usual);
    for (double t = -0.5; t < curve.size() - 0.5; t += 0.13) {
      CHECK((curve.outline_at(t) - curve.spline_at(t)).norm() < 8.0 * usual.tolerance);
    }
  }
}

TEST_CASE("an affine map of all control points gives that map of the outline", "[outline_curve]") {
  // DESIGN decision 1: to 1e-9 units plus the map's strength times the residual.
  Affine map;
  map.linear << 1.05, 0.1, -0.03, 0.96;
  map.shift << 12, -5;
  const double strength = (map.linear - Eigen::Matrix2d::Identity()).norm();
  for (const BezierContour& contour : specimens()) {
    const OutlineCurve curve(contour, usual);
    const Points moved = (curve.control_points() * map.linear.transpose()).rowwise() + map.shift.transpose();
    const Points field = moved - curve.control_points();
    for (double t = -0.5; t < curve.size() - 0.5; t += 0.29) {
      const Point outline = curve.outline_at(t);
      const Point edited = outline + evaluate(Scheme::Chaikin, field, t).transpose();
      const double residual = (outline - curve.spline_at(t)).norm();
      CHECK((edited - map(outline)).norm() <= 1e-9 + strength * residual);
    }
  }
}

TEST_CASE("a polygon's model is the polygon", "[outline_curve]") {
  const OutlineCurve curve(shapes::square(600), usual);
  CHECK(curve.distance() < 1e-9);
  CHECK(curve.corner_pairs().size() == 4);
  CHECK(limit_area(curve.control_points()) == Approx(360000.0).epsilon(1e-13));
}

TEST_CASE("duplicate points and segments of no length do not disturb the model", "[outline_curve]") {
  const OutlineCurve plain(shapes::square(600), usual);
  const OutlineCurve doubled(shapes::polygon({{0, 0}, {0, 0}, {600, 0}, {600, 600}, {600, 600}, {0, 600}}), usual);
  CHECK(doubled.size() == plain.size());
  CHECK(shapes::largest_distance(doubled.control_points(), plain.control_points()) < 1e-9);
  CHECK(doubled.nodes()[0].t == doubled.nodes()[1].t);
}

TEST_CASE("a contour without an inside has no model, and says why", "[outline_curve]") {
  CHECK_THROWS_WITH(OutlineCurve(shapes::polygon({{0, 0}, {100, 0}}), usual),
                    "OutlineCurve: a contour of 2 points has no inside");
  CHECK_THROWS_WITH(OutlineCurve(shapes::polygon({{0, 0}, {100, 0}, {50, 0}}), usual),
                    "OutlineCurve: a contour of length 200 has no area");
  CHECK_THROWS_AS(OutlineCurve(shapes::circle(400), {.tolerance = 1e-9, .most = 128}), InvalidInput);
}
