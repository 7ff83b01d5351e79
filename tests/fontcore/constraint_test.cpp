#include "fontcore/constraint.h"

#include <limits>

#include "fontcore/error.h"
#include "fontcore/solve.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr std::array schemes = {Scheme::Chaikin,       Scheme::Orthogonal,    Scheme::EndpointQuadratic,
                                Scheme::EndpointCubic, Scheme::HeldQuadratic, Scheme::HeldCubic};

Eigen::Index points_of_spans(Scheme scheme, Eigen::Index spans) {
  return is_closed(scheme) ? spans : spans + degree(scheme);
}

Eigen::VectorXd flat(const Points& points) { return points.reshaped<Eigen::RowMajor>(); }
Points unflat(const Eigen::VectorXd& flat) { return flat.reshaped<Eigen::RowMajor>(flat.size() / 2, 2); }

Eigen::SparseMatrix<double> identity(const Points& points) {
  Eigen::SparseMatrix<double> H(2 * points.rows(), 2 * points.rows());
  H.setIdentity();
  return H;
}

// Points moved by the least change from a wish under rows that must not contradict each other.
Points moved(const Points& points, const Rows& rows, const Points& wish) {
  RowElimination elimination(static_cast<int>(2 * points.rows()));
  elimination.add(rows);
  CHECK(elimination.conflicts().empty());
  return points + unflat(LeastChange(identity(points), elimination).solve(flat(wish)).displacement);
}

Points moved(const Points& points, const Rows& rows, unsigned seed = 1) {
  return moved(points, rows, shapes::random_points(points.rows(), seed, 60.0));
}

BezierContour moved(const BezierContour& contour, const Rows& rows, unsigned seed = 1) {
  return contour.with_points(moved(contour.points(), rows, seed));
}

void append(Rows& all, const Rows& more) { all.insert(all.end(), more.begin(), more.end()); }

// How far two directions are from being parallel.
double sine_between(const Point& a, const Point& b) { return std::abs(cross(a, b)) / (a.norm() * b.norm()); }

Point row(const Points& points, Eigen::Index i) { return points.row(i).transpose(); }

// A spline's derivative by differences that are exact for its degree while t - 2h and t + 2h lie on the same piece.
Point slope(Scheme scheme, const Points& points, double t) {
  const double h = 0.05;
  const auto at = [&](double s) -> Point { return evaluate(scheme, points, s).transpose(); };
  return (8.0 * (at(t + h) - at(t - h)) - (at(t + 2.0 * h) - at(t - 2.0 * h))) / (12.0 * h);
}

// An H: two stems 80 and 90 wide, a bar.
BezierContour letter_h() {
  return shapes::polygon({{0, 0},
                          {80, 0},
                          {80, 300},
                          {300, 300},
                          {300, 0},
                          {390, 0},
                          {390, 700},
                          {300, 700},
                          {300, 380},
                          {80, 380},
                          {80, 700},
                          {0, 700}});
}

}  // namespace

TEST_CASE("places and derivatives of outlines are weighted sums of their points", "[constraint]") {
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::circle(400)}) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      for (const double u : {0.0, 0.3, 1.0}) {
        const Bezier bezier = contour.segment(s);
        CHECK((curve_at(contour, s, u).value - evaluate(bezier, u)).norm() < 1e-12 * 2048);
        CHECK((curve_at(contour, s, u, 1).value - derivative(bezier, u)).norm() < 1e-12 * 2048);
        const Point second = (derivative(bezier, u + 0.1) - derivative(bezier, u - 0.1)) / 0.2;
        CHECK((curve_at(contour, s, u, 2).value - second).norm() < 1e-10 * 2048);
      }
    }
  }
}

TEST_CASE("places and derivatives of splines are weighted sums of their control points, by every scheme",
          "[constraint]") {
  for (const Scheme scheme : schemes) {
    const Points points = shapes::random_points(points_of_spans(scheme, 8), 3);
    for (const double t : {0.3, 3.25, 6.7}) {
      CHECK((curve_at(scheme, points, t).value - evaluate(scheme, points, t).transpose()).norm() < 1e-10);
      CHECK((curve_at(scheme, points, t, 1).value - slope(scheme, points, t)).norm() < 1e-8);
      const Point second =
          (curve_at(scheme, points, t + 0.1, 1).value - curve_at(scheme, points, t - 0.1, 1).value) / 0.2;
      CHECK((curve_at(scheme, points, t, 2).value - second).norm() < 1e-8);
    }
  }
  // Closed by hand: at a knot the derivative is the leg between two control points.
  const Points ring = shapes::random_points(8, 4);
  CHECK((curve_at(Scheme::Chaikin, ring, 2.5, 1).value - (row(ring, 3) - row(ring, 2))).norm() < 1e-9);
  CHECK((curve_at(Scheme::Chaikin, ring, -0.5, 1).value - (row(ring, 0) - row(ring, 7))).norm() < 1e-9);
  CHECK((curve_at(Scheme::EndpointCubic, ring, 0.0, 1).value - 3.0 * (row(ring, 1) - row(ring, 0))).norm() < 1e-9);
  CHECK((curve_at(Scheme::EndpointCubic, ring, 5.0, 1).value - 3.0 * (row(ring, 7) - row(ring, 6))).norm() < 1e-9);
}

