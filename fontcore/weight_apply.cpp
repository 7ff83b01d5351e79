#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "fontcore/constraint.h"
#include "fontcore/crossing.h"
#include "fontcore/error.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/solve.h"
#include "fontcore/weight_law.h"

namespace fontcore {

using namespace weight;

namespace {

using Zone = WeightModel::Zone;

// Lengths below are in thousandths of the em.
constexpr double counter_weight = 0.03;
constexpr double room_weight = 0.05;
constexpr double zone_weight = 20.0;
constexpr double smooth_weight = 40.0;
constexpr double gradient_weight = 1.2;
constexpr double place_weight = 0.006;
constexpr double serif_weight = 5.0;
constexpr double terminal_weight = 3.0;
constexpr double least_deviation = 8.0;  // of a law's growth: letters differ
constexpr double rigid_weight = 1e4;
constexpr double handle_weight = 0.02;
constexpr double beyond_allowed = 0.2;  // of an extremum beyond the ends of its segment
constexpr double longest_mitre = 6.0;   // of the offset: further a tip does not go
constexpr double lone_weight = 1e-9;

bool is_near(const std::vector<Zone>& zones, double y) {
  return std::ranges::any_of(zones, [&](const Zone& z) { return std::abs(z.height - y) < near_zone; });
}

// Linear wishes on the displacements of all points of a glyph, in least squares under rows.
class Wishes {
 public:
  // A place of the outline: its displacement is a sum of those of points.
  struct Sum {
    std::array<int, 4> point{};
    std::array<double, 4> weight{};
    int count = 0;
  };
  // A term of a wish: what of a place's displacement counts.
  struct Part {
    Sum place;
    Point factor;
  };

  explicit Wishes(const Contours& contours) : contours_(contours) {
    for (const BezierContour& contour : contours) {
      first_.push_back(points_);
      points_ += static_cast<int>(contour.point_count());
    }
  }
  int share() const { return 2 * points_; }  // the variable beside the points'
  Sum at(int contour, int segment, double u) const {
    const BezierContour& c = contours_[static_cast<std::size_t>(contour)];
    Sum sum;
    const int degree = c.degree(segment);
    sum.weight = bernstein(degree, u);
    sum.count = degree + 1;
    for (int k = 0; k <= degree; ++k) {
      sum.point[static_cast<std::size_t>(k)] = first_[static_cast<std::size_t>(contour)] + c.point_of(segment, k);
    }
    return sum;
  }
  // The sum of the parts, and of `share_factor` times the share, is to be `value`.
  void add(std::initializer_list<Part> parts, double value, double weight, double share_factor = 0.0) {
    if (weight <= 0.0) return;
    const double w = std::sqrt(weight);
    for (const Part& part : parts) {
      for (int k = 0; k < part.place.count; ++k) {
        const auto i = static_cast<std::size_t>(k);
        for (int axis = 0; axis < 2; ++axis) {
          const double entry = w * part.factor[axis] * part.place.weight[i];
          if (entry != 0.0) entries_.emplace_back(rows_, 2 * part.place.point[i] + axis, entry);
        }
      }
    }
    if (share_factor != 0.0) entries_.emplace_back(rows_, share(), w * share_factor);
    values_.push_back(w * value);
    ++rows_;
  }
  // Both coordinates.
  void add(const Sum& to, const Sum& from, const Point& value, double weight) {
    add({{to, Point(1, 0)}, {from, Point(-1, 0)}}, value.x(), weight);
    add({{to, Point(0, 1)}, {from, Point(0, -1)}}, value.y(), weight);
  }

