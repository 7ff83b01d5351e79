#include "fontcore/ink.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "fontcore/error.h"

namespace fontcore {

namespace {

// Heights nearer than this are one, as share of the largest coordinate.
constexpr double same_height = 1e-13;
// Slabs in which edges change places are halved until this much area lies between them, as share of the
// square of the box's diagonal.
constexpr double settled_area = 1e-13;

// Edges ---------------------------------------------------------------------------------------------------------------

/// A part of a segment along which neither coordinate turns back, as polynomials in t from 0, its lower end, to 1.
struct Edge {
  int winding = 0;  ///< what the winding number gains from left to right: 1 if the outline runs down, -1 if up
  int degree = 1;
  std::array<double, 4> x{};  ///< coefficients of powers
  std::array<double, 4> y{};
  double low = 0.0;  ///< y at t = 0
  double high = 0.0;
  double left = 0.0;   ///< x at t = 0
  double right = 0.0;  ///< x at t = 1
};

double value(const std::array<double, 4>& c, double t) { return c[0] + t * (c[1] + t * (c[2] + t * c[3])); }
double slope(const std::array<double, 4>& c, double t) { return c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]); }

/// The t at a height, by Newton's method within an interval that shrinks round the root.
double parameter(const Edge& edge, double y, double from) {
  if (y <= edge.low) return 0.0;
  if (y >= edge.high) return 1.0;
  if (edge.degree == 1) return (y - edge.low) / (edge.high - edge.low);
  double low = from;
  double high = 1.0;
  double t = low + (high - low) * (y - value(edge.y, low)) / (edge.high - value(edge.y, low));
  if (!(t >= low && t <= high)) t = 0.5 * (low + high);
  for (int step = 0; step < 60; ++step) {
    const double miss = value(edge.y, t) - y;
    if (miss == 0.0) break;
    (miss < 0.0 ? low : high) = t;
    double better = t - miss / slope(edge.y, t);
    if (!(better > low && better < high)) better = 0.5 * (low + high);
    if (std::abs(better - t) <= std::numeric_limits<double>::epsilon()) break;
    t = better;
  }
  return t;
}

double x_at(const Edge& edge, double t) { return t <= 0.0 ? edge.left : t >= 1.0 ? edge.right : value(edge.x, t); }

/// Integral of x dy from t = 0 on.
double swept(const Edge& edge, double t) {
  double sum = 0.0;
  double power = t;
  // x y' = sum over n of t^n sum over j of x_(n - j) (j + 1) y_(j + 1)
  const auto degree = static_cast<std::size_t>(edge.degree);
  for (std::size_t n = 0; n + 1 <= 2 * degree; ++n) {
    double coefficient = 0.0;
    for (std::size_t j = n > degree ? n - degree : 0; j <= n && j < degree; ++j)
      coefficient += edge.x[n - j] * static_cast<double>(j + 1) * edge.y[j + 1];
    sum += coefficient * power / static_cast<double>(n + 1);
    power *= t;
  }
  return sum;
}

void add_edge(Bezier bezier, std::vector<Edge>& edges) {
  if (bezier.start().y() == bezier.end().y()) return;
  Edge edge;
  edge.winding = 1;
  edge.degree = bezier.degree;
  if (bezier.start().y() < bezier.end().y()) {
    edge.winding = -1;
  } else {
    std::reverse(bezier.p.begin(), bezier.p.begin() + bezier.degree + 1);
  }
  const auto& p = bezier.p;
  for (const Eigen::Index axis : {0, 1}) {
    auto& c = axis == 0 ? edge.x : edge.y;
    const double d1 = p[1][axis] - p[0][axis];
    c[0] = p[0][axis];
    if (edge.degree == 1) c[1] = d1;
    if (edge.degree == 2) c = {c[0], 2.0 * d1, p[2][axis] - p[1][axis] - d1, 0.0};
    if (edge.degree == 3) {
      const double d2 = p[2][axis] - p[1][axis];
      c = {c[0], 3.0 * d1, 3.0 * (d2 - d1), p[3][axis] - p[2][axis] - 2.0 * d2 + d1};
    }
  }
  edge.low = bezier.start().y();
  edge.high = bezier.end().y();
  edge.left = bezier.start().x();
  edge.right = bezier.end().x();
  edges.push_back(edge);
}