TEST_CASE("a pinned place moves by what is asked, on outlines and by every scheme", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  const BezierContour after = moved(a, rows(Pinned{curve_at(a, 9, 0.4), Point(12, -5)}));
  CHECK((evaluate(after.segment(9), 0.4) - evaluate(a.segment(9), 0.4) - Point(12, -5)).norm() < 1e-9);
  for (const Scheme scheme : schemes) {
    const Points points = shapes::random_points(points_of_spans(scheme, 8), 5);
    const Points now = moved(points, rows(Pinned{curve_at(scheme, points, 3.2), Point(0, 30)}));
    CHECK((evaluate(scheme, now, 3.2) - evaluate(scheme, points, 3.2) - Eigen::RowVector2d(0, 30)).norm() < 1e-9);
  }
  CHECK(rows(Pinned{point_of(a.points(), 0), Point(3, 0)})[0].name == "point 0 goes to x = 468");
  CHECK(rows(Pinned{point_of(a.points(), 0), Point(3, 0)})[1].name == "point 0 stays at y = 961");
}

TEST_CASE("a tangent keeps its direction, takes a given one, or is orthogonal to one, exactly", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  for (const Scheme scheme : schemes) {
    const Points points = shapes::random_points(points_of_spans(scheme, 8), 6);
    const WeightedSum tangent = curve_at(scheme, points, 2.2, 1);
    const auto after = [&](const Rows& rows) { return slope(scheme, moved(points, rows), 2.2); };
    CHECK(sine_between(after(rows(TangentDirection{tangent, {}})), tangent.value) < 1e-9);
    CHECK(sine_between(after(rows(TangentDirection{tangent, Point(2, 1)})), Point(2, 1)) < 1e-9);
    CHECK((after(rows(TangentDirection{tangent, {}, Tangent::Whole})) - tangent.value).norm() < 1e-8);
    const Point turned = after(rows(TangentDirection{tangent, Point(2, 1), Tangent::Whole}));
    CHECK(turned.norm() == Approx(tangent.value.norm()).epsilon(1e-9));
    CHECK(sine_between(turned, Point(2, 1)) < 1e-9);
    CHECK(sine_between(after(rows(Orthogonal{tangent, Point(3, -1)})), Point(1, 3)) < 1e-9);
  }
  const Rows turned = rows(TangentDirection{curve_at(a, 9, 0.5, 1), Point(-1, -1)});
  CHECK(turned[0].name == "tangent of the outline at 0.5 of segment 9 turns to 45 degrees");
  CHECK(sine_between(derivative(moved(a, turned).segment(9), 0.5), Point(1, 1)) < 1e-9);
}

TEST_CASE("two tangents are made orthogonal by rows taken anew, and at once where one is held", "[constraint]") {
  const Points before = shapes::random_points(12, 7);
  const auto first = [](const Points& points) { return curve_at(Scheme::Chaikin, points, 2.2, 1); };
  const auto second = [](const Points& points) { return curve_at(Scheme::Chaikin, points, 7.9, 1); };
  const auto cosine = [&](const Points& points) {
    const Point a = slope(Scheme::Chaikin, points, 2.2);
    const Point b = slope(Scheme::Chaikin, points, 7.9);
    return std::abs(a.dot(b)) / (a.norm() * b.norm());
  };
  Points points = before;
  for (int pass = 0; pass < 6; ++pass)
    points = moved(points, rows(OrthogonalTangents{first(points), second(points)}), Points::Zero(12, 2));
  CHECK(cosine(points) < 1e-9);
  Rows held = rows(TangentDirection{first(before), {}, Tangent::Whole});
  append(held, rows(OrthogonalTangents{first(before), second(before)}));
  CHECK(cosine(moved(before, held)) < 1e-9);
}

TEST_CASE("a corner keeps the directions of its tangents, or moves along unturned", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  const std::vector<double> turns = turning_angles(a);
  for (int s = 0; s < a.segment_count(); ++s) {
    if (std::abs(turns[static_cast<std::size_t>(s)]) < 0.2) continue;
    for (const Tangent kept : {Tangent::Direction, Tangent::Whole}) {
      const BezierContour after = moved(a, rows(a, CornerTangents{s, kept}));
      const Bezier before_corner = after.segment(a.previous(s));
      CHECK(sine_between(end_tangent(before_corner), end_tangent(a.segment(a.previous(s)))) < 1e-9);
      CHECK(sine_between(start_tangent(after.segment(s)), start_tangent(a.segment(s))) < 1e-9);
      CHECK((after.point(a.node(s)) - a.point(a.node(s))).norm() > 1.0);
      if (kept == Tangent::Whole)
        CHECK((derivative(after.segment(s), 0.0) - derivative(a.segment(s), 0.0)).norm() < 1e-9);
    }
  }
}

