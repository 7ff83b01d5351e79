#include "glyphs/drawing.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>
#include <string_view>

#include "fontcore/error.h"
#include "glyphs/error.h"
#include "glyphs/font_file.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using fontcore::Affine;
using fontcore::Bezier;
using fontcore::Point;
using fontcore::Points;
using fontcore::text;
using std::numbers::pi;
using xml::Malformed;

constexpr std::size_t most_points = 10'000'000;

Eigen::Matrix2d rotation_by(double angle) {
  Eigen::Matrix2d rotation;
  rotation << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return rotation;
}

void check(const DrawingOptions& options) {
  for (const double length : {options.scale, options.step}) {
    if (!(length > 0.0) || !std::isfinite(length)) {
      throw RequestError(text("drawing: scale ", options.scale, " and step ", options.step, " must be positive"));
    }
  }
}

// Draws strokes with a transform: what all kinds of elements come down to.
class Pen {
 public:
  explicit Pen(const DrawingOptions& options) : step_(options.step) {}

  void set_transform(const Affine& transform) { transform_ = transform; }
  const Point& at() const { return at_; }

  void move_to(const Point& to) {
    lift(false);
    at_ = to;
    begin_ = to;
  }
  void line_to(const Point& to) {
    put_down();
    add(to);
    at_ = to;
  }
  void curve_to(Bezier curve) {
    put_down();
    double speed = 0.0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(curve.degree); ++k) {
      speed = std::max(speed, curve.degree * (transform_.linear * (curve.p[k + 1] - curve.p[k])).norm());
    }
    const auto chords = chords_of(speed);
    for (std::size_t i = 1; i < chords; ++i) {
      add(evaluate(curve, static_cast<double>(i) / static_cast<double>(chords)));
    }
    add(curve.end());
    at_ = curve.end();
  }
  // SVG 1.1, appendix F.6: elliptical arc implementation notes.
  void arc_to(Point radii, double rotation, bool is_large, bool is_sweep, const Point& to) {
    if (to == at_) return;
    radii = radii.cwiseAbs();
    if (radii.minCoeff() == 0.0) return line_to(to);
    put_down();
    const Eigen::Matrix2d turned = rotation_by(rotation);
    const Point half = turned.transpose() * (0.5 * (at_ - to));
    // On the unit circle that the ellipse comes from.
    Point chord = half.cwiseQuotient(radii);
    if (chord.squaredNorm() > 1.0) {
      radii *= chord.norm();
      chord.normalize();
    }
    const double reach = std::sqrt(std::max(0.0, 1.0 / chord.squaredNorm() - 1.0));
    const Point centre = (is_large == is_sweep ? -reach : reach) * Point(chord.y(), -chord.x());
    const Point from = chord - centre;
    const Point until = -chord - centre;
    const double start = std::atan2(from.y(), from.x());
    double sweep = std::atan2(until.y(), until.x()) - start;
    if (is_sweep && sweep < 0.0) sweep += 2.0 * pi;
    if (!is_sweep && sweep > 0.0) sweep -= 2.0 * pi;
    const Point middle = 0.5 * (at_ + to) + turned * centre.cwiseProduct(radii);
    const Eigen::Matrix2d on_circle = turned * radii.asDiagonal();
    const auto chords = chords_of(std::abs(sweep) * (transform_.linear * on_circle).norm());
    for (std::size_t i = 1; i < chords; ++i) {
      const double angle = start + sweep * static_cast<double>(i) / static_cast<double>(chords);
      add(middle + on_circle * Point(std::cos(angle), std::sin(angle)));
    }
    add(to);
    at_ = to;
  }
  void close() {
    lift(true);
    at_ = begin_;
  }
  // Ends what is being drawn.
  void lift() { lift(false); }

  std::vector<Stroke> strokes() && { return std::move(strokes_); }

 private:
  void put_down() {
    if (drawn_.empty()) add(at_);
  }
  std::size_t chords_of(double length) const {
    const double chords = std::ceil(length / step_);
    if (!(chords + static_cast<double>(total_) <= static_cast<double>(most_points))) {
      throw Malformed(text("draws more than ", most_points, " points: a smaller scale or a longer step is needed"));
    }
    return std::max<std::size_t>(1, static_cast<std::size_t>(chords));
  }
  void add(const Point& point) {
    const Point mapped = transform_(point);
    if (!(mapped.cwiseAbs().maxCoeff() <= max_coordinate)) {
      throw Malformed(text("the point ", mapped.x(), " ", mapped.y(), " is beyond ", max_coordinate));
    }
    if (!drawn_.empty() && drawn_.back() == mapped) return;
    if (++total_ > most_points) throw Malformed(text("draws more than ", most_points, " points"));
    drawn_.push_back(mapped);
  }
  void lift(bool is_closed) {
    if (is_closed && drawn_.size() > 1 && drawn_.back() == drawn_.front()) drawn_.pop_back();
    if (drawn_.size() > 1) {
      Stroke stroke{Points(static_cast<Eigen::Index>(drawn_.size()), 2), is_closed};
      for (std::size_t i = 0; i < drawn_.size(); ++i) stroke.points.row(static_cast<Eigen::Index>(i)) = drawn_[i];
      strokes_.push_back(std::move(stroke));
    }
    drawn_.clear();
  }

  double step_;
  Affine transform_;
  Point at_ = Point::Zero();
  Point begin_ = Point::Zero();  // of the subpath
  std::vector<Point> drawn_;
  std::size_t total_ = 0;
  std::vector<Stroke> strokes_;
};

