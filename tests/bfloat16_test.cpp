// Products of a layer with factors rounded to bfloat16, portable, by AVX512-BF16 and by AMX's tiles, against
// double. ε = 2⁻²⁴, a float's rounding, u = 2⁻⁸, a bfloat16's.
#include "recon/network/bfloat16.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "recon/network/bfloat16_arithmetic.h"
#include "recon/network/bfloat16_tiles.h"
#include "recon/network/mlp.h"
#include "tests/bfloat16_reference.h"
#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::NearestBfloat16;
using test::Random;

// AMX's tiles by Intel's description of its instructions (Software Developer's Manual, volume 2: TILELOADD,
// TILESTORED, TDPBF16PS), so that the loops over them are tested on any processor.
struct ModelTiles {
  struct Tile {
    uint32_t row[16][16];
  };
  static inline Tile tiles[8];

  static void Prepare() {}
  template <int kTileNumber>
  static void Load(const void* from, size_t stride) {
    for (int r = 0; r < 16; ++r)
      std::memcpy(tiles[kTileNumber].row[r], static_cast<const uint32_t*>(from) + r * stride, 64);
  }
  template <int kTileNumber>
  static void Store(void* to, size_t stride) {
    for (int r = 0; r < 16; ++r)
      std::memcpy(static_cast<uint32_t*>(to) + r * stride, tiles[kTileNumber].row[r], 64);
  }
  // The sums of the pairs' first and second numbers are apart until the end. Numbers below the normal ones
  // count as 0.
  template <int kSum, int kA, int kB>
  static void AddProducts() {
    const auto normal = [](float v) { return std::abs(v) < 0x1p-126f ? 0.0f : v; };
    const auto number = [&](uint32_t bits) { return normal(std::bit_cast<float>(bits)); };
    for (int m = 0; m < 16; ++m) {
      for (int n = 0; n < 16; ++n) {
        float first = 0, second = 0;
        for (int k = 0; k < 16; ++k) {
          const uint32_t a = tiles[kA].row[m][k], b = tiles[kB].row[k][n];
          first = normal(std::fma(number(a << 16), number(b << 16), first));
          second = normal(std::fma(number(a & 0xffff0000), number(b & 0xffff0000), second));
        }
        uint32_t& sum = tiles[kSum].row[m][n];
        sum = std::bit_cast<uint32_t>(normal(number(sum) + normal(first + second)));
      }
    }
  }
};

const Bfloat16Kernels& ModelTileKernels() {
  return Bfloat16TileLoops<ModelTiles, PortableArithmetic>::kKernels;
}

// AMX's before they are tried: where they are wrong, what tests them is to say so.
std::vector<const Bfloat16Kernels*> AllKernels() {
  std::vector<const Bfloat16Kernels*> all = {&PortableBfloat16Kernels(), &ModelTileKernels()};
  for (const Bfloat16Kernels* here : {Avx512Bfloat16Kernels(), UntriedAmxBfloat16Kernels()})
    if (here) all.push_back(here);
  return all;
}

// What goes into the three products of a layer.
struct Subject {
  Subject(int outputs, int inputs, int tiles, const std::function<double()>& next)
      : layers{{inputs, outputs, 0, size_t(outputs) * inputs}},
        parameters(layers[0].bias + outputs),
        x(inputs, tiles),
        y(outputs, tiles) {
    ForEach([&](float& value) { value = static_cast<float>(next()); });
  }
  void ForEach(const std::function<void(float&)>& change) {
    for (float& value : parameters) change(value);
    for (Panel<float>* panel : {&x, &y})
      for (int i = 0; i < panel->rows() * panel->tiles() * kTile; ++i) change(panel->Tile(0)[i]);
  }
  std::vector<MlpLayer> layers;
  std::vector<float> parameters;
  Panel<float> x, y;
};

