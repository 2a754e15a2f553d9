// How far the initial tube reaches ahead of the cameras. What is far ahead is what training moves last, and a
// dark wall that is near looks much like a bright one that is far: so the tube ends where the fall-off of the
// light says that the lumen does.
#pragma once

#include <cstdint>

#include "recon/surface/initial_surface.h"
#include "recon/training/training_frames.h"

namespace lumen {

// The reach, mm, within [radius/2, farthest_mm], on whose tube a wall of one colour comes nearest to the
// frames' brightness: the least mean absolute deviation of log(radiance shown / radiance of a white wall
// there) from its median, one a channel, and a frame where gains are unknown. Light from other walls and
// shadows are left out. initial.reach_mm where the frames say nothing. frames: lit; initial: a tube; seed: of
// the pixels that are asked. The same for any number of threads.
double FitReach(const TrainingFrames& frames, const InitialSurfaceOptions& initial, double farthest_mm,
                uint64_t seed);

}  // namespace lumen
