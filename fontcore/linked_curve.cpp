#include "fontcore/linked_curve.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>

#include "fontcore/crossing.h"
#include "fontcore/degree.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"

namespace fontcore {

namespace {

/// Two parameters nearer to each other than this are one.
constexpr double same_t = 1e-12;
/// Corners and held places that one means by t, typed or computed.
constexpr double same_place = 1e-9;

enum SlotNumber : std::size_t { bezier_slot, polyline_slot, spline_slot, wavelet_slot, arcwise_slot };

/// The t of the sample at a parameter, which is put in if there is none; nothing if the splice does not reach there.
std::optional<double> sample_at(SampledSplice& splice, double t) {
  auto& samples = splice.samples;
  const double at = unwrapped(t, samples.front().t - same_t);
  if (at > samples.back().t + same_t) return std::nullopt;
  const auto after = std::partition_point(samples.begin(), samples.end(),
                                          [at](const Sample& sample) { return sample.t < at - same_t; });
  if (after != samples.end() && after->t <= at + same_t) return after->t;
  const Point p = splice.at(at);
  samples.insert(after, {at, p});
  return at;
}

void add_pin(SampledSplice& splice, const Pin& pin) {
  const auto at =
      std::partition_point(splice.pins.begin(), splice.pins.end(), [&](const Pin& other) { return other.t < pin.t; });
  if (at == splice.pins.end() || at->t != pin.t) {
    splice.pins.insert(at, pin);
    return;
  }
  at->is_corner = at->is_corner || pin.is_corner;
  if (pin.in) at->in = pin.in;
  if (pin.out) at->out = pin.out;
}

/// The part of a splice over an interval within it.
SampledSplice part(const SampledSplice& splice, const Interval& interval) {
  SampledSplice result{interval, {}};
  const double from = unwrapped(interval.from, splice.samples.front().t - same_t);
  const double to = from + length(interval);
  result.samples.push_back({from, splice.at(from)});
  for (const Sample& sample : splice.samples) {
    if (sample.t > from + same_t && sample.t < to - same_t) result.samples.push_back(sample);
  }
  result.samples.push_back({to, splice.at(to)});
  for (const Pin& pin : splice.pins) {
    if (pin.t > from + same_t && pin.t < to - same_t) result.pins.push_back(pin);
  }
  return result;
}

/// Samples of two splices over the same interval mixed: weight(t) of `second`, the rest of `first`.
template <typename Weight>
SampledSplice mixed(const SampledSplice& first, const SampledSplice& second, const Weight& weight) {
  SampledSplice result{second.interval, {}, second.pins};
  auto a = first.samples.begin();
  auto b = second.samples.begin();
  const double shift = second.samples.front().t - first.samples.front().t;
  while (a != first.samples.end() || b != second.samples.end()) {
    const double ta = a != first.samples.end() ? a->t + shift : second.samples.back().t + 1.0;
    const double tb = b != second.samples.end() ? b->t : ta + 1.0;
    const double t = std::min(ta, tb);
    const bool is_second = tb <= ta + same_t;
    if (is_second) {
      const double w = weight(b->t);
      result.samples.push_back({b->t, w == 1.0 ? b->p : Point(first.at(b->t - shift) * (1.0 - w) + w * b->p)});
      ++b;
      if (ta <= tb + same_t) ++a;
    } else {
      const double w = weight(t);
      if (w < 1.0 && t < second.samples.back().t - same_t) {
        result.samples.push_back({t, w == 0.0 ? a->p : Point(a->p * (1.0 - w) + w * second.at(t))});
      }
      ++a;
    }
  }
  return result;
}

/// From 0 to 1 with slope 0 at both.
double smooth_step(double x) {
  const double in = std::clamp(x, 0.0, 1.0);
  return in * in * (3.0 - 2.0 * in);
}

std::vector<double> corners_of(const BezierContour& contour, const LinkedBezier& bezier, double corner_angle) {
  std::vector<double> corners;
  const std::vector<double> turns = turning_angles(contour);
  for (int i = 0; i < bezier.size(); ++i) {
    if (std::abs(turns[static_cast<std::size_t>(i)]) > corner_angle) corners.push_back(bezier.piece(i).t);
  }
  return corners;
}

void require_options(const LinkedOptions& options) {
  if (!(options.epsilon > 0.0) || !std::isfinite(options.epsilon)) {
    throw InvalidInput(text("LinkedCurve: epsilon ", options.epsilon, " is not positive"));
  }
  if (options.spline_degree < 1 || options.spline_degree > 5) {
    throw InvalidInput(text("LinkedCurve: spline degree ", options.spline_degree, " is not in [1, 5]"));
  }
}

IntervalSet everything() { return IntervalSet({whole_curve}); }

}  // namespace

struct LinkedCurve::Rules {
  LinkedOptions options;
  std::vector<CurveRule> rules;
  IntervalSet frozen{};           // by hand; rules may freeze more
  std::vector<double> corners{};  // ascending in [0, 1)
  std::optional<Interval> marks{};

