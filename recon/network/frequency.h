// Frequency encoding (Mildenhall et al. 2020): sin(2ᵏ x_d), cos(2ᵏ x_d) for k = 0 … octaves − 1 and the three
// axes d. Nothing in it is learnt; its derivatives are its own rows.
#pragma once

#include "recon/network/panel.h"

namespace lumen {

template <class T>
class Frequency {
 public:
  explicit Frequency(int octaves) : octaves_(octaves) {}

  int outputs() const { return 6 * octaves_; }

  // x: 3 rows of one tile, dimensionless, the sphere of radius 1 being the scene's. encoding: outputs() rows,
  // three of sines, then three of cosines, an octave after the other.
  void Encode(const T* x, T* encoding) const;
  // gradient[d] += scale · Σ_r q[r] ∂encoding[r]/∂x_d. q: outputs() rows; gradient: 3 rows.
  void AddGradient(const T* encoding, const T* q, T scale, T* gradient) const;
  // change[r] = Σ_d ∂encoding[r]/∂x_d · direction[d]: the transpose.
  void Push(const T* encoding, const T* direction, T* change) const;

 private:
  int octaves_;
};

}  // namespace lumen
