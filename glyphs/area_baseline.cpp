#include "glyphs/area_baseline.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/json_reader.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Moments;
using fontcore::Point;
using fontcore::text;

// The largest baseline in use, 65,535 glyphs with everything measured, is some 40 MB.
constexpr std::size_t most_baseline_bytes = std::size_t{256} << 20;

GlyphArea measured(const Font& font, int id, AreaMetrics metrics, const std::string& location) {
  GlyphArea glyph;
  glyph.name = font.glyphs[static_cast<std::size_t>(id)].name;
  glyph.location = location;
  std::vector<BezierContour> contours;
  try {
    contours = compose(font, id);
  } catch (const FontReadError& error) {
    glyph.trouble = error.what();
    const std::string file = font.path + ": ";
    if (glyph.trouble.starts_with(file)) glyph.trouble.erase(0, file.size());
    return glyph;
  }
  glyph.advance = font.glyphs[static_cast<std::size_t>(id)].advance;
  const std::vector<int> signs = contours.empty() ? std::vector<int>{} : fontcore::orientation_signs(contours);
  Moments all;
  for (std::size_t i = 0; i < contours.size(); ++i) {
    const Moments own = signs[i] * fontcore::moments(contours[i]);
    glyph.area += signs[i] * own.area;
    const double length = fontcore::length(contours[i]);
    if (length == 0.0) continue;  // a point that marks a place
    glyph.length += length;
    glyph.contours.push_back({own.area, own.area == 0.0 ? contours[i].point(0) : own.centroid()});
    all += own;
    for (const fontcore::PointKind kind : contours[i].kinds()) {
      glyph.has_quadratics = glyph.has_quadratics || kind == fontcore::PointKind::Quadratic;
      glyph.has_cubics = glyph.has_cubics || kind == fontcore::PointKind::Cubic;
    }
  }
  std::sort(glyph.contours.begin(), glyph.contours.end(), [](const ContourArea& a, const ContourArea& b) {
    return std::tuple(-std::abs(a.area), a.centroid.x(), a.centroid.y()) <
           std::tuple(-std::abs(b.area), b.centroid.x(), b.centroid.y());
  });
  if (all.area != 0.0) glyph.centroid = all.centroid();
  glyph.second_moments = all.about(glyph.centroid).second;
  if (metrics == AreaMetrics::Area) return glyph;
  try {
    glyph.ink = contours.empty() ? 0.0 : fontcore::measure_ink(contours).area;
    glyph.octaves = fontcore::octave_energies(contours, finest_feature * font.units_per_em);
  } catch (const fontcore::WorkLimitExceeded& error) {
    glyph.trouble = error.what();
  }
  return glyph;
}

// JSON ----------------------------------------------------------------------------------------------------------------

