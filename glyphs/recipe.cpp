#include "glyphs/recipe.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "glyphs/detail_library.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/json_reader.h"

namespace glyphs {

namespace {

using fontcore::Point;
using fontcore::text;

Step read_sweep(ObjectReader& reader) {
  SweepStep step;
  if (reader.has("handles")) {
    const Json& handles = reader.take("handles");
    if (!handles.is_array() || handles.empty()) reader.fail("handles", "must be a list of {\"near\", \"move\"}");
    for (std::size_t k = 0; k < handles.size(); ++k) {
      ObjectReader one(handles[k], reader.where(text("handles[", k, "]")));
      SweepHandle handle;
      handle.near = one.take_point("near");
      handle.move = one.take_point("move");
      one.finish();
      step.more.push_back(handle);
    }
    step.near = step.more.front().near;
    step.move = step.more.front().move;
    step.more.erase(step.more.begin());
  } else {
    step.near = reader.take_point("near");
    step.move = reader.take_point("move");
  }
  if (reader.has("level")) {
    step.level = reader.take_number("level");
    if (!(*step.level >= 0.0)) reader.fail("level", "must not be negative");
    const std::string grip = reader.take_choice("grip", {"curve", "control point"}, "curve");
    if (grip == "control point") step.grip = fontcore::Grip::ControlPoint;
    if (!step.more.empty()) reader.fail("level", "goes with one handle, several take a breadth");
  } else {
    step.breadth = reader.take_number("breadth");
    if (!(step.breadth > 0.0)) reader.fail("breadth", "must be positive");
  }
  step.pin = reader.take_flag("pin", false);
  const std::string detail = reader.take_choice("detail", {"xy", "tangent", "scaled tangent"}, "xy");
  if (detail == "tangent") step.detail = fontcore::DetailFrame::Tangent;
  if (detail == "scaled tangent") step.detail = fontcore::DetailFrame::ScaledTangent;
  if (detail != "xy" && !step.more.empty()) reader.fail("detail", "turns with one handle, not with several");
  return step;
}

Step read_smooth(ObjectReader& reader) {
  SmoothStep step;
  step.scale = reader.take_number("scale");
  if (!(step.scale >= 0.0)) reader.fail("scale", "must not be negative");
  if (reader.take_choice("by", {"energy", "level"}, "energy") == "level") step.by = fontcore::SmoothBy::Level;
  return step;
}

Step read_equalize(ObjectReader& reader) {
  EqualizeStep step;
  const Json& bands = reader.take("bands");
  if (!bands.is_object()) reader.fail("bands", "must be an object: {\"20\": 0.5, \"80\": 1.3}");
  for (const auto& [key, gain] : bands.items()) {
    fontcore::Band band;
    const auto [end, status] = std::from_chars(key.data(), key.data() + key.size(), band.scale);
    if (status != std::errc() || end != key.data() + key.size() || !(band.scale > 0.0) || !std::isfinite(band.scale)) {
      reader.fail("bands." + key, "a band is named by a length");
    }
    if (!step.bands.empty() && band.scale <= step.bands.back().scale) reader.fail("bands." + key, "lengths must rise");
    if (!gain.is_number() || gain.get<double>() < 0.0) reader.fail("bands." + key, "a gain is a number from 0");
    band.gain = gain.get<double>();
    step.bands.push_back(band);
  }
  return step;
}

Step read_soften(ObjectReader& reader) {
  SoftenStep step;
  step.radius = reader.take_number("radius");
  if (!(step.radius >= 0.0)) reader.fail("radius", "must not be negative");
  if (!reader.has("corners")) return step;
  if (!reader.has("contour")) reader.fail("corners", "are points of one contour; \"contour\" is missing");
  const Json& corners = reader.take("corners");
  if (!corners.is_array()) reader.fail("corners", "must be a list of point numbers");
  step.corners.emplace();
  for (const Json& number : corners) {
    if (!number.is_number_integer() || number.get<std::int64_t>() < 0 || number.get<std::int64_t>() > 65535) {
      reader.fail("corners", "a point number is a whole number from 0");
    }
    step.corners->push_back(number.get<int>());
  }
  return step;
}

Step read_character(ObjectReader& reader) {
  CharacterStep step;
  step.library_path = reader.take_text("library", "");
  if (step.library_path.empty()) reader.fail("library", "must name a library of detail");
  if (reader.has("gain")) step.gain = reader.take_number("gain");
  step.adds = reader.take_flag("add", false);
  step.mirrors = reader.take_flag("mirror", false);
  step.spares_lines = reader.take_choice("straights", {"lay", "spare"}, "lay") == "spare";
  step.holds_joins = reader.take_choice("joins", {"lay", "hold"}, "lay") == "hold";
  return step;
}

Step read_repeat(ObjectReader& reader) {
  RepeatStep step;
  step.library_path = reader.take_text("library", "");
  if (step.library_path.empty()) reader.fail("library", "must name an edit");
  if (reader.has("within")) step.within = reader.take_number("within");
  if (!(step.within > 0.0) || step.within > 1000.0) reader.fail("within", "must be positive, and at most 1000");
  step.mirrors = reader.take_flag("mirror", true);
  step.turns = reader.take_flag("turn", false);
  if (reader.has("sizes")) {
    const fontcore::Point sizes = reader.take_point("sizes");
    step.smallest = sizes.x();
    step.largest = sizes.y();
    if (!(step.smallest >= 0.01) || !(step.largest >= step.smallest) || step.largest > 100.0)
      reader.fail("sizes", "must be the smallest and the largest, from 0.01 to 100");
  }
  return step;
}

Step read_weight(ObjectReader& reader) {
  WeightStep step;
  step.model_path = reader.take_text("model", "");
  if (step.model_path.empty()) reader.fail("model", "must name a weight model");
  if (reader.has("contour")) reader.fail("contour", "weight is of a whole glyph");
  const auto share = [&](const char* key) {
    const double amount = reader.take_number(key);
    if (!(amount >= -1.0 && amount <= 2.0)) reader.fail(key, "must be from -1 to 2");
    return amount;
  };
  const auto thickness = [&](const char* key) {
    const double units = reader.take_number(key);
    if (!(units > 0.0)) reader.fail(key, "must be positive");
    return units;
  };
  step.carries = reader.take_flag("carry", false);
  WeightStrength& strength = step.strength;
  if (reader.has("amount")) strength.amount = share("amount");
  if (reader.has("amount_x")) strength.x = share("amount_x");
  if (reader.has("amount_y")) strength.y = share("amount_y");
  if (reader.has("amount_thin")) strength.thin = share("amount_thin");
  if (reader.has("amount_serif")) strength.serif = share("amount_serif");
  if (reader.has("stem_x")) strength.stems.upright = thickness("stem_x");
  if (reader.has("stem_y")) strength.stems.level = thickness("stem_y");
  if (reader.has("detail")) step.detail_scale = thickness("detail");
  step.advance = advance_policy(reader.take_choice("advance", {"keep", "sidebearings", "scale", "learnt"}, "keep"));
  return step;
}

Step read_step(const Json& json, const std::string& path) {
  ObjectReader reader(json, path);
  if (!reader.has("op")) reader.fail("op", "is missing");
  const std::string op =
      reader.take_choice("op", {"sweep", "smooth", "equalize", "soften", "character", "repeat", "weight"}, "");
  Step step = op == "sweep"      ? read_sweep(reader)
              : op == "smooth"   ? read_smooth(reader)
              : op == "equalize" ? read_equalize(reader)
              : op == "soften"   ? read_soften(reader)
              : op == "repeat"   ? read_repeat(reader)
              : op == "weight"   ? read_weight(reader)
                                 : read_character(reader);
  const std::string glyph = reader.take_text("glyph", "");
  const std::optional<int> contour = reader.take_contour();
  std::visit(
      [&](auto& any) {
        any.glyph = glyph;
        any.contour = contour;
      },
      step);
  reader.finish();
  return step;
}

Freeze read_freeze(const Json& json, const std::string& path) {
  ObjectReader reader(json, path);
  Freeze freeze;
  freeze.glyph = reader.take_text("glyph", "");
  freeze.contour = reader.take_contour();
  if (reader.has("box")) {
    const Json& box = reader.take("box");
    const bool fits = box.is_array() && box.size() == 4 &&
                      std::all_of(box.begin(), box.end(), [](const Json& number) { return number.is_number(); });
    if (!fits) reader.fail("box", "must be four numbers, [left, bottom, right, top]");
    freeze.box.emplace();
    freeze.box->add(Point(box[0].get<double>(), box[1].get<double>()));
    freeze.box->add(Point(box[2].get<double>(), box[3].get<double>()));
  } else {
    const Point from = reader.take_point("from");
    freeze.stretch.emplace(from, reader.take_point("to"));
  }
  reader.finish();
  return freeze;
}

Keep read_keep(const Json& json) {
  ObjectReader reader(json, "keep");
  Keep keep;
  keep.corners = reader.take_flag("corners", true);
  keep.lines = reader.take_flag("lines", true);
  keep.smooth_joins = reader.take_flag("smooth_joins", true);
  keep.extrema = reader.take_flag("extrema", true);
  if (reader.has("zones")) {
    const Json& zones = reader.take("zones");
    keep.zones_auto = zones == "auto" || zones == true;
    if (zones.is_array()) {
      for (const Json& height : zones) {
        if (!height.is_number()) reader.fail("zones", "heights must be numbers");
        keep.zones.push_back(height.get<double>());
      }
    } else if (!keep.zones_auto && zones != false) {
      reader.fail("zones", "must be \"auto\", false or a list of heights");
    }
  }
  const std::string area = reader.take_choice("area", {"glyph", "contour", "none"}, "glyph");
  keep.area = area == "glyph" ? KeepArea::Glyph : area == "contour" ? KeepArea::Contour : KeepArea::None;
  keep.length = reader.take_flag("length", false);
  if (reader.has("italic_angle")) {
    keep.italic_angle = reader.take_number("italic_angle");
    if (!(std::abs(keep.italic_angle) <= 60.0)) reader.fail("italic_angle", "must be from -60 to 60 degrees");
  }
  if (reader.has("freeze")) {
    const Json& freeze = reader.take("freeze");
    if (!freeze.is_array()) reader.fail("freeze", "must be a list");
    for (std::size_t k = 0; k < freeze.size(); ++k) {
      keep.freeze.push_back(read_freeze(freeze[k], text("keep.freeze[", k, "]")));
    }
  }
  reader.finish();
  return keep;
}

Recipe read_recipe(const std::string& json) {
  const Json root = parse_json(json);
  ObjectReader reader(root, "");
  Recipe recipe;
  recipe.lengths_in_thousandths = reader.take_choice("unit", {"unit", "em/1000"}, "unit") == "em/1000";
  recipe.glyphs = reader.take_text("glyphs", "");
  const Json& steps = reader.take("steps");
  if (!steps.is_array()) reader.fail("steps", "must be a list");
  for (std::size_t k = 0; k < steps.size(); ++k) recipe.steps.push_back(read_step(steps[k], text("steps[", k, "]")));
  if (reader.has("keep")) recipe.keep = read_keep(reader.take("keep"));
  if (reader.has("emit")) {
    ObjectReader emit(reader.take("emit"), "emit");
    if (emit.take_choice("mode", {"structure", "compact"}, "structure") == "compact") {
      recipe.emission = Emission::Compact;
    }
    if (emit.has("tolerance")) recipe.tolerance = emit.take_number("tolerance");
    if (!(recipe.tolerance > 0.0)) emit.fail("tolerance", "must be positive");
    if (emit.has("points")) {
      const Json& points = emit.take("points");
      if (!points.is_number_integer() || points.get<std::int64_t>() < 1 || points.get<std::int64_t>() > 65535) {
        emit.fail("points", "is the most that a glyph may have: a whole number from 1 to 65535");
      }
      recipe.most_points = points.get<int>();
    }
    if (emit.take_choice("composites", {"refuse", "decompose"}, "refuse") == "decompose") {
      recipe.composites = Composites::Decompose;
    }
    emit.finish();
  }
  const std::string crossing = reader.take_choice("on_crossing", {"reduce", "refuse", "allow"}, "reduce");
  recipe.on_crossing = crossing == "reduce"   ? OnCrossing::Reduce
                       : crossing == "refuse" ? OnCrossing::Refuse
                                              : OnCrossing::Allow;
  if (reader.has("seed")) {
    const Json& seed = reader.take("seed");
    if (!seed.is_number_unsigned()) reader.fail("seed", "must be a whole number from 0");
    recipe.seed = seed.get<std::uint64_t>();
  }
  reader.finish();
  return recipe;
}

}  // namespace

Recipe parse_recipe(const std::string& json, const std::string& name) { return naming_file(name, json, read_recipe); }

Recipe load_recipe(const std::string& path) {
  Recipe recipe = parse_recipe(read_text(path), path);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  for (Step& step : recipe.steps) {
    auto* const character = std::get_if<CharacterStep>(&step);
    if (character != nullptr) character->library = load_library(folder / character->library_path);
    auto* const repeat = std::get_if<RepeatStep>(&step);
    if (repeat != nullptr) repeat->edit = load_edit(folder / repeat->library_path);
    if (auto* const weight = std::get_if<WeightStep>(&step)) {
      const std::string model = folder / weight->model_path;
      weight->model = std::make_shared<const fontcore::WeightModel>(parse_weight(read_text(model), model));
    }
  }
  return recipe;
}

namespace {

char32_t read_code_point(const std::string& digits, const std::string& item) {
  std::uint32_t code = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), code, 16);
  if (digits.empty() || status != std::errc() || end != digits.data() + digits.size() || code > 0x10FFFF) {
    throw RequestError("\"" + item + "\" is no code point");
  }
  return code;
}

