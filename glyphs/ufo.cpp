#include "glyphs/ufo.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <set>

#include "glyphs/error.h"
#include "glyphs/glif.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::text;
using xml::Malformed;
using xml::shown;

// ---- the font

/// Whether a name from a property list may be taken for a file or a folder beside it.
void require_plain(const std::string& name, const std::string& what) {
  if (name.empty() || name == "." || name == ".." ||
      name.find_first_of(std::string_view("/\\\0", 3)) != std::string::npos) {
    throw Malformed(text(what, " \"", shown(name), "\" is no plain name"));
  }
}

bool has_control(const std::string& name) {
  return std::any_of(name.begin(), name.end(), [](char c) { return (c >= 0 && c < ' ') || c == 0x7F; });
}

/// The property lists that say what a UFO holds.
class UfoReader {
 public:
  explicit UfoReader(const Folder& folder) : folder_(folder) {}

  /// The file that `Malformed` was about.
  const std::string& file() const { return file_; }

  void read_version() {
    const xml::Document document(bytes("metainfo.plist"));
    const xml::Entries info = xml::entries(xml::property_list(document), "its object");
    const pugi::xml_node version = xml::find(info, "formatVersion");
    if (!version) throw Malformed("no formatVersion");
    const double number = xml::as_number(version, "formatVersion");
    if (number != 1 && number != 2 && number != 3) throw Malformed(text("formatVersion ", number, " is not 1, 2 or 3"));
    version_ = static_cast<int>(number);
  }

  /// The default layer is always in `glyphs`; of others only the names are looked at.
  void check_layers() {
    if (version_ < 3) return;
    const xml::Document document(bytes("layercontents.plist"));
    std::set<std::string> names;
    std::set<std::string> folders;
    for (const pugi::xml_node layer : xml::as_array(xml::property_list(document), "its object")) {
      const std::vector<pugi::xml_node> pair = xml::as_array(layer, "a layer");
      if (pair.size() != 2) throw Malformed("a layer is not a name and a folder");
      const std::string name = xml::as_text(pair[0], "a layer's name");
      const std::string folder = xml::as_text(pair[1], "a layer's folder");
      require_plain(folder, "folder");
      if (!names.insert(name).second) throw Malformed(text("layer \"", shown(name), "\" stands twice"));
      if (!folders.insert(folder).second) throw Malformed(text("folder \"", shown(folder), "\" stands twice"));
      if (!has_folder(folder)) throw Malformed(text("folder \"", shown(folder), "\" is missing"));
    }
    if (folders.count("glyphs") == 0) throw Malformed("no layer is in the folder glyphs");
  }

  /// Glyph names and their files, by name.
  std::map<std::string, std::string> contents() {
    const xml::Document document(bytes("glyphs/contents.plist"));
    std::map<std::string, std::string> files;
    std::set<std::string> seen;
    for (const auto& [name, value] : xml::entries(xml::property_list(document), "its object")) {
      if (name.empty()) throw Malformed("a glyph without a name");
      if (has_control(name)) throw Malformed(text("glyph name \"", shown(name), "\" has control characters"));
      const std::string file = xml::as_text(value, text("the file of ", shown(name)));
      require_plain(file, text("the file of ", shown(name)));
      if (folder_.count("glyphs/" + file) == 0) {
        throw Malformed(text("\"", shown(file), "\", the file of ", shown(name), ", is missing"));
      }
      if (!seen.insert(file).second) throw Malformed(text("\"", shown(file), "\" is the file of two glyphs"));
      files[name] = "glyphs/" + file;
    }
    return files;
  }

  /// Names in the order of `public.glyphOrder`, then the others by name.
  std::vector<std::string> order(const std::map<std::string, std::string>& contents) {
    std::vector<std::string> names;
    std::set<std::string> seen;
    if (folder_.count("lib.plist") > 0) {
      const xml::Document document(bytes("lib.plist"));
      const xml::Entries lib = xml::entries(xml::property_list(document), "its object");
      if (const pugi::xml_node order = xml::find(lib, "public.glyphOrder")) {
        for (const pugi::xml_node item : xml::as_array(order, "public.glyphOrder")) {
          const std::string name = xml::as_text(item, "an entry of public.glyphOrder");
          if (contents.count(name) > 0 && seen.insert(name).second) names.push_back(name);
        }
      }
    }
    for (const auto& [name, file] : contents) {
      if (seen.insert(name).second) names.push_back(name);
    }
    return names;
  }

