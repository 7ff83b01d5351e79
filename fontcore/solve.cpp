#include "fontcore/solve.h"

#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr double vanishing_coefficient = 1e-11;  // of the row's largest: what substitution leaves of a cancelled term
constexpr double contradiction = 1e-9;           // font units: less is rounding
constexpr double length_tolerance = 1e-9;        // relative, as `length` is measured to
constexpr double area_tolerance = 1e-13;         // relative

}  // namespace

void RowElimination::add_to(Sum& sum, int key, double value) {
  auto* const at = std::ranges::lower_bound(sum, key, {}, &Term::key);
  if (at != sum.end() && at->key == key) {
    at->value += value;
  } else {
    sum.insert(at, {key, value});
  }
}

void RowElimination::add_to(Sum& sum, const Sum& more, double factor) {
  for (const auto& [key, value] : more) add_to(sum, key, factor * value);
}

const RowElimination::Expression* RowElimination::expression_of(int variable) const {
  const int index = expression_of_[static_cast<std::size_t>(variable)];
  return index < 0 ? nullptr : &expressions_[static_cast<std::size_t>(index)];
}

RowElimination::Outcome RowElimination::add(Row row) {
  const int id = static_cast<int>(rows_.size());
  Expression reduced;
  reduced.constant = row.value;
  reduced.multipliers = {{id, 1.0}};
  double scale = 0.0;
  for (const auto& [variable, coefficient] : row.terms) {
    scale = std::max(scale, std::abs(coefficient));
    const Expression* const known = expression_of(variable);
    if (known == nullptr) {
      add_to(reduced.terms, variable, coefficient);
      continue;
    }
    add_to(reduced.terms, known->terms, coefficient);
    reduced.constant -= coefficient * known->constant;
    add_to(reduced.multipliers, known->multipliers, -coefficient);
  }
  const auto gone = std::ranges::remove_if(
      reduced.terms, [&](double value) { return std::abs(value) <= vanishing_coefficient * scale; }, &Term::value);
  reduced.terms.erase(gone.begin(), gone.end());

  if (reduced.terms.empty()) {
    if (std::abs(reduced.constant) <= contradiction) {
      ++redundant_;
      return Outcome::Redundant;
    }
    Conflict conflict{{row.name.str()}, reduced.constant};
    for (const auto& [other, multiplier] : reduced.multipliers) {
      if (other == id || std::abs(multiplier) <= contradiction) continue;
      const std::string name = rows_[static_cast<std::size_t>(other)].name.str();
      if (std::find(conflict.rules.begin(), conflict.rules.end(), name) == conflict.rules.end())
        conflict.rules.push_back(name);
    }
    conflicts_.push_back(std::move(conflict));
    return Outcome::Conflicting;
  }

  Expression& solved = reduced;
  auto* const pivot = std::max_element(solved.terms.begin(), solved.terms.end(), [](const Term& a, const Term& b) {
    return std::abs(a.value) < std::abs(b.value) * (1.0 - 1e-9);
  });
  const int variable = pivot->key;
  const double coefficient = pivot->value;
  solved.terms.erase(pivot);
  for (Term& term : solved.terms) term.value = -term.value / coefficient;
  solved.constant /= coefficient;
  for (Term& multiplier : solved.multipliers) multiplier.value /= coefficient;

  // What was expressed by the new dependent variable is expressed by the free ones instead.
  for (const int user : users_[static_cast<std::size_t>(variable)]) {
    Expression& expression = expressions_[static_cast<std::size_t>(expression_of_[static_cast<std::size_t>(user)])];
    auto* const mention = std::ranges::lower_bound(expression.terms, variable, {}, &Term::key);
    if (mention == expression.terms.end() || mention->key != variable) continue;
    const double factor = mention->value;
    expression.terms.erase(mention);
    add_to(expression.terms, solved.terms, factor);
    expression.constant += factor * solved.constant;
    add_to(expression.multipliers, solved.multipliers, factor);
    for (const Term& term : solved.terms) users_[static_cast<std::size_t>(term.key)].push_back(user);
  }
  users_[static_cast<std::size_t>(variable)].clear();
  for (const Term& term : solved.terms) users_[static_cast<std::size_t>(term.key)].push_back(variable);
  expression_of_[static_cast<std::size_t>(variable)] = static_cast<int>(expressions_.size());
  expressions_.push_back(std::move(solved));
  rows_.push_back(std::move(row));
  return Outcome::Taken;
}