  // The displacement of every point of every contour that meets the wishes best under the rules and further rows.
  std::vector<Points> solve(const OutlineRules& rules, const std::vector<Rows>& further) const {
    RowElimination rows(2 * points_ + 1);
    for (std::size_t k = 0; k < contours_.size(); ++k) {
      for (const Rows& list : {outline_rows(contours_[k], rules), further[k]}) {
        for (Row row : list) {
          for (Row::Term& term : row.terms) term.variable += 2 * first_[k];
          rows.add(std::move(row));
        }
      }
    }
    const RowElimination::Space space = rows.space();
    Eigen::SparseMatrix<double> A(rows_, 2 * points_ + 1);
    A.setFromTriplets(entries_.begin(), entries_.end());
    const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(values_.data(), rows_) - A * space.c;
    const Eigen::SparseMatrix<double> S = A * space.T;
    const Eigen::SparseMatrix<double> K = S.transpose() * S;
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factored(K);
    const Eigen::VectorXd q = factored.solve(S.transpose() * b);
    if (factored.info() != Eigen::Success || !q.allFinite()) {
      throw UnsatisfiableConstraints(text("apply_weight: ", space.T.cols(), " unknowns, ", rows_, " wishes: singular"));
    }
    const Eigen::VectorXd d = space.T * q + space.c;
    std::vector<Points> moves;
    for (std::size_t k = 0; k < contours_.size(); ++k) {
      Points points(contours_[k].point_count(), 2);
      for (Eigen::Index p = 0; p < points.rows(); ++p) points.row(p) = d.segment<2>(2 * (first_[k] + p)).transpose();
      moves.push_back(std::move(points));
    }
    return moves;
  }

 private:
  const Contours& contours_;
  std::vector<int> first_;
  int points_ = 0;
  int rows_ = 0;
  std::vector<Eigen::Triplet<double>> entries_;
  std::vector<double> values_;
};

// What is done about a segment in a loop: its length along itself is held at half, then whole, then it only moves.
enum class Fold : std::uint8_t { Free, Halved, Whole, Rigid };
using Folds = std::vector<std::vector<Fold>>;  // by contour and segment

// A shape, and what the model says of each of its edges.
class Application {
 public:
  Application(const Contours& contours, int letters, const WeightModel& model, double widening)
      : contours_(contours),
        shape_(contours, curve_step, line_step),
        model_(model),
        index_(letters),
        letters_(model.letters[static_cast<std::size_t>(letters)]),
        stem_(letters_.upright.thickness),
        stretch_(widening * letters_.upright.growth / std::max(box_width(shape_), 1.0)) {
    for (const StrokeEdge& edge : shape_.edges()) {
      Growth growth = growth_at(model, place_of(edge, letters));
      growth.value *= crowded(shape_, edge, letters_.room);
      growth_.push_back(growth);
    }
  }

  const StrokeEdges& shape() const { return shape_; }
  // Displacement of every point, linear in the amounts.
  std::vector<Points> moves(const WeightAmounts& amounts, const Folds& folds, const OutlineRules& rules,
                            const std::vector<Rows>& held) const {
    Wishes wishes(contours_);
    std::vector<Wishes::Sum> starts;
    std::vector<Wishes::Sum> middles;
    for (const StrokeEdge& edge : shape_.edges()) {
      starts.push_back(wishes.at(edge.contour, edge.segment, edge.u0));
      middles.push_back(wishes.at(edge.contour, edge.segment, 0.5 * (edge.u0 + edge.u1)));
    }
    ask_strokes(wishes, amounts, middles);
    ask_counters(wishes, amounts, middles);
    ask_zones(wishes, amounts, starts, middles);
    ask_offset(wishes, amounts, starts, folds);
    ask_folds(wishes, amounts, folds);
    ask_handles(wishes);
    return wishes.solve(rules, held);
  }

 private:
  const Growth& growth(int edge) const { return growth_[static_cast<std::size_t>(edge)]; }
  // The amount that an edge takes as part of a stroke of a thickness.
  double taken(const WeightAmounts& amounts, const StrokeEdge& edge, double thickness) const {
    const double by_direction = amounts.y + (amounts.x - amounts.y) * squared(std::cos(edge.direction));
    double amount = by_direction;
    if (amounts.thin) {
      const StrokePlace place{thickness, edge.direction, index_, !edge.is_line};
      const double thin = 1.0 - std::clamp(thickness_share(letters_, place), 0.0, 1.0);
      amount += share_of_contrast(letters_) * thin * (*amounts.thin - by_direction);
    }
    const bool faces_serif = edge.ink.exists() && edge.facing > 0.7 && is_serif(shape_[edge.ink.edge], stem_);
    if (amounts.serif && (faces_serif || is_serif(edge, stem_))) amount = *amounts.serif;
    return amount;
  }
  double taken(const WeightAmounts& amounts, const StrokeEdge& edge) const {
    return taken(amounts, edge, place_of(edge, index_).thickness);
  }
  Wishes::Sum on(const Wishes& wishes, const EdgeHit& hit) const {
    const StrokeEdge& edge = shape_[hit.edge];
    return wishes.at(edge.contour, edge.segment, edge.u0 + std::clamp(hit.at, 0.0, 1.0) * (edge.u1 - edge.u0));
  }

