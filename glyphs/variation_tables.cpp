#include "glyphs/variation_tables.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>

namespace glyphs::variation {

using fontcore::text;
using sfnt::i16;
using sfnt::Malformed;
using sfnt::put_u16;
using sfnt::put_u32;
using sfnt::slice;
using sfnt::Tag;
using sfnt::tag;
using sfnt::u16;
using sfnt::u32;
using sfnt::u8;
using sfnt::View;

namespace {

double fixed(View bytes, std::uint64_t at) { return static_cast<std::int32_t>(u32(bytes, at)) / 65536.0; }
double f2dot14(View bytes, std::uint64_t at) { return i16(bytes, at) / 16384.0; }

}  // namespace

int to_int16(double value, const char* what) {
  const double rounded = round_half_up(value);
  if (!(rounded >= std::numeric_limits<std::int16_t>::min() && rounded <= std::numeric_limits<std::int16_t>::max())) {
    throw Malformed(text(what, " ", rounded, " does not fit in 16 bits"));
  }
  return static_cast<int>(rounded);
}

// ---- the design space

std::vector<Axis> read_axes(View fvar) {
  const std::uint64_t first = u16(fvar, 4);
  const std::uint64_t count = u16(fvar, 8);
  const std::uint64_t size = u16(fvar, 10);
  if (count == 0 || size < 20) throw Malformed(text("table fvar: ", count, " axes of ", size, " bytes"));
  std::vector<Axis> axes;
  for (std::uint64_t i = 0; i < count; ++i) {
    const View record = slice(fvar, first + i * size, 20);
    const Axis axis{u32(record, 0), fixed(record, 4), fixed(record, 8), fixed(record, 12)};
    if (!(axis.minimum <= axis.initial && axis.initial <= axis.maximum)) {
      throw Malformed(text("table fvar: axis ", sfnt::tag_name(axis.name), " goes from ", axis.minimum, " over ",
                           axis.initial, " to ", axis.maximum));
    }
    axes.push_back(axis);
  }
  return axes;
}

namespace {

std::string list_axes(const std::vector<Axis>& axes) {
  std::string list;
  for (const Axis& axis : axes) {
    list += text(list.empty() ? "" : ", ", sfnt::tag_name(axis.name), " from ", axis.minimum, " to ", axis.maximum);
  }
  return list;
}

}  // namespace

std::vector<double> normalize(const std::vector<Axis>& axes, const Location& location, const sfnt::Directory& tables) {
  std::vector<double> place;
  std::set<std::string> known;
  for (const Axis& axis : axes) {
    const std::string name = sfnt::tag_name(axis.name);
    known.insert(name);
    const auto wanted = location.find(name);
    const double value = wanted == location.end() ? axis.initial : wanted->second;
    if (!(value >= axis.minimum && value <= axis.maximum)) {
      throw Malformed(text("axis ", name, " has no ", value, "; its axes are ", list_axes(axes)));
    }
    const double span = value < axis.initial ? axis.initial - axis.minimum : axis.maximum - axis.initial;
    place.push_back(value == axis.initial ? 0.0 : (value - axis.initial) / span);
  }
  for (const auto& [name, value] : location) {
    if (!known.contains(name)) throw Malformed(text("has no axis ", name, "; its axes are ", list_axes(axes)));
  }
  if (const sfnt::TableRecord* table = tables.find(tag("avar"))) {
    const View avar = table->bytes;
    if (u16(avar, 0) != 1) throw Malformed(text("table avar: version ", u16(avar, 0), " is not read by this version"));
    if (u16(avar, 6) != axes.size()) {
      throw Malformed(text("table avar: ", u16(avar, 6), " axes, in fvar ", axes.size()));
    }
    std::uint64_t at = 8;
    for (double& value : place) {
      const std::uint64_t count = u16(avar, at);
      const View pairs = slice(avar, at + 2, 4 * count);
      at += 2 + 4 * count;
      for (std::uint64_t i = 1; i < count; ++i) {
        const double from = f2dot14(pairs, 4 * i - 4);
        const double to = f2dot14(pairs, 4 * i);
        if (!(from < to && value >= from && value <= to)) continue;
        const double low = f2dot14(pairs, 4 * i - 2);
        value = low + (f2dot14(pairs, 4 * i + 2) - low) * (value - from) / (to - from);
        break;
      }
    }
  }
  for (double& value : place) value = round_half_up(value * 16384.0) / 16384.0;
  return place;
}

namespace {

/// How much a region that rises from `start` to `peak` and falls to `end` counts at a coordinate.
double tent(double value, double start, double peak, double end) {
  if (peak == 0.0 || start > peak || peak > end || (start < 0.0 && end > 0.0) || value == peak) return 1.0;
  if (value <= start || value >= end) return 0.0;
  return value < peak ? (value - start) / (peak - start) : (end - value) / (end - peak);
}

// ---- tuple variations: gvar and cvar

/// Reads on from a place.
struct Cursor {
  View bytes;
  std::uint64_t at = 0;

