#include "glyphs/reweight.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/rounding.h"
#include "glyphs/error.h"
#include "glyphs/json_reader.h"
#include "glyphs/restyle.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::text;
using fontcore::WeightAmounts;
using fontcore::WeightModel;
using Contours = std::vector<BezierContour>;

Contours in_whole_numbers(const Contours& wished, const Contours& original, double italic_angle) {
  double scale = 0.0;
  for (const BezierContour& contour : wished) scale += std::abs(signed_area(contour));
  std::vector<fontcore::Unrounded> unrounded;
  for (std::size_t k = 0; k < wished.size(); ++k) {
    fontcore::OutlineRules rules;
    rules.frame.italic_angle = italic_angle;
    unrounded.push_back(
        {wished[k], original[k], rules, {.area = signed_area(wished[k]), .scale = scale, .handles = {}}});
  }
  Contours result;
  for (fontcore::Rounding& rounding : round_keeping_area(unrounded)) result.push_back(std::move(rounding.contour));
  return result;
}

// The sign that all amounts have; 0 if they differ.
int sign_of(const WeightAmounts& amounts) {
  const double thin = amounts.thin.value_or(amounts.x);
  const double serif = amounts.serif.value_or(amounts.x);
  const auto [least, most] = std::minmax({amounts.x, amounts.y, thin, serif});
  return least >= 0.0 ? 1 : most <= 0.0 ? -1 : 0;
}

// What an outline must not become.
class Guard {
 public:
  Guard(const Contours& outline, int sign)
      : before_(find_crossings(outline)), ink_(measure_ink(outline, before_)), sign_(sign) {}

  int crossings_before() const { return static_cast<int>(before_.size()); }
  /// The crossings of an outline that adds none, closes no counter and has ink as the sign has it; else none.
  std::optional<int> crossings_of(const Contours& outline) const {
    const auto after = find_crossings(outline);
    if (added_crossings(before_, after) > 0) return std::nullopt;
    const fontcore::Ink now = measure_ink(outline, after);
    if (!closed_counters(ink_, now).empty()) return std::nullopt;
    if (sign_ > 0 ? now.area < ink_.area : sign_ < 0 && now.area > ink_.area) return std::nullopt;
    return static_cast<int>(after.size());
  }

 private:
  std::vector<fontcore::Crossing> before_;
  fontcore::Ink ink_;
  int sign_;
};

// The recipe of one step that is the same edit.
Recipe compact_recipe(const WeightModel& model, const WeightAmounts& amounts, const ReweightOptions& options) {
  WeightStep step;
  step.model = std::shared_ptr<const WeightModel>(std::shared_ptr<void>(), &model);
  step.amounts = amounts;
  step.detail_scale = options.detail_scale;
  Recipe recipe;
  recipe.steps.emplace_back(std::move(step));
  recipe.keep.italic_angle = options.italic_angle;
  recipe.emission = Emission::Compact;
  recipe.tolerance = options.tolerance;
  return recipe;
}

}  // namespace

Contours reweight_glyph(const Font& font, int id, const WeightModel& model, const WeightAmounts& amounts,
                        const ReweightOptions& options, ReweightedGlyph& report,
                        std::vector<std::vector<int>>& came_from) {
  const Glyph& glyph = font.glyphs.at(static_cast<std::size_t>(id));
  report.glyph = id;
  report.name = glyph.name;
  report.advance_before = report.advance_after = glyph.advance;
  const Contours& outline = glyph.contours;
  try {
    if (!glyph.trouble.empty()) {
      report.refused = glyph.trouble;
      return outline;
    }
    report.area_before = report.area_after = signed_area(outline);
    report.segments_before = report.segments_after = segment_count(outline);
    if (outline.empty() || is_nothing(amounts)) return outline;
    const Guard guard(outline, sign_of(amounts));
    report.crossings_before = report.crossings_after = guard.crossings_before();
    const double italic_angle = options.italic_angle * std::numbers::pi / 180.0;
    // Whole numbers may add what the step itself did not: less of it then.
    for (const double share : {1.0, 0.98, 0.95, 0.9, 0.8, 0.65, 0.5}) {
      const fontcore::Weighted weighted =
          apply_weight(font, id, outline, model, amounts,
                       {.share = share, .italic_angle = italic_angle, .detail_scale = options.detail_scale});
      if (weighted.amount == 0.0) break;
      Contours made = in_whole_numbers(weighted.contours, outline, italic_angle);
      std::optional<int> crossings = guard.crossings_of(made);
      if (!crossings) continue;
      if (options.emission == Emission::Compact) {
        WeightAmounts applied = amounts;
        for (double* amount : {&applied.x, &applied.y}) *amount *= weighted.amount;
        for (std::optional<double>* amount : {&applied.thin, &applied.serif}) {
          if (*amount) **amount *= weighted.amount;
        }
        GlyphResult compact = restyle_glyph(font, id, compact_recipe(model, applied, options));
        const auto its = guard.crossings_of(compact.contours);
        if (compact.report.refused.empty() && its && segment_count(compact.contours) < segment_count(made)) {
          made = std::move(compact.contours);
          came_from = std::move(compact.came_from);
          crossings = its;
        } else {
          report.notes.emplace_back("keeps its own points: no fewer segments are within the tolerance");
        }
      }
      report.changed = made != outline;
      report.share = weighted.amount;
      report.held_segments = weighted.held_segments;
      report.sides = {weighted.left_side, weighted.right_side};
      report.crossings_after = *crossings;
      report.segments_after = segment_count(made);
      report.area_after = signed_area(made);
      return made;
    }
    report.refused = "any of the step adds a crossing, closes a counter or changes the ink against its sign";
  } catch (const fontcore::Error& error) {
    report.refused = error.what();
  } catch (const FontReadError& error) {
    report.refused = error.what();
  }
  return outline;
}

