#include "glyphs/sfnt_check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <optional>
#include <set>
#include <string_view>

#include "glyphs/jobs.h"
#include "glyphs/sfnt_cff.h"

namespace glyphs::sfnt {

namespace {

using fontcore::text;

void require(bool holds, const std::string& else_why) {
  if (!holds) throw Malformed(else_why);
}
void require(bool holds, const char* else_why) {
  if (!holds) throw Malformed(else_why);
}

std::uint32_t u24(View bytes, std::uint64_t at) { return std::uint32_t{u8(bytes, at)} << 16 | u16(bytes, at + 1); }

// ---- small tables; the driver adds the table's name

void check_head(View table) {
  require(u16(table, 0) == 1, text("version ", u16(table, 0)));
  const Box box{i16(table, 36), i16(table, 38), i16(table, 40), i16(table, 42)};
  require(box.x_min <= box.x_max && box.y_min <= box.y_max,
          text("its box from (", box.x_min, ", ", box.y_min, ") to (", box.x_max, ", ", box.y_max, ") is inside out"));
  require(i16(table, 50) == 0 || i16(table, 50) == 1, text("indexToLocFormat ", i16(table, 50)));
  require(i16(table, 52) == 0, text("glyphDataFormat ", i16(table, 52)));
}

void check_maxp(View table) {
  const int version = u16(table, 0);
  require(version <= 1, text("version ", version));
  if (version == 0) return;
  slice(table, 0, 32);
  constexpr int most_zones = 3;
  require(u16(table, 14) <= most_zones, text("maxZones ", u16(table, 14)));
}

/// hhea and vhea, and beside them hmtx and vmtx.
void check_metrics_header(View table, int glyph_count) {
  slice(table, 0, 36);
  require(i16(table, 32) == 0, text("metricDataFormat ", i16(table, 32)));
  require(u16(table, 34) <= glyph_count, text(u16(table, 34), " metrics for ", glyph_count, " glyphs"));
}

void check_hhea(View table, int glyph_count) {
  require(u16(table, 0) == 1, text("version ", u16(table, 0)));
  check_metrics_header(table, glyph_count);
}

void check_vhea(View table, int glyph_count) {
  const std::uint32_t version = u32(table, 0);
  require(version == 0x00010000 || version == 0x00011000, text("version ", version >> 16, ".", version & 0xFFFF));
  check_metrics_header(table, glyph_count);
}

void check_os2(View table) {
  const int version = u16(table, 0);
  require(version <= 5, text("version ", version));
  slice(table, 0, 78);
  constexpr std::uint64_t with_heights = 96;
  if (version == 5 && table.size() >= with_heights) slice(table, with_heights, 4);
}

/// Whether sanitizers know the encoding; of other records they keep nothing.
bool is_known_encoding(int platform, int encoding) {
  constexpr std::array last{6, 32, 2, 6, 255};
  return platform < std::ssize(last) &&
         (encoding <= last[static_cast<std::size_t>(platform)] || (platform == 3 && encoding == 10));
}

void check_names(View table) {
  const int format = u16(table, 0);
  require(format <= 1, text("format ", format));
  const std::uint64_t strings = u16(table, 4);
  require(strings <= table.size(), text("strings at ", strings, " of ", table.size(), " bytes"));
  const std::uint64_t count = u16(table, 2);
  std::uint64_t end = 6 + 12 * count;
  slice(table, 0, end);
  constexpr std::uint64_t room =
      0xFFFF - 192;  // sanitizers write a string again for every record, and four of their own
  std::uint64_t written = 0;
  for (std::uint64_t at = 6; at < end; at += 12) {
    const std::uint64_t length = u16(table, at + 8);
    const bool is_kept = is_known_encoding(u16(table, at), u16(table, at + 2));
    if (is_kept && strings + u16(table, at + 10) + length <= table.size()) written += length;
  }
  require(written <= room, text("names of ", written, " bytes"));
  if (format == 1) {
    const std::uint64_t languages = u16(table, end);
    for (std::uint64_t i = 0; i < languages; ++i) {
      const std::uint64_t at = end + 2 + 4 * i;
      slice(table, strings + u16(table, at + 2), u16(table, at));
      constexpr int longest_language = 200;
      require(u16(table, at) <= longest_language, text("a language tag of ", u16(table, at), " bytes"));
    }
    end += 2 + 4 * languages;
  }
  require(end <= strings, text("strings at ", strings, ", inside the ", count, " records"));
}

void check_post(View table, int glyph_count) {
  const std::uint32_t version = u32(table, 0);
  require(version == 0x00010000 || version == 0x00020000 || version == 0x00030000,
          text("version ", version >> 16, ".", version & 0xFFFF));
  slice(table, 0, 32);
  if (version != 0x00020000) return;
  const int count = u16(table, 32);
  constexpr unsigned standard = 258;  // names of the Macintosh
  if (count == 0 && glyph_count <= static_cast<int>(standard)) return;
  require(count == glyph_count, text("names of ", count, " glyphs for ", glyph_count));
  std::uint64_t at = 34 + 2 * static_cast<std::uint64_t>(count);
  slice(table, 0, at);
  unsigned names = 0;
  for (; at < table.size(); ++names) {
    const View name = slice(table, at + 1, u8(table, at));
    require(std::ranges::find(name, 0) == name.end(), text("name ", names, " has a nought in it"));
    at += 1 + name.size();
  }
  for (int i = 0; i < count; ++i) {
    const unsigned name = u16(table, 34 + 2 * static_cast<std::uint64_t>(i));
    require(name < standard + names, text("glyph ", i, " has name ", name, " of ", standard + names));
  }
}

/// What sanitizers hold against a `kern` that they would else drop.
void check_kern(View table) {
  slice(table, 0, 4);
  if (u16(table, 0) != 0) return;
  std::uint64_t at = 4;
  for (int i = 0; i < u16(table, 2); ++i) {
    const int version = u16(table, at);
    const std::uint64_t length = u16(table, at + 2);
    at += 4;
    if (version != 0) continue;
    slice(table, at - 4, length);
    const int coverage = u16(table, at);
    at += 2;
    if (!(coverage & 1)) continue;
    if (coverage & 0xF0) return;
    if (coverage >> 8 != 0) continue;
    slice(table, at, 8);
    const unsigned pairs = u16(table, at);
    constexpr unsigned most_pairs = 10922;
    if (pairs == 0 || pairs > most_pairs) return;
    const int selector = static_cast<int>(std::bit_width(pairs)) - 1;
    require(u16(table, at + 4) == selector,
            text("subtable ", i, ": entrySelector ", u16(table, at + 4), " for ", pairs, " pairs"));
    at += 8;
    std::optional<std::uint32_t> last;
    for (unsigned k = 0; k < pairs; ++k, at += 6) {
      slice(table, at, 6);
      const std::uint32_t pair = u32(table, at);
      if (last && pair <= *last) return;
      last = pair;
    }
  }
}

void check_gasp(View table) {
  const int count = u16(table, 2);
  if (u16(table, 0) > 1) return;
  int last = -1;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t at = 4 + 4 * static_cast<std::uint64_t>(i);
    slice(table, at, 4);
    if (u16(table, at) <= last) return;
    last = u16(table, at);
  }
}

void check_vorg(View table) {
  slice(table, 0, 8);
  if (u32(table, 0) != 0x00010000) return;
  int last = -1;
  for (std::uint64_t i = 0; i < u16(table, 6); ++i) {
    slice(table, 8 + 4 * i, 4);
    if (u16(table, 8 + 4 * i) <= last) return;
    last = u16(table, 8 + 4 * i);
  }
}

void check_ltsh(View table, int glyph_count) {
  slice(table, 0, 4);
  if (u16(table, 0) == 0 && u16(table, 2) == glyph_count) slice(table, 4, static_cast<std::uint64_t>(glyph_count));
}

void check_program(View table) {
  constexpr std::uint64_t end = 128 * 1024;
  require(table.size() < end, text(table.size(), " bytes, ", end, " or more"));
}

void check_cvt(View table) {
  check_program(table);
  require(table.size() % 2 == 0, text(table.size(), " bytes, an odd number"));
}

// ---- cmap

constexpr std::uint32_t most_groups = 0xFFFF;
constexpr std::uint32_t last_character = 0x10FFFF;

void check_format_4(View map, int glyph_count) {
  require(u16(map, 4) == 0, text("language ", u16(map, 4)));
  const unsigned doubled = u16(map, 6);
  const unsigned count = doubled / 2;
  require(doubled % 2 == 0 && count > 0, text("segCountX2 ", doubled));
  const unsigned power = std::bit_floor(count);
  require(u16(map, 8) == ((2 * power) & 0xFFFF), text("searchRange ", u16(map, 8), " for ", count, " segments"));
  require(u16(map, 10) + 1 == static_cast<int>(std::bit_width(power)),
          text("entrySelector ", u16(map, 10), " for ", count, " segments"));
  require(u16(map, 12) == ((doubled - 2 * power) & 0xFFFF), text("rangeShift ", u16(map, 12)));
  require(u16(map, 14 + doubled) == 0, text("reservedPad ", u16(map, 14 + doubled)));
  slice(map, 0, 16 + std::uint64_t{4} * doubled);
  struct Segment {
    unsigned start = 0;
    unsigned end = 0;
    unsigned delta = 0;
    unsigned offset = 0;
  };
  std::vector<Segment> segments;
  for (unsigned i = 0; i < count; ++i) {
    const std::uint64_t at = 14 + 2 * i;
    segments.push_back(
        {u16(map, at + 2 + doubled), u16(map, at), u16(map, at + 2 + 2 * doubled), u16(map, at + 2 + 3 * doubled)});
    Segment& segment = segments.back();
    if (segment.offset % 2 == 0) continue;
    require(i + 1 == count, text("segment ", i, ": idRangeOffset ", segment.offset));
    segment.offset = 0;  // the closing segment often has 0xFFFF
  }
  const auto closes = [](const Segment& segment) { return segment.start == 0xFFFF && segment.end == 0xFFFF; };
  for (unsigned i = 1; i < count; ++i) {
    const Segment& before = segments[i - 1];
    const Segment& segment = segments[i];
    if (i + 1 == count && closes(before) && closes(segment)) continue;
    require(segment.end > before.end && segment.start > before.end,
            text("segment ", i, " from ", segment.start, " to ", segment.end, " behind one to ", before.end));
  }
  require(closes(segments.back()),
          text("its last segment is from ", segments.back().start, " to ", segments.back().end));
  for (unsigned i = 0; i < count; ++i) {
    const Segment& segment = segments[i];
    for (unsigned code = segment.start; code <= segment.end; ++code) {
      unsigned glyph = (code + segment.delta) & 0xFFFF;
      if (segment.offset != 0) {
        const std::uint64_t at = 16 + 3 * doubled + 2 * i + segment.offset + 2 * (code - segment.start);
        glyph = u16(map, at);
      }
      require(static_cast<int>(glyph) < glyph_count,
              text("character ", code, " is glyph ", glyph, " of ", glyph_count));
    }
  }
}

/// Formats 12 and 13: groups of characters for glyphs in a row, or for one glyph.
void check_groups(View map, int glyph_count, bool is_one_glyph) {
  require(u32(map, 8) == 0, text("language ", u32(map, 8)));
  const std::uint32_t count = u32(map, 12);
  require(count > 0 && count <= most_groups, text(count, " groups"));
  std::optional<std::uint32_t> last;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t at = 16 + std::uint64_t{12} * i;
    const std::uint32_t first = u32(map, at);
    const std::uint32_t end = u32(map, at + 4);
    const std::uint64_t glyph = u32(map, at + 8);
    const auto group = [&] { return text("group ", i, ", characters ", first, " to ", end); };
    require(first <= last_character && end <= last_character, group());
    require(glyph <= 0xFFFF, text(group(), ": glyph ", glyph));
    if (is_one_glyph) {
      require(glyph < static_cast<std::uint64_t>(glyph_count), text(group(), ": glyph ", glyph, " of ", glyph_count));
    } else {
      require(end < 0xD800 || first > 0xDFFF, text(group(), ": surrogates"));
      require(first <= end, group());
      require(end - first + glyph <= static_cast<std::uint64_t>(glyph_count),
              text(group(), ": from glyph ", glyph, " on, of ", glyph_count));
    }
    require(!last || first > *last, text(group(), ", behind one to ", last.value_or(0)));
    last = std::max(end, first);
  }
}

