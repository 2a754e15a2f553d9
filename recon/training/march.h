// Where on its ray a pixel's samples go: a few look-ups of the signed distance find where the ray meets the
// surface, most samples go there, some in front of it.
#pragma once

#include <cstdint>

#include "recon/surface/field.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// Nearest place, mm, that a ray is sampled at: below it lie neither walls (an endoscope's own tip is wider)
// nor a 1/t² worth computing.
inline constexpr float kNearest_mm = 0.5f;

class Marcher {
 public:
  explicit Marcher(const Field<float>* field) : field_(field) {}

  // Fills batch->samples, distance and each ray's eikonal_sample. The jitter is a function of (key, ray's
  // place in the batch, sample).
  void Place(const float* parameters, const TrainOptions::Sampling& options, float sharpness, uint64_t key,
             RayBatch<float>* batch);

 private:
  struct Crossing {
    float inside, outside;              // distances with the surface between them
    float inside_value, outside_value;  // signed distances there
  };
  // Signed distances at one distance for each of `count` rays; distance[i] belongs to rays[i % rays].
  void Look(const float* parameters, const RayBatch<float>& batch, const std::vector<float>& distance);
  void FindCrossings(const float* parameters, const TrainOptions::Sampling& options, uint64_t key,
                     const RayBatch<float>& batch);

  const Field<float>* field_;
  Field<float>::ValuePass pass_;
  std::vector<float> look_, far_;
  std::vector<Crossing> crossings_;
};

}  // namespace lumen
