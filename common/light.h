// Spotlight sources (SLS) of an endoscope and the irradiance they give: intensity · exp(−spread·(1 − D·L)) /
// d², with L the unit direction from source to point (Modrzejewski et al. 2020; calibrated for endoscopes in
// EndoMapper).
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "common/math.h"

namespace lumen {

// One light guide, in camera axes.
struct LightSource {
  Vec3d position = Vec3d::Zero();    // mm
  Vec3d direction = Vec3d::UnitZ();  // unit
  double spread = 0;                 // dimensionless; 0 = the same in all directions
  Vec3d intensity = Vec3d::Ones();   // mm², RGB: full scale times mm² on the axis
};

struct Light {
  std::vector<LightSource> sources;
  bool calibrated = true;  // false: intensities are relative only, their common scale is unknown
};

// EndoMapper's light of the scope that recorded C3VD; intensity 1.
Light EndomapperLight();

// The part of a source's irradiance that all channels share.
template <class T>
struct Irradiance {
  Vec3<T> toward;   // unit, from the point to the source
  T per_intensity;  // 1/mm²: exp(−spread·(1 − D·L)) / d², on a patch that faces the source
};

// At a point in the same axes as the source. A point on the source itself has no direction: toward is 0 and
// per_intensity infinite; callers that can get there must look.
template <class T>
Irradiance<T> IrradianceAt(const Vec3<T>& position, const Vec3<T>& direction, T spread,
                           const Vec3<T>& point) {
  const Vec3<T> to_source = position - point;
  const T squared = to_source.squaredNorm();
  if (squared == 0) return {Vec3<T>::Zero(), std::numeric_limits<T>::infinity()};
  const Vec3<T> toward = to_source / std::sqrt(squared);
  const T cos_angle = -direction.dot(toward);
  return {toward, std::exp(-spread * (1 - cos_angle)) / squared};
}

// The same pattern as directions to send light in: the integral of exp(−spread·(1 − cos)) over the sphere,
// sr.
inline double PatternSolidAngle(double spread) {
  return 2 * kPi * (spread > 0 ? -std::expm1(-2 * spread) / spread : 2.0);
}
// 1 − cos of a direction with a density in proportion to it, from a number in [0, 1): the inverse of its
// distribution function, within 0…2 to rounding.
inline double SamplePattern(double spread, double random) {
  return spread > 0 ? -std::log1p(random * std::expm1(-2 * spread)) / spread : 2 * random;
}

}  // namespace lumen
