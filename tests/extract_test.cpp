#include "recon/surface/extract.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace lumen {
namespace {

const Vec3d kOrigin(100, -50, 7);

FieldOptions SmallField() {
  FieldOptions options;
  options.grid.levels = 2;
  options.grid.log2_table_size = 8;
  options.initial.radius_mm = 10;
  options.initial.reach_mm = 20;
  return options;
}

// A field whose networks say nothing: its surface is the initial one, a capsule of radius 10 about a segment
// of 20 mm.
Mesh CapsuleMesh(double half_box_mm, double cell_mm) {
  const FieldOptions options = SmallField();
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Eigen::AlignedBox3d box(Vec3d::Constant(-half_box_mm),
                                Vec3d(half_box_mm, half_box_mm, half_box_mm + 20));
  const Field<float> field(options, initial, box);
  const std::vector<float> nothing(field.parameter_count(), 0.0f);
  return ExtractMesh(field, nothing.data(), kOrigin, {cell_mm});
}

double Volume(const Mesh& mesh) {
  double six = 0;
  for (const Vec3i& f : mesh.faces) {
    six += (mesh.vertices[f[0]] - kOrigin)
               .dot((mesh.vertices[f[1]] - kOrigin).cross(mesh.vertices[f[2]] - kOrigin));
  }
  return six / 6;
}

// Every directed edge once, and its opposite once: closed, manifold along edges, consistently oriented.
bool IsClosed(const Mesh& mesh) {
  std::map<std::pair<int, int>, int> edges;
  for (const Vec3i& f : mesh.faces)
    for (int k = 0; k < 3; ++k) ++edges[{f[k], f[(k + 1) % 3]}];
  for (const auto& [edge, count] : edges) {
    const auto opposite = edges.find({edge.second, edge.first});
    if (count != 1 || opposite == edges.end()) return false;
  }
  return true;
}

TEST(Extract, CapsuleIsClosedAndWhereItShouldBe) {
  const double cell = 0.9;
  const Mesh mesh = CapsuleMesh(14, cell);
  EXPECT_TRUE(IsClosed(mesh));
  for (const Vec3d& vertex : mesh.vertices) {
    const Vec3d local = vertex - kOrigin;
    const double along = std::clamp(local.z(), 0.0, 20.0);
    // A chord of an edge (at most √3 cells) bulges by edge²/(8·radius); a vertex may be moved by 1% of an
    // edge.
    const double bound = 3 * cell * cell / 80 + 0.01 * std::sqrt(3.0) * cell + 1e-4;
    EXPECT_NEAR((local - Vec3d(0, 0, along)).norm(), 10, bound);
  }
  // 4/3 π r³ + π r² h; the mesh lies within its own bound of the surface (area 2πrh + 4πr² = 2513 mm²).
  const double volume = 4.0 / 3 * kPi * 1000 + kPi * 100 * 20;
  EXPECT_NEAR(Volume(mesh), volume, 2513 * (3 * cell * cell / 80));
  EXPECT_GT(Volume(mesh), 0);  // outward: away from the lumen
}

TEST(Extract, BoundsCloseASurfaceThatReachesThem) {
  const Mesh mesh = CapsuleMesh(7, 0.5);  // the capsule sticks out of the box on all sides but two
  EXPECT_TRUE(IsClosed(mesh));
  EXPECT_LT(Bounds(mesh).sizes().maxCoeff(), 7 + 27 + 1e-3);
  EXPECT_FALSE(IsClosed([&] {
    Mesh open = mesh;
    open.faces.pop_back();
    return open;
  }()));
}

}  // namespace
}  // namespace lumen
