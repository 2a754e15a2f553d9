#include "common/ray_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "common/error.h"
#include "common/parallel.h"
#include "common/random.h"
#include "tests/random_rays.h"

namespace lumen {
namespace {

using test::Between;

constexpr float kFar = 1e6f;  // mm
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Coordinates are multiples of 2⁻¹⁰ mm, so that they are exact in float relative to the anchor and the
// references below see the very triangles that Embree sees.
double OnGrid(double x) { return std::round(x * 1024) / 1024; }

Mesh TriangleSoup(int faces) {
  Mesh mesh = test::TriangleSoup(faces, 4);
  for (Vec3d& vertex : mesh.vertices) vertex = vertex.unaryExpr(&OnGrid);
  return mesh;
}

// A lumen of about 12 mm radius with folds, 80 mm long, closed at both ends by fans.
Mesh ClosedTube(int around, int along) {
  Mesh mesh;
  for (int i = 0; i <= along; ++i) {
    const double z = 80.0 * i / along - 40;
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * kPi * j / around;
      const double radius = 12 + 2 * std::sin(0.5 * z) + std::cos(3 * angle);
      mesh.vertices.push_back(
          {OnGrid(radius * std::cos(angle)), OnGrid(radius * std::sin(angle)), OnGrid(z)});
    }
  }
  const int ends = static_cast<int>(mesh.vertices.size());
  mesh.vertices.push_back({0, 0, -40});
  mesh.vertices.push_back({0, 0, 40});
  for (int j = 0; j < around; ++j) {
    const int next = (j + 1) % around;
    for (int i = 0; i < along; ++i) {
      const int a = i * around + j, b = i * around + next;
      mesh.faces.push_back({a, b, a + around});
      mesh.faces.push_back({b, b + around, a + around});
    }
    mesh.faces.push_back({ends, next, j});
    mesh.faces.push_back({ends + 1, along * around + j, along * around + next});
  }
  return mesh;
}

struct Ray {
  Vec3f origin;     // relative to the anchor
  Vec3f direction;  // unit, nearly
};

// Rays from within the tube (and the soup), all ways.
std::vector<Ray> RandomRays(int count, uint64_t seed) {
  std::vector<Ray> rays(count);
  for (int i = 0; i < count; ++i) {
    rays[i].direction = test::RandomDirection(seed, i, 0);
    const Vec3d origin(Between(-5, 5, seed, i, 2), Between(-5, 5, seed, i, 3), Between(-38, 38, seed, i, 4));
    rays[i].origin = origin.cast<float>();
  }
  return rays;
}

// Möller and Trumbore's intersection in double, of the triangle's plane: t, and how deep inside the triangle
// the point lies (the least barycentric coordinate; negative outside).
struct PlaneHit {
  double t = kInfinity;
  double inside = -kInfinity;
};

PlaneHit IntersectPlane(const Mesh& mesh, size_t face, const Vec3d& origin, const Vec3d& direction) {
  const Vec3i& corners = mesh.faces[face];
  const Vec3d& v0 = mesh.vertices[corners[0]];
  const Vec3d e1 = mesh.vertices[corners[1]] - v0, e2 = mesh.vertices[corners[2]] - v0;
  const Vec3d p = direction.cross(e2);
  const double determinant = e1.dot(p);
  if (determinant == 0) return {};
  const Vec3d s = origin - v0;
  const Vec3d q = s.cross(e1);
  const double u = s.dot(p) / determinant, v = direction.dot(q) / determinant;
  return {e2.dot(q) / determinant, std::min({u, v, 1 - u - v})};
}

struct Nearest {
  uint32_t face = kNoFace;
  double t = kInfinity;
};

Nearest BruteForce(const Mesh& mesh, const Vec3d& origin, const Vec3d& direction) {
  Nearest nearest;
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    const PlaneHit hit = IntersectPlane(mesh, face, origin, direction);
    if (hit.inside >= 0 && hit.t >= 0 && hit.t < nearest.t) nearest = {static_cast<uint32_t>(face), hit.t};
  }
  return nearest;
}

struct Comparison {
  int agree = 0;
  int ties = 0;         // another face, but one of the two is met within a part in 10⁵ of its edge
  int contradict = 0;   // another face, well inside both
  double worst_mm = 0;  // largest difference in distance where both name the same face
};

