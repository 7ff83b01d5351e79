#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "fontcore/character.h"
#include "fontcore/crossing.h"
#include "fontcore/edit.h"
#include "fontcore/fit.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "fontcore/soften.h"
#include "glyphs/detail_library.h"
#include "glyphs/emission.h"
#include "glyphs/error.h"
#include "glyphs/restyle.h"

namespace glyphs {

namespace {

using fontcore::Bezier;
using fontcore::BezierContour;
using fontcore::Point;
using fontcore::text;
using Contours = std::vector<BezierContour>;

constexpr double least_handle = 2.0;           // units: shorter ones have no direction in whole numbers
constexpr double bisection_width = 0.01;       // of the amount
constexpr double first_left_out = 1.0 / 16.0;  // of a library's scale: features below go first if points must be saved
constexpr double worth_a_note = 5e-4;          // area error after rounding, relative
constexpr std::int64_t most_glyph_work = 1 << 20;  // far more than any drawn glyph takes

// A step of the recipe as it applies to one glyph, in font units.
struct PlacedStep {
  Step step;
  int contour = 0;
};

// The whole flow at one amount.
struct Attempt {
  Contours unrounded;
  Contours rounded;
  std::vector<StepReport> steps;
  double area = 0.0;                        // that the glyph is to have
  std::vector<std::vector<int>> came_from;  // per contour and point; none if the structure is the font's
  std::vector<std::string> notes;
};

// A seed of its own for every place (FNV-1a).
std::uint64_t seed_of(std::uint64_t seed, const std::string& place) {
  std::uint64_t hash = 0xCBF29CE484222325U ^ seed;
  for (const char c : place) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  return hash;
}

class GlyphEditor {
 public:
  /// Counts into `work` what the tries cost.
  GlyphEditor(const Font& font, const Glyph& glyph, const Recipe& recipe, const std::vector<double>& zones,
              std::int64_t& work)
      : font_(font),
        id_(glyph.id),
        name_(glyph.name),
        original_(glyph.contours),
        marks_(glyph.marks),
        drawn_at_(glyph.origin, 0.0),
        recipe_(recipe),
        work_(work),
        curves_(original_.size()) {
    const double unit = recipe.lengths_in_thousandths ? font.units_per_em / 1000.0 : 1.0;
    // Names are unique; only what is no name needs the font.
    const auto is_about_this = [&](const std::string& about) {
      return about.empty() || about == glyph.name ||
             (about.find_first_of("+:@,") != std::string::npos &&
              select_glyphs(font, about) == std::vector<int>{glyph.id});
    };
    for (const Step& step : recipe.steps) {
      const std::string& about = std::visit([](const auto& any) -> const std::string& { return any.glyph; }, step);
      if (is_about_this(about)) std::visit([&](const auto& any) { place(any, unit); }, step);
    }
    frozen_.resize(original_.size());
    for (std::size_t k = 0; k < marks_.size() && has_work(); ++k) {
      for (const int point : marks_[k].frozen) add_frozen(k, rows(original_[k], fontcore::FrozenPoint{point}));
    }
    for (const Freeze& freeze : recipe.keep.freeze) {
      if (is_about_this(freeze.glyph) && has_work()) place(freeze, unit);
    }
    rules_.lines = recipe.keep.lines;
    rules_.smooth_joins = recipe.keep.smooth_joins;
    rules_.extrema = recipe.keep.extrema;
    rules_.frame.italic_angle = recipe.keep.italic_angle * std::numbers::pi / 180.0;
    for (const double height : recipe.keep.zones) rules_.zones.push_back(height * unit);
    if (recipe.keep.zones_auto) {
      double low = std::numeric_limits<double>::infinity();
      double high = -low;
      for (const BezierContour& contour : original_) {
        for (int s = 0; s < contour.segment_count(); ++s) {
          low = std::min(low, contour.point(contour.node(s)).y());
          high = std::max(high, contour.point(contour.node(s)).y());
        }
      }
      rules_.zones = zones;
      rules_.zones.insert(rules_.zones.end(), {low, high});
    }
  }

  bool has_work() const { return !steps_.empty(); }
  /// Leaves features of libraries out that are shorter than a share of their scale.
  void leave_out_below(double finest) { finest_ = finest; }
  bool has_detail() const {
    return std::ranges::any_of(
        steps_, [](const PlacedStep& placed) { return std::holds_alternative<CharacterStep>(placed.step); });
  }
  /// Leaves detail of libraries out near a place.
  void keep_quiet(const Point& place) { quiet_.push_back(place); }
  bool has_pin() const {
    return std::any_of(steps_.begin(), steps_.end(), [](const PlacedStep& placed) {
      const auto* const sweep = std::get_if<SweepStep>(&placed.step);
      return sweep != nullptr && sweep->pin;
    });
  }

