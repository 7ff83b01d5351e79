#include "glyphs/sfnt_cff.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <unordered_map>

#include "fontcore/measure.h"
#include "glyphs/jobs.h"

namespace glyphs::sfnt {

namespace {

using fontcore::Affine;
using fontcore::BezierContour;
using fontcore::text;

enum DictOperator : int {
  font_bbox = 5,
  charset = 15,
  encoding = 16,
  char_strings = 17,
  private_dict = 18,
  subrs = 19,
  default_width = 20,
  nominal_width = 21,
  variation_store = 24,  // of CFF2
  charstring_type = 0x0C06,
  font_matrix = 0x0C07,
  ros = 0x0C1E,
  cid_count = 0x0C22,
  fd_array = 0x0C24,
  fd_select = 0x0C25,
};

// ---- reading

std::uint64_t number_at(View bytes, std::uint64_t at, int size) {
  std::uint64_t value = 0;
  for (const unsigned char byte : slice(bytes, at, static_cast<std::uint64_t>(size))) value = value << 8 | byte;
  return value;
}

}  // namespace

CffIndex open_index(View table, std::uint64_t at, const char* what) {
  try {
    CffIndex index{.table = table, .begin = at, .end = at + 2, .count = u16(table, at)};
    if (index.count == 0) return index;
    index.offset_size = u8(table, at + 2);
    if (index.offset_size < 1 || index.offset_size > 4)
      throw Malformed(text("offsets of ", index.offset_size, " bytes"));
    const auto count = static_cast<std::uint64_t>(index.count);
    const auto size = static_cast<std::uint64_t>(index.offset_size);
    const std::uint64_t first = number_at(table, at + 3, index.offset_size);
    const std::uint64_t last = number_at(table, at + 3 + count * size, index.offset_size);
    const std::uint64_t base = at + 3 + (count + 1) * size - 1;
    if (first != 1) throw Malformed(text("the first offset is ", first, ", not 1"));
    if (last < 1 || base + last > table.size()) {
      throw Malformed(text("it ends at ", base + last, " of ", table.size(), " bytes"));
    }
    index.end = base + last;
    return index;
  } catch (const Malformed& error) {
    throw Malformed(text("table CFF: INDEX of ", what, ": ", error.what()));
  }
}

namespace {

/// A real number in nibbles, from behind its 30; `at` goes behind it.
double read_real(View bytes, std::uint64_t& at) {
  std::string digits;
  for (bool is_open = true; is_open;) {
    const int byte = u8(bytes, at++);
    for (const int nibble : {byte >> 4, byte & 15}) {
      if (nibble == 15) {
        is_open = false;
        break;
      }
      if (nibble == 13) throw Malformed("a real number with a reserved nibble");
      constexpr const char* written[] = {"0", "1", "2", "3", "4", "5", "6", "7", "8", "9", ".", "e", "e-", "", "-"};
      digits += written[nibble];
    }
    constexpr std::size_t longest = 64;
    if (digits.size() > longest) throw Malformed("a real number without end");
  }
  const double value = std::strtod(digits.c_str(), nullptr);
  if (!std::isfinite(value)) throw Malformed(text("the number ", digits));
  return value;
}

}  // namespace

CffDict read_dict(View bytes, const char* what, int last_operator) {
  try {
    CffDict dict;
    CffEntry entry;
    std::uint64_t begin = 0;
    for (std::uint64_t at = 0; at < bytes.size();) {
      const std::uint64_t from = at;
      const int b = bytes[at++];
      if (b <= last_operator) {
        entry.op = b == 12 ? 0x0C00 | u8(bytes, at++) : b;
        entry.bytes = bytes.subspan(begin, at - begin);
        dict.push_back(std::move(entry));
        entry = {};
        begin = at;
        continue;
      }
      double value = 0.0;
      if (b == 28) {
        value = i16(bytes, at);
        at += 2;
      } else if (b == 29) {
        value = static_cast<std::int32_t>(u32(bytes, at));
        at += 4;
      } else if (b == 30) {
        value = read_real(bytes, at);
      } else if (b >= 32 && b <= 246) {
        value = b - 139;
      } else if (b >= 247 && b <= 250) {
        value = (b - 247) * 256 + u8(bytes, at++) + 108;
      } else if (b >= 251 && b <= 254) {
        value = -(b - 251) * 256 - u8(bytes, at++) - 108;
      } else {
        throw Malformed(text("the reserved byte ", b));
      }
      constexpr std::size_t most_operands = 48;
      if (entry.operands.size() == most_operands) throw Malformed(text("more than ", most_operands, " operands"));
      entry.operands.push_back(value);
      entry.operand_bytes.push_back(bytes.subspan(from, at - from));
    }
    return dict;
  } catch (const Malformed& error) {
    throw Malformed(text("table CFF: ", what, ": ", error.what()));
  }
}

namespace {

const CffEntry* find(const CffDict& dict, int op) {
  const auto at = std::find_if(dict.begin(), dict.end(), [&](const CffEntry& entry) { return entry.op == op; });
  return at == dict.end() ? nullptr : &*at;
}

std::uint64_t whole(double value, const char* what) {
  if (!(value >= 0.0) || value != std::trunc(value) || value > std::numeric_limits<std::uint32_t>::max()) {
    throw Malformed(text("table CFF: ", what, " ", value));
  }
  return static_cast<std::uint64_t>(value);
}

/// The last operand of an entry as an offset; none if there is no entry.
std::optional<std::uint64_t> offset_in(const CffDict& dict, int op, const char* what) {
  const CffEntry* entry = find(dict, op);
  if (!entry || entry->operands.empty()) return std::nullopt;
  return whole(entry->operands.back(), what);
}

/// A FontMatrix as FreeType takes it: scaled to 1 for y, and the units per em that this gives.
struct Matrix {
  Affine map;  // the shift in ems
  double units_per_em = 1000.0;
};

std::optional<Affine> matrix_in(const CffDict& dict) {
  const CffEntry* entry = find(dict, font_matrix);
  if (!entry || entry->operands.size() < 6) return std::nullopt;
  const auto& v = entry->operands;
  Affine map;
  map.linear << v[0], v[2], v[1], v[3];
  map.shift = {v[4], v[5]};
  const double size = std::max(std::abs(v[3]), std::abs(v[1]));
  constexpr double least = 1e-6;
  constexpr double most = 1e3;
  const double determinant = v[0] * v[3] - v[1] * v[2];
  if (!(size > least && size < most) || !(std::abs(determinant) > least * least)) return std::nullopt;
  return map;
}

double size_of(const Affine& map) {
  return std::abs(map.linear(1, 1)) > 0.0 ? std::abs(map.linear(1, 1)) : std::abs(map.linear(1, 0));
}

}  // namespace

View CffIndex::object(int number) const {
  if (number < 0 || number >= count) throw Malformed(text("there is no object ", number, " of ", count));
  const auto size = static_cast<std::uint64_t>(offset_size);
  const std::uint64_t at = begin + 3 + static_cast<std::uint64_t>(number) * size;
  const std::uint64_t from = number_at(table, at, offset_size);
  const std::uint64_t to = number_at(table, at + size, offset_size);
  const std::uint64_t base = begin + 3 + (static_cast<std::uint64_t>(count) + 1) * size - 1;
  if (from < 1 || from > to || base + to > end) {
    throw Malformed(text("object ", number, " of an INDEX lies at ", from, " to ", to, " of ", end - base));
  }
  return table.subspan(base + from, to - from);
}

// ---- the table

CffTable::CffTable(View table, int units_per_em) : table_(table) {
  if (table.size() < 4) throw Malformed(text("table CFF has ", table.size(), " bytes"));
  if (table[0] != 1) throw Malformed(text("table CFF: version ", int{table[0]}, " is not 1"));
  const CffIndex names = open_index(table, u8(table, 2), "names");
  top_dicts_ = open_index(table, names.end, "Top DICTs");
  const CffIndex strings = open_index(table, top_dicts_.end, "strings");
  global_subroutines_ = open_index(table, strings.end, "global subroutines");
  top_ = read_dict(top_dicts_.object(0), "Top DICT");
  if (const CffEntry* type = find(top_, charstring_type); type && type->operands != std::vector{2.0}) {
    throw Malformed("table CFF: its charstrings are not of Type 2");
  }
  const auto at = offset_in(top_, char_strings, "offset of charstrings");
  if (!at || *at == 0) throw Malformed("table CFF has no charstrings");
  charstrings_ = open_index(table, *at, "charstrings");
  if (!is_cid_keyed()) {
    font_dicts_.push_back(open_font_dict(top_, {}, units_per_em));
    return;
  }
  font_dict_index_ = open_index(table, offset_in(top_, fd_array, "offset of FDArray").value_or(0), "Font DICTs");
  constexpr int most_font_dicts = 256;
  if (font_dict_index_.count > most_font_dicts) {
    throw Malformed(text("table CFF: ", font_dict_index_.count, " Font DICTs, more than ", most_font_dicts));
  }
  for (int i = 0; i < font_dict_index_.count; ++i) {
    font_dicts_.push_back(open_font_dict(read_dict(font_dict_index_.object(i), "Font DICT"), top_, units_per_em));
  }
  open_selection(offset_in(top_, fd_select, "offset of FDSelect").value_or(0));
}

bool CffTable::is_cid_keyed() const { return find(top_, ros) != nullptr; }

std::optional<CffTable::Private> CffTable::open_private(const CffDict& dict) const {
  const CffEntry* entry = find(dict, private_dict);
  if (!entry || entry->operands.size() < 2) return std::nullopt;
  const std::uint64_t size = whole(entry->operands[0], "size of a Private DICT");
  const std::uint64_t begin = whole(entry->operands[1], "offset of a Private DICT");
  if (size == 0) return std::nullopt;
  return Private{begin, begin + size, read_dict(slice(table_, begin, size), "Private DICT")};
}

CffFontDict CffTable::open_font_dict(const CffDict& dict, const CffDict& top, int units_per_em) const {
  CffFontDict result;
  if (const auto own = open_private(dict)) {
    const auto at = offset_in(own->dict, subrs, "offset of subroutines");
    if (at && *at != 0) result.local_subroutines = open_index(table_, own->begin + *at, "subroutines");
    const auto width = [&](int op) {
      const CffEntry* entry = find(own->dict, op);
      return entry && !entry->operands.empty() ? entry->operands.back() : 0.0;
    };
    result.default_width = width(default_width);
    result.nominal_width = width(nominal_width);
  }
  // The size of the Top DICT's matrix is that of unitsPerEm; a Font DICT's is taken against it.
  const auto above = matrix_in(top);
  const auto mine = matrix_in(dict);
  if (!above && !mine) return result;
  const bool is_top = top.empty();
  const double em_above = above ? std::round(1.0 / size_of(*above)) : units_per_em;
  Affine map = mine && above ? Affine{above->linear * mine->linear, above->linear * mine->shift + above->shift}
               : mine        ? *mine
                             : *above;
  const double em = mine ? std::round(1.0 / size_of(map)) : em_above;
  const double scale = is_top || !mine || em <= 0.0 ? 1.0 : em_above / em;
  // Numbers of few decimals stand for quotients such as 1/2048.
  constexpr double grid = 65536.0;
  const double size = size_of(map);
  map.linear = (map.linear / size).unaryExpr([](double v) { return std::round(v * grid) / grid; }) * scale;
  map.shift *= is_top ? std::round(1.0 / size) : em_above;
  result.matrix = map;
  result.is_scaled = map.linear != Eigen::Matrix2d::Identity() || map.shift != fontcore::Point::Zero();
  return result;
}

void CffTable::open_selection(std::uint64_t at) {
  const auto count = static_cast<std::uint64_t>(glyph_count());
  const int format = u8(table_, at);
  if (format == 0) {
    const View list = slice(table_, at + 1, count);
    selection_.assign(list.begin(), list.end());
  } else if (format == 3) {
    const std::uint64_t ranges = u16(table_, at + 1);
    selection_.assign(count, 0xFF);
    for (std::uint64_t i = 0; i < ranges; ++i) {
      const std::uint64_t from = u16(table_, at + 3 + 3 * i);
      const std::uint64_t to = u16(table_, at + 6 + 3 * i);
      if (from > to || to > count) throw Malformed(text("table CFF: FDSelect gives glyphs ", from, " to ", to));
      std::fill(selection_.begin() + static_cast<std::ptrdiff_t>(from),
                selection_.begin() + static_cast<std::ptrdiff_t>(to), u8(table_, at + 5 + 3 * i));
    }
  } else {
    throw Malformed(text("table CFF: FDSelect of format ", format));
  }
}

const CffFontDict& CffTable::font_dict(int glyph) const {
  const std::size_t number = selection_.empty() ? 0 : selection_.at(static_cast<std::size_t>(glyph));
  if (number >= font_dicts_.size()) throw Malformed(text("FDSelect names Font DICT ", number));
  return font_dicts_[number];
}

Charstring CffTable::read(int glyph) const {
  try {
    const CffFontDict& dict = font_dict(glyph);
    Charstring result = interpret(charstrings_.object(glyph), global_subroutines_, dict.local_subroutines);
    if (!dict.is_scaled) return result;
    result.has_fractions = false;
    for (BezierContour& contour : result.contours) {
      contour = transform(contour, dict.matrix);
      const auto& points = contour.points().array();
      result.has_fractions = result.has_fractions || (points != points.floor()).any();
    }
    if (result.accent) result.accent->shift = dict.matrix.linear * result.accent->shift;
    return result;
  } catch (const Malformed& error) {
    Charstring result;
    result.trouble = error.what();
    return result;
  }
}

std::vector<int> CffTable::standard_glyphs() const {
  // The codes of the Standard Encoding that draw something, in the order of their string numbers from 1 on.
  constexpr std::array<std::pair<int, int>, 15> codes{{{32, 126},
                                                       {161, 175},
                                                       {177, 180},
                                                       {182, 189},
                                                       {191, 191},
                                                       {193, 200},
                                                       {202, 203},
                                                       {205, 208},
                                                       {225, 225},
                                                       {227, 227},
                                                       {232, 235},
                                                       {241, 241},
                                                       {245, 245},
                                                       {248, 251},
                                                       {0, -1}}};
  std::vector<int> code_of(1, -1);
  for (const auto& [first, last] : codes) {
    for (int code = first; code <= last; ++code) code_of.push_back(code);
  }
  std::vector<int> glyphs(256, -1);
  const auto add = [&](std::uint64_t string, int glyph) {
    if (string > 0 && string < code_of.size()) glyphs[static_cast<std::size_t>(code_of[string])] = glyph;
  };
  const std::uint64_t at = offset_in(top_, charset, "offset of charset").value_or(0);
  if (at == 0) {  // ISOAdobe: the strings in their order
    for (int glyph = 1; glyph < glyph_count(); ++glyph) add(static_cast<std::uint64_t>(glyph), glyph);
  } else if (at > 2) {  // the predefined Expert sets have no accents to be put on letters
    const int format = u8(table_, at);
    std::uint64_t place = at + 1;
    for (int glyph = 1; glyph < glyph_count();) {
      const std::uint64_t first = u16(table_, place);
      place += 2;
      std::uint64_t more = 0;
      if (format == 1) more = u8(table_, place++);
      if (format == 2) {
        more = u16(table_, place);
        place += 2;
      }
      for (std::uint64_t k = 0; k <= more && glyph < glyph_count(); ++k) add(first + k, glyph++);
    }
  }
  return glyphs;
}

namespace {

/// Steps, and what memory the outline takes: without it 300 million steps could draw as many points.
std::int64_t cost(const Charstring& charstring) {
  constexpr std::int64_t steps_per_point = 16;
  std::int64_t points = 0;
  for (const fontcore::BezierContour& contour : charstring.contours) points += contour.point_count();
  return charstring.work + steps_per_point * points;
}

}  // namespace

void read_cff_outlines(Font& font, const CffTable& table) {
  std::vector<Charstring> read(font.glyphs.size());
  const int within = run_jobs_within(most_font_work, static_cast<int>(read.size()), {}, [&](int id) {
    Charstring& its = read[static_cast<std::size_t>(id)];
    its = table.read(id);
    its.is_closed_by_line = std::vector<bool>();  // freed later, it would leave a hole in memory for every glyph
    return cost(its);
  });

  std::vector<int> standard;
  const auto place_accent = [&](Glyph& glyph, const CffAccent& accent) {
    if (table.is_cid_keyed()) throw Malformed("is an accented letter, in a font without glyph names");
    if (standard.empty()) standard = table.standard_glyphs();
    for (const int code : {accent.base, accent.accent}) {
      const int part = standard[static_cast<std::size_t>(code)];
      if (part < 0) throw Malformed(text("is put together from a character ", code, " that the font does not have"));
      glyph.components.push_back({.glyph = part, .placement = {}});
    }
    glyph.components.back().placement.shift = accent.shift;
  };
  for (Glyph& glyph : font.glyphs) {
    Charstring& its = read[static_cast<std::size_t>(glyph.id)];
    if (glyph.id >= within) {
      glyph.trouble = "not read: charstrings before it take too much work";
      continue;
    }
    glyph.trouble = its.trouble;
    glyph.has_hints = its.has_hints;
    glyph.contours = std::move(its.contours);
    font.has_fractional_coordinates = font.has_fractional_coordinates || its.has_fractions;
    if (!its.accent) continue;
    try {
      place_accent(glyph, *its.accent);
    } catch (const Malformed& error) {
      glyph.components.clear();
      glyph.trouble = error.what();
    }
  }
}

// ---- rewriting

namespace {

void append(Bytes& bytes, std::uint64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<unsigned char>(value >> shift & 0xFF));
  }
}
void append(Bytes& bytes, View more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

/// Bytes per offset of an INDEX over so many bytes.
int offset_size_for(std::uint64_t bytes) { return bytes < 0xFF ? 1 : bytes < 0xFFFF ? 2 : bytes < 0xFFFFFF ? 3 : 4; }

Bytes build_index(const std::vector<View>& objects, int least_offset_size) {
  Bytes bytes;
  append(bytes, objects.size(), 2);
  if (objects.empty()) return bytes;
  std::uint64_t total = 0;
  for (const View object : objects) total += object.size();
  if (total >= std::numeric_limits<std::uint32_t>::max()) throw Malformed("table CFF: an INDEX of more than 4 GiB");
  const int size = std::max(least_offset_size, offset_size_for(total));
  bytes.reserve(3 + (objects.size() + 1) * static_cast<std::size_t>(size) + total);
  append(bytes, static_cast<std::uint64_t>(size), 1);
  std::uint64_t offset = 1;
  append(bytes, offset, size);
  for (const View object : objects) append(bytes, offset += object.size(), size);
  for (const View object : objects) append(bytes, object);
  return bytes;
}

/// Bytes of a whole number in a DICT; in as few bytes as can be if `size` is 0. Empty if it does not fit.
Bytes dict_number(std::int64_t value, std::size_t size) {
  const std::int64_t magnitude = std::abs(value);
  const std::size_t least = magnitude <= 107 ? 1 : magnitude <= 1131 ? 2 : magnitude <= 0x7FFF ? 3 : 5;
  if (size == 0) size = least;
  Bytes bytes;
  const auto bits = static_cast<std::uint64_t>(value);
  if (size == 1 && least == 1) {
    append(bytes, bits + 139, 1);
  } else if (size == 2 && least == 2) {
    append(bytes, (value > 0 ? 247u << 8 : 251u << 8) + static_cast<std::uint64_t>(magnitude - 108), 2);
  } else if (size == 3 && least <= 3) {
    append(bytes, 28, 1);
    append(bytes, bits, 2);
  } else if (size == 5 && magnitude <= std::numeric_limits<std::int32_t>::max()) {
    append(bytes, 29, 1);
    append(bytes, bits, 4);
  }
  return bytes;
}

/// How offsets are written: in the bytes they had, or in five, which hold any.
enum class OffsetSize { AsBefore, Five };

using Values = std::map<int, std::vector<std::int64_t>>;  // operands by operator

/// The DICT with other operands for some operators. Offsets keep their size, or take five bytes; others take as few
/// bytes as they can. Nothing if one does not fit.
std::optional<Bytes> rewritten_dict(View all, const CffDict& dict, const Values& offsets, const Values& others,
                                    OffsetSize size) {
  Bytes bytes;
  std::uint64_t behind = 0;
  for (const CffEntry& entry : dict) {
    behind = static_cast<std::uint64_t>(entry.bytes.data() - all.data()) + entry.bytes.size();
    const auto offset = offsets.find(entry.op);
    const auto other = others.find(entry.op);
    if (offset == offsets.end() && other == others.end()) {
      append(bytes, entry.bytes);
      continue;
    }
    const std::vector<std::int64_t>& values = offset == offsets.end() ? other->second : offset->second;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const bool is_new = i >= entry.operands.size();
      if (!is_new && entry.operands[i] == static_cast<double>(values[i]) &&
          (size == OffsetSize::AsBefore || offset == offsets.end())) {
        append(bytes, entry.operand_bytes[i]);
        continue;
      }
      const std::size_t wanted = offset == offsets.end()    ? 0
                                 : size == OffsetSize::Five ? 5
                                 : is_new                   ? 0
                                                            : entry.operand_bytes[i].size();
      const Bytes number = dict_number(values[i], wanted);
      if (number.empty()) return std::nullopt;
      append(bytes, number);
    }
    if (entry.op > 255) append(bytes, 12, 1);
    append(bytes, static_cast<std::uint64_t>(entry.op & 0xFF), 1);
  }
  append(bytes, all.subspan(behind));
  return bytes;
}

}  // namespace

