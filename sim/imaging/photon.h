// A path of light from a guide, where it meets a wall that the camera sees.
#pragma once

#include "common/math.h"
#include "sim/imaging/coat.h"

namespace lumen {

// The place that the path comes from, and how it leaves it.
struct PhotonSource {
  Vec3f point;
  CoatedPlace place;  // outgoing: to where the path came from
  Vec3f power;        // that arrives there, mm² sr
  float level;        // the roulette lets a path that leaves with the power p go on at min(1, max(p) / level)
  bool by_glint;      // it leaves by the coat's first lobe alone
};

struct Photon {
  PhotonSource source;
  Vec3f point, normal, albedo, coat_normal;  // where it meets the wall, as a CoatedPlace's
  Vec2f position;                            // in the image, px
  int x, y;                                  // its pixel
};

// The factor by which the coat's first lobe weighs more along a path from the light, which place.outgoing
// points to, than along one from the viewer. For directions above wall and relief.
inline float GlintFromLight(const CoatedPlace& place, const Vec3f& toward) {
  return place.outgoing.dot(place.coat_normal) * toward.dot(place.normal) /
         (place.outgoing.dot(place.normal) * toward.dot(place.coat_normal));
}
inline Lanes GlintFromLight(const CoatedLanes& places, const Lanes3& toward) {
  return Dot(places.outgoing, places.coat_normal) * Dot(toward, places.normal) /
         (Dot(places.outgoing, places.normal) * Dot(toward, places.coat_normal));
}

}  // namespace lumen
