#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fontcore/compact.h"
#include "glyphs/font_file.h"
#include "glyphs/jobs.h"

namespace glyphs {

/// What curves a simplified font is made of.
enum class SimplifiedCurve { Same, Cubic, Quadratic };

struct SimplifyOptions {
  double tolerance = 1.0;  ///< two-sided distance allowed, thousandths of the em; 0: nothing changes
  fontcore::Extrema extrema = fontcore::Extrema::Keep;
  SimplifiedCurve curve = SimplifiedCurve::Same;
  std::optional<std::vector<int>> only;  ///< glyph ids, sorted; none: all with outlines of their own
  JobOptions jobs;
};

/// What became of one glyph.
struct SimplifiedGlyph : GlyphChange {
  double tolerance = 0.0;       ///< that was used, font units: less than asked where more would have added a crossing
  double deviation = 0.0;       ///< two-sided distance of the written outline from the old one, font units
  fontcore::Point where{0, 0};  ///< the point of either that is so far from the other
  int worst_contour = 0;        ///< the contour it is on
};

/// A font in fewer segments.
struct SimplifyResult : GlyphChanges<SimplifiedGlyph> {
  WrittenFont font;
};

/// The kind of file that a simplified font is: that of its outlines, OpenType if TrueType outlines become cubics.
///
/// Throws  RequestError as `kind_of` does, and if cubics are to become quadratics in a font file.
FileKind simplified_kind(const Font& font, SimplifiedCurve curve);

/// A font with its outlines in the fewest segments found, every selected glyph on its own. With nothing shorter the
/// file itself comes back, bit for bit. Composites follow their parts; where TrueType outlines become cubics all are
/// flattened, and the glyphs not selected are raised to the same cubics.
///
/// Throws  RequestError as `simplified_kind` does; FontWriteError as the writers do; InvalidInput if the tolerance is
///         negative or no number.
SimplifyResult simplify(const Font& font, const SimplifyOptions& options = {});

/// The report as JSON text; same result, same bytes.
std::string simplify_json(const Font& font, const SimplifyOptions& options, const SimplifyResult& result);

}  // namespace glyphs