/// Variation selectors.
void check_format_14(View map) {
  const std::uint32_t count = u32(map, 6);
  constexpr std::uint32_t most_selectors = 259;
  require(count > 0 && count <= most_selectors, text(count, " variation selectors"));
  std::uint32_t last_selector = 0;
  std::uint64_t end = 10 + std::uint64_t{11} * count;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t at = 10 + std::uint64_t{11} * i;
    const std::uint32_t selector = u24(map, at);
    const std::uint64_t common = u32(map, at + 3);
    const std::uint64_t special = u32(map, at + 7);
    require((selector >= 0x180B && selector <= 0x180D) || (selector >= 0xFE00 && selector <= 0xFE0F) ||
                (selector >= 0xE0100 && selector <= 0xE01EF),
            text(selector, " is no variation selector"));
    require(selector > last_selector, text("variation selector ", selector, " behind ", last_selector));
    last_selector = selector;
    require(common != 0 || special != 0, text("variation selector ", selector, " has no characters"));
    const auto list = [&](std::uint64_t from, std::uint64_t size) {
      const std::uint32_t entries = u32(map, from);
      require(entries > 0 && entries <= most_groups, text("variation selector ", selector, ": ", entries, " entries"));
      std::uint32_t last = 0;
      for (std::uint32_t k = 0; k < entries; ++k) {
        const std::uint64_t entry = from + 4 + size * k;
        const std::uint32_t character = u24(map, entry);
        require(character > last && character <= last_character,
                text("variation selector ", selector, ": character ", character, " behind ", last));
        constexpr std::uint64_t range = 4;
        last = character + (size == range ? u8(map, entry + 3) : 0);
        require(size == range || u16(map, entry + 3) != 0,
                text("variation selector ", selector, ": character ", character, " has no glyph"));
      }
      end = from + 4 + size * entries;
    };
    if (common != 0) list(common, 4);
    if (special != 0) list(special, 5);
  }
  require(end == map.size(), text("ends at ", end, " of ", map.size(), " bytes"));
}

