#include "recon/evaluation/point_mesh_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"
#include "common/random.h"
#include "recon/evaluation/nearest_point.h"
#include "tests/evaluation_scenes.h"

namespace lumen {
namespace {

using LongVec = Eigen::Matrix<long double, 3, 1>;

Vec3d RandomVector(uint64_t seed, uint64_t index, double size) {
  Vec3d v;
  for (int axis = 0; axis < 3; ++axis)
    v[axis] = size * (2 * UniformDouble(RandomBits(seed, index, axis)) - 1);
  return v;
}

long double ToSegment(const LongVec& p, const LongVec& a, const LongVec& b) {
  const LongVec ab = b - a;
  const long double t = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0L, 1.0L);
  return (p - a - t * ab).norm();
}

// The distance by another way than CGAL's: over the plane where the foot has no negative barycentric
// coordinate, else the least of those to the three edges. region: 0 = face, 1 = edge, 2 = vertex.
long double ToTriangle(const Vec3d& point, const Mesh& mesh, const Vec3i& face, int* region = nullptr) {
  const LongVec p = point.cast<long double>(), a = mesh.vertices[face[0]].cast<long double>(),
                b = mesh.vertices[face[1]].cast<long double>(),
                c = mesh.vertices[face[2]].cast<long double>();
  const LongVec normal = (b - a).cross(c - a);
  const long double u = (c - b).cross(p - b).dot(normal), v = (a - c).cross(p - c).dot(normal),
                    w = (b - a).cross(p - a).dot(normal);
  if (u >= 0 && v >= 0 && w >= 0) {
    if (region) *region = 0;
    return std::abs((p - a).dot(normal)) / normal.norm();
  }
  const long double edges = std::min({ToSegment(p, a, b), ToSegment(p, b, c), ToSegment(p, c, a)});
  const long double corners = std::min({(p - a).norm(), (p - b).norm(), (p - c).norm()});
  if (region) *region = corners <= edges ? 2 : 1;
  return edges;
}

Mesh RandomTriangles(int count, double size) {
  Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3d centre = RandomVector(1, i, 50);
    for (int corner = 0; corner < 3; ++corner) {
      mesh.vertices.push_back(centre + RandomVector(2 + corner, i, size));
    }
    mesh.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

TEST(PointMeshDistance, MatchesBruteForce) {
  const Mesh mesh = RandomTriangles(200, 10);
  const PointMeshDistance distance(mesh);
  int regions[3] = {};
  for (int i = 0; i < 2000; ++i) {
    const Vec3d point = RandomVector(9, i, 60);
    long double expected = std::numeric_limits<long double>::infinity();
    int closest_region = 0;
    for (const Vec3i& face : mesh.faces) {
      int region;
      const long double d = ToTriangle(point, mesh, face, &region);
      if (d < expected) {
        expected = d;
        closest_region = region;
      }
    }
    ++regions[closest_region];
    const ClosestPoint closest = distance.Closest(point);
    ASSERT_NEAR(closest.distance_mm, static_cast<double>(expected), 1e-10) << "point " << i;
    EXPECT_NEAR(static_cast<double>(ToTriangle(point, mesh, mesh.faces[closest.face])), closest.distance_mm,
                1e-10);
    EXPECT_NEAR((closest.position - point).norm(), closest.distance_mm, 1e-12);
  }
  for (int region : regions) EXPECT_GT(region, 100);  // faces, edges and vertices have all been the closest
}

// Marching tetrahedra leave triangles as narrow as this.
TEST(PointMeshDistance, MatchesBruteForceOnSlivers) {
  for (double width : {1e-3, 1e-6, 1e-9}) {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0.4, width, 0.1}};
    mesh.faces = {{0, 1, 2}};
    const PointMeshDistance distance(mesh);
    for (int i = 0; i < 300; ++i) {
      const Vec3d point = RandomVector(5, i, 2);
      EXPECT_NEAR(distance.Distance(point), static_cast<double>(ToTriangle(point, mesh, mesh.faces[0])), 1e-9)
          << "width " << width << ", point " << i;
    }
  }
}

TEST(PointMeshDistance, KnowsTheRegionsOfATriangle) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {3, 0, 0}, {0, 4, 0}};
  mesh.faces = {{0, 1, 2}};
  const PointMeshDistance distance(mesh);
  EXPECT_DOUBLE_EQ(distance.Distance({1, 1, 2}), 2);          // face
  EXPECT_DOUBLE_EQ(distance.Distance({1, -3, 4}), 5);         // edge
  EXPECT_DOUBLE_EQ(distance.Distance({3, 4, 0}), 12.0 / 5);   // hypotenuse
  EXPECT_DOUBLE_EQ(distance.Distance({-2, -3, 6}), 7);        // vertex
  EXPECT_DOUBLE_EQ(distance.Distance({3 + 2, -10, 11}), 15);  // vertex of an acute angle
  EXPECT_DOUBLE_EQ(distance.Distance({0.5, 0.5, 0}), 0);
}

TEST(PointMeshDistance, SignsByTheVolumeOfAClosedMesh) {
  const PointMeshDistance cube(test::Cube(10, 4));
  EXPECT_DOUBLE_EQ(cube.SignedDistance({0, 0, 0}), -10);
  EXPECT_DOUBLE_EQ(cube.SignedDistance({9, 2, 3}), -1);
  EXPECT_DOUBLE_EQ(cube.SignedDistance({9, 9, -9.5}), -0.5);
  EXPECT_DOUBLE_EQ(cube.SignedDistance({12, 2, 3}), 2);
  EXPECT_DOUBLE_EQ(cube.SignedDistance({13, 14, 3}), 5);
}

TEST(PointMeshDistance, SignsByTheSideOfAnOpenMesh) {
  Mesh plate;
  test::AddPlate({0, 0, 0}, {10, 0, 0}, {0, 10, 0}, 5, &plate);
  const PointMeshDistance distance(plate);
  EXPECT_DOUBLE_EQ(distance.SignedDistance({5, 5, 3}), 3);
  EXPECT_DOUBLE_EQ(distance.SignedDistance({5, 5, -3}), -3);
}

TEST(PointMeshDistance, LeavesOutFacesWithoutArea) {
  Mesh mesh = test::Cube(10, 2);
  const PointMeshDistance whole(mesh);
  mesh.faces.push_back({0, 0, 1});
  mesh.faces.push_back({3, 3, 3});
  const PointMeshDistance with_lines(mesh);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(with_lines.Distance(RandomVector(3, i, 30)), whole.Distance(RandomVector(3, i, 30)));
  }
  mesh.faces = {{0, 0, 1}, {3, 3, 3}};
  EXPECT_THROW(PointMeshDistance{mesh}, InputError);
}

TEST(NearestPoint, MatchesBruteForce) {
  std::vector<Vec3d> points;
  for (int i = 0; i < 500; ++i) points.push_back(RandomVector(4, i, 20));
  const NearestPoint nearest(points);
  for (int i = 0; i < 500; ++i) {
    const Vec3d query = RandomVector(6, i, 40);
    double expected = std::numeric_limits<double>::infinity();
    for (const Vec3d& point : points) expected = std::min(expected, (point - query).norm());
    EXPECT_NEAR(nearest.Distance(query), expected, 1e-12);
  }
  EXPECT_EQ(NearestPoint({}).Distance({0, 0, 0}), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace lumen
