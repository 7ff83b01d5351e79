// [HBS05] figure 5: what alpha does. A spline of 32 control points is dragged by one of the 8 of a coarser level; the
// area is given back by all coefficients, details too. Blue as it was, green as asked for, red with the area kept, for
// alpha = 1 (smooth) and alpha = 100 (faithful).

#include <array>
#include <cmath>
#include <numbers>

#include "fontcore/drag.h"
#include "tools/examples/svg.h"

using namespace fontcore;

int main() {
  constexpr int size = 32;
  constexpr int level = 1;  // 8 control points; the paper counts from 1, so that this is its L = 3 of n = 5
  Points initial(size, 2);
  for (int i = 0; i < size; ++i) {
    const double a = 2.0 * std::numbers::pi * i / size;
    const double radius = 260.0 + 50.0 * std::cos(3.0 * a) + 14.0 * std::sin(8.0 * a);
    initial.row(i) << 1.2 * radius * std::cos(a), radius * std::sin(a);
  }
  const int finest = most_levels(Scheme::Chaikin, size);
  const DragHandle handle{.t = finer_parameter(2, finest - level), .grip = Grip::ControlPoint};
  const auto drag = [&](double alpha, const Target& area) {
    DragSolver solver(initial, {handle},
                      {.level = level,
                       .alpha = alpha,
                       .smoothness = DragOptions::Smoothness::Curve,
                       .details = DragOptions::Details::Free,
                       .insistence = 0.0,
                       .area = area});
    solver.move(std::array{Point(60, 260)});
    return solver.commit();
  };
  const auto polygon = [&](const Points& points) { return from_level(decompose(points, finest), level).coarse; };

  Picture picture;
  const Points deformed = drag(1e12, AnyValue{});  // as good as not smoothed
  picture.polygon(polygon(initial), "blue");
  picture.spline(initial, "blue");
  picture.next_panel(900.0);
  picture.polygon(polygon(deformed), "green");
  picture.spline(deformed, "green");
  for (const double alpha : {1.0, 100.0}) {
    const Points kept = drag(alpha, KeptValue{});
    picture.next_panel(900.0);
    picture.spline(initial, "blue");
    picture.spline(deformed, "green");
    picture.polygon(polygon(kept), "red");
    picture.spline(kept, "red");
  }
  picture.print();
}
