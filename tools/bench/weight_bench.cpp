// How near a weight learnt from a few letters comes to the drawn one: for every letter that was no control the
// symmetric difference to the Bold's as a share of its area, and the area error, beside those of other tools.
//
//   weight_bench REGULAR BOLD [LETTERS] [--prior none|FILE] [--leave-out FAMILY] [--from REGULAR BOLD] [--no-peers]
//
// LETTERS are the control letters, noHO unless given; the prior is the built-in one unless another is given, or none,
// or with --leave-out one that is made anew without a family (by weight_prior.sh, from the fonts that are installed).
// With --from the step is learnt from another pair and carried to REGULAR with its n and o drawn in BOLD.
//
// The other tools have their one strength fitted on n and o: an offset by FreeType's stroker, FreeType's
// FT_Outline_EmboldenXY as it is and with heights restored, and FontForge's changeWeight where it is installed.

#include <ft2build.h>
#include FT_FREETYPE_H
#include FT_OUTLINE_H
#include FT_STROKER_H

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/reweight.h"
#include "glyphs/weight_proof.h"

namespace {

using Contours = std::vector<fontcore::BezierContour>;
using fontcore::Affine;
using fontcore::Box;
using fontcore::Point;
using fontcore::PointKind;
using glyphs::Font;

const std::string alphabet = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
const std::string fitted_on = "no";

int glyph_of(const Font& font, char letter) {
  const auto found = font.character_map.find(static_cast<char32_t>(letter));
  return found == font.character_map.end() ? -1 : found->second;
}

Contours mapped(const Contours& contours, const Affine& map) {
  Contours result;
  for (const fontcore::BezierContour& contour : contours) result.push_back(transform(contour, map));
  return result;
}

// ---- FreeType's outlines

constexpr double sixty_fourths = 64.0;

struct Library {
  Library() {
    if (FT_Init_FreeType(&handle) != 0) throw std::runtime_error("FreeType does not start");
  }
  ~Library() { FT_Done_FreeType(handle); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  FT_Library handle = nullptr;
};

// An outline of FreeType, of our contours or with room for its own.
class FreeTypeOutline {
 public:
  FreeTypeOutline(const Library& library, FT_UInt points, FT_Int contours) : library_(library) {
    if (FT_Outline_New(library.handle, points, contours, &outline_) != 0) throw std::runtime_error("FT_Outline_New");
    outline_.n_points = 0;
    outline_.n_contours = 0;
  }
  FreeTypeOutline(const Library& library, const Contours& contours)
      : FreeTypeOutline(library, count(contours), static_cast<FT_Int>(contours.size())) {
    for (const fontcore::BezierContour& contour : contours) {
      for (int i = 0; i < contour.point_count(); ++i) {
        if (contour.kind(i) == PointKind::ImpliedNode) continue;
        const Point p = sixty_fourths * contour.point(i);
        outline_.points[outline_.n_points] = {std::lround(p.x()), std::lround(p.y())};
        outline_.tags[outline_.n_points++] = contour.kind(i) == PointKind::Node        ? FT_CURVE_TAG_ON
                                             : contour.kind(i) == PointKind::Quadratic ? FT_CURVE_TAG_CONIC
                                                                                       : FT_CURVE_TAG_CUBIC;
      }
      outline_.contours[outline_.n_contours++] = static_cast<short>(outline_.n_points - 1);
    }
  }
  ~FreeTypeOutline() { FT_Outline_Done(library_.handle, &outline_); }
  FreeTypeOutline(const FreeTypeOutline&) = delete;
  FreeTypeOutline& operator=(const FreeTypeOutline&) = delete;

  FT_Outline* get() { return &outline_; }

