#include "fontcore/outline_curve.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "fontcore/error.h"

namespace fontcore {

namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr int samples_per_piece = 8;
constexpr double first_look = 1.5;      // tolerances: what is further off at a first look is not worth measuring
constexpr int most_samples = 20000;     // of either curve when the distance is measured
constexpr double sample_spacing = 3.0;  // of the distance's samples, in tolerances: 0.75/1000 em, far below a piece

int wrapped(int i, int n) { return ((i % n) + n) % n; }

// Whole numbers that sum to `total`, at least `floor`, otherwise as near to proportional as largest remainders allow.
std::vector<int> share_out(const std::vector<double>& weights, int total, const std::vector<int>& floor) {
  const std::size_t n = weights.size();
  const auto wanted = [&](std::size_t k, double scale) {
    return std::max(static_cast<double>(floor[k]), scale * weights[k]);
  };
  double low = 0.0;
  double high = total / std::max(*std::min_element(weights.begin(), weights.end()), 1e-12);
  for (int round = 0; round < 100; ++round) {
    const double scale = 0.5 * (low + high);
    double sum = 0.0;
    for (std::size_t k = 0; k < n; ++k) sum += wanted(k, scale);
    (sum > total ? high : low) = scale;
  }
  std::vector<int> shares(n);
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t k = 0; k < n; ++k) shares[k] = static_cast<int>(std::floor(wanted(k, low) + 1e-9));
  const auto remainder = [&](std::size_t k) { return wanted(k, low) - shares[k]; };
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return remainder(a) > remainder(b); });
  int rest = total - std::accumulate(shares.begin(), shares.end(), 0);
  for (std::size_t k = 0; rest > 0; k = (k + 1) % n, --rest) ++shares[order[k]];
  return shares;
}

// Arc-length coefficients of one arc: the legs between them vary least while the ends of spans fall on knots.
struct ArcLegs {
  std::vector<double> coefficients;
  std::vector<bool> on_knot;  // for every span, whether its start does
};

// A straight half span lies at each end of an arc with corners; a first leg of half its neighbour halves the error made
// there.
constexpr double corner_leg_ratio = 0.5;
constexpr int most_knots_given_up = 16;

