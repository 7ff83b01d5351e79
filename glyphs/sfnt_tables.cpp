#include "glyphs/sfnt_tables.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <functional>
#include <string_view>

namespace glyphs::sfnt {

using fontcore::text;

namespace {

std::uint64_t padded(std::uint64_t length) { return (length + 3) / 4 * 4; }

/// Sum of big-endian words; `bytes` is padded.
std::uint32_t checksum(View bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 4 <= bytes.size(); i += 4) {
    sum += std::uint32_t{bytes[i]} << 24 | std::uint32_t{bytes[i + 1]} << 16 | std::uint32_t{bytes[i + 2]} << 8 |
           bytes[i + 3];
  }
  return sum;
}

}  // namespace

std::string tag_name(Tag value) {
  std::string name;
  for (int shift = 24; shift >= 0; shift -= 8) {
    const auto c = static_cast<char>(value >> shift & 0xFF);
    name += c >= ' ' && c <= '~' ? c : '?';
  }
  while (!name.empty() && name.back() == ' ') name.pop_back();
  return name;
}

View Directory::require(Tag wanted, std::uint64_t least) const {
  const TableRecord* table = find(wanted);
  if (!table) throw Malformed(text("table ", tag_name(wanted), " is missing"));
  if (table->bytes.size() < least) {
    throw Malformed(text("table ", tag_name(wanted), " has ", table->bytes.size(), " bytes, needs ", least));
  }
  return table->bytes;
}

