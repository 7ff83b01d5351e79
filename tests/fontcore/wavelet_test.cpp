#include "fontcore/wavelet.h"

#include <array>
#include <cmath>
#include <limits>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/outline_curve.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr std::array<Scheme, 6> all_schemes = {Scheme::Chaikin,       Scheme::Orthogonal,    Scheme::EndpointQuadratic,
                                               Scheme::EndpointCubic, Scheme::HeldQuadratic, Scheme::HeldCubic};
constexpr std::array<Scheme, 4> open_schemes = {Scheme::EndpointQuadratic, Scheme::EndpointCubic, Scheme::HeldQuadratic,
                                                Scheme::HeldCubic};

// Control points of a curve with `spans` spans.
Eigen::Index points_of_spans(Scheme scheme, Eigen::Index spans) {
  return is_closed(scheme) ? spans : spans + degree(scheme);
}

// n×k numbers up to `size`, the same for the same seed.
Coefficients random_rows(Eigen::Index rows, Eigen::Index columns, unsigned seed, double size = 1000.0) {
  Coefficients values(rows, columns);
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-size, size);
  for (Eigen::Index k = 0; k < columns; ++k) {
    for (Eigen::Index i = 0; i < rows; ++i) values(i, k) = uniform(engine);
  }
  return values;
}

// Control points along a lobed closed path with a slow wobble: what outlines are like.
Coefficients smooth_rows(Eigen::Index rows) {
  Coefficients values(rows, 2);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double a = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(rows);
    values.row(i) << 700.0 * std::cos(a) + 90.0 * std::cos(5.0 * a), 500.0 * std::sin(a) + 40.0 * std::sin(9.0 * a);
  }
  return values;
}

double largest_difference(const Coefficients& a, const Coefficients& b) { return (a - b).cwiseAbs().maxCoeff(); }

}  // namespace

TEST_CASE("every scheme gives control points back, at every size and from every level", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    for (const Eigen::Index coarsest : {1, 2, 3, 4, 5, 6, 7, 9, 12, 13}) {
      if (points_of_spans(scheme, coarsest) < fewest(scheme)) continue;
      for (int levels = 0; levels <= 8; ++levels) {
        const Eigen::Index size = points_of_spans(scheme, coarsest << levels);
        for (const Coefficients& fine : {random_rows(size, 2, static_cast<unsigned>(levels)), smooth_rows(size)}) {
          const MultiresCurve curve = decompose(scheme, fine, levels);
          REQUIRE(curve.coarse.rows() == points_of_spans(scheme, coarsest));
          REQUIRE(largest_difference(reconstruct(curve), fine) <= 1e-12 * fine.cwiseAbs().maxCoeff());
        }
      }
    }
  }
}

TEST_CASE("sixteen thousand points go down to the fewest and come back", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Coefficients fine = random_rows(points_of_spans(scheme, 1 << 14), 2, 7);
    const int levels = most_levels(scheme, fine.rows());
    CHECK(levels == (is_closed(scheme) ? 12 : 14));
    const MultiresCurve curve = decompose(scheme, fine, levels);
    CHECK(curve.coarse.rows() == fewest(scheme));
    CHECK(largest_difference(reconstruct(curve), fine) <= 1e-12 * fine.cwiseAbs().maxCoeff());
  }
}

TEST_CASE("attributes are filtered like x and y, column by column, bit for bit", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Coefficients fine = random_rows(points_of_spans(scheme, 48), 5, 2);
    const Split together = analyze(scheme, fine);
    for (Eigen::Index k = 0; k < fine.cols(); ++k) {
      const Split alone = analyze(scheme, fine.col(k));
      CHECK(together.coarse.col(k) == alone.coarse);
      CHECK(together.detail.col(k) == alone.detail);
      CHECK(synthesize(scheme, together.coarse, together.detail).col(k) ==
            synthesize(scheme, alone.coarse, alone.detail));
    }
  }
}

