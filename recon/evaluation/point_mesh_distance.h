// Distance from points to the closest triangle of a mesh, in double, through CGAL's AABB tree.
#pragma once

#include <memory>
#include <vector>

#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

struct ClosestPoint {
  Vec3d position = Vec3d::Zero();  // mm, on the mesh
  int face = -1;                   // one of those that hold it, where several do
  double distance_mm = 0;
};

// Const members may be called from any thread.
class PointMeshDistance {
 public:
  // Copies what it needs of the mesh. Faces without area are left out: their points lie on their neighbours,
  // too. Throws InputError where no face has an area.
  explicit PointMeshDistance(const Mesh& mesh);
  ~PointMeshDistance();
  PointMeshDistance(PointMeshDistance&&) noexcept;
  PointMeshDistance& operator=(PointMeshDistance&&) noexcept;

  ClosestPoint Closest(const Vec3d& point) const;
  double Distance(const Vec3d& point) const { return Closest(point).distance_mm; }

  // The distance, negative inside. A closed mesh tells inside from outside by counting crossings of a ray;
  // the other meshes by the side of the closest face that the point is on, its normal pointing out, which is
  // a guess near their borders and sharp edges.
  double SignedDistance(const Vec3d& point) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lumen
