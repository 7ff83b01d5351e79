#include "fontcore/crossing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

/// A contour from its points and their kinds, one letter each: n node, q quadratic, c cubic handle.
BezierContour outline(const std::vector<Point>& points, const std::string& letters) {
  Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) rows.row(i) = points[static_cast<std::size_t>(i)];
  std::vector<PointKind> kinds;
  for (const char letter : letters) {
    kinds.push_back(letter == 'n' ? PointKind::Node : letter == 'q' ? PointKind::Quadratic : PointKind::Cubic);
  }
  return {rows, kinds};
}

BezierContour polygon(const std::vector<Point>& points) { return outline(points, std::string(points.size(), 'n')); }

BezierContour box(double x0, double y0, double x1, double y1) {
  return polygon({{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}});
}

/// A circle of four cubics, first node on the right.
BezierContour circle(Point m, double r) {
  const double h = 0.5522847498 * r;
  const double x = m.x();
  const double y = m.y();
  return outline({{x + r, y},
                  {x + r, y + h},
                  {x + h, y + r},
                  {x, y + r},
                  {x - h, y + r},
                  {x - r, y + h},
                  {x - r, y},
                  {x - r, y - h},
                  {x - h, y - r},
                  {x, y - r},
                  {x + h, y - r},
                  {x + r, y - h}},
                 "nccnccnccncc");
}

/// The same contour with its point list begun k points later.
BezierContour rotate(const BezierContour& contour, Eigen::Index k) {
  const Eigen::Index n = contour.point_count();
  Points points(n, 2);
  std::vector<PointKind> kinds;
  for (Eigen::Index i = 0; i < n; ++i) {
    points.row(i) = contour.points().row((i + k) % n);
    kinds.push_back(contour.kind(static_cast<int>((i + k) % n)));
  }
  return {points, kinds};
}

Point point_at(const std::vector<BezierContour>& contours, const Place& place) {
  return evaluate(contours[static_cast<std::size_t>(place.contour)].segment(place.segment), place.u);
}

std::string names(const std::vector<Crossing>& found) {
  std::string list;
  for (const Crossing& crossing : found) {
    const char* name = crossing.meeting == Meeting::Crossing  ? "crossing"
                       : crossing.meeting == Meeting::Contact ? "contact"
                                                              : "overlap";
    list += (list.empty() ? "" : " ") + std::string(name);
  }
  return list;
}

std::string meetings(const std::vector<BezierContour>& contours) { return names(find_crossings(contours)); }

/// One finding of the kind, at the point to 1e-3 units.
void check_one(const std::vector<BezierContour>& contours, const std::string& kind, Point where) {
  const auto found = find_crossings(contours);
  REQUIRE(names(found) == kind);
  CHECK((found[0].where - where).norm() < 1e-3);
  CHECK((point_at(contours, found[0].a) - found[0].where).norm() < 2e-4);
  CHECK((point_at(contours, found[0].b) - found[0].where).norm() < 2e-4);
}

/// A random closed contour of n segments of the degree, or of mixed degrees if 0.
BezierContour random_contour(std::mt19937& random, int n, int degree) {
  std::uniform_int_distribution<int> coordinate(-50000, 50000);
  std::uniform_int_distribution<int> any_degree(1, 3);
  std::vector<Point> points;
  std::string kinds;
  for (int s = 0; s < n; ++s) {
    const int d = degree == 0 ? any_degree(random) : degree;
    for (int k = 0; k < d; ++k) {
      const int x = coordinate(random);
      points.emplace_back(x / 128.0, coordinate(random) / 128.0);
      kinds += k == 0 ? 'n' : d == 2 ? 'q' : 'c';
    }
  }
  return outline(points, kinds);
}

/// Proper crossings of chords, `chords` to a curve and shorter towards its ends, where neighbours may cross shortly.
int count_by_flattening(const std::vector<BezierContour>& contours, int chords) {
  struct Chord {
    Point from, to;
  };
  std::vector<Chord> all;
  for (const BezierContour& contour : contours) {
    std::vector<Point> line;
    for (int s = 0; s < contour.segment_count(); ++s) {
      const int n = contour.degree(s) == 1 ? 1 : chords;
      for (int k = 0; k < n; ++k)
        line.push_back(evaluate(contour.segment(s), 0.5 - 0.5 * std::cos(3.14159265358979 * k / n)));
    }
    for (std::size_t k = 0; k < line.size(); ++k) all.push_back({line[k], line[(k + 1) % line.size()]});
  }
  std::sort(all.begin(), all.end(), [](const Chord& x, const Chord& y) {
    return std::min(x.from.x(), x.to.x()) < std::min(y.from.x(), y.to.x());
  });
  const auto turn = [](const Point& a, const Point& b, const Point& c) {
    const Point u = b - a;
    const Point v = c - a;
    return u.x() * v.y() - u.y() * v.x();
  };
  int sum = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [a, b] = all[i];
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      const auto& [c, d] = all[j];
      if (std::min(c.x(), d.x()) > std::max(a.x(), b.x())) break;
      if (a == d || b == c) continue;
      if (turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0) ++sum;
    }
  }
  return sum;
}

}  // namespace