  unsigned byte() { return u8(bytes, at++); }
  int word() {
    at += 2;
    return i16(bytes, at - 2);
  }
};

PointNumbers read_point_numbers(Cursor& cursor, Budget& budget) {
  std::size_t count = cursor.byte();
  if (count & 0x80) count = (count & 0x7F) << 8 | cursor.byte();
  PointNumbers numbers{count == 0, {}};
  budget.spend(count);
  int number = 0;
  while (numbers.list.size() < count) {
    const unsigned control = cursor.byte();
    for (unsigned left = (control & 0x7F) + 1; left > 0 && numbers.list.size() < count; --left) {
      number += control & 0x80 ? cursor.word() & 0xFFFF : static_cast<int>(cursor.byte());
      numbers.list.push_back(number);
    }
  }
  return numbers;
}

std::vector<int> read_deltas(Cursor& cursor, std::size_t count, Budget& budget) {
  std::vector<int> deltas;
  budget.spend(count);
  while (deltas.size() < count) {
    const unsigned control = cursor.byte();
    for (unsigned left = (control & 0x3F) + 1; left > 0 && deltas.size() < count; --left) {
      deltas.push_back(control & 0x80 ? 0 : control & 0x40 ? cursor.word() : static_cast<std::int8_t>(cursor.byte()));
    }
  }
  return deltas;
}

}  // namespace

void for_each_tuple(View bytes, std::uint64_t header, const SharedTuples& shared, const std::vector<double>& place,
                    std::size_t point_count, int dimensions, Budget& budget, const UseTuple& use) {
  enum : unsigned {
    shares_points = 0x8000,
    own_peak = 0x8000,
    intermediate = 0x4000,
    own_points = 0x2000,
    low = 0xFFF
  };
  const unsigned flags = u16(bytes, header);
  Cursor data{bytes, u16(bytes, header + 2)};
  PointNumbers common;
  if (flags & shares_points) common = read_point_numbers(data, budget);
  const std::uint64_t tuple_size = 2 * place.size();
  std::uint64_t at = header + 4;
  for (unsigned i = 0; i < (flags & low); ++i) {
    const std::uint64_t size = u16(bytes, at);
    const unsigned index = u16(bytes, at + 2);
    at += 4;
    const auto take = [&] {
      at += tuple_size;
      return slice(bytes, at - tuple_size, tuple_size);
    };
    if (!(index & own_peak) && (index & low) >= shared.count) {
      throw Malformed(text("tuple ", index & low, " of ", shared.count, " shared ones"));
    }
    const View peak = index & own_peak ? take() : slice(shared.bytes, tuple_size * (index & low), tuple_size);
    const View start = index & intermediate ? take() : View();
    const View end = index & intermediate ? take() : View();
    double scalar = 1.0;
    for (std::size_t axis = 0; axis < place.size() && scalar != 0.0; ++axis) {
      const double top = f2dot14(peak, 2 * axis);
      scalar *= tent(place[axis], start.empty() ? std::min(top, 0.0) : f2dot14(start, 2 * axis), top,
                     end.empty() ? std::max(top, 0.0) : f2dot14(end, 2 * axis));
    }
    budget.spend(1 + place.size());
    Cursor own{slice(bytes, data.at, size)};
    data.at += size;
    if (scalar == 0.0) continue;
    const PointNumbers numbers = index & own_points ? read_point_numbers(own, budget) : common;
    const std::size_t count = numbers.is_all ? point_count : numbers.list.size();
    const std::vector<int> x = read_deltas(own, count, budget);
    const std::vector<int> y = dimensions == 2 ? read_deltas(own, count, budget) : std::vector<int>();
    use(scalar, numbers, x, y);
  }
}

namespace {

/// The move of an untouched point between two touched ones, along one axis.
double inferred(double at, double a, double b, double move_a, double move_b) {
  if (a == b) return move_a == move_b ? move_a : 0.0;
  if (a > b) {
    std::swap(a, b);
    std::swap(move_a, move_b);
  }
  if (at <= a) return move_a;
  if (at >= b) return move_b;
  return move_a + (move_b - move_a) * (at - a) / (b - a);
}

}  // namespace

void infer(const std::vector<Vector>& points, std::size_t first, std::size_t last, const std::vector<bool>& is_touched,
           std::vector<Vector>& moves) {
  std::vector<std::size_t> touched;
  for (std::size_t i = first; i <= last; ++i) {
    if (is_touched[i]) touched.push_back(i);
  }
  if (touched.empty()) return;
  for (std::size_t k = 0; k < touched.size(); ++k) {
    const std::size_t a = touched[k];
    const std::size_t b = touched[(k + 1) % touched.size()];
    for (std::size_t i = a == last ? first : a + 1; i != b; i = i == last ? first : i + 1) {
      if (is_touched[i]) break;
      moves[i] = {inferred(points[i].x, points[a].x, points[b].x, moves[a].x, moves[b].x),
                  inferred(points[i].y, points[a].y, points[b].y, moves[a].y, moves[b].y)};
    }
  }
}

// ---- item variations: HVAR, VVAR, MVAR, GDEF and what refers to it

VariationStore::VariationStore(View table, std::uint64_t offset, const std::vector<double>& place, Budget& budget)
    : bytes_(slice(table, offset, table.size() - std::min<std::uint64_t>(offset, table.size()))), budget_(budget) {
  const View bytes = bytes_;
  if (u16(bytes, 0) != 1) throw Malformed(text("variation store of format ", u16(bytes, 0)));
  const std::uint64_t regions = u32(bytes, 2);
  const std::uint64_t axes = u16(bytes, regions);
  const std::uint64_t count = u16(bytes, regions + 2);
  if (axes != place.size()) throw Malformed(text("variation store of ", axes, " axes, in fvar ", place.size()));
  const View list = slice(bytes, regions + 4, 6 * axes * count);
  budget_.spend(axes * count);
  for (std::uint64_t i = 0; i < count; ++i) {
    double scalar = 1.0;
    for (std::uint64_t axis = 0; axis < axes; ++axis) {
      const std::uint64_t at = 6 * (i * axes + axis);
      scalar *= tent(place[axis], f2dot14(list, at), f2dot14(list, at + 2), f2dot14(list, at + 4));
    }
    scalars_.push_back(scalar);
  }
}

double VariationStore::delta(unsigned outer, unsigned inner) const {
  if (outer >= u16(bytes_, 6)) return 0.0;
  const std::uint64_t data = u32(bytes_, 8 + 4 * std::uint64_t{outer});
  if (data == 0 || inner >= u16(bytes_, data)) return 0.0;
  const unsigned words = u16(bytes_, data + 2);
  const std::uint64_t regions = u16(bytes_, data + 4);
  const std::uint64_t wide = words & 0x7FFF;  // deltas of twice the size come first
  const std::uint64_t narrow_size = words & 0x8000 ? 2 : 1;
  if (wide > regions) throw Malformed("variation store: more wide deltas than regions");
  budget_.spend(1 + regions);
  const std::uint64_t row_size = narrow_size * (regions + wide);
  std::uint64_t at = data + 6 + 2 * regions + inner * row_size;
  double sum = 0.0;
  for (std::uint64_t i = 0; i < regions; ++i) {
    const std::uint64_t region = u16(bytes_, data + 6 + 2 * i);
    if (region >= scalars_.size()) throw Malformed(text("variation store: region ", region, " of ", scalars_.size()));
    const std::uint64_t size = narrow_size * (i < wide ? 2 : 1);
    const double value = size == 1   ? static_cast<std::int8_t>(u8(bytes_, at))
                         : size == 2 ? i16(bytes_, at)
                                     : static_cast<std::int32_t>(u32(bytes_, at));
    sum += scalars_[region] * value;
    at += size;
  }
  return sum;
}

MetricVariations::MetricVariations(View table, const std::vector<double>& place, Budget& budget)
    : table_(table), store_(table, u32(table, 4), place, budget) {
  if (u16(table, 0) != 1) throw Malformed(text("table of varied metrics of version ", u16(table, 0)));
}

double MetricVariations::delta(Map which, int glyph) const {
  const auto by_glyph = static_cast<unsigned>(glyph);
  const std::uint64_t map = u32(table_, which);
  if (map == 0) return which == advances ? store_.delta(0, by_glyph) : 0.0;
  const unsigned format = u8(table_, map);
  if (format > 1) throw Malformed(text("map of varied metrics of format ", format));
  const std::uint64_t count = format == 0 ? u16(table_, map + 2) : u32(table_, map + 2);
  if (count == 0) return store_.delta(0, by_glyph);
  const unsigned entry = u8(table_, map + 1);
  const std::uint64_t size = (entry >> 4 & 3) + 1;
  const unsigned inner_bits = (entry & 0xF) + 1;
  const std::uint64_t index = std::min<std::uint64_t>(by_glyph, count - 1);
  unsigned value = 0;
  for (const unsigned char byte : slice(table_, map + (format == 0 ? 4 : 6) + size * index, size)) {
    value = value << 8 | byte;
  }
  return store_.delta(value >> inner_bits, value & ((1u << inner_bits) - 1));
}

namespace {

/// Puts what a variation store says into the numbers of GPOS and GDEF, and takes the references to it away.
class LayoutPatcher {
 public:
  LayoutPatcher(Bytes& table, const VariationStore& store, Budget& budget)
      : table_(table), store_(store), budget_(budget) {}

