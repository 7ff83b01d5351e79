#include "fontcore/weight.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "fontcore/constraint.h"
#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"
#include "fontcore/stroke.h"

namespace fontcore {

namespace {

using Contours = std::vector<BezierContour>;
using Letters = WeightModel::Letters;
using Stroke = WeightModel::Stroke;
using Zone = WeightModel::Zone;

// Lengths below are in thousandths of the em.
constexpr double curve_step = 11.0;
constexpr double line_step = 22.0;
constexpr double fine_step = 5.0;     // of the outline that a control letter is compared with
constexpr double usual_stem = 100.0;  // of a shape without upright strokes
constexpr double thinnest = 5.0;      // of a stroke, for logarithms
constexpr double no_stroke = 1e4;     // thickness where nothing is met
constexpr double near_zone = 7.0;     // a height so near a zone is in it
constexpr double crowding = 0.15;     // bars lose this share of their growth as the room beside them goes to 0
// Powers of thickness by which strokes of one contrast grow where nothing says more: the thin parts of round ones are
// joins, which hardly do.
constexpr double power_straight = 1.0;
constexpr double power_round = 2.5;
constexpr double diagonal = 1.0;        // powers of the cosine of the direction by which thick strokes of a contrasted
constexpr double diagonal_round = 0.5;  // face grow less than stems: growth is alike along the line, not across

double squared(double x) { return x * x; }
double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

// ---- statistics

struct Weighed {
  double value = 0.0;
  double weight = 0.0;
};

// The value below which a share of the weight lies, between the middles of the entries.
double quantile(std::vector<Weighed> list, double share) {
  std::ranges::stable_sort(list, {}, &Weighed::value);
  double total = 0.0;
  for (const Weighed& entry : list) total += entry.weight;
  const double wanted = share * total;
  double sum = 0.0;
  double previous_at = 0.0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const double at = sum + 0.5 * list[i].weight;
    if (at >= wanted) {
      if (i == 0) return list[0].value;
      const double t = (wanted - previous_at) / std::max(at - previous_at, 1e-12);
      return list[i - 1].value + t * (list[i].value - list[i - 1].value);
    }
    previous_at = at;
    sum += list[i].weight;
  }
  return list.back().value;
}
double median(const std::vector<Weighed>& list) { return quantile(list, 0.5); }

// Where x lies among rising nodes, clamped: the node before it and the share of the way to the next.
template <std::size_t n>
std::pair<std::size_t, double> place_among(const std::array<double, n>& nodes, double x) {
  std::size_t i = 0;
  while (i + 2 < n && x >= nodes[i + 1]) ++i;
  return {i, std::clamp((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0)};
}

// Gaussian process on what a law leaves over, from cells of rows: each stands for `count` of them.
class Residual {
 public:
  struct Cell {
    Eigen::VectorXd x;   // over the length scales
    double value = 0.0;  // measured minus law
    double size = 1.0;   // by which amplitude goes here
    double count = 1.0;
  };
  Residual(std::vector<Cell> cells, double amplitude, double noise) : cells_(std::move(cells)), amplitude_(amplitude) {
    const auto n = static_cast<Eigen::Index>(cells_.size());
    Eigen::MatrixXd K(n, n);
    Eigen::VectorXd y(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Cell& a = cells_[static_cast<std::size_t>(i)];
      for (Eigen::Index j = 0; j < n; ++j) K(i, j) = covariance(a.x, a.size, cells_[static_cast<std::size_t>(j)]);
      K(i, i) += noise * noise / a.count;
      y[i] = a.value;
    }
    factored_.compute(K);
    solved_ = factored_.solve(y);
  }
  struct Estimate {
    double value = 0.0;
    double deviation = 0.0;
  };
  Estimate at(const Eigen::VectorXd& x, double size) const {
    Eigen::VectorXd k(static_cast<Eigen::Index>(cells_.size()));
    for (Eigen::Index i = 0; i < k.size(); ++i) k[i] = covariance(x, size, cells_[static_cast<std::size_t>(i)]);
    const double own = squared(amplitude_ * size);
    return {k.dot(solved_), std::sqrt(std::max(own - k.dot(factored_.solve(k)), 0.0))};
  }

 private:
  double covariance(const Eigen::VectorXd& x, double size, const Cell& cell) const {
    return squared(amplitude_) * size * cell.size * std::exp(-0.5 * (x - cell.x).squaredNorm());
  }

  std::vector<Cell> cells_;
  double amplitude_;
  Eigen::LDLT<Eigen::MatrixXd> factored_;
  Eigen::VectorXd solved_;
};

// ---- the law

// What the growth of a stroke depends on.
struct StrokePlace {
  double thickness = 0.0;
  double direction = 0.0;  // radians
  int letters = 0;
  bool is_round = false;
};

double contrast(const Letters& letters) { return 1.0 - letters.level.thickness / letters.upright.thickness; }
double share_of_contrast(const Letters& letters) { return std::clamp((contrast(letters) - 0.25) / 0.15, 0.0, 1.0); }

// Where a stroke stands between the thin strokes of its class (0) and the thick ones (1): straight ones are the one or
// the other, round ones go over.
double thickness_share(const Letters& letters, const StrokePlace& place) {
  const double z =
      (place.thickness - letters.level.thickness) / std::max(letters.upright.thickness - letters.level.thickness, 5.0);
  const double v = std::clamp((z - 0.25) / 0.5, 0.0, 1.0);
  return place.is_round ? std::clamp(z, -0.2, 1.1) : v * v * (3.0 - 2.0 * v) + std::clamp(z - 1.0, 0.0, 0.1);
}

// The growth of a stroke by the strokes of its class alone.
double law(const Letters& letters, const StrokePlace& place) {
  const Stroke& up = letters.upright;
  const Stroke& bar = letters.level;
  const double T = place.thickness;
  const double c2 = squared(std::cos(place.direction));
  // Strokes about as thick as each other: a power, its exponent from stems and bars as far as they differ.
  const double u = std::log(std::max(up.thickness, 2.0) / std::max(bar.thickness, 2.0));
  const double steps = std::log(std::max(up.growth, 2.0) / std::max(bar.growth, 2.0));
  const double usual_power = place.is_round ? power_round : power_straight;
  const double g = std::clamp((steps * u + 0.1 * usual_power) / (u * u + 0.1), 0.5, 4.0);
  const double usual = up.thickness * c2 + bar.thickness * (1.0 - c2);
  const double growth = up.growth * c2 + bar.growth * (1.0 - c2);
  const double relative = T / usual;
  const double even = std::min(growth * (relative < 1.0 ? std::pow(std::max(relative, 0.15), g)
                                                        : std::pow(std::min(relative, 4.0), std::min(g, 1.0))),
                               std::max(1.1 * std::max(up.growth, bar.growth), growth));
  // Thin and thick ones.
  const double thick = thickness_share(letters, place);
  const double across = std::pow(std::sqrt(c2), place.is_round ? diagonal_round : diagonal);
  const double contrasted = bar.growth + (up.growth * across - bar.growth) * thick;
  const double share = share_of_contrast(letters);
  return even * (1.0 - share) + contrasted * share;
}

double counter_law(const Letters& letters, double width) {
  return std::max(letters.counter_growth + letters.counter_slope * (width - letters.counter), -0.8 * width);
}

struct Growth {
  double value = 0.0;
  double deviation = 0.0;
};

Growth growth_at(const WeightModel& model, const StrokePlace& place) {
  const Letters& letters = model.letters[static_cast<std::size_t>(place.letters)];
  const auto [i, a] = place_among(WeightModel::directions, place.direction * 180.0 / std::numbers::pi);
  // Between thicknesses on a logarithmic scale.
  std::array<double, WeightModel::thicknesses.size()> nodes;
  for (std::size_t k = 0; k < nodes.size(); ++k) nodes[k] = std::log(WeightModel::thicknesses[k]);
  const auto [j, b] = place_among(nodes, std::log(place.thickness / letters.upright.thickness));
  const auto read = [&, i = i, a = a, j = j, b = b](const WeightModel::Table& table) {
    const auto& t = table[place.is_round ? 1 : 0];
    return (1.0 - a) * ((1.0 - b) * t[i][j] + b * t[i][j + 1]) + a * ((1.0 - b) * t[i + 1][j] + b * t[i + 1][j + 1]);
  };
  return {law(letters, place) + read(letters.correction), read(letters.deviation)};
}

double counter_growth_at(const WeightModel& model, int letters_index, double width, int round_sides) {
  const Letters& letters = model.letters[static_cast<std::size_t>(letters_index)];
  std::array<double, WeightModel::widths.size()> nodes;
  for (std::size_t k = 0; k < nodes.size(); ++k) nodes[k] = std::log(WeightModel::widths[k]);
  const auto [j, b] = place_among(nodes, std::log(std::max(width, 10.0)));
  const auto& t = letters.counter_correction[static_cast<std::size_t>(round_sides)];
  return counter_law(letters, width) + (1.0 - b) * t[j] + b * t[j + 1];
}

// ---- what a shape looks like from an edge

StrokePlace place_of(const StrokeEdge& edge, int letters) {
  return {std::max(edge.ink.exists() ? edge.thickness() : no_stroke, thinnest), edge.direction, letters, !edge.is_line};
}

// How far an edge is part of a stroke about as thick as a stem.
double stem_like(const StrokeEdge& edge, double stem) {
  const double facing = std::clamp((edge.facing - 0.5) / 0.3, 0.03, 1.0);
  if (!edge.ink.exists() || edge.facing <= 0.5) return 0.03 * facing;
  return facing / (1.0 + std::pow(edge.thickness() / (1.5 * stem), 8));
}

bool is_serif(const StrokeEdge& edge, double stem) {
  return std::abs(edge.normal.y()) > 0.7 && edge.ink.exists() && edge.thickness() < 0.62 * stem && edge.facing > 0.7 &&
         edge.run < 1.4 * stem;
}

// Room above or below the bar that an edge belongs to, on its tighter side.
double room_beside(const StrokeEdges& shape, const StrokeEdge& edge) {
  double room = edge.gap_y.distance;
  if (edge.ink.exists()) room = std::min(room, shape[edge.ink.edge].gap_y.distance);
  return room;
}

// The share of its growth that a bar keeps between others.
double crowded(const StrokeEdges& shape, const StrokeEdge& edge, double room) {
  if (room <= 0.0) return 1.0;
  const double tight = std::clamp(1.0 - room_beside(shape, edge) / room, 0.0, 0.8);
  return 1.0 - crowding * tight * squared(std::sin(edge.direction));
}

Contours in_thousandths(const Contours& contours, double units_per_em) {
  Affine map;
  map.linear *= 1000.0 / units_per_em;
  Contours result;
  for (const BezierContour& contour : contours) result.push_back(transform(contour, map));
  return result;
}

// ---- correspondence

struct Ring {
  Box box;
  Point centre = Point::Zero();
  double area = 0.0;
};

Ring ring_of(const StrokeEdges& shape, int contour) {
  Ring ring;
  const int count = shape.first(contour + 1) - shape.first(contour);
  for (int i = shape.first(contour); i < shape.first(contour + 1); ++i) {
    const Point& a = shape[i].start;
    const Point b = shape.end(i);
    ring.box.add(a);
    ring.centre += a / count;
    ring.area += 0.5 * (a.x() * b.y() - b.x() * a.y());
  }
  return ring;
}

Point within(const Box& box, const Point& p) {
  const Point size = (box.high - box.low).cwiseMax(1e-9);
  return (p - box.low).cwiseQuotient(size);
}

std::vector<Point> tangents_at_starts(const StrokeEdges& shape) {
  std::vector<Point> tangents;
  for (const StrokeEdge& edge : shape.edges()) {
    const StrokeEdge& before = shape[edge.previous];
    const Point own = edge.chord / std::max(edge.length, 1e-12);
    const Point sum = own + before.chord / std::max(before.length, 1e-12);
    tangents.push_back(sum.norm() > 0.2 ? Point(sum.normalized()) : own);
  }
  return tangents;
}

// The cheapest way through a matrix from its first entry to its last, by steps down, right or both.
std::vector<std::pair<int, int>> cheapest_way(const Eigen::MatrixXd& cost) {
  const auto n = static_cast<int>(cost.rows());
  const auto m = static_cast<int>(cost.cols());
  constexpr double far = std::numeric_limits<double>::infinity();
  Eigen::MatrixXd sum(n, m);
  const auto at = [&](int i, int j) { return i < 0 || j < 0 ? far : sum(i, j); };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      const double before = i == 0 && j == 0 ? 0.0 : std::min({at(i - 1, j - 1), at(i - 1, j), at(i, j - 1)});
      sum(i, j) = before + cost(i, j);
    }
  }
  std::vector<std::pair<int, int>> way{{n - 1, m - 1}};
  for (int i = n - 1, j = m - 1; i > 0 || j > 0;) {
    const double both = at(i - 1, j - 1);
    const double down = at(i - 1, j);
    const double right = at(i, j - 1);
    if (both <= down && both <= right) {
      --i;
      --j;
    } else if (down <= right) {
      --i;
    } else {
      --j;
    }
    way.emplace_back(i, j);
  }
  return way;
}

