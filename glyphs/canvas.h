#pragma once

// Private to the proofs: what they draw on, by cairo.

#include <cairo.h>

#include <memory>
#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "glyphs/font.h"
#include "glyphs/proof.h"

namespace glyphs {

struct Colour {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
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

/// Curves flattened so finely, and edges so smooth, that 8-bit coverage shows no difference.
ContextHandle start_drawing(cairo_surface_t* surface);
/// Throws  FontWriteError if something went wrong.
void check_drawing(cairo_status_t status);

void set_colour(cairo_t* context, const Colour& colour);
/// From its start, where the path is.
void add_curve(cairo_t* context, const fontcore::Bezier& b);
/// Outlines mapped from font units to the page.
void add_path(cairo_t* context, const std::vector<fontcore::BezierContour>& contours, const fontcore::Affine& to_page);
void fill(cairo_t* context, const std::vector<fontcore::BezierContour>& contours, const fontcore::Affine& to_page,
          const Colour& colour);

/// A white page that is drawn on, kept in memory. A PDF says no date of its own.
class Canvas {
 public:
  /// Of a PNG whole pixels, what is over cut off.
  Canvas(ProofFormat format, double width, double height);
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  ProofFormat format() const { return format_; }
  cairo_surface_t* surface() const { return surface_.get(); }
  cairo_t* context() const { return context_.get(); }
  /// The file; nothing can be drawn any more. Same drawing, same bytes.
  /// Throws  FontWriteError if something went wrong.
  Bytes finish();

 private:
  ProofFormat format_;
  Bytes bytes_;  // before the surface, which writes to it until it is destroyed
  SurfaceHandle surface_;
  ContextHandle context_;
};

}  // namespace glyphs
