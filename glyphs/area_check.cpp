#include "glyphs/area_check.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <unordered_map>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::octave_count;
using fontcore::Point;
using fontcore::text;

// What the sum of areas in another order, or the 12 digits of a baseline, may change, relative.
constexpr double rounding = 1e-9;
// The 12 digits of an octave's energy as the height of a bump, of the em.
constexpr double least_height = 1e-6;
// What moments may change, of what octaves may: a bump stands on some thousandth of the outline.
constexpr double mean_share = 1e-3;
// How far curves refitted within a distance are off on average, of that distance, where all err to one side: small
// round contours come to a third.
constexpr double refit_share = 0.5;
// Contours are told apart in a message up to so many; a glyph of more is named as a whole.
constexpr std::size_t most_matched = 200;
constexpr std::size_t most_named = 3;
constexpr std::size_t most_drawn = 12;
constexpr const char* advance_key = "glyphwave/advance";

std::string number(double value, int digits = 3) {
  char buffer[32];
  return {std::begin(buffer),
          std::to_chars(std::begin(buffer), std::end(buffer), value, std::chars_format::general, digits).ptr};
}

std::string signed_number(double value) { return (value < 0.0 ? "" : "+") + number(value); }
std::string percent(double ratio) { return signed_number(100.0 * ratio) + " %"; }
std::string pair_of(const Point& point) {
  const auto hundredths = [](double value) { return number(std::round(100.0 * value) / 100.0 + 0.0, 6); };
  return text("(", hundredths(point.x()), ", ", hundredths(point.y()), ")");
}
std::string whole(double value) { return number(std::round(value), 7); }

/// The glyph as it would measure in an em `factor` times as large.
GlyphArea rescaled(GlyphArea glyph, double factor) {
  const double square = factor * factor;
  glyph.area *= square;
  glyph.advance *= factor;
  glyph.length *= factor;
  glyph.centroid *= factor;
  glyph.second_moments *= square * square;
  for (ContourArea& contour : glyph.contours) {
    contour.area *= square;
    contour.centroid *= factor;
  }
  if (glyph.ink) *glyph.ink *= square;
  if (glyph.octaves)
    for (double& energy : *glyph.octaves) energy *= square * factor;
  return glyph;
}

/// What is allowed of one glyph, in font units of now.
struct Allowance {
  double em = 0.0;
  double percent = 0.0;
  double units = 0.0;
  double move = 0.0;
  double mean_move = 0.0;  ///< that all of the outline may have made; 0: it has to be what it was
  double advance = 0.0;
  bool area_only = false;
};

/// What of a glyph changed, in words.
struct Change {
  double area = 0.0;  ///< relative; 0 if it is within the tolerance
  double move = 0.0;  ///< in what is allowed; 0 if it is within that
  std::vector<std::string> words;
};

/// Pairs of contours, before and now, that are most alike.
std::vector<std::pair<std::size_t, std::size_t>> match(const GlyphArea& was, const GlyphArea& is, double em) {
  struct Pair {
    double difference;
    std::size_t before, now;
  };
  std::vector<Pair> all;
  for (std::size_t i = 0; i < was.contours.size(); ++i) {
    for (std::size_t j = 0; j < is.contours.size(); ++j) {
      const ContourArea& a = was.contours[i];
      const ContourArea& b = is.contours[j];
      all.push_back(
          {(a.centroid - b.centroid).norm() / em + std::sqrt(std::abs(std::abs(a.area) - std::abs(b.area))) / em, i,
           j});
    }
  }
  std::sort(all.begin(), all.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.difference, a.before, a.now) < std::tie(b.difference, b.before, b.now);
  });
  std::vector<bool> has_before(was.contours.size());
  std::vector<bool> has_now(is.contours.size());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const Pair& one : all) {
    if (has_before[one.before] || has_now[one.now]) continue;
    has_before[one.before] = has_now[one.now] = true;
    pairs.emplace_back(one.before, one.now);
  }
  return pairs;
}

/// Which contours changed, in words.
struct ContourChanges {
  bool is_beyond = false;   ///< one of them by more than its share
  bool has_turned = false;  ///< one runs the other way beside those it meets, and the ink is the same
  std::vector<std::string> words;
};

