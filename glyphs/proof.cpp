#include "glyphs/proof.h"

#include <cairo-pdf.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <variant>

#include "fontcore/arcwise.h"
#include "fontcore/curvature.h"
#include "fontcore/measure.h"
#include "glyphs/canvas.h"
#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::Affine;
using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Box;
using fontcore::Point;

constexpr Colour ink_colour{0.16, 0.16, 0.18};
constexpr Colour went_colour{0.86, 0.13, 0.11};
constexpr Colour came_colour{0.13, 0.36, 0.92};
constexpr Colour label_colour{0.45, 0.45, 0.48};
constexpr Colour crossing_colour{0.95, 0.55, 0.0};
constexpr Colour level_colour{0.0, 0.62, 0.31};
constexpr Colour comb_colour{0.60, 0.15, 0.65};
constexpr Colour tooth_colour{0.83, 0.62, 0.86};
constexpr Colour marked_ink_colour{0.82, 0.82, 0.84};  // under nodes, levels and combs

/// A glyph's outline put on the page: font units to pixels, y down.
struct Inked {
  const std::vector<BezierContour>* contours = nullptr;
  Affine to_page;
  int glyph = 0;
};

Inked shifted(Inked inked, const Point& by) {
  inked.to_page.shift += by;
  return inked;
}

Inked scaled(Inked inked, double by) {
  inked.to_page.linear *= by;
  inked.to_page.shift *= by;
  return inked;
}

std::vector<Inked> shifted(std::vector<Inked> inked, const Point& by) {
  for (Inked& one : inked) one = shifted(one, by);
  return inked;
}

Box box_of(const std::vector<Inked>& inked) {
  Box box;
  for (const Inked& one : inked)
    for (const BezierContour& contour : *one.contours)
      for (int i = 0; i < contour.point_count(); ++i) box.add(one.to_page(contour.point(i)));
  return box;
}

/// Outlines by glyph id; they stay where they are when the map is moved.
using ComposedGlyphs = std::map<int, std::vector<BezierContour>>;

/// The composed outlines of a font, each composed once.
class Outlines {
 public:
  explicit Outlines(const Font& font) : font_(&font) {}

  const Font& font() const { return *font_; }
  const std::vector<BezierContour>& of(int glyph) {
    const auto found = composed_.find(glyph);
    if (found != composed_.end()) return found->second;
    return composed_.emplace(glyph, compose(*font_, glyph)).first->second;
  }
  /// A glyph with its origin at a place in font units; the page's origin stays (0, 0).
  Inked ink(int glyph, const Point& origin, double pixels_per_em) {
    const double scale = pixels_per_em / font_->units_per_em;
    Inked inked{&of(glyph), {}, glyph};
    inked.to_page.linear << scale, 0.0, 0.0, -scale;
    inked.to_page.shift = inked.to_page.linear * origin;
    return inked;
  }
  /// All that were composed; nothing can be inked any more.
  ComposedGlyphs take() && { return std::move(composed_); }

 private:
  const Font* font_;
  ComposedGlyphs composed_;
};

/// A line of text as ink, and the room it takes: its advance, its ink, and ascender to descender, or half an em on both
/// sides of vertical text.
struct InkedLine {
  std::vector<Inked> inked;
  Box box;
  Direction direction = Direction::LeftToRight;
  bool is_complete = true;  ///< the font had every character
};

bool is_vertical(Direction direction) {
  return direction == Direction::TopToBottom || direction == Direction::BottomToTop;
}

InkedLine ink_line(Outlines& outlines, const std::string& text, double pixels_per_em, const ShapingOptions& shaping) {
  const Font& font = outlines.font();
  const int missing = font.format == OutlineFormat::Ufo ? font.find(".notdef") : 0;
  const double scale = pixels_per_em / font.units_per_em;
  InkedLine line;
  ShapedLine shaped;
  if (!text.empty()) shaped = shape(font, text, shaping);
  line.direction = shaped.direction;
  for (const PlacedGlyph& placed : shaped.glyphs) {
    line.inked.push_back(outlines.ink(placed.glyph, placed.origin, pixels_per_em));
    line.is_complete = line.is_complete && placed.glyph != missing;
  }
  const double advance = shaped.advance * scale;
  if (is_vertical(line.direction)) {
    line.box.add(Point(-0.5 * pixels_per_em, 0.0));
    line.box.add(Point(0.5 * pixels_per_em, line.direction == Direction::TopToBottom ? advance : -advance));
  } else {
    line.box.add(Point(0.0, -font.ascender * scale));
    line.box.add(Point(advance, -font.descender * scale));
  }
  line.box.add(box_of(line.inked));
  return line;
}

