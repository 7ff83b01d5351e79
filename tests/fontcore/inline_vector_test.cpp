#include "fontcore/inline_vector.h"

#include <random>
#include <vector>

#include "tests/catch.h"

using fontcore::InlineVector;

TEST_CASE("a list in place holds what a list on the heap would, however long it grows", "[inline_vector]") {
  std::mt19937 engine(5);
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(engine); };
  for (int round = 0; round < 50; ++round) {
    InlineVector<int, 4> list;
    std::vector<int> expected;
    for (int step = 0; step < 60; ++step) {
      const int value = static_cast<int>(engine() % 1000);
      if (expected.empty() || below(3) > 0) {
        const std::size_t at = below(expected.size() + 1);
        list.insert(list.begin() + at, value);
        expected.insert(expected.begin() + static_cast<std::ptrdiff_t>(at), value);
      } else {
        const std::size_t at = below(expected.size());
        list.erase(list.begin() + at);
        expected.erase(expected.begin() + static_cast<std::ptrdiff_t>(at));
      }
      InlineVector<int, 4> copy = list;
      REQUIRE(std::vector<int>(copy.begin(), copy.end()) == expected);
      const InlineVector<int, 4> moved = std::move(copy);
      REQUIRE(std::vector<int>(moved.begin(), moved.end()) == expected);
      list = moved;
    }
  }
}

TEST_CASE("an entry of a list may be added to the same list again", "[inline_vector]") {
  InlineVector<int, 2> list = {1, 2};
  for (int k = 0; k < 5; ++k) list.push_back(list[0]);
  CHECK(std::vector<int>(list.begin(), list.end()) == std::vector<int>{1, 2, 1, 1, 1, 1, 1});
}