// The displacement of every edge's start towards another drawing of the shape; none if the contours do not pair up.
std::optional<std::vector<Point>> correspond(const StrokeEdges& from, const StrokeEdges& to) {
  if (from.contour_count() != to.contour_count() || from.size() == 0 || to.size() == 0) return std::nullopt;
  const int contours = from.contour_count();
  std::vector<Ring> rings;
  std::vector<Ring> others;
  std::vector<int> order;
  std::vector<bool> is_free(static_cast<std::size_t>(contours), true);
  for (int k = 0; k < contours; ++k) {
    if (from.first(k) == from.first(k + 1) || to.first(k) == to.first(k + 1)) return std::nullopt;
    rings.push_back(ring_of(from, k));
    others.push_back(ring_of(to, k));
    order.push_back(k);
  }
  std::ranges::stable_sort(order, std::greater{},
                           [&](int k) { return std::abs(rings[static_cast<std::size_t>(k)].area); });
  const std::vector<Point> from_tangents = tangents_at_starts(from);
  const std::vector<Point> to_tangents = tangents_at_starts(to);
  std::vector<Point> moves(static_cast<std::size_t>(from.size()), Point::Zero());
  for (const int k : order) {
    const Ring& ring = rings[static_cast<std::size_t>(k)];
    int partner = -1;
    double nearest = std::numeric_limits<double>::infinity();
    for (int q = 0; q < contours; ++q) {
      const Ring& other = others[static_cast<std::size_t>(q)];
      if (!is_free[static_cast<std::size_t>(q)] || other.area * ring.area <= 0.0) continue;
      const double distance = (within(from.box(), ring.centre) - within(to.box(), other.centre)).norm();
      if (distance < nearest) {
        nearest = distance;
        partner = q;
      }
    }
    if (partner < 0) return std::nullopt;
    is_free[static_cast<std::size_t>(partner)] = false;
    const Ring& other = others[static_cast<std::size_t>(partner)];
    const int a0 = from.first(k);
    const int b0 = to.first(partner);
    const int n = from.first(k + 1) - a0;
    const int m = to.first(partner + 1) - b0;
    const Point size = (ring.box.high - ring.box.low).cwiseMax(1e-9);
    Eigen::MatrixXd cost(n, m);
    int first = 0;
    double lowest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < n; ++i) {
      const Point p = within(ring.box, from[a0 + i].start);
      const double corner = p.sum() - (from[a0 + i].is_corner ? 0.2 : 0.0);
      if (corner < lowest) {
        lowest = corner;
        first = i;
      }
      for (int j = 0; j < m; ++j) {
        const Point apart = (p - within(other.box, to[b0 + j].start)).cwiseProduct(size);
        const double turned =
            1.0 - from_tangents[static_cast<std::size_t>(a0 + i)].dot(to_tangents[static_cast<std::size_t>(b0 + j)]);
        cost(i, j) = 6.0 * apart.squaredNorm() / (size.x() * size.y()) + 0.7 * turned +
                     (from[a0 + i].is_corner != to[b0 + j].is_corner ? 0.15 : 0.0);
      }
    }
    Eigen::Index second = 0;
    cost.row(first).minCoeff(&second);
    Eigen::MatrixXd turned(n + 1, m + 1);
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; j <= m; ++j) turned(i, j) = cost((first + i) % n, (static_cast<int>(second) + j) % m);
    }
    std::vector<std::vector<int>> met(static_cast<std::size_t>(n));
    for (const auto& [i, j] : cheapest_way(turned)) {
      met[static_cast<std::size_t>((first + i) % n)].push_back((static_cast<int>(second) + j) % m);
    }
    for (int i = 0; i < n; ++i) {
      std::vector<int>& list = met[static_cast<std::size_t>(i)];
      if (from[a0 + i].is_corner) {
        std::vector<int> corners;
        for (const int j : list) {
          if (to[b0 + j].is_corner) corners.push_back(j);
        }
        if (!corners.empty()) list = corners;
        list = {*std::ranges::min_element(list, {}, [&](int j) { return cost(i, j); })};
      }
      Point mean = Point::Zero();
      double total = 0.0;
      for (const int j : list) {
        const double weight = 1.0 / (cost(i, j) + 1e-3);
        mean += weight * to[b0 + j].start;
        total += weight;
      }
      moves[static_cast<std::size_t>(a0 + i)] = mean / total - from[a0 + i].start;
    }
  }
  return moves;
}

// Displacements of edges' starts, read in between.
class Moves {
 public:
  Moves(const StrokeEdges& shape, const std::vector<Point>& at_starts) : shape_(shape), at_starts_(at_starts) {}
  const Point& start(int edge) const { return at_starts_[static_cast<std::size_t>(edge)]; }
  const Point& end(int edge) const { return start(shape_[edge].next); }
  Point on(int edge, double at) const { return (1.0 - at) * start(edge) + at * end(edge); }
  Point middle(int edge) const { return on(edge, 0.5); }
  // By how much the stroke at an edge grows.
  double growth(int edge) const {
    const StrokeEdge& e = shape_[edge];
    return e.normal.dot(middle(edge) - on(e.ink.edge, e.ink.at));
  }

 private:
  const StrokeEdges& shape_;
  const std::vector<Point>& at_starts_;
};

// ---- learning

