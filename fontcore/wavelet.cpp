#include "fontcore/wavelet.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "fontcore/error.h"

namespace fontcore {

using Eigen::Index;

void require_finite(const char* function, const CoefficientsView& rows) {
  if (rows.allFinite()) return;
  for (Index i = 0; i < rows.rows(); ++i) {
    for (Index k = 0; k < rows.cols(); ++k) {
      if (!std::isfinite(rows(i, k))) {
        throw InvalidInput(text(function, ": point ", i, ", column ", k, " is ", rows(i, k)));
      }
    }
  }
}

namespace {

double binomial(int n, int k) {
  double value = 1.0;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

// Integral over [0, 1] of the product of two Bernstein polynomials; 0 for an index out of range.
double bernstein_product(int n, int i, int m, int j) {
  if (i < 0 || i > n || j < 0 || j > m) return 0.0;
  return binomial(n, i) * binomial(m, j) / (binomial(n + m, i + j) * (n + m + 1));
}

}  // namespace

Eigen::MatrixXd bernstein_form(Form form, int p) {
  const auto slope = [&](int i, int j) {  // of B_i B_j'
    return p * (bernstein_product(p, i, p - 1, j - 1) - bernstein_product(p, i, p - 1, j));
  };
  Eigen::MatrixXd matrix(p + 1, p + 1);
  for (int i = 0; i <= p; ++i) {
    for (int j = 0; j <= p; ++j) {
      switch (form) {
        case Form::Product:
          matrix(i, j) = bernstein_product(p, i, p, j);
          break;
        case Form::Area:
          matrix(i, j) = slope(i, j) - slope(j, i);
          break;
        case Form::Energy: {
          constexpr std::array<int, 3> second_difference = {1, -2, 1};
          double sum = 0.0;
          for (int k = 0; k < 3; ++k) {
            for (int l = 0; l < 3; ++l) {
              sum += second_difference[static_cast<std::size_t>(k)] * second_difference[static_cast<std::size_t>(l)] *
                     bernstein_product(p - 2, i - k, p - 2, j - l);
            }
          }
          matrix(i, j) = 2.0 * p * (p - 1) * p * (p - 1) * sum;
          break;
        }
      }
    }
  }
  return matrix;
}

namespace {

const char* name_of(Scheme scheme) {
  switch (scheme) {
    case Scheme::Chaikin:
      return "chaikin";
    case Scheme::Orthogonal:
      return "orthogonal";
    case Scheme::EndpointQuadratic:
      return "endpoint_quadratic";
    case Scheme::EndpointCubic:
      return "endpoint_cubic";
    case Scheme::HeldQuadratic:
      return "held_quadratic";
    case Scheme::HeldCubic:
      return "held_cubic";
  }
  return "unknown scheme";
}

Index coarser_size(Scheme scheme, Index size) {
  return is_closed(scheme) ? size / 2 : (size - degree(scheme)) / 2 + degree(scheme);
}

bool can_halve(Scheme scheme, Index size) {
  const Index spans = detail_count(scheme, size);
  return spans > 0 && spans % 2 == 0 && coarser_size(scheme, size) >= fewest(scheme);
}

void require_halvable(Scheme scheme, const char* function, Index size) {
  if (!can_halve(scheme, size)) {
    throw InvalidInput(text(name_of(scheme), "::", function, ": ", size,
                            " control points cannot be halved into at least ", fewest(scheme)));
  }
}

void require_levels(Scheme scheme, const char* function, Index size, int levels) {
  const int most = most_levels(scheme, size);
  if (levels < 0 || levels > most) {
    throw InvalidInput(text(function, ": ", size, " control points of scheme ", name_of(scheme), " have 0 to ", most,
                            " levels below them, not ", levels));
  }
}

// ---- Closed curves. Kernels work on one column; buffers must not overlap.

// [HBS05] eq. 7 with its sums shared: A = (3 x_{2i} - x_{2i+1}) / 4, B = (3 x_{2i+1} - x_{2i}) / 4 are x less the
// quarter of their sum; coarse_i = A_i + B_{i-1}, detail_i = A_i - B_{i-1}. `previous` is B_{i-1}.
void split_chaikin(const double* fine, Index m, double* coarse, double* detail) {
  double previous = fine[2 * m - 1] - 0.25 * (fine[2 * m - 2] + fine[2 * m - 1]);
  for (Index i = 0; i < m; ++i) {
    const double quarter = 0.25 * (fine[2 * i] + fine[2 * i + 1]);
    const double A = fine[2 * i] - quarter;
    coarse[i] = A + previous;
    detail[i] = A - previous;
    previous = fine[2 * i + 1] - quarter;
  }
}

// [HBS05] eq. 8, corrected: x_{2i} and x_{2i+1} from here = c_i + d_i and there = c_{i+1} - d_{i+1}:
// a quarter of the way from one to the other.
void merge_chaikin(const double* coarse, const double* detail, Index m, double* fine) {
  for (Index i = 0; i < m; ++i) {
    const Index next = i + 1 == m ? 0 : i + 1;
    const double here = coarse[i] + detail[i];
    const double there = coarse[next] - detail[next];
    const double quarter = 0.25 * (there - here);
    fine[2 * i] = here + quarter;
    fine[2 * i + 1] = there - quarter;
  }
}

Index wrapped(Index i, Index size) { return i < 0 ? i + size : i >= size ? i - size : i; }

void adjoint_chaikin(const double* fine, Index m, double* coarse, double* detail) {
  for (Index i = 0; i < m; ++i) {
    const double a = fine[wrapped(2 * i - 2, 2 * m)];
    const double b = fine[wrapped(2 * i - 1, 2 * m)];
    const double c = fine[2 * i];
    const double d = fine[2 * i + 1];
    coarse[i] = 0.25 * (a + 3.0 * b + 3.0 * c + d);
    detail[i] = 0.25 * (-a - 3.0 * b + 3.0 * c + d);
  }
}

// Wavelet i of `orthogonal` over the fine points 2i - 4 .. 2i + 3.
constexpr std::array<double, 8> quadratic_wavelet = {1.0 / 480,   -29.0 / 480,  147.0 / 480, -303.0 / 480,
                                                     303.0 / 480, -147.0 / 480, 29.0 / 480,  -1.0 / 480};

// Solves x_{i-2} + 26 x_{i-1} + 66 x_i + 26 x_{i+1} + x_{i+2} = 60 b_i, indices modulo m, in place: twice the Gram
// matrix, of the coarse B-splines in fine spans. Its symbol has the roots z and 1/z of z + 1/z = -13 ± sqrt(105): two
// recursions forward and two backward. The periodic solution is met by starting `warm_up` points ahead, from zero.
void solve_gram(double* b, Index m) {
  constexpr Index warm_up = 64;  // the slower root to this power is 4e-24
  constexpr double z1 = -0.430575347099973791851;
  constexpr double z2 = -0.0430962882032646538227;
  constexpr double scale = 60.0 * z1 * z2;
  double slow = 0.0;
  double both = 0.0;
  const auto step = [&](double value) {
    slow = value + z1 * slow;
    both = slow + z2 * both;
  };
  for (Index k = warm_up; k > 0; --k) step(b[((m - k) % m + m) % m]);
  for (Index i = 0; i < m; ++i) {
    step(b[i]);
    b[i] = both;
  }
  slow = both = 0.0;
  for (Index k = warm_up; k > 0; --k) step(b[(k - 1) % m]);
  for (Index i = m - 1; i >= 0; --i) {
    step(b[i]);
    b[i] = both;
  }
  for (Index i = 0; i < m; ++i) b[i] *= scale;
}

// With B and A Chaikin's filters: B fine = B Q d, where B Q is the matrix of `solve_gram`, and c = A fine - A Q d, A Q
// being 41/120 between neighbours and 1/60 between their neighbours, skew.
void split_orthogonal(const double* fine, Index m, double* coarse, double* detail) {
  split_chaikin(fine, m, coarse, detail);
  solve_gram(detail, m);
  const auto lift = [&](Index i, Index before2, Index before, Index after, Index after2) {
    coarse[i] -= 41.0 / 120.0 * (detail[after] - detail[before]) + 1.0 / 60.0 * (detail[after2] - detail[before2]);
  };
  const auto lift_wrapped = [&](Index i) {
    lift(i, wrapped(i - 2, m), wrapped(i - 1, m), wrapped(i + 1, m), wrapped(i + 2, m));
  };
  lift_wrapped(0);
  lift_wrapped(1);
  for (Index i = 2; i < m - 2; ++i) lift(i, i - 2, i - 1, i + 1, i + 2);
  lift_wrapped(m - 2);
  lift_wrapped(m - 1);
}

void merge_orthogonal(const double* coarse, const double* detail, Index m, double* fine) {
  const auto& q = quadratic_wavelet;
  const auto merge = [&](Index i, Index before, Index after, Index after2) {
    const double c = coarse[i];
    const double c_after = coarse[after];
    fine[2 * i] = 0.75 * c + 0.25 * c_after + q[6] * detail[before] + q[4] * detail[i] + q[2] * detail[after] +
                  q[0] * detail[after2];
    fine[2 * i + 1] = 0.25 * c + 0.75 * c_after + q[7] * detail[before] + q[5] * detail[i] + q[3] * detail[after] +
                      q[1] * detail[after2];
  };
  merge(0, m - 1, 1, 2);
  for (Index i = 1; i < m - 2; ++i) merge(i, i - 1, i + 1, i + 2);
  merge(m - 2, m - 3, m - 1, 0);
  merge(m - 1, m - 2, 0, 1);
}

void adjoint_orthogonal(const double* fine, Index m, double* coarse, double* detail) {
  adjoint_chaikin(fine, m, coarse, detail);
  for (Index i = 0; i < m; ++i) {
    double sum = 0.0;
    for (Index k = 0; k < 8; ++k)
      sum += quadratic_wavelet[static_cast<std::size_t>(k)] * fine[wrapped(2 * i - 4 + k, 2 * m)];
    detail[i] = sum;
  }
}

// ---- Pieces of B-splines, and integrals over them.

// Weights of control points e .. e + p in the polar form, at p arguments, of span e of `spans` unit spans with knots of
// full multiplicity at both ends (de Boor's algorithm).
std::array<double, 4> polar_weights(int p, Index spans, Index e, std::span<const double> arguments) {
  const auto knot = [&](Index i) { return static_cast<double>(std::clamp<Index>(i - p, 0, spans)); };
  std::array<std::array<double, 4>, 4> points{};
  for (std::size_t i = 0; i < points.size(); ++i) points[i][i] = 1.0;
  for (int r = 1; r <= p; ++r) {
    for (int i = p; i >= r; --i) {
      const double low = knot(e + i);
      const double high = knot(e + i + p - r + 1);
      const double a = (arguments[static_cast<std::size_t>(r - 1)] - low) / (high - low);
      auto& point = points[static_cast<std::size_t>(i)];
      const auto& before = points[static_cast<std::size_t>(i - 1)];
      for (std::size_t k = 0; k < 4; ++k) point[k] = (1.0 - a) * before[k] + a * point[k];
    }
  }
  return points[static_cast<std::size_t>(p)];
}

// The same at p equal arguments: the basis functions, by rising degree.
std::array<double, 4> open_basis(int p, Index spans, Index e, double t) {
  std::array<double, 4> weight{1.0, 0.0, 0.0, 0.0};
  std::array<double, 4> before{};  // from knots to the left of the span
  std::array<double, 4> after{};
  for (std::size_t r = 1; r <= static_cast<std::size_t>(p); ++r) {
    before[r] = t - static_cast<double>(std::max<Index>(e + 1 - static_cast<Index>(r), 0));
    after[r] = static_cast<double>(std::min<Index>(e + static_cast<Index>(r), spans)) - t;
    double rest = 0.0;
    for (std::size_t k = 0; k < r; ++k) {
      const double share = weight[k] / (after[k + 1] + before[r - k]);
      weight[k] = rest + after[k + 1] * share;
      rest = before[r - k] * share;
    }
    weight[r] = rest;
  }
  return weight;
}

// The form on control points e .. e + p over span e.
Eigen::MatrixXd make_span_form(const Eigen::MatrixXd& bernstein, int p, Index spans, Index e) {
  Eigen::MatrixXd to_bezier(p + 1, p + 1);
  for (int k = 0; k <= p; ++k) {
    std::array<double, 3> arguments{};
    arguments.fill(static_cast<double>(e));
    for (int r = 0; r < k; ++r) arguments[static_cast<std::size_t>(p - 1 - r)] += 1.0;
    const auto weights = polar_weights(p, spans, e, arguments);
    for (int i = 0; i <= p; ++i) to_bezier(k, i) = weights[static_cast<std::size_t>(i)];
  }
  return to_bezier.transpose() * bernstein * to_bezier;
}

// A span is like all others that have as many spans before and after them, up to the degree.
class SpanForms {
 public:
  SpanForms(Form form, int p) : p_(p) {
    const Eigen::MatrixXd bernstein = bernstein_form(form, p);
    for (Index before = 0; before <= p; ++before) {
      for (Index after = 0; after <= p; ++after) {
        Eigen::Matrix4d& local = forms_.emplace_back(Eigen::Matrix4d::Zero());
        local.topLeftCorner(p + 1, p + 1) = make_span_form(bernstein, p, before + after + 1, before);
      }
    }
  }
  const Eigen::Matrix4d& at(Index before, Index after) const {
    return forms_[static_cast<std::size_t>(std::min<Index>(before, p_) * (p_ + 1) + std::min<Index>(after, p_))];
  }

