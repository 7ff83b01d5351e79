#include "fontcore/edit.h"

#include "fontcore/error.h"
#include "fontcore/solve.h"
#include "fontcore/wavelet.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

const OutlineCurve& specimen() {
  static const OutlineCurve curve(shapes::letter_a()[0], {.tolerance = 0.5});
  return curve;
}

}  // namespace

TEST_CASE("the handle gets its move exactly, at every breadth", "[edit]") {
  for (const Scheme scheme : {Scheme::Chaikin, Scheme::Orthogonal}) {
    for (double breadth = 20.0; breadth < 6000.0; breadth *= 1.17) {
      for (const double t : {0.0, 7.3, 31.5, 60.25}) {
        const Sweep s = sweep(specimen(), t, Point(24, -10), breadth, {.scheme = scheme});
        // What decays below a millionth of a unit is cut off; Chaikin's sweep is local and exact.
        const double cut = scheme == Scheme::Chaikin ? 1e-12 : 1e-5;
        CHECK((evaluate(scheme, s.field, t).transpose() - Point(24, -10)).norm() < cut);
      }
    }
  }
}

TEST_CASE("a sweep has no wavelet detail finer than its level", "[edit]") {
  const int finest = specimen().levels();
  for (double breadth = 20.0; breadth < 6000.0; breadth *= 1.17) {
    const Sweep s = sweep(specimen(), 12.4, Point(24, -10), breadth);
    CHECK(s.level >= 0.0);
    CHECK(s.level <= finest);
    const MultiresCurve curve = decompose(s.field, finest);
    for (int level = static_cast<int>(std::ceil(s.level)); level < finest; ++level) {
      CHECK(curve.details[static_cast<std::size_t>(level)].cwiseAbs().maxCoeff() < 1e-12 * std::pow(1.25, finest) * 24);
    }
  }
}

TEST_CASE("a broader sweep has a lower level, and the field changes continuously with the breadth", "[edit]") {
  double before_level = 100.0;
  Points before;
  for (double breadth = 30.0; breadth < 5000.0; breadth *= 1.002) {
    const Sweep s = sweep(specimen(), 12.4, Point(1, 0), breadth);
    CHECK(s.level <= before_level + 1e-12);
    if (before.rows() > 0) CHECK(shapes::largest_distance(s.field, before) < 0.05);
    before_level = s.level;
    before = s.field;
  }
}

TEST_CASE("an integer level moves just the length it is asked for, and nothing beyond", "[edit]") {
  const double t = 12.4;
  for (int down = 0; down < specimen().levels() - 2; ++down) {
    const double breadth = breadth_of_level(specimen(), t, specimen().levels() - down);
    const Sweep s = sweep(specimen(), t, Point(1, 0), breadth);
    CHECK(s.level == Approx(specimen().levels() - down));
    double first = 0.0;
    double last = 0.0;
    for (double x = t - 0.5 * specimen().size(); x < t + 0.5 * specimen().size(); x += 0.01) {
      if (evaluate(Scheme::Chaikin, s.field, x).norm() == 0.0) continue;
      if (first == 0.0) first = x;
      last = x;
    }
    CHECK(specimen().arc_length(first, last) <= breadth + 1e-9);
    CHECK(specimen().arc_length(first, last) > 0.9 * breadth);
  }
}

namespace {

// A circle of length 4096 in 512 spans, run through at a speed that varies by `ratio`.
MultiresCurve run_through(double ratio) {
  Coefficients points(512, 2);
  const double amount = (ratio - 1.0) / (ratio + 1.0);
  for (int i = 0; i < 512; ++i) {
    const double a = 2.0 * std::numbers::pi * i / 512.0;
    const double angle = a + amount * std::sin(a);
    points.row(i) << 652.0 * std::cos(angle), 652.0 * std::sin(angle);
  }
  return decompose(Scheme::Chaikin, points, 6);
}

// 8/3 of the integral of the displacement over arc length, for a move of 1.
double moved_length(const MultiresCurve& curve, double t, double breadth) {
  const Coefficients points = reconstruct(curve);
  const double level = level_of_breadth(curve, t, breadth);
  const Coefficients field = reconstruct(pull(curve.scheme, points.rows(), curve.levels(), t, level));
  double sum = 0.0;
  constexpr double step = 0.125;
  for (double x = 0.0; x < 512.0; x += step) {
    const double size = std::abs(evaluate(curve.scheme, field, x + 0.5 * step)[0]);
    sum += size * (evaluate(curve.scheme, points, x + step) - evaluate(curve.scheme, points, x)).norm();
  }
  return 8.0 / 3.0 * sum;
}

}  // namespace