// What a control letter shows at a stroke or a counter.
struct StrokeRow {
  StrokePlace place;
  double growth = 0.0;
  double weight = 0.0;
  int lesson = 0;  // the letter it is from
};
struct CounterRow {
  double width = 0.0;
  double growth = 0.0;
  double weight = 0.0;
  double thickness = 0.0;  // of the strokes beside it, the mean
  double thickened = 0.0;  // by how much they grow
  int round_sides = 0;
};
struct HeightRow {
  double height = 0.0;
  double shift = 0.0;
  double weight = 0.0;
};

// A letter with all that is measured on it.
struct Lesson {
  const WeightPair* pair = nullptr;
  int letters = 0;
  StrokeEdges shape;
  StrokeEdges drawn;
  std::vector<Point> moves;  // of the edges' starts
  double stem = 0.0;
};

bool is_stroke(const StrokeEdge& edge) { return edge.ink.exists() && edge.facing > 0.75; }

// Heights that lie together, as one each; lone ones are dropped.
std::vector<Zone> gather_zones(std::vector<HeightRow> rows) {
  std::ranges::stable_sort(rows, {}, &HeightRow::height);
  std::vector<Zone> zones;
  for (std::size_t i = 0; i < rows.size();) {
    const double first = rows[i].height;
    double last = first;
    double height = 0.0;
    double shift = 0.0;
    double weight = 0.0;
    for (; i < rows.size() && rows[i].height - last <= 3.0 && rows[i].height - first <= 5.0; ++i) {
      last = rows[i].height;
      height += rows[i].weight * rows[i].height;
      shift += rows[i].weight * rows[i].shift;
      weight += rows[i].weight;
    }
    if (weight > 15.0) zones.push_back({height / weight, shift / weight});
  }
  return zones;
}

double rounded(double x, double step) { return std::round(x / step) * step; }

// The vertical and horizontal strokes of a class, by medians so that no odd letter moves them.
void find_strokes(Letters& letters, const std::vector<StrokeRow>& all, int index) {
  std::vector<StrokeRow> rows;
  for (const StrokeRow& row : all) {
    if (row.place.letters == index) rows.push_back(row);
  }
  if (rows.size() <= 20) rows = all;
  const auto chosen = [&](auto&& which) {
    std::vector<StrokeRow> list;
    for (const StrokeRow& row : rows) {
      if (which(row)) list.push_back(row);
    }
    return list;
  };
  const auto weight_of = [](const std::vector<StrokeRow>& list) {
    double sum = 0.0;
    for (const StrokeRow& row : list) sum += row.weight;
    return sum;
  };
  const auto stroke_of = [](const std::vector<StrokeRow>& list, double spread) {
    std::vector<Weighed> widths;
    for (const StrokeRow& row : list) widths.push_back({row.place.thickness, row.weight});
    const double usual = median(widths);
    std::vector<Weighed> growths;
    for (const StrokeRow& row : list) {
      if (std::abs(row.place.thickness / usual - 1.0) < spread) growths.push_back({row.growth, row.weight});
    }
    return Stroke{usual, median(growths)};
  };
  std::vector<StrokeRow> upright =
      chosen([](const StrokeRow& r) { return !r.place.is_round && r.place.direction < 0.25; });
  if (weight_of(upright) < 100.0) upright = chosen([](const StrokeRow& r) { return r.place.direction < 0.35; });
  if (upright.empty()) upright = rows;
  letters.upright = stroke_of(upright, 0.25);
  const double most = 1.15 * letters.upright.thickness;
  const auto level_from = [&](double least) {
    return chosen([&](const StrokeRow& r) { return r.place.direction > least && r.place.thickness < most; });
  };
  std::vector<StrokeRow> level = level_from(1.25);
  if (weight_of(level) < 40.0) level = level_from(1.0);
  letters.level = level.empty() ? letters.upright : stroke_of(level, 0.3);
}

Eigen::VectorXd stroke_point(const StrokePlace& place) {
  return Eigen::Vector4d(std::log(place.thickness) / 0.35, place.direction / 0.5, place.letters / 1.2,
                         (place.is_round ? 1.0 : 0.0) / 0.6);
}

// The tables of what the control letters say beyond the law.
void correct_strokes(WeightModel& model, const std::vector<StrokeRow>& rows) {
  constexpr double samples = 220.0;  // that all rows together count for
  struct Sum {
    double log_thickness = 0.0, direction = 0.0, growth = 0.0, weight = 0.0;
    std::map<int, double> of_lesson;  // weight
  };
  std::map<std::array<int, 4>, Sum> sums;
  double total = 0.0;
  double usual = 0.0;
  for (const StrokeRow& row : rows) {
    const double t = std::log(row.place.thickness);
    Sum& sum =
        sums[{static_cast<int>(std::lround(t / 0.1)), static_cast<int>(std::lround(row.place.direction / radians(7.5))),
              row.place.letters, row.place.is_round ? 1 : 0}];
    sum.log_thickness += row.weight * t;
    sum.direction += row.weight * row.place.direction;
    sum.growth += row.weight * row.growth;
    sum.weight += row.weight;
    sum.of_lesson[row.lesson] += row.weight;
    total += row.weight;
    usual += row.weight * std::abs(row.growth);
  }
  usual = std::max(usual / total, 1.0);
  // Where the law says that little grows, little is left over too.
  const auto size_at = [&](const StrokePlace& place) {
    const double grows = law(model.letters[static_cast<std::size_t>(place.letters)], place);
    return 0.3 + 0.7 * std::min(std::abs(grows) / usual, 1.5);
  };
  const double noise = 0.12 * usual + 2.0;
  const double by_letter = 0.05 * usual;  // letters differ by so much: many rows of one say no more than it does
  std::vector<Residual::Cell> cells;
  for (const auto& [key, sum] : sums) {
    if (sum.weight <= 0.0) continue;
    const StrokePlace place{std::exp(sum.log_thickness / sum.weight), sum.direction / sum.weight, key[2], key[3] == 1};
    const double left = sum.growth / sum.weight - law(model.letters[static_cast<std::size_t>(place.letters)], place);
    double same_letter = 0.0;  // chance that two rows are from one
    for (const auto& [lesson, weight] : sum.of_lesson) same_letter += squared(weight / sum.weight);
    const double variance = squared(noise) * total / (samples * sum.weight) + squared(by_letter) * same_letter;
    cells.push_back({stroke_point(place), left, size_at(place), squared(noise) / variance});
  }
  const Residual residual(std::move(cells), 0.5 * usual, noise);
  for (int c = 0; c < 2; ++c) {
    Letters& letters = model.letters[static_cast<std::size_t>(c)];
    for (std::size_t kind = 0; kind < 2; ++kind) {
      for (std::size_t i = 0; i < WeightModel::directions.size(); ++i) {
        for (std::size_t j = 0; j < WeightModel::thicknesses.size(); ++j) {
          const StrokePlace place{WeightModel::thicknesses[j] * letters.upright.thickness,
                                  radians(WeightModel::directions[i]), c, kind == 1};
          const double size = size_at(place);
          const auto [value, deviation] = residual.at(stroke_point(place), size);
          letters.correction[kind][i][j] = rounded(value, 0.1);
          letters.deviation[kind][i][j] = rounded(deviation / std::max(size, 0.3), 0.1);
        }
      }
    }
  }
}

Eigen::VectorXd counter_point(double width, int letters, int round_sides) {
  return Eigen::Vector3d(std::log(std::max(width, 10.0)) / 0.4, letters / 0.7, 0.5 * round_sides / 0.7);
}

void learn_counters(WeightModel& model, std::array<std::vector<CounterRow>, 2> rows) {
  constexpr double samples = 120.0;
  for (std::size_t c = 0; c < 2; ++c) {
    if (rows[c].empty()) continue;
    const double most = 1.5 * model.letters[c].upright.thickness;
    std::vector<CounterRow> between_stems;
    for (const CounterRow& row : rows[c]) {
      if (row.thickness < most) between_stems.push_back(row);
    }
    if (between_stems.size() > 5) rows[c] = std::move(between_stems);
  }
  struct Sum {
    double log_width = 0.0, growth = 0.0, weight = 0.0;
  };
  std::map<std::array<int, 3>, Sum> sums;
  double total = 0.0;
  for (std::size_t c = 0; c < 2; ++c) {
    Letters& letters = model.letters[c];
    const std::vector<CounterRow>& own = rows[c].empty() ? rows[1 - c] : rows[c];
    // Nothing seen: strokes grow into the counters.
    letters.counter = 300.0;
    letters.counter_growth = -letters.upright.growth;
    double weight = 0.0;
    double width = 0.0;
    double growth = 0.0;
    double spread = 0.0;
    double squares = 0.0;
    for (const CounterRow& row : own) {
      // As it would be if both strokes grew like stems.
      const double grown = row.growth + row.thickened - letters.upright.growth;
      const double centre_lines = row.width + row.thickness;
      weight += row.weight;
      width += row.weight * row.width;
      growth += row.weight * grown;
      spread += row.weight * centre_lines * (grown + letters.upright.growth);
      squares += row.weight * squared(centre_lines);
    }
    if (weight > 0.0) {
      letters.counter = width / weight;
      letters.counter_growth = growth / weight;
      letters.spread = spread / squares;
    }
    letters.counter_slope = 0.5 * letters.spread + 0.5 * letters.counter_growth / letters.counter;
    for (const CounterRow& row : rows[c]) {
      const double t = std::log(std::max(row.width, 10.0));
      Sum& sum = sums[{static_cast<int>(std::lround(t / 0.08)), static_cast<int>(c), row.round_sides}];
      sum.log_width += row.weight * t;
      sum.growth += row.weight * (row.growth + row.thickened - letters.upright.growth);
      sum.weight += row.weight;
      total += row.weight;
    }
  }
  std::vector<Residual::Cell> cells;
  for (const auto& [key, sum] : sums) {
    if (sum.weight <= 0.0) continue;
    const double width = std::exp(sum.log_width / sum.weight);
    const double left = sum.growth / sum.weight - counter_law(model.letters[static_cast<std::size_t>(key[1])], width);
    cells.push_back({counter_point(width, key[1], key[2]), left, 1.0, samples * sum.weight / total});
  }
  const Residual residual(std::move(cells), 10.0, 4.0);
  for (int c = 0; c < 2; ++c) {
    for (int round_sides = 0; round_sides < 3; ++round_sides) {
      for (std::size_t j = 0; j < WeightModel::widths.size(); ++j) {
        model.letters[static_cast<std::size_t>(c)].counter_correction[static_cast<std::size_t>(round_sides)][j] =
            rounded(residual.at(counter_point(WeightModel::widths[j], c, round_sides), 1.0).value, 0.1);
      }
    }
  }
}

