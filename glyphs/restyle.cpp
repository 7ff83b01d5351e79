#include "glyphs/restyle.h"

#include <Eigen/LU>
#include <algorithm>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "fontcore/alignment.h"
#include "fontcore/crossing.h"
#include "glyphs/error.h"

namespace glyphs {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::text;
using Contours = std::vector<BezierContour>;

std::vector<double> alignment_zones(const Font& font) {
  std::vector<Contours> shapes;
  for (const auto& [first, last] : {std::pair{U'0', U'9'}, std::pair{U'A', U'Z'}, std::pair{U'a', U'z'}}) {
    for (char32_t character = first; character <= last; ++character) {
      const auto found = font.character_map.find(character);
      if (found == font.character_map.end()) continue;
      const Glyph& glyph = font.glyphs[static_cast<std::size_t>(found->second)];
      if (glyph.trouble.empty() && !glyph.contours.empty()) shapes.push_back(glyph.contours);
    }
  }
  return heights(fontcore::find_zones(shapes, font.units_per_em));
}

namespace {

// A step or a frozen stretch that names a glyph must find it, and its contour, among the selected ones: anything else
// is a slip of the recipe.
void check_named(const Font& font, const std::vector<int>& selected, const std::string& key,
                 const std::string& glyph_name, std::optional<int> contour) {
  if (glyph_name.empty()) return;
  const std::vector<int> named = select_glyphs(font, glyph_name);
  if (named.size() != 1) {
    throw RequestError(text(key, ".glyph: \"", glyph_name, "\" names ", named.size(), " glyphs, not one"));
  }
  if (!std::binary_search(selected.begin(), selected.end(), named[0])) {
    throw RequestError(text(key, ".glyph: \"", glyph_name, "\" is not among the recipe's glyphs"));
  }
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(named[0])];
  const int contours = static_cast<int>(glyph.contours.size());
  if (contour && !glyph.is_composite() && *contour >= contours) {
    throw RequestError(text(font.path, ": ", glyph.name, ": ", key, ".contour: there is no contour ", *contour,
                            ", it has ", contours));
  }
}

void check_recipe(const Font& font, const Recipe& recipe, const std::vector<int>& selected) {
  for (std::size_t k = 0; k < recipe.steps.size(); ++k) {
    std::visit([&](const auto& step) { check_named(font, selected, text("steps[", k, "]"), step.glyph, step.contour); },
               recipe.steps[k]);
  }
  for (std::size_t k = 0; k < recipe.keep.freeze.size(); ++k) {
    const Freeze& freeze = recipe.keep.freeze[k];
    check_named(font, selected, text("keep.freeze[", k, "]"), freeze.glyph, freeze.contour);
  }
}

}  // namespace

Recipe with_amounts(const Font& font, Recipe recipe) {
  const double unit = recipe.lengths_in_thousandths ? font.units_per_em / 1000.0 : 1.0;
  for (Step& step : recipe.steps) {
    auto* const weight = std::get_if<WeightStep>(&step);
    if (weight == nullptr || weight->amounts) continue;
    if (!weight->model) throw RequestError(weight->model_path + ": the model of a weight step is not loaded");
    if (weight->carries) {
      weight->model = std::make_shared<const fontcore::WeightModel>(carry_weight(font, *weight->model));
    }
    WeightStrength strength = weight->strength;
    if (strength.stems.upright) *strength.stems.upright *= unit;
    if (strength.stems.level) *strength.stems.level *= unit;
    weight->amounts = amounts_in(font, *weight->model, strength);
  }
  return recipe;
}

std::vector<int> glyphs_to_restyle(const Font& font, const Recipe& recipe, const RestyleOptions& options) {
  kind_of(font);  // what cannot be written is refused before it is worked on
  std::vector<int> selected = select_glyphs(font, recipe.glyphs);
  check_recipe(font, recipe, selected);
  if (!options.only) return selected;
  std::vector<int> both;
  std::ranges::set_intersection(selected, *options.only, std::back_inserter(both));
  return both;
}

namespace {

// Where the contours of a composite come from, in the order they are composed in: a glyph, and how it is placed. None
// for a composite whose parts are placed by points, which only composing it tells.
struct Origin {
  int glyph = 0;
  fontcore::Affine placement;
};
bool add_origins(const Font& font, int id, const fontcore::Affine& placement, std::vector<Origin>& origins) {
  const Glyph& glyph = font.glyphs[static_cast<std::size_t>(id)];
  origins.insert(origins.end(), glyph.contours.size(), {id, placement});
  return std::ranges::all_of(glyph.components, [&](const Component& part) {
    const fontcore::Affine placed{placement.linear * part.placement.linear, placement(part.placement.shift)};
    return part.matched_parent < 0 && add_origins(font, part.glyph, placed, origins);
  });
}

// Detail that makes the parts of a composite cross is left out of them there; what still crosses is warned of.
class CompositeCheck {
 public:
  CompositeCheck(const Font& font, const RestyleOptions& options) : font_(font), jobs_(options.jobs) {
    jobs_.progress = {};
  }

