#include "fontcore/brush.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {
namespace {

using Eigen::Index;

constexpr double chord_share = 1.0 / 16.0;   // of epsilon: what bent ends may be off between samples
constexpr double least_density = 1.0 / 8.0;  // share of t that a stretch has, against its share of length
constexpr int places_of_length = 64;         // that a curve's length is estimated by

Points points_of(const Run& run) {
  Points points(static_cast<Index>(run.size()), 2);
  for (std::size_t i = 0; i < run.size(); ++i) points.row(static_cast<Index>(i)) = run[i].p;
  return points;
}

double length_of(const Run& run) {
  double length = 0.0;
  for (std::size_t i = 0; i + 1 < run.size(); ++i) length += (run[i + 1].p - run[i].p).norm();
  return length;
}

// Cheap and near enough for what is measured by it: sizes of gestures.
double estimated_length(const LinkedPolyline& polyline) {
  double length = 0.0;
  Point before = polyline.evaluate(0.0);
  for (int k = 1; k <= places_of_length; ++k) {
    const Point next = polyline.evaluate(static_cast<double>(k % places_of_length) / places_of_length);
    length += (next - before).norm();
    before = next;
  }
  return length;
}

Run run_of(const LinkedPolyline& polyline, const Interval& interval) { return polyline.sample(interval, 0.0).samples; }

LinkedPolyline spliced(const LinkedPolyline& polyline, const SampledSplice& splice) {
  return dynamic_cast<const LinkedPolyline&>(*polyline.splice(splice, 0.0));
}

// What of an interval tools may change.
std::vector<Interval> free_parts(const LinkedCurve& curve, const Interval& interval) {
  IntervalSet held(curve.frozen());
  if (curve.marks()) {
    for (const Interval& outside : IntervalSet({*curve.marks()}).outside(whole_curve)) held.add(outside);
  }
  return held.outside(interval);
}

// The marked stretch, or the whole curve from a corner on, if there is one.
std::vector<Interval> marked_parts(const LinkedCurve& curve) {
  if (curve.marks()) return free_parts(curve, *curve.marks());
  const std::vector<double> corners = curve.corners();
  return free_parts(curve, corners.empty() ? whole_curve : Interval{corners.front(), corners.front()});
}

// Two parameters nearer to each other than this are one: t was carried round 1 and back.
constexpr double same_t = 1e-12;

// Which of some parameters lie inside a run, unwrapped as there, ascending.
std::vector<double> within(const std::vector<double>& parameters, const Run& run) {
  std::vector<double> inside;
  for (const double t : parameters) {
    const double at = t > run.front().t - same_t ? t : t + 1.0;
    if (at > run.front().t + same_t && at < run.back().t - same_t) inside.push_back(at);
  }
  std::sort(inside.begin(), inside.end());
  const auto is_one = [](double a, double b) { return b - a <= same_t; };
  inside.erase(std::unique(inside.begin(), inside.end(), is_one), inside.end());
  return inside;
}

// Parameters of places that rules hold.
std::vector<double> held_places(const LinkedCurve& curve) {
  std::vector<double> held;
  for (const CurveRule& rule : curve.rules()) {
    if (const auto* point = std::get_if<HeldPoint>(&rule.rule)) held.push_back(point->t);
    if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) held.push_back(corner->t);
    if (const auto* line = std::get_if<HeldLine>(&rule.rule)) {
      held.push_back(line->interval.from);
      held.push_back(line->interval.to);
    }
  }
  for (double& t : held) t = wrapped(t);
  return held;
}

// A run with samples at parameters, which are from `within`; of a sample that is there by rounding it takes the place.
void add_samples(Run& run, const std::vector<double>& parameters) {
  for (const double t : parameters) {
    const auto after =
        std::partition_point(run.begin(), run.end(), [t](const Sample& sample) { return sample.t < t - same_t; });
    if (after->t <= t + same_t) {
      after->t = t;
      while (after[1].t <= t + same_t) run.erase(after + 1);
      continue;
    }
    const Sample& before = after[-1];
    const double u = (t - before.t) / (after->t - before.t);
    run.insert(after, {t, (1.0 - u) * before.p + u * after->p});
  }
}

// The part of a run from one of its samples to another as a splice, t brought into [0, 1) at its start.
SampledSplice splice_of(const Run& run, std::size_t first, std::size_t last) {
  SampledSplice splice;
  splice.samples.assign(run.begin() + static_cast<std::ptrdiff_t>(first),
                        run.begin() + static_cast<std::ptrdiff_t>(last) + 1);
  const double turns = std::floor(splice.samples.front().t);
  for (Sample& sample : splice.samples) sample.t -= turns;
  splice.interval = {splice.samples.front().t, splice.samples.back().t};
  return splice;
}
SampledSplice splice_of(const Run& run) { return splice_of(run, 0, run.size() - 1); }

