// The papers' equations, by their numbers.

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "fontcore/measure.h"
#include "fontcore/wavelet.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr std::array<Scheme, 6> all_schemes = {Scheme::Chaikin,       Scheme::Orthogonal,    Scheme::EndpointQuadratic,
                                               Scheme::EndpointCubic, Scheme::HeldQuadratic, Scheme::HeldCubic};
constexpr std::array<Scheme, 3> orthogonal_schemes = {Scheme::Orthogonal, Scheme::EndpointQuadratic,
                                                      Scheme::EndpointCubic};
constexpr std::array<Scheme, 4> open_schemes = {Scheme::EndpointQuadratic, Scheme::EndpointCubic, Scheme::HeldQuadratic,
                                                Scheme::HeldCubic};

Eigen::Index points_of_spans(Scheme scheme, Eigen::Index spans) {
  return is_closed(scheme) ? spans : spans + degree(scheme);
}

// Value or derivative of the B-spline on knots[i] .. knots[i + p + 1], by the recursion of Cox and de Boor: nothing of
// what `wavelet` uses.
double b_spline(const std::vector<double>& knots, std::size_t i, std::size_t p, double t, int derivative) {
  if (p == 0) return derivative == 0 && t >= knots[i] && t < knots[i + 1] ? 1.0 : 0.0;
  const double left = knots[i + p] - knots[i];
  const double right = knots[i + p + 1] - knots[i + 1];
  double value = 0.0;
  const int lower = derivative > 0 ? derivative - 1 : 0;
  if (left > 0.0) {
    const double factor = derivative > 0 ? static_cast<double>(p) : t - knots[i];
    value += factor / left * b_spline(knots, i, p - 1, t, lower);
  }
  if (right > 0.0) {
    const double factor = derivative > 0 ? -static_cast<double>(p) : knots[i + p + 1] - t;
    value += factor / right * b_spline(knots, i + 1, p - 1, t, lower);
  }
  return value;
}

// All basis functions of a level with unit spans at t in [0, spans).
Eigen::RowVectorXd basis(Scheme scheme, Eigen::Index spans, double t, int derivative) {
  const int p = degree(scheme);
  const bool closed = is_closed(scheme);
  std::vector<double> knots;
  for (Eigen::Index i = -p; i <= spans + p; ++i) {
    knots.push_back(static_cast<double>(closed ? i : std::clamp<Eigen::Index>(i, 0, spans)));
  }
  Eigen::RowVectorXd values = Eigen::RowVectorXd::Zero(points_of_spans(scheme, spans));
  for (Eigen::Index i = 0; i < spans + p; ++i) {
    values[i % values.size()] +=
        b_spline(knots, static_cast<std::size_t>(i), static_cast<std::size_t>(p), t, derivative);
  }
  return values;
}

// Integral of an expression of the basis at t: four Gauss points a span, exact to degree 7.
template <typename Integrand>
auto integral(Eigen::Index spans, const Integrand& integrand) {
  constexpr std::array<double, 4> node = {-0.86113631159405257522, -0.33998104358485626480, 0.33998104358485626480,
                                          0.86113631159405257522};
  constexpr std::array<double, 4> weight = {0.34785484513745385737, 0.65214515486254614263, 0.65214515486254614263,
                                            0.34785484513745385737};
  auto sum = (0.0 * integrand(0.0)).eval();
  for (Eigen::Index span = 0; span < spans; ++span) {
    for (std::size_t k = 0; k < 4; ++k) {
      sum += 0.5 * weight[k] * integrand(static_cast<double>(span) + 0.5 + 0.5 * node[k]);
    }
  }
  return sum;
}

Eigen::MatrixXd form_by_quadrature(Form form, Scheme scheme, Eigen::Index spans) {
  return integral(spans, [&](double t) -> Eigen::MatrixXd {
    const Eigen::RowVectorXd f = basis(scheme, spans, t, 0);
    const Eigen::RowVectorXd slope = basis(scheme, spans, t, 1);
    const Eigen::RowVectorXd bend = basis(scheme, spans, t, 2);
    if (form == Form::Product) return f.transpose() * f;
    if (form == Form::Area) return f.transpose() * slope - slope.transpose() * f;
    return 2.0 * bend.transpose() * bend;
  });
}

