// Compiled for processors with AVX512-BF16, whatever the rest is compiled for.
#include "recon/network/bfloat16_loops.h"

#ifdef __AVX512BF16__
#include <immintrin.h>

namespace lumen {
namespace {

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

}  // namespace

const Bfloat16Kernels* const kAvx512Bfloat16Kernels = &Bfloat16Loops<Avx512Arithmetic>::kKernels;

}  // namespace lumen

#else

namespace lumen {
const Bfloat16Kernels* const kAvx512Bfloat16Kernels = nullptr;
}

#endif
