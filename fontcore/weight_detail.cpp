#include <algorithm>
#include <array>
#include <cmath>

#include "fontcore/crossing.h"
#include "fontcore/detail.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/weight_law.h"

namespace fontcore {

using namespace weight;

namespace {

constexpr double flat = 0.05;      // of the scale: a stretch of base that bends by less is a line
constexpr double close = 0.02;     // of the scale, from its base to a curve that stands for it
constexpr double most_turn = 1.7;  // radians of one curve
constexpr int steps_per_scale = 16;
constexpr double most_steps = 2048.0;

// The rotation from one direction to another.
Eigen::Matrix2d turn(const Point& from, const Point& to) {
  const Point a = from.stableNormalized();
  const Point b = to.stableNormalized();
  const double cosine = a.dot(b);
  const double sine = cross(a, b);
  if (cosine == 0.0 && sine == 0.0) return Eigen::Matrix2d::Identity();
  return (Eigen::Matrix2d() << cosine, -sine, sine, cosine).finished();
}

// The base of a contour below a scale as lines and cubics, and of each of the contour's nodes its place on them.
class BaseOutline {
 public:
  BaseOutline(const BezierContour& contour, double scale) : original_(contour), base_(contour) {
    if (contour.point_count() < 3 || signed_area(contour) == 0.0) return;  // its own base
    const OutlineArcs arcs = arcs_at_scale(contour, scale);
    const bool is_closed = !arcs.has_corner();
    for (std::size_t k = 0; k < arcs.arcs().size(); ++k) {
      const double wanted = arcs.arcs()[k].length / scale * steps_per_scale;
      const auto count = static_cast<Eigen::Index>(std::clamp(std::ceil(wanted), 16.0, most_steps));
      add_arc(DetailBase(points_along(arcs, static_cast<int>(k), count), is_closed, scale), scale);
    }
    Points points(static_cast<Eigen::Index>(points_.size()), 2);
    for (std::size_t i = 0; i < points_.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = points_[i].transpose();
    base_ = BezierContour(std::move(points), kinds_);
    for (int s = 0; s < contour.segment_count(); ++s) {
      feet_.push_back(nearest_point(base_, contour.point(contour.node(s))));
    }
  }
  const BezierContour& base() const { return base_; }

  // The contour with its detail as it was, on the base moved: every node keeps its place beside it and turns with it,
  // handles turn with their nodes and stretch as far as their segment does.
  BezierContour on(const BezierContour& moved) const {
    if (feet_.empty()) return moved;
    std::vector<Point> nodes;
    std::vector<Eigen::Matrix2d> turns;
    for (int s = 0; s < original_.segment_count(); ++s) {
      const NearestPoint& foot = feet_[static_cast<std::size_t>(s)];
      const Bezier from = base_.segment(foot.segment);
      const Bezier to = moved.segment(foot.segment);
      turns.push_back(turn(derivative(from, foot.u), derivative(to, foot.u)));
      const Point offset = original_.point(original_.node(s)) - evaluate(from, foot.u);
      nodes.push_back(evaluate(to, foot.u) + turns.back() * offset);
    }
    Points points = original_.points();
    for (int s = 0; s < original_.segment_count(); ++s) {
      const auto first = static_cast<std::size_t>(s);
      const auto last = static_cast<std::size_t>(original_.next(s));
      const Bezier was = original_.segment(s);
      points.row(original_.node(s)) = nodes[first].transpose();
      const Point chord = was.end() - was.start();
      const Point chord_now = nodes[last] - nodes[first];
      const auto handle = [&](const Point& place, const Point& node, std::size_t k) -> Point {
        const Point arm = place - node;
        const Point arm_now = turns[k] * arm;
        const double reach = arm.dot(chord);
        const bool is_along = std::abs(reach) > 0.3 * arm.norm() * chord.norm() && reach * arm_now.dot(chord_now) > 0.0;
        const double stretch =
            is_along ? arm_now.dot(chord_now) / reach : chord_now.norm() / std::max(chord.norm(), 1e-9);
        return nodes[k] + stretch * arm_now;
      };
      if (was.degree == 2) {
        points.row(original_.point_of(s, 1)) =
            0.5 * (handle(was.p[1], was.start(), first) + handle(was.p[1], was.end(), last)).transpose();
      } else if (was.degree == 3) {
        points.row(original_.point_of(s, 1)) = handle(was.p[1], was.start(), first).transpose();
        points.row(original_.point_of(s, 2)) = handle(was.p[2], was.end(), last).transpose();
      }
    }
    for (int s = 0; s < original_.segment_count(); ++s) {
      const int node = original_.node(s);
      if (original_.kind(node) != PointKind::ImpliedNode) continue;
      const int before = original_.previous(s);
      points.row(node) = 0.5 * (points.row(original_.point_of(before, 1)) + points.row(original_.point_of(s, 1)));
    }
    return original_.with_points(std::move(points));
  }

 private:
  // As few lines and cubics as are close to the base, each as long as may be.
  void add_arc(const DetailBase& base, double scale) {
    const Eigen::Index n = base.points().rows();
    const Eigen::Index last = base.is_closed() ? n : n - 1;
    const auto at = [&](Eigen::Index i) -> Point { return base.points().row(i % n).transpose(); };
    const auto tangent = [&](Eigen::Index i) -> Point { return base.tangents().row(i % n).transpose(); };
    const auto place = [&](Eigen::Index i) { return base.places()[i % n] + (i < n ? 0.0 : base.length()); };
    const auto curve = [&](Eigen::Index i, Eigen::Index j) {
      const double third = (place(j) - place(i)) / 3.0;
      return Bezier{{at(i), at(i) + third * tangent(i), at(j) - third * tangent(j), at(j)}, 3};
    };
    const auto is_flat = [&](Eigen::Index i, Eigen::Index j) {
      const Point chord = at(j) - at(i);
      if (chord.norm() < 1e-9) return false;
      const Point across = left_of(chord).normalized();
      for (Eigen::Index k = i + 1; k < j; ++k) {
        if (std::abs(across.dot(at(k) - at(i))) > flat * scale) return false;
      }
      return true;
    };
    const auto is_close = [&](Eigen::Index i, Eigen::Index j) {
      double turn = 0.0;
      const Bezier bezier = curve(i, j);
      for (Eigen::Index k = i; k < j; ++k) {
        turn += std::abs(std::acos(std::clamp(tangent(k).dot(tangent(k + 1)), -1.0, 1.0)));
        const double u = (place(k) - place(i)) / (place(j) - place(i));
        if ((evaluate(bezier, u) - at(k)).norm() > close * scale) return false;
      }
      return turn < most_turn;
    };
    // The farthest step up to which a stretch may go, by steps that double and then halve.
    const auto farthest = [&](Eigen::Index from, const auto& may) {
      Eigen::Index reached = from + 1;
      Eigen::Index step = 1;
      while (reached + step <= last && may(from, reached + step)) {
        reached += step;
        step *= 2;
      }
      for (; step > 0; step /= 2) {
        if (reached + step <= last && may(from, reached + step)) reached += step;
      }
      return reached;
    };
    for (Eigen::Index i = 0; i < last;) {
      const Eigen::Index straight = farthest(i, is_flat);
      const Eigen::Index bent = farthest(i, is_close);
      points_.push_back(at(i));
      kinds_.push_back(PointKind::Node);
      if (place(straight) - place(i) >= std::min(scale, place(bent) - place(i))) {
        i = straight;
        continue;
      }
      const Bezier bezier = curve(i, bent);
      for (const std::size_t k : {std::size_t{1}, std::size_t{2}}) {
        points_.push_back(bezier.p[k]);
        kinds_.push_back(PointKind::Cubic);
      }
      i = bent;
    }
  }

  BezierContour original_;
  std::vector<Point> points_;
  std::vector<PointKind> kinds_;
  BezierContour base_;
  std::vector<NearestPoint> feet_;  // of the nodes, by segment
};

}  // namespace

Weighted weight::apply_above_detail(const Contours& contours, LetterClass letter_class, const WeightModel& model,
                                    double units_per_em, const WeightOptions& options) {
  std::vector<BaseOutline> outlines;
  Contours bases;
  for (const BezierContour& contour : contours) {
    outlines.emplace_back(contour, options.detail_scale);
    bases.push_back(outlines.back().base());
  }
  const std::vector<Crossing> crossings = find_crossings(contours);
  const Ink ink = measure_ink(contours, crossings);
  WeightOptions of_base = options;
  of_base.detail_scale = 0.0;
  // The base may take an amount at which its detail would meet: less of it then.
  for (const double share : {1.0, 0.95, 0.9, 0.8, 0.65, 0.5, 0.3, 0.15}) {
    of_base.amount = share * options.amount;
    Weighted made = apply_weight(bases, letter_class, model, units_per_em, of_base);
    for (std::size_t c = 0; c < contours.size(); ++c) made.contours[c] = outlines[c].on(made.contours[c]);
    const std::vector<Crossing> after = find_crossings(made.contours);
    if (added_crossings(crossings, after) > 0) continue;
    const Ink now = measure_ink(made.contours, after);
    const auto [least, most] = std::minmax({options.amount * options.amounts.x, options.amount * options.amounts.y});
    const bool keeps_sign = (least < 0.0 || now.area >= ink.area) && (most > 0.0 || now.area <= ink.area);
    if (closed_counters(ink, now).empty() && keeps_sign) return made;
  }
  return {contours, 0.0, 0, 0.0, 0.0};
}

}  // namespace fontcore
