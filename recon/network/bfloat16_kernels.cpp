#include "recon/network/bfloat16_kernels.h"

#include <array>
#include <vector>

#include "recon/network/bfloat16_arithmetic.h"

namespace lumen {

bool MultipliesRight(const Bfloat16Kernels& kernels) {
  constexpr int kRows = 19, kPairs = 21, kInputs = 35;
  std::vector<uint32_t> weight(kRows * kPairs), room(kRows * PairsFor(kTile));
  LineVector<uint32_t> x(kPairs * kTile);
  LineVector<float> left(kRows * kTile), right(kInputs * kTile);
  std::vector<float> bias(kRows);
  const auto whole = [](size_t i, int modulus) { return static_cast<float>(int(i) % modulus - modulus / 2); };
  const auto pair = [&](size_t i) { return Bfloat16Of(whole(i, 13)) | Bfloat16Of(whole(i, 7)) << 16; };
  for (size_t i = 0; i < weight.size(); ++i) weight[i] = pair(i);
  for (size_t i = 0; i < x.size(); ++i) x[i] = pair(5 * i + i / kTile);
  for (size_t i = 0; i < left.size(); ++i) left[i] = whole(i, 11);
  for (size_t i = 0; i < right.size(); ++i) right[i] = whole(3 * i, 17);
  for (int r = 0; r < kRows; ++r) bias[r] = whole(r, 5);
  const auto results = [&](const Bfloat16Kernels& by) {
    LineVector<float> straight(kRows * kTile), turned(kRows * kTile), outer(kRows * kInputs, 1.0f);
    by.multiply(weight.data(), kPairs, 1, bias.data(), kRows, kPairs, x.data(), straight.data());
    by.multiply(weight.data(), 1, kRows, nullptr, kRows, kPairs, x.data(), turned.data());
    by.accumulate_outer(left.data(), kRows, right.data(), kInputs, 1, room.data(), outer.data());
    return std::array{straight, turned, outer};
  };
  return results(kernels) == results(PortableBfloat16Kernels());
}

const Bfloat16Kernels& PortableBfloat16Kernels() { return Bfloat16Loops<PortableArithmetic>::kKernels; }

const Bfloat16Kernels* Avx512Bfloat16Kernels() {
#ifdef __x86_64__
  static const bool here = __builtin_cpu_supports("avx512bf16") && __builtin_cpu_supports("avx512bw");
  return here ? kAvx512Bfloat16Kernels : nullptr;
#else
  return nullptr;
#endif
}

const Bfloat16Kernels* UntriedAmxBfloat16Kernels() {
#ifdef __x86_64__
  static const bool here =
      Avx512Bfloat16Kernels() && __builtin_cpu_supports("amx-tile") && __builtin_cpu_supports("amx-bf16");
  if (!here) return nullptr;
  static const Bfloat16Kernels* const permitted = PermittedAmxBfloat16Kernels();
  return permitted;
#else
  return nullptr;
#endif
}

// No machine that this was written on has them, so they are tried before they are used.
const Bfloat16Kernels* AmxBfloat16Kernels() {
  const Bfloat16Kernels* const untried = UntriedAmxBfloat16Kernels();
  static const bool right = untried && MultipliesRight(*untried);
  return right ? untried : nullptr;
}

const Bfloat16Kernels& FastestBfloat16Kernels() {
  for (const Bfloat16Kernels* fastest : {AmxBfloat16Kernels(), Avx512Bfloat16Kernels()})
    if (fastest) return *fastest;
  return PortableBfloat16Kernels();
}

}  // namespace lumen
