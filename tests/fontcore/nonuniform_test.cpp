#include "fontcore/nonuniform.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "fontcore/error.h"
#include "tests/catch.h"

using namespace fontcore;

namespace {

using Eigen::Index;

Coefficients random_rows(Index rows, Index columns, unsigned seed, double size = 1000.0) {
  Coefficients values(rows, columns);
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  for (Index k = 0; k < columns; ++k) {
    for (Index i = 0; i < rows; ++i) values(i, k) = uniform(engine);
  }
  return values;
}

double largest(const Coefficients& values) { return values.size() == 0 ? 0.0 : values.cwiseAbs().maxCoeff(); }

enum class Shape { Open, Closed };

// Spans from 1 to `ratio`, one knot in `rarity` repeated up to degree + 1 times.
KnotVector random_knots(int degree, Shape shape, int places, double ratio, unsigned rarity, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const auto span = [&] { return std::pow(ratio, uniform(engine)); };
  std::vector<double> knots;
  double t = -3.0;
  if (shape == Shape::Open) knots.assign(static_cast<std::size_t>(degree + 1), t);
  for (int place = 0; place < places; ++place) {
    t += span();
    const bool is_repeated = rarity > 0 && engine() % rarity == 0;
    const auto times = is_repeated ? 1 + engine() % static_cast<unsigned>(degree + 1) : 1;
    knots.insert(knots.end(), times, t);
  }
  t += span();
  if (shape == Shape::Closed) return closed_knots(degree, knots, t - knots.front());
  knots.insert(knots.end(), static_cast<std::size_t>(degree + 1), t);
  return open_knots(degree, knots);
}

std::vector<KnotVector> many_knots() {
  std::vector<KnotVector> all;
  for (const int degree : {1, 2, 3, 4, 5}) {
    for (const Shape shape : {Shape::Open, Shape::Closed}) {
      for (const int places : {degree + 1, degree + 2, 7, 16, 41}) {
        const unsigned seed = static_cast<unsigned>(all.size());
        all.push_back(random_knots(degree, shape, places, 1.0, 0, seed));
        all.push_back(random_knots(degree, shape, places, 10.0, 0, seed));
        all.push_back(random_knots(degree, shape, places, 10.0, 5, seed));
        all.push_back(random_knots(degree, shape, places, 1000.0, 9, seed));
      }
    }
  }
  return all;
}

// Value or derivative of the B-spline on knots i .. i + p + 1 by the recursion of Cox and de Boor: nothing of what
// `nonuniform` uses.
double b_spline(const KnotVector& knots, Index i, int p, double t, int derivative) {
  if (p == 0) return derivative == 0 && t >= knots.knot(i) && t < knots.knot(i + 1) ? 1.0 : 0.0;
  const double left = knots.knot(i + p) - knots.knot(i);
  const double right = knots.knot(i + p + 1) - knots.knot(i + 1);
  const int lower = derivative > 0 ? derivative - 1 : 0;
  double value = 0.0;
  if (left > 0.0) value += (derivative > 0 ? p : t - knots.knot(i)) / left * b_spline(knots, i, p - 1, t, lower);
  if (right > 0.0) {
    value += (derivative > 0 ? -p : knots.knot(i + p + 1) - t) / right * b_spline(knots, i + 1, p - 1, t, lower);
  }
  return value;
}

// All basis functions at a t that is no knot.
Eigen::RowVectorXd basis(const KnotVector& knots, double t, int derivative) {
  if (t < knots.start()) t += knots.period();  // knots of a level begin in the period of the finest
  Eigen::RowVectorXd values = Eigen::RowVectorXd::Zero(knots.size());
  const Index n = knots.size();
  for (Index i = knots.is_closed() ? -knots.degree() : 0; i < n; ++i) {
    values[(i + n) % n] += b_spline(knots, i, knots.degree(), t, derivative);
  }
  return values;
}

// The places of knots that differ, and the end.
std::vector<double> breaks(const KnotVector& knots) {
  std::vector<double> places = knots.knots();
  places.push_back(knots.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return places;
}

// Integral of an expression of t: six Gauss points a span, exact to degree 11.
template <typename Integrand>
Eigen::MatrixXd integral(const KnotVector& knots, const Integrand& integrand) {
  constexpr std::array<double, 3> node = {0.23861918608319690863, 0.66120938646626451366, 0.93246951420315202781};
  constexpr std::array<double, 3> weight = {0.46791393457269104739, 0.36076157304813860757, 0.17132449237917034504};
  Eigen::MatrixXd sum;
  const std::vector<double> places = breaks(knots);
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double half = 0.5 * (places[i] - places[i - 1]);
    for (std::size_t k = 0; k < 3; ++k) {
      for (const double side : {-1.0, 1.0}) {
        const Eigen::MatrixXd value = half * weight[k] * integrand(places[i - 1] + half * (1.0 + side * node[k]));
        if (sum.size() == 0) sum = Eigen::MatrixXd::Zero(value.rows(), value.cols());
        sum += value;
      }
    }
  }
  return sum;
}

// The curves of one detail each, as fine control points: Q of the step from level j to j + 1, column by column.
Coefficients wavelets(const NonuniformScheme& scheme, int j) {
  const Index coarse = scheme.knots(j).size();
  const Index details = scheme.knots(j + 1).size() - coarse;
  const NonuniformScheme step(scheme.knots(j + 1), 1);
  return step.reconstruct({Coefficients::Zero(coarse, details), {Coefficients::Identity(details, details)}});
}

Eigen::RowVectorXd jump(const KnotVector& knots, const Coefficients& points, double t, int derivative) {
  return evaluate(knots, points, t, derivative, Side::Right) - evaluate(knots, points, t, derivative, Side::Left);
}

// Whole knots 0 .. spans.
KnotVector whole_knots(int degree, int spans) {
  std::vector<double> knots(static_cast<std::size_t>(degree), 0.0);
  for (int i = 0; i <= spans; ++i) knots.push_back(i);
  knots.insert(knots.end(), static_cast<std::size_t>(degree), spans);
  return open_knots(degree, knots);
}

// Cubic knots 0 .. 16, the one at 8 repeated.
KnotVector knots_with_middle(int times) {
  std::vector<double> knots = whole_knots(3, 16).knots();
  knots.insert(std::ranges::find(knots, 8.0), static_cast<std::size_t>(times - 1), 8.0);
  return open_knots(3, knots);
}

// Control points of a piecewise polynomial of degree 3 or less that is in the space, by least squares.
Coefficients fitted(const KnotVector& knots, double (*function)(double)) {
  const Eigen::MatrixXd gram =
      integral(knots, [&](double t) -> Eigen::MatrixXd { return basis(knots, t, 0).transpose() * basis(knots, t, 0); });
  const Eigen::MatrixXd right =
      integral(knots, [&](double t) -> Eigen::MatrixXd { return basis(knots, t, 0).transpose() * function(t); });
  return gram.llt().solve(right);
}

}  // namespace

