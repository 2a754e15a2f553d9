// Light that comes from the guides to places on the wall and is sent on from there.
#pragma once

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/eye.h"
#include "sim/imaging/offset_origin.h"
#include "sim/imaging/places.h"

namespace lumen {

// Radiance, RGB, that leaves places towards where their rays came from.
struct PlainLobes {
  Lanes3 base;
  Lanes3 Whole() const { return base; }
};
struct CoatedLobes {
  Lanes3 base, glint;
  Lanes3 Whole() const { return base + glint; }
};
template <bool kCoat>
using LobesOf = std::conditional_t<kCoat, CoatedLobes, PlainLobes>;

// A guide's light as it comes to places.
struct Incidence {
  Lanes3 toward;        // unit, from the place to the guide
  Lanes per_intensity;  // 1/mm², on a patch that faces the guide
};

// common/light.h's IrradianceAt in lanes. A place on the guide itself has no direction: `toward` is not a
// number there, its cosine is above nothing, and no light is sent on.
inline Incidence IncidenceFrom(const Guide& guide, const Lanes3& point) {
  const Lanes3 to_guide = Broadcast(guide.position) - point;
  const Lanes squared = Dot(to_guide, to_guide);
  const Lanes3 toward = to_guide * (1.0f / Sqrt(squared));
  const Lanes cos_angle = -Dot(Broadcast(guide.direction), toward);
  return {toward, Exp(-guide.spread * (1.0f - cos_angle)) / squared};
}

// What the guide's light makes places send, shadows apart.
template <bool kCoat>
LobesOf<kCoat> Reflected(const Guide& guide, const Incidence& incidence, const PlacesOf<kCoat>& places) {
  const Lanes cosine = Dot(places.normal, incidence.toward);
  const LanesI lit = places.alive & (cosine > 0.0f);
  const Lanes3 intensity = Broadcast(guide.intensity);
  if constexpr (kCoat) {
    const CoatLobesLanes lobes = places.coat->Eval(places.lanes(), incidence.toward);
    const Lanes per_intensity = lit ? incidence.per_intensity : Lanes{};
    return {lobes.base * intensity * per_intensity, intensity * (per_intensity * lobes.glint)};
  } else {
    const Lanes irradiance = lit ? incidence.per_intensity * cosine : Lanes{};
    return {places.albedo * intensity * (irradiance * static_cast<float>(1 / kPi))};
  }
}

// Which lobes of the wall the guides' light is followed through where paths from the camera meet it. Without
// a coat there is one.
enum class GuideLobes { kAll, kBase, kGlint };

// Both lobes' sum, or one's alone.
template <bool kCoat>
Lanes3 Reflected(const Guide& guide, const Incidence& incidence, const PlacesOf<kCoat>& places,
                 GuideLobes lobes) {
  if constexpr (kCoat) {
    if (lobes != GuideLobes::kAll) {
      const LanesI lit = places.alive & (Dot(places.normal, incidence.toward) > 0.0f);
      const Lanes3 intensity = Broadcast(guide.intensity);
      const Lanes per_intensity = lit ? incidence.per_intensity : Lanes{};
      if (lobes == GuideLobes::kGlint) {
        return intensity * (per_intensity * places.coat->EvalGlint(places.lanes(), incidence.toward));
      }
      return places.coat->EvalBase(places.lanes(), incidence.toward) * intensity * per_intensity;
    }
  }
  return Reflected<kCoat>(guide, incidence, places).Whole();
}

// −1 in those of the asked lanes from whose place a guide can't be seen. For places close together. time: of
// a wall that moves.
inline LanesI Shadowed(const RayScene& wall, const Guide& guide, float time, const Places& places,
                       const LanesI& asked) {
  if (!Any(asked)) return LanesI{};
  const Lanes3 from = OffsetOrigin(places.point, places.normal);
  RayPacket rays;
  Store3(from, rays.origin);
  Store3(Broadcast(guide.position) - from, rays.direction);
  Store(Lanes{}, rays.tnear);
  Store(asked ? Broadcast(1) : Broadcast(-1), rays.tfar);
  rays.time = time;
  return wall.Occluded(rays);
}

// Light of one of the guides in each lane.
struct ChosenLight {
  Lanes3 sent;        // by the place to where its ray came from
  Lanes3 toward;      // the guide
  Lanes3 irradiance;  // on a patch that faces it
};

// What guides send to places and these send on, estimated without bias from one guide each, chosen by what it
// would make the place send if nothing stood in its way: guides lie close together, so that one shadow ray
// tells nearly as much as one to each. random: in [0, 1). A sum that isn't finite is passed on.
template <bool kCoat>
ChosenLight LightFromOneGuide(const RayScene& wall, const Eye& eye, const PlacesOf<kCoat>& places,
                              GuideLobes lobes, const Lanes& random, int64_t* rays) {
  Lanes sum{};
  for (const Guide& guide : eye.guides) {
    sum += Sum(Reflected<kCoat>(guide, IncidenceFrom(guide, places.point), places, lobes));
  }
  // Adds up in the order of `sum`, so that random < 1 finds a guide; where random · sum rounds up to sum, the
  // last that shines.
  Lanes below{}, chosen_sum{};
  LanesI found{};
  Lanes3 position{};
  ChosenLight light{};
  for (const Guide& guide : eye.guides) {
    const Incidence incidence = IncidenceFrom(guide, places.point);
    const Lanes3 candidate = Reflected<kCoat>(guide, incidence, places, lobes);
    const Lanes part = Sum(candidate);
    const LanesI taken = ~found & (part > 0.0f);
    below += part;
    light.sent = Select(taken, candidate, light.sent);
    light.toward = Select(taken, incidence.toward, light.toward);
    light.irradiance = Select(taken, Broadcast(guide.intensity) * incidence.per_intensity, light.irradiance);
    position = Select(taken, Broadcast(guide.position), position);
    chosen_sum = taken ? part : chosen_sum;
    found |= taken & (random * sum < below);
  }
  const Lanes3 from = OffsetOrigin(places.point, places.normal);
  Lanes share = chosen_sum > 0.0f ? sum / chosen_sum : Lanes{};
  for (int i = 0; i < kLanes; ++i) {
    if (!(chosen_sum[i] > 0)) continue;
    ++*rays;
    const Vec3f origin = from[i];
    if (wall.Occluded(origin, position[i] - origin, 0, 1, eye.time)) share[i] = 0;
  }
  const LanesI finite = IsFinite(sum);
  light.sent = Select(finite, light.sent * share, {sum, sum, sum});
  light.irradiance = Select(finite, light.irradiance * share, {sum, sum, sum});
  return light;
}

}  // namespace lumen
