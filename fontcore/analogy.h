#pragma once

#include <string>
#include <vector>

#include "fontcore/detail.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// A stretch of an outline by arc length from its first arc's start; it may run over that.
struct Stretch {
  double start = 0.0;
  double length = 0.0;
};

/// For every arc of a plain outline the stretch of another version of it that it became.
///
/// The corners at the arcs' ends go to corners of the other outline, or to the point nearest to them if it has none
/// there: in order round the contour, so that places, turns and the lengths between them agree best together. So the
/// other outline may have any number of further corners. Both run the same way; they may start anywhere.
///
/// Units   `reach`, font units: how far corners may have gone; turns are looked at over half of it.
/// Throws  InvalidInput if the windings differ or the reach is not positive.
std::vector<Stretch> match_arcs(const OutlineArcs& plain, const OutlineArcs& other, double reach);

/// What makes a textured outline of a plain one, A' - A, as detail of the plain one: of every arc that has room for it
/// as `extract_detail` has it, along the plain arc's base.
///
/// Between matched corners a place goes to that at the same share of the arc length of the bases. What the bases
/// themselves differ by is no detail and left out, so the two may come from different fonts. Both may have any
/// structure.
///
/// Shape   samples with the shapes of the plain bases, of 128 steps to a scale; place "PLACE/ARC".
/// Units   font units; a library of another em takes them as they are, with its own `units_per_em`.
/// Throws  InvalidInput if the scale is not positive, or as `match_arcs`.
/// Source  [HOCS02]: A is to A' as B to B'; [FS94] character.
std::vector<DetailSample> learn_difference(const OutlineArcs& plain, const OutlineArcs& textured, double scale,
                                           DetailFrame frame, InkSide ink, const std::string& place = {});

/// The detail of a library `by_shape` along a stretch: everywhere that of the place of a sample which runs most like
/// it.
///
/// Compared are direction, curvature times the scale, and how far the ends are, up to a scale. Of all ways to take runs
/// of samples one after another the cheapest, where a jump costs as much as running 22 degrees astray for a scale:
/// steps of an eighth of the scale, in time and memory proportional to both lengths. Runs fade into each other over
/// half the scale. A stretch that runs like a whole sample gets its detail as it was. There is no choice for a seed.
///
/// Shape   as `lay_detail`; the bed's and the samples' shapes must be given.
/// Throws  InvalidInput if there is no sample, a shape is missing, or the stretch has no length.
Points lay_by_shape(const DetailLibrary& library, const DetailBed& bed, const Eigen::VectorXd& places);

}  // namespace fontcore
