#include "sim/imaging/shutter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/error.h"
#include "common/mesh.h"
#include "sim/imaging/path.h"

namespace lumen {
namespace {

Pose PoseAt(const Vec3d& position, double turn_rad = 0) {
  return Pose(Eigen::Translation3d(position) * Eigen::AngleAxisd(turn_rad, Vec3d(1, 2, 2) / 3));
}

void ExpectPose(const Pose& found, const Pose& expected) {
  EXPECT_LT((found.matrix() - expected.matrix()).norm(), 1e-9) << found.matrix() << '\n' << expected.matrix();
}

TEST(Shutter, MovesEvenlyBetweenFramesAndBeyondTheEnds) {
  const std::vector<Pose> poses = {PoseAt({0, 0, 0}, 0.1), PoseAt({2, 0, 1}, 0.3), PoseAt({2, 4, 1}, 0.2)};
  const CameraMotion middle({}, poses, 1), first({}, poses, 0), last({}, poses, 2);
  ExpectPose(middle.At(0), poses[1]);
  ExpectPose(middle.At(-1), poses[0]);
  ExpectPose(middle.At(1), poses[2]);
  ExpectPose(middle.At(-0.25), PoseAt({1.5, 0, 0.75}, 0.25));
  ExpectPose(middle.At(0.25), PoseAt({2, 1, 1}, 0.275));
  ExpectPose(first.At(0.5), PoseAt({1, 0, 0.5}, 0.2));
  ExpectPose(first.At(-0.5), PoseAt({-1, 0, -0.5}, 0.0));
  ExpectPose(last.At(-0.5), PoseAt({2, 2, 1}, 0.25));
  ExpectPose(last.At(0.5), PoseAt({2, 6, 1}, 0.15));
  ExpectPose(CameraMotion({}, {poses[1]}, 0).At(0.7), poses[1]);
}

TEST(Shutter, RowsAndSamplesHaveTheirTimes) {
  const CameraMotion motion({0.4, 0.8}, {Pose::Identity()}, 0);
  EXPECT_DOUBLE_EQ(motion.Time(0.5, 0.5), 0);
  EXPECT_DOUBLE_EQ(motion.Time(0, 0.5), -0.4);
  EXPECT_DOUBLE_EQ(motion.Time(1, 0.5), 0.4);
  EXPECT_DOUBLE_EQ(motion.Time(0.5, 0), -0.2);
}

// The extremes are met exactly, and rounding leads beyond neither.
TEST(Shutter, PartsOfTheDuration) {
  const Shutter shutter = {0.4, -0.8};
  EXPECT_DOUBLE_EQ(shutter.Duration(), 1.2);
  EXPECT_FLOAT_EQ(CameraMotion(shutter, {Pose::Identity()}, 0).Part(0.3), 0.75f);
  for (int i = 1; i <= 300; ++i) {
    const double exposure = i / 300.0, readout = std::sin(7.0 * i);
    const CameraMotion motion({exposure, readout}, {Pose::Identity()}, 0);
    EXPECT_EQ(motion.Part(motion.Time(readout < 0, 0)), 0) << i;
    const float last = motion.Part(motion.Time(readout > 0, std::nextafter(1.0, 0.0)));
    EXPECT_LE(last, 1) << i;
    EXPECT_GT(last, 1 - 1e-6f) << i;
  }
}

// A plate x > 0 at a distance of 20 mm, seen by a camera that moves along x and sees 1 mm as 5 px.
struct Stage {
  Mesh mesh;
  CameraIntrinsics intrinsics;
  Light light;
  PathOptions options;
  Surface surface;

