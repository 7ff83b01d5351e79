#include "fontcore/rounding.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

constexpr double good_area = 1e-6;      // relative: nearer than this nothing is searched further
constexpr double area_rounding = 1e-6;  // square units: areas nearer to each other than this rank alike
constexpr double whole = 1e-9;          // font units: what is nearer to a whole number is one
constexpr double handle_slack = 1.0;    // font units
constexpr std::size_t most_exact = 14;  // free unknowns up to which the best choice is found, whatever it takes
constexpr std::size_t most_flips = 32;  // free unknowns that one search chooses for
constexpr int most_steps = 20000;       // of a search that need not be exact
constexpr std::size_t most_rounds = 6;  // searches, each for other unknowns, until the area is good
constexpr std::size_t widest = 4;       // of the flips: those that change the area most
constexpr double little_weight = 1e-3;  // of an unknown in the place of a handle: with less it hardly moves it
constexpr int mending_sweeps = 4;
constexpr std::size_t most_own = 8;       // unknowns that bear on one join
constexpr double enough_area = 4e-4;      // relative: what may go beyond a unit does so if it is further off than this
constexpr int far = 12;                   // steps that such a search takes an unknown to either side
constexpr std::size_t most_for_far = 24;  // unknowns it is made for; with more the near one has not failed yet

// Choices of floor (0) or ceiling (1) for the unknowns of a join; bit k of a choice is that of its k-th unknown.
using Choices = std::bitset<std::size_t{1} << most_own>;

// The choices whose bit k is 1.
const Choices& with_ceiling(std::size_t k) {
  static const std::array<Choices, most_own> made = [] {
    std::array<Choices, most_own> all;
    for (std::size_t choice = 0; choice < all[0].size(); ++choice) {
      for (std::size_t b = 0; b < most_own; ++b) all[b][choice] = (choice >> b & 1U) != 0U;
    }
    return all;
  }();
  return made[k];
}

bool is_among(std::size_t k, const std::vector<std::size_t>& unknowns) {
  return std::find(unknowns.begin(), unknowns.end(), k) != unknowns.end();
}

// A smooth join: its node, and the points that may give its tangents, nearest first; a handle may fall onto the node.
struct Join {
  int node = 0;
  std::vector<int> before;
  std::vector<int> after;
  std::vector<std::size_t> near;  // unknowns of the node and of the nearest point on either side, if they may move
  std::vector<std::size_t> own;   // free unknowns of all these points
  Choices allowed;                // of their floors and ceilings, those that close the join
  bool is_open_anyway = false;    // not even a unit further it closes
};

// A moved contour as whole-number unknowns, coordinates that rules tie being one, and its smooth joins.
class WholeNumbers {
 public:
  explicit WholeNumbers(const Unrounded& contour)
      : edited_(contour.edited), goal_(contour.goal), original_(contour.original) {
    find_unknowns(contour.rules);
    for (std::size_t k = 0; k < exact_.size(); ++k) {
      const double nearest = std::round(exact_[k]);
      if (!is_free_[k] || std::abs(exact_[k] - nearest) < whole) {
        is_free_[k] = false;
        value_.push_back(is_locked_[k] ? exact_[k] : nearest);
      } else {
        value_.push_back(std::floor(exact_[k] + 0.5));
      }
    }
    plain_error_ = error();
    find_joins(contour.rules);
    mend_joins();
    most_handle_error_ = std::max(handle_slack, handle_error());
  }

  std::size_t size() const { return exact_.size(); }
  bool is_free(std::size_t k) const { return is_free_[k]; }
  bool is_ceiling(std::size_t k) const { return value_[k] > exact_[k]; }
  // From its floor to its ceiling, or back.
  double step(std::size_t k) const { return is_ceiling(k) ? -1.0 : 1.0; }
  void flip(std::size_t k) { value_[k] += step(k); }
  // What a flip adds to the squared distance from the outline.
  double cost(std::size_t k) const { return 1.0 - 2.0 * std::abs(value_[k] - exact_[k]); }
  double error() const { return signed_area(whole_contour()) - goal_.area; }
  // Handles may end this far from their places: no further than where mending left them, or a unit.
  double most_handle_error() const { return most_handle_error_; }
  double plain_error() const { return plain_error_; }
  const std::vector<Join>& joins() const { return joins_; }
  const RoundingGoal& goal() const { return goal_; }

