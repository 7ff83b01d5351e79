#include "fontcore/gesture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/profile.h"

namespace fontcore {
namespace {

using Eigen::Index;

constexpr double on_boundary = 1e-12;  // of a tip's extent: what rounding leaves of a point put on it

std::size_t at(Index index) { return static_cast<std::size_t>(index); }

double distance_to_edge(const Point& x, const Point& a, const Point& b) {
  const Point along = b - a;
  const double square = along.squaredNorm();
  const double u = square > 0.0 ? std::clamp((x - a).dot(along) / square, 0.0, 1.0) : 0.0;
  return (a + u * along - x).norm();
}

void require_finite_point(const char* function, const Point& x) {
  if (!x.allFinite()) throw InvalidInput(text(function, ": a point is not finite"));
}

// Nearest point of x²/a² + y²/b² = 1 to a point inside, a >= b, x and y not negative: the root of a function that
// falls, by halving (D. Eberly, Distance from a Point to an Ellipse).
Point nearest_of_quadrant(double a, double b, double x, double y) {
  if (y <= 0.0) {
    const double focal = a * a - b * b;
    if (a * x >= focal) return {a, 0.0};
    const double u = a * x / focal;
    return {a * u, b * std::sqrt(1.0 - u * u)};
  }
  if (x <= 0.0) return {0.0, b};
  const double ratio = (a / b) * (a / b);
  const double z0 = x / a;
  const double z1 = y / b;
  double low = z1 - 1.0;
  double high = 0.0;
  for (int i = 0; i < 100 && low < high; ++i) {
    const double s = 0.5 * (low + high);
    if (s == low || s == high) break;
    const double u = ratio * z0 / (s + ratio);
    const double v = z1 / (s + 1.0);
    (u * u + v * v > 1.0 ? low : high) = s;
  }
  const double s = 0.5 * (low + high);
  const Point found(ratio * x / (s + ratio), y / (s + 1.0));
  return found / std::hypot(found.x() / a, found.y() / b);
}

template <typename... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <typename... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

// Coordinates in which an ellipse is the unit circle.
Point unit_place(const Ellipse& ellipse, const Point& x) {
  const Eigen::Rotation2Dd turn(-ellipse.angle);
  const Point local = turn * x;
  return {local.x() / ellipse.along, local.y() / ellipse.across};
}

}  // namespace

// --- Arc length ---

Eigen::VectorXd lengths_along(const Points& line) {
  Eigen::VectorXd lengths = Eigen::VectorXd::Zero(line.rows());
  for (Index i = 1; i < line.rows(); ++i) lengths[i] = lengths[i - 1] + (line.row(i) - line.row(i - 1)).norm();
  return lengths;
}

namespace {

// The edge of a polyline that holds an arc length, and the share of it before that.
struct PlaceAlong {
  Index edge = 0;
  double u = 0.0;
};
PlaceAlong place_along(const Eigen::VectorXd& lengths, double s) {
  const Index n = lengths.size();
  if (n < 2) return {};
  const double* const begin = lengths.data();
  const Index next = std::upper_bound(begin, begin + n, s) - begin;
  const Index edge = std::clamp<Index>(next - 1, 0, n - 2);
  const double step = lengths[edge + 1] - lengths[edge];
  return {edge, step > 0.0 ? std::clamp((s - lengths[edge]) / step, 0.0, 1.0) : 0.0};
}

Point between(const Points& line, const PlaceAlong& place) {
  if (line.rows() < 2 || place.u == 0.0) return line.row(place.edge);
  if (place.u == 1.0) return line.row(place.edge + 1);
  return (1.0 - place.u) * line.row(place.edge) + place.u * line.row(place.edge + 1);
}

}  // namespace

Point point_along(const Points& line, const Eigen::VectorXd& lengths, double s) {
  return between(line, place_along(lengths, s));
}

// --- Tips ---

Tip::Tip(TipShape shape) : shape_(std::move(shape)) {
  const auto require_length = [](double length) {
    if (!(length > 0.0 && std::isfinite(length))) throw InvalidInput(text("Tip: a length of ", length));
  };
  std::visit(Overloaded{[&](const Circle& circle) {
                          require_length(circle.radius);
                          radius_ = extent_ = circle.radius;
                        },
                        [&](const Ellipse& ellipse) {
                          require_length(ellipse.along);
                          require_length(ellipse.across);
                          if (!std::isfinite(ellipse.angle)) throw InvalidInput("Tip: an angle that is not finite");
                          radius_ = std::min(ellipse.along, ellipse.across);
                          extent_ = std::max(ellipse.along, ellipse.across);
                        },
                        [&](const ConvexPolygon& polygon) {
                          const std::size_t n = polygon.corners.size();
                          if (n < 3) throw InvalidInput(text("Tip: a polygon of ", n, " corners"));
                          radius_ = std::numeric_limits<double>::infinity();
                          for (std::size_t i = 0; i < n; ++i) {
                            const Point& a = polygon.corners[i];
                            const Point edge = polygon.corners[(i + 1) % n] - a;
                            const Point next = polygon.corners[(i + 2) % n] - polygon.corners[(i + 1) % n];
                            require_finite_point("Tip", a);
                            if (!(cross(edge, next) > 0.0)) {
                              throw InvalidInput(text("Tip: no turn to the left at corner ", (i + 1) % n));
                            }
                            radius_ = std::min(radius_, cross(a, edge) / edge.norm());
                            extent_ = std::max(extent_, a.norm());
                          }
                          if (!(radius_ > 0.0)) throw InvalidInput("Tip: a polygon that does not hold its place");
                          double turned = 0.0;
                          for (std::size_t i = 0; i < n; ++i) {
                            const Point& a = polygon.corners[i];
                            const Point& b = polygon.corners[(i + 1) % n];
                            turned += angle(a, b);
                          }
                          if (turned > 3.0 * std::numbers::pi) {
                            throw InvalidInput("Tip: a polygon that runs round its place more than once");
                          }
                        }},
             shape_);
}

bool Tip::contains(const Point& x) const {
  if (x.squaredNorm() > extent_ * extent_) return false;
  return std::visit(
      Overloaded{[&](const Circle& circle) { return x.norm() < circle.radius * (1.0 - on_boundary); },
                 [&](const Ellipse& ellipse) { return unit_place(ellipse, x).norm() < 1.0 - on_boundary; },
                 [&](const ConvexPolygon& polygon) {
                   const std::size_t n = polygon.corners.size();
                   for (std::size_t i = 0; i < n; ++i) {
                     const Point& a = polygon.corners[i];
                     const Point edge = polygon.corners[(i + 1) % n] - a;
                     if (!(cross(edge, x - a) > on_boundary * extent_ * edge.norm())) return false;
                   }
                   return true;
                 }},
      shape_);
}

bool Tip::meets(const Point& a, const Point& b) const {
  if (!(distance_to_edge(Point::Zero(), a, b) < extent_)) return false;
  const double inside = 1.0 - on_boundary;
  return std::visit(
      Overloaded{[&](const Circle& circle) { return distance_to_edge(Point::Zero(), a, b) < circle.radius * inside; },
                 [&](const Ellipse& ellipse) {
                   return distance_to_edge(Point::Zero(), unit_place(ellipse, a), unit_place(ellipse, b)) < inside;
                 },
                 [&](const ConvexPolygon& polygon) {  // the edge cut by every half plane
                   const std::size_t n = polygon.corners.size();
                   double from = 0.0;
                   double to = 1.0;
                   for (std::size_t i = 0; i < n; ++i) {
                     const Point& corner = polygon.corners[i];
                     const Point edge = polygon.corners[(i + 1) % n] - corner;
                     const double least = on_boundary * extent_ * edge.norm();
                     const double at_a = cross(edge, a - corner) - least;
                     const double at_b = cross(edge, b - corner) - least;
                     if (at_a <= 0.0 && at_b <= 0.0) return false;
                     if (at_a < 0.0) from = std::max(from, at_a / (at_a - at_b));
                     if (at_b < 0.0) to = std::min(to, at_a / (at_a - at_b));
                   }
                   return from < to;
                 }},
      shape_);
}

Point Tip::nearest_boundary(const Point& x, const Point& tie) const {
  return std::visit(
      Overloaded{[&](const Circle& circle) -> Point {
                   const Point& direction = x.norm() > on_boundary * circle.radius ? x : tie;
                   return circle.radius * direction.normalized();
                 },
                 [&](const Ellipse& ellipse) -> Point {
                   const Eigen::Rotation2Dd turn(ellipse.angle);
                   const Point local = turn.inverse() * x;
                   const Point side = turn.inverse() * tie;
                   const auto sign = [](double value, double otherwise) {
                     return value < 0.0 || (value == 0.0 && otherwise < 0.0) ? -1.0 : 1.0;
                   };
                   const bool is_long = ellipse.along >= ellipse.across;
                   const Point quadrant = local.cwiseAbs();
                   const Point found =
                       is_long ? nearest_of_quadrant(ellipse.along, ellipse.across, quadrant.x(), quadrant.y())
                               : nearest_of_quadrant(ellipse.across, ellipse.along, quadrant.y(), quadrant.x());
                   const Point turned = is_long ? found : Point(found.y(), found.x());
                   return turn * Point(sign(local.x(), side.x()) * turned.x(), sign(local.y(), side.y()) * turned.y());
                 },
                 [&](const ConvexPolygon& polygon) -> Point {
                   const std::size_t n = polygon.corners.size();
                   double least = std::numeric_limits<double>::infinity();
                   Point found = x;
                   for (std::size_t i = 0; i < n; ++i) {
                     const Point& a = polygon.corners[i];
                     const Point edge = (polygon.corners[(i + 1) % n] - a).normalized();
                     const double distance = cross(edge, x - a);
                     if (distance >= least) continue;
                     least = distance;
                     found = a + edge.dot(x - a) * edge;
                   }
                   return found;
                 }},
      shape_);
}

// --- Pushing ---

namespace {

constexpr double step_of_radius = 1.0 / 8.0;
constexpr double longest_of_radius = 1.0 / 4.0;    // [GA98]: edges in contact
constexpr double shortest_of_radius = 1.0 / 8.0;   // [GA98]: two edges together
constexpr double thinnest_of_radius = 1.0 / 32.0;  // folds: chords of edges in contact lie so close to each other
constexpr double most_steps = 1e5;
constexpr double least_room =
    0x1p-40;  // of t between neighbours: below it stretches are spread before they are halved again

class PushedRun {
 public:
  PushedRun(const Run& run, const Tip& tip, std::span<const double> held, std::span<const double> kept) : tip_(tip) {
    std::merge(held.begin(), held.end(), kept.begin(), kept.end(), std::back_inserter(kept_));
    vertices_.reserve(2 * run.size());
    for (const Sample& sample : run) {
      vertices_.push_back({sample.t, sample.p, std::binary_search(held.begin(), held.end(), sample.t),
                           std::binary_search(kept_.begin(), kept_.end(), sample.t)});
    }
    if (vertices_.empty()) return;
    vertices_.front().is_held = true;
    vertices_.back().is_held = true;
  }