 private:
  int p_;
  std::vector<Eigen::Matrix4d> forms_;
};

const Eigen::Matrix4d& span_form(Form form, int p, bool closed, Index spans, Index e) {
  static const std::array<SpanForms, 6> forms = {SpanForms(Form::Product, 2), SpanForms(Form::Area, 2),
                                                 SpanForms(Form::Energy, 2),  SpanForms(Form::Product, 3),
                                                 SpanForms(Form::Area, 3),    SpanForms(Form::Energy, 3)};
  const SpanForms& all = forms[static_cast<std::size_t>(form) + (p == 3 ? 3 : 0)];
  return closed ? all.at(p, p) : all.at(e, spans - 1 - e);
}

// Row i holds the entries of columns i - p .. i + p, indices modulo `size` if closed.
Eigen::MatrixXd banded_form(Form form, int p, bool closed, Index size) {
  const Index spans = closed ? size : size - p;
  Eigen::MatrixXd band = Eigen::MatrixXd::Zero(size, 2 * p + 1);
  for (Index e = 0; e < spans; ++e) {
    const Eigen::Matrix4d& local = span_form(form, p, closed, spans, e);
    for (int i = 0; i <= p; ++i) {
      for (int j = 0; j <= p; ++j) band(wrapped(e + i, size), p + j - i) += local(i, j);
    }
  }
  return band;
}

Coefficients apply_band(const Eigen::MatrixXd& band, bool closed, const CoefficientsView& x) {
  const Index n = band.rows();
  const Index p = band.cols() / 2;
  Coefficients product = Coefficients::Zero(n, x.cols());
  for (Index k = 0; k < x.cols(); ++k) {
    for (Index s = -p; s <= p; ++s) {
      const Index from = std::max<Index>(0, -s);
      const Index count = std::max<Index>(0, n - std::abs(s));
      product.col(k).segment(from, count).array() +=
          band.col(p + s).segment(from, count).array() * x.col(k).segment(from + s, count).array();
    }
    if (!closed) continue;
    for (Index s = 1; s <= p; ++s) {
      for (Index i = 0; i < s; ++i) {
        product(i, k) += band(i, p - s) * x(n + i - s, k);
        product(n - 1 - i, k) += band(n - 1 - i, p + s) * x(s - 1 - i, k);
      }
    }
  }
  return product;
}

// ---- Open arcs: endpoint-interpolating B-splines of degree p on K coarse and 2K fine spans.
//
// Column j of P reaches over the fine rows max(j, 2j - p) .. min(K + j, 2j + 1); wavelet k over max(k, 2k - p) ..
// min(K + p + k, 2p + 2k + 1): one row more than coarse functions it must be orthogonal to, which is the least, and so
// unique up to its factor. With held ends the first and last rows and coarse functions drop out, and the wavelets at
// the ends become as much shorter. K = 2 * end_wavelets is the first K at which one end knows nothing of the other.

template <int p>
struct Inner;
template <>
struct Inner<2> {
  static constexpr std::array<double, 4> scaling = {0.25, 0.75, 0.75, 0.25};
  static constexpr std::array<double, 8> wavelet = quadratic_wavelet;
};
template <>
struct Inner<3> {
  static constexpr std::array<double, 5> scaling = {0.125, 0.5, 0.75, 0.5, 0.125};
  static constexpr std::array<double, 11> wavelet = {
      1.0 / 40320,     -124.0 / 40320,  1677.0 / 40320, -7904.0 / 40320, 18482.0 / 40320, -24264.0 / 40320,
      18482.0 / 40320, -7904.0 / 40320, 1677.0 / 40320, -124.0 / 40320,  1.0 / 40320};
};

enum class ArcEnds { Free, Held };

template <int p, ArcEnds arc_ends>
class EndpointLevel {
 public:
  explicit EndpointLevel(Index spans) : K_(spans) {}

