#include "fontcore/arcwise.h"

#include <array>
#include <cmath>
#include <limits>

#include "fontcore/error.h"
#include "tests/catch.h"
#include "tests/shapes.h"

using namespace fontcore;

namespace {

constexpr std::array<Scheme, 6> all_schemes = {Scheme::Chaikin,       Scheme::Orthogonal,    Scheme::EndpointQuadratic,
                                               Scheme::EndpointCubic, Scheme::HeldQuadratic, Scheme::HeldCubic};

constexpr Eigen::Index base_spans = 24;

SparseCurve base_curve(Scheme scheme) {
  const Eigen::Index size = is_closed(scheme) ? base_spans : base_spans + degree(scheme);
  return SparseCurve(decompose(scheme, shapes::random_points(size, 11), 2));
}

// Every stored detail is set to a number of its own.
void roughen(SparseCurve& curve) {
  for (int level = curve.base().levels(); level < curve.levels(); ++level) {
    const auto runs = curve.runs(level);
    for (const SparseCurve::Run& run : runs) {
      for (Eigen::Index i = 0; i < run.details.rows(); ++i) {
        const double a = static_cast<double>(run.first + i);
        curve.set_detail(level, run.first + i, Eigen::RowVector2d(9.0 * std::sin(a), 7.0 * std::cos(3.0 * a)));
      }
    }
  }
}

Eigen::RowVectorXd dense_at(const MultiresCurve& dense, double t, int extra) {
  return evaluate(dense.scheme, reconstruct(dense), finer_parameter(dense.scheme, t, extra));
}

}  // namespace

TEST_CASE("a sparse curve is the curve with all its details written out", "[arcwise]") {
  for (const Scheme scheme : all_schemes) {
    for (const auto& [from, to] : {std::array{3.0, 9.5}, std::array{0.0, 5.0}, std::array{17.5, 24.0}}) {
      SparseCurve curve = base_curve(scheme);
      curve.refine(from, to, 6);
      curve.refine(11.0, 14.0, 5);
      roughen(curve);
      const MultiresCurve dense = curve.dense();
      CHECK(dense.levels() == 6);
      for (double t = 0.01; t < 23.9; t += 0.237) {
        CHECK((curve.evaluate(t) - dense_at(dense, t, 4)).norm() < 1e-10);
      }
      const Coefficients fine = reconstruct(dense);
      CHECK((curve.control_points(6, 40, 50) - fine.middleRows(40, 50)).norm() < 1e-10);
    }
  }
}

TEST_CASE("a refined stretch changes nothing outside itself, bit for bit", "[arcwise]") {
  for (const Scheme scheme : all_schemes) {
    const SparseCurve before = base_curve(scheme);
    SparseCurve flat = before;
    flat.refine(6.25, 12.0, 6);
    SparseCurve rough = flat;
    roughen(rough);
    double most = 0.0;
    for (double t = 0.0; t < 23.5; t += 0.113) {
      CHECK((flat.evaluate(t) - before.evaluate(t)).norm() < 1e-10);
      if (t <= 6.25 || t >= 12.0) CHECK(rough.evaluate(t) == flat.evaluate(t));
      most = std::max(most, (rough.evaluate(t) - flat.evaluate(t)).norm());
    }
    CHECK(most > 5.0);
  }
}

TEST_CASE("refining a stretch costs memory there and only there", "[arcwise]") {
  for (const Scheme scheme : all_schemes) {
    SparseCurve curve = base_curve(scheme);
    const Eigen::Index before = curve.stored();
    curve.refine(8.0, 12.0, 10);  // 4 spans, 8 levels: 4 * (1 + 2 + ... + 128) wavelets less those that reach out
    CHECK(curve.stored() - before <= 4 * 255);
    CHECK(curve.stored() - before >= 4 * 255 - 8 * 11);
    CHECK(curve.size(10) >= base_spans * 256);
    const Eigen::Index once = curve.stored();
    curve.refine(8.0, 12.0, 10);
    CHECK(curve.stored() == once);  // what is there already is not stored twice
  }
}

