#include "tools/commands.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "glyphs/area_audit.h"
#include "glyphs/area_baseline.h"
#include "glyphs/area_check.h"
#include "glyphs/convert.h"
#include "glyphs/detail_library.h"
#include "glyphs/error.h"
#include "glyphs/family.h"
#include "glyphs/font_file.h"
#include "glyphs/inspect.h"
#include "glyphs/json_reader.h"
#include "glyphs/proof.h"
#include "glyphs/recipe.h"
#include "glyphs/restyle.h"
#include "glyphs/reweight.h"
#include "glyphs/safe_file.h"
#include "glyphs/simplify.h"
#include "glyphs/ufo.h"
#include "glyphs/weight_proof.h"

namespace commands {

namespace {

using fontcore::text;
using glyphs::Font;
using glyphs::RequestError;

std::string join(const std::vector<std::string>& parts, const char* separator) {
  std::string all;
  for (const std::string& part : parts) all += (all.empty() ? "" : separator) + part;
  return all;
}

/// The first few of a list of names, and how many more there are.
std::string few(const std::vector<std::string>& names, std::size_t shown = 8) {
  std::vector<std::string> first(names.begin(),
                                 names.begin() + static_cast<std::ptrdiff_t>(std::min(shown, names.size())));
  return names.empty() ? "none"
                       : join(first, ", ") + (names.size() > shown ? text(" and ", names.size() - shown, " more") : "");
}

/// A number with a few digits, as a person reads it.
std::string rounded(double value, int digits = 6) {
  char buffer[32];
  const auto end = std::to_chars(std::begin(buffer), std::end(buffer), value, std::chars_format::general, digits).ptr;
  return {std::begin(buffer), end};
}

/// The shortest text that reads back to the same number.
std::string exact(double value) {
  char buffer[400];
  const auto end = std::to_chars(std::begin(buffer), std::end(buffer), value, std::chars_format::fixed).ptr;
  return {std::begin(buffer), end};
}

/// Adds the file's name to a complaint about what was asked of the font.
template <typename Work>
auto naming(const std::string& file, const Work& work) {
  try {
    return work();
  } catch (const RequestError& error) {
    const std::string what = error.what();
    throw RequestError(what.find(file) == std::string::npos ? file + ": " + what : what);
  }
}

glyphs::LoadOptions load_options(const Request& request) {
  glyphs::LoadOptions options{.face = request.face};
  if (!request.location.empty()) options.location = glyphs::parse_location(request.location);
  return options;
}

/// The font that is meant.
Font load(const Request& request) { return glyphs::load_font(request.font, load_options(request)); }

bool has_selection(const Request& request) { return request.text || !request.glyphs.empty(); }

std::vector<int> selected(const Request& request, const Font& font) {
  return naming(font.path, [&] {
    if (!request.text) return glyphs::select_glyphs(font, join(request.glyphs, ","));
    if (!request.glyphs.empty()) throw RequestError("--glyphs and --text cannot both select");
    return glyphs::glyphs_of_text(font, *request.text, request.shaping);
  });
}

std::string count(std::size_t number, const char* of_what) {
  return text(number, " ", of_what, number == 1 ? "" : "s");
}

/// The value that a word stands for, or a refusal that names the words there are.
template <typename Value>
Value chosen(const std::string& option, const std::string& word,
             const std::vector<std::pair<std::string, Value>>& words) {
  std::vector<std::string> known;
  for (const auto& [name, value] : words) {
    if (name == word) return value;
    known.push_back(name);
  }
  throw RequestError(text(option, " ", word, ": one of ", join(known, ", "), " is expected"));
}

/// Refuses outputs that would overwrite each other or what is read.
void check_outputs(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
  const auto is_same = [](const std::string& a, const std::string& b) {
    std::error_code error;
    return a == b || std::filesystem::equivalent(a, b, error) ||
           std::filesystem::weakly_canonical(a, error) == std::filesystem::weakly_canonical(b, error);
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (outputs[i].empty()) continue;
    for (std::size_t k = 0; k < i; ++k)
      if (!outputs[k].empty() && is_same(outputs[k], outputs[i]))
        throw RequestError(outputs[i] + ": two outputs with one name");
    for (const std::string& input : inputs)
      if (!input.empty() && is_same(input, outputs[i]))
        throw RequestError(outputs[i] + ": would overwrite what is read");
  }
}

}  // namespace

Outcome inspect(const Request& request) {
  const Font font = load(request);
  const auto facts = glyphs::inspect(font, selected(request, font), request.jobs);
  if (request.json) return {glyphs::facts_json(font, facts), "", 0};

  constexpr std::array<const char*, 5> formats{"TrueType", "CFF", "CFF2", "no", "UFO"};
  std::string out =
      text(request.font, ": ", font.family, " ", font.style, ", ", formats[static_cast<std::size_t>(font.format)],
           " outlines, ", font.units_per_em, " units per em, ", count(font.glyphs.size(), "glyph"), "\n");
  for (const glyphs::GlyphFacts& glyph : facts) {
    out += text(glyph.name, " (gid:", glyph.glyph, "): ");
    if (!glyph.trouble.empty()) {
      out += glyph.trouble + "\n";
      continue;
    }
    const auto left_out = static_cast<std::size_t>(glyph.left_out);
    out += text(count(glyph.contours.size() + left_out, "contour"), ", area ", exact(glyph.area), "\n");
    for (std::size_t i = 0; i < glyph.contours.size(); ++i) {
      const glyphs::ContourFacts& contour = glyph.contours[i];
      out += text("  contour ", i, ": ", count(static_cast<std::size_t>(contour.points), "point"), ", ",
                  count(static_cast<std::size_t>(contour.segments), "segment"), ", area ", exact(contour.area),
                  ", length ", rounded(contour.length), "; ");
      if (contour.no_model.empty())
        out += text(count(static_cast<std::size_t>(contour.corners), "corner"), ", ", contour.control_points,
                    " control points, ", count(static_cast<std::size_t>(contour.levels), "level"), ", distance ",
                    rounded(contour.distance, 3), "\n");
      else
        out += "no model: " + contour.no_model + "\n";
    }
    if (left_out > 0) out += text("  ", count(left_out, "more contour"), ": left out, beyond the budget for one job\n");
  }
  return {std::move(out), "", 0};
}

Outcome check(const Request& request) {
  const Font font = load(request);
  const std::vector<glyphs::GlyphCrossings> found =
      glyphs::check_crossings(font, selected(request, font), request.jobs);
  std::array<std::size_t, 3> findings{};  // by `Meeting`
  std::size_t faulty = 0;
  std::string lines;
  for (const glyphs::GlyphCrossings& glyph : found) {
    if (!glyph.crossings.empty() || !glyph.trouble.empty()) ++faulty;
    if (!glyph.trouble.empty()) lines += glyph.name + ": " + glyph.trouble + "\n";
    for (const fontcore::Crossing& crossing : glyph.crossings) {
      ++findings[static_cast<std::size_t>(crossing.meeting)];
      lines += glyphs::describe(glyph, crossing) + "\n";
    }
  }
  const auto& [crossings, contacts, overlaps] = findings;
  std::string summary = count(crossings, "crossing");
  if (contacts > 0) summary += ", " + count(contacts, "contact");
  if (overlaps > 0) summary += ", " + count(overlaps, "overlap");
  Outcome outcome;
  outcome.status = faulty > 0 ? 1 : 0;
  outcome.text = request.json ? glyphs::report_json(glyphs::crossings_report(font, found))
                              : lines + text(request.font, ": ", summary, " in ", faulty, " of ",
                                             count(found.size(), "glyph"), "\n");
  return outcome;
}

namespace {

/// Fonts at the places of a design space that are asked for, each with its glyphs' areas.
glyphs::AreaBaseline measured(const Request& request, glyphs::AreaMetrics metrics,
                              const std::vector<std::string>& locations, std::vector<Font>* fonts = nullptr) {
  glyphs::AreaBaseline baseline;
  baseline.metrics = metrics;
  baseline.is_selection = has_selection(request);
  if (!locations.empty()) baseline.locations = locations;
  for (const std::string& location : baseline.locations) {
    Request there = request;
    there.location = location;
    Font font = load(there);
    baseline.units_per_em = font.units_per_em;
    std::vector<glyphs::GlyphArea> areas =
        glyphs::measure_areas(font, selected(request, font), metrics, location, request.jobs);
    if (baseline.glyphs.empty())
      baseline.glyphs = std::move(areas);
    else
      std::move(areas.begin(), areas.end(), std::back_inserter(baseline.glyphs));
    if (fonts != nullptr) fonts->push_back(std::move(font));
  }
  if (baseline.locations.size() > 1)
    std::stable_sort(baseline.glyphs.begin(), baseline.glyphs.end(),
                     [](const auto& a, const auto& b) { return a.name < b.name; });
  return baseline;
}

void refuse_repeats(const std::vector<std::string>& locations) {
  for (std::size_t i = 0; i < locations.size(); ++i)
    if (std::find(locations.begin(), locations.begin() + static_cast<std::ptrdiff_t>(i), locations[i]) !=
        locations.begin() + static_cast<std::ptrdiff_t>(i))
      throw RequestError("--location " + locations[i] + ": given twice");
}

/// The report as it was asked for: to files, all or none, and to standard output.
Outcome reported(const Request& request, const glyphs::Report& report, const ReportRequest& wanted,
                 const std::string& json) {
  const glyphs::Status level = glyphs::status_of(wanted.error_code_on);
  std::vector<glyphs::PendingFile> files;
  const auto add = [&](const std::string& path, const std::string& page) {
    if (!path.empty()) files.push_back({path, {page.begin(), page.end()}});
  };
  add(wanted.html, wanted.html.empty() ? "" : glyphs::report_html(report));
  add(wanted.junit, wanted.junit.empty() ? "" : glyphs::report_junit(report));
  add(wanted.markdown, wanted.markdown.empty() ? "" : glyphs::report_markdown(report));
  glyphs::write_files(files);
  Outcome outcome;
  outcome.status = report.worst() >= level && report.worst() > glyphs::Status::Pass ? 1 : 0;
  if (request.json)
    outcome.text = json;
  else if (!request.quiet || outcome.status != 0)
    outcome.text = glyphs::report_text(report);
  return outcome;
}

}  // namespace

Outcome measure_area(const Request& request, const MeasureAreaRequest& measure) {
  using glyphs::AreaMetrics;
  check_outputs({request.font}, {measure.output});
  refuse_repeats(measure.locations);
  const AreaMetrics metrics =
      chosen<AreaMetrics>("--metrics", measure.metrics, {{"area", AreaMetrics::Area}, {"all", AreaMetrics::All}});
  glyphs::AreaBaseline baseline = measured(request, metrics, measure.locations);
  // Tolerances are written by hand: a baseline measured anew keeps them.
  if (!measure.output.empty() && std::filesystem::is_regular_file(measure.output))
    baseline.tolerances = glyphs::load_tolerances(measure.output);
  const std::string json = !measure.output.empty() || request.json ? glyphs::baseline_json(baseline) : "";
  if (!measure.output.empty()) glyphs::write_file(measure.output, json);
  if (request.json) return {json, "", 0};
  if (!measure.output.empty())
    return {request.quiet ? "" : text(measure.output, ": areas of ", count(baseline.glyphs.size(), "glyph"), "\n"), "",
            0};
  std::string out;
  for (const glyphs::GlyphArea& glyph : baseline.glyphs) {
    out += glyph.name + (glyph.location.empty() ? "" : " at " + glyph.location) + " ";
    if (!glyph.trouble.empty()) {
      out += glyph.trouble + "\n";
      continue;
    }
    out += exact(glyph.area);
    if (glyph.ink)
      out += text(" ink ", rounded(*glyph.ink, 10), " advance ", rounded(glyph.advance), " length ",
                  rounded(glyph.length));
    out += "\n";
  }
  return {std::move(out), "", 0};
}

Outcome check_area(const Request& request, const CheckAreaRequest& check) {
  const ReportRequest& report = check.report;
  check_outputs({request.font, check.baseline, check.against}, {report.html, report.junit, report.markdown});
  glyphs::status_of(report.error_code_on);  // refused before anything is read
  for (const auto& [option, value] :
       {std::pair("--tolerance-percent", check.tolerance_percent),
        std::pair("--tolerance-units", check.tolerance_units), std::pair("--tolerance-move", check.tolerance_move),
        std::pair("--tolerance-curve", check.tolerance_curve)})
    if (!(value >= 0.0) || !std::isfinite(value))
      throw RequestError(text(option, " ", value, ": not negative is expected"));
  const glyphs::AreaBaseline before = glyphs::load_baseline(check.baseline);
  const std::vector<std::string> locations =
      before.locations == std::vector<std::string>{""} ? std::vector<std::string>{} : before.locations;
  std::vector<Font> fonts;
  const glyphs::AreaBaseline now = naming(request.font, [&] {
    return measured(request, before.metrics, locations, report.html.empty() ? nullptr : &fonts);
  });
  glyphs::AreaComparison comparison = glyphs::compare_areas(before, now, request.font,
                                                            {.percent = check.tolerance_percent,
                                                             .units = check.tolerance_units,
                                                             .move = check.tolerance_move,
                                                             .curve = check.tolerance_curve,
                                                             .area_only = check.area_only,
                                                             .rescale = check.rescale});
  comparison.report.notes.push_back(
      "Compared with " + check.baseline +
      (before.metrics == glyphs::AreaMetrics::Area
           ? ", which has areas and moments alone; --metrics all measures ink and detail too."
           : "."));
  for (std::size_t i = 0; i < fonts.size(); ++i) {
    std::optional<Font> old;
    if (!check.against.empty()) {
      glyphs::LoadOptions options;
      if (!now.locations[i].empty()) options.location = glyphs::parse_location(now.locations[i]);
      old = glyphs::load_font(check.against, options);
    }
    for (glyphs::Picture& picture : glyphs::draw_drifts(comparison, now.locations[i], fonts[i], old ? &*old : nullptr))
      comparison.report.pictures.push_back(std::move(picture));
  }
  if (!comparison.report.pictures.empty() && check.against.empty())
    comparison.report.notes.push_back(
        "Pictures show the glyphs as they are now: a baseline holds no outlines. --against FONT shows those before "
        "too.");
  return reported(request, comparison.report, report, request.json ? glyphs::report_json(comparison.report) : "");
}

Outcome audit_area(const Request& request, const AuditAreaRequest& audit) {
  check_outputs(audit.fonts, {audit.report.html, audit.report.junit, audit.report.markdown});
  glyphs::status_of(audit.report.error_code_on);
  refuse_repeats(audit.locations);
  glyphs::Frequencies frequencies = glyphs::english_frequencies();
  if (!audit.frequencies.empty()) frequencies = glyphs::load_frequencies(audit.frequencies);
  std::vector<glyphs::FontColour> fonts;
  for (const std::string& path : audit.fonts) {
    Request one = request;
    one.font = path;
    const glyphs::AreaBaseline areas = measured(one, glyphs::AreaMetrics::All, audit.locations);
    for (const std::string& location : areas.locations)
      fonts.push_back(glyphs::colour_of(areas, path, location, frequencies));
  }
  const glyphs::Report report = glyphs::audit_colour(fonts);
  return reported(request, report, audit.report, request.json ? glyphs::audit_json(report, fonts) : "");
}

namespace {

/// What was rebuilt and dropped, and what there is to know about it.
std::string what_changed(const Font& font, const glyphs::WrittenFont& written) {
  const auto listed = [](const std::vector<std::string>& tags) { return tags.empty() ? "none" : join(tags, " "); };
  std::string out = font.format == glyphs::OutlineFormat::Ufo
                        ? text("files changed: ", few(written.changed_tables), "\n")
                        : text("tables rebuilt: ", listed(written.changed_tables),
                               "; dropped: ", listed(written.dropped_tables), "\n");
  for (const std::string& warning : written.warnings) out += "warning: " + warning + "\n";
  return out;
}

/// Glyphs that lost what was made for points that are no longer.
std::string what_was_dropped(const glyphs::WrittenFont& written) {
  std::string out;
  if (!written.dropped_instructions.empty())
    out += text("instructions dropped from ", count(written.dropped_instructions.size(), "glyph"), "\n");
  if (!written.dropped_hints.empty())
    out += text("hints dropped from ", count(written.dropped_hints.size(), "glyph"), "\n");
  return out;
}

/// Selected glyphs that stay as they were though something was asked of them, and why.
/// What --strict does with refusals.
Outcome nothing_written(const Request& request, const std::vector<std::string>& refused) {
  return {"", text(request.font, ": ", count(refused.size(), "glyph"), " refused, nothing written: ", few(refused)), 1};
}

template <typename Change>
std::vector<int> changed_glyphs(const glyphs::GlyphChanges<Change>& changes) {
  std::vector<int> changed;
  for (const Change& glyph : changes.glyphs)
    if (glyph.changed) changed.push_back(glyph.glyph);
  return changed;
}

/// The font as a reader of the output will see it.
Font read_again(const std::string& output, const glyphs::WrittenFont& written) {
  return written.folder ? glyphs::load_ufo(output, *written.folder) : glyphs::load_font_bytes(output, written.data);
}

/// What the outlines of a font take now, and how much of it was added.
std::string what_was_added(const glyphs::OutlineSize& size) {
  const auto compared = [](std::int64_t after, std::int64_t before) {
    return text(after, " for ", before, " (", after < before ? "" : "+", after - before, ")");
  };
  return text("points in all: ", compared(size.points_after, size.points_before),
              "; bytes of outlines: ", compared(size.bytes_after, size.bytes_before));
}

/// What changed, in some ten lines.
std::string summary(const Request& request, const RestyleRequest& restyle, const Font& font,
                    const glyphs::RestyleResult& result) {
  std::vector<std::string> reduced;
  std::vector<std::string> held_back;
  const glyphs::GlyphReport* widest = nullptr;
  const glyphs::GlyphReport* worst = nullptr;
  int segments = 0;
  int kept = 0;
  const auto area_error = [](const glyphs::GlyphReport& glyph) {
    return std::abs(glyph.area_after - glyph.area_target) / std::max(1.0, std::abs(glyph.area_target));
  };
  for (const glyphs::GlyphReport& glyph : result.glyphs) {
    if (std::any_of(glyph.steps.begin(), glyph.steps.end(), [](const auto& step) { return !step.against.empty(); }))
      held_back.push_back(glyph.name);
    if (!glyph.changed) continue;
    if (glyph.amount < 1.0) reduced.push_back(glyph.name + " to " + rounded(100.0 * glyph.amount, 3) + " %");
    if (widest == nullptr || glyph.largest_displacement > widest->largest_displacement) widest = &glyph;
    if (worst == nullptr || area_error(glyph) > area_error(*worst)) worst = &glyph;
    segments += glyph.segments_after;
    kept += glyph.segments_kept;
  }
  std::string out = text(request.font, ": ", result.changed(), " of ", count(result.glyphs.size(), "selected glyph"),
                         " changed by ", restyle.recipe, "\n");
  if (!reduced.empty()) out += "reduced so that nothing crosses: " + few(reduced) + "\n";
  if (!held_back.empty()) out += "rules stood against the move of: " + few(held_back) + "\n";
  if (result.refused() > 0) out += "refused, left as they were: " + few(refusals(font, {}, result)) + "\n";
  if (widest != nullptr) {
    out += text("largest displacement: ", rounded(widest->largest_displacement, 4), " of ", font.units_per_em,
                " units per em, in ", widest->name, "\n");
    out += text("worst area error after rounding: ", rounded(100.0 * area_error(*worst), 2), " %, in ", worst->name,
                " (", exact(worst->area_target), " wished, ", exact(worst->area_after), " got)\n");
    out += text("segments kept bit for bit: ", kept, " of ", segments, "\n");
    out += what_was_added(result.size) + "\n";
  }
  out += what_changed(font, result.font);
  if (!result.spacing.advances.empty())
    out += text("advances changed: ", result.spacing.advances.size(), " of ", font.glyphs.size(), "\n");
  if (!result.font.dropped_instructions.empty() || !result.font.moved_composites.empty())
    out += text("instructions dropped from ", count(result.font.dropped_instructions.size(), "glyph"),
                "; box moved of ", count(result.font.moved_composites.size(), "composite"), "\n");
  if (!result.font.dropped_hints.empty())
    out += text("hints dropped from ", count(result.font.dropped_hints.size(), "glyph"), "\n");
  if (!result.font.decomposed.empty())
    out += text("composites decomposed: ", few(glyphs::glyph_names(font, result.font.decomposed)), "\n");
  std::vector<std::string> written{restyle.output};
  for (const std::string& path : {restyle.report, restyle.proof})
    if (!path.empty()) written.push_back(path);
  return out + "written: " + join(written, ", ") + "\n";
}

}  // namespace

namespace {

/// A font through a recipe, however it came to be; `restyle.recipe` is the name of the file that says what is done.
template <typename MakeRecipe>
Outcome restyle_by(const Request& request, const RestyleRequest& restyle, const MakeRecipe& make_recipe) {
  glyphs::file_kind(restyle.output);  // a wrong ending is refused before anything is read
  check_outputs({}, {restyle.output, restyle.report, restyle.proof});
  check_outputs({request.font, restyle.recipe}, {restyle.report, restyle.proof});
  check_outputs({restyle.recipe}, {restyle.output});
  const auto proof_format = restyle.proof.empty() ? glyphs::ProofFormat::Png : glyphs::proof_format(restyle.proof);

  const glyphs::Recipe recipe = make_recipe();
  const Font font = load(request);
  glyphs::require_kind(font, restyle.output);

  glyphs::RestyleOptions options;
  options.jobs = request.jobs;
  if (has_selection(request)) options.only = selected(request, font);
  glyphs::RestyleResult result = naming(request.font, [&] { return glyphs::restyle(font, recipe, options); });

  if (restyle.strict && (result.refused() > 0 || !result.font.emptied.empty()))
    return nothing_written(request, refusals(font, result.font, result));

  const bool has_report = request.json || !restyle.report.empty();
  const std::string report = has_report ? glyphs::report_json(font, result) : std::string();
  std::vector<glyphs::PendingFile> files;
  if (!restyle.report.empty()) files.push_back({restyle.report, {report.begin(), report.end()}});
  if (!restyle.proof.empty()) {
    std::vector<int> changed = changed_glyphs(result);
    // With nothing changed the proof shows what was looked at.
    if (changed.empty())
      for (const glyphs::GlyphReport& glyph : result.glyphs) changed.push_back(glyph.glyph);
    const Font after = read_again(restyle.output, result.font);
    files.push_back({restyle.proof, glyphs::draw_glyph_proof(after, font, changed, proof_format)});
  }
  files.push_back({restyle.output, std::move(result.font.data), std::move(result.font.folder)});
  glyphs::write_files(files);
  if (request.json) return {report, "", 0};
  return {request.quiet ? "" : summary(request, restyle, font, result), "", 0};
}

}  // namespace

Outcome restyle(const Request& request, const RestyleRequest& restyle) {
  return restyle_by(request, restyle, [&] { return glyphs::load_recipe(restyle.recipe); });
}

Outcome apply_character(const Request& request, const ApplyRequest& apply, const RestyleRequest& restyle) {
  return restyle_by(request, restyle, [&] {
    if (!std::isfinite(apply.gain)) throw RequestError(text("--gain ", apply.gain, ": a number is expected"));
    if (!(apply.tolerance > 0.0) || !std::isfinite(apply.tolerance))
      throw RequestError(text("--tolerance ", apply.tolerance, ": a distance is expected"));
    glyphs::Recipe recipe;
    recipe.steps.emplace_back(glyphs::CharacterStep{.library_path = apply.library,
                                                    .library = glyphs::load_library(apply.library),
                                                    .gain = apply.gain,
                                                    .adds = apply.adds,
                                                    .mirrors = apply.mirrors,
                                                    .spares_lines = apply.spares_straights,
                                                    .holds_joins = apply.holds_joins});
    recipe.tolerance = apply.tolerance;
    recipe.seed = apply.seed;
    if (apply.points) recipe.most_points = *apply.points;
    return recipe;
  });
}

Outcome repeat_character(const Request& request, const RepeatRequest& repeat, const RestyleRequest& restyle) {
  return restyle_by(request, restyle, [&] {
    glyphs::RepeatStep step{.library_path = repeat.library,
                            .edit = glyphs::load_edit(repeat.library),
                            .within = repeat.within,
                            .mirrors = repeat.mirrors,
                            .turns = repeat.turns};
    if (!(repeat.within > 0.0) || !std::isfinite(repeat.within))
      throw RequestError(text("--within ", repeat.within, ": thousandths of the em are expected"));
    if (!repeat.sizes.empty()) {
      step.smallest = repeat.sizes[0];
      step.largest = repeat.sizes[1];
      if (!(step.smallest > 0.0) || !(step.largest >= step.smallest) || !std::isfinite(step.largest))
        throw RequestError(text("--sizes ", step.smallest, " ", step.largest, ": smallest and largest are expected"));
    }
    glyphs::Recipe recipe;
    recipe.steps.emplace_back(std::move(step));
    // The edit says itself what moves; what it was made of is the designer's.
    recipe.keep.area = glyphs::KeepArea::None;
    recipe.keep.lines = recipe.keep.extrema = recipe.keep.zones_auto = false;
    return recipe;
  });
}

namespace {

fontcore::Point place_from(const std::string& option, const std::string& text_of_it) {
  const char* const end = text_of_it.data() + text_of_it.size();
  fontcore::Point place;
  const auto x = std::from_chars(text_of_it.data(), end, place.x());
  const bool has_comma = x.ec == std::errc() && x.ptr != end && *x.ptr == ',';
  const auto y = has_comma ? std::from_chars(x.ptr + 1, end, place.y()) : x;
  if (!has_comma || y.ec != std::errc() || y.ptr != end || !place.allFinite())
    throw RequestError(option + " " + text_of_it + ": a place x,y is expected");
  return place;
}

}  // namespace

namespace {

Outcome written(const Request& request, const std::string& path, const std::string& summary) {
  if (request.json) return {nlohmann::json{{"version", 1}, {"written", {path}}}.dump() + "\n", "", 0};
  return {request.quiet ? "" : path + ": " + summary + "\n", "", 0};
}

/// The one glyph that --glyph names, or the request's selection.
std::vector<int> selected_for(const Request& request, const ExtractRequest& extract, const Font& font) {
  Request chosen_glyphs = request;
  if (!extract.glyph.empty()) {
    if (request.text || !request.glyphs.empty()) throw RequestError("--glyph goes without --glyphs and --text");
    chosen_glyphs.glyphs = {extract.glyph};
  }
  return selected(chosen_glyphs, font);
}

}  // namespace

Outcome extract_character(const Request& request, const ExtractRequest& extract) {
  const int sources =
      (extract.procedural.empty() ? 0 : 1) + (extract.drawing.empty() ? 0 : 1) + (extract.like.empty() ? 0 : 1);
  if (sources > 1) throw RequestError("--procedural, --drawing and --like: one source at a time");
  const bool has_font = !request.font.empty();
  if (has_font ? !extract.procedural.empty() || !extract.like.empty() : sources == 0) {
    throw RequestError(has_font ? "--procedural and --like go without FONT" : "FONT is required");
  }
  check_outputs({request.font, extract.drawing}, {extract.output});
  check_outputs(extract.like, {extract.output});
  if (extract.from.empty() != extract.to.empty()) throw RequestError("--from and --to go together");
  const bool is_edit = !extract.like.empty() && !extract.from.empty();
  const bool needs_scale = extract.procedural.empty() && !is_edit;
  if (needs_scale && (!(extract.scale > 0.0) || !std::isfinite(extract.scale)))
    throw RequestError(text("--scale ", extract.scale, ": a length in font units is expected"));
  if (!needs_scale && extract.scale != 0.0) throw RequestError("--scale: this source has none to choose");
  glyphs::ExtractOptions options{.scale = extract.scale, .contour = extract.contour};
  using fontcore::DetailFrame;
  options.frame = chosen<DetailFrame>(
      "--frame", extract.frame,
      {{"tangent", DetailFrame::Tangent}, {"scaled tangent", DetailFrame::ScaledTangent}, {"xy", DetailFrame::Fixed}});
  if (!extract.from.empty()) options.stretch = {place_from("--from", extract.from), place_from("--to", extract.to)};
  const auto named = [&](const std::string& otherwise) {
    return !extract.name.empty() ? extract.name : !extract.glyph.empty() ? extract.glyph : otherwise;
  };

  fontcore::DetailLibrary library;
  if (!extract.procedural.empty()) {
    library = glyphs::procedural_library(extract.procedural, extract.name);
  } else if (!extract.drawing.empty()) {
    if (!(extract.unit > 0.0) || !std::isfinite(extract.unit))
      throw RequestError(text("--unit ", extract.unit, ": a length in font units is expected"));
    options.name = named(std::filesystem::path(extract.drawing).stem().string());
    const double units_per_em = has_font ? load(request).units_per_em : 1000.0;
    library = glyphs::drawn_library(extract.drawing, extract.unit, units_per_em, options);
  } else if (!extract.like.empty()) {
    Request other = request;
    other.font = extract.like[0];
    const Font plain = load(other);
    other.font = extract.like[1];
    const Font textured = load(other);
    options.name = named(textured.family);
    const std::vector<int> ids = selected_for(request, extract, plain);
    if (is_edit) {
      if (ids.size() != 1) throw RequestError(text("--from and --to: a stretch of one glyph, not of ", ids.size()));
      const fontcore::PlacedDetail edit = glyphs::learn_edit(plain, textured, ids[0], options);
      glyphs::write_file(extract.output, glyphs::edit_json(edit, options.name));
      const double unit = plain.units_per_em;
      std::string summary = text("an edit of ", rounded(unit * edit.along[edit.along.size() - 1]), " units with ",
                                 count(edit.corners.size(), "corner"), ", which moves up to ",
                                 rounded(unit * edit.displacement.rowwise().norm().maxCoeff()));
      if (edit.faded > 1e-4) {
        summary += text("; moves of up to ", rounded(unit * edit.faded), " near its ends are left out: take it longer");
      }
      return written(request, extract.output, summary);
    }
    library = naming(extract.like[0], [&] { return glyphs::learn_library(plain, textured, ids, options); });
  } else {
    const Font font = load(request);
    options.name = named(font.family);
    library = naming(request.font,
                     [&] { return glyphs::extract_library(font, selected_for(request, extract, font), options); });
  }
  glyphs::write_file(extract.output, glyphs::library_json(library));
  double length = 0.0;
  for (const fontcore::DetailSample& sample : library.samples) length += sample.length;
  return written(request, extract.output,
                 text(count(library.samples.size(), "sample"), " of \"", library.name, "\", ", rounded(length),
                      " units of outline, detail below ", rounded(library.scale), " of ", rounded(library.units_per_em),
                      " units per em"));
}

namespace {

/// One font of a family in a line, and its warnings.
std::string family_line(const glyphs::FamilyFont& font) {
  const std::vector<glyphs::GlyphReport>& reports = font.result.glyphs;
  std::size_t reduced = 0;
  std::size_t held_back = 0;
  const glyphs::GlyphReport* widest = nullptr;
  for (const glyphs::GlyphReport& glyph : reports) {
    if (std::ranges::any_of(glyph.steps, [](const auto& step) { return !step.against.empty(); })) ++held_back;
    if (!glyph.changed) continue;
    if (glyph.amount < 1.0) ++reduced;
    if (widest == nullptr || glyph.largest_displacement > widest->largest_displacement) widest = &glyph;
  }
  std::string out =
      text(font.font, ": ", font.result.changed(), " of ", count(reports.size(), "selected glyph"), " changed");
  if (widest != nullptr) {
    out += text(", by at most ", rounded(widest->largest_displacement, 4), " of ", font.units_per_em,
                " units per em, in ", widest->name);
  }
  if (reduced > 0) out += text("; ", reduced, " reduced so that nothing crosses");
  if (held_back > 0) out += text("; rules stood against the move of ", held_back);
  if (!font.refusals.empty())
    out += text("; ", font.refusals.size(), " refused, left as they were: ", few(font.refusals, 2));
  for (const std::string& warning : font.result.font.warnings) out += "\n  warning: " + warning;
  return out + "\n";
}

std::string family_summary(const FamilyRequest& request, const glyphs::FamilyResult& family) {
  std::string out;
  int changed = 0;
  std::size_t selected = 0;
  std::size_t refused = 0;
  glyphs::OutlineSize size;
  for (const glyphs::FamilyFont& font : family.fonts) {
    out += family_line(font);
    changed += font.result.changed();
    selected += font.result.glyphs.size();
    refused += font.refusals.size();
    size += font.result.size;
  }
  out += text(count(family.fonts.size(), "font"), ": ", changed, " of ", count(selected, "selected glyph"),
              " changed by ", request.recipe, ", ", refused, " refused; ", what_was_added(size), "\n");
  std::vector<std::string> written;
  for (const glyphs::FamilyFont& font : family.fonts) written.push_back(font.name);
  out += text("written: in ", request.output_dir, ": ", few(written));
  for (const std::string& path : {request.report, request.proof})
    if (!path.empty()) out += "; " + path;
  return out + "\n";
}

}  // namespace

Outcome restyle_family(const Request& request, const FamilyRequest& family) {
  check_outputs({}, {family.report, family.proof});
  std::vector<std::string> inputs = family.fonts;
  inputs.push_back(family.recipe);
  check_outputs(inputs, {family.report, family.proof});
  if (request.text && !request.glyphs.empty()) throw RequestError("--glyphs and --text cannot both select");

  glyphs::FamilyOptions options{.load = load_options(request), .jobs = request.jobs};
  if (has_selection(request)) options.only = [&](const Font& font) { return selected(request, font); };
  const glyphs::FamilyOutputs outputs{family.output_dir, family.report, family.proof, family.strict};
  const glyphs::FamilyResult result =
      glyphs::restyle_family_into(outputs, family.fonts, glyphs::load_recipe(family.recipe), options);

  if (!result.is_written) {
    std::size_t refused = 0;
    std::vector<std::string> lists;
    for (const glyphs::FamilyFont& font : result.fonts) {
      refused += font.refusals.size();
      if (!font.refusals.empty()) lists.push_back(font.font + ": " + few(font.refusals));
    }
    return {"", text(count(refused, "glyph"), " refused, nothing written: ", join(lists, "; ")), 1};
  }
  if (request.json) return {result.report, "", 0};
  return {request.quiet ? "" : family_summary(family, result), "", 0};
}

namespace {

std::string simplify_summary(const Request& request, const SimplifyRequest& simplify, const Font& font,
                             const glyphs::SimplifyResult& result) {
  const glyphs::SimplifiedGlyph* worst = nullptr;
  int before = 0;
  int after = 0;
  for (const glyphs::SimplifiedGlyph& glyph : result.glyphs) {
    before += glyph.segments_before;
    after += glyph.segments_after;
    if (glyph.changed && (worst == nullptr || glyph.deviation > worst->deviation)) worst = &glyph;
  }
  std::string out = text(request.font, ": ", result.changed(), " of ", count(result.glyphs.size(), "selected glyph"),
                         " simplified: ", after, " segments for ", before, "\n");
  if (result.refused() > 0) out += "left as they were: " + few(refusals(font, {}, result)) + "\n";
  if (worst != nullptr) {
    out += text("largest deviation: ", rounded(worst->deviation, 4), " of ", font.units_per_em, " units per em, in ",
                worst->name, ", contour ", worst->worst_contour, ", at ", rounded(worst->where.x()), ",",
                rounded(worst->where.y()), "\n");
  }
  out += what_changed(font, result.font) + what_was_dropped(result.font);
  std::vector<std::string> written{simplify.output};
  if (!simplify.report.empty()) written.push_back(simplify.report);
  return out + "written: " + join(written, ", ") + "\n";
}

}  // namespace

Outcome simplify(const Request& request, const SimplifyRequest& simplify) {
  using glyphs::SimplifiedCurve;
  const glyphs::FileKind kind = glyphs::file_kind(simplify.output);
  check_outputs({}, {simplify.output, simplify.report});
  check_outputs({request.font}, {simplify.report});
  glyphs::SimplifyOptions options;
  options.jobs = request.jobs;
  options.tolerance = simplify.tolerance;
  options.extrema = chosen<fontcore::Extrema>("--extrema", simplify.extrema,
                                              {{"keep", fontcore::Extrema::Keep}, {"free", fontcore::Extrema::Free}});
  options.curve = chosen<SimplifiedCurve>(
      "--curve", simplify.curve,
      {{"same", SimplifiedCurve::Same}, {"cubic", SimplifiedCurve::Cubic}, {"quadratic", SimplifiedCurve::Quadratic}});
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance))
    throw RequestError(text("--tolerance ", simplify.tolerance, ": a distance is expected"));
  const Font font = load(request);
  const glyphs::FileKind own = glyphs::simplified_kind(font, options.curve);
  if (own == glyphs::kind_of(font)) {
    glyphs::require_kind(font, simplify.output);
  } else if (kind != own) {
    throw RequestError(simplify.output + ": with cubics the font is an OpenType font, so the output's ending is .otf");
  }
  if (has_selection(request)) options.only = selected(request, font);
  glyphs::SimplifyResult result = naming(request.font, [&] { return glyphs::simplify(font, options); });

  if (simplify.strict && (result.refused() > 0 || !result.font.emptied.empty()))
    return nothing_written(request, refusals(font, result.font, result));
  const bool has_report = request.json || !simplify.report.empty();
  const std::string report = has_report ? glyphs::simplify_json(font, options, result) : std::string();
  std::vector<glyphs::PendingFile> files;
  if (!simplify.report.empty()) files.push_back({simplify.report, {report.begin(), report.end()}});
  files.push_back({simplify.output, std::move(result.font.data), std::move(result.font.folder)});
  glyphs::write_files(files);
  if (request.json) return {report, "", 0};
  return {request.quiet ? "" : simplify_summary(request, simplify, font, result), "", 0};
}

