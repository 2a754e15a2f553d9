// What patches of the wall receive from each other, once: the form factors of radiosity and their sums.
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

// What share of what leaves `from` the irradiance at `to` has, if they see each other: cosθ cosθ' A /
// (π d² + A), a disc seen from its axis: never more than all. 0 where either is turned away, and of a patch for
// itself.
double FormFactor(const Patch& to, const Patch& from);

// The irradiance, RGB, that each patch receives from all others, of which `leaving` is sent (radiosity, a
// patch). All see each other: they all see the camera. Where they would give a patch more than the whole
// hemisphere they are scaled to it.
std::vector<Vec3d> Gather(const std::vector<Patch>& patches, const std::vector<Vec3d>& leaving);

// The same in float, sixteen patches at a time: for places up to some 100 mm apart within 2e-5 of it.
std::vector<Vec3d> GatherInLanes(const std::vector<Patch>& patches, const std::vector<Vec3d>& leaving);

}  // namespace lumen
