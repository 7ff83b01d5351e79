#pragma once

#include <cstdint>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// What layout says of some glyphs, which an edit of outlines or advances does not touch.
struct LayoutUse {
  std::vector<int> anchored;       ///< of the glyphs those with anchors in GPOS; sorted
  std::int64_t kerning_pairs = 0;  ///< pairs with a kerning that is not 0 and one of the glyphs at least; a pair counts
                                   ///< for every subtable that has it
};

/// Looks through GPOS and kern, or a UFO's kerning and groups. What cannot be read says nothing.
LayoutUse layout_use(const Font& font, const std::vector<int>& glyphs);

}  // namespace glyphs
