#include "glyphs/emission.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <set>

#include "fontcore/compact.h"
#include "fontcore/degree.h"
#include "fontcore/error.h"
#include "fontcore/fit.h"
#include "fontcore/measure.h"
#include "fontcore/rounding.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::text;
using Contours = std::vector<BezierContour>;

constexpr double least_texture_tolerance = 1.25;  // units: whole numbers alone move points by up to 0.7
constexpr double most_texture_tolerance = 4.0;    // units, and eight times what is asked

class GlyphEmitter {
 public:
  GlyphEmitter(const SolvedGlyph& glyph, const Recipe& recipe)
      : glyph_(glyph),
        original_(glyph.original),
        references_(glyph.references),
        recipe_(recipe),
        has_quadratics_(has_quadratics(glyph.font, glyph.original)) {}

  EmittedGlyph emit() const {
    EmittedGlyph result;
    round_own_points(result);
    emit_compactly(result);
    return result;
  }

 private:
  fontcore::OutlineRules rules_of(std::size_t index) const {
    fontcore::OutlineRules rules = glyph_.rules;
    rules.corners = references_[index].corners;
    return rules;
  }

  // What moved, on its own points; a texture has none of them.
  void round_own_points(EmittedGlyph& result) const {
    const Contours& solved = glyph_.contours;
    result.contours = original_;
    result.handle_errors.assign(solved.size(), 0.0);
    const double scale = std::abs(signed_area(original_));
    std::vector<fontcore::Unrounded> moved;
    std::vector<std::size_t> index;
    for (std::size_t k = 0; k < solved.size(); ++k) {
      if (solved[k] == original_[k] || references_[k].is_textured) continue;
      const ContourReference& reference = references_[k];
      fontcore::RoundingGoal goal{signed_area(solved[k]), scale, glyph_.handles[k], {}, fontcore::BeyondUnit::ForArea};
      if (reference.contour != original_[k]) {
        for (std::size_t i = 0; i < reference.came_from.size(); ++i) {
          const int from = reference.came_from[i];
          const int now = static_cast<int>(i);
          // A node that was implied has no place of its own in the font, and may lie at halves.
          goal.is_new.push_back(from < 0 || reference.contour.kind(now) != original_[k].kind(from) ||
                                reference.contour.point(now) != original_[k].point(from));
        }
      }
      moved.push_back({solved[k], reference.contour, rules_of(k), std::move(goal)});
      index.push_back(k);
    }
    std::vector<fontcore::Rounding> roundings = round_together(moved);
    for (std::size_t i = 0; i < moved.size(); ++i) {
      const std::size_t k = index[i];
      result.contours[k] = std::move(roundings[i].contour);
      result.handle_errors[k] = roundings[i].handle_error;
      const fontcore::Box box = control_box(result.contours[k]);
      if (box.low.minCoeff() < -32768.0 || box.high.maxCoeff() > 32767.0) {
        throw Refusal{text("contour ", k, ": a coordinate leaves the range -32768 to 32767")};
      }
    }
  }

  // What moved, in the fewest segments within the tolerance: fitted, its area given back by the least change of its own
  // points, rounded and measured; with less tolerance where one of these takes it beyond. What comes out no shorter
  // stays as its own points have it, and so do segments that are frozen.
  void emit_compactly(EmittedGlyph& result) const {
    const double unit = recipe_.lengths_in_thousandths ? glyph_.font.units_per_em / 1000.0 : 1.0;
    const double tolerance = recipe_.tolerance * unit;
    std::vector<std::size_t> open;
    std::vector<std::size_t> textured;
    for (std::size_t k = 0; k < original_.size(); ++k) {
      if (glyph_.contours[k] == original_[k]) continue;
      if (references_[k].is_textured) {
        textured.push_back(k);
      } else if (recipe_.emission == Emission::Compact) {
        open.push_back(k);
      }
    }
    for (const std::size_t k : fitted_within(tolerance, {0.8, 0.56, 0.39, 0.27}, std::move(open), result)) {
      result.notes.push_back(text("contour ", k, ": no fewer segments in whole numbers stay within ", tolerance));
    }
    // A texture has no points of its own to fall back to: where whole numbers are too far apart, it may be farther off.
    for (double wide = std::max(tolerance, least_texture_tolerance); !textured.empty(); wide *= 1.5) {
      if (wide > most_texture_tolerance * unit + 8.0 * tolerance) {
        throw Refusal{
            text("contour ", textured[0], ": no curves in whole numbers are within ", wide / 1.5, " of its texture")};
      }
      textured = fitted_within(wide, {0.6, 0.4, 0.25}, std::move(textured), result);
    }
  }

