#include "glyphs/inspect.h"

#include <algorithm>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>

#include "fontcore/measure.h"
#include "fontcore/outline_curve.h"
#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Meeting;
using Json = nlohmann::ordered_json;

// What looking into contours may cost, in points; modelling takes 5 to 30 microseconds for each.
constexpr std::int64_t contour_cost = 64;    // of any contour, beside its points: no model has fewer control points
constexpr std::int64_t glyph_budget = 1024;  // ten contours of 40 points, before any glyph gets more
constexpr std::int64_t drawn_budget = 16;    // of a job, for every point that the font stores, and
constexpr std::int64_t in_any_case = 131'072;

/// Names in broken fonts need not be UTF-8.
std::string line_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

const Glyph& glyph_of(const Font& font, int glyph) {
  if (glyph < 0 || glyph >= static_cast<int>(font.glyphs.size()))
    throw RequestError(fontcore::text(font.path, ": there is no glyph gid:", glyph));
  return font.glyphs[static_cast<std::size_t>(glyph)];
}

/// The composed outline; what is wrong with it goes to `Facts::trouble`, without the file's name that every line of
/// output would repeat.
template <typename Facts>
std::vector<BezierContour> outline_for(const Font& font, int glyph, Facts& facts) {
  facts.glyph = glyph;
  facts.name = glyph_of(font, glyph).name;
  try {
    return compose(font, glyph);
  } catch (const FontReadError& error) {
    facts.trouble = error.what();
    const std::string file = font.path + ": ";
    if (facts.trouble.starts_with(file)) facts.trouble.erase(0, file.size());
    return {};
  }
}

ContourFacts facts_of(const BezierContour& contour, int units_per_em) {
  ContourFacts facts;
  facts.area = fontcore::signed_area(contour);
  facts.points = static_cast<int>(stored_points(contour));
  facts.segments = contour.segment_count();
  facts.length = fontcore::length(contour);
  try {
    const fontcore::OutlineCurve curve(contour, {.tolerance = model_tolerance * units_per_em});
    facts.corners = static_cast<int>(curve.corner_pairs().size());
    facts.control_points = curve.size();
    facts.levels = curve.levels();
    facts.distance = curve.distance();
  } catch (const fontcore::InvalidInput& error) {
    facts.no_model = error.what();
  }
  return facts;
}

// In the order of `Meeting`.
constexpr std::array<const char*, 3> kinds{"crossing", "contact", "overlap"};
constexpr std::array<const char*, 3> verbs{"crosses", "touches", "runs along"};

std::string place(const fontcore::Point& where) { return fontcore::text("(", where.x(), ", ", where.y(), ")"); }

}  // namespace

std::vector<GlyphFacts> inspect(const Font& font, const std::vector<int>& glyphs, const JobOptions& options) {
  std::vector<GlyphFacts> all(glyphs.size());
  std::vector<std::int64_t> wanted(glyphs.size(), 0);
  const auto cost = [](const BezierContour& contour) { return contour_cost + contour.point_count(); };
  run_jobs(static_cast<int>(glyphs.size()), options, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    const std::vector<BezierContour> contours = outline_for(font, glyphs[at], all[at]);
    all[at].area = fontcore::signed_area(contours);
    all[at].left_out = static_cast<int>(contours.size());
    wanted[at] = std::transform_reduce(contours.begin(), contours.end(), std::int64_t{0}, std::plus<>(), cost);
  });

  std::int64_t left = in_any_case + drawn_budget * drawn_points(font, glyphs);
  std::vector<std::int64_t> granted(glyphs.size(), 0);
  const auto grant = [&](std::size_t at, std::int64_t most) {
    const std::int64_t more = std::min({wanted[at] - granted[at], most, left});
    granted[at] += more;
    left -= more;
  };
  for (std::size_t at = 0; at < glyphs.size(); ++at) grant(at, glyph_budget);
  for (std::size_t at = 0; at < glyphs.size(); ++at) grant(at, wanted[at]);
  run_jobs(static_cast<int>(glyphs.size()), {.jobs = options.jobs}, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (granted[at] == 0) return;
    for (const BezierContour& contour : compose(font, glyphs[at])) {
      granted[at] -= cost(contour);
      if (granted[at] < 0) return;
      all[at].contours.push_back(facts_of(contour, font.units_per_em));
      --all[at].left_out;
    }
  });
  return all;
}

