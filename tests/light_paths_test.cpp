// Light that a coat mirrors onto other walls, traced from the guides, against the tracer's own paths from the
// camera: an aperture a millionth of a mm wide is no pinhole to it, and all light is found from the camera.
#include "sim/imaging/light_paths.h"

#include <gtest/gtest.h>

#include "tests/path_stage.h"
#include "tests/seed_means.h"

namespace lumen {
namespace {

constexpr int kSeeds = 12, kBlockEdge_px = 8, kAcross = 4, kDown = 3;

// A camera and two guides off its axis in a globe whose coat is sharp, on a relief, and outshines the wall.
test::Stage GlintingGlobe() {
  test::Stage stage(test::Globe(20, 40),
                    test::CentredPinhole(kAcross * kBlockEdge_px, kDown * kBlockEdge_px, 16));
  stage.surface.albedo = Vec3d(0.3, 0.15, 0.1);
  stage.surface.coat.emplace(CoatOptions{1.8, 0.3, 1, 0.06});
  stage.light.sources.resize(2, stage.light.sources[0]);
  stage.light.sources[0].position = Vec3d(3, 0.5, 0);
  stage.light.sources[1].position = Vec3d(-2, -3, 0);
  stage.light.sources[1].direction = Vec3d(0.3, 0.2, 1).normalized();
  for (LightSource& source : stage.light.sources) source.spread = 2;
  stage.light.sources[1].intensity = Vec3d(300, 200, 100);
  stage.world_from_camera.translation() = Vec3d(3, -2, 4);
  stage.options.samples = 16;
  return stage;
}

// Blocks' light between walls over seeds.
test::SeedMeans Measure(const test::Stage& stage, uint64_t first_seed, const Defocus* defocus) {
  test::SeedMeans blocks;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Film film;
    EXPECT_EQ(stage.Render(first_seed + seed, true, &film, defocus).failure.count, 0);
    blocks.Add(test::BlockMeansOf(film.indirect, kBlockEdge_px));
  }
  return blocks;
}

// Welch's test of blocks' means, one false alarm in 1,000; an index of refraction whose reflectance is 15%
// too high is noticed. After one bounce and after three, the last between walls.
TEST(LightPaths, AgreeWithPathsFromTheCamera) {
  const Defocus point{1e-6, 10};
  for (const int bounces : {1, 3}) {
    test::Stage stage = GlintingGlobe();
    stage.options.bounces = bounces;
    if (bounces == 1) stage.options.samples = 64;  // they cost less
    const test::SeedMeans from_camera = Measure(stage, 100, &point),
                          from_guides = Measure(stage, 200, nullptr);
    EXPECT_EQ(test::CountOff(from_camera, from_guides, 1e-3), 0) << bounces;
    if (bounces > 1) continue;
    stage.surface.coat.emplace(CoatOptions{1.8835, 0.3, 1, 0.06});
    EXPECT_GT(test::CountOff(from_camera, Measure(stage, 200, nullptr), 1e-3), 0);
  }
}

// So do paths of the pixels' own, in which a wider lobe is met after a bounce.
TEST(LightPaths, AgreeWithOwnPathsThroughAWiderLobe) {
  const Defocus point{1e-6, 10};
  test::Stage stage = GlintingGlobe();
  stage.options.bounces = 2;
  stage.options.shared_paths = 0;
  stage.surface.bounced_coat.emplace(CoatOptions{1.8, 0.5, 1, 0.06});
  EXPECT_EQ(test::CountOff(Measure(stage, 300, &point), Measure(stage, 400, nullptr), 1e-3), 0);
}

TEST(LightPaths, SameBytesForAnyNumberOfThreads) {
  test::Stage stage = GlintingGlobe();
  stage.options.bounces = 3;
  SetThreadCount(1);
  const Film one = stage.Render(5);
  SetThreadCount(2);
  const Film two = stage.Render(5);
  SetThreadCount(0);
  EXPECT_EQ(one.radiance.data, two.radiance.data);
}

// Light that pixels which aren't rendered would see goes nowhere.
TEST(LightPaths, MaskedPixelsStayBlack) {
  test::Stage stage = GlintingGlobe();
  stage.options.bounces = 2;
  for (int y = 0; y < stage.valid.height; ++y) {
    for (int x = y % 3; x < stage.valid.width; x += 3) *stage.valid.Pixel(x, y) = 0;
  }
  const Film film = stage.Render(1);
  for (int y = 0; y < stage.valid.height; ++y) {
    for (int x = 0; x < stage.valid.width; ++x) {
      EXPECT_EQ(test::PixelOf(film.radiance, x, y).isZero(0), *stage.valid.Pixel(x, y) == 0);
    }
  }
}

// What can't be told of a path before its pixel is known leaves a frame to the paths from the camera.
TEST(LightPaths, ServeWidePinholesWithACoat) {
  test::Stage stage = GlintingGlobe();
  stage.options.bounces = 1;
  const auto serve = [&](const Defocus* defocus = nullptr) {
    const Camera<float> camera(stage.intrinsics);
    return LightPaths::Serve({&stage.wall, &stage.surface, 0, &stage.vertex_normals},
                             {&camera, &stage.valid, stage.world_from_camera, &stage.light, nullptr, defocus},
                             stage.options);
  };
  const Defocus open{0.3, 10}, closed{0, 10};
  EXPECT_TRUE(serve());
  EXPECT_TRUE(serve(&closed));
  EXPECT_FALSE(serve(&open));
  stage.options.samples = 1;  // goes through the pixel's centre
  EXPECT_FALSE(serve());
  stage.options.direct_oversampling = 2;
  EXPECT_TRUE(serve());
  stage.options.bounces = 0;
  EXPECT_FALSE(serve());
  stage.options.bounces = 1;
  stage.intrinsics.fx = stage.intrinsics.fy = 200;
  EXPECT_FALSE(serve());
  stage.intrinsics.fx = stage.intrinsics.fy = 16;
  stage.surface.coat.reset();
  EXPECT_FALSE(serve());
}

}  // namespace
}  // namespace lumen
