#include "sim/imaging/chromatic_aberration.h"

#include <algorithm>
#include <cmath>

#include "common/parallel.h"

namespace lumen {
namespace {

// Linear between the four pixels around a place, those that aren't valid left out; `otherwise` where none is.
float Interpolate(const ImageF& image, const Image8& valid, int channel, double x, double y,
                  float otherwise) {
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  double sum = 0, weights = 0;
  for (const int py : {y0, y0 + 1}) {
    for (const int px : {x0, x0 + 1}) {
      if (px < 0 || py < 0 || px >= image.width || py >= image.height || !*valid.Pixel(px, py)) continue;
      const double weight = (1 - std::abs(x - px)) * (1 - std::abs(y - py));
      sum += weight * image.Pixel(px, py)[channel];
      weights += weight;
    }
  }
  return weights > 0 ? static_cast<float>(sum / weights) : otherwise;
}

}  // namespace

ChromaticAberration ReadChromaticAberration(const ConfigTable& table) {
  ChromaticAberration aberration;
  aberration.red = table.Number("red", aberration.red, {-0.1, 0.1});
  aberration.blue = table.Number("blue", aberration.blue, {-0.1, 0.1});
  return aberration;
}

ImageF Disperse(const ChromaticAberration& aberration, const CameraIntrinsics& camera, const ImageF& radiance,
                const Image8& valid) {
  ImageF dispersed = radiance;
  ParallelFor(0, radiance.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < radiance.width; ++x) {
      if (!*valid.Pixel(x, y)) continue;
      for (const auto& [channel, k] : {std::pair(0, aberration.red), std::pair(2, aberration.blue)}) {
        const double from_x = camera.cx + (x - camera.cx) / (1 + k),
                     from_y = camera.cy + (y - camera.cy) / (1 + k);
        dispersed.Pixel(x, y)[channel] =
            Interpolate(radiance, valid, channel, from_x, from_y, radiance.Pixel(x, y)[channel]);
      }
    }
  });
  return dispersed;
}

}  // namespace lumen