  void push_from(const Point& place) {
    bool has_any = split([&](const Vertex& a, const Vertex& b) { return tip_.meets(a.p - place, b.p - place); });
    // An edge that is stretched is halved until its parts are short; no more passes than the edge has bits of length.
    constexpr int most_passes = 64;
    for (int pass = 0; pass < most_passes; ++pass) {
      has_any |= move_out(place);
      const bool is_split = has_any && split([&](const Vertex& a, const Vertex& b) {
                              const bool is_stuck = (a.is_held && tip_.contains(a.p - place)) ||
                                                    (b.is_held && tip_.contains(b.p - place));
                              return a.is_changed && !is_stuck;
                            });
      if (!is_split) break;
    }
    if (has_any) merge();
  }

  ChangedRun result() {
    drop_idle();
    spread();
    ChangedRun result;
    result.run = run_of(0, vertices_.size());
    result.changed = stretches();
    return result;
  }

 private:
  struct Vertex {
    double t = 0.0;
    Point p = Point::Zero();
    bool is_held = false;
    bool is_kept = false;
    bool is_new = false;
    bool is_changed = false;  // the edge to the next vertex, from what it was
  };

  // Halves edges longer than r / 4 that `is_asked` names, and halves of these.
  template <typename IsAsked>
  bool split(const IsAsked& is_asked) {
    const double longest = longest_of_radius * tip_.radius();
    const auto is_long = [&](const Vertex& a, const Vertex& b) {
      return (b.p - a.p).squaredNorm() > longest * longest && is_asked(a, b);
    };
    bool has_any = false;
    for (std::size_t i = 0; i + 1 < vertices_.size() && !has_any; ++i)
      has_any = is_long(vertices_[i], vertices_[i + 1]);
    if (!has_any) return false;
    for (std::size_t i = 0; i + 1 < vertices_.size(); ++i) {
      if (vertices_[i + 1].t - vertices_[i].t < least_room) {
        spread();
        break;
      }
    }
    std::vector<Vertex> halved;
    halved.reserve(2 * vertices_.size());
    std::vector<Vertex> ahead;
    for (std::size_t i = 0; i + 1 < vertices_.size(); ++i) {
      Vertex from = vertices_[i];
      ahead.assign(1, vertices_[i + 1]);
      while (!ahead.empty()) {
        if (is_long(from, ahead.back()) && ahead.back().t - from.t > 0.25 * least_room) {
          ahead.push_back(
              {0.5 * (from.t + ahead.back().t), 0.5 * (from.p + ahead.back().p), false, false, true, from.is_changed});
          continue;
        }
        halved.push_back(from);
        from = ahead.back();
        ahead.pop_back();
      }
    }
    halved.push_back(vertices_.back());
    vertices_.swap(halved);
    return true;
  }

