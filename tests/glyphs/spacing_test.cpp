#include "glyphs/spacing.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/recipe.h"
#include "glyphs/reweight.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/sfnt_tables.h"
#include "glyphs/ufo.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;
using fontcore::Box;
using fontcore::Point;

namespace {

const std::string open_sans = bundled_font("open-sans/OpenSans-Regular.ttf");
const std::string open_sans_bold = bundled_font("open-sans/OpenSans-Bold.ttf");
const std::string cabin = bundled_font("cabin/Cabin-Regular.otf");
const std::string cabin_bold = bundled_font("cabin/Cabin-Bold.otf");

Box box_of(const Font& font, int glyph) {
  Box box;
  for (const auto& contour : compose(font, glyph)) box.add(tight_box(contour));
  return box;
}
double middle(const Box& box) { return 0.5 * (box.low.x() + box.high.x()); }
const Glyph& glyph_of(const Font& font, char32_t character) {
  return font.glyphs[static_cast<std::size_t>(font.character_map.at(character))];
}

/// A font in a weight learnt from its own Bold, written and read again.
struct Reweighted {
  Font before;
  ReweightResult result;
  Font after;
};
Reweighted reweighted(const std::string& regular, const std::string& bold, AdvancePolicy policy,
                      const std::string& only = "") {
  Font font = load_font(regular);
  ReweightOptions options;
  options.advance = policy;
  if (!only.empty()) options.only = select_glyphs(font, only);
  ReweightResult result = reweight(font, learn_weight(font, load_font(bold), "n,o,H,O"), options);
  Font after = load_font_bytes("after", result.font.data);
  return {std::move(font), std::move(result), std::move(after)};
}

}  // namespace

TEST_CASE("kept advances are all equal, and every glyph's ink keeps its middle", "[spacing]") {
  for (const auto& [regular, bold] : {std::pair(open_sans, open_sans_bold), std::pair(cabin, cabin_bold)}) {
    const Reweighted made = reweighted(regular, bold, AdvancePolicy::Keep);
    for (const Glyph& glyph : made.before.glyphs) {
      CAPTURE(glyph.name);
      REQUIRE(made.after.glyphs[static_cast<std::size_t>(glyph.id)].advance == glyph.advance);
      if (glyph.is_composite() || glyph.contours.empty()) continue;
      CHECK(middle(box_of(made.after, glyph.id)) == Approx(middle(box_of(made.before, glyph.id))).margin(1.5));
    }
    CHECK(made.result.spacing.advances.empty());
    CHECK(std::ranges::count(made.result.font.changed_tables, "OS/2") == 0);
  }
}

TEST_CASE("kept sidebearings are kept, and the advance grows by what the ink does", "[spacing]") {
  for (const auto& [regular, bold] : {std::pair(open_sans, open_sans_bold), std::pair(cabin, cabin_bold)}) {
    const Reweighted made = reweighted(regular, bold, AdvancePolicy::Sidebearings);
    int wider = 0;
    for (const Glyph& glyph : made.before.glyphs) {
      if (glyph.is_composite() || glyph.contours.empty()) continue;
      CAPTURE(glyph.name);
      const double advance = made.after.glyphs[static_cast<std::size_t>(glyph.id)].advance;
      const Box before = box_of(made.before, glyph.id);
      const Box after = box_of(made.after, glyph.id);
      if (glyph.advance == 0.0) {  // a mark
        CHECK(advance == 0.0);
        CHECK(middle(after) == Approx(middle(before)).margin(1.5));
        continue;
      }
      CHECK(after.low.x() == Approx(before.low.x()).margin(0.5));
      CHECK(advance - after.high.x() == Approx(glyph.advance - before.high.x()).margin(1.0));
      wider += advance > glyph.advance ? 1 : 0;
    }
    CHECK(wider > 200);
  }
}