// Every number that the products make of a subject, in one order: forward, transposed, outer.
template <class Products>
std::vector<float> ResultsOf(Products products, const Subject& subject) {
  const MlpLayer& layer = subject.layers[0];
  const int tiles = subject.x.tiles();
  Panel<float> forward(layer.outputs, tiles), transposed(layer.inputs, tiles);
  products.PrepareMultiply(subject.layers, layer.outputs);
  for (int tile = 0; tile < tiles; ++tile)
    products.Multiply(layer, subject.parameters.data() + layer.bias, layer.outputs, subject.x.Tile(tile),
                      forward.Tile(tile));
  products.PrepareTransposed(subject.layers, layer.outputs);
  for (int tile = 0; tile < tiles; ++tile)
    products.MultiplyTransposed(layer, layer.outputs, subject.y.Tile(tile), transposed.Tile(tile));
  std::vector<float> gradient(layer.bias, 0.5f);
  products.AccumulateOuter(subject.y, subject.x, gradient.data(), nullptr);
  std::vector<float> all;
  for (int o = 0; o < layer.outputs; ++o)
    for (int s = 0; s < tiles * kTile; ++s) all.push_back(forward.At(o, s));
  for (int i = 0; i < layer.inputs; ++i)
    for (int s = 0; s < tiles * kTile; ++s) all.push_back(transposed.At(i, s));
  all.insert(all.end(), gradient.begin(), gradient.end());
  return all;
}
std::vector<float> ResultsOf(const Bfloat16Kernels& kernels, const Subject& subject) {
  Bfloat16Products::Room room;
  return ResultsOf(Bfloat16Products(kernels, subject.parameters.data(), &room), subject);
}
std::vector<float> ExactResultsOf(const Subject& subject) {
  return ResultsOf(ExactProducts<float>(subject.parameters.data()), subject);
}

// A sum in double of products, and how far one of rounded factors in float may be off.
struct Sum {
  double value, size, factors = 0;
  int additions = 0;
  explicit Sum(double start) : value(start), size(std::abs(start)) {}
  void Add(double a, double b) {
    value += a * b;
    size += std::abs(a * b);
    factors += std::abs(a) + std::abs(b);
    ++additions;
  }
  // Each addition rounds by ε of no more than the sum's size, at most one more rounds to what is there
  // already, and either it or the product may be taken for 0 below 2⁻¹²⁶, as may each factor.
  double Rounding() const {
    return 1.0001 * 0x1p-24 * (additions + 2) * size + 0x1p-126 * (2 * additions + factors);
  }
  // Beyond that, that of the factors: (1 + u)² − 1 of every product.
  double RoundingWithFactors() const { return (2 * 0x1p-8 + 0x1p-16) * size + 1.01 * Rounding(); }
};

// In the order of ResultsOf.
std::vector<Sum> SumsOf(const Subject& subject, const std::function<double(float)>& factor) {
  const MlpLayer& layer = subject.layers[0];
  const int samples = subject.x.tiles() * kTile;
  const auto weight = [&](int o, int i) { return factor(subject.parameters[size_t(o) * layer.inputs + i]); };
  std::vector<Sum> all;
  for (int o = 0; o < layer.outputs; ++o) {
    for (int s = 0; s < samples; ++s) {
      Sum& sum = all.emplace_back(subject.parameters[layer.bias + o]);
      for (int i = 0; i < layer.inputs; ++i) sum.Add(weight(o, i), factor(subject.x.At(i, s)));
    }
  }
  for (int i = 0; i < layer.inputs; ++i) {
    for (int s = 0; s < samples; ++s) {
      Sum& sum = all.emplace_back(0);
      for (int o = 0; o < layer.outputs; ++o) sum.Add(weight(o, i), factor(subject.y.At(o, s)));
    }
  }
  for (int o = 0; o < layer.outputs; ++o) {
    for (int i = 0; i < layer.inputs; ++i) {
      Sum& sum = all.emplace_back(0.5);
      for (int s = 0; s < samples; ++s) sum.Add(factor(subject.y.At(o, s)), factor(subject.x.At(i, s)));
    }
  }
  return all;
}

// The largest part of its bound that a result is off by; infinite for what isn't a number.
double Worst(const std::vector<float>& results, const std::vector<Sum>& sums, double (Sum::*bound)() const) {
  double worst = results.size() == sums.size() ? 0 : std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < sums.size() && k < results.size(); ++k) {
    const double part = std::abs(results[k] - sums[k].value) / (sums[k].*bound)();
    worst = part <= worst ? worst : std::isnan(part) ? std::numeric_limits<double>::infinity() : part;
  }
  return worst;
}

constexpr struct {
  int outputs, inputs, tiles;
} kShapes[] = {{1, 1, 1},  {3, 19, 2}, {5, 7, 1},   {16, 3, 1},  {7, 16, 2}, {13, 33, 1},
               {6, 64, 1}, {9, 67, 2}, {2, 129, 1}, {32, 64, 1}, {35, 70, 2}};

double Exact(float value) { return value; }