TEST_CASE("control points come back from every level of every ladder of knots", "[nonuniform]") {
  for (const KnotVector& knots : many_knots()) {
    for (int levels = 0; levels <= most_levels(knots); ++levels) {
      for (const Jumps jumps : {Jumps::Fitted, Jumps::Held}) {
        const NonuniformScheme scheme(knots, levels, {.jumps = jumps});
        const Coefficients fine = random_rows(knots.size(), 2, static_cast<unsigned>(levels));
        const NonuniformCurve curve = scheme.decompose(fine);
        REQUIRE(curve.coarse.rows() == scheme.knots(0).size());
        REQUIRE(largest(scheme.reconstruct(curve) - fine) <= 1e-12 * largest(fine));
      }
    }
  }
}

TEST_CASE("details are no more than a few times as large as the curve, however uneven the knots", "[nonuniform]") {
  for (const double ratio : {1.0, 10.0, 1e3, 1e6}) {
    for (const int degree : {1, 2, 3}) {
      for (const Shape shape : {Shape::Open, Shape::Closed}) {
        for (unsigned seed = 0; seed < 10; ++seed) {
          const KnotVector knots = random_knots(degree, shape, 60, ratio, seed % 2 == 0 ? 0 : 6, seed);
          const Coefficients fine = random_rows(knots.size(), 1, seed, 1.0);
          const NonuniformScheme scheme(knots, most_levels(knots));
          const NonuniformCurve curve = scheme.decompose(fine);
          for (const Coefficients& detail : curve.details) CHECK(largest(detail) < 8.0);
          CHECK(largest(scheme.reconstruct(curve) - fine) < 1e-14);
        }
      }
    }
  }
}

TEST_CASE("curves are what the recursion of B-splines says, and equal control points draw a point", "[nonuniform]") {
  for (const KnotVector& knots : many_knots()) {
    const Coefficients points = random_rows(knots.size(), 3, 5);
    const std::vector<double> places = breaks(knots);
    for (std::size_t i = 1; i < places.size(); ++i) {
      const double span = places[i] - places[i - 1];
      for (const double u : {0.1, 0.5, 0.77}) {
        const double t = places[i - 1] + u * span;
        CHECK(evaluate(knots, Coefficients::Ones(knots.size(), 1), t)[0] == Approx(1.0).epsilon(1e-14));
        for (int derivative = 0; derivative <= knots.degree() + 1; ++derivative) {
          const Eigen::RowVectorXd value = evaluate(knots, points, t, derivative);
          const double unit = 1e3 * std::pow(knots.degree() * 2.0 / span, derivative);
          REQUIRE(largest(value - basis(knots, t, derivative) * points) < 1e-10 * unit);
        }
      }
    }
    if (!knots.is_closed()) {
      const double t = 0.3 * knots.start() + 0.7 * knots.end();
      CHECK(evaluate(knots, greville(knots), t)[0] == Approx(t).epsilon(1e-13));
    }
  }
}

