#include "fontcore/representation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "fontcore/error.h"

namespace fontcore {

namespace {

/// Two parameters nearer to each other than this are one: t may have been carried round 1 and back.
constexpr double same_t = 1e-12;

/// Where samples turn off from the curve before them by more they begin a corner, radians (8 degrees).
constexpr double smooth_turn = 0.139626;

/// A sequence with the entries over [low, high) of unwrapped t replaced, low in [0, 1) and high at most low + 1.
template <typename Entry>
SharedSequence<Entry> with_stretch(const SharedSequence<Entry>& sequence, double low, double high,
                                   const std::vector<Entry>& entries) {
  std::vector<Entry> tail;
  std::vector<Entry> head;
  for (Entry entry : entries) {
    if (entry.t < 1.0) {
      tail.push_back(std::move(entry));
    } else {
      entry.t -= 1.0;
      head.push_back(std::move(entry));
    }
  }
  if (high <= 1.0) return sequence.replaced(sequence.count_below(low), sequence.count_below(high), tail);
  const auto first = sequence.replaced(sequence.count_below(low), sequence.size(), tail);
  return first.replaced(0, std::min(first.count_below(high - 1.0), first.count_below(low)), head);
}

void require_index(const char* function, const char* what, int index, int size) {
  if (index < 0 || index >= size) throw InvalidInput(text(function, ": no ", what, " ", index, " of ", size));
}

void require_place(const char* function, const Point& place) {
  if (!place.allFinite()) throw InvalidInput(text(function, ": a place that is not finite"));
}

/// Indices of those samples that alone keep the polyline within a tolerance of all, at equal t; pins and ends stay.
std::vector<std::size_t> needed(const SampledSplice& splice, double tolerance) {
  const auto& samples = splice.samples;
  std::vector<std::size_t> kept{0};
  for (const Pin& pin : splice.pins) {
    const auto at =
        std::partition_point(samples.begin(), samples.end(), [&](const Sample& sample) { return sample.t < pin.t; });
    const auto index = static_cast<std::size_t>(at - samples.begin());
    if (index > kept.back() && index + 1 < samples.size()) kept.push_back(index);
  }
  kept.push_back(samples.size() - 1);

  std::vector<std::size_t> result{0};
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k + 1 < kept.size(); ++k) {
    open.assign(1, kept[k + 1]);
    while (!open.empty()) {
      const std::size_t from = result.back();
      const std::size_t to = open.back();
      const Sample& a = samples[from];
      const Sample& b = samples[to];
      double farthest = 0.0;
      std::size_t at = from;
      for (std::size_t i = from + 1; i < to; ++i) {
        const double share = (samples[i].t - a.t) / (b.t - a.t);
        const double off = (samples[i].p - a.p - share * (b.p - a.p)).norm();
        if (off > farthest) {
          farthest = off;
          at = i;
        }
      }
      if (farthest > tolerance) {
        open.push_back(at);
      } else {
        result.push_back(to);
        open.pop_back();
      }
    }
  }
  return result;
}

}  // namespace

// Polyline.

LinkedPolyline::LinkedPolyline(const Polyline& polyline) {
  const auto n = static_cast<Eigen::Index>(polyline.t.size());
  if (n < 3 || polyline.points.rows() != n) {
    throw InvalidInput(text("LinkedPolyline: ", n, " parameters and ", polyline.points.rows(), " vertices"));
  }
  std::vector<Vertex> vertices;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = polyline.t[static_cast<std::size_t>(i)];
    const Point p = polyline.points.row(i).transpose();
    if (!(t >= 0.0 && t < 1.0) || !p.allFinite() || (i > 0 && !(t > vertices.back().t))) {
      throw InvalidInput(text("LinkedPolyline: vertex ", i, " at t = ", t));
    }
    vertices.push_back({t, p});
  }
  vertices_ = SharedSequence<Vertex>(vertices);
}

Sample LinkedPolyline::vertex(int index) const {
  const Vertex& vertex = vertices_[static_cast<std::size_t>(index)];
  return {vertex.t, vertex.p};
}

int LinkedPolyline::vertex_at(double t) const {
  const double in = wrapped(t);
  const auto below = static_cast<int>(vertices_.count_below(in));
  if (below < size() && vertices_[static_cast<std::size_t>(below)].t == in) return below;
  return below == 0 ? size() - 1 : below - 1;
}