  // The places to leave out, by glyph, of those edited; and the composites that cross more often than before.
  struct Found {
    std::map<int, std::vector<Point>> places;
    std::vector<int> composites;
  };
  Found look(const std::vector<GlyphResult>& results) {
    Font edited = font_;
    std::vector<int> changed;
    for (const GlyphResult& result : results) {
      if (!result.report.changed) continue;
      const auto id = static_cast<std::size_t>(result.report.glyph);
      changed.push_back(result.report.glyph);
      edited.glyphs[id].contours = result.contours;
      edited.glyphs[id].components.clear();
    }
    std::vector<int> composites;
    for (const int id : dependents(font_, changed)) {
      const Glyph& glyph = edited.glyphs[static_cast<std::size_t>(id)];
      if (glyph.is_composite() && glyph.trouble.empty()) composites.push_back(id);
    }
    std::vector<std::vector<fontcore::Crossing>> added(composites.size());
    run_jobs(static_cast<int>(composites.size()), jobs_, [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      try {
        const auto before = find_crossings(compose(font_, composites[k]));
        auto after = find_crossings(compose(edited, composites[k]));
        if (added_crossings(before, after) == 0) return;
        std::erase_if(after, [&](const fontcore::Crossing& crossing) {
          return std::ranges::any_of(before,
                                     [&](const auto& old) { return (old.where - crossing.where).norm() < 1.0; });
        });
        added[k] = std::move(after);
      } catch (const fontcore::WorkLimitExceeded&) {
        return;  // it lies on itself too often to say
      }
    });
    Found found;
    for (std::size_t k = 0; k < composites.size(); ++k) {
      if (added[k].empty()) continue;
      found.composites.push_back(composites[k]);
      const double origin = font_.glyphs[static_cast<std::size_t>(composites[k])].origin;
      std::vector<Origin> origins;
      if (!add_origins(font_, composites[k], {}, origins)) continue;
      for (const fontcore::Crossing& crossing : added[k]) {
        for (const int contour : {crossing.a.contour, crossing.b.contour}) {
          const auto& [glyph, placement] = origins.at(static_cast<std::size_t>(contour));
          if (placement.linear.determinant() == 0.0 || !std::ranges::binary_search(changed, glyph)) continue;
          const Point where = crossing.where + Point(origin, 0.0) - placement.shift;
          found.places[glyph].push_back(placement.linear.inverse() * where);
        }
      }
    }
    return found;
  }

 private:
  const Font& font_;
  JobOptions jobs_;
};

// What a job may cost, as GlyphResult::work. Sound fonts take 1 to 3.6 tries of every point that they store.
std::int64_t most_work(const Font& font, const Recipe& recipe, const std::vector<int>& selected) {
  constexpr std::int64_t tries = 6;
  constexpr std::int64_t in_any_case = 1 << 15;
  return tries * work_of_point(recipe) * drawn_points(font, selected) + in_any_case;
}

// What becomes of advances: as the last weight step has it. None: no step weighs, and they stay.
std::optional<AdvancePolicy> advance_of(const Recipe& recipe) {
  std::optional<AdvancePolicy> advance;
  for (const Step& step : recipe.steps) {
    if (const auto* const weight = std::get_if<WeightStep>(&step)) advance = weight->advance;
  }
  return advance;
}

}  // namespace

