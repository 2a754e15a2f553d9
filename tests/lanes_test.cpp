// What the packets of rays are written in, lane by lane against double and the standard library, on
// processors with AVX-512 and, in lumen_portable_tests, without.
#include "common/lanes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <limits>
#include <string>

#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::Random;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Lanes RandomLanes(uint64_t& state, double size) {
  Lanes lanes;
  for (int i = 0; i < kLanes; ++i) lanes[i] = static_cast<float>(size * Random(state));
  return lanes;
}

double UnitInLastPlace(double value) {
  const auto nearest = static_cast<float>(value);
  return std::nextafter(nearest, kInfinity) - nearest;
}

// This program is compiled for what its name says.
TEST(Lanes, AreThoseOfTheProgram) {
#ifdef __AVX512F__
  EXPECT_EQ(std::string(program_invocation_short_name).find("portable"), std::string::npos);
#endif
}

TEST(Lanes, ExponentialIsWithinTwoUnits) {
  uint64_t state = 1;
  for (int i = 0; i < 20000; ++i) {
    const Lanes x = RandomLanes(state, i % 2 ? 87 : 1), found = Exp(x);
    for (int lane = 0; lane < kLanes; ++lane) {
      const double expected = std::exp(double(x[lane]));
      ASSERT_LE(std::abs(found[lane] - expected), 2 * UnitInLastPlace(expected)) << x[lane];
    }
  }
  const Lanes edges = Exp(Lanes{-87.01f, -1e30f, -kInfinity, 0, 88, 1e30f, kInfinity, std::nanf("")});
  EXPECT_EQ(edges[0], 0);
  EXPECT_EQ(edges[1], 0);
  EXPECT_EQ(edges[2], 0);
  EXPECT_EQ(edges[3], 1);
  EXPECT_EQ(edges[4], edges[5]);
  EXPECT_EQ(edges[4], edges[6]);
  EXPECT_NEAR(edges[4] / std::exp(88.0), 1, 2e-7);
  EXPECT_TRUE(std::isnan(edges[7]));
}

// IEC 60559's square root is rounded to nearest: that of double, rounded once more, is the same.
TEST(Lanes, RootsAndRoundingAreThoseOfIec60559) {
  uint64_t state = 2;
  for (int i = 0; i < 5000; ++i) {
    const Lanes x = RandomLanes(state, 1e6), root = Sqrt(Abs(x));
    const LanesI floor = FloorInt(x), cut = Truncate(x);
    for (int lane = 0; lane < kLanes; ++lane) {
      ASSERT_EQ(root[lane], static_cast<float>(std::sqrt(std::abs(double(x[lane])))));
      ASSERT_EQ(floor[lane], std::floor(double(x[lane])));
      ASSERT_EQ(cut[lane], std::trunc(double(x[lane])));
    }
  }
  EXPECT_EQ(FloorInt(Lanes{-3.0f})[0], -3);
  const Lanes edges = Sqrt(Lanes{0, kInfinity, -1, std::nanf("")});
  EXPECT_EQ(edges[0], 0);
  EXPECT_EQ(edges[1], kInfinity);
  EXPECT_TRUE(std::isnan(edges[2]) && std::isnan(edges[3]));
}

TEST(Lanes, MasksAndTables) {
  uint64_t state = 3;
  float table[100];
  int32_t numbers[100];
  for (int i = 0; i < 100; ++i) {
    table[i] = static_cast<float>(Random(state));
    numbers[i] = i * i;
  }
  for (int i = 0; i < 1000; ++i) {
    const Lanes a = RandomLanes(state, 1), b = RandomLanes(state, 1);
    const float threshold = static_cast<float>(1.2 * Random(state));
    const LanesI mask = a > threshold, index = Truncate((a + 1) * 49.5f);
    int count = 0;
    for (int lane = 0; lane < kLanes; ++lane) count += a[lane] > threshold;
    ASSERT_EQ(Count(mask), count);
    ASSERT_EQ(Any(mask), count > 0);
    const Lanes from_table = Gather(table, index), low = Min(a, b), high = Max(a, b);
    const LanesI from_numbers = Gather(numbers, index);
    for (int lane = 0; lane < kLanes; ++lane) {
      ASSERT_EQ(from_table[lane], table[index[lane]]);
      ASSERT_EQ(from_numbers[lane], index[lane] * index[lane]);
      ASSERT_EQ(low[lane], std::min(a[lane], b[lane]));
      ASSERT_EQ(high[lane], std::max(a[lane], b[lane]));
    }
  }
  const Lanes numbers_not = Lanes{std::nanf(""), kInfinity, -kInfinity, 3.4e38f};
  EXPECT_EQ(Count(IsFinite(numbers_not)), kLanes - 3);
  EXPECT_EQ(Min(numbers_not, Broadcast(2))[0], 2);  // the second operand
  EXPECT_EQ(Max(numbers_not, Broadcast(2))[0], 2);
}

}  // namespace
}  // namespace lumen
