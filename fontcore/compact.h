#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// Whether horizontal and vertical extrema become nodes with axis-aligned handles.
enum class Extrema : std::uint8_t { Keep, Free };
/// What curves are made of. Quadratics are TrueType's: smooth nodes between two handles are implied.
enum class CurveKind : std::uint8_t { Cubic, Quadratic };
enum class Coordinates : std::uint8_t { Whole, Any };

struct CompactOptions {
  double tolerance = 1.0;        ///< two-sided distance allowed, after rounding, font units; 0: leave all as it is
  double units_per_em = 1000.0;  ///< what a straight run is measured by
  Extrema extrema = Extrema::Keep;
  CurveKind curve = CurveKind::Cubic;
  Coordinates coordinates = Coordinates::Whole;
  double corner_angle = 0.139626;  ///< sharper turns are corners, radians (8 degrees)
  double straight_run = 0.03;      ///< straight runs this long stay lines, em
  std::vector<int> corners;        ///< points of the contour that are corners however little they turn
  std::vector<int> kept_segments;  ///< segments of the contour that come out as they are, bit for bit; ascending
  /// Samples looked at by the solver, for every 64 segments: in a millisecond about ten thousand or more.
  long most_work = 170'000;
};

/// An outline of fewer segments, and where it is farthest from the one it stands for.
struct CompactFit {
  BezierContour contour;
  double deviation = 0.0;       ///< two-sided distance from the source, measured, font units
  Point where = Point::Zero();  ///< the point of either that is so far from the other
  bool kept = false;            ///< left as it was, bit for bit: nothing shorter was found
  std::string why;              ///< what stood against it, if something did: work, rounding; empty as a rule
  long work = 0;                ///< of `most_work`
  std::vector<int> kept_at{};   ///< where the segments that were to be kept are now, in their order
};

/// The fewest lines and curves found within a distance of a contour.
///
/// Corners and straight runs split the contour; what is between them is a chain of curves whose smooth joins share one
/// tangent. Dynamic programming over places to join at gives chains to start from, one solve over all joins and handles
/// at once moves them towards the least largest distance, and joins are dropped while the distance stays within the
/// tolerance. Coordinates are then rounded by a search over neighbouring whole numbers that keeps smooth joins within
/// 1.5 degrees, and the result is measured; what fails is tried with more curves, in the end as many as there were.
///
/// The direction stays, and the first node the first; with free extrema, that of a smooth contour is the node nearest
/// to where it was. A corner keeps its angle within 2 degrees and what one and a half units at its shorter handle turn
/// it. The source's own nodes mean nothing but a hint where to join: it may be cut as finely as it likes. With more
/// than `most_work` to do, stretches not yet looked at stay as they are. Cubics of a stretch for which no quadratics
/// are found are cut into them one by one.
///
/// Cubics for a stretch that is cut very finely, as texture is, come from a search window by window, linear in length;
/// on whole numbers half a unit or so is less than texture can be followed within, and `why` says so.
///
/// Segments to be kept keep points and kinds, whole numbers or not; what is fitted between them meets their ends
/// exactly, and goes on from them smoothly where the source turns by no more than `corner_angle`. The first node stays
/// the first if one of them ends there. An implied end of a quadratic becomes a point, or, where points are whole
/// numbers and it is not, keeps the segment beyond it too.
///
/// Exact   deviation <= tolerance unless `why` says otherwise; never more segments than the source has, but where
///         whole numbers or quadratics for cubics need them. A source moved by whole units or mirrored gives the result
///         moved or mirrored, bit for bit, if its coordinates are dyadic fractions, as font coordinates are.
/// Throws  InvalidInput if the tolerance is negative or not finite, or the em not positive; if the segments to be kept
///         are not ascending, or none of the contour's, or one is a curve of the other kind.
CompactFit fit_compact(const BezierContour& source, const CompactOptions& options = {});

}  // namespace fontcore