RestyleResult restyle(const Font& font, const Recipe& given, const RestyleOptions& options) {
  const std::vector<int> selected = glyphs_to_restyle(font, given, options);
  if (!given.steps.empty()) refuse_at_fault(font);
  const Recipe recipe = with_amounts(font, given);
  const std::optional<AdvancePolicy> advance = advance_of(recipe);
  const std::optional<std::vector<int>> spaced_glyphs =
      recipe.glyphs.empty() && !options.only ? std::nullopt : std::optional(selected);
  if (advance) space(font, {}, *advance, {}, spaced_glyphs);  // what it refuses, before any work
  const bool finds_zones = recipe.keep.zones_auto && !recipe.steps.empty() && !selected.empty();
  const std::vector<double> zones = finds_zones ? alignment_zones(font) : std::vector<double>{};
  std::vector<GlyphResult> results(selected.size());
  const int count = static_cast<int>(selected.size());
  const std::int64_t budget = most_work(font, recipe, selected);
  const int within = run_jobs_within(
      budget, count, options.jobs,
      [&](int i) {
        const auto k = static_cast<std::size_t>(i);
        results[k] = restyle_glyph(font, selected[k], recipe, zones);
        results[k].unrounded.clear();  // a font has tens of thousands of glyphs
        if (!results[k].report.changed) results[k].contours.clear();
        results[k].unrounded.shrink_to_fit();
        results[k].contours.shrink_to_fit();
        return results[k].work;
      },
      1);
  const Recipe no_steps;
  for (int i = within; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    results[k] = restyle_glyph(font, selected[k], no_steps, {});
    if (!results[k].report.refused.empty() || font.glyphs[static_cast<std::size_t>(selected[k])].contours.empty()) {
      continue;
    }
    results[k].report.amount = 0.0;
    results[k].report.refused =
        text("the work of the job is spent: the glyphs before it took all of ", budget, " points");
  }

  std::vector<int> crossing_composites;
  if (lays_detail(recipe) && recipe.on_crossing != OnCrossing::Allow) {
    constexpr int rounds = 4;
    CompositeCheck check(font, options);
    std::map<int, std::vector<Point>> quiet;
    for (int round = 0; round < rounds; ++round) {
      auto found = check.look(results);
      crossing_composites = std::move(found.composites);
      if (found.places.empty() || round + 1 == rounds) break;
      std::vector<std::size_t> again;
      for (std::size_t k = 0; k < results.size(); ++k) {
        const auto places = found.places.find(results[k].report.glyph);
        if (places == found.places.end()) continue;
        again.push_back(k);
        std::ranges::copy(places->second, std::back_inserter(quiet[places->first]));
      }
      JobOptions jobs = options.jobs;
      jobs.progress = {};
      run_jobs(static_cast<int>(again.size()), jobs, [&](int i) {
        GlyphResult& result = results[again[static_cast<std::size_t>(i)]];
        const int id = result.report.glyph;
        result = restyle_glyph(font, id, recipe, zones, quiet.at(id));
        result.report.notes.push_back(
            text("detail is left out around ", quiet.at(id).size(), " places: there composites with it would cross"));
      });
    }
  }

  RestyleResult result;
  EditedGlyphs edited;
  WriteOptions writing{.composites = recipe.composites, .is_checked = !recipe.steps.empty()};
  for (GlyphResult& glyph : results) {
    const bool was_composite = font.glyphs[static_cast<std::size_t>(glyph.report.glyph)].is_composite();
    if (glyph.report.crossings_after > 0 && (glyph.report.crossings_before == 0 || was_composite)) {
      writing.overlapping.push_back(glyph.report.glyph);
    }
    if (!glyph.came_from.empty()) writing.origins.emplace(glyph.report.glyph, std::move(glyph.came_from));
    if (glyph.report.changed) edited.emplace(glyph.report.glyph, std::move(glyph.contours));
    result.glyphs.push_back(std::move(glyph.report));
  }
  if (advance) {
    std::map<int, SideGrowth> growth;
    for (const GlyphReport& report : result.glyphs) {
      for (const StepReport& step : report.steps) {
        growth[report.glyph].left += step.sides.left;
        growth[report.glyph].right += step.sides.right;
      }
    }
    result.spacing = space(font, std::move(edited), *advance, growth, spaced_glyphs);
    edited = std::exchange(result.spacing.outlines, {});
    writing.advances = result.spacing.advances;
    writing.component_shifts = result.spacing.component_shifts;
    writing.anchors = result.spacing.anchors;
  }
  result.font = write_font(font, edited, writing);
  for (const int id : crossing_composites) {
    result.font.warnings.push_back(text(font.glyphs[static_cast<std::size_t>(id)].name,
                                        ": its parts cross in more places than before, with detail on them"));
  }
  const std::vector<std::int64_t> bytes_before = glyph_bytes(font);
  const std::vector<std::int64_t> bytes_after = glyph_bytes(font, result.font);
  for (const Glyph& glyph : font.glyphs) {
    const auto id = static_cast<std::size_t>(glyph.id);
    const std::int64_t points = stored_points(glyph.contours);
    result.size.points_before += points;
    result.size.points_after += result.font.emptied.count(glyph.id) > 0 ? 0 : points;
    result.size.bytes_before += bytes_before[id];
    result.size.bytes_after += bytes_after[id];
  }
  for (GlyphReport& report : result.glyphs) {
    report.size.bytes_before = bytes_before[static_cast<std::size_t>(report.glyph)];
    report.size.bytes_after = bytes_after[static_cast<std::size_t>(report.glyph)];
    add_written(result.font, report);
    if (result.font.emptied.contains(report.glyph)) {
      report.amount = 0.0;
      report.size.points_after = 0;
    } else {
      result.size.points_after += report.size.points_after - report.size.points_before;
    }
  }
  return result;
}

