// How fast the products of a network's layer are, in float, with factors rounded to bfloat16, and by others.
// flop/s counts multiplications and additions alone.
#include <benchmark/benchmark.h>
#ifdef LUMEN_HAS_XSMM
#include <libxsmm.h>
#endif

#include "common/math.h"
#include "recon/network/mlp_products.h"
#include "tools/bench_train.h"

namespace lumen {
namespace {

// Arguments: outputs, inputs.
double ProductFlops(const State& state) { return 2.0 * double(state.range(0) * state.range(1)) * kSamples; }

void ProductForward(State& state) {
  const int outputs = static_cast<int>(state.range(0)), inputs = static_cast<int>(state.range(1));
  LineVector<float> weight(size_t(outputs) * inputs), bias(outputs, 0.1f);
  FillRandom(&weight, 1);
  const Panel<float> x = RandomPanel(inputs, kTiles);
  Panel<float> y(outputs, kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t)
      Multiply(weight.data(), bias.data(), outputs, inputs, x.Tile(t), y.Tile(t));
    benchmark::DoNotOptimize(y.Tile(0));
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

void ProductBackward(State& state) {
  const int outputs = static_cast<int>(state.range(0)), inputs = static_cast<int>(state.range(1));
  LineVector<float> weight(size_t(outputs) * inputs);
  FillRandom(&weight, 1);
  const Panel<float> y = RandomPanel(outputs, kTiles);
  Panel<float> x(inputs, kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t) MultiplyTransposed(weight.data(), outputs, inputs, y.Tile(t), x.Tile(t));
    benchmark::DoNotOptimize(x.Tile(0));
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

void ProductOuter(State& state) {
  const int outputs = static_cast<int>(state.range(0)), inputs = static_cast<int>(state.range(1));
  const Panel<float> y = RandomPanel(outputs, kTiles), x = RandomPanel(inputs, kTiles);
  LineVector<float> gradient(size_t(outputs) * inputs), bias(outputs);
  for (auto _ : state) {
    AccumulateOuter(y, x, gradient.data(), bias.data());
    benchmark::DoNotOptimize(gradient.data());
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

// The same with factors rounded to bfloat16: a layer's weights once a batch, a tile for each product, as a
// network's passes do.
struct Bfloat16Layer {
  explicit Bfloat16Layer(State& state) : layers{{int(state.range(1)), int(state.range(0)), 0, 0}} {
    layers[0].bias = size_t(layers[0].outputs) * layers[0].inputs;
    weight.resize(layers[0].bias);
    FillRandom(&weight, 1);
    state.SetLabel(Avx512Bfloat16Kernels() ? "AVX512-BF16" : "portable");
  }
  Bfloat16Products Products() { return {FastestBfloat16Kernels(), weight.data(), &room}; }
  std::vector<MlpLayer> layers;
  LineVector<float> weight;
  Bfloat16Products::Room room;
};

void Bfloat16Forward(State& state) {
  Bfloat16Layer layer(state);
  const MlpLayer& shape = layer.layers[0];
  const LineVector<float> bias(shape.outputs, 0.1f);
  const Panel<float> x = RandomPanel(shape.inputs, kTiles);
  Panel<float> y(shape.outputs, kTiles);
  for (auto _ : state) {
    Bfloat16Products products = layer.Products();
    products.PrepareMultiply(layer.layers, shape.outputs);
    for (int t = 0; t < kTiles; ++t)
      products.Multiply(shape, bias.data(), shape.outputs, x.Tile(t), y.Tile(t));
    benchmark::DoNotOptimize(y.Tile(0));
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

void Bfloat16Backward(State& state) {
  Bfloat16Layer layer(state);
  const MlpLayer& shape = layer.layers[0];
  const Panel<float> y = RandomPanel(shape.outputs, kTiles);
  Panel<float> x(shape.inputs, kTiles);
  for (auto _ : state) {
    Bfloat16Products products = layer.Products();
    products.PrepareTransposed(layer.layers, shape.outputs);
    for (int t = 0; t < kTiles; ++t) products.MultiplyTransposed(shape, shape.outputs, y.Tile(t), x.Tile(t));
    benchmark::DoNotOptimize(x.Tile(0));
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

void Bfloat16Outer(State& state) {
  Bfloat16Layer layer(state);
  const MlpLayer& shape = layer.layers[0];
  const Panel<float> y = RandomPanel(shape.outputs, kTiles), x = RandomPanel(shape.inputs, kTiles);
  LineVector<float> gradient(layer.weight.size()), bias(shape.outputs);
  for (auto _ : state) {
    layer.Products().AccumulateOuter(y, x, gradient.data(), bias.data());
    benchmark::DoNotOptimize(gradient.data());
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

#ifdef LUMEN_HAS_XSMM
// libxsmm's kernel of a tile's product, in its column-major terms: y (kTile × outputs) = x (kTile × inputs)
// by weight, which is stored as its transpose for one direction and as it is for the other.
void XsmmProduct(State& state, int from, int to, bool transposed) {
  const int rows = kTile, stored = transposed ? to : from;
  const int flags = transposed ? LIBXSMM_GEMM_FLAG_TRANS_B : LIBXSMM_GEMM_FLAG_NONE;
  const float alpha = 1, beta = 0;
  const libxsmm_smmfunction kernel =
      libxsmm_smmdispatch(rows, to, from, &rows, &stored, &rows, &alpha, &beta, &flags, nullptr);
  if (!kernel) return state.SkipWithError("libxsmm has no kernel of this shape");
  LineVector<float> weight(size_t(from) * to);
  FillRandom(&weight, 1);
  const Panel<float> x = RandomPanel(from, kTiles);
  Panel<float> y(to, kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t) kernel(x.Tile(t), weight.data(), y.Tile(t));
    benchmark::DoNotOptimize(y.Tile(0));
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}
void XsmmForward(State& state) { XsmmProduct(state, int(state.range(1)), int(state.range(0)), false); }
void XsmmBackward(State& state) { XsmmProduct(state, int(state.range(0)), int(state.range(1)), true); }
#endif

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

void EigenForward(State& state) {
  const Rows weight = Rows::Random(state.range(0), state.range(1));
  const Rows x = Rows::Random(state.range(1), kSamples);
  Rows y(state.range(0), kSamples);
  for (auto _ : state) {
    y.noalias() = weight * x;
    benchmark::DoNotOptimize(y.data());
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

void EigenOuter(State& state) {
  const Rows y = Rows::Random(state.range(0), kSamples), x = Rows::Random(state.range(1), kSamples);
  Rows gradient = Rows::Zero(state.range(0), state.range(1));
  for (auto _ : state) {
    gradient.noalias() += y * x.transpose();
    benchmark::DoNotOptimize(gradient.data());
    benchmark::ClobberMemory();
  }
  CountFlops(state, ProductFlops(state));
}

// The layers of the fast preset's networks, of wider ones, and of the paper's.
void Shapes(benchmark::internal::Benchmark* benchmark) {
  for (const auto& [outputs, inputs] :
       {std::pair(32, 19), {16, 32}, {32, 18}, {32, 32}, {64, 64}, {256, 256}})
    benchmark->Args({outputs, inputs});
}
BENCHMARK(ProductForward)->Apply(Shapes);
BENCHMARK(Bfloat16Forward)->Apply(Shapes);
BENCHMARK(EigenForward)->Apply(Shapes);
BENCHMARK(ProductBackward)->Apply(Shapes);
BENCHMARK(Bfloat16Backward)->Apply(Shapes);
BENCHMARK(ProductOuter)->Apply(Shapes);
BENCHMARK(Bfloat16Outer)->Apply(Shapes);
#ifdef LUMEN_HAS_XSMM
BENCHMARK(XsmmForward)->Apply(Shapes);
BENCHMARK(XsmmBackward)->Apply(Shapes);
#endif
BENCHMARK(EigenOuter)->Apply(Shapes);

}  // namespace
}  // namespace lumen
