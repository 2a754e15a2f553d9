// bfloat16 by its definition.
#pragma once

#include <algorithm>
#include <cmath>

namespace lumen::test {

// To eight bits of significand, to nearest, ties to even; below the normal numbers in steps of 2⁻¹³³.
inline double NearestBfloat16(float value) {
  int exponent;
  std::frexp(value, &exponent);
  const double step = std::ldexp(1.0, std::max(exponent - 8, -133));
  return std::nearbyint(value / step) * step;
}

}  // namespace lumen::test