// Pins at the corners and held places that lie inside a splice.
void add_pins(const LinkedCurve& curve, SampledSplice& splice) {
  const std::vector<double> corners = within(curve.corners(), splice.samples);
  add_samples(splice.samples, corners);
  for (const double t : corners) {
    const auto pin = std::find_if(splice.pins.begin(), splice.pins.end(),
                                  [t](const Pin& other) { return std::abs(other.t - t) <= same_t; });
    if (pin == splice.pins.end()) {
      splice.pins.push_back({.t = t, .is_corner = true});
    } else {
      pin->t = t;
    }
  }
  std::sort(splice.pins.begin(), splice.pins.end(), [](const Pin& a, const Pin& b) { return a.t < b.t; });
}

// Runs joined end to end in one count of t: each begins where the one before ends.
void append(Run& run, const Run& part) {
  const double shift = run.empty() ? 0.0 : run.back().t - part.front().t;
  for (const Sample& sample : part) {
    if (run.empty() || sample.t + shift > run.back().t) run.push_back({sample.t + shift, sample.p});
  }
}

double least_step(const Run& run) {
  double least = 1.0;
  for (std::size_t i = 0; i + 1 < run.size(); ++i) least = std::min(least, run[i + 1].t - run[i].t);
  return least;
}

// A splice so long for its share of t that its neighbours have to give of theirs: with them, spread by arc length.
SampledSplice with_room(const LinkedCurve& curve, const LinkedPolyline& polyline, SampledSplice splice) {
  const double whole = estimated_length(polyline);
  const auto has_room = [&](const Run& run) {
    return whole * (run.back().t - run.front().t) >= least_density * length_of(run);
  };
  if (has_room(splice.samples)) return splice;
  const double from = splice.samples.front().t;
  const double to = splice.samples.back().t;
  const std::vector<Interval> free = free_parts(curve, whole_curve);
  const auto region =
      std::find_if(free.begin(), free.end(), [&](const Interval& part) { return contains(part, 0.5 * (from + to)); });
  if (region == free.end()) return splice;
  double room_before = 0.5 * (1.0 - (to - from));
  double room_after = room_before;
  if (length(*region) < 1.0) {
    const double most = length(*region) - (to - from);
    const auto up_to = [most](double way) { return way <= most ? way : 0.0; };  // rounding may go all the way round
    room_before = up_to(wrapped(from - region->from));
    room_after = up_to(wrapped(region->to - to));
  }
  Run run;
  double before = 0.0;
  for (double wider = to - from;; wider *= 3.0) {
    before = std::min(wider, room_before);
    const double after = std::min(wider, room_after);
    run.clear();
    if (before > 0.0) append(run, run_of(polyline, {wrapped(from - before), wrapped(from)}));
    append(run, splice.samples);
    if (after > 0.0) append(run, run_of(polyline, {wrapped(to), wrapped(to + after)}));
    if (has_room(run) || (before == room_before && after == room_after)) break;
  }

  // Corners and held places of the neighbours stay at their t; what was drawn is spread.
  const double start = run.front().t + before;
  const double end = start + (to - from);
  const auto of_neighbours = [&](const std::vector<double>& parameters) {
    std::vector<double> inside = within(parameters, run);
    std::erase_if(inside, [&](double t) { return t > start + same_t && t < end - same_t; });
    return inside;
  };
  const std::vector<double> corners = of_neighbours(curve.corners());
  std::vector<double> held = of_neighbours(held_places(curve));
  held.insert(held.end(), corners.begin(), corners.end());
  held = within(held, run);
  add_samples(run, held);
  std::vector<Pin> pins = splice.pins;
  for (Pin& pin : pins) pin.t += start - from;
  for (const double t : corners) {
    std::erase_if(pins, [t](const Pin& pin) { return std::abs(pin.t - t) <= same_t; });
    pins.push_back({.t = t, .is_corner = true});
  }
  std::sort(pins.begin(), pins.end(), [](const Pin& a, const Pin& b) { return a.t < b.t; });
  const Run spread = respaced(run, held);
  SampledSplice result = splice_of(spread);
  for (Pin& pin : pins) {  // each goes with its sample
    const auto sample = std::partition_point(run.begin(), run.end() - 1,
                                             [&](const Sample& s) { return s.t < pin.t - 1e-3 * least_step(run); });
    pin.t = result.samples[static_cast<std::size_t>(sample - run.begin())].t;
  }
  result.pins = std::move(pins);
  return result;
}

double distance_to_path(const Points& path, const Point& x) {
  Run run;
  for (Index i = 0; i < path.rows(); ++i) run.push_back({static_cast<double>(i), path.row(i)});
  return nearest(run, x).distance;
}

}  // namespace

