#pragma once

#include <string>
#include <vector>

#include "glyphs/area_baseline.h"
#include "glyphs/report.h"

namespace glyphs {

struct AreaCheckOptions {
  double percent = 0.1;    ///< change allowed of a glyph's area, and of each of its contours'
  double units = 0.0;      ///< square font units, if that is more
  double move = 0.25;      ///< change allowed of the outline where areas stay, thousandths of the em
  double curve = 1.0;      ///< distance of outlines whose curves are of another kind now, thousandths of the em
  bool area_only = false;  ///< outlines may change as they like while areas stay
  bool rescale = false;    ///< another number of units to the em is no finding
};

/// One glyph that is not what it was.
struct AreaDrift {
  std::string glyph;  ///< as it is called now
  std::string location;
};

struct AreaComparison {
  Report report;
  std::vector<AreaDrift> drifts;  ///< the worst first: what changed its area most, then what moved most
};

/// Compares glyphs with their baseline, matched by character first, then by name, at every location.
///
/// Areas are ink where both sides have it, else what contours enclose, whichever way they run. Where areas stay, the
/// outline has to: a change of the first or second moments counts as the mean move of the outline that explains it, and
/// may come to a thousandth of `move`; a change of energy in an octave counts as the height of a bump of that size on a
/// straight that has it, and may come to `move`. With the default and everything measured, every local move of 4/1000
/// em is found, as are most that are smaller.
///
/// Where curves are of another kind now every curve may have moved by `curve`, though not all of them all one way: a
/// mean move of half of it is allowed, of areas, moments and the root mean square of every octave. Where the em
/// was rescaled that is half a unit of either em, as whole numbers have it.
///
/// `file` is what the font is called. A FAIL is what changed, has gone or cannot be read any more, a WARN what is new.
/// Nothing is said of glyphs gone or new if `now` is a selection, nor of new ones if `before` is.
///
/// Throws  InvalidInput if a tolerance is negative or no number.
AreaComparison compare_areas(const AreaBaseline& before, const AreaBaseline& now, const std::string& file,
                             const AreaCheckOptions& options = {});

/// Pictures of the worst glyphs at one location, by `AreaComparison::drifts`: before, now, both overlaid (what went is
/// red, what came is blue), and the place where they differ most enlarged; without the font of before now alone.
std::vector<Picture> draw_drifts(const AreaComparison& comparison, const std::string& location, const Font& now,
                                 const Font* before);

}  // namespace glyphs
