#include "fontcore/nonuniform.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <iterator>
#include <utility>

#include "fontcore/error.h"

namespace fontcore {

namespace {

using Eigen::Index;
using Sparse = Eigen::SparseMatrix<double>;
using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr int most_degree = 5;
using Weights = Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, most_degree + 1>;
using Local = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, most_degree + 1, most_degree + 1>;

Sparse from_triplets(Index rows, Index columns, const Triplets& triplets) {
  Sparse matrix(rows, columns);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  return matrix;
}

// ---- What the constructor functions ask of knots.

void require_knots(const char* function, int degree, const std::vector<double>& knots, std::size_t fewest) {
  if (degree < 1 || degree > most_degree) {
    throw InvalidInput(text(function, ": degree ", degree, " is not in 1 to ", most_degree));
  }
  if (knots.size() < fewest) {
    throw InvalidInput(text(function, ": ", knots.size(), " knots; degree ", degree, " takes at least ", fewest));
  }
  std::size_t first = 0;
  for (std::size_t i = 0; i < knots.size(); ++i) {
    if (!std::isfinite(knots[i])) throw InvalidInput(text(function, ": knot ", i, " is ", knots[i]));
    if (knots[i] < knots[first]) {
      throw InvalidInput(text(function, ": knot ", i, " is ", knots[i], ", less than ", knots[first], " before it"));
    }
    if (knots[i] > knots[first]) first = i;
    if (i - first > static_cast<std::size_t>(degree)) {
      throw InvalidInput(
          text(function, ": knot ", first, ", ", knots[i], ", is repeated more than ", degree + 1, " times"));
    }
  }
  if (!std::isfinite(knots.back() - knots.front())) {
    throw InvalidInput(text(function, ": knots from ", knots.front(), " to ", knots.back()));
  }
}

void require_rows(const char* function, Index size, const CoefficientsView& points) {
  if (points.rows() != size) {
    throw InvalidInput(text(function, ": ", points.rows(), " control points for knots of ", size));
  }
}

// ---- B-splines.

// Weights of the control points span - p .. span in the polar form, at p arguments, of the polynomial between the knots
// `span` and span + 1: the Oslo algorithm. Arguments that are knots of a finer vector, in order from one in that span,
// or that all lie in the span make every factor a number in [0, 1], and one that is to be 0 or 1 exactly so.
template <typename Argument>
Weights polar_weights(const KnotVector& knots, Index span, const Argument& argument) {
  const int p = knots.degree();
  Weights weights = Weights::Zero(p + 1);
  weights[p] = 1.0;
  for (int q = 1; q <= p; ++q) {
    const double t = argument(q);
    for (int i = p - q; i <= p; ++i) {
      const Index j = span - p + i;
      double sum = 0.0;
      if (i > p - q) sum += (t - knots.knot(j)) / (knots.knot(j + q) - knots.knot(j)) * weights[i];
      if (i < p) {
        sum += (knots.knot(j + q + 1) - t) / (knots.knot(j + q + 1) - knots.knot(j + 1)) * weights[i + 1];
      }
      weights[i] = sum;
    }
  }
  return weights;
}

// From the control points span - p .. span to the Bezier points of the span.
Local to_bezier(const KnotVector& knots, Index span) {
  const int p = knots.degree();
  Local matrix(p + 1, p + 1);
  for (int k = 0; k <= p; ++k) {
    matrix.row(k) = polar_weights(knots, span, [&](int q) { return knots.knot(q <= p - k ? span : span + 1); });
  }
  return matrix;
}

Coefficients bezier_points(const KnotVector& knots, const CoefficientsView& points, Index span) {
  Coefficients local(knots.degree() + 1, points.cols());
  for (int i = 0; i <= knots.degree(); ++i) {
    local.row(i) = points.row(modulo(span - knots.degree() + i, knots.size()));
  }
  return to_bezier(knots, span) * local;
}

// The knots that a polynomial of the curve starts at.
std::vector<Index> spans(const KnotVector& knots) {
  std::vector<Index> result;
  for (Index i = knots.is_closed() ? 0 : knots.degree(); i < knots.size(); ++i) {
    if (knots.knot(i) < knots.knot(i + 1)) result.push_back(i);
  }
  return result;
}

// The P of [FS94]: fine control points of coarse ones, without the zeros.
Sparse insertion(const KnotVector& coarse, const KnotVector& fine) {
  const int p = fine.degree();
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(fine.size() * (p + 1)));
  Index span = -1;  // the last coarse knot up to the fine one
  for (Index i = 0; i < fine.size(); ++i) {
    while (span + 1 < std::ssize(coarse.knots()) && coarse.knot(span + 1) <= fine.knot(i)) ++span;
    const Weights weights = polar_weights(coarse, span, [&](int q) { return fine.knot(i + q); });
    for (int k = 0; k <= p; ++k) {
      if (weights[k] != 0.0) triplets.emplace_back(i, modulo(span - p + k, coarse.size()), weights[k]);
    }
  }
  return from_triplets(fine.size(), coarse.size(), triplets);
}

// ---- Integrals.

// Derivative of Bernstein coefficients over [0, 1]: p + 1 of degree p to p of degree p - 1.
Local difference(int p) {
  Local matrix = Local::Zero(p, p + 1);
  matrix.diagonal<0>().setConstant(-p);
  matrix.diagonal<1>().setConstant(p);
  return matrix;
}

Sparse form_matrix(Form form, const KnotVector& knots) {
  const int p = knots.degree();
  const Eigen::MatrixXd bernstein = bernstein_form(form, p);
  // Of derivatives taken: each divides by the length of the span, the integral multiplies.
  const int order = form == Form::Product ? 0 : form == Form::Area ? 1 : 4;
  Triplets triplets;
  triplets.reserve(static_cast<std::size_t>(knots.size() * (p + 1) * (p + 1)));
  for (const Index span : spans(knots)) {
    const Local M = to_bezier(knots, span);
    const double length = knots.knot(span + 1) - knots.knot(span);
    const Local local = std::pow(length, 1 - order) * (M.transpose() * bernstein * M);
    for (int i = 0; i <= p; ++i) {
      for (int j = 0; j <= p; ++j) {
        triplets.emplace_back(modulo(span - p + i, knots.size()), modulo(span - p + j, knots.size()), local(i, j));
      }
    }
  }
  return from_triplets(knots.size(), knots.size(), triplets);
}

// ---- Coarsening.

bool stays(const KnotVector& knots, double t, const std::vector<double>& kept) {
  return knots.multiplicity(t) >= 2 || std::ranges::find(kept, t) != kept.end();
}

// The places among `knots()` of those that go, in order.
std::vector<Index> removed_knots(const KnotVector& fine, const std::vector<double>& kept) {
  const Index count = std::ssize(fine.knots());
  const auto stays_at = [&](Index i) { return stays(fine, fine.knot(i), kept); };
  Index first = 0;
  while (first < count && !stays_at(first)) ++first;
  std::vector<Index> removed;
  bool is_next = true;
  for (Index step = 1; step < count; ++step) {
    const Index i = (first + step) % count;
    const bool stays_here = stays_at(i);
    if (!stays_here && is_next) removed.push_back(i);
    is_next = stays_here || !is_next;
  }
  std::ranges::sort(removed);
  if (fine.is_closed() && count - std::ssize(removed) <= fine.degree()) removed.clear();
  return removed;
}

KnotVector without(const KnotVector& fine, const std::vector<Index>& removed) {
  std::vector<double> knots;
  auto next = removed.begin();
  for (Index i = 0; i < std::ssize(fine.knots()); ++i) {
    if (next != removed.end() && *next == i) {
      ++next;
    } else {
      knots.push_back(fine.knot(i));
    }
  }
  return fine.is_closed() ? closed_knots(fine.degree(), std::move(knots), fine.period())
                          : open_knots(fine.degree(), std::move(knots));
}

// All levels there are, fine to coarse.
std::vector<KnotVector> whole_ladder(const char* function, const KnotVector& fine, const std::vector<double>& kept) {
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (fine.multiplicity(kept[i]) == 0) {
      throw InvalidInput(text(function, ": kept knot ", i, ", ", kept[i], ", is not among the knots"));
    }
  }
  std::vector<KnotVector> levels = {fine};
  for (auto removed = removed_knots(fine, kept); !removed.empty(); removed = removed_knots(levels.back(), kept)) {
    levels.push_back(without(levels.back(), removed));
  }
  return levels;
}

