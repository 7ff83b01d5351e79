#include "fontcore/weight.h"

#include <array>

#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/stroke.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

using Contours = std::vector<BezierContour>;

constexpr double em = 1000.0;

// An H of straight stems: stems `stem` thick, a bar `bar` thick, `counter` between the stems.
Contours letter_h(double stem, double bar, double counter, double height) {
  const double right = 2.0 * stem + counter;
  const double low = 0.5 * (height - bar);
  const double high = 0.5 * (height + bar);
  return {shapes::polygon({{0, 0},
                           {stem, 0},
                           {stem, low},
                           {stem + counter, low},
                           {stem + counter, 0},
                           {right, 0},
                           {right, height},
                           {stem + counter, height},
                           {stem + counter, high},
                           {stem, high},
                           {stem, height},
                           {0, height}})};
}

// A ring: an ellipse with an ellipse cut out.
Contours letter_o(double stem, double bar, double width, double height, double overshoot) {
  const auto ellipse = [&](double w, double low, double high) {
    Affine map;
    map.linear << w / 200.0, 0, 0, (high - low) / 200.0;
    map.shift << 0.5 * width, 0.5 * (low + high);
    return transform(shapes::circle(100), map);
  };
  return {ellipse(width, -overshoot, height + overshoot),
          reverse(ellipse(width - 2.0 * stem, bar - overshoot, height + overshoot - bar))};
}

struct Weight {
  double stem, bar, counter;
};
constexpr Weight regular{90, 76, 300};
constexpr Weight bold{150, 110, 270};

WeightPair pair_of(const char* name, LetterClass letter_class, Contours from, Contours to) {
  return {name, letter_class, std::move(from), std::move(to), 600.0, 650.0};
}

// H, O, and an n and an o made alike, of a made face.
std::vector<WeightPair> controls() {
  const auto h = [](const Weight& w, double height) { return letter_h(w.stem, w.bar, w.counter, height); };
  const auto o = [](const Weight& w, double height) {
    return letter_o(w.stem, w.bar, 2.0 * w.stem + w.counter + 60.0, height, 12.0);
  };
  return {pair_of("n", LetterClass::LowerCase, h(regular, 520), h(bold, 530)),
          pair_of("o", LetterClass::LowerCase, o(regular, 520), o(bold, 530)),
          pair_of("H", LetterClass::Capital, h(regular, 700), h(bold, 700)),
          pair_of("O", LetterClass::Capital, o(regular, 700), o(bold, 700))};
}

// A capital that was no control letter: an E.
Contours letter_e(double stem, double bar, double width, double height) {
  const double low = 0.5 * (height - bar);
  const double high = 0.5 * (height + bar);
  return {shapes::polygon({{0, 0},
                           {width, 0},
                           {width, bar},
                           {stem, bar},
                           {stem, low},
                           {width - 40, low},
                           {width - 40, high},
                           {stem, high},
                           {stem, height - bar},
                           {width, height - bar},
                           {width, height},
                           {0, height}})};
}

double area_of(const Contours& contours) { return measure_ink(contours).area; }

Weighted at_amount(const Contours& contours, double amount, LetterClass letter_class = LetterClass::Capital) {
  static const WeightModel model = learn_weight(controls(), em);
  return apply_weight(contours, letter_class, model, em, {.amount = amount});
}

Weighted with_amounts(const Contours& contours, const WeightAmounts& amounts) {
  static const WeightModel model = learn_weight(controls(), em);
  return apply_weight(contours, LetterClass::Capital, model, em, {.amounts = amounts});
}

// An I: a stem with serifs, `reach` beyond it and `slab` thick.
Contours letter_i(double stem, double slab, double reach, double height) {
  const double right = stem + 2.0 * reach;
  return {shapes::polygon({{0, 0},
                           {right, 0},
                           {right, slab},
                           {reach + stem, slab},
                           {reach + stem, height - slab},
                           {right, height - slab},
                           {right, height},
                           {0, height},
                           {0, height - slab},
                           {reach, height - slab},
                           {reach, slab},
                           {0, slab}})};
}

Contours mapped(const Contours& contours, const Affine& map) {
  Contours result;
  for (const BezierContour& contour : contours) result.push_back(transform(contour, map));
  return result;
}

Affine scaled(double factor) {
  Affine map;
  map.linear *= factor;
  return map;
}