  template <typename Rule>
  const Rule* find() const {
    for (const CurveRule& rule : rules) {
      if (const auto* found = std::get_if<Rule>(&rule.rule)) return found;
    }
    return nullptr;
  }
  IntervalSet all_frozen() const {
    IntervalSet all = frozen;
    for (const CurveRule& rule : rules) {
      if (const auto* stretch = std::get_if<Frozen>(&rule.rule)) all.add(stretch->interval);
    }
    return all;
  }
  /// What may not change: frozen, or outside the marks.
  IntervalSet held() const {
    IntervalSet all = all_frozen();
    if (marks) {
      for (const Interval& outside : IntervalSet({*marks}).outside(whole_curve)) all.add(outside);
    }
    return all;
  }
  /// The interval that a rule may move to come true; none if it has no place.
  static std::optional<Interval> control_of(const CurveRule& rule) {
    const auto about = [](double t, double control) { return Interval{wrapped(t - control), wrapped(t + control)}; };
    if (const auto* stretch = std::get_if<Frozen>(&rule.rule)) return stretch->interval;
    if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) return about(point->t, point->control);
    if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) return about(corner->t, corner->control);
    if (const auto* line = std::get_if<HeldLine>(&rule.rule)) return line->interval;
    return std::nullopt;
  }
  /// Whether a place is a held point, a corner or an end of a line, or inside one: it is not moved for an area.
  bool claims(double t) const {
    const auto is_at = [t](double place) { return std::abs(unwrapped(place - t, -0.5)) < same_place; };
    return std::any_of(rules.begin(), rules.end(), [&](const CurveRule& rule) {
      if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) return is_at(point->t);
      if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) return is_at(corner->t);
      if (const auto* line = std::get_if<HeldLine>(&rule.rule)) return contains(line->interval, t);
      return false;
    });
  }
  bool may_object_to(const IntervalSet& changed) const {
    if (find<HeldArea>() || find<NoAddedCrossing>()) return true;
    const IntervalSet fixed = held();
    for (const Interval& interval : changed.intervals()) {
      if (fixed.overlaps(interval)) return true;
    }
    return std::any_of(rules.begin(), rules.end(), [&](const CurveRule& rule) {
      if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) return changed.contains(point->t);
      if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) return changed.contains(corner->t);
      if (const auto* line = std::get_if<HeldLine>(&rule.rule)) return changed.overlaps(line->interval);
      return false;
    });
  }
  void add_corner(double t) {
    std::erase_if(corners, [t](double corner) { return std::abs(unwrapped(corner - t, -0.5)) < same_place; });
    corners.insert(std::lower_bound(corners.begin(), corners.end(), wrapped(t)), wrapped(t));
  }
  /// Of the corners strictly inside a splice, those that it says are there.
  void take_corners(const SampledSplice& splice) {
    const double from = splice.samples.front().t;
    const double to = splice.samples.back().t;
    std::erase_if(corners, [&](double corner) {
      const double at = unwrapped(corner, from);
      return at > from + same_t && at < to - same_t;
    });
    for (const Pin& pin : splice.pins) {
      if (pin.is_corner) add_corner(pin.t);
    }
  }

  /// Pins at corners and at what is held, and lines without samples inside.
  void pin(SampledSplice& splice) const {
    for (const double corner : corners) {
      if (const auto at = sample_at(splice, corner)) add_pin(splice, {.t = *at, .is_corner = true});
    }
    pin_rules(splice);
  }
  void pin_rules(SampledSplice& splice) const {
    for (const CurveRule& rule : rules) {
      if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) {
        if (const auto at = place(splice, point->t, point->p)) add_pin(splice, {.t = *at});
      } else if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) {
        if (const auto at = place(splice, corner->t, corner->p)) {
          add_pin(splice, {*at, true, corner->in.normalized(), corner->out.normalized()});
        }
      }
    }
    for (const CurveRule& rule : rules) {
      if (const auto* line = std::get_if<HeldLine>(&rule.rule)) straighten(splice, line->interval);
    }
  }
  /// The sample at t, moved to a point; none if the splice does not go there, or ends there.
  static std::optional<double> place(SampledSplice& splice, double t, const Point& p) {
    const auto at = sample_at(splice, t);
    if (!at) return std::nullopt;
    const auto found = std::partition_point(splice.samples.begin(), splice.samples.end(),
                                            [&](const Sample& sample) { return sample.t < *at; });
    found->p = p;
    return at;
  }
  /// What of a line is in a splice becomes its chord; tangents at its ends follow it unless they are corners.
  void straighten(SampledSplice& splice, const Interval& line) const {
    const double start = splice.samples.front().t;
    const double stop = splice.samples.back().t;
    for (const Interval& common : IntervalSet({line}).within(splice.interval)) {
      double from = unwrapped(common.from, start - same_t);
      double to = from + length(common);
      if (to > stop + same_t) continue;
      from = *sample_at(splice, from);
      to = *sample_at(splice, to);
      std::erase_if(splice.samples, [&](const Sample& sample) { return sample.t > from && sample.t < to; });
      std::erase_if(splice.pins, [&](const Pin& pin) { return pin.t > from && pin.t < to; });
      const Point direction = splice.at(to) - splice.at(from);
      if (!(direction.norm() > 0.0)) continue;
      const auto end = [&](double t, bool is_start) {
        Pin pin{.t = t};
        const bool is_corner = std::any_of(corners.begin(), corners.end(), [t](double corner) {
          return std::abs(unwrapped(corner - t, -0.5)) < same_place;
        });
        pin.is_corner = is_corner;
        if (is_start || !is_corner) pin.out = direction.normalized();
        if (!is_start || !is_corner) pin.in = direction.normalized();
        add_pin(splice, pin);
      };
      end(from, true);
      end(to, false);
    }
  }
  /// A splice that takes in every line that it has a part of, from the curve as it is.
  SampledSplice widened(SampledSplice splice, const std::function<SampledSplice(const Interval&)>& curve) const {
    for (const CurveRule& rule : rules) {
      const auto* line = std::get_if<HeldLine>(&rule.rule);
      if (!line || length(splice.interval) >= 1.0 || !overlaps(line->interval, splice.interval)) continue;
      for (const Interval& missing : IntervalSet({splice.interval}).outside(line->interval)) {
        const bool is_after = std::abs(unwrapped(missing.from - splice.interval.to, -0.5)) < same_t;
        SampledSplice more = curve(missing);
        const double shift = is_after ? splice.samples.back().t - more.samples.front().t
                                      : splice.samples.front().t - more.samples.back().t;
        for (Sample& sample : more.samples) sample.t += shift;
        if (is_after) {
          splice.samples.insert(splice.samples.end(), more.samples.begin() + 1, more.samples.end());
          splice.interval.to = missing.to;
        } else {
          splice.samples.insert(splice.samples.begin(), more.samples.begin(), more.samples.end() - 1);
          splice.interval.from = missing.from;
        }
      }
    }
    return splice;
  }
  /// Moves samples so that points, corners and lines hold again, each within its control interval; what is of one kind
  /// together.
  void establish(SampledSplice& splice) const {
    move_to_points(splice);
    turn_corners(splice);
    pin_rules(splice);
  }

  struct Held {
    double t = 0.0;
    Point p = Point::Zero();
    double before = 0.0;  // how far it may move the curve, of t
    double after = 0.0;
  };
  std::vector<Held> held_in(const SampledSplice& splice) const {
    const double from = splice.samples.front().t;
    const double to = splice.samples.back().t;
    std::vector<Held> found;
    const auto add = [&](double t, const Point& p, double control) {
      const double at = unwrapped(t, from - same_t);
      if (at > from + same_t && at < to - same_t) {
        found.push_back({at, p, std::min(control, at - from), std::min(control, to - at)});
      }
    };
    for (const CurveRule& rule : rules) {
      if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) add(point->t, point->p, point->control);
      if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) add(corner->t, corner->p, corner->control);
    }
    return found;
  }
  /// 1 at a held place, falling smoothly to 0 at the ends of its control interval.
  static double bump(const Held& held, double t) {
    const double x = t < held.t ? (held.t - t) / held.before : (t - held.t) / held.after;
    return x < 1.0 ? (1.0 - x * x) * (1.0 - x * x) : 0.0;
  }
  /// Samples close enough to follow a bump of a height.
  void refine(SampledSplice& splice, const Held& held, double height) const {
    constexpr double bend = 8.0;  // largest second derivative of (1 - x^2)^2
    const double allowed = 0.5 * sampling_share * options.epsilon;
    const int parts = std::clamp(static_cast<int>(std::ceil(std::sqrt(bend * height / (8.0 * allowed)))), 1, 4096);
    for (int k = -parts; k <= parts; ++k) {
      const double reach = k < 0 ? held.before : held.after;
      static_cast<void>(sample_at(splice, held.t + reach * k / parts));
    }
  }
  void move_to_points(SampledSplice& splice) const {
    std::vector<Held> places = held_in(splice);
    std::vector<Point> missing;
    double largest = 0.0;
    for (const Held& held : places) {
      missing.push_back(held.p - splice.at(held.t));
      largest = std::max(largest, missing.back().norm());
    }
    if (!(largest > 0.0)) return;
    // Bumps that overlap are solved for together.
    const auto n = static_cast<Eigen::Index>(places.size());
    Eigen::MatrixXd bumps(n, n);
    Eigen::MatrixXd asked(n, 2);
    for (Eigen::Index i = 0; i < n; ++i) {
      asked.row(i) = missing[static_cast<std::size_t>(i)];
      for (Eigen::Index j = 0; j < n; ++j) {
        bumps(i, j) = bump(places[static_cast<std::size_t>(j)], places[static_cast<std::size_t>(i)].t);
      }
    }
    const Eigen::MatrixXd heights = bumps.completeOrthogonalDecomposition().solve(asked);
    for (std::size_t j = 0; j < places.size(); ++j) {
      const double height = heights.row(static_cast<Eigen::Index>(j)).norm();
      if (height > 0.0) refine(splice, places[j], height);
    }
    for (Sample& sample : splice.samples) {
      for (std::size_t j = 0; j < places.size(); ++j) {
        sample.p += bump(places[j], sample.t) * heights.row(static_cast<Eigen::Index>(j)).transpose();
      }
    }
  }
  /// The legs of corners turned into their directions, at the speed that they have.
  void turn_corners(SampledSplice& splice) const {
    const double from = splice.samples.front().t;
    const double to = splice.samples.back().t;
    for (const CurveRule& rule : rules) {
      const auto* corner = std::get_if<HeldCorner>(&rule.rule);
      if (!corner) continue;
      const double at = unwrapped(corner->t, from - same_t);
      if (!(at > from + same_t && at < to - same_t)) continue;
      Held held{at, corner->p, std::min(corner->control, at - from), std::min(corner->control, to - at)};
      // What else is held, or a corner, stays as it is, and so do the legs beyond it.
      const auto stop_at = [&](double t) {
        if (t < at - same_t) held.before = std::min(held.before, at - t);
        if (t > at + same_t) held.after = std::min(held.after, t - at);
      };
      for (const Held& other : held_in(splice)) stop_at(other.t);
      for (const Pin& pin : splice.pins) stop_at(pin.t);
      for (const double side : {-1.0, 1.0}) {
        const double reach = side < 0.0 ? held.before : held.after;
        const Point wanted = (side < 0.0 ? corner->in : corner->out).normalized();
        // The chord over a tenth of the reach: what is nearer to the corner than that is its direction's.
        const double near = *sample_at(splice, at + side * 0.1 * reach);
        std::erase_if(splice.samples, [&](const Sample& sample) {
          return (sample.t - at) * side > same_t && (near - sample.t) * side > same_t;
        });
        const Point leg = (splice.at(near) - splice.at(at)) / (near - at);
        constexpr double same_direction = 1e-3;  // radians: what chords cannot tell apart
        if ((leg - leg.norm() * wanted).norm() <= same_direction * leg.norm()) continue;
        const Point turn = leg.norm() * wanted - leg;
        refine(splice, held, reach * turn.norm());
        std::erase_if(splice.samples, [&](const Sample& sample) {
          return (sample.t - at) * side > same_t && (near - sample.t) * side > same_t;
        });
        for (Sample& sample : splice.samples) {
          const double way = sample.t - at;
          if (way * side > same_t && way * side < reach) sample.p += way * bump(held, sample.t) * turn;
        }
      }
    }
  }

  /// Throws if a rule is not a valid one, or another claims its place.
  void require_free(const CurveRule& rule, const LinkedCurve& curve) const;
};