TEST_CASE("a figure eight of lines crosses itself once, in its middle", "[crossing]") {
  check_one({polygon({{0, 0}, {100, 100}, {100, 0}, {0, 100}})}, "crossing", {50, 50});
  CHECK_FALSE(is_simple(polygon({{0, 0}, {100, 100}, {100, 0}, {0, 100}})));
}

TEST_CASE("a waist of a hundredth of a unit is no crossing", "[crossing]") {
  const auto waist = [](double air) {
    return polygon({{0, 0}, {50, 50 - air}, {100, 0}, {100, 100}, {50, 50 + air}, {0, 100}});
  };
  CHECK(is_simple(waist(0.005)));
  CHECK(meetings({waist(-0.1)}) == "crossing crossing");
  check_one({waist(0.0)}, "contact", {50, 50});
}

TEST_CASE("a figure eight of two curves crosses itself where it was drawn through", "[crossing]") {
  check_one({outline({{0, 0}, {200, 200}, {200, -200}, {0, 0}, {-200, 200}, {-200, -200}}, "nccncc")}, "crossing",
            {0, 0});
}

TEST_CASE("the loop in one cubic is found at its closed form", "[crossing]") {
  // Over v = 2 u - 1 the curve is x = 400 v (v^2 - w^2), y = 300 (1 - v^2): it meets itself at v = -w and w.
  const auto loop = [](double w2) {
    const double k = 400.0;
    return outline({{k * (w2 - 1), 0}, {k * (1 + w2 / 3), 400}, {-k * (1 + w2 / 3), 400}, {k * (1 - w2), 0}, {0, -200}},
                   "nccnn");
  };
  for (const double w : {0.5, 0.1, 0.02, 0.003}) {
    const auto found = find_crossings({loop(w * w)});
    REQUIRE(names(found) == "crossing");
    CHECK((found[0].where - Point(0, 300 * (1 - w * w))).norm() < 1e-6);
    CHECK(found[0].a.segment == 0);
    CHECK(found[0].b.segment == 0);
    CHECK(found[0].a.u == Approx((1 - w) / 2).margin(1e-8));
    CHECK(found[0].b.u == Approx((1 + w) / 2).margin(1e-8));
  }
  CHECK(is_simple(loop(0.0)));  // a cusp
  CHECK(is_simple(loop(-0.01)));
}

TEST_CASE("a contour of a single closed cubic is clean", "[crossing]") {
  CHECK(is_simple(outline({{0, 0}, {200, 100}, {-200, 100}}, "ncc")));
}

TEST_CASE("a cusp that no halving reaches is clean", "[crossing]") {
  // x = 400 (u - 1/3)^2, y = 900 (u - 1/3)^3
  const double t = 1.0 / 3.0;
  const auto at = [&](double u) { return Point(400 * (u - t) * (u - t), 900 * std::pow(u - t, 3)); };
  const auto slope = [&](double u) { return Point(800 * (u - t), 2700 * (u - t) * (u - t)); };
  CHECK(is_simple(outline({at(0), at(0) + slope(0) / 3, at(1) - slope(1) / 3, at(1), {400, 0}}, "nccnn")));
}

TEST_CASE("a drop that ends in a cusp is clean", "[crossing]") {
  // Both sides leave the point (0, 0) upwards.
  CHECK(is_simple(
      outline({{0, 0}, {0, 150}, {100, 200}, {100, 300}, {100, 400}, {-100, 400}, {-100, 300}, {-100, 200}, {0, 150}},
              "nccnccncc")));
  CHECK(is_simple(outline({{0, 0}, {0, 100}, {2, 200}, {-2, 200}, {0, 100}}, "nqnnq")));
  // One side straight, and the other leaving it with its third power.
  CHECK(is_simple(outline({{0, 0}, {0, 300}, {-100, 300}, {0, 200}, {0, 100}}, "nnncc")));
}