TEST_CASE("two arcs that meet in a corner have no jump there, by every open scheme", "[constraint]") {
  for (const Scheme scheme : {Scheme::EndpointQuadratic, Scheme::EndpointCubic}) {
    const Eigen::Index n = points_of_spans(scheme, 4);
    Points points = shapes::random_points(2 * n, 8);
    points.row(n) = points.row(n - 1);
    const Points first = points.topRows(n);
    const Points second = points.bottomRows(n);
    const Points after = moved(points, rows(Together{curve_at(scheme, first, 4.0),
                                                     shifted(curve_at(scheme, second, 0.0), static_cast<int>(n))}));
    CHECK((after.row(n) - after.row(n - 1)).norm() < 1e-9);
    CHECK((after.row(n) - points.row(n)).norm() > 1.0);
  }
  // A jump that there is stays, or is closed.
  const Points points = shapes::random_points(4, 9);
  const auto apart = [](const Points& any) -> Point { return row(any, 2) - row(any, 1); };
  const Together rule{point_of(points, 1), point_of(points, 2)};
  CHECK((apart(moved(points, rows(rule))) - apart(points)).norm() < 1e-9);
  CHECK(apart(moved(points, rows(Together{rule.first, rule.second, Offset::Closed}))).norm() < 1e-9);
}

TEST_CASE("a straight run stays straight, and keeps its slant when asked", "[constraint]") {
  // A slanted run over two nodes, with a straight cubic in it.
  const BezierContour contour(
      shapes::points_of({{0, 0}, {100, 50}, {140, 70}, {200, 100}, {300, 150}, {400, 200}, {400, 600}, {0, 600}}),
      {PointKind::Node, PointKind::Node, PointKind::Cubic, PointKind::Cubic, PointKind::Node, PointKind::Node,
       PointKind::Node, PointKind::Node});
  for (int s = 0; s < 3; ++s) CHECK(straight_run(contour, s).places.size() == 6);
  CHECK(straight_run(contour, 3).places.size() == 2);
  CHECK_THROWS_WITH(straight_run(shapes::circle(400), 2), "straight_run: segment 2 is not straight");
  StraightRun run = straight_run(contour, 1);
  const auto furthest = [](const BezierContour& any) {
    const Point chord = any.point(5) - any.point(0);
    double worst = 0.0;
    for (int p = 1; p < 5; ++p)
      worst = std::max(worst, std::abs(cross(chord, any.point(p) - any.point(0))) / chord.norm());
    return worst;
  };
  const BezierContour free = moved(contour, rows(run));
  CHECK(furthest(free) < 1e-9);
  CHECK(sine_between(free.point(5) - free.point(0), Point(2, 1)) > 1e-3);
  run.kept = Tangent::Direction;
  const BezierContour kept = moved(contour, rows(run));
  CHECK(furthest(kept) < 1e-9);
  CHECK(sine_between(kept.point(5) - kept.point(0), Point(2, 1)) < 1e-12);
  const Rows slant = rows(contour, SlantedLine{0});
  CHECK(slant.front().name == "line from point 0 keeps its direction of 26.5651 degrees");
  const BezierContour line = moved(contour, slant);
  CHECK(sine_between(line.point(1) - line.point(0), Point(2, 1)) < 1e-12);
  // By `outline_rows` every line keeps its slant.
  const BezierContour all = moved(contour, outline_rows(contour, OutlineRules{.slants = true}));
  for (int s = 0; s < all.segment_count(); ++s)
    CHECK(sine_between(end_tangent(all.segment(s)), end_tangent(contour.segment(s))) < 1e-9);
}

TEST_CASE("an extremum stays at its parameter, upright or leaning", "[constraint]") {
  for (const double angle : {0.0, 0.2, -0.1}) {
    for (const Scheme scheme : schemes) {
      const Points points = shapes::random_points(points_of_spans(scheme, 8), 10);
      for (const int axis : {0, 1}) {
        const Points after = moved(points, rows(Stationary{curve_at(scheme, points, 3.2, 1), axis, Frame{angle}}));
        const Point tangent = axis == 0 ? Point(std::tan(angle), 1.0) : Point(1.0, 0.0);
        CHECK(sine_between(slope(scheme, after, 3.2), tangent) < 1e-9);
      }
    }
  }
  const BezierContour circle = shapes::circle(400);
  const BezierContour after = moved(circle, rows(Stationary{curve_at(circle, 0, 1.0, 1), 1}));
  CHECK(std::abs(derivative(after.segment(0), 1.0).y()) < 1e-9);
}

