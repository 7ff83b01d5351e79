#pragma once

#include <string>
#include <vector>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "glyphs/font_file.h"

/// A contour of a letter, and the em that sizes are measured by.
struct LetterContour {
  std::string name;
  fontcore::BezierContour contour;
  double em = 0.0;
};

/// The contours with an inside of the visible ASCII characters of fonts, in order.
/// Throws  FontReadError.
inline std::vector<LetterContour> letter_contours(const std::vector<std::string>& fonts) {
  std::vector<LetterContour> contours;
  for (const std::string& path : fonts) {
    const glyphs::Font font = glyphs::load_font(path);
    for (char32_t letter = U'!'; letter <= U'~'; ++letter) {
      const auto glyph = font.character_map.find(letter);
      if (glyph == font.character_map.end()) continue;
      int number = 0;
      for (const fontcore::BezierContour& contour : glyphs::compose(font, glyph->second)) {
        if (!has_inside(contour)) continue;
        const std::string name =
            fontcore::text(path, ", U+", static_cast<unsigned long>(letter), ", contour ", number++);
        contours.push_back({name, contour, static_cast<double>(font.units_per_em)});
      }
    }
  }
  return contours;
}