Bytes CffTable::rewritten(const std::map<int, Bytes>& charstrings, const std::optional<Box>& box) const {
  struct Piece {
    std::uint64_t end = 0;
    Bytes bytes;
  };
  if (top_dicts_.count != 1) throw Malformed(text("table CFF: ", top_dicts_.count, " fonts, not one"));
  std::vector<View> objects;
  for (int id = 0; id < glyph_count(); ++id) {
    const auto changed = charstrings.find(id);
    objects.push_back(changed == charstrings.end() ? charstrings_.object(id) : View(changed->second));
  }
  const Bytes charstring_bytes = build_index(objects, charstrings_.offset_size);
  Values others;
  if (box) others[font_bbox] = {box->x_min, box->y_min, box->x_max, box->y_max};
  std::vector<CffDict> font_dicts;
  std::map<std::uint64_t, Private> privates;
  const auto add_private = [&](const CffDict& dict) {
    if (auto own = open_private(dict); own && find(own->dict, subrs)) privates.emplace(own->begin, std::move(*own));
  };
  add_private(top_);
  for (int i = 0; i < font_dict_index_.count; ++i) {
    font_dicts.push_back(read_dict(font_dict_index_.object(i), "Font DICT"));
    add_private(font_dicts.back());
  }

  for (const OffsetSize size : {OffsetSize::AsBefore, OffsetSize::Five}) {
    std::map<std::uint64_t, Piece> pieces;  // by where they stood; between them all stays
    bool is_laid_out = false;               // sizes are known, so that offsets can be
    bool fits = true;
    const auto moved = [&](std::uint64_t old) {
      std::uint64_t now = old;
      for (const auto& [begin, piece] : pieces) {
        if (old <= begin) break;
        if (old < piece.end) throw Malformed(text("table CFF: something at ", old, " lies inside another thing"));
        now += piece.bytes.size() - (piece.end - begin);
      }
      return static_cast<std::int64_t>(now);
    };
    const auto size_at = [&](std::uint64_t old, std::uint64_t old_size) {
      const auto piece = pieces.find(old);
      return static_cast<std::int64_t>(piece == pieces.end() ? old_size : piece->second.bytes.size());
    };
    const auto dict_bytes = [&](View all, const CffDict& dict, const Values& offsets, const Values& more) {
      auto bytes = rewritten_dict(all, dict, offsets, more, size);
      fits = fits && bytes.has_value();
      return bytes.value_or(Bytes{});
    };
    const auto offsets_of = [&](const CffDict& dict) {
      Values offsets;
      for (const CffEntry& entry : dict) {
        const bool is_offset = entry.op == char_strings || entry.op == fd_array || entry.op == fd_select ||
                               entry.op == charset || entry.op == encoding;
        const double predefined = entry.op == charset ? 2.0 : entry.op == encoding ? 1.0 : 0.0;
        if (is_offset && !entry.operands.empty() && entry.operands.back() > predefined) {
          offsets[entry.op] = {moved(whole(entry.operands.back(), "offset"))};
        }
        if (entry.op == private_dict && entry.operands.size() == 2 && entry.operands[0] > 0.0) {
          const std::uint64_t begin = whole(entry.operands[1], "offset");
          offsets[entry.op] = {size_at(begin, whole(entry.operands[0], "size")), moved(begin)};
        }
      }
      return offsets;
    };
    const auto lay_out = [&] {
      std::map<std::uint64_t, Piece> next;
      next[charstrings_.begin] = {charstrings_.end, charstring_bytes};
      for (const auto& [begin, own] : privates) {
        const std::uint64_t at = *offset_in(own.dict, subrs, "offset of subroutines");
        Values offsets;
        if (at != 0) offsets[subrs] = {moved(begin + at) - moved(begin)};
        next[begin] = {own.end, dict_bytes(slice(table_, begin, own.end - begin), own.dict, offsets, {})};
      }
      std::vector<Bytes> dicts;
      for (int i = 0; i < font_dict_index_.count; ++i) {
        const CffDict& dict = font_dicts[static_cast<std::size_t>(i)];
        dicts.push_back(dict_bytes(font_dict_index_.object(i), dict, offsets_of(dict), {}));
      }
      if (font_dict_index_.count > 0) {
        next[font_dict_index_.begin] = {font_dict_index_.end,
                                        build_index({dicts.begin(), dicts.end()}, font_dict_index_.offset_size)};
      }
      const Bytes top = dict_bytes(top_dicts_.object(0), top_, offsets_of(top_), others);
      next[top_dicts_.begin] = {top_dicts_.end, build_index({View(top)}, top_dicts_.offset_size)};
      is_laid_out = pieces.size() == next.size() &&
                    std::equal(pieces.begin(), pieces.end(), next.begin(), [](const auto& a, const auto& b) {
                      return a.first == b.first && a.second.bytes == b.second.bytes;
                    });
      pieces = std::move(next);
    };
    // Sizes are settled after the first round, offsets after the second, sizes of Private DICTs in them after the
    // third.
    constexpr int most_rounds = 6;
    for (int round = 0; round < most_rounds && fits && !is_laid_out; ++round) lay_out();
    if (!fits) continue;
    if (!is_laid_out) break;

    Bytes result;
    std::uint64_t at = 0;
    for (const auto& [begin, piece] : pieces) {
      if (begin < at) throw Malformed("table CFF: its structures overlap");
      append(result, table_.subspan(at, begin - at));
      append(result, piece.bytes);
      at = piece.end;
    }
    append(result, table_.subspan(at));
    return result;
  }
  throw Malformed("table CFF: its offsets cannot be settled");
}

