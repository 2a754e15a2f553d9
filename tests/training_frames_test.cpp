// Which pixels training keeps, and that they are the frames' own.
#include "recon/training/training_frames.h"

#include <gtest/gtest.h>

#include <map>

#include "common/files.h"
#include "tests/child_process.h"
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

// Peak memory of a run of one step, bytes.
size_t PeakOfTraining(const std::filesystem::path& sequence, const std::filesystem::path& run,
                      const std::string& cell_mm) {
  const pid_t child = test::StartLumen({"train", sequence.string(), "-o", run.string(), "--iterations", "1",
                                        "--set", "extract.cell_mm=" + cell_mm, "--quiet", "--threads", "1"});
  int status = 0;
  rusage usage;
  wait4(child, &status, 0, &usage);
  EXPECT_EQ(status, 0);
  return size_t(usage.ru_maxrss) * 1024;
}

// Of a frame of 4096 × 4096 pixels, 50 MB, 27 bytes a pixel are kept, as many as fit into half of kFrameBytes
// at least. What comes on top of that over a frame of 64 × 64 is the mask's 17 MB, while that is read its
// file's and the rows': less than 12 MB, so that the frame isn't held whole.
TEST(TrainingFrames, AFrameOf4096SquaredIsNotHeldWhole) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer keeps what is freed for a while, and counts as the program's memory";
#endif
  const test::ScratchFolder scratch;
  const auto peak = [&](int side, const std::string& cell_mm) {
    Sequence sequence;
    sequence.folder = scratch / std::to_string(side);
    CreateFolder(sequence.folder);
    Calibration& calibration = sequence.calibration;
    calibration.light = EndomapperLight();
    calibration.response.gamma = 2.2;
    CameraIntrinsics& camera = calibration.camera;
    camera.width = camera.height = side;
    camera.cx = camera.cy = (side - 1) / 2.0;
    camera.fx = camera.fy = 0.6 * side;
    calibration.mask = Image8(side, side, 1, 255);
    sequence.frames.resize(1);
    WriteSequenceHeader(sequence);
    WriteImage(FrameFile(sequence.folder, 0, "color.png"), Image8(side, side, 3, 90));
    return PeakOfTraining(sequence.folder, scratch / "run", cell_mm);
  };
  const size_t small = peak(64, "8"), large = peak(4096, "8");
  constexpr size_t kMask = size_t{4096} * 4096;
  // Linux counts a thread's pages by 64 at a time: so far off may each of the two be, and both twice.
  constexpr size_t kCountedAtOnce = 4 * 64 * 4096;
  EXPECT_LT(large - small, kFrameBytes + 12'000'000);
  EXPECT_GT(large - small, kFrameBytes - kMask - kCountedAtOnce);  // so much it does keep
  // A fine mesh takes the memory that the pixels have given back.
  const size_t mesh = peak(64, "0.35") - small;
  EXPECT_GT(mesh, kCountedAtOnce * 4);
  EXPECT_LT(peak(4096, "0.35"), large + mesh / 2);
}

}  // namespace
}  // namespace lumen
