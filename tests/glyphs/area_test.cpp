#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "fontcore/ink.h"
#include "glyphs/area_audit.h"
#include "glyphs/area_baseline.h"
#include "glyphs/area_check.h"
#include "glyphs/convert.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/recipe.h"
#include "glyphs/safe_file.h"
#include "tests/area_mutations.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/glyphs/made_font.h"
#include "tests/glyphs/python.h"
#include "tests/shapes.h"

using namespace glyphs;
using namespace area_mutations;
using fontcore::BezierContour;
using fontcore::Point;

namespace {

AreaBaseline measured(const Font& font, const std::string& selection = "", AreaMetrics metrics = AreaMetrics::All) {
  AreaBaseline areas;
  areas.units_per_em = font.units_per_em;
  areas.metrics = metrics;
  areas.is_selection = !selection.empty();
  areas.glyphs = measure_areas(font, select_glyphs(font, selection), metrics);
  return areas;
}

std::vector<std::string> messages(const AreaComparison& comparison) {
  std::vector<std::string> all;
  for (const Check& check : comparison.report.checks)
    for (const Finding& finding : check.findings) all.push_back(finding.message);
  return all;
}

std::set<std::string> named(const AreaComparison& comparison) {
  std::set<std::string> all;
  for (const AreaDrift& drift : comparison.drifts) all.insert(drift.glyph);
  return all;
}

/// A ring of two squares, and a small square above it that it does not meet.
std::vector<BezierContour> ring_and_dot() {
  return {shapes::square(400), reverse(transform(shapes::square(200), {.shift = Point(100, 100)})),
          transform(shapes::square(60), {.shift = Point(170, 500)})};
}

AreaComparison compare(const std::vector<BezierContour>& before, const std::vector<BezierContour>& now,
                       const AreaCheckOptions& options = {}) {
  return compare_areas(measured(font_of(before)), measured(font_of(now)), "now.ttf", options);
}

/// The letters of a font, each drawn by contours of its own.
Font letters_of(const std::string& path) { return flattened(load_font(path)); }
const std::string selection = "U+0041-005A,U+0061-007A,U+00E0-00FF";

}  // namespace

TEST_CASE("a glyph's measures are those of what it is drawn as", "[area]") {
  const AreaBaseline areas = measured(font_of(ring_and_dot()));
  REQUIRE(areas.glyphs.size() == 1);
  const GlyphArea& glyph = areas.glyphs[0];
  CHECK(glyph.area == 400.0 * 400.0 - 200.0 * 200.0 + 60.0 * 60.0);
  CHECK(glyph.advance == 600.0);
  CHECK(glyph.length == Approx(4 * (400 + 200 + 60)));
  CHECK(*glyph.ink == Approx(glyph.area));
  REQUIRE(glyph.contours.size() == 3);
  CHECK(glyph.contours[0].area == 160000.0);
  CHECK(glyph.contours[1].area == -40000.0);
  CHECK(glyph.contours[2].centroid == Point(200, 530));
  // The ring balances at (200, 200), the dot at (200, 530).
  CHECK(glyph.centroid.x() == Approx(200.0));
  CHECK(glyph.centroid.y() == Approx((120000.0 * 200.0 + 3600.0 * 530.0) / 123600.0));
  // A square of side a has a^4 / 12 across its middle.
  CHECK(glyph.second_moments[0] == Approx((std::pow(400, 4) - std::pow(200, 4) + std::pow(60, 4)) / 12.0));
  CHECK(glyph.second_moments[1] == Approx(0.0).margin(1e-3));
}

TEST_CASE("what overlaps is enclosed twice and inked once", "[area]") {
  const AreaBaseline areas =
      measured(font_of({shapes::square(400), transform(shapes::square(400), {.shift = Point(200, 0)})}));
  CHECK(areas.glyphs[0].area == 320000.0);
  CHECK(*areas.glyphs[0].ink == Approx(240000.0));
  CHECK(areas.glyphs[0].colour_area() == Approx(240000.0));
}

TEST_CASE("a baseline is one line a glyph, sorted by name, and reads back", "[area]") {
  const Font font = load_font(bundled_otf[0]);
  for (const AreaMetrics metrics : {AreaMetrics::Area, AreaMetrics::All}) {
    AreaBaseline baseline = measured(font, selection, metrics);
    baseline.tolerances["a"].percent = 2.0;
    const std::string json = baseline_json(baseline);
    std::istringstream lines(json);
    std::vector<std::string> names;
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with("{\"name\":")) continue;
      names.push_back(nlohmann::json::parse(line.ends_with(',') ? line.substr(0, line.size() - 1) : line)["name"]);
    }
    CHECK(names.size() == baseline.glyphs.size());
    CHECK(std::is_sorted(names.begin(), names.end()));
    const AreaBaseline read = parse_baseline(json);
    CHECK(baseline_json(read) == json);
    CHECK(read.tolerances.at("a").percent == 2.0);
    CHECK(read.is_selection);
    for (std::size_t i = 0; i < read.glyphs.size(); ++i) CHECK(read.glyphs[i].area == baseline.glyphs[i].area);
    CHECK(compare_areas(read, baseline, "same").drifts.empty());
  }
}