CurvePlace nearest_place(const LinkedCurve& curve, const Point& place) {
  if (!place.allFinite()) throw InvalidInput("nearest_place: a place that is not finite");
  const LinkedPolyline& polyline = curve.polyline();
  Points centre(1, 2);
  centre.row(0) = place;
  for (double radius = 16.0 * curve.epsilon();; radius *= 4.0) {
    NearestPlace found{0.0, std::numeric_limits<double>::infinity()};
    for (const Interval& interval : polyline.near(box_around(centre, radius))) {
      const NearestPlace here = nearest(run_of(polyline, interval), place);
      if (here.distance < found.distance) found = here;
    }
    if (found.distance <= radius) return {wrapped(found.t), polyline.evaluate(found.t), found.distance};
  }
}

// --- Control points ---

namespace {

void require_form(bool is_known, const char* function) {
  if (!is_known) throw InvalidInput(text(function, ": the form has no such control points"));
}

const LinkedWavelet& wavelet_of(const LinkedCurve& curve, FormKind form) {
  return form == FormKind::Arcwise ? curve.arcwise() : curve.wavelet();
}

LinkedCurve with_wavelet_of(const LinkedCurve& curve, FormKind form, const Changed<LinkedWavelet>& changed) {
  return form == FormKind::Arcwise ? curve.with_arcwise(changed) : curve.with_wavelet(changed);
}

// A control point of a wavelet displaced; where two arcs meet, with the end of the other one.
Changed<LinkedWavelet> displaced(const LinkedWavelet& wavelet, const ControlPoint& control, const Points& by) {
  const auto own = wavelet.displace(control.part, control.level, control.index, by);
  const int last = static_cast<int>(wavelet.size(control.level)) - 1;
  const int arcs = wavelet.arc_count();
  if (!is_held(wavelet.scheme()) || (control.index != 0 && control.index != last)) return own;
  const bool is_start = control.index == 0;
  const int other = (control.part + (is_start ? arcs - 1 : 1)) % arcs;
  const auto both = own.form.displace(other, control.level, is_start ? last : 0, by);
  if (arcs < 3) return {both.form, whole_curve};
  return {both.form,
          is_start ? Interval{both.interval.from, own.interval.to} : Interval{own.interval.from, both.interval.to}};
}

}  // namespace

Point place_of(const LinkedCurve& curve, const ControlPoint& control) {
  const auto require = [&](int count) {
    if (control.index < 0 || control.index >= count) {
      throw InvalidInput(text("place_of: control point ", control.index, " of ", count));
    }
  };
  switch (control.form) {
    case FormKind::Bezier: {
      const LinkedBezier& bezier = curve.bezier();
      require(bezier.size());
      const Bezier& piece = bezier.piece(control.index).bezier;
      if (control.part < 0 || control.part > piece.degree) {
        throw InvalidInput(text("place_of: control point ", control.part, " of a piece of degree ", piece.degree));
      }
      return piece.p[static_cast<std::size_t>(control.part)];
    }
    case FormKind::Polyline:
      require(curve.polyline().size());
      return curve.polyline().vertex(control.index).p;
    case FormKind::Spline:
      require(curve.spline().size());
      return curve.spline().control_point(control.index);
    default: {
      const LinkedWavelet& wavelet = wavelet_of(curve, control.form);
      if (control.part < 0 || control.part >= wavelet.arc_count() || control.level < 0) {
        throw InvalidInput(text("place_of: arc ", control.part, ", level ", control.level));
      }
      require(static_cast<int>(wavelet.size(control.level)));
      return wavelet.control_points(control.part, control.level, control.index, 1).row(0);
    }
  }
}

LinkedCurve move_control_point(const LinkedCurve& curve, const ControlPoint& control, const Point& to) {
  switch (control.form) {
    case FormKind::Bezier:
      return curve.with(curve.bezier().move_control_point(control.index, control.part, to));
    case FormKind::Polyline:
      return curve.with(curve.polyline().move_vertex(control.index, to));
    case FormKind::Spline:
      return curve.with(curve.spline().move_control_point(control.index, to));
    default: {
      if (!to.allFinite()) throw InvalidInput("move_control_point: a place that is not finite");
      const Points by = (to - place_of(curve, control)).transpose();
      return with_wavelet_of(curve, control.form, displaced(wavelet_of(curve, control.form), control, by));
    }
  }
}

LinkedCurve add_control_point(const LinkedCurve& curve, FormKind form, double t) {
  if (!std::isfinite(t)) throw InvalidInput("add_control_point: t is not finite");
  for (const Interval& frozen : curve.frozen()) {
    const double way = wrapped(t - frozen.from);
    if (length(frozen) >= 1.0 || (way > 0.0 && way < length(frozen))) {
      throw UnsatisfiableConstraints(text("add_control_point: what is frozen claims t = ", t));
    }
  }
  switch (form) {
    case FormKind::Bezier:
      return curve.with(curve.bezier().add_node(t).form, {});
    case FormKind::Polyline:
      return curve.with(curve.polyline().add_vertex(t, curve.polyline().evaluate(t)).form, {});
    case FormKind::Spline:
      return curve.with(curve.spline().insert_knot(t), {});
    default:
      require_form(false, "add_control_point");
      return curve;
  }
}

