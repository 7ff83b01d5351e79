#pragma once

#include <optional>
#include <string>
#include <vector>

#include "glyphs/jobs.h"
#include "glyphs/shaping.h"

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

/// With `output` the areas go to that file as the baseline.
Outcome measure_area(const Request& request, const std::string& output);

struct RestyleRequest {
  std::string recipe;
  std::string output;
  std::string report;  ///< empty: none
  std::string proof;   ///< empty: none
  bool strict = false;
};
Outcome restyle(const Request& request, const RestyleRequest& restyle);

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
  double amount = 1.0;
  double italic_angle = 0.0;  ///< degrees leaning right
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

struct ProofRequest {
  std::string output;
  std::string against;            ///< empty: nothing to compare with
  std::vector<std::string> show;  ///< nodes, crossings, level=LENGTH
};
Outcome proof(const Request& request, const ProofRequest& proof);

}  // namespace commands
