#include "fontcore/ink.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

using Contours = std::vector<BezierContour>;

BezierContour rectangle(double x0, double y0, double x1, double y1) {
  return shapes::polygon({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}});
}

BezierContour moved(const BezierContour& contour, double x, double y) { return transform(contour, {.shift = {x, y}}); }

BezierContour turned(const BezierContour& contour, double angle) {
  Affine turn;
  turn.linear << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return transform(contour, turn);
}

Contours turned(const Contours& contours, double angle) {
  Contours result;
  for (const BezierContour& contour : contours) result.push_back(turned(contour, angle));
  return result;
}

/// The ink along horizontal lines half way between equal steps, of the contours flattened.
double area_by_lines(const Contours& contours, double step, int lines) {
  struct Chord {
    Point from, to;
  };
  std::vector<Chord> chords;
  Box box;
  for (const BezierContour& contour : contours) {
    const Points points = to_polyline(contour, step);
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      chords.push_back({points.row(i), points.row((i + 1) % points.rows())});
      box.add(chords.back().from);
    }
  }
  const double height = (box.high.y() - box.low.y()) / lines;
  double area = 0.0;
  for (int k = 0; k < lines; ++k) {
    const double y = box.low.y() + (k + 0.5) * height;
    std::vector<std::pair<double, int>> passed;
    for (const auto& [from, to] : chords) {
      if ((from.y() <= y) == (to.y() <= y)) continue;
      const double t = (y - from.y()) / (to.y() - from.y());
      passed.emplace_back(from.x() + t * (to.x() - from.x()), from.y() < to.y() ? -1 : 1);
    }
    std::sort(passed.begin(), passed.end());
    int winding = 0;
    for (std::size_t i = 0; i + 1 < passed.size(); ++i) {
      winding += passed[i].second;
      if (winding != 0) area += height * (passed[i + 1].first - passed[i].first);
    }
  }
  return area;
}

