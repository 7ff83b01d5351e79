#include "fontcore/arcwise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <optional>

#include "fontcore/error.h"

namespace fontcore {

namespace {

using Eigen::Index;

constexpr int most_levels_beyond = 30;  // of the base: indices stay far from overflow

Index floor_half(Index i) { return i >= 0 ? i / 2 : -((1 - i) / 2); }
// Fine rows first .. last of a wavelet, not taken modulo anything.
struct Reach {
  Index first;
  Index last;
};
Reach reach_of_wavelet(Scheme scheme, Index size, Index k) {
  if (!is_closed(scheme)) {
    const FilterColumn column = wavelet_column(scheme, size, k);
    return {column.first, column.first + std::ssize(column.values) - 1};
  }
  const Index ahead = scheme == Scheme::Chaikin ? 2 : 4;
  return {2 * k - ahead, 2 * k + ahead - 1};
}

}  // namespace

SparseCurve::SparseCurve(MultiresCurve base) : base_(std::move(base)), points_(reconstruct(base_)) {}

Index SparseCurve::size(int level) const {
  if (level < base_.levels() || level > base_.levels() + most_levels_beyond) {
    throw InvalidInput(text("SparseCurve: level ", level, " is not from ", base_.levels(), " to ",
                            base_.levels() + most_levels_beyond));
  }
  const Index spans = detail_count(scheme(), points_.rows());
  return points_.rows() + (spans << (level - base_.levels())) - spans;
}

void SparseCurve::refine(double from, double to, int level) {
  const double spans = static_cast<double>(detail_count(scheme(), points_.rows()));
  const bool closed = is_closed(scheme());
  if (!(to > from) || !(to - from <= spans) || (!closed && (from < 0.0 || to > spans))) {
    throw InvalidInput(text("SparseCurve::refine: no stretch from ", from, " to ", to, " in ", spans, " spans"));
  }
  const int bottom = base_.levels();
  if (level <= bottom) throw InvalidInput(text("SparseCurve::refine: level ", level, " is not above ", bottom));
  size(level);
  if (closed) {
    const double turns = std::floor(from / spans) * spans;
    from -= turns;
    to -= turns;
  }
  // Wavelets lie wholly in the stretch: indices first .. last of a level, over 0 for closed curves.
  const auto within = [&](int at) -> Reach {
    const Index details = detail_count(scheme(), size(at));
    const int p = degree(scheme());
    const double low = finer_parameter(scheme(), from, at + 1 - bottom);
    const double high = finer_parameter(scheme(), to, at + 1 - bottom);
    const auto lies_within = [&](Index k) {
      if (!closed && (k < 0 || k >= details)) return false;
      const auto [first, last] = reach_of_wavelet(scheme(), size(at), k);
      // A function of a fine closed level reaches 3/2 spans to either side, one of an open arc from knot to knot.
      const double begin =
          closed ? static_cast<double>(first) - 1.5 : static_cast<double>(std::max<Index>(0, first - p));
      const double end =
          closed ? static_cast<double>(last) + 1.5 : static_cast<double>(std::min<Index>(last + 1, 2 * details));
      return begin >= low && end <= high;
    };
    auto first = static_cast<Index>(std::floor(0.5 * low)) - p;
    const auto end = static_cast<Index>(std::ceil(0.5 * high)) + p;
    while (first < end && !lies_within(first)) ++first;
    Index last = first;
    while (last < end && lies_within(last)) ++last;
    return {first, std::min(last - 1, first + details - 1)};
  };
  if (const Reach finest = within(level - 1); finest.last < finest.first) {
    throw InvalidInput(
        text("SparseCurve::refine: no wavelet of level ", level - 1, " lies between ", from, " and ", to));
  }
  finer_.resize(std::max(finer_.size(), static_cast<std::size_t>(level - bottom)));
  for (int at = bottom; at < level; ++at) {
    const Index details = detail_count(scheme(), size(at));
    std::vector<Run>& runs = finer_[static_cast<std::size_t>(at - bottom)];
    const auto add = [&](Index first, Index last) {  // the union with the runs it meets or touches
      const auto begin = std::find_if(runs.begin(), runs.end(),
                                      [&](const Run& run) { return run.first + run.details.rows() >= first; });
      const auto end = std::find_if(begin, runs.end(), [&](const Run& run) { return run.first > last + 1; });
      if (begin != end) {
        first = std::min(first, begin->first);
        last = std::max(last, (end - 1)->first + (end - 1)->details.rows() - 1);
      }
      Run merged{first, Coefficients::Zero(last - first + 1, points_.cols())};
      for (auto run = begin; run != end; ++run) {
        merged.details.middleRows(run->first - first, run->details.rows()) = run->details;
      }
      runs.insert(runs.erase(begin, end), std::move(merged));
    };
    const auto [first, last] = within(at);
    if (last < first) continue;
    const Index start = modulo(first, details);
    const Index stop = start + last - first;
    add(start, std::min(stop, details - 1));
    if (stop >= details) add(0, stop - details);
  }
}

const std::vector<SparseCurve::Run>& SparseCurve::runs(int level) const {
  size(level);
  static const std::vector<Run> none;
  return level < levels() ? finer_[static_cast<std::size_t>(level - base_.levels())] : none;
}

const SparseCurve::Run* SparseCurve::run_of(int level, Index index) const {
  const std::vector<Run>& all = runs(level);
  const auto after =
      std::upper_bound(all.begin(), all.end(), index, [](Index i, const Run& run) { return i < run.first; });
  if (after == all.begin() || index >= (after - 1)->first + (after - 1)->details.rows()) return nullptr;
  return &*(after - 1);
}

void SparseCurve::set_detail(int level, Index index, const Eigen::RowVectorXd& value) {
  const Run* const run = run_of(level, index);
  if (run == nullptr || value.size() != points_.cols() || !value.allFinite()) {
    throw InvalidInput(text("SparseCurve::set_detail: detail ", index, " of level ", level,
                            run == nullptr ? " is not stored" : " of wrong width or not finite"));
  }
  const auto which = static_cast<std::size_t>(run - runs(level).data());
  finer_[static_cast<std::size_t>(level - base_.levels())][which].details.row(index - run->first) = value;
}

Eigen::RowVectorXd SparseCurve::detail(int level, Index index) const {
  const Run* const run = run_of(level, index);
  if (run == nullptr) return Eigen::RowVectorXd::Zero(points_.cols());
  return run->details.row(index - run->first);
}

void SparseCurve::pull(double t, int level, const Eigen::RowVectorXd& move) {
  const Index coarse = size(level);
  const Index details = detail_count(scheme(), coarse);
  const BasisRow row = basis_row(scheme(), size(level + 1), finer_parameter(scheme(), t, level + 1 - base_.levels()));
  // What a wavelet is at t: its column times the basis there.
  std::vector<std::pair<Index, double>> weights;
  double square = 0.0;
  const Index middle = floor_half(row.index[0]);
  for (Index k = middle - 2 * degree(scheme()); k <= middle + 2 * degree(scheme()); ++k) {
    const Index index = is_closed(scheme()) ? modulo(k, details) : k;
    if (index < 0 || index >= details || run_of(level, index) == nullptr) continue;
    const bool seen = std::any_of(weights.begin(), weights.end(), [&](const auto& one) { return one.first == index; });
    if (seen) continue;
    const FilterColumn column = wavelet_column(scheme(), coarse, index);
    double weight = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(row.count); ++i) {
      const Index r =
          is_closed(scheme()) ? modulo(row.index[i] - column.first, 2 * coarse) : row.index[i] - column.first;
      if (r >= 0 && r < std::ssize(column.values)) weight += row.weight[i] * column.values[static_cast<std::size_t>(r)];
    }
    if (weight == 0.0) continue;
    weights.emplace_back(index, weight);
    square += weight * weight;
  }
  if (square == 0.0) throw InvalidInput(text("SparseCurve::pull: no stored wavelet of level ", level, " reaches ", t));
  for (const auto& [index, weight] : weights) set_detail(level, index, detail(level, index) + weight / square * move);
}

