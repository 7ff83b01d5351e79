#include "fontcore/crossing.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "fontcore/error.h"

namespace fontcore {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

// Pairs of pieces undecided at one depth beyond which two segments count as running along each other. Curves of radius
// r at a distance g over a length l need about 3 l / sqrt(8 r g) pairs: this tells a gap of contact_distance apart
// over one em.
constexpr std::size_t undecided_limit = 4096;
// A contact longer than this many contact distances is an overlap: the undecided neighbourhood of a tangency is
// 2 sqrt(2 r margin) long, so this takes curves flatter than a radius of 10^6 units for overlapping.
constexpr double overlap_length = 1000.0;
// Findings of the same two branches this many contact distances apart are one.
constexpr double merging_distance = 10.0;
// Of cutting a curve that turns back, in pairs of pieces: a cusp needs thirty, coordinates beyond all bounds would not
// end.
constexpr long work_of_halving = 100;
// Branches are told apart round a point if their directions differ by this. Radians.
constexpr double least_angle = 1e-4;
constexpr double largest_window = 1.0;  // radius in which branches round a point are looked at, font units
// Error of an orientation in doubles, relative to its two products. J. R. Shewchuk, Adaptive Precision Floating-Point
// Arithmetic and Fast Robust Geometric Predicates, 1997: ccwerrboundA.
constexpr double orientation_error = 3.3306690738754716e-16;
// Numbers worked out in a few steps from coordinates are told apart if they differ by this share of what they are made
// of.
constexpr double distinct = 1e-9;

/// Exact: most signs are certain in doubles, CGAL decides the others.
CGAL::Orientation side(const Point& from, const Point& to, const Point& x) {
  const double left = (to.x() - from.x()) * (x.y() - from.y());
  const double right = (to.y() - from.y()) * (x.x() - from.x());
  const double turn = left - right;
  if (std::abs(turn) > orientation_error * (std::abs(left) + std::abs(right)) + std::numeric_limits<double>::min()) {
    return turn > 0.0 ? CGAL::LEFT_TURN : CGAL::RIGHT_TURN;
  }
  return CGAL::orientation(Kernel::Point_2(from.x(), from.y()), Kernel::Point_2(to.x(), to.y()),
                           Kernel::Point_2(x.x(), x.y()));
}

struct Tolerance {
  double contact;
  double margin;    // distance that counts as apart: far above the rounding of points by subdivision
  double rounding;  // distance that coordinates may have been rounded by
};

/// The part of a segment over [u0, u1].
struct Stretch {
  int contour = 0;
  int segment = 0;
  double u0 = 0.0;
  double u1 = 0.0;
};

struct Box {
  Point low;
  Point high;

