// Interreflection as the reconstruction models it: the map of directions, and radiosity against closed forms.
#include "recon/surface/radiosity.h"

#include <gtest/gtest.h>

#include "common/light.h"
#include "common/random.h"
#include "recon/surface/direction_map.h"
#include "recon/training/trainer.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using Map = DirectionMap<double>;

// Both the sum over cells and the mean over evenly drawn directions of a known function are its integral.
TEST(DirectionMap, SolidAnglesAreThoseOfEvenlyDrawnDirections) {
  constexpr int kDraws = 400000;
  double sum = 0;
  for (int cell = 0; cell < Map::kCells; ++cell) sum += Map::SolidAngle(cell);
  EXPECT_NEAR(sum, 4 * kPi, 1e-12);
  Map lobe;
  double share = 0;
  const Vec3d axis = Vec3d(1, 2, 3).normalized();
  for (int cell = 0; cell < Map::kCells; ++cell) {
    const double weight = std::pow(std::max(0.0, axis.dot(Map::Direction(cell))), 4);
    share += weight * Map::SolidAngle(cell);
    lobe.values[cell] = Vec3d::Constant(weight);
  }
  EXPECT_NEAR(share, 2 * kPi / 5, 0.01 * 2 * kPi / 5);  // ∫ cos⁴ over a hemisphere
  double mean = 0, largest_error = 0;
  for (int k = 0; k < kDraws; ++k) {
    const double z = 2 * UniformDouble(RandomBits(1, k, 0)) - 1;
    const double angle = 2 * kPi * UniformDouble(RandomBits(1, k, 1)), r = std::sqrt(1 - z * z);
    const Vec3d d(r * std::cos(angle), r * std::sin(angle), z);
    const double value = lobe.At(7 * d)[0];
    mean += value / kDraws;
    largest_error = std::max(largest_error, std::abs(value - std::pow(std::max(0.0, axis.dot(d)), 4)));
  }
  EXPECT_NEAR(mean, 2 * kPi / 5 / (4 * kPi), 0.002);
  // Across the octahedron's edges, where the map has kinks, and at its rim, where it is held constant, linear
  // interpolation errs by the slope, 1.3 at most, over half a cell, which is h = .125 wide there; elsewhere by
  // h²/8 of the second derivatives, 4 at most along either side, with h = .16: .026.
  EXPECT_LT(largest_error, 1.3 * 0.125 / 2);
  EXPECT_GT(largest_error, 1e-4);
}

TEST(DirectionMap, GivesACellsValueInItsMiddle) {
  Map map;
  for (int cell = 0; cell < Map::kCells; ++cell) map.values[cell] = Vec3d(cell, 2 * cell, -cell);
  for (int cell = 0; cell < Map::kCells; ++cell) {
    EXPECT_NEAR(Map::Direction(cell).norm(), 1, 1e-15);
    EXPECT_NEAR((map.At(3 * Map::Direction(cell)) - map.values[cell]).norm(), 0, 1e-10);
  }
}

// A sphere around its middle, lit from there by a source with an axis.
std::vector<Patch> Sphere(double radius_mm, double albedo, double spread) {
  std::vector<Patch> patches;
  for (int cell = 0; cell < Map::kCells; ++cell) {
    const Vec3d d = Map::Direction(cell);
    const double irradiance =
        IrradianceAt<double>(Vec3d::Zero(), Vec3d::UnitZ(), spread, radius_mm * d).per_intensity;
    patches.push_back({radius_mm * d, -d, Map::SolidAngle(cell) * radius_mm * radius_mm,
                       Vec3d::Constant(albedo), irradiance * Vec3d(1, 2, 3)});
  }
  return patches;
}

// In a sphere every place gets the same from all others: ρ/(1 − ρ) of what the light sends to the mean place.
TEST(Radiosity, IntegratingSphere) {
  for (const double albedo : {0.1, 0.5, 0.8, 0.9}) {
    for (const double spread : {0.0, 2.77}) {
      constexpr double kRadius = 20;
      // Of e^(−spread·(1 − cosine)) over all directions.
      const double mean = (spread == 0 ? 1 : -std::expm1(-2 * spread) / (2 * spread)) / (kRadius * kRadius);
      const double expected = mean * albedo / (1 - albedo);
      const auto irradiance = InterreflectedIrradiance(Sphere(kRadius, albedo, spread));
      double sum = 0;
      for (const Vec3d& e : irradiance) {
        sum += e[0] / static_cast<double>(irradiance.size());
        EXPECT_NEAR(e[2], 3 * e[0], 1e-9 * e[2]);
      }
      // Each patch misses itself, 1/N of what it sees, and the disc's formula takes A/(π d² + A) for A/π
      // d²: 1/(1 + Ω R²/(π d²)), over the sphere 1 − (Ω/4π) ln(4π/Ω) or .7% less with N = 1024 of 4π/N; 32
      // bounces leave ρ^32. Both grow by 1/(1 − ρ) as light goes on bouncing.
      const double tolerance = 0.009 / (1 - albedo) + std::pow(albedo, 32);
      EXPECT_NEAR(sum / expected, 1, tolerance) << albedo << " " << spread;
      EXPECT_LT(sum, expected);
    }
  }
}

TEST(Radiosity, NothingComesFromBlackWallsAndWhiteOnesStayFinite) {
  for (const Vec3d& e : InterreflectedIrradiance(Sphere(20, 0, 1))) EXPECT_EQ(e, Vec3d::Zero());
  const auto white = InterreflectedIrradiance(Sphere(20, 1, 1)),
             palest = InterreflectedIrradiance(Sphere(20, kPalest, 1));
  for (size_t i = 0; i < white.size(); ++i) EXPECT_EQ(white[i], palest[i]);
}

