#include "glyphs/freetype_loader.h"

#include <ft2build.h>
#include <hb-ot.h>
#include FT_FREETYPE_H
#include FT_ADVANCES_H
#include FT_MULTIPLE_MASTERS_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <set>

#include "glyphs/error.h"
#include "glyphs/sfnt_cff.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using fontcore::text;
using sfnt::Malformed;
using sfnt::tag;

/// Closes what a C library opened.
template <auto close>
struct Closer {
  template <typename Handle>
  void operator()(Handle* handle) const {
    close(handle);
  }
};
using Library = std::unique_ptr<FT_LibraryRec_, Closer<FT_Done_FreeType>>;
using Face = std::unique_ptr<FT_FaceRec_, Closer<FT_Done_Face>>;
using HbFont = std::unique_ptr<hb_font_t, Closer<hb_font_destroy>>;
using HbPen = std::unique_ptr<hb_draw_funcs_t, Closer<hb_draw_funcs_destroy>>;

constexpr int unscaled = FT_LOAD_NO_SCALE | FT_LOAD_NO_HINTING | FT_LOAD_NO_AUTOHINT | FT_LOAD_NO_BITMAP;

/// FreeType's words for an error; Debian builds it without FT_Error_String.
std::string reason(FT_Error error) {
  const char* words = "unknown error";
  switch (FT_ERROR_BASE(error)) {
#undef FTERRORS_H_
#define FT_ERROR_START_LIST
#define FT_ERRORDEF(name, value, meaning) \
  case value:                             \
    words = meaning;                      \
    break;
#define FT_ERROR_END_LIST
#include FT_ERRORS_H
  }
  return text("FreeType: ", words);
}

/// Seconds that this thread has worked: other programs on the machine do not count.
double thread_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Points to_points(const std::vector<Point>& list) {
  Points points(static_cast<Eigen::Index>(list.size()), 2);
  for (Eigen::Index i = 0; i < points.rows(); ++i) points.row(i) = list[static_cast<std::size_t>(i)];
  return points;
}

// ---- contours

/// The contours of a slot, `shift` added to every x.
std::vector<BezierContour> read_contours(const FT_Outline& outline, double shift) {
  std::vector<BezierContour> contours;
  int next = 0;
  for (int c = 0; c < outline.n_contours; ++c) {
    const int end = outline.contours[c];
    Points points(end + 1 - next, 2);
    std::vector<bool> on_curve;
    std::vector<PointKind> kinds;
    bool is_cubic = false;
    for (int i = next; i <= end; ++i) {
      const FT_Vector& p = outline.points[i];
      points.row(i - next) << static_cast<double>(p.x) + shift, static_cast<double>(p.y);
      const int curve = FT_CURVE_TAG(outline.tags[i]);
      is_cubic = is_cubic || curve == FT_CURVE_TAG_CUBIC;
      on_curve.push_back(curve == FT_CURVE_TAG_ON);
      kinds.push_back(curve == FT_CURVE_TAG_ON ? PointKind::Node : PointKind::Cubic);
    }
    contours.push_back(is_cubic ? BezierContour(std::move(points), std::move(kinds))
                                : fontcore::from_quadratic_points(points, on_curve));
    next = end + 1;
  }
  return contours;
}

