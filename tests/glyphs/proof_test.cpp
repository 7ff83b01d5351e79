#include "glyphs/proof.h"

#include <cairo.h>
#include <ft2build.h>
#include FT_FREETYPE_H
#include FT_OUTLINE_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/restyle.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using glyphs::Bytes;
using glyphs::Font;
using glyphs::ProofFormat;
using glyphs::RequestError;

namespace {

constexpr int size = 160;  // pixels per em
constexpr int width = 400;
constexpr int height = 400;
constexpr int left = 120;
constexpr int baseline = 260;

/// The glyph as FreeType itself draws it, without hints.
class Raster {
 public:
  explicit Raster(const Font& font) : data_(font.data) {
    REQUIRE(FT_Init_FreeType(&library_) == 0);
    REQUIRE(FT_New_Memory_Face(library_, data_->data(), static_cast<FT_Long>(data_->size()), font.face_index, &face_) ==
            0);
    REQUIRE(FT_Set_Pixel_Sizes(face_, size, size) == 0);
  }
  Raster(const Raster&) = delete;
  Raster& operator=(const Raster&) = delete;
  ~Raster() {
    FT_Done_Face(face_);
    FT_Done_FreeType(library_);
  }

  std::vector<unsigned char> draw(int glyph) const {
    REQUIRE(FT_Load_Glyph(face_, static_cast<FT_UInt>(glyph), FT_LOAD_NO_HINTING | FT_LOAD_NO_BITMAP) == 0);
    std::vector<unsigned char> pixels(static_cast<std::size_t>(width) * height);
    FT_Bitmap bitmap{};
    bitmap.width = width;
    bitmap.rows = height;
    bitmap.pitch = width;
    bitmap.buffer = pixels.data();
    bitmap.num_grays = 256;
    bitmap.pixel_mode = FT_PIXEL_MODE_GRAY;
    FT_Outline_Translate(&face_->glyph->outline, left * 64, (height - baseline) * 64);
    REQUIRE(FT_Outline_Get_Bitmap(library_, &face_->glyph->outline, &bitmap) == 0);
    return pixels;
  }

