#include "glyphs/sfnt_writer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/freetype_loader.h"
#include "glyphs/jobs.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/sfnt_check.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::PointKind;
using fontcore::text;
using sfnt::Box;
using sfnt::Malformed;
using sfnt::put_box;
using sfnt::put_u16;
using sfnt::put_u32;
using sfnt::SimpleGlyph;
using sfnt::Tag;
using sfnt::tag;
using sfnt::View;

constexpr Eigen::Index most_drawn = 32767;  // FreeType counts points in 16 bits
constexpr std::size_t most_points = 65535;  // of a simple glyph: the last one's number has 16 bits, maxp's count too
constexpr int int16_min = std::numeric_limits<std::int16_t>::min();
constexpr int int16_max = std::numeric_limits<std::int16_t>::max();
bool fits_int16(double value) { return value >= int16_min && value <= int16_max; }

/// Names, the first few of them.
std::string list_names(const Font& font, const std::vector<int>& glyphs) {
  constexpr std::size_t shown = 8;
  std::string list;
  for (std::size_t i = 0; i < std::min(shown, glyphs.size()); ++i) {
    list += (i ? ", " : "") + font.glyphs[static_cast<std::size_t>(glyphs[i])].name;
  }
  return glyphs.size() > shown ? text(list, " and ", glyphs.size() - shown, " more") : list;
}

/// Same structure; same points, implied nodes aside, which follow their handles.
bool is_same_outline(const std::vector<BezierContour>& a, const std::vector<BezierContour>& b) {
  if (!has_same_structure(a, b)) return false;
  for (std::size_t c = 0; c < a.size(); ++c) {
    for (int i = 0; i < a[c].point_count(); ++i) {
      if (a[c].kind(i) != PointKind::ImpliedNode && a[c].point(i) != b[c].point(i)) return false;
    }
  }
  return true;
}

bool is_same_part(const Component& a, const Component& b) {
  return a.glyph == b.glyph && a.placement.linear == b.placement.linear && a.placement.shift == b.placement.shift &&
         a.matched_parent == b.matched_parent && a.matched_child == b.matched_child &&
         a.use_my_metrics == b.use_my_metrics;
}

// ---- the font

/// The box of what every glyph draws, before and after; none if it draws nothing.
struct Boxes {
  std::vector<std::optional<Box>> before;
  std::vector<std::optional<Box>> after;
};

/// What hhea (or vhea, with y for x) and head say of all outlines together.
struct Summary {
  int min_left = std::numeric_limits<int>::max();
  int min_right = std::numeric_limits<int>::max();
  int max_extent = std::numeric_limits<int>::min();
  std::optional<Box> box;

  void add(const Box& its, int bearing, int advance) {
    const int extent = bearing + its.x_max - its.x_min;
    min_left = std::min(min_left, bearing);
    min_right = std::min(min_right, advance - extent);
    max_extent = std::max(max_extent, extent);
    box = box ? Box{std::min(box->x_min, its.x_min), std::min(box->y_min, its.y_min), std::max(box->x_max, its.x_max),
                    std::max(box->y_max, its.y_max)}
              : its;
  }
};

/// Looks in GPOS for anchors that name a point of an outline, by its number.
class PointAnchors {
 public:
  explicit PointAnchors(View gpos) : gpos_(gpos) {}

  /// What cannot be read has none.
  bool exist() {
    try {
      const std::uint64_t lookups = u16(8);
      for (std::uint64_t i = 0; i < u16(lookups) && !found_; ++i) look_up(lookups + u16(lookups + 2 + 2 * i));
    } catch (const Malformed&) {
      return found_;
    }
    return found_;
  }

 private:
  std::uint64_t u16(std::uint64_t at) {
    if (++reads_ > most_reads) throw Malformed("tables that share their parts without end");
    return sfnt::u16(gpos_, at);
  }

  void look_up(std::uint64_t lookup) {
    enum : unsigned { cursive = 3, mark_to_base = 4, mark_to_ligature = 5, mark_to_mark = 6, extension = 9 };
    for (std::uint64_t i = 0; i < u16(lookup + 4) && !found_; ++i) {
      std::uint64_t type = u16(lookup);
      std::uint64_t at = lookup + u16(lookup + 6 + 2 * i);
      if (type == extension) {
        type = u16(at + 2);
        at += sfnt::u32(gpos_, at + 4);
      }
      if (type == cursive) {
        see_all(at, at + 6, 2 * u16(at + 4), 2);
      } else if (type >= mark_to_base && type <= mark_to_mark) {
        const std::uint64_t classes = u16(at + 6);
        const std::uint64_t marks = at + u16(at + 8);
        see_all(marks, marks + 4, u16(marks), 4);
        const std::uint64_t bases = at + u16(at + 10);
        if (type != mark_to_ligature) {
          see_all(bases, bases + 2, classes * u16(bases), 2);
          continue;
        }
        for (std::uint64_t k = 0; k < u16(bases); ++k) {
          const std::uint64_t ligature = bases + u16(bases + 2 + 2 * k);
          see_all(ligature, ligature + 2, classes * u16(ligature), 2);
        }
      }
    }
  }

  /// Anchors by their offsets from `base`, which stand `stride` bytes apart.
  void see_all(std::uint64_t base, std::uint64_t offsets, std::uint64_t count, std::uint64_t stride) {
    for (std::uint64_t i = 0; i < count && !found_; ++i) {
      const std::uint64_t offset = u16(offsets + stride * i);
      constexpr std::uint64_t by_point = 2;
      found_ = offset != 0 && u16(base + offset) == by_point;
    }
  }

  static constexpr int most_reads = 20'000'000;
  View gpos_;
  int reads_ = 0;
  bool found_ = false;
};

class Writer {
 public:
  Writer(const Font& font, const EditedGlyphs& edited, const WriteOptions& options)
      : font_(font), edited_(edited), options_(options) {}

  WrittenFont write() {
    find_changes();
    result_.warnings = font_.warnings;
    if (has_no_change() && (!options_.is_checked || is_faultless())) {
      copy_all();
      return std::move(result_);
    }
    refuse_formats();
    open_tables();
    empty_glyphs();
    if (font_.format == OutlineFormat::Cff) {
      rebuild_cff();
    } else {
      encode_glyphs();
      move_composites();
      rebuild_tables();
    }
    // Made untrue by any edit of outlines: the signature, and what was derived from hinted widths and heights.
    assemble(void_tables());
    std::ranges::sort(result_.dropped_instructions);
    warn();
    read_back();
    return std::move(result_);
  }

  void refuse_at_fault() const {
    if (!font_.data) fail("the font has no data to be written from");
    refuse_faults(faults_of(sfnt::read_directory(*font_.data, font_.face_index)));
  }