TEST_CASE("neighbouring stretches grow together, and a closed curve's stretch may run over its start", "[arcwise]") {
  for (const Scheme scheme : all_schemes) {
    SparseCurve curve = base_curve(scheme);
    curve.refine(3.0, 9.0, 5);
    curve.refine(15.0, 20.0, 5);
    CHECK(curve.runs(4).size() == 2);
    roughen(curve);
    const Eigen::RowVectorXd kept = curve.detail(4, curve.runs(4)[0].first);
    curve.refine(5.0, 18.0, 5);
    CHECK(curve.runs(4).size() == 1);
    CHECK(curve.detail(4, curve.runs(4)[0].first) == kept);
  }
  for (const Scheme scheme : {Scheme::Chaikin, Scheme::Orthogonal}) {
    SparseCurve across = base_curve(scheme);
    across.refine(21.0, 26.5, 5);
    CHECK(across.runs(4).size() == 2);
    roughen(across);
    const MultiresCurve dense = across.dense();
    for (double t = 19.0; t < 30.0; t += 0.1) CHECK((across.evaluate(t) - dense_at(dense, t, 3)).norm() < 1e-10);
    SparseCurve turned = base_curve(scheme);
    turned.refine(21.0 - 48.0, 26.5 - 48.0, 5);
    CHECK(turned.stored() == across.stored());
  }
}

TEST_CASE("details of one level move the curve by what is asked, and only near there", "[arcwise]") {
  for (const Scheme scheme : all_schemes) {
    SparseCurve curve = base_curve(scheme);
    curve.refine(4.0, 16.0, 5);
    for (const double t : {7.3, 9.0, 11.71}) {
      for (int level = 2; level < 5; ++level) {
        const Eigen::RowVectorXd before = curve.evaluate(t);
        const Eigen::RowVectorXd far = curve.evaluate(2.0);
        curve.pull(t, level, Eigen::RowVector2d(3.0, -5.0));
        CHECK((curve.evaluate(t) - before - Eigen::RowVector2d(3.0, -5.0)).norm() < 1e-9);
        CHECK(curve.evaluate(2.0) == far);
      }
    }
    CHECK(message_of<InvalidInput>([&] { curve.pull(20.0, 4, Eigen::RowVector2d(1.0, 1.0)); }) ==
          "SparseCurve::pull: no stored wavelet of level 4 reaches 20");
  }
}

TEST_CASE("pruning forgets what is small, and nothing else", "[arcwise]") {
  SparseCurve curve = base_curve(Scheme::HeldCubic);
  curve.refine(4.0, 16.0, 5);
  curve.pull(9.0, 4, Eigen::RowVector2d(6.0, 0.0));
  SparseCurve pruned = curve;
  pruned.prune(0.0);
  CHECK(pruned.stored() <= base_curve(Scheme::HeldCubic).stored() + 7);  // as many wavelets as reach a point
  CHECK(pruned.stored() < curve.stored());
  for (double t = 0.0; t < 24.0; t += 0.11) CHECK(pruned.evaluate(t) == curve.evaluate(t));
  pruned.prune(100.0);
  CHECK(pruned.levels() == 2);
  CHECK(pruned.stored() == base_curve(Scheme::HeldCubic).stored());
}

TEST_CASE("stretches that are none and details that are not there are refused by value and place", "[arcwise]") {
  SparseCurve curve = base_curve(Scheme::EndpointCubic);
  CHECK(message_of<InvalidInput>([&] { curve.refine(5.0, 5.0, 4); }) ==
        "SparseCurve::refine: no stretch from 5 to 5 in 24 spans");
  CHECK(message_of<InvalidInput>([&] { curve.refine(20.0, 25.0, 4); }) ==
        "SparseCurve::refine: no stretch from 20 to 25 in 24 spans");
  CHECK(message_of<InvalidInput>([&] { curve.refine(5.0, 5.5, 3); }) ==
        "SparseCurve::refine: no wavelet of level 2 lies between 5 and 5.5");
  CHECK(message_of<InvalidInput>([&] { curve.refine(5.0, 9.0, 2); }) == "SparseCurve::refine: level 2 is not above 2");
  CHECK_THROWS_AS(curve.refine(std::numeric_limits<double>::quiet_NaN(), 9.0, 4), InvalidInput);
  CHECK_THROWS_AS(curve.refine(5.0, 9.0, 90), InvalidInput);
  CHECK(curve.stored() == base_curve(Scheme::EndpointCubic).stored());
  curve.refine(4.0, 12.0, 3);
  CHECK(message_of<InvalidInput>([&] { curve.set_detail(2, 20, Eigen::RowVector2d(1.0, 1.0)); }) ==
        "SparseCurve::set_detail: detail 20 of level 2 is not stored");
  CHECK_THROWS_AS(curve.set_detail(2, curve.runs(2)[0].first, Eigen::RowVector3d(1.0, 1.0, 1.0)), InvalidInput);
  CHECK_THROWS_AS(curve.control_points(2, -1, 3), InvalidInput);
}

namespace {

const OutlineCurve& letter() {
  static const OutlineCurve curve(shapes::letter_a()[0], {.tolerance = 0.5});
  return curve;
}

}  // namespace