TEST_CASE("a baseline that is none is refused, and the place is named", "[area]") {
  const auto refuses = [](const std::string& json, const std::string& why) {
    CHECK_THROWS_WITH(parse_baseline(json), Catch::Contains(why));
  };
  refuses("[]", "must be an object");
  refuses("not", "not JSON");
  refuses(R"({"version":2,"unitsPerEm":1000,"glyphs":[]})", "version");
  refuses(R"({"version":1,"unitsPerEm":0,"glyphs":[]})", "unitsPerEm");
  refuses(R"({"version":1,"unitsPerEm":1000})", "glyphs: is missing");
  refuses(R"({"version":1,"unitsPerEm":1000,"glyphs":[{"name":"a","area":1}]})", "glyphs[0].advance: is missing");
  refuses(R"({"version":1,"unitsPerEm":1000,"glyphs":[],"colour":1})", "colour: unknown key");
  refuses(R"({"version":1,"unitsPerEm":1000,"tolerances":{"a":{"percent":-1}},"glyphs":[]})", "must not be negative");
}

TEST_CASE("the number of threads does not change a baseline", "[area]") {
  const Font font = load_font(bundled_ttf[0]);
  const std::vector<int> ids = select_glyphs(font, selection);
  AreaBaseline one;
  AreaBaseline many;
  one.units_per_em = many.units_per_em = font.units_per_em;
  one.metrics = many.metrics = AreaMetrics::All;
  one.glyphs = measure_areas(font, ids, AreaMetrics::All, "", {.jobs = 1});
  many.glyphs = measure_areas(font, ids, AreaMetrics::All, "", {.jobs = 7});
  CHECK(baseline_json(one) == baseline_json(many));
}

TEST_CASE("a check names the counter and by how much it changed", "[area]") {
  auto smaller = ring_and_dot();
  smaller[1] = reverse(transform(shapes::square(198), {.shift = Point(101, 101)}));
  const AreaComparison comparison = compare(ring_and_dot(), smaller);
  REQUIRE(messages(comparison).size() == 1);
  CHECK_THAT(messages(comparison)[0], Catch::StartsWith("g: ink +0.644 % (123600 to 124396), counter -1.99 %"));
  CHECK(comparison.report.worst() == Status::Fail);
}

TEST_CASE("a check names the part that moved though no area changed", "[area]") {
  auto other = ring_and_dot();
  other[2] = transform(other[2], {.shift = Point(0, 4)});
  const AreaComparison comparison = compare(ring_and_dot(), other);
  REQUIRE(messages(comparison).size() == 1);
  CHECK_THAT(messages(comparison)[0], Catch::StartsWith("g: contour at (200, 534) moved by (0, 4)"));
}

TEST_CASE("a check names the size of the features that came", "[area]") {
  // Saw teeth 20 units wide on the top of a square, as much above the edge as below.
  std::vector<Point> corners{{0, 0}, {400, 0}, {400, 400}};
  for (int x = 390; x > 0; x -= 20) corners.push_back({static_cast<double>(x), x % 40 == 30 ? 403.0 : 397.0});
  corners.push_back({0, 400});
  const AreaComparison comparison = compare({shapes::square(400)}, {shapes::polygon(corners)});
  REQUIRE(messages(comparison).size() == 1);
  CHECK_THAT(messages(comparison)[0], Catch::Contains("detail of 8 to ") || Catch::Contains("detail below "));
  CHECK_THAT(messages(comparison)[0], Catch::Contains("32 units +") || Catch::Contains("16 units +"));
}

