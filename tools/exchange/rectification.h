// Pictures as a pinhole camera in the same place would have taken them.
#pragma once

#include <vector>

#include "common/sequence.h"

namespace lumen {

class Rectification {
 public:
  // A pinhole with square pixels, as large as the sequence's images, that sees fov_deg across, its axis the
  // camera's own. Throws InputError unless 0 < fov_deg < 170.
  Rectification(const Calibration& calibration, double fov_deg);

  const CameraIntrinsics& camera() const { return camera_; }
  // One channel: 255 where all four pixels around the place that is looked up carry image.
  const Image8& mask() const { return mask_; }
  // Bilinear, in the values as they are stored; black outside the mask. Three channels.
  Image8 Apply(const Image8& color) const;

 private:
  CameraIntrinsics camera_;
  Image8 mask_;
  std::vector<Vec2f> source_;  // a pixel: where it is looked up
};

}  // namespace lumen