/// Lines one below the other as they are; vertical ones as a single block, from right to left.
std::vector<InkedLine> ink_lines(Outlines& outlines, const std::vector<std::string>& lines, double pixels_per_em,
                                 const ShapingOptions& shaping) {
  std::vector<InkedLine> inked;
  for (const std::string& line : lines) inked.push_back(ink_line(outlines, line, pixels_per_em, shaping));
  const auto upright = std::ranges::find_if(inked, [](const InkedLine& line) { return is_vertical(line.direction); });
  if (upright == inked.end()) return inked;
  double column = 0.0;
  for (const InkedLine& line : inked) column = std::max(column, line.box.high.x() - line.box.low.x());
  InkedLine block;
  block.direction = upright->direction;
  Point at = Point::Zero();
  for (const InkedLine& line : inked) {
    const std::vector<Inked> shifted_line = shifted(line.inked, at);
    block.inked.insert(block.inked.end(), shifted_line.begin(), shifted_line.end());
    block.is_complete = block.is_complete && line.is_complete;
    block.box.add(line.box.low + at);
    block.box.add(line.box.high + at);
    at.x() -= column;
  }
  return {block};
}

// What is drawn, back to front.
struct Fill {
  std::vector<Inked> inked;
  Colour colour;
};
struct Overlay {
  std::vector<Inked> before;
  std::vector<Inked> after;
};
struct Nodes {
  Inked inked;
};
struct Ring {
  Point where;
};
/// Curves of one level, and the ends of their spans.
struct LevelCurves {
  std::vector<std::vector<Bezier>> curves;
  std::vector<Point> dots;
};
/// Curvature combs: the feet and tips of their teeth.
struct Combs {
  struct Tooth {
    Point foot;
    Point tip;
    bool is_cut = false;  ///< shorter than it should be: the line through the tips has a gap
  };
  std::vector<std::vector<Tooth>> combs;
};
using Item = std::variant<Fill, Overlay, Nodes, Ring, LevelCurves, Combs>;

struct Scene {
  double width = 0.0;
  double height = 0.0;
  std::vector<Item> items;
};

Bezier moved(Bezier b, const Affine& map) {
  for (Point& point : b.p) point = map(point);
  return b;
}

void add_path(cairo_t* context, const Inked& inked) { glyphs::add_path(context, *inked.contours, inked.to_page); }

/// Ink as 8-bit coverage; glyph upon glyph, as they would be printed.
Coverage cover(const std::vector<Inked>& inked, int width, int height) {
  const SurfaceHandle surface(cairo_image_surface_create(CAIRO_FORMAT_A8, width, height));
  const ContextHandle context = start_drawing(surface.get());
  for (const Inked& one : inked) {
    add_path(context.get(), one);
    cairo_fill(context.get());
  }
  check_drawing(cairo_status(context.get()));
  cairo_surface_flush(surface.get());
  Coverage coverage{width, height, {}};
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < height; ++y)
    coverage.pixels.insert(coverage.pixels.end(), data + std::ptrdiff_t{y} * stride,
                           data + std::ptrdiff_t{y} * stride + width);
  return coverage;
}

/// A page that scenes are drawn on, kept in memory.
class Page {
 public:
  Page(ProofFormat format, double width, double height) : canvas_(format, std::ceil(width), std::ceil(height)) {
    if (format == ProofFormat::Pdf) set_date();
  }

  void draw(const Fill& fill) {
    for (const Inked& inked : fill.inked) glyphs::fill(canvas_.context(), *inked.contours, inked.to_page, fill.colour);
  }

  void draw(const Overlay& overlay) {
    if (canvas_.format() == ProofFormat::Png) {
      blend(overlay);
      return;
    }
    draw(Fill{overlay.before, went_colour});
    draw(Fill{overlay.after, came_colour});
    cairo_save(canvas_.context());
    for (const Inked& before : overlay.before) add_path(canvas_.context(), before);
    cairo_clip(canvas_.context());
    draw(Fill{overlay.after, ink_colour});
    cairo_restore(canvas_.context());
  }

