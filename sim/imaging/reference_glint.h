// The coat's first lobe as the plain tracer has it: from its formula's parts, sampled by all normals of the
// microsurface and not by the visible ones.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math.h"
#include "sim/imaging/coat.h"

namespace lumen {

// The coat's first lobe, F·D·G₂ / (4 (i·s)(o·s)) times i·s, by its parts.
template <class T>
class GlintLobe {
 public:
  explicit GlintLobe(const Coat& coat) : squared_(T(coat.alpha()) * T(coat.alpha())), ior_(coat.ior()) {}

  T Eval(const Vec3<T>& normal, const Vec3<T>& in, const Vec3<T>& out) const {
    const Vec3<T> half = (in + out).normalized();
    const T spread = 1 + (squared_ - 1) * half.dot(normal) * half.dot(normal);
    const T distribution = squared_ / (static_cast<T>(kPi) * spread * spread);
    return Fresnel(half.dot(out)) * distribution * Seen(normal, in, out) / (4 * out.dot(normal));
  }
  // A half vector with density D·(h·s) (Walter et al. 2007, eq. 35).
  Vec3<T> SampleHalf(const Vec3<T>& normal, const Vec2f& random) const {
    const T height = std::sqrt((1 - T(random[0])) / (1 + (squared_ - 1) * T(random[0])));
    const T radius = std::sqrt(1 - height * height), angle = static_cast<T>(2 * kPi) * T(random[1]);
    const Vec3<T> tangent = normal.unitOrthogonal(), bitangent = normal.cross(tangent);
    return (radius * std::cos(angle) * tangent + radius * std::sin(angle) * bitangent + height * normal)
        .normalized();
  }
  // The lobe over the density of directions that such half vectors mirror `out` to: D·(h·s) / (4 (o·h)).
  T Weight(const Vec3<T>& normal, const Vec3<T>& half, const Vec3<T>& in, const Vec3<T>& out) const {
    return Fresnel(half.dot(out)) * Seen(normal, in, out) * half.dot(out) /
           (out.dot(normal) * half.dot(normal));
  }

 private:
  // Of unpolarised light from air, by Snell's law.
  T Fresnel(T cosine) const {
    const T sine = std::sqrt(std::max(T(0), 1 - cosine * cosine)) / ior_,
            refracted = std::sqrt(1 - sine * sine);
    const T across = (cosine - ior_ * refracted) / (cosine + ior_ * refracted);
    const T along = (refracted - ior_ * cosine) / (refracted + ior_ * cosine);
    return (across * across + along * along) / 2;
  }
  // G₂, height-correlated (Heitz 2014, eq. 99).
  T Seen(const Vec3<T>& normal, const Vec3<T>& in, const Vec3<T>& out) const {
    return 1 / (1 + Lambda(in.dot(normal)) + Lambda(out.dot(normal)));
  }
  T Lambda(T cosine) const { return (std::sqrt(1 + squared_ * (1 / (cosine * cosine) - 1)) - 1) / 2; }

  T squared_, ior_;
};

}  // namespace lumen
