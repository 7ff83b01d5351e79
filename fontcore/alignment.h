#pragma once

#include <span>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// A height that features of many shapes share: flat ones, and round ones that overshoot it.
struct AlignmentZone {
  double flat = 0.0;       ///< font units; the round height if no flat feature is there
  double overshoot = 0.0;  ///< the flat height if no round feature is there
  int flat_count = 0;      ///< shapes with a flat feature at it
  int round_count = 0;
  bool is_top = false;  ///< ink ends upwards here, else downwards
};
/// Alignment zones of a set of shapes (the contours of a glyph each), lowest first.
///
/// Features are places where the ink ends upwards or downwards: horizontal lines at least 10/1000 em long, and round
/// extrema. The ink is on the side that a shape's largest contour says. Heights of one kind within 4/1000 em are one,
/// the most frequent of them; a round height goes with the nearest flat one up to 30/1000 em inside of it. Heights in
/// fewer than 2 shapes, or than a twentieth of all, are no zones.
///
/// Units   font units, units_per_em to the em. Throws InvalidInput if that is not positive.
std::vector<AlignmentZone> find_zones(std::span<const std::vector<BezierContour>> shapes, double units_per_em);
/// Their heights, flat and overshoot, rising, each once: for `OutlineRules::zones`.
std::vector<double> heights(const std::vector<AlignmentZone>& zones);

}  // namespace fontcore
