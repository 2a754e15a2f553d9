// A million rays against CGAL's exact predicates, through a real colon, a procedural one and a soup.
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/config.h"
#include "common/parallel.h"
#include "common/random.h"
#include "common/ray_scene.h"
#include "sim/geometry/geometry.h"
#include "tests/random_rays.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::Between;
using test::RandomDirection;
using test::SharedData;
using test::TriangleSoup;

constexpr float kFar = 1e4f;  // mm
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// In double; its numbers are exactly those of the float ray.
struct Ray {
  Vec3f local_origin, direction;
  Vec3d origin, direction_mm;
};

Ray RandomRay(const RayScene& scene, uint64_t seed, int64_t i) {
  // From 0.05 to 8 mm inward of a random face, every way.
  const Mesh& mesh = scene.mesh();
  const int face = static_cast<int>(RandomBits(seed, i) % mesh.faces.size());
  const Vec3i& corners = mesh.faces[face];
  const Vec3d centroid =
      (mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3;
  const double inward_mm = 0.05 * std::pow(160, Between(0, 1, seed, i, 1));
  Ray ray;
  ray.local_origin = scene.ToLocal(centroid - inward_mm * FaceNormal(mesh, face));
  ray.direction = RandomDirection(seed, i, 2);
  ray.origin = ray.local_origin.cast<double>() + scene.anchor();
  ray.direction_mm = ray.direction.cast<double>();
  return ray;
}

// Distance to a face's plane (Möller and Trumbore 1997), units of the direction's length.
double PlaneDistance(const Mesh& mesh, size_t face, const Ray& ray) {
  const Vec3i& corners = mesh.faces[face];
  const Vec3d e1 = mesh.vertices[corners[1]] - mesh.vertices[corners[0]];
  const Vec3d e2 = mesh.vertices[corners[2]] - mesh.vertices[corners[0]];
  const Vec3d s = ray.origin - mesh.vertices[corners[0]];
  return e2.dot(s.cross(e1)) / e1.dot(ray.direction_mm.cross(e2));
}

// How far the ray's line passes from the nearest of a face's edges, mm.
double EdgeDistance(const Mesh& mesh, size_t face, const Ray& ray) {
  double nearest = kInfinity;
  const Vec3d along = ray.direction_mm.normalized();
  for (int i = 0; i < 3; ++i) {
    // Across the ray: the segment's projection, and the origin's distance to it.
    const auto project = [&](const Vec3d& p) {
      return Vec3d(p - ray.origin - (p - ray.origin).dot(along) * along);
    };
    const Vec3d a = project(mesh.vertices[mesh.faces[face][i]]);
    const Vec3d b = project(mesh.vertices[mesh.faces[face][(i + 1) % 3]]);
    const double where = std::clamp(-a.dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
    nearest = std::min(nearest, (a + where * (b - a)).norm());
  }
  return nearest;
}

// Whether two faces are the same triangle; the real colon has one twice.
bool AreDoubles(const Mesh& mesh, uint32_t a, uint32_t b) {
  if (a == kNoFace || b == kNoFace) return false;
  return std::is_permutation(mesh.faces[a].begin(), mesh.faces[a].end(), mesh.faces[b].begin());
}

struct Nearest {
  uint32_t face = kNoFace;
  double t = kInfinity;
};

// Which triangles a ray meets is decided by exact predicates; how far they are, in double.
class ExactScene {
 public:
  explicit ExactScene(const Mesh& mesh) : mesh_(mesh) {
    const auto point = [&](int i) { return ToPoint(mesh.vertices[i]); };
    for (const Vec3i& f : mesh.faces) triangles_.emplace_back(point(f[0]), point(f[1]), point(f[2]));
    tree_.rebuild(triangles_.begin(), triangles_.end());
  }

  // Looks as far as `probably`, mm, where something is expected to be met; farther only if nothing is.
  Nearest Intersect(const Ray& ray, double probably) const {
    std::vector<Triangles::const_iterator> met;
    const Vec3d end = ray.origin + probably * ray.direction_mm;
    tree_.all_intersected_primitives(Kernel::Segment_3(ToPoint(ray.origin), ToPoint(end)),
                                     std::back_inserter(met));
    if (met.empty()) {
      const Kernel::Ray_3 whole(ToPoint(ray.origin), ToPoint(ray.origin + ray.direction_mm));
      tree_.all_intersected_primitives(whole, std::back_inserter(met));
    }
    Nearest nearest;
    for (const auto& triangle : met) {
      const size_t face = triangle - triangles_.begin();
      const double t = PlaneDistance(mesh_, face, ray);
      if (t < nearest.t) nearest = {static_cast<uint32_t>(face), t};
    }
    return nearest;
  }

 private:
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Triangles = std::vector<Kernel::Triangle_3>;
  using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
  static Kernel::Point_3 ToPoint(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }
  const Mesh& mesh_;
  Triangles triangles_;
  CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree_;
};

struct Comparison {
  int64_t agree = 0;
  int64_t ties = 0;  // another face in the same place, or one of the two met within rounding of its edge
  int64_t contradict = 0;  // another face, well inside both
  double worst_mm = 0;     // of the truth's distance, where both name the same face
  double worst_float = 0;  // of the ray's own distance, times the cosine: in units of the rounding

  void Add(const Comparison& other) {
    agree += other.agree;
    ties += other.ties;
    contradict += other.contradict;
    worst_mm = std::max(worst_mm, other.worst_mm);
    worst_float = std::max(worst_float, other.worst_float);
  }
};

// How far a float ray can pass beside its double original, mm: sim/ground_truth.cpp derives it.
double Rounding_mm(const Mesh& mesh) { return 0x1p-20 * Bounds(mesh).diagonal().norm(); }

void CompareRay(const RayScene& scene, const ExactScene& exact, double rounding_mm, const Ray& ray,
                Comparison* result) {
  const Mesh& mesh = scene.mesh();
  const RayHit hit = scene.Intersect(ray.local_origin, ray.direction, 0, kFar);
  const Nearest expected = exact.Intersect(ray, hit.hit() ? hit.t + 0.1 : kFar);
  if (hit.face != expected.face) {
    bool tie = AreDoubles(mesh, hit.face, expected.face);
    for (const uint32_t face : {hit.face, expected.face}) {
      tie |= face != kNoFace && EdgeDistance(mesh, face, ray) < rounding_mm;
    }
    ++(tie ? result->ties : result->contradict);
    return;
  }
  ++result->agree;
  if (!hit.hit()) return;
  const double truth = scene.ExactDistance(hit.face, ray.origin, ray.direction_mm);
  const double cosine = std::abs(FaceNormal(mesh, int(hit.face)).dot(ray.direction_mm));
  result->worst_mm = std::max(result->worst_mm, std::abs(truth - expected.t));
  result->worst_float = std::max(result->worst_float, std::abs(hit.t - expected.t) * cosine / rounding_mm);
}

Comparison Compare(const RayScene& scene, const Mesh& reference, int64_t rays, uint64_t seed) {
  const ExactScene exact(reference);
  const double rounding_mm = Rounding_mm(scene.mesh());
  constexpr int64_t kChunk = 1000;
  std::vector<Comparison> chunks((rays + kChunk - 1) / kChunk);
  ParallelChunks(0, rays, kChunk, [&](int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i) {
      CompareRay(scene, exact, rounding_mm, RandomRay(scene, seed, i), &chunks[first / kChunk]);
    }
  });
  Comparison whole;
  for (const Comparison& chunk : chunks) whole.Add(chunk);
  return whole;
}

void ExpectSame(const Mesh& mesh, int64_t rays, uint64_t seed) {
  const RayScene scene(mesh);
  const Comparison found = Compare(scene, mesh, rays, seed);
  EXPECT_EQ(found.contradict, 0);
  EXPECT_LE(found.ties, rays / 1000);
  EXPECT_EQ(found.agree + found.ties, rays);
  EXPECT_LT(found.worst_mm, 1e-4);
  EXPECT_LT(found.worst_float, 1);
  testing::Test::RecordProperty("ties", static_cast<int>(found.ties));
}

Mesh ProceduralColon() {
  const Config config =
      Config::Parse("kind = \"colon\"\nfold_thickness_mm = 3\ntolerance_mm = 0.02\n", "colon.toml");
  return BuildGeometry(config.root(), 5).mesh;
}

TEST(ExactKernel, RealColon) {
  const char* file = "colon_ct/EdinGCA00020_large_intestine_merged.obj";
  LUMEN_NEEDS_DATA(file);
  ExpectSame(ReadMesh(SharedData(file)), 500000, 31);
}

TEST(ExactKernel, ProceduralColon) { ExpectSame(ProceduralColon(), 400000, 32); }

TEST(ExactKernel, TriangleSoup) { ExpectSame(TriangleSoup(20000, 3), 100000, 33); }

// A mesh whose vertices lie elsewhere by a hundredth of a mm must not pass for the same.
TEST(ExactKernel, TellsAMovedMesh) {
  const Mesh mesh = TriangleSoup(2000, 3);
  Mesh moved = mesh;
  for (Vec3d& vertex : moved.vertices) vertex.x() += 1e-2;
  const RayScene scene(mesh);
  const Comparison found = Compare(scene, moved, 20000, 34);
  EXPECT_GT(found.worst_mm, 1e-3);
  EXPECT_GT(found.contradict, 10);
}

}  // namespace
}  // namespace lumen