ArcLegs solve_legs(const std::vector<double>& lengths, const std::vector<int>& pieces, bool closed) {
  const int n = std::accumulate(pieces.begin(), pieces.end(), 0);
  const double total = std::accumulate(lengths.begin(), lengths.end(), 0.0);
  const int legs = closed ? n : n - 1;
  const double mean = total / legs;
  ArcLegs result{std::vector<double>(static_cast<std::size_t>(n)), std::vector<bool>(lengths.size(), true)};

  std::vector<double> span_length = lengths;
  std::vector<int> span_pieces = pieces;
  std::vector<std::size_t> span_start(lengths.size());
  std::iota(span_start.begin(), span_start.end(), std::size_t{0});
  double shortest = 1.0;
  for (std::size_t k = 0; k < lengths.size(); ++k) shortest = std::min(shortest, lengths[k] / pieces[k] / mean);

  Eigen::VectorXd leg = Eigen::VectorXd::Constant(legs, mean);
  for (int given_up = 0; legs > 1; ++given_up) {
    // min |D l|^2 under one row for every span: l[first - 1]/2 + l[first] + .. + l[last - 2] + l[last - 1]/2 = its
    // length.
    const int rows = static_cast<int>(span_length.size());
    Triplets entries;
    for (int k = 0; k < legs; ++k) entries.emplace_back(k, k, 1e-9);
    for (int k = 0; k + (closed ? 0 : 1) < legs; ++k) {
      const int next = (k + 1) % legs;
      const double a = !closed && k + 1 == legs - 1 && legs > 2 ? corner_leg_ratio : 1.0;
      const double b = !closed && k == 0 && legs > 2 ? corner_leg_ratio : 1.0;
      entries.emplace_back(k, k, a * a);
      entries.emplace_back(next, next, b * b);
      entries.emplace_back(k, next, -a * b);
      entries.emplace_back(next, k, -a * b);
    }
    Eigen::VectorXd right = Eigen::VectorXd::Zero(legs + rows);
    for (int r = 0, first = 0; r < rows; first += span_pieces[static_cast<std::size_t>(r)], ++r) {
      const int last = first + span_pieces[static_cast<std::size_t>(r)];
      const auto add = [&](int k, double weight) {
        if (!closed && (k < 0 || k >= legs)) return;
        entries.emplace_back(legs + r, wrapped(k, legs), weight);
        entries.emplace_back(wrapped(k, legs), legs + r, weight);
      };
      add(first - 1, 0.5);
      for (int k = first; k <= last - 2; ++k) add(k, 1.0);
      add(last - 1, 0.5);
      entries.emplace_back(legs + r, legs + r, -1e-12);  // dependent rows (all spans one piece) must not be singular
      right[legs + r] = span_length[static_cast<std::size_t>(r)] / mean;
    }
    Eigen::SparseMatrix<double> system(legs + rows, legs + rows);
    system.setFromTriplets(entries.begin(), entries.end());
    Eigen::SparseLU<Eigen::SparseMatrix<double>> factor(system);
    if (factor.info() == Eigen::Success) {
      const Eigen::VectorXd solution = factor.solve(right);
      const Eigen::VectorXd defect = (system * solution - right).tail(rows);
      if (solution.head(legs).minCoeff() > 0.05 * shortest && defect.cwiseAbs().maxCoeff() < 1e-9) {
        leg = solution.head(legs) * mean;
        break;
      }
    }
    // Legs too uneven: the knot beside the shortest pieces is given up, and the two spans share one row.
    if (rows == 1 || given_up == most_knots_given_up) {
      leg.setConstant(mean);
      std::fill(result.on_knot.begin() + 1, result.on_knot.end(), false);
      break;
    }
    const auto per_piece = [&](std::size_t k) { return span_length[k] / span_pieces[k]; };
    std::size_t worst = 1;
    for (std::size_t k = 1; k < span_length.size(); ++k) {
      if (std::min(per_piece(k - 1), per_piece(k)) < std::min(per_piece(worst - 1), per_piece(worst))) worst = k;
    }
    result.on_knot[span_start[worst]] = false;
    span_length[worst - 1] += span_length[worst];
    span_pieces[worst - 1] += span_pieces[worst];
    const auto gone = static_cast<std::ptrdiff_t>(worst);
    span_length.erase(span_length.begin() + gone);
    span_pieces.erase(span_pieces.begin() + gone);
    span_start.erase(span_start.begin() + gone);
  }
  double s = closed ? 0.5 * leg[legs - 1] : 0.0;
  for (int k = 0; k < n; ++k) {
    result.coefficients[static_cast<std::size_t>(k)] = s;
    if (k < legs) s += leg[k];
  }
  if (!closed) result.coefficients.back() = total;
  return result;
}

}  // namespace