Coefficients SparseCurve::control_points(int level, Index first, Index count) const {
  const bool closed = is_closed(scheme());
  const Index n = size(level);
  if (count < 0 || (!closed && (first < 0 || first + count > n))) {
    throw InvalidInput(text("SparseCurve::control_points: ", first, " to ", first + count - 1, " of ", n));
  }
  if (level == base_.levels()) {
    Coefficients window(count, points_.cols());
    for (Index i = 0; i < count; ++i) window.row(i) = points_.row(modulo(first + i, n));
    return window;
  }
  // Coarse control points and wavelets that reach the window; closed ones by indices that are not taken modulo.
  const Index last = first + count - 1;
  const Index coarse_size = size(level - 1);
  const Index details = detail_count(scheme(), coarse_size);
  const int p = degree(scheme());
  Index from = floor_half(first);
  Index to = floor_half(last + p);
  if (!closed) {
    from = std::max<Index>(0, from);
    to = std::min({to, last, coarse_size - 1});
  }
  const Coefficients coarse = control_points(level - 1, from, to - from + 1);
  Coefficients window = Coefficients::Zero(count, points_.cols());
  // Where a column that was taken modulo starts, seen from about row 2j.
  const auto add = [&](const FilterColumn& column, Index about, const Eigen::RowVectorXd& value) {
    Index row = column.first;
    if (closed)
      row += 2 * coarse_size *
             static_cast<Index>(std::lround(static_cast<double>(about - row) / static_cast<double>(2 * coarse_size)));
    for (const double weight : column.values) {
      if (row >= first && row <= last) window.row(row - first) += weight * value;
      ++row;
    }
  };
  for (Index j = from; j <= to; ++j) {
    add(scaling_column(scheme(), coarse_size, closed ? modulo(j, coarse_size) : j), 2 * j, coarse.row(j - from));
  }
  for (Index k = floor_half(first) - 2 * p; k <= floor_half(last) + 2 * p; ++k) {
    const Index index = closed ? modulo(k, details) : k;
    const Run* const run = run_of(level - 1, index);
    if (run != nullptr) add(wavelet_column(scheme(), coarse_size, index), 2 * k, run->details.row(index - run->first));
  }
  return window;
}

