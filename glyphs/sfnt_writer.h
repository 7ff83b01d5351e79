#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/jobs.h"

namespace glyphs {

/// A font ready to be written, and what was done to it beyond the outlines.
struct WrittenFont {
  Bytes data;
  std::optional<Folder> folder;             ///< of a UFO: all its files, instead of `data`
  std::vector<std::string> changed_tables;  ///< rebuilt, other bytes than before; of a UFO its files; sorted
  std::vector<std::string> dropped_tables;  ///< made void by the edit: DSIG, hdmx, LTSH, VDMX; sorted
  std::vector<int> dropped_instructions;    ///< glyphs whose TrueType instructions are gone: edited ones, and
                                            ///< composites in which points have other numbers now; sorted
  std::vector<int> dropped_hints;           ///< edited CFF glyphs whose hints are gone; sorted
  std::vector<int> moved_composites;        ///< composites whose box follows an edited component; sorted
  std::vector<int> decomposed;              ///< edited composites, which are simple glyphs now; sorted
  std::map<int, std::string> emptied;       ///< glyphs for which sanitizers refuse the whole font, and why; they have
                                            ///< no outline now
  std::vector<std::string> warnings;        ///< what is kept though it may no longer match, a line each
};

/// Edited outlines, by glyph id: as many contours, of the font's structure or another. Coordinates are whole numbers;
/// in CFF fonts they may have fractions, which are written in steps of 1/65536.
using EditedGlyphs = std::map<int, std::vector<fontcore::BezierContour>>;

/// Advances, by glyph id; whole numbers from 0 to 65535 in an sfnt.
using Advances = std::map<int, double>;

/// By how much each component of a composite is moved, by glyph id; a component placed by matched points by nothing.
using ComponentShifts = std::map<int, std::vector<fontcore::Point>>;

/// Where each anchor of a glyph of a UFO is to stand, by glyph id.
using AnchorPlaces = std::map<int, std::vector<fontcore::Point>>;

/// For every point of an edited contour the index it had in the font's, rising, -1 if it is new: by glyph and contour.
using PointOrigins = std::map<int, std::vector<std::vector<int>>>;

struct WriteOptions {
  Composites composites = Composites::Refuse;  ///< what an edited composite means
  std::vector<int> overlapping;                ///< edited glyphs that are to have the overlap flag; sorted
  PointOrigins origins;                        ///< where points have come from; of a UFO, which keeps their names
  Advances advances;                           ///< other ones than the font has
  ComponentShifts component_shifts;            ///< of composites that are not edited themselves
  AnchorPlaces anchors;                        ///< of a UFO
  bool is_checked = false;                     ///< looked through for faults even if nothing is edited
};

/// The font with the given glyphs' outlines replaced and nothing else changed; of a collection the one face, as a
/// single font.
///
/// `glyf` and `loca`, or `CFF `, and `hmtx`, `vmtx`, `head`, `hhea`, `vhea` and `maxp` follow the outlines; every other
/// table is copied byte for byte. A glyph not edited keeps its bytes; a composite that uses an edited one changes in
/// its box alone (of CFF, an accented letter put together by `endchar`, in nothing). Overlap flags are kept,
/// instructions and CFF hints of edited glyphs dropped; where points have other numbers, instructions of composites
/// too. Left side bearings move with xMin and top side bearings with yMax, so that every outline stays at its origins.
/// Advances change where the options say so, and with them hhea.advanceWidthMax, OS/2.xAvgCharWidth and widths in CFF;
/// offsets of components too, in whole numbers, with unscaled offsets where they were scaled. Same input, same bytes:
/// head.modified changes only if SOURCE_DATE_EPOCH is set. With nothing edited the file itself comes back, bit for bit,
/// and of a collection all tables of the face. The result has been read again and compared before it is returned,
/// charstrings by FreeType too.
///
/// Whatever is edited, or is to be checked, comes out as a font that sanitizers (OTS, that of browsers) accept. A glyph
/// for which they refuse the whole font, because its bytes end early, its component does not exist or its charstring
/// has no end, comes out empty, and is named; its metrics stay, and so do composites of it.
///
/// A composite that is edited and may be decomposed becomes a simple glyph of the contours given: those that
/// `decompose` gives, changed. Where its parts are edited too, it has what it is given and none of their changes. It
/// has the overlap flag if it had the one of composites, or if a part has it.
///
/// Throws  FontWriteError: neither TrueType nor CFF (CFF2), variable, a coordinate that is no whole number or leaves 16
///         bits, another number of contours, a cubic in TrueType or a quadratic in CFF, a glyph drawn through a
///         FontMatrix, other points in a glyph whose points a composite matches by their numbers, a composite among the
///         edited that is not to be decomposed, a table for which sanitizers refuse the font, a size over the format's
///         limits, a result that does not read back. Names file and glyph.
WrittenFont write_sfnt(const Font& font, const EditedGlyphs& edited, const WriteOptions& options = {});

/// Refuses, before any work on its glyphs, a font that `write_sfnt` would refuse for a table; a UFO has none.
///
/// Throws  FontWriteError naming file and tables.
void refuse_at_fault(const Font& font);

/// Outlines of all glyphs, by id.
using GlyphOutlines = std::vector<std::vector<fontcore::BezierContour>>;

/// A TrueType font as an OpenType font with CFF outlines of lines and cubics, in steps of 1/65536; or a CFF font as a
/// TrueType font with outlines of lines and quadratics on whole numbers, composites none.
///
/// `glyf`, `loca` and what belongs to TrueType instructions go, or `CFF ` with its hints and `VORG`; the names of
/// glyphs move between `CFF ` and `post`; `maxp`, `hmtx`, `vmtx`, `head`, `hhea` and `vhea` follow; every other table
/// is copied byte for byte. Every outline stays at its origins. The result has been read again and compared before it
/// is returned, charstrings by FreeType too.
///
/// Throws  FontWriteError: outlines of neither kind, variable, a table for which sanitizers refuse the font, a
///         coordinate that does not fit, a result that does not read back. Names file and glyph.
WrittenFont write_as_cff(const Font& font, const GlyphOutlines& outlines);
WrittenFont write_as_truetype(const Font& font, const GlyphOutlines& outlines);

/// Why an outline would be none that readers of charstrings, or of `glyf`, take; empty if they do.
std::string why_no_charstring(const std::vector<fontcore::BezierContour>& outline);
std::string why_no_truetype(const std::vector<fontcore::BezierContour>& outline);

}  // namespace glyphs
