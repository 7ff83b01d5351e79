#pragma once

#include <vector>

#include "fontcore/outline_curve.h"
#include "fontcore/profile.h"
#include "fontcore/wavelet.h"

namespace fontcore {

/// A multiresolution curve that goes on to finer levels in some stretches only.
///
/// Up to the levels of its base it is an ordinary curve. Beyond, only details of the stretches that were refined are
/// stored; all others are 0. Memory and work grow with the stretches, not with the curve.
///
/// Units   t is the parameter of the base's finest level, as for `basis_row`; a closed curve's stretch may run over 0.
/// Source  [FS94] future work: a sparse representation, a pruned tree of wavelet coefficients.
class SparseCurve {
 public:
  explicit SparseCurve(MultiresCurve base);

  const MultiresCurve& base() const { return base_; }
  Scheme scheme() const { return base_.scheme; }
  /// The finest level anywhere; details lead to it from the level below.
  int levels() const { return base_.levels() + static_cast<int>(finer_.size()); }
  /// Control points that the whole curve would have at a level from `base().levels()` on.
  Eigen::Index size(int level) const;

  /// Lets details up to `level` exist between two parameters: those whose wavelets lie wholly in between.
  ///
  /// The curve stays as it is. What is set later changes it nowhere else.
  ///
  /// Throws  InvalidInput if the stretch is empty, leaves an open arc, is longer than the curve, or is too short for
  /// any
  ///         wavelet of that level; or if the level is not above the base's.
  void refine(double from, double to, int level);

  /// Neighbouring details that are stored: wavelets first .. first + rows - 1.
  struct Run {
    Eigen::Index first = 0;
    Coefficients details;
  };
  /// Those that lead from `level` to level + 1, by rising index; level from `base().levels()` on.
  const std::vector<Run>& runs(int level) const;
  /// Throws  InvalidInput if the detail is not stored, its width differs or it is not finite.
  void set_detail(int level, Eigen::Index index, const Eigen::RowVectorXd& value);
  /// Zero where nothing is stored.
  Eigen::RowVectorXd detail(int level, Eigen::Index index) const;

  /// Moves the curve's point at t by `move` with stored details of one level alone: least squares over their wavelets.
  /// Throws  InvalidInput if no stored wavelet of that level reaches t.
  void pull(double t, int level, const Eigen::RowVectorXd& move);

  /// Control points first .. first + count - 1 of a level from `base().levels()` on; closed: indices modulo its size.
  Coefficients control_points(int level, Eigen::Index first, Eigen::Index count) const;
  /// The point at t with all details.
  Eigen::RowVectorXd evaluate(double t) const;

  /// Forgets stored details no longer than `tolerance`.
  void prune(double tolerance);
  /// Rows of numbers held: control points of the base, its details and those of the stretches.
  Eigen::Index stored() const;
  /// The same curve with every detail written out.
  MultiresCurve dense() const;

 private:
  const Run* run_of(int level, Eigen::Index index) const;

  MultiresCurve base_;
  Coefficients points_;                  // of the base's finest level
  std::vector<std::vector<Run>> finer_;  // per level beyond the base
};

/// A curve as pieces of its levels, coarse where that will do, each a polynomial of its own; ends meet.
struct CompressedCurve {
  std::vector<Bezier> pieces;
  std::vector<int> levels;  ///< of every piece: the level it is a span of
  double bound = 0.0;       ///< proved: no point of a piece is farther from the curve's point at the same parameter
};

/// The spans of differing levels that stay within `tolerance` of the finest level, in the largest norm: for drawing at
/// a device's resolution, where continuity of tangents is of no use.
///
/// From the whole curve down, the coarsest span that is within. The bound is proved by the coefficients: two
/// polynomials differ by no more than their Bernstein coefficients do. It is taken against the finest level itself,
/// where [FS94] adds the bounds of all levels between: never larger. Where neighbours of two levels leave a gap both
/// ends go to its middle; the bound is that of the pieces after this, and what is beyond it then is split after all.
///
/// Shape   two columns.
/// Exact   bound <= tolerance to rounding, and proved.
/// Throws  InvalidInput if the tolerance is negative or no number, or the curve is not in the plane.
/// Source  [FS94] scan conversion and curve compression: DrawSeg, ErrBound.
CompressedCurve compress(const MultiresCurve& curve, double tolerance);

/// Whether corners cut an outline into arcs that are curves of their own, or the whole contour is one curve across
/// them.
enum class Corners { Keep, Round };

struct ArcwiseOptions {
  double tolerance = 0.25;  ///< distance allowed between outline and arcs at equal arc length, font units
  Corners corners = Corners::Keep;
  Scheme open = Scheme::HeldCubic;     ///< of arcs between corners
  Scheme closed = Scheme::Orthogonal;  ///< of contours without corners
  int most_spans = 2048;               ///< of an arc; one that needs more stays at its last distance
};

/// One arc of an outline as a single spline over its arc length.
struct ArcSpline {
  Scheme scheme = Scheme::HeldCubic;
  Points points;          ///< control points
  int levels = 0;         ///< how often the spans can be halved again
  double start = 0.0;     ///< arc length of the outline where it begins
  double length = 0.0;    ///< arc length of the outline along it
  double distance = 0.0;  ///< largest between outline and spline at equal arc length, as sampled
  bool is_line = false;   ///< a single line of the outline

