#pragma once

#include <iostream>
#include <string>

#include "fontcore/error.h"
#include "fontcore/measure.h"
#include "fontcore/wavelet.h"

/// Collects curves, y up, panel by panel, and prints them as one SVG picture with y down.
class Picture {
 public:
  /// What follows is drawn in a panel of its own, so far to the right.
  void next_panel(double width) { left_ += width; }

  /// Style is what SVG has for a path: `fill="none" stroke="black"`.
  void path(const fontcore::Points& points, const std::string& style, bool is_closed = false) {
    body_ += "<path d=\"";
    for (Eigen::Index i = 0; i < points.rows(); ++i) body_ += (i == 0 ? "M" : "L") + place(points.row(i));
    body_ += (is_closed ? "Z\" " : "\" ") + style + "/>\n";
  }
  /// A closed outline of segments that follow each other, moved.
  void path(const std::vector<fontcore::Bezier>& segments, const fontcore::Point& by, const std::string& style) {
    for (const fontcore::Bezier& segment : segments) {
      body_ +=
          &segment == &segments.front() ? "<path d=\"M" + place((segment.start() + by).transpose()) : std::string();
      body_ += segment.degree == 1 ? "L" : segment.degree == 2 ? "Q" : "C";
      for (int k = 1; k <= segment.degree; ++k)
        body_ += place((segment.p[static_cast<std::size_t>(k)] + by).transpose()) + " ";
    }
    body_ += "Z\" " + style + "/>\n";
  }
  void dots(const fontcore::Points& points, double radius, const std::string& style) {
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      body_ += "<path d=\"M" + place(points.row(i)) + "h0\" stroke-linecap=\"round\" " +
               fontcore::text("stroke-width=\"", 2.0 * radius, "\" ") + style + "/>\n";
    }
  }
  /// A closed quadratic spline by its control points, and their polygon.
  void spline(const fontcore::Points& points, const std::string& colour) {
    const auto middle = [&](Eigen::Index i) {
      return place(0.5 * (points.row(i) + points.row((i + 1) % points.rows())));
    };
    body_ += "<path fill=\"none\" stroke-width=\"5\" stroke=\"" + colour + "\" d=\"M" + middle(points.rows() - 1);
    for (Eigen::Index i = 0; i < points.rows(); ++i) body_ += "Q" + place(points.row(i)) + " " + middle(i);
    body_ += "Z\"/>\n";
  }
  void polygon(const fontcore::Points& points, const std::string& colour) {
    path(points, "fill=\"none\" stroke-width=\"1\" stroke=\"" + colour + "\"", true);
  }

  void print() const {
    const fontcore::Point size = box_.high - box_.low;
    const double margin = 0.04 * size.maxCoeff();
    std::cout << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"900\" viewBox=\"" << box_.low.x() - margin << ' '
              << -box_.high.y() - margin << ' ' << size.x() + 2 * margin << ' ' << size.y() + 2 * margin << "\">\n"
              << body_ << "</svg>\n";
  }

 private:
  std::string place(const Eigen::RowVector2d& point) {
    box_.add(fontcore::Point(point.x() + left_, point.y()));
    return fontcore::text(point.x() + left_, " ", -point.y());
  }

  double left_ = 0.0;
  fontcore::Box box_;
  std::string body_;
};