// ---- a new table

namespace {

/// The strings every CFF font has without storing them, in their order.
/// Source  Adobe Technical Note 5176, Appendix A.
constexpr const char* standard_strings =
    ".notdef space exclam quotedbl numbersign dollar percent ampersand quoteright parenleft parenright asterisk "
    "plus comma hyphen period slash zero one two three four five six seven eight nine colon semicolon less equal "
    "greater question at A B C D E F G H I J K L M N O P Q R S T U V W X Y Z bracketleft backslash bracketright "
    "asciicircum underscore quoteleft a b c d e f g h i j k l m n o p q r s t u v w x y z braceleft bar "
    "braceright asciitilde exclamdown cent sterling fraction yen florin section currency quotesingle quotedblleft "
    "guillemotleft guilsinglleft guilsinglright fi fl endash dagger daggerdbl periodcentered paragraph bullet "
    "quotesinglbase quotedblbase quotedblright guillemotright ellipsis perthousand questiondown grave acute "
    "circumflex tilde macron breve dotaccent dieresis ring cedilla hungarumlaut ogonek caron emdash AE "
    "ordfeminine Lslash Oslash OE ordmasculine ae dotlessi lslash oslash oe germandbls onesuperior logicalnot mu "
    "trademark Eth onehalf plusminus Thorn onequarter divide brokenbar degree thorn threequarters twosuperior "
    "registered minus eth multiply threesuperior copyright Aacute Acircumflex Adieresis Agrave Aring Atilde "
    "Ccedilla Eacute Ecircumflex Edieresis Egrave Iacute Icircumflex Idieresis Igrave Ntilde Oacute Ocircumflex "
    "Odieresis Ograve Otilde Scaron Uacute Ucircumflex Udieresis Ugrave Yacute Ydieresis Zcaron aacute "
    "acircumflex adieresis agrave aring atilde ccedilla eacute ecircumflex edieresis egrave iacute icircumflex "
    "idieresis igrave ntilde oacute ocircumflex odieresis ograve otilde scaron uacute ucircumflex udieresis "
    "ugrave yacute ydieresis zcaron exclamsmall Hungarumlautsmall dollaroldstyle dollarsuperior ampersandsmall "
    "Acutesmall parenleftsuperior parenrightsuperior twodotenleader onedotenleader zerooldstyle oneoldstyle "
    "twooldstyle threeoldstyle fouroldstyle fiveoldstyle sixoldstyle sevenoldstyle eightoldstyle nineoldstyle "
    "commasuperior threequartersemdash periodsuperior questionsmall asuperior bsuperior centsuperior dsuperior "
    "esuperior isuperior lsuperior msuperior nsuperior osuperior rsuperior ssuperior tsuperior ff ffi ffl "
    "parenleftinferior parenrightinferior Circumflexsmall hyphensuperior Gravesmall Asmall Bsmall Csmall Dsmall "
    "Esmall Fsmall Gsmall Hsmall Ismall Jsmall Ksmall Lsmall Msmall Nsmall Osmall Psmall Qsmall Rsmall Ssmall "
    "Tsmall Usmall Vsmall Wsmall Xsmall Ysmall Zsmall colonmonetary onefitted rupiah Tildesmall exclamdownsmall "
    "centoldstyle Lslashsmall Scaronsmall Zcaronsmall Dieresissmall Brevesmall Caronsmall Dotaccentsmall "
    "Macronsmall figuredash hypheninferior Ogoneksmall Ringsmall Cedillasmall questiondownsmall oneeighth "
    "threeeighths fiveeighths seveneighths onethird twothirds zerosuperior foursuperior fivesuperior sixsuperior "
    "sevensuperior eightsuperior ninesuperior zeroinferior oneinferior twoinferior threeinferior fourinferior "
    "fiveinferior sixinferior seveninferior eightinferior nineinferior centinferior dollarinferior periodinferior "
    "commainferior Agravesmall Aacutesmall Acircumflexsmall Atildesmall Adieresissmall Aringsmall AEsmall "
    "Ccedillasmall Egravesmall Eacutesmall Ecircumflexsmall Edieresissmall Igravesmall Iacutesmall "
    "Icircumflexsmall Idieresissmall Ethsmall Ntildesmall Ogravesmall Oacutesmall Ocircumflexsmall Otildesmall "
    "Odieresissmall OEsmall Oslashsmall Ugravesmall Uacutesmall Ucircumflexsmall Udieresissmall Yacutesmall "
    "Thornsmall Ydieresissmall 001.000 001.001 001.002 001.003 Black Bold Book Light Medium Regular Roman "
    "Semibold";

/// Numbers of strings: the standard ones, then the font's own as they come.
class Strings {
 public:
  Strings() {
    std::istringstream stream(standard_strings);
    for (std::string name; stream >> name;) numbers_.emplace(name, static_cast<int>(numbers_.size()));
  }
  int number(const std::string& name) {
    const auto [at, is_new] = numbers_.emplace(name, static_cast<int>(numbers_.size()));
    if (is_new) own_.emplace_back(name.begin(), name.end());
    return at->second;
  }
  Bytes index() const { return build_index({own_.begin(), own_.end()}, 1); }