/// All edges of contours seen from an origin; horizontal ones sweep nothing and are left out.
std::vector<Edge> edges_of(const std::vector<BezierContour>& contours, const Point& origin) {
  std::vector<Edge> edges;
  for (const BezierContour& contour : contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      Bezier rest = contour.segment(s);
      for (auto& p : rest.p) p -= origin;
      if (rest.degree > 1) {
        std::vector<double> turns = extrema(rest, 0);
        const std::vector<double> of_y = extrema(rest, 1);
        turns.insert(turns.end(), of_y.begin(), of_y.end());
        std::sort(turns.begin(), turns.end());
        double done = 0.0;
        for (const double u : turns) {
          if (u <= done) continue;
          const auto part = split(rest, (u - done) / (1.0 - done));
          add_edge(part[0], edges);
          rest = part[1];
          done = u;
        }
      }
      add_edge(rest, edges);
    }
  }
  return edges;
}

// Regions -------------------------------------------------------------------------------------------------------------

/// Regions of the plane put together from what lies between two edges in one slab.
class Regions {
 public:
  static constexpr int outside = 0;

  Regions() { add(false); }

  int add(bool is_ink) {
    parent_.push_back(static_cast<int>(parent_.size()));
    is_ink_.push_back(is_ink);
    boxes_.emplace_back();
    return parent_.back();
  }
  void join(int a, int b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    if (b < a) std::swap(a, b);
    parent_[at(b)] = a;
    boxes_[at(a)].add(boxes_[at(b)]);
  }
  Box& box(int region) { return boxes_[at(root(region))]; }

  int parts() {
    int parts = 0;
    for (int i = 0; i < static_cast<int>(parent_.size()); ++i) parts += is_ink_[at(i)] && root(i) == i;
    return parts;
  }
  std::vector<Box> counters() {
    std::vector<Box> counters;
    for (int i = 1; i < static_cast<int>(parent_.size()); ++i)
      if (!is_ink_[at(i)] && root(i) == i) counters.push_back(boxes_[at(i)]);
    return counters;
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  int root(int i) {
    while (parent_[at(i)] != i) i = parent_[at(i)] = parent_[at(parent_[at(i)])];
    return i;
  }

  std::vector<int> parent_;
  std::vector<char> is_ink_;
  std::vector<Box> boxes_;
};

void sort_boxes(std::vector<Box>& boxes) {
  std::sort(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) {
    return std::tuple(a.low.x(), a.low.y(), a.high.x(), a.high.y()) <
           std::tuple(b.low.x(), b.low.y(), b.high.x(), b.high.y());
  });
}

// Slabs ---------------------------------------------------------------------------------------------------------------

/// One edge where it passes through a slab.
struct Passage {
  const Edge* edge;
  double t0, t1;      // at the slab's bottom and top
  double x0, xm, x1;  // at its bottom, half way and top
};

/// The sweep from bottom to top.
class Slabs {
 public:
  Slabs(const std::vector<Edge>& edges, const CrossingOptions& options, double settled)
      : edges_(edges), contact_(options.contact_distance), budget_(options.most_work), settled_(settled) {}

  void sweep(const std::vector<double>& heights);

  double area() const { return area_; }
  Regions& regions() { return regions_; }

 private:
  /// What lies between two edges in one slab: its stretches of the slab's bottom and top, and the region that it
  /// belongs to.
  struct Cell {
    bool is_ink;
    double bottom_from, bottom_to;
    double top_from, top_to;
    int region = unknown;
  };
  static constexpr int unknown = -1;
  static Cell outside();