  double size() const { return std::max(high.x() - low.x(), high.y() - low.y()); }
};

std::size_t count(const Bezier& curve) { return static_cast<std::size_t>(curve.degree) + 1; }

Box box(const Bezier& curve) {
  Box box{curve.p[0], curve.p[0]};
  for (std::size_t k = 1; k < count(curve); ++k) {
    box.low = box.low.cwiseMin(curve.p[k]);
    box.high = box.high.cwiseMax(curve.p[k]);
  }
  return box;
}

bool apart(const Box& a, const Box& b, double margin) {
  return a.low.x() > b.high.x() + margin || b.low.x() > a.high.x() + margin || a.low.y() > b.high.y() + margin ||
         b.low.y() > a.high.y() + margin;
}

/// A stretch with its own control points and their box.
struct Piece {
  Stretch on;
  Bezier curve;
  Box box;
};

std::array<Piece, 2> halves(const Piece& piece) {
  const auto part = split(piece.curve, 0.5);
  const Stretch& on = piece.on;
  const double middle = 0.5 * (on.u0 + on.u1);
  return {Piece{{on.contour, on.segment, on.u0, middle}, part[0], box(part[0])},
          Piece{{on.contour, on.segment, middle, on.u1}, part[1], box(part[1])}};
}

Bezier reversed(Bezier curve) {
  std::reverse(curve.p.begin(), curve.p.begin() + curve.degree + 1);
  return curve;
}

// Certificates on two pieces ------------------------------------------------------------------------------------------

/// True if every step of the control polygon goes forward along the chord. Then so does the curve, whose derivative is
/// a positive mean of the steps, and it cannot come back to where it was.
bool goes_forward(const Bezier& curve) {
  const Point chord = curve.end() - curve.start();
  if (curve.degree == 1) return chord != Point::Zero();
  constexpr double least_cosine = 1e-6;
  for (std::size_t k = 0; k + 1 < count(curve); ++k) {
    const Point step = curve.p[k + 1] - curve.p[k];
    if (step == Point::Zero()) continue;
    if (step.dot(chord) <= least_cosine * step.norm() * chord.norm()) return false;
  }
  return chord != Point::Zero();
}

/// True if a line parts the control points of the two, and so the curves, with the margin to spare.
///
/// Disjoint hulls of points are parted by a line along an edge of one of them, so every line through two points of one
/// piece is tried, chords first. Its place is chosen in doubles, the parting is proved by exact orientations.
bool apart(const Piece& a, const Piece& b, double margin) {
  if (apart(a.box, b.box, margin)) return true;
  const auto parted_along = [&](const Bezier& own, const Bezier& other, std::size_t i, std::size_t j) {
    const Point along = own.p[j] - own.p[i];
    const Point normal(-along.y(), along.x());
    const auto range = [&](const Bezier& curve) {
      auto [low, high] = std::pair(normal.dot(curve.p[0] - own.p[i]), normal.dot(curve.p[0] - own.p[i]));
      for (std::size_t k = 1; k < count(curve); ++k) {
        const double d = normal.dot(curve.p[k] - own.p[i]);
        low = std::min(low, d);
        high = std::max(high, d);
      }
      return std::pair(low, high);
    };
    const auto [own_low, own_high] = range(own);
    const auto [other_low, other_high] = range(other);
    const double gap = std::max(own_low - other_high, other_low - own_high);
    if (!(gap > 0.0) || gap * gap <= margin * margin * normal.squaredNorm()) return false;
    const bool own_is_left = own_low > other_high;
    const double middle = 0.5 * (own_is_left ? own_low + other_high : own_high + other_low);
    const Point from = own.p[i] + middle / normal.squaredNorm() * normal;
    const Point to = from + along;
    const auto all_on = [&](const Bezier& curve, CGAL::Orientation wanted) {
      for (std::size_t k = 0; k < count(curve); ++k) {
        if (side(from, to, curve.p[k]) != wanted) return false;
      }
      return true;
    };
    const CGAL::Orientation side_of_own = own_is_left ? CGAL::LEFT_TURN : CGAL::RIGHT_TURN;
    return all_on(own, side_of_own) && all_on(other, -side_of_own);
  };
  for (std::size_t span = 3; span > 0; --span) {
    for (std::size_t i = 0; i + span < count(a.curve); ++i) {
      if (parted_along(a.curve, b.curve, i, i + span)) return true;
    }
    for (std::size_t i = 0; i + span < count(b.curve); ++i) {
      if (parted_along(b.curve, a.curve, i, i + span)) return true;
    }
  }
  return false;
}

/// True if the ends of `b` lie beyond opposite edges of the strip along the chord of `a` that holds all of `a`.
bool spans(const Bezier& b, const Bezier& a, double margin) {
  const Point chord = a.end() - a.start();
  const double length = chord.norm();
  if (length == 0.0) return false;
  const Point normal = left_of(chord) / length;
  double low = 0.0;
  double high = 0.0;
  for (std::size_t k = 1; k + 1 < count(a); ++k) {
    const double d = normal.dot(a.p[k] - a.start());
    low = std::min(low, d);
    high = std::max(high, d);
  }
  const Point left = a.start() + (high + margin) * normal;
  const Point right = a.start() + (low - margin) * normal;
  const auto is_left = [&](const Point& x) { return side(left, left + chord, x) == CGAL::LEFT_TURN; };
  const auto is_right = [&](const Point& x) { return side(right, right + chord, x) == CGAL::RIGHT_TURN; };
  return (is_left(b.start()) && is_right(b.end())) || (is_right(b.start()) && is_left(b.end()));
}

/// True if the two must go through each other: in the parallelogram that is common to their strips, one leads from side
/// to opposite side and the other between the other two sides.
bool must_cross(const Bezier& a, const Bezier& b, double margin) { return spans(a, b, margin) && spans(b, a, margin); }

/// True if no step of one control polygon, nor any positive mean of them, is parallel to one of the other. Then the two
/// meet once at most: two common points would give them a common chord, which is such a mean of both.
bool meet_once_at_most(const Bezier& a, const Bezier& b) {
  int sign = 0;
  for (std::size_t i = 0; i + 1 < count(a); ++i) {
    const Point s = a.p[i + 1] - a.p[i];
    if (s == Point::Zero()) continue;
    for (std::size_t j = 0; j + 1 < count(b); ++j) {
      const Point t = b.p[j + 1] - b.p[j];
      if (t == Point::Zero()) continue;
      const double sine = cross(s, t);
      const int here = sine > 0.0 ? 1 : -1;
      if (std::abs(sine) <= 1e-6 * s.norm() * t.norm() || here == -sign) return false;
      sign = here;
    }
  }
  return sign != 0;
}

/// True if a line through the joint, where both begin, parts the two but for the joint.
///
/// Seen from the joint, each piece lies in the cone of its control points. Lines to try are the one across the way from
/// the one end to the other, and those along the edges of the cones; what lies on the line may be there on one side of
/// the joint for the one piece, on the other for the other.
bool have_parted_cones(const Bezier& a, const Bezier& b, double margin) {
  const Point joint = a.start();
  const Point way = b.end() - a.end();
  const Point across = joint + left_of(way);
  const auto all_on = [&](const Bezier& curve, CGAL::Orientation wanted) {
    for (std::size_t k = 1; k < count(curve); ++k) {
      if (side(joint, across, curve.p[k]) != wanted && curve.p[k] != joint) return false;
    }
    return true;
  };
  if (all_on(a, CGAL::LEFT_TURN) && all_on(b, CGAL::RIGHT_TURN)) return true;
  const auto parted_along = [&](const Point& edge, const Bezier& own, const Bezier& other) {
    const Point ray = edge - joint;
    CGAL::Orientation inside = CGAL::COLLINEAR;
    for (std::size_t k = 1; k < count(own); ++k) {
      const CGAL::Orientation at = side(joint, edge, own.p[k]);
      if (at == CGAL::COLLINEAR) {
        if (ray.dot(own.p[k] - joint) < 0.0) return false;
      } else if (at == -inside) {
        return false;
      } else {
        inside = at;
      }
    }
    for (std::size_t k = 1; k < count(other); ++k) {
      const Point x = other.p[k] - joint;
      if (x == Point::Zero()) continue;
      const CGAL::Orientation at = side(joint, edge, other.p[k]);
      if (inside == CGAL::COLLINEAR) inside = -at;
      if (at == inside && at != CGAL::COLLINEAR) return false;
      if (ray.dot(x) > 0.0 && std::abs(cross(ray, x)) <= margin * std::max(ray.norm(), x.norm())) return false;
    }
    return true;
  };
  for (std::size_t k = 1; k < count(a); ++k) {
    if (a.p[k] != joint && parted_along(a.p[k], a, b)) return true;
  }
  for (std::size_t k = 1; k < count(b); ++k) {
    if (b.p[k] != joint && parted_along(b.p[k], b, a)) return true;
  }
  return false;
}

/// What y / x^2 of a curve may be, over a line through its first point: the curvature there, and how it goes on.
struct Bend {
  double low = 0.0;
  double high = 0.0;
  bool is_one_sided = false;  // y is 0 nowhere but at the first point
};

/// Of a curve that from its first point on keeps ahead along the direction; nothing if it does not.
///
/// With y = t^m q(t), x = t^l p(t) and Bernstein coefficients of q and p from the points' own. Points nearer to the
/// line than their rounding lie on it.
std::optional<Bend> bend(const Bezier& curve, const Point& along, double rounding) {
  constexpr std::array<std::array<double, 4>, 4> binomial{{{1, 0, 0, 0}, {1, 1, 0, 0}, {1, 2, 1, 0}, {1, 3, 3, 1}}};
  struct Power {
    std::size_t order = 0;
    double low = 0.0;
    double high = 0.0;
  };
  const auto n = static_cast<std::size_t>(curve.degree);
  const auto power = [&](const Point& direction) {
    std::array<double, 4> x{};
    std::size_t m = n;
    for (std::size_t k = n; k > 0; --k) {
      x[k] = direction.dot(curve.p[k] - curve.p[0]);
      if (std::abs(x[k]) <= rounding) x[k] = 0.0;
      if (x[k] != 0.0) m = k;
    }
    Power factor{m, x[m] * binomial[n][m], x[m] * binomial[n][m]};
    for (std::size_t k = m + 1; k <= n; ++k) {
      const double coefficient = x[k] * binomial[n][k] / binomial[n - m][k - m];
      factor.low = std::min(factor.low, coefficient);
      factor.high = std::max(factor.high, coefficient);
    }
    return factor;
  };
  const Power x = power(along);
  if (!(x.low > 0.0)) return std::nullopt;
  const Power y = power({-along.y(), along.x()});
  Bend bend{y.low / (y.low < 0.0 ? x.low * x.low : x.high * x.high),
            y.high / (y.high > 0.0 ? x.low * x.low : x.high * x.high), y.low > 0.0 || y.high < 0.0};
  // times t^(m - 2 l), t in (0, 1]
  if (y.order > 2 * x.order) {
    bend.low = std::min(bend.low, 0.0);
    bend.high = std::max(bend.high, 0.0);
  } else if (y.order < 2 * x.order) {
    if (bend.low < 0.0) bend.low = -std::numeric_limits<double>::infinity();
    if (bend.high > 0.0) bend.high = std::numeric_limits<double>::infinity();
  }
  return bend;
}

/// True if the two, which begin at one joint and leave it alike, bend away from each other all along.
bool bend_apart(const Bezier& a, const Bezier& b, double rounding) {
  const auto is_below = [](const Bend& x, const Bend& y) {
    if (x.high == 0.0 && y.low == 0.0) return x.is_one_sided || y.is_one_sided;
    return x.high < y.low - distinct * std::max(std::abs(x.high), std::abs(y.low));
  };
  for (const Bezier* leading : {&a, &b}) {
    const Point along = start_tangent(*leading);
    const auto bend_a = bend(a, along, rounding);
    const auto bend_b = bend(b, along, rounding);
    if (bend_a && bend_b && (is_below(*bend_a, *bend_b) || is_below(*bend_b, *bend_a))) return true;
  }
  return false;
}

bool are_same_or_reversed(const Bezier& a, const Bezier& b) {
  if (a.degree != b.degree) return false;
  const auto end = a.p.begin() + a.degree + 1;
  return std::equal(a.p.begin(), end, b.p.begin()) || std::equal(a.p.begin(), end, b.p.rbegin() + (3 - b.degree));
}

// The search in one pair of segments ----------------------------------------------------------------------------------

/// Where two pieces meet, or cannot be told apart.
struct Hit {
  Meeting meeting = Meeting::Contact;
  Stretch a;
  Stretch b;
};

/// Two pieces, and which of their ends are one point that is known: `joint[i][j]` is end i of a (0 its start, 1 its
/// end) and end j of b.
struct Pair {
  Piece a;
  Piece b;
  std::array<std::array<bool, 2>, 2> joint{};

