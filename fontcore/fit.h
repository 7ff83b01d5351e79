#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/edit.h"
#include "fontcore/outline_curve.h"
#include "fontcore/solve.h"

namespace fontcore {

/// How hard the handle's move is meant.
enum class HandleMove {
  Forced,  ///< a pair of rows, wherever rules and area let it
  Wished,  ///< part of the wish, like the rest of the field
  Pinned,  ///< a pair of rows that must hold: what contradicts it is an error
};

/// What a structure-preserving edit is to reach, and within what.
struct StructureEdit {
  /// A point of the outline, and how it is to move.
  struct Handle {
    OutlineCurve::Location at;
    Point move = Point::Zero();
  };
  Points field;  ///< the wish, if it comes on the spline's control points: their displacement, N×2, font units
  std::vector<Handle> handles;
  HandleMove handle_move = HandleMove::Forced;
  double breadth = 0.0;  ///< of the edit; segments further from every handle than twice this keep their bits
  OutlineRules rules;
  Rows rows;                     ///< further rules on the outline's points, taken before those
  std::optional<double> area;    ///< signed area the contour is to have
  std::optional<double> length;  ///< length the contour is to have
};

/// An outline of the same structure, moved.
struct StructureFit {
  BezierContour contour;  ///< not rounded
  SolveReport report;
  std::vector<Point> got;            ///< how the handles moved
  std::vector<std::string> against;  ///< rules that stood against their moves; empty if all were met
  double off_wish = 0.0;             ///< largest distance of the displacement from the wish, at the samples, font units
};

/// Moves an outline's own points: the least-squares image of the wish inside what the rules leave, at exactly the area.
///
/// Segments, kinds and start point stay; what is solved is what is emitted. A forced handle is a pair of rows, taken
/// last: where the rules or the area stand against it, or where forcing would throw other points further than three
/// times the longest move, it stays a wish, and `against` names what stood against it. Segments nearer to a handle than
/// the breadth are released, up to twice that where the area cannot be given back gently; a line that is reached goes
/// as a whole. With a breadth of at most a quarter of the contour no more than half of its segments are released.
/// Nearly smooth joins that the edit would open are closed.
///
/// Exact   rows to rounding; area to 1e-12 and length to 1e-9 relative unless `report.failed` says otherwise; segments
/// not released, bit
///         for bit.
/// Throws  UnsatisfiableConstraints naming the rules that a pinned handle contradicts.
/// Source  DESIGN, "And one consequence".
StructureFit refit_structure(const OutlineCurve& curve, const StructureEdit& edit);
/// The same for a wish of any kind: the displacement at u of a segment, `s` of arc length from its start.
using Wish = std::function<Point(int segment, double u, double s)>;
StructureFit refit_structure(const OutlineArcs& outline, const Wish& wish, const StructureEdit& edit);

}  // namespace fontcore
