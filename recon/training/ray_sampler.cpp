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
                   const std::vector<int>& along, const std::vector<float>& distance,
                   Field<float>::ValuePass* pass) {
  const size_t count = distance.size();
  pass->positions.Resize(3, TilesFor(static_cast<int>(count)));
  const size_t padded = size_t(pass->positions.tiles()) * kTile;
  size_t next = 0;
  for (size_t i = 0; i < padded; ++i) {
    const bool beyond = i >= count;  // the last tile is filled up with copies of the last
    const auto& ray = batch.rays[along[beyond ? (count - 1) % along.size() : next]];
    const float t = distance[beyond ? count - 1 : i];
    float* position = pass->positions.Column(i);
    for (int d = 0; d < 3; ++d) position[d * kTile] = ray.origin[d] + t * ray.direction[d];
    if (++next == along.size()) next = 0;
  }
  field.Value(parameters, pass);
}

}  // namespace lumen
