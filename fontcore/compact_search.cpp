#include "fontcore/compact_search.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "fontcore/measure.h"

namespace fontcore::compact {

namespace {

// Long stretches are searched window by window: so many pieces at a time, the next ones so many further on.
constexpr int window_pieces = 6;
constexpr int window_step = 3;
constexpr double near_enough = 2.5;  // single curves, of the tolerance, that a chain of them begins with
// Rounding handles costs so much, font units.
constexpr double room_of_handles = 0.12;
// The part of the tolerance that the solver aims for: the rest is for what lies between the samples.
constexpr double aim = 0.985;
// How far control points may lie outside the box of their curve, as a share of its larger side.
constexpr double handle_margin = 0.5;

// The first vertices of one polyline, `most` of them, that are farther than a distance from the other, both run from
// end to end together. It looks near where the vertex before was nearest: a distance is never taken for smaller than it
// is. Closed ones repeat their first point at the end, and go on there.
std::vector<std::size_t> beyond(const std::vector<Point>& a, const std::vector<Point>& b, double limit, bool is_closed,
                                std::size_t most) {
  std::vector<std::size_t> far;
  const int n = static_cast<int>(b.size()) - 1;
  constexpr int ahead = 8;
  constexpr int behind = 5;
  int near = 0;
  for (std::size_t i = 1; is_closed && i < b.size(); ++i) {
    if ((b[i] - a[0]).squaredNorm() < (b[at(near)] - a[0]).squaredNorm()) near = static_cast<int>(i) - 1;
  }
  for (std::size_t vertex = 0; vertex < a.size() && far.size() < most; ++vertex) {
    const Point& p = a[vertex];
    double least = never;
    int nearest = near;
    const auto look = [&](int segment) {
      const int i = is_closed ? (segment + n) % n : segment;
      const Point d = b[at(i + 1)] - b[at(i)];
      const Point e = p - b[at(i)];
      const double square = d.squaredNorm();
      const double u = square > 0.0 ? std::clamp(e.dot(d) / square, 0.0, 1.0) : 0.0;
      const double distance = (e - u * d).squaredNorm();
      if (distance >= least) return false;
      least = distance;
      nearest = i;
      return true;
    };
    const int low = is_closed ? near - n / 2 : 0;
    const int high = is_closed ? near + n / 2 : n;
    int idle = 0;
    for (int i = std::max(low, near - 1); i < high && idle < ahead; ++i) idle = look(i) ? 0 : idle + 1;
    idle = 0;
    for (int i = std::min(high - 1, near - 2); i >= low && idle < behind; --i) idle = look(i) ? 0 : idle + 1;
    if (least > limit * limit) {  // where the polyline is much finer than the steps along it, farther ahead
      for (int i = near + 1; i < high && i < near + 64; ++i) look(i);
      if (least > limit * limit) far.push_back(vertex);
    }
    near = nearest;
  }
  return far;
}

double distance_from(const std::vector<Point>& line, const Point& p) {
  double distance = never;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Point d = line[i + 1] - line[i];
    const double square = d.squaredNorm();
    const double u = square > 0.0 ? std::clamp((p - line[i]).dot(d) / square, 0.0, 1.0) : 0.0;
    distance = std::min(distance, (p - line[i] - u * d).norm());
  }
  return distance;
}

// Whether an extremum lies inside a curve by more than a unit's fraction: it would want a node of its own.
bool has_extremum_within(const Bezier& b) {
  constexpr double most_within = 0.9;
  for (int axis = 0; axis < 2; ++axis) {
    const auto [low, high] = std::minmax(b.start()[axis], b.end()[axis]);
    for (const double u : extrema(b, axis)) {
      const double value = evaluate(b, u)[axis];
      if (value < low - most_within || value > high + most_within) return true;
    }
  }
  return false;
}

// Whether handles reach far beyond their curve: an editor's nuisance.
bool has_far_handle(const Bezier& b) {
  const Box box = tight_box(b);
  const Point margin = Point::Constant(handle_margin * (box.high - box.low).maxCoeff());
  for (int k = 1; k < b.degree; ++k) {
    const Point& p = b.p[at(k)];
    if ((p.array() < (box.low - margin).array()).any() || (p.array() > (box.high + margin).array()).any()) return true;
  }
  return false;
}

}  // namespace

Point tangent_at(const Bezier& b, double u) {
  if (u <= 0.0) return start_tangent(b);
  if (u >= 1.0) return end_tangent(b);
  const Point d = derivative(b, u);
  const double size = d.norm();
  return size > 1e-9 ? Point(d / size) : Point(evaluate(b, u + 1e-3) - evaluate(b, u - 1e-3)).normalized();
}

Extent extent_of(const Bezier& b) {
  Extent extent;
  if (b.degree == 1) return {(b.end() - b.start()).norm(), 0.0};
  Point place = b.start();
  Point tangent = start_tangent(b);
  for (int i = 1; i <= 8; ++i) {
    const Point next = evaluate(b, i / 8.0);
    const Point then = tangent_at(b, i / 8.0);
    extent.length += (next - place).norm();
    extent.turn += std::abs(angle(tangent, then));
    place = next;
    tangent = then;
  }
  return extent;
}

void add_polyline(const Bezier& b, double sagitta, int fewest, std::vector<Point>& to) {
  const Extent extent = extent_of(b);
  const int pieces = std::clamp(static_cast<int>(std::ceil(std::sqrt(extent.length * extent.turn / (8.0 * sagitta)))),
                                b.degree == 1 ? 6 : fewest, 400);
  for (int i = 0; i < pieces; ++i) to.push_back(evaluate(b, static_cast<double>(i) / pieces));
}

Point whole(const Settings& settings, const Point& p) {
  if (settings.options.coordinates == Coordinates::Any) return p;
  Point rounded;
  for (int axis = 0; axis < 2; ++axis) {
    const double below = std::floor(p[axis] + settings.fraction[axis]) - settings.fraction[axis];
    const double down = p[axis] - below;
    const double up = below + 1.0 - p[axis];
    const bool takes_below = down != up ? down < up : std::abs(below) < std::abs(below + 1.0);
    rounded[axis] = takes_below ? below : below + 1.0;
  }
  return rounded;
}

Point whole_near(const Settings& settings, const Point& place, const std::vector<Point>& line) {
  constexpr int around = 3;
  const Point base = whole(settings, place);
  Point best = base;
  double least = never;
  for (int x = -around; x <= around; ++x) {
    for (int y = -around; y <= around; ++y) {
      const Point p = base + Point(x, y);
      // Of two as near the one closer by, so that mirroring mirrors.
      const double cost = distance_from(line, p) + 0.02 * (p - place).norm();
      if (cost < least) {
        least = cost;
        best = p;
      }
    }
  }
  return best;
}