 private:
  std::shared_ptr<const Bytes> data_;
  FT_Library library_ = nullptr;
  FT_Face face_ = nullptr;
};

/// Difference of ink between ours and FreeType's, as a share of the ink; every pixel counts by how far it is off.
double disagreement(const Font& font, const Raster& raster, int glyph) {
  const std::vector<unsigned char> theirs = raster.draw(glyph);
  const glyphs::Coverage ours = glyphs::draw_coverage(font, glyph, size, width, height, left, baseline);
  REQUIRE(ours.pixels.size() == theirs.size());
  double ink = 0.0;
  double difference = 0.0;
  for (std::size_t i = 0; i < theirs.size(); ++i) {
    ink += theirs[i];
    difference += std::abs(static_cast<double>(theirs[i]) - ours.pixels[i]);
  }
  REQUIRE(ink > 0.0);
  return difference / ink;
}

int glyph_of(const Font& font, char letter) { return font.character_map.at(static_cast<char32_t>(letter)); }

/// Every letter a little restyled: a sweep of its first contour.
glyphs::Recipe swept(const Font& font) {
  glyphs::Recipe recipe;
  recipe.glyphs = "U+0061-007A,U+0041-005A";
  glyphs::SweepStep step;
  step.contour = 0;
  step.near = fontcore::Point(font.units_per_em / 3.0, font.units_per_em / 3.0);
  step.move = fontcore::Point(0.02, -0.012) * font.units_per_em;
  step.breadth = 0.35 * font.units_per_em;
  recipe.steps = {step};
  return recipe;
}

std::uint32_t big_endian(const Bytes& bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24U | std::uint32_t{bytes[at + 1]} << 16U | std::uint32_t{bytes[at + 2]} << 8U |
         bytes[at + 3];
}

/// A PNG as it is seen: rows of red, green, blue.
class Picture {
 public:
  explicit Picture(const Bytes& png) {
    auto rest = std::pair(png.data(), png.data() + png.size());
    cairo_surface_t* image = cairo_image_surface_create_from_png_stream(
        [](void* source, unsigned char* to, unsigned length) {
          auto& [next, end] = *static_cast<std::pair<const unsigned char*, const unsigned char*>*>(source);
          if (end - next < static_cast<std::ptrdiff_t>(length)) return CAIRO_STATUS_READ_ERROR;
          std::copy(next, next + length, to);
          next += length;
          return CAIRO_STATUS_SUCCESS;
        },
        &rest);
    REQUIRE(cairo_surface_status(image) == CAIRO_STATUS_SUCCESS);
    width = cairo_image_surface_get_width(image);
    height = cairo_image_surface_get_height(image);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const unsigned char* pixel =
            cairo_image_surface_get_data(image) + y * cairo_image_surface_get_stride(image) + 4 * x;
        pixels_.push_back({pixel[2], pixel[1], pixel[0]});
      }
    cairo_surface_destroy(image);
  }
  int red(int x, int y) const { return at(x, y)[0]; }
  int blue(int x, int y) const { return at(x, y)[2]; }
  bool is_ink(int x, int y) const { return red(x, y) < 100; }
  bool is_coloured(int x, int y) const {
    const auto [low, high] = std::minmax({at(x, y)[0], at(x, y)[1], at(x, y)[2]});
    return high - low > 16;
  }
  /// Columns of ink from a row on, first and last.
  std::pair<int, int> columns(int first_row, int end_row) const {
    std::pair<int, int> found{width, -1};
    for (int y = first_row; y < end_row; ++y)
      for (int x = 0; x < width; ++x)
        if (is_ink(x, y)) found = {std::min(found.first, x), std::max(found.second, x)};
    return found;
  }

  int width = 0;
  int height = 0;

 private:
  const std::array<unsigned char, 3>& at(int x, int y) const {
    return pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
  std::vector<std::array<unsigned char, 3>> pixels_;
};

/// Pixels of a PNG below the first rows that are not grey.
int coloured_pixels(const Bytes& png, int first_row) {
  const Picture picture(png);
  int count = 0;
  for (int y = first_row; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) count += picture.is_coloured(x, y) ? 1 : 0;
  return count;
}

std::string as_text(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }

const Font& regular() {
  static const Font font = glyphs::load_font(bundled_ttf[0]);
  return font;
}
const Font& bold() {
  static const Font font = glyphs::load_font(bundled_ttf[1]);
  return font;
}

}  // namespace

TEST_CASE("the ink of every bundled letter is FreeType's to 1 %", "[proof]") {
  for (const std::string& path : bundled_fonts()) {
    const Font font = glyphs::load_font(path);
    const Raster raster(font);
    // FreeType cuts off fractions of a unit, which ours keeps.
    const double allowed = font.has_fractional_coordinates ? 0.015 : 0.01;
    for (const char letter : letters + "0123456789") {
      CAPTURE(path, letter);
      CHECK(disagreement(font, raster, glyph_of(font, letter)) < allowed);
    }
  }
}

TEST_CASE("the ink of restyled letters is FreeType's to 1 %", "[proof][slow]") {
  for (const std::string& path : bundled_ttf) {
    const Font before = glyphs::load_font(path);
    const glyphs::RestyleResult result = glyphs::restyle(before, swept(before));
    CHECK(result.changed() > 40);
    const Font after = glyphs::load_font_bytes("after.ttf", result.font.data);
    const Raster raster(after);
    for (const char letter : letters) {
      CAPTURE(path, letter);
      CHECK(disagreement(after, raster, glyph_of(after, letter)) < 0.01);
    }
  }
}

