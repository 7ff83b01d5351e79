#include "fontcore/wavelet.h"

#include "fontcore/error.h"

namespace fontcore {

namespace chaikin {

Split analyze(const Points& fine) {
  const Eigen::Index n = fine.rows();
  if (n % 2 != 0 || n < 2 * min_coarse) {
    throw InvalidInput(text("chaikin::analyze: ", n, " control points cannot be halved into at least ", min_coarse));
  }
  Split split{Points(n / 2, 2), Points(n / 2, 2)};
  for (Eigen::Index i = 0; i < n / 2; ++i) {  // eq. 7
    const auto a = fine.row((2 * i + n - 2) % n);
    const auto b = fine.row((2 * i + n - 1) % n);
    const auto c = fine.row(2 * i);
    const auto d = fine.row(2 * i + 1);
    split.coarse.row(i) = 0.25 * (-a + 3.0 * b + 3.0 * c - d);
    split.detail.row(i) = 0.25 * (a - 3.0 * b + 3.0 * c - d);
  }
  return split;
}

Points synthesize(const Points& coarse, const Points& detail) {
  const Eigen::Index m = coarse.rows();
  if (detail.rows() != m || m < min_coarse) {
    throw InvalidInput(text("chaikin::synthesize: ", m, " control points with ", detail.rows(), " details"));
  }
  Points fine(2 * m, 2);
  for (Eigen::Index i = 0; i < m; ++i) {  // eq. 8, corrected
    const Eigen::Index next = i + 1 == m ? 0 : i + 1;
    const Eigen::RowVector2d here = coarse.row(i) + detail.row(i);
    const Eigen::RowVector2d there = coarse.row(next) - detail.row(next);
    fine.row(2 * i) = 0.75 * here + 0.25 * there;
    fine.row(2 * i + 1) = 0.25 * here + 0.75 * there;
  }
  return fine;
}

Points refine(const Points& coarse) { return synthesize(coarse, Points::Zero(coarse.rows(), 2)); }

}  // namespace chaikin

MultiresCurve decompose(const Points& fine, int levels) {
  MultiresCurve curve{fine, {}};
  for (int level = 0; level < levels; ++level) {
    auto [coarse, detail] = chaikin::analyze(curve.coarse);
    curve.coarse = std::move(coarse);
    curve.details.insert(curve.details.begin(), std::move(detail));
  }
  return curve;
}

Points reconstruct(const MultiresCurve& curve) {
  Points fine = curve.coarse;
  for (const Points& detail : curve.details) fine = chaikin::synthesize(fine, detail);
  return fine;
}

double coarser_parameter(double t, int levels) {
  for (int level = 0; level < levels; ++level) t = 0.5 * (t + 0.5);
  return t;
}

double finer_parameter(double t, int levels) {
  for (int level = 0; level < levels; ++level) t = 2.0 * t - 0.5;
  return t;
}

}  // namespace fontcore
