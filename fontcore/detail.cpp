#include "fontcore/detail.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "fontcore/error.h"
#include "fontcore/profile.h"
#include "fontcore/wavelet.h"

namespace fontcore {

namespace {

using Eigen::Index;

// Steps of a sample to a scale, and the error between them, as a share of it, at which more are of no use.
constexpr double fewest_steps = 24.0;
constexpr double most_steps = 256.0;
constexpr double sampling_error = 1e-4;
constexpr Index fewest_points = 8;
constexpr int most_points = 20000;  // of one arc
// Of base and parameter, each on the parameter that the one before gave; first by the base's length alone.
constexpr int passes = 12;
constexpr int passes_by_length = 3;
constexpr double corner_at_scale = 30.0 * std::numbers::pi / 180.0;
// A bend of a radius below half a scale is more than the base can follow, unless all of a small contour bends so.
constexpr double bend_at_scale = 1.0;  // radians, over half a scale
constexpr double bend_of_all = 1.5;    // times what the contour turns in the mean

void check_scale(const char* who, double scale) {
  if (!(scale > 0.0) || !std::isfinite(scale)) throw InvalidInput(text(who, ": scale ", scale, ", must be positive"));
}

// Uniform cubic B-splines over x in [0, spans]: closed, or open with their ends at end points.
struct CubicSpace {
  bool is_closed;
  int spans;

