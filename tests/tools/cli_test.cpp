#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/bundled_fonts.h"
#include "tests/tools/program.h"

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

using Folder = TestFolder;

/// All files below a folder, by their paths in it.
std::map<std::string, std::string> tree(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = contents(entry.path());
  return files;
}

const std::string& serif = bundled_ttf[0];
const std::string letters_list = "U+0041-005A,U+0061-007A";

/// A recipe that moves the given glyphs by `strength` of a visible amount.
std::string recipe_for(const std::string& glyphs, double strength, const std::string& more = "") {
  const json step{{"op", "sweep"}, {"near", {700, 450}}, {"move", {30 * strength, 0}}, {"breadth", 600}};
  json recipe{{"glyphs", glyphs}, {"steps", json::array({step})}};
  if (!more.empty()) recipe.update(json::parse(more));
  return recipe.dump();
}

}  // namespace

TEST_CASE("help and version go to standard output with status 0", "[cli]") {
  const Run version = glyphwave({"--version"});
  CHECK(version.status == 0);
  CHECK_THAT(version.out, Catch::StartsWith("glyphwave "));
  const Run help = glyphwave({"--help"});
  CHECK(help.status == 0);
  for (const char* command : {"inspect", "restyle", "check", "area", "proof"})
    CHECK_THAT(help.out, Catch::Contains(command));
  const Run of_command = glyphwave({"restyle", "--help"});
  CHECK(of_command.status == 0);
  CHECK_THAT(of_command.out, Catch::Contains("--strict"));
}

TEST_CASE("misuse is one line and status 2", "[cli]") {
  check_refusal(glyphwave({}), {});
  check_refusal(glyphwave({"frobnicate"}), {"frobnicate"});
  check_refusal(glyphwave({"inspect"}), {"FONT"});
  check_refusal(glyphwave({"inspect", serif, "--colour"}), {"--colour"});
  check_refusal(glyphwave({"inspect", serif, "-j", "-1"}), {"-1"});
  check_refusal(glyphwave({"inspect", serif, "-j", "many"}), {"many"});
  check_refusal(glyphwave({"inspect", serif, "--face", "1"}), {"LiberationSerif-Regular.ttf"});
  check_refusal(glyphwave({"inspect", serif, "--glyphs", "a", "--text", "a"}), {"--glyphs", "--text"});
}

TEST_CASE("places of a font that has none, and numbers that are none, are refused by name", "[cli]") {
  check_refusal(glyphwave({"inspect", serif, "--location", "wght=650"}), {serif, "is not variable"});
  check_refusal(glyphwave({"inspect", serif, "--location", "wght=bold"}), {"--location", "is no number"});
  check_refusal(glyphwave({"inspect", serif, "--location", ""}), {"--location", "names no place"});
  check_refusal(glyphwave({"inspect", serif, "--location", "wght=1", "--location", "wght=2"}), {"one place at a time"});
  const Folder folder;
  put(folder / "r.json", recipe_for("a", 1));
  check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.otf"}), {"o.otf"});
  CHECK(folder.files() == std::vector<std::string>{"r.json"});
}

TEST_CASE("detail goes from one font to another, by command or recipe", "[cli]") {
  const Folder folder;
  const std::string library = folder / "hand.json";
  const Run extract = glyphwave({"character", "extract", serif, "--glyph", "s", "--scale", "200", "-o", library});
  CHECK(extract.status == 0);
  CHECK(extract.out.find("of \"s\"") != std::string::npos);
  put(folder / "r.json",
      R"({"glyphs": "o", "seed": 1, "steps": [{"op": "character", "library": "hand.json", "gain": 2}]})");
  const Run recipe = glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "one.ttf", "-q"});
  CHECK(recipe.status == 0);
  const Run apply =
      glyphwave({"character", "apply", serif, library, "--glyphs", "o", "--gain", "2", "-o", folder / "two.ttf", "-q"});
  CHECK(apply.status == 0);
  CHECK(contents(folder / "one.ttf") == contents(folder / "two.ttf"));
  CHECK(contents(folder / "one.ttf") != contents(serif));
  check_refusal(glyphwave({"character"}), {"subcommand"});
  check_refusal(glyphwave({"character", "extract", serif, "--scale", "0", "-o", library}), {"--scale 0"});
  check_refusal(glyphwave({"character", "extract", serif, "--glyph", "o", "--scale", "5000", "-o", folder / "x.json"}),
                {"5000", "no detail"});
  check_refusal(glyphwave({"character", "extract", serif, "--glyph", "o", "--from", "1", "--to", "2,3", "--scale", "80",
                           "-o", folder / "x.json"}),
                {"--from 1"});
  check_refusal(glyphwave({"character", "apply", serif, folder / "r.json", "-o", folder / "x.ttf"}),
                {"r.json", "version: is missing"});
  put(folder / "r.json", R"({"steps": [{"op": "character", "library": "none.json"}]})");
  check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "x.ttf"}), {"none.json"});
}