namespace {

void require_place(const std::string& name, double t, const Point& p, double control) {
  if (!std::isfinite(t) || !p.allFinite() || !(control > 0.0 && control < 0.5)) {
    throw InvalidInput(text("LinkedCurve::with_rule: ", name, " at t = ", t, ", control ", control));
  }
}

}  // namespace

void LinkedCurve::Rules::require_free(const CurveRule& rule, const LinkedCurve& curve) const {
  for (const CurveRule& other : rules) {
    if (other.name == rule.name) throw InvalidInput(text("LinkedCurve::with_rule: there is a rule named ", rule.name));
  }
  const auto refuse = [&](const std::string& other, const std::string& claim) {
    throw UnsatisfiableConstraints(text("LinkedCurve::with_rule: ", rule.name, " and ", other, " both claim ", claim));
  };
  std::optional<double> t;
  std::optional<Point> p;
  if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) {
    require_place(rule.name, point->t, point->p, point->control);
    t = point->t;
    p = point->p;
  } else if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) {
    require_place(rule.name, corner->t, corner->p, corner->control);
    if (!(corner->in.norm() > 0.0) || !(corner->out.norm() > 0.0) || !corner->in.allFinite() ||
        !corner->out.allFinite()) {
      throw InvalidInput(text("LinkedCurve::with_rule: ", rule.name, " has a tangent without direction"));
    }
    t = corner->t;
  } else if (const auto* area = std::get_if<HeldArea>(&rule.rule)) {
    if (!std::isfinite(area->area)) throw InvalidInput(text("LinkedCurve::with_rule: ", rule.name, " is not finite"));
  }
  const auto control = control_of(rule);
  if (control && (!std::isfinite(control->from) || !std::isfinite(control->to))) {
    throw InvalidInput(text("LinkedCurve::with_rule: ", rule.name, " has an interval that is not finite"));
  }
  const auto* line = std::get_if<HeldLine>(&rule.rule);
  const auto is_inside = [](const Interval& interval, double place) {
    const double way = unwrapped(place - interval.from, -same_place);
    return way > same_place && way < length(interval) - same_place;
  };
  for (const CurveRule& other : rules) {
    if (other.rule.index() == rule.rule.index() &&
        (std::holds_alternative<HeldArea>(rule.rule) || std::holds_alternative<NoAddedCrossing>(rule.rule))) {
      refuse(other.name, "the whole curve");
    }
    std::optional<double> other_t;
    if (const auto* point = std::get_if<HeldPoint>(&other.rule)) other_t = point->t;
    if (const auto* corner = std::get_if<HeldCorner>(&other.rule)) other_t = corner->t;
    const auto* other_line = std::get_if<HeldLine>(&other.rule);
    if (t && other_t && std::abs(unwrapped(*t - *other_t, -0.5)) < same_place) refuse(other.name, text("t = ", *t));
    if (t && other_line && is_inside(other_line->interval, *t)) refuse(other.name, text("t = ", *t));
    if (line && other_t && is_inside(line->interval, *other_t)) refuse(other.name, text("t = ", *other_t));
    if (line && other_line && overlaps(line->interval, other_line->interval)) {
      refuse(other.name, text("what lies between t = ", other_line->interval.from, " and ", other_line->interval.to));
    }
  }
  // What is frozen cannot move to where a rule asks it to be.
  const auto frozen_by = [&](const Interval& interval) -> std::string {
    for (const CurveRule& other : rules) {
      const auto* stretch = std::get_if<Frozen>(&other.rule);
      if (stretch && overlaps(stretch->interval, interval)) return other.name;
    }
    return "a frozen stretch";
  };
  const IntervalSet fixed = all_frozen();
  if (line && fixed.overlaps(line->interval)) {
    refuse(frozen_by(line->interval), text("what lies between t = ", line->interval.from, " and ", line->interval.to));
  }
  if (t && fixed.contains(*t)) {
    const Interval about{wrapped(*t - same_place), wrapped(*t + same_place)};
    const bool stays = p && (curve.bezier().evaluate(*t) - *p).norm() <= same_place;
    if (!stays) refuse(frozen_by(about), text("t = ", *t));
  }
}