TEST_CASE("scaled advances keep one ratio, so that equal ones stay equal", "[spacing]") {
  const Reweighted made = reweighted(open_sans, open_sans_bold, AdvancePolicy::Scale);
  const double ratio = made.result.spacing.ratio;
  CHECK(ratio > 1.02);
  CHECK(ratio < 1.2);
  for (const Glyph& glyph : made.before.glyphs) {
    CAPTURE(glyph.name);
    CHECK(made.after.glyphs[static_cast<std::size_t>(glyph.id)].advance == std::floor(ratio * glyph.advance + 0.5));
    if (!made.before.has_outline(glyph.id) || glyph.is_composite()) continue;
    CHECK(middle(box_of(made.after, glyph.id)) == Approx(ratio * middle(box_of(made.before, glyph.id))).margin(1.5));
  }
}

TEST_CASE("learnt advances come nearer to the drawn ones than kept ones, and than kept sidebearings", "[spacing]") {
  const Font bold = load_font(open_sans_bold);
  const auto error = [&](AdvancePolicy policy) {
    const Reweighted made = reweighted(open_sans, open_sans_bold, policy, "U+0041-005A,U+0061-007A");
    double sum = 0.0;
    for (const char32_t letter : std::u32string(U"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"))
      sum += std::abs(glyph_of(made.after, letter).advance - glyph_of(bold, letter).advance);
    return sum;
  };
  const double learnt = error(AdvancePolicy::Learnt);
  CHECK(learnt < error(AdvancePolicy::Keep));
  CHECK(learnt < error(AdvancePolicy::Sidebearings));
}

TEST_CASE("composites follow their base, marks stay centred over it, parts in a row keep their gaps", "[spacing]") {
  for (const AdvancePolicy policy : {AdvancePolicy::Sidebearings, AdvancePolicy::Scale, AdvancePolicy::Learnt}) {
    const Reweighted made = reweighted(open_sans, open_sans_bold, policy);
    const auto part_box = [](const Font& font, const Glyph& glyph, std::size_t k) {
      const Component& part = glyph.components[k];
      Box box = box_of(font, part.glyph);
      box.low += part.placement.shift;
      box.high += part.placement.shift;
      return box;
    };
    for (const char32_t letter : std::u32string(U"áèîõÄÇŠů")) {
      const Glyph& before = glyph_of(made.before, letter);
      const Glyph& after = glyph_of(made.after, letter);
      CAPTURE(before.name, static_cast<int>(policy));
      REQUIRE(before.components.size() == 2);
      const Glyph& base = made.before.glyphs[static_cast<std::size_t>(before.components[0].glyph)];
      if (before.advance == base.advance) {
        CHECK(after.advance == made.after.glyphs[static_cast<std::size_t>(base.id)].advance);
      }
      const double ratio = made.result.spacing.ratio;
      const double off = middle(part_box(made.before, before, 1)) - middle(part_box(made.before, before, 0));
      CHECK(middle(part_box(made.after, after, 1)) - middle(part_box(made.after, after, 0)) ==
            Approx(ratio * off).margin(2.0));
    }
    const Glyph& dots = glyph_of(made.before, U'…');
    const Glyph& after = glyph_of(made.after, U'…');
    const auto gap = [&](const Font& font, const Glyph& glyph, std::size_t k) {
      return part_box(font, glyph, k + 1).low.x() - part_box(font, glyph, k).high.x();
    };
    if (policy == AdvancePolicy::Sidebearings) {
      CHECK(gap(made.after, after, 0) == Approx(gap(made.before, dots, 0)).margin(1.0));
      CHECK(gap(made.after, after, 1) == Approx(gap(made.before, dots, 1)).margin(1.0));
    }
    CHECK(gap(made.after, after, 0) == Approx(gap(made.after, after, 1)).margin(1.5));
  }
}

TEST_CASE("a part that lends its metrics has the advance of the composite, whatever the policy", "[spacing]") {
  for (const AdvancePolicy policy : {AdvancePolicy::Keep, AdvancePolicy::Sidebearings, AdvancePolicy::Learnt}) {
    const Reweighted made = reweighted(open_sans, open_sans_bold, policy);
    for (const Glyph& glyph : made.before.glyphs) {
      for (const Component& part : glyph.components) {
        const auto base = static_cast<std::size_t>(part.glyph);
        if (!part.use_my_metrics || made.before.glyphs[base].advance != glyph.advance) continue;
        CAPTURE(glyph.name);
        CHECK(made.after.glyphs[static_cast<std::size_t>(glyph.id)].advance == made.after.glyphs[base].advance);
      }
    }
  }
}