  FilterColumn scaling(Index j) const {
    const Index beyond = is_long() ? j - p : -1;  // inner ones from 0 to K - p - 1
    if (beyond >= 0 && beyond < K_ - p) return {2 * j - p, Inner<p>::scaling};
    return stored(ends().P, j, beyond < 0 ? j : j - (K_ - 2 * end_wavelets));
  }
  FilterColumn wavelet(Index k) const {
    const Index beyond = is_long() ? k - end_wavelets : -1;
    if (beyond >= 0 && beyond < K_ - 2 * end_wavelets) return {2 * k - p, Inner<p>::wavelet};
    return stored(ends().Q, k, beyond < 0 ? k : k - (K_ - 2 * end_wavelets));
  }

  Coefficients merge(const CoefficientsView& coarse, const CoefficientsView& detail) const {
    Coefficients fine(2 * K_ + p, coarse.cols());
    for (Index c = 0; c < coarse.cols(); ++c) {
      double* x = fine.col(c).data();
      Index cleared = 0;
      for (Index j = 0; j < K_; ++j) {  // all side by side, so that x is passed through once
        for (; cleared < std::min(2 * K_ + p, 2 * (p + j + 1)); ++cleared) x[cleared] = 0.0;
        add(scaling(j), coarse(j, c), x);
        add(wavelet(j), detail(j, c), x);
      }
      for (Index j = K_; j < K_ + p; ++j) add(scaling(j), coarse(j, c), x);
    }
    return fine;
  }

  Split adjoint(const CoefficientsView& fine) const {
    Split split{Coefficients(K_ + p, fine.cols()), Coefficients(K_, fine.cols())};
    for (Index c = 0; c < fine.cols(); ++c) {
      const double* x = fine.col(c).data();
      for (Index j = 0; j < K_ + p; ++j) split.coarse(j, c) = dot(scaling(j), x);
      for (Index k = 0; k < K_; ++k) split.detail(k, c) = dot(wavelet(k), x);
    }
    return split;
  }

