// The optimisation: a state, and steps that move it. A step's result depends on the state, the options and
// the seed only, never on the number of threads.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "recon/network/adam.h"
#include "recon/training/march.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"
#include "recon/training/training_frames.h"

namespace lumen {

// Everything that a step changes; what a checkpoint holds.
struct TrainState {
  int64_t iteration = 0;
  double seconds = 0;                           // spent so far; only runs that end by the clock count them
  LineVector<float> parameters, first, second;  // Adam's moments
  std::vector<float> log_gain, log_gain_first, log_gain_second;  // a frame; 0 where the gain is known
  int64_t skipped_steps = 0;                                     // whose loss or gradient was not finite
  int64_t first_skipped_step = -1;
};

struct StepReport {
  LossTerms loss;
  double sharpness_per_mm = 0;
  bool skipped = false;
};

class Trainer {
 public:
  // `frames` must outlive the trainer.
  Trainer(const TrainingFrames& frames, const TrainOptions& options, uint64_t seed);

  // progress: how much of the run is done, 0…1; the schedules follow it.
  StepReport Step(double progress);

  const Field<float>& field() const { return *field_; }
  // World point that the field's coordinates count from.
  const Vec3d& origin() const { return origin_; }
  TrainState& state() { return state_; }
  const TrainState& state() const { return state_; }

 private:
  // Rays that are computed together, by one thread.
  struct Chunk {
    explicit Chunk(const Field<float>* field) : marcher(field), loss(field) {}
    RayBatch<float> batch;
    Marcher marcher;
    RayLoss<float> loss;
    LineVector<float> network_gradient;
    std::vector<float> log_gain_gradient;
    LossTerms terms;
    bool finite = true;  // loss and gradient
  };
  void RunChunk(int index, const LossSettings<float>& settings);
  LossSettings<float> SettingsAt(double progress) const;
  bool GradientsAreFinite() const;
  void UpdateNetworks(const AdamStep& step);
  void UpdateGains(const AdamStep& step);
  void MatchColorsToInitialSurface(const InitialSurface& initial);

  const TrainingFrames& frames_;
  TrainOptions options_;
  uint64_t seed_;
  Vec3d origin_;
  std::unique_ptr<Field<float>> field_;
  std::vector<FrameLight<float>> lights_;
  std::vector<std::unique_ptr<Chunk>> chunks_;
  LineVector<float> gradient_;
  TrainState state_;
};

// Box, in world axes, that the wall may lie in: `aside_mm` around every camera and `ahead_mm` along its rays
// within 45° of its axis.
Eigen::AlignedBox3d SceneBounds(const std::vector<Pose>& world_from_camera,
                                const TrainOptions::Bounds& bounds);

}  // namespace lumen
