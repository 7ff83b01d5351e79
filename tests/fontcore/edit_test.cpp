#include "fontcore/edit.h"

#include "fontcore/error.h"
#include "fontcore/wavelet.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

const OutlineCurve& specimen() {
  static const OutlineCurve curve(shapes::letter_a()[0], {.tolerance = 0.5});
  return curve;
}

}  // namespace

TEST_CASE("the handle gets its move exactly, at every breadth", "[edit]") {
  for (double breadth = 20.0; breadth < 6000.0; breadth *= 1.17) {
    for (const double t : {0.0, 7.3, 31.5, 60.25}) {
      const Sweep s = sweep(specimen(), t, Point(24, -10), breadth);
      CHECK((evaluate_spline(s.field, t).transpose() - Point(24, -10)).norm() < 1e-12);
    }
  }
}

TEST_CASE("a sweep has no wavelet detail finer than its level", "[edit]") {
  const int finest = specimen().levels();
  for (double breadth = 20.0; breadth < 6000.0; breadth *= 1.17) {
    const Sweep s = sweep(specimen(), 12.4, Point(24, -10), breadth);
    CHECK(s.level >= 0.0);
    CHECK(s.level <= finest);
    const MultiresCurve curve = decompose(s.field, finest);
    for (int level = static_cast<int>(std::ceil(s.level)); level < finest; ++level) {
      CHECK(curve.details[static_cast<std::size_t>(level)].cwiseAbs().maxCoeff() < 1e-12 * std::pow(1.25, finest) * 24);
    }
  }
}

TEST_CASE("a broader sweep has a lower level, and the field changes continuously with the breadth", "[edit]") {
  double before_level = 100.0;
  Points before;
  for (double breadth = 30.0; breadth < 5000.0; breadth *= 1.002) {
    const Sweep s = sweep(specimen(), 12.4, Point(1, 0), breadth);
    CHECK(s.level <= before_level + 1e-12);
    if (before.rows() > 0) CHECK(shapes::largest_distance(s.field, before) < 0.05);
    before_level = s.level;
    before = s.field;
  }
}

TEST_CASE("an integer level moves just the length it is asked for, and nothing beyond", "[edit]") {
  const double t = 12.4;
  for (int down = 0; down < specimen().levels() - 2; ++down) {
    const double breadth = breadth_of_level(specimen(), t, down);
    const Sweep s = sweep(specimen(), t, Point(1, 0), breadth);
    CHECK(s.level == Approx(specimen().levels() - down));
    double first = 0.0;
    double last = 0.0;
    for (double x = t - 0.5 * specimen().size(); x < t + 0.5 * specimen().size(); x += 0.01) {
      if (evaluate_spline(s.field, x).norm() == 0.0) continue;
      if (first == 0.0) first = x;
      last = x;
    }
    CHECK(specimen().arc_length(first, last) <= breadth + 1e-9);
    CHECK(specimen().arc_length(first, last) > 0.9 * breadth);
  }
}

TEST_CASE("both members of a corner pair move alike, by the field's value at the corner", "[edit]") {
  const Sweep s = sweep(specimen(), 12.4, Point(24, -10), 700.0);
  const Points field = respect_corners(specimen(), s.field);
  CHECK_FALSE(specimen().corner_pairs().empty());
  for (const int i : specimen().corner_pairs()) {
    const int next = (i + 1) % specimen().size();
    CHECK(field.row(i) == field.row(next));
    CHECK((field.row(i) - evaluate_spline(s.field, i + 0.5)).norm() < 1e-12);
  }
}

TEST_CASE("a breadth that is not positive is refused", "[edit]") {
  CHECK_THROWS_AS(sweep(specimen(), 1.0, Point(1, 0), 0.0), InvalidInput);
  CHECK_THROWS_AS(sweep(specimen(), 1.0, Point(1, 0), std::numeric_limits<double>::quiet_NaN()), InvalidInput);
}