TEST_CASE("ink covers as many pixels as the glyph has area", "[proof]") {
  // H has no overlaps, so its ink is its signed area.
  const int glyph = glyph_of(regular(), 'H');
  const glyphs::Coverage coverage = glyphs::draw_coverage(regular(), glyph, size, width, height, left, baseline);
  double ink = 0.0;
  for (const unsigned char pixel : coverage.pixels) ink += pixel / 255.0;
  const double scale = static_cast<double>(size) / regular().units_per_em;
  const double area = std::abs(fontcore::signed_area(glyphs::compose(regular(), glyph))) * scale * scale;
  CHECK(ink == Approx(area).epsilon(2e-3));
}

TEST_CASE("a proof's format follows the file's ending", "[proof]") {
  CHECK(glyphs::proof_format("a.b/p.png") == ProofFormat::Png);
  CHECK(glyphs::proof_format("p.pdf") == ProofFormat::Pdf);
  CHECK(glyphs::proof_format("p.svg") == ProofFormat::Svg);
  CHECK_THROWS_WITH(glyphs::proof_format("p.jpeg"), Catch::Contains("p.jpeg"));
}

TEST_CASE("the same proof twice is the same bytes, without a date", "[proof]") {
  unsetenv("SOURCE_DATE_EPOCH");
  for (const ProofFormat format : {ProofFormat::Png, ProofFormat::Pdf, ProofFormat::Svg}) {
    glyphs::ProofOptions all;
    all.nodes = all.crossings = true;
    all.comb = 0.0;
    all.levels = {60.0, 300.0};
    all.waterfall = {30.0, 90.0};
    const Bytes first = glyphs::draw_proof(regular(), bold(), "ag", format, all);
    CHECK(glyphs::draw_proof(regular(), bold(), "ag", format, all) == first);
    CHECK(as_text(first).find("CreationDate") == std::string::npos);
    const Bytes sheet = glyphs::draw_glyph_proof(regular(), bold(), {36, 37, 38}, format);
    CHECK(glyphs::draw_glyph_proof(regular(), bold(), {36, 37, 38}, format) == sheet);
  }
}

TEST_CASE("a PDF is dated by SOURCE_DATE_EPOCH and by nothing else", "[proof]") {
  setenv("SOURCE_DATE_EPOCH", "86400", 1);
  const std::string dated = as_text(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Pdf));
  unsetenv("SOURCE_DATE_EPOCH");
  CHECK(dated.find("(19700102000000") != std::string::npos);
  for (const char* wrong : {"", "soon", "12h", "-1"}) {
    setenv("SOURCE_DATE_EPOCH", wrong, 1);
    CHECK_THROWS_WITH(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Pdf), Catch::Contains("SOURCE_DATE_EPOCH"));
  }
  unsetenv("SOURCE_DATE_EPOCH");
}

TEST_CASE("a picture that compares has three rows to a line and is as wide as the wider font", "[proof]") {
  const auto size_of = [](const Bytes& png) {
    REQUIRE(as_text(png).substr(1, 3) == "PNG");
    return std::pair(big_endian(png, 16), big_endian(png, 20));
  };
  const auto [one_width, one_height] = size_of(glyphs::draw_proof(regular(), {}, "Hamburg", ProofFormat::Png));
  const auto [both_width, both_height] = size_of(glyphs::draw_proof(regular(), bold(), "Hamburg", ProofFormat::Png));
  CHECK(both_height > 2.5 * one_height);
  CHECK(both_width >= one_width);
}

TEST_CASE("a font against itself shows nothing that went or came, and against another it does", "[proof]") {
  const auto coloured = [](const Font& against) {
    constexpr int legend = 44;  // rows at the top with the words in their colours
    return coloured_pixels(glyphs::draw_glyph_proof(regular(), against, {glyph_of(regular(), 'a')}, ProofFormat::Png),
                           legend);
  };
  CHECK(coloured(regular()) == 0);
  CHECK(coloured(bold()) > 100);
}