  // Every stroke grows as the law says, the surer the heavier.
  void ask_strokes(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& middles) const {
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      if (!edge.ink.exists() || edge.facing <= 0.5) continue;
      const double weight = 0.1 * edge.length * std::clamp((edge.facing - 0.5) / 0.35, 0.0, 1.0) * 16.0 /
                            (16.0 + squared(std::max(growth(i).deviation, least_deviation))) /
                            (1.0 + std::pow(edge.thickness() / (1.6 * stem_), 10));
      wishes.add({{middles[static_cast<std::size_t>(i)], edge.normal}, {on(wishes, edge.ink), -edge.normal}},
                 taken(amounts, edge) * growth(i).value, weight);
    }
  }

  // Counters between upright strokes grow as the control letters' do; those above each other alike.
  void ask_counters(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& middles) const {
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Wishes::Sum& own = middles[static_cast<std::size_t>(i)];
      if (edge.gap_x.exists()) {
        const int j = edge.gap_x.edge;
        const StrokeEdge& other = shape_[j];
        const double width = edge.gap_x.distance;
        const double law = counter_growth_at(model_, index_, width, (edge.is_line ? 0 : 1) + (other.is_line ? 0 : 1));
        const double grown = std::max(
            law - 0.5 * (growth(i).value + growth(j).value) + letters_.upright.growth + stretch_ * width, -0.8 * width);
        // Strokes that take another amount than widths leave or take the difference.
        const double rest = 0.5 * (growth(i).value * (amounts.x - taken(amounts, edge)) +
                                   growth(j).value * (amounts.x - taken(amounts, other)));
        const double facing = std::pow(std::abs(edge.normal.x() * other.normal.x()), 16);
        const double sign = edge.normal.x() < 0.0 ? -1.0 : 1.0;
        wishes.add({{on(wishes, edge.gap_x), Point(sign, 0)}, {own, Point(-sign, 0)}}, amounts.x * grown + rest,
                   counter_weight * 0.1 * edge.length * facing * stem_like(edge, stem_) * stem_like(other, stem_));
      }
      if (edge.gap_y.exists()) {
        const double sign = edge.normal.y() < 0.0 ? -1.0 : 1.0;
        wishes.add({{on(wishes, edge.gap_y), Point(0, sign)}, {own, Point(0, -sign)}}, 0.0,
                   room_weight * 0.1 * edge.length * std::abs(edge.normal.y()), -edge.gap_y.distance);
      }
    }
    wishes.add({}, 0.0, 1.0, 1.0);
  }

  void ask_zones(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& starts,
                 const std::vector<Wishes::Sum>& middles) const {
    for (const double sign : {1.0, -1.0}) {
      const std::vector<Zone>& zones = sign > 0.0 ? model_.top : model_.bottom;
      const double end = sign > 0.0 ? shape_.box().high.y() : shape_.box().low.y();
      for (int i = 0; i < shape_.size(); ++i) {
        const StrokeEdge& edge = shape_[i];
        const double y = edge.middle.y();
        if (sign * edge.normal.y() > 0.99 && edge.is_line && (is_near(zones, y) || std::abs(y - end) < 2.0)) {
          wishes.add({{middles[static_cast<std::size_t>(i)], Point(0, 1)}}, amounts.y * shift_of(zones, y),
                     zone_weight * std::max(0.1 * edge.length, 0.5));
        }
        const double y0 = edge.start.y();
        const bool is_top = shape_.is_extremum(i, sign) && (is_near(zones, y0) || std::abs(y0 - end) < 2.0);
        if (is_top || std::abs(y0 - end) < 0.5) {
          wishes.add({{starts[static_cast<std::size_t>(i)], Point(0, 1)}}, amounts.y * shift_of(zones, y0),
                     zone_weight);
        }
      }
    }
  }