// The synthesis matrices of [HBS05] eq. 2, column by column, of the level with `spans` coarse spans.
struct Synthesis {
  Eigen::MatrixXd P;
  Eigen::MatrixXd Q;
};
Synthesis synthesis_matrices(Scheme scheme, Eigen::Index spans) {
  const Eigen::Index coarse = points_of_spans(scheme, spans);
  const Eigen::Index details = detail_count(scheme, coarse);
  return {synthesize(scheme, Eigen::MatrixXd::Identity(coarse, coarse), Eigen::MatrixXd::Zero(details, coarse)),
          synthesize(scheme, Eigen::MatrixXd::Zero(coarse, details), Eigen::MatrixXd::Identity(details, details))};
}

std::vector<Eigen::Index> few_spans(Scheme scheme) {
  std::vector<Eigen::Index> spans;
  for (Eigen::Index k = is_closed(scheme) ? 4 : 1; k <= 15; ++k) spans.push_back(k);
  return spans;
}

double largest(const Eigen::MatrixXd& matrix) { return matrix.cwiseAbs().maxCoeff(); }

}  // namespace

TEST_CASE("[HBS05] eq. 7: the analysis filters on numbers worked by hand", "[papers]") {
  Points fine = Points::Zero(8, 2);
  fine.col(0) << 1, 2, 4, 8, 16, 32, 64, 128;
  const auto [coarse, detail] = chaikin::analyze(fine);
  // x_1^{n-1} = (-x_0 + 3 x_1 + 3 x_2 - x_3) / 4 and d_1 = (x_0 - 3 x_1 + 3 x_2 - x_3) / 4.
  CHECK(coarse(1, 0) == (-1 + 3 * 2 + 3 * 4 - 8) / 4.0);
  CHECK(detail(1, 0) == (1 - 3 * 2 + 3 * 4 - 8) / 4.0);
  // Indices are modulo the number of control points.
  CHECK(coarse(0, 0) == (-64 + 3 * 128 + 3 * 1 - 2) / 4.0);
}

TEST_CASE("[HBS05] eq. 8 reconstructs with a minus in its second line, and does not as printed", "[papers]") {
  const Points fine = shapes::random_points(16, 8);
  const auto [c, d] = chaikin::analyze(fine);
  const Eigen::Index m = c.rows();
  Points as_printed(2 * m, 2);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Eigen::Index next = (i + 1) % m;
    as_printed.row(2 * i) = 0.75 * (c.row(i) + d.row(i)) + 0.25 * (c.row(next) - d.row(next));
    as_printed.row(2 * i + 1) = 0.25 * (c.row(i) + d.row(i)) + 0.75 * (c.row(next) + d.row(next));
  }
  CHECK(shapes::largest_distance(as_printed, fine) > 1.0);
  CHECK(shapes::largest_distance(chaikin::synthesize(c, d), fine) < 1e-12);
}

TEST_CASE("[HBS05] eq. 9 and 11: the area of the spline is the bilinear form on its control points", "[papers]") {
  // Green's theorem by the midpoint rule on the curve itself, whose error falls with the square of the step.
  const Points control = shapes::random_points(12, 5);
  const Points polyline = to_polyline(shapes::all_implied(control), 0.5);
  CHECK(limit_area(control) == Approx(signed_area(shapes::polygon([&] {
                                 std::vector<Point> corners;
                                 for (Eigen::Index i = 0; i < polyline.rows(); ++i)
                                   corners.emplace_back(polyline.row(i));
                                 return corners;
                               }())))
                                   .epsilon(1e-5));
}

