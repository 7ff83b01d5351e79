#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/weight.h"
#include "glyphs/font_file.h"
#include "glyphs/jobs.h"

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

struct ReweightOptions {
  double amount = 1.0;                   ///< of the learnt step, -1 to 2
  double italic_angle = 0.0;             ///< degrees leaning right
  std::optional<std::vector<int>> only;  ///< glyph ids, sorted; none: all with outlines of their own
  JobOptions jobs;
};

/// What became of one glyph.
struct ReweightedGlyph {
  int glyph = 0;
  std::string name;
  std::string refused;  ///< why the glyph stays as it was; empty otherwise
  bool changed = false;
  double amount = 0.0;  ///< applied
  double area_before = 0.0;
  double area_after = 0.0;
  int crossings_before = 0;
  int crossings_after = 0;
  int held_segments = 0;             ///< kept from folding over
  std::vector<std::string> dropped;  ///< instructions or hints, and why
};

struct ReweightResult {
  WrittenFont font;
  std::vector<ReweightedGlyph> glyphs;  ///< by id
  int changed() const;
  int refused() const;
};

/// A glyph's contours in another weight, in whole numbers, with its advance kept: what is wider stands in the middle of
/// where it stood. The input's own at amount 0.
std::vector<fontcore::BezierContour> reweight_glyph(const Font& font, int glyph, const fontcore::WeightModel& model,
                                                    const ReweightOptions& options, ReweightedGlyph& report);

/// A font in another weight, every selected glyph on its own; composites follow their parts, advances stay. At amount 0
/// the file itself comes back, bit for bit.
///
/// Throws  RequestError as `kind_of` does, or if the amount is not in [-1, 2]; FontWriteError as the writers do.
ReweightResult reweight(const Font& font, const fontcore::WeightModel& model, const ReweightOptions& options = {});

/// The report as JSON text; same result, same bytes.
std::string reweight_json(const Font& font, const ReweightOptions& options, const ReweightResult& result);

}  // namespace glyphs
