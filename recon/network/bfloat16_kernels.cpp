#include "recon/network/bfloat16_kernels.h"

#include "recon/network/bfloat16.h"
#include "recon/network/bfloat16_loops.h"

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

}  // namespace

const Bfloat16Kernels& PortableBfloat16Kernels() { return Bfloat16Loops<PortableArithmetic>::kKernels; }

const Bfloat16Kernels* Avx512Bfloat16Kernels() {
#ifdef __x86_64__
  static const bool here = __builtin_cpu_supports("avx512bf16") && __builtin_cpu_supports("avx512bw");
  return here ? kAvx512Bfloat16Kernels : nullptr;
#else
  return nullptr;
#endif
}

const Bfloat16Kernels& FastestBfloat16Kernels() {
  const Bfloat16Kernels* fastest = Avx512Bfloat16Kernels();
  return fastest ? *fastest : PortableBfloat16Kernels();
}

}  // namespace lumen