void check_cmap(View table, int glyph_count) {
  require(u16(table, 0) == 0, text("version ", u16(table, 0)));
  const std::uint64_t count = u16(table, 2);
  require(count > 0, "no subtables");
  const std::uint64_t end = 4 + 8 * count;
  slice(table, 0, end);
  std::set<std::pair<std::uint64_t, std::uint64_t>> spans;
  bool is_usable = false;
  std::vector<std::function<void()>> checks;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t at = 4 + 8 * i;
    const int platform = u16(table, at);
    const int encoding = u16(table, at + 2);
    const std::uint64_t offset = u32(table, at + 4);
    const auto which = [=](const std::string& why) {
      return text("subtable ", i, " (", platform, ", ", encoding, "): ", why);
    };
    require(offset >= end && offset < table.size(), which(text("it lies at ", offset, " of ", table.size(), " bytes")));
    const int format = u16(table, offset);
    std::uint64_t length = 0;
    if (format == 0 || format == 4) {
      length = u16(table, offset + 2);
      slice(table, offset, 6);
    } else if (format == 12 || format == 13) {
      length = u32(table, offset + 4);
      slice(table, offset, 12);
    } else if (format == 14) {
      length = u32(table, offset + 2);
    }
    require(offset + length <= table.size(),
            which(text("it ends at ", offset + length, " of ", table.size(), " bytes")));
    spans.emplace(offset, offset + length);
    const bool is_unicode = platform == 0;
    const bool is_windows = platform == 3;
    std::function<void(View)> check;
    if (format == 4 && ((is_unicode && (encoding == 0 || encoding == 1 || encoding == 3)) ||
                        (is_windows && (encoding == 0 || encoding == 1)))) {
      is_usable = true;
      check = [=](View map) { check_format_4(map, glyph_count); };
    } else if (format == 12 && ((is_unicode && encoding == 3) || (is_windows && encoding == 10))) {
      is_usable = true;
      check = [=](View map) { check_groups(map, glyph_count, false); };
    } else if (format == 13 && is_windows && encoding == 10) {
      is_usable = true;
      check = [=](View map) { check_groups(map, glyph_count, true); };
    } else if (format == 14 && is_unicode && encoding == 5) {
      check = check_format_14;
    } else if (format == 0 && platform == 1 && encoding == 0) {
      check = [](View map) { slice(map, 0, 262); };
    } else {
      continue;
    }
    checks.push_back([=] {
      try {
        check(slice(table, offset, length));
      } catch (const Malformed& error) {
        throw Malformed(which(error.what()));
      }
    });
  }
  std::uint64_t last = 0;
  for (const auto& [begin, stop] : spans) {
    require(begin >= last, text("a subtable begins at ", begin, ", before the end of another at ", last));
    last = std::max(last, stop);
  }
  for (const auto& check : checks) check();
  require(is_usable, "no subtable of Unicode or symbols");
}

// ---- glyf

