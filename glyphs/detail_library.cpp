#include "glyphs/detail_library.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <numbers>

#include "fontcore/analogy.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/texture.h"
#include "glyphs/drawing.h"
#include "glyphs/error.h"
#include "glyphs/json_reader.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::DetailFrame;
using fontcore::DetailLibrary;
using fontcore::DetailSample;
using fontcore::Point;
using fontcore::Points;
using fontcore::text;

constexpr std::array<std::pair<const char*, DetailFrame>, 3> frames = {{
    {"xy", DetailFrame::Fixed},
    {"tangent", DetailFrame::Tangent},
    {"scaled tangent", DetailFrame::ScaledTangent},
}};
constexpr double least_step = 1e-4;  // of a unit
constexpr double least_angle = 1e-6;
constexpr long fewest_rows = 4;
constexpr long most_rows = 1'000'000;

// A number to whole steps, as short as it can be written.
void append(std::string& out, double value, double step) {
  const double whole = std::round(value / step);
  std::array<char, 32> digits{};
  const double shown = whole == 0.0 ? 0.0 : whole / std::round(1.0 / step);
  out.append(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), shown).ptr);
}

std::string list_of(const Points& rows, double first, double second) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    out += i == 0 ? "[" : ",[";
    append(out, rows(i, 0), first);
    out += ",";
    append(out, rows(i, 1), second);
    out += "]";
  }
  return out + "]";
}

Points read_rows(ObjectReader& reader, const std::string& key, double limit) {
  const Json& list = reader.take(key);
  if (!list.is_array()) reader.fail(key, "must be a list of pairs of numbers");
  const auto rows = static_cast<long>(list.size());
  if (rows < fewest_rows || rows > most_rows) {
    reader.fail(key, text("has ", rows, " rows, must have from ", fewest_rows, " to ", most_rows));
  }
  Points points(rows, 2);
  for (long i = 0; i < rows; ++i) {
    const Json& row = list[static_cast<std::size_t>(i)];
    const bool is_pair = row.is_array() && row.size() == 2 && row[0].is_number() && row[1].is_number();
    if (!is_pair) reader.fail(text(key, "[", i, "]"), "must be two numbers");
    points.row(i) << row[0].get<double>(), row[1].get<double>();
    if (!(points.row(i).cwiseAbs().maxCoeff() <= limit)) reader.fail(text(key, "[", i, "]"), text("is over ", limit));
  }
  return points;
}

double positive(ObjectReader& reader, const std::string& key) {
  const double value = reader.take_number(key);
  if (!(value > 0.0) || value > 1e6) reader.fail(key, "must be positive, and at most 1000000");
  return value;
}

DetailLibrary read_library(const std::string& json) {
  const Json root = parse_json(json);
  ObjectReader reader(root, "");
  if (!root.is_object()) reader.fail("", "a library is an object");
  const Json& version = reader.take("version");
  if (version != 1) reader.fail("version", "is " + version.dump() + "; this version of glyphwave reads 1");
  if (reader.take_text("kind", "") != "detail") reader.fail("kind", "must be \"detail\": this is no library of detail");
  DetailLibrary library;
  library.name = reader.take_text("name", "");
  library.units_per_em = positive(reader, "unitsPerEm");
  library.scale = positive(reader, "scale");
  const std::string frame = reader.take_choice("frame", {"xy", "tangent", "scaled tangent"}, "tangent");
  for (const auto& [name, value] : frames) {
    if (frame == name) library.frame = value;
  }
  library.by_shape = reader.take_flag("by_shape", false);
  const Json& samples = reader.take("samples");
  if (!samples.is_array() || samples.empty()) reader.fail("samples", "must be a list of at least one");
  for (std::size_t k = 0; k < samples.size(); ++k) {
    ObjectReader one(samples[k], text("samples[", k, "]"));
    DetailSample sample;
    sample.place = one.take_text("place", "");
    sample.length = positive(one, "length");
    sample.is_closed = one.take_flag("closed", false);
    sample.offsets = read_rows(one, "offsets", 1e6);
    if (one.has("shape")) {
      sample.shape = read_rows(one, "shape", 1e6);
      if (sample.shape.rows() != sample.offsets.rows()) one.fail("shape", "must have as many rows as \"offsets\"");
    } else if (library.by_shape) {
      one.fail("shape", "is missing, and the library is laid by shape");
    }
    one.finish();
    library.samples.push_back(std::move(sample));
  }
  reader.finish();
  return library;
}

}  // namespace

