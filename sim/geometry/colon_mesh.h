// Triangles of a colon's wall.
#pragma once

#include "common/mesh.h"
#include "sim/geometry/colon_wall.h"

namespace lumen {

// Closed, oriented, its normals away from the lumen; nowhere farther than tolerance_mm from the smooth wall,
// as Refine judges it. shape: the wall's.
Mesh ColonMesh(const ColonShape& shape, const ColonWall& wall, double tolerance_mm);

}  // namespace lumen
