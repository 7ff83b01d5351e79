#include "glyphs/font.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <set>
#include <unordered_map>

#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::text;

bool is_glyph(const Font& font, int glyph) {
  return glyph >= 0 && static_cast<std::size_t>(glyph) < font.glyphs.size();
}

const Glyph& glyph_at(const Font& font, int glyph) {
  if (!is_glyph(font, glyph)) {
    throw FontReadError(text(font.path, ": there is no glyph ", glyph, " among ", font.glyphs.size()));
  }
  return font.glyphs[static_cast<std::size_t>(glyph)];
}

/// Composes one glyph. Points and components are budgeted, so that parts sharing parts cannot multiply without end.
class Composer {
 public:
  Composer(const Font& font, int glyph) : font_(font), name_(glyph_at(font, glyph).name) {}

  std::vector<BezierContour> placed(int id, int depth) {
    const Glyph& glyph = glyph_at(font_, id);
    if (!glyph.trouble.empty()) fail(text(glyph.name == name_ ? "" : "component " + glyph.name + ": ", glyph.trouble));
    for (const BezierContour& contour : glyph.contours) spend_points(contour);
    if (!glyph.is_composite()) return glyph.contours;
    if (depth == max_component_depth) {
      fail(text("components nest deeper than ", max_component_depth, " or in a cycle, at ", glyph.name));
    }
    std::vector<BezierContour> all = glyph.contours;
    for (const Component& part : glyph.components) {
      if (++parts_ > max_composed_points) fail(text("more than ", max_composed_points, " components"));
      if (!is_glyph(font_, part.glyph)) fail(text("component ", part.glyph, " is no glyph of the font"));
      std::vector<BezierContour> contours = placed(part.glyph, depth + 1);
      for (BezierContour& contour : contours) contour = transform(contour, part.placement);
      if (part.matched_parent >= 0) {
        const Point parent = stored_point(all, part.matched_parent, glyph);
        const fontcore::Affine onto{.shift = parent - stored_point(contours, part.matched_child, glyph)};
        for (BezierContour& contour : contours) contour = transform(contour, onto);
      }
      std::move(contours.begin(), contours.end(), std::back_inserter(all));
    }
    return all;
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw FontReadError(text(font_.path, ": ", name_, ": ", why));
  }

  void spend_points(const BezierContour& contour) {
    points_ += stored_points(contour);
    if (points_ > max_composed_points) fail(text("more than ", max_composed_points, " points"));
  }

  Point stored_point(const std::vector<BezierContour>& contours, int wanted, const Glyph& glyph) const {
    int index = wanted;
    for (const BezierContour& contour : contours) {
      for (int i = 0; i < contour.point_count(); ++i) {
        if (contour.kind(i) != PointKind::ImpliedNode && index-- == 0) return contour.point(i);
      }
    }
    fail(text("point ", wanted, " to be matched does not exist, in ", glyph.name));
  }

  const Font& font_;
  const std::string& name_;
  std::ptrdiff_t points_ = 0;
  int parts_ = 0;
};

}  // namespace

int Font::find(const std::string& name) const {
  const auto at = std::find_if(glyphs.begin(), glyphs.end(), [&](const Glyph& g) { return g.name == name; });
  return at == glyphs.end() ? -1 : static_cast<int>(at - glyphs.begin());
}

bool Font::has_outline(int glyph) const {
  std::set<int> seen{glyph};
  std::vector<int> open{glyph};
  while (!open.empty()) {
    const int id = open.back();
    open.pop_back();
    if (!is_glyph(*this, id)) continue;
    const Glyph& g = glyphs[static_cast<std::size_t>(id)];
    if (!g.contours.empty()) return true;
    for (const Component& part : g.components) {
      if (seen.insert(part.glyph).second) open.push_back(part.glyph);
    }
  }
  return false;
}

std::vector<BezierContour> compose(const Font& font, int glyph) {
  std::vector<BezierContour> contours = Composer(font, glyph).placed(glyph, 0);
  if (const double origin = glyph_at(font, glyph).origin; origin != 0.0) {
    for (BezierContour& contour : contours) contour = transform(contour, {.shift = Point(-origin, 0.0)});
  }
  return contours;
}

