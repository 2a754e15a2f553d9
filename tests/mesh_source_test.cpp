#include "sim/geometry/mesh_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/error.h"
#include "common/files.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/mesh_repair.h"
#include "sim/trajectory/trajectory.h"
#include "tests/mesh_checks.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ScratchFolder;
using test::SharedData;

// An open tube along z, radius 20 mm, as an untidy exporter leaves it: every face has corners of its own,
// every third is turned round, some are doubled, some have no area.
Mesh UntidyTube(double length_mm) {
  Mesh soup;
  const int columns = 36, rows = static_cast<int>(length_mm / 3.5);
  const auto corner = [&](int row, int column) {
    const double angle = 2 * kPi * (column % columns) / columns;
    return Vec3d(20 * std::cos(angle), 20 * std::sin(angle), length_mm * row / rows);
  };
  const auto add = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const int first = static_cast<int>(soup.vertices.size());
    soup.vertices.insert(soup.vertices.end(), {a, b, c});
    soup.faces.emplace_back(first, first + 1, first + 2);
    if (soup.faces.size() % 3 == 0) std::swap(soup.faces.back()[0], soup.faces.back()[1]);
    if (soup.faces.size() % 50 == 0) soup.faces.push_back(Vec3i(soup.faces.back()));
    if (soup.faces.size() % 70 == 0) soup.faces.emplace_back(first, first, first + 1);
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      add(corner(row, column), corner(row, column + 1), corner(row + 1, column + 1));
      add(corner(row, column), corner(row + 1, column + 1), corner(row + 1, column));
    }
  }
  return soup;
}

class MeshSource : public ::testing::Test {
 protected:
  Geometry Load(const Mesh& mesh, const std::string& keys = "") {
    WriteMesh(folder_ / "mesh.ply", mesh);
    return LoadFile("path = \"mesh.ply\"\n" + keys);
  }
  Geometry LoadFile(const std::string& keys) {
    const Config config = Config::Parse(keys, "scene", folder_.path());
    Geometry geometry = LoadMeshSource(config.root());
    config.RejectUnknown();
    return geometry;
  }
  std::string Refusal(const Mesh& mesh, const std::string& keys = "") {
    try {
      Load(mesh, keys);
    } catch (const InputError& error) {
      return error.what();
    }
    return "not refused";
  }
  ScratchFolder folder_;
};

TEST_F(MeshSource, UntidyOpenTubeBecomesAClosedVolume) {
  const Geometry tube = Load(UntidyTube(100));
  EXPECT_TRUE(test::BoundsOneVolume(tube.mesh));
  // A 36-gon's prism; the fair caps bulge by something between nothing and a half-sphere.
  const double prism = 18 * 400 * std::sin(2 * kPi / 36) * 100;
  EXPECT_GT(test::Volume(tube.mesh), prism);
  EXPECT_LT(test::Volume(tube.mesh), prism + 4.0 / 3 * kPi * 8000);
}

TEST_F(MeshSource, FindsTheMiddleOfATube) {
  const Geometry tube = Load(UntidyTube(100));
  const Centreline line(tube.centreline);
  EXPECT_GT(line.length_mm(), 85);
  for (double s = 10; s < line.length_mm() - 10; s += 5) {
    EXPECT_LT(line.At(s).point.head<2>().norm(), 2);
    EXPECT_GT(std::abs(line.At(s).tangent.z()), 0.98);
  }
  const Geometry reversed = Load(UntidyTube(100), "reverse = true");
  EXPECT_LT((reversed.centreline.front() - tube.centreline.back()).norm(), 1.5);
}

TEST_F(MeshSource, CutsOutAStretchOfTheGivenCentreline) {
  WriteFile(folder_ / "line.txt", "# along the axis\n0 0 0\n0 0 50 # middle\n\n0 0 100\n");
  const Geometry part = Load(UntidyTube(100), "centreline = \"line.txt\"\nbetween = [20, 70]");
  EXPECT_TRUE(test::BoundsOneVolume(part.mesh));
  ASSERT_EQ(part.centreline.size(), 51u);
  EXPECT_NEAR((part.centreline.front() - Vec3d(0, 0, 20)).norm(), 0, 0.1);
  EXPECT_NEAR((part.centreline.back() - Vec3d(0, 0, 70)).norm(), 0, 0.1);
  for (const Vec3d& v : part.mesh.vertices) {
    if (std::abs(v.head<2>().norm() - 20) < 0.01) {
      EXPECT_GT(v.z(), 20 - 1e-6);
      EXPECT_LT(v.z(), 70 + 1e-6);
    }
  }
}

TEST_F(MeshSource, UnitAndScaleTurnCoordinatesIntoMillimetres) {
  Mesh metres = UntidyTube(100);
  for (Vec3d& v : metres.vertices) v *= 1e-3 / 2;
  const double diagonal = Bounds(Load(UntidyTube(100)).mesh).diagonal().norm();
  EXPECT_NEAR(Bounds(Load(metres, "unit = \"m\"\nscale = 2").mesh).diagonal().norm(), diagonal, 0.5);
}

