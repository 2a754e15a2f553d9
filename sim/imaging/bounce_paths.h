// Paths from wall to wall, sixteen at a time: what light comes from where they first end up.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/far_ends.h"
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
  // The first of a walk's two. Chains count from 1 on.
  constexpr uint32_t Walk(int bounce) const { return WalkPair(bounce) + (first_ - 1); }

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

// The coat and tissue make a difference inside the loops and are template parameters.
template <bool kCoat, bool kTissue>
class BouncePaths {
 public:
  using Ends = FarEnds<kCoat, kTissue>;

  // guide_lobes: all, where there is tissue.
  BouncePaths(const PathScene& scene, const PathOptions& options, GuideLobes guide_lobes)
      : wall_(*scene.wall), options_(options), guide_lobes_(guide_lobes), finder_(scene) {
    if constexpr (kTissue) walks_.emplace(scene);
  }

  // Where the rays end and what of the guides' light is sent from there. Rays are counted.
  Ends End(const Eye& eye, const BounceStart& start, BouncePairs pairs, int64_t* rays) const {
    Ends ends;
    static_cast<Stop&>(ends) =
        StopAt(eye.time, start.on, start.origin, start.direction, start, pairs.Walk(1), rays);
    const GuideLight light = LightOfGuides(eye, ends, start, pairs.Guide(1), rays);
    if constexpr (kCoat && kTissue) {
      ends.base_from_guide = {light.toward, light.irradiance};
      ends.glint_from_guide = {light.glint.toward, light.glint.irradiance};
      ends.from_walls = {light.toward, Lanes3{}};
      ends.by_glint = LanesI{};
    } else if constexpr (kCoat) {
      ends.guide_lobes = guide_lobes_;
      ends.from_guide = {light.toward, light.irradiance};
      ends.from_walls = {light.toward, Lanes3{}};
    } else {
      ends.radiance = light.sent;
    }
    return ends;
  }

