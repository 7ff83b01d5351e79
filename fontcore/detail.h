#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/edit.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// What one stretch of outline adds to its base: its detail below a scale.
///
/// The stretch runs with the ink on its left. Offsets stand at even steps of the base's arc length: one at every
/// i * length / n of a closed stretch of n rows, at every i * length / (n - 1) of an open one.
///
/// Units   font units of the library's em.
struct DetailSample {
  double length = 0.0;     ///< arc length of the base
  bool is_closed = false;  ///< goes on from its end to its start
  Points offsets;          ///< n×2: along the base and away from the ink; with DetailFrame::Fixed x and y
  Points shape;  ///< n×2, or none: the base's direction, radians, without jumps, and its curvature, 1 / font units
  std::string place;  ///< where it was taken, or nothing: a stretch of this place and length gets it back as it was
};

/// Detail to be laid on outlines: samples of one hand, below one scale.
struct DetailLibrary {
  std::string name;
  double units_per_em = 1000.0;  ///< of the lengths here
  double scale = 0.0;            ///< feature size below which this is detail
  DetailFrame frame =
      DetailFrame::Tangent;  ///< ScaledTangent: a sample is stretched to the whole arc, and grows with it
  bool by_shape = false;     ///< every stretch takes the detail of the stretch of a sample that runs most like it
  std::vector<DetailSample> samples;
};

/// On which side of its direction a contour has the ink.
enum class InkSide { Left, Right };

/// The contour cut into arcs where it has corners at a scale, looking half of it to either side.
///
/// A corner with an arc shorter than that beside it, where the outline as a whole turns by less than 30 degrees, is
/// texture: rough print is not a row of corners. A node where it turns by more than a radian, and half as much again as
/// the contour does in the mean, is a corner though it be smooth: the tip of a terminal is no detail to be taken off.
///
/// `options` as for OutlineArcs; its corners are always kept.
OutlineArcs arcs_at_scale(const BezierContour& contour, double scale, const OutlineCurveOptions& options = {});

/// Points at even steps of arc length along one of an outline's arcs: both ends of an open one, of a closed one the
/// first once.
Points points_along(const OutlineArcs& outline, int arc, Eigen::Index count);

/// An arc's base: the part that is no detail below a scale, and the parameter that outline and base share.
///
/// The least-squares cubic spline of round(2 L / scale) spans, at least 4 if closed and else 1, over its own arc
/// length L; open arcs keep their ends. A point's place is its foot on the base, as far as places keep their order, so
/// that roughness does not stretch the parameter and detail is an offset away from the base: found in a few passes. On
/// the parameter found it is a projection, so base + detail has the same base.
///
/// Source  [FS94] editing the character of a curve; DESIGN, Detail frames.
class DetailBase {
 public:
  /// `points` at even steps of arc length: both ends of an open stretch, of a closed one the first once.
  /// Throws  InvalidInput if there are fewer than 8 points or the scale is not positive.
  DetailBase(const Points& points, bool is_closed, double scale);

  bool is_closed() const { return is_closed_; }
  double length() const { return length_; }
  int spans() const { return spans_; }
  /// Of every point its place on the base, as arc length.
  const Eigen::VectorXd& places() const { return places_; }
  /// The base where the points are: n×2; its unit tangents, n×2.
  const Points& points() const { return base_; }
  const Points& tangents() const { return tangents_; }
  /// Direction without jumps and curvature of the base, n×2.
  Points shape() const;

  /// What is left of a displacement of the points when the base must not move: mask * (d - B c), with the c that makes
  /// it orthogonal to all splines of the base. It is 0 where the mask is.
  ///
  /// Shape   displacement n×2; mask n, in [0, 1].
  Points detail_part(const Points& displacement, const Eigen::VectorXd& mask) const;
  /// Values at the points without their features below a length: their projection on splines of half that spacing.
  Points without_features_below(double length, const Points& values) const;
  /// The largest move of the base under a displacement of the points: its projection, on the shared parameter.
  double base_move(const Points& displacement) const;

 private:
  void move_to_feet(const Points& points);

  bool is_closed_ = false;
  int spans_ = 0;
  double length_ = 0.0;
  Eigen::VectorXd places_;
  Eigen::VectorXd weights_;
  Points base_;
  Points tangents_;
};

/// A displacement of a base's points as a sample: in the frame, at even steps of the base.
DetailSample to_sample(const DetailBase& base, const Points& detail, DetailFrame frame);
/// The offsets at a place, by cubics between the steps: a closed sample goes on for ever; mirrored, from its end.
Eigen::RowVector2d value_at(const DetailSample& sample, bool mirrors, double x);

/// The detail below `scale` of every arc of an outline that is as long: it has room for two fades of half of it.
///
/// Shape   samples with their shapes, of 24 to 256 steps to a scale, as the outline needs them; place "PLACE/ARC".
/// Exact   a sample is its detail within 1e-4 of the scale, as far as those steps reach.
/// Throws  InvalidInput if the scale is not positive.
std::vector<DetailSample> extract_detail(const OutlineArcs& outline, double scale, DetailFrame frame, InkSide ink,
                                         const std::string& place = {});
/// The same of the stretch of an outline from one place forward to another, across corners that lie in it.
/// Throws  InvalidInput too if the stretch is shorter than the scale.
DetailSample extract_detail(const OutlineArcs& outline, const OutlineArcs::Location& from,
                            const OutlineArcs::Location& to, double scale, DetailFrame frame, InkSide ink);
/// The same of a drawn stroke, the ink on its left: an open polyline, or a closed one.
/// Throws  InvalidInput too if it has fewer than two points, or is shorter than the scale.
DetailSample extract_detail(const Points& stroke, bool is_closed, double scale, DetailFrame frame);

/// Detail along a stretch, as a library has it: of a base of some length in the library's units.
struct DetailBed {
  double length = 0.0;
  bool is_closed = false;
  std::string place;
  Points shape;  ///< m×2 at even steps like a sample's; only needed by a library `by_shape`
};
/// The sample that was taken from this very stretch, if there is one: it goes back where it was.
const DetailSample* sample_of_place(const DetailLibrary& library, const DetailBed& bed);
/// The detail that a library has for a stretch.
///
/// On closed stretches whole tiles of a closed sample, if they need to be stretched by no more than 4 %; else runs cut
/// from samples, joined by cross-fades of half the scale where, of some tried, they agree best. A closed sample goes on
/// for ever; open ones are cut off their ends.
///
/// Shape   n×2 at places 0 <= x <= length; offsets as in a sample.
/// Throws  InvalidInput if there is no sample or the stretch has no length.
Points lay_detail(const DetailLibrary& library, const DetailBed& bed, std::uint64_t seed, bool mirrors,
                  const Eigen::VectorXd& places);

}  // namespace fontcore
