// The wall that a scene shows: a procedural colon, one around a camera path, or a mesh file.
#pragma once

#include <cstdint>
#include <vector>

#include "common/config.h"
#include "common/mesh.h"

namespace lumen {

struct Geometry {
  Mesh mesh;  // closed, oriented, mm; normals point into the wall, away from the lumen
  std::vector<Vec3d>
      centreline;  // mm, about a point a mm, from the end that withdrawal leads to, to the deep end
};

// Builds what the scene's [geometry] names: kind = "colon" (sim/geometry/colon.h), "around_path"
// (sim/geometry/around_path.h; given: that path) or "mesh" (sim/geometry/mesh_source.h). Throws InputError
// with the reason where a mesh can't be used.
Geometry BuildGeometry(const ConfigTable& geometry, uint64_t seed, const std::vector<Pose>& given = {});

}  // namespace lumen