  void patch_gpos() {
    const std::uint64_t lookups = u16(table_, 8);
    if (lookups == 0) return;
    for (const std::uint64_t lookup : offsets(lookups, lookups)) {
      for (std::uint64_t subtable : offsets(lookup, lookup + 4)) {
        unsigned type = u16(table_, lookup);
        if (type == extension) {
          type = u16(table_, subtable + 2);
          subtable += u32(table_, subtable + 4);
        }
        if (visited_.insert(subtable).second) patch_subtable(type, subtable);
      }
    }
  }

  void patch_gdef() {
    const std::uint64_t carets = u16(table_, 8);
    if (carets == 0) return;
    for (const std::uint64_t glyph : offsets(carets, carets + 2)) {
      for (const std::uint64_t caret : offsets(glyph, glyph)) {
        if (u16(table_, caret) == 3) add_delta(caret, caret + 2, caret + 4);
      }
    }
  }

  /// Numbers whose variation could not be put in.
  int lost() const { return lost_; }

 private:
  static constexpr unsigned extension = 9;

  /// Of a count at `at` and as many offsets from `base`; null ones left out.
  std::vector<std::uint64_t> offsets(std::uint64_t base, std::uint64_t at) { return grid(base, at, 1); }
  std::vector<std::uint64_t> grid(std::uint64_t base, std::uint64_t at, std::uint64_t columns) {
    const std::uint64_t count = columns * u16(table_, at);
    budget_.spend(count + 1);
    std::vector<std::uint64_t> list;
    for (std::uint64_t i = 0; i < count; ++i) {
      if (const std::uint64_t offset = u16(table_, at + 2 + 2 * i); offset != 0) list.push_back(base + offset);
    }
    return list;
  }

