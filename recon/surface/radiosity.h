// Interreflection by radiosity: the wall around a camera as a few hundred Lambertian patches, one in each of
// the directions from the camera, and the light that these send each other.
#pragma once

#include <vector>

#include "common/math.h"

namespace lumen {

struct Patch {
  Vec3d point, normal;  // mm; unit, into the lumen
  double area_mm2;
  Vec3d albedo;
  Vec3d irradiance;  // from the light guides
};

// The irradiance, RGB, that each patch receives from all the others, bounced any number of times. Between two
// patches goes cosθ cosθ' A / (π d² + A) of what leaves a white one (a disc seen from its axis: never more
// than all), and where they would give a patch more than the whole hemisphere they are scaled to it. All
// patches are taken to see each other: they all see the camera. Albedos count as at most kPalest.
std::vector<Vec3d> InterreflectedIrradiance(const std::vector<Patch>& patches);

// An enclosure that swallowed nothing would shine without bound. At .95 it multiplies the first bounce by 20
// at most, and no mucosa is paler.
inline constexpr double kPalest = 0.95;

}  // namespace lumen
