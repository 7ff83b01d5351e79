#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/sfnt_writer.h"

namespace glyphs {

/// What becomes of advances and sidebearings where the ink of glyphs has another width.
///
/// Glyphs without advance, marks, keep it, and the middle of their ink stays; but by `Scale` its place follows too.
enum class AdvancePolicy : std::uint8_t {
  Keep,          ///< advances stay, and the middle of the ink
  Sidebearings,  ///< both sidebearings stay: the advance grows by what the ink grows by
  /// Every advance and the place of the middle of every glyph's ink are multiplied by one ratio: that of the widths of
  /// the ink of all edited glyphs with an advance, together, after to before. Sidebearings take what is left. Advances
  /// that were equal stay equal.
  Scale,
  Learnt  ///< each sidebearing grows by what is given for it, and the advance by that and by what the ink grows by
};

/// The policy of a name: keep, sidebearings, scale, learnt.
/// Throws  RequestError.
AdvancePolicy advance_policy(const std::string& name);
/// The name of a policy.
const char* name_of(AdvancePolicy policy);

/// By how much the sidebearings of a glyph grow; font units.
struct SideGrowth {
  double left = 0.0;
  double right = 0.0;
};

/// Edited glyphs on their advances, and all that follows from that.
struct Spacing {
  EditedGlyphs outlines;             ///< those given, each moved sideways as a whole, by whole units
  Advances advances;                 ///< those that change
  ComponentShifts component_shifts;  ///< of composites whose parts must move against each other
  AnchorPlaces anchors;              ///< of a UFO: those that move
  double ratio = 1.0;                ///< by `Scale`
  std::vector<int> kept_composites;  ///< whose advance would follow, but which place parts by points; sorted
};

/// True if the font says that it is monospaced (post.isFixedPitch), or if all glyphs with an advance have the same one.
bool is_monospaced(const Font& font);

/// Places edited glyphs on their advances.
///
/// Composites follow. One has the advance of a part whose metrics it uses, or that it stands on unmoved and had the
/// advance of; else its advance grows with its ink. Of two parts over each other, by half of the narrower one's width
/// at least, the one keeps its middle on that of the other; of two beside each other, the gap stays. A glyph of a UFO
/// that has contours and components at once keeps its advance.
///
/// Anchors of a UFO are moved by the map that takes origin, left and right of the ink and advance from where they were
/// to where they are now, linear in between, and upwards by bottom and top of the ink, outside as the nearer of them.
///
/// `edited` hold whole-number outlines, the middle of whose ink is where it was. `only` says which glyphs are worked on
/// at all, edited or not; none: all.
///
/// Units   font units; advances, shifts and places are whole numbers, but those of anchors and components that were
///         none.
/// Throws  RequestError if the font is monospaced and its advances would become unequal: by `Sidebearings` and
///         `Learnt`, and by `Scale` unless all glyphs are worked on.
Spacing space(const Font& font, EditedGlyphs edited, AdvancePolicy policy, const std::map<int, SideGrowth>& growth = {},
              const std::optional<std::vector<int>>& only = {});

}  // namespace glyphs