LinkedCurve::LinkedCurve(const BezierContour& contour, const LinkedOptions& options) {
  require_options(options);
  auto bezier = std::make_shared<const LinkedBezier>(contour);
  rules_ = std::make_shared<const Rules>(Rules{options, {}, {}, corners_of(contour, *bezier, options.corner_angle)});
  slots_.push_back({std::move(bezier), {}});
  slots_.push_back({std::make_shared<const LinkedPolyline>(), everything()});
  add_slots();
  current_ = bezier_slot;
}

LinkedCurve::LinkedCurve(const Polyline& polyline, const LinkedOptions& options) {
  require_options(options);
  auto form = std::make_shared<const LinkedPolyline>(polyline);
  std::vector<double> corners;
  const Eigen::Index n = polyline.points.rows();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Point in = (polyline.points.row(i) - polyline.points.row((i + n - 1) % n)).transpose();
    const Point out = (polyline.points.row((i + 1) % n) - polyline.points.row(i)).transpose();
    if (std::abs(angle(in, out)) > options.corner_angle) corners.push_back(polyline.t[static_cast<std::size_t>(i)]);
  }
  rules_ = std::make_shared<const Rules>(Rules{options, {}, {}, std::move(corners)});
  slots_.push_back({std::make_shared<const LinkedBezier>(), everything()});
  slots_.push_back({std::move(form), {}});
  add_slots();
  current_ = polyline_slot;
}

void LinkedCurve::add_slots() {
  slots_.push_back({std::make_shared<const LinkedSpline>(rules_->options.spline_degree), everything()});
  slots_.push_back({std::make_shared<const LinkedWavelet>(), everything()});
  slots_.push_back({nullptr, everything()});  // arcwise: made when it is read
}

const LinkedWavelet& LinkedCurve::wavelet() const {
  return dynamic_cast<const LinkedWavelet&>(read_slot(wavelet_slot));
}

const LinkedWavelet& LinkedCurve::arcwise() const {
  return dynamic_cast<const LinkedWavelet&>(read_slot(arcwise_slot));
}

LinkedCurve LinkedCurve::with_wavelet(const Changed<LinkedWavelet>& changed) const {
  return with_changed(wavelet_slot, std::make_shared<const LinkedWavelet>(changed.form), {changed.interval});
}

LinkedCurve LinkedCurve::with_arcwise(const Changed<LinkedWavelet>& changed) const {
  return with_changed(arcwise_slot, std::make_shared<const LinkedWavelet>(changed.form), {changed.interval});
}

double LinkedCurve::epsilon() const { return rules_->options.epsilon; }
const LinkedOptions& LinkedCurve::options() const { return rules_->options; }
const std::vector<CurveRule>& LinkedCurve::rules() const { return rules_->rules; }
const std::optional<Interval>& LinkedCurve::marks() const { return rules_->marks; }
std::vector<Interval> LinkedCurve::frozen() const { return rules_->all_frozen().intervals(); }
std::vector<double> LinkedCurve::corners() const { return rules_->corners; }

std::size_t LinkedCurve::slot_of(const std::type_info& type) const {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i == arcwise_slot) continue;  // of the type of the periodic one
    const Representation& form = *slots_[i].form;
    if (typeid(form) == type) return i;
  }
  throw InvalidInput(text("LinkedCurve: no form of the type ", type.name()));
}

SampledSplice LinkedCurve::sample(const Interval& interval, double tolerance) const {
  return slots_[current_].form->sample(interval, tolerance);
}

SampledSplice LinkedCurve::handed_over(const Interval& interval) const {
  SampledSplice splice = sample(interval, 0.5 * sampling_share * epsilon());
  rules_->pin(splice);
  return splice;
}

const Representation& LinkedCurve::read_slot(std::size_t slot) const {
  Slot& own = slots_[slot];
  if (!own.form) {
    own.form =
        std::make_shared<const LinkedWavelet>(rules_->corners.size() > 1 ? rules_->corners : std::vector<double>{});
  }
  if (!own.stale.empty()) {
    for (const Interval& interval : own.stale.intervals()) {
      own.form = own.form->splice(handed_over(interval), 0.5 * epsilon());
    }
    own.stale = {};
  }
  return *own.form;
}

LinkedCurve LinkedCurve::with_slot(std::shared_ptr<const Representation> empty) const {
  LinkedCurve result = *this;
  result.slots_.push_back({std::move(empty), everything()});
  return result;
}

