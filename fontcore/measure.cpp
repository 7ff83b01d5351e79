#include "fontcore/measure.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fontcore/error.h"

namespace fontcore {

namespace {

Bezier shifted(Bezier bezier, const Point& origin) {
  for (auto& p : bezier.p) p -= origin;
  return bezier;
}

// Nodes and weights of the five-point Gauss-Legendre rule on [0, 1].
constexpr std::array<double, 5> gauss_node = {0.046910077030668004, 0.23076534494715845, 0.5, 0.76923465505284155,
                                              0.95308992296933200};
constexpr std::array<double, 5> gauss_weight = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                                0.23931433524968324, 0.11846344252809454};

double length_between(const Bezier& bezier, double u0, double u1) {
  double sum = 0.0;
  for (std::size_t k = 0; k < gauss_node.size(); ++k) {
    sum += gauss_weight[k] * derivative(bezier, u0 + gauss_node[k] * (u1 - u0)).norm();
  }
  return sum * (u1 - u0);
}

double length_within(const Bezier& bezier, double u0, double u1, double whole, int depth) {
  const double middle = 0.5 * (u0 + u1);
  const double a = length_between(bezier, u0, middle);
  const double b = length_between(bezier, middle, u1);
  if (depth == 0 || std::abs(a + b - whole) <= 1e-11 * (a + b)) return a + b;
  return length_within(bezier, u0, middle, a, depth - 1) + length_within(bezier, middle, u1, b, depth - 1);
}

}  // namespace

std::span<const AreaTerm> area_terms(int degree) {
  static constexpr AreaTerm line[] = {{0, 1, 1.0 / 2}};
  static constexpr AreaTerm quadratic[] = {{0, 1, 1.0 / 3}, {1, 2, 1.0 / 3}, {0, 2, 1.0 / 6}};
  static constexpr AreaTerm cubic[] = {{0, 1, 0.3},  {0, 2, 0.15}, {0, 3, 0.05},
                                       {1, 2, 0.15}, {1, 3, 0.15}, {2, 3, 0.3}};
  switch (degree) {
    case 1:
      return line;
    case 2:
      return quadratic;
    default:
      return cubic;
  }
}

double signed_area(const Bezier& bezier) {
  double area = 0.0;
  for (const auto& [i, j, weight] : area_terms(bezier.degree)) area += weight * cross(bezier.p[i], bezier.p[j]);
  return area;
}

double signed_area(const BezierContour& contour) {
  const Point origin = contour.point(0);
  double area = 0.0;
  for (int s = 0; s < contour.segment_count(); ++s) area += signed_area(shifted(contour.segment(s), origin));
  return area;
}

bool has_inside(const BezierContour& contour) { return contour.point_count() >= 3 && signed_area(contour) != 0.0; }

double signed_area(const std::vector<BezierContour>& contours) {
  double area = 0.0;
  for (const auto& contour : contours) area += signed_area(contour);
  return area;
}

Moments& Moments::operator+=(const Moments& other) {
  area += other.area;
  first += other.first;
  second += other.second;
  return *this;
}

Moments Moments::about(const Point& o) const {
  Moments shifted = *this;
  shifted.first -= area * o;
  shifted.second += Eigen::Vector3d(-2.0 * o.x() * first.x() + o.x() * o.x() * area,
                                    -o.x() * first.y() - o.y() * first.x() + o.x() * o.y() * area,
                                    -2.0 * o.y() * first.y() + o.y() * o.y() * area);
  return shifted;
}

namespace {

/// Nodes and weights on [0, 1]; n of them integrate polynomials of degree 2n - 1 exactly. The second moments of a
/// segment of degree d are one of degree 4d - 1.
struct GaussRule {
  std::span<const double> node;
  std::span<const double> weight;
};

GaussRule moments_rule(int degree) {
  static constexpr std::array node2{0.21132486540518712, 0.78867513459481288};
  static constexpr std::array weight2{0.5, 0.5};
  static constexpr std::array node4{0.069431844202973714, 0.33000947820757187, 0.66999052179242813,
                                    0.93056815579702629};
  static constexpr std::array weight4{0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                      0.17392742256872693};
  static constexpr std::array node6{0.033765242898423975, 0.16939530676686776, 0.38069040695840156,
                                    0.61930959304159844,  0.83060469323313224, 0.96623475710157601};
  static constexpr std::array weight6{0.085662246189585178, 0.18038078652406930, 0.23395696728634552,
                                      0.23395696728634552,  0.18038078652406930, 0.085662246189585178};
  switch (degree) {
    case 1:
      return {node2, weight2};
    case 2:
      return {node4, weight4};
    default:
      return {node6, weight6};
  }
}

}  // namespace

