#include "recon/network/grid.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "common/random.h"

namespace lumen {

template <class T>
struct Grid<T>::Cell {
  alignas(64) int32_t entry[8][kTile];  // corner c: bit d of c set = the upper corner along axis d
  alignas(64) T fraction[3][kTile];     // position within the cell, 0…1
};

// A number for each feature of each of the eight corners of a tile's cells.
template <class T>
struct Grid<T>::Corners {
  alignas(64) T value[kFeatures][8][kTile];
};

template <class T>
Grid<T>::Grid(const GridOptions& options, const Eigen::AlignedBox3d& box)
    : packed_(options.precision == Precision::kBfloat16 && std::is_same_v<T, float>) {
  for (int d = 0; d < 3; ++d) low_[d] = static_cast<T>(box.min()[d]);
  const double ratio = options.levels > 1 ? std::pow(options.finest_cell_mm / options.coarsest_cell_mm,
                                                     1.0 / (options.levels - 1))
                                          : 1.0;
  for (int l = 0; l < options.levels; ++l) {
    const double cell = options.coarsest_cell_mm * std::pow(ratio, l);
    Level level;
    level.inverse_cell = static_cast<T>(1 / cell);
    double points = 1;
    for (int d = 0; d < 3; ++d) {
      level.corners[d] = static_cast<int32_t>(std::ceil(box.sizes()[d] / cell)) + 1;
      points *= level.corners[d];
    }
    const double table = std::ldexp(1.0, options.log2_table_size);
    level.dense = points <= table;
    level.entries = static_cast<uint32_t>(level.dense ? points : table);
    level.offset = parameter_count_;
    parameter_count_ += size_t(level.entries) * kFeatures;
    levels_.push_back(level);
  }
}

template <class T>
void Grid<T>::Initialise(uint64_t seed, T* tables) const {
  for (size_t i = 0; i < parameter_count_; ++i) {
    tables[i] = static_cast<T>(1e-4 * (2 * UniformDouble(RandomBits(seed, i)) - 1));
  }
}

template <class T>
void Grid<T>::Pack(int level, const T* tables, T* packed) const {
  const T* from = tables + levels_[level].offset;
  char* to = reinterpret_cast<char*>(packed + levels_[level].offset);
  const size_t count = levels_[level].entries;
  uint32_t entries[kTile];
  for (size_t begin = 0; begin < count; begin += kTile) {
    const size_t some = std::min<size_t>(kTile, count - begin);
    for (size_t i = 0; i < some; ++i) {
      const T* entry = from + kFeatures * (begin + i);
      entries[i] = Bfloat16Of(static_cast<float>(entry[0])) | Bfloat16Of(static_cast<float>(entry[1])) << 16;
    }
    std::memcpy(to + begin * sizeof(uint32_t), entries, some * sizeof(uint32_t));
  }
}

template <class T>
void Grid<T>::Locate(const Level& level, const T* positions, Cell* cell) const {
  alignas(64) int32_t base[3][kTile];
  for (int d = 0; d < 3; ++d) {
    const int32_t last_cell = level.corners[d] - 2;
    for (int s = 0; s < kTile; ++s) {
      const T x = (positions[d * kTile + s] - low_[d]) * level.inverse_cell;
      int32_t i = static_cast<int32_t>(x);
      i = i < 0 ? 0 : i;
      i = i > last_cell ? last_cell : i;
      T fraction = x - static_cast<T>(i);
      fraction = fraction < 0 ? T(0) : fraction;
      fraction = fraction > 1 ? T(1) : fraction;
      base[d][s] = i;
      cell->fraction[d][s] = fraction;
    }
  }
  // What the lower and the upper corner along an axis bring to the place of an entry.
  alignas(64) uint32_t part[3][2][kTile];
  const uint32_t row = level.corners[0], slice = row * static_cast<uint32_t>(level.corners[1]);
  // The primes of Müller et al.
  const uint32_t factor[3] = {1, level.dense ? row : 2654435761u, level.dense ? slice : 805459861u};
  for (int d = 0; d < 3; ++d) {
    for (int s = 0; s < kTile; ++s) {
      part[d][0][s] = static_cast<uint32_t>(base[d][s]) * factor[d];
      part[d][1][s] = part[d][0][s] + factor[d];
    }
  }
  for (int c = 0; c < 8; ++c) {
    const uint32_t *x = part[0][c & 1], *y = part[1][(c >> 1) & 1], *z = part[2][c >> 2];
    if (level.dense) {
      for (int s = 0; s < kTile; ++s) cell->entry[c][s] = static_cast<int32_t>(x[s] + y[s] + z[s]);
    } else {
      const uint32_t mask = level.entries - 1;
      for (int s = 0; s < kTile; ++s) cell->entry[c][s] = static_cast<int32_t>((x[s] ^ y[s] ^ z[s]) & mask);
    }
  }
}

// kRun entries that lie side by side are moved as one: gather instructions fetch their numbers one by one,
// and are slow on processors that guard them against speculation. A dense level has both ends of each of a
// cell's edges along x side by side.
template <class T>
template <int kRun>
void Grid<T>::FetchRuns(const T* table, const Cell& cell, Corners* corners) {
  constexpr int kNumbers = kRun * kFeatures;
  alignas(64) T runs[kTile * kNumbers];
  for (int c = 0; c < 8; c += kRun) {
    for (int s = 0; s < kTile; ++s)
      std::memcpy(&runs[kNumbers * s], table + kFeatures * cell.entry[c][s], kNumbers * sizeof(T));
    for (int s = 0; s < kTile; ++s)
      for (int i = 0; i < kNumbers; ++i)
        corners->value[i % kFeatures][c + i / kFeatures][s] = runs[kNumbers * s + i];
  }
}

template <class T>
void Grid<T>::FetchPacked(const T* table, const Cell& cell, Corners* corners) {
  static_assert(kFeatures == 2);
  alignas(64) uint32_t entries[kTile];
  const char* bytes = reinterpret_cast<const char*>(table);
  for (int c = 0; c < 8; ++c) {
    for (int s = 0; s < kTile; ++s)
      std::memcpy(&entries[s], bytes + sizeof(uint32_t) * cell.entry[c][s], sizeof(uint32_t));
    for (int s = 0; s < kTile; ++s) {
      corners->value[0][c][s] = std::bit_cast<float>(entries[s] << 16);
      corners->value[1][c][s] = std::bit_cast<float>(entries[s] & 0xffff0000u);
    }
  }
}

// And the way back: table += numbers, for the first `samples` of the tile.
template <class T>
template <int kRun>
void Grid<T>::ScatterRuns(const Corners& corners, const Cell& cell, int samples, T* table) {
  constexpr int kNumbers = kRun * kFeatures;
  typedef T Run __attribute__((vector_size(kNumbers * sizeof(T))));
  alignas(64) T runs[8 / kRun][kTile * kNumbers];
  for (int r = 0; r < 8 / kRun; ++r) {
    for (int s = 0; s < kTile; ++s)
      for (int i = 0; i < kNumbers; ++i)
        runs[r][kNumbers * s + i] = corners.value[i % kFeatures][r * kRun + i / kFeatures][s];
  }
  for (int s = 0; s < samples; ++s) {
    for (int r = 0; r < 8 / kRun; ++r) {
      T* entry = table + kFeatures * cell.entry[r * kRun][s];
      Run sum, part;
      std::memcpy(&sum, entry, sizeof(Run));
      std::memcpy(&part, &runs[r][kNumbers * s], sizeof(Run));
      sum += part;
      std::memcpy(entry, &sum, sizeof(Run));
    }
  }
}

template <class T>
void Grid<T>::Fetch(const Level& level, const T* tables, const Cell& cell, Corners* corners) const {
  const T* table = tables + level.offset;
  if (packed_) return FetchPacked(table, cell, corners);
  level.dense ? FetchRuns<2>(table, cell, corners) : FetchRuns<1>(table, cell, corners);
}

template <class T>
void Grid<T>::Scatter(const Level& level, const Corners& corners, const Cell& cell, int samples, T* tables) {
  T* table = tables + level.offset;
  level.dense ? ScatterRuns<2>(corners, cell, samples, table) : ScatterRuns<1>(corners, cell, samples, table);
}

template <class T>
void Grid<T>::Encode(const T* tables, const Panel<T>& positions, Panel<T>* encoding) const {
  Cell cell;
  Corners corners;
  for (int tile = 0; tile < positions.tiles(); ++tile) {
    for (int l = 0; l < levels(); ++l) {
      Locate(levels_[l], positions.Tile(tile), &cell);
      Fetch(levels_[l], tables, cell, &corners);
      for (int f = 0; f < kFeatures; ++f) {
        const auto& value = corners.value[f];
        T* out = encoding->Row(tile, l * kFeatures + f);
        for (int s = 0; s < kTile; ++s) {
          const T fx = cell.fraction[0][s], fy = cell.fraction[1][s], fz = cell.fraction[2][s];
          const T v00 = value[0][s] + fx * (value[1][s] - value[0][s]);
          const T v10 = value[2][s] + fx * (value[3][s] - value[2][s]);
          const T v01 = value[4][s] + fx * (value[5][s] - value[4][s]);
          const T v11 = value[6][s] + fx * (value[7][s] - value[6][s]);
          const T v0 = v00 + fy * (v10 - v00), v1 = v01 + fy * (v11 - v01);
          out[s] = v0 + fz * (v1 - v0);
        }
      }
    }
  }
}

template <class T>
void Grid<T>::EncodeWithJacobian(const T* tables, const Panel<T>& positions, Panel<T>* encoding,
                                 Panel<T>* jacobian) const {
  Cell cell;
  Corners corners;
  for (int tile = 0; tile < positions.tiles(); ++tile) {
    for (int l = 0; l < levels(); ++l) {
      const T inverse_cell = levels_[l].inverse_cell;
      Locate(levels_[l], positions.Tile(tile), &cell);
      Fetch(levels_[l], tables, cell, &corners);
      for (int f = 0; f < kFeatures; ++f) {
        const auto& value = corners.value[f];
        const int row = l * kFeatures + f;
        T* out = encoding->Row(tile, row);
        T* dx = jacobian->Row(tile, row);
        T* dy = jacobian->Row(tile, outputs() + row);
        T* dz = jacobian->Row(tile, 2 * outputs() + row);
        for (int s = 0; s < kTile; ++s) {
          const T fx = cell.fraction[0][s], fy = cell.fraction[1][s], fz = cell.fraction[2][s];
          const T d00 = value[1][s] - value[0][s], d10 = value[3][s] - value[2][s];
          const T d01 = value[5][s] - value[4][s], d11 = value[7][s] - value[6][s];
          const T v00 = value[0][s] + fx * d00, v10 = value[2][s] + fx * d10;
          const T v01 = value[4][s] + fx * d01, v11 = value[6][s] + fx * d11;
          const T e0 = v10 - v00, e1 = v11 - v01;
          const T v0 = v00 + fy * e0, v1 = v01 + fy * e1;
          const T d0 = d00 + fy * (d10 - d00), d1 = d01 + fy * (d11 - d01);
          out[s] = v0 + fz * (v1 - v0);
          dx[s] = inverse_cell * (d0 + fz * (d1 - d0));
          dy[s] = inverse_cell * (e0 + fz * (e1 - e0));
          dz[s] = inverse_cell * (v1 - v0);
        }
      }
    }
  }
}

template <class T>
template <bool kSecondOrder>
void Grid<T>::BackwardImpl(int l, const Panel<T>& positions, const Panel<T>& delta, const Panel<T>* pull,
                           const Panel<T>* direction, int count, T* gradient) const {
  const Level& level = levels_[l];
  Cell cell;
  Corners share;
  for (int tile = 0; tile * kTile < count; ++tile) {
    Locate(level, positions.Tile(tile), &cell);
    const T* delta0 = delta.Row(tile, l * kFeatures);
    const T* delta1 = delta.Row(tile, l * kFeatures + 1);
    for (int c = 0; c < 8; ++c) {
      for (int s = 0; s < kTile; ++s) {
        const T fx = cell.fraction[0][s], fy = cell.fraction[1][s], fz = cell.fraction[2][s];
        const T wx = c & 1 ? fx : 1 - fx, wy = c & 2 ? fy : 1 - fy, wz = c & 4 ? fz : 1 - fz;
        const T weight = wx * wy * wz;
        share.value[0][c][s] = weight * delta0[s];
        share.value[1][c][s] = weight * delta1[s];
        if constexpr (kSecondOrder) {
          const T* u = direction->Tile(tile);
          const T along = level.inverse_cell * ((c & 1 ? u[s] : -u[s]) * wy * wz +
                                                (c & 2 ? u[kTile + s] : -u[kTile + s]) * wx * wz +
                                                (c & 4 ? u[2 * kTile + s] : -u[2 * kTile + s]) * wx * wy);
          share.value[0][c][s] += along * pull->Row(tile, l * kFeatures)[s];
          share.value[1][c][s] += along * pull->Row(tile, l * kFeatures + 1)[s];
        }
      }
    }
    Scatter(level, share, cell, std::min(kTile, count - tile * kTile), gradient);
  }
}

template <class T>
void Grid<T>::Backward(int level, const Panel<T>& positions, const Panel<T>& delta, int count,
                       T* gradient) const {
  BackwardImpl<false>(level, positions, delta, nullptr, nullptr, count, gradient);
}

template <class T>
void Grid<T>::BackwardSecondOrder(int level, const Panel<T>& positions, const Panel<T>& delta,
                                  const Panel<T>& pull, const Panel<T>& direction, int count,
                                  T* gradient) const {
  BackwardImpl<true>(level, positions, delta, &pull, &direction, count, gradient);
}

template class Grid<float>;
template class Grid<double>;

}  // namespace lumen
