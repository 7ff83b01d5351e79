#include "fontcore/drag.h"

#include <Eigen/LU>
#include <array>
#include <cstdlib>
#include <numbers>
#include <random>

#include "fontcore/edit.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"
#include "tests/catch.h"
#include "tests/shapes.h"

// Every allocation of this program is counted, Eigen's too, which ask malloc; sanitizers bring their own.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define COUNTS_ALLOCATIONS 1
namespace {
long allocations = 0;
}
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* realloc(void* memory, std::size_t size) {
  ++allocations;
  return __libc_realloc(memory, size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
}
#endif

using namespace fontcore;

namespace {

const OutlineCurve& specimen() {
  static const OutlineCurve curve(shapes::letter_a()[0], {.tolerance = 0.5});
  return curve;
}

// A round spline with waves, not symmetric; counter-clockwise.
Points wavy(int count) {
  Points points(count, 2);
  for (int i = 0; i < count; ++i) {
    const double a = 2.0 * std::numbers::pi * i / count;
    const double radius = 400.0 + 40.0 * std::cos(3.0 * a + 0.4) + 12.0 * std::sin(9.0 * a);
    points.row(i) << 1.3 * radius * std::cos(a), radius * std::sin(a);
  }
  return points;
}

// Parameter of control point i of a level, at the finest level of `count` control points.
double parameter_of(int i, int level, int count) {
  return finer_parameter(i, most_levels(Scheme::Chaikin, count) - level);
}

Row frozen(int point, int axis) {
  return {text("control point ", point, " is frozen"), {{2 * point + axis, 1.0}}, 0.0};
}
Rows frozen_stretch(int first, int last, int count) {
  Rows rows;
  for (int i = first; i < last; ++i) {
    for (int axis = 0; axis < 2; ++axis) rows.push_back(frozen(i % count, axis));
  }
  return rows;
}

double bending(const Points& points) {
  double sum = 0.0;
  const Eigen::Index n = points.rows();
  for (Eigen::Index i = 0; i < n; ++i) {
    sum += (points.row((i + n - 1) % n) - 2.0 * points.row(i) + points.row((i + 1) % n)).squaredNorm();
  }
  return sum;
}

// Length of a spline by chords, refined until they no longer change it: nothing of what the solver uses.
double spline_length(const Points& points) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Eigen::Index n = points.rows();
    const Point before = points.row((i + n - 1) % n);
    const Point at = points.row(i);
    const Point after = points.row((i + 1) % n);
    Bezier piece;
    piece.p = {Point(0.5 * (before + at)), at, Point(0.5 * (at + after)), Point::Zero()};
    piece.degree = 2;
    sum += length(piece);
  }
  return sum;
}

const DragOptions no_area = {.level = 3.0, .area = AnyValue{}};

}  // namespace

TEST_CASE("a wish that no rule hinders is the sweep of the same place and level", "[drag]") {
  for (const Scheme scheme : {Scheme::Chaikin, Scheme::Orthogonal}) {
    for (const double breadth : {200.0, 450.0, 1100.0, 2500.0}) {
      const double t = 12.4;
      const Sweep swept = sweep(specimen(), t, Point(24, -10), breadth, {.scheme = scheme});
      DragOptions options{.level = swept.level, .scheme = scheme, .alpha = 1e9, .area = AnyValue{}};
      options.corners = Corners::Round;
      const DragResult result = solve_once(specimen(), {{.t = t}}, {Point(24, -10)}, options);
      CHECK(shapes::largest_distance(result.field, swept.field) < 1e-5);
      CHECK((result.report.got[0] - Point(24, -10)).norm() < 1e-6);
      CHECK(result.report.passes == 0);
    }
  }
}

