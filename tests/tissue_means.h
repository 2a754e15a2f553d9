// Means with their standard errors, and tissue by its albedos: what the tests of subsurface scattering share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "sim/imaging/subsurface.h"

namespace lumen::test {

// Standard errors that a mean may be off: one in 300,000 estimates is further.
inline constexpr double kBound = 4.5;

struct Mean {
  double sum = 0, squares = 0;
  int64_t count = 0;
  void Add(double value) {
    sum += value;
    squares += value * value;
    ++count;
  }
  double value() const { return sum / double(count); }
  double error() const {
    return std::sqrt(std::max(0.0, squares / double(count) - value() * value()) / double(count));
  }
};

inline void ExpectAgree(const Mean& a, const Mean& b) {
  EXPECT_LT(std::abs(a.value() - b.value()), kBound * std::hypot(a.error(), b.error()))
      << a.value() << " ± " << a.error() << " against " << b.value() << " ± " << b.error();
}

inline void ExpectMean(const Mean& mean, double expected) {
  EXPECT_LT(std::abs(mean.value() - expected), kBound * mean.error() + 1e-6)
      << mean.value() << " ± " << mean.error() << " against " << expected;
}

inline SubsurfaceOptions WithAlbedos(const Vec3d& albedos, const Vec3d& extinctions) {
  return {extinctions.cwiseProduct(Vec3d::Ones() - albedos), extinctions.cwiseProduct(albedos)};
}

}  // namespace lumen::test
