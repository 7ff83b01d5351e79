#pragma once

#include "fontcore/contour.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// The displacement that moves the broad shape of an outline near one place, before any rule is applied.
struct Sweep {
  Points field;        ///< displacement of the spline's control points, N×2
  double t = 0.0;      ///< parameter of the handle; the field there is the move, exactly
  double level = 0.0;  ///< fractional level j + t: wavelet details finer than level ceil(j + t) are 0
};

/// Direct manipulation at a fractional level: the outline's point at parameter t is moved by `move`, and a stretch of
/// about `breadth` follows.
///
/// Breadth becomes a level by interpolating the arc lengths that integer levels would move: five spans, three basis
/// functions of three spans each about t. At level j + f the broad answer, least squares at level j, is mixed with the
/// narrow one, at level j + 1, by g = f^2: dc^j = (1 - g) broad + g A narrow, dd^j = (g / f) B narrow; then the whole
/// is scaled so that the handle gets its move.
///
/// Shape   field N×2.
/// Units   font units.
/// Throws  InvalidInput if breadth is not positive.
/// Source  [FS94] editing at fractional levels, direct manipulation, editing a desired portion of the curve.
Sweep sweep(const OutlineCurve& curve, double t, const Point& move, double breadth);

/// Length of outline that direct manipulation at parameter t moves, at `levels_down` below the finest.
double breadth_of_level(const OutlineCurve& curve, double t, int levels_down);

/// The field with both members of every corner pair moved by its value at the corner, so that corners stay corners.
Points respect_corners(const OutlineCurve& curve, Points field);

}  // namespace fontcore