  Index size() const { return is_closed ? spans : spans + 3; }
  BasisRow row(double x) const {
    if (!is_closed) return basis_row(Scheme::EndpointCubic, size(), std::clamp(x, 0.0, static_cast<double>(spans)));
    const double whole = std::floor(x);
    const double u = x - whole;
    const double v = 1.0 - u;
    const auto first = static_cast<Index>(whole) - 1;
    BasisRow row;
    row.count = 4;
    row.weight = {v * v * v / 6.0, (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
                  (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0, u * u * u / 6.0};
    for (Index k = 0; k < 4; ++k) row.index[static_cast<std::size_t>(k)] = ((first + k) % spans + spans) % spans;
    return row;
  }
  Point at(const Points& coefficients, double x) const {
    const BasisRow row = this->row(x);
    Point value = Point::Zero();
    for (std::size_t k = 0; k < 4; ++k) value += row.weight[k] * coefficients.row(row.index[k]).transpose();
    return value;
  }

  // The spline nearest to values at places, weighted; with `is_held` its ends are the first and the last value. Where
  // weights vanish it is nothing in particular, but finite.
  Points fit(const Eigen::VectorXd& places, const Eigen::VectorXd& weights, const Points& values, bool is_held) const {
    const Index held = is_held && !is_closed ? 1 : 0;
    const auto n = static_cast<int>(size() - 2 * held);
    std::vector<int> first;
    for (int i = 0; i < n; ++i) first.push_back(is_closed && i + 3 >= n ? 0 : std::max(0, i - 3));
    ProfileSystem normal(std::move(first));
    Points right = Points::Zero(n, 2);
    for (Index p = 0; p < places.size(); ++p) {
      const BasisRow row = this->row(places[p]);
      Eigen::RowVector2d value = values.row(p);
      for (std::size_t a = 0; a < 4 && held > 0; ++a) {
        if (row.index[a] == 0) value -= row.weight[a] * values.row(0);
        if (row.index[a] == size() - 1) value -= row.weight[a] * values.row(values.rows() - 1);
      }
      for (std::size_t a = 0; a < 4; ++a) {
        const Index i = row.index[a] - held;
        if (i < 0 || i >= n) continue;
        right.row(i) += weights[p] * row.weight[a] * value;
        for (std::size_t b = 0; b < 4; ++b) {
          const Index j = row.index[b] - held;
          if (j < 0 || j > i) continue;
          normal.entry(static_cast<int>(i), static_cast<int>(j)) += weights[p] * row.weight[a] * row.weight[b];
        }
      }
    }
    const double ridge = 1e-13 * std::max(weights.sum() / n, 1e-300);
    for (int i = 0; i < n; ++i) normal.entry(i, i) += ridge;
    Points coefficients = Points::Zero(size(), 2);
    if (!normal.factor()) throw InvalidInput(text("DetailBase: no spline of ", spans, " spans is nearest"));
    coefficients.middleRows(held, n) = normal.solve(std::move(right));
    if (held > 0) {
      coefficients.row(0) = values.row(0);
      coefficients.row(size() - 1) = values.row(values.rows() - 1);
    }
    return coefficients;
  }
  Points at_all(const Points& coefficients, const Eigen::VectorXd& places) const {
    Points values(places.size(), 2);
    for (Index p = 0; p < places.size(); ++p) values.row(p) = at(coefficients, places[p]).transpose();
    return values;
  }
};

// Arc length at every point of a polyline, and of all of it.
double accumulate(const Points& points, bool is_closed, Eigen::VectorXd& places) {
  const Index n = points.rows();
  places.resize(n);
  places[0] = 0.0;
  for (Index i = 1; i < n; ++i) places[i] = places[i - 1] + (points.row(i) - points.row(i - 1)).norm();
  return places[n - 1] + (is_closed ? (points.row(0) - points.row(n - 1)).norm() : 0.0);
}

// For every place the share of the curve that it stands for.
Eigen::VectorXd shares(const Eigen::VectorXd& places, double length, bool is_closed) {
  const Index n = places.size();
  Eigen::VectorXd weights(n);
  for (Index i = 0; i < n; ++i) {
    const double before = i > 0 ? places[i - 1] : is_closed ? places[n - 1] - length : places[0];
    const double after = i + 1 < n ? places[i + 1] : is_closed ? places[0] + length : places[n - 1];
    weights[i] = 0.5 * (after - before) / length;
  }
  return weights;
}

// The cubic through the four values nearest to a place, of values at rising places.
Eigen::RowVector2d between(const Eigen::VectorXd& places, const Points& values, bool is_closed, double period,
                           double x) {
  const Index n = places.size();
  const double* const above = std::upper_bound(places.data(), places.data() + n, x);
  Index first = above - places.data() - 2;
  if (!is_closed) first = std::clamp<Index>(first, 0, n - 4);
  std::array<double, 4> at{};
  std::array<Index, 4> index{};
  for (Index k = 0; k < 4; ++k) {
    const Index i = first + k;
    const Index turns = i < 0 ? -1 : i >= n ? 1 : 0;
    index[static_cast<std::size_t>(k)] = i - turns * n;
    at[static_cast<std::size_t>(k)] = places[i - turns * n] + static_cast<double>(turns) * period;
  }
  Eigen::RowVector2d sum = Eigen::RowVector2d::Zero();
  for (std::size_t a = 0; a < 4; ++a) {
    double weight = 1.0;
    for (std::size_t b = 0; b < 4; ++b) {
      if (b != a) weight *= (x - at[b]) / (at[a] - at[b]);
    }
    sum += weight * values.row(index[a]);
  }
  return sum;
}

double wrapped_angle(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

}  // namespace

DetailSample to_sample(const DetailBase& base, const Points& detail, DetailFrame frame) {
  const bool is_closed = base.is_closed();
  Points offsets = detail;
  if (frame != DetailFrame::Fixed) {
    for (Index i = 0; i < detail.rows(); ++i) {
      const Eigen::RowVector2d t = base.tangents().row(i);
      offsets(i, 0) = detail.row(i).dot(t);
      offsets(i, 1) = detail(i, 0) * t.y() - detail(i, 1) * t.x();
    }
  }
  const Points shape = base.shape();
  const Index n = detail.rows();
  DetailSample sample;
  sample.length = base.length();
  sample.is_closed = is_closed;
  sample.offsets.resize(n, 2);
  sample.shape.resize(n, 2);
  // The direction goes on by whole turns round a closed run; what is without jumps is its rest from an even turn.
  Points even = shape;
  const double turn =
      is_closed ? 2.0 * std::numbers::pi * std::round((shape(n - 1, 0) - shape(0, 0)) / (2.0 * std::numbers::pi)) : 0.0;
  even.col(0) -= turn / sample.length * base.places();
  for (Index i = 0; i < n; ++i) {
    const double x = sample.length * static_cast<double>(i) / static_cast<double>(is_closed ? n : n - 1);
    sample.offsets.row(i) = between(base.places(), offsets, is_closed, sample.length, x);
    sample.shape.row(i) = between(base.places(), even, is_closed, sample.length, x);
    sample.shape(i, 0) += turn / sample.length * x;
  }
  return sample;
}

Eigen::RowVector2d value_at(const DetailSample& sample, bool mirrors, double x) {
  if (mirrors) x = sample.length - x;
  const Index n = sample.offsets.rows();
  const double steps = static_cast<double>(sample.is_closed ? n : n - 1);
  double at = x / sample.length * steps;
  if (sample.is_closed) at -= std::floor(at / steps) * steps;
  auto first = static_cast<Index>(std::floor(at)) - 1;
  if (!sample.is_closed) first = std::clamp<Index>(first, 0, n - 4);
  const double u = at - static_cast<double>(first);  // the four values stand at 0, 1, 2, 3
  const std::array<double, 4> weight = {-(u - 1) * (u - 2) * (u - 3) / 6, u * (u - 2) * (u - 3) / 2,
                                        -u * (u - 1) * (u - 3) / 2, u * (u - 1) * (u - 2) / 6};
  Eigen::RowVector2d value = Eigen::RowVector2d::Zero();
  for (Index k = 0; k < 4; ++k) {
    value += weight[static_cast<std::size_t>(k)] *
             sample.offsets.row(sample.is_closed ? ((first + k) % n + n) % n : first + k);
  }
  return value;
}

namespace {

// Detail of a run of points with the ink on its left, at even steps of the base.
DetailSample sample_of(const Points& points, bool is_closed, double scale, DetailFrame frame) {
  const DetailBase base(points, is_closed, scale);
  return to_sample(base, points - base.points(), frame);
}
// The detail of a run whose points can be had at any number of even steps: so many that it is what more of them say.
template <typename PointsAt>
DetailSample sampled(const PointsAt& points_at, double length, bool is_closed, double scale, DetailFrame frame) {
  const double wanted = std::min(std::ceil(length / scale * fewest_steps), 1e9);
  Index steps = std::clamp<Index>(static_cast<Index>(wanted), 4 * fewest_points, most_points / 2);
  const auto at = [&](Index count) {
    return sample_of(points_at(is_closed ? count : count + 1), is_closed, scale, frame);
  };
  DetailSample sample = at(steps);
  while (steps <= most_points / 2 && static_cast<double>(steps) * scale < most_steps * length) {
    steps *= 2;
    DetailSample finer = at(steps);
    double off = 0.0;
    for (Index i = 0; i < finer.offsets.rows(); ++i) {
      const double x = sample.length * static_cast<double>(i) / static_cast<double>(steps);
      off = std::max(off, (value_at(sample, false, x) - finer.offsets.row(i)).norm());
    }
    if (off < sampling_error * scale) break;
    sample = std::move(finer);
  }
  return sample;
}

// A closed run begins where it began.
Points with_ink_on_left(Points points, bool is_closed, InkSide ink) {
  const Index held = is_closed ? 1 : 0;
  if (ink == InkSide::Right) {
    points.bottomRows(points.rows() - held) = points.bottomRows(points.rows() - held).colwise().reverse().eval();
  }
  return points;
}

}  // namespace

Points points_along(const OutlineArcs& outline, int arc, Index count) {
  const double length = outline.arcs()[static_cast<std::size_t>(arc)].length;
  const double step = length / static_cast<double>(outline.has_corner() ? count - 1 : count);
  Points points(count, 2);
  for (Index i = 0; i < count; ++i) {
    const auto [segment, u] = outline.locate(arc, std::min(static_cast<double>(i) * step, length));
    points.row(i) = evaluate(outline.contour().segment(segment), u).transpose();
  }
  return points;
}

OutlineArcs arcs_at_scale(const BezierContour& contour, double scale, const OutlineCurveOptions& options) {
  check_scale("arcs_at_scale", scale);
  OutlineArcs arcs(contour, options);
  const double half = std::min(0.5 * scale, 0.25 * arcs.length());
  const auto at = [&](double s) {
    const auto [segment, u] = arcs.locate(s);
    return evaluate(contour.segment(segment), u);
  };
  const auto turn_at = [&](double s) {
    const Point here = at(s);
    const Point before = here - at(s - half);
    const Point after = at(s + half) - here;
    return std::abs(angle(before, after));
  };
  const double sharpest = std::max(bend_at_scale, bend_of_all * 2.0 * std::numbers::pi * half / arcs.length());
  struct Cut {
    double s;
    double turn;
    int node;
  };
  std::vector<Cut> cuts;
  std::vector<Cut> bends;
  for (std::size_t k = 0; k < arcs.arcs().size(); ++k) {
    const OutlineArcs::Arc& arc = arcs.arcs()[k];
    const OutlineArcs::Arc& before = arcs.arcs()[(k == 0 ? arcs.arcs().size() : k) - 1];
    for (std::size_t i = 0; i < arc.segments.size(); ++i) {
      const int node = contour.node(arc.segments[i]);
      const Cut cut{arc.start + arc.offsets[i], turn_at(arc.start + arc.offsets[i]), node};
      if (i == 0 && arcs.has_corner()) {
        const bool is_texture = std::min(arc.length, before.length) < half && cut.turn < corner_at_scale &&
                                std::ranges::find(options.corners, node) == options.corners.end();
        if (!is_texture) cuts.push_back(cut);
      } else if (cut.turn > sharpest && contour.kind(node) == PointKind::Node) {
        bends.push_back(cut);
      }
    }
  }
  // Of bends near to each other the sharpest, and none beside a corner.
  std::ranges::stable_sort(bends, std::ranges::greater{}, &Cut::turn);
  for (const Cut& bend : bends) {
    const bool is_free = std::ranges::none_of(
        cuts, [&](const Cut& cut) { return std::abs(std::remainder(cut.s - bend.s, arcs.length())) < 0.5 * half; });
    if (is_free) cuts.push_back(bend);
  }
  OutlineCurveOptions kept = options;
  kept.corner_angle = kept.line_angle = 2.0 * std::numbers::pi;  // none but those named
  for (const Cut& cut : cuts) kept.corners.push_back(cut.node);
  return OutlineArcs(contour, kept);
}

DetailBase::DetailBase(const Points& points, bool is_closed, double scale) : is_closed_(is_closed) {
  check_scale("DetailBase", scale);
  const Index n = points.rows();
  if (n < fewest_points) throw InvalidInput(text("DetailBase: ", n, " points, at least ", fewest_points));
  length_ = accumulate(points, is_closed, places_);
  for (int pass = 0;; ++pass) {
    if (!(length_ > 0.0)) throw InvalidInput("DetailBase: a run of points without length");
    spans_ = static_cast<int>(
        std::clamp(std::round(2.0 * length_ / scale), is_closed ? 4.0 : 1.0, static_cast<double>(n / 3)));
    const CubicSpace space{is_closed, spans_};
    const Eigen::VectorXd x = places_ * (spans_ / length_);
    weights_ = shares(places_, length_, is_closed);
    const Points coefficients = space.fit(x, weights_, points, true);
    base_ = space.at_all(coefficients, x);
    tangents_.resize(n, 2);
    constexpr double step = 1e-4;  // of a span
    for (Index i = 0; i < n; ++i) {
      const double low = is_closed ? x[i] - step : std::max(x[i] - step, 0.0);
      const double high = is_closed ? x[i] + step : std::min(x[i] + step, static_cast<double>(spans_));
      const Point d = space.at(coefficients, high) - space.at(coefficients, low);
      const double size = d.norm();
      tangents_.row(i) = (size > 0.0 ? Point(d / size) : Point(1.0, 0.0)).transpose();
    }
    if (pass + 1 == passes) return;
    length_ = accumulate(base_, is_closed, places_);
    if (pass >= passes_by_length) move_to_feet(points);
  }
}

// Every point's place becomes its foot on the base, as far as they keep their order.
void DetailBase::move_to_feet(const Points& points) {
  const Index n = points.rows();
  const Points shape = this->shape();
  Eigen::VectorXd feet = places_;
  const double farthest = length_ / spans_;
  for (Index i = is_closed_ ? 0 : 1; i < (is_closed_ ? n : n - 1); ++i) {
    const Eigen::RowVector2d off = points.row(i) - base_.row(i);
    const Eigen::RowVector2d t = tangents_.row(i);
    const double away = off.y() * t.x() - off.x() * t.y();  // to the left, as curvature is
    feet[i] += std::clamp(off.dot(t) / std::max(1.0 - shape(i, 1) * away, 0.5), -0.25 * farthest, 0.25 * farthest);
  }
  // The nearest rising places, at least a share of the mean step apart: neighbours that are not are averaged.
  const double apart = 0.1 * length_ / static_cast<double>(n);
  struct Block {
    double sum;
    Index count;
    double mean() const { return sum / static_cast<double>(count); }
  };
  std::vector<Block> blocks;
  for (Index i = 0; i < n; ++i) {
    blocks.push_back({feet[i] - apart * static_cast<double>(i), 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].mean() > blocks.back().mean()) {
      blocks[blocks.size() - 2].sum += blocks.back().sum;
      blocks[blocks.size() - 2].count += blocks.back().count;
      blocks.pop_back();
    }
  }
  Index i = 0;
  for (const Block& block : blocks) {
    for (Index k = 0; k < block.count; ++k, ++i) places_[i] = block.mean() + apart * static_cast<double>(i);
  }
  const double origin = places_[0];
  if (is_closed_) {
    // A closed run's first point is where places begin.
    if (places_[n - 1] - origin < length_ - apart) {
      places_.array() -= origin;
    } else {
      length_ = accumulate(base_, true, places_);
    }
    return;
  }
  // Ends stay ends.
  const double reach = places_[n - 1] - origin;
  places_ = ((places_.array() - origin) * (length_ / reach)).matrix();
}

Points DetailBase::shape() const {
  const Index n = base_.rows();
  Points shape(n, 2);
  double direction = 0.0;
  for (Index i = 0; i < n; ++i) {
    const double now = std::atan2(tangents_(i, 1), tangents_(i, 0));
    direction = i == 0 ? now : direction + wrapped_angle(now - direction);
    shape(i, 0) = direction;
  }
  for (Index i = 0; i < n; ++i) {
    const Index low = i > 0 ? i - 1 : is_closed_ ? n - 1 : 0;
    const Index high = i + 1 < n ? i + 1 : is_closed_ ? 0 : n - 1;
    double run = places_[high] - places_[low];
    if (run <= 0.0) run += length_;
    shape(i, 1) = wrapped_angle(shape(high, 0) - shape(low, 0)) / run;
  }
  return shape;
}

Points DetailBase::detail_part(const Points& displacement, const Eigen::VectorXd& mask) const {
  const CubicSpace space{is_closed_, spans_};
  const Eigen::VectorXd x = places_ * (spans_ / length_);
  const Points low = space.fit(x, weights_.cwiseProduct(mask), displacement, false);
  Points part = displacement - space.at_all(low, x);
  for (Index i = 0; i < part.rows(); ++i) part.row(i) *= mask[i];
  return part;
}

Points DetailBase::without_features_below(double length, const Points& values) const {
  const auto spans = static_cast<int>(std::clamp(std::round(2.0 * length_ / length), static_cast<double>(spans_),
                                                 static_cast<double>(values.rows() / 3)));
  const CubicSpace space{is_closed_, spans};
  const Eigen::VectorXd x = places_ * (spans / length_);
  return space.at_all(space.fit(x, weights_, values, false), x);
}

double DetailBase::base_move(const Points& displacement) const {
  const CubicSpace space{is_closed_, spans_};
  const Eigen::VectorXd x = places_ * (spans_ / length_);
  return space.at_all(space.fit(x, weights_, displacement, true), x).rowwise().norm().maxCoeff();
}

std::vector<DetailSample> extract_detail(const OutlineArcs& outline, double scale, DetailFrame frame, InkSide ink,
                                         const std::string& place) {
  check_scale("extract_detail", scale);
  std::vector<DetailSample> samples;
  for (std::size_t k = 0; k < outline.arcs().size(); ++k) {
    const bool is_closed = !outline.has_corner();
    if (outline.arcs()[k].length < scale) continue;
    const int arc = static_cast<int>(k);
    const auto points_at = [&](Index count) {
      return with_ink_on_left(points_along(outline, arc, count), is_closed, ink);
    };
    samples.push_back(sampled(points_at, outline.arcs()[k].length, is_closed, scale, frame));
    if (!place.empty()) samples.back().place = text(place, "/", k);
  }
  return samples;
}

DetailSample extract_detail(const OutlineArcs& outline, const OutlineArcs::Location& from,
                            const OutlineArcs::Location& to, double scale, DetailFrame frame, InkSide ink) {
  check_scale("extract_detail", scale);
  const auto along = [&](const OutlineArcs::Location& location) {
    const auto& arc = outline.arcs()[static_cast<std::size_t>(outline.arc_of(location.segment))];
    return arc.start + outline.offset_of(location.segment) + outline.along(location.segment).at(location.u);
  };
  const double start = along(from);
  double length = along(to) - start;
  if (length <= 0.0) length += outline.length();
  if (length < scale)
    throw InvalidInput(text("extract_detail: a stretch of ", length, " units is shorter than the scale of ", scale));
  const auto points_at = [&](Index count) {
    Points points(count, 2);
    for (Index i = 0; i < count; ++i) {
      const double s = start + length * static_cast<double>(i) / static_cast<double>(count - 1);
      const auto [segment, u] = outline.locate(s);
      points.row(i) = evaluate(outline.contour().segment(segment), u).transpose();
    }
    return with_ink_on_left(std::move(points), false, ink);
  };
  return sampled(points_at, length, false, scale, frame);
}

DetailSample extract_detail(const Points& stroke, bool is_closed, double scale, DetailFrame frame) {
  check_scale("extract_detail", scale);
  if (stroke.rows() < 2) throw InvalidInput(text("extract_detail: a stroke of ", stroke.rows(), " points"));
  Eigen::VectorXd places;
  const double length = accumulate(stroke, is_closed, places);
  if (!(length >= scale))
    throw InvalidInput(text("extract_detail: a stroke of ", length, " units is shorter than the scale of ", scale));
  const auto points_at = [&](Index count) {
    Points points(count, 2);
    Index k = 0;
    for (Index i = 0; i < count; ++i) {
      const double s = length * static_cast<double>(i) / static_cast<double>(is_closed ? count : count - 1);
      while (k + 1 < stroke.rows() && places[k + 1] <= s) ++k;
      const Index next = k + 1 < stroke.rows() ? k + 1 : is_closed ? 0 : k;
      const double step = (stroke.row(next) - stroke.row(k)).norm();
      const double u = step > 0.0 ? std::min((s - places[k]) / step, 1.0) : 0.0;
      points.row(i) = stroke.row(k) + u * (stroke.row(next) - stroke.row(k));
    }
    return points;
  };
  return sampled(points_at, length, is_closed, scale, frame);
}

namespace {

// Numbers in [0, 1) that a seed gives, one after the other (splitmix64).
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : state_(seed) {}
  double next() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
  }
  std::size_t below(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(next() * static_cast<double>(count)));
  }

