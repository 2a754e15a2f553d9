#include "common/light.h"

namespace lumen {

Light EndomapperLight() {
  LightSource source;
  source.position = {-0.061, -1.135, -3.612};
  source.direction = Vec3d(0.011092, 0, 0.999938).normalized();
  source.spread = 2.767302;
  return {.sources = {source}, .calibrated = false};
}

}  // namespace lumen
