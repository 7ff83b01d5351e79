#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/glyph_editor.h"
#include "glyphs/restyle.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::text;
using Contours = std::vector<BezierContour>;

constexpr double bisection_width = 0.01;       // of the amount
constexpr double first_left_out = 1.0 / 16.0;  // of a library's scale: features below go first if points must be saved
constexpr double worth_a_note = 5e-4;          // area error after rounding, relative

int kept_segments(const Contours& before, const Contours& after) {
  int kept = 0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (fontcore::has_same_structure(before[k], after[k])) {
      kept += equal_segments(before[k], after[k]);
      continue;
    }
    std::vector<Bezier> old;
    for (int s = 0; s < before[k].segment_count(); ++s) old.push_back(before[k].segment(s));
    for (int s = 0; s < after[k].segment_count(); ++s) {
      const Bezier now = after[k].segment(s);
      kept += std::any_of(old.begin(), old.end(),
                          [&](const Bezier& was) { return was.degree == now.degree && was.p == now.p; })
                  ? 1
                  : 0;
    }
  }
  return kept;
}

// Of the points; of contours with other points, the distance of the outlines.
double largest_displacement(const Contours& before, const Contours& after, double step) {
  double largest = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (!fontcore::has_same_structure(before[k], after[k])) {
      largest =
          std::max(largest, fontcore::two_sided_distance(to_polyline(before[k], step), to_polyline(after[k], step)));
      continue;
    }
    largest = std::max(largest, (after[k].points() - before[k].points()).rowwise().norm().maxCoeff());
  }
  return largest;
}

double emission_deviation(const Contours& solved, const Contours& emitted) {
  double deviation = 0.0;
  constexpr double accuracy = 0.005;  // font units
  for (std::size_t k = 0; k < solved.size(); ++k) {
    deviation = std::max(deviation, fontcore::has_same_structure(solved[k], emitted[k])
                                        ? fontcore::two_sided_distance(solved[k], emitted[k])
                                        : farthest(solved[k], emitted[k], accuracy).distance);
  }
  return deviation;
}

// How much of what was asked the handles got, summed over the steps.
double progress(const Attempt& attempt) {
  double sum = 0.0;
  for (const StepReport& step : attempt.steps) {
    for (const auto& [handle, asked, got] : step.handles) {
      if (asked != Point::Zero()) sum += got.dot(asked) / asked.squaredNorm();
    }
  }
  return sum;
}

// Counters that an edit closed, and contours that it turned round.
void compare_ink(const Contours& before, const std::vector<fontcore::Crossing>& crossings_before, const Contours& after,
                 const std::vector<fontcore::Crossing>& crossings_after, GlyphReport& report) {
  try {
    const auto closed = closed_counters(measure_ink(before, crossings_before), measure_ink(after, crossings_after));
    report.closed_counters = static_cast<int>(closed.size());
    for (const fontcore::Box& counter : closed) {
      report.notes.push_back(text("a counter is closed: the one from (", counter.low.x(), ", ", counter.low.y(),
                                  ") to (", counter.high.x(), ", ", counter.high.y(), ")"));
    }
    report.changed_windings = changed_windings(before, crossings_before, after, crossings_after);
    for (const int contour : report.changed_windings) {
      report.notes.push_back(text("contour ", contour, ": runs the other way round now, or lies in another"));
    }
  } catch (const fontcore::WorkLimitExceeded&) {
    report.notes.emplace_back("counters are not compared: the contours lie on themselves too often");
  }
}

// The whole edit; where detail of libraries needs more points than the glyph may have, without its finest features.
Attempt within_budget(GlyphEditor& editor, const Recipe& recipe, GlyphReport& report) {
  Attempt attempt = editor.attempt(1.0);
  const std::int64_t wanted = stored_points(attempt.rounded);
  std::int64_t points = wanted;
  for (double finest = first_left_out; points > recipe.most_points && editor.has_detail();
       finest *= std::numbers::sqrt2) {
    if (finest > 1.0) {
      throw Refusal{text("it would have ", points, " points without any detail, more than ", recipe.most_points)};
    }
    editor.leave_out_below(finest);
    attempt = editor.attempt(1.0);
    points = stored_points(attempt.rounded);
  }
  if (points < wanted) {
    const auto step = std::ranges::find(attempt.steps, "character", &StepReport::op);
    report.notes.push_back(text("features of the library below ", step->finest,
                                " units are left out: with them it has ", wanted, " points, without ", points,
                                "; it may have ", recipe.most_points));
  }
  return attempt;
}

