// Random drags on the bundled fonts: how many passes they take, what holds and how well, and what cannot be met.
//
//     drag_sweep [EDITS] [FONT ...]        10,000 edits with the bundled fonts, if nothing else is said
//
// Exit status 1 if something that was promised does not hold.

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "fontcore/drag.h"
#include "fontcore/edit.h"
#include "fontcore/error.h"
#include "tools/bench/letter_contours.h"

namespace {

using namespace fontcore;

constexpr unsigned seed = 20050401;
constexpr double largest_move = 0.2;  // of the em
constexpr double usual_throw = 3.0;   // a control point that moves further than this many times the handle
constexpr double little_share = 0.01;
constexpr double frozen_part = 0.25;  // of the control points, in every second edit
constexpr int ties = 4;               // pairs of control points that move alike in one coordinate
constexpr std::size_t histogram_size = 9;

struct Model {
  OutlineCurve curve;
  double em;
};

std::vector<Model> models_of(const std::vector<std::string>& fonts) {
  std::vector<Model> models;
  for (const auto& [name, contour, em] : letter_contours(fonts)) {
    try {
      models.push_back({OutlineCurve(contour, {.tolerance = glyphs::model_tolerance * em}), em});
    } catch (const InvalidInput& error) {
      std::cerr << name << ": " << error.what() << '\n';
    }
  }
  return models;
}

struct Kind {
  const char* title;
  DragHandle::Hold hold;
  bool keep_length;
};

struct Tally {
  int edits = 0;
  int cut = 0;
  int refused = 0;
  int thrown = 0;
  std::map<std::string, int> unmet;
  std::array<int, histogram_size> passes{};
  double row_residual = 0.0;
  double area_error = 0.0;
  double length_error = 0.0;

  int unmet_count() const {
    int sum = 0;
    for (const auto& [reason, count] : unmet) sum += count;
    return sum;
  }
  int median_passes() const {
    int sum = 0;
    for (int count : passes) sum += count;
    int below = 0;
    for (std::size_t p = 0; p < passes.size(); ++p) {
      below += passes[p];
      if (2 * below >= sum) return static_cast<int>(p);
    }
    return 0;
  }
};

const char* reason_of(DragReport::Failure failure) {
  switch (failure) {
    case DragReport::Failure::NothingFree:
      return "nothing free";
    case DragReport::Failure::AreaOutOfReach:
      return "area out of reach";
    case DragReport::Failure::LengthOutOfReach:
      return "length out of reach";
    case DragReport::Failure::None:
      break;
  }
  return "";
}

// One random edit: any place, any breadth from a twentieth of the contour to all of it.
void edit(const Model& model, std::mt19937& engine, const Kind& kind, Tally& tally) {
  const auto random = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / static_cast<double>(std::mt19937::max());
  };
  const OutlineCurve& curve = model.curve;
  const int n = curve.size();
  const DragHandle handle{.t = random(0.0, n), .hold = kind.hold};
  const double breadth = curve.length() * std::pow(20.0, random(-1.0, 0.0));
  DragOptions options{.level = level_of_breadth(curve, handle.t, breadth)};
  options.scheme = random(0.0, 1.0) < 0.5 ? Scheme::Chaikin : Scheme::Orthogonal;
  options.alpha = std::pow(10.0, random(0.0, 2.0));
  const double growth = random(0.0, 1.0) < 0.25 ? random(0.97, 1.03) : 1.0;
  options.area = KeptValue{growth};
  if (kind.keep_length) options.length = KeptValue{std::sqrt(growth)};  // a circle's area has no other length
  Rows rows;
  for (const int i : curve.corner_pairs()) {
    for (Row& row : fontcore::rows(CornerPair{i, n})) rows.push_back(std::move(row));
  }
  if (random(0.0, 1.0) < 0.5) {
    const int first = static_cast<int>(handle.t + random(0.1, 0.9 - frozen_part) * n);
    for (int k = 0; k < frozen_part * n; ++k) {
      const int i = (first + k) % n;
      for (int axis = 0; axis < 2; ++axis)
        rows.push_back({text("control point ", i, " is frozen"), {{2 * i + axis, 1.0}}, 0.0});
    }
  }
  for (int k = 0; k < ties; ++k) {
    const int a = static_cast<int>(random(0.0, n));
    const int b = (a + 1 + static_cast<int>(random(0.0, n - 1))) % n;
    const int axis = k % 2;
    rows.push_back(
        {text("control points ", a, " and ", b, " move alike"), {{2 * a + axis, 1.0}, {2 * b + axis, -1.0}}, 0.0});
  }
  const double angle = random(0.0, 2.0 * std::numbers::pi);
  const Point delta = random(0.0, largest_move) * model.em * Point(std::cos(angle), std::sin(angle));

