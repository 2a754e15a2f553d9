#include "sim/trajectory/stand_in.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace lumen {
namespace {

constexpr double kLeanTurns = 1.5;

struct Movement {
  int64_t frames;
  std::vector<double> depth_mm;
  double aside_mm, turn_rad;
};

// At a part of the whole time, each leg taking its share of the way.
double DepthAt(const std::vector<double>& depth_mm, double time) {
  double whole = 0;
  for (size_t i = 1; i < depth_mm.size(); ++i) whole += std::abs(depth_mm[i] - depth_mm[i - 1]);
  double left = time * whole;
  for (size_t i = 1; i < depth_mm.size(); ++i) {
    const double leg = depth_mm[i] - depth_mm[i - 1];
    if (left > std::abs(leg) && i + 1 < depth_mm.size()) {
      left -= std::abs(leg);
      continue;
    }
    const double done = leg != 0 ? std::min(1.0, left / std::abs(leg)) : 0;
    return depth_mm[i - 1] + leg * 0.5 * (1 - std::cos(kPi * done));
  }
  return depth_mm.back();
}

std::vector<Pose> PosesOf(const Movement& movement, double circles) {
  std::vector<Pose> poses;
  for (int64_t i = 0; i < movement.frames; ++i) {
    const double time = static_cast<double>(i) / static_cast<double>(movement.frames - 1);
    const double round = 2 * kPi * circles * time, lean = 2 * kPi * kLeanTurns * time;
    Pose pose = Pose::Identity();
    pose.translation() = Vec3d(movement.aside_mm * std::cos(round), movement.aside_mm * std::sin(round),
                               DepthAt(movement.depth_mm, time));
    pose.linear() =
        Eigen::AngleAxisd(movement.turn_rad, Vec3d(std::cos(lean), std::sin(lean), 0)).toRotationMatrix();
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace

double PathLength(const std::vector<Pose>& poses) {
  double length_mm = 0;
  for (size_t i = 1; i < poses.size(); ++i) {
    length_mm += (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return length_mm;
}

std::vector<Pose> StandInPoses(const ConfigTable& stand_in) {
  Movement movement;
  movement.frames = stand_in.Integer("frames", Range{2, 100000});
  movement.depth_mm = stand_in.Numbers("depth_mm", 0, Range{-1000, 1000});
  if (movement.depth_mm.size() < 2) stand_in.Fail("depth_mm", "needs two turning points at least");
  movement.aside_mm = stand_in.Number("aside_mm", Range{0, 100});
  movement.turn_rad = stand_in.Number("turn_rad", Range{0, 1});
  const double length_mm = stand_in.Number("length_mm", kPositive);

  // A circle of fewer than six frames is none. The length grows with the circles' number until then.
  double few = 0, many = static_cast<double>(movement.frames) / 6;
  const double shortest = PathLength(PosesOf(movement, few)), longest = PathLength(PosesOf(movement, many));
  if (length_mm < shortest || length_mm > longest) {
    stand_in.Fail("length_mm", "this movement is between " + std::to_string(shortest) + " and " +
                                   std::to_string(longest) + " mm long");
  }
  for (int halving = 0; halving < 50; ++halving) {
    const double middle = (few + many) / 2;
    (PathLength(PosesOf(movement, middle)) < length_mm ? few : many) = middle;
  }
  return PosesOf(movement, few);
}

}  // namespace lumen
