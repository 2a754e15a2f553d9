#include "recon/training/memory.h"

#include <algorithm>
#include <numeric>

#include "recon/surface/field.h"
#include "recon/training/trainer.h"
#include "recon/training/training_frames.h"

namespace lumen {
namespace {

// Of 300 MB program and libraries take 125; frames as they are read, checkpoints, looks at the wall, and what
// is freed but not given back, 39.
constexpr size_t kRunBytes = 136'000'000;

constexpr size_t kThreads = 2;

// Parameters, two moments, their gradient and, where they are normalised or packed, what the field reads.
constexpr size_t kNumbersAParameter = 5;

// Of a network's gradient, beside the sum: one a thread and one that waits (OrderedSum); and one a thread
// that comes with the gradient by poses and isn't used (RayLoss::AddPoseGradient).
size_t GradientsOnTheirWay(const TrainOptions& options) {
  return kThreads + 1 + (options.poses.refine ? kThreads : 0);
}

// A sample's numbers for each unit of a hidden layer (Mlp::Pass): all eight of the distance network; value,
// slope and delta of the others.
constexpr size_t kNumbersADistanceUnit = 8, kNumbersAColorUnit = 3;

size_t Units(const std::vector<int>& hidden) {
  return std::accumulate(hidden.begin(), hidden.end(), size_t{0});
}

}  // namespace

size_t NetworkBytes(const TrainOptions& options) {
  const Vec3d reach = Vec3d::Constant(options.bounds.ahead_mm);
  const Field<float> field(options.field,
                           InitialSurface(options.field.initial, {Pose::Identity()}, Vec3d::Zero()),
                           {-reach, reach});
  const size_t learnt = kNumbersAParameter * field.parameter_count();
  const size_t gradients = GradientsOnTheirWay(options) * field.network_size();
  const bool rounds = options.field.network_precision == Precision::kBfloat16;
  const size_t rounded = rounds ? kThreads * field.network_size() : 0;
  const size_t samples = size_t(RaysAtOnce(options)) * size_t(options.sampling.PerRay());
  const size_t a_sample = kNumbersADistanceUnit * Units(options.field.sdf_hidden) +
                          kNumbersAColorUnit * Units(options.field.color_hidden);
  return sizeof(float) * (learnt + gradients + rounded + kThreads * samples * a_sample);
}

size_t FrameBytes(const TrainOptions& options) {
  const size_t networks = std::min(NetworkBytes(options), kRunBytes);
  return std::clamp(kRunBytes - networks, kFrameBytes / 4, kFrameBytes);
}

}  // namespace lumen
