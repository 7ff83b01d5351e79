#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/area_baseline.h"
#include "glyphs/report.h"

namespace glyphs {

/// How often characters occur in text; any unit.
using Frequencies = std::map<char32_t, double>;

/// The letters of English, a to z.
/// Source  R. E. Lewand, Cryptological Mathematics, 2000.
const Frequencies& english_frequencies();
/// `{"a": 8.2, "b": 1.5, ...}`, a character a key.
/// Throws  RequestError, naming the place.
Frequencies parse_frequencies(const std::string& json);
/// Throws  RequestError, naming the file.
Frequencies load_frequencies(const std::string& path);

/// The colour of one glyph: its ink as share of its advance times the em.
struct GlyphColour {
  std::string name;
  double colour = 0.0;
  char32_t character = 0;  ///< its lowest; 0: none
  std::string group;       ///< "lower case", "capitals", "figures" or "others": those it is compared with
  std::optional<double> to_n;
  std::optional<double> to_H;
  double to_median = 1.0;  ///< of its group
  double score = 0.0;      ///< how unlike its group: deviations of log colour from the median, in robust sigmas
};

/// The colour of a font at one place.
struct FontColour {
  std::string file;
  std::string location;
  std::optional<double> coverage;  ///< of text: sum of colour x width x frequency / sum of width x frequency
  std::optional<double> n;
  std::optional<double> H;
  double median = 0.0;              ///< of all glyphs
  std::vector<GlyphColour> glyphs;  ///< the most unlike first
};

/// Glyphs without an advance or without ink, which stand on others, are left out, and `.notdef`.
///
/// Source  LettError/coverage: grey = area / (width x em), weighted by the frequency of letters.
FontColour colour_of(const AreaBaseline& areas, const std::string& file, const std::string& location,
                     const Frequencies& frequencies);

/// The fonts side by side: figures of each; outliers ranked, a WARN each, where colour is 3.5 robust sigmas and a tenth
/// from the median of letters or figures; and the letters whose colour differs most from font to font, relative to n.
Report audit_colour(const std::vector<FontColour>& fonts);
/// `audit_colour` as JSON, with `"fonts": [{"filename", "location", "coverage", "n", "H", "median", "glyphs": [{"name",
/// "colour", "group", "toN", "toH", "toMedian", "score"}]}]`.
std::string audit_json(const Report& report, const std::vector<FontColour>& fonts);

}  // namespace glyphs
