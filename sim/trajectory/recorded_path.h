// A camera path from a file: the scene's [trajectory] with kind = "file".
#pragma once

#include <vector>

#include "common/config.h"
#include "common/math.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"

namespace lumen {

// Whether the file that the keys name is absent and its table stand_in (sim/trajectory/stand_in.h) counts.
bool IsStandIn(const ConfigTable& trajectory);

// Poses that don't depend on the lumen, for one that is built around them: those of kind = "file" as they
// are. None where the trajectory is of another kind or anchored.
std::vector<Pose> GivenPoses(const ConfigTable& trajectory);

// Keys: path (a pose.txt), stand_in (what counts where that is absent), frames (that many, uniformly; all by
// default), anchor = "none" or "centreline", and with the latter at_mm, roll_rad, clearance_mm. Anchored, the
// path is moved as a whole, rigidly and at its own scale: its first camera comes to the centreline at at_mm,
// the mean viewing direction along the centreline towards the deep end, over the stretch that the path
// covers; then it is shifted across that direction as far as the clearance asks. What can't be kept clear
// that way is left for the caller to report.
std::vector<Pose> RecordedPoses(const ConfigTable& trajectory, const Centreline& centreline,
                                const Clearance& wall);

// The rigid motion new_world_from_world that anchors the poses as said above, without the shift. Throws
// InputError where the views cancel out, so that there is no mean direction.
Pose AnchorOnCentreline(const std::vector<Pose>& poses, const Centreline& centreline, double at_mm,
                        double roll_rad);

}  // namespace lumen
