// The reconstructor's encoding and networks at a million random places each: finite, and in float within the
// bound of rounding of what double gives. ε = 2⁻²⁴, a float's rounding.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "recon/network/grid.h"
#include "recon/network/mlp.h"
#include "tests/bfloat16_reference.h"
#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::NearestBfloat16;
using test::Random;

constexpr double kRounding = 0x1p-24;
constexpr int kStates = 1000000;

// Corners have x/cell − i, off by n = (corners + 2) roundings of a cell along each axis, times what entries
// of at most 1 differ by, 2; and a dozen roundings of the interpolation.
TEST(HardCasesTraining, GridOfAMillionPlacesIsThatOfDouble) {
  GridOptions options;
  options.levels = 6;
  options.log2_table_size = 12;
  const Eigen::AlignedBox3d box(Vec3d(-64, -32, -32), Vec3d(64, 32, 32));
  const Grid<float> single(options, box);
  const Grid<double> reference(options, box);
  ASSERT_EQ(single.parameter_count(), reference.parameter_count());
  std::vector<float> table(single.parameter_count());
  uint64_t state = 6;
  for (float& entry : table) entry = static_cast<float>(Random(state));
  const std::vector<double> wide(table.begin(), table.end());
  Panel<float> x(3, 1), found(single.outputs(), 1);
  Panel<double> x_wide(3, 1), expected(single.outputs(), 1);
  const double bound = kRounding * (3 * 2 * (128 / options.finest_cell_mm + 2) * 2 + 12);
  for (int tile = 0; tile < kStates / kTile; ++tile) {
    for (int i = 0; i < 3 * kTile; ++i) {
      // Beyond the box on all sides, at times far.
      const double size = tile % 50 == 0 ? 1e6 : 80;
      x.Tile(0)[i] = static_cast<float>(size * Random(state));
      x_wide.Tile(0)[i] = x.Tile(0)[i];
    }
    single.Encode(table.data(), x, &found);
    reference.Encode(wide.data(), x_wide, &expected);
    for (int i = 0; i < single.outputs() * kTile; ++i)
      ASSERT_NEAR(found.Tile(0)[i], expected.Tile(0)[i], bound) << tile << " " << i;
  }
}

// What is looked up in packed tables is to the bit what a float grid finds in the nearest bfloat16s.
TEST(HardCasesTraining, PackedTablesHoldTheNearestBfloat16s) {
  GridOptions options;
  options.levels = 3;
  options.log2_table_size = 10;
  const Eigen::AlignedBox3d box(Vec3d(-8, -8, -8), Vec3d(8, 8, 8));
  const Grid<float> whole(options, box);
  options.precision = Precision::kBfloat16;
  const Grid<float> half(options, box);
  EXPECT_TRUE(half.packed());
  EXPECT_FALSE(whole.packed() || Grid<double>(options, box).packed());
  std::vector<float> table(whole.parameter_count()), nearest(table.size()), packed(table.size());
  uint64_t state = 8;
  for (size_t i = 0; i < table.size(); ++i) {
    table[i] = static_cast<float>(Random(state) * std::pow(10, 5 * Random(state)));
    if (i % 7 == 0) table[i] = std::ldexp(257.0f + 2 * (i % 3), -static_cast<int>(i % 80));  // halfway
    if (i % 11 == 0) table[i] = std::ldexp(static_cast<float>(Random(state)), -128);
    nearest[i] = static_cast<float>(NearestBfloat16(table[i]));
  }
  for (int level = 0; level < half.levels(); ++level) half.Pack(level, table.data(), packed.data());
  Panel<float> x(3, 16), found(half.outputs(), 16), slopes(3 * half.outputs(), 16),
      expected = found, expected_slopes = slopes, exact = found;
  for (int tile = 0; tile < 16; ++tile)
    for (int i = 0; i < 3 * kTile; ++i) x.Tile(tile)[i] = static_cast<float>(9 * Random(state));
  const auto equal = [](const Panel<float>& a, const Panel<float>& b) {
    return std::equal(a.Tile(0), a.Tile(a.tiles()), b.Tile(0));
  };
  half.Encode(packed.data(), x, &found);
  whole.Encode(nearest.data(), x, &expected);
  whole.Encode(table.data(), x, &exact);
  EXPECT_TRUE(equal(found, expected));
  EXPECT_FALSE(equal(found, exact));
  half.EncodeWithJacobian(packed.data(), x, &found, &slopes);
  whole.EncodeWithJacobian(nearest.data(), x, &expected, &expected_slopes);
  EXPECT_TRUE(equal(found, expected) && equal(slopes, expected_slopes));

  // What isn't finite isn't hidden, whatever its lower half.
  for (const uint32_t bits : {0x7f800001u, 0x7fffffffu, 0xffffffffu, 0x7f800000u, 0xff800000u, 0x7f7fffffu}) {
    std::fill(table.begin(), table.end(), std::bit_cast<float>(bits));
    for (int level = 0; level < half.levels(); ++level) half.Pack(level, table.data(), packed.data());
    half.Encode(packed.data(), x, &found);
    for (int i = 0; i < kTile; ++i) ASSERT_FALSE(std::isfinite(found.Tile(0)[i])) << bits;
  }
}