Moments moments(const BezierContour& contour) {
  const Point origin = contour.point(0);
  Moments sum;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = shifted(contour.segment(s), origin);
    const GaussRule rule = moments_rule(bezier.degree);
    for (std::size_t k = 0; k < rule.node.size(); ++k) {
      const Point p = evaluate(bezier, rule.node[k]);
      const double sweep = rule.weight[k] * cross(p, derivative(bezier, rule.node[k]));
      sum.first += sweep / 3.0 * p;
      sum.second += sweep / 4.0 * Eigen::Vector3d(p.x() * p.x(), p.x() * p.y(), p.y() * p.y());
    }
    sum.area += signed_area(bezier);
  }
  return sum.about(-origin);
}

Points area_gradient(const BezierContour& contour) {
  const Point origin = contour.point(0);
  Points gradient = Points::Zero(contour.point_count(), 2);
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = shifted(contour.segment(s), origin);
    for (const auto& [i, j, weight] : area_terms(bezier.degree)) {
      gradient.row(contour.point_of(s, static_cast<int>(i))) +=
          weight * Eigen::RowVector2d(bezier.p[j].y(), -bezier.p[j].x());
      gradient.row(contour.point_of(s, static_cast<int>(j))) +=
          weight * Eigen::RowVector2d(-bezier.p[i].y(), bezier.p[i].x());
    }
  }
  return gradient;
}

double limit_area(const Points& control_points) {
  const Eigen::Index n = control_points.rows();
  const Point origin = control_points.row(0);
  double twice = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto y = [&](Eigen::Index k) { return control_points((k + n) % n, 1) - origin.y(); };
    const double my = 5.0 / 6.0 * (y(i + 1) - y(i - 1 + n)) + 1.0 / 12.0 * (y(i + 2) - y(i - 2 + n));
    twice += (control_points(i, 0) - origin.x()) * my;
  }
  return 0.5 * twice;
}

double length(const Bezier& bezier) {
  if (bezier.degree == 1) return (bezier.p[1] - bezier.p[0]).norm();
  return length_within(bezier, 0.0, 1.0, length_between(bezier, 0.0, 1.0), 12);
}

double length(const BezierContour& contour) {
  double sum = 0.0;
  for (int s = 0; s < contour.segment_count(); ++s) sum += length(contour.segment(s));
  return sum;
}

Points length_gradient(const BezierContour& contour) {
  // Gauss-Legendre on [0, 1].
  constexpr std::array<double, 8> node = {0.01985507175123188, 0.10166676129318664, 0.23723379504183550,
                                          0.40828267875217510, 0.59171732124782490, 0.76276620495816450,
                                          0.89833323870681336, 0.98014492824876812};
  constexpr std::array<double, 8> weight = {0.05061426814518813, 0.11119051722668724, 0.15685332293894364,
                                            0.18134189168918100, 0.18134189168918100, 0.15685332293894364,
                                            0.11119051722668724, 0.05061426814518813};
  Points gradient = Points::Zero(contour.point_count(), 2);
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier segment = contour.segment(s);
    for (std::size_t g = 0; g < node.size(); ++g) {
      const Point along = derivative(segment, node[g]);
      if (along == Point::Zero()) continue;
      // The derivative is degree times the Bernstein sum of the control points' differences.
      const auto lower = segment.degree == 1 ? std::array{1.0, 0.0, 0.0, 0.0} : bernstein(segment.degree - 1, node[g]);
      for (int k = 0; k < segment.degree; ++k) {
        const Eigen::RowVector2d share =
            weight[g] * segment.degree * lower[static_cast<std::size_t>(k)] * along.normalized().transpose();
        gradient.row(contour.point_of(s, k)) -= share;
        gradient.row(contour.point_of(s, k + 1)) += share;
      }
    }
  }
  return gradient;
}

void Box::add(const Point& point) {
  low = low.cwiseMin(point);
  high = high.cwiseMax(point);
}

void Box::add(const Box& box) {
  low = low.cwiseMin(box.low);
  high = high.cwiseMax(box.high);
}

