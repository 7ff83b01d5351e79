#pragma once

#include <vector>

#include "fontcore/arcwise.h"
#include "fontcore/contour.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// The displacement that moves the broad shape of an outline near one place, before any rule is applied.
struct Sweep {
  Points field;        ///< displacement of the spline's control points, N×2
  double t = 0.0;      ///< parameter of the handle; the field there is the move, exactly, if the curve is dragged
  double level = 0.0;  ///< fractional level j + t: wavelet details finer than level ceil(j + t) are 0
};

/// How details ride on a curve whose coarse shape is edited.
enum class DetailFrame {
  Fixed,          ///< they keep their x and y
  Tangent,        ///< they turn with the tangent of the coarser curve
  ScaledTangent,  ///< they turn with it and grow with its length
};

/// The curve with other control points at a level, its finer details carried along in their frames.
///
/// Every detail is kept in the tangent and normal of the coarser curve where its wavelet is centred, level by level
/// from coarse to fine. With DetailFrame::Fixed, or where a coarser tangent is 0, it stays as it is. Columns beyond x
/// and y ride along unturned.
///
/// Shape   coarse as the control points of `level`; the result has `level` as its coarsest, like `from_level`.
/// Exact   a rotation of all coarse points turns the whole curve; with ScaledTangent so does any similarity.
/// Throws  InvalidInput if the level is not in [0, levels] or the shape differs.
/// Source  [FS94] orientation of detail; unit tangents there are Tangent here.
MultiresCurve carry_details(const MultiresCurve& curve, int level, const CoefficientsView& coarse, DetailFrame frame);

/// What is dragged: the outline at a parameter, or the control point of the level that is nearest to it.
enum class Grip { Curve, ControlPoint };

struct SweepOptions {
  Scheme scheme = Scheme::Chaikin;
  DetailFrame detail = DetailFrame::Fixed;
  Grip grip = Grip::Curve;
};

/// Direct manipulation at a fractional level: the outline's point at parameter t is moved by `move`, and a stretch of
/// about `breadth` follows.
///
/// It is `pull` at `level_of_breadth`. Chaikin's is local; Orthogonal reaches everywhere, decaying, and what is below
/// 1e-9 of the contour's length is 0. Details finer than the level ride along as `options.detail` says; where they
/// turn, the handle is met by a second, small pull.
///
/// Shape   field N×2.
/// Units   font units.
/// Throws  InvalidInput if breadth is not positive, t or the move not finite, or the scheme is for open arcs.
/// Source  [FS94] editing at fractional levels, direct manipulation, editing a desired portion of the curve.
Sweep sweep(const OutlineCurve& curve, double t, const Point& move, double breadth, const SweepOptions& options = {});

/// The same at a fractional level, counted from the coarsest, instead of a breadth.
/// Throws  InvalidInput if the level is not in [0, levels].
Sweep sweep_at_level(const OutlineCurve& curve, double t, const Point& move, double level,
                     const SweepOptions& options = {});

/// A point of the outline, by its parameter, and its move.
struct Pull {
  double t = 0.0;
  Point move = Point::Zero();
};

/// Several handles at once: each point of the outline at a t moves by its own move, every stretch of `breadth`.
///
/// The field is the sum of the handles' pulls that meets all moves. Details do not turn.
///
/// Shape   level that of the first handle.
/// Throws  InvalidInput if there is no handle, or two lie so near to each other that no such sum meets them.
Sweep sweep(const OutlineCurve& curve, const std::vector<Pull>& handles, double breadth,
            Scheme scheme = Scheme::Chaikin);

/// The fractional level at which direct manipulation at parameter t moves a stretch of `breadth`: interpolated between
/// the arc lengths that integer levels move, five spans, three basis functions of three spans each about t.
///
/// So the moved arc length, 8/3 of the integral of |displacement| / |move| over arc length, is the breadth within a
/// fifth where the parameter is even, and grows with it.
///
/// Throws  InvalidInput if breadth is not positive.
/// Source  [FS94] editing a desired portion of the curve.
double level_of_breadth(const OutlineCurve& curve, double t, double breadth);
/// The same for a bare curve of any scheme, however unevenly it is run through: breadth is the moved arc length of its
/// own spline. Units   t at the finest level, as for `basis_row`.
double level_of_breadth(const MultiresCurve& curve, double t, double breadth);

/// Length of outline that direct manipulation at parameter t moves at a fractional level: the way back.
/// Throws  InvalidInput if the level is not in [0, levels].
double breadth_of_level(const OutlineCurve& curve, double t, double level);