fontcore::InkSide ink_side(const std::vector<BezierContour>& contours, std::size_t index) {
  const BezierContour& contour = contours[index];
  int longest = 0;
  const auto chord = [&](int s) { return (contour.segment(s).end() - contour.segment(s).start()).norm(); };
  for (int s = 1; s < contour.segment_count(); ++s) {
    if (chord(s) > chord(longest)) longest = s;
  }
  const Bezier segment = contour.segment(longest);
  const Point along = derivative(segment, 0.5).normalized();
  const Point left = 1e-3 * chord(longest) * fontcore::left_of(along);
  const Point middle = evaluate(segment, 0.5);
  const auto winding = [&](const Point& place) {
    int sum = 0;
    for (const BezierContour& any : contours) sum += winding_number(any, place);
    return sum;
  };
  const bool on_left = winding(middle + left) != 0;
  const bool on_right = winding(middle - left) != 0;
  if (on_left != on_right) return on_left ? fontcore::InkSide::Left : fontcore::InkSide::Right;
  return signed_area(contours) > 0.0 ? fontcore::InkSide::Left : fontcore::InkSide::Right;
}

std::string place_of(const std::string& glyph, int contour) { return text(glyph, "/", contour); }

DetailLibrary extract_library(const Font& font, const std::vector<int>& glyphs, const ExtractOptions& options) {
  DetailLibrary library;
  library.units_per_em = font.units_per_em;
  library.scale = options.scale;
  library.frame = options.frame;
  library.by_shape = options.by_shape;
  library.name = options.name;
  if (options.stretch && glyphs.size() != 1) {
    throw RequestError(text("a stretch is one of one glyph, not of ", glyphs.size()));
  }
  for (const int id : glyphs) {
    const Glyph& glyph = font.glyphs.at(static_cast<std::size_t>(id));
    if (!glyph.trouble.empty()) {
      if (glyphs.size() == 1) throw FontReadError(font.path + ": " + glyph.trouble);
      continue;
    }
    const int count = static_cast<int>(glyph.contours.size());
    if (glyphs.size() == 1 && count == 0) {
      throw RequestError(glyph.name +
                         (glyph.is_composite() ? ": is a composite: take its parts" : ": has no contours"));
    }
    if (options.contour && *options.contour >= count) {
      throw RequestError(text(glyph.name, ": there is no contour ", *options.contour, ": it has ", count));
    }
    int only = options.contour.value_or(-1);
    if (options.stretch && !options.contour) {
      only = 0;
      double nearest = std::numeric_limits<double>::infinity();
      for (int c = 0; c < count; ++c) {
        const double distance =
            nearest_point(glyph.contours[static_cast<std::size_t>(c)], options.stretch->first).distance;
        if (distance < nearest) {
          nearest = distance;
          only = c;
        }
      }
    }
    for (int c = 0; c < count; ++c) {
      const BezierContour& contour = glyph.contours[static_cast<std::size_t>(c)];
      if ((only >= 0 && c != only) || !has_inside(contour)) continue;
      const fontcore::InkSide ink = ink_side(glyph.contours, static_cast<std::size_t>(c));
      try {
        if (options.stretch) {
          const fontcore::OutlineArcs outline(contour);
          const auto from = nearest_point(contour, options.stretch->first);
          const auto to = nearest_point(contour, options.stretch->second);
          library.samples.push_back(
              extract_detail(outline, {from.segment, from.u}, {to.segment, to.u}, options.scale, options.frame, ink));
        } else {
          auto samples = extract_detail(fontcore::arcs_at_scale(contour, options.scale), options.scale, options.frame,
                                        ink, place_of(glyph.name, c));
          std::ranges::move(samples, std::back_inserter(library.samples));
        }
      } catch (const fontcore::InvalidInput& error) {
        throw RequestError(text(glyph.name, ": contour ", c, ": ", error.what()));
      }
    }
  }
  if (library.samples.empty()) {
    throw RequestError(text("no arc is as long as the scale of ", options.scale, " units: there is no detail to take"));
  }
  return library;
}

