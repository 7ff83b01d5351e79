#include "glyphs/ufo.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "fontcore/soften.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/safe_file.h"
#include "glyphs/shaping.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/folder.h"
#include "tests/shapes.h"

namespace {

namespace fs = std::filesystem;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using glyphs::Bytes;
using glyphs::EditedGlyphs;
using glyphs::Folder;
using glyphs::Font;
using glyphs::FontReadError;
using glyphs::FontWriteError;
using glyphs::Glyph;
using glyphs::load_ufo;
using glyphs::OutlineFormat;
using glyphs::write_ufo;
using glyphs::WrittenUfo;

Bytes bytes_of(const std::string& content) { return {content.begin(), content.end()}; }
std::string text_of(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }
std::string text_of(const Folder& folder, const std::string& file) { return text_of(folder.at(file)); }

std::string plist(const std::string& object) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE plist PUBLIC \"-//Apple//DTD PLIST 1.0//EN\" "
         "\"http://www.apple.com/DTDs/PropertyList-1.0.dtd\">\n<plist version=\"1.0\">\n" +
         object + "\n</plist>\n";
}

/// A glyph in a hand no program writes: both kinds of quotes, odd order, comments, things unknown.
const std::string letter_i = R"(<?xml version='1.0' encoding='UTF-8'?>
<!-- drawn by hand -->
<glyph format="2"  name='i' >
	<advance height="10" width="300.5"/>
	<unicode hex="0069"/><unicode hex="FF49"/>
	<note>keep &lt;me&gt;</note>
	<image fileName="i.png" xOffset="3"/>
	<guideline x="100" name="stem"/>
	<anchor x="150" y="700" name="top"/>
	<outline>
		<contour identifier="stem">
			<point y='0' type="line" x="100" name="first" identifier="p1"/>
			<point x="200" y="0" type="line" other="x"/> <!-- foot -->
			<point x="200.50" y="&#53;00" type="curve" smooth="no"></point>
			<point x="100" y="500" type="line"/>
		</contour>
		<contour><point x="150" y="720" type="move" name="old anchor"/></contour>
		<contour>
			<point x="150" y="600" type="curve" smooth="yes" identifier="dot"/>
			<point x="177" y="600"/>
			<point x="200" y="622"/>
			<point x="200" y="650" type="curve" smooth="yes"/>
			<point x="200" y="677"/>
			<point x="177" y="700"/>
			<point x="150" y="700" type="curve" smooth="yes"/>
			<point x="100" y="700" type="offcurve"/>
			<point x="100" y="600"/>
		</contour>
		<contour><point x="0" y="0" type="move"/><point x="10" y="0" type="line"/></contour>
	</outline>
	<lib><dict><key>com.example.unknown</key><array><data>AAEC</data></array></dict></lib>
</glyph>
)";

std::string glif(const std::string& name, const std::string& outline, const std::string& lib = "") {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<glyph name=\"" + name +
         "\" format=\"2\">\n  <advance width=\"500\"/>\n" + "  <outline>\n" + outline + "  </outline>\n" +
         (lib.empty() ? "" : "  <lib>" + lib + "</lib>\n") + "</glyph>\n";
}

const std::string box_outline = R"(    <contour>
      <point x="0" y="0" type="line"/>
      <point x="400" y="0" type="line"/>
      <point x="400" y="700" type="line"/>
      <point x="0" y="700" type="line"/>
    </contour>
)";