void RowElimination::add(Rows rows) {
  for (Row& row : rows) add(std::move(row));
}

RowElimination::Space RowElimination::space() const {
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<int> column(static_cast<std::size_t>(variables_), -1);
  int free = 0;
  for (int v = 0; v < variables_; ++v) {
    if (expression_of(v) != nullptr) continue;
    entries.emplace_back(v, free, 1.0);
    column[static_cast<std::size_t>(v)] = free++;
  }
  Space space{Eigen::SparseMatrix<double>(variables_, free), Eigen::VectorXd::Zero(variables_)};
  for (int v = 0; v < variables_; ++v) {
    const Expression* const expression = expression_of(v);
    if (expression == nullptr) continue;
    space.c[v] = expression->constant;
    for (const auto& [other, value] : expression->terms)
      entries.emplace_back(v, column[static_cast<std::size_t>(other)], value);
  }
  space.T.setFromTriplets(entries.begin(), entries.end());
  return space;
}

double RowElimination::residual(const Eigen::VectorXd& displacement) const {
  double worst = 0.0;
  for (const Row& row : rows_) {
    double sum = -row.value;
    for (const auto& [variable, coefficient] : row.terms) sum += coefficient * displacement[variable];
    worst = std::max(worst, std::abs(sum));
  }
  return worst;
}

std::optional<double> area_root(double missing, double slope, double bend) {
  const double discriminant = slope * slope + 4.0 * bend * missing;
  if (discriminant < 0.0) return std::nullopt;
  const double divisor = slope + std::sqrt(discriminant);
  if (divisor > 0.0) return 2.0 * missing / divisor;
  return missing == 0.0 ? std::optional(0.0) : std::nullopt;
}

struct LeastChange::Factored {
  Factored(RowElimination rules, const Eigen::SparseMatrix<double>& objective)
      : rows(std::move(rules)), space(rows.space()), H(objective) {}

  RowElimination rows;
  RowElimination::Space space;
  Eigen::SparseMatrix<double> H;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor;

  Eigen::VectorXd displacement(const Eigen::VectorXd& q) const {
    Eigen::VectorXd d = space.c;
    if (q.size() > 0) d += space.T * q;
    return d;
  }
};

LeastChange::LeastChange(const Eigen::SparseMatrix<double>& H, RowElimination rows)
    : factored_(std::make_unique<Factored>(std::move(rows), H)) {
  const auto& T = factored_->space.T;
  if (T.cols() == 0) return;
  const Eigen::SparseMatrix<double> K = T.transpose() * H * T;
  factored_->factor.compute(K);
  if (factored_->factor.info() != Eigen::Success) {
    throw UnsatisfiableConstraints(text("LeastChange: the system of ", K.rows(), " unknowns is singular"));
  }
}

LeastChange::~LeastChange() = default;
LeastChange::LeastChange(LeastChange&&) noexcept = default;
LeastChange& LeastChange::operator=(LeastChange&&) noexcept = default;

LeastChange::Solution LeastChange::solve(const Eigen::VectorXd& f) const {
  const Factored& system = *factored_;
  Eigen::VectorXd q(system.space.T.cols());
  if (q.size() > 0) q = system.factor.solve(system.space.T.transpose() * (f - system.H * system.space.c));
  Solution solution{system.displacement(q), {}};
  solution.report.free = static_cast<int>(q.size());
  solution.report.row_residual = system.rows.residual(solution.displacement);
  return solution;
}