TEST_CASE("a library comes from a rule, from a drawing or from two fonts", "[cli]") {
  const Folder folder;
  const std::string library = folder / "l.json";
  REQUIRE(glyphwave({"character", "extract", "--procedural", "wave,amplitude=3", "-o", library}).status == 0);
  CHECK(json::parse(contents(library))["scale"] == 75);
  REQUIRE(glyphwave({"character", "apply", serif, library, "--glyphs", "o", "-o", folder / "w.ttf", "-q"}).status == 0);
  CHECK(contents(folder / "w.ttf") != contents(serif));
  const Run learnt = glyphwave(
      {"character", "extract", "--like", serif, folder / "w.ttf", "--glyph", "o", "--scale", "160", "-o", library});
  REQUIRE(learnt.status == 0);
  CHECK(learnt.out.find("2 samples") != std::string::npos);
  CHECK(json::parse(contents(library))["by_shape"] == true);
  const std::string drawing = bundled_font("drawings/dry_brush.svg");
  REQUIRE(glyphwave({"character", "extract", "--drawing", drawing, "--scale", "110", "-o", library}).status == 0);
  CHECK(json::parse(contents(library))["unitsPerEm"] == 1000);
  REQUIRE(
      glyphwave({"character", "extract", serif, "--drawing", drawing, "--unit", "2", "--scale", "220", "-o", library})
          .status == 0);
  CHECK(json::parse(contents(library))["unitsPerEm"] == 2048);

  const auto refused = [&](std::vector<std::string> arguments, const std::string& what) {
    arguments.insert(arguments.begin(), {"character", "extract", "-o", folder / "x.json"});
    check_refusal(glyphwave(arguments), {what});
  };
  refused({}, "FONT is required");
  refused({"--procedural", "waves"}, "waves");
  refused({"--procedural", "wave,height=3"}, "height");
  refused({"--procedural", "wave,amplitude"}, "wave: amplitude");
  refused({"--procedural", "wave,amplitude=-1"}, "amplitude");
  refused({"--procedural", "noise,seed=0.5"}, "seed");
  refused({"--procedural", "wave", "--scale", "90"}, "--scale");
  refused({serif, "--procedural", "wave"}, "without FONT");
  refused({"--procedural", "wave", "--drawing", drawing}, "one source at a time");
  refused({"--drawing", drawing}, "--scale 0");
  refused({"--drawing", drawing, "--scale", "9000"}, "9000");
  refused({"--drawing", serif, "--scale", "90"}, "line 1");
  refused({"--drawing", drawing, "--scale", "90", "--unit", "0"}, "--unit 0");
  refused({"--like", serif, bundled_otf[0], "--glyph", "o", "--scale", "90", "--contour", "7"}, "no arc in common");
  CHECK_FALSE(fs::exists(folder / "x.json"));
}

TEST_CASE("an edit of one foot goes to the feet that run alike", "[cli]") {
  const Folder folder;
  put(folder / "r.json",
      R"({"glyphs": "n", "steps": [{"op": "sweep", "glyph": "n", "near": [993, 22], "move": [30, 0], "breadth": 120}],
          "keep": {"area": "none"}})");
  REQUIRE(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "e.ttf", "-q"}).status == 0);
  const std::string edit = folder / "edit.json";
  const Run extract = glyphwave({"character", "extract", "--like", serif, folder / "e.ttf", "--glyph", "n", "--from",
                                 "879,300", "--to", "713,300", "-o", edit});
  REQUIRE(extract.status == 0);
  CHECK(extract.out.find("moves up to 30") != std::string::npos);
  REQUIRE(glyphwave({"character", "repeat", serif, edit, "--text", "hnoq", "-o", folder / "two.ttf", "--report",
                     folder / "report.json", "-q"})
              .status == 0);
  std::map<std::string, int> places;
  const json report = json::parse(contents(folder / "report.json"));
  for (const json& glyph : report["glyphs"]) {
    for (const json& step : glyph["steps"]) places[glyph["name"]] += step["places"].get<int>();
  }
  CHECK(places == std::map<std::string, int>{{"h", 2}, {"n", 2}, {"o", 0}, {"q", 1}});
  REQUIRE(glyphwave({"character", "repeat", serif, edit, "--glyphs", "n", "--no-mirror", "--within", "2", "-o",
                     folder / "one.ttf", "-q"})
              .status == 0);
  CHECK(contents(folder / "one.ttf") == contents(folder / "e.ttf"));

  check_refusal(glyphwave({"character", "repeat", serif, edit, "--within", "0", "-o", folder / "x.ttf"}), {"--within"});
  check_refusal(glyphwave({"character", "repeat", serif, edit, "--sizes", "2", "1", "-o", folder / "x.ttf"}),
                {"--sizes"});
  check_refusal(glyphwave({"character", "repeat", serif, folder / "r.json", "-o", folder / "x.ttf"}),
                {"r.json", "version"});
  check_refusal(glyphwave({"character", "apply", serif, edit, "-o", folder / "x.ttf"}), {"edit.json", "kind"});
  check_refusal(glyphwave({"character", "extract", "--like", serif, serif, "--from", "1,2", "--to", "3,4", "-o",
                           folder / "x.json"}),
                {"one glyph"});
}

TEST_CASE("a font that is none is refused in one line that names it, for every command", "[cli]") {
  const Folder folder;
  const std::string font = contents(serif);
  put(folder / "text.ttf", "this is not a font\n");
  put(folder / "empty.ttf", "");
  put(folder / "cut.ttf", font.substr(0, font.size() / 2));
  put(folder / "head.ttf", font.substr(0, 300));
  fs::create_directory(folder / "folder.ttf");
  put(folder / "r.json", recipe_for("a", 1));
  const auto before = folder.files();
  for (const char* name : {"text.ttf", "empty.ttf", "cut.ttf", "head.ttf", "folder.ttf", "missing.ttf"}) {
    CAPTURE(name);
    const std::string bad = folder / name;
    check_refusal(glyphwave({"inspect", bad}), {name});
    check_refusal(glyphwave({"check", bad}), {name});
    check_refusal(glyphwave({"area", "measure", bad, "-o", folder / "base.json"}), {name});
    check_refusal(glyphwave({"proof", bad, "--text", "a", "-o", folder / "p.png"}), {name});
    check_refusal(glyphwave({"restyle", bad, folder / "r.json", "-o", folder / "o.ttf", "--report", folder / "o.json"}),
                  {name});
  }
  CHECK(folder.files() == before);
}