  int joints() const { return joint[0][0] + joint[0][1] + joint[1][0] + joint[1][1]; }
};

/// What a test says of a pair: nothing, that the two do not meet (but at their joint), or how they meet.
struct Verdict {
  bool decided = false;
  std::optional<Hit> hit;
};

Stretch at(const Piece& piece, double t) {
  Stretch place = piece.on;
  place.u0 = place.u1 = piece.on.u0 + t * (piece.on.u1 - piece.on.u0);
  return place;
}

/// The common point of two pieces that meet in one, by Newton from the crossing of the chords.
std::optional<Hit> common_point(const Piece& a, const Piece& b, double margin) {
  double s = 0.5;
  double t = 0.5;
  for (int step = 0; step < 20; ++step) {
    const Point miss = evaluate(b.curve, t) - evaluate(a.curve, s);
    const Point da = derivative(a.curve, s);
    const Point db = derivative(b.curve, t);
    const double area = cross(da, db);
    if (area == 0.0) return std::nullopt;
    const double ds = cross(miss, db) / area;
    const double dt = cross(miss, da) / area;
    s = std::clamp(s + ds, 0.0, 1.0);
    t = std::clamp(t + dt, 0.0, 1.0);
    if (std::abs(ds) + std::abs(dt) < 1e-14) break;
  }
  if ((evaluate(b.curve, t) - evaluate(a.curve, s)).norm() > margin) return std::nullopt;
  return Hit{Meeting::Crossing, at(a, s), at(b, t)};
}

/// Where a point on a line, but for rounding, is on it: by the coordinate in which the line is longer, so that an end
/// is 0 or 1 exactly.
double parameter(const Bezier& line, const Point& x) {
  const Point chord = line.end() - line.start();
  const Eigen::Index axis = std::abs(chord.x()) >= std::abs(chord.y()) ? 0 : 1;
  return std::clamp((x[axis] - line.start()[axis]) / chord[axis], 0.0, 1.0);
}

/// What exact orientations say of two lines: their meeting, or that they meet only at their joint. Nothing is said of
/// lines apart, joined at an angle, or crossing by less than the margin: the general tests decide, so that what is a
/// contact in whole units stays one when the outline is turned and rounded.
Verdict compare_lines(const Pair& pair, double margin) {
  const Piece& a = pair.a;
  const Piece& b = pair.b;
  const auto& p = a.curve.p;
  const auto& q = b.curve.p;
  const std::array on_a{side(p[0], p[1], q[0]), side(p[0], p[1], q[1])};
  const std::array on_b{side(q[0], q[1], p[0]), side(q[0], q[1], p[1])};
  const auto touch = [](Stretch x, Stretch y) { return Verdict{true, Hit{Meeting::Contact, x, y}}; };

  if (on_a[0] == CGAL::COLLINEAR && on_a[1] == CGAL::COLLINEAR) {
    const Eigen::Index axis = std::abs(p[1].x() - p[0].x()) >= std::abs(p[1].y() - p[0].y()) ? 0 : 1;
    const auto is_lower = [&](const Point& x, const Point& y) { return x[axis] < y[axis]; };
    const Point low = std::max(std::min(p[0], p[1], is_lower), std::min(q[0], q[1], is_lower), is_lower);
    const Point high = std::min(std::max(p[0], p[1], is_lower), std::max(q[0], q[1], is_lower), is_lower);
    if (is_lower(high, low)) return {};
    const auto part = [&](const Piece& line) {
      const auto [t0, t1] = std::minmax({parameter(line.curve, low), parameter(line.curve, high)});
      Stretch stretch = line.on;
      stretch.u0 = t0;
      stretch.u1 = t1;
      return stretch;
    };
    if (is_lower(low, high)) return {true, Hit{Meeting::Overlap, part(a), part(b)}};
    if (pair.joints() > 0) return {true, std::nullopt};
    return touch(part(a), part(b));
  }
  if (pair.joints() > 0) return {};
  if (on_a[0] == on_a[1] || on_b[0] == on_b[1]) return {};
  for (std::size_t k = 0; k < 2; ++k) {
    if (on_a[k] == CGAL::COLLINEAR) return touch(at(a, parameter(a.curve, q[k])), at(b, static_cast<double>(k)));
    if (on_b[k] == CGAL::COLLINEAR) return touch(at(a, static_cast<double>(k)), at(b, parameter(b.curve, p[k])));
  }
  if (!must_cross(a.curve, b.curve, margin)) return {};
  const double area = cross(p[1] - p[0], q[1] - q[0]);
  const double s = std::clamp(cross(q[0] - p[0], q[1] - q[0]) / area, 0.0, 1.0);
  const double t = std::clamp(cross(q[0] - p[0], p[1] - p[0]) / area, 0.0, 1.0);
  return {true, Hit{Meeting::Crossing, at(a, s), at(b, t)}};
}

/// What exact orientations say of a line and a curve that keeps to one side of it and reaches it: it does so with an
/// end, since between its ends a curve is as far from the line as a positive mean of its points.
Verdict compare_line_and_curve(const Piece& line, const Piece& curve) {
  const Point& from = line.curve.start();
  const Point& to = line.curve.end();
  CGAL::Orientation beyond = CGAL::COLLINEAR;
  std::array<CGAL::Orientation, 2> ends{};
  for (std::size_t k = 0; k < count(curve.curve); ++k) {
    const CGAL::Orientation here = side(from, to, curve.curve.p[k]);
    if (k == 0) ends[0] = here;
    ends[1] = here;
    if (here == CGAL::COLLINEAR) continue;
    if (here == -beyond) return {};
    beyond = here;
  }
  if (beyond == CGAL::COLLINEAR || (ends[0] == CGAL::COLLINEAR) == (ends[1] == CGAL::COLLINEAR)) return {};
  const bool at_start = ends[0] == CGAL::COLLINEAR;
  const double t = parameter(line.curve, at_start ? curve.curve.start() : curve.curve.end());
  if (!(t > 0.0 && t < 1.0)) return {};
  return {true, Hit{Meeting::Contact, at(line, t), at(curve, at_start ? 0.0 : 1.0)}};
}

/// Joins undecided hits that follow each other along both pieces, so that a long chain is one hit.
///
/// A piece passes a point once, so in the order of `a` the chains do not interleave.
std::vector<Hit> join_chains(std::vector<Hit> hits) {
  std::sort(hits.begin(), hits.end(),
            [](const Hit& x, const Hit& y) { return std::tie(x.a.u0, x.b.u0) < std::tie(y.a.u0, y.b.u0); });
  std::vector<Hit> chains;
  for (const Hit& hit : hits) {
    if (!chains.empty()) {
      Hit& chain = chains.back();
      if (hit.a.u0 <= chain.a.u1 && hit.b.u0 <= chain.b.u1 && chain.b.u0 <= hit.b.u1) {
        chain.a.u1 = std::max(chain.a.u1, hit.a.u1);
        chain.b.u0 = std::min(chain.b.u0, hit.b.u0);
        chain.b.u1 = std::max(chain.b.u1, hit.b.u1);
        continue;
      }
    }
    chains.push_back(hit);
  }
  return chains;
}

/// What the certificates say of two pieces as they are. Pieces joined at both ends have to be halved first.
Verdict judge(const Pair& pair, const Tolerance& tolerance) {
  const int joints = pair.joints();
  if (joints > 1) return {};
  if (joints == 1) {
    const bool a_begins = pair.joint[0][0] || pair.joint[0][1];
    const bool b_begins = pair.joint[0][0] || pair.joint[1][0];
    const Bezier a = a_begins ? pair.a.curve : reversed(pair.a.curve);
    const Bezier b = b_begins ? pair.b.curve : reversed(pair.b.curve);
    return {have_parted_cones(a, b, tolerance.margin) || bend_apart(a, b, tolerance.rounding), std::nullopt};
  }
  if (apart(pair.a, pair.b, tolerance.margin)) return {true, std::nullopt};
  if (!meet_once_at_most(pair.a.curve, pair.b.curve) || !must_cross(pair.a.curve, pair.b.curve, tolerance.margin))
    return {};
  const auto hit = common_point(pair.a, pair.b, tolerance.margin);
  return {hit.has_value(), hit};
}

/// Adds the pairs of parts when the larger piece is halved, or both if they are of a size; so neither is cut down to
/// its rounding. The parts at a joint are joined, the others are ordinary pairs.
void add_parts(const Pair& pair, std::vector<Pair>& parts) {
  const double a_size = pair.a.box.size();
  const double b_size = pair.b.box.size();
  const bool cut_a = a_size >= 0.5 * b_size;
  const bool cut_b = b_size >= 0.5 * a_size;
  const auto a = cut_a ? halves(pair.a) : std::array{pair.a, pair.a};
  const auto b = cut_b ? halves(pair.b) : std::array{pair.b, pair.b};
  for (std::size_t i = 0; i < (cut_a ? 2 : 1); ++i) {
    for (std::size_t j = 0; j < (cut_b ? 2 : 1); ++j) {
      Pair& part = parts.emplace_back(Pair{a[i], b[j], pair.joint});
      for (std::size_t k = 0; k < 2; ++k) {
        if (cut_a) part.joint[1 - i][k] = false;
        if (cut_b) part.joint[k][1 - j] = false;
      }
    }
  }
}

void spend(long& budget, long work) {
  budget -= work;
  if (budget < 0) throw WorkLimitExceeded("find_crossings: too many pieces lie on each other");
}

/// Adds all meetings of two pieces that go forward: they are halved until every pair of parts is apart, crosses once,
/// meets only at its joint, or is too small to tell.
///
/// Depth by depth, not pair by pair, so that an overlap shows early as a row of undecided pairs that keeps doubling.
void add_meetings(Pair whole, const Tolerance& tolerance, long& budget, std::vector<Hit>& hits) {
  if (are_same_or_reversed(whole.a.curve, whole.b.curve)) {
    hits.push_back({Meeting::Overlap, whole.a.on, whole.b.on});
    return;
  }
  const bool a_is_line = whole.a.curve.degree == 1;
  const bool b_is_line = whole.b.curve.degree == 1;
  Verdict verdict;
  if (a_is_line && b_is_line) verdict = compare_lines(whole, tolerance.margin);
  if (a_is_line && !b_is_line && whole.joints() == 0) verdict = compare_line_and_curve(whole.a, whole.b);
  if (b_is_line && !a_is_line && whole.joints() == 0) {
    verdict = compare_line_and_curve(whole.b, whole.a);
    if (verdict.hit) std::swap(verdict.hit->a, verdict.hit->b);
  }
  if (verdict.hit) hits.push_back(*verdict.hit);
  if (verdict.decided) return;
  // Ends that are one point though no neighbours share it.
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t j = 0; j < 2; ++j) {
      const Point& a = i == 0 ? whole.a.curve.start() : whole.a.curve.end();
      const Point& b = j == 0 ? whole.b.curve.start() : whole.b.curve.end();
      if (whole.joint[i][j] || a != b) continue;
      whole.joint[i][j] = true;
      hits.push_back({Meeting::Contact, at(whole.a, static_cast<double>(i)), at(whole.b, static_cast<double>(j))});
    }
  }
  verdict = judge(whole, tolerance);
  if (verdict.hit) hits.push_back(*verdict.hit);
  if (verdict.decided) return;

  std::vector<Hit> undecided;
  std::vector<Pair> open;
  std::vector<Pair> next;
  add_parts(whole, open);
  while (!open.empty()) {
    const bool is_last = open.size() > undecided_limit;
    spend(budget, static_cast<long>(open.size()));
    next.clear();
    for (const Pair& pair : open) {
      verdict = judge(pair, tolerance);
      if (verdict.hit) hits.push_back(*verdict.hit);
      if (verdict.decided) continue;
      const bool is_small = std::max(pair.a.box.size(), pair.b.box.size()) < tolerance.contact;
      if (is_last || is_small) {
        undecided.push_back({Meeting::Contact, pair.a.on, pair.b.on});
      } else {
        add_parts(pair, next);
      }
    }
    std::swap(open, next);
  }
  const std::vector<Hit> chains = join_chains(std::move(undecided));
  hits.insert(hits.end(), chains.begin(), chains.end());
}