LinkedCurve LinkedCurve::with_changed(std::size_t slot, std::shared_ptr<const Representation> form,
                                      const std::vector<Interval>& changed) const {
  read_slot(slot);
  const IntervalSet stretches(changed);
  const std::vector<Interval> intervals = stretches.intervals();
  if (!intervals.empty() && rules_->may_object_to(stretches)) {
    std::vector<SampledSplice> splices;
    for (const Interval& interval : intervals) {
      splices.push_back(form->sample(interval, 0.5 * sampling_share * epsilon()));
      for (const double corner : rules_->corners) {
        if (const auto at = sample_at(splices.back(), corner)) add_pin(splices.back(), {.t = *at, .is_corner = true});
      }
    }
    return with_splices(std::move(splices));
  }
  LinkedCurve result = *this;
  result.report_ = {.rounds = 1, .changed = intervals};
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i != slot) result.slots_[i].stale.add(stretches);
  }
  result.slots_[slot].form = std::move(form);
  result.current_ = slot;
  return result;
}

LinkedCurve LinkedCurve::with_splices(std::vector<SampledSplice> splices) const {
  for (const SampledSplice& splice : splices) require_valid("LinkedCurve::with_splices", splice);
  LinkedCurve whole = with_share(splices, 1.0);
  const auto* crossings = rules_->find<NoAddedCrossing>();
  if (!crossings || whole.report_.changed.empty()) return whole;
  const int added = added_meetings(whole);
  if (added <= 0) return whole;

  LinkedCurve best = *this;
  best.report_ = {.share = 0.0, .rounds = 1, .added_crossings = added};
  if (crossings->otherwise == NoAddedCrossing::Otherwise::Reduce) {
    constexpr int most_rounds = 8;  // the share to a few thousandths
    double low = 0.0;
    double high = 1.0;
    for (int round = 0; round < most_rounds; ++round) {
      const double share = 0.5 * (low + high);
      LinkedCurve less = with_share(splices, share);
      if (added_meetings(less) <= 0) {
        low = share;
        less.report_.share = share;
        less.report_.added_crossings = added;
        best = std::move(less);
      } else {
        high = share;
      }
    }
    best.report_.rounds = 1 + most_rounds;
  }
  if (best.report_.share == 0.0) best.report_.refused = text("it would add ", added, " crossings");
  return best;
}

LinkedCurve LinkedCurve::with_share(const std::vector<SampledSplice>& splices, double share) const {
  read_slot(bezier_slot);
  LinkedCurve result = *this;
  result.report_ = {.rounds = 1};
  for (const SampledSplice& splice : splices) {
    result = result.with_change(
        share < 1.0 ? mixed(result.sample(splice.interval), splice, [share](double) { return share; }) : splice);
  }
  if (result.report_.changed.empty() && !splices.empty()) {
    result.report_.share = 0.0;
    result.report_.refused = "all of it is frozen";
  }
  if (rules_->find<HeldArea>()) result.give_back_area(*this);
  return result;
}

LinkedCurve LinkedCurve::with_change(const SampledSplice& asked) const {
  LinkedCurve result = *this;
  const auto rules = std::make_shared<Rules>(*rules_);
  const IntervalSet held = rules_->held();
  result.read_slot(bezier_slot);
  const SampledSplice wanted = rules_->widened(asked, [this](const Interval& interval) { return sample(interval); });
  IntervalSet changed;
  for (const Interval& interval : held.outside(wanted.interval)) {
    if (length(interval) < same_t) continue;  // what is held ends where the splice does, but for rounding
    SampledSplice splice = wanted;
    if (length(interval) < length(wanted.interval)) {
      splice = part(wanted, interval);
      const SampledSplice before = sample(interval);
      const double from = splice.samples.front().t;
      const double to = splice.samples.back().t;
      const double quarter = 0.25 * (to - from);
      // Where what is held cut it off, the change sets in smoothly.
      const bool is_cut_before = from > wanted.samples.front().t + same_t;
      const bool is_cut_after = to < wanted.samples.back().t - same_t;
      splice = mixed(before, splice, [&](double t) {
        return (is_cut_before ? smooth_step((t - from) / quarter) : 1.0) *
               (is_cut_after ? smooth_step((to - t) / quarter) : 1.0);
      });
    }
    rules_->establish(splice);
    rules->take_corners(splice);
    Slot& bezier = result.slots_[bezier_slot];
    bezier.form = bezier.form->splice(splice, 0.5 * epsilon());
    changed.add(interval);
  }
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i != bezier_slot) result.slots_[i].stale.add(changed);
  }
  result.current_ = bezier_slot;
  result.rules_ = rules;
  IntervalSet all(result.report_.changed);
  all.add(changed);
  result.report_.changed = all.intervals();
  return result;
}

namespace {

/// Area seen from the origin, of what lies in the intervals.
double area_along(const LinkedBezier& bezier, const std::vector<Interval>& intervals) {
  double area = 0.0;
  for (const Interval& interval : intervals) {
    for (const LinkedBezier::Piece& piece : bezier.pieces_within(interval)) area += signed_area(piece.bezier);
  }
  return area;
}

/// A node that may move with its handles, and the pieces before and after it.
struct FreeNode {
  int before = 0;
  int after = 0;
  Point by = Point::Zero();
};

enum class Lines { Stay, Bend };

/// A curve whose ends have a handle each, a line too if it may bend.
Bezier with_own_handles(const Bezier& bezier, Lines lines) {
  if (bezier.degree == 1 && lines == Lines::Bend) {
    const Point third = (bezier.p[1] - bezier.p[0]) / 3.0;
    return {{bezier.p[0], bezier.p[0] + third, bezier.p[1] - third, bezier.p[1]}, 3};
  }
  if (bezier.degree != 2) return bezier;
  const auto& p = bezier.p;
  return {{p[0], (p[0] + 2.0 * p[1]) / 3.0, (2.0 * p[1] + p[2]) / 3.0, p[2]}, 3};
}

void move_end(Bezier& bezier, const Point& by) {
  const auto last = static_cast<std::size_t>(bezier.degree);
  bezier.p[last] += by;
  if (last > 1) bezier.p[last - 1] += by;
}

void move_start(Bezier& bezier, const Point& by) {
  bezier.p[0] += by;
  if (bezier.degree > 1) bezier.p[1] += by;
}

}  // namespace