  void slab(std::vector<Passage>& passages, double low, double high);
  void settle(const std::vector<Passage>& passages, double low, double high);
  void connect(std::vector<Cell> cells, double low, double high);

  const std::vector<Edge>& edges_;
  double contact_;
  long budget_;
  double settled_;  // area that is none
  double area_ = 0.0;
  Regions regions_;
  std::vector<Cell> below_;  // the last slab that had height
};

Slabs::Cell Slabs::outside() {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return {false, -infinity, infinity, -infinity, infinity, Regions::outside};
}

void Slabs::sweep(const std::vector<double>& heights) {
  std::vector<std::size_t> order(edges_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t i, std::size_t j) { return std::tie(edges_[i].low, i) < std::tie(edges_[j].low, j); });
  below_ = {outside()};
  std::vector<Passage> passages;
  std::size_t next = 0;
  for (std::size_t k = 0; k + 1 < heights.size(); ++k) {
    const double middle = 0.5 * (heights[k] + heights[k + 1]);
    std::erase_if(passages, [&](const Passage& one) { return one.edge->high <= middle; });
    for (Passage& one : passages) {  // on from the slab below
      one.t0 = one.t1;
      one.x0 = one.x1;
    }
    for (; next < order.size() && edges_[order[next]].low <= middle; ++next) {
      const Edge& edge = edges_[order[next]];
      if (edge.high > middle) passages.push_back({&edge, 0.0, 0.0, edge.left, 0.0, 0.0});
    }
    for (Passage& one : passages) {
      one.t1 = parameter(*one.edge, heights[k + 1], one.t0);
      one.x1 = x_at(*one.edge, one.t1);
    }
    slab(passages, heights[k], heights[k + 1]);
  }
  connect({outside()}, heights.back(), heights.back());
}

/// The passages in order from left to right, which must be the same at the bottom and at the top; else the slab is
/// halved. Crossings known are heights of their own, so this is for edges that run along each other.
void Slabs::slab(std::vector<Passage>& passages, double low, double high) {
  budget_ -= static_cast<long>(passages.size()) + 1;
  if (budget_ < 0) throw WorkLimitExceeded("measure_ink: too many edges lie on each other");
  const double middle = 0.5 * (low + high);
  for (Passage& one : passages) one.xm = x_at(*one.edge, parameter(*one.edge, middle, one.t0));
  std::sort(passages.begin(), passages.end(), [](const Passage& a, const Passage& b) {
    return std::tuple(a.xm, a.x0 + a.x1, a.edge) < std::tuple(b.xm, b.x0 + b.x1, b.edge);
  });
  double disorder = 0.0;
  for (std::size_t i = 0; i + 1 < passages.size(); ++i) {
    disorder = std::max({disorder, passages[i].x0 - passages[i + 1].x0, passages[i].x1 - passages[i + 1].x1});
  }
  if (disorder * (high - low) <= settled_) {
    settle(passages, low, high);
    return;
  }
  std::vector<Passage> lower = passages;
  std::vector<Passage> upper = passages;
  for (std::size_t i = 0; i < lower.size(); ++i) {
    const double t = parameter(*lower[i].edge, middle, lower[i].t0);
    lower[i].t1 = upper[i].t0 = t;
    lower[i].x1 = upper[i].x0 = lower[i].xm;
  }
  slab(lower, low, middle);
  slab(upper, middle, high);
}

