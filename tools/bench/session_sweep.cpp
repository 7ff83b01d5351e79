// Random editing sessions with every tool on contours of the bundled fonts: whether forms stay in step, frozen
// stretches and untouched Bezier segments keep their bits, rules hold and nothing crosses that did not.
//
//     session_sweep [OPERATIONS [SEED [FONT ...]]]        10,000 operations on the bundled fonts, if nothing else is
//     said
//
// Exit status 1 if something that was promised does not hold.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <iomanip>
#include <iostream>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "fontcore/brush.h"
#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tools/bench/letter_contours.h"

namespace {

using namespace fontcore;

constexpr unsigned long usual_seed = 19980907;
constexpr int session_length = 50;
constexpr int full_look = 10;           // every so many operations all forms are compared, and crossings looked for
constexpr double epsilon_of_em = 1e-3;  // what an editor shows at a thousand pixels
constexpr double met = 1e-9;            // of points and directions that rules hold
constexpr double area_met = 1e-9;

class Chance {
 public:
  explicit Chance(unsigned from) : engine_(from) {}
  double operator()(double low, double high) { return low + (high - low) * share_(engine_); }
  int below(int count) { return std::min(static_cast<int>((*this)(0.0, count)), count - 1); }

 private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> share_{0.0, 1.0};
};

Points points_of(const std::vector<Point>& list) {
  Points points(static_cast<Eigen::Index>(list.size()), 2);
  for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i];
  return points;
}

/// A curve in the hands of somebody who takes one tool after the other, sizes by the em.
class Session {
 public:
  Session(const LetterContour& model, unsigned number) : chance_(number), em_(model.em), curve_(start_of(model)) {}

  const LinkedCurve& curve() const { return curve_; }
  struct Step {
    std::string tool;
    std::optional<IntervalSet> allowed{};  ///< where it may change anything, if its report does not say
  };
  /// One operation; what rules refuse leaves the curve.
  Step take() {
    using Tool = Step (Session::*)();
    constexpr std::array<Tool, 17> tools{&Session::push_circle, &Session::push_shape,  &Session::pull_wavelet,
                                         &Session::pull_arc,    &Session::pull_spline, &Session::draw_over,
                                         &Session::drag_point,  &Session::add_point,   &Session::drop_point,
                                         &Session::new_corner,  &Session::drag_corner, &Session::drop_corner,
                                         &Session::mark_some,   &Session::freeze_some, &Session::smooth_some,
                                         &Session::paste_some,  &Session::compact_it};
    return (this->*tools[static_cast<std::size_t>(chance_.below(static_cast<int>(tools.size())))])();
  }

 private:
  static constexpr FormKind forms[] = {FormKind::Bezier, FormKind::Polyline, FormKind::Spline, FormKind::Wavelet,
                                       FormKind::Arcwise};

  LinkedCurve start_of(const LetterContour& model) {
    LinkedCurve curve(model.contour, {.epsilon = epsilon_of_em * em_});
    curve = curve.with_rule({"no crossing", NoAddedCrossing{}});
    if (chance_.below(2) == 0) curve = curve.with_rule({"area", HeldArea{signed_area(model.contour)}});
    return curve;
  }

  double t() { return chance_(0.0, 1.0); }
  double size(double low, double high) { return em_ * chance_(low, high); }
  Point move(double most) {
    const double angle = chance_(0.0, 2.0 * std::numbers::pi);
    return size(0.0, most) * Point(std::cos(angle), std::sin(angle));
  }
  Point on_curve() { return curve_.polyline().evaluate(t()); }
  Points path(double reach) {
    const Point from = on_curve() + move(reach);
    return points_of({from, from + move(reach), from + move(reach)});
  }
  static std::optional<IntervalSet> nowhere() { return IntervalSet(); }

  Step push_circle() {
    curve_ = push(curve_, Tip(Circle{size(0.01, 0.05)}), path(0.06));
    return {"spatula"};
  }
  Step push_shape() {
    const double a = size(0.01, 0.03);
    const double b = size(0.01, 0.03);
    const TipShape shape = chance_.below(2) == 0
                               ? TipShape(Ellipse{a, b, chance_(0.0, 3.0)})
                               : TipShape(ConvexPolygon{{{-a, -b}, {a, -b}, {0.3 * a, b}, {-a, 0.8 * b}}});
    curve_ = push(curve_, Tip(shape), path(0.05));
    return {"spatula of another shape"};
  }
  double width() { return breadth_of(curve_, static_cast<Width>(chance_.below(3))); }
  Step pull_by(FormKind form, const char* tool) {
    const double breadth = width();
    curve_ = pull(curve_, t(), move(0.03), breadth, form);
    return {tool};
  }
  Step pull_wavelet() { return pull_by(FormKind::Wavelet, "direct manipulation, wavelet"); }
  Step pull_arc() { return pull_by(FormKind::Arcwise, "direct manipulation, arcs"); }
  Step pull_spline() { return pull_by(FormKind::Spline, "direct manipulation, spline"); }