// Reads numbers and letters as SVG has them: blanks and one comma between, or nothing where it is clear.
class Scanner {
 public:
  explicit Scanner(std::string_view input) : rest_(input) { skip_blanks(); }

  bool is_done() const { return rest_.empty(); }
  bool is_number_next() const {
    return !rest_.empty() && (is_digit(rest_[0]) || rest_[0] == '.' || rest_[0] == '-' || rest_[0] == '+');
  }
  char letter() {
    const char c = rest_.empty() ? '\0' : rest_[0];
    rest_.remove_prefix(rest_.empty() ? 0 : 1);
    skip_blanks();
    return c;
  }
  double number() {
    std::string_view digits = rest_;
    const bool is_signed = !digits.empty() && (digits[0] == '-' || digits[0] == '+');
    const bool is_negative = is_signed && digits[0] == '-';
    if (is_signed) digits.remove_prefix(1);
    double value = 0.0;
    // from_chars would take words and a second sign.
    if (digits.empty() || !(is_digit(digits[0]) || digits[0] == '.')) throw no_number();
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || !std::isfinite(value)) throw no_number();
    digits.remove_prefix(static_cast<std::size_t>(end - digits.data()));
    rest_ = digits;
    skip_separator();
    return is_negative ? -value : value;
  }
  bool flag() {
    if (rest_.empty() || (rest_[0] != '0' && rest_[0] != '1')) {
      throw Malformed(text("\"", xml::shown(rest_), "\" is no flag of an arc"));
    }
    const bool value = rest_[0] == '1';
    rest_.remove_prefix(1);
    skip_separator();
    return value;
  }
  // What stands before a character, which is taken too.
  std::string_view until(char c) {
    const std::size_t end = rest_.find(c);
    if (end == std::string_view::npos) throw Malformed(text("\"", xml::shown(rest_), "\" lacks a ", std::string(1, c)));
    const std::string_view before = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    skip_separator();
    return before;
  }
  std::string shown() const { return xml::shown(rest_); }

 private:
  static bool is_digit(char c) { return c >= '0' && c <= '9'; }
  static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\f'; }
  void skip_blanks() {
    while (!rest_.empty() && is_blank(rest_[0])) rest_.remove_prefix(1);
  }
  void skip_separator() {
    skip_blanks();
    if (!rest_.empty() && rest_[0] == ',') {
      rest_.remove_prefix(1);
      skip_blanks();
    }
  }
  Malformed no_number() const {
    return Malformed(rest_.empty() ? "a number is missing at the end" : text("\"", shown(), "\" is no number"));
  }

  std::string_view rest_;
};

