#include "glyphs/variation.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/freetype_loader.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/sfnt_tables.h"
#include "glyphs/variation_tables.h"

namespace glyphs {

using namespace variation;

namespace {

using fontcore::text;
using sfnt::Box;
using sfnt::i16;
using sfnt::Malformed;
using sfnt::put_u16;
using sfnt::put_u32;
using sfnt::SimpleGlyph;
using sfnt::slice;
using sfnt::Tag;
using sfnt::tag;
using sfnt::u16;
using sfnt::u32;
using sfnt::u8;
using sfnt::View;

class Instancer {
 public:
  Instancer(const std::string& path, const Bytes& data, int face_index, const Location& location)
      : path_(path), location_(location), directory_(sfnt::read_directory(data, face_index)) {}

  Instance run() {
    const sfnt::TableRecord* fvar = directory_.find(tag("fvar"));
    if (!fvar) throw Malformed("is not variable; it has no other place to be read at");
    axes_ = read_axes(fvar->bytes);
    place_ = normalize(axes_, location_, directory_);
    basics_ = sfnt::read_basics(directory_);
    const bool is_truetype = !basics_.outlines.loca.empty();
    if (!is_truetype && (directory_.has(tag("CFF ")) || !directory_.has(tag("CFF2")))) {
      throw Malformed(
          "is variable, but neither TrueType nor CFF2; only those are read at a place of their design space");
    }
    for (const sfnt::TableRecord& table : directory_.tables) {
      tables_[table.tag] = Bytes(table.bytes.begin(), table.bytes.end());
    }
    open_vertical();
    if (is_truetype) {
      vary_glyphs();
    } else {
      vary_charstrings();
    }
    vary_control_values();
    vary_layout();
    vary_metrics();
    put_style();
    for (const Tag gone : {tag("fvar"), tag("gvar"), tag("avar"), tag("cvar"), tag("HVAR"), tag("VVAR"), tag("MVAR"),
                           tag("CFF2"), tag("DSIG"), tag("hdmx"), tag("LTSH"), tag("VDMX")}) {
      tables_.erase(gone);
    }
    if (is_truetype) {
      put_glyphs();
      box_composites();
      put_glyphs();
      put_advances();
    } else {
      put_bearings();
      put_advances();
      put_charstrings();
    }
    return {built(), std::move(warnings_)};
  }

 private:
  struct GlyphMetrics {
    double advance = 0.0;
    double left = 0.0;  // x of its origin
    double top = 0.0;   // y of its vertical origin
    double height = 0.0;
  };

  bool has(Tag name) const { return tables_.contains(name); }

  void open_vertical() {
    const auto count = static_cast<std::size_t>(basics_.glyph_count);
    if (const sfnt::TableRecord* vhea = directory_.find(tag("vhea")); vhea && has(tag("vmtx"))) {
      const std::uint64_t longs = u16(vhea->bytes, 34);
      if (longs == 0 || longs > count) throw Malformed(text("table vhea: ", longs, " metrics for ", count, " glyphs"));
      vertical_ =
          sfnt::Metrics{directory_.require(tag("vmtx"), 4 * longs + 2 * (count - longs)), static_cast<int>(longs)};
    }
    metrics_.resize(count);
    boxes_.resize(count);
    is_drawn_.resize(count);
  }

  // ---- TrueType

  void vary_glyphs() {
    const auto count = static_cast<std::size_t>(basics_.glyph_count);
    if (const sfnt::TableRecord* table = directory_.find(tag("gvar"))) {
      gvar_ = table->bytes;
      if (u16(gvar_, 0) != 1) throw Malformed(text("table gvar: version ", u16(gvar_, 0)));
      if (u16(gvar_, 4) != place_.size()) {
        throw Malformed(text("table gvar: ", u16(gvar_, 4), " axes, in fvar ", place_.size()));
      }
      if (u16(gvar_, 12) != count) {
        throw Malformed(text("table gvar: ", u16(gvar_, 12), " glyphs, the font has ", count));
      }
      shared_.count = u16(gvar_, 6);
      shared_.bytes = slice(gvar_, u32(gvar_, 8), 2 * place_.size() * shared_.count);
    }
    glyphs_.resize(count);
    std::vector<int> unvaried;
    std::string why;
    for (int id = 0; id < basics_.glyph_count; ++id) {
      try {
        vary(id);
      } catch (const Malformed& error) {
        if (unvaried.empty()) why = error.what();
        unvaried.push_back(id);
      }
    }
    if (!unvaried.empty()) {
      warnings_.push_back(text("gvar: ", unvaried.size(),
                               " glyphs stay as they are at the default; the first is gid:", unvaried[0], ": ", why));
    }
  }

