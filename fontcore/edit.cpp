#include "fontcore/edit.h"

#include <cmath>

#include "fontcore/error.h"
#include "fontcore/wavelet.h"

namespace fontcore {

namespace {

constexpr double moved_spans = 5.0;  // of a level: three neighbouring basis functions, each three spans wide

// Least-squares coefficients that move the curve at t by (1, 0): w / (w . w), in the first column.
Points pull(int size, double t) {
  const int i = static_cast<int>(std::floor(t + 0.5));
  const double u = t + 0.5 - i;
  const Eigen::Vector3d weight(0.5 * (1.0 - u) * (1.0 - u), 0.5 * (1.0 + 2.0 * u - 2.0 * u * u), 0.5 * u * u);
  Points coefficients = Points::Zero(size, 2);
  for (int k = 0; k < 3; ++k) coefficients(((i - 1 + k) % size + size) % size, 0) += weight[k] / weight.squaredNorm();
  return coefficients;
}

}  // namespace

double breadth_of_level(const OutlineCurve& curve, double t, int levels_down) {
  if (moved_spans >= curve.size() >> levels_down) return curve.length();
  const double middle = std::floor(coarser_parameter(t, levels_down) + 0.5);
  return curve.arc_length(finer_parameter(middle - 0.5 * moved_spans, levels_down),
                          finer_parameter(middle + 0.5 * moved_spans, levels_down));
}

Sweep sweep(const OutlineCurve& curve, double t, const Point& move, double breadth) {
  if (!(breadth > 0.0)) throw InvalidInput(text("sweep: breadth ", breadth, " is not positive"));
  const int finest = curve.levels();
  int down = 0;  // of the narrow level below the finest
  double narrow_breadth = breadth_of_level(curve, t, 0);
  double broad_breadth = narrow_breadth;
  for (; down < finest; ++down) {
    broad_breadth = breadth_of_level(curve, t, down + 1);
    if (breadth <= broad_breadth) break;
    narrow_breadth = broad_breadth;
  }

  Points field;
  double level = finest - down;
  if (down == finest || breadth <= narrow_breadth) {
    field = pull(curve.size() >> down, coarser_parameter(t, down));
  } else {
    const double f = (broad_breadth - breadth) / (broad_breadth - narrow_breadth);
    const double g = f * f;
    const Points broad = pull(curve.size() >> (down + 1), coarser_parameter(t, down + 1));
    const auto [A_narrow, B_narrow] = chaikin::analyze(pull(curve.size() >> down, coarser_parameter(t, down)));
    field = chaikin::synthesize((1.0 - g) * broad + g * A_narrow, f * B_narrow);
    level = finest - down - 1 + f;
  }
  for (int k = 0; k < down; ++k) field = chaikin::refine(field);
  const double at_handle = evaluate_spline(field, t)[0];
  return {field.col(0) * (move / at_handle).transpose(), t, level};
}

Points respect_corners(const OutlineCurve& curve, Points field) {
  for (const int i : curve.corner_pairs()) {
    const int next = (i + 1) % curve.size();
    const Eigen::RowVector2d both = 0.5 * (field.row(i) + field.row(next));
    field.row(i) = field.row(next) = both;
  }
  return field;
}

}  // namespace fontcore
