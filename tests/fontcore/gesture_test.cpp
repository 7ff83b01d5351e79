#include "fontcore/gesture.h"

#include <cmath>
#include <numbers>
#include <random>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;
using shapes::points_of;

namespace {

Run run_of(const std::vector<Point>& points) {
  Run run;
  for (std::size_t i = 0; i < points.size(); ++i) {
    run.push_back({static_cast<double>(i) / static_cast<double>(points.size()), points[i]});
  }
  return run;
}

Points points_of_run(const Run& run) {
  Points points(static_cast<Eigen::Index>(run.size()), 2);
  for (std::size_t i = 0; i < run.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = run[i].p;
  return points;
}

Run straight(double from, double to, int count) {
  std::vector<Point> points;
  for (int i = 0; i < count; ++i) points.emplace_back(from + (to - from) * i / (count - 1), 0.0);
  return run_of(points);
}

double distance_to(const Run& run, const Point& place) { return nearest(run, place).distance; }

void require_ascending(const Run& run) {
  for (std::size_t i = 0; i + 1 < run.size(); ++i) REQUIRE(run[i].t < run[i + 1].t);
}

const std::vector<TipShape> tips{Circle{40.0}, Ellipse{70.0, 30.0, 0.6}, Ellipse{20.0, 50.0, 0.0},
                                 ConvexPolygon{{{-30, -20}, {40, -25}, {50, 30}, {0, 45}}}};

Points arc_of(double radius, double from, double to, int count) {
  Points points(count, 2);
  for (int i = 0; i < count; ++i) {
    const double a = from + (to - from) * i / (count - 1);
    points.row(i) << radius * std::cos(a), radius * std::sin(a);
  }
  return points;
}

}  // namespace

TEST_CASE("the nearest point of a tip's boundary is on it and no boundary point is nearer", "[gesture]") {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> uniform(-60.0, 60.0);
  for (const TipShape& shape : tips) {
    const Tip tip(shape);
    for (int k = 0; k < 300; ++k) {
      const Point x(uniform(engine), uniform(engine));
      if (!tip.contains(x)) continue;
      const Point found = tip.nearest_boundary(x, Point::UnitX());
      CHECK_FALSE(tip.contains(found));
      CHECK(tip.contains(found * (1.0 - 1e-9)));
      // Along rays from the place, the boundary is where the tip ends: none of it is nearer.
      for (int i = 0; i < 720; ++i) {
        const Point ray(std::cos(i * std::numbers::pi / 360.0), std::sin(i * std::numbers::pi / 360.0));
        double inside = 0.0;
        double outside = 2.0 * tip.extent();
        for (int halving = 0; halving < 60; ++halving) {
          const double middle = 0.5 * (inside + outside);
          (tip.contains(middle * ray) ? inside : outside) = middle;
        }
        REQUIRE((outside * ray - x).norm() >= (found - x).norm() - 1e-9);
      }
    }
  }
}

TEST_CASE("a circle pushed into a straight line leaves an arc of its radius", "[gesture]") {
  const double r = 40.0;
  for (const double depth : {5.0, 20.0, 39.0}) {
    const Point end(3.0, depth - r);
    const ChangedRun pushed = push(straight(-500, 500, 7), Tip(Circle{r}), points_of({{3.0, -90.0}, end}));
    require_ascending(pushed.run);
    const double half_chord = std::sqrt(r * r - end.y() * end.y());
    int on_arc = 0;
    for (const Sample& sample : pushed.run) {
      if (sample.p.y() == 0.0) {
        CHECK(std::abs(sample.p.x() - 3.0) > half_chord - 1e-9);
      } else {
        CHECK((sample.p - end).norm() == Approx(r).epsilon(1e-11));
        ++on_arc;
      }
    }
    CHECK(on_arc > 2);
    // Edges of r / 4 fall short of the arc by no more than their height over it.
    CHECK(distance_to(pushed.run, end + Point(0.0, r)) < r * (1.0 - std::cos(0.125)));
  }
}

TEST_CASE("no sample is left inside a tip, however it moves", "[gesture]") {
  for (const TipShape& shape : tips) {
    const Tip tip(shape);
    std::mt19937 engine(11);
    std::uniform_real_distribution<double> uniform(-150.0, 150.0);
    Run run = straight(-600, 600, 40);
    Point place(0.0, -200.0);
    for (int step = 0; step < 40; ++step) {
      const Point next(uniform(engine), uniform(engine));
      const ChangedRun pushed = push(run, tip, points_of({place, next}));
      run = pushed.run;
      place = next;
      require_ascending(run);
      for (const Sample& sample : run) REQUIRE_FALSE(tip.contains(sample.p - place));
      // Sand is added and taken away: edges that were pushed keep their size.
      for (const auto& [first, last] : pushed.changed) {
        for (std::size_t i = first; i < last; ++i) {
          REQUIRE((run[i + 1].p - run[i].p).norm() <= std::max(0.25 * tip.radius() * (1 + 1e-12), 1200.0 / 39.0));
        }
      }
    }
    UNSCOPED_INFO(run.size());
    CHECK(run.size() < 4000);
  }
}

TEST_CASE("nothing changes farther from the path than the tip and one edge reach", "[gesture]") {
  for (const TipShape& shape : tips) {
    const Tip tip(shape);
    const Run before = straight(-600, 600, 300);
    const Point from(-30.0, -120.0);
    const Point to(60.0, 50.0);
    const ChangedRun pushed = push(before, tip, points_of({from, to}));
    REQUIRE(pushed.changed.size() == 1);
    const Run path{{0.0, from}, {1.0, to}};
    const double reach = tip.extent() + 0.25 * tip.radius();
    for (const Sample& sample : pushed.run) CHECK((sample.p.y() == 0.0 || distance_to(path, sample.p) < reach));
    for (const Sample& sample : before) {
      if (distance_to(path, sample.p) < reach) continue;
      INFO("sample at " << sample.t << " " << sample.p.transpose());
      CHECK(std::any_of(pushed.run.begin(), pushed.run.end(),
                        [&](const Sample& other) { return other.t == sample.t && other.p == sample.p; }));
    }
    for (std::size_t i = 0; i <= pushed.changed.front().first; ++i) {
      CHECK(pushed.run[i].t == before[i].t);
      CHECK(pushed.run[i].p == before[i].p);
    }
  }
}

TEST_CASE("a tip that moves fast does not jump across the curve", "[gesture]") {
  const Run before = straight(-500, 500, 60);
  for (const double speed : {10.0, 200.0, 400.0}) {
    Run run = before;
    Point place(0.0, -200.0);
    while (place.y() < 200.0) {
      const Point next = place + Point(0.0, std::min(speed, 200.0 - place.y()));
      run = push(run, Tip(Circle{30.0}), points_of({place, next})).run;
      place = next;
    }
    // The curve is ahead of the tip, as far as it went, and not behind it.
    CHECK(distance_to(run, place + Point(0.0, 30.0)) < 0.3);
    CHECK(crossed(run, points_of({place, Point(0.0, -200.0)})).empty());
    CHECK(crossed(run, points_of({place, Point(0.0, 500.0)})).size() == 1);
  }
}

TEST_CASE("held samples stay where a tip goes over them", "[gesture]") {
  const Run before = straight(-500, 500, 41);
  const std::vector<double> held{before[20].t};
  const ChangedRun pushed = push(before, Tip(Circle{50.0}), points_of({{0.0, -100.0}, {0.0, 40.0}}), held);
  bool is_there = false;
  for (const Sample& sample : pushed.run) is_there |= sample.t == held[0] && sample.p == before[20].p;
  CHECK(is_there);
  for (const Sample& sample : pushed.run) {
    if (sample.t != held[0]) CHECK_FALSE(Tip(Circle{50.0}).contains(sample.p - Point(0.0, 40.0)));
  }
}

TEST_CASE("a tip put down on the very line makes room for itself", "[gesture]") {
  const ChangedRun pushed = push(straight(-500, 500, 3), Tip(Circle{50.0}), points_of({{0, 0}}));
  for (const Sample& sample : pushed.run) CHECK_FALSE(Tip(Circle{50.0}).contains(sample.p));
  CHECK(distance_to(pushed.run, Point(0.0, 50.0)) < 0.5);
}

TEST_CASE("a run spread by arc length keeps its places and its held parameters", "[gesture]") {
  Run run = run_of({{0, 0}, {10, 0}, {30, 0}, {30, 60}, {0, 60}});
  const std::vector<double> held{run[2].t};
  const Run spread = respaced(run, held);
  require_ascending(spread);
  CHECK(spread[0].t == run[0].t);
  CHECK(spread[2].t == run[2].t);
  CHECK(spread[4].t == run[4].t);
  CHECK(spread[1].t == Approx(run[0].t + (run[2].t - run[0].t) / 3.0).epsilon(1e-2));
  for (std::size_t i = 0; i < run.size(); ++i) CHECK(spread[i].p == run[i].p);
}

TEST_CASE("a stroke's corners are found and round bends are none", "[gesture]") {
  std::vector<Point> zigzag;
  for (int i = 0; i <= 100; ++i)
    zigzag.emplace_back(3.0 * i, i <= 30 ? 2.0 * i : i <= 70 ? 120.0 - 2.0 * i : 2.0 * i - 160.0);
  const Stroke stroke = tidy(points_of(zigzag));
  CHECK(stroke.corners == std::vector<int>{30, 70});
  CHECK(tidy(arc_of(200.0, 0.0, 1.9 * std::numbers::pi, 200)).corners.empty());
}

TEST_CASE("trembling is taken off a stroke, its ends and corners stay", "[gesture]") {
  std::mt19937 engine(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<Point> drawn;
  for (int i = 0; i <= 400; ++i)
    drawn.emplace_back(2.0 * i + noise(engine), (i < 200 ? 1.5 * i : 600.0 - 1.5 * i) + noise(engine));
  const Stroke rough = tidy(points_of(drawn), {.corner_reach = 60.0});
  const Stroke stroke = tidy(points_of(drawn), {.noise = 60.0, .corner_reach = 60.0});
  REQUIRE(stroke.corners.size() == 1);
  CHECK(Point(stroke.points.row(stroke.corners[0])) == drawn[static_cast<std::size_t>(rough.corners[0])]);
  CHECK(Point(stroke.points.row(0)) == drawn.front());
  CHECK(Point(stroke.points.row(stroke.points.rows() - 1)) == drawn.back());
  double largest = 0.0;
  for (Eigen::Index i = 0; i < stroke.points.rows(); ++i) {
    const double x = stroke.points(i, 0);
    largest = std::max(largest, std::abs(stroke.points(i, 1) - (x < 400 ? 0.75 * x : 600.0 - 0.75 * x)));
  }
  CHECK(largest < 3.0);  // that of the ends, which stay
}

TEST_CASE("the average of a stroke drawn again and again is the stroke", "[gesture]") {
  const Stroke stroke = tidy(points_of({{0, 0}, {100, 20}, {180, 90}, {150, 300}, {400, 310}}), {.corner_reach = 60.0});
  const Stroke backwards{stroke.points.colwise().reverse(), [&] {
                           std::vector<int> corners;
                           for (auto k = stroke.corners.rbegin(); k != stroke.corners.rend(); ++k)
                             corners.push_back(4 - *k);
                           return corners;
                         }()};
  const Stroke mean = average({stroke, backwards, stroke});
  REQUIRE(mean.points.rows() == stroke.points.rows());
  CHECK(shapes::largest_distance(mean.points, stroke.points) < 1e-10);
  CHECK(mean.corners == stroke.corners);
}

TEST_CASE("the average of strokes about a line is nearer to it than they are", "[gesture]") {
  std::vector<Stroke> strokes;
  for (const double offset : {-6.0, 2.0, 4.0}) strokes.push_back(tidy(points_of({{0, offset}, {500, offset}})));
  const Stroke mean = average(strokes);
  for (Eigen::Index i = 0; i < mean.points.rows(); ++i) CHECK(std::abs(mean.points(i, 1)) < 1e-12);
}

TEST_CASE("bent ends meet their points with their tangents, and the middle stays", "[gesture]") {
  const Ray start{{310.0, 40.0}, Point(0.6, 0.8)};
  const Ray end{{-240.0, 180.0}, Point(-0.28, -0.96)};
  const auto bent_arc = [&](int count, double accuracy) {
    Run arc;
    const Points points = arc_of(300.0, 0.2, 2.4, count);
    for (int i = 0; i < count; ++i) arc.push_back({0.5 * i / count, points.row(i)});
    const Run bent = with_ends(arc, start, end, 120.0, accuracy);
    require_ascending(bent);
    CHECK(bent.front().p == start.point);
    CHECK(bent.back().p == end.point);
    CHECK(((bent[1].p - bent[0].p).normalized() - start.direction).norm() < 1e-9);
    CHECK(((bent.back().p - bent[bent.size() - 2].p).normalized() - end.direction).norm() < 1e-9);
    for (const Sample& sample : arc) {  // beyond the reach
      const double way = 300.0 * 2.2 * sample.t / 0.5;
      if (way < 130.0 || way > 2.2 * 300.0 - 130.0) continue;
      CHECK(std::any_of(bent.begin(), bent.end(), [&](const Sample& s) { return s.t == sample.t && s.p == sample.p; }));
    }
    double largest = 0.0;  // turn from edge to edge
    for (std::size_t i = 1; i + 1 < bent.size(); ++i) {
      const Point a = bent[i].p - bent[i - 1].p;
      const Point b = bent[i + 1].p - bent[i].p;
      largest = std::max(largest, std::abs(std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b))));
    }
    return largest;
  };
  // There is no corner: with ever finer samples every turn vanishes.
  const double coarse = bent_arc(80, 0.05);
  const double fine = bent_arc(8000, 0.000005);
  CHECK(fine < 0.05 * coarse);
}

