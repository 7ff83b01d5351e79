#pragma once

#include <memory>
#include <vector>

#include "fontcore/wavelet.h"

namespace fontcore {

/// The knots of a B-spline curve, in order, each repeated as often as the curve is to lose smoothness there.
///
/// Across a knot of multiplicity m the derivatives up to degree - m agree. A cubic may jump in curvature at a double
/// knot, in tangent at a triple one, in position at one that stands four times. Open curves run from their first knot
/// to their last, both degree + 1 times, and begin and end in a control point; closed ones repeat after `period`.
/// Control point i belongs to the B-spline on knots i .. i + degree + 1.
class KnotVector {
 public:
  int degree() const { return degree_; }
  bool is_closed() const { return period_ > 0.0; }
  double period() const { return period_; }  ///< 0 if open
  /// The number of control points.
  Eigen::Index size() const;
  /// Where the parameter begins and ends; closed: one period.
  double start() const { return knots_.front(); }
  double end() const { return is_closed() ? start() + period_ : knots_.back(); }
  /// All knots with their repetitions; closed: those of one period, as many as control points.
  const std::vector<double>& knots() const { return knots_; }
  /// Knot i; closed: of any period.
  double knot(Eigen::Index i) const;
  /// How often t stands among the knots; 0 if it is none.
  int multiplicity(double t) const;

  friend bool operator==(const KnotVector&, const KnotVector&) = default;

 private:
  KnotVector(int degree, std::vector<double> knots, double period);
  friend KnotVector open_knots(int degree, std::vector<double> knots);
  friend KnotVector closed_knots(int degree, std::vector<double> knots, double period);

  int degree_;
  double period_;
  std::vector<double> knots_;
};

/// Knots of an open curve, both ends written degree + 1 times.
///
/// Throws  InvalidInput if the degree is not in [1, 5], or naming the first knot that is not finite, less than the one
///         before it or repeated more than degree + 1 times, or an end that is repeated less often.
KnotVector open_knots(int degree, std::vector<double> knots);

/// Knots of one period of a closed curve, degree + 1 or more.
///
/// Throws  InvalidInput as for `open_knots`, if the knots span a period or more, or if adding the period to two of them
///         makes them one.
KnotVector closed_knots(int degree, std::vector<double> knots, double period);

/// Greville abscissae: the mean of the degree knots inside each B-spline. As control points they draw x(t) = t on open
/// curves.
Eigen::VectorXd greville(const KnotVector& knots);

/// From which side a curve is looked at: the two differ where it, or the derivative asked for, jumps.
enum class Side { Left, Right };

/// The curve, or a derivative of it, at t. At its ends an open curve is seen from inside.
///
/// Shape   points size×k, the result 1×k.
/// Exact   where a control point lies on the curve (knots of multiplicity degree or more): that point, bit for bit.
/// Throws  InvalidInput if the rows differ from `knots.size()`, if t is not finite or off the open curve, or if the
///         derivative is negative.
Eigen::RowVectorXd evaluate(const KnotVector& knots, const CoefficientsView& points, double t, int derivative = 0,
                            Side side = Side::Right);

/// One polynomial of a curve: degree + 1 Bezier points over [start, end].
struct SplinePiece {
  double start = 0.0;
  double end = 0.0;
  Coefficients points;
};

/// The pieces between knots that differ, in order. Unless the curve jumps neighbours share their end: up to rounding,
/// at knots of multiplicity degree bit for bit.
///
/// Throws  InvalidInput if the rows differ from `knots.size()`.
std::vector<SplinePiece> bezier_pieces(const KnotVector& knots, const CoefficientsView& points);

/// The control points of the same curve on more knots.
/// Throws  InvalidInput if degree or period differ, a coarse knot is missing in `fine`, or the rows differ.
Coefficients refine(const KnotVector& coarse, const KnotVector& fine, const CoefficientsView& points);

/// What stays when a curve is made coarser.
enum class Jumps {
  Fitted,  ///< knots stay, and what may jump there is fitted like the rest
  Held,    ///< so do the curve's points at the ends and at knots of multiplicity degree or more that stay
};

struct NonuniformOptions {
  std::vector<double> kept;  ///< simple knots that stay at every level
  Jumps jumps = Jumps::Fitted;
};

/// Knots of all levels, coarse to fine.
///
/// From a level to the coarser one, knots that are repeated, `kept` or ends stay as they are; of every run of others
/// between two that stay, the first, third, fifth and so on go. A run that is used up stops while others go on. Where
/// nothing stays on a closed curve its first knot does.
struct KnotLadder {
  std::vector<KnotVector> levels;
};

/// How many coarser levels there are: until no knot can go, or fewer than degree + 1 would be left of a closed curve.
/// Throws  InvalidInput if a kept knot is not in `fine`.
int most_levels(const KnotVector& fine, const std::vector<double>& kept = {});
/// Throws  InvalidInput if a kept knot is not in `fine`, or levels is negative or above `most_levels`.
KnotLadder make_ladder(const KnotVector& fine, int levels, const std::vector<double>& kept = {});

/// Control points at the coarsest knots and the details from coarse to fine; details[j] leads from level j to j + 1,
/// one row for every knot that went.
struct NonuniformCurve {
  Coefficients coarse;
  std::vector<Coefficients> details;
};

/// Wavelets on a ladder of knots: a jump that the finest knots allow survives at every level.
///
/// The coarse curve is the nearest in least squares over the parameter, so every wavelet is orthogonal to every coarse
/// curve. For each knot that goes, one fine B-spline E that bends at it is chosen such that coarse functions and these
/// span the fine ones well; the wavelet is E less its nearest coarse curve, its detail a displacement. With
/// `Jumps::Held` "nearest" is among coarse curves through the held points, where wavelets vanish.
///
/// Factorises once and is cheap to copy; all that follows takes linear time. Knots may be very uneven: with spans of
/// any ratio up to 1e6 no detail of degree 3 or less was 8 times as large as the control points.
///
/// Source  [FS94] future work, discontinuities of various orders; [DL92] for decomposition on knots of any spacing.
class NonuniformScheme {
 public:
  /// Throws  InvalidInput as `make_ladder` does, or if knots are so uneven that rounding leaves a level singular.
  NonuniformScheme(const KnotVector& fine, int levels, const NonuniformOptions& options = {});

