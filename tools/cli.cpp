#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>

#include "glyphs/error.h"
#include "glyphs/safe_file.h"
#include "tools/commands.h"

namespace {

using commands::Outcome;
using commands::Request;
using fontcore::text;
using glyphs::RequestError;

constexpr int misuse = 2;

/// Standard error as one line, whatever file names hold.
void complain(std::string message) {
  for (char& c : message)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = ' ';
  std::fprintf(stderr, "glyphwave: %s\n", message.c_str());
}

/// How far the work is, on standard error: a bar that redraws itself on a terminal; elsewhere a line at every tenth,
/// and none if the work is short.
class Progress {
 public:
  explicit Progress(std::string what) : what_(std::move(what)), start_(std::chrono::steady_clock::now()) {}
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() { clear(); }

  void show(int done, int total) {
    if (total <= 0) return;
    if (is_terminal_) {
      if (done == total) {
        clear();
        return;
      }
      constexpr std::size_t width = 30;
      const auto filled = static_cast<std::size_t>(std::int64_t{width} * done / total);
      const std::string bar = std::string(filled, '#') + std::string(width - filled, ' ');
      std::fprintf(stderr, "\r%s [%s] %d of %d", what_.c_str(), bar.c_str(), done, total);
      is_drawn_ = true;
      return;
    }
    const int tenth = static_cast<int>(std::int64_t{10} * done / total);
    constexpr std::chrono::seconds short_work(3);
    if (tenth <= last_tenth_ || std::chrono::steady_clock::now() - start_ < short_work) return;
    last_tenth_ = tenth;
    std::fprintf(stderr, "%s: %d %%\n", what_.c_str(), 10 * tenth);
  }

 private:
  void clear() {
    if (is_drawn_) std::fputs("\r\x1b[K", stderr);
    is_drawn_ = false;
  }

