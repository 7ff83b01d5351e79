// Bytes -> one file of a small UFO -> load_ufo -> every outline composed -> one glyph moved -> write_ufo -> read again.

#include <cmath>
#include <cstdint>
#include <iterator>

#include "fontcore/measure.h"
#include "glyphs/ufo.h"
#include "tools/fuzz/documented.h"
#include "tools/fuzz/small_ufo.h"

namespace {

const std::string name = "fuzzed.ufo";

double measure_all(const glyphs::Font& font) {
  double area = 0.0;
  for (const glyphs::Glyph& glyph : font.glyphs) {
    if (glyph.trouble.find('\n') != std::string::npos) broken("trouble in one line: " + glyph.trouble);
    try {
      area += fontcore::signed_area(compose(font, glyph.id));
    } catch (const glyphs::FontReadError&) {
      if (glyph.trouble.empty()) broken("what cannot be composed is in trouble: " + glyph.name);
    }
  }
  if (!std::isfinite(area)) broken("areas are finite");
  return area;
}

void round_trip(const glyphs::Font& font, const glyphs::EditedGlyphs& edited) {
  const glyphs::WrittenUfo written = write_ufo(font, edited);
  if (edited.empty() && written.folder != *font.folder) broken("nothing edited, nothing changed");
  try {
    const glyphs::Font read = glyphs::load_ufo(name, written.folder);
    if (edited.empty() && measure_all(read) != measure_all(font)) broken("the same files, the same areas");
  } catch (const glyphs::FontReadError& error) {
    broken(std::string("the result reads back: ") + error.what());
  }
}

}  // namespace

/// The first byte says which file the others are.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static const glyphs::Folder good = small_ufo();
  return documented(name, [&] {
    glyphs::Folder folder = good;
    std::next(folder.begin(), data[0] % std::ssize(folder))->second.assign(data + 1, data + size);
    const glyphs::Font font = glyphs::load_ufo(name, std::move(folder));
    measure_all(font);
    round_trip(font, {});
    for (const glyphs::Glyph& glyph : font.glyphs) {
      if (glyph.contours.empty()) continue;
      std::vector<fontcore::BezierContour> contours = glyph.contours;
      for (auto& contour : contours) contour = transform(contour, {.shift = fontcore::Point(3.5, -2)});
      round_trip(font, {{glyph.id, std::move(contours)}});
      break;
    }
  });
}
