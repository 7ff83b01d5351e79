#include "fontcore/drag.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"

namespace fontcore {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseRows = Eigen::SparseMatrix<double, Eigen::RowMajor>;
using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double promise = 1e-12;           // relative, of area and length: a move further off is not met
constexpr double area_tolerance = 2e-13;    // relative: above it another pass cleans rounding
constexpr double length_tolerance = 2e-13;  // relative
constexpr double no_slope = 1e-14;          // of the area, per unit along the correction: nothing is free to change it
constexpr int most_area_passes = 3;         // of which the later ones clean rounding
constexpr int most_length_passes = 8;       // of one attempt: Newton's, the first root among them
constexpr double turn_margin = 1e-2;        // of slope squared, left where the correction's root is taken
constexpr double largest_throw = 1e3;       // of a control point, per unit that a pin moves: more is a conflict
constexpr int most_dense = 200;             // unknowns: above, a sparse factor is cheaper
constexpr int share_halvings = 50;          // of the interval in which the share of the wishes is sought
constexpr int length_halvings = 12;         // the same with a length, where each is a solve
constexpr int most_bend_steps = 20;         // double steps of power iteration: any direction near the best will do
constexpr double least_fraction = 1e-3;     // of a level, below which its details are as good as fixed
constexpr double parallel_gradients = 1e-10;  // sine squared between area's and length's: nothing tells them apart
constexpr double negligible_pull = 1e-9;      // of its largest coefficient: Orthogonal's decays for ever
constexpr double dependent_handles = 1e-9;    // relative: handles that D0 cannot tell apart share their wish

// Nodes and weights of the five-point Gauss-Legendre rule on [0, 1].
constexpr std::array<double, 5> gauss_node = {0.046910077030668004, 0.23076534494715845, 0.5, 0.76923465505284155,
                                              0.95308992296933200};
constexpr std::array<double, 5> gauss_weight = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                                0.23931433524968324, 0.11846344252809454};

// Fields of the finest level are kept as x, y pairs, so that a row of S serves both at once.
VectorXd pairs_of(const Points& points) {
  VectorXd pairs(2 * points.rows());
  for (Index i = 0; i < points.rows(); ++i) pairs.segment<2>(2 * i) = points.row(i).transpose();
  return pairs;
}

// Gradient of the spline's area at a field: with it the area is half their product, since it is a quadratic form.
void area_gradient_into(const VectorXd& x, VectorXd& gradient) {
  const Index n = x.size() / 2;
  const double* p = x.data();
  const auto at = [&](Index i, Index b, Index a, Index c, Index d) {  // neighbours i - 2, i - 1, i + 1, i + 2
    gradient[2 * i] = 5.0 / 12.0 * (p[2 * c + 1] - p[2 * a + 1]) + 1.0 / 24.0 * (p[2 * d + 1] - p[2 * b + 1]);
    gradient[2 * i + 1] = -(5.0 / 12.0 * (p[2 * c] - p[2 * a]) + 1.0 / 24.0 * (p[2 * d] - p[2 * b]));
  };
  for (Index i = 2; i < n - 2; ++i) at(i, i - 2, i - 1, i + 1, i + 2);
  for (const Index i : {Index{0}, Index{1}, n - 2, n - 1}) {
    at(i, modulo(i - 2, n), modulo(i - 1, n), modulo(i + 1, n), modulo(i + 2, n));
  }
}

// Length of the spline with control points x, y in pairs; its gradient too, if there is room for one.
double spline_length(const VectorXd& x, VectorXd* gradient) {
  const Index n = x.size() / 2;
  if (gradient != nullptr) gradient->setZero();
  double sum = 0.0;
  for (Index i = 0; i < n; ++i) {
    const Index before = i == 0 ? n - 1 : i - 1;
    const Index after = i + 1 == n ? 0 : i + 1;
    const Point a = x.segment<2>(2 * i) - x.segment<2>(2 * before);
    const Point b = x.segment<2>(2 * after) - x.segment<2>(2 * i);
    Point slope_a = Point::Zero();
    Point slope_b = Point::Zero();
    for (std::size_t k = 0; k < gauss_node.size(); ++k) {
      const double u = gauss_node[k];
      const Point velocity = (1.0 - u) * a + u * b;
      const double speed = velocity.norm();
      sum += gauss_weight[k] * speed;
      if (gradient == nullptr || speed == 0.0) continue;
      const Point pull = gauss_weight[k] / speed * velocity;
      slope_a += (1.0 - u) * pull;
      slope_b += u * pull;
    }
    if (gradient == nullptr) continue;
    gradient->segment<2>(2 * before) -= slope_a;
    gradient->segment<2>(2 * i) += slope_a - slope_b;
    gradient->segment<2>(2 * after) += slope_b;
  }
  return sum;
}

// y = S z and z = S' y, of x, y pairs.
void synthesize_into(const SparseRows& S, const VectorXd& z, VectorXd& y) {
  const double* value = S.valuePtr();
  const int* column = S.innerIndexPtr();
  const int* start = S.outerIndexPtr();
  for (Index i = 0; i < S.rows(); ++i) {
    double sum_x = 0.0;
    double sum_y = 0.0;
    for (int k = start[i]; k < start[i + 1]; ++k) {
      sum_x += value[k] * z[2 * column[k]];
      sum_y += value[k] * z[2 * column[k] + 1];
    }
    y[2 * i] = sum_x;
    y[2 * i + 1] = sum_y;
  }
}