  /// The delta that the device table at `parent` + `offset` stands for; none if it is one for pixel sizes.
  std::optional<double> delta(std::uint64_t parent, std::uint64_t offset) const {
    constexpr unsigned variation_index = 0x8000;
    const std::uint64_t device = parent + offset;
    if (u16(table_, device + 4) != variation_index) return std::nullopt;
    return store_.delta(u16(table_, device), u16(table_, device + 2));
  }

  void add_delta(std::uint64_t parent, std::uint64_t value_at, std::uint64_t offset_at) {
    const std::uint64_t offset = u16(table_, offset_at);
    if (offset == 0) return;
    const std::optional<double> its = delta(parent, offset);
    if (!its) return;
    put_u16(table_, value_at, to_int16(i16(table_, value_at) + round_half_up(*its), "a position of"));
    put_u16(table_, offset_at, 0);
  }

  void patch_anchor(std::uint64_t anchor) {
    if (u16(table_, anchor) != 3) return;
    add_delta(anchor, anchor + 2, anchor + 6);
    add_delta(anchor, anchor + 4, anchor + 8);
  }

  void patch_anchors(std::uint64_t base, std::uint64_t at, std::uint64_t columns) {
    for (const std::uint64_t anchor : grid(base, at, columns)) patch_anchor(anchor);
  }

