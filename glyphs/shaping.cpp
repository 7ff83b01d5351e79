#include "glyphs/shaping.h"

#include <hb-aat.h>
#include <hb-ot.h>
#include <hb.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <set>

#include "glyphs/error.h"

namespace glyphs {

namespace {

template <auto destroy>
struct Destroy {
  template <typename T>
  void operator()(T* object) const {
    destroy(object);
  }
};
using FaceHandle = std::unique_ptr<hb_face_t, Destroy<hb_face_destroy>>;
using FontHandle = std::unique_ptr<hb_font_t, Destroy<hb_font_destroy>>;
using BufferHandle = std::unique_ptr<hb_buffer_t, Destroy<hb_buffer_destroy>>;

FaceHandle open_face(const Font& font) {
  if (!font.data) return FaceHandle(hb_face_create(hb_blob_get_empty(), 0));
  hb_blob_t* blob = hb_blob_create(reinterpret_cast<const char*>(font.data->data()),
                                   static_cast<unsigned>(font.data->size()), HB_MEMORY_MODE_READONLY, nullptr, nullptr);
  FaceHandle face(hb_face_create(blob, static_cast<unsigned>(font.face_index)));
  hb_blob_destroy(blob);
  return face;
}

/// The glyph that stands for characters that the font lacks.
int missing_glyph(const Font& font) {
  return font.format == OutlineFormat::Ufo ? std::max(0, font.find(".notdef")) : 0;
}

hb_bool_t nominal_glyph(hb_font_t*, void* font, hb_codepoint_t code, hb_codepoint_t* glyph, void*) {
  const auto& map = static_cast<const Font*>(font)->character_map;
  const auto at = map.find(static_cast<char32_t>(code));
  if (at == map.end()) return 0;
  *glyph = static_cast<hb_codepoint_t>(at->second);
  return 1;
}

hb_position_t advance_of(hb_font_t*, void* font, hb_codepoint_t glyph, void*) {
  const auto& glyphs = static_cast<const Font*>(font)->glyphs;
  return glyph < glyphs.size() ? static_cast<hb_position_t>(std::lround(glyphs[glyph].advance)) : 0;
}

/// Downwards from ascender to descender, as HarfBuzz does for fonts without vertical metrics; without these functions
/// it would go up.
hb_position_t vertical_advance_of(hb_font_t*, void* font, hb_codepoint_t, void*) {
  const auto& own = *static_cast<const Font*>(font);
  return static_cast<hb_position_t>(std::lround(own.descender - own.ascender));
}

hb_bool_t vertical_origin_of(hb_font_t* sized, void* font, hb_codepoint_t glyph, hb_position_t* x, hb_position_t* y,
                             void* user) {
  *x = advance_of(sized, font, glyph, user) / 2;
  *y = static_cast<hb_position_t>(std::lround(static_cast<const Font*>(font)->ascender));
  return 1;
}

/// A font without tables, by its characters and advances.
void set_functions(hb_font_t* sized, const Font& font) {
  using Functions = std::unique_ptr<hb_font_funcs_t, Destroy<hb_font_funcs_destroy>>;
  const Functions functions(hb_font_funcs_create());
  hb_font_funcs_set_nominal_glyph_func(functions.get(), nominal_glyph, nullptr, nullptr);
  hb_font_funcs_set_glyph_h_advance_func(functions.get(), advance_of, nullptr, nullptr);
  hb_font_funcs_set_glyph_v_advance_func(functions.get(), vertical_advance_of, nullptr, nullptr);
  hb_font_funcs_set_glyph_v_origin_func(functions.get(), vertical_origin_of, nullptr, nullptr);
  // The functions only read it; HarfBuzz hands them a pointer to what it takes as its own.
  hb_font_set_funcs(sized, functions.get(), const_cast<Font*>(&font), nullptr);
}

/// The code points of UTF-8 text; HarfBuzz itself would put replacement characters for what is malformed.
std::vector<char32_t> decode(const std::string& text) {
  std::vector<char32_t> points;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const int more = lead < 0x80 ? 0 : lead < 0xC2 ? -1 : lead < 0xE0 ? 1 : lead < 0xF0 ? 2 : lead < 0xF5 ? 3 : -1;
    bool is_good = more >= 0 && i + static_cast<std::size_t>(more) < text.size();
    char32_t point = more <= 0 ? lead : lead & (0x3FU >> more);
    for (int k = 1; is_good && k <= more; ++k) {
      const auto byte = static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]);
      is_good = (byte & 0xC0U) == 0x80;
      point = (point << 6U) | (byte & 0x3FU);
    }
    // Longer than need be, a surrogate, or beyond Unicode.
    constexpr std::array<char32_t, 4> least{0, 0x80, 0x800, 0x10000};
    if (!is_good || point < least[static_cast<std::size_t>(more)] || (point >= 0xD800 && point < 0xE000) ||
        point > 0x10FFFF)
      throw RequestError(fontcore::text("text: not UTF-8 at byte ", i));
    points.push_back(point);
    i += static_cast<std::size_t>(more) + 1;
  }
  return points;
}