// Running error analysis (Higham 2002, 3.1): a layer's sums are off by |W| times what its inputs are off by
// and (n + 2)ε |W||x|; activations pass errors on at most whole and add 4 roundings and, softplus, the 1e-8
// of its series and the 2⁻²⁴/β where it ends. The gradient: σ′ is off by σ″ ≤ L times the sum's error, 16
// roundings and the same end. Where factors are rounded to bfloat16, by u = 2⁻⁸ of themselves, each product
// of |w| and |x| is off by (2u + u²)|w||x| more; the last layer's row, which the gradient starts from, isn't
// rounded.
void ExpectMlpAsInDouble(Activation activation, double steepest_slope,
                         const Bfloat16Kernels* rounded = nullptr) {
  const MlpShape shape{7, {16, 16}, 3, activation, 0};
  const double of_product = rounded ? 2 * 0x1p-8 + 0x1p-16 : 0;
  const Mlp<float> single(shape, rounded);
  const Mlp<double> reference(shape);
  std::vector<float> weights(single.parameter_count());
  single.Initialise(3, 1, weights.data());
  const std::vector<double> wide(weights.begin(), weights.end());
  Panel<float> x(7, 1);
  Panel<double> x_wide(7, 1);
  Mlp<float>::Pass found;
  Mlp<double>::Pass expected;
  uint64_t state = 7;
  double worst = 0;
  for (int tile = 0; tile < kStates / kTile; ++tile) {
    const double size = std::pow(10, 3 * Random(state));
    for (int i = 0; i < 7 * kTile; ++i) {
      x.Tile(0)[i] = static_cast<float>(size * Random(state));
      x_wide.Tile(0)[i] = x.Tile(0)[i];
    }
    single.Forward(weights.data(), x, 3, Mlp<float>::Keep::kSlopes, &found);
    single.InputGradient(weights.data(), &found);
    reference.Forward(wide.data(), x_wide, 3, Mlp<double>::Keep::kSlopes, &expected);
    reference.InputGradient(wide.data(), &expected);
    for (int i = 0; i < 3 * kTile; ++i) ASSERT_TRUE(std::isfinite(found.value.back().Tile(0)[i]));
    for (int i = 0; i < 7 * kTile; ++i) ASSERT_TRUE(std::isfinite(found.input_gradient.Tile(0)[i]));
    const int s = tile % kTile;  // the bounds of one sample a tile: they cost as much as the network
    std::vector<double> size_of(7), error(7, 0.0);
    for (int i = 0; i < 7; ++i) size_of[i] = std::abs(x_wide.At(i, s));
    const auto matrices = reference.matrices();
    std::vector<std::vector<double>> slope_error;
    for (size_t l = 0; l < matrices.size(); ++l) {
      const auto& m = matrices[l];
      std::vector<double> next_size(m.rows), next_error(m.rows);
      slope_error.emplace_back(m.rows);
      for (int o = 0; o < m.rows; ++o) {
        double sum = std::abs(wide[m.begin + size_t(m.rows) * m.columns + o]), carried = 0;
        for (int i = 0; i < m.columns; ++i) {
          const double weight = std::abs(wide[m.begin + size_t(o) * m.columns + i]);
          sum += weight * size_of[i];
          carried += weight * (error[i] + of_product * (size_of[i] + error[i]));
        }
        next_error[o] = carried + kRounding * (m.columns + 2) * (sum + carried);
        slope_error[l][o] = steepest_slope * next_error[o] + 20 * kRounding;
        if (l + 1 < matrices.size()) next_error[o] += 4 * kRounding * (sum + 0.1) + 2e-8;
        next_size[o] = sum + 0.1;
      }
      size_of = next_size;
      error = next_error;
    }
    for (int o = 0; o < 3; ++o) {
      const double off = std::abs(found.value.back().At(o, s) - expected.value.back().At(o, s));
      ASSERT_LE(off, error[o]) << tile << " " << o;
      worst = std::max(worst, off / error[o]);
    }
    // The gradient, from the last layer down; slopes are within 0…1.
    std::vector<double> pulled(16), off(16, 0.0);
    for (int i = 0; i < 16; ++i) pulled[i] = std::abs(wide[matrices[2].begin + i]);
    for (int l = 1; l >= 0; --l) {
      const auto& m = matrices[l];
      std::vector<double> below(m.columns), below_off(m.columns);
      for (int i = 0; i < m.columns; ++i) {
        for (int o = 0; o < m.rows; ++o) {
          const double weight = std::abs(wide[m.begin + size_t(o) * m.columns + i]);
          const double adjoint_off =
              off[o] + std::min(slope_error[l][o], 1.0) * (pulled[o] + off[o]) + kRounding * pulled[o];
          below[i] += weight * pulled[o];
          below_off[i] +=
              weight * (adjoint_off + (of_product + kRounding * (m.rows + 1)) * (pulled[o] + adjoint_off));
        }
      }
      pulled = below;
      off = below_off;
    }
    for (int i = 0; i < 7; ++i)
      ASSERT_NEAR(found.input_gradient.At(i, s), expected.input_gradient.At(i, s), off[i])
          << tile << " " << i;
  }
  EXPECT_GT(worst, 1e-3);  // the bound isn't idle
}

TEST(HardCasesTraining, SquareplusNetworkOfAMillionPlacesIsThatOfDouble) {
  ExpectMlpAsInDouble(Activation::kSquareplus, 5);  // σ″ ≤ 1/(2√b)
}
TEST(HardCasesTraining, SoftplusNetworkOfAMillionPlacesIsThatOfDouble) {
  ExpectMlpAsInDouble(Activation::kSoftplus, 25);  // σ″ ≤ β/4
}
TEST(HardCasesTraining, NetworkInBfloat16OfAMillionPlacesIsThatOfDouble) {
  ExpectMlpAsInDouble(Activation::kSquareplus, 5, &FastestBfloat16Kernels());
}
TEST(HardCasesTraining, NetworkInPortableBfloat16IsThatOfDouble) {
  ExpectMlpAsInDouble(Activation::kSquareplus, 5, &PortableBfloat16Kernels());
}

}  // namespace
}  // namespace lumen
