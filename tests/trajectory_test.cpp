#include "sim/trajectory/trajectory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/error.h"
#include "common/files.h"
#include "common/random.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"
#include "sim/trajectory/recorded_path.h"
#include "tests/mesh_checks.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ScratchFolder;
using test::SharedData;

const Geometry& SmallColon() {
  static const Geometry colon = [] {
    const Config config = Config::Parse(
        "kind = \"colon\"\nsegment = \"descending\"\nlength_mm = 90\nbend_rad = 0.6\ntolerance_mm = 0.3",
        "colon");
    return BuildGeometry(config.root(), 3);
  }();
  return colon;
}

std::vector<Pose> Follow(const std::string& keys, uint64_t seed = 1) {
  const Config config = Config::Parse(keys, "path");
  std::vector<Pose> poses = BuildTrajectory(config.root(), SmallColon(), seed);
  config.RejectUnknown();
  return poses;
}

std::string Refusal(const std::string& keys) {
  try {
    Follow(keys);
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

double Uniform(uint64_t i, uint64_t k) { return 2 * UniformDouble(RandomBits(11, i, k)) - 1; }

TEST(Clearance, NearestPointOfATriangleIsThatOfCgal) {
  for (uint64_t i = 0; i < 2000; ++i) {
    Vec3d p[4];
    for (int k = 0; k < 12; ++k) p[k / 3][k % 3] = Uniform(i, k);
    const Mesh triangle = {{p[1], p[2], p[3]}, {{0, 1, 2}}, {}};
    const double distance = (p[0] - NearestPointOfTriangle(p[0], p[1], p[2], p[3])).norm();
    EXPECT_NEAR(distance, test::DistanceByBruteForce(triangle, p[0]), 1e-9);
  }
}

TEST(Clearance, TellsInsideFromOutside) {
  const Clearance wall(SmallColon().mesh);
  for (const Vec3d& p : SmallColon().centreline) EXPECT_TRUE(wall.Encloses(p));
  EXPECT_FALSE(wall.Encloses({0, 0, -40}));
  EXPECT_FALSE(wall.Encloses({60, 0, 30}));
}

TEST(Withdrawal, NeverComesNearerThanItsClearance) {
  const std::vector<Pose> poses = Follow(
      "kind = \"withdrawal\"\nstart_mm = 80\nend_mm = 5\nframes = 40\nwobble_mm = 12\nwobble_rad = 0.3\n"
      "clearance_mm = 4");
  ASSERT_EQ(poses.size(), 40u);
  double nearest = 1e9;
  for (const Pose& pose : poses)
    nearest = std::min(nearest, test::DistanceByBruteForce(SmallColon().mesh, pose.translation()));
  EXPECT_GE(nearest, 4);
  EXPECT_LT(nearest, 4.1) << "so much wobble should have been held back somewhere";
}

TEST(Withdrawal, LooksTowardsTheDeepEndAndDrawsBack) {
  const Centreline line(SmallColon().centreline);
  const std::vector<Pose> poses = Follow("kind = \"withdrawal\"\nstart_mm = 60\nend_mm = 10\nframes = 11");
  for (size_t i = 0; i < poses.size(); ++i) {
    const CentrelineFrame frame = line.At(60 - 5.0 * i);
    EXPECT_NEAR((poses[i].translation() - frame.point).norm(), 0, 1e-9);
    EXPECT_NEAR(poses[i].linear().col(2).dot(frame.tangent), 1, 1e-12);
    EXPECT_NEAR((poses[i].linear().transpose() * poses[i].linear() - Mat3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(poses[i].linear().determinant(), 1, 1e-12);
  }
}

TEST(Withdrawal, WobbleHasItsAmplitudeAndIsAFunctionOfPlaceAndSeed) {
  const std::string keys =
      "kind = \"withdrawal\"\nstart_mm = 80\nend_mm = 5\nwobble_mm = 2\nwobble_rad = 0.1\n";
  const std::vector<Pose> few = Follow(keys + "frames = 16"), many = Follow(keys + "frames = 76");
  for (size_t i = 0; i < few.size(); ++i) EXPECT_TRUE(few[i].isApprox(many[5 * i], 1e-12));
  const Centreline line(SmallColon().centreline);
  double aside = 0, step = 0;
  for (size_t i = 0; i < many.size(); ++i) {
    aside = std::max(aside, (many[i].translation() - line.At(80.0 - i).point).norm());
    if (i > 0) step = std::max(step, (many[i].translation() - many[i - 1].translation()).norm());
  }
  EXPECT_GT(aside, 0.7);
  EXPECT_LT(aside, 2 * 2 * std::sqrt(2.0));
  EXPECT_LT(step, 2.5) << "1 mm along and a smooth movement aside";
  EXPECT_FALSE(many[40].isApprox(Follow(keys + "frames = 76", 2)[40], 1e-6));
}

TEST(Withdrawal, SpeedAndRateGiveTheNumberOfFrames) {
  EXPECT_EQ(
      Follow("kind = \"withdrawal\"\nstart_mm = 50\nend_mm = 11\nspeed_mm_s = 3.9\nrate_hz = 10").size(),
      101u);
}

TEST(Withdrawal, RefusesWhatCantBe) {
  const std::string along = "kind = \"withdrawal\"\nstart_mm = 60\nend_mm = 10\n";
  EXPECT_NE(Refusal(along + "frames = 5\nclearance_mm = 14").find("path:5: clearance_mm: frame"),
            std::string::npos);
  EXPECT_NE(Refusal(along + "frames = 5\nclearance_mm = 14").find("too near"), std::string::npos);
  EXPECT_NE(Refusal(along).find("give either frames or speed_mm_s"), std::string::npos);
  EXPECT_NE(Refusal("kind = \"withdrawal\"\nstart_mm = 10\nend_mm = 60\nframes = 5").find("path:3: end_mm"),
            std::string::npos);
  EXPECT_NE(Refusal("kind = \"withdrawal\"\nstart_mm = 95\nend_mm = 60\nframes = 5").find("path:2: start_mm"),
            std::string::npos);
}

// A camera at (1, 2, 30) mm turned by 90° about z, then 4 mm deeper: worked by hand. The file is transposed.
TEST(RecordedPath, ReadsPosesAsTheyAre) {
  const ScratchFolder folder;
  WriteFile(folder / "pose.txt", "0,1,0,0,-1,0,0,0,0,0,1,0,1,2,30,1\n0,1,0,0,-1,0,0,0,0,0,1,0,1,2,34,1\n");
  const std::vector<Pose> poses =
      Follow("kind = \"file\"\npath = \"" + (folder / "pose.txt").string() + "\"");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].translation(), Vec3d(1, 2, 30));
  EXPECT_EQ(poses[1].translation(), Vec3d(1, 2, 34));
  EXPECT_EQ(Vec3d(poses[0].linear() * Vec3d::UnitX()), Vec3d(0, 1, 0));
}

TEST(RecordedPath, NamesTheFrameThatLeavesTheColonOrComesTooNear) {
  const ScratchFolder folder;
  const std::string path = "kind = \"file\"\npath = \"" + (folder / "pose.txt").string() + "\"\n";
  WriteFile(folder / "pose.txt", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1\n1,0,0,0,0,1,0,0,0,0,1,0,0,0,-40,1\n");
  EXPECT_NE(Refusal(path).find("frame 1 is outside the colon"), std::string::npos);
  WriteFile(folder / "pose.txt", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1\n1,0,0,0,0,1,0,0,0,0,1,0,0,0,-13.5,1\n");
  EXPECT_NE(Refusal(path).find("frame 1 comes within 1.00 mm of the wall, 2.00 mm too near"),
            std::string::npos);
  EXPECT_NE(Refusal(path + "frames = 3").find("has 2 poses only"), std::string::npos);
}

// A path that nobody would take for one along our centreline: far off, turned, drawing back while it looks
// ahead.
std::vector<Pose> RecordedSomewhere() {
  Pose world = Pose::Identity();
  world.linear() = Eigen::AngleAxisd(2.1, Vec3d(1, 2, -1).normalized()).toRotationMatrix();
  world.translation() = Vec3d(300, -200, 77);
  std::vector<Pose> poses;
  for (int i = 0; i < 30; ++i) {
    Pose pose = Pose::Identity();
    pose.translation() = Vec3d(0.4 * std::sin(0.5 * i), 0.3 * std::cos(0.4 * i), -i);
    pose.linear() = Eigen::AngleAxisd(0.05 * std::sin(i), Vec3d::UnitX()).toRotationMatrix();
    poses.push_back(world * pose);
  }
  return poses;
}

TEST(RecordedPath, AnchorIsRigidAndLooksDeepFromItsPlace) {
  const std::vector<Pose> recorded = RecordedSomewhere();
  const Centreline line(SmallColon().centreline);
  const Pose anchor = AnchorOnCentreline(recorded, line, 70, 0.3);
  EXPECT_NEAR((anchor.linear().transpose() * anchor.linear() - Mat3d::Identity()).norm(), 0, 1e-12);
  EXPECT_NEAR(anchor.linear().determinant(), 1, 1e-12);
  EXPECT_NEAR((anchor * recorded.front().translation() - line.At(70).point).norm(), 0, 1e-9);
  Vec3d view = Vec3d::Zero();
  for (const Pose& pose : recorded) view += (anchor * pose).linear().col(2);
  const Vec3d deep = (line.At(70).point - line.At(41).point).normalized();
  EXPECT_GT(view.normalized().dot(deep), std::cos(0.02));
  EXPECT_NEAR((anchor * recorded.back().translation() - line.At(41).point).norm(), 0, 2)
      << "true scale, along the lumen";
  // The roll turns the picture and nothing else.
  const Pose unrolled = AnchorOnCentreline(recorded, line, 70, 0);
  const Mat3d turn = anchor.linear() * unrolled.linear().transpose();
  EXPECT_NEAR(Eigen::AngleAxisd(turn).angle(), 0.3, 1e-9);
  EXPECT_NEAR((turn * view - view).norm(), 0, 1e-9);
}

TEST(RecordedPath, RealPathIsShiftedClearOfTheWall) {
  LUMEN_NEEDS_DATA("c3vd/poses");
  const std::string path = "kind = \"file\"\nanchor = \"centreline\"\nat_mm = 70\nframes = 30\npath = \"" +
                           SharedData("c3vd/poses/sigmoid_t2_a.txt").string() + "\"\n";
  const std::vector<Pose> poses = Follow(path + "clearance_mm = 7");
  ASSERT_EQ(poses.size(), 30u);
  for (const Pose& pose : poses)
    EXPECT_GE(test::DistanceByBruteForce(SmallColon().mesh, pose.translation()), 7);
  // 43.5 mm of path with a chord of 39.8 mm, as recorded.
  EXPECT_NEAR((poses.front().translation() - poses.back().translation()).norm(), 39.8, 0.1);
  EXPECT_NE(Refusal(path + "clearance_mm = 13").find("too near"), std::string::npos);
}

}  // namespace
}  // namespace lumen