TEST_CASE("[HBS05] eq. 1 to 4: coarse functions and wavelets are fine functions, and [P | Q] undoes A over B",
          "[papers]") {
  for (const Scheme scheme : all_schemes) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      const auto [P, Q] = synthesis_matrices(scheme, spans);
      const Eigen::Index n = P.rows();
      REQUIRE(P.cols() + Q.cols() == n);
      const Split identity = analyze(scheme, Eigen::MatrixXd::Identity(n, n));
      CHECK(largest(P * identity.coarse + Q * identity.detail - Eigen::MatrixXd::Identity(n, n)) < 1e-13);
      CHECK(largest(identity.coarse * P - Eigen::MatrixXd::Identity(P.cols(), P.cols())) < 1e-13);
      CHECK(largest(identity.detail * P) < 1e-13);
      CHECK(largest(adjoint(scheme, Eigen::MatrixXd::Identity(n, n)).coarse - P.transpose()) < 1e-15);
      CHECK(largest(adjoint(scheme, Eigen::MatrixXd::Identity(n, n)).detail - Q.transpose()) < 1e-15);
      for (double t = 0.06; t < static_cast<double>(spans); t += 0.19) {  // eq. 2: phi^{j-1} = P' phi^j
        CHECK(largest(basis(scheme, 2 * spans, 2.0 * t, 0) * P - basis(scheme, spans, t, 0)) < 1e-13);
      }
    }
  }
}

TEST_CASE("[HBS05] eq. 6: a curve is the sum of its coarse version and of its details at any level", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    const Points fine = shapes::random_points(points_of_spans(scheme, 40), 17);
    const MultiresCurve curve = decompose(scheme, fine, 3);
    for (int level = 0; level <= 3; ++level) {
      MultiresCurve part = from_level(curve, level);
      for (Coefficients& detail : part.details) detail.setZero();
      Coefficients sum = reconstruct(part);
      part.coarse.setZero();
      for (std::size_t k = 0; k < part.details.size(); ++k) {
        part.details[k] = curve.details[static_cast<std::size_t>(level) + k];
        sum += reconstruct(part);
        part.details[k].setZero();
      }
      CHECK(largest(sum - fine) < 1e-10);
    }
  }
}

TEST_CASE("[FS94] wavelets are orthogonal to every coarse function, and coarse curves are least squares", "[papers]") {
  for (const Scheme scheme : orthogonal_schemes) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      const auto [P, Q] = synthesis_matrices(scheme, spans);
      const Eigen::MatrixXd G = form_by_quadrature(Form::Product, scheme, 2 * spans);
      CHECK(largest(P.transpose() * G * Q) < 1e-12);
      const Points fine = shapes::random_points(P.rows(), 3);
      const Split split = analyze(scheme, fine);
      CHECK(largest((P.transpose() * G * P).ldlt().solve(P.transpose() * G * fine) - split.coarse) < 1e-9);
      CHECK(largest((Q.transpose() * G * Q).ldlt().solve(Q.transpose() * G * fine) - split.detail) < 1e-9);
    }
  }
}

TEST_CASE("held arcs: coarse curves are the nearest with the same ends, wavelets vanish there", "[papers]") {
  for (const Scheme scheme : {Scheme::HeldQuadratic, Scheme::HeldCubic}) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      const auto [P, Q] = synthesis_matrices(scheme, spans);
      const Eigen::MatrixXd G = form_by_quadrature(Form::Product, scheme, 2 * spans);
      const Eigen::MatrixXd vanishing = P.middleCols(1, P.cols() - 2);
      CHECK(largest(vanishing.transpose() * G * Q) < 1e-12);
      CHECK(Q.row(0).isZero(0.0));
      CHECK(Q.bottomRows(1).isZero(0.0));
      const Points fine = shapes::random_points(P.rows(), 3);
      const Split split = analyze(scheme, fine);
      CHECK(split.coarse.row(0) == fine.row(0));
      CHECK(split.coarse.bottomRows(1) == fine.bottomRows(1));
      Eigen::MatrixXd rest = fine - P.leftCols(1) * fine.row(0) - P.rightCols(1) * fine.bottomRows(1);
      const Eigen::MatrixXd inner = split.coarse.middleRows(1, split.coarse.rows() - 2);
      CHECK(largest((vanishing.transpose() * G * vanishing).ldlt().solve(vanishing.transpose() * G * rest) - inner) <
            1e-9);
    }
  }
}

