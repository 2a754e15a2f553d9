// Subsurface scattering in packets of sixteen places: what the wall sends from there came in where walks
// through the tissue lead.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/path.h"
#include "sim/imaging/places.h"
#include "sim/imaging/sampler.h"
#include "sim/imaging/subsurface.h"

namespace lumen {

// The first of two pairs of random numbers of the walk after so many bounces: no other use of a sampler has
// pairs from here on but for the last of all.
constexpr uint32_t WalkPair(int bounce) { return (1u << 31) + 2 * static_cast<uint32_t>(bounce); }

template <bool kCoat>
class TissueWalks {
 public:
  // The scene's surface must have tissue.
  explicit TissueWalks(const PathScene& scene)
      : wall_(*scene.wall),
        tissue_(*scene.surface->subsurface),
        finder_(scene),
        even_(Broadcast(tissue_.EvenReflectance())) {
    const Vec3f palest = PalestAlbedo(*scene.surface);
    for (int c = 0; c < 3; ++c) per_palest_[c] = palest[c] > 0 ? 1 / palest[c] : 0.0f;
  }

  // Where light comes in that leaves the places, alive where there is such light. As albedo they have what
  // of it leaves there, RGB: what the walk carries, dimmed by the texture at both of its ends. The coat's
  // reflectance stays that of the places. time: of a wall that moves; pair: the first of two; bounced: paths
  // come there from the wall; sampler(i): lane i's; rays are counted.
  template <class Samplers>
  PlacesOf<kCoat> Entries(float time, const HitPacket& hits, const PlacesOf<kCoat>& places, uint32_t pair,
                          bool bounced, const Samplers& sampler, int64_t* rays) const {
    RayPacket onto{};
    onto.time = time;
    HitPacket ends{};
    Lanes3 weight{};
    for (int i = 0; i < kLanes; ++i) {
      ends.face[i] = kNoFace;
      if (!places.alive[i]) continue;
      const Vec3f normal = places.normal[i];
      const Sampler random = sampler(i);
      const WalkExit exit = tissue_.Walk(
          wall_, {hits.face[i], places.point[i], normal, lambert::Sample(-normal, random.Pair(pair)), time},
          Stream(random.Pair(pair + 1)), rays);
      if (!exit.found) continue;
      ends.face[i] = exit.hit.face;
      ends.u[i] = exit.hit.u;
      ends.v[i] = exit.hit.v;
      for (int d = 0; d < 3; ++d) {
        onto.origin[d][i] = exit.point[d];
        onto.direction[d][i] = -exit.normal[d];
      }
      weight.Set(i, exit.weight);
    }
    PlacesOf<kCoat> entries = finder_.Find(onto, ends, bounced);
    const Lanes3 both = places.albedo * entries.albedo;
    const auto dimmed = [](const Lanes& weight, const Lanes& both, float per_palest) {
      return weight * (Sqrt(both) * per_palest);
    };
    entries.albedo = {dimmed(weight.x, both.x, per_palest_[0]), dimmed(weight.y, both.y, per_palest_[1]),
                      dimmed(weight.z, both.z, per_palest_[2])};
    if constexpr (kCoat) entries.reflectance = places.reflectance;
    return entries;
  }

  // Albedo of a Lambertian wall that sends back as much as the tissue below a texture does, where it is even.
  Lanes3 EvenAlbedo(const Lanes3& texture) const {
    return {even_.x * (texture.x * per_palest_[0]), even_.y * (texture.y * per_palest_[1]),
            even_.z * (texture.z * per_palest_[2])};
  }

 private:
  // A stream of its own for each pair of numbers, which a pixel's samples don't have twice.
  static SampleStream Stream(const Vec2f& numbers) {
    return {std::bit_cast<uint32_t>(numbers[0]), std::bit_cast<uint32_t>(numbers[1]), 0};
  }

  const RayScene& wall_;
  const Subsurface& tissue_;
  const PlaceFinder<kCoat> finder_;
  const Lanes3 even_;
  Vec3f per_palest_;
};

}  // namespace lumen
