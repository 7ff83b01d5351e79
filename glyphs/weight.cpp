#include "glyphs/weight.h"

#include <hb.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/rounding.h"
#include "glyphs/error.h"
#include "glyphs/json_reader.h"
#include "latin_prior.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::LetterClass;
using fontcore::text;
using fontcore::WeightModel;
using Contours = std::vector<BezierContour>;

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts;
  std::size_t from = 0;
  while (from <= list.size()) {
    const std::size_t comma = std::min(list.find(',', from), list.size());
    if (comma > from) parts.push_back(list.substr(from, comma - from));
    from = comma + 1;
  }
  return parts;
}

// The one character a text is, if it is one.
std::optional<char32_t> as_character(const std::string& letter) {
  const auto lead = static_cast<unsigned char>(letter[0]);
  const std::size_t length = lead < 0x80 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
  if (letter.size() != length) return std::nullopt;
  if (length == 1) return lead;
  char32_t character = lead & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i)
    character = (character << 6U) | (static_cast<unsigned char>(letter[i]) & 0x3FU);
  return character;
}

int control_glyph(const Font& font, const std::string& letter) {
  int glyph = -1;
  if (const auto character = as_character(letter)) {
    if (const auto found = font.character_map.find(*character); found != font.character_map.end())
      glyph = found->second;
  }
  if (glyph < 0) glyph = font.find(letter);
  if (glyph < 0) throw RequestError(font.path + ": control letter " + letter + ": there is no such glyph");
  if (!font.has_outline(glyph)) throw RequestError(font.path + ": control letter " + letter + ": it has no outline");
  return glyph;
}

// ---- the model as JSON

// Numbers as short as a tenth of a thousandth of the em needs.
double short_number(double value) { return std::round(value * 1e4) / 1e4; }

Json stroke_json(const WeightModel::Stroke& stroke) {
  return {{"thickness", short_number(stroke.thickness)}, {"growth", short_number(stroke.growth)}};
}

template <typename Nested>
Json list_json(const Nested& list) {
  if constexpr (std::is_arithmetic_v<Nested>) {
    return short_number(list);
  } else {
    Json json = Json::array();
    for (const auto& item : list) json.push_back(list_json(item));
    return json;
  }
}

// Every key once, no other, each of its kind.
class Reader {
 public:
  Reader(const Json& object, std::string where, std::initializer_list<const char*> keys)
      : object_(object), where_(std::move(where)) {
    if (!object.is_object()) fail("an object is expected");
    for (const auto& [key, value] : object.items()) {
      if (std::ranges::none_of(keys, [&, &k = key](const char* known) { return k == known; })) fail(key + ": unknown");
    }
    for (const char* key : keys) {
      if (!object.contains(key)) fail(std::string(key) + ": missing");
    }
  }
  const Json& at(const char* key) const { return object_.at(key); }
  std::string where(const char* key) const { return where_ + ": " + key; }
  double number(const char* key) const { return number_of(at(key), where(key)); }
  const Json& list(const char* key) const {
    if (!at(key).is_array()) throw RequestError(where(key) + ": a list is expected");
    return at(key);
  }
  template <typename Nested>
  void fill(const char* key, Nested& nested) const {
    fill(at(key), where(key), nested);
  }
  static double number_of(const Json& value, const std::string& where) {
    if (!value.is_number() || !std::isfinite(value.get<double>()) || std::abs(value.get<double>()) > 1e6) {
      throw RequestError(where + ": a number of at most a million is expected");
    }
    return value.get<double>();
  }

 private:
  [[noreturn]] void fail(const std::string& why) const { throw RequestError(where_ + ": " + why); }
  template <typename Nested>
  static void fill(const Json& value, const std::string& where, Nested& nested) {
    if constexpr (std::is_arithmetic_v<Nested>) {
      nested = number_of(value, where);
    } else {
      if (!value.is_array() || value.size() != nested.size()) {
        throw RequestError(text(where, ": a list of ", nested.size(), " is expected"));
      }
      for (std::size_t i = 0; i < nested.size(); ++i) fill(value[i], text(where, " ", i), nested[i]);
    }
  }

  const Json& object_;
  std::string where_;
};

WeightModel::Stroke read_stroke(const Json& json, const std::string& where) {
  const Reader reader(json, where, {"thickness", "growth"});
  const WeightModel::Stroke stroke{reader.number("thickness"), reader.number("growth")};
  if (!(stroke.thickness > 0.0)) throw RequestError(where + ": thickness: it must be positive");
  return stroke;
}