/// Adds the ink between passages that do not change places, and what hangs together there.
void Slabs::settle(const std::vector<Passage>& passages, double low, double high) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const bool has_height = high - low > contact_;
  std::vector<Cell> cells;
  if (has_height) cells.push_back(outside());
  int winding = 0;
  for (std::size_t i = 0; i < passages.size(); ++i) {
    const Passage& one = passages[i];
    const bool was_ink = winding != 0;
    winding += one.edge->winding;
    const bool is_ink = winding != 0;
    if (was_ink != is_ink) {
      const double sweep = swept(*one.edge, one.t1) - swept(*one.edge, one.t0);
      area_ += is_ink ? -sweep : sweep;
    }
    if (!has_height) continue;
    const bool is_last = i + 1 == passages.size();
    const Passage& beside = passages[is_last ? i : i + 1];
    // What lies on both sides of a narrow cell is beside each other.
    if (!is_last && std::max({beside.x0 - one.x0, beside.xm - one.xm, beside.x1 - one.x1}) <= contact_) continue;
    const double bottom_to = is_last ? infinity : beside.x0;
    const double top_to = is_last ? infinity : beside.x1;
    Cell& last = cells.back();
    if (is_ink == last.is_ink) {
      last.bottom_to = bottom_to;
      last.top_to = top_to;
    } else {
      last.bottom_to = one.x0;
      last.top_to = one.x1;
      cells.push_back({is_ink, one.x0, bottom_to, one.x1, top_to});
    }
  }
  if (!has_height) return;
  cells.back().region = Regions::outside;
  connect(std::move(cells), low, high);
}

/// Gives the cells of a slab the regions that come up from below.
void Slabs::connect(std::vector<Cell> cells, double low, double high) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < below_.size() && j < cells.size()) {
    const Cell& a = below_[i];
    Cell& b = cells[j];
    if (a.is_ink == b.is_ink && std::min(a.top_to, b.bottom_to) - std::max(a.top_from, b.bottom_from) > contact_) {
      if (b.region == unknown) b.region = a.region;
      regions_.join(a.region, b.region);
    }
    ++(a.top_to < b.bottom_to ? i : j);
  }
  for (Cell& cell : cells) {
    if (cell.region == unknown) cell.region = regions_.add(cell.is_ink);
    if (cell.region == Regions::outside) continue;
    Box& box = regions_.box(cell.region);
    for (const double x : {cell.bottom_from, cell.bottom_to}) box.add(Point(x, low));
    for (const double x : {cell.top_from, cell.top_to}) box.add(Point(x, high));
  }
  below_ = std::move(cells);
}

// -----------------------------------------------------------------------------------------------------------------------

Point start_of(const BezierContour& contour) { return contour.point(contour.node(0)); }

bool is_in(const Box& box, const Point& point) {
  return (point.array() >= box.low.array()).all() && (point.array() <= box.high.array()).all();
}

/// Contours that meet nowhere, each wound once: what lies inside and outside beside a contour tells what it adds.
Ink ink_of_apart(const std::vector<BezierContour>& contours) {
  Ink ink;
  std::vector<Box> boxes;
  for (const BezierContour& contour : contours) boxes.push_back(control_box(contour));
  for (std::size_t i = 0; i < contours.size(); ++i) {
    const double area = signed_area(contours[i]);
    if (area == 0.0) continue;
    int outside = 0;
    for (std::size_t j = 0; j < contours.size(); ++j) {
      if (j != i && is_in(boxes[j], start_of(contours[i])))
        outside += winding_number(contours[j], start_of(contours[i]));
    }
    const int inside = outside + (area > 0.0 ? 1 : -1);
    if (outside == 0) {
      ink.area += std::abs(area);
      ++ink.parts;
    } else if (inside == 0) {
      ink.area -= std::abs(area);
      ink.counters.push_back(tight_box(contours[i]));
    }
  }
  sort_boxes(ink.counters);
  return ink;
}

}  // namespace