namespace {

class Search {
 public:
  Search(const Task& task, const Settings& settings, long& work) : task_(task), settings_(settings), work_(work) {}

  std::optional<Result> run();

 private:
  struct Path {
    double error;
    std::vector<int> breaks;
  };

  bool is_exhausted() const { return work_ > settings_.most_work; }
  Join join_at(int sample) const;
  std::vector<Join> joins_at(const std::vector<int>& breaks) const;
  const Task::Must* must_at(int sample) const;
  struct Span {
    double error;
    double out;
    double in;
  };
  Span span(int i, int j);
  double quadratic_error(int i, int j, const Join* start, const Join* end);
  const Join* rail_at(int sample) const;
  bool is_straight_between(const Join& a, const Join& b) const;
  double span_error(int i, int j) { return span(i, j).error; }
  double free_error(int i, int j);
  Chain laid(const std::vector<int>& breaks);
  // Of a closed stretch the candidates come round again; its last is its first.
  int candidate_round() const { return static_cast<int>(task_.candidates.size()) - (task_.rotates ? 1 : 0); }
  int candidate(int i) const {
    const int round = candidate_round();
    return i < round ? task_.candidates[at(i)]
                     : task_.candidates[at(i - round)] + (task_.stretch.last - task_.stretch.first);
  }
  std::vector<std::vector<double>> span_errors(double hopeless);
  std::vector<std::vector<Path>> paths(int most);
  Result result_of(std::vector<Bezier> pieces, const Chain& chain) const;
  std::optional<Result> accepted(ChainFit fit);
  Chain held_on_whole_numbers(const Chain& chain) const;
  void hold_window(Chain& chain, int low, int high) const;
  static void release_window(Chain& chain, int low, int high);
  bool solves_window(Chain& chain, int low, int high, double within);
  std::optional<Result> tried(const std::vector<int>& breaks, double* error = nullptr);
  std::optional<Result> windowed();
  std::vector<int> fewest(double limit) const;
  std::optional<Path> path_between(int from, int to, int pieces) const;
  Chain relaid(const Chain& chain, int low, int high, const std::vector<int>& inside);
  void settle(Chain& chain, int low, int high) const;
  int candidate_after(int sample) const;
  bool replan(Chain& chain, int low, int& high, int least, int most, double within);
  void sweep(Chain& chain, const std::vector<int>& next, double within);
  bool solves_around(Chain& chain, int piece);
  bool solves_between(Chain& chain, int low, int high, double within, int rounds);
  std::vector<Chain> shortened(Chain chain);
  bool has_fault(const Bezier& piece) const;
  bool is_near(const Chain& chain, int index) const;
  std::vector<int> faults(const std::vector<Bezier>& pieces, std::size_t most) const;
  bool verified(const std::vector<Bezier>& pieces) const { return faults(pieces, 1).empty(); }