std::vector<WeightModel::Zone> read_zones(const Reader& reader, const char* key) {
  std::vector<WeightModel::Zone> zones;
  for (const Json& item : reader.list(key)) {
    const Reader zone(item, text(reader.where(key), " ", zones.size()), {"height", "shift"});
    zones.push_back({zone.number("height"), zone.number("shift")});
    if (zones.size() > 1 && zones[zones.size() - 2].height >= zones.back().height) {
      throw RequestError(reader.where(key) + ": heights must rise");
    }
  }
  return zones;
}

// How much wider letters grow, by name.
std::map<std::string, double> read_letters(const Reader& reader, const char* key) {
  std::map<std::string, double> letters;
  if (!reader.at(key).is_object()) throw RequestError(reader.where(key) + ": an object is expected");
  for (const auto& [name, value] : reader.at(key).items()) {
    letters[name] = Reader::number_of(value, reader.where(key) + ": " + name);
    if (std::abs(letters[name]) > 3.0) throw RequestError(reader.where(key) + ": " + name + ": at most 3 is expected");
  }
  return letters;
}

Json letters_json(const std::map<std::string, double>& letters) {
  Json json = Json::object();
  for (const auto& [name, widening] : letters) json[name] = short_number(widening);
  return json;
}

Json zones_json(const std::vector<WeightModel::Zone>& zones) {
  Json list = Json::array();
  for (const WeightModel::Zone& zone : zones) {
    list.push_back({{"height", short_number(zone.height)}, {"shift", short_number(zone.shift)}});
  }
  return list;
}

constexpr const char* format_name = "glyphwave weight model";
constexpr const char* prior_name = "glyphwave weight prior";
constexpr std::array<const char*, 2> class_names{"lower_case", "capitals"};

fontcore::Box box_of(const Contours& contours) {
  fontcore::Box box;
  for (const BezierContour& contour : contours) box.add(tight_box(contour));
  return box;
}

Contours shifted(const Contours& contours, double dx) {
  Contours result;
  for (const BezierContour& contour : contours) {
    fontcore::Points points = contour.points();
    points.col(0).array() += dx;
    result.push_back(contour.with_points(std::move(points)));
  }
  return result;
}

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

}  // namespace

LetterClass letter_class_of(const Font& font, int glyph) {
  for (const auto& [character, id] : font.character_map) {
    if (id != glyph) continue;
    const hb_unicode_general_category_t category =
        hb_unicode_general_category(hb_unicode_funcs_get_default(), character);
    return category == HB_UNICODE_GENERAL_CATEGORY_LOWERCASE_LETTER ? LetterClass::LowerCase : LetterClass::Capital;
  }
  const auto x = font.character_map.find(U'x');
  if (x == font.character_map.end()) return LetterClass::Capital;
  const fontcore::Box own = box_of(compose(font, glyph));
  const fontcore::Box small = box_of(compose(font, x->second));
  return own.high.y() <= 1.1 * small.high.y() ? LetterClass::LowerCase : LetterClass::Capital;
}

WeightModel learn_weight(const Font& from, const Font& to, const std::string& controls) {
  std::vector<fontcore::WeightPair> pairs;
  fontcore::Affine to_units;
  to_units.linear *= static_cast<double>(from.units_per_em) / to.units_per_em;
  for (const std::string& letter : split(controls)) {
    const int a = control_glyph(from, letter);
    const int b = control_glyph(to, letter);
    fontcore::WeightPair pair;
    pair.name = letter;
    pair.letter_class = letter_class_of(from, a);
    pair.from = compose(from, a);
    for (const BezierContour& contour : compose(to, b)) pair.to.push_back(transform(contour, to_units));
    pair.from_advance = from.glyphs[static_cast<std::size_t>(a)].advance;
    pair.to_advance = to_units.linear(0, 0) * to.glyphs[static_cast<std::size_t>(b)].advance;
    pairs.push_back(std::move(pair));
  }
  if (pairs.empty()) throw RequestError("--control: letters are expected: n,o,H,O");
  return fontcore::learn_weight(pairs, from.units_per_em);
}

