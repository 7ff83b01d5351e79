#pragma once

// The bytes of small variable fonts, made without the library: tests judge by these.

#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "tests/glyphs/cff_bytes.h"
#include "tests/glyphs/sfnt_bytes.h"

namespace variable_bytes {

using namespace sfnt_bytes;
using Tables = std::map<std::string, Bytes>;

inline Bytes words(const std::vector<int>& values) {
  Bytes bytes;
  for (const int value : values) put16(bytes, value);
  return bytes;
}
inline Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

inline constexpr int one = 0x4000;  // in 2.14

struct Axis {
  std::string tag;
  int minimum;
  int initial;
  int maximum;
};

inline Bytes fvar_of(const std::vector<Axis>& axes) {
  const int count = static_cast<int>(axes.size());
  Bytes fvar = words({1, 0, 16, 2, count, 20, 0, 4 * count + 4});
  for (const Axis& axis : axes) {
    fvar.insert(fvar.end(), axis.tag.begin(), axis.tag.end());
    for (const int value : {axis.minimum, axis.initial, axis.maximum}) {
      put(fvar, static_cast<std::uint32_t>(value) << 16, 4);
    }
    put16(fvar, 0);
    put16(fvar, 256);
  }
  return fvar;
}

inline Bytes weight_axis() { return fvar_of({{"wght", 100, 400, 900}}); }

/// Variations of one glyph: a tuple for heavier, and its points and deltas as packed bytes.
inline Bytes tuple(const Bytes& packed) {
  Bytes bytes = words({1, 10, static_cast<int>(packed.size()), 0xA000, one});
  bytes.insert(bytes.end(), packed.begin(), packed.end());
  bytes.resize((bytes.size() + 1) / 2 * 2);
  return bytes;
}

inline Bytes gvar_of(const std::vector<Bytes>& variations) {
  const int count = static_cast<int>(variations.size());
  Bytes gvar = words({1, 0, 1, 0});
  put(gvar, 0, 4);
  put16(gvar, count);
  put16(gvar, 0);
  put(gvar, static_cast<std::uint32_t>(20 + 2 * (count + 1)), 4);
  Bytes data;
  for (const Bytes& its : variations) {
    put16(gvar, static_cast<int>(data.size() / 2));
    data.insert(data.end(), its.begin(), its.end());
  }
  put16(gvar, static_cast<int>(data.size() / 2));
  return joined({gvar, data});
}

/// Deltas by row, for some of the regions.
struct DeltaList {
  std::vector<int> regions;
  std::vector<std::vector<int>> rows;
};

/// A variation store; a region is start, peak and end for every axis, in 2.14.
inline Bytes variation_store(const std::vector<std::vector<int>>& regions, const std::vector<DeltaList>& lists) {
  const std::size_t region_bytes = 4 + 2 * regions.size() * regions.at(0).size();
  Bytes list = words({static_cast<int>(regions[0].size() / 3), static_cast<int>(regions.size())});
  for (const std::vector<int>& region : regions) list = joined({list, words(region)});
  Bytes store = words({1});
  const std::size_t head = 8 + 4 * lists.size();
  put(store, static_cast<std::uint32_t>(head), 4);
  put16(store, static_cast<int>(lists.size()));
  Bytes data;
  for (const DeltaList& deltas : lists) {
    put(store, static_cast<std::uint32_t>(head + region_bytes + data.size()), 4);
    const int count = static_cast<int>(deltas.regions.size());
    data = joined({data, words({static_cast<int>(deltas.rows.size()), deltas.rows.empty() ? 0 : count, count}),
                   words(deltas.regions)});
    for (const std::vector<int>& row : deltas.rows) data = joined({data, words(row)});
  }
  return joined({store, list, data});
}

/// One region, heavier, and one delta.
inline Bytes store_of(int delta) { return variation_store({{0, one, one}}, {{{0}, {{delta}}}}); }

inline constexpr unsigned char low(int value) { return static_cast<unsigned char>(value & 0xFF); }

/// .notdef empty; A a triangle, all points moved; B a square, of which two points move and two follow; C a composite
/// of both whose second part moves. Kerning of A and B -50, 20 less at the heaviest; the x-height 40 more.
inline Tables variable_tables() {
  const Bytes triangle = simple_glyph({{{0, 0}, {300, 0}, {0, 300}}}, 0x40, {0x4F});
  const Bytes square = simple_glyph({{{0, 0}, {300, 0}, {300, 300}, {0, 300}}});
  Tables tables =
      small_font({{}, triangle, square, composite({{.glyph = 1}, {.glyph = 2, .first = 120, .second = 7}})});
  tables["fvar"] = weight_axis();
  tables["gvar"] = gvar_of({
      tuple({1, 0, 1, 0x00, 30, 0x80}),  // point 1, the advance: wider by 30
      tuple({0, 6, low(-10), 60, 20, 0, 50, 0, 0, 6, low(-5), low(-7), 45, 0, 0, 0, 0}),
      tuple({2, 1, 0, 2, 0x01, low(-20), 80, 0x01, low(-8), 31}),
      tuple({2, 1, 1, 2, 0x01, 33, 70, 0x81}),
  });
  tables["cvt "] = words({100, 200});
  tables["cvar"] = joined({words({1, 0, 1, 14, 5, 0xA000, one}), Bytes{1, 0, 1, 0x00, 44}});
  Bytes os2(96);
  sfnt_bytes::set16(os2, 0, 4);
  sfnt_bytes::set16(os2, 4, 400);
  sfnt_bytes::set16(os2, 86, 500);
  tables["OS/2"] = os2;
  Bytes mvar = words({1, 0, 0, 8, 1, 20});
  mvar.insert(mvar.end(), {'x', 'h', 'g', 't'});
  tables["MVAR"] = joined({mvar, words({0, 0}), store_of(40)});
  Bytes gdef = words({1, 3, 0, 0, 0, 0, 0});
  put(gdef, 18, 4);
  tables["GDEF"] = joined({gdef, store_of(-20)});
  // Pairs of glyph 1 with glyph 2: a value with a number and its variation.
  const Bytes scripts = joined({words({1}), Bytes{'D', 'F', 'L', 'T'}, words({8}), words({4, 0, 0, 0xFFFF, 1, 0})});
  const Bytes features = joined({words({1}), Bytes{'k', 'e', 'r', 'n'}, words({8}), words({0, 1, 0})});
  const Bytes lookups = words({1, 4, 2, 0, 1, 8});
  const Bytes pairs =
      words({1, 12, 0x44, 0, 1, 18, 1, 1, 1, /* pair set */ 1, 2, -50, 8, /* variation */ 0, 0, 0x8000});
  const int scripts_at = 10;
  const int features_at = scripts_at + static_cast<int>(scripts.size());
  const int lookups_at = features_at + static_cast<int>(features.size());
  tables["GPOS"] = joined({words({1, 0, scripts_at, features_at, lookups_at}), scripts, features, lookups, pairs});
  return tables;
}

// ---- CFF2

/// As in CFF, with a count of four bytes.
inline Bytes cff2_index(const std::vector<Bytes>& objects) {
  Bytes bytes{0, 0};
  const Bytes index = cff_bytes::index(objects);
  bytes.insert(bytes.end(), index.begin(), index.end());
  return bytes;
}

struct Cff2 {
  std::vector<Bytes> charstrings;
  std::vector<Bytes> global_subroutines;
  std::vector<Bytes> local_subroutines;
  Bytes store;
};

/// The table: global subroutines, variation store, charstrings, one Private DICT with its subroutines, FDArray.
inline Bytes cff2_table(const Cff2& font) {
  using cff_bytes::entry;
  const Bytes globals = cff2_index(font.global_subroutines);
  const Bytes store = joined({words({static_cast<int>(font.store.size())}), font.store});
  const Bytes charstrings = cff2_index(font.charstrings);
  const Bytes own = joined({entry(19, {6}), cff2_index(font.local_subroutines)});
  constexpr int top_size = 19;
  const auto size = [](const Bytes& bytes) { return static_cast<int>(bytes.size()); };
  const int store_at = 5 + top_size + size(globals);
  const int charstrings_at = store_at + size(store);
  const int own_at = charstrings_at + size(charstrings);
  const Bytes dicts = cff2_index({entry(18, {6, own_at})});
  return joined({Bytes{2, 0, 5, 0, top_size}, entry(17, {charstrings_at}), entry(1236, {own_at + size(own)}),
                 entry(24, {store_at}), globals, store, charstrings, own, dicts});
}

/// What varies when heavier, and when narrower.
inline const std::vector<std::vector<int>> heavier_and_narrower{{0, one, one, 0, 0, 0}, {0, 0, 0, -one, -one, 0}};

/// HVAR or VVAR: a store of the two regions with these rows, and maps from glyphs to rows behind the header of
/// `header_size` bytes; the maps' offsets stand from byte 8 on.
inline Bytes varied_metrics(const std::vector<std::vector<int>>& rows, std::size_t header_size,
                            const std::vector<Bytes>& maps) {
  const Bytes store = variation_store(heavier_and_narrower, {{{0, 1}, rows}});
  Bytes table = words({1, 0});
  put(table, static_cast<std::uint32_t>(header_size), 4);
  Bytes body = store;
  for (const Bytes& map : maps) {
    put(table, map.empty() ? 0 : static_cast<std::uint32_t>(header_size + body.size()), 4);
    body.insert(body.end(), map.begin(), map.end());
  }
  table.resize(header_size);
  return joined({table, body});
}

/// Axes wght and wdth. .notdef empty; A a triangle that varies with the weight; B a square that varies with both,
/// by blends in a local and a global subroutine too; C of curves and lines, which varies with the weight. Advances 600,
/// and by HVAR; the x-height by MVAR.
inline Tables cff2_tables() {
  using cff_bytes::charstring;
  Tables tables = small_font(std::vector<Bytes>(4));
  tables.erase("glyf");
  tables.erase("loca");
  tables["maxp"] = {0, 0, 0x50, 0, 0, 4};
  tables["fvar"] = fvar_of({{"wght", 100, 400, 900}, {"wdth", 75, 100, 100}});
  tables["CFF2"] =
      cff2_table({.charstrings = {{},
                                  charstring("0 0 -10 -5 2 blend rmoveto 300 0 70 -2 2 blend rlineto "
                                             "-300 300 -40 52 2 blend rlineto"),
                                  charstring("1 vsindex 20 40 10 -8 -5 3 2 blend rmoveto -107 callsubr -107 callgsubr "
                                             "-300 -60 90 1 blend hlineto"),
                                  charstring("100 100 rmoveto 0 55 45 45 55 0 0 10 20 30 40 50 6 blend rrcurveto "
                                             "55 0 45 -45 0 -55 rrcurveto 80 -20 1 blend vlineto")},
                  .global_subroutines = {charstring("300 40 20 1 blend vlineto")},
                  .local_subroutines = {charstring("300 60 -90 1 blend hlineto")},
                  .store = variation_store(heavier_and_narrower, {{{0}, {}}, {{0, 1}, {}}})});
  tables["HVAR"] = varied_metrics({{30, 0}, {50, -7}, {70, -100}, {0, 0}}, 20, {});
  Bytes os2(96);
  set16(os2, 0, 4);
  set16(os2, 4, 400);
  set16(os2, 86, 500);
  tables["OS/2"] = os2;
  tables["MVAR"] = joined({words({1, 0, 0, 8, 1, 20}), Bytes{'x', 'h', 'g', 't'}, words({0, 0}),
                           variation_store(heavier_and_narrower, {{{0, 1}, {{40, -10}}}})});
  return tables;
}

inline Bytes otto(const Tables& tables) {
  Bytes font = font_of(tables);
  for (std::size_t i = 0; i < 4; ++i) font[i] = static_cast<unsigned char>("OTTO"[i]);
  return font;
}

}  // namespace variable_bytes