TEST_CASE("a cubic that returns to its own node is found whichever end it is", "[crossing]") {
  // The loop of the closed form above, from its double point on: the node is where the curve passes again.
  const double w = 0.5;
  const auto at = [&](double v) { return Point(400 * v * (v * v - w * w), 300 * (1 - v * v)); };
  const auto slope = [&](double v) { return Point(400 * (3 * v * v - w * w), -600 * v); };
  const auto part = [&](double from, double to) {
    const double third = (to - from) / 3;
    return std::array{at(from), Point(at(from) + third * slope(from)), Point(at(to) - third * slope(to)), at(to)};
  };
  const auto tail = part(-w, 1.0);
  // The neighbour comes to the node from the left, so that the outline goes through it; or from where it leaves.
  const std::vector<BezierContour> through{
      outline({tail[0], tail[1], tail[2], tail[3], {500, 600}, {-200, 600}}, "nccnnn")};
  const auto found = find_crossings(through);
  REQUIRE_FALSE(found.empty());
  CHECK(std::any_of(found.begin(), found.end(),
                    [&](const Crossing& one) { return (one.where - tail[0]).norm() < 1e-6; }));
  const auto again = find_crossings({reverse(through[0])});
  CHECK(names(again) == names(found));
  // A loop that closes on its own two ends is a place passed twice, unless it is all there is.
  const auto loop = part(-w, w);
  CHECK(is_simple(outline({loop[0], loop[1], loop[2]}, "ncc")));
  const auto ends = find_crossings({outline({loop[0], loop[1], loop[2], loop[3], {-300, 0}, {300, 0}}, "nccnnn")});
  REQUIRE(ends.size() == 1);
  CHECK((ends[0].where - loop[0]).norm() < 1e-9);
}

TEST_CASE("a loop of a millionth of a unit is told from a cusp", "[crossing]") {
  const auto loop = [](double w2) {
    const double k = 400.0;
    return outline({{k * (w2 - 1), 0}, {k * (1 + w2 / 3), 400}, {-k * (1 + w2 / 3), 400}, {k * (1 - w2), 0}, {0, -200}},
                   "nccnn");
  };
  // It is 300 w^2 deep.
  CHECK(meetings({loop(1e-8)}) == "crossing");
  CHECK(meetings({loop(-1e-8)}).empty());
}

TEST_CASE("neighbours that leave their node alike are told apart by how they bend", "[crossing]") {
  // Both go up from the node: apart if the left one bends more to the left, and not if they cross further on.
  const auto drop = [](double left, double right) {
    return outline({{0, 0}, {0, 100}, {right, 200}, {50, 400}, {-50, 400}, {left, 200}, {0, 100}}, "nccnncc");
  };
  CHECK(is_simple(drop(-1, 1)));
  CHECK(is_simple(drop(10, 20)));
  CHECK(is_simple(drop(-20, -10)));
  CHECK(is_simple(drop(0.001, 0.002)));
  CHECK(meetings({drop(1, -1)}) == "crossing");
  CHECK(meetings({drop(20, 10)}) == "crossing");
  CHECK_FALSE(meetings({drop(0.002, 0.001)}).empty());  // for a hundredth of a unit, by a few millionths of a millionth
  // A line and a curve of the third order, on either side.
  for (const double side : {-100.0, 100.0}) {
    CHECK(is_simple(outline({{0, 0}, {0, 300}, {side, 300}, {0, 200}, {0, 100}}, "nnncc")));
  }
  // A handle of no length: its curve leaves with infinite curvature.
  CHECK(is_simple(outline({{0, 0}, {0, 100}, {5, 200}, {50, 400}, {-50, 400}, {0, 100}, {0, 0}}, "nccnncc")));
}

TEST_CASE("ends that are one point or lie on an edge are contacts to the last bit", "[crossing]") {
  const auto place = [](const Place& at) { return std::tuple(at.contour, at.segment, at.u); };
  SECTION("nodes of two contours, curves on both sides") {
    const std::vector<BezierContour> contours{circle({0, 0}, 100), circle({200, 0}, 100)};
    const auto found = find_crossings(contours);
    REQUIRE(names(found) == "contact");
    CHECK(found[0].where == Point(100, 0));
    CHECK(place(found[0].a) == std::tuple(0, 0, 0.0));
    CHECK(place(found[0].b) == std::tuple(1, 2, 0.0));
  }
  SECTION("a corner on an edge, at a place that is no binary fraction of it") {
    const auto found =
        find_crossings({polygon({{0, 0}, {300, 150}, {0, 150}}), polygon({{100, 50}, {200, 0}, {120, 0}})});
    REQUIRE(names(found) == "contact");
    CHECK(found[0].where == Point(100, 50));
    CHECK(found[0].a.u == Approx(1.0 / 3.0).epsilon(1e-15));
    CHECK(place(found[0].b) == std::tuple(1, 0, 0.0));
  }
  SECTION("an extremum of a curve on an edge") {
    const auto found = find_crossings({circle({0, 0}, 100), polygon({{100, -70}, {200, 0}, {100, 80}})});
    REQUIRE(names(found) == "contact");
    CHECK(found[0].where == Point(100, 0));
    CHECK(place(found[0].a) == std::tuple(0, 0, 0.0));
  }
  SECTION("contacts a unit along the contour from each other") {
    // A notch of one unit whose mouth is closed by a point.
    const auto found = find_crossings(
        {polygon({{0, 0}, {100, 0}, {100, 50}, {99.5, 50.5}, {99.5, 51}, {100, 50}, {100, 100}, {0, 100}})});
    REQUIRE(names(found) == "contact");
    CHECK(found[0].where == Point(100, 50));
  }
}