LinkedCurve remove_control_point(const LinkedCurve& curve, const ControlPoint& control) {
  switch (control.form) {
    case FormKind::Bezier:
      return curve.with(curve.bezier().remove_node(control.index));
    case FormKind::Polyline:
      return curve.with(curve.polyline().remove_vertex(control.index));
    case FormKind::Spline:
      return curve.with(curve.spline().remove_knot(control.index));
    default:
      require_form(false, "remove_control_point");
      return curve;
  }
}

// --- Direct manipulation ---

double breadth_of(const LinkedCurve& curve, Width width) {
  const double length = estimated_length(curve.polyline());
  switch (width) {
    case Width::Narrow:
      return length / 16.0;
    case Width::Medium:
      return length / 6.0;
    default:
      return length / 2.0;
  }
}

namespace {

// The same curve with knots no farther apart than `span` within `reach` of t.
LinkedSpline refined(LinkedSpline spline, double t, double reach, double span) {
  for (double at = t - reach; at < t + reach;) {
    const int knot = spline.knot_at(wrapped(at));
    const double start = spline.knot(knot);
    const double width = spline.knot(knot + 1) - start;
    if (width > span) {
      spline = spline.insert_knot(wrapped(start + 0.5 * width));
    } else {
      at += std::max(width - wrapped(at - start), 1e-9);
    }
  }
  return spline;
}

// Control points of a spline within half a breadth of t, moved less and less, so that its point at t moves by `move`.
// Where knots are too far apart for that breadth there are more first.
Changed<LinkedSpline> pulled(const LinkedSpline& own, double t, const Point& move, double breadth) {
  constexpr double least_speed = 1e-6;  // of a breadth per turn: where the curve stands still no breadth is that of t
  const double speed = std::max(own.evaluate(t, 1).norm(), least_speed * breadth);
  const double reach = std::clamp(0.5 * breadth / speed, 1e-6, 0.4);
  const LinkedSpline spline = refined(own, t, reach, 0.5 * reach);
  std::vector<std::pair<int, double>> weights;
  const int n = spline.size();
  const int knot = spline.knot_at(t);
  const double turn = std::floor(t - spline.knot(knot));  // knots are counted on round the curve
  const auto place = [&](int index) {
    double sum = 0.0;
    for (int k = 1; k <= spline.degree(); ++k) sum += spline.knot(index + k);
    return sum / spline.degree() + turn;
  };
  // Control point i lies in the mean of knots i + 1 .. i + degree: i rises with it.
  int first = knot - spline.degree();
  while (first > knot - n && place(first - 1) > t - reach) --first;
  for (int i = first; i < first + n && place(i) < t + reach; ++i) {
    const double x = (place(i) - t) / reach;
    if (std::abs(x) < 1.0) weights.emplace_back(i, (1.0 - x * x) * (1.0 - x * x));
  }
  const auto moved = [&](const Point& by) {
    LinkedSpline result = spline;
    for (const auto& [index, weight] : weights) {
      const int point = ((index % n) + n) % n;
      result = result.move_control_point(point, spline.control_point(point) + weight * by).form;
    }
    return result;
  };
  const double gain = moved(Point::UnitX()).evaluate(t).x() - spline.evaluate(t).x();
  const double start = spline.knot(weights.front().first);
  const double end = spline.knot(weights.back().first + spline.degree() + 1);
  return {moved(move / gain), end - start < 1.0 ? Interval{wrapped(start), wrapped(end)} : whole_curve};
}

}  // namespace

LinkedCurve pull(const LinkedCurve& curve, double t, const Point& move, double breadth, FormKind form) {
  if (!std::isfinite(t) || !move.allFinite()) throw InvalidInput("pull: a place or a move that is not finite");
  if (!(breadth > 0.0 && std::isfinite(breadth))) throw InvalidInput(text("pull: a breadth of ", breadth));
  require_form(form != FormKind::Bezier && form != FormKind::Polyline, "pull");
  if (form == FormKind::Spline) return curve.with(pulled(curve.spline(), wrapped(t), move, breadth));
  const LinkedWavelet& wavelet = wavelet_of(curve, form);
  return with_wavelet_of(curve, form, wavelet.pull(t, wavelet.level_of_breadth(t, breadth), move));
}

// --- Sketching ---

