// The twin of C3VD's sequences: a lumen around each camera path, recorded or standing in.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "common/pose_file.h"
#include "common/progress.h"
#include "sim/geometry/around_path.h"
#include "sim/geometry/centreline.h"
#include "sim/scene.h"
#include "sim/trajectory/stand_in.h"
#include "tests/mesh_checks.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::SharedData;

constexpr char kTwin[] = LUMEN_SOURCE_FOLDER "/scenes/c3vd_twin";

// The names of Table 1 of the paper (LightNeuS), spelt as C3VD spells them.
const std::vector<std::string> kSequences = {
    "cecum_t1_a",   "cecum_t1_b", "cecum_t2_a", "cecum_t2_b",   "cecum_t2_c",   "cecum_t3_a",
    "cecum_t4_a",   "cecum_t4_b", "desc_t4_a",  "sigmoid_t1_a", "sigmoid_t2_a", "sigmoid_t3_a",
    "sigmoid_t3_b", "trans_t1_a", "trans_t1_b", "trans_t2_a",   "trans_t2_b",   "trans_t2_c",
    "trans_t3_a",   "trans_t3_b", "trans_t4_a", "trans_t4_b"};

Scene CoarseTwin(const std::string& name, const std::string& poses) {
  return ReadScene(kTwin + ("/" + name + ".toml"), {"geometry.tolerance_mm=0.3", "trajectory.path=" + poses},
                   0);
}

std::string RecordedPath(const std::string& name) {
  return SharedData("c3vd/poses/" + name + ".txt").string();
}

// Of every so-many-th camera, by CGAL's distances: an upper bound of the smallest.
double SmallestDistance(const Scene& scene, size_t step) {
  double smallest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < scene.world_from_camera.size(); i += step) {
    const Vec3d place = scene.world_from_camera[i].translation();
    smallest = std::min(smallest, test::DistanceByBruteForce(scene.geometry.mesh, place));
  }
  return smallest;
}

TEST(Twin, IsThereForEverySequenceOfTheTable) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(kTwin)) {
    if (entry.path().extension() == ".toml") found.push_back(entry.path().stem().string());
  }
  std::ranges::sort(found);
  EXPECT_EQ(found, kSequences);
}

TEST(Twin, RecordedCamerasStayThreeMillimetresFromTheWall) {
  LUMEN_NEEDS_DATA("c3vd/poses");
  SetQuiet(true);
  for (const std::string& name : kSequences) {
    const Scene scene = CoarseTwin(name, RecordedPath(name));
    EXPECT_FALSE(scene.path_is_stand_in) << name;
    const std::vector<Pose> recorded = ReadPoses(RecordedPath(name));
    ASSERT_EQ(scene.world_from_camera.size(), recorded.size()) << name;
    EXPECT_EQ(scene.world_from_camera.back().matrix(), recorded.back().matrix()) << name;
    // The sampled ones only; reading the scene has looked at all of them with the project's own distances.
    EXPECT_GE(SmallestDistance(scene, recorded.size() / 4), 3) << name;
  }
}

TEST(Twin, StandInsHaveTheLengthAndTheFramesOfWhatTheyStandFor) {
  SetQuiet(true);
  for (const std::string name : {"cecum_t4_a", "desc_t4_a", "sigmoid_t2_a", "trans_t2_c", "trans_t4_b"}) {
    const Scene scene = CoarseTwin(name, "/absent/poses.txt");
    EXPECT_TRUE(scene.path_is_stand_in) << name;
    EXPECT_GE(SmallestDistance(scene, scene.world_from_camera.size() / 4), 3) << name;
    if (!fs::exists(RecordedPath(name))) continue;
    const std::vector<Pose> recorded = ReadPoses(RecordedPath(name));
    EXPECT_EQ(scene.world_from_camera.size(), recorded.size()) << name;
    EXPECT_NEAR(PathLength(scene.world_from_camera), PathLength(recorded), 0.1) << name;
  }
}

TEST(Twin, WallsBoundOneVolume) {
  SetQuiet(true);
  for (const std::string name : {"cecum_t4_a", "sigmoid_t3_a", "trans_t2_a"}) {
    EXPECT_TRUE(test::BoundsOneVolume(CoarseTwin(name, RecordedPath(name)).geometry.mesh)) << name;
  }
}

// Cameras that walk a half circle aside, each looking along +z but for `turn_rad` about y.
std::vector<Pose> SidewaysPath(double radius_mm, double turn_rad) {
  std::vector<Pose> path;
  for (int i = 0; i <= 100; ++i) {
    Pose pose = Pose::Identity();
    const double angle = kPi * i / 100;
    pose.translation() = Vec3d(radius_mm * std::cos(angle), radius_mm * std::sin(angle), 0);
    pose.linear() = Eigen::AngleAxisd(turn_rad, Vec3d::UnitY()).toRotationMatrix();
    path.push_back(pose);
  }
  return path;
}

TEST(AroundPath, CentrelineReachesAheadAndBehindAlongTheView) {
  CentrelineRule rule;
  rule.ahead_mm = 60;
  rule.behind_mm = 15;
  rule.off_centre_mm = 0;
  rule.widest_radius_mm = 25;
  const double turn_rad = 0.4;
  const Vec3d view(std::sin(turn_rad), 0, std::cos(turn_rad));
  const std::vector<Pose> path = SidewaysPath(8, turn_rad);
  const std::vector<Vec3d> points = CentrelineAroundPath(path, rule, 1);
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const Pose& pose : path) {
    least = std::min(least, view.dot(pose.translation()));
    most = std::max(most, view.dot(pose.translation()));
  }
  EXPECT_NEAR(view.dot(points.front()), least - 15, 1.5);
  EXPECT_NEAR(view.dot(points.back()), most + 60, 1.5);
  EXPECT_GT(view.dot((points.back() - points.front()).normalized()), 0.99);
}

TEST(AroundPath, BendsNoMoreSharplyThanItsWallAllows) {
  CentrelineRule rule;
  rule.bend_rad = 1.5;
  rule.ahead_mm = 30;
  rule.widest_radius_mm = 30;
  EXPECT_LT(Centreline(CentrelineAroundPath(SidewaysPath(3, 0), rule, 1)).MaxCurvature() * 30, 0.9);
}

TEST(AroundPath, CamerasThatLookAllWaysAreRefused) {
  std::vector<Pose> path = SidewaysPath(3, 0);
  for (size_t i = 0; i < path.size(); i += 2) path[i].rotate(Eigen::AngleAxisd(kPi, Vec3d::UnitX()));
  EXPECT_NE(ErrorOf([&] { CentrelineAroundPath(path, {}, 1); }).find("look all ways"), std::string::npos);
}

TEST(StandIn, AWayThatIsTooShortForItsTurningPointsIsRefused) {
  const auto read = [](const std::string& length) {
    const Config config = Config::Parse(
        "frames = 50\ndepth_mm = [0, 20, 5]\naside_mm = 2\nturn_rad = 0.1\nlength_mm = " + length,
        "scene.toml");
    return StandInPoses(config.root());
  };
  EXPECT_NEAR(PathLength(read("60")), 60, 1e-6);
  EXPECT_EQ(ErrorOf([&] { read("30"); }).find("scene.toml:5: length_mm: this movement is between 3"), 0u);
}

}  // namespace
}  // namespace lumen
