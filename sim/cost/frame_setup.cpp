#include "sim/cost/frame_setup.h"

namespace lumen {

FrameSetup::FrameSetup(const Scene& scene, MovingWall* walls, int frame, uint64_t seed)
    : scene_(scene),
      frame_(frame),
      wall_(walls->At(frame)),
      at_moment_{&wall_->rays, &scene.surface, SurfaceSeed(seed), &wall_->vertex_normals},
      camera_(scene.calibration.camera),
      valid_(ValidPixels(scene.calibration)),
      photographer_(scene, valid_, seed) {
  if (walls->moves()) {
    at_moment_.rest = &scene.geometry.mesh;
    at_moment_.rest_anchor = Bounds(scene.geometry.mesh).center();
  }
  if (scene.sensor.shutter) {
    motion_.emplace(*scene.sensor.shutter, scene.world_from_camera, frame);
    wall_motion_ = walls->During(frame, scene.sensor.shutter->Duration());
  }
  during_exposure_ = at_moment_;
  if (wall_motion_) {
    during_exposure_.wall = &wall_motion_->rays;
    during_exposure_.vertex_normals = wall_motion_->vertex_normals.data();
  }
  if (scene.sensor.auto_gain) meter_.emplace(scene, valid_, seed);
}

View FrameSetup::ViewOfFrame() const {
  return {&camera_,
          &valid_,
          scene_.world_from_camera[frame_],
          &scene_.calibration.light,
          motion_ ? &*motion_ : nullptr,
          scene_.defocus ? &*scene_.defocus : nullptr};
}

ImageF FrameSetup::Trace(const PathOptions& options, uint64_t seed, PathCount* count) const {
  Film film;
  const PathCount counted = RenderFrame(during_exposure_, ViewOfFrame(), options, seed, frame_, false, &film);
  if (count != nullptr) *count = counted;
  return std::move(film.radiance);
}

Image8 FrameSetup::Take(uint64_t seed) const {
  double gain = scene_.sensor.gain;
  if (meter_) {
    PathCount count;
    const double brightness = meter_->Brightness(at_moment_, frame_, &count);
    gain = RunAutoGain(*scene_.sensor.auto_gain, scene_.calibration.response, {brightness}).front();
  }
  return photographer_.Photograph(frame_, gain, Trace(scene_.path, seed));
}

}  // namespace lumen
