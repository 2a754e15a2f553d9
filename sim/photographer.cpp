#include "sim/photographer.h"

#include "common/jpeg.h"

namespace lumen {

Photographer::Photographer(const Scene& scene, const Image8& valid, uint64_t seed)
    : scene_(scene),
      valid_(valid),
      seed_(seed),
      vignetting_(VignettingMap(scene.calibration.response, Camera<double>(scene.calibration.camera))) {}

Image8 Photographer::Photograph(int frame, double gain, const ImageF& radiance) const {
  ImageF dispersed;
  if (scene_.chromatic_aberration) {
    dispersed = Disperse(*scene_.chromatic_aberration, scene_.calibration.camera, radiance, valid_);
  }
  Image8 picture = Expose(frame, gain, scene_.chromatic_aberration ? dispersed : radiance);
  if (scene_.sensor.jpeg) picture = ThroughJpeg(picture, scene_.sensor.jpeg->quality);
  return picture;
}

Image8 Photographer::Expose(int frame, double gain, const ImageF& radiance) const {
  const Response& response = scene_.calibration.response;
  if (!scene_.sensor.noise) return Develop(response, gain, radiance, vignetting_, valid_);
  const ImageF signal = NoisySignal(*scene_.sensor.noise, radiance, vignetting_, valid_, seed_, frame);
  const ImageF no_more_vignetting(signal.width, signal.height, 1, 1.0f);
  return Develop(response, gain, signal, no_more_vignetting, valid_);
}

}  // namespace lumen