namespace {

Stroke averaged(const std::vector<Points>& strokes, const StrokeOptions& options) {
  std::vector<Stroke> tidied;
  for (const Points& stroke : strokes) tidied.push_back(tidy(stroke, options));
  return average(tidied);
}

// A stroke over an interval of t by its arc length, and the t of its corners.
struct DrawnRun {
  Run run;
  std::vector<double> corners;
};
DrawnRun drawn_run(const Stroke& stroke, double from, double to) {
  const Eigen::VectorXd lengths = lengths_along(stroke.points);
  const Index n = lengths.size();
  DrawnRun drawn;
  for (Index i = 0; i < n; ++i) {
    const double t = i + 1 == n ? to : from + lengths[i] / lengths[n - 1] * (to - from);
    const bool is_corner = std::binary_search(stroke.corners.begin(), stroke.corners.end(), static_cast<int>(i));
    if (!drawn.run.empty() && !(t > drawn.run.back().t)) continue;
    drawn.run.push_back({t, stroke.points.row(i)});
    if (is_corner) drawn.corners.push_back(t);
  }
  return drawn;
}

double blend_of(const SketchOptions& options, const Points& line) {
  if (!(options.blend >= 0.0 && std::isfinite(options.blend))) {
    throw InvalidInput(text("sketch: a blend of ", options.blend));
  }
  const Eigen::VectorXd lengths = lengths_along(line);
  return options.blend > 0.0 ? options.blend : 0.1 * lengths[lengths.size() - 1];
}

Point start_direction(const Points& line) { return (line.row(1) - line.row(0)).normalized(); }
Point end_direction(const Points& line) { return (line.row(line.rows() - 1) - line.row(line.rows() - 2)).normalized(); }

// Mean distance of places of an interval from a line.
double distance_from(const LinkedPolyline& polyline, const Interval& interval, const Points& line) {
  constexpr int places = 32;
  constexpr Index most = 128;
  const Index step = std::max<Index>(1, line.rows() / most);
  Run run;
  for (Index i = 0; i < line.rows(); i += step) run.push_back({static_cast<double>(i), line.row(i)});
  run.push_back({static_cast<double>(line.rows()), line.row(line.rows() - 1)});
  double sum = 0.0;
  for (int k = 0; k <= places; ++k) {
    sum += nearest(run, polyline.evaluate(interval.from + length(interval) * k / places)).distance;
  }
  return sum / places;
}

}  // namespace

LinkedCurve sketch(const std::vector<Points>& strokes, const SketchOptions& options, const LinkedOptions& linked) {
  const Stroke stroke = averaged(strokes, options.stroke);
  const Points& line = stroke.points;
  const Point first = line.row(0);
  const Point last = line.row(line.rows() - 1);
  const double blend = blend_of(options, line);
  const bool is_open = (last - first).norm() > blend;
  const double length = lengths_along(line)[line.rows() - 1];
  const double gap = is_open ? (last - first).norm() : 0.0;
  DrawnRun drawn = drawn_run(stroke, 0.0, length / (length + gap));
  if (is_open) {
    // Too far apart to be meant as one: a straight edge closes it.
    drawn.corners.push_back(drawn.run.back().t);
    drawn.corners.push_back(0.0);
  } else {
    const Point start = start_direction(line);
    const Point end = end_direction(line);
    const bool is_corner = std::abs(angle(end, start)) > options.join_angle;
    const Ray meeting{0.5 * (first + last), is_corner ? Point::Zero() : Point((start + end).normalized())};
    drawn.run = with_ends(drawn.run, meeting, meeting, blend, chord_share * linked.epsilon);
    drawn.run.pop_back();
    if (is_corner) drawn.corners.push_back(0.0);
  }
  Polyline polyline;
  for (const Sample& sample : drawn.run) polyline.t.push_back(sample.t);
  polyline.points = points_of(drawn.run);
  LinkedCurve curve(polyline, linked);
  // The corners are those of the stroke, not the turns of its polyline.
  for (const double t : curve.corners()) curve = curve.without_corner(t);
  for (const double t : drawn.corners) curve = curve.with_corner(t);
  return curve;
}