 private:
  std::uint64_t state_;
};

constexpr double most_stretch = 0.04;
constexpr int tries = 48;  // of a cut's place, for the one that agrees best with what it is joined to
constexpr int looks = 24;  // at an overlap

// Cuts from samples, one after the other, every one faded into the next.
class Run {
 public:
  Run(const DetailLibrary& library, std::size_t first, bool mirrors, double overlap, Chance& chance)
      : library_(library), mirrors_(mirrors), overlap_(overlap), chance_(chance) {
    add(first, 0.0);
  }

  // Goes on until it is at least this long.
  void extend(double length) {
    while (cuts_.back().end < length) {
      const double reached = cuts_.back().end;
      const double from = std::max(cuts_.back().start, reached - overlap_);
      cuts_.back().end = reached;
      add(chance_.below(library_.samples.size()), from);
      if (cuts_.back().end <= reached) cuts_.back().end = std::nextafter(reached, 2.0 * length) + 0.25 * overlap_;
    }
  }
  Eigen::RowVector2d at(double x) const {
    // A place lies in one cut, or where it fades into the next.
    std::size_t k = 0;
    while (k + 1 < cuts_.size() && cuts_[k + 1].start <= x) ++k;
    Eigen::RowVector2d value = value_of(cuts_[k], x);
    if (k > 0 && x < cuts_[k - 1].end) {
      const double share = (x - cuts_[k].start) / (cuts_[k - 1].end - cuts_[k].start);
      const double gone = 0.5 + 0.5 * std::cos(std::numbers::pi * share);
      value = gone * value_of(cuts_[k - 1], x) + (1.0 - gone) * value;
    }
    return value;
  }

