#include "sim/cost/frame_setup.h"

namespace lumen {

FrameSetup::FrameSetup(const Scene& scene, const WallMoment& wall, int frame, uint64_t seed)
    : scene_(scene),
      frame_(frame),
      path_scene_{&wall.rays, &scene.surface, SurfaceSeed(seed), &wall.vertex_normals},
      camera_(scene.calibration.camera),
      valid_(ValidPixels(scene.calibration)),
      photographer_(scene, valid_, seed) {
  if (wall.moved) {
    path_scene_.rest = &scene.geometry.mesh;
    path_scene_.rest_anchor = Bounds(scene.geometry.mesh).center();
  }
  if (scene.sensor.shutter) motion_.emplace(*scene.sensor.shutter, scene.world_from_camera, frame);
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
  const PathCount counted = RenderFrame(path_scene_, ViewOfFrame(), options, seed, frame_, false, &film);
  if (count != nullptr) *count = counted;
  return std::move(film.radiance);
}

Image8 FrameSetup::Take(uint64_t seed) const {
  double gain = scene_.sensor.gain;
  if (meter_) {
    PathCount count;
    const double brightness = meter_->Brightness(path_scene_, frame_, &count);
    gain = RunAutoGain(*scene_.sensor.auto_gain, scene_.calibration.response, {brightness}).front();
  }
  return photographer_.Photograph(frame_, gain, Trace(scene_.path, seed));
}

}  // namespace lumen
