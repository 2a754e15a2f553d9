#include "tools/study/scaled_scene.h"

#include <algorithm>
#include <cmath>

namespace lumen {

Scene ReadScaledScene(const std::filesystem::path& file, const std::vector<std::string>& settings,
                      uint64_t seed, double scale) {
  Scene scene = ReadScene(file, settings, seed);
  if (scale == 1) return scene;
  const CameraIntrinsics& camera = scene.calibration.camera;
  const auto scaled = [&](int size) { return std::max(1, static_cast<int>(std::lround(scale * size))); };
  const int width = scaled(camera.width), height = scaled(camera.height);
  const Image8& mask = scene.calibration.mask;
  if (!mask.empty()) {
    Image8 smaller(width, height, 1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {  // as the mask's pixel at its middle
        *smaller.Pixel(x, y) = *mask.Pixel(static_cast<int>((x + 0.5) * mask.width / width),
                                           static_cast<int>((y + 0.5) * mask.height / height));
      }
    }
    scene.calibration.mask = smaller;
  }
  scene.calibration.camera = Resized(camera, width, height);
  return scene;
}

}  // namespace lumen