  struct Record {
    std::uint64_t at = 0;
    std::uint64_t parent = 0;  // what its offsets count from
  };
  static std::uint64_t size_of(unsigned format) { return 2 * static_cast<std::uint64_t>(std::popcount(format & 0xFF)); }

  /// All value records of one format. Where a format has variations of a number without the number itself, the number
  /// takes their place.
  void patch_values(std::uint64_t format_at, const std::vector<Record>& records) {
    const unsigned format = u16(table_, format_at);
    if (!(format & 0xF0)) return;
    budget_.spend(8 * records.size());
    unsigned taking_place = format >> 4 & ~format & 0xF;
    for (const Record& record : records) {
      if (!done_.contains(record.at) || taking_place == 0) continue;
      taking_place = 0;  // the record serves another subtable too
      ++lost_;
    }
    for (const Record& record : records) {
      std::uint64_t at = record.at + size_of(format & 0xF);
      for (unsigned i = 0; i < 4; ++i) {
        if (!(format & 0x10u << i)) continue;
        const std::uint64_t offset = u16(table_, at);
        at += 2;
        if (!(taking_place & 1u << i) || offset == 0 || delta(record.parent, offset)) continue;
        taking_place &= ~(1u << i);
        ++lost_;
      }
    }
    const unsigned new_format = (format & ~(taking_place << 4)) | taking_place;
    for (const Record& record : records) {
      if (!done_.insert(record.at).second) continue;
      std::array<int, 8> slots{};
      std::uint64_t at = record.at;
      for (unsigned i = 0; i < 8; ++i) {
        if (!(format & 1u << i)) continue;
        slots[i] = u16(table_, at);
        at += 2;
      }
      for (unsigned i = 0; i < 4; ++i) {
        const auto offset = static_cast<std::uint64_t>(slots[i + 4]);
        if (offset == 0 || !(new_format & 1u << i)) continue;
        const std::optional<double> its = delta(record.parent, offset);
        if (!its) continue;
        slots[i] = to_int16(static_cast<std::int16_t>(slots[i]) + round_half_up(*its), "a position of");
        slots[i + 4] = 0;
      }
      at = record.at;
      for (unsigned i = 0; i < 8; ++i) {
        if (!(new_format & 1u << i)) continue;
        put_u16(table_, at, slots[i]);
        at += 2;
      }
    }
    put_u16(table_, format_at, static_cast<int>(new_format));
  }