// Where detail of libraries adds crossings, it is left out around them. Returns how many are left.
int quieted(GlyphEditor& editor, const std::vector<fontcore::Crossing>& before, int more, Attempt& best,
            std::vector<fontcore::Crossing>& after, GlyphReport& report) {
  constexpr int rounds = 4;
  int places = 0;
  const auto is_old = [&](const fontcore::Crossing& crossing) {
    return std::ranges::any_of(before, [&](const auto& old) { return (old.where - crossing.where).norm() < 1.0; });
  };
  for (int round = 0; round < rounds && more > 0; ++round) {
    for (const fontcore::Crossing& crossing : after) {
      if (is_old(crossing)) continue;
      editor.keep_quiet(crossing.where);
      ++places;
    }
    Attempt tried = editor.attempt(1.0);
    auto crossings = find_crossings(tried.rounded);
    more = added_crossings(before, crossings);
    best = std::move(tried);
    after = std::move(crossings);
  }
  if (more == 0) report.notes.push_back(text("detail is left out around ", places, " places: there it would cross"));
  return more;
}

// The edit that comes nearest to the wish without adding a crossing: the largest safe amount, found by bisection; or,
// where only forcing the handles would cross and it gets further, the whole amount with the handles as wishes.
template <typename Added>
Attempt reduced(GlyphEditor& editor, Attempt best, const Added& added, GlyphReport& report) {
  for (StepReport& step : best.steps) {
    for (HandleReport& handle : step.handles) handle.got = Point::Zero();
    step.corners = 0;
    step.least_radius = 0.0;
  }
  report.amount = 0.0;
  for (double unsafe = 1.0; unsafe - report.amount > bisection_width;) {
    const double amount = 0.5 * (report.amount + unsafe);
    Attempt tried = editor.attempt(amount);
    if (added(tried) > 0) {
      unsafe = amount;
    } else {
      report.amount = amount;
      best = std::move(tried);
    }
  }
  Attempt wished = editor.attempt(1.0, fontcore::HandleMove::Wished);
  if (progress(wished) > progress(best) && added(wished) == 0) {
    report.amount = 1.0;
    for (StepReport& step : wished.steps) step.against = {"a crossing, if the handle were forced"};
    report.notes.emplace_back("the handle is not forced: that would add a crossing");
    return wished;
  }
  for (StepReport& step : best.steps) step.against.emplace_back("a crossing: the amount is reduced");
  report.notes.push_back(text("reduced to ", report.amount, " of the move: more would add a crossing"));
  return best;
}

// A composite that the recipe decomposes, as the simple glyph it would be.
std::optional<Glyph> without_components(const Font& font, const Glyph& glyph, const Recipe& recipe) {
  if (!glyph.is_composite() || recipe.composites == Composites::Refuse) return std::nullopt;
  Glyph result = glyph;
  result.components.clear();
  try {
    result.contours = decompose(font, glyph.id);
  } catch (const FontReadError& error) {
    result.trouble = error.what();
  }
  return result;
}

std::string list_of(const Font& font, const std::vector<int>& glyphs) {
  std::string list;
  for (const int id : glyphs) list += (list.empty() ? "" : ", ") + font.glyphs[static_cast<std::size_t>(id)].name;
  return list;
}

// The names of a composite's parts, each once, the first few of them.
std::string parts_of(const Font& font, const Glyph& glyph) {
  constexpr std::size_t shown = 8;
  std::vector<int> parts;
  for (const Component& part : glyph.components) {
    if (std::find(parts.begin(), parts.end(), part.glyph) != parts.end()) continue;
    if (parts.size() == shown) return list_of(font, parts) + " and more";
    parts.push_back(part.glyph);
  }
  return list_of(font, parts);
}

}  // namespace

bool lays_detail(const Recipe& recipe) {
  return std::ranges::any_of(recipe.steps,
                             [](const Step& step) { return std::holds_alternative<CharacterStep>(step); });
}

std::int64_t work_of_point(const Recipe& recipe) {
  constexpr std::int64_t with_detail = 16;
  return lays_detail(recipe) ? with_detail : 1;
}