  Stage() {
    mesh.vertices = {{0, -50, 20}, {50, -50, 20}, {50, 50, 20}, {0, 50, 20}};
    mesh.faces = {{0, 1, 2}, {0, 2, 3}};
    intrinsics.width = 40;
    intrinsics.height = 24;
    intrinsics.fx = intrinsics.fy = 100;
    intrinsics.cx = 19.5;
    intrinsics.cy = 11.5;
    light.sources.push_back({Vec3d(1, 1, 0), Vec3d::UnitZ(), 1, Vec3d::Constant(500)});
    options.samples = 4;
  }
  ImageF Render(const Pose& pose, const CameraMotion* motion) const {
    const RayScene wall(mesh);
    const Camera<float> camera(intrinsics);
    const Image8 valid(intrinsics.width, intrinsics.height, 1, 255);
    Film film;
    RenderFrame({&wall, &surface, 0}, {&camera, &valid, pose, &light, motion}, options, 3, 0, false, &film);
    return film.radiance;
  }
};

TEST(Shutter, InstantOfAGlobalShutterIsTheFrame) {
  const Stage stage;
  const std::vector<Pose> poses = {PoseAt({0, 0, 0}), PoseAt({1, 0, 0}, 0.2), PoseAt({2, 1, 0})};
  const CameraMotion still({0, 0}, poses, 1), moving({0.5, 0}, poses, 1);
  EXPECT_EQ(stage.Render(poses[1], &still).data, stage.Render(poses[1], nullptr).data);
  EXPECT_NE(stage.Render(poses[1], &moving).data, stage.Render(poses[1], nullptr).data);
}

// Four rows at a time show what a camera at rest shows from where the camera then is, to the last bit.
TEST(Shutter, RowsAreReadOneAfterTheOther) {
  const Stage stage;
  const std::vector<Pose> poses = {PoseAt({-2, 0, 1}, 0.1), PoseAt({0, 0, 0}), PoseAt({2, 1, 0}, -0.1)};
  const CameraMotion motion({0, 0.9}, poses, 1);
  const ImageF rolling = stage.Render(poses[1], &motion);
  for (int row = 0; row < 24; row += 4) {
    const ImageF rest = stage.Render(motion.At(motion.Time((row + 2) / 24.0, 0.5)), nullptr);
    for (int y = row; y < row + 4; ++y) {
      for (int x = 0; x < 40; ++x) ASSERT_EQ(rolling.Pixel(x, y)[0], rest.Pixel(x, y)[0]) << x << ' ' << y;
    }
  }
}

// The plate's border sweeps over 10 px (2 mm a frame, 5 px a mm, the whole interval) and is seen, at each of
// them, for the part of the exposure that comes after: a ramp. The light's share, being smooth, changes
// little.
TEST(Shutter, EdgeIsBlurredOverItsPath) {
  Stage stage;
  stage.options.samples = 1024;
  const std::vector<Pose> poses = {PoseAt({-2, 0, 0}), PoseAt({0, 0, 0}), PoseAt({2, 0, 0})};
  const CameraMotion motion({1, 0}, poses, 1);
  const ImageF blurred = stage.Render(poses[1], &motion);
  const ImageF inside = stage.Render(PoseAt({30, 0, 0}), nullptr);  // the plate everywhere
  int ramp = 0;
  for (int x = 0; x < 40; ++x) {
    const double place = (x - 19.5) / 5;  // mm; the camera is anywhere within ±1 mm
    const double share = std::clamp((1 + place) / 2, 0.0, 1.0);
    // Sobol's numbers leave 1/1024 of a stratum and the pixel's width.
    EXPECT_NEAR(blurred.Pixel(x, 12)[0] / inside.Pixel(x, 12)[0], share, 0.02) << x;
    ramp += share > 0.05 && share < 0.95;
  }
  EXPECT_GE(ramp, 8);
}

TEST(Shutter, ReadsItsTable) {
  const auto read = [](const std::string& text) {
    return ReadShutter(Config::Parse(text, "scene.toml").root());
  };
  EXPECT_EQ(read("").exposure, 0.5);
  EXPECT_EQ(read("readout = -0.5").readout, -0.5);
  EXPECT_THROW(read("exposure = 1.5"), InputError);
  EXPECT_THROW(read("readout = 2"), InputError);
}

}  // namespace
}  // namespace lumen
