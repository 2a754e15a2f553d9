#include "tools/exchange/rectification.h"

#include <cmath>

#include "common/error.h"
#include "common/parallel.h"

namespace lumen {

Rectification::Rectification(const Calibration& calibration, double fov_deg) {
  constexpr double kWidest_deg = 170;
  if (!(fov_deg > 0 && fov_deg < kWidest_deg)) {
    throw InputError("a pinhole's field of view must lie between 0 and " + std::to_string(int(kWidest_deg)) +
                     " degrees");
  }
  const Camera<double> from(calibration.camera);
  const Image8 valid = ValidPixels(calibration);
  camera_.model = CameraModel::kPinhole;
  camera_.width = valid.width;
  camera_.height = valid.height;
  camera_.cx = (camera_.width - 1) / 2.0;
  camera_.cy = (camera_.height - 1) / 2.0;
  camera_.fx = camera_.fy = camera_.width / 2.0 / std::tan(fov_deg * kPi / 360);
  const Camera<double> to(camera_);
  mask_ = Image8(valid.width, valid.height, 1);
  source_.assign(mask_.data.size(), Vec2f::Zero());
  ParallelFor(0, valid.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < valid.width; ++x) {
      const auto place = from.Project(*to.Unproject(Vec2d(x, y)));
      if (!place) continue;
      const Vec2d corner = place->array().floor();
      if (!(corner.x() >= 0 && corner.y() >= 0 && corner.x() < valid.width - 1 &&
            corner.y() < valid.height - 1)) {
        continue;
      }
      const int u = static_cast<int>(corner.x()), v = static_cast<int>(corner.y());
      if (!*valid.Pixel(u, v) || !*valid.Pixel(u + 1, v) || !*valid.Pixel(u, v + 1) ||
          !*valid.Pixel(u + 1, v + 1)) {
        continue;
      }
      *mask_.Pixel(x, y) = 255;
      source_[static_cast<size_t>(y) * valid.width + x] = place->cast<float>();
    }
  });
}

Image8 Rectification::Apply(const Image8& color) const {
  Image8 image(mask_.width, mask_.height, 3);
  ParallelFor(0, image.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < image.width; ++x) {
      if (!*mask_.Pixel(x, y)) continue;
      const Vec2f& place = source_[static_cast<size_t>(y) * image.width + x];
      const int u = static_cast<int>(place.x()), v = static_cast<int>(place.y());
      const float right = place.x() - static_cast<float>(u), down = place.y() - static_cast<float>(v);
      for (int c = 0; c < 3; ++c) {
        const float above = (1 - right) * color.Pixel(u, v)[c] + right * color.Pixel(u + 1, v)[c];
        const float below = (1 - right) * color.Pixel(u, v + 1)[c] + right * color.Pixel(u + 1, v + 1)[c];
        image.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround((1 - down) * above + down * below));
      }
    }
  });
  return image;
}

}  // namespace lumen
