#include "fontcore/fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr int samples_per_segment = 9;
constexpr double stiffness = 0.4;  // of the breadth: length over which a displacement's slope weighs as much as itself
constexpr double shortest_stretch = 1e-3;   // of a segment: what a sample's stretch is at least taken for, at cusps
constexpr double ridge = 1e-7;              // of the mean diagonal: keeps points without samples at rest
constexpr double most_throw = 3.0;          // a handle that throws a point further than this many moves is not forced
constexpr double most_throw_pinned = 10.0;  // the same of a handle that must land
constexpr double gentle_throw = 1.25;       // and one that throws none further than this needs no more room
constexpr double landed = 1e-9;             // font units

// The wish at samples of every released segment, as least squares on its control points: the displacement and its slope
// along the outline. Without the slope a short segment weighs little and is folded over when the area is given back.
struct WishSystem {
  std::vector<Eigen::Triplet<double>> H;  // 2n×2n
  Eigen::VectorXd f;
  struct Sample {
    int segment;
    std::array<double, 4> weight;
    Point wish;
  };
  std::vector<Sample> samples;
};

// Bernstein weights in the middle of every sample's stretch, and what they gain over it.
struct SampleWeights {
  std::array<double, samples_per_segment> u;  // in the middle
  std::array<double, samples_per_segment> end;
  std::array<std::array<double, 4>, samples_per_segment> weight;
  std::array<std::array<double, 4>, samples_per_segment> change;
};

const SampleWeights& sample_weights(int degree) {
  const auto make = [](int of_degree) {
    SampleWeights samples{};
    for (std::size_t k = 0; k < samples_per_segment; ++k) {
      const double u0 = static_cast<double>(k) / samples_per_segment;
      const double u1 = static_cast<double>(k + 1) / samples_per_segment;
      samples.u[k] = 0.5 * (u0 + u1);
      samples.end[k] = u1;
      samples.weight[k] = bernstein(of_degree, samples.u[k]);
      const auto from = bernstein(of_degree, u0);
      samples.change[k] = bernstein(of_degree, u1);
      for (std::size_t a = 0; a < from.size(); ++a) samples.change[k][a] -= from[a];
    }
    return samples;
  };
  static const std::array<SampleWeights, 3> made = {make(1), make(2), make(3)};
  return made[static_cast<std::size_t>(degree - 1)];
}

WishSystem wish_system(const OutlineArcs& outline, const Wish& wish, const StructureEdit& edit,
                       const std::vector<bool>& released) {
  const BezierContour& contour = outline.contour();
  const auto n = contour.point_count();
  WishSystem system{{}, Eigen::VectorXd::Zero(2 * n), {}};
  std::vector<Eigen::Triplet<double>>& entries = system.H;
  const auto segments = static_cast<std::size_t>(contour.segment_count());
  entries.reserve(32 * segments);
  system.samples.reserve(samples_per_segment * segments);
  double trace = 0.0;
  const double stiff = stiffness * edit.breadth;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const ArcLength& along = outline.along(s);
    if (!released[static_cast<std::size_t>(s)] || along.length() == 0.0) continue;
    const auto points = static_cast<std::size_t>(contour.degree(s)) + 1;
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();  // of the segment's points, x and y alike
    std::array<Point, 4> right{Point::Zero(), Point::Zero(), Point::Zero(), Point::Zero()};
    const auto ask = [&](const std::array<double, 4>& weight, double importance, const Point& value) {
      for (std::size_t a = 0; a < points; ++a) {
        const double wa = importance * weight[a];
        right[a] += wa * value;
        for (std::size_t b = 0; b < points; ++b) normal(static_cast<int>(a), static_cast<int>(b)) += wa * weight[b];
      }
    };
    Point before = wish(s, 0.0, 0.0);
    double s0 = 0.0;
    const SampleWeights& samples = sample_weights(contour.degree(s));
    for (std::size_t k = 0; k < samples_per_segment; ++k) {
      const Point value = wish(s, samples.u[k], along.at(samples.u[k]));
      ask(samples.weight[k], along.length() / samples_per_segment, value);
      system.samples.push_back({s, samples.weight[k], value});
      // The change of the displacement over the sample's stretch, as the wish has it.
      const double s1 = along.at(samples.end[k]);
      const Point after = wish(s, samples.end[k], s1);
      const double stretch = std::max(s1 - s0, shortest_stretch * along.length());
      ask(samples.change[k], stiff * stiff / stretch, after - before);
      before = after;
      s0 = s1;
    }
    for (std::size_t a = 0; a < points; ++a) {
      const int p = contour.point_of(s, static_cast<int>(a));
      system.f.segment<2>(2 * p) += right[a];
      for (std::size_t b = 0; b < points; ++b) {
        const int q = contour.point_of(s, static_cast<int>(b));
        const double entry = normal(static_cast<int>(a), static_cast<int>(b));
        entries.emplace_back(2 * p, 2 * q, entry);
        entries.emplace_back(2 * p + 1, 2 * q + 1, entry);
        if (p == q) trace += 2.0 * entry;
      }
    }
  }
  const double small = ridge * (trace > 0.0 ? trace / static_cast<double>(2 * n) : 1.0);
  for (int v = 0; v < 2 * n; ++v) entries.emplace_back(v, v, small);
  return system;
}

