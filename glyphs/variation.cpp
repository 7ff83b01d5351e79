#include "glyphs/variation.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "glyphs/error.h"
#include "glyphs/freetype_loader.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/sfnt_tables.h"

namespace glyphs {

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

double round_half_up(double value) { return std::floor(value + 0.5); }
double fixed(View bytes, std::uint64_t at) { return static_cast<std::int32_t>(u32(bytes, at)) / 65536.0; }
double f2dot14(View bytes, std::uint64_t at) { return i16(bytes, at) / 16384.0; }

int to_int16(double value, const char* what) {
  const double rounded = round_half_up(value);
  if (!(rounded >= std::numeric_limits<std::int16_t>::min() && rounded <= std::numeric_limits<std::int16_t>::max())) {
    throw Malformed(text(what, " ", rounded, " does not fit in 16 bits"));
  }
  return static_cast<int>(rounded);
}

/// Steps that decoding may take in all. The largest fonts in use, of 65,535 glyphs, take a tenth of it.
class Budget {
 public:
  void spend(std::uint64_t steps) {
    constexpr std::uint64_t most = 1'000'000'000;
    spent_ += steps;
    if (spent_ > most) throw Exhausted("its variations take more than a thousand million steps to decode");
  }
  /// Ends the whole job, where a Malformed ends one glyph.
  struct Exhausted : std::runtime_error {
    using std::runtime_error::runtime_error;
  };

 private:
  std::uint64_t spent_ = 0;
};

// ---- the design space

struct Axis {
  Tag name = 0;
  double minimum = 0.0;
  double initial = 0.0;
  double maximum = 0.0;
};

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

std::string list_axes(const std::vector<Axis>& axes) {
  std::string list;
  for (const Axis& axis : axes) {
    list += text(list.empty() ? "" : ", ", sfnt::tag_name(axis.name), " from ", axis.minimum, " to ", axis.maximum);
  }
  return list;
}

/// The place in the coordinates that variations are given in: -1 to 1, 0 the default, bent by avar.
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

/// Point numbers of a tuple; none listed means all.
struct PointNumbers {
  bool is_all = true;
  std::vector<int> list;
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

struct SharedTuples {
  View bytes;
  std::uint64_t count = 0;
};

/// Gives `use` every tuple that counts at the place: how much, its points, and its deltas, x before y.
template <typename Use>
void for_each_tuple(View bytes, std::uint64_t header, const SharedTuples& shared, const std::vector<double>& place,
                    std::size_t point_count, int dimensions, Budget& budget, const Use& use) {
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

struct Vector {
  double x = 0.0;
  double y = 0.0;
};

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

/// Moves the untouched points of a contour along with the touched ones.
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

class VariationStore {
 public:
  VariationStore(View table, std::uint64_t offset, const std::vector<double>& place, Budget& budget)
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

  /// 0 where the store has nothing.
  double delta(unsigned outer, unsigned inner) const {
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

 private:
  View bytes_;
  Budget& budget_;
  std::vector<double> scalars_;
};

/// What HVAR or VVAR says of the glyphs' metrics.
class MetricVariations {
 public:
  MetricVariations(View table, const std::vector<double>& place, Budget& budget)
      : table_(table), store_(table, u32(table, 4), place, budget) {
    if (u16(table, 0) != 1) throw Malformed(text("table of varied metrics of version ", u16(table, 0)));
  }

  /// Where the header says by which map a metric's variations are found.
  enum Map : unsigned { advances = 8, top_bearings = 12, vertical_origins = 20 };

  bool has(Map map) const { return u32(table_, map) != 0; }

  /// Without a map advances are found by glyph id, and no other metric varies.
  double delta(Map which, int glyph) const {
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

 private:
  View table_;
  VariationStore store_;
};

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

/// Lets the features of GSUB or GPOS that others stand for at the place be those. A new list of features comes to lie
/// behind the header, and all else moves up by its length: no other offset has to change. False if an offset does not
/// fit; then the features are as at the default.
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

// ---- the font

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
    if (has(tag("GPOS"))) {
      LayoutPatcher patcher(tables_[tag("GPOS")], store, budget_);
      patcher.patch_gpos();
      lost += patcher.lost();
    }
    LayoutPatcher patcher(gdef, store, budget_);
    patcher.patch_gdef();
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
      double low_x = std::numeric_limits<double>::infinity();
      double low_y = low_x;
      double high_x = -low_x;
      double high_y = -low_x;
      for (const fontcore::BezierContour& contour : compose(draft, glyph.id)) {
        low_x = std::min(low_x, contour.points().col(0).minCoeff());
        low_y = std::min(low_y, contour.points().col(1).minCoeff());
        high_x = std::max(high_x, contour.points().col(0).maxCoeff());
        high_y = std::max(high_y, contour.points().col(1).maxCoeff());
      }
      if (low_x > high_x) continue;
      sfnt::put_box(glyphs_[static_cast<std::size_t>(glyph.id)], 2,
                    {to_int16(low_x + glyph.origin, "box coordinate"), to_int16(low_y, "box coordinate"),
                     to_int16(high_x + glyph.origin, "box coordinate"), to_int16(high_y, "box coordinate")});
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
