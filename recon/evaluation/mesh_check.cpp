#include "recon/evaluation/mesh_check.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/helpers.h>
#include <CGAL/iterator.h>

#include <array>
#include <numeric>
#include <vector>

#include "common/error.h"

namespace lumen {
namespace {

namespace PMP = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using SoupFaces = std::vector<std::array<size_t, 3>>;

SoupFaces ToSoup(const Mesh& mesh) {
  SoupFaces faces;
  faces.reserve(mesh.faces.size());
  for (const Vec3i& face : mesh.faces) faces.push_back({size_t(face[0]), size_t(face[1]), size_t(face[2])});
  return faces;
}

// Nothing where the faces form no oriented manifold.
std::optional<SurfaceMesh> ToSurfaceMesh(const Mesh& mesh) {
  const SoupFaces faces = ToSoup(mesh);
  if (faces.empty() || !PMP::is_polygon_soup_a_polygon_mesh(faces)) return std::nullopt;
  std::vector<Kernel::Point_3> points;
  points.reserve(mesh.vertices.size());
  for (const Vec3d& v : mesh.vertices) points.emplace_back(v.x(), v.y(), v.z());
  SurfaceMesh result;
  PMP::polygon_soup_to_polygon_mesh(points, faces, result);
  return result;
}

// Number of sets of faces connected by shared vertices, by union-find over the vertices.
int CountComponents(const Mesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const Vec3i& face : mesh.faces) {
    for (int corner : face) {
      used[corner] = true;
      parent[root(corner)] = root(face[0]);
    }
  }
  int components = 0;
  for (size_t v = 0; v < parent.size(); ++v) components += used[v] && parent[v] == static_cast<int>(v);
  return components;
}

}  // namespace

MeshFigures CheckMesh(const Mesh& mesh) {
  MeshFigures figures;
  figures.faces = static_cast<int64_t>(mesh.faces.size());
  figures.components = CountComponents(mesh);
  if (const auto surface = ToSurfaceMesh(mesh)) {
    figures.watertight = CGAL::is_closed(*surface);
    size_t pairs = 0;
    PMP::self_intersections(*surface, CGAL::Counting_output_iterator(&pairs));
    figures.self_intersections = static_cast<int64_t>(pairs);
  }
  return figures;
}

bool IsManifoldAndClosed(const Mesh& mesh) {
  const auto surface = ToSurfaceMesh(mesh);
  return surface && CGAL::is_closed(*surface);
}

void RequireSurface(const Mesh& mesh, const std::string& name) {
  if (mesh.faces.empty()) throw InputError(name + " has no faces: there is nothing to measure");
  const int vertices = static_cast<int>(mesh.vertices.size());
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.vertices[v].allFinite()) continue;
    throw InputError(name + ": vertex " + std::to_string(v) +
                     " (counted from 0) is not finite: export it again");
  }
  double area_mm2 = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    if (mesh.faces[f].minCoeff() < 0 || mesh.faces[f].maxCoeff() >= vertices) {
      throw InputError(name + ": face " + std::to_string(f) +
                       " (counted from 0) names a vertex that doesn't exist: "
                       "the mesh has " +
                       std::to_string(vertices));
    }
    area_mm2 += FaceArea(mesh, static_cast<int>(f));
  }
  if (!(area_mm2 > 0)) throw InputError(name + " has no area: all its faces are points or lines");
}

}  // namespace lumen