TEST_CASE("more knots draw the same curve, from both sides of its jumps", "[nonuniform]") {
  for (const KnotVector& fine : many_knots()) {
    const KnotLadder ladder = make_ladder(fine, most_levels(fine));
    const KnotVector& coarse = ladder.levels.front();
    const Coefficients points = random_rows(coarse.size(), 2, 8);
    const Coefficients refined = refine(coarse, fine, points);
    std::vector<double> places = breaks(fine);
    for (std::size_t i = 1; i < breaks(fine).size(); ++i) places.push_back(0.5 * (places[i - 1] + places[i]));
    for (const double t : places) {
      for (const Side side : {Side::Left, Side::Right}) {
        REQUIRE(largest(evaluate(fine, refined, t, 0, side) - evaluate(coarse, points, t, 0, side)) < 1e-10);
      }
    }
    // And so do the steps of the scheme, when there is no detail.
    const NonuniformScheme scheme(fine, most_levels(fine));
    NonuniformCurve curve = scheme.decompose(refined);
    CHECK(largest(curve.coarse - points) < 1e-10 * std::pow(2.0, scheme.levels()));
    for (const Coefficients& detail : curve.details) CHECK(largest(detail) < 1e-10);
  }
}

TEST_CASE("Bezier pieces share their ends bit for bit, but for jumps, and a closed curve closes", "[nonuniform]") {
  for (const int degree : {1, 2, 3}) {
    const KnotVector knots = random_knots(degree, Shape::Closed, 30, 10.0, 4, 3);
    const Coefficients points = random_rows(knots.size(), 2, 4);
    const std::vector<SplinePiece> pieces = bezier_pieces(knots, points);
    REQUIRE(pieces.size() == 30);
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const SplinePiece& next = pieces[(i + 1) % pieces.size()];
      const double gap = (pieces[i].points.row(degree) - next.points.row(0)).norm();
      const bool may_jump = knots.multiplicity(next.start) == degree + 1;
      CHECK((may_jump ? gap > 1.0 : gap < 1e-12 * 1000.0));
      CHECK(evaluate(knots, points, pieces[i].start) == pieces[i].points.row(0));
      CHECK(evaluate(knots, points, pieces[i].end, 0, Side::Left) == pieces[i].points.row(degree));
    }
    CHECK(largest(evaluate(knots, points, 2.0 + 3.0 * knots.period()) - evaluate(knots, points, 2.0)) < 1e-9);
  }
}

TEST_CASE("wavelets are orthogonal to every coarse curve", "[nonuniform]") {
  for (const int degree : {1, 2, 3}) {
    for (const Shape shape : {Shape::Open, Shape::Closed}) {
      for (const unsigned rarity : {0U, 5U}) {
        const KnotVector knots = random_knots(degree, shape, 25, 30.0, rarity, 17);
        const NonuniformScheme scheme(knots, most_levels(knots));
        REQUIRE(scheme.levels() >= 2);
        for (int j = 0; j < scheme.levels(); ++j) {
          const KnotVector& fine = scheme.knots(j + 1);
          const Coefficients Q = wavelets(scheme, j);
          const auto products = [&](const auto& f, const auto& g) {
            return integral(fine, [&](double t) -> Eigen::MatrixXd { return f(t).transpose() * g(t); });
          };
          const auto coarse = [&](double t) { return basis(scheme.knots(j), t, 0); };
          const auto detail = [&](double t) -> Eigen::RowVectorXd { return basis(fine, t, 0) * Q; };
          const Eigen::VectorXd coarse_norm = products(coarse, coarse).diagonal().cwiseSqrt();
          const Eigen::VectorXd detail_norm = products(detail, detail).diagonal().cwiseSqrt();
          const Eigen::MatrixXd cosines = coarse_norm.cwiseInverse().asDiagonal() * products(coarse, detail) *
                                          detail_norm.cwiseInverse().asDiagonal();
          CHECK(largest(cosines) < 1e-12);
        }
      }
    }
  }
}