// ---- One level.

// The B-splines that take up the details, one for each removed knot, among those that bend at it. What is left of P has
// the diagonal P(i, i - m) for rows i between those of the removed knots m - 1 and m; the larger its product, the
// better the lazy split is conditioned. From the middle ones a few rounds of single moves come near the largest.
std::vector<Index> detail_rows(const Sparse& P, const KnotVector& fine, const std::vector<Index>& removed) {
  const int p = fine.degree();
  const Index count = std::ssize(removed);
  std::vector<Index> rows;
  for (const Index k : removed) rows.push_back(k - p / 2 - 1);
  const auto row = [&](Index m) {
    if (m < 0) return fine.is_closed() ? rows.back() - P.rows() : -1;
    if (m == count) return fine.is_closed() ? rows.front() + P.rows() : P.rows();
    return rows[static_cast<std::size_t>(m)];
  };
  constexpr int rounds = 4;
  for (int round = 0; round < rounds; ++round) {
    for (Index m = 0; m < count; ++m) {
      const Index k = removed[static_cast<std::size_t>(m)];
      const Index first = std::max(k - p, row(m - 1) + 1);
      const Index last = std::min(k - 1, row(m + 1) - 1);
      const auto product = [&](Index own) {
        double value = 1.0;
        for (Index i = first; i <= last; ++i) {
          if (i != own) value *= P.coeff(modulo(i, P.rows()), modulo(i < own ? i - m : i - m - 1, P.cols()));
        }
        return value;
      };
      constexpr double rounding = 1e-9;  // of two equally good ones the one that was there stays
      double best = product(row(m));
      for (Index i = first; i <= last; ++i) {
        const double value = product(i);
        if (value <= best * (1.0 + rounding)) continue;
        best = value;
        rows[static_cast<std::size_t>(m)] = i;
      }
    }
  }
  for (Index& i : rows) i = modulo(i, P.rows());
  return rows;
}