  /// Throws  WorkLimitExceeded once the tries of this glyph have cost more than any drawn one takes.
  Attempt attempt(double amount, fontcore::HandleMove handle_move = fontcore::HandleMove::Forced) {
    if (work_ > most_glyph_work) {
      throw fontcore::WorkLimitExceeded(
          text("its ", stored_points(original_), " points were tried too often: that took all a glyph gets"));
    }
    work_ += work_of_point(recipe_) * stored_points(original_);
    handle_move_ = handle_move;
    Attempt result;
    result.unrounded = original_;
    references_.clear();
    weighed_zones_.clear();
    for (std::size_t k = 0; k < original_.size(); ++k) {
      references_.push_back({original_[k], std::vector<int>(original_[k].kinds().size()), frozen_[k],
                             marks_.empty() ? std::vector<int>{} : marks_[k].corners});
      std::iota(references_[k].came_from.begin(), references_[k].came_from.end(), 0);
    }
    std::vector<std::vector<fontcore::OutlineCurve::Location>> handles(original_.size());
    for (const PlacedStep& placed : steps_) {
      if (const auto* const step = std::get_if<WeightStep>(&placed.step)) {
        result.steps.push_back(weighed(*step, amount, result.unrounded));
        for (auto& places : handles) places.clear();  // they are part of the outline that is kept now
        continue;
      }
      const auto k = static_cast<std::size_t>(placed.contour);
      result.steps.push_back(apply(placed, amount, result.unrounded, handles[k]));
    }
    EmittedGlyph emitted = emit({font_, original_, result.unrounded, references_, handles, rules_}, recipe_);
    result.rounded = std::move(emitted.contours);
    result.notes = std::move(emitted.notes);
    for (std::size_t k = 0; k < original_.size(); ++k) {
      const double off = emitted.handle_errors[k];
      if (!(off > 1.0)) continue;
      const auto last = std::find_if(result.steps.rbegin(), result.steps.rend(),
                                     [&](const StepReport& step) { return step.contour == static_cast<int>(k); });
      last->against.push_back(text("area in whole numbers: the handle ends ", off, " units off"));
    }
    for (const ContourReference& reference : references_) result.area += signed_area(reference.contour);
    if (!has_same_structure(result.rounded, original_)) {
      for (std::size_t k = 0; k < references_.size(); ++k) {
        const bool is_own = fontcore::has_same_structure(result.rounded[k], references_[k].contour);
        const auto points = static_cast<std::size_t>(result.rounded[k].point_count());
        result.came_from.push_back(is_own ? references_[k].came_from : std::vector<int>(points, -1));
      }
    }
    return result;
  }

 private:
  void place(SweepStep step, double unit) {
    const bool moves =
        step.move != Point::Zero() ||
        std::any_of(step.more.begin(), step.more.end(), [](const SweepHandle& h) { return h.move != Point::Zero(); });
    if (!moves) return;
    step.near = step.near * unit + drawn_at_;
    step.move *= unit;
    for (SweepHandle& handle : step.more) {
      handle.near = handle.near * unit + drawn_at_;
      handle.move *= unit;
    }
    step.breadth *= unit;
    steps_.push_back({step, step.contour ? checked(*step.contour) : nearest_contour(step.near)});
  }
  void place(SmoothStep step, double unit) {
    step.scale *= unit;
    if (!(step.scale > 0.0)) return;
    const std::size_t first = steps_.size();
    place_on_contours(step, step.contour);
    for (std::size_t i = first; i < steps_.size() && !marks_.empty(); ++i) {
      const auto& marked = marks_[static_cast<std::size_t>(steps_[i].contour)].scale;
      if (marked) std::get<SmoothStep>(steps_[i].step).scale = *marked;
    }
    std::erase_if(steps_, [](const PlacedStep& placed) {
      const auto* const smooth = std::get_if<SmoothStep>(&placed.step);
      return smooth != nullptr && !(smooth->scale > 0.0);
    });
  }
  void place(EqualizeStep step, double unit) {
    for (fontcore::Band& band : step.bands) band.scale *= unit;
    const bool changes =
        std::any_of(step.bands.begin(), step.bands.end(), [](const auto& band) { return band.gain != 1.0; });
    if (changes) place_on_contours(step, step.contour);
  }
  void place(SoftenStep step, double unit) {
    step.radius *= unit;
    if (step.radius > 0.0) place_on_contours(step, step.contour);
  }
  void place(const CharacterStep& step, double) {
    if (!step.library) throw RequestError(step.library_path + ": the library of a character step is not loaded");
    if (step.gain != 0.0 || !step.adds) place_on_contours(step, step.contour);
  }
  void place(const RepeatStep& step, double) {
    if (!step.edit) throw RequestError(step.library_path + ": the edit of a repeat step is not loaded");
    place_on_contours(step, step.contour);
  }
  void place(WeightStep step, double unit) {
    step.detail_scale *= unit;
    if (!step.amounts) throw RequestError(step.model_path + ": the amounts of a weight step are not told");
    if (!original_.empty() && !is_nothing(*step.amounts)) steps_.push_back({step, 0});
  }
  void place_on_contours(const Step& step, std::optional<int> contour) {
    if (contour) {
      steps_.push_back({step, checked(*contour)});
      return;
    }
    for (std::size_t k = 0; k < original_.size(); ++k) {  // what has no inside is carried through
      if (has_inside(original_[k])) steps_.push_back({step, static_cast<int>(k)});
    }
  }
  void place(const Freeze& freeze, double unit) {
    const auto on_glyph = [&](const Point& p) -> Point { return p * unit + drawn_at_; };
    const auto add = [&](int contour, const fontcore::FrozenStretch& stretch) {
      add_frozen(static_cast<std::size_t>(contour), fontcore::rows(stretch));
    };
    if (freeze.box) {
      fontcore::Box box;
      box.add(on_glyph(freeze.box->low));
      box.add(on_glyph(freeze.box->high));
      for (int c = 0; c < static_cast<int>(original_.size()); ++c) {
        if (freeze.contour.value_or(c) == c) add(c, frozen_within(original_[static_cast<std::size_t>(c)], box));
      }
      return;
    }
    const Point from = on_glyph(freeze.stretch->first);
    const int contour = freeze.contour ? checked(*freeze.contour) : nearest_contour(from);
    const BezierContour& outline = original_[static_cast<std::size_t>(contour)];
    const auto start = fontcore::nearest_point(outline, from);
    const auto end = fontcore::nearest_point(outline, on_glyph(freeze.stretch->second));
    add(contour, frozen_between(outline, {start.segment, start.u}, {end.segment, end.u}));
  }
  void add_frozen(std::size_t contour, fontcore::Rows rows) {
    std::move(rows.begin(), rows.end(), std::back_inserter(frozen_[contour]));
  }
  int checked(int contour) const {
    const int count = static_cast<int>(original_.size());
    if (contour >= count) throw Refusal{text("there is no contour ", contour, ": it has ", count)};
    return contour;
  }
  int nearest_contour(const Point& place) const {
    int best = 0;
    constexpr double without_inside = std::numeric_limits<double>::max();
    double nearest = std::numeric_limits<double>::infinity();
    for (int c = 0; c < static_cast<int>(original_.size()); ++c) {
      // A point or a line without inside is there for other tools, unless there is nothing else.
      const BezierContour& contour = original_[static_cast<std::size_t>(c)];
      const double distance = has_inside(contour) ? fontcore::nearest_point(contour, place).distance : without_inside;
      if (distance < nearest) {
        nearest = distance;
        best = c;
      }
    }
    return best;
  }

