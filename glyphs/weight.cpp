#include "glyphs/weight.h"

#include <hb.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "fontcore/measure.h"
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

// A finite number, of a size that no model has.
double sized(const ObjectReader& reader, const std::string& key, const Json& value) {
  if (!value.is_number() || !std::isfinite(value.get<double>()) || std::abs(value.get<double>()) > 1e6) {
    reader.fail(key, "must be a number of at most a million");
  }
  return value.get<double>();
}
double take_sized(ObjectReader& reader, const std::string& key) { return sized(reader, key, reader.take(key)); }

template <typename Nested>
void fill(const ObjectReader& reader, const std::string& key, const Json& value, Nested& nested) {
  if constexpr (std::is_arithmetic_v<Nested>) {
    nested = sized(reader, key, value);
  } else {
    if (!value.is_array() || value.size() != nested.size()) {
      reader.fail(key, text("must be a list of ", nested.size()));
    }
    for (std::size_t i = 0; i < nested.size(); ++i) fill(reader, text(key, "[", i, "]"), value[i], nested[i]);
  }
}
template <typename Nested>
void take_nested(ObjectReader& reader, const std::string& key, Nested& nested) {
  fill(reader, key, reader.take(key), nested);
}

const Json& take_list(ObjectReader& reader, const std::string& key) {
  const Json& value = reader.take(key);
  if (!value.is_array()) reader.fail(key, "must be a list");
  return value;
}

WeightModel::Stroke take_stroke(ObjectReader& letters, const std::string& key) {
  ObjectReader reader(letters.take(key), letters.where(key));
  const WeightModel::Stroke stroke{take_sized(reader, "thickness"), take_sized(reader, "growth")};
  if (!(stroke.thickness > 0.0)) reader.fail("thickness", "must be positive");
  reader.finish();
  return stroke;
}

std::vector<WeightModel::Zone> take_zones(ObjectReader& model, const std::string& key) {
  std::vector<WeightModel::Zone> zones;
  for (const Json& item : take_list(model, key)) {
    ObjectReader zone(item, model.where(text(key, "[", zones.size(), "]")));
    zones.push_back({take_sized(zone, "height"), take_sized(zone, "shift")});
    zone.finish();
    if (zones.size() > 1 && zones[zones.size() - 2].height >= zones.back().height) {
      model.fail(key, "heights must rise");
    }
  }
  return zones;
}