TEST_CASE("an affine map of the control points maps every level, and leaves shifts out of the details", "[wavelet]") {
  Eigen::Matrix2d linear;
  linear << 0.7, -1.2, 0.4, 1.1;
  const Eigen::RowVector2d shift(310.0, -45.0);
  for (const Scheme scheme : all_schemes) {
    const Coefficients fine = random_rows(points_of_spans(scheme, 40), 2, 12);
    const Coefficients mapped = (fine * linear.transpose()).rowwise() + shift;
    const Split before = analyze(scheme, fine);
    const Split after = analyze(scheme, mapped);
    CHECK(largest_difference(after.coarse, (before.coarse * linear.transpose()).rowwise() + shift) < 1e-9);
    CHECK(largest_difference(after.detail, before.detail * linear.transpose()) < 1e-9);
  }
}

TEST_CASE("an arc run backwards has its control points backwards at every level", "[wavelet]") {
  for (const Scheme scheme : open_schemes) {
    for (const Eigen::Index spans : {2, 4, 6, 8, 10, 12, 14, 40}) {
      const Coefficients fine = random_rows(points_of_spans(scheme, spans), 2, 31);
      const Coefficients coarse = analyze(scheme, fine).coarse;
      const Coefficients backwards = analyze(scheme, fine.colwise().reverse()).coarse;
      CHECK(largest_difference(backwards.colwise().reverse(), coarse) < 1e-9);
    }
  }
}

TEST_CASE("the ends of an arc are its first and last control points, and refinement leaves them there", "[wavelet]") {
  for (const Scheme scheme : open_schemes) {
    const Coefficients coarse = random_rows(points_of_spans(scheme, 5), 2, 9);
    const Coefficients fine = refine(scheme, coarse);
    CHECK(fine.row(0) == coarse.row(0));
    CHECK(fine.bottomRows(1) == coarse.bottomRows(1));
  }
}

TEST_CASE("least squares is nearer to the original than dropping Chaikin's details, at every level", "[wavelet]") {
  for (const Eigen::Index size : {64, 96, 320}) {
    for (const Coefficients& fine : {random_rows(size, 2, 4), random_rows(size, 2, 5), smooth_rows(size)}) {
      const int levels = most_levels(Scheme::Chaikin, size);
      const LevelForm product(Form::Product, Scheme::Chaikin, size, 0);
      for (int down = 1; down <= levels; ++down) {
        const auto distance = [&](Scheme scheme) {
          Coefficients coarse = decompose(scheme, fine, down).coarse;
          for (int level = 0; level < down; ++level) coarse = refine(scheme, coarse);
          const Coefficients gap = coarse - fine;
          return std::sqrt(gap.cwiseProduct(product.apply(gap)).sum());
        };
        CHECK(distance(Scheme::Orthogonal) < distance(Scheme::Chaikin));
      }
    }
  }
}

// The buffers are filtered by vectors as wide as the machine has, the rest by narrower ones, the matrices by none:
// where all agree to the last bit, so do machines.
TEST_CASE("interleaved buffers get the same coefficients as the matrices, to the last bit", "[wavelet]") {
  const auto check = [](const Coefficients& fine, int levels) {
    CAPTURE(fine.rows(), levels);
    const MultiresCurve curve = decompose(Scheme::Chaikin, fine, levels);
    const Eigen::Matrix2Xd interleaved = fine.transpose();
    std::vector<double> out(static_cast<std::size_t>(interleaved.size()));
    std::vector<double> back(out.size());
    std::vector<double> scratch(3 * out.size() / 4);
    chaikin::analyze_into({interleaved.data(), out.size()}, levels, out, scratch);
    CHECK((Eigen::Map<Eigen::Matrix2Xd>(out.data(), 2, fine.rows()).transpose() == stack(curve)));
    chaikin::synthesize_into(out, levels, back, scratch);
    CHECK((Eigen::Map<Eigen::Matrix2Xd>(back.data(), 2, fine.rows()).transpose() == reconstruct(curve)));
  };
  for (const Eigen::Index coarsest : {4, 5, 6, 7}) {
    for (Eigen::Index size = coarsest; size <= 7 << 10; size *= 2) {
      const Coefficients fine = random_rows(size, 2, 77);
      for (int levels = 0; levels <= most_levels(Scheme::Chaikin, size); ++levels) check(fine, levels);
    }
    check(random_rows(coarsest << 15, 2, 78), 15);
  }
}