std::vector<Sample> LinkedPolyline::vertices(const Interval& interval) const {
  std::vector<Sample> result;
  const double from = wrapped(interval.from);
  const double to = from + length(interval);
  const std::size_t n = vertices_.size();
  for (std::size_t i = vertices_.count_below(from); i < 2 * n; ++i) {
    const Vertex& vertex = vertices_[i < n ? i : i - n];
    const double t = i < n ? vertex.t : vertex.t + 1.0;
    if (t > to) break;
    result.push_back({t, vertex.p});
  }
  return result;
}

Point LinkedPolyline::evaluate(double t) const {
  const double in = wrapped(t);
  const Sample a = vertex(vertex_at(in));
  const Sample b = vertex((vertex_at(in) + 1) % size());
  const double way = length({a.t, b.t});
  const double share = (unwrapped(in, a.t) - a.t) / way;
  return a.p + share * (b.p - a.p);
}

Polyline LinkedPolyline::whole() const {
  Polyline result;
  result.points.resize(size(), 2);
  for (int i = 0; i < size(); ++i) {
    result.t.push_back(vertex(i).t);
    result.points.row(i) = vertex(i).p;
  }
  return result;
}

std::vector<Interval> LinkedPolyline::near(const Box& box) const {
  IntervalSet stretches;
  for (const auto& [first, last] : vertices_.near(box)) {
    stretches.add({vertices_[first].t, last < vertices_.size() ? vertices_[last].t : vertices_[0].t});
  }
  return stretches.intervals();
}

LinkedPolyline LinkedPolyline::replaced(const Interval& interval, const std::vector<Sample>& by) const {
  const double shift = wrapped(interval.from) - by.front().t;
  std::vector<Vertex> vertices;
  for (const Sample& sample : by) {
    const double t = sample.t + shift;
    vertices.push_back({std::abs(t - 1.0) < same_t ? 1.0 : t, sample.p});
  }
  LinkedPolyline result;
  if (length(interval) >= 1.0) {
    vertices.pop_back();
    std::vector<Vertex> in_order;
    for (const Vertex& vertex : vertices) {
      if (vertex.t >= 1.0) in_order.push_back({vertex.t - 1.0, vertex.p});
    }
    for (const Vertex& vertex : vertices) {
      if (vertex.t < 1.0) in_order.push_back(vertex);
    }
    result.vertices_ = SharedSequence<Vertex>(in_order);
    return result;
  }
  const double low = std::max(0.0, vertices.front().t - same_t);
  const double high = vertices.back().t + same_t;
  result.vertices_ = with_stretch(vertices_, low, high, vertices);
  return result;
}

Changed<LinkedPolyline> LinkedPolyline::move_vertex(int index, const Point& to) const {
  require_index("LinkedPolyline::move_vertex", "vertex", index, size());
  require_place("LinkedPolyline::move_vertex", to);
  const auto i = static_cast<std::size_t>(index);
  const double t = vertices_[i].t;
  LinkedPolyline result;
  result.vertices_ = vertices_.replaced(i, i + 1, {{t, to}});
  return {std::move(result), {vertex((index + size() - 1) % size()).t, vertex((index + 1) % size()).t}};
}

Changed<LinkedPolyline> LinkedPolyline::add_vertex(double t, const Point& place) const {
  require_place("LinkedPolyline::add_vertex", place);
  if (!std::isfinite(t)) throw InvalidInput("LinkedPolyline::add_vertex: t is not finite");
  const double in = wrapped(t);
  const int before = vertex_at(in);
  if (vertex(before).t == in) throw InvalidInput(text("LinkedPolyline::add_vertex: there is a vertex at t = ", in));
  const std::size_t at = vertices_.count_below(in);
  LinkedPolyline result;
  result.vertices_ = vertices_.replaced(at, at, {{in, place}});
  return {std::move(result), {vertex(before).t, vertex((before + 1) % size()).t}};
}

Changed<LinkedPolyline> LinkedPolyline::remove_vertex(int index) const {
  require_index("LinkedPolyline::remove_vertex", "vertex", index, size());
  if (size() <= 3) throw InvalidInput("LinkedPolyline::remove_vertex: 3 vertices are left");
  const auto i = static_cast<std::size_t>(index);
  LinkedPolyline result;
  result.vertices_ = vertices_.replaced(i, i + 1, {});
  return {std::move(result), {vertex((index + size() - 1) % size()).t, vertex((index + 1) % size()).t}};
}