  // [FS94] appendix B: with its columns interleaved, [P | Q] is banded. Gaussian elimination with row exchanges on a
  // window of below + 1 rows; the right-hand sides go along, and every finished row of U is kept for the way back.
  Split split(const CoefficientsView& fine) const {
    const Index n = 2 * K_ + p;
    const Index columns = fine.cols();
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> x(n + width - 1, columns);
    x.topRows(n) = fine;
    x.bottomRows(width - 1).setZero();
    const auto upper = std::make_unique_for_overwrite<Row[]>(static_cast<std::size_t>(n));
    std::array<Row, static_cast<std::size_t>(below + 1)> window{};
    const std::array<Row, 2> inner = {matrix_row(inner_start(), inner_start() - below),
                                      matrix_row(inner_start() + 1, inner_start() + 1 - below)};
    const auto next_row = [&](Index i) {
      const bool is_inner = i >= inner_start() && i < inner_end();
      return is_inner ? inner[static_cast<std::size_t>((i - inner_start()) % 2)] : matrix_row(i, i - below);
    };

    for (Index i = 0; i <= std::min<Index>(below, n - 1); ++i) window[static_cast<std::size_t>(i)] = matrix_row(i, 0);
    for (Index j = 0; j < n; ++j) {
      const std::size_t rows = static_cast<std::size_t>(std::min<Index>(below, n - 1 - j));
      std::size_t pivot = 0;
      for (std::size_t r = 1; r <= rows; ++r) {
        if (std::abs(window[r][0]) > std::abs(window[pivot][0])) pivot = r;
      }
      if (pivot != 0) {
        std::swap(window[0], window[pivot]);
        x.row(j).swap(x.row(j + static_cast<Index>(pivot)));
      }
      const Row top = window[0];
      upper[static_cast<std::size_t>(j)] = top;
      const double inverse = 1.0 / top[0];
      double* right = x.row(j).data();
      for (std::size_t r = 1; r <= rows; ++r) {
        const double factor = window[r][0] * inverse;
        for (std::size_t c = 1; c < width; ++c) window[r - 1][c - 1] = window[r][c] - factor * top[c];
        window[r - 1][width - 1] = 0.0;
        double* below_right = right + static_cast<Index>(r) * columns;
        for (Index c = 0; c < columns; ++c) below_right[c] -= factor * right[c];
      }
      if (j + below + 1 < n) window[below] = next_row(j + below + 1);
    }
    for (Index j = n - 1; j >= 0; --j) {
      const Row& row = upper[static_cast<std::size_t>(j)];
      double* right = x.row(j).data();
      for (Index c = 0; c < columns; ++c) {
        double sum = right[c];
        for (Index k = 1; k < width; ++k) sum -= row[static_cast<std::size_t>(k)] * right[k * columns + c];
        right[c] = sum / row[0];
      }
    }

    Split split{Coefficients(K_ + p, columns), Coefficients(K_, columns)};
    for (Index j = 0; j < K_ + p; ++j) split.coarse.row(j) = x.row(std::max(j, std::min(2 * j - ahead, j + K_)));
    for (Index k = 0; k < K_; ++k) split.detail.row(k) = x.row(2 * k + ahead + 1);
    if (held == 1) {  // to the last bit
      split.coarse.row(0) = fine.row(0);
      split.coarse.row(K_ + p - 1) = fine.row(n - 1);
    }
    return split;
  }

 private:
  static constexpr Index held = arc_ends == ArcEnds::Held ? 1 : 0;  // rows and coarse functions left out at each end
  static constexpr Index end_wavelets = p + held;                   // that differ from the inner ones, at each end

  bool is_long() const { return K_ > 2 * end_wavelets; }

  // Interleaved order c_0 .. c_ahead, d_0, c_{ahead+1}, d_1, ..., then the last c's; reach of the rows in it.
  static constexpr Index ahead = p / 2;
  static constexpr Index below = 2 * p - ahead;
  static constexpr Index above = p + ahead + 1;
  static constexpr Index width = below + above + 1;
  using Row = std::array<double, static_cast<std::size_t>(width)>;

  struct Entry {
    Index first;
    std::vector<double> values;
  };
  // All columns of P and Q for one K up to 2 * end_wavelets; those at the ends are the same for every larger K.
  struct Ends {
    std::vector<Entry> P;
    std::vector<Entry> Q;
  };

  const Ends& ends() const {
    static const AllEnds all = make_ends();
    return all[static_cast<std::size_t>(std::min<Index>(K_, 2 * end_wavelets) - 1)];
  }

  static FilterColumn stored(const std::vector<Entry>& columns, Index index, Index stored_index) {
    const Entry& entry = columns[static_cast<std::size_t>(stored_index)];
    return {entry.first + 2 * (index - stored_index), entry.values};
  }

  using AllEnds = std::array<Ends, static_cast<std::size_t>(2 * end_wavelets)>;
  static AllEnds make_ends() {
    AllEnds all;
    for (Index K = 1; K <= 2 * end_wavelets; ++K) all[static_cast<std::size_t>(K - 1)] = make_ends(K);
    return all;
  }

  static Ends make_ends(Index K) {
    const Index n = 2 * K + p;
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(n, K + p);
    for (Index i = 0; i < n; ++i) {
      std::vector<double> arguments;  // fine control point i is the polar form at its p fine knots
      for (Index r = 1; r <= p; ++r) {
        arguments.push_back(0.5 * static_cast<double>(std::clamp<Index>(i + r - p, 0, 2 * K)));
      }
      const Index span = std::max<Index>(i - p, 0) / 2;
      const auto weights = polar_weights(p, K, span, arguments);
      for (int k = 0; k <= p; ++k) P(i, span + k) = weights[static_cast<std::size_t>(k)];
    }
    const Eigen::MatrixXd band = banded_form(Form::Product, p, false, n);
    const Eigen::MatrixXd constraints =  // P'G: the Gram matrix is symmetric
        apply_band(band, false, P.middleCols(held, K + p - 2 * held)).transpose();

    Ends ends;
    for (Index j = 0; j < K + p; ++j) {
      const Index first = std::max(j, 2 * j - p);
      const Eigen::VectorXd values = P.col(j).segment(first, std::min(K + j, 2 * j + 1) - first + 1);
      ends.P.push_back({first, {values.begin(), values.end()}});
    }
    for (Index k = 0; k < K; ++k) {
      const Index first = std::max(k + held, 2 * k - p);
      const Index size = std::min(K + p + k - held, 2 * p + 2 * k + 1) - first + 1;
      Eigen::FullPivLU<Eigen::MatrixXd> solver(constraints.middleCols(first, size));
      solver.setThreshold(1e-10);  // of the largest pivot: the rank is size - 1, by total positivity
      Eigen::VectorXd values = solver.kernel().col(0);
      // Scale and signs as inside, and the right end a mirror of the left: first positive there, or last (-1)^(p+1).
      const double inside = Eigen::Map<const Eigen::ArrayXd>(Inner<p>::wavelet.data(), 3 * p + 2).abs().maxCoeff();
      const double end = 2 * k < K ? values[0] : (p % 2 == 0 ? -1.0 : 1.0) * values[size - 1];
      values *= std::copysign(inside, end) / values.cwiseAbs().maxCoeff();
      ends.Q.push_back({first, {values.begin(), values.end()}});
    }
    return ends;
  }