// Steps of ±1 mm from vertex to vertex, as voxels leave them: they go, the radius stays.
TEST_F(MeshSource, SmoothingTakesStepsAwayAndKeepsTheVolume) {
  Mesh rough = UntidyTube(100);
  for (Vec3d& v : rough.vertices) {
    const bool odd =
        (std::lround(std::atan2(v.y(), v.x()) / (2 * kPi / 36)) + std::lround(v.z() / 3.5)) % 2 != 0;
    v.head<2>() *= 1 + (odd ? 0.05 : -0.05);
  }
  const Mesh smooth = Load(rough, "smooth_iterations = 10\nrefine_mm = 2").mesh;
  EXPECT_TRUE(test::BoundsOneVolume(smooth));
  double deviation = 0;
  for (const Vec3d& v : smooth.vertices) {
    if (v.z() > 15 && v.z() < 85) deviation = std::max(deviation, std::abs(v.head<2>().norm() - 20));
  }
  EXPECT_LT(deviation, 0.35);
}

TEST_F(MeshSource, SubdivisionReachesTheEdgeLength) {
  const Mesh fine = Load(UntidyTube(50), "refine_mm = 1").mesh;
  double sum = 0;
  for (const Vec3i& f : fine.faces) sum += (fine.vertices[f[0]] - fine.vertices[f[1]]).norm();
  EXPECT_LT(sum / fine.faces.size(), 1.1);
}

TEST_F(MeshSource, RefusesWhatCantBeRepairedWithTheReason) {
  const Mesh line = {{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 1, 2}}, {}};
  EXPECT_NE(Refusal(line).find("mesh.ply: no face has an area"), std::string::npos);
  EXPECT_NE(Refusal(UntidyTube(100), "close = false").find("2 holes; close = true fills holes"),
            std::string::npos);
  const Mesh sheet = {{{0, 0, 0}, {9, 0, 0}, {9, 9, 0}, {0, 9, 0}}, {{0, 1, 2}, {0, 2, 3}}, {}};
  EXPECT_NE(Refusal(sheet).find("scene:1: path: can't use"), std::string::npos);
  EXPECT_NE(Refusal(UntidyTube(100), "between = [50, 500]").find("scene:2: between: the centreline ends at"),
            std::string::npos);
  WriteFile(folder_ / "off.txt", "100 0 0\n100 0 90\n");
  EXPECT_NE(Refusal(UntidyTube(100), "centreline = \"off.txt\"").find("its centreline runs outside of it"),
            std::string::npos);
  WriteFile(folder_ / "bad.txt", "0 0 0\n0 0\n");
  EXPECT_NE(Refusal(UntidyTube(100), "centreline = \"bad.txt\"").find("bad.txt:2: expected \"x y z\""),
            std::string::npos);
}

TEST(MeshRepair, KeepsTheLargestPieceAndSaysWhatItLeavesOut) {
  Mesh soup = UntidyTube(40);
  const size_t corners = soup.vertices.size();
  soup.vertices.insert(soup.vertices.end(), {{90, 0, 0}, {95, 0, 0}, {90, 5, 0}});
  soup.faces.emplace_back(corners, corners + 1, corners + 2);
  RepairLog log;
  const Mesh kept = MakeManifold(soup, &log);
  EXPECT_LT(Bounds(kept).max().x(), 21);
  EXPECT_EQ(log.back(), "left out 1 smaller piece of 1 face in all");
}

// A one-sided strip has no inside.
TEST_F(MeshSource, RefusesAMoebiusStrip) {
  Mesh strip;
  const int steps = 60;
  for (int i = 0; i < steps; ++i) {
    const double angle = 2 * kPi * i / steps;
    for (const double side : {-8.0, 8.0}) {
      const double radius = 40 + side * std::cos(angle / 2);
      strip.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle),
                                  side * std::sin(angle / 2));
    }
  }
  for (int i = 0; i < steps; ++i) {
    const int a = 2 * i, b = 2 * i + 1, last = i + 1 == steps;
    const int c = last ? 1 : a + 2, d = last ? 0 : a + 3;
    strip.faces.emplace_back(a, b, c);
    strip.faces.emplace_back(b, d, c);
  }
  EXPECT_NE(Refusal(strip).find("can't use"), std::string::npos);
}

// The scene's own stretch of a CT colon and its recorded path.
TEST(CtColon, SceneGivesAClosedColonAndAClearPath) {
  LUMEN_NEEDS_DATA("colon_ct");
  const std::string ct = SharedData("colon_ct").string() + "/EdinGCA00020_";
  const Config config = Config::Read(
      LUMEN_SOURCE_FOLDER "/scenes/colon_ct.toml",
      {"geometry.path=\"" + ct + "SF+-HF-.obj\"", "geometry.centreline=\"" + ct + "centreline_mm.txt\"",
       "trajectory.path=\"" + SharedData("c3vd/poses/sigmoid_t2_a.txt").string() + "\"",
       "geometry.refine_mm=3"});
  const Geometry colon = BuildGeometry(config.root().Table("geometry"), 1);
  EXPECT_TRUE(test::BoundsOneVolume(colon.mesh));
  EXPECT_GT(colon.centreline.size(), 100u);
  const std::vector<Pose> poses = BuildTrajectory(config.root().Table("trajectory"), colon, 1);
  EXPECT_EQ(poses.size(), 40u);
  for (size_t i = 0; i < poses.size(); i += 10)
    EXPECT_GE(test::DistanceByBruteForce(colon.mesh, poses[i].translation()), 5);
}

}  // namespace
}  // namespace lumen
