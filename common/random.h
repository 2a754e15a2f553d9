// Random numbers as a function of (seed, pixel, sample, dimension): no state, so neither threads, nor tiles,
// nor an effect that draws numbers of its own can change anybody else's.
#pragma once

#include <cstdint>

namespace lumen {

// A bijective mixer of 64 bits (the finaliser of SplitMix64: Steele, Lea, Flood, "Fast splittable
// pseudorandom number generators", OOPSLA 2014).
// T: uint64_t, or a vector of them.
template <class T>
constexpr T MixEach64(T x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
constexpr uint64_t Mix64(uint64_t x) { return MixEach64(x); }

// 64 random bits of (seed, a, b, c).
constexpr uint64_t RandomBits(uint64_t seed, uint64_t a, uint64_t b = 0, uint64_t c = 0) {
  return Mix64(Mix64(Mix64(Mix64(seed) ^ a) ^ b) ^ c);
}

// A float in [0, 1): 24 bits, so that rounding never yields 1.
constexpr float UniformFloat(uint64_t bits) { return static_cast<float>(bits >> 40) * 0x1p-24f; }

// A double in [0, 1): 53 bits.
constexpr double UniformDouble(uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }

// The random numbers of one sample of one pixel.
class SampleStream {
 public:
  constexpr SampleStream(uint64_t seed, uint64_t pixel, uint64_t sample)
      : key_(Mix64(Mix64(Mix64(seed) ^ pixel) ^ sample)) {}

  // The number of one dimension, in [0, 1). Each use of randomness owns its dimensions.
  constexpr float Uniform(uint32_t dimension) const { return UniformFloat(Mix64(key_ ^ dimension)); }

 private:
  uint64_t key_;
};

}  // namespace lumen
