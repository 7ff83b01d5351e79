#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "glyphs/sfnt_cff.h"

namespace glyphs::sfnt {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::Points;
using fontcore::text;

constexpr double one = 65536.0;  // 16.16
constexpr int most_operands = 48;
constexpr int most_calls = 10;  // subroutines within each other
constexpr int storage_size = 32;
constexpr std::size_t usual_contours = 24;
constexpr double coordinate_end = 32768.0;  // 16.16 numbers lie below

enum Operator : int {
  hstem = 1,
  vstem = 3,
  vmoveto = 4,
  rlineto = 5,
  hlineto = 6,
  vlineto = 7,
  rrcurveto = 8,
  callsubr = 10,
  return_op = 11,
  escape = 12,
  endchar = 14,
  hstemhm = 18,
  hintmask = 19,
  cntrmask = 20,
  rmoveto = 21,
  hmoveto = 22,
  vstemhm = 23,
  rcurveline = 24,
  rlinecurve = 25,
  vvcurveto = 26,
  hhcurveto = 27,
  callgsubr = 29,
  vhcurveto = 30,
  hvcurveto = 31,
  dotsection = 0x0C00,
  and_op = 0x0C03,
  or_op = 0x0C04,
  not_op = 0x0C05,
  abs_op = 0x0C09,
  add_op = 0x0C0A,
  sub_op = 0x0C0B,
  div_op = 0x0C0C,
  neg_op = 0x0C0E,
  eq_op = 0x0C0F,
  drop_op = 0x0C12,
  put_op = 0x0C14,
  get_op = 0x0C15,
  ifelse_op = 0x0C16,
  random_op = 0x0C17,
  mul_op = 0x0C18,
  sqrt_op = 0x0C1A,
  dup_op = 0x0C1B,
  exch_op = 0x0C1C,
  index_op = 0x0C1D,
  roll_op = 0x0C1E,
  hflex = 0x0C22,
  flex = 0x0C23,
  hflex1 = 0x0C24,
  flex1 = 0x0C25,
};

std::string name_of(int op) { return op > 255 ? text("12 ", op & 0xFF) : text(op); }

// ---- reading

class Interpreter {
 public:
  Interpreter(const CffIndex& global, const CffIndex& local, Charstring& result)
      : global_(global), local_(local), result_(result) {
    contours_.reserve(usual_contours);
  }

  void run(View code) {
    enter(code);
    while (depth_ > 0) {
      Frame& frame = frames_[static_cast<std::size_t>(depth_ - 1)];
      if (frame.at == frame.end) {  // no return, or no endchar
        --depth_;
        continue;
      }
      if (++result_.work > most_charstring_work) throw Malformed(text("takes over ", most_charstring_work, " steps"));
      const int b = *frame.at++;
      if (b >= 32 || b == 28) {
        push(read_number(b, frame));
      } else {
        const int op = b == escape ? 0x0C00 | byte(frame) : b;
        if (op == endchar) {
          finish();
          return;
        }
        operate(op, frame);
      }
    }
    finish();
  }

 private:
  struct Frame {
    const unsigned char* at = nullptr;
    const unsigned char* end = nullptr;
  };

  void enter(View code) {
    if (depth_ > most_calls) throw Malformed(text("subroutines nest deeper than ", most_calls));
    frames_[static_cast<std::size_t>(depth_++)] = {code.data(), code.data() + code.size()};
  }

  static int byte(Frame& frame) {
    if (frame.at == frame.end) throw Malformed("ends within a number or an operator");
    return *frame.at++;
  }

  static double read_number(int first, Frame& frame) {
    if (first == 28) {
      const int high = byte(frame);
      return static_cast<std::int16_t>(high << 8 | byte(frame));
    }
    if (first <= 246) return first - 139;
    if (first <= 250) return (first - 247) * 256 + byte(frame) + 108;
    if (first <= 254) return -(first - 251) * 256 - byte(frame) - 108;
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint32_t>(byte(frame));
    return static_cast<std::int32_t>(value) / one;
  }

  // ---- operands