  void draw(const Nodes& nodes) {
    cairo_t* context = canvas_.context();
    cairo_set_line_width(context, 0.7);
    for (const BezierContour& contour : *nodes.inked.contours) {
      const auto place = [&](int index) { return nodes.inked.to_page(contour.point(index)); };
      set_colour(came_colour);
      for (int s = 0; s < contour.segment_count(); ++s)
        for (int k = 1; k < contour.degree(s); ++k) {
          // A handle is tied to the node beside it; that of a quadratic to both.
          if (k == 1) stroke(place(contour.point_of(s, 0)), place(contour.point_of(s, 1)));
          if (k + 1 == contour.degree(s)) stroke(place(contour.point_of(s, k)), place(contour.point_of(s, k + 1)));
        }
      for (int i = 0; i < contour.point_count(); ++i) {
        const Point p = place(i);
        if (contour.kind(i) == fontcore::PointKind::Node)
          cairo_rectangle(context, p.x() - 2.0, p.y() - 2.0, 4.0, 4.0);
        else if (contour.kind(i) != fontcore::PointKind::ImpliedNode)
          cairo_arc(context, p.x(), p.y(), 1.8, 0.0, 2.0 * M_PI);
        set_colour({1.0, 1.0, 1.0});
        cairo_fill_preserve(context);
        set_colour(came_colour);
        cairo_stroke(context);
      }
    }
  }

  void draw(const LevelCurves& level) {
    cairo_t* context = canvas_.context();
    set_colour(level_colour);
    cairo_set_line_width(context, 1.2);
    for (const std::vector<Bezier>& curve : level.curves) {
      cairo_move_to(context, curve[0].start().x(), curve[0].start().y());
      for (const Bezier& b : curve) add_curve(context, b);
      cairo_close_path(context);
      cairo_stroke(context);
    }
    for (const Point& p : level.dots) {
      cairo_arc(context, p.x(), p.y(), 1.8, 0.0, 2.0 * M_PI);
      cairo_fill(context);
    }
  }

  void draw(const Combs& combs) {
    cairo_t* context = canvas_.context();
    set_colour(tooth_colour);
    cairo_set_line_width(context, 0.5);
    for (const auto& comb : combs.combs)
      for (const auto& [foot, tip, is_cut] : comb)
        if (foot != tip) stroke(foot, tip);
    set_colour(comb_colour);
    cairo_set_line_width(context, 0.9);
    cairo_set_line_join(context, CAIRO_LINE_JOIN_BEVEL);
    for (const auto& comb : combs.combs) {
      bool was_cut = true;
      for (const auto& [foot, tip, is_cut] : comb) {
        if (was_cut && is_cut)
          cairo_move_to(context, tip.x(), tip.y());
        else
          cairo_line_to(context, tip.x(), tip.y());
        was_cut = is_cut;
      }
      cairo_stroke(context);
    }
    cairo_set_line_join(context, CAIRO_LINE_JOIN_MITER);
  }

  void draw(const Ring& ring) {
    cairo_set_line_width(canvas_.context(), 1.5);
    set_colour(crossing_colour);
    cairo_arc(canvas_.context(), ring.where.x(), ring.where.y(), 6.0, 0.0, 2.0 * M_PI);
    cairo_stroke(canvas_.context());
  }

  Bytes finish() { return canvas_.finish(); }

 private:
  void set_colour(const Colour& colour) { glyphs::set_colour(canvas_.context(), colour); }

  void stroke(const Point& from, const Point& to) {
    cairo_move_to(canvas_.context(), from.x(), from.y());
    cairo_line_to(canvas_.context(), to.x(), to.y());
    cairo_stroke(canvas_.context());
  }

  /// Pixel by pixel, so that an edge that did not move has no coloured fringe.
  void blend(const Overlay& overlay) {
    Box box = box_of(overlay.before);
    box.add(box_of(overlay.after));
    if (box.is_empty()) return;
    const int columns = cairo_image_surface_get_width(canvas_.surface());
    const int rows = cairo_image_surface_get_height(canvas_.surface());
    const int left = std::clamp(static_cast<int>(std::floor(box.low.x())), 0, columns);
    const int top = std::clamp(static_cast<int>(std::floor(box.low.y())), 0, rows);
    const int width = std::clamp(static_cast<int>(std::ceil(box.high.x())), 0, columns) - left;
    const int height = std::clamp(static_cast<int>(std::ceil(box.high.y())), 0, rows) - top;
    if (width <= 0 || height <= 0) return;
    const Point to_corner(-left, -top);
    const Coverage before = cover(shifted(overlay.before, to_corner), width, height);
    const Coverage after = cover(shifted(overlay.after, to_corner), width, height);

    cairo_surface_flush(canvas_.surface());
    unsigned char* data = cairo_image_surface_get_data(canvas_.surface());
    const int stride = cairo_image_surface_get_stride(canvas_.surface());
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        const double b = before.pixels[i] / 255.0;
        const double a = after.pixels[i] / 255.0;
        const double common = std::min(a, b);
        unsigned char* bytes = data + std::ptrdiff_t{y + top} * stride + std::ptrdiff_t{x + left} * 4;
        std::uint32_t pixel = 0;
        std::memcpy(&pixel, bytes, sizeof pixel);
        const auto mix = [&](int shift, double Colour::*channel) {
          const double paper = ((pixel >> shift) & 0xFFU) / 255.0;
          const double mixed = paper * (1.0 - std::max(a, b)) + common * ink_colour.*channel +
                               (b - common) * went_colour.*channel + (a - common) * came_colour.*channel;
          return static_cast<std::uint32_t>(std::lround(mixed * 255.0)) << shift;
        };
        pixel = mix(16, &Colour::red) | mix(8, &Colour::green) | mix(0, &Colour::blue);
        std::memcpy(bytes, &pixel, sizeof pixel);
      }
    cairo_surface_mark_dirty(canvas_.surface());
  }

  /// The one that SOURCE_DATE_EPOCH gives.
  void set_date() {
    std::array<char, 32> date{};
    if (const char* epoch = std::getenv("SOURCE_DATE_EPOCH")) {
      std::time_t seconds = 0;
      const char* const end = epoch + std::strlen(epoch);
      const auto [stop, status] = std::from_chars(epoch, end, seconds);
      if (status != std::errc() || stop != end || seconds < 0)
        throw RequestError(std::string("SOURCE_DATE_EPOCH: '") + epoch + "' is no number of seconds");
      std::tm utc{};
      if (gmtime_r(&seconds, &utc) != nullptr) std::strftime(date.data(), date.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
    }
    cairo_pdf_surface_set_metadata(canvas_.surface(), CAIRO_PDF_METADATA_CREATE_DATE, date.data());
  }

  Canvas canvas_;
};