  // Those of the contours that cannot be had in whole numbers within a tolerance; the others are emitted. Shares of it
  // are what the fit may take, one after the other: the rest is for area and rounding.
  std::vector<std::size_t> fitted_within(double tolerance, std::initializer_list<double> shares,
                                         std::vector<std::size_t> open, EmittedGlyph& result) const {
    std::vector<std::size_t> never;
    for (const double share : shares) {
      if (open.empty()) break;
      std::vector<fontcore::Unrounded> fitted;
      std::vector<std::size_t> index;
      for (const std::size_t k : open) {
        std::optional<fontcore::Unrounded> fit = fitted_compactly(glyph_.contours[k], k, share * tolerance);
        if (!fit && references_[k].is_textured) never.push_back(k);
        const bool is_worth_it =
            fit && (references_[k].is_textured || fit->edited.segment_count() < result.contours[k].segment_count());
        if (!is_worth_it) continue;
        fitted.push_back(std::move(*fit));
        index.push_back(k);
      }
      open.clear();
      auto roundings = round_together(fitted);
      for (std::size_t i = 0; i < index.size(); ++i) {
        const std::size_t k = index[i];
        if (references_[k].is_textured) {
          std::vector<bool> stays;
          for (const bool is_new : fitted[i].goal.is_new) stays.push_back(!is_new);
          roundings[i].contour = straightened(roundings[i].contour, stays);
        }
        const double accuracy = 0.005 * tolerance;
        if (farthest(glyph_.contours[k], roundings[i].contour, accuracy).distance > tolerance) {
          open.push_back(k);
        } else {
          result.contours[k] = roundings[i].contour;
        }
      }
    }
    open.insert(open.end(), never.begin(), never.end());
    return open;
  }

  // The points of a contour that are frozen, an implied node by its handles too.
  std::vector<bool> frozen_points(std::size_t index) const {
    const BezierContour& contour = references_[index].contour;
    const fontcore::Rows& frozen = references_[index].frozen;
    const auto count = static_cast<std::size_t>(contour.point_count());
    std::vector<bool> is_frozen(count, false);
    for (const fontcore::Row& row : frozen) is_frozen[static_cast<std::size_t>(row.terms.front().variable / 2)] = true;
    for (std::size_t i = 0; i < count; ++i) {
      if (contour.kind(static_cast<int>(i)) != fontcore::PointKind::ImpliedNode) continue;
      const std::size_t before = i == 0 ? count - 1 : i - 1;
      const std::size_t after = i + 1 == count ? 0 : i + 1;
      if (is_frozen[i] && (is_frozen[before] || is_frozen[after])) is_frozen[before] = is_frozen[after] = true;
      if (is_frozen[before] && is_frozen[after]) is_frozen[i] = true;
    }
    return is_frozen;
  }

  // Whether a point is one of the font's, and where the font has it.
  bool is_unmoved(const BezierContour& solved, int point, std::size_t index) const {
    const int from = references_[index].came_from[static_cast<std::size_t>(point)];
    return from >= 0 && solved.point(point) == original_[index].point(from);
  }

  // Those, and of a textured contour the points of segments that nothing touched.
  std::vector<bool> staying_points(const BezierContour& solved, std::size_t index) const {
    std::vector<bool> stays = frozen_points(index);
    const ContourReference& reference = references_[index];
    if (!reference.is_textured) return stays;
    for (int s = 0; s < solved.segment_count(); ++s) {
      bool is_whole = true;
      for (int k = 0; k <= solved.degree(s); ++k)
        is_whole = is_whole && is_unmoved(solved, solved.point_of(s, k), index);
      for (int k = 0; is_whole && k <= solved.degree(s); ++k)
        stays[static_cast<std::size_t>(solved.point_of(s, k))] = true;
    }
    return stays;
  }

