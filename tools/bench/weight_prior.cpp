// Makes a prior of weight from pairs of fonts, given by name, Regular and Bold; the JSON goes to standard output.
//
//   weight_prior LETTERS NAME REGULAR BOLD [NAME REGULAR BOLD ...]

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "glyphs/font_file.h"
#include "glyphs/weight.h"

namespace {

int run(const std::vector<std::string>& arguments) {
  if (arguments.size() < 4 || arguments.size() % 3 != 1) {
    std::fprintf(stderr, "weight_prior LETTERS NAME REGULAR BOLD [NAME REGULAR BOLD ...]\n");
    return 2;
  }
  std::vector<glyphs::WeightFamily> families;
  for (std::size_t i = 1; i < arguments.size(); i += 3) {
    families.push_back({arguments[i], glyphs::load_font(arguments[i + 1]), glyphs::load_font(arguments[i + 2])});
  }
  const std::string json = prior_json(glyphs::learn_prior(families, arguments[0]));
  std::fwrite(json.data(), 1, json.size(), stdout);
  return 0;
}

}  // namespace

int main(int count, char** arguments) {
  try {
    return run({arguments + 1, arguments + count});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "weight_prior: %s\n", error.what());
    return 2;
  }
}
