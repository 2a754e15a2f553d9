// Adam (Kingma and Ba 2015) over flat arrays.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lumen {

struct AdamStep {
  float rate;
  // 1/(1 − β₁ᵗ) and 1/(1 − β₂ᵗ) of step t = 1, 2, …
  float first_correction, second_correction;
  float beta2;

  AdamStep(double rate, int64_t step, double beta2);
};

inline constexpr double kAdamBeta1 = 0.9;

// Moves parameters against their gradient and clears the gradient.
void AdamUpdate(const AdamStep& step, size_t count, float* parameter, float* gradient, float* first,
                float* second);

}  // namespace lumen
