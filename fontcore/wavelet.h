#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <concepts>
#include <span>
#include <vector>

#include "fontcore/contour.h"

namespace fontcore {

/// Control points, one a row: x, y and any number of further attributes (thickness, colour), all filtered alike.
using Coefficients = Eigen::MatrixXd;
using CoefficientsView = Eigen::Ref<const Eigen::MatrixXd>;  ///< takes Points and Coefficients without a copy

/// How a curve and its coarser versions are related. All are uniform B-splines, refined by knot doubling.
///
/// Chaikin and Orthogonal share their spaces: closed quadratic B-splines of N = D * 2^n control points. Chaikin's
/// analysis is local; Orthogonal's coarse curve is the nearest (least squares over the parameter), its wavelets the
/// shortest that are orthogonal to every coarse curve. The endpoint schemes are for open arcs: K = D * 2^n spans, K +
/// degree control points, the first and last on the ends of the arc, wavelets as short as can be and orthogonal. A
/// coarse arc of theirs ends near the ends of the fine one, not on them. The held schemes have the same curves, and
/// coarse arcs that are the nearest of those with the very same ends: their wavelets vanish at both ends and are
/// orthogonal to the coarse curves that do.
///
/// Source  [HBS05] eq. 7 and 8; [FS94] sections 2 and 3. The held schemes are ours: corners of an outline must stay.
enum class Scheme { Chaikin, Orthogonal, EndpointQuadratic, EndpointCubic, HeldQuadratic, HeldCubic };

constexpr bool is_closed(Scheme scheme) { return scheme == Scheme::Chaikin || scheme == Scheme::Orthogonal; }
constexpr bool is_held(Scheme scheme) { return scheme == Scheme::HeldQuadratic || scheme == Scheme::HeldCubic; }
constexpr int degree(Scheme scheme) { return scheme == Scheme::EndpointCubic || scheme == Scheme::HeldCubic ? 3 : 2; }
/// Fewest control points of a level: 4 where filters would else meet themselves, one span of an open arc.
constexpr int fewest(Scheme scheme) { return is_closed(scheme) ? 4 : degree(scheme) + 1; }
/// The number of wavelets between a level of `size` control points and the next finer one: its spans.
constexpr Eigen::Index detail_count(Scheme scheme, Eigen::Index size) {
  return is_closed(scheme) ? size : size - degree(scheme);
}
/// The row of a closed curve of `size` rows that an index, counted on or back round it, is of.
constexpr Eigen::Index modulo(Eigen::Index index, Eigen::Index size) { return (index % size + size) % size; }
/// How often `size` control points can be halved; 0 if not at all.
int most_levels(Scheme scheme, Eigen::Index size);

/// Throws  InvalidInput naming the function and the first entry that is not finite.
void require_finite(const char* function, const CoefficientsView& rows);

struct Split {
  Coefficients coarse;
  Coefficients detail;
};

/// Splits control points into those of half the spans and the detail lost: coarse = A fine, detail = B fine.
///
/// The detail is whatever `synthesize` needs to give `fine` back, up to rounding. Linear time: a local filter, a banded
/// circulant system, or for open arcs the banded system of [FS94] appendix B, its rows and columns interleaved.
///
/// Shape   closed: fine 2m×k, coarse m×k, detail m×k; open: fine (2m + degree)×k, coarse (m + degree)×k, detail m×k.
/// Units   those of `fine`; detail is a displacement.
/// Throws  InvalidInput if the rows cannot be halved into `fewest`, or naming the first entry that is not finite.
/// Source  [HBS05] eq. 3, 7; [FS94] section 2, appendix B.
Split analyze(Scheme scheme, const CoefficientsView& fine);

/// The fine control points of coarse ones and their detail: P coarse + Q detail.
///
/// Shape   as for `analyze`.
/// Throws  InvalidInput if the shapes do not fit, or naming the first entry that is not finite.
/// Source  [HBS05] eq. 2, 8 (its second line is misprinted: before d_{i+1} it must read minus); [FS94] section 2.
Coefficients synthesize(Scheme scheme, const CoefficientsView& coarse, const CoefficientsView& detail);

/// `synthesize` without detail: the same curve with twice the spans.
Coefficients refine(Scheme scheme, const CoefficientsView& coarse);

/// P' fine and Q' fine: what a gradient over fine control points is over coarse ones and details.
///
/// Shape, Throws  as for `analyze`.
/// Source  [HBS05] eq. 14 and 15, the (P) and the (Q) filter.
Split adjoint(Scheme scheme, const CoefficientsView& fine);

/// A column of P or of Q: what one coarse control point, or one detail, adds to the fine control points.
///
/// Rows first .. first + values.size() - 1; modulo the number of fine control points if closed. The values live for
/// ever.
struct FilterColumn {
  Eigen::Index first = 0;
  std::span<const double> values;
};
/// Column j of P, and column k of Q, that lead from `size` control points to the next finer level.
/// Throws  InvalidInput if the size is below `fewest` or the index out of range.
/// Source  [HBS05] eq. 1 to 3; [FS94] appendix A.
FilterColumn scaling_column(Scheme scheme, Eigen::Index size, Eigen::Index j);
FilterColumn wavelet_column(Scheme scheme, Eigen::Index size, Eigen::Index k);

/// The control points that matter at one parameter, and how much each does: degree + 1 weights that sum to 1.
///
/// A closed curve of N points has the parameter t modulo N, piece i over [i - 1/2, i + 1/2], and indices modulo N; an
/// open arc of K spans the parameter [0, K], beyond which its end pieces go on.
struct BasisRow {
  std::array<Eigen::Index, 4> index{};
  std::array<double, 4> weight{};
  int count = 0;
};
/// Throws  InvalidInput if the size is below `fewest` or t is not finite.
BasisRow basis_row(Scheme scheme, Eigen::Index size, double t);
/// The curve at t: a row as wide as the control points.
Eigen::RowVectorXd evaluate(Scheme scheme, const CoefficientsView& control_points, double t);
/// The same in the plane, without a row to allocate.
inline Eigen::RowVector2d evaluate(Scheme scheme, const std::same_as<Points> auto& control_points, double t) {
  const BasisRow row = basis_row(scheme, control_points.rows(), t);
  Eigen::RowVector2d value = Eigen::RowVector2d::Zero();
  for (std::size_t k = 0; k < static_cast<std::size_t>(row.count); ++k) {
    value += row.weight[k] * control_points.row(row.index[k]);
  }
  return value;
}

/// Weights of the control points i - 1, i, i + 1 of a closed curve at t = i - 1/2 + u, u in [0, 1].
Eigen::Vector3d spline_weights(double u);

/// Chaikin's scheme: closed uniform quadratic B-splines, local and exact filters, not orthogonal.
///
/// Parameters of neighbouring levels: t_fine = 2 t_coarse - 1/2. Fine piece i spans t in [i - 1/2, i + 1/2]. Repeated
/// analysis can grow content of period three by 1.25 a level; reconstruction stays at 1e-15.
namespace chaikin {

Split analyze(const CoefficientsView& fine);
Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail);
Coefficients refine(const CoefficientsView& coarse);

/// Analyses x, y pairs `levels` times into buffers of the caller: for curves that change at every frame.
///
/// Shape   all interleaved x, y: fine and out 2N numbers, scratch N + N/2 or more; none may overlap. `out` receives the
///         coarsest control points, then the details from coarse to fine.
/// Throws  InvalidInput if N is not at least 4 * 2^levels and divisible by 2^levels, if a buffer does not fit, or
///         naming the first number that is not finite; `out` is then undefined.
/// Source  [HBS05] eq. 6 and 7.
void analyze_into(std::span<const double> fine, int levels, std::span<double> out, std::span<double> scratch);
/// The way back; buffers as for `analyze_into`.
void synthesize_into(std::span<const double> coefficients, int levels, std::span<double> fine,
                     std::span<double> scratch);

}  // namespace chaikin