TEST_CASE("without an area the answer is the least of energy and distance under the rows, as a dense solve finds it",
          "[drag]") {
  const int n = 32;
  const int level = 2;
  const double alpha = 3.0;
  const DragHandle handle{.t = parameter_of(5, level, n), .grip = Grip::ControlPoint};
  Rows rows = {{"two points move alike", {{2 * 3, 1.0}, {2 * 20 + 1, -1.0}}, 0.0},
               {"one moves by 2", {{31, 1.0}}, 2.0}};
  for (const auto smoothness : {DragOptions::Smoothness::Displacement, DragOptions::Smoothness::Curve}) {
    const DragOptions options{
        .level = level, .alpha = alpha, .smoothness = smoothness, .insistence = 0.0, .area = AnyValue{}};
    DragSolver solver(wavy(n), {handle}, options, rows);
    const DragReport& report = solver.move(std::array{Point(30, 50)});

    const Eigen::Index m = n >> 1;
    const Eigen::MatrixXd S = refine(Scheme::Chaikin, Eigen::MatrixXd::Identity(m, m));
    const Eigen::MatrixXd H = 8.0 * S.transpose() * mother_matrix(Form::Energy, Scheme::Chaikin, n) * S;
    const Eigen::MatrixXd G = mother_matrix(Form::Product, Scheme::Chaikin, m);
    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(2 * m + 2, 2 * m + 2);
    kkt.topLeftCorner(m, m) = kkt.block(m, m, m, m) = H + 2.0 * alpha * G;
    Eigen::VectorXd right = Eigen::VectorXd::Zero(2 * m + 2);
    right.head(m) = 2.0 * alpha * 30.0 * G.col(5);
    right.segment(m, m) = 2.0 * alpha * 50.0 * G.col(5);
    if (smoothness == DragOptions::Smoothness::Curve) {
      const Eigen::MatrixXd pull = 8.0 * S.transpose() * mother_matrix(Form::Energy, Scheme::Chaikin, n) * wavy(n);
      right.head(m) -= pull.col(0);
      right.segment(m, m) -= pull.col(1);
    }
    kkt.block(2 * m, 0, 1, m) = S.row(3);
    kkt.block(2 * m, m, 1, m) = -S.row(20);
    kkt.block(2 * m + 1, m, 1, m) = S.row(15);
    right[2 * m + 1] = 2.0;
    kkt.bottomRows(2).rightCols(2).setZero();
    kkt.topRightCorner(2 * m, 2) = kkt.bottomLeftCorner(2, 2 * m).transpose();
    const Eigen::VectorXd z = kkt.fullPivLu().solve(right);
    CHECK((solver.field().col(0) - S * z.head(m)).cwiseAbs().maxCoeff() < 1e-9);
    CHECK((solver.field().col(1) - S * z.segment(m, m)).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(report.row_residual < 1e-12);
  }
}

TEST_CASE("the area is that of the displaced outline, not of its spline", "[drag]") {
  // The polygon through outline + D, twice as fine until its area is settled by extrapolation.
  CHECK(std::abs(limit_area(specimen().control_points()) / signed_area(specimen().contour()) - 1.0) > 1e-6);
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::arch(500), shapes::circle(400)}) {
    const OutlineCurve curve(contour, {.tolerance = 0.5});
    for (const double factor : {1.0, 1.03}) {
      const DragOptions options{.level = 2.3, .area = KeptValue{factor}};
      const DragResult result = solve_once(curve, {{.t = 9.3}}, {Point(60, 25)}, options);
      CHECK(result.report.is_met());
      const auto polygon_area = [&](int per_piece) {
        Points polygon(curve.size() * per_piece, 2);
        for (int k = 0; k < polygon.rows(); ++k) {
          const double t = -0.5 + static_cast<double>(k) / per_piece;
          polygon.row(k) = curve.outline_at(t).transpose() + evaluate(Scheme::Chaikin, result.field, t);
        }
        double twice = 0.0;
        for (Eigen::Index k = 0; k < polygon.rows(); ++k) {
          const Eigen::Index next = (k + 1) % polygon.rows();
          twice += polygon(k, 0) * polygon(next, 1) - polygon(k, 1) * polygon(next, 0);
        }
        return 0.5 * twice;
      };
      const double area = (4.0 * polygon_area(200) - polygon_area(100)) / 3.0;
      CHECK(area == Approx(factor * signed_area(contour)).epsilon(1e-10));
    }
  }
}