std::vector<BezierContour> decompose(const Font& font, int glyph) {
  std::vector<BezierContour> contours = Composer(font, glyph).placed(glyph, 0);
  if (!glyph_at(font, glyph).is_composite()) return contours;
  for (BezierContour& contour : contours) {
    fontcore::Points points = contour.points();
    const Eigen::Index n = points.rows();
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index axis = 0; axis < 2; ++axis) points(i, axis) = std::floor(points(i, axis) + 0.5);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      if (contour.kind(static_cast<int>(i)) != PointKind::ImpliedNode) continue;
      points.row(i) = 0.5 * (points.row((i + n - 1) % n) + points.row((i + 1) % n));
    }
    contour = contour.with_points(points);
  }
  return contours;
}

std::vector<int> dependents(const Font& font, const std::vector<int>& glyphs) {
  std::vector<std::vector<int>> users(font.glyphs.size());
  for (std::size_t user = 0; user < font.glyphs.size(); ++user) {
    for (const Component& part : font.glyphs[user].components) {
      if (is_glyph(font, part.glyph)) users[static_cast<std::size_t>(part.glyph)].push_back(static_cast<int>(user));
    }
  }
  std::vector<bool> is_reached(font.glyphs.size(), false);
  std::vector<int> reached;
  const auto reach = [&](int glyph) {
    const auto index = static_cast<std::size_t>(glyph);
    if (!is_glyph(font, glyph) || is_reached[index]) return;
    is_reached[index] = true;
    reached.push_back(glyph);
  };
  for (const int glyph : glyphs) reach(glyph);
  for (std::size_t i = 0; i < reached.size(); ++i) {
    for (const int user : users[static_cast<std::size_t>(reached[i])]) reach(user);
  }
  std::sort(reached.begin(), reached.end());
  return reached;
}

void check_composites(Font& font) {
  struct Extent {
    std::int64_t points = 0;
    std::int64_t parts = 0;
    std::int64_t work = 0;  // points and components placed at every level, and points counted off
    int depth = 0;
    double reach = 0.0;  // no coordinate is larger
  };
  const std::size_t count = font.glyphs.size();
  const auto index = [](int glyph) { return static_cast<std::size_t>(glyph); };
  std::vector<Extent> extent(count);
  std::vector<std::vector<int>> users(count);
  std::vector<std::size_t> open(count, 0);
  std::vector<int> ready;
  const auto refuse = [](Glyph& glyph, const std::string& why) {
    glyph.trouble = why;
    glyph.contours.clear();
    glyph.components.clear();
    glyph.marks.clear();
  };
  for (Glyph& glyph : font.glyphs) {
    for (const Component& part : glyph.components) {
      if (part.glyph < 0 || index(part.glyph) >= count) {
        refuse(glyph, text("component ", part.glyph, " is no glyph of the font, which has ", count));
        break;
      }
    }
    for (const BezierContour& contour : glyph.contours) {
      extent[index(glyph.id)].points += stored_points(contour);
      double& reach = extent[index(glyph.id)].reach;
      reach = std::max(reach, contour.points().cwiseAbs().maxCoeff());
    }
    for (const Component& part : glyph.components) users[index(part.glyph)].push_back(glyph.id);
    open[index(glyph.id)] = glyph.components.size();
    if (glyph.components.empty()) ready.push_back(glyph.id);
  }
  std::int64_t work = 0;  // of all composites
  const auto settle = [&](Glyph& glyph) {
    Extent& own = extent[index(glyph.id)];
    for (const Component& part : glyph.components) {
      const Glyph& child = font.glyphs[index(part.glyph)];
      const Extent& its = extent[index(part.glyph)];
      if (!child.trouble.empty()) return refuse(glyph, text("component ", child.name, " cannot be read"));
      if (part.matched_parent >= 0 && (part.matched_parent >= own.points || part.matched_child >= its.points)) {
        return refuse(glyph, text("component ", child.name, " matches its point ", part.matched_child, " of ",
                                  its.points, " to point ", part.matched_parent, " of ", own.points));
      }
      const double placed = part.placement.linear.cwiseAbs().rowwise().sum().maxCoeff() * its.reach +
                            part.placement.shift.cwiseAbs().maxCoeff();
      own.reach = part.matched_parent >= 0 ? own.reach + 2.0 * placed : std::max(own.reach, placed);
      if (!(own.reach <= max_coordinate)) {
        return refuse(glyph, text("component ", child.name, " is placed beyond ", max_coordinate, " units"));
      }
      own.points += its.points;
      own.parts += its.parts + 1;
      own.work += its.work + its.points + 1;
      if (part.matched_parent >= 0) own.work += part.matched_parent + part.matched_child;  // counted off to be found
      own.depth = std::max(own.depth, its.depth + 1);
      if (own.depth > max_component_depth) {
        return refuse(glyph, text("components nest deeper than ", max_component_depth));
      }
      if (own.points > max_composed_points) return refuse(glyph, text("more than ", max_composed_points, " points"));
      if (own.parts > max_composed_points) return refuse(glyph, text("more than ", max_composed_points, " components"));
    }
    if (work + own.work > max_composed_work) {
      return refuse(glyph, text("the font's composites place more than ", max_composed_work, " points"));
    }
    work += own.work;
    // The phantom points of a component that lends its metrics carry the origin along.
    for (const Component& part : glyph.components) {
      if (part.use_my_metrics) glyph.origin = font.glyphs[index(part.glyph)].origin;
    }
  };
  for (std::size_t i = 0; i < ready.size(); ++i) {
    settle(font.glyphs[index(ready[i])]);
    for (const int user : users[index(ready[i])]) {
      if (--open[index(user)] == 0) ready.push_back(user);
    }
  }
  for (Glyph& glyph : font.glyphs) {
    if (open[index(glyph.id)] > 0) refuse(glyph, "its components form a cycle, or lead to one");
  }
}

