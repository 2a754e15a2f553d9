// The endoscope at a moment, in the wall's local coordinates: where the camera is, and its light guides. What
// is asked of the wall with it is asked of the same moment.
#pragma once

#include <vector>

#include "common/light.h"
#include "common/math.h"
#include "common/ray_scene.h"

namespace lumen {

struct Guide {
  Vec3f position, direction;
  float spread;
  Vec3f intensity;
  bool at_camera;  // what the camera sees, it lights: no shadow at the first vertex
};

struct Eye {
  // pinhole: all of the camera's rays start at its centre. time: of a wall that moves.
  Eye(const RayScene& wall, const Light& light, const Pose& world_from_camera, bool pinhole, float time = 0)
      : time(time),
        origin(wall.ToLocal(world_from_camera.translation())),
        rotation(world_from_camera.linear().cast<float>()) {
    for (const LightSource& source : light.sources) {
      guides.push_back({wall.ToLocal(world_from_camera * source.position),
                        (world_from_camera.linear() * source.direction).cast<float>(),
                        static_cast<float>(source.spread), source.intensity.cast<float>(),
                        pinhole && source.position.isZero(0)});
    }
  }

  float time;
  Vec3f origin;
  Mat3<float> rotation;
  std::vector<Guide> guides;
};

}  // namespace lumen