std::vector<Lesson> lessons_of(WeightModel& model, std::span<const WeightPair> pairs, double units_per_em) {
  std::vector<Lesson> lessons;
  for (const WeightPair& pair : pairs) {
    StrokeEdges shape(in_thousandths(pair.from, units_per_em), curve_step, line_step);
    StrokeEdges drawn(in_thousandths(pair.to, units_per_em), fine_step, fine_step);
    std::optional<std::vector<Point>> moves = correspond(shape, drawn);
    model.controls.push_back({pair.name, 0.0, 0.0, moves.has_value()});
    if (!moves) continue;
    lessons.push_back({&pair, pair.letter_class == LetterClass::Capital ? 1 : 0, std::move(shape), std::move(drawn),
                       std::move(*moves), 0.0});
    lessons.back().stem = lessons.back().shape.stem(usual_stem);
  }
  return lessons;
}

double box_width(const StrokeEdges& shape) { return shape.box().high.x() - shape.box().low.x(); }

// Room beside bars, of every class: that of the letter with most of it, a bowl without bars.
void learn_room(WeightModel& model, const std::vector<Lesson>& lessons) {
  constexpr double open = 5000.0;  // no letter closes so high
  std::array<double, 2> most{};
  for (const Lesson& lesson : lessons) {
    std::vector<Weighed> rooms;
    for (const StrokeEdge& edge : lesson.shape.edges()) {
      if (!is_stroke(edge) || edge.direction < 1.1 || edge.thickness() > 1.5 * lesson.stem) continue;
      const double room = room_beside(lesson.shape, edge);
      if (room < open) rooms.push_back({room, edge.length});
    }
    double& own = most[static_cast<std::size_t>(lesson.letters)];
    if (!rooms.empty()) own = std::max(own, quantile(rooms, 0.75));
  }
  for (std::size_t c = 0; c < 2; ++c) model.letters[c].room = most[c] > 0.0 ? most[c] : most[1 - c];
}

std::vector<StrokeRow> stroke_rows(const WeightModel& model, const Lesson& lesson, int index) {
  const Moves moves(lesson.shape, lesson.moves);
  const double room = model.letters[static_cast<std::size_t>(lesson.letters)].room;
  std::vector<StrokeRow> rows;
  for (int i = 0; i < lesson.shape.size(); ++i) {
    const StrokeEdge& edge = lesson.shape[i];
    if (!is_stroke(edge) || edge.thickness() >= 1.5 * lesson.stem) continue;
    // What bars would grow by with room beside them is a guess, the less worth the tighter they stand.
    const double kept = crowded(lesson.shape, edge, room);
    const double room_left = 1.0 - (1.0 - kept) / crowding;
    rows.push_back(
        {place_of(edge, lesson.letters), moves.growth(i) / kept, edge.length * squared(squared(room_left)), index});
  }
  return rows;
}

std::vector<CounterRow> counter_rows(const Lesson& lesson) {
  const Moves moves(lesson.shape, lesson.moves);
  std::vector<CounterRow> rows;
  for (int i = 0; i < lesson.shape.size(); ++i) {
    const StrokeEdge& edge = lesson.shape[i];
    if (!edge.gap_x.exists() || std::abs(edge.normal.x()) <= 0.95) continue;
    const int j = edge.gap_x.edge;
    const StrokeEdge& other = lesson.shape[j];
    if (!edge.ink.exists() || !other.ink.exists()) continue;
    // Serifs and beaks are no stems.
    if (std::min(edge.thickness(), other.thickness()) < 0.6 * lesson.stem) continue;
    const double sign = edge.normal.x() < 0.0 ? -1.0 : 1.0;
    rows.push_back({edge.gap_x.distance, sign * (moves.on(j, edge.gap_x.at) - moves.middle(i)).x(),
                    edge.length * stem_like(edge, lesson.stem) * stem_like(other, lesson.stem),
                    0.5 * (edge.thickness() + other.thickness()), 0.5 * (moves.growth(i) + moves.growth(j)),
                    (edge.is_line ? 0 : 1) + (other.is_line ? 0 : 1)});
  }
  return rows;
}

// Flats, extrema and the end of the box at the top (sign 1) or bottom (-1) of a letter.
void add_heights(std::vector<HeightRow>& rows, const Lesson& lesson, double sign) {
  const StrokeEdges& shape = lesson.shape;
  const Moves moves(shape, lesson.moves);
  const auto end_of = [&](const Box& box) { return sign > 0.0 ? box.high.y() : box.low.y(); };
  const double end = end_of(shape.box());
  const double reach = 0.1 * (shape.box().high.y() - shape.box().low.y());
  for (int i = 0; i < shape.size(); ++i) {
    const StrokeEdge& edge = shape[i];
    if (sign * edge.normal.y() > 0.99 && edge.is_line && std::abs(edge.middle.y() - end) < reach) {
      rows.push_back({edge.middle.y(), moves.middle(i).y(), edge.length});
    }
    if (shape.is_extremum(i, sign) && std::abs(edge.start.y() - end) < reach) {
      rows.push_back({edge.start.y(), moves.start(i).y(), 40.0});
    }
  }
  rows.push_back({end, end_of(lesson.drawn.box()) - end, 60.0});
}

void learn_serifs(WeightModel& model, const std::vector<Lesson>& lessons) {
  std::array<double, 2> grown{};
  std::array<double, 2> length{};
  for (const Lesson& lesson : lessons) {
    const Moves moves(lesson.shape, lesson.moves);
    for (int i = 0; i < lesson.shape.size(); ++i) {
      const StrokeEdge& edge = lesson.shape[i];
      if (!is_serif(edge, lesson.stem)) continue;
      const auto c = static_cast<std::size_t>(lesson.letters);
      grown[c] += (moves.end(i) - moves.start(i)).dot(edge.chord) / edge.length;
      length[c] += edge.length;
    }
  }
  for (std::size_t c = 0; c < 2; ++c) model.letters[c].serif = grown[c] / std::max(length[c], 1.0);
}

void learn_sides(WeightModel& model, const std::vector<Lesson>& lessons, double units_per_em) {
  for (std::size_t c = 0; c < 2; ++c) {
    double left = 0.0;
    double right = 0.0;
    int count = 0;
    for (const bool own : {true, false}) {
      if (count > 0) break;
      for (const Lesson& lesson : lessons) {
        if (own && lesson.letters != static_cast<int>(c)) continue;
        const double scale = 1000.0 / units_per_em;
        left += lesson.drawn.box().low.x() - lesson.shape.box().low.x();
        right += scale * (lesson.pair->to_advance - lesson.pair->from_advance) -
                 (lesson.drawn.box().high.x() - lesson.shape.box().high.x());
        ++count;
      }
    }
    model.letters[c].left_side = left / count;
    model.letters[c].right_side = right / count;
  }
}

// ---- application

constexpr double counter_weight = 0.03;
constexpr double room_weight = 0.05;
constexpr double zone_weight = 20.0;
constexpr double smooth_weight = 40.0;
constexpr double gradient_weight = 1.2;
constexpr double place_weight = 0.006;
constexpr double serif_weight = 5.0;
constexpr double terminal_weight = 3.0;
constexpr double least_deviation = 8.0;  // of a law's growth: letters differ
constexpr double rigid_weight = 1e4;
constexpr double handle_weight = 0.02;
constexpr double beyond_allowed = 0.2;  // of an extremum beyond the ends of its segment
constexpr double longest_mitre = 6.0;   // of the offset: further a tip does not go
constexpr double lone_weight = 1e-9;

double shift_of(const std::vector<Zone>& zones, double y) {
  if (zones.empty()) return 0.0;
  const Zone& nearest = *std::ranges::min_element(zones, {}, [&](const Zone& z) { return std::abs(z.height - y); });
  if (std::abs(nearest.height - y) < near_zone || y <= zones.front().height || y >= zones.back().height) {
    return nearest.shift;
  }
  std::size_t i = 0;
  while (zones[i + 1].height < y) ++i;
  const double t = (y - zones[i].height) / (zones[i + 1].height - zones[i].height);
  return (1.0 - t) * zones[i].shift + t * zones[i + 1].shift;
}

