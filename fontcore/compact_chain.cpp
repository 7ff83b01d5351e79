#include "fontcore/compact_chain.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fontcore/profile.h"

namespace fontcore::compact {

namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Handles stay between these shares of the arc below their curve.
constexpr double shortest_handle = 0.03;
constexpr double longest_handle = 1.2;
// A step moves no handle and no join by more than this share of the arc, and turns no tangent by more.
constexpr double longest_step = 0.35;
constexpr double largest_turn = 0.35;  // radians
// Pairs of control points, each once.
constexpr int pair_of[4][4] = {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};

}  // namespace

Bezier Chain::piece(int index) const {
  const Join& a = joins[at(index)];
  const Join& b = joins[at(next(index))];
  if (kind == CurveKind::Quadratic) return {{a.place, top[at(index)], b.place, Point::Zero()}, 2};
  return {{a.place, a.place + a.tangent * out[at(index)], b.place - b.tangent * in[at(index)], b.place}, 3};
}

Chain lay_chain(const Stretch& stretch, CurveKind kind, std::vector<Join> joins, std::vector<int> breaks) {
  Chain chain;
  chain.kind = kind;
  chain.is_closed = stretch.is_closed;
  chain.joins = std::move(joins);
  chain.breaks = std::move(breaks);
  for (std::size_t i = 0; i + 1 < chain.breaks.size(); ++i) {
    const double arc = stretch.samples[at(chain.breaks[i + 1])].s - stretch.samples[at(chain.breaks[i])].s;
    chain.arc.push_back(arc);
    chain.out.push_back(arc / 3.0);
    chain.in.push_back(arc / 3.0);
  }
  return chain;
}

ChainFit::ChainFit(const Stretch& stretch, Chain chain) : stretch_(stretch), chain_(std::move(chain)) {
  if (chain_.kind == CurveKind::Quadratic) place_quadratics();
  variables_ = count_variables();
  blocked_.assign(at(variables_), 0);
  if (chain_.kind == CurveKind::Quadratic) keep_in_order();
  const auto& samples = stretch.samples;
  const int first = chain_.breaks.front();
  const int last = chain_.breaks.back();
  // Of a closed stretch one round; of an open one also what lies beyond its ends.
  from_ = stretch.is_closed ? first : 0;
  feet_.resize(stretch.is_closed ? at(last - first) : samples.size());
  for (int m = 0; m < static_cast<int>(feet_.size()); ++m) {
    const int sample = from_ + m;
    Foot& foot = feet_[at(m)];
    if (sample < first || sample > last) {
      foot.piece = sample < first ? 0 : chain_.size() - 1;
      foot.u = sample < first ? -1.0 : 2.0;
      continue;
    }
    const auto next = std::upper_bound(chain_.breaks.begin(), chain_.breaks.end() - 1, sample);
    foot.piece = static_cast<int>(next - chain_.breaks.begin()) - 1;
    foot.piece = std::min(foot.piece, chain_.size() - 1);
    foot.u = (samples[at(sample)].s - samples[at(chain_.breaks[at(foot.piece)])].s) / chain_.arc[at(foot.piece)];
  }
  worst_ = project(3);
}

// A quadratic's handle lies on the rails of the joins at its ends: free, on one line, or where two lines meet.
void ChainFit::place_quadratics() {
  const int k = chain_.size();
  top_base_.resize(at(k));
  top_by_.assign(at(k), {});
  chain_.top.resize(at(k));
  for (int i = 0; i < k; ++i) {
    const Join& a = chain_.joins[at(i)];
    const Join& b = chain_.joins[at(chain_.next(i))];
    const bool rail_a = !a.moves && !a.is_corner;
    const bool rail_b = !b.moves && !b.is_corner;
    const double sine = cross(a.tangent, b.tangent);
    const Point chord = b.home - a.home;
    // Where the end tangents meet, if they do ahead of one and behind the other.
    const double ahead = cross(chord, b.tangent) / sine;
    const double behind = cross(a.tangent, chord) / sine;
    const bool meets = std::abs(sine) > 1e-3 && ahead > 0.0 && behind > 0.0 && ahead < 2.0 * chain_.arc[at(i)] &&
                       behind < 2.0 * chain_.arc[at(i)];
    const Point meeting = meets ? Point(a.home + ahead * a.tangent) : Point(0.5 * (a.home + b.home));
    Point& base = top_base_[at(i)];
    auto& by = top_by_[at(i)];
    base = meeting;
    if (rail_a && rail_b) {
      if (!meets) base = 0.5 * (a.home + b.home);
    } else if (rail_a) {
      if (!meets) base = a.home + 0.5 * chain_.arc[at(i)] * a.tangent;
      by = {a.tangent};
    } else if (rail_b) {
      if (!meets) base = b.home - 0.5 * chain_.arc[at(i)] * b.tangent;
      by = {b.tangent};
    } else {
      by = {Point::UnitX(), Point::UnitY()};
    }
    chain_.top[at(i)] = base;
  }
}

