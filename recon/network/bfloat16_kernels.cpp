#include "recon/network/bfloat16_kernels.h"

#include <algorithm>

#include "recon/network/bfloat16_arithmetic.h"

namespace lumen {

namespace {

// Whether whole numbers, whose sums are exact in any order, have the products that they must.
bool MultipliesRight(const Bfloat16Kernels& kernels) {
  constexpr int kRows = 19, kPairs = 21;
  uint32_t weight[kRows * kPairs];
  alignas(64) uint32_t x[kPairs * kTile];
  alignas(64) float found[kRows * kTile], expected[kRows * kTile];
  const auto pair = [](int i) { return Bfloat16Of(float(i % 13 - 6)) | Bfloat16Of(float(i % 7 - 3)) << 16; };
  for (int i = 0; i < kRows * kPairs; ++i) weight[i] = pair(i);
  for (int i = 0; i < kPairs * kTile; ++i) x[i] = pair(5 * i + i / kTile);
  kernels.multiply(weight, kPairs, 1, nullptr, kRows, kPairs, x, found);
  PortableBfloat16Kernels().multiply(weight, kPairs, 1, nullptr, kRows, kPairs, x, expected);
  return std::equal(found, found + kRows * kTile, expected);
}

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

const Bfloat16Kernels* AmxBfloat16Kernels() {
#ifdef __x86_64__
  static const bool here =
      Avx512Bfloat16Kernels() && __builtin_cpu_supports("amx-tile") && __builtin_cpu_supports("amx-bf16");
  if (!here) return nullptr;
  // No machine that this was written on has them, so they are tried before they are used.
  static const Bfloat16Kernels* const permitted = PermittedAmxBfloat16Kernels();
  static const bool right = permitted && MultipliesRight(*permitted);
  return right ? permitted : nullptr;
#else
  return nullptr;
#endif
}

const Bfloat16Kernels& FastestBfloat16Kernels() {
  for (const Bfloat16Kernels* fastest : {AmxBfloat16Kernels(), Avx512Bfloat16Kernels()})
    if (fastest) return *fastest;
  return PortableBfloat16Kernels();
}

}  // namespace lumen
