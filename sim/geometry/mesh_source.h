// A mesh file as geometry: the scene's [geometry] with kind = "mesh".
#pragma once

#include "common/config.h"
#include "sim/geometry/geometry.h"

namespace lumen {

// Keys (scenes/README.md has them with their defaults): path, unit, scale, centreline, reverse, between,
// close, smooth_iterations, refine_mm. The mesh is repaired as far as that is possible, saying what was done,
// cut to the stretch asked for, closed, smoothed and subdivided. Throws InputError with the reason where it
// can't be used.
Geometry LoadMeshSource(const ConfigTable& geometry);

}  // namespace lumen
