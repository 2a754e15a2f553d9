#include "recon/training/memory.h"

#include <algorithm>
#include <numeric>

#include "recon/surface/field.h"

namespace lumen {
namespace {

// Without a grid, where networks are wide: of 2 rays of the paper's 128 samples its passes take 20 MB a
// thread; half of that would take a tenth more time, for a gradient is read and written for fewer samples.
// Where such a field has an albedo its pull is between the places of 2 rays.
constexpr int kPieceRays = 2;

// What pixels and networks share. The rest of 300 MB are 125 of program and libraries; and 38 of frames as
// they are read, checkpoints, looks at the wall, and what is freed but not given back.
constexpr size_t kShared = 137'000'000;

constexpr size_t kThreads =
    2;  // that 300 MB are meant for; each more has a workspace and a gradient of its own

// Parameters, two moments, their gradient and, where they are normalised or packed, what the field reads.
constexpr size_t kNumbersAParameter = 5;

// Of a network's gradient, beside the sum: one a thread and one that waits (OrderedSum); and one a thread
// that comes with the gradient by poses and isn't used (RayLoss::AddPoseGradient).
size_t GradientsOnTheirWay(const TrainOptions& options) {
  return kThreads + 1 + (options.poses.refine ? kThreads : 0);
}

// A thread's rounded weights, two numbers in 32 bits: of the largest network, which is most of them.
size_t RoundedAWeight(const TrainOptions& options) {
  return options.field.network_precision == Precision::kBfloat16 ? kThreads : 0;
}

// A sample's numbers for each unit of a hidden layer (Mlp::Pass): all eight of the distance network; value,
// slope and delta of the others.
constexpr size_t kNumbersADistanceUnit = 8, kNumbersAnotherUnit = 3;

size_t Units(const std::vector<int>& hidden) {
  return std::accumulate(hidden.begin(), hidden.end(), size_t{0});
}

}  // namespace

int RaysAtOnce(const TrainOptions& options) {
  return options.field.grid.levels > 0 ? kChunkRays : kPieceRays;
}

size_t NetworkBytes(const TrainOptions& options) {
  const FieldOptions& of = options.field;
  const Vec3d reach = Vec3d::Constant(options.bounds.ahead_mm);
  const Field<float> field(of, InitialSurface(of.initial, {Pose::Identity()}, Vec3d::Zero()),
                           {-reach, reach});
  const size_t learnt = kNumbersAParameter * field.parameter_count();
  const size_t on_their_way = (GradientsOnTheirWay(options) + RoundedAWeight(options)) * field.network_size();
  const size_t samples = kThreads * size_t(RaysAtOnce(options)) * size_t(options.sampling.PerRay());
  const size_t a_sample = kNumbersADistanceUnit * Units(of.sdf_hidden) +
                          kNumbersAnotherUnit * (Units(of.color_hidden) + Units(of.ambient_hidden));
  return sizeof(float) * (learnt + on_their_way + samples * a_sample);
}

size_t FrameBytes(const TrainOptions& options) {
  const size_t networks = std::min(NetworkBytes(options), kShared);
  return std::clamp(kShared - networks, kFrameBytes / 4, kFrameBytes);
}

}  // namespace lumen