void select_item(const Font& font, const std::string& item, std::set<int>& selected) {
  if (item.starts_with("gid:")) {
    int id = -1;
    const auto [end, status] = std::from_chars(item.data() + 4, item.data() + item.size(), id);
    if (status != std::errc() || end != item.data() + item.size() || id < 0 ||
        id >= static_cast<int>(font.glyphs.size())) {
      throw RequestError(
          text(font.path, ": no glyph \"", item, "\": ids go from 0 to ", static_cast<long>(font.glyphs.size()) - 1));
    }
    selected.insert(id);
  } else if (item.starts_with("U+") || item.starts_with("u+")) {
    const auto dash = item.find('-');
    const char32_t first = read_code_point(item.substr(2, dash == std::string::npos ? dash : dash - 2), item);
    std::string rest = dash == std::string::npos ? item.substr(2) : item.substr(dash + 1);
    if (rest.starts_with("U+") || rest.starts_with("u+")) rest = rest.substr(2);
    const char32_t last = read_code_point(rest, item);
    if (last < first) throw RequestError("\"" + item + "\" is an empty range");
    const auto begin = font.character_map.lower_bound(first);
    const auto end = font.character_map.upper_bound(last);
    if (begin == end) throw RequestError(font.path + ": no glyph for \"" + item + "\"");
    for (auto it = begin; it != end; ++it) selected.insert(it->second);
  } else {
    const int id = font.find(item);
    if (id < 0) throw RequestError(font.path + ": no glyph named \"" + item + "\"");
    selected.insert(id);
  }
}

