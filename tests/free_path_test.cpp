// How far light goes in tissue between two collisions.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/random.h"
#include "sim/imaging/subsurface.h"
#include "tests/tissue_means.h"

namespace lumen {
namespace {

using test::ExpectMean;
using test::Mean;
using test::WithAlbedos;

// Sum over cells of the squared deviation, less the cells, in standard deviations.
double ChiSquareDeviation(const std::vector<double>& counts, double expected) {
  double sum = 0;
  for (const double count : counts) sum += (count - expected) * (count - expected) / expected;
  const double freedom = double(counts.size()) - 1;
  return (sum - freedom) / std::sqrt(2 * freedom);
}

TEST(FreePath, IsExponential) {
  const Vec3d extinctions(0.7, 2, 5);
  const Subsurface tissue(WithAlbedos({0.5, 0.6, 0.7}, extinctions));
  const int count = 200000, cells = 50;
  const auto deviation = [&](int channel, double tested) {
    std::vector<double> found(cells, 0);
    for (int i = 0; i < count; ++i) {
      const SampleStream random(3, uint64_t(channel), uint64_t(i));
      const float path = tissue.FreePath(Vec3f::Unit(channel) * 0.3f, random.Uniform(0), random.Uniform(1));
      found[std::min(cells - 1, int(cells * -std::expm1(-tested * path)))] += 1;
    }
    return ChiSquareDeviation(found, double(count) / cells);
  };
  for (int c = 0; c < 3; ++c) {
    EXPECT_LT(std::abs(deviation(c, extinctions[c])), 5);
    EXPECT_GT(deviation(c, 1.1 * extinctions[c]), 20);
  }
}

// Of a path that is drawn for all channels, each keeps its own exponential: what it carries after collisions
// within a range of lengths, and after meeting a wall.
TEST(FreePath, KeepsEveryChannelsOwn) {
  const Vec3d albedos(0.5, 0.6, 0.7), extinctions(0.7, 2, 5);
  const Subsurface tissue(WithAlbedos(albedos, extinctions));
  const Vec3f before(0.9f, 0.2f, 0.5f);
  const double wall = 0.8;
  Mean early[3], late[3], crossed[3];
  double most = 0;
  for (int i = 0; i < 200000; ++i) {
    const SampleStream random(4, 0, uint64_t(i));
    const float path = tissue.FreePath(before, random.Uniform(0), random.Uniform(1));
    Vec3f carried = before;
    if (path < wall) {
      tissue.Scatter(path, &carried);
    } else {
      tissue.Cross(float(wall), &carried);
    }
    most = std::max(most, double(carried.sum()));
    for (int c = 0; c < 3; ++c) {
      early[c].Add(path < wall / 2 ? carried[c] : 0);
      late[c].Add(path >= wall / 2 && path < wall ? carried[c] : 0);
      crossed[c].Add(path >= wall ? carried[c] : 0);
    }
  }
  for (int c = 0; c < 3; ++c) {
    const double half = std::exp(-extinctions[c] * wall / 2);
    ExpectMean(early[c], before[c] * albedos[c] * (1 - half));
    ExpectMean(late[c], before[c] * albedos[c] * half * (1 - half));
    ExpectMean(crossed[c], before[c] * half * half);
  }
  EXPECT_LE(most, double(before.sum()) * (1 + 1e-6));
}

}  // namespace
}  // namespace lumen