// The pairs to search -------------------------------------------------------------------------------------------------

/// True if all points lie within the distance from the line through two of them.
bool is_flat(const Bezier& curve, double distance) {
  Point along = Point::Zero();
  for (std::size_t k = 1; k < count(curve); ++k) {
    const Point step = curve.p[k] - curve.p[0];
    if (step.squaredNorm() > along.squaredNorm()) along = step;
  }
  const double length = along.norm();
  for (std::size_t k = 1; k < count(curve); ++k) {
    if (std::abs(cross(along, curve.p[k] - curve.p[0])) > distance * length) return false;
  }
  return true;
}

/// The parameters s <= t where a curve that is not flat passes one point twice: none, or one pair of a cubic. Of a
/// loop smaller than the margin, which is a cusp, none.
///
/// With x(u) = a u^3 + b u^2 + c u, (x(t) - x(s)) / (t - s) = a ((s + t)^2 - s t) + b (s + t) + c is 0, two equations
/// for s + t and s t.
std::optional<std::pair<double, double>> double_point(const Bezier& curve, double margin) {
  if (curve.degree < 3) return std::nullopt;
  const auto& p = curve.p;
  const Point c = 3.0 * (p[1] - p[0]);
  const Point b = 3.0 * (p[2] - p[1]) - c;
  const Point a = p[3] - p[0] - c - b;
  const double ab = cross(a, b);
  const double sum = -cross(a, c) / ab;
  const double product = sum * sum - cross(b, c) / ab;
  const double gap = sum * sum - 4.0 * product;  // (t - s)^2
  const double before = product;                 // s t
  const double after = 1.0 - sum + product;      // (1 - s) (1 - t)
  if (!(sum >= -distinct && sum <= 2.0 + distinct && before >= -distinct && after >= -distinct)) return std::nullopt;
  // Half way the second derivative is 2 b + 3 a sum; the loop is about an eighth of it by (t - s)^2 deep.
  if (!(gap > 0.0) || 0.125 * gap * (2.0 * b + 3.0 * sum * a).norm() <= margin) return std::nullopt;
  const auto snap = [](double u) { return u < distinct ? 0.0 : u > 1.0 - distinct ? 1.0 : u; };
  return std::pair(snap(0.5 * (sum - std::sqrt(gap))), snap(0.5 * (sum + std::sqrt(gap))));
}

