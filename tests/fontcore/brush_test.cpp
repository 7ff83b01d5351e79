#include "fontcore/brush.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;
using shapes::points_of;

namespace {

BezierContour letter() { return shapes::letter_a()[0]; }

Points circle_points(double radius, int count) {
  Points points(count, 2);
  for (int i = 0; i < count; ++i) {
    const double a = 2.0 * std::numbers::pi * i / count;
    points.row(i) << radius * std::cos(a), radius * std::sin(a);
  }
  return points;
}

/// Largest distance of two forms at equal t, at many places.
double farthest_apart(const Representation& a, const Representation& b) {
  const SampledSplice x = a.sample(whole_curve, 1e-3);
  const SampledSplice y = b.sample(whole_curve, 1e-3);
  double largest = 0.0;
  for (const SampledSplice* run : {&x, &y}) {
    for (const Sample& sample : run->samples) {
      largest = std::max(largest, (x.at(sample.t) - y.at(sample.t)).norm());
    }
  }
  return largest;
}

/// Segments of the font that are still there, bit for bit.
int kept_segments(const LinkedCurve& curve, const BezierContour& contour) {
  int kept = 0;
  for (int i = 0; i < curve.bezier().size(); ++i) {
    const LinkedBezier::Piece& piece = curve.bezier().piece(i);
    if (piece.source < 0) continue;
    const Bezier original = contour.segment(piece.source);
    REQUIRE(original.degree == piece.bezier.degree);
    for (std::size_t k = 0; k <= static_cast<std::size_t>(original.degree); ++k) {
      REQUIRE(piece.bezier.p[k] == original.p[k]);
    }
    ++kept;
  }
  return kept;
}

void require_in_step(const LinkedCurve& curve) {
  REQUIRE(farthest_apart(curve.bezier(), curve.polyline()) <= curve.epsilon());
  REQUIRE(farthest_apart(curve.spline(), curve.polyline()) <= curve.epsilon());
  REQUIRE(farthest_apart(curve.spline(), curve.bezier()) <= curve.epsilon());
}

double distance_to(const LinkedCurve& curve, const Point& place) { return nearest_place(curve, place).distance; }

}  // namespace

TEST_CASE("a spatula pushed into a letter dents it there and nowhere else", "[brush]") {
  const BezierContour contour = letter();
  const LinkedCurve curve(contour, {.epsilon = 1.0});
  const Tip tip(Circle{60.0});
  const LinkedCurve pushed = push(curve, tip, points_of({{650, 300}, {720, 300}}));  // from inside its stem
  CHECK(distance_to(pushed, {780, 300}) < 2.0);
  require_in_step(pushed);
  const int kept = kept_segments(pushed, contour);
  CHECK(kept >= contour.segment_count() - 2);
  CHECK(kept < contour.segment_count());
  // Nothing farther from the path than the tip and one of its edges.
  const LinkedPolyline& before = curve.polyline();
  for (int i = 0; i < before.size(); ++i) {
    const Sample vertex = before.vertex(i);
    const double way = std::max({0.0, 650.0 - vertex.p.x(), vertex.p.x() - 720.0});
    if (std::hypot(way, vertex.p.y() - 300.0) > 75.0) CHECK(distance_to(pushed, vertex.p) < 1e-9);
  }
  CHECK(distance_to(curve, {764, 300}) < 1e-6);  // the old value is the undo
}

TEST_CASE("a spatula that touches nothing changes nothing", "[brush]") {
  const LinkedCurve curve(letter());
  const LinkedCurve pushed = push(curve, Tip(Circle{10.0}), points_of({{2000, 2000}, {2100, 2000}}));
  CHECK(kept_segments(pushed, letter()) == letter().segment_count());
}

TEST_CASE("a spatula pulls a tail of any length, and t keeps room for more", "[brush]") {
  LinkedCurve curve(shapes::circle(200.0), {.epsilon = 0.5});
  const Tip tip(Circle{20.0});
  Point place(150.0, 0.0);
  for (int step = 0; step < 200; ++step) {
    const Point next = place + Point(8.0, 0.0);
    curve = push(curve, tip, points_of({place, next}));
    place = next;
  }
  CHECK(distance_to(curve, place + Point(20.0, 0.0)) < 0.5);
  const LinkedPolyline& polyline = curve.polyline();
  CHECK(polyline.size() < 3000);
  double least = 1.0;
  for (int i = 0; i + 1 < polyline.size(); ++i)
    least = std::min(least, polyline.vertex(i + 1).t - polyline.vertex(i).t);
  CHECK(least > 1e-7);
  require_in_step(curve);
}