  Step draw_over() {
    const double from = t();
    const double way = chance_(0.02, 0.15);
    const Point bulge = move(0.04);
    std::vector<Points> strokes;
    for (int stroke = 0; stroke <= chance_.below(3); ++stroke) {
      std::vector<Point> drawn;
      for (int i = 0; i <= 40; ++i) {
        const double x = i / 40.0;
        drawn.push_back(curve_.polyline().evaluate(from + way * x) + std::sin(std::numbers::pi * x) * bulge +
                        move(0.001));
      }
      strokes.push_back(points_of(drawn));
    }
    curve_ = sketch_over(curve_, strokes, {.stroke = {.noise = 0.02 * em_}});
    return {"sketch over"};
  }

  ControlPoint some_point(FormKind form) {
    ControlPoint control{.form = form};
    switch (form) {
      case FormKind::Bezier:
        control.index = chance_.below(curve_.bezier().size());
        control.part = chance_.below(curve_.bezier().piece(control.index).bezier.degree + 1);
        break;
      case FormKind::Polyline:
        control.index = chance_.below(curve_.polyline().size());
        break;
      case FormKind::Spline:
        control.index = chance_.below(curve_.spline().size());
        break;
      default: {
        const LinkedWavelet& wavelet = form == FormKind::Wavelet ? curve_.wavelet() : curve_.arcwise();
        control.part = chance_.below(wavelet.arc_count());
        control.level = chance_.below(4);
        control.index = chance_.below(static_cast<int>(wavelet.size(control.level)));
      }
    }
    return control;
  }
  Step drag_point() {
    const ControlPoint control = some_point(forms[chance_.below(5)]);
    curve_ = move_control_point(curve_, control, place_of(curve_, control) + move(0.01));
    return {"control point moved"};
  }
  Step add_point() {
    const double at = t();
    curve_ = add_control_point(curve_, forms[chance_.below(3)], at);
    return {"control point added", IntervalSet({{wrapped(at - 1e-9), wrapped(at + 1e-9)}})};
  }
  Step drop_point() {
    const ControlPoint control = some_point(forms[chance_.below(3)]);
    // The node at t = 0 stays, and so do the last two.
    const bool is_held = control.form == FormKind::Bezier && (control.index == 0 || curve_.bezier().size() <= 2);
    if (!is_held) curve_ = remove_control_point(curve_, control);
    return {"control point removed"};
  }

  Step new_corner() {
    if (corner_handles(curve_).size() > 3) return drop_corner();
    const double at = t();  // its segment is cut in two there
    curve_ = make_corner(curve_, at, 0.03);
    return {"corner made", IntervalSet({{wrapped(at - 1e-9), wrapped(at + 1e-9)}})};
  }
  Step drag_corner() {
    const std::vector<CornerHandle> handles = corner_handles(curve_);
    if (handles.empty()) return new_corner();
    const auto& [name, corner] = handles[static_cast<std::size_t>(chance_.below(static_cast<int>(handles.size())))];
    const IntervalSet allowed({{wrapped(corner.t - corner.control), wrapped(corner.t + corner.control)}});
    if (chance_.below(2) == 0) {
      curve_ = move_corner(curve_, name, corner.p + move(0.01));
      return {"corner moved", allowed};
    }
    const bool is_left = chance_.below(2) == 0;
    const double angle = chance_(-0.5, 0.5);
    const Point& is = is_left ? corner.in : corner.out;
    const Point to(std::cos(angle) * is.x() - std::sin(angle) * is.y(),
                   std::sin(angle) * is.x() + std::cos(angle) * is.y());
    curve_ = turn_corner(curve_, name, is_left ? Side::Left : Side::Right, to);
    return {"corner turned", allowed};
  }
  Step drop_corner() {
    const std::vector<CornerHandle> handles = corner_handles(curve_);
    if (handles.empty()) return new_corner();
    const CornerHandle& handle = handles[static_cast<std::size_t>(chance_.below(static_cast<int>(handles.size())))];
    curve_ = remove_corner(curve_, handle.name);
    const HeldCorner& corner = handle.corner;
    return {"corner removed", IntervalSet({{wrapped(corner.t - corner.control), wrapped(corner.t + corner.control)}})};
  }

