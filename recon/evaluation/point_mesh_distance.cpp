#include "recon/evaluation/point_mesh_distance.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>

#include <cmath>
#include <optional>

#include "common/error.h"
#include "recon/evaluation/mesh_check.h"

namespace lumen {
namespace {

// Distances are rounded numbers whatever the kernel; exact predicates would only slow them.
using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
using ClosedMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Side = CGAL::Side_of_triangle_mesh<ClosedMesh, Kernel>;

Kernel::Point_3 ToCgal(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

ClosedMesh ToClosedMesh(const Mesh& mesh) {
  std::vector<Kernel::Point_3> points;
  points.reserve(mesh.vertices.size());
  for (const Vec3d& vertex : mesh.vertices) points.push_back(ToCgal(vertex));
  std::vector<std::array<size_t, 3>> faces;
  faces.reserve(mesh.faces.size());
  for (const Vec3i& face : mesh.faces) faces.push_back({size_t(face[0]), size_t(face[1]), size_t(face[2])});
  ClosedMesh closed;
  CGAL::Polygon_mesh_processing::polygon_soup_to_polygon_mesh(points, faces, closed);
  return closed;
}

}  // namespace

struct PointMeshDistance::State {
  Triangles triangles;
  std::vector<int> face_of_triangle;
  std::vector<Vec3d> normals;  // one a triangle
  Tree tree;
  ClosedMesh closed_mesh;
  std::optional<Side> side;  // of a closed mesh
};

PointMeshDistance::PointMeshDistance(const Mesh& mesh) : state_(std::make_unique<State>()) {
  State& state = *state_;
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    const int face = static_cast<int>(i);
    const Vec3d normal = FaceNormal(mesh, face);
    if (normal.isZero(0)) continue;
    const Vec3i& corners = mesh.faces[i];
    state.triangles.emplace_back(ToCgal(mesh.vertices[corners[0]]), ToCgal(mesh.vertices[corners[1]]),
                                 ToCgal(mesh.vertices[corners[2]]));
    state.face_of_triangle.push_back(face);
    state.normals.push_back(normal);
  }
  if (state.triangles.empty())
    throw InputError("the mesh has no face with an area: no distance to it exists");
  state.tree.rebuild(state.triangles.cbegin(), state.triangles.cend());
  state.tree.accelerate_distance_queries();
  if (IsManifoldAndClosed(mesh)) {
    state.closed_mesh = ToClosedMesh(mesh);
    state.side.emplace(state.closed_mesh);
    (*state.side)(ToCgal(mesh.vertices[mesh.faces[0][0]]));  // builds its tree before threads ask for it
  }
}

PointMeshDistance::~PointMeshDistance() = default;
PointMeshDistance::PointMeshDistance(PointMeshDistance&&) noexcept = default;
PointMeshDistance& PointMeshDistance::operator=(PointMeshDistance&&) noexcept = default;

ClosestPoint PointMeshDistance::Closest(const Vec3d& point) const {
  const auto [closest, triangle] = state_->tree.closest_point_and_primitive(ToCgal(point));
  ClosestPoint result;
  result.position = Vec3d(closest.x(), closest.y(), closest.z());
  result.face = state_->face_of_triangle[triangle - state_->triangles.cbegin()];
  result.distance_mm = (result.position - point).norm();
  return result;
}

double PointMeshDistance::SignedDistance(const Vec3d& point) const {
  const auto [closest, triangle] = state_->tree.closest_point_and_primitive(ToCgal(point));
  const Vec3d away = point - Vec3d(closest.x(), closest.y(), closest.z());
  const bool inside = state_->side ? (*state_->side)(ToCgal(point)) == CGAL::ON_BOUNDED_SIDE
                                   : away.dot(state_->normals[triangle - state_->triangles.cbegin()]) < 0;
  return inside ? -away.norm() : away.norm();
}

}  // namespace lumen