  const Task& task_;
  const Settings& settings_;
  long& work_;
  std::vector<std::vector<double>> errors_;  // long stretches: of single curves from every candidate on
};

const Task::Must* Search::must_at(int sample) const {
  for (const Task::Must& must : task_.musts) {
    if (must.sample == sample) return &must;
  }
  return nullptr;
}

Join Search::join_at(int sample) const {
  if (const Task::Must* must = must_at(sample)) return must->join;
  Join join;
  join.place = join.home = task_.stretch.samples[at(sample)].place;
  join.tangent = task_.stretch.samples[at(sample)].tangent;
  join.moves = join.turns = true;
  return join;
}

std::vector<Join> Search::joins_at(const std::vector<int>& breaks) const {
  std::vector<Join> joins;
  if (!task_.rotates) joins.push_back(task_.start);
  for (std::size_t i = task_.rotates ? 0 : 1; i + 1 < breaks.size(); ++i) joins.push_back(join_at(breaks[i]));
  if (!task_.stretch.is_closed) joins.push_back(task_.end);
  return joins;
}

// How well one cubic with the source's tangents at its ends does between two samples: what orders candidates.
Search::Span Search::span(int i, int j) {
  if (settings_.options.curve == CurveKind::Quadratic) return {quadratic_error(i, j, rail_at(i), rail_at(j)), 0.0, 0.0};
  const auto& samples = task_.stretch.samples;
  const Sample& a = samples[at(i)];
  const Sample& b = samples[at(j)];
  const double arc = b.s - a.s;
  const Point u0 = a.tangent;
  const Point u1 = b.tangent;
  double out = arc / 3.0;
  double in = arc / 3.0;
  constexpr int most_looked_at = 40;
  const int most = task_.is_long ? most_looked_at : 16;  // texture must not fall between them
  const int step = 1 + (j - i - 1) / (most - 2);
  double u[most_looked_at];
  Point place[most_looked_at];
  int count = 0;
  for (int m = i + 1; m < j && count < most; m += step) {
    place[count] = samples[at(m)].place;
    u[count++] = (samples[at(m)].s - a.s) / arc;
  }
  double worst = 0.0;
  constexpr int rounds = 6;
  work_ += count * rounds / 2;
  for (int round = 0; round < rounds; ++round) {
    double h00 = 1e-9;
    double h01 = 0.0;
    double h11 = 1e-9;
    double g0 = 0.0;
    double g1 = 0.0;
    worst = 0.0;
    const Point p0 = a.place;
    const Point p3 = b.place;
    const Point p1 = p0 + u0 * out;
    const Point p2 = p3 - u1 * in;
    for (int m = 0; m < count; ++m) {
      const double t = u[m];
      const double v = 1.0 - t;
      Point e = p0 * (v * v * v) + p1 * (3.0 * v * v * t) + p2 * (3.0 * v * t * t) + p3 * (t * t * t) - place[m];
      const Point d = 3.0 * ((p1 - p0) * (v * v) + (p2 - p1) * (2.0 * v * t) + (p3 - p2) * (t * t));
      const double square = d.squaredNorm();
      if (square < 1e-12) continue;
      const double by = -e.dot(d) / square;
      const double then = std::clamp(t + by, 0.0, 1.0);
      u[m] = then;
      e += by * d;
      const Point normal = Point(-d.y(), d.x()) / std::sqrt(square);
      const double residual = e.dot(normal);
      worst = std::max(worst, std::abs(residual));
      const double w = 1.0 - then;
      const double j0 = 3.0 * w * w * then * normal.dot(u0);
      const double j1 = -3.0 * w * then * then * normal.dot(u1);
      h00 += j0 * j0;
      h01 += j0 * j1;
      h11 += j1 * j1;
      g0 -= j0 * residual;
      g1 -= j1 * residual;
    }
    if (round + 1 == rounds) break;
    h00 *= 1.0001;
    h11 *= 1.0001;
    const double determinant = h00 * h11 - h01 * h01;
    const double largest = 0.4 * arc;
    out = std::clamp(out + std::clamp((g0 * h11 - g1 * h01) / determinant, -largest, largest), 0.03 * arc, 1.2 * arc);
    in = std::clamp(in + std::clamp((h00 * g1 - h01 * g0) / determinant, -largest, largest), 0.03 * arc, 1.2 * arc);
  }
  return {worst, out, in};
}

// The join at a sample, if the handle of a quadratic that ends there has to lie on its tangent.
const Join* Search::rail_at(int sample) const {
  const Stretch& stretch = task_.stretch;
  if (!task_.rotates) {
    if (sample == stretch.first || (stretch.is_closed && sample == stretch.last))
      return task_.start.is_corner ? nullptr : &task_.start;
    if (sample == stretch.last) return task_.end.is_corner ? nullptr : &task_.end;
  }
  const Task::Must* must = must_at(sample);
  return must != nullptr ? &must->join : nullptr;
}

// Whether one quadratic that is straight goes from rail to rail.
bool Search::is_straight_between(const Join& a, const Join& b) const {
  const Point chord = whole(settings_, b.home) - whole(settings_, a.home);
  if (!(chord.dot(a.tangent) > 0.0) || !(chord.dot(b.tangent) > 0.0)) return false;
  const auto deviates = [&](const Join& join) {
    // Along an axis handles of whole numbers keep exactly to it.
    const bool is_exact = settings_.options.coordinates == Coordinates::Whole && join.tangent.prod() == 0.0;
    return std::abs(cross(join.tangent, chord)) > (is_exact ? 0.0 : std::sin(smooth_turn) * chord.norm());
  };
  return !deviates(a) && !deviates(b);
}

// The same for one quadratic, between rails if there are such: the tangents leave it no freedom. None joins rails that
// do not meet between them.
double Search::quadratic_error(int i, int j, const Join* start, const Join* end) {
  const auto& samples = task_.stretch.samples;
  Sample a = samples[at(i)];
  Sample b = samples[at(j)];
  if (start != nullptr) a.tangent = start->tangent;
  if (end != nullptr) b.tangent = end->tangent;
  const Point chord = b.place - a.place;
  const double sine = cross(a.tangent, b.tangent);
  const double ahead = cross(chord, b.tangent) / sine;
  const double behind = cross(a.tangent, chord) / sine;
  const double arc = b.s - a.s;
  const bool meets = std::abs(sine) > 1e-3 && ahead > 0.0 && behind > 0.0 && ahead < arc && behind < arc;
  if (!meets && start != nullptr && end != nullptr && !is_straight_between(*start, *end)) return never;
  const Point handle = meets ? Point(a.place + ahead * a.tangent) : Point(0.5 * (a.place + b.place));
  constexpr int most = 14;
  const int step = 1 + (j - i - 1) / most;
  double worst = 0.0;
  for (int m = i + 1; m < j; m += step) {
    double u = (samples[at(m)].s - a.s) / arc;
    Point e = Point::Zero();
    for (int round = 0; round < 3; ++round) {
      const double v = 1.0 - u;
      e = v * v * a.place + 2.0 * v * u * handle + u * u * b.place - samples[at(m)].place;
      const Point d = 2.0 * (v * (handle - a.place) + u * (b.place - handle));
      const double square = d.squaredNorm();
      if (square > 1e-12) u = std::clamp(u - e.dot(d) / square, 0.0, 1.0);
    }
    worst = std::max(worst, e.norm());
    work_ += 1;
  }
  return worst;
}

// A chain to start from: every piece as good as it can be alone.
Chain Search::laid(const std::vector<int>& breaks) {
  Chain chain = lay_chain(task_.stretch, settings_.options.curve, joins_at(breaks), breaks);
  if (chain.kind == CurveKind::Quadratic) return chain;
  for (int i = 0; i < chain.size(); ++i) {
    const Span best = span(breaks[at(i)], breaks[at(i + 1)]);
    chain.out[at(i)] = best.out;
    chain.in[at(i)] = best.in;
  }
  return chain;
}

// How near to the source between two samples one cubic can be that may end anywhere: by least squares, whose largest
// distance a solution undercuts by a quarter.
double Search::free_error(int i, int j) {
  const auto& samples = task_.stretch.samples;
  constexpr int most = 40;
  constexpr int rounds = 3;
  constexpr double undercut = 0.75;
  const int step = 1 + (j - i) / (most - 1);
  const double arc = samples[at(j)].s - samples[at(i)].s;
  double u[most];
  Point place[most];
  int count = 0;
  for (int m = i; m <= j && count < most; m += step) {
    place[count] = samples[at(m)].place;
    u[count++] = (samples[at(m)].s - samples[at(i)].s) / arc;
  }
  double worst = 0.0;
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Matrix<double, 4, 2> right = Eigen::Matrix<double, 4, 2>::Zero();
    for (int m = 0; m < count; ++m) {
      const auto weight = bernstein(3, u[m]);
      const Eigen::Vector4d b(weight[0], weight[1], weight[2], weight[3]);
      normal += b * b.transpose();
      right += b * place[m].transpose();
    }
    normal.diagonal().array() += 1e-9;
    const Eigen::Matrix<double, 4, 2> control = normal.llt().solve(right);
    Bezier curve{{}, 3};
    for (int k = 0; k < 4; ++k) curve.p[at(k)] = control.row(k).transpose();
    worst = 0.0;
    for (int m = 0; m < count; ++m) {
      const Point e = evaluate(curve, u[m]) - place[m];
      const Point d = derivative(curve, u[m]);
      const double square = d.squaredNorm() + 1e-12;
      worst = std::max(worst, std::abs(cross(d, e)) / std::sqrt(square));
      u[m] = std::clamp(u[m] - e.dot(d) / square, 0.0, 1.0);
    }
  }
  work_ += count * rounds / 2;
  return undercut * worst;
}

