#include "fontcore/character.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fontcore/analogy.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"

namespace fontcore {

namespace {

using Eigen::Index;

// What is shorter than this share of the scale is rounding, not detail.
constexpr double nothing = 1e-5;
// Of the length of features that are looked at, the distance of the curve's own points.
constexpr double coarsest_step = 1.0 / 64.0;
constexpr Index most_points = 20000;
constexpr double own_fade = 1.0 / 32.0;  // of the scale: room for the last of it to become nothing
// How far a cubic may be from the points between its ends, as a share of the scale.
constexpr double thinning = 1e-4;
constexpr Index longest_piece = 16;  // in points
// Of the largest displacement, or of the scale, what the area's correction may add inside the detail's own space.
constexpr double room_for_area = 0.25;
constexpr double least_room_for_area = 0.002;
// Where there is detail to lay the base moves by no more than this, em, or the outline stays.
constexpr double most_base_move = 5e-5;

// One arc with what is laid on it.
struct Dressed {
  int arc = 0;
  double step = 0.0;  // arc length of the outline between points
  bool is_closed = false;
  Points points;
  Points displacement;
  Eigen::VectorXd mask;
  std::optional<DetailBase> base;

  bool is_bare() const { return displacement.size() == 0 || displacement.isZero(0.0); }
};

// From 0 at no distance to 1 at the fade's.
double faded(double distance, double fade) {
  return distance >= fade ? 1.0 : 0.5 - 0.5 * std::cos(std::numbers::pi * std::max(distance, 0.0) / fade);
}

std::uint64_t mixed(std::uint64_t seed, std::uint64_t with) {
  std::uint64_t z = seed ^ (with + 0x9E3779B97F4A7C15U + (seed << 6U) + (seed >> 2U));
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  return z ^ (z >> 31U);
}

class Dresser {
 public:
  Dresser(const OutlineArcs& outline, const DetailLibrary& library, const CharacterOptions& options)
      : outline_(outline),
        contour_(outline.contour()),
        library_(library),
        options_(options),
        scale_(library.scale * options.unit),
        is_held_(contour_.kinds().size(), false) {
    if (library.samples.empty()) throw InvalidInput("apply_detail: a library without samples");
    if (!(scale_ > 0.0) || !std::isfinite(scale_) || !std::isfinite(options.gain) || !std::isfinite(options.finest) ||
        !std::isfinite(options.amount)) {
      throw InvalidInput(text("apply_detail: scale ", scale_, ", gain ", options.gain, ", finest ", options.finest));
    }
    for (const int point : options.held) is_held_.at(static_cast<std::size_t>(point)) = true;
    step_ = scale_ * coarsest_step;
    for (const DetailSample& sample : library.samples) {
      if (sample.offsets.rows() < 4 || !(sample.length > 0.0)) {
        throw InvalidInput(text("apply_detail: a sample of ", sample.offsets.rows(), " steps over ", sample.length));
      }
      step_ = std::min(step_, options.unit * sample.length / static_cast<double>(sample.offsets.rows()));
    }
  }

  Character run() {
    Character result;
    for (int k = 0; k < static_cast<int>(outline_.arcs().size()); ++k) {
      const bool is_long = outline_.arcs()[static_cast<std::size_t>(k)].length >= scale_;
      dressed_.push_back(is_long ? dress(k) : Dressed{.arc = k});
    }
    const auto is_bare = [](const Dressed& arc) { return arc.is_bare(); };
    parts_ = all_parts();
    if (options_.area && !std::ranges::all_of(dressed_, is_bare)) result.area_failed = give_area_back();
    for (const Dressed& arc : dressed_) {
      if (arc.displacement.size() == 0) ++result.too_short;
      if (arc.is_bare()) continue;
      ++result.arcs;
      result.base_move = std::max(result.base_move, arc.base->base_move(arc.displacement));
      result.largest = std::max(result.largest, arc.displacement.rowwise().norm().maxCoeff());
    }
    write(result);
    return result;
  }

