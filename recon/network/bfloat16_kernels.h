// A layer's products (recon/network/product.h) with factors rounded to bfloat16 and sums in float, as the
// processor at hand computes them fastest. Two numbers that follow each other in a sum are a pair of 32 bits,
// the first in the lower half: the AVX512-BF16 instruction VDPBF16PS adds the products of sixteen such pairs
// at once, twice the work of a multiply-add in float; AMX's TDPBF16PS multiplies tiles of 16 × 16 pairs.
//
// Factors are rounded to nearest, ties to even: off by at most 2⁻⁸ of themselves. A product of two has 16
// bits and is exact in float, so what the sums are off by beyond that is float's rounding. AVX512-BF16 and
// AMX take numbers below the normal ones, 2⁻¹²⁶, for 0, as factors and as sums; the portable kernels keep
// them. The order of the additions, and whether there is a rounding between a pair's two, is the processor's.
#pragma once

#include <cstddef>
#include <cstdint>

#include "recon/network/panel.h"

namespace lumen {

constexpr int PairsFor(int numbers) { return (numbers + 1) / 2; }

struct Bfloat16Kernels {
  // Row-major, rows × columns, to PairsFor(rows) × columns: a row's numbers are paired with those of the next
  // row, the last row's with 0 if it has none.
  void (*pair_rows)(int rows, int columns, const float* from, uint32_t* pairs);
  // To rows × PairsFor(columns): a number is paired with the next one of its row.
  void (*pair_columns)(int rows, int columns, const float* from, uint32_t* pairs);
  // y[r] = bias[r] + Σ_p weight[r·row_stride + p·pair_stride] · x[p] for every sample of a tile; bias may be
  // null (0). x: pairs × kTile, y: rows × kTile.
  void (*multiply)(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias, int rows,
                   int pairs, const uint32_t* x, float* y);
  // gradient[o·inputs + i] += Σ_samples y[o] · x[i] over the tiles of two panels. room: outputs ×
  // PairsFor(kTile).
  void (*accumulate_outer)(const float* y, int outputs, const float* x, int inputs, int tiles, uint32_t* room,
                           float* gradient);
};

// Whether products of whole numbers, whose sums are exact in any order, are what they must be.
bool MultipliesRight(const Bfloat16Kernels& kernels);

const Bfloat16Kernels& PortableBfloat16Kernels();
// Null where the processor, or what this was compiled with, doesn't have these instructions.
const Bfloat16Kernels* Avx512Bfloat16Kernels();
// Nor where the system doesn't permit them.
const Bfloat16Kernels* UntriedAmxBfloat16Kernels();
// Nor where trial products are wrong.
const Bfloat16Kernels* AmxBfloat16Kernels();
const Bfloat16Kernels& FastestBfloat16Kernels();

}  // namespace lumen