Eigen::RowVectorXd SparseCurve::evaluate(double t) const {
  const BasisRow row = basis_row(scheme(), size(levels()), finer_parameter(scheme(), t, levels() - base_.levels()));
  const Coefficients points = control_points(levels(), row.index[0], row.count);
  Eigen::RowVectorXd value = Eigen::RowVectorXd::Zero(points.cols());
  for (int k = 0; k < row.count; ++k) value += row.weight[static_cast<std::size_t>(k)] * points.row(k);
  return value;
}

void SparseCurve::prune(double tolerance) {
  for (std::vector<Run>& runs : finer_) {
    std::vector<Run> kept;
    for (const Run& run : runs) {
      Index start = 0;
      for (Index i = 0; i <= run.details.rows(); ++i) {
        if (i < run.details.rows() && run.details.row(i).norm() > tolerance) continue;
        if (i > start) kept.push_back({run.first + start, run.details.middleRows(start, i - start)});
        start = i + 1;
      }
    }
    runs = std::move(kept);
  }
  while (!finer_.empty() && finer_.back().empty()) finer_.pop_back();
}

Index SparseCurve::stored() const {
  Index rows = points_.rows();  // as many as the base has coefficients
  for (const std::vector<Run>& runs : finer_) {
    for (const Run& run : runs) rows += run.details.rows();
  }
  return rows;
}

MultiresCurve SparseCurve::dense() const {
  MultiresCurve curve = base_;
  for (int level = base_.levels(); level < levels(); ++level) {
    curve.details.emplace_back(Coefficients::Zero(detail_count(scheme(), size(level)), points_.cols()));
    for (const Run& run : runs(level)) curve.details.back().middleRows(run.first, run.details.rows()) = run.details;
  }
  return curve;
}

