// Bytes -> a CFF table -> every charstring interpreted -> its outline encoded and interpreted again -> the table
// rewritten.

#include <cstdint>

#include "glyphs/sfnt_cff.h"
#include "tools/fuzz/documented.h"

namespace {

using glyphs::sfnt::CffTable;
using glyphs::sfnt::Charstring;

constexpr std::int64_t most_work = 2'000'000;  // steps of one table: what is linear need not be shown to be slow

/// The glyph's outline as a charstring of ours; none if our charstrings cannot hold it, which is said by Malformed.
std::optional<glyphs::Bytes> encoded(const Charstring& charstring) {
  const auto contours = glyphs::sfnt::snap(charstring.contours);
  glyphs::Bytes bytes;
  try {
    bytes = glyphs::sfnt::encode_charstring(contours, charstring.is_closed_by_line, charstring.width);
  } catch (const glyphs::sfnt::Malformed&) {
    return {};
  }
  const Charstring again = glyphs::sfnt::interpret(bytes, {}, {});
  if (!again.trouble.empty()) broken("an encoded charstring is one: " + again.trouble);
  if (again.contours != contours) broken("an encoded charstring draws its outline");
  return bytes;
}

void read_table(glyphs::sfnt::View data) {
  const CffTable table(data, 1000);
  table.is_cid_keyed();
  std::map<int, glyphs::Bytes> rewritten;
  std::int64_t work = 0;
  for (int glyph = 0; glyph < table.glyph_count() && work < most_work; ++glyph) {
    const Charstring charstring = table.read(glyph);
    work += charstring.work + 16;
    if (charstring.trouble.find('\n') != std::string::npos) broken("trouble in one line: " + charstring.trouble);
    if (!charstring.trouble.empty() && !charstring.contours.empty()) broken("trouble, no outline");
    if (!charstring.trouble.empty() || charstring.accent || charstring.contours.empty()) continue;
    const auto bytes = encoded(charstring);
    if (bytes && rewritten.empty() && !table.font_dict(glyph).is_scaled) rewritten[glyph] = *bytes;
  }
  if (rewritten.empty()) return;
  const glyphs::Bytes written = table.rewritten(rewritten, std::nullopt);
  const int glyph = rewritten.begin()->first;
  const CffTable again(written, 1000);
  if (again.glyph_count() != table.glyph_count()) broken("a table rewritten has its glyphs");
  if (again.read(glyph).contours != glyphs::sfnt::snap(table.read(glyph).contours)) broken("the outline rewritten");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return documented("", [&] {
    try {
      read_table({data, size});
    } catch (const glyphs::sfnt::Malformed& error) {  // who calls this adds the file
      if (std::string(error.what()).find('\n') != std::string::npos) broken(error.what());
    }
  });
}