template <class Reference>
Comparison Compare(const RayScene& scene, const Mesh& mesh, const std::vector<Ray>& rays,
                   const Reference& reference) {
  Comparison result;
  for (const Ray& ray : rays) {
    const Vec3d origin = ray.origin.cast<double>() + scene.anchor(), direction = ray.direction.cast<double>();
    const RayHit hit = scene.Intersect(ray.origin, ray.direction, 0, kFar);
    const Nearest expected = reference(origin, direction);
    if (hit.face == expected.face) {
      ++result.agree;
      if (hit.hit()) result.worst_mm = std::max(result.worst_mm, std::abs(hit.t - expected.t));
      continue;
    }
    bool tie = false;
    for (const uint32_t face : {hit.face, expected.face}) {
      tie |= face != kNoFace && std::abs(IntersectPlane(mesh, face, origin, direction).inside) < 1e-5;
    }
    ++(tie ? result.ties : result.contradict);
  }
  return result;
}

void ExpectSame(const Comparison& found, size_t rays) {
  EXPECT_EQ(found.contradict, 0);
  EXPECT_LE(found.ties, int(rays / 1000));
  EXPECT_GE(found.agree, int(rays - rays / 1000));
  EXPECT_LT(found.worst_mm, 1e-4);
}

TEST(RayScene, AgreesWithBruteForceInDouble) {
  const std::vector<Ray> rays = RandomRays(3000, 11);
  for (const Mesh& mesh : {TriangleSoup(2000), ClosedTube(40, 30)}) {
    const RayScene scene(mesh);
    const auto reference = [&](const Vec3d& o, const Vec3d& d) { return BruteForce(mesh, o, d); };
    ExpectSame(Compare(scene, mesh, rays, reference), rays.size());
  }
}

// A mesh moved by a thousandth of a millimetre must not pass for the same.
TEST(RayScene, ComparisonTellsAMovedMesh) {
  const Mesh mesh = ClosedTube(40, 30);
  Mesh moved = mesh;
  for (Vec3d& vertex : moved.vertices) vertex.x() += 1e-3;
  const RayScene scene(mesh);
  const auto reference = [&](const Vec3d& o, const Vec3d& d) { return BruteForce(moved, o, d); };
  EXPECT_GT(Compare(scene, moved, RandomRays(1000, 13), reference).worst_mm, 9e-4);
}

TEST(RayScene, BarycentricCoordinatesNameThePointMet) {
  const Mesh mesh = TriangleSoup(2000);
  const RayScene scene(mesh);
  int hits = 0;
  for (const Ray& ray : RandomRays(3000, 14)) {
    const RayHit hit = scene.Intersect(ray.origin, ray.direction, 0, kFar);
    if (!hit.hit()) continue;
    ++hits;
    const Vec3i& f = mesh.faces[hit.face];
    const Vec3d point = (1 - double(hit.u) - hit.v) * mesh.vertices[f[0]] + hit.u * mesh.vertices[f[1]] +
                        hit.v * mesh.vertices[f[2]];
    const Vec3d reached = scene.anchor() + (ray.origin + hit.t * ray.direction).cast<double>();
    EXPECT_LT((point - reached).norm(), 2e-4);
  }
  EXPECT_GT(hits, 1000);
}

// Shadow rays of all lengths: occluded exactly where the nearest hit lies before their end.
TEST(RayScene, OccludedWhereSomethingIsHit) {
  const Mesh mesh = TriangleSoup(2000);
  const RayScene scene(mesh);
  int occluded = 0;
  const std::vector<Ray> rays = RandomRays(3000, 15);
  for (size_t i = 0; i < rays.size(); ++i) {
    const float length = static_cast<float>(Between(1, 40, 16, i));
    const RayHit hit = scene.Intersect(rays[i].origin, rays[i].direction, 0.5f, length);
    EXPECT_EQ(scene.Occluded(rays[i].origin, rays[i].direction, 0.5f, length), hit.hit());
    EXPECT_TRUE(!hit.hit() || (hit.t >= 0.5f && hit.t <= length));
    occluded += hit.hit();
  }
  EXPECT_GT(occluded, 300);
  EXPECT_LT(occluded, 2700);
}

RayPacket PacketOf(const std::vector<Ray>& rays, size_t first) {
  RayPacket packet;
  for (int lane = 0; lane < RayPacket::kSize; ++lane) {
    for (int i = 0; i < 3; ++i) {
      packet.origin[i][lane] = rays[first + lane].origin[i];
      packet.direction[i][lane] = rays[first + lane].direction[i];
    }
    packet.tnear[lane] = 0;
    packet.tfar[lane] = lane % 5 == 4 ? -1 : 25;  // every fifth is off
  }
  return packet;
}

