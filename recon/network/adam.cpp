#include "recon/network/adam.h"

#include <cmath>

namespace lumen {
namespace {

// Below these a moment counts as 0: the first moves a parameter by less than rate · 10⁻³⁰/kLeastAdamEpsilon,
// the root of the second is a thousandth of kLeastAdamEpsilon. Entries of the tables that no ray has met for
// some hundred steps would otherwise decay into numbers below the normal ones and stay there, and processors
// compute with those a hundred times slower.
constexpr float kLeastFirst = 1e-30f, kLeastSecond = 1e-36f;

}  // namespace

AdamStep::AdamStep(double rate, int64_t step, double beta2, double epsilon)
    : rate(static_cast<float>(rate)),
      first_correction(static_cast<float>(1 / (1 - std::pow(kAdamBeta1, static_cast<double>(step))))),
      second_correction(static_cast<float>(1 / (1 - std::pow(beta2, static_cast<double>(step))))),
      beta2(static_cast<float>(beta2)),
      epsilon(static_cast<float>(epsilon)) {}

void AdamUpdate(const AdamStep& step, size_t count, float* __restrict parameter, float* __restrict gradient,
                float* __restrict first, float* __restrict second) {
  constexpr float b1 = kAdamBeta1;
  const float b2 = step.beta2;
  const float rate = step.rate * step.first_correction, epsilon = step.epsilon;
  for (size_t i = 0; i < count; ++i) {
    const float g = gradient[i];
    const float m = b1 * first[i] + (1 - b1) * g;
    const float v = b2 * second[i] + (1 - b2) * g * g;
    first[i] = std::abs(m) < kLeastFirst ? 0.0f : m;
    second[i] = v < kLeastSecond ? 0.0f : v;
    parameter[i] -= rate * m / (std::sqrt(v * step.second_correction) + epsilon);
    gradient[i] = 0;
  }
}

}  // namespace lumen