TEST_CASE("tolerances are in percent, in square units, in moves and per glyph", "[area]") {
  const auto grown = std::vector{shapes::square(401)};  // by 0.5 %
  const auto square = std::vector{shapes::square(400)};
  CHECK(named(compare(square, grown)).size() == 1);
  CHECK_THAT(messages(compare(square, grown, {.percent = 1.0}))[0], Catch::StartsWith("g: detail"));
  CHECK(named(compare(square, grown, {.percent = 1.0, .move = 1000.0})).empty());
  CHECK(named(compare(square, grown, {.percent = 1.0, .area_only = true})).empty());
  CHECK(named(compare(square, grown, {.percent = 0.4, .area_only = true})).size() == 1);
  CHECK(named(compare(square, grown, {.percent = 0.0, .units = 900.0, .area_only = true})).empty());
  AreaBaseline before = measured(font_of(square));
  before.tolerances["g"] = {.percent = 1.0, .units = {}, .move = 1000.0};
  CHECK(compare_areas(before, measured(font_of(grown)), "now").drifts.empty());
  CHECK_THROWS_AS(compare(square, grown, {.percent = -1.0}), fontcore::InvalidInput);
}

TEST_CASE("glyphs are matched by character first, then by name, and what is gone or new is told", "[area]") {
  Font before = font_of({shapes::square(400)});
  before.glyphs[0].name = "a";
  before.character_map[U'a'] = 0;
  Font renamed = before;
  renamed.glyphs[0].name = "uni0061";
  CHECK(messages(compare_areas(measured(before), measured(renamed), "now")).empty());
  Font recoded = before;
  recoded.character_map = {{U'b', 0}};
  CHECK(messages(compare_areas(measured(before), measured(recoded), "now")).empty());
  Font other = renamed;
  other.character_map = {{U'b', 0}};
  const AreaComparison comparison = compare_areas(measured(before), measured(other), "now");
  REQUIRE(messages(comparison).size() == 2);
  CHECK_THAT(messages(comparison)[0], Catch::StartsWith("a: has gone"));
  CHECK_THAT(messages(comparison)[1], Catch::StartsWith("uni0061: is new"));
  Font wider = before;
  wider.glyphs[0].advance += 1.0;
  CHECK(messages(compare_areas(measured(before), measured(wider), "now")) ==
        std::vector<std::string>{"a: advance 601, 600 before"});
}

TEST_CASE("directions count among contours that meet or nest, and nowhere else", "[area]") {
  const auto drawn = ring_and_dot();
  auto turned = drawn;
  for (BezierContour& contour : turned) contour = reverse(contour);
  CHECK(messages(compare(drawn, turned)).empty());
  auto dot_turned = drawn;
  dot_turned[2] = reverse(dot_turned[2]);
  CHECK(messages(compare(drawn, dot_turned)).empty());
  auto filled = drawn;
  filled[1] = reverse(filled[1]);
  REQUIRE(messages(compare(drawn, filled)).size() == 1);
  CHECK_THAT(messages(compare(drawn, filled))[0], Catch::Contains("counter is filled"));
}

TEST_CASE("a font at another em is one finding, or none if that is asked for", "[area]") {
  const Font font = letters_of(bundled_otf[0]);
  for (const double factor : {2.0, 2.048, 0.5}) {
    Font other = font;
    other.units_per_em = static_cast<int>(std::round(factor * font.units_per_em));
    for (Glyph& glyph : other.glyphs) {
      glyph.advance = std::round(factor * glyph.advance);
      for (BezierContour& contour : glyph.contours) {
        fontcore::Points points = (factor * contour.points().array()).round();
        contour = contour.with_points(points);
      }
    }
    const AreaBaseline before = measured(font);
    const AreaBaseline now = measured(other);
    CAPTURE(factor);
    CHECK(messages(compare_areas(before, now, "now", {.rescale = true})).empty());
    const AreaComparison plain = compare_areas(before, now, "now");
    REQUIRE(messages(plain).size() == 1);
    CHECK_THAT(messages(plain)[0], Catch::StartsWith("units per em: "));
  }
}

TEST_CASE("every change of area by 0.2 % and every local move of 4/1000 em is found and named, and nothing else",
          "[area][mutation]") {
  std::mt19937 random(7);
  for (const std::string& path : {bundled_otf[0], bundled_ttf[2]}) {
    const Font font = letters_of(path);
    const AreaBaseline before = measured(font, selection);
    const auto check = [&](const auto& change) {
      Font other = font;
      std::set<std::string> changed;
      for (const int id : select_glyphs(font, selection)) {
        Glyph& glyph = other.glyphs[static_cast<std::size_t>(id)];
        if (id % 3 != 0) continue;
        std::optional<Outline> outline = change(glyph.contours);
        if (!outline) continue;
        glyph.contours = std::move(*outline);
        changed.insert(glyph.name);
      }
      CHECK(named(compare_areas(before, measured(other, selection), path)) == changed);
      return changed.size();
    };
    for (const double share : {2e-3, -2e-3})
      CHECK(check([&](const Outline& outline) { return with_other_area(outline, share, random); }) > 10);
    for (const LocalMove how : local_moves)
      CHECK(check([&](const Outline& outline) {
              return locally_moved(outline, how, 4e-3 * font.units_per_em, random);
            }) > 3);
  }
}

