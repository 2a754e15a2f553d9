#include "recon/network/frequency.h"

#include <cmath>

namespace lumen {
namespace {

constexpr int kAxes = 3 * kTile;  // numbers in the three rows of a tile

}  // namespace

template <class T>
void Frequency<T>::Encode(const T* x, T* encoding) const {
  if (octaves_ == 0) return;
  for (int i = 0; i < kAxes; ++i) {
    encoding[i] = std::sin(x[i]);
    encoding[kAxes + i] = std::cos(x[i]);
  }
  for (int k = 1; k < octaves_; ++k) {
    // Doubled angles: each octave doubles the error of the one before it, 2ᵏ roundings, which is what x's own
    // rounding makes of sin(2ᵏ x) anyway.
    const T* sine = encoding + 2 * (k - 1) * kAxes;
    const T* cosine = sine + kAxes;
    T* next = encoding + 2 * k * kAxes;
    for (int i = 0; i < kAxes; ++i) {
      next[i] = 2 * sine[i] * cosine[i];
      next[kAxes + i] = 1 - 2 * sine[i] * sine[i];
    }
  }
}

template <class T>
void Frequency<T>::AddGradient(const T* encoding, const T* q, T scale, T* gradient) const {
  T slope = scale;
  for (int k = 0; k < octaves_; ++k, slope *= 2) {
    const T* sine = encoding + 2 * k * kAxes;
    const T* by_sine = q + 2 * k * kAxes;
    for (int i = 0; i < kAxes; ++i)
      gradient[i] += slope * (by_sine[i] * sine[kAxes + i] - by_sine[kAxes + i] * sine[i]);
  }
}

template <class T>
void Frequency<T>::Push(const T* encoding, const T* direction, T* change) const {
  T slope = 1;
  for (int k = 0; k < octaves_; ++k, slope *= 2) {
    const T* sine = encoding + 2 * k * kAxes;
    T* out = change + 2 * k * kAxes;
    for (int i = 0; i < kAxes; ++i) {
      out[i] = slope * direction[i] * sine[kAxes + i];
      out[kAxes + i] = -slope * direction[i] * sine[i];
    }
  }
}

template class Frequency<float>;
template class Frequency<double>;

}  // namespace lumen