GlyphResult restyle_glyph(const Font& font, int id, const Recipe& given, const std::vector<double>& zones,
                          const std::vector<Point>& quiet) {
  const std::optional<Glyph> decomposed = without_components(font, font.glyphs.at(static_cast<std::size_t>(id)), given);
  const Glyph& glyph = decomposed ? *decomposed : font.glyphs.at(static_cast<std::size_t>(id));
  const Recipe recipe = with_amounts(font, given);
  GlyphResult result{glyph.contours, glyph.contours, {}, {}, 0};
  GlyphReport& report = result.report;
  report.glyph = id;
  report.name = glyph.name;
  report.segments_before = report.segments_after = report.segments_kept = segment_count(glyph.contours);
  report.size.points_before = report.size.points_after =
      stored_points(font.glyphs[static_cast<std::size_t>(id)].contours);
  report.area_before = report.area_target = report.area_unrounded = report.area_after = signed_area(glyph.contours);
  try {
    if (!glyph.trouble.empty()) throw Refusal{glyph.trouble};
    // In a UFO a composite may have contours of its own, which are edited beside its components.
    if (glyph.is_composite() && glyph.contours.empty())
      throw Refusal{"it is a composite; edit its parts: " + parts_of(font, glyph)};
    GlyphEditor editor(font, glyph, recipe, zones, result.work);
    for (const Point& place : quiet) editor.keep_quiet(place);
    if (!editor.has_work() || glyph.contours.empty()) return result;

    const auto before = find_crossings(glyph.contours);
    report.crossings_before = report.crossings_after = static_cast<int>(before.size());
    const auto crossings = [&](const Attempt& attempt) {
      return attempt.rounded == glyph.contours ? before : find_crossings(attempt.rounded);
    };
    const auto added = [&](const Attempt& attempt) { return added_crossings(before, crossings(attempt)); };
    Attempt best = within_budget(editor, recipe, report);
    auto after = crossings(best);
    int more = added_crossings(before, after);
    if (recipe.on_crossing == OnCrossing::Reduce && more > 0 && editor.has_detail()) {
      more = quieted(editor, before, more, best, after, report);
    }
    if (recipe.on_crossing != OnCrossing::Allow && more > 0) {
      if (recipe.on_crossing == OnCrossing::Refuse) throw Refusal{text("crossings that the edit adds: ", more)};
      if (editor.has_pin()) throw Refusal{text("crossings that the pinned move adds: ", more)};
      best = reduced(editor, Attempt{glyph.contours, glyph.contours, best.steps, report.area_before, {}, {}}, added,
                     report);
      after = crossings(best);
    }
    const bool has_new_points = !has_same_structure(best.rounded, glyph.contours);
    if (const int user = has_new_points ? matched_in(font, id) : -1; user >= 0) {
      throw Refusal{text("its points would be other ones, and ", font.glyphs[static_cast<std::size_t>(user)].name,
                         " matches its parts by point numbers")};
    }
    report.area_target = best.area;
    report.crossings_after = static_cast<int>(after.size());
    if (best.rounded != glyph.contours) compare_ink(glyph.contours, before, best.rounded, after, report);
    result.contours = std::move(best.rounded);
    result.unrounded = std::move(best.unrounded);
    result.came_from = std::move(best.came_from);
    report.steps = std::move(best.steps);
    std::ranges::move(best.notes, std::back_inserter(report.notes));
    report.changed = result.contours != glyph.contours;
    if (decomposed && report.changed) {
      report.notes.push_back("decomposed: it is a simple glyph now, of the outlines that its parts had: " +
                             parts_of(font, font.glyphs[static_cast<std::size_t>(id)]));
    }
  } catch (const Refusal& refusal) {
    report.refused = refusal.reason;
  } catch (
      const fontcore::Error& error) {  // what fails for one glyph leaves that glyph as it was, and the others go on
    report.refused = error.what();
  }
  if (!report.refused.empty()) {
    report.amount = 0.0;
    return result;
  }
  report.area_unrounded = signed_area(result.unrounded);
  report.area_after = signed_area(result.contours);
  if (recipe.keep.area == KeepArea::None) report.area_target = report.area_unrounded;
  report.largest_displacement = largest_displacement(glyph.contours, result.contours, 1e-3 * font.units_per_em);
  report.segments_after = segment_count(result.contours);
  if (report.changed) report.size.points_after = stored_points(result.contours);
  report.segments_kept = kept_segments(glyph.contours, result.contours);
  report.deviation = emission_deviation(result.unrounded, result.contours);
  if (const double taken = std::abs(report.area_before) - std::abs(report.area_target);
      recipe.keep.area != KeepArea::None && std::abs(taken) > 1e-9 * std::abs(report.area_before)) {
    const bool is_weighed = std::ranges::count(report.steps, "weight", &StepReport::op) > 0;
    const bool is_softened = std::ranges::count(report.steps, "soften", &StepReport::op) > 0;
    const char* what = !is_weighed ? "softening " : is_softened ? "weight and softening " : "weight ";
    report.notes.push_back(text(what, taken > 0.0 ? "takes " : "adds ", std::abs(taken), " square units, ",
                                100.0 * std::abs(taken / report.area_before), " % of the area"));
  }
  if (report.deviation > recipe.tolerance) {
    report.notes.push_back(
        text("rounding moved the outline by ", report.deviation, " units, over the tolerance of ", recipe.tolerance));
  }
  const double area_error = std::abs(report.area_after - report.area_target);
  if (area_error > worth_a_note * std::abs(report.area_target)) {
    report.notes.push_back(
        text("no whole-number outline near this one is nearer to the area than ", area_error, " square units"));
  }
  return result;
}

OutlineSize& OutlineSize::operator+=(const OutlineSize& other) {
  points_before += other.points_before;
  points_after += other.points_after;
  bytes_before += other.bytes_before;
  bytes_after += other.bytes_after;
  return *this;
}

}  // namespace glyphs
