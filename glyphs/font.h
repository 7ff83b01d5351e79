#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fontcore/contour.h"

namespace glyphs {

using Bytes = std::vector<unsigned char>;
/// The regular files of a folder, by their path within it: "glyphs/A_.glif".
using Folder = std::map<std::string, Bytes>;

/// What a composite may come to; beyond it the glyph is in trouble. The same as other readers'.
inline constexpr int max_component_depth = 32;
inline constexpr int max_composed_points = 65535;  ///< and as many components
inline constexpr double max_coordinate = 1e6;      ///< of any point, either way; font units
/// What all composites of a font may come to, together: every point and component once for every level that it is
/// placed through, and points counted off to be matched. More than the largest fonts made of components have, and
/// composed in about a second.
inline constexpr int max_composed_work = 1 << 23;

/// One part of a composite glyph: another glyph, placed.
///
/// The part's points are mapped by `placement.linear`, then shifted by `placement.shift`; or, if `matched_parent` is
/// not negative, shifted so that point `matched_child` of the part falls on point `matched_parent` of what is composed
/// so far.
struct Component {
  int glyph = 0;
  fontcore::Affine placement;
  int matched_parent = -1;  ///< point number, counted as in the font: implied nodes do not count
  int matched_child = -1;
  bool use_my_metrics = false;
};

/// What a designer has marked on a contour in the source; every edit honours it.
struct ContourMarks {
  std::vector<int> corners;     ///< points that are corners however little they turn; indices, sorted
  std::vector<int> frozen;      ///< points that stay where they are; indices, sorted
  std::optional<double> scale;  ///< length below which features go, instead of a smooth step's own; font units
};

/// A glyph as the font stores it: contours of its own, or components; in a UFO also both.
struct Glyph {
  int id = 0;
  std::string name;      ///< unique within the font
  double advance = 0.0;  ///< font units
  double origin = 0.0;   ///< x of what the advance counts from: a point is drawn at x - origin; nearly always 0
  std::vector<fontcore::BezierContour>
      contours;  ///< the font's own points and their order; they come before components
  std::vector<Component> components;
  std::vector<ContourMarks> marks;       ///< one a contour; empty if nothing is marked
  std::vector<fontcore::Point> anchors;  ///< of a UFO: where its anchors stand, in the order of the file
  bool has_instructions = false;         ///< of TrueType
  bool has_hints = false;                ///< of CFF: stems or masks; not looked for in CFF2
  std::string trouble;  ///< why it cannot be drawn, one line; then it has neither contours nor components

  bool is_composite() const { return !components.empty(); }
};

enum class OutlineFormat { TrueType, Cff, Cff2, None, Ufo };

/// What the file was, before its bytes became an sfnt.
enum class Container { Sfnt, Woff, Woff2 };

/// A font as plain values, in font units, y up, that know no file format; `data` is the file it came from.
struct Font {
  std::string path;
  int face_index = 0;
  bool is_collection = false;
  bool is_variable = false;
  int units_per_em = 0;
  double ascender = 0.0;
  double descender = 0.0;
  std::string family;
  std::string style;
  OutlineFormat format = OutlineFormat::None;
  std::vector<Glyph> glyphs;              ///< by glyph id
  std::map<char32_t, int> character_map;  ///< Unicode code point -> glyph id
  std::shared_ptr<const Bytes> data;      ///< the whole file, bit for bit; of a web font what it packs, of an
                                          ///< instance the static font; none for a UFO
  Container container = Container::Sfnt;
  std::vector<std::string> warnings;        ///< what reading could not carry over, a line each
  std::shared_ptr<const Folder> folder;     ///< of a UFO: all its files, bit for bit
  bool has_fractional_coordinates = false;  ///< operands of a CFF, points of a UFO

  /// Glyph id of a name; -1 if there is none.
  int find(const std::string& name) const;
  /// True if the glyph draws anything: contours of its own, or of its components.
  bool has_outline(int glyph) const;
};

/// The names of glyphs, in the order of the ids.
std::vector<std::string> glyph_names(const Font& font, const std::vector<int>& ids);

/// Two-sided distance allowed between an outline and its model, of the em.
constexpr double model_tolerance = 0.25e-3;

/// The outline of a glyph as it is drawn: its components put in place, in doubles (FreeType would round scaled ones),
/// and the whole shifted so that its origin is at 0.
///
/// Throws  FontReadError on a glyph in trouble, a component cycle, nesting deeper than `max_component_depth`, a point
///         match out of range, or more than `max_composed_points` points, naming file and glyph.
std::vector<fontcore::BezierContour> compose(const Font& font, int glyph);

/// What editing a composite means: nothing, or the glyph with its components' contours in place of them.
enum class Composites { Refuse, Decompose };

/// A glyph's contours as the font would store them if it had no components: `compose`, in the glyph's own place,
/// rounded half up to whole numbers. Points keep their numbers. Throws  as compose.
std::vector<fontcore::BezierContour> decompose(const Font& font, int glyph);

/// Glyph ids whose outline changes when the given glyphs' own contours do: they, and every composite that uses them,
/// sorted.
std::vector<int> dependents(const Font& font, const std::vector<int>& glyphs);

/// Finds the composites that cannot be composed, before anything tries, and gives them their `trouble`: a part that is
/// no glyph of the font or in trouble itself, a cycle, a point match out of range, more than the limits above. Children
/// come before parents, so that neither depth nor shared parts cost more than one visit of every component.
void check_composites(Font& font);

/// For every glyph the first one whose own contours are the same, bit for bit, with the same origin: fonts draw spaces,
/// letters of several scripts and, if damaged, whole ranges by one outline.
std::vector<int> first_alike(const Font& font);

/// Points that a file holds; implied nodes follow from their handles.
std::int64_t stored_points(const fontcore::BezierContour& contour);
std::int64_t stored_points(const std::vector<fontcore::BezierContour>& contours);

/// Points that the file stores for glyphs: outlines that are alike counted once, and never more than a quarter of the
/// file's bytes, whatever a damaged one claims. What budgets of work are counted in.
std::int64_t drawn_points(const Font& font, const std::vector<int>& glyphs);

/// The first composite that places parts by matching points whose numbers count those of the glyph; -1 if none does. If
/// the glyph had other points, other ones would be matched.
int matched_in(const Font& font, int glyph);

}  // namespace glyphs
