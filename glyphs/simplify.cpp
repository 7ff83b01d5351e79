#include "glyphs/simplify.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "fontcore/crossing.h"
#include "fontcore/measure.h"
#include "glyphs/convert.h"
#include "glyphs/error.h"
#include "glyphs/shared_fits.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::CompactFit;
using fontcore::CompactOptions;
using fontcore::CurveKind;
using fontcore::PointKind;
using fontcore::text;
using Contours = std::vector<BezierContour>;

bool becomes_cff(const Font& font, SimplifiedCurve curve) {
  return curve == SimplifiedCurve::Cubic && font.format == OutlineFormat::TrueType;
}

/// What the outline is drawn from, in the glyph's own place.
Contours outline_of(const Font& font, int id, bool is_flat) {
  return is_flat ? compose(font, id) : font.glyphs[static_cast<std::size_t>(id)].contours;
}

CurveKind curve_of(const Font& font, SimplifiedCurve curve, const BezierContour& contour) {
  switch (curve) {
    case SimplifiedCurve::Cubic:
      return CurveKind::Cubic;
    case SimplifiedCurve::Quadratic:
      return CurveKind::Quadratic;
    case SimplifiedCurve::Same:
      break;
  }
  if (font.format == OutlineFormat::TrueType) return CurveKind::Quadratic;
  const bool has_cubic = std::ranges::find(contour.kinds(), PointKind::Cubic) != contour.kinds().end();
  const bool has_quadratic = std::ranges::find(contour.kinds(), PointKind::Quadratic) != contour.kinds().end();
  return has_quadratic && !has_cubic ? CurveKind::Quadratic : CurveKind::Cubic;
}

/// For every point of the new contour the index of the same point in the old, rising; -1 for new ones.
std::vector<int> origins_of(const BezierContour& before, const BezierContour& after) {
  std::vector<int> origins;
  int next = 0;
  for (int i = 0; i < after.point_count(); ++i) {
    int found = next;
    while (found < before.point_count() &&
           (before.point(found) != after.point(i) || before.kind(found) != after.kind(i)))
      ++found;
    const bool exists = found < before.point_count();
    origins.push_back(exists ? found : -1);
    if (exists) next = found + 1;
  }
  return origins;
}

/// A glyph's contours in the fewest segments found, by `fit_compact`; the input's own where nothing shorter was found.
///
/// A glyph whose simplified outline crosses itself where it did not is tried with less tolerance, down to an eighth;
/// then it stays as it was.
Contours simplify_glyph(const Font& font, int id, const SimplifyOptions& options, SharedFits& fits,
                        SimplifiedGlyph& report) {
  const Glyph& glyph = font.glyphs.at(static_cast<std::size_t>(id));
  report.glyph = id;
  report.name = glyph.name;
  Contours outline;
  try {
    const bool is_flat = becomes_cff(font, options.curve);
    if (!glyph.trouble.empty()) {
      report.refused = glyph.trouble;
      return outline;
    }
    outline = outline_of(font, id, is_flat);
    report.segments_before = report.segments_after = segment_count(outline);
    report.area_before = report.area_after = signed_area(outline);
    if (outline.empty()) return outline;
    const auto before = find_crossings(outline);
    report.crossings_before = report.crossings_after = static_cast<int>(before.size());
    constexpr double least_share = 0.125;
    int added = 0;
    for (double share = 1.0; share >= least_share; share *= 0.5) {
      Contours simplified;
      long spent = 0;
      SimplifiedGlyph found = report;
      found.tolerance = share * options.tolerance * font.units_per_em / 1000.0;
      for (std::size_t c = 0; c < outline.size(); ++c) {
        const BezierContour& own = outline[c];
        CompactOptions compact;
        compact.tolerance = found.tolerance;
        compact.units_per_em = font.units_per_em;
        compact.extrema = options.extrema;
        compact.curve = curve_of(font, options.curve, own);
        if (!is_flat && c < glyph.marks.size()) compact.corners = glyph.marks[c].corners;
        const bool is_frozen = !is_flat && c < glyph.marks.size() && !glyph.marks[c].frozen.empty();
        if (is_frozen) {
          found.notes.push_back(text("contour ", c, ": it has frozen points"));
          simplified.push_back(own);
          continue;
        }
        CompactFit fit = fits.fit(own, compact, spent);
        if (!fit.why.empty()) found.notes.push_back(text("contour ", c, ": ", fit.why));
        if (fit.deviation > found.deviation) {
          found.deviation = fit.deviation;
          found.where = fit.where;
          found.worst_contour = static_cast<int>(c);
        }
        simplified.push_back(std::move(fit.contour));
      }
      if (simplified == outline) {
        report.notes = std::move(found.notes);
        return outline;
      }
      const auto after = find_crossings(simplified);
      added = added_crossings(before, after);
      if (added > 0) continue;
      if (const int user = is_flat ? -1 : matched_in(font, id); user >= 0) {
        report.refused = text("its points would be other ones, and ", font.glyphs[static_cast<std::size_t>(user)].name,
                              " matches its parts by point numbers");
        return outline;
      }
      if (share < 1.0) found.notes.push_back(text("within ", found.tolerance, " units: more would add a crossing"));
      found.changed = true;
      found.crossings_after = static_cast<int>(after.size());
      found.segments_after = segment_count(simplified);
      found.area_after = signed_area(simplified);
      report = std::move(found);
      return simplified;
    }
    report.refused = text("crossings that simplifying adds: ", added);
  } catch (const fontcore::Error& error) {
    report.refused = error.what();
  } catch (const FontReadError& error) {
    report.refused = error.what();
  }
  return outline;
}

}  // namespace

