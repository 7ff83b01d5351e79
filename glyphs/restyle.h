#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/jobs.h"
#include "glyphs/recipe.h"

namespace glyphs {

/// What became of a handle.
struct HandleReport {
  fontcore::Point handle{0, 0};  ///< the point of the outline nearest to `near`
  fontcore::Point asked{0, 0};   ///< the move wished for it
  fontcore::Point got{0, 0};     ///< the move it made before rounding
};

/// What became of one step on one contour of a glyph. Handles are a sweep's.
struct StepReport {
  std::string op;
  int contour = 0;
  std::vector<HandleReport> handles;
  double level = 0.0;                ///< fractional level j + t of the edit
  int levels = 0;                    ///< level of the finest control points, of a sweep's model or of any arc
  std::vector<std::string> against;  ///< what stood against the wish, by name; empty if it was met
  double energy_before = 0.0;        ///< of a smooth step: bending energy of the contour's model, 1 / font units
  double energy_after = 0.0;
  double off_wish = 0.0;      ///< largest distance of the solved displacement from the wished one, font units
  int corners = 0;            ///< of a soften step: corners that are arcs now
  double least_radius = 0.0;  ///< of these arcs, font units
  int arcs = 0;               ///< of a character step: arcs with new detail
  int too_short = 0;          ///< and those without room for two fades, which stay
  double base_move = 0.0;     ///< largest move of the outline projected at the library's scale, font units
  int places = 0;             ///< of a repeat step: stretches that run alike
  double share = 0.0;         ///< of a weight step: of its amounts that was applied
  int held_segments = 0;      ///< and segments kept from folding over
  SideGrowth sides;           ///< and by how much the sidebearings grow, as learnt
  double finest = 0.0;  ///< features shorter than this are left out, so that the glyph has no more points than it may
};

/// How much glyphs take in their file, before and after.
struct OutlineSize {
  std::int64_t points_before = 0;  ///< that the file holds: implied nodes and those of components do not count
  std::int64_t points_after = 0;
  std::int64_t bytes_before = 0;  ///< as `glyph_bytes` counts them
  std::int64_t bytes_after = 0;

  OutlineSize& operator+=(const OutlineSize& other);
};

/// What became of one glyph.
struct GlyphReport : GlyphChange {
  double amount = 1.0;          ///< share of the wished moves applied; below 1 if a crossing stood against it
  double area_target = 0.0;     ///< that of before, or of the softened or weighed outline
  double area_unrounded = 0.0;  ///< area before rounding to whole numbers
  double largest_displacement = 0.0;
  int closed_counters = 0;            ///< counters of the ink that are gone
  std::vector<int> changed_windings;  ///< contours that run the other way round now, or lie within others
  int segments_kept = 0;              ///< bit for bit as they were
  OutlineSize size;                   ///< its bytes are known once the font is written
  double deviation = 0.0;  ///< two-sided distance of the emitted outline from the solved one: rounding's, font units
  std::vector<StepReport> steps;
};

/// One glyph through the whole flow: model, sweep, rules, area, whole numbers, crossing check.
struct GlyphResult {
  std::vector<fontcore::BezierContour> contours;  ///< whole-number coordinates; the input's own where nothing changed
  std::vector<fontcore::BezierContour> unrounded;
  std::vector<std::vector<int>> came_from;  ///< per contour and point its index in the input, -1 if it is new; none
                                            ///< where all contours have the structure of the input
  GlyphReport report;
  std::int64_t work = 0;  ///< points, every one counted as often as the steps were tried, with detail
                          ///< of libraries sixteen times: that is what it takes
};
/// `zones` are heights that the font's letters share; the glyph's own lowest and highest nodes are added if the recipe
/// says "auto".
/// Around `quiet` places no library's detail is laid.
GlyphResult restyle_glyph(const Font& font, int glyph, const Recipe& recipe, const std::vector<double>& zones = {},
                          const std::vector<fontcore::Point>& quiet = {});
/// Whether a step lays detail of a library.
bool lays_detail(const Recipe& recipe);
/// What a point costs as `GlyphResult::work` counts.
std::int64_t work_of_point(const Recipe& recipe);

/// Heights of the alignment zones of a font, flat and overshoot, found from its Latin letters and figures.
std::vector<double> alignment_zones(const Font& font);

struct RestyleOptions {
  JobOptions jobs;
  std::optional<std::vector<int>> only;  ///< of the recipe's glyphs only these, sorted
};

/// A font through a recipe: every selected glyph on its own, then one font. Glyphs that refuse stay as they were and
/// are named.
///
/// Work is bounded by what the font stores: a damaged one whose glyphs all draw one huge outline would take for ever.
/// Every glyph costs its points for every time that its steps are tried; what comes after the budget is spent stays as
/// it was and is named. No sound font comes near it.
struct RestyleResult : GlyphChanges<GlyphReport> {
  WrittenFont font;
  Spacing spacing;   ///< without its outlines; advances change by weight steps alone
  OutlineSize size;  ///< of all glyphs of the font: composites change with their parts
};

/// The recipe with the models and amounts of its weight steps told for the font.
///
/// Throws  RequestError as `carry_weight` and `amounts_in`, or if a step's model is not loaded.
Recipe with_amounts(const Font& font, Recipe recipe);

/// The glyphs that `restyle` works on, sorted.
///
/// Throws  RequestError as `restyle` does.
std::vector<int> glyphs_to_restyle(const Font& font, const Recipe& recipe, const RestyleOptions& options = {});

/// Throws  RequestError if a step names a glyph or a contour that does not exist or was not selected, or as `kind_of`
/// does; FontWriteError as `write_font` does.
RestyleResult restyle(const Font& font, const Recipe& recipe, const RestyleOptions& options = {});

/// The report as JSON text; same result, same bytes.
std::string report_json(const Font& font, const RestyleResult& result);

}  // namespace glyphs
