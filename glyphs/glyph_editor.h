#pragma once

// Private to `restyle_glyph`: the steps of a recipe on one glyph, at an amount.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/constraint.h"
#include "fontcore/edit.h"
#include "fontcore/fit.h"
#include "fontcore/outline_curve.h"
#include "glyphs/emission.h"
#include "glyphs/font.h"
#include "glyphs/recipe.h"
#include "glyphs/restyle.h"

namespace glyphs {

/// The whole flow at one amount.
struct Attempt {
  std::vector<fontcore::BezierContour> unrounded;
  std::vector<fontcore::BezierContour> rounded;
  std::vector<StepReport> steps;
  double area = 0.0;                        ///< that the glyph is to have
  std::vector<std::vector<int>> came_from;  ///< per contour and point; none if the structure is the font's
  std::vector<std::string> notes;
};

/// What a recipe asks of one glyph, tried as often as needed; what it refers to has to stay.
///
/// Throws  Refusal if the glyph cannot be edited so; RequestError if the recipe is at fault.
class GlyphEditor {
 public:
  /// Counts into `work` what the tries cost.
  GlyphEditor(const Font& font, const Glyph& glyph, const Recipe& recipe, const std::vector<double>& zones,
              std::int64_t& work);

  bool has_work() const { return !steps_.empty(); }
  /// Leaves features of libraries out that are shorter than a share of their scale.
  void leave_out_below(double finest) { finest_ = finest; }
  bool has_detail() const;
  /// Leaves detail of libraries out near a place.
  void keep_quiet(const fontcore::Point& place) { quiet_.push_back(place); }
  bool has_pin() const;

  /// Throws  WorkLimitExceeded once the tries of this glyph have cost more than any drawn one takes.
  Attempt attempt(double amount, fontcore::HandleMove handle_move = fontcore::HandleMove::Forced);

 private:
  // A step of the recipe as it applies to one glyph, in font units.
  struct PlacedStep {
    Step step;
    int contour = 0;
  };

  void place(SweepStep step, double unit);
  void place(SmoothStep step, double unit);
  void place(EqualizeStep step, double unit);
  void place(SoftenStep step, double unit);
  void place(const CharacterStep& step, double);
  void place(const RepeatStep& step, double);
  void place(WeightStep step, double unit);
  void place_on_contours(const Step& step, std::optional<int> contour);
  void place(const Freeze& freeze, double unit);
  void add_frozen(std::size_t contour, fontcore::Rows rows);
  int checked(int contour) const;
  int nearest_contour(const fontcore::Point& place) const;
  fontcore::Corners corners() const;
  // The points of a contour as it stands that the source marks as corners.
  const std::vector<int>& marked_corners(std::size_t index) const { return references_[index].corners; }
  fontcore::OutlineRules rules_of(std::size_t index) const;
  fontcore::OutlineCurve curve_of(int index, const fontcore::BezierContour& contour);
  void wish(const SweepStep& step, double amount, const fontcore::OutlineCurve& curve, fontcore::StructureEdit& edit,
            StepReport& report) const;
  fontcore::ArcSmoothing smoothing(const Step& step, const fontcore::OutlineArcs& outline,
                                   fontcore::StructureEdit& edit, StepReport& report) const;
  static void hold_corners(const fontcore::OutlineArcs& outline, fontcore::StructureEdit& edit);
  int segment_at(int number, int index) const;
  StepReport soften(const SoftenStep& step, int index, double amount, fontcore::BezierContour& contour);
  void take_over(const fontcore::BezierContour& made, std::vector<int> came_from, int index,
                 fontcore::BezierContour& contour);
  StepReport weighed(const WeightStep& step, double amount, std::vector<fontcore::BezierContour>& contours);
  fontcore::BezierContour held(const fontcore::BezierContour& contour, const fontcore::BezierContour& wished,
                               std::size_t index) const;
  StepReport character(const CharacterStep& step, int index, double amount, fontcore::BezierContour& contour);
  StepReport apply(const PlacedStep& placed, double amount, std::vector<fontcore::BezierContour>& contours,
                   std::vector<fontcore::OutlineCurve::Location>& handles);
  fontcore::StructureFit swept(const SweepStep& step, double amount, const fontcore::BezierContour& contour,
                               fontcore::StructureEdit& edit, StepReport& report);
  fontcore::StructureFit repeated(const RepeatStep& step, double amount, const fontcore::BezierContour& contour,
                                  const fontcore::StructureEdit& edit, StepReport& report) const;
  fontcore::StructureFit smoothed(const Step& step, double amount, const fontcore::BezierContour& contour,
                                  fontcore::StructureEdit& edit, StepReport& report) const;

  const Font& font_;
  const int id_;
  const std::string& name_;
  const std::vector<fontcore::BezierContour>& original_;
  const std::vector<ContourMarks>& marks_;  // one a contour, or none
  const fontcore::Point drawn_at_;          // the place in stored coordinates that a recipe calls the origin
  const Recipe& recipe_;
  std::int64_t& work_;
  fontcore::HandleMove handle_move_ = fontcore::HandleMove::Forced;
  double finest_ = 0.0;
  std::vector<fontcore::Point> quiet_;
  std::vector<PlacedStep> steps_;
  fontcore::OutlineRules rules_;
  std::vector<fontcore::Rows> frozen_;        // per contour
  std::vector<ContourReference> references_;  // per contour, of the attempt being made
  std::vector<double> weighed_zones_;         // where a weight step has put heights of zones
  std::vector<std::optional<fontcore::OutlineCurve>> curves_;
};

}  // namespace glyphs
