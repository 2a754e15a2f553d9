// Products of Bfloat16Kernels by tiles, sixteen rows of sixteen 32-bit numbers each, as AMX has them. Tiles
// is eight of them, of the calling thread:
//   Prepare()                 before any other
//   Load<t>(from, stride)     row r of t from `from` + r · stride, in 32-bit numbers
//   Store<t>(to, stride)      and back
//   AddProducts<c, a, b>()    c[i][j] += Σ_p a[i][p]₀ · b[p][j]₀ + a[i][p]₁ · b[p][j]₁: a and b hold pairs.
#pragma once

#include <cstring>
#include <type_traits>

#include "recon/network/bfloat16_loops.h"
#include "recon/network/row_blocks.h"

namespace lumen {

template <class Tiles, class Arithmetic>
struct Bfloat16TileLoops {
  using Loops = Bfloat16Loops<Arithmetic>;
  static constexpr int kEdge = 16;
  static constexpr int kWeights = 4, kInput = 5;  // tiles; those before are for the sums

  // Sixteen rows at the most of y = bias + weight · x, of which the first kVectors · 16 columns count. What
  // the tiles have beyond the rows and pairs there are is 0.
  template <int kVectors>
  static void MultiplyRows(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                           int rows, int pairs, const uint32_t* x, float* y) {
    alignas(64) float start[kEdge][kEdge] = {};
    for (int r = 0; bias && r < rows; ++r)
      for (float& value : start[r]) value = bias[r];
    ForVectors<kVectors>([&](auto v) { Tiles::template Load<v>(start, kEdge); });
    for (int first = 0; first < pairs; first += kEdge) {
      const int some = pairs - first < kEdge ? pairs - first : kEdge;
      LoadWeights(weight + first * pair_stride, row_stride, pair_stride, rows, some);
      const uint32_t* in = x + size_t(first) * kTile;
      alignas(64) uint32_t rest[kEdge][kTile];
      if (some < kEdge) {
        std::memset(rest, 0, sizeof(rest));
        in = static_cast<uint32_t*>(std::memcpy(rest, in, size_t(some) * sizeof(rest[0])));
      }
      ForVectors<kVectors>([&](auto v) {
        Tiles::template Load<kInput>(in + v * kEdge, kTile);
        Tiles::template AddProducts<v, kWeights, kInput>();
      });
    }
    alignas(64) float sum[kEdge][kTile];
    ForVectors<kVectors>([&](auto v) { Tiles::template Store<v>(&sum[0][v * kEdge], kTile); });
    std::memcpy(y, sum, size_t(rows) * sizeof(sum[0]));
  }

  static void Multiply(const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                       int rows, int pairs, const uint32_t* x, float* y) {
    Tiles::Prepare();
    for (int r = 0; r < rows; r += kEdge) {
      MultiplyRows<kTile / kEdge>(weight + r * row_stride, row_stride, pair_stride, bias ? bias + r : nullptr,
                                  rows - r < kEdge ? rows - r : kEdge, pairs, x, y + size_t(r) * kTile);
    }
  }

  static void AccumulateOuter(const float* y, int outputs, const float* x, int inputs, int tiles,
                              uint32_t* room, float* gradient) {
    Tiles::Prepare();
    alignas(64) uint32_t block[kTile / 2 * kTile];
    alignas(64) float sum[kEdge * kTile];
    for (int tile = 0; tile < tiles; ++tile) {
      Loops::PairColumns(outputs, kTile, y + size_t(tile) * outputs * kTile, room);
      for (int first = 0; first < inputs; first += kTile) {
        const int columns = Loops::TransposeBlock(x + size_t(tile) * inputs * kTile, inputs, first, block);
        for (int o = 0; o < outputs; o += kEdge) {
          const int rows = outputs - o < kEdge ? outputs - o : kEdge;
          WithConstantRows<kTile / kEdge>((columns + kEdge - 1) / kEdge, [&](auto vectors) {
            MultiplyRows<vectors>(room + size_t(o) * (kTile / 2), kTile / 2, 1, nullptr, rows, kTile / 2,
                                  block, sum);
          });
          for (int r = 0; r < rows; ++r) {
            float* to = gradient + size_t(o + r) * inputs + first;
            for (int i = 0; i < columns; ++i) to[i] += sum[r * kTile + i];
          }
        }
      }
    }
  }

  static constexpr Bfloat16Kernels kKernels = {&Loops::PairRows, &Loops::PairColumns, &Multiply,
                                               &AccumulateOuter};

 private:
  static void LoadWeights(const uint32_t* weight, size_t row_stride, size_t pair_stride, int rows,
                          int pairs) {
    const bool whole = rows == kEdge && pairs == kEdge;
    if (whole && pair_stride == 1) return Tiles::template Load<kWeights>(weight, row_stride);
    alignas(64) PairLanes block[kEdge] = {};
    if (whole && row_stride == 1) {
      for (int p = 0; p < kEdge; ++p) std::memcpy(&block[p], weight + p * pair_stride, sizeof(PairLanes));
      Loops::Transpose(block);
    } else {
      for (int r = 0; r < rows; ++r)
        for (int p = 0; p < pairs; ++p) block[r][p] = weight[r * row_stride + p * pair_stride];
    }
    Tiles::template Load<kWeights>(block, kEdge);
  }
  // body(v) with v as a constant, for v < kCount.
  template <int kCount, class Body>
  static void ForVectors(const Body& body) {
    if constexpr (kCount > 1) ForVectors<kCount - 1>(body);
    body(std::integral_constant<int, kCount - 1>());
  }
};

}  // namespace lumen
