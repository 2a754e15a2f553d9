// Adam (Kingma and Ba 2015) over flat arrays.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lumen {

// Keeps 0/0 away from parameters that have never had a gradient. The smallest float gradient whose square is
// not lost is about 1e-22; a denominator this much smaller than any that counts leaves Adam scale-free, as
// hash tables with their tiny gradients need it (Müller et al. 2022).
inline constexpr double kLeastAdamEpsilon = 1e-15;

struct AdamStep {
  float rate;
  // 1/(1 − β₁ᵗ) and 1/(1 − β₂ᵗ) of step t = 1, 2, …
  float first_correction, second_correction;
  float beta2;
  // Added to the root of the second moment. With kLeastAdamEpsilon a step is as long whatever the gradient's
  // scale; gradients far below a larger one move next to nothing.
  float epsilon;

  AdamStep(double rate, int64_t step, double beta2, double epsilon = kLeastAdamEpsilon);
};

inline constexpr double kAdamBeta1 = 0.9;

// Moves parameters against their gradient and clears the gradient.
void AdamUpdate(const AdamStep& step, size_t count, float* parameter, float* gradient, float* first,
                float* second);

}  // namespace lumen