TEST_CASE("a line through the middle of a curve crosses it there, whichever comes first", "[crossing]") {
  // The curve turns back, so that it is cut in its middle, (45, 75), which lies on the line.
  const BezierContour curve = outline({{60, 90}, {60, 30}, {0, 120}, {120, 60}, {200, 300}}, "nccnn");
  const BezierContour line = polygon({{60, 60}, {0, 120}, {-200, -50}});
  for (const auto& contours : {std::vector{curve, line}, std::vector{line, curve}, std::vector{reverse(curve), line},
                               std::vector{line, reverse(curve)}}) {
    const auto found = find_crossings(contours);
    CHECK(std::any_of(found.begin(), found.end(), [](const Crossing& one) {
      return one.meeting == Meeting::Crossing && (one.where - Point(45, 75)).norm() < 1e-9;
    }));
  }
}

TEST_CASE("quadratics that touch or miss by less than any margin are never clear if they meet", "[crossing]") {
  // Two parabolas, the lower one raised by the gap.
  const auto pair = [](double gap) {
    return std::vector<BezierContour>{outline({{0, 200}, {128, -56}, {256, 200}, {128, 400}}, "nqnn"),
                                      outline({{0, gap}, {128, 144 + gap}, {256, gap}, {128, -200}}, "nqnn")};
  };
  CHECK(meetings(pair(0.0)) == "contact");  // at (128, 72)
  for (int k = 1; k < 20; ++k) {
    CAPTURE(k);
    const double gap = std::ldexp(1.0, -k);
    CHECK(meetings(pair(-gap)).empty());
    const auto found = find_crossings(pair(gap));
    CHECK_FALSE(found.empty());
    if (gap > 1e-3) CHECK(names(found) == "crossing crossing");
  }
}

TEST_CASE("displaced outlines cross as often as their fine flattening does", "[crossing]") {
  std::mt19937 random(77);
  std::normal_distribution<double> shake(0.0, 12.0);
  int crossed = 0;
  for (int k = 0; k < 300; ++k) {
    std::vector<BezierContour> contours{circle({0, 0}, 100), reverse(circle({0, 0}, 88)), circle({140, 10}, 45)};
    for (BezierContour& contour : contours) {
      Points points = contour.points();
      for (Eigen::Index i = 0; i < points.size(); ++i) points(i) = std::round(2.0 * (points(i) + shake(random))) / 2.0;
      contour = contour.with_points(points);
    }
    const auto found = find_crossings(contours);
    const auto crossings =
        std::count_if(found.begin(), found.end(), [](const Crossing& one) { return one.meeting == Meeting::Crossing; });
    CAPTURE(k, contours[0].points(), contours[1].points(), contours[2].points());
    CHECK(crossings == count_by_flattening(contours, 600));
    crossed += crossings > 0;
  }
  CHECK(crossed > 100);
}

TEST_CASE("a crossing shorter than one unit is found", "[crossing]") {
  // A spike from the right whose tip ends `depth` units beyond the left edge at x = 0.
  const auto spike = [](double depth) {
    return polygon({{0, 0}, {100, 0}, {100, 49}, {-depth, 50}, {100, 51}, {100, 100}, {0, 100}});
  };
  CHECK(meetings({spike(0.3)}) == "crossing crossing");
  CHECK(is_simple(spike(-0.01)));
  check_one({spike(0.0)}, "contact", {0, 50});

  // Two curves that leave their common corner on the wrong sides and pass each other half a unit further on.
  const auto corner = [](double bulge) {
    return outline({{0, 0}, {50, bulge}, {100, 10}, {100, -10}, {50, -bulge}}, "nqnnq");
  };
  const auto found = find_crossings({corner(-0.025)});
  REQUIRE(names(found) == "crossing");
  CHECK(found[0].where.norm() < 1.0);
  CHECK(found[0].where.norm() > 0.1);
  CHECK(is_simple(corner(0.025)));
}

TEST_CASE("two contours cross where their circles do", "[crossing]") {
  const std::vector<BezierContour> contours{circle({0, 0}, 100), circle({120, 7}, 100)};
  const auto found = find_crossings(contours);
  REQUIRE(names(found) == "crossing crossing");
  for (const Crossing& crossing : found) {
    CHECK(crossing.a.contour == 0);
    CHECK(crossing.b.contour == 1);
    CHECK(crossing.where.norm() == Approx(100).epsilon(3e-4));  // four cubics are a circle to 2.7e-4
    CHECK((point_at(contours, crossing.a) - point_at(contours, crossing.b)).norm() < 1e-9);
  }
}