  bool move_out(const Point& place) {
    bool has_moved = false;
    for (std::size_t i = 1; i + 1 < vertices_.size(); ++i) {
      Vertex& vertex = vertices_[i];
      if (vertex.is_held || !tip_.contains(vertex.p - place)) continue;
      Point tie = left_of(vertices_[i + 1].p - vertices_[i - 1].p);
      if (tie.isZero(0.0)) tie = Point::UnitX();
      vertex.p = place + tip_.nearest_boundary(vertex.p - place, tie);
      vertex.is_changed = true;
      vertices_[i - 1].is_changed = true;
      has_moved = true;
    }
    return has_moved;
  }

  // Takes sand away: vertices between two short edges, and those at the end of a fold whose sides lie on each other.
  void merge() {
    const double shortest = shortest_of_radius * tip_.radius();
    std::size_t kept = 1;
    for (std::size_t i = 1; i < vertices_.size(); ++i) {
      const Vertex next = vertices_[i];
      while (kept > 1) {
        const Vertex& vertex = vertices_[kept - 1];
        Vertex& before = vertices_[kept - 2];
        if (vertex.is_held || vertex.is_kept || !(vertex.is_changed || before.is_changed)) break;
        const double lengths = (vertex.p - before.p).norm() + (next.p - vertex.p).norm();
        if (lengths >= shortest && !is_fold(before.p, vertex.p, next.p)) break;
        before.is_changed = true;
        --kept;
      }
      vertices_[kept++] = next;
    }
    vertices_.resize(kept);
  }

  bool is_fold(const Point& before, const Point& tip, const Point& next) const {
    const double thinnest = thinnest_of_radius * tip_.radius();
    return (before - tip).dot(next - tip) > 0.0 &&
           std::min(distance_to_edge(before, tip, next), distance_to_edge(next, before, tip)) < thinnest;
  }

  // Halves of edges that nothing happened to become one again.
  void drop_idle() {
    if (vertices_.empty()) return;
    std::size_t kept = 1;
    for (std::size_t i = 1; i < vertices_.size(); ++i) {
      if (vertices_[i].is_new && !vertices_[i].is_changed && !vertices_[kept - 1].is_changed) continue;
      vertices_[kept++] = vertices_[i];
    }
    vertices_.resize(kept);
  }

  std::vector<ChangedRun::Stretch> stretches() const {
    std::vector<ChangedRun::Stretch> changed;
    for (std::size_t i = 0; i + 1 < vertices_.size(); ++i) {
      if (!vertices_[i].is_changed) continue;
      if (!changed.empty() && changed.back().last == i) {
        changed.back().last = i + 1;
      } else {
        changed.push_back({i, i + 1});
      }
    }
    return changed;
  }

  Run run_of(std::size_t from, std::size_t to) const {
    Run run;
    run.reserve(to - from);
    for (std::size_t i = from; i < to; ++i) run.push_back({vertices_[i].t, vertices_[i].p});
    return run;
  }

  void spread() {
    for (const auto& [first, last] : stretches()) {
      const Run run = respaced(run_of(first, last + 1), kept_);
      for (std::size_t i = first; i <= last; ++i) vertices_[i].t = run[i - first].t;
    }
  }