// Path data: commands and their arguments, drawn as they come.
class PathReader {
 public:
  PathReader(std::string_view data, Pen& pen) : in_(data), pen_(pen) {}

  void draw() {
    char command = '\0';
    while (!in_.is_done()) {
      if (!in_.is_number_next()) {
        command = in_.letter();
      } else if (command == '\0' || command == 'Z' || command == 'z') {
        throw Malformed(text("path data has \"", in_.shown(), "\" where a command should be"));
      }
      if (is_first_ && command != 'M' && command != 'm') throw Malformed("path data does not begin with a move");
      is_first_ = false;
      draw(command);
      if (command == 'M') command = 'L';  // further pairs are lines
      if (command == 'm') command = 'l';
    }
    pen_.lift();
  }

 private:
  void draw(char command) {
    const bool is_relative = command >= 'a' && command <= 'z';
    const Point origin = is_relative ? pen_.at() : Point::Zero();
    const auto point = [&]() -> Point {
      const double x = in_.number();
      return origin + Point(x, in_.number());
    };
    const Point at = pen_.at();
    std::optional<Point> cubic;
    std::optional<Point> quadratic;
    switch (is_relative ? static_cast<char>(command - 'a' + 'A') : command) {
      case 'M':
        pen_.move_to(point());
        break;
      case 'L':
        pen_.line_to(point());
        break;
      case 'H':
        pen_.line_to({origin.x() + in_.number(), at.y()});
        break;
      case 'V':
        pen_.line_to({at.x(), origin.y() + in_.number()});
        break;
      case 'C': {
        const Point a = point();
        cubic = point();
        pen_.curve_to({{at, a, *cubic, point()}, 3});
        break;
      }
      case 'S': {
        const Point a = cubic_ ? Point(2.0 * at - *cubic_) : at;
        cubic = point();
        pen_.curve_to({{at, a, *cubic, point()}, 3});
        break;
      }
      case 'Q':
        quadratic = point();
        pen_.curve_to({{at, *quadratic, point(), Point::Zero()}, 2});
        break;
      case 'T':
        quadratic = quadratic_ ? Point(2.0 * at - *quadratic_) : at;
        pen_.curve_to({{at, *quadratic, point(), Point::Zero()}, 2});
        break;
      case 'A': {
        const double rx = in_.number();
        const double ry = in_.number();
        const double rotation = in_.number() * pi / 180.0;
        const bool is_large = in_.flag();
        const bool is_sweep = in_.flag();
        pen_.arc_to({rx, ry}, rotation, is_large, is_sweep, point());
        break;
      }
      case 'Z':
        pen_.close();
        break;
      default:
        throw Malformed(text("path data has \"", xml::shown(std::string(1, command)), "\", which is no command"));
    }
    cubic_ = cubic;  // only the last command's handle is reflected
    quadratic_ = quadratic;
  }

  Scanner in_;
  Pen& pen_;
  bool is_first_ = true;
  std::optional<Point> cubic_;
  std::optional<Point> quadratic_;
};

Affine after(const Affine& outer, const Affine& inner) { return {outer.linear * inner.linear, outer(inner.shift)}; }

Affine read_transform(std::string_view list) {
  Affine all;
  Scanner in(list);
  while (!in.is_done()) {
    std::string_view name = in.until('(');
    while (!name.empty() && (name.back() == ' ' || name.back() == '\t' || name.back() == '\n')) name.remove_suffix(1);
    Scanner arguments(in.until(')'));
    std::vector<double> a;
    while (!arguments.is_done()) a.push_back(arguments.number());
    const auto takes = [&](std::string_view what, std::initializer_list<std::size_t> counts) {
      if (name != what) return false;
      if (std::find(counts.begin(), counts.end(), a.size()) == counts.end()) {
        throw Malformed(text("transform ", what, " of ", a.size(), " numbers"));
      }
      return true;
    };
    Affine one;
    if (takes("matrix", {6})) {
      one.linear << a[0], a[2], a[1], a[3];
      one.shift = {a[4], a[5]};
    } else if (takes("translate", {1, 2})) {
      one.shift = {a[0], a.size() == 2 ? a[1] : 0.0};
    } else if (takes("scale", {1, 2})) {
      one.linear = Point(a[0], a.back()).asDiagonal();
    } else if (takes("rotate", {1, 3})) {
      one.linear = rotation_by(a[0] * pi / 180.0);
      const Point centre = a.size() == 3 ? Point(a[1], a[2]) : Point(0.0, 0.0);
      one.shift = centre - one.linear * centre;
    } else if (takes("skewX", {1})) {
      one.linear(0, 1) = std::tan(a[0] * pi / 180.0);
    } else if (takes("skewY", {1})) {
      one.linear(1, 0) = std::tan(a[0] * pi / 180.0);
    } else {
      throw Malformed(text("transform \"", xml::shown(name), "\" is not known"));
    }
    all = after(all, one);
  }
  return all;
}