TEST_CASE("arcs lie on the outline within the tolerance, and meet at its corners to the last bit", "[arcwise]") {
  const ArcwiseCurve arcs(letter(), {.tolerance = 0.5});
  REQUIRE(arcs.arcs().size() == letter().corner_pairs().size());
  for (std::size_t k = 0; k < arcs.arcs().size(); ++k) {
    const ArcwiseCurve::Arc& arc = arcs.arcs()[k];
    const ArcwiseCurve::Arc& next = arcs.arcs()[(k + 1) % arcs.arcs().size()];
    CHECK(arc.distance <= 0.5);
    for (double level = 0.0; level <= 12.0; level += 0.4) {  // at every level of either
      const Coefficients here = arc.at_level(std::min<double>(level, arc.curve.base().levels()));
      const Coefficients there = next.at_level(std::min<double>(level, next.curve.base().levels()));
      CHECK(here.bottomRows(1) == there.topRows(1));
    }
  }
  for (double s = 0.0; s < letter().length(); s += 13.7) {
    const auto [segment, u] = letter().outline().locate(s);
    CHECK((arcs.evaluate(s) - evaluate(letter().contour().segment(segment), u)).norm() <= 0.5);
  }
}

TEST_CASE("an arc that has reached its fewest points stops while others go on", "[arcwise]") {
  const ArcwiseCurve arcs(letter(), {.tolerance = 0.05});
  int deepest = 0;
  int shallowest = 100;
  for (const ArcwiseCurve::Arc& arc : arcs.arcs()) {
    const int levels = arc.curve.base().levels();
    deepest = std::max(deepest, levels);
    shallowest = std::min(shallowest, levels);
    CHECK(arc.level_of_scale(1e9) == 0.0);
    CHECK(arc.at_level(0.0).rows() == 4);
    CHECK(arc.level_of_scale(0.0) == levels);
  }
  CHECK(deepest >= 4);
  CHECK(shallowest == 0);  // a straight one
}

TEST_CASE("an arc is refined in a stretch of its own", "[arcwise]") {
  ArcwiseCurve arcs(letter(), {.tolerance = 0.5});
  int longest = 0;
  for (int k = 0; k < static_cast<int>(arcs.arcs().size()); ++k) {
    if (arcs.arcs()[static_cast<std::size_t>(k)].length > arcs.arc(longest).length) longest = k;
  }
  const ArcwiseCurve before = arcs;
  ArcwiseCurve::Arc& arc = arcs.arc(longest);
  const double from = arc.start + 0.3 * arc.length;
  const double to = arc.start + 0.7 * arc.length;
  const double middle = 0.5 * (from + to);
  arcs.refine(longest, from, to, 3);
  const int level = arc.curve.base().levels() + 2;
  arc.curve.pull(arc.parameter(middle), level, Eigen::RowVector2d(0.0, 8.0));
  CHECK((arcs.evaluate(middle) - before.evaluate(middle) - Point(0.0, 8.0)).norm() < 1e-9);
  for (double s = 0.0; s < letter().length(); s += 9.1) {
    if (s <= from || s >= to) CHECK((arcs.evaluate(s) - before.evaluate(s)).norm() < 1e-10);
  }
}

TEST_CASE("the arcwise view works with each open and each closed scheme, and refuses the others", "[arcwise]") {
  const OutlineCurve circle(shapes::circle(400), {.tolerance = 0.5});
  for (const Scheme scheme :
       {Scheme::EndpointQuadratic, Scheme::EndpointCubic, Scheme::HeldQuadratic, Scheme::HeldCubic}) {
    const ArcwiseCurve arcs(letter(), {.tolerance = 0.5, .open = scheme});
    for (double s = 1.0; s < letter().length(); s += 31.0) {
      const auto [segment, u] = letter().outline().locate(s);
      CHECK((arcs.evaluate(s) - evaluate(letter().contour().segment(segment), u)).norm() <= 0.5);
    }
  }
  for (const Scheme scheme : {Scheme::Chaikin, Scheme::Orthogonal}) {
    const ArcwiseCurve arcs(circle, {.tolerance = 0.5, .closed = scheme});
    REQUIRE(arcs.arcs().size() == 1);
    for (double s = 0.0; s < circle.length(); s += 31.0) CHECK(arcs.evaluate(s).norm() == Approx(400.0).epsilon(2e-3));
  }
  CHECK_THROWS_AS(ArcwiseCurve(circle, {.closed = Scheme::HeldCubic}), InvalidInput);
  CHECK_THROWS_AS(ArcwiseCurve(circle, {.open = Scheme::Chaikin}), InvalidInput);
  CHECK_THROWS_AS(ArcwiseCurve(circle, {.tolerance = 0.0}), InvalidInput);
  CHECK(message_of<InvalidInput>([&] { ArcwiseCurve(circle).pieces(-3.0, 1.0); }) ==
        "ArcwiseCurve: scale -3 is not a length");
  CHECK_THROWS_AS(ArcwiseCurve(circle).pieces(std::nan(""), 1.0), InvalidInput);
  CHECK_THROWS_AS(ArcwiseCurve(circle).pieces(3.0, -1.0), InvalidInput);
}