  const Tip& tip_;
  std::vector<double> kept_;  // with those that are held
  std::vector<Vertex> vertices_;
};

}  // namespace

ChangedRun push(const Run& run, const Tip& tip, const Points& path, std::span<const double> held,
                std::span<const double> kept) {
  if (path.rows() == 0 || !path.allFinite()) throw InvalidInput("push: a path that is empty or not finite");
  const double step = step_of_radius * tip.radius();
  double steps = 0.0;
  for (Index i = 0; i + 1 < path.rows(); ++i) steps += std::ceil((path.row(i + 1) - path.row(i)).norm() / step);
  if (!(steps <= most_steps))
    throw WorkLimitExceeded(text("push: a path of ", steps, " steps, more than ", most_steps));
  PushedRun pushed(run, tip, held, kept);
  pushed.push_from(path.row(0));
  for (Index i = 0; i + 1 < path.rows(); ++i) {
    const Point from = path.row(i);
    const Point to = path.row(i + 1);
    const double parts = std::ceil((to - from).norm() / step);
    for (double k = 1.0; k < parts; ++k) pushed.push_from(from + k / parts * (to - from));
    if (parts > 0.0) pushed.push_from(to);
  }
  return pushed.result();
}

Run respaced(const Run& run, std::span<const double> held) {
  Run result = run;
  std::size_t from = 0;
  for (std::size_t to = 1; to < run.size(); ++to) {
    if (to + 1 < run.size() && !std::binary_search(held.begin(), held.end(), run[to].t)) continue;
    double length = 0.0;
    for (std::size_t i = from; i < to; ++i) length += (run[i + 1].p - run[i].p).norm();
    // Places with no length between them get a step all the same: t ascends strictly.
    const double least = 1e-3 * length / static_cast<double>(to - from) + std::numeric_limits<double>::min();
    const double whole = length + least * static_cast<double>(to - from);
    double s = 0.0;
    for (std::size_t i = from; i + 1 < to; ++i) {
      s += (run[i + 1].p - run[i].p).norm() + least;
      result[i + 1].t = run[from].t + s / whole * (run[to].t - run[from].t);
    }
    from = to;
  }
  return result;
}

// --- Strokes ---

namespace {

Points without_repeats(const Points& drawn) {
  Points kept(drawn.rows(), 2);
  Index n = 0;
  for (Index i = 0; i < drawn.rows(); ++i) {
    if (n == 0 || drawn.row(i) != kept.row(n - 1)) kept.row(n++) = drawn.row(i);
  }
  return kept.topRows(n);
}

// How much a line turns at an arc length, looking so far to either side.
double turn_at(const Points& line, const Eigen::VectorXd& lengths, double s, double reach) {
  const Point here = point_along(line, lengths, s);
  const Point in = here - point_along(line, lengths, s - reach);
  const Point out = point_along(line, lengths, s + reach) - here;
  if (in.isZero(0.0) || out.isZero(0.0)) return 0.0;
  return std::abs(angle(in, out));
}

std::vector<int> corners_of(const Points& line, double angle, double reach) {
  const Eigen::VectorXd lengths = lengths_along(line);
  const Index n = line.rows();
  std::vector<int> corners;
  std::vector<double> turn(at(n), 0.0);
  for (Index i = 1; i + 1 < n; ++i) {
    const double half = turn_at(line, lengths, lengths[i], 0.5 * reach);
    if (half > 0.8 * angle && turn_at(line, lengths, lengths[i], reach) > angle) turn[at(i)] = half;
  }
  for (Index i = 1; i + 1 < n; ++i) {
    if (turn[at(i)] == 0.0) continue;
    bool is_largest = true;
    for (Index k = i - 1; k > 0 && lengths[i] - lengths[k] < reach; --k) is_largest &= turn[at(k)] < turn[at(i)];
    for (Index k = i + 1; k + 1 < n && lengths[k] - lengths[i] < reach; ++k) is_largest &= turn[at(k)] <= turn[at(i)];
    if (is_largest) corners.push_back(static_cast<int>(i));
  }
  return corners;
}

// What is kept at an end of a line that is smoothed.
enum class End { Point, Free };

// Points at even steps h: the x that makes |x - c|^2 + (scale / 2 pi)^4 |x''|^2 least.
Points smoothed_points(const Points& points, double h, double scale, End start, End end) {
  const int n = static_cast<int>(points.rows());
  const int first = start == End::Point ? 1 : 0;
  const int last = n - (end == End::Point ? 1 : 0);
  const int free = last - first;
  if (free < 1 || !(h > 0.0)) return points;
  const double stiffness = std::pow(scale / (2.0 * std::numbers::pi * h), 4);
  std::vector<int> starts;
  for (int i = 0; i < free; ++i) starts.push_back(std::max(0, i - 2));
  ProfileSystem system(std::move(starts));
  Points right = points.middleRows(first, free);
  for (int i = 0; i < free; ++i) system.entry(i, i) = 1.0;
  constexpr std::array<double, 3> bend = {1.0, -2.0, 1.0};
  for (int k = 1; k + 1 < n; ++k) {
    for (int a = 0; a < 3; ++a) {
      const int i = k - 1 + a;
      if (i < first || i >= last) continue;
      for (int b = 0; b < 3; ++b) {
        const int j = k - 1 + b;
        const double weight = stiffness * bend[at(a)] * bend[at(b)];
        if (j < first || j >= last) {
          right.row(i - first) -= weight * points.row(j);
        } else if (j <= i) {
          system.entry(i - first, j - first) += weight;
        }
      }
    }
  }
  if (!system.factor()) return points;
  Points result = points;
  result.middleRows(first, free) = system.solve(right);
  return result;
}

// From 0 to 1 with slope 0 at both.
double smooth_step(double x) {
  const double in = std::clamp(x, 0.0, 1.0);
  return in * in * (3.0 - 2.0 * in);
}

constexpr Index most_even_steps = 4096;

// So many steps of even length that features of `scale` have eight, and a line's own points two each.
Index even_steps(Index points, double length, double scale) {
  return std::clamp<Index>(std::max(2 * (points - 1), static_cast<Index>(std::ceil(8.0 * length / scale))), 2,
                           most_even_steps);
}

}  // namespace

Stroke tidy(const Points& drawn, const StrokeOptions& options) {
  if (!drawn.allFinite()) throw InvalidInput("tidy: a point is not finite");
  for (const double option : {options.noise, options.corner_angle, options.corner_reach}) {
    if (!(option >= 0.0 && std::isfinite(option))) throw InvalidInput(text("tidy: an option of ", option));
  }
  Stroke stroke;
  stroke.points = without_repeats(drawn);
  if (stroke.points.rows() < 2) throw InvalidInput("tidy: a stroke without length");
  const double length = lengths_along(stroke.points)[stroke.points.rows() - 1];
  const double reach = options.corner_reach > 0.0 ? options.corner_reach : 0.05 * length;
  stroke.corners = corners_of(stroke.points, options.corner_angle, reach);
  if (!(options.noise > 0.0)) return stroke;

  std::vector<Point> points;
  std::vector<int> corners;
  Index from = 0;
  for (std::size_t piece = 0; piece <= stroke.corners.size(); ++piece) {
    const bool is_last = piece == stroke.corners.size();
    const Index to = is_last ? stroke.points.rows() - 1 : stroke.corners[piece];
    const Points part = stroke.points.middleRows(from, to - from + 1);
    const Eigen::VectorXd lengths = lengths_along(part);
    const Index steps = even_steps(part.rows(), lengths[lengths.size() - 1], options.noise);
    const double h = lengths[lengths.size() - 1] / static_cast<double>(steps);
    Points even(steps + 1, 2);
    for (Index i = 0; i <= steps; ++i) even.row(i) = point_along(part, lengths, h * static_cast<double>(i));
    even.row(steps) = part.row(part.rows() - 1);
    even = smoothed_points(even, h, options.noise, End::Point, End::Point);
    if (piece > 0) corners.push_back(static_cast<int>(points.size()));
    for (Index i = 0; i < steps + (is_last ? 1 : 0); ++i) points.emplace_back(even.row(i));
    from = to;
  }
  stroke.points.resize(static_cast<Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) stroke.points.row(static_cast<Index>(i)) = points[i];
  stroke.corners = std::move(corners);
  return stroke;
}

namespace {

Stroke reversed(const Stroke& stroke) {
  Stroke result{stroke.points.colwise().reverse(), {}};
  for (auto corner = stroke.corners.rbegin(); corner != stroke.corners.rend(); ++corner) {
    result.corners.push_back(static_cast<int>(stroke.points.rows()) - 1 - *corner);
  }
  return result;
}

// Sum of squared distances of points at the same share of length.
double distance_of_shares(const Stroke& a, const Stroke& b) {
  constexpr int shares = 16;
  const Eigen::VectorXd along_a = lengths_along(a.points);
  const Eigen::VectorXd along_b = lengths_along(b.points);
  double sum = 0.0;
  for (int k = 0; k <= shares; ++k) {
    const double share = static_cast<double>(k) / shares;
    sum += (point_along(a.points, along_a, share * along_a[along_a.size() - 1]) -
            point_along(b.points, along_b, share * along_b[along_b.size() - 1]))
               .squaredNorm();
  }
  return sum;
}

}  // namespace

Stroke average(const std::vector<Stroke>& strokes) {
  if (strokes.empty()) throw InvalidInput("average: no stroke");
  std::vector<Stroke> turned;
  for (const Stroke& stroke : strokes) {
    if (stroke.points.rows() < 2) throw InvalidInput("average: a stroke of fewer than two points");
    Stroke other = reversed(stroke);
    const bool fits = distance_of_shares(strokes.front(), stroke) <= distance_of_shares(strokes.front(), other);
    turned.push_back(fits ? stroke : std::move(other));
  }
  const std::size_t corner_count = turned.front().corners.size();
  const bool has_pieces = std::all_of(turned.begin(), turned.end(),
                                      [&](const Stroke& stroke) { return stroke.corners.size() == corner_count; });
  const std::size_t pieces = has_pieces ? corner_count + 1 : 1;
  const auto part_of = [&](const Stroke& stroke, std::size_t piece) -> Points {
    const Index from = piece == 0 ? 0 : stroke.corners[piece - 1];
    const Index to = piece + 1 == pieces ? stroke.points.rows() - 1 : stroke.corners[piece];
    return stroke.points.middleRows(from, to - from + 1);
  };

  std::vector<Point> points;
  std::vector<int> corners;
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    std::vector<Points> parts;
    std::vector<Eigen::VectorXd> along;
    std::vector<double> shares;
    for (const Stroke& stroke : turned) {
      parts.push_back(part_of(stroke, piece));
      along.push_back(lengths_along(parts.back()));
      const double length = along.back()[along.back().size() - 1];
      for (Index i = 0; i < along.back().size(); ++i) shares.push_back(length > 0.0 ? along.back()[i] / length : 0.0);
    }
    std::sort(shares.begin(), shares.end());
    constexpr double same_share = 1e-12;
    double last = -1.0;
    if (piece > 0) corners.push_back(static_cast<int>(points.size()));
    for (const double share : shares) {
      if (share - last < same_share || (share > 1.0 - same_share && piece + 1 < pieces)) continue;
      last = share;
      Point sum = Point::Zero();
      for (std::size_t k = 0; k < parts.size(); ++k) {
        sum += point_along(parts[k], along[k], share * along[k][along[k].size() - 1]);
      }
      points.push_back(sum / static_cast<double>(parts.size()));
    }
  }
  Stroke result;
  result.points.resize(static_cast<Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) result.points.row(static_cast<Index>(i)) = points[i];
  result.corners = std::move(corners);
  return result;
}

