// One real frame of C3VD: the depth and the normals that were rendered from its ground-truth mesh must agree
// through the camera. Its depth comes in steps of 0.39 mm and its normals in 8 bits (0.45° apart), so normals
// are fitted to the depth of windows, and neither can agree better than to about a degree.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/camera.h"
#include "common/sequence.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

constexpr char kFrame[] = "c3vd/trans_t4_a_frame0010";
constexpr int kHalfWindow_px = 20;

struct Frame {
  ImageF z_mm;
  ImageF normal;
};

Frame ReadFrame() {
  const Sequence sequence = ReadSequence(SharedData(kFrame));
  return {DecodeDepth(ReadImage16(sequence.frames.at(0).depth, 1)),
          DecodeNormals(ReadImage16(sequence.frames.at(0).normals, 3))};
}

// The stored normals' mean over a window, weighted as a straight line's slope weighs the slopes along it, by
// 1 − x². Zero where the window has no depth somewhere or an edge: normals that spread by more than some 8°.
Vec3d StoredNormal(const Frame& frame, int x, int y) {
  Vec3d sum = Vec3d::Zero();
  double weights = 0;
  for (int dy = -kHalfWindow_px; dy <= kHalfWindow_px; dy += 2) {
    for (int dx = -kHalfWindow_px; dx <= kHalfWindow_px; dx += 2) {
      const float z = *frame.z_mm.Pixel(x + dx, y + dy);
      if (!(z > 0) || std::isinf(z)) return Vec3d::Zero();
      const double weight = (1.05 - std::pow(double(dx) / kHalfWindow_px, 2)) *
                            (1.05 - std::pow(double(dy) / kHalfWindow_px, 2));
      const float* n = frame.normal.Pixel(x + dx, y + dy);
      sum += weight * Vec3d(n[0], n[1], n[2]);
      weights += weight;
    }
  }
  const Vec3d mean = sum / weights;
  return mean.norm() > 0.99 ? Vec3d(mean.normalized()) : Vec3d::Zero();
}

// Normal of the plane through a window's points, facing the camera. Where q = ray/z, a plane is m · q = 1/z,
// linear in its unknowns with the steps of z as the only error.
Vec3d FittedNormal(const Frame& frame, const Camera<double>& camera, int x, int y) {
  Mat3d squares = Mat3d::Zero();
  Vec3d values = Vec3d::Zero();
  for (int dy = -kHalfWindow_px; dy <= kHalfWindow_px; dy += 2) {
    for (int dx = -kHalfWindow_px; dx <= kHalfWindow_px; dx += 2) {
      const Vec3d ray = camera.Unproject(Vec2d(x + dx, y + dy)).value();
      const Vec3d q = ray / ray.z();
      squares += q * q.transpose();
      values += q / *frame.z_mm.Pixel(x + dx, y + dy);
    }
  }
  return -squares.ldlt().solve(values).normalized();
}

struct Agreement {
  int windows = 0;
  double median_deg = 0;
  double mean_roll_deg = 0;  // rotation about the camera's axis from the fitted to the stored normals
};

Agreement Compare(const Frame& frame, const CameraIntrinsics& intrinsics) {
  const Camera<double> camera(intrinsics);
  std::vector<double> angles_deg;
  double roll = 0;
  for (int y = kHalfWindow_px; y + kHalfWindow_px < frame.z_mm.height; y += 16) {
    for (int x = kHalfWindow_px; x + kHalfWindow_px < frame.z_mm.width; x += 16) {
      const Vec3d stored = StoredNormal(frame, x, y);
      if (stored.isZero()) continue;
      const Vec3d fitted = FittedNormal(frame, camera, x, y);
      angles_deg.push_back(std::atan2(fitted.cross(stored).norm(), fitted.dot(stored)) * 180 / kPi);
      roll += fitted.cross(stored).z() * 180 / kPi;
    }
  }
  const auto middle = angles_deg.begin() + angles_deg.size() / 2;
  std::nth_element(angles_deg.begin(), middle, angles_deg.end());
  return {int(angles_deg.size()), *middle, roll / double(angles_deg.size())};
}

TEST(RealFrame, DepthAndNormalsAgreeThroughTheCamera) {
  LUMEN_NEEDS_DATA(kFrame);
  const Agreement found = Compare(ReadFrame(), C3vdIntrinsics());
  EXPECT_GT(found.windows, 3000);
  EXPECT_LT(found.median_deg, 1.4);
  EXPECT_LT(std::abs(found.mean_roll_deg), 0.1);
}

// What the comparison must reject: other cameras, and normals that face away.
TEST(RealFrame, OtherCamerasDisagree) {
  LUMEN_NEEDS_DATA(kFrame);
  Frame frame = ReadFrame();

  CameraIntrinsics transposed = C3vdIntrinsics();
  std::swap(transposed.stretch[1], transposed.stretch[2]);
  EXPECT_GT(std::abs(Compare(frame, transposed).mean_roll_deg), 0.2);  // of the 0.33° that S turns

  CameraIntrinsics shifted = C3vdIntrinsics();
  shifted.cx += 50;
  EXPECT_GT(Compare(frame, shifted).median_deg, 3);

  CameraIntrinsics mirrored = C3vdIntrinsics();  // as if x ran to the left: 7 px off
  mirrored.cx = mirrored.width - 1 - mirrored.cx;
  EXPECT_GT(Compare(frame, mirrored).median_deg, 1.4);

  CameraIntrinsics longer = C3vdIntrinsics();
  longer.a[0] *= 1.1;
  EXPECT_GT(Compare(frame, longer).median_deg, 3);

  for (float& n : frame.normal.data) n = -n;
  EXPECT_GT(Compare(frame, C3vdIntrinsics()).median_deg, 170);
}

// The distance along the ray must not pass for z: C3VD's depth is z.
TEST(RealFrame, DepthIsAlongTheAxisNotTheRay) {
  LUMEN_NEEDS_DATA(kFrame);
  Frame frame = ReadFrame();
  const Camera<double> camera(C3vdIntrinsics());
  for (int y = 0; y < frame.z_mm.height; ++y) {
    for (int x = 0; x < frame.z_mm.width; ++x) {
      *frame.z_mm.Pixel(x, y) *= static_cast<float>(camera.Unproject(Vec2d(x, y)).value().z());
    }
  }
  EXPECT_GT(Compare(frame, C3vdIntrinsics()).median_deg, 10);
}

// A C3VD folder as it was downloaded: one frame, no sequence.toml, the built-in camera, whose image is the
// octagon.
TEST(RealFrame, FolderIsReadAsDownloaded) {
  LUMEN_NEEDS_DATA(kFrame);
  const Sequence sequence = ReadSequence(SharedData(kFrame));
  EXPECT_FALSE(sequence.has_toml);
  ASSERT_EQ(sequence.frames.size(), 1u);
  EXPECT_EQ(sequence.frames[0].number, 10);
  EXPECT_FALSE(sequence.frames[0].gain);
  EXPECT_EQ(sequence.calibration.camera.a, C3vdIntrinsics().a);
  const Image8 color = ReadColor(sequence, sequence.frames[0]);
  EXPECT_EQ(color.width, 1350);
  EXPECT_EQ(color.height, 1080);
  EXPECT_EQ(color.channels, 3);
}

}  // namespace
}  // namespace lumen::test
