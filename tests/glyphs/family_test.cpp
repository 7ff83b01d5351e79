#include "glyphs/family.h"

#include <woff2/encode.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "glyphs/error.h"
#include "glyphs/safe_file.h"
#include "glyphs/ufo.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/folder.h"

namespace {

namespace fs = std::filesystem;
using glyphs::Font;
using glyphs::load_font;
using glyphs::Recipe;
using glyphs::RestyleResult;

using Folder = TestFolder;

glyphs::Bytes content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Recipe smoothing(const std::string& glyphs = "U+0061-007A") {
  Recipe recipe;
  recipe.glyphs = glyphs;
  recipe.lengths_in_thousandths = true;
  recipe.steps = {glyphs::SmoothStep{.scale = 150}};
  return recipe;
}

/// Two TrueType fonts, an OpenType font and a UFO.
std::vector<std::string> family_in(const Folder& folder) {
  std::vector<std::string> fonts{bundled_ttf[0], bundled_ttf[1], bundled_otf[2], folder / "Serif.ufo"};
  glyphs::write_files({{fonts[3], {}, glyphs::extract_ufo(load_font(bundled_otf[3])).folder}});
  return fonts;
}

}  // namespace

TEST_CASE("every font of a family becomes what it becomes alone, byte for byte", "[family]") {
  const Folder folder;
  const std::vector<std::string> fonts = family_in(folder);
  const Recipe recipe = smoothing();
  const glyphs::FamilyResult family =
      restyle_family_into({folder / "out", folder / "report.json", folder / "proof.svg"}, fonts, recipe);
  REQUIRE(family.is_written);
  REQUIRE(family.fonts.size() == fonts.size());
  const auto json = nlohmann::json::parse(family.report);
  CHECK(content(folder / "report.json") == glyphs::Bytes(family.report.begin(), family.report.end()));
  CHECK(json.at("version") == 1);
  int changed = 0;
  std::int64_t bytes = 0;
  for (std::size_t k = 0; k < fonts.size(); ++k) {
    CAPTURE(fonts[k]);
    const Font font = load_font(fonts[k]);
    const RestyleResult alone = restyle(font, recipe);
    CHECK(alone.changed() > 0);
    changed += alone.changed();
    bytes += alone.size.bytes_after - alone.size.bytes_before;
    const std::string name = fs::path(fonts[k]).filename().string();
    CHECK(family.fonts[k].name == name);
    if (alone.font.folder) {
      CHECK(glyphs::read_folder(folder / "out/" + name) == *alone.font.folder);
    } else {
      CHECK(content(folder / "out/" + name) == alone.font.data);
    }
    auto expected = nlohmann::json::parse(report_json(font, alone));
    expected["font"] = name;
    CHECK(json.at("fonts").at(k) == expected);
  }
  CHECK(json.at("changed") == changed);
  CHECK(json.at("bytes_after").get<std::int64_t>() - json.at("bytes_before").get<std::int64_t>() == bytes);
  CHECK(json.at("moved_most").size() == 20);
  const auto moved = [&](std::size_t i) {
    return json.at("moved_most").at(i).at("displacement_in_thousandths").get<double>();
  };
  for (std::size_t i = 1; i < 20; ++i) CHECK(moved(i - 1) >= moved(i));
  CHECK(fs::file_size(folder / "proof.svg") > 0);
  CHECK(folder.count() == 4);
}

TEST_CASE("a family does not depend on the number of threads, and its progress is over all glyphs", "[family]") {
  const Folder folder;
  const std::vector<std::string> fonts = family_in(folder);
  const Recipe recipe = smoothing();
  for (const int jobs : {1, 3}) {
    const std::string out = folder / std::to_string(jobs);
    std::vector<std::pair<int, int>> steps;
    glyphs::FamilyOptions options;
    options.jobs = {jobs, [&](int done, int total) { steps.emplace_back(done, total); }};
    restyle_family_into({out + "/f", out + "/r.json", out + "/p.png"}, fonts, recipe, options);
    REQUIRE_FALSE(steps.empty());
    CHECK(steps.back() == std::pair(4 * 26, 4 * 26));
    CHECK(std::ranges::is_sorted(steps));
  }
  for (const std::string& path : fonts) {
    if (path.ends_with(".ufo")) continue;
    const std::string name = fs::path(path).filename().string();
    CHECK(content(folder / "1/f/" + name) == content(folder / "3/f/" + name));
  }
  CHECK(glyphs::read_folder(folder / "1/f/Serif.ufo") == glyphs::read_folder(folder / "3/f/Serif.ufo"));
  for (const char* name : {"/r.json", "/p.png"}) {
    CHECK(content(folder / "1" + name) == content(folder / "3" + name));
  }
}