int ChainFit::count_variables() {
  const bool cubic = chain_.kind == CurveKind::Cubic;
  int count = 0;
  join_variable_.assign(chain_.joins.size(), 0);
  piece_variable_.assign(at(chain_.size()), 0);
  for (std::size_t j = 0; j < chain_.joins.size(); ++j) {
    const Join& join = chain_.joins[j];
    join_variable_[j] = count;
    if (cubic) count += (join.moves ? 2 : 0) + (join.turns ? 1 : 0);
    if (join.slides) ++count;
    if (j >= piece_variable_.size()) continue;
    piece_variable_[j] = count;
    count += cubic ? 2 : static_cast<int>(top_by_[j].size());
  }
  return count;
}

void ChainFit::find_entries(int piece, std::vector<Entry>& list) const {
  list.clear();
  const int ends[2] = {piece, chain_.next(piece)};
  if (chain_.kind == CurveKind::Quadratic) {
    const auto follow_top = [&](int index, int control, double share) {
      const auto& by = top_by_[at(index)];
      for (std::size_t v = 0; v < by.size(); ++v)
        list.push_back({piece_variable_[at(index)] + static_cast<int>(v), control, share * by[v]});
    };
    follow_top(piece, 1, 1.0);
    for (int e = 0; e < 2; ++e) {
      const Join& join = chain_.joins[at(ends[e])];
      if (join.moves) {
        follow_top(ends[e] == 0 ? chain_.size() - 1 : ends[e] - 1, 2 * e, 0.5);
        follow_top(ends[e], 2 * e, 0.5);
      } else if (join.slides) {
        list.push_back({join_variable_[at(ends[e])], 2 * e, join.rail});
      }
    }
    return;
  }
  for (int e = 0; e < 2; ++e) {
    const Join& join = chain_.joins[at(ends[e])];
    const int node = e == 0 ? 0 : 3;
    const int handle = e == 0 ? 1 : 2;
    const double reach = e == 0 ? chain_.out[at(piece)] : -chain_.in[at(piece)];
    int variable = join_variable_[at(ends[e])];
    if (join.moves) {
      for (const Point& axis : {Point(1.0, 0.0), Point(0.0, 1.0)}) {
        list.push_back({variable, node, axis});
        list.push_back({variable++, handle, axis});
      }
    }
    if (join.slides) {
      list.push_back({variable, node, join.rail});
      list.push_back({variable++, handle, join.rail});
    }
    if (join.turns) list.push_back({variable++, handle, reach * left_of(join.tangent)});
    list.push_back({piece_variable_[at(piece)] + e, handle, e == 0 ? join.tangent : Point(-join.tangent)});
  }
}