  // Adds the light that comes to the ends from other walls.
  void AddRest(const Eye& eye, const BounceStart& start, BouncePairs pairs, Ends* ends, int64_t* rays) const {
    Stop stop = *ends;
    Lanes3 throughput = Broadcast(Vec3f(1, 1, 1)), weight = start.weight, incoming{};
    for (int bounce = 2; bounce <= options_.bounces && Any(stop.places.alive); ++bounce) {
      const Leaving leaving = GoOn(start, pairs, bounce, stop, &throughput, &weight);
      if constexpr (kCoat) {
        if (bounce == 2) ends->from_walls.toward = leaving.direction;
        if constexpr (kTissue) {
          if (bounce == 2) ends->by_glint = leaving.by_glint;
        }
      }
      stop = StopAt(eye.time, leaving.on, leaving.origin, leaving.direction, start, pairs.Walk(bounce), rays);
      const GuideLight light = LightOfGuides(eye, stop, start, pairs.Guide(bounce), rays);
      incoming = incoming + Select(stop.places.alive, throughput * light.Whole(), Lanes3{});
    }
    if constexpr (kCoat) {
      ends->from_walls.light = incoming;
    } else {
      ends->radiance = ends->radiance + ends->lit().albedo * incoming;
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
    return finder_.Find(packet, *hits, true);
  }

 private:
  using Stop = PathPlaces<kCoat, kTissue>;

  Stop StopAt(float time, const LanesI& on, const Lanes3& origin, const Lanes3& direction,
              const BounceStart& start, uint32_t walk_pair, int64_t* rays) const {
    Stop stop;
    HitPacket hits;
    stop.places = Meet(time, on, origin, direction, &hits, rays);
    if constexpr (kTissue) {
      stop.entries = walks_->Entries(
          time, hits, stop.places, walk_pair, true, [&](int i) { return *start.samplers[i]; }, rays);
    }
    // A lobe is chosen as on an even wall, whether the walk got lost or not; but what carries much is
    // followed the more often, and whatever carries something may be.
    if constexpr (kCoat && kTissue) {
      stop.places.albedo = Max(walks_->EvenAlbedo(stop.places.albedo), stop.entries.albedo);
    }
    return stop;
  }

  // Of one of the guides in each lane; in tissue below a coat, one for each lobe.
  struct OneLobeOfGuide : ChosenLight {
    Lanes3 Whole() const { return sent; }
  };
  struct BothLobesOfGuide : ChosenLight {
    ChosenLight glint;
    Lanes3 Whole() const { return sent + glint.sent; }
  };
  using GuideLight = std::conditional_t<kCoat && kTissue, BothLobesOfGuide, OneLobeOfGuide>;

  GuideLight LightOfGuides(const Eye& eye, const Stop& stop, const BounceStart& start, uint32_t pair,
                           int64_t* rays) const {
    const auto from_one = [&](const PlacesOf<kCoat>& places, GuideLobes lobes, int number) {
      return LightFromOneGuide<kCoat>(wall_, eye, places, lobes, Numbers(start, places.alive, pair, number),
                                      rays);
    };
    if constexpr (kCoat && kTissue) {
      return {from_one(stop.entries, GuideLobes::kBase, 0), from_one(stop.places, GuideLobes::kGlint, 1)};
    } else {
      return {from_one(stop.lit(), guide_lobes_, 0)};
    }
  }

  static Lanes Numbers(const BounceStart& start, const LanesI& alive, uint32_t pair, int number) {
    Lanes numbers{};
    for (int i = 0; i < kLanes; ++i) {
      if (alive[i]) numbers[i] = start.samplers[i]->Pair(pair)[number];
    }
    return numbers;
  }

  // Rays on which paths go on from a stop.
  struct Leaving {
    LanesI on;
    Lanes3 origin, direction;
    LanesI by_glint;  // −1: from the places, by the coat's first lobe; set only in tissue below a coat
  };

  // The roulette ends some paths. throughput: what share of the light that comes along them reaches the ends,
  // without the ends' own lobe and, with a coat, the density of the direction there; weight: of what is seen.
  Leaving GoOn(const BounceStart& start, BouncePairs pairs, int bounce, const Stop& stop, Lanes3* throughput,
               Lanes3* weight) const {
    const PlacesOf<kCoat>& lit = stop.lit();
    Leaving leaving{kCoat ? stop.places.alive : lit.alive, {}, {}, {}};
    for (int i = 0; i < kLanes; ++i) {
      if (!leaving.on[i]) continue;
      const Sampler& sampler = *start.samplers[i];
      const Vec2f random = sampler.Pair(pairs.Direction(bounce));
      Vec3f factor = lit.albedo[i], toward;  // cosine-distributed: BRDF · cos / density is the albedo
      if constexpr (kCoat && kTissue) {
        const LobeStep step = ByOneLobe(stop, i, random, sampler.Pair(pairs.Roulette(bounce))[1]);
        leaving.by_glint[i] = step.by_glint ? -1 : 0;
        factor = step.factor;
        toward = step.toward;
        if (factor.isZero(0)) {
          leaving.on[i] = 0;
          continue;
        }
      } else if constexpr (kCoat) {
        const CoatedPlace place = lit.lanes()[i];
        // The roulette's second number is free to choose the lobe.
        toward = lit.coat->Sample(place, random, sampler.Pair(pairs.Roulette(bounce))[1]);
        const CoatLobes lobes = lit.coat->Eval(place, toward);
        factor = (lobes.base + Vec3f::Constant(lobes.glint)) / lit.coat->Pdf(place, toward);
      } else {
        toward = lambert::Sample(lit.normal[i], random);
      }
      Vec3f seen = (*weight)[i].cwiseProduct(factor);
      Vec3f passed = (*throughput)[i];
      if (bounce > 2) passed = passed.cwiseProduct(factor).eval();
      if (bounce > options_.roulette_after) {
        const float survival = std::min(1.0f, std::sqrt(seen.maxCoeff()));
        if (sampler.Pair(pairs.Roulette(bounce))[0] >= survival) leaving.on[i] = 0;
        passed /= survival;
        seen /= survival;
      }
      weight->Set(i, seen);
      throughput->Set(i, passed);
      leaving.direction.Set(i, toward);
    }
    if constexpr (kCoat && kTissue) {
      leaving.origin = OffsetOrigin(Select(leaving.by_glint, stop.places.point, lit.point),
                                    Select(leaving.by_glint, stop.places.normal, lit.normal));
    } else {
      leaving.origin = OffsetOrigin(lit.point, lit.normal);
    }
    return leaving;
  }

  // A direction of one of the lobes, and what the lobe sends on of the light that comes along it over the
  // density of lobe and direction; nothing where the walk got lost or the mirror direction is below the wall.
  struct LobeStep {
    Vec3f toward, factor;
    bool by_glint;
  };
  static LobeStep ByOneLobe(const PathPlaces<true, true>& stop, int lane, const Vec2f& random, float choice) {
    const Coat& coat = *stop.places.coat;
    const CoatedPlace place = stop.places.lanes()[lane];
    const float share = coat.GlintShare(place);
    if (choice < share) {
      const Coat::Glint glint = coat.SampleGlint(place, random);
      return {glint.incoming, Vec3f::Constant(glint.weight / share), true};
    }
    const CoatedPlace entry = stop.entries.lanes()[lane];
    if (entry.albedo.isZero(0)) return {Vec3f::Zero(), Vec3f::Zero(), false};
    const Vec3f toward = lambert::Sample(entry.normal, random);
    return {toward, entry.albedo * (coat.Transmission(entry, toward) / (1 - share)), false};
  }

  const RayScene& wall_;
  const PathOptions options_;
  const GuideLobes guide_lobes_;
  PlaceFinder<kCoat> finder_;
  std::optional<TissueWalks<kCoat>> walks_;
};

}  // namespace lumen
