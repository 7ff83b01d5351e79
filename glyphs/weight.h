#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/weight.h"
#include "glyphs/font.h"

namespace glyphs {

/// Which letters a glyph goes with: the lower case by its character; figures, capitals and all else are as tall as
/// capitals, and glyphs without a character go with the lower case if they are not taller than its x.
fontcore::LetterClass letter_class_of(const Font& font, int glyph);

/// The step between two fonts, learnt from control letters; nothing else of them is looked at.
///
/// Controls are characters or glyph names, comma separated: "n,o,H,O". Both fonts may have any units per em.
///
/// Throws  RequestError naming a control letter that a font lacks or that has no outline; InvalidInput as
///         `fontcore::learn_weight` does; FontReadError as `compose` does.
fontcore::WeightModel learn_weight(const Font& from, const Font& to, const std::string& controls);

/// What other families say of single letters: how much wider they grow than a model learnt from controls says, in
/// growths of an upright stroke, for families whose strokes are about as thick as each other and for contrasted ones.
struct WeightPrior {
  std::map<std::string, double> even;
  std::map<std::string, double> contrasted;
  std::vector<std::string> families;  ///< that it was learnt from
};
/// A pair of fonts that a prior is learnt from.
struct WeightFamily {
  std::string name;
  Font from;
  Font to;
};
/// Learns a prior: of every letter a to z and A to Z that is no control the median over the families of a kind, times
/// n / (n + 2) for n families, and a third of that where strokes are contrasted, since they agree less. Letters seen in
/// one family only are left out.
///
/// Throws  as `learn_weight`.
WeightPrior learn_prior(const std::vector<WeightFamily>& families, const std::string& controls);
/// The prior as JSON text and back, as `weight_json` and `parse_weight`.
std::string prior_json(const WeightPrior& prior);
WeightPrior parse_prior(const std::string& json, const std::string& name);
/// The prior that is built in: fonts/priors/latin.json.
WeightPrior latin_prior();
/// Gives a model what the prior says for its kind; what a control letter has shown stands.
void take_prior(fontcore::WeightModel& model, const WeightPrior& prior);

/// The model as JSON text and back: lengths in thousandths of the em, a table's innermost lists by thickness, their
/// lists by direction, straight strokes before round ones. Same model, same bytes.
std::string weight_json(const fontcore::WeightModel& model);
/// Throws  RequestError, one line naming file and key, on JSON that does not parse, a key missing or unknown, a value
///         of the wrong type or shape, a number that is not finite.
fontcore::WeightModel parse_weight(const std::string& json, const std::string& name);

/// How much of a learnt step is taken: shares from -1, as much lighter, to 2; 0 changes nothing.
struct WeightStrength {
  double amount = 1.0;
  std::optional<double> x;      ///< of upright strokes, widths and sides; not given: the amount
  std::optional<double> y;      ///< of level strokes and heights; not given: the amount
  std::optional<double> thin;   ///< of thin strokes of a contrasted face; not given: by their direction
  std::optional<double> serif;  ///< of serifs; not given: as other strokes
  /// How thick stems and bars of the font's n and o are to be, in place of x and y; font units.
  fontcore::StemWidths stems;
};

/// The amounts that a strength means in a font.
///
/// Throws  RequestError if one is not in [-1, 2], or if stems are wished that the step cannot give, or that the font
///         has no n and o to tell from.
fontcore::WeightAmounts amounts_in(const Font& font, const fontcore::WeightModel& model,
                                   const WeightStrength& strength);

/// A model learnt on one family as another takes it, the font's: with heights and counters of its n, o, H and O, and
/// strokes in proportion to theirs. With a font that has its n and o in the weight wanted, `drawn`, the step is the one
/// that they show.
///
/// Throws  RequestError naming one of these letters that a font lacks, or that has no outline.
fontcore::WeightModel carry_weight(const Font& font, const fontcore::WeightModel& model, const Font* drawn = nullptr);

/// True if nothing is taken of a step.
bool is_nothing(const fontcore::WeightAmounts& amounts);

struct GlyphWeight {
  double share = 1.0;         ///< of the amounts
  double italic_angle = 0.0;  ///< radians leaning right
  double detail_scale = 0.0;  ///< texture below rides along unthickened; font units, 0: none
};

/// Contours of a glyph, its own or what became of them, in another weight, not rounded; the middle of their ink stays
/// where it was. Throws  as `fontcore::apply_weight`.
fontcore::Weighted apply_weight(const Font& font, int glyph, const std::vector<fontcore::BezierContour>& contours,
                                const fontcore::WeightModel& model, const fontcore::WeightAmounts& amounts,
                                const GlyphWeight& options = {});

}  // namespace glyphs
