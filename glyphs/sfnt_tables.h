#pragma once

// Private to the loader and the writer: the bytes of an sfnt. Every read is checked, every offset has 64 bits.

#include <algorithm>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "fontcore/error.h"

namespace glyphs::sfnt {

/// What is wrong with the bytes, one line; who catches it adds the file.
struct Malformed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

using View = std::span<const unsigned char>;

inline View slice(View bytes, std::uint64_t at, std::uint64_t length) {
  if (at > bytes.size() || length > bytes.size() - at) {
    throw Malformed(fontcore::text(length, " bytes at ", at, " reach past the end of ", bytes.size()));
  }
  return bytes.subspan(at, length);
}

inline std::uint8_t u8(View bytes, std::uint64_t at) { return slice(bytes, at, 1)[0]; }
inline std::uint16_t u16(View bytes, std::uint64_t at) {
  const View b = slice(bytes, at, 2);
  return static_cast<std::uint16_t>(b[0] << 8 | b[1]);
}
inline std::int16_t i16(View bytes, std::uint64_t at) { return static_cast<std::int16_t>(u16(bytes, at)); }
inline std::uint32_t u32(View bytes, std::uint64_t at) {
  return std::uint32_t{u16(bytes, at)} << 16 | u16(bytes, at + 2);
}

using Tag = std::uint32_t;

constexpr Tag tag(const char (&name)[5]) {
  Tag value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(name[i]);
  return value;
}

/// The tag as text: trailing spaces dropped, what cannot be printed as '?'.
inline std::string tag_name(Tag value) {
  std::string name;
  for (int shift = 24; shift >= 0; shift -= 8) {
    const auto c = static_cast<char>(value >> shift & 0xFF);
    name += c >= ' ' && c <= '~' ? c : '?';
  }
  while (!name.empty() && name.back() == ' ') name.pop_back();
  return name;
}

struct TableRecord {
  Tag tag = 0;
  View bytes;
};

/// The tables of one face, in the order of the directory.
struct Directory {
  Tag version = 0;
  bool is_collection = false;
  std::vector<TableRecord> tables;

