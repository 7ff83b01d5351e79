#pragma once

// Private to `learn_weight` and `apply_weight`: the law by which strokes and counters grow, and what of a shape it asks
// for. Lengths are in thousandths of the em.

#include <cmath>
#include <numbers>
#include <vector>

#include "fontcore/stroke.h"
#include "fontcore/weight.h"

namespace fontcore::weight {

using Contours = std::vector<BezierContour>;
using Letters = WeightModel::Letters;
using Stroke = WeightModel::Stroke;

constexpr double curve_step = 11.0;  // of the edges that a shape is cut into
constexpr double line_step = 22.0;
constexpr double usual_stem = 100.0;  // of a shape without upright strokes
constexpr double near_zone = 7.0;     // a height so near a zone is in it
constexpr double crowding = 0.15;     // bars lose this share of their growth as the room beside them goes to 0

inline double squared(double x) { return x * x; }
inline double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

struct Weighed {
  double value = 0.0;
  double weight = 0.0;
};
/// The value below which a share of the weight lies, between the middles of the entries. There is one at least.
double quantile(std::vector<Weighed> list, double share);
inline double median(const std::vector<Weighed>& list) { return quantile(list, 0.5); }

/// What the growth of a stroke depends on.
struct StrokePlace {
  double thickness = 0.0;
  double direction = 0.0;  ///< radians
  int letters = 0;         ///< LetterClass
  bool is_round = false;
};

/// How contrasted a class is: 0 if its strokes are about as thick as each other, 1 if there are thin and thick ones.
double share_of_contrast(const Letters& letters);
/// Where a stroke stands between the thin strokes of its class (0) and the thick ones (1): straight ones are the one or
/// the other, round ones go over.
double thickness_share(const Letters& letters, const StrokePlace& place);
/// The growth of a stroke by the strokes of its class alone.
double law(const Letters& letters, const StrokePlace& place);
/// The growth of a counter by its width alone.
double counter_law(const Letters& letters, double width);

struct Growth {
  double value = 0.0;
  double deviation = 0.0;
};
/// The laws with what the control letters say beyond them. Counters by how many of their sides are round.
Growth growth_at(const WeightModel& model, const StrokePlace& place);
double counter_growth_at(const WeightModel& model, int letters_index, double width, int round_sides);

/// By how much a height moves: as its zone does, between zones in proportion, beyond them as the last.
double shift_of(const std::vector<WeightModel::Zone>& zones, double height);

StrokePlace place_of(const StrokeEdge& edge, int letters);
/// An edge with a stroke behind it.
bool is_stroke(const StrokeEdge& edge);
/// How far an edge is part of a stroke about as thick as a stem.
double stem_like(const StrokeEdge& edge, double stem);
bool is_serif(const StrokeEdge& edge, double stem);
/// Room above or below the bar that an edge belongs to, on its tighter side.
double room_beside(const StrokeEdges& shape, const StrokeEdge& edge);
/// The share of its growth that a bar keeps between others.
double crowded(const StrokeEdges& shape, const StrokeEdge& edge, double room);
double box_width(const StrokeEdges& shape);

Contours in_thousandths(const Contours& contours, double units_per_em);

}  // namespace fontcore::weight