namespace {

// In what a person would look for in vain: letters that the model does not follow.
std::vector<std::string> learning_warnings(const fontcore::WeightModel& model) {
  using Control = fontcore::WeightModel::Control;
  constexpr double seen_in_strokes = 0.25;  // of the step: what a reader sees between strokes of one letter
  constexpr double seen_in_width = 1.0;     // of the step
  constexpr double no_step = 1.0;           // thousandths of the em
  std::vector<std::string> warnings;
  double step = 0.0;
  for (const auto& letters : model.letters)
    step = std::max({step, std::abs(letters.upright.growth), std::abs(letters.level.growth)});
  if (step < no_step) {
    return {"the letters are as heavy in one font as in the other: there is nothing to learn"};
  }
  for (const Control& control : model.controls) {
    if (!control.used) {
      warnings.push_back(control.name +
                         " is left out: its contours in the two fonts do not pair up; is it drawn in both?");
    } else if (control.thickness_error > seen_in_strokes * step) {
      warnings.push_back(control.name + " contradicts the others: its strokes grow otherwise, by " +
                         rounded(control.thickness_error, 2) + " of " + rounded(step, 2));
    } else if (std::abs(control.width_error) > seen_in_width * step) {
      warnings.push_back(control.name +
                         (control.width_error > 0.0 ? " would come out wider than it is drawn, by "
                                                    : " would come out narrower than it is drawn, by ") +
                         rounded(std::abs(control.width_error), 2));
    }
  }
  const auto& [small, large] = model.letters;
  if (small.upright.thickness == large.upright.thickness && small.level.thickness == large.level.thickness)
    warnings.emplace_back("the letters are all of the lower case, or all capitals: the others are taken to grow alike");
  return warnings;
}

std::string learn_summary(const fontcore::WeightModel& model) {
  std::string out = "in thousandths of the em\n";
  const auto stroke = [](const fontcore::WeightModel::Stroke& one) {
    return rounded(one.thickness, 3) + " to " + rounded(one.thickness + one.growth, 3);
  };
  for (const auto& [name, letters] :
       {std::pair("lower case", model.letters[0]), std::pair("capitals", model.letters[1])}) {
    out += text(name, ": stems from ", stroke(letters.upright), ", bars from ", stroke(letters.level), "\n");
  }
  for (const fontcore::WeightModel::Control& control : model.controls) {
    if (!control.used) continue;
    out += text("control letter ", control.name, ": strokes off by ", rounded(control.thickness_error, 2), ", ",
                rounded(std::abs(control.width_error), 2), control.width_error < 0.0 ? " narrower" : " wider",
                " than drawn\n");
  }
  for (const std::string& warning : learning_warnings(model)) out += "warning: " + warning + "\n";
  return out;
}

}  // namespace

