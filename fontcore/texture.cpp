#include "fontcore/texture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "fontcore/error.h"

namespace fontcore::texture {

namespace {

using std::numbers::pi;

constexpr double scale_of_longest = 2.5;  // a base of spans of half the scale follows no wave this much shorter
constexpr double least_run = 4000.0;      // an irregular run is longer than most contours
constexpr double least_waves = 64.0;      // and holds this many of its longest waves
constexpr double steps_per_wave = 16.0;   // of the shortest: straight lines between them are within 2 % of its peak
constexpr double steps_per_rounding = 8.0;
constexpr double most_steps = 1e6;
constexpr double band = 1.2;        // an ink's bulges and noise have wavelengths within this factor
constexpr double hollowness = 0.3;  // square of the bulges taken off them: broad tops, narrow hollows

void require(bool holds, const char* kind, const char* name, double value, const char* what) {
  if (!holds) throw InvalidInput(text("texture ", kind, ": ", name, " ", value, " ", what));
}

void require_length(const char* kind, const char* name, double value) {
  require(value > 0.0 && std::isfinite(value), kind, name, value, "is not a positive length");
}

DetailLibrary library_of(const char* kind, const std::string& name, double longest, double length, Points offsets) {
  DetailLibrary library;
  library.name = name.empty() ? kind : name;
  library.scale = scale_of_longest * longest;
  DetailSample sample;
  sample.length = length;
  sample.is_closed = true;
  sample.offsets = std::move(offsets);
  library.samples.push_back(std::move(sample));
  return library;
}

// A long closed run of n steps, by its harmonics.
class Run {
 public:
  Run(const char* kind, double shortest, double longest) : length_(std::max(least_run, least_waves * longest)) {
    const double steps = std::ceil(steps_per_wave * length_ / shortest);
    require(steps <= most_steps, kind, "shortest wavelength", shortest, "needs more than a million steps");
    n_ = 4 * ((static_cast<std::int64_t>(steps) + 3) / 4);  // quarters: the sine is the cosine's table too
    cosine_.resize(static_cast<std::size_t>(n_));
    for (std::int64_t i = 0; i < n_; ++i) {
      cosine_[static_cast<std::size_t>(i)] = std::cos(2.0 * pi * static_cast<double>(i) / static_cast<double>(n_));
    }
  }

  double length() const { return length_; }

  /// Noise of equal power in every octave, of mean square 1.
  Eigen::VectorXd noise(double shortest, double longest, std::mt19937_64& engine) const {
    Eigen::VectorXd values = Eigen::VectorXd::Zero(n_);
    for (std::int64_t k = first(longest); k <= last(shortest); ++k) {
      // A normal deviate of two dimensions, by Box and Muller: the library's own distributions differ between systems.
      const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(engine))) / std::sqrt(static_cast<double>(k));
      const double angle = 2.0 * pi * uniform(engine);
      add(values, k, radius * std::cos(angle), radius * std::sin(angle));
    }
    return values / root_mean_square(values);
  }

  /// What lies between two wavelengths.
  Eigen::VectorXd within(const Eigen::VectorXd& values, double shortest, double longest) const {
    Eigen::VectorXd kept = Eigen::VectorXd::Zero(n_);
    for (std::int64_t k = first(longest); k <= last(shortest); ++k) {
      double a = 0.0;
      double b = 0.0;
      for (std::int64_t i = 0, at = 0; i < n_; ++i, at = (at + k) % n_) {
        a += values[i] * cosine(at);
        b += values[i] * sine(at);
      }
      add(kept, k, 2.0 * a / static_cast<double>(n_), 2.0 * b / static_cast<double>(n_));
    }
    return kept;
  }

  static double root_mean_square(const Eigen::VectorXd& values) {
    return values.norm() / std::sqrt(static_cast<double>(values.size()));
  }

