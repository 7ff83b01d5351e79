#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tests/bundled_fonts.h"
#include "tests/glyphs/variable_bytes.h"
#include "tests/tools/program.h"

using nlohmann::json;

namespace {

const std::string& regular = bundled_otf[0];
const std::string& bold = bundled_otf[1];
const std::string letters_list = "U+0041-005A,U+0061-007A";

/// A baseline of the regular's letters.
std::string baseline_in(const TestFolder& folder, const std::string& metrics = "all") {
  const std::string path = folder / "base.json";
  REQUIRE(glyphwave({"area", "measure", regular, "--glyphs", letters_list, "--metrics", metrics, "-q", "-o", path})
              .status == 0);
  return path;
}

/// The regular with the counter of its o pulled up, area not kept.
std::string drifted_in(const TestFolder& folder) {
  put(folder / "recipe.json",
      R"({"glyphs": "o", "steps": [{"op": "sweep", "contour": 1, "near": [270, 430], "move": [0, -12], "breadth": 200}],
          "keep": {"area": "none", "extrema": false, "zones": false}})");
  const std::string path = folder / "Drifted.otf";
  REQUIRE(glyphwave({"restyle", regular, folder / "recipe.json", "-q", "-o", path}).status == 0);
  return path;
}

}  // namespace

TEST_CASE("area check is status 0 on the font itself and 1 on one that drifted, and names what drifted",
          "[cli][area]") {
  const TestFolder folder;
  for (const char* metrics : {"area", "all"}) {
    const std::string base = baseline_in(folder, metrics);
    const Run same = glyphwave({"area", "check", base, regular});
    CHECK(same.status == 0);
    CHECK_THAT(same.out, Catch::Contains("0 of 52 glyphs changed in area, 0 in outline alone"));
    CHECK(glyphwave({"area", "check", base, regular, "-q"}).out.empty());
    const Run drifted = glyphwave({"area", "check", base, drifted_in(folder)});
    CHECK(drifted.status == 1);
    CHECK_THAT(drifted.out, Catch::StartsWith("FAIL o: ") && Catch::Contains("counter -"));
    CHECK_THAT(drifted.out, Catch::Contains("1 of 52 glyphs changed in area"));
    CHECK(
        glyphwave({"area", "check", base, folder / "Drifted.otf", "--tolerance-percent", "50", "--area-only"}).status ==
        0);
    CHECK(glyphwave({"area", "check", base, folder / "Drifted.otf", "--error-code-on", "ERROR"}).status == 0);
  }
}

TEST_CASE("area check writes its report in fontbakery's shape, as JUnit, as Markdown and as a page, or not at all",
          "[cli][area]") {
  const TestFolder folder;
  const std::string base = baseline_in(folder);
  const std::string drifted = drifted_in(folder);
  const Run run = glyphwave({"area", "check", base, drifted, "--json", "--html", folder / "a.html", "--junit",
                             folder / "a.xml", "--markdown", folder / "a.md", "--against", regular});
  CHECK(run.status == 1);
  const json report = json::parse(run.out);
  CHECK(report["result"]["FAIL"] == 1);
  const json& section = report["sections"][0];
  CHECK(section["key"] == "Area");
  CHECK(section["result"] == "FAIL");
  for (const json& check : section["checks"]) {
    for (const char* key : {"key", "description", "rationale", "severity", "result", "filename", "logs"})
      CHECK(check.contains(key));
    CHECK((check["result"] == "FAIL") == (check["key"] == "glyphwave/area"));
  }
  CHECK(section["checks"][0]["logs"][0]["status"] == "FAIL");
  CHECK(section["checks"][0]["logs"][0]["glyph"] == "o");

  const std::string page = contents(folder / "a.html");
  CHECK_THAT(page, Catch::StartsWith("<!DOCTYPE html>") && Catch::EndsWith("</html>\n"));
  CHECK_THAT(page, Catch::Contains("before") && Catch::Contains("red: gone, blue: new"));
  for (const char* fetched : {"<script", "src=", "url(", "@import", "https://"})
    CHECK(page.find(fetched) == std::string::npos);
  const std::string junit = contents(folder / "a.xml");
  CHECK_THAT(junit, Catch::Contains("failures=\"1\" errors=\"0\"") && Catch::Contains("name=\"o\"") &&
                        Catch::Contains("<failure type=\"FAIL\""));
  CHECK_THAT(contents(folder / "a.md"), Catch::StartsWith("## Areas of ") && Catch::Contains("| **FAIL** | o: "));

  // Without the font of before the page shows what is now, and says so.
  REQUIRE(glyphwave({"area", "check", base, drifted, "--html", folder / "b.html"}).status == 1);
  CHECK_THAT(contents(folder / "b.html"),
             Catch::Contains("a baseline holds no outlines") && !Catch::Contains("red: gone"));
  check_refusal(
      glyphwave({"area", "check", base, drifted, "--html", folder / "c.html", "--junit", folder / "no/c.xml"}),
      {"c.xml"});
  CHECK_FALSE(std::filesystem::exists(folder / "c.html"));
}

