#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/spectrum.h"
#include "glyphs/font.h"
#include "glyphs/jobs.h"

namespace glyphs {

/// How much is measured: what is exact and next to free, or ink and octaves of feature size too.
enum class AreaMetrics { Area, All };

/// One contour of a glyph; its area is positive where it adds to what the contours enclose together, negative for a
/// counter, whichever way they run.
struct ContourArea {
  double area = 0.0;
  fontcore::Point centroid = fontcore::Point::Zero();  ///< the first point if there is no area
};

/// What one glyph measures, composed, in font units. Nothing here but `area` depends on the directions of contours that
/// neither meet nor lie in one another, or on their order and starts.
struct GlyphArea {
  std::string name;
  std::vector<char32_t> characters;  ///< sorted
  std::string location;              ///< in the design space, as it was asked for; empty: the font's own
  std::string trouble;               ///< why it cannot be drawn; then nothing below is known
  double area = 0.0;                 ///< exact signed area of all contours
  double advance = 0.0;
  double length = 0.0;                                       ///< of all contours
  fontcore::Point centroid = fontcore::Point::Zero();        ///< of `enclosed`, 0 if that is 0
  Eigen::Vector3d second_moments = Eigen::Vector3d::Zero();  ///< about the centroid: xx, xy, yy
  std::vector<ContourArea> contours;                         ///< of some length; the largest area first
  bool has_quadratics = false;
  bool has_cubics = false;
  std::optional<double> ink;                                          ///< area by the non-zero rule
  std::optional<std::array<double, fontcore::octave_count>> octaves;  ///< energies, finest first

  /// Sum of the contours' areas.
  double enclosed() const;
  /// Ink if it is known, else what is enclosed: the same where no contours overlap.
  double colour_area() const { return ink.value_or(enclosed()); }
};

/// By how much one glyph may differ, instead of what the comparison is asked for.
struct AreaTolerance {
  std::optional<double> percent;
  std::optional<double> units;
  std::optional<double> move;
};

/// Areas of a font's glyphs, at one or several places of its design space, to be kept and compared with.
struct AreaBaseline {
  int units_per_em = 0;
  AreaMetrics metrics = AreaMetrics::Area;
  bool is_selection = false;  ///< only some of the font's glyphs were asked for
  std::vector<std::string> locations{""};
  std::vector<GlyphArea> glyphs;                    ///< sorted by name, then as the locations are
  std::map<std::string, AreaTolerance> tolerances;  ///< by glyph name
};

/// The shortest feature that octaves are counted from, of the em: octave k holds features up to 2^k times that.
inline constexpr double finest_feature = 8e-3;

/// Measures glyphs of a font; the same for every number of threads. A glyph in trouble, or whose ink takes more work to
/// find than any drawn glyph's, is named in `trouble`.
///
/// Exact   areas, centroids and moments to rounding; lengths to 1e-10.
std::vector<GlyphArea> measure_areas(const Font& font, const std::vector<int>& glyphs, AreaMetrics metrics,
                                     const std::string& location = "", const JobOptions& options = {});

/// The baseline as JSON, one line a glyph, made to be compared by diff:
///
///     {"version": 1, "unitsPerEm": .., "metrics": "area" | "all", "glyphs": [
///     {"name", "area", "characters": ["U+0061"], "location", "advance", "length", "centroid": [x, y],
///      "secondMoments": [xx, xy, yy], "contours": [[area, x, y], ..], "curves": "quadratic" | "cubic" | "both",
///      "ink", "octaves": [..]}, ..]}
///
/// Keys that would say nothing are left out. `"locations": [..]` and `"selection": true` stand in the head, and
/// `"tolerances": {"a": {"percent": 1, "units": 500, "move": 2}}`, which is written by hand and kept. `area` reads back
/// to the same double, other numbers have 12 digits.
std::string baseline_json(const AreaBaseline& baseline);

/// Throws  RequestError, naming the place: not such a file, an unknown key or version.
AreaBaseline parse_baseline(const std::string& json);
/// Only the tolerances of a baseline of any version; none if the file is not JSON.
/// Throws  RequestError, naming the file and the place, if they are no such tolerances.
std::map<std::string, AreaTolerance> load_tolerances(const std::string& path);
/// Throws  RequestError, naming the file.
AreaBaseline load_baseline(const std::string& path);

}  // namespace glyphs