  fontcore::Corners corners() const {
    return recipe_.keep.corners ? fontcore::Corners::Keep : fontcore::Corners::Round;
  }

  // The points of a contour as it stands that the source marks as corners.
  const std::vector<int>& marked_corners(std::size_t index) const { return references_[index].corners; }
  fontcore::OutlineRules rules_of(std::size_t index) const {
    fontcore::OutlineRules rules = rules_;
    rules.corners = marked_corners(index);
    return rules;
  }

  // The model of a contour; of one that no step has touched yet it is made once for all amounts.
  fontcore::OutlineCurve curve_of(int index, const BezierContour& contour) {
    auto& known = curves_[static_cast<std::size_t>(index)];
    if (known && contour == known->contour()) return *known;
    fontcore::OutlineCurve curve(contour, {.tolerance = model_tolerance * font_.units_per_em,
                                           .corners = marked_corners(static_cast<std::size_t>(index))});
    if (!known) known = curve;
    return curve;
  }

  // The wish of a sweep, and what the report says of it.
  void wish(const SweepStep& step, double amount, const fontcore::OutlineCurve& curve, fontcore::StructureEdit& edit,
            StepReport& report) const {
    const BezierContour& contour = curve.contour();
    std::vector<SweepHandle> handles = {{step.near, step.move}};
    handles.insert(handles.end(), step.more.begin(), step.more.end());
    std::vector<fontcore::Pull> pulls;
    for (const auto& [near, move] : handles) {
      const auto [segment, u, distance] = fontcore::nearest_point(contour, near);
      pulls.push_back({curve.parameter(segment, u), amount * move});
      edit.handles.push_back({{segment, u}, amount * move});
      report.handles.push_back({evaluate(contour.segment(segment), u) - drawn_at_, move, Point::Zero()});
    }
    const fontcore::SweepOptions options{.detail = step.detail, .grip = step.grip};
    const double breadth = step.level ? breadth_of_level(curve, pulls[0].t, *step.level) : step.breadth;
    const fontcore::Sweep sweep = step.level ? sweep_at_level(curve, pulls[0].t, pulls[0].move, *step.level, options)
                                  : pulls.size() == 1
                                      ? fontcore::sweep(curve, pulls[0].t, pulls[0].move, breadth, options)
                                      : fontcore::sweep(curve, pulls, breadth);
    edit.field = recipe_.keep.corners ? respect_corners(curve, sweep.field) : sweep.field;
    edit.handle_move = step.grip == fontcore::Grip::ControlPoint ? fontcore::HandleMove::Wished
                       : step.pin                                ? fontcore::HandleMove::Pinned
                                                                 : handle_move_;
    edit.breadth = breadth;
    report.op = "sweep";
    report.level = sweep.level;
  }
  // What works arc by arc needs no model.
  fontcore::ArcSmoothing smoothing(const Step& step, const fontcore::OutlineArcs& outline,
                                   fontcore::StructureEdit& edit, StepReport& report) const {
    const fontcore::ArcwiseOptions options{.tolerance = model_tolerance * font_.units_per_em, .corners = corners()};
    if (const auto* const equalize = std::get_if<EqualizeStep>(&step)) {
      edit.breadth = equalize->bands.back().scale;
      report.op = "equalize";
      return equalize_arcs(outline, equalize->bands, fontcore::SmoothBy::Energy, options);
    }
    const auto& smooth = std::get<SmoothStep>(step);
    edit.breadth = smooth.scale;
    report.op = "smooth";
    return smooth_arcs(outline, smooth.scale, smooth.by, options);
  }

  static void hold_corners(const fontcore::OutlineArcs& outline, fontcore::StructureEdit& edit) {
    for (int s = 0; s < outline.contour().segment_count(); ++s) {
      if (!outline.is_corner(s)) continue;
      const fontcore::Rows rows = fontcore::rows(outline.contour(), fontcore::FrozenPoint{outline.contour().node(s)});
      edit.rows.insert(edit.rows.end(), rows.begin(), rows.end());
    }
  }

  // The segment that starts at a point of the font's contour, given by its number there.
  int segment_at(int number, int index) const {
    const BezierContour& own = original_[static_cast<std::size_t>(index)];
    int point = -1;
    int stored = 0;
    for (int i = 0; i < own.point_count(); ++i) {
      if (own.kind(i) == fontcore::PointKind::ImpliedNode) continue;
      if (stored++ == number) point = i;
    }
    if (point < 0) throw Refusal{text("contour ", index, ": there is no point ", number, ": it has ", stored)};
    if (!is_node(own.kind(point))) throw Refusal{text("contour ", index, ": point ", number, " is no node")};
    const ContourReference& reference = references_[static_cast<std::size_t>(index)];
    for (int s = 0; s < reference.contour.segment_count(); ++s) {
      if (reference.came_from[static_cast<std::size_t>(reference.contour.node(s))] == point) return s;
    }
    throw Refusal{text("contour ", index, ": point ", number, " is an arc already")};
  }