bool is_axis_parallel(const BezierContour& contour) {
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier line = contour.segment(s);
    if (std::abs(line.start().x() - line.end().x()) > 1e-9 && std::abs(line.start().y() - line.end().y()) > 1e-9) {
      return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("an edge knows the thickness of its stroke and the gaps beside it", "[weight]") {
  const StrokeEdges shape(letter_h(90, 70, 300, 700), 11.0, 22.0);
  int stems = 0;
  int bars = 0;
  for (const StrokeEdge& edge : shape.edges()) {
    CHECK(edge.is_visible);
    // The left wall of the counter: a stem behind it, the other wall before it.
    if (edge.middle.x() == Approx(90.0) && edge.normal.x() == Approx(1.0)) {
      CHECK(edge.thickness() == Approx(90.0));
      CHECK(edge.facing == Approx(1.0));
      CHECK(edge.gap_x.distance == Approx(300.0));
      ++stems;
    }
    if (edge.middle.y() == Approx(385.0) && edge.normal.y() == Approx(1.0)) {
      CHECK(edge.thickness() == Approx(70.0));
      CHECK_FALSE(edge.gap_y.exists());
      ++bars;
    }
  }
  CHECK(stems > 10);
  CHECK(bars > 10);
  CHECK(shape.stem(50.0) == Approx(90.0));
}

TEST_CASE("edges do not depend on the direction of contours", "[weight]") {
  Contours there = letter_o(90, 70, 480, 700, 12);
  Contours back;
  for (const BezierContour& contour : there) back.push_back(reverse(contour));
  const StrokeEdges a(there, 11.0, 22.0);
  const StrokeEdges b(back, 11.0, 22.0);
  REQUIRE(a.size() == b.size());
  double sum_a = 0.0;
  double sum_b = 0.0;
  for (const StrokeEdge& edge : a.edges()) sum_a += edge.thickness();
  for (const StrokeEdge& edge : b.edges()) sum_b += edge.thickness();
  CHECK(sum_a == Approx(sum_b).epsilon(1e-9));
}

TEST_CASE("edges within the ink of another contour take no part", "[weight]") {
  // A cross of two overlapping bars: the stem's walls inside the bar are hidden.
  const Contours cross = {shapes::polygon({{100, 0}, {200, 0}, {200, 700}, {100, 700}}),
                          shapes::polygon({{0, 300}, {300, 300}, {300, 400}, {0, 400}})};
  const StrokeEdges shape(cross, 11.0, 22.0);
  int hidden = 0;
  for (const StrokeEdge& edge : shape.edges()) {
    const bool is_inside = edge.contour == 0 && edge.middle.y() > 300.0 && edge.middle.y() < 400.0;
    if (is_inside) CHECK_FALSE(edge.is_visible);
    hidden += edge.is_visible ? 0 : 1;
    if (edge.is_visible && edge.contour == 0 && std::abs(edge.normal.x()) > 0.5)
      CHECK(edge.thickness() == Approx(100.0));
  }
  CHECK(hidden > 4);
}

TEST_CASE("stems, bars and heights of both weights are read off the control letters", "[weight]") {
  const WeightModel model = learn_weight(controls(), em);
  for (const WeightModel::Letters& letters : model.letters) {
    CHECK(letters.upright.thickness == Approx(regular.stem).margin(1.0));
    CHECK(letters.upright.growth == Approx(bold.stem - regular.stem).margin(1.5));
    CHECK(letters.level.thickness == Approx(regular.bar).margin(2.0));
    CHECK(letters.level.growth == Approx(bold.bar - regular.bar).margin(2.0));
  }
  const auto shift_at = [](const std::vector<WeightModel::Zone>& zones, double height) {
    for (const WeightModel::Zone& zone : zones) {
      if (std::abs(zone.height - height) < 3.0) return zone.shift;
    }
    return std::nan("");
  };
  CHECK(shift_at(model.top, 520.0) == Approx(10.0).margin(0.5));
  CHECK(shift_at(model.top, 700.0) == Approx(0.0).margin(0.5));
  CHECK(shift_at(model.bottom, 0.0) == Approx(0.0).margin(0.5));
  for (const WeightModel::Control& control : model.controls) {
    CHECK(control.used);
    CHECK(control.thickness_error < 3.0);
    CHECK(std::abs(control.width_error) < 6.0);
  }
}

TEST_CASE("a control letter comes out as it was drawn", "[weight]") {
  for (const WeightPair& pair : controls()) {
    const Weighted made = at_amount(pair.from, 1.0, pair.letter_class);
    CHECK(made.amount == 1.0);
    CHECK(area_of(made.contours) == Approx(area_of(pair.to)).epsilon(0.02));
    const Box box = tight_box(made.contours[0]);
    const Box drawn = tight_box(pair.to[0]);
    CHECK(box.high.y() == Approx(drawn.high.y()).margin(1.0));
    CHECK(box.low.y() == Approx(drawn.low.y()).margin(1.0));
    CHECK(box.high.x() - box.low.x() == Approx(drawn.high.x() - drawn.low.x()).margin(6.0));
  }
}

TEST_CASE("a letter that was not drawn gets the stems and bars of those that were", "[weight]") {
  const Contours e = letter_e(regular.stem, regular.bar, 420, 700);
  const Weighted made = at_amount(e, 1.0);
  const StrokeEdges shape(made.contours, 11.0, 22.0);
  CHECK(shape.stem(100.0) == Approx(bold.stem).margin(4.0));
  CHECK(area_of(made.contours) > area_of(e));
}

TEST_CASE("at amount 0 an outline comes back bit for bit", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  CHECK(at_amount(e, 0.0).contours == e);
  CHECK(at_amount(shapes::letter_a(), 0.0).contours == shapes::letter_a());
}

TEST_CASE("the outline moves evenly with the amount", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  const Contours whole = at_amount(e, 1.0).contours;
  for (const double amount : {-1.0, -0.3, 0.25, 0.5, 1.5}) {
    const Weighted made = at_amount(e, amount);
    REQUIRE(made.amount == amount);
    for (std::size_t c = 0; c < e.size(); ++c) {
      const Points wished = e[c].points() + amount * (whole[c].points() - e[c].points());
      CHECK((made.contours[c].points() - wished).cwiseAbs().maxCoeff() < 1e-9);
    }
  }
}

TEST_CASE("equal amounts of every kind are that amount, bit for bit", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  for (const double amount : {-0.7, 0.0, 0.35, 1.0, 1.9}) {
    const Weighted made = with_amounts(e, {.x = amount, .y = amount});
    CHECK(made.contours == at_amount(e, amount).contours);
  }
}

TEST_CASE("the outline moves evenly with every amount by itself", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  const auto moved_by = [&](const WeightAmounts& amounts) -> Points {
    return with_amounts(e, amounts).contours[0].points() - e[0].points();
  };
  const Points by_x = moved_by({.x = 1.0, .y = 0.0});
  const Points by_y = moved_by({.x = 0.0, .y = 1.0});
  for (const auto& [x, y] : {std::pair{1.0, 1.0}, {0.5, 1.5}, {-0.4, 0.8}, {1.8, 0.1}}) {
    CHECK((moved_by({.x = x, .y = y}) - x * by_x - y * by_y).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("each direction of strokes can be weighted alone", "[weight]") {
  const std::vector<Contours> h = {letter_h(regular.stem, regular.bar, regular.counter, 700)};
  const auto made = [&](const WeightAmounts& amounts) {
    return std::vector<Contours>{with_amounts(h[0], amounts).contours};
  };
  const std::vector<Contours> wide = made({.x = 1.0, .y = 0.0});
  CHECK(measure_stems(wide, em).level.value() == Approx(regular.bar).margin(0.5));
  CHECK(measure_stems(wide, em).upright.value() == Approx(bold.stem).margin(2.0));
  const std::vector<Contours> high = made({.x = 0.0, .y = 1.0});
  CHECK(measure_stems(high, em).upright.value() == Approx(regular.stem).margin(0.5));
  CHECK(measure_stems(high, em).level.value() == Approx(bold.bar).margin(2.0));
  CHECK(tight_box(high[0][0]).high.x() == Approx(tight_box(h[0][0]).high.x()).margin(0.5));
}

TEST_CASE("thin strokes of a contrasted face take an amount of their own", "[weight]") {
  const WeightPair pair = pair_of("H", LetterClass::Capital, letter_h(120, 40, 300, 700), letter_h(180, 55, 300, 700));
  const WeightModel model = learn_weight(std::vector{pair}, em);
  const auto bar_at = [&](const std::optional<double>& thin) {
    const WeightOptions options{.amounts = {.thin = thin}};
    const std::vector<Contours> made = {apply_weight(pair.from, LetterClass::Capital, model, em, options).contours};
    CHECK(measure_stems(made, em).upright.value() == Approx(180.0).margin(1.0));
    return measure_stems(made, em).level.value();
  };
  CHECK(bar_at({}) == Approx(55.0).margin(1.0));
  CHECK(bar_at(0.0) == Approx(40.0).margin(1.0));
  CHECK(bar_at(2.0) == Approx(70.0).margin(2.0));
}

TEST_CASE("serifs take an amount of their own", "[weight]") {
  const WeightPair pair = pair_of("I", LetterClass::Capital, letter_i(100, 40, 60, 700), letter_i(160, 60, 80, 700));
  const WeightModel model = learn_weight(std::vector{pair}, em);
  const auto made_at = [&](const std::optional<double>& serif) {
    return apply_weight(pair.from, LetterClass::Capital, model, em, {.amounts = {.serif = serif}}).contours[0];
  };
  const auto serif_of = [](const BezierContour& i) { return i.points()(2, 1) - i.points()(1, 1); };
  CHECK(serif_of(made_at({})) == Approx(60.0).margin(2.0));
  CHECK(serif_of(made_at(0.0)) == Approx(40.0).margin(2.0));
  CHECK(serif_of(made_at(2.0)) > serif_of(made_at(1.0)));
}

TEST_CASE("stems wished for are met", "[weight]") {
  const std::vector<Contours> letters = {letter_h(84, 70, 310, 520), letter_o(88, 72, 520, 520, 12)};
  const WeightModel model = learn_weight(controls(), em);
  for (const auto& [upright, level] : {std::pair{120.0, 90.0}, {84.0, 80.0}, {150.0, 70.0}, {60.0, 60.0}}) {
    const WeightAmounts amounts =
        amounts_for_stems(letters, LetterClass::LowerCase, model, em, {.upright = upright, .level = level});
    std::vector<Contours> made;
    for (const Contours& letter : letters) {
      made.push_back(apply_weight(letter, LetterClass::LowerCase, model, em, {.amounts = amounts}).contours);
    }
    CHECK(measure_stems(made, em).upright.value() == Approx(upright).margin(0.6));
    CHECK(measure_stems(made, em).level.value() == Approx(level).margin(0.6));
  }
  const WeightAmounts even =
      amounts_for_stems(letters, LetterClass::LowerCase, model, em, {.upright = 120.0, .level = {}});
  CHECK(even.x == even.y);
  CHECK_THROWS_AS(amounts_for_stems(letters, LetterClass::LowerCase, model, em, {}), InvalidInput);
  CHECK_THROWS_AS(amounts_for_stems({}, LetterClass::LowerCase, model, em, {.upright = 100.0, .level = {}}),
                  InvalidInput);
  CHECK_THROWS_AS(amounts_for_stems(letters, LetterClass::LowerCase, model, em, {.upright = 400.0, .level = {}}),
                  InvalidInput);
}

TEST_CASE("the amounts a letter was made with are found again", "[weight]") {
  const WeightModel model = learn_weight(controls(), em);
  for (const auto& [x, y] : {std::pair{1.0, 1.0}, {0.6, 1.2}, {1.5, 0.7}}) {
    std::vector<WeightPair> made = controls();
    for (WeightPair& pair : made) {
      pair.to = apply_weight(pair.from, pair.letter_class, model, em, {.amounts = {.x = x, .y = y}}).contours;
    }
    const WeightAmounts found = fit_amounts(made, model, em);
    CHECK(found.x == Approx(x).margin(0.03));
    CHECK(found.y == Approx(y).margin(0.05));
  }
  CHECK_THROWS_AS(fit_amounts({}, model, em), InvalidInput);
}

TEST_CASE("a family half as large takes half the step", "[weight]") {
  std::vector<WeightPair> half = controls();
  for (WeightPair& pair : half) {
    pair.from = mapped(pair.from, scaled(0.5));
    pair.to = mapped(pair.to, scaled(0.5));
  }
  const WeightModel carried = carry_weight(learn_weight(controls(), em), half, em);
  const Contours e = letter_e(regular.stem, regular.bar, 420, 700);
  const Contours there = at_amount(e, 1.0).contours;
  const Contours made = apply_weight(mapped(e, scaled(0.5)), LetterClass::Capital, carried, em).contours;
  const Points apart = 2.0 * made[0].points() - there[0].points();
  CHECK(apart.col(1).cwiseAbs().maxCoeff() < 0.5);
  const auto stem = [](const Contours& letter) { return letter[0].points()(3, 0) - letter[0].points()(0, 0); };
  CHECK(2.0 * stem(made) == Approx(stem(there)).margin(0.5));
  // The ends of arms are held by no law, only weakly by lengths in the em.
  CHECK(apart.col(0).cwiseAbs().maxCoeff() < 10.0);
}

TEST_CASE("a carried step is as strong as the other family's letters show", "[weight]") {
  // Another family: thinner, lower, with its own n and o in both weights and H and O in one.
  const Weight thin{70, 56, 340};
  const Weight black{135, 80, 330};
  const auto o = [](const Weight& w) { return letter_o(w.stem, w.bar, 2.0 * w.stem + w.counter + 60.0, 480, 10.0); };
  const std::vector<WeightPair> letters = {
      pair_of("n", LetterClass::LowerCase, letter_h(thin.stem, thin.bar, thin.counter, 480),
              letter_h(black.stem, black.bar, black.counter, 480)),
      pair_of("o", LetterClass::LowerCase, o(thin), o(black)),
      pair_of("H", LetterClass::Capital, letter_h(thin.stem, thin.bar, thin.counter, 640), {}),
      pair_of("O", LetterClass::Capital, letter_o(thin.stem, thin.bar, 600, 640, 10.0), {})};
  const WeightModel carried = carry_weight(learn_weight(controls(), em), letters, em);
  REQUIRE(carried.controls.size() == 2);
  for (const WeightModel::Control& control : carried.controls) {
    CHECK(control.thickness_error < 3.0);
    CHECK(std::abs(control.width_error) < 8.0);
  }
  const WeightAmounts fitted = fit_amounts(std::span(letters).first(2), carried, em);
  CHECK(fitted.x == Approx(1.0).margin(0.02));
  CHECK(fitted.y == Approx(1.0).margin(0.02));
  // A capital it never saw in bold: stems in proportion, height kept as the model keeps it.
  const Contours e = letter_e(thin.stem, thin.bar, 400, 640);
  const Contours made = apply_weight(e, LetterClass::Capital, carried, em).contours;
  CHECK(StrokeEdges(made, 11.0, 22.0).stem(100.0) == Approx(black.stem).margin(4.0));
  CHECK(tight_box(made[0]).high.y() == Approx(640.0).margin(1.0));
  CHECK_THROWS_AS(carry_weight(carried, {}, em), InvalidInput);
  CHECK_THROWS_AS(carry_weight(carried, letters, 0.0), InvalidInput);
}

TEST_CASE("bolder never takes ink away, lighter never adds any", "[weight]") {
  const std::vector<Contours> letters = {letter_e(90, 76, 420, 700), letter_o(90, 76, 450, 700, 12),
                                         letter_h(90, 76, 300, 700), mapped(shapes::letter_a(), scaled(1000.0 / 2048))};
  for (const Contours& letter : letters) {
    double before = area_of(letter);
    for (const double amount : {0.1, 0.5, 1.0, 2.0}) {
      const double area = area_of(at_amount(letter, amount).contours);
      CHECK(area >= before);
      before = area;
    }
    CHECK(area_of(at_amount(letter, -0.5).contours) <= area_of(letter));
  }
}

TEST_CASE("structure, axis-parallel lines and extrema survive a change of weight", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  const Weighted made = at_amount(e, 1.0);
  CHECK(has_same_structure(made.contours[0], e[0]));
  CHECK(is_axis_parallel(made.contours[0]));
  const Contours ring = at_amount(letter_o(90, 76, 450, 700, 12), 1.0).contours;
  for (const BezierContour& contour : ring) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      for (const int axis : {0, 1}) {
        const Bezier bezier = contour.segment(s);
        for (const double u : extrema(bezier, axis)) {
          const double low = std::min(bezier.start()[axis], bezier.end()[axis]);
          const double high = std::max(bezier.start()[axis], bezier.end()[axis]);
          CHECK(evaluate(bezier, u)[axis] > low - 0.3);
          CHECK(evaluate(bezier, u)[axis] < high + 0.3);
        }
      }
    }
  }
}

TEST_CASE("a change of weight adds no crossing and closes no counter", "[weight]") {
  // Counters that a bold stroke would fill: the amount is scaled back, and said to be.
  const Contours narrow = letter_o(90, 76, 240, 700, 12);
  const Weighted made = at_amount(narrow, 2.0);
  CHECK(find_crossings(made.contours).empty());
  CHECK(measure_ink(made.contours).counters.size() == 1);
  CHECK(made.amount <= 2.0);
  CHECK(area_of(made.contours) >= area_of(narrow));
}

TEST_CASE("a narrow notch that thick strokes would cross is kept open", "[weight]") {
  // A V with a short flat foot in its crotch, which the strokes' inner sides would pass.
  const Contours v = {
      shapes::polygon({{0, 700}, {200, 0}, {290, 0}, {490, 700}, {395, 700}, {248, 150}, {242, 150}, {95, 700}})};
  for (const double amount : {0.5, 1.0, 2.0}) {
    const Weighted made = at_amount(v, amount);
    CHECK(find_crossings(made.contours).empty());
    CHECK(made.amount > 0.0);
  }
}

TEST_CASE("a model fits any units per em", "[weight]") {
  std::vector<WeightPair> large = controls();
  for (WeightPair& pair : large) {
    pair.from = mapped(pair.from, scaled(2.048));
    pair.to = mapped(pair.to, scaled(2.048));
  }
  const WeightModel model = learn_weight(large, 2048.0);
  const Contours e = letter_e(90, 76, 420, 700);
  const Contours made = apply_weight(mapped(e, scaled(2.048)), LetterClass::Capital, model, 2048.0).contours;
  const Contours small = at_amount(e, 1.0).contours;
  CHECK((made[0].points() / 2.048 - small[0].points()).cwiseAbs().maxCoeff() < 0.1);
}

TEST_CASE("neither where a letter stands nor which way its contours run matters", "[weight]") {
  const Contours e = letter_e(90, 76, 420, 700);
  const Contours made = at_amount(e, 1.0).contours;
  const Contours back = at_amount({reverse(e[0])}, 1.0).contours;
  CHECK((reverse(back[0]).points() - made[0].points()).cwiseAbs().maxCoeff() < 0.5);
  Affine aside;
  aside.shift = Point(250, 0);
  const Points there = at_amount(mapped(e, aside), 1.0).contours[0].points();
  const Points apart = there - made[0].points();
  CHECK((apart.rowwise() - apart.row(0)).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("a point that draws nothing stays, and an empty shape is no error", "[weight]") {
  Contours letter = letter_e(90, 76, 420, 700);
  letter.push_back(shapes::polygon({{250, 800}}));
  const Weighted made = at_amount(letter, 1.0);
  CHECK(made.contours[1] == letter[1]);
  CHECK(made.amount == 1.0);
  CHECK(at_amount({}, 1.0).contours.empty());
}

TEST_CASE("a control letter whose contours do not pair up is left out and named", "[weight]") {
  std::vector<WeightPair> pairs = controls();
  pairs.push_back(pair_of("Q", LetterClass::Capital, letter_o(90, 76, 450, 700, 12), letter_h(150, 110, 270, 700)));
  const WeightModel model = learn_weight(pairs, em);
  REQUIRE(model.controls.size() == 5);
  CHECK_FALSE(model.controls.back().used);
  CHECK(model.controls.back().name == "Q");
}

TEST_CASE("weight refuses what it cannot mean", "[weight]") {
  const WeightModel model = learn_weight(controls(), em);
  const Contours e = letter_e(90, 76, 420, 700);
  CHECK_THROWS_AS(learn_weight({}, em), InvalidInput);
  CHECK_THROWS_AS(learn_weight(controls(), 0.0), InvalidInput);
  CHECK_THROWS_AS(apply_weight(e, LetterClass::Capital, model, -1.0), InvalidInput);
  CHECK_THROWS_AS(apply_weight(e, LetterClass::Capital, model, em, {.amount = 2.5}), InvalidInput);
  CHECK_THROWS_AS(apply_weight(e, LetterClass::Capital, model, em, {.amount = std::nan("")}), InvalidInput);
  CHECK_THROWS_AS(apply_weight(e, LetterClass::Capital, model, em, {.amounts = {.x = 2.5}}), InvalidInput);
  CHECK_THROWS_AS(apply_weight(e, LetterClass::Capital, model, em, {.amount = 2.0, .amounts = {.y = -0.6}}),
                  InvalidInput);
  CHECK_THROWS_AS(measure_stems(std::vector<Contours>{e}, 0.0), InvalidInput);
}