bool is_near(const std::vector<Zone>& zones, double y) {
  return std::ranges::any_of(zones, [&](const Zone& z) { return std::abs(z.height - y) < near_zone; });
}

// Linear wishes on the displacements of all points of a glyph, in least squares under rows.
class Wishes {
 public:
  // A place of the outline: its displacement is a sum of those of points.
  struct Sum {
    std::array<int, 4> point{};
    std::array<double, 4> weight{};
    int count = 0;
  };
  // A term of a wish: what of a place's displacement counts.
  struct Part {
    Sum place;
    Point factor;
  };

  explicit Wishes(const Contours& contours) : contours_(contours) {
    for (const BezierContour& contour : contours) {
      first_.push_back(points_);
      points_ += static_cast<int>(contour.point_count());
    }
  }
  int share() const { return 2 * points_; }  // the variable beside the points'
  Sum at(int contour, int segment, double u) const {
    const BezierContour& c = contours_[static_cast<std::size_t>(contour)];
    Sum sum;
    const int degree = c.degree(segment);
    sum.weight = bernstein(degree, u);
    sum.count = degree + 1;
    for (int k = 0; k <= degree; ++k) {
      sum.point[static_cast<std::size_t>(k)] = first_[static_cast<std::size_t>(contour)] + c.point_of(segment, k);
    }
    return sum;
  }
  // The sum of the parts, and of `share_factor` times the share, is to be `value`.
  void add(std::initializer_list<Part> parts, double value, double weight, double share_factor = 0.0) {
    if (weight <= 0.0) return;
    const double w = std::sqrt(weight);
    for (const Part& part : parts) {
      for (int k = 0; k < part.place.count; ++k) {
        const auto i = static_cast<std::size_t>(k);
        for (int axis = 0; axis < 2; ++axis) {
          const double entry = w * part.factor[axis] * part.place.weight[i];
          if (entry != 0.0) entries_.emplace_back(rows_, 2 * part.place.point[i] + axis, entry);
        }
      }
    }
    if (share_factor != 0.0) entries_.emplace_back(rows_, share(), w * share_factor);
    values_.push_back(w * value);
    ++rows_;
  }
  // Both coordinates.
  void add(const Sum& to, const Sum& from, const Point& value, double weight) {
    add({{to, Point(1, 0)}, {from, Point(-1, 0)}}, value.x(), weight);
    add({{to, Point(0, 1)}, {from, Point(0, -1)}}, value.y(), weight);
  }

  // The displacement of every point of every contour that meets the wishes best under the rules and further rows.
  std::vector<Points> solve(const OutlineRules& rules, const std::vector<Rows>& further) const {
    RowElimination rows(2 * points_ + 1);
    for (std::size_t k = 0; k < contours_.size(); ++k) {
      for (const Rows& list : {outline_rows(contours_[k], rules), further[k]}) {
        for (Row row : list) {
          for (Row::Term& term : row.terms) term.variable += 2 * first_[k];
          rows.add(std::move(row));
        }
      }
    }
    const RowElimination::Space space = rows.space();
    Eigen::SparseMatrix<double> A(rows_, 2 * points_ + 1);
    A.setFromTriplets(entries_.begin(), entries_.end());
    const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(values_.data(), rows_) - A * space.c;
    const Eigen::SparseMatrix<double> S = A * space.T;
    const Eigen::SparseMatrix<double> K = S.transpose() * S;
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factored(K);
    const Eigen::VectorXd q = factored.solve(S.transpose() * b);
    if (factored.info() != Eigen::Success || !q.allFinite()) {
      throw UnsatisfiableConstraints(text("apply_weight: ", space.T.cols(), " unknowns, ", rows_, " wishes: singular"));
    }
    const Eigen::VectorXd d = space.T * q + space.c;
    std::vector<Points> moves;
    for (std::size_t k = 0; k < contours_.size(); ++k) {
      Points points(contours_[k].point_count(), 2);
      for (Eigen::Index p = 0; p < points.rows(); ++p) points.row(p) = d.segment<2>(2 * (first_[k] + p)).transpose();
      moves.push_back(std::move(points));
    }
    return moves;
  }

 private:
  const Contours& contours_;
  std::vector<int> first_;
  int points_ = 0;
  int rows_ = 0;
  std::vector<Eigen::Triplet<double>> entries_;
  std::vector<double> values_;
};

// What is done about a segment in a loop: its length along itself is held at half, then whole, then it only moves.
enum class Fold : std::uint8_t { Free, Halved, Whole, Rigid };
using Folds = std::vector<std::vector<Fold>>;  // by contour and segment

// A shape, and what the model says of each of its edges.
class Application {
 public:
  Application(const Contours& contours, int letters, const WeightModel& model, double widening)
      : contours_(contours),
        shape_(contours, curve_step, line_step),
        model_(model),
        index_(letters),
        letters_(model.letters[static_cast<std::size_t>(letters)]),
        stem_(letters_.upright.thickness),
        stretch_(widening * letters_.upright.growth / std::max(box_width(shape_), 1.0)) {
    for (const StrokeEdge& edge : shape_.edges()) {
      Growth growth = growth_at(model, place_of(edge, letters));
      growth.value *= crowded(shape_, edge, letters_.room);
      growth_.push_back(growth);
    }
  }

  const StrokeEdges& shape() const { return shape_; }
  // Displacement of every point, linear in the amounts.
  std::vector<Points> moves(const WeightAmounts& amounts, const Folds& folds, const OutlineRules& rules,
                            const std::vector<Rows>& held) const {
    Wishes wishes(contours_);
    std::vector<Wishes::Sum> starts;
    std::vector<Wishes::Sum> middles;
    for (const StrokeEdge& edge : shape_.edges()) {
      starts.push_back(wishes.at(edge.contour, edge.segment, edge.u0));
      middles.push_back(wishes.at(edge.contour, edge.segment, 0.5 * (edge.u0 + edge.u1)));
    }
    ask_strokes(wishes, amounts, middles);
    ask_counters(wishes, amounts, middles);
    ask_zones(wishes, amounts, starts, middles);
    ask_offset(wishes, amounts, starts, folds);
    ask_folds(wishes, amounts, folds);
    ask_handles(wishes);
    return wishes.solve(rules, held);
  }

 private:
  const Growth& growth(int edge) const { return growth_[static_cast<std::size_t>(edge)]; }
  // The amount that an edge takes as part of a stroke of a thickness.
  double taken(const WeightAmounts& amounts, const StrokeEdge& edge, double thickness) const {
    const double by_direction = amounts.y + (amounts.x - amounts.y) * squared(std::cos(edge.direction));
    double amount = by_direction;
    if (amounts.thin) {
      const StrokePlace place{thickness, edge.direction, index_, !edge.is_line};
      const double thin = 1.0 - std::clamp(thickness_share(letters_, place), 0.0, 1.0);
      amount += share_of_contrast(letters_) * thin * (*amounts.thin - by_direction);
    }
    const bool faces_serif = edge.ink.exists() && edge.facing > 0.7 && is_serif(shape_[edge.ink.edge], stem_);
    if (amounts.serif && (faces_serif || is_serif(edge, stem_))) amount = *amounts.serif;
    return amount;
  }
  double taken(const WeightAmounts& amounts, const StrokeEdge& edge) const {
    return taken(amounts, edge, place_of(edge, index_).thickness);
  }
  Wishes::Sum on(const Wishes& wishes, const EdgeHit& hit) const {
    const StrokeEdge& edge = shape_[hit.edge];
    return wishes.at(edge.contour, edge.segment, edge.u0 + std::clamp(hit.at, 0.0, 1.0) * (edge.u1 - edge.u0));
  }

