#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "fontcore/error.h"
#include "fontcore/wavelet.h"

// Chaikin's filters on interleaved x, y. A run is one level over neighbouring points, some points a vector; a cascade
// is several levels of one block, a run each, whose numbers stay in the nearest cache; a pass is a whole curve, block
// by block. So memory is gone through about once, whatever the number of levels.
//
// Vectors of every width do the same operations, those of the matrices in wavelet.cpp, and results are the same to the
// last bit on every machine. Where a product is fused with a sum that holds as well: every factor is a quarter, so that
// products are exact (down to 1e-307).

namespace fontcore::chaikin {

namespace {

using Eigen::Index;

constexpr Index block_size = 1024;   // fine points: with all that comes of them they fit the nearest cache
constexpr int pass_levels = 6;       // of a curve larger than a block; what they leave is small
constexpr Index fetched_ahead = 64;  // numbers: places of details are fetched so early; processors do not foresee them

template <int width>
struct Lanes {
  using Vector [[gnu::vector_size(sizeof(double) * width)]] = double;
};
using Point = Lanes<2>::Vector;

Point point_at(const double* numbers) {
  Point point;
  std::memcpy(&point, numbers, sizeof point);
  return point;
}

// Numbers pattern(0), pattern(1) ... of two vectors side by side. Wide vectors go by reference: how they are passed by
// value depends on the instructions a function is compiled for.
template <auto pattern, typename Vector, typename Picked, int... k>
[[gnu::always_inline]] inline void pick(const Vector& first, const Vector& second, Picked& picked,
                                        std::integer_sequence<int, k...>) {
  picked = __builtin_shufflevector(first, second, pattern(k)...);
}

template <int width, auto pattern, typename Vector, typename Picked>
[[gnu::always_inline]] inline void pick(const Vector& first, const Vector& second, Picked& picked) {
  pick<pattern>(first, second, picked, std::make_integer_sequence<int, width>());
}

// 2m points to m and m details, [HBS05] eq. 7 with its sums shared: A = (3 x_{2i} - x_{2i+1}) / 4 and
// B = (3 x_{2i+1} - x_{2i}) / 4 are x less the quarter of their sum; coarse_i = A_i + B_{i-1} and
// detail_i = A_i - B_{i-1}. `carry` is the B before the first pair, then that of the last. `coarse` may be `fine`.
template <int width>
[[gnu::always_inline]] inline void split_run(const double* fine, Index m, double* coarse, double* detail,
                                             Point& carry) {
  using Vector = typename Lanes<width>::Vector;
  constexpr Index pairs = width / 2;
  Vector before;
  pick<width, [](int k) { return k % 2; }>(carry, carry, before);
  Index i = 0;
#pragma GCC unroll 2
  for (; i + pairs <= m; i += pairs) {
    Vector one;
    Vector two;
    Vector first;
    Vector second;
    Vector previous;
    std::memcpy(&one, fine + 4 * i, sizeof one);
    std::memcpy(&two, fine + 4 * i + width, sizeof two);
    __builtin_prefetch(detail + 2 * i + fetched_ahead, 1);
    pick<width, [](int k) { return 2 * k - k % 2; }>(one, two, first);
    pick<width, [](int k) { return 2 * k - k % 2 + 2; }>(one, two, second);
    const Vector quarter = 0.25 * (first + second);
    const Vector A = first - quarter;
    const Vector B = second - quarter;
    pick<width, [](int k) { return width - 2 + k; }>(before, B, previous);
    const Vector sum = A + previous;
    const Vector difference = A - previous;
    std::memcpy(coarse + 2 * i, &sum, sizeof sum);
    std::memcpy(detail + 2 * i, &difference, sizeof difference);
    before = B;
  }
  pick<2, [](int k) { return width - 2 + k; }>(before, before, carry);
  if constexpr (width > 2) {
    if (i < m) split_run<width / 2>(fine + 4 * i, m - i, coarse + 2 * i, detail + 2 * i, carry);
  }
}

// Where number k is, of points taken from one vector and the other in turn.
template <int width>
constexpr int alternating(int k) {
  return k / 4 * 2 + k % 2 + k / 2 % 2 * width;
}

// m points and m details to 2m, [HBS05] eq. 8, corrected: x_{2i} and x_{2i+1} lie a quarter of the way between
// here = c_i + d_i and there = c_{i+1} - d_{i+1}. From the last to the first: `carry` is `there` for the last, then
// what it is for the points before. `fine` may be `coarse`.
template <int width>
[[gnu::always_inline]] inline void merge_run(const double* coarse, const double* detail, Index m, double* fine,
                                             Point& carry) {
  using Vector = typename Lanes<width>::Vector;
  constexpr Index pairs = width / 2;
  Vector after;
  pick<width, [](int k) { return k % 2; }>(carry, carry, after);
#pragma GCC unroll 2
  for (; m >= pairs; m -= pairs) {
    Vector c;
    Vector d;
    Vector there;
    Vector one;
    Vector two;
    std::memcpy(&c, coarse + 2 * (m - pairs), sizeof c);
    std::memcpy(&d, detail + 2 * (m - pairs), sizeof d);
    const Vector here = c + d;
    const Vector difference = c - d;
    pick<width, [](int k) { return k + 2; }>(difference, after, there);
    const Vector quarter = 0.25 * (there - here);
    const Vector first = here + quarter;
    const Vector second = there - quarter;
    pick<width, [](int k) { return alternating<width>(k); }>(first, second, one);
    pick<width, [](int k) { return alternating<width>(k + width); }>(first, second, two);
    std::memcpy(fine + 4 * (m - pairs), &one, sizeof one);
    std::memcpy(fine + 4 * (m - pairs) + width, &two, sizeof two);
    after = difference;
  }
  pick<2, [](int k) { return k; }>(after, after, carry);
  if constexpr (width > 2) {
    if (m > 0) merge_run<width / 2>(coarse, detail, m, fine, carry);
  }
}

// Between n points and n / 2^levels.
struct Pass {
  Index n;
  int levels;
  std::array<Point, std::bit_width(static_cast<std::size_t>(block_size))> carries{};  // by level, finest first
};

// The points from `start` on. Those of a whole curve close: before the first pair comes the last.
template <int width>
[[gnu::always_inline]] inline void split_cascade(Pass& pass, Index start, Index count, const double* fine,
                                                 double* coarse, double* out) {
  alignas(64) std::array<double, block_size> between;
  const double* from = fine + 2 * start;
  for (int level = 1; level <= pass.levels; ++level) {
    const Index m = count >> level;
    Point& carry = pass.carries[static_cast<std::size_t>(level - 1)];
    if (count == pass.n) {
      const Point last = point_at(from + 4 * m - 2);
      carry = last - 0.25 * (point_at(from + 4 * m - 4) + last);
    }
    double* const to = level == pass.levels ? coarse + 2 * (start >> level) : between.data();
    split_run<width>(from, m, to, out + 2 * ((pass.n >> level) + (start >> level)), carry);
    from = to;
  }
}

template <int width>
[[gnu::always_inline]] inline void merge_cascade(Pass& pass, Index start, Index count, const double* coarse,
                                                 const double* coefficients, double* fine) {
  const double* from = coarse + 2 * (start >> pass.levels);
  double* const to = fine + 2 * start;
  for (int level = pass.levels; level > 0; --level) {
    const double* const detail = coefficients + 2 * ((pass.n >> level) + (start >> level));
    Point& carry = pass.carries[static_cast<std::size_t>(level - 1)];
    if (count == pass.n) carry = point_at(from) - point_at(detail);
    merge_run<width>(from, detail, count >> level, to, carry);
    from = to;
  }
}

using SplitCascade = void(Pass& pass, Index start, Index count, const double* fine, double* coarse, double* out);
using MergeCascade = void(Pass& pass, Index start, Index count, const double* coarse, const double* coefficients,
                          double* fine);
struct Cascades {
  SplitCascade* split;
  MergeCascade* merge;
};

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] void split_avx2(Pass& pass, Index start, Index count, const double* fine, double* coarse,
                                            double* out) {
  split_cascade<4>(pass, start, count, fine, coarse, out);
}
[[gnu::target("avx2,fma")]] void merge_avx2(Pass& pass, Index start, Index count, const double* coarse,
                                            const double* coefficients, double* fine) {
  merge_cascade<4>(pass, start, count, coarse, coefficients, fine);
}
[[gnu::target("avx512f")]] void split_avx512(Pass& pass, Index start, Index count, const double* fine, double* coarse,
                                             double* out) {
  split_cascade<8>(pass, start, count, fine, coarse, out);
}
[[gnu::target("avx512f")]] void merge_avx512(Pass& pass, Index start, Index count, const double* coarse,
                                             const double* coefficients, double* fine) {
  merge_cascade<8>(pass, start, count, coarse, coefficients, fine);
}
#endif

// By the widest vectors of this machine.
const Cascades& cascades() {
  static const Cascades widest = [] {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) return Cascades{split_avx512, merge_avx512};
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Cascades{split_avx2, merge_avx2};
#endif
    return Cascades{split_cascade<2>, merge_cascade<2>};
  }();
  return widest;
}

