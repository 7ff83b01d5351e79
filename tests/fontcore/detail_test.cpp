#include "fontcore/detail.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "fontcore/character.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;
using Eigen::Index;

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

/// A closed run of detail, away from the ink: sine waves of wavelengths between two, all as strong.
DetailLibrary noise(double length, double shortest, double longest, double amplitude, unsigned seed, double scale) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, two_pi);
  const auto n = static_cast<Index>(std::ceil(length / shortest * 12.0));
  Points offsets = Points::Zero(n, 2);
  int waves = 0;
  for (int k = static_cast<int>(std::ceil(length / longest)); k <= length / shortest; ++k, ++waves) {
    const double start = phase(random);
    for (Index i = 0; i < n; ++i) {
      offsets(i, 1) += std::sin(two_pi * k * static_cast<double>(i) / static_cast<double>(n) + start);
    }
  }
  offsets *= amplitude * std::sqrt(2.0 / waves);
  DetailLibrary library{.name = "noise", .scale = scale};
  library.samples.push_back({.length = length, .is_closed = true, .offsets = offsets});
  return library;
}
DetailLibrary wave(double wavelength, double amplitude, double scale) {
  Points offsets = Points::Zero(32, 2);
  for (Index i = 0; i < 32; ++i) offsets(i, 1) = amplitude * std::sin(two_pi * static_cast<double>(i) / 32.0);
  DetailLibrary library{.name = "wave", .scale = scale};
  library.samples.push_back({.length = wavelength, .is_closed = true, .offsets = offsets});
  return library;
}

double rms(const Points& d) { return std::sqrt(d.squaredNorm() / static_cast<double>(d.rows())); }

BezierContour letter(std::size_t contour) {
  return transform(shapes::letter_a()[contour], {Eigen::Matrix2d::Identity() * (1000.0 / 2048.0), Point(0, 0)});
}

std::vector<BezierContour> outlines() {
  return {shapes::circle(240), shapes::square(700), shapes::arch(500), letter(0), letter(1)};
}

double distance(const BezierContour& a, const BezierContour& b) { return farthest(a, b, 0.004).distance; }

}  // namespace