TEST_CASE("a recipe that cannot be honoured is refused and an old output is untouched", "[cli]") {
  const Folder folder;
  const std::string old = "an old output";
  put(folder / "o.ttf", old);
  put(folder / "report.json", old);
  put(folder / "proof.png", old);
  const std::vector<std::pair<std::string, std::string>> recipes{
      {"{", "r.json"},
      {"[]", "r.json"},
      {R"({"glyphs": "a", "steps": [], "colour": 1})", "colour"},
      {R"({"glyphs": "a", "steps": [{"op": "sweep", "glyph": "a", "near": [1, 2], "move": [1, 1], "breadth": 100,
           "wobble": 2}]})",
       "wobble"},
      {R"({"glyphs": "a", "steps": [{"op": "melt"}]})", "melt"},
      {R"({"glyphs": "a", "steps": [{"op": "weight", "model": "m.json"}]})", "m.json"},
      {R"({"glyphs": "nosuchglyph", "steps": []})", "nosuchglyph"},
      {R"({"glyphs": "a", "steps": [{"op": "sweep", "glyph": "a", "contour": 7, "near": [1, 2], "move": [1, 1],
           "breadth": 100}]})",
       "7"},
      {R"({"glyphs": "a", "steps": [], "emit": {"mode": "small"}})", "small"},
  };
  for (const auto& [text, word] : recipes) {
    CAPTURE(text);
    put(folder / "r.json", text);
    check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--report",
                             folder / "report.json", "--proof", folder / "proof.png"}),
                  {word});
  }
  check_refusal(glyphwave({"restyle", serif, folder / "missing.json", "-o", folder / "o.ttf"}), {"missing.json"});
  check_refusal(glyphwave({"restyle", serif, folder / "", "-o", folder / "o.ttf"}), {});
  CHECK(contents(folder / "o.ttf") == old);
  CHECK(contents(folder / "report.json") == old);
  CHECK(contents(folder / "proof.png") == old);
  CHECK(folder.files() == std::vector<std::string>{"o.ttf", "proof.png", "r.json", "report.json"});
}

TEST_CASE("outputs are written all or none", "[cli]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("a", 1));
  const Run lost = glyphwave(
      {"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--report", folder / "no/such/folder/report.json"});
  check_refusal(lost, {"report.json"});
  check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--report", folder / "o.ttf"}),
                {"o.ttf"});
  check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--report", folder / "r.json"}),
                {"r.json"});
  check_refusal(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--proof", folder / "p.bmp"}),
                {"p.bmp"});
  CHECK(folder.files() == std::vector<std::string>{"r.json"});
}

TEST_CASE("a family is restyled by one recipe, each font as alone", "[cli]") {
  const Folder folder;
  REQUIRE(glyphwave({"convert", bundled_otf[0], folder / "Cabin.ufo", "-q"}).status == 0);
  put(folder / "r.json", R"({"glyphs": "U+0061-007A", "unit": "em/1000", "steps": [{"op": "smooth", "scale": 150}]})");
  const std::vector<std::string> fonts{bundled_ttf[0], bundled_otf[2], folder / "Cabin.ufo"};
  const auto restyle = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"restyle", "--recipe", folder / "r.json", "--output-dir", folder / out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    arguments.insert(arguments.end(), fonts.begin(), fonts.end());
    return glyphwave(arguments);
  };
  const Run one = restyle("one", {"--report", folder / "one.json", "--proof", folder / "one.pdf", "-j", "1"});
  CAPTURE(one.out, one.err);
  REQUIRE(one.status == 0);
  CHECK(one.err.empty());
  CHECK(std::count(one.out.begin(), one.out.end(), '\n') == 5);  // a line a font, the sum, what was written
  CHECK_THAT(one.out, Catch::Contains(fonts[2] + ": ") && Catch::Contains("3 fonts: ") &&
                          Catch::Contains(" of 78 selected glyphs changed") && Catch::Contains("0 refused"));
  const Run two =
      restyle("two/deep", {"--report", folder / "two.json", "--proof", folder / "two.pdf", "-j", "2", "-q"});
  REQUIRE(two.status == 0);
  CHECK(two.out.empty());
  CHECK(tree(folder / "one") == tree(folder / "two/deep"));
  CHECK(contents(folder / "one.json") == contents(folder / "two.json"));
  CHECK(contents(folder / "one.pdf") == contents(folder / "two.pdf"));
  CHECK(restyle("two/deep", {"--json"}).out == contents(folder / "one.json"));
  for (const std::string& font : fonts) {
    CAPTURE(font);
    const std::string name = fs::path(font).filename().string();
    const std::string alone = folder / ("alone" + fs::path(font).extension().string());
    REQUIRE(glyphwave({"restyle", font, folder / "r.json", "-o", alone, "-q"}).status == 0);
    if (fs::is_directory(alone)) {
      CHECK(tree(alone) == tree(folder / "one/" + name));
    } else {
      CHECK(contents(alone) == contents(folder / "one/" + name));
    }
  }
  const Run narrowed = restyle("o", {"--glyphs", "o", "--glyphs", "n", "--json"});
  REQUIRE(narrowed.status == 0);
  const json report = json::parse(narrowed.out);
  for (const auto& font : report["fonts"]) CHECK(font["glyphs"].size() == 2);
  CHECK(json::parse(restyle("t", {"--text", "oo", "--json"}).out)["fonts"][1]["glyphs"][0]["name"] == "o");
}