  void push(double value) {
    if (count_ == most_operands) throw Malformed(text("more than ", most_operands, " operands"));
    stack_[static_cast<std::size_t>(count_++)] = value;
  }
  double pop() {
    if (count_ == 0) throw Malformed("takes operands that are not there");
    return stack_[static_cast<std::size_t>(--count_)];
  }
  double operand(int i) const {
    if (i < 0 || i >= count_) throw Malformed("takes operands that are not there");
    return stack_[static_cast<std::size_t>(i)];
  }
  int pop_whole() {
    const double value = pop();
    if (value != std::trunc(value)) throw Malformed(text(value, " where a whole number is needed"));
    return static_cast<int>(value);
  }
  void push_rounded(double value) {
    if (!(std::abs(value) <= coordinate_end)) throw Malformed(text("computes ", value, ", outside 16 bits"));
    push(std::round(value * one) / one);
  }
  /// The first operator that clears the stack may find the width below its operands.
  void take_width(bool is_there) {
    if (has_passed_width_) return;
    has_passed_width_ = true;
    if (!is_there || count_ == 0) return;
    result_.width = stack_[0];
    std::copy(stack_.begin() + 1, stack_.begin() + count_, stack_.begin());
    --count_;
  }

  // ---- drawing

  void add(PointKind kind) {
    if (!(std::abs(x_) < coordinate_end && std::abs(y_) < coordinate_end)) {
      throw Malformed(text("coordinate (", x_, ", ", y_, ") outside 16 bits"));
    }
    if (++point_count_ > max_composed_points) throw Malformed(text("more than ", max_composed_points, " points"));
    list_.push_back(x_);
    list_.push_back(y_);
    kinds_.push_back(kind);
    result_.has_fractions = result_.has_fractions || x_ != std::trunc(x_) || y_ != std::trunc(y_);
  }
  void step(PointKind kind, double dx, double dy) {
    x_ += dx;
    y_ += dy;
    add(kind);
  }
  /// A contour begins with what is drawn first: a point that nothing follows is none.
  void begin() {
    if (kinds_.empty()) add(PointKind::Node);
  }
  void move(double dx, double dy) {
    close();
    x_ += dx;
    y_ += dy;
  }
  void line(double dx, double dy) {
    begin();
    step(PointKind::Node, dx, dy);
  }
  void curve(double dx1, double dy1, double dx2, double dy2, double dx3, double dy3) {
    begin();
    step(PointKind::Cubic, dx1, dy1);
    step(PointKind::Cubic, dx2, dy2);
    step(PointKind::Node, dx3, dy3);
  }
  /// A contour ends where it began: the start point is not listed twice.
  void close() {
    std::size_t n = kinds_.size();
    bool is_closed_by_line = false;
    if (n > 1 && list_[0] == list_[2 * n - 2] && list_[1] == list_[2 * n - 1]) {
      --n;
      is_closed_by_line = kinds_[n - 1] == PointKind::Node;
    }
    if (n > 1) {
      Points points(static_cast<Eigen::Index>(n), 2);
      for (std::size_t i = 0; i < n; ++i) {
        points(static_cast<Eigen::Index>(i), 0) = list_[2 * i];
        points(static_cast<Eigen::Index>(i), 1) = list_[2 * i + 1];
      }
      kinds_.resize(n);
      contours_.emplace_back(std::move(points), kinds_);
      result_.is_closed_by_line.push_back(is_closed_by_line);
    }
    list_.clear();
    kinds_.clear();
  }

  void finish() {
    take_width(count_ % 2 == 1);
    if (count_ >= 4) {
      const auto code = [&](int i) {
        const double value = operand(i);
        if (value != std::trunc(value) || value < 0 || value > 255) {
          throw Malformed(text("accented letter: ", value, " is no character code"));
        }
        return static_cast<int>(value);
      };
      if (!contours_.empty() || !kinds_.empty()) throw Malformed("draws, and is an accented letter too");
      result_.accent = CffAccent{{operand(0), operand(1)}, code(2), code(3)};
    }
    close();
    result_.contours.assign(std::make_move_iterator(contours_.begin()), std::make_move_iterator(contours_.end()));
  }

  void hint() {
    take_width(count_ % 2 == 1);
    stems_ += count_ / 2;
    result_.has_hints = true;
    count_ = 0;
  }