TEST_CASE("what is frozen stays bit for bit under a spatula", "[brush]") {
  const BezierContour contour = letter();
  LinkedCurve curve(contour, {.epsilon = 1.0});
  const Points over = points_of({{764, 250}, {764, 350}});
  curve = freeze(curve, over, 20.0);
  const std::vector<Interval> frozen = curve.frozen();
  REQUIRE(frozen.size() == 1);
  const LinkedCurve pushed = push(curve, Tip(Circle{60.0}), points_of({{650, 300}, {720, 300}}));
  for (int k = 0; k <= 100; ++k) {
    const double t = frozen[0].from + length(frozen[0]) * k / 100.0;
    CHECK((pushed.polyline().evaluate(t) - curve.polyline().evaluate(t)).norm() < 1e-9);
    CHECK((pushed.bezier().evaluate(t) - curve.bezier().evaluate(t)).norm() < 1e-9);
  }
  CHECK(thaw(curve, over, 40.0).frozen().empty());
}

TEST_CASE("a sketched line becomes the curve, its corners become corners", "[brush]") {
  std::vector<Point> house;
  const std::vector<Point> corners{{0, 0}, {400, 0}, {400, 300}, {200, 500}, {0, 300}, {0, 10}};
  for (std::size_t k = 0; k + 1 < corners.size(); ++k) {
    for (int i = 0; i < 40; ++i) house.push_back(corners[k] + i / 40.0 * (corners[k + 1] - corners[k]));
  }
  const LinkedCurve curve = sketch({points_of(house)}, {.stroke = {.corner_angle = 0.6, .corner_reach = 40.0}});
  CHECK(curve.corners().size() == 5);
  for (const Point& corner : corners) CHECK(distance_to(curve, corner) < 12.0);
  CHECK(distance_to(curve, {400, 150}) < 1e-9);

  const Points round = circle_points(300.0, 200);
  const LinkedCurve circle = sketch({round, round});
  CHECK(circle.corners().empty());
  CHECK(farthest_apart(circle.bezier(), circle.polyline()) < circle.epsilon());
  CHECK(distance_to(circle, {-300, 0}) < 1e-6);
}

TEST_CASE("a stroke over a part of a curve replaces it, and the rest stays", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0), {.epsilon = 0.5});
  // A bump over the top, drawn either way; and a long tongue from nearly one place.
  std::vector<Point> bump;
  for (int i = 0; i <= 60; ++i) {
    const double a = std::numbers::pi * (0.25 + 0.5 * i / 60.0);
    const double radius = 300.0 + 60.0 * std::sin(std::numbers::pi * i / 60.0);
    bump.emplace_back(radius * std::cos(a), radius * std::sin(a));
  }
  for (const bool is_backwards : {false, true}) {
    if (is_backwards) std::reverse(bump.begin(), bump.end());
    const LinkedCurve drawn = sketch_over(curve, {points_of(bump)});
    CHECK(distance_to(drawn, {0, 360}) < 1.0);
    CHECK(distance_to(drawn, {0, -300}) < 0.5);
    CHECK(drawn.corners().size() == curve.corners().size());
    require_in_step(drawn);
    // Where it joins, the curve does not turn.
    for (const Point& place : {bump.front(), bump.back()}) {
      const double t = nearest_place(drawn, place).t;
      const Point in = drawn.bezier().tangent(t - 2e-3, Side::Left);
      const Point out = drawn.bezier().tangent(t + 2e-3, Side::Right);
      CHECK(in.dot(out) > 0.98);
    }
  }
  std::vector<Point> tongue;
  for (int i = 0; i <= 100; ++i) tongue.emplace_back(290.0 + 12.0 * i, -10.0);
  for (int i = 1; i <= 100; ++i) tongue.emplace_back(1490.0 - 12.0 * i, 10.0);
  const LinkedCurve long_one = sketch_over(curve, {points_of(tongue)}, {.stroke = {.corner_reach = 10.0}});
  CHECK(distance_to(long_one, {1400, 10}) < 1.0);
  CHECK(distance_to(long_one, {-300, 0}) < 0.5);
  require_in_step(long_one);
}