void select_list(const Font& font, const std::string& selection, bool files_allowed, std::set<int>& selected) {
  constexpr const char* white = " \t\r\n";
  std::size_t from = 0;
  while (from <= selection.size()) {
    const std::size_t comma = std::min(selection.find_first_of(",\n", from), selection.size());
    std::string item = selection.substr(from, comma - from);
    from = comma + 1;
    item.erase(0, std::min(item.find_first_not_of(white), item.size()));
    item.erase(item.find_last_not_of(white) + 1);
    if (item.empty()) continue;
    if (item[0] == '@' && item.size() > 1) {
      if (!files_allowed) throw RequestError("\"" + item + "\": a list within a list");
      Bytes bytes;
      try {
        bytes = read_file(item.substr(1));
      } catch (const FontReadError& error) {
        throw RequestError(error.what());
      }
      select_list(font, {bytes.begin(), bytes.end()}, false, selected);
    } else {
      select_item(font, item, selected);
    }
  }
}

}  // namespace

std::vector<int> select_glyphs(const Font& font, const std::string& selection) {
  std::set<int> selected;
  if (selection.empty()) {
    for (const Glyph& glyph : font.glyphs) {
      if (font.has_outline(glyph.id) || !glyph.trouble.empty()) selected.insert(glyph.id);
    }
  } else {
    select_list(font, selection, true, selected);
    if (selected.empty()) throw RequestError("\"" + selection + "\" selects no glyph");
  }
  return {selected.begin(), selected.end()};
}

}  // namespace glyphs
