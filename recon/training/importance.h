// NeuS's sampling of a ray: uniform samples, then rounds of importance samples, each drawn from the weights
// that the samples so far have at a sharpness that doubles from round to round.
#pragma once

#include <vector>

#include "recon/training/ray_sampler.h"

namespace lumen {

class ImportanceSampler : public RaySampler {
 public:
  explicit ImportanceSampler(const Field<float>* field) : field_(field) {}

  // The sharpness of the rounds is the options', not the loss's: the weights only say where to look.
  void Place(const float* parameters, const TrainOptions::Sampling& options, float sharpness, uint64_t key,
             RayBatch<float>* batch) override;

 private:
  struct Sample {
    float distance, value;  // mm
  };
  void PlaceUniform(const float* parameters, int count, uint64_t key, const RayBatch<float>& batch);
  void AddRound(const float* parameters, int count, float sharpness, const RayBatch<float>& batch);

  const Field<float>* field_;
  Field<float>::ValuePass pass_;
  std::vector<float> look_, weight_;
  std::vector<int> all_;                      // rays of the batch
  std::vector<std::vector<Sample>> samples_;  // a ray; by distance
};

}  // namespace lumen