 private:
  // What stays on an arc: places from its start, as stretches.
  std::vector<std::pair<double, double>> held_on(const OutlineArcs::Arc& arc) const {
    std::vector<std::pair<double, double>> held;
    for (std::size_t k = 0; k < arc.segments.size(); ++k) {
      const int s = arc.segments[k];
      const double start = arc.offsets[k];
      const double end = start + outline_.along(s).length();
      if (is_held(contour_.node(s))) held.emplace_back(start, start);
      if (is_held(contour_.point_of(s, contour_.degree(s)))) held.emplace_back(end, end);
      bool all = contour_.degree(s) == 1 && is_held(contour_.node(s)) && is_held(contour_.point_of(s, 1));
      for (int i = 1; i < contour_.degree(s); ++i) all = all || is_held(contour_.point_of(s, i));
      const bool is_spared = options_.spares_lines && contour_.degree(s) == 1 && end - start > 0.5 * scale_;
      if (all || is_spared) held.emplace_back(start, end);
      const bool is_join = contour_.kind(contour_.node(s)) == PointKind::Node && !outline_.is_corner(s);
      if (options_.holds_joins && is_join) held.emplace_back(start, start);
    }
    if (outline_.has_corner()) {
      held.emplace_back(0.0, 0.0);
      held.emplace_back(arc.length, arc.length);
    }
    return held;
  }
  std::string place_of(int arc) const { return options_.place.empty() ? "" : text(options_.place, "/", arc); }
  bool is_held(int point) const { return is_held_[static_cast<std::size_t>(point)]; }

  Dressed dress(int index) const {
    const OutlineArcs::Arc& arc = outline_.arcs()[static_cast<std::size_t>(index)];
    Dressed dressed{.arc = index};
    dressed.is_closed = !outline_.has_corner();
    Index count = std::clamp<Index>(static_cast<Index>(std::min(std::ceil(arc.length / step_), 1e9)), 32, most_points);
    // An arc that detail was taken from is looked at where it was then.
    const auto own = options_.place.empty()
                         ? library_.samples.end()
                         : std::ranges::find(library_.samples, place_of(index), &DetailSample::place);
    const bool is_own = own != library_.samples.end();
    if (is_own) count = own->offsets.rows();
    dressed.step = arc.length / static_cast<double>(dressed.is_closed ? count : count - 1);
    dressed.points = points_along(outline_, index, count);
    const DetailBase& base = dressed.base.emplace(dressed.points, dressed.is_closed, scale_);

    const auto held = held_on(arc);
    // A difference learnt at this very place comes to nothing at the corners by itself.
    const bool has_faded = options_.adds && is_own;
    dressed.mask = Eigen::VectorXd::Ones(count);
    for (Index i = 0; i < count; ++i) {
      const double s = static_cast<double>(i) * dressed.step;
      for (const auto& [from, to] : held) {
        double distance = std::max({from - s, s - to, 0.0});
        if (dressed.is_closed) {
          distance = std::min({distance, std::max(from - s + arc.length, 0.0), std::max(s + arc.length - to, 0.0)});
        }
        const bool is_end = !dressed.is_closed && (to == 0.0 || from == arc.length);
        const double fade = has_faded && is_end ? own_fade * scale_ : 0.5 * scale_;
        // At the next point too, so that nothing between the points reaches into what is held.
        dressed.mask[i] = std::min(dressed.mask[i], faded(distance - dressed.step, fade));
      }
      for (const Point& place : options_.quiet) {
        const double distance = (dressed.points.row(i).transpose() - place).norm();
        dressed.mask[i] *= faded(distance - 0.25 * scale_, 0.25 * scale_);
      }
    }
    if (dressed.mask.isZero(0.0)) return dressed;

    Points wish = laid(index, base);
    if (!options_.adds) wish -= dressed.points - base.points();
    dressed.displacement = options_.amount * base.detail_part(wish, dressed.mask);
    if (dressed.displacement.rowwise().norm().maxCoeff() < nothing * scale_) dressed.displacement.setZero();
    return dressed;
  }

