#include "common/random.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lumen {
namespace {

// SplitMix64 seeded with 1234567 gives these numbers (the generator's published test vector).
TEST(Random, MixerIsSplitMix64) {
  uint64_t state = 1234567;
  const uint64_t expected[] = {6457827717110365317ull, 3203168211198807973ull, 9817491932198370423ull,
                               4593380528125082431ull, 16408922859458223821ull};
  for (uint64_t value : expected) {
    EXPECT_EQ(Mix64(state), value);
    state += 0x9e3779b97f4a7c15ull;
  }
}

TEST(Random, UniformStaysBelowOne) {
  EXPECT_EQ(UniformFloat(0), 0.0f);
  EXPECT_LT(UniformFloat(~0ull), 1.0f);
  EXPECT_LT(UniformDouble(~0ull), 1.0);
}

// Over neighbouring pixels, samples and dimensions the numbers are uniform: χ² over 64 bins of 3 × 65536
// numbers, 63 degrees of freedom; mean 63, standard deviation √126, bound at five of them.
TEST(Random, NeighbouringCoordinatesAreUniform) {
  for (int axis = 0; axis < 3; ++axis) {
    int bins[64] = {};
    for (uint64_t i = 0; i < 65536; ++i) {
      const SampleStream stream(7, axis == 0 ? i : 5, axis == 1 ? i : 3);
      ++bins[static_cast<int>(stream.Uniform(axis == 2 ? static_cast<uint32_t>(i) : 2) * 64)];
    }
    double chi2 = 0;
    for (int count : bins) chi2 += (count - 1024.0) * (count - 1024.0) / 1024.0;
    EXPECT_LT(chi2, 63 + 5 * std::sqrt(126.0));
  }
}

}  // namespace
}  // namespace lumen
