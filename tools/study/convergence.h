// How a run's surface takes shape: its mesh at parts of the run, beside its error then (the paper's figure
// "Convergence").
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/sequence.h"
#include "recon/evaluation/evaluate.h"
#include "recon/training/options.h"

namespace lumen {

struct ConvergencePoint {
  int64_t iteration = 0;
  ErrorFigures surveyed, extended;  // mm
};

// The paper shows its surface at 2,500, 5,000, 12,500, 15,000 and 65,000 iterations of its run; these are the
// same parts of any other.
std::vector<double> ConvergenceParts();

// Trains in FOLDER/convergence by iterations, and writes FOLDER/convergence.png: the middle frame beside the
// surface as seen from there, coloured by its error, for each part. Parts without a surface that any frame
// sees are left out. A run that is there already, of the same options and seed, is taken. Throws InputError
// where the sequence has no ground truth.
std::vector<ConvergencePoint> DrawConvergence(const Sequence& sequence, TrainOptions options, uint64_t seed,
                                              const std::filesystem::path& folder);

}  // namespace lumen
