#pragma once

// Private to the loader and the writer: the CFF table and its Type 2 charstrings. Every read is checked, every offset
// has 64 bits, every loop has an end.

#include <optional>
#include <string>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/sfnt_tables.h"

namespace glyphs::sfnt {

/// An INDEX: objects one after another, found by their number.
struct CffIndex {
  View table;
  std::uint64_t begin = 0;  ///< where it stands in the table
  std::uint64_t end = 0;    ///< behind its last byte
  int count = 0;
  int offset_size = 1;

  /// Throws  Malformed if there is no such object, or if its offsets fall or leave the INDEX.
  View object(int number) const;
};

// ---- charstrings

/// Steps that one charstring, and all of a font together, may take: operands and operators, those of subroutines each
/// time they are called; beside them every point that is drawn counts as 16 of the font's. Some twenty times what the
/// largest fonts in use need; subroutines that call each other reach any number.
inline constexpr std::int64_t most_charstring_work = 1'000'000;
inline constexpr std::int64_t most_font_work = 300'000'000;

/// What a charstring draws: the base and an accent of the font, by their codes in the Standard Encoding.
struct CffAccent {
  fontcore::Point shift;  ///< of the accent, font units
  int base = 0;
  int accent = 0;
};

/// What a Type 2 charstring says.
struct Charstring {
  std::vector<fontcore::BezierContour> contours;  ///< each begins with a node; single points are left out
  std::vector<bool> is_closed_by_line;            ///< per contour: its last line is drawn, not implied
  std::optional<CffAccent> accent;                ///< endchar with four operands more
  std::optional<double> width;                    ///< as stored: less nominalWidthX; none means defaultWidthX
  bool has_hints = false;                         ///< stems or masks
  bool has_fractions = false;
  std::int64_t work = 0;
  std::string trouble;  ///< why it is not drawn, one line; then there are no contours
};

/// Interprets a charstring. Coordinates are exact: sums of 16.16 numbers; products, quotients and roots are rounded to
/// 1/65536.
///
/// What is wrong with it, `most_charstring_work` and more than `max_composed_points` points are its `trouble`. Left out
/// at the end, `endchar` and `return` are taken as said, as other readers do; surplus operands too.
///
/// Source  Adobe Technical Note 5177.
Charstring interpret(View code, const CffIndex& global_subroutines, const CffIndex& local_subroutines);

/// The outline with every coordinate rounded to a multiple of 1/65536, which charstrings can hold.
std::vector<fontcore::BezierContour> snap(const std::vector<fontcore::BezierContour>& contours);

/// The charstring of an outline with the fewest bytes that drawing operators without subroutines and flexes can do: no
/// hints, at most 48 operands at a time. `is_closed_by_line` may be empty.
///
/// Exact   every coordinate is a multiple of 1/65536.
/// Throws  Malformed, naming contour and point: a coordinate that is no such multiple, a coordinate or a step outside
///         -32768 to 32768, a handle of a quadratic, a contour that does not begin with a node.
Bytes encode_charstring(const std::vector<fontcore::BezierContour>& contours,
                        const std::vector<bool>& is_closed_by_line, std::optional<double> width);

/// The charstring of a glyph put together from two others of the font.
/// Throws  Malformed if a number does not fit.
Bytes encode_accented(const CffAccent& accent, std::optional<double> width);

// ---- the table

/// One operator of a DICT with its operands.
struct CffEntry {
  int op = 0;  ///< 0x0C00 more for those of two bytes
  std::vector<double> operands;
  std::vector<View> operand_bytes;
  View bytes;  ///< operands and operator
};
using CffDict = std::vector<CffEntry>;

/// The INDEX at a place of the table; only its first and last offset are looked at.
/// Throws  Malformed, saying `what` it is.
CffIndex open_index(View table, std::uint64_t at, const char* what);
inline constexpr int last_cff_operator = 21;   ///< of one byte
inline constexpr int last_cff2_operator = 24;  ///< vsindex, blend and vstore come there
/// Throws  Malformed, saying `what` it is.
CffDict read_dict(View bytes, const char* what, int last_operator = last_cff_operator);

/// What belongs to the glyphs of one Font DICT, or of the whole font if it is not CID-keyed.
struct CffFontDict {
  CffIndex local_subroutines;
  double default_width = 0.0;  ///< of charstrings that say none
  double nominal_width = 0.0;  ///< what others count from
  fontcore::Affine matrix;     ///< from charstrings to font units
  bool is_scaled = false;      ///< the matrix is not the identity
};

/// A CFF table, opened.
///
/// A FontMatrix is honoured as FreeType does: that of the Top DICT but for its size, which is `unitsPerEm`; those of
/// Font DICTs against it.
///
/// Source  Adobe Technical Note 5176.
class CffTable {
 public:
  /// Throws  Malformed: an INDEX or a DICT that leaves the table, no charstrings, charstrings of Type 1.
  CffTable(View table, int units_per_em);