Directory read_directory(View file, int face_index) {
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

Basics read_basics(const Directory& directory) {
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

int instruction_length(View glyph) {
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

SimpleGlyph read_simple_glyph(View glyph) {
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

Layout lay_out(Tag version, const std::vector<TableSize>& tables) {
  Layout layout;
  const std::uint64_t count = tables.size();
  std::uint64_t end = 12 + 16 * count;
  for (const TableSize& table : tables) {
    layout.offsets.push_back(end);
    end += padded(table.length);
  }
  layout.file.resize(end);
  put_u32(layout.file, 0, version);
  const unsigned power = std::bit_floor(static_cast<unsigned>(count));
  put_u16(layout.file, 4, static_cast<int>(count));
  put_u16(layout.file, 6, static_cast<int>(16 * power));
  put_u16(layout.file, 8, static_cast<int>(std::bit_width(power)) - 1);
  put_u16(layout.file, 10, static_cast<int>(16 * (count - power)));
  std::vector<std::size_t> by_tag(tables.size());
  for (std::size_t i = 0; i < by_tag.size(); ++i) by_tag[i] = i;
  std::ranges::sort(by_tag, {}, [&](std::size_t i) { return tables[i].tag; });
  std::uint64_t at = 12;
  for (const std::size_t i : by_tag) {
    put_u32(layout.file, at, tables[i].tag);
    put_u32(layout.file, at + 8, static_cast<std::uint32_t>(layout.offsets[i]));
    put_u32(layout.file, at + 12, static_cast<std::uint32_t>(tables[i].length));
    at += 16;
  }
  return layout;
}

void seal(std::vector<unsigned char>& file) {
  constexpr std::uint32_t whole = 0xB1B0AFBA;  // what a font's words sum to
  const std::uint64_t count = u16(file, 4);
  std::uint64_t adjustment = 0;
  for (std::uint64_t at = 12; at < 12 + 16 * count; at += 16) {
    const std::uint64_t offset = u32(file, at + 8);
    const std::uint64_t length = u32(file, at + 12);
    if (u32(file, at) == tag("head") && length >= 12) {
      adjustment = offset + 8;
      put_u32(file, adjustment, 0);
    }
    put_u32(file, at + 4, checksum(slice(file, offset, padded(length))));
  }
  if (adjustment != 0) put_u32(file, adjustment, whole - checksum(file));
}

std::vector<unsigned char> build(Tag version, const std::vector<TableRecord>& tables) {
  std::vector<TableSize> sizes;
  for (const TableRecord& table : tables) sizes.push_back({table.tag, table.bytes.size()});
  Layout layout = lay_out(version, sizes);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    std::ranges::copy(tables[i].bytes, layout.file.begin() + static_cast<std::ptrdiff_t>(layout.offsets[i]));
  }
  seal(layout.file);
  return std::move(layout.file);
}

std::vector<TableRecord> in_file_order(const Directory& directory) {
  std::vector<TableRecord> tables = directory.tables;
  std::ranges::stable_sort(tables, std::less<>(), [](const TableRecord& table) { return table.bytes.data(); });
  return tables;
}

std::vector<unsigned char> build_loca(const std::vector<std::uint64_t>& offsets, bool is_long) {
  std::vector<unsigned char> loca(offsets.size() * (is_long ? 4 : 2));
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    if (is_long) {
      put_u32(loca, 4 * i, static_cast<std::uint32_t>(offsets[i]));
    } else {
      put_u16(loca, 2 * i, static_cast<int>(offsets[i] / 2));
    }
  }
  return loca;
}

std::vector<unsigned char> encode(const SimpleGlyph& glyph, const Box& box, View instructions) {
  enum : unsigned { on = 1, short_x = 2, short_y = 4, repeat = 8, same_x = 16, same_y = 32, overlap = 64 };
  std::vector<unsigned char> bytes;
  append_u16(bytes, static_cast<int>(glyph.ends.size()));
  bytes.resize(10);
  put_box(bytes, 2, box);
  for (const int end : glyph.ends) append_u16(bytes, end);
  append_u16(bytes, static_cast<int>(instructions.size()));
  bytes.insert(bytes.end(), instructions.begin(), instructions.end());
  std::vector<unsigned> flags;
  std::vector<unsigned char> steps_x;
  std::vector<unsigned char> steps_y;
  const auto encode_step = [](int step, unsigned is_short, unsigned same,
                              std::vector<unsigned char>& steps) -> unsigned {
    if (step == 0) return same;
    if (step >= -255 && step <= 255) {
      steps.push_back(static_cast<unsigned char>(std::abs(step)));
      return step > 0 ? is_short | same : is_short;
    }
    append_u16(steps, step);
    return 0;
  };
  SimpleGlyph::Point last;
  for (const SimpleGlyph::Point& point : glyph.points) {
    unsigned flag = point.on_curve ? on : 0u;
    if (flags.empty() && glyph.overlaps) flag |= overlap;
    flag |= encode_step(point.x - last.x, short_x, same_x, steps_x);
    flag |= encode_step(point.y - last.y, short_y, same_y, steps_y);
    flags.push_back(flag);
    last = point;
  }
  for (std::size_t i = 0; i < flags.size();) {
    std::size_t run = 1;
    while (run < 256 && i + run < flags.size() && flags[i + run] == flags[i]) ++run;
    if (run > 2) {
      bytes.push_back(static_cast<unsigned char>(flags[i] | repeat));
      bytes.push_back(static_cast<unsigned char>(run - 1));
    } else {
      bytes.insert(bytes.end(), run, static_cast<unsigned char>(flags[i]));
    }
    i += run;
  }
  bytes.insert(bytes.end(), steps_x.begin(), steps_x.end());
  bytes.insert(bytes.end(), steps_y.begin(), steps_y.end());
  return bytes;
}

std::string postscript_name(const Directory& directory, const std::string& otherwise) {
  std::string found;
  if (const TableRecord* table = directory.find(tag("name"))) {
    try {
      const std::uint64_t strings = u16(table->bytes, 4);
      for (std::uint64_t i = 0; i < u16(table->bytes, 2) && found.empty(); ++i) {
        const std::uint64_t at = 6 + 12 * i;
        if (u16(table->bytes, at + 6) != 6) continue;
        const View bytes = slice(table->bytes, strings + u16(table->bytes, at + 10), u16(table->bytes, at + 8));
        for (const unsigned char c : bytes) {
          if (c != 0) found += static_cast<char>(c);  // UTF-16 of ASCII is ASCII with noughts
        }
      }
    } catch (const Malformed&) {
      found.clear();
    }
  }
  if (found.empty()) found = otherwise;
  std::erase_if(found, [](char c) {
    return c <= ' ' || c > '~' || std::string_view("[](){}<>/%").find(c) != std::string_view::npos;
  });
  constexpr std::size_t longest = 63;
  return found.empty() ? "Converted" : found.substr(0, longest);
}

}  // namespace glyphs::sfnt