// All right-hand sides one by one, so that a column does not know of its neighbours.
template <typename Solver>
Coefficients solve_columns(const Solver& solver, const Coefficients& right) {
  Coefficients x(right.rows(), right.cols());
  for (Index k = 0; k < right.cols(); ++k) x.col(k) = solver.solve(right.col(k));
  return x;
}

// From a level to the next coarser one by lifting. First the lazy split fine = P a + E d, E the B-splines of
// `detail_rows`; then c = a + L d, where L = (P'GP)^-1 P'G E leaves out the rows and columns of held points. The
// wavelets are E - P L.
class Step {
 public:
  Step(const KnotVector& coarse, const KnotVector& fine, const std::vector<Index>& removed,
       const NonuniformOptions& options)
      : P_(insertion(coarse, fine)), own_(detail_rows(P_, fine, removed)) {
    std::vector<bool> is_own(static_cast<std::size_t>(fine.size()), false);
    for (const Index i : own_) is_own[static_cast<std::size_t>(i)] = true;
    for (Index i = 0; i < fine.size(); ++i) {
      if (!is_own[static_cast<std::size_t>(i)]) rest_.push_back(i);
    }
    lazy_.compute(selection(rest_) * P_);

    const Sparse coarse_products = P_.transpose() * form_matrix(Form::Product, fine);
    Sparse gram = coarse_products * P_;
    lift_ = coarse_products * Sparse(selection(own_).transpose());
    if (options.jumps == Jumps::Held) {
      find_held(fine, options.kept);
      Eigen::VectorXd is_free = Eigen::VectorXd::Ones(coarse.size());
      for (const auto& [coarse_row, fine_row] : held_) is_free[coarse_row] = 0.0;
      const Eigen::VectorXd is_held = 1.0 - is_free.array();
      gram = Sparse(is_free.asDiagonal() * gram * is_free.asDiagonal()) + Sparse(is_held.asDiagonal());
      lift_ = Sparse(is_free.asDiagonal() * lift_);
    }
    gram_.compute(gram);
    if (lazy_.info() != Eigen::Success || gram_.info() != Eigen::Success) {
      throw InvalidInput(text("NonuniformScheme: the knots of ", fine.size(),
                              " control points are so uneven that a level is singular"));
    }
  }

