// One frame of a scene, ready to be taken again and again.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sim/photographer.h"
#include "sim/scene.h"

namespace lumen {

class FrameSetup {
 public:
  // Scene, wall and normals (VertexNormals of the wall; empty for a scene without a coat) are referred to.
  FrameSetup(const Scene& scene, const RayScene& wall, const std::vector<Vec3d>& normals, int frame,
             uint64_t seed);
  FrameSetup(const FrameSetup&) = delete;
  FrameSetup& operator=(const FrameSetup&) = delete;

  const Image8& valid() const { return valid_; }

  // The path tracer alone: linear radiance.
  ImageF Trace(const PathOptions& options, uint64_t seed, PathCount* count = nullptr) const;
  // The scene's own path, lens and sensor.
  Image8 Take(uint64_t seed) const;

 private:
  const Scene& scene_;
  int frame_;
  PathScene path_scene_;
  Camera<float> camera_;
  Image8 valid_;
  Photographer photographer_;
  std::optional<CameraMotion> motion_;
};

}  // namespace lumen
