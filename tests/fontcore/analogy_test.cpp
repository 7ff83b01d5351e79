#include "fontcore/analogy.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "fontcore/character.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/texture.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr double pi = std::numbers::pi;

/// The shape of a circle run through counter-clockwise from its rightmost point, at even steps.
Points shape_of_circle(double radius, Eigen::Index count) {
  Points shape(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    shape.row(i) << 0.5 * pi + 2 * pi * static_cast<double>(i) / static_cast<double>(count), 1 / radius;
  }
  return shape;
}

/// The shape of a straight stretch.
Points shape_of_line(double direction, Eigen::Index count) {
  Points shape(count, 2);
  shape.col(0).setConstant(direction);
  shape.col(1).setZero();
  return shape;
}

Eigen::VectorXd even_places(double length, Eigen::Index count) {
  return Eigen::VectorXd::LinSpaced(count, 0.0, length);
}

/// A circle with waves on it wherever it runs down, within a right angle.
DetailLibrary waves_where_it_runs_down(double radius, double scale) {
  DetailLibrary library;
  library.scale = scale;
  library.by_shape = true;
  DetailSample sample;
  sample.length = 2 * pi * radius;
  sample.is_closed = true;
  sample.shape = shape_of_circle(radius, 2000);
  sample.offsets = Points::Zero(2000, 2);
  for (Eigen::Index i = 0; i < 2000; ++i) {
    const double x = sample.length * static_cast<double>(i) / 2000;
    if (std::cos(sample.shape(i, 0) + 0.5 * pi) > std::numbers::sqrt2 / 2) {
      sample.offsets(i, 1) = 3 * std::sin(2 * pi * x / (0.3 * scale));
    }
  }
  library.samples = {sample};
  return library;
}

double largest(const Points& offsets) { return offsets.rowwise().norm().maxCoeff(); }

}  // namespace

TEST_CASE("arcs go to the arcs of the moved outline, whatever corners it has besides", "[analogy]") {
  const BezierContour plain = shapes::polygon({{0, 0}, {600, 0}, {600, 500}, {0, 500}});
  // Teeth along all sides, and it starts elsewhere.
  std::vector<Point> teeth;
  for (int x = 20; x < 600; x += 20) teeth.emplace_back(x, x % 40 == 0 ? 0 : -5);
  teeth.emplace_back(601, 2);
  for (int y = 20; y < 500; y += 20) teeth.emplace_back(y % 40 == 0 ? 600 : 606, y);
  teeth.emplace_back(597, 503);
  for (int x = 580; x > 0; x -= 20) teeth.emplace_back(x, x % 40 == 0 ? 500 : 505);
  teeth.emplace_back(-3, 498);
  for (int y = 480; y > 0; y -= 20) teeth.emplace_back(y % 40 == 0 ? 0 : -4, y);
  teeth.emplace_back(1, 1);
  const OutlineArcs from(plain);
  const OutlineArcs to(shapes::polygon(teeth));
  const std::vector<Stretch> stretches = match_arcs(from, to, 100);
  REQUIRE(stretches.size() == 4);
  const std::vector<Point> corners{{1, 1}, {601, 2}, {597, 503}, {-3, 498}};
  double all = 0.0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto at = [&](double s) {
      const auto [segment, u] = to.locate(s);
      return evaluate(to.contour().segment(segment), u);
    };
    const Point start = at(stretches[k].start);
    const Point own = evaluate(from.contour().segment(from.arcs()[k].segments[0]), 0.0);
    const auto expected =
        std::find_if(corners.begin(), corners.end(), [&](const Point& c) { return (c - own).norm() < 9; });
    REQUIRE(expected != corners.end());
    CHECK((start - *expected).norm() < 1e-9);
    CHECK((at(stretches[k].start + stretches[k].length) - at(stretches[(k + 1) % 4].start)).norm() < 1e-9);
    all += stretches[k].length;
  }
  CHECK(all == Approx(to.length()));
}