  Contours contours() {
    FT_Outline_Funcs pen{};
    pen.move_to = [](const FT_Vector* to, void* made) {
      static_cast<Pen*>(made)->start(*to);
      return 0;
    };
    pen.line_to = [](const FT_Vector* to, void* made) {
      static_cast<Pen*>(made)->add({{*to, PointKind::Node}});
      return 0;
    };
    pen.conic_to = [](const FT_Vector* handle, const FT_Vector* to, void* made) {
      static_cast<Pen*>(made)->add({{*handle, PointKind::Quadratic}, {*to, PointKind::Node}});
      return 0;
    };
    pen.cubic_to = [](const FT_Vector* first, const FT_Vector* second, const FT_Vector* to, void* made) {
      static_cast<Pen*>(made)->add({{*first, PointKind::Cubic}, {*second, PointKind::Cubic}, {*to, PointKind::Node}});
      return 0;
    };
    Pen made;
    FT_Outline_Decompose(&outline_, &pen, &made);
    made.finish();
    return std::move(made.contours);
  }

 private:
  static FT_UInt count(const Contours& contours) {
    FT_UInt points = 0;
    for (const fontcore::BezierContour& contour : contours) points += static_cast<FT_UInt>(contour.point_count());
    return points;
  }

  struct Pen {
    Contours contours;
    std::vector<Point> points;
    std::vector<PointKind> kinds;

    void start(const FT_Vector& to) {
      finish();
      add({{to, PointKind::Node}});
    }
    void add(std::initializer_list<std::pair<FT_Vector, PointKind>> more) {
      for (const auto& [p, kind] : more) {
        points.emplace_back(static_cast<double>(p.x) / sixty_fourths, static_cast<double>(p.y) / sixty_fourths);
        kinds.push_back(kind);
      }
    }
    void finish() {
      if (points.size() > 1 && points.back() == points.front()) {  // it ends where it starts
        points.pop_back();
        kinds.pop_back();
      }
      if (points.size() > 1) {
        fontcore::Points rows(static_cast<Eigen::Index>(points.size()), 2);
        for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
        contours.emplace_back(std::move(rows), kinds);
      }
      points.clear();
      kinds.clear();
    }
  };

  const Library& library_;
  FT_Outline outline_{};
};

FT_Pos in_sixty_fourths(double units) { return std::lround(sixty_fourths * units); }

Contours offset(const Library& library, const Contours& contours, double units) {
  FreeTypeOutline outline(library, contours);
  FT_Stroker stroker = nullptr;
  if (FT_Stroker_New(library.handle, &stroker) != 0) throw std::runtime_error("FT_Stroker_New");
  FT_Stroker_Set(stroker, in_sixty_fourths(units), FT_STROKER_LINECAP_BUTT, FT_STROKER_LINEJOIN_MITER_FIXED, 4 << 16);
  FT_Stroker_ParseOutline(stroker, outline.get(), 0);
  const FT_StrokerBorder border = FT_Outline_GetOutsideBorder(outline.get());
  FT_UInt points = 0;
  FT_UInt ends = 0;
  FT_Stroker_GetBorderCounts(stroker, border, &points, &ends);
  FreeTypeOutline grown(library, points, static_cast<FT_Int>(ends));
  FT_Stroker_ExportBorder(stroker, border, grown.get());
  FT_Stroker_Done(stroker);
  return grown.contours();
}

Contours emboldened(const Library& library, const Contours& contours, double units) {
  FreeTypeOutline outline(library, contours);
  FT_Outline_EmboldenXY(outline.get(), in_sixty_fourths(2.0 * units), in_sixty_fourths(2.0 * units));
  return mapped(outline.contours(), {.shift = Point(-units, -units)});  // it grows to the right and up
}

Contours with_heights(const Contours& contours, const Box& wanted) {
  const Box box = tight_box(contours);
  Affine map;
  map.linear(1, 1) = (wanted.high.y() - wanted.low.y()) / (box.high.y() - box.low.y());
  map.shift.y() = wanted.low.y() - map.linear(1, 1) * box.low.y();
  return mapped(contours, map);
}

// ---- scores

struct Score {
  glyphs::OutlineError error;
  int crossings = 0;  // added
  int counters = 0;   // closed
};
using Scores = std::map<char, Score>;

class Judge {
 public:
  Judge(const Font& regular, const Font& bold) : regular_(regular) {
    Affine to_units;
    to_units.linear *= static_cast<double>(regular.units_per_em) / bold.units_per_em;
    for (const char letter : alphabet) {
      const int from = glyph_of(regular, letter);
      const int to = glyph_of(bold, letter);
      if (from < 0 || to < 0 || !bold.has_outline(to)) continue;
      const Contours& own = regular.glyphs[static_cast<std::size_t>(from)].contours;
      if (!own.empty()) letters_[letter] = {own, mapped(compose(bold, to), to_units)};
    }
  }