// The point of the chain nearest to every sample, by Newton's method from where it was; over joins into the next piece.
template <int degree>
double ChainFit::project(int newton) {
  const int k = chain_.size();
  polynomials_.resize(at(k));
  for (int i = 0; i < k; ++i) {
    const Bezier b = chain_.piece(i);
    Polynomial& q = polynomials_[at(i)];
    for (int axis = 0; axis < 2; ++axis) {
      double* const c = axis == 0 ? q.x : q.y;
      const auto p = [&](std::size_t j) { return b.p[j][axis]; };
      c[0] = p(0);
      if constexpr (degree == 3) {
        c[1] = 3.0 * (p(1) - p(0));
        c[2] = 3.0 * (p(2) - 2.0 * p(1) + p(0));
        c[3] = p(3) - p(0) - 3.0 * (p(2) - p(1));
      } else {
        c[1] = 2.0 * (p(1) - p(0));
        c[2] = p(2) - 2.0 * p(1) + p(0);
      }
    }
  }
  const auto place = [](const double* c, double u) {
    if constexpr (degree == 3) return ((c[3] * u + c[2]) * u + c[1]) * u + c[0];
    return (c[2] * u + c[1]) * u + c[0];
  };
  const auto slope_at = [](const double* c, double u) {
    if constexpr (degree == 3) return (3.0 * c[3] * u + 2.0 * c[2]) * u + c[1];
    return 2.0 * c[2] * u + c[1];
  };
  const auto bend_at = [](const double* c, double u) {
    if constexpr (degree == 3) return 6.0 * c[3] * u + 2.0 * c[2];
    return 2.0 * c[2];
  };
  const Join& first = chain_.joins.front();
  const Join& last = chain_.joins.back();
  double worst = 0.0;
  for (std::size_t m = 0; m < feet_.size(); ++m) {
    Foot& foot = feet_[m];
    const Point& q = sample(m).place;
    int piece = foot.piece;
    double u = std::clamp(foot.u, 0.0, 1.0);
    bool before = false;
    bool beyond = false;
    int hops = 0;
    for (int round = 0; round < newton + hops; ++round) {
      const Polynomial& c = polynomials_[at(piece)];
      const double ex = place(c.x, u) - q.x();
      const double ey = place(c.y, u) - q.y();
      const double dx = slope_at(c.x, u);
      const double dy = slope_at(c.y, u);
      const double bx = bend_at(c.x, u);
      const double by = bend_at(c.y, u);
      const double square = dx * dx + dy * dy;
      const double slope = std::max(square + ex * bx + ey * by, 0.3 * square) + 1e-12;
      u -= std::clamp((ex * dx + ey * dy) / slope, -0.3, 0.3);
      before = beyond = false;
      if (u < 0.0) {
        if ((chain_.is_closed || piece > 0) && hops < 2) {
          piece = piece == 0 ? k - 1 : piece - 1;
          u = 1.0 + std::max(-0.2, u);
          ++hops;
        } else {
          before = piece == 0 && !chain_.is_closed;
          u = 0.0;
        }
      } else if (u > 1.0) {
        if ((chain_.is_closed || piece + 1 < k) && hops < 2) {
          piece = piece + 1 == k ? 0 : piece + 1;
          u = std::min(0.2, u - 1.0);
          ++hops;
        } else {
          beyond = piece + 1 == k && !chain_.is_closed;
          u = 1.0;
        }
      }
    }
    foot.piece = piece;
    foot.u = u;
    // Beyond an end that slides there is its line: the bounds of the slide keep the distance.
    foot.is_active = !(before && (first.slides || first.is_cut)) && !(beyond && (last.slides || last.is_cut));
    foot.residual = 0.0;
    if (!foot.is_active) continue;
    const Polynomial& c = polynomials_[at(piece)];
    const double ex = place(c.x, u) - q.x();
    const double ey = place(c.y, u) - q.y();
    const double dx = slope_at(c.x, u);
    const double dy = slope_at(c.y, u);
    const double scale = 1.0 / std::sqrt(dx * dx + dy * dy + 1e-18);
    Point normal(-dy * scale, dx * scale);
    double distance = ex * normal.x() + ey * normal.y();
    const double square = ex * ex + ey * ey;
    if (square > 1e-18 && distance * distance < 0.81 * square) {  // the foot is an end: the distance is to a point
      distance = std::sqrt(square);
      normal = Point(ex / distance, ey / distance);
    }
    foot.normal = normal;
    foot.residual = distance;
    worst = std::max(worst, std::abs(distance));
  }
  work_ += static_cast<long>(feet_.size());
  return worst;
}

void ChainFit::apply(const Eigen::VectorXd& step, double scale) {
  const bool cubic = chain_.kind == CurveKind::Cubic;
  for (std::size_t j = 0; j < chain_.joins.size(); ++j) {
    Join& join = chain_.joins[j];
    int variable = join_variable_[j];
    if (join.moves && cubic) {
      join.place.x() += scale * step[variable++];
      join.place.y() += scale * step[variable++];
    }
    if (join.slides) {
      if (!cubic) blocked_[at(variable)] = 0;
      const double to = join.slid + scale * step[variable];
      join.slid = std::clamp(to, join.slide_low, join.slide_high);
      if (!cubic && to >= join.slide_high) blocked_[at(variable)] = 1;
      if (!cubic && to <= join.slide_low) blocked_[at(variable)] = -1;
      ++variable;
      join.place = join.home + join.slid * join.rail;
    }
    if (join.turns && cubic) {
      const double to = std::clamp(join.turned + scale * step[variable++], join.turn_low, join.turn_high);
      const double by = to - join.turned;
      join.turned = to;
      join.tangent = std::cos(by) * join.tangent + std::sin(by) * left_of(join.tangent);
    }
  }
  for (int i = 0; i < chain_.size(); ++i) {
    const int variable = piece_variable_[at(i)];
    if (cubic) {
      const double arc = chain_.arc[at(i)];
      const auto moved = [&](double handle, int v) {
        return std::clamp(handle + scale * step[v], shortest_handle * arc, longest_handle * arc);
      };
      chain_.out[at(i)] = moved(chain_.out[at(i)], variable);
      chain_.in[at(i)] = moved(chain_.in[at(i)], variable + 1);
    } else {
      const auto& by = top_by_[at(i)];
      for (std::size_t v = 0; v < by.size(); ++v) blocked_[at(variable) + v] = 0;
      for (std::size_t v = 0; v < by.size(); ++v)
        chain_.top[at(i)] += scale * step[variable + static_cast<int>(v)] * by[v];
    }
  }
  if (!cubic) keep_in_order();
}