  // What a step of one adds to the area, per unknown, but for what goes with steps of others.
  std::vector<double> gains() const {
    std::vector<double> gain(exact_.size(), 0.0);
    const Points gradient = area_gradient(whole_contour());
    for (int p = 0; p < edited_.point_count(); ++p) {
      for (int axis = 0; axis < 2; ++axis) {
        for_unknowns(p, axis, [&](std::size_t k, double weight) { gain[k] += weight * gradient(p, axis); });
      }
    }
    return gain;
  }
  // How far a handle is from its place; move(k, axis, weight) for what a step of one in an unknown adds.
  template <typename Move>
  Point handle_offset(const OutlineCurve::Location& handle, const Move& move) const {
    const auto weight = bernstein(edited_.degree(handle.segment), handle.u);
    Point off = Point::Zero();
    for (int k = 0; k <= edited_.degree(handle.segment); ++k) {
      const double w = weight[static_cast<std::size_t>(k)];
      const int p = edited_.point_of(handle.segment, k);
      off += w * (place(p) - edited_.point(p));
      for (int axis = 0; axis < 2; ++axis) {
        for_unknowns(p, axis, [&](std::size_t of, double part) { move(of, axis, w * part); });
      }
    }
    return off;
  }
  // The area is bilinear: add(k, l, weight) for every pair of unknowns, with what a step of one in both adds to it.
  template <typename Add>
  void for_twists(const Add& add) const {
    for (int s = 0; s < edited_.segment_count(); ++s) {
      for (const auto& [i, j, weight] : area_terms(edited_.degree(s))) {
        const int p = edited_.point_of(s, static_cast<int>(i));
        const int q = edited_.point_of(s, static_cast<int>(j));
        const auto add_products = [&](int x, int y, double signed_weight) {
          for_unknowns(x, 0, [&](std::size_t k, double a) {
            for_unknowns(y, 1, [&](std::size_t l, double b) { add(k, l, signed_weight * a * b); });
          });
        };
        add_products(p, q, weight);
        add_products(q, p, -weight);
      }
    }
  }

  // Two unknowns that go further than their neighbours, the nearest pair that brings the error within `enough`, with
  // the handles in place if that can be. `error` is that of all contours.
  bool go_beyond(double error, double enough);

  Rounding result() const {
    Rounding rounding{whole_contour(), error(), plain_error_, handle_error(), 0};
    for (const Join& join : joins_) rounding.opened_joins += is_closed(join) ? 0 : 1;
    return rounding;
  }

 private:
  void find_unknowns(const OutlineRules& rules);
  void find_joins(const OutlineRules& rules);
  void find_own(Join& join);
  void find_allowed(Join& join);
  void mend_joins();
  std::vector<std::size_t> joins_of(const std::vector<std::size_t>& unknowns) const;
  void mend(const Join& join);
  void mend_further(Join& join);

  template <typename Visit>
  void for_unknowns(int point, int axis, const Visit& visit) const {
    const int k = unknown_[static_cast<std::size_t>(2 * point + axis)];
    if (k >= 0) {
      visit(static_cast<std::size_t>(k), 1.0);
    } else {  // an implied node: the midpoint of its handles
      const int n = static_cast<int>(edited_.point_count());
      for (const int handle : {(point + n - 1) % n, (point + 1) % n}) {
        visit(static_cast<std::size_t>(unknown_[static_cast<std::size_t>(2 * handle + axis)]), 0.5);
      }
    }
  }
  Point place(int point) const {
    Point at = Point::Zero();
    for (int axis = 0; axis < 2; ++axis) {
      for_unknowns(point, axis, [&](std::size_t k, double weight) { at[axis] += weight * value_[k]; });
    }
    return at;
  }
  BezierContour whole_contour() const {
    Points points(edited_.point_count(), 2);
    for (int p = 0; p < edited_.point_count(); ++p) points.row(p) = place(p);
    return edited_.with_points(std::move(points));
  }
  double handle_error() const {
    double worst = 0.0;
    for (const auto& handle : goal_.handles) {
      worst = std::max(worst, handle_offset(handle, [](std::size_t, int, double) {}).norm());
    }
    return worst;
  }