  Step mark_some() {
    if (curve_.marks()) {
      curve_ = unmark(curve_);
    } else {
      const double from = t();
      std::vector<Point> way;
      for (int k = 0; k <= 8; ++k) way.push_back(curve_.polyline().evaluate(from + 0.04 * k));
      curve_ = mark(curve_, points_of(way), 0.01 * em_);
    }
    return {"marks", nowhere()};
  }
  Step freeze_some() {
    const Points way = points_of({on_curve()});
    const double radius = size(0.02, 0.06);
    curve_ = chance_.below(2) == 0 ? freeze(curve_, way, radius) : thaw(curve_, way, 2.0 * radius);
    return {"freezing", nowhere()};
  }
  Step smooth_some() {
    const LinkedCurve before = curve_;
    if (!before.marks()) curve_ = curve_.with_marks(Interval{t(), t()});
    curve_ = smooth_marked(curve_, size(0.01, 0.1)).with_marks(before.marks());
    return {"smoothing"};
  }
  Step paste_some() {
    const double from = t();
    const double scale = size(0.03, 0.06);
    const LinkedCurve before = curve_;
    const DetailLibrary library = copy_detail(curve_, {from, wrapped(from + 0.4)}, scale);
    if (!before.marks()) curve_ = curve_.with_marks(Interval{t(), t()});
    curve_ = paste_detail(curve_, library, chance_(0.0, 1.5)).with_marks(before.marks());
    return {"detail"};
  }
  Step compact_it() {
    curve_ = curve_.compacted(0.25 * curve_.epsilon());
    return {"compaction"};
  }

  Chance chance_;
  double em_;
  LinkedCurve curve_;
};

double farthest_apart(const Representation& a, const Representation& b) {
  const SampledSplice x = a.sample(whole_curve, 1e-2);
  const SampledSplice y = b.sample(whole_curve, 1e-2);
  double largest = 0.0;
  for (const SampledSplice* run : {&x, &y}) {
    for (const Sample& sample : run->samples) largest = std::max(largest, (x.at(sample.t) - y.at(sample.t)).norm());
  }
  return largest;
}

bool is_same(const Bezier& a, const Bezier& b) {
  if (a.degree != b.degree) return false;
  for (std::size_t k = 0; k <= static_cast<std::size_t>(a.degree); ++k) {
    if (a.p[k] != b.p[k]) return false;
  }
  return true;
}

/// What does not hold after an operation, in a line each.
class Examination {
 public:
  explicit Examination(const BezierContour& contour) : crossings_(find_crossings({contour})) {}

  std::vector<std::string> look(const LinkedCurve& before, const LinkedCurve& after, const Session::Step& step,
                                bool is_full) {
    faults_.clear();
    untouched_segments(before, after, step.allowed.value_or(IntervalSet(after.report().changed)));
    frozen_stretches(before, after);
    rules(after);
    if (is_full) {
      forms(after);
      crossings(after);
    }
    return faults_;
  }
  double largest_gap() const { return largest_gap_; }

 private:
  template <typename... Facts>
  void fault(const Facts&... facts) {
    faults_.push_back(text(facts...));
  }

  void untouched_segments(const LinkedCurve& before, const LinkedCurve& after, const IntervalSet& changed) {
    const LinkedBezier& old = before.bezier();
    const LinkedBezier& now = after.bezier();
    for (int i = 0; i < old.size(); ++i) {
      const double from = old.piece(i).t;
      const double to = old.end(i);
      if (changed.overlaps({from, wrapped(to)})) continue;
      const int same = now.piece_at(from);
      if (now.piece(same).t != from || !is_same(old.piece(i).bezier, now.piece(same).bezier)) {
        fault("segment at t ", from, " lost its bits though nothing changed there");
        return;
      }
    }
  }
  void frozen_stretches(const LinkedCurve& before, const LinkedCurve& after) {
    const LinkedBezier& old = before.bezier();
    const LinkedBezier& now = after.bezier();
    for (const Interval& interval : before.frozen()) {
      for (const int i : old.pieces(interval)) {
        const double from = old.piece(i).t;
        if (!IntervalSet({interval}).outside({from, wrapped(old.end(i))}).empty()) continue;
        const int same = now.piece_at(from);
        if (now.piece(same).t != from || !is_same(old.piece(i).bezier, now.piece(same).bezier)) {
          fault("a frozen segment at t ", from, " lost its bits");
          return;
        }
      }
      for (int k = 0; k <= 8; ++k) {
        const double t = interval.from + length(interval) * k / 8.0;
        const double apart = (old.evaluate(t) - now.evaluate(t)).norm();
        if (apart > met) {
          fault("a frozen place at t ", t, " moved by ", apart);
          return;
        }
      }
    }
  }
  void rules(const LinkedCurve& after) {
    for (const auto& [name, corner] : corner_handles(after)) {
      const double apart = (after.bezier().evaluate(corner.t) - corner.p).norm();
      const double in = (after.bezier().tangent(corner.t, Side::Left) - corner.in.normalized()).norm();
      const double out = (after.bezier().tangent(corner.t, Side::Right) - corner.out.normalized()).norm();
      if (std::max({apart, in, out}) > met) fault(name, " is off by ", apart, ", its tangents by ", in, ", ", out);
    }
    for (const CurveRule& rule : after.rules()) {
      const auto* area = std::get_if<HeldArea>(&rule.rule);
      if (area == nullptr) continue;
      const double is = signed_area(after.bezier().contour());
      const double error = std::abs(is - area->area) / std::abs(area->area);
      // What could not be met is reported by the change that could not; until another gives it back it stays.
      const double known = std::max(area_met + after.report().area_error, area_known_);
      if (error > known) fault("the area is off by ", error, ", its report says ", after.report().area_error);
      area_known_ = error > area_met ? error + area_met : 0.0;
    }
  }
  void forms(const LinkedCurve& after) {
    const std::array<std::pair<const char*, const Representation*>, 5> all{{{"polyline", &after.polyline()},
                                                                            {"spline", &after.spline()},
                                                                            {"wavelet", &after.wavelet()},
                                                                            {"arcwise", &after.arcwise()},
                                                                            {"bezier", &after.bezier()}}};
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t k = i + 1; k < all.size(); ++k) {
        const double gap = farthest_apart(*all[i].second, *all[k].second);
        largest_gap_ = std::max(largest_gap_, gap / after.epsilon());
        if (gap > after.epsilon()) {
          fault(all[i].first, " and ", all[k].first, " are ", gap / after.epsilon(), " epsilon apart");
        }
      }
    }
  }
  void crossings(const LinkedCurve& after) {
    const std::vector<Crossing> now = find_crossings({after.bezier().contour()});
    const int added = added_crossings(crossings_, now);
    if (added > 0) fault(added, " crossings more");
    crossings_ = now;
  }

  std::vector<Crossing> crossings_;
  std::vector<std::string> faults_;
  double largest_gap_ = 0.0;
  double area_known_ = 0.0;
};

