#pragma once

#include <utility>
#include <vector>

#include "fontcore/detail.h"
#include "fontcore/fit.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// A stretch of outline, a serif or a terminal, and how somebody edited it: to be done again wherever an outline has
/// such a stretch.
///
/// The stretch runs with the ink on its left. At both of its ends the displacement is 0, and so is its slope.
///
/// Units   ems.
struct PlacedDetail {
  /// A turn of at least 30 degrees, by which stretches are laid on each other.
  struct Corner {
    double at = 0.0;    ///< arc length from the start
    double turn = 0.0;  ///< radians, positive to the left
  };
  Eigen::VectorXd along;        ///< n: arc length from the start, rising from 0; nodes of the outline are among them
  Points path;                  ///< n×2: the plain stretch there, its start at 0, 0
  Points displacement;          ///< n×2: x and y of what the edit added
  std::vector<Corner> corners;  ///< in order; those at the very ends too
  double faded = 0.0;           ///< largest of the edit's moves that was taken away near the ends
};

/// What an edit did to the stretch of an outline from one place forward to another.
///
/// Outlines of one structure are compared point for point, others by arc length between corners as `match_arcs` has
/// them. Over a sixteenth of the stretch at either end the displacement comes up from nothing: a stretch should be
/// taken a little longer than what was edited.
///
/// Throws  InvalidInput if the stretch has no length, an em is not positive, or as `match_arcs`.
PlacedDetail learn_place(const OutlineArcs& plain, const OutlineArcs& edited, const OutlineArcs::Location& from,
                         const OutlineArcs::Location& to, double units_per_em, InkSide ink);

struct PlaceOptions {
  double tolerance = 4.0;  ///< largest distance between matching points, thousandths of the em
  bool mirrors = true;     ///< also the other way round, left for right
  bool turns = false;      ///< also turned, by any angle
  double smallest = 1.0;   ///< of the stretch, the size that others may have
  double largest = 1.0;
  double units_per_em = 1000.0;
  InkSide ink = InkSide::Left;
};

/// A stretch of a contour that runs as a PlacedDetail does.
struct MatchingPlace {
  int contour = 0;
  double start = 0.0;  ///< arc length from the contour's first arc's start, font units; it may run over that
  double length = 0.0;
  double distance = 0.0;  ///< largest between matching points once laid on each other, thousandths of the em
  bool is_mirrored = false;
  double angle = 0.0;  ///< that the detail is turned by, after mirroring
  double size = 1.0;   ///< and grown
  /// Font units from `start`, and the arc length of the detail there: at the ends, and at every corner.
  std::vector<std::pair<double, double>> knots;
};

/// All stretches of a glyph's outlines that run as the detail's own does, best first, none over another; a mirror image
/// only where the detail as it is fits worse by a quarter.
///
/// Its corners must be there in their order, turning alike within 30 degrees; between them points at the same share of
/// the length match. Laid on each other by least squares, all must be within the tolerance. A detail without corners is
/// looked for everywhere.
///
/// Throws  InvalidInput if the detail is empty or a number of the options is not positive or out of order.
std::vector<MatchingPlace> find_places(const std::vector<OutlineArcs>& contours, const PlacedDetail& detail,
                                       const PlaceOptions& options = {});

/// The displacement that puts a detail at places of one outline, added to what is there: what made the places differ
/// stays as it is. 0 elsewhere; a line moves as its ends do. It refers to the outline and holds the rest.
Wish wish_of_places(const OutlineArcs& outline, const PlacedDetail& detail, const std::vector<MatchingPlace>& places,
                    const PlaceOptions& options = {});

/// The outline with it: the same structure, `edit` with its rules and area around the wish. Points of segments that no
/// displacement reaches are frozen.
///
/// Exact   without a displacement the contour is the same bit for bit, whatever is asked of its area.
StructureFit add_at_places(const OutlineArcs& outline, const PlacedDetail& detail,
                           const std::vector<MatchingPlace>& places, const PlaceOptions& options = {},
                           StructureEdit edit = {});

}  // namespace fontcore