// The errors of single curves from every candidate to those after it, up to the second that is hopeless.
std::vector<std::vector<double>> Search::span_errors(double hopeless) {
  const auto& samples = task_.stretch.samples;
  const int count = static_cast<int>(task_.candidates.size());
  const int round = candidate_round();
  std::vector<double> turn(samples.size(), 0.0);
  for (std::size_t i = 1; i < samples.size(); ++i)
    turn[i] = turn[i - 1] + std::abs(angle(samples[i - 1].tangent, samples[i].tangent));
  std::vector<int> waves(samples.size(), 0);  // changes of side so far
  double since = 0.0;                         // the turn since the last of them
  double back = 0.0;                          // and what has gone back of it
  for (std::size_t i = 1; i < samples.size(); ++i) {
    constexpr double least = 4.0 * degrees;
    const double turned = angle(samples[i - 1].tangent, samples[i].tangent);
    waves[i] = waves[i - 1];
    if (since * turned < 0.0) {
      back += turned;
      if (std::abs(back) > least) {
        ++waves[i];
        since = back;
        back = 0.0;
      }
    } else {
      since += turned;
      back = std::abs(back) < std::abs(turned) ? 0.0 : back + turned;
    }
  }
  const bool is_quadratic = settings_.options.curve == CurveKind::Quadratic;
  std::vector<std::vector<double>> error(at(round));
  std::vector<char> is_must(samples.size(), 0);
  for (const Task::Must& must : task_.musts) is_must[at(must.sample)] = 1;
  for (int i = 0; i < round; ++i) {
    int bad = 0;
    for (int j = i + 1; j < (task_.rotates ? i + round : count); ++j) {
      const double turned = turn[at(candidate(j))] - turn[at(candidate(i))];
      if (turned > 4.0 && j > i + 1) break;
      const bool is_straight = !is_quadratic && j == i + 1 && turned < 0.02;
      // Of curves that follow the source a solution wins much over single ones; those that cut through its waves are
      // as good as they can be.
      const bool cuts = task_.is_long && waves[at(candidate(j))] > waves[at(candidate(i))] + 1;
      const double here = is_straight ? 0.0
                          : cuts      ? near_enough * free_error(candidate(i), candidate(j))
                                      : span_error(candidate(i), candidate(j));
      error[at(i)].push_back(here);
      bad = here > hopeless ? bad + 1 : 0;
      if (bad > 1 || is_must[at(candidate(j))]) break;
    }
  }
  return error;
}

// For every number of pieces the paths over the candidates with the least largest span error and with the least sum of
// its squares, best first.
std::vector<std::vector<Search::Path>> Search::paths(int most) {
  const auto& candidates = task_.candidates;
  const int count = static_cast<int>(candidates.size());
  const int round = candidate_round();
  const std::vector<std::vector<double>> error = span_errors(30.0 * settings_.options.tolerance);
  std::vector<std::vector<Path>> result(at(most + 1));
  const int width = task_.rotates ? round + 1 : count;
  const int rotations = task_.rotates ? std::min(round, 2 + static_cast<int>(error[0].size())) : 1;
  std::vector<std::vector<double>> least(at(most + 1), std::vector<double>(at(width)));
  std::vector<std::vector<int>> from(at(most + 1), std::vector<int>(at(width)));
  for (int rotation = 0; rotation < rotations; ++rotation) {
    for (const bool of_squares : {false, true}) {
      for (auto& row : least) std::fill(row.begin(), row.end(), never);
      least[0][0] = 0.0;
      for (int k = 1; k <= most; ++k) {
        for (int i = 0; i < width; ++i) {
          const double sofar = least[at(k - 1)][at(i)];
          if (sofar == never) continue;
          const auto& spans = error[at((rotation + i) % round)];
          for (std::size_t l = 0; l < spans.size() && at(i) + l + 1 < at(width); ++l) {
            const std::size_t j = at(i) + l + 1;
            const double e = spans[l];
            const double value = of_squares ? sofar + e * e : std::max(sofar, e);
            if (value < least[at(k)][j]) {
              least[at(k)][j] = value;
              from[at(k)][j] = i;
            }
          }
        }
        const double value = least[at(k)][at(width - 1)];
        if (value == never) continue;
        Path path{of_squares ? std::sqrt(value) : value, {}};
        int i = width - 1;
        for (int left = k; left >= 0; --left) {
          path.breaks.push_back(candidate(rotation + i));
          if (left > 0) i = from[at(left)][at(i)];
        }
        std::reverse(path.breaks.begin(), path.breaks.end());
        result[at(k)].push_back(std::move(path));
      }
    }
  }
  if (most >= 2 && task_.musts.empty() && !task_.rotates) {
    for (int c = 1; c + 1 < count; ++c) {
      const std::size_t rest = at(count - 2 - c);
      if (at(c - 1) >= error[0].size() || rest >= error[at(c)].size()) continue;
      result[2].push_back({std::max(error[0][at(c - 1)], error[at(c)][rest]),
                           {candidates.front(), candidates[at(c)], candidates.back()}});
    }
  }
  for (auto& list : result) {
    std::stable_sort(list.begin(), list.end(), [](const Path& a, const Path& b) { return a.error < b.error; });
    std::vector<Path> distinct;
    for (Path& path : list) {
      const bool is_known =
          std::any_of(distinct.begin(), distinct.end(), [&](const Path& p) { return p.breaks == path.breaks; });
      if (!is_known) distinct.push_back(std::move(path));
    }
    list = std::move(distinct);
  }
  return result;
}

bool Search::has_fault(const Bezier& piece) const {
  const CompactOptions& options = settings_.options;
  // Of long stretches on whole numbers a unit of which is much, some extrema are none.
  const bool is_coarse = task_.is_long && options.coordinates == Coordinates::Whole && options.tolerance < 1.0;
  if (options.extrema == Extrema::Keep && !is_coarse && has_extremum_within(piece)) return true;
  return has_far_handle(piece);
}

// Whether a piece keeps to the source below it, at places between the samples' feet too.
bool Search::is_near(const Chain& chain, int index) const {
  constexpr int places = 12;
  constexpr int beyond_ends = 3;
  const auto& samples = task_.stretch.samples;
  const int from = std::max(0, chain.breaks[at(index)] - beyond_ends);
  const int to = std::min(static_cast<int>(samples.size()) - 1, chain.breaks[at(index + 1)] + beyond_ends);
  std::vector<Point> line;
  for (int m = from; m <= to; ++m) line.push_back(samples[at(m)].place);
  const Bezier piece = chain.piece(index);
  for (int i = 1; i < places; ++i) {
    if (distance_from(line, evaluate(piece, static_cast<double>(i) / places)) > settings_.options.tolerance)
      return false;
  }
  return true;
}