  View variations_of(int id) const {
    if (gvar_.empty()) return {};
    const auto i = static_cast<std::uint64_t>(id);
    const bool is_long = (u16(gvar_, 14) & 1) != 0;
    const auto offset = [&](std::uint64_t k) {
      return is_long ? std::uint64_t{u32(gvar_, 20 + 4 * k)} : 2 * std::uint64_t{u16(gvar_, 20 + 2 * k)};
    };
    const std::uint64_t from = offset(i);
    const std::uint64_t to = offset(i + 1);
    if (from > to) throw Malformed(text("its variations lie from ", from, " to ", to));
    return slice(gvar_, u32(gvar_, 16) + from, to - from);
  }

  void vary(int id) {
    const auto k = static_cast<std::size_t>(id);
    GlyphMetrics& metrics = metrics_[k];
    metrics.advance = basics_.metrics.advance(id);
    const View old = basics_.outlines.bytes(id);  // throws: then it has none
    glyphs_[k] = Bytes(old.begin(), old.end());
    const Box box = old.size() >= 10 ? sfnt::read_box(old) : Box{};
    metrics.left = box.x_min - basics_.metrics.bearing(id);
    if (vertical_) {
      metrics.top = box.y_max + vertical_->bearing(id);
      metrics.height = vertical_->advance(id);
    }
    const bool is_composite = !old.empty() && i16(old, 0) < 0;
    SimpleGlyph simple;
    std::vector<std::uint64_t> parts;
    std::vector<Vector> points;
    if (is_composite) {
      parts = component_offsets(old);
      for (const std::uint64_t part : parts) points.push_back(argument(old, part));
    } else if (!old.empty()) {
      simple = sfnt::read_simple_glyph(old);
      for (const SimpleGlyph::Point& p : simple.points) {
        points.push_back({static_cast<double>(p.x), static_cast<double>(p.y)});
      }
    }
    const std::size_t own = points.size();
    points.push_back({metrics.left, 0.0});
    points.push_back({metrics.left + metrics.advance, 0.0});
    points.push_back({0.0, metrics.top});
    points.push_back({0.0, metrics.top - metrics.height});
    const std::vector<Vector> moves =
        moves_of(variations_of(id), points, is_composite ? std::vector<int>() : simple.ends);
    if (is_composite) {
      for (std::size_t i = 0; i < own; ++i) points[i] = {points[i].x + moves[i].x, points[i].y + moves[i].y};
      glyphs_[k] = with_arguments(old, parts, points);
    } else if (own > 0) {
      Box new_box{32767, 32767, -32768, -32768};
      SimpleGlyph::Point last;
      for (std::size_t i = 0; i < own; ++i) {
        SimpleGlyph::Point& p = simple.points[i];
        p.x = to_int16(points[i].x + moves[i].x, "coordinate");
        p.y = to_int16(points[i].y + moves[i].y, "coordinate");
        to_int16(p.x - last.x, "the step to a coordinate");
        to_int16(p.y - last.y, "the step to a coordinate");
        last = p;
        new_box = {std::min(new_box.x_min, p.x), std::min(new_box.y_min, p.y), std::max(new_box.x_max, p.x),
                   std::max(new_box.y_max, p.y)};
      }
      const std::uint64_t lengths = 10 + 2 * simple.ends.size();
      glyphs_[k] = sfnt::encode(simple, new_box, slice(old, lengths + 2, u16(old, lengths)));
    }
    metrics.left += moves[own].x;
    metrics.advance = std::max(0.0, round_half_up(metrics.advance + moves[own + 1].x - moves[own].x));
    if (metrics.advance > 65535.0) throw Malformed(text("advance ", metrics.advance, " does not fit in 16 bits"));
    metrics.top += moves[own + 2].y;
    metrics.height = std::clamp(round_half_up(metrics.height + moves[own + 2].y - moves[own + 3].y), 0.0, 65535.0);
  }

