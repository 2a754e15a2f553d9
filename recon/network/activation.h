// What the hidden layers of a network do to their sums, with the first and second derivatives.
#pragma once

namespace lumen {

enum class Activation {
  kRelu,
  kSquareplus,  // (a + √(a² + b)) / 2, b = 0.01: ReLU with a bend of width 0.1 (Barron 2021)
  kSoftplus,    // log(1 + e^(βa)) / β, β = 100: NeuS's
};

// In place: `count` sums a become σ(a), a whole number of 64 of them, aligned to 64 bytes. slope = σ′ and
// bend = σ″, as many, may be null; bend only with slope.
template <class T>
void Activate(Activation activation, int count, T* a, T* slope, T* bend);

}  // namespace lumen