ContourChanges contour_changes(const GlyphArea& was, const GlyphArea& is, const Allowance& allowed, bool has_same_ink) {
  ContourChanges changes;
  if (was.contours.size() != is.contours.size()) {
    changes.words.push_back(
        text(is.contours.size(), is.contours.size() == 1 ? " contour" : " contours", " for ", was.contours.size()));
    changes.is_beyond = true;
    return changes;
  }
  if (was.contours.size() > most_matched) return changes;
  struct Named {
    double relative;
    std::string words;
  };
  std::vector<Named> named;
  const auto counters =
      std::count_if(was.contours.begin(), was.contours.end(), [](const auto& c) { return c.area < 0.0; });
  for (const auto& [i, j] : match(was, is, allowed.em)) {
    const ContourArea& a = was.contours[i];
    const ContourArea& b = is.contours[j];
    const double change = std::abs(b.area) - std::abs(a.area);
    const double relative = a.area == 0.0 ? std::copysign(1.0, change) : change / std::abs(a.area);
    const bool is_counter = a.area < 0.0;
    const auto same_kind = is_counter ? counters : static_cast<std::ptrdiff_t>(was.contours.size()) - counters;
    const std::string place =
        same_kind == 1 ? "" : text(" at (", whole(b.centroid.x()), ", ", whole(b.centroid.y()), ")");
    const std::string name = (is_counter                       ? "counter"
                              : was.contours.size() == 1       ? "contour"
                              : counters > 0 && same_kind == 1 ? "outer contour"
                                                               : "contour") +
                             place;
    if (is_counter != (b.area < 0.0) && has_same_ink) {
      changes.has_turned = true;
    } else if (is_counter != (b.area < 0.0)) {
      named.push_back({2.0, name + (is_counter ? " is filled" : " is a counter now")});
      changes.is_beyond = true;
    } else if (std::abs(change) >
               std::max(0.01 * allowed.percent * std::abs(a.area), allowed.units) + rounding * std::abs(a.area)) {
      named.push_back({std::abs(relative), name + " " + percent(relative)});
      changes.is_beyond = true;
    } else if (const Point by = b.centroid - a.centroid;
               was.contours.size() > 1 && by.norm() > allowed.move + allowed.mean_move) {
      named.push_back({by.norm() / allowed.em, name + " moved by " + pair_of(by)});
    }
  }
  std::stable_sort(named.begin(), named.end(), [](const Named& a, const Named& b) { return a.relative > b.relative; });
  for (std::size_t i = 0; i < std::min(named.size(), most_named); ++i) changes.words.push_back(named[i].words);
  if (named.size() > most_named) changes.words.push_back(text(named.size() - most_named, " more contours"));
  return changes;
}

/// How far the outline moved on average if that is to explain its moments, in what is allowed.
double moved_by_moments(const GlyphArea& was, const GlyphArea& is, const Allowance& allowed) {
  if (was.length <= 0.0) return 0.0;
  const double area = was.enclosed();
  const double spread = was.second_moments[0] + was.second_moments[2];
  const double radius = area > 0.0 && spread > 0.0 ? std::sqrt(spread / area) : 0.25 * allowed.em;
  const Point by = is.centroid - was.centroid;
  const double now = is.enclosed();
  const Point first = now * by;
  const Eigen::Vector3d second =
      is.second_moments + now * Eigen::Vector3d(by.x() * by.x(), by.x() * by.y(), by.y() * by.y()) - was.second_moments;
  const double mean = std::max(first.norm() / radius, second.norm() / (radius * radius)) / was.length;
  return mean / (mean_share * allowed.move + allowed.mean_move + rounding * allowed.em);
}

void describe_moments(const GlyphArea& was, const GlyphArea& is, std::vector<std::string>& words) {
  const Point by = is.centroid - was.centroid;
  if (by.cwiseAbs().maxCoeff() >= 0.005) words.push_back("balance moved by " + pair_of(by));
  const auto spread = [&](Eigen::Index k) {
    const double before = was.second_moments[k] / was.enclosed();
    const double after = is.second_moments[k] / is.enclosed();
    return before > 0.0 && after > 0.0 ? std::sqrt(after / before) - 1.0 : 0.0;
  };
  for (const auto& [k, direction] : {std::pair(0, "across"), std::pair(2, "up")}) {
    if (const double change = spread(k); std::abs(change) >= 5e-5)
      words.push_back(text("spread ", direction, " ", percent(change)));
  }
}