TEST_CASE("smoothing a run takes its short features and keeps ends, straights and held samples", "[gesture]") {
  Run wavy;
  for (int i = 0; i <= 300; ++i) {
    const double x = 3.0 * i;
    wavy.push_back({0.2 + i / 600.0, {x, 200.0 * std::sin(x / 400.0) + 3.0 * std::sin(x / 4.0)}});
  }
  const std::vector<double> held{wavy[150].t};
  const Run smooth = smoothed(wavy, 120.0, held);
  require_ascending(smooth);
  CHECK(smooth.front().p == wavy.front().p);
  CHECK(smooth.back().p == wavy.back().p);
  CHECK(
      std::any_of(smooth.begin(), smooth.end(), [&](const Sample& s) { return s.t == held[0] && s.p == wavy[150].p; }));
  for (const Sample& sample : smooth) {
    const double x = sample.p.x();
    if (std::abs(x - 450.0) > 60.0 && x > 60.0 && x < 840.0) {
      CHECK(std::abs(sample.p.y() - 200.0 * std::sin(x / 400.0)) < 1.0);
    }
  }
  double before = 1e9;
  for (const double scale : {20.0, 60.0, 180.0}) {  // away from the ends bending falls as the scale grows
    const Run run = smoothed(wavy, scale);
    double bending = 0.0;
    for (std::size_t i = 1; i + 1 < run.size(); ++i) {
      if (std::abs(run[i].p.x() - 450.0) < 150.0)
        bending += (run[i - 1].p - 2.0 * run[i].p + run[i + 1].p).squaredNorm();
    }
    CHECK(bending < before);
    before = bending;
  }
  for (const Sample& sample : smoothed(straight(0, 100, 9), 50.0)) CHECK(std::abs(sample.p.y()) < 1e-12);
}