TEST_CASE("with no italic angle the rows are those of upright letters, term for term", "[constraint]") {
  const auto same = [](const Rows& a, const Rows& b) {
    REQUIRE(a.size() == b.size());
    for (std::size_t r = 0; r < a.size(); ++r) {
      CHECK(a[r].name == b[r].name);
      REQUIRE(a[r].terms.size() == b[r].terms.size());
      for (std::size_t k = 0; k < a[r].terms.size(); ++k) {
        CHECK(a[r].terms[k].variable == b[r].terms[k].variable);
        CHECK(a[r].terms[k].coefficient == b[r].terms[k].coefficient);
      }
    }
  };
  const BezierContour contour = shapes::letter_a()[0];
  same(outline_rows(contour, OutlineRules{}), outline_rows(contour, OutlineRules{.frame = Frame{0.0}}));
  const BezierContour line = shapes::square(600);
  same(rows(line, AxisLine{1}), {{"line from point 1 stays vertical", {{2, 1.0}, {4, -1.0}}, 0.0}});
}

TEST_CASE("an italic angle turns what vertical and extremum mean", "[constraint]") {
  const double angle = 12.0 * std::numbers::pi / 180.0;
  const double lean = std::tan(angle);
  Affine shear;
  shear.linear << 1, lean, 0, 1;
  for (const bool is_rounded : {false, true}) {
    for (const BezierContour& upright : {shapes::arch(500), shapes::circle(400)}) {
      BezierContour italic = transform(upright, shear);
      if (is_rounded) italic = italic.with_points(italic.points().array().round());
      const OutlineRules rules{.frame = Frame{angle}};
      // As many rows as the upright letter has, and what holds for that holds sheared.
      CHECK(outline_rows(italic, rules).size() == outline_rows(upright, OutlineRules{}).size());
      const BezierContour after = moved(italic, outline_rows(italic, rules));
      const auto upright_x = [&](const BezierContour& any, int p) {
        return any.point(p).x() - lean * any.point(p).y();
      };
      const auto tied = [&](int p, int q) {
        CHECK(upright_x(after, p) - upright_x(after, q) ==
              Approx(upright_x(italic, p) - upright_x(italic, q)).margin(1e-9));
      };
      if (upright.degree(0) == 1) {
        tied(1, 2);  // the right side
        tied(0, static_cast<int>(upright.point_count()) - 1);
      } else {
        tied(0, 1);  // the right extremum with its handles
        tied(0, 11);
      }
    }
  }
  const BezierContour side = transform(shapes::square(600), shear);
  CHECK(rows(side, AxisLine{1, Frame{angle}})[0].name ==
        "line from point 1 stays vertical at the italic angle of 12 degrees");
  CHECK(rows(side, AxisLine{0, Frame{angle}})[0].name == "line from point 0 stays horizontal");
  CHECK(rows(side, AxisLine{1}).empty());
  CHECK_THROWS_WITH(rows(side, AxisLine{1, Frame{1.5}}),
                    "rows(AxisLine): italic angle 85.9437 degrees is not within 80");
}

TEST_CASE("a stem keeps its width where its edges face each other, and takes a given one", "[constraint]") {
  // The right stem of the a lies between the outer contour and the counter.
  const std::vector<BezierContour> a = shapes::letter_a();
  const int outer = 2;  // from (764, 705) down to (764, 70)
  REQUIRE(a[0].segment(outer).degree == 1);
  REQUIRE(a[0].segment(outer).start() == Point(764, 705));
  REQUIRE(a[1].point(a[1].node(a[1].segment_count() - 1)) == Point(598, 145));
  const int inner = a[1].segment_count() - 1;
  std::vector<Stem> stems = stems_between(a[0], outer, a[1], inner);
  REQUIRE(stems.size() == 2);
  const int n = static_cast<int>(a[0].point_count());
  Points points(n + a[1].point_count(), 2);
  points << a[0].points(), a[1].points();
  for (const std::optional<double>& width : {std::optional<double>(), std::optional<double>(190.0)}) {
    Rows all;
    for (Stem& stem : stems) {
      Stem both = stem;
      both.right = shifted(both.right, n);
      both.width = width;
      append(all, rows(both));
    }
    // The edges stay upright, as the outline's own rules ask.
    append(all, rows(a[0], AxisLine{outer}));
    const Points after = moved(points, all);
    const BezierContour outside = a[0].with_points(after.topRows(n));
    const BezierContour inside = a[1].with_points(after.bottomRows(a[1].point_count()));
    for (const double u : {0.0, 0.5, 1.0}) {
      CHECK(outside.segment(outer).start().x() - evaluate(inside.segment(inner), u).x() ==
            Approx(width.value_or(166.0)).margin(1e-9));
    }
    CHECK(all[0].name.str().ends_with(width ? " is 190 wide" : " stays 166 wide"));
  }
  CHECK_THROWS_AS(stems_between(a[0], outer, a[0], outer + 2), InvalidInput);
  CHECK_THROWS_AS(stems_between(letter_h(), 0, letter_h(), 4), InvalidInput);
}

