#include "glyphs/convert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "fontcore/crossing.h"
#include "fontcore/degree.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/sfnt_writer.h"
#include "glyphs/shared_fits.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::CurveKind;
using fontcore::PointKind;
using fontcore::text;
using Contours = std::vector<BezierContour>;

/// Largest distance of the same places of two contours of as many segments: never less than between the curves.
double same_places(const BezierContour& a, const BezierContour& b) {
  constexpr int samples = 16;  // of a segment
  double largest = 0.0;
  for (int s = 0; s < a.segment_count(); ++s) {
    const fontcore::Bezier one = a.segment(s);
    const fontcore::Bezier other = b.segment(s);
    for (int k = 0; k < samples; ++k) {
      const double u = static_cast<double>(k) / samples;
      largest = std::max(largest, (evaluate(one, u) - evaluate(other, u)).norm());
    }
  }
  return largest;
}

double distance(const BezierContour& before, const BezierContour& after) {
  constexpr double accuracy = 0.005;  // font units
  const bool has_same_count = before.segment_count() == after.segment_count();
  const double same = has_same_count ? same_places(before, after) : std::numeric_limits<double>::infinity();
  return same <= accuracy ? same : std::min(same, farthest(before, after, accuracy).distance);
}

/// Outlines of one font as curves of one kind.
class OutlineConverter {
 public:
  OutlineConverter(const Font& font, const ConvertOptions& options)
      : tolerance_(options.tolerance * font.units_per_em / 1000.0),
        curve_(font.format == OutlineFormat::TrueType ? CurveKind::Cubic : CurveKind::Quadratic),
        is_whole_(options.fractions == Fractions::Round) {
    compact_.tolerance = tolerance_;
    compact_.units_per_em = font.units_per_em;
    compact_.curve = curve_;
    compact_.coordinates = is_whole_ ? fontcore::Coordinates::Whole : fontcore::Coordinates::Any;
  }

  struct Converted {
    Contours contours;
    double deviation = 0.0;  // of the contours from those they stand for
  };

  /// Still in their own direction.
  Converted convert(const Contours& before) {
    if (tolerance_ == 0.0) return one_by_one(before);
    try {
      Converted after;
      long spent = 0;
      for (const BezierContour& contour : before) {
        fontcore::CompactFit fit = fits_.fit(contour, compact_, spent);
        const bool is_fitted = fit.deviation <= tolerance_ && is_of_kind(fit.contour);
        if (is_fitted) {
          add(after, contour, std::move(fit.contour), fit.deviation);
        } else {
          add(after, contour, one_by_one(contour));
        }
      }
      if (added_crossings(find_crossings(before), find_crossings(after.contours)) == 0) return after;
    } catch (const fontcore::WorkLimitExceeded&) {  // outlines that lie on themselves over and over
    }
    return one_by_one(before);
  }

  /// What is of the other kind, or at fractions, one by one; the rest as it is.
  Converted adopt(const Contours& given) const {
    Converted result;
    for (const BezierContour& contour : given) {
      if (contour.point_count() >= 2) add(result, contour, is_of_kind(contour) ? contour : one_by_one(contour));
    }
    return result;
  }

 private:
  bool is_of_kind(const BezierContour& contour) const {
    const PointKind other = curve_ == CurveKind::Cubic ? PointKind::Quadratic : PointKind::Cubic;
    for (int i = 0; i < contour.point_count(); ++i) {
      if (contour.kind(i) == other) return false;
      const bool is_stored = contour.kind(i) != PointKind::ImpliedNode || curve_ == CurveKind::Cubic;
      if (is_whole_ && is_stored && contour.point(i) != fontcore::Point(contour.point(i).array().floor())) return false;
    }
    return true;
  }
  BezierContour one_by_one(const BezierContour& contour) const {
    if (curve_ == CurveKind::Quadratic) {
      constexpr double share = 0.5;  // the rest is for rounding
      return lowered_to_quadratics(contour, share * tolerance_, is_whole_);
    }
    const BezierContour raised = raised_to_cubics(contour);
    return is_whole_ ? raised.with_points((raised.points().array() + 0.5).floor()) : raised;
  }
  /// As the file has it, and how far off it is if that is not known.
  void add(Converted& to, const BezierContour& before, BezierContour after, std::optional<double> known = {}) const {
    if (curve_ == CurveKind::Cubic) after = sfnt::snap({raised_to_cubics(after)}).front();  // it begins with a node
    to.deviation = std::max(to.deviation, known && is_whole_ ? *known : distance(before, after));
    to.contours.push_back(std::move(after));
  }
  Converted one_by_one(const Contours& contours) const {
    Converted result;
    for (const BezierContour& contour : contours) add(result, contour, one_by_one(contour));
    return result;
  }

  double tolerance_;
  CurveKind curve_;
  bool is_whole_;
  fontcore::CompactOptions compact_;
  SharedFits fits_;
};

// ---- one glyph as a picture that drawing programs edit

/// The outline as it is drawn, y down, in font units: from the ascender to the descender, as wide as the advance.
std::string outline_picture(const Font& font, int glyph) {
  std::string path;
  const auto place = [](const fontcore::Point& p) { return xml::number_text(p.x()) + ' ' + xml::number_text(-p.y()); };
  for (const fontcore::BezierContour& contour : compose(font, glyph)) {
    if (!path.empty()) path += ' ';
    path += 'M' + place(contour.point(contour.node(0)));
    for (int s = 0; s < contour.segment_count(); ++s) {
      const fontcore::Bezier part = contour.segment(s);
      if (part.degree == 1 && s + 1 == contour.segment_count()) break;  // drawn by Z
      path += part.degree == 1 ? 'L' : part.degree == 2 ? 'Q' : 'C';
      for (int k = 1; k <= part.degree; ++k) path += (k > 1 ? " " : "") + place(part.p[static_cast<std::size_t>(k)]);
    }
    path += 'Z';
  }
  const Glyph& drawn = font.glyphs.at(static_cast<std::size_t>(glyph));
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 " + xml::number_text(-font.ascender) + ' ' +
         xml::number_text(std::max(1.0, drawn.advance)) + ' ' +
         xml::number_text(std::max(1.0, font.ascender - font.descender)) + "\">\n<path d=\"" + path + "\"/>\n</svg>\n";
}

}  // namespace