// Along a rail a node stays behind the handle ahead of it, and ahead of the one behind: of a node and a handle that
// slide along it the node goes first. At a corner the handle stays where it turns no more than it may. Nodes that move
// are implied.
void ChainFit::keep_in_order() {
  const int k = chain_.size();
  constexpr double at_bound = 1e-9;
  for (int j = 0; j < static_cast<int>(chain_.joins.size()); ++j) {
    Join& join = chain_.joins[at(j)];
    if (join.moves) continue;
    for (const bool is_ahead : {false, true}) {
      if (!chain_.is_closed && (is_ahead ? j == k : j == 0)) continue;
      const int piece = is_ahead ? j : j == 0 ? k - 1 : j - 1;
      const double sense = is_ahead ? 1.0 : -1.0;
      const auto& by = top_by_[at(piece)];
      Point& top = chain_.top[at(piece)];
      const double least = std::max(shortest_handle * chain_.arc[at(piece)], join.least_handle);
      const Point handle = sense * (top - join.place);
      if (join.is_corner) {
        const double turn = angle(join.tangent, handle);
        const double to = std::clamp(turn, join.turn_low, join.turn_high);
        if (to == turn || by.empty()) continue;
        const Point limit = std::cos(to) * join.tangent + std::sin(to) * left_of(join.tangent);
        if (by.size() == 2) {
          top = join.place + sense * std::max(least, handle.dot(limit)) * limit;
        } else if (const double sine = cross(by[0], limit); std::abs(sine) > 0.1) {
          top += cross(join.place - top, limit) / sine * by[0];
        }
        continue;
      }
      const double lacks = least - handle.dot(join.tangent);
      if (!(lacks > -at_bound)) continue;
      if (!by.empty()) {
        top += sense * lacks * join.tangent;
        blocked_[at(piece_variable_[at(piece)])] = is_ahead ? -1 : 1;
      } else if (join.slides) {
        join.slid = std::clamp(join.slid - sense * lacks, join.slide_low, join.slide_high);
        join.place = join.home + join.slid * join.rail;
        blocked_[at(join_variable_[at(j)])] = is_ahead ? 1 : -1;
      }
    }
  }
  for (std::size_t j = 0; j < chain_.joins.size(); ++j) {
    if (!chain_.joins[j].moves) continue;
    const std::size_t before = j == 0 ? at(k - 1) : j - 1;
    chain_.joins[j].place = 0.5 * (chain_.top[before] + chain_.top[j]);
  }
}

template <int degree>
void ChainFit::sum_up(std::vector<Sums>& sums, double& weights, double& squares) const {
  for (const Foot& foot : feet_) {
    if (!foot.is_active) continue;
    const double u = foot.u;
    const double v = 1.0 - u;
    double b[4];
    if constexpr (degree == 3) {
      b[0] = v * v * v;
      b[1] = 3.0 * v * v * u;
      b[2] = 3.0 * v * u * u;
      b[3] = u * u * u;
    } else {
      b[0] = v * v;
      b[1] = 2.0 * v * u;
      b[2] = u * u;
    }
    Sums& s = sums[at(foot.piece)];
    const double w = foot.weight;
    const double nx = foot.normal.x();
    const double ny = foot.normal.y();
    weights += w;
    squares += w * foot.residual * foot.residual;
    const double wxx = w * nx * nx;
    const double wxy = w * nx * ny;
    const double wyy = w * ny * ny;
    const double rx = w * foot.residual * nx;
    const double ry = w * foot.residual * ny;
    for (int i = 0; i <= degree; ++i) {
      for (int j = i; j <= degree; ++j) {
        const double both = b[i] * b[j];
        s.xx[pair_of[i][j]] += wxx * both;
        s.xy[pair_of[i][j]] += wxy * both;
        s.yy[pair_of[i][j]] += wyy * both;
      }
      s.x[i] -= rx * b[i];
      s.y[i] -= ry * b[i];
    }
  }
}

