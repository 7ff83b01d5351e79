#include "fontcore/spectrum.h"

#include <algorithm>
#include <cmath>

#include "fontcore/error.h"

namespace fontcore {

namespace {

// Of all contours of an outline together, so that none costs more than time and memory allow: the longest letters have
// a quarter.
constexpr double most_steps = 65'536.0;
constexpr double steps_per_feature = 4.0;
// Heights nearer to the top than this are one, as share of a step.
constexpr double same_height = 1e-6;

/// A closed curve as its coordinates one after the other.
struct Samples {
  std::vector<double> x;
  std::vector<double> y;
};

double polygon_length(const Bezier& bezier) {
  double length = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(bezier.degree); ++k)
    length += (bezier.p[k + 1] - bezier.p[k]).norm();
  return length;
}

/// Points of the outline at most `step` apart along it.
Samples to_samples(const BezierContour& contour, double step) {
  Samples samples;
  for (int s = 0; s < contour.segment_count(); ++s) {
    const Bezier bezier = contour.segment(s);
    const int pieces = bezier.degree == 1 ? 1 : std::max(static_cast<int>(std::ceil(polygon_length(bezier) / step)), 4);
    for (int k = 0; k < pieces; ++k) {
      const Point p = k == 0 ? bezier.start() : evaluate(bezier, static_cast<double>(k) / pieces);
      samples.x.push_back(p.x());
      samples.y.push_back(p.y());
    }
  }
  return samples;
}

std::size_t topmost(const Samples& samples, double same) {
  const double top = *std::max_element(samples.y.begin(), samples.y.end()) - same;
  std::size_t best = samples.y.size();
  for (std::size_t i = 0; i < samples.y.size(); ++i) {
    if (samples.y[i] >= top && (best == samples.y.size() || samples.x[i] < samples.x[best])) best = i;
  }
  return best;
}

/// The polyline's points at equal steps of its length, at most so long, from its topmost one.
Samples at_equal_steps(const Samples& polyline, double most, double& step) {
  const std::size_t n = polyline.x.size();
  const std::size_t first = topmost(polyline, same_height * most);
  std::vector<double> s(n + 1, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t a = (first + i) % n;
    const std::size_t b = (first + i + 1) % n;
    const double dx = polyline.x[b] - polyline.x[a];
    const double dy = polyline.y[b] - polyline.y[a];
    s[i + 1] = s[i] + std::sqrt(dx * dx + dy * dy);
  }
  const double length = s[n];
  const int count = std::max(static_cast<int>(std::ceil(length / most)), 4);
  step = length / count;
  Samples samples;
  samples.x.resize(static_cast<std::size_t>(count));
  samples.y.resize(static_cast<std::size_t>(count));
  std::size_t i = 0;
  for (std::size_t k = 0; k < samples.x.size(); ++k) {
    const double at = static_cast<double>(k) * step;
    while (i + 1 < n && s[i + 1] <= at) ++i;
    const std::size_t a = (first + i) % n;
    const std::size_t b = (first + i + 1) % n;
    const double u = s[i + 1] > s[i] ? (at - s[i]) / (s[i + 1] - s[i]) : 0.0;
    samples.x[k] = polyline.x[a] + u * (polyline.x[b] - polyline.x[a]);
    samples.y[k] = polyline.y[a] + u * (polyline.y[b] - polyline.y[a]);
  }
  return samples;
}

/// Smooths a closed sequence by the mask over every `stride`-th value; gives the energy of what is taken away.
double smooth(const std::vector<double>& from, std::size_t stride, std::vector<double>& to) {
  const std::size_t n = from.size();
  const std::size_t shift = stride % n;
  double energy = 0.0;
  const auto take = [&](std::size_t begin, std::size_t end, std::size_t before, std::size_t after) {
    for (std::size_t k = begin; k < end; ++k) {
      to[k] = 0.25 * (from[before + k - begin] + from[after + k - begin]) + 0.5 * from[k];
      const double detail = from[k] - to[k];
      energy += detail * detail;
    }
  };
  // Where neighbours lie beyond an end they are those of the other end.
  const std::size_t low = std::min(shift, n - shift);
  const std::size_t high = std::max(shift, n - shift);
  take(0, low, n - shift, shift);
  take(low, high, shift <= n - shift ? 0 : n - shift + low, shift <= n - shift ? shift + low : shift + low - n);
  take(high, n, high - shift, high + shift - n);
  return energy;
}

}  // namespace

std::array<double, octave_count> octave_energies(const std::vector<BezierContour>& contours, double finest) {
  if (!(finest > 0.0)) throw InvalidInput(text("octave_energies: a finest feature of ", finest, " units"));
  std::array<double, octave_count> energies{};
  double length = 0.0;
  for (const BezierContour& contour : contours)
    for (int s = 0; s < contour.segment_count(); ++s) length += polygon_length(contour.segment(s));
  const double most = std::max(finest / steps_per_feature, length / most_steps);
  std::vector<double> scratch;
  for (const BezierContour& contour : contours) {
    double step = 0.0;
    Samples samples = at_equal_steps(to_samples(contour, most), most, step);
    scratch.resize(samples.x.size());
    for (std::vector<double>* axis : {&samples.x, &samples.y}) {
      smooth(*axis, 1, scratch);  // where samples fall beside a corner is no feature
      axis->swap(scratch);
      for (std::size_t octave = 0; octave < octave_count; ++octave) {
        energies[octave] += step * smooth(*axis, std::size_t{2} << octave, scratch);
        axis->swap(scratch);
      }
    }
  }
  return energies;
}

}  // namespace fontcore
