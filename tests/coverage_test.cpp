// How much was surveyed: by the truth, by the reconstruction alone, and by the simulator's own count.
#include "recon/evaluation/coverage.h"

#include <gtest/gtest.h>

#include "common/files.h"
#include "recon/evaluation/evaluate.h"
#include "recon/evaluation/portrait.h"
#include "recon/evaluation/visibility.h"
#include "recon/evaluation/walk.h"
#include "sim/face_visibility.h"
#include "sim/ground_truth.h"
#include "tests/evaluation_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::At;

// A camera on the axis of a tube with closed ends, radius 20, 200 long, that looks along it with half a field
// of 45° (and the image's corners, so the field is cut round by a mask) sees the wall from 20 mm ahead of it
// on to the far end: of a tube that is smooth, all in closed form.
TEST(Coverage, ShareOfATube) {
  const Mesh tube = test::Tube(20, 200, 0, 128, 100);
  Sequence sequence = test::PinholeSequence({At(0, 0, 100)});
  Image8& mask = sequence.calibration.mask = Image8(200, 200, 1);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) *mask.Pixel(x, y) = std::hypot(x - 99.5, y - 99.5) < 100 ? 255 : 0;
  }
  const Evaluation result = Evaluate(tube, tube, sequence, {.completeness_points = 20000});
  // Of the wall 80 of 200 mm and one end are seen; within 20 mm of the seen lie 20 mm more of the wall.
  const double end = kPi * 20 * 20, per_mm = 2 * kPi * 20;
  EXPECT_NEAR(result.coverage.observed_fraction, (80 * per_mm + end) / (200 * per_mm + 2 * end), 0.004);
  const double near = (80 * per_mm + end) / (100 * per_mm + end);
  ASSERT_TRUE(result.coverage.truth_share && result.coverage.reconstruction_share);
  EXPECT_NEAR(*result.coverage.truth_share, near, 0.004);
  EXPECT_EQ(*result.coverage.reconstruction_share, *result.coverage.truth_share);
  EXPECT_EQ(*result.coverage.DifferencePoints(), 0);
}

// A reconstruction that misses a fold sees behind it, and says so: its share is too high.
TEST(Coverage, AMissedFoldShowsAsADifference) {
  const Mesh smooth = test::Tube(20, 120, 0, 64, 80), folded = test::Tube(20, 120, 6, 64, 80);
  const Sequence sequence = test::PinholeSequence({At(0, 0, 10), At(0, 0, 30)}, 60);
  const EvaluateOptions options = {.completeness_points = 20000};
  const Evaluation result = Evaluate(smooth, folded, sequence, options);
  EXPECT_GT(*result.coverage.DifferencePoints(), 3);
  EXPECT_LT(*result.coverage.truth_share, *result.coverage.reconstruction_share);
  EXPECT_EQ(*Evaluate(folded, smooth, sequence, options).coverage.DifferencePoints(),
            -*result.coverage.DifferencePoints());
}

TEST(Coverage, NothingSeenIsNoShare) {
  const Mesh cube = test::Cube(10, 4);
  const std::vector<SurfacePoint> points = SpreadPoints(cube, 100, 0);
  const SurveyedShare share = MeasureShare(points, std::vector<int>(100, 0), 20);
  EXPECT_EQ(share.whole, 0);
  EXPECT_FALSE(share.near);
}

// The faces of a closed wall that the only frame sees by the evaluation's rule: the centroid or a corner,
// moved a thousandth towards it. That rule takes what lies some µm behind another face for its own place;
// faces that look away, which nobody in the lumen sees, would come in by their corners.
std::vector<uint8_t> FacesSeen(const RayScene& scene, const Sequence& sequence) {
  std::vector<SurfacePoint> points;
  const Mesh& mesh = scene.mesh();
  for (int f = 0; f < static_cast<int>(mesh.faces.size()); ++f) {
    const Vec3i& face = mesh.faces[f];
    const Vec3d centroid = (mesh.vertices[face[0]] + mesh.vertices[face[1]] + mesh.vertices[face[2]]) / 3;
    points.push_back({centroid, f});
    for (int corner : face) points.push_back({0.999 * mesh.vertices[corner] + 0.001 * centroid, f});
  }
  const std::vector<int> seeing = SeePoints(scene, points, FrameViews(sequence)).frames_seeing;
  std::vector<uint8_t> seen(mesh.faces.size(), 0);
  const Vec3d eye = sequence.frames[0].world_from_camera.translation();
  for (size_t i = 0; i < points.size(); ++i) {
    const int face = points[i].face;
    const bool faces_away = FaceNormal(mesh, face).dot(mesh.vertices[mesh.faces[face][0]] - eye) <= 0;
    seen[face] |= seeing[i] > 0 && !faces_away;
  }
  return seen;
}