  static void add(const FilterColumn& column, double amount, double* x) {
    double* const at = x + column.first;
    for (std::size_t r = 0; r < column.values.size(); ++r) at[r] += column.values[r] * amount;
  }
  static double dot(const FilterColumn& column, const double* x) {
    double sum = 0.0;
    for (std::size_t r = 0; r < column.values.size(); ++r)
      sum += column.values[r] * x[column.first + static_cast<Index>(r)];
    return sum;
  }

  // Rows all of whose columns are inner ones; empty on few spans.
  Index inner_start() const { return 2 * end_wavelets + ahead + 1 + below; }
  Index inner_end() const { return 2 * (K_ - end_wavelets) - above; }

  // Entries of row i of the interleaved [P | Q] from column `from` on: of all columns of P and Q that reach it.
  // Not inlined: g++ 12.2 -O3 specialises it for from = 0 and then loses the inner wavelets (papers_test sees it).
  [[gnu::noinline]] Row matrix_row(Index i, Index from) const {
    Row row{};
    const auto put = [&](Index position, const FilterColumn& column) {
      const Index r = i - column.first;
      if (r < 0 || r >= std::ssize(column.values)) return;
      row[static_cast<std::size_t>(position - from)] = column.values[static_cast<std::size_t>(r)];
    };
    const Index last = std::min(i, (i + p) / 2);
    for (Index j = i / 2; j <= std::min(last, K_ + p - 1); ++j)
      put(std::max(j, std::min(2 * j - ahead, j + K_)), scaling(j));
    for (Index k = std::max<Index>(0, i / 2 - p); k <= std::min(last, K_ - 1); ++k) put(2 * k + ahead + 1, wavelet(k));
    return row;
  }

