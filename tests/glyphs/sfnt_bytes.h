#pragma once

// The bytes of small TrueType fonts, made and taken apart without the library: tests judge by these.

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace sfnt_bytes {

using Bytes = std::vector<unsigned char>;

inline void put(Bytes& bytes, std::uint32_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<unsigned char>(value >> shift & 0xFF));
  }
}
inline void put16(Bytes& bytes, int value) { put(bytes, static_cast<std::uint32_t>(value), 2); }
inline void set16(Bytes& bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<unsigned char>(value >> 8 & 0xFF);
  bytes.at(at + 1) = static_cast<unsigned char>(value & 0xFF);
}
inline std::uint32_t get(const Bytes& bytes, std::size_t at, int size) {
  std::uint32_t value = 0;
  for (int i = 0; i < size; ++i) value = value << 8 | bytes.at(at + static_cast<std::size_t>(i));
  return value;
}
inline int get16(const Bytes& bytes, std::size_t at) { return static_cast<std::int16_t>(get(bytes, at, 2)); }

/// The tables of a single font, by tag.
inline std::map<std::string, Bytes> tables_of(const Bytes& font) {
  std::map<std::string, Bytes> tables;
  for (std::size_t i = 0; i < get(font, 4, 2); ++i) {
    const std::size_t at = 12 + 16 * i;
    const auto from = font.begin() + get(font, at + 8, 4);
    tables[std::string(font.begin() + static_cast<std::ptrdiff_t>(at),
                       font.begin() + static_cast<std::ptrdiff_t>(at + 4))] = Bytes(from, from + get(font, at + 12, 4));
  }
  return tables;
}

inline std::uint32_t checksum(Bytes bytes) {
  bytes.resize((bytes.size() + 3) / 4 * 4);
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 4) sum += get(bytes, i, 4);
  return sum;
}

inline Bytes font_of(const std::map<std::string, Bytes>& tables) {
  Bytes font{0, 1, 0, 0};
  put16(font, static_cast<int>(tables.size()));
  for (int i = 0; i < 3; ++i) put16(font, 0);
  std::uint32_t offset = static_cast<std::uint32_t>(12 + 16 * tables.size());
  Bytes body;
  for (const auto& [tag, bytes] : tables) {
    font.insert(font.end(), tag.begin(), tag.end());
    put(font, checksum(bytes), 4);
    put(font, offset + static_cast<std::uint32_t>(body.size()), 4);
    put(font, static_cast<std::uint32_t>(bytes.size()), 4);
    body.insert(body.end(), bytes.begin(), bytes.end());
    body.resize((body.size() + 3) / 4 * 4);
  }
  font.insert(font.end(), body.begin(), body.end());
  return font;
}

/// The glyphs' bytes, by glyph id, padding included.
inline std::vector<Bytes> glyphs_of(const std::map<std::string, Bytes>& tables) {
  const bool is_long = get16(tables.at("head"), 50) == 1;
  const Bytes& loca = tables.at("loca");
  const Bytes& glyf = tables.at("glyf");
  std::vector<Bytes> glyphs;
  const auto offset = [&](std::size_t i) { return is_long ? get(loca, 4 * i, 4) : 2 * get(loca, 2 * i, 2); };
  for (std::size_t i = 0; i < get(tables.at("maxp"), 4, 2); ++i) {
    glyphs.emplace_back(glyf.begin() + offset(i), glyf.begin() + offset(i + 1));
  }
  return glyphs;
}

struct Point {
  int x;
  int y;
  bool on_curve = true;
};
using Contours = std::vector<std::vector<Point>>;

/// A simple glyph with word deltas; `first_flag` is added to the first flag.
inline Bytes simple_glyph(const Contours& contours, int first_flag = 0, const Bytes& instructions = {}) {
  std::vector<Point> points;
  for (const auto& contour : contours) points.insert(points.end(), contour.begin(), contour.end());
  int box[4] = {32767, 32767, -32768, -32768};
  for (const Point& p : points) {
    box[0] = p.x < box[0] ? p.x : box[0];
    box[1] = p.y < box[1] ? p.y : box[1];
    box[2] = p.x > box[2] ? p.x : box[2];
    box[3] = p.y > box[3] ? p.y : box[3];
  }
  Bytes glyph;
  put16(glyph, static_cast<int>(contours.size()));
  for (const int side : box) put16(glyph, side);
  int end = -1;
  for (const auto& contour : contours) put16(glyph, end += static_cast<int>(contour.size()));
  put16(glyph, static_cast<int>(instructions.size()));
  glyph.insert(glyph.end(), instructions.begin(), instructions.end());
  for (std::size_t i = 0; i < points.size(); ++i) {
    glyph.push_back(static_cast<unsigned char>((points[i].on_curve ? 1 : 0) | (i == 0 ? first_flag : 0)));
  }
  for (int Point::*axis : {&Point::x, &Point::y}) {
    int last = 0;
    for (const Point& p : points) {
      put16(glyph, p.*axis - last);
      last = p.*axis;
    }
  }
  return glyph;
}

