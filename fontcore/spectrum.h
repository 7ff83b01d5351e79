#pragma once

#include <array>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// Octaves of feature size that `octave_energies` tells apart.
inline constexpr std::size_t octave_count = 7;

/// How much of an outline is in features of what size: energy of its detail by octaves, `finest * 2^k` and shorter.
///
/// Every contour is the closed sequence of its points at equal steps of arc length, at most a quarter of `finest`
/// apart, from its topmost point (of several the leftmost), smoothed once. Octave k is what (1, 2, 1)/4, the mask of
/// linear B-splines, over every 2^(k + 1) th point takes away from what the finer ones have left; its energy is the sum
/// of squares times the step. All points are kept at every octave, where a decimated hierarchy keeps every second: so
/// the energies depend neither on start point, order and direction of the contours nor on where the outline lies.
///
/// Units   energy in font units to the third: squared displacement times length.
/// Exact   for the polyline through points of the outline at most a quarter of `finest` apart. An outline longer than
///         16,384 `finest` is taken as coarsely as leaves no more of them.
/// Throws  InvalidInput if `finest` is not positive.
/// Source  [FS94] energy of details by level; without decimation as in the algorithme a trous.
std::array<double, octave_count> octave_energies(const std::vector<BezierContour>& contours, double finest);

}  // namespace fontcore