  // Arcs for corners: the contour so far, as it stands, is what later steps and rounding keep to.
  StepReport soften(const SoftenStep& step, int index, double amount, BezierContour& contour) {
    ContourReference& reference = references_[static_cast<std::size_t>(index)];
    StepReport report;
    report.op = "soften";
    report.contour = index;
    fontcore::SoftenOptions options{.radius = amount * step.radius, .least_handle = least_handle};
    options.arcs = has_quadratics(font_, original_) ? fontcore::ArcKind::Quadratic : fontcore::ArcKind::Cubic;
    std::vector<int>& corners = options.corners.emplace();
    if (step.corners) {
      options.empty = fontcore::EmptyArc::Add;
      for (const int number : *step.corners) corners.push_back(segment_at(number, index));
    } else {
      const std::vector<double> turns = turning_angles(contour);
      for (int s = 0; s < contour.segment_count(); ++s) {
        if (std::abs(turns[static_cast<std::size_t>(s)]) > options.corner_angle) corners.push_back(s);
      }
    }
    const auto is_frozen = [&](int segment) {
      const int point = contour.node(segment);
      return std::any_of(reference.frozen.begin(), reference.frozen.end(),
                         [&](const fontcore::Row& row) { return row.terms.front().variable / 2 == point; });
    };
    if (const auto left = std::erase_if(corners, is_frozen); left > 0) {
      report.against.push_back(text("frozen: ", left, " of its corners"));
    }
    const fontcore::Softened softened = fontcore::soften(contour, options);
    report.corners = static_cast<int>(softened.corners.size());
    if (softened.corners.empty()) return report;
    report.least_radius = options.radius;
    for (const auto& corner : softened.corners) report.least_radius = std::min(report.least_radius, corner.radius);

    take_over(softened.contour, softened.came_from, index, contour);
    return report;
  }

  // A contour with other points: what later steps keep to. No frozen point is gone.
  void take_over(const BezierContour& made, std::vector<int> came_from, int index, BezierContour& contour) {
    ContourReference& reference = references_[static_cast<std::size_t>(index)];
    ContourReference now{made, std::move(came_from), {}, {}, reference.is_textured};
    std::vector<int> index_now(reference.came_from.size(), -1);
    for (std::size_t i = 0; i < now.came_from.size(); ++i) {
      int& from = now.came_from[i];
      if (from < 0) continue;
      if (std::ranges::binary_search(reference.corners, from)) now.corners.push_back(static_cast<int>(i));
      index_now[static_cast<std::size_t>(from)] = static_cast<int>(i);
      from = reference.came_from[static_cast<std::size_t>(from)];
    }
    for (fontcore::Row row : reference.frozen) {
      for (auto& term : row.terms) {
        term.variable = 2 * index_now[static_cast<std::size_t>(term.variable / 2)] + term.variable % 2;
      }
      now.frozen.push_back(std::move(row));
    }
    reference = std::move(now);
    contour = made;
  }

  // The whole glyph in another weight: what later steps, and rounding, keep to.
  StepReport weighed(const WeightStep& step, double amount, Contours& contours) {
    StepReport report;
    report.op = "weight";
    fontcore::Weighted made =
        apply_weight(font_, id_, contours, *step.model, *step.amounts,
                     {.share = amount, .italic_angle = rules_.frame.italic_angle, .detail_scale = step.detail_scale});
    report.share = made.amount;
    report.held_segments = made.held_segments;
    report.sides = {made.left_side, made.right_side};
    if (made.amount == 0.0) {
      if (amount > 0.0)
        report.against.emplace_back("a crossing, a closed counter or lost ink: nothing of it is applied");
      return report;
    }
    if (made.amount < amount) {
      report.against.push_back(text("a crossing, a closed counter or lost ink: ", made.amount, " of it is applied"));
    }
    for (std::size_t k = 0; k < contours.size(); ++k) {
      ContourReference& reference = references_[k];
      if (!reference.frozen.empty()) made.contours[k] = held(contours[k], made.contours[k], k);
      const std::vector<double>& zones = rules_.zones;
      for (int s = 0; s < contours[k].segment_count(); ++s) {
        const int node = contours[k].node(s);
        const double height = contours[k].point(node).y();
        constexpr double same_height = 1e-9;
        if (std::ranges::any_of(zones, [&](double zone) { return std::abs(zone - height) < same_height; })) {
          weighed_zones_.push_back(made.contours[k].point(node).y());
        }
      }
      reference.contour = made.contours[k];
    }
    contours = std::move(made.contours);
    return report;
  }

  // A contour moved to another of its structure as far as what is frozen lets it.
  BezierContour held(const BezierContour& contour, const BezierContour& wished, std::size_t index) const {
    fontcore::StructureEdit edit;
    edit.rules = rules_of(index);
    edit.rules.zones.clear();  // heights are the step's
    edit.rows = references_[index].frozen;
    edit.breadth = length(contour);
    const auto wish = [&](int segment, double u, double) -> Point {
      return evaluate(wished.segment(segment), u) - evaluate(contour.segment(segment), u);
    };
    fontcore::StructureFit fit = refit_structure(fontcore::OutlineArcs(contour), wish, edit);
    if (!fit.report.failed.empty()) throw Refusal{text("contour ", index, ": ", fit.report.failed)};
    return std::move(fit.contour);
  }

