// Where the camera is at each frame.
#pragma once

#include <cstdint>
#include <vector>

#include "common/config.h"
#include "common/math.h"
#include "sim/geometry/geometry.h"

namespace lumen {

// world_from_camera of each frame, as the scene's [trajectory] names it: kind = "withdrawal" (along the
// centreline, with wobble, never nearer to the wall than a clearance) or "file" (a pose.txt, as it is or
// re-anchored on the centreline). Throws InputError naming the frame that comes too near to the wall and by
// how much.
std::vector<Pose> BuildTrajectory(const ConfigTable& trajectory, const Geometry& geometry, uint64_t seed);

}  // namespace lumen