constexpr double margin = 24.0;         ///< round the page, pixels
constexpr double gap = 14.0;            ///< between rows and cells, pixels
constexpr double label_size = 13.0;     ///< pixels per em
constexpr double label_room = 20.0;     ///< height of a row of labels, pixels
constexpr double level_error = 0.05;    ///< of a level's curve as it is drawn, pixels
constexpr double tooth_step = 3.0;      ///< between the teeth of a comb, pixels
constexpr double longest_tooth = 0.15;  ///< em
constexpr double usual_tooth = 0.05;    ///< em: half of the curves' at most, where no scale is asked for

/// A word in the proofed font's own outlines, so that no other font is needed.
InkedLine ink_label(Outlines& outlines, const std::string& word) { return ink_line(outlines, word, label_size, {}); }

/// Nothing if the font lacks letters of the label. Gives where the next word may begin.
double add_label(Scene& scene, const InkedLine& label, const Point& baseline, const Colour& colour) {
  if (!label.is_complete) return baseline.x();
  scene.items.push_back(Fill{shifted(label.inked, baseline), colour});
  const double end = baseline.x() + label.box.high.x();
  scene.width = std::max(scene.width, end + margin);
  return end + 0.6 * label_size;
}

struct OverlayLabel {
  explicit OverlayLabel(Outlines& outlines)
      : head(ink_label(outlines, "overlaid:")), went(ink_label(outlines, "went")), came(ink_label(outlines, "came")) {}
  InkedLine head;
  InkedLine went;
  InkedLine came;
};

void add_label(Scene& scene, const OverlayLabel& label, const Point& baseline) {
  double x = add_label(scene, label.head, baseline, label_colour);
  x = add_label(scene, label.went, Point(x, baseline.y()), went_colour);
  add_label(scene, label.came, Point(x, baseline.y()), came_colour);
}

/// Pixels of the page for one font unit.
double scale_of(const Inked& inked) { return inked.to_page.linear(0, 0); }

/// Every contour of a glyph at the level for features longer than `scale`, in as few pieces as its size on the page
/// needs; what has no inside has no levels.
LevelCurves level_curves(const Inked& inked, double scale, double units_per_em) {
  LevelCurves level;
  for (const BezierContour& contour : *inked.contours) {
    if (!has_inside(contour)) continue;
    const fontcore::ArcwiseCurve arcs(fontcore::OutlineArcs(contour), {.tolerance = model_tolerance * units_per_em});
    std::vector<Bezier>& curve = level.curves.emplace_back();
    for (const Bezier& piece : arcs.pieces(scale, level_error / scale_of(inked)))
      curve.push_back(moved(piece, inked.to_page));
    const fontcore::Points ends = arcs.span_ends(scale);
    for (Eigen::Index i = 0; i < ends.rows(); ++i) level.dots.push_back(inked.to_page(ends.row(i).transpose()));
  }
  return level;
}

