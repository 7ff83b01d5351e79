#pragma once

#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "glyphs/font.h"
#include "glyphs/proof.h"

namespace glyphs {

/// How near a made outline comes to a drawn one.
struct OutlineError {
  double difference = 0.0;  ///< area that only one of them has, as a share of the drawn one's
  double area = 0.0;        ///< area of the made one over that of the drawn one, less 1
  double shift = 0.0;       ///< sideways, by which the made one was moved to be compared
};

/// Compares inks at the best of fifteen shifts sideways: left sides together, right sides together, and thirteen about
/// the middles, up to three hundredths of the width away.
///
/// Units   both in the same. Throws WorkLimitExceeded as `fontcore::measure_ink`.
OutlineError compare_outlines(const std::vector<fontcore::BezierContour>& made,
                              const std::vector<fontcore::BezierContour>& drawn);

/// A glyph in another weight, beside the same one in a font where that weight is drawn.
struct ComparedGlyph {
  int glyph = 0;  ///< id in the font made
  int drawn = 0;  ///< id in the font drawn
  OutlineError error;
};

/// The glyphs that a font where the weight is drawn has too, by character, else by name; worst first. Those that
/// cannot be composed or compared are left out.
std::vector<ComparedGlyph> compare_weights(const Font& made, const Font& drawn, const std::vector<int>& glyphs);

/// A picture of glyphs in another weight, a cell each, with their errors: the weight before as a line, over both what
/// was made and what is drawn; where only one of them has ink, in a colour of its own. Same input, same bytes.
///
/// Throws  RequestError if there is no glyph; FontReadError if one cannot be composed.
Bytes draw_weight_proof(const Font& before, const Font& made, const Font& drawn,
                        const std::vector<ComparedGlyph>& glyphs, ProofFormat format);

}  // namespace glyphs
