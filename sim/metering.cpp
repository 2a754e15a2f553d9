#include "sim/metering.h"

#include <algorithm>

#include "common/random.h"

namespace lumen {
namespace {

constexpr int kReduction = 8;
constexpr int kSamples = 4;
constexpr uint64_t kSeed = 0x6d65746572ull;

CameraIntrinsics Reduced(const CameraIntrinsics& camera) {
  return Resized(camera, std::max(1, camera.width / kReduction), std::max(1, camera.height / kReduction));
}

// As the picture's pixel at the middle of each of the small one's.
Image8 MaskOf(const Image8& valid, int width, int height) {
  Image8 mask(width, height, 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      *mask.Pixel(x, y) = *valid.Pixel(static_cast<int>((x + 0.5) * valid.width / width),
                                       static_cast<int>((y + 0.5) * valid.height / height));
    }
  }
  return mask;
}

}  // namespace

Meter::Meter(const Scene& scene, const Image8& valid, uint64_t seed)
    : scene_(scene),
      intrinsics_(Reduced(scene.calibration.camera)),
      camera_(intrinsics_),
      fast_camera_(intrinsics_),
      path_(scene.path),
      seed_(RandomBits(seed, kSeed)) {
  Calibration small = scene.calibration;
  small.camera = intrinsics_;
  small.mask = MaskOf(valid, intrinsics_.width, intrinsics_.height);
  valid_ = ValidPixels(small);
  path_.samples = kSamples;
}

double Meter::Brightness(const PathScene& path_scene, int frame, PathCount* count) const {
  const View view{&fast_camera_, &valid_, scene_.world_from_camera[frame], &scene_.calibration.light};
  Film film;
  *count = RenderFrame(path_scene, view, path_, seed_, frame, false, &film);
  return MeterBrightness(scene_.calibration.response, film.radiance, valid_, camera_);
}

}  // namespace lumen
