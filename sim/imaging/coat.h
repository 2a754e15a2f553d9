// Effect: a coat of mucus, [surface.coat]: glints that break up on a fine relief. A rough dielectric boundary
// lies over the Lambertian wall:
//
//   f = F·D·G₂ / (4 (i·s)(o·s)) + ρ/π · (1 − E(i·s)) (1 − E(o·s)) / (1 − Ē)
//
// with i, o the directions to the light and to the viewer, h = (i + o)/|i + o|, s the normal of the coat's
// relief. Both lobes are 0 where i or o is below the wall. What leaves the place is irradiance · (first lobe
// · (i·s) + second · (i·n)), n the wall's own normal.
//
//   ior               1.37  index of refraction, 1.33–1.40 for mucus and mucosa: F, Fresnel's reflectance
//   roughness         0.2   its square is GGX's α, the scale of the slopes that are too fine to be seen as
//                           relief. D and the height-correlated G₂: Walter et al. 2007; Heitz 2014,
//                           "Understanding the masking-shadowing function", eq. 99
//   relief_mm         0.5   length of the coarser waves of the relief; the finer ones are half as long and
//                           high
//   relief_height_mm  0.06  of the relief, which is noise within ± this height; s is the mesh's smooth
//                           normal, tilted by the relief's slope. 0 = no relief
//   bounced_roughness none  roughness that paths meet after their first bounce, in place of `roughness`
//
// Relief and roughness are chosen by eye: their glints look like those of C3VD's frames.
//
// With bounces, the light that a sharp lobe throws onto other walls is found by few paths from the camera,
// which are bright: white dots until there are many samples. light_paths.h traces it from the guides and has
// none, but not through a lens out of focus, a shutter or tissue, for a view below 0.25 sr or a single
// sample. For those, bounced_roughness widens the lobe for that light alone (Kaplanyan and Dachsbacher 2013,
// "Path space regularization"): it lands more evenly than it would, and is less by what single scattering in
// the wider lobe loses. Without it the picture is unbiased.
//
// Energy: E(c) is what the first lobe sends back at the cosine c, Ē = 2 ∫ E(c) c dc its mean. The second has
// what is left, shared out so that it stays reciprocal (Kelemen and Szirmay-Kalos 2001): with albedo 1 and no
// relief exactly everything comes back, and with any relief never more, since 1 − E falls with the angle to s
// and so its overlap with the cosine about n is largest where the two agree. ρ is the wall's albedo as seen
// through the coat: what goes to and fro between wall and coat is in it. What the first lobe loses by
// counting single reflections only (for F = 1 at 60°: 0.4% at α = 0.04, 14% at 0.25, 55% at 1) goes on to the
// second.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/config.h"
#include "common/lanes.h"
#include "common/math.h"

namespace lumen {

struct CoatOptions {
  double ior = 1.37;
  double roughness = 0.2;
  double relief_mm = 0.5;
  double relief_height_mm = 0.06;
  std::optional<double> bounced_roughness = std::nullopt;
};

// Reads the scene's [surface.coat].
CoatOptions ReadCoat(const ConfigTable& coat);

// Fresnel's reflectance of a dielectric for light that comes from air at a cosine within 0…1.
float FresnelDielectric(float ior, float cosine);

// The GGX microsurface; cosines are to its normal.
namespace ggx {
// Distribution of normals, 1/sr. sin_squared is given apart, because 1 − cosine² is lost in rounding where α
// is small.
float Distribution(float alpha, float cosine, float sin_squared);
// G₂ / (4 (i·s)(o·s)): finite unless both cosines are 0.
float Visibility(float alpha, float cos_in, float cos_out);
// Density of the directions into which visible normals reflect, 1/sr. cos_out > 0.
float ReflectedPdf(float alpha, float distribution, float cos_out);
// A visible normal from two numbers in [0, 1)² (Heitz 2018, "Sampling the GGX distribution of visible
// normals"). out: in the axes of which z is the microsurface's normal, z > 0.
Vec3f SampleVisibleNormal(float alpha, const Vec3f& out, const Vec2f& random);
}  // namespace ggx

// A place of the coated wall, as a ray meets it. Vectors are units.
struct CoatedPlace {
  Vec3f normal;       // of the wall, to the side that the ray came from
  Vec3f albedo;       // of the wall, seen through the coat
  Vec3f outgoing;     // to where the ray came from
  Vec3f coat_normal;  // of the relief; may turn away from `outgoing`: then there is no glint
  float reflectance;  // of the coat, towards `outgoing`
};

// BRDF times cosine, 1/sr, by lobe.
struct CoatLobes {
  Vec3f base;
  float glint;
};

// Sixteen coated places at once.
struct CoatedLanes {
  Lanes3 normal, albedo, outgoing, coat_normal;
  Lanes reflectance;
  CoatedPlace operator[](int lane) const {
    return {normal[lane], albedo[lane], outgoing[lane], coat_normal[lane], reflectance[lane]};
  }
};

struct CoatLobesLanes {
  Lanes3 base;
  Lanes glint;
};

class Coat {
 public:
  explicit Coat(const CoatOptions& options);