/// Draws CFF2 glyphs by HarfBuzz in font units, fractions and all.
class HarfBuzzReader {
 public:
  HarfBuzzReader(const Bytes& data, int face_index, int units_per_em, const std::vector<double>& place)
      : pen_(hb_draw_funcs_create()) {
    hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(data.data()), static_cast<unsigned>(data.size()),
                                     HB_MEMORY_MODE_READONLY, nullptr, nullptr);
    hb_face_t* face = hb_face_create(blob, static_cast<unsigned>(face_index));
    hb_blob_destroy(blob);
    font_.reset(hb_font_create(face));
    hb_face_destroy(face);
    hb_font_set_scale(font_.get(), units_per_em, units_per_em);
    std::vector<int> coordinates;  // 2.14
    for (const double value : place) coordinates.push_back(static_cast<int>(std::lround(value * 16384.0)));
    hb_font_set_var_coords_normalized(font_.get(), coordinates.data(), static_cast<unsigned>(coordinates.size()));
    hb_draw_funcs_set_move_to_func(
        pen_.get(),
        [](hb_draw_funcs_t*, void* reader, hb_draw_state_t*, float x, float y, void*) {
          static_cast<HarfBuzzReader*>(reader)->add(PointKind::Node, x, y);
        },
        nullptr, nullptr);
    hb_draw_funcs_set_line_to_func(
        pen_.get(),
        [](hb_draw_funcs_t*, void* reader, hb_draw_state_t*, float x, float y, void*) {
          static_cast<HarfBuzzReader*>(reader)->add(PointKind::Node, x, y);
        },
        nullptr, nullptr);
    hb_draw_funcs_set_cubic_to_func(
        pen_.get(),
        [](hb_draw_funcs_t*, void* reader, hb_draw_state_t*, float ax, float ay, float bx, float by, float x, float y,
           void*) {
          auto* self = static_cast<HarfBuzzReader*>(reader);
          self->add(PointKind::Cubic, ax, ay);
          self->add(PointKind::Cubic, bx, by);
          self->add(PointKind::Node, x, y);
        },
        nullptr, nullptr);
    hb_draw_funcs_set_close_path_func(
        pen_.get(),
        [](hb_draw_funcs_t*, void* reader, hb_draw_state_t*, void*) { static_cast<HarfBuzzReader*>(reader)->close(); },
        nullptr, nullptr);
  }

  /// Reads a glyph; true if a coordinate is no whole number.
  bool read(int glyph) {
    contours_.clear();
    has_fractions_ = false;
#if HB_VERSION_ATLEAST(7, 0, 0)
    hb_font_draw_glyph(font_.get(), static_cast<hb_codepoint_t>(glyph), pen_.get(), this);
#else
    hb_font_get_glyph_shape(font_.get(), static_cast<hb_codepoint_t>(glyph), pen_.get(), this);
#endif
    close();
    return has_fractions_;
  }
  const std::vector<BezierContour>& contours() const { return contours_; }

 private:
  void add(PointKind kind, float x, float y) {
    points_.emplace_back(x, y);
    kinds_.push_back(kind);
    has_fractions_ = has_fractions_ || x != std::trunc(x) || y != std::trunc(y);
  }
  /// A contour ends where it began: the start point is not listed twice. Single points are left out.
  void close() {
    if (points_.size() > 1 && kinds_.back() == PointKind::Node && points_.back() == points_.front()) {
      points_.pop_back();
      kinds_.pop_back();
    }
    if (points_.size() > 1) contours_.emplace_back(to_points(points_), kinds_);
    points_.clear();
    kinds_.clear();
  }

  HbPen pen_;
  HbFont font_;
  std::vector<Point> points_;
  std::vector<PointKind> kinds_;
  std::vector<BezierContour> contours_;
  bool has_fractions_ = false;
};

/// True if `exact` is `truncated` with fractions: the same contours, nothing further than a unit and `drift` away.
bool is_refinement(const std::vector<BezierContour>& exact, const std::vector<BezierContour>& truncated, double drift) {
  if (exact.size() != truncated.size()) return false;
  for (std::size_t c = 0; c < exact.size(); ++c) {
    // FreeType drops an end point that truncation laid on the start point.
    if (exact[c].kinds() != truncated[c].kinds()) {
      if (std::abs(exact[c].point_count() - truncated[c].point_count()) > 1) return false;
    } else if ((exact[c].points() - truncated[c].points()).cwiseAbs().maxCoeff() > 1.0 + drift) {
      return false;
    }
  }
  return true;
}

// ---- components

Component read_component(FT_GlyphSlot slot, unsigned index) {
  int glyph = 0;
  int first = 0;
  int second = 0;
  unsigned flags = 0;
  FT_Matrix matrix{};
  if (const FT_Error error = FT_Get_SubGlyph_Info(slot, index, &glyph, &flags, &first, &second, &matrix)) {
    throw Malformed(text("component ", index, ": ", reason(error)));
  }
  Component part;
  part.glyph = glyph;
  part.use_my_metrics = (flags & FT_SUBGLYPH_FLAG_USE_MY_METRICS) != 0;
  constexpr double one = 65536.0;  // 16.16
  const auto entry = [](FT_Fixed value) { return static_cast<double>(value) / one; };
  part.placement.linear << entry(matrix.xx), entry(matrix.xy), entry(matrix.yx), entry(matrix.yy);
  if ((flags & FT_SUBGLYPH_FLAG_ARGS_ARE_XY_VALUES) == 0) {
    part.matched_parent = first;
    part.matched_child = second;
    return part;
  }
  part.placement.shift = Point(first, second);
  constexpr unsigned scaled_offset = 0x0800;  // SCALED_COMPONENT_OFFSET; FreeType has no public name for it
  // The offset goes through the matrix, as HarfBuzz and fontTools do and Apple says; FreeType takes the lengths of the
  // matrix's rows, which differs only where the part is turned or mirrored.
  if (flags & scaled_offset) part.placement.shift = part.placement.linear * part.placement.shift;
  return part;
}

