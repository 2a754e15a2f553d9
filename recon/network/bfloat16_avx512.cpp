// Compiled for processors with AVX512-BF16, whatever the rest is compiled for.
#include "recon/network/bfloat16_arithmetic.h"

namespace lumen {

#ifdef __AVX512BF16__
const Bfloat16Kernels* const kAvx512Bfloat16Kernels = &Bfloat16Loops<Avx512Arithmetic>::kKernels;
#else
const Bfloat16Kernels* const kAvx512Bfloat16Kernels = nullptr;
#endif

}  // namespace lumen