/// Text put together number by number: a font of 65,535 glyphs has two millions of them.
class Line {
 public:
  Line& operator<<(const char* part) { return add(part); }
  Line& operator<<(const std::string& part) { return add(part); }
  /// The shortest text that reads back to the same number.
  Line& exact(double value) { return is_whole(value) ? put(static_cast<std::int64_t>(value)) : put(value); }
  Line& number(double value) {
    constexpr int digits = 12;
    return is_whole(value) ? put(static_cast<std::int64_t>(value)) : put(value, std::chars_format::general, digits);
  }
  Line& quoted(const std::string& words) {
    return add(Json(words).dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  std::string take() { return std::move(out_); }

 private:
  static bool is_whole(double value) { return std::abs(value) < 1e15 && value == std::round(value); }
  template <typename... How>
  Line& put(How... how) {
    char buffer[32];
    out_.append(std::begin(buffer), std::to_chars(std::begin(buffer), std::end(buffer), how...).ptr);
    return *this;
  }
  template <typename Text>
  Line& add(const Text& part) {
    out_ += part;
    return *this;
  }
  std::string out_;
};

std::string character_name(char32_t character) {
  char buffer[8];
  const auto* const end =
      std::to_chars(std::begin(buffer), std::end(buffer), static_cast<std::uint32_t>(character), 16).ptr;
  std::string digits(static_cast<const char*>(buffer), end);
  std::transform(digits.begin(), digits.end(), digits.begin(),
                 [](char c) { return c >= 'a' ? static_cast<char>(c - 'a' + 'A') : c; });
  return "U+" + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits;
}

std::string line_of(const GlyphArea& glyph) {
  Line line;
  (line << "{\"name\":").quoted(glyph.name) << ",\"area\":";
  if (glyph.trouble.empty())
    line.exact(glyph.area);
  else
    line << "null";
  const char* separator = ",\"characters\":[\"";
  for (const char32_t character : glyph.characters) {
    line << separator << character_name(character);
    separator = "\",\"";
  }
  if (!glyph.characters.empty()) line << "\"]";
  if (!glyph.location.empty()) (line << ",\"location\":").quoted(glyph.location);
  if (!glyph.trouble.empty()) {
    (line << ",\"trouble\":").quoted(glyph.trouble) << "}";
    return line.take();
  }
  (line << ",\"advance\":").number(glyph.advance);
  (line << ",\"length\":").number(glyph.length);
  (line << ",\"centroid\":[").number(glyph.centroid.x());
  (line << ",").number(glyph.centroid.y()) << "],\"secondMoments\":[";
  line.number(glyph.second_moments[0]);
  (line << ",").number(glyph.second_moments[1]);
  (line << ",").number(glyph.second_moments[2]) << "],\"contours\":[";
  separator = "[";
  for (const ContourArea& contour : glyph.contours) {
    (line << separator).number(contour.area);
    (line << ",").number(contour.centroid.x());
    (line << ",").number(contour.centroid.y()) << "]";
    separator = ",[";
  }
  line << "]";
  if (glyph.has_quadratics || glyph.has_cubics)
    line << ",\"curves\":" << (!glyph.has_cubics ? "\"quadratic\"" : glyph.has_quadratics ? "\"both\"" : "\"cubic\"");
  if (glyph.ink) (line << ",\"ink\":").number(*glyph.ink);
  if (glyph.octaves) {
    separator = ",\"octaves\":[";
    for (const double energy : *glyph.octaves) {
      (line << separator).number(energy);
      separator = ",";
    }
    line << "]";
  }
  line << "}";
  return line.take();
}

std::vector<double> take_numbers(ObjectReader& object, const std::string& key, std::size_t count) {
  const Json& list = object.take(key);
  const bool is_good = list.is_array() && list.size() == count &&
                       std::all_of(list.begin(), list.end(), [](const Json& one) { return one.is_number(); });
  if (!is_good) object.fail(key, text("must be ", count, " numbers"));
  return list.get<std::vector<double>>();
}

AreaTolerance take_tolerance(const Json& json, const std::string& place) {
  ObjectReader object(json, place);
  AreaTolerance tolerance;
  const auto take = [&](const char* key, std::optional<double>& value) {
    if (!object.has(key)) return;
    value = object.take_number(key);
    if (!(*value >= 0.0)) object.fail(key, "must not be negative");
  };
  take("percent", tolerance.percent);
  take("units", tolerance.units);
  take("move", tolerance.move);
  object.finish();
  return tolerance;
}

std::map<std::string, AreaTolerance> take_tolerances(const Json& json) {
  if (!json.is_object()) throw RequestError("tolerances: must be an object");
  std::map<std::string, AreaTolerance> tolerances;
  for (const auto& [name, one] : json.items()) tolerances[name] = take_tolerance(one, "tolerances." + name);
  return tolerances;
}

GlyphArea take_glyph(const Json& json, const std::string& place, AreaMetrics metrics) {
  ObjectReader object(json, place);
  GlyphArea glyph;
  glyph.name = object.take_text("name", "");
  if (glyph.name.empty()) object.fail("name", "is missing");
  if (object.has("characters")) {
    const Json& list = object.take("characters");
    if (!list.is_array()) object.fail("characters", "must be a list");
    for (const Json& one : list) {
      const std::string name = one.is_string() ? one.get<std::string>() : std::string();
      std::uint32_t character = 0;
      const char* const end = name.data() + name.size();
      if (!name.starts_with("U+") || std::from_chars(name.data() + 2, end, character, 16).ptr != end ||
          character > 0x10FFFF)
        object.fail("characters", "must be like \"U+0061\"");
      glyph.characters.push_back(character);
    }
  }
  glyph.location = object.take_text("location", "");
  glyph.trouble = object.take_text("trouble", "");
  if (!glyph.trouble.empty()) {
    object.take("area");
    object.finish();
    return glyph;
  }
  glyph.area = object.take_number("area");
  glyph.advance = object.take_number("advance");
  glyph.length = object.take_number("length");
  glyph.centroid = object.take_point("centroid");
  const std::vector<double> second = take_numbers(object, "secondMoments", 3);
  glyph.second_moments = {second[0], second[1], second[2]};
  const Json& contours = object.take("contours");
  if (!contours.is_array()) object.fail("contours", "must be a list");
  for (const Json& one : contours) {
    if (!one.is_array() || one.size() != 3 ||
        !std::all_of(one.begin(), one.end(), [](const Json& x) { return x.is_number(); }))
      object.fail("contours", "must be lists of an area, x and y");
    glyph.contours.push_back({one[0].get<double>(), {one[1].get<double>(), one[2].get<double>()}});
  }
  const std::string curves =
      object.has("curves") ? object.take_choice("curves", {"quadratic", "cubic", "both"}, "") : "";
  glyph.has_quadratics = curves == "quadratic" || curves == "both";
  glyph.has_cubics = curves == "cubic" || curves == "both";
  if (metrics == AreaMetrics::All) {
    glyph.ink = object.take_number("ink");
    const std::vector<double> energies = take_numbers(object, "octaves", fontcore::octave_count);
    glyph.octaves.emplace();
    std::copy(energies.begin(), energies.end(), glyph.octaves->begin());
  }
  object.finish();
  return glyph;
}

}  // namespace

double GlyphArea::enclosed() const {
  // From small to large, as they stand the other way: sums of the same areas are the same in every order.
  return std::accumulate(contours.rbegin(), contours.rend(), 0.0,
                         [](double sum, const ContourArea& contour) { return sum + contour.area; });
}

std::vector<GlyphArea> measure_areas(const Font& font, const std::vector<int>& glyphs, AreaMetrics metrics,
                                     const std::string& location, const JobOptions& options) {
  std::vector<std::vector<char32_t>> characters(font.glyphs.size());
  for (const auto& [character, glyph] : font.character_map) {
    if (glyph >= 0 && static_cast<std::size_t>(glyph) < characters.size())
      characters[static_cast<std::size_t>(glyph)].push_back(character);
  }
  std::vector<GlyphArea> all(glyphs.size());
  run_jobs(static_cast<int>(glyphs.size()), options, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    const auto id = static_cast<std::size_t>(glyphs[at]);
    all[at] = measured(font, glyphs[at], metrics, location);
    all[at].characters = characters[id];
  });
  std::sort(all.begin(), all.end(), [](const GlyphArea& a, const GlyphArea& b) { return a.name < b.name; });
  return all;
}