/// All segments cut into pieces that go forward, in order.
class Pieces {
 public:
  Pieces(const std::vector<BezierContour>& contours, const Tolerance& tolerance, long& budget);

  const Piece& operator[](std::size_t i) const { return pieces_[i]; }
  std::size_t size() const { return pieces_.size(); }
  /// The piece that a piece runs into, segments of no length passed over.
  std::size_t next(std::size_t i) const { return next_[i]; }
  /// True if the two belong to one segment that has been looked at as a whole.
  bool are_settled(std::size_t i, std::size_t j) const {
    return settled_[i] && pieces_[i].on.segment == pieces_[j].on.segment &&
           pieces_[i].on.contour == pieces_[j].on.contour;
  }
  /// Where segments meet themselves, found on the way.
  const std::vector<Hit>& loops() const { return loops_; }

 private:
  void add(const Bezier& curve, int contour, int segment, const Tolerance& tolerance, long& budget);

  std::vector<Piece> pieces_;
  std::vector<std::size_t> next_;
  std::vector<bool> settled_;
  std::vector<Hit> loops_;
};

Pieces::Pieces(const std::vector<BezierContour>& contours, const Tolerance& tolerance, long& budget) {
  std::size_t segments = 0;
  for (const BezierContour& contour : contours) segments += static_cast<std::size_t>(contour.segment_count());
  pieces_.reserve(segments + segments / 4);
  next_.reserve(segments + segments / 4);
  for (std::size_t c = 0; c < contours.size(); ++c) {
    const std::size_t first = pieces_.size();
    for (int s = 0; s < contours[c].segment_count(); ++s) {
      add(contours[c].segment(s), static_cast<int>(c), s, tolerance, budget);
    }
    for (std::size_t i = first; i < pieces_.size(); ++i) next_.push_back(i + 1);
    if (pieces_.size() == first) continue;
    next_.back() = first;
    const auto closes = [&](const Hit& loop) {
      return loop.a.contour == static_cast<int>(c) && loop.a.u0 == 0.0 && loop.b.u0 == 1.0;
    };
    // A contour of one segment ends where it began.
    if (pieces_[first].on.segment == pieces_.back().on.segment) std::erase_if(loops_, closes);
    for (std::size_t i = first; i < pieces_.size(); ++i) {
      Bezier& follower = pieces_[next_[i]].curve;
      follower.p[0] = pieces_[i].curve.end();  // the same but after a segment passed over
    }
  }
}

void Pieces::add(const Bezier& curve, int contour, int segment, const Tolerance& tolerance, long& budget) {
  const Piece whole{{contour, segment, 0.0, 1.0}, curve, box(curve)};
  if (whole.box.size() <= tolerance.margin) return;
  bool settled = false;
  if (goes_forward(curve)) {
    pieces_.push_back(whole);
  } else {
    settled = !is_flat(curve, tolerance.contact);
    if (settled) {
      if (const auto twice = double_point(curve, tolerance.margin)) {
        const bool at_node = twice->first == 0.0 || twice->second == 1.0;
        loops_.push_back(
            {at_node ? Meeting::Contact : Meeting::Crossing, at(whole, twice->first), at(whole, twice->second)});
      }
    }
    std::vector<Piece> open{whole};
    while (!open.empty()) {
      const Piece piece = open.back();
      open.pop_back();
      // At a cusp no part ever goes forward; one of this size cannot be told from a point.
      if (goes_forward(piece.curve) || piece.box.size() < tolerance.contact) {
        pieces_.push_back(piece);
      } else {
        spend(budget, work_of_halving);
        const auto half = halves(piece);
        open.push_back(half[1]);
        open.push_back(half[0]);
      }
    }
  }
  settled_.resize(pieces_.size(), settled);
}