namespace {

// Cubic Hermite functions over [0, 1] that carry a position and a slope at 0, and nothing at 1.
double position_part(double x) { return (1.0 - x) * (1.0 - x) * (1.0 + 2.0 * x); }
double slope_part(double x) { return x * (1.0 - x) * (1.0 - x); }

// What is missing at an end of a line: in position, and in direction a unit of length.
struct Missing {
  Point position = Point::Zero();
  Point slope = Point::Zero();
  double reach = 1.0;

  Missing(const Ray& wanted, const Point& is, const Point& is_direction, double over)
      : position(wanted.point - is), reach(over) {
    if (!wanted.direction.isZero(0.0)) slope = wanted.direction - is_direction;
  }
  bool is_nothing() const { return position.isZero(0.0) && slope.isZero(0.0); }
  Point at(double distance) const {
    const double x = distance / reach;
    if (x >= 1.0) return Point::Zero();
    return position_part(x) * position + reach * slope_part(x) * slope;
  }
  // Steps over the reach at which its chords are within an accuracy: its second derivative is below this bound.
  Index steps(double accuracy) const {
    if (is_nothing()) return 0;
    const double bend = 6.0 * position.norm() / (reach * reach) + 4.0 * slope.norm() / reach;
    const double step = std::sqrt(8.0 * accuracy / bend);
    return std::clamp<Index>(static_cast<Index>(std::ceil(reach / step)), 4, most_even_steps);
  }
};

}  // namespace

