// Weights of a ray's samples: closed forms, rays cut fine, and their gradients against central differences.
#include "recon/surface/volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::Difference;
using test::Random;

// The integral of the density seen by a ray in NeuS's closed form: with f falling linearly through 0, what
// passes is Φ(s·f_last)/Φ(s·f_first).
TEST(Volume, WeightsTelescope) {
  const double f[] = {3, 2.2, 1, 0.4, -0.1, -0.5, -2};
  double occupancy[7], transmittance[7], weight[7];
  for (double sharpness : {0.3, 1.0, 4.4, 50.0}) {
    RayWeights(7, f, sharpness, occupancy, transmittance, weight);
    double sum = 0;
    for (double w : weight) sum += w;
    const double passes = std::exp(LogSigmoid(sharpness * -2) - LogSigmoid(sharpness * 3));
    EXPECT_NEAR(transmittance[6], passes, 1e-14);
    EXPECT_NEAR(sum, 1, 1e-14);  // what passes is the last sample's
    EXPECT_GT(weight[6], passes);
  }
}

TEST(Volume, GradientMatchesFiniteDifferences) {
  uint64_t state = 23;
  for (double sharpness : {0.3, 2.0, 10.0}) {
    double f[9], by_weight[9], occupancy[9], transmittance[9], weight[9], gradient[9];
    for (int i = 0; i < 9; ++i) {
      f[i] = 2 - 0.5 * i + 0.6 * Random(state);  // mostly falling, some sections rise
      by_weight[i] = Random(state);
    }
    auto loss = [&] {
      RayWeights(9, f, sharpness, occupancy, transmittance, weight);
      double sum = 0;
      for (int i = 0; i < 9; ++i) sum += weight[i] * by_weight[i];
      return sum;
    };
    loss();
    RayWeightsBackward(9, f, sharpness, occupancy, transmittance, by_weight, gradient);
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(gradient[i], Difference(loss, &f[i]), 1e-8);
  }
}

// A ray with a colour at each sample, both linear from sample to sample: cut into thousands of sections, on
// which any rule agrees, it has the radiance that the linear weights give uncut, and the trapezoidal rule
// doesn't. Rays that cross the wall, one of thin sections, and one that starts deep in it.
TEST(Volume, LinearWeightsIntegrateLinearColor) {
  constexpr int kSamples = 9, kParts = 4000, kFine = (kSamples - 1) * kParts + 1;
  uint64_t state = 31;
  double farthest_trapezoid = 0;
  for (const auto& [sharpness, offset_mm] : {std::pair(0.05, 0.0), std::pair(0.3, 0.0), std::pair(2.0, 0.0),
                                             std::pair(10.0, 0.0), std::pair(2.0, -30.0)}) {
    double f[kSamples], color[kSamples], occupancy[kSamples], transmittance[kSamples], share[kSamples],
        weight[kSamples];
    for (int i = 0; i < kSamples; ++i) {
      f[i] = offset_mm + 4 - i + 1.2 * Random(state);  // some sections rise
      color[i] = Random(state);
    }
    LinearRayWeights(kSamples, f, sharpness, occupancy, transmittance, share, weight);
    double found = 0, sum = 0, trapezoid = 0;
    for (int i = 0; i < kSamples; ++i) {
      found += weight[i] * color[i];
      sum += weight[i];
      EXPECT_GE(weight[i], 0);
    }
    EXPECT_NEAR(sum, 1, 1e-14);
    RayWeights(kSamples, f, sharpness, occupancy, transmittance, weight);
    for (int i = 0; i < kSamples; ++i) trapezoid += weight[i] * color[i];

    std::vector<double> fine(kFine), fine_color(kFine), a(kFine), b(kFine), fine_weight(kFine);
    for (int k = 0; k < kFine; ++k) {
      const int i = std::min(k / kParts, kSamples - 2);
      const double part = double(k - i * kParts) / kParts;
      fine[k] = f[i] + part * (f[i + 1] - f[i]);
      fine_color[k] = color[i] + part * (color[i + 1] - color[i]);
    }
    RayWeights(kFine, fine.data(), sharpness, a.data(), b.data(), fine_weight.data());
    double expected = 0;
    for (int k = 0; k < kFine; ++k) expected += fine_weight[k] * fine_color[k];
    EXPECT_NEAR(found, expected, 1e-6) << sharpness;
    farthest_trapezoid = std::max(farthest_trapezoid, std::abs(trapezoid - expected));
  }
  EXPECT_GT(farthest_trapezoid, 1e-2);
}

// Thick sections by the closed form, thin ones by the series.
TEST(Volume, GradientOfLinearWeightsMatchesFiniteDifferences) {
  uint64_t state = 29;
  for (double sharpness : {0.05, 0.3, 0.41, 2.0, 10.0, 40.0}) {
    double f[9], by_weight[9], occupancy[9], transmittance[9], share[9], weight[9], gradient[9];
    for (int i = 0; i < 9; ++i) {
      f[i] = 2 - 0.5 * i + 0.6 * Random(state);
      by_weight[i] = Random(state);
    }
    auto loss = [&] {
      LinearRayWeights(9, f, sharpness, occupancy, transmittance, share, weight);
      double sum = 0;
      for (int i = 0; i < 9; ++i) sum += weight[i] * by_weight[i];
      return sum;
    };
    loss();
    LinearRayWeightsBackward(9, f, sharpness, occupancy, transmittance, share, by_weight, gradient);
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(gradient[i], Difference(loss, &f[i]), 1e-7 * sharpness) << i;
  }
}

}  // namespace
}  // namespace lumen