OutlineArcs::OutlineArcs(const BezierContour& contour, const OutlineCurveOptions& options) : contour_(contour) {
  if (contour.point_count() < 3) {
    throw InvalidInput(text("OutlineCurve: a contour of ", contour.point_count(), " points has no inside"));
  }
  along_.reserve(static_cast<std::size_t>(contour.segment_count()));
  for (int s = 0; s < contour.segment_count(); ++s) along_.emplace_back(contour.segment(s));
  for (const auto& table : along_) length_ += table.length();
  if (signed_area(contour) == 0.0)
    throw InvalidInput(text("OutlineCurve: a contour of length ", length_, " has no area"));

  // Cut at corners into arcs, and those into spans: the stretches between nodes that must lie on knots.
  const std::vector<double> turns = turning_angles(contour_);
  std::vector<int> solid;
  for (int s = 0; s < contour_.segment_count(); ++s) {
    if (along_[static_cast<std::size_t>(s)].length() > 0.0) solid.push_back(s);
  }
  const std::size_t n = solid.size();
  is_corner_.assign(static_cast<std::size_t>(contour_.segment_count()), false);
  std::vector<bool> is_cut(n, false);
  bool any_cut = false;
  for (std::size_t k = 0; k < n; ++k) {
    const int here = solid[k];
    const int before = solid[(k + n - 1) % n];
    const bool line_before = contour_.degree(before) == 1;
    const bool line_here = contour_.degree(here) == 1;
    const double turn = std::abs(turns[static_cast<std::size_t>(here)]);
    const bool is_marked =
        std::find(options.corners.begin(), options.corners.end(), contour_.node(here)) != options.corners.end();
    const bool corner =
        is_marked || turn > options.corner_angle || ((line_before || line_here) && turn > options.line_angle);
    const Point tangent = start_tangent(contour_.segment(here));
    const bool extremum = tangent.cwiseAbs().minCoeff() < 1e-3 && !(line_before && line_here);
    const bool implied = contour_.kind(contour_.node(here)) == PointKind::ImpliedNode;
    is_corner_[static_cast<std::size_t>(here)] = corner;
    is_cut[k] = corner || line_before || line_here || extremum || !implied;
    has_corner_ = has_corner_ || corner;
    any_cut = any_cut || is_cut[k];
  }
  if (!any_cut) is_cut[0] = true;
  if (has_corner_) arcs_.reserve(static_cast<std::size_t>(std::count(is_corner_.begin(), is_corner_.end(), true)));
  std::size_t start = 0;
  while (has_corner_ ? !is_corner(solid[start]) : !is_cut[start]) ++start;

  arc_of_.assign(static_cast<std::size_t>(contour_.segment_count()), 0);
  offset_of_.assign(static_cast<std::size_t>(contour_.segment_count()), 0.0);
  for (std::size_t step = 0; step < n; ++step) {
    const std::size_t k = (start + step) % n;
    const auto s = static_cast<std::size_t>(solid[k]);
    if (arcs_.empty() || is_corner_[s]) {
      const double begin = arcs_.empty() ? 0.0 : arcs_.back().start + arcs_.back().length;
      arcs_.emplace_back().start = begin;
    }
    Arc& arc = arcs_.back();
    if (arc.spans.empty() || is_cut[k]) arc.spans.push_back({static_cast<int>(arc.segments.size())});
    Span& span = arc.spans.back();
    ++span.count;
    span.length += along_[s].length();
    span.is_line = span.count == 1 && contour_.degree(solid[k]) == 1;
    arc_of_[s] = static_cast<int>(arcs_.size()) - 1;
    offset_of_[s] = arc.length;
    arc.segments.push_back(solid[k]);
    arc.offsets.push_back(arc.length);
    arc.length += along_[s].length();
  }
  // A segment of no length starts where the next one with length does.
  const int count = contour_.segment_count();
  for (int s = count - 1, seen = 0; seen < 2 * count; s = contour_.previous(s), ++seen) {
    const auto here = static_cast<std::size_t>(s);
    if (along_[here].length() > 0.0) continue;
    const auto next = static_cast<std::size_t>(contour_.next(s));
    is_corner_[here] = is_corner_[next];
    arc_of_[here] = arc_of_[next];
    offset_of_[here] = offset_of_[next];
  }
}

bool OutlineArcs::is_straight() const {
  return std::all_of(arcs_.begin(), arcs_.end(), [](const Arc& arc) { return arc.is_line(); });
}

OutlineArcs::Location OutlineArcs::locate(int arc, double s) const {
  const Arc& on = arcs_[static_cast<std::size_t>(arc)];
  if (!has_corner_) s -= std::floor(s / on.length) * on.length;
  const auto above = std::upper_bound(on.offsets.begin(), on.offsets.end(), s);
  const auto k = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, above - on.offsets.begin() - 1));
  const int segment = on.segments[k];
  return {segment, along(segment).inverse(s - on.offsets[k])};
}