  // Where nothing else is said, edges go out by half the growth, corners mitred, the whole spread in x and between the
  // zones in y.
  std::vector<Point> offsets(const WeightAmounts& amounts) const {
    std::vector<double> half;
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      // The ends of strokes go out as far as the side of one across them would.
      StrokePlace place = place_of(edge, index_);
      const double c2 = squared(std::cos(edge.direction));
      place.thickness = letters_.upright.thickness * c2 + letters_.level.thickness * (1.0 - c2);
      half.push_back(is_sure(edge) ? taken(amounts, edge) * 0.5 * growth(i).value
                                   : taken(amounts, edge, place.thickness) * 0.5 * growth_at(model_, place).value);
    }
    std::vector<Point> offset;
    int highest = 0;
    int lowest = 0;
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Point& n = edge.normal;
      const Point& before = shape_[edge.previous].normal;
      const double h = half[static_cast<std::size_t>(i)];
      const double h0 = half[static_cast<std::size_t>(edge.previous)];
      const double turn = cross(before, n);
      const Point sum = n + before;
      if (edge.is_corner && std::abs(turn) > 0.3) {
        offset.push_back(Point(h0 * n.y() - h * before.y(), before.x() * h - n.x() * h0) / turn);
      } else if (edge.is_corner && n.dot(before) < 0.0 && sum.norm() > 0.0) {
        // The tip of a spike or a notch: along the middle, no farther than a sharp corner's mitre goes.
        const double reach = std::min(2.0 / sum.norm(), longest_mitre);
        offset.push_back(0.5 * (h + h0) * reach * sum.normalized());
      } else {
        offset.push_back(0.5 * (h * n + h0 * before));
      }
      if (edge.start.y() > shape_[highest].start.y()) highest = i;
      if (edge.start.y() < shape_[lowest].start.y()) lowest = i;
    }
    const double low = shape_.box().low.y();
    const double high = shape_.box().high.y();
    const double top = amounts.y * shift_of(model_.top, high) - offset[static_cast<std::size_t>(highest)].y();
    const double bottom = amounts.y * shift_of(model_.bottom, low) - offset[static_cast<std::size_t>(lowest)].y();
    for (int i = 0; i < shape_.size(); ++i) {
      const Point& p = shape_[i].start;
      const double t = high > low ? (p.y() - low) / (high - low) : 0.5;
      offset[static_cast<std::size_t>(i)] +=
          Point(amounts.x * ((letters_.spread + stretch_) * p.x()), bottom + (top - bottom) * t);
    }
    return offset;
  }
  static bool is_sure(const StrokeEdge& edge) {
    return edge.ink.exists() && edge.thickness() < 200.0 && edge.facing > 0.6;
  }

  void ask_offset(Wishes& wishes, const WeightAmounts& amounts, const std::vector<Wishes::Sum>& starts,
                  const Folds& folds) const {
    const std::vector<Point> offset = offsets(amounts);
    const double along_serifs = amounts.serif.value_or(amounts.x);
    const double share = share_of_contrast(letters_);
    for (int i = 0; i < shape_.size(); ++i) {
      const StrokeEdge& edge = shape_[i];
      const Wishes::Sum& own = starts[static_cast<std::size_t>(i)];
      const Wishes::Sum& next = starts[static_cast<std::size_t>(edge.next)];
      const double length = 0.1 * edge.length;
      const double slope = 1.0 / std::max(length, 0.2);
      const Point& d = offset[static_cast<std::size_t>(i)];
      if (folds[static_cast<std::size_t>(edge.contour)][static_cast<std::size_t>(edge.segment)] == Fold::Rigid) {
        wishes.add(next, own, Point::Zero(), rigid_weight);
        continue;
      }
      double weight = gradient_weight * slope;
      if (share > 0.0 && is_serif(edge, stem_)) {
        weight *= 1.0 - 0.95 * share;
        wishes.add({{next, Point(1, 0)}, {own, Point(-1, 0)}}, along_serifs * letters_.serif * edge.chord.x(),
                   share * serif_weight * slope);
      }
      wishes.add(next, own, offset[static_cast<std::size_t>(edge.next)] - d, weight);
      wishes.add({{own, Point(1, 0)}}, d.x(), place_weight * length + 1e-6);
      wishes.add({{own, Point(0, 1)}}, d.y(), place_weight * length + 1e-6);
      // Curves bend evenly.
      const StrokeEdge& before = shape_[edge.previous];
      if (!edge.is_corner && !(edge.is_line && before.is_line)) {
        const Wishes::Sum& last = starts[static_cast<std::size_t>(edge.previous)];
        const double both = before.length + edge.length;
        const double a = 2.0 * edge.length / both;
        const double b = 2.0 * before.length / both;
        for (const Point& axis : {Point(1, 0), Point(0, 1)}) {
          wishes.add({{last, a * axis}, {own, -2.0 * axis}, {next, b * axis}}, 0.0, smooth_weight);
        }
      }
      // The ends of strokes keep their direction.
      const bool ends_stroke =
          edge.is_line && edge.run < 1.6 * stem_ && !(edge.ink.exists() && edge.thickness() < 1.3 * stem_);
      if (ends_stroke) wishes.add({{next, edge.normal}, {own, -edge.normal}}, 0.0, terminal_weight * slope);
    }
  }

  // Segments that folded over keep half of their length, so that they do not up to twice the step; or more. They take
  // the level strokes' amount, so that the moves are linear in the amounts.
  void ask_folds(Wishes& wishes, const WeightAmounts& amounts, const Folds& folds) const {
    for (std::size_t c = 0; c < contours_.size(); ++c) {
      for (int s = 0; s < contours_[c].segment_count(); ++s) {
        const Fold fold = folds[c][static_cast<std::size_t>(s)];
        if (fold == Fold::Free || fold == Fold::Rigid) continue;
        const Bezier bezier = contours_[c].segment(s);
        const Point chord = bezier.end() - bezier.start();
        const double length = chord.norm();
        if (length == 0.0) continue;
        const int index = static_cast<int>(c);
        wishes.add({{wishes.at(index, s, 1.0), chord / length}, {wishes.at(index, s, 0.0), -chord / length}},
                   fold == Fold::Halved ? amounts.y * -0.5 * length : 0.0, rigid_weight);
      }
    }
  }

  // Handles go along with their curve where its places do not say how.
  void ask_handles(Wishes& wishes) const {
    for (std::size_t c = 0; c < contours_.size(); ++c) {
      const BezierContour& contour = contours_[c];
      for (int s = 0; s < contour.segment_count(); ++s) {
        const int degree = contour.degree(s);
        for (int k = 1; k < degree; ++k) {
          Wishes::Sum sum = wishes.at(static_cast<int>(c), s, 0.0);
          const double t = static_cast<double>(k) / degree;
          sum.weight = {t - 1.0, 0.0, 0.0, 0.0};
          sum.weight[static_cast<std::size_t>(degree)] = -t;
          sum.weight[static_cast<std::size_t>(k)] = 1.0;
          wishes.add({{sum, Point(1, 0)}}, 0.0, handle_weight);
          wishes.add({{sum, Point(0, 1)}}, 0.0, handle_weight);
        }
        // A point alone has nothing else to hold it.
        const Wishes::Sum node = wishes.at(static_cast<int>(c), s, 0.0);
        wishes.add({{node, Point(1, 0)}}, 0.0, lone_weight);
        wishes.add({{node, Point(0, 1)}}, 0.0, lone_weight);
      }
    }
  }

  const Contours& contours_;
  StrokeEdges shape_;
  const WeightModel& model_;
  int index_;
  const Letters& letters_;
  double stem_;
  double stretch_;
  std::vector<Growth> growth_;
};