std::string library_json(const DetailLibrary& library) {
  std::string frame;
  for (const auto& [name, value] : frames) {
    if (library.frame == value) frame = name;
  }
  std::string out = "{\n  \"version\": 1,\n  \"kind\": \"detail\",\n  \"name\": ";
  out += Json(library.name).dump(-1, ' ', false, Json::error_handler_t::replace);
  out += ",\n  \"unitsPerEm\": ";
  append(out, library.units_per_em, least_step);
  out += ",\n  \"scale\": ";
  append(out, library.scale, least_step);
  out += ",\n  \"frame\": \"" + frame + "\"";
  if (library.by_shape) out += ",\n  \"by_shape\": true";
  out += ",\n  \"samples\": [";
  for (std::size_t k = 0; k < library.samples.size(); ++k) {
    const DetailSample& sample = library.samples[k];
    out += k == 0 ? "\n    {" : ",\n    {";
    if (!sample.place.empty()) {
      out += "\"place\": " + Json(sample.place).dump(-1, ' ', false, Json::error_handler_t::replace) + ", ";
    }
    out += "\"length\": ";
    append(out, sample.length, least_step);
    out += sample.is_closed ? ", \"closed\": true" : ", \"closed\": false";
    out += ", \"offsets\": " + list_of(sample.offsets, least_step, least_step);
    if (library.by_shape) out += ", \"shape\": " + list_of(sample.shape, least_angle, least_angle);
    out += "}";
  }
  return out + "\n  ]\n}\n";
}

DetailLibrary parse_library(const std::string& json, const std::string& name) {
  return naming_file(name, json, read_library);
}

std::shared_ptr<const DetailLibrary> load_library(const std::filesystem::path& path) {
  const std::string name = path.string();
  return std::make_shared<const DetailLibrary>(parse_library(read_text(name), name));
}