TEST_CASE("area is met in one pass, seldom two, rows hold, and what cannot be met says why", "[drag]") {
  std::vector<OutlineCurve> curves;
  for (const BezierContour& contour :
       {shapes::letter_a()[0], shapes::letter_a()[1], shapes::circle(400), shapes::arch(500)})
    curves.emplace_back(contour, OutlineCurveOptions{.tolerance = 0.5});
  std::mt19937 engine(7);
  const auto random = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  };
  int met = 0;
  int one_pass = 0;
  constexpr int edits = 400;
  for (int k = 0; k < edits; ++k) {
    const OutlineCurve& curve = curves[engine() % curves.size()];
    const int n = curve.size();
    const double t = random(0.0, n);
    Rows rows = frozen_stretch(static_cast<int>(t + 0.3 * n), static_cast<int>(t + 0.5 * n), n);
    for (const int i : curve.corner_pairs()) {
      for (Row& row : fontcore::rows(CornerPair{i, n})) rows.push_back(std::move(row));
    }
    DragOptions options{.level = level_of_breadth(curve, t, curve.length() * random(0.05, 0.6))};
    options.area = KeptValue{k % 3 == 0 ? 1.03 : 1.0};
    DragSolver solver(curve, {{.t = t}}, options, rows);
    const Point delta(random(-200.0, 200.0), random(-200.0, 200.0));
    const DragReport& report = solver.move(std::array{delta});
    CHECK(report.passes <= 3);
    CHECK(report.is_met() == explain(report).empty());
    CHECK(report.row_residual < 1e-9);
    if (!report.is_met()) continue;
    ++met;
    one_pass += report.passes == 1;
    CHECK(std::abs(report.area_error) < 1e-12);
    CHECK(report.area == Approx(signed_area(curve.contour()) * (k % 3 == 0 ? 1.03 : 1.0)).epsilon(1e-12));
  }
  CHECK(met >= 0.99 * edits);
  CHECK(one_pass > edits / 2);
}

TEST_CASE("a bare spline's area is its own, exactly", "[drag]") {
  const Points points = wavy(128);
  for (const double level : {0.0, 1.5, 2.0, 3.7, 5.0}) {
    DragSolver solver(points, {{.t = 31.2}}, {.level = level});
    const DragReport& report = solver.move(std::array{Point(70, -90)});
    CHECK(report.is_met());
    CHECK(limit_area(solver.control_points()) == Approx(limit_area(points)).epsilon(1e-12));
    CHECK((report.got[0] - report.share * Point(70, -90)).norm() < 2.0);
  }
}

TEST_CASE("area and length are kept together, within eight passes", "[drag]") {
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::arch(500)}) {
    const OutlineCurve curve(contour, {.tolerance = 0.5});
    for (const double level : {1.4, 2.0, 3.1}) {
      const DragOptions options{.level = level, .length = KeptValue{}};
      const DragResult result = solve_once(curve, {{.t = 20.0}}, {Point(25, -30)}, options);
      CHECK(result.report.is_met());
      CHECK(result.report.passes <= 8);
      CHECK(std::abs(result.report.area_error) <= 1e-12);
      CHECK(std::abs(result.report.length_error) <= 1e-12);
      CHECK(spline_length(curve.control_points() + result.field) ==
            Approx(spline_length(curve.control_points())).epsilon(1e-4));
    }
  }
  // A longer curve round the same area; and a length with the area free.
  DragSolver longer(wavy(64), {{.t = 3.0}}, {.level = 3.0, .length = KeptValue{1.02}});
  CHECK(longer.move(std::array{Point(30, 0)}).is_met());
  CHECK(limit_area(longer.control_points()) == Approx(limit_area(wavy(64))).epsilon(1e-11));
  CHECK(spline_length(longer.control_points()) == Approx(1.02 * spline_length(wavy(64))).epsilon(1e-6));
  DragSolver length_alone(wavy(64), {{.t = 3.0}}, {.level = 3.0, .area = AnyValue{}, .length = KeptValue{}});
  CHECK(length_alone.move(std::array{Point(30, 0)}).is_met());
  CHECK(spline_length(length_alone.control_points()) == Approx(spline_length(wavy(64))).epsilon(1e-6));
}

