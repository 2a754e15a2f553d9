// Photons (light_paths.h) brought to the camera by the pixels of a tile together, as shared_paths.h does with
// paths from the camera. A photon that comes from the place y and meets the wall within the tile could as
// well have met it wherever else the tile's pixels look. Its power Φ at y goes to each place x_i that they
// see; a pixel's radiance gains
//
//   Φ f(y → x_i) g_i f_base(x_i) / Σ_j s_j g_j a_j,   g = V cos/d²,
//
// with f the lobes by which the path left y, times its cosine there, f_base what the wall below the coat
// sends towards the camera, s = min(q, max(Φ f)/level) the density 1/sr with which paths leave y and survive
// the roulette, and a the area of the wall, mm², that a px² of the image about x_j shows. In the photon's own
// pixel its place stands for the pixel's. That is without bias: each pixel's place is spread evenly over the
// pixel, and so is the photon's, given its pixel, but for its density s g a, which is then the numerator of
// Σ_j s_j g_j a_j over its own sum.
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "sim/imaging/eye.h"
#include "sim/imaging/path.h"
#include "sim/imaging/photon.h"
#include "sim/imaging/tile_shadows.h"

namespace lumen {

// A frame's photons, by the tiles that they are in, in a tile in their order.
class PhotonsOfTiles {
 public:
  PhotonsOfTiles(std::vector<Photon> photons, const TileGrid& grid)
      : photons_(std::move(photons)), order_(photons_.size()), begin_(size_t(grid.columns) * grid.rows + 1) {
    for (const Photon& photon : photons_) ++begin_[grid.Of(photon.x, photon.y) + 1];
    for (size_t tile = 1; tile < begin_.size(); ++tile) begin_[tile] += begin_[tile - 1];
    std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
    for (size_t i = 0; i < photons_.size(); ++i) {
      order_[next[grid.Of(photons_[i].x, photons_[i].y)]++] = static_cast<uint32_t>(i);
    }
  }

  bool Has(int tile) const { return begin_[tile] < begin_[tile + 1]; }
  template <class Visit>
  void ForEach(int tile, const Visit& visit) const {
    for (uint32_t i = begin_[tile]; i < begin_[tile + 1]; ++i) visit(photons_[order_[i]]);
  }

 private:
  const std::vector<Photon> photons_;
  std::vector<uint32_t> order_, begin_;
};

// A tile's pixels, for photons to be joined to.
class PhotonJoins {
 public:
  PhotonJoins(const PathScene& scene, const View& view, const Eye& eye, const TilePixels& pixels,
              TileSample<true>* tile)
      : scene_(scene),
        view_(view),
        eye_(eye),
        pixels_(pixels),
        tile_(*tile),
        shadows_(*scene.wall, eye.time, *tile) {}

  // x, y: positions in the image that a block's places are seen at.
  void SetPositions(int block, const Lanes& x, const Lanes& y) {
    const CoatedPlaces& places = tile_.places[block];
    for (int i = 0; i < kLanes; ++i) {
      if (places.alive[i])
        area_[block][i] = AreaPerPixel(Vec2f(x[i], y[i]), places.point[i], places.normal[i]);
    }
  }