TEST_CASE("other starts, another order, the other direction and other curves are no findings", "[area][mutation]") {
  for (const std::string& path : {bundled_otf[0], bundled_ttf[2]}) {
    const Font read = load_font(path);
    const Font font = flattened(read);
    const AreaBaseline before = measured(font);
    for (const auto& same : {with_other_starts, in_other_order, the_other_way}) {
      Font other = font;
      for (Glyph& glyph : other.glyphs)
        if (!glyph.contours.empty()) glyph.contours = same(glyph.contours);
      CHECK(messages(compare_areas(before, measured(other), path)).empty());
    }
    const bool is_truetype = read.format == OutlineFormat::TrueType;
    const ConvertedFont converted = convert_font(read, is_truetype ? FileKind::OpenType : FileKind::TrueType);
    CHECK(messages(compare_areas(before, measured(load_font_bytes(path, converted.font.data)), path)).empty());
  }
}

// By other programs --------------------------------------------------------------------------------------------------

TEST_CASE("areas are those of fontTools' areaPen on every glyph of five fonts", "[area][python]") {
  if (!has_modules("fontTools.pens.areaPen")) {
    WARN("skipped: " + python + " has no fontTools (Debian: python3-fonttools)");
    return;
  }
  const std::string script = R"(
import sys
from fontTools.ttLib import TTFont
from fontTools.pens.areaPen import AreaPen
font = TTFont(sys.argv[1])
glyphs = font.getGlyphSet()
for index, name in enumerate(font.getGlyphOrder()):
    pen = AreaPen(glyphs)
    glyphs[name].draw(pen)
    print(index, repr(float(pen.value)))
)";
  for (const std::string& path : {bundled_ttf[0], bundled_ttf[2], bundled_otf[0], bundled_otf[2], bundled_otf[3]}) {
    const Font font = load_font(path);
    std::vector<int> ids(font.glyphs.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<int>(i);
    std::map<std::string, double> ours;
    for (const GlyphArea& glyph : measure_areas(font, ids, AreaMetrics::Area)) ours[glyph.name] = glyph.area;
    std::istringstream theirs(run_python(script, {path}));
    std::size_t id = 0;
    double area = 0.0;
    std::size_t count = 0;
    double worst = 0.0;
    for (; theirs >> id >> area; ++count) {
      const double own = ours.at(font.glyphs.at(id).name);
      worst = std::max(worst, std::abs(own - area) / std::max(1.0, std::abs(area)));
    }
    CAPTURE(path);
    CHECK(count == font.glyphs.size());
    CHECK(worst < 1e-9);
  }
}

TEST_CASE("ink is the union of polygons to the error of their flattening", "[area][python]") {
  if (!has_modules("fontTools, shapely")) {
    WARN("skipped: " + python + " has no fontTools or no shapely (Debian: python3-fonttools, python3-shapely)");
    return;
  }
  // Liberation Serif and Open Sans have contours that overlap; the non-zero rule by the union of all pieces whose
  // winding number is not 0.
  const std::string script = R"(
import json, sys
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import polygonize, unary_union
def winding(point, ring):
    n = 0
    for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1]):
        if (y0 <= point.y) != (y1 <= point.y):
            x = x0 + (point.y - y0) * (x1 - x0) / (y1 - y0)
            if x > point.x: n += 1 if y1 > y0 else -1
    return n