TEST_CASE("the wall of a bowl keeps its thickness at every matching parameter", "[constraint]") {
  const BezierContour outside = shapes::circle(400);
  const BezierContour inside = reverse(shapes::circle(320));
  const int n = static_cast<int>(outside.point_count());
  Points points(2 * n, 2);
  points << outside.points(), inside.points();
  // Segment 0 of the outside, from right to top; that of the inside which runs from top to right.
  int facing = 0;
  while ((inside.segment(facing).end() - Point(320, 0)).norm() > 1e-9) ++facing;
  Rows all;
  const std::vector<Stem> stems = stems_between(outside, 0, inside, facing);
  CHECK(stems.size() == 4);
  for (Stem stem : stems) {
    stem.right = shifted(stem.right, n);
    append(all, rows(stem));
  }
  const Points after = moved(points, all);
  for (const Stem& stem : stems) {
    const auto at = [&](const WeightedSum& sum, int shift) {
      Point place = Point::Zero();
      for (const auto& [point, weight] : sum.terms) place += weight * row(after, point + shift);
      return place;
    };
    CHECK(std::abs((at(stem.left, 0) - at(stem.right, n)).dot(stem.across.normalized())) ==
          Approx(stem.across.norm()).margin(1e-9));
  }
}

TEST_CASE("two stems become equally wide, or keep the difference", "[constraint]") {
  const BezierContour h = letter_h();
  const std::vector<Stem> left = stems_between(h, 11, h, 1);
  const std::vector<Stem> right = stems_between(h, 3, h, 5);
  const auto width = [](const BezierContour& any, int a, int b) { return any.point(b).x() - any.point(a).x(); };
  for (const Offset offset : {Offset::Closed, Offset::Kept}) {
    Rows all = outline_rows(h, OutlineRules{});
    append(all, rows(EqualStems{left[0], right[0], offset}));
    const BezierContour after = moved(h, all);
    CHECK(width(after, 4, 5) - width(after, 0, 1) == Approx(offset == Offset::Closed ? 0.0 : 10.0).margin(1e-9));
    CHECK(width(after, 0, 1) != Approx(80.0));
  }
}

TEST_CASE("a symmetric contour stays symmetric, about a line or a point", "[constraint]") {
  const auto check = [](const BezierContour& contour, const Affine& map) {
    const auto pairs = symmetric_pairs(contour, map, 1e-6);
    REQUIRE_FALSE(pairs.empty());
    Rows all;
    for (const auto& [k, l] : pairs)
      append(all, rows(Symmetry{point_of(contour.points(), k), point_of(contour.points(), l), map, Offset::Closed}));
    const BezierContour after = moved(contour, all);
    for (const auto& [k, l] : pairs) CHECK((map(after.point(k)) - after.point(l)).norm() < 1e-9);
    CHECK((after.points() - contour.points()).norm() > 1.0);
    // Near symmetry can be made exact; here one point is a little off.
    Points off = contour.points();
    off(0, 0) += 0.4;
    const BezierContour uneven = contour.with_points(off);
    CHECK(symmetric_pairs(uneven, map, 0.1).empty());
    CHECK(symmetric_pairs(uneven, map, 1.0).size() == pairs.size());
  };
  check(shapes::arch(500), mirror_about(Point(250, 0), Point(0, 1)));
  check(shapes::circle(400), mirror_about(Point(0, 0), Point(1, 1)));
  check(shapes::circle(400), half_turn_about(Point(0, 0)));
  check(shapes::square(600), half_turn_about(Point(300, 300)));
  CHECK(symmetric_pairs(shapes::letter_a()[0], mirror_about(Point(400, 0), Point(0, 1)), 5.0).empty());
  CHECK(symmetric_pairs(shapes::arch(500), half_turn_about(Point(250, 300)), 5.0).empty());
}

TEST_CASE("a frozen stretch of parameter keeps the curve on it, and every point that shapes it", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  const FrozenStretch stretch = frozen_between(a, {20, 0.5}, {2, 0.25});
  const BezierContour after = moved(a, rows(stretch));
  for (int s = 0; s < a.segment_count(); ++s) {
    const bool is_within = s >= 20 || s <= 2;
    double furthest = 0.0;
    for (const double u : {0.2, 0.5, 0.8})
      furthest = std::max(furthest, (evaluate(after.segment(s), u) - evaluate(a.segment(s), u)).norm());
    CHECK((furthest == 0.0) == is_within);
  }
  CHECK(frozen_between(a, {3, 1.0}, {5, 0.0}).points == frozen_between(a, {4, 0.0}, {4, 1.0}).points);
  CHECK(static_cast<Eigen::Index>(frozen_between(a, {3, 0.5}, {3, 0.5}).points.size()) == a.point_count());
  for (const Scheme scheme : schemes) {
    const Points points = shapes::random_points(points_of_spans(scheme, 16), 11);
    const Points now = moved(points, rows(frozen_between(scheme, points.rows(), 3.2, 5.1)));
    CHECK(evaluate(scheme, now, 3.2) == evaluate(scheme, points, 3.2));
    CHECK(evaluate(scheme, now, 5.1) == evaluate(scheme, points, 5.1));
    CHECK(evaluate(scheme, now, 8.0) != evaluate(scheme, points, 8.0));
    // No more points than that takes: the pieces that begin in the stretch and degree more.
    const auto count = static_cast<int>(frozen_between(scheme, points.rows(), 3.2, 5.1).points.size());
    CHECK(count <= 3 + degree(scheme));
  }
  CHECK(frozen_between(Scheme::Chaikin, 16, 15.0, 17.2).points == std::vector<int>{0, 1, 2, 14, 15});
  CHECK(frozen_between(Scheme::Chaikin, 16, 0.0, 40.0).points.size() == 16);
}