void check_flags(View glyph, std::uint64_t at, unsigned points) {
  enum : unsigned { short_x = 2, short_y = 4, repeat = 8, same_x = 16, same_y = 32, overlap = 64, reserved = 128 };
  std::uint64_t coordinates = 0;
  for (unsigned i = 0; i < points; ++i) {
    const unsigned flag = u8(glyph, at++);
    require(!(flag & reserved), text("the flag of point ", i, " has its reserved bit set"));
    require(!(flag & overlap) || i == 0, text("the flag of point ", i, " says that contours overlap, not the first"));
    const unsigned bytes = (flag & short_x  ? 1u
                            : flag & same_x ? 0u
                                            : 2u) +
                           (flag & short_y  ? 1u
                            : flag & same_y ? 0u
                                            : 2u);
    unsigned times = 1;
    if (flag & repeat) {
      const unsigned more = u8(glyph, at++);
      require(more > 0 && i + more < points,
              text("the flag of point ", i, " of ", points, " is repeated ", more, " times"));
      times += more;
    }
    coordinates += std::uint64_t{bytes} * times;
    i += times - 1;
  }
  slice(glyph, at, coordinates);
}

void check_simple(View glyph, int contours) {
  int last = -1;
  std::uint64_t at = 10;
  for (int c = 0; c < contours; ++c, at += 2) {
    const int end = u16(glyph, at);
    require(end != 0xFFFF && end > last, text("contour ", c, " ends at point ", end, ", that before at ", last));
    last = end;
  }
  const std::uint64_t instructions = u16(glyph, at);
  slice(glyph, at + 2, instructions);
  check_flags(glyph, at + 2 + instructions, static_cast<unsigned>(last + 1));
}

std::vector<int> check_composite(View glyph, int glyph_count) {
  enum : unsigned { more = 0x20, instructions = 0x100 };
  std::vector<int> parts;
  std::uint64_t at = 10;
  unsigned flags = more;
  while (flags & more) {
    flags = u16(glyph, at);
    const int part = u16(glyph, at + 2);
    require(part < glyph_count, text("is put together from glyph ", part, " of ", glyph_count));
    slice(glyph, at, component_length(flags));
    at += component_length(flags);
    parts.push_back(part);
  }
  if (flags & instructions) slice(glyph, at + 2, u16(glyph, at));
  return parts;
}

/// TrueType glyphs one by one, then composites from their parts up.
class GlyphChecker {
 public:
  GlyphChecker(const GlyphData& data, int glyph_count, std::map<int, std::string>& faults)
      : data_(data), glyph_count_(glyph_count), faults_(faults) {}

  void check() {
    const auto count = static_cast<std::size_t>(glyph_count_);
    points_.resize(count);
    placed_.resize(count);
    parts_.resize(count);
    for (int id = 0; id < glyph_count_; ++id) {
      try {
        check_alone(id);
      } catch (const Malformed& error) {
        parts_[static_cast<std::size_t>(id)].clear();
        points_[static_cast<std::size_t>(id)] = 0;
        faults_.emplace(id, error.what());
      }
    }
    check_nesting();
  }

 private:
  void check_alone(int id) {
    const View glyph = data_.bytes(id);
    if (glyph.empty()) return;
    slice(glyph, 0, 10);
    const int contours = i16(glyph, 0);
    require(contours >= -1, text(contours, " contours"));
    const Box box = read_box(glyph);
    constexpr Box unset{32767, 32767, -32767, -32767};  // of some old fonts; taken as empty
    require(
        box == unset || (box.x_min <= box.x_max && box.y_min <= box.y_max),
        text("its box from (", box.x_min, ", ", box.y_min, ") to (", box.x_max, ", ", box.y_max, ") is inside out"));
    if (contours > 0) {
      check_simple(glyph, contours);
      points_[static_cast<std::size_t>(id)] = u16(glyph, 8 + 2 * static_cast<std::uint64_t>(contours)) + 1u;
    } else if (contours < 0) {
      parts_[static_cast<std::size_t>(id)] = check_composite(glyph, glyph_count_);
    }
  }

  /// Parts before what is made of them. What is left over leads to a circle or is on one; without those that nothing of
  /// it is made of, again and again, the circles are left.
  void check_nesting() {
    const auto count = static_cast<std::size_t>(glyph_count_);
    std::vector<std::vector<int>> users(count);
    std::vector<std::size_t> open(count);
    std::vector<int> ready;
    for (std::size_t id = 0; id < count; ++id) {
      open[id] = parts_[id].size();
      if (open[id] == 0) ready.push_back(static_cast<int>(id));
      for (const int part : parts_[id]) users[static_cast<std::size_t>(part)].push_back(static_cast<int>(id));
    }
    for (std::size_t k = 0; k < ready.size(); ++k) {
      add_up(ready[k]);
      for (const int user : users[static_cast<std::size_t>(ready[k])]) {
        if (--open[static_cast<std::size_t>(user)] == 0) ready.push_back(user);
      }
    }
    std::vector<std::size_t> uses(count);
    std::vector<int> outer;
    for (std::size_t id = 0; id < count; ++id) {
      if (open[id] == 0) continue;
      for (const int part : parts_[id]) ++uses[static_cast<std::size_t>(part)];
    }
    for (std::size_t id = 0; id < count; ++id) {
      if (open[id] > 0 && uses[id] == 0) outer.push_back(static_cast<int>(id));
    }
    std::vector<bool> is_outer(count);
    for (std::size_t k = 0; k < outer.size(); ++k) {
      is_outer[static_cast<std::size_t>(outer[k])] = true;
      for (const int part : parts_[static_cast<std::size_t>(outer[k])]) {
        const auto p = static_cast<std::size_t>(part);
        if (--uses[p] == 0 && open[p] > 0) outer.push_back(part);
      }
    }
    for (std::size_t id = 0; id < count; ++id) {
      if (open[id] > 0 && !is_outer[id]) faults_.emplace(static_cast<int>(id), "is part of itself");
    }
    std::for_each(outer.rbegin(), outer.rend(), [&](int id) { add_up(id); });
  }

