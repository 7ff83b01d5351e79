#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/inline_vector.h"
#include "fontcore/measure.h"
#include "fontcore/outline_curve.h"
#include "fontcore/wavelet.h"

namespace fontcore {

/// What must hold, in words a designer knows.
///
/// Rows are named by the hundred and few names are ever read: one may be its facts only, put together when it is.
class RowName {
 public:
  RowName() = default;
  RowName(std::string text) : text_(std::make_shared<const std::string>(std::move(text))) {}
  RowName(const char* text) : facts_{text} {}
  /// Of string literals and numbers.
  template <typename... Facts>
  static RowName of(const Facts&... facts) {
    RowName name;
    name.facts_ = {facts...};
    return name;
  }
  std::string str() const;

  friend bool operator==(const RowName& a, const RowName& b) { return a.str() == b.str(); }

 private:
  using Fact = std::variant<std::monostate, const char*, int, double>;
  std::array<Fact, 5> facts_{};              // literals live as long as the program
  std::shared_ptr<const std::string> text_;  // instead of them
};

/// One linear equation on displacements: the sum of coefficient * displacement[2 * point + axis] is `value`.
///
/// `name` is what a report or a contradiction shows.
struct Row {
  struct Term {
    int variable = 0;  ///< 2 * point + axis, axis 0 for x and 1 for y
    double coefficient = 0.0;
  };
  RowName name;
  InlineVector<Term, 4> terms;
  double value = 0.0;
};
using Rows = std::vector<Row>;

/// What vertical means: along (tan italic_angle, 1). Horizontal stays horizontal.
///
/// A coordinate of the frame is x - y tan(italic_angle), constant along its verticals, or y. Leaning verticals of a
/// font stand on whole numbers: what is vertical to within one unit, and to 3 degrees, counts as vertical.
struct Frame {
  double italic_angle = 0.0;  ///< radians, positive leaning to the right; between -80 and 80 degrees
};

// Rules on the points of an outline, as values. Points and segments are those of a BezierContour; displacements those
// of its points. Every `rows` throws InvalidInput, naming rule and value, if an index is out of range, a number is not
// finite or a direction is zero.

/// A point that does not move.
struct FrozenPoint {
  int point = 0;
};
/// A smooth join keeps its tangency and the ratio of its handles: with a and b the points beside node p,
/// d_p = (1 - m) d_a + m d_b, m from the handle lengths (1/2 for an implied node). A line that runs smoothly into a
/// curve is the same row. A join that is only nearly smooth is carried along as it is; with `close` it is made exactly
/// smooth.
struct SmoothJoin {
  int segment = 0;  ///< the segment that starts at the join
  bool close = false;
};
/// A node between two lines that go straight on stays on their line.
struct NodeOnLine {
  int segment = 0;
};
/// A horizontal or vertical line stays so.
struct AxisLine {
  int segment = 0;
  Frame frame{};
};
/// A line keeps its direction, whatever it is.
struct SlantedLine {
  int segment = 0;
};
/// A smooth node whose tangent is horizontal or vertical stays an extremum: handles and node keep one coordinate.
struct Extremum {
  int segment = 0;
  Frame frame{};
};
/// A flat or round feature at an alignment zone keeps its height.
struct Zone {
  int segment = 0;  ///< the segment that starts at the node
};
/// A point of the outline moves by a given displacement.
struct Position {
  int segment = 0;
  double u = 0.0;
  Point displacement = Point::Zero();
};
/// Neighbouring points that lie on each other stay on each other: a segment of no length, a handle drawn in.
struct Coincident {
  int first = 0;
  int second = 0;
};
/// What of a tangent is kept: the line it lies on, or its length too.
enum class Tangent { Direction, Whole };
/// Both tangents of a corner keep their directions: a row a side; with Tangent::Whole they move along unturned, two.
struct CornerTangents {
  int segment = 0;  ///< the segment that starts at the corner
  Tangent kept = Tangent::Direction;
};

Rows rows(const BezierContour& contour, const FrozenPoint& rule);
Rows rows(const BezierContour& contour, const SmoothJoin& rule);
Rows rows(const BezierContour& contour, const NodeOnLine& rule);
Rows rows(const BezierContour& contour, const AxisLine& rule);
Rows rows(const BezierContour& contour, const SlantedLine& rule);
Rows rows(const BezierContour& contour, const Extremum& rule);
Rows rows(const BezierContour& contour, const Zone& rule);
Rows rows(const BezierContour& contour, const Position& rule);
Rows rows(const BezierContour& contour, const Coincident& rule);
Rows rows(const BezierContour& contour, const CornerTangents& rule);

/// A join that turns by less is smooth and must stay so, radians (1.5 degrees).
constexpr double smooth_angle = 0.026180;

/// Which features of an outline are kept when its rules are gathered.
struct OutlineRules {
  bool lines = true;
  bool smooth_joins = true;
  bool extrema = true;
  std::vector<double> zones;       ///< heights of alignment zones, font units
  double corner_angle = 0.139626;  ///< a sharper turn is a corner and free, radians (8 degrees)
  std::vector<int> closed_joins;   ///< segments whose nearly smooth start is to be made exactly smooth
  std::vector<int> corners;        ///< points that are corners and free however little they turn; no implied nodes
  bool slants = false;             ///< lines that are neither horizontal nor vertical keep their direction too
  Frame frame{};                   ///< what vertical means for lines and extrema

