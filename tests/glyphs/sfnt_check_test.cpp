// What is said to be at fault, against what the OpenType Sanitizer refuses.

#include "glyphs/sfnt_check.h"

#include <random>

#include "glyphs/sfnt_writer.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/sanitizer.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/glyphs/subset.h"

namespace {

using glyphs::Bytes;
using glyphs::sfnt::Faults;
using Tables = std::map<std::string, Bytes>;

Bytes font_like(const Bytes& file, const Tables& tables) {
  Bytes bytes = sfnt_bytes::font_of(tables);
  std::copy_n(file.begin(), 4, bytes.begin());
  return bytes;
}

/// Empty if the font has none, or is none.
std::string first_fault(const Bytes& font) {
  try {
    const Faults faults = glyphs::sfnt::find_faults(glyphs::sfnt::read_directory(font, 0));
    if (!faults.tables.empty()) return faults.tables[0];
    if (!faults.glyphs.empty()) return faults.glyphs.begin()->second;
    return "";
  } catch (const glyphs::sfnt::Malformed& error) {
    return error.what();
  }
}

struct Agreement {
  int refused = 0;
  int taken = 0;
};

/// Numbers of a table written over at random: whatever the sanitizer refuses is at fault, and what is at
/// fault it refuses.
Agreement compare(const Bytes& file, const std::string& name, unsigned rounds) {
  const Tables tables = sfnt_bytes::tables_of(file);
  Agreement agreement;
  for (unsigned seed = 1; seed <= rounds; ++seed) {
    std::mt19937 random(seed);
    Tables bad = tables;
    Bytes& table = bad[name];
    const std::size_t reach = std::min<std::size_t>(table.size() / 2, seed % 3 == 0 ? 16 : seed % 3 == 1 ? 256 : 65536);
    if (reach == 0) continue;
    const std::size_t at = random() % reach * 2;
    constexpr int values[] = {0, 1, 2, 0x7FFF, 0xFFFF};
    const int old = table[at] << 8 | table[at + 1];
    const int value = seed % 2 == 0 ? values[random() % 5] : old + static_cast<int>(random() % 5) - 2;
    sfnt_bytes::set16(table, at, value & 0xFFFF);
    const Bytes font = font_like(file, bad);
    const bool is_taken = is_accepted_by_sanitizer(font);
    const std::string fault = first_fault(font);
    INFO(name << ": number at " << at << " from " << old << " to " << value << ": " << fault);
    CHECK(is_taken == fault.empty());
    ++(is_taken ? agreement.taken : agreement.refused);
  }
  return agreement;
}

}  // namespace

TEST_CASE("the bundled fonts have no fault", "[sfnt_check]") {
  for (const std::string& path : bundled_fonts()) {
    INFO(path);
    CHECK(first_fault(glyphs::read_file(path)) == "");
  }
}

TEST_CASE("damaged tables are at fault where the OpenType Sanitizer refuses them", "[sfnt_check][slow]") {
  Agreement all;
  for (const std::string& path : bundled_fonts()) {
    INFO(path);
    const Bytes file = glyphs::read_file(path);
    for (const auto& [name, table] : sfnt_bytes::tables_of(file)) {
      const bool is_layout = name == "GDEF" || name == "GSUB" || name == "GPOS";
      const Agreement here = compare(file, name, is_layout ? 8 : 3);
      all.refused += here.refused;
      all.taken += here.taken;
    }
  }
  CHECK(all.refused > 100);
  CHECK(all.taken > 100);
}