TEST_CASE("a round curve cannot grow round the same length: the report says so and the curve stays", "[drag]") {
  const OutlineCurve circle(shapes::circle(400));
  const DragOptions options{.level = 2.0, .area = KeptValue{1.03}, .length = KeptValue{}};
  DragSolver solver(circle, {{.t = 3.0}}, options);
  const DragReport& report = solver.move(std::array{Point(20, 0)});
  CHECK(report.failure == DragReport::Failure::LengthOutOfReach);
  CHECK(explain(report).rfind("the length cannot be met", 0) == 0);
  CHECK(solver.control_points() == circle.control_points());
}

TEST_CASE("a counter grows by 3 percent, and a glyph's area is shared out to one contour", "[drag]") {
  const std::vector<BezierContour> glyph = shapes::letter_a();
  const OutlineCurve counter(glyph[1], {.tolerance = 0.5});
  const DragResult grown = solve_once(counter, {}, {}, {.level = 3.0, .area = KeptValue{1.03}});
  CHECK(grown.report.area == Approx(1.03 * signed_area(glyph[1])).epsilon(1e-12));
  CHECK(grown.report.passes == 1);

  // The bowl is dragged and the counter answers for both.
  const double wanted = signed_area(glyph) + 5000.0;
  const double own = area_within_glyph(glyph, 1, wanted);
  CHECK(own == Approx(signed_area(glyph[1]) + 5000.0).epsilon(1e-12));
  const DragResult shared = solve_once(counter, {}, {}, {.level = 3.0, .area = GivenValue{own}});
  CHECK(signed_area(glyph[0]) + shared.report.area == Approx(wanted).epsilon(1e-12));
  CHECK_THROWS_WITH(area_within_glyph(glyph, 2, 0.0), "area_within_glyph: contour 2 of a glyph with 2");
}

TEST_CASE("both members of a corner move alike to the last bit, and frozen points keep theirs", "[drag]") {
  const int n = specimen().size();
  const Rows rows = frozen_stretch(n / 2, n * 3 / 4, n);
  DragSolver solver(specimen(), {{.t = 10.0}}, {.level = 2.6}, rows);
  CHECK(solver.move(std::array{Point(50, 35)}).is_met());
  for (const int i : specimen().corner_pairs()) {
    CHECK(solver.field().row(i) == solver.field().row((i + 1) % n));
    CHECK(solver.control_points().row(i) == solver.control_points().row((i + 1) % n));
  }
  for (int i = n / 2; i < n * 3 / 4; ++i) CHECK(solver.control_points().row(i) == specimen().control_points().row(i));
}

TEST_CASE("every handle gets its own move, whatever the others do", "[drag]") {
  const std::vector<DragHandle> handles = {{.t = 10.0}, {.t = 14.0}, {.t = 40.5, .hold = DragHandle::Hold::Pinned}};
  const std::vector<Point> deltas = {Point(20, 0), Point(-15, 30), Point(0, 12)};
  const DragResult result = solve_once(specimen(), handles, deltas, {.level = 3.0});
  CHECK(result.report.is_met());
  CHECK((result.report.got[0] - deltas[0]).norm() < 0.1);
  CHECK((result.report.got[1] - deltas[1]).norm() < 0.1);
  CHECK((result.report.got[2] - deltas[2]).norm() < 1e-10);
  CHECK((evaluate(Scheme::Chaikin, result.field, 40.5).transpose() - deltas[2]).norm() < 1e-10);
}

