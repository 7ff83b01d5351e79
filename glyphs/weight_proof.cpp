#include "glyphs/weight_proof.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>

#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/canvas.h"
#include "glyphs/error.h"
#include "glyphs/shaping.h"

namespace glyphs {

namespace {

using fontcore::Affine;
using fontcore::BezierContour;
using fontcore::Box;
using fontcore::Point;
using Contours = std::vector<BezierContour>;

Contours placed(const Contours& contours, const Affine& placement) {
  Contours result;
  for (const BezierContour& contour : contours) result.push_back(transform(contour, placement));
  return result;
}

Contours moved(const Contours& contours, double dx) { return placed(contours, {.shift = Point(dx, 0.0)}); }

// Outer contours counter-clockwise: ink of two shapes together is then where either has it.
Contours counter_clockwise(Contours contours) {
  double largest = 0.0;
  for (const BezierContour& contour : contours) {
    const double area = signed_area(contour);
    if (std::abs(area) > std::abs(largest)) largest = area;
  }
  if (largest < 0.0) {
    for (BezierContour& contour : contours) contour = reverse(contour);
  }
  return contours;
}

}  // namespace

OutlineError compare_outlines(const Contours& made, const Contours& drawn) {
  const Contours own = counter_clockwise(made);
  const Contours wished = counter_clockwise(drawn);
  const double own_area = measure_ink(own).area;
  const double wished_area = measure_ink(wished).area;
  const Box a = tight_box(own);
  const Box b = tight_box(wished);
  const double left = b.low.x() - a.low.x();
  const double right = b.high.x() - a.high.x();
  constexpr double reach = 0.03;  // of the width
  constexpr int steps = 6;        // either way
  std::vector<double> shifts{left, right};
  for (int k = -steps; k <= steps; ++k)
    shifts.push_back(0.5 * (left + right) + reach * (b.high.x() - b.low.x()) * k / steps);
  OutlineError error{std::numeric_limits<double>::infinity(), own_area / wished_area - 1.0};
  for (const double shift : shifts) {
    Contours both = moved(own, shift);
    both.insert(both.end(), wished.begin(), wished.end());
    // |A - B| + |B - A| is twice what both have together, less each of them.
    const double difference = (2.0 * measure_ink(both).area - own_area - wished_area) / wished_area;
    if (difference >= error.difference) continue;
    error.difference = difference;
    error.shift = shift;
  }
  return error;
}

namespace {

// A drawn glyph in the units of the font made.
Contours drawn_outline(const Font& drawn, int glyph, const Font& made) {
  Affine to_units;
  to_units.linear *= static_cast<double>(made.units_per_em) / drawn.units_per_em;
  return placed(compose(drawn, glyph), to_units);
}

}  // namespace

std::vector<ComparedGlyph> compare_weights(const Font& made, const Font& drawn, const std::vector<int>& glyphs) {
  std::map<int, char32_t> characters;
  for (const auto& [character, id] : made.character_map) characters.emplace(id, character);
  std::vector<ComparedGlyph> compared;
  for (const int id : glyphs) {
    const auto character = characters.find(id);
    int other = -1;
    if (character != characters.end()) {
      const auto found = drawn.character_map.find(character->second);
      other = found == drawn.character_map.end() ? -1 : found->second;
    } else {
      other = drawn.find(made.glyphs[static_cast<std::size_t>(id)].name);
    }
    if (other < 0 || !drawn.has_outline(other)) continue;
    try {
      compared.push_back({id, other, compare_outlines(compose(made, id), drawn_outline(drawn, other, made))});
    } catch (const FontReadError&) {
      continue;
    } catch (const fontcore::WorkLimitExceeded&) {
      continue;
    }
  }
  std::ranges::stable_sort(compared, std::greater{}, [](const ComparedGlyph& one) { return one.error.difference; });
  return compared;
}

namespace {

constexpr Colour both_colour{0.62, 0.62, 0.65};
constexpr Colour made_colour{0.13, 0.36, 0.92};
constexpr Colour drawn_colour{0.86, 0.13, 0.11};
constexpr Colour before_colour{0.05, 0.05, 0.05};
constexpr Colour label_colour{0.25, 0.25, 0.28};

constexpr double pixels_per_em = 200.0;
constexpr double margin = 24.0;  // pixels, as all below
constexpr double gap = 20.0;
constexpr double label_size = 13.0;
constexpr double label_room = 20.0;
constexpr double page_width = 1600.0;
constexpr double line_width = 1.2;
constexpr double largest_height = 16000.0;

Affine at(const Point& place, double scale) {
  Affine to_page;
  to_page.linear << scale, 0.0, 0.0, -scale;
  to_page.shift = place;
  return to_page;
}

// A word in the font's own outlines; gives where the next may begin. Nothing if the font lacks its letters.
double write(cairo_t* context, const Font& font, const std::string& word, const Point& place, const Colour& colour) {
  const ShapedLine line = shape(font, word);
  if (std::ranges::any_of(line.glyphs, [](const PlacedGlyph& placed) { return placed.glyph == 0; })) return place.x();
  const double scale = label_size / font.units_per_em;
  for (const PlacedGlyph& one : line.glyphs) {
    const Point origin = place + Point(scale * one.origin.x(), -scale * one.origin.y());
    fill(context, compose(font, one.glyph), at(origin, scale), colour);
  }
  return place.x() + scale * line.advance + 0.6 * label_size;
}

std::string percent(const char* format, double share) {
  std::array<char, 32> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, 100.0 * share);
  return buffer.data();
}

// What a cell shows, its origin at (0, 0), font units.
struct Cell {
  Contours before;
  Contours made;
  Contours drawn;
  Box box;
  std::string label;
};

}  // namespace

