#include "recon/training/estimate.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <vector>

#include "recon/training/trainer.h"

namespace lumen {
namespace {

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Of this process, from Linux's account; 0 where there is none.
int64_t ResidentBytes() {
  std::ifstream statm("/proc/self/statm");
  int64_t all = 0, resident = 0;
  statm >> all >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

}  // namespace

TrainEstimate EstimateTraining(const Sequence& sequence, const TrainOptions& options,
                               const EstimateOptions& estimate) {
  const TrainingFrames frames = FramesFor(sequence, options, estimate.seed);
  Trainer trainer(frames, options, estimate.seed);
  TrainEstimate result;
  result.parameters = static_cast<int64_t>(trainer.state().parameters.size());
  result.network_parameters = result.parameters - static_cast<int64_t>(trainer.field().grid_size());
  result.frames = frames.size();
  result.samples_per_iteration = int64_t(options.sampling.rays) * options.sampling.PerRay();
  result.state_bytes = 4 * result.parameters * static_cast<int64_t>(sizeof(float));

  // Where sharpness is scheduled a step's cost follows it: the sharper, the fewer samples of a ray count.
  // These steps are spread over the schedule evenly, however many there will be (multiples of the golden
  // ratio, Weyl 1916), on a field that has hardly been trained.
  auto iterations = static_cast<double>(options.schedule.iterations);
  const auto step = [&](size_t i) {
    const double progress = std::fmod(0.5 + 0.6180339887498949 * double(i), 1.0);
    trainer.state().iteration = std::llround(progress * iterations);
    trainer.Step(progress);
  };
  step(0);                             // fills caches and workspaces
  if (options.schedule.seconds > 0) {  // of a timed run the second step tells how many there will be
    const double before = Now();
    step(0);
    iterations = options.schedule.seconds / (Now() - before);
  }
  trainer.MeasurePhases();
  std::vector<double> seconds;
  const double start = Now();
  while (seconds.size() < 2 ||
         (Now() - start < estimate.seconds && static_cast<int64_t>(seconds.size()) < estimate.iterations)) {
    const double before = Now();
    step(seconds.size());
    seconds.push_back(Now() - before);
  }
  result.phase_seconds = trainer.phase_seconds();
  for (double& phase : result.phase_seconds) phase /= static_cast<double>(seconds.size());
  result.resident_bytes = ResidentBytes();
  result.measured_iterations = static_cast<int64_t>(seconds.size());
  // Some steps wait for what else the machine does.
  std::ranges::sort(seconds);
  result.seconds_per_iteration = (seconds[(seconds.size() - 1) / 2] + seconds[seconds.size() / 2]) / 2;
  if (options.schedule.seconds > 0) {
    result.seconds = options.schedule.seconds;
    result.iterations = static_cast<int64_t>(result.seconds / result.seconds_per_iteration);
  } else {
    result.iterations = options.schedule.iterations;
    result.seconds = static_cast<double>(result.iterations) * result.seconds_per_iteration;
  }
  return result;
}

}  // namespace lumen