  Index coarse_size() const { return P_.cols(); }
  Index detail_size() const { return std::ssize(own_); }

  Split split(const Coefficients& fine) const {
    Split result{solve_columns(lazy_, fine(rest_, Eigen::all)), {}};
    result.detail = Coefficients(fine - P_ * result.coarse)(own_, Eigen::all);
    result.coarse += solve_columns(gram_, lift_ * result.detail);
    for (const auto& [coarse_row, fine_row] : held_) result.coarse.row(coarse_row) = fine.row(fine_row);
    return result;
  }

  Coefficients merge(const Coefficients& coarse, const Coefficients& detail) const {
    Coefficients fine = P_ * (coarse - solve_columns(gram_, lift_ * detail));
    fine(own_, Eigen::all) += detail;
    return fine;
  }

  // P' fine and Q' fine.
  Split adjoint(const Coefficients& fine) const {
    Split result{P_.transpose() * fine, fine(own_, Eigen::all)};
    result.detail -= lift_.transpose() * solve_columns(gram_, result.coarse);
    return result;
  }

 private:
  Sparse selection(const std::vector<Index>& rows) const {
    Triplets triplets;
    for (std::size_t i = 0; i < rows.size(); ++i) triplets.emplace_back(static_cast<Index>(i), rows[i], 1.0);
    return from_triplets(std::ssize(rows), P_.rows(), triplets);
  }

  // Control points that lie on the curve at knots that stay: their rows of P have a single entry, 1.
  void find_held(const KnotVector& fine, const std::vector<double>& kept) {
    const Sparse rows = P_.transpose();
    for (Index i = 0; i < fine.size(); ++i) {
      const double t = fine.knot(modulo(i + 1, std::ssize(fine.knots())));
      if (fine.knot(i + 1) == fine.knot(i + fine.degree()) && stays(fine, t, kept)) {
        held_.emplace_back(Sparse::InnerIterator(rows, i).row(), i);
      }
    }
  }

  Sparse P_;
  Sparse lift_;                                // P'G E, rows of held points zero
  std::vector<Index> own_;                     // fine control points that details are added to
  std::vector<Index> rest_;                    // the others, as many as coarse ones
  std::vector<std::pair<Index, Index>> held_;  // coarse and fine
  Eigen::SparseLU<Sparse> lazy_;               // of the rest's rows of P
  Eigen::SimplicialLDLT<Sparse> gram_;         // of P'GP
};

}  // namespace

KnotVector::KnotVector(int degree, std::vector<double> knots, double period)
    : degree_(degree), period_(period), knots_(std::move(knots)) {}

Index KnotVector::size() const { return std::ssize(knots_) - (is_closed() ? 0 : degree_ + 1); }

double KnotVector::knot(Index i) const {
  const Index count = std::ssize(knots_);
  if (i >= 0 && i < count) return knots_[static_cast<std::size_t>(i)];
  const Index place = modulo(i, count);
  const Index turns = (i - place) / count;
  return knots_[static_cast<std::size_t>(place)] + static_cast<double>(turns) * period_;
}

int KnotVector::multiplicity(double t) const {
  if (std::isnan(t)) return 0;
  const auto [first, last] = std::equal_range(knots_.begin(), knots_.end(), t);  // clang 14 cannot read std::ranges'
  return static_cast<int>(last - first);
}