  // Those marked; and of a textured contour the font's own that a fit would take for smooth, beside a line.
  std::vector<int> corners_of(const BezierContour& solved, std::size_t index) const {
    std::vector<int> corners = references_[index].corners;
    if (!references_[index].is_textured) return corners;
    constexpr double least_turn = 0.01;  // radians
    const std::vector<double> turns = turning_angles(solved);
    for (int s = 0; s < solved.segment_count(); ++s) {
      const int node = solved.node(s);
      const bool is_own = solved.kind(node) == fontcore::PointKind::Node && is_unmoved(solved, node, index);
      if (is_own && std::abs(turns[static_cast<std::size_t>(s)]) > least_turn) corners.push_back(node);
    }
    std::ranges::sort(corners);
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    return corners;
  }

  // Where points stand that stay: of segments that nothing touched, and nodes of the font's between textured stretches.
  using Places = std::set<std::pair<double, double>>;
  Places staying_places(const BezierContour& solved, const std::vector<bool>& stays, std::size_t index) const {
    Places places;
    for (int i = 0; i < solved.point_count(); ++i) {
      const bool is_own = references_[index].is_textured && is_node(solved.kind(i)) && is_unmoved(solved, i, index);
      if (stays[static_cast<std::size_t>(i)] || is_own) places.emplace(solved.point(i).x(), solved.point(i).y());
    }
    return places;
  }
  static std::vector<bool> marks_at(const BezierContour& contour, const Places& places) {
    std::vector<bool> marks;
    for (int i = 0; i < contour.point_count(); ++i) {
      marks.push_back(places.contains({contour.point(i).x(), contour.point(i).y()}));
    }
    return marks;
  }

  // The segments that frozen points need: those frozen as a whole, and those with a frozen point that none of them has,
  // or one that is implied and so lies between two.
  static std::vector<int> segments_of(const BezierContour& contour, const std::vector<bool>& is_frozen) {
    const auto frozen = [&](int s, int k) { return is_frozen[static_cast<std::size_t>(contour.point_of(s, k))]; };
    const auto is_whole = [&](int s) {
      for (int k = 0; k <= contour.degree(s); ++k) {
        if (!frozen(s, k)) return false;
      }
      return true;
    };
    std::vector<int> segments;
    for (int s = 0; s < contour.segment_count(); ++s) {
      const auto needs_end = [&](int k, int beyond) {
        const bool is_implied = contour.kind(contour.point_of(s, k)) == fontcore::PointKind::ImpliedNode;
        return frozen(s, k) && (is_implied || !is_whole(beyond));
      };
      bool is_needed =
          is_whole(s) || needs_end(0, contour.previous(s)) || needs_end(contour.degree(s), contour.next(s));
      for (int k = 1; k < contour.degree(s); ++k) is_needed = is_needed || frozen(s, k);
      if (is_needed) segments.push_back(s);
    }
    return segments;
  }

  // None if the fit or the area cannot be had.
  std::optional<fontcore::Unrounded> fitted_compactly(const BezierContour& solved, std::size_t index,
                                                      double tolerance) const {
    fontcore::CompactOptions options;
    options.tolerance = tolerance;
    options.units_per_em = glyph_.font.units_per_em;
    options.extrema = recipe_.keep.extrema ? fontcore::Extrema::Keep : fontcore::Extrema::Free;
    options.curve = has_quadratics_ ? fontcore::CurveKind::Quadratic : fontcore::CurveKind::Cubic;
    options.coordinates = fontcore::Coordinates::Any;
    options.corners = corners_of(solved, index);
    const std::vector<bool> stays = staying_points(solved, index);
    options.kept_segments = segments_of(solved, stays);
    const Places places = staying_places(solved, stays, index);
    std::optional<BezierContour> emitted;
    if (references_[index].is_textured && options.curve == fontcore::CurveKind::Quadratic) {
      emitted = fitted_by_quadratics(solved, options, places);
    } else {
      const int other_degree = options.curve == fontcore::CurveKind::Cubic ? 2 : 3;
      for (const int s : options.kept_segments) {
        if (solved.degree(s) == other_degree) return std::nullopt;
      }
      fontcore::CompactFit fit = fit_compact(solved, options);
      if (fit.why.empty()) emitted = std::move(fit.contour);
    }
    if (!emitted) return std::nullopt;
    fontcore::Unrounded result{*emitted, *emitted, glyph_.rules, {}};
    result.goal.area = signed_area(solved);
    result.goal.scale = std::abs(signed_area(original_));
    const std::vector<bool> is_held = marks_at(*emitted, places);
    std::vector<int> held;
    for (int i = 0; i < emitted->point_count(); ++i) {
      if (is_held[static_cast<std::size_t>(i)]) held.push_back(i);
    }
    result.goal.is_new = is_held;
    result.goal.is_new.flip();
    if (recipe_.keep.area == KeepArea::None || *emitted == solved) return result;
    fontcore::StructureEdit edit;
    edit.rules = glyph_.rules;
    edit.area = result.goal.area;
    edit.breadth = length(*emitted);
    edit.rows = rows(fontcore::FrozenStretch{"what is frozen", held});
    const auto stay = [](int, double, double) { return Point(Point::Zero()); };
    fontcore::StructureFit given_back = refit_structure(fontcore::OutlineArcs(*emitted), stay, edit);
    if (!given_back.report.failed.empty()) return std::nullopt;
    result.edited = std::move(given_back.contour);
    return result;
  }

