#include "fontcore/solve.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/profile.h"

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
  auto* const kept_end = std::remove_if(reduced.terms.begin(), reduced.terms.end(), [&](const Term& term) {
    return std::abs(term.value) <= vanishing_coefficient * scale;
  });
  reduced.terms.erase(kept_end, reduced.terms.end());

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

RowElimination::Substitution RowElimination::substitution() const {
  Substitution result;
  result.first.reserve(static_cast<std::size_t>(variables_) + 1);
  result.c = Eigen::VectorXd::Zero(variables_);
  std::vector<int> column(static_cast<std::size_t>(variables_), -1);
  std::size_t terms = 0;
  for (int v = 0; v < variables_; ++v) {
    const Expression* const expression = expression_of(v);
    if (expression == nullptr) column[static_cast<std::size_t>(v)] = result.free++;
    terms += expression == nullptr ? 1 : expression->terms.size();
  }
  result.terms.reserve(terms);
  for (int v = 0; v < variables_; ++v) {
    result.first.push_back(static_cast<int>(result.terms.size()));
    const Expression* const expression = expression_of(v);
    if (expression == nullptr) {
      result.terms.push_back({column[static_cast<std::size_t>(v)], 1.0});
      continue;
    }
    result.c[v] = expression->constant;
    for (const auto& [other, value] : expression->terms)
      result.terms.push_back({column[static_cast<std::size_t>(other)], value});
  }
  result.first.push_back(static_cast<int>(result.terms.size()));
  return result;
}

RowElimination::Space RowElimination::space() const {
  const Substitution by_row = substitution();
  std::vector<Eigen::Triplet<double>> entries;
  for (int v = 0; v < variables_; ++v) {
    for (const auto& [free, value] : by_row.of(v)) entries.emplace_back(v, free, value);
  }
  Space space{Eigen::SparseMatrix<double>(variables_, by_row.free), by_row.c};
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

namespace {

using Entries = std::span<const Eigen::Triplet<double>>;
using Substitution = RowElimination::Substitution;

// Numbers the unknowns anew: those that hang together through T'HT one after the other, in the order they had. The
// coordinates of an outline do not hang together but through slanted lines, nor do the stretches between held points:
// so the rows of a profile stay short.
void gather_unknowns(Substitution& space, const Entries& H) {
  std::vector<int> parent(static_cast<std::size_t>(space.free));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      int& up = parent[static_cast<std::size_t>(i)];
      up = parent[static_cast<std::size_t>(up)];
      i = up;
    }
    return i;
  };
  const auto join = [&](int i, int j) {
    i = root(i);
    j = root(j);
    parent[static_cast<std::size_t>(std::max(i, j))] = std::min(i, j);
  };
  for (std::size_t v = 0; v + 1 < space.first.size(); ++v) {
    const auto terms = space.of(static_cast<int>(v));
    for (std::size_t k = 1; k < terms.size(); ++k) join(terms[0].key, terms[k].key);
  }
  for (const auto& entry : H) {
    if (entry.row() <= entry.col()) continue;
    const auto a = space.of(entry.row());
    const auto b = space.of(entry.col());
    if (!a.empty() && !b.empty()) join(a[0].key, b[0].key);
  }
  std::vector<int> next(parent.size() + 1, 0);  // per root, where its unknowns go
  for (int i = 0; i < space.free; ++i) ++next[static_cast<std::size_t>(root(i)) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<int> place(parent.size());
  for (int i = 0; i < space.free; ++i) place[static_cast<std::size_t>(i)] = next[static_cast<std::size_t>(root(i))]++;
  for (auto& term : space.terms) term.key = place[static_cast<std::size_t>(term.key)];
}

// T'HT.
ProfileSystem reduced_system(const Substitution& space, const Entries& H) {
  std::vector<int> first(static_cast<std::size_t>(space.free));
  std::iota(first.begin(), first.end(), 0);
  for (const auto& entry : H) {
    for (const auto& a : space.of(entry.row())) {
      int& begin = first[static_cast<std::size_t>(a.key)];
      for (const auto& b : space.of(entry.col())) begin = std::min(begin, b.key);
    }
  }
  ProfileSystem system(std::move(first));
  for (const auto& entry : H) {
    for (const auto& a : space.of(entry.row())) {
      for (const auto& b : space.of(entry.col())) {
        if (b.key <= a.key) system.entry(a.key, b.key) += a.value * b.value * entry.value();
      }
    }
  }
  return system;
}

std::vector<Eigen::Triplet<double>> entries_of(const Eigen::SparseMatrix<double>& H) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index k = 0; k < H.outerSize(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(H, k); entry; ++entry)
      entries.emplace_back(static_cast<int>(entry.row()), static_cast<int>(entry.col()), entry.value());
  }
  return entries;
}

}  // namespace

