#include "sim/imaging/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <set>
#include <vector>

namespace lumen {
namespace {

using Points = std::vector<Vec2f>;

Points OfPair(uint64_t seed, uint64_t pixel, uint32_t first, uint32_t count, uint32_t pair) {
  Points points;
  for (uint32_t i = first; i < first + count; ++i) points.push_back(Sampler(seed, pixel, i).Pair(pair));
  return points;
}

Points Independent(uint64_t seed, uint64_t pixel, uint32_t first, uint32_t count, uint32_t pair) {
  Points points;
  for (uint32_t i = first; i < first + count; ++i) {
    const SampleStream stream(seed, pixel, i);
    points.push_back(Vec2f(stream.Uniform(2 * pair), stream.Uniform(2 * pair + 1)));
  }
  return points;
}

// Whether each of the rectangles 2^−a × 2^−b, a + b = m, that tile the square holds one of the 2^m points.
bool IsNet(const Points& points, int m) {
  for (int a = 0; a <= m; ++a) {
    std::set<std::pair<int, int>> cells;
    for (const Vec2f& p : points) cells.insert({int(p.x() * (1 << a)), int(p.y() * (1 << (m - a)))});
    if (cells.size() != points.size()) return false;
  }
  return true;
}

// The direction numbers of x + 1 are each the one before xor its shift by one.
uint32_t SobolSecondByDirections(uint32_t index) {
  uint32_t result = 0;
  for (uint32_t direction = 1u << 31; index; index >>= 1, direction ^= direction >> 1) {
    if (index & 1) result ^= direction;
  }
  return result;
}

TEST(Sampler, SecondDimensionIsSobols) {
  for (uint32_t i = 0; i < 100000; ++i) {
    const uint32_t index = i < 4096 ? i : static_cast<uint32_t>(RandomBits(3, i));
    ASSERT_EQ(ReverseBits(SobolSecondReversed(index)), SobolSecondByDirections(index)) << index;
  }
  // 0, 1/2, 3/4, 1/4, 5/8: by hand.
  const uint32_t first[] = {0u, 1u << 31, 3u << 30, 1u << 30, 5u << 29};
  for (uint32_t i = 0; i < 5; ++i) EXPECT_EQ(ReverseBits(SobolSecondReversed(i)), first[i]) << i;
}

TEST(Sampler, EverySixteenSamplesAreANet) {
  for (uint64_t pixel = 0; pixel < 200; ++pixel) {
    for (const uint32_t pair : {0u, 1u, 7u}) {
      for (const uint32_t first : {0u, 16u, 4096u}) EXPECT_TRUE(IsNet(OfPair(5, pixel, first, 16, pair), 4));
    }
    EXPECT_TRUE(IsNet(OfPair(6, pixel, 256, 256, 3), 8));
    EXPECT_FALSE(IsNet(Independent(5, pixel, 0, 16, 0), 4));
  }
}

TEST(Sampler, NumbersAreInTheUnitInterval) {
  for (uint32_t i = 0; i < 100000; ++i) {
    const Vec2f p = Sampler(1, i, i % 32).Pair(i % 11);
    ASSERT_TRUE(p.minCoeff() >= 0 && p.maxCoeff() < 1) << i;
  }
}

// χ² of 16 × 16 cells: 255 degrees of freedom, standard deviation √510; 5 of them allowed.
double ChiSquare(const std::function<Vec2f(int)>& point, int count) {
  std::vector<int> cells(256, 0);
  for (int i = 0; i < count; ++i) {
    const Vec2f p = point(i);
    ++cells[int(p.x() * 16) * 16 + int(p.y() * 16)];
  }
  double sum = 0;
  for (const int n : cells) sum += std::pow(n - count / 256.0, 2) / (count / 256.0);
  return sum;
}

TEST(Sampler, UniformOverPixelsAndSeeds) {
  const double most = 255 + 5 * std::sqrt(510.0), least = 255 - 5 * std::sqrt(510.0);
  const std::vector<std::function<Vec2f(int)>> uses = {
      [](int i) { return Sampler(1, i, 0).Pair(0); },
      [](int i) { return Sampler(1, i, 3).Pair(5); },
      [](int i) { return Sampler(i, 77, 2).Pair(1); },
  };
  for (const auto& use : uses) {
    const double found = ChiSquare(use, 65536);
    EXPECT_LT(found, most);
    EXPECT_GT(found, least);
  }
  EXPECT_GT(ChiSquare([](int i) { return Vec2f(Sampler(1, i, 0).Pair(0).cwiseAbs2()); }, 65536), most);
}

// Numbers of different pixels, seeds and pairs together fill the square like independent ones.
TEST(Sampler, PixelsSeedsAndPairsAreUnrelated) {
  const double most = 255 + 5 * std::sqrt(510.0);
  const std::vector<std::function<Vec2f(int)>> uses = {
      [](int i) { return Vec2f(Sampler(1, i, 0).Pair(0).x(), Sampler(1, i + 1, 0).Pair(0).x()); },
      [](int i) { return Vec2f(Sampler(1, i, 0).Pair(0).x(), Sampler(2, i, 0).Pair(0).x()); },
      [](int i) { return Vec2f(Sampler(1, i, 0).Pair(0).x(), Sampler(1, i, 0).Pair(1).x()); },
      [](int i) { return Vec2f(Sampler(1, i, 0).Pair(0).y(), Sampler(1, i, 0).Pair(3).x()); },
      [](int i) {
        return Vec2f(Sampler(1, i / 16, i % 16).Pair(0).x(), Sampler(1, i / 16, i % 16).Pair(1).x());
      },
  };
  for (size_t use = 0; use < uses.size(); ++use) EXPECT_LT(ChiSquare(uses[use], 65536), most) << use;
  EXPECT_GT(ChiSquare([](int i) -> Vec2f { return Vec2f::Constant(Sampler(1, i, 0).Pair(0).x()); }, 65536),
            most);
}

// Root mean square error of the mean of x·y² + e^x over many pixels.
double Error(Points (*points)(uint64_t, uint64_t, uint32_t, uint32_t, uint32_t), uint32_t count) {
  const double exact = 1.0 / 6 + std::exp(1.0) - 1;
  double sum = 0;
  const int pixels = 300;
  for (int pixel = 0; pixel < pixels; ++pixel) {
    double mean = 0;
    for (const Vec2f& p : points(9, pixel, 0, count, 2)) {
      mean += double(p.x()) * p.y() * p.y() + std::exp(double(p.x()));
    }
    sum += std::pow(mean / count - exact, 2);
  }
  return std::sqrt(sum / pixels);
}

// Independent numbers: error · √N is constant. Owen's scrambling: near N^(−3/2) for a smooth integrand.
TEST(Sampler, MeanConvergesFasterThanIndependentNumbers) {
  const double order = std::log2(Error(OfPair, 16) / Error(OfPair, 1024)) / 6;
  const double independent = std::log2(Error(Independent, 16) / Error(Independent, 1024)) / 6;
  EXPECT_GT(order, 1.2);
  EXPECT_NEAR(independent, 0.5, 0.1);
  EXPECT_LT(Error(OfPair, 64), Error(Independent, 64) / 8);
}

Vec2f IndependentPair(uint64_t seed, uint64_t pixel, uint32_t sample, uint32_t pair) {
  return Sampler(seed, pixel, sample, Sampling::kIndependent).Pair(pair);
}

Points OfIndependentPair(uint64_t seed, uint64_t pixel, uint32_t first, uint32_t count, uint32_t pair) {
  Points points;
  for (uint32_t i = first; i < first + count; ++i) points.push_back(IndependentPair(seed, pixel, i, pair));
  return points;
}

TEST(Sampler, IndependentNumbersAreIndependentFromSampleToSample) {
  const double most = 255 + 5 * std::sqrt(510.0), least = 255 - 5 * std::sqrt(510.0);
  const std::vector<std::function<Vec2f(int)>> uses = {
      [](int i) { return IndependentPair(1, 7, i, 0); },
      [](int i) { return IndependentPair(1, i, 3, 5); },
      [](int i) { return Vec2f(IndependentPair(1, 7, i, 0).x(), IndependentPair(1, 7, i + 1, 0).x()); },
      [](int i) { return Vec2f(IndependentPair(1, 7, i, 0).x(), IndependentPair(1, 7, i, 1).x()); },
      [](int i) { return Vec2f(IndependentPair(1, i, 4, 0).x(), IndependentPair(1, i + 1, 4, 0).x()); },
  };
  for (size_t use = 0; use < uses.size(); ++use) {
    EXPECT_LT(ChiSquare(uses[use], 65536), most) << use;
    EXPECT_GT(ChiSquare(uses[use], 65536), least) << use;  // Sobol's would be far below
  }
  EXPECT_LT(ChiSquare([](int i) { return Sampler(1, 7, i).Pair(0); }, 65536), least);
  const double order = std::log2(Error(OfIndependentPair, 16) / Error(OfIndependentPair, 1024)) / 6;
  EXPECT_NEAR(order, 0.5, 0.1);
}

TEST(Sampler, LanesHaveTheSameNumbers) {
  for (const Sampling sampling : {Sampling::kSobol, Sampling::kIndependent}) {
    uint64_t pixels[kLanes];
    for (int i = 0; i < kLanes; ++i) pixels[i] = (uint64_t{3} << 40) + 1000 * i;
    const SamplerLanes lanes(9, pixels, sampling);
    for (uint32_t pair : {0u, 5u, 0xfffffffeu}) {
      LanesU samples;
      for (int i = 0; i < kLanes; ++i) samples[i] = static_cast<uint32_t>(7 * i + pair);
      Lanes u, v;
      lanes.Pair(samples, pair, &u, &v);
      for (int i = 0; i < kLanes; ++i) {
        EXPECT_EQ(Vec2f(u[i], v[i]), Sampler(9, pixels[i], samples[i], sampling).Pair(pair));
      }
    }
  }
}

}  // namespace
}  // namespace lumen