  // Every stroke grows as the law says, the surer the heavier.
  void ask_strokes(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& middles) const {
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      if (!edge.ink.exists() || edge.facing <= 0.5) continue;
      const double weight = 0.1 * edge.length * std::clamp((edge.facing - 0.5) / 0.35, 0.0, 1.0) * 16.0 /
                            (16.0 + squared(std::max(growth(i).deviation, least_deviation))) /
                            (1.0 + std::pow(edge.thickness() / (1.6 * stem_), 10));
      wishes.add({{middles[static_cast<std::size_t>(i)], edge.normal}, {on(wishes, edge.ink), -edge.normal}},
                 taken(amounts, edge) * growth(i).value, weight);
    }
  }

  // Counters between upright strokes grow as the control letters' do; those above each other alike.
  void ask_counters(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& middles) const {
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Wishes::Sum& own = middles[static_cast<std::size_t>(i)];
      if (edge.gap_x.exists()) {
        const int j = edge.gap_x.edge;
        const StrokeEdge& other = shape_[j];
        const double width = edge.gap_x.distance;
        const double law = counter_growth_at(model_, index_, width, (edge.is_line ? 0 : 1) + (other.is_line ? 0 : 1));
        const double grown = std::max(
            law - 0.5 * (growth(i).value + growth(j).value) + letters_.upright.growth + stretch_ * width, -0.8 * width);
        // Strokes that take another amount than widths leave or take the difference.
        const double rest = 0.5 * (growth(i).value * (amounts.x - taken(amounts, edge)) +
                                   growth(j).value * (amounts.x - taken(amounts, other)));
        const double facing = std::pow(std::abs(edge.normal.x() * other.normal.x()), 16);
        const double sign = edge.normal.x() < 0.0 ? -1.0 : 1.0;
        wishes.add({{on(wishes, edge.gap_x), Point(sign, 0)}, {own, Point(-sign, 0)}}, amounts.x * grown + rest,
                   counter_weight * 0.1 * edge.length * facing * stem_like(edge, stem_) * stem_like(other, stem_));
      }
      if (edge.gap_y.exists()) {
        const double sign = edge.normal.y() < 0.0 ? -1.0 : 1.0;
        wishes.add({{on(wishes, edge.gap_y), Point(0, sign)}, {own, Point(0, -sign)}}, 0.0,
                   room_weight * 0.1 * edge.length * std::abs(edge.normal.y()), -edge.gap_y.distance);
      }
    }
    wishes.add({}, 0.0, 1.0, 1.0);
  }

  void ask_zones(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& starts,
                 const std::vector<Wishes::Sum>& middles) const {
    for (const double sign : {1.0, -1.0}) {
      const std::vector<Zone>& zones = sign > 0.0 ? model_.top : model_.bottom;
      const double end = sign > 0.0 ? shape_.box().high.y() : shape_.box().low.y();
      for (int i = 0; i < shape_.size(); ++i) {
        const StrokeEdge& edge = shape_[i];
        const double y = edge.middle.y();
        if (sign * edge.normal.y() > 0.99 && edge.is_line && (is_near(zones, y) || std::abs(y - end) < 2.0)) {
          wishes.add({{middles[static_cast<std::size_t>(i)], Point(0, 1)}}, amounts.y * shift_of(zones, y),
                     zone_weight * std::max(0.1 * edge.length, 0.5));
        }
        const double y0 = edge.start.y();
        const bool is_top = shape_.is_extremum(i, sign) && (is_near(zones, y0) || std::abs(y0 - end) < 2.0);
        if (is_top || std::abs(y0 - end) < 0.5) {
          wishes.add({{starts[static_cast<std::size_t>(i)], Point(0, 1)}}, amounts.y * shift_of(zones, y0),
                     zone_weight);
        }
      }
    }
  }

  // Where nothing else is said, edges go out by half the growth, corners mitred, the whole spread in x and between the
  // zones in y.
  std::vector<Point> offsets(const WeightAmounts& amounts) const {
    std::vector<double> half;
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      // The ends of strokes go out as far as the side of one across them would.
      StrokePlace place = place_of(edge, index_);
      const double c2 = squared(std::cos(edge.direction));
      place.thickness = letters_.upright.thickness * c2 + letters_.level.thickness * (1.0 - c2);
      half.push_back(is_sure(edge) ? taken(amounts, edge) * 0.5 * growth(i).value
                                   : taken(amounts, edge, place.thickness) * 0.5 * growth_at(model_, place).value);
    }
    std::vector<Point> offset;
    int highest = 0;
    int lowest = 0;
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Point& n = edge.normal;
      const Point& before = shape_[edge.previous].normal;
      const double h = half[static_cast<std::size_t>(i)];
      const double h0 = half[static_cast<std::size_t>(edge.previous)];
      const double turn = before.x() * n.y() - before.y() * n.x();
      const Point sum = n + before;
      if (edge.is_corner && std::abs(turn) > 0.3) {
        offset.push_back(Point(h0 * n.y() - h * before.y(), before.x() * h - n.x() * h0) / turn);
      } else if (edge.is_corner && n.dot(before) < 0.0 && sum.norm() > 0.0) {
        // The tip of a spike or a notch: along the middle, no farther than a sharp corner's mitre goes.
        const double reach = std::min(2.0 / sum.norm(), longest_mitre);
        offset.push_back(0.5 * (h + h0) * reach * sum.normalized());
      } else {
        offset.push_back(0.5 * (h * n + h0 * before));
      }
      if (edge.start.y() > shape_[highest].start.y()) highest = i;
      if (edge.start.y() < shape_[lowest].start.y()) lowest = i;
    }
    const double low = shape_.box().low.y();
    const double high = shape_.box().high.y();
    const double top = amounts.y * shift_of(model_.top, high) - offset[static_cast<std::size_t>(highest)].y();
    const double bottom = amounts.y * shift_of(model_.bottom, low) - offset[static_cast<std::size_t>(lowest)].y();
    for (int i = 0; i < shape_.size(); ++i) {
      const Point& p = shape_[i].start;
      const double t = high > low ? (p.y() - low) / (high - low) : 0.5;
      offset[static_cast<std::size_t>(i)] +=
          Point(amounts.x * ((letters_.spread + stretch_) * p.x()), bottom + (top - bottom) * t);
    }
    return offset;
  }
  static bool is_sure(const StrokeEdge& edge) {
    return edge.ink.exists() && edge.thickness() < 200.0 && edge.facing > 0.6;
  }

  void ask_offset(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& starts,
                  const Folds& folds) const {
    const std::vector<Point> offset = offsets(amounts);
    const double along_serifs = amounts.serif.value_or(amounts.x);
    const double share = share_of_contrast(letters_);
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Wishes::Sum& own = starts[static_cast<std::size_t>(i)];
      const Wishes::Sum& next = starts[static_cast<std::size_t>(edge.next)];
      const double length = 0.1 * edge.length;
      const double slope = 1.0 / std::max(length, 0.2);
      const Point& d = offset[static_cast<std::size_t>(i)];
      if (folds[static_cast<std::size_t>(edge.contour)][static_cast<std::size_t>(edge.segment)] == Fold::Rigid) {
        wishes.add(next, own, Point::Zero(), rigid_weight);
        continue;
      }
      double weight = gradient_weight * slope;
      if (share > 0.0 && is_serif(edge, stem_)) {
        weight *= 1.0 - 0.95 * share;
        wishes.add({{next, Point(1, 0)}, {own, Point(-1, 0)}}, along_serifs * letters_.serif * edge.chord.x(),
                   share * serif_weight * slope);
      }
      wishes.add(next, own, offset[static_cast<std::size_t>(edge.next)] - d, weight);
      wishes.add({{own, Point(1, 0)}}, d.x(), place_weight * length + 1e-6);
      wishes.add({{own, Point(0, 1)}}, d.y(), place_weight * length + 1e-6);
      // Curves bend evenly.
      const StrokeEdge& before = shape_[edge.previous];
      if (!edge.is_corner && !(edge.is_line && before.is_line)) {
        const Wishes::Sum& last = starts[static_cast<std::size_t>(edge.previous)];
        const double both = before.length + edge.length;
        const double a = 2.0 * edge.length / both;
        const double b = 2.0 * before.length / both;
        for (const Point& axis : {Point(1, 0), Point(0, 1)}) {
          wishes.add({{last, a * axis}, {own, -2.0 * axis}, {next, b * axis}}, 0.0, smooth_weight);
        }
      }
      // The ends of strokes keep their direction.
      const bool ends_stroke =
          edge.is_line && edge.run < 1.6 * stem_ && !(edge.ink.exists() && edge.thickness() < 1.3 * stem_);
      if (ends_stroke) wishes.add({{next, edge.normal}, {own, -edge.normal}}, 0.0, terminal_weight * slope);
    }
  }

  // Segments that folded over keep half of their length, so that they do not up to twice the step; or more. They take
  // the level strokes' amount, so that the moves are linear in the amounts.
  void ask_folds(Wishes& wishes, const WeightAmounts& amounts, const Folds& folds) const {
    for (std::size_t c = 0; c < contours_.size(); ++c) {
      for (int s = 0; s < contours_[c].segment_count(); ++s) {
        const Fold fold = folds[c][static_cast<std::size_t>(s)];
        if (fold == Fold::Free || fold == Fold::Rigid) continue;
        const Bezier bezier = contours_[c].segment(s);
        const Point chord = bezier.end() - bezier.start();
        const double length = chord.norm();
        if (length == 0.0) continue;
        const int index = static_cast<int>(c);
        wishes.add({{wishes.at(index, s, 1.0), chord / length}, {wishes.at(index, s, 0.0), -chord / length}},
                   fold == Fold::Halved ? amounts.y * -0.5 * length : 0.0, rigid_weight);
      }
    }
  }

  // Handles go along with their curve where its places do not say how.
  void ask_handles(Wishes& wishes) const {
    for (std::size_t c = 0; c < contours_.size(); ++c) {
      const BezierContour& contour = contours_[c];
      for (int s = 0; s < contour.segment_count(); ++s) {
        const int degree = contour.degree(s);
        for (int k = 1; k < degree; ++k) {
          Wishes::Sum sum = wishes.at(static_cast<int>(c), s, 0.0);
          const double t = static_cast<double>(k) / degree;
          sum.weight = {t - 1.0, 0.0, 0.0, 0.0};
          sum.weight[static_cast<std::size_t>(degree)] = -t;
          sum.weight[static_cast<std::size_t>(k)] = 1.0;
          wishes.add({{sum, Point(1, 0)}}, 0.0, handle_weight);
          wishes.add({{sum, Point(0, 1)}}, 0.0, handle_weight);
        }
        // A point alone has nothing else to hold it.
        const Wishes::Sum node = wishes.at(static_cast<int>(c), s, 0.0);
        wishes.add({{node, Point(1, 0)}}, 0.0, lone_weight);
        wishes.add({{node, Point(0, 1)}}, 0.0, lone_weight);
      }
    }
  }

  const Contours& contours_;
  StrokeEdges shape_;
  const WeightModel& model_;
  int index_;
  const Letters& letters_;
  double stem_;
  double stretch_;
  std::vector<Growth> growth_;
};