TEST_CASE("a decomposed control polygon comes back", "[wavelet]") {
  for (const int coarsest : {4, 5, 6, 7, 9}) {
    for (int levels = 0; levels <= 6; ++levels) {
      const Points fine = shapes::random_points(coarsest << levels, static_cast<unsigned>(levels));
      const MultiresCurve curve = decompose(fine, levels);
      CHECK(curve.levels() == levels);
      CHECK(curve.coarse.rows() == coarsest);
      CHECK(shapes::largest_distance(reconstruct(curve), fine) < 1e-11 * std::pow(1.25, levels));
    }
  }
}

TEST_CASE("refinement draws the same curve at the parameters of the finer level", "[wavelet]") {
  const Points coarse = shapes::random_points(6, 3);
  const Points fine = chaikin::refine(chaikin::refine(coarse));
  for (double t = -0.5; t < 24.0; t += 0.37) {
    CHECK((evaluate(Scheme::Chaikin, fine, t) - evaluate(Scheme::Chaikin, coarse, coarser_parameter(t, 2))).norm() <
          1e-11);
    CHECK(finer_parameter(coarser_parameter(t, 5), 5) == Approx(t).margin(1e-12));
  }
  CHECK(limit_area(fine) == Approx(limit_area(coarse)).epsilon(1e-12));
}

TEST_CASE("what refinement adds is no detail", "[wavelet]") {
  const Points coarse = shapes::random_points(8, 4);
  const auto [again, detail] = chaikin::analyze(chaikin::refine(coarse));
  CHECK(shapes::largest_distance(again, coarse) < 1e-12);
  CHECK(detail.cwiseAbs().maxCoeff() < 1e-12);
}

TEST_CASE("analysis is local: a moved control point reaches two coarse points and two details", "[wavelet]") {
  Points fine = Points::Zero(32, 2);
  fine(11, 0) = 1.0;
  const auto [coarse, detail] = chaikin::analyze(fine);
  CHECK((coarse.array() != 0.0).count() == 2);
  CHECK((detail.array() != 0.0).count() == 2);
}

TEST_CASE("polygons that cannot be halved are refused with their size", "[wavelet]") {
  CHECK_THROWS_AS(chaikin::analyze(shapes::random_points(9, 1)), InvalidInput);
  CHECK_THROWS_WITH(chaikin::analyze(shapes::random_points(6, 1)),
                    "chaikin::analyze: 6 control points cannot be halved into at least 4");
  CHECK_THROWS_AS(decompose(shapes::random_points(24, 1), 3), InvalidInput);
  CHECK_THROWS_AS(chaikin::synthesize(Points::Zero(8, 2), Points::Zero(7, 2)), InvalidInput);
}

TEST_CASE("a level between two is continuous, and at whole levels it is the level itself", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Coefficients fine = random_rows(points_of_spans(scheme, 64), 3, 21);
    const MultiresCurve curve = decompose(scheme, fine, 4);
    for (int level = 0; level <= 4; ++level) {
      const Coefficients here = fractional(curve, level);
      CHECK(here == from_level(curve, level).coarse);
      if (level == 4) break;
      const double step = 1e-9;
      const Coefficients above = fractional(curve, level + step);
      CHECK(largest_difference(above, refine(scheme, here)) < 1e-5);
      const Coefficients below_next = fractional(curve, level + 1 - step);
      CHECK(largest_difference(below_next, fractional(curve, level + 1)) < 1e-5);
    }
  }
}

TEST_CASE("a curve edited between two levels has there what was asked, and its finer details", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const MultiresCurve curve = decompose(scheme, random_rows(points_of_spans(scheme, 64), 2, 22), 4);
    for (const double level : {0.0, 0.3, 1.0, 1.5, 2.75, 3.0, 3.9, 4.0}) {
      const Coefficients before = fractional(curve, level);
      Coefficients change = Coefficients::Zero(before.rows(), 2);
      change.row(2) << 30.0, -12.0;
      const MultiresCurve edited = edit_fractional(curve, level, change);
      CHECK(largest_difference(fractional(edited, level), before + change) < 1e-10);
      for (int finer = static_cast<int>(std::ceil(level)); finer < 4; ++finer) {
        CHECK(edited.details[static_cast<std::size_t>(finer)] == curve.details[static_cast<std::size_t>(finer)]);
      }
    }
  }
}