Contours moved(const Contours& contours, const std::vector<Points>& moves, double factor) {
  Contours result;
  for (std::size_t k = 0; k < contours.size(); ++k) {
    result.push_back(contours[k].with_points(contours[k].points() + factor * moves[k]));
  }
  return result;
}

// Halves the segments that turned back; false if none is new.
bool open_folds(const BezierContour& before, const BezierContour& after, std::vector<Fold>& folds) {
  bool is_new = false;
  for (int s = 0; s < before.segment_count(); ++s) {
    Fold& fold = folds[static_cast<std::size_t>(s)];
    const Bezier was = before.segment(s);
    const Bezier is = after.segment(s);
    if (fold != Fold::Free || (was.end() - was.start()).dot(is.end() - is.start()) >= 0.0) continue;
    fold = Fold::Halved;
    is_new = true;
  }
  return is_new;
}

// Deals with the loop between two places of a contour, the shorter way round; false if nothing is left to do.
bool open_loop(const BezierContour& before, const BezierContour& after, const Crossing& crossing,
               std::vector<Fold>& folds) {
  const int n = before.segment_count();
  const int ahead = (crossing.b.segment - crossing.a.segment + n) % n;
  const int from = ahead <= n - ahead ? crossing.a.segment : crossing.b.segment;
  const int count = std::min(ahead, n - ahead);
  // What lies wholly between the two places; of neighbours, and of a loop within a segment, themselves.
  const int first = count > 1 ? 1 : 0;
  const int last = count > 1 ? count - 1 : count;
  bool is_halved = false;
  for (int k = first; k <= last; ++k) {
    const int s = (from + k) % n;
    Fold& fold = folds[static_cast<std::size_t>(s)];
    const Bezier was = before.segment(s);
    const Bezier is = after.segment(s);
    const Point chord = was.end() - was.start();
    if (fold != Fold::Free || chord.dot(is.end() - is.start()) > 0.5 * chord.squaredNorm()) continue;
    fold = Fold::Halved;
    is_halved = true;
  }
  if (is_halved) return true;
  // The shortest first: long sides are to turn with their strokes.
  int shortest = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int k = first; k <= last; ++k) {
    const int s = (from + k) % n;
    const double size = length(before.segment(s));
    if (folds[static_cast<std::size_t>(s)] == Fold::Rigid || size >= least) continue;
    least = size;
    shortest = s;
  }
  if (shortest < 0) return false;
  Fold& fold = folds[static_cast<std::size_t>(shortest)];
  fold = fold < Fold::Whole ? Fold::Whole : Fold::Rigid;
  return true;
}