  Index K_;
};

// ---- One level of any scheme, its arguments checked.

using Kernel = void (*)(const double* fine, Index m, double* coarse, double* detail);

Split split_columns(Kernel kernel, const CoefficientsView& fine) {
  const Index m = fine.rows() / 2;
  Split split{Coefficients(m, fine.cols()), Coefficients(m, fine.cols())};
  for (Index k = 0; k < fine.cols(); ++k) {
    kernel(fine.col(k).data(), m, split.coarse.col(k).data(), split.detail.col(k).data());
  }
  return split;
}

// Calls `work` with the level of an endpoint scheme that has `spans` coarse spans.
template <typename Work>
auto at_endpoint_level(Scheme scheme, Index spans, const Work& work) {
  switch (scheme) {
    case Scheme::EndpointQuadratic:
      return work(EndpointLevel<2, ArcEnds::Free>(spans));
    case Scheme::HeldQuadratic:
      return work(EndpointLevel<2, ArcEnds::Held>(spans));
    case Scheme::HeldCubic:
      return work(EndpointLevel<3, ArcEnds::Held>(spans));
    default:
      return work(EndpointLevel<3, ArcEnds::Free>(spans));
  }
}

Split split_level(Scheme scheme, const CoefficientsView& fine) {
  if (scheme == Scheme::Chaikin) return split_columns(split_chaikin, fine);
  if (scheme == Scheme::Orthogonal) return split_columns(split_orthogonal, fine);
  return at_endpoint_level(scheme, (fine.rows() - degree(scheme)) / 2,
                           [&](const auto& level) { return level.split(fine); });
}

Split adjoint_level(Scheme scheme, const CoefficientsView& fine) {
  if (scheme == Scheme::Chaikin) return split_columns(adjoint_chaikin, fine);
  if (scheme == Scheme::Orthogonal) return split_columns(adjoint_orthogonal, fine);
  return at_endpoint_level(scheme, (fine.rows() - degree(scheme)) / 2,
                           [&](const auto& level) { return level.adjoint(fine); });
}

Coefficients merge_level(Scheme scheme, const CoefficientsView& coarse, const CoefficientsView& detail) {
  if (!is_closed(scheme)) {
    return at_endpoint_level(scheme, detail.rows(), [&](const auto& level) { return level.merge(coarse, detail); });
  }
  const auto kernel = scheme == Scheme::Chaikin ? merge_chaikin : merge_orthogonal;
  Coefficients fine(2 * coarse.rows(), coarse.cols());
  for (Index k = 0; k < coarse.cols(); ++k) {
    kernel(coarse.col(k).data(), detail.col(k).data(), coarse.rows(), fine.col(k).data());
  }
  return fine;
}

}  // namespace

int most_levels(Scheme scheme, Index size) {
  int levels = 0;
  for (; can_halve(scheme, size); size = coarser_size(scheme, size)) ++levels;
  return levels;
}

Split analyze(Scheme scheme, const CoefficientsView& fine) {
  require_halvable(scheme, "analyze", fine.rows());
  require_finite("analyze", fine);
  return split_level(scheme, fine);
}

namespace {

void require_detail(Scheme scheme, const CoefficientsView& coarse, const CoefficientsView& detail) {
  if (coarse.rows() < fewest(scheme) || detail.rows() != detail_count(scheme, coarse.rows()) ||
      detail.cols() != coarse.cols()) {
    throw InvalidInput(text(name_of(scheme), "::synthesize: ", coarse.rows(), " control points of ", coarse.cols(),
                            " columns with ", detail.rows(), " details of ", detail.cols()));
  }
  require_finite("synthesize: details", detail);
}

}  // namespace

Coefficients synthesize(Scheme scheme, const CoefficientsView& coarse, const CoefficientsView& detail) {
  require_detail(scheme, coarse, detail);
  require_finite("synthesize: control points", coarse);
  return merge_level(scheme, coarse, detail);
}

Coefficients refine(Scheme scheme, const CoefficientsView& coarse) {
  const Index details = std::max<Index>(0, detail_count(scheme, coarse.rows()));
  return synthesize(scheme, coarse, Coefficients::Zero(details, coarse.cols()));
}

Split adjoint(Scheme scheme, const CoefficientsView& fine) {
  require_halvable(scheme, "adjoint", fine.rows());
  require_finite("adjoint", fine);
  return adjoint_level(scheme, fine);
}

namespace {

constexpr std::array<double, 4> chaikin_scaling = {0.25, 0.75, 0.75, 0.25};
constexpr std::array<double, 4> chaikin_wavelet = {-0.25, -0.75, 0.75, 0.25};

void require_column(const char* function, Scheme scheme, Index size, Index index, Index count) {
  if (size < fewest(scheme) || index < 0 || index >= count) {
    throw InvalidInput(
        text(name_of(scheme), "::", function, ": column ", index, " of a level of ", size, " control points"));
  }
}

}  // namespace

FilterColumn scaling_column(Scheme scheme, Index size, Index j) {
  require_column("scaling_column", scheme, size, j, size);
  if (is_closed(scheme)) return {wrapped(2 * j - 2, 2 * size), chaikin_scaling};
  return at_endpoint_level(scheme, detail_count(scheme, size), [&](const auto& level) { return level.scaling(j); });
}

FilterColumn wavelet_column(Scheme scheme, Index size, Index k) {
  require_column("wavelet_column", scheme, size, k, detail_count(scheme, size));
  if (scheme == Scheme::Chaikin) return {wrapped(2 * k - 2, 2 * size), chaikin_wavelet};
  if (scheme == Scheme::Orthogonal) return {wrapped(2 * k - 4, 2 * size), quadratic_wavelet};
  return at_endpoint_level(scheme, detail_count(scheme, size), [&](const auto& level) { return level.wavelet(k); });
}

Eigen::Vector3d spline_weights(double u) {
  return {0.5 * (1.0 - u) * (1.0 - u), 0.5 * (1.0 + 2.0 * u - 2.0 * u * u), 0.5 * u * u};
}

BasisRow basis_row(Scheme scheme, Index size, double t) {
  if (size < fewest(scheme) || !std::isfinite(t)) {
    throw InvalidInput(text(name_of(scheme), "::basis_row: parameter ", t, " of ", size, " control points"));
  }
  const int p = degree(scheme);
  BasisRow row;
  row.count = p + 1;
  if (is_closed(scheme)) {
    t -= std::floor((t + 0.5) / static_cast<double>(size)) * static_cast<double>(size);
    const auto piece = std::min(static_cast<Index>(std::floor(t + 0.5)), size - 1);
    const Eigen::Vector3d weight = spline_weights(t + 0.5 - static_cast<double>(piece));
    for (int k = 0; k < 3; ++k) {
      row.index[static_cast<std::size_t>(k)] = wrapped(piece - 1 + k, size);
      row.weight[static_cast<std::size_t>(k)] = weight[k];
    }
    return row;
  }
  const Index spans = size - p;
  const Index span = static_cast<Index>(std::clamp(std::floor(t), 0.0, static_cast<double>(spans - 1)));
  row.weight = open_basis(p, spans, span, t);
  for (int k = 0; k <= p; ++k) row.index[static_cast<std::size_t>(k)] = span + k;
  return row;
}

Eigen::RowVectorXd evaluate(Scheme scheme, const CoefficientsView& control_points, double t) {
  const BasisRow row = basis_row(scheme, control_points.rows(), t);
  Eigen::RowVectorXd value = Eigen::RowVectorXd::Zero(control_points.cols());
  for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
    value += row.weight[k] * control_points.row(row.index[k]);
  }
  return value;
}

namespace chaikin {

Split analyze(const CoefficientsView& fine) { return fontcore::analyze(Scheme::Chaikin, fine); }

Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail) {
  return fontcore::synthesize(Scheme::Chaikin, coarse, detail);
}

Coefficients refine(const CoefficientsView& coarse) { return fontcore::refine(Scheme::Chaikin, coarse); }

}  // namespace chaikin

namespace orthogonal {

Split analyze(const CoefficientsView& fine) { return fontcore::analyze(Scheme::Orthogonal, fine); }

Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail) {
  return fontcore::synthesize(Scheme::Orthogonal, coarse, detail);
}

}  // namespace orthogonal

namespace endpoint_quadratic {

Split analyze(const CoefficientsView& fine) { return fontcore::analyze(Scheme::EndpointQuadratic, fine); }

Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail) {
  return fontcore::synthesize(Scheme::EndpointQuadratic, coarse, detail);
}

}  // namespace endpoint_quadratic

namespace endpoint_cubic {

Split analyze(const CoefficientsView& fine) { return fontcore::analyze(Scheme::EndpointCubic, fine); }

Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail) {
  return fontcore::synthesize(Scheme::EndpointCubic, coarse, detail);
}

}  // namespace endpoint_cubic

MultiresCurve decompose(Scheme scheme, const CoefficientsView& fine, int levels) {
  require_levels(scheme, "decompose", fine.rows(), levels);
  require_finite("decompose", fine);
  MultiresCurve curve{{}, std::vector<Coefficients>(static_cast<std::size_t>(levels)), scheme};
  if (levels == 0) curve.coarse = fine;
  for (int level = levels - 1; level >= 0; --level) {
    Split split = level == levels - 1 ? split_level(scheme, fine) : split_level(scheme, curve.coarse);
    curve.coarse = std::move(split.coarse);
    curve.details[static_cast<std::size_t>(level)] = std::move(split.detail);
  }
  return curve;
}

MultiresCurve decompose(const CoefficientsView& fine, int levels) { return decompose(Scheme::Chaikin, fine, levels); }

Coefficients reconstruct(const MultiresCurve& curve) {
  require_finite("reconstruct: control points", curve.coarse);
  Coefficients fine = curve.coarse;
  for (const Coefficients& detail : curve.details) {  // what comes of finite numbers is not looked at again
    require_detail(curve.scheme, fine, detail);
    fine = merge_level(curve.scheme, fine, detail);
  }
  return fine;
}