TEST_CASE("the moved length grows with the breadth and is near it, evenly and unevenly run through", "[edit]") {
  for (const auto& [ratio, within] : {std::pair{1.0, 1.2}, std::pair{10.0, 1.5}}) {
    const MultiresCurve curve = run_through(ratio);
    for (const double t : {0.0, 100.3, 256.0, 310.71}) {
      double before = 0.0;
      for (double breadth = 80.0; breadth < 2000.0; breadth *= 1.03) {
        const double moved = moved_length(curve, t, breadth);
        CHECK(moved >= before * (1.0 - 1e-9));
        const double level = level_of_breadth(curve, t, breadth);
        const bool is_reached = level > 0.0 && level < curve.levels();  // beyond, there is nothing broader or narrower
        if (is_reached) CHECK(std::max(moved / breadth, breadth / moved) < within);
        before = moved;
      }
    }
  }
}

TEST_CASE("both members of a corner pair move alike, by the field's value at the corner", "[edit]") {
  const Sweep s = sweep(specimen(), 12.4, Point(24, -10), 700.0);
  const Points field = respect_corners(specimen(), s.field);
  CHECK_FALSE(specimen().corner_pairs().empty());
  for (const int i : specimen().corner_pairs()) {
    const int next = (i + 1) % specimen().size();
    CHECK(field.row(i) == field.row(next));
    CHECK((field.row(i) - evaluate(Scheme::Chaikin, s.field, i + 0.5)).norm() < 1e-12);
  }
}

TEST_CASE("corner rows, solved, are what respecting corners does to a field", "[edit]") {
  const int n = specimen().size();
  const Sweep s = sweep(specimen(), 12.4, Point(24, -10), 700.0);
  RowElimination corners(2 * n);
  for (const int i : specimen().corner_pairs()) corners.add(rows(CornerPair{i, n}));
  Eigen::SparseMatrix<double> identity(2 * n, 2 * n);
  identity.setIdentity();
  Eigen::VectorXd wish(2 * n);
  for (int i = 0; i < n; ++i) wish.segment<2>(2 * i) = s.field.row(i);
  const Eigen::VectorXd least = LeastChange(identity, corners).solve(wish).displacement;
  const Points field = respect_corners(specimen(), s.field);
  for (int i = 0; i < n; ++i) CHECK((least.segment<2>(2 * i) - field.row(i).transpose()).norm() < 1e-12);
}