  // A texture in quadratics: fitted by cubics, and these cut. What is kept comes back as the quadratics it was.
  static std::optional<BezierContour> fitted_by_quadratics(const BezierContour& solved,
                                                           fontcore::CompactOptions options, const Places& places) {
    constexpr double shortest = 2.5;  // units: on shorter ones rounding turns handles back
    constexpr double share_of_cubics = 0.6;
    constexpr double share_of_nodes = 0.1;
    const double tolerance = options.tolerance;
    options.curve = fontcore::CurveKind::Cubic;
    options.tolerance = share_of_cubics * tolerance;
    const BezierContour raised = raised_to_cubics(solved);
    std::vector<int> corners;  // its points have other numbers
    for (int s = 0; s < solved.segment_count(); ++s) {
      if (std::ranges::binary_search(options.corners, solved.node(s))) corners.push_back(raised.node(s));
    }
    options.corners = std::move(corners);
    const fontcore::CompactFit fit = fit_compact(raised, options);
    if (!fit.why.empty()) return std::nullopt;
    std::vector<Point> points;
    std::vector<fontcore::PointKind> kinds;
    for (int s = 0; s < fit.contour.segment_count(); ++s) {
      const auto kept = std::ranges::find(fit.kept_at, s);
      const Bezier segment =
          kept == fit.kept_at.end()
              ? fit.contour.segment(s)
              : solved.segment(options.kept_segments[static_cast<std::size_t>(kept - fit.kept_at.begin())]);
      for (int k = 0; k < segment.degree; ++k) {
        points.push_back(segment.p[static_cast<std::size_t>(k)]);
        kinds.push_back(k == 0                ? fontcore::PointKind::Node
                        : segment.degree == 2 ? fontcore::PointKind::Quadratic
                                              : fontcore::PointKind::Cubic);
      }
    }
    fontcore::Points list(static_cast<Eigen::Index>(points.size()), 2);
    for (std::size_t i = 0; i < points.size(); ++i) list.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
    const BezierContour cut = fontcore::lowered_to_quadratics(
        {std::move(list), std::move(kinds)}, (1.0 - share_of_cubics - share_of_nodes) * tolerance, false);
    return with_implied_nodes(without_short_segments(cut, shortest, marks_at(cut, places)), share_of_nodes * tolerance);
  }

  std::vector<fontcore::Rounding> round_together(const std::vector<fontcore::Unrounded>& moved) const {
    if (recipe_.keep.area == KeepArea::Glyph) return round_keeping_area(moved);
    std::vector<fontcore::Rounding> roundings;
    for (const auto& [contour, reference, rules, goal] : moved) {
      roundings.push_back(round_keeping_area(contour, reference, rules, goal));
    }
    return roundings;
  }

  const SolvedGlyph& glyph_;
  const Contours& original_;
  const std::vector<ContourReference>& references_;
  const Recipe& recipe_;
  const bool has_quadratics_;
};

}  // namespace

EmittedGlyph emit(const SolvedGlyph& glyph, const Recipe& recipe) { return GlyphEmitter(glyph, recipe).emit(); }

bool has_quadratics(const Font& font, const Contours& contours) {
  if (font.format != OutlineFormat::Ufo) return font.format == OutlineFormat::TrueType;
  return std::ranges::any_of(contours, [](const BezierContour& contour) {
    return std::ranges::count(contour.kinds(), fontcore::PointKind::Quadratic) > 0;
  });
}

}  // namespace glyphs