  WrittenFont write_as(OutlineFormat to, const GlyphOutlines& outlines) {
    if (!font_.data) fail("the font has no data to be converted");
    refuse_formats();
    result_.warnings = font_.warnings;
    open_tables();
    if (outlines.size() != old_glyphs_.size()) {
      fail(text("outlines of ", outlines.size(), " glyphs for ", old_glyphs_.size()));
    }
    for (const Glyph& glyph : font_.glyphs) {
      if (glyph.has_instructions) result_.dropped_instructions.push_back(glyph.id);
      if (glyph.has_hints) result_.dropped_hints.push_back(glyph.id);
      snapped_[glyph.id] = outlines[static_cast<std::size_t>(glyph.id)];
      changed_.push_back(glyph.id);
    }
    std::set<Tag> gone = void_tables();
    if (to == OutlineFormat::Cff) {
      rebuild_as_cff(outlines);
      directory_.version = tag("OTTO");
      gone.insert({tag("glyf"), tag("loca"), tag("fpgm"), tag("prep"), tag("cvt ")});
    } else {
      rebuild_as_truetype(outlines);
      directory_.version = 0x00010000;
      gone.insert({tag("CFF "), tag("VORG")});
    }
    assemble(gone);
    refuse_faults(sfnt::find_faults(sfnt::read_directory(result_.data, 0)));
    warn();
    if (const sfnt::TableRecord* gpos = directory_.find(tag("GPOS")); gpos && PointAnchors(gpos->bytes).exist()) {
      result_.warnings.emplace_back(
          "GPOS: has anchors that name points of outlines by their numbers, which are others now");
    }
    read_back_converted();
    if (to == OutlineFormat::Cff) check_by_freetype();
    return std::move(result_);
  }

 private:
  const Glyph& glyph_at(int id) const { return font_.glyphs[static_cast<std::size_t>(id)]; }
  [[noreturn]] void fail(const std::string& why) const { throw FontWriteError(text(font_.path, ": ", why)); }
  [[noreturn]] void fail(int glyph, const std::string& why) const { fail(text(glyph_at(glyph).name, ": ", why)); }

  /// The edited glyphs that differ from the font's, with their structure checked; a composite's is that of its parts.
  void find_changes() {
    if (!font_.data) fail("the font has no data to be written from");
    for (const auto& [id, contours] : edited_) {
      if (id < 0 || static_cast<std::size_t>(id) >= font_.glyphs.size()) {
        fail(text("glyph ", id, " is no glyph of the font, which has ", font_.glyphs.size()));
      }
      const Glyph& glyph = glyph_at(id);
      if (!glyph.trouble.empty()) fail(id, text("cannot be edited: ", glyph.trouble));
      const bool is_composite = glyph.is_composite();
      if (is_composite && options_.composites == Composites::Refuse) {
        fail(id, "is a composite; it is edited through its components");
      }
      const std::vector<BezierContour> before = decompose(font_, id);
      if (contours.size() != before.size()) {
        fail(id, text(contours.size(), " contours for the font's ", before.size()));
      }
      for (std::size_t c = 0; c < contours.size(); ++c) {
        for (int i = 0; i < contours[c].point_count(); ++i) {
          if (contours[c].kind(i) == PointKind::ImpliedNode) require_midpoint(id, c, contours[c], i);
        }
      }
      if (is_same_outline(contours, before)) continue;
      changed_.push_back(id);
      if (is_composite) result_.decomposed.push_back(id);
      if (has_same_structure(contours, before)) continue;
      renumbered_.push_back(id);
      if (const int user = matched_in(font_, id); user >= 0) {
        fail(id,
             text("its points are other ones now, and ", glyph_at(user).name, " matches its parts by point numbers"));
      }
    }
    find_respaced();
  }

  bool has_no_change() const { return changed_.empty() && advances_.empty() && moved_.empty(); }

  /// Advances and offsets of components that differ from the font's.
  void find_respaced() {
    for (const auto& [id, advance] : options_.advances) {
      if (id < 0 || static_cast<std::size_t>(id) >= font_.glyphs.size())
        fail(text("glyph ", id, " is none of the font"));
      if (advance != std::trunc(advance) || advance < 0.0 || advance > 0xFFFF) {
        fail(id, text("the advance ", advance, " is no whole number from 0 to 65535"));
      }
      if (advance == glyph_at(id).advance) continue;
      if (!glyph_at(id).trouble.empty()) fail(id, text("cannot get another advance: ", glyph_at(id).trouble));
      advances_[id] = static_cast<int>(advance);
    }
    for (const auto& [id, shifts] : options_.component_shifts) {
      if (id < 0 || static_cast<std::size_t>(id) >= font_.glyphs.size())
        fail(text("glyph ", id, " is none of the font"));
      if (shifts.size() != glyph_at(id).components.size()) {
        fail(id, text(shifts.size(), " shifts for its ", glyph_at(id).components.size(), " components"));
      }
      if (is_decomposed(id)) continue;
      if (std::ranges::any_of(shifts, [](const fontcore::Point& shift) { return shift != fontcore::Point::Zero(); })) {
        moved_.push_back(id);
      }
    }
  }

  int wanted_advance(int id) const {
    const auto wanted = advances_.find(id);
    return wanted == advances_.end() ? static_cast<int>(glyph_at(id).advance) : wanted->second;
  }

  /// The components of a composite, with the offsets that they are to have.
  std::vector<Component> wanted_parts(int id) const {
    std::vector<Component> parts = glyph_at(id).components;
    if (!std::ranges::binary_search(moved_, id)) return parts;
    const std::vector<fontcore::Point>& shifts = options_.component_shifts.at(id);
    for (std::size_t k = 0; k < parts.size(); ++k) {
      if (shifts[k] == fontcore::Point::Zero()) continue;
      if (parts[k].matched_parent >= 0) fail(id, text("component ", k, " is placed by points, and cannot be moved"));
      fontcore::Point& shift = parts[k].placement.shift;
      shift = (shift + shifts[k]).array() + 0.5;
      shift = shift.array().floor();
    }
    return parts;
  }

  /// The font with its changed outlines, and composites with their parts where they are to be.
  Font changed_font(const EditedGlyphs& outlines) const {
    Font after = font_;
    for (const auto& [id, contours] : outlines) {
      if (!std::ranges::binary_search(changed_, id)) continue;
      after.glyphs[static_cast<std::size_t>(id)].contours = contours;
      after.glyphs[static_cast<std::size_t>(id)].components.clear();
    }
    for (const int id : moved_) after.glyphs[static_cast<std::size_t>(id)].components = wanted_parts(id);
    return after;
  }

  /// Composites that are drawn otherwise, though not edited themselves, and the glyphs that are.
  std::vector<int> drawn_otherwise() const {
    std::vector<int> sources = changed_;
    sources.insert(sources.end(), moved_.begin(), moved_.end());
    return dependents(font_, sources);
  }

  bool is_decomposed(int id) const { return std::ranges::binary_search(result_.decomposed, id); }

  /// Nothing is edited: the file, or a face of a collection by itself.
  void copy_all() {
    result_.data = *font_.data;
    if (!font_.is_collection) return;
    const sfnt::Directory face = sfnt::read_directory(*font_.data, font_.face_index);
    std::vector<sfnt::TableRecord> tables = sfnt::in_file_order(face);
    if (std::erase_if(tables, [](const sfnt::TableRecord& table) { return table.tag == tag("DSIG"); }) > 0) {
      result_.dropped_tables.emplace_back("DSIG");
    }
    result_.data = sfnt::build(face.version, tables);
  }

  static std::set<Tag> void_tables() { return {tag("DSIG"), tag("hdmx"), tag("LTSH"), tag("VDMX")}; }

  void refuse_faults(const sfnt::Faults& faults) const {
    if (faults.tables.empty()) return;
    std::string all;
    for (const std::string& fault : faults.tables) all += (all.empty() ? "" : "; ") + fault;
    fail(text("browsers would refuse the whole font: ", all));
  }