  void add_up(int id) {
    const auto k = static_cast<std::size_t>(id);
    if (parts_[k].empty()) return;
    for (const int part : parts_[k]) {
      points_[k] += points_[static_cast<std::size_t>(part)];
      placed_[k] += placed_[static_cast<std::size_t>(part)] + 1;
    }
    constexpr std::uint64_t most = 65535;  // sanitizers count points one by one, and parts without points for ever
    if (points_[k] <= most && placed_[k] <= most) return;
    faults_.emplace(id, text("its parts are ", placed_[k], " with ", points_[k], " points, more than ", most));
    points_[k] = placed_[k] = 0;
  }

  const GlyphData& data_;
  int glyph_count_;
  std::map<int, std::string>& faults_;
  std::vector<std::uint64_t> points_;
  std::vector<std::uint64_t> placed_;
  std::vector<std::vector<int>> parts_;
};

// ---- charstrings

/// Runs through a charstring as sanitizers do: counts operands, draws nothing.
class CharstringChecker {
 public:
  CharstringChecker(const CffIndex& global, const CffIndex& local) : global_(global), local_(local) {}

  /// Throws  Malformed.
  void check(View code) { require(run(code, 0) == End::Char, "its charstring has no endchar"); }
  std::int64_t work() const { return work_; }

 private:
  enum class End { Char, Return };
  enum class Stage { HorizontalStems, VerticalStems, Masks, Drawing };
  static constexpr std::uint64_t longest = 65535;

  End run(View code, int depth) {
    constexpr int deepest = 10;
    // Not by `require`, here and below: making what it would say takes many times as long as a step.
    if (depth > deepest) throw Malformed(text("its subroutines nest deeper than ", deepest));
    if (code.size() > longest) throw Malformed(text("its charstring has ", code.size(), " bytes"));
    for (std::uint64_t at = 0; at < code.size();) {
      if (++work_ > most_charstring_work)
        throw Malformed(text("its charstring takes over ", most_charstring_work, " steps"));
      const int b = code[at++];
      constexpr int word = 28;
      if (b >= 32 || b == word) {
        push(read_number(code, b, at));
        continue;
      }
      constexpr int escape = 12;
      const int op = b == escape ? 0x0C00 | u8(code, at++) : b;
      constexpr int callsubr = 10;
      constexpr int return_op = 11;
      constexpr int endchar = 14;
      constexpr int callgsubr = 29;
      if (op == endchar) return End::Char;
      if (op == return_op) return End::Return;
      if (op == callsubr || op == callgsubr) {
        if (run(subroutine(op == callsubr ? local_ : global_), depth + 1) == End::Char) return End::Char;
        continue;
      }
      if (op > 255 ? !compute(op) : !operate(op, code, at)) {
        throw Malformed(text("its charstring has the operator ", op > 255 ? text("12 ", op & 0xFF) : text(op),
                             " after ", static_cast<int>(stack_.size()), " operands"));
      }
    }
    throw Malformed(depth == 0 ? "its charstring has no endchar" : "a subroutine of its charstring has no return");
  }

  static std::optional<int> read_number(View code, int first, std::uint64_t& at) {
    if (first == 28) {
      at += 2;
      return i16(code, at - 2);
    }
    if (first <= 246) return first - 139;
    if (first <= 250) return (first - 247) * 256 + u8(code, at++) + 108;
    if (first <= 254) return -(first - 251) * 256 - u8(code, at++) - 108;
    slice(code, at, 4);
    at += 4;
    return std::nullopt;  // of fractions, and of what is computed, only that they are there
  }

  void push(std::optional<int> value) {
    constexpr std::size_t most_operands = 48;
    if (stack_.size() >= most_operands)
      throw Malformed(text("its charstring has more than ", most_operands, " operands"));
    stack_.push_back(value);
  }

  View subroutine(const CffIndex& subroutines) {
    require(!stack_.empty() && stack_.back(), "its charstring calls a subroutine without a number");
    const int bias = subroutines.count < 1240 ? 107 : subroutines.count < 33900 ? 1131 : 32768;
    const int number = *stack_.back() + bias;
    stack_.pop_back();
    if (number < 0 || number >= subroutines.count)
      throw Malformed(text("its charstring calls subroutine ", number, " of ", subroutines.count));
    return subroutines.object(number);
  }

  /// Takes `taken` operands and leaves `left`.
  bool replace(std::size_t taken, std::size_t left) {
    if (stack_.size() < taken) return false;
    stack_.resize(stack_.size() - taken);
    for (std::size_t i = 0; i < left; ++i) push(std::nullopt);
    return true;
  }

  /// Operators of two bytes.
  bool compute(int op) {
    const std::size_t count = stack_.size();
    switch (op & 0xFF) {
      case 0:  // dotsection
        return count == 0;
      case 3:   // and
      case 4:   // or
      case 10:  // add
      case 11:  // sub
      case 12:  // div
      case 15:  // eq
      case 24:  // mul
        return replace(2, 1);
      case 5:   // not
      case 9:   // abs
      case 14:  // neg
      case 26:  // sqrt
        return replace(1, 1);
      case 18:  // drop
        return replace(1, 0);
      case 22:  // ifelse
        return replace(4, 1);
      case 27:  // dup
        return replace(1, 2);
      case 28:  // exch
        return replace(2, 2);
      case 34:  // hflex
        return clear(has_width_ && count == 7);
      case 35:  // flex
        return clear(has_width_ && count == 13);
      case 36:  // hflex1
        return clear(has_width_ && count == 9);
      case 37:  // flex1
        return clear(has_width_ && count == 11);
      default:
        return false;
    }
  }

  bool clear(bool is_good) {
    stack_.clear();
    return is_good;
  }

