#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/restyle.h"

namespace glyphs {

struct FamilyOptions {
  LoadOptions load;  ///< of every font
  JobOptions jobs;   ///< progress is over the glyphs of all fonts
  /// Of a font the recipe's glyphs to work on, sorted; none: all.
  std::function<std::optional<std::vector<int>>(const Font&)> only;
};

/// One recipe over several fonts, one after the other, so that one is held at a time: `take` gets the index of each,
/// the font and what `restyle` made of it, in order.
///
/// Every font is read and looked through before the first is worked on, and read again then.
///
/// Throws  FontReadError or RequestError, one line naming all fonts that cannot be read or written, and those in which
///         the recipe names a glyph or a contour that is not there; FontWriteError as `restyle` does.
void restyle_family(const std::vector<std::string>& fonts, const Recipe& recipe, const FamilyOptions& options,
                    const std::function<void(std::size_t, const Font&, RestyleResult)>& take);

/// Where a family goes.
struct FamilyOutputs {
  std::string folder;   ///< made if it is missing, and removed again if nothing came
  std::string report;   ///< empty: none
  std::string proof;    ///< ends in .png, .pdf or .svg; empty: none
  bool strict = false;  ///< a refused glyph in any font: nothing is written
};

/// What became of one font of a family.
struct FamilyFont {
  std::string font;  ///< as given
  std::string name;  ///< of its file in the folder
  int units_per_em = 0;
  RestyleResult result;  ///< but for the font itself, which is in its file
  std::vector<std::string> refusals;
};

struct FamilyResult {
  std::vector<FamilyFont> fonts;
  std::string report;       ///< JSON text; same fonts, same bytes
  bool is_written = false;  ///< false if strictness forbade it
};

/// A family restyled into a folder, with one report and one proof: all files or none, as an `OutputBatch`. A font is
/// staged when it is done, so that memory is needed for one.
///
/// A font's file has the name of the one it came from; of a web font or a collection with the ending of its outlines.
/// The folder may be the one the fonts are in.
///
/// The report has what that of `restyle` has, font by font, their sums, and the glyphs that moved most of all. The
/// proof has a section for each font with the glyphs that changed, or of many those that moved most, the farthest
/// first; of a font without changes those that were looked at.
///
/// Throws  RequestError if two fonts have one name, or one would overwrite another that is read; as `restyle_family`,
///         `OutputFolder` and `OutputBatch` do. Nothing is written then.
FamilyResult restyle_family_into(const FamilyOutputs& outputs, const std::vector<std::string>& fonts,
                                 const Recipe& recipe, const FamilyOptions& options = {});

}  // namespace glyphs