  // Detail laid on a contour as it stands.
  StepReport character(const CharacterStep& step, int index, double amount, BezierContour& contour) {
    ContourReference& reference = references_[static_cast<std::size_t>(index)];
    StepReport report;
    report.op = "character";
    report.contour = index;
    const fontcore::DetailLibrary& library = *step.library;
    fontcore::CharacterOptions options{.gain = step.gain, .adds = step.adds, .mirrors = step.mirrors};
    options.amount = amount;
    options.unit = font_.units_per_em / library.units_per_em;
    options.finest = report.finest = finest_ * library.scale * options.unit;
    options.spares_lines = step.spares_lines;
    options.holds_joins = step.holds_joins;
    options.ink = ink_side(original_, static_cast<std::size_t>(index));
    options.place = place_of(name_, index);
    options.seed = seed_of(recipe_.seed, options.place);
    options.quiet = quiet_;
    for (const fontcore::Row& row : reference.frozen) options.held.push_back(row.terms.front().variable / 2);
    if (recipe_.keep.area != KeepArea::None) options.area = signed_area(reference.contour);
    fontcore::Character made;
    try {
      const fontcore::OutlineCurveOptions cut{.corners = marked_corners(static_cast<std::size_t>(index))};
      made = apply_detail(fontcore::arcs_at_scale(contour, library.scale * options.unit, cut), library, options);
    } catch (const fontcore::InvalidInput& error) {
      throw Refusal{text("contour ", index, ": ", error.what())};
    }
    if (!made.area_failed.empty()) throw Refusal{text("contour ", index, ": ", made.area_failed)};
    report.arcs = made.arcs;
    report.too_short = made.too_short;
    report.base_move = made.base_move;
    if (made.arcs == 0) return report;
    reference.is_textured = true;
    take_over(made.contour, std::move(made.came_from), index, contour);
    return report;
  }

  StepReport apply(const PlacedStep& placed, double amount, Contours& contours,
                   std::vector<fontcore::OutlineCurve::Location>& handles) {
    BezierContour& contour = contours[static_cast<std::size_t>(placed.contour)];
    if (const auto* const step = std::get_if<SoftenStep>(&placed.step)) {
      handles.clear();  // their segments have other numbers now, and their places are part of the outline that is kept
      return soften(*step, placed.contour, amount, contour);
    }
    if (const auto* const step = std::get_if<CharacterStep>(&placed.step)) {
      handles.clear();
      return character(*step, placed.contour, amount, contour);
    }
    StepReport report;
    report.contour = placed.contour;
    fontcore::StructureEdit edit;
    edit.rules = rules_of(static_cast<std::size_t>(placed.contour));
    edit.rules.zones.insert(edit.rules.zones.end(), weighed_zones_.begin(), weighed_zones_.end());
    const ContourReference& reference = references_[static_cast<std::size_t>(placed.contour)];
    edit.rows = reference.frozen;
    // Every step gives its own area back, so glyph and contour ask the same of it; they differ in rounding.
    if (recipe_.keep.area != KeepArea::None) edit.area = signed_area(reference.contour);
    if (recipe_.keep.length) edit.length = length(reference.contour);
    fontcore::StructureFit fit;
    try {
      const auto* const sweep = std::get_if<SweepStep>(&placed.step);
      const auto* const repeat = std::get_if<RepeatStep>(&placed.step);
      fit = sweep != nullptr    ? swept(*sweep, amount, contour, edit, report)
            : repeat != nullptr ? repeated(*repeat, amount, contour, edit, report)
                                : smoothed(placed.step, amount, contour, edit, report);
    } catch (const fontcore::InvalidInput& error) {
      throw Refusal{text("contour ", placed.contour, ": ", error.what())};
    }
    if (!fit.report.failed.empty()) throw Refusal{text("contour ", placed.contour, ": ", fit.report.failed)};
    for (std::size_t k = 0; k < fit.got.size(); ++k) report.handles[k].got = fit.got[k];
    report.against.insert(report.against.end(), fit.against.begin(), fit.against.end());
    report.off_wish = fit.off_wish;
    if (corners() == fontcore::Corners::Round && report.op != "sweep" && report.op != "repeat" &&
        fit.off_wish > recipe_.tolerance) {
      report.against.push_back(
          text("the outline's own points: it ends up to ", fit.off_wish, " units off the rounded one"));
    }
    contour = std::move(fit.contour);
    // Handles that the rules did not hold back must not be lost to rounding.
    if (!edit.handles.empty() && report.against.empty()) {
      handles.clear();
      for (const auto& handle : edit.handles) handles.push_back(handle.at);
    }
    return report;
  }

  fontcore::StructureFit swept(const SweepStep& step, double amount, const BezierContour& contour,
                               fontcore::StructureEdit& edit, StepReport& report) {
    const fontcore::OutlineCurve curve = curve_of(report.contour, contour);
    report.levels = curve.levels();
    wish(step, amount, curve, edit, report);
    if (edit.field.isZero(0.0)) {
      edit.handles.clear();
      return {contour, {}, {}, {}, 0.0};
    }
    return fontcore::refit_structure(curve, edit);
  }

  fontcore::StructureFit repeated(const RepeatStep& step, double amount, const BezierContour& contour,
                                  const fontcore::StructureEdit& edit, StepReport& report) const {
    report.op = "repeat";
    const auto index = static_cast<std::size_t>(report.contour);
    const std::vector<fontcore::OutlineArcs> outlines{
        fontcore::OutlineArcs(contour, {.corners = marked_corners(index)})};
    const fontcore::PlaceOptions options{.tolerance = step.within,
                                         .mirrors = step.mirrors,
                                         .turns = step.turns,
                                         .smallest = step.smallest,
                                         .largest = step.largest,
                                         .units_per_em = static_cast<double>(font_.units_per_em),
                                         .ink = ink_side(original_, index)};
    fontcore::PlacedDetail detail = *step.edit;
    const std::vector<fontcore::MatchingPlace> places = find_places(outlines, detail, options);
    report.places = static_cast<int>(places.size());
    detail.displacement *= amount;
    return add_at_places(outlines[0], detail, places, options, edit);
  }