TEST_CASE("the base of base plus detail is the base", "[detail]") {
  const OutlineArcs outline(shapes::circle(240));
  const Points points = points_along(outline, 0, 1200);
  const DetailBase base(points, true, 120.0);
  CHECK(base.length() == Approx(two_pi * 240).epsilon(1e-3));
  CHECK(base.spans() == 25);
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 4.0);
  Points d(points.rows(), 2);
  for (Index i = 0; i < d.rows(); ++i) d.row(i) << normal(random), normal(random);
  for (const bool fades : {false, true}) {
    Eigen::VectorXd mask = Eigen::VectorXd::Ones(d.rows());
    for (Index i = 0; i < 300 && fades; ++i)
      mask[i] = i < 200 ? 0.0 : 0.5 - 0.5 * std::cos(std::numbers::pi * (static_cast<double>(i) - 200) / 100);
    const Points part = base.detail_part(d, mask);
    CHECK(base.base_move(part) < 1e-9);
    CHECK(rms(part) > 0.8 * rms(d) * (fades ? 0.7 : 1.0));
    if (fades) CHECK(part.topRows(200).isZero(0.0));
    CHECK((base.detail_part(part, Eigen::VectorXd::Ones(d.rows())) - part).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("detail laid on an outline is extracted again", "[detail]") {
  const OutlineArcs outline(shapes::circle(240));
  const double length = outline.length();
  const DetailLibrary library = noise(length, 12.0, 48.0, 3.0, 5, 120.0);
  const Character textured = apply_detail(outline, library, {.seed = 9});
  const auto back = extract_detail(arcs_at_scale(textured.contour, 120.0), 120.0, DetailFrame::Tangent, InkSide::Left);
  REQUIRE(back.size() == 1);
  // Wherever it was laid, some turn of the run brings it onto what is found, within three hundredths.
  const DetailSample& sample = library.samples[0];
  const Index n = back[0].offsets.rows();
  double best = 1e9;
  for (Index turn = 0; turn < sample.offsets.rows(); ++turn) {
    double off = 0.0;
    for (Index i = 0; i < n; ++i) {
      const double x = static_cast<double>(i) / static_cast<double>(n) * static_cast<double>(sample.offsets.rows());
      const auto at = static_cast<Index>(x);
      const double u = x - static_cast<double>(at);
      const Index size = sample.offsets.rows();
      const double value =
          (1 - u) * sample.offsets((at + turn) % size, 1) + u * sample.offsets((at + turn + 1) % size, 1);
      off += std::pow(back[0].offsets(i, 1) - value, 2);
    }
    best = std::min(best, std::sqrt(off / static_cast<double>(n)));
  }
  CHECK(best < 0.03 * 3.0);
}

TEST_CASE("detail runs with the ink on its left, whichever way a contour does", "[detail]") {
  const BezierContour outline = apply_detail(OutlineArcs(letter(0)), noise(3000, 15, 50, 4, 2, 120)).contour;
  const auto one = extract_detail(arcs_at_scale(outline, 120), 120, DetailFrame::Tangent, InkSide::Right);
  const auto other = extract_detail(arcs_at_scale(reverse(outline), 120), 120, DetailFrame::Tangent, InkSide::Left);
  REQUIRE(one.size() == other.size());
  double most = 0.0;
  for (const DetailSample& a : one) {
    double nearest = 1e9;
    for (const DetailSample& b : other) {
      if (b.offsets.rows() == a.offsets.rows())
        nearest = std::min(nearest, (a.offsets - b.offsets).cwiseAbs().maxCoeff());
    }
    most = std::max(most, nearest);
  }
  CHECK(most < 1e-3);
}

TEST_CASE("an outline gets its own detail back as it was", "[character]") {
  for (const double rough : {0.0, 3.0}) {
    for (BezierContour contour : outlines()) {
      const InkSide ink = signed_area(contour) > 0 ? InkSide::Left : InkSide::Right;
      if (rough > 0.0)
        contour = apply_detail(OutlineArcs(contour), noise(3000, 15, 50, rough, 2, 120), {.ink = ink}).contour;
      const OutlineArcs outline = arcs_at_scale(contour, 120.0);
      for (const DetailFrame frame : {DetailFrame::Fixed, DetailFrame::Tangent, DetailFrame::ScaledTangent}) {
        DetailLibrary library{.name = "own", .scale = 120.0, .frame = frame};
        library.samples = extract_detail(outline, 120.0, frame, ink, "a/0");
        if (library.samples.empty()) continue;
        const CharacterOptions options{.ink = ink, .place = "a/0", .area = signed_area(contour)};
        const Character same = apply_detail(outline, library, options);
        CHECK(distance(same.contour, contour) < 0.05);
      }
    }
  }
}

TEST_CASE("character moves no base, no corner and no area", "[character]") {
  double base_move = 0.0;
  double blind = 0.0;
  for (const BezierContour& contour : outlines()) {
    const OutlineArcs outline(contour);
    const InkSide ink = signed_area(contour) > 0 ? InkSide::Left : InkSide::Right;
    for (unsigned seed = 1; seed < 6; ++seed) {
      for (const double amplitude : {1.0, 4.0}) {
        const DetailLibrary library = noise(4000, 15, 50, amplitude, seed, 120);
        const Character textured =
            apply_detail(outline, library, {.seed = seed, .ink = ink, .area = signed_area(contour)});
        CHECK(textured.area_failed.empty());
        CHECK(signed_area(textured.contour) == Approx(signed_area(contour)).epsilon(1e-11));
        base_move = std::max(base_move, textured.base_move);
        CHECK(textured.arcs > 0);
        CHECK(textured.largest > amplitude);
        // Corners keep their place and their tangents.
        for (int s = 0; s < contour.segment_count(); ++s) {
          if (!outline.is_corner(s)) continue;
          int found = -1;
          for (int r = 0; r < textured.contour.segment_count(); ++r) {
            if (textured.contour.point(textured.contour.node(r)) == contour.point(contour.node(s))) found = r;
          }
          REQUIRE(found >= 0);
          CHECK((start_tangent(textured.contour.segment(found)) - start_tangent(contour.segment(s))).norm() < 1e-2);
        }
        // Looked at anew, the base is where it was.
        const OutlineArcs anew = arcs_at_scale(textured.contour, 120);
        if (anew.arcs().size() != outline.arcs().size()) continue;
        for (std::size_t k = 0; k < outline.arcs().size(); ++k) {
          if (outline.arcs()[k].length < 120.0) continue;
          const bool is_closed = !outline.has_corner();
          const DetailBase before(points_along(outline, static_cast<int>(k), 1500), is_closed, 120.0);
          const DetailBase after(points_along(anew, static_cast<int>(k), 1500), is_closed, 120.0);
          blind = std::max(blind, two_sided_distance(before.points(), after.points()));
        }
      }
    }
  }
  INFO(blind);
  CHECK(base_move < 1e-6);
  CHECK(blind < 1.5);
}

TEST_CASE("a gain of 0 takes detail away, and adds none", "[character]") {
  const BezierContour plain = shapes::circle(240);
  const DetailLibrary library = noise(2000, 15, 50, 3, 7, 120);
  const BezierContour rough = apply_detail(OutlineArcs(plain), library, {.area = signed_area(plain)}).contour;
  const OutlineArcs outline = arcs_at_scale(rough, 120);
  const Character smooth = apply_detail(outline, library, {.gain = 0.0, .area = signed_area(rough)});
  CHECK(distance(rough, plain) > 5.0);
  CHECK(distance(smooth.contour, plain) < 0.5);
  CHECK(signed_area(smooth.contour) == Approx(signed_area(plain)).epsilon(1e-11));
  const Character same = apply_detail(outline, library, {.gain = 0.0, .adds = true});
  CHECK(same.contour == rough);
  CHECK(same.arcs == 0);
}

TEST_CASE("what is held stays bit for bit", "[character]") {
  const BezierContour contour = shapes::arch(700);
  const OutlineArcs outline(contour);
  const DetailLibrary library = noise(4000, 15, 50, 4, 1, 120);
  const auto has = [](const BezierContour& in, const Bezier& segment) {
    for (int s = 0; s < in.segment_count(); ++s) {
      if (in.segment(s).degree == segment.degree && in.segment(s).p == segment.p) return true;
    }
    return false;
  };
  const Character spared = apply_detail(outline, library, {.spares_lines = true, .area = signed_area(contour)});
  for (int s = 0; s < contour.segment_count(); ++s) {
    if (contour.degree(s) == 1) CHECK(has(spared.contour, contour.segment(s)));
  }
  CHECK(spared.arcs == 1);
  const int held = contour.node(1);
  const Character one = apply_detail(outline, library, {.held = {held, contour.point_of(1, 1)}});
  CHECK(has(one.contour, contour.segment(1)));
  CHECK(!has(one.contour, contour.segment(0)));
  CHECK(one.base_move < 1e-6);
}

TEST_CASE("texture has one size on all contours", "[character]") {
  for (const double wavelength : {30.0, 37.0}) {
    const DetailLibrary library = wave(wavelength, 2.0, 120.0);
    for (const double length : {200.0, 260.0, 500.0, 1300.0, 5000.0}) {
      const double radius = length / two_pi;
      const BezierContour contour = shapes::circle(radius);
      const OutlineArcs outline = arcs_at_scale(contour, library.scale);
      const Character textured = apply_detail(outline, library, {.seed = 4});
      REQUIRE(textured.arcs == 1);
      // From every second passage through the middle to the next, where no seam is.
      const Points polyline = to_polyline(textured.contour, 0.5);
      std::vector<double> passages;
      for (Index i = 0; i + 1 < polyline.rows(); ++i) {
        const double step = (polyline.row(i + 1) - polyline.row(i)).norm();
        const double here = polyline.row(i).norm() - radius;
        const double next = polyline.row(i + 1).norm() - radius;
        const double angle = std::atan2(polyline(i, 1), polyline(i, 0));
        if (here < 0.0 && next >= 0.0) passages.push_back(radius * angle + step * here / (here - next));
      }
      std::vector<double> lengths;
      for (std::size_t i = 0; i + 1 < passages.size(); ++i) {
        lengths.push_back(std::remainder(passages[i + 1] - passages[i], length));
      }
      REQUIRE(lengths.size() >= 3);
      std::ranges::nth_element(lengths, lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2));
      CHECK(lengths[lengths.size() / 2] == Approx(wavelength).epsilon(0.05));
    }
  }
}

TEST_CASE("a seed decides where detail falls, and always the same way", "[character]") {
  const OutlineArcs outline(shapes::circle(240));
  const DetailLibrary library = noise(6000, 15, 50, 3, 7, 120);
  const auto with = [&](std::uint64_t seed) { return apply_detail(outline, library, {.seed = seed}).contour; };
  CHECK(with(1) == with(1));
  CHECK(!(with(1) == with(2)));
}

TEST_CASE("detail grows with the em", "[character]") {
  const BezierContour small = letter(1);
  const BezierContour large = transform(small, {2.0 * Eigen::Matrix2d::Identity(), Point(0, 0)});
  const DetailLibrary library = noise(4000, 15, 50, 3, 7, 120);
  const BezierContour one = apply_detail(OutlineArcs(small), library, {.seed = 3}).contour;
  const BezierContour two = apply_detail(OutlineArcs(large), library, {.seed = 3, .unit = 2.0}).contour;
  REQUIRE(has_same_structure(one, two));
  CHECK((2.0 * one.points() - two.points()).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("libraries and numbers that cannot be are refused", "[detail][character]") {
  const OutlineArcs outline(shapes::circle(240));
  CHECK_THROWS_AS(apply_detail(outline, DetailLibrary{.scale = 100}), InvalidInput);
  CHECK_THROWS_AS(extract_detail(outline, 0.0, DetailFrame::Tangent, InkSide::Left), InvalidInput);
  CHECK_THROWS_AS(apply_detail(outline, wave(30, 2, 0.0)), InvalidInput);
  CHECK_THROWS_AS(extract_detail(Points::Zero(1, 2), false, 100, DetailFrame::Fixed), InvalidInput);
}