// Segments nearer along the outline to a handle than `reach`; for a breadth of at most a quarter of the contour, the
// nearest of them, no more than half of all.
std::vector<bool> released_segments(const OutlineArcs& outline, const StructureEdit& edit, double reach) {
  const BezierContour& contour = outline.contour();
  const int n = contour.segment_count();
  std::vector<bool> released(static_cast<std::size_t>(n), true);
  if (edit.handles.empty()) return released;
  const double L = outline.length();
  std::vector<double> start(static_cast<std::size_t>(n) + 1, 0.0);
  for (int s = 0; s < n; ++s) {
    start[static_cast<std::size_t>(s) + 1] = start[static_cast<std::size_t>(s)] + outline.along(s).length();
  }
  std::vector<double> own(static_cast<std::size_t>(n), L);
  for (const auto& [at, move] : edit.handles) {
    const auto h = static_cast<std::size_t>(at.segment);
    const double handle = start[h] + outline.along(at.segment).at(at.u);
    // A line goes as a whole: if the handle is on one, its ends are as near as the handle itself.
    const bool on_line = contour.degree(at.segment) == 1;
    const double first = on_line ? start[h] : handle;
    const double last = on_line ? start[h + 1] : handle;
    const auto around = [&](double s) {
      if (s >= first && s <= last) return 0.0;
      const double d = s < first ? std::min(first - s, s + L - last) : std::min(s - last, first + L - s);
      return std::max(d, 0.0);
    };
    for (std::size_t s = 0; s < own.size(); ++s) {
      own[s] = std::min(own[s], s == h ? 0.0 : std::min(around(start[s]), around(start[s + 1])));
    }
  }
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  // So does a line that is reached: what lies beyond it is as near as it is, or its far end could not follow.
  std::vector<double> distance = own;
  for (int s = 0; s < n; ++s) {
    if (contour.degree(s) != 1) continue;
    for (const int beside : {contour.previous(s), contour.next(s)}) {
      double& d = distance[static_cast<std::size_t>(beside)];
      d = std::min(d, own[static_cast<std::size_t>(s)]);
    }
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return distance[static_cast<std::size_t>(a)] < distance[static_cast<std::size_t>(b)];
  });
  const int most = edit.breadth <= 0.25 * L ? n / 2 : n;
  for (int k = 0; k < n; ++k) {
    const auto s = static_cast<std::size_t>(order[static_cast<std::size_t>(k)]);
    released[s] = k < most && distance[s] < reach;
  }
  return released;
}

