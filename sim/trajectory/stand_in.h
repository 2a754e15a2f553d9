// A camera path in place of a recorded one that isn't here: the table `stand_in` of a [trajectory] of kind
// "file".
#pragma once

#include <vector>

#include "common/config.h"
#include "common/math.h"

namespace lumen {

// Keys: frames; depth_mm, the turning points of the movement along +z, at least two; aside_mm, how far from
// the axis the camera circles; length_mm, of the whole way from frame to frame: it tells how often it
// circles; turn_rad, by how much the view leans from the axis, to a side that goes once and a half around.
// Between turning points it moves evenly but for gentle ends. Throws InputError where the way can't have that
// length.
std::vector<Pose> StandInPoses(const ConfigTable& stand_in);

// The sum of the distances from camera to camera, mm.
double PathLength(const std::vector<Pose>& poses);

}  // namespace lumen
