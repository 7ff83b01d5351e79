// What `area check` finds: changes made to glyphs of fonts, one in three at a time, and which glyphs are named.
//
//     area_sweep [ROUNDS [FONT ...]]      the bundled fonts unless others are named
//
// A line a font and kind of change: changes made, found (the glyph is named), missed, and glyphs named though nothing
// was done to them. Changes of area by 0.2 %; local moves of 4/1000 em that keep the area; what is neutral: other
// starts, order and direction, and curves of the other kind within 1/1000 em. Exit status 1 if anything was missed or
// named without cause.

#include <array>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <iostream>
#include <set>

#include "glyphs/area_check.h"
#include "glyphs/convert.h"
#include "glyphs/font_file.h"
#include "glyphs/recipe.h"
#include "tests/area_mutations.h"

namespace {

using namespace area_mutations;
using glyphs::AreaBaseline;
using glyphs::Font;

constexpr double area_change = 2e-3;
constexpr double move = 4e-3;  // of the em

AreaBaseline measured(const Font& font) {
  AreaBaseline areas;
  areas.units_per_em = font.units_per_em;
  areas.metrics = glyphs::AreaMetrics::All;
  areas.glyphs = glyphs::measure_areas(font, glyphs::select_glyphs(font, ""), areas.metrics);
  return areas;
}

struct Tally {
  int made = 0;
  int found = 0;
  int false_alarms = 0;
};

/// Names that are in one set only.
void count(const std::set<std::string>& changed, const glyphs::AreaComparison& comparison, const std::string& what,
           Tally& tally) {
  std::set<std::string> named;
  for (const glyphs::AreaDrift& drift : comparison.drifts) named.insert(drift.glyph);
  for (const std::string& glyph : changed) {
    ++tally.made;
    if (named.contains(glyph)) {
      ++tally.found;
    } else {
      std::cerr << "missed: " << what << ", " << glyph << '\n';
    }
  }
  for (const glyphs::Check& check : comparison.report.checks) {
    for (const glyphs::Finding& finding : check.findings) {
      if (changed.contains(finding.glyph)) continue;
      ++tally.false_alarms;
      std::cerr << "false alarm: " << what << ", " << finding.message << '\n';
    }
  }
}

using Change = std::function<std::optional<Outline>(const Outline&)>;

/// One in three glyphs changed, as far as the change can be made.
void sweep(const Font& font, const AreaBaseline& before, const std::string& what, int part, const Change& change,
           bool is_neutral, Tally& tally) {
  Font other = font;
  std::set<std::string> changed;
  for (glyphs::Glyph& glyph : other.glyphs) {
    if (glyph.contours.empty() || (!is_neutral && glyph.id % 3 != part)) continue;
    if (std::abs(fontcore::signed_area(glyph.contours)) < 1.0) continue;
    std::optional<Outline> outline = change(glyph.contours);
    if (!outline) continue;
    glyph.contours = std::move(*outline);
    if (!is_neutral) changed.insert(glyph.name);
  }
  count(changed, glyphs::compare_areas(before, measured(other), font.path), what, tally);
}

int tell(const std::string& font, const std::string& what, const Tally& tally) {
  std::cout << std::left << std::setw(28) << font << std::setw(34) << what << std::right << std::setw(8) << tally.made
            << std::setw(8) << tally.found << std::setw(8) << tally.made - tally.found << std::setw(13)
            << tally.false_alarms << std::endl;
  return tally.made - tally.found + tally.false_alarms;
}

}  // namespace

int main(int argc, char** argv) try {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 1;
  std::vector<std::string> paths(argv + std::min(argc, 2), argv + argc);
  if (paths.empty()) {
    const std::string folder = GLYPHWAVE_SOURCE_DIR "/fonts/";
    for (const char* font :
         {"cabin/Cabin-Regular.otf", "cabin/Cabin-Bold.otf", "eb-garamond/EBGaramond12-Regular.otf",
          "eb-garamond/EBGaramond12-Bold.otf", "liberation-serif/LiberationSerif-Regular.ttf",
          "liberation-serif/LiberationSerif-Bold.ttf", "open-sans/OpenSans-Regular.ttf", "open-sans/OpenSans-Bold.ttf"})
      paths.push_back(folder + font);
  }
  std::cout << std::left << std::setw(28) << "font" << std::setw(34) << "change" << std::right
            << "    made   found  missed  false alarms\n";
  int faults = 0;
  std::mt19937 random(1);
  for (const std::string& path : paths) {
    const std::string name = path.substr(path.find_last_of('/') + 1);
    const Font font = flattened(glyphs::load_font(path));
    const AreaBaseline before = measured(font);
    const double distance = move * font.units_per_em;
    Tally area;
    for (int part = 0; part < 3; ++part) {
      for (const double share : {area_change, -area_change})
        sweep(
            font, before, name + ", area", part,
            [&](const Outline& outline) { return with_other_area(outline, share, random); }, false, area);
    }
    faults += tell(name, "area by 0.2 %", area);
    constexpr std::array<const char*, 4> names{"node along its chord", "two nodes", "point along its chord",
                                               "point and node"};
    for (std::size_t k = 0; k < local_moves.size(); ++k) {
      Tally tally;
      for (int round = 0; round < 3 * rounds; ++round)
        sweep(
            font, before, name + ", " + names[k], round % 3,
            [&](const Outline& outline) { return locally_moved(outline, local_moves[k], distance, random); }, false,
            tally);
      faults += tell(name, names[k], tally);
    }
    Tally neutral;
    for (const auto& same : {with_other_starts, in_other_order, the_other_way}) {
      sweep(
          font, before, name + ", neutral", 0, [&](const Outline& outline) { return same(outline); }, true, neutral);
      ++neutral.made, ++neutral.found;
    }
    // Other starts, order and direction count as one change each of the whole font.
    faults += tell(name, "starts, order, direction", neutral);
    Tally kind;
    const bool is_truetype = font.format == glyphs::OutlineFormat::TrueType;
    const Font read = glyphs::load_font(path);
    const glyphs::ConvertedFont converted =
        glyphs::convert_font(read, is_truetype ? glyphs::FileKind::OpenType : glyphs::FileKind::TrueType);
    const Font other = glyphs::load_font_bytes(path, converted.font.data);
    count({}, glyphs::compare_areas(measured(read), measured(other), path), name + ", other curves", kind);
    ++kind.made, ++kind.found;
    faults += tell(name, "curves of the other kind", kind);
  }
  return faults == 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
