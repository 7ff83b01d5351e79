#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/contour.h"

namespace fontcore {

/// Rows that cannot hold together: their names, and by how much they disagree.
struct Conflict {
  std::vector<std::string> rules;
  double disagreement = 0.0;  ///< font units
};

/// Linear rows taken one after the other and solved away: displacement = T q + c with q free.
///
/// Every displacement of that form obeys every row taken. A row that follows from those before is redundant and
/// vanishes; one that contradicts them is not taken, and is reported with the rows it contradicts, found by their
/// multipliers.
///
/// Source  DESIGN decision 5: substitution with the largest pivot.
class RowElimination {
 public:
  explicit RowElimination(int variables)
      : variables_(variables), expression_of_(static_cast<std::size_t>(variables), -1), users_(expression_of_.size()) {}

  enum class Outcome { Taken, Redundant, Conflicting };
  Outcome add(Row row);
  void add(Rows rows);

  const std::vector<Conflict>& conflicts() const { return conflicts_; }
  int redundant() const { return redundant_; }

  /// A term of a sum, by what it is of.
  struct Term {
    int key;
    double value;
  };
  /// T row by row, the keys counting free variables, and c.
  struct Substitution {
    int free = 0;
    std::vector<int> first;   ///< per variable, and one more: where its terms begin
    std::vector<Term> terms;  ///< of one variable by rising key
    Eigen::VectorXd c;

    std::span<const Term> of(int variable) const {
      const auto v = static_cast<std::size_t>(variable);
      return std::span(terms).subspan(static_cast<std::size_t>(first[v]),
                                      static_cast<std::size_t>(first[v + 1] - first[v]));
    }
  };
  Substitution substitution() const;
  /// T (variables × free) and c.
  struct Space {
    Eigen::SparseMatrix<double> T;
    Eigen::VectorXd c;
  };
  Space space() const;

  /// Largest residual of the rows taken, from the rows as they were given.
  double residual(const Eigen::VectorXd& displacement) const;

 private:
  /// A sum of few terms, by rising key.
  using Sum = InlineVector<Term, 4>;
  // variable = sum of coefficient * free variable + constant; and the rows, with multipliers, that say so.
  struct Expression {
    Sum terms;
    double constant = 0.0;
    Sum multipliers;
  };
  static void add_to(Sum& sum, int key, double value);
  static void add_to(Sum& sum, const Sum& more, double factor);
  const Expression* expression_of(int variable) const;

  int variables_ = 0;
  int redundant_ = 0;
  std::vector<Row> rows_;
  std::vector<Expression> expressions_;
  std::vector<int> expression_of_;           // per variable its expression; -1 if it is free
  std::vector<InlineVector<int, 4>> users_;  // per free variable the dependent ones that may mention it
  std::vector<Conflict> conflicts_;
};

/// The t nearest to 0 with slope t + bend t^2 = missing, slope >= 0: how far to go along a line on which the area is
/// exactly quadratic. None if the area turns back before.
///
/// Exact   to rounding, also where bend is small: the root is taken in the form that does not cancel.
std::optional<double> area_root(double missing, double slope, double bend);

/// What a solve came to.
struct SolveReport {
  int passes = 0;             ///< of the area's root: one meets it, another cleans rounding
  double area_error = 0.0;    ///< relative to the contour's area
  double length_error = 0.0;  ///< relative to the contour's length, if that was asked for
  double row_residual = 0.0;  ///< largest, font units
  int free = 0;               ///< unknowns that the rules leave
  std::string failed;         ///< why the area could not be met; empty if it was or was not asked
};

/// The least change under rows: min 1/2 d'Hd - f'd over d = T q + c; with an area to meet, exactly, along K^-1 T' grad
/// A.
///
/// Factored once; every solve is back substitution and a few sweeps over the contour. Rows hold to rounding, the area
/// to 1e-12 relative; the change is least but for the area's correction, which follows one direction.
///
/// Source  [HBS05] eq. 20 with rows eliminated and the area's quadratic solved in closed form.
class LeastChange {
 public:
  /// Shape   H 2n×2n, symmetric, positive definite on what the rows leave; as entries in any order, those of one place
  ///         added up.
  /// Throws  UnsatisfiableConstraints if it is not.
  LeastChange(std::span<const Eigen::Triplet<double>> H, RowElimination rows);
  LeastChange(const Eigen::SparseMatrix<double>& H, RowElimination rows);
  ~LeastChange();
  LeastChange(LeastChange&&) noexcept;
  LeastChange& operator=(LeastChange&&) noexcept;

  struct Solution {
    Eigen::VectorXd displacement;
    SolveReport report;
  };
  Solution solve(const Eigen::VectorXd& f) const;
  /// `contour` is what the displacement is of, `area` the signed area it is to have afterwards.
  Solution solve(const Eigen::VectorXd& f, const BezierContour& contour, double area) const;
  /// The same with the length of the outline to have too, by Newton's method on both; 1e-9 relative.
  Solution solve(const Eigen::VectorXd& f, const BezierContour& contour, std::optional<double> area,
                 double length) const;

 private:
  struct Factored;
  std::unique_ptr<Factored> factored_;
};

/// The contour with its points displaced; points whose displacement is 0 keep their bits.
BezierContour displaced(const BezierContour& contour, const Eigen::VectorXd& displacement);

}  // namespace fontcore