TEST_CASE("on whole knots the levels are those of the endpoint schemes", "[nonuniform]") {
  for (const Scheme scheme : {Scheme::EndpointQuadratic, Scheme::EndpointCubic}) {
    const int spans = 64;
    const KnotVector knots = whole_knots(degree(scheme), spans);
    const Coefficients fine = random_rows(knots.size(), 2, 40);
    const MultiresCurve expected = decompose(scheme, fine, 6);
    const NonuniformScheme nonuniform(knots, most_levels(knots));
    REQUIRE(nonuniform.levels() == 6);
    const NonuniformCurve curve = nonuniform.decompose(fine);
    for (int level = 0; level <= 6; ++level) {
      CHECK(largest(nonuniform.points(curve, level) - from_level(expected, level).coarse) < 1e-10 * 1000.0);
      CHECK(nonuniform.area(curve, level) == Approx(area(expected, level)).epsilon(1e-11));
      CHECK(nonuniform.energy(curve, level) == Approx(energy(expected, level)).epsilon(1e-11));
    }
  }
}

TEST_CASE("on whole closed knots a level is that of the orthogonal scheme, numbered from one on", "[nonuniform]") {
  std::vector<double> places(24);
  std::iota(places.begin(), places.end(), 0.0);
  const Coefficients fine = random_rows(24, 2, 41);
  const Split expected = orthogonal::analyze(fine);
  const NonuniformCurve curve = NonuniformScheme(closed_knots(2, places, 24.0), 1).decompose(fine);
  for (Index i = 0; i < 12; ++i) CHECK(largest(curve.coarse.row(i) - expected.coarse.row((i + 1) % 12)) < 1e-10 * 1000);
}

TEST_CASE("a jump in position, tangent or curvature is there at every level, and nowhere else", "[nonuniform]") {
  for (const Shape shape : {Shape::Open, Shape::Closed}) {
    for (const int times : {2, 3, 4}) {
      const int broken = 4 - times;  // the derivative that jumps
      KnotVector knots = knots_with_middle(times);
      if (shape == Shape::Closed) {
        knots = closed_knots(3, {knots.knots().begin() + 3, knots.knots().end() - 4}, 16.0);
      }
      const NonuniformScheme scheme(knots, most_levels(knots));
      REQUIRE(scheme.levels() >= (shape == Shape::Open ? 3 : 2));
      const NonuniformCurve curve = scheme.decompose(random_rows(knots.size(), 2, 50));
      for (int level = 0; level <= scheme.levels(); ++level) {
        const Coefficients points = scheme.points(curve, level);
        for (const double t : breaks(scheme.knots(level))) {
          if (shape == Shape::Open && (t == 0.0 || t == 16.0)) continue;
          for (int derivative = 0; derivative < 3; ++derivative) {
            const double size = jump(scheme.knots(level), points, t, derivative).norm();
            const bool breaks_here = std::fmod(t, 16.0) == 8.0 && derivative >= broken;
            CHECK((breaks_here ? size > 0.1 : size < 1e-9));
          }
        }
      }
    }
  }
}

TEST_CASE("a step, a corner and a kink of curvature keep their size, and simple knots smooth them away",
          "[nonuniform]") {
  using Function = double (*)(double);
  const std::array<Function, 3> functions = {[](double t) { return t < 8.0 ? 0.0 : 1.0; },
                                             [](double t) { return std::abs(t - 8.0); },
                                             [](double t) { return t < 8.0 ? 0.0 : (t - 8.0) * (t - 8.0); }};
  const std::array<double, 3> sizes = {1.0, 2.0, 2.0};
  for (int broken = 0; broken < 3; ++broken) {
    const auto f = static_cast<std::size_t>(broken);
    const KnotVector knots = knots_with_middle(4 - broken);
    const NonuniformScheme scheme(knots, most_levels(knots));
    const NonuniformCurve curve = scheme.decompose(fitted(knots, functions[f]));
    const KnotVector simple = whole_knots(3, 16);
    const NonuniformScheme smooth(simple, most_levels(simple));
    const NonuniformCurve smoothed = smooth.decompose(fitted(simple, functions[f]));
    for (int level = 0; level <= scheme.levels(); ++level) {
      CHECK(jump(scheme.knots(level), scheme.points(curve, level), 8.0, broken)[0] == Approx(sizes[f]).epsilon(1e-10));
      CHECK(std::abs(jump(smooth.knots(level), smooth.points(smoothed, level), 8.0, broken)[0]) < 1e-10);
    }
  }
}

