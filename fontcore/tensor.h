#pragma once

#include <vector>

#include "fontcore/wavelet.h"

namespace fontcore {

/// Control points of a tensor-product surface: one matrix for each coordinate or attribute, entry (i, j) of control
/// point i along u and j along v.
///
/// Rows may be the control points of a contour and columns its masters along a design axis; or a patch in space.
using Grid = std::vector<Eigen::MatrixXd>;

/// A tensor-product surface as coarse control points and details in both directions: the coefficients (c, d, d, ...) of
/// every row and every column, coarse first.
///
/// The curve filters run along u, then along v; a scheme and a number of levels of its own for each.
///
/// Source  [FS94] surfaces: tensor-product B-splines edited at different levels.
struct MultiresPatch {
  Grid coefficients;  ///< shaped like the grid
  Scheme scheme_u = Scheme::EndpointCubic;
  Scheme scheme_v = Scheme::EndpointCubic;
  int levels_u = 0;
  int levels_v = 0;
};

/// Throws  InvalidInput if the grid is empty, its matrices differ in shape, sizes cannot be halved so often, or an
/// entry
///         is not finite.
MultiresPatch decompose(Scheme scheme_u, Scheme scheme_v, const Grid& grid, int levels_u, int levels_v);
Grid reconstruct(const MultiresPatch& patch);

/// Control points between levels, in the two directions apart: each as `fractional` has it for curves.
/// Throws  InvalidInput if a level is not from 0 to the levels of its direction.
Grid fractional(const MultiresPatch& patch, double level_u, double level_v);

/// The point at (u, v), one number for each matrix of the grid.
/// Throws  InvalidInput if u or v is not finite, or the grid is too small for the schemes.
Eigen::RowVectorXd evaluate(Scheme scheme_u, Scheme scheme_v, const Grid& grid, double u, double v);

/// Direct manipulation: the surface's point at (u, v) is moved by `move`, broadly or narrowly in each direction by
/// itself.
///
/// The change is the product of the two curves' changes (`pull`), so that a broad level along v and a narrow one along
/// u move one feature of a contour in all masters, or the whole contour in one of them.
///
/// Shape   move: one number for each matrix of the grid.
/// Throws  InvalidInput as `pull`, or if the move's width differs.
MultiresPatch drag(MultiresPatch patch, double u, double v, const Eigen::RowVectorXd& move, double level_u,
                   double level_v);

}  // namespace fontcore