/// Least squares in the spaces of `chaikin`; wavelet (1, -29, 147, -303, 303, -147, 29, -1) / 480.
///
/// The coarse points solve (P'GP) c = P'G fine, G the Gram matrix (1, 26, 66, 26, 1) / 120 of B-splines. They are found
/// by lifting, with Chaikin's A and B: B fine = (B Q) d, where B Q = 2 G, is the one solve; c = A fine - A Q d.
namespace orthogonal {
Split analyze(const CoefficientsView& fine);
Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail);
}  // namespace orthogonal

/// Open quadratic arcs; inner wavelets as in `orthogonal`, those at the ends scaled to the same largest coefficient.
namespace endpoint_quadratic {
Split analyze(const CoefficientsView& fine);
Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail);
}  // namespace endpoint_quadratic

/// Open cubic arcs; inner wavelets (1, -124, 1677, -7904, 18482, -24264, 18482, -7904, 1677, -124, 1) / 40320.
namespace endpoint_cubic {
Split analyze(const CoefficientsView& fine);
Coefficients synthesize(const CoefficientsView& coarse, const CoefficientsView& detail);
}  // namespace endpoint_cubic

/// Control points as their coarsest version and the details from coarse to fine.
///
/// Level 0 is coarsest; level j has the control points of `coarse` with their spans doubled j times, and details[j]
/// leads from level j to j + 1.
struct MultiresCurve {
  Coefficients coarse;
  std::vector<Coefficients> details;
  Scheme scheme = Scheme::Chaikin;

