#include "sim/geometry/geometry.h"

#include "sim/geometry/colon.h"
#include "sim/geometry/mesh_source.h"

namespace lumen {

Geometry BuildGeometry(const ConfigTable& geometry, uint64_t seed) {
  if (geometry.Choice("kind", {"colon", "mesh"}) == "mesh") return LoadMeshSource(geometry);
  return BuildColon(geometry, seed);
}

}  // namespace lumen