// ---- names

bool is_printable(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
}

// Printable ASCII by the names of the Adobe Glyph List, from U+0020 on; letters are their own names.
constexpr std::array<const char*, 95> ascii_names{"space",       "exclam",
                                                  "quotedbl",    "numbersign",
                                                  "dollar",      "percent",
                                                  "ampersand",   "quotesingle",
                                                  "parenleft",   "parenright",
                                                  "asterisk",    "plus",
                                                  "comma",       "hyphen",
                                                  "period",      "slash",
                                                  "zero",        "one",
                                                  "two",         "three",
                                                  "four",        "five",
                                                  "six",         "seven",
                                                  "eight",       "nine",
                                                  "colon",       "semicolon",
                                                  "less",        "equal",
                                                  "greater",     "question",
                                                  "at",          "A",
                                                  "B",           "C",
                                                  "D",           "E",
                                                  "F",           "G",
                                                  "H",           "I",
                                                  "J",           "K",
                                                  "L",           "M",
                                                  "N",           "O",
                                                  "P",           "Q",
                                                  "R",           "S",
                                                  "T",           "U",
                                                  "V",           "W",
                                                  "X",           "Y",
                                                  "Z",           "bracketleft",
                                                  "backslash",   "bracketright",
                                                  "asciicircum", "underscore",
                                                  "grave",       "a",
                                                  "b",           "c",
                                                  "d",           "e",
                                                  "f",           "g",
                                                  "h",           "i",
                                                  "j",           "k",
                                                  "l",           "m",
                                                  "n",           "o",
                                                  "p",           "q",
                                                  "r",           "s",
                                                  "t",           "u",
                                                  "v",           "w",
                                                  "x",           "y",
                                                  "z",           "braceleft",
                                                  "bar",         "braceright",
                                                  "asciitilde"};

std::string unicode_name(char32_t code) {
  if (code >= U' ' && code <= U'~') return ascii_names[code - U' '];
  char name[16];
  const auto value = static_cast<unsigned>(code);
  std::snprintf(name, sizeof name, value > 0xFFFF ? "u%05X" : "uni%04X", value);
  return name;
}

/// Every glyph's own name, where it has one that no lower glyph id has taken; else that of its lowest code point (the
/// Adobe Glyph List's for ASCII, else uniXXXX or uXXXXX), else gidN. Names that cannot be printed in ASCII count as
/// absent.
void name_glyphs(Font& font, FT_Face face) {
  std::set<std::string> taken;
  const auto take = [&](Glyph& glyph, std::string name) {
    if (!is_printable(name) || !taken.insert(name).second) return false;
    glyph.name = std::move(name);
    return true;
  };
  if (FT_HAS_GLYPH_NAMES(face)) {
    for (Glyph& glyph : font.glyphs) {
      char name[256] = "";
      if (FT_Get_Glyph_Name(face, static_cast<FT_UInt>(glyph.id), name, sizeof name) == 0) take(glyph, name);
    }
  }
  for (const auto& [code, id] : font.character_map) {
    Glyph& glyph = font.glyphs[static_cast<std::size_t>(id)];
    if (glyph.name.empty()) take(glyph, unicode_name(code));
  }
  for (Glyph& glyph : font.glyphs) {
    if (!glyph.name.empty()) continue;
    std::string name = text("gid", glyph.id);
    while (!take(glyph, name)) name += '#';
  }
}

// ---- the font

class Loader {
 public:
  Loader(Font& font, const sfnt::Directory& directory, std::vector<double> place)
      : font_(font), basics_(sfnt::read_basics(directory)), place_(std::move(place)) {
    font_.is_collection = directory.is_collection;
    font_.is_variable = directory.has(tag("fvar"));
    font_.units_per_em = basics_.units_per_em;
    font_.format = outline_format(directory);
    if (font_.format == OutlineFormat::Cff) cff_ = directory.require(tag("CFF "), 4);
    if (font_.format == OutlineFormat::Cff2) {
      sfnt::check_cff2_variations(directory.require(tag("CFF2"), 5), basics_.glyph_count);
    }
  }