// Groups of 64 patches miss more of each other: themselves 1/16 and, by the same formula, 17% of the rest. What
// comes for the last time comes from single patches, so only what has bounced before falls short. A wall without
// groups of its own, each patch one, is the plain radiosity.
TEST(Radiosity, GroupsOfPatchesSendWhatTheirPartsSend) {
  constexpr double kAlbedo = 0.5;
  const std::vector<Patch> sphere = Sphere(20, kAlbedo, 0);
  std::vector<int> eighths, own;
  for (int cell = 0; cell < Map::kCells; ++cell) {
    eighths.push_back(cell / Map::kEdge / 8 * (Map::kEdge / 8) + cell % Map::kEdge / 8);
    own.push_back(cell);
  }
  const auto whole = InterreflectedIrradiance(sphere);
  const auto grouped = InterreflectedIrradiance(sphere, eighths, Map::kCells / 64);
  const auto ungrouped = InterreflectedIrradiance(sphere, own, Map::kCells);
  double ratio = 0;
  for (int i = 0; i < Map::kCells; ++i) {
    ratio += grouped[i][0] / whole[i][0] / Map::kCells;
    // The plain one ends after 32 bounces, this one after one more; GatherInLanes rounds to 1e-5.
    EXPECT_NEAR(ungrouped[i][0] / whole[i][0], 1, 1e-5);
  }
  // Half of the light has bounced once only; the other half is less by .24 or more, as its bounces do.
  EXPECT_GT(ratio, 1 - 0.5 * 0.24 / (1 - kAlbedo * (1 - 0.24)));
  EXPECT_LT(ratio, 1);
}

// In lanes as in double, whatever number of patches is left for the last lanes.
TEST(Radiosity, GatheringInLanesIsGathering) {
  for (const int count : {1, 2, 15, 16, 17, 333}) {
    std::vector<Patch> patches;
    std::vector<Vec3d> leaving;
    const auto uniform = [&](int i, int k) { return UniformDouble(RandomBits(count, i, k)); };
    for (int i = 0; i < count; ++i) {
      const auto vector = [&](int k) { return Vec3d(uniform(i, k), uniform(i, k + 1), uniform(i, k + 2)); };
      const Vec3d normal = (vector(3) - Vec3d::Constant(0.5)).normalized();
      patches.push_back({100 * vector(0), normal, 200 * uniform(i, 6), Vec3d::Ones(), Vec3d::Ones()});
      leaving.push_back(vector(7));
    }
    const std::vector<Vec3d> expected = Gather(patches, leaving), found = GatherInLanes(patches, leaving);
    ASSERT_EQ(found.size(), patches.size());
    // A cosine is a difference of products of lengths below 200 mm: off by 1e-5 mm over the 2 mm and more of the
    // nearest pair, of 333 that share what is received.
    for (int i = 0; i < count; ++i) {
      EXPECT_LT((found[i] - expected[i]).norm(), 2e-5 * (1 + expected[i].norm())) << count << " " << i;
    }
  }
  // A patch that sends nothing but to itself, and what lies in its place twice.
  const Patch patch{Vec3d(1, 2, 3), Vec3d::UnitX(), 4, Vec3d::Ones(), Vec3d::Ones()};
  for (const Vec3d& e : GatherInLanes({patch, patch}, {Vec3d::Ones(), Vec3d::Ones()}))
    EXPECT_EQ(e, Vec3d::Zero());
}

// What two places at d face to face give each other is the closed form of two small discs.
TEST(Radiosity, TwoPatchesFaceToFace) {
  std::vector<Patch> two = {{Vec3d::Zero(), Vec3d::UnitZ(), 0.01, Vec3d::Constant(0.5), Vec3d(1, 1, 1)},
                            {Vec3d(0, 0, 10), -Vec3d::UnitZ(), 0.01, Vec3d::Constant(0.5), Vec3d(0, 0, 0)}};
  const auto irradiance = InterreflectedIrradiance(two);
  EXPECT_NEAR(irradiance[1][0], 0.5 * 0.01 / (kPi * 100), 1e-9);
  EXPECT_LT(irradiance[0][0], 1e-9);
  two[1].normal = Vec3d::UnitZ();  // turned away
  EXPECT_EQ(InterreflectedIrradiance(two)[1][0], 0);
}

// A run that is taken up again between two updates of its surroundings goes on as if nothing had happened.
TEST(Radiosity, RunIsTakenUpAgainByItsState) {
  const TrainOptions options =
      ReadTrainOptions("fast", {"network.interreflection=\"radiosity\"", "sampling.rays=64"});
  const TrainingFrames frames(test::SmallSequence(), options.frames, true);
  Trainer through(frames, options, 1), first(frames, options, 1), second(frames, options, 1);
  for (int step = 0; step < 8; ++step) through.Step(step / 8.0);
  for (int step = 0; step < 3; ++step) first.Step(step / 8.0);
  second.state() = first.state();
  for (int step = 3; step < 8; ++step) second.Step(step / 8.0);
  EXPECT_EQ(through.state().surroundings, second.state().surroundings);
  EXPECT_TRUE(through.state().parameters == second.state().parameters);
  float largest = 0;
  for (float value : through.state().surroundings) largest = std::max(largest, value);
  EXPECT_GT(largest, 0);
  // Without what the state holds it would be another run.
  Trainer other(frames, options, 1);
  other.state() = first.state();
  for (float& value : other.state().surroundings) value *= 2;
  for (int step = 3; step < 8; ++step) other.Step(step / 8.0);
  EXPECT_FALSE(through.state().parameters == other.state().parameters);
}

}  // namespace
}  // namespace lumen