/// By octave, how high a bump of its size explains what changed, or how far the outline moved, in what is allowed.
std::array<double, octave_count> moved_by_octaves(const GlyphArea& was, const GlyphArea& is, const Allowance& allowed) {
  std::array<double, octave_count> moved{};
  if (!was.octaves || !is.octaves || allowed.area_only) return moved;
  for (std::size_t k = 0; k < octave_count; ++k) {
    const double a = (*was.octaves)[k];
    const double b = (*is.octaves)[k];
    if (allowed.mean_move > 0.0) {
      moved[k] = std::abs(std::sqrt(b) - std::sqrt(a)) / std::sqrt(std::max(was.length, 1e-9)) / allowed.mean_move;
    } else {
      const double size = std::ldexp(finest_feature * allowed.em, static_cast<int>(k));
      moved[k] = std::sqrt(std::abs(b - a) / size) / std::max(allowed.move, least_height * allowed.em);
    }
  }
  return moved;
}

/// The octaves whose energy changed most for what they had, of those beyond what is allowed.
void describe_octaves(const GlyphArea& was, const GlyphArea& is, const std::array<double, octave_count>& moved,
                      double em, std::vector<std::string>& words) {
  std::array<double, octave_count> change{};
  std::size_t most = octave_count;
  for (std::size_t k = 0; k < octave_count; ++k) {
    if (moved[k] <= 1.0) continue;
    const double before = std::sqrt((*was.octaves)[k]);
    change[k] = (std::sqrt((*is.octaves)[k]) - before) / std::max(before, least_height * em);
    if (most == octave_count || std::abs(change[k]) > std::abs(change[most])) most = k;
  }
  if (most == octave_count) return;
  std::size_t from = most;
  std::size_t to = most;
  const auto belongs = [&](std::size_t k) {
    return change[k] * change[most] > 0.0 && std::abs(change[k]) >= 0.5 * std::abs(change[most]);
  };
  while (from > 0 && belongs(from - 1)) --from;
  while (to + 1 < octave_count && belongs(to + 1)) ++to;
  const auto size = [&](std::size_t k) { return whole(std::ldexp(finest_feature * em, static_cast<int>(k))); };
  const std::string sizes = from == 0 ? "below " + size(to) : "of " + size(from - 1) + " to " + size(to);
  words.push_back(text("detail ", sizes, " units ", percent(change[most])));
}

Change change_of(const GlyphArea& was, const GlyphArea& is, const Allowance& allowed) {
  Change change;
  const bool has_ink = was.ink && is.ink;
  const double before = has_ink ? *was.ink : was.enclosed();
  const double after = has_ink ? *is.ink : is.enclosed();
  const double limit = std::max(0.01 * allowed.percent * std::abs(before), allowed.units) +
                       allowed.mean_move * was.length + rounding * (std::abs(before) + allowed.em);
  const double relative = before == 0.0 ? std::copysign(1.0, after) : (after - before) / std::abs(before);
  if (std::abs(after - before) > limit) change.area = relative;

  ContourChanges contours = contour_changes(was, is, allowed, has_ink && change.area == 0.0);
  change.words = std::move(contours.words);
  // Moments count what is enclosed; where contours turned and ink did not, that says nothing of the outline.
  const double by_moments = contours.has_turned || allowed.area_only ? 0.0 : moved_by_moments(was, is, allowed);
  const std::array<double, octave_count> by_octaves = moved_by_octaves(was, is, allowed);
  const double most = std::max(by_moments, *std::max_element(by_octaves.begin(), by_octaves.end()));
  if (most > 1.0) change.move = most;
  // Refitted or rounded, a small contour may change its area by more than its share.
  if (contours.is_beyond && (allowed.mean_move == 0.0 || was.contours.size() != is.contours.size()))
    change.move = std::max(change.move, 1.0);
  if (change.area == 0.0 && change.move == 0.0) return {};
  if (was.octaves && is.octaves) describe_octaves(was, is, by_octaves, allowed.em, change.words);
  if (by_moments > 1.0) describe_moments(was, is, change.words);
  if (change.area != 0.0) {
    const std::string head =
        text(has_ink ? "ink " : "area ", percent(relative), " (", whole(before), " to ", whole(after), ")");
    change.words.insert(change.words.begin(), head);
  }
  return change;
}

std::string joined(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& one : words) all += (all.empty() ? "" : ", ") + one;
  return all;
}