TEST(RayScene, PacketsEqualSingleRays) {
  const Mesh mesh = ClosedTube(80, 60);
  const RayScene scene(mesh);
  const std::vector<Ray> rays = RandomRays(16000, 17);
  int hits = 0, ties = 0;
  for (size_t first = 0; first < rays.size(); first += RayPacket::kSize) {
    const RayPacket packet = PacketOf(rays, first);
    HitPacket found;
    scene.Intersect(packet, &found);
    const LanesI occluded = scene.Occluded(packet);
    for (int lane = 0; lane < RayPacket::kSize; ++lane) {
      const Ray& ray = rays[first + lane];
      RayHit expected;
      if (lane % 5 != 4) expected = scene.Intersect(ray.origin, ray.direction, 0, 25);
      EXPECT_EQ(found.face[lane] != kNoFace, expected.hit());
      EXPECT_EQ(occluded[lane] != 0, expected.hit());
      EXPECT_NEAR(found.t[lane], expected.t, 1e-5);
      if (found.face[lane] != expected.face) {
        ++ties;
        continue;
      }
      EXPECT_NEAR(found.u[lane], expected.u, 1e-5);
      EXPECT_NEAR(found.v[lane], expected.v, 1e-5);
      hits += expected.hit();
    }
  }
  EXPECT_GT(hits, 8000);
  EXPECT_LT(ties, 16);
}

TEST(RayScene, NothingLeaksFromAClosedTube) {
  const Mesh mesh = ClosedTube(160, 160);
  const RayScene scene(mesh);
  int leaks = 0;
  for (const Ray& ray : RandomRays(100000, 18)) leaks += !scene.Occluded(ray.origin, ray.direction, 0, kFar);
  EXPECT_EQ(leaks, 0);

  // Along the seams: rays at points on edges.
  for (int i = 0; i < 20000; ++i) {
    const Vec3i& face = mesh.faces[RandomBits(19, i) % mesh.faces.size()];
    const double w = Between(0.01, 0.99, 20, i);
    const Vec3d target = (1 - w) * mesh.vertices[face[i % 3]] + w * mesh.vertices[face[(i + 1) % 3]];
    const Vec3f origin(0.1f, -0.2f, static_cast<float>(Between(-35, 35, 21, i)));
    leaks += !scene.Occluded(origin, scene.ToLocal(target) - origin, 0, kFar);
  }
  EXPECT_EQ(leaks, 0);

  // The count must be able to see a hole: twenty faces of 51,520 gone.
  Mesh holed = mesh;
  holed.faces.erase(holed.faces.begin() + 25000, holed.faces.begin() + 25020);
  const RayScene open(holed);
  for (const Ray& ray : RandomRays(100000, 18)) leaks += !open.Occluded(ray.origin, ray.direction, 0, kFar);
  EXPECT_GT(leaks, 5);
}

// In float, 1e5 mm away from the origin, neighbouring numbers are 0.008 mm apart; the anchor keeps all
// digits.
TEST(RayScene, FarFromTheOriginNothingIsLost) {
  const Mesh mesh = TriangleSoup(2000);
  const Vec3d offset(1e5, -2e5, 5e4);
  Mesh far = mesh;
  for (Vec3d& vertex : far.vertices) vertex += offset;
  const RayScene scene(mesh), far_scene(far);
  EXPECT_EQ(far_scene.anchor(), scene.anchor() + offset);
  EXPECT_EQ(far_scene.ToLocal(far.vertices[7]), scene.ToLocal(mesh.vertices[7]));
  int hits = 0;
  for (const Ray& ray : RandomRays(2000, 22)) {
    const RayHit near = scene.Intersect(ray.origin, ray.direction, 0, kFar);
    const RayHit hit = far_scene.Intersect(ray.origin, ray.direction, 0, kFar);
    EXPECT_EQ(near.face, hit.face);
    EXPECT_EQ(near.t, hit.t);
    if (!hit.hit()) continue;
    ++hits;
    const Vec3d origin = ray.origin.cast<double>(), direction = ray.direction.cast<double>();
    const double expected = IntersectPlane(mesh, hit.face, origin + scene.anchor(), direction).t;
    EXPECT_NEAR(far_scene.ExactDistance(hit.face, origin + far_scene.anchor(), direction), expected, 1e-8);
    EXPECT_NEAR(hit.t, expected, 1e-4);
  }
  EXPECT_GT(hits, 700);
}

