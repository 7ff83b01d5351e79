#pragma once

#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/jobs.h"

namespace glyphs {

/// What becomes of coordinates that are no whole numbers.
enum class Fractions { Round, Keep };

struct ConvertOptions {
  JobOptions jobs;
  double tolerance = 1.0;  ///< two-sided distance allowed where the kind of curve changes, thousandths of the em; 0:
                           ///< quadratics are raised to the same curves, cubics cannot be converted
  Fractions fractions = Fractions::Round;  ///< where the kind of curve changes
  std::vector<int> glyphs;                 ///< of an SVG the one it is of
};

/// A font as another kind of file, and what became of its outlines.
struct ConvertedFont {
  WrittenFont font;
  std::vector<int> flattened;     ///< composites that are outlines now; sorted
  std::vector<int> emptied;       ///< glyphs in trouble, which have no outline now; sorted
  std::vector<double> deviation;  ///< by glyph id: distance of the outlines, or of those taken instead, both ways, font
                                  ///< units; may be empty
  int worst = -1;                 ///< glyph with the largest
  int segments_before = 0;        ///< of all glyphs, flattened
  int segments_after = 0;
};

/// A font with its outlines as curves of the other kind: TrueType's quadratics as cubics, or the cubics of CFF as
/// quadratics, every glyph flattened and in the fewest segments found by `fit_compact`, on whole numbers or, of cubics,
/// in steps of 1/65536. Contours run the other way, as the format has them, from the same starts; those of one point
/// are left out.
///
/// Where fewest segments are not found or would cross, quadratics are raised and cubics cut one by one: whole numbers
/// then take them up to 0.71 units beyond half of the tolerance. A glyph in
/// trouble, or with more points than readers take, comes out empty and is named. `instead` has outlines to be taken
/// for those of the font.
///
/// Throws  RequestError: the font has outlines of neither kind, a tolerance of 0 for quadratics, fractions in TrueType;
///         FontWriteError as the writers do.
ConvertedFont convert_outlines(const Font& font, const ConvertOptions& options = {}, const EditedGlyphs& instead = {});

/// A font as a file of another kind: TrueType as OpenType with CFF outlines and back, either as a UFO, one glyph as an
/// SVG; or of its own kind, a face of a collection, a web font or a place of a design space being a font of its own
/// then.
///
/// Throws  RequestError if that cannot be done: a UFO is compiled by fontmake, an SVG is of one glyph; FontWriteError
/// as
///         the writers do.
ConvertedFont convert_font(const Font& font, FileKind kind, const ConvertOptions& options = {});

}  // namespace glyphs
