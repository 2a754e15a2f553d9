#include "recon/evaluation/evaluate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "common/error.h"
#include "common/parallel.h"
#include "recon/evaluation/evaluation_json.h"
#include "recon/evaluation/evaluation_table.h"
#include "tests/evaluation_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::At;

// From the middle, in three directions.
Sequence LookAround() {
  const Pose right(Eigen::AngleAxisd(1.3, Vec3d::UnitY())), up(Eigen::AngleAxisd(1.3, Vec3d::UnitX()));
  return test::PinholeSequence({At(0, 0, 0), right, up});
}

void ExpectAllErrorsAre(const RegionError& region, double expected_mm) {
  ASSERT_TRUE(region.error);
  EXPECT_NEAR(region.error->medae_mm, expected_mm, 1e-9);
  EXPECT_NEAR(region.error->mae_mm, expected_mm, 1e-9);
  EXPECT_NEAR(region.error->rmse_mm, expected_mm, 1e-9);
}

// Every vertex of a cube is as far from a larger one as their half sides differ.
TEST(Evaluate, SmallerCubeIsOffByTheDifference) {
  const Evaluation result = Evaluate(test::Cube(18.5, 12), test::Cube(20, 9), LookAround());
  EXPECT_GT(result.surveyed.vertices, 200);
  EXPECT_GT(result.extended.vertices, result.surveyed.vertices);
  ExpectAllErrorsAre(result.surveyed, 1.5);
  ExpectAllErrorsAre(result.extended, 1.5);
  for (double error_mm : result.signed_error_mm) EXPECT_NEAR(error_mm, -1.5, 1e-9);
}

// From a vertex pushed out along its radius, the closest point of a polyhedron inscribed in a sphere is that
// vertex: all others lie below the plane through it that is perpendicular to the radius.
TEST(Evaluate, LargerSphereIsOffByTheDifference) {
  const Evaluation result = Evaluate(test::Sphere(22, 16), test::Sphere(20, 16), LookAround());
  ExpectAllErrorsAre(result.surveyed, 2);
  ExpectAllErrorsAre(result.extended, 2);
  for (double error_mm : result.signed_error_mm) EXPECT_NEAR(error_mm, 2, 1e-9);
}

TEST(Evaluate, TheTruthItselfIsOffByNothing) {
  const Mesh tube = test::Tube(20, 120, 3, 60, 90);
  const Evaluation result = Evaluate(tube, tube, test::PinholeSequence({At(0, 0, 30), At(0, 0, 50)}));
  ExpectAllErrorsAre(result.surveyed, 0);
  ASSERT_TRUE(result.completeness.error);
  EXPECT_NEAR(result.completeness.error->rmse_mm, 0, 1e-9);
  EXPECT_EQ(result.completeness.within_1mm, 1.0);
}

// MedAE, MAE, RMSE over errors that differ: a plate tilted against the truth, its vertices at heights 0, 1,
// …, 9.
TEST(Evaluate, FiguresAreMedianMeanAndRootMeanSquare) {
  Mesh truth, tilted;
  test::AddPlate({-100, -100, 50}, {200, 0, 0}, {0, 200, 0}, 1, &truth);
  test::AddPlate({-9, -9, 41}, {18, 0, 9}, {0, 18, 0}, 9, &tilted);
  const Evaluation result = Evaluate(tilted, truth, test::PinholeSequence({At(0, 0, 0)}));
  EXPECT_EQ(result.surveyed.vertices, 100);
  ASSERT_TRUE(result.surveyed.error);
  EXPECT_NEAR(result.surveyed.error->medae_mm, 4.5, 1e-9);
  EXPECT_NEAR(result.surveyed.error->mae_mm, 4.5, 1e-9);
  EXPECT_NEAR(result.surveyed.error->rmse_mm, std::sqrt(285 / 10.0), 1e-9);
}