Changed<LinkedPolyline> LinkedPolyline::merge_straight(const Interval& interval, double tolerance,
                                                       const std::vector<double>& kept) const {
  SampledSplice run = sample(interval, tolerance);
  for (const double t : kept) {
    const double at = unwrapped(t, run.samples.front().t);
    const auto found = std::find_if(run.samples.begin(), run.samples.end(),
                                    [&](const Sample& sample) { return std::abs(sample.t - at) < same_t; });
    if (found != run.samples.end()) run.pins.push_back({.t = found->t});
  }
  std::sort(run.pins.begin(), run.pins.end(), [](const Pin& a, const Pin& b) { return a.t < b.t; });
  std::vector<Sample> by;
  for (const std::size_t i : needed(run, tolerance)) by.push_back(run.samples[i]);
  if (length(interval) >= 1.0 && by.size() < 4) return {*this, interval};
  return {replaced(interval, by), interval};
}

SampledSplice LinkedPolyline::sample(const Interval& interval, double /*tolerance*/) const {
  SampledSplice result{interval, {}};
  const double from = wrapped(interval.from);
  const double to = from + length(interval);
  result.samples.push_back({from, evaluate(from)});
  for (const Sample& vertex : vertices(interval)) {
    if (vertex.t > from + same_t && vertex.t < to - same_t) result.samples.push_back(vertex);
  }
  result.samples.push_back({to, evaluate(to)});
  return result;
}

std::shared_ptr<const Representation> LinkedPolyline::splice(const SampledSplice& samples, double tolerance) const {
  require_valid("LinkedPolyline::splice", samples);
  const bool is_whole = length(samples.interval) >= 1.0;
  SampledSplice met = samples;
  if (!is_whole) met = meet(samples, evaluate(samples.samples.front().t), evaluate(samples.samples.back().t));
  std::vector<Sample> by;
  // Chords that are fitted later must be much nearer to the curve than the fit.
  for (const std::size_t i : needed(met, sampling_share * tolerance)) by.push_back(met.samples[i]);
  if (is_whole && by.size() < 4) by = met.samples;
  return std::make_shared<const LinkedPolyline>(replaced(samples.interval, by));
}

std::size_t LinkedPolyline::bytes_beyond(const Representation& other) const {
  return vertices_.bytes_beyond(dynamic_cast<const LinkedPolyline&>(other).vertices_);
}

// Bezier.

namespace {

/// Cubics through samples within a distance at equal t, neighbours with a common tangent but at corners.
class CubicFit {
 public:
  CubicFit(const SampledSplice& splice, double tolerance)
      : samples_(splice.samples), pins_(splice.pins), tolerance_(tolerance) {}

  /// From the first sample to the last. Directions at the ends, where the curve goes on from others; by the samples if
  /// none is given.
  std::vector<LinkedBezier::Piece> pieces(std::optional<Point> start, std::optional<Point> end) {
    const std::size_t last = samples_.size() - 1;
    std::size_t from = 0;
    Direction out = start ? Direction{*start, true} : Direction{leaving(0, last)};
    bool is_end_pinned = false;
    for (const Pin& pin : pins_) {
      const auto found = std::partition_point(samples_.begin(), samples_.end(),
                                              [&](const Sample& sample) { return sample.t < pin.t; });
      const auto at = static_cast<std::size_t>(found - samples_.begin());
      if (at == 0) {
        if (pin.out) out = {*pin.out, true, true};
      } else if (at == last) {
        if (pin.in) {
          end = pin.in;
          is_end_pinned = true;
        }
      } else {
        const auto given = [&](const std::optional<Point>& direction, const Point& otherwise) {
          return direction ? Direction{*direction, true, true} : Direction{otherwise};
        };
        const Point smooth = tangent(at, from, last);
        add(from, at, out, given(pin.in, pin.is_corner ? arriving(from, at) : smooth));
        out = given(pin.out, pin.is_corner ? leaving(at, last) : smooth);
        from = at;
      }
    }
    add(from, last, out, end ? Direction{*end, true, is_end_pinned} : Direction{arriving(from, last)});
    return std::move(pieces_);
  }

  /// Direction of the samples at one of them, seen from both sides within a range.
  Point tangent(std::size_t i, std::size_t first, std::size_t last) const {
    return slope(before(i, first), i, after(i, last));
  }
  Point leaving(std::size_t i, std::size_t last) const {
    const std::size_t near = after(i, last);
    return end_slope(i, near, after(near, last));
  }
  Point arriving(std::size_t first, std::size_t i) const {
    const std::size_t near = before(i, first);
    return -end_slope(i, near, before(near, first));
  }

