// Means with their standard errors, squares of wall, and tissue by its albedos: what the tests of subsurface
// scattering share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/mesh.h"
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

inline Mean MeanOf(const std::vector<double>& values) {
  Mean mean;
  for (const double value : values) mean.Add(value);
  return mean;
}

inline void ExpectAgree(const Mean& a, const Mean& b) {
  EXPECT_LT(std::abs(a.value() - b.value()), kBound * std::hypot(a.error(), b.error()))
      << a.value() << " ± " << a.error() << " against " << b.value() << " ± " << b.error();
}

inline void ExpectMean(const Mean& mean, double expected) {
  EXPECT_LT(std::abs(mean.value() - expected), kBound * mean.error() + 1e-6)
      << mean.value() << " ± " << mean.error() << " against " << expected;
}

// A square in the plane z, its normal along ±z.
inline void AddSquare(double half_mm, double z, bool up, Mesh* mesh) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (const auto& [x, y] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
    mesh->vertices.push_back({x * half_mm, y * half_mm, z});
  }
  for (const Vec3i& face : {Vec3i(0, 1, 2), Vec3i(0, 2, 3)}) {
    const Vec3i turned = up ? face : Vec3i(face[0], face[2], face[1]);
    mesh->faces.push_back(turned + Vec3i::Constant(first));
  }
}

inline SubsurfaceOptions WithAlbedos(const Vec3d& albedos, const Vec3d& extinctions) {
  return {extinctions.cwiseProduct(Vec3d::Ones() - albedos), extinctions.cwiseProduct(albedos)};
}

}  // namespace lumen::test