void adjoint_into(const SparseRows& S, const VectorXd& y, VectorXd& z) {
  z.setZero();
  const double* value = S.valuePtr();
  const int* column = S.innerIndexPtr();
  const int* start = S.outerIndexPtr();
  for (Index i = 0; i < S.rows(); ++i) {
    for (int k = start[i]; k < start[i + 1]; ++k) {
      z[2 * column[k]] += value[k] * y[2 * i];
      z[2 * column[k] + 1] += value[k] * y[2 * i + 1];
    }
  }
}

SparseRows identity(Index n) {
  SparseRows I(n, n);
  I.setIdentity();
  return I;
}

// What a level of `size` control points is at the next finer one.
SparseRows refinement(Index size) {
  Triplets entries;
  for (Index j = 0; j < size; ++j) {
    const FilterColumn column = scaling_column(Scheme::Chaikin, size, j);
    for (std::size_t k = 0; k < column.values.size(); ++k) {
      entries.emplace_back(modulo(column.first + static_cast<Index>(k), 2 * size), j, column.values[k]);
    }
  }
  SparseRows P(2 * size, size);
  P.setFromTriplets(entries.begin(), entries.end());
  return P;
}

// Both members of a corner pair become their mean, the spline's value at the corner.
SparseRows corner_means(Index size, const std::vector<int>& corner_pairs) {
  std::vector<Index> partner(static_cast<std::size_t>(size), -1);
  for (const int i : corner_pairs) {
    const Index next = modulo(i + 1, size);
    partner[static_cast<std::size_t>(i)] = next;
    partner[static_cast<std::size_t>(next)] = i;
  }
  Triplets entries;
  for (Index i = 0; i < size; ++i) {
    const Index other = partner[static_cast<std::size_t>(i)];
    entries.emplace_back(i, i, other < 0 ? 1.0 : 0.5);
    if (other >= 0) entries.emplace_back(i, other, 0.5);
  }
  SparseRows R(size, size);
  R.setFromTriplets(entries.begin(), entries.end());
  return R;
}

// Chaikin's B: the details of `size` control points; 0 just on what a coarser level can be.
SparseRows detail_filter(Index size) {
  Triplets entries;
  for (Index i = 0; i < size / 2; ++i) {
    constexpr std::array<double, 4> filter = {0.25, -0.75, 0.75, -0.25};
    for (Index k = 0; k < 4; ++k) {
      entries.emplace_back(i, modulo(2 * i - 2 + k, size), filter[static_cast<std::size_t>(k)]);
    }
  }
  SparseRows B(size / 2, size);
  B.setFromTriplets(entries.begin(), entries.end());
  return B;
}

// The symmetric system, factored the way that suits its size. Solving allocates nothing.
class Factor {
 public:
  void compute(const Eigen::SparseMatrix<double>& K) {
    dense_ = K.rows() <= most_dense;
    work_.resize(K.rows());
    if (K.rows() == 0) return;
    if (dense_) {
      cholesky_.compute(MatrixXd(K));
    } else {
      sparse_.compute(K);
    }
    if ((dense_ ? cholesky_.info() : sparse_.info()) != Eigen::Success) {
      throw UnsatisfiableConstraints(text("DragSolver: the system of ", K.rows(), " unknowns is singular"));
    }
    if (!dense_) pivots_ = sparse_.vectorD();
  }
  void solve_in_place(VectorXd& b) {
    if (b.size() == 0) return;
    if (dense_) {
      cholesky_.solveInPlace(b);
      return;
    }
    work_.noalias() = sparse_.permutationP() * b;
    sparse_.matrixL().solveInPlace(work_);
    work_.array() /= pivots_.array();
    sparse_.matrixU().solveInPlace(work_);
    b.noalias() = sparse_.permutationPinv() * work_;
  }

 private:
  bool dense_ = true;
  Eigen::LLT<MatrixXd> cholesky_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> sparse_;
  VectorXd pivots_;  // Eigen gives them as a copy
  VectorXd work_;
};

std::optional<double> value_of(const Target& target, double before, const char* what) {
  const auto finite = [&](double value) {
    if (!std::isfinite(value)) throw InvalidInput(text("DragSolver: ", what, " ", value, " is not finite"));
    return value;
  };
  if (const auto* kept = std::get_if<KeptValue>(&target)) return finite(kept->factor) * before;
  if (const auto* reached = std::get_if<GivenValue>(&target)) return finite(reached->value);
  return std::nullopt;
}

std::string join(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : "; ") + name;
  return all;
}

}  // namespace

double area_within_glyph(const std::vector<BezierContour>& glyph, std::size_t contour, double glyph_area) {
  if (contour >= glyph.size()) {
    throw InvalidInput(text("area_within_glyph: contour ", contour, " of a glyph with ", glyph.size()));
  }
  for (std::size_t k = 0; k < glyph.size(); ++k) {
    if (k != contour) glyph_area -= signed_area(glyph[k]);
  }
  return glyph_area;
}

std::string explain(const DragReport& report) {
  switch (report.failure) {
    case DragReport::Failure::None:
      return "";
    case DragReport::Failure::NothingFree:
      return "the rules leave nothing free that changes the area";
    case DragReport::Failure::AreaOutOfReach:
      return text("the area can be from ", report.least_area, " to ", report.largest_area, " only");
    case DragReport::Failure::LengthOutOfReach:
      return text("the length cannot be met; it comes to ", report.length);
  }
  return "";
}

struct DragSolver::State {
  State(const Points& control_points, const DragOptions& drag_options, const std::vector<DragHandle>& drag_handles)
      : options(drag_options), handles(drag_handles), initial(control_points), base(pairs_of(control_points)) {}

  DragOptions options;
  std::vector<DragHandle> handles;

  // What is edited: control points, and area as a form of D: area_before + area_form . D + area of D.
  Points initial;
  VectorXd base;
  VectorXd area_form;
  double area_before = 0.0;
  std::optional<double> area;
  std::optional<double> length;

