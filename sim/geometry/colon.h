// A procedural segment of a colon: the scene's [geometry] with kind = "colon".
#pragma once

#include "common/config.h"
#include "sim/geometry/geometry.h"

namespace lumen {

// Keys (scenes/README.md has them with their defaults): segment, length_mm, bend_rad, torsion_rad or
// control_points, diameter_mm or diameters_mm, haustra_spacing_mm, haustra_depth_mm, fold_height_mm,
// fold_thickness_mm, taenia_width_mm, taenia_depth_mm, irregularity_mm, polyps, tolerance_mm. The mesh is
// closed by rounded ends beyond both ends of the centreline. Throws InputError with file and line where the
// wall would meet itself: bent too sharply for its radius, folds that close the lumen, polyps that touch.
Geometry BuildColon(const ConfigTable& geometry, uint64_t seed);

}  // namespace lumen