  // The library's detail along an arc, in the outline's own directions.
  Points laid(int index, const DetailBase& base) const {
    if (options_.gain == 0.0) return Points::Zero(base.points().rows(), 2);
    const bool is_reversed = options_.ink == InkSide::Right;
    DetailBed bed{base.length() / options_.unit, base.is_closed(), {}, {}};
    bed.place = place_of(index);
    if (library_.by_shape) bed.shape = shape_of(base);
    Eigen::VectorXd places = base.places() / options_.unit;
    if (is_reversed) places = (bed.length - places.array()).matrix();
    const auto seed = mixed(options_.seed, static_cast<std::uint64_t>(index));
    const Points offsets = library_.by_shape ? lay_by_shape(library_, bed, places)
                                             : lay_detail(library_, bed, seed, options_.mirrors, places);
    Points result = options_.gain * options_.unit * offsets;
    if (library_.frame != DetailFrame::Fixed) {
      for (Index i = 0; i < result.rows(); ++i) {
        const Eigen::RowVector2d t = (is_reversed ? -1.0 : 1.0) * base.tangents().row(i);
        result.row(i) = result(i, 0) * t + result(i, 1) * Eigen::RowVector2d(t.y(), -t.x());
      }
    }
    return options_.finest > 0.0 ? base.without_features_below(options_.finest, result) : result;
  }
  // The base's shape in the direction that has the ink on its left, in the library's units.
  Points shape_of(const DetailBase& base) const {
    Points shape = base.shape();
    shape.col(1) *= options_.unit;
    if (options_.ink == InkSide::Left) return shape;
    const Index turned = shape.rows() - (base.is_closed() ? 1 : 0);
    shape.bottomRows(turned) = shape.bottomRows(turned).colwise().reverse().eval();
    shape.col(0).array() += std::numbers::pi;
    shape.col(1) *= -1.0;
    return shape;
  }

  // A part of the new contour: a segment of the source, or a cubic between two places of an arc.
  struct Part {
    int arc = 0;
    int segment = -1;    // that is kept
    int starts_at = -1;  // the node of the source that the cubic starts at, if it does and that stays
    double from = 0.0;   // arc length from the arc's start
    double to = 0.0;
    bool is_first = false;  // starts where the source does
  };
  using Displacements = std::vector<Points>;  // one for every arc; none of what is bare

  // Displacement and its derivative by arc length, where the points are and between them.
  struct Shift {
    Point by = Point::Zero();
    Point slope = Point::Zero();
  };
  static Point slope_at(const Dressed& arc, const Points& d, Index i) {
    const Index n = d.rows();
    const auto at = [&](Index k) -> Point {
      if (arc.is_closed) return d.row((k % n + n) % n).transpose();
      return k < 0 || k >= n ? Point(Point::Zero()) : Point(d.row(k).transpose());
    };
    return (8.0 * (at(i + 1) - at(i - 1)) - (at(i + 2) - at(i - 2))) / (12.0 * arc.step);
  }
  static Shift shift_at(const Dressed& arc, const Points& d, double s) {
    const Index n = d.rows();
    const double x = s / arc.step;
    auto i = static_cast<Index>(std::floor(x + 1e-9));
    if (!arc.is_closed && i >= n - 1) return {};
    const double u = std::max(0.0, x - static_cast<double>(i));
    const Index a = i % n;
    const Index b = (i + 1) % n;
    const Point slope = slope_at(arc, d, a);
    if (u < 1e-8) return {d.row(a).transpose(), slope};
    const Point end_slope = slope_at(arc, d, b);
    const Point p = d.row(a).transpose();
    const Point q = d.row(b).transpose();
    const Point m = arc.step * slope;
    const Point o = arc.step * end_slope;
    const Point c2 = 3.0 * (q - p) - 2.0 * m - o;
    const Point c3 = 2.0 * (p - q) + m + o;
    return {p + u * (m + u * (c2 + u * c3)), (m + u * (2.0 * c2 + 3.0 * u * c3)) / arc.step};
  }