KnotVector open_knots(int degree, std::vector<double> knots) {
  require_knots("open_knots", degree, knots, static_cast<std::size_t>(2 * (degree + 1)));
  KnotVector result(degree, std::move(knots), 0.0);
  for (const double end : {result.start(), result.end()}) {
    if (result.multiplicity(end) != degree + 1) {
      throw InvalidInput(
          text("open_knots: the end ", end, " stands ", result.multiplicity(end), " times, not ", degree + 1));
    }
  }
  return result;
}

KnotVector closed_knots(int degree, std::vector<double> knots, double period) {
  require_knots("closed_knots", degree, knots, static_cast<std::size_t>(degree + 1));
  if (!(period > 0.0) || !std::isfinite(period)) throw InvalidInput(text("closed_knots: a period of ", period));
  if (knots.back() >= knots.front() + period) {
    throw InvalidInput(
        text("closed_knots: knots from ", knots.front(), " to ", knots.back(), " in a period of ", period));
  }
  KnotVector result(degree, std::move(knots), period);
  const Index count = result.size();
  for (Index i = -1; i < count; ++i) {
    const bool differ = result.knots()[static_cast<std::size_t>(modulo(i, count))] !=
                        result.knots()[static_cast<std::size_t>(modulo(i + 1, count))];
    if (differ && !(result.knot(i) < result.knot(i + 1) && result.knot(i + count) < result.knot(i + 1 + count) &&
                    result.knot(i - count) < result.knot(i + 1 - count))) {
      throw InvalidInput(text("closed_knots: knots ", modulo(i, count), " and ", modulo(i + 1, count),
                              " are nearer than a period of ", period, " can tell"));
    }
  }
  return result;
}

Eigen::VectorXd greville(const KnotVector& knots) {
  Eigen::VectorXd abscissae = Eigen::VectorXd::Zero(knots.size());
  for (Index i = 0; i < knots.size(); ++i) {
    for (int q = 1; q <= knots.degree(); ++q) abscissae[i] += knots.knot(i + q) / knots.degree();
  }
  return abscissae;
}

Eigen::RowVectorXd evaluate(const KnotVector& knots, const CoefficientsView& points, double t, int derivative,
                            Side side) {
  require_rows("evaluate", knots.size(), points);
  const bool is_inside = knots.is_closed() ? std::isfinite(t) : t >= knots.start() && t <= knots.end();
  if (!is_inside) throw InvalidInput(text("evaluate: t = ", t, " on knots from ", knots.start(), " to ", knots.end()));
  if (derivative < 0) throw InvalidInput(text("evaluate: derivative ", derivative));
  const int p = knots.degree();
  if (derivative > p) return Eigen::RowVectorXd::Zero(points.cols());
  if (knots.is_closed()) {
    if (t == knots.end()) t = knots.start();
    if (t < knots.start() || t > knots.end()) {
      t -= std::floor((t - knots.start()) / knots.period()) * knots.period();
      if (t < knots.start() || t >= knots.end()) t = knots.start();
    }
    if (side == Side::Left && t == knots.start()) t = knots.end();
  }
  const auto after =
      side == Side::Left ? std::ranges::lower_bound(knots.knots(), t) : std::ranges::upper_bound(knots.knots(), t);
  const Index span =
      std::clamp<Index>(std::distance(knots.knots().begin(), after) - 1, knots.is_closed() ? 0 : p, knots.size() - 1);

  const double length = knots.knot(span + 1) - knots.knot(span);
  Coefficients b = bezier_points(knots, points, span);
  for (int d = 0; d < derivative; ++d) b = (difference(p - d) / length * b).eval();
  const double u = (t - knots.knot(span)) / length;
  while (b.rows() > 1) b = ((1.0 - u) * b.topRows(b.rows() - 1) + u * b.bottomRows(b.rows() - 1)).eval();
  return b.row(0);
}

