#include "sim/geometry/geometry.h"

#include <string>

#include "sim/geometry/around_path.h"
#include "sim/geometry/colon.h"
#include "sim/geometry/mesh_source.h"

namespace lumen {

Geometry BuildGeometry(const ConfigTable& geometry, uint64_t seed, const std::vector<Pose>& given) {
  const std::string kind = geometry.Choice("kind", {"colon", "around_path", "mesh"});
  if (kind == "mesh") return LoadMeshSource(geometry);
  if (kind == "around_path") return BuildAroundPath(geometry, given, seed);
  return BuildColon(geometry, seed);
}

}  // namespace lumen
