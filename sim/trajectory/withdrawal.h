// A withdrawal along the centreline: the scene's [trajectory] with kind = "withdrawal".
#pragma once

#include <cstdint>
#include <vector>

#include "common/config.h"
#include "common/math.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"

namespace lumen {

// Keys: start_mm, end_mm, frames or speed_mm_s, rate_hz, wobble_mm, wobble_rad, roll_rad, clearance_mm. The
// camera looks towards the deep end and moves away from it; where its wobble would bring it nearer to the
// wall than clearance_mm, the wobble is less. The wobble is a function of the place and the seed: more frames
// are more pictures of the same path.
std::vector<Pose> WithdrawalPoses(const ConfigTable& trajectory, const Centreline& centreline,
                                  const Clearance& wall, uint64_t seed);

}  // namespace lumen
