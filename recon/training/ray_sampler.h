// Where on its ray a pixel's samples go.
#pragma once

#include <cstdint>
#include <memory>

#include "recon/surface/field.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// Nearest place, mm, that a ray is sampled at: below it lie neither walls (an endoscope's own tip is wider)
// nor a 1/t² worth computing.
inline constexpr float kNearest_mm = 0.5f;

class RaySampler {
 public:
  virtual ~RaySampler() = default;

  // Fills batch->samples, distance and each ray's eikonal_sample. The jitter is a function of (key, ray's
  // number, sample).
  virtual void Place(const float* parameters, const TrainOptions::Sampling& options, float sharpness,
                     uint64_t key, RayBatch<float>* batch) = 0;
};

// The sampler that the options name.
std::unique_ptr<RaySampler> MakeRaySampler(const TrainOptions::Sampling& options, const Field<float>* field);

// Distance, mm, to where a ray is sampled at most: a little beyond the box, where the signed distance is
// negative for certain.
float FarthestSample(const Eigen::AlignedBox3d& box, const Vec3f& origin, const Vec3f& direction);

// Signed distances, in pass->value, at so many distances; distance[i] is along batch.rays[along[i % n]], n
// being the number of `along`.
void LookAlongRays(const Field<float>& field, const float* parameters, const RayBatch<float>& batch,
                   const std::vector<int>& along, const std::vector<float>& distance,
                   Field<float>::ValuePass* pass);

}  // namespace lumen