// Simulator and evaluation count the frames that see each face, each by code of its own. The simulator also
// counts faces of which a pixel's ray meets a part while the four points are hidden: a few at silhouettes.
TEST(Coverage, CountsPerFaceAgreeWithTheSimulators) {
  const Mesh mesh = test::Tube(20, 120, 5, 64, 96);
  const RayScene scene(mesh);
  Sequence sequence = test::PinholeSequence({At(2, -1, 15), At(-4, 2, 40), At(0, 5, 75), At(1, 1, 110)});
  sequence.calibration.camera = Resized(C3vdIntrinsics(), 270, 216);
  sequence.calibration.mask = C3vdOctagon(270, 216);
  sequence.frames[3].world_from_camera.rotate(Eigen::AngleAxisd(2.5, Vec3d::UnitY()));
  const Camera<double> camera(sequence.calibration.camera);
  const Image8 valid = ValidPixels(sequence.calibration);
  FaceVisibility simulators(mesh.faces.size());
  std::vector<int> evaluations(mesh.faces.size(), 0);
  for (const SequenceFrame& frame : sequence.frames) {
    std::vector<uint8_t> seen(mesh.faces.size(), 0);
    MarkObserved(scene, camera, valid, frame.world_from_camera, &seen);
    AddFrame(mesh, frame.world_from_camera.translation(), seen, &simulators);
    Sequence alone = sequence;
    alone.frames = {frame};
    const std::vector<uint8_t> by_evaluation = FacesSeen(scene, alone);
    for (size_t f = 0; f < seen.size(); ++f) evaluations[f] += by_evaluation[f];
  }
  int differ = 0, seen = 0, often = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    differ += evaluations[f] != simulators.frames[f];
    seen += evaluations[f] > 0;
    often += evaluations[f] > 1;
  }
  EXPECT_LT(differ, 0.01 * static_cast<double>(mesh.faces.size()));
  EXPECT_GT(seen, 4000);
  EXPECT_LT(seen, static_cast<int>(mesh.faces.size()) - 500);
  EXPECT_GT(often, 1000);
}

TEST(Walk, StopsAreEvenAlongThePath) {
  // Dense at its start.
  const Sequence sequence = test::PinholeSequence(
      {At(0, 0, 0), At(0, 0, 1), At(0, 0, 2), At(0, 0, 10), At(0, 0, 21), At(0, 0, 30)});
  EXPECT_EQ(StopsAlongPath(sequence, 4), (std::vector<int>{0, 3, 4, 5}));
  EXPECT_EQ(StopsAlongPath(sequence, 9), (std::vector<int>{0, 1, 2, 3, 4, 5}));
  const Sequence still = test::PinholeSequence({At(0, 0, 0), At(0, 0, 0), At(0, 0, 0)});
  EXPECT_EQ(StopsAlongPath(still, 2), (std::vector<int>{0}));
}

// What lies behind the only camera is red, and shows when it looks back.
TEST(Walk, WhatWasNeverSeenIsRed) {
  const test::ScratchFolder scratch;
  const Mesh tube = test::Tube(20, 100, 0, 64, 50);
  const Sequence sequence = test::PinholeSequence({At(0, 0, 50)});
  const std::vector<int> seeing = SeeVertices(RayScene(tube), FrameViews(sequence)).frames_seeing;
  WriteWalk(tube, seeing, sequence, scratch.path());
  const Mesh colored = ReadMesh(scratch / "unseen.ply");
  int red = 0;
  for (size_t v = 0; v < tube.vertices.size(); ++v) {
    const bool is_red = colored.colors[v][0] > 3 * colored.colors[v][1];
    EXPECT_EQ(is_red, seeing[v] == 0);
    EXPECT_EQ(is_red, seeing[v] == 0 || tube.vertices[v].z() < 50);
    red += is_red;
  }
  EXPECT_GT(red, 1000);
  // Two pictures, one below the other, each red or not in its middle.
  const Image8 walk = ReadImage8(scratch / "walk.png", 3);
  const auto is_red = [&](int y) {
    const uint8_t* pixel = walk.Pixel(walk.width / 2, y);
    EXPECT_GT(pixel[0], 20);
    return pixel[0] > 3 * pixel[1];
  };
  EXPECT_FALSE(is_red(walk.height / 4 + 20));
  EXPECT_TRUE(is_red(walk.height * 3 / 4 + 10));
}

// On the axis a facing plate has half its colour where the lamp's light has fallen to half.
TEST(Portrait, TheLampFades) {
  Mesh plate;
  test::AddPlate({-50, -50, 30}, {100, 0, 0}, {0, 100, 0}, 1, &plate);
  View view;
  view.camera = Resized(test::PinholeSequence({}).calibration.camera, 51, 51);
  const std::vector<Rgb8> colors(plate.vertices.size(), Rgb8{200, 200, 200});
  EXPECT_NEAR(Portrait(plate).Draw(view, colors).Pixel(25, 25)[0], 200, 1);
  view.fade_mm = 30;
  EXPECT_NEAR(Portrait(plate).Draw(view, colors).Pixel(25, 25)[0], 100, 1);
}

}  // namespace
}  // namespace lumen