  void read_info(Font& font) {
    constexpr double usual = 1000;
    font.units_per_em = static_cast<int>(usual);
    std::optional<double> ascender;
    std::optional<double> descender;
    if (folder_.count("fontinfo.plist") > 0) {
      const xml::Document document(bytes("fontinfo.plist"));
      for (const auto& [key, value] : xml::entries(xml::property_list(document), "its object")) {
        if (key == "unitsPerEm") {
          const double units = xml::as_number(value, key);
          constexpr double least = 16;
          constexpr double most = 16384;
          if (units != std::trunc(units)) throw Malformed(text(key, " ", units, " is no whole number"));
          if (units < least || units > most)
            throw Malformed(text(key, " ", units, " is outside ", least, " to ", most));
          font.units_per_em = static_cast<int>(units);
        } else if (key == "ascender" || key == "descender") {
          const double height = xml::as_number(value, key);
          if (std::abs(height) > max_coordinate) throw Malformed(text(key, " ", height, " is beyond ", max_coordinate));
          (key == "ascender" ? ascender : descender) = height;
        } else if (key == "familyName" || key == "styleName") {
          const std::string name = xml::as_text(value, key);
          if (has_control(name)) throw Malformed(text(key, " \"", shown(name), "\" has control characters"));
          (key == "familyName" ? font.family : font.style) = name;
        }
      }
    }
    constexpr double usual_ascender = 0.8;
    constexpr double usual_descender = -0.2;
    font.ascender = ascender.value_or(usual_ascender * font.units_per_em);
    font.descender = descender.value_or(usual_descender * font.units_per_em);
  }

  const Bytes& bytes(const std::string& file) {
    file_ = file;
    const auto at = folder_.find(file);
    if (at == folder_.end()) throw Malformed("is missing");
    return at->second;
  }

 private:
  bool has_folder(const std::string& name) const {
    const auto at = folder_.lower_bound(name + "/");
    return at != folder_.end() && at->first.starts_with(name + "/");
  }

  const Folder& folder_;
  std::string file_;
  int version_ = 3;
};

void fill(Font& font) {
  UfoReader reader(*font.folder);
  try {
    reader.read_version();
    reader.check_layers();
    reader.read_info(font);
    const std::map<std::string, std::string> contents = reader.contents();
    const std::vector<std::string> names = reader.order(contents);
    std::map<std::string, int> ids;
    for (const std::string& name : names) ids.emplace(name, static_cast<int>(ids.size()));
    font.glyphs.reserve(names.size());
    for (const std::string& name : names) {
      Glif glif = parse_glif(font.folder->at(contents.at(name)), name);
      Glyph& glyph = font.glyphs.emplace_back();
      glyph.id = static_cast<int>(font.glyphs.size()) - 1;
      glyph.name = name;
      glyph.advance = glif.advance;
      glyph.trouble = glif.trouble;
      for (const char32_t code : glif.unicodes) font.character_map.emplace(code, glyph.id);
      if (!glyph.trouble.empty()) continue;
      for (const GlifComponent& component : glif.components) {
        const auto base = ids.find(component.base);
        if (base == ids.end()) {
          glyph.trouble = text("component ", shown(component.base), " is no glyph of the font");
          break;
        }
        Component part;
        part.glyph = base->second;
        part.placement = component.placement;
        glyph.components.push_back(part);
      }
      if (!glyph.trouble.empty()) {
        glyph.components.clear();
        continue;
      }
      for (GlifContour& contour : glif.contours) {
        if (!contour.outline) continue;
        for (const GlifPoint& point : contour.points) {
          const bool is_whole = point.position == Point(point.position.array().round());
          font.has_fractional_coordinates = font.has_fractional_coordinates || !is_whole;
        }
        glyph.contours.push_back(std::move(*contour.outline));
      }
      glyph.marks = std::move(glif.marks);
      for (const GlifAnchor& anchor : glif.anchors) glyph.anchors.push_back(anchor.position);
    }
  } catch (const Malformed& error) {
    throw FontReadError(text(font.path, ": ", reader.file(), ": ", error.what()));
  }
  check_composites(font);
}

