#include "sim/geometry/colon_mesh.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/geometry/refine.h"

namespace lumen {
namespace {

// Folds of this length at least, whatever their centreline: two of the coarsest mesh's edges across a fold's
// flank.
constexpr double kEdgesPerFold = 4;

// Corner indices of one ring of the capsule, all the way round: column `count` is column 0.
struct Ring {
  int first, count;
  int At(int column) const { return first + column % count; }
};

// A rounded end as half an octahedron, subdivided: ring m of n has 4m corners, the pole being ring 0.
// `outward` says which way the faces turn.
void AddCap(const std::vector<Ring>& rings, bool deep, Mesh* mesh) {
  const auto add = [&](int a, int b, int c) {
    mesh->faces.push_back(deep ? Vec3i(a, b, c) : Vec3i(a, c, b));
  };
  for (size_t m = 0; m + 1 < rings.size(); ++m) {
    const int size = static_cast<int>(m);
    for (int quadrant = 0; quadrant < 4; ++quadrant) {
      for (int i = 0; i <= size; ++i) {
        const int inner = quadrant * size + i, outer = quadrant * (size + 1) + i;
        const int inner_corner = size == 0 ? rings[0].first : rings[m].At(inner);
        add(inner_corner, rings[m + 1].At(outer), rings[m + 1].At(outer + 1));
        if (i < size) add(rings[m].At(inner), rings[m + 1].At(outer + 1), rings[m].At(inner + 1));
      }
    }
  }
}

// Triangles of the wall's capsule, about `spacing_mm` apart on the wall.
Mesh CapsuleMesh(const ColonWall& wall, double spacing_mm) {
  Mesh mesh;
  const double radius = std::max(wall.NearCapHeight(), wall.DeepCapHeight());
  const int quarter = std::max(2, static_cast<int>(std::ceil(kPi / 2 * radius / spacing_mm)));
  const int rows = std::max(1, static_cast<int>(std::ceil(wall.length_mm() / spacing_mm)));
  const auto add_ring = [&](int count, double scale, double s) {
    const Ring ring = {static_cast<int>(mesh.vertices.size()), count};
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * kPi * i / count;
      mesh.vertices.emplace_back(scale * std::cos(angle), scale * std::sin(angle), s);
    }
    return ring;
  };
  std::vector<Ring> near, tube, deep;
  for (int m = 0; m < quarter; ++m) {
    const double turn = kPi / 2 * m / quarter;
    const int count = std::max(1, 4 * m);
    near.push_back(add_ring(count, std::sin(turn), -wall.NearCapHeight() * std::cos(turn)));
    deep.push_back(add_ring(count, std::sin(turn), wall.length_mm() + wall.DeepCapHeight() * std::cos(turn)));
  }
  for (int row = 0; row <= rows; ++row)
    tube.push_back(add_ring(4 * quarter, 1, wall.length_mm() * row / rows));
  near.push_back(tube.front());
  deep.push_back(tube.back());
  AddCap(near, false, &mesh);
  AddCap(deep, true, &mesh);
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < 4 * quarter; ++i) {
      mesh.faces.emplace_back(tube[row].At(i), tube[row].At(i + 1), tube[row + 1].At(i + 1));
      mesh.faces.emplace_back(tube[row].At(i), tube[row + 1].At(i + 1), tube[row + 1].At(i));
    }
  }
  return mesh;
}

}  // namespace

Mesh ColonMesh(const ColonShape& shape, const ColonWall& wall, double tolerance_mm) {
  double spacing_mm = std::min(shape.fold_thickness_mm / kEdgesPerFold, wall.InnerRadius() / 4);
  for (const Polyp& polyp : shape.polyps) spacing_mm = std::min(spacing_mm, ColonWall::FootRadius(polyp) / 4);
  const ParametricSurface surface = {[&](const Vec3d& near) { return wall.OntoCapsule(near); },
                                     [&](const Vec3d& capsule) { return wall.At(capsule); }};
  return Refine(CapsuleMesh(wall, spacing_mm), surface, tolerance_mm);
}

}  // namespace lumen
