#include "sim/trajectory/withdrawal.h"

#include <algorithm>
#include <cmath>

#include "common/parallel.h"
#include "common/random.h"

namespace lumen {
namespace {

// A smooth function of the place along the centreline, in about ±1: five cosines with wave-lengths of 10–60
// mm, what a scope does that follows the breath and the operator's wrist.
class Wobble {
 public:
  Wobble(uint64_t seed, uint64_t component) {
    for (uint64_t i = 0; i < kWaves; ++i) {
      const double wavelength =
          10 * std::pow(6.0, (i + UniformDouble(RandomBits(seed, 0x77, component, 2 * i))) / kWaves);
      waves_[i] = {2 * kPi / wavelength,
                   2 * kPi * UniformDouble(RandomBits(seed, 0x77, component, 2 * i + 1))};
    }
  }
  double operator()(double s_mm) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += std::cos(wave.per_mm * s_mm + wave.phase);
    return sum / kWaves * 2;
  }

 private:
  static constexpr int kWaves = 5;
  struct Wave {
    double per_mm, phase;
  };
  Wave waves_[kWaves];
};

struct Withdrawal {
  double start_mm, end_mm, wobble_mm, wobble_rad, roll_rad, clearance_mm;
  int frames;
};

Withdrawal ReadWithdrawal(const ConfigTable& table, double length_mm) {
  Withdrawal w;
  const Range along{0, length_mm};
  w.start_mm = table.Number("start_mm", along);
  w.end_mm = table.Number("end_mm", along);
  if (w.end_mm >= w.start_mm)
    table.Fail("end_mm", "a withdrawal moves from a deep start_mm to a smaller end_mm");
  w.wobble_mm = table.Number("wobble_mm", 0, Range{0, 50});
  w.wobble_rad = table.Number("wobble_rad", 0, Range{0, 1.5});
  w.roll_rad = table.Number("roll_rad", 0, Range{-2 * kPi, 2 * kPi});
  w.clearance_mm = ClearanceKey(table);
  const double rate_hz = table.Number("rate_hz", 29.97, kPositive);
  if (table.Has("frames") == table.Has("speed_mm_s"))
    table.Fail("frames", "give either frames or speed_mm_s");
  if (table.Has("frames")) {
    w.frames = static_cast<int>(table.Integer("frames", Range{1, 100000}));
  } else {
    const double seconds = (w.start_mm - w.end_mm) / table.Number("speed_mm_s", kPositive);
    if (seconds * rate_hz > 99999) table.Fail("speed_mm_s", "more than 100000 frames: move faster");
    w.frames = static_cast<int>(seconds * rate_hz) + 1;
  }
  return w;
}

// As far from the middle along the offset as the clearance lets go, at most all of it. Each step is as long
// as the wall is known to be away beyond the clearance, so that none crosses the wall; it ends within
// kStep_mm of the limit.
Vec3d KeepClear(const Clearance& wall, const Vec3d& middle, const Vec3d& offset, double clearance_mm) {
  constexpr double kStep_mm = 1e-3;
  const double length = offset.norm();
  if (length < kStep_mm) return middle;
  const Vec3d direction = offset / length;
  double gone = 0;
  while (gone < length) {
    const double free_mm = wall.At(middle + gone * direction).distance_mm - clearance_mm;
    if (free_mm < kStep_mm) break;
    gone += free_mm;
  }
  return middle + std::min(gone, length) * direction;
}

}  // namespace

std::vector<Pose> WithdrawalPoses(const ConfigTable& trajectory, const Centreline& centreline,
                                  const Clearance& wall, uint64_t seed) {
  const Withdrawal w = ReadWithdrawal(trajectory, centreline.length_mm());
  const Wobble right(seed, 0), down(seed, 1), pitch(seed, 2), yaw(seed, 3), roll(seed, 4);
  std::vector<Pose> poses(w.frames);
  ParallelFor(0, w.frames, [&](int64_t i) {
    const double s =
        w.start_mm + (w.end_mm - w.start_mm) * (w.frames > 1 ? static_cast<double>(i) / (w.frames - 1) : 0);
    const CentrelineFrame frame = centreline.At(s);
    Mat3d axes;  // x right, y down, z towards the deep end
    axes << frame.normal, frame.binormal, frame.tangent;
    axes = axes * Eigen::AngleAxisd(w.roll_rad, Vec3d::UnitZ());
    const Vec3d offset = w.wobble_mm * (right(s) * axes.col(0) + down(s) * axes.col(1));
    Pose& pose = poses[i];
    pose = Pose::Identity();
    pose.translation() = KeepClear(wall, frame.point, offset, w.clearance_mm);
    pose.linear() = axes * Eigen::AngleAxisd(w.wobble_rad * yaw(s), Vec3d::UnitY()) *
                    Eigen::AngleAxisd(w.wobble_rad * pitch(s), Vec3d::UnitX()) *
                    Eigen::AngleAxisd(w.wobble_rad * roll(s), Vec3d::UnitZ()).toRotationMatrix();
  });
  return poses;
}

}  // namespace lumen