 private:
  struct Cut {
    const DetailSample* sample;
    double start;   // of the run, where it begins to come in
    double end;     // where it is gone
    double offset;  // in the sample, of the start
  };
  Eigen::RowVector2d value_of(const Cut& cut, double x) const {
    return value_at(*cut.sample, mirrors_, cut.offset + x - cut.start);
  }
  void add(std::size_t index, double start) {
    const DetailSample& sample = library_.samples[index];
    // The ends of an open sample are held down: they are no part of its texture.
    const double end = sample.is_closed ? 0.0 : std::min(0.25 * library_.scale, 0.125 * sample.length);
    const double room = sample.is_closed ? sample.length : sample.length - 2.0 * end;
    Cut best{&sample, start, std::numeric_limits<double>::infinity(), 0.0};
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < (cuts_.empty() ? 1 : tries); ++k) {
      Cut cut = best;
      // Of an open sample at least half its room is used.
      const double slack = sample.is_closed ? room : 0.5 * room;
      cut.offset = end + slack * chance_.next();
      if (!sample.is_closed) cut.end = start + room - (cut.offset - end);
      double off = 0.0;
      for (int look = 0; !cuts_.empty() && look < looks; ++look) {
        const double x = start + (cuts_.back().end - start) * (look + 0.5) / looks;
        off += (value_of(cut, x) - value_of(cuts_.back(), x)).squaredNorm();
      }
      if (off < least) {
        least = off;
        best = cut;
      }
    }
    cuts_.push_back(best);
  }