// The levels that go into one pass over n points.
int levels_at_once(Index n, int levels) { return n <= block_size ? levels : std::min(levels, pass_levels); }

// The details go behind the place of the coarse points in `out`.
void split_pass(const double* fine, Index n, int levels, double* coarse, double* out) {
  Pass pass{n, levels};
  SplitCascade* const cascade = cascades().split;
  if (n <= block_size) return cascade(pass, 0, n, fine, coarse, out);
  // The B before the first pair of a level is that of its last, which depends on no more than these points; what is
  // written meanwhile is written again.
  const Index ahead = Index{2} << levels;
  cascade(pass, n - ahead, ahead, fine, coarse, out);
  for (Index start = 0; start < n; start += block_size) {
    cascade(pass, start, std::min(block_size, n - start), fine, coarse, out);
  }
}

// The way back; blocks from the last to the first.
void merge_pass(const double* coarse, Index n, int levels, const double* coefficients, double* fine) {
  Pass pass{n, levels};
  MergeCascade* const cascade = cascades().merge;
  if (n <= block_size) return cascade(pass, 0, n, coarse, coefficients, fine);
  // After the last point of a level comes its first; the first two make those of the next level.
  std::array<double, 4> first;
  std::copy_n(coarse, 4, first.begin());
  for (int level = levels; level > 0; --level) {
    const double* const detail = coefficients + 2 * (n >> level);
    Point& carry = pass.carries[static_cast<std::size_t>(level - 1)];
    carry = point_at(first.data() + 2) - point_at(detail + 2);
    merge_run<2>(first.data(), detail, 1, first.data(), carry);
  }
  for (Index start = (n - 1) / block_size * block_size; start >= 0; start -= block_size) {
    cascade(pass, start, std::min(block_size, n - start), coarse, coefficients, fine);
  }
}

