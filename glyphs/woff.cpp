#include "glyphs/woff.h"

#include <woff2/decode.h>
#include <zlib.h>

#include <algorithm>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/sfnt_tables.h"

namespace glyphs {

namespace {

using fontcore::text;
using sfnt::Malformed;
using sfnt::Tag;
using sfnt::tag;
using sfnt::tag_name;
using sfnt::View;

/// Fonts pack to a half or a third; woff2 takes more than this for a trap, and says so on standard error.
constexpr std::uint64_t most_plausible_ratio = 100;

/// Refuses what a file claims to unpack to, before it is.
void check_total(std::uint64_t total, View file) {
  if (total > max_font_size) throw Malformed(text("unpacks to more than ", max_font_size, " bytes"));
  if (total > most_plausible_ratio * file.size()) {
    throw Malformed(
        text("claims that its ", file.size(), " bytes unpack to more than ", most_plausible_ratio, " times"));
  }
}

std::uint64_t padded(std::uint64_t length) { return (length + 3) / 4 * 4; }

// ---- WOFF

struct PackedTable {
  Tag name = 0;
  std::uint64_t offset = 0;
  std::uint64_t packed_length = 0;
  std::uint64_t length = 0;
};

/// The directory of a WOFF file, every length checked.
std::vector<PackedTable> read_woff_directory(View file) {
  constexpr std::uint64_t header_size = 44;
  constexpr std::uint64_t record_size = 20;
  constexpr std::uint64_t most_zlib_packs = 1032;  // a byte stands for at most so many
  if (file.size() < header_size) throw Malformed(text("is truncated: a WOFF font of ", file.size(), " bytes"));
  if (sfnt::u32(file, 8) != file.size()) {
    throw Malformed(text("says it has ", sfnt::u32(file, 8), " bytes, and has ", file.size()));
  }
  const std::uint64_t count = sfnt::u16(file, 12);
  if (count == 0) throw Malformed("is not a font: it has no tables");
  const std::uint64_t end = header_size + record_size * count;
  if (end > file.size()) throw Malformed(text("is truncated: the directory of ", count, " tables ends at ", end));
  std::vector<PackedTable> tables;
  std::uint64_t total = 12 + 16 * count;
  for (std::uint64_t at = header_size; at < end; at += record_size) {
    const PackedTable table{sfnt::u32(file, at), sfnt::u32(file, at + 4), sfnt::u32(file, at + 8),
                            sfnt::u32(file, at + 12)};
    const std::string name = tag_name(table.name);
    if (std::ranges::any_of(tables, [&](const PackedTable& other) { return other.name == table.name; })) {
      throw Malformed(text("table ", name, " stands twice in the directory"));
    }
    if (table.offset < end || table.offset + table.packed_length > file.size()) {
      throw Malformed(text("is truncated: table ", name, " lies at ", table.offset, " to ",
                           table.offset + table.packed_length, " of ", file.size(), " bytes"));
    }
    if (table.packed_length > table.length || table.length / most_zlib_packs > table.packed_length) {
      throw Malformed(text("table ", name, ": ", table.packed_length, " bytes cannot unpack to ", table.length));
    }
    total += padded(table.length);
    check_total(total, file);
    tables.push_back(table);
  }
  if (total != sfnt::u32(file, 16)) {
    throw Malformed(text("says it unpacks to ", sfnt::u32(file, 16), " bytes, its tables to ", total));
  }
  std::ranges::stable_sort(tables, {}, &PackedTable::offset);
  for (std::size_t i = 1; i < tables.size(); ++i) {
    const PackedTable& before = tables[i - 1];
    if (before.offset + before.packed_length > tables[i].offset) {
      throw Malformed(text("tables ", tag_name(before.name), " and ", tag_name(tables[i].name), " overlap"));
    }
  }
  return tables;
}

void inflate_table(View packed, std::span<unsigned char> into, const std::string& name) {
  z_stream stream{};
  stream.next_in = const_cast<Bytef*>(packed.data());  // zlib does not write there
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = into.data();
  stream.avail_out = static_cast<uInt>(into.size());
  if (inflateInit(&stream) != Z_OK) throw Malformed("zlib does not start");
  const int status = inflate(&stream, Z_FINISH);
  const std::uint64_t got = stream.total_out;
  inflateEnd(&stream);
  if (status != Z_STREAM_END || got != into.size()) {
    throw Malformed(text("table ", name, " does not unpack to its ", into.size(), " bytes"));
  }
}

Bytes unpack_woff(View file) {
  const std::vector<PackedTable> tables = read_woff_directory(file);
  std::vector<sfnt::TableSize> sizes;
  for (const PackedTable& table : tables) sizes.push_back({table.name, table.length});
  sfnt::Layout layout = sfnt::lay_out(sfnt::u32(file, 4), sizes);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    const PackedTable& table = tables[i];
    const View packed = sfnt::slice(file, table.offset, table.packed_length);
    const std::span<unsigned char> into = std::span(layout.file).subspan(layout.offsets[i], table.length);
    if (table.packed_length == table.length) {
      std::ranges::copy(packed, into.begin());
    } else {
      inflate_table(packed, into, tag_name(table.name));
    }
  }
  sfnt::seal(layout.file);
  return std::move(layout.file);
}

// ---- WOFF2

/// Reads what woff2 would allocate by before it does: the lengths in the directory.
class Woff2Directory {
 public:
  explicit Woff2Directory(View file) : file_(file), at_(header_size) {
    if (file.size() < header_size) throw Malformed(text("is truncated: a WOFF2 font of ", file.size(), " bytes"));
    const int count = sfnt::u16(file, 12);
    if (count == 0) throw Malformed("is not a font: it has no tables");
    std::uint64_t unpacked = 0;
    for (int i = 0; i < count; ++i) {
      unpacked += read_length(i);
      check_total(unpacked, file);
    }
    if (sfnt::u32(file, 20) > file.size() - at_) {
      throw Malformed(text("is truncated: ", sfnt::u32(file, 20), " packed bytes in ", file.size()));
    }
  }

