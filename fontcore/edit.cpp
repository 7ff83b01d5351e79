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

// What smoothing makes of one arc: the change of its control points, and its energy.
struct ArcChange {
  Points change;
  double energy_before = 0.0;
  double energy_after = 0.0;
};

// A form on the control points of an arc, times them.
Points times(Form form, Scheme scheme, const Points& x) {
  const Eigen::Index n = x.rows();
  const int p = degree(scheme);
  Points product = Points::Zero(n, 2);
  for (Eigen::Index e = 0; e < detail_count(scheme, n); ++e) {
    const Eigen::Matrix4d& local = span_form(form, scheme, n, e);
    for (int i = 0; i <= p; ++i) {
      for (int j = 0; j <= p; ++j) product.row((e + i) % n) += local(i, j) * x.row((e + j) % n);
    }
  }
  return product;
}

// The energy over arc length of what the form gives over spans of length 1.
double bending_factor(double span) { return 0.5 / (span * span * span); }

// The x that makes |x - c|^2 + (scale / 2 pi)^4 E(x) least, less c; `bent` is the energy's form times c.
Points smoothed_by_energy(const ArcSpline& arc, double scale, const Points& bent) {
  const Scheme scheme = arc.scheme;
  const Eigen::Index n = bent.rows();
  const int p = degree(scheme);
  const double span = arc.span_length();
  const double bending = bending_factor(span);
  const double stiffness = std::pow(scale / (2.0 * std::numbers::pi), 4);
  const int held = is_closed(scheme) ? 0 : 1;
  const auto unknowns = static_cast<int>(n) - 2 * held;
  ProfileSystem system = spline_system(scheme, n, held);
  for (Eigen::Index e = 0; e < detail_count(scheme, n); ++e) {
    const Eigen::Matrix4d local =
        span * span_form(Form::Product, scheme, n, e) + stiffness * bending * span_form(Form::Energy, scheme, n, e);
    for (int i = 0; i <= p; ++i) {
      const auto row = static_cast<int>((e + i) % n) - held;
      if (row < 0 || row >= unknowns) continue;
      for (int j = 0; j <= p; ++j) {
        const auto column = static_cast<int>((e + j) % n) - held;
        if (column >= 0 && column <= row) system.entry(row, column) += local(i, j);
      }
    }
  }
  system.factor();
  Points change = Points::Zero(n, 2);
  change.middleRows(held, unknowns) = system.solve(Points(-stiffness * bending * bent.middleRows(held, unknowns)));
  return change;
}

Points smoothed_by_level(const ArcSpline& spline, double scale) {
  const ArcwiseCurve::Arc arc(spline);
  const Eigen::Index n = spline.points.rows();
  const double level = arc.level_of_scale(scale);
  if (level >= arc.curve.base().levels()) return Points::Zero(n, 2);
  Coefficients x = arc.at_level(level);
  while (x.rows() < n) x = refine(spline.scheme, x);
  return x - spline.points;
}

ArcChange smooth_arc(const ArcSpline& arc, double scale, SmoothBy by) {
  if (arc.is_line) return {Points::Zero(arc.points.rows(), 2)};
  const Eigen::RowVector2d middle = arc.points.colwise().mean();
  const Points c = arc.points.rowwise() - middle;  // or large coordinates would cancel in the energy
  const double bending = bending_factor(arc.span_length());
  const Points bent = times(Form::Energy, arc.scheme, c);
  ArcChange result{Points::Zero(c.rows(), 2), bending * c.cwiseProduct(bent).sum(), 0.0};
  result.energy_after = result.energy_before;
  if (scale == 0.0) return result;
  result.change = by == SmoothBy::Energy ? smoothed_by_energy(arc, scale, bent) : smoothed_by_level(arc, scale);
  // An arc that only rounding moves stays; as a whole, since its energy hangs on differences of neighbours.
  if (result.change.rowwise().norm().maxCoeff() < negligible * arc.length) result.change.setZero();
  const Points x = c + result.change;
  result.energy_after = bending * x.cwiseProduct(times(Form::Energy, arc.scheme, x)).sum();
  return result;
}