struct LeastChange::Factored {
  Factored(RowElimination rules, const Entries& H) : rows(std::move(rules)), space(rows.substitution()) {
    gather_unknowns(space, H);
    K = reduced_system(space, H);
    Eigen::VectorXd Hc = Eigen::VectorXd::Zero(space.c.size());
    for (const auto& entry : H) Hc[entry.row()] += entry.value() * space.c[entry.col()];
    held = reduced(Hc);
  }

  // T' x
  Eigen::VectorXd reduced(const Eigen::VectorXd& x) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(space.free);
    for (Eigen::Index v = 0; v < x.size(); ++v) {
      for (const auto& [free, value] : space.of(static_cast<int>(v))) q[free] += value * x[v];
    }
    return q;
  }
  // T q
  Eigen::VectorXd expanded(const Eigen::VectorXd& q) const {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(space.c.size());
    for (Eigen::Index v = 0; v < x.size(); ++v) {
      for (const auto& [free, value] : space.of(static_cast<int>(v))) x[v] += value * q[free];
    }
    return x;
  }

  RowElimination rows;
  Substitution space;
  ProfileSystem K{{}};   // T'HT, factored
  Eigen::VectorXd held;  // T'Hc
};

LeastChange::LeastChange(std::span<const Eigen::Triplet<double>> H, RowElimination rows)
    : factored_(std::make_unique<Factored>(std::move(rows), H)) {
  if (!factored_->K.factor()) {
    throw UnsatisfiableConstraints(text("LeastChange: the system of ", factored_->K.size(), " unknowns is singular"));
  }
}

LeastChange::LeastChange(const Eigen::SparseMatrix<double>& H, RowElimination rows)
    : LeastChange(entries_of(H), std::move(rows)) {}

LeastChange::~LeastChange() = default;
LeastChange::LeastChange(LeastChange&&) noexcept = default;
LeastChange& LeastChange::operator=(LeastChange&&) noexcept = default;

LeastChange::Solution LeastChange::solve(const Eigen::VectorXd& f) const {
  const Factored& system = *factored_;
  const Eigen::VectorXd right = system.reduced(f) - system.held;
  Solution solution{system.space.c + system.expanded(system.K.solve(right)), {}};
  solution.report.free = system.space.free;
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
    const Eigen::VectorXd Tg = system.reduced(g);
    const Eigen::VectorXd v = system.K.solve(Tg);
    const double slope = Tg.dot(v);
    if (!(slope > 1e-14 * size)) {
      solution.report.failed = "what the rules leave free does not change the area";
      break;
    }
    // Along v the area is exactly quadratic: error = slope t + bend t^2.
    const Eigen::VectorXd step = system.expanded(v);
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
    Eigen::VectorXd g(contour.points().size());
    Eigen::MatrixXd Tg(report.free, 2);
    const Points gradients[] = {area ? area_gradient(now) : Points(Points::Zero(now.point_count(), 2)),
                                length_gradient(now)};
    for (Eigen::Index k = 0; k < 2; ++k) {
      for (Eigen::Index i = 0; i < now.point_count(); ++i)
        g.segment<2>(2 * i) = gradients[k].row(i).transpose() / size[k];
      Tg.col(k) = system.reduced(g);
    }
    const Eigen::MatrixXd V = system.K.solve(Tg);
    const Eigen::Matrix2d S = Tg.transpose() * V;
    const Eigen::Vector2d share = S.completeOrthogonalDecomposition().solve(error);  // one of the two may be idle
    solution.displacement += system.expanded(V * share);
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