  int levels() const;
  /// Throws  InvalidInput if the level is not in [0, levels].
  const KnotVector& knots(int level) const;

  /// Shape   fine n×k with n = knots(levels()).size().
  /// Exact   `reconstruct` gives `fine` back up to rounding; held points bit for bit, at every level.
  /// Throws  InvalidInput if the rows differ, or naming the first entry that is not finite.
  NonuniformCurve decompose(const CoefficientsView& fine) const;
  /// Throws  InvalidInput if the shapes do not fit, or naming the first entry that is not finite. So do all below.
  Coefficients reconstruct(const NonuniformCurve& curve) const;
  /// Control points of a level, over knots(level).
  /// Throws  InvalidInput if the level is not in [0, levels].
  Coefficients points(const NonuniformCurve& curve, int level) const;
  /// Control points of the curve between two levels: c^{j+t} = P c^j + t Q d^j, for level j + t with t in (0, 1].
  ///
  /// Continuous in the level, over knots(ceil(level)).
  ///
  /// Throws  InvalidInput if the level is not in [0, levels].
  /// Source  [FS94] smoothing, the fractional-level curve.
  Coefficients fractional(const NonuniformCurve& curve, double level) const;

  /// All coefficients seen from a level, below each other: c^L, d^L, ..., d^{n-1}.
  /// Throws  InvalidInput if the level is not in [0, levels].
  Coefficients stack(const NonuniformCurve& curve, int level) const;
  /// The matrix of a form on those coefficients times every column.
  ///
  /// Integrals are over the parameter as the knots measure it, piece by piece: a jump itself adds nothing.
  ///
  /// Shape   coefficients n×k.
  /// Throws  InvalidInput if the rows differ or the level is not in [0, levels].
  /// Source  [HBS05] eq. 10 to 19.
  Coefficients apply(Form form, int level, const CoefficientsView& coefficients) const;
  /// Signed area from columns 0 and 1 of the coefficients seen from a level: 1/2 of the integral of x y' - x' y.
  ///
  /// Exact   to rounding, the same from every level.
  /// Throws  InvalidInput if the level is not in [0, levels] or there are fewer than two columns.
  double area(const NonuniformCurve& curve, int level) const;
  /// Integral of |c''|^2 over the parameter, all columns, piece by piece.
  ///
  /// Exact, Throws  as for `area`; one column is enough.
  double energy(const NonuniformCurve& curve, int level) const;

 private:
  struct Ladder;
  void require_fitting(const char* function, const NonuniformCurve& curve) const;
  Coefficients points_at(const char* function, const NonuniformCurve& curve, double level) const;

  std::shared_ptr<const Ladder> ladder_;
};

}  // namespace fontcore