/// Nodes within what changed move, each with its handles, so that joins keep their tangents: along the gradient of the
/// area, on which it is exactly quadratic.
void LinkedCurve::give_back_area(const LinkedCurve& before) {
  const LinkedBezier& old = before.bezier();
  LinkedBezier now = bezier();
  double missing = before.area_missing_ - (area_along(now, report_.changed) - area_along(old, report_.changed));
  const double whole = rules_->find<HeldArea>()->area;
  const auto put_back = [&](double left) {
    area_missing_ = left;
    report_.area_error = std::abs(left) / std::max(std::abs(whole), 1.0);
  };
  put_back(missing);
  constexpr double rounding = 1e-13;  // of the area: below that a move would only add more
  if (std::abs(missing) <= rounding * std::abs(whole)) return;

  for (const Interval& interval : report_.changed) {
    const std::vector<int> pieces = now.pieces(interval);
    // A single piece has no node of its own to move.
    if (pieces.size() == 1) now = now.add_node(interval.from + 0.5 * length(interval)).form;
  }
  // A node whose neighbours meet there without a corner, or that a rule holds: directions at it are to stay.
  const auto keeps_directions = [&](int piece) {
    const Bezier a = now.piece(piece == 0 ? now.size() - 1 : piece - 1).bezier;
    const Bezier b = now.piece(piece).bezier;
    return rules_->claims(now.piece(piece).t) ||
           end_tangent(a).dot(start_tangent(b)) > std::cos(rules_->options.corner_angle);
  };
  // A curve carries its handle along; of one without a handle at the other end that end would turn.
  const auto turns_start = [](const Bezier& bezier) { return bezier.degree == 1 || bezier.p[1] == bezier.p[0]; };
  const auto turns_end = [](const Bezier& bezier) {
    const auto last = static_cast<std::size_t>(bezier.degree);
    return last == 1 || bezier.p[last - 1] == bezier.p[last];
  };
  Lines lines = Lines::Stay;
  const auto free_nodes = [&] {
    std::vector<FreeNode> nodes;
    for (const Interval& interval : report_.changed) {
      const std::vector<int> pieces = now.pieces(interval);
      for (std::size_t i = 1; i < pieces.size(); ++i) {
        if (rules_->claims(now.piece(pieces[i]).t)) continue;
        const Bezier a = with_own_handles(now.piece(pieces[i - 1]).bezier, lines);
        const Bezier b = with_own_handles(now.piece(pieces[i]).bezier, lines);
        // A line that runs smoothly into a curve would turn.
        const bool is_smooth = end_tangent(a).dot(start_tangent(b)) > std::cos(rules_->options.corner_angle);
        if (is_smooth && (a.degree == 1) != (b.degree == 1)) continue;
        const int next = pieces[i] + 1 == now.size() ? 0 : pieces[i] + 1;
        if (turns_start(a) && keeps_directions(pieces[i - 1])) continue;
        if (turns_end(b) && keeps_directions(next)) continue;
        nodes.push_back({pieces[i - 1], pieces[i], Point::Zero()});
      }
    }
    return nodes;
  };
  std::vector<FreeNode> nodes = free_nodes();
  if (nodes.empty()) {  // lines bend before the area is missed
    lines = Lines::Bend;
    nodes = free_nodes();
  }
  if (nodes.empty()) return;
  const auto area_moved = [](Bezier a, Bezier b, const Point& by) {
    move_end(a, by);
    move_start(b, by);
    return signed_area(a) + signed_area(b);
  };
  double steepness = 0.0;
  for (FreeNode& node : nodes) {
    const Bezier a = with_own_handles(now.piece(node.before).bezier, lines);
    const Bezier b = with_own_handles(now.piece(node.after).bezier, lines);
    for (int axis = 0; axis < 2; ++axis) {
      const Point unit = Point::Unit(axis);
      node.by[axis] = 0.5 * (area_moved(a, b, unit) - area_moved(a, b, -unit));
    }
    steepness += node.by.squaredNorm();
  }
  if (!(steepness > 0.0)) return;
  for (FreeNode& node : nodes) node.by /= std::sqrt(steepness);
  const auto displaced = [&](double share) {
    std::map<int, Bezier> pieces;
    const auto piece = [&](int index) -> Bezier& {
      return pieces.try_emplace(index, with_own_handles(now.piece(index).bezier, lines)).first->second;
    };
    for (const FreeNode& node : nodes) {
      move_end(piece(node.before), share * node.by);
      move_start(piece(node.after), share * node.by);
    }
    return pieces;
  };
  const auto area_of = [&](double share) {
    double area = 0.0;
    for (const auto& [index, bezier] : displaced(share)) area += signed_area(bezier);
    return area;
  };
  for (int pass = 0; pass < 2; ++pass) {  // the second cleans rounding
    const double here = area_of(0.0);
    const double forward = area_of(1.0);
    const double backward = area_of(-1.0);
    const double slope = 0.5 * (forward - backward);
    const auto share = area_root(missing, slope, 0.5 * (forward + backward) - here);
    if (!share) break;
    const double reached = area_of(*share) - here;
    LinkedBezier next = now;
    for (const auto& [index, bezier] : displaced(*share)) {
      next = next.replaced({next.piece(index).t, next.end(index)}, {{next.piece(index).t, bezier}});
    }
    now = std::move(next);
    missing -= reached;
    put_back(missing);
    if (std::abs(missing) <= rounding * std::abs(whole)) break;
  }
  slots_[bezier_slot].form = std::make_shared<const LinkedBezier>(std::move(now));
}

namespace {

/// How often the curve meets itself where a box is, of pieces in or near the intervals.
int meetings_near(const LinkedBezier& bezier, const std::vector<Interval>& intervals, const Box& box) {
  std::set<int> near;
  for (const Interval& interval : intervals) {
    for (const int index : bezier.pieces(interval)) near.insert(index);
  }
  for (const Interval& interval : bezier.near(box)) {
    for (const int index : bezier.pieces(interval)) {
      if (overlap(control_box(bezier.piece(index).bezier), box)) near.insert(index);
    }
  }
  // One contour of them all: from the end of one chain to the start of the next by way of places far outside, each in
  // a direction of its own, so that no such way runs along the curve. What they cross does not count.
  std::vector<Point> points;
  std::vector<PointKind> kinds;
  std::vector<bool> is_real;
  Box all;
  for (const int index : near) all.add(control_box(bezier.piece(index).bezier));
  const Point centre = 0.5 * (all.low + all.high);
  const double far = 2.0 * (all.high - all.low).norm() + 1.0;
  const auto add_node = [&](const Point& p, bool starts_real) {
    points.push_back(p);
    kinds.push_back(PointKind::Node);
    is_real.push_back(starts_real);
  };
  const std::vector<int> order(near.begin(), near.end());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Bezier piece = bezier.piece(order[i]).bezier;
    add_node(piece.start(), true);
    for (std::size_t k = 1; k < static_cast<std::size_t>(piece.degree); ++k) {
      points.push_back(piece.p[k]);
      kinds.push_back(piece.degree == 2 ? PointKind::Quadratic : PointKind::Cubic);
    }
    const int next = order[(i + 1) % order.size()];
    if (next == (order[i] + 1) % bezier.size()) continue;
    add_node(piece.end(), false);
    const double angle = 2.399963 * static_cast<double>(i + 1);  // the golden angle: no two alike
    add_node(centre + far * Point(std::cos(angle), std::sin(angle)), false);
    add_node(centre + far * Point(std::cos(angle + 0.7), std::sin(angle + 0.7)), false);
  }
  Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  const std::vector<Crossing> found = find_crossings({BezierContour(std::move(rows), std::move(kinds))});
  return static_cast<int>(std::count_if(found.begin(), found.end(), [&](const Crossing& crossing) {
    return is_real[static_cast<std::size_t>(crossing.a.segment)] &&
           is_real[static_cast<std::size_t>(crossing.b.segment)];
  }));
}

}  // namespace

