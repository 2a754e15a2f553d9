#include "recon/training/initial_reach.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/parallel.h"
#include "tests/support.h"

namespace lumen {
namespace {

constexpr double kRadius_mm = 20, kSpread = 1.5, kGamma = 2.2;
constexpr int kFrames = 4;

// Where a ray from inside leaves a capsule around the z axis from 0 to `length`, by bisection.
Vec3d LeavesCapsule(double length, const Vec3d& origin, const Vec3d& direction) {
  double inside = 0, outside = 1000;
  for (int i = 0; i < 100; ++i) {
    const double middle = (inside + outside) / 2;
    const Vec3d at = origin + middle * direction;
    const Vec3d on_axis(0, 0, std::clamp(at.z(), 0.0, length));
    ((at - on_axis).norm() < kRadius_mm ? inside : outside) = middle;
  }
  return origin + inside * direction;
}

// Frames from within a capsule of one colour that ends `reach` before the first camera, in closed form, as a
// light beside each camera shows it. Gains fall from frame to frame.
Sequence CapsuleSequence(const test::ScratchFolder& folder, double reach, bool gains_known) {
  Sequence sequence;
  sequence.folder = folder.path();
  CameraIntrinsics& camera = sequence.calibration.camera;
  camera.width = 64;
  camera.height = 48;
  camera.fx = camera.fy = 24;
  camera.cx = 31.5;
  camera.cy = 23.5;
  const double intensity = 0.5 * reach * reach;
  sequence.calibration.light.sources.push_back(
      {Vec3d(3, 0, 0), Vec3d::UnitZ(), kSpread, Vec3d::Constant(intensity)});
  sequence.calibration.response.gamma = kGamma;
  for (int number = 0; number < kFrames; ++number) {
    const double gain = std::pow(0.8, number);
    SequenceFrame frame;
    frame.number = number;
    frame.world_from_camera.translation() = Vec3d(0, 0, number);
    if (gains_known) frame.gain = gain;
    frame.color = FrameFile(folder.path(), number, "color.png");
    Image8 image(camera.width, camera.height, 3);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const Vec3d ray = Vec3d((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1).normalized();
        const Vec3d eye(0, 0, number), point = LeavesCapsule(reach, eye, ray);
        const Vec3d normal = (Vec3d(0, 0, std::clamp(point.z(), 0.0, reach)) - point) / kRadius_mm;
        const Vec3d to_light = eye + Vec3d(3, 0, 0) - point, toward = to_light.normalized();
        const double irradiance = intensity * std::exp(-kSpread * (1 + toward.z())) *
                                  std::max(0.0, normal.dot(toward)) / to_light.squaredNorm();
        for (int c = 0; c < 3; ++c) {
          const double radiance = gain * (0.6 - 0.2 * c) / kPi * irradiance;
          image.Pixel(x, y)[c] =
              static_cast<uint8_t>(std::lround(255 * std::pow(std::min(1.0, radiance), 1 / kGamma)));
        }
      }
    }
    WriteImage(frame.color, image);
    sequence.frames.push_back(frame);
  }
  return sequence;
}

InitialSurfaceOptions Tube() {
  InitialSurfaceOptions tube;
  tube.radius_mm = kRadius_mm;
  return tube;
}

// The tube that is tried is the capsule itself, so the nearest of the reaches tried, which lie 15% apart, is
// within half of that in the logarithm. Reaches of less than half a radius beyond the path add no segment,
// and are left out.
TEST(InitialReach, IsTheCapsulesThatTheFramesShow) {
  for (const double reach : {18.0, 35.0, 75.0}) {
    for (const bool gains_known : {true, false}) {
      const test::ScratchFolder folder;
      const TrainingFrames frames(CapsuleSequence(folder, reach, gains_known), kFrames, true);
      for (const uint64_t seed : {1, 2}) {
        const double found = FitReach(frames, Tube(), 100, seed);
        EXPECT_LT(std::abs(std::log(found / reach)), std::log(1.15) * 0.51)
            << reach << " and " << found << (gains_known ? "" : ", gains unknown");
      }
    }
  }
}

TEST(InitialReach, KeepsToItsBoundsAndIsTheSameForAnyNumberOfThreads) {
  const test::ScratchFolder folder;
  const TrainingFrames frames(CapsuleSequence(folder, 75, true), kFrames, true);
  const double within = FitReach(frames, Tube(), 30, 1);
  EXPECT_LE(within, 30);
  EXPECT_GT(within, 30 / 1.15);
  SetThreadCount(1);
  const double alone = FitReach(frames, Tube(), 100, 1);
  SetThreadCount(0);
  EXPECT_EQ(FitReach(frames, Tube(), 100, 1), alone);
  // A bound below the shortest that is tried leaves what the options say.
  EXPECT_EQ(FitReach(frames, Tube(), kRadius_mm / 4, 1), Tube().reach_mm);
}

}  // namespace
}  // namespace lumen