// Gauss-Newton on the orthogonal distances; after two plain rounds weights are multiplied by the distances (Lawson),
// which leads from least squares to the least maximum. The weighted mean square at a solution bounds that from below.
bool ChainFit::solve(double distance, int rounds, Until until) {
  if (worst_ <= distance && until == Until::Within) return true;
  for (Foot& foot : feet_) foot.weight = 1.0;
  const bool cubic = chain_.kind == CurveKind::Cubic;
  const int k = chain_.size();
  const int n = variables_;
  if (n == 0) return worst_ <= distance;
  Chain best = chain_;
  std::vector<Foot> best_feet = feet_;
  double least = worst_;

  std::vector<Sums> sums(at(k));
  std::vector<int> first(at(n));
  std::vector<double> diagonal(at(n));
  std::vector<std::vector<Entry>> follow(at(k));
  Eigen::VectorXd limit(n);
  for (int i = 0; i < k; ++i) {
    follow[at(i)].reserve(14);
    find_entries(i, follow[at(i)]);
    for (const Entry& e : follow[at(i)]) limit[e.variable] = std::numeric_limits<double>::infinity();
  }
  for (int i = 0; i < k; ++i) {  // a variable that two pieces share has the smaller limit
    for (const Entry& e : follow[at(i)])
      limit[e.variable] = std::min(limit[e.variable], longest_step * chain_.arc[at(i)]);
  }
  if (cubic) {
    for (std::size_t j = 0; j < chain_.joins.size(); ++j) {
      const Join& join = chain_.joins[j];
      if (join.turns) limit[join_variable_[j] + (join.moves ? 2 : 0) + (join.slides ? 1 : 0)] = largest_turn;
    }
  }
  for (int v = 0; v < n; ++v) first[at(v)] = v;
  for (int i = 0; i < k; ++i) {
    int least_variable = n;
    for (const Entry& e : follow[at(i)]) least_variable = std::min(least_variable, e.variable);
    for (const Entry& e : follow[at(i)]) first[at(e.variable)] = std::min(first[at(e.variable)], least_variable);
  }

  ProfileSystem system(first);
  Eigen::VectorXd right(n);
  double bound_before = std::numeric_limits<double>::infinity();
  double least_before = least;
  int stalled = 0;
  for (int round = 0; round < rounds; ++round) {
    std::fill(sums.begin(), sums.end(), Sums{});
    double weights = 0.0;
    double squares = 0.0;
    if (cubic) {
      sum_up<3>(sums, weights, squares);
    } else {
      sum_up<2>(sums, weights, squares);
    }

    system.clear();
    right.setZero();
    for (int i = 0; i < k; ++i) {
      if (round > 0 && cubic) find_entries(i, follow[at(i)]);  // those of quadratics stay
      const Sums& s = sums[at(i)];
      for (const Entry& e : follow[at(i)]) {
        right[e.variable] += e.by.x() * s.x[e.control] + e.by.y() * s.y[e.control];
        double* const row = system.row(e.variable);
        for (const Entry& f : follow[at(i)]) {
          if (f.variable > e.variable) continue;
          const int c = pair_of[e.control][f.control];
          row[f.variable] += e.by.x() * (f.by.x() * s.xx[c] + f.by.y() * s.xy[c]) +
                             e.by.y() * (f.by.x() * s.xy[c] + f.by.y() * s.yy[c]);
        }
      }
    }
    if (!cubic) {
      for (int v = 0; v < n; ++v) {
        if (!(blocked_[at(v)] * right[v] > 0.0)) continue;
        right[v] = 0.0;
        for (int w = first[at(v)]; w < v; ++w) system.entry(v, w) = 0.0;
        for (int w = v + 1; w < n; ++w) {
          if (first[at(w)] <= v) system.entry(w, v) = 0.0;
        }
      }
    }
    double largest = 0.0;
    for (int v = 0; v < n; ++v) largest = std::max(largest, system.entry(v, v));
    constexpr double damping = 1e-6;
    for (int v = 0; v < n; ++v) {
      double& pivot = system.entry(v, v);
      pivot += damping * largest + 10.0 * damping * pivot + 1e-12;
    }
    if (!system.factor()) break;
    const Eigen::VectorXd step = system.solve(right);
    const double bound = std::sqrt(std::max(0.0, squares - step.dot(right)) / std::max(weights, 1e-30));
    if (until == Until::Within) {
      if (!cubic) {
        // Near its solution the bound is one on the curve too; and what wins little in a while wins no more.
        if (round > 0 && bound > 1.02 * distance && step.cwiseAbs().maxCoeff() < 0.5 * distance) break;
        if (round > 4 && round % 4 == 0 && least > std::max(0.9 * least_before, 1.1 * distance)) break;
        if (round % 4 == 0) least_before = least;
      }
      if (round >= 6 && bound > distance && bound > 0.97 * bound_before) {
        if (++stalled > 1) break;
      } else {
        stalled = 0;
      }
      if (round >= 4 && bound > 12.0 * distance && bound > 0.7 * bound_before) break;
    } else {
      if (round % 6 == 5) {
        if (least > 0.95 * least_before) break;
        least_before = least;
      }
      if (bound > 0.93 * least) break;
    }
    bound_before = bound;
    double scale = 1.0;
    for (int v = 0; v < n; ++v) {
      const double size = std::abs(step[v]);
      if (size > limit[v]) scale = std::min(scale, limit[v] / size);
    }
    apply(step, scale);
    worst_ = project(round < 3 ? 2 : 1);
    if (worst_ < least) {
      least = worst_;
      best = chain_;
      best_feet = feet_;
      if (least <= distance && until == Until::Within) return true;
    }
    if (round >= 2) {
      double heaviest = 0.0;
      for (Foot& foot : feet_) {
        foot.weight *= 0.02 + std::abs(foot.residual) / worst_;
        heaviest = std::max(heaviest, foot.weight);
      }
      for (Foot& foot : feet_) foot.weight = std::max(foot.weight / heaviest, 1e-5);
    }
  }
  chain_ = std::move(best);
  feet_ = std::move(best_feet);
  worst_ = least;
  return least <= distance;
}