Outcome learn_weight(const Request& request, const LearnWeightRequest& learn) {
  const bool has_file = !learn.prior.empty() && learn.prior != "none";
  check_outputs({request.font, learn.bold, has_file ? learn.prior : ""}, {learn.output});
  if (request.text || !request.glyphs.empty()) throw RequestError("weight learn: --control says which letters");
  const Font regular = load(request);
  const Font bold = glyphs::load_font(learn.bold);
  fontcore::WeightModel model = glyphs::learn_weight(regular, bold, learn.controls);
  if (has_file) {
    const glyphs::Bytes bytes = glyphs::read_file(learn.prior);
    take_prior(model, glyphs::parse_prior({bytes.begin(), bytes.end()}, learn.prior));
  } else if (learn.prior.empty()) {
    take_prior(model, glyphs::latin_prior());
  }
  const std::string json = glyphs::weight_json(model);
  glyphs::write_files({{learn.output, {json.begin(), json.end()}}});
  if (request.json) return {json, "", 0};
  if (request.quiet) return {};
  return {learn_summary(model) + "written: " + learn.output + "\n", "", 0};
}

namespace {

// What every glyph takes of the step.
std::string amounts_text(const fontcore::WeightAmounts& amounts) {
  std::string out = amounts.x == amounts.y ? rounded(amounts.x, 3)
                                           : rounded(amounts.x, 3) + " across, " + rounded(amounts.y, 3) + " upwards";
  if (amounts.thin) out += ", thin strokes " + rounded(*amounts.thin, 3);
  if (amounts.serif) out += ", serifs " + rounded(*amounts.serif, 3);
  return out;
}

std::string errors_text(const Font& made, const std::string& drawn,
                        const std::vector<glyphs::ComparedGlyph>& compared) {
  if (compared.empty()) return "none of them is drawn in " + drawn + "\n";
  double sum = 0.0;
  double area = 0.0;
  std::vector<std::string> worst;
  for (const glyphs::ComparedGlyph& one : compared) {
    sum += one.error.difference;
    area += std::abs(one.error.area);
    constexpr std::size_t most = 5;
    if (worst.size() < most)
      worst.push_back(made.glyphs[static_cast<std::size_t>(one.glyph)].name + " " +
                      rounded(100.0 * one.error.difference, 3) + " %");
  }
  const auto number = static_cast<double>(compared.size());
  return text("against ", drawn, ": ", count(compared.size(), "glyph"), " differ by ", rounded(100.0 * sum / number, 3),
              " % of their ink in the mean, in area by ", rounded(100.0 * area / number, 3),
              " %; worst: ", join(worst, ", "), "\n");
}

std::string advances_text(const Font& font, const glyphs::ReweightOptions& options, const glyphs::Spacing& spacing) {
  const std::size_t changed = spacing.advances.size();
  if (changed == 0) return text("advances: all ", font.glyphs.size(), " as they were\n");
  std::string out =
      text("advances by ", name_of(options.advance), ": ", changed, " of ", font.glyphs.size(), " changed");
  if (options.advance == glyphs::AdvancePolicy::Scale) out += ", times " + rounded(spacing.ratio, 4);
  out += "\n";
  if (!spacing.component_shifts.empty())
    out += text("components moved in ", count(spacing.component_shifts.size(), "composite"), "\n");
  if (!spacing.kept_composites.empty())
    out += "advances kept, since parts are placed by points: " + few(glyph_names(font, spacing.kept_composites)) + "\n";
  return out;
}

std::string apply_summary(const Request& request, const ApplyWeightRequest& apply, const Font& font,
                          const glyphs::ReweightOptions& options, const glyphs::ReweightResult& result,
                          const std::string& errors) {
  std::vector<std::string> reduced;
  int segments_before = 0;
  int segments_after = 0;
  for (const glyphs::ReweightedGlyph& glyph : result.glyphs) {
    if (glyph.changed && glyph.share < 1.0) reduced.push_back(glyph.name + " (" + rounded(glyph.share, 3) + ")");
    segments_before += glyph.segments_before;
    segments_after += glyph.segments_after;
  }
  std::string out = text(request.font, ": ", result.changed(), " of ", count(result.glyphs.size(), "selected glyph"),
                         " in another weight: ", amounts_text(result.amounts), " of the step",
                         !apply.fit_to.empty() ? " that n and o of " + apply.fit_to + " show"
                         : apply.carries       ? " in proportion to its own letters"
                                               : "",
                         "\n");
  if (options.emission == glyphs::Emission::Compact)
    out += text("segments: ", segments_after, " for ", segments_before, "\n");
  out += advances_text(font, options, result.spacing);
  if (!result.layout.anchored.empty()) {
    out += text("anchors of GPOS kept where they were, though the outline is another: ",
                few(glyph_names(font, result.layout.anchored)), "\n");
  }
  if (result.layout.kerning_pairs > 0)
    out += text("kerning kept: ", result.layout.kerning_pairs, " pairs have a glyph that is drawn otherwise\n");
  if (result.refused() > 0) out += "left as they were: " + few(refusals(font, {}, result)) + "\n";
  if (!reduced.empty()) out += "by a smaller share than was asked: " + few(reduced) + "\n";
  out += what_changed(font, result.font) + what_was_dropped(result.font);
  out += errors;
  for (const std::string& path : {apply.report, apply.proof, apply.output}) {
    if (!path.empty()) out += "written: " + path + "\n";
  }
  return out;
}

}  // namespace