/// The combs of a glyph, whose teeth are `comb` em long where the radius is an em.
Combs curvature_combs(const Inked& inked, double comb, double units_per_em) {
  Combs combs;
  for (const BezierContour& contour : *inked.contours) {
    if (!has_inside(contour)) continue;
    for (const auto& teeth : curvature_comb(fontcore::OutlineArcs(contour), tooth_step / scale_of(inked))) {
      auto& drawn = combs.combs.emplace_back();
      for (const fontcore::CombTooth& tooth : teeth) {
        const double ems = comb * tooth.curvature * units_per_em;
        const double shown = std::clamp(ems, -longest_tooth, longest_tooth);
        drawn.push_back(
            {inked.to_page(tooth.foot), inked.to_page(tooth.foot - shown * units_per_em * tooth.normal), ems != shown});
      }
    }
  }
  return combs;
}

/// A glyph's outlines and the em that they are measured by.
using Measured = std::pair<const std::vector<BezierContour>*, double>;

/// The length of a tooth, em, where the radius is an em, that suits all these glyphs.
double readable_comb(const std::set<Measured>& glyphs) {
  constexpr double step = 0.01;  // em
  std::vector<double> bends;     // em / radius
  for (const auto& [contours, units_per_em] : glyphs)
    for (const BezierContour& contour : *contours) {
      if (!has_inside(contour)) continue;
      for (const auto& teeth : curvature_comb(fontcore::OutlineArcs(contour), step * units_per_em))
        for (const fontcore::CombTooth& tooth : teeth)
          if (tooth.curvature != 0.0) bends.push_back(std::abs(tooth.curvature) * units_per_em);
    }
  if (bends.empty()) return usual_tooth;
  const auto median = bends.begin() + static_cast<std::ptrdiff_t>(bends.size() / 2);
  std::ranges::nth_element(bends, median);
  return usual_tooth / *median;
}

Colour ink_below(const ProofOptions& options) {
  return options.nodes || options.comb || !options.levels.empty() ? marked_ink_colour : ink_colour;
}

Box with_room_for_marks(Box box, double pixels_per_em, const ProofOptions& options) {
  if (!options.comb) return box;
  const Point tooth = Point::Constant(longest_tooth * pixels_per_em);
  box.low -= tooth;
  box.high += tooth;
  return box;
}

/// Combs, levels, nodes and crossings on top of the ink.
void add_marks(Scene& scene, const std::vector<Inked>& inked, double units_per_em, const std::optional<double>& level,
               const ProofOptions& options) {
  for (const Inked& one : inked) {
    if (options.comb) scene.items.push_back(curvature_combs(one, *options.comb, units_per_em));
    if (level) scene.items.push_back(level_curves(one, *level, units_per_em));
    if (options.nodes) scene.items.push_back(Nodes{one});
    if (options.crossings)
      for (const fontcore::Crossing& crossing : fontcore::find_crossings(*one.contours))
        scene.items.push_back(Ring{one.to_page(crossing.where)});
  }
}

/// The levels to draw one beside the other; without any, once without.
std::vector<std::optional<double>> levels_of(const ProofOptions& options) {
  if (options.levels.empty()) return {std::nullopt};
  return {options.levels.begin(), options.levels.end()};
}

/// What a label says of one of several levels.
std::string named_level(const std::optional<double>& level, const ProofOptions& options) {
  return level && options.levels.size() > 1 ? fontcore::text(" level ", *level) : "";
}

/// Largest side and size of a picture, pixels: what viewers open without trouble.
constexpr double largest_side = 16000.0;
constexpr double largest_size = 64e6;
constexpr double fewest_pixels_per_em = 4.0;

/// The scene at the wished scale, or as large as a picture may be: `lay` takes the share of its sizes.
template <typename Lay>
Bytes draw(ProofFormat format, double pixels_per_em, const Lay& lay) {
  double share = 1.0;
  Scene scene = lay(share);
  while (scene.width > largest_side || scene.height > largest_side || scene.width * scene.height > largest_size) {
    const double excess = std::max({scene.width / largest_side, scene.height / largest_side,
                                    std::sqrt(scene.width * scene.height / largest_size)});
    share *= 0.95 / excess;
    if (share * pixels_per_em < fewest_pixels_per_em)
      throw RequestError(fontcore::text("proof: too much for one picture of ", largest_side, " pixels a side"));
    scene = lay(share);
  }
  Page page(format, scene.width, scene.height);
  for (const Item& item : scene.items) std::visit([&](const auto& one) { page.draw(one); }, item);
  return page.finish();
}

void check_options(const ProofOptions& options) {
  std::vector<double> sizes = options.waterfall;
  sizes.push_back(options.pixels_per_em);
  for (const double size : sizes)
    if (!(size >= fewest_pixels_per_em && size <= largest_side))
      throw RequestError(fontcore::text("proof: ", size, " pixels per em is not between ", fewest_pixels_per_em,
                                        " and ", largest_side));
  for (const double level : options.levels)
    if (!(level >= 0.0 && std::isfinite(level)))
      throw RequestError(fontcore::text("proof: level ", level, " is not a length"));
  if (options.comb && !(*options.comb >= 0.0 && std::isfinite(*options.comb)))
    throw RequestError(fontcore::text("proof: comb ", *options.comb, " is not a length"));
}