  int levels() const { return static_cast<int>(details.size()); }
};

/// Analyses `levels` times.
/// Throws  InvalidInput if levels is negative or above `most_levels`, or naming the first entry that is not finite.
/// Source  [HBS05] eq. 6; the filter bank of [FS94].
MultiresCurve decompose(Scheme scheme, const CoefficientsView& fine, int levels);
MultiresCurve decompose(const CoefficientsView& fine, int levels);  ///< by Chaikin's scheme
Coefficients reconstruct(const MultiresCurve& curve);
/// The same curve with `level` as its coarsest: c^L, d^L, ..., d^{n-1}.
/// Throws  InvalidInput if the level is not in [0, levels].
MultiresCurve from_level(const MultiresCurve& curve, int level);

/// Control points of the curve between two levels: c^{j+t} = P c^j + t Q d^j, for level j + t with t in (0, 1].
///
/// Continuous in the level. An integer level gives c^j itself, any other the size of the next finer level.
///
/// Throws  InvalidInput if the level is not in [0, levels].
/// Source  [FS94] smoothing, the fractional-level curve.
Coefficients fractional(const MultiresCurve& curve, double level);

/// The curve whose c^{j+t} differs by `change`, finer details kept: c^j moves by A change, d^j by B change / t.
///
/// Level 0 moves the coarsest control points alone. A small t asks much of d^j: for dragging mix a broad and a narrow
/// change first ([FS94] g(t) = t^2), as `sweep` does.
///
/// Shape   change like `fractional(curve, level)`.
/// Throws  InvalidInput if the level is not in [0, levels], the shape differs or an entry is not finite.
/// Source  [FS94] editing at fractional levels.
MultiresCurve edit_fractional(const MultiresCurve& curve, double level, const CoefficientsView& change);

/// Which point direct manipulation moves: that of the curve at the fractional level, or of the whole curve.
enum class Moved { Fractional, Whole };

/// Direct manipulation: the change that moves the curve's point at t by 1, of all coefficients, in a single column.
///
/// Times a move (1×k) it is a change of k columns. At level j + f the broad answer, least squares over the control
/// points of level j, is mixed with the narrow one, at level j + 1, by g = f^2: dc^j = (1 - g) broad + g A narrow, dd^j
/// = (g / f) B narrow; details finer than those are 0. The point that moves by 1 is that of the curve at the fractional
/// level ([FS94]); `whole` scales the change so that it is that of the whole curve. Ends of held arcs do not take part.
///
/// Shape   coefficients of a curve of `size` control points seen from `levels` below.
/// Units   t as for `basis_row` at the finest level.
/// Throws  InvalidInput if the level is not in [0, levels], the size cannot be halved so often, or nothing that may
/// move
///         has a weight at t: the end of a held arc.
/// Source  [FS94] editing at fractional levels, direct manipulation (pseudo-inverse).
MultiresCurve pull(Scheme scheme, Eigen::Index size, int levels, double t, double level, Moved moved = Moved::Whole);

/// Control-point editing: the change that moves control point `index` of c^{j+f} by 1, of all coefficients, in a
/// column.
///
/// At a whole level it alone moves there. Between levels the broad answer moves the one or two points of level j that
/// weigh most in it, by one over the sum of their weights; the narrow one moves it alone; they are mixed by g = f^2 as
/// in `pull`, so that the neighbours come along less and less.
///
/// Throws  InvalidInput as `pull`, or if the index is out of range at that level or the end of a held arc.
/// Source  [FS94] editing at fractional levels.
MultiresCurve pull_control_point(Scheme scheme, Eigen::Index size, int levels, Eigen::Index index, double level);

