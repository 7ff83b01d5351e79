#include "fontcore/edit.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "fontcore/error.h"
#include "fontcore/wavelet.h"

namespace fontcore {

namespace {

constexpr double moved_spans = 5.0;  // of a level: three neighbouring basis functions, each three spans wide
constexpr double negligible = 1e-9;  // displacement, in lengths of the contour: below it a point stays, bit for bit

}  // namespace

double breadth_of_level(const OutlineCurve& curve, double t, int levels_down) {
  if (moved_spans >= curve.size() >> levels_down) return curve.length();
  const double middle = std::floor(coarser_parameter(t, levels_down) + 0.5);
  return curve.arc_length(finer_parameter(middle - 0.5 * moved_spans, levels_down),
                          finer_parameter(middle + 0.5 * moved_spans, levels_down));
}

double level_of_breadth(const OutlineCurve& curve, double t, double breadth) {
  if (!(breadth > 0.0)) throw InvalidInput(text("level_of_breadth: breadth ", breadth, " is not positive"));
  const int finest = curve.levels();
  int down = 0;  // of the narrow level below the finest
  double narrow_breadth = breadth_of_level(curve, t, 0);
  double broad_breadth = narrow_breadth;
  for (; down < finest; ++down) {
    broad_breadth = breadth_of_level(curve, t, down + 1);
    if (breadth <= broad_breadth) break;
    narrow_breadth = broad_breadth;
  }

  if (down == finest || breadth <= narrow_breadth) return finest - down;
  return finest - down - 1 + (broad_breadth - breadth) / (broad_breadth - narrow_breadth);
}

Sweep sweep(const OutlineCurve& curve, double t, const Point& move, double breadth, Scheme scheme) {
  if (!is_closed(scheme)) throw InvalidInput("sweep: an outline is closed, the scheme is not");
  const double level = level_of_breadth(curve, t, breadth);
  Eigen::VectorXd weights = reconstruct(pull(scheme, curve.size(), curve.levels(), t, level));
  weights = (weights.array().abs() * move.norm() < negligible * curve.length()).select(0.0, weights);
  return {weights * move.transpose(), t, level};
}

Points respect_corners(const OutlineCurve& curve, Points field) {
  for (const int i : curve.corner_pairs()) {
    const int next = (i + 1) % curve.size();
    const Eigen::RowVector2d both = 0.5 * (field.row(i) + field.row(next));
    field.row(i) = field.row(next) = both;
  }
  return field;
}

namespace {

// Three-point Gauss-Legendre rule on [0, 1].
constexpr std::array<double, 3> gauss_node = {0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> gauss_weight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

// |x|^2 and E(x) over one piece's arc length as forms of its three control points.
struct PieceForms {
  Eigen::Matrix3d mass = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d bending = Eigen::Matrix3d::Zero();
};

PieceForms piece_forms(const OutlineCurve& curve, int piece) {
  PieceForms forms;
  for (std::size_t g = 0; g < gauss_node.size(); ++g) {
    const double u = gauss_node[g];
    const auto [speed, change] = curve.pace(piece - 0.5 + u);
    const Eigen::Vector3d value = spline_weights(u);
    const Eigen::Vector3d slope(u - 1.0, 1.0 - 2.0 * u, u);
    const Eigen::Vector3d bend(1.0, -2.0, 1.0);
    // d^2x / ds^2 = (x_tt s_t - x_t s_tt) / s_t^3: straight runs, where x is linear in s, have none.
    const Eigen::Vector3d second = (bend * speed - slope * change) / (speed * speed * speed);
    forms.mass += gauss_weight[g] * speed * value * value.transpose();
    forms.bending += gauss_weight[g] * speed * second * second.transpose();
  }
  return forms;
}

}  // namespace

Smoothing smooth_by_energy(const OutlineCurve& curve, double scale) {
  if (!(scale >= 0.0) || !std::isfinite(scale))
    throw InvalidInput(text("smooth_by_energy: scale ", scale, " is not a length"));
  const int n = curve.size();
  const Points& x = curve.control_points();
  const double stiffness = std::pow(scale / (2.0 * std::numbers::pi), 4);
  std::vector<int> column(static_cast<std::size_t>(n), 0);
  for (const int i : curve.corner_pairs())
    column[static_cast<std::size_t>(i)] = column[static_cast<std::size_t>((i + 1) % n)] = -1;
  int unknowns = 0;
  for (int& c : column) c = c < 0 ? c : unknowns++;

  std::vector<PieceForms> forms;
  for (int i = 0; i < n; ++i) forms.push_back(piece_forms(curve, i));
  const auto control = [&](int piece, int k) { return ((piece - 1 + k) % n + n) % n; };
  Smoothing result{Points::Zero(n, 2), {}, {}, {}};
  if (scale > 0.0 && unknowns > 0) {
    std::vector<Eigen::Triplet<double>> entries;
    Points right = Points::Zero(unknowns, 2);
    for (int i = 0; i < n; ++i) {
      const PieceForms& form = forms[static_cast<std::size_t>(i)];
      for (int p = 0; p < 3; ++p) {
        const int row = column[static_cast<std::size_t>(control(i, p))];
        if (row < 0) continue;
        for (int q = 0; q < 3; ++q) {
          const int j = control(i, q);
          right.row(row) -= stiffness * form.bending(p, q) * (x.row(j) - x.row(i));  // a shift has no energy
          const int col = column[static_cast<std::size_t>(j)];
          if (col >= 0 && col <= row) entries.emplace_back(row, col, form.mass(p, q) + stiffness * form.bending(p, q));
        }
      }
    }
    Eigen::SparseMatrix<double> system(unknowns, unknowns);
    system.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(system);
    const Points solved = factor.solve(right);
    for (int i = 0; i < n; ++i) {
      const int row = column[static_cast<std::size_t>(i)];
      if (row >= 0) result.field.row(i) = solved.row(row);
    }
    // An arc that only rounding moves stays; as a whole, since its energy hangs on differences of neighbours.
    const double least = 1e-9 * curve.length();
    for (const auto& [first, size] : curve.arcs()) {
      auto arc = result.field.middleRows(first, size);
      if (arc.rowwise().norm().maxCoeff() < least) arc.setZero();
    }
  }
  for (const auto& [first, size] : curve.arcs()) {
    double before = 0.0;
    double after = 0.0;
    double distance = 0.0;
    for (int i = first; i < first + size; ++i) {
      Eigen::Matrix<double, 3, 2> c;
      Eigen::Matrix<double, 3, 2> d;
      for (int k = 0; k < 3; ++k) {
        c.row(k) = x.row(control(i, k)) - x.row(i);  // from the piece's middle, or large coordinates would cancel
        d.row(k) = result.field.row(control(i, k));
      }
      const PieceForms& form = forms[static_cast<std::size_t>(i)];
      before += (c.transpose() * form.bending * c).trace();
      after += ((c + d).transpose() * form.bending * (c + d)).trace();
      distance += (d.transpose() * form.mass * d).trace();
    }
    result.energy_before.push_back(before);
    result.energy_after.push_back(after);
    result.distance.push_back(std::sqrt(std::max(0.0, distance)));
  }
  return result;
}

Points equalize(const OutlineCurve& curve, const std::vector<Band>& bands) {
  double before = 0.0;
  for (const Band& band : bands) {
    if (!(band.scale > before) || !std::isfinite(band.scale)) {
      throw InvalidInput(text("equalize: scale ", band.scale, " does not rise from ", before));
    }
    if (!(band.gain >= 0.0) || !std::isfinite(band.gain)) {
      throw InvalidInput(text("equalize: gain ", band.gain, " at scale ", band.scale, " is no gain"));
    }
    before = band.scale;
  }
  Points field = Points::Zero(curve.size(), 2);
  for (const auto& [scale, gain] : bands) {
    if (gain == 1.0) continue;
    const Points finer = smooth_by_energy(curve, scale / std::numbers::sqrt2).field;
    field += (gain - 1.0) * (finer - smooth_by_energy(curve, scale * std::numbers::sqrt2).field);
  }
  return field;
}

}  // namespace fontcore