/// A row of set text, where it will stand still open.
struct Row {
  std::vector<std::pair<InkedLine, Colour>> label;
  Box room;  ///< of the line, its origin at (0, 0)
  bool ends_at_right = false;
  std::vector<Inked> inked;
  std::optional<std::vector<Inked>> before;  ///< to be overlaid by it
  bool is_marked = false;
  std::optional<double> level;
  double units_per_em = 0.0;
};

/// The rows of one font at one size.
class RowMaker {
 public:
  RowMaker(const ProofedFont& font, const ProofOptions& options)
      : options_(options), name_(font.font.family + " " + font.font.style), now_(font.font) {
    if (!font.place.empty()) name_ += " " + font.place;
    if (font.against != nullptr) old_.emplace(*font.against);
  }

  /// All outlines that setting the lines takes, but those of labels.
  void add_measured(const std::vector<std::string>& lines, std::set<Measured>& to) {
    for (const InkedLine& line : ink_lines(now_, lines, 1.0, options_.shaping))
      for (const Inked& one : line.inked) to.emplace(one.contours, now_.font().units_per_em);
  }

  void add_rows(const std::vector<std::string>& lines, double pixels_per_em, const std::string& size, bool is_named,
                std::vector<Row>& to) {
    Outlines& labels = old_ ? *old_ : now_;
    const std::vector<InkedLine> after = ink_lines(now_, lines, pixels_per_em, options_.shaping);
    std::vector<InkedLine> before;
    if (old_) before = ink_lines(*old_, lines, pixels_per_em, options_.shaping);
    const std::string name = name_ + size;
    for (std::size_t i = 0; i < after.size(); ++i) {
      Box room = after[i].box;
      if (old_) room.add(before[i].box);
      room = with_room_for_marks(room, pixels_per_em, options_);
      const auto row_of = [&](const InkedLine& line) {
        Row row;
        row.room = room;
        row.ends_at_right = line.direction == Direction::RightToLeft;
        row.inked = line.inked;
        row.units_per_em = now_.font().units_per_em;
        return row;
      };
      const auto label = [&](Row& row, const std::string& words, const Colour& colour) {
        if (!words.empty()) row.label.emplace_back(ink_label(labels, words), colour);
      };
      if (old_) {
        Row row = row_of(before[i]);
        if (is_named && i == 0) label(row, name, label_colour);
        label(row, "before", label_colour);
        to.push_back(std::move(row));
      }
      bool is_first = i == 0 && !old_;
      for (const std::optional<double>& level : levels_of(options_)) {
        Row row = row_of(after[i]);
        row.is_marked = true;
        row.level = level;
        label(row, (old_ ? "after" : is_first ? name : "") + named_level(level, options_), label_colour);
        is_first = false;
        to.push_back(std::move(row));
      }
      if (!old_) continue;
      Row row = row_of(after[i]);
      row.before = before[i].inked;
      label(row, "overlaid:", label_colour);
      label(row, "went", went_colour);
      label(row, "came", came_colour);
      to.push_back(std::move(row));
    }
  }

 private:
  const ProofOptions& options_;
  std::string name_;
  Outlines now_;
  std::optional<Outlines> old_;
};

void place(const std::vector<Row>& rows, const ProofOptions& options, Scene& scene) {
  const auto width_of = [](const Row& row) { return row.room.high.x() - row.room.low.x(); };
  double width = 0.0;
  for (const Row& row : rows) width = std::max(width, width_of(row));
  scene.width = width + 2.0 * margin;
  double top = margin;
  for (const Row& row : rows) {
    Point word(margin, top + label_size);
    for (const auto& [ink, colour] : row.label) word.x() = add_label(scene, ink, word, colour);
    const double left = margin + (row.ends_at_right ? width - width_of(row) : 0.0);
    if (!row.label.empty()) top += label_room;
    const Point origin(left - row.room.low.x(), top - row.room.low.y());
    const std::vector<Inked> inked = shifted(row.inked, origin);
    if (row.before)
      scene.items.push_back(Overlay{shifted(*row.before, origin), inked});
    else
      scene.items.push_back(Fill{inked, row.is_marked ? ink_below(options) : ink_colour});
    if (row.is_marked) add_marks(scene, inked, row.units_per_em, row.level, options);
    top += (row.room.high.y() - row.room.low.y()) + gap;
  }
  scene.height = top - gap + margin;
}

}  // namespace

