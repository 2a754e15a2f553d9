// What a training run would cost on this machine, measured over some iterations, and on what it goes.
#pragma once

#include <cstdint>

#include "common/sequence.h"
#include "recon/training/options.h"
#include "recon/training/phase_clock.h"

namespace lumen {

struct TrainEstimate {
  int64_t parameters = 0;  // that are learnt: grid, networks, their lengths
  int64_t network_parameters = 0;
  int frames = 0;
  int64_t samples_per_iteration = 0;  // rays × samples a ray
  int64_t state_bytes = 0;            // parameters, gradient and Adam's moments
  int64_t resident_bytes = 0;         // of the whole process after the measured iterations, frames included
  int64_t measured_iterations = 0;
  double seconds_per_iteration = 0;  // their median, wall time
  PhaseSeconds phase_seconds = {};   // an iteration's, their mean, threads added up
  int64_t iterations = 0;            // of the whole run
  double seconds = 0;
};

struct EstimateOptions {
  double seconds = 5;        // of measuring, about; at least two iterations after one that doesn't count
  int64_t iterations = 100;  // no more than so many
  uint64_t seed = 0;
};

// Writes no file. A run that ends by the clock is as long as that, its iterations follow from their median.
// Throws InputError as Train does, for what the sequence is at fault for.
TrainEstimate EstimateTraining(const Sequence& sequence, const TrainOptions& options,
                               const EstimateOptions& estimate);

}  // namespace lumen
