#include "fontcore/edit.h"

#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "fontcore/constraint.h"
#include "fontcore/error.h"
#include "fontcore/wavelet.h"

namespace fontcore {

namespace {

constexpr double negligible = 1e-9;  // displacement, in lengths of the contour: below it a point stays, bit for bit

constexpr double breadth_of_displacement = 8.0 / 3.0;  // over its integral, for a move of 1: five even spans

// Direct manipulation moves degree + 1 neighbouring basis functions, each degree + 1 spans wide.
constexpr double moved_spans(Scheme scheme) { return 2.0 * degree(scheme) + 1.0; }

// The fractional level whose breadth is asked for, between those of integer levels: `breadth_at(down)` below the
// finest.
template <typename BreadthAt>
double level_between(int levels, double breadth, const BreadthAt& breadth_at) {
  if (!(breadth > 0.0)) throw InvalidInput(text("level_of_breadth: breadth ", breadth, " is not positive"));
  double narrow = breadth_at(0);
  if (breadth <= narrow) return levels;
  for (int down = 1; down <= levels; ++down) {
    const double broad = breadth_at(down);
    if (breadth <= broad) return levels - down + (broad - breadth) / (broad - narrow);
    narrow = broad;
  }
  return 0.0;
}

// Where the spans that direct manipulation at t moves begin, `down` levels below the finest, in parameters of the
// finest.
std::pair<double, double> moved_stretch(Scheme scheme, double t, int down) {
  const double at = coarser_parameter(scheme, t, down);
  const double middle = is_closed(scheme) ? std::floor(at + 0.5) : std::floor(at) + 0.5;
  const double half = 0.5 * moved_spans(scheme);
  return {finer_parameter(scheme, middle - half, down), finer_parameter(scheme, middle + half, down)};
}

}  // namespace

namespace {

double breadth_below(const OutlineCurve& curve, double t, int levels_down) {
  if (moved_spans(Scheme::Chaikin) >= curve.size() >> levels_down) return curve.length();
  const auto [from, to] = moved_stretch(Scheme::Chaikin, t, levels_down);
  return curve.arc_length(from, to);
}

}  // namespace

double breadth_of_level(const OutlineCurve& curve, double t, double level) {
  if (!(level >= 0.0 && level <= curve.levels())) {
    throw InvalidInput(text("breadth_of_level: level ", level, " of a curve with levels 0 to ", curve.levels()));
  }
  const int coarser = static_cast<int>(std::floor(level));
  const double broad = breadth_below(curve, t, curve.levels() - coarser);
  if (level == coarser) return broad;
  return broad + (level - coarser) * (breadth_below(curve, t, curve.levels() - coarser - 1) - broad);
}

double level_of_breadth(const OutlineCurve& curve, double t, double breadth) {
  return level_between(curve.levels(), breadth, [&](int down) { return breadth_below(curve, t, down); });
}

double level_of_breadth(const MultiresCurve& curve, double t, double breadth) {
  const Scheme scheme = curve.scheme;
  const Coefficients points = reconstruct(curve);
  // Where speed varies within the moved stretch, its ends count as little as they move.
  return level_between(curve.levels(), breadth, [&](int down) {
    const MultiresCurve seen = from_level(curve, curve.levels() - down);
    const double at = coarser_parameter(scheme, t, down);
    const Coefficients weights = pull(scheme, seen.coarse.rows(), 0, at, 0.0).coarse;
    const auto spans = static_cast<double>(detail_count(scheme, points.rows()));
    auto [from, to] = moved_stretch(scheme, t, down);
    if (!is_closed(scheme)) {
      from = std::max(from, 0.0);
      to = std::min(to, spans);
    } else if (to - from > spans) {
      to = from + spans;
    }
    constexpr double chords = 8.0;  // a span: a chord is 1e-3 short where the span turns by half a radian
    const int steps = static_cast<int>(std::ceil(chords * (to - from)));
    const double step = (to - from) / steps;
    double sum = 0.0;
    Eigen::RowVectorXd before = evaluate(scheme, points, from);
    for (int k = 0; k < steps; ++k) {
      const double middle = coarser_parameter(scheme, from + (k + 0.5) * step, down);
      const Eigen::RowVectorXd here = evaluate(scheme, points, from + (k + 1) * step);
      sum += std::abs(evaluate(scheme, weights, middle)[0]) * (here - before).norm();
      before = here;
    }
    return breadth_of_displacement * sum;
  });
}

MultiresCurve carry_details(const MultiresCurve& curve, int level, const CoefficientsView& coarse, DetailFrame frame) {
  MultiresCurve result = from_level(curve, level);
  if (coarse.rows() != result.coarse.rows() || coarse.cols() != result.coarse.cols() || coarse.cols() < 2) {
    throw InvalidInput(text("carry_details: ", coarse.rows(), "×", coarse.cols(), " control points at level ", level,
                            ", where the curve has ", result.coarse.rows(), "×", result.coarse.cols()));
  }
  Coefficients before = result.coarse;
  result.coarse = coarse;
  if (frame == DetailFrame::Fixed) return result;
  Coefficients after = coarse;
  for (Coefficients& detail : result.details) {
    const Coefficients was = detail;
    const Points old_points = before.leftCols<2>();
    const Points new_points = after.leftCols<2>();
    for (Eigen::Index k = 0; k < detail.rows(); ++k) {
      const double t = static_cast<double>(k) + (is_closed(curve.scheme) ? 0.0 : 0.5);  // the wavelet's middle
      const Point from = curve_at(curve.scheme, old_points, t, 1).value;
      const Point to = curve_at(curve.scheme, new_points, t, 1).value;
      if (from == Point::Zero() || to == Point::Zero()) continue;
      std::complex<double> turn = std::complex(to.x(), to.y()) / std::complex(from.x(), from.y());
      if (frame == DetailFrame::Tangent) turn /= std::abs(turn);
      const std::complex<double> turned = turn * std::complex(was(k, 0), was(k, 1));
      detail(k, 0) = turned.real();
      detail(k, 1) = turned.imag();
    }
    before = synthesize(curve.scheme, before, was);
    after = synthesize(curve.scheme, after, detail);
  }
  return result;
}

Sweep sweep(const OutlineCurve& curve, double t, const Point& move, double breadth, const SweepOptions& options) {
  if (!std::isfinite(t)) throw InvalidInput(text("sweep: a move at parameter ", t));
  return sweep_at_level(curve, t, move, level_of_breadth(curve, t, breadth), options);
}

Sweep sweep_at_level(const OutlineCurve& curve, double t, const Point& move, double level,
                     const SweepOptions& options) {
  if (!is_closed(options.scheme)) throw InvalidInput("sweep: an outline is closed, the scheme is not");
  if (!std::isfinite(t) || !move.allFinite()) {
    throw InvalidInput(text("sweep: a move by ", move.x(), ", ", move.y(), " at parameter ", t));
  }
  const auto pulled = [&] {
    if (options.grip == Grip::Curve) return pull(options.scheme, curve.size(), curve.levels(), t, level);
    const int finer = static_cast<int>(std::ceil(level));
    const int down = curve.levels() - finer;
    const int count = curve.size() >> std::max(down, 0);
    const auto nearest = static_cast<int>(std::lround(coarser_parameter(t, down)));
    return pull_control_point(options.scheme, curve.size(), curve.levels(), ((nearest % count) + count) % count, level);
  };
  Eigen::VectorXd weights = reconstruct(pulled());
  weights = (weights.array().abs() * move.norm() < negligible * curve.length()).select(0.0, weights);
  Sweep result{weights * move.transpose(), t, level};
  if (options.detail == DetailFrame::Fixed) return result;

  const int seen = static_cast<int>(std::ceil(level));  // the sweep itself is all in its control points
  const MultiresCurve before = decompose(options.scheme, curve.control_points(), curve.levels());
  const MultiresCurve change = from_level(decompose(options.scheme, result.field, curve.levels()), seen);
  const Coefficients coarse = from_level(before, seen).coarse + change.coarse;
  result.field = reconstruct(carry_details(before, seen, coarse, options.detail)) - curve.control_points();
  for (Eigen::Index i = 0; i < result.field.rows(); ++i) {
    if (weights[i] == 0.0 && result.field.row(i).norm() < negligible * curve.length()) result.field.row(i).setZero();
  }
  if (options.grip == Grip::ControlPoint) return result;
  const Point missed = move - evaluate(options.scheme, result.field, t).transpose();
  result.field += weights * missed.transpose();
  return result;
}

Sweep sweep(const OutlineCurve& curve, const std::vector<Pull>& handles, double breadth, Scheme scheme) {
  if (handles.empty()) throw InvalidInput("sweep: no handle");
  const auto n = static_cast<Eigen::Index>(handles.size());
  Eigen::MatrixXd weights(curve.size(), n);  // a column a handle: its pull by 1
  Eigen::MatrixXd at_handles(n, n);
  Points moves(n, 2);
  double level = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Pull& handle = handles[static_cast<std::size_t>(k)];
    const Sweep alone = sweep(curve, handle.t, Point(1.0, 0.0), breadth, {.scheme = scheme});
    if (k == 0) level = alone.level;
    weights.col(k) = alone.field.col(0);
    moves.row(k) = handle.move.transpose();
  }
  for (Eigen::Index i = 0; i < n; ++i)
    at_handles.row(i) = evaluate(scheme, weights, handles[static_cast<std::size_t>(i)].t);
  Eigen::FullPivLU<Eigen::MatrixXd> factor(at_handles);
  factor.setThreshold(1e-3);  // of the largest pivot: a pull of the difference would be a thousand times as strong
  if (!moves.allFinite() || !factor.isInvertible()) {
    throw InvalidInput(text("sweep: ", n, " handles that lie too near to each other for a breadth of ", breadth));
  }
  return {weights * factor.solve(moves), handles[0].t, level};
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

// What smoothing makes of one arc: the change of its control points at the finest level, and its measures.
struct ArcChange {
  Coefficients change;
  double energy_before = 0.0;
  double energy_after = 0.0;
  double distance = 0.0;
  double detail = 0.0;
};

// |.|^2 over arc length of a displacement, to the power 1/2.
double norm_over_length(const Eigen::SparseMatrix<double>& mass, const Coefficients& x) {
  return std::sqrt(std::max(0.0, x.cwiseProduct(mass * x).sum()));
}

// What an infinite scale would leave of control points x: by level the coarsest curve; by energy that of no energy, the
// chord, for a closed curve the middle.
Coefficients without_detail(const MultiresCurve& base, const Coefficients& x, SmoothBy by) {
  MultiresCurve curve = decompose(base.scheme, x, base.levels());
  for (Coefficients& detail : curve.details) detail.setZero();
  if (by == SmoothBy::Energy) {
    if (is_closed(base.scheme)) {
      curve.coarse.rowwise() = x.colwise().mean();
    } else {
      const Eigen::RowVectorXd chord = x.bottomRows(1) - x.topRows(1);
      const Eigen::Index n = curve.coarse.rows();  // of a single span
      for (Eigen::Index k = 0; k < n; ++k) {
        curve.coarse.row(k) = x.row(0) + static_cast<double>(k) / static_cast<double>(n - 1) * chord;
      }
    }
  }
  return reconstruct(curve);
}

ArcChange smooth_arc(const ArcwiseCurve::Arc& arc, double scale, SmoothBy by) {
  const MultiresCurve& base = arc.curve.base();
  const Scheme scheme = base.scheme;
  Coefficients c = reconstruct(base);
  const Eigen::RowVector2d middle = c.colwise().mean();
  c.rowwise() -= middle;  // or large coordinates would cancel in the energy
  const Eigen::Index n = c.rows();
  const double span = arc.span_length();
  const Eigen::SparseMatrix<double> mass = span * mother_matrix(Form::Product, scheme, n);
  const Eigen::SparseMatrix<double> bending = 0.5 / (span * span * span) * mother_matrix(Form::Energy, scheme, n);

  ArcChange result{Coefficients::Zero(n, 2)};
  const Eigen::Index held = is_closed(scheme) ? 0 : 1;
  const Eigen::Index inner = n - 2 * held;
  if (scale > 0.0 && by == SmoothBy::Level) {
    const double level = arc.level_of_scale(scale);
    if (level < base.levels()) {
      Coefficients x = arc.at_level(level);
      x.rowwise() -= middle;
      while (x.rows() < n) x = refine(scheme, x);
      result.change = x - c;
    }
  } else if (scale > 0.0) {
    const double stiffness = std::pow(scale / (2.0 * std::numbers::pi), 4);
    const Eigen::SparseMatrix<double> system = (mass + stiffness * bending).block(held, held, inner, inner);
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(system);
    const Coefficients force = -stiffness * (bending * c);
    result.change.middleRows(held, inner) = factor.solve(force.middleRows(held, inner));
  }
  // An arc that only rounding moves stays; as a whole, since its energy hangs on differences of neighbours.
  if (result.change.rowwise().norm().maxCoeff() < negligible * arc.length) result.change.setZero();
  const Coefficients x = c + result.change;
  const auto energy_of = [&](const Coefficients& points) { return points.cwiseProduct(bending * points).sum(); };
  result.energy_before = energy_of(c);
  result.energy_after = energy_of(x);
  result.distance = norm_over_length(mass, result.change);
  result.detail = norm_over_length(mass, x - without_detail(base, x, by));
  return result;
}

// The field on the model's control points that is, at every t = i, what the arcs' changes are at that place.
Points field_of(const OutlineCurve& curve, const ArcwiseCurve& arcs, const std::vector<Coefficients>& changes) {
  const int n = curve.size();
  std::vector<bool> fixed(static_cast<std::size_t>(n), false);
  if (arcs.arcs().size() > 1 || !is_closed(arcs.arcs()[0].curve.scheme())) {
    for (const int i : curve.corner_pairs()) {
      fixed[static_cast<std::size_t>(i)] = fixed[static_cast<std::size_t>((i + 1) % n)] = true;
    }
  }
  // (x_{i-1} + 6 x_i + x_{i+1}) / 8 = D(i); what is fixed is 0.
  std::vector<Eigen::Triplet<double>> entries;
  Points right = Points::Zero(n, 2);
  for (int i = 0; i < n; ++i) {
    entries.emplace_back(i, i, 0.75);
    if (fixed[static_cast<std::size_t>(i)]) continue;
    const int next = (i + 1) % n;
    const int before = (i + n - 1) % n;
    for (const int other : {before, next}) {
      if (!fixed[static_cast<std::size_t>(other)]) entries.emplace_back(i, other, 0.125);
    }
    const double s = curve.arc_length(-0.5, i);
    const int a = arcs.arc_at(s);
    const ArcwiseCurve::Arc& arc = arcs.arcs()[static_cast<std::size_t>(a)];
    right.row(i) = evaluate(arc.curve.scheme(), changes[static_cast<std::size_t>(a)], arc.parameter(s));
  }
  if (right.isZero(0.0)) return right;
  Eigen::SparseMatrix<double> system(n, n);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(system);
  Points field = factor.solve(right);
  for (int i = 0; i < n; ++i) {
    if (fixed[static_cast<std::size_t>(i)] || field.row(i).norm() < negligible * curve.length()) field.row(i).setZero();
  }
  return field;
}

Smoothing smooth_arcs(const OutlineCurve& curve, const ArcwiseCurve& arcs, double scale, SmoothBy by) {
  if (!(scale >= 0.0) || !std::isfinite(scale)) throw InvalidInput(text("smooth: scale ", scale, " is not a length"));
  Smoothing result;
  std::vector<Coefficients> changes;
  for (const ArcwiseCurve::Arc& arc : arcs.arcs()) {
    ArcChange change = smooth_arc(arc, scale, by);
    changes.push_back(std::move(change.change));
    result.energy_before.push_back(change.energy_before);
    result.energy_after.push_back(change.energy_after);
    result.distance.push_back(change.distance);
    result.detail.push_back(change.detail);
  }
  result.field = field_of(curve, arcs, changes);
  return result;
}

// The arcs to smooth, a little nearer to the outline than its own model is.
ArcwiseCurve arcs_of(const OutlineCurve& curve, Corners corners) {
  return ArcwiseCurve(curve, {.tolerance = std::max(curve.distance(), 1e-6 * curve.length()), .corners = corners});
}

}  // namespace

Smoothing smooth(const OutlineCurve& curve, double scale, SmoothBy by, Corners corners) {
  return smooth_arcs(curve, arcs_of(curve, corners), scale, by);
}

Points equalize(const OutlineCurve& curve, const std::vector<Band>& bands, SmoothBy by, Corners corners) {
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
  const bool changes = std::any_of(bands.begin(), bands.end(), [](const Band& band) { return band.gain != 1.0; });
  if (!changes) return field;
  const ArcwiseCurve arcs = arcs_of(curve, corners);
  for (const auto& [scale, gain] : bands) {
    if (gain == 1.0) continue;
    const Points finer = smooth_arcs(curve, arcs, scale / std::numbers::sqrt2, by).field;
    field += (gain - 1.0) * (finer - smooth_arcs(curve, arcs, scale * std::numbers::sqrt2, by).field);
  }
  return field;
}

}  // namespace fontcore
