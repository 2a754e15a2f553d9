// Places that paths from wall to wall come to, and the light that is sent from where they first end. Tissue
// under a coat has two: what the coat mirrors is sent on from the place itself, what is scattered below came
// in where a walk from there ends, and each path goes on from one of them.
#pragma once

#include "common/lanes.h"
#include "common/math.h"
#include "sim/imaging/coat.h"
#include "sim/imaging/guide_light.h"
#include "sim/imaging/places.h"

namespace lumen {

// Where paths come to the wall. lit(): where light comes in that is scattered towards them.
template <bool kCoat, bool kTissue>
struct PathPlaces {
  PlacesOf<kCoat> places;
  const PlacesOf<kCoat>& lit() const { return places; }
};

template <bool kCoat>
struct PathPlaces<kCoat, true> {
  PlacesOf<kCoat> places;   // with a coat their albedo is no more than what a lobe is chosen by
  PlacesOf<kCoat> entries;  // the ends of walks from there
  const PlacesOf<kCoat>& lit() const { return entries; }
};

// Light that comes to a place.
struct Arrival {
  Lanes3 toward;  // unit, from the place
  Lanes3 light;   // irradiance of a facing patch

  // One lane's in all lanes.
  Arrival Lane(int i) const { return {Broadcast(toward[i]), Broadcast(light[i])}; }
};

// What a coated wall sends towards unit directions above it, and the density with which a path from there
// would have gone on as this one did, 1/sr. of_walls is not over that density.
struct CoatedLight {
  Lanes3 of_guide, of_walls;
  Lanes density;

  Lanes3 Whole() const { return of_guide + Select(density > 0.0f, of_walls * (1.0f / density), Lanes3{}); }
};

// The wall's shape and coat at one lane's place, in all lanes.
inline CoatedPlaces CoatedLane(const CoatedPlaces& places, int i) {
  CoatedPlaces lane;
  lane.normal = Broadcast(places.normal[i]);
  lane.albedo = Broadcast(places.albedo[i]);
  lane.coat_normal = Broadcast(places.coat_normal[i]);
  lane.coat = places.coat;
  return lane;
}

// Where paths first end, and the light that is sent from there.
template <bool kCoat, bool kTissue>
struct FarEnds;

template <bool kTissue>
struct FarEnds<false, kTissue> : PathPlaces<false, kTissue> {
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
struct FarEnds<true, false> : PathPlaces<true, false> {
  Arrival from_guide;
  GuideLobes guide_lobes;  // that it goes through
  Arrival from_walls;  // along the path, whose direction was chosen with the coat's density (Coat::Pdf) for
                       // light that leaves for where the path came from: not over that density

  FarEnds Lane(int i) const {
    FarEnds lane;
    lane.places = CoatedLane(places, i);
    lane.from_guide = from_guide.Lane(i);
    lane.guide_lobes = guide_lobes;
    lane.from_walls = from_walls.Lane(i);
    return lane;
  }

  CoatedLight To(const Lanes3& direction) const {
    CoatedLanes seen{places.normal, places.albedo, direction, places.coat_normal, {}};
    seen.reflectance = places.coat->Reflectance(Dot(seen.coat_normal, direction));
    const Coat& coat = *places.coat;
    return {from_guide.light * (guide_lobes == GuideLobes::kBase ? coat.EvalBase(seen, from_guide.toward)
                                                                 : coat.EvalBoth(seen, from_guide.toward)),
            from_walls.light * coat.EvalBoth(seen, from_walls.toward), coat.Pdf(seen, from_walls.toward)};
  }

  // Towards where the paths came from.
  Lanes3 RadianceTo(const Lanes3& direction) const { return To(direction).Whole(); }
  LanesI Finite() const { return IsFinite(Sum(from_guide.light)) & IsFinite(Sum(from_walls.light)); }
};

template <>
struct FarEnds<true, true> : PathPlaces<true, true> {
  Arrival base_from_guide;   // to the entries
  Arrival glint_from_guide;  // to the places
  Arrival from_walls;        // to that of both that the path goes on from; not over its direction's density
  LanesI by_glint;           // −1: it goes on from the places

  FarEnds Lane(int i) const {
    FarEnds lane;
    lane.places = CoatedLane(places, i);
    lane.entries = CoatedLane(entries, i);
    lane.base_from_guide = base_from_guide.Lane(i);
    lane.glint_from_guide = glint_from_guide.Lane(i);
    lane.from_walls = from_walls.Lane(i);
    lane.by_glint = BroadcastI(by_glint[i]);
    return lane;
  }

  CoatedLight To(const Lanes3& direction) const {
    const Coat& coat = *places.coat;
    CoatedLanes mirror{places.normal, places.albedo, direction, places.coat_normal, {}};
    mirror.reflectance = coat.Reflectance(Dot(mirror.coat_normal, direction));
    // Light leaves the tissue evenly: towards all sides it came in at the same place.
    const CoatedLanes entry{entries.normal, entries.albedo, direction, entries.coat_normal,
                            mirror.reflectance};
    const Lanes share = coat.GlintShare(mirror), cosine = Dot(entry.normal, from_walls.toward);
    const Lanes glint = coat.EvalGlint(mirror, from_walls.toward);
    CoatedLight sent;
    sent.of_guide = base_from_guide.light * coat.EvalBase(entry, base_from_guide.toward) +
                    glint_from_guide.light * coat.EvalGlint(mirror, glint_from_guide.toward);
    sent.of_walls =
        from_walls.light * Select(by_glint, {glint, glint, glint}, coat.EvalBase(entry, from_walls.toward));
    sent.density = by_glint ? share * coat.GlintPdf(mirror, from_walls.toward)
                            : (1.0f - share) * Max(cosine, Lanes{}) * static_cast<float>(1 / kPi);
    return sent;
  }

  Lanes3 RadianceTo(const Lanes3& direction) const { return To(direction).Whole(); }
  LanesI Finite() const {
    return IsFinite(Sum(base_from_guide.light)) & IsFinite(Sum(glint_from_guide.light)) &
           IsFinite(Sum(from_walls.light));
  }
};

}  // namespace lumen
