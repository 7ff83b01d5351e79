#include "glyphs/spacing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "fontcore/measure.h"
#include "glyphs/error.h"
#include "glyphs/sfnt_tables.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Box;
using fontcore::Point;

constexpr double half_width = 0.5;  // of the narrower part: it is over or under the other, not beside it

double round_half_up(double value) { return std::floor(value + 0.5); }
double middle(const Box& box) { return 0.5 * (box.low.x() + box.high.x()); }
double width(const Box& box) { return box.high.x() - box.low.x(); }

Box placed(const Box& box, const fontcore::Affine& placement) {
  Box result;
  if (box.is_empty()) return result;
  for (const double x : {box.low.x(), box.high.x()}) {
    for (const double y : {box.low.y(), box.high.y()}) result.add(placement(Point(x, y)));
  }
  return result;
}

bool has_matched_parts(const Glyph& glyph) {
  return std::ranges::any_of(glyph.components, [](const Component& part) { return part.matched_parent >= 0; });
}

// A part of a composite, as it is placed.
struct Part {
  std::size_t index = 0;
  Box before;
  Box after;  // where it would be if its offset stayed
  SideGrowth growth;
  double shift = 0.0;  // of its offset
  int over = -1;       // the part that it stands over or under
};

class Spacer {
 public:
  Spacer(const Font& font, EditedGlyphs edited, AdvancePolicy policy, const std::map<int, SideGrowth>& growth,
         const std::optional<std::vector<int>>& only)
      : font_(font), policy_(policy), growth_(growth), only_(only), before_(font.glyphs.size()) {
    result_.outlines = std::move(edited);
    for (const Glyph& glyph : font.glyphs) after_.push_back(before(glyph.id));
  }

  Spacing spaced() {
    if (policy_ == AdvancePolicy::Scale) find_ratio();
    for (const Glyph& glyph : font_.glyphs) {
      if (!glyph.trouble.empty()) continue;
      const bool is_decomposed = glyph.contours.empty() && result_.outlines.contains(glyph.id);
      if (glyph.is_composite() && !is_decomposed) {
        open_.insert(glyph.id);
      } else {
        place(glyph);
      }
    }
    while (!open_.empty()) follow(*open_.begin());
    for (const Glyph& glyph : font_.glyphs) {
      if (!glyph.anchors.empty()) move_anchors(glyph);
    }
    std::ranges::sort(result_.kept_composites);
    return std::move(result_);
  }

 private:
  const Glyph& glyph_at(int id) const { return font_.glyphs[static_cast<std::size_t>(id)]; }
  bool is_chosen(int id) const { return !only_ || std::ranges::binary_search(*only_, id); }
  double advance_after(int id) const {
    const auto advance = result_.advances.find(id);
    return advance == result_.advances.end() ? glyph_at(id).advance : advance->second;
  }
  Box& after(int id) { return after_[static_cast<std::size_t>(id)]; }

  // The box of what a glyph draws, in its own stored coordinates.
  const Box& before(int id) {
    std::optional<Box>& known = before_[static_cast<std::size_t>(id)];
    if (known) return *known;
    Box box = tight_box(glyph_at(id).contours);
    for (const Component& part : glyph_at(id).components) box.add(placed(before(part.glyph), part.placement));
    known = box;
    return *known;
  }

  void find_ratio() {
    double old_width = 0.0;
    double new_width = 0.0;
    for (const auto& [id, contours] : result_.outlines) {
      if (glyph_at(id).advance <= 0.0 || before(id).is_empty()) continue;
      old_width += width(before(id));
      new_width += width(tight_box(contours));
    }
    if (old_width > 0.0) result_.ratio = new_width / old_width;
  }

  void set_advance(const Glyph& glyph, double advance) {
    const double whole = std::max(0.0, round_half_up(advance));
    if (whole != round_half_up(glyph.advance)) result_.advances[glyph.id] = whole;
  }