/// All hits between pieces whose boxes meet, found by sweeping the boxes in x.
std::vector<Hit> all_hits(const std::vector<BezierContour>& contours, const Tolerance& tolerance, long budget) {
  const Pieces pieces(contours, tolerance, budget);
  std::vector<Hit> hits = pieces.loops();
  struct Entry {
    Box box;
    std::size_t piece;
  };
  std::vector<Entry> entries;
  entries.reserve(pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i) entries.push_back({pieces[i].box, i});
  std::sort(entries.begin(), entries.end(), [](const Entry& x, const Entry& y) {
    return x.box.low.x() < y.box.low.x() || (x.box.low.x() == y.box.low.x() && x.piece < y.piece);
  });
  for (std::size_t m = 0; m < entries.size(); ++m) {
    const Box here = entries[m].box;
    const double reach = here.high.x() + tolerance.margin;
    for (std::size_t k = m + 1; k < entries.size() && entries[k].box.low.x() <= reach; ++k) {
      if (apart(here, entries[k].box, tolerance.margin)) continue;
      const auto [i, j] = std::minmax({entries[m].piece, entries[k].piece});
      if (pieces.are_settled(i, j)) continue;
      Pair pair{pieces[i], pieces[j]};
      pair.joint[1][0] = pieces.next(i) == j;
      pair.joint[0][1] = pieces.next(j) == i;
      const std::size_t before = hits.size();
      add_meetings(pair, tolerance, budget, hits);
      spend(budget, 1 + static_cast<long>((hits.size() - before) * hits.size()));  // they are compared later
    }
  }
  return hits;
}

// From hits to findings -----------------------------------------------------------------------------------------------

/// Positions along a closed contour by the length of its control polygons, so that a node is one position.
struct Path {
  std::vector<double> begin;  // position of every segment's start
  double length = 0.0;

  explicit Path(const BezierContour& contour) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      begin.push_back(length);
      const Bezier curve = contour.segment(s);
      for (std::size_t k = 0; k + 1 < count(curve); ++k) length += (curve.p[k + 1] - curve.p[k]).norm();
    }
    begin.push_back(length);
  }

  double position(int segment, double u) const {
    const auto s = static_cast<std::size_t>(segment);
    return begin[s] + u * (begin[s + 1] - begin[s]);
  }
  /// The way from one position forward to another.
  double way(double from, double to) const { return to >= from ? to - from : to - from + length; }
};

class Findings {
 public:
  Findings(const std::vector<BezierContour>& contours, const Tolerance& tolerance)
      : contours_(contours), tolerance_(tolerance) {
    for (const BezierContour& contour : contours) paths_.emplace_back(contour);
  }

  std::vector<Crossing> from(const std::vector<Hit>& hits) const;

 private:
  using Cluster = std::vector<Hit>;

  const BezierContour& contour(int index) const { return contours_[static_cast<std::size_t>(index)]; }
  const Path& path(int index) const { return paths_[static_cast<std::size_t>(index)]; }
  Point point(const Place& place) const { return evaluate(contour(place.contour).segment(place.segment), place.u); }

  bool is_near(const Stretch& x, const Stretch& y) const;
  bool is_near(const Hit& x, const Hit& y) const;
  std::vector<Cluster> clusters(std::vector<Hit> hits) const;
  bool is_one_place(const Cluster& cluster) const;
  double extent(const Cluster& cluster) const;
  Place nearest(const Stretch& on, const Point& x) const;
  Crossing finding(Meeting meeting, Place a, Place b) const;
  Crossing overlap(const Cluster& cluster) const;
  Crossing contact(const Cluster& cluster) const;
  Crossing polished(const Crossing& crossing) const;
  Meeting kind_of_contact(const Crossing& contact, double smallest, double largest) const;

  struct Branch {
    Point direction;  // from the centre to where the branch first leaves the disc
    double walked;    // length of contour up to there
  };
  enum class Way { Forward, Backward };
  std::optional<Branch> branch(const Place& from, Way way, const Point& centre, double radius) const;

  const std::vector<BezierContour>& contours_;
  Tolerance tolerance_;
  std::vector<Path> paths_;
};

bool Findings::is_near(const Stretch& x, const Stretch& y) const {
  if (x.contour != y.contour) return false;
  const Path& along = path(x.contour);
  const double slack = merging_distance * tolerance_.contact;
  const double x0 = along.position(x.segment, x.u0);
  const double x1 = along.position(x.segment, x.u1);
  const double y0 = along.position(y.segment, y.u0);
  const double y1 = along.position(y.segment, y.u1);
  return along.way(x0, y0) <= x1 - x0 + slack || along.way(y0, x0) <= y1 - y0 + slack || along.way(x1, y0) <= slack ||
         along.way(y1, x0) <= slack;
}

bool Findings::is_near(const Hit& x, const Hit& y) const {
  return (is_near(x.a, y.a) && is_near(x.b, y.b)) || (is_near(x.a, y.b) && is_near(x.b, y.a));
}

/// Hits that are near each other on both branches, directly or through others, are one.
std::vector<Findings::Cluster> Findings::clusters(std::vector<Hit> hits) const {
  std::vector<Cluster> clusters;
  while (!hits.empty()) {
    Cluster cluster{hits.back()};
    hits.pop_back();
    for (std::size_t k = 0; k < cluster.size(); ++k) {
      const Hit member = cluster[k];
      const auto rest =
          std::stable_partition(hits.begin(), hits.end(), [&](const Hit& x) { return !is_near(member, x); });
      cluster.insert(cluster.end(), rest, hits.end());
      hits.erase(rest, hits.end());
    }
    clusters.push_back(std::move(cluster));
  }
  return clusters;
}

/// True if the contour does not go away in between: what lies that near along it is told apart as little as what lies
/// that near across it.
bool Findings::is_one_place(const Cluster& cluster) const {
  return std::all_of(cluster.begin(), cluster.end(), [&](const Hit& hit) {
    if (hit.a.contour != hit.b.contour) return false;
    const Path& along = path(hit.a.contour);
    const double a_to_b = along.way(along.position(hit.a.segment, hit.a.u0), along.position(hit.b.segment, hit.b.u1));
    const double b_to_a = along.way(along.position(hit.b.segment, hit.b.u0), along.position(hit.a.segment, hit.a.u1));
    return std::min(a_to_b, b_to_a) <= merging_distance * tolerance_.contact;
  });
}