TEST_CASE("a corner passes its point with both its tangents", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0), {.epsilon = 0.5});
  LinkedCurve cornered = make_corner(curve, 0.31);
  REQUIRE(corner_handles(cornered).size() == 1);
  const std::string name = corner_handles(cornered)[0].name;
  for (double t = 0.0; t < 1.0; t += 0.005) {
    CHECK((cornered.bezier().evaluate(t) - curve.bezier().evaluate(t)).norm() < 1e-9);
  }
  const double t = corner_handles(cornered)[0].corner.t;
  const Point to = corner_handles(cornered)[0].corner.p * 1.2;
  const Point in = Point(-0.6, 0.8);
  const Point out = Point(-0.8, -0.6);
  cornered = move_corner(cornered, name, to);
  cornered = turn_corner(cornered, name, Side::Left, in);
  cornered = turn_corner(cornered, name, Side::Right, out);
  CHECK((cornered.bezier().evaluate(t) - to).norm() < 1e-9);
  CHECK((cornered.bezier().tangent(t, Side::Left) - in).norm() < 1e-9);
  CHECK((cornered.bezier().tangent(t, Side::Right) - out).norm() < 1e-9);
  CHECK((cornered.spline().evaluate(t) - to).norm() < 1e-9);
  CHECK((cornered.spline().evaluate(t, 1, Side::Left).normalized() - in).norm() < 1e-9);
  CHECK((cornered.spline().evaluate(t, 1, Side::Right).normalized() - out).norm() < 1e-9);
  require_in_step(cornered);
  // It holds while other tools work beside it.
  const LinkedCurve pushed = push(cornered, Tip(Circle{40.0}), points_of({to * 0.7, to * 0.9}));
  CHECK((pushed.bezier().evaluate(t) - to).norm() < 1e-9);
  CHECK((pushed.bezier().tangent(t, Side::Left) - in).norm() < 1e-9);

  const LinkedCurve smooth = remove_corner(cornered, name);
  CHECK(corner_handles(smooth).empty());
  CHECK((smooth.bezier().tangent(t, Side::Left) - smooth.bezier().tangent(t, Side::Right)).norm() < 1e-6);
  CHECK_THROWS_AS(move_corner(curve, name, to), InvalidInput);
}

TEST_CASE("corners keep their directions whatever is changed about them, with an area held", "[brush]") {
  for (const BezierContour& contour : {letter(), shapes::circle(300.0)}) {
    LinkedCurve curve = LinkedCurve(contour).with_rule({"area", HeldArea{signed_area(contour)}});
    for (const double t : {0.027, 0.31, 0.33, 0.62, 0.9}) curve = make_corner(curve, t, 0.03);  // 0.31 in reach of 0.33
    REQUIRE(corner_handles(curve).size() == 5);
    const auto require_held = [&] {
      for (const auto& [name, corner] : corner_handles(curve)) {
        INFO(name);
        REQUIRE((curve.bezier().evaluate(corner.t) - corner.p).norm() < 1e-9);
        REQUIRE((curve.bezier().tangent(corner.t, Side::Left) - corner.in.normalized()).norm() < 1e-9);
        REQUIRE((curve.bezier().tangent(corner.t, Side::Right) - corner.out.normalized()).norm() < 1e-9);
      }
      REQUIRE(signed_area(curve.bezier().contour()) == Approx(signed_area(contour)).epsilon(1e-9));
    };
    for (const Interval& marks : {Interval{0.8, 0.1}, Interval{0.55, 0.5}, Interval{0.25, 0.4}, Interval{0.6, 0.59}}) {
      curve = smooth_marked(curve.with_marks(marks), 30.0).with_marks(std::nullopt);
      require_held();
      for (const FormKind form : {FormKind::Spline, FormKind::Wavelet}) {
        curve = pull(curve, wrapped(marks.from + 0.05), {15.0, -10.0}, 300.0, form);
        require_held();
      }
    }
  }
}

