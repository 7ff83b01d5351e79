#include "glyphs/sfnt_tables.h"

#include <bit>
#include <cstdlib>
#include <functional>
#include <string_view>

namespace glyphs::sfnt {

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