TEST_CASE("a font of a family whose ending is not that of its outlines is refused", "[cli]") {
  const Folder folder;
  put(folder / "r.json", R"({"steps": []})");
  fs::copy_file(serif, folder / "F.otf");
  check_refusal(glyphwave({"restyle", "--recipe", folder / "r.json", "--output-dir", folder / "x", folder / "F.otf"}),
                {"F.otf", "the output's ending is .ttf"});
  CHECK_FALSE(fs::exists(folder / "x"));
}

TEST_CASE("a family that is refused in one font is refused in one line, and nothing is written", "[cli]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("a", 1));
  put(folder / "broken.ttf", "no font");
  fs::create_directory(folder / "old");
  put(folder / "old/LiberationSerif-Regular.ttf", "old");
  const std::string recipe = folder / "r.json";
  const std::string old = folder / "old";
  const auto family = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"restyle", "--recipe", recipe};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return glyphwave(arguments);
  };
  check_refusal(family({"--output-dir", old}), {"FONT"});
  check_refusal(family({serif}), {"--recipe needs --output-dir"});
  check_refusal(glyphwave({"restyle", serif, recipe, "--output-dir", old}), {"--output-dir", "--recipe"});
  check_refusal(glyphwave({"restyle", serif, recipe, bundled_ttf[1], "-o", folder / "o.ttf"}),
                {"LiberationSerif-Bold.ttf", "--recipe"});
  check_refusal(family({"--output-dir", old, serif, recipe}), {"r.json", "one recipe"});
  check_refusal(family({"--output-dir", old, serif, "-o", folder / "o.ttf"}), {"--output", "--output-dir"});
  check_refusal(family({"--output-dir", old, serif, folder / "broken.ttf", folder / "missing.otf"}),
                {"broken.ttf", "missing.otf"});
  check_refusal(family({"--output-dir", old, serif, serif}), {"would both be"});
  check_refusal(family({"--output-dir", old, serif, "--report", recipe}), {"r.json", "would overwrite"});
  check_refusal(family({"--output-dir", old, serif, "--report", folder / "x", "--proof", folder / "x"}), {"x"});
  check_refusal(family({"--output-dir", old, serif, "--report", old + "/LiberationSerif-Regular.ttf"}),
                {"LiberationSerif-Regular.ttf"});
  check_refusal(family({"--output-dir", old, serif, "--proof", folder / "p.bmp"}), {"p.bmp"});
  check_refusal(family({"--output-dir", old, serif, "--proof", folder / "none/p.png"}), {"none/p.png"});
  check_refusal(family({"--output-dir", recipe, serif}), {"r.json", "Not a directory"});
  check_refusal(family({"--output-dir", folder / "new/x", serif, "--glyphs", "nosuch"}), {serif, "nosuch"});
  put(folder / "s.json", R"({"glyphs": "a,b", "keep": {"freeze": [{"glyph": "longs", "from": [0, 0], "to": [9, 9]}]},
      "steps": []})");
  check_refusal(glyphwave({"restyle", "--recipe", folder / "s.json", "--output-dir", old, serif, bundled_ttf[1]}),
                {serif, bundled_ttf[1], "longs"});
  CHECK(contents(old + "/LiberationSerif-Regular.ttf") == "old");
  CHECK(folder.files() == std::vector<std::string>{"broken.ttf", "old", "r.json", "s.json"});

  put(folder / "r.json", recipe_for("a,adieresis", 1));
  const Run strict = family({"--output-dir", old, serif, bundled_ttf[1], "--strict"});
  CHECK(strict.status == 1);
  CHECK(strict.out.empty());
  CHECK_THAT(strict.err, Catch::Contains("2 glyphs refused, nothing written: ") && Catch::Contains("adieresis ("));
  CHECK(std::count(strict.err.begin(), strict.err.end(), '\n') == 1);
  CHECK(contents(old + "/LiberationSerif-Regular.ttf") == "old");
  CHECK(fs::exists(old + "/LiberationSerif-Bold.ttf") == false);
}

TEST_CASE("restyle gives font, report and proof, the same for every number of threads", "[cli]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("a,o,e,n", 1));
  const auto run = [&](const std::string& jobs) {
    return glyphwave({"restyle", serif, folder / "r.json", "-o", folder / (jobs + ".ttf"), "--report",
                      folder / (jobs + ".json"), "--proof", folder / (jobs + ".png"), "-j", jobs});
  };
  const Run one = run("1");
  CAPTURE(one.err);
  REQUIRE(one.status == 0);
  CHECK(one.err.empty());
  CHECK(std::count(one.out.begin(), one.out.end(), '\n') <= 10);
  REQUIRE(run("2").status == 0);
  for (const char* ending : {".ttf", ".json", ".png"})
    CHECK(contents(folder / (std::string("1") + ending)) == contents(folder / (std::string("2") + ending)));
  CHECK(contents(folder / "1.ttf") != contents(serif));
  const json report = json::parse(contents(folder / "1.json"));
  CHECK(report["version"] == 1);
  CHECK(report["glyphs"].size() == 4);
  CHECK(glyphwave({"inspect", folder / "1.ttf", "--glyphs", "a,o,e,n"}).status == 0);
}