// How far a segment goes beyond its ends along an axis.
double beyond_ends(const Bezier& bezier, int axis) {
  const double low = std::min(bezier.start()[axis], bezier.end()[axis]);
  const double high = std::max(bezier.start()[axis], bezier.end()[axis]);
  double most = 0.0;
  for (const double u : extrema(bezier, axis)) {
    const double at = evaluate(bezier, u)[axis];
    most = std::max({most, low - at, at - high});
  }
  return most;
}

// Holds the handles of a segment at their shares of the way between its ends, along an axis.
void hold_handles(const BezierContour& contour, int segment, int axis, Rows& rows) {
  const Bezier bezier = contour.segment(segment);
  const double way = bezier.end()[axis] - bezier.start()[axis];
  const int first = contour.point_of(segment, 0);
  const int last = contour.point_of(segment, bezier.degree);
  for (int k = 1; k < bezier.degree; ++k) {
    const double share =
        way == 0.0 ? 0.5
                   : std::clamp((bezier.p[static_cast<std::size_t>(k)][axis] - bezier.start()[axis]) / way, 0.0, 1.0);
    Row row{RowName::of("handles of segment ", segment, " stay between its ends"), {}, 0.0};
    row.terms.push_back({2 * contour.point_of(segment, k) + axis, 1.0});
    row.terms.push_back({2 * first + axis, share - 1.0});
    row.terms.push_back({2 * last + axis, -share});
    rows.push_back(std::move(row));
  }
}

// Holds what came to reach beyond its ends, where extrema were nodes; false if nothing is new.
class HeldHandles {
 public:
  explicit HeldHandles(const Contours& contours) : rows_(contours.size()), is_held_(contours.size()) {
    for (std::size_t c = 0; c < contours.size(); ++c) {
      is_held_[c].resize(2 * static_cast<std::size_t>(contours[c].segment_count()), false);
    }
  }
  const std::vector<Rows>& rows() const { return rows_; }
  bool hold(const Contours& before, const Contours& after, double allowed) {
    bool is_new = false;
    for (std::size_t c = 0; c < before.size(); ++c) {
      for (int s = 0; s < before[c].segment_count(); ++s) {
        for (int axis = 0; axis < 2; ++axis) {
          const auto k = 2 * static_cast<std::size_t>(s) + static_cast<std::size_t>(axis);
          if (is_held_[c][k]) continue;
          const double beyond = beyond_ends(after[c].segment(s), axis);
          if (beyond <= allowed || beyond_ends(before[c].segment(s), axis) > allowed) continue;
          is_held_[c][k] = true;
          hold_handles(before[c], s, axis, rows_[c]);
          is_new = true;
        }
      }
    }
    return is_new;
  }

 private:
  std::vector<Rows> rows_;
  std::vector<std::vector<bool>> is_held_;  // by 2 * segment + axis
};

}  // namespace

