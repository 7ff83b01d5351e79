#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

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

/// Builds an error text from its facts: `text("contour ", 3, ": area is ", 0.0)`.
template <typename... Facts>
std::string text(const Facts&... facts) {
  std::ostringstream out;
  (out << ... << facts);
  return out.str();
}

}  // namespace fontcore