 private:
  std::unordered_map<std::string, int> numbers_;
  std::vector<Bytes> own_;
};

void append_operator(Bytes& bytes, int op) {
  if (op > 255) append(bytes, 12, 1);
  append(bytes, static_cast<std::uint64_t>(op & 0xFF), 1);
}

void append_entry(Bytes& bytes, int op, const std::vector<std::int64_t>& operands, std::size_t size = 0) {
  for (const std::int64_t operand : operands) append(bytes, dict_number(operand, size));
  append_operator(bytes, op);
}

/// A real number by its digits, in nibbles.
void append_real(Bytes& bytes, double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.15g", value);
  std::vector<int> nibbles;
  for (const char* at = digits; *at; ++at) {
    if (*at == 'e') {
      const bool is_negative = at[1] == '-';
      nibbles.push_back(is_negative ? 12 : 11);
      ++at;
    } else {
      nibbles.push_back(*at == '.' ? 10 : *at == '-' ? 14 : *at - '0');
    }
  }
  nibbles.push_back(15);
  if (nibbles.size() % 2) nibbles.push_back(15);
  append(bytes, 30, 1);
  for (std::size_t i = 0; i < nibbles.size(); i += 2) {
    append(bytes, static_cast<std::uint64_t>(nibbles[i] << 4 | nibbles[i + 1]), 1);
  }
}

/// Names by glyph as ranges of string numbers, in the format that takes fewer bytes.
Bytes build_charset(const std::vector<int>& numbers) {
  std::vector<std::pair<int, int>> ranges;  // first number, how many
  for (std::size_t glyph = 1; glyph < numbers.size(); ++glyph) {
    if (!ranges.empty() && ranges.back().first + ranges.back().second == numbers[glyph]) {
      ++ranges.back().second;
    } else {
      ranges.emplace_back(numbers[glyph], 1);
    }
  }
  constexpr int most_short = 256;
  std::size_t short_bytes = 0;
  for (const auto& [first, count] : ranges) {
    short_bytes += 3 * static_cast<std::size_t>((count + most_short - 1) / most_short);
  }
  const bool is_short = short_bytes <= 4 * ranges.size();
  Bytes bytes;
  append(bytes, is_short ? 1 : 2, 1);
  for (auto [first, count] : ranges) {
    while (count > 0) {
      const int part = is_short ? std::min(count, most_short) : count;
      append(bytes, static_cast<std::uint64_t>(first), 2);
      append(bytes, static_cast<std::uint64_t>(part - 1), is_short ? 1 : 2);
      first += part;
      count -= part;
    }
  }
  return bytes;
}

/// The width most glyphs have, which they need not say, and the one that the others' are told from.
struct Widths {
  int usual = 0;
  int nominal = 0;
};

Widths choose_widths(const std::vector<int>& advances) {
  std::map<int, std::int64_t> uses;
  for (const int advance : advances) ++uses[advance];
  Widths widths;
  std::int64_t most = -1;
  for (const auto& [advance, count] : uses) {
    if (count > most) {
      most = count;
      widths.usual = advance;
    }
  }
  uses.erase(widths.usual);
  constexpr int one_byte = 107;
  constexpr int two_bytes = 1131;
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (const auto& [lowest, count] : uses) {  // the lowest width that takes a byte
    const int nominal = lowest + one_byte;
    std::int64_t bytes = 0;
    for (const auto& [advance, times] : uses) {
      const int away = std::abs(advance - nominal);
      bytes += times * (away <= one_byte ? 1 : away <= two_bytes ? 2 : 3);
    }
    if (bytes < least) {
      least = bytes;
      widths.nominal = nominal;
    }
  }
  return widths;
}

}  // namespace