  void patch_subtable(unsigned type, std::uint64_t at) {
    enum : unsigned { single = 1, pair, cursive, mark_to_base, mark_to_ligature, mark_to_mark };
    const unsigned format = u16(table_, at);
    if (type == single) {
      const std::uint64_t count = format == 1 ? 1 : u16(table_, at + 6);
      const std::uint64_t first = format == 1 ? at + 6 : at + 8;
      std::vector<Record> records;
      for (std::uint64_t i = 0; i < count; ++i) records.push_back({first + i * size_of(u16(table_, at + 4)), at});
      patch_values(at + 4, records);
    } else if (type == pair) {
      const std::uint64_t first_size = size_of(u16(table_, at + 4));
      const std::uint64_t second_size = size_of(u16(table_, at + 6));
      std::vector<Record> firsts;
      std::vector<Record> seconds;
      // Sets of pairs may be shared, but not so that a few bytes fill the memory.
      const std::uint64_t most_pairs = 0xFFFF + std::uint64_t{16} * table_.size();
      const auto add = [&](std::uint64_t record, std::uint64_t parent) {
        budget_.spend(1);
        if (firsts.size() == most_pairs) throw Malformed(text("more than ", most_pairs, " pairs"));
        firsts.push_back({record, parent});
        seconds.push_back({record + first_size, parent});
      };
      if (format == 1) {
        for (const std::uint64_t set : offsets(at, at + 8)) {
          const std::uint64_t count = u16(table_, set);
          for (std::uint64_t i = 0; i < count; ++i) add(set + 4 + i * (2 + first_size + second_size), set);
        }
      } else {
        const std::uint64_t count = std::uint64_t{u16(table_, at + 12)} * u16(table_, at + 14);
        if (first_size + second_size == 0) return;
        for (std::uint64_t i = 0; i < count; ++i) add(at + 16 + i * (first_size + second_size), at);
      }
      patch_values(at + 4, firsts);
      patch_values(at + 6, seconds);
    } else if (type == cursive) {
      patch_anchors(at, at + 4, 2);
    } else if (type == mark_to_base || type == mark_to_ligature || type == mark_to_mark) {
      const std::uint64_t classes = u16(table_, at + 6);
      const std::uint64_t marks = at + u16(table_, at + 8);
      const std::uint64_t bases = at + u16(table_, at + 10);
      const std::uint64_t mark_count = u16(table_, marks);
      budget_.spend(mark_count);
      for (std::uint64_t i = 0; i < mark_count; ++i) {
        if (const std::uint64_t offset = u16(table_, marks + 4 + 4 * i)) patch_anchor(marks + offset);
      }
      if (type != mark_to_ligature) {
        patch_anchors(bases, bases, classes);
      } else {
        for (const std::uint64_t ligature : offsets(bases, bases)) patch_anchors(ligature, ligature, classes);
      }
    }
  }

