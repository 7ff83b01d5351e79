#include "fontcore/tensor.h"

#include "fontcore/error.h"

namespace fontcore {

namespace {

void require_grid(const char* function, const Grid& grid) {
  if (grid.empty()) throw InvalidInput(text(function, ": a grid without coordinates"));
  for (const Eigen::MatrixXd& coordinate : grid) {
    if (coordinate.rows() != grid[0].rows() || coordinate.cols() != grid[0].cols()) {
      throw InvalidInput(text(function, ": coordinates of ", grid[0].rows(), "×", grid[0].cols(), " and ",
                              coordinate.rows(), "×", coordinate.cols(), " control points"));
    }
  }
}

// A curve operation on the columns of every coordinate, and one on the rows of what that gives.
template <typename AlongU, typename AlongV>
Grid apply(const Grid& grid, const AlongU& along_u, const AlongV& along_v) {
  Grid result;
  for (const Eigen::MatrixXd& coordinate : grid) {
    const Coefficients columns = along_u(coordinate);
    result.emplace_back(along_v(columns.transpose()).transpose());
  }
  return result;
}

}  // namespace

MultiresPatch decompose(Scheme scheme_u, Scheme scheme_v, const Grid& grid, int levels_u, int levels_v) {
  require_grid("decompose", grid);
  return {apply(
              grid, [&](const CoefficientsView& x) { return stack(decompose(scheme_u, x, levels_u)); },
              [&](const CoefficientsView& x) { return stack(decompose(scheme_v, x, levels_v)); }),
          scheme_u, scheme_v, levels_u, levels_v};
}

Grid reconstruct(const MultiresPatch& patch) { return fractional(patch, patch.levels_u, patch.levels_v); }

Grid fractional(const MultiresPatch& patch, double level_u, double level_v) {
  require_grid("fractional", patch.coefficients);
  return apply(
      patch.coefficients,
      [&](const CoefficientsView& x) { return fractional(unstack(patch.scheme_u, x, patch.levels_u), level_u); },
      [&](const CoefficientsView& x) { return fractional(unstack(patch.scheme_v, x, patch.levels_v), level_v); });
}

Eigen::RowVectorXd evaluate(Scheme scheme_u, Scheme scheme_v, const Grid& grid, double u, double v) {
  require_grid("evaluate", grid);
  Eigen::RowVectorXd point(static_cast<Eigen::Index>(grid.size()));
  for (std::size_t k = 0; k < grid.size(); ++k) {
    const Coefficients across = evaluate(scheme_u, grid[k], u).transpose();
    point[static_cast<Eigen::Index>(k)] = evaluate(scheme_v, across, v)[0];
  }
  return point;
}

MultiresPatch drag(MultiresPatch patch, double u, double v, const Eigen::RowVectorXd& move, double level_u,
                   double level_v) {
  require_grid("drag", patch.coefficients);
  if (move.size() != static_cast<Eigen::Index>(patch.coefficients.size()) || !move.allFinite()) {
    throw InvalidInput(text("drag: a move of ", move.size(), " numbers, some perhaps not finite, for ",
                            patch.coefficients.size(), " coordinates"));
  }
  const Eigen::MatrixXd& shape = patch.coefficients[0];
  const Coefficients along_u = stack(pull(patch.scheme_u, shape.rows(), patch.levels_u, u, level_u));
  const Coefficients along_v = stack(pull(patch.scheme_v, shape.cols(), patch.levels_v, v, level_v));
  for (std::size_t k = 0; k < patch.coefficients.size(); ++k) {
    patch.coefficients[k] += move[static_cast<Eigen::Index>(k)] * along_u * along_v.transpose();
  }
  return patch;
}

}  // namespace fontcore