TEST_CASE("a frozen box keeps the curve in it, and no segment that does not touch it", "[constraint]") {
  Box box;
  box.add(Point(560, -50));
  box.add(Point(900, 300));
  const BezierContour a = shapes::letter_a()[0];
  const BezierContour after = moved(a, rows(frozen_within(a, box)));
  const auto is_within = [&](const Point& p) {
    return (p.array() >= box.low.array()).all() && (p.array() <= box.high.array()).all();
  };
  int frozen = 0;
  for (int s = 0; s < a.segment_count(); ++s) {
    bool touches = false;
    for (double u = 0.0; u <= 1.0; u += 1.0 / 512) touches = touches || is_within(evaluate(a.segment(s), u));
    if (!touches) continue;
    ++frozen;
    CHECK(evaluate(after.segment(s), 0.37) == evaluate(a.segment(s), 0.37));
  }
  CHECK(frozen == equal_segments(after, a));
  for (const Scheme scheme : schemes) {
    const Points points = shapes::random_points(points_of_spans(scheme, 16), 12);
    const Points now = moved(points, rows(frozen_within(scheme, points, box)));
    int inside = 0;
    for (double t = 0.0; t < 16.0; t += 0.01) {
      if (!is_within(evaluate(scheme, points, t).transpose())) continue;
      ++inside;
      CHECK(evaluate(scheme, now, t) == evaluate(scheme, points, t));
    }
    CHECK(inside > 0);
    CHECK(now != points);
  }
  box.add(Point(5000, 5000));
  box.low = Point(4000, 4000);
  CHECK(frozen_within(a, box).points.empty());
}

TEST_CASE("a place stays at its zone or goes to one", "[constraint]") {
  const Points points = shapes::random_points(12, 13);
  const WeightedSum place = curve_at(Scheme::Orthogonal, points, 4.4);
  const auto height = [&](const Rows& rows) { return evaluate(Scheme::Orthogonal, moved(points, rows), 4.4)[1]; };
  CHECK(height(rows(AtHeight{place, {}})) == Approx(place.value.y()).margin(1e-9));
  CHECK(height(rows(AtHeight{place, 500.0})) == Approx(500.0).margin(1e-9));
}

TEST_CASE("the same rule twice is redundant, and a pin against a frozen stretch is named with it", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  const Points& points = a.points();
  const Affine mirror = mirror_about(Point(400, 0), Point(0, 1));
  const std::vector<Rows> every = {
      rows(Pinned{curve_at(a, 9, 0.4), Point(3, 4)}),
      rows(Together{point_of(points, 1), point_of(points, 8), Offset::Closed}),
      rows(TangentDirection{curve_at(a, 9, 0.4, 1), Point(1, 2)}),
      rows(Orthogonal{curve_at(a, 9, 0.4, 1), Point(1, 2)}),
      rows(OrthogonalTangents{curve_at(a, 9, 0.4, 1), curve_at(a, 2, 0.5, 1)}),
      rows(a, CornerTangents{5, Tangent::Whole}),
      rows(StraightRun{{point_of(points, 3), point_of(points, 9), point_of(points, 20)}, Tangent::Direction}),
      rows(Stationary{curve_at(a, 9, 0.4, 1), 0, Frame{0.2}}),
      rows(AtHeight{curve_at(a, 9, 0.4), 100.0}),
      rows(Stem{point_of(points, 3), point_of(points, 20), Point(1, 0), 200.0}),
      rows(Symmetry{point_of(points, 3), point_of(points, 20), mirror, Offset::Closed}),
      rows(frozen_between(a, {2, 0.0}, {4, 0.5})),
  };
  for (const Rows& once : every) {
    RowElimination elimination(static_cast<int>(2 * a.point_count()));
    elimination.add(once);
    const int before = elimination.redundant();
    elimination.add(once);
    CHECK(elimination.conflicts().empty());
    CHECK(elimination.redundant() == before + static_cast<int>(once.size()));
  }
  RowElimination elimination(static_cast<int>(2 * a.point_count()));
  elimination.add(rows(frozen_between(a, {2, 0.0}, {2, 1.0})));
  elimination.add(rows(Pinned{point_of(points, a.node(2)), Point(0, 12)}));
  REQUIRE(elimination.conflicts().size() == 1);
  CHECK(elimination.conflicts()[0].rules ==
        std::vector<std::string>{
            text("point ", a.node(2), " goes to y = 717"),
            text("point ", a.node(2), " is frozen with the stretch from 0 of segment 2 to 1 of segment 2")});
  CHECK(elimination.conflicts()[0].disagreement == Approx(12.0));
}