OutlineArcs::Location OutlineArcs::locate(double s) const {
  s -= std::floor(s / length_) * length_;
  const auto after =
      std::upper_bound(arcs_.begin(), arcs_.end(), s, [](double x, const Arc& arc) { return x < arc.start; });
  const auto arc = after - arcs_.begin() - 1;
  const Arc& on = arcs_[static_cast<std::size_t>(arc)];
  return locate(static_cast<int>(arc), std::min(s - on.start, on.length));
}

OutlineCurve::OutlineCurve(const BezierContour& contour, const OutlineCurveOptions& options)
    : outline_(contour, options) {
  for (const OutlineArcs::Arc& arc : outline_.arcs()) {
    arcs_.push_back({static_cast<int>(arcs_.size()), 0, 0, arc.length, arc.start});
  }
  double nearest = std::numeric_limits<double>::infinity();
  double worth_trying = options.fewest;
  for (int scale = 1; 4 * scale <= options.most; scale *= 2) {
    for (int d = 4; d <= 7 && d * scale <= options.most; ++d) {
      if (d * scale < worth_trying) continue;
      const double off = fit(d * scale, options.tolerance);
      if (off > first_look * options.tolerance) {
        // No outline's error falls faster than with the fourth power: sizes that would need more are passed over.
        if (std::isfinite(off)) worth_trying = d * scale * std::pow(off / (first_look * options.tolerance), 0.25);
        continue;
      }
      distance_ = measure_distance(options.tolerance);
      nearest = std::min(nearest, distance_);
      if (distance_ <= options.tolerance) return;
    }
  }
  throw InvalidInput(text("OutlineCurve: no spline of up to ", options.most, " control points is within ",
                          options.tolerance, " units; the nearest is ", nearest, " away"));
}

int OutlineCurve::levels() const {
  int count = 0;
  for (int n = size(); n % 2 == 0 && n / 2 >= 4; n /= 2) ++count;
  return count;
}