namespace {

constexpr double smooth_sine = 0.0253;  // of 1.45 degrees: 1.5 are promised

bool is_smooth(const Point& a, const Point& b) {
  return a.dot(b) > 0.0 && cross(a, b) * cross(a, b) <= smooth_sine * smooth_sine * a.squaredNorm() * b.squaredNorm();
}

// Whole numbers near a value, nearest first: the two beside it, and `reach` more on each side. Numbers are whole if
// `fraction` added makes them so. In every order and choice an odd function of the value, so that mirroring mirrors.
std::vector<double> whole_near(double value, double fraction, int reach) {
  const double below = std::floor(value + fraction) - fraction;
  std::vector<double> near;
  const bool is_whole = value - below < 1e-9 || below + 1.0 - value < 1e-9;
  const double base = value - below < 0.5 ? below : below + 1.0;
  if (is_whole) {
    for (int d = -reach; d <= reach; ++d) near.push_back(base + d);
  } else {
    for (int d = -reach; d <= reach + 1; ++d) near.push_back(below + d);
  }
  std::sort(near.begin(), near.end(), [&](double a, double b) {
    const double da = std::abs(a - value);
    const double db = std::abs(b - value);
    return da != db ? da < db : std::abs(a) < std::abs(b);
  });
  return near;
}

std::vector<Point> lattice_near(const Point& value, const Point& fraction, int reach) {
  const auto x = whole_near(value.x(), fraction.x(), reach);
  const auto y = whole_near(value.y(), fraction.y(), reach);
  std::vector<Point> points;
  points.reserve(x.size() * y.size());
  for (const double a : x) {
    for (const double b : y) points.emplace_back(a, b);
  }
  return points;
}

struct State {
  Point node;
  Point in;   // handle before it
  Point out;  // and after it
  double rank;
};

}  // namespace