// The first pieces, `most` of them, that may not be written: too far off, an extremum within, a handle far outside, a
// loop.
std::vector<int> Search::faults(const std::vector<Bezier>& pieces, std::size_t most) const {
  const double tolerance = settings_.options.tolerance;
  const double sagitta = polyline_sagitta * tolerance;
  std::vector<int> bad;
  const int count = static_cast<int>(pieces.size());
  for (int i = 0; i < count && bad.size() < most; ++i) {
    const Bezier& b = pieces[at(i)];
    if (has_fault(b)) bad.push_back(i);
  }
  if (!bad.empty()) return bad;
  std::vector<Point> line;
  std::vector<int> piece_of;
  const Stretch& stretch = task_.stretch;
  if (stretch.first > 0) line.push_back(stretch.samples.front().place);
  piece_of.resize(line.size(), 0);
  double turn = 0.0;
  for (int i = 0; i < count; ++i) {
    const Bezier& b = pieces[at(i)];
    add_polyline(b, sagitta, 20, line);
    piece_of.resize(line.size(), i);
    Point tangent = start_tangent(b);
    for (int k = 1; k <= 16; ++k) {
      const Point then = tangent_at(b, k / 16.0);
      turn += std::abs(angle(tangent, then));
      tangent = then;
    }
  }
  line.push_back(pieces.back().end());
  const bool has_after = !stretch.is_closed && stretch.last + 1 < static_cast<int>(stretch.samples.size());
  if (has_after) line.push_back(stretch.samples.back().place);
  piece_of.resize(line.size(), count - 1);
  double source_turn = 0.0;
  const std::size_t round = stretch.is_closed ? at(stretch.last + 1) : stretch.samples.size();
  for (std::size_t i = 1; i < round; ++i)
    source_turn += std::abs(angle(stretch.samples[i - 1].tangent, stretch.samples[i].tangent));
  if (turn > source_turn + 1.0 && !task_.is_long) return {0};  // a loop or a cusp
  const double limit = tolerance * (1.0 - polyline_sagitta);
  for (const std::size_t vertex : beyond(line, stretch.polyline, limit, stretch.is_closed, most))
    bad.push_back(piece_of[vertex]);
  if (bad.size() < most) {
    for (const std::size_t vertex : beyond(stretch.polyline, line, limit, stretch.is_closed, most)) {
      std::size_t nearest = 0;
      for (std::size_t i = 1; i < line.size(); ++i) {
        if ((line[i] - stretch.polyline[vertex]).squaredNorm() <
            (line[nearest] - stretch.polyline[vertex]).squaredNorm())
          nearest = i;
      }
      bad.push_back(piece_of[nearest]);
    }
  }
  std::sort(bad.begin(), bad.end());
  bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
  return bad;
}

// The pieces of a chain, with what it has done to corners.
Result Search::result_of(std::vector<Bezier> pieces, const Chain& chain) const {
  const auto turn_of = [](const Join& join, const Point& tangent) {
    return join.is_corner ? join.turned + angle(join.tangent, tangent) : 0.0;
  };
  int first = -1;
  for (int i = 0; i < chain.size(); ++i) {
    if (chain.joins[at(i)].is_first) first = i;
  }
  if (first < 0 && task_.first) {  // the node nearest to it, of the stretch and the one that ends it
    double least = never;
    for (int i = 0; i <= chain.size(); ++i) {
      const Point node = i < chain.size() ? pieces[at(i)].start() : pieces.back().end();
      if ((node - *task_.first).squaredNorm() >= least) continue;
      least = (node - *task_.first).squaredNorm();
      first = i;
    }
  }
  return Result{pieces, first, turn_of(chain.joins.front(), start_tangent(pieces.front())),
                chain.is_closed ? 0.0 : turn_of(chain.joins.back(), end_tangent(pieces.back()))};
}

// The chain as it will be written, if that stays within the tolerance.
std::optional<Result> Search::accepted(ChainFit fit) {
  const double tolerance = settings_.options.tolerance;
  if (settings_.options.coordinates == Coordinates::Any) {
    std::vector<Bezier> pieces;
    for (int i = 0; i < fit.chain().size(); ++i) pieces.push_back(fit.chain().piece(i));
    if (verified(pieces)) return result_of(std::move(pieces), fit.chain());
    if (fit.solve(0.9 * tolerance, 12)) {
      pieces.clear();
      for (int i = 0; i < fit.chain().size(); ++i) pieces.push_back(fit.chain().piece(i));
      if (verified(pieces)) return result_of(std::move(pieces), fit.chain());
    }
    work_ += fit.work();
    return std::nullopt;
  }
  // Room for what rounding moves: up to three quarters of a unit.
  const long before = fit.work();
  fit.solve(std::max(0.2 * tolerance, tolerance - 0.75), 30, ChainFit::Until::Least);
  work_ += fit.work() - before;
  const auto on_whole_numbers = [&](const ChainFit& on, int reach, std::size_t states) -> std::optional<Result> {
    auto pieces = on.rounded(settings_.fraction, 1.05 * tolerance, reach, states).pieces;
    work_ += static_cast<long>(task_.stretch.samples.size()) * (reach == 0 ? 4 : 20);  // by the time they take
    if (pieces.empty() || !verified(pieces)) return std::nullopt;
    return result_of(std::move(pieces), on.chain());
  };
  if (auto result = on_whole_numbers(fit, 0, 24)) return result;
  if (auto result = on_whole_numbers(fit, 1, 48)) return result;
  if (tolerance >= 1.0) return std::nullopt;
  // Where a unit is coarse: joins first, each to the whole numbers nearest to the curve thereabouts, then the rest
  // anew.
  ChainFit held(task_.stretch, held_on_whole_numbers(fit.chain()));
  held.solve(std::max(0.2 * tolerance, tolerance - 0.75), 30, ChainFit::Until::Least);
  work_ += held.work();
  if (held.worst() > tolerance) return std::nullopt;
  return on_whole_numbers(held, 1, 48);
}

// Joins that may be anywhere held at points of whole numbers, of those near by the one nearest to the chain's own
// curves.
Chain Search::held_on_whole_numbers(const Chain& chain) const {
  constexpr int steps = 48;
  Chain held = chain;
  if (chain.kind == CurveKind::Quadratic) return held;
  for (std::size_t j = 0; j < held.joins.size(); ++j) {
    Join& join = held.joins[j];
    if (!join.moves) continue;
    const int after = static_cast<int>(j);
    const int before = after == 0 ? chain.size() - 1 : after - 1;
    std::vector<Point> near;
    for (const auto& [piece, from] : {std::pair{before, 0.5}, std::pair{after, 0.0}}) {
      const Bezier curve = chain.piece(piece);
      for (int i = 0; i <= steps; ++i) near.push_back(evaluate(curve, from + 0.5 * i / steps));
    }
    join.place = join.home = whole_near(settings_, join.place, near);
    join.moves = false;
  }
  return held;
}

// A chain solved on both sides of one piece, three pieces at most each way, the rest held; false if it is not within.
bool Search::solves_around(Chain& chain, int piece) {
  constexpr int reach = 3;
  return solves_between(chain, std::max(0, piece - reach), std::min(chain.size(), piece + 1 + reach),
                        aim * settings_.options.tolerance, 40);
}