  bool operate(int op, View code, std::uint64_t& at) {
    const std::size_t n = stack_.size();
    const bool had_width = has_width_;
    const auto first = [&](bool is_good) {  // may find the width below its operands
      has_width_ = true;
      return is_good;
    };
    switch (op) {
      case 1:     // hstem
      case 18:    // hstemhm
      case 3:     // vstem
      case 23: {  // vstemhm
        const bool is_vertical = op == 3 || op == 23;
        if (n < 2 || stage_ > (is_vertical ? Stage::VerticalStems : Stage::HorizontalStems)) return false;
        if (is_vertical) stage_ = Stage::VerticalStems;
        return add_stems(n) && first(n % 2 == 0 || !had_width) && clear(true);
      }
      case 19:    // hintmask
      case 20: {  // cntrmask
        if (n % 2 == 1 && had_width) return false;
        if (op == 20 && stage_ > Stage::Masks) return false;
        stage_ = op == 20 ? Stage::Masks : Stage::Drawing;
        if (!add_stems(n) || stems_ == 0) return false;
        slice(code, at, (stems_ + 7) / 8);
        at += (stems_ + 7) / 8;
        return first(true) && clear(true);
      }
      case 21:  // rmoveto
        stage_ = Stage::Drawing;
        return first(n == 2 || (n == 3 && !had_width)) && clear(true);
      case 4:   // vmoveto
      case 22:  // hmoveto
        stage_ = Stage::Drawing;
        return first(n == 1 || (n == 2 && !had_width)) && clear(true);
      default:
        return has_width_ && n > 0 && is_drawn_by(op, n) && clear(true);
    }
  }

  static bool is_drawn_by(int op, std::size_t n) {
    switch (op) {
      case 5:  // rlineto
        return n % 2 == 0;
      case 6:  // hlineto
      case 7:  // vlineto
        return true;
      case 8:  // rrcurveto
        return n % 6 == 0;
      case 24:  // rcurveline
        return n >= 8 && n % 6 == 2;
      case 25:  // rlinecurve
        return n >= 8 && n % 2 == 0;
      case 26:  // vvcurveto
      case 27:  // hhcurveto
      case 30:  // vhcurveto
      case 31:  // hvcurveto
        return n >= 4 && n % 4 <= 1;
      default:
        return false;
    }
  }

  bool add_stems(std::size_t operands) {
    constexpr std::size_t most_stems = 96;
    stems_ += operands / 2;
    return stems_ <= most_stems;
  }

  const CffIndex& global_;
  const CffIndex& local_;
  std::vector<std::optional<int>> stack_;
  std::size_t stems_ = 0;
  Stage stage_ = Stage::HorizontalStems;
  bool has_width_ = false;
  std::int64_t work_ = 0;
};

// ---- CFF

/// The offsets of an INDEX must rise within it.
void check_index(const CffIndex& index, const char* what) {
  try {
    for (int i = 0; i < index.count; ++i) index.object(i);
  } catch (const Malformed& error) {
    throw Malformed(text(what, ": ", error.what()));
  }
}

/// What OTS looks at in a real number: the second nibble of every byte.
void check_real(View bytes) {
  int points = 0;
  int exponents = 0;
  for (const unsigned char byte : bytes.subspan(1)) {
    const int nibble = byte & 15;
    require(byte >> 4 != 15 || nibble == 15, "a real number that ends within a byte");
    require(nibble != 13 && nibble != 14, "a real number with a sign in its midst");
    points += nibble == 10 ? 1 : 0;
    exponents += nibble == 11 || nibble == 12 ? 1 : 0;
  }
  require(points <= 1 && exponents <= 1, "a real number with two points or exponents");
}

/// A whole CFF table but for its charstrings.
class CffChecker {
 public:
  CffChecker(View table, int glyph_count) : table_(table), glyph_count_(static_cast<unsigned>(glyph_count)) {}

  /// Throws  Malformed.
  void check() {
    require(u8(table_, 0) == 1 && u8(table_, 1) == 0, text("version ", int{table_[0]}, ".", int{table_[1]}));
    require(u8(table_, 2) == 4, text("a header of ", int{table_[2]}, " bytes"));
    require(u8(table_, 3) >= 1 && u8(table_, 3) <= 4, text("offsets of ", int{table_[3]}, " bytes"));
    const CffIndex names = open_index(table_, 4, "names");
    require(names.count == 1, text(names.count, " names"));
    check_name(names.object(0));
    const CffIndex dicts = open_index(table_, names.end, "Top DICTs");
    require(dicts.count == 1, text(dicts.count, " Top DICTs"));
    const CffIndex strings = open_index(table_, dicts.end, "strings");
    constexpr int standard_strings = 390;
    require(strings.count < 65000 - standard_strings, text(strings.count, " strings"));
    check_index(strings, "strings");
    check_index(open_index(table_, strings.end, "global subroutines"), "global subroutines");
    last_string_ = strings.count + standard_strings;
    check_dict(read_dict(dicts.object(0), "Top DICT"), Kind::Top);
    for (const unsigned dict : selected_) {
      require(dict < font_dicts_, text("FDSelect names Font DICT ", dict, " of ", font_dicts_));
    }
  }

 private:
  enum class Kind { Top, Font };

  static void check_name(View name) {
    constexpr std::size_t longest = 127;
    require(name.size() <= longest, text("a name of ", name.size(), " bytes"));
    for (std::size_t i = 0; i < name.size(); ++i) {
      const auto c = static_cast<char>(name[i]);
      const bool is_good = c > ' ' && c <= '~' && std::string_view("[](){}<>/%").find(c) == std::string_view::npos;
      require(is_good || (i == 0 && c == 0), text("a name with the character ", int{name[i]}));
    }
  }

  static std::string name_of(int op) { return op > 255 ? text("operator 12 ", op & 0xFF) : text("operator ", op); }
  static bool is_whole(const CffEntry& entry, std::size_t i) { return entry.operand_bytes.at(i)[0] != 30; }

