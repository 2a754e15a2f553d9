// How the lumen that a run has learnt goes on behind its cameras.
#pragma once

#include <optional>

#include "recon/surface/continuation.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"
#include "recon/training/training_frames.h"

namespace lumen {

// Relative to the field's origin, which `origin` is in the world, mm; from what rays of the frames' pixels
// meet, which `seed` chooses. Nothing where Continuation::Fit finds none.
std::optional<Continuation> ContinueLumen(const TrainingFrames& frames, const Field<float>& field,
                                          const float* parameters, const Vec3d& origin,
                                          const TrainOptions::Sampling& sampling, uint64_t seed);

}  // namespace lumen
