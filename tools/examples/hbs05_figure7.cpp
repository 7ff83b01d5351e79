// [HBS05] figure 7: a curve with much detail is dragged by one of the 4 control points of its coarsest level, and its
// two direct neighbours alone give back the area: the sweep changes, every detail stays. Blue as it was, green as asked
// for, red with the area kept.

#include <array>
#include <cmath>
#include <numbers>

#include "fontcore/drag.h"
#include "tools/examples/svg.h"

using namespace fontcore;

int main() {
  constexpr int size = 128;
  constexpr int level = 0;  // 4 control points: the paper's L = 2 of n = 7
  Points initial(size, 2);
  for (int i = 0; i < size; ++i) {
    const double a = 2.0 * std::numbers::pi * i / size;
    const double radius = 260.0 + 18.0 * std::sin(17.0 * a) + 10.0 * std::cos(40.0 * a);
    initial.row(i) << 1.3 * radius * std::cos(a), radius * std::sin(a);
  }
  const int finest = most_levels(Scheme::Chaikin, size);
  const DragHandle handle{
      .t = finer_parameter(1, finest - level), .hold = DragHandle::Hold::Pinned, .grip = Grip::ControlPoint};
  const std::array move = {Point(0, 260)};
  DragSolver freely(initial, {handle}, {.level = level, .neighbours = 0, .area = AnyValue{}});
  freely.move(move);
  DragSolver solver(initial, {handle}, {.level = level, .neighbours = 1});
  solver.move(move);

  Picture picture;
  const std::array<std::pair<const Points*, const char*>, 3> curves = {
      {{&initial, "blue"}, {&freely.control_points(), "green"}, {&solver.control_points(), "red"}}};
  for (const auto& [points, colour] : curves) {
    picture.polygon(decompose(*points, finest).coarse, colour);
    picture.spline(*points, colour);
  }
  picture.print();
}