TEST_CASE("detail copied from one run and pasted on another is that of the first", "[gesture]") {
  Points rough(400, 2);
  Run plain;
  for (int i = 0; i < 400; ++i) {
    const double x = 2.5 * i;
    rough.row(i) << x, 6.0 * std::sin(x / 8.0);
    plain.push_back({i / 500.0, {x, 300.0 * std::sin(x / 700.0)}});
  }
  DetailLibrary library;
  library.scale = 120.0;
  library.samples.push_back(extract_detail(rough, false, library.scale, library.frame));
  const Run pasted = with_detail(plain, library);
  require_ascending(pasted);
  CHECK(pasted.front().p == plain.front().p);
  CHECK(pasted.back().p == plain.back().p);
  const auto roughness = [](const Run& run) {  // root mean square of the detail away from the ends
    const DetailSample sample = extract_detail(points_of_run(run), false, 120.0, DetailFrame::Tangent);
    const Eigen::Index n = sample.offsets.rows();
    const Points middle = sample.offsets.middleRows(n / 5, 3 * n / 5);
    return middle.norm() / std::sqrt(static_cast<double>(middle.rows()));
  };
  CHECK(roughness(pasted) == Approx(6.0 / std::numbers::sqrt2).epsilon(0.1));
  CHECK(roughness(plain) < 0.1);
  CHECK(roughness(with_detail(pasted, library, 0.0)) < 0.5);
}

