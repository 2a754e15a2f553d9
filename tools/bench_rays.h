// What finding triangles alone costs here, for the path tracer's rates to be read against.
#pragma once

#include "common/ray_scene.h"
#include "sim/scene.h"

namespace lumen {

// Millions of rays a CPU second of one core.
struct RayRates {
  double primary = 0;  // a frame's, in packets of 16
  double shadow = 0;   // from where those end to one guide off the axis, in packets of 16
  double bounce = 0;   // from there on, cosine-distributed, one by one
};

// Through Embree and what little RayScene puts around it; rays are made beforehand. The first frame, medians
// of runs.
RayRates MeasureRays(const Scene& scene, const RayScene& wall, int runs);

}  // namespace lumen