// ---- writing

/// A stretch of a file and what stands there instead.
struct Replacement {
  Span span;
  std::string text;
};

Bytes replaced(const Bytes& bytes, const std::vector<Replacement>& replacements) {
  Bytes out;
  std::size_t at = 0;
  for (const auto& [span, instead] : replacements) {
    out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
               bytes.begin() + static_cast<std::ptrdiff_t>(span.begin));
    out.insert(out.end(), instead.begin(), instead.end());
    at = span.end;
  }
  out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end());
  return out;
}

/// Same kinds; same places, implied nodes aside, which follow their handles.
bool is_same(const BezierContour& a, const BezierContour& b) {
  if (a.kinds() != b.kinds()) return false;
  for (int i = 0; i < a.point_count(); ++i) {
    if (a.kind(i) != PointKind::ImpliedNode && a.point(i) != b.point(i)) return false;
  }
  return true;
}

/// An implied node is not stored, so it must be where a reader will put it.
bool is_midway(const BezierContour& contour, int i) {
  constexpr double rounding = 1e-6;  // of what computed it
  const int n = static_cast<int>(contour.point_count());
  const Point middle = 0.5 * (contour.point((i + n - 1) % n) + contour.point((i + 1) % n));
  return (contour.point(i) - middle).cwiseAbs().maxCoeff() <= rounding;
}

/// The points of a contour that a file holds.
std::vector<int> stored_indices(const BezierContour& contour) {
  std::vector<int> points;
  for (int i = 0; i < contour.point_count(); ++i) {
    if (contour.kind(i) != PointKind::ImpliedNode) points.push_back(i);
  }
  return points;
}

/// For each of `now` the one of `before` that it is, by kind and place, or -1: as many as keep their order.
std::vector<int> match_points(const BezierContour& before, const std::vector<int>& was, const BezierContour& after,
                              const std::vector<int>& now) {
  const auto is_equal = [&](std::size_t i, std::size_t k) {
    return before.kind(was[i]) == after.kind(now[k]) && before.point(was[i]) == after.point(now[k]);
  };
  std::vector<int> matched(now.size(), -1);
  std::size_t start = 0;
  std::size_t end_was = was.size();
  std::size_t end_now = now.size();
  for (; start < std::min(end_was, end_now) && is_equal(start, start); ++start)
    matched[start] = static_cast<int>(start);
  for (; end_was > start && end_now > start && is_equal(end_was - 1, end_now - 1); --end_was, --end_now) {
    matched[end_now - 1] = static_cast<int>(end_was - 1);
  }
  // The longest common subsequence of what is left, by the table of the lengths of those of all tails.
  const std::size_t rows = end_was - start;
  const std::size_t columns = end_now - start;
  constexpr std::size_t most_cells = std::size_t{1} << 24;
  if (rows == 0 || columns == 0 || rows * columns > most_cells) return matched;
  std::vector<std::uint16_t> length((rows + 1) * (columns + 1), 0);
  const auto at = [&](std::size_t i, std::size_t k) -> std::uint16_t& { return length[i * (columns + 1) + k]; };
  for (std::size_t i = rows; i-- > 0;) {
    for (std::size_t k = columns; k-- > 0;) {
      at(i, k) = is_equal(start + i, start + k) ? static_cast<std::uint16_t>(at(i + 1, k + 1) + 1)
                                                : std::max(at(i + 1, k), at(i, k + 1));
    }
  }
  for (std::size_t i = 0, k = 0; i < rows && k < columns;) {
    if (is_equal(start + i, start + k)) {
      matched[start + k++] = static_cast<int>(start + i++);
    } else if (at(i + 1, k) >= at(i, k + 1)) {
      ++i;
    } else {
      ++k;
    }
  }
  return matched;
}

