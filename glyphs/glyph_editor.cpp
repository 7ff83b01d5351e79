#include "glyphs/glyph_editor.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "fontcore/character.h"
#include "fontcore/measure.h"
#include "fontcore/soften.h"
#include "glyphs/detail_library.h"
#include "glyphs/error.h"

namespace glyphs {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::text;
using Contours = std::vector<BezierContour>;

namespace {

constexpr double least_handle = 2.0;               // units: shorter ones have no direction in whole numbers
constexpr std::int64_t most_glyph_work = 1 << 20;  // far more than any drawn glyph takes

// A seed of its own for every place (FNV-1a).
std::uint64_t seed_of(std::uint64_t seed, const std::string& place) {
  std::uint64_t hash = 0xCBF29CE484222325U ^ seed;
  for (const char c : place) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  return hash;
}

}  // namespace

GlyphEditor::GlyphEditor(const Font& font, const Glyph& glyph, const Recipe& recipe, const std::vector<double>& zones,
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

bool GlyphEditor::has_detail() const {
  return std::ranges::any_of(
      steps_, [](const PlacedStep& placed) { return std::holds_alternative<CharacterStep>(placed.step); });
}

bool GlyphEditor::has_pin() const {
  return std::any_of(steps_.begin(), steps_.end(), [](const PlacedStep& placed) {
    const auto* const sweep = std::get_if<SweepStep>(&placed.step);
    return sweep != nullptr && sweep->pin;
  });
}

Attempt GlyphEditor::attempt(double amount, fontcore::HandleMove handle_move) {
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

void GlyphEditor::place(SweepStep step, double unit) {
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

void GlyphEditor::place(SmoothStep step, double unit) {
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

void GlyphEditor::place(EqualizeStep step, double unit) {
  for (fontcore::Band& band : step.bands) band.scale *= unit;
  const bool changes =
      std::any_of(step.bands.begin(), step.bands.end(), [](const auto& band) { return band.gain != 1.0; });
  if (changes) place_on_contours(step, step.contour);
}

void GlyphEditor::place(SoftenStep step, double unit) {
  step.radius *= unit;
  if (step.radius > 0.0) place_on_contours(step, step.contour);
}

void GlyphEditor::place(const CharacterStep& step, double) {
  if (!step.library) throw RequestError(step.library_path + ": the library of a character step is not loaded");
  if (step.gain != 0.0 || !step.adds) place_on_contours(step, step.contour);
}

void GlyphEditor::place(const RepeatStep& step, double) {
  if (!step.edit) throw RequestError(step.library_path + ": the edit of a repeat step is not loaded");
  place_on_contours(step, step.contour);
}

void GlyphEditor::place(WeightStep step, double unit) {
  step.detail_scale *= unit;
  if (!step.amounts) throw RequestError(step.model_path + ": the amounts of a weight step are not told");
  if (!original_.empty() && !is_nothing(*step.amounts)) steps_.push_back({step, 0});
}

void GlyphEditor::place_on_contours(const Step& step, std::optional<int> contour) {
  if (contour) {
    steps_.push_back({step, checked(*contour)});
    return;
  }
  for (std::size_t k = 0; k < original_.size(); ++k) {  // what has no inside is carried through
    if (has_inside(original_[k])) steps_.push_back({step, static_cast<int>(k)});
  }
}

void GlyphEditor::place(const Freeze& freeze, double unit) {
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

void GlyphEditor::add_frozen(std::size_t contour, fontcore::Rows rows) {
  std::move(rows.begin(), rows.end(), std::back_inserter(frozen_[contour]));
}

int GlyphEditor::checked(int contour) const {
  const int count = static_cast<int>(original_.size());
  if (contour >= count) throw Refusal{text("there is no contour ", contour, ": it has ", count)};
  return contour;
}

int GlyphEditor::nearest_contour(const Point& place) const {
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

fontcore::Corners GlyphEditor::corners() const {
  return recipe_.keep.corners ? fontcore::Corners::Keep : fontcore::Corners::Round;
}

fontcore::OutlineRules GlyphEditor::rules_of(std::size_t index) const {
  fontcore::OutlineRules rules = rules_;
  rules.corners = marked_corners(index);
  return rules;
}

// The model of a contour; of one that no step has touched yet it is made once for all amounts.
fontcore::OutlineCurve GlyphEditor::curve_of(int index, const BezierContour& contour) {
  auto& known = curves_[static_cast<std::size_t>(index)];
  if (known && contour == known->contour()) return *known;
  fontcore::OutlineCurve curve(contour, {.tolerance = model_tolerance * font_.units_per_em,
                                         .corners = marked_corners(static_cast<std::size_t>(index))});
  if (!known) known = curve;
  return curve;
}

// The wish of a sweep, and what the report says of it.
void GlyphEditor::wish(const SweepStep& step, double amount, const fontcore::OutlineCurve& curve,
                       fontcore::StructureEdit& edit, StepReport& report) const {
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
fontcore::ArcSmoothing GlyphEditor::smoothing(const Step& step, const fontcore::OutlineArcs& outline,
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

void GlyphEditor::hold_corners(const fontcore::OutlineArcs& outline, fontcore::StructureEdit& edit) {
  for (int s = 0; s < outline.contour().segment_count(); ++s) {
    if (!outline.is_corner(s)) continue;
    const fontcore::Rows rows = fontcore::rows(outline.contour(), fontcore::FrozenPoint{outline.contour().node(s)});
    edit.rows.insert(edit.rows.end(), rows.begin(), rows.end());
  }
}

// The segment that starts at a point of the font's contour, given by its number there.
int GlyphEditor::segment_at(int number, int index) const {
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
StepReport GlyphEditor::soften(const SoftenStep& step, int index, double amount, BezierContour& contour) {
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
void GlyphEditor::take_over(const BezierContour& made, std::vector<int> came_from, int index, BezierContour& contour) {
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
StepReport GlyphEditor::weighed(const WeightStep& step, double amount, Contours& contours) {
  StepReport report;
  report.op = "weight";
  fontcore::Weighted made =
      apply_weight(font_, id_, contours, *step.model, *step.amounts,
                   {.share = amount, .italic_angle = rules_.frame.italic_angle, .detail_scale = step.detail_scale});
  report.share = made.amount;
  report.held_segments = made.held_segments;
  report.sides = {made.left_side, made.right_side};
  if (made.amount == 0.0) {
    if (amount > 0.0) report.against.emplace_back("a crossing, a closed counter or lost ink: nothing of it is applied");
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
BezierContour GlyphEditor::held(const BezierContour& contour, const BezierContour& wished, std::size_t index) const {
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
StepReport GlyphEditor::character(const CharacterStep& step, int index, double amount, BezierContour& contour) {
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

StepReport GlyphEditor::apply(const PlacedStep& placed, double amount, Contours& contours,
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

fontcore::StructureFit GlyphEditor::swept(const SweepStep& step, double amount, const BezierContour& contour,
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

fontcore::StructureFit GlyphEditor::repeated(const RepeatStep& step, double amount, const BezierContour& contour,
                                             const fontcore::StructureEdit& edit, StepReport& report) const {
  report.op = "repeat";
  const auto index = static_cast<std::size_t>(report.contour);
  const std::vector<fontcore::OutlineArcs> outlines{fontcore::OutlineArcs(contour, {.corners = marked_corners(index)})};
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

fontcore::StructureFit GlyphEditor::smoothed(const Step& step, double amount, const BezierContour& contour,
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

}  // namespace glyphs