/// Where the glyphs of one location are found.
struct Index {
  std::unordered_map<std::string, std::size_t> by_name;
  std::unordered_map<char32_t, std::size_t> by_character;

  Index(const AreaBaseline& baseline, const std::string& location) {
    for (std::size_t i = 0; i < baseline.glyphs.size(); ++i) {
      if (baseline.glyphs[i].location != location) continue;
      by_name.emplace(baseline.glyphs[i].name, i);
      for (const char32_t character : baseline.glyphs[i].characters) by_character.emplace(character, i);
    }
  }
  std::size_t find(const GlyphArea& glyph) const {
    for (const char32_t character : glyph.characters)
      if (const auto found = by_character.find(character); found != by_character.end()) return found->second;
    const auto found = by_name.find(glyph.name);
    return found == by_name.end() ? none : found->second;
  }
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
};

std::string counted(std::size_t count, const char* of_what) { return text(count, " ", of_what, count == 1 ? "" : "s"); }

}  // namespace

AreaComparison compare_areas(const AreaBaseline& before, const AreaBaseline& now, const std::string& file,
                             const AreaCheckOptions& options) {
  for (const double tolerance : {options.percent, options.units, options.move, options.curve})
    if (!(tolerance >= 0.0) || !std::isfinite(tolerance))
      throw fontcore::InvalidInput(text("compare_areas: a tolerance of ", tolerance));
  Check area{"glyphwave/area", "No glyph's area has drifted.",
             "The area of a glyph is its colour in text; drifts of single glyphs make spots.", file};
  Check outline{"glyphwave/outline", "No outline has moved where its area has stayed.",
                "A shape can change and keep its area; moments and the energy in octaves of feature size tell.", file};
  Check advance{advance_key, "No advance has changed.",
                "Advances share out the area: the same ink in less room is darker, and text breaks elsewhere.", file};
  Check set{"glyphwave/glyph_set", "Every glyph of the baseline is there and can be read, and no other.",
            "What is not in the baseline is not watched.", file};
  Check em{"glyphwave/units_per_em", "The em has as many units as before.",
           "All lengths are in units of the em; --rescale compares across ems.", file};

  const double factor = static_cast<double>(now.units_per_em) / before.units_per_em;
  const bool is_rescaled = now.units_per_em != before.units_per_em;
  if (is_rescaled && !options.rescale)
    em.findings.push_back({Status::Fail,
                           text("units per em: ", now.units_per_em, ", ", before.units_per_em,
                                " before; glyphs are compared in the new ones"),
                           "", ""});

  struct Ranked {
    AreaDrift drift;
    double area;
    double move;
  };
  std::vector<Ranked> ranked;
  std::size_t compared = 0;
  std::size_t gone = 0;
  std::size_t added = 0;
  for (const std::string& location : before.locations) {
    const Index index(now, location);
    const std::string where = location.empty() ? "" : " at " + location;
    std::vector<bool> is_known(now.glyphs.size());
    for (const GlyphArea& glyph : before.glyphs) {
      if (glyph.location != location) continue;
      const std::size_t found = index.find(glyph);
      if (found == Index::none) {
        if (now.is_selection) continue;
        ++gone;
        set.findings.push_back(
            {Status::Fail, glyph.name + where + ": has gone, or has no outline any more", glyph.name, location});
        continue;
      }
      const GlyphArea& is = now.glyphs[found];
      is_known[found] = true;
      const std::string name = is.name + where;
      ++compared;
      if (!is.trouble.empty()) {
        if (glyph.trouble.empty())
          set.findings.push_back(
              {Status::Fail, name + ": cannot be measured any more: " + is.trouble, is.name, location});
        continue;
      }
      if (!glyph.trouble.empty()) {
        set.findings.push_back({Status::Warn, name + ": could not be measured before", is.name, location});
        continue;
      }
      const GlyphArea was = is_rescaled ? rescaled(glyph, factor) : glyph;
      const double thousandth = 1e-3 * now.units_per_em;
      const auto own = before.tolerances.find(glyph.name);
      const AreaTolerance tolerance = own == before.tolerances.end() ? AreaTolerance{} : own->second;
      const double half_units = is_rescaled ? 0.5 * (1.0 + factor) : 0.0;
      const bool is_refitted = was.has_quadratics != is.has_quadratics || was.has_cubics != is.has_cubics;
      const Allowance allowed{.em = static_cast<double>(now.units_per_em),
                              .percent = tolerance.percent.value_or(options.percent),
                              .units = tolerance.units.value_or(options.units),
                              .move = thousandth * tolerance.move.value_or(options.move),
                              .mean_move = half_units + (is_refitted ? refit_share * options.curve * thousandth : 0.0),
                              .advance = 2.0 * half_units + rounding * now.units_per_em,
                              .area_only = options.area_only};
      if (std::abs(is.advance - was.advance) > allowed.advance)
        advance.findings.push_back(
            {Status::Fail, text(name, ": advance ", number(is.advance, 7), ", ", number(was.advance, 7), " before"),
             is.name, location});
      const Change change = change_of(was, is, allowed);
      if (change.area == 0.0 && change.move == 0.0) continue;
      (change.area != 0.0 ? area : outline)
          .findings.push_back({Status::Fail, name + ": " + joined(change.words), is.name, location});
      ranked.push_back({{is.name, location}, std::abs(change.area), change.move});
    }
    if (before.is_selection || now.is_selection) continue;
    for (std::size_t i = 0; i < now.glyphs.size(); ++i) {
      if (now.glyphs[i].location != location || is_known[i]) continue;
      ++added;
      set.findings.push_back({Status::Warn, now.glyphs[i].name + where + ": is new, the baseline does not have it",
                              now.glyphs[i].name, location});
    }
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked& a, const Ranked& b) {
    return std::tie(a.area, a.move) > std::tie(b.area, b.move);
  });

  AreaComparison comparison;
  for (Ranked& one : ranked) comparison.drifts.push_back(std::move(one.drift));
  comparison.report.title = "Areas of " + file;
  comparison.report.section = "Area";
  comparison.report.summary = text(file, ": ", area.findings.size(), " of ", counted(compared, "glyph"),
                                   " changed in area, ", outline.findings.size(), " in outline alone, ",
                                   advance.findings.size(), " in advance; ", gone, " gone, ", added, " new");
  comparison.report.checks = {std::move(area), std::move(outline), std::move(advance), std::move(set), std::move(em)};
  return comparison;
}

