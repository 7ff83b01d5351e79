#include "fontcore/place.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>

#include "fontcore/analogy.h"
#include "fontcore/error.h"
#include "fontcore/measure.h"

namespace fontcore {

namespace {

using Eigen::Index;
constexpr double pi = std::numbers::pi;

constexpr int steps_of_segment = 32;      // a cubic is within 1.5e-3 of its move of the lines between them
constexpr double fade = 1.0 / 16.0;       // of the stretch, at either end
constexpr double corner_turn = pi / 6.0;  // by which stretches are laid on each other
constexpr double other_turn = pi / 6.0;   // how much more or less a matching corner may turn
constexpr double other_length = 0.5;      // how much longer or shorter what lies between two corners may be
constexpr double reach_of_edit = 0.1;     // ems: how far an edit may have moved a corner
constexpr int slides = 64;                // of a detail without corners, over its own length
constexpr int most_passes = 20;           // of size and ends, each of which says where the other is
constexpr int halvings = 12;
constexpr double better_mirrored = 1.25;  // a mirror image is taken where it fits better by a quarter
constexpr double no_move = 1e-9;          // ems

double place_of(const OutlineArcs& outline, const OutlineArcs::Location& location) {
  const auto& arc = outline.arcs()[static_cast<std::size_t>(outline.arc_of(location.segment))];
  return arc.start + outline.offset_of(location.segment) + outline.along(location.segment).at(location.u);
}

double forward(const OutlineArcs& outline, double from, double to) {
  const double gap = to - from;
  return gap - std::floor(gap / outline.length()) * outline.length();
}

Point point_at(const OutlineArcs& outline, double s) {
  const auto [segment, u] = outline.locate(s);
  return evaluate(outline.contour().segment(segment), u);
}

// Arc lengths of an outline's joins, rising, and their turns.
std::vector<PlacedDetail::Corner> joins_of(const OutlineArcs& outline) {
  const std::vector<double> turns = turning_angles(outline.contour());
  std::vector<PlacedDetail::Corner> joins;
  for (const OutlineArcs::Arc& arc : outline.arcs()) {
    for (std::size_t k = 0; k < arc.segments.size(); ++k) {
      joins.push_back({arc.start + arc.offsets[k], turns[static_cast<std::size_t>(arc.segments[k])]});
    }
  }
  return joins;
}

// Where an outline's edited version has the places of the outline.
class Edited {
 public:
  Edited(const OutlineArcs& plain, const OutlineArcs& edited, double units_per_em) : plain_(plain), edited_(edited) {
    if (!has_same_structure(plain.contour(), edited.contour())) {
      stretches_ = match_arcs(plain, edited, reach_of_edit * units_per_em);
    }
  }

  Point at(double s) const {
    const auto [segment, u] = plain_.locate(s);
    if (stretches_.empty()) return evaluate(edited_.contour().segment(segment), u);
    const auto k = static_cast<std::size_t>(plain_.arc_of(segment));
    const double share = (plain_.offset_of(segment) + plain_.along(segment).at(u)) / plain_.arcs()[k].length;
    return point_at(edited_, stretches_[k].start + share * stretches_[k].length);
  }

 private:
  const OutlineArcs& plain_;
  const OutlineArcs& edited_;
  std::vector<Stretch> stretches_;
};

// The stretch run through from its other end.
PlacedDetail reversed(const PlacedDetail& detail) {
  PlacedDetail other = detail;
  const double length = detail.along[detail.along.size() - 1];
  other.along = (length - detail.along.reverse().array()).matrix();
  other.path = detail.path.colwise().reverse();
  other.displacement = detail.displacement.colwise().reverse();
  other.corners.assign(detail.corners.rbegin(), detail.corners.rend());
  for (PlacedDetail::Corner& corner : other.corners) corner = {length - corner.at, -corner.turn};
  return other;
}

PlacedDetail mirrored(const PlacedDetail& detail) {
  PlacedDetail other = detail;
  other.path.col(0) *= -1.0;
  other.displacement.col(0) *= -1.0;
  for (PlacedDetail::Corner& corner : other.corners) corner.turn *= -1.0;
  return other;
}

// The detail as it is to run along contours with their ink on a side. A mirror image has its ink on the other side.
PlacedDetail as_it_runs(const PlacedDetail& detail, InkSide ink, bool is_mirrored) {
  const PlacedDetail image = is_mirrored ? mirrored(detail) : detail;
  return (ink == InkSide::Right) == is_mirrored ? image : reversed(image);
}

std::complex<double> complex_of(const Eigen::RowVector2d& p) { return {p.x(), p.y()}; }

// Finds where one way of running a detail lies on one outline.
class Finder {
 public:
  Finder(const OutlineArcs& outline, const PlacedDetail& detail, const PlaceOptions& options)
      : outline_(outline), detail_(detail), options_(options), length_(detail.along[detail.along.size() - 1]) {
    for (const auto& join : joins_of(outline)) {
      if (std::abs(join.turn) >= corner_turn - other_turn) joins_.push_back(join);
    }
  }