ChainFit::Rounded ChainFit::rounded(const Point& fraction, double most_distance, int reach,
                                    std::size_t most_states) const {
  const bool cubic = chain_.kind == CurveKind::Cubic;
  const int k = chain_.size();
  const int count = static_cast<int>(chain_.joins.size());
  std::vector<Bezier> pieces;
  for (int i = 0; i < k; ++i) pieces.push_back(chain_.piece(i));
  const auto in_of = [&](int piece) { return pieces[at(piece)].p[cubic ? 2 : 1]; };
  const auto out_of = [&](int piece) { return pieces[at(piece)].p[1]; };

  // The whole-number places of every join and of the handles beside it.
  std::vector<std::vector<State>> states(at(count));
  for (int j = 0; j < count; ++j) {
    const Join& join = chain_.joins[at(j)];
    const bool has_in = chain_.is_closed || j > 0;
    const bool has_out = chain_.is_closed || j + 1 < count;
    const int before = j == 0 ? k - 1 : j - 1;
    const Point in = has_in ? in_of(before) : join.place;
    const Point out = has_out ? out_of(j) : join.place;
    const Point normal = left_of(join.tangent);
    const bool tangent_is_fixed = !join.turns && !(join.moves && !cubic);
    const int axis = join.tangent.y() == 0.0 ? 0 : 1;  // along which the handles lie, if they lie along one
    const bool is_off_grid = join.is_held && whole_near(join.place[1 - axis], fraction[1 - axis], 0).size() > 1;
    const bool is_axial = tangent_is_fixed && join.tangent[1 - axis] == 0.0 && !(join.moves && !cubic) && !is_off_grid;

    std::vector<Point> nodes;
    const bool implied = join.moves && !cubic;
    if (implied) {
      nodes = {join.place};  // it follows its handles
    } else if (join.is_held) {
      nodes = {join.place};
    } else if (join.moves) {
      nodes = lattice_near(join.place, fraction, 0);
    } else if (join.slides && (join.rail.x() == 0.0 || join.rail.y() == 0.0)) {
      const int along = join.rail.y() == 0.0 ? 0 : 1;
      for (const double v : whole_near(join.place[along], fraction[along], 0)) {
        Point node = join.home;
        node[along] = v;
        nodes.push_back(node);
      }
      for (Point& node : nodes) node[1 - along] = whole_near(node[1 - along], fraction[1 - along], 0).front();
    } else if (join.slides) {
      nodes = lattice_near(join.place, fraction, 0);
    } else {
      nodes = {lattice_near(join.place, fraction, 0).front()};
    }
    const auto square = [](double x) { return x * x; };
    // Across the tangent a handle counts, along it hardly.
    const auto handle_rank = [&](const Point& d) { return 0.4 * square(d.dot(normal)) + 0.05 * d.squaredNorm(); };
    constexpr std::size_t most_handles = 9;
    const auto handles = [&](const Point& handle, const Point& node) {
      std::vector<Point> list;
      if (!is_axial) {
        list = lattice_near(handle, fraction, reach);
        if (!cubic || list.size() <= most_handles) return list;
        std::stable_sort(list.begin(), list.end(), [&](const Point& a, const Point& b) {
          return handle_rank(a - handle) < handle_rank(b - handle);
        });
        list.resize(most_handles);
        return list;
      }
      for (const double v : whole_near(handle[axis], fraction[axis], reach)) {
        Point p = node;
        p[axis] = v;
        list.push_back(p);
      }
      return list;
    };
    auto& list = states[at(j)];
    list.reserve(nodes.size() * most_handles * most_handles);
    for (const Point& wished : nodes) {
      const std::vector<Point> ins = has_in ? handles(in, wished) : std::vector<Point>{wished};
      const std::vector<Point> outs = has_out ? handles(out, wished) : std::vector<Point>{wished};
      for (const Point& a : ins) {
        for (const Point& b : outs) {
          const Point node = implied ? Point(0.5 * (a + b)) : wished;
          const Point arriving = node - a;
          const Point leaving = b - node;
          if (has_in && !(arriving.dot(join.tangent) > 0.0)) continue;
          if (has_out && !(leaving.dot(join.tangent) > 0.0)) continue;
          if (has_in && has_out && !implied && !is_smooth(arriving, leaving)) continue;
          if (has_in != has_out) {
            const Point own = has_in ? arriving : leaving;
            if (join.is_corner) {
              const double turn = join.turned + angle(join.tangent, own);
              if (turn < join.turn_low - join.turn_slack || turn > join.turn_high + join.turn_slack) continue;
            } else {
              Point line = join.rail;
              if (join.has_line) line = has_in ? Point(join.line_end - node) : Point(node - join.line_end);
              if (!is_smooth(line, own)) continue;
              if (join.line_tangent != Point::Zero() && !is_smooth(line, join.line_tangent)) continue;
            }
          }
          const Point dn = node - join.place;
          const Point da = has_in ? Point(a - in) : Point::Zero();
          const Point db = has_out ? Point(b - out) : Point::Zero();
          const double rank = square(dn.dot(normal)) + 0.05 * dn.squaredNorm() + handle_rank(da) + handle_rank(db);
          list.push_back({node, a, b, rank});
        }
      }
    }
    if (list.empty()) return {{}, {std::min(j, k - 1)}};
    // The best of them, in order; of equals those found first.
    const std::size_t count_kept = std::min(list.size(), most_states);
    std::vector<std::pair<double, std::size_t>> order(list.size());
    for (std::size_t i = 0; i < list.size(); ++i) order[i] = {list[i].rank, i};
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count_kept), order.end());
    std::vector<State> kept;
    kept.reserve(count_kept);
    for (std::size_t i = 0; i < count_kept; ++i) kept.push_back(list[order[i].second]);
    list = std::move(kept);
  }

  // The linearised distance of every sample, as a sum of what the states at both ends of its piece do. Of a quadratic
  // both ends give the one handle: it counts at the start.
  struct Share {
    double residual;
    std::array<Point, 2> node;  // how far the sample goes with the node at the start, at the end
    std::array<Point, 2> handle;
  };
  std::vector<std::vector<Share>> below(at(k));
  for (const Foot& foot : feet_) {
    if (!foot.is_active) continue;
    const auto weight = bernstein(cubic ? 3 : 2, foot.u);
    const Point& n = foot.normal;
    if (cubic) {
      below[at(foot.piece)].push_back({foot.residual, {weight[0] * n, weight[3] * n}, {weight[1] * n, weight[2] * n}});
    } else {
      below[at(foot.piece)].push_back(
          {foot.residual, {weight[0] * n, weight[2] * n}, {weight[1] * n, Point(0.0, 0.0)}});
    }
  }
  const auto add_shares = [&](int piece, const State& state, bool is_start, std::vector<double>& to) {
    const Bezier& b = pieces[at(piece)];
    const Point node = state.node - (is_start ? b.start() : b.end());
    const Point handle = is_start ? Point(state.out - b.p[1]) : Point(state.in - b.p[cubic ? 2 : 1]);
    const std::size_t end = is_start ? 0 : 1;
    for (const Share& share : below[at(piece)]) {
      to.push_back(share.node[end].dot(node) + share.handle[end].dot(handle) + (is_start ? share.residual : 0.0));
    }
  };

  constexpr double never = std::numeric_limits<double>::infinity();
  struct Path {
    double worst = never;
    std::vector<int> choice;
  };
  std::vector<std::vector<double>> cost(at(k));  // of a piece, by the state at its start, then at its end
  std::vector<double> starts;                    // shares, by state, then sample
  std::vector<double> ends;
  for (int i = 0; i < k; ++i) {
    const auto& from = states[at(i)];
    const auto& to = states[at(chain_.next(i))];
    const std::size_t count_below = below[at(i)].size();
    starts.clear();
    ends.clear();
    for (const State& s : from) add_shares(i, s, true, starts);
    for (const State& s : to) add_shares(i, s, false, ends);
    auto& table = cost[at(i)];
    table.assign(from.size() * to.size(), never);
    for (std::size_t a = 0; a < from.size(); ++a) {
      for (std::size_t b = 0; b < to.size(); ++b) {
        if (!cubic && from[a].out != to[b].in) continue;
        double worst = 0.0;
        const double* const start = starts.data() + a * count_below;
        const double* const end = ends.data() + b * count_below;
        for (std::size_t m = 0; m < count_below && worst <= most_distance; ++m)
          worst = std::max(worst, std::abs(start[m] + end[m]));
        if (worst > most_distance) continue;
        table[a * to.size() + b] = worst;
      }
    }
  }
  // For every last state the least largest distance of a path to it, below a limit, and where it came from.
  std::vector<std::vector<int>> came(at(k));
  std::vector<int> blocked;
  bool is_first = true;
  const auto sweep = [&](std::vector<double> worst, double limit) {
    for (int i = 0; i < k; ++i) {
      const auto& table = cost[at(i)];
      std::vector<double> next(states[at(chain_.next(i))].size(), limit);
      came[at(i)].assign(next.size(), -1);
      for (std::size_t a = 0; a < worst.size(); ++a) {
        if (worst[a] >= limit) continue;
        for (std::size_t b = 0; b < next.size(); ++b) {
          const double here = std::max(worst[a], table[a * next.size() + b]);
          if (here < next[b]) {
            next[b] = here;
            came[at(i)][b] = static_cast<int>(a);
          }
        }
      }
      worst = std::move(next);
      const bool is_dead = std::all_of(worst.begin(), worst.end(), [&](double w) { return w >= limit; });
      if (is_dead && is_first) {  // on from there, to find the others
        blocked.push_back(i);
        worst.assign(worst.size(), 0.0);
      }
    }
    is_first = false;
    return worst;
  };
  const auto path_to = [&](std::size_t last, double worst) {
    Path path{worst, std::vector<int>(at(k + 1), 0)};
    int state = static_cast<int>(last);
    for (int i = k; i > 0; --i) {
      path.choice[at(i)] = state;
      state = came[at(i - 1)][at(state)];
    }
    path.choice[0] = state;
    return path;
  };
  const std::vector<double> least = sweep(std::vector<double>(states[0].size(), 0.0), never);
  if (!blocked.empty()) return {{}, std::move(blocked)};
  Path best;
  if (chain_.is_closed) {
    // A path that returns to its start is no better than one to there from anywhere.
    std::vector<std::size_t> order(states[0].size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return least[a] < least[b]; });
    for (const std::size_t s : order) {
      if (least[s] >= best.worst) break;
      std::vector<double> from(states[0].size(), never);
      from[s] = 0.0;
      const double worst = sweep(std::move(from), best.worst)[s];
      if (worst < best.worst) best = path_to(s, worst);
    }
  } else {
    const auto last = std::min_element(least.begin(), least.end());
    if (*last < never) best = path_to(static_cast<std::size_t>(last - least.begin()), *last);
  }
  if (best.worst == never) return {{}, {0}};
  std::vector<Bezier> result;
  for (int i = 0; i < k; ++i) {
    const State& a = states[at(i)][at(best.choice[at(i)])];
    const State& b = states[at(chain_.next(i))][at(best.choice[at(i + 1)])];
    if (cubic) {
      result.push_back({{a.node, a.out, b.in, b.node}, 3});
    } else {
      result.push_back({{a.node, a.out, b.node, Point::Zero()}, 2});
    }
  }
  return {std::move(result), {}};
}

}  // namespace fontcore::compact