Outcome apply_weight(const Request& request, const ApplyWeightRequest& apply) {
  glyphs::file_kind(apply.output);  // a wrong ending is refused before anything is read
  check_outputs({apply.model, apply.fit_to, apply.against}, {apply.output, apply.report, apply.proof});
  check_outputs({request.font}, {apply.report, apply.proof});
  if (!apply.proof.empty()) glyphs::proof_format(apply.proof);
  glyphs::ReweightOptions options{.strength = apply.strength,
                                  .advance = glyphs::advance_policy(apply.advance),
                                  .emission = chosen<glyphs::Emission>("--emit", apply.emission,
                                                                       {{"structure", glyphs::Emission::Structure},
                                                                        {"compact", glyphs::Emission::Compact}}),
                                  .tolerance = apply.tolerance,
                                  .italic_angle = apply.italic_angle,
                                  .detail_scale = apply.detail_scale,
                                  .only = {},
                                  .jobs = request.jobs};
  if (!(options.tolerance > 0.0) || !std::isfinite(options.tolerance))
    throw RequestError(text("--tolerance ", apply.tolerance, ": a distance above 0 is expected"));
  if (!(options.detail_scale >= 0.0) || !std::isfinite(options.detail_scale))
    throw RequestError(text("--detail ", apply.detail_scale, ": a size of 0 or more is expected"));
  fontcore::WeightModel model = glyphs::parse_weight(glyphs::read_text(apply.model), apply.model);
  const Font font = load(request);
  glyphs::require_kind(font, apply.output);
  if (request.text || !request.glyphs.empty()) options.only = selected(request, font);
  if (!apply.fit_to.empty()) {
    const Font drawn = glyphs::load_font(apply.fit_to);
    model = carry_weight(font, model, &drawn);
  } else if (apply.carries) {
    model = carry_weight(font, model);
  }
  glyphs::ReweightResult result = naming(request.font, [&] { return glyphs::reweight(font, model, options); });
  if (apply.strict && (result.refused() > 0 || !result.font.emptied.empty()))
    return nothing_written(request, refusals(font, result.font, result));
  const bool has_report = request.json || !apply.report.empty();
  const std::string report = has_report ? glyphs::reweight_json(font, options, result) : std::string();
  std::vector<glyphs::PendingFile> files;
  std::string errors;
  if (!apply.proof.empty() || !apply.against.empty()) {
    const std::vector<int> changed = changed_glyphs(result);
    const Font made = read_again(apply.output, result.font);
    glyphs::Bytes picture;
    if (apply.against.empty()) {
      if (changed.empty()) throw RequestError("--proof: no glyph has changed");
      picture = glyphs::draw_glyph_proof(made, font, changed, glyphs::proof_format(apply.proof));
    } else {
      const Font drawn = glyphs::load_font(apply.against);
      const std::vector<glyphs::ComparedGlyph> compared = compare_weights(made, drawn, changed);
      errors = errors_text(made, apply.against, compared);
      if (!apply.proof.empty())
        picture = draw_weight_proof(font, made, drawn, compared, glyphs::proof_format(apply.proof));
    }
    if (!apply.proof.empty()) files.push_back({apply.proof, std::move(picture)});
  }
  if (!apply.report.empty()) files.push_back({apply.report, {report.begin(), report.end()}});
  files.push_back({apply.output, std::move(result.font.data), std::move(result.font.folder)});
  glyphs::write_files(files);
  if (request.json) return {report, "", 0};
  return {request.quiet ? "" : apply_summary(request, apply, font, options, result, errors), "", 0};
}