TEST_CASE("held ends and corners keep their place to the last bit at every level", "[nonuniform]") {
  for (const int degree : {1, 2, 3}) {
    for (const Shape shape : {Shape::Open, Shape::Closed}) {
      const KnotVector knots = random_knots(degree, shape, 40, 10.0, 3, 60);
      const NonuniformScheme held(knots, most_levels(knots), {.jumps = Jumps::Held});
      const NonuniformScheme fitting(knots, most_levels(knots));
      const Coefficients fine = random_rows(knots.size(), 2, 61);
      const NonuniformCurve curve = held.decompose(fine);
      const NonuniformCurve fit = fitting.decompose(fine);
      int corners = 0;
      double moved = 0.0;
      for (const double t : breaks(knots)) {
        const bool is_end = shape == Shape::Open && (t == knots.start() || t == knots.end());
        if (!is_end && knots.multiplicity(t) < std::max(2, degree)) continue;
        ++corners;
        for (const Side side : {Side::Left, Side::Right}) {
          const Eigen::RowVectorXd place = evaluate(knots, fine, t, 0, side);
          for (int level = 0; level <= held.levels(); ++level) {
            CHECK(evaluate(held.knots(level), held.points(curve, level), t, 0, side) == place);
          }
          moved = std::max(moved, largest(evaluate(fitting.knots(0), fit.coarse, t, 0, side) - place));
        }
      }
      CHECK(corners >= 3);
      CHECK(moved > 1.0);
    }
  }
}

TEST_CASE("with held corners the coarse curve is the nearest of those that have them", "[nonuniform]") {
  const KnotVector knots = knots_with_middle(3);
  const NonuniformScheme scheme(knots, 1, {.jumps = Jumps::Held});
  const Coefficients fine = random_rows(knots.size(), 1, 70);
  const Coefficients coarse = scheme.decompose(fine).coarse;
  const Eigen::MatrixXd products = integral(knots, [&](double t) -> Eigen::MatrixXd {
    return basis(scheme.knots(0), t, 0).transpose() *
           (basis(knots, t, 0) * fine - basis(scheme.knots(0), t, 0) * coarse);
  });
  int held = 0;
  for (Index i = 0; i < coarse.rows(); ++i) {
    const auto& at = scheme.knots(0);
    const bool is_held = at.knot(i + 1) == at.knot(i + 3);
    held += is_held ? 1 : 0;
    CHECK((is_held || std::abs(products(i, 0)) < 1e-9));
  }
  CHECK(held == 3);
}

TEST_CASE("a run of knots that is used up stops while another goes on", "[nonuniform]") {
  // One simple knot before the corner at 2, seven behind it.
  const KnotVector knots = open_knots(3, {0, 0, 0, 0, 1, 2, 2, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10, 10, 10});
  const KnotLadder ladder = make_ladder(knots, most_levels(knots));
  REQUIRE(ladder.levels.size() == 4);
  CHECK(ladder.levels[2].knots() == std::vector<double>{0, 0, 0, 0, 2, 2, 2, 4, 6, 8, 10, 10, 10, 10});
  CHECK(ladder.levels[1].knots() == std::vector<double>{0, 0, 0, 0, 2, 2, 2, 6, 10, 10, 10, 10});
  CHECK(ladder.levels[0].knots() == std::vector<double>{0, 0, 0, 0, 2, 2, 2, 10, 10, 10, 10});
  const NonuniformCurve curve = NonuniformScheme(knots, 3).decompose(random_rows(15, 2, 1));
  CHECK(curve.details[2].rows() == 5);
  CHECK(curve.details[1].rows() == 2);
  CHECK(curve.details[0].rows() == 1);
}

TEST_CASE("knots that are kept stay at every level", "[nonuniform]") {
  const KnotVector knots = whole_knots(2, 8);
  CHECK(make_ladder(knots, most_levels(knots, {3}), {3}).levels.front().knots() ==
        std::vector<double>{0, 0, 0, 3, 8, 8, 8});
  CHECK(most_levels(knots, {1, 2, 3, 4, 5, 6, 7}) == 0);
  // Where nothing else is to stay on a closed curve the first knot does; no fewer than degree + 1 are left.
  const KnotVector closed = closed_knots(2, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, 13.0);
  CHECK(make_ladder(closed, most_levels(closed)).levels.front().knots() == std::vector<double>{0, 4, 8, 12});
  CHECK(make_ladder(closed, 1, {2.0}).levels.front().knots() == std::vector<double>{1, 2, 4, 6, 8, 10, 12});
}