namespace {

Points points_of(const Run& run, std::size_t from, std::size_t to) {
  Points points(static_cast<Index>(to - from + 1), 2);
  for (std::size_t i = from; i <= to; ++i) points.row(static_cast<Index>(i - from)) = run[i].p;
  return points;
}

double t_at(const Run& run, std::size_t from, const PlaceAlong& place) {
  const Sample& before = run[from + at(place.edge)];
  const Sample& after = run[from + at(place.edge) + 1];
  return before.t + place.u * (after.t - before.t);
}

// The samples from one to another at even steps of arc length, both included; places with one t are one sample.
Run evenly(const Run& run, std::size_t from, std::size_t to, Index steps) {
  const Points points = points_of(run, from, to);
  const Eigen::VectorXd lengths = lengths_along(points);
  const double length = lengths[lengths.size() - 1];
  Run even;
  even.push_back(run[from]);
  for (Index i = 1; i < steps; ++i) {
    const PlaceAlong place = place_along(lengths, length * static_cast<double>(i) / static_cast<double>(steps));
    even.push_back({t_at(run, from, place), between(points, place)});
  }
  even.push_back(run[to]);
  return even;
}

double length_of(const Run& run, std::size_t from, std::size_t to) {
  double length = 0.0;
  for (std::size_t i = from; i < to; ++i) length += (run[i + 1].p - run[i].p).norm();
  return length;
}

// Samples whose t does not rise go, but for the last.
void drop_repeated(Run& run) {
  std::size_t kept = 1;
  for (std::size_t i = 1; i + 1 < run.size(); ++i) {
    if (run[i].t > run[kept - 1].t && run[i].t < run.back().t) run[kept++] = run[i];
  }
  run[kept++] = run.back();
  run.resize(kept);
}

}  // namespace

Run with_ends(const Run& run, const Ray& start, const Ray& end, double reach, double accuracy) {
  if (!(reach > 0.0 && accuracy > 0.0)) throw InvalidInput(text("with_ends: reach ", reach, ", accuracy ", accuracy));
  for (const Point& x : {start.point, start.direction, end.point, end.direction}) require_finite_point("with_ends", x);
  if (run.size() < 2) throw InvalidInput(text("with_ends: a run of ", run.size(), " samples"));
  const Points points = points_of(run, 0, run.size() - 1);
  const Index n = points.rows();
  const Eigen::VectorXd lengths = lengths_along(points);
  const double length = lengths[n - 1];
  if (!(length > 0.0)) throw InvalidInput("with_ends: a run without length");
  const double over = std::min(reach, 0.5 * length);
  const Missing at_start(start, points.row(0), (points.row(1) - points.row(0)).normalized(), over);
  // Seen from the end the run goes backwards.
  const Missing at_end({end.point, -end.direction}, points.row(n - 1),
                       (points.row(n - 2) - points.row(n - 1)).normalized(), over);

  // Arc lengths of samples; own ones by their number, so that they keep their t and point.
  struct Place {
    double s = 0.0;
    Index own = -1;
  };
  std::vector<Place> places;
  for (Index i = 0; i < n; ++i) places.push_back({lengths[i], i});
  const auto add = [&](Index steps, bool is_end) {
    for (Index k = 1; k < steps; ++k) {
      const double s = over * static_cast<double>(k) / static_cast<double>(steps);
      places.push_back({is_end ? length - s : s, -1});
    }
  };
  add(at_start.steps(accuracy), false);
  add(at_end.steps(accuracy), true);
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.s < b.s || (a.s == b.s && a.own > b.own); });

  Run bent;
  for (const Place& place : places) {
    const PlaceAlong along = place_along(lengths, place.s);
    const double t = place.own >= 0 ? run[at(place.own)].t : t_at(run, 0, along);
    if (!bent.empty() && place.own < 0 && !(t > bent.back().t)) continue;
    const Point x = place.own >= 0 ? run[at(place.own)].p : between(points, along);
    bent.push_back({t, x + at_start.at(place.s) + at_end.at(length - place.s)});
  }
  bent.front().p = start.point;
  bent.back().p = end.point;
  // An end's edge is a chord of what was bent: put on the tangent it is a second-order step away.
  const auto put_on = [](const Sample& from, Sample& to, const Point& direction) {
    if (!direction.isZero(0.0)) to.p = from.p + (to.p - from.p).norm() * direction.normalized();
  };
  if (bent.size() >= 4) {
    put_on(bent.front(), bent[1], start.direction);
    put_on(bent.back(), bent[bent.size() - 2], -end.direction);
  }
  return bent;
}