// Builds the model with `size` control points. Returns how far it is off at a first look, at equal parameters and off
// the tangent; infinity if the spans need more pieces than that.
double OutlineCurve::fit(int size, double tolerance) {
  const bool has_corner = outline_.has_corner();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  // Fewest pieces: a line from corner to corner 2, a line inside an arc 1, a curved span 2, an arc 4.
  std::vector<int> floor;
  std::vector<double> weights;
  for (const auto& [start, length, segments, offsets, spans] : outline_.arcs()) {
    const std::size_t first = floor.size();
    for (const OutlineArcs::Span& span : spans) {
      floor.push_back(span.is_line ? 1 : 2);
      weights.push_back(span.length);
    }
    if (spans.size() == 1 && spans[0].is_line && has_corner) {
      floor[first] = 2;
      continue;
    }
    if (has_corner) {  // the first piece at a corner is half a span long
      floor[first] = std::max(floor[first], 2);
      floor.back() = std::max(floor.back(), 2);
    }
    const int sum = std::accumulate(floor.begin() + static_cast<std::ptrdiff_t>(first), floor.end(), 0);
    floor[first] += std::max(0, 4 - sum);
  }
  if (std::accumulate(floor.begin(), floor.end(), 0) > size) return infinity;
  const std::vector<int> shares = share_out(weights, size, floor);

  control_points_ = Points::Zero(size, 2);
  arc_length_coefficients_ = Eigen::VectorXd::Zero(size);
  corner_pairs_.clear();
  std::vector<bool> pinned(static_cast<std::size_t>(size), false);
  std::vector<std::vector<bool>> knot_kept;
  std::size_t next_share = 0;
  int first = 0;
  for (Arc& arc : arcs_) {
    std::vector<double> lengths;
    std::vector<int> pieces;
    for (const OutlineArcs::Span& span : outline_.arcs()[static_cast<std::size_t>(arc.index)].spans) {
      lengths.push_back(span.length);
      pieces.push_back(shares[next_share++]);
    }
    const ArcLegs legs = solve_legs(lengths, pieces, !has_corner);
    knot_kept.push_back(legs.on_knot);
    arc.first = first;
    arc.size = static_cast<int>(legs.coefficients.size());
    for (int k = 0; k < arc.size; ++k)
      arc_length_coefficients_[first + k] = legs.coefficients[static_cast<std::size_t>(k)];
    first += arc.size;
  }
  const auto pin = [&](int i, const Point& where) {
    control_points_.row(wrapped(i, size)) = where;
    pinned[static_cast<std::size_t>(wrapped(i, size))] = true;
  };
  next_share = 0;
  for (const Arc& arc : arcs_) {
    const OutlineArcs::Arc& own = outline_.arcs()[static_cast<std::size_t>(arc.index)];
    int local = 0;
    for (const OutlineArcs::Span& span : own.spans) {
      const int pieces = shares[next_share++];
      if (span.is_line) {  // its control points, and the one beyond each smooth end, on the line
        const int segment = own.segments[static_cast<std::size_t>(span.first)];
        const Bezier line = contour().segment(segment);
        const Point direction = (line.p[1] - line.p[0]) / span.length;
        const double offset = outline_.offset_of(segment);
        for (int k = local - 1; k <= local + pieces; ++k) {
          if (has_corner && (k < 0 || k >= arc.size)) continue;
          pin(arc.first + wrapped(k, arc.size), line.p[0] + (coefficient(arc, k) - offset) * direction);
        }
      }
      local += pieces;
    }
    if (has_corner) {
      corner_pairs_.push_back(wrapped(arc.first - 1, size));
      pin(arc.first, contour().segment(own.segments.front()).start());
      pin(arc.first + arc.size - 1, contour().segment(own.segments.back()).end());
    }
  }
  std::sort(corner_pairs_.begin(), corner_pairs_.end());

  // Least squares at samples of equal parameter: the normal matrix of a piece is always the same.
  Eigen::Matrix<double, samples_per_piece, 3> basis;
  for (int k = 0; k < samples_per_piece; ++k) basis.row(k) = spline_weights((k + 0.5) / samples_per_piece);
  const Eigen::Matrix3d gram = basis.transpose() * basis;
  std::vector<int> column(static_cast<std::size_t>(size), -1);
  int unknowns = 0;
  for (int i = 0; i < size; ++i) {
    if (!pinned[static_cast<std::size_t>(i)]) column[static_cast<std::size_t>(i)] = unknowns++;
  }
  Points samples(size * samples_per_piece, 2);
  for (const Arc& arc : arcs_) {
    for (int k = 0; k < arc.size * samples_per_piece; ++k) {
      const double t = arc.first - 0.5 + (k + 0.5) / samples_per_piece;
      const Location at = outline_.locate(arc.index, arc_length_in(arc, t));
      samples.row(arc.first * samples_per_piece + k) = evaluate(contour().segment(at.segment), at.u);
    }
  }
  // Sample row block i covers t in [i - 1/2, i + 1/2]: piece i.
  Triplets entries;
  Points right = Points::Zero(unknowns, 2);
  for (int i = 0; i < size; ++i) {
    const Eigen::Matrix<double, 3, 2> moment =
        basis.transpose() * samples.middleRows<samples_per_piece>(i * samples_per_piece);
    for (int p = 0; p < 3; ++p) {
      const int row = column[static_cast<std::size_t>(wrapped(i - 1 + p, size))];
      if (row < 0) continue;
      right.row(row) += moment.row(p);
      for (int q = 0; q < 3; ++q) {
        const int j = wrapped(i - 1 + q, size);
        const int col = column[static_cast<std::size_t>(j)];
        if (col < 0) {
          right.row(row) -= gram(p, q) * control_points_.row(j);
        } else if (col <= row) {
          entries.emplace_back(row, col, gram(p, q));
        }
      }
    }
  }
  if (unknowns > 0) {
    Eigen::SparseMatrix<double> normal(unknowns, unknowns);
    normal.setFromTriplets(entries.begin(), entries.end());
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor(normal);
    if (factor.info() != Eigen::Success) return infinity;
    const Points solved = factor.solve(right);
    for (int i = 0; i < size; ++i) {
      if (column[static_cast<std::size_t>(i)] >= 0)
        control_points_.row(i) = solved.row(column[static_cast<std::size_t>(i)]);
    }
  }
  place_nodes(shares, knot_kept);

  double worst = 0.0;
  for (int i = 0; i < size; ++i) {
    Eigen::Matrix<double, 3, 2> controls;
    for (int p = 0; p < 3; ++p) controls.row(p) = control_points_.row(wrapped(i - 1 + p, size));
    const Eigen::Matrix<double, samples_per_piece, 2> error =
        basis * controls - samples.middleRows<samples_per_piece>(i * samples_per_piece);
    for (int k = 0; k < samples_per_piece; ++k) {
      const Point tangent = (controls.row(1) - controls.row(0)) * (1.0 - (k + 0.5) / samples_per_piece) +
                            (controls.row(2) - controls.row(1)) * ((k + 0.5) / samples_per_piece);
      const Point e = error.row(k);
      const double speed = tangent.norm();
      const double off = speed > tolerance ? std::abs(cross(e, tangent)) / speed : 0.0;
      worst = std::max(worst, off);
    }
  }
  return worst;
}

