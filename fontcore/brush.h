#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fontcore/detail.h"
#include "fontcore/gesture.h"
#include "fontcore/linked_curve.h"

namespace fontcore {

// The tools of an editor: every one takes a curve and a gesture and gives the curve that it makes, with all rules of
// the curve holding; what that came to is in its `report()`. Undo is the curve it was given.

/// A place of a curve.
struct CurvePlace {
  double t = 0.0;
  Point point = Point::Zero();
  double distance = 0.0;  ///< from where it was looked for
};
/// The place of a curve nearest to a point: of its polyline.
CurvePlace nearest_place(const LinkedCurve& curve, const Point& place);

// --- Control points ---

/// A form with control points of its own.
enum class FormKind { Bezier, Polyline, Spline, Wavelet, Arcwise };

/// A control point of one of a curve's forms.
struct ControlPoint {
  FormKind form = FormKind::Bezier;
  int index = 0;  ///< piece of a Bezier, vertex, control point of a spline or of a wavelet's level
  int part = 0;   ///< of a piece: which of its control points; of a wavelet: the arc
  int level = 0;  ///< of a wavelet
};
/// Where it is.
/// Throws  InvalidInput if there is none. So do all that take one.
Point place_of(const LinkedCurve& curve, const ControlPoint& control);
LinkedCurve move_control_point(const LinkedCurve& curve, const ControlPoint& control, const Point& to);
/// One more, at t: a node of the Bezier form, a vertex or a knot. The curve stays.
/// Throws  InvalidInput if there is one at t, or if the form is a wavelet: its levels say how many there are;
///         UnsatisfiableConstraints if t is in a frozen stretch.
LinkedCurve add_control_point(const LinkedCurve& curve, FormKind form, double t);
/// One less: a node (the start of a piece), a vertex or a knot.
/// Throws  InvalidInput too if too few are left, or if the form is a wavelet.
LinkedCurve remove_control_point(const LinkedCurve& curve, const ControlPoint& control);

// --- Direct manipulation ---

/// How much of a curve a pull moves: a sixteenth, a sixth or half of its length.
enum class Width { Narrow, Medium, Broad };
/// The breadth that a width is of a curve, font units.
double breadth_of(const LinkedCurve& curve, Width width);

/// The curve with its point at t moved, and a stretch of about `breadth` with it.
///
/// By the wavelet forms it is `pull` at the fractional level of that breadth; by the spline those control points move
/// that are within half the breadth, less and less.
///
/// Exact   the form's point at t gets there, if no rule objects.
/// Throws  InvalidInput if the form has no direct manipulation (Bezier, polyline), breadth is not positive, t or the
///         move not finite, or t is the end of an arc.
/// Source  [GA98] section 2.2.2, figure 4; [FS94] direct manipulation.
LinkedCurve pull(const LinkedCurve& curve, double t, const Point& move, double breadth,
                 FormKind form = FormKind::Wavelet);

// --- Sketching ---

struct SketchOptions {
  StrokeOptions stroke;
  double blend = 0.0;       ///< length over which the ends of a stroke bend into the curve; 0: a tenth of the stroke
  double join_angle = 1.0;  ///< where a stroke leaves the curve more sharply, radians, it makes a corner
  std::optional<Interval> replaced;  ///< what is sketched over; without it, where the stroke begins and ends
};

/// A curve drawn anew by one stroke or, on average, several of the same line; it is closed from its end to its start.
/// Throws  InvalidInput as `tidy` and `average`, or if it has no length.
/// Source  [GA98] section 2.2.3, figure 3.
LinkedCurve sketch(const std::vector<Points>& strokes, const SketchOptions& options = {},
                   const LinkedOptions& linked = {});
/// The curve with a stretch replaced by a stroke, or by the average of several of the same line.
///
/// The stretch lies between the places nearest to the stroke's ends; of the two there are, the one nearer to the
/// stroke. The stroke may be much longer or shorter than it, and may run either way. Its ends bend into the curve,
/// which outside the stretch does not change; its corners become corners.
///
/// Throws  InvalidInput as `tidy` and `average`, or if the ends of the stroke are at one place of the curve.
/// Source  [GA98] section 2.2.3.
LinkedCurve sketch_over(const LinkedCurve& curve, const std::vector<Points>& strokes,
                        const SketchOptions& options = {});

// --- The spatula ---

/// The curve pushed by a tip that moves along a path: see the `push` of a run.
///
/// Frozen stretches and what the rules hold at a t stay where they are. Where what was pushed became so long that an
/// eighth of its share of t is left, its neighbours are spread with it: they change within epsilon.
///
/// Shape   path n×2, n >= 1.
/// Throws  as the `push` of a run.
/// Source  [GA98] section 5.1, figure 5.
LinkedCurve push(const LinkedCurve& curve, const Tip& tip, const Points& path);

// --- Corners ---

/// A corner: a rule of the curve, by its name.
struct CornerHandle {
  std::string name;
  HeldCorner corner;
};
/// The corners that are rules, in the order of the rules.
std::vector<CornerHandle> corner_handles(const LinkedCurve& curve);

/// A corner made where the curve is at t, with the tangents that it has there. The curve stays.
///
/// It is a rule named "corner 1" or the next number that is free, its control interval `control` of t to either side,
/// less where another corner or a frozen stretch is nearer.
///
/// Throws  InvalidInput if t is not finite or control not in (0, 1/2); UnsatisfiableConstraints if a corner or a held
///         point is there, or a line that is held runs through it.
/// Source  [GA98] section 5.1.1, figure 6.
LinkedCurve make_corner(const LinkedCurve& curve, double t, double control = 0.05);
/// The corner moved to a place, its tangents as they are; the curve follows within the control interval. Where another
/// rule lets it go less far, the corner is where it came to.
/// Throws  InvalidInput if there is no corner rule of that name or a number is not finite. So do those below.
LinkedCurve move_corner(const LinkedCurve& curve, const std::string& name, const Point& to);
/// One of its tangents turned into a direction, of the curve's own sense: Left is the one that it arrives with.
/// Throws  InvalidInput too if the direction is 0.
LinkedCurve turn_corner(const LinkedCurve& curve, const std::string& name, Side side, const Point& direction);
/// The corner gone: its rule goes, and the curve passes the place with the mean of both tangents.
LinkedCurve remove_corner(const LinkedCurve& curve, const std::string& name);

// --- Marks, freezing ---

/// The marks of a click and a drag: from the place nearest to its first point, along the way to that of its last.
///
/// If there are marks, and the path begins within `grip` of one, that one is moved instead.
///
/// Throws  InvalidInput if the path has fewer than two points or ends at the place where it begins.
/// Source  [GA98] section 5.2.
LinkedCurve mark(const LinkedCurve& curve, const Points& path, double grip);
LinkedCurve unmark(const LinkedCurve& curve);

/// What lies within a radius of a path frozen, or no longer.
/// Throws  InvalidInput as `painted`.
LinkedCurve freeze(const LinkedCurve& curve, const Points& path, double radius);
LinkedCurve thaw(const LinkedCurve& curve, const Points& path, double radius);
/// The marked stretch frozen, or no longer; without marks the whole curve.
LinkedCurve freeze_marked(const LinkedCurve& curve);
LinkedCurve thaw_marked(const LinkedCurve& curve);

// --- Smoothing, detail ---

/// The marked stretch, or without marks the whole curve, without its features shorter than `scale`: see `smoothed`.
/// Frozen stretches, corners and held points stay.
/// Throws  InvalidInput if the scale is not positive.
LinkedCurve smooth_marked(const LinkedCurve& curve, double scale);

/// The detail of a stretch of a curve below a scale, as a library of one sample.
/// Throws  InvalidInput if the scale is not positive or the stretch shorter.
DetailLibrary copy_detail(const LinkedCurve& curve, const Interval& interval, double scale,
                          DetailFrame frame = DetailFrame::Tangent);
/// The marked stretch, or without marks the whole curve, with the detail of a library: see `with_detail`. It is laid
/// from corner to corner; what is shorter than the library's scale stays. Throws  InvalidInput as `with_detail`.
LinkedCurve paste_detail(const LinkedCurve& curve, const DetailLibrary& library, double gain = 1.0,
                         std::uint64_t seed = 0);

// --- Selection ---

/// What of a curve lies inside a lasso.
/// Throws  InvalidInput as `inside_lasso`.
IntervalSet select_lasso(const LinkedCurve& curve, const Points& lasso);
/// Where a stroke goes across a curve, ascending.
/// Throws  InvalidInput as `crossed`.
std::vector<double> select_across(const LinkedCurve& curve, const Points& stroke);
/// Which of several curves a stroke goes across.
std::vector<std::size_t> select_across(const std::vector<LinkedCurve>& curves, const Points& stroke);

}  // namespace fontcore
