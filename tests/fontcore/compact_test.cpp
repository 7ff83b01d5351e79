#include "fontcore/compact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/kept_segments.h"
#include "tests/shapes.h"
#include "tests/textured.h"

using namespace fontcore;

namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// Every segment cut into `parts` of the same kind.
BezierContour finely_cut(const BezierContour& contour, int parts) {
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  for (int s = 0; s < contour.segment_count(); ++s) {
    Bezier rest = contour.segment(s);
    for (int i = 0; i < parts; ++i) {
      const auto halves = split(rest, 1.0 / (parts - i));
      const Bezier part = i + 1 < parts ? halves[0] : rest;
      rest = halves[1];
      points.push_back(part.start());
      kinds.push_back(PointKind::Node);
      for (int k = 1; k < part.degree; ++k) {
        points.push_back(part.p[static_cast<std::size_t>(k)]);
        kinds.push_back(part.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
      }
    }
  }
  return {shapes::points_of(points), std::move(kinds)};
}

double largest_smooth_turn(const BezierContour& contour) {
  double largest = 0.0;
  for (const double turn : turning_angles(contour)) {
    if (std::abs(turn) < 8.0 * degree) largest = std::max(largest, std::abs(turn));
  }
  return largest;
}

int corner_count(const BezierContour& contour) {
  int count = 0;
  for (const double turn : turning_angles(contour)) count += std::abs(turn) > 10.0 * degree ? 1 : 0;
  return count;
}

std::vector<CompactOptions> all_options(double tolerance) {
  std::vector<CompactOptions> all;
  for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
    for (const CurveKind curve : {CurveKind::Cubic, CurveKind::Quadratic}) {
      for (const Coordinates coordinates : {Coordinates::Whole, Coordinates::Any}) {
        CompactOptions options;
        options.tolerance = tolerance;
        options.units_per_em = 2048;
        options.extrema = extrema;
        options.curve = curve;
        options.coordinates = coordinates;
        all.push_back(options);
      }
    }
  }
  return all;
}

/// Contours of 250 to 5000 units to lay texture on, corners on whole numbers, 1000 units per em.
std::vector<BezierContour> bases() {
  std::vector<BezierContour> all{shapes::circle(40), shapes::circle(250), shapes::arch(500)};
  const Affine to_thousand{0.5 * Eigen::Matrix2d::Identity(), Point::Zero()};
  for (const BezierContour& contour : shapes::letter_a()) {
    const BezierContour half = transform(contour, to_thousand);
    all.push_back(half.with_points(half.points().array().round()));
  }
  all.push_back(shapes::polygon({{60, 0},
                                 {150, 0},
                                 {150, 560},
                                 {380, 0},
                                 {470, 0},
                                 {700, 560},
                                 {700, 0},
                                 {790, 0},
                                 {790, 700},
                                 {650, 700},
                                 {425, 140},
                                 {200, 700},
                                 {60, 700}}));
  return all;
}

/// Coordinates in 1/64 units.
BezierContour on_fractions(const BezierContour& contour) {
  return contour.with_points((64.0 * contour.points()).array().round() / 64.0);
}

}  // namespace

TEST_CASE("a circle cut into hundreds of pieces comes back as four cubics", "[compact]") {
  for (const int parts : {2, 10, 90}) {
    const BezierContour fine = finely_cut(shapes::circle(400), parts);
    const CompactFit fit = fit_compact(fine, {.tolerance = 0.5, .extrema = Extrema::Keep});
    CHECK(fit.contour.segment_count() == 4);
    CHECK_FALSE(fit.kept);
    CHECK(fit.deviation <= 0.5);
    for (int i = 0; i < fit.contour.point_count(); ++i) {
      const Point p = fit.contour.point(i);
      CHECK(p == Point(p.array().round()));
    }
  }
}

TEST_CASE("no point of a compact outline is farther off than the tolerance, nor one of the source", "[compact]") {
  std::vector<BezierContour> sources = shapes::letter_a();
  sources.push_back(finely_cut(sources[0], 7));
  sources.push_back(shapes::arch(600));
  for (const double tolerance : {0.8, 1.5, 3.0, 6.0}) {
    for (const CompactOptions& options : all_options(tolerance)) {
      for (const BezierContour& source : sources) {
        const CompactFit fit = fit_compact(source, options);
        const double measured = two_sided_distance(to_polyline(source, 0.5), to_polyline(fit.contour, 0.5));
        CHECK(measured <= tolerance + 0.01);
        CHECK(fit.deviation == Approx(measured).margin(0.05));
        CHECK(fit.contour.segment_count() <= source.segment_count());
        if (!fit.kept) CHECK(largest_smooth_turn(fit.contour) <= 1.5 * degree);
        CHECK(corner_count(fit.contour) == corner_count(source));
        CHECK(signed_area(fit.contour) * signed_area(source) > 0.0);
      }
    }
  }
}

