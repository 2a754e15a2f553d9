// Interreflection by radiosity: the wall around a camera as patches, one in each of the directions from the
// camera, and the light that these send each other.
#pragma once

#include <vector>

#include "recon/surface/gather.h"

namespace lumen {

// The irradiance, RGB, that each patch receives from all the others (Gather), bounced any number of times.
// Albedos count as at most kPalest.
std::vector<Vec3d> InterreflectedIrradiance(const std::vector<Patch>& patches);

// The same of many patches at the price of few: patch i is a part of group[i] (0 … groups − 1, none empty), and
// only the light that comes to a patch for the last time comes from single patches (compare Cohen et al. 1986,
// "An efficient radiosity approach for realistic image synthesis", where receivers alone are the finer ones).
// The last gathering is in float.
std::vector<Vec3d> InterreflectedIrradiance(const std::vector<Patch>& patches, const std::vector<int>& group,
                                            int groups);

// An enclosure that swallowed nothing would shine without bound. At .95 it multiplies the first bounce by 20
// at most, and no mucosa is paler.
inline constexpr double kPalest = 0.95;

}  // namespace lumen