TEST_CASE("convert makes OpenType of TrueType, UFOs of both, an SVG of a glyph", "[cli]") {
  const Folder folder;
  const Run otf = glyphwave({"convert", serif, folder / "o.otf"});
  CAPTURE(otf.err);
  REQUIRE(otf.status == 0);
  CHECK_THAT(otf.out, Catch::Contains("largest deviation: 2"));  // 1/1000 em is 2.048 units
  const Run truetype = glyphwave({"convert", folder / "o.otf", folder / "back.ttf", "--json"});
  CAPTURE(truetype.err);
  REQUIRE(truetype.status == 0);
  CHECK(json::parse(truetype.out)["deviation"].get<double>() < 2.1);
  CHECK_THAT(otf.out, Catch::Contains("dropped: cvt fpgm glyf loca prep"));
  const Run exact = glyphwave({"convert", serif, folder / "exact.otf", "--fractional", "--json"});
  REQUIRE(exact.status == 0);
  const json told = json::parse(exact.out);
  CHECK(told["deviation"].get<double>() < 1e-4);
  CHECK(told["flattened"].size() > 100);
  const json before = json::parse(glyphwave({"area", "measure", serif, "--json", "--glyphs", letters_list}).out);
  const json after =
      json::parse(glyphwave({"area", "measure", folder / "exact.otf", "--json", "--glyphs", letters_list}).out);
  for (std::size_t i = 0; i < before["glyphs"].size(); ++i)  // PostScript's contours run the other way
    CHECK(-after["glyphs"][i]["area"].get<double>() == Approx(before["glyphs"][i]["area"].get<double>()).epsilon(1e-6));

  for (const std::string& font : {serif, bundled_otf[0]}) {
    CAPTURE(font);
    const Run ufo = glyphwave({"convert", font, folder / "u.ufo"});
    REQUIRE(ufo.status == 0);
    CHECK_THAT(ufo.out, Catch::Contains("GPOS"));
    const json drawn = json::parse(glyphwave({"area", "measure", font, "--json"}).out);
    const json source = json::parse(glyphwave({"area", "measure", folder / "u.ufo", "--json"}).out);
    REQUIRE(drawn["glyphs"].size() == source["glyphs"].size());
    for (std::size_t i = 0; i < drawn["glyphs"].size(); ++i) {
      CHECK(drawn["glyphs"][i]["name"] == source["glyphs"][i]["name"]);
      CHECK(drawn["glyphs"][i]["area"].get<double>() == Approx(source["glyphs"][i]["area"].get<double>()));
    }
  }
  REQUIRE(glyphwave({"convert", serif, folder / "a.svg", "--glyphs", "a"}).status == 0);
  CHECK_THAT(contents(folder / "a.svg"), Catch::StartsWith("<svg") && Catch::Contains("<path d=\"M"));

  const auto files = folder.files();
  check_refusal(glyphwave({"convert", folder / "u.ufo", folder / "x.ttf"}), {"fontmake -u", "u.ufo"});
  check_refusal(glyphwave({"convert", folder / "o.otf", folder / "x.ttf", "--tolerance", "0"}), {"o.otf", "cubics"});
  check_refusal(glyphwave({"convert", folder / "o.otf", folder / "x.ttf", "--fractional"}), {"o.otf", "tolerance"});
  check_refusal(glyphwave({"convert", serif, folder / "x.svg"}), {"LiberationSerif", "one glyph"});
  check_refusal(glyphwave({"convert", serif, folder / "x.woff"}), {"x.woff", "ending"});
  check_refusal(glyphwave({"convert", serif, folder / "x.otf", "--glyphs", "a"}), {"every glyph is converted"});
  check_refusal(glyphwave({"convert", serif, folder / "x.otf", "--tolerance", "-2"}), {"tolerance"});
  CHECK(folder.files() == files);
}

