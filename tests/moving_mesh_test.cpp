// Rays at a mesh that moves, asked at a time.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "common/ray_scene.h"
#include "tests/path_stage.h"
#include "tests/random_rays.h"

namespace lumen {
namespace {

using test::Between;

constexpr float kFar = 1e6f;  // mm

// Triangles that are shaken from step to step.
std::vector<Mesh> Shaken(int steps) {
  std::vector<Mesh> meshes(steps, test::TriangleSoup(1000, 4));
  for (int step = 0; step < steps; ++step) {
    for (size_t i = 0; i < meshes[step].vertices.size(); ++i) {
      for (int d = 0; d < 3; ++d) meshes[step].vertices[i][d] += Between(-2, 2, 31 + step, i, d);
    }
  }
  return meshes;
}

// Where the vertices are, in double.
Mesh Between(const std::vector<Mesh>& steps, double time) {
  const double along = time * (steps.size() - 1.0);
  const size_t first = std::min(static_cast<size_t>(along), steps.size() - 2);
  Mesh mesh = steps[first];
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.vertices[i] += (along - first) * (steps[first + 1].vertices[i] - mesh.vertices[i]);
  }
  return mesh;
}

struct Meeting {
  uint32_t face = kNoFace;
  double t = std::numeric_limits<double>::infinity();
  Vec3d normal = Vec3d::Zero();
};

// The nearest of all triangles, by Cramer's rule in double.
Meeting Nearest(const Mesh& mesh, const Vec3d& origin, const Vec3d& direction) {
  Meeting nearest;
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    const Vec3d& a = mesh.vertices[mesh.faces[face][0]];
    const Vec3d ab = mesh.vertices[mesh.faces[face][1]] - a, ac = mesh.vertices[mesh.faces[face][2]] - a;
    const Vec3d normal = ab.cross(ac);
    const double determinant = -normal.dot(direction);
    const Vec3d from = origin - a, turned = from.cross(direction);
    const double u = ac.dot(turned) / determinant, v = -ab.dot(turned) / determinant;
    const double t = normal.dot(from) / determinant;
    if (u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t < nearest.t) {
      nearest = {static_cast<uint32_t>(face), t, normal.normalized()};
    }
  }
  return nearest;
}

struct Comparison {
  int agree = 0, hits = 0;
  double point_mm = 0, normal = 0;  // the largest differences
};

// Packets, with the single rays beside them, against the mesh that a time's is said to be.
Comparison Compare(const RayScene& scene, const Mesh& mesh, float time, int packets) {
  Comparison result;
  for (int p = 0; p < packets; ++p) {
    RayPacket packet;
    packet.time = time;
    std::array<Vec3f, kLanes> origins, directions;
    for (int i = 0; i < kLanes; ++i) {
      const uint64_t ray = p * kLanes + i;
      directions[i] = test::RandomDirection(41, ray, 0);
      for (int d = 0; d < 3; ++d) {
        origins[i][d] = static_cast<float>(Between(-25, 25, 42, ray, d));
        packet.origin[d][i] = origins[i][d];
        packet.direction[d][i] = directions[i][d];
      }
      packet.tnear[i] = 0;
      packet.tfar[i] = kFar;
    }
    HitPacket hits;
    scene.Intersect(packet, &hits);
    const LanesI occluded = scene.Occluded(packet);
    const Lanes3 points = scene.Points(hits, time);
    for (int i = 0; i < kLanes; ++i) {
      const Vec3d origin = origins[i].cast<double>() + scene.anchor(),
                  direction = directions[i].cast<double>();
      const Meeting expected = Nearest(mesh, origin, direction);
      const RayHit hit = scene.Intersect(origins[i], directions[i], 0, kFar, time);
      EXPECT_EQ(hit.hit(), hits.face[i] != kNoFace);
      EXPECT_EQ(hit.hit(), occluded[i] != 0);
      EXPECT_EQ(hit.hit(), scene.Occluded(origins[i], directions[i], 0, kFar, time));
      if (hit.face != expected.face || hits.face[i] != expected.face) continue;
      ++result.agree;
      if (!hit.hit()) continue;
      ++result.hits;
      const auto [a, b, c] = scene.Corners(hit.face, time);
      const Vec3d place = (1 - double(hit.u) - hit.v) * a + double(hit.u) * b + double(hit.v) * c;
      for (const Vec3d& met : {Vec3d(points[i].cast<double>() + scene.anchor()), place}) {
        result.point_mm = std::max(result.point_mm, (met - origin - expected.t * direction).norm());
      }
      HitPacket one = hits;
      std::fill_n(one.face, kLanes, hits.face[i]);
      result.normal =
          std::max(result.normal, (scene.Normals(one, time)[i].cast<double>() - expected.normal).norm());
    }
  }
  return result;
}

