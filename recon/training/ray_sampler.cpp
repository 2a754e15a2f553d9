#include "recon/training/ray_sampler.h"

#include <algorithm>
#include <limits>

#include "recon/training/importance.h"
#include "recon/training/march.h"

namespace lumen {

std::unique_ptr<RaySampler> MakeRaySampler(const TrainOptions::Sampling& options, const Field<float>* field) {
  if (options.kind == SamplerKind::kImportance) return std::make_unique<ImportanceSampler>(field);
  return std::make_unique<Marcher>(field);
}

float FarthestSample(const Eigen::AlignedBox3d& box, const Vec3f& origin, const Vec3f& direction) {
  float exit = std::numeric_limits<float>::max();
  for (int d = 0; d < 3; ++d) {
    if (direction[d] == 0) continue;
    const double wall = direction[d] > 0 ? box.max()[d] : box.min()[d];
    exit = std::min(exit, (static_cast<float>(wall) - origin[d]) / direction[d]);
  }
  return std::max(1.001f * exit, 2 * kNearest_mm);
}

void LookAlongRays(const Field<float>& field, const float* parameters, const RayBatch<float>& batch,
                   const std::vector<float>& distance, Field<float>::ValuePass* pass) {
  const int count = static_cast<int>(distance.size());
  const int rays = static_cast<int>(batch.rays.size());
  pass->positions.Resize(3, TilesFor(count));
  for (int i = 0; i < TilesFor(count) * kTile; ++i) {
    const int k = std::min(i, count - 1);
    const auto& ray = batch.rays[k % rays];
    for (int d = 0; d < 3; ++d) pass->positions.At(d, i) = ray.origin[d] + distance[k] * ray.direction[d];
  }
  field.Value(parameters, pass);
}

}  // namespace lumen