TEST_CASE("details turn with the sweep they ride on", "[edit]") {
  Eigen::Matrix2d turn;
  turn << 0.8, -0.6, 0.6, 0.8;
  for (const Scheme scheme : {Scheme::Chaikin, Scheme::Orthogonal, Scheme::EndpointCubic, Scheme::HeldCubic}) {
    const Eigen::Index size = is_closed(scheme) ? 48 : 48 + degree(scheme);
    const MultiresCurve curve = decompose(scheme, shapes::random_points(size, 5), 3);
    for (int level = 0; level <= 3; ++level) {
      const Coefficients coarse = from_level(curve, level).coarse;
      const Coefficients whole = reconstruct(curve);
      const auto carried = [&](const Coefficients& to, DetailFrame frame) {
        return reconstruct(carry_details(curve, level, to, frame));
      };
      const auto far_off = [](const Coefficients& a, const Coefficients& b) { return (a - b).cwiseAbs().maxCoeff(); };
      // A rotation of the sweep turns the whole curve; twice the size is for scaled frames alone.
      CHECK(far_off(carried(coarse * turn, DetailFrame::Tangent), whole * turn) < 1e-8);
      CHECK(far_off(carried(2.0 * coarse * turn, DetailFrame::ScaledTangent), 2.0 * whole * turn) < 1e-8);
      CHECK(far_off(carried(coarse, DetailFrame::Tangent), whole) < 1e-8);
      const Coefficients fixed = carried(coarse * turn, DetailFrame::Fixed);
      if (level < 3) CHECK(far_off(fixed, whole * turn) > 1.0);
      const MultiresCurve details = from_level(curve, level);
      const MultiresCurve kept = carry_details(curve, level, coarse * turn, DetailFrame::Fixed);
      for (std::size_t k = 0; k < details.details.size(); ++k) CHECK(kept.details[k] == details.details[k]);
    }
  }
}

TEST_CASE("a sweep that turns details lands its handle, and turns as little as it bends", "[edit]") {
  for (const DetailFrame frame : {DetailFrame::Tangent, DetailFrame::ScaledTangent}) {
    for (const double breadth : {200.0, 900.0, 3000.0}) {
      const Sweep s = sweep(specimen(), 20.3, Point(60, -30), breadth, {.detail = frame});
      CHECK((evaluate(Scheme::Chaikin, s.field, 20.3).transpose() - Point(60, -30)).norm() < 1e-9);
      const Sweep plain = sweep(specimen(), 20.3, Point(60, -30), breadth);
      const double difference = shapes::largest_distance(s.field, plain.field);
      CHECK(difference < 120.0);
      const Sweep little = sweep(specimen(), 20.3, Point(0.06, -0.03), breadth, {.detail = frame});
      CHECK(shapes::largest_distance(1000.0 * little.field, plain.field) < 250.0);
    }
  }
}

TEST_CASE("a level and its breadth are two names of one sweep", "[edit]") {
  for (const double level : {0.5, 1.0, 2.3, 3.0}) {
    const double breadth = breadth_of_level(specimen(), 20.3, level);
    CHECK(level_of_breadth(specimen(), 20.3, breadth) == Approx(level));
    CHECK(shapes::largest_distance(sweep_at_level(specimen(), 20.3, Point(9, 4), level).field,
                                   sweep(specimen(), 20.3, Point(9, 4), breadth).field) < 1e-9);
  }
  CHECK_THROWS_AS(breadth_of_level(specimen(), 20.3, 99.0), InvalidInput);
  CHECK_THROWS_AS(sweep_at_level(specimen(), 20.3, Point(9, 4), -0.5), InvalidInput);
}

TEST_CASE("a control point of a level is dragged with its neighbours' help between levels", "[edit]") {
  const int levels = specimen().levels();
  for (const double level : {1.0, 1.6, 2.0, 2.7}) {
    const Sweep s = sweep_at_level(specimen(), 20.3, Point(9, 4), level, {.grip = Grip::ControlPoint});
    const MultiresCurve field = decompose(Scheme::Chaikin, s.field, levels);
    const Coefficients seen = fractional(field, level);
    const auto nearest = std::lround(coarser_parameter(20.3, levels - static_cast<int>(std::ceil(level))));
    CHECK((seen.row(nearest) - Eigen::RowVector2d(9, 4)).norm() < 1e-9);
  }
}

TEST_CASE("several handles get their moves at once, however their stretches overlap", "[edit]") {
  const std::vector<Pull> handles = {{7.3, Point(20, 5)}, {12.0, Point(-8, 3)}, {40.6, Point(0, 31)}};
  for (const double breadth : {60.0, 400.0, 1500.0}) {
    const Sweep s = sweep(specimen(), handles, breadth);
    for (const auto& [t, move] : handles) {
      CHECK((evaluate(Scheme::Chaikin, s.field, t).transpose() - move).norm() < 1e-9);
    }
    CHECK(sweep(specimen(), {handles[0]}, breadth).field.isApprox(sweep(specimen(), 7.3, Point(20, 5), breadth).field));
  }
  CHECK_THROWS_AS(sweep(specimen(), std::vector<Pull>{}, 100.0), InvalidInput);
  CHECK_THROWS_AS(sweep(specimen(), {{7.3, Point(1, 0)}, {7.3, Point(2, 0)}}, 100.0), InvalidInput);
}

