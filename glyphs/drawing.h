#pragma once

#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "glyphs/font.h"

namespace glyphs {

/// A line that somebody drew, as a polyline in font units, y up.
struct Stroke {
  fontcore::Points points;  ///< n×2, n >= 2, no two neighbours equal; a closed one's first point stands once
  bool is_closed = false;
};

struct DrawingOptions {
  double scale = 1.0;  ///< font units that a unit of the drawing is long
  double step = 0.5;   ///< longest chord that a curve is drawn by, font units
};

/// The strokes of an SVG document in its order, as they look on a screen: y is turned up.
///
/// Every subpath of a `path` (all commands of SVG 1.1, relative and absolute, repeated, compactly written), and `line`,
/// `polyline`, `polygon`, `rect`, `circle` and `ellipse`, through the transforms of their groups. What is not drawn
/// where it stands (`defs`, `symbol`, `marker`, `pattern`, `mask`, `clipPath`), text and pictures are passed over.
/// Style, `viewBox` and units of the document mean nothing here.
///
/// Exact   points on the curve; chords of arcs and Beziers of at most `step`.
/// Throws  RequestError, one line naming the line of the document and what is wrong: not well-formed, a document type
///         with declarations, a command or a number that is none, `use`, coordinates over `max_coordinate`, more than
///         ten million points, a scale or a step that is not positive.
std::vector<Stroke> read_svg(const Bytes& svg, const DrawingOptions& options = {});

/// The strokes of a text of points: "x y" or "x,y" a line, y up already, an empty line between strokes, # before what
/// is a remark. One that ends where it began is closed.
///
/// Throws  RequestError, naming the line.
std::vector<Stroke> read_polylines(const Bytes& text, const DrawingOptions& options = {});

/// Either of them, as the file begins: SVG with a <.
/// Throws  RequestError naming the file too; also if it cannot be read or holds no stroke.
std::vector<Stroke> load_drawing(const std::string& path, const DrawingOptions& options = {});

}  // namespace glyphs
