#include "sim/trajectory/trajectory.h"

#include <algorithm>
#include <cstdio>
#include <string>

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
  std::vector<Vec3d> places;
  for (const Pose& pose : poses) places.push_back(pose.translation());
  const std::vector<double> within_mm = wall.WithinBy(places);
  const auto outside = std::find_if(within_mm.begin(), within_mm.end(), [](double mm) { return mm < 0; });
  if (outside != within_mm.end()) {
    const size_t frame = outside - within_mm.begin();
    table.Fail("clearance_mm", "frame " + std::to_string(frame) + " is outside the colon, " +
                                   Millimetres(-*outside) + " from its wall: move the trajectory");
  }
  const size_t worst = std::min_element(within_mm.begin(), within_mm.end()) - within_mm.begin();
  if (within_mm[worst] < clearance_mm)
    table.Fail("clearance_mm", "frame " + std::to_string(worst) + " comes within " +
                                   Millimetres(within_mm[worst]) + " of the wall, " +
                                   Millimetres(clearance_mm - within_mm[worst]) +
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
