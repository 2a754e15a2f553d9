// What the wall's surface is in each pixel of a frame, from the places that its truth names.
#pragma once

#include <cstdint>

#include "common/image.h"
#include "common/math.h"
#include "sim/ground_truth.h"
#include "sim/imaging/surface.h"

namespace lumen {

// RGB; NaN where the truth has no place. The texture is that of the wall at rest: of truth.rest_position
// where there is one. anchor_mm: RayScene's of the wall at rest.
ImageF AlbedoMap(const Surface& surface, uint64_t surface_seed, const Vec3d& anchor_mm,
                 const FrameTruth& truth);

// The normal that shading goes by, camera axes, unit: that of the coat's relief where there is a coat (it may
// turn away from the camera), else the smooth wall's. Needs truth.smooth_normal; NaN where there is none.
ImageF ShadingNormalMap(const Surface& surface, uint64_t surface_seed, const Vec3d& anchor_mm,
                        const Pose& world_from_camera, const FrameTruth& truth);

}  // namespace lumen