TEST_CASE("a level is drawn beside the ink it departs from, and at its corners on it", "[proof]") {
  const auto drawn = [](const std::vector<double>& levels) {
    glyphs::ProofOptions options;
    options.levels = levels;
    return glyphs::draw_glyph_proof(regular(), {}, {glyph_of(regular(), 'a')}, ProofFormat::Svg, options);
  };
  CHECK(drawn({}) != drawn({0.0}));
  CHECK(drawn({0.0}) != drawn({2000.0}));
  CHECK(drawn({300.0}) == drawn({300.0}));
  // Fewer spans, fewer dots.
  const auto dots = [&](double level) {
    const std::string text = as_text(drawn({level}));
    std::size_t count = 0;
    for (std::size_t at = text.find("62%"); at != std::string::npos; at = text.find("62%", at + 1)) ++count;
    return count;
  };
  CHECK(dots(2000.0) < dots(100.0));
}

TEST_CASE("several levels stand side by side, glyphs in cells and text in rows", "[proof]") {
  glyphs::ProofOptions one;
  one.levels = {60.0};
  glyphs::ProofOptions three;
  three.levels = {60.0, 200.0, 600.0};
  const std::vector<int> glyph{glyph_of(regular(), 'a')};
  CHECK(Picture(glyphs::draw_glyph_proof(regular(), {}, glyph, ProofFormat::Png, three)).width >
        2 * Picture(glyphs::draw_glyph_proof(regular(), {}, glyph, ProofFormat::Png, one)).width);
  CHECK(Picture(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, three)).height >
        2 * Picture(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, one)).height);
}

TEST_CASE("a comb stands on curves alone, and as long as is asked", "[proof]") {
  const auto coloured = [](char letter, std::optional<double> comb) {
    glyphs::ProofOptions options;
    options.comb = comb;
    return coloured_pixels(
        glyphs::draw_glyph_proof(regular(), {}, {glyph_of(regular(), letter)}, ProofFormat::Png, options), 0);
  };
  CHECK(coloured('o', {}) == 0);
  CHECK(coloured('o', 0.02) > coloured('o', 0.005));
  CHECK(coloured('o', 0.0) > 1000);
  // On straight lines its tips lie on the outline: a line and no teeth.
  CHECK(coloured('H', 1.0) == coloured('H', 0.01));
}

TEST_CASE("a waterfall is one text at every size, each as large as it says", "[proof]") {
  const auto drawn = [](const std::vector<double>& sizes) {
    glyphs::ProofOptions options;
    options.waterfall = sizes;
    return Picture(glyphs::draw_proof(regular(), {}, "HHHHHHHHHHHH", ProofFormat::Png, options));
  };
  const Picture both = drawn({40.0, 80.0});
  CHECK(both.width == drawn({80.0}).width);
  const auto [small_left, small_right] = both.columns(44, both.height / 3);
  const auto [left, right] = both.columns(both.height / 2, both.height);
  CHECK(right - left == Approx(2 * (small_right - small_left)).epsilon(0.02));  // to the edges of pixels
  CHECK_THROWS_AS(drawn({40.0, 0.0}), RequestError);
}

TEST_CASE("lines from right to left end at the right, and vertical ones are columns from right to left", "[proof]") {
  const auto drawn = [](const char* direction) {
    glyphs::ProofOptions options;
    options.shaping.direction = direction;
    return Picture(glyphs::draw_proof(regular(), {}, "HHHHHH\nH", ProofFormat::Png, options));
  };
  const Picture forward = drawn("ltr");
  const Picture backward = drawn("rtl");
  REQUIRE(forward.width == backward.width);
  const int lower = 2 * forward.height / 3;
  CHECK(forward.columns(lower, forward.height).second < forward.width / 2);
  CHECK(backward.columns(lower, backward.height).first > backward.width / 2);
  const Picture down = drawn("ttb");
  CHECK(down.height > 2 * down.width);
  const int halfway = down.height / 2;
  CHECK(down.columns(halfway, down.height).first > down.columns(44, halfway).first);
}