class Writer {
 public:
  Writer(const Font& font, const EditedGlyphs& edited, const WriteOptions& options)
      : font_(font), edited_(edited), options_(options) {}

  WrittenUfo write() {
    if (!font_.folder) fail("the font was not read from a UFO");
    result_.folder = *font_.folder;
    find_changes();
    find_respaced();
    if (changed_.empty() && respaced_.empty()) return std::move(result_);
    try {
      files_ = UfoReader(*font_.folder).contents();
    } catch (const Malformed& error) {
      fail(text("glyphs/contents.plist: ", error.what()));
    }
    std::set<int> rewritten(changed_.begin(), changed_.end());
    rewritten.insert(respaced_.begin(), respaced_.end());
    for (const int id : rewritten) rewrite(id);
    std::sort(result_.changed_files.begin(), result_.changed_files.end());
    for (const int id : dependents(font_, {rewritten.begin(), rewritten.end()})) {
      if (glyph_at(id).is_composite() && !is_decomposed(id)) result_.moved_composites.push_back(id);
    }
    warn();
    return std::move(result_);
  }

 private:
  const Glyph& glyph_at(int id) const { return font_.glyphs[static_cast<std::size_t>(id)]; }
  [[noreturn]] void fail(const std::string& why) const { throw FontWriteError(text(font_.path, ": ", why)); }
  [[noreturn]] void fail(int glyph, const std::string& why) const { fail(text(glyph_at(glyph).name, ": ", why)); }

  void find_changes() {
    for (const auto& [id, contours] : edited_) {
      if (id < 0 || static_cast<std::size_t>(id) >= font_.glyphs.size()) {
        fail(text("glyph ", id, " is no glyph of the font, which has ", font_.glyphs.size()));
      }
      const Glyph& glyph = glyph_at(id);
      if (!glyph.trouble.empty()) fail(id, text("cannot be edited: ", glyph.trouble));
      const bool is_whole = glyph.is_composite() && options_.composites == Composites::Decompose;
      const std::vector<BezierContour> before = is_whole ? decompose(font_, id) : glyph.contours;
      if (contours.size() != before.size()) {
        fail(id, text(contours.size(), " contours for the font's ", before.size()));
      }
      bool is_changed = false;
      for (std::size_t c = 0; c < contours.size(); ++c) {
        for (int i = 0; i < contours[c].point_count(); ++i) {
          const Point p = contours[c].point(i);
          const std::string where = text("contour ", c, ", point ", i, ": (", p.x(), ", ", p.y(), ")");
          if (p.cwiseAbs().maxCoeff() > max_coordinate) fail(id, text(where, " is beyond ", max_coordinate));
          if (contours[c].kind(i) == PointKind::ImpliedNode && !is_midway(contours[c], i)) {
            fail(id, where + " is an implied node not midway between its handles");
          }
        }
        is_changed = is_changed || !is_same(contours[c], before[c]);
      }
      if (is_changed) changed_.push_back(id);
      if (is_changed && is_whole) result_.decomposed.push_back(id);
    }
  }

  /// Glyphs with another advance, with components or anchors elsewhere.
  void find_respaced() {
    const auto checked = [&](int id) -> const Glyph& {
      if (id < 0 || static_cast<std::size_t>(id) >= font_.glyphs.size()) {
        fail(text("glyph ", id, " is no glyph of the font, which has ", font_.glyphs.size()));
      }
      if (!glyph_at(id).trouble.empty()) fail(id, text("cannot be edited: ", glyph_at(id).trouble));
      return glyph_at(id);
    };
    const auto require_near = [&](int id, double value) {
      if (!(std::abs(value) <= max_coordinate)) fail(id, text(value, " is beyond ", max_coordinate));
    };
    for (const auto& [id, advance] : options_.advances) {
      require_near(id, advance);
      if (checked(id).advance != advance) respaced_.insert(id);
    }
    for (const auto& [id, shifts] : options_.component_shifts) {
      if (shifts.size() != checked(id).components.size()) {
        fail(id, text(shifts.size(), " shifts for its ", glyph_at(id).components.size(), " components"));
      }
      for (const Point& shift : shifts) {
        require_near(id, shift.cwiseAbs().maxCoeff());
        if (shift != Point::Zero() && !is_decomposed(id)) respaced_.insert(id);
      }
    }
    for (const auto& [id, places] : options_.anchors) {
      if (places.size() != checked(id).anchors.size()) {
        fail(id, text(places.size(), " places for its ", glyph_at(id).anchors.size(), " anchors"));
      }
      for (const Point& place : places) require_near(id, place.cwiseAbs().maxCoeff());
      if (places != glyph_at(id).anchors) respaced_.insert(id);
    }
  }