std::vector<int> first_alike(const Font& font) {
  std::unordered_multimap<std::uint64_t, int> firsts;
  std::vector<int> result;
  for (const Glyph& glyph : font.glyphs) {
    std::uint64_t hash = std::bit_cast<std::uint64_t>(glyph.origin);
    for (const fontcore::BezierContour& contour : glyph.contours) {
      for (const double coordinate : contour.points().reshaped()) {
        hash = (hash ^ std::bit_cast<std::uint64_t>(coordinate)) * 0x100000001B3U;
      }
    }
    int first = glyph.id;
    const auto [begin, end] = firsts.equal_range(hash);
    for (auto at = begin; at != end && first == glyph.id; ++at) {
      const Glyph& other = font.glyphs[static_cast<std::size_t>(at->second)];
      if (other.contours == glyph.contours && other.origin == glyph.origin) first = other.id;
    }
    if (first == glyph.id) firsts.emplace(hash, first);
    result.push_back(first);
  }
  return result;
}

std::int64_t stored_points(const BezierContour& contour) {
  return contour.point_count() - std::ranges::count(contour.kinds(), PointKind::ImpliedNode);
}

std::int64_t stored_points(const std::vector<BezierContour>& contours) {
  std::int64_t points = 0;
  for (const BezierContour& contour : contours) points += stored_points(contour);
  return points;
}

std::int64_t drawn_points(const Font& font, const std::vector<int>& glyphs) {
  constexpr std::int64_t bytes_a_point = 4;
  const std::vector<int> first = first_alike(font);
  std::set<int> counted;
  std::int64_t points = 0;
  for (const int id : glyphs) {
    if (!counted.insert(first[static_cast<std::size_t>(id)]).second) continue;
    for (const auto& contour : font.glyphs[static_cast<std::size_t>(id)].contours) points += contour.point_count();
  }
  if (font.data) points = std::min(points, static_cast<std::int64_t>(font.data->size()) / bytes_a_point);
  return points;
}

int matched_in(const Font& font, int glyph) {
  const std::vector<int> users = dependents(font, {glyph});
  for (const int user : users) {
    bool has_passed = false;  // a part that draws the glyph
    for (const Component& part : glyph_at(font, user).components) {
      has_passed = has_passed || std::binary_search(users.begin(), users.end(), part.glyph);
      if (has_passed && part.matched_parent >= 0) return user;
    }
  }
  return -1;
}

std::vector<std::string> glyph_names(const Font& font, const std::vector<int>& ids) {
  std::vector<std::string> names;
  for (const int id : ids) names.push_back(font.glyphs[static_cast<std::size_t>(id)].name);
  return names;
}

}  // namespace glyphs