ProofFormat proof_format(const std::string& path) {
  const auto ends_with = [&](const char* ending) { return path.ends_with(ending); };
  if (ends_with(".png")) return ProofFormat::Png;
  if (ends_with(".pdf")) return ProofFormat::Pdf;
  if (ends_with(".svg")) return ProofFormat::Svg;
  throw RequestError(path + ": a proof ends in .png, .pdf or .svg");
}

Coverage draw_coverage(const Font& font, int glyph, double pixels_per_em, int width, int height, double left,
                       double baseline) {
  Outlines outlines(font);
  return cover({shifted(outlines.ink(glyph, Point::Zero(), pixels_per_em), Point(left, baseline))}, width, height);
}

Bytes draw_proof(const std::vector<ProofedFont>& fonts, const std::string& text, ProofFormat format,
                 const ProofOptions& options) {
  check_options(options);
  if (fonts.empty()) throw RequestError("proof: no font to draw");
  const std::vector<std::string> lines = split_lines(text);
  if (std::all_of(lines.begin(), lines.end(), [](const std::string& line) { return line.empty(); }))
    throw RequestError("text: it is empty");
  ProofOptions shown = options;
  std::vector<std::unique_ptr<RowMaker>> makers;
  for (const ProofedFont& font : fonts) makers.push_back(std::make_unique<RowMaker>(font, shown));
  if (shown.comb == 0.0) {
    std::set<Measured> measured;
    for (const auto& maker : makers) maker->add_measured(lines, measured);
    shown.comb = readable_comb(measured);
  }
  std::vector<double> sizes = options.waterfall;
  if (sizes.empty()) sizes.push_back(options.pixels_per_em);
  const bool is_named = fonts.size() > 1 || !options.waterfall.empty();

  return draw(format, std::ranges::max(sizes), [&](double share) {
    std::vector<Row> rows;
    for (const auto& maker : makers)
      for (const double size : sizes)
        maker->add_rows(lines, size * share, options.waterfall.empty() ? "" : fontcore::text(" ", size), is_named,
                        rows);
    Scene scene;
    place(rows, shown, scene);
    return scene;
  });
}

Bytes draw_proof(const Font& font, const std::optional<Font>& against, const std::string& text, ProofFormat format,
                 const ProofOptions& options) {
  return draw_proof({{font, against ? &*against : nullptr, ""}}, text, format, options);
}

namespace {

/// The glyph of another font that stands for one; -1 if there is none.
int counterpart(const Font& font, int glyph, const Font& other) {
  const auto id = static_cast<std::size_t>(glyph);
  const std::string& name = font.glyphs[id].name;
  if (id < other.glyphs.size() && other.glyphs[id].name == name) return glyph;
  if (const int named = other.find(name); named >= 0) return named;
  for (const auto& [character, own] : font.character_map) {
    if (own != glyph) continue;
    const auto found = other.character_map.find(character);
    if (found != other.character_map.end()) return found->second;
  }
  return -1;
}

}  // namespace

struct GlyphProof::Section {
  struct Cell {
    std::optional<Inked> before;  ///< in ems, as all here
    Inked after;
    double advance = 0.0;
    std::optional<double> level;
    InkedLine label;
  };
  double units_per_em = 0.0;
  std::vector<Cell> cells;
  std::optional<OverlayLabel> overlay;
  std::optional<InkedLine> title;
  std::array<ComposedGlyphs, 2> outlines;  ///< what is inked
};

GlyphProof::GlyphProof(const ProofOptions& options) : options_(options) { check_options(options); }

GlyphProof::~GlyphProof() = default;

void GlyphProof::add(const Font& font, const Font* against, const std::vector<int>& glyphs, const std::string& title) {
  Outlines now(font);
  std::optional<Outlines> old;
  if (against != nullptr) old.emplace(*against);
  Outlines& labels = old ? *old : now;
  auto section = std::make_unique<Section>();
  section->units_per_em = font.units_per_em;
  for (const int glyph : glyphs) {
    if (glyph < 0 || glyph >= static_cast<int>(font.glyphs.size()))
      throw RequestError(fontcore::text(font.path, ": there is no glyph gid:", glyph));
    const Glyph& own = font.glyphs[static_cast<std::size_t>(glyph)];
    const int before = old ? counterpart(font, glyph, *against) : -1;
    for (const std::optional<double>& level : levels_of(options_)) {
      Section::Cell& cell = section->cells.emplace_back();
      cell.after = now.ink(glyph, Point::Zero(), 1.0);
      if (before >= 0) cell.before = old->ink(before, Point::Zero(), 1.0);
      cell.advance = own.advance / font.units_per_em;
      cell.level = level;
      cell.label = ink_label(labels, own.name + named_level(level, options_));
    }
  }
  if (old) section->overlay.emplace(*old);
  if (!title.empty()) section->title = ink_label(labels, title);
  section->outlines[0] = std::move(now).take();
  if (old) section->outlines[1] = std::move(*old).take();
  sections_.push_back(std::move(section));
}