  std::vector<MatchingPlace> find() const {
    std::vector<MatchingPlace> found;
    if (detail_.corners.empty()) {
      slide(found);
      return found;
    }
    for (std::size_t first = 0; first < joins_.size(); ++first) {
      // The sizes between those allowed that a rough look may need.
      for (const double size :
           {1.0, options_.smallest, options_.largest, std::sqrt(options_.smallest * options_.largest)}) {
        if (size < options_.smallest || size > options_.largest) continue;
        const std::optional<MatchingPlace> place = at_corner(first, size);
        if (!place) continue;
        found.push_back(*place);
        break;
      }
    }
    return found;
  }

 private:
  double em() const { return options_.units_per_em; }

  // The detail with its first corner on a join.
  std::optional<MatchingPlace> at_corner(std::size_t first, double size) const {
    std::vector<double> at{joins_[first].at};  // of the corners: rising, over the start if need be
    if (!turns_alike(0, joins_[first])) return {};
    for (std::size_t k = 1; k < detail_.corners.size(); ++k) {
      const double wanted = size * em() * (detail_.corners[k].at - detail_.corners[k - 1].at);
      const double slack = other_length * wanted + 2e-3 * options_.tolerance * em();
      double nearest = slack;
      double chosen = -1.0;
      for (const auto& join : joins_) {
        const double gap = forward(outline_, at.back(), join.at);
        if (gap == 0.0 || std::abs(gap - wanted) > nearest || !turns_alike(k, join)) continue;
        nearest = std::abs(gap - wanted);
        chosen = at.back() + gap;
      }
      if (chosen < 0.0) return {};
      at.push_back(chosen);
    }
    const double span = detail_.corners.back().at - detail_.corners.front().at;
    if (span > 0.0) size = std::clamp((at.back() - at.front()) / (em() * span), options_.smallest, options_.largest);
    for (int pass = 0;; ++pass) {
      MatchingPlace place = laid(at, size);
      if (place.length > outline_.length()) return {};
      measure(place);
      if (std::abs(place.size - size) <= 1e-9 || pass == most_passes) {
        return place.distance <= options_.tolerance ? std::optional(place) : std::nullopt;
      }
      size = place.size;
    }
  }
  bool turns_alike(std::size_t corner, const PlacedDetail::Corner& join) const {
    return std::abs(join.turn - detail_.corners[corner].turn) <= other_turn;
  }

  // From the corners' places those of the ends.
  MatchingPlace laid(const std::vector<double>& at, double size) const {
    MatchingPlace place;
    place.size = size;
    place.start = at.front() - size * em() * detail_.corners.front().at;
    const double end = at.back() + size * em() * (length_ - detail_.corners.back().at);
    place.length = end - place.start;
    place.knots.emplace_back(0.0, 0.0);
    for (std::size_t k = 0; k < at.size(); ++k) add_knot(place, at[k] - place.start, detail_.corners[k].at);
    add_knot(place, place.length, length_);
    return place;
  }
  static void add_knot(MatchingPlace& place, double s, double along) {
    if (along - place.knots.back().second > 1e-12) place.knots.emplace_back(s, along);
  }

