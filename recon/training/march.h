// The guided sampler: a few look-ups of the signed distance find where the ray meets the
// surface, most samples go there, some in front of it.
#pragma once

#include <vector>

#include "recon/training/ray_sampler.h"

namespace lumen {

class Marcher : public RaySampler {
 public:
  explicit Marcher(const Field<float>* field) : field_(field) {}

  void Place(const float* parameters, const TrainOptions::Sampling& options, float sharpness, uint64_t key,
             RayBatch<float>* batch) override;

 private:
  struct Crossing {
    float inside, outside;              // distances with the surface between them
    float inside_value, outside_value;  // signed distances there
  };
  // Fills crossings_ with the first look-ups between which each ray leaves the lumen.
  void FindCrossings(const float* parameters, int looks, uint64_t key, const RayBatch<float>& batch);
  void NarrowCrossings(const float* parameters, const RayBatch<float>& batch);

  const Field<float>* field_;
  Field<float>::ValuePass pass_;
  std::vector<float> look_, far_, jitter_, placed_;
  std::vector<int> along_;  // rays that are looked along
  std::vector<Crossing> crossings_;
};

}  // namespace lumen
