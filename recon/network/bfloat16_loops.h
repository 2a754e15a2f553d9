// The loops of Bfloat16Kernels over an arithmetic, which does with sixteen pairs at a time
//   Pair(low, high, to)           to[i] = the pair of low[i] and high[i], rounded, i < 16
//   PairNeighbours(from, to)      to[i] = that of from[2i] and from[2i + 1]
//   AddProducts(a, b, sum)        sum[i] += a[i]₀ · b[i]₀ + a[i]₁ · b[i]₁
// (recon/network/bfloat16_arithmetic.h).
#pragma once

#include <cstring>
#include <utility>

#include "recon/network/bfloat16_kernels.h"
#include "recon/network/row_blocks.h"

namespace lumen {

typedef float SumLanes __attribute__((vector_size(64)));
typedef uint32_t PairLanes __attribute__((vector_size(64)));
inline constexpr int kPairLanes = 16;

template <class Arithmetic>
struct Bfloat16Loops {
  static void PairRows(int rows, int columns, const float* from, uint32_t* pairs) {
    alignas(64) static constexpr float kZeros[kPairLanes] = {};
    for (int r = 0; r < rows; r += 2, pairs += columns) {
      const float* row = from + size_t(r) * columns;
      const bool single = r + 1 == rows;
      int c = 0;
      for (; c + kPairLanes <= columns; c += kPairLanes)
        Arithmetic::Pair(row + c, single ? kZeros : row + columns + c, pairs + c);
      if (c == columns) continue;
      const size_t rest = size_t(columns - c);
      alignas(64) float low[kPairLanes] = {}, high[kPairLanes] = {};
      alignas(64) uint32_t both[kPairLanes];
      std::memcpy(low, row + c, rest * sizeof(float));
      if (!single) std::memcpy(high, row + columns + c, rest * sizeof(float));
      Arithmetic::Pair(low, high, both);
      std::memcpy(pairs + c, both, rest * sizeof(uint32_t));
    }
  }

  static void PairColumns(int rows, int columns, const float* from, uint32_t* pairs) {
    const int all = PairsFor(columns);
    for (int r = 0; r < rows; ++r, from += columns, pairs += all) {
      int p = 0;
      for (; 2 * (p + kPairLanes) <= columns; p += kPairLanes)
        Arithmetic::PairNeighbours(from + 2 * p, pairs + p);
      if (p == all) continue;
      alignas(64) float some[2 * kPairLanes] = {};
      alignas(64) uint32_t both[kPairLanes];
      std::memcpy(some, from + 2 * p, size_t(columns - 2 * p) * sizeof(float));
      Arithmetic::PairNeighbours(some, both);
      std::memcpy(pairs + p, both, size_t(all - p) * sizeof(uint32_t));
    }
  }

  // x and y: rows of kTile, of which the first kVectors · 16 columns count.
  template <int kRows, int kVectors>
  static void MultiplyRows(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                           int pairs, const uint32_t* x, float* y) {
    SumLanes sum[kRows][kVectors];
    for (int r = 0; r < kRows; ++r)
      for (int v = 0; v < kVectors; ++v) sum[r][v] = SumLanes{} + (bias ? bias[r] : 0.0f);
    for (int p = 0; p < pairs; ++p) {
      const PairLanes* in = reinterpret_cast<const PairLanes*>(x + size_t(p) * kTile);
      for (int r = 0; r < kRows; ++r) {
        const PairLanes w = PairLanes{} + weight[r * row_stride + p * pair_stride];
        for (int v = 0; v < kVectors; ++v) Arithmetic::AddProducts(w, in[v], &sum[r][v]);
      }
    }
    for (int r = 0; r < kRows; ++r)
      for (int v = 0; v < kVectors; ++v) reinterpret_cast<SumLanes*>(y + r * kTile)[v] = sum[r][v];
  }

  // As many rows as leave registers for a row of the input, as in product.cpp.
  static constexpr int kMostRows = 6;

  template <int kVectors>
  static void MultiplyBlocks(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                             int rows, int pairs, const uint32_t* x, float* y) {
    ForRowBlocks<kMostRows>(rows, [&](auto count, int r) {
      MultiplyRows<count, kVectors>(weight + r * row_stride, row_stride, pair_stride,
                                    bias ? bias + r : nullptr, pairs, x, y + r * kTile);
    });
  }

