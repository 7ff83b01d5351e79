#pragma once

#include <cstdint>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// A place on an outline: contour, segment, and the parameter in [0, 1) on it. A node is u = 0 of the segment it
/// starts.
struct Place {
  int contour = 0;
  int segment = 0;
  double u = 0.0;
};

enum class Meeting : std::uint8_t {
  Crossing,  ///< the two go through each other: proved by exact predicates
  Contact,   ///< they touch, or come nearer than the check can tell apart, without a proved crossing
  Overlap,   ///< they run along each other for a stretch; given by its leftmost end, the lowest if several
};

/// Two places of an outline that are one point, though they are not neighbours along it; `a` comes before `b`.
struct Crossing {
  Meeting meeting = Meeting::Crossing;
  Point where = Point::Zero();  ///< the mean of the two places' points
  Place a;
  Place b;
};

struct CrossingOptions {
  long most_work =
      10'000'000;  ///< pairs of pieces and of hits compared at most: a hundred times what the worst real glyphs take
  double contact_distance = 1e-4;  ///< pieces this small and undecided are in contact, font units
};

/// Every place where the contours meet themselves or each other.
///
/// A crossing is a place where two branches of the outline go through each other: in the middle of segments, at nodes
/// (if the branches interleave round the node), within one cubic, and however short what lies beyond is. What comes up
/// to another branch and stays on its side is a contact: a corner on an edge, a node on a node, curves that touch. What
/// cannot be told from that is a contact too, never clear. A stretch run twice is an overlap, in either direction. No
/// finding: the ends that neighbouring segments share, whatever the angle, so neither corners nor cusps; segments of
/// no length, which are passed over.
///
/// A finding at a node shared by several segments is listed once; a stretch of overlap is listed once, however many
/// segments it runs over. Sorted by contours, then segments, then parameters.
///
/// Units   font units; `u` is good to 1e-6 of a segment of ordinary size.
/// Exact   a pair reported as `Crossing` crosses and a pair not reported is apart, both by exact predicates on the
///         control points of the pieces, with a margin (1e-9 units up to coordinates of 10^4) for the rounding of
///         their subdivision; halves of whole and half coordinates are exact to begin with. Ends that are one point,
///         an end on a straight edge, and a curve that touches a line with an end are contacts by the points
///         themselves; neighbours that leave their node alike are told apart by curvature. What is neither apart nor
///         crossing when cut down to `contact_distance` is a `Contact`, or an `Overlap` if it goes on for a thousand
///         times that distance or for more pieces than the check will cut.
///         Not seen: contacts between places less than ten times `contact_distance` apart along the contour; the loop
///         of a cubic if smaller than the margin.
/// Throws  InvalidInput if contact_distance is not positive; WorkLimitExceeded on outlines that lie on themselves so
///         often that listing it would take `most_work`, and on coordinates whose squares are no doubles.
std::vector<Crossing> find_crossings(const std::vector<BezierContour>& contours, const CrossingOptions& options = {});

/// True if the contour meets itself nowhere.
bool is_simple(const BezierContour& contour);

/// How many findings `after` has beyond those of `before`, counted for every pair of contours on its own, so that a
/// crossing gone in one place does not pay for a new one in another.
///
/// Both lists come from outlines of the same contours.
int added_crossings(const std::vector<Crossing>& before, const std::vector<Crossing>& after);

}  // namespace fontcore