TEST_CASE("area and energy are the same from every level, and those of the curve", "[nonuniform]") {
  for (const int degree : {1, 2, 3, 4}) {
    for (const Shape shape : {Shape::Open, Shape::Closed}) {
      for (const Jumps jumps : {Jumps::Fitted, Jumps::Held}) {
        const KnotVector knots = random_knots(degree, shape, 24, 5.0, 4, 80);
        const NonuniformScheme scheme(knots, most_levels(knots), {.jumps = jumps});
        const Coefficients fine = random_rows(knots.size(), 2, 81);
        const NonuniformCurve curve = scheme.decompose(fine);
        const auto at = [&](double t, int derivative) -> Eigen::RowVector2d {
          return basis(knots, t, derivative) * fine;
        };
        const double area = integral(knots, [&](double t) -> Eigen::MatrixXd {
          return Eigen::MatrixXd::Constant(1, 1, 0.5 * (at(t, 0)[0] * at(t, 1)[1] - at(t, 1)[0] * at(t, 0)[1]));
        })(0, 0);
        const double energy = integral(knots, [&](double t) -> Eigen::MatrixXd {
          return Eigen::MatrixXd::Constant(1, 1, at(t, 2).squaredNorm());
        })(0, 0);
        const double swept = fine.squaredNorm();  // what cancels in an area
        for (int level = 0; level <= scheme.levels(); ++level) {
          CHECK(std::abs(scheme.area(curve, level) - area) < 1e-12 * swept);
          CHECK(scheme.energy(curve, level) == Approx(energy).epsilon(1e-12).margin(1e-300));
        }
      }
    }
  }
}

TEST_CASE("a closed curve of degree 1 has the area of its polygon", "[nonuniform]") {
  Coefficients square(4, 2);
  square << 0, 0, 600, 0, 600, 600, 0, 600;
  const NonuniformScheme scheme(closed_knots(1, {0, 1, 5, 7}, 8.0), 1);
  CHECK(scheme.area(scheme.decompose(square), 0) == Approx(360000.0).epsilon(1e-12));
  CHECK(scheme.energy(scheme.decompose(square), 0) == 0.0);
}

TEST_CASE("a form at a level is the form of the finest one between synthesis and its transpose", "[nonuniform]") {
  for (const Jumps jumps : {Jumps::Fitted, Jumps::Held}) {
    const KnotVector knots = random_knots(3, Shape::Open, 20, 5.0, 4, 90);
    const NonuniformScheme scheme(knots, 2, {.jumps = jumps});
    const Index n = knots.size();
    const Index coarse = scheme.knots(0).size();
    const Index middle = scheme.knots(1).size();
    const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(n, n);
    const Eigen::MatrixXd S = scheme.reconstruct(
        {unit.topRows(coarse), {unit.middleRows(coarse, middle - coarse), unit.bottomRows(n - middle)}});
    for (const Form form : {Form::Product, Form::Area, Form::Energy}) {
      const Eigen::MatrixXd fine = scheme.apply(form, 2, unit);
      const Eigen::MatrixXd expected = S.transpose() * fine * S;
      CHECK(largest(scheme.apply(form, 0, unit) - expected) < 1e-12 * largest(fine) * static_cast<double>(n));
    }
    const NonuniformCurve curve = scheme.decompose(random_rows(n, 2, 91));
    CHECK(scheme.stack(curve, 2) == scheme.reconstruct(curve));
    CHECK(scheme.stack(curve, 0).topRows(coarse) == curve.coarse);
    CHECK(scheme.stack(curve, 1).bottomRows(n - middle) == curve.details[1]);
  }
}

TEST_CASE("between two levels a curve is continuous in the level, and at whole ones the level", "[nonuniform]") {
  const KnotVector knots = random_knots(3, Shape::Closed, 50, 10.0, 8, 100);
  const NonuniformScheme scheme(knots, 3);
  const NonuniformCurve curve = scheme.decompose(random_rows(knots.size(), 3, 101));
  const double step = 1e-9;
  for (int level = 0; level <= 3; ++level) {
    const Coefficients here = scheme.fractional(curve, level);
    CHECK(here == scheme.points(curve, level));
    if (level > 0) CHECK(largest(scheme.fractional(curve, level - step) - here) < 1e-4);
    if (level == 3) break;
    const Coefficients refined = refine(scheme.knots(level), scheme.knots(level + 1), here);
    CHECK(largest(scheme.fractional(curve, level + step) - refined) < 1e-4);
    const Coefficients halfway = 0.5 * (refined + scheme.points(curve, level + 1));
    CHECK(largest(scheme.fractional(curve, level + 0.5) - halfway) < 1e-9);
  }
}

TEST_CASE("attributes ride along, column by column, bit for bit", "[nonuniform]") {
  for (const Shape shape : {Shape::Open, Shape::Closed}) {
    const KnotVector knots = random_knots(3, shape, 60, 10.0, 5, 110);
    const NonuniformScheme scheme(knots, most_levels(knots));
    const Coefficients fine = random_rows(knots.size(), 5, 111);
    const NonuniformCurve together = scheme.decompose(fine);
    for (Index k = 0; k < fine.cols(); ++k) {
      const NonuniformCurve alone = scheme.decompose(fine.col(k));
      CHECK(together.coarse.col(k) == alone.coarse);
      CHECK(scheme.reconstruct(together).col(k) == scheme.reconstruct(alone));
    }
  }
}