std::vector<std::string> split(const std::string& list, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : list)
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

/// Every feature the font's layout tables name, and kerning if there is an old `kern` table.
std::set<hb_tag_t> features_of(hb_face_t* face) {
  std::set<hb_tag_t> found;
  for (const hb_tag_t table : {HB_OT_TAG_GSUB, HB_OT_TAG_GPOS}) {
    std::vector<hb_tag_t> tags(hb_ot_layout_table_get_feature_tags(face, table, 0, nullptr, nullptr));
    auto count = static_cast<unsigned>(tags.size());
    hb_ot_layout_table_get_feature_tags(face, table, 0, &count, tags.data());
    found.insert(tags.begin(), tags.end());
  }
  hb_blob_t* kern = hb_face_reference_table(face, HB_TAG('k', 'e', 'r', 'n'));
  if (hb_blob_get_length(kern) > 0) found.insert(HB_TAG('k', 'e', 'r', 'n'));
  hb_blob_destroy(kern);
  return found;
}

std::vector<hb_feature_t> parse_features(hb_face_t* face, const std::string& list) {
  std::vector<hb_feature_t> features;
  if (list.empty()) return features;
  const std::set<hb_tag_t> known = features_of(face);
  for (const std::string& part : split(list, ',')) {
    hb_feature_t feature;
    if (!hb_feature_from_string(part.data(), static_cast<int>(part.size()), &feature))
      throw RequestError("features: '" + part + "' is no feature");
    // AAT fonts translate features to settings of their own.
    if (feature.value != 0 && known.count(feature.tag) == 0 && !hb_aat_layout_has_substitution(face))
      throw RequestError("features: the font has no feature '" + part + "'");
    features.push_back(feature);
  }
  return features;
}

hb_script_t parse_script(const std::string& name) {
  const hb_script_t script = hb_script_from_string(name.data(), static_cast<int>(name.size()));
  // HarfBuzz takes any four letters; a script is one that a character has.
  static const std::set<hb_script_t> used = [] {
    std::set<hb_script_t> scripts;
    for (hb_codepoint_t c = 0; c < 0x110000; ++c) scripts.insert(hb_unicode_script(hb_unicode_funcs_get_default(), c));
    scripts.erase(HB_SCRIPT_UNKNOWN);
    return scripts;
  }();
  if (name.size() != 4 || used.count(script) == 0) throw RequestError("script: '" + name + "' is no script");
  return script;
}

hb_direction_t parse_direction(const std::string& name) {
  if (name == "ltr") return HB_DIRECTION_LTR;
  if (name == "rtl") return HB_DIRECTION_RTL;
  if (name == "ttb") return HB_DIRECTION_TTB;
  if (name == "btt") return HB_DIRECTION_BTT;
  throw RequestError("direction: '" + name + "' is none of ltr, rtl, ttb, btt");
}

