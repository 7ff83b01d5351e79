#include "glyphs/weight_proof.h"

#include <algorithm>

#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/recipe.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace glyphs;
using fontcore::Affine;
using fontcore::Point;

namespace {

Affine stretched(double x, double y) {
  Affine map;
  map.linear(0, 0) = x;
  map.linear(1, 1) = y;
  return map;
}

}  // namespace

TEST_CASE("outlines differ by the share of ink that only one has, wherever they stand", "[weight_proof]") {
  const auto square = shapes::square(600);
  for (const double shift : {0.0, 37.0, -200.0}) {
    const auto taller = transform(transform(square, stretched(1.0, 1.25)), {.shift = Point(shift, 0.0)});
    const OutlineError error = compare_outlines({taller}, {square});
    CHECK(error.difference == Approx(0.25).epsilon(1e-9));
    CHECK(error.area == Approx(0.25).epsilon(1e-9));
    CHECK(error.shift == Approx(-shift).margin(1e-9));
    CHECK(compare_outlines({square}, {taller}).difference == Approx(0.2).epsilon(1e-9));
    CHECK(compare_outlines({taller}, {taller}).difference == Approx(0.0).margin(1e-9));
    // The way round does not matter.
    CHECK(compare_outlines({reverse(taller)}, {square}).difference == Approx(0.25).epsilon(1e-9));
  }
}

TEST_CASE("glyphs are compared by their characters, worst first", "[weight_proof]") {
  const Font regular = load_font(bundled_font("open-sans/OpenSans-Regular.ttf"));
  const Font bold = load_font(bundled_font("open-sans/OpenSans-Bold.ttf"));
  const std::vector<int> small = select_glyphs(regular, "U+0061-007A");
  const auto compared = compare_weights(regular, bold, small);
  CHECK(compared.size() == 26);
  CHECK(
      std::ranges::is_sorted(compared, std::greater{}, [](const ComparedGlyph& one) { return one.error.difference; }));
  for (const ComparedGlyph& one : compared) {
    CHECK(one.error.difference > 0.1);
    CHECK(one.error.area < -0.1);
  }
  for (const ComparedGlyph& one : compare_weights(regular, regular, small)) {
    CHECK(one.glyph == one.drawn);
    CHECK(one.error.difference == Approx(0.0).margin(1e-6));
  }
}

TEST_CASE("a proof of a weight is a picture of its own bytes in every format", "[weight_proof]") {
  const Font regular = load_font(bundled_font("open-sans/OpenSans-Regular.ttf"));
  const Font bold = load_font(bundled_font("open-sans/OpenSans-Bold.ttf"));
  const auto compared = compare_weights(regular, bold, select_glyphs(regular, "a,s,n"));
  const auto picture = [&](ProofFormat format) { return draw_weight_proof(regular, regular, bold, compared, format); };
  const auto starts_with = [](const Bytes& bytes, const std::string& head) {
    return std::string(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(head.size())) == head;
  };
  CHECK(starts_with(picture(ProofFormat::Png), "\x89PNG"));
  CHECK(starts_with(picture(ProofFormat::Pdf), "%PDF"));
  CHECK(starts_with(picture(ProofFormat::Svg), "<?xml"));
  for (const ProofFormat format : {ProofFormat::Png, ProofFormat::Pdf, ProofFormat::Svg}) {
    CHECK(picture(format) == picture(format));
  }
  CHECK_THROWS_AS(draw_weight_proof(regular, regular, bold, {}, ProofFormat::Png), RequestError);
}