  double wanted_advance(int id) const {
    const auto wanted = options_.advances.find(id);
    return wanted == options_.advances.end() ? glyph_at(id).advance : wanted->second;
  }
  Point wanted_shift(int id, std::size_t component) const {
    const auto shifts = options_.component_shifts.find(id);
    const Point& old = glyph_at(id).components[component].placement.shift;
    return shifts == options_.component_shifts.end() ? old : Point(old + shifts->second[component]);
  }

  /// Digits of advance, offsets and anchors that are to be others.
  void respace(int id, const Glif& glif, std::vector<Replacement>& replacements) const {
    if (const double advance = wanted_advance(id); advance != glif.advance) {
      if (!glif.width) fail(id, "has no width that could be another");
      replacements.push_back({*glif.width, xml::number_text(advance)});
    }
    for (std::size_t k = 0; k < glif.components.size() && !is_decomposed(id); ++k) {
      const GlifComponent& component = glif.components[k];
      const Point shift = wanted_shift(id, k);
      constexpr std::size_t opening = std::string_view("<component").size();
      const std::size_t behind = component.element.begin + opening;
      const auto put = [&](const char* name, const std::optional<Span>& span, double old, double value) {
        if (value == old) return;
        const std::string digits = xml::number_text(value);
        replacements.push_back(span ? Replacement{*span, digits}
                                    : Replacement{{behind, behind}, text(" ", name, "=\"", digits, "\"")});
      };
      put("xOffset", component.x_offset, component.placement.shift.x(), shift.x());
      put("yOffset", component.y_offset, component.placement.shift.y(), shift.y());
    }
    if (const auto places = options_.anchors.find(id); places != options_.anchors.end()) {
      for (std::size_t k = 0; k < glif.anchors.size(); ++k) {
        const GlifAnchor& anchor = glif.anchors[k];
        const Point& to = places->second[k];
        if (anchor.position.x() != to.x()) replacements.push_back({anchor.x, xml::number_text(to.x())});
        if (anchor.position.y() != to.y()) replacements.push_back({anchor.y, xml::number_text(to.y())});
      }
    }
  }

  bool is_decomposed(int id) const { return std::ranges::binary_search(result_.decomposed, id); }

  /// Contours in the place of the components, and behind all contours of the file, laid out like the components.
  void decompose_file(int id, const Bytes& bytes, const Glif& glif, std::vector<Replacement>& replacements) const {
    const std::vector<BezierContour>& contours = edited_.at(id);
    const auto blank_before = [&](std::size_t at) {
      std::size_t begin = at;
      while (begin > 0 && std::strchr(" \t\r\n", bytes[begin - 1]) != nullptr) --begin;
      return std::string(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                         bytes.begin() + static_cast<std::ptrdiff_t>(at));
    };
    const std::string gap = blank_before(glif.components.front().element.begin);
    const bool has_lines = gap.find('\n') != std::string::npos;
    const std::string deeper = !has_lines ? "" : gap + (gap.find('\t') != std::string::npos ? "\t" : "  ");
    std::string out;
    for (std::size_t c = glif.outlines().size(); c < contours.size(); ++c) {
      out += (out.empty() ? "" : gap) + "<contour>";
      for (const int point : stored_indices(contours[c])) out += deeper + point_element(contours[c], point);
      out += gap + "</contour>";
    }
    std::size_t behind = 0;  // the points of all contours
    for (const GlifContour& contour : glif.contours) {
      if (!contour.points.empty()) behind = std::max(behind, contour.points.back().element.end);
    }
    const bool is_last = glif.components.back().element.begin >= behind;
    for (const GlifComponent& component : glif.components) {
      Span span = component.element;
      const bool takes_contours = is_last && &component == &glif.components.back();
      if (!takes_contours) span.begin -= blank_before(span.begin).size();
      replacements.push_back({span, takes_contours ? out : ""});
    }
    if (!is_last) {
      constexpr std::string_view closing = "</contour>";
      const auto end =
          std::search(bytes.begin() + static_cast<std::ptrdiff_t>(behind), bytes.end(), closing.begin(), closing.end());
      const auto at = static_cast<std::size_t>(end - bytes.begin()) + closing.size();
      if (at > bytes.size()) fail(id, "its contours do not end as they begin");
      replacements.push_back({{at, at}, gap + out});
    }
  }