  // D = S z for x and y alike, z = T q + c. Weights of a handle are on the finest control points.
  SparseRows S;
  Eigen::SparseMatrix<double> T;
  std::vector<std::vector<std::pair<Index, double>>> handle_weights;
  SparseRows rows;
  VectorXd row_values;
  Factor factor;

  // The answer is answer * w and the direction that gives back the area correction * w, with w = (1, deltas); the area
  // of D = S (answer w + t correction w) is area_linear . W + W' area_square W / 2, W = (w, t w).
  MatrixXd answer;
  MatrixXd correction;
  VectorXd area_linear;
  MatrixXd area_square;

  // Buffers of a move.
  VectorXd w, q, z, z_met, D, gradient, length_gradient, moved, row_sums, pulled;
  VectorXd area_right, area_step, length_right, length_step;
  Points field, displaced;
  DragReport report;

  Index size() const { return initial.rows(); }
  double area_scale() const { return std::max(std::abs(area_before), std::abs(*area)); }

  void begin(const std::vector<int>& corner_pairs, const Rows& rules);
  void begin_subspace(const std::vector<int>& corner_pairs, SparseRows& smooth, std::vector<Index>& columns,
                      MatrixXd& wish);
  void begin_rows(const Rows& rules, MatrixXd& fixed);
  Row in_subspace(const Row& row) const;
  void begin_area_line();

  struct Line {  // area along the correction: missing = slope t + bend t^2
    double missing, slope, bend;
  };
  Line line() const;
  std::optional<double> root(const Line& along, double margin) const;
  void ask(std::span<const Point> deltas, double share);
  void synthesize();
  double missing_area() const;
  double find_share(std::span<const Point> deltas);
  bool meet_area(std::span<const Point> deltas, double share, double margin = turn_margin);
  bool bend_area();
  bool meet(std::span<const Point> deltas);
  bool meet_length();
  void publish();
  const DragReport& move(std::span<const Point> deltas);
};

// The unknowns, their fields before corners are respected (smooth) and after (S), and D0 as wish * deltas.
void DragSolver::State::begin_subspace(const std::vector<int>& corner_pairs, SparseRows& smooth,
                                       std::vector<Index>& columns, MatrixXd& wish) {
  const int finest = most_levels(Scheme::Chaikin, size());
  if (!(options.level >= 0.0 && options.level <= finest)) {
    throw InvalidInput(text("DragSolver: level ", options.level, " of a spline with levels 0 to ", finest));
  }
  const int level = static_cast<int>(std::ceil(options.level));
  const int down = finest - level;
  const Index level_size = size() >> down;
  const bool free_details = options.details == DragOptions::Details::Free;

  SparseRows P = identity(level_size);
  for (int k = 0; k < down; ++k) P = refinement(level_size << k) * P;
  const SparseRows R = corner_means(size(), corner_pairs);
  const Index count = static_cast<Index>(handles.size());
  MatrixXd pulls(level_size, count);  // of every handle, on the level's control points
  std::vector<bool> takes_part(static_cast<std::size_t>(level_size), !options.neighbours.has_value());
  for (Index h = 0; h < count; ++h) {
    const DragHandle& handle = handles[static_cast<std::size_t>(h)];
    if (!std::isfinite(handle.t)) throw InvalidInput(text("DragSolver: handle ", h, " is at parameter ", handle.t));
    const Index nearest = modulo(static_cast<Index>(std::floor(coarser_parameter(handle.t, down) + 0.5)), level_size);
    auto& weights = handle_weights.emplace_back();
    if (handle.grip == Grip::Curve) {
      pulls.col(h) = from_level(pull(options.scheme, size(), finest, handle.t, options.level), level).coarse;
      const double least = negligible_pull * pulls.col(h).cwiseAbs().maxCoeff();
      pulls.col(h) = (pulls.col(h).array().abs() < least).select(0.0, pulls.col(h));
      const BasisRow row = basis_row(Scheme::Chaikin, size(), handle.t);
      for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
        if (row.weight[k] != 0.0) weights.emplace_back(row.index[k], row.weight[k]);
      }
    } else {
      if (options.level != level) {
        throw InvalidInput(text("DragSolver: level ", options.level, " is between levels: it has no control points"));
      }
      pulls.col(h) = VectorXd::Unit(level_size, nearest);
      // Row `nearest` of the analysis down to the level.
      VectorXd row = pulls.col(h);
      while (row.size() < size()) {
        constexpr std::array<double, 4> filter = {-0.25, 0.75, 0.75, -0.25};
        VectorXd finer = VectorXd::Zero(2 * row.size());
        for (Index i = 0; i < row.size(); ++i) {
          for (Index k = 0; k < 4; ++k) {
            finer[modulo(2 * i - 2 + k, finer.size())] += filter[static_cast<std::size_t>(k)] * row[i];
          }
        }
        row = std::move(finer);
      }
      for (Index i = 0; i < size(); ++i) {
        if (row[i] != 0.0) weights.emplace_back(i, row[i]);
      }
    }
    for (Index i = 0; i < level_size; ++i) {
      const Index away = std::min(modulo(i - nearest, level_size), modulo(nearest - i, level_size));
      if (pulls(i, h) != 0.0 || away <= options.neighbours.value_or(0)) takes_part[static_cast<std::size_t>(i)] = true;
    }
  }

  // Handles near each other share the work: each still gets its delta.
  MatrixXd got(count, count);
  const MatrixXd pulled_fields = R * (P * pulls);
  for (Index h = 0; h < count; ++h) {
    got.row(h).setZero();
    for (const auto& [i, weight] : handle_weights[static_cast<std::size_t>(h)])
      got.row(h) += weight * pulled_fields.row(i);
  }
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> shared(count, count);
  shared.setThreshold(dependent_handles);
  if (count > 0) {
    shared.compute(got);
    pulls = MatrixXd(pulls * shared.pseudoInverse());
  }

  if (free_details) {
    wish = P * pulls;
    std::vector<bool> finest_part(static_cast<std::size_t>(size()), false);
    for (Index i = 0; i < size(); ++i) {
      for (SparseRows::InnerIterator entry(P, i); entry; ++entry) {
        if (takes_part[static_cast<std::size_t>(entry.col())]) finest_part[static_cast<std::size_t>(i)] = true;
      }
    }
    takes_part = std::move(finest_part);
    P = identity(size());
  } else {
    wish = pulls;
  }
  Triplets chosen;
  for (std::size_t i = 0; i < takes_part.size(); ++i) {
    if (!takes_part[i]) continue;
    chosen.emplace_back(static_cast<Index>(i), static_cast<Index>(columns.size()), 1.0);
    columns.push_back(static_cast<Index>(i));
  }
  SparseRows choice(static_cast<Index>(takes_part.size()), static_cast<Index>(columns.size()));
  choice.setFromTriplets(chosen.begin(), chosen.end());
  smooth = P * choice;
  S = R * smooth;
  S.makeCompressed();
  wish = MatrixXd(choice.transpose() * wish);
}

