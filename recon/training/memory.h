// How a run's 300 MB are shared out.
#pragma once

#include <cstddef>

#include "recon/training/options.h"

namespace lumen {

// About what learning with the field's networks takes on two threads, bytes: parameters, their moments and
// gradients, and what the networks' passes leave for each other.
size_t NetworkBytes(const TrainOptions& options);

// What the frames' pixels may take up beside them (TrainingFrames): kFrameBytes, or less where networks are
// wide; a quarter of it at least, whatever these take.
size_t FrameBytes(const TrainOptions& options);

}  // namespace lumen
