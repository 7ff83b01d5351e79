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
// What is undecided within this length of contour lies on both sides of one cusp or corner. Font units.
constexpr double local_length = 2.0;
// Branches are told apart round a point if their directions differ by this. Radians.
constexpr double least_angle = 1e-4;
constexpr double largest_window = 1.0;  // radius in which branches round a point are looked at, font units

double cross(const Point& a, const Point& b) { return a.x() * b.y() - a.y() * b.x(); }

CGAL::Orientation side(const Point& from, const Point& to, const Point& x) {
  return CGAL::orientation(Kernel::Point_2(from.x(), from.y()), Kernel::Point_2(to.x(), to.y()),
                           Kernel::Point_2(x.x(), x.y()));
}

struct Tolerance {
  double contact;
  double margin;  // distance that counts as apart: far above the rounding of points by subdivision
};

/// The part of a segment over [u0, u1].
struct Stretch {
  int contour = 0;
  int segment = 0;
  double u0 = 0.0;
  double u1 = 0.0;
};

/// A stretch with its own control points.
struct Piece {
  Stretch on;
  Bezier curve;
};

std::size_t count(const Bezier& curve) { return static_cast<std::size_t>(curve.degree) + 1; }

std::array<Piece, 2> halves(const Piece& piece) {
  const auto part = split(piece.curve, 0.5);
  const double middle = 0.5 * (piece.on.u0 + piece.on.u1);
  std::array<Piece, 2> half{piece, piece};
  half[0].curve = part[0];
  half[1].curve = part[1];
  half[0].on.u1 = half[1].on.u0 = middle;
  return half;
}

struct Box {
  Point low;
  Point high;

  double size() const { return (high - low).maxCoeff(); }
};

Box box(const Bezier& curve) {
  Box box{curve.p[0], curve.p[0]};
  for (std::size_t k = 1; k < count(curve); ++k) {
    box.low = box.low.cwiseMin(curve.p[k]);
    box.high = box.high.cwiseMax(curve.p[k]);
  }
  return box;
}

bool apart(const Box& a, const Box& b, double margin) {
  return (a.low.array() > b.high.array() + margin).any() || (b.low.array() > a.high.array() + margin).any();
}

// Certificates on two pieces ------------------------------------------------------------------------------------------

/// True if every step of the control polygon goes forward along the chord. Then so does the curve, whose derivative is
/// a positive mean of the steps, and it cannot come back to where it was.
bool goes_forward(const Bezier& curve) {
  const Point chord = curve.end() - curve.start();
  for (std::size_t k = 0; k + 1 < count(curve); ++k) {
    const Point step = curve.p[k + 1] - curve.p[k];
    if (step != Point::Zero() && step.dot(chord) <= 1e-6 * step.norm() * chord.norm()) return false;
  }
  return chord != Point::Zero();
}

/// True if a line parts the control points of the two, and so the curves, with the margin to spare.
///
/// Disjoint hulls of points are parted by a line along an edge of one of them, so every line through two points of one
/// piece is tried. Its place is chosen in doubles, the parting is proved by exact orientations.
bool apart(const Bezier& a, const Bezier& b, double margin) {
  if (apart(box(a), box(b), margin)) return true;
  const Point origin = a.p[0];
  for (const Bezier* edges : {&a, &b}) {
    for (std::size_t i = 0; i < count(*edges); ++i) {
      for (std::size_t j = i + 1; j < count(*edges); ++j) {
        const Point along = edges->p[j] - edges->p[i];
        const Point normal(-along.y(), along.x());
        const auto range = [&](const Bezier& curve) {
          auto [low, high] = std::pair(normal.dot(curve.p[0] - origin), normal.dot(curve.p[0] - origin));
          for (std::size_t k = 1; k < count(curve); ++k) {
            const double d = normal.dot(curve.p[k] - origin);
            low = std::min(low, d);
            high = std::max(high, d);
          }
          return std::pair(low, high);
        };
        const auto [a_low, a_high] = range(a);
        const auto [b_low, b_high] = range(b);
        const double gap = std::max(a_low - b_high, b_low - a_high);
        if (!(gap > 0.0) || gap * gap <= margin * margin * normal.squaredNorm()) continue;
        const double middle = 0.5 * (a_low > b_high ? a_low + b_high : a_high + b_low);
        const Point from = origin + middle / normal.squaredNorm() * normal;
        const Point to = from + along;
        const CGAL::Orientation side_of_a = a_low > b_high ? CGAL::LEFT_TURN : CGAL::RIGHT_TURN;
        const auto all_on = [&](const Bezier& curve, CGAL::Orientation wanted) {
          for (std::size_t k = 0; k < count(curve); ++k) {
            if (side(from, to, curve.p[k]) != wanted) return false;
          }
          return true;
        };
        if (all_on(a, side_of_a) && all_on(b, -side_of_a)) return true;
      }
    }
  }
  return false;
}