Row DragSolver::State::in_subspace(const Row& row) const {
  Row reduced{row.name, {}, row.value};
  for (const auto& [variable, coefficient] : row.terms) {
    if (variable < 0 || variable >= 2 * size() || !std::isfinite(coefficient)) {
      throw InvalidInput(text("DragSolver: ", row.name.str(), ": variable ", variable, " of ", 2 * size(),
                              " control points' axes, ", "coefficient ", coefficient));
    }
    for (SparseRows::InnerIterator entry(S, variable / 2); entry; ++entry) {
      reduced.terms.push_back({static_cast<int>(2 * entry.col()) + variable % 2, coefficient * entry.value()});
    }
  }
  return reduced;
}

// T, and c as fixed * (1, deltas).
void DragSolver::State::begin_rows(const Rows& rules, MatrixXd& fixed) {
  Rows taken;
  Rows pins;
  std::vector<Index> pin_column;
  const int variables = static_cast<int>(2 * S.cols());
  RowElimination elimination(variables);
  Triplets entries;
  row_values.resize(static_cast<Index>(rules.size()));
  for (std::size_t r = 0; r < rules.size(); ++r) {
    const Row row = in_subspace(rules[r]);
    if (!std::isfinite(row.value)) throw InvalidInput(text("DragSolver: ", row.name.str(), ": value ", row.value));
    row_values[static_cast<Index>(r)] = row.value;
    for (const auto& term : rules[r].terms)
      entries.emplace_back(static_cast<Index>(r), term.variable, term.coefficient);
    if (elimination.add(row) == RowElimination::Outcome::Taken) taken.push_back(row);
  }
  rows.resize(static_cast<Index>(rules.size()), 2 * size());
  rows.setFromTriplets(entries.begin(), entries.end());
  for (std::size_t h = 0; h < handles.size(); ++h) {
    if (handles[h].hold != DragHandle::Hold::Pinned) continue;
    for (int axis = 0; axis < 2; ++axis) {
      // Any values that no rule and no other pin happens to ask for.
      Row row{text("handle ", h, " is pinned"), {}, std::sqrt(2.0 + static_cast<double>(pins.size()))};
      for (const auto& [i, weight] : handle_weights[h]) row.terms.push_back({static_cast<int>(2 * i) + axis, weight});
      row = in_subspace(row);
      pin_column.push_back(static_cast<Index>(1 + 2 * h) + axis);
      elimination.add(row);
      pins.push_back(std::move(row));
    }
  }
  if (!elimination.conflicts().empty()) {
    const Conflict& conflict = elimination.conflicts().front();
    throw UnsatisfiableConstraints(text("DragSolver: ", join(conflict.rules), ": off by ",
                                        std::abs(conflict.disagreement), " units, with ", S.cols(),
                                        " control points to move"));
  }
  // The constants are linear in the values: once with the rules' own, once for every pin alone.
  const auto space_with = [&](bool rules_values, std::size_t moved_pin) {
    RowElimination again(variables);
    for (Row row : taken) {
      if (!rules_values) row.value = 0.0;
      again.add(row);
    }
    for (std::size_t p = 0; p < pins.size(); ++p) {
      Row row = pins[p];
      row.value = p == moved_pin ? 1.0 : 0.0;
      again.add(row);
    }
    return again.space();
  };
  fixed = MatrixXd::Zero(variables, 1 + 2 * static_cast<Index>(handles.size()));
  const RowElimination::Space space = space_with(true, pins.size());
  fixed.col(0) = space.c;
  T = space.T;
  for (std::size_t p = 0; p < pins.size(); ++p) fixed.col(pin_column[p]) = space_with(false, p).c;
}

