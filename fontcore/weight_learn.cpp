#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/weight_law.h"

namespace fontcore {

using namespace weight;

namespace {

using Zone = WeightModel::Zone;

constexpr double fine_step = 5.0;  // of the outline that a control letter is compared with, thousandths of the em

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
  return Eigen::Vector4d(std::log(place.thickness) / 0.25, place.direction / 0.5, place.letters / 1.2,
                         (place.is_round ? 1.0 : 0.0) / 0.6);
}

// The tables of what the control letters say beyond the law.
void correct_strokes(WeightModel& model, const std::vector<StrokeRow>& rows) {
  constexpr double samples = 220.0;  // that all rows together count for
  // The law is read off straight strokes: what a single one shows beyond it, a leg or a beak, is mostly its letter's
  // own.
  constexpr std::array<double, 2> kept = {0.3, 1.0};  // straight, round
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
          letters.correction[kind][i][j] = rounded(kept[kind] * value, 0.1);
          letters.deviation[kind][i][j] = rounded(deviation / std::max(size, 0.3), 0.1);
        }
      }
    }
  }
}

Eigen::VectorXd counter_point(double width, int letters, int round_sides) {
  return Eigen::Vector3d(std::log(std::max(width, 10.0)) / 0.4, letters / 0.7, 0.5 * round_sides / 0.7);
}