// The same from one join to another.
bool Search::solves_between(Chain& chain, int low, int high, double within, int rounds) {
  const bool is_whole = low == 0 && high == chain.size();
  if (is_whole || chain.kind == CurveKind::Quadratic) {
    ChainFit fit(task_.stretch, chain);
    const bool is_within = fit.solve(within, rounds);
    work_ += fit.work();
    if (is_within) chain = fit.chain();
    return is_within;
  }
  const auto& samples = task_.stretch.samples;
  Stretch around;
  const bool has_start = low == 0 && !chain.is_closed;
  const bool has_end = high == chain.size() && !chain.is_closed;
  const int from = has_start ? 0 : chain.breaks[at(low)];
  const int to = has_end ? static_cast<int>(samples.size()) - 1 : chain.breaks[at(high)];
  around.samples.assign(samples.begin() + from, samples.begin() + to + 1);
  around.first = chain.breaks[at(low)] - from;
  around.last = chain.breaks[at(high)] - from;
  Chain part;
  for (int j = low; j <= high; ++j) {
    Join join = chain.joins[at(j == chain.size() && chain.is_closed ? 0 : j)];
    if ((j == low && !has_start) || (j == high && !has_end)) {
      join.moves = join.turns = join.slides = false;
      join.is_cut = true;
    }
    part.joins.push_back(join);
    part.breaks.push_back(chain.breaks[at(j)] - from);
  }
  const auto copy = [&](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + low, all.begin() + high);
  };
  part.out = copy(chain.out);
  part.in = copy(chain.in);
  part.arc = copy(chain.arc);
  ChainFit fit(around, std::move(part));
  const bool is_within = fit.solve(within, rounds);
  work_ += fit.work();
  if (!is_within) return false;
  const Chain& solved = fit.chain();
  for (int i = low; i < high; ++i) {
    chain.out[at(i)] = solved.out[at(i - low)];
    chain.in[at(i)] = solved.in[at(i - low)];
    const bool is_held = i == low && !has_start;
    if (!is_held) chain.joins[at(i)] = solved.joins[at(i - low)];
  }
  if (has_end) chain.joins[at(high)] = solved.joins.back();
  return true;
}

// A chain and shorter ones, each made from the one before by dropping a join while what is left stays within.
std::vector<Chain> Search::shortened(Chain chain) {
  constexpr int tries = 4;
  const auto& samples = task_.stretch.samples;
  std::vector<Chain> chains{chain};
  for (bool again = true; again && chain.size() >= 3 && !is_exhausted();) {
    again = false;
    const int k = chain.size();
    for (int j = 1; j < k; ++j) {  // the samples where the joins are by now
      Join& join = chain.joins[at(j)];
      int& own = chain.breaks[at(j)];
      double least = never;
      int nearest = own;
      for (int m = chain.breaks[at(j - 1)] + 1; m < chain.breaks[at(j + 1)]; ++m) {
        const double square = (samples[at(m)].place - join.place).squaredNorm();
        if (square < least) {
          least = square;
          nearest = m;
        }
      }
      own = nearest;
      if (chain.kind == CurveKind::Quadratic && join.moves) {
        join.home = join.place = samples[at(own)].place;
        join.tangent = samples[at(own)].tangent;
      }
    }
    struct Removal {
      double error;
      int join;
    };
    std::vector<Removal> removals;
    const auto rail = [&](int j) {
      const Join& join = chain.joins[at(j == k && chain.is_closed ? 0 : j)];
      return join.moves || join.is_corner ? nullptr : &join;
    };
    for (int j = 1; j < k; ++j) {
      const Join& join = chain.joins[at(j)];
      if (!join.moves || join.is_first) continue;
      const int from = chain.breaks[at(j - 1)];
      const int to = chain.breaks[at(j + 1)];
      const bool is_quadratic = chain.kind == CurveKind::Quadratic;
      removals.push_back(
          {is_quadratic ? quadratic_error(from, to, rail(j - 1), rail(j + 1)) : span_error(from, to), j});
    }
    std::stable_sort(removals.begin(), removals.end(),
                     [](const Removal& a, const Removal& b) { return a.error < b.error; });
    for (int r = 0; r < std::min(tries, static_cast<int>(removals.size())) && !again; ++r) {
      if (removals[at(r)].error > 60.0 * settings_.options.tolerance) break;
      const int j = removals[at(r)].join;
      Chain fewer = chain;
      fewer.joins.erase(fewer.joins.begin() + j);
      fewer.breaks.erase(fewer.breaks.begin() + j);
      fewer.out.erase(fewer.out.begin() + j);
      fewer.in.erase(fewer.in.begin() + (j - 1));
      fewer.arc.erase(fewer.arc.begin() + j);
      if (!fewer.top.empty()) fewer.top.erase(fewer.top.begin() + j);
      fewer.arc[at(j - 1)] = samples[at(fewer.breaks[at(j)])].s - samples[at(fewer.breaks[at(j - 1)])].s;
      const Span alone = span(fewer.breaks[at(j - 1)], fewer.breaks[at(j)]);
      fewer.out[at(j - 1)] = alone.out;
      fewer.in[at(j - 1)] = alone.in;
      if (solves_around(fewer, j - 1)) {
        chain = std::move(fewer);
        chains.push_back(chain);
        again = true;
      }
    }
  }
  return chains;
}

// The chain laid at these samples, solved, shortened and written, if it can be.
std::optional<Result> Search::tried(const std::vector<int>& breaks, double* error) {
  ChainFit fit(task_.stretch, laid(breaks));
  const bool is_within = fit.solve(aim * settings_.options.tolerance, 40);
  work_ += fit.work();
  if (error != nullptr) *error = fit.worst();
  if (!is_within) return std::nullopt;
  if (fit.chain().size() < 3) return accepted(std::move(fit));
  const std::vector<Chain> chains = shortened(fit.chain());
  constexpr std::size_t most = 4;  // what many pieces more cannot be written on whole numbers will not be with another
  for (std::size_t i = 0; i < std::min(most, chains.size()); ++i) {
    if (auto result = accepted(ChainFit(task_.stretch, chains[chains.size() - 1 - i]))) return result;
  }
  return std::nullopt;
}

// --- long stretches

// From every candidate the next one of the path to the end whose every span is within a limit, or cannot be shorter: of
// the fewest pieces, and of these that with the least sum of squares.
std::vector<int> Search::fewest(double limit) const {
  const auto count = task_.candidates.size();
  constexpr double share = 1e-5;  // of a piece: what errors count
  std::vector<double> least(count, never);
  std::vector<int> next(count, static_cast<int>(count) - 1);
  least[count - 1] = 0.0;
  for (std::size_t i = count - 1; i-- > 0;) {
    const auto& spans = errors_[i];
    for (std::size_t l = 0; l < spans.size() && i + l + 1 < count; ++l) {
      const double e = spans[l] / limit;
      if (e > 1.0 && l > 0) continue;
      const double value = least[i + l + 1] + 1.0 + share * e * e;
      if (value >= least[i]) continue;
      least[i] = value;
      next[i] = static_cast<int>(i + l) + 1;
    }
  }
  return next;
}