TEST_CASE("several fonts, or places of one, follow one another", "[proof]") {
  const Bytes both = glyphs::draw_proof({{regular(), nullptr, ""}, {bold(), nullptr, ""}}, "Ham", ProofFormat::Png);
  const Bytes one = glyphs::draw_proof({{regular(), nullptr, ""}}, "Ham", ProofFormat::Png);
  CHECK(Picture(both).height > Picture(one).height * 3 / 2);
  CHECK(glyphs::draw_proof(regular(), {}, "Ham", ProofFormat::Png) == one);
  CHECK_THROWS_AS(glyphs::draw_proof(std::vector<glyphs::ProofedFont>{}, "Ham", ProofFormat::Png), RequestError);
}

TEST_CASE("a glyph is compared with the one of its name, wherever it is in the other font", "[proof]") {
  const Font sans = glyphs::load_font(bundled_font("open-sans/OpenSans-Regular.ttf"));
  int own = -1;
  for (const auto& [character, glyph] : regular().character_map) {
    const auto found = sans.character_map.find(character);
    if (own < 0 && found != sans.character_map.end() && found->second != glyph && character > U'\u0100' &&
        regular().glyphs[static_cast<std::size_t>(glyph)].name ==
            sans.glyphs[static_cast<std::size_t>(found->second)].name)
      own = glyph;
  }
  REQUIRE(own >= 0);
  const auto inked = [&](const Font& against) {
    const Picture picture(glyphs::draw_glyph_proof(regular(), against, {own}, ProofFormat::Png));
    int dark = 0;
    int came = 0;
    for (int y = 44; y < picture.height - 30; ++y)
      for (int x = 0; x < picture.width; ++x) {
        if (picture.is_ink(x, y) && !picture.is_coloured(x, y)) ++dark;
        if (picture.blue(x, y) > picture.red(x, y) + 100) ++came;
      }
    return std::pair(dark, came);
  };
  const auto [shared, came] = inked(sans);
  CHECK(shared > 0);
  // Without a counterpart all of it came.
  Font bare = sans;
  for (glyphs::Glyph& glyph : bare.glyphs) glyph.name = "none" + std::to_string(glyph.id);
  bare.character_map.clear();
  const auto [nothing_shared, all] = inked(bare);
  CHECK(nothing_shared == 0);
  CHECK(all > came);
}

TEST_CASE("a sheet of all glyphs is drawn smaller rather than too large", "[proof][slow]") {
  std::vector<int> all;
  for (int glyph = 0; glyph < static_cast<int>(regular().glyphs.size()); ++glyph)
    if (regular().has_outline(glyph)) all.push_back(glyph);
  const Bytes png = glyphs::draw_glyph_proof(regular(), {}, all, ProofFormat::Png, {.pixels_per_em = 400.0});
  CHECK(static_cast<double>(big_endian(png, 16)) * big_endian(png, 20) <= 64.5e6);
}

TEST_CASE("what cannot be drawn is refused", "[proof]") {
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "", ProofFormat::Png), RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "\n\n", ProofFormat::Png), RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "a\xFF", ProofFormat::Png), RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, {.pixels_per_em = 0.0}), RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, {.pixels_per_em = std::nan("")}),
                  RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, {.levels = {-1.0}}), RequestError);
  CHECK_THROWS_AS(glyphs::draw_proof(regular(), {}, "a", ProofFormat::Png, {.comb = -1.0}), RequestError);
  CHECK_THROWS_AS(glyphs::draw_glyph_proof(regular(), {}, {}, ProofFormat::Png), RequestError);
  CHECK_THROWS_AS(glyphs::draw_glyph_proof(regular(), {}, {1 << 20}, ProofFormat::Png), RequestError);
}