  const DetailLibrary& library_;
  bool mirrors_;
  double overlap_;
  Chance& chance_;
  std::vector<Cut> cuts_;
};

}  // namespace

const DetailSample* sample_of_place(const DetailLibrary& library, const DetailBed& bed) {
  constexpr double same_length = 1e-3;
  for (const DetailSample& sample : library.samples) {
    if (!bed.place.empty() && sample.place == bed.place && sample.is_closed == bed.is_closed &&
        std::abs(sample.length - bed.length) < same_length * bed.length) {
      return &sample;
    }
  }
  return nullptr;
}

Points lay_detail(const DetailLibrary& library, const DetailBed& bed, std::uint64_t seed, bool mirrors,
                  const Eigen::VectorXd& places) {
  if (library.samples.empty()) throw InvalidInput("lay_detail: a library without samples");
  if (!(bed.length > 0.0)) throw InvalidInput(text("lay_detail: a stretch of length ", bed.length));
  Points laid(places.size(), 2);
  const auto fill = [&](const auto& value) {
    for (Index i = 0; i < places.size(); ++i) laid.row(i) = value(places[i]);
    return laid;
  };
  if (const DetailSample* const own = sample_of_place(library, bed); own != nullptr && !mirrors) {
    return fill([&](double x) { return value_at(*own, false, x * (own->length / bed.length)); });
  }
  Chance chance(seed);
  if (library.frame == DetailFrame::ScaledTangent) {
    const DetailSample& sample = library.samples[chance.below(library.samples.size())];
    const double grown = bed.length / sample.length;
    const double phase = bed.is_closed && sample.is_closed ? sample.length * chance.next() : 0.0;
    return fill([&](double x) -> Eigen::RowVector2d { return grown * value_at(sample, mirrors, phase + x / grown); });
  }
  if (bed.is_closed) {
    std::vector<std::pair<const DetailSample*, double>> tiles;  // and how much of a sample a unit of the bed is
    for (const DetailSample& sample : library.samples) {
      const double whole = std::max(1.0, std::round(bed.length / sample.length));
      const double shrink = whole * sample.length / bed.length;
      if (sample.is_closed && std::abs(1.0 / shrink - 1.0) <= most_stretch) tiles.emplace_back(&sample, shrink);
    }
    if (!tiles.empty()) {
      const auto [sample, shrink] = tiles[chance.below(tiles.size())];
      const double phase = sample->length * chance.next();
      return fill([&, tile = sample, by = shrink](double x) { return value_at(*tile, mirrors, phase + by * x); });
    }
  }
  // A closed bed's run is longer by an overlap, in which its end fades into its start; of several runs the one whose
  // ends agree best.
  const double overlap = std::min(0.5 * library.scale, 0.125 * bed.length);
  const std::size_t first = chance.below(library.samples.size());
  std::optional<Run> best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < (bed.is_closed ? tries : 1); ++k) {
    Run run(library, first, mirrors, overlap, chance);
    run.extend(bed.length + (bed.is_closed ? overlap : 0.0));
    double off = 0.0;
    for (int look = 0; bed.is_closed && look < looks; ++look) {
      const double x = overlap * (look + 0.5) / looks;
      off += (run.at(x) - run.at(bed.length + x)).squaredNorm();
    }
    if (off < least) {
      least = off;
      best.emplace(run);
    }
  }
  return fill([&](double x) -> Eigen::RowVector2d {
    if (!bed.is_closed) return best->at(x);
    if (x >= bed.length) x -= bed.length;
    if (x >= overlap) return best->at(x);
    const double gone = 0.5 + 0.5 * std::cos(std::numbers::pi * x / overlap);
    return gone * best->at(bed.length + x) + (1.0 - gone) * best->at(x);
  });
}

}  // namespace fontcore