// The counter of a class and its growth, and the spread of its centre lines. Nothing seen: strokes grow into counters.
void find_counter(Letters& letters, const std::vector<CounterRow>& rows) {
  letters.counter = 300.0;
  letters.counter_growth = -letters.upright.growth;
  double weight = 0.0;
  double width = 0.0;
  double growth = 0.0;
  double spread = 0.0;
  double squares = 0.0;
  for (const CounterRow& row : rows) {
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
}

double usual_slope(const Letters& letters) {
  return 0.5 * letters.spread + 0.5 * letters.counter_growth / letters.counter;
}

// Those beside stems, where there are some.
void keep_between_stems(std::vector<CounterRow>& rows, const Letters& letters) {
  std::vector<CounterRow> between_stems;
  for (const CounterRow& row : rows) {
    if (row.thickness < 1.5 * letters.upright.thickness) between_stems.push_back(row);
  }
  if (between_stems.size() > 5) rows = std::move(between_stems);
}

void learn_counters(WeightModel& model, std::array<std::vector<CounterRow>, 2> rows) {
  constexpr double samples = 120.0;
  for (std::size_t c = 0; c < 2; ++c) keep_between_stems(rows[c], model.letters[c]);
  struct Sum {
    double log_width = 0.0, growth = 0.0, weight = 0.0;
  };
  std::map<std::array<int, 3>, Sum> sums;
  double total = 0.0;
  for (std::size_t c = 0; c < 2; ++c) {
    Letters& letters = model.letters[c];
    find_counter(letters, rows[c].empty() ? rows[1 - c] : rows[c]);
    letters.counter_slope = usual_slope(letters);
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

// Flats, extrema and the end of the box at the top (sign 1) or bottom (-1) of a letter. What moves unlike the end is a
// part of that letter, a beak or a cut, and no height that letters share.
void add_heights(std::vector<HeightRow>& rows, const Lesson& lesson, double sign) {
  const StrokeEdges& shape = lesson.shape;
  const Moves moves(shape, lesson.moves);
  const auto end_of = [&](const Box& box) { return sign > 0.0 ? box.high.y() : box.low.y(); };
  const double end = end_of(shape.box());
  const double shift = end_of(lesson.drawn.box()) - end;
  const double reach = 0.1 * (shape.box().high.y() - shape.box().low.y());
  const auto add = [&](double height, double its_shift, double weight) {
    if (std::abs(height - end) < reach && std::abs(its_shift - shift) < near_zone) {
      rows.push_back({height, its_shift, weight});
    }
  };
  for (int i = 0; i < shape.size(); ++i) {
    const StrokeEdge& edge = shape[i];
    if (sign * edge.normal.y() > 0.99 && edge.is_line) add(edge.middle.y(), moves.middle(i).y(), edge.length);
    if (shape.is_extremum(i, sign)) add(edge.start.y(), moves.start(i).y(), 40.0);
  }
  rows.push_back({end, shift, 60.0});
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

// All that letters show.
struct Shown {
  std::vector<StrokeRow> strokes;
  std::vector<HeightRow> tops;
  std::vector<HeightRow> bottoms;
  std::array<std::vector<CounterRow>, 2> counters;  // by class
};

Shown look_at(WeightModel& model, const std::vector<Lesson>& lessons) {
  learn_room(model, lessons);
  Shown rows;
  for (const Lesson& lesson : lessons) {
    const std::vector<StrokeRow> strokes = stroke_rows(model, lesson, static_cast<int>(&lesson - lessons.data()));
    rows.strokes.insert(rows.strokes.end(), strokes.begin(), strokes.end());
    const std::vector<CounterRow> between = counter_rows(lesson);
    std::vector<CounterRow>& own = rows.counters[static_cast<std::size_t>(lesson.letters)];
    own.insert(own.end(), between.begin(), between.end());
    add_heights(rows.tops, lesson, 1.0);
    add_heights(rows.bottoms, lesson, -1.0);
  }
  return rows;
}

// What the model makes of the control letters, beside what was drawn.
void measure_controls(WeightModel& model, const std::vector<Lesson>& lessons, double units_per_em) {
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
}

// The amounts for upright and level strokes by which they come nearest to what was drawn.
Eigen::Vector2d nearest_amounts(const std::vector<Lesson>& lessons, const WeightModel& model, double units_per_em) {
  // The growth of strokes: what was drawn, what the whole step makes of it, and what of that is due to x.
  struct Grown {
    double whole, by_x, drawn, length;
  };
  std::vector<Grown> strokes;
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
    for (const Grown& stroke : strokes) {
      const Eigen::Vector2d row(stroke.by_x, stroke.whole - stroke.by_x);
      const double weight = stroke.length / std::max(round == 0 ? 0.0 : std::abs(row.dot(best) - stroke.drawn), near);
      K += weight * row * row.transpose();
      f += weight * stroke.drawn * row;
    }
    best = K.ldlt().solve(f);
  }
  return best;
}

// A letter as it stands, to be measured like a lesson in which nothing grows.
Lesson still(const WeightPair& pair, double units_per_em) {
  StrokeEdges shape(in_thousandths(pair.from, units_per_em), curve_step, line_step);
  std::vector<Point> moves(static_cast<std::size_t>(shape.size()), Point::Zero());
  const double stem = shape.stem(usual_stem);
  return {&pair, pair.letter_class == LetterClass::Capital ? 1 : 0, shape, shape, std::move(moves), stem};
}

// The model with the strokes of other letters: growths in proportion.
void take_strokes(Letters& letters, const Letters& own) {
  const double factor = own.upright.thickness / letters.upright.thickness;
  letters.upright = {own.upright.thickness, letters.upright.growth * factor};
  letters.level.growth *= own.level.thickness / letters.level.thickness;
  letters.level.thickness = own.level.thickness;
  for (auto& kind : letters.correction) {
    for (auto& direction : kind) {
      for (double& correction : direction) correction *= factor;
    }
  }
}

// Upright and level strokes by amounts of their own, what depends on the direction in between.
void scale_strokes(Letters& letters, const Eigen::Vector2d& amounts) {
  letters.upright.growth *= amounts[0];
  letters.level.growth *= amounts[1];
  letters.serif *= amounts[0];
  letters.left_side *= amounts[0];
  letters.right_side *= amounts[0];
  for (auto& kind : letters.correction) {
    for (std::size_t i = 0; i < WeightModel::directions.size(); ++i) {
      const double c2 = squared(std::cos(radians(WeightModel::directions[i])));
      for (double& correction : kind[i]) correction *= amounts[0] * c2 + amounts[1] * (1.0 - c2);
    }
  }
}

// The shifts of a model's zones at the heights of others: in order where there are as many, else in proportion.
std::vector<Zone> take_heights(const std::vector<Zone>& zones, std::vector<Zone> own) {
  if (zones.empty() || own.empty()) return own;
  const auto farthest = [](const std::vector<Zone>& list) {
    return std::max(std::abs(list.front().height), std::abs(list.back().height));
  };
  const double factor = farthest(zones) / std::max(farthest(own), 1.0);
  for (std::size_t k = 0; k < own.size(); ++k) {
    own[k].shift = own.size() == zones.size() ? zones[k].shift : shift_of(zones, factor * own[k].height);
  }
  return own;
}

}  // namespace

WeightModel learn_weight(std::span<const WeightPair> pairs, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("learn_weight: units_per_em is ", units_per_em));
  WeightModel model;
  const std::vector<Lesson> lessons = lessons_of(model, pairs, units_per_em);
  if (lessons.empty()) {
    throw InvalidInput(text("learn_weight: of ", pairs.size(), " control letters none has contours that pair up"));
  }
  Shown rows = look_at(model, lessons);
  if (rows.strokes.empty()) throw InvalidInput("learn_weight: the control letters have no strokes");
  for (int c = 0; c < 2; ++c) find_strokes(model.letters[static_cast<std::size_t>(c)], rows.strokes, c);
  correct_strokes(model, rows.strokes);
  learn_counters(model, std::move(rows.counters));
  learn_serifs(model, lessons);
  learn_sides(model, lessons, units_per_em);
  model.top = gather_zones(std::move(rows.tops));
  model.bottom = gather_zones(std::move(rows.bottoms));
  measure_controls(model, lessons, units_per_em);
  return model;
}

WeightAmounts fit_amounts(std::span<const WeightPair> pairs, const WeightModel& model, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("fit_amounts: units_per_em is ", units_per_em));
  WeightModel found;
  const std::vector<Lesson> lessons = lessons_of(found, pairs, units_per_em);
  if (lessons.empty()) {
    throw InvalidInput(text("fit_amounts: of ", pairs.size(), " letters none has contours that pair up"));
  }
  const Eigen::Vector2d best = nearest_amounts(lessons, model, units_per_em);
  return {std::clamp(best[0], -1.0, 2.0), std::clamp(best[1], -1.0, 2.0), {}, {}};
}

