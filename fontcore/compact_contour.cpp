#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "fontcore/compact.h"
#include "fontcore/compact_search.h"
#include "fontcore/degree.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace compact {

namespace {

// A curve this near to its chord, as a share of the tolerance, is a straight line.
constexpr double straightness = 0.02;
// The angle that a corner may lose or win, before what whole numbers cost.
constexpr double corner_freedom = 1.95 * degrees;
// Of its line, what the curves at both ends of a straight run may take over together.
constexpr double line_share = 0.4;
// How far an extremum may move along its tangent, em.
constexpr double extremum_slide = 0.012;
// One sample for so much length, em, or so much turn.
constexpr double sample_length = 0.04;
constexpr double sample_turn = 8.0 * degrees;
constexpr int most_samples_of_curve = 30;
constexpr int most_samples = 640;
// A stretch of so many samples that is cut so finely, em a segment, as texture is, is searched window by window.
constexpr double long_stretch = 30.0;
constexpr double long_segment = 0.01;
constexpr int segments_of_work = 64;  // that `most_work` is allowed for
// On whole numbers a handle beside a line that leans is no shorter, font units: the line could hardly keep its
// direction.
constexpr double leaning_handle = 8.0;
// A long turn is cut so often to join in.
constexpr double candidate_turn = 15.0 * degrees;
constexpr double most_candidates = 56.0;
constexpr double measuring_accuracy = 0.004;
// Of the tolerance, what cubics that are cut into quadratics one by one may take: the rest is for rounding.
constexpr double share_of_lowering = 0.5;
constexpr const char* too_much_work = "the work for the shortest outline would be more than is allowed";

// A segment of the source, or a part of it between extrema, or several that are one straight line.
struct Element {
  Bezier curve;
  int source = 0;          // the segment it begins with
  int sources = 1;         // how many end in it
  bool is_corner = false;  // at its start
  bool is_first = false;   // it starts at the contour's first node
  bool is_line = false;    // one that stays
  bool is_kept = false;    // the source's own, bit for bit
  double turn = 0.0;       // at its start, absolute
};

bool is_straight(const Bezier& b, double tolerance) {
  const Point chord = b.end() - b.start();
  const double length = chord.norm();
  if (!(length > 0.0)) return false;
  const Point along = chord / length;
  for (int i = 1; i < b.degree; ++i) {
    const Point d = b.p[at(i)] - b.start();
    const double x = d.dot(along);
    if (std::abs(cross(along, d)) > tolerance || x < -1e-9 || x > length + 1e-9) return false;
  }
  return true;
}

double handle_length(const Bezier& b, bool at_start) {
  const Point d = at_start ? Point(b.p[1] - b.start()) : Point(b.end() - b.p[at(b.degree - 1)]);
  const double size = d.norm();
  return size > 0.0 ? size : (b.end() - b.start()).norm();
}

class ContourFit {
 public:
  ContourFit(const BezierContour& source, const CompactOptions& options);
  CompactFit run();

 private:
  void make_elements();
  void split_at_extrema();
  void merge_lines();
  bool holds_first() const;
  void make_first(Join& join) const;
  Join end_join(int from, int to, bool is_closed, bool is_start) const;
  void add_samples(int from, int to, Task& task) const;
  void add_extrema(Task& task) const;
  void bring_start_near(Task& task) const;
  void add_first_node(int from, int to, Task& task) const;
  void sort_musts(Task& task) const;
  int most_pieces(int from, int to) const;
  Task task_of(int from, int to) const;
  std::optional<Result> originals(int from, int to) const;
  BezierContour contour_of(const std::vector<Bezier>& pieces, const std::vector<int>& segment) const;
  CompactFit as_it_was(std::string why = {}) const;
  bool is_admissible(int segment) const;
  void find_kept();
  Point node_place(int i) const;
  bool is_beside_kept(int i) const { return element(i).is_kept || element(i - 1).is_kept; }
  const Element& element(int i) const { return elements_[at((i + count()) % count())]; }
  int count() const { return static_cast<int>(elements_.size()); }
  Point whole(const Point& p) const { return compact::whole(settings_, p); }

