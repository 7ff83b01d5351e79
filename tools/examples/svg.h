#pragma once

#include <iostream>
#include <string>

#include "fontcore/error.h"
#include "fontcore/measure.h"

/// Collects paths of points, y up, and prints them as one SVG picture with y down.
class Picture {
 public:
  /// Style is what SVG has for a path: `fill="none" stroke="black"`.
  void path(const fontcore::Points& points, const std::string& style, bool is_closed = false) {
    body_ += "<path d=\"";
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      box_.add(points.row(i).transpose());
      body_ += fontcore::text(i == 0 ? "M" : "L", points(i, 0), " ", -points(i, 1));
    }
    body_ += (is_closed ? "Z\" " : "\" ") + style + "/>\n";
  }
  void dots(const fontcore::Points& points, double radius, const std::string& style) {
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      box_.add(points.row(i).transpose());
      body_ += fontcore::text("<circle cx=\"", points(i, 0), "\" cy=\"", -points(i, 1), "\" r=\"", radius, "\" ", style,
                              "/>\n");
    }
  }
  void print() const {
    const fontcore::Point size = box_.high - box_.low;
    const double margin = 0.04 * size.maxCoeff();
    std::cout << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"900\" viewBox=\"" << box_.low.x() - margin << ' '
              << -box_.high.y() - margin << ' ' << size.x() + 2 * margin << ' ' << size.y() + 2 * margin << "\">\n"
              << body_ << "</svg>\n";
  }

 private:
  fontcore::Box box_;
  std::string body_;
};
