// What the loops of recon/network/bfloat16_loops.h do with sixteen pairs at a time, and for which processor.
// The files that include this are compiled for different ones, so these are types of each file alone: the
// linker must not take one's instructions for the other's.
#pragma once

#include "recon/network/bfloat16.h"
#include "recon/network/bfloat16_loops.h"

#ifdef __AVX512BF16__
#include <immintrin.h>
#endif

namespace lumen {
namespace {

// A bfloat16 is a float with its lower half 0.
struct PortableArithmetic {
  static void Pair(const float* low, const float* high, uint32_t* to) {
    for (int i = 0; i < kPairLanes; ++i) to[i] = Bfloat16Of(low[i]) | Bfloat16Of(high[i]) << 16;
  }
  static void PairNeighbours(const float* from, uint32_t* to) {
    for (int i = 0; i < kPairLanes; ++i) to[i] = Bfloat16Of(from[2 * i]) | Bfloat16Of(from[2 * i + 1]) << 16;
  }
  static void AddProducts(const PairLanes& a, const PairLanes& b, SumLanes* sum) {
    constexpr uint32_t kUpper = 0xffff0000;
    *sum += (SumLanes)(a << 16) * (SumLanes)(b << 16);
    *sum += (SumLanes)(a & kUpper) * (SumLanes)(b & kUpper);
  }
};

#ifdef __AVX512BF16__
struct Avx512Arithmetic {
  static void Pair(const float* low, const float* high, uint32_t* to) {
    // The conversion leaves all of low before all of high.
    alignas(64) static constexpr uint16_t kInterleaved[32] = {0,  16, 1,  17, 2,  18, 3,  19, 4,  20, 5,
                                                              21, 6,  22, 7,  23, 8,  24, 9,  25, 10, 26,
                                                              11, 27, 12, 28, 13, 29, 14, 30, 15, 31};
    const __m512bh rounded = _mm512_cvtne2ps_pbh(_mm512_loadu_ps(high), _mm512_loadu_ps(low));
    _mm512_storeu_si512(to, _mm512_permutexvar_epi16(_mm512_load_si512(kInterleaved), (__m512i)rounded));
  }
  static void PairNeighbours(const float* from, uint32_t* to) {
    const __m512bh rounded = _mm512_cvtne2ps_pbh(_mm512_loadu_ps(from + kPairLanes), _mm512_loadu_ps(from));
    _mm512_storeu_si512(to, (__m512i)rounded);
  }
  static void AddProducts(const PairLanes& a, const PairLanes& b, SumLanes* sum) {
    *sum = (SumLanes)_mm512_dpbf16_ps((__m512)*sum, (__m512bh)a, (__m512bh)b);
  }
};
#endif

}  // namespace
}  // namespace lumen