FileKind simplified_kind(const Font& font, SimplifiedCurve curve) {
  const FileKind own = kind_of(font);
  if (becomes_cff(font, curve)) return FileKind::OpenType;
  if (curve == SimplifiedCurve::Quadratic && own == FileKind::OpenType) {
    throw RequestError(font.path + ": cubics become quadratics by convert to a .ttf");
  }
  return own;
}

SimplifyResult simplify(const Font& font, const SimplifyOptions& options) {
  simplified_kind(font, options.curve);  // what cannot be written is refused before it is worked on
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance))
    throw fontcore::InvalidInput(text("simplify: the tolerance is ", options.tolerance));
  const bool is_flat = becomes_cff(font, options.curve);
  if (options.tolerance > 0.0 && !is_flat) refuse_at_fault(font);
  std::vector<int> selected;
  for (const Glyph& glyph : font.glyphs) {
    if (options.only && !std::ranges::binary_search(*options.only, glyph.id)) continue;
    const bool has_own = !glyph.contours.empty() || (is_flat && glyph.is_composite()) || !glyph.trouble.empty();
    if (has_own) selected.push_back(glyph.id);
  }
  std::vector<Contours> outlines(selected.size());
  SimplifyResult result;
  result.glyphs.resize(selected.size());
  SharedFits fits;
  run_jobs(static_cast<int>(selected.size()), options.jobs, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    outlines[k] = simplify_glyph(font, selected[k], options, fits, result.glyphs[k]);
    if (!result.glyphs[k].changed) outlines[k].clear();
  });
  EditedGlyphs edited;
  WriteOptions writing{.is_checked = options.tolerance > 0.0};
  for (std::size_t k = 0; k < selected.size(); ++k) {
    if (!result.glyphs[k].changed) continue;
    if (font.format == OutlineFormat::Ufo) {
      const Contours& before = font.glyphs[static_cast<std::size_t>(selected[k])].contours;
      std::vector<std::vector<int>>& origins = writing.origins[selected[k]];
      for (std::size_t c = 0; c < outlines[k].size(); ++c) origins.push_back(origins_of(before[c], outlines[k][c]));
    }
    edited.emplace(selected[k], std::move(outlines[k]));
  }
  if (is_flat) {
    result.font = convert_outlines(font, {.jobs = options.jobs, .tolerance = 0.0}, edited).font;
  } else {
    result.font = write_font(font, edited, writing);
  }
  for (SimplifiedGlyph& report : result.glyphs) add_written(result.font, report);
  return result;
}

std::string simplify_json(const Font& font, const SimplifyOptions& options, const SimplifyResult& result) {
  using Json = nlohmann::ordered_json;
  const auto names = [&](const std::vector<int>& ids) { return glyph_names(font, ids); };
  int before = 0;
  int after = 0;
  for (const SimplifiedGlyph& glyph : result.glyphs) {
    before += glyph.segments_before;
    after += glyph.segments_after;
  }
  Json head = {{"version", 1},
               {"unitsPerEm", font.units_per_em},
               {"tolerance", options.tolerance * font.units_per_em / 1000.0},
               {"changed", result.changed()},
               {"refused", result.refused()},
               {"segments_before", before},
               {"segments_after", after},
               {"changed_tables", result.font.changed_tables},
               {"dropped_tables", result.font.dropped_tables},
               {"moved_composites", names(result.font.moved_composites)},
               {"dropped_instructions", names(result.font.dropped_instructions)},
               {"dropped_hints", names(result.font.dropped_hints)},
               {"warnings", result.font.warnings}};
  constexpr auto replace = nlohmann::json::error_handler_t::replace;
  std::string out = head.dump(2, ' ', false, replace);
  out.erase(out.size() - 2);  // the closing brace: the glyphs follow, a line each
  out += ",\n  \"glyphs\": [";
  for (std::size_t k = 0; k < result.glyphs.size(); ++k) {
    const SimplifiedGlyph& report = result.glyphs[k];
    Json glyph = {{"name", report.name},
                  {"glyph", report.glyph},
                  {"changed", report.changed},
                  {"tolerance", report.tolerance},
                  {"area_before", report.area_before},
                  {"area_after", report.area_after},
                  {"crossings_before", report.crossings_before},
                  {"crossings_after", report.crossings_after},
                  {"segments_before", report.segments_before},
                  {"segments_after", report.segments_after},
                  {"deviation", report.deviation},
                  {"dropped", report.dropped}};
    if (report.deviation > 0.0) {
      glyph["where"] = Json::array({report.where.x(), report.where.y()});
      glyph["worst_contour"] = report.worst_contour;
    }
    if (!report.refused.empty()) glyph["refused"] = report.refused;
    if (!report.notes.empty()) glyph["notes"] = report.notes;
    out += (k == 0 ? "\n    " : ",\n    ") + glyph.dump(-1, ' ', false, replace);
  }
  return out + (result.glyphs.empty() ? "]\n}\n" : "\n  ]\n}\n");
}

}  // namespace glyphs