Bytes build_cff(const NewCff& font) {
  const std::size_t count = font.names.size();
  if (count == 0 || font.outlines.size() != count || font.advances.size() != count) {
    throw Malformed(text("table CFF: ", count, " names, ", font.outlines.size(), " outlines and ", font.advances.size(),
                         " advances"));
  }
  Strings strings;
  std::vector<int> numbers;
  for (std::size_t glyph = 0; glyph < count; ++glyph) {
    numbers.push_back(strings.number(glyph == 0 ? ".notdef" : font.names[glyph]));
  }
  constexpr int most_strings = 64999;
  const bool is_cid_keyed = *std::ranges::max_element(numbers) > most_strings;
  if (is_cid_keyed) {
    strings = Strings();
    for (std::size_t glyph = 0; glyph < count; ++glyph) numbers[glyph] = static_cast<int>(glyph);
  }
  const std::vector<std::int64_t> collection =
      is_cid_keyed ? std::vector<std::int64_t>{strings.number("Adobe"), strings.number("Identity"), 0}
                   : std::vector<std::int64_t>();
  const Widths widths = choose_widths(font.advances);
  std::vector<Bytes> charstrings;
  for (std::size_t glyph = 0; glyph < count; ++glyph) {
    std::optional<double> width;
    if (font.advances[glyph] != widths.usual) width = font.advances[glyph] - widths.nominal;
    try {
      charstrings.push_back(encode_charstring(font.outlines[glyph], {}, width));
    } catch (const Malformed& error) {
      throw Malformed(text(font.names[glyph], ": ", error.what()));
    }
  }
  Bytes own;
  if (widths.usual != 0) append_entry(own, default_width, {widths.usual});
  if (widths.nominal != 0) append_entry(own, nominal_width, {widths.nominal});
  const Bytes charset_bytes = build_charset(numbers);
  const Bytes charstring_bytes = build_index({charstrings.begin(), charstrings.end()}, 1);

  Bytes result{1, 0, 4, 4};
  const Bytes name(font.name.begin(), font.name.end());
  append(result, build_index({View(name)}, 1));
  Bytes selection;  // every glyph has the one Font DICT
  if (is_cid_keyed) {
    append(selection, 3, 1);
    for (const std::uint64_t value : {std::uint64_t{1}, std::uint64_t{0}}) append(selection, value, 2);
    append(selection, 0, 1);
    append(selection, count, 2);
  }
  constexpr std::size_t any_offset = 5;
  const auto append_private = [&](Bytes& dict, std::int64_t own_at) {
    append_entry(dict, private_dict, {static_cast<std::int64_t>(own.size()), own_at}, any_offset);
  };
  const auto top_index = [&](std::uint64_t body) {
    Bytes top;
    if (is_cid_keyed) append_entry(top, ros, collection);
    append_entry(top, font_bbox, {font.box.x_min, font.box.y_min, font.box.x_max, font.box.y_max});
    if (font.units_per_em != 1000) {
      for (const double entry : {1.0, 0.0, 0.0, 1.0, 0.0, 0.0}) {
        entry == 0.0 ? append(top, dict_number(0, 0)) : append_real(top, entry / font.units_per_em);
      }
      append_operator(top, font_matrix);
    }
    const auto at = static_cast<std::int64_t>(body);
    const auto behind_charset = at + static_cast<std::int64_t>(charset_bytes.size());
    const auto behind_charstrings = behind_charset + static_cast<std::int64_t>(charstring_bytes.size());
    append_entry(top, charset, {at}, any_offset);
    append_entry(top, char_strings, {behind_charset}, any_offset);
    if (is_cid_keyed) {
      const auto behind_selection = behind_charstrings + static_cast<std::int64_t>(own.size() + selection.size());
      append_entry(top, cid_count, {static_cast<std::int64_t>(count)});
      append_entry(top, fd_select, {behind_charstrings + static_cast<std::int64_t>(own.size())}, any_offset);
      append_entry(top, fd_array, {behind_selection}, any_offset);
    } else {
      append_private(top, behind_charstrings);
    }
    return build_index({View(top)}, 1);
  };
  const Bytes string_index = strings.index();
  const std::uint64_t body = result.size() + top_index(0).size() + string_index.size() + 2;
  append(result, top_index(body));
  append(result, string_index);
  append(result, 0, 2);  // no global subroutines
  append(result, charset_bytes);
  append(result, charstring_bytes);
  const auto own_at = static_cast<std::int64_t>(result.size());
  append(result, own);
  append(result, selection);
  if (is_cid_keyed) {
    Bytes dict;
    append_private(dict, own_at);
    append(result, build_index({View(dict)}, 1));
  }
  return result;
}