  std::string what_;
  std::chrono::steady_clock::time_point start_;
  bool is_terminal_ = isatty(STDERR_FILENO) != 0;
  bool is_drawn_ = false;
  int last_tenth_ = 0;
};

/// What all options of all subcommands fill in.
struct Options {
  Request request;
  bool no_progress = false;
  std::string output;
  std::vector<std::string> locations;
  std::vector<std::string> words;  ///< of restyle, behind the first font
  commands::MeasureAreaRequest measure_area;
  commands::CheckAreaRequest check_area;
  commands::AuditAreaRequest audit_area;
  commands::ReportRequest report;
  commands::RestyleRequest restyle;
  commands::FamilyRequest family;
  commands::SimplifyRequest simplify;
  commands::LearnWeightRequest learn_weight;
  commands::ApplyWeightRequest apply_weight;
  commands::ConvertRequest convert;
  commands::ProofRequest proof;
  commands::ExtractRequest extract;
  commands::ApplyRequest apply;
  commands::RepeatRequest repeat;
};

/// One subcommand: its name, in two words if it is one of several of a kind, its own options, what it does.
struct Command {
  const char* name;
  const char* help;
  void (*add_options)(CLI::App&, Options&);
  Outcome (*run)(const Options&);
  bool takes_places = false;  ///< --location more than once
};

CLI::Option* add_output(CLI::App& app, Options& options, const char* help) {
  return app.add_option("-o,--output", options.output, help);
}

void add_font(CLI::App& app, Options& options) {
  app.add_option("FONT", options.request.font, "a font: TTF, OTF, TTC, OTC, WOFF, WOFF2 or a UFO folder")->required();
}

/// Where a report goes, and what it makes of the exit status.
void add_reports(CLI::App& app, Options& options) {
  app.add_option("--html", options.report.html, "the report as one HTML page, with pictures where there are any");
  app.add_option("--junit", options.report.junit, "the report as JUnit XML");
  app.add_option("--markdown", options.report.markdown, "the report as GitHub-flavoured Markdown");
  app.add_option("--error-code-on", options.report.error_code_on,
                 "exit status 1 from this on: ERROR, FATAL, FAIL, WARN, INFO, SKIP, PASS, DEBUG; FAIL unless given");
}

/// What a command that edits by a recipe says of its work.
void add_findings(CLI::App& app, Options& options) {
  app.add_option("--report", options.restyle.report, "what became of every glyph, JSON");
  app.add_option("--proof", options.restyle.proof, "changed glyphs before and after, .png, .pdf or .svg");
  app.add_flag("--strict", options.restyle.strict, "any refused glyph: exit status 1 and no output");
}

/// A restyling by the file that says what is done.
commands::RestyleRequest restyled_by(const std::string& recipe, const Options& options) {
  commands::RestyleRequest restyle = options.restyle;
  restyle.recipe = recipe;
  restyle.output = options.output;
  return restyle;
}

Outcome restyle(const Options& options) {
  if (!options.family.output_dir.empty())
    throw RequestError("restyle: --output-dir is where a family goes, which takes its recipe by --recipe");
  if (options.words.empty()) throw RequestError("restyle: RECIPE is required");
  if (options.words.size() > 1)
    throw RequestError("restyle: " + options.words[1] +
                       ": one FONT and one RECIPE are expected; a family takes its recipe by --recipe");
  if (options.output.empty()) throw RequestError("restyle: --output is required");
  return commands::restyle(options.request, restyled_by(options.words[0], options));
}

Outcome restyle_family(const Options& options) {
  if (!options.output.empty()) throw RequestError("restyle: --output is for one font; a family goes to --output-dir");
  if (options.family.output_dir.empty()) throw RequestError("restyle: --recipe needs --output-dir, where the fonts go");
  for (const std::string& word : options.words)
    if (word.ends_with(".json"))
      throw RequestError("restyle: " + word + ": with --recipe all words are fonts, and there is one recipe for all");
  commands::FamilyRequest request = options.family;
  request.fonts = options.words;
  request.fonts.insert(request.fonts.begin(), options.request.font);
  request.report = options.restyle.report;
  request.proof = options.restyle.proof;
  request.strict = options.restyle.strict;
  return commands::restyle_family(options.request, request);
}

constexpr std::array<Command, 14> table{{
    {"inspect", "per glyph and contour: points, segments, corners, model, area, length", [](CLI::App&, Options&) {},
     [](const Options& options) { return commands::inspect(options.request); }},
    {"restyle",
     "apply a recipe to a font or a UFO: restyle FONT RECIPE -o OUT; or to a family: restyle --recipe RECIPE "
     "--output-dir DIR FONT...",
     [](CLI::App& app, Options& options) {
       app.add_option("RECIPE", options.words, "the recipe, JSON; with --recipe the other fonts of the family");
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT; may be FONT itself");
       app.add_option("--recipe", options.family.recipe, "the recipe for a family");
       app.add_option(
           "--output-dir", options.family.output_dir,
           "where a family goes, each font under its own name; made if it is missing, may be the fonts' own");
       add_findings(app, options);
     },
     [](const Options& options) { return options.family.recipe.empty() ? restyle(options) : restyle_family(options); }},
    {"simplify", "outlines in the fewest lines and curves within a tolerance",
     [](CLI::App& app, Options& options) {
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT, .otf with cubics; may be FONT itself")
           ->required();
       app.add_option("--tolerance", options.simplify.tolerance,
                      "two-sided distance allowed, thousandths of the em; 1 unless given");
       app.add_option("--extrema", options.simplify.extrema, "keep: extrema are nodes; free: nodes are anywhere");
       app.add_option("--curve", options.simplify.curve, "same, cubic or quadratic");
       app.add_option("--report", options.simplify.report, "what became of every glyph, JSON");
       app.add_flag("--strict", options.simplify.strict, "any refused glyph: exit status 1 and no output");
     },
     [](const Options& options) {
       commands::SimplifyRequest simplify = options.simplify;
       simplify.output = options.output;
       return commands::simplify(options.request, simplify);
     }},
    {"check", "where outlines meet themselves or each other; exit status 1 if anywhere", [](CLI::App&, Options&) {},
     [](const Options& options) { return commands::check(options.request); }},
    {"area measure", "exact areas, moments and lengths of glyphs, as a baseline to compare with",
     [](CLI::App& app, Options& options) {
       add_output(app, options, "the baseline, JSON; tolerances written into an old one are kept");
       app.add_option("--metrics", options.measure_area.metrics,
                      "area: area, moments, length, advance; all: ink and detail by octaves of size too");
     },
     [](const Options& options) {
       commands::MeasureAreaRequest measure = options.measure_area;
       measure.output = options.output;
       measure.locations = options.locations;
       return commands::measure_area(options.request, measure);
     },
     true},
    {"area check", "glyphs whose area or outline is not that of a baseline; exit status 1 if any",
     [](CLI::App& app, Options& options) {
       app.remove_option(app.get_option("FONT"));
       app.add_option("BASE", options.check_area.baseline, "the baseline, JSON, by `area measure`")->required();
       add_font(app, options);
       app.add_option("--tolerance-percent", options.check_area.tolerance_percent,
                      "change of area allowed, of a glyph and of each of its contours; 0.1 unless given");
       app.add_option("--tolerance-units", options.check_area.tolerance_units,
                      "the same in square font units, where that is more; 0 unless given");
       app.add_option("--tolerance-move", options.check_area.tolerance_move,
                      "change of an outline allowed that keeps its area, thousandths of the em; 0.25 unless given");
       app.add_option(
           "--tolerance-curve", options.check_area.tolerance_curve,
           "distance of outlines whose curves are of another kind now, thousandths of the em; 1 unless given");
       app.add_flag("--area-only", options.check_area.area_only, "outlines may change while areas stay");
       app.add_flag("--rescale", options.check_area.rescale, "another number of units to the em is no finding");
       app.add_option("--against", options.check_area.against, "the font before, for the pictures of --html");
       add_reports(app, options);
     },
     [](const Options& options) {
       if (!options.locations.empty()) throw RequestError("--location: the baseline says at which places to compare");
       commands::CheckAreaRequest check = options.check_area;
       check.report = options.report;
       return commands::check_area(options.request, check);
     },
     true},
    {"area audit", "colour of glyphs against n, H and the median, of one font or a family side by side",
     [](CLI::App& app, Options& options) {
       app.remove_option(app.get_option("FONT"));
       app.add_option("FONT", options.audit_area.fonts, "fonts: TTF, OTF, TTC, OTC, WOFF, WOFF2 or UFO folders")
           ->required();
       app.add_option("--frequencies", options.audit_area.frequencies,
                      "how often letters occur in text, JSON: {\"a\": 8.2, ..}; of English unless given");
       add_reports(app, options);
     },
     [](const Options& options) {
       commands::AuditAreaRequest audit = options.audit_area;
       audit.report = options.report;
       audit.locations = options.locations;
       return commands::audit_area(options.request, audit);
     },
     true},
    {"character extract", "the detail of glyphs below a feature size, as a library",
     [](CLI::App& app, Options& options) {
       add_output(app, options, "the library, JSON")->required();
       app.get_option("FONT")->required(false);
       app.add_option("--scale", options.extract.scale, "feature size below which it is detail, font units");
       app.add_option("--procedural", options.extract.procedural,
                      "no font, but a rule: noise, wave, saw, scallop or ink, and its parameters: noise,amplitude=2");
       app.add_option("--drawing", options.extract.drawing, "the strokes of an SVG, or of a text of points x,y");
       app.add_option("--unit", options.extract.unit, "font units that a unit of the drawing is long; 1 unless given");
       app.add_option(
              "--like", options.extract.like,
              "two fonts, plain and textured: what differs, glyph by glyph; with --from and --to an edit of one "
              "stretch, for `character repeat`")
           ->expected(2);
       app.add_option("--glyph", options.extract.glyph, "the glyph to take it from; else --glyphs, --text or all");
       app.add_option("--contour", options.extract.contour, "of the glyph only this contour, from 0")
           ->check(CLI::NonNegativeNumber);
       app.add_option("--from", options.extract.from, "of the contour only the stretch from near x,y forward");
       app.add_option("--to", options.extract.to, "to near x,y");
       app.add_option("--frame", options.extract.frame,
                      "tangent: detail turns with the outline; scaled tangent: and grows with it; xy: neither");
       app.add_option("--name", options.extract.name, "what the library is called");
     },
     [](const Options& options) {
       commands::ExtractRequest extract = options.extract;
       extract.output = options.output;
       return commands::extract_character(options.request, extract);
     }},
    {"character apply", "a library of detail laid on a font",
     [](CLI::App& app, Options& options) {
       app.add_option("LIBRARY", options.apply.library, "the library, JSON")->required();
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT; may be FONT itself")->required();
       app.add_option("--gain", options.apply.gain, "1: as it is; 0: the glyphs' own detail goes, and none comes");
       app.add_option("--seed", options.apply.seed, "where on the outlines it falls; 1 unless given");
       app.add_flag("--mirror", options.apply.mirrors, "run it the other way");
       app.add_flag("--add", options.apply.adds, "to the glyphs' own detail, instead of in its place");
       app.add_flag("--spare-straights", options.apply.spares_straights, "straight stems stay as they are");
       app.add_flag("--hold-joins", options.apply.holds_joins, "smooth joins stay where they are");
       app.add_option("--tolerance", options.apply.tolerance,
                      "distance allowed between the textured outline and its curves, font units; 0.5 unless given");
       app.add_option("--points", options.apply.points,
                      "points that a glyph may have: the finest features are left out until it has no more")
           ->check(CLI::Range(1, 65535));
       add_findings(app, options);
     },
     [](const Options& options) {
       return commands::apply_character(options.request, options.apply, restyled_by(options.apply.library, options));
     }},
    {"character repeat", "an edit of one stretch, a serif, put wherever outlines run alike",
     [](CLI::App& app, Options& options) {
       app.add_option("EDIT", options.repeat.library, "the edit, JSON, by `character extract --like`")->required();
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT; may be FONT itself")->required();
       app.add_option("--within", options.repeat.within,
                      "how far from its own a stretch may be, thousandths of the em; 4 unless given");
       app.add_flag("!--no-mirror", options.repeat.mirrors, "not its mirror images");
       app.add_flag("--turn", options.repeat.turns, "turned by any angle too");
       app.add_option("--sizes", options.repeat.sizes, "smallest and largest size that it may have: 0.8 1.2")
           ->expected(2);
       add_findings(app, options);
     },
     [](const Options& options) {
       return commands::repeat_character(options.request, options.repeat, restyled_by(options.repeat.library, options));
     }},
    {"weight learn", "the step from a weight to another, from a few letters drawn in both",
     [](CLI::App& app, Options& options) {
       app.add_option("BOLD", options.learn_weight.bold, "the other weight")->required();
       app.add_option("--control", options.learn_weight.controls, "letters to learn from: n,o,H,O")->required();
       add_output(app, options, "the model, JSON")->required();
       app.add_option(
           "--prior", options.learn_weight.prior,
           "what other families say of single letters: JSON of weight_prior, or none; built in unless given");
     },
     [](const Options& options) {
       commands::LearnWeightRequest learn = options.learn_weight;
       learn.output = options.output;
       return commands::learn_weight(options.request, learn);
     }},
    {"weight apply", "a learnt step put on glyphs of the same or another family",
     [](CLI::App& app, Options& options) {
       app.add_option("MODEL", options.apply_weight.model, "what weight learn has written")->required();
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT; may be FONT itself")->required();
       glyphs::WeightStrength& strength = options.apply_weight.strength;
       app.add_option("--amount", strength.amount, "of the step, -1 to 2; 1 unless given, 0 changes nothing");
       app.add_option("--amount-x", strength.x, "of upright strokes and widths, instead of the amount");
       app.add_option("--amount-y", strength.y, "of level strokes and heights, instead of the amount");
       app.add_option("--amount-thin", strength.thin, "of thin strokes of a contrasted face");
       app.add_option("--amount-serif", strength.serif, "of serifs");
       app.add_option("--stem-x", strength.stems.upright, "how thick the stem of n is to be, font units");
       app.add_option("--stem-y", strength.stems.level, "how thick the top and bottom of o are to be, font units");
       app.add_flag("--carry", options.apply_weight.carries,
                    "FONT is of another family than the model: heights and counters are its own");
       app.add_option("--fit-amount", options.apply_weight.fit_to,
                      "a font of FONT's family with n and o in the weight wanted: carries, and fits the step to them");
       app.add_option("--detail", options.apply_weight.detail_scale,
                      "texture below this size rides along unthickened, font units");
       app.add_option("--italic-angle", options.apply_weight.italic_angle,
                      "what vertical means, degrees leaning right");
       app.add_option("--advance", options.apply_weight.advance,
                      "keep: advances stay; sidebearings: these stay; scale: all advances times one ratio; learnt: "
                      "sidebearings grow as those of the control letters");
       app.add_option("--emit", options.apply_weight.emission,
                      "structure: every glyph's own points; compact: the fewest segments");
       app.add_option("--tolerance", options.apply_weight.tolerance,
                      "deviation allowed to compact emission, font units; 0.5 unless given");
       app.add_option("--report", options.apply_weight.report, "what became of every glyph, JSON");
       app.add_option("--proof", options.apply_weight.proof,
                      "changed glyphs before and after, .png, .pdf or .svg; with --against beside the drawn ones");
       app.add_option("--against", options.apply_weight.against,
                      "a font where the weight is drawn: how far each glyph is from it, worst first");
       app.add_flag("--strict", options.apply_weight.strict, "any refused glyph: exit status 1 and no output");
     },
     [](const Options& options) {
       commands::ApplyWeightRequest apply = options.apply_weight;
       apply.output = options.output;
       return commands::apply_weight(options.request, apply);
     }},
    {"convert", "a font as another kind of file: TrueType as OpenType and back, either as a UFO, one glyph as an SVG",
     [](CLI::App& app, Options& options) {
       app.add_option("OUT", options.convert.output, "the new file, .otf, .ttf, .ufo or .svg")->required();
       app.add_flag("--fractional", options.convert.fractional,
                    "keep fractions of coordinates, in steps of 1/65536, where quadratics become cubics");
       app.add_flag("--strict", options.convert.strict, "any glyph that cannot be read: exit status 1 and no output");
       app.add_option("--tolerance", options.convert.tolerance,
                      "two-sided distance allowed where the kind of curve changes, thousandths of the em; 1 unless "
                      "given, with --fractional 0; 0: the same curves, quadratics to cubics only");
     },
     [](const Options& options) { return commands::convert(options.request, options.convert); }},
    {"proof", "a picture of set text or of single glyphs, before and after overlaid",
     [](CLI::App& app, Options& options) {
       add_output(app, options, "the picture, .png, .pdf or .svg")->required();
       app.add_option("--against", options.proof.against, "the font before");
       app.add_option("--show", options.proof.show,
                      "nodes, crossings, comb (curvature; comb=LENGTH: of its teeth in ems where the radius is an em), "
                      "level=LENGTH (font units; repeatable)")
           ->delimiter(',');
       app.add_option("--sizes", options.proof.sizes, "pixels per em; several: a waterfall of --text; 160 unless given")
           ->delimiter(',');
     },
     [](const Options& options) {
       commands::ProofRequest proof = options.proof;
       proof.output = options.output;
       proof.locations = options.locations;
       return commands::proof(options.request, proof);
     },
     true},
}};

/// What commands of two words have in common.
const std::map<std::string, std::string> kinds = {
    {"area", "areas of glyphs"},
    {"character", "detail below a feature size, taken from one place and put elsewhere"},
    {"weight", "a step of weight learnt from a few letters and put on others"},
};

void add_common_options(CLI::App& app, Options& options) {
  Request& request = options.request;
  add_font(app, options);
  app.add_option("--glyphs", request.glyphs,
                 "names, code points and ranges (U+0041-005A), gid:12, @file; comma separated; repeatable")
      ->allow_extra_args(false);
  app.add_option("--text", request.text, "the glyphs that setting this text needs");
  app.add_option("--features", request.shaping.features, "OpenType features for --text: smcp,-liga");
  app.add_option("--script", request.shaping.script, "script for --text: Latn");
  app.add_option("--language", request.shaping.language, "language for --text: de");
  app.add_option("--direction", request.shaping.direction, "ltr, rtl, ttb, btt");
  app.add_option("--face", request.face, "which font of a collection")->check(CLI::NonNegativeNumber);
  app.add_option("-j,--jobs", request.jobs.jobs, "threads; 0: all cores")->check(CLI::NonNegativeNumber);
  app.add_flag("--json", request.json, "the result as JSON on standard output");
  app.add_flag("-q,--quiet", request.quiet, "no progress, no summary");
  app.add_flag("--no-progress", options.no_progress, "no progress");
  app.add_option("--location", options.locations, "where in a variable font to look: wght=650,wdth=80")
      ->allow_extra_args(false);
}

Outcome run(const Command& command, Options& options) {
  if (options.locations.size() > 1 && !command.takes_places) throw RequestError("--location: one place at a time");
  for (const std::string& location : options.locations)
    if (location.empty()) throw RequestError("--location: names no place; wght=650 would be one");
  if (!options.locations.empty()) options.request.location = options.locations[0];
  Progress progress(std::string("glyphwave ") + command.name);
  if (!options.no_progress && !options.request.quiet)
    options.request.jobs.progress = [&](int done, int total) { progress.show(done, total); };
  return command.run(options);
}

/// Standard output, whole; a full disk is an error like any other.
void print(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    throw std::runtime_error(std::string("standard output: ") + std::strerror(errno));
}

int run_program(int count, char** arguments) {
  CLI::App app("Designs with font outlines: broad shape moved, detail kept, area held.", "glyphwave");
  app.set_version_flag("--version", "glyphwave " GLYPHWAVE_VERSION);
  app.require_subcommand(1);
  Options options;
  Outcome outcome;
  for (const Command& command : table) {
    const std::string name = command.name;
    const std::size_t space = name.find(' ');
    CLI::App* parent = &app;
    if (space != std::string::npos) {
      const std::string kind = name.substr(0, space);
      const auto known = app.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == kind; });
      parent = known.empty() ? app.add_subcommand(kind, kinds.at(kind)) : known[0];
      parent->require_subcommand(1);
    }
    CLI::App* const sub = parent->add_subcommand(name.substr(space == std::string::npos ? 0 : space + 1), command.help);
    // FONT stands before a command's own arguments.
    add_common_options(*sub, options);
    command.add_options(*sub, options);
    sub->callback([&] { outcome = run(command, options); });
  }
  try {
    app.parse(count, arguments);
  } catch (const CLI::Success& asked) {  // --help, --version
    std::ostringstream out;
    app.exit(asked, out, out);
    print(out.str());
    return 0;
  } catch (const CLI::RequiredError& error) {
    // A word that is no command is the likelier mistake.
    const std::vector<std::string> rest = app.remaining(true);
    throw RequestError(rest.empty() ? error.what() : rest[0] + ": unknown; " + error.what());
  } catch (const CLI::ParseError& error) {
    throw RequestError(error.what());
  }
  if (!outcome.complaint.empty()) complain(outcome.complaint);
  print(outcome.text);
  return outcome.status;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    glyphs::secure_standard_descriptors();
    return run_program(count, arguments);
  } catch (const std::bad_alloc&) {
    complain("out of memory");
  } catch (const std::exception& error) {
    complain(error.what());
  }
  return misuse;
}
