// A stroke whose thickness is a third column of its control points: [FS94] textural properties.
//
// Its sweep is edited at a coarse level while the thickness stays; then the thickness at a fine one while the path
// stays. Every version is expanded to an outline.

#include "fontcore/wavelet.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

constexpr Scheme scheme = Scheme::EndpointCubic;
constexpr int levels = 4;

// Control points x, y, thickness: a wave drawn with a swelling, trembling hand.
Coefficients drawn() {
  Coefficients points((3 << levels) + degree(scheme), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(points.rows() - 1);
    points.row(i) << 900.0 * t, 110.0 * std::sin(7.0 * t), 18.0 + 40.0 * t * (1.0 - t) * 4.0 + 3.0 * std::sin(90.0 * t);
  }
  return points;
}

// There on the left of the path, back on its right, half the thickness away.
Points outline_of(const Coefficients& stroke) {
  const auto spans = static_cast<double>(detail_count(scheme, stroke.rows()));
  constexpr Eigen::Index steps = 400;
  Points outline(2 * steps, 2);
  for (Eigen::Index k = 0; k < steps; ++k) {
    const double t = spans * static_cast<double>(k) / (steps - 1);
    const Eigen::RowVector3d here = evaluate(scheme, stroke, t);
    const Eigen::RowVector3d along = evaluate(scheme, stroke, t + 1e-4) - evaluate(scheme, stroke, t - 1e-4);
    const Eigen::RowVector2d normal = Eigen::RowVector2d(-along[1], along[0]).normalized();
    outline.row(k) = here.head<2>() + 0.5 * here[2] * normal;
    outline.row(2 * steps - 1 - k) = here.head<2>() - 0.5 * here[2] * normal;
  }
  return outline;
}

}  // namespace

int main() {
  const MultiresCurve curve = decompose(scheme, drawn(), levels);
  const auto edited = [&](double t, double level, const Eigen::RowVector3d& move) {
    const MultiresCurve change = pull(scheme, drawn().rows(), levels, t, level);
    return Coefficients(drawn() + reconstruct(change) * move);
  };
  Picture picture;
  const auto show = [&](const Coefficients& stroke, double y) {
    picture.path(outline_of(stroke).rowwise() + Eigen::RowVector2d(0.0, y), "fill=\"#29292e\"", true);
  };
  show(drawn(), 0.0);
  show(edited(24.0, 0.5, {0.0, 160.0, 0.0}), -330.0);  // the sweep
  show(edited(24.0, 2.5, {0.0, 0.0, 60.0}), -620.0);   // the thickness, narrowly
  show(fractional(curve, 1.5), -900.0);                // path and hand both smoothed
  picture.print();
}
