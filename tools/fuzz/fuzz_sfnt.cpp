// Bytes -> load_font, a variable font also at a place -> every outline composed -> one glyph moved -> write_sfnt ->
// read again.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

#include "fontcore/measure.h"
#include "glyphs/font_file.h"
#include "glyphs/sfnt_writer.h"
#include "tools/fuzz/documented.h"

namespace {

constexpr std::ptrdiff_t most_points = 200'000;  // composed of one font: what is linear need not be shown to be slow
const std::string name = "fuzzed.ttf";

void measure_all(const glyphs::Font& font) {
  std::ptrdiff_t points = 0;
  for (const glyphs::Glyph& glyph : font.glyphs) {
    if (!glyph.trouble.empty() && !(glyph.contours.empty() && glyph.components.empty())) broken("trouble, no outline");
    if (glyph.trouble.find('\n') != std::string::npos) broken("trouble in one line: " + glyph.trouble);
    try {
      for (const fontcore::BezierContour& contour : compose(font, glyph.id)) {
        points += contour.point_count();
        if (!std::isfinite(signed_area(contour))) broken("areas are finite: " + glyph.name);
      }
    } catch (const glyphs::FontReadError&) {
      if (glyph.trouble.empty()) broken("what cannot be composed is in trouble: " + glyph.name);
    }
    if (points > most_points) break;
  }
}

/// Moves the first glyph, from `start` on, that has contours; empty if there is none.
glyphs::EditedGlyphs moved(const glyphs::Font& font, std::size_t start) {
  const std::size_t count = font.glyphs.size();
  for (std::size_t k = 0; k < count; ++k) {
    const glyphs::Glyph& glyph = font.glyphs[(start + k) % count];
    if (glyph.contours.empty()) continue;
    std::vector<fontcore::BezierContour> contours = glyph.contours;
    for (auto& contour : contours) contour = transform(contour, {.shift = fontcore::Point(3, -2)});
    return {{glyph.id, std::move(contours)}};
  }
  return {};
}

void round_trip(const glyphs::Font& font, const glyphs::EditedGlyphs& edited) {
  const glyphs::Bytes written = write_sfnt(font, edited).data;
  if (edited.empty() && written != *font.data) broken("nothing edited, nothing changed");
  try {
    const glyphs::Font read = glyphs::load_font_bytes(name, written, {.face = edited.empty() ? font.face_index : 0});
    for (const auto& [id, contours] : edited) {
      const auto area = fontcore::signed_area(read.glyphs.at(static_cast<std::size_t>(id)).contours);
      if (std::abs(area - fontcore::signed_area(contours)) > 1e-6 * (1.0 + std::abs(area))) broken("the area written");
    }
  } catch (const glyphs::FontReadError& error) {
    broken(std::string("the result reads back: ") + error.what());
  }
}

void edit(const glyphs::Font& font, std::size_t start) {
  measure_all(font);
  round_trip(font, {});
  round_trip(font, moved(font, start));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const glyphs::Bytes bytes(data, data + size);
  const std::size_t middle = size == 0 ? 0 : data[size / 2];
  documented(name, [&] { edit(glyphs::load_font_bytes(name, bytes), middle); });
  // 650 lies off the default on the weight axis of the seeds, which mutations leave alone often enough.
  return documented(name, [&] { edit(glyphs::load_font_bytes(name, bytes, {.location = {{"wght", 650.0}}}), middle); });
}

// ---- mutations within one table

namespace {

struct Table {
  std::uint32_t offset;
  std::uint32_t length;
};

std::uint32_t u32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24 | std::uint32_t{bytes[at + 1]} << 16 | std::uint32_t{bytes[at + 2]} << 8 |
         bytes[at + 3];
}
void put_u32(std::span<std::uint8_t> bytes, std::size_t at, std::size_t value) {
  for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i) & 0xFF);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

/// Half of the mutations stay within one table, whose new length the directory then tells; all that lies behind it is
/// moved along. Otherwise most inputs would end at the directory.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  const std::size_t count = size < 12 ? 0 : std::size_t{data[4]} << 8 | data[5];
  if (seed % 2 == 0 || count == 0 || 12 + 16 * count > size) return LLVMFuzzerMutate(data, size, most);
  const std::size_t record = 12 + 16 * (seed / 2 % count);
  const std::size_t offset = u32({data, size}, record + 8);
  const std::size_t length = u32({data, size}, record + 12);
  if (offset > size || length > size - offset || offset < 12 + 16 * count) return LLVMFuzzerMutate(data, size, most);

  const std::size_t room = std::min(length + 64, length + (most - size));
  std::vector<std::uint8_t> table(data + offset, data + offset + length);
  table.resize(std::max<std::size_t>(room, 1));
  std::size_t now = room == 0 ? 0 : LLVMFuzzerMutate(table.data(), length, room);
  const std::size_t slot = (length + 3) / 4 * 4;  // what lies behind keeps to multiples of four
  const std::size_t new_slot = (now + 3) / 4 * 4;
  const std::size_t behind = std::min(size, offset + slot);
  if (new_slot > slot && size + new_slot - slot > most) now = std::min(now, length);
  const std::size_t moved_to = offset + (now + 3) / 4 * 4;
  std::memmove(data + moved_to, data + behind, size - behind);
  std::memcpy(data + offset, table.data(), now);
  std::memset(data + offset + now, 0, moved_to - offset - now);
  const std::size_t new_size = moved_to + size - behind;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = 12 + 16 * i;
    const std::size_t its = u32({data, new_size}, at + 8);
    if (its >= behind && i != (record - 12) / 16) put_u32({data, new_size}, at + 8, its + moved_to - behind);
  }
  put_u32({data, new_size}, record + 12, now);
  return new_size;
}
