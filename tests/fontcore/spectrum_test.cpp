#include "fontcore/spectrum.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr double finest = 8.0;

/// A bar of 800 by 100 units whose top is a saw, as much above its edge as below.
BezierContour saw(double width, double height) {
  std::vector<Point> corners{{0, 0}, {800, 0}, {800, 100}};
  double side = 0.5 * height;
  for (double x = 800 - width; x >= width; x -= width, side = -side) corners.push_back({x, 100 + side});
  corners.push_back({0, 100});
  return shapes::polygon(corners);
}

void check_equal(const std::array<double, octave_count>& a, const std::array<double, octave_count>& b) {
  for (std::size_t k = 0; k < octave_count; ++k) CHECK(a[k] == Approx(b[k]).epsilon(1e-9));
}

}  // namespace

TEST_CASE("octaves do not depend on place, order, direction or start", "[spectrum]") {
  const std::vector<BezierContour> letter = shapes::letter_a();
  const auto energies = octave_energies(letter, finest);
  std::vector<BezierContour> other;
  for (const BezierContour& contour : letter) {
    const BezierContour there = transform(reverse(contour), {.shift = Point(1000, -500)});
    // From half way round.
    const int n = static_cast<int>(there.point_count());
    int from = n / 2;
    while (there.kind(from) != PointKind::Node) from = (from + 1) % n;
    Points points(n, 2);
    std::vector<PointKind> kinds;
    for (int i = 0; i < n; ++i) {
      points.row(i) = there.points().row((from + i) % n);
      kinds.push_back(there.kind((from + i) % n));
    }
    other.insert(other.begin(), BezierContour(points, kinds));
  }
  check_equal(octave_energies(other, finest), energies);
}

TEST_CASE("octaves grow with the outline as a length to the third", "[spectrum]") {
  const auto energies = octave_energies(shapes::letter_a(), finest);
  std::vector<BezierContour> twice;
  for (const BezierContour& contour : shapes::letter_a())
    twice.push_back(transform(contour, {.linear = 2.0 * Eigen::Matrix2d::Identity()}));
  auto larger = octave_energies(twice, 2.0 * finest);
  for (double& energy : larger) energy /= 8.0;
  check_equal(larger, energies);
}

TEST_CASE("features add energy to the octaves of their size", "[spectrum]") {
  const auto plain = octave_energies({shapes::polygon({{0, 0}, {800, 0}, {800, 100}, {0, 100}})}, finest);
  for (const int octave : {1, 2}) {
    // A tooth is as wide as the longest features of the octave: half of it there, half in the next.
    auto gained = octave_energies({saw(std::ldexp(finest, octave), 8.0)}, finest);
    for (std::size_t k = 0; k < octave_count; ++k) gained[k] -= plain[k];
    const auto most = std::max_element(gained.begin(), gained.end()) - gained.begin();
    CAPTURE(octave, gained);
    CHECK((most == octave || most == octave + 1));
  }
}

TEST_CASE("a finest feature of no size is refused, and an endless outline costs no more than a long one",
          "[spectrum]") {
  CHECK_THROWS_AS(octave_energies({shapes::square(100)}, 0.0), InvalidInput);
  CHECK_THROWS_AS(octave_energies({shapes::square(100)}, std::nan("")), InvalidInput);
  CHECK(octave_energies({shapes::square(1e6)}, 1e-6)[0] > 0.0);
  const auto nothing = octave_energies({}, finest);
  CHECK(std::accumulate(nothing.begin(), nothing.end(), 0.0) == 0.0);
}