TEST_CASE("sizes, levels and numbers that do not fit are refused by value and place", "[wavelet]") {
  Coefficients fine = random_rows(16, 2, 1);
  CHECK_THROWS_WITH(decompose(Scheme::Orthogonal, fine, 3),
                    "decompose: 16 control points of scheme orthogonal have 0 to 2 levels below them, not 3");
  CHECK_THROWS_WITH(decompose(fine, -1),
                    "decompose: 16 control points of scheme chaikin have 0 to 2 levels below them, not -1");
  CHECK_THROWS_WITH(analyze(Scheme::EndpointCubic, fine),
                    "endpoint_cubic::analyze: 16 control points cannot be halved into at least 4");
  CHECK_THROWS_WITH(endpoint_cubic::analyze(random_rows(4, 2, 1)),
                    "endpoint_cubic::analyze: 4 control points cannot be halved into at least 4");
  CHECK_THROWS_WITH(endpoint_quadratic::synthesize(random_rows(7, 2, 1), random_rows(7, 2, 1)),
                    "endpoint_quadratic::synthesize: 7 control points of 2 columns with 7 details of 2");
  CHECK_THROWS_AS(orthogonal::synthesize(random_rows(8, 2, 1), random_rows(8, 3, 1)), InvalidInput);
  CHECK_THROWS_AS(refine(Scheme::EndpointCubic, random_rows(2, 2, 1)), InvalidInput);
  CHECK_THROWS_AS(adjoint(Scheme::Orthogonal, random_rows(6, 2, 1)), InvalidInput);
  CHECK_THROWS_AS(LevelForm(Form::Area, Scheme::EndpointCubic, 3, 0), InvalidInput);
  CHECK_THROWS_AS(LevelForm(Form::Area, Scheme::Chaikin, 16, 3), InvalidInput);
  CHECK_THROWS_WITH(LevelForm(Form::Area, Scheme::Chaikin, 16, 1).apply(random_rows(15, 1, 1)),
                    "LevelForm::apply: 15 coefficients, not 16");
  const MultiresCurve curve = decompose(fine, 2);
  CHECK_THROWS_WITH(fractional(curve, -0.5), "fractional: level -0.5 of a curve with levels 0 to 2");
  CHECK_THROWS_AS(fractional(curve, 2.01), InvalidInput);
  CHECK_THROWS_AS(fractional(curve, std::numeric_limits<double>::quiet_NaN()), InvalidInput);
  CHECK_THROWS_WITH(area(curve, 3), "from_level: level 3 of a curve with levels 0 to 2");
  CHECK_THROWS_AS(energy(curve, -1), InvalidInput);
  CHECK_THROWS_AS(area(decompose(random_rows(16, 1, 1), 1), 0), InvalidInput);
  CHECK_THROWS_AS(edit_fractional(curve, 1.5, random_rows(8, 2, 1)), InvalidInput);

  std::vector<double> out(32);
  std::vector<double> scratch(24);
  std::vector<double> numbers(32, 1.0);
  CHECK_THROWS_AS(chaikin::analyze_into(numbers, 1, out, std::span(scratch).first(23)), InvalidInput);
  CHECK_THROWS_AS(chaikin::analyze_into(std::span(numbers).first(30), 1, out, scratch), InvalidInput);
  CHECK_THROWS_AS(chaikin::synthesize_into(numbers, 3, out, scratch), InvalidInput);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    fine = random_rows(16, 2, 1);
    fine(5, 1) = bad;
    CHECK_THROWS_WITH(decompose(fine, 2), Catch::Contains("decompose: point 5, column 1 is "));
    for (int levels = 0; levels <= 2; ++levels) {
      std::fill(numbers.begin(), numbers.end(), 1.0);
      numbers[11] = bad;
      CHECK_THROWS_WITH(chaikin::analyze_into(numbers, levels, out, scratch),
                        Catch::Contains("chaikin::analyze_into: point 5, column 1 is "));
    }
  }
}