  /// True if the point is one of `corners`.
  bool marks_corner(int point) const;
};

/// Every rule that the outline's own points must obey, in a fixed order: coincident points, implied nodes, lines,
/// joins, extrema, zones. Corners need no row: they are points, free to turn.
Rows outline_rows(const BezierContour& contour, const OutlineRules& rules);

/// Rows of a corner of the spline: both members of a pair (x_i, x_{i+1}) of control points move alike, so it stays a
/// corner.
struct CornerPair {
  int first = 0;
  int size = 0;  ///< number of control points
};
Rows rows(const CornerPair& rule);

/// Something of a curve that is a weighted sum of its points: a place on it, a derivative, the edge from one place to
/// another. Its change is the same sum of their displacements, so a rule on it is one on outlines and on control
/// points of every scheme alike.
struct WeightedSum {
  struct Term {
    int point = 0;
    double weight = 0.0;
  };
  std::string name;  ///< "the outline at 0.5 of segment 3"
  std::vector<Term> terms;
  Point value = Point::Zero();  ///< the sum of the points where they are now
};

/// A point itself. Throws InvalidInput if there is none of that index.
WeightedSum point_of(const Points& points, int point);
/// An outline at u of a segment: the place (derivative 0), or the first or second derivative by u.
/// Throws  InvalidInput if the segment or derivative is out of range, or u not in [0, 1].
WeightedSum curve_at(const BezierContour& contour, int segment, double u, int derivative = 0);
/// The same of a spline, by its parameter; where two pieces meet, of the piece that begins there.
/// Throws  InvalidInput as `basis_row`, or if the derivative is not 0, 1 or 2.
WeightedSum curve_at(Scheme scheme, const Points& control_points, double t, int derivative = 0);
/// From one to the other: to - from.
WeightedSum edge(const WeightedSum& from, const WeightedSum& to);
/// The same sum when `points_before` other points come first: contours of a glyph, one after the other.
WeightedSum shifted(WeightedSum sum, int points_before);

/// Whether what is not quite so yet stays as far off as it is, or is made so exactly.
enum class Offset { Kept, Closed };

/// A place moves by a given displacement; by none, it is pinned.
struct Pinned {
  WeightedSum place;
  Point displacement = Point::Zero();
};
/// Two places move alike: a corner between two arcs has no jump, its tangents are free.
struct Together {
  WeightedSum first;
  WeightedSum second;
  Offset offset = Offset::Kept;
};
/// A tangent keeps its direction, or takes a given one: cross(tangent, direction) = 0, exact however far it moves. It
/// may come to point the other way. With Tangent::Whole it keeps its length and its sense too, by two rows. At a corner
/// of a spline the tangents are the edges from and to the control points beside the pair.
struct TangentDirection {
  WeightedSum tangent;
  std::optional<Point> direction;  ///< its own if not given
  Tangent kept = Tangent::Direction;
};
/// A tangent is orthogonal to a given direction: exact.
struct Orthogonal {
  WeightedSum tangent;
  Point direction = Point::Zero();
};
/// Two tangents are orthogonal to each other, to first order: their product differs from 0 by that of their changes,
/// so it is exact where one of them is held. Rows taken anew at the solution double the digits every time.
struct OrthogonalTangents {
  WeightedSum first;
  WeightedSum second;
};
/// Places in order on a straight line stay on the moving chord from first to last, at the same fractions of it. With
/// Tangent::Direction its direction is kept as well. A handle, a node and a handle are a smooth join.
struct StraightRun {
  std::vector<WeightedSum> places;
  std::optional<Tangent> kept;
  Offset offset = Offset::Kept;
};
/// A coordinate's derivative is 0: an extremum at that parameter, of x (axis 0, vertical tangent) or of y (1). Exact.
struct Stationary {
  WeightedSum derivative;
  int axis = 0;
  Frame frame{};
};
/// A place keeps its height, or takes a given one.
struct AtHeight {
  WeightedSum place;
  std::optional<double> height;
};
/// Two opposite places keep the distance across, or take a given one, measured in a fixed direction. For the width of
/// a stem that is exact as long as its edges do not turn, else of second order in the angle.
struct Stem {
  WeightedSum left;
  WeightedSum right;
  Point across = Point::Zero();  ///< either way round
  std::optional<double> width;
};
/// Two stems become equally wide, or keep the difference.
struct EqualStems {
  Stem first;
  Stem second;
  Offset offset = Offset::Closed;
};
/// One place moves like the image of the other under a map: a reflection, a half turn. Exact.
struct Symmetry {
  WeightedSum place;
  WeightedSum image;
  Affine map;
  Offset offset = Offset::Kept;
};
/// Points that do not move, and of which stretch they are.
struct FrozenStretch {
  std::string name;
  std::vector<int> points;
};

Rows rows(const Pinned& rule);
Rows rows(const Together& rule);
Rows rows(const TangentDirection& rule);
Rows rows(const Orthogonal& rule);
Rows rows(const OrthogonalTangents& rule);
Rows rows(const StraightRun& rule);
Rows rows(const Stationary& rule);
Rows rows(const AtHeight& rule);
Rows rows(const Stem& rule);
Rows rows(const EqualStems& rule);
Rows rows(const Symmetry& rule);
Rows rows(const FrozenStretch& rule);

/// Every point that shapes the outline from one place forward to another; from a place to itself is the whole contour.
/// Throws  InvalidInput if a segment is out of range or u not in [0, 1].
FrozenStretch frozen_between(const BezierContour& contour, const OutlineCurve::Location& from,
                             const OutlineCurve::Location& to);
/// Every control point that shapes the spline over [from, to].
/// Throws  InvalidInput if `to` is not above `from`, or the stretch leaves an open arc.
FrozenStretch frozen_between(Scheme scheme, Eigen::Index size, double from, double to);
/// Every point of the segments, or control point of the pieces, that have a part in a box; none if nothing has.
/// Throws  InvalidInput if the box is empty.
FrozenStretch frozen_within(const BezierContour& contour, const Box& box);
FrozenStretch frozen_within(Scheme scheme, const Points& control_points, const Box& box);

/// The points of the straight run that a segment belongs to: its neighbours on either side as far as they are straight
/// and within 1e-3 of its direction.
/// Throws  InvalidInput if the segment is not straight.
StraightRun straight_run(const BezierContour& contour, int segment);

/// The stem between two opposite segments, at as many places as its width is to be held at.
///
/// Lines: at both ends of the stretch where they face each other, across the first; two rows that hold the distance in
/// between too. Curves: at matching parameters, one place more than the higher degree, each across its own pair. The
/// segments may be of two contours (`left` of the first, `right` of the second): see `shifted`.
///
/// Throws  InvalidInput if they are not opposite: lines that do not face each other or meet at more than 45 degrees.
std::vector<Stem> stems_between(const BezierContour& first, int a, const BezierContour& second, int b);

/// Reflection in the line through a point; half turn about a point.
Affine mirror_about(const Point& on_line, const Point& direction);
Affine half_turn_about(const Point& centre);
/// Pairs (k, l), k <= l, of points of a contour that lie on each other's image within `tolerance`, every point in one;
/// empty if the contour is not symmetric, kinds and order of points included. The map must be its own inverse.
std::vector<std::array<int, 2>> symmetric_pairs(const BezierContour& contour, const Affine& map, double tolerance);

/// Points in order whose polygon must not gain an inflection: control points of a stretch of an outline or a spline.
/// For quadratic splines, whose pieces curve as their polygon turns, that is all there is to it; for cubics it is
/// enough.
struct ConvexStretch {
  std::vector<int> points;
  bool closed = false;  ///< the last is followed by the first
};
/// Points of the stretch whose turn left its side: was to the left and is to the right, or the other way round. A
/// straight one may take the side of its neighbours. Turns of less than 1e-9 are straight.
///
/// An inequality, so no row. Shape  points and displaced n×2.
std::vector<int> added_inflections(const Points& points, const ConvexStretch& stretch, const Points& displaced);
/// Each of the turns at these points held at a twentieth of its size, to first order in what is added to `displaced`.
Rows held_turns(const Points& points, const ConvexStretch& stretch, const Points& displaced,
                const std::vector<int>& turns);
/// Each of the turns at these points kept with the ratio of its legs: two rows that hold its side exactly, for any
/// displacement.
Rows kept_turns(const Points& points, const ConvexStretch& stretch, const std::vector<int>& turns);

/// A solution without added inflections, by active sets.
struct ConvexSolution {
  Points displaced;
  Rows rows;              ///< that it took
  std::vector<int> left;  ///< turns that other rules keep on the wrong side; empty if it was met
  int solves = 0;
};
/// Solves, holds the turns that left their side, and solves again until none does; a turn that comes back after
/// `linear_tries` linear holds is kept whole.
///
/// `solve` gives all points displaced under its own rules and the rows given, taken last. A turn once held stays held:
/// the change is the least under the rows, not under the inequalities. Ends, since every solve tightens a turn.
///
/// Exact   what it returns passes `added_inflections` but for the points `left`.
ConvexSolution keep_convex(const Points& points, const std::vector<ConvexStretch>& stretches,
                           const std::function<Points(const Rows&)>& solve, int linear_tries = 4);

/// Whether the details of a level are unknowns, or stay as they are.
enum class Details { Moved, Fixed };
/// Rows on the control points of a curve as rows on its coefficients seen from `levels` below: by P' and Q'.
///
/// Variables are 2 * coefficient + axis, coefficients stacked coarse first as `stack` has them; with Details::Fixed the
/// coarse control points alone. Coefficients that obey the result synthesise to control points that obey `fine`. Terms
/// below 1e-15 of a row's largest are dropped; names stay.
///
/// Throws  InvalidInput if the size cannot be halved so often, or naming the row with a variable out of range.
/// Source  DESIGN decision 5; [HBS05] eq. 14 and 15, the (P) and the (Q) filter.
Rows at_level(const Rows& fine, Scheme scheme, Eigen::Index size, int levels, Details details = Details::Moved);

}  // namespace fontcore