  // Lays the detail on the place by least squares, as far as it may turn and grow, and measures what is between.
  void measure(MatchingPlace& place) const {
    const Index n = detail_.along.size();
    Points there(n, 2);
    std::size_t k = 1;
    for (Index i = 0; i < n; ++i) {
      while (k + 1 < place.knots.size() && detail_.along[i] > place.knots[k].second) ++k;
      const auto& [s0, a0] = place.knots[k - 1];
      const auto& [s1, a1] = place.knots[k];
      there.row(i) = point_at(outline_, place.start + s0 + (s1 - s0) * (detail_.along[i] - a0) / (a1 - a0)) / em();
    }
    Eigen::VectorXd weight = Eigen::VectorXd::Zero(n);
    for (Index i = 0; i + 1 < n; ++i) {
      const double half = 0.5 * (detail_.along[i + 1] - detail_.along[i]) / length_;
      weight[i] += half;
      weight[i + 1] += half;
    }
    const Eigen::RowVector2d middle = weight.transpose() * detail_.path;
    const Eigen::RowVector2d middle_there = weight.transpose() * there;
    std::complex<double> product = 0.0;
    double square = 0.0;
    for (Index i = 0; i < n; ++i) {
      const std::complex<double> own = complex_of(detail_.path.row(i) - middle);
      product += weight[i] * std::conj(own) * complex_of(there.row(i) - middle_there);
      square += weight[i] * std::norm(own);
    }
    place.angle = options_.turns ? std::arg(product) : 0.0;
    const double grown = options_.turns ? std::abs(product) : product.real();
    place.size = std::clamp(grown / square, options_.smallest, options_.largest);
    const std::complex<double> turn = std::polar(place.size, place.angle);
    double off = 0.0;
    for (Index i = 0; i < n; ++i) {
      off = std::max(
          off, std::abs(complex_of(there.row(i) - middle_there) - turn * complex_of(detail_.path.row(i) - middle)));
    }
    place.distance = 1000.0 * off;
  }

  // A detail without corners, by trying everywhere.
  void slide(std::vector<MatchingPlace>& found) const {
    const double own = em() * length_;
    if (own > outline_.length()) return;
    const auto tried = [&](double start) {
      MatchingPlace place;
      place.start = start;
      place.length = own * options_.smallest;
      place.knots = {{0.0, 0.0}, {place.length, length_}};
      measure(place);
      for (int pass = 0; pass < 3 && options_.largest > options_.smallest; ++pass) {
        place.length = own * place.size;
        place.knots.back().first = place.length;
        measure(place);
      }
      return place;
    };
    const auto count = static_cast<int>(std::ceil(outline_.length() / own * slides));
    const double step = outline_.length() / count;
    std::vector<MatchingPlace> all;
    for (int i = 0; i < count; ++i) all.push_back(tried(i * step));
    for (int i = 0; i < count; ++i) {
      const auto at = [&](int k) -> const MatchingPlace& {
        return all[static_cast<std::size_t>((k % count + count) % count)];
      };
      if (at(i).distance > at(i - 1).distance || at(i).distance > at(i + 1).distance) continue;
      MatchingPlace best = at(i);
      double by = 0.5 * step;
      for (int pass = 0; pass < halvings; ++pass, by *= 0.5) {
        for (const MatchingPlace& near : {tried(best.start - by), tried(best.start + by)}) {
          if (near.distance < best.distance) best = near;
        }
      }
      if (best.distance <= options_.tolerance) found.push_back(best);
    }
  }