TEST_CASE("a wish that the rules hinder reports what was asked and what was got", "[drag]") {
  const int n = specimen().size();
  const Rows rows = frozen_stretch(8, 13, n);
  DragSolver solver(specimen(), {{.t = 10.0}}, {.level = 4.0}, rows);
  const DragReport& report = solver.move(std::array{Point(50, 35)});
  CHECK(report.is_met());
  CHECK(report.got[0].norm() == 0.0);
  CHECK(std::abs(report.area_error) < 1e-12);
}

TEST_CASE("rules that contradict a pin or each other are named, and the curve is unchanged", "[drag]") {
  const OutlineCurve& curve = specimen();
  const Points before = curve.control_points();
  Rows rows = frozen_stretch(9, 12, curve.size());
  const DragOptions options{.level = 4.0};
  CHECK_NOTHROW(DragSolver(curve, {{.t = 10.0}}, options, rows));
  const std::string pinned = message_of<UnsatisfiableConstraints>(
      [&] { DragSolver(curve, {{.t = 10.0, .hold = DragHandle::Hold::Pinned}}, options, rows); });
  CHECK(pinned.find("handle 0 is pinned") != std::string::npos);
  CHECK(pinned.find("control point 10 is frozen") != std::string::npos);

  rows.push_back({"control point 10 moves by 12", {{20, 1.0}}, 12.0});
  const std::string conflict = message_of<UnsatisfiableConstraints>([&] { DragSolver(curve, {}, options, rows); });
  CHECK(conflict.rfind("DragSolver: control point 10 moves by 12; control point ", 0) == 0);
  CHECK(conflict.find("is frozen: off by 12 units") != std::string::npos);

  // Two pins at one place can only ever agree by chance.
  const DragHandle pin{.t = 30.0, .hold = DragHandle::Hold::Pinned};
  CHECK(message_of<UnsatisfiableConstraints>([&] {
          DragSolver(curve, {pin, pin}, options);
        }).find("handle 1 is pinned; handle 0 is pinned") != std::string::npos);
  // Beyond the neighbours nothing moves, so nothing can be asked there.
  const DragOptions local{.level = 4.0, .neighbours = 1};
  CHECK_THROWS_AS(DragSolver(curve, {{.t = 10.0}}, local, {{"far away", {{2 * 40, 1.0}}, 5.0}}),
                  UnsatisfiableConstraints);
  CHECK(curve.control_points() == before);
}

TEST_CASE("an area that nothing free can change, or that bends one way only, comes with a certificate", "[drag]") {
  const Points points = wavy(64);
  DragSolver still(points, {}, {.level = 2.0, .area = KeptValue{1.01}}, frozen_stretch(0, 64, 64));
  CHECK(still.move({}).failure == DragReport::Failure::NothingFree);
  CHECK(explain(still.move({})) == "the rules leave nothing free that changes the area");
  CHECK(still.control_points() == points);

  // One freedom: control point 9 rises as 8 goes right, so that the area is a parabola.
  const int level = 4;  // the finest
  Rows rows;
  for (int i = 0; i < 64; ++i) {
    if (i != 8 && i != 9) {
      rows.push_back(frozen(i, 0));
      rows.push_back(frozen(i, 1));
    }
  }
  rows.push_back({"8 does not rise", {{17, 1.0}}, 0.0});
  rows.push_back({"9 does not go sideways", {{18, 1.0}}, 0.0});
  rows.push_back({"9 rises as 8 goes right", {{19, 1.0}, {16, -1.0}}, 0.0});
  const auto area_at = [&](double s) {
    Points moved = points;
    moved(8, 0) += s;
    moved(9, 1) += s;
    return limit_area(moved);
  };
  // Of a parabola through three points: its turn.
  const double bend = 0.5 * (area_at(1.0) + area_at(-1.0)) - area_at(0.0);
  const double slope = 0.5 * (area_at(1.0) - area_at(-1.0));
  const double turn = area_at(-0.5 * slope / bend);
  REQUIRE(bend > 0.0);
  DragSolver parabola(points, {}, {.level = level, .area = GivenValue{turn - 1000.0}}, rows);
  const DragReport& report = parabola.move({});
  CHECK(report.free == 1);
  CHECK(report.failure == DragReport::Failure::AreaOutOfReach);
  CHECK(report.least_area == Approx(turn).epsilon(1e-9));
  CHECK(report.largest_area == std::numeric_limits<double>::infinity());
  CHECK(parabola.control_points() == points);
  DragSolver reached(points, {}, {.level = level, .area = GivenValue{turn + 1.0}}, rows);
  CHECK(reached.move({}).is_met());
}