TEST_CASE("a page of area check opens in a browser without an error and fetches nothing", "[cli][area]") {
  if (std::system("command -v chromium > /dev/null 2>&1") != 0) {
    WARN("skipped: there is no chromium (Debian: chromium)");
    return;
  }
  const TestFolder folder;
  const std::string base = baseline_in(folder);
  REQUIRE(glyphwave({"area", "check", base, drifted_in(folder), "--html", folder / "a.html", "--against", regular})
              .status == 1);
  const Run browser = run_program(
      "chromium",
      {"--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
       "--disable-sync", "--no-first-run", "--enable-logging=stderr", "--user-data-dir=" + (folder / "profile"),
       "--log-net-log=" + (folder / "net.json"), "--dump-dom", "file://" + (folder / "a.html")});
  CHECK(browser.status == 0);
  CHECK_THAT(browser.out, Catch::Contains("Areas of") && Catch::Contains("<figure>") && Catch::Contains("</html>"));
  CHECK(browser.err.find("CONSOLE") == std::string::npos);  // where a page's errors are told
  // What a browser asks its maker on its own is not the page's.
  std::istringstream log(contents(folder / "net.json"));
  for (std::string line; std::getline(log, line);) {
    const std::size_t at = line.find("\"url\":\"http");
    if (at == std::string::npos) continue;
    const std::string url = line.substr(at, 60);
    CAPTURE(url);
    CHECK((url.find(".google.com/") != std::string::npos || url.find(".googleapis.com/") != std::string::npos));
  }
}

TEST_CASE("a baseline measured anew keeps the tolerances written into it", "[cli][area]") {
  const TestFolder folder;
  const std::string base = baseline_in(folder);
  std::string text = contents(base);
  text.insert(text.find(",\"glyphs\":["), R"(,"tolerances":{"o":{"percent":50,"move":1000}})");
  put(base, text);
  const std::string drifted = drifted_in(folder);
  CHECK(glyphwave({"area", "check", base, drifted}).status == 0);
  baseline_in(folder);
  CHECK(glyphwave({"area", "check", base, drifted}).status == 0);
  CHECK_THAT(contents(base), Catch::Contains(R"("o":{"percent":50.0,"move":1000.0})"));
}

TEST_CASE("a variable font is measured and compared at several places", "[cli][area]") {
  const TestFolder folder;
  const variable_bytes::Bytes bytes = variable_bytes::font_of(variable_bytes::variable_tables());
  put(folder / "V.ttf", {bytes.begin(), bytes.end()});
  const std::string base = folder / "base.json";
  REQUIRE(glyphwave({"area", "measure", folder / "V.ttf", "--location", "wght=400", "--location", "wght=900",
                     "--metrics", "all", "-q", "-o", base})
              .status == 0);
  const json baseline = json::parse(contents(base));
  CHECK(baseline["locations"] == json({"wght=400", "wght=900"}));
  const json& lines = baseline["glyphs"];
  REQUIRE(lines.size() >= 2);
  CHECK(lines[0]["name"] == lines[1]["name"]);
  CHECK(lines[0]["location"] == "wght=400");
  CHECK(lines[1]["location"] == "wght=900");
  CHECK(glyphwave({"area", "check", base, folder / "V.ttf"}).status == 0);
  const json audit = json::parse(
      glyphwave({"area", "audit", folder / "V.ttf", "--location", "wght=400", "--location", "wght=900", "--json"}).out);
  CHECK(audit["fonts"].size() == 2);
}