TEST_CASE("a UFO is restyled in place, and only the glyphs that changed have other bytes", "[cli]") {
  const Folder folder;
  REQUIRE(glyphwave({"convert", serif, folder / "u.ufo", "-q"}).status == 0);
  const auto before = tree(folder / "u.ufo");
  put(folder / "none.json", R"({"steps": []})");
  REQUIRE(glyphwave({"restyle", folder / "u.ufo", folder / "none.json", "-o", folder / "same.ufo"}).status == 0);
  CHECK(tree(folder / "same.ufo") == before);

  put(folder / "r.json", recipe_for("a,o", 1));
  const Run run = glyphwave({"restyle", folder / "u.ufo", folder / "r.json", "-o", folder / "u.ufo", "--report",
                             folder / "report.json", "--proof", folder / "p.png"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("files changed: glyphs/a.glif, glyphs/o.glif"));
  const auto after = tree(folder / "u.ufo");
  REQUIRE(after.size() == before.size());
  for (const auto& [name, bytes] : after) {
    CAPTURE(name);
    CHECK((bytes == before.at(name)) == (name != "glyphs/a.glif" && name != "glyphs/o.glif"));
  }
  CHECK(folder.files() == std::vector<std::string>{"none.json", "p.png", "r.json", "report.json", "same.ufo", "u.ufo"});
  check_refusal(glyphwave({"restyle", folder / "u.ufo", folder / "r.json", "-o", folder / "x.ttf"}), {"u.ufo", ".ufo"});
  check_refusal(glyphwave({"inspect", folder / "u.ufo", "--face", "1"}), {"u.ufo", "no face 1"});
  check_refusal(glyphwave({"inspect", folder / "u.ufo", "--location", "wght=650"}), {"u.ufo", "not a variable font"});
}

TEST_CASE("a CFF font is restyled as one, and its ending says so", "[cli]") {
  const Folder folder;
  put(folder / "r.json", R"({"glyphs": "a,o,n", "steps": [{"op": "smooth", "scale": 300}]})");
  const Run run = glyphwave({"restyle", bundled_otf[0], folder / "r.json", "-o", folder / "o.otf"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("tables rebuilt: CFF"));
  check_refusal(glyphwave({"restyle", bundled_otf[0], folder / "r.json", "-o", folder / "o.ttf"}), {"o.ttf", ".otf"});
}

TEST_CASE("the demo's recipe changes every glyph it names and keeps their areas", "[cli]") {
  const Folder folder;
  const Run run = glyphwave({"restyle", serif, std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/recipes/demo.json", "-o",
                             folder / "o.ttf", "--strict", "--json"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  const json report = json::parse(run.out);
  CHECK(report["glyphs"].size() == 8);
  for (const auto& glyph : report["glyphs"]) {
    CHECK(glyph["changed"] == true);
    CHECK(glyph["area_after"].get<double>() == Approx(glyph["area_before"].get<double>()).epsilon(5e-4));
  }
}

TEST_CASE("restyled letters of every bundled TrueType font pass the OpenType sanitizer", "[cli][slow]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("U+0041-005A,U+0061-007A", 1));
  for (const std::string& font : bundled_ttf) {
    CAPTURE(font);
    REQUIRE(glyphwave({"restyle", font, folder / "r.json", "-o", folder / "o.ttf"}).status == 0);
    CHECK(contents(folder / "o.ttf") != contents(font));
    CHECK(run_program("ots-sanitize", {folder / "o.ttf"}).status == 0);
  }
}

TEST_CASE("a recipe of strength zero gives the input back, also onto itself", "[cli]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("U+0061-007A", 0));
  REQUIRE(glyphwave({"restyle", serif, folder / "r.json", "-o", folder / "o.ttf"}).status == 0);
  CHECK(contents(folder / "o.ttf") == contents(serif));
  REQUIRE(glyphwave({"restyle", folder / "o.ttf", folder / "r.json", "-o", folder / "o.ttf"}).status == 0);
  CHECK(contents(folder / "o.ttf") == contents(serif));
}

TEST_CASE("a selection narrows what a recipe is applied to", "[cli]") {
  const Folder folder;
  put(folder / "r.json", recipe_for("U+0061-007A", 1));
  for (const auto& narrowed : {std::vector<std::string>{"--glyphs", "o"}, {"--text", "ooo"}}) {
    std::vector<std::string> arguments{"restyle", serif, folder / "r.json", "-o", folder / "o.ttf", "--json"};
    arguments.insert(arguments.end(), narrowed.begin(), narrowed.end());
    const Run run = glyphwave(arguments);
    REQUIRE(run.status == 0);
    const json report = json::parse(run.out);
    REQUIRE(report["glyphs"].size() == 1);
    CHECK(report["glyphs"][0]["name"] == "o");
  }
}

TEST_CASE("under --strict a refused glyph means status 1 and no output", "[cli]") {
  const Folder folder;
  // So far to the left that the bowl must cross the counter.
  put(folder / "r.json", R"({"glyphs": "o", "on_crossing": "refuse",
      "keep": {"area": "none", "extrema": false, "zones": false},
      "steps": [{"op": "sweep", "near": [950, 450], "move": [-700, 0], "breadth": 1500}]})");
  const std::vector<std::string> arguments{"restyle", serif, folder / "r.json", "-o", folder / "o.ttf"};
  const Run lenient = glyphwave(arguments);
  CAPTURE(lenient.out, lenient.err);
  REQUIRE(lenient.status == 0);
  CHECK_THAT(lenient.out, Catch::Contains("refused"));
  CHECK(contents(folder / "o.ttf") == contents(serif));
  fs::remove(folder / "o.ttf");
  std::vector<std::string> strict = arguments;
  strict.push_back("--strict");
  const Run run = glyphwave(strict);
  CHECK(run.status == 1);
  CHECK(run.out.empty());
  CHECK_THAT(run.err, Catch::StartsWith("glyphwave: ") && Catch::Contains("o ("));
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
  CHECK(folder.files() == std::vector<std::string>{"r.json"});
}

TEST_CASE("with --json there is one JSON value on standard output and nothing else", "[cli]") {
  const Folder folder;
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"inspect", serif, "--glyphs", "a,b"},
                                                    {"area", "measure", serif, "--glyphs", "a,b"},
                                                    {"check", serif, "--glyphs", "a,b"},
                                                    {"proof", serif, "--text", "a", "-o", folder / "p.png"}}) {
    std::vector<std::string> with_json = arguments;
    with_json.push_back("--json");
    const Run run = glyphwave(with_json);
    CAPTURE(arguments[0], run.err);
    CHECK(run.status == 0);
    CHECK(run.err.empty());
    CHECK(json::accept(run.out));
  }
}

TEST_CASE("inspect and area measure do not depend on the number of threads", "[cli]") {
  const auto same = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"-j", "1"});
    const Run one = glyphwave(arguments);
    arguments.back() = "2";
    CHECK(one.status == 0);
    CHECK_FALSE(one.out.empty());
    CHECK(glyphwave(arguments).out == one.out);
  };
  same({"inspect", bundled_otf[0]});
  same({"inspect", bundled_otf[0], "--json"});
  same({"area", "measure", serif, "--json"});
}