  // A glyph without components on its advance.
  void place(const Glyph& glyph) {
    const auto edited = result_.outlines.find(glyph.id);
    const bool is_edited = edited != result_.outlines.end();
    if (policy_ == AdvancePolicy::Scale && is_chosen(glyph.id)) {
      set_advance(glyph, result_.ratio * glyph.advance);
    } else if (!is_edited) {
      return;
    }
    const Box& old = before(glyph.id);
    if (old.is_empty()) return;
    const Box now = is_edited ? tight_box(edited->second) : old;
    double shift = 0.0;
    if (policy_ == AdvancePolicy::Scale) {
      const double origin = glyph.origin;
      shift = round_half_up(origin + result_.ratio * (middle(old) - origin) - middle(now));
    } else if (policy_ != AdvancePolicy::Keep && glyph.advance > 0.0) {
      const SideGrowth sides = side_growth_[glyph.id] = growth_of(glyph.id);
      shift = round_half_up(old.low.x() + sides.left - now.low.x());
      set_advance(glyph, now.high.x() + shift + glyph.advance - old.high.x() + sides.right);
    }
    if (shift != 0.0) {
      auto& contours = result_.outlines[glyph.id];
      if (!is_edited) contours = glyph.contours;
      for (BezierContour& contour : contours) contour = transform(contour, {.shift = Point(shift, 0.0)});
    }
    after(glyph.id) = placed(now, {.shift = Point(shift, 0.0)});
  }

  SideGrowth growth_of(int id) const {
    const auto growth = growth_.find(id);
    return policy_ == AdvancePolicy::Learnt && growth != growth_.end() ? growth->second : SideGrowth{};
  }

  // A composite after its parts.
  void follow(int id) {
    open_.erase(id);
    const Glyph& glyph = glyph_at(id);
    for (const Component& part : glyph.components) {
      if (open_.contains(part.glyph)) follow(part.glyph);
    }
    std::vector<Part> parts;
    bool is_touched = false;
    for (std::size_t k = 0; k < glyph.components.size(); ++k) {
      const Component& component = glyph.components[k];
      const Box& old = before(component.glyph);
      is_touched = is_touched || old.low != after(component.glyph).low || old.high != after(component.glyph).high ||
                   result_.advances.contains(component.glyph);
      if (old.is_empty() || after(component.glyph).is_empty()) continue;
      Part& part = parts.emplace_back();
      part.index = k;
      part.before = placed(old, component.placement);
      part.after = placed(after(component.glyph), component.placement);
      const double across = component.placement.linear(0, 0);
      part.growth = side_growth_[component.glyph];
      if (across < 0.0) std::swap(part.growth.left, part.growth.right);
      part.growth.left *= std::abs(across);
      part.growth.right *= std::abs(across);
    }
    const auto edited = result_.outlines.find(id);
    const bool has_own = !glyph.contours.empty();  // of a UFO
    if (edited != result_.outlines.end() || has_own) {
      const Box own = edited != result_.outlines.end() ? tight_box(edited->second) : tight_box(glyph.contours);
      Box box = own;
      for (const Part& part : parts) box.add(part.after);
      after(id) = box;
      return;
    }
    const bool scales = policy_ == AdvancePolicy::Scale && is_chosen(id);
    if (!is_touched && !scales) return;
    const int base = base_of(glyph);
    if (has_matched_parts(glyph)) {
      if (base >= 0) set_advance(glyph, advance_after(base));
      if (base < 0 && policy_ != AdvancePolicy::Keep) result_.kept_composites.push_back(id);
    } else if (policy_ == AdvancePolicy::Scale) {
      for (Part& part : parts) part.shift = result_.ratio * middle(part.before) - middle(part.after);
      if (scales) set_advance(glyph, result_.ratio * glyph.advance);
    } else if (policy_ != AdvancePolicy::Keep && !parts.empty()) {
      set_apart(glyph, base, parts);
    }
    std::vector<Point> shifts(glyph.components.size(), Point::Zero());
    Box box;
    bool is_moved = false;
    for (Part& part : parts) {
      part.shift = round_half_up(part.shift);
      is_moved = is_moved || part.shift != 0.0;
      shifts[part.index].x() = part.shift;
      box.add(placed(part.after, {.shift = Point(part.shift, 0.0)}));
    }
    after(id) = box;
    if (is_moved) result_.component_shifts[id] = std::move(shifts);
  }