TEST_CASE("marks follow a click and a drag, and bound what tools change", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0), {.epsilon = 0.5});
  // Over the place where t begins.
  LinkedCurve marked = mark(curve, points_of({{290, -100}, {300, 0}, {290, 100}}), 10.0);
  REQUIRE(marked.marks().has_value());
  CHECK(contains(*marked.marks(), 0.0));
  CHECK(length(*marked.marks()) < 0.15);
  const Interval before = *marked.marks();
  marked = mark(marked, points_of({{286, 95}, {212, 212}}), 20.0);
  CHECK(marked.marks()->from == before.from);
  CHECK(marked.marks()->to == Approx(0.125).margin(1e-3));

  const LinkedCurve pushed = push(marked, Tip(Circle{50.0}), points_of({{0, 270}, {250, 200}, {265, 0}}));
  for (int k = 0; k <= 100; ++k) {
    const double t = 0.13 + k / 100.0 * 0.75;
    CHECK((pushed.bezier().evaluate(t) - curve.bezier().evaluate(t)).norm() < 1e-9);
  }
  CHECK(distance_to(pushed, {315, 0}) < 1.0);
  CHECK_FALSE(unmark(marked).marks().has_value());
}

TEST_CASE("freezing without a path is of the marked stretch, or of the whole curve", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0), {.epsilon = 0.5});
  const LinkedCurve frozen = freeze_marked(curve.with_marks(Interval{0.2, 0.4}));
  REQUIRE(frozen.frozen().size() == 1);
  CHECK(frozen.frozen()[0].from == 0.2);
  CHECK(frozen.frozen()[0].to == 0.4);
  const LinkedCurve half = thaw_marked(frozen.with_marks(Interval{0.3, 0.5}));
  REQUIRE(half.frozen().size() == 1);
  CHECK(half.frozen()[0].to == 0.3);
  CHECK(thaw_marked(frozen.with_marks(std::nullopt)).frozen().empty());
  const LinkedCurve pushed = push(freeze_marked(curve), Tip(Circle{50.0}), points_of({{0, 270}, {250, 200}, {265, 0}}));
  for (int k = 0; k < 100; ++k) CHECK(pushed.bezier().evaluate(k / 100.0) == curve.bezier().evaluate(k / 100.0));
}

TEST_CASE("smoothing under the marks takes a wiggle away there alone", "[brush]") {
  Points wavy = circle_points(300.0, 600);
  for (int i = 0; i < 600; ++i) wavy.row(i) *= 1.0 + 0.01 * std::sin(i * 0.8);
  const LinkedCurve curve = sketch({wavy});
  const LinkedCurve marked = curve.with_marks(Interval{0.3, 0.6});
  const LinkedCurve smooth = smooth_marked(marked, 200.0);
  for (double t = 0.35; t < 0.55; t += 0.01) {
    INFO("at t = " << t);
    CHECK(std::abs(smooth.polyline().evaluate(t).norm() - 300.0) < 1.0);
  }
  double rough = 0.0;
  for (double t = 0.65; t < 0.85; t += 0.001)
    rough = std::max(rough, std::abs(smooth.polyline().evaluate(t).norm() - 300.0));
  CHECK(rough > 2.5);
}

TEST_CASE("detail copied from one curve and pasted on another is that of the first", "[brush]") {
  Points wavy = circle_points(300.0, 1200);
  for (int i = 0; i < 1200; ++i) wavy.row(i) *= 1.0 + 0.015 * std::sin(i * 2.0 * std::numbers::pi / 20.0);
  const LinkedCurve from = sketch({wavy});
  const LinkedCurve to(shapes::circle(400.0), {.epsilon = 0.5});
  const DetailLibrary library = copy_detail(from, {0.1, 0.9}, 90.0);
  const LinkedCurve pasted = paste_detail(to.with_marks(Interval{0.2, 0.7}), library);
  double largest = 0.0;
  for (double t = 0.3; t < 0.6; t += 0.0005) {
    largest = std::max(largest, std::abs(pasted.polyline().evaluate(t).norm() - 400.0));
  }
  CHECK(largest == Approx(4.5).epsilon(0.15));
  for (double t = 0.71; t < 1.19; t += 0.01)
    CHECK((pasted.bezier().evaluate(t) - to.bezier().evaluate(t)).norm() < 1e-9);
}