  static void require_count(const CffEntry& entry, std::size_t count) {
    require(entry.operands.size() == count, text(name_of(entry.op), " has ", entry.operands.size(), " operands"));
  }
  /// A single whole number between two.
  static int number(const CffEntry& entry, double least, double most) {
    require_count(entry, 1);
    const double value = entry.operands[0];
    require(is_whole(entry, 0) && value >= least && value <= most, text(name_of(entry.op), " is ", value));
    return static_cast<int>(value);
  }
  std::uint64_t offset(const CffEntry& entry) const {
    return static_cast<std::uint64_t>(number(entry, 0.0, static_cast<double>(table_.size()) - 1.0));
  }
  void check_string(const CffEntry& entry, std::size_t i) const {
    const double value = entry.operands.at(i);
    require(is_whole(entry, i) && value >= 0 && value <= last_string_, text(name_of(entry.op), ": string ", value));
  }

  static void check_operands(const CffEntry& entry) {
    for (std::size_t i = 0; i < entry.operands.size(); ++i) {
      if (!is_whole(entry, i)) check_real(entry.operand_bytes[i]);
    }
  }

  void check_dict(const CffDict& dict, Kind kind) {
    std::optional<std::uint64_t> charset;
    bool has_charstrings = false;
    const bool is_cid_keyed = !dict.empty() && dict[0].op == 0x0C1E;
    for (const CffEntry& entry : dict) {
      check_operands(entry);
      const auto require_top = [&] { require(kind == Kind::Top, text(name_of(entry.op), " in a Font DICT")); };
      switch (entry.op) {
        case 0:
        case 1:
        case 2:
        case 3:
        case 4:
        case 0x0C00:
        case 0x0C15:
        case 0x0C16:
        case 0x0C26:
          require_count(entry, 1);
          check_string(entry, 0);
          break;
        case 5:
        case 14:
        case 0x0C07:
        case 0x0C17:
          require(!entry.operands.empty(), text(name_of(entry.op), " has no operands"));
          break;
        case 13:
        case 0x0C02:
        case 0x0C03:
        case 0x0C04:
        case 0x0C05:
        case 0x0C08:
        case 0x0C14:
          require_count(entry, 1);
          break;
        case 0x0C1F:  // of CID-keyed fonts
        case 0x0C20:
        case 0x0C21:
        case 0x0C22:
        case 0x0C23:
          require_count(entry, 1);
          require(is_cid_keyed, text(name_of(entry.op), " without ROS before it"));
          break;
        case 0x0C06:  // CharstringType
          number(entry, 2, 2);
          break;
        case 0x0C01:  // isFixedPitch
          number(entry, 0, 1);
          break;
        case 15:  // charset
          if (const std::uint64_t at = offset(entry); at > 2) {
            require(!charset, "two charsets");
            charset = at;
          }
          break;
        case 16:  // Encoding
          if (const std::uint64_t at = offset(entry); at > 1) {
            require(!(u8(table_, at) & 0x80), text("an Encoding of format ", int{u8(table_, at)}));
          }
          break;
        case 17: {  // CharStrings
          require_top();
          require(!has_charstrings, "two lists of charstrings");
          has_charstrings = true;
          const unsigned count = static_cast<unsigned>(open_index(table_, offset(entry), "charstrings").count);
          require(count == glyph_count_, text(count, " charstrings for ", glyph_count_, " glyphs"));
          require(count >= 2, text(count, " charstrings"));
          break;
        }
        case 18:  // Private
          require_count(entry, 2);
          require(is_whole(entry, 0) && is_whole(entry, 1), "a Private DICT at a fraction");
          check_private(entry.operands[1], entry.operands[0]);
          break;
        case 0x0C24: {  // FDArray
          require_top();
          require(font_dicts_ == 0, "two FDArrays");
          const CffIndex index = open_index(table_, offset(entry), "Font DICTs");
          for (int i = 0; i < index.count; ++i) check_dict(read_dict(index.object(i), "Font DICT"), Kind::Font);
          font_dicts_ = static_cast<unsigned>(index.count);
          break;
        }
        case 0x0C25:  // FDSelect
          require_top();
          check_selection(offset(entry));
          break;
        case 0x0C1E:  // ROS
          require(&entry == dict.data(), "ROS is not the first operator");
          require_count(entry, 3);
          check_string(entry, 0);
          check_string(entry, 1);
          break;
        default:
          throw Malformed(text("a DICT with ", name_of(entry.op)));
      }
    }
    if (charset) check_charset(*charset, is_cid_keyed);
  }

  void check_private(double begin, double length) const {
    const auto size = static_cast<double>(table_.size());
    require(begin >= 0 && length >= 0 && length < size && begin + length <= size,
            text("a Private DICT of ", length, " bytes at ", begin, " of ", table_.size()));
    const auto at = static_cast<std::uint64_t>(begin);
    for (const CffEntry& entry : read_dict(slice(table_, at, static_cast<std::uint64_t>(length)), "Private DICT")) {
      check_operands(entry);
      switch (entry.op) {
        case 6:  // pairs of heights
        case 7:
        case 8:
        case 9:
          require(entry.operands.size() % 2 == 0, text(name_of(entry.op), " has ", entry.operands.size(), " operands"));
          break;
        case 0x0C0C:
        case 0x0C0D:
          require(!entry.operands.empty(), text(name_of(entry.op), " has no operands"));
          break;
        case 10:
        case 11:
        case 20:
        case 21:
        case 0x0C09:
        case 0x0C0A:
        case 0x0C0B:
        case 0x0C11:
        case 0x0C12:
        case 0x0C13:
          require_count(entry, 1);
          break;
        case 19:  // Subrs
          check_index(open_index(table_, at + offset(entry), "subroutines"), "subroutines");
          break;
        case 0x0C0E:  // ForceBold
          number(entry, 0, 1);
          break;
        default:
          throw Malformed(text("a Private DICT with ", name_of(entry.op)));
      }
    }
  }

