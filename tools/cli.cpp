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
  commands::RestyleRequest restyle;
  std::string family_recipe;
  std::string output_dir;
  commands::SimplifyRequest simplify;
  commands::LearnWeightRequest learn_weight;
  commands::ApplyWeightRequest apply_weight;
  std::string advance;
  commands::ConvertRequest convert;
  commands::ProofRequest proof;
};

/// One subcommand: its name and words, its own options, what it does.
struct Command {
  const char* name;
  const char* help;
  void (*add_options)(CLI::App&, Options&);
  Outcome (*run)(const Options&);
};

CLI::Option* add_output(CLI::App& app, Options& options, const char* help) {
  return app.add_option("-o,--output", options.output, help);
}

/// Options and commands that CLI users know and this version lacks are refused by name, not as unknown.
[[noreturn]] void refuse(const std::string& what) { throw RequestError(what + ": not in this version"); }

constexpr std::array<Command, 9> table{{
    {"inspect", "per glyph and contour: points, segments, corners, model, area, length", [](CLI::App&, Options&) {},
     [](const Options& options) { return commands::inspect(options.request); }},
    {"restyle", "apply a recipe to a font or a UFO",
     [](CLI::App& app, Options& options) {
       app.add_option("RECIPE", options.restyle.recipe, "the recipe, JSON");
       add_output(app, options, "the new font, .ttf, .otf or .ufo as FONT; may be FONT itself");
       app.add_option("--report", options.restyle.report, "what became of every glyph, JSON");
       app.add_option("--proof", options.restyle.proof, "changed glyphs before and after, .png, .pdf or .svg");
       app.add_flag("--strict", options.restyle.strict, "any refused glyph: exit status 1 and no output");
       app.add_option("--recipe", options.family_recipe)->group("");
       app.add_option("--output-dir", options.output_dir)->group("");
     },
     [](const Options& options) {
       if (!options.family_recipe.empty()) refuse("restyle --recipe");
       if (!options.output_dir.empty()) refuse("restyle --output-dir");
       if (options.restyle.recipe.empty()) throw RequestError("restyle: RECIPE is required");
       if (options.output.empty()) throw RequestError("restyle: --output is required");
       commands::RestyleRequest restyle = options.restyle;
       restyle.output = options.output;
       return commands::restyle(options.request, restyle);
     }},
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
    {"area measure", "exact signed area of every glyph",
     [](CLI::App& app, Options& options) { add_output(app, options, "the baseline, JSON"); },
     [](const Options& options) { return commands::measure_area(options.request, options.output); }},
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
       app.add_option("--amount", options.apply_weight.amount,
                      "of the step, -1 to 2; 1 unless given, 0 changes nothing");
       app.add_option("--italic-angle", options.apply_weight.italic_angle,
                      "what vertical means, degrees leaning right");
       app.add_option("--advance", options.advance, "keep: advances stay");
       app.add_option("--report", options.apply_weight.report, "what became of every glyph, JSON");
       app.add_flag("--strict", options.apply_weight.strict, "any refused glyph: exit status 1 and no output");
     },
     [](const Options& options) {
       if (!options.advance.empty() && options.advance != "keep") refuse("weight apply --advance " + options.advance);
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
       app.add_option("--show", options.proof.show, "nodes, crossings, level=LENGTH (font units)")->delimiter(',');
     },
     [](const Options& options) {
       commands::ProofRequest proof = options.proof;
       proof.output = options.output;
       return commands::proof(options.request, proof);
     }},
}};

void add_common_options(CLI::App& app, Options& options) {
  Request& request = options.request;
  app.add_option("FONT", request.font, "a font: TTF, OTF, TTC, OTC, WOFF, WOFF2 or a UFO folder")->required();
  app.add_option("--glyphs", request.glyphs,
                 "names, code points and ranges (U+0041-005A), gid:12, @file; comma separated; repeatable");
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
  app.add_option("--location", options.locations, "where in a variable font to look: wght=650,wdth=80");
}

Outcome run(const Command& command, Options& options) {
  if (options.locations.size() > 1) throw RequestError("--location: one place at a time");
  if (!options.locations.empty()) {
    if (options.locations[0].empty()) throw RequestError("--location: names no place; wght=650 would be one");
    options.request.location = options.locations[0];
  }
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
  std::map<std::string, CLI::App*> groups;
  for (const auto& [name, help] : {std::pair("area", "areas of glyphs: area measure FONT"),
                                   std::pair("weight", "weight learnt from a pair, put on other glyphs")}) {
    groups[name] = app.add_subcommand(name, help)->require_subcommand(1);
  }
  for (const char* later : {"check", "audit"})
    groups["area"]->add_subcommand(later, "not in this version")->allow_extras()->group("")->callback([later] {
      refuse(std::string("area ") + later);
    });
  for (const Command& command : table) {
    const std::string name = command.name;
    const std::size_t space = name.find(' ');
    CLI::App* parent = space == std::string::npos ? &app : groups.at(name.substr(0, space));
    CLI::App* sub = parent->add_subcommand(name.substr(space + 1), command.help);
    // FONT stands before a command's own arguments.
    add_common_options(*sub, options);
    command.add_options(*sub, options);
    sub->callback([&] { outcome = run(command, options); });
  }
  for (const char* later : {"character"})
    app.add_subcommand(later, "not in this version")->allow_extras()->group("")->callback([later] { refuse(later); });

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