LinkedCurve sketch_over(const LinkedCurve& curve, const std::vector<Points>& strokes, const SketchOptions& options) {
  Stroke stroke = averaged(strokes, options.stroke);
  const LinkedPolyline polyline = curve.polyline();
  const auto turn_round = [&] {
    stroke = average({Stroke{stroke.points.colwise().reverse(), [&] {
                               std::vector<int> corners;
                               for (auto k = stroke.corners.rbegin(); k != stroke.corners.rend(); ++k) {
                                 corners.push_back(static_cast<int>(stroke.points.rows()) - 1 - *k);
                               }
                               return corners;
                             }()}});
  };
  Interval replaced;
  if (options.replaced) {
    replaced = {wrapped(options.replaced->from), wrapped(options.replaced->to)};
    const Point from = polyline.evaluate(replaced.from);
    const Point to = polyline.evaluate(replaced.to);
    const Point first = stroke.points.row(0);
    const Point last = stroke.points.row(stroke.points.rows() - 1);
    if ((from - first).norm() + (to - last).norm() > (from - last).norm() + (to - first).norm()) turn_round();
  } else {
    const double t0 = nearest_place(curve, stroke.points.row(0)).t;
    const double t1 = nearest_place(curve, stroke.points.row(stroke.points.rows() - 1)).t;
    constexpr double same_place = 1e-9;
    if (std::min(wrapped(t1 - t0), wrapped(t0 - t1)) < same_place) {
      throw InvalidInput(text("sketch_over: the stroke begins and ends at one place of the curve, t = ", t0));
    }
    replaced = {t0, t1};
    if (distance_from(polyline, {t1, t0}, stroke.points) < distance_from(polyline, replaced, stroke.points)) {
      replaced = {t1, t0};
      turn_round();
    }
  }

  const LinkedBezier& bezier = curve.bezier();
  const double blend = blend_of(options, stroke.points);
  DrawnRun drawn = drawn_run(stroke, replaced.from, replaced.from + length(replaced));
  const auto join = [&](double t, Side side, const Point& direction) {
    Ray tangent{bezier.evaluate(t), bezier.tangent(t, side)};
    if (std::abs(angle(tangent.direction, direction)) > options.join_angle) tangent.direction.setZero();
    return tangent;
  };
  const Ray start = join(replaced.from, Side::Left, start_direction(stroke.points));
  const Ray end = join(replaced.to, Side::Right, end_direction(stroke.points));
  drawn.run = with_ends(drawn.run, start, end, blend, chord_share * curve.epsilon());
  SampledSplice splice = splice_of(drawn.run);
  for (const double t : drawn.corners) splice.pins.push_back({.t = t, .is_corner = true});
  splice = with_room(curve, polyline, std::move(splice));
  LinkedCurve result = curve.with_splice(splice);
  if (start.direction.isZero(0.0)) result = result.with_corner(replaced.from);
  if (end.direction.isZero(0.0)) result = result.with_corner(replaced.to);
  return result;
}

// --- The spatula ---

LinkedCurve push(const LinkedCurve& curve, const Tip& tip, const Points& path) {
  if (path.rows() == 0 || !path.allFinite()) throw InvalidInput("push: a path that is empty or not finite");
  const LinkedPolyline polyline = curve.polyline();
  LinkedPolyline pushed = polyline;
  IntervalSet changed;
  for (Interval near : polyline.near(box_around(path, tip.extent()))) {
    if (length(near) >= 1.0) {
      // Cut where it is farthest from the path: the ends of a run stay.
      double farthest = -1.0;
      for (int i = 0; i < polyline.size(); ++i) {
        const Sample vertex = polyline.vertex(i);
        const double distance = distance_to_path(path, vertex.p);
        if (distance <= farthest) continue;
        farthest = distance;
        near = {vertex.t, vertex.t};
      }
    }
    for (const Interval& interval : free_parts(curve, near)) {
      Run run = run_of(polyline, interval);
      const std::vector<double> held = within(held_places(curve), run);
      const std::vector<double> kept = within(curve.corners(), run);
      add_samples(run, held);
      add_samples(run, kept);
      const ChangedRun result = push(run, tip, path, held, kept);
      for (const auto& [first, last] : result.changed) {
        const SampledSplice splice = with_room(curve, pushed, splice_of(result.run, first, last));
        pushed = spliced(pushed, splice);
        changed.add(splice.interval);
      }
    }
  }
  return changed.empty() ? curve : curve.with(pushed, changed.intervals());
}

// --- Corners ---

std::vector<CornerHandle> corner_handles(const LinkedCurve& curve) {
  std::vector<CornerHandle> handles;
  for (const CurveRule& rule : curve.rules()) {
    if (const auto* corner = std::get_if<HeldCorner>(&rule.rule)) handles.push_back({rule.name, *corner});
  }
  return handles;
}

