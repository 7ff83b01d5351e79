// How near a weight learnt from a few letters comes to the drawn one: for every letter that was no control the
// symmetric difference to the Bold's as a share of its area, at the best of 15 horizontal shifts, and the area error.
//
//   weight_bench REGULAR BOLD [LETTERS] [--amount-from LETTERS MODEL_REGULAR MODEL_BOLD]
//   weight_bench REGULAR BOLD LETTERS --prior PRIOR.json
//
// With --amount-from the step is learnt from another pair, and its amount fitted on the first letters of REGULAR and
// BOLD.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "fontcore/crossing.h"
#include "fontcore/ink.h"
#include "fontcore/measure.h"
#include "glyphs/weight.h"

namespace {

using Contours = std::vector<fontcore::BezierContour>;
using fontcore::Affine;
using fontcore::Box;
using glyphs::Font;

const std::string alphabet = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";

int glyph_of(const Font& font, char letter) {
  const auto found = font.character_map.find(static_cast<char32_t>(letter));
  return found == font.character_map.end() ? -1 : found->second;
}

Contours placed(const Contours& contours, double scale, double shift) {
  Affine map;
  map.linear *= scale;
  map.shift.x() = shift;
  Contours result;
  for (const fontcore::BezierContour& contour : contours) result.push_back(transform(contour, map));
  return result;
}

// Outer contours counter-clockwise: ink of two shapes together is then where either has it.
Contours counter_clockwise(Contours contours) {
  double largest = 0.0;
  for (const fontcore::BezierContour& contour : contours) {
    const double area = signed_area(contour);
    if (std::abs(area) > std::abs(largest)) largest = area;
  }
  if (largest < 0.0) {
    for (fontcore::BezierContour& contour : contours) contour = reverse(contour);
  }
  return contours;
}

Box box_of(const Contours& contours) {
  Box box;
  for (const fontcore::BezierContour& contour : contours) box.add(tight_box(contour));
  return box;
}

// |A - B| + |B - A| as a share of |B|: both together less each of them.
double difference(const Contours& made, const Contours& drawn) {
  const double own = measure_ink(made).area;
  const double wished = measure_ink(drawn).area;
  const Box a = box_of(made);
  const Box b = box_of(drawn);
  const double left = b.low.x() - a.low.x();
  const double right = b.high.x() - a.high.x();
  const double middle = 0.5 * (left + right);
  const double reach = 0.03 * (b.high.x() - b.low.x());
  std::vector<double> shifts{left, right};
  for (int k = -6; k <= 6; ++k) shifts.push_back(middle + reach * k / 6.0);
  double least = 1e300;
  for (const double shift : shifts) {
    Contours both = placed(made, 1.0, shift);
    both.insert(both.end(), drawn.begin(), drawn.end());
    least = std::min(least, 2.0 * measure_ink(both).area - own - wished);
  }
  return least / wished;
}

struct Score {
  char letter = 0;
  double difference = 0.0;
  double area = 0.0;
  int crossings = 0;  // added
  int counters = 0;   // closed
};

Score score_of(const Font& regular, const Font& bold, char letter, const fontcore::WeightModel& model, double amount) {
  const int id = glyph_of(regular, letter);
  glyphs::ReweightOptions options;
  options.amount = amount;
  glyphs::ReweightedGlyph report;
  const Contours& before = regular.glyphs[static_cast<std::size_t>(id)].contours;
  const Contours after = glyphs::reweight_glyph(regular, id, model, options, report);
  const double scale = static_cast<double>(regular.units_per_em) / bold.units_per_em;
  const Contours drawn = counter_clockwise(placed(compose(bold, glyph_of(bold, letter)), scale, 0.0));
  Score score;
  score.letter = letter;
  score.difference = difference(counter_clockwise(after), drawn);
  score.area = measure_ink(after).area / measure_ink(drawn).area - 1.0;
  score.crossings = added_crossings(find_crossings(before), find_crossings(after));
  score.counters = static_cast<int>(closed_counters(measure_ink(before), measure_ink(after)).size());
  return score;
}

double mean_difference(const Font& regular, const Font& bold, const std::string& letters,
                       const fontcore::WeightModel& model, double amount) {
  double sum = 0.0;
  for (const char letter : letters) sum += score_of(regular, bold, letter, model, amount).difference;
  return sum / static_cast<double>(letters.size());
}

std::string as_list(const std::string& letters) {
  std::string list;
  for (const char letter : letters) list += (list.empty() ? "" : ",") + std::string(1, letter);
  return list;
}

int run(const std::vector<std::string>& arguments) {
  const bool has_prior = arguments.size() == 5 && arguments[3] == "--prior";
  const bool has_other = arguments.size() == 7 && arguments[3] == "--amount-from";
  if (arguments.size() != 2 && arguments.size() != 3 && !has_other && !has_prior) {
    std::fprintf(stderr,
                 "weight_bench REGULAR BOLD [LETTERS]\n"
                 "weight_bench REGULAR BOLD LETTERS --prior PRIOR.json\n"
                 "weight_bench REGULAR BOLD LETTERS --amount-from FITTED MODEL_REGULAR MODEL_BOLD\n");
    return 2;
  }
  const Font regular = glyphs::load_font(arguments[0]);
  const Font bold = glyphs::load_font(arguments[1]);
  const std::string controls = arguments.size() > 2 ? arguments[2] : "noHO";
  fontcore::WeightModel model = has_other ? glyphs::learn_weight(glyphs::load_font(arguments[5]),
                                                                 glyphs::load_font(arguments[6]), as_list(controls))
                                          : glyphs::learn_weight(regular, bold, as_list(controls));
  if (has_prior) {
    const glyphs::Bytes bytes = glyphs::read_file(arguments[4]);
    take_prior(model, glyphs::parse_prior({bytes.begin(), bytes.end()}, arguments[4]));
  }
  double amount = 1.0;
  std::string seen = controls;
  if (has_other) {
    seen = arguments[4];
    double least = 1e300;
    for (int k = 4; k <= 40; ++k) {
      const double error = mean_difference(regular, bold, seen, model, 0.05 * k);
      if (error < least) {
        least = error;
        amount = 0.05 * k;
      }
    }
    std::printf("amount %.2f\n", amount);
  }
  std::vector<Score> scores;
  for (const char letter : alphabet) {
    if (seen.find(letter) != std::string::npos) continue;
    if (glyph_of(regular, letter) < 0 || glyph_of(bold, letter) < 0) continue;
    scores.push_back(score_of(regular, bold, letter, model, amount));
  }
  if (scores.empty()) return 0;
  std::ranges::stable_sort(scores, std::greater{}, &Score::difference);
  double sum = 0.0;
  double area = 0.0;
  int crossings = 0;
  int counters = 0;
  std::printf("letter  error %%  area %%\n");
  for (const Score& score : scores) {
    std::printf("%c       %7.2f  %+6.2f\n", score.letter, 100.0 * score.difference, 100.0 * score.area);
    sum += score.difference;
    area += std::abs(score.area);
    crossings += score.crossings;
    counters += score.counters;
  }
  const auto count = static_cast<double>(scores.size());
  std::printf("mean of %zu: error %.2f %%, area error %.2f %%, crossings added %d, counters closed %d\n", scores.size(),
              100.0 * sum / count, 100.0 * area / count, crossings, counters);
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