TEST_CASE("a lasso and a stroke across select stretches and curves", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0));
  const IntervalSet right = select_lasso(curve, points_of({{0, -400}, {400, -400}, {400, 400}, {0, 400}}));
  REQUIRE(right.intervals().size() == 1);
  CHECK(right.contains(0.0));
  CHECK(length(right.intervals()[0]) == Approx(0.5).margin(1e-3));
  const std::vector<double> across = select_across(curve, points_of({{-400, 0}, {400, 0}}));
  REQUIRE(across.size() == 2);
  CHECK(std::abs(across[1] - across[0]) == Approx(0.5).margin(1e-3));
  const std::vector<LinkedCurve> curves{curve, LinkedCurve(shapes::circle(100.0)), LinkedCurve(shapes::circle(20.0))};
  CHECK(select_across(curves, points_of({{50, 0}, {400, 0}})) == std::vector<std::size_t>{0, 1});
}

TEST_CASE("control points of every form are moved, added and removed", "[brush]") {
  const LinkedCurve curve(letter(), {.epsilon = 1.0});
  for (const FormKind form : {FormKind::Bezier, FormKind::Polyline, FormKind::Spline, FormKind::Wavelet}) {
    const ControlPoint control{.form = form, .index = 2, .level = form == FormKind::Wavelet ? 2 : 0};
    const Point to = place_of(curve, control) + Point(12.0, -7.0);
    const LinkedCurve moved = move_control_point(curve, control, to);
    CHECK((place_of(moved, control) - to).norm() < 1e-9);
    CHECK(farthest_apart(moved.bezier(), moved.polyline()) <= moved.epsilon());
    CHECK(farthest_apart(moved.bezier(), curve.bezier()) > 0.5);
    if (form == FormKind::Wavelet) {
      CHECK_THROWS_AS(add_control_point(curve, form, 0.1234), InvalidInput);
      continue;
    }
    const LinkedCurve more = add_control_point(curve, form, 0.1234);
    CHECK(farthest_apart(more.bezier(), curve.bezier()) <= curve.epsilon());
    const LinkedCurve fewer = remove_control_point(more, control);
    CHECK(farthest_apart(fewer.bezier(), fewer.polyline()) <= fewer.epsilon());
  }
  CHECK_THROWS_AS(place_of(curve, {.form = FormKind::Polyline, .index = 1'000'000}), InvalidInput);
  const LinkedCurve frozen = curve.with_frozen({0.9, 0.2});
  CHECK_THROWS_AS(add_control_point(frozen, FormKind::Bezier, 0.1234), UnsatisfiableConstraints);
  CHECK(add_control_point(frozen, FormKind::Bezier, 0.31).bezier().size() == curve.bezier().size() + 1);
}

TEST_CASE("direct manipulation takes a point where it is wanted, by three widths", "[brush]") {
  const LinkedCurve curve(shapes::circle(300.0), {.epsilon = 0.5});
  for (const FormKind form : {FormKind::Wavelet, FormKind::Spline}) {
    double moved_before = 0.0;
    for (const Width width : {Width::Narrow, Width::Medium, Width::Broad}) {
      const double t = 0.3;
      const Point from = form == FormKind::Spline ? curve.spline().evaluate(t) : curve.wavelet().evaluate(t);
      const LinkedCurve pulled = pull(curve, t, {20.0, 30.0}, breadth_of(curve, width), form);
      const Point to = form == FormKind::Spline ? pulled.spline().evaluate(t) : pulled.wavelet().evaluate(t);
      CHECK((to - from - Point(20.0, 30.0)).norm() < 1e-9);
      double moved = 0.0;  // share of t that moved
      for (int k = 0; k < 1000; ++k) {
        moved += (pulled.bezier().evaluate(k / 1000.0) - curve.bezier().evaluate(k / 1000.0)).norm() > 2.0 ? 1e-3 : 0.0;
      }
      CHECK(moved > moved_before);
      moved_before = moved;
    }
    CHECK(moved_before < 0.8);
  }
  CHECK_THROWS_AS(pull(curve, 0.3, {1.0, 0.0}, 100.0, FormKind::Bezier), InvalidInput);
  CHECK_THROWS_AS(pull(curve, 0.3, {1.0, 0.0}, -1.0), InvalidInput);
}