// Coarser passes first, into what is spare.
void merge_levels(const double* coefficients, Index n, int levels, double* fine, std::array<double*, 2> spare) {
  const int step = levels_at_once(n, levels);
  const double* coarse = coefficients;
  if (step < levels) {
    merge_levels(coefficients, n >> step, levels - step, spare[0], {spare[1], spare[0]});
    coarse = spare[0];
  }
  merge_pass(coarse, n, step, coefficients, fine);
}

bool are_finite(std::span<const double> numbers) {
  constexpr std::uint64_t exponent = std::bit_cast<std::uint64_t>(std::numeric_limits<double>::infinity());
  constexpr std::uint64_t one = exponent & -exponent;
  std::uint64_t sums = 0;  // bit 63 is set by an exponent of ones alone
  for (const double number : numbers) sums |= (std::bit_cast<std::uint64_t>(number) & exponent) + one;
  return sums >> 63 == 0;
}

void require_buffers(const char* function, std::size_t in, int levels, std::size_t out, std::size_t scratch) {
  if (in % 2 != 0 || out != in || scratch < in / 2 + in / 4) {
    throw InvalidInput(text(function, ": buffers of ", in, ", ", out, " and ", scratch,
                            " numbers; x and y of N points take 2N, 2N, 3N/2"));
  }
  const int most = most_levels(Scheme::Chaikin, static_cast<Index>(in / 2));
  if (levels < 0 || levels > most) {
    throw InvalidInput(text(function, ": ", in / 2, " control points of scheme chaikin have 0 to ", most,
                            " levels below them, not ", levels));
  }
}

}  // namespace

void analyze_into(std::span<const double> fine, int levels, std::span<double> out, std::span<double> scratch) {
  require_buffers("chaikin::analyze_into", fine.size(), levels, out.size(), scratch.size());
  if (levels == 0) std::ranges::copy(fine, out.begin());
  const double* from = fine.data();
  Index n = static_cast<Index>(fine.size() / 2);
  std::array<double*, 2> spare = {scratch.data(), scratch.data() + fine.size() / 2};
  while (levels > 0) {
    const int step = levels_at_once(n, levels);
    levels -= step;
    double* const coarse = levels == 0 ? out.data() : spare[0];
    split_pass(from, n, step, coarse, out.data());
    from = coarse;
    n >>= step;
    std::swap(spare[0], spare[1]);
  }
  // Every number of `fine` weighs in the coarsest points, so one that is not finite shows there.
  if (are_finite(out.first(static_cast<std::size_t>(2 * n)))) return;
  for (std::size_t i = 0; i < fine.size(); ++i) {
    if (!std::isfinite(fine[i])) {
      throw InvalidInput(text("chaikin::analyze_into: point ", i / 2, ", column ", i % 2, " is ", fine[i]));
    }
  }
  throw InvalidInput("chaikin::analyze_into: numbers so large that their sums are not finite");
}

void synthesize_into(std::span<const double> coefficients, int levels, std::span<double> fine,
                     std::span<double> scratch) {
  require_buffers("chaikin::synthesize_into", coefficients.size(), levels, fine.size(), scratch.size());
  if (levels == 0) {
    std::ranges::copy(coefficients, fine.begin());
  } else {
    merge_levels(coefficients.data(), static_cast<Index>(fine.size() / 2), levels, fine.data(),
                 {scratch.data(), scratch.data() + fine.size() / 2});
  }
}

}  // namespace fontcore::chaikin
