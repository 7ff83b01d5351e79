#pragma once

#include <optional>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/jobs.h"
#include "glyphs/layout_use.h"
#include "glyphs/recipe.h"
#include "glyphs/spacing.h"
#include "glyphs/weight.h"

namespace glyphs {

struct ReweightOptions {
  WeightStrength strength;
  AdvancePolicy advance = AdvancePolicy::Keep;
  Emission emission = Emission::Structure;
  double tolerance = 0.5;                ///< that compact emission may deviate, font units
  double italic_angle = 0.0;             ///< degrees leaning right
  double detail_scale = 0.0;             ///< texture below rides along unthickened; font units, 0: none
  std::optional<std::vector<int>> only;  ///< glyph ids, sorted; none: all with outlines of their own
  JobOptions jobs;
};

/// What became of one glyph.
struct ReweightedGlyph : GlyphChange {
  double share = 0.0;  ///< of the amounts that was applied: 1 unless more would do harm
  double advance_before = 0.0;
  double advance_after = 0.0;
  int held_segments = 0;  ///< kept from folding over
  SideGrowth sides;       ///< by how much the sidebearings grow, as learnt
};

struct ReweightResult : GlyphChanges<ReweightedGlyph> {
  WrittenFont font;
  fontcore::WeightAmounts amounts;  ///< that were asked of every glyph
  Spacing spacing;                  ///< without its outlines
  LayoutUse layout;                 ///< of what is drawn otherwise, and is kept: anchors in GPOS, kerning
};

/// A glyph's contours in another weight, in whole numbers, on the advance it has: the middle of the ink stays. The
/// input's own where nothing is taken of the step.
///
/// A glyph that the whole of it would make cross itself anew, close a counter or change its ink against the sign of the
/// amounts takes less. Compact emission is that of a recipe; a glyph that it would make cross itself, close a counter
/// or change its ink so, or give no fewer segments, keeps its own points.
///
/// `came_from` is as in `GlyphResult`.
std::vector<fontcore::BezierContour> reweight_glyph(const Font& font, int glyph, const fontcore::WeightModel& model,
                                                    const fontcore::WeightAmounts& amounts,
                                                    const ReweightOptions& options, ReweightedGlyph& report,
                                                    std::vector<std::vector<int>>& came_from);

/// A font in another weight, every selected glyph on its own; advances, composites and anchors by `space`. Where
/// nothing is taken of the step the file itself comes back, bit for bit.
///
/// Throws  RequestError as `kind_of`, `amounts_in` and `space` do; FontWriteError as the writers do.
ReweightResult reweight(const Font& font, const fontcore::WeightModel& model, const ReweightOptions& options = {});

/// The report as JSON text; same result, same bytes.
std::string reweight_json(const Font& font, const ReweightOptions& options, const ReweightResult& result);

}  // namespace glyphs
