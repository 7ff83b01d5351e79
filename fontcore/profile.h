#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace fontcore {

/// A symmetric positive definite system whose rows are short: row i begins at a column of its own and runs to the
/// diagonal. Elimination in the given order stays within these rows.
///
/// So it is for splines and for points along a contour; where they close, the last rows alone are long. For systems of
/// a few dozen unknowns, made and solved once, this is several times as fast as a general sparse matrix.
class ProfileSystem {
 public:
  /// Row i begins at column first[i] <= i. All entries are 0.
  explicit ProfileSystem(std::vector<int> first) : first_(std::move(first)) {
    begin_.reserve(first_.size());
    int entries = 0;
    for (int i = 0; i < size(); ++i) {
      begin_.push_back(entries - first_[at(i)]);
      entries += i - first_[at(i)] + 1;
    }
    entries_.assign(at(entries), 0.0);
  }

  /// All entries 0 again.
  void clear() { std::fill(entries_.begin(), entries_.end(), 0.0); }

  int size() const { return static_cast<int>(first_.size()); }
  /// Entry of a row and a column not beyond the diagonal, within the row.
  double& entry(int row, int column) { return entries_[at(begin_[at(row)] + column)]; }

  /// A row, indexed by column.
  double* row(int row) { return entries_.data() + begin_[at(row)]; }

  /// Replaces the matrix by its factors L D L'. False if a pivot is not positive.
  bool factor() {
    for (int i = 0; i < size(); ++i) {
      double* const row = entries_.data() + begin_[at(i)];
      double pivot = row[i];
      for (int j = first_[at(i)]; j < i; ++j) {  // row[j] is L(i, j) D(j) until the row is done
        const double* const other = entries_.data() + begin_[at(j)];
        for (int k = std::max(first_[at(i)], first_[at(j)]); k < j; ++k) row[j] -= row[k] * other[k];
      }
      for (int j = first_[at(i)]; j < i; ++j) {
        const double scaled = row[j] / entry(j, j);
        pivot -= row[j] * scaled;
        row[j] = scaled;
      }
      if (!(pivot > 0.0)) return false;
      row[i] = pivot;
    }
    return true;
  }

  /// Solves for every column, after `factor`.
  template <typename Columns>
  Columns solve(Columns x) const {
    for (int i = 0; i < size(); ++i) {
      const double* const row = entries_.data() + begin_[at(i)];
      for (int j = first_[at(i)]; j < i; ++j) x.row(i) -= row[j] * x.row(j);
    }
    for (int i = 0; i < size(); ++i) x.row(i) /= entries_[at(begin_[at(i)] + i)];
    for (int i = size() - 1; i > 0; --i) {
      const double* const row = entries_.data() + begin_[at(i)];
      for (int j = first_[at(i)]; j < i; ++j) x.row(j) -= row[j] * x.row(i);
    }
    return x;
  }

 private:
  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  std::vector<int> first_;       // per row
  std::vector<int> begin_;       // per row, of its entries less `first_`
  std::vector<double> entries_;  // row by row
};

}  // namespace fontcore