namespace {

// What the rules and the rows held make of a wish; rows that contradict the rules are left out.
auto solver(const Points& points, const Rows& rules, const Points& wish) {
  return [&points, &rules, wish](const Rows& held) -> Points {
    RowElimination elimination(static_cast<int>(2 * points.rows()));
    elimination.add(rules);
    elimination.add(held);
    return points + unflat(LeastChange(identity(points), elimination).solve(flat(wish)).displacement);
  };
}

// An ellipse of control points, counter-clockwise.
Points ring(int count) {
  Points points(count, 2);
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / count;
    points.row(k) << 500.0 * std::cos(angle), 350.0 * std::sin(angle);
  }
  return points;
}

ConvexStretch stretch_of(int first, int last, bool closed) {
  ConvexStretch stretch{{}, closed};
  for (int p = first; p <= last; ++p) stretch.points.push_back(p);
  return stretch;
}

}  // namespace

TEST_CASE("no inflection is added, whatever the wish", "[constraint]") {
  struct Case {
    Points points;
    ConvexStretch stretch;
    Rows rules;
  };
  std::vector<Case> cases;
  for (const BezierContour& contour : {shapes::letter_a()[0], shapes::circle(400)}) {
    const ConvexStretch whole = stretch_of(0, static_cast<int>(contour.point_count()) - 1, true);
    cases.push_back({contour.points(), whole, {}});
    cases.push_back({contour.points(), whole, outline_rows(contour, OutlineRules{})});
  }
  cases.push_back({ring(48), stretch_of(0, 47, true), {}});
  cases.push_back({ring(48), stretch_of(3, 12, false), rows(frozen_between(Scheme::Chaikin, 48, 20.0, 40.0))});
  int added = 0;
  for (const Case& now : cases) {
    for (unsigned seed = 0; seed < 30; ++seed) {
      const double size = seed % 3 == 0 ? 5.0 : seed % 3 == 1 ? 40.0 : 200.0;
      const Points wish = shapes::random_points(now.points.rows(), seed, size);
      const auto solve = solver(now.points, now.rules, wish);
      added += added_inflections(now.points, now.stretch, solve({})).empty() ? 0 : 1;
      const ConvexSolution solution = keep_convex(now.points, {now.stretch}, solve);
      CHECK(solution.left.empty());
      CHECK(added_inflections(now.points, now.stretch, solution.displaced).empty());
      CHECK(solution.solves <= (size < 100.0 ? 12 : 30));  // 200 is three times the length of the ring's legs
      // The rules hold all along.
      RowElimination rules(static_cast<int>(2 * now.points.rows()));
      rules.add(now.rules);
      CHECK(rules.residual(flat(solution.displaced - now.points)) < 1e-9);
    }
  }
  CHECK(added > 80);
}

TEST_CASE("a turn that is held keeps a part of itself, one that is kept its angle", "[constraint]") {
  const Points points = ring(12);
  const ConvexStretch stretch = stretch_of(0, 11, true);
  const auto turn = [](const Points& any, int k) {
    return cross(row(any, k) - row(any, k - 1), row(any, k + 1) - row(any, k));
  };
  Points now = moved(points, {}, 4);
  for (int pass = 0; pass < 30; ++pass) now = moved(points, held_turns(points, stretch, now, {4, 9}), 4);
  CHECK(turn(now, 4) == Approx(0.05 * turn(points, 4)).epsilon(1e-9));
  CHECK(turn(now, 9) == Approx(0.05 * turn(points, 9)).epsilon(1e-9));
  const Points kept = moved(points, kept_turns(points, stretch, {4}), 4);
  const Point in = row(kept, 4) - row(kept, 3);
  CHECK(turn(kept, 4) / in.squaredNorm() == Approx(turn(points, 4) / (row(points, 4) - row(points, 3)).squaredNorm()));
  CHECK(held_turns(points, stretch, points, {4})[0].name.str().starts_with("the turn at point 4 stays to the left: "));
}

TEST_CASE("a turn that other rules push over is reported, and inflections that were there may stay", "[constraint]") {
  const Points points = ring(12);
  const ConvexStretch stretch = stretch_of(0, 11, true);
  Rows rules = rows(FrozenStretch{"its neighbours", {2, 4}});
  append(rules, rows(Pinned{point_of(points, 3), Point(0, -200)}));
  const ConvexSolution solution = keep_convex(points, {stretch}, solver(points, rules, Points::Zero(12, 2)));
  CHECK(solution.left == std::vector<int>{3});
  // An S keeps its one inflection; a straight stretch may bend to either side, but not to both.
  const Points s = shapes::points_of({{0, 0}, {100, 0}, {200, 100}, {300, 100}});
  CHECK(added_inflections(s, stretch_of(0, 3, false), s).empty());
  const Points line = shapes::points_of({{0, 0}, {100, 0}, {200, 0}, {300, 0}});
  Points bent = line;
  bent.col(1) << 0, 10, 10, 0;
  CHECK(added_inflections(line, stretch_of(0, 3, false), bent).empty());
  bent.col(1) << 0, 10, -20, 0;
  CHECK(added_inflections(line, stretch_of(0, 3, false), bent) == std::vector<int>{1});
}

