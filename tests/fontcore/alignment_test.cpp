#include "fontcore/alignment.h"

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

using Shape = std::vector<BezierContour>;

BezierContour box(double low, double high) { return shapes::polygon({{0, low}, {300, low}, {300, high}, {0, high}}); }

// Centred on x = 300, with extrema at the heights given.
BezierContour bowl(double low, double high, double width) {
  Affine map;
  map.linear << width / 200.0, 0, 0, (high - low) / 200.0;
  map.shift << 300, 0.5 * (low + high);
  return transform(shapes::circle(100), map);
}

// An n: feet at 0, a round shoulder, and the inside of its arch at 420, which is no end of the ink.
BezierContour letter_n(double top) {
  return from_quadratic_points(
      shapes::points_of({{0, 0},
                         {80, 0},
                         {80, 300},
                         {80, 420},
                         {200, 420},
                         {320, 420},
                         {320, 300},
                         {320, 0},
                         {400, 0},
                         {400, 300},
                         {400, top},
                         {220, top},
                         {0, top},
                         {0, 300}}),
      {true, true, true, false, true, false, true, true, true, true, false, true, false, true});
}

// Capitals, round capitals, small letters and round small letters of a made face.
std::vector<Shape> face() {
  return {{box(0, 700)},
          {box(0, 700)},
          {box(0, 701)},
          {bowl(-12, 712, 600), reverse(bowl(70, 630, 440))},
          {bowl(-12, 712, 580), reverse(bowl(70, 630, 420))},
          {box(0, 500)},
          {box(0, 500)},
          {letter_n(510)},
          {letter_n(510)},
          {bowl(-10, 510, 500), reverse(bowl(60, 440, 360))},
          {box(-200, 500)},
          {box(-200, 500)},
          {box(130, 333)}};  // a hyphen: nobody shares its heights
}

std::vector<Shape> mapped(std::vector<Shape> shapes, const Affine& map) {
  for (Shape& shape : shapes) {
    for (BezierContour& contour : shape) contour = transform(contour, map);
  }
  return shapes;
}

}  // namespace

TEST_CASE("alignment zones are the heights that flat and round features share", "[alignment]") {
  const std::vector<AlignmentZone> zones = find_zones(face(), 1000.0);
  REQUIRE(zones.size() == 4);
  const auto check = [](const AlignmentZone& zone, double flat, double overshoot, bool is_top) {
    CHECK(zone.flat == flat);
    CHECK(zone.overshoot == Approx(overshoot).margin(1e-9));
    CHECK(zone.is_top == is_top);
  };
  check(zones[0], -200, -200, false);
  check(zones[1], 0, -12, false);
  check(zones[2], 500, 510, true);
  check(zones[3], 700, 712, true);
  CHECK(zones[0].flat_count == 2);
  CHECK(zones[0].round_count == 0);
  CHECK(zones[1].flat_count == 7);
  CHECK(zones[1].round_count == 3);
  CHECK(zones[3].flat_count == 3);
  CHECK(zones[3].round_count == 2);
  CHECK(heights(zones).size() == 7);
}

TEST_CASE("alignment zones do not depend on the direction of contours, and grow with the em", "[alignment]") {
  std::vector<Shape> backwards = face();
  for (Shape& shape : backwards) {
    for (BezierContour& contour : shape) contour = reverse(contour);
  }
  Affine twice;
  twice.linear *= 2.0;
  const std::vector<AlignmentZone> zones = find_zones(face(), 1000.0);
  const std::vector<AlignmentZone> other = find_zones(backwards, 1000.0);
  const std::vector<AlignmentZone> large = find_zones(mapped(face(), twice), 2000.0);
  REQUIRE(zones.size() == other.size());
  REQUIRE(zones.size() == large.size());
  for (std::size_t k = 0; k < zones.size(); ++k) {
    CHECK(zones[k].flat == other[k].flat);
    CHECK(zones[k].overshoot == Approx(other[k].overshoot).margin(1e-9));
    CHECK(zones[k].flat_count == other[k].flat_count);
    CHECK(zones[k].round_count == other[k].round_count);
    CHECK(large[k].flat == 2.0 * zones[k].flat);
    CHECK(large[k].overshoot == Approx(2.0 * zones[k].overshoot).margin(1e-9));
  }
}

TEST_CASE("round letters alone have zones at their own heights, and nothing has none", "[alignment]") {
  const std::vector<Shape> round = {{bowl(-10, 510, 500)}, {bowl(-10, 510, 400)}};
  const std::vector<AlignmentZone> zones = find_zones(round, 1000.0);
  REQUIRE(zones.size() == 2);
  CHECK(zones[0].flat == zones[0].overshoot);
  CHECK(zones[0].overshoot == Approx(-10.0));
  CHECK(zones[1].flat_count == 0);
  CHECK(find_zones({}, 1000.0).empty());
  CHECK_THROWS_WITH(find_zones({}, 0.0), "find_zones: 0 units to the em");
}