  const TableRecord* find(Tag wanted) const {
    const auto at = std::find_if(tables.begin(), tables.end(), [&](const TableRecord& t) { return t.tag == wanted; });
    return at == tables.end() ? nullptr : &*at;
  }
  bool has(Tag wanted) const { return find(wanted) != nullptr; }
  /// Throws  Malformed if there is none, or if it is shorter than `least`.
  View require(Tag wanted, std::uint64_t least) const {
    const TableRecord* table = find(wanted);
    if (!table) throw Malformed(fontcore::text("table ", tag_name(wanted), " is missing"));
    if (table->bytes.size() < least) {
      throw Malformed(
          fontcore::text("table ", tag_name(wanted), " has ", table->bytes.size(), " bytes, needs ", least));
    }
    return table->bytes;
  }
};

/// The directory of a face: all tables within the file, none over the directory, none twice, none overlapping (two
/// tags may share the same bytes).
inline Directory read_directory(View file, int face_index) {
  using fontcore::text;
  if (file.empty()) throw Malformed("is empty");
  if (file.size() < 12) throw Malformed(text("is not a font: it has ", file.size(), " bytes"));
  Directory directory;
  std::uint64_t start = 0;
  directory.version = u32(file, 0);
  std::uint64_t faces = 1;
  if (directory.version == tag("ttcf")) {
    directory.is_collection = true;
    faces = u32(file, 8);
    if (12 + 4 * faces > file.size()) {
      throw Malformed(text("is truncated: a collection of ", faces, " faces in ", file.size(), " bytes"));
    }
  }
  if (face_index < 0 || static_cast<std::uint64_t>(face_index) >= faces) {
    throw Malformed(text("has ", faces, " faces; there is no face ", face_index));
  }
  if (directory.is_collection) {
    start = u32(file, 12 + 4 * static_cast<std::uint64_t>(face_index));
    if (start > file.size() || file.size() - start < 12) {
      throw Malformed(text("is truncated: face ", face_index, " begins at ", start, " of ", file.size(), " bytes"));
    }
    directory.version = u32(file, start);
  }
  if (directory.version != 0x00010000 && directory.version != tag("true") && directory.version != tag("OTTO")) {
    throw Malformed("is not a TrueType or OpenType font");
  }
  const std::uint64_t count = u16(file, start + 4);
  const std::uint64_t end = start + 12 + 16 * count;
  if (count == 0) throw Malformed("is not a font: it has no tables");
  if (end > file.size()) {
    throw Malformed(
        text("is truncated: the directory of ", count, " tables ends at ", end, " of ", file.size(), " bytes"));
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t at = start + 12 + 16 * i;
    const Tag name = u32(file, at);
    const std::uint64_t offset = u32(file, at + 8);
    const std::uint64_t length = u32(file, at + 12);
    if (directory.has(name)) throw Malformed(text("table ", tag_name(name), " stands twice in the directory"));
    if (offset + length > file.size()) {
      throw Malformed(
          text("is truncated: table ", tag_name(name), " ends at ", offset + length, " of ", file.size(), " bytes"));
    }
    if (length > 0 && offset < end && offset + length > start) {
      throw Malformed(text("table ", tag_name(name), " lies at ", offset, ", inside the directory"));
    }
    directory.tables.push_back({name, file.subspan(offset, length)});
  }
  std::vector<TableRecord> sorted = directory.tables;
  std::erase_if(sorted, [](const TableRecord& t) { return t.bytes.empty(); });
  std::sort(sorted.begin(), sorted.end(),
            [](const TableRecord& a, const TableRecord& b) { return a.bytes.data() < b.bytes.data(); });
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const View a = sorted[i - 1].bytes;
    const View b = sorted[i].bytes;
    const bool same = a.data() == b.data() && a.size() == b.size();
    if (!same && a.data() + a.size() > b.data()) {
      throw Malformed(text("tables ", tag_name(sorted[i - 1].tag), " and ", tag_name(sorted[i].tag), " overlap"));
    }
  }
  return directory;
}

/// A table to be written, and how long it is.
struct TableSize {
  Tag tag = 0;
  std::uint64_t length = 0;
};

/// A single font whose tables are still to be filled in; `seal` makes it whole.
struct Layout {
  std::vector<unsigned char> file;
  std::vector<std::uint64_t> offsets;  ///< of each table, in the order given
};

/// The directory of a single font, by tag, and room for its tables in the order given, each padded to four bytes.
Layout lay_out(Tag version, const std::vector<TableSize>& tables);
/// Puts in the tables' checksums and head.checkSumAdjustment.
void seal(std::vector<unsigned char>& file);
/// A single font of the given tables, in that order in the file.
std::vector<unsigned char> build(Tag version, const std::vector<TableRecord>& tables);
/// The tables of a directory as they lie in the file.
std::vector<TableRecord> in_file_order(const Directory& directory);

/// The font's PostScript name: name 6 of table name, else `otherwise`, without what PostScript does not allow.
std::string postscript_name(const Directory& directory, const std::string& otherwise);

/// `hmtx` with the numbers that say how to read it.
struct Metrics {
  View hmtx;
  int long_count = 0;  ///< hhea.numberOfHMetrics

  std::uint64_t bearing_offset(int glyph) const {
    const auto g = static_cast<std::uint64_t>(glyph);
    const auto n = static_cast<std::uint64_t>(long_count);
    return g < n ? 4 * g + 2 : 4 * n + 2 * (g - n);
  }
  int bearing(int glyph) const { return i16(hmtx, bearing_offset(glyph)); }
  int advance(int glyph) const { return u16(hmtx, 4 * static_cast<std::uint64_t>(std::min(glyph, long_count - 1))); }
};

/// `loca` and `glyf`.
struct GlyphData {
  View loca;
  View glyf;
  bool has_long_offsets = false;