  fontcore::StructureFit smoothed(const Step& step, double amount, const BezierContour& contour,
                                  fontcore::StructureEdit& edit, StepReport& report) const {
    const fontcore::OutlineArcs outline(contour, {.corners = marked_corners(static_cast<std::size_t>(report.contour))});
    const fontcore::ArcSmoothing made = smoothing(step, outline, edit, report);
    report.levels = made.levels;
    report.energy_before = made.energy_before;
    report.energy_after = made.energy_after;
    if (made.field.is_zero()) return {contour, {}, {}, {}, 0.0};
    const auto wish = [&](int segment, double, double s) -> Point {
      return amount * made.field.at(outline, outline.arc_of(segment), outline.offset_of(segment) + s);
    };
    if (corners() == fontcore::Corners::Round) return refit_structure(outline, wish, edit);
    // Corners are kept to the last bit, unless they alone could give the area back.
    fontcore::StructureEdit held = edit;
    hold_corners(outline, held);
    fontcore::StructureFit fit = refit_structure(outline, wish, held);
    if (fit.report.failed.empty()) return fit;
    report.against.push_back("area: with corners held, " + fit.report.failed);
    return refit_structure(outline, wish, edit);
  }

  const Font& font_;
  const int id_;
  const std::string& name_;
  const Contours& original_;
  const std::vector<ContourMarks>& marks_;  // one a contour, or none
  const Point drawn_at_;                    // the place in stored coordinates that a recipe calls the origin
  const Recipe& recipe_;
  std::int64_t& work_;
  fontcore::HandleMove handle_move_ = fontcore::HandleMove::Forced;
  double finest_ = 0.0;
  std::vector<Point> quiet_;
  std::vector<PlacedStep> steps_;
  fontcore::OutlineRules rules_;
  std::vector<fontcore::Rows> frozen_;        // per contour
  std::vector<ContourReference> references_;  // per contour, of the attempt being made
  std::vector<double> weighed_zones_;         // where a weight step has put heights of zones
  std::vector<std::optional<fontcore::OutlineCurve>> curves_;
};

int kept_segments(const Contours& before, const Contours& after) {
  int kept = 0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (fontcore::has_same_structure(before[k], after[k])) {
      kept += equal_segments(before[k], after[k]);
      continue;
    }
    std::vector<Bezier> old;
    for (int s = 0; s < before[k].segment_count(); ++s) old.push_back(before[k].segment(s));
    for (int s = 0; s < after[k].segment_count(); ++s) {
      const Bezier now = after[k].segment(s);
      kept += std::any_of(old.begin(), old.end(),
                          [&](const Bezier& was) { return was.degree == now.degree && was.p == now.p; })
                  ? 1
                  : 0;
    }
  }
  return kept;
}

// Of the points; of contours with other points, the distance of the outlines.
double largest_displacement(const Contours& before, const Contours& after, double step) {
  double largest = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    if (!fontcore::has_same_structure(before[k], after[k])) {
      largest =
          std::max(largest, fontcore::two_sided_distance(to_polyline(before[k], step), to_polyline(after[k], step)));
      continue;
    }
    largest = std::max(largest, (after[k].points() - before[k].points()).rowwise().norm().maxCoeff());
  }
  return largest;
}

double emission_deviation(const Contours& solved, const Contours& emitted) {
  double deviation = 0.0;
  constexpr double accuracy = 0.005;  // font units
  for (std::size_t k = 0; k < solved.size(); ++k) {
    deviation = std::max(deviation, fontcore::has_same_structure(solved[k], emitted[k])
                                        ? fontcore::two_sided_distance(solved[k], emitted[k])
                                        : farthest(solved[k], emitted[k], accuracy).distance);
  }
  return deviation;
}

// How much of what was asked the handles got, summed over the steps.
double progress(const Attempt& attempt) {
  double sum = 0.0;
  for (const StepReport& step : attempt.steps) {
    for (const auto& [handle, asked, got] : step.handles) {
      if (asked != Point::Zero()) sum += got.dot(asked) / asked.squaredNorm();
    }
  }
  return sum;
}

// Counters that an edit closed, and contours that it turned round.
void compare_ink(const Contours& before, const std::vector<fontcore::Crossing>& crossings_before, const Contours& after,
                 const std::vector<fontcore::Crossing>& crossings_after, GlyphReport& report) {
  try {
    const auto closed = closed_counters(measure_ink(before, crossings_before), measure_ink(after, crossings_after));
    report.closed_counters = static_cast<int>(closed.size());
    for (const fontcore::Box& counter : closed) {
      report.notes.push_back(text("a counter is closed: the one from (", counter.low.x(), ", ", counter.low.y(),
                                  ") to (", counter.high.x(), ", ", counter.high.y(), ")"));
    }
    report.changed_windings = changed_windings(before, crossings_before, after, crossings_after);
    for (const int contour : report.changed_windings) {
      report.notes.push_back(text("contour ", contour, ": runs the other way round now, or lies in another"));
    }
  } catch (const fontcore::WorkLimitExceeded&) {
    report.notes.emplace_back("counters are not compared: the contours lie on themselves too often");
  }
}

