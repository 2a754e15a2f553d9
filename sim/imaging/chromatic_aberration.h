// Effect: lateral chromatic aberration of the lens, [lens.chromatic_aberration]: red and blue images a little
// larger or smaller than the green one, for which the camera is calibrated. Edges far from the axis get
// coloured seams.
//
//   channel(centre + (1 + k)·r) = sharp channel(centre + r),   r from the principal point, px
//
//   red   -0.0006  k of red: how much larger than green's its image is, in parts; 0.001 is 0.5 px at the edge
//   of a
//                  frame of 1000 px
//   blue   0.0012  k of blue
//
// The linear term of lateral colour (Mallon and Whelan 2007, "Calibration and removal of lateral chromatic
// aberration in images"). The finished frame is resampled, linearly between pixels, so red and blue lose a
// little of their noise and finest detail as well; ground truth and exact channels are those of the lens
// without it.
#pragma once

#include "common/camera.h"
#include "common/config.h"
#include "common/image.h"

namespace lumen {

struct ChromaticAberration {
  double red = -0.0006;
  double blue = 0.0012;
};

// Reads the scene's [lens.chromatic_aberration].
ChromaticAberration ReadChromaticAberration(const ConfigTable& table);

// The frame as the lens images it. Only valid pixels are looked at: beyond the image's border and the mask's
// the nearest of them go on. radiance: RGB, linear.
ImageF Disperse(const ChromaticAberration& aberration, const CameraIntrinsics& camera, const ImageF& radiance,
                const Image8& valid);

}  // namespace lumen