  std::uint64_t offset(int index) const {
    const auto i = static_cast<std::uint64_t>(index);
    return has_long_offsets ? u32(loca, 4 * i) : 2 * std::uint64_t{u16(loca, 2 * i)};
  }
  /// Throws  Malformed if the glyph's offsets fall, or leave the table.
  View bytes(int glyph) const {
    const std::uint64_t from = offset(glyph);
    const std::uint64_t to = offset(glyph + 1);
    if (from > to || to > glyf.size()) {
      throw Malformed(fontcore::text("loca gives it bytes ", from, " to ", to, " of ", glyf.size(), " in glyf"));
    }
    return glyf.subspan(from, to - from);
  }
};

/// What every other table is read by; checked against each other.
struct Basics {
  int glyph_count = 0;
  int units_per_em = 0;
  Metrics metrics;
  GlyphData outlines;  ///< empty unless there is `glyf`
};

/// Throws  Malformed if head, maxp, hhea or hmtx, or loca beside glyf, are missing, too short, or contradict each
///         other.
inline Basics read_basics(const Directory& directory) {
  using fontcore::text;
  Basics basics;
  const View head = directory.require(tag("head"), 54);
  if (u32(head, 12) != 0x5F0F3CF5) throw Malformed("table head has no magic number");
  basics.units_per_em = u16(head, 18);
  if (basics.units_per_em < 16 || basics.units_per_em > 16384) {
    throw Malformed(text("table head: ", basics.units_per_em, " units per em, outside 16 to 16384"));
  }
  const bool has_glyf = directory.version != tag("OTTO") && directory.has(tag("glyf"));
  basics.glyph_count = u16(directory.require(tag("maxp"), has_glyf ? 32 : 6), 4);
  if (basics.glyph_count == 0) throw Malformed("table maxp: no glyphs");
  const auto glyphs = static_cast<std::uint64_t>(basics.glyph_count);
  const std::uint64_t metrics = u16(directory.require(tag("hhea"), 36), 34);
  if (metrics == 0 || metrics > glyphs) {
    throw Malformed(text("table hhea: ", metrics, " metrics for ", glyphs, " glyphs"));
  }
  basics.metrics = {directory.require(tag("hmtx"), 4 * metrics + 2 * (glyphs - metrics)), static_cast<int>(metrics)};
  if (has_glyf) {
    const int format = i16(head, 50);
    if (format != 0 && format != 1) throw Malformed(text("table head: indexToLocFormat ", format, " is not 0 or 1"));
    if (i16(head, 52) != 0) throw Malformed(text("table head: glyphDataFormat ", i16(head, 52), " is not 0"));
    basics.outlines.has_long_offsets = format == 1;
    basics.outlines.loca = directory.require(tag("loca"), (format == 1 ? 4 : 2) * (glyphs + 1));
    basics.outlines.glyf = directory.require(tag("glyf"), 0);
  }
  return basics;
}

/// Control box of a glyph, from its header.
struct Box {
  int x_min = 0;
  int y_min = 0;
  int x_max = 0;
  int y_max = 0;

  friend bool operator==(const Box&, const Box&) = default;
};

inline Box read_box(View glyph) { return {i16(glyph, 2), i16(glyph, 4), i16(glyph, 6), i16(glyph, 8)}; }

/// Bytes of one component of a composite, from its flags.
inline unsigned component_length(unsigned flags) {
  enum : unsigned { words = 1, scale = 8, scale_xy = 0x40, matrix = 0x80 };
  return 4u + (flags & words ? 4u : 2u) + (flags & scale ? 2u : flags & scale_xy ? 4u : flags & matrix ? 8u : 0u);
}

