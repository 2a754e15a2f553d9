#include "recon/network/weight_norm.h"

#include <algorithm>
#include <cmath>

namespace lumen {
namespace {

template <class T>
T Dot(const T* a, const T* b, int size) {
  double sum = 0;
  for (int i = 0; i < size; ++i) sum += double(a[i]) * double(b[i]);
  return static_cast<T>(sum);
}

template <class T>
T Length(const T* v, int size) {
  return std::sqrt(Dot(v, v, size));
}

}  // namespace

template <class T>
void WeightNorm<T>::Initialise(T* learnt) const {
  for (size_t r = 0; r < rows_.size(); ++r)
    learnt[count_ + r] = Length(learnt + rows_[r].begin, rows_[r].size);
}

template <class T>
void WeightNorm<T>::Expand(const T* learnt, T* weights) const {
  std::copy(learnt, learnt + count_, weights);
  for (size_t r = 0; r < rows_.size(); ++r) {
    const T* v = learnt + rows_[r].begin;
    const T length = Length(v, rows_[r].size);
    // A row of zeros has no direction; it stays what it is.
    const T scale = length > 0 ? learnt[count_ + r] / length : T(0);
    for (int i = 0; i < rows_[r].size; ++i) weights[rows_[r].begin + i] = scale * v[i];
  }
}

template <class T>
void WeightNorm<T>::PullBack(const T* learnt, T* gradient) const {
  // ∂/∂g = G·v/|v|, ∂/∂v = g/|v| (G − (G·v/|v|) v/|v|), G = ∂loss/∂w.
  for (size_t r = 0; r < rows_.size(); ++r) {
    const T* v = learnt + rows_[r].begin;
    T* by_row = gradient + rows_[r].begin;
    const T length = Length(v, rows_[r].size);
    if (!(length > 0)) {
      std::fill(by_row, by_row + rows_[r].size, T(0));
      gradient[count_ + r] = 0;
      continue;
    }
    const T along = Dot(by_row, v, rows_[r].size) / length;
    const T scale = learnt[count_ + r] / length;
    for (int i = 0; i < rows_[r].size; ++i) by_row[i] = scale * (by_row[i] - along * v[i] / length);
    gradient[count_ + r] = along;
  }
}

template class WeightNorm<float>;
template class WeightNorm<double>;

}  // namespace lumen