// What an infinite scale would leave of control points x: by level the coarsest curve; by energy that of no energy, the
// chord, for a closed curve the middle.
Coefficients without_detail(const ArcSpline& arc, const Points& x, SmoothBy by) {
  MultiresCurve curve = decompose(arc.scheme, x, arc.levels);
  for (Coefficients& detail : curve.details) detail.setZero();
  if (by == SmoothBy::Energy) {
    if (is_closed(arc.scheme)) {
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

// |.|^2 over arc length of a displacement, to the power 1/2.
double norm_over_length(const ArcSpline& arc, const Points& x) {
  const double square = arc.span_length() * x.cwiseProduct(times(Form::Product, arc.scheme, x)).sum();
  return std::sqrt(std::max(0.0, square));
}

// The field on the model's control points that is, at every t = i, what the arcs' changes are at that place.
Points field_of(const OutlineCurve& curve, const ArcField& arcs, Corners corners) {
  const int n = curve.size();
  std::vector<bool> fixed(static_cast<std::size_t>(n), false);
  if (corners == Corners::Keep) {
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
    const auto [arc, s] = curve.along(i);
    right.row(i) = arcs.at(curve.outline(), arc, s);
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

// The arcs to smooth, a little nearer to the outline than its own model is.
ArcwiseOptions arcs_of(const OutlineCurve& curve, Corners corners) {
  return {.tolerance = std::max(curve.distance(), 1e-6 * curve.length()), .corners = corners};
}

void require_scale(double scale) {
  if (!(scale >= 0.0) || !std::isfinite(scale)) throw InvalidInput(text("smooth: scale ", scale, " is not a length"));
}

void require_bands(const std::vector<Band>& bands) {
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
}

}  // namespace

ArcField::ArcField(const std::vector<ArcSpline>& splines, std::vector<Points> changes) {
  for (std::size_t k = 0; k < splines.size(); ++k) {
    const bool is_zero = changes[k].isZero(0.0);
    pieces_.push_back({splines[k].scheme, is_zero ? 1.0 : splines[k].span_length(), is_zero, std::move(changes[k])});
  }
}

bool ArcField::is_zero() const { return std::ranges::all_of(pieces_, &Piece::is_zero); }

Point ArcField::at(const OutlineArcs& outline, int arc, double s) const {
  const bool is_whole = pieces_.size() == 1;
  const Piece& piece = pieces_[is_whole ? 0 : static_cast<std::size_t>(arc)];
  if (piece.is_zero) return Point::Zero();
  if (is_whole) s += outline.arcs()[static_cast<std::size_t>(arc)].start;
  const double spans = s / piece.span_length;
  return evaluate(piece.scheme, piece.change, is_closed(piece.scheme) ? spans - 0.5 : spans).transpose();
}

ArcSmoothing smooth_arcs(const OutlineArcs& outline, double scale, SmoothBy by, const ArcwiseOptions& options) {
  require_scale(scale);
  const std::vector<ArcSpline> splines = fit_arcs(outline, options);
  std::vector<Points> changes;
  int levels = 0;
  double before = 0.0;
  double after = 0.0;
  for (const ArcSpline& arc : splines) {
    ArcChange smoothed = smooth_arc(arc, scale, by);
    changes.push_back(std::move(smoothed.change));
    levels = std::max(levels, arc.levels);
    before += smoothed.energy_before;
    after += smoothed.energy_after;
  }
  return {ArcField(splines, std::move(changes)), levels, before, after};
}

Smoothing smooth(const OutlineCurve& curve, double scale, SmoothBy by, Corners corners) {
  require_scale(scale);
  Smoothing result;
  std::vector<Points> changes;
  const std::vector<ArcSpline> splines = fit_arcs(curve.outline(), arcs_of(curve, corners));
  for (const ArcSpline& arc : splines) {
    ArcChange smoothed = smooth_arc(arc, scale, by);
    const Points x = arc.points + smoothed.change;
    result.energy_before.push_back(smoothed.energy_before);
    result.energy_after.push_back(smoothed.energy_after);
    result.distance.push_back(norm_over_length(arc, smoothed.change));
    result.detail.push_back(norm_over_length(arc, x - without_detail(arc, x, by)));
    changes.push_back(std::move(smoothed.change));
  }
  result.field = field_of(curve, ArcField(splines, std::move(changes)), corners);
  return result;
}

ArcSmoothing equalize_arcs(const OutlineArcs& outline, const std::vector<Band>& bands, SmoothBy by,
                           const ArcwiseOptions& options) {
  require_bands(bands);
  const std::vector<ArcSpline> splines = fit_arcs(outline, options);
  std::vector<Points> changes;
  int levels = 0;
  for (const ArcSpline& arc : splines) {
    levels = std::max(levels, arc.levels);
    Points& change = changes.emplace_back(Points::Zero(arc.points.rows(), 2));
    for (const auto& [scale, gain] : bands) {
      if (gain == 1.0) continue;
      change += (gain - 1.0) * (smooth_arc(arc, scale / std::numbers::sqrt2, by).change -
                                smooth_arc(arc, scale * std::numbers::sqrt2, by).change);
    }
  }
  return {ArcField(splines, std::move(changes)), levels, 0.0, 0.0};
}

Points equalize(const OutlineCurve& curve, const std::vector<Band>& bands, SmoothBy by, Corners corners) {
  return field_of(curve, equalize_arcs(curve.outline(), bands, by, arcs_of(curve, corners)).field, corners);
}

}  // namespace fontcore
