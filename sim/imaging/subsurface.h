// Effect: subsurface scattering, [surface.subsurface]: light that enters the wall at one place leaves it at
// another. A random walk through tissue of measured coefficients takes the place of the Lambertian wall's
// reflection on the spot.
//
//   absorption_per_mm  0.402, 0.746, 1.496  μa, RGB, at most 1000, a free path of 1 µm: finer than any mesh
//   scattering_per_mm  0.769, 0.864, 1.008  μs′, RGB, likewise: scattering reduced by its mean cosine
//
// The defaults are of human colon ex vivo: Marchesini et al. 1994, "Ex vivo optical properties of human colon
// tissue", Lasers Surg. Med. 15, 351: μa falls from 47.7 to 1.0 /cm and μs′ from 14.2 to 6.2 /cm over
// 300–800 nm. Those four figures are interpolated to 620, 540 and 450 nm, μa as an exponential and μs′ as a
// power of the wavelength (exponent −0.845). Perfused tissue differs by its blood: the 93 µM of haemoglobin,
// 67% of it oxygenated, that are known of the colon in vivo (Wang et al. 2009, Opt. Express 17, 2805) absorb
// 0.06, 1.1 and 1.6 /mm there.
//
// The walk. Tissue is behind the wall, the same everywhere and without end: walks may cross a fold and leave
// on its other side. Light enters in a cosine-distributed direction, scatters evenly in all directions
// (similarity: μs′ with an isotropic phase function stands for μs with a forward one) and leaves evenly in
// the sense of Lambert wherever it meets the wall from inside, without reflection there: the tissue's index
// is taken as that of what covers it. What a boundary to air does belongs to the coat (coat.h), whose formula
// counts what goes to and fro below it as the wall's. Rays are followed from the camera, so that the walk
// starts where the camera looks and leaves where the light came in; both ends are alike.
//
// A wall lit evenly then reflects 1 − 2 √(1 − a) ∫ H(μ) μ dμ, where a = μs′/(μa + μs′) and H is
// Chandrasekhar's function for isotropic scattering: the defaults give 0.23, 0.16, 0.11, that blood alone
// 0.54, 0.12, 0.10.
//
// In a picture the coefficients give the wall's colour. The surface's albedo tells no more than how its
// texture varies: relative to its palest place, its root dims the light on the way in and on the way out, so
// that a texture wide against the walks looks as on a Lambertian wall, and finer ones blur. A channel whose
// albedo is 0 stays black. Paths from wall to wall walk at every wall. What a coat mirrors doesn't walk:
// where a path comes to tissue under a coat it goes on either from the end of a walk or, mirrored, from the
// place.
//
// Three channels share a walk. Its free paths are those of a channel drawn by what each still carries, and
// all three are weighted by the mean density of the three choices (one-sample multiple importance sampling:
// Veach 1997, ch. 9; Wilkie et al. 2014, "Hero wavelength spectral sampling"): the sum over the channels
// never grows on the way.
//
// Russian roulette ends walks that carry little and, from 1024 steps on at each doubling, every second one.
// After 2^20 steps a walk is given up. On an even wall a walk without absorption takes more than n steps with
// probability 1.30/√n, so that this loses 0.13% of the light where μa = 0, and nothing worth naming where
// μa > 10⁻⁵ μs′.
#pragma once

#include <cstdint>

#include "common/config.h"
#include "common/math.h"
#include "common/random.h"
#include "common/ray_scene.h"

namespace lumen {

struct SubsurfaceOptions {
  Vec3d absorption_per_mm = Vec3d(0.402, 0.746, 1.496);
  Vec3d scattering_per_mm = Vec3d(0.769, 0.864, 1.008);
};

// Reads the scene's [surface.subsurface].
SubsurfaceOptions ReadSubsurface(const ConfigTable& subsurface);

// Where a walk starts. In the wall's local coordinates, mm.
struct WalkEntry {
  uint32_t face;
  Vec3f point;      // on the face
  Vec3f normal;     // of the face, to the lumen's side
  Vec3f direction;  // into the tissue, unit
  float time = 0;   // of a wall that moves
};

struct WalkExit {
  bool found;           // false: the light stays in the tissue, and weight is 0
  RayHit hit;           // of the wall
  Vec3f point, normal;  // as above
  Vec3f weight;         // RGB: on the average over walks, the share of the light that leaves
};

class Subsurface {
 public:
  explicit Subsurface(const SubsurfaceOptions& options);

  // The wall must be oriented. Random numbers: any dimension of the stream, which must be the walk's own.
  // Adds to the number of rays.
  WalkExit Walk(const RayScene& wall, const WalkEntry& entry, const SampleStream& random,
                int64_t* rays) const;

  // The share of the light, RGB, that an even wall sends back if it comes from all sides alike: the head's
  // formula.
  Vec3f EvenReflectance() const;

  // The walk's parts, for three channels of which each still carries `carried`. A length, mm, from two
  // numbers in [0, 1); infinite where the channel that `choice` draws has no extinction.
  float FreePath(const Vec3f& carried, float choice, float random) const;
  // What is carried after a collision at the end of a free path, and after meeting the wall sooner.
  void Scatter(float path_mm, Vec3f* carried) const;
  void Cross(float path_mm, Vec3f* carried) const;

 private:
  Vec3f scattering_, extinction_;  // 1/mm
};

}  // namespace lumen