namespace {

HeldCorner corner_of(const LinkedCurve& curve, const std::string& name) {
  for (const CornerHandle& handle : corner_handles(curve)) {
    if (handle.name == name) return handle.corner;
  }
  throw InvalidInput(text("no corner of the name ", name));
}

// How far from t the curve is free on a side (+1 or -1), up to `most`: to corners, held places and what is frozen.
double room(const LinkedCurve& curve, double t, double side, double most) {
  std::vector<double> bounds = curve.corners();
  for (const double held : held_places(curve)) bounds.push_back(held);
  for (const Interval& interval : curve.frozen()) {
    bounds.push_back(interval.from);
    bounds.push_back(interval.to);
  }
  constexpr double own = 1e-9;
  for (const double bound : bounds) {
    const double way = wrapped(side * (bound - t));
    if (way > own && way < 1.0 - own) most = std::min(most, way);
  }
  return most;
}

// The curve bent so that it arrives at a point and leaves it in given directions, within the control interval.
LinkedCurve bent(const LinkedCurve& curve, const HeldCorner& corner, bool is_corner) {
  const double accuracy = chord_share * curve.epsilon();
  Run before = curve.sample({wrapped(corner.t - room(curve, corner.t, -1.0, corner.control)), corner.t}).samples;
  Run after = curve.sample({corner.t, wrapped(corner.t + room(curve, corner.t, 1.0, corner.control))}).samples;
  const Ray start{before.front().p, Point::Zero()};
  const Ray end{after.back().p, Point::Zero()};
  before = with_ends(before, start, {corner.p, corner.in.normalized()}, 2.0 * length_of(before), accuracy);
  after = with_ends(after, {corner.p, corner.out.normalized()}, end, 2.0 * length_of(after), accuracy);
  const std::size_t middle = before.size() - 1;
  append(before, after);
  SampledSplice splice = splice_of(before);
  splice.pins.push_back({.t = splice.samples[middle].t,
                         .is_corner = is_corner,
                         .in = corner.in.normalized(),
                         .out = corner.out.normalized()});
  return curve.with_splice(splice);
}

// The rule becomes what the curve came to, where other rules let it go less far than asked.
LinkedCurve with_changed_corner(const LinkedCurve& curve, const std::string& name, HeldCorner corner) {
  const LinkedCurve changed = bent(curve.without_rule(name), corner, true);
  const LinkedBezier& bezier = changed.bezier();
  corner.p = bezier.evaluate(corner.t);
  corner.in = bezier.tangent(corner.t, Side::Left);
  corner.out = bezier.tangent(corner.t, Side::Right);
  return changed.with_rule({name, corner});
}

}  // namespace

LinkedCurve make_corner(const LinkedCurve& curve, double t, double control) {
  if (!std::isfinite(t)) throw InvalidInput("make_corner: t is not finite");
  if (!(control > 0.0 && control < 0.5)) throw InvalidInput(text("make_corner: a control interval of ", control));
  int number = 1;
  std::string name = "corner 1";
  while (std::any_of(curve.rules().begin(), curve.rules().end(),
                     [&](const CurveRule& rule) { return rule.name == name; })) {
    name = text("corner ", ++number);
  }
  // With a node there nothing has to move.
  const LinkedBezier bezier = curve.bezier().add_node(t).form;
  t = bezier.piece(bezier.piece_at(t)).t;  // that of a node which is there already, if one is as near as rounding
  HeldCorner corner{t, bezier.evaluate(t), bezier.tangent(t, Side::Left), bezier.tangent(t, Side::Right), 0.0};
  corner.control = std::min(room(curve, t, -1.0, control), room(curve, t, 1.0, control));
  return curve.with(bezier, {}).with_rule({name, corner});
}

LinkedCurve move_corner(const LinkedCurve& curve, const std::string& name, const Point& to) {
  if (!to.allFinite()) throw InvalidInput("move_corner: a place that is not finite");
  HeldCorner corner = corner_of(curve, name);
  corner.p = to;
  return with_changed_corner(curve, name, corner);
}

LinkedCurve turn_corner(const LinkedCurve& curve, const std::string& name, Side side, const Point& direction) {
  if (!direction.allFinite() || direction.isZero(0.0)) {
    throw InvalidInput("turn_corner: a direction that is 0 or not finite");
  }
  HeldCorner corner = corner_of(curve, name);
  (side == Side::Left ? corner.in : corner.out) = direction.normalized();
  return with_changed_corner(curve, name, corner);
}

LinkedCurve remove_corner(const LinkedCurve& curve, const std::string& name) {
  HeldCorner corner = corner_of(curve, name);
  const Point mean = corner.in.normalized() + corner.out.normalized();
  const LinkedCurve free = curve.without_rule(name).without_corner(corner.t);
  // A cusp has no mean: it goes with the next change there.
  constexpr double least_mean = 1e-6;
  if (mean.norm() < least_mean) return free;
  corner.in = corner.out = mean.normalized();
  return bent(free, corner, false);
}

// --- Marks, freezing ---

LinkedCurve mark(const LinkedCurve& curve, const Points& path, double grip) {
  if (path.rows() < 2 || !path.allFinite()) throw InvalidInput("mark: a path of fewer than two points, or not finite");
  // Along the path t is followed on: it goes over where the curve starts, and no shorter way round is taken.
  double from = nearest_place(curve, path.row(0)).t;
  double way = 0.0;
  double t = from;
  for (Index i = 1; i < path.rows(); ++i) {
    const double next = nearest_place(curve, path.row(i)).t;
    way += std::remainder(next - t, 1.0);
    t = next;
  }
  if (way == 0.0) throw InvalidInput(text("mark: the path ends where it begins, at t = ", from));
  if (curve.marks()) {
    const Point start = path.row(0);
    const double left = (curve.polyline().evaluate(curve.marks()->from) - start).norm();
    const double right = (curve.polyline().evaluate(curve.marks()->to) - start).norm();
    if (std::min(left, right) <= grip) {
      const Interval moved = left <= right ? Interval{t, curve.marks()->to} : Interval{curve.marks()->from, t};
      return curve.with_marks(moved);
    }
  }
  if (std::abs(way) >= 1.0) return curve.with_marks(whole_curve);
  return curve.with_marks(way > 0.0 ? Interval{from, t} : Interval{t, from});
}