namespace {

// Gauss-Legendre nodes and weights on [0, 1].
constexpr std::array<double, 3> gauss_node = {0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> gauss_weight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

// An arc of an outline, sampled at fractions of its length; those of halved spans are asked for again and again.
class ArcSamples {
 public:
  ArcSamples(const OutlineArcs& outline, int arc, double length) : outline_(outline), arc_(arc), length_(length) {}

  double length() const { return length_; }
  Point at(double s) const {
    const auto [segment, u] = arc_ < 0 ? outline_.locate(s) : outline_.locate(arc_, s);
    return evaluate(outline_.contour().segment(segment), u);
  }
  /// The points at k / count of the length, k = 0 .. count, where `count` doubles from one call to the next.
  const std::vector<Point>& even(Index count) {
    const double step = length_ / static_cast<double>(count);
    std::vector<Point> finer;
    finer.reserve(static_cast<std::size_t>(count) + 1);
    const bool knows_half = 2 * (std::ssize(even_) - 1) == count;
    for (Index k = 0; k <= count; ++k) {
      const bool is_known = knows_half && k % 2 == 0;
      finer.push_back(is_known ? even_[static_cast<std::size_t>(k / 2)] : at(static_cast<double>(k) * step));
    }
    even_ = std::move(finer);
    return even_;
  }

 private:
  const OutlineArcs& outline_;
  int arc_;  // -1: the whole contour, across corners
  double length_;
  std::vector<Point> even_;
};

ArcSpline line_spline(Scheme scheme, double length, const std::array<Point, 2>& ends) {
  const int p = degree(scheme);
  ArcSpline line{scheme, Points(p + 1, 2)};
  for (int k = 0; k <= p; ++k) line.points.row(k) = ends[0] + static_cast<double>(k) / p * (ends[1] - ends[0]);
  line.points.row(p) = ends[1];
  line.length = length;
  line.is_line = true;
  return line;
}

constexpr Index looks_per_span = 4;  // places where the distance of a fit is measured

// What a fit over arc length hangs on beside the outline.
struct FitBasis {
  Index spans;
  std::vector<BasisRow> at_nodes;  // of the Gauss-Legendre rule, span by span
  std::vector<BasisRow> at_looks;  // and at the end
  ProfileSystem normal;            // factored

  FitBasis(Scheme scheme, Index of_spans)
      : spans(of_spans), normal(spline_system(scheme, size(scheme, spans), held(scheme))) {
    const Index points = size(scheme, spans);
    const auto row_at = [&](double u) { return basis_row(scheme, points, is_closed(scheme) ? u - 0.5 : u); };
    for (Index e = 0; e < spans; ++e) {
      for (std::size_t g = 0; g < gauss_node.size(); ++g) {
        const BasisRow row = at_nodes.emplace_back(row_at(static_cast<double>(e) + gauss_node[g]));
        for (std::size_t a = 0; a < static_cast<std::size_t>(row.count); ++a) {
          const Index i = unknown(scheme, points, row.index[a]);
          for (std::size_t b = 0; b < static_cast<std::size_t>(row.count); ++b) {
            const Index j = unknown(scheme, points, row.index[b]);
            if (i >= 0 && j >= 0 && j <= i)
              normal.entry(static_cast<int>(i), static_cast<int>(j)) += gauss_weight[g] * row.weight[a] * row.weight[b];
          }
        }
      }
    }
    normal.factor();
    for (Index k = 0; k <= looks_per_span * spans; ++k)
      at_looks.push_back(row_at(static_cast<double>(k) / looks_per_span));
  }

  static Index held(Scheme scheme) { return is_closed(scheme) ? 0 : 1; }  // at either end
  static Index size(Scheme scheme, Index spans) { return is_closed(scheme) ? spans : spans + degree(scheme); }
  /// Index of a control point among those that are not held; -1 for the others.
  static Index unknown(Scheme scheme, Index points, Index index) {
    const Index i = index - held(scheme);
    return i < points - 2 * held(scheme) ? i : Index{-1};
  }
};

// Arcs are fitted by the thousand, their spans a power of two: what is the same for all of them is made once.
const FitBasis* common_basis(Scheme scheme, Index spans) {
  constexpr std::size_t sizes = 11;
  struct Common {
    std::array<std::once_flag, sizes> once;
    std::array<std::optional<FitBasis>, sizes> basis;
  };
  static Common held;
  static Common closed;
  if (scheme != Scheme::HeldCubic && scheme != Scheme::Orthogonal) return nullptr;
  const auto count = static_cast<std::uint64_t>(spans);
  const auto k = static_cast<std::size_t>(std::countr_zero(count));
  if (!std::has_single_bit(count) || k >= sizes) return nullptr;
  Common& of = scheme == Scheme::HeldCubic ? held : closed;
  std::call_once(of.once[k], [&] { of.basis[k].emplace(scheme, spans); });
  return &*of.basis[k];
}

// Least squares over arc length by `spans` spans; an open arc has its ends on the outline.
ArcSpline fit_arc(ArcSamples& samples, Scheme scheme, Index spans, const std::array<Point, 2>& ends) {
  std::optional<FitBasis> own;
  const FitBasis* basis = common_basis(scheme, spans);
  if (basis == nullptr) basis = &own.emplace(scheme, spans);
  const Index size = FitBasis::size(scheme, spans);
  const Index held = FitBasis::held(scheme);
  const Index unknowns = size - 2 * held;
  const double span = samples.length() / static_cast<double>(spans);
  ArcSpline fit{scheme, Points::Zero(size, 2)};
  fit.length = samples.length();
  if (held > 0) {
    fit.points.row(0) = ends[0].transpose();
    fit.points.row(size - 1) = ends[1].transpose();
  }
  Points right = Points::Zero(unknowns, 2);
  for (std::size_t n = 0; n < basis->at_nodes.size(); ++n) {
    const BasisRow& row = basis->at_nodes[n];
    const std::size_t g = n % gauss_node.size();
    const double u = static_cast<double>(n / gauss_node.size()) + gauss_node[g];
    Eigen::RowVector2d rest = samples.at(u * span).transpose();
    for (std::size_t a = 0; a < static_cast<std::size_t>(row.count); ++a) {
      if (FitBasis::unknown(scheme, size, row.index[a]) < 0) rest -= row.weight[a] * fit.points.row(row.index[a]);
    }
    for (std::size_t a = 0; a < static_cast<std::size_t>(row.count); ++a) {
      const Index i = FitBasis::unknown(scheme, size, row.index[a]);
      if (i >= 0) right.row(i) += gauss_weight[g] * row.weight[a] * rest;
    }
  }
  fit.points.middleRows(held, unknowns) = basis->normal.solve(std::move(right));
  const std::vector<Point>& outline = samples.even(looks_per_span * spans);
  for (std::size_t k = 0; k < outline.size(); ++k) {
    const BasisRow& row = basis->at_looks[k];
    Eigen::RowVector2d there = Eigen::RowVector2d::Zero();
    for (std::size_t a = 0; a < static_cast<std::size_t>(row.count); ++a)
      there += row.weight[a] * fit.points.row(row.index[a]);
    fit.distance = std::max(fit.distance, (there.transpose() - outline[k]).norm());
  }
  return fit;
}

}  // namespace

ProfileSystem spline_system(Scheme scheme, Eigen::Index size, Eigen::Index held) {
  const auto n = static_cast<int>(size - 2 * held);
  const int p = degree(scheme);
  std::vector<int> first;
  for (int i = 0; i < n; ++i) first.push_back(is_closed(scheme) && i + p >= n ? 0 : std::max(0, i - p));
  return ProfileSystem(std::move(first));
}

std::vector<ArcSpline> fit_arcs(const OutlineArcs& outline, const ArcwiseOptions& options) {
  if (!(options.tolerance > 0.0) || is_closed(options.open) || !is_closed(options.closed)) {
    throw InvalidInput(text("ArcwiseCurve: tolerance ", options.tolerance, ", or a scheme of the wrong kind"));
  }
  std::vector<ArcSpline> arcs;
  const auto add = [&](ArcSamples samples, double start, Scheme scheme, const std::array<Point, 2>& ends) {
    Index spans = is_closed(scheme) ? 4 : 1;
    int levels = 0;
    ArcSpline fit = fit_arc(samples, scheme, spans, ends);
    while (fit.distance > options.tolerance && 2 * spans <= options.most_spans) {
      spans *= 2;
      ++levels;
      fit = fit_arc(samples, scheme, spans, ends);
    }
    fit.levels = levels;
    fit.start = start;
    arcs.push_back(std::move(fit));
  };
  if (!outline.has_corner() || options.corners == Corners::Round) {  // it has no ends
    add({outline, -1, outline.length()}, 0.0, options.closed, {Point::Zero(), Point::Zero()});
    return arcs;
  }
  const BezierContour& contour = outline.contour();
  const std::vector<OutlineArcs::Arc>& own = outline.arcs();
  for (std::size_t k = 0; k < own.size(); ++k) {
    const int next = own[(k + 1) % own.size()].segments[0];
    const std::array<Point, 2> ends = {contour.point(contour.node(own[k].segments[0])),
                                       contour.point(contour.node(next))};
    if (own[k].is_line()) {
      arcs.push_back(line_spline(options.open, own[k].length, ends));
      arcs.back().start = own[k].start;
    } else {
      add({outline, static_cast<int>(k), own[k].length}, own[k].start, options.open, ends);
    }
  }
  return arcs;
}

ArcwiseCurve::Arc::Arc(const ArcSpline& spline)
    : curve(decompose(spline.scheme, spline.points, spline.levels)),
      start(spline.start),
      length(spline.length),
      distance(spline.distance) {}

double ArcwiseCurve::Arc::span_length() const {
  return length / static_cast<double>(detail_count(curve.scheme(), curve.size(curve.base().levels())));
}

double ArcwiseCurve::Arc::level_of_scale(double scale) const {
  if (!(scale >= 0.0)) throw InvalidInput(text("ArcwiseCurve: scale ", scale, " is not a length"));
  const MultiresCurve& base = curve.base();
  const auto fewest_spans = static_cast<double>(detail_count(base.scheme, base.coarse.rows()));
  const double level = std::log2(2.0 * length / (scale * fewest_spans));
  return std::clamp(level, 0.0, static_cast<double>(base.levels()));
}

ArcwiseCurve::ArcwiseCurve(const OutlineArcs& outline, const ArcwiseOptions& options) : length_(outline.length()) {
  for (const ArcSpline& spline : fit_arcs(outline, options)) arcs_.emplace_back(spline);
}

int ArcwiseCurve::arc_at(double s) const {
  s -= std::floor(s / length_) * length_;
  const auto after =
      std::upper_bound(arcs_.begin(), arcs_.end(), s, [](double x, const Arc& arc) { return x < arc.start; });
  return static_cast<int>(std::max<std::ptrdiff_t>(0, after - arcs_.begin() - 1));
}

Point ArcwiseCurve::evaluate(double s) const {
  s -= std::floor(s / length_) * length_;
  const Arc& arc = arcs_[static_cast<std::size_t>(arc_at(s))];
  return arc.curve.evaluate(arc.parameter(s)).transpose();
}

std::vector<Bezier> ArcwiseCurve::pieces(double scale, double tolerance) const {
  std::vector<Bezier> all;
  for (const Arc& arc : arcs_) {
    const double level = arc.level_of_scale(scale);
    const MultiresCurve shown = decompose(arc.curve.scheme(), arc.at_level(level), static_cast<int>(std::ceil(level)));
    const CompressedCurve compressed = compress(shown, tolerance);
    all.insert(all.end(), compressed.pieces.begin(), compressed.pieces.end());
  }
  return all;
}

Points ArcwiseCurve::span_ends(double scale) const {
  std::vector<Point> ends;
  for (const Arc& arc : arcs_) {
    const Coefficients control = arc.at_level(arc.level_of_scale(scale));
    const Index spans = detail_count(arc.curve.scheme(), control.rows());
    for (Index k = 0; k < spans; ++k)
      ends.emplace_back(fontcore::evaluate(arc.curve.scheme(), control, arc.parameter_at(static_cast<double>(k))));
  }
  Points rows(static_cast<Index>(ends.size()), 2);
  for (std::size_t i = 0; i < ends.size(); ++i) rows.row(static_cast<Index>(i)) = ends[i].transpose();
  return rows;
}

void ArcwiseCurve::refine(int arc, double from, double to, int more) {
  Arc& at = this->arc(arc);
  at.curve.refine(at.parameter(from), at.parameter(to), at.curve.base().levels() + more);
}

namespace {

// The polynomial of one span of a level.
Bezier span_curve(Scheme scheme, const Coefficients& points, Eigen::Index span) {
  const double from = static_cast<double>(span) - (is_closed(scheme) ? 0.5 : 0.0);
  const auto at = [&](double u) { return Point(evaluate(scheme, points, from + u).transpose()); };
  Bezier b;
  b.degree = degree(scheme);
  b.p[0] = at(0.0);
  if (b.degree == 2) {
    b.p[2] = at(1.0);
    b.p[1] = 2.0 * at(0.5) - 0.5 * (b.p[0] + b.p[2]);
  } else {  // through its values at thirds
    const Point f1 = at(1.0 / 3.0);
    const Point f2 = at(2.0 / 3.0);
    b.p[3] = at(1.0);
    b.p[1] = (-5.0 * b.p[0] + 18.0 * f1 - 9.0 * f2 + 2.0 * b.p[3]) / 6.0;
    b.p[2] = (2.0 * b.p[0] - 9.0 * f1 + 18.0 * f2 - 5.0 * b.p[3]) / 6.0;
  }
  return b;
}

// Two polynomials of one degree differ nowhere by more.
double coefficient_distance(const Bezier& a, const Bezier& b) {
  double largest = 0.0;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(a.degree); ++k)
    largest = std::max(largest, (a.p[k] - b.p[k]).norm());
  return largest;
}

class Compressor {
 public:
  Compressor(const MultiresCurve& curve, double tolerance) : tolerance_(tolerance) {
    const Scheme scheme = curve.scheme;
    Coefficients points = curve.coarse;
    for (int level = 0;; ++level) {
      const Eigen::Index spans = detail_count(scheme, points.rows());
      auto& own = spans_.emplace_back();
      for (Eigen::Index i = 0; i < spans; ++i) own.push_back(span_curve(scheme, points, i));
      if (level == curve.levels()) break;
      points = synthesize(scheme, points, curve.details[static_cast<std::size_t>(level)]);
    }
    // Of a closed curve the halves of span i are 2i - 1 and 2i: coarse piece i over [i - 1/2, i + 1/2], t' = 2t - 1/2.
    shift_ = is_closed(scheme) ? 1 : 0;
    is_closed_ = is_closed(scheme);
    is_split_.resize(spans_.size());
    for (std::size_t level = 0; level < spans_.size(); ++level) is_split_[level].assign(spans_[level].size(), false);
  }