bool overlap(const Box& a, const Box& b) {
  return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

Box box_around(const Points& points, double margin) {
  Box box;
  for (Eigen::Index i = 0; i < points.rows(); ++i) box.add(Point(points.row(i)));
  box.low.array() -= margin;
  box.high.array() += margin;
  return box;
}

Box control_box(const Bezier& bezier) {
  Box box;
  for (int k = 0; k <= bezier.degree; ++k) box.add(bezier.p[static_cast<std::size_t>(k)]);
  return box;
}

Box control_box(const BezierContour& contour) {
  Box box;
  for (int i = 0; i < contour.point_count(); ++i) box.add(contour.point(i));
  return box;
}

Box control_box(const std::vector<BezierContour>& contours) {
  Box box;
  for (const BezierContour& contour : contours) box.add(control_box(contour));
  return box;
}

Box tight_box(const Bezier& bezier) {
  Box box;
  box.add(bezier.start());
  box.add(bezier.end());
  for (int axis = 0; axis < 2; ++axis) {
    for (const double u : extrema(bezier, axis)) box.add(evaluate(bezier, u));
  }
  return box;
}

Box tight_box(const BezierContour& contour) {
  Box box;
  for (int s = 0; s < contour.segment_count(); ++s) box.add(tight_box(contour.segment(s)));
  return box;
}

Box tight_box(const std::vector<BezierContour>& contours) {
  Box box;
  for (const BezierContour& contour : contours) box.add(tight_box(contour));
  return box;
}

std::vector<double> extrema(const Bezier& bezier, int axis) {
  std::vector<double> roots;
  const auto keep = [&](double u) {
    if (u > 0.0 && u < 1.0) roots.push_back(u);
  };
  const auto p = [&](std::size_t k) { return bezier.p[k][axis]; };
  if (bezier.degree == 2) {
    const double a = p(1) - p(0);
    const double b = p(2) - p(1);
    if (a != b) keep(a / (a - b));
  } else if (bezier.degree == 3) {
    // a (1-u)^2 + 2 b u (1-u) + c u^2 = 0, by the root formula that does not cancel.
    const double a = p(1) - p(0);
    const double b = p(2) - p(1);
    const double c = p(3) - p(2);
    const double quadratic = a - 2.0 * b + c;
    const double half_linear = b - a;
    const double discriminant = half_linear * half_linear - quadratic * a;
    if (discriminant >= 0.0) {
      const double q = -(half_linear + std::copysign(std::sqrt(discriminant), half_linear));
      if (quadratic != 0.0) keep(q / quadratic);
      if (q != 0.0) keep(a / q);
    }
  }
  std::sort(roots.begin(), roots.end());
  return roots;
}

std::vector<double> turning_angles(const BezierContour& contour) {
  const int n = contour.segment_count();
  std::vector<double> angles(static_cast<std::size_t>(n), 0.0);
  std::vector<int> solid;  // segments that have a direction
  for (int s = 0; s < n; ++s) {
    if (!is_degenerate(contour.segment(s))) solid.push_back(s);
  }
  for (std::size_t k = 0; k < solid.size(); ++k) {
    const int before = solid[(k + solid.size() - 1) % solid.size()];
    const Point a = end_tangent(contour.segment(before));
    const Point b = start_tangent(contour.segment(solid[k]));
    angles[static_cast<std::size_t>(solid[k])] = angle(a, b);
  }
  return angles;
}

ArcLength::ArcLength(const Bezier& bezier) : bezier_(bezier) {
  if (bezier.degree == 1) {
    s_[1] = (bezier.p[1] - bezier.p[0]).norm();
    return;
  }
  intervals_ = most_intervals;
  for (std::size_t k = 0; k < intervals_; ++k) {
    const double u0 = static_cast<double>(k) / most_intervals;
    const double u1 = static_cast<double>(k + 1) / most_intervals;
    s_[k + 1] = s_[k] + length_within(bezier, u0, u1, length_between(bezier, u0, u1), 6);
    speed_[k] = derivative(bezier, u0).norm();
  }
  speed_[intervals_] = derivative(bezier, 1.0).norm();
}

double ArcLength::at(double u) const {
  if (u >= 1.0) return length();
  const auto intervals = static_cast<double>(intervals_);
  const auto k = static_cast<std::size_t>(std::clamp(std::floor(u * intervals), 0.0, intervals - 1.0));
  const double u0 = static_cast<double>(k) / intervals;
  return bezier_.degree == 1 ? u * length() : s_[k] + length_between(bezier_, u0, u);
}

double ArcLength::inverse(double s) const {
  if (s <= 0.0) return 0.0;
  if (s >= length()) return 1.0;
  if (bezier_.degree == 1) return s / length();
  const auto* const above = std::upper_bound(s_.begin(), s_.begin() + intervals_ + 1, s);
  const auto k = static_cast<std::size_t>(above - s_.begin()) - 1;
  const auto intervals = static_cast<double>(intervals_);
  const double within = s_[k + 1] - s_[k];
  const double start = static_cast<double>(k) / intervals;
  double low = start;
  double high = static_cast<double>(k + 1) / intervals;
  const double share = (s - s_[k]) / within;
  double at = share;  // of the interval
  const bool is_even = std::min(speed_[k], speed_[k + 1]) > 0.25 * intervals * within;
  if (is_even) {  // the cubic with the slopes of both ends
    const double rest = 1.0 - share;
    const double slope_low = intervals * within / speed_[k];
    const double slope_high = intervals * within / speed_[k + 1];
    at = share * share * (3.0 - 2.0 * share) + share * rest * (rest * slope_low - share * slope_high);
  }
  double u = std::clamp(start + at / intervals, low, high);
  for (int round = 0; round < 40; ++round) {  // Newton, kept inside a shrinking bracket where the speed vanishes
    const double error = s_[k] + length_between(bezier_, start, u) - s;
    if (std::abs(error) <= 1e-13 * length()) break;
    (error > 0.0 ? high : low) = u;
    const double speed = derivative(bezier_, u).norm();
    const double next = speed > 0.0 ? u - error / speed : low;
    const bool is_within = next > low && next < high;
    u = is_within ? next : 0.5 * (low + high);
    // A step leaves about the square of what was off: so little that nobody need look.
    if (is_within && is_even && std::abs(error) <= 1e-7 * within) break;
  }
  return u;
}

namespace {

double squared_distance_to_segment(const Point& p, const Point& a, const Point& b) {
  const Point ab = b - a;
  const double size = ab.squaredNorm();
  const double u = size > 0.0 ? std::clamp((p - a).dot(ab) / size, 0.0, 1.0) : 0.0;
  return (p - a - u * ab).squaredNorm();
}

// The segments of a closed polyline, filed by the cells of a square grid that their boxes touch.
class SegmentGrid {
 public:
  explicit SegmentGrid(const Points& polyline) : polyline_(polyline) {
    for (Eigen::Index i = 0; i < polyline.rows(); ++i) box_.add(Point(polyline.row(i)));
    const Point size = box_.high - box_.low;
    // About four segments a side of a cell: a near point then finds its nearest in its own cell.
    const double across = std::clamp(static_cast<double>(polyline.rows()) / 16.0, 1.0, 256.0);
    cell_ = std::max(size.maxCoeff() / across, 1e-9);
    columns_ = static_cast<int>(size.x() / cell_) + 1;
    rows_ = static_cast<int>(size.y() / cell_) + 1;
    first_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
    for_each_cell([&](std::size_t cell, int) { ++first_[cell + 1]; });
    for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
    segment_.resize(static_cast<std::size_t>(first_.back()));
    std::vector<int> next = first_;
    for_each_cell([&](std::size_t cell, int segment) { segment_[static_cast<std::size_t>(next[cell]++)] = segment; });
  }

  struct Nearest {
    int segment;
    double squared_distance;
  };
  /// What of the polyline is nearest to a point: rings of cells outward until no nearer one can come.
  Nearest nearest(const Point& p) const {
    const int cx = column(p.x());
    const int cy = row(p.y());
    const Point corner = box_.low + cell_ * Point(cx, cy);
    const double margin =
        std::min((p - corner).minCoeff(), (corner - p).minCoeff() + cell_);  // to the border of the cell
    Nearest best{0, std::numeric_limits<double>::infinity()};
    for (int ring = 0; ring <= columns_ + rows_; ++ring) {
      // A segment not yet seen has no point in the cells of the smaller rings.
      const double reached = ring == 0 ? 0.0 : (ring - 1) * cell_ + margin;
      if (reached > 0.0 && best.squared_distance <= reached * reached) break;
      for (int y = cy - ring; y <= cy + ring; ++y) {
        if (y < 0 || y >= rows_) continue;
        const bool edge = y == cy - ring || y == cy + ring;
        for (int x = cx - ring; x <= cx + ring; x += edge || ring == 0 ? 1 : 2 * ring) {
          if (x < 0 || x >= columns_) continue;
          const auto cell = static_cast<std::size_t>(y * columns_ + x);
          for (int k = first_[cell]; k < first_[cell + 1]; ++k) {
            const int segment = segment_[static_cast<std::size_t>(k)];
            const double here = squared_distance(p, segment);
            if (here < best.squared_distance) best = {segment, here};
          }
        }
      }
    }
    return best;
  }
  double squared_distance(const Point& p, int segment) const {
    const auto [a, b] = ends(segment);
    return squared_distance_to_segment(p, a, b);
  }

 private:
  template <typename Visit>
  void for_each_cell(const Visit& visit) const {
    for (int i = 0; i < static_cast<int>(polyline_.rows()); ++i) {
      const auto [a, b] = ends(i);
      const auto [x0, x1] = std::minmax({column(a.x()), column(b.x())});
      const auto [y0, y1] = std::minmax({row(a.y()), row(b.y())});
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) visit(static_cast<std::size_t>(y * columns_ + x), i);
      }
    }
  }
  std::pair<Point, Point> ends(int i) const {
    return {polyline_.row(i), polyline_.row(i + 1 == polyline_.rows() ? 0 : i + 1)};
  }
  int column(double x) const { return std::clamp(static_cast<int>((x - box_.low.x()) / cell_), 0, columns_ - 1); }
  int row(double y) const { return std::clamp(static_cast<int>((y - box_.low.y()) / cell_), 0, rows_ - 1); }
  const Points& polyline_;
  Box box_;
  double cell_ = 1.0;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<int> first_;    // per cell, where its segments begin
  std::vector<int> segment_;  // segments by cell
};