Contours moved(const Contours& contours, const std::vector<Points>& moves, double factor) {
  Contours result;
  for (std::size_t k = 0; k < contours.size(); ++k) {
    result.push_back(contours[k].with_points(contours[k].points() + factor * moves[k]));
  }
  return result;
}

// Halves the segments that turned back; false if none is new.
bool open_folds(const BezierContour& before, const BezierContour& after, std::vector<Fold>& folds) {
  bool is_new = false;
  for (int s = 0; s < before.segment_count(); ++s) {
    Fold& fold = folds[static_cast<std::size_t>(s)];
    const Bezier was = before.segment(s);
    const Bezier is = after.segment(s);
    if (fold != Fold::Free || (was.end() - was.start()).dot(is.end() - is.start()) >= 0.0) continue;
    fold = Fold::Halved;
    is_new = true;
  }
  return is_new;
}

// Deals with the loop between two places of a contour, the shorter way round; false if nothing is left to do.
bool open_loop(const BezierContour& before, const BezierContour& after, const Crossing& crossing,
               std::vector<Fold>& folds) {
  const int n = before.segment_count();
  const int ahead = (crossing.b.segment - crossing.a.segment + n) % n;
  const int from = ahead <= n - ahead ? crossing.a.segment : crossing.b.segment;
  const int count = std::min(ahead, n - ahead);
  // What lies wholly between the two places; of neighbours, and of a loop within a segment, themselves.
  const int first = count > 1 ? 1 : 0;
  const int last = count > 1 ? count - 1 : count;
  bool is_halved = false;
  for (int k = first; k <= last; ++k) {
    const int s = (from + k) % n;
    Fold& fold = folds[static_cast<std::size_t>(s)];
    const Bezier was = before.segment(s);
    const Bezier is = after.segment(s);
    const Point chord = was.end() - was.start();
    if (fold != Fold::Free || chord.dot(is.end() - is.start()) > 0.5 * chord.squaredNorm()) continue;
    fold = Fold::Halved;
    is_halved = true;
  }
  if (is_halved) return true;
  // The shortest first: long sides are to turn with their strokes.
  int shortest = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int k = first; k <= last; ++k) {
    const int s = (from + k) % n;
    const double size = length(before.segment(s));
    if (folds[static_cast<std::size_t>(s)] == Fold::Rigid || size >= least) continue;
    least = size;
    shortest = s;
  }
  if (shortest < 0) return false;
  Fold& fold = folds[static_cast<std::size_t>(shortest)];
  fold = fold < Fold::Whole ? Fold::Whole : Fold::Rigid;
  return true;
}

// How far a segment goes beyond its ends along an axis.
double beyond_ends(const Bezier& bezier, int axis) {
  const double low = std::min(bezier.start()[axis], bezier.end()[axis]);
  const double high = std::max(bezier.start()[axis], bezier.end()[axis]);
  double most = 0.0;
  for (const double u : extrema(bezier, axis)) {
    const double at = evaluate(bezier, u)[axis];
    most = std::max({most, low - at, at - high});
  }
  return most;
}

// Holds the handles of a segment at their shares of the way between its ends, along an axis.
void hold_handles(const BezierContour& contour, int segment, int axis, Rows& rows) {
  const Bezier bezier = contour.segment(segment);
  const double way = bezier.end()[axis] - bezier.start()[axis];
  const int first = contour.point_of(segment, 0);
  const int last = contour.point_of(segment, bezier.degree);
  for (int k = 1; k < bezier.degree; ++k) {
    const double share =
        way == 0.0 ? 0.5
                   : std::clamp((bezier.p[static_cast<std::size_t>(k)][axis] - bezier.start()[axis]) / way, 0.0, 1.0);
    Row row{RowName::of("handles of segment ", segment, " stay between its ends"), {}, 0.0};
    row.terms.push_back({2 * contour.point_of(segment, k) + axis, 1.0});
    row.terms.push_back({2 * first + axis, share - 1.0});
    row.terms.push_back({2 * last + axis, -share});
    rows.push_back(std::move(row));
  }
}

// Holds what came to reach beyond its ends, where extrema were nodes; false if nothing is new.
class HeldHandles {
 public:
  explicit HeldHandles(const Contours& contours) : rows_(contours.size()), is_held_(contours.size()) {
    for (std::size_t c = 0; c < contours.size(); ++c) {
      is_held_[c].resize(2 * static_cast<std::size_t>(contours[c].segment_count()), false);
    }
  }
  const std::vector<Rows>& rows() const { return rows_; }
  bool hold(const Contours& before, const Contours& after, double allowed) {
    bool is_new = false;
    for (std::size_t c = 0; c < before.size(); ++c) {
      for (int s = 0; s < before[c].segment_count(); ++s) {
        for (int axis = 0; axis < 2; ++axis) {
          const auto k = 2 * static_cast<std::size_t>(s) + static_cast<std::size_t>(axis);
          if (is_held_[c][k]) continue;
          const double beyond = beyond_ends(after[c].segment(s), axis);
          if (beyond <= allowed || beyond_ends(before[c].segment(s), axis) > allowed) continue;
          is_held_[c][k] = true;
          hold_handles(before[c], s, axis, rows_[c]);
          is_new = true;
        }
      }
    }
    return is_new;
  }

 private:
  std::vector<Rows> rows_;
  std::vector<std::vector<bool>> is_held_;  // by 2 * segment + axis
};

}  // namespace

WeightModel learn_weight(std::span<const WeightPair> pairs, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("learn_weight: units_per_em is ", units_per_em));
  WeightModel model;
  const std::vector<Lesson> lessons = lessons_of(model, pairs, units_per_em);
  if (lessons.empty()) {
    throw InvalidInput(text("learn_weight: of ", pairs.size(), " control letters none has contours that pair up"));
  }
  learn_room(model, lessons);
  std::vector<StrokeRow> strokes;
  std::vector<HeightRow> tops;
  std::vector<HeightRow> bottoms;
  std::array<std::vector<CounterRow>, 2> counters;
  for (const Lesson& lesson : lessons) {
    const std::vector<StrokeRow> rows = stroke_rows(model, lesson, static_cast<int>(&lesson - lessons.data()));
    strokes.insert(strokes.end(), rows.begin(), rows.end());
    const std::vector<CounterRow> between = counter_rows(lesson);
    std::vector<CounterRow>& own = counters[static_cast<std::size_t>(lesson.letters)];
    own.insert(own.end(), between.begin(), between.end());
    add_heights(tops, lesson, 1.0);
    add_heights(bottoms, lesson, -1.0);
  }
  if (strokes.empty()) throw InvalidInput("learn_weight: the control letters have no strokes");
  for (int c = 0; c < 2; ++c) find_strokes(model.letters[static_cast<std::size_t>(c)], strokes, c);
  correct_strokes(model, strokes);
  learn_counters(model, std::move(counters));
  learn_serifs(model, lessons);
  learn_sides(model, lessons, units_per_em);
  model.top = gather_zones(std::move(tops));
  model.bottom = gather_zones(std::move(bottoms));

  std::size_t next = 0;
  for (WeightModel::Control& control : model.controls) {
    if (!control.used) continue;
    const Lesson& lesson = lessons[next++];
    const Moves drawn(lesson.shape, lesson.moves);
    double sum = 0.0;
    double weight = 0.0;
    for (int i = 0; i < lesson.shape.size(); ++i) {
      const StrokeEdge& edge = lesson.shape[i];
      if (!is_stroke(edge) || edge.thickness() >= 1.5 * lesson.stem) continue;
      const double room = model.letters[static_cast<std::size_t>(lesson.letters)].room;
      const double made = growth_at(model, place_of(edge, lesson.letters)).value * crowded(lesson.shape, edge, room);
      sum += edge.length * squared(made - drawn.growth(i));
      weight += edge.length;
    }
    control.thickness_error = weight > 0.0 ? std::sqrt(sum / weight) : 0.0;
    const Weighted made = apply_weight(lesson.pair->from, lesson.pair->letter_class, model, units_per_em);
    const StrokeEdges shape(in_thousandths(made.contours, units_per_em), curve_step, line_step);
    control.width_error = box_width(shape) - box_width(lesson.drawn);
  }
  return model;
}