  void load() {
    FT_Library library = nullptr;
    if (const FT_Error error = FT_Init_FreeType(&library)) throw Malformed(reason(error));
    library_.reset(library);
    FT_Face face = nullptr;
    const Bytes& data = *font_.data;
    if (const FT_Error error =
            FT_New_Memory_Face(library, data.data(), static_cast<FT_Long>(data.size()), font_.face_index, &face)) {
      throw Malformed(text("is not a font that can be read; ", reason(error)));
    }
    face_.reset(face);
    if (face->num_glyphs != basics_.glyph_count) {
      throw Malformed(text("table maxp says ", basics_.glyph_count, " glyphs, the outlines are ", face->num_glyphs));
    }
    font_.ascender = face->ascender;
    font_.descender = face->descender;
    if (face->family_name) font_.family = face->family_name;
    if (face->style_name) font_.style = face->style_name;
    read_character_map();
    font_.glyphs.resize(static_cast<std::size_t>(basics_.glyph_count));
    for (int id = 0; id < basics_.glyph_count; ++id) font_.glyphs[static_cast<std::size_t>(id)].id = id;
    name_glyphs(font_, face);
    go_to_place();
    read_glyphs();
    check_composites(font_);
  }

 private:
  static OutlineFormat outline_format(const sfnt::Directory& directory) {
    if (directory.version != tag("OTTO") && directory.has(tag("glyf"))) return OutlineFormat::TrueType;
    if (directory.has(tag("CFF "))) return OutlineFormat::Cff;
    if (directory.has(tag("CFF2"))) return OutlineFormat::Cff2;
    for (const sfnt::Tag picture : {tag("EBDT"), tag("CBDT"), tag("sbix"), tag("bdat"), tag("SVG ")}) {
      if (directory.has(picture)) return OutlineFormat::None;
    }
    throw Malformed("has no outlines: no table glyf, CFF or CFF2");
  }

  void read_character_map() {
    FT_Face face = face_.get();
    if (FT_Select_Charmap(face, FT_ENCODING_UNICODE) != 0 && FT_Select_Charmap(face, FT_ENCODING_MS_SYMBOL) != 0)
      return;
    constexpr FT_ULong last_code = 0x10FFFF;
    FT_UInt glyph = 0;
    for (FT_ULong code = FT_Get_First_Char(face, &glyph); glyph != 0 && code <= last_code;
         code = FT_Get_Next_Char(face, code, &glyph)) {
      if (glyph >= static_cast<FT_UInt>(basics_.glyph_count)) continue;
      font_.character_map.emplace_hint(font_.character_map.end(), static_cast<char32_t>(code), static_cast<int>(glyph));
    }
  }

  void go_to_place() {
    if (place_.empty()) return;
    std::vector<FT_Fixed> coordinates;
    for (const double value : place_) coordinates.push_back(std::lround(value * 65536.0));
    const auto count = static_cast<FT_UInt>(coordinates.size());
    if (const FT_Error error = FT_Set_Var_Blend_Coordinates(face_.get(), count, coordinates.data())) {
      throw Malformed(text("its variations cannot be read; ", reason(error)));
    }
  }

  void read_glyphs() {
    for (Glyph& glyph : font_.glyphs) glyph.advance = basics_.metrics.advance(glyph.id);
    if (font_.format == OutlineFormat::Cff) {
      sfnt::read_cff_outlines(font_, sfnt::CffTable(cff_, basics_.units_per_em));
      return;
    }
    std::unique_ptr<HarfBuzzReader> harfbuzz;
    const bool is_cff2 = font_.format == OutlineFormat::Cff2;
    if (is_cff2) {
      harfbuzz = std::make_unique<HarfBuzzReader>(*font_.data, font_.face_index, basics_.units_per_em, place_);
    }
    for (Glyph& glyph : font_.glyphs) {
      try {
        if (font_.format == OutlineFormat::TrueType) read_truetype(glyph);
        if (is_cff2) read_cff2(glyph, *harfbuzz);
        spend_points(glyph);
      } catch (const Malformed& error) {
        refuse(glyph, error.what());
      } catch (const fontcore::InvalidInput& error) {
        refuse(glyph, error.what());
      }
    }
  }

  static void refuse(Glyph& glyph, const std::string& why) {
    glyph.trouble = why;
    glyph.contours.clear();
    glyph.components.clear();
  }

  /// Drawn points take a byte or more; repeated flags, glyphs at one place of the file and subroutines can give any
  /// number for none.
  void spend_points(const Glyph& glyph) {
    for (const BezierContour& contour : glyph.contours) points_ += contour.point_count();
    const auto most = std::min<std::int64_t>(
        most_points, points_per_byte * static_cast<std::int64_t>(font_.data->size()) + max_composed_points);
    if (points_ > most) throw Malformed(text("the font's outlines come to more than ", most, " points"));
  }