  /// The sum of all tuples; of a simple glyph, whose contours end at `ends`, untouched points follow the touched ones.
  std::vector<Vector> moves_of(View variations, const std::vector<Vector>& points, const std::vector<int>& ends) {
    std::vector<Vector> sum(points.size());
    if (variations.empty()) return sum;
    for_each_tuple(
        variations, 0, shared_, place_, points.size(), 2, budget_,
        [&](double scalar, const PointNumbers& numbers, const std::vector<int>& x, const std::vector<int>& y) {
          budget_.spend(points.size());
          std::vector<Vector> moves(points.size());
          std::vector<bool> is_touched(points.size(), numbers.is_all);
          for (std::size_t i = 0; i < x.size(); ++i) {
            const std::size_t point = numbers.is_all ? i : static_cast<std::size_t>(numbers.list[i]);
            if (point >= points.size()) continue;
            moves[point] = {static_cast<double>(x[i]), static_cast<double>(y[i])};
            is_touched[point] = true;
          }
          std::size_t first = 0;
          for (const int end : ends) {
            if (!numbers.is_all) infer(points, first, static_cast<std::size_t>(end), is_touched, moves);
            first = static_cast<std::size_t>(end) + 1;
          }
          for (std::size_t i = 0; i < points.size(); ++i) {
            sum[i] = {sum[i].x + scalar * moves[i].x, sum[i].y + scalar * moves[i].y};
          }
        });
    return sum;
  }

  enum : unsigned { words = 1, is_shift = 2, more = 0x20 };

  static std::vector<std::uint64_t> component_offsets(View glyph) {
    std::vector<std::uint64_t> parts;
    std::uint64_t at = 10;
    for (unsigned flags = more; flags & more;) {
      flags = u16(glyph, at);
      parts.push_back(at);
      at += sfnt::component_length(flags);
    }
    slice(glyph, at, 0);
    return parts;
  }

  static Vector argument(View glyph, std::uint64_t part) {
    const unsigned flags = u16(glyph, part);
    if (!(flags & is_shift)) return {};
    if (flags & words) return {static_cast<double>(i16(glyph, part + 4)), static_cast<double>(i16(glyph, part + 6))};
    return {static_cast<double>(static_cast<std::int8_t>(u8(glyph, part + 4))),
            static_cast<double>(static_cast<std::int8_t>(u8(glyph, part + 5)))};
  }

  /// The composite with other offsets, as words where bytes do not hold them.
  static Bytes with_arguments(View glyph, const std::vector<std::uint64_t>& parts, const std::vector<Vector>& offsets) {
    Bytes result(glyph.begin(), glyph.begin() + 10);
    std::uint64_t end = 10;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const unsigned flags = u16(glyph, parts[i]);
      const View record = slice(glyph, parts[i], sfnt::component_length(flags));
      end = parts[i] + record.size();
      if (!(flags & is_shift)) {
        result.insert(result.end(), record.begin(), record.end());
        continue;
      }
      const int x = to_int16(offsets[i].x, "the offset of a component,");
      const int y = to_int16(offsets[i].y, "the offset of a component,");
      const bool needs_words = (flags & words) || std::min(x, y) < -128 || std::max(x, y) > 127;
      sfnt::append_u16(result, static_cast<int>(needs_words ? flags | words : flags));
      sfnt::append_u16(result, u16(record, 2));
      if (needs_words) {
        sfnt::append_u16(result, x);
        sfnt::append_u16(result, y);
      } else {
        result.push_back(static_cast<unsigned char>(x & 0xFF));
        result.push_back(static_cast<unsigned char>(y & 0xFF));
      }
      const View matrix = record.subspan(flags & words ? 8 : 6);
      result.insert(result.end(), matrix.begin(), matrix.end());
    }
    const View rest = glyph.subspan(end);
    result.insert(result.end(), rest.begin(), rest.end());
    return result;
  }

  // ---- CFF2

  /// Outlines by the loader, in whole numbers; advances by HVAR, vertical metrics by VVAR.
  void vary_charstrings() {
    outlines_ = load_cff2_at(path_, outline_tables(), place_);
    std::vector<int> emptied;
    std::string why;
    for (Glyph& glyph : outlines_.glyphs) {
      const auto k = static_cast<std::size_t>(glyph.id);
      try {
        if (!glyph.trouble.empty()) throw Malformed(glyph.trouble);
        for (fontcore::BezierContour& contour : glyph.contours) contour = rounded(contour);
        sfnt::encode_charstring(glyph.contours, {}, std::nullopt);
        const std::optional<Box> box = sfnt::drawn_box(glyph.contours);
        is_drawn_[k] = box.has_value();
        boxes_[k] = box.value_or(Box{});
      } catch (const Malformed& error) {
        if (emptied.empty()) why = error.what();
        emptied.push_back(glyph.id);
        glyph.contours.clear();
      }
    }
    warnings_.push_back("CFF2: its hints and subroutines are gone; the outlines are CFF now");
    if (!emptied.empty()) {
      warnings_.push_back(
          text("CFF2: ", emptied.size(), " glyphs are empty now; the first is gid:", emptied[0], ": ", why));
    }
    vary_advances();
    if (vertical_) vary_heights();
  }

