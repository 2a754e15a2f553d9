#include "recon/network/product.h"

#include <cstring>

#include "recon/network/row_blocks.h"

namespace lumen {
namespace {

// One vector register of the widest machine; narrower ones split it.
template <class T>
struct Lanes {
  typedef T Vector __attribute__((vector_size(64)));
  static constexpr int kCount = 64 / sizeof(T);
  static constexpr int kPerRow = kTile / kCount;
};

// The sum over a register's lanes, by halves: one after another each addition would wait for the one before.
template <class T>
T SumOfLanes(const typename Lanes<T>::Vector& lanes) {
  typedef T Half __attribute__((vector_size(32)));
  typedef T Quarter __attribute__((vector_size(16)));
  Half halves[2];
  std::memcpy(halves, &lanes, sizeof halves);
  const Half half = halves[0] + halves[1];
  Quarter quarters[2];
  std::memcpy(quarters, &half, sizeof quarters);
  const Quarter quarter = quarters[0] + quarters[1];
  if constexpr (sizeof(T) == 8) {
    return quarter[0] + quarter[1];
  } else {
    return (quarter[0] + quarter[2]) + (quarter[1] + quarter[3]);
  }
}

// The sum over the samples of a tile.
template <class T>
T SumOfRow(const T* row) {
  using Vector = typename Lanes<T>::Vector;
  Vector sum = {};
  for (int v = 0; v < Lanes<T>::kPerRow; ++v) sum += reinterpret_cast<const Vector*>(row)[v];
  return SumOfLanes<T>(sum);
}

// kRows rows of the result at a time: their sums stay in registers while the columns stream by.
template <class T, int kRows>
void MultiplyRows(const T* weight, size_t row_stride, size_t column_stride, const T* bias, int columns,
                  const T* x, T* y) {
  using Vector = typename Lanes<T>::Vector;
  constexpr int kVectors = Lanes<T>::kPerRow;
  Vector sum[kRows][kVectors];
  for (int r = 0; r < kRows; ++r)
    for (int v = 0; v < kVectors; ++v) sum[r][v] = Vector{} + (bias ? bias[r] : T(0));
  const Vector* in = reinterpret_cast<const Vector*>(x);
  for (int c = 0; c < columns; ++c, in += kVectors) {
    for (int r = 0; r < kRows; ++r) {
      const T w = weight[r * row_stride + c * column_stride];
      for (int v = 0; v < kVectors; ++v) sum[r][v] += w * in[v];
    }
  }
  Vector* out = reinterpret_cast<Vector*>(y);
  for (int r = 0; r < kRows; ++r)
    for (int v = 0; v < kVectors; ++v) out[r * kVectors + v] = sum[r][v];
}

// As many rows as leave registers for a column of the input, which comes in once for all of them.
constexpr int kMostRows = 6;

template <class T>
void MultiplyStrided(const T* weight, size_t row_stride, size_t column_stride, const T* bias, int rows,
                     int columns, const T* x, T* y) {
  ForRowBlocks<kMostRows>(rows, [&](auto count, int r) {
    MultiplyRows<T, count>(weight + r * row_stride, row_stride, column_stride, bias ? bias + r : nullptr,
                           columns, x, y + r * kTile);
  });
}

// Tiles of both panels that go through the second-level cache together.
constexpr size_t kGroupBytes = size_t(1) << 20;

struct TileRange {
  int begin, end;
};

template <class T, int kOutputs, int kInputs>
void AccumulateBlock(const Panel<T>& y, int first_output, const Panel<T>& x, int first_input, TileRange tiles,
                     T* gradient) {
  using Vector = typename Lanes<T>::Vector;
  constexpr int kVectors = Lanes<T>::kPerRow;
  Vector sum[kOutputs][kInputs] = {};
  for (int tile = tiles.begin; tile < tiles.end; ++tile) {
    const Vector* a = reinterpret_cast<const Vector*>(y.Row(tile, first_output));
    const Vector* b = reinterpret_cast<const Vector*>(x.Row(tile, first_input));
    for (int v = 0; v < kVectors; ++v)
      for (int o = 0; o < kOutputs; ++o)
        for (int i = 0; i < kInputs; ++i) sum[o][i] += a[o * kVectors + v] * b[i * kVectors + v];
  }
  for (int o = 0; o < kOutputs; ++o) {
    for (int i = 0; i < kInputs; ++i) {
      gradient[size_t(o) * x.rows() + i] += SumOfLanes<T>(sum[o][i]);
    }
  }
}

// From so many columns on the product goes by broadcasts, which need no sums across a register; below, what
// transposing costs and what is lost at the last block's end count for more.
constexpr int kWide = 64;

// Columns [first, first + kTile) of a tile's transpose: to[s · kTile + i] = x[first + i][s], 0 beyond the
// last.
template <class T>
void TransposeBlock(const Panel<T>& x, int tile, int first, T* to) {
  const int columns = std::min(kTile, x.rows() - first);
  for (int i = 0; i < columns; ++i) {
    const T* row = x.Row(tile, first + i);
    for (int s = 0; s < kTile; ++s) to[s * kTile + i] = row[s];
  }
  for (int i = columns; i < kTile; ++i)
    for (int s = 0; s < kTile; ++s) to[s * kTile + i] = 0;
}

// The same as AccumulateGroup for one tile.
template <class T>
void AccumulateWideTile(const Panel<T>& y, const Panel<T>& x, int tile, T* gradient) {
  alignas(64) T block[kTile * kTile];
  alignas(64) T sum[4 * kTile];
  for (int first = 0; first < x.rows(); first += kTile) {
    TransposeBlock(x, tile, first, block);
    const int columns = std::min(kTile, x.rows() - first);
    for (int o = 0; o < y.rows(); o += 4) {
      const int rows = std::min(4, y.rows() - o);
      MultiplyStrided<T>(y.Row(tile, o), kTile, 1, nullptr, rows, kTile, block, sum);
      for (int r = 0; r < rows; ++r) {
        T* to = gradient + size_t(o + r) * x.rows() + first;
        for (int i = 0; i < columns; ++i) to[i] += sum[r * kTile + i];
      }
    }
  }
}

template <class T>
void AccumulateGroup(const Panel<T>& y, const Panel<T>& x, TileRange tiles, T* gradient) {
  constexpr int kBlock = 4;
  const int outputs = y.rows();
  const int inputs = x.rows();
  for (int o = 0; o < outputs; o += kBlock) {
    WithConstantRows<kBlock>(std::min(kBlock, outputs - o), [&](auto rows) {
      for (int i = 0; i < inputs; i += kBlock) {
        WithConstantRows<kBlock>(std::min(kBlock, inputs - i), [&](auto columns) {
          AccumulateBlock<T, rows, columns>(y, o, x, i, tiles, gradient + size_t(o) * inputs + i);
        });
      }
    });
  }
}

}  // namespace

template <class T>
void Multiply(const T* weight, const T* bias, int outputs, int inputs, const T* x, T* y) {
  MultiplyStrided(weight, inputs, 1, bias, outputs, inputs, x, y);
}

template <class T>
void MultiplyTransposed(const T* weight, int outputs, int inputs, const T* y, T* x) {
  MultiplyStrided<T>(weight, 1, inputs, nullptr, inputs, outputs, y, x);
}

template <class T>
void AccumulateOuter(const Panel<T>& y, const Panel<T>& x, T* gradient, T* bias_gradient) {
  const int outputs = y.rows();
  if (x.rows() >= kWide) {
    for (int tile = 0; tile < y.tiles(); ++tile) AccumulateWideTile(y, x, tile, gradient);
  } else {
    const size_t tile_bytes = size_t(outputs + x.rows()) * kTile * sizeof(T);
    const int group = static_cast<int>(std::max<size_t>(1, kGroupBytes / tile_bytes));
    for (int begin = 0; begin < y.tiles(); begin += group)
      AccumulateGroup(y, x, {begin, std::min(begin + group, y.tiles())}, gradient);
  }
  if (bias_gradient) AccumulateRows(y, bias_gradient);
}

template <class T>
void AccumulateRows(const Panel<T>& y, T* sums) {
  for (int tile = 0; tile < y.tiles(); ++tile)
    for (int o = 0; o < y.rows(); ++o) sums[o] += SumOfRow(y.Row(tile, o));
}

#define LUMEN_INSTANTIATE(T)                                                  \
  template void Multiply<T>(const T*, const T*, int, int, const T*, T*);      \
  template void MultiplyTransposed<T>(const T*, int, int, const T*, T*);      \
  template void AccumulateOuter<T>(const Panel<T>&, const Panel<T>&, T*, T*); \
  template void AccumulateRows<T>(const Panel<T>&, T*);
LUMEN_INSTANTIATE(float)
LUMEN_INSTANTIATE(double)
#undef LUMEN_INSTANTIATE

}  // namespace lumen
