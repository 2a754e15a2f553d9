// What the benchmarks of training's kernels share: the batch, random numbers to fill it with, and counters.
#pragma once

#include <benchmark/benchmark.h>

#include "common/random.h"
#include "recon/network/panel.h"

namespace lumen {

using benchmark::Counter;
using benchmark::State;

// Samples of a batch: 32 rays of the fast preset's 17 samples.
inline constexpr int kTiles = 9;
inline constexpr int kSamples = kTiles * kTile;

inline void CountFlops(State& state, double flops) {
  state.counters["flop/s"] = Counter(flops, Counter::kIsIterationInvariantRate);
}
inline void CountBytes(State& state, double bytes) {
  state.counters["bytes/s"] = Counter(bytes, Counter::kIsIterationInvariantRate);
}
inline void CountSamples(State& state, double samples) {
  state.counters["samples/s"] = Counter(samples, Counter::kIsIterationInvariantRate);
}

template <class Container>
void FillRandom(Container* values, double size) {
  for (size_t i = 0; i < values->size(); ++i)
    (*values)[i] = static_cast<float>(size * (2 * UniformDouble(RandomBits(7, i)) - 1));
}

inline Panel<float> RandomPanel(int rows, int tiles, double size = 1) {
  Panel<float> panel(rows, tiles);
  for (int i = 0; i < rows * tiles * kTile; ++i)
    panel.Tile(0)[i] = static_cast<float>(size * (2 * UniformDouble(RandomBits(9, i)) - 1));
  return panel;
}

}  // namespace lumen