/// One record of a composite; `matrix` holds no, one, two or four F2Dot14 numbers.
struct Part {
  int glyph;
  int first = 0;
  int second = 0;
  bool is_shift = true;
  int more_flags = 0;
  std::vector<double> matrix = {};
};

inline Bytes composite(const std::vector<Part>& parts) {
  Bytes glyph;
  put16(glyph, -1);
  for (int i = 0; i < 4; ++i) put16(glyph, 0);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& part = parts[i];
    const int matrix = part.matrix.size() == 1   ? 8
                       : part.matrix.size() == 2 ? 0x40
                       : part.matrix.size() == 4 ? 0x80
                                                 : 0;
    put16(glyph, 1 | (part.is_shift ? 2 : 0) | matrix | part.more_flags | (i + 1 < parts.size() ? 0x20 : 0));
    put16(glyph, part.glyph);
    put16(glyph, part.first);
    put16(glyph, part.second);
    for (const double entry : part.matrix) put16(glyph, static_cast<int>(entry * 16384));
  }
  return glyph;
}

/// A font of the given glyphs; left side bearings are xMin plus `bearing_shift`, advances 600; glyph 1 is 'A', and so
/// on.
inline std::map<std::string, Bytes> small_font(const std::vector<Bytes>& glyphs, int bearing_shift = 0) {
  const int count = static_cast<int>(glyphs.size());
  std::map<std::string, Bytes> tables;
  Bytes head;
  put(head, 0x00010000, 4);
  put(head, 0, 4);
  put(head, 0, 4);
  put(head, 0x5F0F3CF5, 4);
  put16(head, 3);
  put16(head, 1000);
  head.resize(36);
  for (const int side : {0, 0, 1000, 1000}) put16(head, side);
  put16(head, 0);
  put16(head, 8);
  put16(head, 2);
  put16(head, 0);  // short offsets
  put16(head, 0);
  tables["head"] = head;
  Bytes hhea;
  put(hhea, 0x00010000, 4);
  for (const int value : {800, -200, 0, 600, 0, 0, 0, 1}) put16(hhea, value);
  hhea.resize(34);
  put16(hhea, count);
  tables["hhea"] = hhea;
  Bytes maxp;
  put(maxp, 0x00010000, 4);
  put16(maxp, count);
  for (const int value : {1000, 1000, 1000, 1000, 2, 0, 0, 0, 0, 0, 100, 10, 10}) put16(maxp, value);
  tables["maxp"] = maxp;
  Bytes glyf;
  Bytes loca;
  Bytes hmtx;
  for (Bytes glyph : glyphs) {
    put16(loca, static_cast<int>(glyf.size() / 2));
    put16(hmtx, 600);
    put16(hmtx, glyph.empty() ? 0 : get16(glyph, 2) + bearing_shift);
    glyph.resize((glyph.size() + 3) / 4 * 4);
    glyf.insert(glyf.end(), glyph.begin(), glyph.end());
  }
  put16(loca, static_cast<int>(glyf.size() / 2));
  tables["glyf"] = glyf;
  tables["loca"] = loca;
  tables["hmtx"] = hmtx;
  Bytes cmap;
  for (const int value : {0, 1, 3, 1}) put16(cmap, value);
  put(cmap, 12, 4);
  const int last = 0x40 + count - 1;  // one segment from 'A', and the closing one
  for (const int value : {4, 32, 0, 4, 4, 1, 0, last, 0xFFFF, 0, 0x41, 0xFFFF, 1 - 0x41, 1, 0, 0}) put16(cmap, value);
  tables["cmap"] = cmap;
  Bytes post;
  put(post, 0x00030000, 4);
  post.resize(32);
  tables["post"] = post;
  tables["OS/2"] = Bytes(78);
  tables["name"] = {0, 0, 0, 0, 0, 6};
  return tables;
}

}  // namespace sfnt_bytes