for line in open(sys.argv[1]):
    rings = [[tuple(p) for p in ring] for ring in json.loads(line)]
    lines = unary_union([LineString(ring + ring[:1]) for ring in rings])
    area = 0.0
    for piece in polygonize(lines):
        inside = piece.representative_point()
        if sum(winding(inside, ring) for ring in rings) != 0: area += piece.area
    print(repr(area))
)";
  for (const std::string& path : {bundled_ttf[0], bundled_ttf[2], bundled_otf[2]}) {
    const Font font = load_font(path);
    const AreaBaseline areas =
        measured(font, "U+0041,U+0051,U+0061-0067,U+0025,U+0040,U+00A9,U+01FA,U+0110,U+00C7,U+00D8");
    const TestFolder folder;
    std::ofstream file(folder / "rings");
    std::vector<double> ours;
    std::vector<double> bound;
    for (const GlyphArea& glyph : areas.glyphs) {
      nlohmann::json rings = nlohmann::json::array();
      double flattened = 0.0;  // what polylines leave out, contour by contour
      for (const BezierContour& contour : compose(font, font.find(glyph.name))) {
        const fontcore::Points points = fontcore::to_polyline(contour, 2.0);
        nlohmann::json ring = nlohmann::json::array();
        for (Eigen::Index i = 0; i < points.rows(); ++i) ring.push_back({points(i, 0), points(i, 1)});
        double polygon = 0.0;
        for (Eigen::Index i = 0; i < points.rows(); ++i) {
          const Eigen::Index next = (i + 1) % points.rows();
          polygon += 0.5 * (points(i, 0) * points(next, 1) - points(next, 0) * points(i, 1));
        }
        flattened += 1e-3 * fontcore::length(contour) + std::abs(polygon - fontcore::signed_area(contour));
        rings.push_back(std::move(ring));
      }
      file << rings.dump() << '\n';
      ours.push_back(*glyph.ink);
      bound.push_back(2.0 * flattened);
    }
    file.close();
    std::istringstream theirs(run_python(script, {folder / "rings"}));
    for (std::size_t i = 0; i < ours.size(); ++i) {
      double area = 0.0;
      REQUIRE(theirs >> area);
      CAPTURE(path, areas.glyphs[i].name);
      CHECK(std::abs(area - ours[i]) <= bound[i]);
    }
  }
}

TEST_CASE("what fontTools does to a font without moving its outlines is no finding", "[area][python][mutation]") {
  if (!has_modules("fontTools.subset, fontTools.ttLib.scaleUpem")) {
    WARN("skipped: " + python + " has no fontTools 4.33 or later (Debian: python3-fonttools)");
    return;
  }
  const std::string script = R"(
import sys
from fontTools import subset
from fontTools.ttLib import TTFont
from fontTools.ttLib.scaleUpem import scale_upem
from fontTools.pens.cu2quPen import Cu2QuPen
from fontTools.pens.ttGlyphPen import TTGlyphPen
from fontTools.pens.recordingPen import DecomposingRecordingPen
from fontTools.fontBuilder import FontBuilder
change, source, target = sys.argv[1:]
font = TTFont(source, recalcBBoxes=change == "rescale")
if change == "hinting":
    options = subset.Options(hinting=False, notdef_outline=True, glyph_names=True, name_IDs=["*"],
                             layout_features=["*"], recalc_bounds=False)
    chosen = subset.Subsetter(options)
    chosen.populate(glyphs=font.getGlyphOrder())
    chosen.subset(font)
elif change == "tables":
    for tag in ("GSUB", "GPOS", "GDEF", "kern", "DSIG", "gasp", "FFTM"):
        if tag in font: del font[tag]
    for record in font["name"].names: record.string = "Other"
    font["OS/2"].usWeightClass = 123
elif change == "rescale":
    scale_upem(font, int(2 * font["head"].unitsPerEm))
elif change == "quadratic":
    glyphs, order = font.getGlyphSet(), font.getGlyphOrder()
    drawn, metrics = {}, {}
    for name in order:
        pen = TTGlyphPen(None)
        glyphs[name].draw(Cu2QuPen(pen, font["head"].unitsPerEm / 1000, reverse_direction=True))
        drawn[name] = pen.glyph()
        metrics[name] = (font["hmtx"][name][0], 0)
    made = FontBuilder(font["head"].unitsPerEm, isTTF=True)
    made.setupGlyphOrder(order)
    made.setupCharacterMap(font.getBestCmap())
    made.setupGlyf(drawn)
    glyf = made.font["glyf"]
    made.setupHorizontalMetrics({n: (m[0], getattr(glyf[n], "xMin", 0)) for n, m in metrics.items()})
    made.setupHorizontalHeader(ascent=800, descent=-200)
    made.setupNameTable({"familyName": "Made", "styleName": "Regular"})
    made.setupOS2()
    made.setupPost()
    font = made.font
font.save(target)
)";
  const TestFolder folder;
  const auto changed = [&](const std::string& path, const std::string& change) {
    const std::string target = folder / "changed";
    run_python(script, {change, path, target});
    return load_font(target);
  };
  for (const std::string& path : {bundled_ttf[0], bundled_otf[0]}) {
    const AreaBaseline before = measured(load_font(path));
    for (const char* change : {"hinting", "tables"}) {
      CAPTURE(path, change);
      CHECK(messages(compare_areas(before, measured(changed(path, change)), path)).empty());
    }
    CHECK(messages(compare_areas(before, measured(changed(path, "rescale")), path, {.rescale = true})).empty());
  }
  for (const std::string& path : bundled_otf) {
    CAPTURE(path);
    CHECK(messages(compare_areas(measured(load_font(path)), measured(changed(path, "quadratic")), path)).empty());
  }
}
