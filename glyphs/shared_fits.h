#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

#include "fontcore/compact.h"

namespace glyphs {

/// Compact fits of the contours of a font, every shape fitted once: letters stand in a font over and over, with every
/// accent, moved by whole units. May be asked by many threads at once; what they get depends on none of them.
class SharedFits {
 public:
  SharedFits();
  ~SharedFits();
  SharedFits(const SharedFits&) = delete;
  SharedFits& operator=(const SharedFits&) = delete;

  /// As `fit_compact`, the contour bit for bit and its deviation to rounding, for one contour of a glyph that has
  /// `spent` so much of `options.most_work` on those before it; what this one takes, whoever did the work, is added.
  /// Once all is spent contours stay as they are.
  ///
  /// Throws  as `fit_compact`.
  fontcore::CompactFit fit(const fontcore::BezierContour& source, const fontcore::CompactOptions& options, long& spent);

 private:
  struct Entry;
  std::mutex mutex_;
  std::unordered_map<std::string, std::unique_ptr<Entry>> entries_;
};

}  // namespace glyphs
