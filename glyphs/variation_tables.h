#pragma once

// Private to `instantiate`: what the tables of variations come to at a place. Every read is checked and budgeted.
//
// Source  OpenType: fvar, avar, gvar, cvar, HVAR, VVAR, MVAR, GDEF, GPOS, Font Variations Common Table Formats.

#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <vector>

#include "glyphs/font.h"
#include "glyphs/sfnt_tables.h"
#include "glyphs/variation.h"

namespace glyphs::variation {

inline double round_half_up(double value) { return std::floor(value + 0.5); }
/// Rounded half up.
/// Throws  Malformed, naming what it is, if it does not fit.
int to_int16(double value, const char* what);

/// Steps that decoding may take in all. The largest fonts in use, of 65,535 glyphs, take a tenth of it.
class Budget {
 public:
  void spend(std::uint64_t steps) {
    constexpr std::uint64_t most = 1'000'000'000;
    spent_ += steps;
    if (spent_ > most) throw Exhausted("its variations take more than a thousand million steps to decode");
  }
  /// Ends the whole job, where a Malformed ends one glyph.
  struct Exhausted : std::runtime_error {
    using std::runtime_error::runtime_error;
  };

 private:
  std::uint64_t spent_ = 0;
};

struct Axis {
  sfnt::Tag name = 0;
  double minimum = 0.0;
  double initial = 0.0;
  double maximum = 0.0;
};

/// Throws  Malformed if `fvar` has none, or one whose values do not rise.
std::vector<Axis> read_axes(sfnt::View fvar);

/// The place in the coordinates that variations are given in: -1 to 1, 0 the default, bent by avar.
///
/// Throws  Malformed, naming the axes there are, if the font has no such axis, or the axis no such value.
std::vector<double> normalize(const std::vector<Axis>& axes, const Location& location, const sfnt::Directory& tables);

/// Point numbers of a tuple; none listed means all.
struct PointNumbers {
  bool is_all = true;
  std::vector<int> list;
};

struct SharedTuples {
  sfnt::View bytes;
  std::uint64_t count = 0;
};

using UseTuple = std::function<void(double share, const PointNumbers& numbers, const std::vector<int>& x,
                                    const std::vector<int>& y)>;
/// Gives `use` every tuple of `gvar` or `cvar` that counts at the place: how much, its points, and its deltas, x before
/// y.
void for_each_tuple(sfnt::View bytes, std::uint64_t header, const SharedTuples& shared,
                    const std::vector<double>& place, std::size_t point_count, int dimensions, Budget& budget,
                    const UseTuple& use);

struct Vector {
  double x = 0.0;
  double y = 0.0;
};

/// Moves the untouched points of a contour along with the touched ones.
void infer(const std::vector<Vector>& points, std::size_t first, std::size_t last, const std::vector<bool>& is_touched,
           std::vector<Vector>& moves);

/// Deltas of single numbers: of HVAR, VVAR, MVAR, GDEF and what refers to it.
class VariationStore {
 public:
  VariationStore(sfnt::View table, std::uint64_t offset, const std::vector<double>& place, Budget& budget);

  /// 0 where the store has nothing.
  double delta(unsigned outer, unsigned inner) const;

 private:
  sfnt::View bytes_;
  Budget& budget_;
  std::vector<double> scalars_;
};

/// What HVAR or VVAR says of the glyphs' metrics.
class MetricVariations {
 public:
  MetricVariations(sfnt::View table, const std::vector<double>& place, Budget& budget);

  /// Where the header says by which map a metric's variations are found.
  enum Map : unsigned { advances = 8, top_bearings = 12, vertical_origins = 20 };

  bool has(Map map) const { return sfnt::u32(table_, map) != 0; }

  /// Without a map advances are found by glyph id, and no other metric varies.
  double delta(Map which, int glyph) const;

 private:
  sfnt::View table_;
  VariationStore store_;
};

/// Puts what a variation store says into the numbers of GPOS, and takes the references to it away. Returns how many
/// groups of numbers have no room for it.
int patch_gpos(Bytes& gpos, const VariationStore& store, Budget& budget);
/// The same for GDEF, where all have room.
void patch_gdef(Bytes& gdef, const VariationStore& store, Budget& budget);

/// Lets the features of GSUB or GPOS that others stand for at the place be those. False if an offset does not fit; then
/// the features are as at the default.
bool settle_features(Bytes& table, const std::vector<double>& place);

}  // namespace glyphs::variation