// Pictures ------------------------------------------------------------------------------------------------------------

namespace {

std::string path_of(const std::vector<BezierContour>& contours) {
  std::string path;
  const auto add = [&](const char* command, const Bezier& bezier, std::size_t first) {
    path += command;
    for (std::size_t k = first; k <= static_cast<std::size_t>(bezier.degree); ++k)
      path += (k == first ? "" : " ") + number(bezier.p[k].x(), 7) + " " + number(bezier.p[k].y(), 7);
  };
  for (const BezierContour& contour : contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      const fontcore::Bezier bezier = contour.segment(s);
      if (s == 0) path += "M" + number(bezier.start().x(), 7) + " " + number(bezier.start().y(), 7);
      add(bezier.degree == 1 ? "L" : bezier.degree == 2 ? "Q" : "C", bezier, 1);
    }
    path += "Z";
  }
  return path;
}

int glyph_of(const Font& font, const std::string& name, const std::vector<char32_t>& characters) {
  for (const char32_t character : characters)
    if (const auto found = font.character_map.find(character); found != font.character_map.end()) return found->second;
  return font.find(name);
}

/// Where outlines of as many contours differ most.
fontcore::Farthest largest_difference(const std::vector<BezierContour>& before, const std::vector<BezierContour>& now,
                                      double em) {
  fontcore::Farthest worst;
  for (const BezierContour& contour : now) {
    fontcore::Farthest nearest{std::numeric_limits<double>::infinity(), Point::Zero()};
    for (const BezierContour& other : before) {
      const fontcore::Farthest here = fontcore::farthest(other, contour, 1e-4 * em);
      if (here.distance < nearest.distance) nearest = here;
    }
    if (std::isfinite(nearest.distance) && nearest.distance > worst.distance) worst = nearest;
  }
  return worst;
}

}  // namespace