double Findings::extent(const Cluster& cluster) const {
  Box all{Point::Constant(std::numeric_limits<double>::infinity()),
          Point::Constant(-std::numeric_limits<double>::infinity())};
  for (const Hit& hit : cluster) {
    for (const Stretch& on : {hit.a, hit.b}) {
      for (const double u : {on.u0, on.u1}) {
        const Point x = point({on.contour, on.segment, u});
        all.low = all.low.cwiseMin(x);
        all.high = all.high.cwiseMax(x);
      }
    }
  }
  return all.size();
}

/// The place of the stretch nearest to x, by Gauss-Newton from its middle.
Place Findings::nearest(const Stretch& on, const Point& x) const {
  const Bezier curve = contour(on.contour).segment(on.segment);
  double u = 0.5 * (on.u0 + on.u1);
  for (int step = 0; step < 8; ++step) {
    const Point d = derivative(curve, u);
    if (d == Point::Zero()) break;
    u = std::clamp(u + d.dot(x - evaluate(curve, u)) / d.squaredNorm(), on.u0, on.u1);
  }
  return {on.contour, on.segment, u};
}

/// A finding in the one form that every list has: a node is the start of a segment, the earlier place comes first.
Crossing Findings::finding(Meeting meeting, Place a, Place b) const {
  const Point where = 0.5 * (point(a) + point(b));
  for (Place* place : {&a, &b}) {
    if (place->u < 1.0) continue;
    place->u = 0.0;
    place->segment = contour(place->contour).next(place->segment);
  }
  if (std::tie(b.contour, b.segment, b.u) < std::tie(a.contour, a.segment, a.u)) std::swap(a, b);
  return {meeting, where, a, b};
}

/// The leftmost end of the cluster, of its proved stretches if it has any.
Crossing Findings::overlap(const Cluster& cluster) const {
  const auto is_overlap = [](const Hit& hit) { return hit.meeting == Meeting::Overlap; };
  const bool is_proved = std::any_of(cluster.begin(), cluster.end(), is_overlap);
  std::optional<Crossing> lowest;
  for (const Hit& hit : cluster) {
    if (is_proved && !is_overlap(hit)) continue;
    for (const double u : {hit.a.u0, hit.a.u1}) {
      const Place a{hit.a.contour, hit.a.segment, u};
      const Place b = nearest(hit.b, point(a));
      const Crossing here = finding(Meeting::Overlap, a, b);
      if (!lowest || std::pair(here.where.x(), here.where.y()) < std::pair(lowest->where.x(), lowest->where.y())) {
        lowest = here;
      }
    }
  }
  return *lowest;
}

/// Where a short cluster is: at a node, if one of its branches has one there, else in its middle.
Crossing Findings::contact(const Cluster& cluster) const {
  std::optional<Crossing> best;
  double least = 4.0 * tolerance_.contact;  // two pieces undecided are each smaller than one
  for (const Hit& hit : cluster) {
    for (const auto& [one, other] : {std::pair(hit.a, hit.b), std::pair(hit.b, hit.a)}) {
      for (const double u : {one.u0, one.u1}) {
        if (u != 0.0 && u != 1.0) continue;
        const Place node{one.contour, one.segment, u};
        const Place opposite = nearest(other, point(node));
        const double distance = (point(node) - point(opposite)).norm();
        if (distance >= least) continue;
        least = distance;
        best = finding(Meeting::Contact, node, opposite);
      }
    }
  }
  if (best) return *best;
  // Without a node each branch stays on one segment, but it may have been cut there.
  Hit all = cluster.front();
  for (const Hit& hit : cluster) {
    if (hit.a.segment != all.a.segment || hit.b.segment != all.b.segment) continue;
    all.a.u0 = std::min(all.a.u0, hit.a.u0);
    all.a.u1 = std::max(all.a.u1, hit.a.u1);
    all.b.u0 = std::min(all.b.u0, hit.b.u0);
    all.b.u1 = std::max(all.b.u1, hit.b.u1);
  }
  const Place a{all.a.contour, all.a.segment, 0.5 * (all.a.u0 + all.a.u1)};
  return finding(Meeting::Contact, a, nearest(all.b, point(a)));
}

/// A crossing found by its neighbourhood, moved to the common point of the two segments if that is near.
Crossing Findings::polished(const Crossing& crossing) const {
  if (crossing.a.u == 0.0 || crossing.b.u == 0.0) return crossing;
  const auto around = [&](const Place& place) {
    const Bezier curve = contour(place.contour).segment(place.segment);
    const double reach = merging_distance * tolerance_.contact / std::max(box(curve).size(), tolerance_.contact);
    const double from = std::max(0.0, place.u - reach);
    const double to = std::min(1.0, place.u + reach);
    const Bezier after = split(curve, from)[1];
    const Bezier part = split(after, (to - from) / (1.0 - from))[0];
    return Piece{{place.contour, place.segment, from, to}, part, box(part)};
  };
  const auto hit = common_point(around(crossing.a), around(crossing.b), tolerance_.margin);
  if (!hit) return crossing;
  return finding(Meeting::Crossing, {hit->a.contour, hit->a.segment, hit->a.u0},
                 {hit->b.contour, hit->b.segment, hit->b.u0});
}

/// Parameter at which a curve that starts inside the disc first leaves it.
std::optional<double> first_exit(const Bezier& curve, const Point& centre, double radius, double u0, double u1) {
  const auto is_inside = [&](const Point& x) { return (x - centre).norm() < radius; };
  if (std::all_of(curve.p.begin(), curve.p.begin() + curve.degree + 1, is_inside)) return std::nullopt;
  if (box(curve).size() < 1e-6 * radius || u1 - u0 < 1e-14) {
    return is_inside(curve.end()) ? std::nullopt : std::optional(u1);
  }
  const auto half = split(curve, 0.5);
  const double middle = 0.5 * (u0 + u1);
  if (const auto u = first_exit(half[0], centre, radius, u0, middle)) return u;
  return first_exit(half[1], centre, radius, middle, u1);
}

