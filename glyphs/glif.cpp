#include "glyphs/glif.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <utility>

#include "fontcore/error.h"
#include "glyphs/ufo.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using fontcore::text;
using xml::Malformed;
using xml::shown;

/// What a mark says of a point or a contour.
struct Mark {
  bool is_corner = false;
  bool is_frozen = false;
  std::optional<double> scale;
};

double bounded(const std::string& raw, const std::string& what) {
  const double value = xml::number(raw, what);
  if (std::abs(value) > max_coordinate) throw Malformed(text(what, " ", value, " is beyond ", max_coordinate));
  return value;
}

bool is_quadratic(PointKind kind) { return kind == PointKind::Quadratic || kind == PointKind::ImpliedNode; }

class GlifParser {
 public:
  GlifParser(const Bytes& bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  /// What cannot be read is the glyph's trouble.
  Glif parse() {
    try {
      const xml::Document document(bytes_);
      document_ = &document;
      read_header(document.root());
      read_outline(document.root());
      read_lib(document.root());
    } catch (const Malformed& error) {
      glif_.trouble = error.what();
    } catch (const fontcore::InvalidInput& error) {
      glif_.trouble = error.what();
    }
    document_ = nullptr;
    return std::move(glif_);
  }

 private:
  void read_header(pugi::xml_node root) {
    if (std::strcmp(root.name(), "glyph") != 0) throw Malformed("is no glyph");
    const std::string format = xml::attribute(root, "format");
    if (format != "1" && format != "2") throw Malformed(text("format \"", shown(format), "\" is not 1 or 2"));
    if (const std::string own = xml::attribute(root, "name"); own != name_) {
      throw Malformed(text("calls itself \"", shown(own), "\", not what contents.plist has"));
    }
    for (const pugi::xml_node child : root.children()) {
      if (std::strcmp(child.name(), "unicode") == 0) glif_.unicodes.push_back(code_point(xml::attribute(child, "hex")));
      if (std::strcmp(child.name(), "anchor") == 0) read_anchor(child);
    }
    const pugi::xml_attribute width = root.child("advance").attribute("width");
    if (!width) return;
    glif_.advance = bounded(xml::decode(width.value()), "advance");
    glif_.width = value_span(width);
  }

  /// One without a place is carried along like all that is not understood.
  void read_anchor(pugi::xml_node element) {
    const pugi::xml_attribute x = element.attribute("x");
    const pugi::xml_attribute y = element.attribute("y");
    try {
      glif_.anchors.push_back(
          {Point(bounded(xml::decode(x.value()), "anchor"), bounded(xml::decode(y.value()), "anchor")), value_span(x),
           value_span(y)});
    } catch (const Malformed&) {
      return;
    }
  }

  static char32_t code_point(const std::string& hex) {
    std::uint32_t code = 0;
    const auto [end, error] = std::from_chars(hex.data(), hex.data() + hex.size(), code, 16);
    if (error != std::errc() || end != hex.data() + hex.size() || code > 0x10FFFF ||
        (code >= 0xD800 && code <= 0xDFFF)) {
      throw Malformed(text("unicode \"", shown(hex), "\" is no character"));
    }
    return code;
  }

  void read_outline(pugi::xml_node root) {
    const pugi::xml_node outline = root.child("outline");
    if (outline.next_sibling("outline")) throw Malformed("a second outline");
    std::size_t points = 0;
    for (const pugi::xml_node child : outline.children()) {
      if (std::strcmp(child.name(), "contour") == 0) {
        read_contour(child);
        points += glif_.contours.back().points.size();
        if (points > max_composed_points) throw Malformed(text("more than ", max_composed_points, " points"));
      } else if (std::strcmp(child.name(), "component") == 0) {
        read_component(child);
      }
    }
  }

  void read_component(pugi::xml_node element) {
    GlifComponent component;
    component.base = xml::attribute(element, "base");
    if (component.base.empty()) throw Malformed("a component without a base");
    const auto entry = [&](const char* key, double otherwise) {
      const pugi::xml_attribute value = element.attribute(key);
      return value ? bounded(xml::decode(value.value()), text("component ", shown(component.base), ": ", key))
                   : otherwise;
    };
    component.placement.linear << entry("xScale", 1.0), entry("yxScale", 0.0), entry("xyScale", 0.0),
        entry("yScale", 1.0);
    component.placement.shift = Point(entry("xOffset", 0.0), entry("yOffset", 0.0));
    component.is_named = !xml::attribute(element, "identifier").empty();
    component.element = element_span(element);
    if (const pugi::xml_attribute x = element.attribute("xOffset")) component.x_offset = value_span(x);
    if (const pugi::xml_attribute y = element.attribute("yOffset")) component.y_offset = value_span(y);
    glif_.components.push_back(std::move(component));
  }

  Span value_span(pugi::xml_attribute value) const {
    const std::size_t begin = document_->offset(value.value());
    return {begin, begin + std::strlen(value.value())};
  }

  /// From the opening < to behind the closing > of an element that holds no others.
  Span element_span(pugi::xml_node element) const {
    const std::size_t begin = document_->offset(element.name()) - 1;
    std::size_t at = begin;
    const auto pass = [&](unsigned char wanted) {
      unsigned char quote = 0;
      for (; quote != 0 || bytes_[at] != wanted; ++at) {
        if (quote == bytes_[at]) {
          quote = 0;
        } else if (quote == 0 && (bytes_[at] == '"' || bytes_[at] == '\'')) {
          quote = bytes_[at];
        }
      }
      ++at;
    };
    pass('>');
    if (bytes_[at - 2] != '/') {
      const std::string closing = text("</", element.name());
      at = static_cast<std::size_t>(
          std::search(bytes_.begin() + static_cast<std::ptrdiff_t>(at), bytes_.end(), closing.begin(), closing.end()) -
          bytes_.begin());
      pass('>');
    }
    return {begin, at};
  }

  GlifPoint read_point(pugi::xml_node element, const std::string& where) const {
    GlifPoint point;
    const pugi::xml_attribute x = element.attribute("x");
    const pugi::xml_attribute y = element.attribute("y");
    if (!x || !y) throw Malformed(where + " has no place");
    point.position =
        Point(bounded(xml::decode(x.value()), where + ": x"), bounded(xml::decode(y.value()), where + ": y"));
    point.x = value_span(x);
    point.y = value_span(y);
    if (const pugi::xml_attribute type = element.attribute("type")) {
      const std::string name = xml::decode(type.value());
      point.type_name = value_span(type);
      if (name == "move") {
        point.type = PointType::Move;
      } else if (name == "line") {
        point.type = PointType::Line;
      } else if (name == "curve") {
        point.type = PointType::Curve;
      } else if (name == "qcurve") {
        point.type = PointType::QCurve;
      } else if (name != "offcurve") {
        throw Malformed(text(where, ": type \"", shown(name), "\" is not known"));
      }
    }
    point.identifier = xml::attribute(element, "identifier");
    point.is_named = !point.identifier.empty() || element.attribute("name");
    for (const pugi::xml_node child : element.children()) {
      if (child.type() == pugi::node_element) throw Malformed(where + " holds other elements");
    }
    point.element = element_span(element);
    return point;
  }

  void read_contour(pugi::xml_node element) {
    const std::size_t number = glif_.contours.size();
    GlifContour& contour = glif_.contours.emplace_back();
    contour.identifier = xml::attribute(element, "identifier");
    for (const pugi::xml_node child : element.children("point")) {
      contour.points.push_back(read_point(child, text("contour ", number, ", point ", contour.points.size())));
      if (contour.points.size() > max_composed_points) return;  // the caller will say so
      if (contour.points.back().type == PointType::Move && contour.points.size() > 1) {
        throw Malformed(text("contour ", number, ", point ", contour.points.size() - 1, ": a move within a contour"));
      }
    }
    if (contour.points.size() > 1 && contour.points.front().type != PointType::Move) close(contour, number);
  }

  /// The outline of a closed contour.
  static void close(GlifContour& contour, std::size_t number) {
    const std::vector<GlifPoint>& points = contour.points;
    const std::size_t count = points.size();
    std::vector<PointKind> kinds(count, PointKind::Quadratic);
    const auto is_off = [&](std::size_t i) { return points[i].type == PointType::OffCurve; };
    for (std::size_t i = 0; i < count; ++i) {
      if (is_off(i)) continue;
      kinds[i] = PointKind::Node;
      std::size_t handles = 0;
      for (std::size_t k = (i + count - 1) % count; is_off(k) && handles < count; k = (k + count - 1) % count)
        ++handles;
      const bool is_line = points[i].type == PointType::Line;
      if ((is_line && handles > 0) || (points[i].type == PointType::Curve && handles > 2)) {
        throw Malformed(
            text("contour ", number, ", point ", i, ": ", handles, " handles before a ", is_line ? "line" : "curve"));
      }
      if (points[i].type != PointType::Curve || handles != 2) continue;
      kinds[(i + count - 1) % count] = PointKind::Cubic;
      kinds[(i + count - 2) % count] = PointKind::Cubic;
    }
    std::vector<Point> places;
    std::vector<PointKind> all;
    for (std::size_t i = 0; i < count; ++i) {
      places.push_back(points[i].position);
      all.push_back(kinds[i]);
      contour.stored.push_back(static_cast<int>(i));
      const std::size_t next = (i + 1) % count;
      if (kinds[i] != PointKind::Quadratic || kinds[next] != PointKind::Quadratic) continue;
      places.emplace_back(0.5 * (points[i].position + points[next].position));
      all.push_back(PointKind::ImpliedNode);
      contour.stored.push_back(-1);
    }
    Points rows(static_cast<Eigen::Index>(places.size()), 2);
    for (std::size_t i = 0; i < places.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = places[i];
    contour.outline.emplace(std::move(rows), std::move(all));
  }

  void read_lib(pugi::xml_node root) {
    const pugi::xml_node lib = root.child("lib");
    if (!lib) return;
    const xml::Entries keys = xml::entries(lib.first_child(), "lib");
    for (const char* key : {"public.postscript.hints", "public.truetype.instructions", "com.adobe.type.autohint",
                            "com.adobe.type.autohint.v2"}) {
      if (xml::find(keys, key)) glif_.hints.emplace_back(key);
    }
    const pugi::xml_node libs = xml::find(keys, "public.objectLibs");
    if (!libs) return;
    std::map<std::string, Mark> marks;
    for (const auto& [identifier, object] : xml::entries(libs, "public.objectLibs")) {
      const std::string what = text("public.objectLibs: ", shown(identifier));
      if (const pugi::xml_node mark = xml::find(xml::entries(object, what), marks_key)) {
        marks[identifier] = read_mark(mark, text(what, ": ", marks_key));
      }
    }
    if (!marks.empty()) set_marks(marks);
  }

  static Mark read_mark(pugi::xml_node value, const std::string& what) {
    Mark mark;
    for (const auto& [key, setting] : xml::entries(value, what)) {
      if (key == "corner") {
        mark.is_corner = xml::as_bool(setting, what + ": corner");
      } else if (key == "freeze") {
        mark.is_frozen = xml::as_bool(setting, what + ": freeze");
      } else if (key == "scale") {
        mark.scale = xml::as_number(setting, what + ": scale");
        if (!(*mark.scale > 0.0)) throw Malformed(text(what, ": scale ", *mark.scale, " is not above 0"));
      } else {
        throw Malformed(text(what, ": there is no \"", shown(key), "\""));
      }
    }
    return mark;
  }

  void set_marks(const std::map<std::string, Mark>& marks) {
    const auto mark_of = [&](const std::string& identifier) {
      const auto at = identifier.empty() ? marks.end() : marks.find(identifier);
      return at == marks.end() ? Mark{} : at->second;
    };
    for (const GlifContour* contour : glif_.outlines()) {
      ContourMarks& its = glif_.marks.emplace_back();
      const Mark whole = mark_of(contour->identifier);
      if (whole.is_corner) throw Malformed(text(marks_key, ": contour ", shown(contour->identifier), " is no corner"));
      its.scale = whole.scale;
      for (std::size_t i = 0; i < contour->stored.size(); ++i) {
        const int stored = contour->stored[i];
        const Mark mark = stored < 0 ? Mark{} : mark_of(contour->points[static_cast<std::size_t>(stored)].identifier);
        const auto index = static_cast<int>(i);
        if (mark.scale) throw Malformed(text(marks_key, ": a scale is a contour's, not that of point ", stored));
        if (mark.is_corner && !fontcore::is_node(contour->outline->kind(index))) {
          throw Malformed(text(marks_key, ": point ", stored, " is a handle, which cannot be a corner"));
        }
        if (mark.is_corner) its.corners.push_back(index);
        if (mark.is_frozen || whole.is_frozen) its.frozen.push_back(index);
      }
    }
    if (std::all_of(glif_.marks.begin(), glif_.marks.end(),
                    [](const ContourMarks& m) { return m.corners.empty() && m.frozen.empty() && !m.scale; })) {
      glif_.marks.clear();
    }
  }

  const Bytes& bytes_;
  const std::string& name_;
  const xml::Document* document_ = nullptr;
  Glif glif_;
};

PointType type_of_segment(const BezierContour& contour, int node) {
  const int n = static_cast<int>(contour.point_count());
  const PointKind before = contour.kind((node + n - 1) % n);
  return before == PointKind::Cubic ? PointType::Curve : is_quadratic(before) ? PointType::QCurve : PointType::Line;
}

/// Whether a node's tangents agree as well as whole numbers can say; false between two lines.
bool is_smooth(const BezierContour& contour, int node) {
  const int n = static_cast<int>(contour.point_count());
  const int before = (node + n - 1) % n;
  const int after = (node + 1) % n;
  if (fontcore::is_node(contour.kind(before)) && fontcore::is_node(contour.kind(after))) return false;
  const Point in = contour.point(node) - contour.point(before);
  const Point out = contour.point(after) - contour.point(node);
  constexpr double rounding = 0.5;       // of a coordinate, font units
  constexpr double largest_turn = 0.14;  // radians, where handles are so short that rounding alone would allow more
  const double cross = fontcore::cross(in, out);
  const double turn = std::atan2(std::abs(cross), in.dot(out));
  return in.norm() > 0.0 && out.norm() > 0.0 && turn < largest_turn &&
         std::abs(cross) <= rounding * (in.norm() + out.norm());
}

}  // namespace

Glif parse_glif(const Bytes& bytes, const std::string& name) { return GlifParser(bytes, name).parse(); }

const char* segment_type(const BezierContour& contour, int node) {
  const PointType type = type_of_segment(contour, node);
  return type == PointType::Curve ? "curve" : type == PointType::QCurve ? "qcurve" : "line";
}

bool is_compatible(PointType type, const BezierContour& contour, int node) {
  const PointType wanted = type_of_segment(contour, node);
  if (type == wanted || wanted == PointType::Line) return type != PointType::OffCurve;
  const int n = static_cast<int>(contour.point_count());
  const PointKind second = contour.kind((node + 2 * n - 2) % n);
  return type == PointType::Curve && wanted == PointType::QCurve && second != PointKind::ImpliedNode;
}

std::string point_element(const BezierContour& contour, int point) {
  const Point p = contour.point(point);
  std::string element = text("<point x=\"", xml::number_text(p.x()), "\" y=\"", xml::number_text(p.y()), "\"");
  if (contour.kind(point) == PointKind::Node) {
    element += text(" type=\"", segment_type(contour, point), "\"");
    if (is_smooth(contour, point)) element += " smooth=\"yes\"";
  }
  return element + "/>";
}

}  // namespace glyphs