// The whole edit; where detail of libraries needs more points than the glyph may have, without its finest features.
Attempt within_budget(GlyphEditor& editor, const Recipe& recipe, GlyphReport& report) {
  Attempt attempt = editor.attempt(1.0);
  const std::int64_t wanted = stored_points(attempt.rounded);
  std::int64_t points = wanted;
  for (double finest = first_left_out; points > recipe.most_points && editor.has_detail();
       finest *= std::numbers::sqrt2) {
    if (finest > 1.0) {
      throw Refusal{text("it would have ", points, " points without any detail, more than ", recipe.most_points)};
    }
    editor.leave_out_below(finest);
    attempt = editor.attempt(1.0);
    points = stored_points(attempt.rounded);
  }
  if (points < wanted) {
    const auto step = std::ranges::find(attempt.steps, "character", &StepReport::op);
    report.notes.push_back(text("features of the library below ", step->finest,
                                " units are left out: with them it has ", wanted, " points, without ", points,
                                "; it may have ", recipe.most_points));
  }
  return attempt;
}

// Where detail of libraries adds crossings, it is left out around them. Returns how many are left.
int quieted(GlyphEditor& editor, const std::vector<fontcore::Crossing>& before, int more, Attempt& best,
            std::vector<fontcore::Crossing>& after, GlyphReport& report) {
  constexpr int rounds = 4;
  int places = 0;
  const auto is_old = [&](const fontcore::Crossing& crossing) {
    return std::ranges::any_of(before, [&](const auto& old) { return (old.where - crossing.where).norm() < 1.0; });
  };
  for (int round = 0; round < rounds && more > 0; ++round) {
    for (const fontcore::Crossing& crossing : after) {
      if (is_old(crossing)) continue;
      editor.keep_quiet(crossing.where);
      ++places;
    }
    Attempt tried = editor.attempt(1.0);
    auto crossings = find_crossings(tried.rounded);
    more = added_crossings(before, crossings);
    best = std::move(tried);
    after = std::move(crossings);
  }
  if (more == 0) report.notes.push_back(text("detail is left out around ", places, " places: there it would cross"));
  return more;
}

// The edit that comes nearest to the wish without adding a crossing: the largest safe amount, found by bisection; or,
// where only forcing the handles would cross and it gets further, the whole amount with the handles as wishes.
template <typename Added>
Attempt reduced(GlyphEditor& editor, Attempt best, const Added& added, GlyphReport& report) {
  for (StepReport& step : best.steps) {
    for (HandleReport& handle : step.handles) handle.got = Point::Zero();
    step.corners = 0;
    step.least_radius = 0.0;
  }
  report.amount = 0.0;
  for (double unsafe = 1.0; unsafe - report.amount > bisection_width;) {
    const double amount = 0.5 * (report.amount + unsafe);
    Attempt tried = editor.attempt(amount);
    if (added(tried) > 0) {
      unsafe = amount;
    } else {
      report.amount = amount;
      best = std::move(tried);
    }
  }
  Attempt wished = editor.attempt(1.0, fontcore::HandleMove::Wished);
  if (progress(wished) > progress(best) && added(wished) == 0) {
    report.amount = 1.0;
    for (StepReport& step : wished.steps) step.against = {"a crossing, if the handle were forced"};
    report.notes.emplace_back("the handle is not forced: that would add a crossing");
    return wished;
  }
  for (StepReport& step : best.steps) step.against.emplace_back("a crossing: the amount is reduced");
  report.notes.push_back(text("reduced to ", report.amount, " of the move: more would add a crossing"));
  return best;
}

// A composite that the recipe decomposes, as the simple glyph it would be.
std::optional<Glyph> without_components(const Font& font, const Glyph& glyph, const Recipe& recipe) {
  if (!glyph.is_composite() || recipe.composites == Composites::Refuse) return std::nullopt;
  Glyph result = glyph;
  result.components.clear();
  try {
    result.contours = decompose(font, glyph.id);
  } catch (const FontReadError& error) {
    result.trouble = error.what();
  }
  return result;
}

std::string list_of(const Font& font, const std::vector<int>& glyphs) {
  std::string list;
  for (const int id : glyphs) list += (list.empty() ? "" : ", ") + font.glyphs[static_cast<std::size_t>(id)].name;
  return list;
}

// The names of a composite's parts, each once, the first few of them.
std::string parts_of(const Font& font, const Glyph& glyph) {
  constexpr std::size_t shown = 8;
  std::vector<int> parts;
  for (const Component& part : glyph.components) {
    if (std::find(parts.begin(), parts.end(), part.glyph) != parts.end()) continue;
    if (parts.size() == shown) return list_of(font, parts) + " and more";
    parts.push_back(part.glyph);
  }
  return list_of(font, parts);
}

}  // namespace

bool lays_detail(const Recipe& recipe) {
  return std::ranges::any_of(recipe.steps,
                             [](const Step& step) { return std::holds_alternative<CharacterStep>(step); });
}

std::int64_t stored_points(const Contours& contours) {
  std::int64_t points = 0;
  for (const BezierContour& contour : contours) {
    points += static_cast<std::int64_t>(contour.kinds().size()) -
              std::ranges::count(contour.kinds(), fontcore::PointKind::ImpliedNode);
  }
  return points;
}

std::int64_t work_of_point(const Recipe& recipe) {
  constexpr std::int64_t with_detail = 16;
  return lays_detail(recipe) ? with_detail : 1;
}