TEST_CASE("widths in CFF are the advances of hmtx", "[spacing]") {
  for (const AdvancePolicy policy : {AdvancePolicy::Sidebearings, AdvancePolicy::Scale}) {
    const Reweighted made = reweighted(cabin, cabin_bold, policy);
    const sfnt::Directory directory = sfnt::read_directory(*made.after.data, 0);
    const sfnt::CffTable table(directory.require(sfnt::tag("CFF "), 4), made.after.units_per_em);
    for (const Glyph& glyph : made.after.glyphs) {
      const auto width = table.read(glyph.id).width;
      const sfnt::CffFontDict& dict = table.font_dict(glyph.id);
      CAPTURE(glyph.name);
      CHECK((width ? *width + dict.nominal_width : dict.default_width) == glyph.advance);
    }
  }
}

TEST_CASE("an accented glyph by endchar reads back with another width and place of its accent", "[spacing]") {
  for (const std::optional<double> width : {std::optional<double>(), std::optional(-317.0)}) {
    const sfnt::CffAccent accent{Point(212.0, -30.0), 97, 194};
    const Bytes code = sfnt::encode_accented(accent, width);
    const sfnt::Charstring read = sfnt::interpret(code, {}, {});
    REQUIRE(read.trouble.empty());
    REQUIRE(read.accent);
    CHECK(read.accent->shift == accent.shift);
    CHECK(read.accent->base == accent.base);
    CHECK(read.accent->accent == accent.accent);
    CHECK(read.width == width);
  }
}

TEST_CASE("a composite that is decomposed stands on its advance like any other glyph", "[spacing]") {
  const Font font = load_font(open_sans);
  const Glyph& aacute = glyph_of(font, U'\u00e1');
  fontcore::Affine wider;
  wider.linear(0, 0) = 1.2;
  EditedGlyphs edited;
  for (const auto& contour : decompose(font, aacute.id)) edited[aacute.id].push_back(transform(contour, wider));
  Box ink;
  for (const auto& contour : edited[aacute.id]) ink.add(tight_box(contour));
  const Box before = box_of(font, aacute.id);
  const Spacing spacing = space(font, edited, AdvancePolicy::Sidebearings);
  const double growth = (ink.high.x() - ink.low.x()) - (before.high.x() - before.low.x());
  CHECK(spacing.advances.at(aacute.id) - aacute.advance == Approx(growth).margin(1.0));
}

TEST_CASE("hmtx grows where glyphs that shared the last advance no longer do", "[spacing]") {
  const Font font = load_font(open_sans);
  const int last = static_cast<int>(font.glyphs.size()) - 1;
  const WrittenFont written = write_sfnt(font, {}, {.advances = {{last, 777.0}, {3, 2500.0}}});
  CHECK(written.changed_tables == std::vector<std::string>{"OS/2", "head", "hhea", "hmtx"});
  const Font read = load_font_bytes("read", written.data);
  for (const Glyph& glyph : font.glyphs) {
    const double wanted = glyph.id == last ? 777.0 : glyph.id == 3 ? 2500.0 : glyph.advance;
    REQUIRE(read.glyphs[static_cast<std::size_t>(glyph.id)].advance == wanted);
  }
  const sfnt::Directory directory = sfnt::read_directory(written.data, 0);
  CHECK(sfnt::u16(directory.require(sfnt::tag("hhea"), 36), 10) == 2500);
  CHECK(sfnt::u16(directory.require(sfnt::tag("hhea"), 36), 34) == last + 1);
}

