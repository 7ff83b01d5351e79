#include "fontcore/texture.h"

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "fontcore/error.h"
#include "tests/catch.h"

using namespace fontcore;
using namespace fontcore::texture;

namespace {

const std::vector<Texture> all{Noise{}, Wave{}, Saw{}, Saw{.lean = 0.8}, Saw{.lean = 1.0}, Scallop{}, Ink{}};

DetailSample sample_of(const DetailLibrary& library) {
  REQUIRE(library.samples.size() == 1);
  return library.samples[0];
}

double root_mean_square(const Eigen::VectorXd& values) {
  return values.norm() / std::sqrt(static_cast<double>(values.size()));
}

/// Root mean square of what a closed run has of one harmonic.
double harmonic(const Eigen::VectorXd& values, Eigen::Index k) {
  const auto n = values.size();
  std::complex<double> sum = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double phase = 2.0 * std::numbers::pi * static_cast<double>((i * k) % n) / static_cast<double>(n);
    sum += values[i] * std::polar(1.0, -phase);
  }
  return std::numbers::sqrt2 * std::abs(sum) / static_cast<double>(n);
}

/// Root mean square of what lies between two wavelengths.
double between(const DetailSample& sample, double shortest, double longest) {
  double sum = 0.0;
  const auto first = static_cast<Eigen::Index>(std::ceil(sample.length / longest - 1e-9));
  for (Eigen::Index k = first; static_cast<double>(k) * shortest <= sample.length * (1 + 1e-12); ++k) {
    sum += std::pow(harmonic(sample.offsets.col(1), k), 2);
  }
  return std::sqrt(sum);
}

/// The points that a sample makes of a straight base.
Points on_straight_base(const DetailSample& sample) {
  Points points = sample.offsets;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    points(i, 0) += sample.length * static_cast<double>(i) / static_cast<double>(points.rows());
  }
  return points;
}

}  // namespace

TEST_CASE("a texture has no mean, and goes on over its end as within it", "[texture]") {
  for (const Texture& texture : all) {
    const DetailSample sample = sample_of(make_library(texture));
    const Points& offsets = sample.offsets;
    const auto n = offsets.rows();
    CHECK(sample.is_closed);
    CHECK(offsets.colwise().mean().cwiseAbs().maxCoeff() < 1e-12);
    double largest_step = 0.0;
    double largest_bend = 0.0;
    for (Eigen::Index i = 1; i + 1 < n; ++i) {
      largest_step = std::max(largest_step, (offsets.row(i) - offsets.row(i - 1)).norm());
      largest_bend = std::max(largest_bend, (offsets.row(i + 1) - 2 * offsets.row(i) + offsets.row(i - 1)).norm());
    }
    CHECK((offsets.row(0) - offsets.row(n - 1)).norm() <= largest_step * 1.05);
    CHECK((offsets.row(1) - 2 * offsets.row(0) + offsets.row(n - 1)).norm() <= largest_bend * 1.05);
    CHECK((offsets.row(0) - 2 * offsets.row(n - 1) + offsets.row(n - 2)).norm() <= largest_bend * 1.05);
  }
}

TEST_CASE("all of a texture is shorter than two fifths of its scale", "[texture]") {
  for (const Texture& texture : all) {
    const DetailLibrary library = make_library(texture);
    const DetailSample sample = sample_of(library);
    CHECK(library.frame == DetailFrame::Tangent);
    CHECK(library.units_per_em == 1000);
    const auto fewest = static_cast<Eigen::Index>(std::floor(2.5 * sample.length / library.scale - 1e-9));
    for (Eigen::Index k = 0; k <= fewest; ++k) {
      if (static_cast<double>(k) * library.scale > 2.5 * sample.length * (1 - 1e-12)) continue;
      CHECK(harmonic(sample.offsets.col(0), k) < 1e-9);
      CHECK(harmonic(sample.offsets.col(1), k) < 1e-9);
    }
  }
}

TEST_CASE("noise lies between its two wavelengths, as strong as asked, an octave like the other", "[texture]") {
  for (const Noise& noise : {Noise{}, Noise{6, 48, 3.0, 7}, Noise{20, 20.5, 1.0, 3}}) {
    const DetailSample sample = sample_of(make_library(noise));
    const Eigen::VectorXd values = sample.offsets.col(1);
    CHECK(sample.length >= 4000);
    CHECK(sample.offsets.col(0).isZero(0.0));
    CHECK(root_mean_square(values) == Approx(noise.amplitude).epsilon(1e-12));
    CHECK(between(sample, noise.shortest, noise.longest) == Approx(noise.amplitude).epsilon(1e-9));
    CHECK(sample.length / static_cast<double>(values.size()) <= noise.shortest / 16);
  }
  const DetailSample sample = sample_of(make_library(Noise{6, 48, 3.0, 7}));
  for (double octave = 6; octave < 48; octave *= 2) {
    CHECK(between(sample, octave, 2 * octave) == Approx(3.0 / std::sqrt(3.0)).epsilon(0.15));
  }
}