  // Adds a photon's light to the tile's. Light that is not finite is added too.
  void Add(const Photon& photon, int64_t* rays) {
    const int own_x = photon.x - pixels_.x0, own_y = photon.y - pixels_.y0;
    const int own_block = own_y / kBlockEdge * kBlocksAcross + own_x / kBlockEdge;
    const int own_lane = own_y % kBlockEdge * kBlockEdge + own_x % kBlockEdge;
    // The photon's place stands for its pixel's.
    CoatedPlaces& own = tile_.places[own_block];
    const CoatedPlaces places_before = own;
    const Lanes area_before = area_[own_block];
    SetOwn(photon, own_lane, &own);
    area_[own_block][own_lane] = AreaPerPixel(photon.position, photon.point, photon.normal);

    const PhotonSource& source = photon.source;
    const CoatedLanes from = AllLanesOf(source.place);
    const Lanes3 point = Broadcast(source.point), ray_origin = OffsetOrigin(point, from.normal);
    Lanes3 light[kBlocks];
    LanesI joined[kBlocks];
    Lanes sum{};
    for (int block = 0; block < kBlocks; ++block) {
      const CoatedPlaces& seen = tile_.places[block];
      joined[block] = LanesI{};
      if (!Any(seen.alive)) continue;
      const Lanes3 to = seen.point - point;
      const Lanes squared = Dot(to, to), facing = -Dot(seen.normal, to);
      const Lanes3 direction = Normalized(to);
      const LanesI faces = seen.alive & (facing > 0.0f) & (Dot(direction, from.normal) > 0.0f);
      if (!Any(faces)) continue;
      Lanes density;
      const Lanes3 power = Leaving(source, from, direction, &density);
      const LanesI reached = faces & (density > 0.0f);
      if (!Any(reached)) continue;
      LanesI visible = ~shadows_.Hidden(ray_origin, block, reached, rays);
      if (block == own_block) visible[own_lane] = -1;
      joined[block] = reached & visible;
      const Lanes geometry = facing / (squared * Sqrt(squared));
      sum += joined[block] ? density * geometry * area_[block] : Lanes{};
      light[block] =
          power * seen.albedo * (geometry * seen.coat->Transmission(seen.lanes(), direction * Broadcast(-1)));
    }
    own = places_before;
    area_[own_block] = area_before;
    float total = 0;
    for (int i = 0; i < kLanes; ++i) total += sum[i];
    // Rounding can turn the photon's own place away; then nothing is reached.
    if (total == 0) return;
    for (int block = 0; block < kBlocks; ++block) {
      if (!Any(joined[block])) continue;
      tile_.indirect[block] =
          tile_.indirect[block] +
          Select(joined[block], light[block] * Broadcast(static_cast<float>(1 / kPi) / total), Lanes3{});
    }
  }

 private:
  static CoatedLanes AllLanesOf(const CoatedPlace& place) {
    return {Broadcast(place.normal), Broadcast(place.albedo), Broadcast(place.outgoing),
            Broadcast(place.coat_normal), Broadcast(place.reflectance)};
  }

  // Of a photon's power what leaves towards directions, per sr, and the density of the paths that do.
  Lanes3 Leaving(const PhotonSource& source, const CoatedLanes& from, const Lanes3& direction,
                 Lanes* density) const {
    const Coat& coat = scene_.surface->bounced_coat ? *scene_.surface->bounced_coat : *scene_.surface->coat;
    const CoatLobesLanes lobes = coat.Eval(from, direction);
    const Lanes glint = lobes.glint > 0.0f ? lobes.glint * GlintFromLight(from, direction) : Lanes{};
    Lanes3 sent = {glint, glint, glint};
    if (!source.by_glint) sent = sent + lobes.base;
    sent = sent * Broadcast(source.power);
    const Lanes chance = source.by_glint ? coat.GlintPdf(from, direction) : coat.Pdf(from, direction);
    *density = Min(chance, Max(sent.x, Max(sent.y, sent.z)) * (1 / source.level));
    return sent;
  }

  void SetOwn(const Photon& photon, int lane, CoatedPlaces* places) const {
    const Vec3f outgoing = (eye_.origin - photon.point).normalized();
    places->alive[lane] = -1;
    places->point.Set(lane, photon.point);
    places->normal.Set(lane, photon.normal);
    places->albedo.Set(lane, photon.albedo);
    places->coat_normal.Set(lane, photon.coat_normal);
    places->outgoing.Set(lane, outgoing);
    places->reflectance[lane] = scene_.surface->coat->Reflectance(outgoing.dot(photon.coat_normal));
    places->coat = &*scene_.surface->coat;
  }

  // Of the wall, mm², that a px² of the image shows.
  float AreaPerPixel(const Vec2f& position, const Vec3f& point, const Vec3f& normal) const {
    const Vec3f from_eye = point - eye_.origin;
    const float squared = from_eye.squaredNorm(), cosine = -from_eye.dot(normal) / std::sqrt(squared);
    // Rounding can turn a place that is seen edge-on away: no photon meets it.
    if (!(cosine > 0)) return 0;
    return squared /
           (cosine * view_.camera->AreaPerSteradian(position, eye_.rotation.transpose() * from_eye));
  }

  const PathScene& scene_;
  const View& view_;
  const Eye& eye_;
  const TilePixels& pixels_;
  TileSample<true>& tile_;
  const TileShadows shadows_;
  Lanes area_[kBlocks] = {};
};

}  // namespace lumen