Run smoothed(const Run& run, double scale, std::span<const double> held) {
  if (!(scale > 0.0 && std::isfinite(scale))) throw InvalidInput(text("smoothed: a scale of ", scale));
  if (run.size() < 2) throw InvalidInput(text("smoothed: a run of ", run.size(), " samples"));
  Run result{run.front()};
  std::size_t from = 0;
  for (std::size_t to = 1; to < run.size(); ++to) {
    const bool is_last = to + 1 == run.size();
    if (!is_last && !std::binary_search(held.begin(), held.end(), run[to].t)) continue;
    const double length = length_of(run, from, to);
    const Index steps = even_steps(static_cast<Index>(to - from + 1), length, scale);
    Run even = evenly(run, from, to, steps);
    const double h = length / static_cast<double>(steps);
    const Points points = smoothed_points(points_of(even, 0, even.size() - 1), h, scale,
                                          from == 0 ? End::Free : End::Point, is_last ? End::Free : End::Point);
    // At the ends of the run what is smooth sets in over half the scale: holding a rough direction there would swing.
    const double fade = std::min(0.5 * scale, 0.25 * length);
    for (std::size_t i = 1; i + 1 < even.size(); ++i) {
      double share = 1.0;
      if (from == 0) share *= smooth_step(h * static_cast<double>(i) / fade);
      if (is_last) share *= smooth_step(h * static_cast<double>(even.size() - 1 - i) / fade);
      even[i].p += share * (points.row(static_cast<Index>(i)).transpose() - even[i].p);
    }
    drop_repeated(even);
    result.insert(result.end(), even.begin() + 1, even.end());
    from = to;
  }
  return result;
}

Run with_detail(const Run& run, const DetailLibrary& library, double gain, std::uint64_t seed) {
  if (run.size() < 2) throw InvalidInput(text("with_detail: a run of ", run.size(), " samples"));
  if (!std::isfinite(gain)) throw InvalidInput("with_detail: a gain that is not finite");
  const double length = length_of(run, 0, run.size() - 1);
  if (!(length >= library.scale)) {
    throw InvalidInput(text("with_detail: a run of ", length, " units is shorter than the scale of ", library.scale));
  }
  // A sample has at least 24 steps to a scale, and the run at least its own points.
  const auto of_scale = static_cast<Index>(std::ceil(32.0 * length / library.scale));
  const Index steps = std::clamp<Index>(std::max<Index>(of_scale, static_cast<Index>(run.size())), 8, most_even_steps);
  Run even = evenly(run, 0, run.size() - 1, steps);
  const Points points = points_of(even, 0, even.size() - 1);
  const DetailBase base(points, false, library.scale);
  const Points own = points - base.points();

  Points wish = -own;
  if (gain != 0.0) {
    const DetailBed bed{base.length(), false, {}, {}};
    const Points laid = gain * lay_detail(library, bed, seed, false, base.places());
    for (Index i = 0; i < laid.rows(); ++i) {
      if (library.frame == DetailFrame::Fixed) {
        wish.row(i) += laid.row(i);
      } else {
        const Point along = base.tangents().row(i);
        wish.row(i) += (laid(i, 0) * along - laid(i, 1) * left_of(along)).transpose();
      }
    }
  }
  Eigen::VectorXd mask(points.rows());
  const double fade = std::min(0.5 * library.scale, 0.5 * length);
  for (Index i = 0; i < mask.size(); ++i) {
    const double s = length * static_cast<double>(std::min(i, steps - i)) / static_cast<double>(steps);
    mask[i] = s >= fade ? 1.0 : 0.5 - 0.5 * std::cos(std::numbers::pi * s / fade);
  }
  const Points displacement = base.detail_part(wish, mask);
  for (std::size_t i = 1; i + 1 < even.size(); ++i) even[i].p += displacement.row(static_cast<Index>(i));
  drop_repeated(even);
  return even;
}

// --- Places on a curve ---

namespace {

// An edge's stretch of t between two shares of it.
Interval stretch(const Sample& a, const Sample& b, double from, double to) {
  return {a.t + from * (b.t - a.t), a.t + to * (b.t - a.t)};
}

// The part of an edge within a distance of a segment: an interval, as the distance is convex along the edge.
std::pair<double, double> near_part(const Point& a, const Point& b, const Point& from, const Point& to, double radius) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  const Point d = b - a;
  const double dd = d.squaredNorm();
  const auto add = [&](double u, double v) {
    if (!(u <= v)) return;
    low = std::min(low, u);
    high = std::max(high, v);
  };
  for (const Point& centre : {from, to}) {
    const Point x = a - centre;
    const double half = d.dot(x);
    const double rest = x.squaredNorm() - radius * radius;
    if (!(dd > 0.0)) {
      if (rest <= 0.0) add(0.0, 1.0);
      continue;
    }
    const double root = half * half - dd * rest;
    if (root < 0.0) continue;
    add(std::max((-half - std::sqrt(root)) / dd, 0.0), std::min((-half + std::sqrt(root)) / dd, 1.0));
  }
  const Point axis = to - from;
  const double length = axis.norm();
  if (length > 0.0) {
    const Point along = axis / length;
    double u = 0.0;
    double v = 1.0;
    const auto clip = [&](double at_a, double at_b) {  // where it is not negative
      if (at_a < 0.0 && at_b < 0.0) v = -1.0;
      if (at_a < 0.0 && at_b >= 0.0) u = std::max(u, at_a / (at_a - at_b));
      if (at_b < 0.0 && at_a >= 0.0) v = std::min(v, at_a / (at_a - at_b));
    };
    clip(along.dot(a - from), along.dot(b - from));
    clip(length - along.dot(a - from), length - along.dot(b - from));
    clip(radius - cross(along, a - from), radius - cross(along, b - from));
    clip(radius + cross(along, a - from), radius + cross(along, b - from));
    add(u, v);
  }
  return {low, high};
}