namespace {

namespace texture = fontcore::texture;

// The parameters of a kind by their names.
using Parameters = std::vector<std::pair<std::string, std::function<void(double)>>>;

Parameters parameters_of(texture::Texture& any) {
  const auto of = [](std::vector<std::pair<std::string, double*>> lengths, std::uint64_t* seed) {
    Parameters parameters;
    for (const auto& [name, to] : lengths) parameters.emplace_back(name, [at = to](double value) { *at = value; });
    if (seed != nullptr) {
      parameters.emplace_back("seed", [seed](double value) {
        if (value < 0.0 || value > 0x1p53 || value != std::floor(value)) throw RequestError("a seed is a whole number");
        *seed = static_cast<std::uint64_t>(value);
      });
    }
    return parameters;
  };
  if (auto* const noise = std::get_if<texture::Noise>(&any)) {
    return of({{"shortest", &noise->shortest}, {"longest", &noise->longest}, {"amplitude", &noise->amplitude}},
              &noise->seed);
  }
  if (auto* const wave = std::get_if<texture::Wave>(&any)) {
    return of({{"wavelength", &wave->wavelength}, {"amplitude", &wave->amplitude}}, nullptr);
  }
  if (auto* const saw = std::get_if<texture::Saw>(&any)) {
    return of(
        {{"wavelength", &saw->wavelength}, {"height", &saw->height}, {"lean", &saw->lean}, {"radius", &saw->radius}},
        nullptr);
  }
  if (auto* const scallop = std::get_if<texture::Scallop>(&any)) {
    return of({{"wavelength", &scallop->wavelength}, {"height", &scallop->height}, {"radius", &scallop->radius}},
              nullptr);
  }
  auto& ink = std::get<texture::Ink>(any);
  return of({{"wavelength", &ink.wavelength},
             {"amplitude", &ink.amplitude},
             {"fine_wavelength", &ink.fine_wavelength},
             {"fine_amplitude", &ink.fine_amplitude}},
            &ink.seed);
}

// The one of its pairs that a word names; refused with all their names if none does.
template <typename Pairs>
auto& named(Pairs& pairs, const std::string& what, const std::string& word) {
  std::string known;
  for (auto& [name, value] : pairs) {
    if (name == word) return value;
    known += (known.empty() ? "" : ", ") + name;
  }
  throw RequestError(text(what, " \"", word, "\" is not one of ", known));
}

std::vector<std::string> split_at_commas(const std::string& words) {
  std::vector<std::string> items{""};
  for (const char c : words) {
    if (c == ',') {
      items.emplace_back();
    } else {
      items.back() += c;
    }
  }
  return items;
}

void check_scale(double scale) {
  if (!(scale > 0.0) || !std::isfinite(scale))
    throw RequestError(text("a scale of ", scale, " units is no feature size"));
}

// The contours of a glyph that both fonts have, in the plain one's units.
std::vector<BezierContour> counterpart(const Font& plain, const Font& other, int id) {
  const Glyph& glyph = plain.glyphs.at(static_cast<std::size_t>(id));
  const int found = other.find(glyph.name);
  if (found < 0) throw RequestError(text(other.path, ": there is no ", glyph.name));
  const Glyph& twin = other.glyphs.at(static_cast<std::size_t>(found));
  if (twin.contours.size() != glyph.contours.size()) {
    throw RequestError(text(glyph.name, ": ", glyph.contours.size(), " contours in ", plain.path, ", ",
                            twin.contours.size(), " in ", other.path));
  }
  const double unit = static_cast<double>(plain.units_per_em) / other.units_per_em;
  std::vector<BezierContour> contours;
  for (std::size_t c = 0; c < twin.contours.size(); ++c) {
    BezierContour scaled = unit == 1.0
                               ? twin.contours[c]
                               : transform(twin.contours[c], {unit * Eigen::Matrix2d::Identity(), Point::Zero()});
    // TrueType and CFF run opposite ways.
    const bool is_opposite = signed_area(scaled) * signed_area(glyph.contours[c]) < 0.0;
    contours.push_back(is_opposite ? reverse(scaled) : std::move(scaled));
  }
  return contours;
}

}  // namespace

DetailLibrary procedural_library(const std::string& words, const std::string& name) {
  std::vector<std::pair<std::string, texture::Texture>> kinds = {{"noise", texture::Noise{}},
                                                                 {"wave", texture::Wave{}},
                                                                 {"saw", texture::Saw{}},
                                                                 {"scallop", texture::Scallop{}},
                                                                 {"ink", texture::Ink{}}};
  const std::vector<std::string> items = split_at_commas(words);
  texture::Texture& chosen = named(kinds, "the texture", items[0]);
  Parameters parameters = parameters_of(chosen);
  for (std::size_t k = 1; k < items.size(); ++k) {
    const std::size_t equals = items[k].find('=');
    const auto& set = named(parameters, items[0] + ": the parameter", items[k].substr(0, equals));
    const std::string digits = equals == std::string::npos ? "" : items[k].substr(equals + 1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size() || !std::isfinite(value)) {
      throw RequestError(text(items[0], ": ", items[k], ": PARAMETER=NUMBER is expected"));
    }
    set(value);
  }
  try {
    return texture::make_library(chosen, name);
  } catch (const fontcore::InvalidInput& error) {
    throw RequestError(error.what());
  }
}