RowElimination eliminate(const BezierContour& contour, const std::vector<bool>& released, const Rows& further,
                         const OutlineRules& rules) {
  RowElimination rows(static_cast<int>(2 * contour.point_count()));
  std::vector<bool> free(static_cast<std::size_t>(contour.point_count()), true);
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (released[static_cast<std::size_t>(s)]) continue;
    for (int k = 0; k <= contour.degree(s); ++k) free[static_cast<std::size_t>(contour.point_of(s, k))] = false;
  }
  for (int p = 0; p < contour.point_count(); ++p) {
    if (!free[static_cast<std::size_t>(p)]) rows.add(fontcore::rows(contour, FrozenPoint{p}));
  }
  rows.add(further);
  rows.add(outline_rows(contour, rules));
  return rows;
}

Point move_of(const BezierContour& before, const BezierContour& after, const OutlineCurve::Location& at) {
  return evaluate(after.segment(at.segment), at.u) - evaluate(before.segment(at.segment), at.u);
}

double largest(const Eigen::VectorXd& displacement) {
  double worst = 0.0;
  for (Eigen::Index i = 0; i < displacement.size(); i += 2) worst = std::max(worst, displacement.segment<2>(i).norm());
  return worst;
}

double longest_move(const StructureEdit& edit) {
  double longest = 0.0;
  for (const StructureEdit::Handle& handle : edit.handles) longest = std::max(longest, handle.move.norm());
  return longest;
}

void add_names(std::vector<std::string>& names, const std::vector<std::string>& more) {
  for (const std::string& name : more) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
}

// Solves with the handle as rows; where that cannot be, without, and says what stood against it.
struct HandledSolution {
  LeastChange::Solution solution;
  std::vector<std::string> against;
};

HandledSolution solve_with_handle(const BezierContour& contour, const StructureEdit& edit, const WishSystem& system,
                                  RowElimination rules) {
  const auto solve = [&](RowElimination rows) {
    const LeastChange least(std::span(system.H), std::move(rows));
    if (edit.length) return least.solve(system.f, contour, edit.area, *edit.length);
    return edit.area ? least.solve(system.f, contour, *edit.area) : least.solve(system.f);
  };
  HandledSolution result;
  if (edit.handles.empty() || edit.handle_move == HandleMove::Wished) {
    result.solution = solve(std::move(rules));
    return result;
  }
  // x and y are wishes of their own: a rule may stand against one and leave the other.
  RowElimination with_handle = rules;
  for (const auto& [at, move] : edit.handles) with_handle.add(rows(contour, Position{at.segment, at.u, move}));
  for (std::size_t k = rules.conflicts().size(); k < with_handle.conflicts().size(); ++k) {
    const auto& names = with_handle.conflicts()[k].rules;
    add_names(result.against, {names.begin() + 1, names.end()});
  }
  result.solution = solve(std::move(with_handle));
  const bool is_pinned = edit.handle_move == HandleMove::Pinned;
  const double reach = largest(result.solution.displacement);
  const double most = (is_pinned ? most_throw_pinned : most_throw) * longest_move(edit);
  if (result.solution.report.failed.empty() && reach <= most) return result;
  if (is_pinned && !result.against.empty()) return result;
  // The area, or rules that leave the handle only a long lever.
  const std::string reason =
      !result.solution.report.failed.empty()
          ? (edit.length ? "area and length: " : "area: ") + result.solution.report.failed
          : text("rules and area: forcing the handle would throw a point by ", std::round(reach), " units");
  add_names(result.against, {reason});
  result.solution = solve(std::move(rules));
  return result;
}

// The edit with the points within one reach of the handle free.
struct Reached {
  HandledSolution handled;
  WishSystem system;
  BezierContour contour;
};