/// True if the ends of `b` lie beyond opposite edges of the strip along the chord of `a` that holds all of `a`.
bool spans(const Bezier& b, const Bezier& a, double margin) {
  const Point chord = a.end() - a.start();
  const double length = chord.norm();
  if (length == 0.0) return false;
  const Point normal = Point(-chord.y(), chord.x()) / length;
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

/// True if `a`, which runs into the first point of `b`, meets `b` there only.
///
/// Seen from the joint, each piece lies in the cone of its control points. A line along an edge of one cone parts them
/// if each keeps to its side of it and they do not share one of its two rays.
bool meet_only_at_joint(const Bezier& a, const Bezier& b, double margin) {
  const Point joint = b.start();
  const auto parted_along = [&](const Point& edge, const Bezier& own, const Bezier& other) {
    const Point ray = edge - joint;
    for (const CGAL::Orientation inside : {CGAL::LEFT_TURN, CGAL::RIGHT_TURN}) {
      bool parted = true;
      for (std::size_t k = 0; parted && k < count(own); ++k) {
        const CGAL::Orientation at = side(joint, edge, own.p[k]);
        parted = at == inside || (at == CGAL::COLLINEAR && ray.dot(own.p[k] - joint) >= 0.0);
      }
      for (std::size_t k = 0; parted && k < count(other); ++k) {
        const Point x = other.p[k] - joint;
        if (x == Point::Zero()) continue;
        const bool forward = ray.dot(x) > 0.0;
        parted = side(joint, edge, other.p[k]) != inside &&
                 (!forward || std::abs(cross(ray, x)) > margin * std::max(ray.norm(), x.norm()));
      }
      if (parted) return true;
    }
    return false;
  };
  for (std::size_t k = 0; k + 1 < count(a); ++k) {
    if (a.p[k] != joint && parted_along(a.p[k], a, b)) return true;
  }
  for (std::size_t k = 1; k < count(b); ++k) {
    if (b.p[k] != joint && parted_along(b.p[k], b, a)) return true;
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
  bool proved = false;
  Stretch a;
  Stretch b;
};

/// Two pieces, and whether one runs into the other at an end that neighbours along the contour share.
struct Pair {
  Piece a;
  Piece b;
  bool a_into_b = false;
  bool b_into_a = false;
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
  return Hit{Meeting::Crossing, true, at(a, s), at(b, t)};
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
  const auto touch = [](Stretch x, Stretch y) { return Verdict{true, Hit{Meeting::Contact, true, x, y}}; };

  if (on_a[0] == CGAL::COLLINEAR && on_a[1] == CGAL::COLLINEAR) {
    Eigen::Index axis = 0;
    (p[1] - p[0]).cwiseAbs().maxCoeff(&axis);
    const double low = std::max(std::min(p[0][axis], p[1][axis]), std::min(q[0][axis], q[1][axis]));
    const double high = std::min(std::max(p[0][axis], p[1][axis]), std::max(q[0][axis], q[1][axis]));
    if (low > high) return {};
    const auto part = [&](const Piece& line) {
      const double from = line.curve.p[0][axis];
      const double length = line.curve.p[1][axis] - from;
      const auto [t0, t1] = std::minmax({(low - from) / length, (high - from) / length});
      Stretch stretch = line.on;
      stretch.u0 = std::clamp(t0, 0.0, 1.0);
      stretch.u1 = std::clamp(t1, 0.0, 1.0);
      return stretch;
    };
    if (low < high) return {true, Hit{Meeting::Overlap, true, part(a), part(b)}};
    if (pair.a_into_b || pair.b_into_a) return {true, std::nullopt};
    return touch(part(a), part(b));
  }
  if (pair.a_into_b || pair.b_into_a) return {};
  if (on_a[0] == on_a[1] || on_b[0] == on_b[1]) return {};
  const double area = cross(p[1] - p[0], q[1] - q[0]);
  const double s = std::clamp(cross(q[0] - p[0], q[1] - q[0]) / area, 0.0, 1.0);
  const double t = std::clamp(cross(q[0] - p[0], p[1] - p[0]) / area, 0.0, 1.0);
  for (std::size_t k = 0; k < 2; ++k) {
    const double end = static_cast<double>(k);
    if (on_a[k] == CGAL::COLLINEAR) {
      return touch(at(a, on_b[0] == CGAL::COLLINEAR ? 0.0 : on_b[1] == CGAL::COLLINEAR ? 1.0 : s), at(b, end));
    }
    if (on_b[k] == CGAL::COLLINEAR) return touch(at(a, end), at(b, t));
  }
  if (!must_cross(a.curve, b.curve, margin)) return {};
  return {true, Hit{Meeting::Crossing, true, at(a, s), at(b, t)}};
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
Verdict judge(const Pair& pair, double margin) {
  const Bezier& a = pair.a.curve;
  const Bezier& b = pair.b.curve;
  if (pair.a_into_b || pair.b_into_a) {
    if (pair.a_into_b && pair.b_into_a) return {};
    return {pair.a_into_b ? meet_only_at_joint(a, b, margin) : meet_only_at_joint(b, a, margin), std::nullopt};
  }
  if (apart(a, b, margin)) return {true, std::nullopt};
  if (!meet_once_at_most(a, b) || !must_cross(a, b, margin)) return {};
  const auto hit = common_point(pair.a, pair.b, margin);
  return {hit.has_value(), hit};
}

/// The pair with the larger piece halved, or both if they are of a size; so neither is cut down to its rounding. The
/// inner halves of a joined pair are joined, the other pairs are ordinary.
std::vector<Pair> parts(const Pair& pair) {
  const double a_size = box(pair.a.curve).size();
  const double b_size = box(pair.b.curve).size();
  const bool cut_a = a_size >= 0.5 * b_size;
  const bool cut_b = b_size >= 0.5 * a_size;
  const auto a = cut_a ? halves(pair.a) : std::array{pair.a, pair.a};
  const auto b = cut_b ? halves(pair.b) : std::array{pair.b, pair.b};
  std::vector<Pair> parts;
  for (std::size_t i = 0; i < (cut_a ? 2 : 1); ++i) {
    for (std::size_t j = 0; j < (cut_b ? 2 : 1); ++j) {
      parts.push_back({a[i], b[j], pair.a_into_b && (!cut_a || i == 1) && (!cut_b || j == 0),
                       pair.b_into_a && (!cut_b || j == 1) && (!cut_a || i == 0)});
    }
  }
  return parts;
}

void spend(long& budget, long work) {
  budget -= work;
  if (budget < 0) throw WorkLimitExceeded("find_crossings: too many pieces lie on each other");
}

/// All meetings of two pieces that go forward: they are halved until every pair of parts is apart, crosses once, meets
/// only at its joint, or is too small to tell.
///
/// Depth by depth, not pair by pair, so that an overlap shows early as a row of undecided pairs that keeps doubling.
std::vector<Hit> meetings(const Pair& whole, const Tolerance& tolerance, long& budget) {
  if (are_same_or_reversed(whole.a.curve, whole.b.curve)) return {{Meeting::Overlap, true, whole.a.on, whole.b.on}};
  if (whole.a.curve.degree == 1 && whole.b.curve.degree == 1) {
    const Verdict verdict = compare_lines(whole, tolerance.margin);
    if (verdict.decided) return verdict.hit ? std::vector<Hit>{*verdict.hit} : std::vector<Hit>{};
  }
  std::vector<Hit> crossings;
  std::vector<Hit> undecided;
  std::vector<Pair> open{whole};
  while (!open.empty()) {
    const bool is_last = open.size() > undecided_limit;
    spend(budget, static_cast<long>(open.size()));
    std::vector<Pair> next;
    for (const Pair& pair : open) {
      const Verdict verdict = judge(pair, tolerance.margin);
      if (verdict.hit) crossings.push_back(*verdict.hit);
      if (verdict.decided) continue;
      const bool is_small = std::max(box(pair.a.curve).size(), box(pair.b.curve).size()) < tolerance.contact;
      if (is_last || is_small) {
        undecided.push_back({Meeting::Contact, false, pair.a.on, pair.b.on});
      } else {
        const std::vector<Pair> halved = parts(pair);
        next.insert(next.end(), halved.begin(), halved.end());
      }
    }
    open = std::move(next);
  }
  std::vector<Hit> hits = join_chains(std::move(undecided));
  hits.insert(hits.end(), crossings.begin(), crossings.end());
  return hits;
}

// The pairs to search -------------------------------------------------------------------------------------------------

/// The contour cut into pieces that go forward, in order, segments of no length left out.
std::vector<Piece> forward_pieces(const BezierContour& contour, int index, double contact) {
  std::vector<Piece> pieces;
  for (int s = 0; s < contour.segment_count(); ++s) {
    std::vector<Piece> open{{{index, s, 0.0, 1.0}, contour.segment(s)}};
    if (is_degenerate(open.back().curve)) continue;
    while (!open.empty()) {
      const Piece piece = open.back();
      open.pop_back();
      // At a cusp no part ever goes forward; one of this size cannot be told from a point.
      if (goes_forward(piece.curve) || box(piece.curve).size() < contact) {
        pieces.push_back(piece);
      } else {
        const auto half = halves(piece);
        open.push_back(half[1]);
        open.push_back(half[0]);
      }
    }
  }
  return pieces;
}

/// All hits between pieces whose boxes meet, found by sweeping the boxes in x.
std::vector<Hit> all_hits(const std::vector<BezierContour>& contours, const Tolerance& tolerance, long budget) {
  std::vector<Piece> pieces;
  std::vector<std::size_t> next;  // the piece that a piece runs into
  for (std::size_t c = 0; c < contours.size(); ++c) {
    const std::size_t first = pieces.size();
    for (const Piece& piece : forward_pieces(contours[c], static_cast<int>(c), tolerance.contact)) {
      pieces.push_back(piece);
      next.push_back(pieces.size());
    }
    if (pieces.size() > first) next.back() = first;
  }
  std::vector<Box> boxes;
  boxes.reserve(pieces.size());
  for (const Piece& piece : pieces) boxes.push_back(box(piece.curve));
  std::vector<std::size_t> order(pieces.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return boxes[i].low.x() < boxes[j].low.x(); });
  std::vector<Hit> hits;
  for (std::size_t m = 0; m < order.size(); ++m) {
    const double reach = boxes[order[m]].high.x() + tolerance.margin;
    for (std::size_t k = m + 1; k < order.size() && boxes[order[k]].low.x() <= reach; ++k) {
      const auto [i, j] = std::minmax({order[m], order[k]});
      if (apart(boxes[i], boxes[j], tolerance.margin)) continue;
      const auto found = meetings({pieces[i], pieces[j], next[i] == j, next[j] == i}, tolerance, budget);
      hits.insert(hits.end(), found.begin(), found.end());
      spend(budget, 1 + static_cast<long>(found.size() * hits.size()));  // hits are compared with each other later
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
  bool is_local(const Cluster& cluster) const;
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

/// True if nothing is proved and all of it lies within a short way along one contour: the two sides of a cusp come as
/// near each other as one likes, and this is no meeting.
bool Findings::is_local(const Cluster& cluster) const {
  return std::all_of(cluster.begin(), cluster.end(), [&](const Hit& hit) {
    if (hit.proved || hit.a.contour != hit.b.contour) return false;
    const Path& along = path(hit.a.contour);
    const double a_to_b = along.way(along.position(hit.a.segment, hit.a.u0), along.position(hit.b.segment, hit.b.u1));
    const double b_to_a = along.way(along.position(hit.b.segment, hit.b.u0), along.position(hit.a.segment, hit.a.u1));
    return std::min(a_to_b, b_to_a) <= local_length;
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
    return Piece{{place.contour, place.segment, from, to}, split(after, (to - from) / (1.0 - from))[0]};
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
    bool is_local;
    double reach;  // how far from each other the hits are
  };
  std::vector<Draft> drafts;
  for (const Cluster& cluster : clusters(hits)) {
    const auto has = [&](Meeting meeting) {
      return std::any_of(cluster.begin(), cluster.end(), [&](const Hit& hit) { return hit.meeting == meeting; });
    };
    const double reach = extent(cluster);
    const bool local = is_local(cluster);
    const bool is_long = reach > overlap_length * tolerance_.contact;
    if (has(Meeting::Overlap) || (is_long && !local)) {
      drafts.push_back({overlap(cluster), true, local, reach});
    } else if (has(Meeting::Crossing)) {
      for (const Hit& hit : cluster) {
        if (hit.meeting != Meeting::Crossing) continue;
        const Place a{hit.a.contour, hit.a.segment, hit.a.u0};
        const Place b{hit.b.contour, hit.b.segment, hit.b.u0};
        drafts.push_back({finding(Meeting::Crossing, a, b), true, local, reach});
      }
    } else if (!is_long) {
      drafts.push_back({contact(cluster), false, local, reach});
    }
  }

  std::vector<Crossing> found;
  for (const Draft& draft : drafts) {
    Crossing crossing = draft.crossing;
    if (!draft.is_settled) {
      // Only this meeting may lie in the disc: others of the same two contours would mix their branches into it.
      double largest = largest_window;
      for (const Draft& other : drafts) {
        if (&other == &draft || other.is_local || other.crossing.a.contour != crossing.a.contour ||
            other.crossing.b.contour != crossing.b.contour) {
          continue;
        }
        largest = std::min(largest, 0.5 * (other.crossing.where - crossing.where).norm());
      }
      crossing.meeting = kind_of_contact(crossing, 2.0 * draft.reach + 4.0 * tolerance_.contact, largest);
      if (crossing.meeting == Meeting::Crossing) crossing = polished(crossing);
      if (crossing.meeting == Meeting::Contact && draft.is_local) continue;
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
  const Tolerance tolerance{std::max(options.contact_distance, 4.0 * margin), margin};
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