int LinkedCurve::added_meetings(const LinkedCurve& after) const {
  const std::vector<Interval>& changed = after.report_.changed;
  Box box;
  for (const LinkedCurve* curve : {this, &after}) {
    for (const Interval& interval : changed) {
      for (const int index : curve->bezier().pieces(interval))
        box.add(control_box(curve->bezier().piece(index).bezier));
    }
  }
  return meetings_near(after.bezier(), changed, box) - meetings_near(bezier(), changed, box);
}

namespace {

/// Whether a node passes the corner with both its directions.
bool passes(const LinkedBezier& bezier, const HeldCorner& corner) {
  const double node = bezier.piece(bezier.piece_at(corner.t + same_t)).t;  // that at t may be beside it by rounding
  return std::abs(unwrapped(node - corner.t, -0.5)) <= same_t &&
         (bezier.evaluate(corner.t) - corner.p).norm() < same_place &&
         (bezier.tangent(corner.t, Side::Left) - corner.in.normalized()).norm() < same_place &&
         (bezier.tangent(corner.t, Side::Right) - corner.out.normalized()).norm() < same_place;
}

}  // namespace

LinkedCurve LinkedCurve::with_rule(CurveRule rule) const {
  rules_->require_free(rule, *this);
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->rules.push_back(rule);
  if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) rules->add_corner(corner->t);
  result.rules_ = std::move(rules);
  if (const auto* area = std::get_if<HeldArea>(&rule.rule)) {
    result.read_slot(bezier_slot);
    LinkedCurve before = result;
    before.area_missing_ = area->area - signed_area(result.bezier().contour());
    result.report_ = {.rounds = 1, .changed = result.rules_->held().outside(whole_curve)};
    result.give_back_area(before);
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (i != bezier_slot) result.slots_[i].stale.add(IntervalSet(result.report_.changed));
    }
    result.current_ = bezier_slot;
    return result;
  }
  // What it claims is given in as it is: that is moved to where it holds.
  const auto control = Rules::control_of(rule);
  if (!control || std::holds_alternative<Frozen>(rule.rule)) return result;
  if (const auto* corner = std::get_if<HeldCorner>(&rule.rule); corner && passes(result.bezier(), *corner))
    return result;
  SampledSplice splice = result.sample(*control, 0.5 * sampling_share * epsilon());
  for (const double corner : result.rules_->corners) {
    if (const auto at = sample_at(splice, corner)) add_pin(splice, {.t = *at, .is_corner = true});
  }
  return result.with_splices({splice});
}

LinkedCurve LinkedCurve::without_rule(const std::string& name) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  if (std::erase_if(rules->rules, [&](const CurveRule& rule) { return rule.name == name; }) == 0) {
    throw InvalidInput(text("LinkedCurve::without_rule: there is no rule named ", name));
  }
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::with_frozen(const Interval& interval) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->frozen.add(interval);
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::without_frozen(const Interval& interval) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->frozen.subtract(interval);
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::with_corner(double t) const {
  if (!std::isfinite(t)) throw InvalidInput("LinkedCurve::with_corner: t is not finite");
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->add_corner(t);
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::without_corner(double t) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  std::erase_if(rules->corners, [t](double corner) { return std::abs(unwrapped(corner - t, -0.5)) < same_place; });
  result.rules_ = std::move(rules);
  return result;
}

LinkedCurve LinkedCurve::with_marks(std::optional<Interval> marks) const {
  LinkedCurve result = *this;
  auto rules = std::make_shared<Rules>(*rules_);
  rules->marks = marks;
  result.rules_ = std::move(rules);
  return result;
}

namespace {

using KnownNodes = std::vector<std::optional<double>>;  // t by node

/// Of samples over t from 0 the place nearest to a point between two places, in any turn; half way if there is none.
double nearest_place(const std::vector<Sample>& samples, const Point& p, double from, double to) {
  double best = std::numeric_limits<double>::infinity();
  double t = 0.5 * (from + to);
  for (const double turn : {0.0, 1.0, 2.0}) {
    for (const Sample& sample : samples) {
      const double at = sample.t + turn;
      if (at > from && at < to && (sample.p - p).squaredNorm() < best) {
        best = (sample.p - p).squaredNorm();
        t = at;
      }
    }
  }
  return t;
}

/// Gives corners that no node is known to lie at to the nearest node that has no place yet.
void place_corners(const LinkedBezier& old, const std::vector<double>& corners, const BezierContour& contour,
                   double tolerance, KnownNodes& node) {
  const auto is_known = [&](double t) {
    return std::any_of(node.begin(), node.end(), [t](const std::optional<double>& known) {
      return known && std::abs(unwrapped(*known - t, -0.5)) < same_place;
    });
  };
  for (const double corner : corners) {
    if (is_known(corner)) continue;  // the end of a kept piece
    const Point p = old.evaluate(corner);
    double best = 4.0 * std::max(tolerance, 1e-9);
    std::optional<std::size_t> found;
    for (int s = 0; s < contour.segment_count(); ++s) {
      const auto i = static_cast<std::size_t>(s);
      const double off = (contour.segment(s).start() - p).norm();
      if (!node[i] && off < best) {
        best = off;
        found = i;
      }
    }
    if (found) node[*found] = corner;
  }
}

/// t of all nodes round the contour from a known one on, others at the nearest place between: they rise unless the
/// contour doubles back on itself.
std::vector<double> places_from(std::size_t first, const BezierContour& contour, const KnownNodes& node,
                                const std::vector<Sample>& samples) {
  const auto nearest = [&](const Point& p, double from, double to) { return nearest_place(samples, p, from, to); };
  double last = *node[first];
  const double end = last + 1.0;
  std::vector<double> places;
  for (std::size_t k = 0; k < node.size(); ++k) {
    const std::size_t i = (first + k) % node.size();
    if (k > 0) {
      // The next one known bounds it, and those between share what is left.
      std::size_t ahead = k;
      double bound = end;
      for (; ahead < node.size(); ++ahead) {
        if (const auto& known = node[(first + ahead) % node.size()]) {
          bound = unwrapped(*known, last);
          break;
        }
      }
      if (ahead == k) {
        last = bound;
      } else {
        const double least = (bound - last) * 1e-3 / static_cast<double>(ahead - k + 1);
        last = nearest(contour.segment(static_cast<int>(i)).start(), last + least,
                       bound - least * static_cast<double>(ahead - k));
      }
    }
    places.push_back(last);
  }
  return places;
}

/// The curve with runs of new pieces in place of what was there, so that what is kept is not touched at all; and where.
std::pair<LinkedBezier, IntervalSet> with_new_runs(const LinkedBezier& old,
                                                   const std::vector<LinkedBezier::Piece>& compact,
                                                   const std::vector<bool>& is_kept) {
  LinkedBezier next = old;
  IntervalSet changed;
  std::size_t begin = 0;
  while (begin < compact.size() && !is_kept[begin]) ++begin;
  if (begin == compact.size()) {
    changed = everything();
    next = old.replaced({compact.front().t, compact.front().t}, compact);
  }
  for (std::size_t k = begin; k < begin + compact.size() && !compact.empty() && begin < compact.size();) {
    std::vector<LinkedBezier::Piece> run;
    const std::size_t from = k;
    for (; k < begin + compact.size() && !is_kept[k % compact.size()]; ++k) {
      run.push_back(compact[k % compact.size()]);
      if (k >= compact.size()) run.back().t += 1.0;
    }
    if (run.empty()) {
      ++k;
      continue;
    }
    const Interval interval{wrapped(compact[from % compact.size()].t), wrapped(compact[k % compact.size()].t)};
    next = next.replaced(interval, run);
    changed.add(interval);
  }
  return {std::move(next), std::move(changed)};
}

}  // namespace