Reached solve_within(const OutlineArcs& outline, const Wish& wish, const StructureEdit& edit,
                     const std::vector<bool>& released) {
  const BezierContour& contour = outline.contour();
  const std::vector<double> before = turning_angles(contour);
  Reached result{{}, wish_system(outline, wish, edit, released), {}};
  OutlineRules rules = edit.rules;
  for (int round = 0; round < 3; ++round) {
    HandledSolution next =
        solve_with_handle(contour, edit, result.system, eliminate(contour, released, edit.rows, rules));
    if (round > 0 && (!next.solution.report.failed.empty() || next.against.size() > result.handled.against.size()))
      break;
    result.handled = std::move(next);
    result.contour = displaced(contour, result.handled.solution.displacement);
    // Nearly smooth joins that the edit opens are closed, unless that contradicts another rule.
    const std::vector<double> after = turning_angles(result.contour);
    bool opened = false;
    for (int s = 0; s < contour.segment_count(); ++s) {
      const auto k = static_cast<std::size_t>(s);
      const bool known = std::find(rules.closed_joins.begin(), rules.closed_joins.end(), s) != rules.closed_joins.end();
      if (known || std::abs(before[k]) > smooth_angle || std::abs(after[k]) <= smooth_angle) continue;
      if (contour.degree(s) == 1 && contour.degree(contour.previous(s)) == 1) continue;
      if (rules.marks_corner(contour.node(s))) continue;
      rules.closed_joins.push_back(s);
      opened = true;
    }
    if (!opened || !rules.smooth_joins) break;
  }
  return result;
}

}  // namespace

StructureFit refit_structure(const OutlineCurve& curve, const StructureEdit& edit) {
  if (edit.field.rows() != curve.size()) {
    throw InvalidInput(
        text("refit_structure: a field of ", edit.field.rows(), " for ", curve.size(), " control points"));
  }
  const auto wish = [&](int segment, double u, double) -> Point {
    return evaluate(Scheme::Chaikin, edit.field, curve.parameter(segment, u)).transpose();
  };
  return refit_structure(curve.outline(), wish, edit);
}

StructureFit refit_structure(const OutlineArcs& outline, const Wish& wish, const StructureEdit& edit) {
  const BezierContour& contour = outline.contour();
  // As few points as will do: the area is given back near the handle if that is gentle, further off if it is not.
  std::optional<Reached> best;
  std::pair<double, double> best_cost;
  std::vector<bool> tried;
  for (const double reach : {1.0, 1.5, 2.0}) {
    std::vector<bool> released = released_segments(outline, edit, reach * edit.breadth);
    if (released == tried) continue;
    Reached next = solve_within(outline, wish, edit, released);
    tried = std::move(released);
    double missed = 0.0;
    for (const auto& [at, move] : edit.handles) {
      missed = std::max(missed, (move_of(contour, next.contour, at) - move).norm());
    }
    const double thrown = largest(next.handled.solution.displacement);
    const std::pair cost{missed > landed ? missed : 0.0, thrown};
    if (!best || cost < best_cost) {
      best = std::move(next);
      best_cost = cost;
    }
    const bool settled = best_cost.first == 0.0 || edit.handle_move == HandleMove::Wished;
    if (best->handled.solution.report.failed.empty() && settled &&
        best_cost.second <= gentle_throw * longest_move(edit))
      break;
  }
  const HandledSolution& handled = best->handled;
  const WishSystem& system = best->system;
  if (edit.handle_move == HandleMove::Pinned && !handled.against.empty()) {
    std::string names;
    for (const std::string& name : handled.against) names += (names.empty() ? "" : "; ") + name;
    throw UnsatisfiableConstraints("refit_structure: against the pinned handle stands: " + names);
  }

  StructureFit fit{best->contour, handled.solution.report, {}, {}, 0.0};
  bool all_landed = true;
  for (const auto& [at, move] : edit.handles) {
    fit.got.push_back(move_of(contour, fit.contour, at));
    all_landed = all_landed && (fit.got.back() - move).norm() <= landed;
  }
  if (!all_landed) fit.against = handled.against;
  if (!all_landed && fit.against.empty())
    fit.against = {edit.handle_move == HandleMove::Wished ? "it is not forced" : "rounding of the solve"};
  for (const auto& [segment, weight, wished] : system.samples) {
    Point d = Point::Zero();
    for (int k = 0; k <= contour.degree(segment); ++k) {
      d += weight[static_cast<std::size_t>(k)] *
           handled.solution.displacement.segment<2>(2 * contour.point_of(segment, k));
    }
    fit.off_wish = std::max(fit.off_wish, (d - wished).norm());
  }
  return fit;
}

}  // namespace fontcore