// The path of so many pieces from one candidate to another with the least largest span error, and of these with the
// least sum of squares.
std::optional<Search::Path> Search::path_between(int from, int to, int pieces) const {
  const int width = to - from + 1;
  if (width <= pieces) return std::nullopt;
  struct Sum {
    double largest = never;
    double squares = never;
    int from = 0;
  };
  std::vector<std::vector<Sum>> best(at(pieces + 1), std::vector<Sum>(at(width)));
  best[0][0] = {0.0, 0.0, 0};
  for (int k = 1; k <= pieces; ++k) {
    for (int i = k - 1; i + 1 < width; ++i) {
      const Sum& before = best[at(k - 1)][at(i)];
      if (before.largest == never) continue;
      const auto& spans = errors_[at(from + i)];
      for (int l = 0; l < static_cast<int>(spans.size()) && i + l + 1 < width; ++l) {
        const double e = spans[at(l)];
        const Sum here{std::max(before.largest, e), before.squares + e * e, i};
        Sum& known = best[at(k)][at(i + l + 1)];
        if (std::pair(here.largest, here.squares) < std::pair(known.largest, known.squares)) known = here;
      }
    }
  }
  if (best[at(pieces)].back().largest == never) return std::nullopt;
  Path path{best[at(pieces)].back().largest, {}};
  int i = width - 1;
  for (int k = pieces; k > 1; --k) {
    i = best[at(k)][at(i)].from;
    path.breaks.push_back(task_.candidates[at(from + i)]);
  }
  std::reverse(path.breaks.begin(), path.breaks.end());
  return path;
}

// A chain with other joins between two, at these samples.
Chain Search::relaid(const Chain& chain, int low, int high, const std::vector<int>& inside) {
  Chain now = chain;
  const auto replace = [&](auto& list, int begin, int end, const auto& by) {
    list.erase(list.begin() + begin, list.begin() + end);
    list.insert(list.begin() + begin, by.begin(), by.end());
  };
  std::vector<Join> joins;
  for (const int sample : inside) joins.push_back(join_at(sample));
  replace(now.joins, low + 1, high, joins);
  replace(now.breaks, low + 1, high, inside);
  const auto& samples = task_.stretch.samples;
  std::vector<double> out;
  std::vector<double> in;
  std::vector<double> arc;
  for (int i = low; i <= low + static_cast<int>(inside.size()); ++i) {
    const int a = now.breaks[at(i)];
    const int b = now.breaks[at(i + 1)];
    const Span alone = span(a, b);
    out.push_back(alone.out);
    in.push_back(alone.in);
    arc.push_back(samples[at(b)].s - samples[at(a)].s);
  }
  replace(now.out, low, high, out);
  replace(now.in, low, high, in);
  replace(now.arc, low, high, arc);
  return now;
}

// The samples where the joins between two are by now.
void Search::settle(Chain& chain, int low, int high) const {
  const auto& samples = task_.stretch.samples;
  for (int j = low + 1; j < high; ++j) {
    int& own = chain.breaks[at(j)];
    const Point& place = chain.joins[at(j)].place;
    double least = never;
    int nearest = own;
    for (int m = chain.breaks[at(j - 1)] + 1; m < chain.breaks[at(j + 1)]; ++m) {
      const double square = (samples[at(m)].place - place).squaredNorm();
      if (square < least) {
        least = square;
        nearest = m;
      }
    }
    own = nearest;
  }
  for (int i = low; i < high; ++i)
    chain.arc[at(i)] = samples[at(chain.breaks[at(i + 1)])].s - samples[at(chain.breaks[at(i)])].s;
}

// Joins inside a window held at whole numbers, and set free again: they may be anywhere, or along their rail.
void Search::hold_window(Chain& chain, int low, int high) const {
  for (int j = low + 1; j < high; ++j) {
    Join& join = chain.joins[at(j)];
    join.is_held = !join.is_first;
    if (!join.slides && !join.moves) continue;
    // Near to the source: the chain is off by up to the tolerance already.
    constexpr int around = 3;
    constexpr double share = 0.4;
    const auto& samples = task_.stretch.samples;
    std::vector<Point> near;
    const int to = std::min(chain.breaks[at(j)] + around, static_cast<int>(samples.size()) - 1);
    for (int m = std::max(0, chain.breaks[at(j)] - around); m <= to; ++m) near.push_back(samples[at(m)].place);
    if (join.moves) {
      join.place = whole_near(settings_, join.place, near);
    } else {
      Point place = whole(settings_, join.place);
      for (double slid = 0.75; slid >= 0.0 && distance_from(near, place) > share * settings_.options.tolerance;
           slid -= 0.25)
        place = whole(settings_, join.home + slid * join.slid * join.rail);
      join.place = place;
    }
    join.moves = join.slides = false;
    join.home = join.place;
  }
}

void Search::release_window(Chain& chain, int low, int high) {
  for (int j = low + 1; j < high; ++j) {
    Join& join = chain.joins[at(j)];
    if (!join.is_held) continue;
    join.is_held = false;
    join.slides = join.rail != Point::Zero();
    join.moves = !join.slides;
    join.slid = 0.0;
  }
}

// Whether a window is within a distance, on whole numbers with its joins on such and room for handles to be.
bool Search::solves_window(Chain& chain, int low, int high, double within) {
  constexpr int rounds = 40;
  if (settings_.options.coordinates == Coordinates::Any) return solves_between(chain, low, high, within, rounds);
  const double held_within = within - std::min(room_of_handles, 0.4 * within);
  release_window(chain, low, high);
  if (!solves_between(chain, low, high, held_within, rounds)) return false;
  settle(chain, low, high);
  hold_window(chain, low, high);
  return solves_between(chain, low, high, held_within, rounds);
}

int Search::candidate_after(int sample) const {
  const auto next = std::lower_bound(task_.candidates.begin(), task_.candidates.end(), sample);
  return static_cast<int>(next - task_.candidates.begin());
}

// The pieces between two joins made anew: as few as come within a distance, of numbers in a range. False if none do,
// and the chain is as it was.
bool Search::replan(Chain& chain, int low, int& high, int least, int most, double within) {
  const int from = candidate_after(chain.breaks[at(low)]);
  const int to = candidate_after(chain.breaks[at(high)]);
  const int own = high - low;
  const auto takes = [&](Chain tried, int pieces) {
    if (!solves_window(tried, low, low + pieces, within)) return false;
    settle(tried, low, low + pieces);
    for (int i = low; i < low + pieces; ++i) {
      if (has_fault(tried.piece(i)) || !is_near(tried, i)) return false;
    }
    chain = std::move(tried);
    high = low + pieces;
    return true;
  };
  // One piece more and another, then as many as follow the source more and more closely.
  constexpr int one_by_one = 3;
  constexpr double hope = 4.0;  // what a solution wins over single curves
  constexpr double limits[] = {1.6, 1.0, 0.6, 0.35, 0.2, 0.1};
  std::size_t limit = 0;
  int tries = 0;
  for (int m = least; m <= std::min(most, to - from); ++m) {
    auto path = path_between(from, to, m);
    if (tries >= one_by_one) {
      if (limit == std::size(limits)) return false;
      while ((!path || path->error > limits[limit] * within) && m < most) path = path_between(from, to, ++m);
      ++limit;
    }
    if (m == own && takes(chain, m)) return true;
    if (!path || path->error > hope * settings_.options.tolerance) continue;
    ++tries;
    const bool is_in_order = std::all_of(path->breaks.begin(), path->breaks.end(), [&](int sample) {
      return sample > chain.breaks[at(low)] && sample < chain.breaks[at(high)];
    });
    if (is_in_order && takes(relaid(chain, low, high, path->breaks), m)) return true;
  }
  return false;
}

