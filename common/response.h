// From linear radiance (1 = full scale) to what the colour file holds, and back:
// pixel = quantise((gain · vignetting · radiance) ^ (1/γ)), clipped to 0…1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace lumen {

struct Response {
  double gamma = 2.2;
  bool srgb = false;      // the sRGB transfer (IEC 61966-2-1) in place of gamma
  double vignetting = 0;  // k of cos^k(angle to the axis), on top of the light's own fall-off
};

// Encoded value of a linear one, both 0…1; input outside is clipped, NaN stays NaN.
template <class T>
T Encode(const Response& response, T linear) {
  const T x = std::clamp(linear, T(0), T(1));
  if (response.srgb) {
    return x <= T(0.0031308) ? T(12.92) * x : T(1.055) * std::pow(x, T(1 / 2.4)) - T(0.055);
  }
  return response.gamma == 1 ? x : std::pow(x, T(1 / response.gamma));
}

// The inverse of Encode on 0…1; input outside is clipped, NaN stays NaN.
template <class T>
T Decode(const Response& response, T encoded) {
  const T y = std::clamp(encoded, T(0), T(1));
  if (response.srgb) {
    // The standard's own threshold of the inverse; between 12.92 · 0.0031308 and it the branches differ by
    // 1e-8.
    return y <= T(0.04045) ? y / T(12.92) : std::pow((y + T(0.055)) / T(1.055), T(2.4));
  }
  return response.gamma == 1 ? y : std::pow(y, T(response.gamma));
}

// The largest encoded value that 8 bits round to 0: half a step.
inline constexpr double kHalfStep8 = 0.5 / 255;

// dEncode/dlinear, 0 where Encode clips. For γ > 1 the power's slope x^(1/γ − 1)/γ grows without bound
// towards 0, but below x₀ = (half a step of 8 bits)^γ every value gives pixel 0, so nothing can be learnt
// from a steeper slope: there the slope is that at x₀, (half a step)^(1 − γ)/γ, 807 for γ = 2.2. (sRGB's is
// at most 12.92 by itself.)
template <class T>
T EncodeDerivative(const Response& response, T linear) {
  if (linear < 0 || linear > 1) return 0;
  if (response.srgb) {
    return linear <= T(0.0031308) ? T(12.92) : T(1.055 / 2.4) * std::pow(linear, T(1 / 2.4 - 1));
  }
  if (response.gamma == 1) return std::isnan(linear) ? linear : T(1);
  const T floor = response.gamma > 1 ? T(std::pow(kHalfStep8, response.gamma)) : T(0);
  return std::pow(linear < floor ? floor : linear, T(1 / response.gamma - 1)) / T(response.gamma);
}

// cos^k of the angle between a unit ray and the axis; 0 at and beyond 90° for k > 0, 1 everywhere for k = 0.
template <class T>
T Vignetting(const Response& response, T cos_angle) {
  if (response.vignetting == 0) return 1;
  return cos_angle <= 0 ? T(0) : std::pow(cos_angle, T(response.vignetting));
}

// 8 bits with rounding to nearest, clipped. NaN gives 0: count it before.
template <class T>
uint8_t Quantise(T encoded) {
  if (!(encoded > 0)) return 0;
  return static_cast<uint8_t>(std::nearbyint(std::min(encoded, T(1)) * 255));
}

}  // namespace lumen