int winding(const Points& polygon, const Point& x) {
  int turns = 0;
  for (Index i = 0; i < polygon.rows(); ++i) {
    const Point a = polygon.row(i);
    const Point b = polygon.row(i + 1 < polygon.rows() ? i + 1 : 0);
    if ((a.y() <= x.y()) == (b.y() <= x.y())) continue;
    const double side = cross(b - a, x - a);
    if (a.y() <= x.y() && side > 0.0) ++turns;
    if (b.y() <= x.y() && side < 0.0) --turns;
  }
  return turns;
}

// Where an edge goes across a segment, as a share of the edge; none if it does not. Ends count once: the start does.
std::optional<double> share_across(const Point& a, const Point& b, const Point& from, const Point& to) {
  const double at_a = cross(to - from, a - from);
  const double at_b = cross(to - from, b - from);
  if ((at_a < 0.0) == (at_b < 0.0)) return std::nullopt;
  const double at_from = cross(b - a, from - a);
  const double at_to = cross(b - a, to - a);
  if ((at_from < 0.0) == (at_to < 0.0)) return std::nullopt;
  return std::clamp(at_a / (at_a - at_b), 0.0, 1.0);
}

bool is_apart(const Box& box, const Point& a, const Point& b) {
  return std::max(a.x(), b.x()) < box.low.x() || std::min(a.x(), b.x()) > box.high.x() ||
         std::max(a.y(), b.y()) < box.low.y() || std::min(a.y(), b.y()) > box.high.y();
}

}  // namespace

IntervalSet painted(const Run& run, const Points& path, double radius) {
  if (!(radius > 0.0 && std::isfinite(radius))) throw InvalidInput(text("painted: a radius of ", radius));
  if (!path.allFinite()) throw InvalidInput("painted: a point is not finite");
  const Box box = box_around(path, radius);
  IntervalSet found;
  for (std::size_t i = 0; i + 1 < run.size(); ++i) {
    const Sample& a = run[i];
    const Sample& b = run[i + 1];
    if (is_apart(box, a.p, b.p)) continue;
    for (Index k = 0; k < std::max<Index>(path.rows() - 1, 1); ++k) {
      const auto [low, high] = near_part(a.p, b.p, path.row(k), path.row(std::min(k + 1, path.rows() - 1)), radius);
      if (low < high) found.add(stretch(a, b, low, high));
    }
  }
  return found;
}

IntervalSet inside_lasso(const Run& run, const Points& lasso) {
  if (lasso.rows() < 3) throw InvalidInput(text("inside_lasso: a lasso of ", lasso.rows(), " points"));
  if (!lasso.allFinite()) throw InvalidInput("inside_lasso: a point is not finite");
  const Box box = box_around(lasso);
  IntervalSet found;
  std::vector<double> shares;
  for (std::size_t i = 0; i + 1 < run.size(); ++i) {
    const Sample& a = run[i];
    const Sample& b = run[i + 1];
    if (is_apart(box, a.p, b.p)) continue;
    shares.assign({0.0, 1.0});
    for (Index k = 0; k < lasso.rows(); ++k) {
      const Point to = lasso.row(k + 1 < lasso.rows() ? k + 1 : 0);
      if (const auto share = share_across(a.p, b.p, lasso.row(k), to)) shares.push_back(*share);
    }
    std::sort(shares.begin(), shares.end());
    for (std::size_t k = 0; k + 1 < shares.size(); ++k) {
      const double middle = 0.5 * (shares[k] + shares[k + 1]);
      if (!(shares[k] < shares[k + 1]) || winding(lasso, a.p + middle * (b.p - a.p)) == 0) continue;
      found.add(stretch(a, b, shares[k], shares[k + 1]));
    }
  }
  return found;
}

std::vector<double> crossed(const Run& run, const Points& stroke) {
  if (!stroke.allFinite()) throw InvalidInput("crossed: a point is not finite");
  const Box box = box_around(stroke);
  std::vector<double> found;
  for (std::size_t i = 0; i + 1 < run.size(); ++i) {
    const Sample& a = run[i];
    const Sample& b = run[i + 1];
    if (is_apart(box, a.p, b.p)) continue;
    for (Index k = 0; k + 1 < stroke.rows(); ++k) {
      if (const auto share = share_across(a.p, b.p, stroke.row(k), stroke.row(k + 1))) {
        found.push_back(a.t + *share * (b.t - a.t));
      }
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

NearestPlace nearest(const Run& run, const Point& place) {
  require_finite_point("nearest", place);
  if (run.empty()) throw InvalidInput("nearest: an empty run");
  NearestPlace found{run.front().t, (run.front().p - place).norm()};
  for (std::size_t i = 0; i + 1 < run.size(); ++i) {
    const Point along = run[i + 1].p - run[i].p;
    const double square = along.squaredNorm();
    const double u = square > 0.0 ? std::clamp((place - run[i].p).dot(along) / square, 0.0, 1.0) : 0.0;
    const double distance = (run[i].p + u * along - place).norm();
    if (distance < found.distance) found = {run[i].t + u * (run[i + 1].t - run[i].t), distance};
  }
  return found;
}

}  // namespace fontcore