// How much wider letters grow, by name.
std::map<std::string, double> take_letters(ObjectReader& reader, const std::string& key) {
  std::map<std::string, double> letters;
  const Json& object = reader.take(key);
  if (!object.is_object()) reader.fail(key, "must be an object");
  for (const auto& [name, value] : object.items()) {
    letters[name] = sized(reader, key + "." + name, value);
    if (std::abs(letters[name]) > 3.0) reader.fail(key + "." + name, "must be at most 3");
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

Contours shifted(const Contours& contours, double dx) {
  Contours result;
  for (const BezierContour& contour : contours) {
    fontcore::Points points = contour.points();
    points.col(0).array() += dx;
    result.push_back(contour.with_points(std::move(points)));
  }
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
  const fontcore::Box own = tight_box(compose(font, glyph));
  const fontcore::Box small = tight_box(compose(font, x->second));
  return own.high.y() <= 1.1 * small.high.y() ? LetterClass::LowerCase : LetterClass::Capital;
}

namespace {

std::vector<fontcore::WeightPair> pairs_of(const Font& from, const Font& to, const std::string& letters) {
  std::vector<fontcore::WeightPair> pairs;
  fontcore::Affine to_units;
  to_units.linear *= static_cast<double>(from.units_per_em) / to.units_per_em;
  for (const std::string& letter : split(letters)) {
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
  return pairs;
}

}  // namespace

WeightModel learn_weight(const Font& from, const Font& to, const std::string& controls) {
  const std::vector<fontcore::WeightPair> pairs = pairs_of(from, to, controls);
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

namespace {

WeightModel read_weight(const std::string& source) {
  const Json json = parse_json(source);
  ObjectReader reader(json, "");
  if (reader.take("format") != format_name || reader.take("version") != 1 || reader.take("unit") != "em/1000") {
    reader.fail("format", "no weight model of this version");
  }
  const auto expect = [&](const char* key, const auto& nodes) {
    auto given = nodes;
    take_nested(reader, key, given);
    if (given != nodes) reader.fail(key, "must be the places of this version");
  };
  expect("directions", WeightModel::directions);
  expect("thicknesses", WeightModel::thicknesses);
  expect("widths", WeightModel::widths);
  WeightModel model;
  for (std::size_t c = 0; c < 2; ++c) {
    ObjectReader own(reader.take(class_names[c]), class_names[c]);
    WeightModel::Letters& letters = model.letters[c];
    letters.upright = take_stroke(own, "upright");
    letters.level = take_stroke(own, "level");
    letters.counter = take_sized(own, "counter");
    letters.counter_growth = take_sized(own, "counter_growth");
    letters.counter_slope = take_sized(own, "counter_slope");
    letters.spread = take_sized(own, "spread");
    letters.serif = take_sized(own, "serif");
    letters.room = take_sized(own, "room");
    letters.left_side = take_sized(own, "left_side");
    letters.right_side = take_sized(own, "right_side");
    take_nested(own, "correction", letters.correction);
    take_nested(own, "deviation", letters.deviation);
    take_nested(own, "counter_correction", letters.counter_correction);
    own.finish();
  }
  model.top = take_zones(reader, "top");
  model.bottom = take_zones(reader, "bottom");
  model.widening = take_letters(reader, "widening");
  for (const Json& item : take_list(reader, "controls")) {
    ObjectReader control(item, text("controls[", model.controls.size(), "]"));
    WeightModel::Control& read = model.controls.emplace_back();
    if (!control.has("name")) control.fail("name", "is missing");
    read.name = control.take_text("name", "");
    if (!control.has("used")) control.fail("used", "is missing");
    read.used = control.take_flag("used", true);
    read.thickness_error = take_sized(control, "thickness_error");
    read.width_error = take_sized(control, "width_error");
    control.finish();
  }
  reader.finish();
  return model;
}

WeightPrior read_prior(const std::string& source) {
  const Json json = parse_json(source);
  ObjectReader reader(json, "");
  if (reader.take("format") != prior_name || reader.take("version") != 1) {
    reader.fail("format", "no weight prior of this version");
  }
  WeightPrior prior;
  for (const Json& family : take_list(reader, "families")) {
    if (!family.is_string()) reader.fail("families", "must be strings");
    prior.families.push_back(family.get<std::string>());
  }
  prior.even = take_letters(reader, "even");
  prior.contrasted = take_letters(reader, "contrasted");
  reader.finish();
  return prior;
}

}  // namespace

WeightModel parse_weight(const std::string& source, const std::string& name) {
  return naming_file(name, source, read_weight);
}

namespace {

constexpr double even_contrast = 0.3;  // level strokes thinner than upright ones by more than this share are contrasted

bool is_contrasted(const WeightModel& model) {
  const WeightModel::Letters& letters = model.letters[0];
  return 1.0 - letters.level.thickness / letters.upright.thickness > even_contrast;
}

double width_of(const Contours& contours) {
  const fontcore::Box box = tight_box(contours);
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
  return naming_file(name, source, read_prior);
}

WeightPrior latin_prior() { return parse_prior(latin_prior_json, "latin.json"); }

void take_prior(WeightModel& model, const WeightPrior& prior) {
  model.widening = is_contrasted(model) ? prior.contrasted : prior.even;
  for (const WeightModel::Control& control : model.controls) {
    if (control.used) model.widening.erase(control.name);
  }
}

namespace {

constexpr double least_amount = -1.0;
constexpr double most_amount = 2.0;

double checked(const char* option, double amount) {
  if (amount >= least_amount && amount <= most_amount) return amount;
  throw RequestError(text(option, " ", amount, ": it goes from -1 to 2"));
}

// What a font has of letters that are looked at, of one class.
std::vector<Contours> drawn_letters(const Font& font, const std::string& letters) {
  std::vector<Contours> drawn;
  for (const std::string& letter : split(letters)) drawn.push_back(compose(font, control_glyph(font, letter)));
  return drawn;
}

}  // namespace

fontcore::WeightAmounts amounts_in(const Font& font, const WeightModel& model, const WeightStrength& strength) {
  fontcore::WeightAmounts amounts;
  amounts.x = strength.x ? checked("--amount-x", *strength.x) : checked("--amount", strength.amount);
  amounts.y = strength.y ? checked("--amount-y", *strength.y) : checked("--amount", strength.amount);
  if (strength.stems.upright || strength.stems.level) {
    try {
      const fontcore::WeightAmounts found = amounts_for_stems(drawn_letters(font, "n,o"), LetterClass::LowerCase, model,
                                                              font.units_per_em, strength.stems);
      amounts.x = found.x;
      amounts.y = found.y;
    } catch (const fontcore::InvalidInput& error) {
      throw RequestError(font.path + ": stems of n and o: " + error.what());
    }
  }
  if (strength.thin) amounts.thin = checked("--amount-thin", *strength.thin);
  if (strength.serif) amounts.serif = checked("--amount-serif", *strength.serif);
  return amounts;
}

WeightModel carry_weight(const Font& font, const WeightModel& model, const Font* drawn) {
  constexpr const char* drawn_letters = "n,o";
  constexpr const char* others = "H,O";
  std::vector<fontcore::WeightPair> letters = pairs_of(font, drawn != nullptr ? *drawn : font, drawn_letters);
  for (fontcore::WeightPair& letter : pairs_of(font, font, others)) {
    letter.to.clear();
    letters.push_back(std::move(letter));
  }
  if (drawn == nullptr) {
    for (fontcore::WeightPair& letter : letters) letter.to.clear();
  }
  try {
    return fontcore::carry_weight(model, letters, font.units_per_em);
  } catch (const fontcore::InvalidInput& error) {
    throw RequestError(font.path + ": n, o, H and O: " + error.what());
  }
}

bool is_nothing(const fontcore::WeightAmounts& amounts) {
  return amounts.x == 0.0 && amounts.y == 0.0 && amounts.thin.value_or(0.0) == 0.0 &&
         amounts.serif.value_or(0.0) == 0.0;
}

fontcore::Weighted apply_weight(const Font& font, int glyph, const Contours& contours, const WeightModel& model,
                                const fontcore::WeightAmounts& amounts, const GlyphWeight& options) {
  fontcore::Weighted weighted = apply_weight(contours, letter_class_of(font, glyph), model, font.units_per_em,
                                             {.amount = options.share,
                                              .amounts = amounts,
                                              .widening = widening_of(font, glyph, model),
                                              .italic_angle = options.italic_angle,
                                              .detail_scale = options.detail_scale});
  if (weighted.amount == 0.0) return weighted;
  const fontcore::Box old = tight_box(contours);
  const fontcore::Box box = tight_box(weighted.contours);
  weighted.contours = shifted(weighted.contours, 0.5 * (old.low.x() + old.high.x() - box.low.x() - box.high.x()));
  return weighted;
}

}  // namespace glyphs