struct Tally {
  long taken = 0;
  long refused = 0;
  long faults = 0;
  double seconds = 0.0;
};

}  // namespace

int main(int argc, char** argv) {
  const long operations = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 10'000;
  const auto seed = static_cast<unsigned>(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : usual_seed);
  std::vector<std::string> fonts(argv + std::min(argc, 3), argv + argc);
  if (fonts.empty()) {
    for (const char* name : {"liberation-serif/LiberationSerif-Regular.ttf", "open-sans/OpenSans-Bold.ttf",
                             "cabin/Cabin-Regular.otf", "eb-garamond/EBGaramond12-Regular.otf"}) {
      fonts.push_back(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name);
    }
  }
  const std::vector<LetterContour> models = letter_contours(fonts);
  Chance chance(seed);
  std::map<std::string, Tally> tallies;
  long faults = 0;
  double largest_gap = 0.0;
  int most_pieces = 0;
  for (long done = 0; done < operations;) {
    const LetterContour& model = models[static_cast<std::size_t>(chance.below(static_cast<int>(models.size())))];
    const auto number = static_cast<unsigned>(done) + seed;
    Session session(model, number);
    Examination examination(model.contour);
    for (int k = 0; k < session_length && done < operations; ++k, ++done) {
      const LinkedCurve before = session.curve();
      Session::Step step{"refused"};
      const auto start = std::chrono::steady_clock::now();
      bool is_refused = false;
      std::vector<std::string> found;
      try {
        step = session.take();
      } catch (const UnsatisfiableConstraints&) {
        is_refused = true;
      } catch (const Error& error) {
        found.push_back(error.what());
      }
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
      if (found.empty() && !is_refused) {
        found = examination.look(before, session.curve(), step, (k + 1) % full_look == 0);
      }
      Tally& tally = tallies[step.tool];
      ++tally.taken;
      tally.refused += is_refused ? 1 : 0;
      tally.seconds += took.count();
      tally.faults += static_cast<long>(found.size());
      faults += static_cast<long>(found.size());
      for (const std::string& fault : found) {
        std::cerr << model.name << ", session " << number << ", operation " << k << ", " << step.tool << ": " << fault
                  << '\n';
      }
      most_pieces = std::max(most_pieces, session.curve().bezier().size());
    }
    largest_gap = std::max(largest_gap, examination.largest_gap());
  }
  std::cout << "operations  faults   ms each\n" << std::fixed << std::setprecision(3);
  for (const auto& [tool, tally] : tallies) {
    std::cout << std::setw(10) << tally.taken << std::setw(8) << tally.faults << std::setw(10)
              << 1e3 * tally.seconds / static_cast<double>(tally.taken) << "  " << tool << '\n';
  }
  std::cout << "forms at most " << largest_gap << " epsilon apart; at most " << most_pieces << " Bezier pieces; "
            << faults << " faults\n";
  return faults == 0 ? 0 : 1;
}