TEST_CASE("what only touches is a contact, and clean with a hundredth of a unit of air", "[crossing]") {
  SECTION("a curve against a line, at a node and between nodes") {
    check_one({circle({0, 0}, 100), box(100, -50, 200, 50)}, "contact", {100, 0});
    CHECK(meetings({circle({0, 0}, 100), box(100.01, -50, 200, 50)}).empty());
    const BezierContour arch = outline({{0, 0}, {100, 200}, {200, 0}}, "nqn");
    check_one({arch, box(-50, 100, 250, 150)}, "contact", {100, 100});
    CHECK(meetings({arch, box(-50, 100.01, 250, 150)}).empty());
    CHECK(meetings({arch, box(-50, 99.99, 250, 150)}) == "crossing crossing");
    const BezierContour skew = outline({{0, 0}, {70, 200}, {231, 0}}, "nqn");
    check_one({skew, box(-50, 100, 250, 150)}, "contact", {92.75, 100});
  }
  SECTION("a curve against a curve") {
    check_one({circle({0, 0}, 100), circle({200, 0}, 100)}, "contact", {100, 0});
    CHECK(meetings({circle({0, 0}, 100), circle({200.01, 0}, 100)}).empty());
    check_one({circle({0, 0}, 100), circle({60, 0}, 40)}, "contact", {100, 0});
    CHECK(meetings({circle({0, 0}, 100), circle({59.99, 0}, 40)}).empty());
    const BezierContour up = outline({{0, 0}, {80, 200}, {200, 0}}, "nqn");
    const BezierContour down = outline({{10, 200}, {90, 0}, {170, 200}}, "nqn");
    check_one({up, down}, "contact", {90, 100});
  }
  SECTION("a corner against an edge") {
    check_one({box(0, 0, 100, 100), polygon({{100, 30}, {150, 0}, {150, 60}})}, "contact", {100, 30});
    CHECK(meetings({box(0, 0, 100, 100), polygon({{100.01, 30}, {150, 0}, {150, 60}})}).empty());
    check_one({box(0, 0, 100, 100), polygon({{100, 100}, {150, 90}, {150, 160}})}, "contact", {100, 100});
    check_one({circle({0, 0}, 100), polygon({{0, 100}, {-20, 120}, {20, 120}})}, "contact", {0, 100});
    CHECK(meetings({circle({0, 0}, 100), polygon({{0, 100.01}, {-20, 120}, {20, 120}})}).empty());
  }
}

TEST_CASE("a duplicated contour is one overlap, from either start and direction", "[crossing]") {
  const BezierContour round = circle({13, 7}, 100);
  for (const BezierContour& twin : {round, reverse(round), rotate(round, 3), reverse(rotate(round, 6))}) {
    check_one({round, twin}, "overlap", {-87, 7});
  }
  CHECK(meetings({box(0, 0, 9, 9), box(0, 0, 9, 9)}) == "overlap");
  CHECK(meetings({round, circle({13, 7}, 99.99)}).empty());
}

TEST_CASE("curves that run along each other are an overlap however they were cut", "[crossing]") {
  const Bezier whole{{Point(0, 0), Point(31, 200), Point(140, 170), Point(205, 3)}, 3};
  const Bezier part = split(split(whole, 0.3)[1], 0.6)[0];
  const BezierContour low = outline({whole.p[0], whole.p[1], whole.p[2], whole.p[3], {100, -50}}, "nccnn");
  const BezierContour high = outline({part.p[0], part.p[1], part.p[2], part.p[3], {100, 300}}, "nccnn");
  CHECK(meetings({low, high}) == "overlap");
  CHECK(meetings({low, transform(high, {.shift = {0, 0.01}})}).empty());
}

TEST_CASE("shared parts of straight edges are an overlap", "[crossing]") {
  check_one({box(0, 0, 100, 100), box(100, 30, 150, 70)}, "overlap", {100, 30});
  check_one({box(0, 0, 100, 100), box(100, 30, 150, 170)}, "overlap", {100, 30});
  CHECK(meetings({box(0, 0, 100, 100), box(100.01, 30, 150, 70)}).empty());
  // Edges on one line, apart on it, and end to end.
  CHECK(meetings({polygon({{0, 0}, {100, 0}, {50, -50}}), polygon({{101, 0}, {200, 0}, {150, -50}})}).empty());
  check_one({polygon({{0, 0}, {100, 0}, {50, -50}}), polygon({{100, 0}, {200, 0}, {150, -50}})}, "contact", {100, 0});
}

