// Paths from wall to wall, sixteen at a time: what light comes from where they first end up.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/guide_light.h"
#include "sim/imaging/path.h"
#include "sim/imaging/places.h"
#include "sim/imaging/sampler.h"
#include "sim/imaging/tissue_walks.h"

namespace lumen {

// Pairs of random numbers that a path uses, one of each a bounce (from 1). Chains that start at the same
// sample for different purposes start at different pairs.
class BouncePairs {
 public:
  explicit constexpr BouncePairs(uint32_t first) : first_(first) {}
  constexpr uint32_t Direction(int bounce) const { return Of(bounce, 0); }
  constexpr uint32_t Roulette(int bounce) const { return Of(bounce, 1); }
  constexpr uint32_t Guide(int bounce) const { return Of(bounce, 2); }

 private:
  constexpr uint32_t Of(int bounce, uint32_t use) const {
    return first_ + static_cast<uint32_t>(bounce - 1) * 3 + use;
  }
  uint32_t first_;
};

// Sixteen rays that leave the wall.
struct BounceStart {
  LanesI on{};
  Lanes3 origin{}, direction{};  // unit
  Lanes3 weight{};               // what share of the light that comes along them is seen, for the roulette
  std::optional<Sampler> samplers[kLanes];
};

// Where they end on the wall, and the light that is sent from there.
template <bool kCoat>
struct FarEnds;

template <>
struct FarEnds<false> {
  Places places;
  Places entries;   // where light comes in that leaves the places; set only where there is tissue
  Lanes3 radiance;  // to all sides

  // One lane's in all lanes.
  FarEnds Lane(int i) const {
    FarEnds lane;
    lane.radiance = Broadcast(radiance[i]);
    return lane;
  }
  Lanes3 RadianceTo(const Lanes3&) const { return radiance; }
};

template <>
struct FarEnds<true> {
  CoatedPlaces places;
  struct Arrival {
    Lanes3 toward;  // unit, from the place
    Lanes3 light;   // irradiance of a facing patch
  };
  Arrival from_guide;
  GuideLobes guide_lobes;  // that it goes through
  Arrival from_walls;  // along the path, whose direction was chosen with the coat's density (Coat::Pdf) for
                       // light that leaves for where the path came from: not over that density

  FarEnds Lane(int i) const {
    FarEnds lane;
    lane.places.normal = Broadcast(places.normal[i]);
    lane.places.albedo = Broadcast(places.albedo[i]);
    lane.places.coat_normal = Broadcast(places.coat_normal[i]);
    lane.places.coat = places.coat;
    const auto all = [&](const Arrival& arrival) {
      return Arrival{Broadcast(arrival.toward[i]), Broadcast(arrival.light[i])};
    };
    lane.from_guide = all(from_guide);
    lane.guide_lobes = guide_lobes;
    lane.from_walls = all(from_walls);
    return lane;
  }

  // What is sent towards unit directions above the wall, and the density with which a path from there would
  // have gone on as this one did, 1/sr.
  struct Sent {
    Lanes3 of_guide, of_walls;
    Lanes density;
  };
  Sent To(const Lanes3& direction) const {
    CoatedLanes seen{places.normal, places.albedo, direction, places.coat_normal, {}};
    seen.reflectance = places.coat->Reflectance(Dot(seen.coat_normal, direction));
    const Coat& coat = *places.coat;
    return {from_guide.light * (guide_lobes == GuideLobes::kBase ? coat.EvalBase(seen, from_guide.toward)
                                                                 : coat.EvalBoth(seen, from_guide.toward)),
            from_walls.light * coat.EvalBoth(seen, from_walls.toward), coat.Pdf(seen, from_walls.toward)};
  }

  // Towards where the paths came from.
  Lanes3 RadianceTo(const Lanes3& direction) const {
    const Sent sent = To(direction);
    return sent.of_guide + Select(sent.density > 0.0f, sent.of_walls * (1.0f / sent.density), Lanes3{});
  }
};

template <bool kCoat>
class BouncePaths {
 public:
  BouncePaths(const PathScene& scene, const PathOptions& options, GuideLobes guide_lobes)
      : wall_(*scene.wall), options_(options), guide_lobes_(guide_lobes), finder_(scene) {
    if (scene.surface->subsurface) walks_.emplace(scene);
  }

  // Where the rays end and what of the guides' light is sent from there. Rays are counted.
  FarEnds<kCoat> End(const Eye& eye, const BounceStart& start, BouncePairs pairs, int64_t* rays) const {
    FarEnds<kCoat> ends;
    HitPacket hits;
    ends.places = Meet(eye.time, start.on, start.origin, start.direction, &hits, rays);
    if constexpr (!kCoat) {
      if (walks_) ends.entries = Entries(eye.time, hits, ends.places, 1, start, rays);
    }
    const PlacesOf<kCoat>& lit = Lit(ends);
    const ChosenLight light = LightFromOneGuide<kCoat>(wall_, eye, lit, guide_lobes_,
                                                       Numbers(start, lit.alive, pairs.Guide(1)), rays);
    if constexpr (kCoat) {
      ends.guide_lobes = guide_lobes_;
      ends.from_guide = {light.toward, light.irradiance};
      ends.from_walls = {light.toward, Lanes3{}};
    } else {
      ends.radiance = light.sent;
    }
    return ends;
  }