void DragSolver::State::begin(const std::vector<int>& corner_pairs, const Rows& rules) {
  if (!(options.alpha > 0.0) || !std::isfinite(options.alpha)) {
    throw InvalidInput(text("DragSolver: alpha ", options.alpha, " is not positive"));
  }
  if (!(options.insistence >= 0.0) || !std::isfinite(options.insistence)) {
    throw InvalidInput(text("DragSolver: insistence ", options.insistence, " is negative"));
  }
  if (options.neighbours && *options.neighbours < 0) {
    throw InvalidInput(text("DragSolver: ", *options.neighbours, " neighbours"));
  }
  if (!is_closed(options.scheme)) throw InvalidInput("DragSolver: an outline is closed, the scheme is not");
  if (!initial.allFinite()) throw InvalidInput("DragSolver: a control point is not finite");

  SparseRows smooth;
  std::vector<Index> columns;
  MatrixXd wish;
  begin_subspace(corner_pairs, smooth, columns, wish);
  MatrixXd fixed;
  begin_rows(rules, fixed);

  // E and |D - D0|^2 on the unknowns of one axis.
  const bool free_details = options.details == DragOptions::Details::Free;
  const int finest = most_levels(Scheme::Chaikin, size());
  const int level = static_cast<int>(std::ceil(options.level));
  const int down = finest - level;
  const Index of = free_details ? size() : size() >> down;
  // With spans of the fractional level as 1: so nothing jumps where a level ends.
  const double finer = (free_details ? finest : level) - options.level;
  const double energy_scale = std::exp2(3.0 * finer);
  const double weight = 2.0 * options.alpha;
  const Eigen::SparseMatrix<double> H = energy_scale * mother_matrix(Form::Energy, Scheme::Chaikin, of);
  Eigen::SparseMatrix<double> fidelity = weight * std::exp2(-finer) * mother_matrix(Form::Product, Scheme::Chaikin, of);
  if (const double f = options.level - (level - 1); f < 1.0 && !free_details && level > 0) {
    const Eigen::SparseMatrix<double> B = detail_filter(of);
    const double least = std::max(f, least_fraction);
    fidelity += weight * (1.0 / (least * least) - 1.0) * Eigen::SparseMatrix<double>(B.transpose() * B);
  }
  Triplets chosen;
  for (std::size_t k = 0; k < columns.size(); ++k) chosen.emplace_back(columns[k], static_cast<Index>(k), 1.0);
  Eigen::SparseMatrix<double> choice(of, static_cast<Index>(columns.size()));
  choice.setFromTriplets(chosen.begin(), chosen.end());
  fidelity = Eigen::SparseMatrix<double>(choice.transpose() * fidelity * choice);
  Eigen::SparseMatrix<double> system = Eigen::SparseMatrix<double>(choice.transpose() * H * choice) + fidelity;

  // Right sides, a column for 1 and one for every delta; and what the handles insist on.
  const Index count = static_cast<Index>(handles.size());
  const Index m = static_cast<Index>(columns.size());
  MatrixXd right = MatrixXd::Zero(2 * m, 1 + 2 * count);
  const MatrixXd wished = fidelity * wish;
  for (Index h = 0; h < count; ++h) {
    VectorXd on_unknowns = VectorXd::Zero(m);
    for (const auto& [i, w_i] : handle_weights[static_cast<std::size_t>(h)]) {
      for (SparseRows::InnerIterator entry(S, i); entry; ++entry) on_unknowns[entry.col()] += w_i * entry.value();
    }
    const double insistence = weight * options.insistence;
    const Eigen::SparseMatrix<double> row = on_unknowns.sparseView();
    if (insistence > 0.0) system += insistence * Eigen::SparseMatrix<double>(row * row.transpose());
    for (int axis = 0; axis < 2; ++axis) {
      for (Index k = 0; k < m; ++k) {
        right(2 * k + axis, 1 + 2 * h + axis) = wished(k, h) + insistence * on_unknowns[k];
      }
    }
  }
  if (options.smoothness == DragOptions::Smoothness::Curve) {
    const MatrixXd pulls = std::exp2(3.0 * (finest - options.level)) *
                           (smooth.transpose() * (mother_matrix(Form::Energy, Scheme::Chaikin, size()) * initial));
    for (Index k = 0; k < m; ++k) right.block<2, 1>(2 * k, 0) -= pulls.row(k).transpose();
  }

  Triplets both_axes;
  for (Index k = 0; k < system.outerSize(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(system, k); entry; ++entry) {
      for (int axis = 0; axis < 2; ++axis) {
        both_axes.emplace_back(2 * entry.row() + axis, 2 * entry.col() + axis, entry.value());
      }
    }
  }
  Eigen::SparseMatrix<double> whole(2 * m, 2 * m);
  whole.setFromTriplets(both_axes.begin(), both_axes.end());
  factor.compute(Eigen::SparseMatrix<double>(T.transpose() * whole * T));

  const Index free = T.cols();
  q.setZero(free);
  z.setZero(2 * m);
  z_met.setZero(2 * m);
  D.setZero(2 * size());
  moved = base;
  gradient.setZero(2 * size());
  pulled.setZero(2 * m);
  for (VectorXd* buffer : {&area_right, &area_step, &length_right, &length_step}) buffer->setZero(free);
  length_gradient.setZero(2 * size());
  row_sums.setZero(rows.rows());
  field = Points::Zero(size(), 2);
  displaced = initial;
  w.setZero(1 + 2 * count);
  report.got.assign(handles.size(), Point::Zero());
  report.free = static_cast<int>(free);
  area = value_of(options.area, area_before, "area");
  length = value_of(options.length, options.length.index() == 0 ? 0.0 : spline_length(base, nullptr), "length");

  answer = fixed;
  for (Index k = 0; k < answer.cols(); ++k) {
    q = T.transpose() * (right.col(k) - whole * fixed.col(k));
    factor.solve_in_place(q);
    answer.col(k) += T * q;
  }
  for (Index h = 0; h < count; ++h) {
    const double thrown = answer.middleCols<2>(1 + 2 * h).cwiseAbs().maxCoeff();
    if (handles[static_cast<std::size_t>(h)].hold == DragHandle::Hold::Pinned && thrown > largest_throw) {
      throw UnsatisfiableConstraints(text("DragSolver: handle ", h,
                                          " is pinned: the rules let it move only if a control point ", "moves ",
                                          thrown, " times as far"));
    }
  }
  if (area) begin_area_line();
}