Weighted apply_weight(const std::vector<BezierContour>& contours, LetterClass letter_class, const WeightModel& model,
                      double units_per_em, const WeightOptions& options) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("apply_weight: units_per_em is ", units_per_em));
  const WeightAmounts& amounts = options.amounts;
  double least = std::numeric_limits<double>::infinity();
  double most = -least;
  for (const double of_kind :
       {amounts.x, amounts.y, amounts.thin.value_or(amounts.x), amounts.serif.value_or(amounts.x)}) {
    const double amount = options.amount * of_kind;
    if (!(amount >= -1.0 && amount <= 2.0)) {
      throw InvalidInput(text("apply_weight: the amount ", amount, " is not between -1 and 2"));
    }
    least = std::min(least, amount);
    most = std::max(most, amount);
  }
  if (!(options.detail_scale >= 0.0 && std::isfinite(options.detail_scale))) {
    throw InvalidInput(text("apply_weight: the scale of detail is ", options.detail_scale));
  }
  if (options.detail_scale > 0.0 && (least != 0.0 || most != 0.0)) {
    return apply_above_detail(contours, letter_class, model, units_per_em, options);
  }
  const int letters = letter_class == LetterClass::Capital ? 1 : 0;
  const double unit = units_per_em / 1000.0;
  Weighted result{contours, 0.0, 0, 0.0, 0.0};
  const Contours own = in_thousandths(contours, units_per_em);
  const Application application(own, letters, model, options.widening);
  if ((least == 0.0 && most == 0.0) || application.shape().size() == 0) return result;

  OutlineRules rules;
  rules.frame.italic_angle = options.italic_angle;
  const std::vector<Crossing> crossings = find_crossings(contours);
  const Ink ink = measure_ink(contours, crossings);
  Folds folds;
  for (const BezierContour& contour : contours) folds.emplace_back(contour.segment_count(), Fold::Free);
  HeldHandles held(own);
  std::vector<Points> moves;
  for (bool again = true; again;) {
    moves = application.moves({}, folds, rules, held.rows());
    again = held.hold(own, moved(own, moves, 1.0), beyond_allowed);
    for (Points& points : moves) points *= unit;
    const Contours bold = moved(contours, moves, 1.0);
    for (std::size_t c = 0; c < contours.size(); ++c) again = open_folds(contours[c], bold[c], folds[c]) || again;
    if (again) continue;
    std::vector<Crossing> after = find_crossings(bold);
    if (added_crossings(crossings, after) == 0) break;
    for (const Crossing& crossing : after) {
      if (crossing.a.contour != crossing.b.contour) continue;
      const auto c = static_cast<std::size_t>(crossing.a.contour);
      again = open_loop(contours[c], bold[c], crossing, folds[c]) || again;
    }
  }

  // What one step moves: that of equal amounts, or what all of the amounts move together.
  const bool is_even = amounts.x == amounts.y && !amounts.thin && !amounts.serif;
  const double whole = is_even ? options.amount * amounts.y : 1.0;
  const auto mix = [&] {
    if (is_even) return;
    // Every kind by the level strokes' amount, and what it takes beyond that.
    const auto beyond = [&](const std::optional<double>& amount) {
      return amount ? std::optional(*amount - amounts.y) : std::nullopt;
    };
    const std::vector<Points> rest = application.moves(
        {amounts.x - amounts.y, 0.0, beyond(amounts.thin), beyond(amounts.serif)}, folds, rules, held.rows());
    for (std::size_t c = 0; c < moves.size(); ++c) {
      moves[c] = options.amount * (amounts.y * moves[c] + unit * rest[c]);
    }
  };
  mix();
  const auto is_good = [&](const Contours& weighted) {
    const std::vector<Crossing> after = find_crossings(weighted);
    if (added_crossings(crossings, after) > 0) return false;
    const Ink now = measure_ink(weighted, after);
    return closed_counters(ink, now).empty() && (least < 0.0 || now.area >= ink.area) &&
           (most > 0.0 || now.area <= ink.area);
  };
  // As far as all is well; from there on with what looped held back, so that one tight corner does not stop the rest.
  constexpr int most_stages = 24;
  Contours weighted = contours;
  double done = 0.0;
  for (int stage = 0; stage < most_stages; ++stage) {
    Contours all = moved(weighted, moves, (1.0 - done) * whole);
    if (is_good(all)) {
      weighted = std::move(all);
      done = 1.0;
      break;
    }
    // The largest share that is good, by halving.
    double low = 0.0;
    double high = 1.0;
    Contours best = weighted;
    for (int k = 0; k < 10; ++k) {
      const double share = 0.5 * (low + high);
      Contours trial = moved(weighted, moves, share * (1.0 - done) * whole);
      if (is_good(trial)) {
        low = share;
        best = std::move(trial);
      } else {
        high = share;
        all = std::move(trial);
      }
    }
    weighted = std::move(best);
    done += low * (1.0 - done);
    bool is_held = false;
    for (const Crossing& crossing : find_crossings(all)) {
      if (crossing.a.contour != crossing.b.contour) continue;
      const auto c = static_cast<std::size_t>(crossing.a.contour);
      is_held = open_loop(contours[c], all[c], crossing, folds[c]) || is_held;
    }
    if (!is_held) break;
    moves = application.moves({}, folds, rules, held.rows());
    for (Points& points : moves) points *= unit;
    mix();
  }
  const double amount = done * options.amount;
  result.contours = std::move(weighted);
  result.amount = amount;
  for (const std::vector<Fold>& list : folds) {
    result.held_segments +=
        static_cast<int>(list.size() - static_cast<std::size_t>(std::ranges::count(list, Fold::Free)));
  }
  const Letters& own_letters = model.letters[static_cast<std::size_t>(letters)];
  result.left_side = amount * amounts.x * unit * own_letters.left_side;
  result.right_side = amount * amounts.x * unit * own_letters.right_side;
  return result;
}