TEST_CASE("[FS94] appendix A: P and Q are given by their columns, and the basis by its rows", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      const auto [P, Q] = synthesis_matrices(scheme, spans);
      const auto dense = [&](const FilterColumn& column) {
        Eigen::VectorXd values = Eigen::VectorXd::Zero(P.rows());
        for (std::size_t r = 0; r < column.values.size(); ++r) {
          values[(column.first + static_cast<Eigen::Index>(r)) % P.rows()] += column.values[r];
        }
        return values;
      };
      for (Eigen::Index j = 0; j < P.cols(); ++j)
        CHECK(largest(dense(scaling_column(scheme, P.cols(), j)) - P.col(j)) < 1e-16);
      for (Eigen::Index k = 0; k < Q.cols(); ++k)
        CHECK(largest(dense(wavelet_column(scheme, P.cols(), k)) - Q.col(k)) < 1e-16);
      for (double t = 0.0; t < static_cast<double>(spans); t += 0.13) {
        // The test numbers closed functions by where they start, the library by their middle.
        const BasisRow row = basis_row(scheme, P.cols(), is_closed(scheme) ? t - 0.5 : t);
        Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(P.cols());
        for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
          weights[is_closed(scheme) ? (row.index[k] + 1) % P.cols() : row.index[k]] += row.weight[k];
        }
        CHECK(largest(weights - basis(scheme, spans, t, 0)) < 1e-14);
      }
    }
  }
}

TEST_CASE("[FS94] wavelets have the shortest supports there are", "[papers]") {
  // A wavelet over s fine functions must be orthogonal to all coarse functions that meet them: with one fewer fine
  // function at either end none is left but zero.
  for (const Scheme scheme : open_schemes) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      const auto [P, Q] = synthesis_matrices(scheme, spans);
      const Eigen::Index held = is_held(scheme) ? 1 : 0;
      const Eigen::MatrixXd constraints =
          P.middleCols(held, P.cols() - 2 * held).transpose() * form_by_quadrature(Form::Product, scheme, 2 * spans);
      for (Eigen::Index k = 0; k < Q.cols(); ++k) {
        Eigen::Index first = 0;
        Eigen::Index last = Q.rows() - 1;
        while (Q(first, k) == 0.0) ++first;
        while (Q(last, k) == 0.0) --last;
        const Eigen::MatrixXd shorter = constraints.middleCols(first, last - first);
        CHECK(Eigen::FullPivLU<Eigen::MatrixXd>(shorter).setThreshold(1e-10).rank() == last - first);
        CHECK(last - first + 1 <= 3 * degree(scheme) + 2);
      }
    }
  }
}

TEST_CASE("the printed wavelets of uniform quadratic and cubic B-splines, and their Gram matrix", "[papers]") {
  Eigen::VectorXd quadratic(8);
  quadratic << 1, -29, 147, -303, 303, -147, 29, -1;
  quadratic /= 480.0;
  CHECK(largest(synthesis_matrices(Scheme::Orthogonal, 8).Q.col(3).segment(2, 8) - quadratic) < 1e-16);
  CHECK(largest(synthesis_matrices(Scheme::EndpointQuadratic, 8).Q.col(3).segment(4, 8) - quadratic) < 1e-16);
  Eigen::VectorXd cubic(11);
  cubic << 1, -124, 1677, -7904, 18482, -24264, 18482, -7904, 1677, -124, 1;
  cubic /= 40320.0;
  CHECK(largest(synthesis_matrices(Scheme::EndpointCubic, 12).Q.col(5).segment(7, 11) - cubic) < 1e-16);
  Eigen::RowVectorXd gram(8);
  gram << 1, 26, 66, 26, 1, 0, 0, 0;
  CHECK(largest(120.0 * LevelForm(Form::Product, Scheme::Orthogonal, 8, 0).matrix().row(2) - gram) < 1e-12);
}

