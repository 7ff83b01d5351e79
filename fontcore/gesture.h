#pragma once

#include <span>
#include <variant>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/detail.h"
#include "fontcore/splice.h"

namespace fontcore {

// What the path of a pointer does to a stretch of a curve, as samples: no constraint is looked at here.

/// A stretch of a curve: parameters ascend, beyond 1 where it runs over the start; neighbours are joined by lines.
using Run = std::vector<Sample>;

/// Arc length from the first point of an open polyline to every point.
Eigen::VectorXd lengths_along(const Points& line);
/// The point of an open polyline at an arc length, clamped to its ends; `lengths` as above.
Point point_along(const Points& line, const Eigen::VectorXd& lengths, double s);

// --- Tips: the shapes that are pushed and painted with ---

struct Circle {
  double radius = 0.0;  ///< font units
};
/// Semi-axes along and across a direction.
struct Ellipse {
  double along = 0.0;
  double across = 0.0;
  double angle = 0.0;  ///< of `along` against the x axis, radians
};
/// Corners counter-clockwise; the tip's place, the origin, lies inside.
struct ConvexPolygon {
  std::vector<Point> corners;
};
using TipShape = std::variant<Circle, Ellipse, ConvexPolygon>;

/// A convex shape about the place of a pointer: coordinates here are relative to that place.
class Tip {
 public:
  /// Throws  InvalidInput if a length is not positive and finite, or a polygon is not convex, not counter-clockwise or
  ///         does not hold the origin.
  explicit Tip(TipShape shape);

  double radius() const { return radius_; }  ///< of the largest circle about the place that it holds
  double extent() const { return extent_; }  ///< largest distance of it from the place
  bool contains(const Point& x) const;       ///< in its inside; the boundary is not
  /// Whether an edge passes through the inside.
  bool meets(const Point& a, const Point& b) const;
  /// The point of the boundary nearest to one inside. At the centre of a circle, the one towards `tie`.
  /// Exact   on the boundary or outside it by 1e-12 of the extent.
  Point nearest_boundary(const Point& x, const Point& tie) const;

