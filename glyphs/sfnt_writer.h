#pragma once

#include <map>
#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// A font ready to be written, and what was done to it beyond the outlines.
struct WrittenFont {
  Bytes data;
  std::vector<std::string> changed_tables;  ///< rebuilt, other bytes than before; sorted
  std::vector<std::string> dropped_tables;  ///< made void by the edit: DSIG, hdmx, LTSH, VDMX; sorted
  std::vector<int> dropped_instructions;    ///< glyphs whose TrueType instructions are gone: edited ones, and
                                            ///< composites in which points have other numbers now; sorted
  std::vector<int> moved_composites;        ///< composites whose box follows an edited component; sorted
  std::vector<std::string> warnings;        ///< what is kept though it may no longer match, a line each
};

/// Edited outlines, by glyph id: as many contours, with whole-number coordinates, of the font's structure or another.
using EditedGlyphs = std::map<int, std::vector<fontcore::BezierContour>>;

/// The font with the given glyphs' outlines replaced and nothing else changed.
///
/// `glyf`, `loca`, `hmtx`, `head`, `hhea` and `maxp` follow the outlines; every other table is copied byte for byte. A
/// glyph not edited keeps its bytes; a composite that uses an edited one changes in its box alone. Overlap flags are
/// kept, instructions of edited glyphs dropped; where points have other numbers, also those of composites. Left side
/// bearings move with xMin, so that every outline stays at its origin. Same input, same bytes: head.modified changes
/// only if SOURCE_DATE_EPOCH is set. With nothing edited the file itself comes back, bit for bit. The result has been
/// read again and compared before it is returned.
///
/// Throws  FontWriteError: not a single TrueType font (CFF, collection, variable), a coordinate that is no whole number
///         or leaves int16, another number of contours, a cubic, other points in a glyph whose points a composite
///         matches by their numbers, a composite among the edited, a size over the format's limits, a result that does
///         not read back. Names file and glyph.
WrittenFont write_sfnt(const Font& font, const EditedGlyphs& edited);

}  // namespace glyphs