/// The field with both members of every corner pair moved by its value at the corner, so that corners stay corners.
Points respect_corners(const OutlineCurve& curve, Points field);

/// How features shorter than a scale are taken away.
enum class SmoothBy {
  Energy,  ///< every arc becomes the x that makes |x - c|^2 + (scale / 2 pi)^4 E(x) least, with its ends fixed
  Level,   ///< every arc becomes its own at the fractional level whose spans are half the scale ([FS94])
};

/// A displacement of an outline over arc length: on every arc a spline of its own, 0 at the ends of open ones.
class ArcField {
 public:
  /// `splines` as `fit_arcs` gives them, `changes` of their control points.
  ArcField(const std::vector<ArcSpline>& splines, std::vector<Points> changes);

  bool is_zero() const;
  /// The displacement at an arc length from the start of one of the outline's arcs.
  Point at(const OutlineArcs& outline, int arc, double s) const;

 private:
  struct Piece {
    Scheme scheme;
    double span_length;
    bool is_zero;
    Points change;
  };
  std::vector<Piece> pieces_;
};

/// The displacement that smooths an outline, without a model of it: what `smooth` is made of.
struct ArcSmoothing {
  ArcField field;
  int levels = 0;              ///< of the arc that has most
  double energy_before = 0.0;  ///< integral of |x''|^2 over arc length, over all arcs, 1 / font units
  double energy_after = 0.0;
};

/// Smooths an outline, arc by arc, as `smooth` below does. Arcs that are single lines are not looked at.
/// Throws  InvalidInput as `smooth` and `fit_arcs`.
ArcSmoothing smooth_arcs(const OutlineArcs& outline, double scale, SmoothBy by, const ArcwiseOptions& options);

/// The displacement that smooths an outline, and what it does to every arc.
struct Smoothing {
  Points field;                       ///< displacement of the spline's control points, N×2, font units
  std::vector<double> energy_before;  ///< per arc: integral of |x''|^2 over arc length, 1 / font units
  std::vector<double> energy_after;
  std::vector<double> distance;  ///< per arc: integral of |displacement|^2 over arc length, to the power 1/2
  std::vector<double> detail;    ///< per arc: the same of x less what an infinite scale leaves of it
};

/// Smooths an outline, arc by arc: features well below `scale` go, those well above it stay.
///
/// |.|^2 and E, the bending energy, are integrals over the arc length that the outline has, of the splines of
/// `ArcwiseCurve`. Continuous in the scale; with it the distance grows and the details fall on every arc, either way;
/// by energy the energy falls too (by level it may rise: least squares knows nothing of it). With Corners::Keep corners
/// stay to the last bit; with Corners::Round the contour is one arc across them. Arcs that are straight stay as they
/// are, and a scale of 0 displaces nothing.
///
/// Shape   field N×2; the others one number an arc of `ArcwiseCurve`.
/// Units   scale in font units.
/// Exact   on those splines; the field meets the displacement at every t = i.
/// Throws  InvalidInput if scale is negative or not finite.
/// Source  DESIGN, Smoothing; [FS94] smoothing; the energy of [HBS05] section 4.2, over arc length.
Smoothing smooth(const OutlineCurve& curve, double scale, SmoothBy by = SmoothBy::Energy,
                 Corners corners = Corners::Keep);

/// A gain for the features of about one size.
struct Band {
  double scale = 0.0;  ///< length of the features, font units
  double gain = 1.0;   ///< 1 leaves them, 0 takes them away, 2 doubles them
};

/// The displacement that makes features of some sizes stronger or weaker: an equaliser of octaves, arc by arc.
///
/// A band is what smoothing at scale / sqrt 2 leaves and smoothing at scale * sqrt 2 takes away; the displacement is
/// the sum of (gain - 1) times the bands. So bands an octave apart share out what lies between them without gap or
/// overlap, and with all gains 1 nothing is displaced, exactly.
///
/// Shape   N×2 like the control points.
/// Throws  InvalidInput naming the band if scales are not positive and rising, or a gain is negative or not finite.
/// Source  [FS94] smoothing and character as gains on detail, by the operator of `smooth`.
Points equalize(const OutlineCurve& curve, const std::vector<Band>& bands, SmoothBy by = SmoothBy::Energy,
                Corners corners = Corners::Keep);

/// The same without a model of the outline.
ArcSmoothing equalize_arcs(const OutlineArcs& outline, const std::vector<Band>& bands, SmoothBy by,
                           const ArcwiseOptions& options);

}  // namespace fontcore
