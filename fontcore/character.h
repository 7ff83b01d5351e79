#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "fontcore/detail.h"
#include "fontcore/outline_curve.h"

namespace fontcore {

/// How detail is laid on an outline.
struct CharacterOptions {
  double gain = 1.0;
  bool adds = false;          ///< to the outline's own detail below the scale, instead of replacing it
  bool mirrors = false;       ///< samples run the other way
  std::uint64_t seed = 0;     ///< of phases and of the choice among samples; arcs differ by themselves
  double unit = 1.0;          ///< font units that a unit of the library's em is long
  double amount = 1.0;        ///< share of the displacement that is applied: 0 is the identity
  double finest = 0.0;        ///< features of the library shorter than this are left out, font units
  bool spares_lines = false;  ///< lines longer than half the scale stay as they are
  bool holds_joins = false;   ///< smooth joins stay where they are
  std::vector<int> held;      ///< points of the contour that stay, and with a handle all of its segment
  std::vector<Point> quiet;   ///< places with no detail within a quarter of the scale, and all of it from half of it on
  InkSide ink = InkSide::Left;
  std::string place;           ///< of the contour, as `extract_detail` has it
  std::optional<double> area;  ///< signed area the contour is to have
};

/// An outline with detail laid on it: where nothing was laid, its own segments bit for bit; else short cubics.
struct Character {
  BezierContour contour;
  std::vector<int> came_from;  ///< per point its index in the source, -1 if it is new
  std::vector<int> kept;       ///< segments that are the source's own
  int arcs = 0;                ///< that have new detail
  int too_short = 0;           ///< arcs without room for two fades: they stay as they are
  double base_move = 0.0;      ///< largest move of any arc's base on the shared parameter, font units
  double largest = 0.0;        ///< largest displacement of the outline, font units
  std::string area_failed;     ///< why the area is not met; empty if it is or was not asked
};

/// Lays detail along every arc of an outline, by arc length of its base.
///
/// Samples keep their size: where whole tiles of one need to be stretched by no more than 4 %, tiles; else pieces cut
/// from samples, joined by cross-fades of half the scale where they agree best. The detail fades to nothing over half
/// the scale at corners and wherever something is held. The base of every arc stays: all that is laid, or taken away,
/// is orthogonal to its space, with the fades; so is the correction that gives the area back. Where that space has no
/// room for it the outline moves along its normals, with a gain of 0 by as little as it takes, else by no more than
/// 0.05/1000 em: a contour that would need more stays as it is.
///
/// Exact   corners, held stretches and arcs without detail bit for bit; the area to 1e-12; a gain of 0 with `adds` is
///         the identity.
/// Throws  InvalidInput if the library has no sample, or a number is not finite or not positive.
/// Source  [FS94] editing the character of a curve, orientation of detail.
Character apply_detail(const OutlineArcs& outline, const DetailLibrary& library, const CharacterOptions& options = {});

}  // namespace fontcore