void OutlineCurve::place_nodes(const std::vector<int>& pieces, const std::vector<std::vector<bool>>& knot_kept) {
  nodes_.assign(static_cast<std::size_t>(contour().segment_count()), Node{});
  std::size_t next = 0;
  for (const Arc& arc : arcs_) {
    const auto a = static_cast<std::size_t>(arc.index);
    const auto& [start, length, segments, offsets, spans] = outline_.arcs()[a];
    int local = 0;
    for (std::size_t k = 0; k < spans.size(); ++k) {
      for (int i = 0; i < spans[k].count; ++i) {
        const int s = segments[static_cast<std::size_t>(spans[k].first + i)];
        Node& node = nodes_[static_cast<std::size_t>(s)];
        node.is_corner = outline_.is_corner(s);
        node.is_knot = i == 0 && knot_kept[a][k];
        node.t = node.is_knot ? arc.first - 0.5 + local : parameter_in(arc, outline_.offset_of(s));
      }
      local += pieces[next++];
    }
  }
  // A segment of no length starts where the next one with length does.
  const int n = contour().segment_count();
  for (int s = n - 1, seen = 0; seen < 2 * n; s = (s + n - 1) % n, ++seen) {
    if (outline_.along(s).length() == 0.0)
      nodes_[static_cast<std::size_t>(s)] = nodes_[static_cast<std::size_t>((s + 1) % n)];
  }
}

// Arc-length coefficient k of an arc, beyond its ends too: repeated at a corner, carried on round a closed arc.
double OutlineCurve::coefficient(const Arc& arc, int k) const {
  if (outline_.has_corner()) return arc_length_coefficients_[arc.first + std::clamp(k, 0, arc.size - 1)];
  const int turn = k < 0 ? -1 : k >= arc.size ? 1 : 0;
  return arc_length_coefficients_[arc.first + k - turn * arc.size] + turn * arc.length;
}

double OutlineCurve::arc_length_in(const Arc& arc, double t) const {
  const double x = t - (arc.first - 0.5);
  const int k = std::clamp(static_cast<int>(std::floor(x)), 0, arc.size - 1);
  const Eigen::Vector3d weight = spline_weights(x - k);
  return weight[0] * coefficient(arc, k - 1) + weight[1] * coefficient(arc, k) + weight[2] * coefficient(arc, k + 1);
}

