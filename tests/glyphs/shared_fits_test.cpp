#include "glyphs/shared_fits.h"

#include <cmath>

#include "glyphs/font_file.h"
#include "glyphs/jobs.h"
#include "tests/bundled_fonts.h"
#include "tests/catch.h"

using namespace glyphs;
using fontcore::BezierContour;
using fontcore::CompactFit;
using fontcore::CompactOptions;
using fontcore::CurveKind;
using fontcore::Point;

namespace {

// The distance is measured where the contour stands: the same but for rounding.
bool are_same(const CompactFit& a, const CompactFit& b) {
  return a.contour == b.contour && std::abs(a.deviation - b.deviation) < 1e-9 && a.kept == b.kept && a.why == b.why &&
         a.work == b.work;
}

// Letters beside their accents, from a font that draws every accented one whole.
std::vector<std::vector<BezierContour>> accented(const Font& font) {
  std::vector<std::vector<BezierContour>> outlines;
  for (const char32_t letter : {U'e', U'é', U'ë', U'ê', U'o', U'ö', U'ő', U'ø'}) {
    outlines.push_back(font.glyphs[static_cast<std::size_t>(font.character_map.at(letter))].contours);
  }
  return outlines;
}

}  // namespace

TEST_CASE("a shape's fit is the same wherever it stands and whoever asked first", "[compact]") {
  const Font font = load_font(bundled_font("eb-garamond/EBGaramond12-Regular.otf"));
  const auto outlines = accented(font);
  for (const CurveKind curve : {CurveKind::Cubic, CurveKind::Quadratic}) {
    CompactOptions options;
    options.curve = curve;
    SharedFits fits;
    std::vector<std::vector<CompactFit>> shared(outlines.size());
    JobOptions jobs;
    jobs.jobs = 4;
    run_jobs(static_cast<int>(outlines.size()), jobs, [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      long spent = 0;
      for (const BezierContour& contour : outlines[k]) shared[k].push_back(fits.fit(contour, options, spent));
    });
    for (std::size_t k = 0; k < outlines.size(); ++k) {
      for (std::size_t c = 0; c < outlines[k].size(); ++c) {
        INFO("outline " << k << " contour " << c);
        const CompactFit alone = fit_compact(outlines[k][c], options);
        CHECK(are_same(shared[k][c], alone));
      }
    }
  }
}

TEST_CASE("shapes with other options or fractions are fits of their own", "[compact]") {
  const Font font = load_font(bundled_font("eb-garamond/EBGaramond12-Regular.otf"));
  const BezierContour contour = accented(font)[0].back();
  SharedFits fits;
  long spent = 0;
  CompactOptions options;
  CHECK(are_same(fits.fit(contour, options, spent), fit_compact(contour, options)));
  options.tolerance = 3.0;
  CHECK(are_same(fits.fit(contour, options, spent), fit_compact(contour, options)));
  options.corners = {contour.node(3)};
  CHECK(are_same(fits.fit(contour, options, spent), fit_compact(contour, options)));
  const BezierContour thirds = transform(contour, {Eigen::Matrix2d::Identity(), Point(1.0 / 3.0, 100.1)});
  CHECK(are_same(fits.fit(thirds, options, spent), fit_compact(thirds, options)));
}

TEST_CASE("contours of a glyph that has spent its work stay as they are", "[compact]") {
  const Font font = load_font(bundled_font("eb-garamond/EBGaramond12-Regular.otf"));
  const BezierContour contour = accented(font)[0].back();
  SharedFits fits;
  CompactOptions options;
  options.tolerance = 5.0;
  long spent = 0;
  const CompactFit first = fits.fit(contour, options, spent);
  CHECK(first.contour.segment_count() < contour.segment_count());
  CHECK(spent == first.work);
  CHECK(are_same(fits.fit(contour, options, spent), first));
  CHECK(spent == 2 * first.work);
  spent = options.most_work;
  const CompactFit last = fits.fit(contour, options, spent);
  CHECK(last.contour == contour);
  CHECK_FALSE(last.why.empty());
}