  const OutlineArcs& outline_;
  const PlacedDetail& detail_;
  const PlaceOptions& options_;
  double length_;
  std::vector<PlacedDetail::Corner> joins_;
};

void check(const PlacedDetail& detail, const PlaceOptions& options) {
  if (detail.along.size() < 2) throw InvalidInput("find_places: the detail is empty");
  const bool holds = options.tolerance > 0.0 && options.units_per_em > 0.0 && options.smallest > 0.0 &&
                     options.largest >= options.smallest && std::isfinite(options.largest);
  if (!holds) {
    throw InvalidInput(text("find_places: tolerance ", options.tolerance, ", sizes ", options.smallest, " to ",
                            options.largest, ", ", options.units_per_em, " units to the em"));
  }
}

bool overlap(const OutlineArcs& outline, const MatchingPlace& a, const MatchingPlace& b) {
  if (a.contour != b.contour) return false;
  constexpr double touch = 1e-6;
  return forward(outline, a.start, b.start) < a.length - touch || forward(outline, b.start, a.start) < b.length - touch;
}

double rank(const MatchingPlace& place) { return place.distance * (place.is_mirrored ? better_mirrored : 1.0); }

Eigen::RowVector2d between(const Eigen::VectorXd& along, const Points& values, double at) {
  const Index n = along.size();
  const Index above = std::upper_bound(along.data(), along.data() + n, at) - along.data();
  const Index low = std::clamp<Index>(above - 1, 0, n - 2);
  const double share = std::clamp((at - along[low]) / (along[low + 1] - along[low]), 0.0, 1.0);
  return (1.0 - share) * values.row(low) + share * values.row(low + 1);
}

}  // namespace

PlacedDetail learn_place(const OutlineArcs& plain, const OutlineArcs& edited, const OutlineArcs::Location& from,
                         const OutlineArcs::Location& to, double units_per_em, InkSide ink) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("learn_place: ", units_per_em, " units to the em"));
  const double start = place_of(plain, from);
  const double length = forward(plain, start, place_of(plain, to));
  if (!(length > 0.0)) throw InvalidInput("learn_place: the stretch has no length");
  const Edited moved(plain, edited, units_per_em);
  PlacedDetail detail;
  std::vector<double> ends{0.0};
  const double no_length = 1e-9 * length;
  std::vector<PlacedDetail::Corner> joins = joins_of(plain);
  for (PlacedDetail::Corner& join : joins) {
    join.at = forward(plain, start, join.at);
    if (join.at > plain.length() - no_length) join.at = 0.0;
  }
  std::sort(joins.begin(), joins.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
  for (const PlacedDetail::Corner& join : joins) {
    if (join.at > length + no_length) break;
    if (std::abs(join.turn) >= corner_turn) detail.corners.push_back({join.at / units_per_em, join.turn});
    if (join.at > ends.back() + no_length && join.at < length - no_length) ends.push_back(join.at);
  }
  ends.push_back(length);
  const auto n = static_cast<Index>((ends.size() - 1) * steps_of_segment + 1);
  detail.along.resize(n);
  detail.path.resize(n, 2);
  detail.displacement.resize(n, 2);
  const Point origin = point_at(plain, start);
  for (Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(std::min<Index>(i / steps_of_segment, static_cast<Index>(ends.size()) - 2));
    const double share = static_cast<double>(i - static_cast<Index>(k) * steps_of_segment) / steps_of_segment;
    const double s = ends[k] + share * (ends[k + 1] - ends[k]);
    const Point here = point_at(plain, start + s);
    const Point move = moved.at(start + s) - here;
    const double nearest = std::min(s, length - s) / (fade * length);
    const double held = nearest >= 1.0 ? 1.0 : 0.5 - 0.5 * std::cos(pi * nearest);
    detail.along[i] = s / units_per_em;
    detail.path.row(i) = (here - origin) / units_per_em;
    detail.displacement.row(i) = held * move / units_per_em;
    const auto [segment, u] = plain.locate(start + s);
    const Point along = derivative(plain.contour().segment(segment), u).normalized();
    const double off = std::abs(cross(along, move));
    detail.faded = std::max(detail.faded, (1.0 - held) * off / units_per_em);
  }
  if (ink == InkSide::Left) return detail;
  detail = reversed(detail);
  detail.path.rowwise() -= detail.path.row(0).eval();
  return detail;
}

std::vector<MatchingPlace> find_places(const std::vector<OutlineArcs>& contours, const PlacedDetail& detail,
                                       const PlaceOptions& options) {
  check(detail, options);
  std::vector<MatchingPlace> all;
  for (const bool is_mirrored : {false, true}) {
    if (is_mirrored && !options.mirrors) continue;
    const PlacedDetail runs = as_it_runs(detail, options.ink, is_mirrored);
    for (std::size_t c = 0; c < contours.size(); ++c) {
      for (MatchingPlace& place : Finder(contours[c], runs, options).find()) {
        place.contour = static_cast<int>(c);
        place.is_mirrored = is_mirrored;
        all.push_back(std::move(place));
      }
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return rank(a) < rank(b); });
  std::vector<MatchingPlace> chosen;
  for (const MatchingPlace& place : all) {
    const auto& outline = contours[static_cast<std::size_t>(place.contour)];
    if (std::ranges::none_of(chosen, [&](const MatchingPlace& other) { return overlap(outline, place, other); })) {
      chosen.push_back(place);
    }
  }
  return chosen;
}