TEST_CASE("a monospaced font keeps equal advances, or is refused", "[spacing]") {
  Font font = load_font(open_sans);
  CHECK_FALSE(is_monospaced(font));
  for (Glyph& glyph : font.glyphs) glyph.advance = glyph.advance > 0.0 ? 1200.0 : 0.0;
  CHECK(is_monospaced(font));
  const int n = font.character_map.at(U'n');
  EditedGlyphs edited{{n, {}}};
  for (const auto& contour : font.glyphs[static_cast<std::size_t>(n)].contours) {
    fontcore::Affine wider;
    wider.linear(0, 0) = 1.1;
    edited[n].push_back(transform(contour, wider));
  }
  CHECK_THROWS_AS(space(font, edited, AdvancePolicy::Sidebearings), RequestError);
  CHECK_THROWS_AS(space(font, edited, AdvancePolicy::Learnt), RequestError);
  CHECK_THROWS_AS(space(font, edited, AdvancePolicy::Scale, {}, std::vector<int>{n}), RequestError);
  const Spacing spacing = space(font, edited, AdvancePolicy::Scale);
  CHECK(spacing.ratio == Approx(1.1));
  for (const auto& [id, advance] : spacing.advances) CHECK(advance == 1320.0);
  CHECK(space(font, edited, AdvancePolicy::Keep).advances.empty());
}

TEST_CASE("in a UFO advances, offsets and anchors change by their digits alone", "[spacing]") {
  const Font source = load_font(open_sans);
  WrittenFont extracted = extract_ufo(source);
  Folder folder = *extracted.folder;
  const auto put = [&](const std::string& file, const std::string& what, const std::string& instead) {
    Bytes& bytes = folder.at(file);
    std::string text(bytes.begin(), bytes.end());
    const auto at = text.find(what);
    REQUIRE(at != std::string::npos);
    text.replace(at, what.size(), instead);
    bytes.assign(text.begin(), text.end());
  };
  const Glyph& n = glyph_of(source, U'n');
  const Box ink = box_of(source, n.id);
  // Over the middle of the ink, at its top; at the origin; at the advance.
  const std::string anchors = fontcore::text("<anchor x=\"", middle(ink), "\" y=\"", ink.high.y(),
                                             "\" name=\"top\"/><anchor x=\"0\" y=\"0\" name=\"entry\"/><anchor x=\"",
                                             n.advance, "\" y=\"0\" name=\"exit\"/>");
  put("glyphs/n.glif", "<outline>", anchors + "<outline>");
  const Font font = load_ufo("n.ufo", folder);
  REQUIRE(font.glyphs[static_cast<std::size_t>(font.find("n"))].anchors.size() == 3);
  ReweightOptions options;
  options.advance = AdvancePolicy::Sidebearings;
  const auto model = learn_weight(source, load_font(open_sans_bold), "n,o,H,O");
  const ReweightResult result = reweight(font, model, options);
  const Font after = load_ufo("after.ufo", *result.font.folder);
  const Glyph& now = after.glyphs[static_cast<std::size_t>(after.find("n"))];
  const Box moved = box_of(after, now.id);
  CHECK(now.advance - n.advance == Approx(moved.high.x() - ink.high.x()).margin(1.0));
  CHECK(now.anchors[0].x() == Approx(middle(moved)).margin(1.0));
  CHECK(now.anchors[0].y() == Approx(moved.high.y()).margin(1.0));
  CHECK(now.anchors[1] == Point(0.0, 0.0));
  CHECK(now.anchors[2] == Point(now.advance, 0.0));
  CHECK(std::ranges::count(result.spacing.anchors, now.id, [](const auto& one) { return one.first; }) == 1);

  // Of a composite the digits of its offset and its advance.
  const auto text_of = [](const Folder& files, const char* name) {
    const Bytes& bytes = files.at(name);
    std::string text(bytes.begin(), bytes.end());
    std::erase_if(text, [](char c) { return (c >= '0' && c <= '9') || c == '-'; });
    return text;
  };
  CHECK(text_of(folder, "glyphs/aacute.glif") == text_of(*result.font.folder, "glyphs/aacute.glif"));
  CHECK(folder.at("glyphs/aacute.glif") != result.font.folder->at("glyphs/aacute.glif"));
  // The same as in the TrueType font.
  const Reweighted truetype = reweighted(open_sans, open_sans_bold, AdvancePolicy::Sidebearings);
  for (const Glyph& glyph : truetype.after.glyphs) {
    const int id = after.find(glyph.name);
    if (id < 0) continue;
    CAPTURE(glyph.name);
    CHECK(after.glyphs[static_cast<std::size_t>(id)].advance == glyph.advance);
  }
}