  void operate(int op, Frame& frame) {
    if (op > 255) {
      if (compute(op)) return;
    } else if (op == callsubr || op == callgsubr) {
      return call(op == callsubr ? local_ : global_);
    } else if (op == return_op) {
      if (depth_ < 2) throw Malformed("returns from no subroutine");
      --depth_;
      return;
    }
    switch (op) {
      case hstem:
      case vstem:
      case hstemhm:
      case vstemhm:
        hint();
        break;
      case hintmask:
      case cntrmask: {
        hint();  // operands left over are vertical stems
        const int bytes = (stems_ + 7) / 8;
        if (frame.end - frame.at < bytes) throw Malformed("ends within a mask");
        frame.at += bytes;
        break;
      }
      case rmoveto:
        take_width(count_ > 2);
        move(operand(count_ - 2), operand(count_ - 1));
        break;
      case hmoveto:
        take_width(count_ > 1);
        move(operand(count_ - 1), 0.0);
        break;
      case vmoveto:
        take_width(count_ > 1);
        move(0.0, operand(count_ - 1));
        break;
      default:
        draw(op);
        break;
    }
    count_ = 0;
  }

  void draw(int op) {
    const auto v = [&](int i) { return operand(i); };
    int i = 0;
    switch (op) {
      case rlineto:
        for (; i < count_; i += 2) line(v(i), v(i + 1));
        break;
      case hlineto:
      case vlineto:
        for (bool is_flat = op == hlineto; i < count_; ++i, is_flat = !is_flat) {
          is_flat ? line(v(i), 0.0) : line(0.0, v(i));
        }
        break;
      case rrcurveto:
      case rcurveline:
        for (; i + 6 <= count_; i += 6) curve(v(i), v(i + 1), v(i + 2), v(i + 3), v(i + 4), v(i + 5));
        if (op == rcurveline) line(v(i), v(i + 1));
        break;
      case rlinecurve:
        for (; i + 6 < count_; i += 2) line(v(i), v(i + 1));
        curve(v(i), v(i + 1), v(i + 2), v(i + 3), v(i + 4), v(i + 5));
        break;
      case hhcurveto:
      case vvcurveto: {
        i = count_ - (count_ & ~2);  // of another number than 4n or 4n + 1 the first are surplus
        double across = (count_ - i) % 2 == 1 ? v(i++) : 0.0;
        for (; i < count_; i += 4, across = 0.0) {
          op == hhcurveto ? curve(v(i), across, v(i + 1), v(i + 2), v(i + 3), 0.0)
                          : curve(across, v(i), v(i + 1), v(i + 2), 0.0, v(i + 3));
        }
        break;
      }
      case hvcurveto:
      case vhcurveto: {
        i = count_ - (count_ & ~2);
        for (bool starts_flat = op == hvcurveto; i + 1 < count_; i += 4, starts_flat = !starts_flat) {
          const double across = count_ - i == 5 ? v(i + 4) : 0.0;
          starts_flat ? curve(v(i), 0.0, v(i + 1), v(i + 2), across, v(i + 3))
                      : curve(0.0, v(i), v(i + 1), v(i + 2), v(i + 3), across);
        }
        break;
      }
      case hflex:
        curve(v(0), 0.0, v(1), v(2), v(3), 0.0);
        curve(v(4), 0.0, v(5), -v(2), v(6), 0.0);
        break;
      case flex:
        curve(v(0), v(1), v(2), v(3), v(4), v(5));
        curve(v(6), v(7), v(8), v(9), v(10), v(11));
        break;
      case hflex1:
        curve(v(0), v(1), v(2), v(3), v(4), 0.0);
        curve(v(5), 0.0, v(6), v(7), v(8), -(v(1) + v(3) + v(7)));
        break;
      case flex1: {
        const double dx = v(0) + v(2) + v(4) + v(6) + v(8);
        const double dy = v(1) + v(3) + v(5) + v(7) + v(9);
        const bool is_flat = std::abs(dx) > std::abs(dy);
        curve(v(0), v(1), v(2), v(3), v(4), v(5));
        curve(v(6), v(7), v(8), v(9), is_flat ? v(10) : -dx, is_flat ? -dy : v(10));
        break;
      }
      case dotsection:
        break;
      default:
        throw Malformed(text("there is no operator ", name_of(op)));
    }
  }