  /// The font with what outlines and names are read from, and nothing that a library would only spend time on.
  Bytes outline_tables() const {
    std::vector<sfnt::TableRecord> needed;
    for (const sfnt::TableRecord& table : sfnt::in_file_order(directory_)) {
      for (const Tag name : {tag("CFF2"), tag("OS/2"), tag("cmap"), tag("fvar"), tag("head"), tag("hhea"), tag("hmtx"),
                             tag("maxp"), tag("name"), tag("post")}) {
        if (table.tag == name) needed.push_back(table);
      }
    }
    return sfnt::build(directory_.version, needed);
  }

  static fontcore::BezierContour rounded(const fontcore::BezierContour& contour) {
    fontcore::Points points = contour.points();
    for (double& value : points.reshaped()) value = to_int16(value, "coordinate");
    return {std::move(points), contour.kinds()};
  }

  std::optional<MetricVariations> metric_variations(Tag name) {
    const sfnt::TableRecord* table = directory_.find(name);
    return table ? std::optional<MetricVariations>(std::in_place, table->bytes, place_, budget_) : std::nullopt;
  }

  static double varied_advance(double old, const std::optional<MetricVariations>& variations, int glyph) {
    const double delta = variations ? variations->delta(MetricVariations::advances, glyph) : 0.0;
    return std::clamp(old + round_half_up(delta), 0.0, 65535.0);
  }

  void vary_advances() {
    const auto variations = metric_variations(tag("HVAR"));
    for (int id = 0; id < basics_.glyph_count; ++id) {
      metrics_[static_cast<std::size_t>(id)].advance = varied_advance(basics_.metrics.advance(id), variations, id);
    }
  }

  /// Vertical origins come from VORG; where there is none, from the top side bearings, which may vary too.
  void vary_heights() {
    const auto variations = metric_variations(tag("VVAR"));
    const bool has_origins = directory_.has(tag("VORG"));
    const bool has_bearings = variations && variations->has(MetricVariations::top_bearings);
    std::vector<int> origins = has_origins ? read_vertical_origins() : std::vector<int>();
    std::optional<Font> initial;
    if (!has_origins && !has_bearings) {
      initial = load_cff2_at(path_, outline_tables(), std::vector<double>(place_.size()));
    }
    for (int id = 0; id < basics_.glyph_count; ++id) {
      const auto k = static_cast<std::size_t>(id);
      GlyphMetrics& metrics = metrics_[k];
      metrics.height = varied_advance(vertical_->advance(id), variations, id);
      metrics.top = vertical_->bearing(id);
      if (has_origins) {
        const double delta = variations ? variations->delta(MetricVariations::vertical_origins, id) : 0.0;
        origins[k] = to_int16(origins[k] + round_half_up(delta), "vertical origin");
        if (is_drawn_[k]) metrics.top = origins[k];
      } else if (has_bearings) {
        metrics.top += boxes_[k].y_max + round_half_up(variations->delta(MetricVariations::top_bearings, id));
      } else if (is_drawn_[k]) {
        metrics.top += sfnt::drawn_box(initial->glyphs[k].contours).value_or(Box{}).y_max;
      }
    }
    if (has_origins && variations && variations->has(MetricVariations::vertical_origins)) {
      put_vertical_origins(origins);
    }
  }

  std::vector<int> read_vertical_origins() const {
    const View vorg = directory_.require(tag("VORG"), 8);
    std::vector<int> origins(static_cast<std::size_t>(basics_.glyph_count), i16(vorg, 4));
    for (std::uint64_t i = 0; i < u16(vorg, 6); ++i) {
      const std::size_t glyph = u16(vorg, 8 + 4 * i);
      if (glyph < origins.size()) origins[glyph] = i16(vorg, 10 + 4 * i);
    }
    return origins;
  }

