#pragma once

#include <map>
#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// A place in the design space of a variable font: axis tag -> value, as a designer gives them. Axes not named are at
/// their default.
using Location = std::map<std::string, double>;

/// A place as text: "wght=650,wdth=80".
/// Throws  RequestError: not of that form, an axis twice, not a number.
Location parse_location(const std::string& text);

/// A static font, and what it could not take over from the variable one, a line each.
struct Instance {
  Bytes data;
  std::vector<std::string> warnings;
};

/// A variable font at one place of its design space, as a static font: what the variations of its outlines, metrics,
/// `MVAR`, GPOS and GDEF come to there, in whole numbers, rounded half up; features that are substituted there are so
/// for good.
///
/// Of TrueType advances and bearings come from the phantom points of `gvar`; instructions stay, with the `cvt ` of the
/// place. CFF2 becomes `CFF ` without hints: advances come from `HVAR`, heights from `VVAR`, left side bearings are
/// xMin, top ones count from the vertical origins of the place; a glyph that cannot be read comes out empty. Over
/// 64,000 glyphs lose the names that `post` had, as `CFF ` has no room for them. The
/// tables of the variations are gone, all others are copied; OS/2 has the weight and width class of the place, `post`
/// its slant. `name` and `STAT` stay as they are. What is decoded is checked and budgeted.
///
/// Throws  FontReadError, one line naming the file: not variable; an axis that it does not have, or a value outside the
///         axis (naming the axes there are); outlines neither of TrueType nor of CFF2; tables that contradict each
///         other; a coordinate that leaves 16 bits.
/// Source  OpenType: fvar, avar, gvar, cvar, HVAR, VVAR, VORG, MVAR, CFF2, Font Variations Common Table Formats.
Instance instantiate(const std::string& path, const Bytes& data, int face_index, const Location& location);

}  // namespace glyphs