GlyphResult restyle_glyph(const Font& font, int id, const Recipe& given, const std::vector<double>& zones,
                          const std::vector<Point>& quiet) {
  const std::optional<Glyph> decomposed = without_components(font, font.glyphs.at(static_cast<std::size_t>(id)), given);
  const Glyph& glyph = decomposed ? *decomposed : font.glyphs.at(static_cast<std::size_t>(id));
  const Recipe recipe = with_amounts(font, given);
  GlyphResult result{glyph.contours, glyph.contours, {}, {}, 0};
  GlyphReport& report = result.report;
  report.glyph = id;
  report.name = glyph.name;
  report.segments_before = report.segments_after = report.segments_kept = segment_count(glyph.contours);
  report.size.points_before = report.size.points_after =
      stored_points(font.glyphs[static_cast<std::size_t>(id)].contours);
  report.area_before = report.area_target = report.area_unrounded = report.area_after = signed_area(glyph.contours);
  try {
    if (!glyph.trouble.empty()) throw Refusal{glyph.trouble};
    // In a UFO a composite may have contours of its own, which are edited beside its components.
    if (glyph.is_composite() && glyph.contours.empty())
      throw Refusal{"it is a composite; edit its parts: " + parts_of(font, glyph)};
    GlyphEditor editor(font, glyph, recipe, zones, result.work);
    for (const Point& place : quiet) editor.keep_quiet(place);
    if (!editor.has_work() || glyph.contours.empty()) return result;

    const auto before = find_crossings(glyph.contours);
    report.crossings_before = report.crossings_after = static_cast<int>(before.size());
    const auto crossings = [&](const Attempt& attempt) {
      return attempt.rounded == glyph.contours ? before : find_crossings(attempt.rounded);
    };
    const auto added = [&](const Attempt& attempt) { return added_crossings(before, crossings(attempt)); };
    Attempt best = within_budget(editor, recipe, report);
    auto after = crossings(best);
    int more = added_crossings(before, after);
    if (recipe.on_crossing == OnCrossing::Reduce && more > 0 && editor.has_detail()) {
      more = quieted(editor, before, more, best, after, report);
    }
    if (recipe.on_crossing != OnCrossing::Allow && more > 0) {
      if (recipe.on_crossing == OnCrossing::Refuse) throw Refusal{text("crossings that the edit adds: ", more)};
      if (editor.has_pin()) throw Refusal{text("crossings that the pinned move adds: ", more)};
      best = reduced(editor, Attempt{glyph.contours, glyph.contours, best.steps, report.area_before, {}, {}}, added,
                     report);
      after = crossings(best);
    }
    const bool has_new_points = !has_same_structure(best.rounded, glyph.contours);
    if (const int user = has_new_points ? matched_in(font, id) : -1; user >= 0) {
      throw Refusal{text("its points would be other ones, and ", font.glyphs[static_cast<std::size_t>(user)].name,
                         " matches its parts by point numbers")};
    }
    report.area_target = best.area;
    report.crossings_after = static_cast<int>(after.size());
    if (best.rounded != glyph.contours) compare_ink(glyph.contours, before, best.rounded, after, report);
    result.contours = std::move(best.rounded);
    result.unrounded = std::move(best.unrounded);
    result.came_from = std::move(best.came_from);
    report.steps = std::move(best.steps);
    std::ranges::move(best.notes, std::back_inserter(report.notes));
    report.changed = result.contours != glyph.contours;
    if (decomposed && report.changed) {
      report.notes.push_back("decomposed: it is a simple glyph now, of the outlines that its parts had: " +
                             parts_of(font, font.glyphs[static_cast<std::size_t>(id)]));
    }
  } catch (const Refusal& refusal) {
    report.refused = refusal.reason;
  } catch (
      const fontcore::Error& error) {  // what fails for one glyph leaves that glyph as it was, and the others go on
    report.refused = error.what();
  }
  if (!report.refused.empty()) {
    report.amount = 0.0;
    return result;
  }
  report.area_unrounded = signed_area(result.unrounded);
  report.area_after = signed_area(result.contours);
  if (recipe.keep.area == KeepArea::None) report.area_target = report.area_unrounded;
  report.largest_displacement = largest_displacement(glyph.contours, result.contours, 1e-3 * font.units_per_em);
  report.segments_after = segment_count(result.contours);
  if (report.changed) report.size.points_after = stored_points(result.contours);
  report.segments_kept = kept_segments(glyph.contours, result.contours);
  report.deviation = emission_deviation(result.unrounded, result.contours);
  if (const double taken = std::abs(report.area_before) - std::abs(report.area_target);
      recipe.keep.area != KeepArea::None && std::abs(taken) > 1e-9 * std::abs(report.area_before)) {
    const bool is_weighed = std::ranges::count(report.steps, "weight", &StepReport::op) > 0;
    const bool is_softened = std::ranges::count(report.steps, "soften", &StepReport::op) > 0;
    const char* what = !is_weighed ? "softening " : is_softened ? "weight and softening " : "weight ";
    report.notes.push_back(text(what, taken > 0.0 ? "takes " : "adds ", std::abs(taken), " square units, ",
                                100.0 * std::abs(taken / report.area_before), " % of the area"));
  }
  if (report.deviation > recipe.tolerance) {
    report.notes.push_back(
        text("rounding moved the outline by ", report.deviation, " units, over the tolerance of ", recipe.tolerance));
  }
  const double area_error = std::abs(report.area_after - report.area_target);
  if (area_error > worth_a_note * std::abs(report.area_target)) {
    report.notes.push_back(
        text("no whole-number outline near this one is nearer to the area than ", area_error, " square units"));
  }
  return result;
}

OutlineSize& OutlineSize::operator+=(const OutlineSize& other) {
  points_before += other.points_before;
  points_after += other.points_after;
  bytes_before += other.bytes_before;
  bytes_after += other.bytes_after;
  return *this;
}

}  // namespace glyphs
