#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// Letters that share stems and heights; figures and the rest go with the one they stand as tall as.
enum class LetterClass : std::uint8_t { LowerCase, Capital };

/// A control letter in both weights. The outlines may differ in their points, not in how many contours they have.
struct WeightPair {
  std::string name;
  LetterClass letter_class = LetterClass::LowerCase;
  std::vector<BezierContour> from;
  std::vector<BezierContour> to;
  double from_advance = 0.0;
  double to_advance = 0.0;
};

/// How strokes, counters, heights and sides grow from one weight to another: a small value without any outline.
///
/// Thickness T across a stroke grows by a law of T and the direction of its normal, from the vertical and horizontal
/// strokes of the class: like a power of T where both are about as thick; where they differ much, from the growth of
/// the thin ones to that of the thick ones as T goes from the one to the other, diagonals as thick strokes are measured
/// across the line. What the control letters say beyond that is a table, with a deviation that says how sure it is.
/// Counters between upright strokes grow with their width. Heights move by zones.
///
/// Units   thousandths of the em; directions of normals from the x axis.
struct WeightModel {
  static constexpr std::array<double, 7> directions = {0, 15, 30, 45, 60, 75, 90};              ///< degrees
  static constexpr std::array<double, 8> thicknesses = {.2, .3, .42, .56, .72, .9, 1.1, 1.35};  ///< of a stem's
  static constexpr std::array<double, 12> widths = {20,  40,  70,  110, 150, 190,
                                                    240, 300, 370, 460, 600, 900};  ///< of a counter
  using Table = std::array<std::array<std::array<double, thicknesses.size()>, directions.size()>, 2>;

  /// A kind of stroke: how thick it is and by how much it grows.
  struct Stroke {
    double thickness = 0.0;
    double growth = 0.0;
  };
  struct Letters {
    Stroke upright;               ///< vertical stems
    Stroke level;                 ///< horizontal strokes: bars, the tops of bowls, hairlines
    double counter = 0.0;         ///< width of a counter between stems
    double counter_growth = 0.0;  ///< its growth if both strokes beside it grow like stems
    double counter_slope = 0.0;   ///< and how it changes with the counter's width
    double spread = 0.0;          ///< growth of the distance between centre lines, relative
    double serif = 0.0;           ///< growth of serif edges along themselves, relative
    double room = 0.0;            ///< height of a counter without bars; 0 if none was seen
    double left_side = 0.0;       ///< growth of the sidebearings
    double right_side = 0.0;
    Table correction{};  ///< of the law, by straight (0) or round (1), direction, thickness
    Table deviation{};   ///< of law and correction together
    std::array<std::array<double, widths.size()>, 3> counter_correction{};  ///< by round sides: none, one, both
  };
  /// A height and by how much it moves up.
  struct Zone {
    double height = 0.0;
    double shift = 0.0;
  };
  /// What the model makes of a control letter, beside what was drawn.
  struct Control {
    std::string name;
    double thickness_error = 0.0;  ///< root mean square over the length of its strokes
    double width_error = 0.0;      ///< of the box: the model's minus the drawn one
    bool used = true;              ///< false if the contours of its two outlines do not pair up
  };

  std::array<Letters, 2> letters;  ///< by LetterClass
  /// What other families say of single letters, by name: how much wider they grow than the model says, in growths of
  /// an upright stroke. Whoever applies the model knows the names.
  std::map<std::string, double> widening;
  std::vector<Zone> top;  ///< rising
  std::vector<Zone> bottom;
  std::vector<Control> controls;
};

/// Learns the step from one weight to another from a few letters drawn in both.
///
/// Outlines are put in correspondence by dynamic time warping on place, tangent and corners; the model is the law
/// fitted to them with a Gaussian process on what is left, kept as a table.
///
/// Units   outlines and advances in font units.
/// Throws  InvalidInput if no letter can be used, or if units_per_em is not positive.
WeightModel learn_weight(std::span<const WeightPair> pairs, double units_per_em);