// The same but for rounding and for what lies within it of an edge, at steps and in between.
TEST(MovingMesh, IsWhereTheTimeSays) {
  const std::vector<Mesh> steps = Shaken(4);
  const RayScene scene(steps);
  EXPECT_TRUE(scene.moves());
  EXPECT_EQ(&scene.mesh(), steps.data());
  constexpr int kPackets = 40;
  for (const float time : {0.0f, 0.1f, 1 / 3.0f, 0.5f, 0.77f, 1.0f}) {
    const Comparison found = Compare(scene, Between(steps, time), time, kPackets);
    EXPECT_GE(found.agree, kPackets * kLanes - 2) << time;
    EXPECT_GT(found.hits, kPackets * kLanes / 4) << time;
    EXPECT_LT(found.point_mm, 2e-4) << time;
    // Corners in double; a float's last digit, and the digits that a sliver's shape loses.
    EXPECT_LT(found.normal, 1e-5) << time;
  }
  // A hundredth of the time is up to 0.12 mm: it must not pass.
  const Comparison other = Compare(scene, Between(steps, 0.51), 0.5f, kPackets);
  EXPECT_GT(other.point_mm, 0.02);
  EXPECT_GT(other.normal, 0.01);
}

TEST(MovingMesh, OneStepStandsStill) {
  const Mesh mesh = test::TriangleSoup(500, 4);
  const RayScene one(std::span(&mesh, 1)), still(mesh);
  EXPECT_FALSE(one.moves());
  for (int i = 0; i < 500; ++i) {
    const Vec3f direction = test::RandomDirection(43, i, 0);
    const RayHit a = one.Intersect(Vec3f::Zero(), direction, 0, kFar, 0.7f),
                 b = still.Intersect(Vec3f::Zero(), direction, 0, kFar);
    EXPECT_EQ(a.face, b.face);
    EXPECT_EQ(a.t, b.t);
  }
}

// A ball that swells, shrinks and shifts.
TEST(MovingMesh, NothingLeaksAtAnyTime) {
  std::vector<Mesh> steps(5, test::Globe(20, 60));
  for (size_t step = 0; step < steps.size(); ++step) {
    const double swell = 1 + 0.2 * std::sin(2.0 * step);
    for (Vec3d& v : steps[step].vertices) {
      v = (swell + 0.1 * std::sin(0.3 * v.z() + step)) * v + Vec3d(0.5 * step, 0, 0);
    }
  }
  const RayScene scene(steps);
  int leaks = 0;
  for (int i = 0; i < 60000; ++i) {
    const float time = static_cast<float>(Between(0, 1, 44, i));
    const Vec3f origin = scene.ToLocal(Vec3d(Between(-3, 3, 45, i), 1, Between(-3, 3, 46, i)));
    Vec3f direction = test::RandomDirection(47, i, 0);
    if (i % 2) {  // at an edge
      const auto corners = scene.Corners(RandomBits(48, i) % scene.mesh().faces.size(), time);
      const double w = Between(0.01, 0.99, 49, i);
      direction = scene.ToLocal(w * corners[0] + (1 - w) * corners[1 + i / 2 % 2]) - origin;
    }
    leaks += !scene.Occluded(origin, direction, 0, kFar, time);
  }
  EXPECT_EQ(leaks, 0);
}

TEST(MovingMesh, HasSoManyStepsAndNoMore) {
  std::vector<Mesh> steps(RayScene::kMostSteps, test::TriangleSoup(3, 4));
  const Vec3d centroid = steps.back().vertices[0];
  for (Vec3d& vertex : steps.back().vertices) vertex += Vec3d(5, 0, 0);
  const RayScene most(steps);
  EXPECT_EQ(most.Corners(0, 1)[0], Vec3d(centroid + Vec3d(5, 0, 0)));
  EXPECT_EQ(most.MomentOf(1).step, steps.size() - 2);
  EXPECT_EQ(most.MomentOf(1).part, 1);
  steps.push_back(steps.back());
  EXPECT_THROW(RayScene{steps}, std::runtime_error);
}

}  // namespace
}  // namespace lumen
