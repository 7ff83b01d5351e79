#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/jobs.h"
#include "glyphs/shaping.h"
#include "glyphs/weight.h"

/// What each subcommand does, over the library alone: a request as plain values in, the text for standard output back.
/// Files are written whole or not at all, several of them together or none.
///
/// Throws  whatever the library throws, one line each: FontReadError, FontWriteError, RequestError, InvalidInput.
namespace commands {

/// The options that every subcommand has.
struct Request {
  std::string font;
  int face = 0;
  std::string location;             ///< of a variable font, as `glyphs::parse_location` reads it; empty: its default
  std::vector<std::string> glyphs;  ///< selections as `glyphs::select_glyphs` reads them; none: all with outlines
  std::optional<std::string> text;  ///< or the glyphs this text needs
  glyphs::ShapingOptions shaping;
  bool json = false;
  bool quiet = false;  ///< a command that writes a file has nothing more to say
  glyphs::JobOptions jobs;
};

/// What a command has to say, and its exit status: 0 done, 1 the check found something.
struct Outcome {
  std::string text;       ///< for standard output
  std::string complaint;  ///< for standard error: one line, or nothing
  int status = 0;
};

Outcome inspect(const Request& request);

Outcome check(const Request& request);

struct MeasureAreaRequest {
  std::string output;                  ///< the baseline; empty: none
  std::string metrics = "area";        ///< or all
  std::vector<std::string> locations;  ///< of a variable font; none: its default
};
Outcome measure_area(const Request& request, const MeasureAreaRequest& measure);

/// Where a report goes beside standard output, and what makes the exit status 1.
struct ReportRequest {
  std::string html;      ///< empty: none
  std::string junit;     ///< empty: none
  std::string markdown;  ///< empty: none
  std::string error_code_on = "FAIL";
};

struct CheckAreaRequest {
  std::string baseline;
  std::string against;  ///< the font before, for pictures; empty: none
  double tolerance_percent = 0.1;
  double tolerance_units = 0.0;
  double tolerance_move = 0.25;
  double tolerance_curve = 1.0;
  bool area_only = false;
  bool rescale = false;
  ReportRequest report;
};
Outcome check_area(const Request& request, const CheckAreaRequest& check);

struct AuditAreaRequest {
  std::vector<std::string> fonts;
  std::vector<std::string> locations;  ///< all fonts at each
  std::string frequencies;             ///< of letters, JSON; empty: English
  ReportRequest report;
};
Outcome audit_area(const Request& request, const AuditAreaRequest& audit);

struct RestyleRequest {
  std::string recipe;
  std::string output;
  std::string report;  ///< empty: none
  std::string proof;   ///< empty: none
  bool strict = false;
};
Outcome restyle(const Request& request, const RestyleRequest& restyle);

/// A family: all these fonts, `request.font` aside.
struct FamilyRequest {
  std::vector<std::string> fonts;
  std::string recipe;
  std::string output_dir;
  std::string report;  ///< empty: none
  std::string proof;   ///< empty: none
  bool strict = false;
};
Outcome restyle_family(const Request& request, const FamilyRequest& family);

/// Detail of a font's glyphs as a library.
struct ExtractRequest {
  std::string output;
  std::string glyph;           ///< name or code point; empty: the request's selection
  std::optional<int> contour;  ///< none: all
  std::string from;            ///< "x,y", with `to` a stretch of one contour; empty: whole arcs
  std::string to;
  double scale = 0.0;  ///< font units
  std::string frame = "tangent";
  std::string name;               ///< empty: the glyph, or the font's family
  std::string procedural;         ///< "KIND,PARAMETER=VALUE,..": a library that follows a rule, of no font
  std::string drawing;            ///< an SVG or a text of points: the detail of its strokes; a font gives the em
  double unit = 1.0;              ///< of the drawing, font units
  std::vector<std::string> like;  ///< a plain font and its textured version: what differs; with a stretch, one edit
};
Outcome extract_character(const Request& request, const ExtractRequest& extract);

/// A library laid on a font.
struct ApplyRequest {
  std::string library;
  double gain = 1.0;
  std::uint64_t seed = 1;
  bool mirrors = false;
  bool adds = false;
  bool spares_straights = false;
  bool holds_joins = false;
  double tolerance = 0.5;     ///< font units
  std::optional<int> points;  ///< most that a glyph may have
};
/// An edit of one stretch, put wherever outlines run alike.
struct RepeatRequest {
  std::string library;
  double within = 4.0;  ///< thousandths of the em
  bool mirrors = true;
  bool turns = false;
  std::vector<double> sizes;  ///< smallest and largest; empty: its own alone
};
Outcome repeat_character(const Request& request, const RepeatRequest& repeat, const RestyleRequest& restyle);

Outcome apply_character(const Request& request, const ApplyRequest& apply, const RestyleRequest& restyle);

struct SimplifyRequest {
  std::string output;
  std::string report;      ///< empty: none
  double tolerance = 1.0;  ///< thousandths of the em
  std::string extrema = "keep";
  std::string curve = "same";
  bool strict = false;
};
Outcome simplify(const Request& request, const SimplifyRequest& simplify);

struct LearnWeightRequest {
  std::string bold;
  std::string controls;  ///< characters or glyph names, comma separated
  std::string prior;     ///< what other families say of single letters: a file, none, or empty for what is built in
  std::string output;
};
Outcome learn_weight(const Request& request, const LearnWeightRequest& learn);

struct ApplyWeightRequest {
  std::string model;
  std::string output;
  std::string report;  ///< empty: none
  glyphs::WeightStrength strength;
  bool carries = false;  ///< FONT is of another family than the model
  std::string fit_to;    ///< a font of FONT's family with n and o in the weight wanted; empty: none
  std::string advance = "keep";
  std::string emission = "structure";
  double tolerance = 0.5;     ///< of compact emission, font units
  double italic_angle = 0.0;  ///< degrees leaning right
  double detail_scale = 0.0;  ///< font units
  std::string proof;          ///< a picture of what changed, before and after; empty: none
  std::string against;        ///< a font where the weight is drawn: its letters beside those made, worst first
  bool strict = false;
};
Outcome apply_weight(const Request& request, const ApplyWeightRequest& apply);

struct ConvertRequest {
  std::string output;
  bool fractional = false;          ///< coordinates keep their fractions
  std::optional<double> tolerance;  ///< thousandths of the em; none: 1, or 0 if coordinates keep their fractions
  bool strict = false;
};
Outcome convert(const Request& request, const ConvertRequest& convert);

/// `request.location` aside.
struct ProofRequest {
  std::string output;
  std::string against;                 ///< empty: nothing to compare with
  std::vector<std::string> show;       ///< nodes, crossings, comb, comb=LENGTH, level=LENGTH
  std::vector<double> sizes;           ///< pixels per em: one for all, several for a waterfall of text; none: usual
  std::vector<std::string> locations;  ///< of a variable font, one after the other; none: its default
};
Outcome proof(const Request& request, const ProofRequest& proof);

}  // namespace commands