  CompressedCurve run() {
    for (;;) {
      std::vector<Place> places;
      for (std::size_t i = 0; i < spans_[0].size(); ++i) choose({0, static_cast<long>(i)}, places);
      CompressedCurve result;
      for (const Place& place : places) {
        result.pieces.push_back(span(place));
        result.levels.push_back(static_cast<int>(place.level));
      }
      const std::size_t count = places.size();
      for (std::size_t i = is_closed_ ? 0 : 1; i < count; ++i) {
        Bezier& before = result.pieces[i == 0 ? count - 1 : i - 1];
        Bezier& after = result.pieces[i];
        Point& end = before.p[static_cast<std::size_t>(before.degree)];
        end = after.p[0] = 0.5 * (end + after.p[0]);
      }
      // Where the ends' going to the middle takes a piece too far, it is split after all.
      bool is_within = true;
      for (std::size_t i = 0; i < count; ++i) {
        const double bound = distance(result.pieces[i], places[i]);
        result.bound = std::max(result.bound, bound);
        if (bound <= tolerance_ || places[i].level + 1 == spans_.size()) continue;
        is_split_[places[i].level][static_cast<std::size_t>(places[i].index)] = true;
        is_within = false;
      }
      if (is_within) return result;
    }
  }

 private:
  struct Place {
    std::size_t level;
    long index;
  };