int winding_number(const BezierContour& contour, const Point& point) {
  int winding = 0;
  // Edges crossed by the ray to the left; each holds its lower end and not its upper one.
  for (int s = 0; s < contour.segment_count(); ++s) {
    Bezier bezier = contour.segment(s);
    Box box;
    for (std::size_t k = 0; k <= static_cast<std::size_t>(bezier.degree); ++k) box.add(bezier.p[k]);
    if (point.y() < box.low.y() || point.y() > box.high.y() || point.x() < box.low.x()) continue;
    const auto rises = [&](double from, double to) { return (from <= point.y()) != (to <= point.y()); };
    if (point.x() > box.high.x()) {
      if (rises(bezier.start().y(), bezier.end().y())) winding += bezier.start().y() < bezier.end().y() ? -1 : 1;
      continue;
    }
    std::vector<Edge> edges;
    double done = 0.0;
    for (const double u : bezier.degree > 1 ? extrema(bezier, 1) : std::vector<double>{}) {
      const auto part = split(bezier, (u - done) / (1.0 - done));
      add_edge(part[0], edges);
      bezier = part[1];
      done = u;
    }
    add_edge(bezier, edges);
    for (const Edge& edge : edges) {
      if (!rises(edge.low, edge.high)) continue;
      if (x_at(edge, parameter(edge, point.y(), 0.0)) < point.x()) winding += edge.winding;
    }
  }
  return winding;
}

Ink measure_ink(const std::vector<BezierContour>& contours, const CrossingOptions& options) {
  return measure_ink(contours, find_crossings(contours, options), options);
}

Ink measure_ink(const std::vector<BezierContour>& contours, const std::vector<Crossing>& crossings,
                const CrossingOptions& options) {
  if (crossings.empty()) return ink_of_apart(contours);
  const Box box = control_box(contours);
  const Point origin = 0.5 * (box.low + box.high);
  const Point size = box.high - box.low;
  const std::vector<Edge> edges = edges_of(contours, origin);
  std::vector<double> heights;
  for (const Edge& edge : edges) {
    heights.push_back(edge.low);
    heights.push_back(edge.high);
  }
  for (const Crossing& crossing : crossings) heights.push_back(crossing.where.y() - origin.y());
  std::sort(heights.begin(), heights.end());
  const double least = same_height * std::max(box.high.cwiseAbs().maxCoeff(), box.low.cwiseAbs().maxCoeff());
  heights.erase(
      std::unique(heights.begin(), heights.end(), [&](double low, double high) { return high - low <= least; }),
      heights.end());

  Slabs slabs(edges, options, settled_area * size.squaredNorm());
  slabs.sweep(heights);
  Ink ink{slabs.area(), slabs.regions().parts(), slabs.regions().counters()};
  for (Box& counter : ink.counters) {
    counter.low += origin;
    counter.high += origin;
  }
  sort_boxes(ink.counters);
  return ink;
}

namespace {

// Pairs of segments compared to tell which contours meet: hundred times what the richest drawn glyphs take.
constexpr std::int64_t most_orientation_work = 20'000'000;

/// Whether contours meet; if that takes too much to tell, they may.
bool may_meet(const BezierContour& a, const BezierContour& b) {
  const auto boxes_of = [](const BezierContour& contour) {
    std::vector<Box> boxes;
    for (int s = 0; s < contour.segment_count(); ++s) boxes.push_back(control_box(contour.segment(s)));
    return boxes;
  };
  const std::vector<Box> of_b = boxes_of(b);
  const std::vector<Box> of_a = boxes_of(a);
  const Box box_b = control_box(b);
  const bool are_near = std::any_of(of_a.begin(), of_a.end(), [&](const Box& one) {
    return overlap(one, box_b) &&
           std::any_of(of_b.begin(), of_b.end(), [&](const Box& other) { return overlap(one, other); });
  });
  if (!are_near) return false;
  try {
    const std::vector<Crossing> found = find_crossings({a, b});
    return std::any_of(found.begin(), found.end(), [](const Crossing& at) { return at.a.contour != at.b.contour; });
  } catch (const WorkLimitExceeded&) {
    return true;
  }
}

}  // namespace