std::optional<Box> drawn_box(const std::vector<BezierContour>& contours) {
  const fontcore::Box drawn = tight_box(contours);
  if (drawn.is_empty()) return std::nullopt;
  const auto whole = [](double value) {
    if (!(value >= std::numeric_limits<std::int16_t>::min() && value <= std::numeric_limits<std::int16_t>::max())) {
      throw Malformed(text("box coordinate ", value, " does not fit in 16 bits"));
    }
    return static_cast<int>(value);
  };
  return Box{whole(std::floor(drawn.low.x())), whole(std::floor(drawn.low.y())), whole(std::ceil(drawn.high.x())),
             whole(std::ceil(drawn.high.y()))};
}

void check_cff2_variations(View table, int glyph_count) {
  constexpr std::uint64_t most_regions = 512;  // a blend of one number takes 513 operands then, all there are
  constexpr std::uint64_t most_steps = 1'000'000'000;
  const View top = slice(table, u8(table, 2), u16(table, 3));
  for (const CffEntry& entry : read_dict(top, "Top DICT", last_cff2_operator)) {
    if (entry.op != variation_store || entry.operands.empty()) continue;
    const double at = entry.operands.back();
    if (!(at >= 0.0 && at <= static_cast<double>(table.size()))) {
      throw Malformed(text("table CFF2: its variation store lies at ", at));
    }
    const std::uint64_t store = static_cast<std::uint64_t>(at) + 2;  // behind its length
    const std::uint64_t axes = u16(table, store + u32(table, store + 2));
    for (std::uint64_t i = 0; i < u16(table, store + 6); ++i) {
      const std::uint64_t regions = u16(table, store + u32(table, store + 8 + 4 * i) + 4);
      if (regions > most_regions) {
        throw Malformed(text("table CFF2: a list of ", regions, " regions, more than a charstring can blend by"));
      }
      if (regions * axes * static_cast<std::uint64_t>(glyph_count) > most_steps) {
        throw Malformed("table CFF2: its variations take more than a thousand million steps to weigh");
      }
    }
  }
}

}  // namespace glyphs::sfnt