TEST(RayScene, ExactDistanceIsThatOfThePlane) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 10}, {3, 0, 13}, {0, 4, 10}, {1, 1, 5}, {2, 2, 7}, {3, 3, 9}};
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  const RayScene scene(mesh);
  // z = 10 + x along (0.3, 0.2, 2)·t from (0.5, 0.5, 0): 2t = 10.5 + 0.3t.
  EXPECT_NEAR(scene.ExactDistance(0, {0.5, 0.5, 0}, {0.3, 0.2, 2}), 10.5 / 1.7, 1e-15 * 20);
  // A face without area (collinear corners) has no plane; what is given lies between its corners along the
  // ray.
  const double distance = scene.ExactDistance(1, {0, 0, 0}, {0, 0, 1});
  EXPECT_GE(distance, 5);
  EXPECT_LE(distance, 9);
}

TEST(RayScene, FacesWithoutAreaChangeNothing) {
  const Mesh mesh = ClosedTube(40, 30);
  Mesh with = mesh;
  for (int i = 0; i < 200; ++i) {
    const Vec3i face = mesh.faces[RandomBits(23, i) % mesh.faces.size()];
    with.faces.push_back({face[0], face[0], face[0]});
    with.faces.push_back({face[0], face[1], face[1]});
    with.vertices.push_back((mesh.vertices[face[0]] + mesh.vertices[face[1]]) / 2);
    with.faces.push_back({face[0], int(with.vertices.size()) - 1, face[1]});
  }
  const RayScene scene(mesh), with_scene(with);
  for (const Ray& ray : RandomRays(5000, 24)) {
    const RayHit expected = scene.Intersect(ray.origin, ray.direction, 0, kFar);
    const RayHit found = with_scene.Intersect(ray.origin, ray.direction, 0, kFar);
    ASSERT_TRUE(expected.hit());
    EXPECT_EQ(found.face, expected.face);
    EXPECT_EQ(found.t, expected.t);
  }
}

TEST(RayScene, ThreadCountChangesNoHit) {
  const Mesh mesh = ClosedTube(160, 160);
  SetThreadCount(1);
  const RayScene one(mesh);
  SetThreadCount(2);
  const RayScene two(mesh);
  SetThreadCount(0);
  std::vector<Ray> rays = RandomRays(20000, 25);
  // Half of them at vertices, where several faces tie.
  for (size_t i = 0; i < rays.size(); i += 2) {
    rays[i].direction = one.ToLocal(mesh.vertices[RandomBits(26, i) % mesh.vertices.size()]) - rays[i].origin;
  }
  for (const Ray& ray : rays) {
    const RayHit a = one.Intersect(ray.origin, ray.direction, 0, kFar);
    const RayHit b = two.Intersect(ray.origin, ray.direction, 0, kFar);
    ASSERT_EQ(a.face, b.face);
    ASSERT_EQ(a.t, b.t);
    ASSERT_EQ(a.u, b.u);
  }
}

TEST(RayScene, BothSidesOfAFaceAreHit) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  mesh.faces = {{0, 1, 2}};
  RayScene built(mesh);
  const RayScene scene = std::move(built);
  EXPECT_EQ(&scene.mesh(), &mesh);
  for (const float side : {-1.0f, 1.0f}) {
    const Vec3f origin = scene.ToLocal({1, 1, 3 * side});
    const RayHit hit = scene.Intersect(origin, {0, 0, -side}, 0, kFar);
    ASSERT_TRUE(hit.hit());
    EXPECT_FLOAT_EQ(hit.t, 3);
    EXPECT_FLOAT_EQ(hit.u, 0.25f);
    EXPECT_FLOAT_EQ(hit.v, 0.25f);
    EXPECT_FALSE(scene.Intersect(origin, {0, 0, side}, 0, kFar).hit());
    EXPECT_FALSE(scene.Occluded(origin, {0, 0, -side}, 0, 2.99f));
    EXPECT_FALSE(scene.Occluded(origin, {0, 0, -side}, 3.01f, kFar));
  }
}

TEST(RayScene, MeshWithoutFacesIsNeverHit) {
  const Mesh mesh;
  const RayScene scene(mesh);
  EXPECT_FALSE(scene.Intersect({0, 0, 0}, {0, 0, 1}, 0, kFar).hit());
  EXPECT_FALSE(scene.Occluded({0, 0, 0}, {0, 0, 1}, 0, kFar));
}

TEST(RayScene, FaceOfAMissingVertexIsNamed) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 1, 3}};
  try {
    const RayScene scene(mesh);
    FAIL() << "a face names vertex 3 of 3";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("face 1"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace lumen
