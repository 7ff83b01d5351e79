#pragma once

#include <cstdint>
#include <optional>
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
  Points shape;   ///< n×2, or none: the base's direction, radians, without jumps, and its curvature, 1 / font units
  std::string place;  ///< where it was taken, or nothing: a stretch of this place and length gets it back as it was
};

/// Detail to be laid on outlines: samples of one hand, below one scale.
struct DetailLibrary {
  std::string name;
  double units_per_em = 1000.0;             ///< of the lengths here
  double scale = 0.0;                       ///< feature size below which this is detail
  DetailFrame frame = DetailFrame::Tangent;  ///< ScaledTangent: a sample is stretched to the whole arc, and grows with it
  bool by_shape = false;  ///< every stretch takes the detail of the stretch of a sample that runs most like it
  std::vector<DetailSample> samples;
};

/// On which side of its direction a contour has the ink.
enum class InkSide { Left, Right };

/// The contour cut into arcs at those corners that are corners at a scale.
///
/// Where both sides, looked at over half the scale, turn by less than 30 degrees, and a neighbouring arc is shorter
/// than that, what turns is texture: rough print is not a row of corners.
///
/// `options` as for OutlineArcs, its corners always kept.
OutlineArcs arcs_at_scale(const BezierContour& contour, double scale, const OutlineCurveOptions& options = {});

/// An arc's base: the part that is no detail below a scale, and the parameter that outline and base share.
///
/// The least-squares cubic spline of round(2 L / scale) spans, at least 4 if closed and else 1, over its own arc
/// length L, found in a few passes so that roughness does not stretch the parameter; open arcs keep their ends. A
/// projection, so base + detail has the same base.
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
  /// The largest move of the base under a displacement of the points: its projection, on the shared parameter.
  double base_move(const Points& displacement) const;

 private:
  bool is_closed_ = false;
  int spans_ = 0;
  double length_ = 0.0;
  Eigen::VectorXd places_;
  Eigen::VectorXd weights_;
  Points base_;
  Points tangents_;
};

/// The detail below `scale` of every arc of an outline that has room for two fades of half the scale, and of a contour
/// without corners.
///
/// Shape   samples of steps of at most scale / 64, with their shapes; place "PLACE/ARC".
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

/// How detail is laid on an outline.
struct CharacterOptions {
  double gain = 1.0;
  bool adds = false;      ///< to the outline's own detail below the scale, instead of replacing it
  bool mirrors = false;   ///< samples run the other way
  std::uint64_t seed = 0;  ///< of phases and of the choice among samples; arcs differ by themselves
  double unit = 1.0;       ///< font units that a unit of the library's em is long
  double finest = 0.0;     ///< features of the library shorter than this are left out, font units
  bool spares_lines = false;  ///< lines longer than half the scale stay as they are
  bool holds_joins = false;   ///< smooth joins stay where they are
  /// Stretches of arc length, from the first arc's start, that stay as they are.
  std::vector<std::pair<double, double>> held;
  InkSide ink = InkSide::Left;
  std::string place;              ///< of the contour, as `extract_detail` has it
  std::optional<double> area;     ///< signed area the contour is to have
};

/// An outline with detail laid on it: where nothing was laid, its own segments bit for bit; else short cubics.
struct Character {
  BezierContour contour;
  std::vector<int> came_from;  ///< per point its index in the source, -1 if it is new
  std::vector<int> kept;       ///< segments that are the source's own
  int arcs = 0;                ///< that have new detail
  int too_short = 0;           ///< arcs without room for two fades: they stay as they are
  double base_move = 0.0;      ///< largest move of any arc's base on the shared parameter, font units
  double largest = 0.0;        ///< largest displacement of the outline, font units
  std::string area_failed;     ///< why the area is not met; empty if it is or was not asked
};

/// Lays detail along every arc of an outline, by arc length of its base.
///
/// Samples keep their size: where whole tiles of one need to be stretched by no more than 4 %, tiles; else pieces cut
/// from samples, joined by cross-fades of half the scale where they agree best. The detail fades to nothing over half
/// the scale at corners and wherever something is held. The base of every arc stays: all that is laid, or taken away,
/// is orthogonal to its space, with the fades; so is the correction that gives the area back. Where that space has no
/// room for it, as with a gain of 0, the outline moves along its normals by as little as it takes.
///
/// Exact   corners, held stretches and arcs without detail bit for bit; the area to 1e-12; a gain of 0 with `adds` is
///         the identity.
/// Throws  InvalidInput if the library has no sample, or a number is not finite or not positive.
/// Source  [FS94] editing the character of a curve, orientation of detail.
Character apply_detail(const OutlineArcs& outline, const DetailLibrary& library, const CharacterOptions& options = {});

/// Detail along a stretch, as `apply_detail` chooses it: of a base of some length in the library's units.
struct DetailBed {
  double length = 0.0;
  bool is_closed = false;
  std::string place;
  Points shape;  ///< m×2 at even steps like a sample's; only needed by a library `by_shape`
};
/// Shape   n×2 at places 0 <= x <= length; offsets as in a sample.
Points lay_detail(const DetailLibrary& library, const DetailBed& bed, std::uint64_t seed, bool mirrors,
                  const Eigen::VectorXd& places);

}  // namespace fontcore
