#pragma once

#include "fontcore/error.h"

namespace glyphs {

/// A font that cannot be read: file, and where it applies table, glyph, contour and numbers. One line.
struct FontReadError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A font or report that cannot be written. One line; no output is left behind.
struct FontWriteError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A recipe or a request that cannot be honoured, with the key or the name it is about. One line.
struct RequestError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace glyphs
