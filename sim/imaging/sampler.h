// Low-discrepancy numbers as a function of (seed, pixel, sample, dimension): the first two dimensions of
// Sobol's sequence, Owen-scrambled by hashing and shuffled anew for every pair of dimensions (Burley 2020,
// "Practical hash-based Owen scrambling"; the hash is Laine and Karras's).
#pragma once

#include <cstdint>

#include "common/math.h"
#include "common/random.h"

namespace lumen {

constexpr uint32_t ReverseBits(uint32_t x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Owen's scrambling on numbers whose bits run backwards: what becomes of a bit depends on the lower ones
// only.
constexpr uint32_t ScrambleReversed(uint32_t x, uint32_t seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

// A random permutation that keeps every aligned power-of-two block together: Owen's scrambling of the bits
// from the highest down.
constexpr uint32_t OwenScramble(uint32_t x, uint32_t seed) {
  return ReverseBits(ScrambleReversed(ReverseBits(x), seed));
}

// Second dimension of Sobol's sequence with its bits backwards. Its direction numbers are the powers of the
// polynomial x + 1, so bit j of the result is the sum mod 2 of C(k, j) over the index's bits k; by Lucas's
// theorem C(k, j) is odd where j's binary digits are among k's. That sum over supersets takes a step a digit.
constexpr uint32_t SobolSecondReversed(uint32_t index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 8) & 0x00ff00ffu;
  return index ^ (index >> 16);
}

class Sampler {
 public:
  Sampler(uint64_t seed, uint64_t pixel, uint32_t sample)
      : key_(Mix64(Mix64(seed) ^ pixel)), sample_(sample) {}

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

}  // namespace lumen