TEST(Evaluate, ExtendedIsWithinTwentyMillimetresOfSurveyed) {
  const Mesh tube = test::Tube(20, 200, 3, 50, 100);
  const Evaluation result = Evaluate(tube, tube, test::PinholeSequence({At(0, 0, 80), At(5, 0, 90)}));
  std::vector<bool> extended;
  int64_t vertices = 0;
  for (const Vec3d& vertex : tube.vertices) {
    double closest = std::numeric_limits<double>::infinity();
    for (size_t v = 0; v < tube.vertices.size(); ++v) {
      if (result.frames_seeing[v] > 0) closest = std::min(closest, (vertex - tube.vertices[v]).norm());
    }
    extended.push_back(closest <= 20);
    vertices += closest <= 20;
  }
  double area_mm2 = 0;
  for (size_t f = 0; f < tube.faces.size(); ++f) {
    const Vec3i& face = tube.faces[f];
    if (extended[face[0]] && extended[face[1]] && extended[face[2]])
      area_mm2 += FaceArea(tube, static_cast<int>(f));
  }
  EXPECT_EQ(result.extended.vertices, vertices);
  EXPECT_NEAR(result.coverage.extended_area_mm2, area_mm2, 1e-6);
  EXPECT_LT(vertices, static_cast<int64_t>(tube.vertices.size()));
  EXPECT_GT(vertices, result.surveyed.vertices);
}

// A camera in the middle of a cube with half a field of 45° sees one side; of 42°, the vertices out to
// 10·tan 42° = 9.004 mm, here ±8 mm.
TEST(Evaluate, CoverageOfACube) {
  const Mesh cube = test::Cube(10, 10);
  const Evaluation result = Evaluate(cube, cube, test::PinholeSequence({At(0, 0, 0)}, 42));
  EXPECT_EQ(result.surveyed.vertices, 9 * 9);
  EXPECT_NEAR(result.coverage.surveyed_area_mm2, 16 * 16, 1e-9);
  const Evaluation side = Evaluate(cube, cube, test::PinholeSequence({At(0, 0, 0)}, 45));
  EXPECT_NEAR(side.coverage.observed_fraction, 1.0 / 6, 1e-4);
}

