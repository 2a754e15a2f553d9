// The optimisation: a state, and steps that move it. A step's result depends on the state, the options and
// the seed only, never on the number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "recon/network/adam.h"
#include "recon/training/free_space.h"
#include "recon/training/options.h"
#include "recon/training/ordered_sum.h"
#include "recon/training/phase_clock.h"
#include "recon/training/pose_refinement.h"
#include "recon/training/ray_loss.h"
#include "recon/training/ray_sampler.h"
#include "recon/training/training_frames.h"

namespace lumen {

// Everything that a step changes; what a checkpoint holds.
struct TrainState {
  int64_t iteration = 0;
  double seconds = 0;  // spent so far; only runs that end by the clock count them
  // What is learnt: the field's parameters and, with weight normalisation, lengths behind them (see
  // recon/network/weight_norm.h); and Adam's moments.
  LineVector<float> parameters, first, second;
  std::array<float, 3> log_sharpness = {};  // of s in 1/mm, and its moments; where it is learnt
  std::vector<float> log_gain, log_gain_first, log_gain_second;  // a frame; 0 where the gain is known
  PoseMotions poses;                                             // where they are refined
  // Where interreflection is by radiosity: a frame's DirectionMap after the other, as last computed.
  std::vector<float> surroundings;
  double start_photometric = 0;  // the first step's photometric loss, what training is measured by
  double mean_photometric = 0;   // its running mean
  int64_t skipped_steps = 0;     // whose loss or gradient was not finite
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

  // Steps measure their phases from then on.
  void MeasurePhases();
  // Over the steps since then, threads added up.
  PhaseSeconds phase_seconds() const;

  const Field<float>& field() const { return *field_; }
  // The field's parameters as they are now, its tables as its grid reads them.
  const float* Weights();
  // Poses of the frames trained on, as they are refined so far.
  std::vector<Pose> Poses() const;
  // World point that the field's coordinates count from.
  const Vec3d& origin() const { return origin_; }
  TrainState& state() { return state_; }
  const TrainState& state() const { return state_; }

 private:
  // What computing with some rays takes; one a thread.
  struct Workspace {
    Workspace(const TrainOptions::Sampling& sampling, const Field<float>* field)
        : sampler(MakeRaySampler(sampling, field)), loss(field) {}
    RayBatch<float> batch;
    std::unique_ptr<RaySampler> sampler;
    RayLoss<float> loss;
  };
  // Rays that are computed by one thread, and what is kept of them until all are.
  struct Chunk {
    int rays = 0;
    Field<float>::GridTrace to_grid;
    std::vector<float> log_gain_gradient;
    std::vector<float> pose_gradient;  // empty where poses stay as they are given
    LossTerms terms;
    std::unique_ptr<PhaseClock> clock;  // null where phases aren't measured
    bool finite = true;                 // loss and gradient
  };
  bool has_grid() const { return field_->grid_size() > 0; }
  std::unique_ptr<Workspace> TakeWorkspace();
  void LeaveWorkspace(std::unique_ptr<Workspace> workspace);
  void RunChunk(int index, const float* weights, const LossSettings<float>& settings,
                float* network_gradient);
  // Of all chunks, on all threads; fills them and the networks' part of gradient_.
  LossTerms RunChunks(const float* weights, const LossSettings<float>& settings);
  void ClearGradients();
  double RateAt(double progress) const;
  bool KnowsPower() const;
  // How far the run has come on its way to settling; from 1 on it does.
  double Settling(double progress) const;
  double SharpnessAt(double progress) const;
  LossSettings<float> SettingsAt(double progress) const;
  bool GradientsAreFinite() const;
  bool has_surroundings() const;
  void UpdateSurroundings();
  double KeepCamerasFree(const float* weights, float* network_gradient);
  void UpdateNetworks(const AdamStep& step);
  void UpdateGains(const AdamStep& step);
  bool refines_poses() const { return state_.poses.frames() > 0; }
  void UpdatePoses(double progress);
  void PlaceLights();
  void UpdateSharpness(double rate, double gradient);
  void MatchBrightnessToInitialSurface(const InitialSurface& initial);

  const TrainingFrames& frames_;
  TrainOptions options_;
  uint64_t seed_;
  Vec3d origin_;
  std::unique_ptr<Field<float>> field_;
  std::vector<FrameLight<float>> lights_;
  WeightNorm<float> norm_;
  LineVector<float> weights_;  // the field's parameters, where they aren't what is learnt
  std::vector<Chunk> chunks_;
  std::vector<std::unique_ptr<PhaseClock>> update_clocks_;  // one a task of the update; null as the chunks'
  std::unique_ptr<FreeSpace<float>> free_space_;
  std::vector<Vec3f> camera_places_;  // that it looks at
  std::mutex idle_mutex_;
  std::vector<std::unique_ptr<Workspace>> idle_;
  std::unique_ptr<OrderedSum> network_gradients_;  // of the chunks
  LineVector<float> gradient_;                     // zero between the steps
  TrainState state_;
};

// Box, in world axes, that the wall may lie in: `aside_mm` around every camera and `ahead_mm` along its rays
// within 45° of its axis.
Eigen::AlignedBox3d SceneBounds(const std::vector<Pose>& world_from_camera,
                                const TrainOptions::Bounds& bounds);

}  // namespace lumen
