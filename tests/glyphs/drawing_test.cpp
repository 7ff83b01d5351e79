#include "glyphs/drawing.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace glyphs;
using fontcore::Point;
using fontcore::Points;

namespace {

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

std::string svg_of(const std::string& inside) {
  return "<?xml version=\"1.0\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9 9\">\n" + inside +
         "\n</svg>\n";
}

std::vector<Stroke> strokes_of(const std::string& inside, const DrawingOptions& options = {}) {
  return read_svg(bytes_of(svg_of(inside)), options);
}

Stroke path(const std::string& data, const DrawingOptions& options = {}) {
  const std::vector<Stroke> strokes = strokes_of("<path d=\"" + data + "\"/>", options);
  REQUIRE(strokes.size() == 1);
  return strokes[0];
}

bool same(const Stroke& a, const Stroke& b, double within = 1e-9) {
  return a.is_closed == b.is_closed && a.points.rows() == b.points.rows() &&
         shapes::largest_distance(a.points, b.points) <= within;
}

double area(const Stroke& stroke) {
  double twice = 0.0;
  for (Eigen::Index i = 0; i < stroke.points.rows(); ++i) {
    const Point a = stroke.points.row(i);
    const Point b = stroke.points.row((i + 1) % stroke.points.rows());
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

std::string refusal(const std::string& inside, const DrawingOptions& options = {}) {
  return message_of<RequestError>([&] { strokes_of(inside, options); });
}

}  // namespace

TEST_CASE("lines of a path come as they are, turned up and scaled", "[drawing]") {
  const Stroke stroke = path("M 1 2 L 5 2 L 5 7", {.scale = 10});
  CHECK_FALSE(stroke.is_closed);
  CHECK(stroke.points == shapes::points_of({{10, -20}, {50, -20}, {50, -70}}));
  CHECK(path("M0 0H4V4H0Z").points == shapes::points_of({{0, 0}, {4, 0}, {4, -4}, {0, -4}}));
  CHECK(path("M0 0H4V4H0Z").is_closed);
  CHECK(path("M0 0H4V4H0V0Z").points.rows() == 4);
}

TEST_CASE("a path says the same in absolute and relative commands, spaced and compact", "[drawing]") {
  const std::string absolute =
      "M 10 20 L 30 25 H 50 V 60 C 60 70 80 70 90 60 S 120 40 130 60 Q 140 80 150 60 T 170 60 A 20 10 30 0 1 200 70 Z";
  const std::string relative =
      "m 10 20 l 20 5 h 20 v 35 c 10 10 30 10 40 0 s 30 -20 40 0 q 10 20 20 0 t 20 0 a 20 10 30 0 1 30 10 z";
  const std::string compact = "m10,20l20+5h20v35c10 10,30,10,40 0s30-20 40 0q10 20 20 0t20 0a20 10 30 0130 10z";
  CHECK(same(path(absolute), path(relative)));
  CHECK(same(path(absolute), path(compact)));
  CHECK(same(path("M0 0L10 0L10 10L0 10"), path("M0 0 10 0 10 10 0 10")));
  CHECK(same(path("m1 1 10 0 0 10"), path("M1 1L11 1L11 11")));
  CHECK(same(path("M.5.5 1.5-.5.25e1-1E0"), path("M 0.5 0.5 L 1.5 -0.5 L 2.5 -1")));
  CHECK(path("M0 0h1 2 3").points == shapes::points_of({{0, 0}, {1, 0}, {3, 0}, {6, 0}}));
  CHECK(same(path("M0 0C1 1 2 1 3 0 4 -1 5 -1 6 0"), path("M0 0C1 1 2 1 3 0C4 -1 5 -1 6 0")));
}

TEST_CASE("a smooth command reflects the handle of its own kind only", "[drawing]") {
  CHECK(same(path("M0 0C0 9 9 9 9 0S18 -9 18 0"), path("M0 0C0 9 9 9 9 0C9 -9 18 -9 18 0")));
  CHECK(same(path("M0 0Q5 9 9 0T18 0T27 0"), path("M0 0Q5 9 9 0Q13 -9 18 0Q23 9 27 0")));
  CHECK(same(path("M0 0Q5 9 9 0S18 -9 18 0"), path("M0 0Q5 9 9 0C9 0 18 -9 18 0")));
  CHECK(same(path("M0 0C0 9 9 9 9 0T18 0"), path("M0 0C0 9 9 9 9 0L18 0"), 1e-9) == false);
  CHECK(path("M0 0C0 9 9 9 9 0T18 0").points.bottomRows(1) == shapes::points_of({{18, 0}}));
}

TEST_CASE("after the end of a subpath the next begins where it began", "[drawing]") {
  const std::vector<Stroke> strokes = strokes_of("<path d='M1 1h4v4zl-3 0m1 1v1'/>");
  REQUIRE(strokes.size() == 3);
  CHECK(strokes[0].is_closed);
  CHECK_FALSE(strokes[1].is_closed);
  CHECK(strokes[1].points == shapes::points_of({{1, -1}, {-2, -1}}));
  CHECK(strokes[2].points == shapes::points_of({{-1, -2}, {-1, -3}}));
}

TEST_CASE("arcs lie on their ellipse, on the side and the way that the flags say", "[drawing]") {
  for (const char* flags : {"0 0", "0 1", "1 0", "1 1"}) {
    const Stroke arc = path(std::string("M 30 0 A 30 30 0 ") + flags + " 0 30", {.step = 0.2});
    const bool is_large = flags[0] == '1';
    const bool is_sweep = flags[2] == '1';
    const Point centre = is_large != is_sweep ? Point(0, 0) : Point(30, -30);
    for (Eigen::Index i = 0; i < arc.points.rows(); ++i) {
      CHECK((arc.points.row(i).transpose() - centre).norm() == Approx(30).epsilon(1e-12));
    }
    double run = 0.0;
    for (Eigen::Index i = 1; i < arc.points.rows(); ++i) run += (arc.points.row(i) - arc.points.row(i - 1)).norm();
    CHECK(run == Approx((is_large ? 1.5 : 0.5) * std::numbers::pi * 30).epsilon(1e-4));
  }
  // Too small radii grow; a turned ellipse keeps its area.
  CHECK(area(path("M0 0A1 1 0 0 0 20 0A1 1 0 0 0 0 0Z", {.step = 0.1})) ==
        Approx(std::numbers::pi * 100).epsilon(1e-4));
  CHECK(area(path("M40 0A50 20 33 0 0 -40 0A50 20 33 0 0 40 0Z", {.step = 0.1})) > 0);
  CHECK(path("M0 0A0 5 0 0 0 9 0").points.rows() == 2);
}

TEST_CASE("no chord of a curve is longer than the step, and its points lie on it", "[drawing]") {
  for (const double step : {0.1, 0.5, 3.0}) {
    const Stroke stroke = path("M0 0C0 0 0 0 100 0C300 0 100 50 90 80Q0 200 -50 0A30 60 20 1 1 0 -30", {.step = step});
    for (Eigen::Index i = 1; i < stroke.points.rows(); ++i) {
      CHECK((stroke.points.row(i) - stroke.points.row(i - 1)).norm() <= step * (1 + 1e-9));
    }
  }
}

TEST_CASE("groups put their transforms in front", "[drawing]") {
  const Points expected = shapes::points_of({{12, -4}, {12, -8}});
  const auto first = [](const std::string& inside) { return strokes_of(inside).at(0).points; };
  const std::string line = "<line x1='1' y1='2' x2='3' y2='2'/>";
  CHECK(shapes::largest_distance(first("<g transform='translate(16,2) rotate(90) scale(2)'>" + line + "</g>"),
                                 expected) < 1e-12);
  CHECK(shapes::largest_distance(
            first("<g transform='translate(16,2)'><a transform='rotate(90)'><g transform='scale(2 2)'>" + line +
                  "</g></a></g>"),
            expected) < 1e-12);
  CHECK(shapes::largest_distance(first("<g transform='matrix(0 2 -2 0 16 2)'>" + line + "</g>"), expected) < 1e-12);
  CHECK(shapes::largest_distance(first("<g transform='rotate(180 2 2)'>" + line + "</g>"),
                                 shapes::points_of({{3, -2}, {1, -2}})) < 1e-12);
  CHECK(shapes::largest_distance(first("<g transform='skewX(45)'>" + line + "</g>"),
                                 shapes::points_of({{3, -2}, {5, -2}})) < 1e-12);
  CHECK(shapes::largest_distance(first("<g transform='skewY(45)'>" + line + "</g>"),
                                 shapes::points_of({{1, -3}, {3, -5}})) < 1e-12);
}

TEST_CASE("shapes are drawn as their own outlines", "[drawing]") {
  const DrawingOptions fine{.step = 0.05};
  const double pi = std::numbers::pi;
  CHECK(-area(strokes_of("<circle cx='5' cy='6' r='7'/>", fine).at(0)) == Approx(49 * pi).epsilon(1e-4));
  CHECK(-area(strokes_of("<ellipse rx='5' ry='3'/>", fine).at(0)) == Approx(15 * pi).epsilon(1e-4));
  CHECK(-area(strokes_of("<rect width='8' height='6'/>", fine).at(0)) == Approx(48));
  CHECK(-area(strokes_of("<rect width='8' height='6' rx='2'/>", fine).at(0)) ==
        Approx(48 - (4 - pi) * 4).epsilon(1e-4));
  CHECK(strokes_of("<polygon points='0,0 4,0 4,4'/>").at(0).is_closed);
  CHECK_FALSE(strokes_of("<polyline points='0 0-4 0-4-4'/>").at(0).is_closed);
  CHECK(strokes_of("<defs><path d='M0 0h9'/></defs><text>M0 0</text>").empty());
  CHECK(strokes_of("<path d='M3 3'/><path d=''/><path/>").empty());
}

TEST_CASE("an SVG at fault is refused with the line and the reason", "[drawing]") {
  CHECK(refusal("<g>\n<path d='M0 0 X 3'/></g>") == "line 4: <path>: path data has \"X\", which is no command");
  CHECK(refusal("<path d='L0 0'/>") == "line 3: <path>: path data does not begin with a move");
  CHECK(refusal("<path d='M0 0 L 3'/>") == "line 3: <path>: a number is missing at the end");
  CHECK(refusal("<path d='M0 0 L 3 nan'/>") == "line 3: <path>: \"nan\" is no number");
  CHECK(refusal("<path d='M0 0 L 3 +-3'/>") == "line 3: <path>: \"+-3\" is no number");
  CHECK(refusal("<path d='M0 0A1 1 0 2 0 3 3'/>") == "line 3: <path>: \"2 0 3 3\" is no flag of an arc");
  CHECK(refusal("<path d='M0 0z3 3'/>") == "line 3: <path>: path data has \"3 3\" where a command should be");
  CHECK(refusal("<path d='M0 0H2e6'/>") == "line 3: <path>: the point 2e+06 0 is beyond 1e+06");
  CHECK(refusal("<path d='M0 0H1e999'/>") == "line 3: <path>: \"1e999\" is no number");
  CHECK(refusal("<g transform='turn(3)'/>") == "line 3: <g>: transform \"turn\" is not known");
  CHECK(refusal("<g transform='scale(1 2 3)'/>") == "line 3: <g>: transform scale of 3 numbers");
  CHECK(refusal("<g transform='scale(1'/>") == "line 3: <g>: \"1\" lacks a )");
  CHECK(refusal("<circle r='3mm'/>") == "line 3: <circle>: r \"3mm\" is no number");
  CHECK(refusal("<use href='#a'/>").find("line 3: <use>: copies are not followed") == 0);
  CHECK(refusal("<path d='M0 0C9e5 0 0 9e5 9e5 9e5'/>", {.step = 1e-3}).find("more than 10000000 points") !=
        std::string::npos);
  CHECK_FALSE(refusal("<path d='M0 0H1'>").empty());
  CHECK_FALSE(refusal("", {.scale = 0}).empty());
  CHECK_FALSE(refusal("", {.step = -1}).empty());
  const auto whole = [](const std::string& text) {
    return message_of<RequestError>([&] { read_svg(bytes_of(text)); });
  };
  CHECK(whole("<glyph/>") == "is no SVG document");
  CHECK_FALSE(whole("<!DOCTYPE svg [<!ENTITY a \"b\">]><svg/>").empty());
  CHECK_FALSE(whole("<svg>&a;</svg>").empty());
}

TEST_CASE("a text of points holds strokes between empty lines", "[drawing]") {
  const std::vector<Stroke> strokes = read_polylines(
      bytes_of("# an edge\n1 2\n3,4\r\n5, 6 # its end\n\n0 0\n# within\n1 0\n1 1\n0 0\n\n\n7 7\n"), {.scale = 2});
  REQUIRE(strokes.size() == 2);
  CHECK(strokes[0].points == shapes::points_of({{2, 4}, {6, 8}, {10, 12}}));
  CHECK_FALSE(strokes[0].is_closed);
  CHECK(strokes[1].points == shapes::points_of({{0, 0}, {2, 0}, {2, 2}}));
  CHECK(strokes[1].is_closed);
  const auto refused = [](const std::string& text) {
    return message_of<RequestError>([&] { read_polylines(bytes_of(text)); });
  };
  CHECK(refused("1 2\n3") == "line 2: a number is missing at the end");
  CHECK(refused("1 2\n3 4 5") == "line 2: \"5\" follows a point");
  CHECK(refused("x y\n") == "line 1: \"x y\" is no number");
}

TEST_CASE("a drawing is known by its first character, and a fault is said with the file", "[drawing]") {
  const std::vector<Stroke> strokes = load_drawing(bundled_font("drawings/dry_brush.svg"), {.scale = 0.5});
  REQUIRE(strokes.size() == 1);
  CHECK_FALSE(strokes[0].is_closed);
  CHECK(strokes[0].points.rows() > 1000);
  CHECK(message_of<RequestError>([] { load_drawing("/nowhere.svg"); }).find("/nowhere.svg") == 0);
  const std::string readme = bundled_font("README.md");
  CHECK(message_of<RequestError>([&] { load_drawing(readme); }).find(readme + ": ") == 0);
}