// The camera sees one side of the true cube, |x| < 10; the reconstruction is its half x > 0. The other half's
// points are |x| away, evenly over 0…10 mm: a mean of 5 for half of the points, a mean square of 100/3.
TEST(Evaluate, CompletenessOfAHalf) {
  Mesh half;
  test::AddPlate({0, -10, 10}, {10, 0, 0}, {0, 20, 0}, 4, &half);
  const Evaluation result = Evaluate(half, test::Cube(10, 10), test::PinholeSequence({At(0, 0, 0)}));
  ASSERT_TRUE(result.completeness.error);
  EXPECT_NEAR(result.completeness.points, 100'000 / 6, 2);
  EXPECT_NEAR(result.completeness.error->mae_mm, 2.5, 0.02);
  EXPECT_NEAR(result.completeness.error->rmse_mm, std::sqrt(50.0 / 3), 0.02);
  EXPECT_NEAR(result.completeness.error->medae_mm, 0, 0.1);
  EXPECT_NEAR(*result.completeness.within_1mm, 0.55, 0.005);
  EXPECT_NEAR(*result.completeness.within_3mm, 0.65, 0.005);
  ExpectAllErrorsAre(result.surveyed,
                     0);  // what is there is right: only completeness tells that half is missing
}

// The cameras' side is inside, whichever way the truth's faces look, and where the wall has two sides.
TEST(Evaluate, SignFollowsTheCameras) {
  Mesh towards, away, nearer;
  test::AddPlate({-20, -20, 30}, {40, 0, 0}, {0, 40, 0}, 4, &away);
  test::AddPlate({-20, -20, 30}, {0, 40, 0}, {40, 0, 0}, 4, &towards);
  test::AddPlate({-10, -10, 29}, {20, 0, 0}, {0, 20, 0}, 4, &nearer);
  const Sequence sequence = test::PinholeSequence({At(0, 0, 0)});
  for (const Mesh* truth : {&towards, &away}) {
    for (double error_mm : Evaluate(nearer, *truth, sequence).signed_error_mm)
      EXPECT_NEAR(error_mm, -1, 1e-9);
  }

  Mesh wall = test::Cube(26, 4);
  const Mesh lumen = test::Cube(20, 4);
  const int first = static_cast<int>(wall.vertices.size());
  wall.vertices.insert(wall.vertices.end(), lumen.vertices.begin(), lumen.vertices.end());
  for (const Vec3i& face : lumen.faces)
    wall.faces.push_back(Vec3i(face[0], face[2], face[1]).array() + first);
  for (double error_mm : Evaluate(test::Cube(19, 4), wall, LookAround()).signed_error_mm) {
    EXPECT_NEAR(error_mm, -1, 1e-9);
  }
  for (double error_mm : Evaluate(test::Cube(21, 4), wall, LookAround()).signed_error_mm) {
    EXPECT_GT(error_mm, 0.99);
  }
}

TEST(Evaluate, VerticesWithoutAFaceDontCount) {
  Mesh mesh = test::Cube(19, 8);
  const Evaluation before = Evaluate(mesh, test::Cube(20, 8), LookAround());
  mesh.vertices.push_back({0, 0, 5});
  const Evaluation after = Evaluate(mesh, test::Cube(20, 8), LookAround());
  EXPECT_EQ(ToJson(after), ToJson(before));
  EXPECT_EQ(after.frames_seeing.back(), 0);
}

TEST(Evaluate, IsTheSameForAnyNumberOfThreads) {
  const Mesh truth = test::Tube(20, 120, 3, 80, 120), reconstruction = test::Tube(20.5, 119, 2, 90, 100);
  const Sequence sequence = test::PinholeSequence({At(0, 0, 20), At(3, 1, 40), At(-2, 5, 60)});
  SetThreadCount(1);
  const Evaluation one = Evaluate(reconstruction, truth, sequence);
  SetThreadCount(3);
  const Evaluation many = Evaluate(reconstruction, truth, sequence);
  SetThreadCount(0);
  EXPECT_EQ(ToJson(one).dump(), ToJson(many).dump());
  EXPECT_EQ(one.signed_error_mm, many.signed_error_mm);
  EXPECT_EQ(one.frames_seeing, many.frames_seeing);
  EXPECT_GT(one.surveyed.error->mae_mm, 0.1);
}

TEST(Evaluate, ReportsAReconstructionThatNoFrameSees) {
  Mesh elsewhere = test::Cube(10, 3);
  for (Vec3d& vertex : elsewhere.vertices) vertex.z() -= 500;
  const Evaluation result = Evaluate(elsewhere, test::Cube(20, 3), test::PinholeSequence({At(0, 0, 0)}));
  const nlohmann::json json = ToJson(result);
  EXPECT_EQ(json["surveyed"]["vertices"], 0);
  EXPECT_TRUE(json["surveyed"]["mae_mm"].is_null());
  EXPECT_EQ(json["extended"]["vertices"], 0);
  EXPECT_TRUE(json["extended"]["medae_mm"].is_null());
  EXPECT_GT(json["completeness"]["mae_mm"], 400);
  EXPECT_NE(ToTable(result).find("no frame sees the reconstruction"), std::string::npos);

  const Evaluation nothing_observed =
      Evaluate(test::Cube(10, 3), elsewhere, test::PinholeSequence({At(0, 0, 0)}));
  EXPECT_TRUE(ToJson(nothing_observed)["completeness"]["within_1mm"].is_null());
  EXPECT_EQ(nothing_observed.coverage.observed_fraction, 0);
}

TEST(Evaluate, JsonHasTheDocumentedKeys) {
  const nlohmann::json json =
      ToJson(Evaluate(test::Cube(19, 4), test::Cube(20, 4), test::PinholeSequence({At(0, 0, 0)})));
  std::set<std::string> keys;
  const nlohmann::json flat = json.flatten();
  for (const auto& [key, value] : flat.items()) keys.insert(key);
  const std::set<std::string> expected = {"/surveyed/medae_mm",
                                          "/surveyed/mae_mm",
                                          "/surveyed/rmse_mm",
                                          "/surveyed/vertices",
                                          "/extended/medae_mm",
                                          "/extended/mae_mm",
                                          "/extended/rmse_mm",
                                          "/extended/vertices",
                                          "/completeness/medae_mm",
                                          "/completeness/mae_mm",
                                          "/completeness/rmse_mm",
                                          "/completeness/within_1mm",
                                          "/completeness/within_3mm",
                                          "/coverage/surveyed_area_mm2",
                                          "/coverage/extended_area_mm2",
                                          "/coverage/observed_fraction",
                                          "/coverage/truth_share",
                                          "/coverage/reconstruction_share",
                                          "/coverage/difference_percentage_points",
                                          "/mesh/watertight",
                                          "/mesh/components",
                                          "/mesh/faces",
                                          "/mesh/self_intersections"};
  EXPECT_EQ(keys, expected);
  EXPECT_EQ(json["mesh"]["watertight"], true);
}

std::string ErrorOf(const Mesh& reconstruction) {
  try {
    Evaluate(reconstruction, test::Cube(20, 2), test::PinholeSequence({At(0, 0, 0)}));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Evaluate, RejectsWhatIsNoSurface) {
  EXPECT_NE(ErrorOf({}).find("has no faces"), std::string::npos);

  Mesh all_zero = test::Cube(10, 2);
  for (Vec3d& vertex : all_zero.vertices) vertex.setZero();
  EXPECT_NE(ErrorOf(all_zero).find("has no area"), std::string::npos);

  Mesh not_finite = test::Cube(10, 2);
  not_finite.vertices[5].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(ErrorOf(not_finite).find("vertex 5"), std::string::npos);

  Mesh out_of_range = test::Cube(10, 2);
  out_of_range.faces[7][1] = 1000;
  EXPECT_NE(ErrorOf(out_of_range).find("face 7"), std::string::npos);
}

TEST(Evaluate, ReadsTheSequencesOwnTruth) {
  const test::ScratchFolder scratch;
  Sequence sequence = LookAround();
  sequence.folder = scratch.path();
  EXPECT_THROW(Evaluate(test::Cube(19, 4), sequence), InputError);
  sequence.ground_truth_mesh = scratch / "mesh.ply";
  EXPECT_THROW(Evaluate(test::Cube(19, 4), sequence), InputError);
  WriteMesh(sequence.ground_truth_mesh, test::Cube(20, 4));
  ExpectAllErrorsAre(Evaluate(test::Cube(19, 4), sequence).surveyed, 1);
}

TEST(CheckMesh, TellsClosedFromOpen) {
  Mesh mesh = test::Cube(10, 3);
  EXPECT_TRUE(CheckMesh(mesh).watertight);
  EXPECT_EQ(CheckMesh(mesh).components, 1);
  EXPECT_EQ(CheckMesh(mesh).faces, 6 * 2 * 9);
  EXPECT_EQ(CheckMesh(mesh).self_intersections, 0);

  Mesh flipped = mesh;
  std::swap(flipped.faces[4][0], flipped.faces[4][1]);
  EXPECT_FALSE(CheckMesh(flipped).watertight);

  mesh.faces.pop_back();
  EXPECT_FALSE(CheckMesh(mesh).watertight);
  EXPECT_EQ(CheckMesh(mesh).components, 1);

  const Mesh soup = test::Soup(test::Cube(10, 1));
  EXPECT_FALSE(CheckMesh(soup).watertight);
  EXPECT_EQ(CheckMesh(soup).components, 12);
  EXPECT_FALSE(CheckMesh({}).watertight);
}

Mesh TwoCubes(double offset_mm) {
  Mesh mesh = test::Cube(10, 2), other = mesh;
  const int first = static_cast<int>(mesh.vertices.size());
  for (const Vec3d& vertex : other.vertices) mesh.vertices.push_back(vertex + Vec3d::Constant(offset_mm));
  for (const Vec3i& face : other.faces) mesh.faces.push_back(face.array() + first);
  return mesh;
}

TEST(CheckMesh, CountsComponentsAndCrossings) {
  EXPECT_EQ(CheckMesh(TwoCubes(50)).components, 2);
  EXPECT_EQ(CheckMesh(TwoCubes(50)).self_intersections, 0);
  EXPECT_TRUE(CheckMesh(TwoCubes(7)).watertight);  // each cube is, and that is what the word says
  EXPECT_GT(CheckMesh(TwoCubes(7)).self_intersections, 0);

  Mesh three_on_an_edge;
  three_on_an_edge.vertices = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}};
  three_on_an_edge.faces = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}};
  EXPECT_FALSE(CheckMesh(three_on_an_edge).self_intersections);
  EXPECT_FALSE(CheckMesh(three_on_an_edge).watertight);
}

}  // namespace
}  // namespace lumen