TEST_CASE("a difference learnt from an outline and itself is nothing, however it is cut and started", "[analogy]") {
  for (const BezierContour& contour : shapes::letter_a()) {
    const OutlineArcs plain(contour);
    for (const DetailSample& sample : learn_difference(plain, plain, 120, DetailFrame::Tangent, InkSide::Right)) {
      CHECK(largest(sample.offsets) < 1e-6);
    }
  }
  const BezierContour circle = shapes::circle(300);
  Points turned(circle.point_count(), 2);
  for (Eigen::Index i = 0; i < turned.rows(); ++i) turned.row(i) = circle.points().row((i + 6) % turned.rows());
  const OutlineArcs other(circle.with_points(turned));
  const auto samples = learn_difference(OutlineArcs(circle), other, 100, DetailFrame::Tangent, InkSide::Left);
  REQUIRE(samples.size() == 1);
  CHECK(largest(samples[0].offsets) < 0.02);
}

TEST_CASE("an outline that runs like the plain source gets exactly its detail back", "[analogy]") {
  const DetailLibrary noise = texture::make_library(texture::Noise{});
  const double em = 2048;
  for (const BezierContour& contour : shapes::letter_a()) {
    const OutlineArcs plain(contour);
    const CharacterOptions lay{.adds = true, .unit = em / 1000, .ink = InkSide::Right};
    const OutlineArcs textured = arcs_at_scale(apply_detail(plain, noise, lay).contour, noise.scale * em / 1000);
    DetailLibrary learnt;
    learnt.units_per_em = em;
    learnt.scale = noise.scale * em / 1000;
    learnt.by_shape = true;
    learnt.samples = learn_difference(plain, textured, learnt.scale, learnt.frame, InkSide::Right);
    REQUIRE_FALSE(learnt.samples.empty());
    for (const DetailSample& sample : learnt.samples) {
      CHECK(largest(sample.offsets) > 1e-3 * em);
      const DetailBed bed{sample.length, sample.is_closed, {}, sample.shape};
      const Eigen::VectorXd places = even_places(sample.length, 500);
      const Points laid = lay_by_shape(learnt, bed, places);
      double off = 0.0;
      for (Eigen::Index i = 0; i < 500; ++i) {
        off = std::max(off, (laid.row(i) - value_at(sample, false, places[i])).norm());
      }
      CHECK(off <= 0.05e-3 * em);
    }
  }
}

TEST_CASE("a plain outline and what was learnt of it make the textured one again", "[analogy]") {
  const DetailLibrary noise = texture::make_library(texture::Noise{});
  for (const double radius : {150.0, 300.0, 800.0}) {
    const OutlineArcs plain(shapes::circle(radius));
    const OutlineArcs textured(apply_detail(plain, noise, {.adds = true}).contour);
    DetailLibrary learnt;
    learnt.scale = noise.scale;
    learnt.by_shape = true;
    learnt.samples = learn_difference(plain, textured, learnt.scale, learnt.frame, InkSide::Left);
    const BezierContour again = apply_detail(plain, learnt, {.adds = true}).contour;
    CHECK(farthest(again, plain.contour(), 0.01).distance > 3);
    CHECK(farthest(again, textured.contour(), 0.01).distance <= 0.05);
  }
}

TEST_CASE("so do corners and the arcs between them, at the place it was learnt", "[analogy]") {
  const DetailLibrary noise = texture::make_library(texture::Noise{});
  const double em = 2048;
  const double scale = noise.scale * em / 1000;
  for (const BezierContour& contour : shapes::letter_a()) {
    const OutlineArcs plain(contour);
    const BezierContour textured =
        apply_detail(plain, noise, {.adds = true, .unit = em / 1000, .ink = InkSide::Right}).contour;
    DetailLibrary learnt;
    learnt.units_per_em = em;
    learnt.scale = scale;
    learnt.by_shape = true;
    learnt.samples = learn_difference(plain, arcs_at_scale(textured, scale), scale, learnt.frame, InkSide::Right, "a");
    const Character again = apply_detail(plain, learnt, {.adds = true, .ink = InkSide::Right, .place = "a"});
    CHECK(farthest(again.contour, textured, 0.01).distance <= 0.05e-3 * em);
    CHECK(again.base_move < 1e-9);
  }
}