void DragSolver::State::begin_area_line() {
  const Index count = answer.cols();
  correction.setZero(answer.rows(), count);
  MatrixXd fields(2 * size(), 2 * count);
  for (Index k = 0; k < count; ++k) {
    z = answer.col(k);
    synthesize_into(S, z, D);
    fields.col(k) = D;
    area_gradient_into(D, gradient);
    if (k == 0) gradient += area_form;
    adjoint_into(S, gradient, pulled);
    q = T.transpose() * pulled;
    factor.solve_in_place(q);
    correction.col(k) = T * q;
    z = correction.col(k);
    synthesize_into(S, z, D);
    fields.col(count + k) = D;
  }
  area_linear = fields.transpose() * area_form;
  area_square.resize(2 * count, 2 * count);
  for (Index k = 0; k < 2 * count; ++k) {
    D = fields.col(k);
    area_gradient_into(D, gradient);
    area_square.col(k) = fields.transpose() * gradient;
  }
  D.setZero();
}

DragSolver::State::Line DragSolver::State::line() const {
  const Index n = w.size();
  double missing = *area - area_before;
  double slope = 0.0;
  double bend = 0.0;
  for (Index a = 0; a < n; ++a) {
    missing -= area_linear[a] * w[a];
    slope += area_linear[n + a] * w[a];
    for (Index b = 0; b < n; ++b) {
      missing -= 0.5 * w[a] * area_square(a, b) * w[b];
      slope += w[a] * area_square(a, n + b) * w[b];
      bend += 0.5 * w[a] * area_square(n + a, n + b) * w[b];
    }
  }
  return {missing, slope, bend};
}

// None also where the area turns back within the margin: there rounding would be magnified.
std::optional<double> DragSolver::State::root(const Line& along, double margin) const {
  if (along.slope * along.slope * (1.0 - margin) + 4.0 * along.bend * along.missing < 0.0) return std::nullopt;
  return area_root(along.missing, along.slope, along.bend);
}

void DragSolver::State::ask(std::span<const Point> deltas, double share) {
  w[0] = 1.0;
  for (std::size_t h = 0; h < deltas.size(); ++h) {
    const double part = handles[h].hold == DragHandle::Hold::Pinned ? 1.0 : share;
    w.segment<2>(static_cast<Index>(1 + 2 * h)) = part * deltas[h];
  }
}

void DragSolver::State::synthesize() { synthesize_into(S, z, D); }

// From D itself, by the form: what the report promises is not what the line in closed form says.
double DragSolver::State::missing_area() const {
  const Index n = size();
  const double* d = D.data();
  double linear = 0.0;
  for (Index k = 0; k < 2 * n; ++k) linear += area_form[k] * d[k];
  double near = 0.0;  // cross products of neighbours, and of second neighbours
  double far = 0.0;
  const auto cross = [d](Index a, Index b) { return d[2 * a] * d[2 * b + 1] - d[2 * a + 1] * d[2 * b]; };
  for (Index i = 0; i + 2 < n; ++i) {
    near += cross(i, i + 1);
    far += cross(i, i + 2);
  }
  near += cross(n - 2, n - 1) + cross(n - 1, 0);
  far += cross(n - 2, 0) + cross(n - 1, 1);
  return *area - area_before - linear - (5.0 / 12.0 * near + 1.0 / 24.0 * far);
}

// The largest share of the wishes, but for rounding, with which the area can be met; -1 if there is none.
double DragSolver::State::find_share(std::span<const Point> deltas) {
  const auto is_possible = [&](double share) {
    ask(deltas, share);
    const Line along = line();
    return along.slope > no_slope * area_scale() && root(along, turn_margin).has_value();
  };
  if (is_possible(1.0)) return 1.0;
  if (!is_possible(0.0)) return -1.0;
  double low = 0.0;
  double high = 1.0;
  for (int k = 0; k < share_halvings; ++k) {
    const double middle = 0.5 * (low + high);
    (is_possible(middle) ? low : high) = middle;
  }
  return low;
}

// The answer to a share of the wishes, at the area if there is a root.
bool DragSolver::State::meet_area(std::span<const Point> deltas, double share, double margin) {
  report.passes = 0;
  report.share = share;
  ask(deltas, share);
  z.noalias() = answer * w;
  if (!area) {
    synthesize();
    return true;
  }
  const double scale = area_scale();
  const Line along = line();
  const bool is_flat = !(along.slope > no_slope * scale);
  if (is_flat && std::abs(along.missing) > area_tolerance * scale) {
    report.failure = DragReport::Failure::NothingFree;
    return false;
  }
  std::optional<double> t = is_flat ? std::optional(0.0) : root(along, margin);
  if (!t) {
    const double turn = *area - along.missing - 0.25 * along.slope * along.slope / along.bend;
    report.failure = DragReport::Failure::AreaOutOfReach;
    report.least_area = along.bend > 0.0 ? turn : -infinity;
    report.largest_area = along.bend > 0.0 ? infinity : turn;
    return false;
  }
  if (*t != 0.0) {
    z.noalias() += *t * (correction * w);
    ++report.passes;
  }
  synthesize();
  double error = missing_area();
  for (; report.passes < most_area_passes && std::abs(error) > area_tolerance * scale; ++report.passes) {
    const double slope = along.slope + 2.0 * along.bend * *t;
    if (!(slope > no_slope * scale)) break;
    z.noalias() += error / slope * (correction * w);
    *t += error / slope;
    synthesize();
    error = missing_area();
  }
  if (std::abs(error) <= promise * scale) return true;
  report.failure = DragReport::Failure::AreaOutOfReach;  // but for rounding
  report.least_area = report.largest_area = *area - error;
  return false;
}