Bytes GlyphProof::draw(ProofFormat format) const {
  const bool is_empty = std::ranges::all_of(sections_, [](const auto& section) { return section->cells.empty(); });
  if (is_empty) throw RequestError("proof: no glyph to draw");

  ProofOptions shown = options_;
  if (shown.comb == 0.0) {
    std::set<Measured> measured;
    for (const auto& section : sections_)
      for (const Section::Cell& cell : section->cells) measured.emplace(cell.after.contours, section->units_per_em);
    shown.comb = readable_comb(measured);
  }

  return glyphs::draw(format, options_.pixels_per_em, [&](double share) {
    const double pixels_per_em = share * options_.pixels_per_em;
    struct Grid {
      std::vector<Box> boxes;      // of each cell, its origin at (0, 0)
      Point step = Point::Zero();  // from cell to cell
      double above = 0.0;          // most that any reaches above its baseline
    };
    std::vector<Grid> grids;
    double area = 0.0;
    for (const auto& section : sections_) {
      Grid grid;
      double width = 0.0;
      double below = 0.0;
      for (const Section::Cell& cell : section->cells) {
        Box box = box_of({scaled(cell.after, pixels_per_em)});
        if (cell.before) box.add(box_of({scaled(*cell.before, pixels_per_em)}));
        box.add(Point::Zero());
        box.add(Point(cell.advance * pixels_per_em, 0.0));
        box = with_room_for_marks(box, pixels_per_em, shown);
        width = std::max({width, box.high.x() - box.low.x(), cell.label.box.high.x()});
        grid.above = std::max(grid.above, -box.low.y());
        below = std::max(below, box.high.y());
        grid.boxes.push_back(box);
      }
      grid.step = Point(width + gap, grid.above + below + label_room + gap);
      area += static_cast<double>(grid.boxes.size()) * grid.step.x() * grid.step.y();
      grids.push_back(std::move(grid));
    }

    // As wide as a screen, or as a square where there is more.
    const double wished_width = std::max(1600.0, std::sqrt(area));
    Scene scene;
    double top = margin;
    if (const auto& overlay = sections_.front()->overlay) {
      add_label(scene, *overlay, Point(margin, margin + 0.5 * label_size));
      top += label_room + gap;
    }
    for (std::size_t k = 0; k < grids.size(); ++k) {
      const Section& section = *sections_[k];
      const auto& [boxes, step, above] = grids[k];
      if (section.title) {
        top += k == 0 ? 0.0 : gap;
        add_label(scene, *section.title, Point(margin, top + 0.5 * label_size), label_colour);
        top += label_room + gap;
      }
      if (boxes.empty()) continue;
      const auto count = static_cast<double>(boxes.size());
      const double columns = std::clamp(std::floor(wished_width / step.x()), 1.0, count);
      scene.width = std::max(scene.width, 2.0 * margin + columns * step.x() - gap);
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Section::Cell& cell = section.cells[i];
        const double column = std::fmod(static_cast<double>(i), columns);
        const double row = std::floor(static_cast<double>(i) / columns);
        const Point corner(margin + column * step.x(), top + row * step.y());
        const Point origin = corner + Point(-boxes[i].low.x(), above);
        const std::vector<Inked> after{shifted(scaled(cell.after, pixels_per_em), origin)};
        if (section.overlay) {
          std::vector<Inked> before;
          if (cell.before) before.push_back(shifted(scaled(*cell.before, pixels_per_em), origin));
          scene.items.push_back(Overlay{before, after});
        } else {
          scene.items.push_back(Fill{after, ink_below(shown)});
        }
        add_marks(scene, after, section.units_per_em, cell.level, shown);
        add_label(scene, cell.label, corner + Point(0.0, step.y() - gap - 0.3 * label_size), label_colour);
      }
      top += std::ceil(count / columns) * step.y();
    }
    scene.height = top - gap + margin;
    return scene;
  });
}

Bytes draw_glyph_proof(const Font& font, const std::optional<Font>& against, const std::vector<int>& glyphs,
                       ProofFormat format, const ProofOptions& options) {
  GlyphProof proof(options);
  proof.add(font, against ? &*against : nullptr, glyphs);
  return proof.draw(format);
}

}  // namespace glyphs