TEST_CASE("a wish too large for its area goes as far as the area lets it, and on continuously", "[drag]") {
  // Two freedoms, each a parabola open upwards: what the wish for one adds, the other can take away only down to its
  // turn.
  const Points points = wavy(64);
  Rows rows;
  for (int i = 0; i < 64; ++i) {
    const bool is_first = i == 8 || i == 30;
    const bool is_second = i == 9 || i == 31;
    if (!is_first) rows.push_back(frozen(i, 0));
    if (!is_first && !is_second) rows.push_back(frozen(i, 1));
    if (is_first) rows.push_back({"rises as the next goes right", {{2 * i + 3, 1.0}, {2 * i, -1.0}}, 0.0});
    if (is_first) rows.push_back({"does not rise", {{2 * i + 1, 1.0}}, 0.0});
  }
  DragSolver solver(points, {{.t = 8.0}}, {.level = 4.0}, rows);
  Points before = points;
  bool was_cut = false;
  for (double far = 0.0; far < 1000.0; far += 1.0) {
    const DragReport& report = solver.move(std::array{Point(far, 0.0)});
    CHECK(report.free == 2);
    REQUIRE(report.is_met());
    CHECK(limit_area(solver.control_points()) == Approx(limit_area(points)).epsilon(1e-12));
    CHECK(report.attempts == (report.share < 1.0 ? 2 : 1));
    CHECK((report.share < 1.0 || !was_cut));
    was_cut = report.share < 1.0;
    CHECK(shapes::largest_distance(solver.control_points(), before) < 20.0);
    before = solver.control_points();
  }
  CHECK(was_cut);
}

TEST_CASE("moves do not depend on each other, and cancelling brings back every bit", "[drag]") {
  DragSolver solver(specimen(), {{.t = 10.0}}, {.level = 2.6});
  solver.move(std::array{Point(50, 35)});
  const Points first = solver.commit();
  solver.move(std::array{Point(-20, 90)});
  CHECK(solver.commit() != first);
  solver.move(std::array{Point(50, 35)});
  CHECK(solver.commit() == first);
  const Points once = solve_once(specimen(), {{.t = 10.0}}, {Point(50, 35)}, {.level = 2.6}).field;
  CHECK(specimen().control_points() + once == first);
  solver.move(std::array{Point(0, 0)});
  CHECK(solver.commit() == specimen().control_points());
  solver.move(std::array{Point(1, 0)});
  solver.cancel();
  CHECK(solver.field().isZero(0.0));
  CHECK(solver.control_points() == specimen().control_points());
}

TEST_CASE("the answer is continuous in the level", "[drag]") {
  const auto field_at = [](double level) {
    return solve_once(specimen(), {{.t = 10.0}}, {Point(30, 10)}, {.level = level}).field;
  };
  for (double level = 0.02; level < specimen().levels() - 0.02; level += 0.173) {
    CHECK(shapes::largest_distance(field_at(level), field_at(level + 1e-6)) < 1e-3);
  }
  for (int level = 1; level < specimen().levels(); ++level) {
    CHECK(shapes::largest_distance(field_at(level), field_at(level + 1e-6)) < 0.05);
  }
}

