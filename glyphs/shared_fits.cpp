#include "glyphs/shared_fits.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::CompactFit;
using fontcore::CompactOptions;
using fontcore::Point;

// Where a contour is when its first point is within a unit of the origin: by whole units, so that the fit is the same.
Point whole_units_of(const BezierContour& contour) { return contour.point(0).array().floor(); }

BezierContour moved(const BezierContour& contour, const Point& by) {
  return contour.with_points(contour.points().rowwise() + by.transpose());
}

// All that a fit depends on.
std::string key_of(const BezierContour& contour, const CompactOptions& options) {
  std::string key;
  const auto append = [&](const auto* values, std::size_t count) {
    key.append(reinterpret_cast<const char*>(values), count * sizeof(*values));
  };
  const double lengths[] = {options.tolerance, options.units_per_em, options.corner_angle, options.straight_run};
  const long counts[] = {static_cast<long>(options.extrema),        static_cast<long>(options.curve),
                         static_cast<long>(options.coordinates),    options.most_work,
                         static_cast<long>(options.corners.size()), static_cast<long>(options.kept_segments.size())};
  append(lengths, std::size(lengths));
  append(counts, std::size(counts));
  append(options.corners.data(), options.corners.size());
  append(options.kept_segments.data(), options.kept_segments.size());
  append(contour.kinds().data(), contour.kinds().size());
  append(contour.points().data(), static_cast<std::size_t>(contour.points().size()));
  return key;
}

}  // namespace

struct SharedFits::Entry {
  std::once_flag once;
  CompactFit fit;
};

SharedFits::SharedFits() = default;
SharedFits::~SharedFits() = default;

CompactFit SharedFits::fit(const BezierContour& source, const CompactOptions& options, long& spent) {
  if (spent >= options.most_work) {
    CompactOptions nothing_left = options;
    nothing_left.most_work = 0;
    return fit_compact(source, nothing_left);
  }
  const Point place = whole_units_of(source);
  const BezierContour shape = moved(source, -place);
  CompactFit fit;
  if (moved(shape, place) == source) {
    Entry* entry = nullptr;
    {
      const std::lock_guard lock(mutex_);
      std::unique_ptr<Entry>& known = entries_[key_of(shape, options)];
      if (!known) known = std::make_unique<Entry>();
      entry = known.get();
    }
    std::call_once(entry->once, [&] { entry->fit = fit_compact(shape, options); });
    fit = entry->fit;
    fit.contour = fit.kept ? source : moved(fit.contour, place);
    fit.where += place;
  } else {  // fractions that are not the same elsewhere
    fit = fit_compact(source, options);
  }
  spent += fit.work;
  return fit;
}

}  // namespace glyphs
