#include "sim/geometry.h"

#include "sim/colon.h"

namespace lumen {

Geometry BuildGeometry(const ConfigTable& geometry, uint64_t seed) {
  geometry.Choice("kind", {"colon"});
  return BuildColon(geometry, seed);
}

}  // namespace lumen