  // A place on the new outline, and its derivative by arc length; `side` says which way a place on a node looks.
  struct Moved {
    Point at = Point::Zero();
    Point slope = Point::Zero();
  };
  Moved moved_at(const Dressed& arc, const Points& d, double s, double side) const {
    const double length = outline_.arcs()[static_cast<std::size_t>(arc.arc)].length;
    const double look = std::clamp(s + side * 1e-7 * length, 0.0, length * (1.0 - 1e-12));
    const auto [segment, u] = outline_.locate(arc.arc, look);
    const Bezier bezier = contour_.segment(segment);
    const Point along = derivative(bezier, u);
    const double speed = along.norm();
    const Point tangent = speed > 1e-9 ? Point(along / speed) : start_tangent(bezier);
    const Shift shift = shift_at(arc, d, s);
    return {evaluate(bezier, u) - side * 1e-7 * length * tangent + shift.by, tangent + shift.slope};
  }

  // Which of an arc's segments the displacement does not touch.
  std::vector<bool> untouched(const Dressed& dressed) const {
    const OutlineArcs::Arc& arc = outline_.arcs()[static_cast<std::size_t>(dressed.arc)];
    const std::size_t count = arc.segments.size();
    std::vector<bool> is_kept(count, true);
    if (dressed.is_bare()) return is_kept;
    const Points& d = dressed.displacement;
    const Index n = d.rows();
    std::size_t k = 0;
    for (Index i = 0; i < (dressed.is_closed ? n : n - 1); ++i) {
      if (d.row(i).isZero(0.0) && d.row((i + 1) % n).isZero(0.0)) continue;
      const double from = static_cast<double>(i) * dressed.step;
      while (k + 1 < count && arc.offsets[k + 1] <= from) ++k;
      for (std::size_t on = k; on < count && arc.offsets[on] < from + dressed.step; ++on) is_kept[on] = false;
    }
    // An implied node is one only between two segments that stay.
    const auto is_implied = [&](std::size_t on) {
      return contour_.kind(contour_.node(arc.segments[on])) == PointKind::ImpliedNode;
    };
    for (bool again = true; again;) {
      again = false;
      for (std::size_t on = dressed.is_closed ? 0 : 1; on < count; ++on) {
        const std::size_t before = (on + count - 1) % count;
        if (is_kept[on] == is_kept[before] || !is_implied(on)) continue;
        is_kept[on] = is_kept[before] = false;
        again = true;
      }
    }
    return is_kept;
  }

