// Low-discrepancy numbers as a function of (seed, pixel, sample, dimension): the first two dimensions of
// Sobol's sequence, Owen-scrambled by hashing and shuffled anew for every pair of dimensions (Burley 2020,
// "Practical hash-based Owen scrambling"; the hash is Laine and Karras's). Independent numbers, for
// comparison, come of the same formula with a key for each sample in place of one for the pixel: the
// scrambles are then unrelated from sample to sample, and what they make of any index is uniform.
#pragma once

#include <cstdint>

#include "common/lanes.h"
#include "common/math.h"
#include "common/random.h"

namespace lumen {

// The functions on bits take T = uint32_t, or a vector of them.
template <class T>
constexpr T ReverseBits(T x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Owen's scrambling on numbers whose bits run backwards: what becomes of a bit depends on the lower ones
// only.
template <class T>
constexpr T ScrambleReversed(T x, T seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

// A random permutation that keeps every aligned power-of-two block together: Owen's scrambling of the bits
// from the highest down.
template <class T>
constexpr T OwenScramble(T x, T seed) {
  return ReverseBits(ScrambleReversed(ReverseBits(x), seed));
}

// Second dimension of Sobol's sequence with its bits backwards. Its direction numbers are the powers of the
// polynomial x + 1, so bit j of the result is the sum mod 2 of C(k, j) over the index's bits k; by Lucas's
// theorem C(k, j) is odd where j's binary digits are among k's. That sum over supersets takes a step a digit.
template <class T>
constexpr T SobolSecondReversed(T index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 8) & 0x00ff00ffu;
  return index ^ (index >> 16);
}

enum class Sampling { kSobol, kIndependent };

class Sampler {
 public:
  Sampler(uint64_t seed, uint64_t pixel, uint32_t sample, Sampling sampling = Sampling::kSobol)
      : key_(Mix64(Mix64(seed) ^ pixel)), sample_(sample) {
    if (sampling == Sampling::kIndependent) key_ = Mix64(key_ ^ sample);
  }

  // Two numbers in [0, 1)² that, over the samples of a pixel, fill the square evenly. Each use of randomness
  // owns its pair.
  Vec2f Pair(uint32_t pair) const {
    const uint64_t key = Mix64(key_ ^ pair);
    // Shuffling the order of the samples makes the pairs of one pixel independent of each other.
    const uint32_t index = OwenScramble(sample_, static_cast<uint32_t>(key));
    const uint64_t scrambles = Mix64(key);
    // The first dimension is the index with its bits backwards.
    const uint32_t x = ScrambleReversed(index, static_cast<uint32_t>(scrambles));
    const uint32_t y = ScrambleReversed(SobolSecondReversed(index), static_cast<uint32_t>(scrambles >> 32));
    return Vec2f(ToUnit(ReverseBits(x)), ToUnit(ReverseBits(y)));
  }

 private:
  static float ToUnit(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

  uint64_t key_;
  uint32_t sample_;
};

// Sixteen samplers at once, lane for lane the same numbers.
class SamplerLanes {
 public:
  SamplerLanes() = default;
  // pixels: the second argument of each lane's Sampler.
  SamplerLanes(uint64_t seed, const uint64_t pixels[kLanes], Sampling sampling = Sampling::kSobol)
      : sampling_(sampling) {
    for (int i = 0; i < kLanes / 2; ++i) {
      low_[i] = pixels[i];
      high_[i] = pixels[kLanes / 2 + i];
    }
    low_ = MixEach64(low_ ^ Mix64(seed));
    high_ = MixEach64(high_ ^ Mix64(seed));
  }

  void Pair(const LanesU& samples, uint32_t pair, Lanes* u, Lanes* v) const {
    Keys low = low_, high = high_;
    if (sampling_ == Sampling::kIndependent) {
      low = MixEach64(low ^ Widened(samples, 0));
      high = MixEach64(high ^ Widened(samples, kLanes / 2));
    }
    low = MixEach64(low ^ uint64_t{pair});
    high = MixEach64(high ^ uint64_t{pair});
    const LanesU index = OwenScramble(samples, LowBits(low, high));
    const Keys low_scrambles = MixEach64(low), high_scrambles = MixEach64(high);
    const LanesU x = ScrambleReversed(index, LowBits(low_scrambles, high_scrambles));
    const LanesU y =
        ScrambleReversed(SobolSecondReversed(index), LowBits(low_scrambles >> 32, high_scrambles >> 32));
    *u = ToUnit(ReverseBits(x));
    *v = ToUnit(ReverseBits(y));
  }

 private:
  using Keys = uint64_t __attribute__((vector_size(64)));  // of eight lanes

  static LanesU LowBits(const Keys& low, const Keys& high) {
    using Half = uint32_t __attribute__((vector_size(32)));
    const Half first = __builtin_convertvector(low, Half), second = __builtin_convertvector(high, Half);
    return __builtin_shufflevector(first, second, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  }
  // Eight lanes from the first given on.
  static Keys Widened(const LanesU& samples, int first) {
    Keys wide;
    for (int i = 0; i < kLanes / 2; ++i) wide[i] = samples[first + i];
    return wide;
  }
  static Lanes ToUnit(const LanesU& bits) { return ToFloat((LanesI)(bits >> 8)) * 0x1p-24f; }

  Keys low_{}, high_{};
  Sampling sampling_ = Sampling::kSobol;
};

}  // namespace lumen