 private:
  // Harmonics of wavelengths within a band: those of a run of many waves come as near to its ends as one likes.
  std::int64_t first(double longest) const { return static_cast<std::int64_t>(std::ceil(length_ / longest - 1e-9)); }
  std::int64_t last(double shortest) const { return static_cast<std::int64_t>(std::floor(length_ / shortest + 1e-9)); }
  double cosine(std::int64_t at) const { return cosine_[static_cast<std::size_t>(at)]; }
  double sine(std::int64_t at) const { return cosine((at + 3 * (n_ / 4)) % n_); }
  void add(Eigen::VectorXd& values, std::int64_t k, double a, double b) const {
    for (std::int64_t i = 0, at = 0; i < n_; ++i, at = (at + k) % n_) values[i] += a * cosine(at) + b * sine(at);
  }
  static double uniform(std::mt19937_64& engine) { return static_cast<double>(engine() >> 11) * 0x1p-53; }

  double length_;
  std::int64_t n_ = 0;
  std::vector<double> cosine_;
};

Points away(const Eigen::VectorXd& values) {
  Points offsets = Points::Zero(values.size(), 2);
  offsets.col(1) = values;
  return offsets;
}

DetailLibrary make(const Noise& noise, const std::string& name) {
  require_length("noise", "shortest", noise.shortest);
  require_length("noise", "longest", noise.longest);
  require(noise.longest >= noise.shortest, "noise", "longest", noise.longest, "is below the shortest wavelength");
  require_length("noise", "amplitude", noise.amplitude);
  const Run run("noise", noise.shortest, noise.longest);
  std::mt19937_64 engine(noise.seed);
  return library_of("noise", name, noise.longest, run.length(),
                    away(noise.amplitude * run.noise(noise.shortest, noise.longest, engine)));
}

DetailLibrary make(const Ink& ink, const std::string& name) {
  require_length("ink", "wavelength", ink.wavelength);
  require_length("ink", "amplitude", ink.amplitude);
  require_length("ink", "fine_wavelength", ink.fine_wavelength);
  require(ink.fine_amplitude >= 0.0 && std::isfinite(ink.fine_amplitude), "ink", "fine_amplitude", ink.fine_amplitude,
          "is negative");
  const double longest = band * ink.wavelength;
  const double hollow = 0.5 * ink.wavelength / band;
  const double finest = ink.fine_wavelength / band;
  require(band * ink.fine_wavelength <= longest, "ink", "fine_wavelength", ink.fine_wavelength,
          "is longer than the bulges'");
  const Run run("ink", std::min(hollow, finest), longest);
  std::mt19937_64 engine(ink.seed);
  const Eigen::VectorXd swell = run.noise(ink.wavelength / band, longest, engine);
  // The square of a band reaches from twice its frequencies down to none: what is longer than the band belongs to the
  // base and goes.
  Eigen::VectorXd bulges = run.within(swell - hollowness * swell.cwiseAbs2(), hollow, longest);
  bulges *= ink.amplitude / Run::root_mean_square(bulges);
  if (ink.fine_amplitude > 0.0) {
    bulges += ink.fine_amplitude * run.noise(finest, band * ink.fine_wavelength, engine);
  }
  return library_of("ink", name, longest, run.length(), away(bulges));
}

DetailLibrary make(const Wave& wave, const std::string& name) {
  require_length("wave", "wavelength", wave.wavelength);
  require_length("wave", "amplitude", wave.amplitude);
  constexpr int steps = 64;
  Eigen::VectorXd values(steps);
  for (int i = 0; i < steps; ++i) values[i] = wave.amplitude * std::sin(2.0 * pi * i / steps);
  return library_of("wave", name, wave.wavelength, wave.wavelength, away(values));
}

// A line or an arc, run along: its length, and the turn to the left over it.
struct Piece {
  double length;
  double turn;
};