TEST(Bfloat16, ProductsAreThoseOfTheNearestFactors) {
  uint64_t state = 3;
  const auto next = [&state] { return Random(state) * std::pow(10, 3 * Random(state)); };
  double worst = 0;
  for (const auto& shape : kShapes) {
    const Subject subject(shape.outputs, shape.inputs, shape.tiles, next);
    const std::vector<Sum> nearest = SumsOf(subject, NearestBfloat16), exact = SumsOf(subject, Exact);
    for (const Bfloat16Kernels* kernels : AllKernels()) {
      const std::vector<float> results = ResultsOf(*kernels, subject);
      EXPECT_LE(Worst(results, nearest, &Sum::Rounding), 1) << shape.outputs << " × " << shape.inputs;
      const double part = Worst(results, exact, &Sum::RoundingWithFactors);
      EXPECT_LE(part, 1) << shape.outputs << " × " << shape.inputs;
      worst = std::max(worst, part);
    }
    // What the comparison must refuse: factors as they are, factors cut off, and not a number.
    EXPECT_GT(Worst(ExactResultsOf(subject), nearest, &Sum::Rounding), 1);
    Subject cut = subject;
    cut.ForEach([](float& v) { v = std::bit_cast<float>(std::bit_cast<uint32_t>(v) & 0xffff0000); });
    cut.parameters = subject.parameters;
    EXPECT_GT(Worst(ExactResultsOf(cut), nearest, &Sum::Rounding), 1);
    std::vector<float> broken = ResultsOf(PortableBfloat16Kernels(), subject);
    broken.back() = std::numeric_limits<float>::quiet_NaN();
    EXPECT_GT(Worst(broken, nearest, &Sum::Rounding), 1);
  }
  EXPECT_GT(worst, 0.5);  // the bound isn't idle
}

// Whole numbers up to 256 are bfloat16s and their sums are exact in any order: every kernel gives the very
// same, at each shape.
TEST(Bfloat16, ProductsOfWholeNumbersAreExact) {
  uint64_t state = 5;
  const auto next = [&state] { return std::round(100 * Random(state)); };
  for (const auto& shape : kShapes) {
    const Subject subject(shape.outputs, shape.inputs, shape.tiles, next);
    for (const Bfloat16Kernels* kernels : AllKernels())
      EXPECT_EQ(ResultsOf(*kernels, subject), ExactResultsOf(subject))
          << shape.outputs << " × " << shape.inputs;
  }
}

// Numbers around the least normal one, among which AVX512-BF16 drops those below.
TEST(Bfloat16, TinyFactorsAreOffByTheLeastNormalNumberAtMost) {
  uint64_t state = 7;
  const auto next = [&state] { return std::ldexp(Random(state), state % 3 == 0 ? -64 : -124); };
  const Subject subject(5, 7, 1, next);
  for (const Bfloat16Kernels* kernels : AllKernels())
    EXPECT_LE(Worst(ResultsOf(*kernels, subject), SumsOf(subject, NearestBfloat16), &Sum::Rounding), 1);
}

// What is tried before AMX is used: right kernels pass, and none whose product or gradient is off by one
// number.
TEST(Bfloat16, TrialProductsTellRightFromWrong) {
  for (const Bfloat16Kernels* kernels : AllKernels()) EXPECT_TRUE(MultipliesRight(*kernels));
  Bfloat16Kernels wrong = ModelTileKernels();
  wrong.multiply = [](const uint32_t* weight, size_t row_stride, size_t pair_stride, const float* bias,
                      int rows, int pairs, const uint32_t* x, float* y) {
    ModelTileKernels().multiply(weight, row_stride, pair_stride, bias, rows, pairs, x, y);
    if (row_stride == 1) y[rows * kTile - 1] += 1;
  };
  EXPECT_FALSE(MultipliesRight(wrong));
  wrong = ModelTileKernels();
  wrong.accumulate_outer = [](const float* y, int outputs, const float* x, int inputs, int tiles,
                              uint32_t* room, float* gradient) {
    ModelTileKernels().accumulate_outer(y, outputs, x, inputs, tiles, room, gradient);
    gradient[outputs * inputs - 1] += 1;
  };
  EXPECT_FALSE(MultipliesRight(wrong));
}