std::vector<SplinePiece> bezier_pieces(const KnotVector& knots, const CoefficientsView& points) {
  require_rows("bezier_pieces", knots.size(), points);
  std::vector<SplinePiece> pieces;
  for (const Index span : spans(knots)) {
    pieces.push_back({knots.knot(span), knots.knot(span + 1), bezier_points(knots, points, span)});
  }
  return pieces;
}

Coefficients refine(const KnotVector& coarse, const KnotVector& fine, const CoefficientsView& points) {
  const bool same_ends = coarse.is_closed() || (coarse.start() == fine.start() && coarse.end() == fine.end());
  if (coarse.degree() != fine.degree() || coarse.period() != fine.period() || !same_ends) {
    throw InvalidInput(text("refine: from degree ", coarse.degree(), " over [", coarse.start(), ", ", coarse.end(),
                            "] to degree ", fine.degree(), " over [", fine.start(), ", ", fine.end(), "]"));
  }
  for (const double t : coarse.knots()) {
    if (fine.multiplicity(t) < coarse.multiplicity(t)) {
      throw InvalidInput(text("refine: knot ", t, " stands ", coarse.multiplicity(t), " times in the coarse knots, ",
                              fine.multiplicity(t), " in the fine ones"));
    }
  }
  require_rows("refine", coarse.size(), points);
  return insertion(coarse, fine) * points;
}

int most_levels(const KnotVector& fine, const std::vector<double>& kept) {
  return static_cast<int>(whole_ladder("most_levels", fine, kept).size()) - 1;
}

KnotLadder make_ladder(const KnotVector& fine, int levels, const std::vector<double>& kept) {
  const std::vector<KnotVector> all = whole_ladder("make_ladder", fine, kept);
  if (levels < 0 || levels >= std::ssize(all)) {
    throw InvalidInput(text("make_ladder: knots of ", fine.size(), " control points have 0 to ", all.size() - 1,
                            " levels below them, not ", levels));
  }
  return {{all.rend() - levels - 1, all.rend()}};
}

struct NonuniformScheme::Ladder {
  KnotLadder knots;
  std::deque<Step> steps;       // steps[j] lies between levels j and j + 1
  std::array<Sparse, 3> forms;  // of the finest level, in the order of Form
};

NonuniformScheme::NonuniformScheme(const KnotVector& fine, int levels, const NonuniformOptions& options) {
  auto ladder = std::make_shared<Ladder>();
  ladder->knots = make_ladder(fine, levels, options.kept);
  for (std::size_t j = 1; j < ladder->knots.levels.size(); ++j) {
    const KnotVector& finer = ladder->knots.levels[j];
    ladder->steps.emplace_back(ladder->knots.levels[j - 1], finer, removed_knots(finer, options.kept), options);
  }
  for (const Form form : {Form::Product, Form::Area, Form::Energy}) {
    ladder->forms[static_cast<std::size_t>(form)] = form_matrix(form, fine);
  }
  ladder_ = std::move(ladder);
}

int NonuniformScheme::levels() const { return static_cast<int>(ladder_->steps.size()); }

namespace {

void require_level(const char* function, double level, int levels) {
  if (!(level >= 0.0 && level <= levels)) {
    throw InvalidInput(text(function, ": level ", level, " of a scheme with levels 0 to ", levels));
  }
}

}  // namespace

const KnotVector& NonuniformScheme::knots(int level) const {
  require_level("knots", level, levels());
  return ladder_->knots.levels[static_cast<std::size_t>(level)];
}

NonuniformCurve NonuniformScheme::decompose(const CoefficientsView& fine) const {
  require_rows("decompose", knots(levels()).size(), fine);
  require_finite("decompose", fine);
  NonuniformCurve curve{fine, std::vector<Coefficients>(ladder_->steps.size())};
  for (std::size_t j = ladder_->steps.size(); j-- > 0;) {
    Split split = ladder_->steps[j].split(curve.coarse);
    curve.coarse = std::move(split.coarse);
    curve.details[j] = std::move(split.detail);
  }
  return curve;
}