// One period of a pattern made of lines and arcs, from a heading on, at even steps of its own length; less the even
// steps along the base and less the mean.
Points pattern(const char* kind, double heading, const std::vector<Piece>& pieces, double wavelength) {
  double length = 0.0;
  double step = wavelength / steps_per_wave;
  for (const Piece& piece : pieces) {
    length += piece.length;
    if (piece.turn != 0.0) step = std::min(step, piece.length / steps_per_rounding);
  }
  require(length / step <= most_steps, kind, "wavelength", wavelength, "needs more than a million steps");
  const int n = static_cast<int>(std::ceil(length / step));
  Points offsets(n, 2);
  Point corner = Point::Zero();
  std::size_t on = 0;
  double begin = 0.0;
  const auto within = [&](const Piece& piece, double s) -> Point {
    const double turn = piece.turn * s / piece.length;
    const double middle = heading + 0.5 * turn;
    const double chord = std::abs(turn) < 1e-9 ? s : s * std::sin(0.5 * turn) / (0.5 * turn);
    return corner + chord * Point(std::cos(middle), std::sin(middle));
  };
  for (int i = 0; i < n; ++i) {
    const double s = length * i / n;
    while (on + 1 < pieces.size() && s > begin + pieces[on].length) {
      corner = within(pieces[on], pieces[on].length);
      heading += pieces[on].turn;
      begin += pieces[on].length;
      ++on;
    }
    offsets.row(i) = within(pieces[on], s - begin);
    offsets(i, 0) -= wavelength * i / n;
  }
  return offsets.rowwise() - offsets.colwise().mean().eval();
}

DetailLibrary make(const Saw& saw, const std::string& name) {
  require_length("saw", "wavelength", saw.wavelength);
  require_length("saw", "height", saw.height);
  require_length("saw", "radius", saw.radius);
  require(saw.lean >= 0.0 && saw.lean <= 1.0, "saw", "lean", saw.lean, "is not in [0, 1]");
  // The sharp teeth whose roundings are as high as asked: every rounding takes its height off them.
  double sharp = saw.height;
  double rise = 0.0;
  double fall = 0.0;
  const auto set_flanks = [&] {
    rise = std::atan2(sharp, saw.lean * saw.wavelength);
    fall = std::atan2(sharp, (1.0 - saw.lean) * saw.wavelength);
  };
  bool settles = false;
  for (int pass = 0; pass < 1000 && !settles && std::isfinite(sharp); ++pass) {
    set_flanks();
    const double taken = saw.radius * (std::cos(0.5 * (rise - fall)) / std::cos(0.5 * (rise + fall)) - 1.0);
    const double next = saw.height + 2.0 * taken;
    settles = std::abs(next - sharp) <= 1e-13 * next;
    sharp = next;
  }
  require(settles, "saw", "radius", saw.radius, "does not fit between the flanks");
  set_flanks();
  const double turn = rise + fall;
  const double cut = 2.0 * saw.radius * std::tan(0.5 * turn);
  const double up = std::hypot(sharp, saw.lean * saw.wavelength) - cut;
  const double down = std::hypot(sharp, (1.0 - saw.lean) * saw.wavelength) - cut;
  require(up > 0.0 && down > 0.0, "saw", "radius", saw.radius, "does not fit between the flanks");
  const double arc = saw.radius * turn;
  return library_of("saw", name, saw.wavelength, saw.wavelength,
                    pattern("saw", rise, {{up, 0.0}, {arc, -turn}, {down, 0.0}, {arc, turn}}, saw.wavelength));
}

DetailLibrary make(const Scallop& scallop, const std::string& name) {
  require_length("scallop", "wavelength", scallop.wavelength);
  require_length("scallop", "height", scallop.height);
  require_length("scallop", "radius", scallop.radius);
  const double half = 0.5 * scallop.wavelength;
  require(scallop.height <= half, "scallop", "height", scallop.height, "is above half the wavelength");
  // Both radii together, from the chord and the height of the two arcs that meet between notch and peak.
  const double radii = 0.5 * (half * half + scallop.height * scallop.height) / scallop.height;
  const double bulge = radii - scallop.radius;
  require(bulge > 0.0, "scallop", "radius", scallop.radius, "does not fit between the bulges");
  const double angle = 2.0 * std::asin(std::min(1.0, half / radii));
  return library_of(
      "scallop", name, scallop.wavelength, scallop.wavelength,
      pattern("scallop", 0.5 * angle, {{bulge * angle, -angle}, {scallop.radius * angle, angle}}, scallop.wavelength));
}

}  // namespace

DetailLibrary make_library(const Texture& texture, const std::string& name) {
  return std::visit([&](const auto& kind) { return make(kind, name); }, texture);
}

}  // namespace fontcore::texture