TEST_CASE("a spike out and back is an overlap", "[crossing]") {
  CHECK(meetings({polygon({{0, 0}, {100, 0}, {100, 50}, {170, 50}, {100, 50}, {100, 100}, {0, 100}})}) == "overlap");
  CHECK(meetings({polygon({{0, 0}, {100, 0}, {100, 50}, {170, 50}, {130, 50}, {100, 100}, {0, 100}})}) == "overlap");
  CHECK(meetings({outline({{0, 0}, {100, 0}, {130, 60}, {160, 50}, {130, 60}, {100, 0}, {0, 100}}, "nnqnqnn")}) ==
        "overlap");
  CHECK(is_simple(polygon({{0, 0}, {100, 0}, {100, 49.995}, {170, 50}, {100, 50.005}, {100, 100}, {0, 100}})));
  // A quadratic whose handle lies beyond its end on the same line turns back within one segment.
  CHECK(meetings({outline({{0, 0}, {200, 0}, {100, 0}, {50, 100}}, "nqnn")}) == "overlap");
}

TEST_CASE("a crossing at nodes is told from a contact by the branches round it", "[crossing]") {
  const Point p(50, 50);
  SECTION("two contours with a node each") {
    const BezierContour left = polygon({{0, 0}, p, {0, 100}});
    check_one({left, polygon({{100, 0}, p, {100, 100}})}, "contact", p);
    const auto through =
        find_crossings({polygon({{0, 0}, p, {100, 100}, {0, 100}}), polygon({{100, 0}, p, {0, 100}, {-50, -200}})});
    REQUIRE_FALSE(through.empty());
    CHECK(std::any_of(through.begin(), through.end(), [&](const Crossing& crossing) {
      return crossing.meeting == Meeting::Crossing && crossing.where == p && crossing.a.segment == 1 &&
             crossing.b.segment == 1 && crossing.a.u == 0.0 && crossing.b.u == 0.0;
    }));
  }
  SECTION("a node on an edge") {
    check_one({box(50, 0, 90, 100), polygon({{0, 40}, p, {0, 60}})}, "contact", p);
    const auto found = find_crossings({box(50, 0, 90, 100), polygon({{0, 40}, p, {70, 50}, {0, 60}})});
    REQUIRE(names(found) == "crossing crossing");
    CHECK(std::any_of(found.begin(), found.end(), [&](const Crossing& crossing) { return crossing.where == p; }));
  }
  SECTION("one contour that passes its node twice") {
    check_one({polygon({{0, 0}, p, {100, 100}, {100, 0}, p, {0, 100}})}, "crossing", p);
    check_one({polygon({{0, 0}, p, {0, 100}, {100, 100}, p, {100, 0}})}, "contact", p);
  }
  SECTION("curves") {
    // Four cubics through (0, 0) with four directions.
    check_one({outline({{0, 0}, {200, 100}, {100, 200}, {0, 0}, {-200, -90}, {-90, -200}}, "nccncc")}, "contact",
              {0, 0});
    check_one({outline({{0, 0}, {200, 100}, {-100, 200}, {0, 0}, {90, -200}, {-200, -90}}, "nccncc")}, "crossing",
              {0, 0});
    check_one({outline({{0, 0}, {200, 200}, {200, -200}, {0, 0}, {-200, 210}, {-200, -190}}, "nccncc")}, "crossing",
              {0, 0});
  }
  SECTION("curves that cross in the middle of both") {
    const BezierContour arch = outline({{-100, -50}, {0, 50}, {100, -50}, {0, -150}}, "nqnn");
    const auto found = find_crossings({arch, polygon({{0, -20}, {0, 20}, {300, 20}, {300, -200}})});
    REQUIRE_FALSE(found.empty());
    CHECK(found[0].meeting == Meeting::Crossing);
    CHECK(found[0].where.norm() < 1e-9);
    CHECK(found[0].a.u == Approx(0.5).margin(1e-9));
    CHECK(found[0].b.u == Approx(0.5).margin(1e-9));
  }
}

TEST_CASE("smooth and nested contours are clean", "[crossing]") {
  CHECK(is_simple(circle({0, 0}, 100)));
  CHECK(meetings({circle({0, 0}, 100), circle({0, 0}, 60), circle({0, 0}, 59.9), box(-20, -20, 20, 20)}).empty());
  Points ring(8, 2);
  for (int i = 0; i < 8; ++i) ring.row(i) << std::round(300 * std::cos(i)), std::round(300 * std::sin(i));
  Points even(12, 2);
  for (int i = 0; i < 12; ++i)
    even.row(i) << std::round(300 * std::cos(i * 0.5236)), std::round(300 * std::sin(i * 0.5236));
  CHECK(is_simple(from_quadratic_points(even, std::vector<bool>(12, false))));
  CHECK_FALSE(is_simple(from_quadratic_points(ring, std::vector<bool>(8, false))));
}

