#include "fontcore/place.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr double em = 1000.0;

/// An I with bracketed serifs, counter-clockwise; below they are 100 to the left and 130 and `longer` to the right, and
/// above the same seen in a level mirror.
BezierContour letter_i(double longer = 0.0) {
  const auto N = PointKind::Node;
  const auto C = PointKind::Cubic;
  const double right = 330 + longer;
  return {shapes::points_of({{0, 0},       {110, 0},   {220, 0},   {right, 0}, {right, 30}, {250, 40},
                             {200, 80},    {200, 160}, {200, 540}, {200, 620}, {250, 660},  {right, 670},
                             {right, 700}, {0, 700},   {0, 670},   {70, 660},  {100, 620},  {100, 540},
                             {100, 160},   {100, 80},  {70, 40},   {0, 30}}),
          {N, C, C, N, N, C, C, N, N, C, C, N, N, N, N, C, C, N, N, C, C, N}};
}

/// Its foot with a longer right end, a heavier bracket and a cup below.
BezierContour edited_i(const BezierContour& plain) {
  Points points = plain.points();
  points.row(1) += Eigen::RowVector2d(0, 12);
  points.row(2) += Eigen::RowVector2d(0, 15);
  points.row(3) += Eigen::RowVector2d(18, 0);
  points.row(4) += Eigen::RowVector2d(18, 6);
  points.row(5) += Eigen::RowVector2d(10, 8);
  return plain.with_points(points);
}

BezierContour moved(const BezierContour& contour, double angle, double size, const Point& by, bool mirror = false) {
  Affine map;
  map.linear << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  map.linear *= size;
  if (mirror) map.linear.col(0) *= -1.0;
  map.shift = by;
  const BezierContour image = transform(contour, map);
  return mirror ? reverse(image) : image;
}

OutlineArcs::Location at(const BezierContour& contour, const Point& place) {
  const NearestPoint nearest = nearest_point(contour, place);
  return {nearest.segment, nearest.u};
}

/// The foot's edit, from the middle of the stem round to its other side.
PlacedDetail foot(InkSide ink = InkSide::Left) {
  const BezierContour plain = ink == InkSide::Left ? letter_i() : reverse(letter_i());
  const BezierContour edited = ink == InkSide::Left ? edited_i(letter_i()) : reverse(edited_i(letter_i()));
  const Point left(100, 350);
  const Point right(200, 350);
  const bool is_left = ink == InkSide::Left;
  return learn_place(OutlineArcs(plain), OutlineArcs(edited), at(plain, is_left ? left : right),
                     at(plain, is_left ? right : left), em, ink);
}

std::vector<MatchingPlace> places_in(const BezierContour& contour, const PlaceOptions& options = {}) {
  return find_places({OutlineArcs(contour)}, foot(), options);
}

/// Largest distance at the same places of two outlines of one structure.
double largest_difference(const BezierContour& a, const BezierContour& b) {
  double off = 0.0;
  for (int s = 0; s < a.segment_count(); ++s) {
    for (double u = 0.0; u <= 1.0; u += 1.0 / 64) {
      off = std::max(off, (evaluate(a.segment(s), u) - evaluate(b.segment(s), u)).norm());
    }
  }
  return off;
}

}  // namespace

TEST_CASE("a foot is learnt with its corners, and nothing of the edit is lost", "[place]") {
  const PlacedDetail detail = foot();
  CHECK(detail.corners.size() == 4);
  CHECK(detail.faded == 0.0);
  CHECK(detail.displacement.row(0).isZero(0.0));
  CHECK(detail.displacement.bottomRows(1).isZero(0.0));
  CHECK(detail.displacement.rowwise().norm().maxCoeff() == Approx(std::hypot(18, 6) / em));
  // The same from an outline that runs the other way.
  const PlacedDetail other = foot(InkSide::Right);
  REQUIRE(other.along.size() == detail.along.size());
  CHECK(shapes::largest_distance(other.path, detail.path) < 1e-9);
  CHECK(shapes::largest_distance(other.displacement, detail.displacement) < 1e-9);
}