  double span_length() const { return length / static_cast<double>(detail_count(scheme, points.rows())); }
  /// The parameter at a distance from the start, in spans.
  double parameter_at(double spans) const { return is_closed(scheme) ? spans - 0.5 : spans; }
};

/// A system on the control points of a spline, but for `held` ones at either end: zero, with room for all pairs of
/// basis functions that overlap.
ProfileSystem spline_system(Scheme scheme, Eigen::Index size, Eigen::Index held);

/// The arcs of an outline, every one by as few spans, doubled again and again, as its distance allows; an open arc has
/// its ends on the outline.
/// Throws  InvalidInput if the tolerance is not positive or a scheme is of the wrong kind.
std::vector<ArcSpline> fit_arcs(const OutlineArcs& outline, const ArcwiseOptions& options = {});

/// An outline as its arcs from corner to corner, each a multiresolution curve of its own over arc length.
///
/// With held schemes corners are in place at every level. An arc has as many levels as it needs and not more: a stem is
/// one span while a bowl has many, and when arcs are coarsened together one that is down to its fewest points stops.
/// Every arc can be refined in a stretch of its own.
///
/// Units   font units; s in arc length of the outline from the start of its first arc.
/// Exact   the arcs are least squares over arc length, with their ends on the outline.
/// Source  DESIGN decision 3; [FS94] discontinuities.
class ArcwiseCurve {
 public:
  explicit ArcwiseCurve(const OutlineArcs& outline, const ArcwiseOptions& options = {});
  explicit ArcwiseCurve(const OutlineCurve& curve, const ArcwiseOptions& options = {})
      : ArcwiseCurve(curve.outline(), options) {}

  struct Arc {
    explicit Arc(const ArcSpline& spline);

    SparseCurve curve;
    double start = 0.0;     ///< arc length where it begins
    double length = 0.0;    ///< arc length of the outline along it
    double distance = 0.0;  ///< largest between outline and arc at equal arc length, as sampled

    /// Length of one span of the base's finest level.
    double span_length() const;
    /// The arc's parameter at arc length s.
    double parameter(double s) const { return parameter_at((s - start) / span_length()); }
    /// The same for a distance from its start, in spans of its finest level.
    double parameter_at(double spans) const { return is_closed(curve.scheme()) ? spans - 0.5 : spans; }
    /// The fractional level whose spans are half of `scale`: it holds features longer than that. From 0, where the arc
    /// has its fewest points, to all levels.
    /// Throws  InvalidInput if scale is negative or no number.
    double level_of_scale(double scale) const;
    /// Control points at a fractional level: continuous in it.
    Coefficients at_level(double level) const { return fractional(curve.base(), level); }
  };
  const std::vector<Arc>& arcs() const { return arcs_; }
  Arc& arc(int index) { return arcs_.at(static_cast<std::size_t>(index)); }
  /// Index of the arc at arc length s, modulo the outline's length.
  int arc_at(double s) const;
  /// The point at arc length s, of all arcs at their finest.
  Point evaluate(double s) const;

  /// Every arc at the level for features longer than `scale`, in as few pieces as a distance allows: what there is to
  /// be shown.
  /// Throws  as Arc::level_of_scale and `compress`.
  std::vector<Bezier> pieces(double scale, double tolerance) const;
  /// Where the spans of that begin.
  Points span_ends(double scale) const;

  /// Lets details of one arc go `more` levels beyond its base between two arc lengths.
  /// Throws  as SparseCurve::refine.
  void refine(int arc, double from, double to, int more);

 private:
  std::vector<Arc> arcs_;
  double length_ = 0.0;
};

}  // namespace fontcore