  const Bezier& span(const Place& place) const { return spans_[place.level][static_cast<std::size_t>(place.index)]; }
  std::array<Place, 2> halves(const Place& place) const {
    const std::size_t level = place.level + 1;
    const long count = static_cast<long>(spans_[level].size());
    return {Place{level, (2 * place.index - shift_ + count) % count}, Place{level, 2 * place.index + 1 - shift_}};
  }

  // How far a polynomial over a span is from the finest level, at most.
  double distance(const Bezier& b, const Place& place) const {
    if (place.level + 1 == spans_.size()) return coefficient_distance(b, span(place));
    const auto half = split(b, 0.5);
    const auto below = halves(place);
    return std::max(distance(half[0], below[0]), distance(half[1], below[1]));
  }

  void choose(const Place& place, std::vector<Place>& to) const {
    const bool is_finest = place.level + 1 == spans_.size();
    const bool is_split = is_split_[place.level][static_cast<std::size_t>(place.index)];
    if (is_finest || (!is_split && distance(span(place), place) <= tolerance_)) {
      to.push_back(place);
      return;
    }
    for (const Place& half : halves(place)) choose(half, to);
  }

  double tolerance_;
  std::vector<std::vector<Bezier>> spans_;  // per level
  std::vector<std::vector<bool>> is_split_;
  long shift_ = 0;
  bool is_closed_ = false;
};

}  // namespace

CompressedCurve compress(const MultiresCurve& curve, double tolerance) {
  if (!(tolerance >= 0.0)) throw InvalidInput(text("compress: the tolerance is ", tolerance));
  if (curve.coarse.cols() != 2)
    throw InvalidInput(text("compress: the curve has ", static_cast<long>(curve.coarse.cols()), " columns, not 2"));
  return Compressor(curve, tolerance).run();
}

}  // namespace fontcore