TEST_CASE("applied where it was learnt the edit comes out as it was made", "[place]") {
  const BezierContour plain = letter_i();
  const OutlineArcs outline(plain);
  const std::vector<MatchingPlace> places = places_in(plain);
  REQUIRE(places.size() == 1);
  CHECK(places[0].distance < 1e-9);
  CHECK_FALSE(places[0].is_mirrored);
  const BezierContour again = add_at_places(outline, foot(), places).contour;
  CHECK(largest_difference(again, edited_i(plain)) < 0.1e-3 * em);
  // What no displacement reaches keeps its bits: the stems and all above them.
  for (int i = 7; i <= 19; ++i) CHECK(again.point(i) == plain.point(i));
}

TEST_CASE("a detail of nothing changes nothing, wherever it is put", "[place]") {
  const BezierContour plain = letter_i();
  const OutlineArcs outline(plain);
  const PlacedDetail nothing =
      learn_place(outline, outline, at(plain, {100, 350}), at(plain, {200, 350}), em, InkSide::Left);
  const auto places = find_places({outline}, nothing);
  REQUIRE(places.size() == 1);
  StructureEdit edit;
  edit.area = 1.0;
  CHECK(add_at_places(outline, nothing, places, {}, edit).contour == plain);
  CHECK(add_at_places(outline, foot(), {}, {}, edit).contour == plain);
}

TEST_CASE("a detail is found wherever its stretch stands, whichever way the outline runs", "[place]") {
  for (const double x : {-700.0, 0.0, 413.5}) {
    const BezierContour shifted = moved(letter_i(), 0, 1, {x, 3 * x});
    REQUIRE(places_in(shifted).size() == 1);
    CHECK(places_in(shifted)[0].distance < 1e-9);
    const BezierContour reversed = reverse(shifted);
    const auto places = find_places({OutlineArcs(reversed)}, foot(), {.ink = InkSide::Right});
    REQUIRE(places.size() == 1);
    CHECK(places[0].distance < 1e-9);
    const BezierContour changed = add_at_places(OutlineArcs(reversed), foot(), places, {.ink = InkSide::Right}).contour;
    CHECK(largest_difference(changed, reverse(moved(edited_i(letter_i()), 0, 1, {x, 3 * x}))) < 0.1e-3 * em);
  }
}

TEST_CASE("mirrored, turned and grown stretches are found if that is asked, and changed alike", "[place]") {
  const BezierContour mirrored = moved(letter_i(), 0, 1, {0, 0}, true);
  CHECK(places_in(mirrored, {.mirrors = false}).empty());
  const auto left = places_in(mirrored);
  REQUIRE(left.size() == 1);
  CHECK(left[0].is_mirrored);
  CHECK(largest_difference(add_at_places(OutlineArcs(mirrored), foot(), left).contour,
                           moved(edited_i(letter_i()), 0, 1, {0, 0}, true)) < 0.1e-3 * em);

  // Turned there is the foot itself, and the head as its mirror image upside down.
  const BezierContour leaning = moved(letter_i(), 0.3, 1, {50, 0});
  CHECK(places_in(leaning).empty());
  const auto turned = places_in(leaning, {.turns = true});
  REQUIRE(turned.size() == 2);
  CHECK(turned[0].angle == Approx(0.3));
  CHECK_FALSE(turned[0].is_mirrored);
  CHECK(turned[1].is_mirrored);
  CHECK(std::abs(std::remainder(turned[1].angle - 0.3 - std::numbers::pi, 2 * std::numbers::pi)) < 1e-9);
  StructureEdit free;
  free.rules.extrema = false;
  CHECK(largest_difference(add_at_places(OutlineArcs(leaning), foot(), {turned[0]}, {.turns = true}, free).contour,
                           moved(edited_i(letter_i()), 0.3, 1, {50, 0})) < 0.1e-3 * em);

  const BezierContour small = moved(letter_i(), 0, 0.8, {0, 0});
  CHECK(places_in(small).empty());
  const PlaceOptions sizes{.smallest = 0.7, .largest = 1.2};
  const auto grown = places_in(small, sizes);
  REQUIRE(grown.size() == 1);
  CHECK(grown[0].size == Approx(0.8));
  CHECK(largest_difference(add_at_places(OutlineArcs(small), foot(), grown, sizes).contour,
                           moved(edited_i(letter_i()), 0, 0.8, {0, 0})) < 0.1e-3 * em);
}

