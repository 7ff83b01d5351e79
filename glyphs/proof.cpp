#include "glyphs/proof.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <memory>
#include <utility>
#include <variant>

#include "fontcore/arcwise.h"
#include "fontcore/measure.h"
#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::Affine;
using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Box;
using fontcore::Point;

struct Colour {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
};
constexpr Colour ink_colour{0.16, 0.16, 0.18};
constexpr Colour went_colour{0.86, 0.13, 0.11};
constexpr Colour came_colour{0.13, 0.36, 0.92};
constexpr Colour label_colour{0.45, 0.45, 0.48};
constexpr Colour crossing_colour{0.95, 0.55, 0.0};
constexpr Colour level_colour{0.0, 0.72, 0.36};

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

/// A line of text as ink, and the room it takes: its advance, its ink, and ascender to descender.
struct InkedLine {
  std::vector<Inked> inked;
  Box box;
  bool is_complete = true;  ///< the font had every character
};

InkedLine ink_line(Outlines& outlines, const std::string& text, double pixels_per_em, const ShapingOptions& shaping) {
  const Font& font = outlines.font();
  const double scale = pixels_per_em / font.units_per_em;
  InkedLine line;
  line.box.add(Point(0.0, -font.ascender * scale));
  line.box.add(Point(0.0, -font.descender * scale));
  if (text.empty()) return line;
  const ShapedLine shaped = shape(font, text, shaping);
  for (const PlacedGlyph& placed : shaped.glyphs) {
    line.inked.push_back(outlines.ink(placed.glyph, placed.origin, pixels_per_em));
    line.is_complete = line.is_complete && placed.glyph != 0;
    line.box.add(scale * Point(placed.origin.x(), -placed.origin.y()));
  }
  if (shaping.direction != "ttb" && shaping.direction != "btt")
    line.box.add(Point(shaped.advance * scale, line.box.low.y()));
  line.box.add(box_of(line.inked));
  return line;
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
/// Curves of one level, closed, and the ends of their spans.
struct LevelCurves {
  std::vector<std::vector<Point>> curves;
  std::vector<Point> dots;
};
using Item = std::variant<Fill, Overlay, Nodes, Ring, LevelCurves>;

struct Scene {
  double width = 0.0;
  double height = 0.0;
  std::vector<Item> items;
};

template <auto destroy>
struct Destroy {
  template <typename T>
  void operator()(T* object) const {
    destroy(object);
  }
};
using SurfaceHandle = std::unique_ptr<cairo_surface_t, Destroy<cairo_surface_destroy>>;
using ContextHandle = std::unique_ptr<cairo_t, Destroy<cairo_destroy>>;

/// How far a flattened curve may lie from the curve, pixels: below what 8-bit coverage shows.
constexpr double flattening = 0.01;

void add_path(cairo_t* context, const Inked& inked) {
  for (const BezierContour& contour : *inked.contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      const Bezier segment = contour.segment(s);
      std::array<Point, 4> p = segment.p;
      for (Point& point : p) point = inked.to_page(point);
      if (s == 0) cairo_move_to(context, p[0].x(), p[0].y());
      if (segment.degree == 2)  // raised to a cubic, which is exact
        p = {p[0], (p[0] + 2.0 * p[1]) / 3.0, (2.0 * p[1] + p[2]) / 3.0, p[2]};
      if (segment.degree == 1)
        cairo_line_to(context, p[1].x(), p[1].y());
      else
        cairo_curve_to(context, p[1].x(), p[1].y(), p[2].x(), p[2].y(), p[3].x(), p[3].y());
    }
    cairo_close_path(context);
  }
}

ContextHandle start_drawing(cairo_surface_t* surface) {
  ContextHandle context(cairo_create(surface));
  cairo_set_fill_rule(context.get(), CAIRO_FILL_RULE_WINDING);
  cairo_set_antialias(context.get(), CAIRO_ANTIALIAS_BEST);
  cairo_set_tolerance(context.get(), flattening);
  return context;
}

void check(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw FontWriteError(std::string("proof: cairo: ") + cairo_status_to_string(status));
}

/// Ink as 8-bit coverage; glyph upon glyph, as they would be printed.
Coverage cover(const std::vector<Inked>& inked, int width, int height) {
  const SurfaceHandle surface(cairo_image_surface_create(CAIRO_FORMAT_A8, width, height));
  const ContextHandle context = start_drawing(surface.get());
  for (const Inked& one : inked) {
    add_path(context.get(), one);
    cairo_fill(context.get());
  }
  check(cairo_status(context.get()));
  cairo_surface_flush(surface.get());
  Coverage coverage{width, height, {}};
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < height; ++y)
    coverage.pixels.insert(coverage.pixels.end(), data + std::ptrdiff_t{y} * stride,
                           data + std::ptrdiff_t{y} * stride + width);
  return coverage;
}

