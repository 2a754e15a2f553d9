#include "recon/evaluation/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "common/random.h"
#include "tests/evaluation_scenes.h"

namespace lumen {
namespace {

using test::At;

// Square plate of half side 2 at z = 10 before a wall at z = 30, camera at the origin: it hides |x|, |y| < 6.
TEST(Visibility, PlateHidesWhatLiesBehindIt) {
  Mesh mesh;
  test::AddPlate({-29.5, -29.5, 30}, {59, 0, 0}, {0, 59, 0}, 59, &mesh);
  const size_t wall = mesh.vertices.size();
  test::AddPlate({-2, -2, 10}, {4, 0, 0}, {0, 4, 0}, 3, &mesh);
  const RayScene scene(mesh);
  const FrameViews views(test::PinholeSequence({At(0, 0, 0)}));
  const Visibility seen = SeeVertices(scene, views);
  for (size_t v = 0; v < wall; ++v) {
    const bool hidden = std::max(std::abs(mesh.vertices[v].x()), std::abs(mesh.vertices[v].y())) < 6;
    EXPECT_EQ(seen.frames_seeing[v], hidden ? 0 : 1) << mesh.vertices[v].transpose();
  }
  for (size_t v = wall; v < mesh.vertices.size(); ++v) EXPECT_EQ(seen.frames_seeing[v], 1);
  EXPECT_EQ(seen.places_seen[0],
            std::accumulate(seen.frames_seeing.begin(), seen.frames_seeing.end(), int64_t{0}));
}

TEST(Visibility, EndsAtTheImageTheMaskAndTheCamerasPlane) {
  Mesh mesh;
  test::AddPlate({-40, -40, 30}, {80, 0, 0}, {0, 80, 0}, 79, &mesh);  // the image shows |x|, |y| < 30
  test::AddPlate({-10, -10, -5}, {20, 0, 0}, {0, 20, 0}, 4, &mesh);   // behind
  Sequence sequence = test::PinholeSequence({At(0, 0, 0)});
  Image8& mask = sequence.calibration.mask = Image8(200, 200, 1, 255);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 50; ++x) *mask.Pixel(x, y) = 0;  // x < −15 at z = 30
  }
  const Visibility seen = SeeVertices(RayScene(mesh), FrameViews(sequence));
  int count = 0;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3d& p = mesh.vertices[v];
    const bool expected = p.z() > 0 && p.x() > -15 && p.x() < 30 && std::abs(p.y()) < 30;
    EXPECT_EQ(seen.frames_seeing[v], expected) << p.transpose();
    count += expected;
  }
  EXPECT_GT(count, 1000);
}

// From within a convex surface everything in the image is seen, at grazing angles and from next to the wall
// too, as vertices of a closed mesh and as those of a soup, near the world's origin and far from it.
TEST(Visibility, LosesNoVertexOfAConvexRoom) {
  for (double far_mm : {0.0, 5000.0}) {
    for (bool soup : {false, true}) {
      Mesh mesh = test::Sphere(30, 24);
      if (soup) mesh = test::Soup(mesh);
      for (Vec3d& vertex : mesh.vertices) vertex += Vec3d::Constant(far_mm);
      std::vector<Pose> poses;
      for (const Vec3d& at : {Vec3d(0, 0, 0), Vec3d(0, 0, -29), Vec3d(29, 1, 2), Vec3d(3, -29.6, 2)}) {
        poses.push_back(At(at.x() + far_mm, at.y() + far_mm, at.z() + far_mm));
      }
      const FrameViews views(test::PinholeSequence(poses, 70));
      const Visibility seen = SeeVertices(RayScene(mesh), views);
      for (int frame = 0; frame < views.size(); ++frame) {
        int64_t framed = 0;
        for (const Vec3d& vertex : mesh.vertices) framed += views.Frames(frame, vertex);
        EXPECT_GT(framed, 500);
        EXPECT_EQ(seen.places_seen[frame], framed)
            << "frame " << frame << ", soup " << soup << ", at " << far_mm;
      }
    }
  }
}

// What counts as the same place: at 60 mm with the anchor 30 mm away, some 3 µm.
TEST(Visibility, BlockersCountFromTheToleranceOn) {
  for (const auto& [gap_mm, hides] : {std::pair(1e-4, false), std::pair(1e-2, true)}) {
    Mesh mesh;
    test::AddPlate({-10, -10, 60}, {20, 0, 0}, {0, 20, 0}, 6, &mesh);
    const size_t wall = mesh.vertices.size();
    test::AddPlate({-15, -15, 60 - gap_mm}, {30, 0, 0}, {0, 30, 0}, 5, &mesh);
    test::AddPlate({-10, -10, 0}, {1, 0, 0}, {0, 1, 0}, 1, &mesh);  // moves the anchor
    const Visibility seen = SeeVertices(RayScene(mesh), FrameViews(test::PinholeSequence({At(0, 0, 1)})));
    for (size_t v = 0; v < wall; ++v) EXPECT_EQ(seen.frames_seeing[v], hides ? 0 : 1) << gap_mm;
  }
}