TEST_CASE("what only stretches that run down have, only stretches that run down get", "[analogy]") {
  const double scale = 80;
  const DetailLibrary library = waves_where_it_runs_down(300, scale);
  for (const double radius : {200.0, 300.0, 450.0}) {
    const Eigen::Index count = 1500;
    const DetailBed bed{2 * pi * radius, true, {}, shape_of_circle(radius, count)};
    const Points laid = lay_by_shape(library, bed, even_places(bed.length, count + 1));
    double where_down = 0.0;
    double elsewhere = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) {
      const double down = std::cos(bed.shape(i, 0) + 0.5 * pi);
      const double size = laid.row(i).norm();
      if (down > std::cos(0.2 * pi)) where_down = std::max(where_down, size);
      if (down < std::cos(0.36 * pi)) elsewhere = std::max(elsewhere, size);
    }
    CHECK(where_down > 2.7);
    CHECK(elsewhere < 1e-9);
    CHECK((laid.row(0) - laid.row(count)).norm() < 1e-9);
  }
  const auto of_line = [&](double direction) {
    return largest(lay_by_shape(library, {400, false, {}, shape_of_line(direction, 100)}, even_places(400, 300)));
  };
  CHECK(of_line(-0.5 * pi) > 2.7);
  CHECK(of_line(1.5 * pi) > 2.7);
  for (const double other : {0.0, 0.5 * pi, pi, -pi, 0.25 * pi}) CHECK(of_line(other) < 1e-9);
}

TEST_CASE("runs go over into each other without a step", "[analogy]") {
  const DetailLibrary library = waves_where_it_runs_down(300, 80);
  const Points laid = lay_by_shape(library, {3000, false, {}, shape_of_line(-0.5 * pi, 500)}, even_places(3000, 30001));
  double step = 0.0;
  for (Eigen::Index i = 1; i < laid.rows(); ++i) step = std::max(step, (laid.row(i) - laid.row(i - 1)).norm());
  // 3 * 2 pi / 24 a unit at a tenth of a unit, and what the fades of 40 units and the sample's own cut add.
  CHECK(step < 0.25);
  CHECK(laid == lay_by_shape(library, {3000, false, {}, shape_of_line(-0.5 * pi, 500)}, even_places(3000, 30001)));
}

TEST_CASE("a texture is learnt from an outline of another structure and of another font", "[analogy]") {
  // The textured circle is larger and rounder than the plain one: that is no detail.
  const double scale = 100;
  const Eigen::Index count = 2880;
  std::vector<Point> points;
  for (Eigen::Index i = 0; i < count; ++i) {
    const double angle = 2 * pi * static_cast<double>(i) / static_cast<double>(count);
    const double radius = 306 + 2 * std::sin(60 * angle);
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  OutlineCurveOptions no_corners;
  no_corners.corner_angle = no_corners.line_angle = pi;
  const OutlineArcs textured(shapes::polygon(points), no_corners);
  const auto samples =
      learn_difference(OutlineArcs(shapes::circle(300)), textured, scale, DetailFrame::Tangent, InkSide::Left);
  REQUIRE(samples.size() == 1);
  CHECK(samples[0].length == Approx(2 * pi * 300).epsilon(1e-3));
  const Eigen::VectorXd away = samples[0].offsets.col(1);
  CHECK(away.norm() / std::sqrt(static_cast<double>(away.size())) == Approx(std::numbers::sqrt2).epsilon(0.03));
  CHECK(std::abs(away.mean()) < 0.02);
}

TEST_CASE("what cannot be matched or laid is refused", "[analogy]") {
  const OutlineArcs square(shapes::square(300));
  CHECK_THROWS_AS(match_arcs(square, OutlineArcs(reverse(shapes::square(300))), 50), InvalidInput);
  CHECK_THROWS_AS(match_arcs(square, square, 0.0), InvalidInput);
  DetailLibrary library = waves_where_it_runs_down(300, 80);
  CHECK_THROWS_AS(lay_by_shape(library, {400, false, {}, {}}, even_places(400, 9)), InvalidInput);
  CHECK_THROWS_AS(lay_by_shape(library, {0, false, {}, shape_of_line(0, 9)}, even_places(0, 9)), InvalidInput);
  library.samples[0].shape.resize(0, 2);
  CHECK_THROWS_AS(lay_by_shape(library, {400, false, {}, shape_of_line(0, 9)}, even_places(400, 9)), InvalidInput);
  library.samples.clear();
  CHECK_THROWS_AS(lay_by_shape(library, {400, false, {}, shape_of_line(0, 9)}, even_places(400, 9)), InvalidInput);
}