TEST_CASE("area audit sets fonts side by side, ranks glyphs, and gives the numbers as JSON", "[cli][area]") {
  const Run run = glyphwave({"area", "audit", regular, bold});
  CHECK(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("Fonts side by side") && Catch::Contains("Cabin-Regular.otf") &&
                          Catch::Contains("Most unlike their group"));
  const json report = json::parse(glyphwave({"area", "audit", regular, bold, "--json"}).out);
  REQUIRE(report["fonts"].size() == 2);
  const json& light = report["fonts"][0];
  CHECK(light["coverage"] < report["fonts"][1]["coverage"]);
  const auto of = [&](const std::string& name) {
    for (const json& glyph : light["glyphs"])
      if (glyph["name"] == name) return glyph;
    return json();
  };
  CHECK(of("n")["toN"] == 1.0);
  CHECK(of("n")["colour"] == light["n"]);
  CHECK(of("a")["toH"].get<double>() == Approx(of("a")["colour"].get<double>() / light["H"].get<double>()));

  // Of two letters as frequent the colour of text is their ink by their width.
  const TestFolder folder;
  put(folder / "f.json", R"({"n": 1, "o": 1})");
  const json two = json::parse(glyphwave({"area", "audit", regular, "--frequencies", folder / "f.json", "--json"}).out);
  const json areas =
      json::parse(glyphwave({"area", "measure", regular, "--glyphs", "n,o", "--metrics", "all", "--json"}).out);
  const auto& n = areas["glyphs"][0];
  const auto& o = areas["glyphs"][1];
  CHECK(two["fonts"][0]["coverage"].get<double>() ==
        Approx((n["ink"].get<double>() + o["ink"].get<double>()) /
               (n["advance"].get<double>() + o["advance"].get<double>()) / areas["unitsPerEm"].get<double>()));
  CHECK(glyphwave({"area", "audit", regular, "--error-code-on", "WARN"}).status == 1);
}

TEST_CASE("misuse of the area commands is one line and status 2", "[cli][area]") {
  const TestFolder folder;
  const std::string base = baseline_in(folder);
  check_refusal(glyphwave({"area", "check", folder / "none.json", regular}), {"none.json"});
  check_refusal(glyphwave({"area", "check", base, folder / "none.otf"}), {"none.otf"});
  check_refusal(glyphwave({"area", "check", base}), {"FONT"});
  check_refusal(glyphwave({"area", "check", base, regular, "--tolerance-percent", "-1"}),
                {"--tolerance-percent", "-1"});
  check_refusal(glyphwave({"area", "check", base, regular, "--error-code-on", "BAD"}), {"BAD", "FAIL"});
  check_refusal(glyphwave({"area", "check", base, regular, "--html", base}), {"base.json"});
  check_refusal(glyphwave({"area", "check", base, regular, "--location", "wght=1"}), {"--location"});
  check_refusal(glyphwave({"area", "measure", regular, "--metrics", "some"}), {"--metrics", "area, all"});
  check_refusal(glyphwave({"area", "measure", regular, "--location", "wght=1", "--location", "wght=1"}),
                {"given twice"});
  put(folder / "f.json", R"({"no": 1})");
  check_refusal(glyphwave({"area", "audit", regular, "--frequencies", folder / "f.json"}),
                {"f.json", "single character"});
  check_refusal(glyphwave({"area", "audit"}), {"FONT"});
}