TEST_CASE("fonts of a family are handed over one after the other", "[family]") {
  std::vector<std::string> taken;
  glyphs::FamilyOptions options;
  options.only = [](const Font& font) { return std::vector{font.find("o")}; };
  restyle_family(bundled_ttf, smoothing(), options, [&](std::size_t k, const Font& font, const RestyleResult& result) {
    CHECK(font.path == bundled_ttf[k]);
    REQUIRE(result.glyphs.size() == 1);
    CHECK(result.glyphs[0].name == "o");
    taken.push_back(font.path);
  });
  CHECK(taken == bundled_ttf);
}

TEST_CASE("all faults of a family are told at once, before anything is worked on", "[family]") {
  const Folder folder;
  std::ofstream(folder / "broken.ttf") << "no font";
  const std::vector<std::string> fonts{bundled_ttf[0], folder / "broken.ttf", folder / "missing.ttf"};
  const glyphs::FamilyOutputs outputs{folder / "out", folder / "r.json", ""};
  const std::string unreadable =
      message_of<glyphs::FontReadError>([&] { restyle_family_into(outputs, fonts, smoothing()); });
  CHECK_THAT(unreadable, Catch::Contains("broken.ttf: ") && Catch::Contains("; ") && Catch::Contains("missing.ttf: "));
  CHECK(unreadable.find('\n') == std::string::npos);

  // A glyph or a contour that one font does not have.
  const auto slip = [&](const Recipe& wrong, const std::vector<std::string>& of) {
    return message_of<glyphs::RequestError>([&] { restyle_family_into(outputs, of, wrong); });
  };
  CHECK_THAT(slip(smoothing("o,uni1E9E"), bundled_otf), Catch::Contains("uni1E9E"));
  Recipe recipe = smoothing("o,a");
  recipe.keep.freeze = {glyphs::Freeze{.glyph = "nosuch", .box = fontcore::Box{}}};
  const std::string both = slip(recipe, {bundled_ttf[0], bundled_otf[0]});
  CHECK_THAT(both, Catch::Contains(bundled_ttf[0]) && Catch::Contains(bundled_otf[0]) && Catch::Contains("nosuch"));
  CHECK(folder.count() == 1);
}

TEST_CASE("two fonts of one name, or one over another, are refused", "[family]") {
  const Folder folder;
  fs::create_directories(folder / "a");
  fs::create_directories(folder / "b");
  for (const char* copy : {"a/F.ttf", "b/F.ttf", "b/G.ttf"}) fs::copy_file(bundled_ttf[0], folder / copy);
  const auto refused = [&](const std::string& out, const std::vector<std::string>& fonts) {
    return message_of<glyphs::RequestError>([&] { restyle_family_into({out, "", ""}, fonts, smoothing()); });
  };
  CHECK_THAT(refused(folder / "out", {folder / "a/F.ttf", folder / "b/F.ttf"}),
             Catch::Contains("a/F.ttf") && Catch::Contains("b/F.ttf"));
  CHECK_THAT(refused(folder / "out", {folder / "a/F.ttf", folder / "a/./F.ttf"}), Catch::Contains("would both be"));
  // a/F.ttf goes where b/F.ttf is read under another name
  fs::create_symlink("F.ttf", folder / "b/H.ttf");
  fs::rename(folder / "a/F.ttf", folder / "a/H.ttf");
  CHECK_THAT(refused(folder / "b", {folder / "a/H.ttf", folder / "b/F.ttf"}), Catch::Contains("would overwrite"));
  CHECK(content(folder / "b/F.ttf") == content(bundled_ttf[0]));
  CHECK_FALSE(fs::exists(folder / "out"));
}

TEST_CASE("a web font of a family gets the ending of what it becomes", "[family]") {
  const Folder folder;
  const glyphs::Bytes font = content(bundled_otf[0]);
  glyphs::Bytes packed(woff2::MaxWOFF2CompressedSize(font.data(), font.size()));
  std::size_t size = packed.size();
  REQUIRE(woff2::ConvertTTFToWOFF2(font.data(), font.size(), packed.data(), &size));
  packed.resize(size);
  glyphs::write_file(folder / "F.1.woff2", packed);
  const glyphs::FamilyResult family =
      restyle_family_into({folder / "out", "", ""}, {folder / "F.1.woff2"}, smoothing());
  CHECK(family.fonts.at(0).name == "F.1.otf");
  CHECK(content(folder / "out/F.1.otf") == restyle(load_font(folder / "F.1.woff2"), smoothing()).font.data);
  CHECK(nlohmann::json::parse(family.report).at("fonts").at(0).at("font") == "F.1.woff2");
  // Its name may then be another's.
  fs::copy_file(bundled_otf[0], folder / "F.1.otf");
  CHECK_THAT(message_of<glyphs::RequestError>([&] {
               restyle_family_into({folder / "x", "", ""}, {folder / "F.1.otf", folder / "F.1.woff2"}, smoothing());
             }),
             Catch::Contains("would both be"));
}