  bool is_closed(const Join& join) const {
    const Point node = place(join.node);
    const auto tangent = [&](const std::vector<int>& points) -> Point {
      for (const int p : points) {
        const Point at = place(p);
        if (at != node) return at - node;
      }
      return Point::Zero();
    };
    const Point a = -tangent(join.before);
    const Point b = tangent(join.after);
    static const double slope = std::tan(smooth_angle);
    const double along = a.dot(b);
    return along > 0.0 && std::abs(cross(a, b)) <= slope * along;
  }
  // Where the unknowns of the join are in its choices.
  std::size_t choice_of(const Join& join) const {
    std::size_t choice = 0;
    for (std::size_t b = 0; b < join.own.size(); ++b) choice |= std::size_t{is_ceiling(join.own[b])} << b;
    return choice;
  }
  bool is_mended(const Join& join) const { return join.is_open_anyway || join.allowed[choice_of(join)]; }

  const BezierContour& edited_;
  const RoundingGoal& goal_;
  const BezierContour& original_;
  std::vector<int> unknown_;     // per coordinate 2 * point + axis; -1 for implied nodes
  std::vector<double> exact_;    // per unknown
  std::vector<double> value_;    // per unknown, whole
  std::vector<bool> is_locked_;  // per unknown: at a place of the font, whole or not
  std::vector<bool> is_free_;    // per unknown: floor or ceiling is to be chosen
  std::vector<Join> joins_;
  std::vector<std::vector<std::size_t>> joins_of_;  // per unknown
  double plain_error_ = 0.0;
  double most_handle_error_ = 0.0;
};

void WholeNumbers::find_unknowns(const OutlineRules& rules) {
  const auto n = static_cast<std::size_t>(edited_.point_count());
  std::vector<std::size_t> parent(2 * n);
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  std::vector<bool> is_held(2 * n, false);
  const auto variable = [](const Row::Term& term) { return static_cast<std::size_t>(term.variable); };
  for (const Row& row : outline_rows(edited_, rules)) {
    if (row.terms.size() == 1) is_held[variable(row.terms[0])] = true;
    if (row.terms.size() == 2 && row.value == 0.0) parent[root(variable(row.terms[0]))] = root(variable(row.terms[1]));
  }
  if (!rules.zones.empty()) {  // what is at a zone was so before the edit
    for (const Row& row : outline_rows(original_, rules)) {
      if (row.terms.size() == 1) is_held[variable(row.terms[0])] = true;
    }
  }
  unknown_.assign(2 * n, -1);
  std::vector<int> of_root(2 * n, -1);
  for (std::size_t v = 0; v < 2 * n; ++v) {
    const int p = static_cast<int>(v / 2);
    const auto axis = static_cast<Eigen::Index>(v % 2);
    if (edited_.kind(p) == PointKind::ImpliedNode) continue;
    int& k = of_root[root(v)];
    const double at = edited_.points()(p, axis);
    if (k < 0) {
      k = static_cast<int>(exact_.size());
      exact_.push_back(at);
      is_free_.push_back(true);
      is_locked_.push_back(false);
    }
    unknown_[v] = k;
    const bool is_new = !goal_.is_new.empty() && goal_.is_new[v / 2];
    const bool has_moved = is_new || edited_.point(p) != original_.point(p);
    // What a rule holds is where it was, but for the rounding of what solved it; what another step moved is not.
    const double before = original_.points()(p, axis);
    const bool stays = is_new ? at == std::floor(at) : std::abs(at - before) < whole;
    if (!has_moved || (is_held[v] && stays)) {
      const auto held = static_cast<std::size_t>(k);
      is_free_[held] = false;
      is_locked_[held] = true;
      exact_[held] = is_new ? at : before;
    }
  }
}

void WholeNumbers::find_joins(const OutlineRules& rules) {
  joins_of_.resize(exact_.size());
  const std::vector<double> turns = turning_angles(original_);
  const int n = static_cast<int>(edited_.point_count());
  for (int s = 0; s < original_.segment_count(); ++s) {
    Join join{original_.node(s), {}, {}, {}, {}, {}, false};
    const bool turns_here = std::abs(turns[static_cast<std::size_t>(s)]) > smooth_angle;
    if (turns_here || original_.kind(join.node) == PointKind::ImpliedNode || rules.marks_corner(join.node)) continue;
    if (is_degenerate(edited_.segment(s))) continue;  // the join is that of the next segment with a direction
    const Point node = edited_.point(join.node);
    // Two units apart they stay apart.
    const auto collect = [&](int way, std::vector<int>& points) {
      for (int k = 1; k < n; ++k) {
        const int p = ((join.node + way * k) % n + n) % n;
        const Point off = edited_.point(p) - node;
        if (off == Point::Zero()) continue;
        points.push_back(p);
        if (off.cwiseAbs().maxCoeff() >= 2.0 || points.size() == 3) return;
      }
    };
    collect(-1, join.before);
    collect(1, join.after);
    if (join.before.empty() || join.after.empty()) continue;
    for (const int p : {join.node, join.before[0], join.after[0]}) {
      for (int axis = 0; axis < 2; ++axis) {
        for_unknowns(p, axis, [&](std::size_t k, double) {
          if (!is_locked_[k] && !is_among(k, join.near)) join.near.push_back(k);
        });
      }
    }
    find_own(join);
    find_allowed(join);
    std::set<std::size_t> bearing(join.near.begin(), join.near.end());
    bearing.insert(join.own.begin(), join.own.end());
    for (const std::size_t k : bearing) joins_of_[k].push_back(joins_.size());
    joins_.push_back(std::move(join));
  }
}