std::optional<Findings::Branch> Findings::branch(const Place& from, Way way, const Point& centre, double radius) const {
  const BezierContour& along = contour(from.contour);
  const bool forward = way == Way::Forward;
  const double start = path(from.contour).position(from.segment, from.u);
  double u = from.u;
  int segment = from.segment;
  for (int passed = 0; passed <= along.segment_count(); ++passed) {
    Bezier rest = split(along.segment(segment), u)[forward ? 1 : 0];
    if (!forward) std::reverse(rest.p.begin(), rest.p.begin() + rest.degree + 1);
    if (const auto t = first_exit(rest, centre, radius, 0.0, 1.0)) {
      const double at_u = forward ? u + *t * (1.0 - u) : u * (1.0 - *t);
      const double position = path(from.contour).position(segment, at_u);
      const double walked = forward ? path(from.contour).way(start, position) : path(from.contour).way(position, start);
      return Branch{evaluate(rest, *t) - centre, walked};
    }
    segment = forward ? along.next(segment) : along.previous(segment);
    u = forward ? 0.0 : 1.0;
  }
  return std::nullopt;
}

/// Crossing if the branches interleave round the point, else Contact.
///
/// Where each of the two ways through a disc first leaves it, forward and backward, it has run inside the disc; if the
/// four exits interleave on the circle, the two ways cross inside by Jordan's theorem, whatever they do at the centre.
/// The disc grows until exits of different ways are told apart.
Meeting Findings::kind_of_contact(const Crossing& contact, double smallest, double largest) const {
  const auto direction = [](const Branch& branch) {
    return Kernel::Direction_2(branch.direction.x(), branch.direction.y());
  };
  double radius = smallest;
  while (radius <= largest) {
    const auto a_on = branch(contact.a, Way::Forward, contact.where, radius);
    const auto a_back = branch(contact.a, Way::Backward, contact.where, radius);
    const auto b_on = branch(contact.b, Way::Forward, contact.where, radius);
    const auto b_back = branch(contact.b, Way::Backward, contact.where, radius);
    if (!a_on || !a_back || !b_on || !b_back) return Meeting::Contact;
    if (contact.a.contour == contact.b.contour) {
      const Path& along = path(contact.a.contour);
      const double a = along.position(contact.a.segment, contact.a.u);
      const double b = along.position(contact.b.segment, contact.b.u);
      // Within one contour the two ways must not be one.
      if (a_on->walked + b_back->walked >= along.way(a, b)) return Meeting::Contact;
      if (b_on->walked + a_back->walked >= along.way(b, a)) return Meeting::Contact;
    }
    const auto is_distinct = [](const Branch& x, const Branch& y) {
      return x.direction.dot(y.direction) < 0.0 ||
             std::abs(cross(x.direction, y.direction)) > least_angle * x.direction.norm() * y.direction.norm();
    };
    if (!is_distinct(*a_on, *b_on) || !is_distinct(*a_on, *b_back) || !is_distinct(*a_back, *b_on) ||
        !is_distinct(*a_back, *b_back)) {
      radius *= 4.0;
      continue;
    }
    const auto is_between = [&](const Branch& x) {
      return direction(x).counterclockwise_in_between(direction(*a_on), direction(*a_back));
    };
    return is_between(*b_on) != is_between(*b_back) ? Meeting::Crossing : Meeting::Contact;
  }
  return Meeting::Contact;
}

std::vector<Crossing> Findings::from(const std::vector<Hit>& hits) const {
  struct Draft {
    Crossing crossing;
    bool is_settled;
    double reach;  // how far from each other the hits are
  };
  std::vector<Draft> drafts;
  for (const Cluster& cluster : clusters(hits)) {
    const auto has = [&](Meeting meeting) {
      return std::any_of(cluster.begin(), cluster.end(), [&](const Hit& hit) { return hit.meeting == meeting; });
    };
    const double reach = extent(cluster);
    if (has(Meeting::Overlap) || reach > overlap_length * tolerance_.contact) {
      drafts.push_back({overlap(cluster), true, reach});
    } else if (has(Meeting::Crossing)) {
      for (const Hit& hit : cluster) {
        if (hit.meeting != Meeting::Crossing) continue;
        const Place a{hit.a.contour, hit.a.segment, hit.a.u0};
        const Place b{hit.b.contour, hit.b.segment, hit.b.u0};
        drafts.push_back({finding(Meeting::Crossing, a, b), true, reach});
      }
    } else if (!is_one_place(cluster)) {
      drafts.push_back({contact(cluster), false, reach});
    }
  }

  std::vector<Crossing> found;
  for (const Draft& draft : drafts) {
    Crossing crossing = draft.crossing;
    if (!draft.is_settled) {
      // Only this meeting may lie in the disc: others of the same two contours would mix their branches into it.
      double largest = largest_window;
      for (const Draft& other : drafts) {
        if (&other == &draft || other.crossing.a.contour != crossing.a.contour ||
            other.crossing.b.contour != crossing.b.contour) {
          continue;
        }
        largest = std::min(largest, 0.5 * (other.crossing.where - crossing.where).norm());
      }
      crossing.meeting = kind_of_contact(crossing, 2.0 * draft.reach + 4.0 * tolerance_.contact, largest);
      if (crossing.meeting == Meeting::Crossing) crossing = polished(crossing);
    }
    found.push_back(crossing);
  }
  const auto order = [](const Crossing& x) {
    return std::tuple(x.a.contour, x.a.segment, x.a.u, x.b.contour, x.b.segment, x.b.u);
  };
  std::sort(found.begin(), found.end(), [&](const Crossing& x, const Crossing& y) { return order(x) < order(y); });
  return found;
}

}  // namespace

std::vector<Crossing> find_crossings(const std::vector<BezierContour>& contours, const CrossingOptions& options) {
  if (!(options.contact_distance > 0.0)) {
    throw InvalidInput(text("find_crossings: contact_distance ", options.contact_distance, " is not positive"));
  }
  double largest = 0.0;
  for (const BezierContour& contour : contours) {
    if (contour.point_count() > 0) largest = std::max(largest, contour.points().cwiseAbs().maxCoeff());
  }
  // Thirty halvings of a cubic err by less than 100 roundings.
  const double margin = std::max(1e-9, 256.0 * std::numeric_limits<double>::epsilon() * largest);
  const double rounding = 16.0 * std::numeric_limits<double>::epsilon() * largest;
  const Tolerance tolerance{std::max(options.contact_distance, 4.0 * margin), margin, rounding};
  const std::vector<Hit> hits = all_hits(contours, tolerance, options.most_work);
  if (hits.empty()) return {};
  return Findings(contours, tolerance).from(hits);
}

bool is_simple(const BezierContour& contour) { return find_crossings({contour}).empty(); }

int added_crossings(const std::vector<Crossing>& before, const std::vector<Crossing>& after) {
  std::map<std::pair<int, int>, int> added;
  for (const Crossing& crossing : after) ++added[{crossing.a.contour, crossing.b.contour}];
  for (const Crossing& crossing : before) --added[{crossing.a.contour, crossing.b.contour}];
  int sum = 0;
  for (const auto& [contours, more] : added) sum += std::max(more, 0);
  return sum;
}

}  // namespace fontcore