TEST_CASE("rows of a level hold for what its coefficients synthesise to, by every scheme", "[constraint]") {
  for (const Scheme scheme : schemes) {
    const Eigen::Index size = points_of_spans(scheme, 32);
    const Points points = shapes::random_points(size, 14);
    Rows fine = rows(Pinned{curve_at(scheme, points, 9.3), Point(5, -7)});
    append(fine, rows(TangentDirection{curve_at(scheme, points, 20.3, 1), {}}));
    append(fine, rows(AtHeight{curve_at(scheme, points, 28.0), {}}));
    append(fine, rows(Stem{curve_at(scheme, points, 3.0), curve_at(scheme, points, 14.0), Point(2, 1), {}}));
    for (int levels = 0; levels <= 3; ++levels) {
      for (const Details details : {Details::Moved, Details::Fixed}) {
        const Rows coarse = at_level(fine, scheme, size, levels, details);
        REQUIRE(coarse.size() == fine.size());
        MultiresCurve curve = decompose(scheme, Points::Zero(size, 2), levels);
        const Eigen::Index unknowns = details == Details::Moved ? size : curve.coarse.rows();
        const Points change = moved(Points::Zero(unknowns, 2), coarse);
        Eigen::Index begin = curve.coarse.rows();
        curve.coarse = change.topRows(begin);
        for (Coefficients& detail : curve.details) {
          if (details == Details::Fixed) break;
          detail = change.middleRows(begin, detail.rows());
          begin += detail.rows();
        }
        const Eigen::VectorXd displacement = flat(Points(reconstruct(curve)));
        for (const Row& rule : fine) {
          double sum = -rule.value;
          for (const auto& [variable, coefficient] : rule.terms) sum += coefficient * displacement[variable];
          CHECK(std::abs(sum) < 1e-12 * 60.0);
        }
      }
    }
  }
  // A row stays local: the place is on few coarse control points and few wavelets of every level.
  const Points points = shapes::random_points(1024, 15);
  const Rows pin = rows(Pinned{curve_at(Scheme::Chaikin, points, 300.2), Point(1, 0)});
  CHECK(at_level(pin, Scheme::Chaikin, 1024, 6)[0].terms.size() < 40);
}

TEST_CASE("rules that cannot be read are refused with their name and value", "[constraint]") {
  const BezierContour a = shapes::letter_a()[0];
  const Points& points = a.points();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(rows(a, FrozenPoint{99}), text("rows(FrozenPoint): point 99 of ", a.point_count()));
  CHECK_THROWS_WITH(rows(a, SmoothJoin{-1}), text("rows(SmoothJoin): segment -1 of ", a.segment_count()));
  CHECK_THROWS_WITH(rows(CornerPair{4, 4}), "rows(CornerPair): point 4 of 4");
  CHECK_THROWS_WITH(rows(a, Position{0, nan, Point(0, 0)}), "rows(Position): u = nan of segment 0");
  CHECK_THROWS_WITH(curve_at(a, 2, 1.5), "curve_at: u = 1.5 of segment 2");
  CHECK_THROWS_WITH(curve_at(a, 2, 0.5, 3), "curve_at: derivative 3 of 0, 1 or 2");
  CHECK_THROWS_WITH(rows(Pinned{point_of(points, 3), Point(nan, 0)}),
                    "rows(Pinned): the displacement of point 3 is (nan, 0)");
  CHECK_THROWS_WITH(rows(Orthogonal{curve_at(a, 2, 0.5, 1), Point(0, 0)}),
                    "rows(Orthogonal): the direction for tangent of the outline at 0.5 of segment 2 has no direction");
  CHECK_THROWS_WITH(rows(StraightRun{{point_of(points, 3)}, {}}), "rows(StraightRun): 1 places");
  CHECK_THROWS_WITH(rows(Stationary{curve_at(a, 2, 0.5, 1), 2}), "rows(Stationary): axis 2 of 0 or 1");
  CHECK_THROWS_WITH(frozen_between(Scheme::Chaikin, 16, 4.0, 4.0),
                    "frozen_between: the stretch from t = 4 to 4 is empty");
  CHECK_THROWS_WITH(frozen_between(Scheme::HeldCubic, 19, 4.0, 17.0),
                    "frozen_between: the stretch from t = 4 to 17 leaves the arc");
  CHECK_THROWS_AS(frozen_within(a, Box{}), InvalidInput);
  CHECK_THROWS_WITH(added_inflections(points, ConvexStretch{{0, 1}}, points),
                    "added_inflections: a stretch of 2 different points has no turn");
  CHECK_THROWS_AS(mirror_about(Point(0, 0), Point(0, 0)), InvalidInput);
  CHECK_THROWS_WITH(at_level({{"a row", {{64, 1.0}}, 0.0}}, Scheme::Chaikin, 32, 1),
                    "at_level: a row: variable 64 of 64");
  CHECK_THROWS_WITH(at_level({}, Scheme::Chaikin, 32, 9), "at_level: 9 levels below 32 control points");
}
