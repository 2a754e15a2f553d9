// What the automatic gain sees: a small picture of each frame.
#pragma once

#include <cstdint>

#include "sim/scene.h"

namespace lumen {

// Meters every frame by itself, so that a frame's gain doesn't depend on which frames are rendered; with
// random numbers of its own.
class Meter {
 public:
  // The scene is referred to. valid: of its camera's pixels.
  Meter(const Scene& scene, const Image8& valid, uint64_t seed);

  // MeterBrightness of a frame. count: of the small picture.
  double Brightness(const PathScene& path_scene, int frame, PathCount* count) const;

 private:
  const Scene& scene_;
  CameraIntrinsics intrinsics_;
  Camera<double> camera_;
  Camera<float> fast_camera_;
  Image8 valid_;
  PathOptions path_;
  uint64_t seed_;
};

}  // namespace lumen