// The last resort where the area turns back along the correction and no wish can yield: from that turn on, along the
// direction in which the area bends most towards what is missing, for the change it costs. There is one unless the
// form of the area is semidefinite on the subspace.
bool DragSolver::State::bend_area() {
  const Line along = line();
  if (!(along.bend * along.missing < 0.0)) return false;
  const double wanted = along.missing > 0.0 ? 1.0 : -1.0;

  // The form's eigenvalues against K come in pairs +-: power iteration finds the plane of the largest.
  const auto apply = [&](const VectorXd& x, VectorXd& image, VectorXd& solved) {
    z.noalias() = T * x;
    synthesize();
    area_gradient_into(D, gradient);
    adjoint_into(S, gradient, pulled);
    image.noalias() = T.transpose() * pulled;
    solved = image;
    factor.solve_in_place(solved);
  };
  for (Index k = 0; k < q.size(); ++k) q[k] = std::sin(static_cast<double>(k + 1));
  double eigenvalue = 0.0;
  for (int k = 0; k < most_bend_steps; ++k) {
    apply(q, area_right, area_step);
    const double before = area_step.dot(area_right);
    apply(area_step, length_right, length_step);
    if (!(before > 0.0)) return false;
    eigenvalue = std::sqrt(length_step.dot(length_right) / before);
    q = length_step / length_step.cwiseAbs().maxCoeff();
    if (!q.allFinite()) return false;
  }
  q = length_step + wanted * eigenvalue * area_step;
  q /= q.cwiseAbs().maxCoeff();

  pulled.noalias() = T * q;
  VectorXd& direction = length_gradient;
  synthesize_into(S, pulled, direction);
  area_gradient_into(direction, gradient);
  const double bend = 0.5 * gradient.dot(direction);
  if (!(wanted * bend > no_slope * area_scale())) return false;

  z.noalias() = answer * w;
  z.noalias() -= 0.5 * along.slope / along.bend * (correction * w);
  ++report.passes;
  for (int k = 0; k < 2; ++k, ++report.passes) {
    synthesize();
    const double error = missing_area();
    if (std::abs(error) <= area_tolerance * area_scale()) break;
    area_gradient_into(D, gradient);
    gradient += area_form;
    const double slope = gradient.dot(direction);
    const double sign = slope < 0.0 ? -1.0 : 1.0;
    const std::optional<double> t = area_root(error, sign * slope, bend);
    if (!t) return false;
    z.noalias() += sign * *t * pulled;
  }
  synthesize();
  return std::abs(missing_area()) <= promise * area_scale();
}

// Newton on area and length together: each pass the least change, in the solver's measure, that their linear parts ask.
bool DragSolver::State::meet_length() {
  const double scale = area ? area_scale() : 1.0;
  for (;; ++report.passes) {
    moved = base + D;
    const double length_missing = *length - spline_length(moved, &length_gradient);
    const double area_missing = area ? missing_area() : 0.0;
    report.length = *length - length_missing;
    if (std::abs(area_missing) <= area_tolerance * scale && std::abs(length_missing) <= length_tolerance * *length)
      return true;
    if (report.passes == most_length_passes) {
      return std::abs(area_missing) <= promise * scale && std::abs(length_missing) <= promise * *length;
    }
    adjoint_into(S, length_gradient, pulled);
    length_right.noalias() = T.transpose() * pulled;
    length_step = length_right;
    factor.solve_in_place(length_step);
    const double ll = length_right.dot(length_step);
    if (!(ll > 0.0)) return false;
    if (area) {
      area_gradient_into(D, gradient);
      gradient += area_form;
      adjoint_into(S, gradient, pulled);
      area_right.noalias() = T.transpose() * pulled;
      area_step = area_right;
      factor.solve_in_place(area_step);
      const double aa = area_right.dot(area_step);
      const double al = area_right.dot(length_step);
      const double determinant = aa * ll - al * al;
      if (!(determinant > parallel_gradients * aa * ll)) return false;
      const double along_area = (ll * area_missing - al * length_missing) / determinant;
      const double along_length = (aa * length_missing - al * area_missing) / determinant;
      q = along_area * area_step + along_length * length_step;
    } else {
      q = length_missing / ll * length_step;
    }
    z.noalias() += T * q;
    synthesize();
  }
}

void DragSolver::State::publish() {
  double residual = 0.0;
  row_sums.noalias() = rows * D;
  for (Index r = 0; r < row_sums.size(); ++r) residual = std::max(residual, std::abs(row_sums[r] - row_values[r]));
  report.row_residual = residual;
  for (std::size_t h = 0; h < handles.size(); ++h) {
    Point got = Point::Zero();
    for (const auto& [i, weight] : handle_weights[h]) got += weight * D.segment<2>(2 * i);
    report.got[h] = got;
  }
  if (area) {
    const double missing = missing_area();
    report.area = *area - missing;
    report.area_error = missing / area_scale();
  }
  if (length) report.length_error = (*length - report.length) / *length;
  for (Index i = 0; i < size(); ++i) {
    field(i, 0) = D[2 * i];
    field(i, 1) = D[2 * i + 1];
  }
  displaced = initial + field;
}

