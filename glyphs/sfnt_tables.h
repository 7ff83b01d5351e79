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
std::string tag_name(Tag value);

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
  View require(Tag wanted, std::uint64_t least) const;
};

/// The directory of a face: all tables within the file, none over the directory, none twice, none overlapping (two
/// tags may share the same bytes).
Directory read_directory(View file, int face_index);

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

constexpr std::uint64_t short_offsets_reach = 2 * 0xFFFF;  ///< bytes of `glyf`, where `loca` has 16 bits
/// `loca` of these offsets, one more than glyphs; even ones unless it is long.
std::vector<unsigned char> build_loca(const std::vector<std::uint64_t>& offsets, bool is_long);

/// What every other table is read by; checked against each other.
struct Basics {
  int glyph_count = 0;
  int units_per_em = 0;
  Metrics metrics;
  GlyphData outlines;  ///< empty unless there is `glyf`
};

/// Throws  Malformed if head, maxp, hhea or hmtx, or loca beside glyf, are missing, too short, or contradict each
///         other.
Basics read_basics(const Directory& directory);

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
int instruction_length(View glyph);

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
SimpleGlyph read_simple_glyph(View glyph);

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