TEST_CASE("breadths that are not positive, moves that are not finite and open schemes are refused", "[edit]") {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(sweep(specimen(), nan, Point(1, 0), 90.0), InvalidInput);
  CHECK(message_of<InvalidInput>([&] { sweep(specimen(), 1.0, Point(nan, 0), 90.0); }) ==
        "sweep: a move by nan, 0 at parameter 1");
  CHECK_THROWS_AS(sweep(specimen(), 1.0, Point(1, 0), 90.0, {.scheme = Scheme::HeldCubic}), InvalidInput);
  CHECK_THROWS_AS(sweep(specimen(), 1.0, Point(1, 0), 0.0), InvalidInput);
  CHECK_THROWS_AS(sweep(specimen(), 1.0, Point(1, 0), std::numeric_limits<double>::quiet_NaN()), InvalidInput);
}

TEST_CASE("smoothing goes further with the scale and leaves less detail on every arc, either way", "[edit]") {
  std::vector<BezierContour> contours = shapes::letter_a();
  contours.push_back(shapes::circle(400));
  contours.push_back(shapes::arch(500));
  for (const BezierContour& contour : contours) {
    const OutlineCurve curve(contour, {.tolerance = 0.5});
    for (const Corners corners : {Corners::Keep, Corners::Round}) {
      for (const SmoothBy by : {SmoothBy::Energy, SmoothBy::Level}) {
        Smoothing before = smooth(curve, 0.0, by, corners);
        CHECK(before.field.isZero(0.0));
        CHECK(before.energy_after == before.energy_before);
        for (double scale = 4.0; scale < 8000.0; scale *= 1.46) {
          const Smoothing now = smooth(curve, scale, by, corners);
          for (std::size_t arc = 0; arc < now.distance.size(); ++arc) {
            CHECK(now.distance[arc] >= before.distance[arc] * (1.0 - 1e-9));
            CHECK(now.detail[arc] <= before.detail[arc] * (1.0 + 1e-9) + 1e-9);
            if (by == SmoothBy::Energy) CHECK(now.energy_after[arc] <= before.energy_after[arc] * (1.0 + 1e-9) + 1e-12);
          }
          before = now;
        }
      }
    }
  }
}

TEST_CASE("smoothing is continuous in the scale", "[edit]") {
  for (const Corners corners : {Corners::Keep, Corners::Round}) {
    for (const SmoothBy by : {SmoothBy::Energy, SmoothBy::Level}) {
      for (double scale = 10.0; scale < 3000.0; scale *= 2.1) {
        CHECK(shapes::largest_distance(smooth(specimen(), scale, by, corners).field,
                                       smooth(specimen(), scale + 1e-6, by, corners).field) < 1e-3);
      }
    }
  }
}

TEST_CASE("smoothing leaves corners and straight arcs where they are, unless corners are to be rounded", "[edit]") {
  const OutlineCurve square(shapes::square(600), {.tolerance = 0.5});
  for (const SmoothBy by : {SmoothBy::Energy, SmoothBy::Level}) {
    const Smoothing a = smooth(specimen(), 300.0, by);
    CHECK_FALSE(a.field.isZero(0.1));
    for (const int i : specimen().corner_pairs()) {
      CHECK(a.field.row(i).isZero(0.0));
      CHECK(a.field.row((i + 1) % specimen().size()).isZero(0.0));
    }
    CHECK(smooth(square, 500.0, by).field.isZero(0.0));

    // Rounded, a corner moves towards the inside, the middle of a side hardly.
    const Points rounded = smooth(square, 200.0, by, Corners::Round).field;
    for (const int i : square.corner_pairs()) {
      const Eigen::RowVector2d corner = square.control_points().row(i) - Eigen::RowVector2d(300, 300);
      CHECK(rounded.row(i).dot(corner) < -0.03 * 200.0 * corner.norm());
    }
    const double t = square.parameter(0, 0.5);
    CHECK(evaluate(Scheme::Chaikin, rounded, t).norm() < 2.0);
  }
}