cairo_status_t append(void* bytes, const unsigned char* data, unsigned length) {
  auto* target = static_cast<Bytes*>(bytes);
  target->insert(target->end(), data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

/// A page that scenes are drawn on, kept in memory.
class Page {
 public:
  Page(ProofFormat format, double width, double height) : format_(format) {
    const int columns = static_cast<int>(std::ceil(width));
    const int rows = static_cast<int>(std::ceil(height));
    if (format == ProofFormat::Png)
      surface_.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, columns, rows));
    else if (format == ProofFormat::Pdf)
      surface_.reset(cairo_pdf_surface_create_for_stream(append, &bytes_, columns, rows));
    else
      surface_.reset(cairo_svg_surface_create_for_stream(append, &bytes_, columns, rows));
    if (format == ProofFormat::Pdf) set_date();
    context_ = start_drawing(surface_.get());
    set_colour({1.0, 1.0, 1.0});
    cairo_paint(context_.get());
  }

  void draw(const Fill& fill) {
    set_colour(fill.colour);
    for (const Inked& inked : fill.inked) {
      add_path(context_.get(), inked);
      cairo_fill(context_.get());
    }
  }

  void draw(const Overlay& overlay) {
    if (format_ == ProofFormat::Png) {
      blend(overlay);
      return;
    }
    draw(Fill{overlay.before, went_colour});
    draw(Fill{overlay.after, came_colour});
    cairo_save(context_.get());
    for (const Inked& before : overlay.before) add_path(context_.get(), before);
    cairo_clip(context_.get());
    draw(Fill{overlay.after, ink_colour});
    cairo_restore(context_.get());
  }

  void draw(const Nodes& nodes) {
    cairo_t* context = context_.get();
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
    cairo_t* context = context_.get();
    set_colour(level_colour);
    cairo_set_line_width(context, 1.2);
    for (const std::vector<Point>& curve : level.curves) {
      cairo_move_to(context, curve[0].x(), curve[0].y());
      for (const Point& p : curve) cairo_line_to(context, p.x(), p.y());
      cairo_close_path(context);
      cairo_stroke(context);
    }
    for (const Point& p : level.dots) {
      cairo_arc(context, p.x(), p.y(), 1.8, 0.0, 2.0 * M_PI);
      cairo_fill(context);
    }
  }

  void draw(const Ring& ring) {
    cairo_set_line_width(context_.get(), 1.5);
    set_colour(crossing_colour);
    cairo_arc(context_.get(), ring.where.x(), ring.where.y(), 6.0, 0.0, 2.0 * M_PI);
    cairo_stroke(context_.get());
  }

  Bytes finish() {
    check(cairo_status(context_.get()));
    if (format_ == ProofFormat::Png) check(cairo_surface_write_to_png_stream(surface_.get(), append, &bytes_));
    cairo_surface_finish(surface_.get());
    check(cairo_surface_status(surface_.get()));
    if (format_ == ProofFormat::Svg) forget_surface_number();
    return std::move(bytes_);
  }

 private:
  void set_colour(const Colour& colour) { cairo_set_source_rgb(context_.get(), colour.red, colour.green, colour.blue); }

  void stroke(const Point& from, const Point& to) {
    cairo_move_to(context_.get(), from.x(), from.y());
    cairo_line_to(context_.get(), to.x(), to.y());
    cairo_stroke(context_.get());
  }

  /// Pixel by pixel, so that an edge that did not move has no coloured fringe.
  void blend(const Overlay& overlay) {
    Box box = box_of(overlay.before);
    box.add(box_of(overlay.after));
    if (box.is_empty()) return;
    const int columns = cairo_image_surface_get_width(surface_.get());
    const int rows = cairo_image_surface_get_height(surface_.get());
    const int left = std::clamp(static_cast<int>(std::floor(box.low.x())), 0, columns);
    const int top = std::clamp(static_cast<int>(std::floor(box.low.y())), 0, rows);
    const int width = std::clamp(static_cast<int>(std::ceil(box.high.x())), 0, columns) - left;
    const int height = std::clamp(static_cast<int>(std::ceil(box.high.y())), 0, rows) - top;
    if (width <= 0 || height <= 0) return;
    const Point to_corner(-left, -top);
    const Coverage before = cover(shifted(overlay.before, to_corner), width, height);
    const Coverage after = cover(shifted(overlay.after, to_corner), width, height);

    cairo_surface_flush(surface_.get());
    unsigned char* data = cairo_image_surface_get_data(surface_.get());
    const int stride = cairo_image_surface_get_stride(surface_.get());
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
    cairo_surface_mark_dirty(surface_.get());
  }

  /// No date, or the one that SOURCE_DATE_EPOCH gives.
  void set_date() {
    std::array<char, 32> date{};
    if (const char* epoch = std::getenv("SOURCE_DATE_EPOCH")) {
      const std::time_t seconds = std::strtoll(epoch, nullptr, 10);
      std::tm utc{};
      if (gmtime_r(&seconds, &utc) != nullptr) std::strftime(date.data(), date.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
    }
    cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATE_DATE, date.data());
  }

  /// cairo numbers its surfaces through the life of the program and puts the number in the file.
  void forget_surface_number() {
    const std::string head = "<g id=\"surface";
    auto found = std::search(bytes_.begin(), bytes_.end(), head.begin(), head.end());
    if (found == bytes_.end()) return;
    found += static_cast<std::ptrdiff_t>(head.size());
    bytes_.erase(found, std::find_if(found, bytes_.end(), [](unsigned char c) { return c < '0' || c > '9'; }));
  }

  ProofFormat format_;
  Bytes bytes_;  // before the surface, which writes to it until it is destroyed
  SurfaceHandle surface_;
  ContextHandle context_;
};