  void rewrite(int id) {
    const Glyph& glyph = glyph_at(id);
    const auto file = files_.find(glyph.name);
    if (file == files_.end()) fail(id, "has no file in glyphs/contents.plist");
    const Bytes& before = font_.folder->at(file->second);
    const Glif glif = parse_glif(before, glyph.name);
    const std::vector<const GlifContour*> outlines = glif.outlines();
    if (!glif.trouble.empty() || outlines.size() != glyph.contours.size()) {
      fail(id, text(file->second, " is not what the font was read from"));
    }
    std::vector<Replacement> replacements;
    const auto edited = edited_.find(id);
    const std::vector<BezierContour>& contours = edited == edited_.end() ? glyph.contours : edited->second;
    for (std::size_t c = 0; c < outlines.size(); ++c) {
      const GlifContour& contour = *outlines[c];
      if (!is_same(*contour.outline, glyph.contours[c])) {
        fail(id, text("contour ", c, ": ", file->second, " is not what the font was read from"));
      }
      if (contours[c].kinds() == contour.outline->kinds()) {
        move_points(contour, contours[c], replacements);
      } else {
        replacements.push_back(relaid(id, c, before, contour, contours[c]));
      }
    }
    if (is_decomposed(id)) {
      decompose_file(id, before, glif, replacements);
      for (const GlifComponent& component : glif.components) lost_names_[id] += component.is_named ? 1 : 0;
    }
    respace(id, glif, replacements);
    std::ranges::stable_sort(replacements, {}, [](const Replacement& r) { return r.span.begin; });
    Bytes after = replaced(before, replacements);
    read_back(id, file->second, glif, parse_glif(after, glyph.name));
    result_.folder[file->second] = std::move(after);
    result_.changed_files.push_back(file->second);
    if (!std::ranges::binary_search(changed_, id)) return;
    for (const std::string& key : glif.hints) stale_[key].push_back(id);
    if (!glif.anchors.empty() && !options_.anchors.contains(id)) kept_anchors_.push_back(id);
  }

  /// New digits where a coordinate is another one.
  static void move_point(const GlifPoint& point, const Point& to, std::vector<Replacement>& replacements) {
    std::vector<Replacement> moved;
    if (point.position.x() != to.x()) moved.push_back({point.x, xml::number_text(to.x())});
    if (point.position.y() != to.y()) moved.push_back({point.y, xml::number_text(to.y())});
    if (moved.size() == 2 && moved[0].span.begin > moved[1].span.begin) std::swap(moved[0], moved[1]);
    replacements.insert(replacements.end(), moved.begin(), moved.end());
  }

  static void move_points(const GlifContour& contour, const BezierContour& after,
                          std::vector<Replacement>& replacements) {
    for (int i = 0; i < after.point_count(); ++i) {
      const int stored = contour.stored[static_cast<std::size_t>(i)];
      if (stored >= 0) move_point(contour.points[static_cast<std::size_t>(stored)], after.point(i), replacements);
    }
  }