bool DragSolver::State::meet(std::span<const Point> deltas) {
  report.failure = DragReport::Failure::None;
  report.attempts = 1;
  report.least_area = report.largest_area = 0.0;
  const bool has_wish =
      std::ranges::any_of(handles, [](const DragHandle& handle) { return handle.hold == DragHandle::Hold::Wished; });
  double share = 1.0;
  if (!meet_area(deltas, share)) {
    ++report.attempts;
    share = has_wish ? find_share(deltas) : -1.0;
    if (share >= 0.0) {
      if (!meet_area(deltas, share)) return false;
      ++report.passes;  // the root that was not there
    } else {
      share = 1.0;
      if (!meet_area(deltas, share, 0.0) && (report.failure != DragReport::Failure::AreaOutOfReach || !bend_area()))
        return false;
    }
    report.failure = DragReport::Failure::None;
  }
  if (!length || meet_length()) return true;
  if (has_wish) {
    // Length has no closed form: by halving.
    double low = -1.0;
    double high = share;
    for (int k = 0; k < length_halvings; ++k) {
      ++report.attempts;
      share = k == 0 ? 0.0 : 0.5 * (low + high);
      const bool is_possible = meet_area(deltas, share) && meet_length();
      if (!is_possible && k == 0) break;
      (is_possible ? low : high) = share;
    }
    if (low >= 0.0 && meet_area(deltas, low) && meet_length()) {
      report.failure = DragReport::Failure::None;
      return true;
    }
  }
  report.failure = DragReport::Failure::LengthOutOfReach;
  return false;
}

const DragReport& DragSolver::State::move(std::span<const Point> deltas) {
  if (deltas.size() != handles.size()) {
    throw InvalidInput(text("DragSolver::move: ", deltas.size(), " deltas for ", handles.size(), " handles"));
  }
  for (const Point& delta : deltas) {
    if (!delta.allFinite()) throw InvalidInput("DragSolver::move: a delta is not finite");
  }
  if (meet(deltas)) {
    z_met = z;
  } else {
    z = z_met;
    synthesize();
  }
  publish();
  return report;
}

namespace {

// The part of the area's linear form that the residual between outline and spline makes: the integral of its cross
// product with D', which has no derivative of the residual in it.
void add_residual(const OutlineCurve& curve, VectorXd& form) {
  const Index n = curve.size();
  std::vector<std::vector<double>> cuts(static_cast<std::size_t>(n));  // of every piece, where segments meet inside it
  for (const OutlineCurve::Node& node : curve.nodes()) {
    if (node.is_knot) continue;
    const Index piece = modulo(static_cast<Index>(std::floor(node.t + 0.5)), n);
    cuts[static_cast<std::size_t>(piece)].push_back(node.t + 0.5 - std::floor(node.t + 0.5));
  }
  for (Index i = 0; i < n; ++i) {
    auto& inner = cuts[static_cast<std::size_t>(i)];
    inner.push_back(0.0);
    inner.push_back(1.0);
    std::sort(inner.begin(), inner.end());
    for (std::size_t c = 0; c + 1 < inner.size(); ++c) {
      const double width = inner[c + 1] - inner[c];
      for (std::size_t k = 0; k < gauss_node.size() && width > 0.0; ++k) {
        const double u = inner[c] + gauss_node[k] * width;
        const double t = static_cast<double>(i) - 0.5 + u;
        const Point residual = gauss_weight[k] * width * (curve.outline_at(t) - curve.spline_at(t));
        const std::array<double, 3> slope = {u - 1.0, 1.0 - 2.0 * u, u};
        for (Index p = 0; p < 3; ++p) {
          const Index j = modulo(i - 1 + p, n);
          form[2 * j] -= slope[static_cast<std::size_t>(p)] * residual.y();
          form[2 * j + 1] += slope[static_cast<std::size_t>(p)] * residual.x();
        }
      }
    }
  }
}

VectorXd spline_area_form(const Points& control_points) {
  const VectorXd x = pairs_of(control_points.rowwise() - control_points.row(0));
  VectorXd form(x.size());
  area_gradient_into(x, form);
  return form;
}

}  // namespace

DragSolver::DragSolver(const OutlineCurve& curve, const std::vector<DragHandle>& handles, const DragOptions& options,
                       const Rows& rows)
    : state_(std::make_unique<State>(curve.control_points(), options, handles)) {
  state_->area_before = signed_area(curve.contour());
  state_->area_form = spline_area_form(curve.control_points());
  add_residual(curve, state_->area_form);
  state_->begin(options.corners == Corners::Keep ? curve.corner_pairs() : std::vector<int>{}, rows);
}

DragSolver::DragSolver(const Points& control_points, const std::vector<DragHandle>& handles, const DragOptions& options,
                       const Rows& rows)
    : state_(std::make_unique<State>(control_points, options, handles)) {
  if (control_points.rows() < fewest(Scheme::Chaikin)) {
    throw InvalidInput(text("DragSolver: ", control_points.rows(), " control points"));
  }
  state_->area_before = limit_area(control_points);
  state_->area_form = spline_area_form(control_points);
  state_->begin({}, rows);
}

DragSolver::~DragSolver() = default;
DragSolver::DragSolver(DragSolver&&) noexcept = default;
DragSolver& DragSolver::operator=(DragSolver&&) noexcept = default;

const DragReport& DragSolver::move(std::span<const Point> deltas) { return state_->move(deltas); }
const Points& DragSolver::control_points() const { return state_->displaced; }
const Points& DragSolver::field() const { return state_->field; }

void DragSolver::cancel() {
  State& state = *state_;
  state.z_met.setZero();
  state.D.setZero();
  state.field.setZero();
  state.displaced = state.initial;
}

DragResult solve_once(const OutlineCurve& curve, const std::vector<DragHandle>& handles,
                      const std::vector<Point>& deltas, const DragOptions& options, const Rows& rows) {
  DragSolver solver(curve, handles, options, rows);
  const DragReport report = solver.move(deltas);
  return {solver.field(), report};
}

}  // namespace fontcore
