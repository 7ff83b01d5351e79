#pragma once

// The bytes of charstrings and of small CFF fonts, made without the library: tests judge by these.

#include <cmath>
#include <cstdint>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/glyphs/sfnt_bytes.h"

namespace cff_bytes {

using sfnt_bytes::Bytes;
using sfnt_bytes::put;

/// A charstring from its words: "0 100 rmoveto 50 hlineto endchar". Numbers without a point take three bytes, others
/// five; #ff is the byte itself.
inline Bytes charstring(const std::string& words) {
  static const std::map<std::string, int> operators{
      {"hstem", 1},         {"vstem", 3},      {"vmoveto", 4},    {"rlineto", 5},     {"hlineto", 6},
      {"vlineto", 7},       {"rrcurveto", 8},  {"callsubr", 10},  {"return", 11},     {"vsindex", 15},
      {"blend", 16},        {"endchar", 14},   {"hstemhm", 18},   {"hintmask", 19},   {"cntrmask", 20},
      {"rmoveto", 21},      {"hmoveto", 22},   {"vstemhm", 23},   {"rcurveline", 24}, {"rlinecurve", 25},
      {"vvcurveto", 26},    {"hhcurveto", 27}, {"callgsubr", 29}, {"vhcurveto", 30},  {"hvcurveto", 31},
      {"dotsection", 1200}, {"and", 1203},     {"or", 1204},      {"not", 1205},      {"abs", 1209},
      {"add", 1210},        {"sub", 1211},     {"div", 1212},     {"neg", 1214},      {"eq", 1215},
      {"drop", 1218},       {"put", 1220},     {"get", 1221},     {"ifelse", 1222},   {"random", 1223},
      {"mul", 1224},        {"sqrt", 1226},    {"dup", 1227},     {"exch", 1228},     {"index", 1229},
      {"roll", 1230},       {"hflex", 1234},   {"flex", 1235},    {"hflex1", 1236},   {"flex1", 1237}};
  Bytes bytes;
  std::istringstream stream(words);
  for (std::string word; stream >> word;) {
    if (const auto found = operators.find(word); found != operators.end()) {
      if (found->second >= 1200) put(bytes, 12, 1);
      put(bytes, static_cast<std::uint32_t>(found->second % 1200), 1);
    } else if (word[0] == '#') {
      put(bytes, static_cast<std::uint32_t>(std::stoi(word.substr(1), nullptr, 16)), 1);
    } else if (word.find('.') != std::string::npos) {
      put(bytes, 255, 1);
      put(bytes, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(std::stod(word) * 65536))), 4);
    } else {
      put(bytes, 28, 1);
      sfnt_bytes::put16(bytes, std::stoi(word));
    }
  }
  return bytes;
}

/// Offsets of two bytes, or of four.
inline Bytes index(const std::vector<Bytes>& objects) {
  Bytes bytes;
  std::size_t total = 0;
  for (const Bytes& object : objects) total += object.size();
  const int offset_size = total < 0xFFFF ? 2 : 4;
  put(bytes, static_cast<std::uint32_t>(objects.size()), 2);
  if (objects.empty()) return bytes;
  put(bytes, static_cast<std::uint32_t>(offset_size), 1);
  std::uint32_t offset = 1;
  put(bytes, offset, offset_size);
  for (const Bytes& object : objects) put(bytes, offset += static_cast<std::uint32_t>(object.size()), offset_size);
  for (const Bytes& object : objects) bytes.insert(bytes.end(), object.begin(), object.end());
  return bytes;
}

/// Operands in five bytes each, and the operator; 1200 more for those of two bytes.
inline Bytes entry(int op, const std::vector<int>& operands) {
  Bytes bytes;
  for (const int operand : operands) {
    put(bytes, 29, 1);
    put(bytes, static_cast<std::uint32_t>(operand), 4);
  }
  if (op >= 1200) put(bytes, 12, 1);
  put(bytes, static_cast<std::uint32_t>(op % 1200), 1);
  return bytes;
}

inline Bytes joined(const std::vector<Bytes>& parts) {
  Bytes bytes;
  for (const Bytes& part : parts) bytes.insert(bytes.end(), part.begin(), part.end());
  return bytes;
}

/// A Font DICT of a CID-keyed font.
struct FontDict {
  std::vector<Bytes> local_subroutines;
  Bytes matrix;  ///< an entry of its own
};