  /// For each stored point of the edited contour the one of the file that it is, or -1.
  std::vector<int> kept_points(int id, std::size_t c, const GlifContour& contour, const BezierContour& after,
                               const std::vector<int>& now) const {
    const auto given = options_.origins.find(id);
    if (given == options_.origins.end() || c >= given->second.size()) {
      return match_points(*contour.outline, stored_indices(*contour.outline), after, now);
    }
    const std::vector<int>& came_from = given->second[c];
    if (came_from.size() != static_cast<std::size_t>(after.point_count())) {
      fail(id, text("contour ", c, ": origins of ", came_from.size(), " points for ", after.point_count()));
    }
    std::vector<int> kept;
    int last = -1;
    for (const int i : now) {
      const int old = came_from[static_cast<std::size_t>(i)];
      const bool is_old = old >= 0 && old < contour.outline->point_count();
      int stored = is_old ? contour.stored[static_cast<std::size_t>(old)] : -1;
      // An element says what kind of point it is.
      if (stored <= last || fontcore::is_node(after.kind(i)) != fontcore::is_node(contour.outline->kind(old)))
        stored = -1;
      last = std::max(last, stored);
      kept.push_back(stored);
    }
    return kept;
  }

  /// The elements of a contour that has other points now, from the first to the last.
  Replacement relaid(int id, std::size_t c, const Bytes& bytes, const GlifContour& contour,
                     const BezierContour& after) {
    const auto piece = [&](std::size_t begin, std::size_t end) {
      return std::string(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                         bytes.begin() + static_cast<std::ptrdiff_t>(end));
    };
    const auto is_blank = [](const std::string& s) { return s.find_first_not_of(" \t\r\n") == std::string::npos; };
    const std::vector<GlifPoint>& old = contour.points;
    const auto gap = [&](int k) {  // before element k
      const auto i = static_cast<std::size_t>(k);
      return piece(old[i - 1].element.end, old[i].element.begin);
    };
    std::string indent;
    for (int k = 1; k < static_cast<int>(old.size()) && indent.empty(); ++k) indent = is_blank(gap(k)) ? gap(k) : "";
    const std::vector<int> now = stored_indices(after);
    const std::vector<int> kept = kept_points(id, c, contour, after, now);
    std::string out;
    int last = 0;  // the element of the file that was come to
    // Comments between elements stay, also where elements go.
    const auto pass_to = [&](int element) {
      std::string passed;
      for (; last < element; ++last) {
        if (!is_blank(gap(last + 1))) passed += gap(last + 1);
      }
      return passed;
    };
    std::set<int> stays;
    for (std::size_t i = 0; i < now.size(); ++i) {
      const int stored = kept[i];
      const std::string passed = stored < 0 ? "" : pass_to(stored);
      if (!passed.empty()) {
        out += passed;
      } else if (i > 0) {
        out += indent;
      }
      if (stored < 0) {
        out += point_element(after, now[i]);
        continue;
      }
      stays.insert(stored);
      const GlifPoint& point = old[static_cast<std::size_t>(stored)];
      std::vector<Replacement> changes;
      move_point(point, after.point(now[i]), changes);
      if (after.kind(now[i]) == PointKind::Node && !is_compatible(point.type, after, now[i])) {
        changes.push_back({point.type_name, segment_type(after, now[i])});
        std::sort(changes.begin(), changes.end(),
                  [](const Replacement& a, const Replacement& b) { return a.span.begin < b.span.begin; });
      }
      std::size_t at = point.element.begin;
      for (const auto& [span, instead] : changes) {
        out += piece(at, span.begin) + instead;
        at = span.end;
      }
      out += piece(at, point.element.end);
    }
    out += pass_to(static_cast<int>(old.size()) - 1);
    for (std::size_t k = 0; k < old.size(); ++k) {
      if (old[k].is_named && stays.count(static_cast<int>(k)) == 0) ++lost_names_[id];
    }
    return {{old.front().element.begin, old.back().element.end}, out};
  }