std::string report_json(const Font& font, const RestyleResult& result) {
  using Json = nlohmann::ordered_json;
  const auto names = [&](const std::vector<int>& ids) { return glyph_names(font, ids); };
  const auto pair = [](const Point& p) { return Json::array({p.x(), p.y()}); };
  std::vector<int> emptied;
  for (const auto& [id, why] : result.font.emptied) emptied.push_back(id);
  const OutlineSize& size = result.size;
  Json head = {{"version", 1},
               {"unitsPerEm", font.units_per_em},
               {"changed", result.changed()},
               {"refused", result.refused()},
               {"points_before", size.points_before},
               {"points_after", size.points_after},
               {"bytes_before", size.bytes_before},
               {"bytes_after", size.bytes_after},
               {"changed_tables", result.font.changed_tables},
               {"dropped_tables", result.font.dropped_tables},
               {"advances_changed", result.spacing.advances.size()},
               {"moved_composites", names(result.font.moved_composites)},
               {"decomposed", names(result.font.decomposed)},
               {"emptied", names(emptied)},
               {"dropped_instructions", names(result.font.dropped_instructions)},
               {"dropped_hints", names(result.font.dropped_hints)},
               {"warnings", result.font.warnings}};
  std::string out = head.dump(2);
  out.erase(out.size() - 2);  // the closing brace: the glyphs follow, a line each
  out += ",\n  \"glyphs\": [";
  for (std::size_t k = 0; k < result.glyphs.size(); ++k) {
    const GlyphReport& report = result.glyphs[k];
    Json glyph = {{"name", report.name},
                  {"glyph", report.glyph},
                  {"changed", report.changed},
                  {"amount", report.amount},
                  {"area_before", report.area_before},
                  {"area_target", report.area_target},
                  {"area_unrounded", report.area_unrounded},
                  {"area_after", report.area_after},
                  {"largest_displacement", report.largest_displacement},
                  {"crossings_before", report.crossings_before},
                  {"crossings_after", report.crossings_after},
                  {"closed_counters", report.closed_counters},
                  {"changed_windings", report.changed_windings},
                  {"segments_before", report.segments_before},
                  {"segments_after", report.segments_after},
                  {"segments_kept", report.segments_kept},
                  {"points_before", report.size.points_before},
                  {"points_after", report.size.points_after},
                  {"bytes_before", report.size.bytes_before},
                  {"bytes_after", report.size.bytes_after},
                  {"deviation", report.deviation},
                  {"dropped", report.dropped}};
    if (!report.refused.empty()) glyph["refused"] = report.refused;
    if (!report.notes.empty()) glyph["notes"] = report.notes;
    Json steps = Json::array();
    for (const StepReport& step : report.steps) {
      Json one = {{"op", step.op}, {"contour", step.contour}};
      if (step.op == "sweep") {
        const auto put = [&](Json& to, const HandleReport& of) {
          to["handle"] = pair(of.handle);
          to["asked"] = pair(of.asked);
          to["got"] = pair(of.got);
        };
        put(one, step.handles.at(0));
        for (std::size_t more = 1; more < step.handles.size(); ++more)
          put(one["more"].emplace_back(), step.handles[more]);
        one["level"] = step.level;
      } else if (step.op == "smooth") {
        one["energy_before"] = step.energy_before;
        one["energy_after"] = step.energy_after;
      }
      if (step.op == "character") {
        one["arcs"] = step.arcs;
        one["too_short"] = step.too_short;
        one["base_move"] = step.base_move;
        one["finest"] = step.finest;
      } else if (step.op == "weight") {
        one.erase("contour");  // it is of the whole glyph
        one["amount"] = step.share;
        one["held_segments"] = step.held_segments;
      } else if (step.op == "repeat") {
        one["places"] = step.places;
        one["off_wish"] = step.off_wish;
      } else if (step.op == "soften") {
        one["corners"] = step.corners;
        one["least_radius"] = step.least_radius;
      } else {
        one["levels"] = step.levels;
        one["off_wish"] = step.off_wish;
      }
      one["against"] = step.against;
      steps.push_back(std::move(one));
    }
    glyph["steps"] = std::move(steps);
    out += (k == 0 ? "\n    " : ",\n    ") + glyph.dump();
  }
  return out + (result.glyphs.empty() ? "]\n}\n" : "\n  ]\n}\n");
}

}  // namespace glyphs