  /// Operators that leave their result on the stack; false for those that clear it.
  bool compute(int op) {
    switch (op) {
      case and_op:
      case or_op: {
        const bool b = pop() != 0.0;
        const bool a = pop() != 0.0;
        push((op == and_op ? a && b : a || b) ? 1.0 : 0.0);
        return true;
      }
      case not_op:
        push(pop() == 0.0 ? 1.0 : 0.0);
        return true;
      case eq_op:
        push(pop() == pop() ? 1.0 : 0.0);
        return true;
      case abs_op:
        push(std::abs(pop()));
        return true;
      case neg_op:
        push(-pop());
        return true;
      case add_op: {
        const double b = pop();
        push_rounded(pop() + b);
        return true;
      }
      case sub_op: {
        const double b = pop();
        push_rounded(pop() - b);
        return true;
      }
      case mul_op: {
        const double b = pop();
        push_rounded(pop() * b);
        return true;
      }
      case div_op: {
        const double b = pop();
        if (b == 0.0) throw Malformed("divides by zero");
        push_rounded(pop() / b);
        return true;
      }
      case sqrt_op: {
        const double a = pop();
        if (a < 0.0) throw Malformed("takes the root of a negative number");
        push_rounded(std::sqrt(a));
        return true;
      }
      case random_op:
        push(0.5);  // any number above 0 and up to 1: the same one every time
        return true;
      case drop_op:
        pop();
        return true;
      case put_op: {
        const int at = pop_whole();
        stored(at) = pop();
        return true;
      }
      case get_op:
        push(stored(pop_whole()));
        return true;
      case ifelse_op: {
        const double v2 = pop();
        const double v1 = pop();
        const double s2 = pop();
        const double s1 = pop();
        push(v1 <= v2 ? s1 : s2);
        return true;
      }
      case dup_op: {
        const double a = pop();
        push(a);
        push(a);
        return true;
      }
      case exch_op: {
        const double b = pop();
        const double a = pop();
        push(b);
        push(a);
        return true;
      }
      case index_op: {
        const int i = std::max(pop_whole(), 0);
        push(operand(count_ - 1 - i));
        return true;
      }
      case roll_op: {
        const int by = pop_whole();
        const int n = pop_whole();
        if (n < 0 || n > count_) throw Malformed("takes operands that are not there");
        if (n == 0) return true;
        const auto end = stack_.begin() + count_;
        std::rotate(end - n, end - ((by % n + n) % n), end);
        return true;
      }
      default:
        return false;
    }
  }

  double& stored(int at) {
    if (at < 0 || at >= storage_size) throw Malformed(text("there is no storage ", at));
    return storage_[static_cast<std::size_t>(at)];
  }

  void call(const CffIndex& subroutines) {
    const int bias = subroutines.count < 1240 ? 107 : subroutines.count < 33900 ? 1131 : 32768;
    const int number = pop_whole() + bias;
    if (number < 0 || number >= subroutines.count) {
      throw Malformed(text("calls subroutine ", number, " of ", subroutines.count));
    }
    enter(subroutines.object(number));
  }