MultiresCurve from_level(const MultiresCurve& curve, int level) {
  if (level < 0 || level > curve.levels()) {
    throw InvalidInput(text("from_level: level ", level, " of a curve with levels 0 to ", curve.levels()));
  }
  MultiresCurve result{curve.coarse, {curve.details.begin() + level, curve.details.end()}, curve.scheme};
  for (int j = 0; j < level; ++j) {
    result.coarse = synthesize(curve.scheme, result.coarse, curve.details[static_cast<std::size_t>(j)]);
  }
  return result;
}

namespace {

// Level j + t with t in (0, 1]; level 0 has j = -1, t = 1.
std::pair<int, double> split_level_number(const char* function, int levels, double level) {
  if (!(level >= 0.0 && level <= levels)) {
    throw InvalidInput(text(function, ": level ", level, " of a curve with levels 0 to ", levels));
  }
  const int j = static_cast<int>(std::ceil(level)) - 1;
  return {j, level - j};
}

}  // namespace

Coefficients fractional(const MultiresCurve& curve, double level) {
  const auto [j, t] = split_level_number("fractional", curve.levels(), level);
  if (j < 0) return curve.coarse;
  const MultiresCurve seen = from_level(curve, j);
  return synthesize(curve.scheme, seen.coarse, t * seen.details.front());
}

MultiresCurve edit_fractional(const MultiresCurve& curve, double level, const CoefficientsView& change) {
  const auto [j, t] = split_level_number("edit_fractional", curve.levels(), level);
  Index rows = curve.coarse.rows();
  for (int i = 0; i <= j; ++i) rows += detail_count(curve.scheme, rows);
  if (change.rows() != rows || change.cols() != curve.coarse.cols()) {
    throw InvalidInput(text("edit_fractional: a change of ", change.rows(), "×", change.cols(), " at level ", level,
                            ", where control points are ", rows, "×", curve.coarse.cols()));
  }
  const MultiresCurve changes = decompose(curve.scheme, change, j + 1);
  MultiresCurve edited = curve;
  edited.coarse += changes.coarse;
  for (int i = 0; i <= j; ++i) {
    const auto at = static_cast<std::size_t>(i);
    edited.details[at] += i == j ? Coefficients(changes.details[at] / t) : changes.details[at];
  }
  return edited;
}

namespace {

// Least-squares control points of one level that move the curve at t by 1: w / (w . w).
Coefficients pull_level(Scheme scheme, Index size, double t) {
  const BasisRow row = basis_row(scheme, size, t);
  Coefficients weights = Coefficients::Zero(size, 1);
  for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) weights(row.index[k], 0) += row.weight[k];
  if (is_held(scheme)) weights(0, 0) = weights(size - 1, 0) = 0.0;
  const double square = weights.squaredNorm();
  if (square == 0.0) throw InvalidInput(text(name_of(scheme), ": the curve is held at parameter ", t));
  return weights / square;
}

}  // namespace

namespace {

// Sizes of the levels from the coarsest to the finest.
std::vector<Index> level_sizes(Scheme scheme, Index size, int levels) {
  std::vector<Index> sizes = {size};
  for (int down = 0; down < levels; ++down) sizes.push_back(coarser_size(scheme, sizes.back()));
  std::ranges::reverse(sizes);
  return sizes;
}

// [FS94] dc^j = (1 - g) broad + g A narrow, dd^j = (g / f) B narrow with g = f^2, at level j + f; at level 0 the broad
// change alone. Other details are 0.
MultiresCurve mixed_change(Scheme scheme, const std::vector<Index>& sizes, int j, double f, const Coefficients& broad,
                           const Coefficients& narrow) {
  MultiresCurve change{Coefficients::Zero(sizes[0], 1), {}, scheme};
  for (std::size_t level = 0; level + 1 < sizes.size(); ++level) {
    change.details.emplace_back(Coefficients::Zero(detail_count(scheme, sizes[level]), 1));
  }
  if (j < 0) {
    change.coarse = broad;
    return change;
  }
  const double g = f * f;
  const Split split = split_level(scheme, narrow);
  change.details[static_cast<std::size_t>(j)] = f * split.detail;
  const MultiresCurve coarser = decompose(scheme, (1.0 - g) * broad + g * split.coarse, j);
  change.coarse = coarser.coarse;
  std::ranges::copy(coarser.details, change.details.begin());
  return change;
}

}  // namespace

MultiresCurve pull(Scheme scheme, Index size, int levels, double t, double level, Moved moved) {
  require_levels(scheme, "pull", size, levels);
  const std::vector<Index> sizes = level_sizes(scheme, size, levels);
  const auto [j, f] = split_level_number("pull", levels, level);
  const auto at = [&](int of) {
    return pull_level(scheme, sizes[static_cast<std::size_t>(of)], coarser_parameter(scheme, t, levels - of));
  };
  MultiresCurve change =
      j < 0 ? mixed_change(scheme, sizes, j, f, at(0), {}) : mixed_change(scheme, sizes, j, f, at(j), at(j + 1));
  if (moved == Moved::Fractional) return change;
  // Of the whole curve, whose finer control points follow from those of level j + 1.
  MultiresCurve seen{change.coarse, {change.details.begin(), change.details.begin() + (j + 1)}, scheme};
  const double got = evaluate(scheme, reconstruct(seen), coarser_parameter(scheme, t, levels - j - 1))[0];
  change.coarse /= got;
  for (Coefficients& detail : change.details) detail /= got;
  return change;
}

MultiresCurve pull_control_point(Scheme scheme, Index size, int levels, Index index, double level) {
  require_levels(scheme, "pull_control_point", size, levels);
  const std::vector<Index> sizes = level_sizes(scheme, size, levels);
  const auto [j, f] = split_level_number("pull_control_point", levels, level);
  const Index count = sizes[static_cast<std::size_t>(j + 1)];
  const bool is_end = is_held(scheme) && (index == 0 || index == count - 1);
  if (index < 0 || index >= count || is_end) {
    throw InvalidInput(text("pull_control_point: control point ", index, " of ", count, " at level ", level,
                            is_end ? " is held" : ""));
  }
  Coefficients narrow = Coefficients::Zero(count, 1);
  narrow(index, 0) = 1.0;
  if (j < 0) return mixed_change(scheme, sizes, j, f, narrow, {});
  // Row `index` of P: the weights of the coarser control points in it.
  const Index coarse_count = sizes[static_cast<std::size_t>(j)];
  Coefficients row = Coefficients::Zero(coarse_count, 1);
  for (Index k = 0; k < coarse_count; ++k) {
    const FilterColumn column = scaling_column(scheme, coarse_count, k);
    const Index r = is_closed(scheme) ? wrapped(index - column.first, count) : index - column.first;
    if (r >= 0 && r < std::ssize(column.values)) row(k, 0) = column.values[static_cast<std::size_t>(r)];
  }
  if (is_held(scheme)) row(0, 0) = row(coarse_count - 1, 0) = 0.0;
  const double most = row.maxCoeff();
  Coefficients broad = (row.array() > most - 1e-9).cast<double>();
  broad /= row.cwiseProduct(broad).sum();
  return mixed_change(scheme, sizes, j, f, broad, narrow);
}