TEST_CASE("a painted stretch is where a line lies within the radius", "[gesture]") {
  const Run line = straight(-500, 500, 11);
  const auto at = [&](double x) { return (x + 500.0) / 1000.0 * 10.0 / 11.0; };
  const auto one = painted(line, points_of({{20.0, 30.0}}), 50.0).intervals();
  REQUIRE(one.size() == 1);
  CHECK(one[0].from == Approx(at(-20.0)));
  CHECK(one[0].to == Approx(at(60.0)));
  const auto path =
      painted(line, points_of({{-200.0, 30.0}, {-100.0, 30.0}, {200.0, 300.0}, {200.0, -30.0}}), 50.0).intervals();
  REQUIRE(path.size() == 2);
  CHECK(path[0].from == Approx(at(-240.0)));
  CHECK(path[1].to == Approx(at(250.0)));
}

TEST_CASE("a lasso takes what lies inside it, a stroke what it goes across", "[gesture]") {
  const Run line = straight(-500, 500, 11);
  const auto at = [&](double x) { return (x + 500.0) / 1000.0 * 10.0 / 11.0; };
  const auto inside = inside_lasso(line, points_of({{-150, -40}, {60, -40}, {60, 40}, {-150, 40}})).intervals();
  REQUIRE(inside.size() == 1);
  CHECK(inside[0].from == Approx(at(-150.0)));
  CHECK(inside[0].to == Approx(at(60.0)));
  const std::vector<double> across = crossed(line, points_of({{-70, -50}, {-70, 50}, {330, -50}}));
  REQUIRE(across.size() == 2);
  CHECK(across[0] == Approx(at(-70.0)));
  CHECK(across[1] == Approx(at(130.0)));
  CHECK(nearest(line, {33.0, 12.0}).t == Approx(at(33.0)));
  CHECK(nearest(line, {33.0, 12.0}).distance == Approx(12.0));
}