TEST_CASE("direct manipulation moves the point it is about by what was asked, at every level", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Eigen::Index size = points_of_spans(scheme, 48);
    const MultiresCurve none = decompose(scheme, Coefficients::Zero(size, 1), 3);
    for (const double level : {0.0, 0.3, 1.0, 1.8, 2.5, 3.0}) {
      for (const double t : {0.7, 11.0, 23.4, 40.25}) {
        const MultiresCurve whole = pull(scheme, size, 3, t, level);
        CHECK(evaluate(scheme, reconstruct(whole), t)[0] == Approx(1.0).epsilon(1e-12));

        const MultiresCurve part = pull(scheme, size, 3, t, level, Moved::Fractional);
        const Coefficients seen = level == 0.0 ? part.coarse : fractional(part, level);
        CHECK(evaluate(scheme, seen, coarser_parameter(scheme, t, 3 - static_cast<int>(std::ceil(level))))[0] ==
              Approx(1.0).epsilon(1e-12));
        for (std::size_t finer = static_cast<std::size_t>(std::ceil(level)); finer < 3; ++finer) {
          CHECK(part.details[finer].isZero(0.0));
        }
      }
    }
  }
}

TEST_CASE("the breadth of direct manipulation goes from one level's to the next without a jump", "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Eigen::Index size = points_of_spans(scheme, 64);
    const auto change = [&](double level) { return reconstruct(pull(scheme, size, 4, 20.3, level)); };
    for (double level = 0.0; level < 3.99; level += 0.05) {
      CHECK(largest_difference(change(level), change(level + 1e-6)) < 1e-4);
    }
    const auto norm = [&](double level) { return change(level).norm(); };
    for (double level = 0.0; level < 4.0; level += 1.0) CHECK(norm(level) > norm(level + 1.0));
  }
}

TEST_CASE("the end of a held arc cannot be pulled, and says so", "[wavelet]") {
  CHECK(message_of<InvalidInput>([] { pull(Scheme::HeldCubic, 11, 2, 0.0, 1.5); }) ==
        "held_cubic: the curve is held at parameter 0");
  CHECK(reconstruct(pull(Scheme::HeldCubic, 11, 2, 0.01, 1.5)).row(0).isZero(0.0));
}

TEST_CASE("[FS94] a control point between two levels moves by what was asked, its neighbours the less the finer",
          "[wavelet]") {
  for (const Scheme scheme : all_schemes) {
    const Eigen::Index size = points_of_spans(scheme, 48);
    for (const double level : {0.0, 0.4, 1.0, 1.7, 2.2, 2.95, 3.0}) {
      const MultiresCurve zero = decompose(scheme, Coefficients::Zero(size, 1), 3);
      const Eigen::Index count = (level == 0.0 ? zero.coarse : fractional(zero, level)).rows();
      for (Eigen::Index index = 1; index + 1 < count; index += 3) {
        const MultiresCurve change = pull_control_point(scheme, size, 3, index, level);
        const Coefficients seen = fractional(change, level);
        CHECK(seen(index, 0) == Approx(1.0).epsilon(1e-12));
        Coefficients others = seen;
        others(index, 0) = 0.0;
        if (level == std::floor(level)) CHECK(others.cwiseAbs().maxCoeff() < 1e-12);
      }
    }
    const auto neighbours = [&](double level) {
      Coefficients seen = fractional(pull_control_point(scheme, size, 3, 11, level), level);
      seen(11, 0) = 0.0;
      return seen.norm();
    };
    for (double level = 2.05; level < 2.95; level += 0.1) CHECK(neighbours(level + 0.04) < neighbours(level));
  }
  CHECK_THROWS_AS(pull_control_point(Scheme::Chaikin, 48, 3, 24, 2.0), InvalidInput);
  CHECK(message_of<InvalidInput>([] { pull_control_point(Scheme::HeldCubic, 51, 3, 0, 3.0); }) ==
        "pull_control_point: control point 0 of 51 at level 3 is held");
}