  static void Multiply(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                       int rows, int pairs, const uint32_t* x, float* y) {
    MultiplyBlocks<kTile / kPairLanes>(weight, row_stride, pair_stride, bias, rows, pairs, x, y);
  }

  // Between rows r and r + kStep of a square of sixteen, whose transpose is made of these for all steps: what
  // lies across the diagonal of each square of 2 kStep changes places.
  template <int kStep, size_t... kLane>
  static void Exchange(PairLanes* row, std::index_sequence<kLane...>) {
    const PairLanes a = row[0], b = row[kStep];
    row[0] = __builtin_shufflevector(a, b, int(kLane & kStep ? kPairLanes + kLane - kStep : kLane)...);
    row[kStep] = __builtin_shufflevector(a, b, int(kLane & kStep ? kPairLanes + kLane : kLane + kStep)...);
  }
  template <int kStep>
  static void ExchangeAll(PairLanes* square) {
    for (int r = 0; r < kPairLanes; ++r)
      if (!(r & kStep)) Exchange<kStep>(square + r, std::make_index_sequence<kPairLanes>());
  }

  static void Transpose(PairLanes* square) {
    ExchangeAll<1>(square);
    ExchangeAll<2>(square);
    ExchangeAll<4>(square);
    ExchangeAll<8>(square);
  }

  // Columns [first, first + kTile) of a tile's transpose, a pair of samples a row: to[p · kTile + i] =
  // x[first + i] at samples 2p and 2p + 1, 0 beyond the last up to a whole vector. Returns how many columns
  // there are.
  static int TransposeBlock(const float* x, int inputs, int first, uint32_t* to) {
    const int columns = inputs - first < kTile ? inputs - first : kTile;
    for (int c = 0; c < columns; c += kPairLanes) {
      const int rows = columns - c < kPairLanes ? columns - c : kPairLanes;
      for (int p = 0; p < kTile / 2; p += kPairLanes) {
        PairLanes square[kPairLanes] = {};
        for (int r = 0; r < rows; ++r)
          Arithmetic::PairNeighbours(x + size_t(first + c + r) * kTile + 2 * p,
                                     reinterpret_cast<uint32_t*>(square + r));
        Transpose(square);
        for (int r = 0; r < kPairLanes; ++r)
          *reinterpret_cast<PairLanes*>(to + size_t(p + r) * kTile + c) = square[r];
      }
    }
    return columns;
  }

  // For one tile.
  template <int kVectors>
  static void AccumulateBlock(const uint32_t* y, int outputs, const uint32_t* block, int inputs, int columns,
                              float* gradient) {
    alignas(64) float sum[kMostRows * kTile];
    ForRowBlocks<kMostRows>(outputs, [&](auto count, int o) {
      MultiplyRows<count, kVectors>(y + o * (kTile / 2), kTile / 2, 1, nullptr, kTile / 2, block, sum);
      for (int r = 0; r < count; ++r) {
        float* to = gradient + size_t(o + r) * inputs;
        for (int i = 0; i < columns; ++i) to[i] += sum[r * kTile + i];
      }
    });
  }

  static void AccumulateOuter(const float* y, int outputs, const float* x, int inputs, int tiles,
                              uint32_t* room, float* gradient) {
    alignas(64) uint32_t block[kTile / 2 * kTile];
    for (int tile = 0; tile < tiles; ++tile) {
      PairColumns(outputs, kTile, y + size_t(tile) * outputs * kTile, room);
      for (int first = 0; first < inputs; first += kTile) {
        const int columns = TransposeBlock(x + size_t(tile) * inputs * kTile, inputs, first, block);
        WithConstantRows<kTile / kPairLanes>((columns + kPairLanes - 1) / kPairLanes, [&](auto vectors) {
          AccumulateBlock<vectors>(room, outputs, block, inputs, columns, gradient + first);
        });
      }
    }
  }

  static constexpr Bfloat16Kernels kKernels = {&PairRows, &PairColumns, &Multiply, &AccumulateOuter};
};

// Of bfloat16_avx512.cpp; null where it is compiled without these instructions.
extern const Bfloat16Kernels* const kAvx512Bfloat16Kernels;
// Of bfloat16_amx.cpp, for a processor that has them; null there likewise, or where the system doesn't
// permit.
const Bfloat16Kernels* PermittedAmxBfloat16Kernels();

}  // namespace lumen
