#pragma once

#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// A glyph set in a line: where its origin lies, in font units, y up, from the line's start.
struct PlacedGlyph {
  int glyph = 0;
  fontcore::Point origin = fontcore::Point::Zero();
};

struct ShapingOptions {
  std::string features;   ///< HarfBuzz feature strings, comma separated: "smcp,-liga"
  std::string script;     ///< ISO 15924 tag; empty: guessed from the text
  std::string language;   ///< BCP 47; empty: none
  std::string direction;  ///< ltr, rtl, ttb, btt; empty: guessed
};

enum class Direction { LeftToRight, RightToLeft, TopToBottom, BottomToTop };

struct ShapedLine {
  std::vector<PlacedGlyph> glyphs;  ///< in the order they are seen: left to right, or top to bottom
  Direction direction = Direction::LeftToRight;
  double advance = 0.0;  ///< how far the line runs, font units; not negative
};

/// Sets one line of UTF-8 text by HarfBuzz, as one run: of one script, language and direction. Characters that the font
/// lacks give its glyph 0, in a UFO its .notdef. A UFO, whose features are source, is set by its characters and
/// advances alone.
///
/// Throws  RequestError if the text is empty or not UTF-8, on an unknown script or direction, a malformed language, or
///         a feature that is malformed or switched on though the font has none of that name.
ShapedLine shape(const Font& font, const std::string& text, const ShapingOptions& options = {});

/// The lines of a text, as they are set one below the other; an empty line is one too, but none after a last newline.
std::vector<std::string> split_lines(const std::string& text);

/// The glyphs that setting the text needs, after substitution, sorted, each once.
///
/// Throws  RequestError as `shape`, and if the font lacks a character, naming it.
std::vector<int> glyphs_of_text(const Font& font, const std::string& text, const ShapingOptions& options = {});

}  // namespace glyphs