// Window after window with as few pieces as come within a distance. `next` is the path of the curves that a solution
// may take to it: where windows end.
void Search::sweep(Chain& chain, const std::vector<int>& next, double within) {
  const bool is_whole = settings_.options.coordinates == Coordinates::Whole;
  const int last = static_cast<int>(task_.candidates.size()) - 1;
  for (int low = 0; low < chain.size();) {
    int end = std::min(candidate_after(chain.breaks[at(low)]), last);
    int least = 0;
    for (; least < window_pieces && end < last; ++least) end = next[at(end)];
    int high = low + 1;
    while (high < chain.size() && chain.breaks[at(high)] < task_.candidates[at(end)]) ++high;
    const int now = high - low;
    const bool is_shorter = !is_exhausted() && replan(chain, low, high, std::max(1, least - 1), now - 1, within);
    // On whole numbers joins have still to be on such.
    if (!is_shorter && is_whole) replan(chain, low, high, now, now + window_pieces, within);
    if (high == chain.size()) break;
    low = std::max(low + 1, high - window_step);
  }
}

// A long stretch: single curves that are within the tolerance to begin with, then window after window with as few
// pieces as do. What cannot be written in the end is mended, and if that fails it is the single curves. A closed
// chain's first join stays where it begins.
std::optional<Result> Search::windowed() {
  const double tolerance = settings_.options.tolerance;
  constexpr double hopeless = 6.0;
  constexpr double safe = 0.7;
  errors_ = span_errors(hopeless * tolerance);
  std::vector<int> breaks;
  const std::vector<int> safely = fewest(safe * tolerance);
  breaks.push_back(task_.candidates.front());
  for (int i = 0; breaks.back() != task_.candidates.back(); i = safely[at(i)]) {
    const int end = safely[at(i)];
    // What would cut through waves has to be solved: until then it follows them.
    const bool follows = span_error(task_.candidates[at(i)], task_.candidates[at(end)]) <= safe * tolerance;
    for (int j = follows ? end : i + 1; j <= end; ++j) breaks.push_back(task_.candidates[at(j)]);
  }
  const Chain safe_chain = laid(breaks);
  Chain chain = safe_chain;
  sweep(chain, fewest(near_enough * tolerance), aim * tolerance);
  const bool is_whole = settings_.options.coordinates == Coordinates::Whole;
  constexpr int repairs = 8;
  for (int repair = 0; repair < repairs; ++repair) {
    std::vector<Bezier> pieces;
    std::vector<int> bad;
    if (is_whole) {
      const ChainFit fit(task_.stretch, chain);
      auto rounded = fit.rounded(settings_.fraction, 1.05 * tolerance, 1, 48);
      work_ += static_cast<long>(task_.stretch.samples.size()) * 20;
      bad = std::move(rounded.blocked);
      pieces = std::move(rounded.pieces);
    } else {
      for (int i = 0; i < chain.size(); ++i) pieces.push_back(chain.piece(i));
    }
    if (bad.empty()) bad = faults(pieces, pieces.size());
    if (bad.empty()) return result_of(std::move(pieces), chain);
    if (repair + 2 == repairs && !is_whole) {
      chain = safe_chain;
      continue;
    }
    const double share = is_whole ? 0.9 - 0.08 * repair : 0.9;  // more and more room for rounding
    int mended = chain.size();                                  // from there on
    for (auto piece = bad.rbegin(); piece != bad.rend(); ++piece) {
      if (*piece >= mended) continue;
      const int low = std::max(0, *piece - 2 - repair);
      mended = low;
      int high = std::min(chain.size(), *piece + 3 + repair);
      const int now = high - low;
      replan(chain, low, high, now + (repair > 0 ? 1 : 0), 2 * now + window_pieces, share * tolerance);
    }
  }
  return std::nullopt;
}

std::optional<Result> Search::run() {
  const Stretch& stretch = task_.stretch;
  const int most = std::min(task_.most_pieces, static_cast<int>(task_.candidates.size()) - 1);
  if (most < 1) return std::nullopt;
  if (task_.is_long) return windowed();
  if (task_.musts.empty() && !stretch.is_closed) {
    std::vector<int> ends{stretch.first, stretch.last};
    if (auto result = tried(ends)) return result;
  }
  if (most < 2) return std::nullopt;
  const auto by_count = paths(most);
  constexpr double distinct = 0.12;  // of a piece: paths nearer than this lead to the same place
  const double length = stretch.samples[at(stretch.last)].s - stretch.samples[at(stretch.first)].s;
  for (int k = 2; k <= most && !is_exhausted(); ++k) {
    const bool is_long = k >= 5;
    const int starts = is_long ? 3 : 8;
    const double limit = (is_long ? 4.0 : 10.0) * settings_.options.tolerance;
    int tries = 0;
    double first_error = 0.0;
    std::vector<const Path*> seen;
    for (const Path& path : by_count[at(k)]) {
      if (path.error > limit * (tries == 0 && !is_long ? 3.0 : 1.0) || tries >= starts || is_exhausted()) break;
      if (tries > 0 && first_error > 3.0 * settings_.options.tolerance) break;
      const bool is_known = std::any_of(seen.begin(), seen.end(), [&](const Path* other) {
        double farthest = 0.0;
        const auto place = [&](int sample) { return stretch.samples[at(sample)].s; };
        for (std::size_t j = 0; j + 1 < path.breaks.size(); ++j) {
          if (!task_.rotates) {
            farthest = std::max(farthest, std::abs(place(path.breaks[j]) - place(other->breaks[j])));
            continue;
          }
          double nearest = never;
          for (std::size_t l = 0; l + 1 < path.breaks.size(); ++l) {
            const double apart = std::fmod(std::abs(place(path.breaks[j]) - place(other->breaks[l])), length);
            nearest = std::min({nearest, apart, length - apart});
          }
          farthest = std::max(farthest, nearest);
        }
        return farthest < distinct * length / k;
      });
      if (is_known) continue;
      seen.push_back(&path);
      double error = 0.0;
      if (auto result = tried(path.breaks, &error)) return result;
      if (tries++ == 0) first_error = error;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Result> search(const Task& task, const Settings& settings, long& work) {
  return Search(task, settings, work).run();
}

}  // namespace fontcore::compact
