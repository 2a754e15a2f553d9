#include "recon/network/activation.h"

#include <algorithm>
#include <cmath>

#include "common/lanes.h"

namespace lumen {
namespace {

constexpr double kSquareplusBend = 0.01;
constexpr double kSoftplusBeta = 100;

template <class T>
void Relu(int count, T* a, T* slope, T* bend) {
  if (slope)
    for (int i = 0; i < count; ++i) slope[i] = a[i] > 0 ? T(1) : T(0);
  if (bend) std::fill(bend, bend + count, T(0));
  for (int i = 0; i < count; ++i) a[i] = a[i] > 0 ? a[i] : T(0);
}

template <class T>
void Squareplus(int count, T* a, T* slope, T* bend) {
  constexpr T b = T(kSquareplusBend);
  if (!slope) {
    for (int i = 0; i < count; ++i) a[i] = T(0.5) * (a[i] + std::sqrt(a[i] * a[i] + b));
  } else if (!bend) {
    for (int i = 0; i < count; ++i) {
      const T root = std::sqrt(a[i] * a[i] + b);
      slope[i] = T(0.5) + T(0.5) * a[i] / root;
      a[i] = T(0.5) * (a[i] + root);
    }
  } else {
    for (int i = 0; i < count; ++i) {
      const T root = std::sqrt(a[i] * a[i] + b);
      const T inverse = 1 / root;
      slope[i] = T(0.5) + T(0.5) * a[i] * inverse;
      bend[i] = T(0.5) * b * inverse * inverse * inverse;
      a[i] = T(0.5) * (a[i] + root);
    }
  }
}

// All from e = e^(−β|a|), which neither overflows nor cancels: σ = max(a, 0) + log(1 + e)/β, σ′ = 1/(1 + e)
// for a > 0, e/(1 + e) for a < 0, σ″ = β e/(1 + e)².
void Softplus(int count, double* a, double* slope, double* bend) {
  for (int i = 0; i < count; ++i) {
    const double e = std::exp(-kSoftplusBeta * std::abs(a[i]));
    const double inverse = 1 / (1 + e);
    if (slope) slope[i] = a[i] > 0 ? inverse : e * inverse;
    if (bend) bend[i] = kSoftplusBeta * e * inverse * inverse;
    a[i] = std::max(a[i], 0.0) + std::log1p(e) / kSoftplusBeta;
  }
}

// log(1 + e) = 2 artanh(z), z = e/(2 + e) ≤ 1/3, as a series; what is left out of it, 2 z¹⁵/15, is below
// 10⁻⁸.
Lanes Log1p(const Lanes& e) {
  const Lanes z = e / (e + 2.0f), q = z * z;
  Lanes series = q * (1 / 13.0f) + 1 / 11.0f;
  for (float term : {1 / 9.0f, 1 / 7.0f, 1 / 5.0f, 1 / 3.0f, 1.0f}) series = series * q + term;
  return 2.0f * z * series;
}

// Where β|a| is beyond this, 24 log 2, e is lost in 1 + e and counts as 0. Without this σ and σ′ would reach
// down to numbers below the normal ones, which processors compute with a hundred times slower.
constexpr float kVanishing = 16.635532f;

void Softplus(int count, float* a, float* slope, float* bend) {
  constexpr float beta = static_cast<float>(kSoftplusBeta);
  const Lanes zero = Broadcast(0);
  for (int i = 0; i < count; i += kLanes) {
    const Lanes x = Load(a + i);
    const Lanes y = beta * Abs(x);
    const Lanes e = y < kVanishing ? Exp(-y) : zero;
    const Lanes inverse = 1.0f / (e + 1.0f);
    if (slope) Store(x > zero ? inverse : e * inverse, slope + i);
    if (bend) Store(beta * e * inverse * inverse, bend + i);
    Store(Max(x, zero) + Log1p(e) * (1 / beta), a + i);
  }
}

}  // namespace

template <class T>
void Activate(Activation activation, int count, T* a, T* slope, T* bend) {
  switch (activation) {
    case Activation::kRelu:
      return Relu(count, a, slope, bend);
    case Activation::kSquareplus:
      return Squareplus(count, a, slope, bend);
    case Activation::kSoftplus:
      return Softplus(count, a, slope, bend);
  }
}

template void Activate<float>(Activation, int, float*, float*, float*);
template void Activate<double>(Activation, int, double*, double*, double*);

}  // namespace lumen
