// How near a place in the lumen is to the wall.
#pragma once

#include <vector>

#include "common/config.h"
#include "common/mesh.h"

namespace lumen {

// Exact distances, in double, to every triangle that can be the nearest: a scan, for the few thousand places
// of a trajectory. Const members may be called from any thread.
class Clearance {
 public:
  // The mesh is referred to: it must outlive this.
  explicit Clearance(const Mesh& mesh);

  struct Nearest {
    double distance_mm;
    Vec3d point;  // of the wall
  };
  Nearest At(const Vec3d& place) const;

  // Whether a closed mesh encloses the place: its winding number, by the solid angles of all triangles (van
  // Oosterom and Strackee, 1983), is not 0.
  bool Encloses(const Vec3d& place) const;

  // How far within the closed mesh each of a path's places is, mm; negative outside. Neighbours should lie
  // close together: then hardly any needs a look at all triangles.
  std::vector<double> WithinBy(const std::vector<Vec3d>& path) const;

 private:
  struct Ball {
    Vec3d centre;
    double radius_mm;
  };
  const Mesh& mesh_;
  std::vector<Ball> balls_;  // around each face
};

// The clearance_mm of a scene's [trajectory]: how near to the wall a camera may come; 3 mm by default.
double ClearanceKey(const ConfigTable& trajectory);

// The point of the triangle abc that is nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
Vec3d NearestPointOfTriangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c);

}  // namespace lumen