Farthest one_sided_distance(const Points& from, const Points& to, double give_up_above) {
  const SegmentGrid grid(to);
  const int n = static_cast<int>(to.rows());
  double worst = 0.0;
  Eigen::Index where = 0;  // of points as far off the first
  SegmentGrid::Nearest near{0, 0.0};
  const auto look = [&](Eigen::Index i) {
    const Point p = from.row(i).transpose();
    const auto is_no_farther = [&](double squared) { return squared < worst || (squared == worst && i >= where); };
    // One that is no farther off than the worst needs no search: mostly, where the point before was nearest says so.
    constexpr int beside = 3;
    for (int k = 0; k <= 2 * beside; ++k) {
      int segment = near.segment + (k % 2 == 0 ? k / 2 : -(k + 1) / 2);
      if (segment < 0 || segment >= n) segment = (segment % n + n) % n;
      if (is_no_farther(grid.squared_distance(p, segment))) {
        near.segment = segment;
        return;
      }
    }
    near = grid.nearest(p);
    if (is_no_farther(near.squared_distance)) return;
    worst = near.squared_distance;
    where = i;
  };
  // A few all round first: how far it is about.
  constexpr Eigen::Index stride = 16;
  const bool sees_all = give_up_above == std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; sees_all && i < from.rows(); i += stride) look(i);
  for (Eigen::Index i = 0; i < from.rows() && !(std::sqrt(worst) > give_up_above); ++i) look(i);
  return {std::sqrt(worst), from.row(where).transpose()};
}