  /// One cubic over a range of samples, its handles along two directions by least squares; a line if it has none.
  Bezier single(std::size_t i, std::size_t j, const Point& out, const Point& in) const {
    const Point& a = samples_[i].p;
    const Point& b = samples_[j].p;
    const double way = samples_[j].t - samples_[i].t;
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t k = i + 1; k < j; ++k) {
      const auto w = bernstein(3, (samples_[k].t - samples_[i].t) / way);
      const Point rest = samples_[k].p - (w[0] + w[1]) * a - (w[2] + w[3]) * b;
      const Point by_out = w[1] * out;
      const Point by_in = -w[2] * in;
      normal(0, 0) += by_out.squaredNorm();
      normal(0, 1) += by_out.dot(by_in);
      normal(1, 1) += by_in.squaredNorm();
      right += Eigen::Vector2d(by_out.dot(rest), by_in.dot(rest));
    }
    normal(1, 0) = normal(0, 1);
    const double chord = (b - a).norm();
    Eigen::Vector2d handles(chord / 3.0, chord / 3.0);
    if (normal.determinant() > 1e-12 * normal(0, 0) * normal(1, 1)) {
      const Eigen::Vector2d solved = normal.inverse() * right;
      if (solved.minCoeff() > 1e-3 * chord) handles = solved;
    }
    return {{a, a + handles[0] * out, b - handles[1] * in, b}, 3};
  }

 private:
  /// The nearest sample before or after one that is far enough away for a direction.
  std::size_t before(std::size_t i, std::size_t first) const {
    std::size_t k = i;
    while (k > first && (k == i || (samples_[k].p - samples_[i].p).norm() < 4.0 * tolerance_)) --k;
    return k;
  }
  std::size_t after(std::size_t i, std::size_t last) const {
    std::size_t k = i;
    while (k < last && (k == i || (samples_[k].p - samples_[i].p).norm() < 4.0 * tolerance_)) ++k;
    return k;
  }
  /// Of the parabola through three samples, over t: at the middle one, and at the first.
  Point slope(std::size_t a, std::size_t i, std::size_t b) const {
    if (a == i) return end_slope(i, b, b);
    if (b == i) return -end_slope(i, a, a);
    const double ta = samples_[i].t - samples_[a].t;
    const double tb = samples_[b].t - samples_[i].t;
    const Point x = (samples_[i].p - samples_[a].p) / ta;
    const Point y = (samples_[b].p - samples_[i].p) / tb;
    return unit((tb * x + ta * y) / (ta + tb), samples_[b].p - samples_[a].p);
  }
  Point end_slope(std::size_t i, std::size_t near, std::size_t far) const {
    const Point x = samples_[near].p - samples_[i].p;
    const Point y = samples_[far].p - samples_[i].p;
    if (near == far) return unit(x, x);
    const double tx = std::abs(samples_[near].t - samples_[i].t);
    const double ty = std::abs(samples_[far].t - samples_[i].t);
    return unit(x * (ty / tx) - y * (tx / ty), x);
  }
  static Point unit(const Point& direction, const Point& otherwise) {
    if (direction.norm() > 0.0) return direction.normalized();
    return otherwise.norm() > 0.0 ? otherwise.normalized() : Point(1.0, 0.0);
  }

  /// Of the curve at the end of a range: given, or taken from the samples.
  struct Direction {
    Point along = Point::Zero();
    bool is_given = false;   // by what is outside the range
    bool is_pinned = false;  // met even where the samples say otherwise
  };

  void add(std::size_t i, std::size_t j, const Direction& out, const Direction& in) {
    const Point chord = samples_[j].p - samples_[i].p;
    const auto bends_chord = [&](const Direction& direction) {
      const double least = direction.is_pinned ? chord.norm() : 1.0 + chord.norm();
      return direction.is_given && (chord - chord.norm() * direction.along).norm() > straight * least;
    };
    const bool is_bent = bends_chord(out) || bends_chord(in);
    const Bezier line{{samples_[i].p, samples_[j].p, Point::Zero(), Point::Zero()}, 1};
    if (!is_bent && is_straight(i, j)) {
      pieces_.push_back({samples_[i].t, line});
      return;
    }
    const Bezier cubic = single(i, j, out.along, in.along);
    if (is_within(cubic, i, j) || (j == i + 1 && (out.is_pinned || in.is_pinned))) {
      pieces_.push_back({samples_[i].t, cubic});
      return;
    }
    if (j == i + 1) {
      pieces_.push_back({samples_[i].t, line});
      return;
    }
    const double middle = 0.5 * (samples_[i].t + samples_[j].t);
    std::size_t at = i + 1;
    while (at + 1 < j && std::abs(samples_[at + 1].t - middle) <= std::abs(samples_[at].t - middle)) ++at;
    const Direction through{tangent(at, i, j)};
    add(i, at, out, through);
    add(at, j, through, in);
  }