constexpr double margin = 24.0;      ///< round the page, pixels
constexpr double gap = 14.0;         ///< between rows and cells, pixels
constexpr double label_size = 13.0;  ///< pixels per em
constexpr double label_room = 20.0;  ///< height of a row of labels, pixels
constexpr double level_step = 2e-3;  ///< between the points of a level's curve, em

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

/// Every contour of a glyph at the level for features longer than `scale`; what has no inside has no levels.
LevelCurves level_curves(const Inked& inked, double scale, double units_per_em) {
  LevelCurves level;
  for (const BezierContour& contour : *inked.contours) {
    if (!has_inside(contour)) continue;
    const fontcore::OutlineCurve outline(contour, {.tolerance = model_tolerance * units_per_em});
    const fontcore::ArcwiseCurve arcs(outline, {.tolerance = model_tolerance * units_per_em});
    const fontcore::Points curve = arcs.to_polyline(scale, level_step * units_per_em);
    level.curves.emplace_back();
    for (Eigen::Index i = 0; i < curve.rows(); ++i)
      level.curves.back().push_back(inked.to_page(curve.row(i).transpose()));
    const fontcore::Points ends = arcs.span_ends(scale);
    for (Eigen::Index i = 0; i < ends.rows(); ++i) level.dots.push_back(inked.to_page(ends.row(i).transpose()));
  }
  return level;
}

/// Nodes, levels and crossings on top of the ink.
void add_marks(Scene& scene, const std::vector<Inked>& inked, double units_per_em, const ProofOptions& options) {
  for (const Inked& one : inked) {
    if (options.level) scene.items.push_back(level_curves(one, *options.level, units_per_em));
    if (options.nodes) scene.items.push_back(Nodes{one});
    if (options.crossings)
      for (const fontcore::Crossing& crossing : fontcore::find_crossings(*one.contours))
        scene.items.push_back(Ring{one.to_page(crossing.where)});
  }
}

/// Largest side and size of a picture, pixels: what viewers open without trouble.
constexpr double largest_side = 16000.0;
constexpr double largest_size = 64e6;
constexpr double fewest_pixels_per_em = 4.0;

/// The scene at the wished scale, or as large as a picture may be.
template <typename Lay>
Bytes draw(ProofFormat format, double pixels_per_em, const Lay& lay) {
  Scene scene = lay(pixels_per_em);
  while (scene.width > largest_side || scene.height > largest_side || scene.width * scene.height > largest_size) {
    const double excess = std::max({scene.width / largest_side, scene.height / largest_side,
                                    std::sqrt(scene.width * scene.height / largest_size)});
    pixels_per_em *= 0.95 / excess;
    if (pixels_per_em < fewest_pixels_per_em)
      throw RequestError(fontcore::text("proof: too much for one picture of ", largest_side, " pixels a side"));
    scene = lay(pixels_per_em);
  }
  Page page(format, scene.width, scene.height);
  for (const Item& item : scene.items) std::visit([&](const auto& one) { page.draw(one); }, item);
  return page.finish();
}

