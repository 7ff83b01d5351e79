#pragma once

// Private to `fit_compact`: one stretch of an outline, and chains of curves that are to stand for it.

#include <limits>
#include <vector>

#include "fontcore/compact.h"
#include "fontcore/contour.h"
#include "fontcore/measure.h"

namespace fontcore::compact {

/// A place on the source: its point, unit tangent, and arc length from the stretch's first sample.
struct Sample {
  Point place = Point::Zero();
  Point tangent = Point::Zero();
  double s = 0.0;
};

/// Where two curves of a chain meet, or where a chain ends; and what of it may move.
struct Join {
  Point place = Point::Zero();
  Point tangent = Point::Zero();  ///< unit, forward; shared by both curves
  bool moves = false;             ///< anywhere: two variables
  bool slides = false;            ///< along `rail`: one
  bool turns = false;             ///< its tangent: one
  bool is_first = false;          ///< the contour's first node
  bool is_cut = false;            ///< an end that others go on from: what lies beyond is none of this chain's
  bool is_corner = false;         ///< an end of the chain that is no smooth continuation
  bool is_held = false;           ///< an end of what stays as it is: on whole numbers or not
  Point rail = Point::Zero();
  Point home = Point::Zero();  ///< where it is on the source
  double slid = 0.0;
  double slide_low = 0.0;
  double slide_high = 0.0;
  double turned = 0.0;
  double turn_low = -std::numeric_limits<double>::infinity();
  double turn_high = std::numeric_limits<double>::infinity();
  /// Whole numbers: what more a corner may turn, for handles end on whole numbers.
  double turn_slack = 0.0;
  /// Quadratics on whole numbers: a handle shorter than this seldom lies along a rail that leans.
  double least_handle = 0.0;
  /// The other end of the line that it slides along.
  bool has_line = false;
  Point line_end = Point::Zero();
  Point line_tangent = Point::Zero();  ///< of what the line goes on to smoothly there; zero if it need not
};

/// What of the source lies between two ends, sampled. Beyond ends that may slide along a line there are samples of
/// that line.
struct Stretch {
  std::vector<Bezier> source;
  std::vector<Sample> samples;  ///< closed: twice round
  int first = 0;                ///< the samples at its own ends
  int last = 0;
  bool is_closed = false;       ///< the whole of a smooth contour: its ends are one join
  std::vector<Point> polyline;  ///< of the source, with the lines beyond its ends
};

/// A chain of curves between joins. Smooth joins share a tangent by construction.
class Chain {
 public:
  CurveKind kind = CurveKind::Cubic;
  bool is_closed = false;  ///< the last piece ends at the first join
  std::vector<Join> joins;
  std::vector<int> breaks;  ///< samples at the joins to start from: one more than pieces
  std::vector<double> out;  ///< cubics: length of every piece's first handle
  std::vector<double> in;   ///< and of its second
  std::vector<double> arc;  ///< arc length of the source below every piece
  std::vector<Point> top;   ///< quadratics: every piece's handle

  int size() const { return static_cast<int>(arc.size()); }
  int next(int join) const { return is_closed && join + 1 == static_cast<int>(joins.size()) ? 0 : join + 1; }
  Bezier piece(int index) const;
};

/// A chain laid on the stretch at the given samples, its handles a third of the arc.
Chain lay_chain(const Stretch& stretch, CurveKind kind, std::vector<Join> joins, std::vector<int> breaks);

/// Moves all that may move in a chain towards the least largest distance from the source.
class ChainFit {
 public:
  ChainFit(const Stretch& stretch, Chain chain);

  enum class Until { Within, Least };
  /// Until the samples are within the distance, or, for the least, until no more is to be won; false if they are not
  /// within it in the end. Gives up where the least squares prove that it cannot be reached.
  bool solve(double distance, int rounds, Until until = Until::Within);
  double worst() const { return worst_; }
  const Chain& chain() const { return chain_; }
  long work() const { return work_; }

  /// The chain on whole numbers: coordinates that differ from one by `fraction`. Of the neighbouring ones, handles up
  /// to `reach` farther, those whose linearised distance is least; no pieces if it is more than `most_distance`, or no
  /// such keep joins smooth, but the pieces that stand against it.
  struct Rounded {
    std::vector<Bezier> pieces;
    std::vector<int> blocked;
  };
  Rounded rounded(const Point& fraction, double most_distance, int reach, std::size_t most_states) const;

 private:
  struct Foot {
    int piece = 0;
    double u = 0.0;
    double weight = 1.0;
    double residual = 0.0;
    Point normal = Point::Zero();
    bool is_active = true;
  };
  // Of one piece, over its feet: what the normal equations are made of.
  struct Sums {
    double xx[10];  // of pairs of control points, i <= j
    double xy[10];
    double yy[10];
    double x[4];
    double y[4];
  };
  struct Polynomial {  // a piece by powers of its parameter
    double x[4];
    double y[4];
  };
  struct Entry {  // how a control point follows a variable
    int variable;
    int control;
    Point by;
  };

  int count_variables();
  double project(int newton) { return chain_.kind == CurveKind::Cubic ? project<3>(newton) : project<2>(newton); }
  template <int degree>
  double project(int newton);
  template <int degree>
  void sum_up(std::vector<Sums>& sums, double& weights, double& squares) const;
  void find_entries(int piece, std::vector<Entry>& list) const;
  void apply(const Eigen::VectorXd& step, double scale);
  void place_quadratics();
  void keep_in_order();

  const Sample& sample(std::size_t foot) const { return stretch_.samples[static_cast<std::size_t>(from_) + foot]; }

  const Stretch& stretch_;
  Chain chain_;
  int from_ = 0;  ///< the first foot's sample
  std::vector<Foot> feet_;
  std::vector<int> join_variable_;
  std::vector<int> piece_variable_;
  std::vector<Point> top_base_;  ///< quadratics: a handle is base + its directions times its variables
  std::vector<std::vector<Point>> top_by_;
  std::vector<Polynomial> polynomials_;  ///< by piece, when last projected on
  int variables_ = 0;
  std::vector<int> blocked_;  ///< per variable: the bound that it is at: above 1, below -1, else 0
  double worst_ = 0.0;
  long work_ = 0;
};

}  // namespace fontcore::compact