  // Adds the light that comes to the ends from other walls.
  void AddRest(const Eye& eye, const BounceStart& start, BouncePairs pairs, FarEnds<kCoat>* ends,
               int64_t* rays) const {
    PlacesOf<kCoat> places = Lit(*ends);
    Lanes3 throughput = Broadcast(Vec3f(1, 1, 1)), weight = start.weight, incoming{};
    for (int bounce = 2; bounce <= options_.bounces && Any(places.alive); ++bounce) {
      const Lanes3 direction = NextDirections(start, pairs, bounce, &places, &throughput, &weight);
      if constexpr (kCoat) {
        if (bounce == 2) ends->from_walls.toward = direction;
      }
      HitPacket hits;
      places =
          Meet(eye.time, places.alive, OffsetOrigin(places.point, places.normal), direction, &hits, rays);
      if constexpr (!kCoat) {
        if (walks_) places = Entries(eye.time, hits, places, bounce, start, rays);
      }
      const ChosenLight light = LightFromOneGuide<kCoat>(
          wall_, eye, places, guide_lobes_, Numbers(start, places.alive, pairs.Guide(bounce)), rays);
      incoming = incoming + Select(places.alive, throughput * light.sent, Lanes3{});
    }
    if constexpr (kCoat) {
      ends->from_walls.light = incoming;
    } else {
      ends->radiance = ends->radiance + Lit(*ends).albedo * incoming;
    }
  }

  // The places that rays from the wall come to.
  PlacesOf<kCoat> Meet(float time, const LanesI& on, const Lanes3& origin, const Lanes3& direction,
                       HitPacket* hits, int64_t* rays) const {
    constexpr float kFar = 1e30f;
    RayPacket packet;
    Store3(origin, packet.origin);
    Store3(direction, packet.direction);
    packet.time = time;
    for (int i = 0; i < kLanes; ++i) {
      RayHit hit;
      if (on[i]) {
        hit = wall_.Intersect(origin[i], direction[i], 0, kFar, time);
        ++*rays;
      }
      hits->face[i] = hit.face;
      hits->t[i] = hit.t;
      hits->u[i] = hit.u;
      hits->v[i] = hit.v;
    }
    PlacesOf<kCoat> places = finder_.Find(packet, *hits, true);
    if (kCoat && walks_) places.albedo = walks_->EvenAlbedo(places.albedo);
    return places;
  }

 private:
  // Where paths go on to from places; those that the roulette ends are no longer alive. throughput: what
  // share of the light that comes along them reaches the ends, without the ends' own lobe and, with a coat,
  // the density of the direction there; weight: of what is seen.
  Lanes3 NextDirections(const BounceStart& start, BouncePairs pairs, int bounce, PlacesOf<kCoat>* places,
                        Lanes3* throughput, Lanes3* weight) const {
    Lanes3 direction{};
    for (int i = 0; i < kLanes; ++i) {
      if (!places->alive[i]) continue;
      const Sampler& sampler = *start.samplers[i];
      const Vec2f random = sampler.Pair(pairs.Direction(bounce));
      Vec3f factor = places->albedo[i], toward;  // cosine-distributed: BRDF · cos / density is the albedo
      if constexpr (kCoat) {
        const CoatedPlace place = places->lanes()[i];
        // The roulette's second number is free to choose the lobe.
        toward = places->coat->Sample(place, random, sampler.Pair(pairs.Roulette(bounce))[1]);
        const CoatLobes lobes = places->coat->Eval(place, toward);
        factor = (lobes.base + Vec3f::Constant(lobes.glint)) / places->coat->Pdf(place, toward);
      } else {
        toward = lambert::Sample(places->normal[i], random);
      }
      Vec3f seen = (*weight)[i].cwiseProduct(factor);
      Vec3f passed = (*throughput)[i];
      if (bounce > 2) passed = passed.cwiseProduct(factor).eval();
      if (bounce > options_.roulette_after) {
        const float survival = std::min(1.0f, std::sqrt(seen.maxCoeff()));
        if (sampler.Pair(pairs.Roulette(bounce))[0] >= survival) places->alive[i] = 0;
        passed /= survival;
        seen /= survival;
      }
      weight->Set(i, seen);
      throughput->Set(i, passed);
      direction.Set(i, toward);
    }
    return direction;
  }

  // Where light comes in that leaves the ends. Below a coat that is the ends themselves: its glints would
  // need a path of their own.
  const PlacesOf<kCoat>& Lit(const FarEnds<kCoat>& ends) const {
    if constexpr (!kCoat) {
      if (walks_) return ends.entries;
    }
    return ends.places;
  }

  Places Entries(float time, const HitPacket& hits, const Places& places, int bounce,
                 const BounceStart& start, int64_t* rays) const {
    return walks_->Entries(
        time, hits, places, bounce, [&](int i) { return *start.samplers[i]; }, rays);
  }

  static Lanes Numbers(const BounceStart& start, const LanesI& alive, uint32_t pair) {
    Lanes numbers{};
    for (int i = 0; i < kLanes; ++i) {
      if (alive[i]) numbers[i] = start.samplers[i]->Pair(pair)[0];
    }
    return numbers;
  }

  const RayScene& wall_;
  const PathOptions options_;
  const GuideLobes guide_lobes_;
  PlaceFinder<kCoat> finder_;
  std::optional<TissueWalks<kCoat>> walks_;
};

}  // namespace lumen