  const CffIndex& global_;
  const CffIndex& local_;
  Charstring& result_;
  std::array<Frame, most_calls + 1> frames_;
  int depth_ = 0;
  std::array<double, most_operands> stack_{};
  int count_ = 0;
  std::array<double, storage_size> storage_{};
  bool has_passed_width_ = false;
  int stems_ = 0;
  int point_count_ = 0;
  double x_ = 0.0;
  double y_ = 0.0;
  std::vector<BezierContour> contours_;  // so far; a list that grows among them leaves a hole in memory for every glyph
  std::vector<double> list_;             // x, y of the contour so far
  std::vector<PointKind> kinds_;
};

// ---- writing

using Steps = std::vector<std::int64_t>;  // 1/65536 units

constexpr std::int64_t unit = 65536;

std::size_t number_size(std::int64_t value) {
  if (value % unit != 0) return 5;
  const std::int64_t whole = value / unit;
  return std::abs(whole) <= 107 ? 1 : std::abs(whole) <= 1131 ? 2 : 3;
}

void append_number(Bytes& bytes, std::int64_t value) {
  const auto put = [&](std::int64_t byte) { bytes.push_back(static_cast<unsigned char>(byte & 0xFF)); };
  const std::int64_t whole = value / unit;
  switch (number_size(value)) {
    case 1:
      put(whole + 139);
      return;
    case 2:
      put(whole > 0 ? 247 + ((whole - 108) >> 8) : 251 + ((-whole - 108) >> 8));
      put(whole > 0 ? whole - 108 : -whole - 108);
      return;
    case 3:
      put(28);
      put(whole >> 8);
      put(whole);
      return;
    default:
      put(255);
      for (int shift = 24; shift >= 0; shift -= 8) put(value >> shift);
  }
}

/// A line (dx, dy) or a curve of three such steps.
struct Segment {
  bool is_curve = false;
  std::array<std::int64_t, 6> d{};
};

/// One way to draw segments from a place on: an operator and its operands.
struct Run {
  int op = 0;
  std::size_t segments = 0;
  std::size_t bytes = 0;
};

/// The segments of a contour as the fewest bytes of operators, by going backwards over all ways to begin.
class RunFinder {
 public:
  explicit RunFinder(const std::vector<Segment>& segments) : segments_(segments), best_(segments.size() + 1) {}

  void append_to(Bytes& bytes) {
    const std::size_t n = segments_.size();
    rest_.assign(n + 1, 0);
    for (std::size_t at = n; at-- > 0;) {
      at_ = at;
      rest_[at] = std::numeric_limits<std::size_t>::max();
      segments_[at].is_curve ? try_curves() : try_lines();
    }
    for (std::size_t at = 0; at < n; at += best_[at].segments) append_run(bytes, at);
  }

 private:
  const Segment& segment(std::size_t i) const { return segments_[i]; }
  std::size_t size(std::size_t i, std::size_t k) const { return number_size(segments_[i].d[k]); }

  void offer(int op, std::size_t end, std::size_t operand_bytes) {
    const std::size_t bytes = 1 + operand_bytes + rest_[end];
    if (bytes >= rest_[at_]) return;
    rest_[at_] = bytes;
    best_[at_] = {op, end - at_, bytes};
  }

  void try_lines() {
    const std::size_t n = segments_.size();
    std::size_t bytes = 0;
    std::size_t i = at_;
    for (; i < n && !segment(i).is_curve && 2 * (i - at_ + 1) <= most_operands; ++i) {
      bytes += size(i, 0) + size(i, 1);
      offer(rlineto, i + 1, bytes);
      const bool has_room = 2 * (i - at_ + 1) + 6 <= most_operands;
      if (i + 1 < n && segment(i + 1).is_curve && has_room) offer(rlinecurve, i + 2, bytes + curve_size(i + 1));
    }
    for (const bool starts_flat : {true, false}) {
      bytes = 0;
      bool is_flat = starts_flat;
      for (i = at_; i < n && !segment(i).is_curve && i - at_ < most_operands; ++i, is_flat = !is_flat) {
        if (segment(i).d[is_flat ? 1 : 0] != 0) break;
        bytes += size(i, is_flat ? 0 : 1);
        offer(starts_flat ? hlineto : vlineto, i + 1, bytes);
      }
    }
  }

  std::size_t curve_size(std::size_t i) const {
    std::size_t bytes = 0;
    for (std::size_t k = 0; k < 6; ++k) bytes += size(i, k);
    return bytes;
  }

