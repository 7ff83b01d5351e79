#pragma once

#include <vector>

#include "fontcore/contour.h"
#include "fontcore/crossing.h"
#include "fontcore/measure.h"

namespace fontcore {

/// What contours make together by the non-zero rule: ink is where their winding number is not 0.
struct Ink {
  double area = 0.0;          ///< square font units
  int parts = 0;              ///< pieces of ink that hang together
  std::vector<Box> counters;  ///< boxes of the regions without ink that ink encloses, from left to right
};

/// Contours may cross, touch and overlap, themselves and each other. Where none meets another, the areas that they
/// enclose are added; else the plane is cut into slabs at every height where edges begin, end or cross, and in each the
/// edges from left to right say where the ink is.
///
/// Units   font units.
/// Exact   area to 1e-9 of that of the contours' box, by Green's theorem on the pieces of the outline. If any meet,
///         necks and gaps no wider than `contact_distance` neither join nor part: a contact joins no parts, and
///         encloses a counter.
/// Throws  as `find_crossings`; WorkLimitExceeded too if the edges of all slabs are more than `most_work`.
Ink measure_ink(const std::vector<BezierContour>& contours, const CrossingOptions& options = {});
/// The same with crossings known, all that `find_crossings` gives.
Ink measure_ink(const std::vector<BezierContour>& contours, const std::vector<Crossing>& crossings,
                const CrossingOptions& options = {});

/// Winding number of a contour round a point that does not lie on it, positive counter-clockwise.
///
/// Exact   for points farther from the contour than the rounding of its coordinates.
int winding_number(const BezierContour& contour, const Point& point);

/// The sign by which to count each contour's area so that the sum does not depend on which way round the whole runs:
/// contours that meet or lie in one another keep their directions to each other, and what they enclose together counts
/// as positive. A dot beside a stem may run either way; a counter may not. Where telling them apart takes more work
/// than any drawn glyph, all contours keep their directions to each other.
///
/// Shape   1 or -1, one a contour.
std::vector<int> orientation_signs(const std::vector<BezierContour>& contours);

/// The counters of `before` that are gone, be it that they are filled, open to the outside, or run into another: those
/// left when each counter of `after` has been given to the one of `before` that it overlaps and whose box differs least
/// from its own.
std::vector<Box> closed_counters(const Ink& before, const Ink& after);

/// Contours that run the other way round than before, or have another winding number round them by those contours that
/// they meet neither before nor after.
///
/// Shape   both of the same number of contours; their crossings all that `find_crossings` gives.
/// Throws  InvalidInput if the numbers differ.
std::vector<int> changed_windings(const std::vector<BezierContour>& before,
                                  const std::vector<Crossing>& crossings_before,
                                  const std::vector<BezierContour>& after,
                                  const std::vector<Crossing>& crossings_after);

}  // namespace fontcore