WeightModel carry_weight(const WeightModel& model, std::span<const WeightPair> letters, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("carry_weight: units_per_em is ", units_per_em));
  // How much wider letters get as they get bolder, by class, relative: means over Roboto, Lato, Inter, Cantarell, Noto
  // and Open Sans. Among all pairs of these and of DejaVu, Liberation and Nimbus Sans keeping all of the model's own
  // errs by 8.5 %, half 8.2, none 8.1.
  constexpr std::array<double, 2> usual_spread = {-0.03, -0.04};
  constexpr double kept_spread = 1.0 / 3.0;
  std::vector<Lesson> seen;
  std::vector<WeightPair> drawn;
  for (const WeightPair& letter : letters) {
    seen.push_back(still(letter, units_per_em));
    if (!letter.to.empty()) drawn.push_back(letter);
  }
  WeightModel own;
  Shown rows = look_at(own, seen);
  if (rows.strokes.empty()) throw InvalidInput("carry_weight: the letters have no strokes");
  WeightModel result = model;
  result.controls.clear();
  const std::vector<Lesson> lessons = lessons_of(result, drawn, units_per_em);
  std::array<std::vector<CounterRow>, 2> grown;
  for (const Lesson& lesson : lessons) {
    std::vector<CounterRow>& of_class = grown[static_cast<std::size_t>(lesson.letters)];
    const std::vector<CounterRow> between = counter_rows(lesson);
    of_class.insert(of_class.end(), between.begin(), between.end());
  }
  for (std::size_t c = 0; c < 2; ++c) {
    Letters& to = result.letters[c];
    find_strokes(own.letters[c], rows.strokes, static_cast<int>(c));
    take_strokes(to, own.letters[c]);
    keep_between_stems(rows.counters[c], to);
    keep_between_stems(grown[c], to);
    if (own.letters[c].room > 0.0) to.room = own.letters[c].room;
    to.spread = kept_spread * to.spread + (1.0 - kept_spread) * usual_spread[c];
  }
  result.top = take_heights(model.top, gather_zones(std::move(rows.tops)));
  result.bottom = take_heights(model.bottom, gather_zones(std::move(rows.bottoms)));
  // Widths depend on strokes, and strokes a little on widths.
  for (int round = 0; round < 2; ++round) {
    Eigen::Vector2d amounts = Eigen::Vector2d::Ones();
    if (!lessons.empty()) amounts = nearest_amounts(lessons, result, units_per_em);
    for (std::size_t c = 0; c < 2; ++c) {
      Letters& to = result.letters[c];
      scale_strokes(to, amounts);
      if (!grown[c].empty()) find_counter(to, grown[c]);
      Letters width = to;
      if (!rows.counters[c].empty()) find_counter(width, rows.counters[c]);
      to.counter = width.counter;
      to.counter_growth = to.spread * (to.counter + to.upright.thickness) - to.upright.growth;
      to.counter_slope = usual_slope(to);
    }
    for (std::vector<Zone>* zones : {&result.top, &result.bottom}) {
      for (Zone& zone : *zones) zone.shift *= amounts[1];
    }
  }
  measure_controls(result, lessons, units_per_em);
  return result;
}

}  // namespace fontcore