// Of every bit pattern of a pair's first number, at random those of the second.
TEST(Bfloat16, Avx512RoundsAsThePortableKernelsDo) {
  if (!Avx512Bfloat16Kernels()) GTEST_SKIP() << "this processor has no AVX512-BF16";
  constexpr int kNumbers = 1 << 12;
  std::vector<float> from(2 * kNumbers);
  std::vector<uint32_t> rows[2], columns[2];
  for (uint64_t block = 0; block < 256; ++block) {
    for (int i = 0; i < 2 * kNumbers; ++i) {
      uint32_t bits = static_cast<uint32_t>(RandomBits(1, block, i));
      if (i % 5 == 0) bits = (bits & 0xffff0000) | 0x8000;  // a tie
      const bool below_normal = (bits & 0x7f800000) == 0;
      from[i] = std::bit_cast<float>(below_normal ? bits & 0x80000000 : bits);
    }
    for (size_t k = 0; k < 2; ++k) {
      rows[k].resize(kNumbers);
      columns[k].resize(kNumbers);
      const Bfloat16Kernels& kernels = k == 0 ? PortableBfloat16Kernels() : *Avx512Bfloat16Kernels();
      kernels.pair_rows(2, kNumbers, from.data(), rows[k].data());
      kernels.pair_columns(1, 2 * kNumbers, from.data(), columns[k].data());
    }
    ASSERT_EQ(rows[0], rows[1]);
    ASSERT_EQ(columns[0], columns[1]);
  }
}

// What isn't finite spreads to the sums that it is in, and to no other.
TEST(Bfloat16, NumbersThatAreNotFiniteAreNotHidden) {
  uint64_t state = 9;
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::max()}) {
    Subject subject(3, 5, 1, [&state] { return Random(state); });
    subject.x.At(4, 17) = bad;  // the row that has no partner
    for (const Bfloat16Kernels* kernels : AllKernels()) {
      const std::vector<float> results = ResultsOf(*kernels, subject);
      for (int k = 0; k < 3 * kTile; ++k) EXPECT_EQ(std::isfinite(results[k]), k % kTile != 17) << k;
      for (int k = 0; k < 15; ++k) EXPECT_EQ(std::isfinite(results[8 * kTile + k]), k % 5 != 4) << k;
    }
  }
}

// A network of small whole numbers takes all its passes exactly, so they must be those of a float network to
// the bit.
struct Passes {
  explicit Passes(const Bfloat16Kernels* rounded, float last_weight = 1) {
    const MlpShape shape{5, {6, 7}, 3, Activation::kRelu};
    const Mlp<float> mlp(shape, rounded);
    std::vector<float> parameters(mlp.parameter_count());
    uint64_t state = 13;
    const auto next = [&state] { return static_cast<float>(std::round(1.4 * Random(state))); };
    for (float& parameter : parameters) parameter = next();
    parameters[mlp.matrices().back().begin] = last_weight;
    Panel<float> input(5, 2), output_delta(3, 2), direction(5, 2);
    for (Panel<float>* panel : {&input, &output_delta, &direction})
      for (int i = 0; i < panel->rows() * 2 * kTile; ++i) panel->Tile(0)[i] = next();
    Mlp<float>::Pass pass;
    first.resize(parameters.size());
    second.resize(parameters.size());
    mlp.Forward(parameters.data(), input, 3, Mlp<float>::Keep::kBends, &pass);
    Keep(pass.value.back());
    mlp.InputGradient(parameters.data(), &pass);
    Keep(pass.input_gradient);
    Panel<float> input_delta;
    mlp.Backward(parameters.data(), input, output_delta, &pass, first.data(), &input_delta);
    Keep(input_delta);
    mlp.BackwardSecondOrder(parameters.data(), input, output_delta, direction, &pass, second.data(),
                            &input_delta);
    Keep(input_delta);
  }
  void Keep(const Panel<float>& panel) {
    panels.insert(panels.end(), panel.Tile(0), panel.Tile(panel.tiles()));
  }
  std::vector<float> panels, first, second;
};

TEST(Bfloat16, PassesOfANetworkOfWholeNumbersAreExact) {
  const Passes expected(nullptr);
  for (const Bfloat16Kernels* kernels : AllKernels()) {
    const Passes found(kernels);
    EXPECT_EQ(found.panels, expected.panels);
    EXPECT_EQ(found.first, expected.first);
    EXPECT_EQ(found.second, expected.second);
    // 257 has nine bits.
    EXPECT_NE(Passes(kernels, 257).panels, Passes(nullptr, 257).panels);
  }
  EXPECT_NE(expected.first, expected.second);
}

}  // namespace
}  // namespace lumen