Wish wish_of_places(const OutlineArcs& outline, const PlacedDetail& detail, const std::vector<MatchingPlace>& places,
                    const PlaceOptions& options) {
  struct Laid {
    MatchingPlace place;
    PlacedDetail detail;
    Eigen::Matrix2d turn;
  };
  std::vector<Laid> all;
  for (const MatchingPlace& place : places) {
    Eigen::Matrix2d turn;
    turn << std::cos(place.angle), -std::sin(place.angle), std::sin(place.angle), std::cos(place.angle);
    all.push_back({place, as_it_runs(detail, options.ink, place.is_mirrored),
                   Eigen::Matrix2d(place.size * options.units_per_em * turn)});
  }
  const auto at = [all = std::move(all), &outline](int segment, double s) -> Point {
    const auto& arc = outline.arcs()[static_cast<std::size_t>(outline.arc_of(segment))];
    Point sum = Point::Zero();
    for (const Laid& laid : all) {
      const double beyond = forward(outline, laid.place.start, arc.start + outline.offset_of(segment) + s);
      if (beyond > laid.place.length) continue;
      const auto& knots = laid.place.knots;
      std::size_t k = 1;
      while (k + 1 < knots.size() && beyond > knots[k].first) ++k;
      const auto& [s0, a0] = knots[k - 1];
      const auto& [s1, a1] = knots[k];
      const double along = a0 + (a1 - a0) * (beyond - s0) / (s1 - s0);
      sum += laid.turn * between(laid.detail.along, laid.detail.displacement, along).transpose();
    }
    return sum;
  };
  return [at, &outline](int segment, double u, double s) -> Point {
    // A line goes with its ends: one that the stretch ends on is not asked to bend there.
    if (outline.contour().degree(segment) > 1) return at(segment, s);
    return (1.0 - u) * at(segment, 0.0) + u * at(segment, outline.along(segment).length());
  };
}

StructureFit add_at_places(const OutlineArcs& outline, const PlacedDetail& detail,
                           const std::vector<MatchingPlace>& places, const PlaceOptions& options, StructureEdit edit) {
  const BezierContour& contour = outline.contour();
  const Wish wish = wish_of_places(outline, detail, places, options);
  const int count = contour.segment_count();
  std::vector<bool> moves(static_cast<std::size_t>(count), false);
  std::vector<bool> is_free(static_cast<std::size_t>(contour.point_count()), true);
  for (int s = 0; s < count; ++s) {
    for (int k = 0; k <= steps_of_segment && !moves[static_cast<std::size_t>(s)]; ++k) {
      const double u = static_cast<double>(k) / steps_of_segment;
      const Point wished = wish(s, u, outline.along(s).at(u));
      moves[static_cast<std::size_t>(s)] = !wished.isZero(no_move * options.units_per_em);
    }
    for (int k = 0; !moves[static_cast<std::size_t>(s)] && k <= contour.degree(s); ++k) {
      is_free[static_cast<std::size_t>(contour.point_of(s, k))] = false;
    }
  }
  if (std::ranges::none_of(moves, [](bool moved) { return moved; })) return {contour, {}, {}, {}, 0.0};
  const auto add = [&](const Rows& more) { edit.rows.insert(edit.rows.end(), more.begin(), more.end()); };
  for (int i = 0; i < static_cast<int>(contour.point_count()); ++i) {
    if (!is_free[static_cast<std::size_t>(i)]) add(rows(contour, FrozenPoint{i}));
  }
  // A line beyond which everything rests may change its length: that it keeps its direction keeps the join smooth,
  // where the ratio of its handles would freeze it.
  const std::vector<double> turns = turning_angles(contour);
  for (int s = 0; s < count; ++s) {
    if (!moves[static_cast<std::size_t>(s)] || contour.degree(s) != 1) continue;
    for (const auto& [join, beyond] :
         {std::pair(s, contour.previous(s)), std::pair(contour.next(s), contour.next(s))}) {
      const bool is_smooth = std::abs(turns[static_cast<std::size_t>(join)]) <= edit.rules.corner_angle;
      if (!edit.rules.smooth_joins || !is_smooth || moves[static_cast<std::size_t>(beyond)]) continue;
      if (contour.kind(contour.node(join)) == PointKind::ImpliedNode || contour.degree(beyond) == 1) continue;
      edit.rules.corners.push_back(contour.node(join));
      add(rows(contour, SlantedLine{s}));
    }
  }
  if (edit.breadth == 0.0) edit.breadth = 0.25 * options.units_per_em * detail.along[detail.along.size() - 1];
  return refit_structure(outline, wish, edit);
}

}  // namespace fontcore