LeastChange::Solution LeastChange::solve(const Eigen::VectorXd& f, const BezierContour& contour, double area) const {
  const Factored& system = *factored_;
  Solution solution = solve(f);
  const double size = std::max(std::abs(area), std::abs(signed_area(contour)));
  const auto missing = [&](const Eigen::VectorXd& d) { return area - signed_area(displaced(contour, d)); };
  double error = missing(solution.displacement);
  for (; std::abs(error) > area_tolerance * size && solution.report.passes < 8; ++solution.report.passes) {
    if (solution.report.free == 0) {
      solution.report.failed = "the rules leave nothing free to keep the area with";
      break;
    }
    const Points gradient = area_gradient(displaced(contour, solution.displacement));
    Eigen::VectorXd g(2 * gradient.rows());
    for (Eigen::Index i = 0; i < gradient.rows(); ++i) g.segment<2>(2 * i) = gradient.row(i).transpose();
    const Eigen::VectorXd Tg = system.space.T.transpose() * g;
    const Eigen::VectorXd v = system.factor.solve(Tg);
    const double slope = Tg.dot(v);
    if (!(slope > 1e-14 * size)) {
      solution.report.failed = "what the rules leave free does not change the area";
      break;
    }
    // Along v the area is exactly quadratic: error = slope t + bend t^2.
    const Eigen::VectorXd step = system.space.T * v;
    const double bend = error - missing(solution.displacement + step) - slope;
    const std::optional<double> t = area_root(error, slope, bend);
    if (!t) {
      solution.report.failed = "the area is out of reach";
      break;
    }
    solution.displacement += *t * step;
    const double before = std::abs(error);
    error = missing(solution.displacement);
    if (solution.report.passes > 0 && std::abs(error) >= before) {  // rounding has the last word
      ++solution.report.passes;
      break;
    }
  }
  solution.report.area_error = error / size;
  solution.report.row_residual = system.rows.residual(solution.displacement);
  return solution;
}

LeastChange::Solution LeastChange::solve(const Eigen::VectorXd& f, const BezierContour& contour,
                                         std::optional<double> area, double length) const {
  const Factored& system = *factored_;
  Solution solution = solve(f);
  SolveReport& report = solution.report;
  const Eigen::Vector2d size(std::max(std::abs(area.value_or(0.0)), std::abs(signed_area(contour))),
                             std::max(length, fontcore::length(contour)));
  // Relative errors, those of the area 0 if it is not asked for.
  const auto errors = [&](const BezierContour& now) {
    return Eigen::Vector2d(area ? (*area - signed_area(now)) / size[0] : 0.0,
                           (length - fontcore::length(now)) / size[1]);
  };
  BezierContour now = displaced(contour, solution.displacement);
  Eigen::Vector2d error = errors(now);
  constexpr int most_passes = 24;  // near its limit a length converges slowly
  for (; std::abs(error[0]) > area_tolerance || std::abs(error[1]) > length_tolerance; ++report.passes) {
    if (report.free == 0) report.failed = "the rules leave nothing free to keep area and length with";
    if (report.passes == most_passes) report.failed = text("the length is out of reach: ", error[1], " off, relative");
    if (!report.failed.empty()) break;
    Eigen::MatrixXd g(contour.points().size(), 2);
    const Points gradients[] = {area ? area_gradient(now) : Points(Points::Zero(now.point_count(), 2)),
                                length_gradient(now)};
    for (Eigen::Index k = 0; k < 2; ++k) {
      for (Eigen::Index i = 0; i < now.point_count(); ++i)
        g.col(k).segment<2>(2 * i) = gradients[k].row(i).transpose() / size[k];
    }
    const Eigen::MatrixXd Tg = system.space.T.transpose() * g;
    const Eigen::MatrixXd V = system.factor.solve(Tg);
    const Eigen::Matrix2d S = Tg.transpose() * V;
    const Eigen::Vector2d share = S.completeOrthogonalDecomposition().solve(error);  // one of the two may be idle
    solution.displacement += system.space.T * (V * share);
    now = displaced(contour, solution.displacement);
    error = errors(now);
  }
  report.area_error = error[0];
  report.length_error = error[1];
  report.row_residual = system.rows.residual(solution.displacement);
  return solution;
}

BezierContour displaced(const BezierContour& contour, const Eigen::VectorXd& displacement) {
  Points points = contour.points();
  for (Eigen::Index i = 0; i < points.rows(); ++i) points.row(i) += displacement.segment<2>(2 * i).transpose();
  return contour.with_points(std::move(points));
}

}  // namespace fontcore