TEST_CASE("a selection is by name, code point, range, glyph number, file or text", "[cli]") {
  const Folder folder;
  put(folder / "list", "a\nb\n");
  const auto measured = [&](const std::vector<std::string>& selection) {
    std::vector<std::string> arguments{"area", "measure", serif, "--json"};
    arguments.insert(arguments.end(), selection.begin(), selection.end());
    const Run run = glyphwave(arguments);
    CAPTURE(run.err);
    REQUIRE(run.status == 0);
    std::string names;
    const json measure = json::parse(run.out);
    for (const auto& glyph : measure["glyphs"]) names += glyph["name"].get<std::string>();
    return names;
  };
  CHECK(measured({"--glyphs", "b,a"}) == "ab");
  CHECK(measured({"--glyphs", "b", "--glyphs", "a"}) == "ab");
  CHECK(measured({"--glyphs", "U+0061-0062"}) == "ab");
  CHECK(measured({"--glyphs", "@" + (folder / "list")}) == "ab");
  CHECK(measured({"--text", "abba"}) == "ab");
  CHECK(measured({"--text", "[a]", "--features", "-kern"}) == "abracketleftbracketright");
  check_refusal(glyphwave({"area", "measure", serif, "--glyphs", "nosuch"}), {"LiberationSerif-Regular.ttf", "nosuch"});
  check_refusal(glyphwave({"area", "measure", serif, "--text", ""}), {"empty"});
  check_refusal(glyphwave({"area", "measure", serif, "--text", "a\xFF"}), {"UTF-8"});
  check_refusal(glyphwave({"area", "measure", serif, "--text", "a", "--features", "zzzz"}), {"zzzz"});
}

TEST_CASE("area measure writes a baseline that a second run gives again", "[cli]") {
  const Folder folder;
  REQUIRE(glyphwave({"area", "measure", serif, "-o", folder / "one.json"}).status == 0);
  REQUIRE(glyphwave({"area", "measure", serif, "-o", folder / "two.json", "-q"}).out.empty());
  CHECK(contents(folder / "one.json") == contents(folder / "two.json"));
  CHECK(contents(folder / "one.json") == glyphwave({"area", "measure", serif, "--json"}).out);
}

TEST_CASE("check ends with 1 if it finds a crossing and with 0 if not", "[cli]") {
  CHECK(glyphwave({"check", serif, "--glyphs", "o"}).status == 0);
  // The cedilla hangs on the t it crosses.
  const std::string sans = bundled_ttf[2];
  const Run found = glyphwave({"check", sans, "--glyphs", "tcedilla"});
  CHECK(found.status == 1);
  CHECK_THAT(found.out, Catch::Contains("tcedilla: contour 0 crosses contour 1 at ("));
  const Run listed = glyphwave({"check", sans, "--glyphs", "tcedilla", "--json"});
  CHECK(listed.status == 1);
  const json check = json::parse(listed.out)["sections"][0]["checks"][1];
  CHECK(check["result"] == "FAIL");
  REQUIRE(check["logs"].size() > 0);
  CHECK(check["logs"][0]["kind"] == "crossing");
  CHECK(check["logs"][0]["places"][1]["contour"] == 1);
}

TEST_CASE("a proof is a picture of the kind its name says", "[cli]") {
  const Folder folder;
  const std::vector<std::pair<std::string, std::string>> kinds{
      {"p.png", "\x89PNG"}, {"p.pdf", "%PDF"}, {"p.svg", "<?xml"}};
  for (const auto& [name, head] : kinds) {
    REQUIRE(glyphwave({"proof", serif, "--text", "Ag", "--against", bundled_ttf[1], "-o", folder / name}).status == 0);
    CHECK(contents(folder / name).starts_with(head));
  }
  check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "p.gif"}), {"p.gif"});
  check_refusal(glyphwave({"proof", serif, "--text", "a"}), {"--output"});
  check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "x.png", "--show", "ghosts"}), {"ghosts"});
  for (const std::string level : {"level=", "level=wide", "level=-1", "level=1e999"}) {
    check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "x.png", "--show", level}), {level});
  }
  for (const std::string comb : {"comb=", "comb=-1"}) {
    check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "x.png", "--show", comb}), {comb});
  }
  check_refusal(glyphwave({"proof", serif, "--glyphs", "a", "-o", folder / "x.png", "--sizes", "12,24"}), {"--sizes"});
  check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "x.png", "--sizes", "12,0"}),
                {"pixels per em"});
  check_refusal(glyphwave({"proof", serif, "--text", "a", "-o", folder / "x.png", "--location", "wght=1", "--location",
                           "wght=2"}),
                {serif, "is not variable"});
  REQUIRE(glyphwave({"proof", serif, "--text", "a", "-o", folder / "p.png", "--show",
                     "nodes,comb,comb=0.02,level=60,level=120", "--sizes", "12,24"})
              .status == 0);
  CHECK(folder.files() == std::vector<std::string>{"p.pdf", "p.png", "p.svg"});
}

TEST_CASE("simplify writes the font with fewer segments, and a report of every glyph", "[cli]") {
  const Folder folder;
  REQUIRE(
      glyphwave({"simplify", serif, "-o", folder / "s.ttf", "--glyphs", "a,o", "--report", folder / "r.json"}).status ==
      0);
  const json report = json::parse(contents(folder / "r.json"));
  CHECK(report["changed"] == 2);
  CHECK(report["refused"] == 0);
  CHECK(report["segments_after"] < report["segments_before"]);
  CHECK(report["glyphs"][0]["deviation"] <= 2.048);
  CHECK(glyphwave({"check", folder / "s.ttf", "--glyphs", "a,o"}).status == 0);
  const Run shown = glyphwave({"simplify", serif, "-o", folder / "s.ttf", "--glyphs", "a,o", "--json"});
  CHECK(json::parse(shown.out) == report);
  REQUIRE(glyphwave({"simplify", serif, "-o", folder / "same.ttf", "--tolerance", "0"}).status == 0);
  CHECK(contents(folder / "same.ttf") == contents(serif));
  REQUIRE(glyphwave({"simplify", serif, "-o", folder / "c.otf", "--curve", "cubic", "--glyphs", "a"}).status == 0);
  CHECK(contents(folder / "c.otf").starts_with("OTTO"));
  check_refusal(glyphwave({"simplify", serif, "-o", folder / "c.ttf", "--curve", "cubic"}), {"c.ttf", ".otf"});
  check_refusal(glyphwave({"simplify", serif, "-o", folder / "c.otf"}), {"c.otf", ".ttf"});
  check_refusal(glyphwave({"simplify", serif, "-o", folder / "c.ttf", "--extrema", "some"}), {"--extrema", "keep"});
  check_refusal(glyphwave({"simplify", serif, "-o", folder / "c.ttf", "--tolerance", "-1"}), {"--tolerance"});
  check_refusal(glyphwave({"simplify", serif}), {"--output"});
}