  const Font& regular() const { return regular_; }
  bool has(char letter) const { return letters_.contains(letter); }
  const Contours& before(char letter) const { return letters_.at(letter).before; }

  Score score(char letter, const Contours& made) const {
    const auto& [before, drawn] = letters_.at(letter);
    Score score;
    score.error = glyphs::compare_outlines(made, drawn);
    score.crossings = std::max(0, added_crossings(find_crossings(before), find_crossings(made)));
    score.counters = static_cast<int>(closed_counters(measure_ink(before), measure_ink(made)).size());
    return score;
  }

 private:
  struct Letter {
    Contours before;
    Contours drawn;
  };
  const Font& regular_;
  std::map<char, Letter> letters_;
};

// The strength between 0 and the largest that comes nearest on n and o, by golden section.
double fitted(double largest, const std::function<double(double)>& error) {
  constexpr double ratio = 0.6180339887498949;
  constexpr int steps = 14;
  double low = 0.0;
  double high = largest;
  double a = high - ratio * (high - low);
  double b = low + ratio * (high - low);
  double error_a = error(a);
  double error_b = error(b);
  for (int i = 0; i < steps; ++i) {
    if (error_a < error_b) {
      high = b;
      b = a;
      error_b = error_a;
      a = high - ratio * (high - low);
      error_a = error(a);
    } else {
      low = a;
      a = b;
      error_a = error_b;
      b = low + ratio * (high - low);
      error_b = error(b);
    }
  }
  return 0.5 * (low + high);
}

// What a tool of one strength, in font units, makes of a letter.
using Tool = std::function<Contours(char, double)>;

Scores scores_of(const Judge& judge, const std::string& letters, const Tool& tool) {
  const double largest = 0.08 * judge.regular().units_per_em;
  const double strength = fitted(largest, [&](double units) {
    double sum = 0.0;
    for (const char letter : fitted_on) sum += judge.score(letter, tool(letter, units)).error.difference;
    return sum;
  });
  Scores scores;
  for (const char letter : letters) scores[letter] = judge.score(letter, tool(letter, strength));
  return scores;
}

// ---- FontForge

// The letters at a strength, by a child. None if it is not installed.
class FontForge {
 public:
  explicit FontForge(const std::string& font) : font_(std::filesystem::absolute(font)) {
    std::string name = std::filesystem::temp_directory_path() / "weight_bench.XXXXXX";
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder for what FontForge makes");
    folder_ = name;
    is_installed_ = std::system("/usr/bin/python3 -c 'import fontforge' 2>/dev/null") == 0;
  }
  ~FontForge() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  FontForge(const FontForge&) = delete;
  FontForge& operator=(const FontForge&) = delete;

