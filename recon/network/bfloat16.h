// bfloat16: a float's upper half, eight bits of significand.
#pragma once

#include <bit>
#include <cstdint>

namespace lumen {

// What numbers are rounded to before they are computed with.
enum class Precision { kFloat, kBfloat16 };

// To nearest, ties to even, in the lower half of the bits. NaN stays NaN, though its upper half alone might
// not be one.
inline uint32_t Bfloat16Of(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  const uint32_t rounded = (bits + 0x7fff + ((bits >> 16) & 1)) >> 16;
  return value == value ? rounded : (bits >> 16) | 0x40;
}

}  // namespace lumen
