#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/crossing.h"
#include "glyphs/font.h"
#include "glyphs/shaping.h"

namespace glyphs {

/// What a proof shows beside the ink.
struct ProofOptions {
  double pixels_per_em = 160.0;
  std::vector<double> waterfall;  ///< text at these sizes, pixels per em, in this order; empty: at `pixels_per_em`
  bool nodes = false;             ///< on-curve points and handles
  bool crossings = false;         ///< where outlines meet
  /// The curvature comb: from every place of an outline a tooth along its normal, away from the centre of curvature,
  /// and a line through their tips. A tooth is comb * em / radius ems long, so this is the length where the radius is
  /// an em; 0: such that half of the curved outline has at most 0.05 em, the same all over the picture. Longer ones
  /// than 0.15 em are cut there, and the line has a gap. Across a smooth join it goes on, with a step where curvature
  /// jumps; at corners it breaks.
  std::optional<double> comb;
  /// Every contour without features shorter than this, font units: arc by arc at its fractional level, the ends of its
  /// spans as dots. What a smooth step by level at this scale wishes. Of several levels each has a row or a cell of its
  /// own, side by side.
  std::vector<double> levels;
  ShapingOptions shaping;
};

/// A font as a proof shows it. It refers to both fonts.
struct ProofedFont {
  const Font& font;
  const Font* against = nullptr;  ///< the font before
  std::string place;              ///< in the design space: what its labels say beside its name
};

enum class ProofFormat { Png, Pdf, Svg };
/// By the file's ending.
/// Throws  RequestError if it is none of .png, .pdf, .svg.
ProofFormat proof_format(const std::string& path);

/// One glyph of one font as a picture: 8-bit coverage, row 0 at the top, by cairo. For tests and pictures.
struct Coverage {
  int width = 0;
  int height = 0;
  std::vector<unsigned char> pixels;
};
/// The glyph's ink at `pixels_per_em`; the glyph's origin is at pixel (left, baseline), counted from the top left
/// corner.
Coverage draw_coverage(const Font& font, int glyph, double pixels_per_em, int width, int height, double left,
                       double baseline);

/// Pictures are drawn at the wished `pixels_per_em`, or smaller so that they stay below 16,000 pixels a side and 64
/// million in all. Labels are set in the proofed font itself. Same input, same bytes.

/// A picture of set text, font after font, size after size: every line of `text` in `font`; with `against` three rows
/// to a line: before (`against`), after (`font`), and the two overlaid, what went in red, what came in blue. Rows are
/// labelled. Lines from right to left end at the right; the lines of vertical text are columns, from right to left.
/// Reproducible: no date is written unless SOURCE_DATE_EPOCH is set.
///
/// Throws  RequestError if there is no font, the text cannot be set, a size, comb or level is out of range, or
///         SOURCE_DATE_EPOCH is no number of seconds; FontReadError if a glyph cannot be composed.
Bytes draw_proof(const std::vector<ProofedFont>& fonts, const std::string& text, ProofFormat format,
                 const ProofOptions& options = {});
/// Of one font.
Bytes draw_proof(const Font& font, const std::optional<Font>& against, const std::string& text, ProofFormat format,
                 const ProofOptions& options = {});

/// A picture of glyphs of one font or of several, a section each. What is shown of a font is taken when it is added, so
/// that the font may go.
class GlyphProof {
 public:
  /// Throws  RequestError if a level is no length.
  explicit GlyphProof(const ProofOptions& options = {});
  GlyphProof(const GlyphProof&) = delete;
  GlyphProof& operator=(const GlyphProof&) = delete;
  ~GlyphProof();

  /// The glyphs in the order of the list, each in a cell of its own with its name: with `against`, which is the font
  /// before, both overlaid. The glyph before is the one of the same id and name, else of the same name, else of the
  /// same character; without one, all of the glyph came. A title stands above them, if the font has its letters.
  ///
  /// Throws  RequestError if a glyph does not exist; FontReadError if one cannot be composed.
  void add(const Font& font, const Font* against, const std::vector<int>& glyphs, const std::string& title = "");

  /// Throws  RequestError if nothing was added, or more than one picture holds.
  Bytes draw(ProofFormat format) const;

 private:
  struct Section;
  ProofOptions options_;
  std::vector<std::unique_ptr<Section>> sections_;
};

/// One section without a title, by `GlyphProof`.
///
/// Throws  RequestError if the list is empty or a glyph does not exist.
Bytes draw_glyph_proof(const Font& font, const std::optional<Font>& against, const std::vector<int>& glyphs,
                       ProofFormat format, const ProofOptions& options = {});

}  // namespace glyphs