LinkedCurve LinkedCurve::compacted(double tolerance) const {
  if (!(tolerance >= 0.0) || !std::isfinite(tolerance)) {
    throw InvalidInput(text("LinkedCurve::compacted: tolerance ", tolerance));
  }
  const LinkedBezier& old = bezier();
  const BezierContour source = raised_to_cubics(old.contour());
  // What is held stays, and so do the pieces beside a held place or in a line.
  const IntervalSet held = rules_->held();
  std::vector<LinkedBezier::Piece> pieces;
  CompactOptions options{.tolerance = tolerance,
                         .extrema = Extrema::Free,
                         .coordinates = Coordinates::Any,
                         .corner_angle = rules_->options.corner_angle};
  for (int i = 0; i < old.size(); ++i) {
    pieces.push_back(old.piece(i));
    const Interval own{pieces.back().t, old.end(i)};
    const bool is_claimed = rules_->claims(own.from) || rules_->claims(own.to);
    if (is_claimed || held.overlaps(own)) options.kept_segments.push_back(i);
    const auto corner = std::lower_bound(rules_->corners.begin(), rules_->corners.end(), own.from - same_place);
    if (corner != rules_->corners.end() && *corner < own.from + same_place) {
      options.corners.push_back(source.node(i));
    }
  }
  if (static_cast<int>(options.kept_segments.size()) == old.size()) return *this;
  const CompactFit fit = fit_compact(source, options);
  if (fit.kept || fit.contour.segment_count() >= old.size()) return *this;

  // Where nodes lie on t: those of kept pieces as before, corners at theirs, others at the nearest place between.
  const BezierContour& contour = fit.contour;
  const int n = contour.segment_count();
  KnownNodes node(static_cast<std::size_t>(n));
  std::vector<int> piece_of(static_cast<std::size_t>(n), -1);
  for (std::size_t k = 0; k < fit.kept_at.size(); ++k) {
    const auto at = static_cast<std::size_t>(fit.kept_at[k]);
    const int own = options.kept_segments[k];
    piece_of[at] = own;
    node[at] = pieces[static_cast<std::size_t>(own)].t;
    node[(at + 1) % node.size()] = wrapped(old.end(own));
  }
  place_corners(old, rules_->corners, contour, tolerance, node);
  const std::vector<Sample> samples = old.sample(whole_curve, 0.1 * std::max(tolerance, 1e-3)).samples;
  std::size_t first = 0;
  while (first < node.size() && !node[first]) ++first;
  if (first == node.size()) {
    first = 0;
    node[0] = wrapped(nearest_place(samples, contour.segment(0).start(), -1e-9, 1.0));
  }
  const std::vector<double> places = places_from(first, contour, node, samples);
  std::vector<LinkedBezier::Piece> compact;
  std::vector<bool> is_kept;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const std::size_t i = (first + k) % places.size();
    is_kept.push_back(piece_of[i] >= 0);
    compact.push_back(is_kept.back() ? pieces[static_cast<std::size_t>(piece_of[i])]
                                     : LinkedBezier::Piece{0.0, contour.segment(static_cast<int>(i))});
    compact.back().t = places[k];
  }
  for (std::size_t k = 0; k < compact.size(); ++k) {
    const double next = k + 1 < compact.size() ? compact[k + 1].t : compact.front().t + 1.0;
    if (!(next > compact[k].t)) return *this;  // it doubled back on itself: no t for it
  }
  auto [next, changed] = with_new_runs(old, compact, is_kept);
  LinkedCurve result = *this;
  result.slots_[bezier_slot].form = std::make_shared<const LinkedBezier>(std::move(next));
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (i != bezier_slot) result.slots_[i].stale.add(changed);
  }
  result.current_ = bezier_slot;
  result.report_ = {.rounds = 1, .changed = changed.intervals()};
  if (rules_->find<HeldArea>()) result.give_back_area(*this);
  if (rules_->find<NoAddedCrossing>()) {
    if (const int added = added_meetings(result); added > 0) {
      result = *this;
      result.report_ = {.share = 0.0, .rounds = 1, .added_crossings = added};
      result.report_.refused = text("it would add ", added, " crossings");
    }
  }
  return result;
}

std::size_t LinkedCurve::bytes_beyond(const LinkedCurve& older) const {
  std::size_t bytes = sizeof(LinkedCurve) + slots_.capacity() * sizeof(Slot);
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (!slots_[i].form || i >= older.slots_.size() || slots_[i].form == older.slots_[i].form) continue;
    bytes += slots_[i].form->bytes_beyond(older.slots_[i].form ? *older.slots_[i].form : *slots_[i].form);
  }
  return bytes;
}

}  // namespace fontcore