  /// Of a font in which nothing is edited.
  bool is_faultless() const {
    const sfnt::Directory directory = sfnt::read_directory(*font_.data, font_.face_index);
    const sfnt::Faults faults = sfnt::find_faults(directory);
    refuse_faults(faults);
    return faults.glyphs.empty() && (font_.is_collection || sfnt::is_well_laid_out(directory, *font_.data));
  }

  /// Of what stays when something is edited.
  static sfnt::Faults faults_of(sfnt::Directory kept) {
    std::erase_if(kept.tables, [&](const sfnt::TableRecord& table) { return void_tables().contains(table.tag); });
    return sfnt::find_faults(kept);
  }

  /// Gives up glyphs for which the whole font would be refused. What is edited has bytes of ours.
  void empty_glyphs() {
    sfnt::Faults faults = faults_of(directory_);
    refuse_faults(faults);
    for (const int id : changed_) faults.glyphs.erase(id);
    result_.emptied = std::move(faults.glyphs);
    for (const auto& [id, why] : result_.emptied) {
      new_glyphs_[static_cast<std::size_t>(id)] = Bytes();
      result_.warnings.push_back(text(glyph_at(id).name, ": comes out empty: ", why));
    }
  }

  bool is_emptied(int id) const { return result_.emptied.contains(id); }

  void refuse_formats() const {
    if (font_.format != OutlineFormat::TrueType && font_.format != OutlineFormat::Cff) {
      fail("this version writes TrueType and CFF outlines only");
    }
    if (font_.is_variable) fail("is variable, and edited at one place of its design space only: give a --location");
  }

  void open_tables() {
    directory_ = sfnt::read_directory(*font_.data, font_.face_index);
    if (directory_.has(tag("gvar"))) fail("this version does not write variable fonts (table gvar)");
    basics_ = sfnt::read_basics(directory_);
    const auto count = static_cast<std::size_t>(basics_.glyph_count);
    if (font_.glyphs.size() != count) fail(text(font_.glyphs.size(), " glyphs, but its data has ", count));
    old_glyphs_.resize(count);
    is_lost_.resize(count);
    std::uint64_t total = 0;
    for (int id = 0; id < basics_.glyph_count && font_.format == OutlineFormat::TrueType; ++id) {
      const auto k = static_cast<std::size_t>(id);
      try {
        old_glyphs_[k] = basics_.outlines.bytes(id);
      } catch (const Malformed&) {
        is_lost_[k] = true;
      }
      total += old_glyphs_[k].size();
    }
    if (total > max_font_size) fail(text("table loca: glyphs share their bytes, and have ", total, " one by one"));
    new_glyphs_.resize(count);
    const auto copy = [&](Tag name) {
      const View bytes = directory_.require(name, 0);
      return Bytes(bytes.begin(), bytes.end());
    };
    for (const Tag name : {tag("head"), tag("hhea"), tag("hmtx"), tag("maxp")}) rebuilt_[name] = copy(name);
    layout_ = basics_.metrics;
    if (!advances_.empty()) set_advances();
  }

  /// hmtx with the advances that are wanted, longer if glyphs that shared the last one no longer do; and what hhea and
  /// OS/2 say of all of them.
  void set_advances() {
    const int count = basics_.glyph_count;
    double before = 0.0;
    double after = 0.0;
    int wide = 0;
    int widest_before = 0;
    int widest = 0;
    std::vector<int> advances;
    for (int id = 0; id < count; ++id) {
      const int old = basics_.metrics.advance(id);
      advances.push_back(advances_.contains(id) ? advances_.at(id) : old);
      before += old;
      after += advances.back();
      wide += advances.back() > 0 ? 1 : 0;
      widest_before = std::max(widest_before, old);
      widest = std::max(widest, advances.back());
    }
    int long_count = count;
    while (long_count > 1 &&
           advances[static_cast<std::size_t>(long_count) - 1] == advances[static_cast<std::size_t>(long_count) - 2])
      --long_count;
    layout_.long_count = std::max(long_count, basics_.metrics.long_count);
    Bytes hmtx;
    for (int id = 0; id < count; ++id) {
      if (id < layout_.long_count) sfnt::append_u16(hmtx, advances[static_cast<std::size_t>(id)]);
      sfnt::append_u16(hmtx, basics_.metrics.bearing(id));
    }
    rebuilt_[tag("hmtx")] = std::move(hmtx);
    Bytes& hhea = rebuilt_[tag("hhea")];
    put_u16(hhea, 34, layout_.long_count);
    if (widest != widest_before) put_u16(hhea, 10, widest);
    const sfnt::TableRecord* os2 = directory_.find(tag("OS/2"));
    if (!os2 || os2->bytes.size() < 4 || wide == 0) return;
    // However it was averaged, by version or by mistake, it moves with the mean.
    const double average = sfnt::i16(os2->bytes, 2) + (after - before) / wide;
    Bytes& bytes = rebuilt_[tag("OS/2")] = Bytes(os2->bytes.begin(), os2->bytes.end());
    put_u16(bytes, 2, static_cast<int>(std::clamp(std::floor(average + 0.5), 0.0, 32767.0)));
  }

  void encode_glyphs() {
    for (const int id : changed_) {
      const std::vector<BezierContour>& contours = edited_.at(id);
      SimpleGlyph stored;
      if (is_decomposed(id)) {
        stored.ends.resize(contours.size());
        stored.overlaps = has_overlaps(id);
      } else {
        stored = sfnt::read_simple_glyph(old_glyphs_[static_cast<std::size_t>(id)]);
      }
      stored.overlaps = stored.overlaps || std::ranges::binary_search(options_.overlapping, id);
      if (stored.ends.size() != contours.size()) {
        fail(id, text("the font's data has ", stored.ends.size(), " contours, the glyph ", contours.size()));
      }
      const Box box = list_points(id, contours, stored);
      place(id, sfnt::encode(stored, box), box);
      if (glyph_at(id).has_instructions) result_.dropped_instructions.push_back(id);
    }
  }

