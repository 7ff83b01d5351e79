#pragma once

#include <cstdint>
#include <string>
#include <variant>

#include "fontcore/detail.h"

/// Detail that follows a rule instead of a hand: a few parameters make a library.
///
/// All lengths are thousandths of the em. Offsets are away from the ink; those of a saw or a scallop are also along the
/// base, so that flanks as steep as one likes are sampled as finely as flat stretches.
namespace fontcore::texture {

/// Roughness without a preferred size: equal power in every octave between two wavelengths, none outside.
struct Noise {
  double shortest = 9.0;
  double longest = 36.0;
  double amplitude = 1.5;  ///< root mean square
  std::uint64_t seed = 1;
};

/// A sine.
struct Wave {
  double wavelength = 30.0;
  double amplitude = 2.5;  ///< peak
};

/// Teeth of two straight flanks, their corners rounded by arcs of a radius.
struct Saw {
  double wavelength = 24.0;
  double height = 6.0;  ///< from valley to peak, after rounding
  double lean = 0.5;    ///< where the sharp peak stands in the wavelength: 0.5 is even, 0 and 1 upright
  double radius = 1.0;
};

/// Round bulges side by side, the notches between them rounded by arcs of a radius.
struct Scallop {
  double wavelength = 30.0;
  double height = 6.0;  ///< from notch to peak, after rounding; up to half the wavelength
  double radius = 1.0;
};

/// The edge of ink that spread on paper: broad uneven bulges with narrow hollows between them, and fine smooth noise.
struct Ink {
  double wavelength = 30.0;      ///< of the bulges, most of them within a fifth; their hollows go down to 5/12 of it
  double amplitude = 1.4;        ///< root mean square of the bulges
  double fine_wavelength = 8.0;  ///< of the noise, within a fifth
  double fine_amplitude = 0.25;  ///< root mean square of the noise
  std::uint64_t seed = 1;
};

using Texture = std::variant<Noise, Wave, Saw, Scallop, Ink>;

/// The library of a texture, named after its kind unless told: one closed sample, DetailFrame::Tangent.
///
/// A regular pattern is one period; an irregular one a run of at least 4000. Steps are at most a sixteenth of the
/// shortest wavelength and an eighth of every rounding. The scale is 2.5 times the longest wavelength, so that nothing
/// of it belongs to the base.
///
/// Exact   amplitude, heights and zero mean to rounding; band limits too; the same texture gives the same bits.
/// Throws  InvalidInput, naming the parameter, if lengths are not positive or out of order, if a radius does not fit
///         between the flanks, or if a run would need more than a million steps.
DetailLibrary make_library(const Texture& texture, const std::string& name = {});

}  // namespace fontcore::texture