LinkedCurve unmark(const LinkedCurve& curve) { return curve.with_marks(std::nullopt); }

namespace {

IntervalSet painted_of(const LinkedCurve& curve, const Points& path, double radius) {
  const LinkedPolyline& polyline = curve.polyline();
  IntervalSet found;
  for (const Interval& interval : polyline.near(box_around(path, radius))) {
    found.add(painted(run_of(polyline, interval), path, radius));
  }
  return found;
}

}  // namespace

LinkedCurve freeze(const LinkedCurve& curve, const Points& path, double radius) {
  LinkedCurve result = curve;
  for (const Interval& interval : painted_of(curve, path, radius).intervals()) result = result.with_frozen(interval);
  return result;
}

LinkedCurve thaw(const LinkedCurve& curve, const Points& path, double radius) {
  LinkedCurve result = curve;
  for (const Interval& interval : painted_of(curve, path, radius).intervals()) result = result.without_frozen(interval);
  return result;
}

LinkedCurve freeze_marked(const LinkedCurve& curve) { return curve.with_frozen(curve.marks().value_or(whole_curve)); }
LinkedCurve thaw_marked(const LinkedCurve& curve) { return curve.without_frozen(curve.marks().value_or(whole_curve)); }

// --- Smoothing, detail ---

namespace {

// Corners and held places of the curve within a run, every one a sample of it from now on.
std::vector<double> sampled_holds(const LinkedCurve& curve, Run& run) {
  std::vector<double> places = curve.corners();
  for (const double t : held_places(curve)) places.push_back(t);
  std::vector<double> holds = within(places, run);
  add_samples(run, holds);
  return holds;
}

}  // namespace

LinkedCurve smooth_marked(const LinkedCurve& curve, double scale) {
  const LinkedPolyline polyline = curve.polyline();
  std::vector<SampledSplice> splices;
  for (const Interval& interval : marked_parts(curve)) {
    Run run = run_of(polyline, interval);
    const std::vector<double> held = sampled_holds(curve, run);
    splices.push_back(splice_of(smoothed(run, scale, held)));
    add_pins(curve, splices.back());
  }
  return splices.empty() ? curve : curve.with_splices(std::move(splices));
}

DetailLibrary copy_detail(const LinkedCurve& curve, const Interval& interval, double scale, DetailFrame frame) {
  DetailLibrary library;
  library.scale = scale;
  library.frame = frame;
  const bool is_whole = length(interval) >= 1.0;
  Points line = points_of(curve.sample(interval).samples);
  if (is_whole) line.conservativeResize(line.rows() - 1, 2);
  library.samples.push_back(extract_detail(line, is_whole, scale, frame));
  return library;
}

LinkedCurve paste_detail(const LinkedCurve& curve, const DetailLibrary& library, double gain, std::uint64_t seed) {
  const LinkedPolyline polyline = curve.polyline();
  std::vector<SampledSplice> splices;
  for (const Interval& interval : marked_parts(curve)) {
    Run run = run_of(polyline, interval);
    std::vector<double> ends = sampled_holds(curve, run);
    ends.push_back(run.back().t);
    auto from = run.begin();
    for (const double end : ends) {
      const auto to = std::partition_point(from, run.end(), [end](const Sample& sample) { return sample.t < end; });
      const Run part(from, to + 1);
      if (length_of(part) >= library.scale) splices.push_back(splice_of(with_detail(part, library, gain, seed++)));
      from = to;
    }
  }
  return splices.empty() ? curve : curve.with_splices(std::move(splices));
}

// --- Selection ---

IntervalSet select_lasso(const LinkedCurve& curve, const Points& lasso) {
  const LinkedPolyline& polyline = curve.polyline();
  IntervalSet found;
  for (const Interval& interval : polyline.near(box_around(lasso))) {
    found.add(inside_lasso(run_of(polyline, interval), lasso));
  }
  return found;
}

std::vector<double> select_across(const LinkedCurve& curve, const Points& stroke) {
  const LinkedPolyline& polyline = curve.polyline();
  std::vector<double> found;
  for (const Interval& interval : polyline.near(box_around(stroke))) {
    for (const double t : crossed(run_of(polyline, interval), stroke)) found.push_back(wrapped(t));
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::size_t> select_across(const std::vector<LinkedCurve>& curves, const Points& stroke) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    if (!select_across(curves[i], stroke).empty()) found.push_back(i);
  }
  return found;
}

}  // namespace fontcore