Vec3d RandomVector(uint64_t seed, uint64_t index, double size) {
  Vec3d v;
  for (int axis = 0; axis < 3; ++axis)
    v[axis] = size * (2 * UniformDouble(RandomBits(seed, index, axis)) - 1);
  return v;
}

// How far the segment from `from` to `to` passes inside (> 0) or outside (< 0) the triangle, as the least
// barycentric coordinate of its crossing with the plane; −1 where it doesn't reach the plane.
double Crossing(const Vec3d& from, const Vec3d& to, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d normal = (b - a).cross(c - a);
  const double t = (a - from).dot(normal) / (to - from).dot(normal);
  if (!(t > 0 && t < 1)) return -1;
  const Vec3d p = from + t * (to - from);
  const double area = normal.squaredNorm();
  return std::min({(c - b).cross(p - b).dot(normal), (a - c).cross(p - c).dot(normal),
                   (b - a).cross(p - a).dot(normal)}) /
         area;
}

TEST(Visibility, MatchesBruteForceInDouble) {
  Mesh mesh;
  for (int i = 0; i < 150; ++i) {
    const Vec3d centre = RandomVector(1, i, 30) + Vec3d(0, 0, 50);
    for (int corner = 0; corner < 3; ++corner)
      mesh.vertices.push_back(centre + RandomVector(2 + corner, i, 6));
    mesh.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const RayScene scene(mesh);
  const FrameViews views(test::PinholeSequence({At(0, 0, 0), At(20, 5, 10), At(-15, 8, 30)}));
  const std::vector<SurfacePoint> points = SpreadPoints(mesh, 3000, 3);
  const Visibility vertices_seen = SeeVertices(scene, views);
  const Visibility points_seen = SeePoints(scene, points, views);
  int seen = 0, hidden = 0, too_close_to_call = 0;
  const auto check = [&](const Vec3d& target, const auto& is_own, int answer) {
    int expected = 0;
    for (int frame = 0; frame < views.size(); ++frame) {
      if (!views.Frames(frame, target)) continue;
      double worst = -1;
      for (size_t f = 0; f < mesh.faces.size(); ++f) {
        const Vec3i& face = mesh.faces[f];
        if (is_own(static_cast<int>(f))) continue;
        worst = std::max(worst, Crossing(views.Centre(frame), target, mesh.vertices[face[0]],
                                         mesh.vertices[face[1]], mesh.vertices[face[2]]));
      }
      if (std::abs(worst) < 1e-4) {
        ++too_close_to_call;
        return;
      }
      expected += worst < 0;
      ++(worst < 0 ? seen : hidden);
    }
    EXPECT_EQ(answer, expected) << target.transpose();
  };
  for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) {
    check(
        mesh.vertices[v], [&](int f) { return f == v / 3; }, vertices_seen.frames_seeing[v]);
  }
  for (size_t p = 0; p < points.size(); ++p) {
    check(
        points[p].position, [&](int f) { return f == points[p].face; }, points_seen.frames_seeing[p]);
  }
  EXPECT_GT(seen, 1000);
  EXPECT_GT(hidden, 1000);
  EXPECT_LT(too_close_to_call, 20);
}

// χ² of the points over faces of very different sizes: each holds its share of the area to within one point
// on either side, as strata cut at its two ends.
TEST(SurfacePoints, FallOnFacesByTheirArea) {
  Mesh mesh;
  for (int i = 1; i <= 20; ++i) test::AddPlate({100.0 * i, 0, 0}, {1.0 * i, 0, 0}, {0, 1.0 * i, 0}, 1, &mesh);
  const int count = 10000;
  const std::vector<SurfacePoint> points = SpreadPoints(mesh, count, 1);
  double total = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) total += FaceArea(mesh, static_cast<int>(f));
  std::vector<int> held(mesh.faces.size(), 0);
  for (const SurfacePoint& point : points) {
    ++held[point.face];
    const Vec3i& face = mesh.faces[point.face];
    const Vec3d a = mesh.vertices[face[0]], b = mesh.vertices[face[1]], c = mesh.vertices[face[2]];
    const Vec3d normal = (b - a).cross(c - a);
    EXPECT_GE(std::min({(c - b).cross(point.position - b).dot(normal),
                        (a - c).cross(point.position - c).dot(normal),
                        (b - a).cross(point.position - a).dot(normal)}),
              -1e-9 * normal.squaredNorm());
  }
  for (size_t f = 0; f < held.size(); ++f) {
    EXPECT_NEAR(held[f], count * FaceArea(mesh, static_cast<int>(f)) / total, 2) << "face " << f;
  }
}

// On one triangle the points' mean is its centroid: each coordinate's standard deviation is 1/√18 of the
// side.
TEST(SurfacePoints, AreUniformOnATriangle) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}};
  const int count = 20000;
  Vec3d mean = Vec3d::Zero();
  for (const SurfacePoint& point : SpreadPoints(mesh, count, 5)) mean += point.position / count;
  const double bound = 5 / std::sqrt(18.0 * count);
  EXPECT_NEAR(mean.x(), 1.0 / 3, bound);
  EXPECT_NEAR(mean.y(), 1.0 / 3, bound);
}

}  // namespace
}  // namespace lumen