  // The parts of one arc: segments that stay, and cubics as long as they follow the displaced points.
  void lay_out(const Dressed& dressed, std::vector<Part>& parts) const {
    const OutlineArcs::Arc& arc = outline_.arcs()[static_cast<std::size_t>(dressed.arc)];
    const std::size_t count = arc.segments.size();
    const std::vector<bool> is_kept = untouched(dressed);
    const bool all_new = std::ranges::find(is_kept, true) == is_kept.end();
    for (std::size_t k = 0; k < count;) {
      const int s = arc.segments[k];
      if (is_kept[k]) {
        parts.push_back({dressed.arc, s, -1, 0.0, 0.0, s == 0});
        ++k;
        continue;
      }
      // Nodes that a cubic must end at: those of what stays beyond, those that are held, the source's first.
      std::vector<Knot> forced;
      for (; k < count && !is_kept[k]; ++k) {
        const int node = contour_.node(arc.segments[k]);
        const bool is_first = arc.segments[k] == 0;
        const bool stays = is_held(node) || (forced.empty() && !(dressed.is_closed && all_new));
        if (is_first || stays || forced.empty()) forced.push_back({arc.offsets[k], true, is_first, stays ? node : -1});
      }
      const double to = k < count ? arc.offsets[k] : arc.length;
      forced.push_back({to, true});
      std::vector<Knot> knots = {forced[0]};
      for (std::size_t f = 1; f < forced.size(); ++f) {
        const double until = forced[f].at - 0.25 * dressed.step;
        for (auto i = static_cast<Index>(std::ceil(knots.back().at / dressed.step + 0.25));
             static_cast<double>(i) * dressed.step < until; ++i) {
          knots.push_back({static_cast<double>(i) * dressed.step});
        }
        knots.push_back(forced[f]);
      }
      cut(dressed, knots, parts);
    }
  }
  // A place where a cubic may end; where it must, the node of the source that is there and stays, or none.
  struct Knot {
    double at = 0.0;
    bool is_forced = false;
    bool is_first = false;  // where the source starts
    int node = -1;
  };
  void cut(const Dressed& dressed, const std::vector<Knot>& knots, std::vector<Part>& parts) const {
    const std::size_t n = knots.size();
    std::vector<Moved> before(n);  // looking back, and forward
    std::vector<Moved> after(n);
    for (std::size_t i = 0; i < n; ++i) {
      before[i] = moved_at(dressed, dressed.displacement, knots[i].at, i == 0 ? 1.0 : -1.0);
      after[i] = moved_at(dressed, dressed.displacement, knots[i].at, i + 1 == n ? -1.0 : 1.0);
    }
    const auto follows = [&](std::size_t i, std::size_t j) {
      const double run = knots[j].at - knots[i].at;
      for (std::size_t k = i + 1; k < j; ++k) {
        if (knots[k].is_forced) return false;
        const double u = (knots[k].at - knots[i].at) / run;
        const double v = 1.0 - u;
        const Point on = v * v * (1.0 + 2.0 * u) * after[i].at + u * u * (3.0 - 2.0 * u) * before[j].at +
                         run * u * v * (v * after[i].slope - u * before[j].slope);
        if ((on - after[k].at).norm() > thinning * scale_) return false;
      }
      return true;
    };
    for (std::size_t i = 0; i + 1 < n;) {
      std::size_t j = std::min(n - 1, i + static_cast<std::size_t>(longest_piece));
      while (j > i + 1 && !follows(i, j)) j = i + (j - i) / 2;
      parts.push_back({dressed.arc, -1, knots[i].node, knots[i].at, knots[j].at, knots[i].is_first});
      i = j;
    }
  }

  BezierContour built(const Displacements& displacements, Character* result) const {
    std::vector<Point> points;
    std::vector<PointKind> kinds;
    std::vector<int> came_from;
    std::vector<int> kept;
    const auto add = [&](const Point& point, PointKind kind, int from) {
      points.push_back(point);
      kinds.push_back(kind);
      came_from.push_back(from);
    };
    int segment = 0;
    for (const Part& part : parts_) {
      if (part.segment >= 0) {
        for (int i = 0; i < contour_.degree(part.segment); ++i) {
          const int index = contour_.point_of(part.segment, i);
          add(contour_.point(index), contour_.kind(index), index);
        }
        kept.push_back(segment++);
        continue;
      }
      const Dressed& arc = dressed_[static_cast<std::size_t>(part.arc)];
      const Points& d = displacements[static_cast<std::size_t>(part.arc)];
      const Moved from = moved_at(arc, d, part.from, 1.0);
      const Moved to = moved_at(arc, d, part.to, -1.0);
      const double third = (part.to - part.from) / 3.0;
      if (part.starts_at >= 0) {
        add(contour_.point(part.starts_at), PointKind::Node, part.starts_at);
      } else {
        add(from.at, PointKind::Node, -1);
      }
      add(from.at + third * from.slope, PointKind::Cubic, -1);
      add(to.at - third * to.slope, PointKind::Cubic, -1);
      ++segment;
    }
    Points all(static_cast<Index>(points.size()), 2);
    for (std::size_t i = 0; i < points.size(); ++i) all.row(static_cast<Index>(i)) = points[i].transpose();
    if (result != nullptr) {
      result->came_from = std::move(came_from);
      result->kept = std::move(kept);
    }
    return {std::move(all), std::move(kinds)};
  }

  std::vector<Part> all_parts() const {
    std::vector<Part> parts;
    for (const Dressed& dressed : dressed_) lay_out(dressed, parts);
    const auto first = std::ranges::find(parts, true, &Part::is_first);
    if (first != parts.end()) std::rotate(parts.begin(), first, parts.end());
    return parts;
  }