TEST_CASE("moving or mirroring an outline moves or mirrors its compact form, bit for bit", "[compact]") {
  for (const CompactOptions& options : all_options(2.0)) {
    if (options.coordinates == Coordinates::Any) continue;  // sums of any numbers round
    for (const BezierContour& source : shapes::letter_a()) {
      const BezierContour own = fit_compact(source, options).contour;
      for (const Point& scale : {Point(1, 1), Point(-1, 1), Point(1, -1)}) {
        const Affine map{scale.asDiagonal(), Point(137, -2011)};
        CHECK(fit_compact(transform(source, map), options).contour == transform(own, map));
      }
    }
  }
}

TEST_CASE("quadratics between extrema whose tangents are parallel meet halfway, at an implied node", "[compact]") {
  // Edges that rise and sink by a few units, as of a pen: between two level tangents one quadratic has a corner.
  constexpr PointKind node = PointKind::Node;
  constexpr PointKind handle = PointKind::Cubic;
  const BezierContour wave(shapes::points_of({{0, 0},
                                              {30, 0},
                                              {50, -6},
                                              {80, -6},
                                              {120, -6},
                                              {150, 5},
                                              {200, 5},
                                              {230, 5},
                                              {250, 0},
                                              {280, 0},
                                              {280, 400},
                                              {0, 400}}),
                           {node, handle, handle, node, handle, handle, node, handle, handle, node, node, node});
  const CompactFit fit = fit_compact(wave, {.tolerance = 1.0, .curve = CurveKind::Quadratic});
  CHECK(fit.why.empty());
  CHECK(fit.deviation <= 1.0);
  CHECK(largest_smooth_turn(fit.contour) <= 1.5 * degree);
  CHECK(fit.contour.segment_count() <= 3 + 6);
}

TEST_CASE("cubics that nothing is left to search quadratics for are cut into them one by one", "[compact]") {
  for (const Coordinates coordinates : {Coordinates::Whole, Coordinates::Any}) {
    const CompactFit fit =
        fit_compact(shapes::circle(250),
                    {.tolerance = 1.5, .curve = CurveKind::Quadratic, .coordinates = coordinates, .most_work = 0});
    CHECK_FALSE(fit.why.empty());
    CHECK(fit.deviation <= 1.5);
    CHECK(std::ranges::count(fit.contour.kinds(), PointKind::Cubic) == 0);
    CHECK((fit.contour.point(0) - shapes::circle(250).point(0)).norm() == 0.0);
  }
}

TEST_CASE("at tolerance 0 an outline stays as it is", "[compact]") {
  for (const BezierContour& source : shapes::letter_a()) {
    const CompactFit fit = fit_compact(source, {.tolerance = 0.0});
    CHECK(fit.contour == source);
    CHECK(fit.kept);
  }
}

TEST_CASE("a polygon has nothing to be made shorter", "[compact]") {
  const CompactFit fit = fit_compact(shapes::square(600), {.tolerance = 5.0});
  CHECK(fit.kept);
  CHECK(fit.contour == shapes::square(600));
}

TEST_CASE("a straight run cut into pieces is one line again", "[compact]") {
  const CompactFit fit = fit_compact(finely_cut(shapes::arch(600), 8), {.tolerance = 1.0});
  int lines = 0;
  for (int s = 0; s < fit.contour.segment_count(); ++s) lines += fit.contour.degree(s) == 1 ? 1 : 0;
  CHECK(lines == 3);
  CHECK(fit.contour.segment_count() == 5);
}

TEST_CASE("kept segments come out bit for bit, and what is fitted beside them goes on from them smoothly",
          "[compact]") {
  std::mt19937 engine(7);
  std::vector<BezierContour> sources = shapes::letter_a();
  sources.push_back(finely_cut(sources[0], 5));
  sources.push_back(finely_cut(shapes::circle(400), 6));
  sources.push_back(transform(sources.back(), {Eigen::Rotation2Dd(0.3).toRotationMatrix(), Point(0.25, 0.1)}));
  int fewer = 0;
  for (CompactOptions options : all_options(2.0)) {
    for (const BezierContour& source : sources) {
      const bool is_cubic = std::ranges::count(source.kinds(), PointKind::Cubic) > 0;
      if (is_cubic != (options.curve == CurveKind::Cubic)) continue;
      for (const double share : {0.05, 0.2, 0.5, 0.8}) {
        options.kept_segments = random_segments(source, share, engine);
        const CompactFit fit = fit_compact(source, options);
        const KeptSegments kept = find_kept(source, options.kept_segments, fit.contour, options.corner_angle);
        CHECK(kept.missing == 0);
        CHECK(kept.largest_turn <= 1.5 * degree);
        CHECK(fontcore::farthest(source, fit.contour, 0.002).distance <= 2.0 + 0.004);
        CHECK(fit.why.empty());
        fewer += source.segment_count() - fit.contour.segment_count();
        if (std::ranges::count(options.kept_segments, 0) > 0) CHECK(fit.contour.segment(0).p == source.segment(0).p);
      }
    }
  }
  CHECK(fewer > 1000);
}