TEST_CASE("contours without area and segments without length are passed over", "[crossing]") {
  CHECK(find_crossings({}).empty());
  CHECK(is_simple(polygon({{7, 7}})));
  CHECK(is_simple(polygon({{7, 7}, {7, 7}, {7, 7}})));
  CHECK(meetings({polygon({{7, 7}}), box(0, 0, 7, 7)}).empty());
  CHECK(is_simple(polygon({{0, 0}, {0, 0}, {100, 0}, {100, 0}, {100, 0}, {50, 80}, {0, 0}})));
  CHECK(is_simple(
      outline({{0, 0}, {0, 0}, {0, 0}, {0, 0}, {100, 0}, {100, 0}, {100, 0}, {50, 50}, {0, 100}}, "nccnnqnqn")));
  // Out and back between two points is a stretch run twice, however often.
  CHECK(meetings({polygon({{0, 0}, {100, 30}})}) == "overlap");
  CHECK(meetings({polygon({{0, 0}, {100, 30}, {100, 30}})}) == "overlap");
  CHECK(meetings({polygon({{0, 0}, {100, 30}, {0, 0}, {100, 30}})}) == "overlap");
  CHECK(meetings({outline({{0, 0}, {50, 30}, {100, 0}, {50, 30}}, "nqnq")}) == "overlap");
  CHECK(is_simple(outline({{0, 0}, {50, 30}, {100, 0}}, "nqn")));
}

TEST_CASE("contacts, overlaps and crossings stay what they are when the outline is turned and rounded", "[crossing]") {
  const std::vector<std::pair<std::vector<BezierContour>, std::string>> drawings{
      {{box(0, 0, 100, 100), polygon({{100, 30}, {150, 0}, {150, 60}})}, "contact"},
      {{box(0, 0, 100, 100), box(100, 30, 150, 70)}, "overlap"},
      {{circle({0, 0}, 100), circle({200, 0}, 100)}, "contact"},
      {{circle({0, 0}, 100), circle({0, 0}, 100)}, "overlap"},
      {{polygon({{0, 0}, {50, 50}, {100, 100}, {100, 0}, {50, 50}, {0, 100}})}, "crossing"},
      {{polygon({{0, 0}, {50, 50}, {0, 100}, {100, 100}, {50, 50}, {100, 0}})}, "contact"},
      {{box(50, 0, 90, 100), polygon({{0, 40}, {50, 50}, {70, 50}, {0, 60}})}, "crossing crossing"},
      {{polygon({{0, 0}, {100, 0}, {100, 50}, {170, 50}, {130, 50}, {100, 100}, {0, 100}})}, "overlap"},
      {{outline({{0, 0}, {200, 0}, {100, 0}, {50, 100}}, "nqnn")}, "overlap"},
      {{polygon({{0, 0}, {100, 30}})}, "overlap"},
      {{outline({{0, 0}, {0, 150}, {100, 200}, {100, 300}, {100, 400}, {-100, 400}, {-100, 300}, {-100, 200}, {0, 150}},
                "nccnccncc")},
       ""},
      {{outline({{0, 0}, {0, 300}, {-100, 300}, {0, 200}, {0, 100}}, "nnncc")}, ""},
      {{circle({0, 0}, 100), circle({3, 0}, 90)}, ""}};
  for (int k = 0; k < 40; ++k) {
    const double angle = 0.157 * k;
    Affine turn{.shift = {300.1, -77.7}};
    turn.linear << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
    for (const auto& [contours, expected] : drawings) {
      std::vector<BezierContour> turned;
      for (const BezierContour& contour : contours) turned.push_back(transform(contour, turn));
      CAPTURE(angle, contours[0].points());
      CHECK(meetings(turned) == expected);
    }
  }
}

TEST_CASE("findings do not depend on place, direction, start point or order", "[crossing]") {
  std::mt19937 random(11);
  const auto places = [](const std::vector<BezierContour>& contours) {
    std::vector<std::tuple<Meeting, double, double>> list;
    for (const Crossing& crossing : find_crossings(contours)) {
      list.emplace_back(crossing.meeting, crossing.where.x(), crossing.where.y());
    }
    std::sort(list.begin(), list.end());
    return list;
  };
  std::vector<std::vector<BezierContour>> drawings{
      {circle({0, 0}, 100), circle({200, 0}, 100), box(-100, -100, 100, 100)},
      {polygon({{0, 0}, {100, 0}, {100, 50}, {170, 50}, {100, 50}, {100, 100}, {0, 100}}), box(50, 50, 100, 100)}};
  for (int k = 0; k < 60; ++k) {
    drawings.push_back({random_contour(random, 2 + k % 5, k % 4), random_contour(random, 3, (k + 1) % 4)});
  }
  for (const auto& drawing : drawings) {
    const auto expected = places(drawing);
    const auto check = [&](const std::vector<BezierContour>& changed, Point shift) {
      const auto got = places(changed);
      REQUIRE(got.size() == expected.size());
      for (std::size_t k = 0; k < got.size(); ++k) {
        const auto& [meeting, x, y] = got[k];
        CHECK(meeting == std::get<0>(expected[k]));
        CHECK(x - shift.x() == Approx(std::get<1>(expected[k])).margin(1e-6));
        CHECK(y - shift.y() == Approx(std::get<2>(expected[k])).margin(1e-6));
      }
    };
    std::vector<BezierContour> moved, reversed, rotated, swapped(drawing.rbegin(), drawing.rend());
    for (const BezierContour& contour : drawing) {
      moved.push_back(transform(contour, {.shift = {1000, -77}}));
      reversed.push_back(reverse(contour));
      rotated.push_back(rotate(contour, contour.point_count() / 2));
    }
    check(moved, {1000, -77});
    check(reversed, {0, 0});
    check(rotated, {0, 0});
    check(swapped, {0, 0});
  }
}

