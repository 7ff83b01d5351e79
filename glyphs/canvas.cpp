#include "glyphs/canvas.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>

#include <algorithm>
#include <array>

#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;

/// How far a flattened curve may lie from the curve, pixels: below what 8-bit coverage shows.
constexpr double flattening = 0.01;

cairo_status_t append(void* bytes, const unsigned char* data, unsigned length) {
  auto* target = static_cast<Bytes*>(bytes);
  target->insert(target->end(), data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

/// cairo numbers its surfaces through the life of the program and puts the number in the file.
void forget_surface_number(Bytes& svg) {
  const std::string head = "<g id=\"surface";
  auto found = std::search(svg.begin(), svg.end(), head.begin(), head.end());
  if (found == svg.end()) return;
  found += static_cast<std::ptrdiff_t>(head.size());
  svg.erase(found, std::find_if(found, svg.end(), [](unsigned char c) { return c < '0' || c > '9'; }));
}

}  // namespace

ContextHandle start_drawing(cairo_surface_t* surface) {
  ContextHandle context(cairo_create(surface));
  cairo_set_fill_rule(context.get(), CAIRO_FILL_RULE_WINDING);
  cairo_set_antialias(context.get(), CAIRO_ANTIALIAS_BEST);
  cairo_set_tolerance(context.get(), flattening);
  return context;
}

void check_drawing(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw FontWriteError(std::string("proof: cairo: ") + cairo_status_to_string(status));
}

void set_colour(cairo_t* context, const Colour& colour) {
  cairo_set_source_rgb(context, colour.red, colour.green, colour.blue);
}

void add_curve(cairo_t* context, const Bezier& b) {
  const std::array<Point, 4>& p = b.p;
  if (b.degree == 1) {
    cairo_line_to(context, p[1].x(), p[1].y());
  } else if (b.degree == 2) {  // raised to a cubic, which is exact
    const Point out = (p[0] + 2.0 * p[1]) / 3.0;
    const Point in = (2.0 * p[1] + p[2]) / 3.0;
    cairo_curve_to(context, out.x(), out.y(), in.x(), in.y(), p[2].x(), p[2].y());
  } else {
    cairo_curve_to(context, p[1].x(), p[1].y(), p[2].x(), p[2].y(), p[3].x(), p[3].y());
  }
}

void add_path(cairo_t* context, const std::vector<BezierContour>& contours, const fontcore::Affine& to_page) {
  for (const BezierContour& contour : contours) {
    for (int s = 0; s < contour.segment_count(); ++s) {
      Bezier b = contour.segment(s);
      for (Point& point : b.p) point = to_page(point);
      if (s == 0) cairo_move_to(context, b.start().x(), b.start().y());
      add_curve(context, b);
    }
    cairo_close_path(context);
  }
}

void fill(cairo_t* context, const std::vector<BezierContour>& contours, const fontcore::Affine& to_page,
          const Colour& colour) {
  set_colour(context, colour);
  add_path(context, contours, to_page);
  cairo_fill(context);
}

Canvas::Canvas(ProofFormat format, double width, double height) : format_(format) {
  if (format == ProofFormat::Png)
    surface_.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width), static_cast<int>(height)));
  else if (format == ProofFormat::Pdf)
    surface_.reset(cairo_pdf_surface_create_for_stream(append, &bytes_, width, height));
  else
    surface_.reset(cairo_svg_surface_create_for_stream(append, &bytes_, width, height));
  if (format == ProofFormat::Pdf) cairo_pdf_surface_set_metadata(surface(), CAIRO_PDF_METADATA_CREATE_DATE, "");
  context_ = start_drawing(surface());
  set_colour(context(), {1.0, 1.0, 1.0});
  cairo_paint(context());
}

Bytes Canvas::finish() {
  check_drawing(cairo_status(context()));
  if (format_ == ProofFormat::Png) check_drawing(cairo_surface_write_to_png_stream(surface(), append, &bytes_));
  cairo_surface_finish(surface());
  check_drawing(cairo_surface_status(surface()));
  if (format_ == ProofFormat::Svg) forget_surface_number(bytes_);
  return std::move(bytes_);
}

}  // namespace glyphs
