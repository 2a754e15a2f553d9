#include "recon/training/meet_surface.h"

#include <algorithm>

#include "recon/training/march.h"

namespace lumen {
namespace {

constexpr int kTilesAtOnce = 2;  // of the paper's networks 5 MB

void CopyTiles(const Panel<float>& from, int first, Panel<float>* to) {
  std::copy_n(from.Tile(0), from.tiles() * from.rows() * kTile, to->Tile(first));
}

}  // namespace

Panel<float> MeetSurface(const Field<float>& field, const float* parameters,
                         const TrainOptions::Sampling& sampling, uint64_t key, RayBatch<float>* batch) {
  constexpr float kSharp = 1e3f;  // 1/mm: the samples around the surface lie within a hundredth of a mm of it
  Marcher(&field).Place(parameters, sampling, kSharp, key, batch);
  const int rays = static_cast<int>(batch->rays.size());
  Panel<float> positions(3, TilesFor(rays));
  for (int r = 0; r < rays; ++r) {
    const auto& ray = batch->rays[r];
    const float t = batch->distance[size_t(r + 1) * batch->samples - 1];
    for (int d = 0; d < 3; ++d) positions.At(d, r) = ray.origin[d] + t * ray.direction[d];
  }
  return positions;
}

SurfaceMet LookAtSurface(const Field<float>& field, const float* parameters,
                         const TrainOptions::Sampling& sampling, uint64_t key, RayBatch<float>* batch) {
  const int rays = static_cast<int>(batch->rays.size()), tiles = TilesFor(rays);
  SurfaceMet met{MeetSurface(field, parameters, sampling, key, batch), Panel<float>(3, tiles),
                 Panel<float>(1, tiles), Panel<float>(3, tiles)};
  Field<float>::SurfacePass pass;
  for (int first = 0; first < tiles; first += kTilesAtOnce) {
    const int some = std::min(kTilesAtOnce, tiles - first);
    pass.positions.Resize(3, some);
    pass.directions.Resize(3, some);
    pass.normal.Resize(3, some);
    std::copy_n(met.positions.Tile(first), 3 * some * kTile, pass.positions.Tile(0));
    field.Surface(parameters, &pass);
    for (int i = 0; i < some * kTile; ++i) {
      const Vec3f gradient(pass.gradient.At(0, i), pass.gradient.At(1, i), pass.gradient.At(2, i));
      const Vec3f normal = gradient.normalized();
      const auto& ray = batch->rays[std::min(first * kTile + i, rays - 1)];
      for (int d = 0; d < 3; ++d) {
        pass.normal.At(d, i) = normal[d];
        pass.directions.At(d, i) = ray.direction[d];
      }
    }
    field.Color(parameters, &pass);
    CopyTiles(pass.gradient, first, &met.gradient);
    CopyTiles(pass.free, first, &met.free);
    CopyTiles(pass.color_output(), first, &met.color);
  }
  return met;
}

}  // namespace lumen