TEST_CASE("the wavelets of one end of an arc are those of the other, mirrored", "[papers]") {
  for (const Scheme scheme : open_schemes) {
    const double sign = degree(scheme) == 3 ? 1.0 : -1.0;  // a quadratic wavelet is odd, a cubic one even
    for (const Eigen::Index spans : few_spans(scheme)) {
      const Eigen::MatrixXd Q = synthesis_matrices(scheme, spans).Q;
      CHECK(largest(sign * Q.colwise().reverse().rowwise().reverse() - Q) < 1e-12);
      CHECK(Q.cwiseAbs().colwise().maxCoeff().isConstant(degree(scheme) == 3 ? 24264.0 / 40320.0 : 303.0 / 480.0));
    }
  }
}

TEST_CASE("[HBS05] eq. 10, 13 and 19: mother matrices are the integrals of the basis functions", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    for (const Eigen::Index spans : few_spans(scheme)) {
      for (const Form form : {Form::Product, Form::Area, Form::Energy}) {
        const Eigen::MatrixXd expected = form_by_quadrature(form, scheme, spans);
        const Eigen::MatrixXd M = LevelForm(form, scheme, expected.rows(), 0).matrix();
        // Closed: functions of the test are numbered alike but for a rotation, which circulant matrices do not see.
        CHECK(largest(M - expected) < 1e-12 * largest(expected));
      }
    }
  }
}

TEST_CASE("[HBS05] eq. 14 to 18: matrices of every level by the P and Q filters are those of the functions",
          "[papers]") {
  for (const Scheme scheme : all_schemes) {
    const Eigen::Index size = points_of_spans(scheme, 40);
    for (const Form form : {Form::Product, Form::Area, Form::Energy}) {
      const Eigen::MatrixXd mother = LevelForm(form, scheme, size, 0).matrix();
      Eigen::MatrixXd S = Eigen::MatrixXd::Identity(size, size);  // stacked coefficients to finest control points
      for (int levels = 0; levels <= 3; ++levels) {
        const LevelForm level_form(form, scheme, size, levels);
        const Eigen::MatrixXd M = level_form.matrix();
        CHECK(largest(M - S.transpose() * mother * S) < 1e-12 * largest(mother));
        CHECK(largest(level_form.apply(Eigen::MatrixXd::Identity(size, size)) - M) < 1e-12 * largest(mother));
        if (form == Form::Area) CHECK(largest(M + M.transpose()) < 1e-12);  // eq. 13: skew
        if (form != Form::Area) CHECK(largest(M - M.transpose()) < 1e-12 * largest(mother));
        if (levels == 3) break;
        const Synthesis next = synthesis_matrices(scheme, 40 >> (levels + 1));
        const Eigen::Index rows = next.P.rows();
        Eigen::MatrixXd PQ(rows, rows);
        PQ << next.P, next.Q;
        S.leftCols(rows) = (S.leftCols(rows) * PQ).eval();
      }
    }
  }
}

TEST_CASE("[HBS05] eq. 11 and 19: area and energy are the same from the coefficients of every level", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    for (const Eigen::Index spans : {16, 40, 96}) {
      const Points control = shapes::random_points(points_of_spans(scheme, spans), 23);
      const int levels = most_levels(scheme, control.rows());
      const MultiresCurve curve = decompose(scheme, control, levels);
      const auto at = [&](double t, int derivative) -> Eigen::RowVector2d {
        return basis(scheme, spans, t, derivative) * control;
      };
      const double exact_area = integral(spans, [&](double t) {
        const Eigen::RowVector2d c = at(t, 0);
        const Eigen::RowVector2d slope = at(t, 1);
        return Eigen::Matrix<double, 1, 1>(0.5 * (c.x() * slope.y() - slope.x() * c.y()));
      })(0);
      const double exact_energy =
          integral(spans, [&](double t) { return Eigen::Matrix<double, 1, 1>(at(t, 2).squaredNorm()); })(0);
      // The area is a difference of large terms: to rounding of their sum.
      const double scale = control.rowwise().squaredNorm().sum();
      for (int level = 0; level <= levels; ++level) {
        CHECK(std::abs(area(curve, level) - exact_area) < 1e-12 * scale);
        CHECK(energy(curve, level) == Approx(exact_energy).epsilon(1e-12));
      }
      if (is_closed(scheme)) CHECK(std::abs(limit_area(control) - exact_area) < 1e-12 * scale);
    }
  }
}