TEST_CASE("a letter D keeps its corners and the places where its bow begins", "[nonuniform]") {
  // A stem with two corners, arms of 300 and a half circle of radius 350, over its length: the corners are triple
  // knots, the joins of arm and bow double ones. Control points lie on the outline, at their Greville abscissae.
  const double radius = 350.0;
  const double bow = std::numbers::pi * radius;
  const auto outline = [&](double s) -> Eigen::RowVector2d {
    if (s < 300.0) return {s, 0.0};
    if (s > 600.0 + bow) return {0.0, 1300.0 + bow - s};
    if (s > 300.0 + bow) return {600.0 + bow - s, 700.0};
    const double angle = (s - 300.0) / radius - 0.5 * std::numbers::pi;
    return {300.0 + radius * std::cos(angle), radius + radius * std::sin(angle)};
  };
  std::vector<double> places;
  const auto add_run = [&](double start, double length, std::size_t times, int parts) {
    places.insert(places.end(), times, start);
    for (int i = 1; i < parts; ++i) places.push_back(start + length * i / parts);
  };
  add_run(0.0, 300.0, 3, 4);
  add_run(300.0, bow, 2, 16);
  add_run(300.0 + bow, 300.0, 2, 4);
  add_run(600.0 + bow, 700.0, 3, 8);
  const KnotVector knots = closed_knots(3, places, 1300.0 + bow);
  Coefficients fine(knots.size(), 2);
  for (Index i = 0; i < knots.size(); ++i) fine.row(i) = outline(std::fmod(greville(knots)[i], knots.period()));

  const NonuniformScheme scheme(knots, most_levels(knots), {.jumps = Jumps::Held});
  REQUIRE(scheme.levels() == 4);
  const NonuniformCurve curve = scheme.decompose(fine);
  CHECK(scheme.knots(0).size() == 10);
  for (int level = 0; level <= 4; ++level) {
    const KnotVector& at = scheme.knots(level);
    const Coefficients points = scheme.points(curve, level);
    CHECK(evaluate(at, points, 0.0) == Eigen::RowVector2d(0.0, 0.0));
    CHECK(evaluate(at, points, 600.0 + bow) == outline(600.0 + bow));
    for (const double corner : {0.0, 600.0 + bow}) {
      const Eigen::RowVectorXd before = evaluate(at, points, corner, 1, Side::Left).normalized();
      const Eigen::RowVectorXd after = evaluate(at, points, corner, 1).normalized();
      CHECK(std::abs(before.dot(after)) < 0.1);  // a right angle, and within 6 degrees of it
    }
    for (const double join : {300.0, 300.0 + bow}) {
      CHECK(jump(at, points, join, 1).norm() < 1e-9);
      CHECK(jump(at, points, join, 2).norm() > 0.5 / radius);  // of 1 / radius
    }
    CHECK(scheme.area(curve, level) == Approx(300.0 * 700.0 + 0.5 * std::numbers::pi * radius * radius).epsilon(0.01));
  }
}

TEST_CASE("knots that are none are refused by value and place", "[nonuniform]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_WITH(open_knots(6, {}), "open_knots: degree 6 is not in 1 to 5");
  CHECK_THROWS_WITH(open_knots(0, {0, 1}), "open_knots: degree 0 is not in 1 to 5");
  CHECK_THROWS_WITH(open_knots(2, {0, 0, 0, 1, 1}), "open_knots: 5 knots; degree 2 takes at least 6");
  CHECK_THROWS_WITH(open_knots(1, {0, 0, 2, 1, 3, 3}), "open_knots: knot 3 is 1, less than 2 before it");
  CHECK_THROWS_WITH(open_knots(1, {0, 0, nan, 3, 3}), "open_knots: knot 2 is nan");
  CHECK_THROWS_WITH(open_knots(1, {0, 0, 1, infinity, infinity}), "open_knots: knot 3 is inf");
  CHECK_THROWS_WITH(open_knots(1, {0, 0, 1, 1, 1, 3, 3}), "open_knots: knot 2, 1, is repeated more than 2 times");
  CHECK_THROWS_WITH(open_knots(2, {0, 0, 1, 2, 3, 3, 3}), "open_knots: the end 0 stands 2 times, not 3");
  CHECK_THROWS_WITH(open_knots(2, {0, 0, 0, 1, 2, 3, 3}), "open_knots: the end 3 stands 2 times, not 3");
  CHECK_THROWS_AS(open_knots(1, {-1e308, -1e308, 1e308, 1e308}), InvalidInput);
  CHECK_THROWS_WITH(closed_knots(3, {0, 1, 2}, 3.0), "closed_knots: 3 knots; degree 3 takes at least 4");
  CHECK_THROWS_WITH(closed_knots(2, {0, 1, 2}, 2.0), "closed_knots: knots from 0 to 2 in a period of 2");
  CHECK_THROWS_WITH(closed_knots(2, {0, 1, 2}, -2.0), "closed_knots: a period of -2");
  CHECK_THROWS_WITH(closed_knots(2, {0, 1, 2}, nan), "closed_knots: a period of nan");
  CHECK_THROWS_WITH(closed_knots(2, {0, 1e-20, 2}, 3.0),
                    "closed_knots: knots 0 and 1 are nearer than a period of 3 can tell");
}