void WholeNumbers::find_own(Join& join) {
  join.own.clear();
  const auto add = [&](int p) {
    for (int axis = 0; axis < 2; ++axis) {
      for_unknowns(p, axis, [&](std::size_t k, double) {
        if (!is_free_[k] || is_among(k, join.own)) return;
        if (join.own.size() < most_own) {
          join.own.push_back(k);
        } else {  // it stays at its nearest whole number
          is_free_[k] = false;
        }
      });
    }
  };
  add(join.node);
  for (std::size_t k = 0; k < std::max(join.before.size(), join.after.size()); ++k) {
    if (k < join.before.size()) add(join.before[k]);
    if (k < join.after.size()) add(join.after[k]);
  }
}

void WholeNumbers::find_allowed(Join& join) {
  join.allowed.reset();
  const std::size_t now = choice_of(join);
  for (std::size_t choice = 0; choice < std::size_t{1} << join.own.size(); ++choice) {
    for (std::size_t b = 0; b < join.own.size(); ++b) {
      if (is_ceiling(join.own[b]) != ((choice >> b & 1U) != 0U)) flip(join.own[b]);
    }
    join.allowed[choice] = is_closed(join);
  }
  for (std::size_t b = 0; b < join.own.size(); ++b) {
    if (is_ceiling(join.own[b]) != ((now >> b & 1U) != 0U)) flip(join.own[b]);
  }
}

// The joins that rounding opened take the best choice of their own points; where there is none, one a unit further,
// whole ones among them too.
void WholeNumbers::mend_joins() {
  const auto is_to_mend = [&](const Join& join) { return !is_mended(join); };
  for (std::size_t round = 0; round < 2 * joins_.size(); ++round) {
    for (int sweep = 0; sweep < mending_sweeps; ++sweep) {
      for (const Join& join : joins_) {
        if (!is_mended(join) && join.allowed.any()) mend(join);
      }
    }
    const auto left = std::find_if(joins_.begin(), joins_.end(), is_to_mend);
    if (left == joins_.end()) return;
    mend_further(*left);
  }
}

std::vector<std::size_t> WholeNumbers::joins_of(const std::vector<std::size_t>& unknowns) const {
  std::set<std::size_t> joins;
  for (const std::size_t k : unknowns) joins.insert(joins_of_[k].begin(), joins_of_[k].end());
  return {joins.begin(), joins.end()};
}

void WholeNumbers::mend(const Join& join) {
  const std::vector<std::size_t> affected = joins_of(join.own);
  std::pair best{std::numeric_limits<std::size_t>::max(), 0.0};  // joins left open, squared distance
  std::size_t best_choice = 0;
  const auto set = [&](std::size_t choice) {
    for (std::size_t b = 0; b < join.own.size(); ++b) {
      if (is_ceiling(join.own[b]) != ((choice >> b & 1U) != 0U)) flip(join.own[b]);
    }
  };
  for (std::size_t choice = 0; choice < std::size_t{1} << join.own.size(); ++choice) {
    if (!join.allowed[choice]) continue;
    set(choice);
    std::pair cost{std::size_t{0}, 0.0};
    for (const std::size_t j : affected) cost.first += is_mended(joins_[j]) ? 0U : 1U;
    for (const std::size_t k : join.own) cost.second += (value_[k] - exact_[k]) * (value_[k] - exact_[k]);
    if (cost < best) {
      best = cost;
      best_choice = choice;
    }
  }
  set(best_choice);
}

