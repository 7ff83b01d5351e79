// Whether `find_crossings` and CGAL's exact arrangement of Bezier curves say the same, on glyphs as they are drawn and
// on the same glyphs with every point displaced at random.
//
//     crossing_arrangement [GLYPHS [SEED [FONT ...]]]        200 glyphs of two bundled fonts, if nothing else is said
//
// In an arrangement of contours that meet nowhere every vertex has degree 2. Exit status 1 if a clear verdict is wrong:
// no finding where the arrangement has another vertex, or a crossing where it has none and rational arithmetic does not
// prove it either: the arrangement misses some crossings beside a joint. Slow, and the arrangement is GPL: this program
// is built only if asked for, and is linked into nothing.

#include <CGAL/Arr_Bezier_curve_traits_2.h>
#include <CGAL/Arrangement_2.h>
#include <CGAL/CORE_algebraic_number_traits.h>
#include <CGAL/Cartesian.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <numeric>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "glyphs/font_file.h"

namespace {

using namespace fontcore;

using Numbers = CGAL::CORE_algebraic_number_traits;
using RationalKernel = CGAL::Cartesian<Numbers::Rational>;
using AlgebraicKernel = CGAL::Cartesian<Numbers::Algebraic>;
using Traits = CGAL::Arr_Bezier_curve_traits_2<RationalKernel, AlgebraicKernel, Numbers>;
using Arrangement = CGAL::Arrangement_2<Traits>;

constexpr int usual_glyphs = 200;
constexpr unsigned usual_seed = 20261122;
constexpr int most_segments = 150;             // of a glyph: the arrangement of more takes minutes
constexpr double largest_displacement = 0.01;  // in each coordinate, of the glyph's size

struct Sample {
  std::string name;
  std::vector<BezierContour> contours;
};

/// Drawn from all fonts alike.
std::vector<Sample> samples(const std::vector<std::string>& fonts, int count, std::mt19937& random) {
  std::vector<Sample> samples;
  for (std::size_t f = 0; f < fonts.size(); ++f) {
    const glyphs::Font font = glyphs::load_font(fonts[f]);
    std::vector<int> order(font.glyphs.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    const auto wanted = static_cast<std::size_t>(count) * (f + 1) / fonts.size();
    for (const int glyph : order) {
      if (samples.size() >= wanted) break;
      std::vector<BezierContour> contours;
      try {
        contours = glyphs::compose(font, glyph);
      } catch (const Error&) {
        continue;  // a glyph in trouble has no outline
      }
      int segments = 0;
      for (const BezierContour& contour : contours) segments += contour.segment_count();
      if (segments == 0 || segments > most_segments) continue;
      samples.push_back({font.path + ": " + font.glyphs[static_cast<std::size_t>(glyph)].name, std::move(contours)});
    }
  }
  return samples;
}

/// Every point moved at random, to whole numbers; implied nodes stay between their handles.
std::vector<BezierContour> displaced(const std::vector<BezierContour>& contours, std::mt19937& random) {
  const Box box = control_box(contours);
  const auto bound = static_cast<int>(std::ceil(largest_displacement * (box.high - box.low).maxCoeff()));
  const auto step = [&] { return static_cast<int>(random() % static_cast<unsigned>(2 * bound + 1)) - bound; };
  std::vector<BezierContour> moved;
  for (const BezierContour& contour : contours) {
    Points points = contour.points().array().round();
    const Eigen::Index n = points.rows();
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index axis = 0; axis < 2; ++axis) points(i, axis) += step();
    for (Eigen::Index i = 0; i < n; ++i) {
      if (contour.kind(static_cast<int>(i)) != PointKind::ImpliedNode) continue;
      points.row(i) = 0.5 * (points.row((i + n - 1) % n) + points.row((i + 1) % n));
    }
    moved.push_back(contour.with_points(points));
  }
  return moved;
}

/// Where curves meet, other than that one goes on where one other ends.
int meeting_vertices(const std::vector<Bezier>& beziers) {
  std::vector<Traits::Curve_2> curves;
  for (const Bezier& bezier : beziers) {
    std::vector<RationalKernel::Point_2> points;
    for (std::size_t k = 0; k <= static_cast<std::size_t>(bezier.degree); ++k)
      points.emplace_back(Numbers::Rational(bezier.p[k].x()), Numbers::Rational(bezier.p[k].y()));
    curves.emplace_back(points.begin(), points.end());
  }
  Arrangement arrangement;
  CGAL::insert(arrangement, curves.begin(), curves.end());
  return static_cast<int>(std::count_if(arrangement.vertices_begin(), arrangement.vertices_end(),
                                        [](const Arrangement::Vertex& vertex) { return vertex.degree() > 2; }));
}

/// What the arrangement says of a glyph: whether anything meets, and in how many places if it took all curves at once.
struct Answer {
  bool meets = false;
  std::optional<int> places;
};

/// Nothing if the arrangement breaks on it. It breaks on some curves together that it takes two by two.
std::optional<Answer> arrange(const std::vector<BezierContour>& contours) {
  std::vector<Bezier> beziers;
  for (std::size_t c = 0; c < contours.size(); ++c) {
    for (int s = 0; s < contours[c].segment_count(); ++s) {
      if (is_degenerate(contours[c].segment(s))) continue;
      // Of a loop in one curve the arrangement knows nothing. Halves of such coordinates are exact.
      std::vector<Bezier> parts{contours[c].segment(s)};
      for (int depth = 0; depth < 3 && parts[0].degree == 3; ++depth) {
        std::vector<Bezier> halves;
        for (const Bezier& part : parts)
          for (const Bezier& half : split(part, 0.5)) halves.push_back(half);
        parts = std::move(halves);
      }
      beziers.insert(beziers.end(), parts.begin(), parts.end());
    }
  }
  try {
    const int places = meeting_vertices(beziers);
    return Answer{places > 0, places};
  } catch (const std::exception&) {
  }
  try {
    for (std::size_t i = 0; i < beziers.size(); ++i) {
      for (std::size_t j = i + 1; j < beziers.size(); ++j) {
        const auto box = [](const Bezier& bezier) {
          Box box;
          for (std::size_t k = 0; k <= static_cast<std::size_t>(bezier.degree); ++k) box.add(bezier.p[k]);
          return box;
        };
        const Box a = box(beziers[i]);
        const Box b = box(beziers[j]);
        if ((a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any()) continue;
        if (meeting_vertices({beziers[i], beziers[j]}) > 0) return Answer{true, std::nullopt};
      }
    }
  } catch (const std::exception&) {
    return std::nullopt;
  }
  return Answer{};
}

using Rational = Numbers::Rational;
using RationalPoint = std::array<Rational, 2>;

/// The control points of a part of a segment, exactly: blossoms of its ends.
std::vector<RationalPoint> part(const Bezier& bezier, const Rational& from, const Rational& to) {
  const auto degree = static_cast<std::size_t>(bezier.degree);
  std::vector<RationalPoint> points;
  for (std::size_t k = 0; k <= degree; ++k) {
    std::vector<RationalPoint> q;
    for (std::size_t i = 0; i <= degree; ++i) q.push_back({Rational(bezier.p[i].x()), Rational(bezier.p[i].y())});
    for (std::size_t level = 0; level < degree; ++level) {
      const Rational& u = level < degree - k ? from : to;
      for (std::size_t i = 0; i + level < degree; ++i)
        for (std::size_t axis = 0; axis < 2; ++axis) q[i][axis] += u * (q[i + 1][axis] - q[i][axis]);
    }
    points.push_back(q[0]);
  }
  return points;
}

/// True if the ends of `b` lie on opposite sides of the strip along the chord of `a` that holds all of `a`.
bool spans(const std::vector<RationalPoint>& b, const std::vector<RationalPoint>& a) {
  const auto turn = [&](const RationalPoint& x) {
    return Rational((a.back()[0] - a[0][0]) * (x[1] - a[0][1]) - (a.back()[1] - a[0][1]) * (x[0] - a[0][0]));
  };
  Rational low = 0;
  Rational high = 0;
  for (const RationalPoint& x : a) {
    low = std::min(low, turn(x));
    high = std::max(high, turn(x));
  }
  return (turn(b[0]) > high && turn(b.back()) < low) || (turn(b[0]) < low && turn(b.back()) > high);
}

/// True if exact numbers alone say that two segments go through each other within 1e-5 of the parameters given.
bool is_proved(const std::vector<BezierContour>& contours, const Crossing& crossing) {
  const auto around = [&](const Place& place) {
    const Rational reach = Rational(1) / Rational(100000);
    const Rational u(place.u);
    return part(contours[static_cast<std::size_t>(place.contour)].segment(place.segment), u - reach, u + reach);
  };
  if (std::min(crossing.a.u, crossing.b.u) < 1e-5 || std::max(crossing.a.u, crossing.b.u) > 1.0 - 1e-5) return false;
  const auto a = around(crossing.a);
  const auto b = around(crossing.b);
  return spans(a, b) && spans(b, a);
}

struct Tally {
  int glyphs = 0;
  int clear = 0;
  int crossing = 0;
  int touching = 0;        // contacts or overlaps, without a crossing
  int touching_apart = 0;  // of these, those that the arrangement finds apart
  int broken = 0;          // glyphs that the arrangement does not take
  int counted = 0;         // glyphs with crossings alone, taken at once
  int counted_otherwise = 0;
  int missed = 0;  // glyphs whose crossings the arrangement misses, though rational arithmetic proves one
  int wrong = 0;
};

void compare(const std::string& name, const std::vector<BezierContour>& contours, Tally& tally) {
  ++tally.glyphs;
  const std::vector<Crossing> found = find_crossings(contours);
  const auto crossings = static_cast<std::size_t>(
      std::count_if(found.begin(), found.end(), [](const Crossing& one) { return one.meeting == Meeting::Crossing; }));
  ++(found.empty() ? tally.clear : crossings > 0 ? tally.crossing : tally.touching);
  const std::optional<Answer> answer = arrange(contours);
  if (!answer) {
    ++tally.broken;
    return;
  }
  if (crossings > 0 && !answer->meets && std::any_of(found.begin(), found.end(), [&](const Crossing& one) {
        return one.meeting == Meeting::Crossing && is_proved(contours, one);
      })) {
    ++tally.missed;
    return;
  }
  if (found.empty() ? answer->meets : crossings > 0 && !answer->meets) {
    ++tally.wrong;
    std::cerr << name << ": WRONG: " << found.size() << " findings, " << crossings << " of them crossings\n";
  }
  if (!found.empty() && crossings == 0 && !answer->meets) ++tally.touching_apart;
  if (crossings > 0 && crossings == found.size() && answer->places) {
    ++tally.counted;
    if (static_cast<int>(crossings) == *answer->places) return;
    ++tally.counted_otherwise;
    std::cerr << name << ": " << crossings << " crossings, " << *answer->places << " vertices\n";
  }
}

void print(const char* title, const Tally& tally) {
  std::cout << title << ": " << tally.glyphs << " glyphs: " << tally.clear << " clear, " << tally.crossing
            << " crossing, " << tally.touching << " touching (" << tally.touching_apart
            << " of them apart); clear verdicts wrong: " << tally.wrong
            << "; not taken by the arrangement: " << tally.broken << ", proved but missed by it: " << tally.missed
            << "; crossings counted in " << tally.counted << " glyphs, otherwise in " << tally.counted_otherwise
            << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : usual_glyphs;
  std::mt19937 random(argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : usual_seed);
  std::vector<std::string> fonts(argv + std::min(argc, 3), argv + argc);
  if (fonts.empty())
    for (const char* name : {"liberation-serif/LiberationSerif-Regular.ttf", "cabin/Cabin-Regular.otf"})
      fonts.push_back(std::string(GLYPHWAVE_SOURCE_DIR "/fonts/") + name);
  CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
  CGAL::set_error_handler([](const char*, const char*, const char*, int, const char*) {});
  Tally as_drawn;
  Tally moved;
  for (const Sample& sample : samples(fonts, count, random)) {
    compare(sample.name, sample.contours, as_drawn);
    compare(sample.name + ", displaced", displaced(sample.contours, random), moved);
  }
  print("as drawn", as_drawn);
  print("displaced", moved);
  return as_drawn.wrong + moved.wrong > 0 ? 1 : 0;
}