  ++tally.edits;
  std::optional<DragSolver> solver;
  try {
    solver.emplace(curve, std::vector{handle}, options, rows);
  } catch (const UnsatisfiableConstraints&) {
    ++tally.unmet["rows in conflict"];
    return;
  }
  const DragReport& report = solver->move(std::array{delta});
  ++tally.passes[static_cast<std::size_t>(report.passes)];
  if (!report.is_met()) {
    ++tally.unmet[reason_of(report.failure)];
    return;
  }
  if (report.share < 1.0) ++tally.cut;
  if (report.share < little_share) ++tally.refused;
  if (solver->field().rowwise().norm().maxCoeff() > usual_throw * delta.norm()) ++tally.thrown;
  tally.row_residual = std::max(tally.row_residual, report.row_residual);
  tally.area_error = std::max(tally.area_error, std::abs(report.area_error));
  tally.length_error = std::max(tally.length_error, std::abs(report.length_error));
}

void print(const std::string& title, const Tally& tally) {
  const auto share = [&](int count) { return text(count, " (", 100.0 * count / tally.edits, " %)"); };
  std::cout << title << ": " << tally.edits << " edits\n  passes";
  for (std::size_t p = 0; p < tally.passes.size(); ++p) {
    if (tally.passes[p] > 0) std::cout << "  " << p << ": " << tally.passes[p];
  }
  std::cout << "  median " << tally.median_passes() << "\n  worst row residual " << tally.row_residual
            << " units, worst area error " << tally.area_error << ", worst length error " << tally.length_error
            << "\n  part of the wish only: " << share(tally.cut) << ", of it less than " << 100.0 * little_share
            << " %: " << share(tally.refused) << "\n  a point thrown over " << usual_throw
            << " moves: " << share(tally.thrown) << "\n  not met: " << share(tally.unmet_count());
  for (const auto& [reason, count] : tally.unmet) std::cout << "; " << reason << ' ' << count;
  std::cout << '\n';
}

bool keeps_promises(const Tally& tally, const Kind& kind) {
  std::size_t most_passes = 0;
  for (std::size_t p = 0; p < tally.passes.size(); ++p) {
    if (tally.passes[p] > 0) most_passes = p;
  }
  return tally.row_residual <= 1e-9 && tally.area_error <= 1e-12 && tally.length_error <= 1e-12 &&
         most_passes <= (kind.keep_length ? 8U : 3U) && (kind.keep_length || tally.median_passes() <= 1) &&
         (kind.hold == DragHandle::Hold::Pinned || tally.unmet_count() <= 0.01 * tally.edits);
}

}  // namespace

int main(int argc, char** argv) try {
  const int edits = argc > 1 ? std::stoi(argv[1]) : 10000;
  std::vector<std::string> fonts(argv + std::min(argc, 2), argv + argc);
  if (fonts.empty()) {
    for (const char* name :
         {"cabin/Cabin-Regular.otf", "eb-garamond/EBGaramond12-Regular.otf",
          "liberation-serif/LiberationSerif-Bold.ttf", "liberation-serif/LiberationSerif-Regular.ttf",
          "open-sans/OpenSans-Bold.ttf", "open-sans/OpenSans-Regular.ttf"}) {
      fonts.push_back(std::string(GLYPHWAVE_SOURCE_DIR) + "/fonts/" + name);
    }
  }
  const std::vector<Model> models = models_of(fonts);
  std::cout << models.size() << " contours of " << fonts.size() << " fonts, seed " << seed << '\n';
  bool is_kept = true;
  for (const Kind& kind : {Kind{"wish, area", DragHandle::Hold::Wished, false},
                           Kind{"wish, area and length", DragHandle::Hold::Wished, true},
                           Kind{"pin, area", DragHandle::Hold::Pinned, false}}) {
    std::mt19937 engine(seed);
    Tally tally;
    for (int k = 0; k < edits; ++k) edit(models[engine() % models.size()], engine, kind, tally);
    print(kind.title, tally);
    is_kept = is_kept && keeps_promises(tally, kind);
  }
  return is_kept ? 0 : 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