  // The glyph whose advance a composite has: a part that lends its metrics, or one that stands unmoved and has it.
  int base_of(const Glyph& glyph) const {
    for (const Component& part : glyph.components) {
      if (part.use_my_metrics) return part.glyph;
    }
    for (const Component& part : glyph.components) {
      const bool is_unmoved =
          part.placement.linear == fontcore::Affine().linear && part.placement.shift == Point::Zero();
      if (is_unmoved && glyph.advance > 0.0 && glyph_at(part.glyph).advance == glyph.advance) return part.glyph;
    }
    return -1;
  }

  // Parts that stand beside each other keep their gaps, those over others their middles; the base stays.
  void set_apart(const Glyph& glyph, int base, std::vector<Part>& parts) {
    std::vector<std::size_t> order(parts.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    const auto is_base = [&](const Part& part) { return glyph.components[part.index].glyph == base; };
    std::ranges::stable_sort(order, [&](std::size_t i, std::size_t k) {
      if (is_base(parts[i]) != is_base(parts[k])) return is_base(parts[i]);
      return width(parts[i].before) > width(parts[k].before);
    });
    std::vector<std::size_t> row;  // parts that stand beside each other
    for (const std::size_t i : order) {
      Part& part = parts[i];
      for (const std::size_t other : row) {
        const Box& beside = parts[other].before;
        const double common =
            std::min(part.before.high.x(), beside.high.x()) - std::max(part.before.low.x(), beside.low.x());
        if (common >= half_width * std::min(width(part.before), width(beside))) part.over = static_cast<int>(other);
        if (part.over >= 0) break;
      }
      if (part.over < 0) row.push_back(i);
    }
    const std::size_t fixed =
        base >= 0 ? row.front()
                  : *std::ranges::min_element(row, {}, [&](std::size_t i) { return parts[i].before.low.x(); });
    std::ranges::stable_sort(row, {}, [&](std::size_t i) { return parts[i].before.low.x(); });
    const auto at = std::ranges::find(row, fixed) - row.begin();
    for (auto i = at + 1; i < std::ssize(row); ++i) {
      const Part& left = parts[row[static_cast<std::size_t>(i) - 1]];
      Part& part = parts[row[static_cast<std::size_t>(i)]];
      const double gap = part.before.low.x() - left.before.high.x() + left.growth.right + part.growth.left;
      part.shift = left.after.high.x() + left.shift + gap - part.after.low.x();
    }
    for (auto i = at - 1; i >= 0; --i) {
      const Part& right = parts[row[static_cast<std::size_t>(i) + 1]];
      Part& part = parts[row[static_cast<std::size_t>(i)]];
      const double gap = right.before.low.x() - part.before.high.x() + part.growth.right + right.growth.left;
      part.shift = right.after.low.x() + right.shift - gap - part.after.high.x();
    }
    for (Part& part : parts) {
      if (part.over < 0) continue;
      const Part& under = parts[static_cast<std::size_t>(part.over)];
      part.shift = middle(under.after) + under.shift - middle(under.before) - middle(part.after) + middle(part.before);
    }
    const auto low = [](const Part& part) { return part.before.low.x(); };
    const auto high = [](const Part& part) { return part.before.high.x(); };
    const SideGrowth sides{std::ranges::min_element(parts, {}, low)->growth.left,
                           std::ranges::max_element(parts, {}, high)->growth.right};
    side_growth_[glyph.id] = sides;
    if (base >= 0) {
      set_advance(glyph, advance_after(base));
      return;
    }
    Box old;
    Box now;
    for (const Part& part : parts) {
      old.add(part.before);
      now.add(placed(part.after, {.shift = Point(part.shift, 0.0)}));
    }
    const double shift = round_half_up(old.low.x() + sides.left - now.low.x());
    for (Part& part : parts) part.shift += shift;
    if (glyph.advance > 0.0) set_advance(glyph, now.high.x() + shift + glyph.advance - old.high.x() + sides.right);
  }

  // The map of a line that takes places to others, linear in between and outside moved like the nearest.
  static double mapped(const std::vector<std::pair<double, double>>& places, double value) {
    if (places.empty()) return value;
    if (value <= places.front().first) return value + places.front().second - places.front().first;
    for (std::size_t i = 1; i < places.size(); ++i) {
      const auto& [from, to] = places[i - 1];
      const auto& [next, next_to] = places[i];
      if (value <= next) return to + (value - from) * (next_to - to) / (next - from);
    }
    return value + places.back().second - places.back().first;
  }

  void move_anchors(const Glyph& glyph) {
    const Box& old = before(glyph.id);
    const Box& now = after(glyph.id);
    if (old.is_empty() || now.is_empty()) return;
    std::vector<std::pair<double, double>> across;
    const auto add = [](std::vector<std::pair<double, double>>& places, double from, double to) {
      if (places.empty() || from > places.back().first) places.emplace_back(from, to);
    };
    if (old.low.x() > glyph.origin) add(across, glyph.origin, glyph.origin);
    add(across, old.low.x(), now.low.x());
    add(across, old.high.x(), now.high.x());
    if (glyph.advance > 0.0) add(across, glyph.origin + glyph.advance, glyph.origin + advance_after(glyph.id));
    std::vector<std::pair<double, double>> upwards;
    add(upwards, old.low.y(), now.low.y());
    add(upwards, old.high.y(), now.high.y());
    std::vector<Point> places;
    for (const Point& anchor : glyph.anchors) {
      const Point to(mapped(across, anchor.x()), mapped(upwards, anchor.y()));
      const auto settled = [](double from, double wanted) {
        return from == std::round(from) ? round_half_up(wanted) : wanted;
      };
      places.emplace_back(settled(anchor.x(), to.x()), settled(anchor.y(), to.y()));
    }
    if (places != glyph.anchors) result_.anchors[glyph.id] = std::move(places);
  }

  const Font& font_;
  AdvancePolicy policy_;
  const std::map<int, SideGrowth>& growth_;
  const std::optional<std::vector<int>>& only_;
  std::vector<std::optional<Box>> before_;
  std::vector<Box> after_;
  std::map<int, SideGrowth> side_growth_;  // of what is placed
  std::set<int> open_;                     // composites that are still to follow
  Spacing result_;
};

bool is_fixed_pitch(const Font& font) {
  if (!font.data) return false;
  const sfnt::Directory directory = sfnt::read_directory(*font.data, font.face_index);
  const sfnt::TableRecord* post = directory.find(sfnt::tag("post"));
  return post && post->bytes.size() >= 16 && sfnt::u32(post->bytes, 12) != 0;
}

}  // namespace