std::vector<int> orientation_signs(const std::vector<BezierContour>& contours) {
  const std::size_t n = contours.size();
  if (n == 1) return {signed_area(contours[0]) < 0.0 ? -1 : 1};
  std::vector<Box> boxes;
  for (const BezierContour& contour : contours) boxes.push_back(control_box(contour));
  std::vector<std::size_t> group(n);
  std::iota(group.begin(), group.end(), std::size_t{0});
  std::int64_t work = 0;
  for (std::size_t i = 0; i < n && work <= most_orientation_work; ++i) {
    for (std::size_t j = i + 1; j < n && work <= most_orientation_work; ++j) {
      ++work;
      if (group[i] == group[j] || !overlap(boxes[i], boxes[j])) continue;
      work += std::int64_t{contours[i].segment_count()} * contours[j].segment_count();
      const auto lies_in = [&](std::size_t inner, std::size_t outer) {
        return is_in(boxes[outer], start_of(contours[inner])) &&
               winding_number(contours[outer], start_of(contours[inner])) != 0;
      };
      if (lies_in(i, j) || lies_in(j, i) || may_meet(contours[i], contours[j]))
        std::replace(group.begin(), group.end(), group[j], std::size_t{group[i]});
    }
  }
  if (work > most_orientation_work) std::fill(group.begin(), group.end(), std::size_t{0});
  std::vector<double> area(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) area[group[i]] += signed_area(contours[i]);
  std::vector<int> signs(n);
  for (std::size_t i = 0; i < n; ++i) signs[i] = area[group[i]] < 0.0 ? -1 : 1;
  return signs;
}

std::vector<Box> closed_counters(const Ink& before, const Ink& after) {
  struct Match {
    double difference;
    std::size_t before;
    std::size_t after;
  };
  std::vector<Match> matches;
  for (std::size_t i = 0; i < before.counters.size(); ++i) {
    for (std::size_t j = 0; j < after.counters.size(); ++j) {
      const Box& a = before.counters[i];
      const Box& b = after.counters[j];
      if ((a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any()) continue;
      matches.push_back({(a.low - b.low).norm() + (a.high - b.high).norm(), i, j});
    }
  }
  std::sort(matches.begin(), matches.end(), [](const Match& x, const Match& y) {
    return std::tie(x.difference, x.before, x.after) < std::tie(y.difference, y.before, y.after);
  });
  std::vector<bool> is_kept(before.counters.size(), false);
  std::vector<bool> is_given(after.counters.size(), false);
  for (const Match& match : matches) {
    if (is_kept[match.before] || is_given[match.after]) continue;
    is_kept[match.before] = is_given[match.after] = true;
  }
  std::vector<Box> closed;
  for (std::size_t i = 0; i < before.counters.size(); ++i)
    if (!is_kept[i]) closed.push_back(before.counters[i]);
  return closed;
}

std::vector<int> changed_windings(const std::vector<BezierContour>& before,
                                  const std::vector<Crossing>& crossings_before,
                                  const std::vector<BezierContour>& after,
                                  const std::vector<Crossing>& crossings_after) {
  if (before.size() != after.size()) {
    throw InvalidInput(text("changed_windings: ", before.size(), " contours before, ", after.size(), " after"));
  }
  const std::size_t n = before.size();
  std::vector<bool> meet(n * n, false);
  for (const std::vector<Crossing>* list : {&crossings_before, &crossings_after}) {
    for (const Crossing& crossing : *list) {
      const auto a = static_cast<std::size_t>(crossing.a.contour);
      const auto b = static_cast<std::size_t>(crossing.b.contour);
      meet[a * n + b] = meet[b * n + a] = true;
    }
  }
  const auto sign = [](double x) { return (x > 0.0) - (x < 0.0); };
  std::vector<int> changed;
  for (std::size_t i = 0; i < n; ++i) {
    const auto around = [&](const std::vector<BezierContour>& contours) {
      int winding = 0;
      for (std::size_t j = 0; j < n; ++j)
        if (j != i && !meet[i * n + j]) winding += winding_number(contours[j], start_of(contours[i]));
      return winding;
    };
    if (sign(signed_area(before[i])) != sign(signed_area(after[i])) || around(before) != around(after))
      changed.push_back(static_cast<int>(i));
  }
  return changed;
}

}  // namespace fontcore
