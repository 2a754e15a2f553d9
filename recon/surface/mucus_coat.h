// A coat of mucus over a diffuse wall: glints, and what the coat keeps from the wall below it. One coat for
// the whole wall, its numbers learnt with the wall. What a place sends to the camera of a guide's irradiance
// is
//
//   w F(h·v) D G₂ / (4 n·v) + albedo/π · n·l · (1 − w F(n·l)) (1 − w F(n·v))
//
// with l, v the directions to the guide and to the camera, h half-way between them, n the wall's normal and w
// the coat's weight. D and the height-correlated G₂ are GGX's with α = roughness² (Walter et al. 2007; Heitz
// 2014, "Understanding the masking-shadowing function", eq. 99), F is Schlick's approximation (1994) of a
// dielectric's reflectance. A relief that is finer than the learnt surface counts as roughness. Light from
// the rest of the wall has passed the coat once when it arrives, whose share is nearly the same everywhere
// and counts as albedo: times 1 − w F(n·v). What the coat sends to the rest of the wall is left out.
#pragma once

#include "common/math.h"

namespace lumen {

template <class T>
struct FrameLight;  // recon/surface/shading.h
template <class T>
struct Shading;

template <class T>
struct MucusCoat {
  T weight;     // 0 … 1
  T roughness;  // in (0, 1]
  T ior;        // > 1
};

// ∂radiance by the coat's numbers.
template <class T>
struct ByCoat {
  Vec3<T> weight = Vec3<T>::Zero(), roughness = Vec3<T>::Zero(), ior = Vec3<T>::Zero();
};

// As Shade's of a wall with an albedo, which it is exactly for a weight of 0.
template <class T>
Shading<T> ShadeCoated(const MucusCoat<T>& coat, const Vec3<T>& output, const Vec3<T>& normal,
                       const FrameLight<T>& light, const Vec3<T>& point, const Vec3<T>& ambient,
                       ByCoat<T>* by_coat);

// How a coat is learnt: by numbers without bounds, from which follow a weight within 0 … 1, a roughness
// within 0.15 … 1 (below that the lobe is narrower than learnt normals are sure) and, where it is learnt, an
// index within 1 … 2.
struct MucusCoatOptions {
  double ior = 1.33;  // its start, where it is learnt
  bool learn_ior = false;
};
inline int CoatParameters(const MucusCoatOptions& options) { return options.learn_ior ? 3 : 2; }
template <class T>
void InitialiseCoat(const MucusCoatOptions& options, T* parameters);
template <class T>
MucusCoat<T> LearntCoat(const MucusCoatOptions& options, const T* parameters);
// Adds the gradient by the parameters, given the loss's derivatives by the coat's numbers.
template <class T>
void LearntCoatBackward(const MucusCoatOptions& options, const T* parameters, const MucusCoat<T>& delta,
                        T* gradient);

}  // namespace lumen
