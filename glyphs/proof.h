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
  bool nodes = false;      ///< on-curve points and handles
  bool crossings = false;  ///< where outlines meet
  /// Every contour without features shorter than this, font units: arc by arc at its fractional level, the ends of its
  /// spans as dots. What a smooth step by level at this scale wishes.
  std::optional<double> level;
  ShapingOptions shaping;
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

/// A picture of set text: every line of `text` in `font`; with `against` three rows to a line: before (`against`),
/// after (`font`), and the two overlaid, what went in red, what came in blue. Rows are labelled. Reproducible: no date
/// is written unless SOURCE_DATE_EPOCH is set.
///
/// Throws  RequestError if the text cannot be set or a level is no length; FontReadError if a glyph cannot be composed.
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
  /// before, both overlaid. A title stands above them, if the font has its letters.
  ///
  /// Throws  RequestError if a glyph does not exist, or has another name in `against`; FontReadError if one cannot be
  ///         composed.
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
/// Throws  RequestError if the list is empty, a glyph does not exist, or has another name in `against`.
Bytes draw_glyph_proof(const Font& font, const std::optional<Font>& against, const std::vector<int>& glyphs,
                       ProofFormat format, const ProofOptions& options = {});

}  // namespace glyphs
