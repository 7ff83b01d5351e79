// [GA98] figures 3 to 7, the paper's cat: sketched, its back sketched over; pulled by the wavelet form with three
// widths; a tail pushed out of it by the spatula; its ears made corners; and all three forms drawn together.

#include <cmath>

#include "fontcore/brush.h"
#include "tools/examples/svg.h"

using namespace fontcore;

namespace {

const std::string grey = "fill=\"none\" stroke=\"#bbb\" stroke-width=\"3\"";
const std::string ink = "fill=\"none\" stroke=\"black\" stroke-width=\"4\"";
const std::string blue = "fill=\"none\" stroke=\"#215bea\" stroke-width=\"4\"";
const std::string red = "fill=\"none\" stroke=\"#d2322d\" stroke-width=\"3\"";

Points points_of(const std::vector<Point>& list) {
  Points points(static_cast<Eigen::Index>(list.size()), 2);
  for (std::size_t i = 0; i < list.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = list[i];
  return points;
}

// What a hand draws through places, and it trembles a little.
Points stroke_through(const std::vector<Point>& places, bool is_closed) {
  const auto n = static_cast<int>(places.size());
  const auto place = [&](int i) {
    return places[static_cast<std::size_t>(is_closed ? (i + n) % n : std::clamp(i, 0, n - 1))];
  };
  std::vector<Point> drawn;
  for (int i = 0; i < (is_closed ? n : n - 1); ++i) {
    for (int k = 0; k < 12; ++k) {
      const double u = k / 12.0;
      const Point a = 0.5 * (place(i + 1) - place(i - 1));
      const Point b = 0.5 * (place(i + 2) - place(i));
      const Point way = place(i + 1) - place(i);
      const Point at = place(i) + u * (a + u * ((3.0 * way - 2.0 * a - b) + u * (a + b - 2.0 * way)));
      const double tremble = static_cast<double>(drawn.size());
      drawn.push_back(at + 1.2 * Point(std::sin(2.3 * tremble), std::sin(3.1 * tremble)));
    }
  }
  if (!is_closed) drawn.push_back(places.back());
  return points_of(drawn);
}

Points outline(const LinkedPolyline& polyline) { return polyline.whole().points; }

}  // namespace

int main() {
  Picture picture;
  const SketchOptions by_hand{.stroke = {.noise = 60.0, .corner_angle = 3.0}, .blend = 60.0};

  // Figure 3: the outline; then the back, which was too thin.
  const Points first =
      stroke_through({{95, 612},  {84, 575},  {106, 535}, {158, 508}, {152, 420}, {150, 300}, {166, 160}, {160, 62},
                      {112, 26},  {130, 0},   {225, 0},   {252, 45},  {262, 130}, {292, 52},  {330, 4},   {420, 0},
                      {478, 30},  {470, 130}, {430, 260}, {380, 370}, {330, 460}, {306, 535}, {306, 600}, {310, 660},
                      {306, 728}, {276, 748}, {240, 706}, {196, 700}, {164, 742}, {134, 736}, {122, 684}, {110, 648}},
                     true);
  LinkedCurve cat = sketch({first}, by_hand, {.epsilon = 1.0});
  const Points back =
      stroke_through({{318, 510}, {390, 452}, {470, 350}, {520, 230}, {530, 110}, {490, 30}, {420, 2}}, false);
  picture.path(outline(cat.polyline()), grey, true);
  cat = sketch_over(cat, {back}, by_hand);
  picture.path(outline(cat.polyline()), ink, true);
  picture.path(back, blue);

  // Figure 4: pulled with three widths.
  picture.next_panel(650.0);
  picture.path(outline(cat.polyline()), grey, true);
  const auto pulled = [&](const Point& from, const Point& to, double breadth) {
    cat = pull(cat, nearest_place(cat, from).t, to - from, breadth);
    picture.path(points_of({from, to}), red);
  };
  pulled({528, 160}, {552, 150}, breadth_of(cat, Width::Broad));
  pulled({152, 380}, {132, 384}, breadth_of(cat, Width::Medium));
  pulled({84, 575}, {72, 573}, breadth_of(cat, Width::Narrow));
  picture.path(outline(cat.polyline()), ink, true);

  // Figure 5: the tail, from the inside.
  picture.next_panel(650.0);
  picture.path(outline(cat.polyline()), grey, true);
  const Points way = stroke_through({{490, 60}, {590, 40}, {690, 60}, {750, 140}, {750, 240}, {700, 300}}, false);
  cat = push(cat, Tip(Circle{18.0}), way);
  picture.path(outline(cat.polyline()), ink, true);
  picture.path(way, "fill=\"none\" stroke=\"#7db3f2\" stroke-width=\"2\"");

  // Figure 6: the ears.
  picture.next_panel(850.0);
  picture.path(outline(cat.polyline()), grey, true);
  const auto ear = [&](const Point& from, const Point& to, const Point& in, const Point& out) {
    cat = make_corner(cat, nearest_place(cat, from).t, 0.04);
    const std::string name = corner_handles(cat).back().name;
    cat = turn_corner(turn_corner(move_corner(cat, name, to), name, Side::Left, in), name, Side::Right, out);
    picture.path(points_of({to - 60.0 * in.normalized(), to, to + 60.0 * out.normalized()}), red);
  };
  ear({300, 742}, {318, 800}, {0.0, 1.0}, {-0.6, -0.8});
  ear({146, 746}, {122, 796}, {-0.55, 0.85}, {-0.05, -1.0});
  picture.path(outline(cat.polyline()), ink, true);

  // Figure 7: polyline, spline and wavelet with what they are made of.
  picture.next_panel(850.0);
  picture.path(outline(cat.polyline()), ink, true);
  picture.dots(outline(cat.polyline()), 3.0, "stroke=\"black\"");
  picture.polygon(cat.spline().control_points(), "#d2322d");
  picture.dots(cat.spline().control_points(), 4.0, "stroke=\"#d2322d\"");
  const LinkedWavelet& wavelet = cat.wavelet();
  const Points sweep = wavelet.control_points(0, 2, 0, wavelet.size(2));
  picture.polygon(sweep, "#215bea");
  picture.dots(sweep, 5.0, "stroke=\"#215bea\"");
  picture.print();
}