class SvgReader {
 public:
  SvgReader(const Bytes& svg, const DrawingOptions& options) : bytes_(svg), document_(svg), pen_(options) {
    outer_.linear = Point(options.scale, -options.scale).asDiagonal();
  }

  std::vector<Stroke> read() {
    if (local_name(document_.root()) != "svg") throw Malformed("is no SVG document");
    draw(document_.root(), outer_);
    return std::move(pen_).strokes();
  }

 private:
  static std::string_view local_name(pugi::xml_node element) {
    const std::string_view name = element.name();
    return name.starts_with("svg:") ? name.substr(4) : name;
  }

  void draw(pugi::xml_node element, const Affine& outer) {
    const std::string_view name = local_name(element);
    for (const char* hidden : {"defs", "symbol", "marker", "pattern", "mask", "clipPath"}) {
      if (name == hidden) return;
    }
    const Affine transform =
        at_line(element, [&] { return after(outer, read_transform(xml::attribute(element, "transform"))); });
    pen_.set_transform(transform);
    at_line(element, [&] { draw_shape(element, name); });
    for (const pugi::xml_node child : element.children()) {
      if (child.type() == pugi::node_element) draw(child, transform);
    }
  }

  void draw_shape(pugi::xml_node element, std::string_view name) {
    if (name == "use") throw Malformed("copies are not followed: draw what is to be read where it stands");
    const auto length = [&](const char* attribute) {
      const pugi::xml_attribute found = element.attribute(attribute);
      return found ? xml::number(xml::decode(found.value()), attribute) : 0.0;
    };
    if (name == "path") {
      PathReader(xml::attribute(element, "d"), pen_).draw();
    } else if (name == "line") {
      pen_.move_to({length("x1"), length("y1")});
      pen_.line_to({length("x2"), length("y2")});
      pen_.lift();
    } else if (name == "polyline" || name == "polygon") {
      draw_polyline(xml::attribute(element, "points"), name == "polygon");
    } else if (name == "circle") {
      draw_ellipse({length("cx"), length("cy")}, {length("r"), length("r")});
    } else if (name == "ellipse") {
      draw_ellipse({length("cx"), length("cy")}, {length("rx"), length("ry")});
    } else if (name == "rect") {
      const double rx = length(element.attribute("rx") ? "rx" : "ry");
      const double ry = length(element.attribute("ry") ? "ry" : "rx");
      draw_rectangle({length("x"), length("y")}, {length("width"), length("height")}, {rx, ry});
    }
  }

  void draw_polyline(const std::string& points, bool is_closed) {
    Scanner in(points);
    for (bool is_first = true; !in.is_done(); is_first = false) {
      const double x = in.number();
      const Point to(x, in.number());
      is_first ? pen_.move_to(to) : pen_.line_to(to);
    }
    is_closed ? pen_.close() : pen_.lift();
  }

  // In SVG's direction, from its rightmost point.
  void draw_ellipse(const Point& centre, const Point& radii) {
    if (radii.minCoeff() <= 0.0) return;
    const Point right(radii.x(), 0.0);
    pen_.move_to(centre + right);
    pen_.arc_to(radii, 0.0, false, true, centre - right);
    pen_.arc_to(radii, 0.0, false, true, centre + right);
    pen_.close();
  }

