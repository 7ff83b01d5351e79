// [FS94] editing: a curve's sweep changed without its character, details fixed in x and y or turned with the tangent;
// the same point pulled at levels from fine to coarse, fractional ones between; and pulls of one breadth on a curve
// that is run through unevenly, each at the level that its own arc length gives.

#include <cmath>

#include "fontcore/edit.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

constexpr Scheme scheme = Scheme::EndpointCubic;
constexpr int levels = 5;
const std::string before = "fill=\"none\" stroke=\"#aaa\" stroke-width=\"3\"";
const std::string after = "fill=\"none\" stroke=\"#215bea\" stroke-width=\"3\"";

// A rough hill: `unevenness` above 1 crowds its control points to the left.
Coefficients hill(double roughness, double unevenness) {
  Coefficients points((2 << levels) + degree(scheme), 2);
  const auto last = static_cast<double>(points.rows() - 1);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double t = std::pow(static_cast<double>(i) / last, unevenness);
    const double rough = roughness * std::sin(static_cast<double>(i) * 2.1);
    points.row(i) << 600.0 * t, 150.0 * std::sin(3.1 * t) + rough;
  }
  return points;
}

Points drawn(const Coefficients& points) {
  Points line(400, 2);
  const auto spans = static_cast<double>(detail_count(scheme, points.rows()));
  for (int k = 0; k < 400; ++k) line.row(k) = evaluate(scheme, points, spans * k / 399.0);
  return line;
}

}  // namespace

int main() {
  Picture picture;
  const Coefficients rough = hill(9.0, 1.0);
  const MultiresCurve curve = decompose(scheme, rough, levels);
  const auto row = [](const Points& points, double y) { return Points(points.rowwise() + Eigen::RowVector2d(0.0, y)); };

  // Sweep: the coarse curve, bent, and the details carried along.
  const Coefficients sweep = from_level(curve, 1).coarse;
  Coefficients bent = sweep;
  bent.row(2) += Eigen::RowVector2d(60.0, 420.0);
  picture.path(drawn(rough), before);
  picture.path(drawn(sweep), after);
  for (const DetailFrame frame : {DetailFrame::Fixed, DetailFrame::Tangent}) {
    picture.next_panel(700.0);
    picture.path(drawn(rough), before);
    picture.path(drawn(reconstruct(carry_details(curve, 1, bent, frame))), after);
  }

  // Breadth: one point pulled from the finest level to the coarsest.
  picture.next_panel(-1400.0);
  for (const double level : {5.0, 4.0, 3.0, 2.5, 2.0, 1.0}) {
    picture.path(row(drawn(rough), -500.0), before);
    const MultiresCurve change = pull(scheme, rough.rows(), levels, 30.0, level);
    picture.path(row(drawn(rough + reconstruct(change) * Eigen::RowVector2d(40.0, 220.0)), -500.0), after);
    picture.next_panel(700.0);
  }

  // A breadth of 300, on the left where the curve is slow, in the middle and on the right where it is fast.
  picture.next_panel(-4200.0);
  const MultiresCurve uneven = decompose(scheme, hill(0.0, 3.0), levels);
  for (const double t : {28.0, 46.0, 58.0}) {
    const Coefficients points = reconstruct(uneven);
    picture.path(row(drawn(points), -1000.0), before);
    const MultiresCurve change = pull(scheme, points.rows(), levels, t, level_of_breadth(uneven, t, 300.0));
    picture.path(row(drawn(points + reconstruct(change) * Eigen::RowVector2d(0.0, 220.0)), -1000.0), after);
    picture.next_panel(700.0);
  }
  picture.print();
}