TEST_CASE("a file name that is not UTF-8 is shown with what can be shown of it", "[family]") {
  const Folder folder;
  const std::string path = folder / "F\xff\n.otf";
  fs::copy_file(bundled_otf[0], path);
  const glyphs::FamilyOutputs outputs{folder / "out", folder / "r.json", folder / "p.svg"};
  const glyphs::FamilyResult family = restyle_family_into(outputs, {path}, smoothing());
  CHECK(fs::exists(folder / "out/F\xff\n.otf"));
  CHECK(nlohmann::json::parse(family.report).at("fonts").at(0).at("font") == "F\uFFFD\n.otf");
}

TEST_CASE("a family may go where it came from", "[family]") {
  const Folder folder;
  std::vector<std::string> fonts{folder / "A.ttf", folder / "B.otf", folder / "Serif.ufo/"};
  family_in(folder);
  fs::copy_file(bundled_ttf[0], fonts[0]);
  fs::copy_file(bundled_otf[0], fonts[1]);
  std::vector<RestyleResult> alone;
  for (const std::string& path : fonts) alone.push_back(restyle(load_font(path), smoothing()));
  restyle_family_into({folder / "", "", ""}, fonts, smoothing());
  CHECK(content(fonts[0]) == alone[0].font.data);
  CHECK(content(fonts[1]) == alone[1].font.data);
  CHECK(glyphs::read_folder(fonts[2]) == *alone[2].font.folder);
  CHECK(folder.count() == 3);
}

TEST_CASE("a family that cannot be written leaves every old output, and no folder that was made", "[family]") {
  const Folder folder;
  const std::vector<std::string> fonts{bundled_ttf[0], bundled_otf[0]};
  const auto refused = [&](const glyphs::FamilyOutputs& outputs) {
    return message_of<glyphs::FontWriteError>([&] { restyle_family_into(outputs, fonts, smoothing()); });
  };
  CHECK_THAT(refused({folder / "new", "", folder / "none/p.png"}), Catch::Contains("none/p.png"));
  CHECK_THAT(refused({folder / "new", "/dev/full", ""}), Catch::Contains("No space left"));
  CHECK_FALSE(fs::exists(folder / "new"));
  const std::string first = fs::path(fonts[0]).filename().string();
  const std::string second = fs::path(fonts[1]).filename().string();
  fs::create_directory(folder / "out");
  std::ofstream(folder / "out/" + first) << "old";
  fs::create_directory(folder / "out/" + second);
  CHECK_THAT(refused({folder / "out", "", ""}), Catch::Contains(second) && Catch::Contains("Is a directory"));
  CHECK_THAT(refused({folder / "out/" + first, "", ""}), Catch::Contains("Not a directory"));
  CHECK(content(folder / "out/" + first) == glyphs::Bytes{'o', 'l', 'd'});
  CHECK(std::distance(fs::directory_iterator(folder / "out"), {}) == 2);
  CHECK(folder.count() == 1);
}

TEST_CASE("strictly, a glyph refused in one font leaves the whole family unwritten", "[family]") {
  const Folder folder;
  Recipe recipe = smoothing("o,adieresis");  // a composite in the TrueType font, not in the other
  const std::vector<std::string> fonts{bundled_otf[0], bundled_ttf[0]};
  glyphs::FamilyOutputs outputs{folder / "out", folder / "r.json", folder / "p.pdf", true};
  const glyphs::FamilyResult strict = restyle_family_into(outputs, fonts, recipe);
  CHECK_FALSE(strict.is_written);
  CHECK(strict.fonts.at(0).refusals.empty());
  REQUIRE(strict.fonts.at(1).refusals.size() == 1);
  CHECK(strict.fonts[1].refusals[0].starts_with("adieresis (it is a composite"));
  CHECK(folder.count() == 0);
  outputs.strict = false;
  CHECK(restyle_family_into(outputs, fonts, recipe).is_written);
  CHECK(folder.count() == 3);
}