TEST_CASE("ink has broad bulges, narrow hollows, and both its amplitudes", "[texture]") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Ink ink{.seed = seed};
    const DetailSample sample = sample_of(make_library(ink));
    const double fine = between(sample, ink.fine_wavelength / 1.2, ink.fine_wavelength * 1.2);
    const double slow = between(sample, 0.5 * ink.wavelength / 1.2, ink.wavelength * 1.2);
    CHECK(fine == Approx(ink.fine_amplitude).epsilon(1e-9));
    CHECK(slow == Approx(ink.amplitude).epsilon(1e-9));
    CHECK(std::hypot(fine, slow) == Approx(root_mean_square(sample.offsets.col(1))).epsilon(1e-9));
    CHECK(sample.offsets.col(1).array().cube().mean() < -0.1 * std::pow(ink.amplitude, 3));
    CHECK(sample.offsets.col(1).maxCoeff() < -sample.offsets.col(1).minCoeff());
  }
}

TEST_CASE("the same seed makes the same bits, another seed another run", "[texture]") {
  const auto offsets = [](const Texture& texture) { return sample_of(make_library(texture)).offsets; };
  CHECK(offsets(Noise{.seed = 5}) == offsets(Noise{.seed = 5}));
  CHECK(offsets(Ink{.seed = 5}) == offsets(Ink{.seed = 5}));
  CHECK(offsets(Noise{.seed = 5}) != offsets(Noise{.seed = 6}));
  CHECK(offsets(Ink{.seed = 5}) != offsets(Ink{.seed = 6}));
}

TEST_CASE("a wave is a sine of its amplitude", "[texture]") {
  const DetailSample sample = sample_of(make_library(Wave{40, 3}));
  CHECK(sample.length == 40);
  CHECK(harmonic(sample.offsets.col(1), 1) == Approx(3 / std::numbers::sqrt2).epsilon(1e-12));
  CHECK(sample.offsets.col(1).maxCoeff() == Approx(3).epsilon(1e-12));
}

TEST_CASE("saws and scallops are as high as asked, and turn on their radius and nowhere sharper", "[texture]") {
  struct Made {
    Texture texture;
    double height;
    double radius;
  };
  const std::vector<Made> made{{Saw{}, 6, 1},
                               {Saw{.wavelength = 50, .height = 12, .lean = 0.9, .radius = 2}, 12, 2},
                               {Saw{.lean = 1.0, .radius = 0.5}, 6, 0.5},
                               {Saw{.lean = 0.0, .radius = 0.5}, 6, 0.5},
                               {Scallop{}, 6, 1},
                               {Scallop{.wavelength = 40, .height = 20, .radius = 3}, 20, 3}};
  for (const Made& one : made) {
    const DetailSample sample = sample_of(make_library(one.texture));
    const Points points = on_straight_base(sample);
    const auto n = points.rows();
    // Between samples a rounding rises by less than its sagitta over an eighth of its turn.
    CHECK(points.col(1).maxCoeff() - points.col(1).minCoeff() == Approx(one.height).margin(0.02 * one.radius));
    const auto at = [&](Eigen::Index i) -> Point {
      Point point = points.row(((i % n) + n) % n);
      point.x() += sample.length * static_cast<double>(i < 0 ? -1 : i / n);
      return point;
    };
    double sharpest = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Point in = at(i) - at(i - 1);
      const Point out = at(i + 1) - at(i);
      const double turn = std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out));
      sharpest = std::max(sharpest, std::abs(turn) / (0.5 * (in.norm() + out.norm())));
    }
    CHECK(sharpest == Approx(1 / one.radius).epsilon(0.01));
  }
}

TEST_CASE("a saw leans as far as asked", "[texture]") {
  for (const double lean : {0.0, 0.3, 0.5, 0.8, 1.0}) {
    const Points points = on_straight_base(sample_of(make_library(Saw{.lean = lean, .radius = 0.05})));
    Eigen::Index peak = 0;
    Eigen::Index valley = 0;
    points.col(1).maxCoeff(&peak);
    points.col(1).minCoeff(&valley);
    const double gap = points(peak, 0) - points(valley, 0);
    CHECK(std::abs(std::remainder(gap / 24 - lean, 1.0)) < 0.02);
  }
}

TEST_CASE("a texture that cannot be is refused by the name of its parameter", "[texture]") {
  const auto is_named = [](const Texture& texture, const char* name) {
    return message_of<InvalidInput>([&] { make_library(texture); }).find(name) != std::string::npos;
  };
  CHECK(is_named(Noise{.shortest = 0}, "shortest"));
  CHECK(is_named(Noise{.shortest = 40}, "longest"));
  CHECK(is_named(Noise{.shortest = 1e-4}, "million"));
  CHECK(is_named(Wave{.amplitude = NAN}, "amplitude"));
  CHECK(is_named(Saw{.lean = 1.5}, "lean"));
  CHECK(is_named(Saw{.radius = 40}, "radius"));
  CHECK(is_named(Scallop{.height = 20}, "height"));
  CHECK(is_named(Scallop{.radius = 60}, "radius"));
  CHECK(is_named(Ink{.fine_wavelength = 300}, "fine_wavelength"));
}
