// A bicubic tensor-product patch pulled at one point, narrowly, fairly and broadly: [FS94] surfaces.

#include "fontcore/tensor.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

constexpr Scheme cubic = Scheme::EndpointCubic;
constexpr int size = (1 << 4) + 3;

Grid rolling_field() {
  Grid grid(3, Eigen::MatrixXd(size, size));
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      grid[0](i, j) = 50.0 * i;
      grid[1](i, j) = 50.0 * j;
      grid[2](i, j) = 12.0 * std::sin(1.9 * i) * std::cos(1.6 * j);
    }
  }
  return grid;
}

// Lines of constant u or v, seen from above one corner.
void show(Picture& picture, const Grid& grid, double x) {
  for (const bool along_u : {true, false}) {
    for (double fixed = 0.0; fixed <= 16.0; fixed += 0.5) {
      Points line(81, 2);
      for (int k = 0; k <= 80; ++k) {
        const double u = along_u ? 0.2 * k : fixed;
        const double v = along_u ? fixed : 0.2 * k;
        const Eigen::RowVector3d p = evaluate(cubic, cubic, grid, u, v);
        line.row(k) << x + 0.8 * (p[0] - p[1]), 0.35 * (p[0] + p[1]) + p[2];
      }
      picture.path(line, "fill=\"none\" stroke=\"#333\" stroke-width=\"2\"");
    }
  }
}

}  // namespace

int main() {
  const MultiresPatch patch = decompose(cubic, cubic, rolling_field(), 4, 4);
  Picture picture;
  show(picture, rolling_field(), 0.0);
  double x = 1600.0;
  for (const double level : {4.0, 2.5, 1.0}) {
    show(picture, reconstruct(drag(patch, 8.0, 8.0, Eigen::RowVector3d(0.0, 0.0, 400.0), level, level)), x);
    x += 1600.0;
  }
  picture.print();
}