  /// The origin that most glyphs have, and those of the others.
  void put_vertical_origins(const std::vector<int>& origins) {
    std::map<int, int> uses;
    for (const int origin : origins) ++uses[origin];
    const int usual = std::ranges::max_element(uses, {}, [](const auto& use) { return use.second; })->first;
    Bytes& vorg = tables_[tag("VORG")];
    vorg.resize(8);
    put_u16(vorg, 4, usual);
    put_u16(vorg, 6, static_cast<int>(origins.size()) - uses[usual]);
    for (std::size_t i = 0; i < origins.size(); ++i) {
      if (origins[i] == usual) continue;
      sfnt::append_u16(vorg, static_cast<int>(i));
      sfnt::append_u16(vorg, origins[i]);
    }
  }

  /// `CFF ` and what goes with it.
  void put_charstrings() {
    Bytes& head = tables_[tag("head")];
    constexpr int bearings_are_x_min = 2;
    put_u16(head, 16, u16(head, 16) | bearings_are_x_min);
    put_u16(head, 50, 0);
    sfnt::NewCff made{.name = sfnt::postscript_name(directory_, outlines_.family + "-" + outlines_.style),
                      .units_per_em = basics_.units_per_em,
                      .box = {i16(head, 36), i16(head, 38), i16(head, 40), i16(head, 42)}};
    for (Glyph& glyph : outlines_.glyphs) {
      made.names.push_back(glyph.name);
      made.advances.push_back(static_cast<int>(metrics_[static_cast<std::size_t>(glyph.id)].advance));
      made.outlines.push_back(std::move(glyph.contours));
    }
    tables_[tag("CFF ")] = sfnt::build_cff(made);
    Bytes& maxp = tables_[tag("maxp")];
    maxp.resize(6);
    put_u32(maxp, 0, 0x00005000);
    if (has(tag("post")) && tables_[tag("post")].size() >= 32) {
      Bytes& post = tables_[tag("post")];
      post.resize(32);
      put_u32(post, 0, 0x00030000);  // without names, which are in `CFF ` now
    }
  }

  // ---- what both have

  void vary_control_values() {
    const sfnt::TableRecord* cvar = directory_.find(tag("cvar"));
    if (!cvar || !has(tag("cvt "))) return;
    Bytes& values = tables_[tag("cvt ")];
    std::vector<double> sum(values.size() / 2);
    const auto add = [&](double scalar, const PointNumbers& numbers, const std::vector<int>& deltas,
                         const std::vector<int>&) {
      for (std::size_t i = 0; i < deltas.size(); ++i) {
        const std::size_t value = numbers.is_all ? i : static_cast<std::size_t>(numbers.list[i]);
        if (value < sum.size()) sum[value] += scalar * deltas[i];
      }
    };
    for_each_tuple(cvar->bytes, 4, {}, place_, sum.size(), 1, budget_, add);
    for (std::size_t i = 0; i < sum.size(); ++i) {
      put_u16(values, 2 * i, to_int16(i16(values, 2 * i) + round_half_up(sum[i]), "table cvt: value"));
    }
  }

  void vary_layout() {
    for (const Tag name : {tag("GSUB"), tag("GPOS")}) {
      if (!has(name)) continue;
      Bytes& table = tables_[name];
      if (!settle_features(table, place_)) {
        put_u32(table, 10, 0);
        warnings_.push_back(text(sfnt::tag_name(name), ": has no room for the features that stand for others at this ",
                                 "place; they are as at the default"));
      }
    }
    for (const auto& [name, store_at] : {std::pair{tag("COLR"), 30}, std::pair{tag("BASE"), 8}}) {
      const auto table = tables_.find(name);
      const auto at = static_cast<std::uint64_t>(store_at);
      if (table == tables_.end() || table->second.size() < at + 4) continue;
      const bool has_store = name == tag("COLR") ? u16(table->second, 0) >= 1 : u16(table->second, 2) >= 1;
      if (!has_store || u32(table->second, at) == 0) continue;
      warnings_.push_back(text(sfnt::tag_name(name), ": its variations are kept, but count for nothing; at this place ",
                               "it is as at the default"));
    }
    if (!has(tag("GDEF"))) return;
    Bytes& gdef = tables_[tag("GDEF")];
    if (u16(gdef, 2) < 3 || gdef.size() < 18 || u32(gdef, 14) == 0) return;
    const Bytes old = gdef;
    const VariationStore store(old, u32(old, 14), place_, budget_);
    int lost = 0;
    if (has(tag("GPOS"))) lost = patch_gpos(tables_[tag("GPOS")], store, budget_);
    patch_gdef(gdef, store, budget_);
    put_u32(gdef, 14, 0);
    if (lost > 0) {
      warnings_.push_back(text("GPOS: ", lost,
                               " groups of positions have no room for what they come to at this place, ",
                               "and are as at the default"));
    }
  }