Outcome convert(const Request& request, const ConvertRequest& convert) {
  using glyphs::FileKind;
  const FileKind kind = glyphs::file_kind(convert.output);
  const Font font = load(request);
  glyphs::ConvertOptions options{.jobs = request.jobs};
  if (convert.fractional) options.fractions = glyphs::Fractions::Keep;
  options.tolerance = convert.tolerance.value_or(convert.fractional ? 0.0 : options.tolerance);
  if (kind == FileKind::Svg)
    options.glyphs = selected(request, font);
  else if (has_selection(request))
    throw RequestError(convert.output + ": every glyph is converted; --glyphs and --text choose that of an SVG");
  glyphs::ConvertedFont converted = glyphs::convert_font(font, kind, options);
  if (convert.strict && !converted.emptied.empty()) {
    return {"",
            text(request.font, ": ", count(converted.emptied.size(), "glyph"),
                 " cannot be read, nothing written: ", few(glyphs::glyph_names(font, converted.emptied))),
            1};
  }
  glyphs::write_files({{convert.output, std::move(converted.font.data), std::move(converted.font.folder)}});

  const bool has_deviation = converted.worst >= 0;
  const std::string worst = has_deviation ? font.glyphs[static_cast<std::size_t>(converted.worst)].name : std::string();
  const double deviation = has_deviation ? converted.deviation[static_cast<std::size_t>(converted.worst)] : 0.0;
  if (request.json) {
    nlohmann::ordered_json json{
        {"version", 1},
        {"written", {convert.output}},
        {"glyphs", font.glyphs.size()},
        {"deviation", deviation},
        {"worst", has_deviation ? nlohmann::ordered_json(worst) : nullptr},
        {"segments_before", converted.segments_before},
        {"segments_after", converted.segments_after},
        {"flattened", glyphs::glyph_names(font, converted.flattened)},
        {"emptied", glyphs::glyph_names(font, converted.emptied)},
        {"changed_tables", converted.font.changed_tables},
        {"dropped_tables", converted.font.dropped_tables},
        {"dropped_instructions", glyphs::glyph_names(font, converted.font.dropped_instructions)},
        {"dropped_hints", glyphs::glyph_names(font, converted.font.dropped_hints)},
        {"warnings", converted.font.warnings}};
    return {json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n", "", 0};
  }
  if (request.quiet) return {};
  std::string out;
  if (has_deviation)
    out += text("largest deviation: ", rounded(deviation, 3), " of ", font.units_per_em, " units per em, in ", worst,
                "; segments: ", converted.segments_before, " before, ", converted.segments_after, " after\n");
  if (!converted.flattened.empty())
    out += "composites flattened: " + few(glyphs::glyph_names(font, converted.flattened)) + "\n";
  if (!converted.font.dropped_instructions.empty())
    out += text("instructions dropped from ", count(converted.font.dropped_instructions.size(), "glyph"), "\n");
  if (kind != FileKind::Ufo && kind != FileKind::Svg)
    out += what_changed(font, converted.font);
  else
    for (const std::string& warning : converted.font.warnings) out += "warning: " + warning + "\n";
  return {out + "written: " + convert.output + "\n", "", 0};
}

namespace {

// The LENGTH of level=LENGTH, or of comb=LENGTH.
double length_in(const std::string& show, const char* what) {
  const std::string digits = show.substr(show.find('=') + 1);
  double length = 0.0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), length);
  if (status != std::errc() || end != digits.data() + digits.size() || !(length >= 0.0) || !std::isfinite(length)) {
    throw RequestError("--show " + show + ": " + what);
  }
  return length;
}