/// A UFO of four glyphs: i as above, box, a composite of both, and quadratics without a node.
Folder made_ufo() {
  Folder ufo;
  const auto put = [&](const std::string& file, const std::string& content) { ufo[file] = bytes_of(content); };
  put("metainfo.plist",
      plist("<dict><key>creator</key><string>me</string><key>formatVersion</key><integer>3</integer></dict>"));
  put("fontinfo.plist",
      plist("<dict><key>familyName</key><string>A &amp; B</string><key>styleName</key><string>Bold</string>"
            "<key>unitsPerEm</key><integer>1000</integer><key>ascender</key><real>750.5</real>"
            "<key>descender</key><integer>-250</integer></dict>"));
  put("layercontents.plist", plist("<array><array><string>public.default</string><string>glyphs</string></array>"
                                   "<array><string>sketch</string><string>glyphs.sketch</string></array></array>"));
  put("lib.plist", plist("<dict><key>public.glyphOrder</key><array><string>quad</string><string>gone</string>"
                         "<string>i</string></array></dict>"));
  put("glyphs/contents.plist",
      plist("<dict><key>both</key><string>both.glif</string><key>box</key><string>box.glif</string>"
            "<key>i</key><string>i.glif</string><key>quad</key><string>quad.glif</string></dict>"));
  put("glyphs/i.glif", letter_i);
  put("glyphs/box.glif", glif("box", box_outline));
  put("glyphs/both.glif", glif("both", R"(    <component base="i" xScale="2" xyScale="0.5" yxScale="-1" xOffset="30"/>
    <component base="box" yOffset="-5.5"/>
)" + box_outline));
  put("glyphs/quad.glif", glif("quad", R"(    <contour>
      <point x="0" y="0"/>
      <point x="100" y="0"/>
      <point x="100" y="100"/>
      <point x="0" y="100"/>
    </contour>
)"));
  put("glyphs.sketch/contents.plist", plist("<dict/>"));
  put("features.fea", "include(../elsewhere.fea);\n");
  put("kerning.plist", "kept whatever it says");
  put("data/com.example/blob", std::string("\0\1\2", 3));
  put("images/i.png", "no picture");
  return ufo;
}

Font made_font() { return load_ufo("made.ufo", made_ufo()); }

const Glyph& glyph_of(const Font& font, const std::string& name) {
  return font.glyphs.at(static_cast<std::size_t>(font.find(name)));
}

std::vector<BezierContour> moved(const std::vector<BezierContour>& contours, const Point& shift) {
  std::vector<BezierContour> all;
  for (const BezierContour& contour : contours) all.push_back(transform(contour, {.shift = shift}));
  return all;
}

/// The lines of one text that are not those of the other, by their numbers.
std::vector<std::string> changed_lines(const std::string& before, const std::string& after) {
  std::istringstream a(before);
  std::istringstream b(after);
  std::vector<std::string> changed;
  std::string old_line;
  std::string new_line;
  while (std::getline(a, old_line)) {
    REQUIRE(std::getline(b, new_line));
    if (old_line != new_line) changed.push_back(new_line);
  }
  CHECK_FALSE(std::getline(b, new_line));
  return changed;
}

/// What reading the made UFO says when one of its files is another one.
std::string refusal(const std::string& file, const std::string& content) {
  Folder ufo = made_ufo();
  ufo[file] = bytes_of(content);
  const std::string message = message_of<FontReadError>([&] { load_ufo("made.ufo", ufo); });
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

std::string trouble(const std::string& content) {
  Folder ufo = made_ufo();
  ufo["glyphs/box.glif"] = bytes_of(content);
  const Font font = load_ufo("made.ufo", ufo);
  const Glyph& glyph = glyph_of(font, "box");
  CHECK(glyph.contours.empty());
  CHECK(glyph.trouble.find('\n') == std::string::npos);
  CHECK(glyph_of(font, "i").trouble.empty());
  if (!glyph.trouble.empty()) CHECK(write_ufo(font, {}).folder == ufo);
  return glyph.trouble;
}

}  // namespace

TEST_CASE("a UFO is read as plain values, glyphs in the order it gives them", "[ufo]") {
  const Font font = made_font();
  CHECK(font.format == OutlineFormat::Ufo);
  CHECK(font.units_per_em == 1000);
  CHECK(font.ascender == 750.5);
  CHECK(font.descender == -250);
  CHECK(font.family == "A & B");
  CHECK(font.style == "Bold");
  CHECK(font.has_fractional_coordinates);
  std::vector<std::string> names;
  for (const Glyph& glyph : font.glyphs) names.push_back(glyph.name);
  CHECK(names == std::vector<std::string>{"quad", "i", "both", "box"});
  CHECK(font.character_map == std::map<char32_t, int>{{U'i', 1}, {U'\uFF49', 1}});
  const Glyph& i = glyph_of(font, "i");
  CHECK(i.advance == 300.5);
  CHECK(i.trouble.empty());
  CHECK(i.marks.empty());
  // Neither the old anchor nor the open contour is an outline.
  REQUIRE(i.contours.size() == 2);
  CHECK(i.contours[0].point(2) == Point(200.5, 500));
  CHECK(i.contours[0].segment_count() == 4);
  CHECK(i.contours[1].segment_count() == 3);
  CHECK(i.contours[1].kind(1) == PointKind::Cubic);
  CHECK(i.contours[1].kind(7) == PointKind::Cubic);
}

TEST_CASE("quadratics without a node have implied ones, a glyph may have contours and components", "[ufo]") {
  const Font font = made_font();
  CHECK(glyph_of(font, "quad").contours.at(0) ==
        shapes::all_implied(shapes::points_of({{0, 0}, {100, 0}, {100, 100}, {0, 100}})));
  const int both = font.find("both");
  CHECK(font.glyphs[static_cast<std::size_t>(both)].contours.size() == 1);
  const auto composed = glyphs::compose(font, both);
  REQUIRE(composed.size() == 4);
  // (100, 0) of i: x' = 2 x - y + 30, y' = 0.5 x + y
  CHECK(composed[1].point(0) == Point(230, 50));
  CHECK(composed[3].point(2) == Point(400, 694.5));
}

TEST_CASE("with nothing edited every file of a UFO is the same, bit for bit", "[ufo]") {
  const Font font = made_font();
  CHECK(write_ufo(font, {}).folder == made_ufo());
  EditedGlyphs same;
  for (const Glyph& glyph : font.glyphs) same[glyph.id] = glyph.contours;
  const WrittenUfo written = write_ufo(font, same);
  CHECK(written.folder == made_ufo());
  CHECK(written.changed_files.empty());
  CHECK(written.warnings.empty());
}

TEST_CASE("a moved point changes its own digits and nothing else in the UFO", "[ufo]") {
  const Font font = made_font();
  const int id = font.find("i");
  std::vector<BezierContour> contours = glyph_of(font, "i").contours;
  fontcore::Points points = contours[0].points();
  points(0, 0) = 90.25;
  points(2, 1) = -7;
  contours[0] = contours[0].with_points(points);
  const WrittenUfo written = write_ufo(font, {{id, contours}});
  CHECK(written.changed_files == std::vector<std::string>{"glyphs/i.glif"});
  CHECK(written.moved_composites == std::vector<int>{font.find("both")});
  Folder others = written.folder;
  others["glyphs/i.glif"] = bytes_of(letter_i);
  CHECK(others == made_ufo());
  CHECK(changed_lines(letter_i, text_of(written.folder, "glyphs/i.glif")) ==
        std::vector<std::string>{"\t\t\t<point y='0' type=\"line\" x=\"90.25\" name=\"first\" identifier=\"p1\"/>",
                                 "\t\t\t<point x=\"200.50\" y=\"-7\" type=\"curve\" smooth=\"no\"></point>"});
  CHECK(load_ufo("again", written.folder).glyphs[static_cast<std::size_t>(id)].contours == contours);
  CHECK(written.warnings == std::vector<std::string>{"anchors: kept where they were in i"});
}

TEST_CASE("whole numbers are written without a fraction, others as short as they read back", "[ufo]") {
  const Font font = made_font();
  const int id = font.find("box");
  std::string all;
  for (const double x : {-0.0, 12.0, 0.1, 1e5, 1.0 / 3.0, 1e-7}) {
    const auto written = write_ufo(font, {{id, moved(glyph_of(font, "box").contours, {x, 0})}});
    const std::string content = text_of(written.folder, "glyphs/box.glif");
    const std::size_t at = content.find("<point x=\"") + 10;
    all += content.substr(at, content.find('"', at) - at) + " ";
  }
  CHECK(all == "0 12 0.1 100000 0.3333333333333333 0.0000001 ");
}

TEST_CASE("a softened corner gives way to new points, the others keep their elements", "[ufo]") {
  Folder ufo = made_ufo();
  ufo["glyphs/box.glif"] = bytes_of(glif("box", R"(    <contour identifier="c">
      <point x="0" y="0" type="line" name="a"/>
      <point x="400" y="0" type="line" identifier="b"/>
      <!-- right -->
      <point x="400" y="700" type="line" name="c"/>
      <point x="0" y="700" type="line" identifier="d"/>
    </contour>
)"));
  const Font font = load_ufo("made.ufo", ufo);
  const int id = font.find("box");
  const BezierContour& box = glyph_of(font, "box").contours[0];
  const auto soft =
      fontcore::soften(box, {.radius = 50, .corners = std::vector<int>{1}, .arcs = fontcore::ArcKind::Cubic});
  const auto written = write_ufo(font, {{id, {soft.contour}}});
  const std::string content = text_of(written.folder, "glyphs/box.glif");
  CHECK(load_ufo("again", written.folder).glyphs[static_cast<std::size_t>(id)].contours[0] == soft.contour);
  INFO(content);
  CHECK(content.find("<contour identifier=\"c\">\n      <point x=\"0\" y=\"0\" type=\"line\" name=\"a\"/>\n"
                     "      <point x=\"350\" y=\"0\" type=\"line\" smooth=\"yes\"/>\n      <point x=\"377.") !=
        std::string::npos);
  CHECK(content.find("<point x=\"400\" y=\"50\" type=\"curve\" smooth=\"yes\"/>\n      <!-- right -->\n"
                     "      <point x=\"400\" y=\"700\" type=\"line\" name=\"c\"/>\n"
                     "      <point x=\"0\" y=\"700\" type=\"line\" identifier=\"d\"/>\n    </contour>") !=
        std::string::npos);
  CHECK(written.warnings == std::vector<std::string>{"box: 1 points or components with a name or identifier are gone"});

  // With everything moved as well, only their origins tell which points are which.
  const BezierContour far = transform(soft.contour, {.shift = Point(7, 9)});
  const auto told = write_ufo(font, {{id, {far}}}, {.origins = {{id, {soft.came_from}}}});
  CHECK(load_ufo("again", told.folder).glyphs[static_cast<std::size_t>(id)].contours[0] == far);
  CHECK(text_of(told.folder, "glyphs/box.glif").find("<point x=\"7\" y=\"709\" type=\"line\" identifier=\"d\"/>") !=
        std::string::npos);
  const auto untold = write_ufo(font, {{id, {far}}});
  CHECK(load_ufo("again", untold.folder).glyphs[static_cast<std::size_t>(id)].contours[0] == far);
}

TEST_CASE("quadratics with other points are written so that the same come back", "[ufo]") {
  const Font font = made_font();
  const int id = font.find("box");
  const BezierContour& box = glyph_of(font, "box").contours[0];
  const auto soft = fontcore::soften(box, {.radius = 40, .arcs = fontcore::ArcKind::Quadratic});
  const auto written = write_ufo(font, {{id, {soft.contour}}});
  const Font again = load_ufo("again", written.folder);
  CHECK(again.glyphs[static_cast<std::size_t>(id)].contours[0].kinds() == soft.contour.kinds());
  const auto back = write_ufo(again, {{id, {box}}});
  CHECK(load_ufo("back", back.folder).glyphs[static_cast<std::size_t>(id)].contours[0] == box);
}

TEST_CASE("a composite of a UFO is decomposed where that is asked for", "[ufo]") {
  const Font font = made_font();
  const int id = font.find("both");
  std::vector<BezierContour> contours = moved(decompose(font, id), {7, 0});
  const WrittenUfo written = write_ufo(font, {{id, contours}}, {.composites = glyphs::Composites::Decompose});
  CHECK(written.decomposed == std::vector<int>{id});
  CHECK(written.changed_files == std::vector<std::string>{"glyphs/both.glif"});
  const std::string before = text_of(made_ufo(), "glyphs/both.glif");
  const std::string after = text_of(written.folder, "glyphs/both.glif");
  CHECK(after.find("<component") == std::string::npos);
  CHECK(after.substr(0, after.find("<contour")) ==
        before.substr(0, std::min(before.find("<contour"), before.find("<component"))));
  const Font again = load_ufo("again", written.folder);
  CHECK(again.glyphs[static_cast<std::size_t>(id)].contours == contours);
  CHECK(again.glyphs[static_cast<std::size_t>(id)].components.empty());
}

TEST_CASE("what cannot be written is refused by glyph", "[ufo]") {
  const Font font = made_font();
  const int id = font.find("box");
  const auto said = [&](const EditedGlyphs& edited) {
    return message_of<FontWriteError>([&] { write_ufo(font, edited); });
  };
  CHECK(said({{9, {}}}) == "made.ufo: glyph 9 is no glyph of the font, which has 4");
  CHECK(said({{id, {}}}) == "made.ufo: box: 0 contours for the font's 1");
  CHECK(said({{id, {shapes::square(3e6)}}}) == "made.ufo: box: contour 0, point 1: (3e+06, 0) is beyond 1e+06");
  fontcore::Points points = glyph_of(font, "quad").contours[0].points();
  points(1, 0) += 1;
  CHECK(said({{font.find("quad"), {glyph_of(font, "quad").contours[0].with_points(points)}}})
            .find("is an implied node not midway between its handles") != std::string::npos);
  CHECK(message_of<FontWriteError>([&] {
          write_ufo(glyphs::load_font(bundled_ttf[0]), {});
        }).ends_with("the font was not read from a UFO"));
}

TEST_CASE("hints of an edited glyph are kept and named as stale", "[ufo]") {
  Folder ufo = made_ufo();
  const std::string lib =
      "<dict><key>public.postscript.hints</key><dict><key>id</key><string>w400x</string></dict></dict>";
  ufo["glyphs/box.glif"] = bytes_of(glif("box", box_outline, lib));
  const Font font = load_ufo("made.ufo", ufo);
  const auto written = write_ufo(font, {{font.find("box"), moved(glyph_of(font, "box").contours, {1, 0})}});
  CHECK(text_of(written.folder, "glyphs/box.glif").find(lib) != std::string::npos);
  CHECK(written.warnings == std::vector<std::string>{"public.postscript.hints: kept, though the outline is another one "
                                                     "now: stale in box"});
}

TEST_CASE("marks of points and contours are read by their identifiers", "[ufo]") {
  const std::string outline = R"(    <contour><point x="0" y="0" type="move" identifier="p0"/></contour>
    <contour identifier="c1">
      <point x="0" y="0" type="line" identifier="p1"/>
      <point x="400" y="0" type="line"/>
      <point x="400" y="700" type="line" identifier="p2"/>
    </contour>
    <contour identifier="c2">
      <point x="0" y="0" identifier="h"/>
      <point x="100" y="0"/>
      <point x="50" y="100"/>
    </contour>
)";
  const auto lib = [](const std::string& entries) {
    return "<dict><key>public.objectLibs</key><dict>" + entries + "</dict></dict>";
  };
  const auto mark = [](const std::string& identifier, const std::string& settings) {
    return "<key>" + identifier + "</key><dict><key>org.glyphwave.marks</key><dict>" + settings + "</dict></dict>";
  };
  Folder ufo = made_ufo();
  const auto marks = [&](const std::string& entries) {
    ufo["glyphs/box.glif"] = bytes_of(glif("box", outline, lib(entries)));
    return glyph_of(load_ufo("made.ufo", ufo), "box");
  };
  const Glyph marked = marks(
      mark("p1", "<key>corner</key><true/>") + mark("p2", "<key>freeze</key><true/><key>corner</key><true/>") +
      mark("c2", "<key>freeze</key><true/><key>scale</key><real>12.5</real>") +
      mark("nobody", "<key>corner</key><true/>") + "<key>other</key><dict><key>x</key><integer>1</integer></dict>");
  CHECK(marked.trouble.empty());
  REQUIRE(marked.marks.size() == 2);
  CHECK(marked.marks[0].corners == std::vector<int>{0, 2});
  CHECK(marked.marks[0].frozen == std::vector<int>{2});
  CHECK_FALSE(marked.marks[0].scale);
  CHECK(marked.marks[1].frozen == std::vector<int>{0, 1, 2, 3, 4, 5});
  CHECK(marked.marks[1].scale == 12.5);
  CHECK(marks(mark("p1", "<key>corner</key><false/>")).marks.empty());
  CHECK(marks(mark("p1", "<key>korner</key><true/>")).trouble ==
        "public.objectLibs: p1: org.glyphwave.marks: there is no \"korner\"");
  CHECK(marks(mark("p1", "<key>corner</key><integer>1</integer>")).trouble ==
        "public.objectLibs: p1: org.glyphwave.marks: corner is neither true nor false");
  CHECK(marks(mark("c1", "<key>scale</key><integer>0</integer>")).trouble ==
        "public.objectLibs: c1: org.glyphwave.marks: scale 0 is not above 0");
  CHECK(marks(mark("h", "<key>corner</key><true/>")).trouble ==
        "org.glyphwave.marks: point 0 is a handle, which cannot be a corner");
}

TEST_CASE("a glyph that cannot be read is in trouble, the font is good and the glyph is kept", "[ufo]") {
  const auto contour = [](const std::string& points) { return glif("box", "<contour>" + points + "</contour>"); };
  const std::string start = "<point x=\"0\" y=\"0\" type=\"line\"/><point x=\"9\" y=\"0\" type=\"line\"/>";
  CHECK(trouble("") == "is empty");
  CHECK(trouble("no XML") == "line 1: text before the root element");
  CHECK(trouble("<glyph name=\"box\" format=\"2\"><outline>") == "line 1: ends within <outline>");
  CHECK(trouble("<glyph name=\"box\" format=\"2\"><a></b></glyph>") == "line 1: </b> closes nothing");
  CHECK(trouble("<glyph name=\"box\" format=\"2\"/><glyph/>") == "line 1: a second root element");
  CHECK(trouble("<glyph name=\"box\" format=\"2\"/>end") == "line 1: text after the root element");
  CHECK(trouble("<glyph name=\"box\" format=\"2\" name=\"box\"/>") == "line 1: name stands twice");
  CHECK(trouble("<glyph name=\"box\" format=\"3\"/>") == "format \"3\" is not 1 or 2");
  CHECK(trouble("<glyph name=\"Box\" format=\"2\"/>") == "calls itself \"Box\", not what contents.plist has");
  CHECK(trouble("<plist/>") == "is no glyph");
  CHECK(trouble(glif("box", "") + '\xFF').find("is not UTF-8") != std::string::npos);
  CHECK(trouble(std::string("<\0g\0", 4)) == "is not in UTF-8, the only encoding that is read");
  CHECK(trouble("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><glyph/>").find("its encoding is not UTF-8") !=
        std::string::npos);
  CHECK(trouble("<!DOCTYPE glyph [<!ENTITY e \"x\">]><glyph name=\"box\" format=\"2\"/>") ==
        "line 1: the document type declares entities or elements, which is not read");
  CHECK(trouble("<glyph name=\"b&o;x\" format=\"2\"/>") == "line 1: an entity that XML itself does not define");
  CHECK(trouble("<glyph name=\"box&#0;\" format=\"2\"/>") == "line 1: an entity that XML itself does not define");
  CHECK(trouble(contour(start + "<point x=\"5\" type=\"line\"/>")) == "contour 0, point 2 has no place");
  CHECK(trouble(contour(start + "<point x=\"5\" y=\"ten\" type=\"line\"/>")) ==
        "contour 0, point 2: y \"ten\" is no number");
  for (const std::string bad : {"", " ", "0x10", "1,5", "+-1", "--1", "1e2x"}) {
    CHECK(trouble(contour(start + "<point x=\"" + bad + "\" y=\"0\" type=\"line\"/>")) ==
          "contour 0, point 2: x \"" + bad + "\" is no number");
  }
  for (const std::string bad : {"nan", "inf", "-inf", "1e400"}) {
    CHECK(trouble(contour(start + "<point x=\"" + bad + "\" y=\"0\" type=\"line\"/>")) ==
          "contour 0, point 2: x \"" + bad + "\" is not finite");
  }
  CHECK(trouble(contour(start + "<point x=\"1e30\" y=\"0\" type=\"line\"/>")) ==
        "contour 0, point 2: x 1e+30 is beyond 1e+06");
  CHECK(trouble(contour(start + "<point x=\"5\" y=\"5\" type=\"spline\"/>")) ==
        "contour 0, point 2: type \"spline\" is not known");
  CHECK(trouble(contour(start + "<point x=\"5\" y=\"5\" type=\"move\"/>")) ==
        "contour 0, point 2: a move within a contour");
  CHECK(trouble(contour(start + "<point x=\"5\" y=\"5\"/>")) == "contour 0, point 0: 1 handles before a line");
  CHECK(trouble(contour("<point x=\"5\" y=\"5\"/><point x=\"6\" y=\"6\"/><point x=\"5\" y=\"5\"/>"
                        "<point x=\"5\" y=\"5\" type=\"curve\"/>")) == "contour 0, point 3: 3 handles before a curve");
  CHECK(trouble(glif("box", "<component base=\"none\"/>")) == "component none is no glyph of the font");
  CHECK(trouble(glif("box", "<component base=\"box\"/>")) == "its components form a cycle, or lead to one");
  CHECK(trouble(glif("box", "<component base=\"i\" xScale=\"nan\"/>")) == "component i: xScale \"nan\" is not finite");
  CHECK(trouble(glif("box", "<component/>")) == "a component without a base");
  CHECK(trouble(glif("box", "<component base=\"i\" xScale=\"1e6\"/>")) == "component i is placed beyond 1e+06 units");
  for (const std::string bad : {"D800", "110000", "FFFFFFFFFF", "zz", "", "+41"}) {
    CHECK(trouble("<glyph name=\"box\" format=\"2\"><unicode hex=\"" + bad + "\"/></glyph>") ==
          "unicode \"" + bad + "\" is no character");
  }
}

TEST_CASE("elements nested without end are found before they are built", "[ufo]") {
  std::string deep;
  for (int i = 0; i < 200'000; ++i) deep += "<a>";
  CHECK(trouble(deep) == "line 1: elements nest deeper than 128");
  CHECK(refusal("lib.plist", deep) == "made.ufo: lib.plist: line 1: elements nest deeper than 128");
}

TEST_CASE("what contradicts the whole is refused with the file's name", "[ufo]") {
  const auto missing = [](const std::string& file) {
    Folder ufo = made_ufo();
    ufo.erase(file);
    return message_of<FontReadError>([&] { load_ufo("made.ufo", ufo); });
  };
  CHECK(missing("metainfo.plist") == "made.ufo: metainfo.plist: is missing");
  CHECK(missing("layercontents.plist") == "made.ufo: layercontents.plist: is missing");
  CHECK(missing("glyphs/contents.plist") == "made.ufo: glyphs/contents.plist: is missing");
  CHECK(missing("glyphs/i.glif") == "made.ufo: glyphs/contents.plist: \"i.glif\", the file of i, is missing");
  CHECK(missing("glyphs.sketch/contents.plist") ==
        "made.ufo: layercontents.plist: folder \"glyphs.sketch\" is missing");
  const auto version = [](const std::string& value) {
    return refusal("metainfo.plist", plist("<dict><key>formatVersion</key>" + value + "</dict>"));
  };
  CHECK(version("<integer>9</integer>") == "made.ufo: metainfo.plist: formatVersion 9 is not 1, 2 or 3");
  CHECK(version("<string>3</string>") == "made.ufo: metainfo.plist: formatVersion is no number");
  CHECK(version("<integer>2.5</integer>") == "made.ufo: metainfo.plist: formatVersion is no whole number");
  CHECK(refusal("metainfo.plist", plist("<dict/>")) == "made.ufo: metainfo.plist: no formatVersion");
  CHECK(refusal("metainfo.plist", plist("<array/>")) == "made.ufo: metainfo.plist: its object is no dictionary");
  CHECK(refusal("lib.plist", plist("<array/>")) == "made.ufo: lib.plist: its object is no dictionary");
  CHECK(refusal("lib.plist", plist("<dict><key>a</key></dict>")) ==
        "made.ufo: lib.plist: its object has a key without a value");
  CHECK(refusal("lib.plist", plist("<dict><key>a</key><true/><key>a</key><true/></dict>")) ==
        "made.ufo: lib.plist: its object has \"a\" twice");
  CHECK(refusal("lib.plist", plist("<dict/><dict/>")) == "made.ufo: lib.plist: is a property list of two objects");
  CHECK(refusal("lib.plist", "<glyph/>") == "made.ufo: lib.plist: is no property list");
  const auto file_of_i = [](const std::string& file) {
    return refusal("glyphs/contents.plist", plist("<dict><key>i</key><string>" + file + "</string></dict>"));
  };
  for (const std::string bad : {"../box.glif", "/etc/passwd", "x/../i.glif", "..", ".", "", "..\\i.glif"}) {
    CHECK(file_of_i(bad) == "made.ufo: glyphs/contents.plist: the file of i \"" + bad + "\" is no plain name");
  }
  CHECK(refusal("glyphs/contents.plist", plist("<dict><key></key><string>i.glif</string></dict>")) ==
        "made.ufo: glyphs/contents.plist: a glyph without a name");
  CHECK(refusal("glyphs/contents.plist",
                plist("<dict><key>i</key><string>i.glif</string><key>j</key><string>i.glif</string></dict>")) ==
        "made.ufo: glyphs/contents.plist: \"i.glif\" is the file of two glyphs");
  const auto layer = [](const std::string& folder) {
    return refusal("layercontents.plist",
                   plist("<array><array><string>a</string><string>" + folder + "</string></array></array>"));
  };
  CHECK(layer("../glyphs") == "made.ufo: layercontents.plist: folder \"../glyphs\" is no plain name");
  CHECK(layer("glyphs.sketch") == "made.ufo: layercontents.plist: no layer is in the folder glyphs");
  const auto units = [](const std::string& value) {
    return refusal("fontinfo.plist", plist("<dict><key>unitsPerEm</key>" + value + "</dict>"));
  };
  CHECK(units("<integer>0</integer>") == "made.ufo: fontinfo.plist: unitsPerEm 0 is outside 16 to 16384");
  CHECK(units("<integer>-5</integer>") == "made.ufo: fontinfo.plist: unitsPerEm -5 is outside 16 to 16384");
  CHECK(units("<real>nan</real>") == "made.ufo: fontinfo.plist: unitsPerEm \"nan\" is not finite");
  CHECK(units("<real>1000.5</real>") == "made.ufo: fontinfo.plist: unitsPerEm 1000.5 is no whole number");
  CHECK(units("<string>x</string>") == "made.ufo: fontinfo.plist: unitsPerEm is no number");
}

TEST_CASE("a UFO of version 2 is read, and without font info there are usual values", "[ufo]") {
  Folder ufo = made_ufo();
  ufo["metainfo.plist"] = bytes_of(plist("<dict><key>formatVersion</key><integer>2</integer></dict>"));
  ufo.erase("layercontents.plist");
  ufo.erase("fontinfo.plist");
  const Font font = load_ufo("made.ufo", ufo);
  CHECK(font.glyphs.size() == 4);
  CHECK(font.units_per_em == 1000);
  CHECK(font.ascender == 800);
  CHECK(font.descender == -200);
}

TEST_CASE("a UFO goes to disk and comes back with all its files, also empty folders", "[ufo]") {
  const TestFolder folder;
  Folder ufo = made_ufo();
  ufo["data/empty/"] = {};
  glyphs::write_files({{folder / "a.ufo/", {}, ufo}});
  CHECK(fs::is_directory(folder / "a.ufo/data/empty"));
  CHECK(glyphs::read_folder(folder / "a.ufo") == ufo);
  fs::create_directory_symlink("a.ufo", folder / "link.ufo");
  for (const std::string& path : {folder / "a.ufo", folder / "a.ufo/", folder / "link.ufo"}) {
    const Font font = glyphs::load_font(path);
    CHECK(font.path == path);
    CHECK(font.glyphs.size() == 4);
    CHECK(*font.folder == ufo);
  }
}

TEST_CASE("links, pipes and what else is no file in a UFO are refused by name and not opened", "[ufo]") {
  const TestFolder folder;
  glyphs::write_files({{folder / "a.ufo", {}, made_ufo()}});
  const std::string path = folder / "a.ufo";
  const auto refused = [&] {
    const std::string message = message_of<FontReadError>([&] { glyphs::load_font(path); });
    CHECK(message.starts_with(path + ": "));
    return message.substr(std::min(message.size(), path.size() + 2));
  };
  fs::create_symlink("i.glif", path + "/glyphs/j.glif");
  CHECK(refused() == "glyphs/j.glif: is a link, which is not followed");
  fs::remove(path + "/glyphs/j.glif");
  fs::create_directory_symlink("glyphs", path + "/glyphs.x");
  CHECK(refused() == "glyphs.x: is a link, which is not followed");
  fs::remove(path + "/glyphs.x");
  REQUIRE(::mkfifo((path + "/data/pipe\n").c_str(), 0600) == 0);
  CHECK(refused() == "data/pipe?: is neither a file nor a folder");
  fs::remove(path + "/data/pipe\n");
  std::string deep = path + "/data";
  for (int i = 0; i < 40; ++i) deep += "/d";
  fs::create_directories(deep);
  CHECK(refused().ends_with(": folders nest deeper than 32"));
  CHECK(message_of<FontReadError>([&] { glyphs::load_font(path + "/glyphs"); }) ==
        path + "/glyphs: is a folder without metainfo.plist, so it is no UFO");
  CHECK(message_of<FontReadError>([&] { glyphs::read_folder(folder / "none.ufo"); }) ==
        folder / "none.ufo: cannot be read: No such file or directory");
}

TEST_CASE("a bundled font made a UFO has the same outlines, metrics, names and characters, single points aside",
          "[ufo]") {
  for (const std::string& path : bundled_fonts()) {
    INFO(path);
    const Font font = glyphs::load_font(path);
    const WrittenUfo built = glyphs::build_ufo(font);
    CHECK(glyphs::build_ufo(font).folder == built.folder);
    const Font ufo = load_ufo("built.ufo", built.folder);
    CHECK(ufo.units_per_em == font.units_per_em);
    CHECK(ufo.ascender == font.ascender);
    CHECK(ufo.descender == font.descender);
    CHECK(ufo.family == font.family);
    CHECK(ufo.style == font.style);
    CHECK(ufo.character_map == font.character_map);
    REQUIRE(ufo.glyphs.size() == font.glyphs.size());
    int different = 0;
    for (const Glyph& glyph : font.glyphs) {
      const Glyph& back = ufo.glyphs[static_cast<std::size_t>(glyph.id)];
      CHECK(back.name == glyph.name);
      CHECK(back.advance == glyph.advance);
      CHECK(back.trouble.empty());
      CHECK(back.components.size() == glyph.components.size());
      auto wanted = glyphs::compose(font, glyph.id);
      std::erase_if(wanted, [](const BezierContour& contour) { return contour.point_count() == 1; });
      const auto got = glyphs::compose(ufo, glyph.id);
      bool is_same = wanted.size() == got.size();
      for (std::size_t c = 0; is_same && c < wanted.size(); ++c) {
        is_same =
            wanted[c].kinds() == got[c].kinds() && (wanted[c].points() - got[c].points()).cwiseAbs().maxCoeff() < 1e-6;
      }
      if (!is_same) ++different;
    }
    CHECK(different == 0);
  }
}

TEST_CASE("the glyph for what is missing has its name in a UFO, also from a font without names", "[ufo]") {
  Font font = glyphs::load_font(bundled_ttf[0]);
  font.glyphs[0].name = "gid0";
  const Font ufo = load_ufo("built.ufo", glyphs::build_ufo(font).folder);
  CHECK(ufo.glyphs[0].name == ".notdef");
  CHECK(ufo.glyphs[0].contours == glyphs::load_font(bundled_ttf[0]).glyphs[0].contours);
}

TEST_CASE("no two glyph files differ in case alone, and none is a device", "[ufo]") {
  Font font = glyphs::load_font(bundled_ttf[0]);
  font.glyphs.resize(8);
  const std::vector<std::string> names{"A", "a", "A_", "a_", ".notdef", "con", "x.Nul.y", std::string(300, 'L')};
  for (std::size_t i = 0; i < names.size(); ++i) {
    font.glyphs[i].name = names[i];
    font.glyphs[i].components.clear();
  }
  font.character_map.clear();
  const Folder folder = glyphs::build_ufo(font).folder;
  for (const std::string file : {"A_", "a", "A__", "a_000000000000001", "_notdef", "_con", "x.N_ul.y"}) {
    CHECK(folder.count("glyphs/" + file + ".glif") == 1);
  }
  CHECK(std::all_of(folder.begin(), folder.end(), [](const auto& entry) { return entry.first.size() <= 255 + 7; }));
}

TEST_CASE("text is set from a UFO by its characters and advances", "[ufo]") {
  const Font font = made_font();
  const glyphs::ShapedLine line = glyphs::shape(font, "ii");
  REQUIRE(line.glyphs.size() == 2);
  CHECK(line.glyphs[1].glyph == font.find("i"));
  CHECK(line.advance == 602);  // twice 300.5, in whole units each
  CHECK(glyphs::glyphs_of_text(font, "i") == std::vector<int>{font.find("i")});
  CHECK(message_of<glyphs::RequestError>([&] { glyphs::glyphs_of_text(font, "ix"); }) ==
        "text: the font has no U+0078");
}

TEST_CASE("the tables a UFO has no place for are named", "[ufo]") {
  const WrittenUfo built = glyphs::build_ufo(glyphs::load_font(bundled_otf[0]));
  CHECK(std::any_of(built.warnings.begin(), built.warnings.end(), [](const std::string& warning) {
    return warning.starts_with("tables that the UFO has nothing of: ") && warning.find("GPOS") != std::string::npos;
  }));
}