  const BezierContour& source_;
  Settings settings_;
  Point origin_;
  std::vector<Element> elements_;
  std::vector<double> corner_turn_;          // by element: what the stretch before has turned the corner at its start
  std::vector<std::vector<Bezier>> fitted_;  // by element that a stretch or a line begins with
  std::vector<int> first_piece_;             // of them, the one that begins with the first node
  std::vector<char> is_kept_;                // by segment of the source
  long work_ = 0;
};

ContourFit::ContourFit(const BezierContour& source, const CompactOptions& options) : source_(source) {
  settings_.options = options;
  settings_.most_work = options.most_work * std::max(1, source.segment_count() / segments_of_work);
  origin_ = source.point(source.node(0));
  for (int axis = 0; axis < 2; ++axis) settings_.fraction[axis] = origin_[axis] - std::floor(origin_[axis]);
}

CompactFit ContourFit::as_it_was(std::string why) const {
  return {source_, 0.0, source_.point(source_.node(0)), true, std::move(why), work_, settings_.options.kept_segments};
}

// Whether a segment of the source may be written as it is.
bool ContourFit::is_admissible(int segment) const {
  const CurveKind curve = settings_.options.curve;
  const int degree = source_.degree(segment);
  if (degree == (curve == CurveKind::Cubic ? 2 : 3)) return false;
  for (int k = 0; k <= degree; ++k) {
    const int index = source_.point_of(segment, k);
    if (curve == CurveKind::Quadratic && source_.kind(index) == PointKind::ImpliedNode) continue;
    const Point p = source_.point(index) - origin_;
    if (whole(p) != p) return false;
  }
  return true;
}

// The segments that stay as they are. On whole numbers a quadratic's implied end that lies between them can be no node
// of its own: what is beyond it stays too.
void ContourFit::find_kept() {
  const CompactOptions& options = settings_.options;
  const int count = source_.segment_count();
  is_kept_.assign(at(count), 0);
  int before = -1;
  for (const int s : options.kept_segments) {
    if (s <= before || s >= count)
      throw InvalidInput(text("fit_compact: segment ", s, " is to be kept after segment ", before, " of ", count));
    if (source_.degree(s) == (options.curve == CurveKind::Cubic ? 2 : 3))
      throw InvalidInput(text("fit_compact: segment ", s, " is to be kept, and is of degree ", source_.degree(s)));
    is_kept_[at(s)] = 1;
    before = s;
  }
  const auto is_split = [&](int node) {
    const Point p = source_.point(node) - origin_;
    return source_.kind(node) == PointKind::ImpliedNode && whole(p) != p;
  };
  for (const bool forward : {true, false}) {
    for (const int kept : options.kept_segments) {
      for (int s = kept; is_split(source_.node(forward ? source_.next(s) : s));) {
        s = forward ? source_.next(s) : source_.previous(s);
        if (is_kept_[at(s)] != 0) break;
        is_kept_[at(s)] = 1;
      }
    }
  }
}

// Where the node at the start of an element is to be.
Point ContourFit::node_place(int i) const {
  const Point& start = element(i).curve.start();
  return is_beside_kept(i) ? start : whole(start);
}

void ContourFit::make_elements() {
  const CompactOptions& options = settings_.options;
  bool is_first = true;
  for (int s = 0; s < source_.segment_count(); ++s) {
    Element element;
    element.curve = source_.segment(s);
    element.is_kept = is_kept_[at(s)] != 0;
    if (is_degenerate(element.curve) && !element.is_kept) continue;
    for (Point& p : element.curve.p) p -= origin_;
    element.source = s;
    element.is_first = std::exchange(is_first, false);
    // A line needs ends on whole numbers: implied nodes stay inside curves.
    const auto is_whole = [&](const Point& p) { return whole(p) == p; };
    if (element.curve.degree > 1 && !element.is_kept && is_straight(element.curve, straightness * options.tolerance) &&
        is_whole(element.curve.start()) && is_whole(element.curve.end())) {
      element.curve.p[1] = element.curve.end();
      element.curve.degree = 1;
    }
    elements_.push_back(element);
  }
  const double run = options.straight_run * options.units_per_em;
  for (int i = 0; i < count(); ++i) {
    Element& own = elements_[at(i)];
    const Bezier& before = element(i - 1).curve;
    own.turn = std::abs(angle(end_tangent(before), start_tangent(own.curve)));
    const auto is_long_line = [&](const Bezier& b) { return b.degree == 1 && (b.end() - b.start()).norm() >= run; };
    constexpr double bend = 0.2 * degrees;  // of two straight runs
    own.is_corner =
        own.turn > options.corner_angle || is_degenerate(own.curve) || is_degenerate(before) ||
        (own.turn > bend && is_long_line(own.curve) && is_long_line(before)) ||
        std::find(options.corners.begin(), options.corners.end(), source_.node(own.source)) != options.corners.end();
  }
}

void ContourFit::merge_lines() {
  std::vector<Element> merged;
  for (const Element& own : elements_) {
    if (!merged.empty() && !own.is_corner && !own.is_first && own.curve.degree == 1 &&
        merged.back().curve.degree == 1 && !own.is_kept && !merged.back().is_kept) {
      Bezier& line = merged.back().curve;
      const Bezier both{{line.start(), line.end(), own.curve.end(), Point::Zero()}, 2};
      if (is_straight(both, straightness * settings_.options.tolerance)) {
        line.p[1] = own.curve.end();
        merged.back().sources += own.sources;
        continue;
      }
    }
    merged.push_back(own);
  }
  elements_ = std::move(merged);
}

void ContourFit::split_at_extrema() {
  std::vector<Element> parts;
  for (const Element& own : elements_) {
    std::vector<double> cuts;
    for (int axis = 0; axis < 2 && !own.is_kept; ++axis) {
      for (const double u : extrema(own.curve, axis)) {
        if (u > 0.002 && u < 0.998) cuts.push_back(u);
      }
    }
    std::sort(cuts.begin(), cuts.end());
    Element rest = own;
    double done = 0.0;
    for (const double cut : cuts) {
      const double u = (cut - done) / (1.0 - done);
      if (u < 1e-3 || u > 0.999) continue;
      done = cut;
      const auto halves = split(rest.curve, u);
      Element part = rest;
      part.curve = halves[0];
      part.sources = 0;
      parts.push_back(part);
      rest.curve = halves[1];
      rest.is_corner = rest.is_first = false;
      rest.turn = 0.0;
    }
    parts.push_back(rest);
  }
  elements_ = std::move(parts);
}

// The source's own segments, if they are of a kind that may be written.
std::optional<Result> ContourFit::originals(int from, int to) const {
  Result result;
  std::vector<Bezier>& pieces = result.pieces;
  for (int i = from; i < to; ++i) {
    const Element& own = element(i);
    if (own.is_first) result.first = static_cast<int>(pieces.size());
    const bool is_lowered = settings_.options.curve == CurveKind::Quadratic && own.curve.degree == 3;
    if (own.sources == 0 && !is_lowered) continue;  // a part: the whole comes with the last
    Bezier b = own.curve;
    if (b.degree > 1 && !is_lowered) {
      b = source_.segment(own.source);
      for (Point& p : b.p) p -= origin_;
      if (is_admissible(own.source)) {
        pieces.push_back(b);
        continue;
      }
      if (settings_.options.curve == CurveKind::Quadratic) return std::nullopt;
      if (b.degree == 2) {
        const Point q = b.p[1];
        b = {{b.p[0], (b.p[0] + 2.0 * q) / 3.0, (b.p[2] + 2.0 * q) / 3.0, b.p[2]}, 3};
      }
    }
    std::vector<Bezier> own_pieces{b};
    if (is_lowered) own_pieces = lowered_to_quadratics(b, share_of_lowering * settings_.options.tolerance);
    for (Bezier& piece : own_pieces) {
      for (int k = 0; k <= piece.degree; ++k) piece.p[at(k)] = whole(piece.p[at(k)]);
    }
    if (is_beside_kept(i)) own_pieces.front().p[0] = own.curve.start();
    if (is_beside_kept(i + 1)) own_pieces.back().p[at(own_pieces.back().degree)] = own.curve.end();
    pieces.insert(pieces.end(), own_pieces.begin(), own_pieces.end());
  }
  return result;
}

// The first node stays where it is; where nodes are free, or it is no point of the font, the nearest will do.
bool ContourFit::holds_first() const {
  return settings_.options.extrema == Extrema::Keep && source_.kind(source_.node(0)) != PointKind::ImpliedNode;
}

void ContourFit::make_first(Join& join) const {
  join.is_first = true;
  join.home = join.place = whole(join.place);
  join.slides = false;
}

// Where the stretch over elements [from, to) starts or ends, and what of that may move.
Join ContourFit::end_join(int from, int to, bool is_closed, bool is_start) const {
  const double em = settings_.options.units_per_em;
  const Element& own = is_start ? element(from) : element(to - 1);
  const Element& node = is_start ? element(from) : element(to);  // that starts at this end
  const Element& beside = is_start ? element(from - 1) : element(to);
  const int node_index = (is_start ? from : to) % count();
  Join join;
  join.place = join.home = is_start ? own.curve.start() : own.curve.end();
  join.tangent = is_start ? start_tangent(own.curve) : end_tangent(own.curve);
  join.is_first = node.is_first;
  if (is_closed) {
    make_first(join);
    join.turns = true;
    return join;
  }
  join.is_corner = node.is_corner;
  join.is_held = is_beside_kept(node_index);
  if (node.is_corner) {
    const double slack =
        1.4 / std::max(1.0, std::min(handle_length(own.curve, is_start), handle_length(beside.curve, !is_start)));
    const double turned = corner_turn_[at(node_index)];
    const double share = to - from == count() ? 0.5 : 1.0;  // its other end is the same corner
    join.turns = true;
    join.turn_low = turned - share * (corner_freedom + 0.8 * slack);
    join.turn_high = turned + share * (corner_freedom + 0.8 * slack);
    join.turn_slack = share * 0.15 * slack;
    join.home = join.place = node_place(node_index);
    return join;
  }
  // A smooth end is that of a line that stays, or of a segment that is kept.
  join.tangent = is_start ? end_tangent(beside.curve) : start_tangent(beside.curve);
  join.rail = join.tangent;
  if (join.is_held) return join;
  const auto& line = fitted_[at((is_start ? from - 1 + count() : to) % count())];
  join.has_line = true;
  join.line_end = is_start ? line.front().start() : line.back().end();
  join.slides = true;
  const int other = is_start ? from - 1 : to + 1;  // the node at the line's other end
  const bool other_smooth = !element(other).is_corner;
  // How much of the line may be taken over.
  const double room = (beside.curve.end() - beside.curve.start()).norm() * (other_smooth ? 0.5 : 1.0) * line_share;
  if (is_beside_kept(other) && element(other).turn < smooth_turn)
    join.line_tangent = is_start ? end_tangent(element(other - 1).curve) : start_tangent(element(other).curve);
  join.slide_low = is_start ? -room : -em;
  join.slide_high = is_start ? em : room;
  if (settings_.options.coordinates == Coordinates::Whole && join.rail.prod() != 0.0)
    join.least_handle = std::min(leaning_handle, 0.5 * room);
  if (node.is_first && holds_first()) make_first(join);
  return join;
}

// The elements sampled, and the lines that their ends may slide along; of the samples those that may be joins.
void ContourFit::add_samples(int from, int to, Task& task) const {
  const CompactOptions& options = settings_.options;
  const double em = options.units_per_em;
  Stretch& stretch = task.stretch;
  const auto extend = [&](const Join& join, bool is_start) {
    constexpr int samples = 4;
    if (!join.slides) return;
    const double room = is_start ? -join.slide_low : join.slide_high;
    for (int i = 1; i <= samples; ++i) {
      const double back = is_start ? samples + 1 - i : i;
      const double signed_room = (is_start ? -room : room) * back / samples;
      stretch.samples.push_back({join.place + signed_room * join.tangent, join.tangent, 0.0});
    }
  };
  if (!stretch.is_closed) extend(task.start, true);
  stretch.first = static_cast<int>(stretch.samples.size());
  std::vector<Extent> extents;
  std::vector<double> weights;
  double total = 0.0;
  double length = 0.0;
  for (int i = from; i < to; ++i) {
    extents.push_back(extent_of(element(i).curve));
    weights.push_back(extents.back().length / (sample_length * em) + extents.back().turn / sample_turn);
    total += weights.back();
    length += extents.back().length;
    stretch.source.push_back(element(i).curve);
  }
  task.is_long = options.curve == CurveKind::Cubic && total > long_stretch && length < long_segment * em * (to - from);
  const int fewest = task.is_long || static_cast<double>(to - from) * 3.0 + total > most_samples ? 1 : 3;
  const double scale = task.is_long ? 1.0 : std::min(1.0, most_samples / (total + 1.0));
  // Of many candidates those that are far enough apart.
  const bool has_many = static_cast<double>(to - from) + total * sample_turn / candidate_turn > most_candidates;
  const double least_gap = task.is_long ? candidate_turn / sample_turn : has_many ? total / most_candidates : 0.0;
  double since = never;
  for (int i = from; i < to; ++i) {
    const Bezier& b = element(i).curve;
    const auto k = at(i - from);
    const int samples = std::clamp(static_cast<int>(std::ceil(scale * weights[k])), fewest, most_samples_of_curve);
    const int begin = static_cast<int>(stretch.samples.size());
    for (int j = 0; j < samples; ++j) {
      const double u = static_cast<double>(j) / samples;
      stretch.samples.push_back({evaluate(b, u), tangent_at(b, u), 0.0});
    }
    int parts = b.degree == 1 ? 1 : std::max(1, static_cast<int>(std::round(extents[k].turn / candidate_turn)));
    if (parts == 1 && to - from < 4 && b.degree > 1) parts = 2;
    for (int j = 0; j < parts; ++j) {
      const double gap = weights[k] / parts;
      if (since >= least_gap || (i == from && j == 0)) {
        task.candidates.push_back(begin + samples * j / parts);
        since = 0.0;
      }
      since += gap;
    }
  }
  stretch.last = static_cast<int>(stretch.samples.size());
  const Bezier& final = element(to - 1).curve;
  stretch.samples.push_back({final.end(), end_tangent(final), 0.0});
  task.candidates.push_back(stretch.last);
  if (!stretch.is_closed) extend(task.end, false);
  auto& samples = stretch.samples;
  if (!stretch.is_closed) {
    if (!task.start.is_corner) samples[at(stretch.first)].tangent = task.start.tangent;
    if (!task.end.is_corner) samples[at(stretch.last)].tangent = task.end.tangent;
  }
  for (std::size_t i = 1; i < samples.size(); ++i)
    samples[i].s = samples[i - 1].s + (samples[i].place - samples[i - 1].place).norm();
}

// Joins at extrema, where the sense of the tangent along an axis changes.
void ContourFit::add_extrema(Task& task) const {
  const CompactOptions& options = settings_.options;
  const double em = options.units_per_em;
  const Stretch& stretch = task.stretch;
  const std::vector<Sample>& samples = stretch.samples;
  std::vector<Task::Must>& musts = task.musts;
  const int n = static_cast<int>(samples.size());
  constexpr double unit = 0.8;  // hardly
  const double prominence = task.is_long ? unit : std::min(options.tolerance, unit);
  for (int axis = 0; axis < 2; ++axis) {
    const auto component = [&](int i) { return samples[at(i)].tangent[axis]; };
    constexpr double none = 1e-9;
    int sense = 0;
    int since_sample = -1;
    if (stretch.is_closed) {
      for (int i = stretch.last - 1; i > 0 && sense == 0; --i) {
        if (std::abs(component(i)) > none) {
          sense = component(i) > 0.0 ? 1 : -1;
          since_sample = i - stretch.last;
        }
      }
    }
    for (int i = stretch.first; i <= stretch.last; ++i) {
      if (std::abs(component(i)) <= none) continue;
      const int own = component(i) > 0.0 ? 1 : -1;
      if (sense != 0 && own != sense) {
        int best = i;
        double least = never;
        for (int m = since_sample; m <= i; ++m) {
          const int sample = m < 0 ? m + stretch.last : m;
          if (std::abs(component(sample)) < least) {
            least = std::abs(component(sample));
            best = sample;
          }
        }
        const Sample& sample = samples[at(best)];
        const int across = 1 - axis;
        const auto leaves = [&](int step) {
          int m = best;
          for (int c = 0; c < n; ++c) {
            m += step;
            if (stretch.is_closed)
              m = (m + stretch.last) % stretch.last;
            else if (m < stretch.first || m > stretch.last)
              return false;
            if (std::abs(samples[at(m)].place[across] - sample.place[across]) > prominence) return true;
          }
          return false;
        };
        // The tangent's component along this axis vanishes: it lies along the other.
        Join join;
        join.place = join.home = sample.place;
        join.tangent = Point::Zero();
        join.tangent[across] = sample.tangent[across] > 0.0 ? 1.0 : -1.0;
        join.rail = join.tangent;
        join.slides = true;
        join.slide_low = -extremum_slide * em;
        join.slide_high = extremum_slide * em;
        bool has_height = true;
        if (task.is_long && options.coordinates == Coordinates::Whole) {
          // What lies between whole numbers by much of the tolerance can be no node of that height.
          const double height = whole(join.place)[axis];
          constexpr double share = 0.6;
          has_height = std::abs(height - join.place[axis]) < share * options.tolerance;
          join.place[axis] = join.home[axis] = height;
        }
        if (has_height && leaves(1) && leaves(-1)) {
          const bool at_end = best == stretch.first || best == stretch.last;
          if (!at_end) {
            musts.push_back({best, join});
          } else if (stretch.is_closed) {
            make_first(join);
            task.start = join;
          }
        }
      }
      sense = own;
      since_sample = i;
    }
  }
}

// The first node of a finely cut contour as near to the curve as whole numbers are.
void ContourFit::bring_start_near(Task& task) const {
  const CompactOptions& options = settings_.options;
  const Stretch& stretch = task.stretch;
  const std::vector<Sample>& samples = stretch.samples;
  const Sample& own = samples[at(stretch.first)];
  const Point off = task.start.place - own.place;
  constexpr double share = 0.5;
  if (std::abs(cross(own.tangent, off)) > share * options.tolerance) {
    std::vector<Point> near;
    constexpr double reach = 4.0;
    for (int i = stretch.last - 1; i > 0 && (samples[at(i)].place - own.place).norm() < reach; --i)
      near.insert(near.begin(), samples[at(i)].place);
    for (int i = stretch.first; i < stretch.last && (samples[at(i)].place - own.place).norm() < reach; ++i)
      near.push_back(samples[at(i)].place);
    task.start.place = task.start.home = whole_near(settings_, own.place, near);
    task.start.tangent = own.tangent;
    task.start.turns = true;
  }
}

// A join at the contour's first node, if that is within the stretch.
void ContourFit::add_first_node(int from, int to, Task& task) const {
  const Stretch& stretch = task.stretch;
  const std::vector<Sample>& samples = stretch.samples;
  std::vector<Task::Must>& musts = task.musts;
  for (int i = stretch.is_closed ? from : from + 1; i < to; ++i) {
    if (element(i).is_first) task.first = element(i).curve.start();
  }
  for (int i = from + 1; i < to; ++i) {
    if (!element(i).is_first || !holds_first()) continue;
    int sample = stretch.first;
    for (int m = stretch.first; m < stretch.last; ++m) {
      if (samples[at(m)].place == element(i).curve.start()) sample = m;
    }
    const auto known =
        std::find_if(musts.begin(), musts.end(), [&](const Task::Must& must) { return must.sample == sample; });
    if (known != musts.end()) {
      make_first(known->join);
    } else {
      Join join;
      join.place = join.home = samples[at(sample)].place;
      join.tangent = samples[at(sample)].tangent;
      make_first(join);
      join.turns = true;
      musts.push_back({sample, join});
    }
  }
}

// The joins there have to be in order, each once and a candidate too.
void ContourFit::sort_musts(Task& task) const {
  const CompactOptions& options = settings_.options;
  const Stretch& stretch = task.stretch;
  const std::vector<Sample>& samples = stretch.samples;
  std::vector<Task::Must>& musts = task.musts;
  std::sort(musts.begin(), musts.end(), [](const Task::Must& a, const Task::Must& b) { return a.sample < b.sample; });
  for (std::size_t i = 1; i < musts.size();) {
    i = musts[i].sample == musts[i - 1].sample
            ? static_cast<std::size_t>(musts.erase(musts.begin() + static_cast<long>(i)) - musts.begin())
            : i + 1;
  }
  if (task.is_long && options.coordinates == Coordinates::Whole) {
    // Nodes so near to each other have no handles on whole numbers.
    constexpr double near = 6.0;
    const auto is_near_end = [&](int sample) {
      const Point& place = samples[at(sample)].place;
      return (place - task.start.place).norm() < near || (!stretch.is_closed && (place - task.end.place).norm() < near);
    };
    std::vector<Task::Must> apart;
    for (const Task::Must& must : musts) {
      const Point& place = must.join.place;
      if (!is_near_end(must.sample) && (apart.empty() || (place - apart.back().join.place).norm() >= near))
        apart.push_back(must);
    }
    musts = std::move(apart);
    std::erase_if(task.candidates,
                  [&](int sample) { return sample != stretch.first && sample != stretch.last && is_near_end(sample); });
  }
  for (const Task::Must& must : musts) task.candidates.push_back(must.sample);
  if (options.curve == CurveKind::Quadratic) {  // one alone seldom joins two such tangents
    for (std::size_t i = 0; i <= musts.size(); ++i) {
      const int a = i == 0 ? stretch.first : musts[i - 1].sample;
      const int b = i == musts.size() ? stretch.last : musts[i].sample;
      task.candidates.push_back((a + b) / 2);
    }
  }
  std::sort(task.candidates.begin(), task.candidates.end());
  task.candidates.erase(std::unique(task.candidates.begin(), task.candidates.end()), task.candidates.end());
}

int ContourFit::most_pieces(int from, int to) const {
  const CompactOptions& options = settings_.options;
  int segments = 0;
  bool is_admissible_as_is = true;
  bool has_cubic = false;
  for (int i = from; i < to; ++i) {
    segments += element(i).sources;
    is_admissible_as_is = is_admissible_as_is && (element(i).curve.degree == 1 || is_admissible(element(i).source));
    has_cubic = has_cubic || element(i).curve.degree == 3;
  }
  // What cannot be written as it is may have to be more: quadratics for cubics, or curves between whole numbers where a
  // unit is more than the tolerance.
  constexpr int quadratics_for_cubic = 8;
  return options.curve == CurveKind::Quadratic && has_cubic ? quadratics_for_cubic * segments
         : is_admissible_as_is                              ? segments - 1
         : options.tolerance < 1.0                          ? 2 * segments
                                                            : segments;
}

// The stretch over elements [from, to).
Task ContourFit::task_of(int from, int to) const {
  Task task;
  Stretch& stretch = task.stretch;
  stretch.is_closed = to - from == count() && !element(from).is_corner;
  task.start = end_join(from, to, stretch.is_closed, true);
  if (!stretch.is_closed) task.end = end_join(from, to, stretch.is_closed, false);
  add_samples(from, to, task);
  task.rotates = stretch.is_closed && !holds_first();
  if (settings_.options.extrema == Extrema::Keep) add_extrema(task);
  if (task.is_long && stretch.is_closed && holds_first()) bring_start_near(task);
  add_first_node(from, to, task);
  sort_musts(task);

  std::vector<Sample>& samples = stretch.samples;
  for (int m = 1; stretch.is_closed && m <= stretch.last; ++m) {
    Sample again = samples[at(m)];
    again.s += samples[at(stretch.last)].s;
    samples.push_back(again);
  }

  if (stretch.first > 0) stretch.polyline.push_back(samples.front().place);
  for (const Bezier& b : stretch.source)
    add_polyline(b, polyline_sagitta * settings_.options.tolerance, 6, stretch.polyline);
  stretch.polyline.push_back(element(to - 1).curve.end());
  if (!stretch.is_closed && stretch.last + 1 < static_cast<int>(samples.size()))
    stretch.polyline.push_back(samples.back().place);
  task.most_pieces = most_pieces(from, to);
  return task;
}

// The contour of pieces; those that are segments of the source, unless that is -1, have its points and kinds.
BezierContour ContourFit::contour_of(const std::vector<Bezier>& pieces, const std::vector<int>& segment) const {
  std::optional<Point> implied_first;
  Points points(static_cast<Eigen::Index>(4 * pieces.size()), 2);
  std::vector<PointKind> kinds;
  const auto add = [&](const Point& p, PointKind kind) {
    points.row(static_cast<Eigen::Index>(kinds.size())) = p.transpose();
    kinds.push_back(kind);
  };
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const Bezier& b = pieces[i];
    const std::size_t previous = i == 0 ? pieces.size() - 1 : i - 1;
    const Bezier& before = pieces[previous];
    const int own = segment[i];
    const int own_before = segment[previous];
    // What is kept has the source's bits, its ends too; between two that are, an implied node stays one.
    const int node = own >= 0 ? source_.node(own) : own_before >= 0 ? source_.point_of(own_before, before.degree) : -1;
    const bool is_middle = b.degree == 2 && before.degree == 2 && b.start() == 0.5 * (before.p[1] + b.p[1]);
    // The first node is one of its own if it can be: where a list begins with a handle, readers begin elsewhere.
    const bool is_implied = node < 0 ? is_middle && (i > 0 || whole(b.start()) != b.start())
                                     : own >= 0 && own_before >= 0 && source_.next(own_before) == own &&
                                           source_.kind(node) == PointKind::ImpliedNode;
    const Point start = node < 0 ? Point(b.start() + origin_) : source_.point(node);
    if (is_implied && i == 0) {
      implied_first = start;
    } else {
      add(start, is_implied ? PointKind::ImpliedNode : PointKind::Node);
    }
    for (int k = 1; k < b.degree; ++k) {
      add(own < 0 ? Point(b.p[at(k)] + origin_) : source_.point(source_.point_of(own, k)),
          b.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
  }
  if (implied_first) add(*implied_first, PointKind::ImpliedNode);
  points.conservativeResize(static_cast<Eigen::Index>(kinds.size()), 2);
  return BezierContour(std::move(points), std::move(kinds));
}

CompactFit ContourFit::run() {
  const CompactOptions& options = settings_.options;
  find_kept();
  const bool keeps_all = std::find(is_kept_.begin(), is_kept_.end(), 0) == is_kept_.end();
  if (options.tolerance == 0.0 || keeps_all) return as_it_was();
  make_elements();
  if (count() < 2) return as_it_was();
  merge_lines();
  if (options.extrema == Extrema::Keep) split_at_extrema();
  const double run = options.straight_run * options.units_per_em;
  for (int i = 0; i < count(); ++i) {
    Element& own = elements_[at(i)];
    own.is_line = !own.is_kept && own.curve.degree == 1 &&
                  ((own.curve.end() - own.curve.start()).norm() >= run || (own.is_corner && element(i + 1).is_corner));
  }
  corner_turn_.assign(at(count()), 0.0);
  fitted_.assign(at(count()), {});
  first_piece_.assign(at(count()), -1);

  // Begin at a break: a corner, an end of a line that stays or of what is kept, else the first node.
  int begin = 0;
  const auto breaks_at = [&](int i) {
    return element(i).is_corner || element(i).is_line || element(i - 1).is_line || is_beside_kept(i);
  };
  while (begin < count() && !breaks_at(begin)) ++begin;
  const bool is_whole = begin == count();
  if (is_whole) begin = 0;
  for (int i = 0; i < count(); ++i) {
    if (element(i).is_line) {
      fitted_[at(i)] = {{{node_place(i), node_place(i + 1), Point::Zero(), Point::Zero()}, 1}};
    } else if (element(i).is_kept) {
      fitted_[at(i)] = {element(i).curve};
    }
  }
  int written = 0;
  for (int from = begin; from < begin + count();) {
    const int index = from % count();
    if (element(from).is_line || element(from).is_kept) {
      ++from;
      ++written;
      continue;
    }
    int to = from + 1;
    while (to < begin + count() && (is_whole || !breaks_at(to))) ++to;
    auto& pieces = fitted_[at(index)];
    Task task = task_of(from, to);
    std::optional<Result> result;
    if (task.most_pieces >= 1) result = search(task, settings_, work_);
    const bool is_found = result.has_value();
    if (!result) result = originals(from, to);
    if (!result) {
      return as_it_was(work_ > settings_.most_work ? too_much_work
                                                   : "no quadratics were found that stay within the tolerance");
    }
    pieces = std::move(result->pieces);
    first_piece_[at(index)] = result->first;
    if (is_found) {
      if (task.start.is_corner) corner_turn_[at(index)] = result->start_turn;
      if (task.end.is_corner) corner_turn_[at(to % count())] = result->end_turn;
      const bool is_open = !task.stretch.is_closed;
      if (is_open && task.start.slides)
        fitted_[at((from - 1 + count()) % count())].back().p[1] = pieces.front().start();
      if (is_open && task.end.slides) fitted_[at(to % count())].front().p[0] = pieces.back().end();
    }
    written += static_cast<int>(pieces.size());
    from = to;
  }

  // From the first node on.
  std::vector<Bezier> out;
  std::vector<int> segment;  // of the source, where it is kept
  int first = 0;
  for (int from = begin; from < begin + count(); ++from) {
    const auto& pieces = fitted_[at(from % count())];
    if (pieces.empty()) continue;  // within a stretch that began before
    const int own = element(from).is_first ? 0 : first_piece_[at(from % count())];
    if (own >= 0) first = static_cast<int>(out.size()) + own;
    out.insert(out.end(), pieces.begin(), pieces.end());
    segment.resize(out.size(), element(from).is_kept ? element(from).source : -1);
  }
  first %= static_cast<int>(out.size());
  std::rotate(out.begin(), out.begin() + first, out.end());
  std::rotate(segment.begin(), segment.begin() + first, segment.end());
  bool is_admissible_as_is = true;
  for (int s = 0; s < source_.segment_count(); ++s) is_admissible_as_is = is_admissible_as_is && is_admissible(s);
  const std::string why = work_ > settings_.most_work ? too_much_work : std::string();
  if (is_admissible_as_is && written >= source_.segment_count()) return as_it_was(why);

  CompactFit fit;
  fit.contour = contour_of(out, segment);
  fit.work = work_;
  fit.why = why;
  for (const int kept : options.kept_segments)
    fit.kept_at.push_back(static_cast<int>(std::ranges::find(segment, kept) - segment.begin()));
  const auto [deviation, where] = farthest(source_, fit.contour, measuring_accuracy * options.tolerance);
  fit.deviation = deviation;
  fit.where = where;
  return fit;
}

}  // namespace

}  // namespace compact

CompactFit fit_compact(const BezierContour& source, const CompactOptions& options) {
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance))
    throw InvalidInput(text("fit_compact: the tolerance is ", options.tolerance));
  if (!(options.units_per_em > 0.0))
    throw InvalidInput(text("fit_compact: the em is ", options.units_per_em, " units"));
  CompactFit fit;
  CompactOptions aimed = options;
  for (const double share : {1.0, 0.9, 0.7}) {  // what was missed between the places looked at
    aimed.tolerance = share * options.tolerance;
    fit = compact::ContourFit(source, aimed).run();
    if (fit.deviation <= (1.0 - compact::measuring_accuracy) * options.tolerance) return fit;
  }
  if (fit.why.empty()) fit.why = text("it is ", fit.deviation, " units off");
  return fit;
}

}  // namespace fontcore