TEST_CASE("random contours cross as often as their fine flattening does", "[crossing]") {
  std::mt19937 random(2024);
  int sum = 0;
  for (int k = 0; k < 400; ++k) {
    const int degree = k % 4;
    const std::vector<BezierContour> contours{random_contour(random, 2 + k % 7, degree),
                                              random_contour(random, 3 + k % 5, (degree + k / 4) % 4)};
    const auto found = find_crossings(contours);
    const auto crossings = std::count_if(
        found.begin(), found.end(), [](const Crossing& crossing) { return crossing.meeting == Meeting::Crossing; });
    const auto between = std::count_if(found.begin(), found.end(), [](const Crossing& crossing) {
      return crossing.meeting == Meeting::Crossing && crossing.a.contour != crossing.b.contour;
    });
    CAPTURE(k, contours[0].points(), contours[1].points());
    CHECK(crossings == count_by_flattening(contours, 400));
    CHECK(between % 2 == 0);  // closed curves
    for (const Crossing& crossing : found) {
      CHECK((point_at(contours, crossing.a) - point_at(contours, crossing.b)).norm() < 1e-8);
    }
    sum += static_cast<int>(crossings);
  }
  CHECK(sum > 4000);
}

TEST_CASE("findings come in order and the same every time", "[crossing]") {
  std::mt19937 random(5);
  const std::vector<BezierContour> contours{random_contour(random, 12, 0), random_contour(random, 12, 0)};
  const auto found = find_crossings(contours);
  const auto again = find_crossings(contours);
  REQUIRE(found.size() > 10);
  const auto key = [](const Crossing& x) {
    return std::tuple(x.a.contour, x.a.segment, x.a.u, x.b.contour, x.b.segment, x.b.u);
  };
  for (std::size_t k = 0; k < found.size(); ++k) {
    CHECK(key(found[k]) == key(again[k]));
    CHECK(std::tuple(found[k].a.contour, found[k].a.segment, found[k].a.u) <
          std::tuple(found[k].b.contour, found[k].b.segment, found[k].b.u));
    if (k > 0) CHECK(key(found[k - 1]) < key(found[k]));
  }
}

TEST_CASE("an edit is judged by the crossings it adds to each pair of contours", "[crossing]") {
  const auto crossing = [](int a, int b) {
    return Crossing{Meeting::Crossing, Point::Zero(), {a, 0, 0.5}, {b, 1, 0.5}};
  };
  const std::vector<Crossing> before{crossing(0, 0), crossing(0, 1), crossing(0, 1)};
  CHECK(added_crossings(before, before) == 0);
  CHECK(added_crossings(before, {}) == 0);
  CHECK(added_crossings({}, before) == 3);
  CHECK(added_crossings(before, {crossing(0, 0), crossing(1, 1)}) == 1);
  CHECK(added_crossings(before, {crossing(0, 0), crossing(0, 0), crossing(0, 1)}) == 1);
}

TEST_CASE("an outline made to exhaust the check is given up, not searched for ever", "[crossing]") {
  const std::vector<BezierContour> pile(3000, shapes::square(500));
  CHECK_THROWS_AS(find_crossings(pile), fontcore::WorkLimitExceeded);
  const auto large = [](double size) {
    return outline({{0, 0}, {size, size}, {-size, size}, {size / 8, 0}, {0, -size}}, "nccnn");
  };
  CHECK(meetings({large(1e150)}) == "crossing");
  CHECK_THROWS_AS(find_crossings({large(1e300)}), fontcore::WorkLimitExceeded);
}

TEST_CASE("a contact distance that is not positive is refused", "[crossing]") {
  CHECK_THROWS_AS(find_crossings({}, {.contact_distance = 0.0}), InvalidInput);
  CHECK_THROWS_AS(find_crossings({}, {.contact_distance = std::numeric_limits<double>::quiet_NaN()}), InvalidInput);
}