std::vector<Picture> draw_drifts(const AreaComparison& comparison, const std::string& location, const Font& now,
                                 const Font* before) {
  std::vector<Picture> pictures;
  const std::size_t count = std::min(comparison.drifts.size(), most_drawn);
  for (std::size_t i = 0; i < count; ++i) {
    const AreaDrift& drift = comparison.drifts[i];
    if (drift.location != location) continue;
    const int id = now.find(drift.glyph);
    if (id < 0) continue;
    std::vector<char32_t> characters;
    for (const auto& [character, glyph] : now.character_map)
      if (glyph == id) characters.push_back(character);
    const std::vector<BezierContour> outline = compose(now, id);
    std::vector<BezierContour> old;
    const int old_id = before == nullptr ? -1 : glyph_of(*before, drift.glyph, characters);
    if (old_id >= 0) {
      old = compose(*before, old_id);
      const double factor = static_cast<double>(now.units_per_em) / before->units_per_em;
      for (BezierContour& contour : old) contour = transform(contour, {.linear = factor * Eigen::Matrix2d::Identity()});
    }
    fontcore::Box box;
    box.add(Point(0.0, std::min(now.descender, -0.2 * now.units_per_em)));
    box.add(Point(now.glyphs[static_cast<std::size_t>(id)].advance, std::max(now.ascender, 0.7 * now.units_per_em)));
    box.add(control_box(outline));
    box.add(control_box(old));

    // All panels as high; a glyph that is wider than that is smaller.
    constexpr double height = 220.0;
    constexpr double gap = 16.0;
    constexpr double least_width = 130.0;  // of a label
    const Point size = box.high - box.low;
    const double scale = height / std::max(size.y(), 0.7 * size.x());
    std::string panels;
    double x = 0.0;
    const auto panel = [&](const fontcore::Box& window, double enlarged, const std::string& label,
                           const std::string& paths) {
      const Point extent = enlarged * (window.high - window.low);
      const double down = -enlarged * window.high.y();
      panels += text(
          "<svg x=\"", number(x, 6), "\" y=\"18\" width=\"", number(extent.x(), 6), "\" height=\"",
          number(extent.y(), 6), "\" style=\"background:none;border:0\" overflow=\"hidden\"><g transform=\"matrix(",
          number(enlarged, 6), " 0 0 ", number(-enlarged, 6), " ", number(-enlarged * window.low.x(), 6), " ",
          number(-down, 6), ")\"><path d=\"M", number(window.low.x(), 7), " 0H", number(window.high.x(), 7),
          "\" stroke=\"#bbb\" stroke-width=\"", number(1.0 / enlarged, 6), "\"/>", paths, "</g></svg><text x=\"",
          number(x, 6), "\" y=\"12\" font-size=\"12\" fill=\"#666\" font-family=\"sans-serif\">", label, "</text>");
      x += std::max(extent.x(), least_width) + gap;
    };
    const auto filled = [&](const std::vector<BezierContour>& contours, const char* colour) {
      return text("<path fill=\"", colour, "\" style=\"mix-blend-mode:multiply\" d=\"", path_of(contours), "\"/>");
    };
    std::string caption = drift.glyph + (location.empty() ? "" : " at " + location);
    for (const Check& check : comparison.report.checks) {
      if (check.key == advance_key) continue;
      for (const Finding& finding : check.findings)
        if (finding.glyph == drift.glyph && finding.location == location) caption = finding.message;
    }
    if (old.empty()) {
      panel(box, scale, "now", filled(outline, "#222"));
    } else {
      panel(box, scale, "before", filled(old, "#222"));
      panel(box, scale, "now", filled(outline, "#222"));
      const std::string both = filled(old, "#f0736a") + filled(outline, "#5aa0f2");
      panel(box, scale, "red: gone, blue: new", both);
      if (const fontcore::Farthest worst = largest_difference(old, outline, now.units_per_em); worst.distance > 0.0) {
        const double reach = std::max(6.0 * worst.distance, 0.02 * now.units_per_em);
        fontcore::Box window;
        window.add(Point(worst.where - Point(reach, reach)));
        window.add(Point(worst.where + Point(reach, reach)));
        const double enlarged = scale * size.y() / (2.0 * reach);
        panel(
            window, enlarged,
            text("at (", whole(worst.where.x()), ", ", whole(worst.where.y()), "): ", number(worst.distance), " units"),
            both);
      }
    }
    const double down = scale * size.y() + 18.0;
    pictures.push_back({caption, text("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"", number(x - gap, 6),
                                      "\" height=\"", number(down, 6), "\">", panels, "</svg>")});
  }
  return pictures;
}

}  // namespace glyphs