// Vertices on the contour, so many that the polyline is within the sagitta of it.
Points fine_polyline(const BezierContour& contour, double sagitta) {
  constexpr int fewest = 16;  // of a curve: between two vertices the distance to another curve hardly changes its trend
  constexpr int most = 1024;
  std::vector<Point> points;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier b = contour.segment(s);
    double bend = 0.0;
    for (std::size_t k = 2; k <= static_cast<std::size_t>(b.degree); ++k)
      bend = std::max(bend, (b.p[k] - 2.0 * b.p[k - 1] + b.p[k - 2]).norm());
    // |b''| <= degree (degree - 1) bend, and a chord over h is within h^2 / 8 of that.
    const double pieces = std::ceil(std::sqrt(b.degree * (b.degree - 1) * bend / (8.0 * sagitta)));
    const int count = b.degree == 1 ? 1 : static_cast<int>(std::clamp<double>(pieces, fewest, most));
    for (int i = 0; i < count; ++i) points.push_back(evaluate(b, static_cast<double>(i) / count));
  }
  Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return rows;
}

}  // namespace

double two_sided_distance(const Points& a, const Points& b, double give_up_above) {
  if (a.rows() == 0 || b.rows() == 0) throw InvalidInput("two_sided_distance: a polyline without points");
  const double there = one_sided_distance(a, b, give_up_above).distance;
  return there > give_up_above ? there : std::max(there, one_sided_distance(b, a, give_up_above).distance);
}