hb_language_t parse_language(const std::string& name) {
  // "und" rather than HarfBuzz's default, which follows the machine's locale.
  if (name.empty()) return hb_language_from_string("und", -1);
  for (const std::string& part : split(name, '-'))
    if (part.empty() || part.size() > 8 || !std::all_of(part.begin(), part.end(), [](char c) {
          return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        }))
      throw RequestError("language: '" + name + "' is no language tag");
  return hb_language_from_string(name.data(), static_cast<int>(name.size()));
}

}  // namespace

ShapedLine shape(const Font& font, const std::string& text, const ShapingOptions& options) {
  const std::vector<char32_t> points = decode(text);
  if (points.empty()) throw RequestError("text: it is empty");
  const FaceHandle face = open_face(font);
  const std::vector<hb_feature_t> features = parse_features(face.get(), options.features);
  const FontHandle sized(hb_font_create(face.get()));
  hb_font_set_scale(sized.get(), font.units_per_em, font.units_per_em);
  if (!font.data) set_functions(sized.get(), font);

  const BufferHandle buffer(hb_buffer_create());
  hb_buffer_set_not_found_glyph(buffer.get(), static_cast<hb_codepoint_t>(missing_glyph(font)));
  static_assert(sizeof(char32_t) == sizeof(std::uint32_t));
  hb_buffer_add_utf32(buffer.get(), reinterpret_cast<const std::uint32_t*>(points.data()),
                      static_cast<int>(points.size()), 0, static_cast<int>(points.size()));
  if (!options.script.empty()) hb_buffer_set_script(buffer.get(), parse_script(options.script));
  if (!options.direction.empty()) hb_buffer_set_direction(buffer.get(), parse_direction(options.direction));
  hb_buffer_set_language(buffer.get(), parse_language(options.language));
  hb_buffer_guess_segment_properties(buffer.get());
  hb_shape(sized.get(), buffer.get(), features.data(), static_cast<unsigned>(features.size()));

  ShapedLine line;
  unsigned count = 0;
  const hb_glyph_info_t* infos = hb_buffer_get_glyph_infos(buffer.get(), &count);
  const hb_glyph_position_t* positions = hb_buffer_get_glyph_positions(buffer.get(), &count);
  fontcore::Point pen(0.0, 0.0);
  for (unsigned i = 0; i < count; ++i) {
    const hb_glyph_position_t& place = positions[i];
    line.glyphs.push_back(
        {static_cast<int>(infos[i].codepoint), pen + fontcore::Point(place.x_offset, place.y_offset)});
    pen += fontcore::Point(place.x_advance, place.y_advance);
  }
  const hb_direction_t direction = hb_buffer_get_direction(buffer.get());
  line.direction = direction == HB_DIRECTION_RTL   ? Direction::RightToLeft
                   : direction == HB_DIRECTION_TTB ? Direction::TopToBottom
                   : direction == HB_DIRECTION_BTT ? Direction::BottomToTop
                                                   : Direction::LeftToRight;
  line.advance = std::abs(HB_DIRECTION_IS_VERTICAL(direction) ? pen.y() : pen.x());
  return line;
}

std::vector<std::string> split_lines(const std::string& text) {
  std::vector<std::string> lines = split(text, '\n');
  if (lines.back().empty()) lines.pop_back();
  return lines;
}

std::vector<int> glyphs_of_text(const Font& font, const std::string& text, const ShapingOptions& options) {
  std::set<int> found;
  for (const std::string& line : split_lines(text)) {
    if (line.empty()) continue;
    const ShapedLine shaped = shape(font, line, options);
    for (const PlacedGlyph& placed : shaped.glyphs) found.insert(placed.glyph);
    if (found.count(missing_glyph(font)) == 0) continue;
    for (const char32_t point : decode(line))
      if (font.character_map.count(point) == 0) {
        std::array<char, 16> name{};
        std::snprintf(name.data(), name.size(), "U+%04X", static_cast<unsigned>(point));
        throw RequestError(std::string("text: the font has no ") + name.data());
      }
  }
  if (found.empty()) throw RequestError("text: it is empty");
  return {found.begin(), found.end()};
}

}  // namespace glyphs