// Where fewer joins are left open by it.
void WholeNumbers::mend_further(Join& join) {
  const std::vector<std::size_t> affected = joins_of(join.near);
  const auto open_count = [&] {
    return std::count_if(affected.begin(), affected.end(), [&](std::size_t j) { return !is_closed(joins_[j]); });
  };
  std::vector<double> best_value = value_;
  std::pair best{open_count(), 0.0};  // joins left open, squared distance
  for (std::size_t choice = 0; choice < std::size_t{1} << 2 * join.near.size(); ++choice) {
    std::pair cost{std::ptrdiff_t{0}, 0.0};
    bool is_near = true;
    for (std::size_t b = 0; b < join.near.size(); ++b) {
      const std::size_t k = join.near[b];
      value_[k] = std::floor(exact_[k] + whole) - 1.0 + static_cast<double>(choice >> 2 * b & 3U);
      is_near = is_near && value_[k] <= std::ceil(exact_[k] - whole) + 1.0;
      cost.second += (value_[k] - exact_[k]) * (value_[k] - exact_[k]);
    }
    if (!is_near || (best.first == 0 && cost.second >= best.second) || !is_closed(join)) continue;
    cost.first = open_count();
    if (cost < best) {
      best = cost;
      best_value = value_;
    }
  }
  value_ = best_value;
  join.is_open_anyway = !is_closed(join);
  std::vector<std::size_t> settled = join.near;
  settled.insert(settled.end(), join.own.begin(), join.own.end());
  for (const std::size_t k : settled) is_free_[k] = false;
  for (const std::size_t j : joins_of(settled)) {
    find_own(joins_[j]);
    find_allowed(joins_[j]);
  }
}

