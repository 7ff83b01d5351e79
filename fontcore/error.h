#pragma once

#include <charconv>
#include <concepts>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace fontcore {

/// What fontcore throws: one line, whoever catches it adds the name it knows.
struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A broken precondition: what was given, and where. One line.
struct InvalidInput : Error {
  using Error::Error;
};

/// Rules that cannot all hold; the text names them and what they ask.
struct UnsatisfiableConstraints : Error {
  using Error::Error;
};

/// A piece of work given up because it had become larger than any real outline makes it; the text names the limit.
struct WorkLimitExceeded : Error {
  using Error::Error;
};

/// Adds a fact to a text as a stream would write it. Numbers and strings take no stream: rows are named by the dozen.
template <typename Fact>
void append_fact(std::string& text, const Fact& fact) {
  if constexpr (std::convertible_to<Fact, std::string_view>) {
    text += std::string_view(fact);
  } else if constexpr (std::same_as<Fact, int> || std::same_as<Fact, long> || std::same_as<Fact, unsigned long>) {
    char digits[24];
    text.append(digits, std::to_chars(digits, digits + sizeof digits, fact).ptr);
  } else if constexpr (std::same_as<Fact, double>) {
    char digits[32];
    text.append(digits, std::to_chars(digits, digits + sizeof digits, fact, std::chars_format::general, 6).ptr);
  } else {
    std::ostringstream out;
    out << fact;
    text += out.str();
  }
}

/// Builds an error text from its facts: `text("contour ", 3, ": area is ", 0.0)`.
template <typename... Facts>
std::string text(const Facts&... facts) {
  std::string result;
  (append_fact(result, facts), ...);
  return result;
}

}  // namespace fontcore
