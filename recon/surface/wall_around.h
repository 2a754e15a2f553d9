// Which part of a surface is the lumen's wall.
#pragma once

#include <vector>

#include "common/mesh.h"

namespace lumen {

// The component of a closed mesh that most rays from the places inside meet first; where none is given or
// meets any, the one that encloses the largest volume: that can be a blob beyond the wall. Empty of an empty
// mesh.
Mesh WallAround(const std::vector<Vec3d>& inside, const Mesh& mesh);

}  // namespace lumen