namespace {

// A circle of radius 500 with 40 ripples of height 6, each about 79 units long.
const OutlineCurve& rippled() {
  static const OutlineCurve curve = [] {
    std::vector<Point> handles;
    for (int k = 0; k < 320; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / 320;
      handles.emplace_back((500.0 + 6.0 * std::cos(40.0 * angle)) * Point(std::cos(angle), std::sin(angle)));
    }
    return OutlineCurve(shapes::all_implied(shapes::points_of(handles)), {.tolerance = 0.05});
  }();
  return curve;
}

double ripple_height(const Points& field) {
  const Points moved = rippled().control_points() + field;
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  for (double t = -0.5; t < rippled().size() - 0.5; t += 0.1) {
    const double radius = evaluate(Scheme::Chaikin, moved, t).norm();
    low = std::min(low, radius);
    high = std::max(high, radius);
  }
  return 0.5 * (high - low);
}

}  // namespace

TEST_CASE("a smoothed wave loses what is shorter than the scale and keeps what is longer", "[edit]") {
  // Each wave of length l is divided by 1 + (scale / l)^4.
  const auto ripple = [](double scale) { return ripple_height(smooth(rippled(), scale).field); };
  const double whole = ripple(0.0);
  CHECK(ripple(20.0) == Approx(whole / (1.0 + std::pow(20.0 / 79.0, 4))).epsilon(0.03));
  CHECK(ripple(79.0) == Approx(whole / 2.0).epsilon(0.12));
  CHECK(ripple(400.0) < 0.01 * whole);
  CHECK_THROWS_AS(smooth(rippled(), -1.0), InvalidInput);
  CHECK_THROWS_AS(smooth(rippled(), std::numeric_limits<double>::infinity()), InvalidInput);
}

TEST_CASE("an equaliser's gain acts on features of its scale and leaves others", "[edit]") {
  const double whole = ripple_height(Points::Zero(rippled().size(), 2));
  const auto ripple = [](const std::vector<Band>& bands) { return ripple_height(equalize(rippled(), bands)); };
  // At its middle a band holds 1/(1 + 1/4) - 1/(1 + 4) = 3/5 of a wave.
  CHECK(ripple({{79.0, 0.0}}) == Approx(0.4 * whole).epsilon(0.1));
  CHECK(ripple({{79.0, 2.0}}) == Approx(1.6 * whole).epsilon(0.05));
  CHECK(ripple({{800.0, 0.0}}) == Approx(whole).epsilon(0.02));
  CHECK(ripple({{8.0, 0.0}}) == Approx(whole).epsilon(0.02));
  // Octaves share out what lies between them.
  CHECK(ripple({{20.0, 0.0}, {40.0, 0.0}, {80.0, 0.0}, {160.0, 0.0}, {320.0, 0.0}}) < 0.02 * whole);
}

TEST_CASE("an equaliser with all gains 1 displaces nothing, and bands must rise", "[edit]") {
  CHECK(equalize(specimen(), {{20.0, 1.0}, {40.0, 1.0}}).isZero(0.0));
  CHECK(equalize(specimen(), {}).isZero(0.0));
  CHECK_THROWS_WITH(equalize(specimen(), {{40.0, 1.0}, {20.0, 1.0}}), "equalize: scale 20 does not rise from 40");
  CHECK_THROWS_WITH(equalize(specimen(), {{40.0, -1.0}}), "equalize: gain -1 at scale 40 is no gain");
  CHECK_THROWS_AS(equalize(specimen(), {{0.0, 1.0}}), InvalidInput);
}
