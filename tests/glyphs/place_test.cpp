#include "fontcore/place.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace fontcore;
using namespace glyphs;

namespace {

std::vector<BezierContour> letter(const Font& font, char c) {
  return compose(font, font.character_map.at(static_cast<char32_t>(c)));
}

OutlineArcs::Location at(const BezierContour& contour, const Point& place) {
  const NearestPoint nearest = nearest_point(contour, place);
  return {nearest.segment, nearest.u};
}

std::vector<OutlineArcs> arcs_of(const std::vector<BezierContour>& contours) {
  return {contours.begin(), contours.end()};
}

/// How many places every letter from a to z has, those that have any.
std::map<char, int> counts(const Font& font, const PlacedDetail& detail, const PlaceOptions& options) {
  std::map<char, int> found;
  for (char c = 'a'; c <= 'z'; ++c) {
    const auto places = find_places(arcs_of(letter(font, c)), detail, options);
    if (!places.empty()) found[c] = static_cast<int>(places.size());
  }
  return found;
}

}  // namespace

TEST_CASE("the foot of an n is found at the feet of a serif face, and at nothing else", "[place]") {
  const Font font = load_font(bundled_font("liberation-serif/LiberationSerif-Regular.ttf"));
  const double em = font.units_per_em;
  const BezierContour plain = letter(font, 'n')[0];
  BezierContour edited = plain;
  const auto move = [&](const Point& from, const Point& by) {
    for (int i = 0; i < static_cast<int>(plain.point_count()); ++i) {
      if (plain.point(i) == from) edited.set_point(i, from + by);
    }
  };
  // The right foot: longer to the right, and higher where it leaves the stem.
  move({993, 45}, {24, 0});
  move({993, 0}, {24, 0});
  move({879, 70}, {0, 20});
  const OutlineArcs outline(plain);
  const PlacedDetail detail =
      learn_place(outline, OutlineArcs(edited), at(plain, {879, 300}), at(plain, {713, 300}), em, InkSide::Right);
  CHECK(detail.faded == 0.0);

  const auto options = [&](double tolerance) {
    return PlaceOptions{.tolerance = tolerance, .units_per_em = em, .ink = InkSide::Right};
  };
  CHECK(counts(font, detail, options(4)) == std::map<char, int>{{'h', 2}, {'n', 2}, {'q', 1}});
  // The serifs of i, l, p and r are longer by up to 23/1000 em on one side; f's slope otherwise too.
  CHECK(counts(font, detail, options(25)) ==
        std::map<char, int>{{'h', 2}, {'i', 1}, {'k', 1}, {'l', 1}, {'m', 3}, {'n', 2}, {'p', 1}, {'q', 1}, {'r', 1}});

  // Where it was learnt it comes out as it was made; n's left foot is its mirror image, and both change alike.
  const auto places = find_places({outline}, detail, options(4));
  REQUIRE(places.size() == 2);
  CHECK_FALSE(places[0].is_mirrored);
  CHECK(places[1].is_mirrored);
  const auto node = [&](const BezierContour& contour, const Point& was) {
    for (int i = 0; i < static_cast<int>(plain.point_count()); ++i) {
      if (plain.point(i) == was) return contour.point(i);
    }
    return Point(Point::Constant(NAN));
  };
  const BezierContour one = add_at_places(outline, detail, {places[0]}, options(4)).contour;
  CHECK((one.points() - edited.points()).rowwise().norm().maxCoeff() < 0.1e-3 * em);
  const BezierContour both = add_at_places(outline, detail, places, options(4)).contour;
  const std::vector<std::pair<Point, Point>> alike{
      {{993, 45}, {47, 45}}, {{993, 0}, {47, 0}}, {{879, 70}, {160, 70}}, {{588, 0}, {453, 0}}, {{588, 45}, {453, 45}}};
  for (const auto& [right, left] : alike) {
    const Point moved_right = node(both, right) - right;
    const Point moved_left = node(both, left) - left;
    CHECK((moved_left - Point(-moved_right.x(), moved_right.y())).norm() < 0.5e-3 * em);
  }
}

TEST_CASE("so is a foot without corners", "[place]") {
  const Font font = load_font(bundled_font("eb-garamond/EBGaramond12-Regular.otf"));
  const double em = font.units_per_em;
  const BezierContour plain = letter(font, 'n')[0];
  BezierContour edited = plain;
  for (int i = 0; i < static_cast<int>(plain.point_count()); ++i) {
    const Point p = plain.point(i);
    if (p.y() < 20 && p.x() > 440) edited.set_point(i, p + Point(15, -4));
  }
  const OutlineArcs outline(plain);
  const PlacedDetail detail =
      learn_place(outline, OutlineArcs(edited), at(plain, {369, 160}), at(plain, {439, 160}), em, InkSide::Left);
  CHECK(detail.corners.empty());
  CHECK(counts(font, detail, {.tolerance = 16, .units_per_em = em}) ==
        std::map<char, int>{
            {'f', 1}, {'h', 2}, {'i', 1}, {'k', 1}, {'l', 1}, {'m', 3}, {'n', 2}, {'p', 1}, {'q', 1}, {'r', 1}});
}
