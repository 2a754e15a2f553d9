#include "sim/trajectory/trajectory.h"

#include <algorithm>
#include <cstdio>
#include <string>

#include "common/parallel.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"
#include "sim/trajectory/recorded_path.h"
#include "sim/trajectory/withdrawal.h"

namespace lumen {
namespace {

std::string Millimetres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f mm", value);
  return text;
}

// The poses as they are, or InputError naming the worst frame.
void CheckClearance(const ConfigTable& table, const std::vector<Pose>& poses, const Clearance& wall) {
  const double clearance_mm = ClearanceKey(table);
  std::vector<double> distance(poses.size());
  std::vector<char> inside(poses.size());
  ParallelFor(0, poses.size(), [&](int64_t i) {
    inside[i] = wall.Encloses(poses[i].translation());
    distance[i] = wall.At(poses[i].translation()).distance_mm;
  });
  const auto outside = std::find(inside.begin(), inside.end(), 0);
  if (outside != inside.end()) {
    const size_t frame = outside - inside.begin();
    table.Fail("clearance_mm", "frame " + std::to_string(frame) + " is outside the colon, " +
                                   Millimetres(distance[frame]) + " from its wall: move the trajectory");
  }
  const size_t worst = std::min_element(distance.begin(), distance.end()) - distance.begin();
  if (distance[worst] < clearance_mm)
    table.Fail("clearance_mm", "frame " + std::to_string(worst) + " comes within " +
                                   Millimetres(distance[worst]) + " of the wall, " +
                                   Millimetres(clearance_mm - distance[worst]) +
                                   " too near: move the trajectory or allow less clearance");
}

}  // namespace

std::vector<Pose> BuildTrajectory(const ConfigTable& trajectory, const Geometry& geometry, uint64_t seed) {
  const Centreline centreline(geometry.centreline);
  const Clearance wall(geometry.mesh);
  const bool from_file = trajectory.Choice("kind", {"withdrawal", "file"}) == "file";
  const std::vector<Pose> poses = from_file ? RecordedPoses(trajectory, centreline, wall)
                                            : WithdrawalPoses(trajectory, centreline, wall, seed);
  CheckClearance(trajectory, poses, wall);
  return poses;
}

}  // namespace lumen
