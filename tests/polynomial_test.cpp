#include "common/polynomial.h"

#include <gtest/gtest.h>

namespace lumen {
namespace {

TEST(Polynomial, ValueAndSlope) {
  // 2 − 3x + 5x³ at x = −2: 2 + 6 − 40 and −3 + 60.
  const auto [value, slope] = EvaluatePolynomial(std::array<double, 4>{2, -3, 0, 5}, -2.0);
  EXPECT_EQ(value, -32);
  EXPECT_EQ(slope, 57);
}

// (x − 1)(x − 2)(x − 4) = −8 + 14x − 7x² + x³
TEST(Polynomial, SignChangesAreTheRootsInside) {
  const std::vector<double> cubic = {-8, 14, -7, 1};
  const auto all = SignChanges(cubic, 0, 10);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_NEAR(all[0], 1, 1e-14);
  EXPECT_NEAR(all[1], 2, 1e-14);
  EXPECT_NEAR(all[2], 4, 1e-14);
  EXPECT_EQ(SignChanges(cubic, 1.5, 3).size(), 1u);
  EXPECT_TRUE(SignChanges(cubic, 4.5, 9).empty());
  EXPECT_TRUE(SignChanges({1, 0, 1}, -5, 5).empty());
  EXPECT_TRUE(SignChanges({4, -4, 1}, 0, 5).empty());  // (x − 2)² touches zero
  EXPECT_TRUE(SignChanges({3}, 0, 5).empty());
}

// Newton's method alone diverges on the arc tangent from beyond 1.39, and from 0 on x³ − 8 it has no slope to
// follow: inside a bracket both arrive.
TEST(Polynomial, BracketHoldsNewton) {
  const auto arc_tangent = [](double x) { return ValueAndSlope<double>{std::atan(x), 1 / (1 + x * x)}; };
  EXPECT_NEAR(SolveIncreasing(arc_tangent, -100.0, 90.0, 50.0), 0, 1e-15);
  const auto flat_start = [](double x) { return ValueAndSlope<double>{x * x * x - 8, 3 * x * x}; };
  EXPECT_NEAR(SolveIncreasing(flat_start, 0.0, 1e6, 0.0), 2, 1e-15);
  EXPECT_NEAR(SolveIncreasing(flat_start, 0.0, 1e6, 1e9), 2, 1e-15);
}

}  // namespace
}  // namespace lumen