Weighted apply_weight(const std::vector<BezierContour>& contours, LetterClass letter_class, const WeightModel& model,
                      double units_per_em, const WeightOptions& options) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("apply_weight: units_per_em is ", units_per_em));
  const WeightAmounts& amounts = options.amounts;
  double least = std::numeric_limits<double>::infinity();
  double most = -least;
  for (const double of_kind :
       {amounts.x, amounts.y, amounts.thin.value_or(amounts.x), amounts.serif.value_or(amounts.x)}) {
    const double amount = options.amount * of_kind;
    if (!(amount >= -1.0 && amount <= 2.0)) {
      throw InvalidInput(text("apply_weight: the amount ", amount, " is not between -1 and 2"));
    }
    least = std::min(least, amount);
    most = std::max(most, amount);
  }
  const int letters = letter_class == LetterClass::Capital ? 1 : 0;
  const double unit = units_per_em / 1000.0;
  Weighted result{contours, 0.0, 0, 0.0, 0.0};
  const Contours own = in_thousandths(contours, units_per_em);
  const Application application(own, letters, model, options.widening);
  if ((least == 0.0 && most == 0.0) || application.shape().size() == 0) return result;

  OutlineRules rules;
  rules.frame.italic_angle = options.italic_angle;
  const std::vector<Crossing> crossings = find_crossings(contours);
  const Ink ink = measure_ink(contours, crossings);
  Folds folds;
  for (const BezierContour& contour : contours) folds.emplace_back(contour.segment_count(), Fold::Free);
  HeldHandles held(own);
  std::vector<Points> moves;
  for (bool again = true; again;) {
    moves = application.moves({}, folds, rules, held.rows());
    again = held.hold(own, moved(own, moves, 1.0), beyond_allowed);
    for (Points& points : moves) points *= unit;
    const Contours bold = moved(contours, moves, 1.0);
    for (std::size_t c = 0; c < contours.size(); ++c) again = open_folds(contours[c], bold[c], folds[c]) || again;
    if (again) continue;
    std::vector<Crossing> after = find_crossings(bold);
    if (added_crossings(crossings, after) == 0) break;
    for (const Crossing& crossing : after) {
      if (crossing.a.contour != crossing.b.contour) continue;
      const auto c = static_cast<std::size_t>(crossing.a.contour);
      again = open_loop(contours[c], bold[c], crossing, folds[c]) || again;
    }
  }

  // The whole step by the level strokes' amount, and what others take beyond it.
  double whole = options.amount * amounts.y;
  if (amounts.x != amounts.y || amounts.thin || amounts.serif) {
    const auto beyond = [&](const std::optional<double>& amount) {
      return amount ? std::optional(*amount - amounts.y) : std::nullopt;
    };
    const std::vector<Points> rest = application.moves(
        {amounts.x - amounts.y, 0.0, beyond(amounts.thin), beyond(amounts.serif)}, folds, rules, held.rows());
    for (std::size_t c = 0; c < moves.size(); ++c) {
      moves[c] = options.amount * (amounts.y * moves[c] + unit * rest[c]);
    }
    whole = 1.0;
  }
  const auto is_good = [&](const Contours& weighted) {
    const std::vector<Crossing> after = find_crossings(weighted);
    if (added_crossings(crossings, after) > 0) return false;
    const Ink now = measure_ink(weighted, after);
    return closed_counters(ink, now).empty() && (least < 0.0 || now.area >= ink.area) &&
           (most > 0.0 || now.area <= ink.area);
  };
  double amount = options.amount;
  Contours weighted = moved(contours, moves, whole);
  if (!is_good(weighted)) {
    // The largest share that is good, by halving; the last one tried that was.
    double low = 0.0;
    double high = 1.0;
    weighted = contours;
    for (int k = 0; k < 10; ++k) {
      const double share = 0.5 * (low + high);
      Contours trial = moved(contours, moves, share * whole);
      if (is_good(trial)) {
        low = share;
        weighted = std::move(trial);
      } else {
        high = share;
      }
    }
    amount = low * options.amount;
  }
  result.contours = std::move(weighted);
  result.amount = amount;
  for (const std::vector<Fold>& list : folds) {
    result.held_segments +=
        static_cast<int>(list.size() - static_cast<std::size_t>(std::ranges::count(list, Fold::Free)));
  }
  const Letters& own_letters = model.letters[static_cast<std::size_t>(letters)];
  result.left_side = amount * amounts.x * unit * own_letters.left_side;
  result.right_side = amount * amounts.x * unit * own_letters.right_side;
  return result;
}

StemWidths measure_stems(std::span<const Contours> letters, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("measure_stems: units_per_em is ", units_per_em));
  std::vector<Weighed> upright;
  std::vector<Weighed> level;
  for (const Contours& letter : letters) {
    const StrokeEdges shape(in_thousandths(letter, units_per_em), curve_step, line_step);
    const double most = 1.5 * shape.stem(usual_stem);
    for (const StrokeEdge& edge : shape.edges()) {
      if (!is_stroke(edge) || edge.thickness() >= most) continue;
      // Straight strokes say what stems are; round ones count where there are few.
      const double weight = edge.length * (edge.is_line ? 1.0 : 0.1);
      if (edge.direction < 0.25) upright.push_back({edge.thickness(), weight});
      if (edge.direction > 1.25) level.push_back({edge.thickness(), edge.length});
    }
  }
  const auto width = [&](const std::vector<Weighed>& list) {
    return list.empty() ? std::nullopt : std::optional(median(list) * units_per_em / 1000.0);
  };
  return {width(upright), width(level)};
}

WeightAmounts amounts_for_stems(std::span<const Contours> letters, LetterClass letter_class, const WeightModel& model,
                                double units_per_em, const StemWidths& wished) {
  if (!wished.upright && !wished.level) throw InvalidInput("amounts_for_stems: no width is wished for");
  const StemWidths now = measure_stems(letters, units_per_em);
  const auto made_at = [&](const WeightAmounts& amounts) {
    std::vector<Contours> made;
    for (const Contours& letter : letters) {
      made.push_back(apply_weight(letter, letter_class, model, units_per_em, {.amounts = amounts}).contours);
    }
    return measure_stems(made, units_per_em);
  };
  const StemWidths whole = made_at({});
  // Widths grow evenly with their amounts: the whole step says how fast; a second look takes what medians leave.
  const auto amount_of = [&](const char* kind, const std::optional<double>& wish, const std::optional<double>& from,
                             const std::optional<double>& to, double start, double at) {
    if (!from || !to || *from == *to) {
      throw InvalidInput(text("amounts_for_stems: the model does not change ", kind, " strokes of these letters"));
    }
    const double amount = at + (*wish - start) / (*to - *from);
    if (!(amount >= -1.0 && amount <= 2.0)) {
      throw InvalidInput(text("amounts_for_stems: ", kind, " strokes of ", *wish, " from ", *from,
                              " ask for the amount ", amount, ", which is not between -1 and 2"));
    }
    return amount;
  };
  WeightAmounts amounts{0.0, 0.0, {}, {}};
  StemWidths reached = now;
  for (int look = 0; look < 2; ++look) {
    if (wished.upright) {
      amounts.x = amount_of("upright", wished.upright, now.upright, whole.upright, *reached.upright, amounts.x);
    }
    if (wished.level) amounts.y = amount_of("level", wished.level, now.level, whole.level, *reached.level, amounts.y);
    if (!wished.upright) amounts.x = amounts.y;
    if (!wished.level) amounts.y = amounts.x;
    reached = made_at(amounts);
  }
  return amounts;
}

WeightAmounts fit_amounts(std::span<const WeightPair> pairs, const WeightModel& model, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("fit_amounts: units_per_em is ", units_per_em));
  WeightModel found;
  const std::vector<Lesson> lessons = lessons_of(found, pairs, units_per_em);
  if (lessons.empty()) {
    throw InvalidInput(text("fit_amounts: of ", pairs.size(), " letters none has contours that pair up"));
  }
  // The growth of strokes: what was drawn, what the whole step makes of it, and what of that is due to x.
  struct Shown {
    double whole, by_x, drawn, length;
  };
  std::vector<Shown> strokes;
  for (const Lesson& lesson : lessons) {
    const LetterClass letter_class = lesson.pair->letter_class;
    const Contours own = in_thousandths(lesson.pair->from, units_per_em);
    const auto moves_at = [&](const WeightAmounts& amounts) {
      const Contours made = apply_weight(own, letter_class, model, 1000.0, {.amounts = amounts}).contours;
      std::vector<Point> at_starts;
      for (const StrokeEdge& edge : lesson.shape.edges()) {
        const auto c = static_cast<std::size_t>(edge.contour);
        at_starts.push_back(evaluate(made[c].segment(edge.segment), edge.u0) - edge.start);
      }
      return at_starts;
    };
    const std::vector<Point> whole_moves = moves_at({});
    const std::vector<Point> x_moves = moves_at({.x = 1.0, .y = 0.0});
    const Moves whole(lesson.shape, whole_moves);
    const Moves by_x(lesson.shape, x_moves);
    const Moves drawn(lesson.shape, lesson.moves);
    for (int i = 0; i < lesson.shape.size(); ++i) {
      const StrokeEdge& edge = lesson.shape[i];
      if (!is_stroke(edge) || edge.thickness() >= 1.5 * lesson.stem) continue;
      strokes.push_back({whole.growth(i), by_x.growth(i), drawn.growth(i), edge.length});
    }
  }
  // Least absolute errors, by least squares weighed anew.
  constexpr int rounds = 30;
  constexpr double near = 1.0;  // errors below count by their squares
  Eigen::Vector2d best = Eigen::Vector2d::Ones();
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix2d K = 1e-6 * Eigen::Matrix2d::Identity();
    Eigen::Vector2d f = 1e-6 * Eigen::Vector2d::Ones();
    for (const Shown& stroke : strokes) {
      const Eigen::Vector2d row(stroke.by_x, stroke.whole - stroke.by_x);
      const double weight = stroke.length / std::max(round == 0 ? 0.0 : std::abs(row.dot(best) - stroke.drawn), near);
      K += weight * row * row.transpose();
      f += weight * stroke.drawn * row;
    }
    best = K.ldlt().solve(f);
  }
  return {std::clamp(best[0], -1.0, 2.0), std::clamp(best[1], -1.0, 2.0), {}, {}};
}

}  // namespace fontcore