TEST_CASE("what made places differ stays: both feet change alike", "[place]") {
  const BezierContour plain = letter_i();
  for (const double longer : {-12.0, 3.0, 9.0}) {
    const BezierContour other = letter_i(longer);
    CHECK(places_in(other, {.tolerance = 0.05 * std::abs(longer)}).empty());
    const auto places = places_in(other, {.tolerance = 12});
    REQUIRE(places.size() == 1);
    const BezierContour changed = add_at_places(OutlineArcs(other), foot(), places).contour;
    const Points before = other.points() - plain.points();
    const Points after = changed.points() - edited_i(plain).points();
    for (const int node : {0, 3, 4, 7, 18, 21}) CHECK((after.row(node) - before.row(node)).norm() < 0.5e-3 * em);
  }
}

TEST_CASE("a stretch without corners is found along smooth outlines", "[place]") {
  // A blob with one flat side, and its copy beside it.
  const BezierContour blob{
      shapes::points_of({{300, 0},
                         {300, 180},
                         {160, 300},
                         {0, 300},
                         {-200, 300},
                         {-220, 150},
                         {-220, 0},
                         {-220, -150},
                         {-150, -200},
                         {0, -200},
                         {160, -200},
                         {300, -140}}),
      {PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic,
       PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Cubic, PointKind::Cubic}};
  Points points = blob.points();
  points.row(3) += Eigen::RowVector2d(0, 10);
  points.row(2) += Eigen::RowVector2d(0, 10);
  points.row(4) += Eigen::RowVector2d(0, 10);
  const OutlineArcs plain(blob);
  const PlacedDetail detail =
      learn_place(plain, OutlineArcs(blob.with_points(points)), {0, 0.0}, {2, 0.0}, em, InkSide::Left);
  CHECK(detail.corners.empty());
  const BezierContour copy = moved(blob, 0, 1, {900, 40});
  const auto places = find_places({plain, OutlineArcs(copy)}, detail, {.mirrors = false});
  REQUIRE(places.size() == 2);
  for (const MatchingPlace& place : places) {
    CHECK(place.distance < 0.2);
    CHECK(std::abs(std::remainder(place.start, plain.length())) < 0.5);
  }
}

TEST_CASE("a detail learnt from an outline of other structure is put on by arc length", "[place]") {
  const BezierContour plain = letter_i();
  // The same edit, its bottom in two pieces.
  const BezierContour edited = edited_i(plain);
  const auto halves = split(edited.segment(0), 0.5);
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  for (const Bezier& half : halves) {
    for (std::size_t k = 0; k < 3; ++k) {
      points.push_back(half.p[k]);
      kinds.push_back(k == 0 ? PointKind::Node : PointKind::Cubic);
    }
  }
  for (int i = 3; i < static_cast<int>(edited.point_count()); ++i) {
    points.push_back(edited.point(i));
    kinds.push_back(edited.kind(i));
  }
  const BezierContour cut(shapes::points_of(points), kinds);
  const PlacedDetail detail = learn_place(OutlineArcs(plain), OutlineArcs(cut), at(plain, {100, 350}),
                                          at(plain, {200, 350}), em, InkSide::Left);
  const OutlineArcs outline(plain);
  const Wish wish = wish_of_places(outline, detail, find_places({outline}, detail));
  for (int segment = 0; segment < plain.segment_count(); ++segment) {
    for (double u = 0.0; u <= 1.0; u += 1.0 / 16) {
      const Point there = evaluate(plain.segment(segment), u) + wish(segment, u, outline.along(segment).at(u));
      CHECK(nearest_point(edited, there).distance < 0.25e-3 * em);
    }
  }
}

TEST_CASE("places that cannot be learnt or looked for are refused", "[place]") {
  const OutlineArcs outline(letter_i());
  CHECK_THROWS_AS(learn_place(outline, outline, {0, 0.5}, {0, 0.5}, em, InkSide::Left), InvalidInput);
  CHECK_THROWS_AS(learn_place(outline, outline, {0, 0.5}, {1, 0.5}, 0, InkSide::Left), InvalidInput);
  CHECK_THROWS_AS(find_places({outline}, PlacedDetail{}), InvalidInput);
  CHECK_THROWS_AS(find_places({outline}, foot(), {.tolerance = 0}), InvalidInput);
  CHECK_THROWS_AS(find_places({outline}, foot(), {.smallest = 2, .largest = 1}), InvalidInput);
}