/// The integrals that are quadratic in the control points, over the parameter with spans of length 1.
enum class Form {
  Product,  ///< of f g: the Gram matrix
  Area,     ///< of f g' - f' g: twice the area x (dy) - y (dx) sweeps, skew
  Energy,   ///< of 2 f'' g'': a refinement multiplies it by 1/8, as the same curve then takes twice the spans
};

/// A form on the Bernstein polynomials of a degree over [0, 1]: what schemes build their matrices from.
/// Shape   (degree + 1)×(degree + 1).
Eigen::MatrixXd bernstein_form(Form form, int degree);

/// What one span adds to the matrix of a form: on its degree + 1 control points in order. The values live for
/// ever.
/// Shape   4×4, zero beyond degree + 1.
/// Throws  InvalidInput if the size is below `fewest` or the span out of range.
const Eigen::Matrix4d& span_form(Form form, Scheme scheme, Eigen::Index size, Eigen::Index span);

/// The matrix of a form on the control points of one level: [HBS05]'s mother matrix M^n.
/// Shape   size×size, banded (cyclic if closed).
/// Throws  InvalidInput if the size is below `fewest`.
Eigen::SparseMatrix<double> mother_matrix(Form form, Scheme scheme, Eigen::Index size);

/// The matrix M^L (area), H^L (energy) or Gram matrix of all coefficients (c^L, d^L, ..., d^{n-1}) of a curve.
///
/// As an operator: synthesis, the banded mother matrix of the finest level, and the adjoint, so a product takes linear
/// time. As a matrix, by the recursive filters, for those who ask.
///
/// Source  [HBS05] eq. 10 to 19.
class LevelForm {
 public:
  /// For `size` control points at the finest level, seen from `levels` below it.
  /// Throws  InvalidInput if the size cannot be halved so often, or levels is negative.
  LevelForm(Form form, Scheme scheme, Eigen::Index size, int levels);

  Eigen::Index size() const { return band_.rows(); }
  /// M^L times every column: coefficients stacked coarse first.
  /// Shape   size×k.
  /// Throws  InvalidInput if the rows differ.
  Coefficients apply(const CoefficientsView& coefficients) const;
  /// Shape   size×size, dense.
  Eigen::MatrixXd matrix() const;

 private:
  Scheme scheme_;
  int levels_;
  Eigen::MatrixXd band_;  // row i: entries of columns i - degree .. i + degree at the finest level
};

/// All coefficients of a curve below each other, coarse first, then details from coarse to fine.
Coefficients stack(const MultiresCurve& curve);
/// The way back: coefficients of a curve with so many levels.
/// Throws  InvalidInput if their number cannot be halved so often.
MultiresCurve unstack(Scheme scheme, const CoefficientsView& stacked, int levels);

/// Signed area, from the coefficients (c^L, d^L, ..., d^{n-1}) of columns 0 and 1; of an open arc the boundary integral
/// 1/2 (x y' - x' y), its share of a contour's area.
///
/// Exact   to rounding, the same at every level.
/// Throws  InvalidInput if the level is not in [0, levels] or there are fewer than two columns.
/// Source  [HBS05] eq. 11: 2A = X M^L Y'.
double area(const MultiresCurve& curve, int level);

/// Integral of |c''|^2 over the parameter, spans of the finest level taken as 1, all columns.
///
/// With true spans of length s divide by s^3.
///
/// Throws  InvalidInput if the level is not in [0, levels].
/// Source  [HBS05] eq. 19: E = 1/2 X H^L X' + 1/2 Y H^L Y'.
double energy(const MultiresCurve& curve, int level);

/// Closed curves: parameter of level `finest - levels` for the parameter t of the finest level, and back.
double coarser_parameter(double t, int levels);
double finer_parameter(double t, int levels);
/// The same for any scheme: on open arcs the parameter halves, as spans are counted from the first end.
double coarser_parameter(Scheme scheme, double t, int levels);
double finer_parameter(Scheme scheme, double t, int levels);

}  // namespace fontcore
