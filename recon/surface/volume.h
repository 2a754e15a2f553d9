// NeuS's opacity along a ray (Wang et al. 2021, eq. 13) in logarithms: between two samples with signed
// distances f₀, f₁ and sharpness s, ℓ = min(0, logΦ(s·f₁) − logΦ(s·f₀)), α = −expm1(ℓ). No epsilon, no
// division by 1 − α.
#pragma once

#include <cmath>

namespace lumen {

// log(1/(1 + e^−x)) without overflow or cancellation.
template <class T>
T LogSigmoid(T x) {
  return x >= 0 ? -std::log1p(std::exp(-x)) : x - std::log1p(std::exp(x));
}

// 1/(1 + e^−x).
template <class T>
T Sigmoid(T x) {
  if (x >= 0) return 1 / (1 + std::exp(-x));
  const T e = std::exp(x);
  return e / (1 + e);
}

// Weights of the n samples of a ray: a section's opacity times the transmittance before it, half to each of
// its ends (the trapezoidal rule). What passes the last sample is the last one's: the wall is opaque, and a
// ray whose weights fell short of 1 would be dark in a way that only a nearer wall can mend, a force on every
// surface and always the same way. occupancy: n numbers Φ(−s·f), 1 deep in the wall; transmittance: n
// numbers, from 1 at the first sample to what passes the last.
template <class T>
void RayWeights(int n, const T* signed_distance, T sharpness, T* occupancy, T* transmittance, T* weight);

// The same but for how a section's opacity is shared between its ends: each gets what makes the sum over the
// samples the ray's integral where signed distance and colour change linearly from sample to sample. With m
// the mean over the section of Φ(s·f)/Φ(s·f₀), the nearer end has 1 − m and the farther m − Φ(s·f₁)/Φ(s·f₀);
// m is (log(1 + e^(s·f₀)) − log(1 + e^(s·f₁)))/(s·(f₀ − f₁)·Φ(s·f₀)), as ∫Φ = log(1 + e^x). The trapezoidal
// rule gives half of the faint front of a wall to the sample before it, however far in front that is: it
// looks nearer, hence brighter. near_share: n numbers, 1 − m of the section after each sample.
template <class T>
void LinearRayWeights(int n, const T* signed_distance, T sharpness, T* occupancy, T* transmittance,
                      T* near_share, T* weight);

// The gradient: distance_delta[i] = ∂loss/∂signed_distance[i], given weight_delta[i] = ∂loss/∂weight[i].
template <class T>
void RayWeightsBackward(int n, const T* signed_distance, T sharpness, const T* occupancy,
                        const T* transmittance, const T* weight_delta, T* distance_delta);
template <class T>
void LinearRayWeightsBackward(int n, const T* signed_distance, T sharpness, const T* occupancy,
                              const T* transmittance, const T* near_share, const T* weight_delta,
                              T* distance_delta);

}  // namespace lumen