  void write(Character& result) const {
    if (result.arcs == 0) {
      result.contour = contour_;
      for (int i = 0; i < contour_.point_count(); ++i) result.came_from.push_back(i);
      for (int s = 0; s < contour_.segment_count(); ++s) result.kept.push_back(s);
      return;
    }
    result.contour = built(displacements(), &result);
  }
  Displacements displacements() const {
    Displacements all;
    for (const Dressed& dressed : dressed_) all.push_back(dressed.displacement);
    return all;
  }

  // Adds to the displacements what gives the contour its area: along the area's gradient within the detail's space,
  // or if that is not enough along the normals. The area is exactly quadratic along either.
  std::string give_area_back() {
    const Displacements now = displacements();
    double largest = 0.0;
    for (const Dressed& arc : dressed_) {
      if (!arc.is_bare()) largest = std::max(largest, arc.displacement.rowwise().norm().maxCoeff());
    }
    const double area = signed_area(built(now, nullptr));
    const auto correct = [&](const Displacements& along, double room) {
      double size = 0.0;
      for (const Points& v : along) {
        if (v.size() > 0) size = std::max(size, v.rowwise().norm().maxCoeff());
      }
      if (!(size > 0.0)) return false;
      const auto area_at = [&](double t) {
        Displacements tried = now;
        for (std::size_t k = 0; k < tried.size(); ++k) {
          if (along[k].size() > 0) tried[k] += (t / size) * along[k];
        }
        return signed_area(built(tried, nullptr));
      };
      const double forward = area_at(1.0) - area;
      const double back = area_at(-1.0) - area;
      double slope = 0.5 * (forward - back);
      const double bend = 0.5 * (forward + back);
      const double sign = slope < 0.0 ? -1.0 : 1.0;
      const std::optional<double> root = area_root(*options_.area - area, sign * slope, bend);
      if (!root || std::abs(*root) > room) return false;
      for (std::size_t k = 0; k < along.size(); ++k) {
        if (along[k].size() > 0) dressed_[k].displacement += (sign * *root / size) * along[k];
      }
      return true;
    };
    Displacements inside(dressed_.size());
    Displacements normal(dressed_.size());
    for (std::size_t k = 0; k < dressed_.size(); ++k) {
      const Dressed& arc = dressed_[k];
      if (arc.is_bare()) continue;
      const Index n = arc.points.rows();
      Points gradient(n, 2);
      normal[k].resize(n, 2);
      for (Index i = 0; i < n; ++i) {
        const Eigen::RowVector2d t = arc.base->tangents().row(i);
        normal[k].row(i) = arc.mask[i] * Eigen::RowVector2d(t.y(), -t.x());
        const Moved moved = moved_at(arc, arc.displacement, static_cast<double>(i) * arc.step, i == 0 ? 1.0 : -1.0);
        gradient.row(i) = Eigen::RowVector2d(moved.slope.y(), -moved.slope.x());
      }
      inside[k] = arc.base->detail_part(gradient, arc.mask);
    }
    if (correct(inside, std::max(room_for_area * largest, least_room_for_area * scale_))) return {};
    const double em = library_.units_per_em * options_.unit;
    if (correct(normal, takes_only() ? 0.25 * scale_ : most_base_move * em)) return {};
    if (!takes_only()) {
      // Too little of the outline can move: it stays.
      for (Dressed& arc : dressed_) arc.displacement.setZero();
      return {};
    }
    return text("the area would need ", *options_.area - area, " square units more than what may move can give");
  }

  // Whether detail goes and none comes: then the base alone can give the area back.
  bool takes_only() const { return options_.gain == 0.0; }

  const OutlineArcs& outline_;
  const BezierContour& contour_;
  const DetailLibrary& library_;
  const CharacterOptions& options_;
  const double scale_;
  double step_ = 0.0;
  std::vector<bool> is_held_;
  std::vector<Dressed> dressed_;
  std::vector<Part> parts_;  // chosen before the area is given back, so that it is quadratic in what gives it
};

}  // namespace

Character apply_detail(const OutlineArcs& outline, const DetailLibrary& library, const CharacterOptions& options) {
  return Dresser(outline, library, options).run();
}

}  // namespace fontcore
