// [HBS05] figure 6: local control. One of 16 control points of a spline of 128 is dragged; the area is given back by
// 1, 2 and 5 neighbours on either side, and nothing beyond them moves. Blue as it was, green as asked for, red with the
// area kept.

#include <array>
#include <cmath>
#include <numbers>

#include "fontcore/drag.h"
#include "tools/examples/svg.h"

using namespace fontcore;

int main() {
  constexpr int size = 128;
  constexpr int level = 2;  // 16 control points: the paper's L = 4 of n = 7
  Points initial(size, 2);
  for (int i = 0; i < size; ++i) {
    const double a = 2.0 * std::numbers::pi * i / size;
    const double radius = 300.0 + 40.0 * std::cos(2.0 * a) + 6.0 * std::sin(31.0 * a);
    initial.row(i) << radius * std::cos(a), radius * std::sin(a);
  }
  const int finest = most_levels(Scheme::Chaikin, size);
  const DragHandle handle{
      .t = finer_parameter(4, finest - level), .hold = DragHandle::Hold::Pinned, .grip = Grip::ControlPoint};
  const std::array move = {Point(30, 190)};
  const auto polygon = [&](const Points& points) { return from_level(decompose(points, finest), level).coarse; };
  DragSolver freely(initial, {handle}, {.level = level, .neighbours = 0, .area = AnyValue{}});
  freely.move(move);

  Picture picture;
  for (const int neighbours : {1, 2, 5}) {
    DragSolver solver(initial, {handle}, {.level = level, .neighbours = neighbours});
    solver.move(move);
    if (neighbours > 1) picture.next_panel(900.0);
    picture.spline(initial, "blue");
    picture.spline(freely.control_points(), "green");
    picture.polygon(polygon(solver.control_points()), "red");
    picture.spline(solver.control_points(), "red");
  }
  picture.print();
}