  bool is_installed() const { return is_installed_; }
  Contours letter(char letter, double units) {
    const long rounded = std::lround(units);
    auto known = made_.find(rounded);
    if (known == made_.end()) {
      const std::string out = folder_ + "/made.otf";
      setenv("WEIGHT_BENCH_FONT", font_.c_str(), 1);
      setenv("WEIGHT_BENCH_UNITS", std::to_string(2 * rounded).c_str(), 1);
      setenv("WEIGHT_BENCH_OUT", out.c_str(), 1);
      if (std::system("/usr/bin/python3 " GLYPHWAVE_SOURCE_DIR "/tools/bench/fontforge_weight.py >/dev/null 2>&1") != 0)
        throw std::runtime_error("FontForge does not change the weight by " + std::to_string(2 * rounded));
      known = made_.emplace(rounded, glyphs::load_font(out)).first;
    }
    return compose(known->second, glyph_of(known->second, letter));
  }

 private:
  std::string font_;
  std::string folder_;
  bool is_installed_ = false;
  std::map<long, Font> made_;
};

// ---- the table

struct Column {
  std::string name;
  Scores scores;
};

void print(const std::vector<Column>& columns, const std::string& letters) {
  std::string order = letters;
  const Scores& ours = columns.front().scores;
  std::ranges::stable_sort(order, std::greater{}, [&](char letter) { return ours.at(letter).error.difference; });
  std::printf("error %% (area %%) to the drawn weight\nletter");
  for (const Column& column : columns) std::printf("  %17s", column.name.c_str());
  std::printf("\n");
  for (const char letter : order) {
    std::printf("%-6c", letter);
    for (const Column& column : columns) {
      const glyphs::OutlineError& error = column.scores.at(letter).error;
      std::printf("  %8.2f (%+6.2f)", 100.0 * error.difference, 100.0 * error.area);
    }
    std::printf("\n");
  }
  const auto each = [&](const char* name, const auto& value) {
    std::printf("%-6s", name);
    for (const Column& column : columns) value(column.scores);
    std::printf("\n");
  };
  const auto count = static_cast<double>(order.size());
  each("mean", [&](const Scores& scores) {
    double difference = 0.0;
    double area = 0.0;
    for (const auto& [letter, score] : scores) {
      difference += score.error.difference;
      area += std::abs(score.error.area);
    }
    std::printf("  %8.2f (%6.2f)", 100.0 * difference / count, 100.0 * area / count);
  });
  const auto sum = [&](int Score::*of) {
    return [of](const Scores& scores) {
      int all = 0;
      for (const auto& [letter, score] : scores) all += score.*of;
      std::printf("  %17d", all);
    };
  };
  each("cross", sum(&Score::crossings));
  each("closed", sum(&Score::counters));
  std::printf("mean of %zu letters; cross: crossings added; closed: counters closed\n", order.size());
}

struct Request {
  std::string regular;
  std::string bold;
  std::string controls = "noHO";
  std::string prior;
  std::string left_out;
  std::vector<std::string> from;
  bool has_peers = true;
};

constexpr const char* usage =
    "weight_bench REGULAR BOLD [LETTERS] [--prior none|FILE] [--leave-out FAMILY] [--from REGULAR BOLD] [--no-peers]\n";

std::optional<Request> parsed(const std::vector<std::string>& arguments) {
  Request request;
  std::vector<std::string> words;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    const std::size_t left = arguments.size() - i - 1;
    if (word == "--prior" && left >= 1) {
      request.prior = arguments[++i];
    } else if (word == "--leave-out" && left >= 1) {
      request.left_out = arguments[++i];
    } else if (word == "--from" && left >= 2) {
      request.from = {arguments[i + 1], arguments[i + 2]};
      i += 2;
    } else if (word == "--no-peers") {
      request.has_peers = false;
    } else if (word.starts_with("--")) {
      return std::nullopt;
    } else {
      words.push_back(word);
    }
  }
  if (words.size() < 2 || words.size() > 3) return std::nullopt;
  request.regular = words[0];
  request.bold = words[1];
  if (words.size() == 3) request.controls = words[2];
  return request;
}

// What the prior's own tool makes without a family.
glyphs::WeightPrior prior_without(const std::string& family) {
  setenv("LEAVE_OUT", family.c_str(), 1);
  std::FILE* const tool = popen("sh " GLYPHWAVE_SOURCE_DIR "/tools/bench/weight_prior.sh " GLYPHWAVE_BINARY_DIR, "r");
  if (tool == nullptr) throw std::runtime_error("weight_prior.sh does not start");
  std::string json;
  std::array<char, 4096> buffer{};
  while (const std::size_t read = std::fread(buffer.data(), 1, buffer.size(), tool)) json.append(buffer.data(), read);
  if (pclose(tool) != 0) throw std::runtime_error("weight_prior.sh makes no prior");
  return glyphs::parse_prior(json, "prior without " + family);
}

int run(const std::vector<std::string>& arguments) {
  const std::optional<Request> request = parsed(arguments);
  if (!request) {
    std::fputs(usage, stderr);
    return 2;
  }
  const Font regular = glyphs::load_font(request->regular);
  const Font bold = glyphs::load_font(request->bold);
  const Judge judge(regular, bold);
  std::string controls;
  for (const char letter : request->controls) controls += (controls.empty() ? "" : ",") + std::string(1, letter);
  fontcore::WeightModel model =
      request->from.empty()
          ? glyphs::learn_weight(regular, bold, controls)
          : glyphs::learn_weight(glyphs::load_font(request->from[0]), glyphs::load_font(request->from[1]), controls);
  if (!request->left_out.empty()) {
    take_prior(model, prior_without(request->left_out));
  } else if (request->prior.empty()) {
    take_prior(model, glyphs::latin_prior());
  } else if (request->prior != "none") {
    const glyphs::Bytes bytes = glyphs::read_file(request->prior);
    take_prior(model, glyphs::parse_prior({bytes.begin(), bytes.end()}, request->prior));
  }
  if (!request->from.empty()) model = carry_weight(regular, model, &bold);

  const std::string seen = request->from.empty() ? request->controls : fitted_on;
  std::string letters;
  for (const char letter : alphabet) {
    if (judge.has(letter) && seen.find(letter) == std::string::npos) letters += letter;
  }
  if (letters.empty()) throw std::runtime_error("no letter that is no control is in both fonts");

  std::vector<Column> columns{{"glyphwave", {}}};
  for (const char letter : letters) {
    glyphs::ReweightedGlyph report;
    std::vector<std::vector<int>> came_from;
    const Contours made = reweight_glyph(regular, glyph_of(regular, letter), model, {}, {}, report, came_from);
    columns[0].scores[letter] = judge.score(letter, made);
  }
  columns.push_back({"unchanged", {}});
  for (const char letter : letters) columns[1].scores[letter] = judge.score(letter, judge.before(letter));
  const bool can_fit = std::ranges::all_of(fitted_on, [&](char letter) { return judge.has(letter); });
  if (request->has_peers && can_fit) {
    const Library library;
    columns.push_back({"offset", scores_of(judge, letters, [&](char letter, double units) {
                         return offset(library, judge.before(letter), units);
                       })});
    columns.push_back({"FreeType", scores_of(judge, letters, [&](char letter, double units) {
                         return emboldened(library, judge.before(letter), units);
                       })});
    columns.push_back({"FreeType, heights", scores_of(judge, letters, [&](char letter, double units) {
                         const Contours& before = judge.before(letter);
                         return with_heights(emboldened(library, before, units), tight_box(before));
                       })});
    FontForge fontforge(request->regular);
    if (fontforge.is_installed()) {
      columns.push_back({"FontForge", scores_of(judge, letters, [&](char letter, double units) {
                           return fontforge.letter(letter, units);
                         })});
    } else {
      std::printf("FontForge is left out: python3-fontforge is not installed\n");
    }
  }
  print(columns, letters);
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    return run({arguments + 1, arguments + count});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "weight_bench: %s\n", error.what());
    return 2;
  }
}
