// One outline at its fractional levels: across its corners (periodic), and arc by arc, where they stay ([FS94]
// smoothing).

#include "fontcore/arcwise.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

// A comma: a bowl, a tail, and two corners.
BezierContour comma() {
  const auto cubic = PointKind::Cubic;
  const auto node = PointKind::Node;
  const std::vector<Point> points = {{0, 120},   {0, 50},    {60, 0},   {120, 0},  {230, 0},  {260, 120},
                                     {260, 200}, {260, 330}, {90, 480}, {20, 500}, {10, 470}, {90, 420},
                                     {150, 330}, {150, 250}, {60, 250}, {0, 200}};
  Points rows(static_cast<Eigen::Index>(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  return BezierContour(
      rows, {node, cubic, cubic, node, cubic, cubic, node, cubic, cubic, node, node, cubic, cubic, node, cubic, cubic});
}

}  // namespace

int main() {
  const OutlineCurve curve(comma(), {.tolerance = 0.2});
  Picture picture;
  double x = 0.0;
  for (const double scale : {0.0, 150.0, 300.0, 600.0, 1200.0}) {
    double y = 0.0;
    for (const Corners corners : {Corners::Round, Corners::Keep}) {
      const ArcwiseCurve arcs(curve, {.tolerance = 0.2, .corners = corners});
      picture.path(arcs.pieces(scale, 0.5), {x, y}, "fill=\"#29292e\"");
      if (scale > 0.0) {
        const Points ends = arcs.span_ends(scale);
        picture.dots(ends.rowwise() + Eigen::RowVector2d(x, y), 6.0, "stroke=\"#00b85c\"");
      }
      y += 620.0;
    }
    x += 380.0;
  }
  picture.print();
}
