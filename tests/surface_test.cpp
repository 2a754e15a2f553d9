#include "sim/imaging/surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/random.h"
#include "tests/path_stage.h"

namespace lumen {
namespace {

Vec3f RandomPoint(uint64_t seed, uint64_t i, float extent) {
  Vec3f point;
  for (int c = 0; c < 3; ++c) point[c] = extent * (2 * UniformFloat(RandomBits(seed, i, c)) - 1);
  return point;
}

// Of the sphere on which vessels grow.
constexpr float kWall_mm = 20;
Vec3f OnWall(uint64_t seed, uint64_t i) { return kWall_mm * RandomPoint(seed, i, 1).normalized(); }

Vec2f RandomPair(uint64_t seed, uint64_t i) {
  return {UniformFloat(RandomBits(seed, i, 7)), UniformFloat(RandomBits(seed, i, 8))};
}

TEST(Surface, NoiseFillsItsRangeAndIsZeroOnTheLattice) {
  float low = 0, high = 0;
  for (int i = 0; i < 100000; ++i) {
    const float value = GradientNoise(3, RandomPoint(1, i, 50));
    low = std::min(low, value);
    high = std::max(high, value);
  }
  EXPECT_GE(low, -1);
  EXPECT_LE(high, 1);
  EXPECT_LT(low, -0.7);
  EXPECT_GT(high, 0.7);
  for (int i = -5; i < 5; ++i) EXPECT_EQ(GradientNoise(3, Vec3f(float(i), float(2 * i), float(7 - i))), 0);
}

// Quintic interpolation: value and first derivative go on across the lattice's planes.
TEST(Surface, NoiseIsSmooth) {
  const float step = 1e-3f;
  double steepest = 0, kink = 0;
  for (int i = 0; i < 20000; ++i) {
    Vec3f point = RandomPoint(2, i, 8);
    point[i % 3] = std::round(point[i % 3]);
    const Vec3f along = step * Vec3f::Unit(i % 3);
    const double before = GradientNoise(5, point) - GradientNoise(5, point - along);
    const double after = GradientNoise(5, point + along) - GradientNoise(5, point);
    steepest = std::max(steepest, std::abs(after) / step);
    kink = std::max(kink, std::abs(after - before) / step);
  }
  EXPECT_GT(steepest, 0.5);
  EXPECT_LT(steepest, 4);
  EXPECT_LT(kink, 0.03);  // rounding alone gives 1e-4, a jump of slope some 0.5
}

TEST(Surface, NoiseIsAFunctionOfSeedAndPlace) {
  int same = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vec3f point = RandomPoint(4, i, 20);
    EXPECT_EQ(GradientNoise(9, point), GradientNoise(9, point));
    same += GradientNoise(9, point) == GradientNoise(10, point);
  }
  EXPECT_LT(same, 50);
}

TEST(Surface, AlbedoStaysWithinZeroAndOne) {
  Surface surface;
  const Vec3f plain = surface.albedo.cast<float>();
  EXPECT_EQ(AlbedoAt(surface, 1, {1, 2, 3}), plain);
  surface.mottling = Mottling{3, 5};
  surface.vessels.emplace(VesselOptions{9, 2, Vec3d(0.15, 0.7, 50)}, test::Globe(kWall_mm, 40), 7);
  bool cut = false, darker = false;
  for (int i = 0; i < 20000; ++i) {
    const Vec3f albedo = AlbedoAt(surface, 7, OnWall(5, i));
    ASSERT_TRUE(albedo.minCoeff() >= 0 && albedo.maxCoeff() <= 1) << i;
    cut |= albedo.x() == 1;
    darker |= albedo.z() < 1e-6f;
  }
  EXPECT_TRUE(cut);
  EXPECT_TRUE(darker);
}

// Vessels only take away, at most their absorption, and from most places nothing.
TEST(Surface, VesselsAbsorb) {
  Surface surface;
  surface.vessels.emplace(VesselOptions{}, test::Globe(kWall_mm, 40), 7);
  const Vec3f plain = surface.albedo.cast<float>();
  const VesselOptions& options = surface.vessels->options();
  int vessel = 0, count = 20000;
  for (int i = 0; i < count; ++i) {
    const Vec3f place = OnWall(6, i), ratio = AlbedoAt(surface, 7, place).cwiseQuotient(plain);
    const double blood = surface.vessels->BloodAt(Broadcast(place))[0];
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(ratio[c], std::exp(-options.absorption[c] * blood), 1e-6);
    vessel += blood > 0;
  }
  EXPECT_GT(vessel, count / 100);
  EXPECT_LT(vessel, count / 5);
}

// Lanes in one cell of the noise's lattice and lanes all over it take different ways through the code.
TEST(Surface, NoiseInLanesIsTheSameBits) {
  for (const float extent : {0.02f, 40.0f}) {
    for (int packet = 0; packet < 1000; ++packet) {
      Lanes3 points;
      const Vec3f middle = RandomPoint(14, packet, 60);
      for (int i = 0; i < kLanes; ++i) {
        points.Set(i, middle + RandomPoint(15, packet * kLanes + i, extent));
      }
      const Lanes noise = GradientNoise(7, points);
      for (int i = 0; i < kLanes; ++i) ASSERT_EQ(noise[i], GradientNoise(7, points[i])) << packet << ' ' << i;
    }
  }
}

TEST(Surface, AlbedoOfALaneIsItsOwn) {
  Surface surface;
  surface.mottling.emplace();
  surface.vessels.emplace(VesselOptions{9, 2, Vec3d(0.15, 0.7, 0.5)}, test::Globe(kWall_mm, 40), 7);
  int in_vessels = 0;
  for (int packet = 0; packet < 1000; ++packet) {
    Lanes3 places;
    for (int i = 0; i < kLanes; ++i) places.Set(i, OnWall(14, packet * kLanes + i));
    const Lanes3 albedos = AlbedoAt(surface, 7, places);
    for (int i = 0; i < kLanes; ++i) {
      ASSERT_EQ(albedos[i], AlbedoAt(surface, 7, places[i])) << packet << ' ' << i;
      in_vessels += albedos.z[i] < 0.85f * albedos.x[i] * 0.3f / 0.8f;
    }
  }
  EXPECT_GT(in_vessels, 100);
}

// cos²θ and φ of the cosine's density are both uniform: χ² of 16 × 16 cells, 255 degrees of freedom.
double ChiSquareOfLobe(const Vec3f& normal, bool uniform_sphere) {
  const Vec3f across = normal.unitOrthogonal(), third = normal.cross(across);
  std::vector<int> cells(256, 0);
  const int count = 65536;
  for (int i = 0; i < count; ++i) {
    const Vec3f direction = uniform_sphere ? Vec3f(RandomPoint(8, i, 1).normalized())
                                           : lambert::Sample(normal, RandomPair(11, i));
    const float cosine = direction.dot(normal);
    EXPECT_NEAR(direction.norm(), 1, 1e-5);
    EXPECT_TRUE(uniform_sphere || cosine >= -1e-6f);
    const double turn = std::atan2(direction.dot(third), direction.dot(across)) / (2 * kPi) + 0.5;
    ++cells[std::clamp(int(cosine * cosine * 16), 0, 15) * 16 + std::clamp(int(turn * 16), 0, 15)];
  }
  double sum = 0;
  for (const int n : cells) sum += std::pow(n - count / 256.0, 2) / (count / 256.0);
  return sum;
}

TEST(Surface, LobeIsSampledWithItsDensity) {
  const double most = 255 + 5 * std::sqrt(510.0);
  for (const Vec3f& normal : {Vec3f(0, 0, 1), Vec3f(0, 0, -1), Vec3f(1, 0, 0), Vec3f(0.3f, -0.8f, -0.52f),
                              Vec3f(1e-4f, -1e-4f, -1)}) {
    EXPECT_LT(ChiSquareOfLobe(normal.normalized(), false), most) << normal.transpose();
  }
  EXPECT_GT(ChiSquareOfLobe(Vec3f::UnitZ(), true), most);
}

TEST(Surface, LobeReturnsItsAlbedo) {
  const Vec3f albedo(1, 0.5f, 0.25f), normal = Vec3f(0.2f, -0.5f, 0.7f).normalized();
  Vec3d by_lobe = Vec3d::Zero(), uniform = Vec3d::Zero();
  double density = 0;
  const int count = 200000;
  for (int i = 0; i < count; ++i) {
    const float cosine = lambert::Sample(normal, RandomPair(12, i)).dot(normal);
    if (cosine > 0) by_lobe += (lambert::Eval(albedo) * cosine / lambert::Pdf(cosine)).cast<double>() / count;
    const float flat = UniformFloat(RandomBits(13, i));  // cosine of a uniform direction in the hemisphere
    uniform += (lambert::Eval(albedo) * flat).cast<double>() * 2 * kPi / count;
    density += lambert::Pdf(flat) * 2 * kPi / count;
  }
  EXPECT_LT((by_lobe - albedo.cast<double>()).norm(), 1e-5);
  EXPECT_LT((uniform - albedo.cast<double>()).norm(), 5 * 1.2 * std::sqrt(1.0 / 3 / count));
  EXPECT_NEAR(density, 1, 5 * std::sqrt(1.0 / 3 / count));
  EXPECT_EQ(lambert::Pdf(-0.5f), 0);
}

}  // namespace
}  // namespace lumen