std::string weight_json(const WeightModel& model) {
  Json controls = Json::array();
  for (const WeightModel::Control& control : model.controls) {
    controls.push_back({{"name", control.name},
                        {"used", control.used},
                        {"thickness_error", short_number(control.thickness_error)},
                        {"width_error", short_number(control.width_error)}});
  }
  Json json = {{"format", format_name},
               {"version", 1},
               {"unit", "em/1000"},
               {"directions", list_json(WeightModel::directions)},
               {"thicknesses", list_json(WeightModel::thicknesses)},
               {"widths", list_json(WeightModel::widths)}};
  for (std::size_t c = 0; c < 2; ++c) {
    const WeightModel::Letters& letters = model.letters[c];
    json[class_names[c]] = {{"upright", stroke_json(letters.upright)},
                            {"level", stroke_json(letters.level)},
                            {"counter", short_number(letters.counter)},
                            {"counter_growth", short_number(letters.counter_growth)},
                            {"counter_slope", short_number(letters.counter_slope)},
                            {"spread", short_number(letters.spread)},
                            {"serif", short_number(letters.serif)},
                            {"room", short_number(letters.room)},
                            {"left_side", short_number(letters.left_side)},
                            {"right_side", short_number(letters.right_side)},
                            {"correction", list_json(letters.correction)},
                            {"deviation", list_json(letters.deviation)},
                            {"counter_correction", list_json(letters.counter_correction)}};
  }
  json["top"] = zones_json(model.top);
  json["bottom"] = zones_json(model.bottom);
  json["widening"] = letters_json(model.widening);
  json["controls"] = controls;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

WeightModel parse_weight(const std::string& source, const std::string& name) {
  const Json json = naming_file(name, source, [](const std::string& file) { return parse_json(file); });
  const Reader reader(json, name,
                      {"format", "version", "unit", "directions", "thicknesses", "widths", class_names[0],
                       class_names[1], "top", "bottom", "widening", "controls"});
  if (reader.at("format") != format_name || reader.at("version") != 1 || reader.at("unit") != "em/1000") {
    throw RequestError(name + ": no weight model of this version");
  }
  const auto expect = [&](const char* key, const auto& nodes) {
    auto given = nodes;
    reader.fill(key, given);
    if (given != nodes) throw RequestError(reader.where(key) + ": other places than those of this version");
  };
  expect("directions", WeightModel::directions);
  expect("thicknesses", WeightModel::thicknesses);
  expect("widths", WeightModel::widths);
  WeightModel model;
  for (std::size_t c = 0; c < 2; ++c) {
    const Reader own(reader.at(class_names[c]), reader.where(class_names[c]),
                     {"upright", "level", "counter", "counter_growth", "counter_slope", "spread", "serif", "room",
                      "left_side", "right_side", "correction", "deviation", "counter_correction"});
    WeightModel::Letters& letters = model.letters[c];
    letters.upright = read_stroke(own.at("upright"), own.where("upright"));
    letters.level = read_stroke(own.at("level"), own.where("level"));
    letters.counter = own.number("counter");
    letters.counter_growth = own.number("counter_growth");
    letters.counter_slope = own.number("counter_slope");
    letters.spread = own.number("spread");
    letters.serif = own.number("serif");
    letters.room = own.number("room");
    letters.left_side = own.number("left_side");
    letters.right_side = own.number("right_side");
    own.fill("correction", letters.correction);
    own.fill("deviation", letters.deviation);
    own.fill("counter_correction", letters.counter_correction);
  }
  model.top = read_zones(reader, "top");
  model.bottom = read_zones(reader, "bottom");
  model.widening = read_letters(reader, "widening");
  for (const Json& item : reader.list("controls")) {
    const Reader control(item, text(reader.where("controls"), " ", model.controls.size()),
                         {"name", "used", "thickness_error", "width_error"});
    if (!control.at("name").is_string()) throw RequestError(control.where("name") + ": a text is expected");
    if (!control.at("used").is_boolean()) throw RequestError(control.where("used") + ": true or false is expected");
    model.controls.push_back({control.at("name").get<std::string>(), control.number("thickness_error"),
                              control.number("width_error"), control.at("used").get<bool>()});
  }
  return model;
}

int ReweightResult::changed() const {
  return static_cast<int>(std::ranges::count_if(glyphs, &ReweightedGlyph::changed));
}

int ReweightResult::refused() const {
  return static_cast<int>(std::ranges::count_if(glyphs, [](const ReweightedGlyph& g) { return !g.refused.empty(); }));
}

namespace {

constexpr double even_contrast = 0.3;  // level strokes thinner than upright ones by more than this share are contrasted

bool is_contrasted(const WeightModel& model) {
  const WeightModel::Letters& letters = model.letters[0];
  return 1.0 - letters.level.thickness / letters.upright.thickness > even_contrast;
}

double width_of(const Contours& contours) {
  const fontcore::Box box = box_of(contours);
  return box.is_empty() ? 0.0 : box.high.x() - box.low.x();
}

// The widening of a glyph by its characters, the first that has one.
double widening_of(const Font& font, int glyph, const WeightModel& model) {
  for (const auto& [letter, widening] : model.widening) {
    const auto character = as_character(letter);
    if (!character) continue;
    const auto found = font.character_map.find(*character);
    if (found != font.character_map.end() && found->second == glyph) return widening;
  }
  return 0.0;
}

}  // namespace

WeightPrior learn_prior(const std::vector<WeightFamily>& families, const std::string& controls) {
  const std::string alphabet = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
  const std::vector<std::string> seen = split(controls);
  std::array<std::map<std::string, std::vector<double>>, 2> missing;
  std::array<int, 2> count{};
  WeightPrior prior;
  for (const WeightFamily& family : families) {
    const WeightModel model = learn_weight(family.from, family.to, controls);
    const auto kind = static_cast<std::size_t>(is_contrasted(model) ? 1 : 0);
    const double to_units = static_cast<double>(family.from.units_per_em) / family.to.units_per_em;
    for (const char character : alphabet) {
      const std::string letter(1, character);
      if (std::ranges::find(seen, letter) != seen.end()) continue;
      const auto from = family.from.character_map.find(static_cast<char32_t>(character));
      const auto to = family.to.character_map.find(static_cast<char32_t>(character));
      if (from == family.from.character_map.end() || to == family.to.character_map.end()) continue;
      const LetterClass letter_class = letter_class_of(family.from, from->second);
      const fontcore::Weighted made =
          apply_weight(compose(family.from, from->second), letter_class, model, family.from.units_per_em);
      const double growth = model.letters[letter_class == LetterClass::Capital ? 1 : 0].upright.growth *
                            family.from.units_per_em / 1000.0;
      if (made.amount != 1.0 || growth <= 0.0) continue;
      missing[kind][letter].push_back((to_units * width_of(compose(family.to, to->second)) - width_of(made.contours)) /
                                      growth);
    }
    ++count[kind];
    prior.families.push_back(family.name);
  }
  for (const std::size_t kind : {std::size_t{0}, std::size_t{1}}) {
    const double sure = count[kind] / (count[kind] + 2.0) * (kind == 1 ? 1.0 / 3.0 : 1.0);
    for (auto& [letter, list] : missing[kind]) {
      if (list.size() < 2) continue;
      std::ranges::sort(list);
      const std::size_t half = list.size() / 2;
      const double median = list.size() % 2 == 1 ? list[half] : 0.5 * (list[half - 1] + list[half]);
      (kind == 1 ? prior.contrasted : prior.even)[letter] = std::round(1e3 * sure * median) / 1e3;
    }
  }
  return prior;
}

std::string prior_json(const WeightPrior& prior) {
  const Json json = {{"format", prior_name},
                     {"version", 1},
                     {"families", prior.families},
                     {"even", letters_json(prior.even)},
                     {"contrasted", letters_json(prior.contrasted)}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

WeightPrior parse_prior(const std::string& source, const std::string& name) {
  const Json json = naming_file(name, source, [](const std::string& file) { return parse_json(file); });
  const Reader reader(json, name, {"format", "version", "families", "even", "contrasted"});
  if (reader.at("format") != prior_name || reader.at("version") != 1) {
    throw RequestError(name + ": no weight prior of this version");
  }
  WeightPrior prior;
  for (const Json& family : reader.list("families")) {
    if (!family.is_string()) throw RequestError(reader.where("families") + ": texts are expected");
    prior.families.push_back(family.get<std::string>());
  }
  prior.even = read_letters(reader, "even");
  prior.contrasted = read_letters(reader, "contrasted");
  return prior;
}

WeightPrior latin_prior() { return parse_prior(latin_prior_json, "latin.json"); }

void take_prior(WeightModel& model, const WeightPrior& prior) {
  model.widening = is_contrasted(model) ? prior.contrasted : prior.even;
  for (const WeightModel::Control& control : model.controls) {
    if (control.used) model.widening.erase(control.name);
  }
}

Contours reweight_glyph(const Font& font, int id, const WeightModel& model, const ReweightOptions& options,
                        ReweightedGlyph& report) {
  const Glyph& glyph = font.glyphs.at(static_cast<std::size_t>(id));
  report.glyph = id;
  report.name = glyph.name;
  const Contours& outline = glyph.contours;
  try {
    if (!glyph.trouble.empty()) {
      report.refused = glyph.trouble;
      return outline;
    }
    report.area_before = report.area_after = signed_area(outline);
    if (outline.empty() || options.amount == 0.0) return outline;
    const auto before = find_crossings(outline);
    const fontcore::Ink ink = measure_ink(outline, before);
    report.crossings_before = report.crossings_after = static_cast<int>(before.size());
    const double italic_angle = options.italic_angle * std::numbers::pi / 180.0;
    const LetterClass letter_class = letter_class_of(font, id);
    const double widening = widening_of(font, id, model);
    // Whole numbers may add what the step itself did not: less of it then.
    for (const double share : {1.0, 0.98, 0.95, 0.9, 0.8, 0.65, 0.5}) {
      const fontcore::Weighted weighted =
          apply_weight(outline, letter_class, model, font.units_per_em,
                       {.amount = share * options.amount, .widening = widening, .italic_angle = italic_angle});
      if (weighted.amount == 0.0) break;
      const fontcore::Box old = box_of(outline);
      const fontcore::Box box = box_of(weighted.contours);
      // The advance stays: what is wider stands in the middle of where it stood.
      const double dx = 0.5 * (old.low.x() + old.high.x() - box.low.x() - box.high.x());
      Contours rounded = in_whole_numbers(shifted(weighted.contours, dx), outline, italic_angle);
      const auto after = find_crossings(rounded);
      if (added_crossings(before, after) > 0) continue;
      const fontcore::Ink now = measure_ink(rounded, after);
      if (!closed_counters(ink, now).empty()) continue;
      if (options.amount > 0.0 ? now.area < ink.area : now.area > ink.area) continue;
      report.changed = rounded != outline;
      report.amount = weighted.amount;
      report.held_segments = weighted.held_segments;
      report.crossings_after = static_cast<int>(after.size());
      report.area_after = signed_area(rounded);
      return rounded;
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
  if (!(options.amount >= -1.0 && options.amount <= 2.0)) {
    throw RequestError(text("--amount ", options.amount, ": it goes from -1 to 2"));
  }
  if (options.amount != 0.0) refuse_at_fault(font);
  std::vector<int> selected;
  for (const Glyph& glyph : font.glyphs) {
    if (options.only && !std::ranges::binary_search(*options.only, glyph.id)) continue;
    if (!glyph.contours.empty() || !glyph.trouble.empty()) selected.push_back(glyph.id);
  }
  std::vector<Contours> outlines(selected.size());
  ReweightResult result;
  result.glyphs.resize(selected.size());
  run_jobs(static_cast<int>(selected.size()), options.jobs, [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    outlines[k] = reweight_glyph(font, selected[k], model, options, result.glyphs[k]);
  });
  EditedGlyphs edited;
  for (std::size_t k = 0; k < selected.size(); ++k) {
    if (result.glyphs[k].changed) edited.emplace(selected[k], std::move(outlines[k]));
  }
  result.font = write_font(font, edited, {.is_checked = options.amount != 0.0});
  for (ReweightedGlyph& report : result.glyphs) {
    if (const auto emptied = result.font.emptied.find(report.glyph); emptied != result.font.emptied.end())
      report.refused = text("comes out empty: ", emptied->second);
    if (std::ranges::binary_search(result.font.dropped_instructions, report.glyph))
      report.dropped.emplace_back("instructions: they were made for the points that were");
    if (std::ranges::binary_search(result.font.dropped_hints, report.glyph))
      report.dropped.emplace_back("hints: they were made for the points that were");
  }
  return result;
}

std::string reweight_json(const Font& font, const ReweightOptions& options, const ReweightResult& result) {
  const auto names = [&](const std::vector<int>& ids) { return glyph_names(font, ids); };
  Json json = {{"version", 1},
               {"unitsPerEm", font.units_per_em},
               {"amount", options.amount},
               {"changed", result.changed()},
               {"refused", result.refused()},
               {"changed_tables", result.font.changed_tables},
               {"dropped_tables", result.font.dropped_tables},
               {"moved_composites", names(result.font.moved_composites)},
               {"dropped_instructions", names(result.font.dropped_instructions)},
               {"dropped_hints", names(result.font.dropped_hints)},
               {"warnings", result.font.warnings},
               {"glyphs", Json::array()}};
  for (const ReweightedGlyph& report : result.glyphs) {
    Json glyph = {{"name", report.name},
                  {"glyph", report.glyph},
                  {"changed", report.changed},
                  {"amount", report.amount},
                  {"area_before", report.area_before},
                  {"area_after", report.area_after},
                  {"crossings_before", report.crossings_before},
                  {"crossings_after", report.crossings_after},
                  {"held_segments", report.held_segments},
                  {"dropped", report.dropped}};
    if (!report.refused.empty()) glyph["refused"] = report.refused;
    json["glyphs"].push_back(std::move(glyph));
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace glyphs