  Bytes& table_;
  const VariationStore& store_;
  Budget& budget_;
  std::set<std::uint64_t> visited_;
  std::set<std::uint64_t> done_;
  int lost_ = 0;
};

}  // namespace

int patch_gpos(Bytes& gpos, const VariationStore& store, Budget& budget) {
  LayoutPatcher patcher(gpos, store, budget);
  patcher.patch_gpos();
  return patcher.lost();
}

void patch_gdef(Bytes& gdef, const VariationStore& store, Budget& budget) {
  LayoutPatcher(gdef, store, budget).patch_gdef();
}

namespace {

/// The features that stand for others at the place: index -> where the other feature table lies.
std::map<std::uint64_t, std::uint64_t> substituted_features(View table, const std::vector<double>& place) {
  const std::uint64_t variations = u32(table, 10);
  const auto holds = [&](std::uint64_t condition) {
    const std::uint64_t axis = u16(table, condition + 2);
    return u16(table, condition) == 1 && axis < place.size() && place[axis] >= f2dot14(table, condition + 4) &&
           place[axis] <= f2dot14(table, condition + 6);
  };
  const auto all_hold = [&](std::uint64_t set) {
    const std::uint64_t count = u16(table, set);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (!holds(set + u32(table, set + 2 + 4 * i))) return false;
    }
    return true;
  };
  std::map<std::uint64_t, std::uint64_t> features;
  const std::uint64_t count = u32(table, variations + 4);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t record = variations + 8 + 8 * i;
    const std::uint64_t conditions = u32(table, record);
    if (conditions != 0 && !all_hold(variations + conditions)) continue;
    const std::uint64_t substitution = variations + u32(table, record + 4);
    const std::uint64_t substituted = u16(table, substitution + 4);
    for (std::uint64_t k = 0; k < substituted; ++k) {
      features.emplace(u16(table, substitution + 6 + 6 * k), substitution + u32(table, substitution + 8 + 6 * k));
    }
    break;
  }
  return features;
}

}  // namespace

bool settle_features(Bytes& table, const std::vector<double>& place) {
  constexpr std::uint64_t header_size = 14;
  if (u16(table, 2) == 0 || table.size() < header_size || u32(table, 10) == 0) return true;
  const View old = table;
  const auto substituted = substituted_features(old, place);
  const std::uint64_t list = u16(old, 6);
  const std::uint64_t count = substituted.empty() ? 0 : u16(old, list);
  Bytes head(table.begin(), table.begin() + header_size);
  put_u32(head, 10, 0);
  Bytes features(2 + 6 * count);
  if (count > 0) put_u16(features, 0, static_cast<int>(count));
  std::map<std::pair<std::uint64_t, std::uint64_t>, std::uint64_t> placed;  // parameters and lookups -> where
  std::vector<std::pair<std::uint64_t, std::uint64_t>> parameters;          // of a feature, and where they lie
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t its = list + u16(old, list + 6 + 6 * i);
    const auto other = substituted.find(i);
    const std::uint64_t lookups = other == substituted.end() ? its : other->second;
    const auto [found, is_new] = placed.emplace(std::pair{its, lookups}, features.size());
    const View tag_bytes = slice(old, list + 2 + 6 * i, 4);
    std::ranges::copy(tag_bytes, features.begin() + static_cast<std::ptrdiff_t>(2 + 6 * i));
    if (found->second > 0xFFFF) return false;
    put_u16(features, 6 + 6 * i, static_cast<int>(found->second));
    if (!is_new) continue;
    const View bytes = slice(old, lookups, 4 + 2 * std::uint64_t{u16(old, lookups + 2)});
    if (const std::uint64_t offset = u16(old, its)) parameters.emplace_back(features.size(), its + offset);
    features.insert(features.end(), bytes.begin(), bytes.end());
    put_u16(features, found->second, 0);
  }
  if (count == 0) features.clear();
  for (const auto& [feature, at] : parameters) {
    const std::uint64_t offset = at - header_size + features.size() - feature;
    if (at < header_size || offset > 0xFFFF) return false;
    put_u16(features, feature, static_cast<int>(offset));
  }
  if (count > 0) {
    for (const std::uint64_t at : {std::uint64_t{4}, std::uint64_t{8}}) {  // scripts, lookups
      const std::uint64_t offset = u16(head, at);
      if (offset == 0) continue;
      if (offset < header_size || offset + features.size() > 0xFFFF) return false;
      put_u16(head, at, static_cast<int>(offset + features.size()));
    }
    put_u16(head, 6, static_cast<int>(header_size));
  }
  head.insert(head.end(), features.begin(), features.end());
  head.insert(head.end(), old.begin() + header_size, old.end());
  table = std::move(head);
  return true;
}

}  // namespace glyphs::variation