  void read_back(int id, const std::string& file, const Glif& before, const Glif& after) const {
    if (!after.trouble.empty()) fail(id, text(file, " does not read back: ", after.trouble));
    const auto edited = edited_.find(id);
    const std::vector<BezierContour>& wanted = edited == edited_.end() ? glyph_at(id).contours : edited->second;
    const std::vector<const GlifContour*> outlines = after.outlines();
    const std::size_t own = before.contours.size() + wanted.size() - before.outlines().size();
    bool is_good = outlines.size() == wanted.size() && own == after.contours.size();
    for (std::size_t c = 0; is_good && c < wanted.size(); ++c) is_good = is_same(*outlines[c]->outline, wanted[c]);
    if (!is_good) fail(id, text(file, " reads back with another outline"));
    std::vector<GlifComponent> parts = is_decomposed(id) ? std::vector<GlifComponent>() : before.components;
    for (std::size_t k = 0; k < parts.size(); ++k) parts[k].placement.shift = wanted_shift(id, k);
    const bool has_same_parts = std::equal(parts.begin(), parts.end(), after.components.begin(), after.components.end(),
                                           [](const GlifComponent& a, const GlifComponent& b) {
                                             return a.base == b.base && a.placement.linear == b.placement.linear &&
                                                    a.placement.shift == b.placement.shift;
                                           });
    if (!has_same_parts || wanted_advance(id) != after.advance || before.unicodes != after.unicodes) {
      fail(id, text(file, " reads back with another advance, character or component"));
    }
    std::vector<Point> anchors;
    for (const GlifAnchor& anchor : after.anchors) anchors.push_back(anchor.position);
    const auto places = options_.anchors.find(id);
    if (anchors != (places == options_.anchors.end() ? glyph_at(id).anchors : places->second)) {
      fail(id, text(file, " reads back with other anchors"));
    }
  }

  /// Names, the first few of them.
  std::string list_names(const std::vector<int>& glyphs) const {
    constexpr std::size_t shown_names = 8;
    std::string list;
    for (std::size_t i = 0; i < std::min(shown_names, glyphs.size()); ++i)
      list += (i ? ", " : "") + glyph_at(glyphs[i]).name;
    return glyphs.size() > shown_names ? text(list, " and ", glyphs.size() - shown_names, " more") : list;
  }

  void warn() {
    for (const auto& [key, glyphs] : stale_) {
      result_.warnings.push_back(
          text(key, ": kept, though the outline is another one now: stale in ", list_names(glyphs)));
    }
    if (!kept_anchors_.empty())
      result_.warnings.push_back(text("anchors: kept where they were in ", list_names(kept_anchors_)));
    for (const auto& [id, count] : lost_names_) {
      if (count == 0) continue;
      result_.warnings.push_back(
          text(glyph_at(id).name, ": ", count, " points or components with a name or identifier are gone"));
    }
  }

  const Font& font_;
  const EditedGlyphs& edited_;
  const WriteOptions& options_;
  std::vector<int> changed_;
  std::map<std::string, std::string> files_;
  std::map<std::string, std::vector<int>> stale_;  // by key of the lib
  std::set<int> respaced_;
  std::vector<int> kept_anchors_;
  std::map<int, int> lost_names_;
  WrittenUfo result_;
};

}  // namespace

Font load_ufo(const std::string& path, Folder folder) {
  Font font;
  font.path = path;
  font.format = OutlineFormat::Ufo;
  font.folder = std::make_shared<const Folder>(std::move(folder));
  fill(font);
  return font;
}

WrittenUfo write_ufo(const Font& font, const EditedGlyphs& edited, const WriteOptions& options) {
  return Writer(font, edited, options).write();
}

std::vector<std::int64_t> glif_bytes(const Font& font, const Folder& folder) {
  std::vector<std::int64_t> bytes(font.glyphs.size(), 0);
  try {
    const std::map<std::string, std::string> files = UfoReader(folder).contents();
    for (const Glyph& glyph : font.glyphs) {
      const auto file = files.find(glyph.name);
      if (file == files.end()) continue;
      bytes[static_cast<std::size_t>(glyph.id)] = static_cast<std::int64_t>(folder.at(file->second).size());
    }
  } catch (const Malformed& error) {
    throw FontReadError(text(font.path, ": glyphs/contents.plist: ", error.what()));
  }
  return bytes;
}

}  // namespace glyphs