BezierContour random_contour(std::mt19937& random, int segments) {
  std::uniform_int_distribution<int> coordinate(-500, 500);
  std::uniform_int_distribution<int> any_degree(1, 3);
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  for (int s = 0; s < segments; ++s) {
    const int degree = any_degree(random);
    for (int k = 0; k < degree; ++k) {
      const int x = coordinate(random);
      points.emplace_back(x, coordinate(random));
      kinds.push_back(k == 0 ? PointKind::Node : degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
  }
  return {shapes::points_of(points), kinds};
}

void check_box(const Box& box, Point low, Point high) {
  CHECK((box.low - low).norm() < 1e-6);
  CHECK((box.high - high).norm() < 1e-6);
}

}  // namespace

TEST_CASE("contours that meet nowhere add and take away their own areas", "[ink]") {
  const double disc = signed_area(shapes::circle(100));
  CHECK(measure_ink({}).area == 0.0);
  const Ink one = measure_ink({shapes::circle(100)});
  CHECK(one.area == disc);
  CHECK(one.parts == 1);
  CHECK(one.counters.empty());
  CHECK(measure_ink({reverse(shapes::circle(100))}).area == Approx(disc).epsilon(1e-14));

  const Contours ring{shapes::square(400), reverse(moved(shapes::circle(100), 200, 200))};
  const Ink with_counter = measure_ink(ring);
  CHECK(with_counter.area == Approx(160000 - disc).epsilon(1e-14));
  CHECK(with_counter.parts == 1);
  REQUIRE(with_counter.counters.size() == 1);
  check_box(with_counter.counters[0], {100, 100}, {300, 300});

  // Of the same direction the inner contour changes nothing; in the counter lies a dot.
  CHECK(measure_ink({shapes::square(400), moved(shapes::circle(100), 200, 200)}).area == 160000);
  Contours eye = ring;
  eye.push_back(moved(shapes::circle(10), 200, 200));
  CHECK(measure_ink(eye).area == Approx(160000 - disc + disc / 100).epsilon(1e-14));
  CHECK(measure_ink(eye).parts == 2);
  CHECK(measure_ink(eye).counters.size() == 1);
}

TEST_CASE("squares that overlap cover their common part once", "[ink]") {
  for (const double angle : {0.0, 0.3, 1.1, 2.0}) {
    CAPTURE(angle);
    const Contours same = turned({shapes::square(100), moved(shapes::square(100), 50, 30)}, angle);
    CHECK(measure_ink(same).area == Approx(20000 - 50 * 70).epsilon(1e-9));
    CHECK(measure_ink(same).parts == 1);
    CHECK(measure_ink(same).counters.empty());
    // Of opposite directions they take it away from each other.
    const Contours opposite = turned({shapes::square(100), reverse(moved(shapes::square(100), 50, 30))}, angle);
    const Ink ink = measure_ink(opposite);
    CHECK(ink.area == Approx(20000 - 2 * 50 * 70).epsilon(1e-9));
    CHECK(ink.parts == 2);
    CHECK(ink.counters.size() == 1);  // two corners, where the parts touch, enclose it
  }
}

TEST_CASE("a circle on a bar covers what the circle's cubic leaves over it", "[ink]") {
  // The bar hides the lower half.
  const double disc = signed_area(shapes::circle(100));
  const Contours shape{rectangle(-300, -200, 300, 0), shapes::circle(100)};
  CHECK(measure_ink(shape).area == Approx(600 * 200 + disc / 2).epsilon(1e-12));
  const Ink cut = measure_ink({rectangle(-300, -30, 300, 30), shapes::circle(100)});
  CHECK(cut.parts == 1);
  CHECK(cut.area ==
        Approx(area_by_lines({rectangle(-300, -30, 300, 30), shapes::circle(100)}, 0.05, 4000)).epsilon(1e-5));
}

TEST_CASE("a contour wound twice is ink once, and one run out and back is none", "[ink]") {
  const BezierContour twice =
      shapes::polygon({{0, 0}, {100, 0}, {100, 100}, {0, 100}, {0, 0}, {100, 0}, {100, 100}, {0, 100}});
  CHECK(measure_ink({twice}).area == Approx(10000).epsilon(1e-12));
  CHECK(measure_ink({twice}).parts == 1);
  const Contours pair{shapes::circle(100), shapes::circle(100)};
  CHECK(measure_ink(pair).area == Approx(signed_area(pair[0])).epsilon(1e-12));
  const Ink cancelled = measure_ink({shapes::circle(100), reverse(shapes::circle(100))});
  CHECK(cancelled.area == Approx(0.0).margin(1e-9));
  CHECK(cancelled.parts == 0);
  CHECK(cancelled.counters.empty());
  CHECK(measure_ink({shapes::polygon({{0, 0}, {100, 40}})}).area == Approx(0.0).margin(1e-9));
}

TEST_CASE("both lobes of a figure eight are ink", "[ink]") {
  const Contours eight{shapes::polygon({{0, 0}, {100, 100}, {100, 0}, {0, 100}})};
  CHECK(signed_area(eight) == 0.0);
  CHECK(measure_ink(eight).area == Approx(5000).epsilon(1e-12));
  CHECK(measure_ink(eight).parts == 2);
  // The loop of one cubic over its closed form: x = 400 v (v^2 - w^2), y = 300 (1 - v^2), v from -1 to 1.
  const double w2 = 0.25;
  const double k = 400.0;
  const Contours loop{
      {shapes::points_of(
           {{k * (w2 - 1), 0}, {k * (1 + w2 / 3), 400}, {-k * (1 + w2 / 3), 400}, {k * (1 - w2), 0}, {0, -200}}),
       {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Node}}};
  // Loop and body run in opposite directions; the loop's own area is 8/15 * 400 * 300 * w^5.
  const double inside = 8.0 / 15.0 * 400 * 300 * std::pow(w2, 2.5);
  CHECK(measure_ink(loop).area == Approx(std::abs(signed_area(loop)) + 2 * inside).epsilon(1e-9));
}

TEST_CASE("a contact joins no ink and closes a counter", "[ink]") {
  const Ink corners = measure_ink({shapes::square(100), moved(shapes::square(100), 100, 100)});
  CHECK(corners.area == Approx(20000));
  CHECK(corners.parts == 2);
  CHECK(corners.counters.empty());
  // Squares that share a side are one piece, whichever side it is.
  for (const double angle : {0.0, 0.4, std::numbers::pi / 2}) {
    const Ink wall = measure_ink(turned({shapes::square(100), moved(shapes::square(100), 100, 20)}, angle));
    CHECK(wall.area == Approx(20000).epsilon(1e-9));
    CHECK(wall.parts == 1);
  }
  // A ring that is open by the gap: closed if it is no wider than a contact.
  const auto ring = [](double gap) {
    return Contours{shapes::polygon({{0, 0},
                                     {300, 0},
                                     {300, 150 - gap / 2},
                                     {200, 150 - gap / 2},
                                     {200, 100},
                                     {100, 100},
                                     {100, 200},
                                     {200, 200},
                                     {200, 150 + gap / 2},
                                     {300, 150 + gap / 2},
                                     {300, 300},
                                     {0, 300}})};
  };
  for (const double angle : {0.0, 0.7, std::numbers::pi / 2}) {
    CAPTURE(angle);
    CHECK(measure_ink(turned(ring(1.0), angle)).counters.empty());
    const Ink closed = measure_ink(turned(ring(0.0), angle));
    CHECK(closed.counters.size() == 1);
    CHECK(closed.parts == 1);
    CHECK(closed.area == Approx(80000).epsilon(1e-9));
    CHECK(measure_ink(turned(ring(-10.0), angle)).counters.size() == 1);
  }
}

TEST_CASE("overlapping strokes enclose a counter", "[ink]") {
  // A hash of four bars.
  const Contours hash{rectangle(0, 100, 400, 150), rectangle(0, 250, 400, 300), rectangle(100, 0, 150, 400),
                      rectangle(250, 0, 300, 400)};
  const Ink ink = measure_ink(hash);
  CHECK(ink.area == Approx(4 * 400 * 50 - 4 * 50 * 50).epsilon(1e-12));
  CHECK(ink.parts == 1);
  REQUIRE(ink.counters.size() == 1);
  check_box(ink.counters[0], {150, 150}, {250, 250});
  // Of curves: two rings through each other, each of two circles.
  const auto ring = [](double x) {
    return Contours{moved(shapes::circle(100), x, 0), reverse(moved(shapes::circle(60), x, 0))};
  };
  Contours chain = ring(0);
  for (const BezierContour& contour : ring(150)) chain.push_back(contour);
  CHECK(measure_ink(chain).counters.size() == 2);
  CHECK(measure_ink(chain).area == Approx(area_by_lines(chain, 0.05, 8000)).epsilon(1e-5));
}

TEST_CASE("ink does not depend on place, direction, start point, order or what lies elsewhere", "[ink]") {
  std::mt19937 random(3);
  for (int k = 0; k < 60; ++k) {
    const Contours contours{random_contour(random, 2 + k % 5), random_contour(random, 3)};
    CAPTURE(k, contours[0].points(), contours[1].points());
    const Ink ink = measure_ink(contours);
    const auto check = [&](const Ink& other) {
      CHECK(other.area == Approx(ink.area).epsilon(1e-9));
      CHECK(other.parts == ink.parts);
      CHECK(other.counters.size() == ink.counters.size());
    };
    check(measure_ink({contours[1], contours[0]}));
    check(measure_ink({reverse(contours[0]), reverse(contours[1])}));
    check(measure_ink({moved(contours[0], 1000, -77), moved(contours[1], 1000, -77)}));
    check(measure_ink(turned(contours, 1.0)));
    check(measure_ink(turned(contours, std::numbers::pi / 2)));
    // Both ways of working: with a figure eight far away nothing is known to be apart.
    Contours clean{shapes::circle(100), reverse(moved(shapes::circle(50), 3, 4)),
                   moved(shapes::circle(20), 7, -3 + k % 7)};
    const Ink quick = measure_ink(clean);
    clean.push_back(moved(shapes::polygon({{0, 0}, {10, 10}, {10, 0}, {0, 10}}), 500, k));
    const Ink slow = measure_ink(clean);
    CHECK(slow.area - 50 == Approx(quick.area).epsilon(1e-11));
    CHECK(slow.parts - 2 == quick.parts);
    REQUIRE(slow.counters.size() == quick.counters.size());
    check_box(slow.counters[0], quick.counters[0].low, quick.counters[0].high);
  }
}

TEST_CASE("the ink of random contours is that along fine lines", "[ink]") {
  std::mt19937 random(17);
  for (int k = 0; k < 60; ++k) {
    const Contours contours{random_contour(random, 2 + k % 6), random_contour(random, 2 + k % 3)};
    CAPTURE(k, contours[0].points(), contours[1].points());
    CHECK(measure_ink(contours).area == Approx(area_by_lines(contours, 1.0, 4000)).epsilon(1e-4).margin(1e-6));
  }
}

TEST_CASE("outlines full of contacts and overlaps have the same ink turned and turned round", "[ink]") {
  std::mt19937 random(5);
  for (int k = 0; k < 200; ++k) {
    const int grid = 2 + k % 5;
    Contours contours;
    for (int c = 0; c < 3; ++c) {
      std::vector<Point> points;
      for (int i = 0; i < 3 + k % 4; ++i) {
        const double x = 120.0 / grid * static_cast<double>(random() % static_cast<unsigned>(grid + 1));
        points.emplace_back(x, 120.0 / grid * static_cast<double>(random() % static_cast<unsigned>(grid + 1)));
      }
      contours.push_back(shapes::polygon(points));
    }
    CAPTURE(k, contours[0].points(), contours[1].points(), contours[2].points());
    const double area = measure_ink(contours).area;
    CHECK(area == Approx(area_by_lines(contours, 1e9, 2000)).margin(10));
    CHECK(measure_ink({reverse(contours[2]), reverse(contours[1]), reverse(contours[0])}).area ==
          Approx(area).margin(1e-6));
    const Contours slanted = turned(contours, 0.7);
    const auto crossings = find_crossings(slanted);
    CHECK(std::all_of(crossings.begin(), crossings.end(), [](const Crossing& one) { return one.where.allFinite(); }));
    CHECK(measure_ink(slanted, crossings).area == Approx(area).margin(1e-5));
  }
  // Without width or height.
  CHECK(measure_ink({shapes::polygon({{7, 0}, {7, 50}, {7, 20}, {7, 90}})}).area == 0.0);
  CHECK(measure_ink({shapes::polygon({{0, 7}, {50, 7}, {20, 7}, {90, 7}})}).area == 0.0);
}

TEST_CASE("a counter that a stroke grows over is closed", "[ink]") {
  const auto letter = [](double counter, double other) {
    return Contours{rectangle(0, 0, 300, 600), reverse(rectangle(100, 350, 100 + counter, 500)),
                    reverse(rectangle(100, 100, 100 + other, 250))};
  };
  const Ink before = measure_ink(letter(100, 100));
  REQUIRE(before.counters.size() == 2);
  CHECK(closed_counters(before, measure_ink(letter(20, 100))).empty());
  const auto gone = closed_counters(before, measure_ink(letter(-5, 100)));  // turned inside out, it is ink
  REQUIRE(gone.size() == 1);
  check_box(gone[0], {100, 350}, {200, 500});
  CHECK(closed_counters(before, measure_ink(letter(100, 0))).size() == 1);
  CHECK(closed_counters(before, Ink{}).size() == 2);
  // Two counters that run into each other are one.
  const Ink joined = measure_ink({rectangle(0, 0, 300, 600), reverse(rectangle(100, 100, 200, 500))});
  CHECK(closed_counters(before, joined).size() == 1);
}

TEST_CASE("a contour that turns round or leaves its place among the others is named", "[ink]") {
  const Contours ring{shapes::square(400), reverse(moved(shapes::circle(50), 200, 200))};
  const auto changed = [&](const Contours& after) {
    return changed_windings(ring, find_crossings(ring), after, find_crossings(after));
  };
  CHECK(changed(ring).empty());
  CHECK(changed({shapes::square(400), shapes::circle(50)}) == std::vector{1});
  CHECK(changed({shapes::square(400), reverse(moved(shapes::circle(50), 600, 200))}) == std::vector{1});
  CHECK(changed({shapes::square(400), reverse(moved(shapes::circle(50), 100, 100))}).empty());
  // Where they meet nothing is said of their places.
  CHECK(changed({shapes::square(400), reverse(moved(shapes::circle(50), 400, 200))}).empty());
  CHECK_THROWS_AS(changed({shapes::square(400)}), InvalidInput);
}

TEST_CASE("the winding number counts every turn, also through nodes and extrema", "[ink]") {
  const BezierContour circle = shapes::circle(100);
  for (const Point& inside : {Point(0, 0), Point(-99.9, 0), Point(50, 80), Point(0, 99.9), Point(0, -99.9)}) {
    CHECK(winding_number(circle, inside) == 1);
    CHECK(winding_number(reverse(circle), inside) == -1);
  }
  for (const Point& outside : {Point(101, 0), Point(-101, 0), Point(300, 100), Point(300, -100), Point(90, 90)}) {
    CHECK(winding_number(circle, outside) == 0);
  }
  CHECK(winding_number(shapes::polygon({{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {9, 0}, {9, 9}, {0, 9}}), {4, 4}) == 2);
}

TEST_CASE("outlines made to exhaust the measure are given up", "[ink]") {
  const Contours pile(3000, shapes::square(500));
  CHECK_THROWS_AS(measure_ink(pile), WorkLimitExceeded);
  CHECK_THROWS_AS(
      measure_ink({shapes::square(500), moved(shapes::square(500), 100, 100)}, CrossingOptions{.most_work = 10}),
      WorkLimitExceeded);
}

TEST_CASE("contours that nest or meet keep their directions to each other, others count as positive", "[ink]") {
  const BezierContour outer = rectangle(0, 0, 400, 400);
  const BezierContour inner = reverse(rectangle(100, 100, 300, 300));
  const BezierContour apart = rectangle(500, 0, 600, 100);
  const BezierContour across = rectangle(350, 150, 450, 250);
  CHECK(orientation_signs({outer, inner, apart}) == std::vector<int>{1, 1, 1});
  CHECK(orientation_signs({reverse(outer), reverse(inner), apart}) == std::vector<int>{-1, -1, 1});
  CHECK(orientation_signs({outer, inner, reverse(apart)}) == std::vector<int>{1, 1, -1});
  CHECK(orientation_signs({inner, reverse(across), outer}) == std::vector<int>{1, 1, 1});
  CHECK(orientation_signs({reverse(outer)}) == std::vector<int>{-1});
}
