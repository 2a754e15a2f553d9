// A lumen built around a recorded camera path: the scene's [geometry] with kind = "around_path".
#pragma once

#include <cstdint>
#include <vector>

#include "common/config.h"
#include "common/math.h"
#include "sim/geometry/geometry.h"

namespace lumen {

struct CentrelineRule {
  double ahead_mm = 45;   // of lumen beyond the deepest camera
  double behind_mm = 20;  // and behind the one least deep
  double bend_rad = 0;    // by which the stretch ahead turns, to a side that the seed chooses
  double off_centre_mm =
      3;  // shift of the centreline from the path's middle, to a side that the seed chooses
  double widest_radius_mm = 0;  // of the wall that is to go around it
};

// The centreline, points 1 mm apart from the near to the deep end, whatever the cameras do:
// - depth is measured along the cameras' mean viewing direction; between the least deep and the deepest
//   camera the curve goes through the mean place of the cameras of each depth (Gaussian weights of 20 mm in
//   depth, each camera counting for the way that it travels), shifted off_centre_mm aside;
// - beyond the deepest camera it goes on where the cameras there look, on the mean, turning by bend_rad;
// behind
//   it goes straight back;
// - the whole is smoothed until it bends gently enough for its wall.
// Throws InputError for cameras that look all ways, so that there is no depth.
std::vector<Vec3d> CentrelineAroundPath(const std::vector<Pose>& path, const CentrelineRule& rule,
                                        uint64_t seed);

// Keys: those of a colon's wall (sim/geometry/colon_keys.h), the rule's ahead_mm, behind_mm, bend_rad (a
// segment's own) and off_centre_mm, clearance_mm (5): where a camera would be nearer to the wall than that,
// the wall is widened around its place until none is; tolerance_mm; variant (0), which gives scenes of the
// same seed folds of their own. Throws InputError with file and line where no wall can be had.
Geometry BuildAroundPath(const ConfigTable& geometry, const std::vector<Pose>& path, uint64_t seed);

}  // namespace lumen
