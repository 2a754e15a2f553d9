// Origins of rays that leave a surface.
#pragma once

#include "common/lanes.h"

namespace lumen {

// The origins of rays that leave a surface at `points` to the side of `normals`: moved in units of the
// coordinates' own floating-point steps, so that the rays can't meet the surface that they leave (Wächter and
// Binder 2019, "A fast and robust method for avoiding self-intersection", Ray Tracing Gems ch. 6).
inline Lanes3 OffsetOrigin(const Lanes3& points, const Lanes3& normals) {
  // 256 steps of a coordinate's own floating point cover the rounding of the hit point and of the ray's
  // transform; below 1/32 of a mm, where such steps vanish, a fixed length takes over.
  constexpr float kScale = 256, kNearZero = 1.0f / 32, kFixed = 1.0f / 65536;
  const auto moved = [](const Lanes& point, const Lanes& normal) {
    // Without a sign: lanes that met nothing hold any normal, whose steps may be too many for one.
    const LanesU steps = (LanesU)Truncate(kScale * normal);
    const Lanes far = (Lanes)((LanesU)point + (point < 0.0f ? -steps : steps));
    return Abs(point) < kNearZero ? point + kFixed * normal : far;
  };
  return {moved(points.x, normals.x), moved(points.y, normals.y), moved(points.z, normals.z)};
}

inline Vec3f OffsetOrigin(const Vec3f& point, const Vec3f& normal) {
  return OffsetOrigin(Broadcast(point), Broadcast(normal))[0];
}

}  // namespace lumen
