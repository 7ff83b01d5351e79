#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/sfnt_writer.h"

namespace glyphs {

/// Our key in the lib of a glyph's object (`public.objectLibs`), by which a point or a contour is marked.
inline constexpr const char* marks_key = "org.glyphwave.marks";

/// The files of a UFO of version 3, 2 or 1 as plain values: the glyphs of its default layer in the order of
/// `public.glyphOrder`, then the rest by name. Closed contours of two points or more are its outlines; open ones and
/// single points are kept in the files alone. Marks are those under `marks_key`.
///
/// A glyph whose file cannot be read has its `trouble` named; the font is still good. Without a number of units per em
/// there are 1000, without ascender and descender 0.8 and -0.2 of them.
///
/// Throws  FontReadError, one line naming the UFO and the file in it: metainfo, layers, contents, lib or fontinfo
///         missing or malformed, a version that is not known, names that lead out of the folder.
Font load_ufo(const std::string& path, Folder folder);

/// A UFO ready to be written, and what there is to know about it.
struct WrittenUfo {
  Folder folder;
  std::vector<std::string> changed_files;  ///< other bytes than before; sorted
  std::vector<int> moved_composites;       ///< composites that are drawn otherwise now; sorted
  std::vector<int> decomposed;             ///< edited composites, which have contours alone now; sorted
  std::vector<std::string> warnings;       ///< what is kept though it may no longer match, or is left out; a line each
};

/// The UFO that the font was read from, with the given glyphs' outlines replaced and nothing else changed.
///
/// In an edited glyph's file only the coordinates of moved points change, digit by digit; names, identifiers, flags,
/// order, layout, comments and all that is not known stay. Where a contour has other points now, those that stayed
/// keep their elements and new ones are laid out like them; which stayed is told by the options' origins, else by their
/// places. A composite that may be decomposed becomes contours, in the place of its components, which go; else its own
/// contours are edited, if it has any, and its components stay. Hints are kept: their id no longer matches the outline,
/// by which they are known as stale. Advances, offsets of components and anchors are others where the options say so;
/// there too only digits change. With nothing edited every file is bit for bit the same. The result has been read
/// again and compared before it is returned.
///
/// Throws  FontWriteError: not a UFO, another number of contours, a glyph in trouble or without outline of its own, an
///         implied node not midway between its handles, a coordinate over `max_coordinate`, a result that does not
///         read back. Names glyph and file.
WrittenUfo write_ufo(const Font& font, const EditedGlyphs& edited, const WriteOptions& options = {});

/// Bytes of every glyph's file in a folder that holds the font's glyphs, by glyph id; 0 where there is none.
///
/// Throws  FontReadError if the folder's list of glyphs cannot be read.
std::vector<std::int64_t> glif_bytes(const Font& font, const Folder& folder);

/// A UFO 3 made from the tables of a TTF or an OTF: outlines, metrics, names, characters, order and font info.
///
/// Quadratics become qcurves with implied points left out, cubics curves; points and their order are the font's own, a
/// node is smooth where its tangents agree to rounding. Components keep their matrices; matched points become offsets.
/// What a UFO would hold as source (layout, kerning, hints, colour) is not taken out of its tables: the warnings name
/// them. A glyph in trouble is named and comes out empty. Same font, same bytes.
///
/// Throws  FontWriteError if the font was not read from an sfnt, or has no units per em or glyphs.
WrittenUfo build_ufo(const Font& font);

}  // namespace glyphs
