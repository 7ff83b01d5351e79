#pragma once

#include <string>
#include <vector>

#include "fontcore/crossing.h"
#include "glyphs/font.h"
#include "glyphs/jobs.h"
#include "glyphs/report.h"

namespace glyphs {

/// What one contour is, and what its model is. Facts of the model are 0 if there is none.
struct ContourFacts {
  int points = 0;  ///< as the font stores them
  int segments = 0;
  double area = 0.0;    ///< exact, signed, square font units
  double length = 0.0;  ///< font units
  int corners = 0;
  int control_points = 0;  ///< N of the spline
  int levels = 0;          ///< how often N can be halved
  double distance = 0.0;   ///< measured two-sided distance between outline and spline, font units
  std::string no_model;    ///< why the contour has no model; empty if it has one
};

/// What one glyph is, composed.
struct GlyphFacts {
  int glyph = 0;
  std::string name;
  std::string trouble;  ///< why the outline could not be read or composed; empty if it could
  double area = 0.0;    ///< exact signed area of all contours, square font units
  std::vector<ContourFacts> contours;
  int left_out = 0;  ///< contours that follow, not looked into one by one: the job's work budget was spent
};

/// The facts of the given glyphs, in their order; the same for every number of threads.
///
/// Looking into contours one by one comes out of a budget that the whole job shares, by what the font stores: first
/// every glyph gets what a rich drawn one costs, then those that need more, first come, first served; what is left then
/// is counted in `GlyphFacts::left_out`. Areas are always of all contours.
std::vector<GlyphFacts> inspect(const Font& font, const std::vector<int>& glyphs, const JobOptions& options = {});

/// The facts as JSON text, one line a glyph, made to be compared by diff: `{"version", "unitsPerEm", "glyphs":
/// [{"name", "area", ...}]}`. Numbers read back to the same doubles.
std::string facts_json(const Font& font, const std::vector<GlyphFacts>& facts);

/// Where one glyph's composed outline meets itself.
struct GlyphCrossings {
  int glyph = 0;
  std::string name;
  std::string trouble;
  std::vector<fontcore::Crossing> crossings;
};
std::vector<GlyphCrossings> check_crossings(const Font& font, const std::vector<int>& glyphs,
                                            const JobOptions& options = {});

/// One finding in words: "a: contour 0 crosses itself at (102, 33.5)".
std::string describe(const GlyphCrossings& in, const fontcore::Crossing& crossing);

/// The findings as a report, for `report_json`: one check within contours, one between them. A crossing is a FAIL, and
/// so is an overlap, along which contours may change sides; a contact is a WARN, a glyph in trouble an ERROR. Every log
/// ends with `"gid"` and, of what was found, `"kind": "crossing" | "contact" | "overlap", "x", "y", "places":
/// [{"contour", "segment", "u"}, ..]`.
Report crossings_report(const Font& font, const std::vector<GlyphCrossings>& found);

}  // namespace glyphs