std::string baseline_json(const AreaBaseline& baseline) {
  const bool has_all = baseline.metrics == AreaMetrics::All;
  Line out;
  out << text("{\"version\":1,\"unitsPerEm\":", baseline.units_per_em, ",\"metrics\":\"", has_all ? "all" : "area",
              "\"");
  if (baseline.is_selection) out << ",\"selection\":true";
  if (baseline.locations != std::vector<std::string>{""}) out << ",\"locations\":" << Json(baseline.locations).dump();
  const char* separator = ",\n\"tolerances\":{\n";
  for (const auto& [name, tolerance] : baseline.tolerances) {
    Json json = Json::object();
    if (tolerance.percent) json["percent"] = *tolerance.percent;
    if (tolerance.units) json["units"] = *tolerance.units;
    if (tolerance.move) json["move"] = *tolerance.move;
    (out << separator).quoted(name) << ":" << json.dump();
    separator = ",\n";
  }
  if (!baseline.tolerances.empty()) out << "\n}";
  separator = ",\"glyphs\":[\n";
  if (baseline.glyphs.empty()) out << ",\"glyphs\":[";
  for (const GlyphArea& glyph : baseline.glyphs) {
    out << separator << line_of(glyph);
    separator = ",\n";
  }
  out << "\n]}\n";
  return out.take();
}

AreaBaseline parse_baseline(const std::string& json) {
  const Json whole = parse_json(json, most_baseline_bytes);
  ObjectReader object(whole, "");
  AreaBaseline baseline;
  if (object.take_number("version") != 1.0) object.fail("version", "is not one that this version reads");
  const double em = object.take_number("unitsPerEm");
  if (!(em >= 1.0 && em <= 1e6)) object.fail("unitsPerEm", "must be from 1 to 1000000");
  baseline.units_per_em = static_cast<int>(em);
  baseline.metrics =
      object.take_choice("metrics", {"area", "all"}, "area") == "all" ? AreaMetrics::All : AreaMetrics::Area;
  baseline.is_selection = object.take_flag("selection", false);
  if (object.has("locations")) {
    const Json& list = object.take("locations");
    if (!list.is_array() || list.empty() ||
        !std::all_of(list.begin(), list.end(), [](const Json& one) { return one.is_string(); }))
      object.fail("locations", "must be a list of places");
    baseline.locations = list.get<std::vector<std::string>>();
  }
  if (object.has("tolerances")) baseline.tolerances = take_tolerances(object.take("tolerances"));
  const Json& glyphs = object.take("glyphs");
  if (!glyphs.is_array()) object.fail("glyphs", "must be a list");
  for (std::size_t i = 0; i < glyphs.size(); ++i)
    baseline.glyphs.push_back(take_glyph(glyphs[i], text("glyphs[", i, "]"), baseline.metrics));
  object.finish();
  return baseline;
}

std::map<std::string, AreaTolerance> load_tolerances(const std::string& path) {
  return naming_file(path, read_text(path), [](const std::string& text) {
    const Json json = Json::parse(text, nullptr, false);
    const bool has_any = json.is_object() && json.contains("tolerances");
    return has_any ? take_tolerances(json.at("tolerances")) : std::map<std::string, AreaTolerance>{};
  });
}

AreaBaseline load_baseline(const std::string& path) {
  return naming_file(path, read_text(path), [](const std::string& json) { return parse_baseline(json); });
}

}  // namespace glyphs
