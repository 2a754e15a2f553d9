// From linear radiance (1 = full scale) to what the colour file holds, and back:
// pixel = quantise((gain · vignetting · radiance) ^ (1/γ)), clipped to 0…1.
#pragma once

#include <cstdint>

namespace lumen {

struct Response {
  double gamma = 2.2;
  bool srgb = false;       // the sRGB transfer (IEC 61966-2-1) in place of gamma
  double vignetting = 0;   // k of cos^k(angle to the axis), on top of the light's own fall-off
};

// Encoded value of a linear one, both 0…1; input outside is clipped, NaN stays NaN.
template <class T>
T Encode(const Response& response, T linear);

// The inverse of Encode on 0…1.
template <class T>
T Decode(const Response& response, T encoded);

// dEncode/dlinear; bounded near 0 as `Encode` is not: see the definition for the bound and its derivation.
template <class T>
T EncodeDerivative(const Response& response, T linear);

// cos^k of the angle between a unit ray and the axis; 0 at and beyond 90° for k > 0.
template <class T>
T Vignetting(const Response& response, T cos_angle);

// 8 bits with rounding to nearest, clipped. NaN gives 0: count it before.
template <class T>
uint8_t Quantise(T encoded);

}  // namespace lumen
