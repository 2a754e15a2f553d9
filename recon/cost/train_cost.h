// What the reconstruction's accuracy costs in seconds of training: each knob's settings trained and
// evaluated.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/cost_curves.h"
#include "common/sequence.h"
#include "recon/training/options.h"

namespace lumen {

struct TrainCostOptions {
  TrainOptions own;                // what the settings are variations of
  bool few = false;                // settings
  std::vector<std::string> knobs;  // names; none = all
  int seeds = 3;                   // runs a setting: the median counts, half the range is the spread
  uint64_t seed = 0;
  // Where runs are made and what has been measured stands (measured.json): a run that is in there isn't made
  // again, so that a measurement that was stopped goes on.
  std::filesystem::path folder;
  // What a measurement depends on besides the options: the sequence's origin. Runs of another are forgotten.
  std::string subject;
};

// Measures, in this order: mean absolute error of the surveyed and of the extended region, mm; NaN where the
// run leaves no surface. Seconds are CPU seconds of training, of all threads, so that what else the machine
// does counts little. Throws InputError where the sequence has no ground truth, and for a knob that there
// isn't.
CostCurves MeasureTrainCost(const Sequence& sequence, const TrainCostOptions& options);

}  // namespace lumen