double OutlineCurve::parameter_in(const Arc& arc, double s) const {
  const auto knot = [&](int k) { return 0.5 * (coefficient(arc, k - 1) + coefficient(arc, k)); };
  int low = 0;
  int high = arc.size;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (knot(middle) <= s ? low : high) = middle;
  }
  const double a = coefficient(arc, low - 1);
  const double b = coefficient(arc, low);
  const double c = coefficient(arc, low + 1);
  // s = (a + b)/2 + (b - a) u + (a - 2b + c)/2 u^2, by the root formula that does not cancel.
  const double rest = std::max(0.0, s - 0.5 * (a + b));
  const double linear = b - a;
  const double root = std::sqrt(std::max(0.0, linear * linear + 2.0 * (a - 2.0 * b + c) * rest));
  const double u = linear + root > 0.0 ? std::min(1.0, 2.0 * rest / (linear + root)) : 0.0;
  return arc.first - 0.5 + low + u;
}

const OutlineCurve::Arc& OutlineCurve::arc_at(double t) const {
  const auto after =
      std::upper_bound(arcs_.begin(), arcs_.end(), t, [](double x, const Arc& arc) { return x < arc.first - 0.5; });
  return after == arcs_.begin() ? arcs_.back() : *(after - 1);
}

namespace {

double into_period(double t, int n) { return t - std::floor((t + 0.5) / n) * n; }  // [-1/2, n - 1/2)

}  // namespace

double OutlineCurve::parameter(int segment, double u) const {
  const auto s = static_cast<std::size_t>(segment);
  if (u <= 0.0) return into_period(nodes_[s].t, size());
  if (u >= 1.0) return into_period(nodes_[static_cast<std::size_t>(contour().next(segment))].t, size());
  const Arc& arc = arcs_[static_cast<std::size_t>(outline_.arc_of(segment))];
  return into_period(parameter_in(arc, outline_.offset_of(segment) + outline_.along(segment).at(u)), size());
}

OutlineCurve::Location OutlineCurve::locate(double t) const {
  t = into_period(t, size());
  const Arc& arc = arc_at(t);
  return outline_.locate(arc.index, arc_length_in(arc, t));
}

Point OutlineCurve::outline_at(double t) const {
  const Location at = locate(t);
  return evaluate(contour().segment(at.segment), at.u);
}

Point OutlineCurve::spline_at(double t) const { return evaluate(Scheme::Chaikin, control_points_, t).transpose(); }

std::vector<OutlineCurve::ArcRange> OutlineCurve::arcs() const {
  std::vector<ArcRange> ranges;
  for (const Arc& arc : arcs_) {
    const int segment = outline_.arcs()[static_cast<std::size_t>(arc.index)].segments[0];
    ranges.push_back({arc.first, arc.size, segment, arc.start, arc.length});
  }
  return ranges;
}

std::pair<int, double> OutlineCurve::along(double t) const {
  t = into_period(t, size());
  const Arc& arc = arc_at(t);
  return {arc.index, arc_length_in(arc, t)};
}

double OutlineCurve::arc_length(double t0, double t1) const {
  const auto from_start = [&](double t) {
    const double within = into_period(t, size());
    const Arc& arc = arc_at(within);
    return std::round((t - within) / size()) * length() + arc.start + arc_length_in(arc, within);
  };
  return from_start(t1) - from_start(t0);
}

double OutlineCurve::measure_distance(double tolerance) const {
  const double step = std::max(sample_spacing * tolerance, length() / most_samples);
  const int n = size();
  const int per_piece = std::max(4, static_cast<int>(std::ceil(1.2 * length() / step / n)));
  Points spline(n * per_piece, 2);
  for (int k = 0; k < per_piece; ++k) {
    const Eigen::Vector3d weight = spline_weights(static_cast<double>(k) / per_piece);
    for (int i = 0; i < n; ++i) {
      spline.row(i * per_piece + k) = weight[0] * control_points_.row(i == 0 ? n - 1 : i - 1) +
                                      weight[1] * control_points_.row(i) +
                                      weight[2] * control_points_.row(i + 1 == n ? 0 : i + 1);
    }
  }
  return two_sided_distance(to_polyline(contour(), step), spline, tolerance);
}

}  // namespace fontcore
