#pragma once

// Private to `fit_compact`: a stretch with what is asked of it, and the search for the fewest curves that stand for it.

#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "fontcore/compact.h"
#include "fontcore/compact_chain.h"
#include "fontcore/contour.h"

namespace fontcore::compact {

constexpr double degrees = std::numbers::pi / 180.0;
constexpr double never = std::numeric_limits<double>::infinity();
constexpr double polyline_sagitta = 0.006;     // share of the tolerance
constexpr double smooth_turn = 1.5 * degrees;  // what joins that go on smoothly may turn on whole numbers

inline std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// Unit tangent at any place of a curve, where its derivative vanishes too.
Point tangent_at(const Bezier& b, double u);

/// Length and absolute turn of a curve, estimated over eight chords.
struct Extent {
  double length = 0.0;
  double turn = 0.0;
};
Extent extent_of(const Bezier& b);

/// Adds a curve as a polyline within a distance of it, `fewest` pieces or more, without its end.
void add_polyline(const Bezier& b, double sagitta, int fewest, std::vector<Point>& to);

struct Settings {
  CompactOptions options;
  Point fraction = Point::Zero();  ///< whole numbers differ by it from the coordinates here
  long most_work = 0;
};

/// The nearest point of whole numbers, if coordinates are to be whole; of two as near, the one nearer to the first
/// node.
Point whole(const Settings& settings, const Point& p);
/// Of the points of whole numbers around another the one nearest to a polyline.
Point whole_near(const Settings& settings, const Point& place, const std::vector<Point>& line);

/// What is asked of a stretch beside its curve.
struct Task {
  Stretch stretch;
  Join start;
  Join end;
  struct Must {
    int sample;
    Join join;
  };
  std::vector<Must> musts;      ///< joins there have to be, in order
  std::vector<int> candidates;  ///< samples that may be joins, its ends among them
  bool rotates = false;         ///< closed, and any candidate may be the first join
  bool is_long = false;         ///< too long for a search of the whole: window by window
  int most_pieces = 0;
  std::optional<Point> first;  ///< where the contour's first node was, if it is within
};

struct Result {
  std::vector<Bezier> pieces;
  int first = -1;  ///< the piece that begins with the contour's first node, if one does
  double start_turn = 0.0;
  double end_turn = 0.0;
};

/// The fewest curves found that may be written for a stretch; none where none were, or `most_work` was met. What was
/// done is added to `work`.
std::optional<Result> search(const Task& task, const Settings& settings, long& work);

}  // namespace fontcore::compact