bool WholeNumbers::go_beyond(double error, double enough) {
  std::vector<std::size_t> own;
  for (std::size_t k = 0; k < exact_.size(); ++k) {
    if (!is_locked_[k]) own.push_back(k);
  }
  if (own.size() < 2 || own.size() > most_for_far) return false;
  const std::vector<double> gain = gains();
  const auto m = static_cast<Eigen::Index>(exact_.size());
  Eigen::MatrixXd twist = Eigen::MatrixXd::Zero(m, m);
  for_twists([&](std::size_t k, std::size_t l, double weight) {
    twist(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(l)) += weight;
    twist(static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(k)) += weight;
  });
  struct Pair {
    double squared_distance;  // of the two from the exact outline
    std::size_t a, b;
    int i, j;
  };
  std::vector<Pair> found;
  for (std::size_t x = 0; x < own.size(); ++x) {
    for (std::size_t y = x + 1; y < own.size(); ++y) {
      const std::size_t a = own[x];
      const std::size_t b = own[y];
      const double both = twist(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      for (int i = -far; i <= far; ++i) {
        const double start = error + i * gain[a];
        const double slope = gain[b] + i * both;
        for (int j = -far; j <= far; ++j) {
          if (std::abs(start + j * slope) > enough) continue;
          const double da = value_[a] + i - exact_[a];
          const double db = value_[b] + j - exact_[b];
          found.push_back({da * da + db * db, a, b, i, j});
        }
      }
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Pair& p, const Pair& q) { return p.squared_distance < q.squared_distance; });
  std::vector<std::size_t> closed;
  for (std::size_t j = 0; j < joins_.size(); ++j) {
    if (is_closed(joins_[j])) closed.push_back(j);
  }
  for (const bool in_place : {true, false}) {
    for (const auto& [distance, a, b, i, j] : found) {
      value_[a] += i;
      value_[b] += j;
      if ((!in_place || handle_error() <= most_handle_error_) &&
          std::all_of(closed.begin(), closed.end(), [&](std::size_t join) { return is_closed(joins_[join]); }))
        return true;
      value_[a] -= i;
      value_[b] -= j;
    }
  }
  return false;
}

// Which unknowns to flip, so that the area is nearest: depth first, those that change it most first, cut off where what
// is left to choose cannot make up the error or bring a handle back, or where a join is left without a choice.
class FlipSearch {
 public:
  struct Flip {
    std::size_t contour;
    std::size_t unknown;
    double gain;  // what it adds to the area alone
    double cost;  // and to the squared distance
  };

  FlipSearch(std::vector<WholeNumbers>& contours, std::vector<Flip> flips)
      : contours_(contours), flips_(std::move(flips)), n_(flips_.size()) {
    // Those of a handle come first of all: it is settled before the rest is tried.
    std::vector<std::vector<bool>> bears_on_handle;
    for (const WholeNumbers& contour : contours_) {
      std::vector<bool>& bears = bears_on_handle.emplace_back(contour.size(), false);
      for (const auto& handle : contour.goal().handles) {
        contour.handle_offset(handle, [&](std::size_t k, int, double weight) {
          if (weight > little_weight) bears[k] = true;
        });
      }
    }
    const auto rank = [&](const Flip& flip) {
      return std::pair{bears_on_handle[flip.contour][flip.unknown], std::abs(flip.gain)};
    };
    std::stable_sort(flips_.begin(), flips_.end(), [&](const Flip& a, const Flip& b) { return rank(a) > rank(b); });
    for (std::size_t c = 0; c < contours_.size(); ++c) place_on(c);
    for (std::size_t d = 0; d < n_; ++d) {
      gain_[0][d] = flips_[d].gain;
      is_ceiling_[d] = contours_[flips_[d].contour].is_ceiling(flips_[d].unknown);
    }
    for (std::size_t d = n_; d-- > 0;) {
      double slack = 0.0;
      for (std::size_t e = 0; e < n_; ++e) slack += std::abs(twist_[d][e]);
      lowest_[d] = lowest_[d + 1] + std::min(0.0, flips_[d].gain - slack);
      highest_[d] = highest_[d + 1] + std::max(0.0, flips_[d].gain + slack);
      cheapest_[d] = cheapest_[d + 1] + std::min(0.0, flips_[d].cost);
    }
  }

  // Makes the best choice, or the first that brings the error within `good`; at most so many steps. `error` is that of
  // all contours as they are.
  void run(double error, double good, int most) {
    good_ = good;
    steps_left_ = most;
    best_error_ = std::abs(error);
    best_ = chosen_ = 0;
    best_cost_ = 0.0;
    if (best_error_ > good) descend(0, error, 0.0);
    for (std::size_t d = 0; d < n_; ++d) {
      if ((best_ >> d & 1U) != 0U) contours_[flips_[d].contour].flip(flips_[d].unknown);
    }
  }

 private:
  using Chosen = std::uint32_t;  // bit d: flip d is made
  static_assert(most_flips <= 32);
  struct Handle {
    double most;                               // distance from its place
    Point off;                                 // with the flips made
    std::array<Point, most_flips> move;        // per flip
    std::array<Point, most_flips + 1> lowest;  // that the flips from here on can add
    std::array<Point, most_flips + 1> highest;
  };
  struct Part {  // of a flip in the choices of a join
    std::size_t limit, bit;
  };

  void place_on(std::size_t c) {
    const WholeNumbers& contour = contours_[c];
    std::vector<std::size_t> flip_of(contour.size(), n_);
    bool has_any = false;
    for (std::size_t d = 0; d < n_; ++d) {
      if (flips_[d].contour != c) continue;
      flip_of[flips_[d].unknown] = d;
      has_any = true;
    }
    if (!has_any) return;
    contour.for_twists([&](std::size_t k, std::size_t l, double weight) {
      const std::size_t d = flip_of[k];
      const std::size_t e = flip_of[l];
      if (d == n_ || e == n_) return;
      weight *= contour.step(k) * contour.step(l);
      twist_[d][e] += weight;
      twist_[e][d] += weight;
    });
    for (const auto& at : contour.goal().handles) {
      Handle handle{contour.most_handle_error(), Point::Zero(), {}, {}, {}};
      handle.move.fill(Point::Zero());
      handle.off = contour.handle_offset(at, [&](std::size_t k, int axis, double weight) {
        if (flip_of[k] < n_) handle.move[flip_of[k]][axis] += weight * contour.step(k);
      });
      handle.lowest[n_] = handle.highest[n_] = Point::Zero();
      for (std::size_t d = n_; d-- > 0;) {
        handle.lowest[d] = handle.lowest[d + 1] + handle.move[d].cwiseMin(0.0);
        handle.highest[d] = handle.highest[d + 1] + handle.move[d].cwiseMax(0.0);
      }
      handles_.push_back(handle);
    }
    for (const Join& join : contour.joins()) {
      const bool is_bound = join.allowed.count() < std::size_t{1} << join.own.size();
      if (join.is_open_anyway || !is_bound) continue;
      Choices allowed = join.allowed;
      bool is_chosen_for = false;
      for (std::size_t b = 0; b < join.own.size(); ++b) {
        if (flip_of[join.own[b]] < n_) {
          is_chosen_for = true;
        } else {
          allowed &= contour.is_ceiling(join.own[b]) ? with_ceiling(b) : ~with_ceiling(b);
        }
      }
      if (!is_chosen_for) continue;
      for (std::size_t b = 0; b < join.own.size(); ++b) {
        const std::size_t d = flip_of[join.own[b]];
        if (d < n_) parts_[d].push_back({limits_.size(), b});
      }
      limits_.push_back(allowed);
    }
  }

  // True if the search is over.
  bool descend(std::size_t d, double error, double cost) {
    if (--steps_left_ < 0) return true;
    if (d == n_) return reach(error, cost);
    const bool flips_first = std::abs(error + gain_[d][d]) < std::abs(error);
    for (const bool is_flipped : {flips_first, !flips_first}) {
      const double next = is_flipped ? error + gain_[d][d] : error;
      const double limit = best_error_ + area_rounding;
      if (next + lowest_[d + 1] > limit || next + highest_[d + 1] < -limit) continue;
      const double next_cost = is_flipped ? cost + flips_[d].cost : cost;
      if (best_error_ <= area_rounding && next_cost + cheapest_[d + 1] >= best_cost_) continue;
      const std::size_t mark = undo_.size();
      bool is_over = false;
      if (is_flipped) move_handles(d, 1.0);
      if (handles_are_in_reach(d + 1) && narrow(d, is_ceiling_[d] != is_flipped)) {
        for (std::size_t e = d + 1; e < n_; ++e) gain_[d + 1][e] = gain_[d][e] + (is_flipped ? twist_[d][e] : 0.0);
        chosen_ = is_flipped ? chosen_ | 1U << d : chosen_ & ~(1U << d);
        is_over = descend(d + 1, next, next_cost);
      }
      if (is_flipped) move_handles(d, -1.0);
      for (; undo_.size() > mark; undo_.pop_back()) limits_[undo_.back().first] = undo_.back().second;
      if (is_over) return true;
    }
    return false;
  }
  void move_handles(std::size_t d, double way) {
    for (Handle& handle : handles_) handle.off += way * handle.move[d];
  }
  bool handles_are_in_reach(std::size_t d) const {
    return std::all_of(handles_.begin(), handles_.end(), [&](const Handle& handle) {
      const Point low = handle.off + handle.lowest[d];
      const Point high = handle.off + handle.highest[d];
      return low.cwiseMax(-high).cwiseMax(0.0).norm() <= handle.most + whole;
    });
  }
  // Leaves joins the choices with this floor or ceiling; false if one has none left.
  bool narrow(std::size_t d, bool is_ceiling) {
    for (const auto& [limit, bit] : parts_[d]) {
      undo_.emplace_back(limit, limits_[limit]);
      limits_[limit] &= is_ceiling ? with_ceiling(bit) : ~with_ceiling(bit);
      if (limits_[limit].none()) return false;
    }
    return true;
  }
  bool reach(double error, double cost) {
    const double off = std::abs(error);
    const bool is_nearer = off < best_error_ - area_rounding;
    if (!is_nearer && (off > best_error_ + area_rounding || cost >= best_cost_)) return false;
    best_error_ = off;
    best_cost_ = cost;
    best_ = chosen_;
    return off <= good_;
  }

  std::vector<WholeNumbers>& contours_;
  std::vector<Flip> flips_;
  std::size_t n_;
  std::array<std::array<double, most_flips>, most_flips> twist_{};     // what two flips add beyond each alone
  std::array<std::array<double, most_flips>, most_flips + 1> gain_{};  // per depth, with the flips made before
  std::array<double, most_flips + 1> lowest_{};                        // that the flips from here on can add
  std::array<double, most_flips + 1> highest_{};
  std::array<double, most_flips + 1> cheapest_{};
  std::array<std::vector<Part>, most_flips> parts_;
  std::vector<Handle> handles_;
  std::vector<Choices> limits_;  // per join: what the flips made leave
  std::vector<std::pair<std::size_t, Choices>> undo_;
  std::array<bool, most_flips> is_ceiling_{};
  Chosen chosen_ = 0;
  Chosen best_ = 0;
  double best_error_ = 0.0;
  double best_cost_ = 0.0;
  double good_ = 0.0;
  int steps_left_ = 0;
};

using Flips = std::vector<FlipSearch::Flip>;

Flips free_flips(const std::vector<WholeNumbers>& contours) {
  Flips flips;
  for (std::size_t c = 0; c < contours.size(); ++c) {
    const std::vector<double> gain = contours[c].gains();
    for (std::size_t k = 0; k < gain.size(); ++k) {
      if (contours[c].is_free(k)) flips.push_back({c, k, contours[c].step(k) * gain[k], contours[c].cost(k)});
    }
  }
  return flips;
}

// As many as one search chooses for: a few that change the area most, and those that take the outline least away, with
// the others of their joins. Every round begins with others.
Flips some_of(const Flips& all, const std::vector<WholeNumbers>& contours, std::size_t round) {
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return all[a].cost < all[b].cost; });
  const std::size_t first = round * (most_flips - widest) % order.size();
  std::rotate(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(first), order.end());
  std::vector<std::size_t> wide = order;
  std::partial_sort(wide.begin(), wide.begin() + static_cast<std::ptrdiff_t>(widest), wide.end(),
                    [&](std::size_t a, std::size_t b) { return std::abs(all[a].gain) > std::abs(all[b].gain); });
  Flips some;
  std::vector<bool> is_taken(all.size(), false);
  const auto take = [&](std::size_t f) {
    if (is_taken[f] || some.size() == most_flips) return;
    is_taken[f] = true;
    some.push_back(all[f]);
  };
  for (std::size_t w = 0; w < widest; ++w) take(wide[w]);
  for (const std::size_t f : order) {
    if (some.size() == most_flips) break;
    take(f);
    for (const Join& join : contours[all[f].contour].joins()) {
      if (!is_among(all[f].unknown, join.own)) continue;
      for (std::size_t g = 0; g < all.size(); ++g) {
        if (all[g].contour == all[f].contour && is_among(all[g].unknown, join.own)) take(g);
      }
    }
  }
  return some;
}

