#include "recon/surface/wall_around.h"

#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "common/ray_scene.h"

namespace lumen {
namespace {

// A vertex of each component stands for it: the component of every vertex.
std::vector<int> Components(const Mesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Vec3i& face : mesh.faces) {
    for (int k = 1; k < 3; ++k) parent[root(face[k])] = root(face[0]);
  }
  for (size_t v = 0; v < parent.size(); ++v) parent[v] = root(static_cast<int>(v));
  return parent;
}

// −1: there is none.
int LargestComponent(const Mesh& mesh, const std::vector<int>& component) {
  std::map<int, double> volume;  // six times it, signed
  for (const Vec3i& f : mesh.faces) {
    volume[component[f[0]]] += mesh.vertices[f[0]].dot(mesh.vertices[f[1]].cross(mesh.vertices[f[2]]));
  }
  int best = -1;
  for (const auto& [which, size] : volume)
    if (best < 0 || std::abs(size) > std::abs(volume[best])) best = which;
  return best;
}

// By rays along the axes and the diagonals between them; only those count that leave by what they meet. −1:
// none does.
int ComponentAround(const std::vector<Vec3d>& inside, const Mesh& mesh, const std::vector<int>& component) {
  if (mesh.faces.empty() || inside.empty()) return -1;
  const RayScene scene(mesh);
  std::map<int, int> rays;
  for (const Vec3d& place : inside) {
    for (int i = 0; i < 27; ++i) {
      const Vec3f direction(float(i % 3 - 1), float(i / 3 % 3 - 1), float(i / 9 - 1));
      if (direction.norm() == 0) continue;
      const RayHit hit =
          scene.Intersect(scene.ToLocal(place), direction, 0, std::numeric_limits<float>::infinity());
      if (!hit.hit()) continue;
      const Vec3i& f = mesh.faces[hit.face];
      const Vec3d outward =
          (mesh.vertices[f[1]] - mesh.vertices[f[0]]).cross(mesh.vertices[f[2]] - mesh.vertices[f[0]]);
      if (outward.dot(direction.cast<double>()) > 0) ++rays[component[f[0]]];
    }
  }
  int best = -1;
  for (const auto& [which, count] : rays)
    if (best < 0 || count > rays[best]) best = which;
  return best;
}

Mesh ComponentAlone(const Mesh& mesh, const std::vector<int>& component, int which) {
  Mesh result;
  std::vector<int> index(mesh.vertices.size(), -1);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (component[v] != which) continue;
    index[v] = static_cast<int>(result.vertices.size());
    result.vertices.push_back(mesh.vertices[v]);
  }
  for (const Vec3i& f : mesh.faces) {
    if (component[f[0]] == which) result.faces.emplace_back(index[f[0]], index[f[1]], index[f[2]]);
  }
  return result;
}

}  // namespace

Mesh WallAround(const std::vector<Vec3d>& inside, const Mesh& mesh) {
  const std::vector<int> component = Components(mesh);
  int wall = ComponentAround(inside, mesh, component);
  if (wall < 0) wall = LargestComponent(mesh, component);
  return ComponentAlone(mesh, component, wall);
}

}  // namespace lumen