  void check_selection(std::uint64_t at) {
    const int format = u8(table_, at);
    if (format == 0) {
      for (const unsigned char dict : slice(table_, at + 1, glyph_count_)) selected_.insert(dict);
      return;
    }
    require(format == 3, text("FDSelect of format ", format));
    const unsigned ranges = u16(table_, at + 1);
    require(ranges > 0, "FDSelect without ranges");
    unsigned last = 0;
    for (unsigned i = 0; i <= ranges; ++i) {
      const unsigned first = u16(table_, at + 3 + std::uint64_t{3} * i);
      const bool is_end = i == ranges;
      require(i == 0 ? first == 0 : first > last && (first < glyph_count_ || (is_end && first == glyph_count_)),
              text("FDSelect: range ", i, " begins at glyph ", first));
      last = first;
      if (!is_end) selected_.insert(u8(table_, at + 5 + std::uint64_t{3} * i));
    }
  }

  void check_charset(std::uint64_t at, bool is_cid_keyed) const {
    const int format = u8(table_, at++);
    require(format <= 2, text("a charset of format ", format));
    for (unsigned glyph = 1; glyph < glyph_count_;) {
      const int string = u16(table_, at);
      require(is_cid_keyed || string <= last_string_, text("glyph ", glyph, " is named by string ", string));
      at += 2;
      glyph += 1;
      if (format == 1) glyph += u8(table_, at++);
      if (format == 2) {
        glyph += u16(table_, at);
        at += 2;
      }
    }
  }

  View table_;
  unsigned glyph_count_;
  int last_string_ = 0;
  unsigned font_dicts_ = 0;
  std::set<unsigned> selected_;
};

void check_charstrings(const CffTable& table, std::map<int, std::string>& faults) {
  std::vector<std::string> found(static_cast<std::size_t>(table.glyph_count()));
  const int within = run_jobs_within(most_font_work, table.glyph_count(), {}, [&](int id) {
    std::optional<CharstringChecker> checker;
    try {
      checker.emplace(table.global_subroutines(), table.font_dict(id).local_subroutines);
      checker->check(table.charstrings().object(id));
    } catch (const Malformed& error) {
      found[static_cast<std::size_t>(id)] = error.what();
    }
    return checker ? checker->work() : 0;
  });
  for (int id = 0; id < table.glyph_count(); ++id) {
    std::string& fault = found[static_cast<std::size_t>(id)];
    if (id >= within) fault = "charstrings before it take too much work";
    if (!fault.empty()) faults.emplace(id, std::move(fault));
  }
}

}  // namespace

Faults find_faults(const Directory& directory) {
  Faults faults;
  const Basics basics = read_basics(directory);
  const int count = basics.glyph_count;
  for (const TableRecord& table : directory.tables) {
    if (table.bytes.empty()) faults.tables.push_back(text("table ", tag_name(table.tag), " has no bytes"));
  }
  for (const Tag name : {tag("OS/2"), tag("cmap"), tag("name"), tag("post")}) {
    if (!directory.has(name)) faults.tables.push_back(text("table ", tag_name(name), " is missing"));
  }
  const bool has_bitmaps = directory.has(tag("CBDT")) && directory.has(tag("CBLC"));
  if (!directory.has(tag("glyf")) && !directory.has(tag("CFF ")) && !has_bitmaps) {
    faults.tables.emplace_back("it has no outlines");
  }
  const auto look = [&](Tag name, const auto& check) {
    const TableRecord* table = directory.find(name);
    if (!table || table->bytes.empty()) return;
    try {
      check(table->bytes);
    } catch (const Malformed& error) {
      const std::string prefix = text("table ", tag_name(name), ": ");
      const std::string why = error.what();
      faults.tables.push_back(why.starts_with(prefix) ? why : prefix + why);
    }
  };
  const auto has_bytes = [](std::uint64_t bytes) { return [bytes](View table) { slice(table, 0, bytes); }; };
  look(tag("maxp"), check_maxp);
  look(tag("head"), check_head);
  look(tag("OS/2"), check_os2);
  look(tag("cmap"), [&](View table) { check_cmap(table, count); });
  look(tag("hhea"), [&](View table) { check_hhea(table, count); });
  look(tag("name"), check_names);
  look(tag("post"), [&](View table) { check_post(table, count); });
  look(tag("cvt "), check_cvt);
  look(tag("fpgm"), check_program);
  look(tag("prep"), check_program);
  look(tag("gasp"), check_gasp);
  look(tag("kern"), check_kern);
  look(tag("LTSH"), [&](View table) { check_ltsh(table, count); });
  look(tag("VORG"), check_vorg);
  look(tag("vhea"), [&](View table) { check_vhea(table, count); });
  look(tag("vmtx"), [&](View table) {
    const std::uint64_t metrics = u16(directory.require(tag("vhea"), 36), 34);
    require(metrics > 0, "no metrics");
    slice(table, 0, 2 * metrics + 2 * static_cast<std::uint64_t>(count));
  });
  std::ranges::copy(layout_faults(directory, count), std::back_inserter(faults.tables));
  look(tag("MATH"), has_bytes(10));
  if (directory.has(tag("glyf"))) GlyphChecker(basics.outlines, count, faults.glyphs).check();
  look(tag("CFF "), [&](View table) {
    CffChecker(table, count).check();
    check_charstrings(CffTable(table, basics.units_per_em), faults.glyphs);
  });
  return faults;
}

bool is_well_laid_out(const Directory& directory, View file) {
  std::set<const unsigned char*> places;
  return std::ranges::all_of(directory.tables, [&](const TableRecord& table) {
    return (table.bytes.data() - file.data()) % 4 == 0 && places.insert(table.bytes.data()).second;
  });
}

}  // namespace glyphs::sfnt