void check_options(const ProofOptions& options) {
  if (!(options.pixels_per_em >= fewest_pixels_per_em && options.pixels_per_em <= largest_side))
    throw RequestError(fontcore::text("proof: ", options.pixels_per_em, " pixels per em is not between ",
                                      fewest_pixels_per_em, " and ", largest_side));
  if (options.level && !(*options.level >= 0.0 && std::isfinite(*options.level)))
    throw RequestError(fontcore::text("proof: level ", *options.level, " is not a length"));
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

Bytes draw_proof(const Font& font, const std::optional<Font>& against, const std::string& text, ProofFormat format,
                 const ProofOptions& options) {
  check_options(options);
  const std::vector<std::string> lines = split_lines(text);
  if (std::all_of(lines.begin(), lines.end(), [](const std::string& line) { return line.empty(); }))
    throw RequestError("text: it is empty");
  Outlines now(font);
  std::optional<Outlines> old;
  if (against) old.emplace(*against);

  return draw(format, options.pixels_per_em, [&](double pixels_per_em) {
    Scene scene;
    double top = margin;
    const auto add_row = [&](const Box& room) {  // gives the row's origin: left end of its baseline
      const Point origin(margin - room.low.x(), top + label_room - room.low.y());
      top += label_room + (room.high.y() - room.low.y()) + gap;
      scene.width = std::max(scene.width, room.high.x() - room.low.x() + 2.0 * margin);
      return origin;
    };
    const auto label_at = [&] { return Point(margin, top + label_size); };
    const std::string name = font.family + " " + font.style;
    for (const std::string& line : lines) {
      const InkedLine after = ink_line(now, line, pixels_per_em, options.shaping);
      if (!old) {
        if (top == margin) add_label(scene, ink_label(now, name), label_at(), label_colour);
        const std::vector<Inked> row = shifted(after.inked, add_row(after.box));
        scene.items.push_back(Fill{row, ink_colour});
        add_marks(scene, row, font.units_per_em, options);
        continue;
      }
      const InkedLine before = ink_line(*old, line, pixels_per_em, options.shaping);
      Box room = before.box;
      room.add(after.box);
      add_label(scene, ink_label(*old, "before"), label_at(), label_colour);
      scene.items.push_back(Fill{shifted(before.inked, add_row(room)), ink_colour});
      add_label(scene, ink_label(*old, "after"), label_at(), label_colour);
      const std::vector<Inked> row = shifted(after.inked, add_row(room));
      scene.items.push_back(Fill{row, ink_colour});
      add_marks(scene, row, font.units_per_em, options);
      add_label(scene, OverlayLabel(*old), label_at());
      const Point origin = add_row(room);
      scene.items.push_back(Overlay{shifted(before.inked, origin), shifted(after.inked, origin)});
    }
    scene.height = top - gap + margin;
    return scene;
  });
}

struct GlyphProof::Section {
  struct Cell {
    std::optional<Inked> before;  ///< in ems, as all here
    Inked after;
    double advance = 0.0;
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
  const auto name_in = [](const Font& in, int glyph) {
    if (glyph < 0 || glyph >= static_cast<int>(in.glyphs.size()))
      throw RequestError(fontcore::text(in.path, ": there is no glyph gid:", glyph));
    return in.glyphs[static_cast<std::size_t>(glyph)].name;
  };
  Outlines now(font);
  std::optional<Outlines> old;
  if (against != nullptr) old.emplace(*against);
  Outlines& labels = old ? *old : now;
  auto section = std::make_unique<Section>();
  section->units_per_em = font.units_per_em;
  for (const int glyph : glyphs) {
    const std::string name = name_in(font, glyph);
    if (old && name_in(*against, glyph) != name)
      throw RequestError(fontcore::text(against->path, ": glyph gid:", glyph, " is ", name_in(*against, glyph),
                                        ", but in ", font.path, " it is ", name));
    Section::Cell& cell = section->cells.emplace_back();
    cell.after = now.ink(glyph, Point::Zero(), 1.0);
    if (old) cell.before = old->ink(glyph, Point::Zero(), 1.0);
    cell.advance = font.glyphs[static_cast<std::size_t>(glyph)].advance / font.units_per_em;
    cell.label = ink_label(labels, name);
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

  return glyphs::draw(format, options_.pixels_per_em, [&](double pixels_per_em) {
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
        if (cell.before)
          scene.items.push_back(Overlay{{shifted(scaled(*cell.before, pixels_per_em), origin)}, after});
        else
          scene.items.push_back(Fill{after, ink_colour});
        add_marks(scene, after, section.units_per_em, options_);
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