 private:
  static constexpr std::uint64_t header_size = 48;

  std::uint64_t read_length(int table) {
    constexpr unsigned own_tag = 63;
    constexpr unsigned glyf = 10;
    constexpr unsigned loca = 11;
    const unsigned flags = sfnt::u8(file_, at_++);
    unsigned known = flags & 0x3F;
    if (known == own_tag) {
      const Tag name = sfnt::u32(file_, at_);
      known = name == tag("glyf") ? glyf : name == tag("loca") ? loca : own_tag;
      at_ += 4;
    }
    const std::uint64_t length = read_number(table);
    // Of glyf and loca version 3 is the plain table, of all others version 0.
    const unsigned version = flags >> 6;
    const bool is_plain = known == glyf || known == loca ? version == 3 : version == 0;
    return is_plain ? length : read_number(table);
  }

  /// UIntBase128: seven bits a byte, at most five bytes.
  std::uint64_t read_number(int table) {
    std::uint64_t value = 0;
    for (int i = 0; i < 5; ++i) {
      const unsigned byte = sfnt::u8(file_, at_++);
      value = value << 7 | (byte & 0x7F);
      if (!(byte & 0x80)) return value;
    }
    throw Malformed(text("the length of table ", table, " in the directory has no end"));
  }

  View file_;
  std::uint64_t at_;
};

/// Where woff2 writes: grows to `max_font_size` and no further.
class LimitedOutput final : public woff2::WOFF2Out {
 public:
  bool Write(const void* bytes, std::size_t count) override { return Write(bytes, data.size(), count); }
  bool Write(const void* bytes, std::size_t offset, std::size_t count) override {
    if (offset > max_font_size || count > max_font_size - offset) {
      is_full = true;
      return false;
    }
    if (data.size() < offset + count) data.resize(offset + count);
    const auto* from = static_cast<const unsigned char*>(bytes);
    std::copy(from, from + count, data.begin() + static_cast<std::ptrdiff_t>(offset));
    return true;
  }
  std::size_t Size() override { return data.size(); }

  Bytes data;
  bool is_full = false;
};

Bytes unpack_woff2(View file) {
  const Woff2Directory checked(file);
  LimitedOutput output;
  const bool is_unpacked = woff2::ConvertWOFF2ToTTF(file.data(), file.size(), &output);
  if (output.is_full) throw Malformed(text("unpacks to more than ", max_font_size, " bytes"));
  if (!is_unpacked) throw Malformed("is a WOFF2 font that does not unpack");
  return std::move(output.data);
}

}  // namespace

bool is_web_font(const Bytes& data) {
  if (data.size() < 4) return false;
  const Tag version = sfnt::u32(data, 0);
  return version == tag("wOFF") || version == tag("wOF2");
}

Bytes unpack_web_font(const std::string& path, const Bytes& data) {
  try {
    Bytes sfnt = sfnt::u32(data, 0) == tag("wOFF") ? unpack_woff(data) : unpack_woff2(data);
    if (is_web_font(sfnt)) throw Malformed("is a web font within a web font");
    return sfnt;
  } catch (const Malformed& error) {
    throw FontReadError(text(path, ": ", error.what()));
  }
}

}  // namespace glyphs