TEST_CASE("closed forms: area of the pieces, and energy as the second differences of a closed quadratic", "[papers]") {
  const Points control = shapes::random_points(20, 6);
  const MultiresCurve closed = decompose(Scheme::Orthogonal, control, 2);
  double bend = 0.0;
  for (Eigen::Index i = 0; i < 20; ++i) {
    bend += (control.row(i) - 2.0 * control.row((i + 1) % 20) + control.row((i + 2) % 20)).squaredNorm();
  }
  CHECK(energy(closed, 0) == Approx(bend).epsilon(1e-12));
  CHECK(area(closed, 0) == Approx(signed_area(shapes::all_implied(control))).epsilon(1e-12));

  const MultiresCurve open = decompose(Scheme::EndpointQuadratic, control, 1);  // 18 spans
  double pieces = 0.0;
  for (Eigen::Index i = 0; i < 18; ++i) {
    Bezier piece;
    piece.degree = 2;
    piece.p[0] = i == 0 ? Point(control.row(0)) : Point(0.5 * (control.row(i) + control.row(i + 1)));
    piece.p[1] = control.row(i + 1);
    piece.p[2] = i == 17 ? Point(control.row(19)) : Point(0.5 * (control.row(i + 1) + control.row(i + 2)));
    pieces += signed_area(piece);
  }
  CHECK(area(open, 0) == Approx(pieces).epsilon(1e-12));

  // One span of a cubic arc is one Bezier.
  const Points four = shapes::points_of({{0, 0}, {100, 300}, {420, 310}, {500, -20}});
  Bezier bezier;
  bezier.degree = 3;
  for (std::size_t k = 0; k < 4; ++k) bezier.p[k] = four.row(static_cast<Eigen::Index>(k));
  CHECK(area({four, {}, Scheme::EndpointCubic}, 0) == Approx(signed_area(bezier)).epsilon(1e-13));
}

TEST_CASE("refined polygons tend to the curve's area, a quarter of the error at a time", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    Coefficients polygon = shapes::random_points(points_of_spans(scheme, 12), 40);
    const double exact = area({polygon, {}, scheme}, 0);
    double error = 0.0;
    for (int level = 0; level < 9; ++level) {
      polygon = refine(scheme, polygon);
      double twice_area = 0.0;
      for (Eigen::Index i = 0; i + (is_closed(scheme) ? 0 : 1) < polygon.rows(); ++i) {
        const Eigen::Index next = (i + 1) % polygon.rows();
        twice_area += polygon(i, 0) * polygon(next, 1) - polygon(next, 0) * polygon(i, 1);
      }
      const double before = error;
      error = std::abs(0.5 * twice_area - exact);
      if (level >= 6) CHECK(error == Approx(0.25 * before).epsilon(0.05));
    }
  }
}

TEST_CASE("a refinement multiplies the energy in unit spans by an eighth and keeps the area", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    const Coefficients coarse = shapes::random_points(points_of_spans(scheme, 9), 41);
    const MultiresCurve before{coarse, {}, scheme};
    const MultiresCurve after{refine(scheme, coarse), {}, scheme};
    CHECK(energy(after, 0) == Approx(energy(before, 0) / 8.0).epsilon(1e-12));
    CHECK(area(after, 0) == Approx(area(before, 0)).epsilon(1e-12));
  }
}

TEST_CASE("[FS94] fractional levels: c^{j+t} = P c^j + t Q d^j", "[papers]") {
  for (const Scheme scheme : all_schemes) {
    const MultiresCurve curve = decompose(scheme, shapes::random_points(points_of_spans(scheme, 48), 5), 3);
    for (const double t : {0.1, 0.5, 0.9}) {
      const auto [P, Q] = synthesis_matrices(scheme, 12);
      const Coefficients expected = P * from_level(curve, 1).coarse + t * Q * curve.details[1];
      CHECK(largest(fractional(curve, 1.0 + t) - expected) < 1e-10);
    }
  }
}
