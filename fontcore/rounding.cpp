#include "fontcore/rounding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr double good_area = 1e-6;    // relative: nearer than this nothing is searched further
constexpr int most_combined = 15;     // unknowns up to which every combination of floor and ceiling is looked at
constexpr int most_for_triples = 40;  // unknowns up to which three are changed at a time
constexpr int tried_exactly = 60;     // candidates whose area is computed, not estimated
constexpr double enough_area = 4e-4;  // relative: an outline of few unknowns further off than this is searched far for
constexpr int far = 12;               // steps that such a search takes an unknown to either side
constexpr std::size_t most_for_far = 24;  // unknowns it is made for; with more the near one has not failed yet
constexpr double handle_slack = 1.0;      // font units
constexpr double area_rounding = 1e-6;    // square units: areas nearer to each other than this rank alike

// Whole-number search over the coordinates of a moved outline, those that rules tie being one unknown.
class WholeNumbers {
 public:
  WholeNumbers(const BezierContour& edited, const BezierContour& original, const OutlineRules& rules,
               const RoundingGoal& goal)
      : edited_(edited), goal_(goal) {
    const int n = static_cast<int>(edited.point_count());
    std::vector<int> parent(static_cast<std::size_t>(2 * n));
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int v) {
      while (parent[static_cast<std::size_t>(v)] != v) v = parent[static_cast<std::size_t>(v)];
      return v;
    };
    std::vector<bool> held(static_cast<std::size_t>(2 * n), false);
    for (const Row& row : outline_rows(edited, rules)) {
      if (row.terms.size() == 1) held[static_cast<std::size_t>(row.terms[0].variable)] = true;
      if (row.terms.size() == 2 && row.value == 0.0)
        parent[static_cast<std::size_t>(root(row.terms[0].variable))] = root(row.terms[1].variable);
    }
    for (const Row& row : outline_rows(original, rules)) {  // zones: what is at one was so before the edit
      if (row.terms.size() == 1) held[static_cast<std::size_t>(row.terms[0].variable)] = true;
    }
    unknown_.assign(static_cast<std::size_t>(2 * n), -1);
    std::map<int, int> ids;
    for (int p = 0; p < n; ++p) {
      const bool is_new = !goal.is_new.empty() && goal.is_new[static_cast<std::size_t>(p)];
      const bool moved = is_new || edited.point(p) != original.point(p);
      for (int axis = 0; axis < 2; ++axis) {
        const auto v = static_cast<std::size_t>(2 * p + axis);
        if (edited.kind(p) == PointKind::ImpliedNode) continue;
        const auto [id, fresh] = ids.try_emplace(root(2 * p + axis), static_cast<int>(exact_.size()));
        if (fresh) {
          exact_.push_back(edited.points()(p, axis));
          locked_.push_back(false);
        }
        unknown_[v] = id->second;
        const auto k = static_cast<std::size_t>(id->second);
        const double at = edited.points()(p, axis);
        // What a rule holds is where it was, but for the rounding of what solved it; what another step moved is not.
        const double before = original.points()(p, axis);
        const bool stays = is_new ? at == std::floor(at) : std::abs(at - before) < 1e-9;
        if (!moved || (held[v] && stays)) {
          locked_[k] = true;
          exact_[k] = is_new ? at : before;
        }
      }
    }
    for (std::size_t k = 0; k < exact_.size(); ++k)
      value_.push_back(locked_[k] ? exact_[k] : std::floor(exact_[k] + 0.5));
    const std::vector<double> turns = turning_angles(original);
    for (int s = 0; s < original.segment_count(); ++s) {
      const int p = original.node(s);
      const bool turns_here = std::abs(turns[static_cast<std::size_t>(s)]) > smooth_angle || rules.marks_corner(p);
      if (original.kind(p) == PointKind::ImpliedNode || turns_here) continue;
      joins_.push_back(s);
    }
    coordinates_.resize(exact_.size());
    for (int v = 0; v < 2 * n; ++v) {
      const int k = unknown_[static_cast<std::size_t>(v)];
      if (k >= 0) coordinates_[static_cast<std::size_t>(k)].push_back(v);
    }
    for (int p = 0; p < n; ++p) {
      if (edited.kind(p) == PointKind::ImpliedNode) implied_.push_back(p);
    }
    here_ = edited;
    shown_.assign(exact_.size(), std::numeric_limits<double>::quiet_NaN());
    all_joins_.resize(joins_.size());
    std::iota(all_joins_.begin(), all_joins_.end(), std::size_t{0});
    joins_of_.resize(exact_.size());
    for (std::size_t j = 0; j < joins_.size(); ++j) {
      for (const std::size_t k : unknowns_of(joins_[j])) joins_of_[k].push_back(j);
    }
  }

  Rounding search() {
    Rounding result;
    const std::vector<double> plain = value_;
    result.plain_area_error = error(plain);
    mend_joins();
    const BezierContour here = contour(value_);
    for (const std::size_t j : opened(value_, all_joins_)) opened_.emplace(j, turn(here, j));
    const std::vector<double> mended = value_;
    const double good = good_area * goal_.scale;
    combine();
    for (int reach = 0; reach <= 1 && std::abs(error(value_)) > good; ++reach) improve(reach);
    if (std::abs(error(value_)) > enough_area * goal_.scale) search_far();
    if (std::abs(error(value_)) > std::max(std::abs(error(mended)), good)) value_ = mended;
    result.contour = contour(value_);
    result.area_error = error(value_);
    result.opened_joins = static_cast<int>(opened(value_, all_joins_).size());
    result.handle_error = handle_error(value_);
    return result;
  }

 private:
  struct Change {
    std::size_t unknown;
    double step;
  };
  using Changes = std::vector<Change>;

  // The outline with these values; the one before is taken over, as most differ from it in a few places.
  const BezierContour& contour(const std::vector<double>& value) const {
    for (std::size_t k = 0; k < value.size(); ++k) {
      if (value[k] == shown_[k]) continue;
      shown_[k] = value[k];
      for (const int v : coordinates_[k]) {
        Point moved = here_.point(v / 2);
        moved[v % 2] = value[k];
        here_.set_point(v / 2, moved);
      }
    }
    const int n = static_cast<int>(here_.point_count());
    for (const int p : implied_) here_.set_point(p, 0.5 * (here_.point((p + n - 1) % n) + here_.point((p + 1) % n)));
    return here_;
  }
  double error(const std::vector<double>& value) const { return signed_area(contour(value)) - goal_.area; }

  // Those of the node and of all points that may give its tangents: a handle may be drawn in onto it.
  std::vector<std::size_t> unknowns_of(int join) const {
    std::set<std::size_t> found;
    const auto add = [&](int p) {
      for (int axis = 0; axis < 2; ++axis) {
        const int k = unknown_[static_cast<std::size_t>(2 * p + axis)];
        if (k >= 0) found.insert(static_cast<std::size_t>(k));
      }
    };
    const int before = edited_.previous(join);
    const Point node = edited_.point(edited_.node(join));
    add(edited_.node(join));
    for (int k = edited_.degree(before) - 1; k >= 0; --k) {
      add(edited_.point_of(before, k));
      if (edited_.point(edited_.point_of(before, k)) != node) break;
    }
    for (int k = 1; k <= edited_.degree(join); ++k) {
      add(edited_.point_of(join, k));
      if (edited_.point(edited_.point_of(join, k)) != node) break;
    }
    return {found.begin(), found.end()};
  }
  // Of the joins given, those that are open.
  std::vector<std::size_t> opened(const std::vector<double>& value, const std::vector<std::size_t>& which) const {
    const BezierContour& here = contour(value);
    std::vector<std::size_t> result;
    std::copy_if(which.begin(), which.end(), std::back_inserter(result),
                 [&](std::size_t j) { return turn(here, j) > smooth_angle; });
    return result;
  }
  double turn(const BezierContour& here, std::size_t join) const {
    const Point a = end_tangent(here.segment(here.previous(joins_[join])));
    const Point b = start_tangent(here.segment(joins_[join]));
    const bool is_gone = a == Point::Zero() || b == Point::Zero();  // a segment that rounding left without length
    return is_gone ? std::numbers::pi : std::abs(std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b)));
  }

  // Every smooth join that rounding opened takes the best of the neighbours of its own points; where no floor and
  // ceiling close it, those a unit further.
  void mend_joins() {
    for (const int further : {0, 1}) {
      for (int sweep = 0; sweep < 4; ++sweep) {
        const std::vector<std::size_t> bad = opened(value_, all_joins_);
        if (bad.empty()) return;
        for (const std::size_t j : bad) mend(j, further);
      }
    }
  }
  void mend(std::size_t join, int further) {
    std::vector<std::size_t> own;
    std::set<std::size_t> touched;
    for (const std::size_t k : unknowns_of(joins_[join])) {
      if (!locked_[k]) own.push_back(k);
    }
    for (const std::size_t k : own) touched.insert(joins_of_[k].begin(), joins_of_[k].end());
    const std::vector<std::size_t> affected(touched.begin(), touched.end());
    std::vector<double> best = value_;
    std::pair<std::size_t, double> best_cost{opened(value_, affected).size(), 0.0};
    const int choices = 2 + 2 * further;
    int combinations = 1;
    for (std::size_t b = 0; b < own.size(); ++b) combinations *= choices;
    for (int combination = 0; combination < combinations; ++combination) {
      std::vector<double> tried = value_;
      double moved = 0.0;
      for (int b = 0, rest = combination; b < static_cast<int>(own.size()); ++b, rest /= choices) {
        const std::size_t k = own[static_cast<std::size_t>(b)];
        const int choice = rest % choices - further;  // 0 the floor, 1 the ceiling
        tried[k] = (choice <= 0 ? std::floor(exact_[k]) : std::ceil(exact_[k]) - 1.0) + choice;
        moved += std::abs(tried[k] - exact_[k]);
      }
      if (moved >= best_cost.second && best_cost.first == 0) continue;
      const std::pair<std::size_t, double> cost{opened(tried, affected).size(), moved};
      if (cost.first < best_cost.first ||
          (cost.first == best_cost.first && best_cost.second > 0.0 && cost < best_cost)) {
        best = tried;
        best_cost = cost;
      }
    }
    value_ = best;
  }

  bool opens_none(const std::vector<double>& value, const Changes& changes) const {
    const BezierContour& here = contour(value);
    const auto stays = [&](std::size_t j) {
      const double now = turn(here, j);
      if (now <= smooth_angle) return true;
      const auto open = opened_.find(j);
      return open != opened_.end() && now <= open->second;
    };
    return std::ranges::all_of(
        changes, [&](const Change& change) { return std::ranges::all_of(joins_of_[change.unknown], stays); });
  }
  bool is_allowed(const std::vector<double>& value, const Changes& changes) const {
    if (!opens_none(value, changes)) return false;
    return goal_.handles.empty() || handle_error(value) <= std::max(handle_slack, handle_error(value_));
  }
  double handle_error(const std::vector<double>& value) const {
    double worst = 0.0;
    for (const auto& [segment, u] : goal_.handles) {
      const Point wished = evaluate(edited_.segment(segment), u);
      worst = std::max(worst, (evaluate(contour(value).segment(segment), u) - wished).norm());
    }
    return worst;
  }
  std::vector<double> changed(const Changes& changes) const {
    std::vector<double> value = value_;
    for (const Change& change : changes) value[change.unknown] += change.step;
    return value;
  }
  bool is_between(std::size_t k) const { return !locked_[k] && std::floor(exact_[k]) != std::ceil(exact_[k]); }
  double other_side(std::size_t k) const { return value_[k] > exact_[k] ? -1.0 : 1.0; }

  // Few unknowns: every combination of floor and ceiling, ranked by the area as a quadratic form of the changes.
  void combine() {
    std::vector<std::size_t> own;
    for (std::size_t k = 0; k < exact_.size(); ++k) {
      if (is_between(k)) own.push_back(k);
    }
    const std::size_t m = own.size();
    if (m == 0 || m > most_combined) return;
    const double start = error(value_);
    if (std::abs(start) < 0.5 * area_rounding) return;
    Eigen::MatrixXd form = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(m));
    const auto at = [&](std::size_t a, std::size_t b) -> double& {
      return form(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    };
    for (std::size_t a = 0; a < m; ++a) at(a, a) = error(changed({{own[a], other_side(own[a])}})) - start;
    for (std::size_t a = 0; a < m; ++a) {
      for (std::size_t b = a + 1; b < m; ++b) {
        at(a, b) =
            error(changed({{own[a], other_side(own[a])}, {own[b], other_side(own[b])}})) - start - at(a, a) - at(b, b);
      }
    }
    // What every combination adds: that of its last unknown, and what this one changes with each of those before.
    std::vector<double> sums(std::size_t{1} << m, start);
    std::vector<double> more(std::size_t{1} << (m - 1));
    for (std::size_t a = 0; a < m; ++a) {
      const std::size_t without = std::size_t{1} << a;
      more[0] = at(a, a);
      for (std::size_t b = 0; b < a; ++b) {
        const std::size_t half = std::size_t{1} << b;
        for (std::size_t mask = 0; mask < half; ++mask) more[half + mask] = more[mask] + at(b, a);
      }
      for (std::size_t mask = 0; mask < without; ++mask) sums[without + mask] = sums[mask] + more[mask];
    }
    std::vector<std::pair<double, unsigned>> ranked;
    for (unsigned mask = 0; mask < 1U << m; ++mask) {
      const double off = std::abs(sums[mask]);
      if (off <= std::abs(start) + area_rounding) ranked.emplace_back(std::round(off / area_rounding), mask);
    }
    const std::size_t most = std::min<std::size_t>(ranked.size(), 4000);
    std::partial_sort(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(most), ranked.end());
    for (std::size_t r = 0; r < most; ++r) {
      Changes changes;
      for (std::size_t a = 0; a < m; ++a) {
        if ((ranked[r].second >> a & 1U) != 0U) changes.push_back({own[a], other_side(own[a])});
      }
      const std::vector<double> tried = changed(changes);
      if (std::abs(error(tried)) > std::abs(start)) return;
      if (!is_allowed(tried, changes)) continue;
      value_ = tried;
      return;
    }
  }

  // The best one, two or three changes that open no join, again and again. With reach 1 an unknown may go one further
  // than its floor and ceiling.
  void improve(int reach) {
    for (int round = 0; round < 6; ++round) {
      const double start = error(value_);
      if (std::abs(start) <= good_area * goal_.scale) return;
      std::vector<std::pair<Change, double>> single;  // and what it adds to the area
      for (std::size_t k = 0; k < exact_.size(); ++k) {
        if (locked_[k]) continue;
        const bool whole = std::floor(exact_[k]) == std::ceil(exact_[k]);
        for (const double step : {-2.0, -1.0, 1.0, 2.0}) {
          const double distance = std::abs(value_[k] + step - exact_[k]);
          if (reach == 0 ? whole || distance >= 1.0 : distance >= 2.0) continue;
          const Changes change{{k, step}};
          const std::vector<double> tried = changed(change);
          if (is_allowed(tried, change)) single.push_back({change[0], error(tried) - start});
        }
      }
      struct Option {
        double off;  // estimated area error
        std::array<std::size_t, 3> changes;
        std::size_t count;
      };
      std::vector<Option> options;
      const auto offer = [&](double sum, std::array<std::size_t, 3> changes, std::size_t count) {
        options.push_back({std::abs(start + sum), changes, count});
      };
      const std::size_t m = single.size();
      for (std::size_t a = 0; a < m; ++a) {
        offer(single[a].second, {a}, 1);
        for (std::size_t b = a + 1; b < m; ++b) {
          if (single[a].first.unknown == single[b].first.unknown) continue;
          const double two = single[a].second + single[b].second;
          offer(two, {a, b}, 2);
          if (m > most_for_triples) continue;
          for (std::size_t c = b + 1; c < m; ++c) {
            if (single[c].first.unknown == single[a].first.unknown ||
                single[c].first.unknown == single[b].first.unknown)
              continue;
            offer(two + single[c].second, {a, b, c}, 3);
          }
        }
      }
      const std::size_t most = std::min<std::size_t>(options.size(), tried_exactly);
      std::partial_sort(options.begin(), options.begin() + static_cast<std::ptrdiff_t>(most), options.end(),
                        [](const Option& a, const Option& b) { return a.off < b.off; });
      std::vector<double> best = value_;
      double best_error = std::abs(start);
      for (std::size_t r = 0; r < most; ++r) {
        Changes changes;
        for (std::size_t c = 0; c < options[r].count; ++c) changes.push_back(single[options[r].changes[c]].first);
        const std::vector<double> tried = changed(changes);
        const double here = std::abs(error(tried));
        if (here < best_error && is_allowed(tried, changes)) {
          best = tried;
          best_error = here;
        }
      }
      if (best == value_) return;
      value_ = best;
    }
  }

  // Outlines of few unknowns (stems, dots) may have no near whole numbers of their area: the nearest pair of further
  // steps that has it, with the handle in place if that can be.
  void search_far() {
    std::vector<std::size_t> own;
    for (std::size_t k = 0; k < exact_.size(); ++k) {
      if (!locked_[k]) own.push_back(k);
    }
    if (own.size() < 2 || own.size() > most_for_far) return;
    const double start = error(value_);
    struct Bend {
      double slope, bend;  // error(step) = start + slope * step + bend * step^2, exactly
    };
    std::vector<Bend> along;
    for (const std::size_t k : own) {
      const double up = error(changed({{k, 1.0}})) - start;
      const double down = error(changed({{k, -1.0}})) - start;
      along.push_back({0.5 * (up - down), 0.5 * (up + down)});
    }
    std::vector<std::pair<double, Changes>> found;  // squared distance from the exact outline
    for (std::size_t a = 0; a < own.size(); ++a) {
      for (std::size_t b = a + 1; b < own.size(); ++b) {
        const double twist = error(changed({{own[a], 1.0}, {own[b], 1.0}})) - start - along[a].slope - along[a].bend -
                             along[b].slope - along[b].bend;
        for (int i = -far; i <= far; ++i) {
          for (int j = -far; j <= far; ++j) {
            const double here = start + i * along[a].slope + i * i * along[a].bend + j * along[b].slope +
                                j * j * along[b].bend + i * j * twist;
            if (std::abs(here) > enough_area * goal_.scale) continue;
            const double da = value_[own[a]] + i - exact_[own[a]];
            const double db = value_[own[b]] + j - exact_[own[b]];
            found.emplace_back(da * da + db * db,
                               Changes{{own[a], static_cast<double>(i)}, {own[b], static_cast<double>(j)}});
          }
        }
      }
    }
    std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const bool in_place : {true, false}) {
      for (const auto& [distance, changes] : found) {
        const std::vector<double> tried = changed(changes);
        if (in_place && handle_error(tried) > handle_slack) continue;
        if (!opens_none(tried, changes)) continue;
        value_ = tried;
        return;
      }
    }
  }

  const BezierContour& edited_;
  RoundingGoal goal_;
  std::vector<int> unknown_;                        // per coordinate 2 * point + axis; -1 for implied nodes
  std::vector<double> exact_;                       // per unknown
  std::vector<double> value_;                       // per unknown, whole
  std::vector<bool> locked_;                        // per unknown
  std::vector<int> joins_;                          // segments that start at a smooth join
  std::vector<std::vector<std::size_t>> joins_of_;  // per unknown
  std::vector<std::vector<int>> coordinates_;       // per unknown: those it stands for
  std::vector<int> implied_;                        // implied nodes
  std::vector<std::size_t> all_joins_;
  mutable BezierContour here_;            // the outline with the values `shown_`
  mutable std::vector<double> shown_;     // per unknown
  std::map<std::size_t, double> opened_;  // joins that could not be mended, and what they turn by at most
};

}  // namespace

Rounding round_keeping_area(const BezierContour& edited, const BezierContour& original, const OutlineRules& rules,
                            const RoundingGoal& goal) {
  if (!has_same_structure(edited, original)) throw InvalidInput("round_keeping_area: the contours differ in structure");
  if (!goal.is_new.empty() && goal.is_new.size() != edited.kinds().size()) {
    throw InvalidInput(
        text("round_keeping_area: ", goal.is_new.size(), " marks for ", edited.point_count(), " points"));
  }
  return WholeNumbers(edited, original, rules, goal).search();
}

}  // namespace fontcore