  void vary_metrics() {
    const sfnt::TableRecord* mvar = directory_.find(tag("MVAR"));
    if (!mvar) return;
    const View bytes = mvar->bytes;
    const std::uint64_t size = u16(bytes, 6);
    const std::uint64_t count = u16(bytes, 8);
    const std::uint64_t store_at = u16(bytes, 10);
    if (count == 0 || store_at == 0) return;
    if (size < 8) throw Malformed(text("table MVAR: records of ", size, " bytes"));
    const VariationStore store(bytes, store_at, place_, budget_);
    for (std::uint64_t i = 0; i < count; ++i) {
      const View record = slice(bytes, 12 + i * size, 8);
      vary_metric(u32(record, 0), round_half_up(store.delta(u16(record, 4), u16(record, 6))));
    }
  }

  void vary_metric(Tag metric, double delta) {
    struct Place {
      Tag metric;
      Tag table;
      std::uint64_t at;
    };
    static constexpr Tag os2 = tag("OS/2");
    static constexpr std::array<Place, 31> places{{
        {tag("hasc"), os2, 68},         {tag("hdsc"), os2, 70},         {tag("hlgp"), os2, 72},
        {tag("hcla"), os2, 74},         {tag("hcld"), os2, 76},         {tag("xhgt"), os2, 86},
        {tag("cpht"), os2, 88},         {tag("sbxs"), os2, 10},         {tag("sbys"), os2, 12},
        {tag("sbxo"), os2, 14},         {tag("sbyo"), os2, 16},         {tag("spxs"), os2, 18},
        {tag("spys"), os2, 20},         {tag("spxo"), os2, 22},         {tag("spyo"), os2, 24},
        {tag("strs"), os2, 26},         {tag("stro"), os2, 28},         {tag("undo"), tag("post"), 8},
        {tag("unds"), tag("post"), 10}, {tag("hcrs"), tag("hhea"), 18}, {tag("hcrn"), tag("hhea"), 20},
        {tag("hcof"), tag("hhea"), 22}, {tag("vasc"), tag("vhea"), 4},  {tag("vdsc"), tag("vhea"), 6},
        {tag("vlgp"), tag("vhea"), 8},  {tag("vcrs"), tag("vhea"), 18}, {tag("vcrn"), tag("vhea"), 20},
        {tag("vcof"), tag("vhea"), 22},
    }};
    const auto found = std::ranges::find(places, metric, &Place::metric);
    if (found == places.end() || metric == 0) {
      if (delta != 0.0) warnings_.push_back(text("MVAR: ", sfnt::tag_name(metric), " moves by ", delta, ", nowhere"));
      return;
    }
    const auto table = tables_.find(found->table);
    if (table == tables_.end() || table->second.size() < found->at + 2) return;
    const bool has_no_sign = metric == tag("hcla") || metric == tag("hcld");
    const double old = has_no_sign ? double(u16(table->second, found->at)) : double(i16(table->second, found->at));
    const double value = std::clamp(old + delta, has_no_sign ? 0.0 : -32768.0, has_no_sign ? 65535.0 : 32767.0);
    put_u16(table->second, found->at, static_cast<int>(value));
  }

  /// What OS/2 and post say of the axes that were set.
  void put_style() {
    const auto wanted = [&](const char* axis) -> std::optional<double> {
      const auto found = location_.find(axis);
      return found == location_.end() ? std::nullopt : std::optional(found->second);
    };
    if (has(tag("OS/2")) && tables_[tag("OS/2")].size() >= 8) {
      Bytes& os2 = tables_[tag("OS/2")];
      if (const auto weight = wanted("wght")) {
        put_u16(os2, 4, static_cast<int>(std::clamp(round_half_up(*weight), 1.0, 1000.0)));
      }
      if (const auto width = wanted("wdth")) {
        constexpr std::array<double, 9> percents{50, 62.5, 75, 87.5, 100, 112.5, 125, 150, 200};
        const auto nearest = std::ranges::min_element(percents, {}, [&](double p) { return std::abs(p - *width); });
        put_u16(os2, 6, static_cast<int>(nearest - percents.begin()) + 1);
      }
    }
    if (const auto slant = wanted("slnt"); slant && has(tag("post")) && tables_[tag("post")].size() >= 8) {
      put_u32(tables_[tag("post")], 4,
              static_cast<std::uint32_t>(
                  static_cast<std::int32_t>(round_half_up(std::clamp(*slant, -90.0, 90.0) * 65536.0))));
    }
  }