DetailLibrary drawn_library(const std::string& path, double unit, double units_per_em, const ExtractOptions& options) {
  check_scale(options.scale);
  DetailLibrary library;
  library.name = options.name;
  library.units_per_em = units_per_em;
  library.scale = options.scale;
  library.frame = options.frame;
  // Chords of a hundredth of the scale are far below the steps of a sample.
  for (const Stroke& stroke : load_drawing(path, {.scale = unit, .step = 0.01 * options.scale})) {
    double run = 0.0;
    const auto n = stroke.points.rows();
    for (Eigen::Index i = stroke.is_closed ? 0 : 1; i < n; ++i) {
      run += (stroke.points.row(i) - stroke.points.row((i + n - 1) % n)).norm();
    }
    if (run < options.scale) continue;
    library.samples.push_back(extract_detail(stroke.points, stroke.is_closed, options.scale, options.frame));
  }
  if (library.samples.empty()) {
    throw RequestError(text(path, ": no stroke is as long as the scale of ", options.scale, " units"));
  }
  return library;
}

DetailLibrary learn_library(const Font& plain, const Font& textured, const std::vector<int>& glyphs,
                            const ExtractOptions& options) {
  check_scale(options.scale);
  DetailLibrary library;
  library.name = options.name;
  library.units_per_em = plain.units_per_em;
  library.scale = options.scale;
  library.frame = options.frame;
  library.by_shape = true;
  for (const int id : glyphs) {
    const Glyph& glyph = plain.glyphs.at(static_cast<std::size_t>(id));
    // Of a whole font what only one of the two has says nothing.
    if (glyphs.size() > 1 && (glyph.contours.empty() || textured.find(glyph.name) < 0)) continue;
    const std::vector<BezierContour> other = counterpart(plain, textured, id);
    for (std::size_t c = 0; c < other.size(); ++c) {
      if (options.contour && *options.contour != static_cast<int>(c)) continue;
      if (!has_inside(glyph.contours[c]) || !has_inside(other[c])) continue;
      try {
        auto samples = learn_difference(fontcore::arcs_at_scale(glyph.contours[c], options.scale),
                                        fontcore::arcs_at_scale(other[c], options.scale), options.scale, options.frame,
                                        ink_side(glyph.contours, c), place_of(glyph.name, static_cast<int>(c)));
        std::ranges::move(samples, std::back_inserter(library.samples));
      } catch (const fontcore::InvalidInput& error) {
        throw RequestError(text(glyph.name, ": contour ", c, ": ", error.what()));
      }
    }
  }
  if (library.samples.empty()) throw RequestError("the two fonts have no arc in common that is as long as the scale");
  return library;
}

fontcore::PlacedDetail learn_edit(const Font& plain, const Font& edited, int id, const ExtractOptions& options) {
  const Glyph& glyph = plain.glyphs.at(static_cast<std::size_t>(id));
  const std::vector<BezierContour> other = counterpart(plain, edited, id);
  if (!options.stretch) throw RequestError(glyph.name + ": the stretch that was edited is not given");
  std::size_t on = static_cast<std::size_t>(options.contour.value_or(0));
  if (on >= other.size()) throw RequestError(text(glyph.name, ": there is no contour ", on, ": it has ", other.size()));
  const auto distance = [&](std::size_t c) {
    return nearest_point(glyph.contours[c], options.stretch->first).distance;
  };
  for (std::size_t c = 0; c < other.size() && !options.contour; ++c) {
    if (distance(c) < distance(on)) on = c;
  }
  const BezierContour& contour = glyph.contours[on];
  const auto from = nearest_point(contour, options.stretch->first);
  const auto to = nearest_point(contour, options.stretch->second);
  try {
    return learn_place(fontcore::OutlineArcs(contour), fontcore::OutlineArcs(other[on]), {from.segment, from.u},
                       {to.segment, to.u}, plain.units_per_em, ink_side(glyph.contours, on));
  } catch (const fontcore::InvalidInput& error) {
    throw RequestError(text(glyph.name, ": contour ", on, ": ", error.what()));
  }
}

