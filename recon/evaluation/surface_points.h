// Points spread evenly over a mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

struct SurfacePoint {
  Vec3d position = Vec3d::Zero();  // mm, world
  int face = 0;
};

// `count` points, each standing for the same area: the faces' areas are laid end to end, cut into `count`
// equal strata, and one point is drawn in each. The same seed gives the same points. The mesh must have an
// area.
std::vector<SurfacePoint> SpreadPoints(const Mesh& mesh, int count, uint64_t seed);

}  // namespace lumen