  void try_curves() {
    const std::size_t n = segments_.size();
    std::size_t bytes = 0;
    for (std::size_t i = at_; i < n && segment(i).is_curve && 6 * (i - at_ + 1) <= most_operands; ++i) {
      bytes += curve_size(i);
      offer(rrcurveto, i + 1, bytes);
      const bool has_room = 6 * (i - at_ + 1) + 2 <= most_operands;
      if (i + 1 < n && !segment(i + 1).is_curve && has_room) {
        offer(rcurveline, i + 2, bytes + size(i + 1, 0) + size(i + 1, 1));
      }
    }
    // Both ends along one axis; the first curve may begin askew.
    for (const std::size_t along : {0u, 1u}) {
      const std::size_t across = 1 - along;
      bytes = segment(at_).d[across] != 0 ? size(at_, across) : 0;
      std::size_t operands = bytes > 0 ? 1 : 0;
      for (std::size_t i = at_; i < n && segment(i).is_curve; ++i) {
        const auto& d = segment(i).d;
        operands += 4;
        if (operands > most_operands || d[4 + across] != 0 || (i > at_ && d[across] != 0)) break;
        bytes += size(i, along) + size(i, 2) + size(i, 3) + size(i, 4 + along);
        offer(along == 0 ? hhcurveto : vvcurveto, i + 1, bytes);
      }
    }
    // From one axis to the other and back; the last curve may end askew.
    for (const bool starts_flat : {true, false}) {
      bytes = 0;
      std::size_t operands = 0;
      std::size_t along = starts_flat ? 0 : 1;
      for (std::size_t i = at_; i < n && segment(i).is_curve; ++i, along = 1 - along) {
        const auto& d = segment(i).d;
        operands += 4;
        if (operands > most_operands || d[1 - along] != 0) break;
        bytes += size(i, along) + size(i, 2) + size(i, 3) + size(i, 5 - along);
        const int op = starts_flat ? hvcurveto : vhcurveto;
        if (d[4 + along] == 0) {
          offer(op, i + 1, bytes);
        } else {
          if (operands < most_operands) offer(op, i + 1, bytes + size(i, 4 + along));
          break;
        }
      }
    }
  }

  void append_run(Bytes& bytes, std::size_t from) const {
    const Run& run = best_[from];
    const std::size_t to = from + run.segments;
    const auto put = [&](std::size_t i, std::size_t k) { append_number(bytes, segments_[i].d[k]); };
    const auto put_all = [&](std::size_t i) {
      for (std::size_t k = 0; k < (segments_[i].is_curve ? 6u : 2u); ++k) put(i, k);
    };
    switch (run.op) {
      case hlineto:
      case vlineto:
        for (std::size_t i = from; i < to; ++i) put(i, (i - from) % 2 == (run.op == hlineto ? 0u : 1u) ? 0 : 1);
        break;
      case hhcurveto:
      case vvcurveto: {
        const std::size_t along = run.op == hhcurveto ? 0 : 1;
        if (segments_[from].d[1 - along] != 0) put(from, 1 - along);
        for (std::size_t i = from; i < to; ++i) {
          for (const std::size_t k : {along, std::size_t{2}, std::size_t{3}, 4 + along}) put(i, k);
        }
        break;
      }
      case hvcurveto:
      case vhcurveto: {
        std::size_t along = run.op == hvcurveto ? 0 : 1;
        for (std::size_t i = from; i < to; ++i, along = 1 - along) {
          for (const std::size_t k : {along, std::size_t{2}, std::size_t{3}, 5 - along}) put(i, k);
          if (segments_[i].d[4 + along] != 0) put(i, 4 + along);
        }
        break;
      }
      default:
        for (std::size_t i = from; i < to; ++i) put_all(i);
    }
    bytes.push_back(static_cast<unsigned char>(run.op));
  }

  const std::vector<Segment>& segments_;
  std::vector<Run> best_;          // by first segment
  std::vector<std::size_t> rest_;  // bytes from a segment to the end
  std::size_t at_ = 0;
};

/// Follows a contour's points by their steps, all checked.
class Pen {
 public:
  void start_contour(std::size_t number) { contour_ = number; }

  std::array<std::int64_t, 2> step_to(const BezierContour& contour, int i) {
    const Point p = contour.point(i);
    std::array<std::int64_t, 2> step{};
    for (const int axis : {0, 1}) {
      const double value = p[axis];
      const std::int64_t now = whole(value, i);
      auto& last = last_[static_cast<std::size_t>(axis)];
      step[static_cast<std::size_t>(axis)] = now - last;
      if (std::abs(now - last) >= 32768 * unit) {
        throw Malformed(text("contour ", contour_, ", point ", i, ": the step of ",
                             static_cast<double>(now - last) / one, " to it does not fit in 16 bits"));
      }
      last = now;
    }
    return step;
  }

