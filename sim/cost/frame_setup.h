// One frame of a scene, ready to be taken again and again.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "sim/geometry/moving_wall.h"
#include "sim/imaging/reference_path.h"
#include "sim/metering.h"
#include "sim/photographer.h"
#include "sim/scene.h"

namespace lumen {

class FrameSetup {
 public:
  // The scene is referred to, and the geometry of the walls, which have vertex normals if the scene has a
  // coat.
  FrameSetup(const Scene& scene, MovingWall* walls, int frame, uint64_t seed);
  FrameSetup(const FrameSetup&) = delete;
  FrameSetup& operator=(const FrameSetup&) = delete;

  const Image8& valid() const { return valid_; }
  const RayScene& wall() const { return wall_->rays; }  // at the frame's moment

  // The path tracer alone: linear radiance.
  ImageF Trace(const PathOptions& options, uint64_t seed, PathCount* count = nullptr) const;
  // The plain path tracer, in float or double.
  template <class T>
  ImageF TracePlainly(const PathOptions& options, uint64_t seed) const {
    return RenderReference<T>(at_moment_, ViewOfFrame(), options, seed, frame_);
  }
  // The scene's own path, lens and sensor, with the automatic gain's metering.
  Image8 Take(uint64_t seed) const;

 private:
  View ViewOfFrame() const;

  const Scene& scene_;
  int frame_;
  std::shared_ptr<const WallMoment> wall_;
  std::unique_ptr<const WallMotion> wall_motion_;
  PathScene at_moment_, during_exposure_;
  Camera<float> camera_;
  Image8 valid_;
  Photographer photographer_;
  std::optional<CameraMotion> motion_;
  std::optional<Meter> meter_;
};

}  // namespace lumen
