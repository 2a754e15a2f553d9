#include "sim/geometry/colon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "common/error.h"
#include "common/parallel.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"
#include "tests/mesh_checks.h"

namespace lumen {
namespace {

Geometry Build(const std::string& keys, uint64_t seed = 1) {
  const Config config = Config::Parse("kind = \"colon\"\n" + keys, "colon");
  config.root().String("kind");
  Geometry geometry = BuildColon(config.root(), seed);
  config.RejectUnknown();
  return geometry;
}

std::string Refusal(const std::string& keys) {
  try {
    Build(keys);
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

constexpr char kPlain[] =
    "haustra_depth_mm = 0\nfold_height_mm = 0\ntaenia_depth_mm = 0\nirregularity_mm = 0\n";

constexpr char kPolyps[] = R"(polyps = [{paris = "Ip", at_mm = 30, angle_rad = 0.5, size_mm = 7},
                                        {paris = "Is", at_mm = 55, angle_rad = 2.5, size_mm = 6},
                                        {paris = "IIa", at_mm = 60, angle_rad = -1.5, size_mm = 9}]
)";

TEST(Colon, EverySegmentIsClosedOutwardAndFreeOfSelfIntersections) {
  for (const char* segment : {"cecum", "ascending", "transverse", "descending", "sigmoid"}) {
    SCOPED_TRACE(segment);
    EXPECT_TRUE(test::BoundsOneVolume(
        Build("tolerance_mm = 0.3\nlength_mm = 120\nsegment = \"" + std::string(segment) + "\"").mesh));
  }
}

TEST(Colon, PolypsKeepItClosedWithoutSelfIntersections) {
  for (uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    EXPECT_TRUE(test::BoundsOneVolume(Build(std::string("tolerance_mm = 0.1\n") + kPolyps, seed).mesh));
  }
}

TEST(Colon, TheCheckItselfRejects) {
  Mesh mesh = Build("tolerance_mm = 0.5\nlength_mm = 60").mesh;
  Mesh inside_out = mesh;
  for (Vec3i& f : inside_out.faces) std::swap(f[0], f[1]);
  EXPECT_FALSE(test::BoundsOneVolume(inside_out));
  Mesh folded = mesh;
  folded.vertices[folded.vertices.size() / 2] += Vec3d(0, 0, 30);
  EXPECT_FALSE(test::BoundsOneVolume(folded));
  mesh.faces.pop_back();
  EXPECT_FALSE(test::BoundsOneVolume(mesh));
}

// π R² L + 4/3 π R³, however the tube bends: by Pappus, its centre of mass being on the curve.
TEST(Colon, PlainTubeHasTheVolumeOfACapsule) {
  const double radius = 20, length = 100;
  const double expected = kPi * radius * radius * length + 4.0 / 3 * kPi * std::pow(radius, 3);
  const double area = 2 * kPi * radius * (length + 2 * radius), tolerance_mm = 0.01;
  for (const char* bend : {"bend_rad = 0", "bend_rad = 1.5\ntorsion_rad = 2"}) {
    const Mesh mesh =
        Build(std::string(kPlain) + "diameter_mm = 40\nlength_mm = 100\ntolerance_mm = 0.01\n" + bend).mesh;
    EXPECT_NEAR(test::Volume(mesh), expected, area * tolerance_mm) << bend;
    EXPECT_LT(test::Volume(mesh), expected) << "a convex wall's chords lie inside";
  }
}

// A straight colon along z from the origin, so that a vertex's radius is its distance to the z axis.
TEST(Colon, RadiusStaysWithinTheAnatomicalParameters) {
  const Mesh mesh = Build(
                        "bend_rad = 0\ndiameter_mm = 44\nhaustra_spacing_mm = 30\nfold_height_mm = 5\n"
                        "haustra_depth_mm = 2\ntaenia_depth_mm = 1\nirregularity_mm = 0.1\nlength_mm = 100\n"
                        "tolerance_mm = 0.05")
                        .mesh;
  double narrowest = std::numeric_limits<double>::infinity(), widest = 0;
  for (const Vec3d& v : mesh.vertices) {
    if (v.z() < 0 || v.z() > 100) continue;
    narrowest = std::min(narrowest, std::hypot(v.x(), v.y()));
    widest = std::max(widest, std::hypot(v.x(), v.y()));
  }
  EXPECT_GT(narrowest, 22 - 1.2 * 5 - 1 - 0.9);
  EXPECT_LT(narrowest, 22 - 0.8 * 5 + 0.9) << "the folds should stand in";
  EXPECT_GT(widest, 22 + 1) << "the haustra should bulge";
  EXPECT_LT(widest, 22 + 2 + 0.9);
  EXPECT_NEAR(Bounds(mesh).max().z(), 100 + 22, 1e-9);
  EXPECT_NEAR(Bounds(mesh).min().z(), -22, 1e-9);
}

// In each sector, folds follow each other at the given spacing: local minima of the radius along the sector's
// middle.
TEST(Colon, FoldsAreHaustraSpacingApart) {
  const Mesh mesh = Build(
                        "bend_rad = 0\ndiameter_mm = 44\nhaustra_spacing_mm = 30\nfold_height_mm = 5\n"
                        "irregularity_mm = 0\nlength_mm = 240\ntolerance_mm = 0.1")
                        .mesh;
  // Crests: vertices at least 70% of the height inside. Clusters of them in (z, angle) are the folds.
  std::vector<Vec3d> folds;
  for (const Vec3d& v : mesh.vertices) {
    if (v.z() < 0 || v.z() > 240 || std::hypot(v.x(), v.y()) > 22 - 0.7 * 5) continue;
    const bool known = std::any_of(folds.begin(), folds.end(), [&](const Vec3d& f) {
      return std::abs(f.z() - v.z()) < 6 && f.head<2>().normalized().dot(v.head<2>().normalized()) > 0.5;
    });
    if (!known) folds.push_back(v);
  }
  // Three sectors of 240 mm, 7.5 mm of margin at either end: 7 or 8 folds each.
  EXPECT_GE(folds.size(), 20u);
  EXPECT_LE(folds.size(), 25u);
}

TEST(Colon, CentrelineHasItsLengthItsBendAndAPointAMillimetre) {
  const Geometry colon = Build("length_mm = 110\nbend_rad = 0.9\ntorsion_rad = 1\ntolerance_mm = 0.5");
  const Centreline line(colon.centreline);
  EXPECT_NEAR(line.length_mm(), 110, 0.01);
  EXPECT_EQ(colon.centreline.size(), 111u);
  EXPECT_NEAR((line.At(0).tangent - Vec3d::UnitZ()).norm(), 0, 1e-3);
  // In a plane, the tangents' angle is the bend.
  const Centreline plane(BentCurve(110, 0.9, 0));
  EXPECT_NEAR(std::acos(plane.At(0).tangent.dot(plane.At(110).tangent)), 0.9, 1e-3);
}

TEST(Centreline, FramesAreOrthonormalAndDontTwistOnACircle) {
  std::vector<Vec3d> points;
  for (int i = 0; i <= 157; ++i) points.emplace_back(50 * std::cos(i * 0.01), 50 * std::sin(i * 0.01), 0);
  const Centreline line(points);
  EXPECT_NEAR(line.MaxCurvature(), 1.0 / 50, 1e-4);
  const double tilt = line.At(0).normal.z();
  for (double s = 0; s < line.length_mm(); s += 3.3) {
    const CentrelineFrame frame = line.At(s);
    EXPECT_NEAR(frame.point.norm(), 50, 1e-4);
    EXPECT_NEAR(frame.normal.dot(frame.tangent), 0, 1e-12);
    EXPECT_NEAR((frame.normal.cross(frame.binormal) - frame.tangent).norm(), 0, 1e-12);
    EXPECT_NEAR(frame.normal.z(), tilt, 1e-4)
        << "a frame that doesn't twist keeps its share of the plane's normal";
  }
}

TEST(Colon, SameSeedSameBytesForAnyNumberOfThreads) {
  const std::string keys = "tolerance_mm = 0.2\nlength_mm = 60\nbend_rad = 0.5";
  const int threads = ThreadCount();
  SetThreadCount(1);
  const Mesh one = Build(keys, 5).mesh;
  SetThreadCount(2);
  const Mesh two = Build(keys, 5).mesh;
  SetThreadCount(threads);
  EXPECT_EQ(one.vertices, two.vertices);
  EXPECT_EQ(one.faces, two.faces);
  EXPECT_NE(one.vertices, Build(keys, 6).mesh.vertices);
}

TEST(Colon, TrianglesKeepTheToleranceAgainstAFourTimesFinerMesh) {
  const std::string keys = "length_mm = 50\nbend_rad = 0.4\nhaustra_spacing_mm = 25\n";
  const Mesh coarse = Build(keys + "tolerance_mm = 0.2").mesh,
             fine = Build(keys + "tolerance_mm = 0.05").mesh;
  EXPECT_GT(fine.faces.size(), 2 * coarse.faces.size());
  const Clearance surface(coarse);
  double farthest = 0;
  for (const Vec3d& v : fine.vertices) farthest = std::max(farthest, surface.At(v).distance_mm);
  EXPECT_LT(farthest, 0.2);
  EXPECT_GT(farthest, 0.02) << "a mesh as fine as that would not have been refined to its tolerance only";
}

TEST(Colon, PolypsRiseByTheirHeight) {
  const std::string keys = std::string(kPlain) + "bend_rad = 0\ndiameter_mm = 44\ntolerance_mm = 0.05\n";
  const struct {
    const char* paris;
    double size_mm, height_mm;
  } cases[] = {{"Is", 8, 4.4}, {"IIa", 10, 2}, {"Ip", 8, 4 * (1 + 1.1 + std::sqrt(1 - 0.16))}};
  for (const auto& polyp : cases) {
    const Mesh mesh =
        Build(keys + "polyps = [{paris = \"" + polyp.paris +
              "\", at_mm = 40, angle_rad = 0, size_mm = " + std::to_string(polyp.size_mm) + "}]")
            .mesh;
    double narrowest = 22;
    for (const Vec3d& v : mesh.vertices) {
      if (v.z() > 0 && v.z() < 90) narrowest = std::min(narrowest, std::hypot(v.x(), v.y()));
    }
    EXPECT_NEAR(22 - narrowest, polyp.height_mm, 0.06) << polyp.paris;
  }
}

TEST(Colon, RefusesAWallThatWouldMeetItself) {
  EXPECT_NE(Refusal("bend_rad = 6").find("colon:2: bend_rad: bends with a radius of"), std::string::npos);
  EXPECT_NE(
      Refusal("fold_height_mm = 19").find("fold_height_mm: folds, taeniae and irregularity may leave only"),
      std::string::npos);
  EXPECT_NE(
      Refusal("length_mm = 500\nbend_rad = 7\ndiameter_mm = 20\nfold_height_mm = 2\ntaenia_width_mm = 5")
          .find("comes within"),
      std::string::npos);
  EXPECT_NE(Refusal("fold_thickness_mm = 25").find("folds would merge"), std::string::npos);
  EXPECT_NE(Refusal("taenia_width_mm = 25").find("three taeniae would cover"), std::string::npos);
}

TEST(Colon, RefusesPolypsThatDontFit) {
  const std::string polyp = "paris = \"Is\", angle_rad = 0";
  EXPECT_NE(Refusal("polyps = [{" + polyp + ", at_mm = 1, size_mm = 8}]").find("reaches over an end"),
            std::string::npos);
  EXPECT_NE(Refusal("polyps = [{" + polyp + ", at_mm = 45, size_mm = 29}]").find("would fill the lumen"),
            std::string::npos);
  EXPECT_NE(
      Refusal("polyps = [{" + polyp + ", at_mm = 45, size_mm = 6}, {" + polyp + ", at_mm = 50, size_mm = 6}]")
          .find("touches polyp 0"),
      std::string::npos);
  EXPECT_NE(Refusal("polyps = [{paris = \"IIb\", angle_rad = 0, at_mm = 45, size_mm = 6}]").find("IIb"),
            std::string::npos);
}

TEST(Colon, RefusesContradictoryKeys) {
  EXPECT_NE(
      Refusal("control_points = [0, 0, 0, 0, 0, 50]\nbend_rad = 1").find("give either control_points or"),
      std::string::npos);
  EXPECT_NE(
      Refusal("diameter_mm = 40\ndiameters_mm = [40, 50]").find("give either diameter_mm or diameters_mm"),
      std::string::npos);
  EXPECT_NE(Refusal("control_points = [0, 0, 0, 0, 0]").find("two or more points"), std::string::npos);
  EXPECT_NE(Refusal("segment = \"rectum\"").find("rectum"), std::string::npos);
}

}  // namespace
}  // namespace lumen
