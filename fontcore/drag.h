#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "fontcore/arcwise.h"
#include "fontcore/constraint.h"
#include "fontcore/contour.h"
#include "fontcore/edit.h"
#include "fontcore/outline_curve.h"
#include "fontcore/wavelet.h"

namespace fontcore {

// What an edit does with the area of a contour, or with the length of its spline: one of three.

/// It may become what it likes.
struct AnyValue {};
/// It stays what it is, times a factor: 1.03 for a counter that grows by 3 %.
struct KeptValue {
  double factor = 1.0;
};
/// It becomes a value: signed square units for an area, units for a length.
struct GivenValue {
  double value = 0.0;
};
using Target = std::variant<AnyValue, KeptValue, GivenValue>;

/// The signed area that one contour of a glyph must have for the whole glyph to have `glyph_area`, the others staying.
/// Throws  InvalidInput if there is no such contour.
double area_within_glyph(const std::vector<BezierContour>& glyph, std::size_t contour, double glyph_area);

/// A place of the curve that is dragged.
struct DragHandle {
  /// A wish goes as far as rules and area let it; a pin is a rule of its own.
  enum class Hold { Wished, Pinned };
  double t = 0.0;  ///< parameter at the finest level
  Hold hold = Hold::Wished;
  Grip grip = Grip::Curve;
};

/// Which displacements an edit may choose from, and which of them is best.
///
/// Chosen is the D that makes E + alpha |D - D0|^2 least, D0 what `pull` makes of the handles alone: a large alpha
/// stays near to the shape asked for, a small one makes it smooth. E is the integral of |D''|^2 and |.|^2 that of the
/// square, over the parameter with spans of the (fractional) level as 1, so that the same alpha means the same at every
/// level; [HBS05] has the sum of squared coefficients in place of the latter. At level j + f the details of level j
/// count 1 / f^2 times in it, so that nothing jumps where f goes to 0.
///
/// Source  [HBS05] eq. 20, sections 4.3 and 4.4; [FS94] fractional levels.
struct DragOptions {
  double level = 0.0;               ///< fractional, of the periodic spline; see `level_of_breadth`
  Scheme scheme = Scheme::Chaikin;  ///< of D0: Chaikin or Orthogonal
  double alpha = 100.0;             ///< above 0
  /// Whose bending energy E is: that of the displacement, or as in [HBS05] that of the whole displaced spline.
  enum class Smoothness { Displacement, Curve } smoothness = Smoothness::Displacement;
  /// Whether details finer than the level stay as they are or are unknowns too ([HBS05] fig. 7 and fig. 5). If they
  /// are, the unknowns are the finest control points, which span the same curves.
  enum class Details { Fixed, Free } details = Details::Fixed;
  /// How many control points of the level on either side of the one nearest to a handle take part ([HBS05] fig. 6);
  /// those that D0 itself moves always do. Without a number all take part.
  std::optional<int> neighbours;
  /// Weight of D - D0 at the handles, in weights of a coefficient: at 1000 a wish that no rule hinders falls short by
  /// about 0.1 %. 0 as in [HBS05], where a handle is nothing but D0. Pins are not weighed, they are met.
  double insistence = 1000.0;
  Target area = KeptValue{};
  Target length = AnyValue{};
  /// Whether both control points of a corner move by D's value at the corner, so that corners stay corners.
  Corners corners = Corners::Keep;
};

/// What one move came to.
struct DragReport {
  /// Of the attempt that gave the answer: one root in closed form meets the area, another cleans rounding; with a
  /// length they are Newton's.
  int passes = 0;
  int attempts = 1;         ///< above 1 if not all of the wishes could be met
  double area = 0.0;        ///< of the displaced outline, signed
  double area_error = 0.0;  ///< relative; 0 if the area is free
  double length = 0.0;      ///< of the displaced spline; measured only if it is to be met
  double length_error = 0.0;
  double row_residual = 0.0;  ///< largest, font units, from the rows as they were given
  int free = 0;               ///< unknowns that the rules leave
  std::vector<Point> got;     ///< how the handles moved
  /// Share of the wishes that was asked for: below 1 where area and length cannot be met with all of it.
  double share = 1.0;

  enum class Failure {
    None,
    NothingFree,      ///< the rules leave nothing that changes area or length
    AreaOutOfReach,   ///< see `least_area` and `largest_area`
    LengthOutOfReach  ///< no step towards area and length together
  } failure = Failure::None;
  /// The certificate of AreaOutOfReach: the areas that can be reached from the wish along the correction K^-1 grad A.
  /// Beyond that turn no direction of the subspace has been found along which the area bends towards the target.
  double least_area = 0.0;
  double largest_area = 0.0;

  bool is_met() const { return failure == Failure::None; }
};
/// Why a move was not met, in one line; empty if it was.
std::string explain(const DragReport& report);

/// A drag: an outline, what must hold, and an answer for every place that the handles are moved to.
///
/// Everything that does not depend on the move is done when the drag begins: rows are eliminated in the subspace, the
/// system is factored, and as its answer and the direction that gives back the area are linear in the move, they are
/// solved for once. A move is then a sum of a few columns, one root in closed form and one synthesis. Moves do not
/// depend on each other, and allocate nothing after the first.
///
/// Area is always that of outline + D: the outline's, exactly, plus a linear form in D, plus the area of D. The linear
/// form is exact for the spline, and for the residual between outline and spline five Gauss points a smooth piece; it
/// is good to 1e-10 of the area. Length is that of the spline, by five Gauss points a piece.
///
/// Exact   rows to 1e-9 font units; area to 1e-12 relative of that form, length too, unless the report says otherwise.
///         Control points that the subspace does not reach keep their bits.
/// Source  [HBS05] section 4; DESIGN, Constrained edit.
class DragSolver {
 public:
  /// Shape   rows on displacements of the spline's control points: variable 2 * point + axis.
  /// Throws  InvalidInput if an option is out of range, a handle's t is not finite, or a row is out of range;
  ///         UnsatisfiableConstraints naming the rows if they contradict each other, or a pin, in the subspace.
  DragSolver(const OutlineCurve& curve, const std::vector<DragHandle>& handles, const DragOptions& options,
             const Rows& rows = {});
  /// A bare spline, which is its own outline. It has no corners but those of its rows.
  DragSolver(const Points& control_points, const std::vector<DragHandle>& handles, const DragOptions& options,
             const Rows& rows = {});
  ~DragSolver();
  DragSolver(DragSolver&&) noexcept;
  DragSolver& operator=(DragSolver&&) noexcept;

  /// The answer to handles that are `deltas` away from where the drag began. A move that cannot be met leaves the curve
  /// as the last one that could be left it; what the report measures is then that curve.
  ///
  /// Shape   one delta a handle, in their order.
  /// Throws  InvalidInput if the number differs or a delta is not finite.
  const DragReport& move(std::span<const Point> deltas);

  const Points& control_points() const;  ///< displaced, N×2
  const Points& field() const;           ///< their displacement D, N×2
  void cancel();                         ///< back to where the drag began
  Points commit() const { return control_points(); }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// One move, for those who do not drag.
struct DragResult {
  Points field;  ///< N×2
  DragReport report;
};
DragResult solve_once(const OutlineCurve& curve, const std::vector<DragHandle>& handles,
                      const std::vector<Point>& deltas, const DragOptions& options, const Rows& rows = {});

}  // namespace fontcore