glyphs::ProofOptions options_of(const Request& request, const ProofRequest& proof) {
  glyphs::ProofOptions options;
  options.shaping = request.shaping;
  for (const std::string& show : proof.show) {
    if (show == "nodes") {
      options.nodes = true;
    } else if (show == "crossings") {
      options.crossings = true;
    } else if (show == "comb") {
      options.comb = 0.0;
    } else if (show.starts_with("comb=")) {
      options.comb =
          length_in(show, "a comb is measured by the length of its teeth, in ems, where the radius is an em");
    } else if (show.starts_with("level=")) {
      options.levels.push_back(length_in(show, "a level is named by a length in font units"));
    } else {
      throw RequestError("--show " + show + ": it is none of nodes, crossings, comb, comb=LENGTH, level=LENGTH");
    }
  }
  if (proof.sizes.size() == 1) options.pixels_per_em = proof.sizes[0];
  if (proof.sizes.size() > 1) options.waterfall = proof.sizes;
  if (request.text && !request.glyphs.empty()) throw RequestError("--glyphs and --text cannot both select");
  if (!request.text && !options.waterfall.empty()) throw RequestError("--sizes: several are for --text");
  return options;
}

// A font and the one before it, at one place.
struct Compared {
  std::string place;
  Font font;
  std::optional<Font> against;
};

