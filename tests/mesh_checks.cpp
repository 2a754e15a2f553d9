#include "tests/mesh_checks.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace lumen::test {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
namespace pmp = CGAL::Polygon_mesh_processing;

Kernel::Point_3 ToPoint(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

MeshFacts Examine(const Mesh& mesh) {
  MeshFacts facts;
  SurfaceMesh surface;
  for (const Vec3d& v : mesh.vertices) surface.add_vertex(ToPoint(v));
  using Vertex = SurfaceMesh::Vertex_index;
  for (const Vec3i& f : mesh.faces) {
    if (surface.add_face(Vertex(f[0]), Vertex(f[1]), Vertex(f[2])) == SurfaceMesh::null_face()) return facts;
  }
  facts.manifold = true;
  facts.closed = CGAL::is_closed(surface);
  facts.outward = facts.closed && pmp::is_outward_oriented(surface);
  std::vector<std::pair<SurfaceMesh::Face_index, SurfaceMesh::Face_index>> pairs;
  pmp::self_intersections(surface, std::back_inserter(pairs));
  facts.self_intersections = pairs.size();
  auto piece = surface.add_property_map<SurfaceMesh::Face_index, std::size_t>("f:piece").first;
  facts.pieces = pmp::connected_components(surface, piece);
  return facts;
}

::testing::AssertionResult BoundsOneVolume(const Mesh& mesh) {
  const MeshFacts facts = Examine(mesh);
  if (!facts.manifold) return ::testing::AssertionFailure() << "not a manifold";
  if (!facts.closed) return ::testing::AssertionFailure() << "not closed";
  if (!facts.outward) return ::testing::AssertionFailure() << "inside out";
  if (facts.pieces != 1) return ::testing::AssertionFailure() << facts.pieces << " pieces";
  if (facts.self_intersections > 0)
    return ::testing::AssertionFailure() << facts.self_intersections << " pairs of faces intersect";
  return ::testing::AssertionSuccess();
}

double Volume(const Mesh& mesh) {
  double sum = 0;
  for (const Vec3i& f : mesh.faces)
    sum += mesh.vertices[f[0]].dot(mesh.vertices[f[1]].cross(mesh.vertices[f[2]]));
  return sum / 6;
}

double DistanceByBruteForce(const Mesh& mesh, const Vec3d& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Vec3i& f : mesh.faces) {
    const Kernel::Triangle_3 triangle(ToPoint(mesh.vertices[f[0]]), ToPoint(mesh.vertices[f[1]]),
                                      ToPoint(mesh.vertices[f[2]]));
    nearest = std::min(nearest, CGAL::squared_distance(ToPoint(point), triangle));
  }
  return std::sqrt(nearest);
}

}  // namespace lumen::test
