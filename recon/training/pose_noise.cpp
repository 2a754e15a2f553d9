#include "recon/training/pose_noise.h"

#include <Eigen/Geometry>
#include <cmath>

#include "common/random.h"

namespace lumen {
namespace {

constexpr uint64_t kPoseNoiseSeed = 0x706f7365ull;

// A standard normal number of (seed, frame, component), by Box and Muller.
double Normal(uint64_t seed, uint64_t frame, uint64_t component) {
  // 1 − u is in (0, 1]: its logarithm is finite.
  const double u = 1 - UniformDouble(RandomBits(seed, frame, component, 0));
  const double v = UniformDouble(RandomBits(seed, frame, component, 1));
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

}  // namespace

void AddPoseNoise(const PoseNoise& noise, uint64_t seed, Sequence* sequence) {
  const uint64_t own_seed = RandomBits(seed, kPoseNoiseSeed);
  // The mean square of a vector is that of its three components together.
  const double shift_mm = noise.shift_mm / std::sqrt(3.0), angle_rad = noise.angle_rad / std::sqrt(3.0);
  for (SequenceFrame& frame : sequence->frames) {
    const auto number = static_cast<uint64_t>(frame.number);
    const auto normals = [&](uint64_t first) {
      return Vec3d(Normal(own_seed, number, first), Normal(own_seed, number, first + 1),
                   Normal(own_seed, number, first + 2));
    };
    const Vec3d rotation = angle_rad * normals(0);
    Pose& pose = frame.world_from_camera;
    if (rotation.norm() > 0) pose.rotate(Eigen::AngleAxisd(rotation.norm(), rotation.normalized()));
    pose.pretranslate(shift_mm * normals(3));
  }
}

}  // namespace lumen
