#include "fontcore/weight_law.h"

#include <algorithm>

namespace fontcore::weight {

namespace {

constexpr double thinnest = 5.0;   // of a stroke, for logarithms
constexpr double no_stroke = 1e4;  // thickness where nothing is met
// Powers of thickness by which strokes of one contrast grow where nothing says more: the thin parts of round ones are
// joins, which hardly do.
constexpr double power_straight = 1.0;
constexpr double power_round = 2.5;
constexpr double diagonal = 1.0;        // powers of the cosine of the direction by which thick strokes of a contrasted
constexpr double diagonal_round = 0.5;  // face grow less than stems: growth is alike along the line, not across

double contrast(const Letters& letters) { return 1.0 - letters.level.thickness / letters.upright.thickness; }

// Where x lies among rising nodes, clamped: the node before it and the share of the way to the next.
template <std::size_t n>
std::pair<std::size_t, double> place_among(const std::array<double, n>& nodes, double x) {
  std::size_t i = 0;
  while (i + 2 < n && x >= nodes[i + 1]) ++i;
  return {i, std::clamp((x - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0)};
}

}  // namespace

double quantile(std::vector<Weighed> list, double share) {
  std::ranges::stable_sort(list, {}, &Weighed::value);
  double total = 0.0;
  for (const Weighed& entry : list) total += entry.weight;
  const double wanted = share * total;
  double sum = 0.0;
  double previous_at = 0.0;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const double at = sum + 0.5 * list[i].weight;
    if (at >= wanted) {
      if (i == 0) return list[0].value;
      const double t = (wanted - previous_at) / std::max(at - previous_at, 1e-12);
      return list[i - 1].value + t * (list[i].value - list[i - 1].value);
    }
    previous_at = at;
    sum += list[i].weight;
  }
  return list.back().value;
}

double share_of_contrast(const Letters& letters) { return std::clamp((contrast(letters) - 0.25) / 0.15, 0.0, 1.0); }

double thickness_share(const Letters& letters, const StrokePlace& place) {
  const double z =
      (place.thickness - letters.level.thickness) / std::max(letters.upright.thickness - letters.level.thickness, 5.0);
  const double v = std::clamp((z - 0.25) / 0.5, 0.0, 1.0);
  return place.is_round ? std::clamp(z, -0.2, 1.1) : v * v * (3.0 - 2.0 * v) + std::clamp(z - 1.0, 0.0, 0.1);
}

double law(const Letters& letters, const StrokePlace& place) {
  const Stroke& up = letters.upright;
  const Stroke& bar = letters.level;
  const double T = place.thickness;
  const double c2 = squared(std::cos(place.direction));
  // Strokes about as thick as each other: a power, its exponent from stems and bars as far as they differ.
  const double u = std::log(std::max(up.thickness, 2.0) / std::max(bar.thickness, 2.0));
  const double steps = std::log(std::max(up.growth, 2.0) / std::max(bar.growth, 2.0));
  const double usual_power = place.is_round ? power_round : power_straight;
  const double g = std::clamp((steps * u + 0.1 * usual_power) / (u * u + 0.1), 0.5, 4.0);
  const double usual = up.thickness * c2 + bar.thickness * (1.0 - c2);
  const double growth = up.growth * c2 + bar.growth * (1.0 - c2);
  const double relative = T / usual;
  const double even = std::min(growth * (relative < 1.0 ? std::pow(std::max(relative, 0.15), g)
                                                        : std::pow(std::min(relative, 4.0), std::min(g, 1.0))),
                               std::max(1.1 * std::max(up.growth, bar.growth), growth));
  // Thin and thick ones.
  const double thick = thickness_share(letters, place);
  const double across = std::pow(std::sqrt(c2), place.is_round ? diagonal_round : diagonal);
  const double contrasted = bar.growth + (up.growth * across - bar.growth) * thick;
  const double share = share_of_contrast(letters);
  return even * (1.0 - share) + contrasted * share;
}

double counter_law(const Letters& letters, double width) {
  return std::max(letters.counter_growth + letters.counter_slope * (width - letters.counter), -0.8 * width);
}

Growth growth_at(const WeightModel& model, const StrokePlace& place) {
  const Letters& letters = model.letters[static_cast<std::size_t>(place.letters)];
  const auto [i, a] = place_among(WeightModel::directions, place.direction * 180.0 / std::numbers::pi);
  // Between thicknesses on a logarithmic scale.
  std::array<double, WeightModel::thicknesses.size()> nodes;
  for (std::size_t k = 0; k < nodes.size(); ++k) nodes[k] = std::log(WeightModel::thicknesses[k]);
  const auto [j, b] = place_among(nodes, std::log(place.thickness / letters.upright.thickness));
  const auto read = [&, i = i, a = a, j = j, b = b](const WeightModel::Table& table) {
    const auto& t = table[place.is_round ? 1 : 0];
    return (1.0 - a) * ((1.0 - b) * t[i][j] + b * t[i][j + 1]) + a * ((1.0 - b) * t[i + 1][j] + b * t[i + 1][j + 1]);
  };
  return {law(letters, place) + read(letters.correction), read(letters.deviation)};
}

double counter_growth_at(const WeightModel& model, int letters_index, double width, int round_sides) {
  const Letters& letters = model.letters[static_cast<std::size_t>(letters_index)];
  std::array<double, WeightModel::widths.size()> nodes;
  for (std::size_t k = 0; k < nodes.size(); ++k) nodes[k] = std::log(WeightModel::widths[k]);
  const auto [j, b] = place_among(nodes, std::log(std::max(width, 10.0)));
  const auto& t = letters.counter_correction[static_cast<std::size_t>(round_sides)];
  return counter_law(letters, width) + (1.0 - b) * t[j] + b * t[j + 1];
}

double shift_of(const std::vector<WeightModel::Zone>& zones, double y) {
  if (zones.empty()) return 0.0;
  const WeightModel::Zone& nearest =
      *std::ranges::min_element(zones, {}, [&](const WeightModel::Zone& z) { return std::abs(z.height - y); });
  if (std::abs(nearest.height - y) < near_zone || y <= zones.front().height || y >= zones.back().height) {
    return nearest.shift;
  }
  std::size_t i = 0;
  while (zones[i + 1].height < y) ++i;
  const double t = (y - zones[i].height) / (zones[i + 1].height - zones[i].height);
  return (1.0 - t) * zones[i].shift + t * zones[i + 1].shift;
}

StrokePlace place_of(const StrokeEdge& edge, int letters) {
  return {std::max(edge.ink.exists() ? edge.thickness() : no_stroke, thinnest), edge.direction, letters, !edge.is_line};
}

double stem_like(const StrokeEdge& edge, double stem) {
  const double facing = std::clamp((edge.facing - 0.5) / 0.3, 0.03, 1.0);
  if (!edge.ink.exists() || edge.facing <= 0.5) return 0.03 * facing;
  return facing / (1.0 + std::pow(edge.thickness() / (1.5 * stem), 8));
}

bool is_serif(const StrokeEdge& edge, double stem) {
  return std::abs(edge.normal.y()) > 0.7 && edge.ink.exists() && edge.thickness() < 0.62 * stem && edge.facing > 0.7 &&
         edge.run < 1.4 * stem;
}

double room_beside(const StrokeEdges& shape, const StrokeEdge& edge) {
  double room = edge.gap_y.distance;
  if (edge.ink.exists()) room = std::min(room, shape[edge.ink.edge].gap_y.distance);
  return room;
}

double crowded(const StrokeEdges& shape, const StrokeEdge& edge, double room) {
  if (room <= 0.0) return 1.0;
  const double tight = std::clamp(1.0 - room_beside(shape, edge) / room, 0.0, 0.8);
  return 1.0 - crowding * tight * squared(std::sin(edge.direction));
}

Contours in_thousandths(const Contours& contours, double units_per_em) {
  Affine map;
  map.linear *= 1000.0 / units_per_em;
  Contours result;
  for (const BezierContour& contour : contours) result.push_back(transform(contour, map));
  return result;
}

bool is_stroke(const StrokeEdge& edge) { return edge.ink.exists() && edge.facing > 0.75; }

double box_width(const StrokeEdges& shape) { return shape.box().high.x() - shape.box().low.x(); }

}  // namespace fontcore::weight