  /// glyf, loca, boxes, hmtx and vmtx of the glyphs as they are now.
  void put_glyphs() {
    Bytes& glyf = tables_[tag("glyf")];
    glyf.clear();
    std::vector<std::uint64_t> offsets{0};
    for (const Bytes& glyph : glyphs_) {
      glyf.insert(glyf.end(), glyph.begin(), glyph.end());
      glyf.resize((glyf.size() + 3) / 4 * 4);
      offsets.push_back(glyf.size());
    }
    const bool is_long = basics_.outlines.has_long_offsets || glyf.size() > sfnt::short_offsets_reach;
    tables_[tag("loca")] = sfnt::build_loca(offsets, is_long);
    put_u16(tables_[tag("head")], 50, is_long ? 1 : 0);
    for (std::size_t i = 0; i < glyphs_.size(); ++i) {
      boxes_[i] = glyphs_[i].size() >= 10 ? sfnt::read_box(glyphs_[i]) : Box{};
    }
    put_bearings();
  }

  /// hmtx and vmtx of the glyphs in their boxes.
  void put_bearings() {
    put_metrics(tag("hmtx"), tag("hhea"), basics_.metrics.long_count, [](const GlyphMetrics& metrics, const Box& box) {
      return std::pair{metrics.advance, box.x_min - metrics.left};
    });
    if (!vertical_) return;
    put_metrics(tag("vmtx"), tag("vhea"), vertical_->long_count, [](const GlyphMetrics& metrics, const Box& box) {
      return std::pair{metrics.height, metrics.top - box.y_max};
    });
  }

  template <typename Measure>
  void put_metrics(Tag table, Tag header, int old_long_count, const Measure& measure) {
    std::vector<std::pair<int, int>> all;
    for (std::size_t i = 0; i < metrics_.size(); ++i) {
      const auto [advance, bearing] = measure(metrics_[i], boxes_[i]);
      all.emplace_back(static_cast<int>(advance), to_int16(bearing, "bearing"));
    }
    std::size_t needed = all.size();
    while (needed > 1 && all[needed - 2].first == all.back().first) --needed;
    const std::size_t long_count = std::max(needed, static_cast<std::size_t>(old_long_count));
    Bytes& bytes = tables_[table];
    bytes.clear();
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (i < long_count) sfnt::append_u16(bytes, all[i].first);
      sfnt::append_u16(bytes, all[i].second);
    }
    put_u16(tables_[header], 34, static_cast<int>(long_count));
  }

  /// Composites get the boxes of what they draw: the font as it is so far is read for them.
  void box_composites() {
    const Font draft = load_sfnt(path_, built());
    for (const Glyph& glyph : draft.glyphs) {
      if (!glyph.is_composite()) continue;
      const auto& [low, high] = control_box(compose(draft, glyph.id));
      if (low.x() > high.x()) continue;
      sfnt::put_box(glyphs_[static_cast<std::size_t>(glyph.id)], 2,
                    {to_int16(low.x() + glyph.origin, "box coordinate"), to_int16(low.y(), "box coordinate"),
                     to_int16(high.x() + glyph.origin, "box coordinate"), to_int16(high.y(), "box coordinate")});
    }
    for (const Glyph& glyph : draft.glyphs) {
      is_drawn_[static_cast<std::size_t>(glyph.id)] = draft.has_outline(glyph.id);
    }
  }