TEST_CASE("with corners rounded a contour is one closed arc across them", "[arcwise]") {
  const OutlineCurve square(shapes::square(600), {.tolerance = 0.5});
  const ArcwiseCurve kept(square);
  CHECK(kept.arcs().size() == 4);
  const ArcwiseCurve round(square, {.tolerance = 2.0, .corners = Corners::Round});
  REQUIRE(round.arcs().size() == 1);
  CHECK(round.arcs()[0].length == Approx(2400.0));
  CHECK(round.arcs()[0].distance <= 2.0);
  // Shown without features below 400 units its corners are far from the square's.
  constexpr int places = 20;
  double nearest = 1e9;
  for (const Bezier& piece : round.pieces(400.0, 0.1)) {
    for (int k = 0; k < places; ++k)
      nearest = std::min(nearest, evaluate(piece, static_cast<double>(k) / places).norm());
  }
  CHECK(nearest > 30.0);
  for (const Bezier& piece : kept.pieces(400.0, 0.1)) {
    for (int k = 0; k < places; ++k) {
      const Point off = evaluate(piece, static_cast<double>(k) / places) - Point(300, 300);
      CHECK(off.cwiseAbs().maxCoeff() == Approx(300.0));  // on the square
    }
  }
}

TEST_CASE("a compressed curve stays within its proved bound, with fewer pieces the more it may differ", "[arcwise]") {
  for (const Scheme scheme :
       {Scheme::Chaikin, Scheme::Orthogonal, Scheme::EndpointQuadratic, Scheme::EndpointCubic, Scheme::HeldCubic}) {
    const Eigen::Index size = 128 + (is_closed(scheme) ? 0 : degree(scheme));
    Coefficients fine(size, 2);
    for (Eigen::Index i = 0; i < size; ++i) {
      const double a = 6.283185307179586 * static_cast<double>(i) / static_cast<double>(size);
      // Smooth on one half, finely waved on the other.
      fine.row(i) << 500.0 * std::cos(a) + (i > size / 2 ? 4.0 * std::cos(40.0 * a) : 0.0), 300.0 * std::sin(a);
    }
    const MultiresCurve curve = decompose(scheme, fine, 5);
    std::size_t fewest = 129;
    for (const double tolerance : {0.01, 0.3, 2.0, 8.0, 40.0}) {
      const CompressedCurve compressed = compress(curve, tolerance);
      CHECK(compressed.bound <= tolerance * (1.0 + 1e-12));
      CHECK(compressed.pieces.size() <= fewest);
      fewest = compressed.pieces.size();
      double from = finer_parameter(scheme, is_closed(scheme) ? -0.5 : 0.0, 5);
      double farthest = 0.0;
      for (std::size_t k = 0; k < compressed.pieces.size(); ++k) {
        const Bezier& piece = compressed.pieces[k];
        const double spans = std::ldexp(1.0, 5 - compressed.levels[k]);
        for (int i = 0; i <= 32; ++i) {
          const double t = from + spans * i / 32.0;
          const Point there = evaluate(scheme, fine, t).transpose();
          farthest = std::max(farthest, (evaluate(piece, i / 32.0) - there).norm());
        }
        from += spans;
        if (k > 0) CHECK(piece.start() == compressed.pieces[k - 1].end());
      }
      CHECK(farthest <= compressed.bound + 1e-9);
      if (is_closed(scheme)) CHECK(compressed.pieces.front().start() == compressed.pieces.back().end());
    }
    CHECK(fewest < 32);
  }
}

TEST_CASE("of a curve without detail the coarsest spans are left", "[arcwise]") {
  Coefficients coarse(7, 2);
  coarse << 0, 0, 50, 80, 120, 90, 200, -40, 260, 10, 330, 60, 400, 0;
  MultiresCurve curve{coarse, {}, Scheme::EndpointCubic};
  for (int level = 0; level < 4; ++level) curve.details.push_back(Coefficients::Zero(4 << level, 2));
  CHECK(compress(curve, 1e-9).pieces.size() == 4);
  CHECK_THROWS_AS(compress(curve, -1.0), InvalidInput);
}