struct Cff {
  std::vector<Bytes> charstrings;
  std::vector<Bytes> global_subroutines;
  std::vector<Bytes> local_subroutines;
  std::vector<FontDict> font_dicts;  ///< CID-keyed if there are any
  std::vector<int> selection;        ///< Font DICT by glyph, if CID-keyed
  Bytes more_top;                    ///< further entries of the Top DICT
  Bytes between = {};                ///< bytes before the charstrings that nothing points to
  Bytes charset = {};                ///< ISOAdobe if empty
};

/// The table: charset, FDSelect, charstrings, Private DICTs with their subroutines, FDArray; nominalWidthX 500.
inline Bytes table(const Cff& font) {
  const Bytes head{1, 0, 4, 2};
  const Bytes names = index({{'S', 'm', 'a', 'l', 'l'}});
  const Bytes strings = index({{'A', 'd', 'o', 'b', 'e'}, {'I', 'd', 'e', 'n', 't', 'i', 't', 'y'}});
  const Bytes globals = index(font.global_subroutines);
  const bool is_cid = !font.font_dicts.empty();
  const auto top_of = [&](int charset, int select, int charstrings, const Bytes& last) {
    std::vector<Bytes> parts;
    if (is_cid) parts.push_back(entry(1230, {391, 392, 0}));
    parts.push_back(entry(5, {0, 0, 1000, 1000}));
    if (charset > 0) parts.push_back(entry(15, {charset}));
    if (is_cid) parts.push_back(entry(1237, {select}));
    parts.push_back(entry(17, {charstrings}));
    parts.push_back(last);
    parts.push_back(font.more_top);
    return joined(parts);
  };
  const auto private_of = [](const std::vector<Bytes>& subroutines) {
    const Bytes widths = joined({entry(20, {600}), entry(21, {500})});
    return subroutines.empty() ? widths : joined({widths, entry(19, {static_cast<int>(widths.size()) + 6})});
  };
  const Bytes as_long = is_cid ? entry(1236, {0}) : entry(18, {0, 0});
  const auto size = [](const Bytes& bytes) { return static_cast<int>(bytes.size()); };
  const int start = size(head) + size(names) + size(index({top_of(font.charset.empty() ? 0 : 1, 0, 0, as_long)})) +
                    size(strings) + size(globals);
  Bytes body = font.charset;
  const int charset = body.empty() ? 0 : start;
  const int select = start + size(body);
  if (is_cid) {
    put(body, 0, 1);
    for (const int number : font.selection) put(body, static_cast<std::uint32_t>(number), 1);
  }
  body.insert(body.end(), font.between.begin(), font.between.end());
  const int charstrings = start + size(body);
  body = joined({body, index(font.charstrings)});
  const auto add_private = [&](const std::vector<Bytes>& subroutines) {
    const Bytes dict = private_of(subroutines);
    const Bytes made = entry(18, {size(dict), start + size(body)});
    body = joined({body, dict, subroutines.empty() ? Bytes{} : index(subroutines)});
    return made;
  };
  Bytes last;
  if (is_cid) {
    std::vector<Bytes> dicts;
    for (const FontDict& dict : font.font_dicts)
      dicts.push_back(joined({dict.matrix, add_private(dict.local_subroutines)}));
    last = entry(1236, {start + size(body)});
    body = joined({body, index(dicts)});
  } else {
    last = add_private(font.local_subroutines);
  }
  return joined({head, names, index({top_of(charset, select, charstrings, last)}), strings, globals, body});
}

/// An OpenType font around the table; advances 600, left side bearings 0, glyph 1 is 'A', and so on.
inline Bytes otf_of(const Bytes& cff, int glyphs, std::map<std::string, Bytes> more = {}) {
  auto tables = sfnt_bytes::small_font(std::vector<Bytes>(static_cast<std::size_t>(glyphs)));
  tables.erase("glyf");
  tables.erase("loca");
  tables["CFF "] = cff;
  tables["maxp"] =
      joined({{0, 0, 0x50, 0}, {static_cast<unsigned char>(glyphs >> 8), static_cast<unsigned char>(glyphs & 0xFF)}});
  for (auto& [tag, bytes] : more) tables[tag] = bytes;
  Bytes font = sfnt_bytes::font_of(tables);
  for (int i = 0; i < 4; ++i) font[static_cast<std::size_t>(i)] = static_cast<unsigned char>("OTTO"[i]);
  return font;
}

inline Bytes otf_of(const Cff& cff) { return otf_of(table(cff), static_cast<int>(cff.charstrings.size())); }

}  // namespace cff_bytes