  /// Points and ends of the contours, as TrueType stores them; their box.
  Box list_points(int id, const std::vector<BezierContour>& contours, SimpleGlyph& stored) {
    stored.points.clear();
    Box box{int16_max, int16_max, int16_min, int16_min};
    for (std::size_t c = 0; c < contours.size(); ++c) {
      const BezierContour& contour = contours[c];
      for (int i = 0; i < contour.point_count(); ++i) {
        if (contour.kind(i) == PointKind::ImpliedNode) continue;
        if (contour.kind(i) == PointKind::Cubic) {
          fail(id, text("contour ", c, ", point ", i, ": a handle of a cubic, which TrueType does not have"));
        }
        const auto [x, y] = whole(id, c, contour, i);
        const SimpleGlyph::Point point{x, y, contour.kind(i) == PointKind::Node};
        box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, x), std::max(box.y_max, y)};
        if (!stored.points.empty()) require_step(id, c, stored.points.back(), point);
        stored.points.push_back(point);
      }
      stored.ends[c] = static_cast<int>(stored.points.size()) - 1;
    }
    if (stored.points.size() > most_points) {
      fail(id, text(stored.points.size(), " points, more than the ", most_points, " of the format"));
    }
    raise_maximum(6, static_cast<int>(stored.points.size()));
    raise_maximum(8, static_cast<int>(stored.ends.size()));
    return box;
  }

  /// True if a composite says that its parts overlap, or if the contours of one do.
  bool has_overlaps(int composite) const {
    constexpr unsigned overlap_compound = 0x0400;
    std::set<int> seen{composite};
    std::vector<int> open{composite};
    while (!open.empty()) {
      const int id = open.back();
      open.pop_back();
      const View bytes = old_glyphs_[static_cast<std::size_t>(id)];
      const Glyph& glyph = glyph_at(id);
      if (!glyph.is_composite()) {
        if (!glyph.contours.empty() && sfnt::read_simple_glyph(bytes).overlaps) return true;
        continue;
      }
      if (sfnt::u16(bytes, 10) & overlap_compound) return true;
      for (const Component& part : glyph.components) {
        if (seen.insert(part.glyph).second) open.push_back(part.glyph);
      }
    }
    return false;
  }

  std::pair<int, int> whole(int id, std::size_t c, const BezierContour& contour, int i) const {
    const fontcore::Point p = contour.point(i);
    for (const double value : {p.x(), p.y()}) {
      const char* why = value != std::trunc(value) ? " is no whole number" : " does not fit in 16 bits";
      if (value != std::trunc(value) || !fits_int16(value)) {
        fail(id, text("contour ", c, ", point ", i, ": coordinate ", value, why));
      }
    }
    return {static_cast<int>(p.x()), static_cast<int>(p.y())};
  }

  void require_step(int id, std::size_t c, const SimpleGlyph::Point& from, const SimpleGlyph::Point& to) const {
    if (fits_int16(to.x - from.x) && fits_int16(to.y - from.y)) return;
    fail(id, text("contour ", c, ": the step from (", from.x, ", ", from.y, ") to (", to.x, ", ", to.y,
                  ") does not fit in 16 bits"));
  }

  /// An implied node is not stored, so it must be where a reader will put it.
  void require_midpoint(int id, std::size_t c, const BezierContour& contour, int i) const {
    constexpr double rounding = 1e-6;  // of what computed it
    const int n = static_cast<int>(contour.point_count());
    const fontcore::Point middle = 0.5 * (contour.point((i + n - 1) % n) + contour.point((i + 1) % n));
    if ((contour.point(i) - middle).cwiseAbs().maxCoeff() <= rounding) return;
    fail(id, text("contour ", c, ", point ", i, ": an implied node at (", contour.point(i).x(), ", ",
                  contour.point(i).y(), ") is not midway between its handles"));
  }

  /// Gives the glyph new bytes and lets its left side bearing follow its box.
  void place(int id, Bytes bytes, const Box& box) {
    const Box old_box = sfnt::read_box(old_glyphs_[static_cast<std::size_t>(id)]);
    // A composite that takes its metrics from a part has its origin from there, whatever its own bearing says.
    const int bearing = is_decomposed(id) ? box.x_min - static_cast<int>(glyph_at(id).origin)
                                          : basics_.metrics.bearing(id) + box.x_min - old_box.x_min;
    if (!fits_int16(bearing)) fail(id, text("left side bearing ", bearing, " does not fit in 16 bits"));
    put_u16(rebuilt_[tag("hmtx")], layout_.bearing_offset(id), bearing);
    new_glyphs_[static_cast<std::size_t>(id)] = std::move(bytes);
  }

  /// A composite's bytes with its parts where they are wanted; in words where a byte no longer holds an offset.
  Bytes with_moved_parts(int id) const {
    enum : unsigned { words = 1, xy = 2, more = 0x20, instructions = 0x100, scaled_offset = 0x800 };
    const View old = old_glyphs_[static_cast<std::size_t>(id)];
    if (!std::ranges::binary_search(moved_, id)) return {old.begin(), old.end()};
    const std::vector<Component> parts = wanted_parts(id);
    Bytes bytes(old.begin(), old.begin() + 10);
    std::uint64_t at = 10;
    std::size_t k = 0;
    unsigned flags = more;
    for (; flags & more; ++k) {
      flags = sfnt::u16(old, at);
      const View record = sfnt::slice(old, at, sfnt::component_length(flags));
      at += record.size();
      if (k >= parts.size()) fail(id, "has more components than were read");
      const fontcore::Point shift = parts[k].placement.shift;
      if (!(flags & xy) || shift == glyph_at(id).components[k].placement.shift) {
        bytes.insert(bytes.end(), record.begin(), record.end());
        continue;
      }
      if (!fits_int16(shift.x()) || !fits_int16(shift.y()))
        fail(id, text("component ", k, ": its offset leaves 16 bits"));
      const auto fits_byte = [](double value) { return value >= -128.0 && value <= 127.0; };
      const bool is_wide = (flags & words) || !fits_byte(shift.x()) || !fits_byte(shift.y());
      sfnt::append_u16(bytes, static_cast<int>((flags & ~scaled_offset) | (is_wide ? words : 0U)));
      bytes.insert(bytes.end(), record.begin() + 2, record.begin() + 4);
      for (const double value : {shift.x(), shift.y()}) {
        if (is_wide) {
          sfnt::append_u16(bytes, static_cast<int>(value));
        } else {
          bytes.push_back(static_cast<unsigned char>(static_cast<int>(value) & 0xFF));
        }
      }
      const std::ptrdiff_t arguments = flags & words ? 8 : 6;
      bytes.insert(bytes.end(), record.begin() + arguments, record.end());
    }
    if (flags & instructions) {  // behind them is padding for the old length
      const View program = sfnt::slice(old, at, 2 + std::uint64_t{sfnt::u16(old, at)});
      bytes.insert(bytes.end(), program.begin(), program.end());
    }
    return bytes;
  }

  /// Those of a composite: they stand behind its components and move points by their numbers.
  static void drop_instructions(Bytes& composite) {
    enum : unsigned { more = 0x20, instructions = 0x100 };
    std::uint64_t at = 10;
    unsigned flags = more;
    while (flags & more) {
      flags = sfnt::u16(composite, at);
      put_u16(composite, at, static_cast<int>(flags & ~instructions));
      at += sfnt::component_length(flags);
    }
    composite.resize(at);
  }

  void raise_maximum(std::uint64_t offset, int value) {
    Bytes& maxp = rebuilt_[tag("maxp")];
    if (sfnt::u16(maxp, offset) < value) put_u16(maxp, offset, value);
  }

  void move_composites() {
    const Font after = changed_font(edited_);
    const std::vector<int> has_other_points = dependents(font_, renumbered_);
    for (const int id : drawn_otherwise()) {
      if (!glyph_at(id).is_composite() || is_decomposed(id) || is_emptied(id)) continue;
      result_.moved_composites.push_back(id);
      const std::vector<BezierContour> outline = compose(after, id);
      const fontcore::Box drawn = control_box(outline);
      const double origin = glyph_at(id).origin;  // the box counts from the glyph's own zero
      const auto round = [&](double value) {
        const double rounded = std::floor(value + 0.5);
        if (!fits_int16(rounded)) fail(id, text("box coordinate ", rounded, " does not fit in 16 bits"));
        return static_cast<int>(rounded);
      };
      const Box box{round(drawn.low.x() + origin), round(drawn.low.y()), round(drawn.high.x() + origin),
                    round(drawn.high.y())};
      Bytes bytes = with_moved_parts(id);
      put_box(bytes, 2, box);
      if (std::ranges::binary_search(has_other_points, id)) {
        raise_maximum(10, static_cast<int>(stored_points(outline)));
        if (glyph_at(id).has_instructions) {
          drop_instructions(bytes);
          result_.dropped_instructions.push_back(id);
        }
      }
      place(id, std::move(bytes), box);
    }
  }

  View glyph_bytes(int id) const {
    const auto& changed = new_glyphs_[static_cast<std::size_t>(id)];
    return changed ? View(*changed) : old_glyphs_[static_cast<std::size_t>(id)];
  }

  void rebuild_tables() {
    rebuild_outlines();
    Boxes boxes{std::vector<std::optional<Box>>(old_glyphs_.size()), {}};
    boxes.after = boxes.before;
    for (int id = 0; id < basics_.glyph_count; ++id) {
      if (!font_.has_outline(id) || is_emptied(id)) continue;
      boxes.before[static_cast<std::size_t>(id)] = sfnt::read_box(old_glyphs_[static_cast<std::size_t>(id)]);
      boxes.after[static_cast<std::size_t>(id)] = sfnt::read_box(glyph_bytes(id));
    }
    follow_boxes(boxes);
  }

  // ---- CFF

  /// Charstrings of edited glyphs anew, without hints; bearings and boxes after what is drawn.
  void rebuild_cff() {
    const sfnt::CffTable table(directory_.require(tag("CFF "), 4), basics_.units_per_em);
    if (table.glyph_count() != basics_.glyph_count) {
      fail(text("table CFF has ", table.glyph_count(), " charstrings for ", basics_.glyph_count, " glyphs"));
    }
    std::map<int, Bytes> charstrings;
    const auto width_of = [&](int id, double advance) {
      const sfnt::CffFontDict& dict = table.font_dict(id);
      return advance == dict.default_width ? std::nullopt : std::optional(advance - dict.nominal_width);
    };
    std::set<int> rewritten(changed_.begin(), changed_.end());
    rewritten.insert(moved_.begin(), moved_.end());
    for (const auto& [id, advance] : advances_) rewritten.insert(id);
    for (const int id : rewritten) {
      try {
        if (table.font_dict(id).is_scaled) fail(id, "cannot be edited: it is drawn through a FontMatrix");
        const sfnt::Charstring old = table.read(id);
        const std::optional<double> width = advances_.contains(id) ? width_of(id, advances_.at(id)) : old.width;
        if (std::ranges::binary_search(changed_, id)) snapped_[id] = sfnt::snap(edited_.at(id));
        const auto edited = snapped_.find(id);
        if (old.accent && edited == snapped_.end()) {
          sfnt::CffAccent accent = *old.accent;
          accent.shift = wanted_parts(id)[1].placement.shift;
          charstrings[id] = sfnt::encode_accented(accent, width);
        } else {
          const auto& contours = edited == snapped_.end() ? old.contours : edited->second;
          const bool is_like_old = has_same_structure(contours, old.contours);
          charstrings[id] =
              sfnt::encode_charstring(contours, is_like_old ? old.is_closed_by_line : std::vector<bool>{}, width);
        }
        if (old.has_hints) result_.dropped_hints.push_back(id);
      } catch (const Malformed& error) {
        fail(id, error.what());
      }
    }
    for (const auto& [id, why] : result_.emptied) {
      charstrings[id] = sfnt::encode_charstring({}, {}, width_of(id, wanted_advance(id)));
    }
    const Boxes boxes = drawn_boxes();
    for (int id = 0; id < basics_.glyph_count; ++id) {
      const auto& before = boxes.before[static_cast<std::size_t>(id)];
      const auto& after = boxes.after[static_cast<std::size_t>(id)];
      if (before && after && before->x_min != after->x_min) {
        const int bearing = basics_.metrics.bearing(id) + after->x_min - before->x_min;
        if (!fits_int16(bearing)) fail(id, text("left side bearing ", bearing, " does not fit in 16 bits"));
        put_u16(rebuilt_[tag("hmtx")], layout_.bearing_offset(id), bearing);
      }
    }
    rebuilt_[tag("CFF ")] = table.rewritten(charstrings, follow_boxes(boxes));
  }

  std::optional<Box> drawn_box(int id, const std::vector<BezierContour>& contours) const {
    try {
      return sfnt::drawn_box(contours);
    } catch (const Malformed& error) {
      fail(id, error.what());
    }
  }

  Boxes drawn_boxes() {
    Boxes boxes;
    for (const Glyph& glyph : font_.glyphs) {
      if (is_emptied(glyph.id)) {
        boxes.before.emplace_back();
        continue;
      }
      boxes.before.push_back(glyph.is_composite() ? drawn_box(glyph.id, compose(font_, glyph.id))
                                                  : drawn_box(glyph.id, glyph.contours));
    }
    boxes.after = boxes.before;
    std::optional<Font> after;  // only for composites
    for (const int id : drawn_otherwise()) {
      if (is_emptied(id)) continue;
      auto& box = boxes.after[static_cast<std::size_t>(id)];
      if (const auto changed = snapped_.find(id); changed != snapped_.end()) {
        box = drawn_box(id, changed->second);
        continue;
      }
      result_.moved_composites.push_back(id);
      if (!after) after = changed_font(snapped_);
      box = drawn_box(id, compose(*after, id));
    }
    return boxes;
  }

  // ---- outlines of the other kind
  /// Bearings, head, hhea and vhea after the boxes of what is drawn now.
  void follow_new_boxes(std::vector<std::optional<Box>> after) {
    Boxes boxes{{}, std::move(after)};
    for (const Glyph& glyph : font_.glyphs) {
      const auto k = static_cast<std::size_t>(glyph.id);
      const bool is_truetype = font_.format == OutlineFormat::TrueType;
      boxes.before.push_back(!font_.has_outline(glyph.id) ? std::nullopt
                             : is_truetype                ? std::optional<Box>(sfnt::read_box(old_glyphs_[k]))
                                                          : drawn_box(glyph.id, compose(font_, glyph.id)));
      if (const auto& box = boxes.after[k]) {
        put_u16(rebuilt_[tag("hmtx")], layout_.bearing_offset(glyph.id), box->x_min);
      }
    }
    follow_boxes(boxes);
    Bytes& head = rebuilt_[tag("head")];
    constexpr int bearings_are_x_min = 2;
    put_u16(head, 16, sfnt::u16(head, 16) | bearings_are_x_min);
  }

  void rebuild_as_cff(const GlyphOutlines& outlines) {
    sfnt::NewCff made{.name = sfnt::postscript_name(directory_, font_.family + "-" + font_.style),
                      .units_per_em = basics_.units_per_em};
    made.outlines = outlines;
    std::vector<std::optional<Box>> boxes;
    for (const Glyph& glyph : font_.glyphs) {
      made.names.push_back(glyph.name);
      made.advances.push_back(basics_.metrics.advance(glyph.id));
      boxes.push_back(drawn_box(glyph.id, outlines[static_cast<std::size_t>(glyph.id)]));
    }
    follow_new_boxes(std::move(boxes));
    Bytes& head = rebuilt_[tag("head")];
    put_u16(head, 50, 0);
    made.box = {sfnt::i16(head, 36), sfnt::i16(head, 38), sfnt::i16(head, 40), sfnt::i16(head, 42)};
    rebuilt_[tag("CFF ")] = build_cff(made);
    Bytes& maxp = rebuilt_[tag("maxp")];
    maxp.resize(6);
    put_u32(maxp, 0, 0x00005000);
    if (const sfnt::TableRecord* post = directory_.find(tag("post")); post && post->bytes.size() >= 32) {
      Bytes& bytes = rebuilt_[tag("post")] = Bytes(post->bytes.begin(), post->bytes.begin() + 32);
      put_u32(bytes, 0, 0x00030000);  // without names
    }
  }

  void rebuild_as_truetype(const GlyphOutlines& outlines) {
    Bytes& maxp = rebuilt_[tag("maxp")];
    maxp.assign(32, 0);
    put_u32(maxp, 0, 0x00010000);
    put_u16(maxp, 4, basics_.glyph_count);
    put_u16(maxp, 14, 2);  // zones
    std::vector<std::optional<Box>> boxes(outlines.size());
    Bytes glyf;
    std::vector<std::uint64_t> offsets{0};
    for (const Glyph& glyph : font_.glyphs) {
      const auto k = static_cast<std::size_t>(glyph.id);
      if (!outlines[k].empty()) {
        SimpleGlyph made;
        made.ends.resize(outlines[k].size());
        boxes[k] = list_points(glyph.id, outlines[k], made);
        const Bytes bytes = sfnt::encode(made, *boxes[k]);
        glyf.insert(glyf.end(), bytes.begin(), bytes.end());
        glyf.resize((glyf.size() + 3) / 4 * 4);
      }
      offsets.push_back(glyf.size());
    }
    if (glyf.size() > max_font_size) fail(text("table glyf: more than ", max_font_size, " bytes"));
    if (glyf.empty()) glyf.push_back(0);  // a table without bytes is refused
    follow_new_boxes(std::move(boxes));
    put_offsets(offsets, glyf.size() > sfnt::short_offsets_reach);
    rebuilt_[tag("glyf")] = std::move(glyf);
    name_in_post();
  }

  void put_offsets(const std::vector<std::uint64_t>& offsets, bool is_long) {
    rebuilt_[tag("loca")] = sfnt::build_loca(offsets, is_long);
    put_u16(rebuilt_[tag("head")], 50, is_long ? 1 : 0);
  }

  /// The names that were in CFF; glyphs of a CID-keyed font have none.
  void name_in_post() {
    const sfnt::TableRecord* post = directory_.find(tag("post"));
    if (!post || post->bytes.size() < 32) return;
    Bytes& bytes = rebuilt_[tag("post")] = Bytes(post->bytes.begin(), post->bytes.begin() + 32);
    constexpr int standard_names = 258;
    const bool is_cid_keyed = sfnt::CffTable(directory_.require(tag("CFF "), 4), basics_.units_per_em).is_cid_keyed();
    const bool has_room = basics_.glyph_count <= 0xFFFF - standard_names;
    has_names_ = !is_cid_keyed && has_room;
    put_u32(bytes, 0, has_names_ ? 0x00020000 : 0x00030000);
    if (!has_names_) return;
    sfnt::append_u16(bytes, basics_.glyph_count);
    for (int id = 0; id < basics_.glyph_count; ++id) sfnt::append_u16(bytes, standard_names + id);
    for (const Glyph& glyph : font_.glyphs) {
      constexpr std::size_t longest = 255;
      const std::string name = glyph.name.substr(0, longest);
      bytes.push_back(static_cast<unsigned char>(name.size()));
      bytes.insert(bytes.end(), name.begin(), name.end());
    }
  }

  Font read_result() const {
    std::optional<Font> read;
    try {
      read = load_sfnt("the result, read back", result_.data);
    } catch (const FontReadError& error) {
      fail(error.what());
    }
    if (read->glyphs.size() != font_.glyphs.size()) fail("the result has another number of glyphs");
    if (read->character_map != font_.character_map) fail("the result reads back with another character map");
    return std::move(*read);
  }

  /// The result, read by the loader and by FreeType, must draw what was asked, with names, advances and characters.
  void read_back_converted() const {
    const Font read = read_result();
    for (const Glyph& glyph : font_.glyphs) {
      const Glyph& back = read.glyphs[static_cast<std::size_t>(glyph.id)];
      if (!is_same_outline(back.contours, wanted_outline(glyph.id))) fail(glyph.id, "reads back with another outline");
      if (back.advance != glyph.advance || (has_names_ && glyph.id > 0 && back.name != glyph.name)) {
        fail(glyph.id, text("reads back with the advance ", back.advance, " and the name ", back.name));
      }
    }
  }

  // ---- what all outlines together say

  /// head, hhea, vhea and vmtx after the boxes; a value that the edit leaves alone stays as the font has it, even where
  /// the font has it wrong. The box of all, if it is another now.
  std::optional<Box> follow_boxes(const Boxes& boxes) {
    sfnt::Metrics metrics = layout_;
    metrics.hmtx = rebuilt_[tag("hmtx")];
    Summary before;
    Summary after;
    for (int id = 0; id < basics_.glyph_count; ++id) {
      const auto& old_box = boxes.before[static_cast<std::size_t>(id)];
      const auto& new_box = boxes.after[static_cast<std::size_t>(id)];
      if (old_box) before.add(*old_box, basics_.metrics.bearing(id), basics_.metrics.advance(id));
      if (new_box) after.add(*new_box, metrics.bearing(id), metrics.advance(id));
    }
    follow_extents(tag("hhea"), before, after);
    follow_vertical(boxes);
    set_modified();
    check_clipping(before.box, after.box);
    if (before.box == after.box) return std::nullopt;
    put_box(rebuilt_[tag("head")], 36, *after.box);
    return after.box;
  }

  void follow_extents(Tag table, const Summary& before, const Summary& after) {
    const auto follow = [&](std::uint64_t offset, int old_value, int value) {
      if (value == old_value) return;
      if (!fits_int16(value)) fail(text("table ", sfnt::tag_name(table), ": ", value, " does not fit in 16 bits"));
      put_u16(rebuilt_[table], offset, value);
    };
    follow(12, before.min_left, after.min_left);
    follow(14, before.min_right, after.min_right);
    follow(16, before.max_extent, after.max_extent);
  }

  /// Top side bearings follow yMax, so that every vertical origin stays where it is, be it told by VORG or counted from
  /// them.
  void follow_vertical(const Boxes& boxes) {
    const sfnt::TableRecord* header = directory_.find(tag("vhea"));
    const sfnt::TableRecord* table = directory_.find(tag("vmtx"));
    if (!header || !table || header->bytes.size() < 36) return;
    const auto glyphs = static_cast<std::uint64_t>(basics_.glyph_count);
    const std::uint64_t count = sfnt::u16(header->bytes, 34);
    if (count == 0 || count > glyphs || table->bytes.size() < 4 * count + 2 * (glyphs - count)) {
      result_.warnings.emplace_back("vmtx: is kept as it was: it is too short for the glyphs");
      return;
    }
    const sfnt::Metrics old{table->bytes, static_cast<int>(count)};
    Bytes& rebuilt = rebuilt_[tag("vmtx")] = Bytes(table->bytes.begin(), table->bytes.end());
    Summary before;
    Summary after;
    const auto upright = [](const Box& box) { return Box{box.y_min, box.x_min, box.y_max, box.x_max}; };
    for (int id = 0; id < basics_.glyph_count; ++id) {
      const auto& old_box = boxes.before[static_cast<std::size_t>(id)];
      const auto& new_box = boxes.after[static_cast<std::size_t>(id)];
      if (!old_box || !new_box) continue;
      const int bearing = old.bearing(id) - (new_box->y_max - old_box->y_max);
      if (!fits_int16(bearing)) fail(id, text("top side bearing ", bearing, " does not fit in 16 bits"));
      put_u16(rebuilt, old.bearing_offset(id), bearing);
      before.add(upright(*old_box), old.bearing(id), old.advance(id));
      after.add(upright(*new_box), bearing, old.advance(id));
    }
    rebuilt_[tag("vhea")] = Bytes(header->bytes.begin(), header->bytes.end());
    follow_extents(tag("vhea"), before, after);
  }

  void rebuild_outlines() {
    const sfnt::GlyphData& old = basics_.outlines;
    const bool is_whole = std::ranges::none_of(is_lost_, [](bool lost) { return lost; });
    std::uint64_t alignment = 4;
    for (int id = 0; id < basics_.glyph_count; ++id) {
      if (is_lost_[static_cast<std::size_t>(id)]) continue;
      while ((old.offset(id) | old.offset(id + 1)) % alignment != 0) alignment /= 2;
    }
    Bytes glyf;
    if (is_whole) {
      const View before = old.glyf.first(old.offset(0));
      glyf.assign(before.begin(), before.end());
    }
    std::vector<std::uint64_t> offsets(old_glyphs_.size() + 1);
    for (int id = 0; id < basics_.glyph_count; ++id) {
      offsets[static_cast<std::size_t>(id)] = glyf.size();
      const View bytes = glyph_bytes(id);
      glyf.insert(glyf.end(), bytes.begin(), bytes.end());
      if (new_glyphs_[static_cast<std::size_t>(id)]) {
        glyf.resize((glyf.size() + alignment - 1) / alignment * alignment);
      }
    }
    offsets.back() = glyf.size();
    const std::uint64_t end = glyf.size();
    const Bytes rest = is_whole ? Bytes() : unclaimed();
    const View behind = is_whole ? old.glyf.subspan(old.offset(basics_.glyph_count)) : View(rest);
    glyf.insert(glyf.end(), behind.begin(), behind.end());
    if (glyf.empty()) glyf.push_back(0);  // a table without bytes is refused
    const bool is_long = old.has_long_offsets || end > sfnt::short_offsets_reach;
    if (glyf.size() > max_font_size) fail(text("table glyf: more than ", max_font_size, " bytes"));
    put_offsets(offsets, is_long);
    if (is_long == old.has_long_offsets) {  // entries beyond the last glyph's
      Bytes& loca = rebuilt_[tag("loca")];
      const View more = old.loca.subspan(loca.size());
      loca.insert(loca.end(), more.begin(), more.end());
    }
    rebuilt_[tag("glyf")] = std::move(glyf);
  }

  /// What of the old table is no readable glyph's.
  Bytes unclaimed() const {
    std::vector<View> claimed;
    std::ranges::copy_if(old_glyphs_, std::back_inserter(claimed), [](const View& bytes) { return !bytes.empty(); });
    std::ranges::sort(claimed, std::less<>(), &View::data);
    const View glyf = basics_.outlines.glyf;
    const unsigned char* at = glyf.data();
    Bytes rest;
    for (const View bytes : claimed) {
      if (bytes.data() > at) rest.insert(rest.end(), at, bytes.data());
      at = std::max(at, bytes.data() + bytes.size());
    }
    rest.insert(rest.end(), at, glyf.data() + glyf.size());
    return rest;
  }

  void set_modified() {
    const char* epoch = std::getenv("SOURCE_DATE_EPOCH");
    if (!epoch) return;
    const std::string_view digits = epoch;
    std::uint64_t seconds = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seconds);
    if (error != std::errc() || end != digits.data() + digits.size()) {
      fail(text("SOURCE_DATE_EPOCH is no number of seconds: ", digits));
    }
    constexpr std::uint64_t from_1904_to_1970 = 2082844800;
    const std::uint64_t modified = seconds + from_1904_to_1970;
    put_u32(rebuilt_[tag("head")], 28, static_cast<std::uint32_t>(modified >> 32));
    put_u32(rebuilt_[tag("head")], 32, static_cast<std::uint32_t>(modified & 0xFFFFFFFF));
  }

  /// Windows clips at usWinAscent and usWinDescent, which are the designer's and stay.
  void check_clipping(const std::optional<Box>& before, const std::optional<Box>& after) {
    const sfnt::TableRecord* os2 = directory_.find(tag("OS/2"));
    if (!os2 || os2->bytes.size() < 78 || !before || !after) return;
    const int ascent = sfnt::u16(os2->bytes, 74);
    const int descent = sfnt::u16(os2->bytes, 76);
    if (after->y_max > ascent && after->y_max > before->y_max) {
      result_.warnings.push_back(text("OS/2: ink now reaches ", after->y_max, ", above usWinAscent ", ascent));
    }
    if (-after->y_min > descent && after->y_min < before->y_min) {
      result_.warnings.push_back(text("OS/2: ink now reaches ", after->y_min, ", below usWinDescent ", descent));
    }
  }

  /// Puts the tables together, in the order of the old file, new ones behind.
  void assemble(const std::set<Tag>& void_tables) {
    std::vector<sfnt::TableRecord> tables;
    for (const sfnt::TableRecord& table : sfnt::in_file_order(directory_)) {
      const auto rebuilt = rebuilt_.find(table.tag);
      if (void_tables.contains(table.tag)) {
        result_.dropped_tables.push_back(sfnt::tag_name(table.tag));
      } else {
        tables.push_back({table.tag, rebuilt == rebuilt_.end() ? table.bytes : View(rebuilt->second)});
      }
    }
    for (const auto& [name, bytes] : rebuilt_) {
      if (!directory_.has(name)) tables.push_back({name, bytes});
    }
    std::sort(result_.dropped_tables.begin(), result_.dropped_tables.end());
    result_.data = sfnt::build(directory_.version, tables);
    const sfnt::Directory written = sfnt::read_directory(result_.data, 0);
    for (const sfnt::TableRecord& table : written.tables) {
      const sfnt::TableRecord* old = directory_.find(table.tag);
      if (!old || !std::ranges::equal(table.bytes, old->bytes)) {
        result_.changed_tables.push_back(sfnt::tag_name(table.tag));
      }
    }
    std::sort(result_.changed_tables.begin(), result_.changed_tables.end());
  }

  void warn() {
    struct Drawing {
      Tag table;
      const char* what;
    };
    for (const Drawing& drawing : {Drawing{tag("SVG "), "an SVG drawing"}, Drawing{tag("COLR"), "coloured layers"},
                                   Drawing{tag("EBDT"), "bitmaps"}, Drawing{tag("bdat"), "bitmaps"},
                                   Drawing{tag("CBDT"), "coloured bitmaps"}, Drawing{tag("sbix"), "bitmaps"}}) {
      if (!directory_.has(drawing.table)) continue;
      result_.warnings.push_back(
          text(sfnt::tag_name(drawing.table), ": ", drawing.what,
               ", another drawing of the same glyphs, are kept as they were; edited: ", list_names(font_, changed_)));
    }
  }

  /// The result, read by the loader, must say what was asked, and the same as before of all else.
  void read_back() const {
    const Font read = read_result();
    for (const Glyph& glyph : font_.glyphs) {
      const Glyph& back = read.glyphs[static_cast<std::size_t>(glyph.id)];
      if (!result_.emptied.empty() && back.trouble.empty() && (is_emptied(glyph.id) || !glyph.trouble.empty())) {
        // With what is made of it, a glyph may be in no trouble any more.
        if (is_emptied(glyph.id) && read.has_outline(glyph.id)) fail(glyph.id, "reads back with an outline");
        if (back.name != glyph.name || back.advance != wanted_advance(glyph.id)) {
          fail(glyph.id, "the result reads back with another name or advance");
        }
        continue;
      }
      const bool is_changed = std::binary_search(changed_.begin(), changed_.end(), glyph.id);
      const auto& wanted = is_changed ? wanted_outline(glyph.id) : glyph.contours;
      if (!is_same_outline(back.contours, wanted)) fail(glyph.id, "the result reads back with another outline");
      const std::vector<Component> parts = is_changed ? std::vector<Component>() : wanted_parts(glyph.id);
      if (back.name != glyph.name || back.advance != wanted_advance(glyph.id) ||
          (back.origin != glyph.origin && (result_.emptied.empty() || !glyph.is_composite())) ||
          back.trouble.empty() != glyph.trouble.empty() ||
          !std::equal(back.components.begin(), back.components.end(), parts.begin(), parts.end(), is_same_part)) {
        fail(glyph.id, "the result reads back with another name, advance, origin or components");
      }
    }
    if (font_.format == OutlineFormat::Cff) check_by_freetype();
  }

  const std::vector<BezierContour>& wanted_outline(int id) const {
    const auto snapped = snapped_.find(id);
    return snapped == snapped_.end() ? edited_.at(id) : snapped->second;
  }

  /// What our reader made of charstrings that our writer made, FreeType must make of them too: exactly, where all
  /// coordinates are whole; others it truncates.
  void check_by_freetype() const {
    std::vector<int> whole;
    for (const int id : changed_) {
      const bool has_fraction = std::ranges::any_of(wanted_outline(id), [](const BezierContour& contour) {
        return (contour.points().array() != contour.points().array().floor()).any();
      });
      if (!has_fraction) whole.push_back(id);
    }
    const auto outlines = read_by_freetype(result_.data, whole);
    for (std::size_t k = 0; k < whole.size(); ++k) {
      if (without_empty_lines(wanted_outline(whole[k])) != outlines[k]) {
        fail(whole[k], "FreeType reads another outline from the result");
      }
    }
  }

  /// As FreeType leaves a CFF glyph: no lines of no length, no contours of one point.
  static std::vector<BezierContour> without_empty_lines(const std::vector<BezierContour>& contours) {
    std::vector<BezierContour> result;
    for (const BezierContour& contour : contours) {
      std::vector<int> kept;
      for (int i = 0; i < contour.point_count(); ++i) {
        const bool is_line = i > 0 && contour.kind(i) == PointKind::Node && contour.kind(i - 1) == PointKind::Node;
        if (!is_line || contour.point(i) != contour.point(i - 1)) kept.push_back(i);
      }
      // The end lies on the start, and only a line of no length is between them.
      if (kept.size() > 1 && contour.kind(kept.back()) == PointKind::Node &&
          contour.point(kept.back()) == contour.point(0)) {
        kept.pop_back();
      }
      if (kept.size() < 2) continue;
      fontcore::Points points(static_cast<Eigen::Index>(kept.size()), 2);
      std::vector<PointKind> kinds;
      for (const int i : kept) {
        points.row(static_cast<Eigen::Index>(kinds.size())) = contour.point(i).transpose();
        kinds.push_back(contour.kind(i));
      }
      result.emplace_back(std::move(points), std::move(kinds));
    }
    return result;
  }

  const Font& font_;
  const EditedGlyphs& edited_;
  const WriteOptions& options_;
  std::vector<int> changed_;
  std::vector<int> renumbered_;  // of those, the ones with another structure
  std::map<int, int> advances_;  // other ones than the font's
  std::vector<int> moved_;       // composites whose components are to stand elsewhere
  sfnt::Directory directory_;
  sfnt::Basics basics_;
  sfnt::Metrics layout_;  // how hmtx is laid out now
  std::vector<View> old_glyphs_;
  std::vector<bool> is_lost_;  // loca gives it no bytes; it comes out empty
  std::vector<std::optional<Bytes>> new_glyphs_;
  bool has_names_ = true;  // of a font converted: it says the names of its glyphs
  EditedGlyphs snapped_;   // of CFF, and of a font converted: as they are written
  std::map<Tag, Bytes> rebuilt_;
  WrittenFont result_;
};

}  // namespace