TEST_CASE("a large system is factored sparsely and gives what a dense one would", "[drag]") {
  const int n = 256;
  Rows rows = frozen_stretch(100, 150, n);
  const DragOptions sparse{.level = 6.0, .area = AnyValue{}};  // the finest: 412 unknowns
  DragSolver solver(wavy(n), {{.t = 31.0}}, sparse, rows);
  const DragReport& report = solver.move(std::array{Point(30, 10)});
  CHECK(report.free == 412);
  // The same problem on 20 neighbours is all but the same problem, as the answer decays; and it is dense.
  const DragOptions dense{.level = 6.0, .neighbours = 40, .area = AnyValue{}};
  DragSolver local(wavy(n), {{.t = 31.0}}, dense, rows);
  CHECK(local.move(std::array{Point(30, 10)}).free <= 200);
  CHECK(shapes::largest_distance(solver.field(), local.field()) < 1e-6);
}

TEST_CASE("[HBS05] figure 5: the area is kept, and a large alpha is nearer to the deformed curve, a small one smoother",
          "[drag][papers]") {
  const int n = 32;
  const int level = 1;  // of 8 control points; the paper counts levels from 1 control point
  const Points points = wavy(n);
  const DragHandle handle{.t = parameter_of(2, level, n), .grip = Grip::ControlPoint};
  const auto edited = [&](double alpha, const Target& area) {
    const DragOptions options{.level = level,
                              .alpha = alpha,
                              .smoothness = DragOptions::Smoothness::Curve,
                              .details = DragOptions::Details::Free,
                              .insistence = 0.0,
                              .area = area};
    DragSolver solver(points, {handle}, options);
    CHECK(solver.move(std::array{Point(0, 300)}).is_met());
    return solver.commit();
  };
  const Points deformed = edited(1e12, AnyValue{});
  const Points loose = edited(1.0, KeptValue{});
  const Points tight = edited(100.0, KeptValue{});
  CHECK(limit_area(deformed) > 1.05 * limit_area(points));
  for (const Points* result : {&loose, &tight}) CHECK(limit_area(*result) == Approx(limit_area(points)).epsilon(1e-12));
  CHECK((tight - deformed).norm() < (loose - deformed).norm());
  CHECK(bending(loose) < bending(tight));
}

TEST_CASE("[HBS05] figure 6: control points beyond 1, 2 and 5 neighbours are untouched, bit for bit",
          "[drag][papers]") {
  const int n = 128;
  const int level = 2;  // of 16 control points
  const Points points = wavy(n);
  const int grabbed = 6;
  const DragHandle handle{
      .t = parameter_of(grabbed, level, n), .hold = DragHandle::Hold::Pinned, .grip = Grip::ControlPoint};
  const Eigen::MatrixXd S =
      reconstruct({Eigen::MatrixXd::Identity(16, 16),
                   {Eigen::MatrixXd::Zero(16, 16), Eigen::MatrixXd::Zero(32, 16), Eigen::MatrixXd::Zero(64, 16)}});
  for (const int neighbours : {1, 2, 5}) {
    DragSolver solver(points, {handle}, {.level = level, .neighbours = neighbours});
    const DragReport& report = solver.move(std::array{Point(-60, 150)});
    CHECK(report.is_met());
    CHECK((report.got[0] - Point(-60, 150)).norm() < 1e-9);
    CHECK(limit_area(solver.control_points()) == Approx(limit_area(points)).epsilon(1e-12));
    int untouched = 0;
    for (int i = 0; i < n; ++i) {
      bool is_reached = false;
      for (int k = -neighbours; k <= neighbours; ++k) is_reached = is_reached || S(i, (grabbed + k + 16) % 16) != 0.0;
      if (is_reached) continue;
      ++untouched;
      CHECK(solver.control_points().row(i) == points.row(i));
    }
    CHECK(untouched >= n - 8 * (2 * neighbours + 4));
  }
}

