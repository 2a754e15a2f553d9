// Multi-resolution grid encoding (Müller et al. 2022): at each level two learnt numbers at the corners of a
// cubic lattice, interpolated trilinearly; coarse levels are stored densely, fine ones hashed into a table.
// Cell sizes are given in mm, so that what a level resolves doesn't depend on the size of the scene.
#pragma once

#include <cstdint>
#include <vector>

#include "common/math.h"
#include "recon/network/bfloat16.h"
#include "recon/network/panel.h"

namespace lumen {

struct GridOptions {
  int levels = 8;
  double coarsest_cell_mm = 8.5;
  double finest_cell_mm = 0.53;
  int log2_table_size = 15;  // entries a level at most
  // What the encoding reads the tables as; bfloat16 is half the memory to look up in. What is learnt stays
  // float, for Adam's steps are smaller than a bfloat16's.
  Precision precision = Precision::kFloat;
};

template <class T>
class Grid {
 public:
  static constexpr int kFeatures = 2;  // a level

  // Covers `box`, mm. Positions outside are answered as at its border.
  Grid(const GridOptions& options, const Eigen::AlignedBox3d& box);

  int levels() const { return static_cast<int>(levels_.size()); }
  int outputs() const { return levels() * kFeatures; }
  size_t parameter_count() const { return parameter_count_; }
  // The part of the parameters that belongs to one level.
  size_t level_begin(int level) const { return levels_[level].offset; }
  size_t level_size(int level) const { return levels_[level].entries * kFeatures; }
  // Uniform in ±1e-4, as Müller et al.
  void Initialise(uint64_t seed, T* tables) const;

  // Whether Encode and EncodeWithJacobian read what Pack has made of the tables. A grid of doubles, which is
  // for reference, never does.
  bool packed() const { return packed_; }
  // One level's numbers as bfloat16, to nearest, ties to even: an entry's two in 32 bits, the first in the
  // lower half, from where the level begins. `packed` is as long as `tables`, and is half used.
  void Pack(int level, const T* tables, T* packed) const;

  // positions: 3 rows, mm. Writes rows [0, outputs()) of `encoding`, which may have more.
  void Encode(const T* tables, const Panel<T>& positions, Panel<T>* encoding) const;
  // And its derivative: row d·outputs() + r of `jacobian` is ∂encoding_r/∂x_d, 1/mm.
  void EncodeWithJacobian(const T* tables, const Panel<T>& positions, Panel<T>* encoding,
                          Panel<T>* jacobian) const;

  // Adds to one level's gradient what the first `count` samples send back: weight · delta. delta:
  // ∂loss/∂encoding. `gradient` is that of the whole grid.
  void Backward(int level, const Panel<T>& positions, const Panel<T>& delta, int count, T* gradient) const;
  // The same where the loss depends on the encoding's derivative too, through (∂encoding/∂x · direction) ·
  // pull: adds weight · delta + pull · (direction · ∇weight). pull: rows as delta; direction: 3 rows, mm⁻¹
  // taken up.
  void BackwardSecondOrder(int level, const Panel<T>& positions, const Panel<T>& delta, const Panel<T>& pull,
                           const Panel<T>& direction, int count, T* gradient) const;

 private:
  struct Level {
    T inverse_cell;
    int32_t corners[3];  // lattice points along each axis
    bool dense;
    uint32_t entries;  // a power of two if hashed
    size_t offset;     // in the parameters
  };
  struct Cell;  // where the samples of a tile lie in a level
  void Locate(const Level& level, const T* positions, Cell* cell) const;
  struct Corners;  // the numbers there
  void Fetch(const Level& level, const T* tables, const Cell& cell, Corners* corners) const;
  template <int kRun>
  static void FetchRuns(const T* table, const Cell& cell, Corners* corners);
  static void FetchPacked(const T* table, const Cell& cell, Corners* corners);
  static void Scatter(const Level& level, const Corners& corners, const Cell& cell, int samples, T* tables);
  template <int kRun>
  static void ScatterRuns(const Corners& corners, const Cell& cell, int samples, T* table);
  template <bool kSecondOrder>
  void BackwardImpl(int level, const Panel<T>& positions, const Panel<T>& delta, const Panel<T>* pull,
                    const Panel<T>* direction, int count, T* gradient) const;

  bool packed_;
  T low_[3];
  std::vector<Level> levels_;
  size_t parameter_count_ = 0;
};

}  // namespace lumen