 private:
  std::int64_t whole(double value, int i) const {
    const char* why = !(std::abs(value) < coordinate_end)      ? " does not fit in 16 bits"
                      : value * one != std::trunc(value * one) ? " is no multiple of 1/65536"
                                                               : nullptr;
    if (why) throw Malformed(text("contour ", contour_, ", point ", i, ": coordinate ", value, why));
    return static_cast<std::int64_t>(value * one);
  }

  std::size_t contour_ = 0;
  std::array<std::int64_t, 2> last_{};
};

}  // namespace

Charstring interpret(View code, const CffIndex& global_subroutines, const CffIndex& local_subroutines) {
  Charstring result;
  try {
    Interpreter(global_subroutines, local_subroutines, result).run(code);
  } catch (const Malformed& error) {
    result.trouble = text("its charstring ", error.what());
    result.contours.clear();
    result.is_closed_by_line.clear();
    result.accent.reset();
  }
  return result;
}

std::vector<BezierContour> snap(const std::vector<BezierContour>& contours) {
  std::vector<BezierContour> result;
  result.reserve(contours.size());
  for (const BezierContour& contour : contours) {
    result.push_back(
        contour.with_points(contour.points().unaryExpr([](double v) { return std::round(v * one) / one; })));
  }
  return result;
}

Bytes encode_charstring(const std::vector<BezierContour>& contours, const std::vector<bool>& is_closed_by_line,
                        std::optional<double> width) {
  Bytes bytes;
  if (width) {
    if (!(std::abs(*width) < coordinate_end)) throw Malformed(text("the width ", *width, " does not fit in 16 bits"));
    append_number(bytes, static_cast<std::int64_t>(std::round(*width * one)));
  }
  Pen pen;
  for (std::size_t c = 0; c < contours.size(); ++c) {
    const BezierContour& contour = contours[c];
    const int n = static_cast<int>(contour.point_count());
    pen.start_contour(c);
    if (contour.kind(0) != PointKind::Node) throw Malformed(text("contour ", c, ": begins with a handle"));
    const auto [dx, dy] = pen.step_to(contour, 0);
    if (dx != 0 || dy == 0) append_number(bytes, dx);
    if (dy != 0) append_number(bytes, dy);
    bytes.push_back(dy == 0 ? hmoveto : dx == 0 ? vmoveto : rmoveto);

    std::vector<Segment> segments;
    const auto add = [&](std::initializer_list<int> points) {
      Segment segment{.is_curve = points.size() == 3};
      std::size_t k = 0;
      for (const int i : points) {
        const auto step = pen.step_to(contour, i % n);
        segment.d[k++] = step[0];
        segment.d[k++] = step[1];
      }
      segments.push_back(segment);
    };
    for (int i = 1; i < n; ++i) {
      switch (contour.kind(i)) {
        case PointKind::Node:
          add({i});
          break;
        case PointKind::Cubic:
          add({i, i + 1, i + 2});
          i += 2;
          break;
        default:
          throw Malformed(text("contour ", c, ", point ", i, ": of a quadratic, which CFF does not have"));
      }
    }
    // The last line back to the start is drawn where it was; and where its end would else be taken for the start.
    const bool ends_at_start = contour.kind(n - 1) == PointKind::Node && contour.point(n - 1) == contour.point(0);
    const bool was_drawn = c < is_closed_by_line.size() && is_closed_by_line[c];
    if (contour.kind(n - 1) == PointKind::Node && (ends_at_start || was_drawn)) add({0});
    RunFinder(segments).append_to(bytes);
  }
  bytes.push_back(endchar);
  return bytes;
}

Bytes encode_accented(const CffAccent& accent, std::optional<double> width) {
  Bytes bytes;
  std::vector<double> numbers{accent.shift.x(), accent.shift.y(), static_cast<double>(accent.base),
                              static_cast<double>(accent.accent)};
  if (width) numbers.insert(numbers.begin(), *width);
  for (const double number : numbers) {
    if (!(std::abs(number) < coordinate_end)) throw Malformed(text("the number ", number, " does not fit in 16 bits"));
    append_number(bytes, static_cast<std::int64_t>(std::round(number * one)));
  }
  bytes.push_back(endchar);
  return bytes;
}

}  // namespace glyphs::sfnt