  void draw_rectangle(const Point& low, const Point& size, Point radii) {
    if (size.minCoeff() <= 0.0) return;
    radii = radii.cwiseMax(0.0).cwiseMin(0.5 * size);
    const Point x(radii.x(), 0.0);
    const Point y(0.0, radii.y());
    const std::array<Point, 4> corner{low, low + Point(size.x(), 0.0), low + size, low + Point(0.0, size.y())};
    pen_.move_to(corner[0] + x);
    pen_.line_to(corner[1] - x);
    pen_.arc_to(radii, 0.0, false, true, corner[1] + y);
    pen_.line_to(corner[2] - y);
    pen_.arc_to(radii, 0.0, false, true, corner[2] - x);
    pen_.line_to(corner[3] + x);
    pen_.arc_to(radii, 0.0, false, true, corner[3] - y);
    pen_.line_to(corner[0] + y);
    pen_.arc_to(radii, 0.0, false, true, corner[0] + x);
    pen_.close();
  }

  // What goes wrong within an element is said with its line and its name.
  template <typename Work>
  auto at_line(pugi::xml_node element, Work work) -> decltype(work()) {
    try {
      return work();
    } catch (const Malformed& error) {
      const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(document_.offset(element.name()));
      const auto line = std::count(bytes_.begin(), end, static_cast<unsigned char>('\n')) + 1;
      throw Malformed(text("line ", line, ": <", xml::shown(element.name()), ">: ", error.what()));
    }
  }

  const Bytes& bytes_;
  xml::Document document_;
  Pen pen_;
  Affine outer_;
};

bool is_svg(const Bytes& bytes) {
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  std::size_t at = 0;
  if (bytes.size() >= 3 && std::memcmp(bytes.data(), byte_order_mark.data(), 3) == 0) at = 3;
  while (at < bytes.size() && std::strchr(" \t\r\n", bytes[at]) != nullptr && bytes[at] != '\0') ++at;
  return at < bytes.size() && bytes[at] == '<';
}

}  // namespace

std::vector<Stroke> read_svg(const Bytes& svg, const DrawingOptions& options) {
  check(options);
  try {
    return SvgReader(svg, options).read();
  } catch (const Malformed& error) {
    throw RequestError(error.what());
  }
}

std::vector<Stroke> read_polylines(const Bytes& bytes, const DrawingOptions& options) {
  check(options);
  const std::string all(bytes.begin(), bytes.end());
  Pen pen(options);
  pen.set_transform({Point(options.scale, options.scale).asDiagonal(), Point::Zero()});
  std::size_t line_number = 0;
  std::vector<Point> run;
  const auto end_stroke = [&] {
    for (std::size_t i = 0; i < run.size(); ++i) i == 0 ? pen.move_to(run[i]) : pen.line_to(run[i]);
    run.size() > 1 && run.front() == run.back() ? pen.close() : pen.lift();
    run.clear();
  };
  try {
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t end = std::min(all.find('\n', at), all.size());
      const std::string_view line(all.data() + at, end - at);
      at = end + 1;
      ++line_number;
      Scanner in(line.substr(0, line.find('#')));
      if (in.is_done()) {
        if (line.find('#') == std::string_view::npos) end_stroke();
        continue;
      }
      const double x = in.number();
      const Point point(x, in.number());
      if (!in.is_done()) throw Malformed(text("\"", in.shown(), "\" follows a point"));
      run.push_back(point);
    }
    end_stroke();
  } catch (const Malformed& error) {
    throw RequestError(text("line ", line_number, ": ", error.what()));
  }
  return std::move(pen).strokes();
}

std::vector<Stroke> load_drawing(const std::string& path, const DrawingOptions& options) {
  try {
    const Bytes bytes = read_file(path);
    std::vector<Stroke> strokes = is_svg(bytes) ? read_svg(bytes, options) : read_polylines(bytes, options);
    if (strokes.empty()) throw RequestError("no stroke is drawn in it");
    return strokes;
  } catch (const FontReadError& error) {  // names the file
    throw RequestError(error.what());
  } catch (const RequestError& error) {
    throw RequestError(text(path, ": ", error.what()));
  }
}

}  // namespace glyphs
