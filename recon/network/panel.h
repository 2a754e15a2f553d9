// How the reconstructor lays out a batch of samples: tiles of 64 samples, in each tile a row of 64 numbers a
// feature. A row is a whole number of vector registers, so every kernel is a loop over rows without a
// remainder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <new>
#include <vector>

namespace lumen {

inline constexpr int kTile = 64;

// Tiles that hold `samples` samples.
constexpr int TilesFor(int samples) { return (samples + kTile - 1) / kTile; }

// Aligned to a cache line, which is also the widest vector register.
template <class T>
struct LineAllocator {
  using value_type = T;
  LineAllocator() = default;
  template <class U>
  LineAllocator(const LineAllocator<U>&) {}
  T* allocate(size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(64))); }
  void deallocate(T* p, size_t) { ::operator delete(p, std::align_val_t(64)); }
  bool operator==(const LineAllocator&) const { return true; }
};
template <class T>
using LineVector = std::vector<T, LineAllocator<T>>;

// [tile][row][kTile]
template <class T>
class Panel {
 public:
  Panel() = default;
  Panel(int rows, int tiles) { Resize(rows, tiles); }

  // Keeps no content; reuses memory.
  void Resize(int rows, int tiles) {
    rows_ = rows;
    tiles_ = tiles;
    const size_t size = size_t(rows) * tiles * kTile;
    if (data_.size() < size) data_.resize(size);
  }
  void SetZero() { std::fill(data_.begin(), data_.begin() + size_t(rows_) * tiles_ * kTile, T(0)); }

  int rows() const { return rows_; }
  int tiles() const { return tiles_; }
  T* Tile(int tile) { return data_.data() + size_t(tile) * rows_ * kTile; }
  const T* Tile(int tile) const { return data_.data() + size_t(tile) * rows_ * kTile; }
  T* Row(int tile, int row) { return Tile(tile) + size_t(row) * kTile; }
  const T* Row(int tile, int row) const { return Tile(tile) + size_t(row) * kTile; }
  // A sample's column, samples counted through all tiles: its number in row r is [r * kTile].
  T* Column(size_t sample) { return Tile(static_cast<int>(sample / kTile)) + sample % kTile; }
  const T* Column(size_t sample) const { return Tile(static_cast<int>(sample / kTile)) + sample % kTile; }
  // And one of its numbers.
  T& At(int row, int sample) { return Row(sample / kTile, row)[sample % kTile]; }
  T At(int row, int sample) const { return Row(sample / kTile, row)[sample % kTile]; }

 private:
  int rows_ = 0;
  int tiles_ = 0;
  LineVector<T> data_;
};

}  // namespace lumen
