// What the pixels of a tile share of each other's paths (shared_paths.h, glint_paths.h, photon_joins.h)
// against pixels that are alone in their tiles. Those are too narrow a view for light paths, too: all of
// their light is found from the camera, each by paths of its own.
#include <gtest/gtest.h>

#include <vector>

#include "sim/imaging/tile.h"
#include "tests/path_stage.h"
#include "tests/seed_means.h"

namespace lumen {
namespace {

constexpr int kSeeds = 12, kAcross = 2, kDown = 2;

// A camera and two guides off its axis in a globe with a sharp coat on a relief, by wide pixels.
test::Stage GlintingGlobe(double ior) {
  test::Stage stage(test::Globe(20, 40), test::CentredPinhole(kAcross * kTileEdge, kDown * kTileEdge, 12));
  stage.surface.albedo = Vec3d(0.3, 0.15, 0.1);
  stage.surface.coat.emplace(CoatOptions{ior, 0.4, 1, 0.06});
  stage.light.sources.resize(2, stage.light.sources[0]);
  stage.light.sources[0].position = Vec3d(3, 0.5, 0);
  stage.light.sources[1].position = Vec3d(-2, -3, 0);
  stage.world_from_camera.translation() = Vec3d(3, -2, 4);
  stage.options.bounces = 2;
  return stage;
}

// So far apart that wherever the grid of tiles lies, no two are in one.
bool IsChosen(int x, int y) { return x % kTileEdge == 5 && y % kTileEdge == 9; }

// The chosen pixels' light between walls over seeds.
test::SeedMeans Measure(const test::Stage& stage, uint64_t first_seed) {
  test::SeedMeans pixels;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const ImageF light = stage.Render(first_seed + seed, true).indirect;
    std::vector<double> values;
    for (int y = 0; y < light.height; ++y) {
      for (int x = 0; x < light.width; ++x) {
        if (!IsChosen(x, y)) continue;
        for (int c = 0; c < 3; ++c) values.push_back(light.Pixel(x, y)[c]);
      }
    }
    pixels.Add(values);
  }
  return pixels;
}

// Welch's test of each pixel, one false alarm in 1,000; a coat that reflects a fifth more is noticed.
TEST(TileSharing, PixelsGetWhatTheyGetAlone) {
  test::Stage alone = GlintingGlobe(1.8), together = GlintingGlobe(1.8), shinier = GlintingGlobe(1.91);
  for (int y = 0; y < alone.valid.height; ++y) {
    for (int x = 0; x < alone.valid.width; ++x) *alone.valid.Pixel(x, y) = IsChosen(x, y) ? 255 : 0;
  }
  alone.options.samples = 512;
  together.options.samples = shinier.options.samples = 48;
  const test::SeedMeans own = Measure(alone, 1), shared = Measure(together, 101),
                        more = Measure(shinier, 101);
  ASSERT_EQ(own.size(), size_t{3 * kAcross * kDown});
  EXPECT_EQ(test::CountOff(own, shared, 1e-3), 0);
  EXPECT_GT(test::CountOff(own, more, 1e-3), 0);
}

}  // namespace
}  // namespace lumen
