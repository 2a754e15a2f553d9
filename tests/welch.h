// Welch's test of two means (Welch 1947, "The generalization of 'Student's' problem when several different
// population variances are involved").
#pragma once

#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace lumen::test {

// How likely two means of `count` runs each differ by so much and more by chance; the variances are those of
// the means. At least one of them is above 0.
inline double WelchChance(double difference, double variance_a, double variance_b, int count) {
  const double variance = variance_a + variance_b;
  const double freedom =
      (count - 1) * variance * variance / (variance_a * variance_a + variance_b * variance_b);
  const boost::math::students_t chance(freedom);
  return 2 * boost::math::cdf(boost::math::complement(chance, std::abs(difference) / std::sqrt(variance)));
}

// The chance that each of `count` tests may have, so that any of them is below it once in 1/all (Šidák 1967).
inline double SharedOut(double all, double count) { return -std::expm1(std::log1p(-all) / count); }

}  // namespace lumen::test
