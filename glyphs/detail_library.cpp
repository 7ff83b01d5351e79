#include "glyphs/detail_library.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>

#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
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
  const Point left = 1e-3 * chord(longest) * Point(-along.y(), along.x());
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

}  // namespace glyphs