ReweightResult reweight(const Font& font, const WeightModel& model, const ReweightOptions& options) {
  kind_of(font);
  ReweightResult result;
  result.amounts = amounts_in(font, model, options.strength);
  const bool is_edit = !is_nothing(result.amounts);
  if (is_edit) refuse_at_fault(font);
  if (is_edit) space(font, {}, options.advance, {}, options.only);  // what it refuses, before any work
  std::vector<int> selected;
  for (const Glyph& glyph : font.glyphs) {
    if (options.only && !std::ranges::binary_search(*options.only, glyph.id)) continue;
    if (!glyph.contours.empty() || !glyph.trouble.empty()) selected.push_back(glyph.id);
  }
  std::vector<Contours> outlines(selected.size());
  std::vector<std::vector<std::vector<int>>> origins(selected.size());
  result.glyphs.resize(selected.size());
  run_jobs(static_cast<int>(selected.size()), options.jobs, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    outlines[k] = reweight_glyph(font, selected[k], model, result.amounts, options, result.glyphs[k], origins[k]);
  });
  EditedGlyphs edited;
  std::map<int, SideGrowth> growth;
  WriteOptions writing{.is_checked = is_edit};
  for (std::size_t k = 0; k < selected.size(); ++k) {
    if (!result.glyphs[k].changed) continue;
    edited.emplace(selected[k], std::move(outlines[k]));
    growth.emplace(selected[k], result.glyphs[k].sides);
    if (!origins[k].empty()) writing.origins.emplace(selected[k], std::move(origins[k]));
  }
  result.spacing = space(font, std::move(edited), options.advance, growth, options.only);
  writing.advances = result.spacing.advances;
  writing.component_shifts = result.spacing.component_shifts;
  writing.anchors = result.spacing.anchors;
  result.font = write_font(font, result.spacing.outlines, writing);
  std::vector<int> drawn_otherwise;
  for (const auto& [id, contours] : result.spacing.outlines) drawn_otherwise.push_back(id);
  result.layout = layout_use(font, dependents(font, drawn_otherwise));
  result.spacing.outlines.clear();
  for (ReweightedGlyph& report : result.glyphs) {
    if (const auto advance = result.spacing.advances.find(report.glyph); advance != result.spacing.advances.end())
      report.advance_after = advance->second;
    add_written(result.font, report);
  }
  return result;
}

namespace {

std::vector<int> ids_of(const auto& by_glyph) {
  std::vector<int> ids;
  for (const auto& [id, value] : by_glyph) ids.push_back(id);
  return ids;
}

}  // namespace

std::string reweight_json(const Font& font, const ReweightOptions& options, const ReweightResult& result) {
  const auto names = [&](const std::vector<int>& ids) { return glyph_names(font, ids); };
  const Spacing& spacing = result.spacing;
  Json amounts = {{"x", result.amounts.x}, {"y", result.amounts.y}};
  if (result.amounts.thin) amounts["thin"] = *result.amounts.thin;
  if (result.amounts.serif) amounts["serif"] = *result.amounts.serif;
  // What was written has been read again, and every advance compared with the one wanted.
  Json advances = {{"policy", name_of(options.advance)},
                   {"glyphs", font.glyphs.size()},
                   {"changed", spacing.advances.size()},
                   {"equal", font.glyphs.size() - spacing.advances.size()}};
  if (options.advance == AdvancePolicy::Scale) advances["ratio"] = spacing.ratio;
  if (!spacing.kept_composites.empty()) advances["kept_composites"] = names(spacing.kept_composites);
  Json json = {{"version", 1},
               {"unitsPerEm", font.units_per_em},
               {"amounts", amounts},
               {"changed", result.changed()},
               {"refused", result.refused()},
               {"advances", advances},
               {"changed_tables", result.font.changed_tables},
               {"dropped_tables", result.font.dropped_tables},
               {"moved_composites", names(result.font.moved_composites)},
               {"moved_components", names(ids_of(spacing.component_shifts))},
               {"moved_anchors", names(ids_of(spacing.anchors))},
               {"kept_anchors", names(result.layout.anchored)},
               {"kerning_pairs", result.layout.kerning_pairs},
               {"dropped_instructions", names(result.font.dropped_instructions)},
               {"dropped_hints", names(result.font.dropped_hints)},
               {"warnings", result.font.warnings},
               {"glyphs", Json::array()}};
  for (const ReweightedGlyph& report : result.glyphs) {
    Json glyph = {{"name", report.name},
                  {"glyph", report.glyph},
                  {"changed", report.changed},
                  {"amount", report.share},
                  {"area_before", report.area_before},
                  {"area_after", report.area_after},
                  {"advance_before", report.advance_before},
                  {"advance_after", report.advance_after},
                  {"crossings_before", report.crossings_before},
                  {"crossings_after", report.crossings_after},
                  {"segments_before", report.segments_before},
                  {"segments_after", report.segments_after},
                  {"held_segments", report.held_segments},
                  {"dropped", report.dropped}};
    if (!report.notes.empty()) glyph["notes"] = report.notes;
    if (!report.refused.empty()) glyph["refused"] = report.refused;
    json["glyphs"].push_back(std::move(glyph));
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace glyphs