void NonuniformScheme::require_fitting(const char* function, const NonuniformCurve& curve) const {
  require_rows(function, knots(0).size(), curve.coarse);
  require_finite(function, curve.coarse);
  if (curve.details.size() != ladder_->steps.size()) {
    throw InvalidInput(text(function, ": ", curve.details.size(), " levels of details, not ", levels()));
  }
  for (std::size_t j = 0; j < curve.details.size(); ++j) {
    const Coefficients& detail = curve.details[j];
    if (detail.rows() != ladder_->steps[j].detail_size() || detail.cols() != curve.coarse.cols()) {
      throw InvalidInput(text(function, ": details of level ", j, " are ", detail.rows(), "×", detail.cols(), ", not ",
                              ladder_->steps[j].detail_size(), "×", curve.coarse.cols()));
    }
    require_finite(text(function, ": details of level ", j).c_str(), detail);
  }
}

Coefficients NonuniformScheme::reconstruct(const NonuniformCurve& curve) const {
  return points_at("reconstruct", curve, levels());
}

Coefficients NonuniformScheme::points(const NonuniformCurve& curve, int level) const {
  return points_at("points", curve, level);
}

Coefficients NonuniformScheme::fractional(const NonuniformCurve& curve, double level) const {
  return points_at("fractional", curve, level);
}

Coefficients NonuniformScheme::points_at(const char* function, const NonuniformCurve& curve, double level) const {
  require_level(function, level, levels());
  require_fitting(function, curve);
  Coefficients points = curve.coarse;
  for (std::size_t j = 0; static_cast<double>(j) < level; ++j) {
    const double t = std::min(1.0, level - static_cast<double>(j));
    points = ladder_->steps[j].merge(points, t * curve.details[j]);
  }
  return points;
}

Coefficients NonuniformScheme::stack(const NonuniformCurve& curve, int level) const {
  Coefficients stacked(knots(levels()).size(), curve.coarse.cols());
  const Coefficients coarse = points(curve, level);
  Index row = coarse.rows();
  stacked.topRows(row) = coarse;
  for (std::size_t j = static_cast<std::size_t>(level); j < curve.details.size(); ++j) {
    stacked.middleRows(row, curve.details[j].rows()) = curve.details[j];
    row += curve.details[j].rows();
  }
  return stacked;
}

Coefficients NonuniformScheme::apply(Form form, int level, const CoefficientsView& coefficients) const {
  require_level("apply", level, levels());
  require_rows("apply", knots(levels()).size(), coefficients);
  Coefficients fine = coefficients.topRows(knots(level).size());
  for (std::size_t j = static_cast<std::size_t>(level); j < ladder_->steps.size(); ++j) {
    const Step& step = ladder_->steps[j];
    fine = step.merge(fine, coefficients.middleRows(step.coarse_size(), step.detail_size()));
  }
  fine = ladder_->forms[static_cast<std::size_t>(form)] * fine;
  Coefficients product(coefficients.rows(), coefficients.cols());
  for (std::size_t j = ladder_->steps.size(); j-- > static_cast<std::size_t>(level);) {
    Split split = ladder_->steps[j].adjoint(fine);
    product.middleRows(split.coarse.rows(), split.detail.rows()) = split.detail;
    fine = std::move(split.coarse);
  }
  product.topRows(fine.rows()) = fine;
  return product;
}

double NonuniformScheme::area(const NonuniformCurve& curve, int level) const {
  if (curve.coarse.cols() < 2) throw InvalidInput(text("area: control points have ", curve.coarse.cols(), " columns"));
  const Coefficients X = stack(curve, level);
  return 0.5 * X.col(0).dot(apply(Form::Area, level, X.col(1)).col(0));
}

double NonuniformScheme::energy(const NonuniformCurve& curve, int level) const {
  const Coefficients X = stack(curve, level);
  return 0.5 * X.cwiseProduct(apply(Form::Energy, level, X)).sum();
}

}  // namespace fontcore