namespace {

constexpr double thousandths = 1000.0;

fontcore::PlacedDetail read_edit(const std::string& json) {
  const Json root = parse_json(json);
  ObjectReader reader(root, "");
  const Json& version = reader.take("version");
  if (version != 1) reader.fail("version", "is " + version.dump() + "; this version of glyphwave reads 1");
  if (reader.take_text("kind", "") != "edit") reader.fail("kind", "must be \"edit\": this is no edit of a stretch");
  reader.take_text("name", "");
  fontcore::PlacedDetail edit;
  edit.path = read_rows(reader, "path", 1e6) / thousandths;
  edit.displacement = read_rows(reader, "displacement", 1e6) / thousandths;
  if (edit.displacement.rows() != edit.path.rows()) reader.fail("displacement", "must have as many rows as \"path\"");
  const Json& along = reader.take("along");
  if (!along.is_array() || static_cast<long>(along.size()) != edit.path.rows())
    reader.fail("along", "must be a list of as many numbers as \"path\" has rows");
  edit.along.resize(edit.path.rows());
  for (Eigen::Index i = 0; i < edit.along.size(); ++i) {
    const Json& place = along[static_cast<std::size_t>(i)];
    if (!place.is_number()) reader.fail(text("along[", i, "]"), "must be a number");
    edit.along[i] = place.get<double>() / thousandths;
    const bool rises = i == 0 ? edit.along[i] == 0.0 : edit.along[i] > edit.along[i - 1];
    if (!rises || edit.along[i] > 1e3) reader.fail(text("along[", i, "]"), "places rise from 0");
  }
  const Json& corners = reader.take("corners");
  if (!corners.is_array()) reader.fail("corners", "must be a list of pairs: place and degrees");
  for (const Json& corner : corners) {
    if (!corner.is_array() || corner.size() != 2 || !corner[0].is_number() || !corner[1].is_number())
      reader.fail("corners", "must be a list of pairs: place and degrees");
    const double at = corner[0].get<double>() / thousandths;
    const double least = edit.corners.empty() ? 0.0 : edit.corners.back().at;
    if (!(at >= least) || !(at <= edit.along[edit.along.size() - 1]))
      reader.fail("corners", "must lie on the stretch, in order");
    edit.corners.push_back({at, corner[1].get<double>() * std::numbers::pi / 180.0});
  }
  reader.finish();
  return edit;
}

}  // namespace

std::string edit_json(const fontcore::PlacedDetail& edit, const std::string& name) {
  std::string out = "{\n  \"version\": 1,\n  \"kind\": \"edit\",\n  \"name\": ";
  out += Json(name).dump(-1, ' ', false, Json::error_handler_t::replace);
  out += ",\n  \"corners\": [";
  for (std::size_t k = 0; k < edit.corners.size(); ++k) {
    out += k == 0 ? "[" : ",[";
    append(out, thousandths * edit.corners[k].at, least_step);
    out += ",";
    append(out, edit.corners[k].turn * 180.0 / std::numbers::pi, least_step);
    out += "]";
  }
  out += "],\n  \"along\": [";
  for (Eigen::Index i = 0; i < edit.along.size(); ++i) {
    if (i > 0) out += ",";
    append(out, thousandths * edit.along[i], least_step);
  }
  out += "],\n  \"path\": " + list_of(thousandths * edit.path, least_step, least_step);
  out += ",\n  \"displacement\": " + list_of(thousandths * edit.displacement, least_step, least_step);
  return out + "\n}\n";
}

fontcore::PlacedDetail parse_edit(const std::string& json, const std::string& name) {
  return naming_file(name, json, read_edit);
}

std::shared_ptr<const fontcore::PlacedDetail> load_edit(const std::filesystem::path& path) {
  const std::string name = path.string();
  return std::make_shared<const fontcore::PlacedDetail>(parse_edit(read_text(name), name));
}

}  // namespace glyphs
