#include "glyphs/woff.h"

#include <woff2/encode.h>
#include <zlib.h>

#include <functional>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/sfnt_writer.h"
#include "tests/catch.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace {

using glyphs::Bytes;
using glyphs::Container;
using glyphs::Font;
using glyphs::FontReadError;
using glyphs::load_font_bytes;
using sfnt_bytes::font_of;
using sfnt_bytes::get;
using sfnt_bytes::put;
using sfnt_bytes::put16;
using sfnt_bytes::simple_glyph;
using sfnt_bytes::small_font;
using sfnt_bytes::tables_of;

const Bytes triangle = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}}, 0x40);
const Bytes square = simple_glyph({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}});

Bytes deflated(const Bytes& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  Bytes packed(size);
  REQUIRE(compress2(packed.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), 9) == Z_OK);
  packed.resize(size);
  return packed;
}

/// A WOFF file of a single font, its tables in the order of the file. `lie` may alter the directory's records: tag,
/// offset, packed length, length.
Bytes woff_of(const Bytes& font, const std::function<void(std::vector<std::array<std::uint32_t, 5>>&)>& lie = {}) {
  const std::size_t count = get(font, 4, 2);
  std::vector<std::array<std::uint32_t, 5>> records;
  for (std::size_t at = 12; at < 12 + 16 * count; at += 16) {
    records.push_back({get(font, at, 4), get(font, at + 8, 4), 0, get(font, at + 12, 4), get(font, at + 4, 4)});
  }
  std::vector<std::size_t> order(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return records[a][1] < records[b][1]; });
  Bytes body;
  for (const std::size_t i : order) {
    auto& record = records[i];
    const auto from = font.begin() + record[1];
    const Bytes table(from, from + record[3]);
    Bytes packed = deflated(table);
    if (packed.size() >= table.size()) packed = table;
    record[1] = static_cast<std::uint32_t>(44 + 20 * count + body.size());
    record[2] = static_cast<std::uint32_t>(packed.size());
    body.insert(body.end(), packed.begin(), packed.end());
    body.resize((body.size() + 3) / 4 * 4);
  }
  std::uint32_t total = static_cast<std::uint32_t>(12 + 16 * count);
  if (lie) lie(records);
  for (const auto& record : records) total += (record[3] + 3) / 4 * 4;
  Bytes file{'w', 'O', 'F', 'F'};
  put(file, get(font, 0, 4), 4);
  put(file, static_cast<std::uint32_t>(44 + 20 * count + body.size()), 4);
  put16(file, static_cast<int>(count));
  put16(file, 0);
  put(file, total, 4);
  file.resize(44);
  for (const auto& record : records) {
    for (const std::uint32_t value : record) put(file, value, 4);
  }
  file.insert(file.end(), body.begin(), body.end());
  return file;
}

Bytes woff2_of(const Bytes& font) {
  Bytes packed(woff2::MaxWOFF2CompressedSize(font.data(), font.size()));
  std::size_t size = packed.size();
  REQUIRE(woff2::ConvertTTFToWOFF2(font.data(), font.size(), packed.data(), &size));
  packed.resize(size);
  return packed;
}

std::string error_of(const Bytes& data) {
  return message_of<FontReadError>([&] { load_font_bytes("f.woff", data); });
}

}  // namespace

TEST_CASE("a WOFF font unpacks to the bytes it was made of", "[woff]") {
  for (const char* name : {"cabin/Cabin-Regular.otf", "open-sans/OpenSans-Regular.ttf"}) {
    const Bytes file = glyphs::read_file(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name);
    const Font font = load_font_bytes("f.woff", woff_of(file));
    CHECK(*font.data == file);
    CHECK(font.container == Container::Woff);
    CHECK(glyphs::write_sfnt(font, {}).data == file);
  }
}

TEST_CASE("a WOFF2 font unpacks to the tables and outlines it was made of", "[woff]") {
  const Bytes file = font_of(small_font({{}, triangle, square}));
  const Font plain = load_font_bytes("f.ttf", file);
  const Font font = load_font_bytes("f.woff2", woff2_of(file));
  CHECK(font.container == Container::Woff2);
  REQUIRE(font.glyphs.size() == plain.glyphs.size());
  for (std::size_t i = 0; i < font.glyphs.size(); ++i) CHECK(font.glyphs[i].contours == plain.glyphs[i].contours);
  const auto before = tables_of(file);
  const auto after = tables_of(*font.data);
  for (const std::string tag : {"cmap", "hhea", "hmtx", "maxp", "post"}) CHECK(after.at(tag) == before.at(tag));
  CHECK(sfnt_bytes::checksum(*font.data) == 0xB1B0AFBA);
}

TEST_CASE("lengths that lie are found before anything is unpacked", "[woff]") {
  const Bytes file = font_of(small_font({{}, triangle, square}));
  const auto lying = [&](std::size_t field, std::uint32_t value) {
    return error_of(woff_of(file, [&](auto& records) { records[3].at(field) = value; }));
  };
  REQUIRE(error_of(woff_of(file)) == "");
  CHECK(lying(3, 0xFFFFFFF0).starts_with("f.woff: table head: "));
  CHECK(lying(3, 3000).starts_with("f.woff: table head does not unpack to its 3000 bytes"));
  CHECK(lying(3, 53).find("does not unpack") != std::string::npos);
  CHECK(lying(1, 0xFFFFFFF0).starts_with("f.woff: is truncated: table head lies at "));
  CHECK(lying(1, 20).starts_with("f.woff: is truncated: table head lies at 20"));
  CHECK(lying(2, 0) == "f.woff: table head does not unpack to its 54 bytes");
  CHECK(lying(0, 0x636D6170) == "f.woff: table cmap stands twice in the directory");
  Bytes cut = woff_of(file);
  cut.pop_back();
  CHECK(error_of(cut).starts_with("f.woff: says it has "));
  Bytes total = woff_of(file);
  total[19] ^= 4;
  CHECK(error_of(total).starts_with("f.woff: says it unpacks to "));
  Bytes flipped = woff_of(file);
  flipped[flipped.size() - 8] ^= 0x55;
  CHECK_NOTHROW(error_of(flipped));
  for (std::size_t size = 4; size < 60; ++size) {
    CHECK(error_of(Bytes(cut.begin(), cut.begin() + static_cast<std::ptrdiff_t>(size))).starts_with("f.woff: "));
  }
}

TEST_CASE("a WOFF2 font that is cut, or that claims more than a font may have, is refused", "[woff]") {
  const Bytes file = woff2_of(font_of(small_font({{}, triangle, square})));
  for (std::size_t size = 4; size < file.size(); size += 3) {
    CHECK(error_of(Bytes(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size))).starts_with("f.woff: "));
  }
  Bytes claim = file;
  // The first length in the directory, after a byte that names its table.
  const Bytes huge{0x8F, 0xFF, 0xFF, 0xFF, 0x7F};
  claim.erase(claim.begin() + 49);
  claim.insert(claim.begin() + 49, huge.begin(), huge.end());
  CHECK(error_of(claim) == "f.woff: unpacks to more than 268435456 bytes");
}

TEST_CASE("a table of zeros that unpacks to a hundred times the file is refused unread", "[woff]") {
  auto tables = small_font({{}, triangle});
  tables["zero"] = Bytes(1 << 20);
  CHECK(error_of(woff_of(font_of(tables))).ends_with(" bytes unpack to more than 100 times"));
  CHECK(error_of(woff2_of(font_of(tables))).ends_with(" bytes unpack to more than 100 times"));
}
