#include "glyphs/area_audit.h"

#include <hb.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "fontcore/error.h"
#include "glyphs/json_reader.h"

namespace glyphs {

namespace {

using fontcore::text;

// Signs and marks, and glyphs without a character: too many kinds for one of them to be an outlier.
constexpr const char* others = "others";
// What is an outlier: [Iglewicz and Hoaglin 1993], and not so small that no reader sees it.
constexpr double outlier_score = 3.5;
constexpr double least_difference = 0.1;
// A group of fewer has no spread to speak of, and of one more even than this no glyph can be told apart.
constexpr std::size_t fewest = 5;
constexpr double least_sigma = 0.01;
constexpr std::size_t most_listed = 20;

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

const char* group_of(char32_t character) {
  if (character == 0) return others;
  switch (hb_unicode_general_category(hb_unicode_funcs_get_default(), character)) {
    case HB_UNICODE_GENERAL_CATEGORY_LOWERCASE_LETTER:
      return "lower case";
    case HB_UNICODE_GENERAL_CATEGORY_UPPERCASE_LETTER:
    case HB_UNICODE_GENERAL_CATEGORY_TITLECASE_LETTER:
      return "capitals";
    case HB_UNICODE_GENERAL_CATEGORY_DECIMAL_NUMBER:
      return "figures";
    default:
      return others;
  }
}

std::string fixed(double value, int digits) {
  char buffer[64];
  return {std::begin(buffer),
          std::to_chars(std::begin(buffer), std::end(buffer), value, std::chars_format::fixed, digits).ptr};
}
std::string percent(double share) { return fixed(100.0 * share, 2) + " %"; }
std::string percent(const std::optional<double>& share) { return share ? percent(*share) : "-"; }
std::string ratio(const std::optional<double>& value) { return value ? fixed(*value, 3) : "-"; }

std::string title_of(const FontColour& font) {
  const std::string name = font.file.substr(font.file.find_last_of('/', font.file.size() - 2) + 1);
  return font.location.empty() ? name : name + " at " + font.location;
}

Json number_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

}  // namespace

const Frequencies& english_frequencies() {
  static const Frequencies letters{
      {U'a', 8.167}, {U'b', 1.492}, {U'c', 2.782}, {U'd', 4.253}, {U'e', 12.702}, {U'f', 2.228}, {U'g', 2.015},
      {U'h', 6.094}, {U'i', 6.966}, {U'j', 0.153}, {U'k', 0.772}, {U'l', 4.025},  {U'm', 2.406}, {U'n', 6.749},
      {U'o', 7.507}, {U'p', 1.929}, {U'q', 0.095}, {U'r', 5.987}, {U's', 6.327},  {U't', 9.056}, {U'u', 2.758},
      {U'v', 0.978}, {U'w', 2.360}, {U'x', 0.150}, {U'y', 1.974}, {U'z', 0.074}};
  return letters;
}

Frequencies parse_frequencies(const std::string& json) {
  const Json whole = parse_json(json);
  if (!whole.is_object() || whole.empty())
    throw RequestError("must be an object of characters and how often they occur");
  Frequencies frequencies;
  for (const auto& [key, value] : whole.items()) {
    hb_buffer_t* const buffer = hb_buffer_create();
    hb_buffer_add_utf8(buffer, key.data(), static_cast<int>(key.size()), 0, static_cast<int>(key.size()));
    unsigned count = 0;
    const hb_glyph_info_t* const characters = hb_buffer_get_glyph_infos(buffer, &count);
    const char32_t character = count == 1 ? characters[0].codepoint : 0;
    hb_buffer_destroy(buffer);
    if (count != 1) throw RequestError(key + ": a single character is expected");
    if (!value.is_number() || !(value.get<double>() >= 0.0))
      throw RequestError(key + ": must be a number, not negative");
    frequencies[character] = value.get<double>();
  }
  return frequencies;
}

Frequencies load_frequencies(const std::string& path) {
  return naming_file(path, read_text(path), [](const std::string& json) { return parse_frequencies(json); });
}

FontColour colour_of(const AreaBaseline& areas, const std::string& file, const std::string& location,
                     const Frequencies& frequencies) {
  FontColour font{.file = file, .location = location, .coverage = {}, .n = {}, .H = {}, .median = 0.0, .glyphs = {}};
  double ink = 0.0;
  double width = 0.0;
  std::map<std::string, std::vector<double>> groups;
  std::vector<double> all;
  for (const GlyphArea& glyph : areas.glyphs) {
    if (glyph.name == ".notdef") continue;
    if (glyph.location != location || !glyph.trouble.empty() || !(glyph.advance > 0.0) || !(glyph.colour_area() > 0.0))
      continue;
    const double colour = glyph.colour_area() / (glyph.advance * areas.units_per_em);
    for (const char32_t character : glyph.characters) {
      if (character == U'n') font.n = colour;
      if (character == U'H') font.H = colour;
      const auto found = frequencies.find(character);
      if (found == frequencies.end()) continue;
      ink += colour * glyph.advance * found->second;
      width += glyph.advance * found->second;
    }
    const char32_t character = glyph.characters.empty() ? 0 : glyph.characters.front();
    font.glyphs.push_back({.name = glyph.name,
                           .colour = colour,
                           .character = character,
                           .group = group_of(character),
                           .to_n = {},
                           .to_H = {}});
    groups[font.glyphs.back().group].push_back(std::log(colour));
    all.push_back(colour);
  }
  if (width > 0.0) font.coverage = ink / width;
  font.median = median_of(all);
  struct Spread {
    double median;
    double sigma;
  };
  std::map<std::string, Spread> spreads;
  for (const auto& [name, logs] : groups) {
    const double median = median_of(logs);
    std::vector<double> off;
    for (const double one : logs) off.push_back(std::abs(one - median));
    constexpr double sigmas = 1.4826;  // of a normal distribution, for its median deviation
    spreads[name] = {median, logs.size() < fewest ? std::numeric_limits<double>::infinity()
                                                  : std::max(least_sigma, sigmas * median_of(off))};
  }
  for (GlyphColour& glyph : font.glyphs) {
    if (font.n) glyph.to_n = glyph.colour / *font.n;
    if (font.H) glyph.to_H = glyph.colour / *font.H;
    const auto& [median, sigma] = spreads.at(glyph.group);
    glyph.to_median = glyph.colour / std::exp(median);
    glyph.score = (std::log(glyph.colour) - median) / sigma;
  }
  std::stable_sort(font.glyphs.begin(), font.glyphs.end(),
                   [](const GlyphColour& a, const GlyphColour& b) { return std::abs(a.score) > std::abs(b.score); });
  return font;
}

Report audit_colour(const std::vector<FontColour>& fonts) {
  Report report;
  report.title = fonts.size() == 1 ? "Colour of " + title_of(fonts[0]) : text("Colour of ", fonts.size(), " fonts");
  report.section = "Colour";
  Table family{"Fonts side by side: ink as share of advance x em",
               {"font", "text", "n", "H", "median", "glyphs", "outliers"},
               {}};
  std::vector<Table> ranked;
  std::size_t outliers = 0;
  for (const FontColour& font : fonts) {
    Check check{"glyphwave/colour", "No glyph is much darker or lighter than its group: " + title_of(font) + ".",
                "Ink as share of advance x em, against the median of lower case, capitals or figures: 3.5 robust "
                "sigmas and a tenth away is an outlier. Many are meant to be: l, i and the quotes are of little ink.",
                font.file};
    Table table{"Most unlike their group: " + title_of(font),
                {"glyph", "colour", "to n", "to H", "to median", "sigmas", "group"},
                {}};
    for (const GlyphColour& glyph : font.glyphs) {
      if (table.rows.size() < most_listed && std::isfinite(glyph.score))
        table.rows.push_back({glyph.name, percent(glyph.colour), ratio(glyph.to_n), ratio(glyph.to_H),
                              ratio(glyph.to_median), fixed(glyph.score, 1), glyph.group});
      if (glyph.group == others || std::abs(glyph.score) <= outlier_score ||
          std::abs(glyph.to_median - 1.0) <= least_difference)
        continue;
      const std::string where = fonts.size() == 1 ? "" : " of " + title_of(font);
      check.findings.push_back(
          {Status::Warn,
           text(glyph.name, where, ": colour ", percent(glyph.colour), ", ", ratio(glyph.to_median),
                " of the median of ", glyph.group, ", ", fixed(std::abs(glyph.score), 1), " sigmas ",
                glyph.score > 0.0 ? "darker" : "lighter"),
           glyph.name, font.location});
    }
    outliers += check.findings.size();
    family.rows.push_back({title_of(font), percent(font.coverage), percent(font.n), percent(font.H),
                           percent(font.median), text(font.glyphs.size()), text(check.findings.size())});
    report.checks.push_back(std::move(check));
    ranked.push_back(std::move(table));
  }
  report.tables.push_back(std::move(family));
  if (fonts.size() > 1) {
    // What stands out in one weight and not in another, whatever the weights are.
    Table table{"Letters whose colour to n differs most from font to font", {"letter"}, {}};
    for (const FontColour& font : fonts) table.head.push_back(title_of(font));
    table.head.emplace_back("spread");
    struct Row {
      double spread;
      std::vector<std::string> cells;
    };
    std::vector<Row> rows;
    for (const GlyphColour& glyph : fonts[0].glyphs) {
      if (glyph.character == 0 || glyph.group == others || !glyph.to_n) continue;
      Row row{0.0, {glyph.name}};
      double least = std::numeric_limits<double>::infinity();
      double most = 0.0;
      for (const FontColour& font : fonts) {
        const auto found = std::find_if(font.glyphs.begin(), font.glyphs.end(),
                                        [&](const GlyphColour& other) { return other.character == glyph.character; });
        const std::optional<double> to_n = found == font.glyphs.end() ? std::nullopt : found->to_n;
        row.cells.push_back(ratio(to_n));
        if (!to_n) continue;
        least = std::min(least, *to_n);
        most = std::max(most, *to_n);
      }
      row.spread = most / least - 1.0;
      row.cells.push_back(percent(row.spread));
      rows.push_back(std::move(row));
    }
    std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.spread > b.spread; });
    for (std::size_t i = 0; i < std::min(rows.size(), most_listed); ++i) table.rows.push_back(std::move(rows[i].cells));
    report.tables.push_back(std::move(table));
  }
  for (Table& table : ranked)
    if (!table.rows.empty()) report.tables.push_back(std::move(table));
  report.summary = text(report.title, ": ", outliers, outliers == 1 ? " outlier" : " outliers");
  return report;
}

std::string audit_json(const Report& report, const std::vector<FontColour>& fonts) {
  Json listed = Json::array();
  for (const FontColour& font : fonts) {
    Json glyphs = Json::array();
    for (const GlyphColour& glyph : font.glyphs)
      glyphs.push_back({{"name", glyph.name},
                        {"colour", glyph.colour},
                        {"group", glyph.group},
                        {"toN", number_or_null(glyph.to_n)},
                        {"toH", number_or_null(glyph.to_H)},
                        {"toMedian", glyph.to_median},
                        {"score", glyph.score}});
    listed.push_back({{"filename", font.file},
                      {"location", font.location},
                      {"coverage", number_or_null(font.coverage)},
                      {"n", number_or_null(font.n)},
                      {"H", number_or_null(font.H)},
                      {"median", font.median},
                      {"glyphs", std::move(glyphs)}});
  }
  return report_json(report, Json{{"fonts", std::move(listed)}}.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace glyphs