ConvertedFont convert_outlines(const Font& font, const ConvertOptions& options, const EditedGlyphs& instead) {
  const bool to_cff = font.format == OutlineFormat::TrueType;
  if (!to_cff && font.format != OutlineFormat::Cff) {
    throw RequestError(font.path + ": has neither TrueType nor CFF outlines to be converted");
  }
  if (!(options.tolerance >= 0.0) || !std::isfinite(options.tolerance)) {
    throw RequestError(text(font.path, ": the tolerance is ", options.tolerance));
  }
  if (!to_cff && options.tolerance == 0.0) {
    throw RequestError(font.path + ": cubics become quadratics within a tolerance, which is 0");
  }
  if (!to_cff && options.fractions == Fractions::Keep) {
    throw RequestError(font.path + ": TrueType has whole numbers only, no --fractional");
  }
  ConvertedFont converted;
  const std::size_t count = font.glyphs.size();
  converted.deviation.resize(count);
  std::vector<Contours> outlines(count);
  std::vector<std::string> troubles(count);
  std::vector<int> before_counts(count);
  OutlineConverter converter(font, options);
  const std::vector<int> first = first_alike(font);
  const auto is_converted_once = [&](int id) {  // for all glyphs that draw the same
    const int as = first[static_cast<std::size_t>(id)];
    const auto is_plain = [&](const Glyph& glyph) { return glyph.components.empty() && glyph.trouble.empty(); };
    return as != id && is_plain(font.glyphs[static_cast<std::size_t>(id)]) &&
           is_plain(font.glyphs[static_cast<std::size_t>(as)]) && !instead.contains(id) && !instead.contains(as);
  };
  run_jobs(static_cast<int>(count), options.jobs, [&](int id) {
    const auto k = static_cast<std::size_t>(id);
    const Glyph& glyph = font.glyphs[k];
    troubles[k] = glyph.trouble;
    if (!troubles[k].empty() || is_converted_once(id)) return;
    const auto given = instead.find(id);
    Contours before = compose(font, id);
    std::erase_if(before, [](const BezierContour& contour) { return contour.point_count() < 2; });
    before_counts[k] = segment_count(before);
    auto [after, deviation] = given == instead.end() ? converter.convert(before) : converter.adopt(given->second);
    converted.deviation[k] = deviation;
    for (BezierContour& contour : after) contour = reverse(contour);
    troubles[k] = to_cff ? why_no_charstring(after) : why_no_truetype(after);
    if (troubles[k].empty()) outlines[k] = std::move(after);
  });
  for (std::size_t k = 0; k < count; ++k) {
    if (!is_converted_once(static_cast<int>(k))) continue;
    const auto as = static_cast<std::size_t>(first[k]);
    outlines[k] = outlines[as];
    troubles[k] = troubles[as];
    before_counts[k] = before_counts[as];
    converted.deviation[k] = converted.deviation[as];
  }
  converted.worst = static_cast<int>(std::ranges::max_element(converted.deviation) - converted.deviation.begin());
  std::vector<std::string> warnings;
  for (const Glyph& glyph : font.glyphs) {
    const auto k = static_cast<std::size_t>(glyph.id);
    converted.segments_before += before_counts[k];
    converted.segments_after += segment_count(outlines[k]);
    if (glyph.is_composite()) converted.flattened.push_back(glyph.id);
    if (troubles[k].empty()) continue;
    converted.emptied.push_back(glyph.id);
    converted.deviation[k] = 0.0;
    warnings.push_back(text(glyph.name, ": comes out empty: ", troubles[k]));
  }
  converted.font = to_cff ? write_as_cff(font, outlines) : write_as_truetype(font, outlines);
  converted.font.warnings.insert(converted.font.warnings.begin(), warnings.begin(), warnings.end());
  return converted;
}

ConvertedFont convert_font(const Font& font, FileKind kind, const ConvertOptions& options) {
  ConvertedFont result;
  if (kind == FileKind::Svg) {
    if (options.glyphs.size() != 1) {
      throw RequestError(text(font.path, ": an SVG is of one glyph; ", options.glyphs.size(), " are selected"));
    }
    const std::string picture = outline_picture(font, options.glyphs.front());
    result.font.data = {picture.begin(), picture.end()};
    return result;
  }
  const FileKind own = kind_of(font);
  if (kind == own) {
    result.font = write_font(font, {}, {.is_checked = true});
    for (const auto& [id, why] : result.font.emptied) result.emptied.push_back(id);
  } else if (own == FileKind::Ufo) {
    throw RequestError(
        text(font.path, ": a UFO is compiled by fontmake: fontmake -u ", font.path, " -o ", ending_of(kind) + 1));
  } else if (kind == FileKind::Ufo) {
    result.font = extract_ufo(font);
  } else if (font.format == OutlineFormat::None) {
    throw RequestError(text(font.path, ": has no outlines to be converted to ", ending_of(kind)));
  } else {
    result = convert_outlines(font, options);
  }
  return result;
}

}  // namespace glyphs