Farthest farthest(const BezierContour& a, const BezierContour& b, double accuracy) {
  if (!(accuracy > 0.0)) throw InvalidInput(text("farthest: the accuracy is ", accuracy));
  const Points p = fine_polyline(a, accuracy);
  const Points q = fine_polyline(b, accuracy);
  const Farthest there = one_sided_distance(p, q, std::numeric_limits<double>::infinity());
  const Farthest back = one_sided_distance(q, p, std::numeric_limits<double>::infinity());
  return there.distance >= back.distance ? there : back;
}

namespace {

// Distance of a place from a segment, by Gauss-Newton from u; and whether it led over an end: -1 the start, 1 the end.
struct SegmentDistance {
  double distance;
  int beyond;
};
SegmentDistance distance_near(const Bezier& bezier, double u, const Point& place) {
  int beyond = 0;
  const int steps = bezier.degree == 1 ? 1 : 3;
  for (int step = 0; step < steps; ++step) {
    const Point along = derivative(bezier, u);
    const double square = along.squaredNorm();
    if (square == 0.0) break;
    const double next = u + along.dot(place - evaluate(bezier, u)) / square;
    beyond = next < 0.0 ? -1 : next > 1.0 ? 1 : 0;
    u = std::clamp(next, 0.0, 1.0);
  }
  return {(place - evaluate(bezier, u)).norm(), beyond};
}

double one_sided_distance(const BezierContour& from, const BezierContour& to) {
  constexpr int pieces_of_curve = 16;
  double worst = 0.0;
  for (int s = 0; s < from.segment_count(); ++s) {
    const Bezier own = from.segment(s);
    const Bezier other = to.segment(s);
    if (std::equal(own.p.begin(), own.p.begin() + own.degree + 1, other.p.begin())) continue;
    const int pieces = own.degree == 1 ? 1 : pieces_of_curve;
    for (int k = 0; k <= pieces; ++k) {
      const double u = static_cast<double>(k) / pieces;
      const Point place = evaluate(own, u);
      if ((place - evaluate(other, u)).norm() <= worst) continue;  // the nearest place is no farther than this one
      auto [distance, beyond] = distance_near(other, u, place);
      if (distance > worst && beyond < 0)
        distance = std::min(distance, distance_near(to.segment(to.previous(s)), 1.0, place).distance);
      if (distance > worst && beyond > 0)
        distance = std::min(distance, distance_near(to.segment(to.next(s)), 0.0, place).distance);
      worst = std::max(worst, distance);
    }
  }
  return worst;
}

}  // namespace

double two_sided_distance(const BezierContour& a, const BezierContour& b) {
  if (!has_same_structure(a, b)) throw InvalidInput("two_sided_distance: the contours differ in structure");
  return std::max(one_sided_distance(a, b), one_sided_distance(b, a));
}

NearestPoint nearest_point(const BezierContour& contour, const Point& place) {
  NearestPoint best{.distance = std::numeric_limits<double>::infinity()};
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = contour.segment(s);
    const int samples = bezier.degree == 1 ? 1 : 32;
    const auto distance = [&](double u) { return (evaluate(bezier, u) - place).norm(); };
    for (int k = 0; k < samples; ++k) {
      // The minimum between two samples, by golden section; the ends are tried as they are.
      double low = static_cast<double>(k) / samples;
      double high = static_cast<double>(k + 1) / samples;
      for (const double u : {low, high}) {
        if (distance(u) < best.distance) best = {s, u, distance(u)};
      }
      if (bezier.degree == 1) {
        const Point along = bezier.p[1] - bezier.p[0];
        const double size = along.squaredNorm();
        const double u = size > 0.0 ? std::clamp((place - bezier.p[0]).dot(along) / size, 0.0, 1.0) : 0.0;
        if (distance(u) < best.distance) best = {s, u, distance(u)};
        continue;
      }
      const double chord = (evaluate(bezier, high) - evaluate(bezier, low)).norm();
      if (std::min(distance(low), distance(high)) - chord > best.distance) continue;
      constexpr double ratio = 1.0 / std::numbers::phi;
      for (int round = 0; round < 60; ++round) {
        const double a = high - ratio * (high - low);
        const double b = low + ratio * (high - low);
        (distance(a) < distance(b) ? high : low) = distance(a) < distance(b) ? b : a;
      }
      const double u = 0.5 * (low + high);
      if (distance(u) < best.distance) best = {s, u, distance(u)};
    }
  }
  return best;
}

}  // namespace fontcore
