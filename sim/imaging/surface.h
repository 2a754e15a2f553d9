// What the mucosa does with light: a Lambertian wall whose albedo is a solid texture of place, with blood
// vessels (vessels.h), or tissue below such a texture (subsurface.h), under a coat of mucus if there is one
// (coat.h).
#pragma once

#include <cstdint>
#include <optional>

#include "common/config.h"
#include "common/lanes.h"
#include "common/math.h"
#include "common/mesh.h"
#include "common/random.h"
#include "sim/imaging/coat.h"
#include "sim/imaging/subsurface.h"
#include "sim/imaging/vessels.h"

namespace lumen {

// Smooth variation of the albedo: every channel times exp(contrast · noise), noise within ±1.
struct Mottling {
  double contrast = 0.2;
  double scale_mm = 8;  // of its coarsest pattern
};

struct Surface {
  Vec3d albedo = Vec3d(0.80, 0.35, 0.30);
  std::optional<Mottling> mottling;
  std::optional<Vessels> vessels;
  std::optional<Coat> coat;
  std::optional<Subsurface> subsurface;
  std::optional<Coat> bounced_coat;  // that paths meet after a bounce; none: the same
};

// Reads the scene's [surface]; vessels grow on the resting wall, from a seed of their own.
Surface ReadSurface(const ConfigTable& surface, const Mesh& wall, uint64_t vessel_seed);

// The seed of the wall's texture in a render with this seed.
inline uint64_t SurfaceSeed(uint64_t seed) { return RandomBits(seed, 0x77616c6cull); }

// Smooth noise in ±1 at a point, period-free, a function of seed (Perlin 2002: gradients at the integer
// lattice, quintic interpolation).
float GradientNoise(uint64_t seed, const Vec3f& point);

// The noise fields of a surface have seeds of their own: mottling the surface's seed and the next, the coat's
// relief two from here on.
inline constexpr uint64_t kReliefSeeds = 4;

// The same in each lane, bit for bit.
Lanes GradientNoise(uint64_t seed, const Lanes3& points);
// Its gradient.
Lanes3 NoiseGradient(uint64_t seed, const Lanes3& points);

// Albedo at places, mm from the middle of the resting mesh's bounds (RayScene's local coordinates, so that a
// mesh far from the world's origin keeps its texture); each channel within [0, 1] (what a texture would lift
// above is cut). Places that lie close together are cheapest.
Lanes3 AlbedoAt(const Surface& surface, uint64_t seed, const Lanes3& places_mm);
// At one place.
Vec3f AlbedoAt(const Surface& surface, uint64_t seed, const Vec3f& place_mm);

// What the texture's albedo is at most, RGB.
Vec3f PalestAlbedo(const Surface& surface);

// Two directions that with a unit normal make right-handed axes (Duff et al. 2017, "Building an orthonormal
// basis, revisited").
struct TangentFrame {
  explicit TangentFrame(const Vec3f& normal);
  Vec3f tangent, bitangent;
};

// Lambert's lobe as the triple eval / sample / pdf. Directions point away from the surface, cosines are to
// its normal. The BRDF is albedo/π.
namespace lambert {
inline Vec3f Eval(const Vec3f& albedo) { return albedo * static_cast<float>(1 / kPi); }
inline float Pdf(float cosine) { return cosine > 0 ? cosine * static_cast<float>(1 / kPi) : 0.0f; }
// A direction about `normal` with density cos/π, from two numbers in [0, 1)².
Vec3f Sample(const Vec3f& normal, const Vec2f& random);
}  // namespace lambert

}  // namespace lumen