/// How much of a learnt step each kind of stroke takes; one of them for all is the step itself.
///
/// A stroke between upright and level takes x cos^2 + y sin^2 of the direction of its normal, one between thin and
/// thick goes over alike.
struct WeightAmounts {
  double x = 1.0;               ///< upright strokes, widths and sides
  double y = 1.0;               ///< level strokes and heights
  std::optional<double> thin;   ///< thin strokes of a contrasted face; not given: by their direction
  std::optional<double> serif;  ///< serifs, how thick and how long they are; not given: as other strokes
};

struct WeightOptions {
  double amount = 1.0;        ///< of the learnt step; 0 is the identity
  WeightAmounts amounts;      ///< times the amount, each product in [-1, 2]
  double widening = 0.0;      ///< of the shape beyond what the model says, in growths of an upright stroke
  double italic_angle = 0.0;  ///< what vertical means for lines and extrema, radians leaning right
};

/// A shape in another weight.
struct Weighted {
  std::vector<BezierContour> contours;  ///< of the structure given, not rounded
  double amount = 0.0;     ///< applied: nearer 0 than asked where more would cross, close a counter or lose ink
  int held_segments = 0;   ///< kept from folding over
  double left_side = 0.0;  ///< learnt growth of the sidebearings times the amount, font units
  double right_side = 0.0;
};

/// Applies a learnt step: one least-squares problem on the outline's own points, with its lines, smooth joins and
/// extrema kept as rows that hold exactly.
///
/// The displacement is linear in the amount and in `amounts`, and 0 where all of them are, where the contours come back
/// bit for bit. Amounts above 0 add ink, ones below take it away, and mixed ones do as they may. Where the outline
/// would cross itself anew, close a counter or change its area against the sign of the amounts, segments that fold over
/// are held back; if that is not enough, the amount is scaled back to the largest that does neither.
///
/// Units   font units. Throws InvalidInput if an amount is not in [-1, 2] or units_per_em is not positive.
Weighted apply_weight(const std::vector<BezierContour>& contours, LetterClass letter_class, const WeightModel& model,
                      double units_per_em, const WeightOptions& options = {});

/// Thickness of the upright and level strokes of letters; of a wish, either may be left open.
///
/// Units   font units.
struct StemWidths {
  std::optional<double> upright;
  std::optional<double> level;
};

/// Measures letters of one class: the medians over their strokes, straight upright ones counting ten times as much as
/// round ones. What the letters have no stroke of stays open.
///
/// Throws  InvalidInput if units_per_em is not positive.
StemWidths measure_stems(std::span<const std::vector<BezierContour>> letters, double units_per_em);

/// The amounts that give letters of one class the stems wished for, by what the model makes of these letters: its n and
/// o, say. A width left open takes as much of the step as the other.
///
/// Exact   up to what the least squares leave: the medians of `measure_stems` within a hundredth of the step.
/// Throws  InvalidInput if nothing is wished, if the letters have no such strokes, if the model does not change them,
/// or
///         if an amount would not be in [-1, 2].
WeightAmounts amounts_for_stems(std::span<const std::vector<BezierContour>> letters, LetterClass letter_class,
                                const WeightModel& model, double units_per_em, const StemWidths& wished);

/// The x and y amounts of a model, learnt elsewhere perhaps, by which the strokes of letters come nearest in thickness
/// to their other drawing: the least sum of errors over their length. Clamped to [-1, 2].
///
/// Throws  InvalidInput if no pair's contours pair up, or if units_per_em is not positive.
WeightAmounts fit_amounts(std::span<const WeightPair> pairs, const WeightModel& model, double units_per_em);

/// A step learnt on one family as another takes it, whose letters are given: `to` of those that are drawn in one weight
/// only is empty.
///
/// Strokes grow in proportion to the family's own, counters and zones are its own. Letters drawn in both weights, an n
/// and an o say, scale the step: upright and level strokes each by their least error, widths by theirs; the amount 1 of
/// the result is the step that they show. How much wider a class gets that none of them shows is what the model says to
/// a third and what families usually do to the rest: widths are a decision of the family, they do not follow the stems.
/// The controls of the result are the letters drawn in both.
///
/// Throws  InvalidInput if no letter has strokes, or if units_per_em is not positive.
WeightModel carry_weight(const WeightModel& model, std::span<const WeightPair> letters, double units_per_em);

}  // namespace fontcore