  int glyph_count() const { return charstrings_.count; }
  bool is_cid_keyed() const;
  const CffIndex& charstrings() const { return charstrings_; }
  const CffIndex& global_subroutines() const { return global_subroutines_; }
  /// Throws  Malformed if FDSelect names none.
  const CffFontDict& font_dict(int glyph) const;
  /// What the glyph's charstring says, in font units. Whatever is wrong is its trouble.
  Charstring read(int glyph) const;
  /// Glyph ids by code of the Standard Encoding, for accented glyphs; -1 where the font has none.
  /// Throws  Malformed: a charset that leaves the table.
  std::vector<int> standard_glyphs() const;

  /// The table with other charstrings for some glyphs, and with another box if one is given. All else stays byte for
  /// byte, but for offsets.
  /// Throws  Malformed if structures overlap so that one cannot grow.
  Bytes rewritten(const std::map<int, Bytes>& charstrings, const std::optional<Box>& box) const;

 private:
  struct Private {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
    CffDict dict;
  };
  CffFontDict open_font_dict(const CffDict& dict, const CffDict& top, int units_per_em) const;
  std::optional<Private> open_private(const CffDict& dict) const;
  void open_selection(std::uint64_t at);

  View table_;
  CffIndex top_dicts_;
  CffIndex global_subroutines_;
  CffIndex charstrings_;
  CffIndex font_dict_index_;  // empty unless CID-keyed
  CffDict top_;
  std::vector<CffFontDict> font_dicts_;
  std::vector<std::uint8_t> selection_;  // Font DICT by glyph; empty unless CID-keyed
};

/// Gives every glyph of the font its outline from the table: contours or components, hints, troubles. Works on several
/// threads; the result is the same for every number of them. `most_font_work` is spent glyph by glyph: those behind it
/// are in trouble.
void read_cff_outlines(Font& font, const CffTable& table);

/// What a new table is made of. The first glyph is called .notdef whatever its name, as the format wants it.
struct NewCff {
  std::string name;  ///< PostScript name of the font
  int units_per_em = 1000;
  Box box;
  std::vector<std::string> names;                              ///< by glyph id, each once
  std::vector<std::vector<fontcore::BezierContour>> outlines;  ///< lines and cubics
  std::vector<int> advances;
};

/// A table without hints and subroutines; widths are told from the values that take the fewest bytes. It is name-keyed;
/// where there are more names than the format has numbers for (64,999 with the standard ones), CID-keyed by glyph ids,
/// without names.
///
/// Throws  Malformed, naming the glyph: an outline that no charstring can hold; lists of other lengths.
Bytes build_cff(const NewCff& font);

/// The box of the curves, rounded outward, as head and FontBBox of CFF fonts count it; none if nothing is drawn.
/// Throws  Malformed if it does not fit in 16 bits.
std::optional<Box> drawn_box(const std::vector<fontcore::BezierContour>& contours);

/// Looks through what a CFF2 table says of variations before a library reads it: libraries weigh every region of a list
/// for every glyph anew.
///
/// Throws  Malformed: a Top DICT or a variation store that leaves the table, more regions in a list than a charstring
///         has room to blend by (512), over a thousand million steps for all glyphs.
/// Source  OpenType: CFF2.
void check_cff2_variations(View table, int glyph_count);

}  // namespace glyphs::sfnt