StemWidths measure_stems(std::span<const Contours> letters, double units_per_em) {
  if (!(units_per_em > 0.0)) throw InvalidInput(text("measure_stems: units_per_em is ", units_per_em));
  std::vector<Weighed> upright;
  std::vector<Weighed> level;
  for (const Contours& letter : letters) {
    const StrokeEdges shape(in_thousandths(letter, units_per_em), curve_step, line_step);
    const double most = 1.5 * shape.stem(usual_stem);
    for (const StrokeEdge& edge : shape.edges()) {
      if (!is_stroke(edge) || edge.thickness() >= most) continue;
      // Straight strokes say what stems are; round ones count where there are few.
      const double weight = edge.length * (edge.is_line ? 1.0 : 0.1);
      if (edge.direction < 0.25) upright.push_back({edge.thickness(), weight});
      if (edge.direction > 1.25) level.push_back({edge.thickness(), edge.length});
    }
  }
  const auto width = [&](const std::vector<Weighed>& list) {
    return list.empty() ? std::nullopt : std::optional(median(list) * units_per_em / 1000.0);
  };
  return {width(upright), width(level)};
}

WeightAmounts amounts_for_stems(std::span<const Contours> letters, LetterClass letter_class, const WeightModel& model,
                                double units_per_em, const StemWidths& wished) {
  if (!wished.upright && !wished.level) throw InvalidInput("amounts_for_stems: no width is wished for");
  const StemWidths now = measure_stems(letters, units_per_em);
  const auto made_at = [&](const WeightAmounts& amounts) {
    std::vector<Contours> made;
    for (const Contours& letter : letters) {
      made.push_back(apply_weight(letter, letter_class, model, units_per_em, {.amounts = amounts}).contours);
    }
    return measure_stems(made, units_per_em);
  };
  const StemWidths whole = made_at({});
  // Widths grow evenly with their amounts: the whole step says how fast; a second look takes what medians leave.
  const auto amount_of = [&](const char* kind, const std::optional<double>& wish, const std::optional<double>& from,
                             const std::optional<double>& to, double start, double at) {
    if (!from || !to || *from == *to) {
      throw InvalidInput(text("amounts_for_stems: the model does not change ", kind, " strokes of these letters"));
    }
    const double amount = at + (*wish - start) / (*to - *from);
    if (!(amount >= -1.0 && amount <= 2.0)) {
      throw InvalidInput(text("amounts_for_stems: ", kind, " strokes of ", *wish, " from ", *from,
                              " ask for the amount ", amount, ", which is not between -1 and 2"));
    }
    return amount;
  };
  WeightAmounts amounts{0.0, 0.0, {}, {}};
  StemWidths reached = now;
  for (int look = 0; look < 2; ++look) {
    if (wished.upright) {
      amounts.x = amount_of("upright", wished.upright, now.upright, whole.upright, *reached.upright, amounts.x);
    }
    if (wished.level) amounts.y = amount_of("level", wished.level, now.level, whole.level, *reached.level, amounts.y);
    if (!wished.upright) amounts.x = amounts.y;
    if (!wished.level) amounts.y = amounts.x;
    reached = made_at(amounts);
  }
  return amounts;
}

}  // namespace fontcore
