#include "fontcore/fit.h"

#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr double em = 2048.0;
constexpr OutlineRules nothing_kept{.lines = false, .smooth_joins = false, .extrema = false, .zones = {}};

StructureEdit sweep_edit(const OutlineCurve& curve, const Point& near, const Point& move, double breadth) {
  const auto [segment, u, distance] = nearest_point(curve.contour(), near);
  StructureEdit edit;
  edit.field = respect_corners(curve, sweep(curve, curve.parameter(segment, u), move, breadth).field);
  edit.handles = {{{segment, u}, move}};
  edit.breadth = breadth;
  edit.area = signed_area(curve.contour());
  return edit;
}

// The displacement of all control points by an affine map.
Points affine_field(const OutlineCurve& curve, const Affine& map) {
  return Points((curve.control_points() * map.linear.transpose()).rowwise() + map.shift.transpose()) -
         curve.control_points();
}

StructureEdit affine_edit(const OutlineCurve& curve, const Affine& map) {
  StructureEdit edit;
  edit.field = affine_field(curve, map);
  edit.breadth = curve.length();
  edit.rules = nothing_kept;
  return edit;
}

}  // namespace

TEST_CASE("no displacement gives the outline back, bit for bit", "[fit]") {
  for (const BezierContour& contour : shapes::letter_a()) {
    const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
    const StructureFit fit = refit_structure(curve, sweep_edit(curve, Point(300, 500), Point(0, 0), 400.0));
    CHECK(fit.contour == contour);
    CHECK(equal_segments(fit.contour, contour) == contour.segment_count());
  }
}

TEST_CASE("a sheared square's corners turn by the angle of the shear, and stay corners", "[fit]") {
  // Horizontal sides stay, vertical ones lean by atan(k): every corner's angle changes by just that.
  const OutlineCurve curve(shapes::square(600), {.tolerance = 0.5});
  for (const double k : {0.01, 0.1, 0.5}) {
    Affine shear;
    shear.linear << 1, k, 0, 1;
    const StructureFit fit = refit_structure(curve, affine_edit(curve, shear));
    const std::vector<double> turns = turning_angles(fit.contour);
    for (std::size_t s = 0; s < turns.size(); ++s) {
      const double change = turns[s] - std::numbers::pi / 2;
      CHECK(std::abs(change) == Approx(std::atan(k)).margin(1e-9));
    }
  }
}

TEST_CASE("an affine displacement of the spline is emitted as that map of the outline's own points", "[fit]") {
  Affine map;
  map.linear << 1.05, 0.1, -0.03, 0.96;
  map.shift << 12, -5;
  const double strength = (map.linear - Eigen::Matrix2d::Identity()).norm();
  std::vector<BezierContour> specimens = shapes::letter_a();
  specimens.push_back(shapes::square(600));
  specimens.push_back(shapes::arch(500));
  for (const BezierContour& contour : specimens) {
    const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
    double residual = 0.0;
    for (double t = -0.5; t < curve.size() - 0.5; t += 0.05)
      residual = std::max(residual, (curve.outline_at(t) - curve.spline_at(t)).norm());
    const StructureFit fit = refit_structure(curve, affine_edit(curve, map));
    const Points expected = transform(contour, map).points();
    // Handles magnify what the residual does to the least squares a little; nodes do not.
    CHECK(shapes::largest_distance(fit.contour.points(), expected) <=
          1e-9 + 4.0 * strength * residual + 1e-6 * em * strength);
  }
}

TEST_CASE("a corner turns by no more than the sweep turns the directions that meet there", "[fit]") {
  const BezierContour contour = shapes::letter_a()[0];
  const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
  for (const Point& near : {Point(780, 600), Point(72, 260), Point(465, 961), Point(300, -20)}) {
    StructureEdit edit = sweep_edit(curve, near, Point(20, 12), 500.0);
    edit.area.reset();
    edit.rules = nothing_kept;
    const StructureFit fit = refit_structure(curve, edit);
    const std::vector<double> before = turning_angles(contour);
    const std::vector<double> after = turning_angles(fit.contour);
    for (int s = 0; s < contour.segment_count(); ++s) {
      if (!curve.nodes()[static_cast<std::size_t>(s)].is_corner) continue;
      // Slope of the field along the outline over the two segments that meet: the most that a direction can turn.
      double rotation = 0.0;
      for (const int side : {contour.previous(s), s}) {
        double steepest = 0.0;
        for (int k = 0; k < 64; ++k) {
          const Point d0 = evaluate(Scheme::Chaikin, edit.field, curve.parameter(side, k / 64.0));
          const Point d1 = evaluate(Scheme::Chaikin, edit.field, curve.parameter(side, (k + 1) / 64.0));
          const double stretch =
              (evaluate(contour.segment(side), (k + 1) / 64.0) - evaluate(contour.segment(side), k / 64.0)).norm();
          steepest = std::max(steepest, (d1 - d0).norm() / stretch);
        }
        rotation += std::asin(std::min(1.0, steepest));
      }
      const auto k = static_cast<std::size_t>(s);
      CHECK(std::abs(after[k] - before[k]) <= rotation + 5e-3);  // 0.3 degrees: what least squares may leave
    }
  }
}

TEST_CASE("a sweep keeps the area, lands its handle and leaves what it does not reach bit for bit", "[fit]") {
  const BezierContour contour = shapes::letter_a()[0];
  const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
  for (const Point& near : {Point(72, 260), Point(465, 961), Point(313, -20), Point(100, 420)}) {
    const StructureFit fit = refit_structure(curve, sweep_edit(curve, near, Point(-18, 7), 0.2 * curve.length()));
    CHECK(fit.report.failed.empty());
    CHECK(std::abs(signed_area(fit.contour) / signed_area(contour) - 1.0) < 1e-12);
    CHECK(fit.report.row_residual < 1e-11);
    if (fit.against.empty()) CHECK((fit.got[0] - Point(-18, 7)).norm() < 1e-9);
    CHECK(2 * equal_segments(fit.contour, contour) >= contour.segment_count());
    CHECK(fit.contour.kinds() == contour.kinds());
  }
}

TEST_CASE("a handle that a rule holds says which", "[fit]") {
  const BezierContour contour = shapes::square(600);
  const OutlineCurve curve(contour, {.tolerance = 0.5});
  StructureEdit edit = sweep_edit(curve, Point(300, 0), Point(0, -20), 3000.0);
  edit.rules.zones = {0.0, 600.0};
  const StructureFit fit = refit_structure(curve, edit);
  CHECK(fit.got[0].norm() < 1e-9);
  REQUIRE_FALSE(fit.against.empty());
  CHECK(std::any_of(fit.against.begin(), fit.against.end(),
                    [](const std::string& rule) { return rule.ends_with("stays at zone y = 0"); }));
}

TEST_CASE("nearly smooth joins that an edit would open are closed", "[fit]") {
  const BezierContour contour = shapes::letter_a()[0];
  const OutlineCurve curve(contour, {.tolerance = 0.25e-3 * em});
  const std::vector<double> before = turning_angles(contour);
  for (const double y : {100.0, 300.0, 500.0, 700.0, 900.0}) {
    const StructureFit fit = refit_structure(curve, sweep_edit(curve, Point(60, y), Point(-30, 25), 800.0));
    const std::vector<double> after = turning_angles(fit.contour);
    for (std::size_t s = 0; s < before.size(); ++s) {
      if (std::abs(before[s]) <= 0.0261) CHECK(std::abs(after[s]) <= 0.0262);
    }
  }
}