const Eigen::Matrix4d& span_form(Form form, Scheme scheme, Index size, Index span) {
  const Index spans = detail_count(scheme, size);
  if (size < fewest(scheme) || span < 0 || span >= spans)
    throw InvalidInput(text("span_form: span ", span, " of ", size, " control points of ", name_of(scheme)));
  return span_form(form, degree(scheme), is_closed(scheme), spans, span);
}

Eigen::SparseMatrix<double> mother_matrix(Form form, Scheme scheme, Index size) {
  if (size < fewest(scheme)) throw InvalidInput(text("mother_matrix: ", size, " control points of ", name_of(scheme)));
  const Index p = degree(scheme);
  const Eigen::MatrixXd band = banded_form(form, degree(scheme), is_closed(scheme), size);
  std::vector<Eigen::Triplet<double>> entries;
  for (Index i = 0; i < size; ++i) {
    for (Index s = -p; s <= p; ++s) {
      if (is_closed(scheme) || (i + s >= 0 && i + s < size))
        entries.emplace_back(i, wrapped(i + s, size), band(i, p + s));
    }
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

LevelForm::LevelForm(Form form, Scheme scheme, Index size, int levels) : scheme_(scheme), levels_(levels) {
  if (size < fewest(scheme))
    throw InvalidInput(text("LevelForm: ", size, " control points of scheme ", name_of(scheme)));
  require_levels(scheme, "LevelForm", size, levels);
  band_ = banded_form(form, degree(scheme), is_closed(scheme), size);
}

Coefficients LevelForm::apply(const CoefficientsView& coefficients) const {
  if (coefficients.rows() != size()) {
    throw InvalidInput(text("LevelForm::apply: ", coefficients.rows(), " coefficients, not ", size()));
  }
  std::vector<Index> sizes = {size()};  // control points of the levels, fine first
  for (int level = 0; level < levels_; ++level) sizes.push_back(coarser_size(scheme_, sizes.back()));

  Coefficients fine = coefficients.topRows(sizes.back());
  for (int level = levels_ - 1; level >= 0; --level) {
    const Index m = fine.rows();
    fine = synthesize(scheme_, fine, coefficients.middleRows(m, detail_count(scheme_, m)));
  }
  fine = apply_band(band_, is_closed(scheme_), fine);
  Coefficients product(coefficients.rows(), coefficients.cols());
  for (int level = 0; level < levels_; ++level) {
    Split split = fontcore::adjoint(scheme_, fine);
    product.middleRows(split.coarse.rows(), split.detail.rows()) = split.detail;
    fine = std::move(split.coarse);
  }
  product.topRows(fine.rows()) = fine;
  return product;
}

Eigen::MatrixXd LevelForm::matrix() const {
  Eigen::MatrixXd M = apply_band(band_, is_closed(scheme_), Eigen::MatrixXd::Identity(size(), size()));
  Index m = size();
  for (int level = 0; level < levels_; ++level) {
    // eq. 16 to 18 on the block of this level, eq. 14 and 15 beside it: both are [P | Q]' from the left and right.
    const auto filter = [&](const Eigen::MatrixXd& rows) {
      const Split split = fontcore::adjoint(scheme_, rows);
      Eigen::MatrixXd filtered(rows.rows(), rows.cols());
      filtered << split.coarse, split.detail;
      return filtered;
    };
    M.topRows(m) = filter(M.topRows(m));
    M.leftCols(m) = filter(M.leftCols(m).transpose()).transpose();
    m = coarser_size(scheme_, m);
  }
  return M;
}

Coefficients stack(const MultiresCurve& curve) {
  Index rows = curve.coarse.rows();
  for (const Coefficients& detail : curve.details) rows += detail.rows();
  Coefficients stacked(rows, curve.coarse.cols());
  stacked.topRows(curve.coarse.rows()) = curve.coarse;
  Index row = curve.coarse.rows();
  for (const Coefficients& detail : curve.details) {
    stacked.middleRows(row, detail.rows()) = detail;
    row += detail.rows();
  }
  return stacked;
}

MultiresCurve unstack(Scheme scheme, const CoefficientsView& stacked, int levels) {
  require_levels(scheme, "unstack", stacked.rows(), levels);
  MultiresCurve curve{{}, std::vector<Coefficients>(static_cast<std::size_t>(levels)), scheme};
  Index size = stacked.rows();
  for (int level = levels - 1; level >= 0; --level) {
    const Index coarse = coarser_size(scheme, size);
    curve.details[static_cast<std::size_t>(level)] = stacked.middleRows(coarse, size - coarse);
    size = coarse;
  }
  curve.coarse = stacked.topRows(size);
  return curve;
}

double area(const MultiresCurve& curve, int level) {
  if (curve.coarse.cols() < 2) throw InvalidInput(text("area: control points have ", curve.coarse.cols(), " columns"));
  const Coefficients X = stack(from_level(curve, level));
  const LevelForm M(Form::Area, curve.scheme, X.rows(), curve.levels() - level);
  return 0.5 * X.col(0).dot(M.apply(X.col(1)).col(0));
}

double energy(const MultiresCurve& curve, int level) {
  const Coefficients X = stack(from_level(curve, level));
  const LevelForm H(Form::Energy, curve.scheme, X.rows(), curve.levels() - level);
  return 0.5 * X.cwiseProduct(H.apply(X)).sum();
}

double coarser_parameter(double t, int levels) {
  for (int level = 0; level < levels; ++level) t = 0.5 * (t + 0.5);
  return t;
}

double finer_parameter(double t, int levels) {
  for (int level = 0; level < levels; ++level) t = 2.0 * t - 0.5;
  return t;
}

double coarser_parameter(Scheme scheme, double t, int levels) {
  return is_closed(scheme) ? coarser_parameter(t, levels) : std::ldexp(t, -levels);
}

double finer_parameter(Scheme scheme, double t, int levels) {
  return is_closed(scheme) ? finer_parameter(t, levels) : std::ldexp(t, levels);
}

}  // namespace fontcore
