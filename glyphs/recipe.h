#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/detail.h"
#include "fontcore/edit.h"
#include "fontcore/measure.h"
#include "fontcore/place.h"
#include "glyphs/font.h"
#include "glyphs/spacing.h"
#include "glyphs/weight.h"

namespace glyphs {

/// A place that is dragged.
struct SweepHandle {
  fontcore::Point near{0, 0};  ///< the nearest point of the outline is the handle, font units
  fontcore::Point move{0, 0};  ///< where it is to go, font units
};

/// Moves the broad shape near a place; detail rides along. [FS94] editing the sweep.
struct SweepStep {
  std::string glyph;            ///< name or code point; empty: every selected glyph
  std::optional<int> contour;   ///< which contour; none: the one nearest to `near`
  fontcore::Point near{0, 0};   ///< the nearest point of the outline is the handle, font units
  fontcore::Point move{0, 0};   ///< where the handle is to go, font units
  double breadth = 0.0;         ///< length of outline that the edit moves, font units
  std::optional<double> level;  ///< a fractional level instead of a breadth, 0 the coarsest of the contour
  fontcore::Grip grip = fontcore::Grip::Curve;  ///< with a level: its control point nearest to `near` instead
  std::vector<SweepHandle> more;                ///< further handles on the same contour, dragged at once
  fontcore::DetailFrame detail = fontcore::DetailFrame::Fixed;
  bool pin = false;  ///< the handle must land: what rules do not allow refuses the glyph
};

/// Takes away features shorter than a scale. Corners and straight arcs stay; with Keep::corners false, corners are
/// rounded as far as the outline's own points can follow. [FS94] smoothing.
struct SmoothStep {
  std::string glyph;           ///< as in SweepStep
  std::optional<int> contour;  ///< which contour; none: every one that has an inside
  double scale = 0.0;          ///< length of the features to go, font units
  fontcore::SmoothBy by = fontcore::SmoothBy::Energy;
};

/// Makes features of some sizes stronger or weaker, arc by arc.
struct EqualizeStep {
  std::string glyph;  ///< as in SmoothStep
  std::optional<int> contour;
  std::vector<fontcore::Band> bands;  ///< scales rising, font units
};

/// Rounds corners by a radius. Every one becomes an arc with points of its own, so the contour changes its structure;
/// later steps work on the rounded outline, and the area it has is what they keep. Frozen corners stay.
struct SoftenStep {
  std::string glyph;  ///< as in SmoothStep
  std::optional<int> contour;
  double radius = 0.0;  ///< of the arcs, font units; less where a leg is too short
  /// Points of the contour that become arcs, whatever their turn: with one list masters of one structure stay of one.
  /// Numbers as the font has them: from 0, implied nodes not counted. None: every corner with room for an arc.
  std::optional<std::vector<int>> corners;
};

/// Lays detail of a library on the outline, in place of its own below the library's scale or in addition to it. What
/// it touches gets points of its own: later steps work on the textured outline, and it is emitted compactly. Corners,
/// frozen stretches and the area stay; rules on extrema, lines and zones are for the other steps. [FS94] character.
struct CharacterStep {
  std::string glyph;  ///< as in SmoothStep
  std::optional<int> contour;
  std::string library_path;                                ///< as the recipe has it, relative to the recipe
  std::shared_ptr<const fontcore::DetailLibrary> library;  ///< none until `load_recipe` has read it
  double gain = 1.0;
  bool adds = false;
  bool mirrors = false;
  bool spares_lines = false;  ///< long straights stay as they are
  bool holds_joins = false;   ///< smooth joins stay where they are
};

/// An edit of one stretch, a serif, done again wherever outlines run alike.
struct RepeatStep {
  std::string glyph;  ///< as in SmoothStep
  std::optional<int> contour;
  std::string library_path;                            ///< as in CharacterStep
  std::shared_ptr<const fontcore::PlacedDetail> edit;  ///< none until `load_recipe` has read it
  double within = 4.0;    ///< largest distance between matching points, thousandths of the em
  bool mirrors = true;    ///< mirror images too
  bool turns = false;     ///< and turned by any angle
  double smallest = 1.0;  ///< sizes that are looked for
  double largest = 1.0;
};

/// A learnt step of weight, on the whole glyph. Heights, widths and the area that it makes are what later steps keep
/// to; frozen stretches stay.
struct WeightStep {
  std::string glyph;                                   ///< as in SmoothStep
  std::optional<int> contour;                          ///< none
  std::string model_path;                              ///< as in CharacterStep
  std::shared_ptr<const fontcore::WeightModel> model;  ///< none until `load_recipe` has read it
  bool carries = false;                                ///< the font is of another family than the model: `carry_weight`
  WeightStrength strength;
  double detail_scale = 0.0;  ///< texture below rides along unthickened; 0: none
  /// What the strength means in the font at hand; none: `amounts_in` tells.
  std::optional<fontcore::WeightAmounts> amounts;
  AdvancePolicy advance = AdvancePolicy::Keep;  ///< of the last step that weighs a glyph
};

using Step = std::variant<SweepStep, SmoothStep, EqualizeStep, SoftenStep, CharacterStep, RepeatStep, WeightStep>;

enum class KeepArea { Glyph, Contour, None };
enum class OnCrossing { Reduce, Refuse, Allow };

/// A stretch of outline that no step moves.
struct Freeze {
  std::string glyph;           ///< name or code point; empty: every selected glyph
  std::optional<int> contour;  ///< none: that nearest to where the stretch begins
  std::optional<std::pair<fontcore::Point, fontcore::Point>> stretch;  ///< near both ends, from the first forward
  std::optional<fontcore::Box> box;  ///< or all that has a part in a box, of every contour
};

/// What must hold while steps are applied.
struct Keep {
  bool corners = true;
  bool lines = true;
  bool smooth_joins = true;
  bool extrema = true;
  bool zones_auto = true;     ///< flat and round features at heights that the font's letters share keep them
  std::vector<double> zones;  ///< heights given by the recipe instead
  KeepArea area = KeepArea::Glyph;
  bool length = false;        ///< of every contour, before rounding
  double italic_angle = 0.0;  ///< what vertical means for lines and extrema, degrees leaning right
  std::vector<Freeze> freeze;
};

/// What an edited outline is written as.
enum class Emission {
  Structure,  ///< its own points, moved: masters stay interpolable
  Compact,    ///< the fewest segments found within the tolerance
};

/// A recipe as a value: which glyphs, which steps, what holds, how it is emitted.
struct Recipe {
  std::string glyphs;  ///< a selection as `select_glyphs` reads it; empty: all glyphs with outlines
  std::vector<Step> steps;
  Keep keep;
  Emission emission = Emission::Structure;
  double tolerance = 0.5;  ///< deviation of the emitted outline from the wished one that is remarked on, or that a
                           ///< compact one may have, font units
  int most_points = 2000;  ///< that a glyph may have by a character step: its finest features are left out until it
                           ///< has no more
  Composites composites = Composites::Refuse;  ///< what a selected composite means
  OnCrossing on_crossing = OnCrossing::Reduce;
  bool lengths_in_thousandths = false;  ///< lengths are em/1000, not font units
  std::uint64_t seed = 0;
};

/// Reads a recipe. Keys, types and what this version can do are checked; nothing is ignored.
///
/// Throws  RequestError, one line: `NAME: KEY: why` for JSON that does not parse, an unknown or repeated key, a value
/// of the wrong type,
///         an operation or a rule this version cannot honour.
Recipe parse_recipe(const std::string& json, const std::string& name);
/// Reads the file, parses it, and reads the libraries and models that it names.
Recipe load_recipe(const std::string& path);

/// The glyph ids a selection names, sorted, each once: names (`a`, `f_f_i`), code points and ranges (`U+0041-005A`),
/// `gid:12`, `@file` (one selection a line), comma separated. Empty: all glyphs with outlines, and those whose outlines
/// cannot be read.
///
/// Throws  RequestError naming what is unknown. A range may have gaps, but must find something.
std::vector<int> select_glyphs(const Font& font, const std::string& selection);

}  // namespace glyphs
