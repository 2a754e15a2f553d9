// Poses as they might be known: what a reconstruction from poses that are off is worth.
#pragma once

#include <cstdint>

#include "common/sequence.h"

namespace lumen {

// Errors of the poses, root mean squares over frames; each component is normal, frames independent.
struct PoseNoise {
  double shift_mm = 0.5;
  double angle_rad = 0.3 / 180 * kPi;
};

// Disturbs every frame's pose: rotation vector and shift, drawn by seed and frame.
void AddPoseNoise(const PoseNoise& noise, uint64_t seed, Sequence* sequence);

}  // namespace lumen