  bool is_straight(std::size_t i, std::size_t j) const {
    const Sample& a = samples_[i];
    const Sample& b = samples_[j];
    for (std::size_t k = i + 1; k < j; ++k) {
      const double share = (samples_[k].t - a.t) / (b.t - a.t);
      if ((samples_[k].p - a.p - share * (b.p - a.p)).norm() > straight) return false;
    }
    return true;
  }

  /// Proved for all t: on the edge from one sample to the next, a cubic is off by no more than at its ends and an
  /// eighth of the square of its length times the largest second derivative.
  bool is_within(const Bezier& cubic, std::size_t i, std::size_t j) const {
    const double way = samples_[j].t - samples_[i].t;
    const Point bend_start = 6.0 * (cubic.p[2] - 2.0 * cubic.p[1] + cubic.p[0]);
    const Point bend_end = 6.0 * (cubic.p[3] - 2.0 * cubic.p[2] + cubic.p[1]);
    double last_u = 0.0;
    double last_off = 0.0;
    double last_bend = bend_start.norm();
    for (std::size_t k = i + 1; k <= j; ++k) {
      const double u = (samples_[k].t - samples_[i].t) / way;
      const double off = k == j ? 0.0 : (evaluate(cubic, u) - samples_[k].p).norm();
      const double bend = (bend_start + u * (bend_end - bend_start)).norm();
      const double step = u - last_u;
      if (std::max(off, last_off) + 0.125 * step * step * std::max(bend, last_bend) > tolerance_) return false;
      last_u = u;
      last_off = off;
      last_bend = bend;
    }
    return true;
  }

  static constexpr double straight = 1e-9;  // font units: rounding of coordinates

  const std::vector<Sample>& samples_;
  const std::vector<Pin>& pins_;
  double tolerance_;
  std::vector<LinkedBezier::Piece> pieces_;
};

}  // namespace

LinkedBezier::LinkedBezier(const BezierContour& contour) : source_(std::make_shared<const BezierContour>(contour)) {
  std::vector<double> lengths;
  double whole = 0.0;
  for (int s = 0; s < contour.segment_count(); ++s) {
    lengths.push_back(fontcore::length(contour.segment(s)));
    whole += lengths.back();
  }
  if (!(whole > 0.0)) throw InvalidInput("LinkedBezier: a contour of no length");
  // Segments of no length are part of the font: they get a little of t, so that it ascends.
  const double least = 1e-6 * whole;
  double sum = 0.0;
  for (double& length : lengths) sum += length = std::max(length, least);
  std::vector<double> nodes;
  double at = 0.0;
  for (const double length : lengths) {
    nodes.push_back(at / sum);
    at += length;
  }
  nodes.push_back(1.0);
  std::vector<Stretch> pieces;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const auto i = static_cast<std::size_t>(s);
    pieces.push_back({nodes[i], nodes[i], nodes[i + 1], contour.segment(s), s});
  }
  pieces_ = SharedSequence<Stretch>(pieces);
}

Bezier LinkedBezier::part(const Stretch& stretch, double from, double to) {
  const double u0 = stretch.parameter(from);
  const double u1 = stretch.parameter(to);
  Bezier part = stretch.whole;
  if (u1 < 1.0) part = split(part, u1)[0];
  if (u0 > 0.0) part = split(part, u0 / u1)[1];
  return part;
}

LinkedBezier::Piece LinkedBezier::piece(int index) const {
  const Stretch& own = stretch(index);
  const bool is_cut = own.parameter(own.t) > 0.0 || own.parameter(end(index)) < 1.0;
  return {own.t, part(own, own.t, end(index)), is_cut ? -1 : own.source};
}

std::vector<LinkedBezier::Piece> LinkedBezier::pieces_within(const Interval& interval) const {
  std::vector<Piece> result;
  const double from = wrapped(interval.from);
  const double to = from + fontcore::length(interval);
  std::vector<int> own = pieces(interval);
  // One that the interval begins in and comes round to again has a part at either end.
  if (node(own.front()) < from && node(own.front()) + 1.0 < to - same_t) own.push_back(own.front());
  for (const int index : own) {
    double start = node(index);
    double stop = end(index);
    if (stop <= from + same_t || (!result.empty() && start < from)) {
      start += 1.0;
      stop += 1.0;
    }
    const double turn = start - node(index);
    const double low = std::max(start, from);
    const double high = std::min(stop, to);
    const bool is_whole = low == start && high == stop;
    result.push_back({low, is_whole ? piece(index).bezier : part(stretch(index), low - turn, high - turn),
                      is_whole ? piece(index).source : -1});
  }
  return result;
}

