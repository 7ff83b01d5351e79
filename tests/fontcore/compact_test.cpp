#include "fontcore/compact.h"

#include <cmath>
#include <numbers>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

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

TEST_CASE("a tolerance that is no distance is refused", "[compact]") {
  CHECK_THROWS_AS(fit_compact(shapes::square(600), {.tolerance = -1.0}), InvalidInput);
  CHECK_THROWS_AS(fit_compact(shapes::square(600), {.tolerance = std::nan("")}), InvalidInput);
}
