// OpenCV's fisheye (Kannala–Brandt) in place of another camera model.
#pragma once

#include <cstdint>

#include "common/sequence.h"

namespace lumen {

struct FisheyeFit {
  CameraIntrinsics camera;  // Kannala–Brandt
  // The fitted camera stands turned by this about its axis: a direction d of the sequence's camera is
  // Rz(roll)·d in the fitted one's axes. Scaramuzza's S can turn the image, the fisheye can't.
  double roll_rad = 0;
  // How far apart the two cameras' pixels of the same direction are.
  double max_px = 0, rms_px = 0;
  int64_t pixels = 0;    // compared: those that carry image
  int64_t unfitted = 0;  // that carry image but lie too far off the axis: others' implementations of the
                         // fisheye go by x/z, y/z
};

// Least squares over the pixels that carry image. A Kannala–Brandt camera is its own fit. Throws InputError
// where too few pixels carry image.
FisheyeFit FitFisheye(const Calibration& calibration);

// Pixels that carry image and that the fit speaks of, 255 = yes.
Image8 FittedPixels(const Calibration& calibration);

}  // namespace lumen
