// Which pixels training keeps, and that they are the frames' own.
#include "recon/training/training_frames.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/small_sequence.h"

namespace lumen {
namespace {

TEST(SpreadEvenly, TakesOneOfEachPart) {
  const std::vector<uint32_t> places = SpreadEvenly(1001, 100);
  ASSERT_EQ(places.size(), 100u);
  for (size_t i = 0; i < 100; ++i) {
    EXPECT_GE(places[i], 1001 * i / 100);
    EXPECT_LT(places[i], 1001 * (i + 1) / 100);
  }
  // Not always the same one of a part: a grid of pixels would miss what repeats with its spacing.
  std::map<size_t, int> of_part;
  for (size_t i = 0; i < 100; ++i) ++of_part[places[i] - 1001 * i / 100];
  EXPECT_GE(of_part.size(), 8u);
  EXPECT_EQ(SpreadEvenly(3, 3), (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(SpreadEvenly(3, 10), (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_TRUE(SpreadEvenly(0, 10).empty());
}

using RaySeen = std::pair<std::array<float, 3>, int>;

std::map<RaySeen, Vec3f> AllDrawn(const TrainingFrames& frames, int draws) {
  std::map<RaySeen, Vec3f> seen;
  std::vector<RayBatch<float>::Ray> rays(static_cast<size_t>(draws));
  frames.Draw(5, 0, Vec3d::Zero(), &rays);
  for (const auto& ray : rays) {
    seen[{{ray.direction.x(), ray.direction.y(), ray.direction.z()}, ray.frame}] = ray.observed;
  }
  return seen;
}

TEST(TrainingFrames, KeepsToItsMemory) {
  const Sequence& sequence = test::SmallSequence();
  const int count = static_cast<int>(sequence.frames.size());
  // Unlit: what is observed is the pixel itself, whatever scale the normalisation finds.
  const TrainingFrames all(sequence, count, false);
  const size_t bytes = 20'000, bytes_a_pixel = 24 + 3 * size_t(count);
  ASSERT_TRUE(sequence.calibration.mask.empty());
  ASSERT_GT(all.pixel_rays().size() * bytes_a_pixel, 2 * bytes);
  const TrainingFrames some(sequence, count, false, bytes);
  EXPECT_EQ(some.pixel_rays().size(), bytes / bytes_a_pixel);

  // Every pixel kept shows what it does in the whole.
  const auto whole = AllDrawn(all, 2'000'000), part = AllDrawn(some, 20'000);
  EXPECT_GT(part.size(), some.pixel_rays().size() * count * 9 / 10);
  for (const auto& [ray, observed] : part) {
    const auto same = whole.find(ray);
    ASSERT_NE(same, whole.end());
    EXPECT_EQ(same->second, observed);
  }
  // And all of them show on the whole what all pixels do: one of each part of neighbours in a row, the mean
  // of a few hundred is within 4 standard errors if they vary by no more than their mean itself.
  const double tolerance = 4 / std::sqrt(double(some.pixel_rays().size()));
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(some.MeanRadiance(0)[c] / all.MeanRadiance(0)[c], 1, tolerance);
  }
}

TEST(TrainingFrames, RefuseToDrawPixelsThatWereGivenBack) {
  TrainingFrames frames(test::SmallSequence(), 2, true);
  std::vector<RayBatch<float>::Ray> rays(1);
  frames.Draw(5, 0, Vec3d::Zero(), &rays);
  frames.ReleasePixels();
  EXPECT_THROW(frames.Draw(5, 0, Vec3d::Zero(), &rays), std::bad_optional_access);
  EXPECT_THROW((void)frames.MeanRadiance(0), std::bad_optional_access);
  EXPECT_EQ(frames.world_from_camera().size(), 2u);
}

}  // namespace
}  // namespace lumen
