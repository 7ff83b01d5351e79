#pragma once

// Private to the writer: faults in an sfnt for which sanitizers, and with them browsers, refuse the whole font.

#include <map>
#include <string>
#include <vector>

#include "glyphs/sfnt_tables.h"

namespace glyphs::sfnt {

/// Why a font would be refused.
struct Faults {
  std::vector<std::string> tables;    ///< a line each, naming the table
  std::map<int, std::string> glyphs;  ///< by glyph id: faults that go when the glyph has no outline
};

/// Looks for what the OpenType Sanitizer (OTS 8.2.1, that of browsers) refuses a whole font for; what it drops with a
/// warning, or mends, is no fault.
///
/// A composite is judged by its parts as they are once the faulty ones are empty. Charstrings after the first that take
/// `most_font_work` together are at fault unread. Sanitizers read charstrings by the letter: no surplus operands, no
/// missing `endchar` or `return`, subroutines by numbers written out, no operators put, get, index, roll and random.
///
/// Throws  Malformed as `read_basics` does.
Faults find_faults(const Directory& directory);

/// The part of it that looks through GDEF, GSUB and GPOS, down to every coverage, class, anchor and rule.
std::vector<std::string> layout_faults(const Directory& directory, int glyph_count);

/// True if the tables lie in the file as sanitizers want them: each on a multiple of four bytes, no two on one place.
bool is_well_laid_out(const Directory& directory, View file);

}  // namespace glyphs::sfnt
