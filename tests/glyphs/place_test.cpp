#include "fontcore/place.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "glyphs/detail_library.h"
#include "glyphs/error.h"
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

TEST_CASE("an edit comes back from its file, and a bad file is refused by its key", "[place]") {
  const Font font = load_font(bundled_font("liberation-serif/LiberationSerif-Regular.ttf"));
  Font edited = font;
  const int n = font.character_map.at(U'n');
  BezierContour& contour = edited.glyphs[static_cast<std::size_t>(n)].contours[0];
  for (int i = 0; i < static_cast<int>(contour.point_count()); ++i) {
    if (contour.point(i).x() == 993) contour.set_point(i, contour.point(i) + Point(24, -3));
  }
  ExtractOptions options;
  options.stretch = {Point(879, 300), Point(713, 300)};
  const PlacedDetail edit = learn_edit(font, edited, n, options);
  const std::string file = edit_json(edit, "foot");
  const PlacedDetail read = parse_edit(file, "foot.json");
  CHECK(edit_json(read, "foot") == file);
  CHECK((read.path - edit.path).cwiseAbs().maxCoeff() < 1e-6);
  CHECK((read.displacement - edit.displacement).cwiseAbs().maxCoeff() < 1e-6);
  CHECK(read.corners.size() == edit.corners.size());
  // The same from a font of another em.
  Font twice = edited;
  twice.units_per_em *= 2;
  for (BezierContour& one : twice.glyphs[static_cast<std::size_t>(n)].contours) {
    one = transform(one, {2.0 * Eigen::Matrix2d::Identity(), Point::Zero()});
  }
  CHECK((learn_edit(font, twice, n, options).displacement - edit.displacement).cwiseAbs().maxCoeff() < 1e-9);

  const auto refused = [&](const std::string& what, const std::string& by) {
    std::string other = file;
    other.replace(other.find(what), what.size(), by);
    return message_of<RequestError>([&] { parse_edit(other, "foot.json"); });
  };
  CHECK(refused("\"kind\": \"edit\"", "\"kind\": \"detail\"").find("foot.json: kind") == 0);
  CHECK(refused("\"version\": 1", "\"version\": 2").find("foot.json: version") == 0);
  CHECK(refused("\"along\": [0,", "\"along\": [1,").find("foot.json: along[0]") == 0);
  CHECK(refused("\"path\": [[", "\"path\": [[\"a\",").find("foot.json: path[0]") == 0);
  CHECK(refused("\"corners\": [[", "\"corners\": [[-5,").find("foot.json: corners") == 0);
  CHECK(refused("\"name\"", "\"nam\"").find("nam") != std::string::npos);
}
