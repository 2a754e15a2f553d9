// Places on the wall in packets of sixteen, with what shading needs to know of them.
#pragma once

#include <type_traits>
#include <vector>

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/coat.h"
#include "sim/imaging/path.h"
#include "sim/imaging/surface.h"

namespace lumen {

// In the lanes that are not alive, values are those of a lane that is, so that they cost no extra cell of a
// texture; if none is, they are 0.
struct Places {
  LanesI alive;   // −1: a ray came to the wall
  Lanes3 point;   // RayScene's local coordinates
  Lanes3 normal;  // unit, to the side that the ray came from; 0 for a face without area
  Lanes3 albedo;
};

struct CoatedPlaces : Places {
  const Coat* coat;
  Lanes3 outgoing;     // to where the ray came from
  Lanes3 coat_normal;  // of the relief
  Lanes reflectance;   // of the coat, towards `outgoing`

  CoatedLanes lanes() const { return {normal, albedo, outgoing, coat_normal, reflectance}; }
};

template <bool kCoat>
using PlacesOf = std::conditional_t<kCoat, CoatedPlaces, Places>;

// Turns what rays meet into places.
template <bool kCoat>
class PlaceFinder {
 public:
  explicit PlaceFinder(const PathScene& scene) : scene_(scene) {}

  // Directions: unit; the rays' time is that of the hits. bounced: they come from the wall, not from the
  // camera.
  PlacesOf<kCoat> Find(const RayPacket& rays, const HitPacket& hits, bool bounced) const {
    PlacesOf<kCoat> places;
    places.alive = LoadI(hits.face) != static_cast<int32_t>(kNoFace);
    HitPacket known = hits;
    int model = 0;  // a lane that is alive
    if (Any(~places.alive)) {
      while (model < kLanes && !places.alive[model]) ++model;
      if (model == kLanes) {
        places.point = places.normal = places.albedo = Lanes3{};
        if constexpr (kCoat) {
          places.coat = &*scene_.surface->coat;
          places.outgoing = places.coat_normal = Lanes3{};
          places.reflectance = Lanes{};
        }
        return places;
      }
      for (int i = 0; i < kLanes; ++i) {
        if (places.alive[i]) continue;
        known.face[i] = hits.face[model];
        known.u[i] = hits.u[model];
        known.v[i] = hits.v[model];
      }
    }
    const Lanes3 direction = Load3(rays.direction);
    places.point = scene_.wall->Points(known, rays.time);
    const Lanes3 normal = scene_.wall->Normals(known, rays.time);
    const LanesI turned = Dot(normal, direction) > 0.0f;
    places.normal = Select(turned, normal * Broadcast(-1), normal);
    const Lanes3 resting = scene_.rest ? RestingPoints(known) : places.point;
    places.albedo = AlbedoAt(*scene_.surface, scene_.surface_seed, resting);
    if constexpr (kCoat) SetCoat(known, rays.time, direction, resting, bounced, &places);
    return places;
  }

 private:
  // Texture moves with the wall.
  Lanes3 RestingPoints(const HitPacket& hits) const {
    Lanes3 points;
    for (int i = 0; i < kLanes; ++i) {
      const Vec3i& corners = scene_.rest->faces[hits.face[i]];
      const double u = hits.u[i], v = hits.v[i];
      const Vec3d point = (1 - u - v) * scene_.rest->vertices[corners[0]] +
                          u * scene_.rest->vertices[corners[1]] + v * scene_.rest->vertices[corners[2]];
      points.Set(i, (point - scene_.rest_anchor).cast<float>());
    }
    return points;
  }

  // The coat lies on the smooth wall that the triangles stand for: its lobe is narrower than the angles
  // between them.
  void SetCoat(const HitPacket& hits, float time, const Lanes3& direction, const Lanes3& resting,
               bool bounced, CoatedPlaces* places) const {
    const Surface& surface = *scene_.surface;
    places->coat = bounced && surface.bounced_coat ? &*surface.bounced_coat : &*surface.coat;
    const auto [step, part] = scene_.wall->MomentOf(time);
    Lanes3 smooth = MeanNormals(hits, scene_.vertex_normals[step]);
    if (scene_.wall->moves()) {
      smooth = smooth + (MeanNormals(hits, scene_.vertex_normals[step + 1]) - smooth) * Broadcast(part);
    }
    const Lanes squared = Dot(smooth, smooth);
    smooth = Select(squared > 0.0f, smooth * (1.0f / Sqrt(squared)), places->normal);
    smooth = Select(Dot(smooth, places->normal) < 0.0f, smooth * Broadcast(-1), smooth);
    places->outgoing = direction * Broadcast(-1);
    places->coat_normal = places->coat->ReliefNormal(scene_.surface_seed, resting, smooth);
    places->reflectance = places->coat->Reflectance(Dot(places->coat_normal, places->outgoing));
  }

  // Of the corners; not unit.
  Lanes3 MeanNormals(const HitPacket& hits, const std::vector<Vec3d>& normals) const {
    const std::vector<Vec3i>& faces = scene_.wall->mesh().faces;
    Lanes3 means;
    for (int i = 0; i < kLanes; ++i) {
      const Vec3i& corners = faces[hits.face[i]];
      const double u = hits.u[i], v = hits.v[i];
      const Vec3d mean =
          (1 - u - v) * normals[corners[0]] + u * normals[corners[1]] + v * normals[corners[2]];
      means.Set(i, mean.cast<float>());
    }
    return means;
  }

  const PathScene scene_;
};

}  // namespace lumen
