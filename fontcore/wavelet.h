#pragma once

#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// Chaikin's scheme on closed control polygons: uniform quadratic B-splines, local and exact filters.
///
/// Parameters of neighbouring levels: t_fine = 2 t_coarse - 1/2. Fine piece i spans t in [i - 1/2, i + 1/2].
namespace chaikin {

struct Split {
  Points coarse;
  Points detail;
};

/// Splits a closed control polygon into one of half the size and the detail lost.
///
/// The detail is whatever `synthesize` needs to give `fine` back, up to rounding. Repeated analysis can grow content of
/// period three by 1.25 a level; reconstruction stays at 1e-15.
///
/// Shape   fine 2m×k; coarse m×k; detail m×k. Any number of columns: points, displacements or plain numbers.
/// Units   those of `fine`; detail is a displacement.
/// Throws  InvalidInput if the number of rows is odd or below 2 * min_coarse.
/// Source  [HBS05] eq. 7.
Split analyze(const Points& fine);

/// The fine polygon of a coarse one and its detail.
///
/// Shape   coarse m×2; detail m×2; result 2m×2.
/// Throws  InvalidInput if the shapes differ or are below min_coarse.
/// Source  [HBS05] eq. 8, whose second line is misprinted: before d_{i+1} it must read minus.
Points synthesize(const Points& coarse, const Points& detail);

/// `synthesize` without detail: the same curve with twice the control points (Chaikin's corner cutting).
Points refine(const Points& coarse);

constexpr int min_coarse = 4;  ///< fewest control points of a level: below, the filters would meet themselves

}  // namespace chaikin

/// A closed control polygon as its coarsest version and the details from coarse to fine.
///
/// Level 0 is coarsest; level j has coarse.rows() * 2^j control points, and details[j] leads from level j to j + 1.
struct MultiresCurve {
  Points coarse;
  std::vector<Points> details;

  int levels() const { return static_cast<int>(details.size()); }
};

/// Analyses `levels` times.
/// Throws  InvalidInput if the number of rows is not at least 4 * 2^levels and divisible by 2^levels.
/// Source  [HBS05] eq. 6; the filter bank of [FS94].
MultiresCurve decompose(const Points& fine, int levels);
Points reconstruct(const MultiresCurve& curve);

/// Parameter of level `finest - levels` for the parameter t of the finest level, and back.
double coarser_parameter(double t, int levels);
double finer_parameter(double t, int levels);

}  // namespace fontcore