TEST_CASE("tips and gestures that make no sense are refused", "[gesture]") {
  CHECK_THROWS_AS(Tip(Circle{0.0}), InvalidInput);
  CHECK_THROWS_AS(Tip(Ellipse{10.0, -1.0, 0.0}), InvalidInput);
  CHECK_THROWS_AS(Tip(ConvexPolygon{{{0, 0}, {1, 0}}}), InvalidInput);
  CHECK_THROWS_AS(Tip(ConvexPolygon{{{1, 1}, {2, 1}, {2, 2}}}), InvalidInput);              // does not hold its place
  CHECK_THROWS_AS(Tip(ConvexPolygon{{{-1, -1}, {-1, 1}, {1, 1}, {1, -1}}}), InvalidInput);  // clockwise
  CHECK_THROWS_AS(push(straight(0, 1, 2), Tip(Circle{1.0}), points_of({{0, NAN}})), InvalidInput);
  CHECK_THROWS_AS(push(straight(0, 1, 2), Tip(Circle{1e-6}), points_of({{0, 0}, {0, 9}})), WorkLimitExceeded);
  CHECK_THROWS_AS(tidy(points_of({{3, 4}, {3, 4}})), InvalidInput);
  CHECK_THROWS_AS(average({}), InvalidInput);
  CHECK_THROWS_AS(smoothed(straight(0, 1, 5), -1.0), InvalidInput);
}