std::string facts_json(const Font& font, const std::vector<GlyphFacts>& facts) {
  std::string text = fontcore::text("{\"version\":1,\"unitsPerEm\":", font.units_per_em, ",\"glyphs\":[");
  const char* separator = "\n";
  for (const GlyphFacts& glyph : facts) {
    Json json{{"name", glyph.name}, {"area", glyph.area}};
    if (!glyph.trouble.empty()) json = {{"name", glyph.name}, {"area", nullptr}, {"trouble", glyph.trouble}};
    json["gid"] = glyph.glyph;
    json["contours"] = Json::array();
    for (const ContourFacts& contour : glyph.contours) {
      Json one{{"points", contour.points},
               {"segments", contour.segments},
               {"area", contour.area},
               {"length", contour.length}};
      if (contour.no_model.empty()) {
        one["corners"] = contour.corners;
        one["controlPoints"] = contour.control_points;
        one["levels"] = contour.levels;
        one["distance"] = contour.distance;
      } else {
        one["noModel"] = contour.no_model;
      }
      json["contours"].push_back(std::move(one));
    }
    if (glyph.left_out > 0) json["contoursLeftOut"] = glyph.left_out;
    text += separator + line_of(json);
    separator = ",\n";
  }
  return text + "\n]}\n";
}

std::vector<GlyphCrossings> check_crossings(const Font& font, const std::vector<int>& glyphs,
                                            const JobOptions& options) {
  std::vector<GlyphCrossings> all(glyphs.size());
  run_jobs(static_cast<int>(glyphs.size()), options, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    const std::vector<BezierContour> contours = outline_for(font, glyphs[at], all[at]);
    try {
      all[at].crossings = fontcore::find_crossings(contours);
    } catch (const fontcore::WorkLimitExceeded& error) {
      all[at].trouble = error.what();
    }
  });
  return all;
}

std::string describe(const GlyphCrossings& in, const fontcore::Crossing& crossing) {
  const char* verb = verbs[static_cast<std::size_t>(crossing.meeting)];
  const std::string other =
      crossing.a.contour == crossing.b.contour ? "itself" : fontcore::text("contour ", crossing.b.contour);
  return fontcore::text(in.name, ": contour ", crossing.a.contour, " ", verb, " ", other, " at ",
                        place(crossing.where));
}

Report crossings_report(const Font& font, const std::vector<GlyphCrossings>& found) {
  const auto place_json = [](const fontcore::Place& at) {
    return Json{{"contour", at.contour}, {"segment", at.segment}, {"u", at.u}};
  };
  Check within{"glyphwave/contour_crosses_itself", "No contour meets itself.",
               "A contour that crosses or touches itself is filled differently by different programs and breaks "
               "hinting, interpolation and offsetting.",
               font.path};
  Check between{"glyphwave/contours_cross", "No two contours of a glyph meet.",
                "Overlapping contours are drawn with gaps or seams where a program does not fill by the non-zero rule.",
                font.path};
  for (const GlyphCrossings& glyph : found) {
    const Json gid{{"gid", glyph.glyph}};
    // A glyph that cannot be read is said once.
    if (!glyph.trouble.empty())
      within.findings.push_back({Status::Error, glyph.name + ": " + glyph.trouble, glyph.name, "", gid.dump()});
    for (const fontcore::Crossing& crossing : glyph.crossings) {
      Json more = gid;
      more["kind"] = kinds[static_cast<std::size_t>(crossing.meeting)];
      more["x"] = crossing.where.x();
      more["y"] = crossing.where.y();
      more["places"] = {place_json(crossing.a), place_json(crossing.b)};
      Check& check = crossing.a.contour == crossing.b.contour ? within : between;
      check.findings.push_back({crossing.meeting == Meeting::Contact ? Status::Warn : Status::Fail,
                                describe(glyph, crossing), glyph.name, "", more.dump()});
    }
  }
  Report report;
  report.section = "Outlines";
  report.checks = {std::move(within), std::move(between)};
  report.possible = {Status::Error, Status::Fail, Status::Warn, Status::Pass};
  return report;
}

}  // namespace glyphs
