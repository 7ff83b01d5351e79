#include "fontcore/curvature.h"

#include <algorithm>
#include <cmath>

#include "fontcore/error.h"

namespace fontcore {

double curvature(const Bezier& bezier, double u) {
  if (bezier.degree == 1) return 0.0;
  constexpr double further = 1e-3;
  constexpr double no_speed = 1e-9;  // of the control polygon
  const auto& p = bezier.p;
  double around = (p[1] - p[0]).norm() + (p[2] - p[1]).norm();
  if (bezier.degree == 3) around += (p[3] - p[2]).norm();
  Point d = derivative(bezier, u);
  if (d.norm() <= no_speed * around) {
    u += u < 0.5 ? further : -further;
    d = derivative(bezier, u);
  }
  const double speed = d.norm();
  if (speed <= no_speed * around) return 0.0;
  const Point first = p[2] - 2.0 * p[1] + p[0];
  Point bend = 2.0 * first;
  if (bezier.degree == 3) bend = 6.0 * ((1.0 - u) * first + u * (p[3] - 2.0 * p[2] + p[1]));
  return cross(d, bend) / (speed * speed * speed);
}

std::vector<std::vector<CombTooth>> curvature_comb(const OutlineArcs& outline, double step) {
  if (!(step > 0.0)) throw InvalidInput(text("curvature_comb: step ", step, " is not positive"));
  std::vector<std::vector<CombTooth>> combs;
  for (const OutlineArcs::Arc& arc : outline.arcs()) {
    std::vector<CombTooth>& comb = combs.emplace_back();
    for (const int segment : arc.segments) {
      const Bezier b = outline.contour().segment(segment);
      const ArcLength& along = outline.along(segment);
      const int count = std::max(1, static_cast<int>(std::ceil(along.length() / step)));
      for (int k = 0; k <= count; ++k) {
        const double u = k == 0 ? 0.0 : k == count ? 1.0 : along.inverse(along.length() * k / count);
        const Point tangent = k == 0       ? start_tangent(b)
                              : k == count ? end_tangent(b)
                                           : Point(derivative(b, u).normalized());
        comb.push_back({evaluate(b, u), left_of(tangent), curvature(b, u)});
      }
    }
    if (!outline.has_corner()) comb.push_back(comb.front());
  }
  return combs;
}

}  // namespace fontcore