  // α; at least 1e-3. A narrower lobe would show a point source as its mirror image, a point of no size and
  // unbounded radiance; the guides themselves, half a mm across or more, spread the half vectors by more than
  // that at up to 250 mm.
  float alpha() const { return alpha_; }
  float ior() const { return ior_; }
  // E: 0…1; below the horizon as at it.
  float Reflectance(float cosine) const;
  float mean_reflectance() const { return mean_reflectance_; }

  Lanes Reflectance(const Lanes& cosine) const;

  // The relief's normals where the mesh has the smooth normals `smooth`; places: mm, as for AlbedoAt.
  Lanes3 ReliefNormal(uint64_t seed, const Lanes3& places_mm, const Lanes3& smooth) const;

  // Eval, sample, pdf, for incoming directions that point away from the surface.
  CoatLobes Eval(const CoatedPlace& place, const Vec3f& incoming) const;
  // The same in sixteen places at once, to rounding.
  CoatLobesLanes Eval(const CoatedLanes& places, const Lanes3& incoming) const;
  // One lobe alone, and the sum of both in each channel.
  Lanes EvalGlint(const CoatedLanes& places, const Lanes3& incoming) const;
  Lanes3 EvalBase(const CoatedLanes& places, const Lanes3& incoming) const;
  Lanes3 EvalBoth(const CoatedLanes& places, const Lanes3& incoming) const {
    const CoatLobesLanes lobes = Eval(places, incoming);
    return lobes.base + Lanes3{lobes.glint, lobes.glint, lobes.glint};
  }
  // What the coat lets by of light that the wall scatters, over that of a wall without one.
  float Transmission(const CoatedPlace& place, const Vec3f& incoming) const;
  Lanes Transmission(const CoatedLanes& places, const Lanes3& incoming) const;
  // How many of Sample's directions are the first lobe's: its part of what leaves the place.
  float GlintShare(const CoatedPlace& place) const;
  Lanes GlintShare(const CoatedLanes& places) const;
  float Pdf(const CoatedPlace& place, const Vec3f& incoming) const;
  Lanes Pdf(const CoatedLanes& places, const Lanes3& incoming) const;
  // SampleGlint's, before it leaves directions out.
  Lanes GlintPdf(const CoatedLanes& places, const Lanes3& incoming) const;
  // choice: in [0, 1), picks the lobe. The direction may be below the wall, where Eval is 0.
  Vec3f Sample(const CoatedPlace& place, const Vec2f& random, float choice) const;
  // A direction for the first lobe alone, and what that lobe sends on over the direction's density: at
  // most 1. No direction (weight 0) where it is below the wall or there is no glint.
  struct Glint {
    Vec3f incoming;
    float weight;
  };
  Glint SampleGlint(const CoatedPlace& place, const Vec2f& random) const;

 private:
  static constexpr int kEntries = 129;  // at equal steps of the cosine's root: E is smooth in it

  float GlintBrdf(const Vec3f& normal, const Vec3f& incoming, const Vec3f& outgoing) const;
  Vec3f Mirrored(const CoatedPlace& place, const Vec2f& random) const;
  float QuadratureOfReflectance(float cosine) const;

  float ior_, alpha_, relief_mm_, relief_height_mm_;
  std::array<float, kEntries> reflectance_;
  float mean_reflectance_;
};

}  // namespace lumen