namespace {

constexpr std::array<const char*, 4> policy_names{"keep", "sidebearings", "scale", "learnt"};  // in the enum's order

}  // namespace

AdvancePolicy advance_policy(const std::string& name) {
  const auto* const found = std::ranges::find(policy_names, name);
  if (found != policy_names.end()) return static_cast<AdvancePolicy>(found - policy_names.begin());
  throw RequestError("--advance " + name + ": keep, sidebearings, scale or learnt is expected");
}

const char* name_of(AdvancePolicy policy) { return policy_names[static_cast<std::size_t>(policy)]; }

bool is_monospaced(const Font& font) {
  double advance = 0.0;
  int count = 0;
  bool is_equal = true;
  for (const Glyph& glyph : font.glyphs) {
    if (glyph.advance <= 0.0) continue;
    is_equal = is_equal && (count == 0 || glyph.advance == advance);
    advance = glyph.advance;
    ++count;
  }
  return (count > 1 && is_equal) || is_fixed_pitch(font);
}

Spacing space(const Font& font, EditedGlyphs edited, AdvancePolicy policy, const std::map<int, SideGrowth>& growth,
              const std::optional<std::vector<int>>& only) {
  const bool is_even = policy == AdvancePolicy::Keep || (policy == AdvancePolicy::Scale && !only);
  if (!is_even && is_monospaced(font)) {
    throw RequestError(font.path +
                       ": is monospaced: its advances stay equal with --advance keep, or scale for all glyphs at once");
  }
  if (edited.empty()) return {};
  return Spacer(font, std::move(edited), policy, growth, only).spaced();
}

}  // namespace glyphs