std::vector<Compared> load_compared(const Request& request, const ProofRequest& proof) {
  std::vector<Compared> loaded;
  for (const std::string& place : proof.locations.empty() ? std::vector<std::string>{""} : proof.locations) {
    Request there = request;
    there.location = place;
    Compared& compared = loaded.emplace_back(Compared{place, load(there), std::nullopt});
    if (proof.against.empty()) continue;
    // A font that does not vary is the same everywhere.
    compared.against = glyphs::load_font(proof.against);
    if (compared.against->is_variable && !place.empty()) {
      there.font = proof.against;
      there.face = 0;
      compared.against = load(there);
    }
  }
  return loaded;
}

}  // namespace

Outcome proof(const Request& request, const ProofRequest& proof) {
  const glyphs::ProofFormat format = glyphs::proof_format(proof.output);
  check_outputs({request.font, proof.against}, {proof.output});
  const glyphs::ProofOptions options = options_of(request, proof);

  const std::vector<Compared> loaded = load_compared(request, proof);
  const glyphs::Bytes picture = naming(request.font, [&] {
    if (request.text) {
      std::vector<glyphs::ProofedFont> fonts;
      for (const auto& [place, font, against] : loaded) fonts.push_back({font, against ? &*against : nullptr, place});
      return glyphs::draw_proof(fonts, *request.text, format, options);
    }
    glyphs::GlyphProof sheet(options);
    for (const auto& [place, font, against] : loaded)
      sheet.add(font, against ? &*against : nullptr, selected(request, font), place);
    return sheet.draw(format);
  });
  glyphs::write_file(proof.output, picture);
  if (request.json) return {nlohmann::json{{"version", 1}, {"written", {proof.output}}}.dump() + "\n", "", 0};
  return {request.quiet ? "" : "written: " + proof.output + "\n", "", 0};
}

}  // namespace commands