/// Bytes of instructions of a glyph; 0 for an empty one.
inline int instruction_length(View glyph) {
  if (glyph.empty()) return 0;
  const int contours = i16(glyph, 0);
  if (contours >= 0) return contours == 0 ? 0 : u16(glyph, 10 + 2 * static_cast<std::uint64_t>(contours));
  enum : unsigned { more = 0x20, instructions = 0x100 };
  std::uint64_t at = 10;
  unsigned flags = more;
  while (flags & more) {
    flags = u16(glyph, at);
    at += component_length(flags);
  }
  return flags & instructions ? u16(glyph, at) : 0;
}

/// A simple glyph as stored.
struct SimpleGlyph {
  struct Point {
    int x = 0;
    int y = 0;
    bool on_curve = false;
  };
  std::vector<int> ends;  ///< last point of every contour
  std::vector<Point> points;
  bool overlaps = false;  ///< bit 6 of the first flag
};

/// A simple glyph's bytes as small as the format allows: short vectors, repeated flags.
std::vector<unsigned char> encode(const SimpleGlyph& glyph, const Box& box, View instructions = {});

/// Throws  Malformed if it ends early, or if the contours' ends do not rise.
inline SimpleGlyph read_simple_glyph(View glyph) {
  enum : unsigned { on = 1, short_x = 2, short_y = 4, repeat = 8, same_x = 16, same_y = 32, overlap = 64 };
  SimpleGlyph result;
  const int contours = i16(glyph, 0);
  std::uint64_t at = 10;
  for (int c = 0; c < contours; ++c, at += 2) {
    const int end = u16(glyph, at);
    if (end <= (result.ends.empty() ? -1 : result.ends.back())) throw Malformed("its contours' ends do not rise");
    result.ends.push_back(end);
  }
  if (result.ends.empty()) return result;
  at += 2 + std::uint64_t{u16(glyph, at)};
  const auto count = static_cast<std::size_t>(result.ends.back()) + 1;
  std::vector<unsigned> flags;
  while (flags.size() < count) {
    const unsigned flag = u8(glyph, at++);
    const std::size_t times = flag & repeat ? std::size_t{u8(glyph, at++)} + 1 : 1;
    flags.insert(flags.end(), std::min(times, count - flags.size()), flag);
  }
  result.overlaps = (flags[0] & overlap) != 0;
  const auto read_axis = [&](unsigned is_short, unsigned same, int SimpleGlyph::Point::*axis) {
    int value = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (flags[i] & is_short) {
        const int step = u8(glyph, at++);
        value += flags[i] & same ? step : -step;
      } else if (!(flags[i] & same)) {
        value += i16(glyph, at);
        at += 2;
      }
      result.points[i].*axis = value;
    }
  };
  result.points.resize(count);
  for (std::size_t i = 0; i < count; ++i) result.points[i].on_curve = (flags[i] & on) != 0;
  read_axis(short_x, same_x, &SimpleGlyph::Point::x);
  read_axis(short_y, same_y, &SimpleGlyph::Point::y);
  return result;
}

// ---- bytes to be written; offsets that are not there are a slip of the program

inline void append_u16(std::vector<unsigned char>& bytes, int value) {
  bytes.push_back(static_cast<unsigned char>(value >> 8 & 0xFF));
  bytes.push_back(static_cast<unsigned char>(value & 0xFF));
}
inline void put_u16(std::vector<unsigned char>& bytes, std::uint64_t at, int value) {
  bytes.at(at) = static_cast<unsigned char>(value >> 8 & 0xFF);
  bytes.at(at + 1) = static_cast<unsigned char>(value & 0xFF);
}
inline void put_u32(std::vector<unsigned char>& bytes, std::uint64_t at, std::uint32_t value) {
  put_u16(bytes, at, static_cast<int>(value >> 16));
  put_u16(bytes, at + 2, static_cast<int>(value & 0xFFFF));
}
inline void put_box(std::vector<unsigned char>& bytes, std::uint64_t at, const Box& box) {
  put_u16(bytes, at, box.x_min);
  put_u16(bytes, at + 2, box.y_min);
  put_u16(bytes, at + 4, box.x_max);
  put_u16(bytes, at + 6, box.y_max);
}

}  // namespace glyphs::sfnt
