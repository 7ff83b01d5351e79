#pragma once

// Private to the UFO reader, writer and builder: the file of one glyph.

#include <optional>
#include <string>
#include <vector>

#include "glyphs/font.h"

namespace glyphs {

/// A stretch of a file.
struct Span {
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// What a point of a file is; of a node, how the segment that ends there is called.
enum class PointType { OffCurve, Move, Line, Curve, QCurve };

struct GlifPoint {
  fontcore::Point position{0, 0};
  PointType type = PointType::OffCurve;
  bool is_named = false;  ///< it has a name or an identifier
  std::string identifier;
  Span element;
  Span x;  ///< the values, between their quotes
  Span y;
  Span type_name;
};

struct GlifContour {
  std::vector<GlifPoint> points;
  std::string identifier;
  std::optional<fontcore::BezierContour> outline;  ///< none if it is open, or fewer than two points
  std::vector<int> stored;  ///< per point of the outline its index in `points`; -1 if it is implied
};

/// A component by the name of its base.
struct GlifComponent {
  std::string base;
  fontcore::Affine placement;
  bool is_named = false;  ///< it has an identifier
  Span element;
  std::optional<Span> x_offset;  ///< the values, between their quotes; none stands for 0
  std::optional<Span> y_offset;
};

/// An anchor, by its place.
struct GlifAnchor {
  fontcore::Point position{0, 0};
  Span x;
  Span y;
};

/// A glyph's file as far as it is understood, with the places of what may be changed.
struct Glif {
  double advance = 0.0;
  std::optional<Span> width;  ///< the value of the advance; none stands for 0
  std::vector<char32_t> unicodes;
  std::vector<GlifContour> contours;  ///< all, in the order of the file
  std::vector<GlifComponent> components;
  std::vector<ContourMarks> marks;  ///< one a contour with an outline; empty if nothing is marked
  std::vector<std::string> hints;   ///< keys of its lib that hold hints
  std::vector<GlifAnchor> anchors;  ///< those with a place
  std::string trouble;

  std::vector<const GlifContour*> outlines() const {
    std::vector<const GlifContour*> closed;
    for (const GlifContour& contour : contours) {
      if (contour.outline) closed.push_back(&contour);
    }
    return closed;
  }
};

/// Reads the file of the glyph of that name. What cannot be read is its `trouble`; what was read before stays.
Glif parse_glif(const Bytes& bytes, const std::string& name);

/// How the segment that ends at a node is called in a file: "line", "curve" or "qcurve".
const char* segment_type(const fontcore::BezierContour& contour, int node);
/// Whether a point of that type can end the segment.
bool is_compatible(PointType type, const fontcore::BezierContour& contour, int node);
/// The element of a point of a contour, marked as smooth if it is a node where the tangents agree to rounding.
std::string point_element(const fontcore::BezierContour& contour, int point);

}  // namespace glyphs
