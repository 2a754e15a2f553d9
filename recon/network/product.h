// The three matrix products of a network's layer and the sum over samples, on panels. T = float or double.
#pragma once

#include "recon/network/panel.h"

namespace lumen {

// y[o] = bias[o] + Σ_i weight[o·inputs + i] · x[i] for every sample of a tile; bias may be null (0).
// weight: outputs × inputs, row-major; x: inputs × kTile; y: outputs × kTile.
template <class T>
void Multiply(const T* weight, const T* bias, int outputs, int inputs, const T* x, T* y);

// x[i] = Σ_o weight[o·inputs + i] · y[o]: the transposed product.
template <class T>
void MultiplyTransposed(const T* weight, int outputs, int inputs, const T* y, T* x);

// gradient[o·inputs + i] += Σ_samples y[o] · x[i] over all tiles; bias_gradient[o] += Σ_samples y[o], unless
// null.
template <class T>
void AccumulateOuter(const Panel<T>& y, const Panel<T>& x, T* gradient, T* bias_gradient);

// sums[o] += Σ_samples y[o] over all tiles.
template <class T>
void AccumulateRows(const Panel<T>& y, T* sums);

}  // namespace lumen
