#include "recon/training/importance.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/random.h"
#include "recon/surface/volume.h"

namespace lumen {
namespace {

// What every section weighs besides its opacity, so that no ray is without a place to go to.
constexpr float kLeastWeight = 1e-5f;

}  // namespace

void ImportanceSampler::PlaceUniform(const float* parameters, int count, uint64_t key,
                                     const RayBatch<float>& batch) {
  const size_t rays = batch.rays.size();
  all_.resize(rays);
  std::iota(all_.begin(), all_.end(), 0);
  look_.resize(rays * count);
  for (size_t r = 0; r < rays; ++r) {
    const auto& ray = batch.rays[r];
    const float far = FarthestSample(field_->box(), ray.origin, ray.direction);
    const float jitter = UniformFloat(RandomBits(key, batch.first + r, 0));  // the whole ray's, as NeuS's
    for (int k = 0; k < count; ++k)
      look_[k * rays + r] = kNearest_mm + (far - kNearest_mm) * (k + jitter) / count;
  }
  LookAlongRays(*field_, parameters, batch, all_, look_, &pass_);
  samples_.resize(rays);
  for (size_t r = 0; r < rays; ++r) {
    samples_[r].clear();
    for (int k = 0; k < count; ++k)
      samples_[r].push_back({look_[k * rays + r], pass_.value.At(0, static_cast<int>(k * rays + r))});
  }
}

void ImportanceSampler::AddRound(const float* parameters, int count, float sharpness,
                                 const RayBatch<float>& batch) {
  const size_t rays = batch.rays.size();
  look_.resize(rays * count);
  for (size_t r = 0; r < rays; ++r) {
    const std::vector<Sample>& samples = samples_[r];
    const size_t sections = samples.size() - 1;
    weight_.resize(sections);
    float transmittance = 1, total = 0, last_cosine = 0;
    for (size_t i = 0; i < sections; ++i) {
      // The section as a plane through its middle, no less steep than the one before it: at a thin wall both
      // ends may lie in front of the surface's other side.
      const Sample &from = samples[i], &to = samples[i + 1];
      const float length = std::max(to.distance - from.distance, 1e-5f);
      const float cosine = (to.value - from.value) / length;
      const float steepest = std::clamp(std::min(cosine, last_cosine), -1e3f, 0.0f);
      last_cosine = cosine;
      const float middle = (from.value + to.value) / 2, half = steepest * length / 2;
      const float change = LogSigmoid(sharpness * (middle + half)) - LogSigmoid(sharpness * (middle - half));
      const float alpha = -std::expm1(std::min(change, 0.0f));
      const float opacity = alpha * transmittance;
      weight_[i] = (opacity > 0 ? opacity : 0) + kLeastWeight;  // written so that NaN weighs least
      total += weight_[i];
      transmittance *= 1 - alpha;
    }
    size_t section = 0;
    float before = 0;  // weight of the sections before
    for (int k = 0; k < count; ++k) {
      const float u = (k + 0.5f) / static_cast<float>(count) * total;
      while (section + 1 < sections && before + weight_[section] < u) before += weight_[section++];
      const float part = std::clamp((u - before) / weight_[section], 0.0f, 1.0f);
      const float start = samples[section].distance;
      look_[k * rays + r] = start + part * (samples[section + 1].distance - start);
    }
  }
  LookAlongRays(*field_, parameters, batch, all_, look_, &pass_);
  for (size_t r = 0; r < rays; ++r) {
    for (int k = 0; k < count; ++k)
      samples_[r].push_back({look_[k * rays + r], pass_.value.At(0, static_cast<int>(k * rays + r))});
    std::ranges::sort(samples_[r], {}, &Sample::distance);
  }
}

void ImportanceSampler::Place(const float* parameters, const TrainOptions::Sampling& options, float,
                              uint64_t key, RayBatch<float>* batch) {
  PlaceUniform(parameters, options.uniform, key, *batch);
  float sharpness = static_cast<float>(options.round_sharpness_per_mm);
  for (int round = 0; round < options.rounds; ++round, sharpness *= 2)
    AddRound(parameters, options.round, sharpness, *batch);
  batch->samples = options.PerRay();
  batch->distance.clear();
  for (size_t r = 0; r < batch->rays.size(); ++r) {
    for (const Sample& sample : samples_[r]) batch->distance.push_back(sample.distance);
    batch->rays[r].eikonal_sample =
        static_cast<int>(RandomBits(key, batch->first + r, 1) % uint64_t(batch->samples));
  }
}

}  // namespace lumen