TEST_CASE("points, levels and places that do not fit the knots are refused", "[nonuniform]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const KnotVector knots = whole_knots(3, 8);
  Coefficients fine = random_rows(11, 2, 1);
  CHECK_THROWS_WITH(evaluate(knots, fine.topRows(10), 1.0), "evaluate: 10 control points for knots of 11");
  CHECK_THROWS_WITH(evaluate(knots, fine, 8.5), "evaluate: t = 8.5 on knots from 0 to 8");
  CHECK_THROWS_AS(evaluate(knots, fine, nan), InvalidInput);
  CHECK_THROWS_WITH(evaluate(knots, fine, 1.0, -1), "evaluate: derivative -1");
  CHECK_THROWS_AS(evaluate(closed_knots(1, {0, 1}, 2.0), fine.topRows(2), nan), InvalidInput);
  CHECK_THROWS_AS(bezier_pieces(knots, fine.topRows(10)), InvalidInput);
  CHECK_THROWS_AS(refine(knots, whole_knots(2, 8), fine), InvalidInput);
  CHECK_THROWS_WITH(refine(knots, whole_knots(3, 4), fine),
                    "refine: from degree 3 over [0, 8] to degree 3 over [0, 4]");
  CHECK_THROWS_WITH(refine(knots, make_ladder(knots, 1).levels[0], fine),
                    "refine: knot 1 stands 1 times in the coarse knots, 0 in the fine ones");
  CHECK_THROWS_WITH(most_levels(knots, {2.5}), "most_levels: kept knot 0, 2.5, is not among the knots");
  CHECK_THROWS_WITH(NonuniformScheme(knots, 4),
                    "make_ladder: knots of 11 control points have 0 to 3 levels below them, not 4");
  CHECK_THROWS_AS(NonuniformScheme(knots, -1), InvalidInput);
  CHECK_THROWS_AS(NonuniformScheme(knots, 1, {.kept = {nan}}), InvalidInput);

  const NonuniformScheme scheme(knots, 2);
  CHECK_THROWS_WITH(scheme.knots(3), "knots: level 3 of a scheme with levels 0 to 2");
  CHECK_THROWS_WITH(scheme.decompose(fine.topRows(10)), "decompose: 10 control points for knots of 11");
  NonuniformCurve curve = scheme.decompose(fine);
  CHECK_THROWS_WITH(scheme.fractional(curve, -0.5), "fractional: level -0.5 of a scheme with levels 0 to 2");
  CHECK_THROWS_AS(scheme.fractional(curve, nan), InvalidInput);
  CHECK_THROWS_AS(scheme.points(curve, 3), InvalidInput);
  CHECK_THROWS_AS(scheme.stack(curve, -1), InvalidInput);
  CHECK_THROWS_AS(scheme.apply(Form::Area, 3, fine), InvalidInput);
  CHECK_THROWS_AS(scheme.apply(Form::Area, 1, fine.topRows(9)), InvalidInput);
  CHECK_THROWS_WITH(scheme.area(scheme.decompose(fine.col(0)), 0), "area: control points have 1 columns");
  curve.details[1](2, 1) = nan;
  CHECK_THROWS_WITH(scheme.reconstruct(curve), "reconstruct: details of level 1: point 2, column 1 is nan");
  curve.details[1].conservativeResize(3, 2);
  CHECK_THROWS_WITH(scheme.reconstruct(curve), "reconstruct: details of level 1 are 3×2, not 4×2");
  curve.details.pop_back();
  CHECK_THROWS_WITH(scheme.reconstruct(curve), "reconstruct: 1 levels of details, not 2");
  fine(5, 1) = nan;
  CHECK_THROWS_WITH(scheme.decompose(fine), "decompose: point 5, column 1 is nan");
}
