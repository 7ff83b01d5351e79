// Masters of an o along a weight axis, as one tensor product: the contour one way, the axis the other.
//
// One drag moves a feature of the contour in all masters alike, another the whole contour of one master: the levels of
// the two directions are apart. Before in grey, after in blue.

#include <numbers>

#include "fontcore/tensor.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

constexpr int masters = 7;  // 4 spans of the cubic axis
constexpr int points = 32;

// The outer contour grows with the weight.
Grid os() {
  Grid grid(2, Eigen::MatrixXd(points, masters));
  for (int i = 0; i < points; ++i) {
    for (int j = 0; j < masters; ++j) {
      const double a = 2.0 * std::numbers::pi * i / points;
      grid[0](i, j) = (150.0 + 14.0 * j) * std::cos(a);
      grid[1](i, j) = (210.0 + 4.0 * j) * std::sin(a);
    }
  }
  return grid;
}

void show(Picture& picture, const Grid& grid, double y, const std::string& style) {
  for (int j = 0; j < masters; ++j) {
    Points contour(200, 2);
    for (int k = 0; k < 200; ++k) {
      Coefficients control(points, 2);
      control << grid[0].col(j), grid[1].col(j);
      contour.row(k) = evaluate(Scheme::Orthogonal, control, points * k / 200.0) + Eigen::RowVector2d(560.0 * j, y);
    }
    picture.path(contour, style, true);
  }
}

}  // namespace

int main() {
  const MultiresPatch patch = decompose(Scheme::Orthogonal, Scheme::EndpointCubic, os(), 3, 2);
  const Eigen::RowVector2d move(90.0, 60.0);
  Picture picture;
  double y = 0.0;
  for (const auto& [round, axis] : {std::pair{3.0, 0.0}, std::pair{0.0, 2.0}, std::pair{1.5, 1.0}}) {
    show(picture, os(), y, "fill=\"none\" stroke=\"#999\" stroke-width=\"6\"");
    show(picture, reconstruct(drag(patch, 4.0, 2.0, move, round, axis)), y,
         "fill=\"none\" stroke=\"#215bea\" stroke-width=\"6\"");
    y -= 640.0;
  }
  picture.print();
}