Bytes draw_weight_proof(const Font& before, const Font& made, const Font& drawn,
                        const std::vector<ComparedGlyph>& glyphs, ProofFormat format) {
  if (glyphs.empty()) throw RequestError("proof: no glyph to draw");
  std::vector<Cell> cells;
  double sum = 0.0;
  double area = 0.0;
  Point largest = Point::Zero();  // of any cell, pixels
  double above = 0.0;
  const double scale = pixels_per_em / made.units_per_em;
  for (const ComparedGlyph& one : glyphs) {
    Cell& cell = cells.emplace_back();
    const std::string& name = made.glyphs[static_cast<std::size_t>(one.glyph)].name;
    cell.made = moved(compose(made, one.glyph), one.error.shift);
    cell.drawn = drawn_outline(drawn, one.drawn, made);
    const Contours old = compose(before, one.glyph);
    const Box box = tight_box(cell.made);
    const Box old_box = tight_box(old);
    const double to_middle =
        old_box.is_empty() ? 0.0 : 0.5 * (box.low.x() + box.high.x() - old_box.low.x() - old_box.high.x());
    cell.before = moved(old, to_middle);
    for (const Contours* contours : {&cell.made, &cell.drawn, &cell.before}) cell.box.add(tight_box(*contours));
    cell.label = name + "  " + percent("%.1f %%", one.error.difference) + percent("  area %+.1f %%", one.error.area);
    sum += one.error.difference;
    area += std::abs(one.error.area);
    const double label_width = label_size / made.units_per_em * shape(before, cell.label).advance;
    largest.x() = std::max({largest.x(), scale * (cell.box.high.x() - cell.box.low.x()), label_width});
    largest.y() = std::max(largest.y(), -scale * cell.box.low.y());
    above = std::max(above, scale * cell.box.high.y());
  }
  const Point step(largest.x() + gap, above + largest.y() + label_room + gap);
  const double columns = std::max(1.0, std::floor((page_width - 2.0 * margin) / step.x()));
  const double rows = std::ceil(static_cast<double>(cells.size()) / columns);
  const double top = margin + label_room + gap;
  const int width = static_cast<int>(std::ceil(std::max(page_width, 2.0 * margin + step.x())));
  const double height = top + rows * step.y() + margin;
  if (height > largest_height)
    throw RequestError(fontcore::text("proof: ", cells.size(), " glyphs are too many for one picture"));

  Canvas canvas(format, width, height);
  cairo_t* const page = canvas.context();
  cairo_set_line_width(page, line_width);

  const auto count = static_cast<double>(cells.size());
  const Point head(margin, margin + 0.7 * label_size);
  double x = write(page, before, "before", head, before_colour);
  x = write(page, before, "made", Point(x, head.y()), made_colour);
  x = write(page, before, "drawn", Point(x, head.y()), drawn_colour);
  x = write(page, before, "both", Point(x, head.y()), both_colour);
  write(page, before,
        fontcore::text("mean of ", cells.size(), ": ", percent("%.1f %%", sum / count), "  area ",
                       percent("%.1f %%", area / count)),
        Point(x + gap, head.y()), label_colour);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Cell& cell = cells[i];
    const Point corner(margin + std::fmod(static_cast<double>(i), columns) * step.x(),
                       top + std::floor(static_cast<double>(i) / columns) * step.y());
    const Affine to_page = at(corner + Point(-scale * cell.box.low.x(), above), scale);
    fill(page, cell.drawn, to_page, drawn_colour);
    fill(page, cell.made, to_page, made_colour);
    cairo_save(page);
    add_path(page, cell.drawn, to_page);
    cairo_clip(page);
    fill(page, cell.made, to_page, both_colour);
    cairo_restore(page);
    set_colour(page, before_colour);
    add_path(page, cell.before, to_page);
    cairo_stroke(page);
    write(page, before, cell.label, corner + Point(0.0, step.y() - gap - 0.3 * label_size), label_colour);
  }
  return canvas.finish();
}

}  // namespace glyphs