WrittenFont write_sfnt(const Font& font, const EditedGlyphs& edited, const WriteOptions& options) {
  try {
    return Writer(font, edited, options).write();
  } catch (const Malformed& error) {
    throw FontWriteError(text(font.path, ": ", error.what()));
  } catch (const FontReadError& error) {
    throw FontWriteError(error.what());
  }
}

void refuse_at_fault(const Font& font) {
  if (font.format == OutlineFormat::Ufo) return;
  const EditedGlyphs edited;
  const WriteOptions options;
  try {
    Writer(font, edited, options).refuse_at_fault();
  } catch (const Malformed& error) {
    throw FontWriteError(text(font.path, ": ", error.what()));
  }
}

namespace {

WrittenFont write_as(OutlineFormat to, const Font& font, const GlyphOutlines& outlines) {
  try {
    return Writer(font, {}, {}).write_as(to, outlines);
  } catch (const Malformed& error) {
    throw FontWriteError(text(font.path, ": ", error.what()));
  } catch (const FontReadError& error) {
    throw FontWriteError(error.what());
  }
}

Eigen::Index count_points(const std::vector<BezierContour>& outline) {
  Eigen::Index points = 0;
  for (const BezierContour& contour : outline) points += contour.point_count();
  return points;
}

}  // namespace

WrittenFont write_as_cff(const Font& font, const GlyphOutlines& outlines) {
  return write_as(OutlineFormat::Cff, font, outlines);
}

WrittenFont write_as_truetype(const Font& font, const GlyphOutlines& outlines) {
  return write_as(OutlineFormat::TrueType, font, outlines);
}

std::string why_no_charstring(const std::vector<BezierContour>& outline) {
  const Eigen::Index points = count_points(outline);
  if (points > most_drawn) return text("its ", points, " points are more than ", most_drawn);
  constexpr std::size_t most_bytes = 65535;  // of sanitizers
  constexpr Eigen::Index bytes_per_point = 11;
  if (points < static_cast<Eigen::Index>(most_bytes) / bytes_per_point) return "";
  const std::size_t bytes = sfnt::encode_charstring(outline, {}, 0.0).size();
  return bytes <= most_bytes ? "" : text("its charstring has ", bytes, " bytes, more than ", most_bytes);
}

std::string why_no_truetype(const std::vector<BezierContour>& outline) {
  const Eigen::Index points = count_points(outline);
  return points <= most_drawn ? "" : text("its ", points, " points are more than ", most_drawn);
}

}  // namespace glyphs