  FT_GlyphSlot load_slot(const Glyph& glyph, int extra_flags) {
    if (const FT_Error error = FT_Load_Glyph(face_.get(), static_cast<FT_UInt>(glyph.id), unscaled | extra_flags)) {
      throw Malformed(reason(error));
    }
    return face_->glyph;
  }

  void read_truetype(Glyph& glyph) {
    const sfnt::View bytes = basics_.outlines.bytes(glyph.id);
    if (bytes.empty()) return;
    const int origin = sfnt::read_box(bytes).x_min - basics_.metrics.bearing(glyph.id);
    glyph.origin = origin;
    glyph.has_instructions = sfnt::instruction_length(bytes) > 0;
    FT_GlyphSlot slot = load_slot(glyph, FT_LOAD_NO_RECURSE);
    if (slot->format == FT_GLYPH_FORMAT_COMPOSITE) {
      for (unsigned i = 0; i < slot->num_subglyphs; ++i) glyph.components.push_back(read_component(slot, i));
    } else {
      glyph.contours = read_contours(slot->outline, origin);  // FreeType has shifted them to the origin
    }
  }

  void read_cff2(Glyph& glyph, HarfBuzzReader& harfbuzz) {
    if (slow_glyphs_ == most_slow_glyphs) throw Malformed("not read: too many charstrings of this font never end");
    const double start = thread_seconds();
    FT_GlyphSlot slot = nullptr;
    try {
      slot = load_slot(glyph, 0);
    } catch (const Malformed&) {
      if (thread_seconds() - start > slow) ++slow_glyphs_;
      throw;
    }
    if (thread_seconds() - start > slow) ++slow_glyphs_;
    glyph.contours = read_contours(slot->outline, 0.0);
    // At a place FreeType may truncate what would be whole but for its own rounding.
    if (!harfbuzz.read(glyph.id) && place_.empty()) return;
    if (!is_refinement(harfbuzz.contours(), glyph.contours, place_.empty() ? 0.0 : blend_drift)) {
      throw Malformed("FreeType and HarfBuzz read different outlines");
    }
    glyph.contours = harfbuzz.contours();
    font_.has_fractional_coordinates = true;
  }

  // FreeType ends a charstring after twenty million steps, which subroutines that call each other reach: 0.1 s, where
  // an honest glyph takes some microseconds. A font may have a few of those, not thousands.
  static constexpr double slow = 0.02;  // seconds of this thread
  static constexpr int most_slow_glyphs = 16;
  // FreeType blends in 16.16: what it rounds off comes to an eighth of a unit where a point moves by thousands of
  // units, or thousands of operands stand before it.
  static constexpr double blend_drift = 0.125;

  Font& font_;
  sfnt::Basics basics_;
  std::vector<double> place_;  // of a CFF2 font; empty: its default
  sfnt::View cff_;
  Library library_;
  Face face_;
  static constexpr std::int64_t most_points = 1 << 24;  // 65,535 glyphs of 256: 400 MiB
  static constexpr std::int64_t points_per_byte = 4;

  int slow_glyphs_ = 0;
  std::int64_t points_ = 0;  // of all glyphs so far
};

}  // namespace

namespace {

Font load(const std::string& path, Bytes data, int face_index, const std::vector<double>& place) {
  Font font;
  font.path = path;
  font.face_index = face_index;
  font.data = std::make_shared<const Bytes>(std::move(data));
  try {
    Loader(font, sfnt::read_directory(*font.data, face_index), place).load();
  } catch (const Malformed& error) {
    throw FontReadError(text(path, ": ", error.what()));
  }
  return font;
}

}  // namespace

Font load_sfnt(const std::string& path, Bytes data, int face_index) {
  return load(path, std::move(data), face_index, {});
}

Font load_cff2_at(const std::string& path, Bytes data, const std::vector<double>& place) {
  return load(path, std::move(data), 0, place);
}

std::vector<std::vector<BezierContour>> read_by_freetype(const Bytes& data, const std::vector<int>& glyphs) {
  FT_Library opened = nullptr;
  const auto check = [](FT_Error error) {
    if (error) throw FontReadError(reason(error));
  };
  check(FT_Init_FreeType(&opened));
  const Library library(opened);
  FT_Face opened_face = nullptr;
  check(FT_New_Memory_Face(opened, data.data(), static_cast<FT_Long>(data.size()), 0, &opened_face));
  const Face face(opened_face);
  std::vector<std::vector<BezierContour>> outlines;
  for (const int glyph : glyphs) {
    check(FT_Load_Glyph(opened_face, static_cast<FT_UInt>(glyph), unscaled));
    outlines.push_back(read_contours(opened_face->glyph->outline, 0.0));
  }
  return outlines;
}

}  // namespace glyphs
