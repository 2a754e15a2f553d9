#include "recon/training/march.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/random.h"

namespace lumen {
namespace {

constexpr int kSecantSteps = 3;

// Of the look-ups that find where a ray leaves the lumen: most rays have left it before the last ones.
constexpr int kLooksAtOnce = 4;

// The steepness, as |df/dt|, that spacing counts with: at grazing incidence the density's layer is longer
// along the ray than its width, but by no more than five times is it followed.
constexpr float kShallowest = 0.2f;

// Where the values at two distances, the former the larger, would be 0, as far as that is between them. The
// nearer distance where they aren't finite: distances stay in order whatever the field has become.
float ZeroBetween(float near, float far, float near_value, float far_value) {
  const float fall = near_value - far_value;
  const float zero = fall > 0 ? near + (far - near) * (near_value / fall) : near;
  return zero > near ? std::min(zero, far) : near;
}

}  // namespace

void Marcher::FindCrossings(const float* parameters, int looks, uint64_t key, const RayBatch<float>& batch) {
  const int rays = static_cast<int>(batch.rays.size());
  far_.resize(rays);
  jitter_.resize(rays);
  crossings_.resize(rays);
  along_.resize(rays);
  for (int r = 0; r < rays; ++r) {
    far_[r] = FarthestSample(field_->box(), batch.rays[r].origin, batch.rays[r].direction);
    jitter_[r] = UniformFloat(RandomBits(key, batch.first + r, 0));
    along_[r] = r;
  }
  for (int begin = 0; begin < looks && !along_.empty(); begin += kLooksAtOnce) {
    const int end = std::min(begin + kLooksAtOnce, looks);
    look_.clear();
    for (int k = begin; k < end; ++k) {
      for (int r : along_) {
        // Denser near the camera, where folds are seen thin; the last look-up is at the far end itself.
        const float u = k + 1 == looks ? 1.0f : (k + jitter_[r]) / (looks - 1);
        look_.push_back(kNearest_mm + (far_[r] - kNearest_mm) * u * std::sqrt(u));
      }
    }
    LookAlongRays(*field_, parameters, batch, along_, look_, &pass_);
    const size_t asked = along_.size();
    size_t still_open = 0;
    for (size_t i = 0; i < asked; ++i) {
      Crossing& c = crossings_[along_[i]];
      bool met = false;
      for (int k = begin; k < end && !met; ++k) {
        const size_t at = size_t(k - begin) * asked + i;
        const float value = *pass_.value.Column(at);
        c = {k > 0 ? c.outside : look_[at], look_[at], k > 0 ? c.outside_value : value, value};
        met = !(value > 0);
      }
      if (!met) along_[still_open++] = along_[i];
    }
    along_.resize(still_open);
  }
}

void Marcher::NarrowCrossings(const float* parameters, const RayBatch<float>& batch) {
  const int rays = static_cast<int>(batch.rays.size());
  along_.resize(rays);
  std::iota(along_.begin(), along_.end(), 0);
  look_.resize(rays);
  for (int step = 0; step < kSecantSteps; ++step) {
    for (int r = 0; r < rays; ++r) {
      const Crossing& c = crossings_[r];
      look_[r] = ZeroBetween(c.inside, c.outside, c.inside_value, c.outside_value);
    }
    LookAlongRays(*field_, parameters, batch, along_, look_, &pass_);
    for (int r = 0; r < rays; ++r) {
      Crossing& c = crossings_[r];
      const float value = pass_.value.At(0, r);
      if (value > 0) {
        c.inside = look_[r];
        c.inside_value = value;
      } else {
        c.outside = look_[r];
        c.outside_value = value;
      }
    }
  }
}

void Marcher::Place(const float* parameters, const TrainOptions::Sampling& options, float sharpness,
                    uint64_t key, RayBatch<float>* batch) {
  FindCrossings(parameters, options.coarse, key, *batch);
  NarrowCrossings(parameters, *batch);
  const int n = options.surface + options.spread;
  batch->samples = n;
  batch->distance.resize(batch->rays.size() * n);
  placed_.resize(n);
  for (size_t r = 0; r < batch->rays.size(); ++r) {
    const Crossing& c = crossings_[r];
    const float meets = ZeroBetween(c.inside, c.outside, c.inside_value, c.outside_value);
    const float gap = c.outside - c.inside, slope = (c.inside_value - c.outside_value) / gap;
    const float steepness = gap > 0 && slope < 1 ? std::max(slope, kShallowest) : 1.0f;
    const float spacing = static_cast<float>(options.surface_spacing) / (sharpness * steepness);
    float* distance = &batch->distance[r * n];
    const float last = std::clamp(meets + 0.5f * options.surface * spacing, 2 * kNearest_mm, far_[r]);
    for (int k = 0; k < options.surface; ++k) {
      const float jitter = UniformFloat(RandomBits(key, batch->first + r, 1 + k));
      const float t = meets + spacing * (k + jitter - 0.5f * options.surface);
      placed_[k] = std::clamp(t, kNearest_mm, far_[r]);
    }
    for (int k = 0; k < options.spread; ++k) {
      const float jitter = UniformFloat(RandomBits(key, batch->first + r, 1 + options.surface + k));
      placed_[options.surface + k] = kNearest_mm + (last - kNearest_mm) * (k + jitter) / options.spread;
    }
    const float eikonal =
        placed_[options.surface + RandomBits(key, batch->first + r, 1 + n) % options.spread];
    // Each kind is in order as it is made.
    std::merge(placed_.begin(), placed_.begin() + options.surface, placed_.begin() + options.surface,
               placed_.end(), distance);
    batch->rays[r].eikonal_sample =
        static_cast<int>(std::lower_bound(distance, distance + n, eikonal) - distance);
  }
}

}  // namespace lumen
