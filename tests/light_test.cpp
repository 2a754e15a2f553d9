// The long numbers were worked out apart from this code in 40-digit decimal arithmetic (Python's `decimal`).
#include "common/light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/random.h"

namespace lumen {
namespace {

template <class T>
class LightOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(LightOf, Scalars);

// A dozen roundings, of which the exponent magnifies those of 1 − D·L by the spread (below 3 here).
template <class T>
constexpr double kRelative = 3 * 12 * std::numeric_limits<T>::epsilon();

TYPED_TEST(LightOf, OffAxisSourceAgreesWithNumberWorkedOutApart) {
  using T = TypeParam;
  const auto light = IrradianceAt<T>(Vec3d(3.24, 0.55, 0).cast<T>(), Vec3d(0.6, 0, 0.8).cast<T>(), T(2.5),
                                     Vec3<T>(10, -5, 40));
  const double expected = 0.0004425405464054501674;
  EXPECT_NEAR(light.per_intensity, expected, expected * kRelative<T>);
  const Vec3d toward(-0.165099175382661231379, 0.135547399907362401503, -0.976918197530539830649);
  EXPECT_LT((light.toward.template cast<double>() - toward).norm(), kRelative<T>);
}

TYPED_TEST(LightOf, EndomapperLightAgreesWithNumbersWorkedOutApart) {
  using T = TypeParam;
  const Light light = EndomapperLight();
  ASSERT_EQ(light.sources.size(), 1u);
  const LightSource& source = light.sources[0];
  EXPECT_EQ(source.intensity, Vec3d(1, 1, 1));
  EXPECT_NEAR(source.direction.norm(), 1, 1e-15);
  const struct {
    Vec3d point;
    double expected;
  } examples[] = {{{0, 0, 30}, 0.0008826299056232801815},
                  {{20, -10, 15}, 0.0004648435930749078977},
                  {{5, 5, -10}, 0.0001083811354691009288}};  // behind the source it still shines, if faintly
  for (const auto& example : examples) {
    const Vec3<T> point = example.point.template cast<T>();
    const double expected = example.expected;
    const auto found =
        IrradianceAt<T>(source.position.cast<T>(), source.direction.cast<T>(), T(source.spread), point);
    EXPECT_NEAR(found.per_intensity, expected, expected * kRelative<T>) << point.transpose();
  }
}

// On the axis there is nothing but 1/d²; powers of two are exact.
TYPED_TEST(LightOf, FallsWithTheSquareOfTheDistance) {
  using T = TypeParam;
  const Vec3<T> position(1, 2, 3), axis(0, 0, 1);
  for (int k = -3; k <= 6; ++k) {
    const T distance = std::ldexp(T(1), k);
    const auto light = IrradianceAt<T>(position, axis, T(2.767302), Vec3<T>(position + distance * axis));
    EXPECT_EQ(light.per_intensity, 1 / (distance * distance));
    EXPECT_EQ(light.toward, -axis);
  }
  // In any one direction the pattern is a factor.
  const Vec3<T> aside = Vec3<T>(0.48, -0.6, 0.64);
  const auto near = IrradianceAt<T>(Vec3<T>::Zero(), axis, T(1.7), Vec3<T>(aside * 5));
  const auto far = IrradianceAt<T>(Vec3<T>::Zero(), axis, T(1.7), Vec3<T>(aside * 35));
  EXPECT_NEAR(near.per_intensity / far.per_intensity, 49, 49 * kRelative<T>);
  EXPECT_NEAR(near.per_intensity * 25, std::exp(-1.7 * 0.36), kRelative<T>);
}

TYPED_TEST(LightOf, SpreadZeroShinesAllRound) {
  using T = TypeParam;
  for (const Vec3<T>& point : {Vec3<T>(0, 0, 4), Vec3<T>(0, 0, -4), Vec3<T>(4, 0, 0), Vec3<T>(0, -4, 0)}) {
    EXPECT_EQ(IrradianceAt<T>(Vec3<T>::Zero(), Vec3<T>(0, 0, 1), T(0), point).per_intensity, T(1) / 16);
  }
}

// A guide 3 mm off the axis lights the wall on its own side more: (d + 3)²/(d − 3)² times as much.
TYPED_TEST(LightOf, OffsetMattersNearAndFadesFar) {
  using T = TypeParam;
  const auto ratio = [](T distance) {
    const Vec3<T> guide(3, 0, 0), axis(0, 0, 1);
    const auto left = IrradianceAt<T>(guide, axis, T(0), Vec3<T>(-distance, 0, 0));
    const auto right = IrradianceAt<T>(guide, axis, T(0), Vec3<T>(distance, 0, 0));
    return right.per_intensity / left.per_intensity;
  };
  EXPECT_NEAR(ratio(10), 13.0 * 13.0 / 49.0, 4 * kRelative<T>);
  EXPECT_NEAR(ratio(30), 33.0 * 33.0 / (27.0 * 27.0), 4 * kRelative<T>);
}

TYPED_TEST(LightOf, PointOnTheSourceHasNoDirection) {
  using T = TypeParam;
  const auto light = IrradianceAt<T>(Vec3<T>(1, 2, 3), Vec3<T>(0, 0, 1), T(2), Vec3<T>(1, 2, 3));
  EXPECT_EQ(light.toward, (Vec3<T>::Zero()));
  EXPECT_TRUE(std::isinf(light.per_intensity) && light.per_intensity > 0);
}

// The density of 1 − cos = t is spread · exp(−spread · t)/(1 − exp(−2 spread)), integrated by the midpoint
// rule. χ² over cells alike in cosine, in standard deviations from its mean; another spread is noticed.
TEST(Light, DirectionsHaveThePatternsDensity) {
  constexpr int kCells = 40, kFine = 200, kCount = 40000;
  const auto deviation = [&](double drawn, double tested) {
    double found[kCells] = {}, expected[kCells] = {}, whole = 0;
    for (int i = 0; i < kCount; ++i) {
      const double below_axis = SamplePattern(drawn, UniformDouble(RandomBits(3, static_cast<uint64_t>(i))));
      EXPECT_GE(below_axis, 0);
      EXPECT_LE(below_axis, 2 + 1e-12);
      ++found[std::min(kCells - 1, static_cast<int>(below_axis * (kCells / 2)))];
    }
    for (int i = 0; i < kCells * kFine; ++i) {
      const double part = std::exp(-tested * 2 * (i + 0.5) / (kCells * kFine)) * 2 / (kCells * kFine);
      expected[i / kFine] += part;
      whole += part;
    }
    EXPECT_NEAR(PatternSolidAngle(tested), 2 * kPi * whole, 1e-4 * whole);
    double sum = 0, rest_found = 0, rest_expected = 0;
    int cells = -1;  // the total is given
    for (int i = 0; i < kCells; ++i) {
      rest_found += found[i];
      rest_expected += kCount * expected[i] / whole;
      if (rest_expected < 10 && i + 1 < kCells) continue;  // cells of few are taken together
      if (rest_expected > 0) sum += std::pow(rest_found - rest_expected, 2) / std::max(1.0, rest_expected);
      ++cells;
      rest_found = rest_expected = 0;
    }
    return (sum - cells) / std::sqrt(2.0 * cells);
  };
  for (const double spread : {0.0, 1e-9, 0.3, 2.767302, 25.0}) {
    EXPECT_LT(deviation(spread, spread), 5) << spread;
    EXPECT_GT(deviation(spread, 1.1 * spread + 0.1), 10) << spread;
  }
}

}  // namespace
}  // namespace lumen