  /// What head, hhea, vhea and OS/2 say of all glyphs together.
  void put_advances() {
    const auto limit = [](double value) { return static_cast<int>(std::clamp(value, -32768.0, 32767.0)); };
    std::optional<Box> all;
    double widest = 0.0;
    double tallest = 0.0;
    double old_sum = 0.0;
    double sum = 0.0;
    int old_wide = 0;
    int wide = 0;
    std::array<double, 6> ends{32767, 32767, -32768, 32767, 32767, -32768};  // least bearings, greatest extent
    for (std::size_t i = 0; i < metrics_.size(); ++i) {
      const GlyphMetrics& metrics = metrics_[i];
      widest = std::max(widest, metrics.advance);
      tallest = std::max(tallest, metrics.height);
      const int old_advance = basics_.metrics.advance(static_cast<int>(i));
      old_sum += old_advance;
      sum += metrics.advance;
      if (old_advance > 0) ++old_wide;
      if (metrics.advance > 0) ++wide;
      if (!is_drawn_[i]) continue;
      const Box box = boxes_[i];
      all = all ? Box{std::min(all->x_min, box.x_min), std::min(all->y_min, box.y_min), std::max(all->x_max, box.x_max),
                      std::max(all->y_max, box.y_max)}
                : box;
      const double left = round_half_up(box.x_min - metrics.left);
      const double right = left + box.x_max - box.x_min;
      const double top = round_half_up(metrics.top - box.y_max);
      const double bottom = top + box.y_max - box.y_min;
      ends = {std::min(ends[0], left), std::min(ends[1], metrics.advance - right), std::max(ends[2], right),
              std::min(ends[3], top),  std::min(ends[4], metrics.height - bottom), std::max(ends[5], bottom)};
    }
    if (all) sfnt::put_box(tables_[tag("head")], 36, *all);
    Bytes& hhea = tables_[tag("hhea")];
    put_u16(hhea, 10, static_cast<int>(widest));
    for (std::uint64_t i = 0; all && i < 3; ++i) put_u16(hhea, 12 + 2 * i, limit(ends[i]));
    if (vertical_) {
      Bytes& vhea = tables_[tag("vhea")];
      put_u16(vhea, 10, static_cast<int>(tallest));
      for (std::uint64_t i = 0; all && i < 3; ++i) put_u16(vhea, 12 + 2 * i, limit(ends[3 + i]));
    }
    // The average width, where it was that of all glyphs that have one.
    if (!has(tag("OS/2")) || old_wide == 0 || wide == 0) return;
    Bytes& os2 = tables_[tag("OS/2")];
    if (os2.size() >= 4 && std::abs(i16(os2, 2) - old_sum / old_wide) <= 1.0)
      put_u16(os2, 2, limit(round_half_up(sum / wide)));
  }

  Bytes built() const {
    std::vector<sfnt::TableRecord> tables;
    const bool is_cff = has(tag("CFF "));
    for (const sfnt::TableRecord& table : sfnt::in_file_order(directory_)) {
      const Tag name = is_cff && table.tag == tag("CFF2") ? tag("CFF ") : table.tag;
      if (const auto found = tables_.find(name); found != tables_.end()) tables.push_back({name, found->second});
    }
    return sfnt::build(is_cff ? tag("OTTO") : directory_.version, tables);
  }

  const std::string& path_;
  const Location& location_;
  sfnt::Directory directory_;
  sfnt::Basics basics_;
  std::vector<Axis> axes_;
  std::vector<double> place_;
  std::map<Tag, Bytes> tables_;
  std::optional<sfnt::Metrics> vertical_;
  View gvar_;
  SharedTuples shared_;
  std::vector<Bytes> glyphs_;  // of TrueType
  Font outlines_;              // of CFF2
  std::vector<GlyphMetrics> metrics_;
  std::vector<Box> boxes_;
  std::vector<bool> is_drawn_;
  std::vector<std::string> warnings_;
  Budget budget_;
};

}  // namespace

Location parse_location(const std::string& list) {
  const auto fail = [&](const std::string& why) { throw RequestError("--location " + list + ": " + why); };
  Location location;
  std::size_t from = 0;
  while (from <= list.size()) {
    const std::size_t comma = std::min(list.find(',', from), list.size());
    const std::string item = list.substr(from, comma - from);
    from = comma + 1;
    const std::size_t equals = item.find('=');
    if (equals == std::string::npos || equals == 0 || equals > 4) {
      fail("\"" + item + "\" is not of the form wght=650");
    }
    double value = 0.0;
    const char* end = item.data() + item.size();
    const auto [at, status] = std::from_chars(item.data() + equals + 1, end, value, std::chars_format::fixed);
    if (status != std::errc() || at != end || !std::isfinite(value)) {
      fail("\"" + item.substr(equals + 1) + "\" is no number");
    }
    if (!location.emplace(item.substr(0, equals), value).second) {
      fail("axis " + item.substr(0, equals) + " is given twice");
    }
  }
  return location;
}

Instance instantiate(const std::string& path, const Bytes& data, int face_index, const Location& location) {
  try {
    return Instancer(path, data, face_index, location).run();
  } catch (const Malformed& error) {
    throw FontReadError(text(path, ": ", error.what()));
  } catch (const Budget::Exhausted& error) {
    throw FontReadError(text(path, ": ", error.what()));
  }
}

}  // namespace glyphs