int LinkedBezier::piece_at(double t) const {
  const double in = wrapped(t);
  const auto below = static_cast<int>(pieces_.count_below(in));
  return below < size() && node(below) == in ? below : below - 1;
}

Point LinkedBezier::evaluate(double t) const {
  const double in = wrapped(t);
  const Stretch& own = stretch(piece_at(in));
  return fontcore::evaluate(own.whole, own.parameter(in));
}

Point LinkedBezier::tangent(double t, Side side) const {
  const double in = wrapped(snapped(wrapped(t)));  // beside a node by rounding the other side would be taken for this
  int index = piece_at(in);
  const bool is_node = node(index) == in;
  if (side == Side::Left && is_node) index = index == 0 ? size() - 1 : index - 1;
  const Stretch& own = stretch(index);
  const double u = own.parameter(side == Side::Left && is_node ? end(index) : in);
  if (u == 0.0) return start_tangent(own.whole);
  if (u == 1.0) return end_tangent(own.whole);
  const Point along = derivative(own.whole, u);
  if (along.norm() > 0.0) return along.normalized();
  const auto halves = split(own.whole, u);
  return side == Side::Left ? end_tangent(halves[0]) : start_tangent(halves[1]);
}

BezierContour LinkedBezier::contour() const {
  int untouched = 0;
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  std::vector<Piece> all;
  for (int i = 0; i < size(); ++i) all.push_back(piece(i));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Piece& own = all[i];
    const Piece& before = all[i == 0 ? all.size() - 1 : i - 1];
    untouched += own.source >= 0 ? 1 : 0;
    const bool is_kept_join = own.source >= 0 && before.source >= 0 && source_->next(before.source) == own.source;
    points.push_back(own.bezier.start());
    kinds.push_back(is_kept_join ? source_->kind(source_->node(own.source)) : PointKind::Node);
    for (std::size_t k = 1; k < static_cast<std::size_t>(own.bezier.degree); ++k) {
      points.push_back(own.bezier.p[k]);
      kinds.push_back(own.bezier.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
  }
  if (source_ && untouched == source_->segment_count() && untouched == size()) return *source_;
  Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  return {std::move(rows), std::move(kinds)};
}

std::vector<int> LinkedBezier::pieces(const Interval& interval) const {
  std::vector<int> result;
  const double from = snapped(wrapped(interval.from));
  const double to = from + fontcore::length(interval);
  int index = from == 1.0 ? 0 : piece_at(from);
  double turn = from == 1.0 ? 1.0 : 0.0;
  while (node(index) + turn < to - same_t) {
    if (!result.empty() && index == result.front()) break;  // a whole turn
    result.push_back(index);
    if (++index == size()) {
      index = 0;
      turn += 1.0;
    }
  }
  return result;
}

std::vector<Interval> LinkedBezier::near(const Box& box) const {
  IntervalSet stretches;
  for (const auto& [first, last] : pieces_.near(box)) {
    stretches.add({node(static_cast<int>(first)), node(static_cast<int>(last))});
  }
  return stretches.intervals();
}

double LinkedBezier::snapped(double t) const {
  const int index = piece_at(t);
  if (t - node(index) < same_t) return node(index);
  return end(index) - t < same_t ? end(index) : t;
}

LinkedBezier LinkedBezier::with_pieces(SharedSequence<Stretch> pieces) const {
  LinkedBezier result;
  result.source_ = source_;
  result.pieces_ = std::move(pieces);
  return result;
}

LinkedBezier LinkedBezier::replaced(const Interval& interval, const std::vector<Piece>& by) const {
  if (by.empty()) throw InvalidInput("LinkedBezier::replaced: no pieces");
  const bool is_whole = fontcore::length(interval) >= 1.0;
  const double start = wrapped(interval.from);
  double from = is_whole ? start : snapped(start);
  if (from == 1.0) from = 0.0;
  // Where it ends, in (0, 1], and counted on from where it begins.
  double end_in = is_whole ? from : snapped(wrapped(interval.to));
  if (end_in == 0.0) end_in = 1.0;
  const double to = end_in > from ? end_in : end_in + 1.0;
  std::vector<Stretch> stretches;
  const double shift = start - by.front().t;  // 0 as a rule: then t stays as it is, bit for bit
  for (std::size_t i = 0; i < by.size(); ++i) {
    double t = i == 0 ? from : by[i].t + shift;
    if (i > 0 && from == 0.0 && start > 0.5) t -= 1.0;
    if (std::abs(t - 1.0) < same_t) t = 1.0;
    if (!(t < to) || (i > 0 && !(t > stretches.back().t))) {
      throw InvalidInput(text("LinkedBezier::replaced: piece ", i, " at t = ", by[i].t));
    }
    if (i > 0) stretches.back().to = t;
    stretches.push_back({t, t, to, by[i].bezier, by[i].source});
  }
  // A piece over 0 is cut there.
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    if (stretches[i].from >= 1.0 || stretches[i].to <= 1.0) continue;
    const auto halves = split(stretches[i].whole, (1.0 - stretches[i].from) / (stretches[i].to - stretches[i].from));
    stretches.insert(stretches.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                     {1.0, 1.0, stretches[i].to, halves[1], -1});
    stretches[i] = {stretches[i].t, stretches[i].from, 1.0, halves[0], -1};
    break;
  }
  std::vector<Stretch> tail;
  std::vector<Stretch> head;
  for (const Stretch& own : stretches) {
    if (own.t < 1.0) {
      tail.push_back(own);
    } else {
      head.push_back({own.t - 1.0, own.from - 1.0, own.to - 1.0, own.whole, own.source});
    }
  }
  (head.empty() ? tail : head).back().to = end_in;
  if (is_whole) {
    head.insert(head.end(), tail.begin(), tail.end());
    return with_pieces(SharedSequence<Stretch>(head));
  }
  // What the interval cuts off after it goes on at its end.
  const auto put = [&](SharedSequence<Stretch>& pieces, double low, double high, std::vector<Stretch>& entries) {
    if (high < 1.0) {
      Stretch rest = stretch(piece_at(high));
      if (rest.t < high) {
        rest.t = high;
        entries.push_back(rest);
      }
    }
    const std::size_t first = pieces.count_below(low);
    pieces = pieces.replaced(first, pieces.count_below(high), entries);
  };
  SharedSequence<Stretch> pieces = pieces_;
  if (to <= 1.0) {
    put(pieces, from, to, tail);
  } else {
    put(pieces, from, 1.0, tail);
    put(pieces, 0.0, end_in, head);
  }
  return with_pieces(std::move(pieces));
}