 private:
  TipShape shape_;
  double radius_ = 0.0;
  double extent_ = 0.0;
};

/// A run after parts of it were changed, and where: stretches from an unchanged sample to the next unchanged one, in
/// order; all edges between them are new.
struct ChangedRun {
  struct Stretch {
    std::size_t first = 0;
    std::size_t last = 0;
  };
  Run run;
  std::vector<Stretch> changed;
};

/// Pushes a run out of a tip that moves along a path: the curve as sand, the tip as a spatula.
///
/// The path is taken in steps of an eighth of the tip's radius r, so that nothing is jumped across. At each, edges that
/// meet the tip are halved to r / 4; what lies inside goes to the nearest point of the boundary; moved edges longer
/// than r / 4 are halved and pushed again; where two moved edges together are shorter than r / 8 their common sample
/// goes, and so does that at the end of a fold whose sides are within r / 32 of each other. The first and the last
/// sample stay, even inside the tip, and so do samples at a t of `held`. In every stretch that changed t is spread by
/// arc length: sand grows at the same places again and again, and halves of halves of t would run out.
///
/// Shape   path n×2, n >= 1; held and kept ascending, t as in the run.
/// Exact   no sample that may move is left inside the tip; nothing farther than extent + r / 4 from the path changes.
/// Throws  InvalidInput if the path is empty or not finite; WorkLimitExceeded if it is longer than 100,000 steps.
/// Source  [GA98] section 5.1.
ChangedRun push(const Run& run, const Tip& tip, const Points& path, std::span<const double> held = {},
                std::span<const double> kept = {});

/// The same run with its parameters spread by arc length between its ends, and between the samples at a t of `held`.
Run respaced(const Run& run, std::span<const double> held = {});

// --- Strokes ---

struct StrokeOptions {
  double noise = 0.0;         ///< features shorter than this are the hand's trembling, font units; 0: none are
  double corner_angle = 1.0;  ///< sharper turns of the stroke are corners, radians
  double corner_reach = 0.0;  ///< length to either side that a turn is measured over; 0: a twentieth of the stroke
};

/// A drawn line without repeated points, its trembling taken off between corners.
struct Stroke {
  Points points;
  std::vector<int> corners;  ///< indices of points, ascending; no ends
};

/// Finds the corners of what a pointer drew, and smooths it between them.
///
/// A corner is where the stroke turns most within the reach, by more than the angle over the whole reach and over half
/// of it: a round bend turns half as much over half the length.
///
/// Shape   drawn n×2, open, n >= 2.
/// Exact   ends and corners; with noise 0 every point.
/// Throws  InvalidInput if fewer than two points differ, one is not finite, or an option is negative.
/// Source  [GA98] section 2.2.3.
Stroke tidy(const Points& drawn, const StrokeOptions& options = {});

/// The mean of several strokes of one line: "home in" on it by drawing it again and again.
///
/// All run as the first does; one that fits better backwards is turned. Points at the same share of length are
/// averaged, between corners if all have as many corners as the first, and else along the whole.
///
/// Exact   strokes that are the same give it back; points are those at all shares that any stroke has a point at.
/// Throws  InvalidInput if there is none.
/// Source  [GA98] section 2.2.3.
Stroke average(const std::vector<Stroke>& strokes);

/// A point with a unit direction.
struct Ray {
  Point point = Point::Zero();
  Point direction = Point::Zero();
};

/// A run with its ends bent so that it starts and ends in given points, and in their directions if these are not 0.
///
/// Each end moves by what is missing there, fading over `reach` of arc length, or half the run, like the cubic Hermite
/// functions: position and direction are met, and beyond the reach nothing moves.
///
/// Shape   the run's own samples, and more where the bending needs them: chords are within `accuracy` of it.
/// Exact   ends bit for bit; the first and last edge have their direction to rounding.
/// Throws  InvalidInput if the run has no length, reach or accuracy are not positive, or a number is not finite.
Run with_ends(const Run& run, const Ray& start, const Ray& end, double reach, double accuracy);

/// A run without its features shorter than `scale`, ends and their directions kept.
///
/// It is the x that makes |x - c|^2 + (scale / 2 pi)^4 times the integral of |x''|^2 least, over arc length at even
/// steps, like `smooth`; it sets in over half the scale at both ends. Samples at a t of `held` stay, and the curve may
/// turn sharply there: it is smoothed between.
///
/// Shape   samples at even steps between held ones, no farther apart than an eighth of the scale unless there would be
///         more than 4096.
/// Exact   ends and held samples bit for bit; a straight run stays straight.
/// Throws  InvalidInput if the scale is not positive or the run has fewer than two samples.
Run smoothed(const Run& run, double scale, std::span<const double> held = {});

/// A run with detail in place of its own below the library's scale.
///
/// The detail is laid along the run's base, fading over half the scale at both ends, orthogonal to the base, so that
/// the base does not move.
///
/// Shape   samples at even steps of arc length.
/// Units   gain multiplies the detail laid; 0 takes the run's own away.
/// Exact   ends bit for bit.
/// Throws  InvalidInput as `lay_detail`, or if the run is shorter than the scale.
/// Source  [FS94] editing the character of a curve; [GA98] section 2.2.4.
Run with_detail(const Run& run, const DetailLibrary& library, double gain = 1.0, std::uint64_t seed = 0);

// --- Places on a curve ---

/// Where a run lies within `radius` of the path of a pointer, which may be one place.
/// Exact   to rounding: every edge against every edge of the path.
/// Throws  InvalidInput if the radius is not positive or a point not finite.
IntervalSet painted(const Run& run, const Points& path, double radius);
/// Where it lies inside a lasso: a closed polygon, by the non-zero rule.
/// Throws  InvalidInput if the lasso has fewer than three points or one is not finite.
IntervalSet inside_lasso(const Run& run, const Points& lasso);
/// The parameters where a stroke goes across it, ascending.
/// Throws  InvalidInput if a point is not finite.
std::vector<double> crossed(const Run& run, const Points& stroke);

/// The place of a run nearest to a point.
struct NearestPlace {
  double t = 0.0;
  double distance = 0.0;
};
/// Throws  InvalidInput if the run is empty or the point not finite.
NearestPlace nearest(const Run& run, const Point& place);

}  // namespace fontcore
