#include "recon/surface/volume.h"

namespace lumen {

template <class T>
void RayWeights(int n, const T* signed_distance, T sharpness, T* occupancy, T* transmittance, T* weight) {
  // LogSigmoid(x) and Sigmoid(−x) by one exponential.
  const auto log_open = [&](int i) {
    const T x = sharpness * signed_distance[i];
    const T e = std::exp(-std::abs(x));
    occupancy[i] = x > 0 ? e / (1 + e) : 1 / (1 + e);
    return x >= 0 ? -std::log1p(e) : x - std::log1p(e);
  };
  T log_here = log_open(0);
  transmittance[0] = 1;
  weight[0] = 0;
  for (int i = 0; i + 1 < n; ++i) {
    const T log_next = log_open(i + 1);
    const T change = log_next < log_here ? log_next - log_here : T(0);
    const T section = -transmittance[i] * std::expm1(change);
    transmittance[i + 1] = transmittance[i] - section;
    weight[i] += section / 2;
    weight[i + 1] = section / 2;
    log_here = log_next;
  }
  weight[n - 1] += transmittance[n - 1];
}

template <class T>
void RayWeightsBackward(int n, const T* signed_distance, T sharpness, const T* occupancy,
                        const T* transmittance, const T* weight_delta, T* distance_delta) {
  // With w_i a section's weight and ℓ_i its logarithm: ∂w_i/∂ℓ_i = −transmittance behind it, ∂w_i/∂ℓ_j = w_i
  // for the sections j before it. dlogΦ(y)/dy = Φ(−y).
  T behind = transmittance[n - 1] * weight_delta[n - 1];  // Σ over the sections behind of weight · delta
  T from_next = 0;                                        // ∂loss/∂ℓ of the section after sample i
  for (int i = n - 1; i >= 0; --i) {
    T from_previous = 0;
    if (i > 0) {
      const T delta = (weight_delta[i - 1] + weight_delta[i]) / 2;
      if (signed_distance[i] < signed_distance[i - 1]) from_previous = behind - transmittance[i] * delta;
      behind += (transmittance[i - 1] - transmittance[i]) * delta;
    }
    distance_delta[i] = sharpness * occupancy[i] * (from_previous - from_next);
    from_next = from_previous;
  }
}

#define LUMEN_INSTANTIATE(T)                                 \
  template void RayWeights<T>(int, const T*, T, T*, T*, T*); \
  template void RayWeightsBackward<T>(int, const T*, T, const T*, const T*, const T*, T*);
LUMEN_INSTANTIATE(float)
LUMEN_INSTANTIATE(double)
#undef LUMEN_INSTANTIATE

}  // namespace lumen