TEST_CASE("[HBS05] figure 7: two coefficients give back the area and every detail is kept", "[drag][papers]") {
  const int n = 128;
  const int level = 0;  // of 4 control points
  const Points points = wavy(n);
  const DragHandle handle{.t = parameter_of(1, level, n), .hold = DragHandle::Hold::Pinned, .grip = Grip::ControlPoint};
  DragSolver solver(points, {handle}, {.level = level, .neighbours = 1});
  const DragReport& report = solver.move(std::array{Point(0, 150)});
  CHECK(report.is_met());
  CHECK(report.free == 4);
  CHECK(limit_area(solver.control_points()) == Approx(limit_area(points)).epsilon(1e-12));
  const MultiresCurve before = decompose(points, 5);
  const MultiresCurve after = decompose(solver.control_points(), 5);
  for (std::size_t k = 0; k < before.details.size(); ++k) {
    CHECK((after.details[k] - before.details[k]).cwiseAbs().maxCoeff() < 1e-9);
  }
  CHECK((after.coarse.row(1) - before.coarse.row(1) - Eigen::RowVector2d(0, 150)).norm() < 1e-9);
  CHECK((after.coarse.row(3) - before.coarse.row(3)).norm() < 1e-9);
}

#ifdef COUNTS_ALLOCATIONS
TEST_CASE("a move allocates nothing after the first", "[drag]") {
  const int n = 256;
  Rows rows = frozen_stretch(100, 150, n);
  for (const double level : {2.3, 6.0}) {
    for (const Target& length : {Target(AnyValue{}), Target(KeptValue{})}) {
      DragSolver solver(wavy(n), {{.t = 31.0}, {.t = 60.0, .hold = DragHandle::Hold::Pinned}},
                        {.level = level, .length = length}, rows);
      std::array deltas = {Point(1, 2), Point(0, 1)};
      solver.move(deltas);
      INFO("level " << level << ", length " << length.index());
      const long before = allocations;
      for (int k = 0; k < 50; ++k) {
        deltas[0] = Point(3.0 * k, -2.0 * k);
        solver.move(deltas);
      }
      CHECK(allocations == before);
    }
  }
}
#endif

TEST_CASE("options out of range are refused by name", "[drag]") {
  const Points points = wavy(64);
  CHECK_THROWS_WITH(DragSolver(points, {}, {.level = 4.5}), "DragSolver: level 4.5 of a spline with levels 0 to 4");
  CHECK_THROWS_WITH(DragSolver(points, {}, {.alpha = 0.0}), "DragSolver: alpha 0 is not positive");
  CHECK_THROWS_WITH(DragSolver(points, {}, {.neighbours = -1}), "DragSolver: -1 neighbours");
  CHECK_THROWS_AS(DragSolver(points, {}, {.scheme = Scheme::EndpointCubic}), InvalidInput);
  CHECK_THROWS_AS(DragSolver(points, {}, {.insistence = -1.0}), InvalidInput);
  CHECK_THROWS_AS(DragSolver(points, {}, {.area = GivenValue{std::nan("")}}), InvalidInput);
  CHECK_THROWS_AS(DragSolver(points, {{.t = std::nan("")}}, {}), InvalidInput);
  CHECK_THROWS_AS(DragSolver(points, {}, {}, {{"nowhere", {{128, 1.0}}, 0.0}}), InvalidInput);
  CHECK_THROWS_WITH(DragSolver(points, {{.grip = Grip::ControlPoint}}, {.level = 1.5}),
                    "DragSolver: level 1.5 is between levels: it has no control points");
  DragSolver solver(points, {{.t = 3.0}}, no_area);
  CHECK_THROWS_WITH(solver.move({}), "DragSolver::move: 0 deltas for 1 handles");
  CHECK_THROWS_AS(solver.move(std::array{Point(std::nan(""), 0.0)}), InvalidInput);
}