Changed<LinkedBezier> LinkedBezier::move_control_point(int index, int k, const Point& to) const {
  require_index("LinkedBezier::move_control_point", "piece", index, size());
  const int degree = piece(index).bezier.degree;
  require_index("LinkedBezier::move_control_point", "control point", k, degree + 1);
  require_place("LinkedBezier::move_control_point", to);
  const int before = index == 0 ? size() - 1 : index - 1;
  const int after = index + 1 == size() ? 0 : index + 1;
  SharedSequence<Stretch> pieces = pieces_;
  const auto put = [&](int of, int point) {
    Bezier moved = piece(of).bezier;
    moved.p[static_cast<std::size_t>(point)] = to;
    const auto i = static_cast<std::size_t>(of);
    pieces = pieces.replaced(i, i + 1, {{node(of), node(of), end(of), moved, -1}});
  };
  put(index, k);
  if (k == 0) {
    put(before, piece(before).bezier.degree);
    return {with_pieces(pieces), {node(before), end(index)}};
  }
  if (k == degree) {
    put(after, 0);
    return {with_pieces(pieces), {node(index), end(after)}};
  }
  return {with_pieces(pieces), {node(index), end(index)}};
}

Changed<LinkedBezier> LinkedBezier::add_node(double t) const {
  if (!std::isfinite(t)) throw InvalidInput("LinkedBezier::add_node: t is not finite");
  const double at = snapped(wrapped(t));
  const int index = piece_at(at);
  const Interval interval{node(index), end(index)};
  if (at == 1.0 || node(index) == at) return {*this, interval};
  Stretch second = stretch(index);
  second.t = at;
  const auto i = static_cast<std::size_t>(index);
  return {with_pieces(pieces_.replaced(i + 1, i + 1, {second})), interval};
}

Changed<LinkedBezier> LinkedBezier::remove_node(int index) const {
  require_index("LinkedBezier::remove_node", "piece", index, size());
  if (index == 0) throw InvalidInput("LinkedBezier::remove_node: the node at t = 0 stays");
  if (size() <= 2) throw InvalidInput("LinkedBezier::remove_node: 2 pieces are left");
  const Interval interval{node(index - 1), end(index)};
  SampledSplice run{interval, {}};
  constexpr int samples = 32;  // more than two cubics can differ in
  const double way = fontcore::length(interval);
  for (int k = 0; k < samples; ++k) {
    const double t = interval.from + way * k / samples;
    run.samples.push_back({t, evaluate(t)});
  }
  const Bezier second = piece(index).bezier;
  run.samples.push_back({interval.to, second.end()});
  const Bezier cubic =
      CubicFit(run, 0.0).single(0, samples, start_tangent(piece(index - 1).bezier), end_tangent(second));
  return {replaced(interval, {{interval.from, cubic}}), interval};
}