TEST_CASE("weight is learnt from a pair of fonts and applied to one", "[cli]") {
  const Folder folder;
  const std::string bold = bundled_font("liberation-serif/LiberationSerif-Bold.ttf");
  const std::string model = folder / "m.json";
  const Run learnt =
      glyphwave({"weight", "learn", serif, bold, "--control", "n,o,H,O", "--prior", "none", "-o", model});
  CHECK(learnt.status == 0);
  CHECK(learnt.out.find("control letter H") != std::string::npos);
  CHECK(json::parse(contents(model)).at("controls").size() == 4);
  CHECK(json::parse(contents(model)).at("widening").empty());
  CHECK(glyphwave({"weight", "learn", serif, bold, "--control", "n,o", "-o", folder / "prior.json"}).status == 0);
  CHECK(json::parse(contents(folder / "prior.json")).at("widening").contains("k"));

  const std::string made = folder / "made.ttf";
  const Run applied = glyphwave({"weight", "apply", serif, model, "-o", made, "--glyphs", "a,e", "--report",
                                 folder / "r.json", "--amount", "0.5"});
  CHECK(applied.status == 0);
  CHECK(applied.out.find("2 of 2 selected glyphs in another weight") != std::string::npos);
  const json report = json::parse(contents(folder / "r.json"));
  CHECK(report.at("changed") == 2);
  for (const json& glyph : report.at("glyphs")) CHECK(glyph.at("area_after") != glyph.at("area_before"));

  const std::string same = folder / "same.ttf";
  CHECK(glyphwave({"weight", "apply", serif, model, "-o", same, "--amount", "0"}).status == 0);
  CHECK(contents(same) == contents(serif));

  // The same through a recipe, whose model is named from where the recipe is.
  put(folder / "bold.recipe.json",
      R"({"glyphs": "a,e", "steps": [{"op": "weight", "model": "m.json", "amount": 0.5, "advance": "sidebearings"}]})");
  const Run restyled = glyphwave({"restyle", serif, folder / "bold.recipe.json", "-o", folder / "restyled.ttf",
                                  "--report", folder / "restyled.json"});
  CHECK(restyled.status == 0);
  const json restyling = json::parse(contents(folder / "restyled.json"));
  CHECK(restyling.at("advances_changed") > 2);  // of a, e and their composites
  const json glyph = restyling.at("glyphs").at(0);
  CHECK(glyph.at("steps").at(0).at("op") == "weight");
  CHECK(glyph.at("notes").at(0).get<std::string>().starts_with("weight adds "));

  const Run proofed = glyphwave({"weight", "apply", serif, model, "-o", made, "--glyphs", "a,e,s", "--against", bold,
                                 "--proof", folder / "p.png"});
  CHECK(proofed.status == 0);
  CHECK(proofed.out.find("3 glyphs differ by ") != std::string::npos);
  CHECK(contents(folder / "p.png").starts_with("\x89PNG"));

  // Carried to where it was learnt, the step is what it was.
  const Run fitted = glyphwave({"weight", "apply", serif, model, "-o", made, "--glyphs", "a", "--fit-amount", bold,
                                "--advance", "learnt", "--report", folder / "r.json"});
  CHECK(fitted.status == 0);
  CHECK(fitted.out.find("advances by learnt") != std::string::npos);
  CHECK(json::parse(contents(folder / "r.json")).at("amounts").at("x") == 1.0);

  check_refusal(glyphwave({"weight", "learn", serif, bold, "--control", "n", "--prior", "p.json", "-o", "x.json"}),
                {"p.json"});
  check_refusal(glyphwave({"weight", "apply", serif, model, "--advance", "wide", "-o", made}), {"--advance wide"});
  check_refusal(glyphwave({"weight", "apply", serif, model, "--emit", "small", "-o", made}), {"--emit", "small"});
  check_refusal(glyphwave({"weight", "apply", serif, model, "--stem-x", "-5", "-o", made}), {"stem"});
  check_refusal(glyphwave({"weight", "apply", serif, model, "-o", made, "--amount", "3"}), {"--amount 3"});
  check_refusal(glyphwave({"weight", "apply", serif, model, "-o", model}), {model});
  check_refusal(glyphwave({"weight", "learn", serif, bold, "--control", "n", "--glyphs", "n", "-o", model}),
                {"--control"});
}

TEST_CASE("standard output that cannot be written is an error", "[cli]") {
  const Run run = glyphwave({"inspect", serif, "--glyphs", "a"}, "/dev/full");
  CHECK(run.status == 2);
  CHECK_THAT(run.err, Catch::StartsWith("glyphwave: standard output: "));
}

TEST_CASE("an output on a full disk is an error", "[cli]") {
  check_refusal(glyphwave({"area", "measure", serif, "-o", "/dev/full"}), {"/dev/full"});
}