double error_of(const std::vector<WholeNumbers>& contours) {
  double error = 0.0;
  for (const WholeNumbers& contour : contours) error += contour.error();
  return error;
}

}  // namespace

std::vector<Rounding> round_keeping_area(const std::vector<Unrounded>& contours) {
  std::vector<WholeNumbers> whole_numbers;
  whole_numbers.reserve(contours.size());
  double scale = 0.0;
  double plain_error = 0.0;
  for (const Unrounded& contour : contours) {
    const auto& [edited, original, rules, goal] = contour;
    if (!has_same_structure(edited, original)) {
      throw InvalidInput("round_keeping_area: the contours differ in structure");
    }
    if (!goal.is_new.empty() && goal.is_new.size() != edited.kinds().size()) {
      throw InvalidInput(
          text("round_keeping_area: ", goal.is_new.size(), " marks for ", edited.point_count(), " points"));
    }
    whole_numbers.emplace_back(contour);
    plain_error += whole_numbers.back().plain_error();
    scale = std::max(scale, goal.scale);
  }

  double error = error_of(whole_numbers);
  Flips flips = free_flips(whole_numbers);
  if (flips.size() <= most_exact) {
    constexpr double never = -1.0;
    FlipSearch(whole_numbers, std::move(flips)).run(error, never, std::numeric_limits<int>::max());
    error = error_of(whole_numbers);
  } else {
    const bool is_whole = flips.size() <= most_flips;
    for (std::size_t round = 0; round < most_rounds && std::abs(error) > good_area * scale; ++round) {
      if (round > 0) flips = free_flips(whole_numbers);
      FlipSearch(whole_numbers, is_whole ? flips : some_of(flips, whole_numbers, round))
          .run(error, good_area * scale, most_steps);
      error = error_of(whole_numbers);
      if (is_whole) break;
    }
  }
  for (std::size_t c = 0; c < contours.size() && std::abs(error) > enough_area * scale; ++c) {
    if (contours[c].goal.beyond_unit == BeyondUnit::Never) continue;
    const double enough = std::clamp(std::abs(plain_error), good_area * scale, enough_area * scale);
    if (whole_numbers[c].go_beyond(error, enough)) error = error_of(whole_numbers);
  }
  std::vector<Rounding> roundings;
  roundings.reserve(contours.size());
  for (const WholeNumbers& contour : whole_numbers) roundings.push_back(contour.result());
  return roundings;
}

Rounding round_keeping_area(const BezierContour& edited, const BezierContour& original, const OutlineRules& rules,
                            const RoundingGoal& goal) {
  return std::move(round_keeping_area({{edited, original, rules, goal}}).front());
}

}  // namespace fontcore
