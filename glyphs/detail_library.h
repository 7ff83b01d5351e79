#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/detail.h"
#include "fontcore/place.h"
#include "glyphs/font.h"

namespace glyphs {

/// A library of detail as its file has it: JSON, lengths in units of an em that it names, rounded to 1e-4 of them.
///
/// README.md describes every key. Same library, same bytes.
std::string library_json(const fontcore::DetailLibrary& library);

/// The way back. Keys, types and lengths of lists are checked; nothing is ignored.
///
/// Throws  RequestError, one line: `NAME: KEY: why`.
fontcore::DetailLibrary parse_library(const std::string& json, const std::string& name);
/// Reads the file and parses it.
std::shared_ptr<const fontcore::DetailLibrary> load_library(const std::filesystem::path& path);

/// What is taken from a font, and how.
struct ExtractOptions {
  double scale = 0.0;  ///< feature size below which it is detail, font units
  fontcore::DetailFrame frame = fontcore::DetailFrame::Tangent;
  bool by_shape = false;
  std::string name;
  std::optional<int> contour;  ///< of every glyph; none: all
  /// Of one glyph the stretch from near one place forward to near another, corners in between taken for detail.
  std::optional<std::pair<fontcore::Point, fontcore::Point>> stretch;
};

/// The detail of glyphs' own contours, arc by arc: a sample for every arc as long as the scale.
///
/// Throws  RequestError naming the glyph if it has no such contour, or if nothing is as long; FontReadError if the only
///         glyph cannot be read.
fontcore::DetailLibrary extract_library(const Font& font, const std::vector<int>& glyphs,
                                        const ExtractOptions& options);

/// A library that follows a rule: "KIND" or "KIND,PARAMETER=VALUE,...", in the words of `fontcore::texture`; lengths
/// are thousandths of the em.
///
/// Throws  RequestError naming the word that is no kind, no parameter or no number, or as `texture::make_library`.
fontcore::DetailLibrary procedural_library(const std::string& words, const std::string& name);

/// The detail of drawn strokes: a sample of every one that is as long as the scale.
///
/// Units   of an em of `units_per_em`; a unit of the drawing is `unit` of them. Of the options scale, frame and name.
/// Throws  RequestError naming the file if it cannot be read, or no stroke is as long.
fontcore::DetailLibrary drawn_library(const std::string& path, double unit, double units_per_em,
                                      const ExtractOptions& options);

/// What makes glyphs of a font those of its textured version, found by their names, laid by shape: to be added to other
/// glyphs' own detail. A font of another em is scaled.
///
/// Throws  RequestError naming the glyph if the two have not the same contours, or if there is nothing in common.
fontcore::DetailLibrary learn_library(const Font& plain, const Font& textured, const std::vector<int>& glyphs,
                                      const ExtractOptions& options);

/// What was done to the stretch of a glyph, to be done again wherever outlines run alike; of the options the contour
/// and the stretch. It has no feature size.
///
/// Throws  RequestError naming the glyph.
fontcore::PlacedDetail learn_edit(const Font& plain, const Font& edited, int glyph, const ExtractOptions& options);
/// Such an edit as its file has it, and back, like a library; lengths are thousandths of the em.
std::string edit_json(const fontcore::PlacedDetail& edit, const std::string& name);
fontcore::PlacedDetail parse_edit(const std::string& json, const std::string& name);
std::shared_ptr<const fontcore::PlacedDetail> load_edit(const std::filesystem::path& path);

/// The side of a contour that has the ink: the one with a winding number, or where both or neither have one, that of
/// the contours together.
fontcore::InkSide ink_side(const std::vector<fontcore::BezierContour>& contours, std::size_t index);

/// What a library calls a contour of a glyph.
std::string place_of(const std::string& glyph, int contour);

}  // namespace glyphs