SampledSplice LinkedBezier::sample(const Interval& interval, double tolerance) const {
  SampledSplice result{interval, {}};
  const double start = wrapped(interval.from);
  const double to = start + fontcore::length(interval);
  result.samples.push_back({start, evaluate(start)});
  int index = piece_at(start);
  double turn = 0.0;
  while (node(index) + turn < to - same_t) {
    const Stretch& own = stretch(index);
    const Bezier& bezier = own.whole;
    double bend = 0.0;
    for (std::size_t k = 1; k < static_cast<std::size_t>(bezier.degree); ++k) {
      bend = std::max(bend, (bezier.p[k + 1] - 2.0 * bezier.p[k] + bezier.p[k - 1]).norm());
    }
    bend *= bezier.degree * (bezier.degree - 1);
    // A chord over h of u is off by h^2 / 8 of the second derivative. Places are the same whatever the interval.
    const double low = std::max(node(index), start - turn);
    const double high = std::min(end(index), to - turn);
    const int parts = std::max(1, static_cast<int>(std::ceil(std::sqrt(bend / (8.0 * tolerance)))));
    const auto first = static_cast<int>(own.parameter(low) * parts);
    const auto last = static_cast<int>(std::ceil(own.parameter(high) * parts));
    const auto add = [&](double t, const Point& p) {
      if (t > result.samples.back().t + same_t && t < to - same_t) result.samples.push_back({t, p});
    };
    for (int k = first; k <= last; ++k) {
      const double t = own.from + (own.to - own.from) * k / parts;
      if (t > low && t < high) add(t + turn, fontcore::evaluate(bezier, own.parameter(t)));
    }
    add(end(index) + turn, fontcore::evaluate(bezier, own.parameter(end(index))));
    if (++index == size()) {
      index = 0;
      turn += 1.0;
    }
  }
  result.samples.push_back({to, evaluate(to)});
  return result;
}

std::shared_ptr<const Representation> LinkedBezier::splice(const SampledSplice& samples, double tolerance) const {
  require_valid("LinkedBezier::splice", samples);
  const double fit = fitting_share * tolerance;
  const auto is_corner_at = [&](double t) {
    return std::any_of(samples.pins.begin(), samples.pins.end(),
                       [t](const Pin& pin) { return pin.is_corner && pin.t == t; });
  };
  const double from = samples.samples.front().t;
  const double to = samples.samples.back().t;
  if (fontcore::length(samples.interval) >= 1.0) {
    // The seam is a place like any other: unless it is a corner, its tangent is that of the samples on both sides.
    SampledSplice closed = samples;
    closed.samples.back().p = closed.samples.front().p;
    std::optional<Point> seam;
    if (!is_corner_at(from) && !is_corner_at(to)) {
      const Sample& before = closed.samples[closed.samples.size() - 2];
      const Sample& after = closed.samples[1];
      const Point& at = closed.samples.front().p;
      const double t_in = to - before.t;
      const double t_out = after.t - from;
      const Point along = t_out / t_in * (at - before.p) + t_in / t_out * (after.p - at);
      if (along.norm() > 0.0) seam = along.normalized();
    }
    return std::make_shared<const LinkedBezier>(replaced(samples.interval, CubicFit(closed, fit).pieces(seam, seam)));
  }
  const SampledSplice met = meet(samples, evaluate(from), evaluate(to));
  CubicFit cubics(met, fit);
  const std::size_t last = met.samples.size() - 1;
  // The curve goes on as it comes, unless the samples turn off from it.
  std::optional<Point> start;
  std::optional<Point> end;
  const auto goes_on = [](const Point& a, const Point& b) { return a.dot(b) > std::cos(smooth_turn) * a.norm(); };
  if (!is_corner_at(from)) {
    const Point before = tangent(from, Side::Left);
    if (goes_on(before, cubics.leaving(0, last))) start = before;
  }
  if (!is_corner_at(to)) {
    const Point after = tangent(to, Side::Right);
    if (goes_on(after, cubics.arriving(0, last))) end = after;
  }
  return std::make_shared<const LinkedBezier>(replaced(samples.interval, cubics.pieces(start, end)));
}

std::size_t LinkedBezier::bytes_beyond(const Representation& other) const {
  return pieces_.bytes_beyond(dynamic_cast<const LinkedBezier&>(other).pieces_);
}

}  // namespace fontcore