TEST_CASE("the first node stays the first where a kept segment ends in it", "[compact]") {
  const BezierContour source = finely_cut(shapes::circle(400), 10);
  for (const int own : {0, 39}) {
    const CompactFit fit = fit_compact(source, {.extrema = Extrema::Free, .kept_segments = {own}});
    CHECK_FALSE(fit.kept);
    CHECK(fit.contour.point(0) == source.point(0));
  }
}

TEST_CASE("a contour whose every segment is kept stays as it is", "[compact]") {
  for (CompactOptions options : all_options(4.0)) {
    const BezierContour source = options.curve == CurveKind::Cubic ? shapes::circle(400.3) : shapes::letter_a()[0];
    for (int s = 0; s < source.segment_count(); ++s) options.kept_segments.push_back(s);
    const CompactFit fit = fit_compact(source, options);
    CHECK(fit.kept);
    CHECK(fit.contour == source);
  }
}

TEST_CASE("segments that cannot be kept are refused", "[compact]") {
  const BezierContour circle = shapes::circle(400);
  CHECK_THROWS_AS(fit_compact(circle, {.kept_segments = {4}}), InvalidInput);
  CHECK_THROWS_AS(fit_compact(circle, {.kept_segments = {-1}}), InvalidInput);
  CHECK_THROWS_AS(fit_compact(circle, {.kept_segments = {2, 1}}), InvalidInput);
  CHECK_THROWS_AS(fit_compact(circle, {.curve = CurveKind::Quadratic, .kept_segments = {1}}), InvalidInput);
}

TEST_CASE("a textured contour is fitted within the tolerance, in about two curves a wave or fewer", "[compact]") {
  for (const textured::Texture& texture : {textured::Texture{.wavelength = 40.0, .amplitude = 4.0, .seed = 1},
                                           textured::Texture{.wavelength = 40.0, .amplitude = 4.0, .seed = 2},
                                           textured::Texture{.wavelength = 80.0, .amplitude = 6.0, .seed = 3}}) {
    for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
      for (const Coordinates coordinates : {Coordinates::Any, Coordinates::Whole}) {
        for (const double tolerance : {0.5, 1.0}) {
          // On whole numbers half a unit is less than what extrema are off them.
          if (coordinates == Coordinates::Whole && extrema == Extrema::Keep && tolerance < 1.0) continue;
          int segments = 0;
          double length = 0.0;
          for (const BezierContour& base : bases()) {
            const BezierContour source = textured::contour(base, texture);
            const CompactFit fit =
                fit_compact(source, {.tolerance = tolerance, .extrema = extrema, .coordinates = coordinates});
            CAPTURE(tolerance, extrema == Extrema::Keep, coordinates == Coordinates::Whole, texture.seed, length);
            CHECK(fit.why.empty());
            CHECK(farthest(source, fit.contour, 0.002).distance <= tolerance + 0.004);
            CHECK(largest_smooth_turn(fit.contour) <= 1.5 * degree);
            segments += fit.contour.segment_count();
            length += fontcore::length(source);
          }
          CHECK(segments * texture.wavelength <= (extrema == Extrema::Keep ? 2.2 : 1.7) * length);
        }
      }
    }
  }
}

TEST_CASE("the work for a textured contour grows as its length does", "[compact]") {
  const auto work = [](double radius) {
    const BezierContour source = textured::contour(shapes::circle(radius), {});
    return static_cast<double>(fit_compact(source, {.tolerance = 0.5, .coordinates = Coordinates::Any}).work);
  };
  CHECK(work(800) < 1.3 * 4.0 * work(200));
}

TEST_CASE("moving or mirroring a textured outline moves or mirrors its compact form, bit for bit", "[compact]") {
  const BezierContour source = on_fractions(textured::contour(shapes::circle(100), {}));
  for (const Extrema extrema : {Extrema::Keep, Extrema::Free}) {
    const CompactOptions options{.tolerance = 1.0, .extrema = extrema};
    const BezierContour own = fit_compact(source, options).contour;
    CHECK(own.segment_count() < source.segment_count() / 2);
    for (const Point& scale : {Point(1, 1), Point(-1, 1), Point(1, -1)}) {
      const Affine map{scale.asDiagonal(), Point(137, -2011)};
      CHECK(fit_compact(transform(source, map), options).contour == transform(own, map));
    }
  }
}

TEST_CASE("a tolerance that is no distance is refused", "[compact]") {
  CHECK_THROWS_AS(fit_compact(shapes::square(600), {.tolerance = -1.0}), InvalidInput);
  CHECK_THROWS_AS(fit_compact(shapes::square(600), {.tolerance = std::nan("")}), InvalidInput);
}
