// The terms of the loss at one pixel or one sample, each with its derivative.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/math.h"

namespace lumen {

// A number and its derivative by the argument in question.
template <class T>
struct Term {
  T value;
  T slope;
};

// x^(1/γ) for x ≥ 0, continued below `floor` by its tangent there: the derivative is bounded by
// floor^(1/γ − 1)/γ, and no x, 0 included, is without a finite one. With floor the radiance of half an 8-bit
// step, (1/510)^γ, the continuation differs from the power by less than the step in which both are black.
template <class T>
Term<T> Compress(T x, T inverse_gamma, T floor) {
  const T base = x > floor ? x : floor;
  const T power = std::pow(base, inverse_gamma);
  const T slope = inverse_gamma * power / base;
  return {power + slope * (x - base), slope};
}

// What a pixel says of its radiance: saturated and black ones bound it from one side only.
enum class PixelBound : uint8_t { kExact, kAtLeast, kAtMost };

// |predicted − observed|, and 0 where the bound is kept.
template <class T>
Term<T> PhotometricLoss(T predicted, T observed, PixelBound bound) {
  const T error = predicted - observed;
  if (bound == PixelBound::kAtLeast && error > 0) return {0, 0};
  if (bound == PixelBound::kAtMost && error < 0) return {0, 0};
  return {std::abs(error), error > 0 ? T(1) : error < 0 ? T(-1) : T(0)};
}

// How much a pixel's channels count beside each other, 3 in sum. What a model says of the light from the rest
// of the wall is off by a part of that light, which is the larger the paler the wall: a channel counts 1/(1 +
// doubt · f⁴), f being the part of its radiance that comes from there. Channels with equal parts count 1
// each, as all do with a doubt of 0. Pixels as a whole keep their weight: to leave out what is far and dark
// because it is lit by other walls would leave its place to chance. Taken as a constant of the step: its
// derivative would let the surface move to where its errors count less. 0 ≤ ambient ≤ radiance, a channel
// each.
template <class T>
Vec3<T> ChannelTrust(const Vec3<T>& radiance, const Vec3<T>& ambient, T doubt) {
  Vec3<T> trust;
  for (int c = 0; c < 3; ++c) {
    const T part = radiance[c] > 0 ? ambient[c] / radiance[c] : T(0);
    trust[c] = 1 / (1 + doubt * part * part * part * part);
  }
  return trust * (3 / trust.sum());
}

// (|g| − 1)² and its gradient by g; 0 at g = 0, which no direction leads away from.
template <class T>
T EikonalLoss(const Vec3<T>& gradient, Vec3<T>* slope) {
  const T length = gradient.norm();
  const T excess = length - 1;
  *slope = length > 0 ? Vec3<T>(gradient * (2 * excess / length)) : Vec3<T>::Zero();
  return excess * excess;
}

// Huber's: quadratic within ±width, linear beyond.
template <class T>
Term<T> HuberLoss(T x, T width) {
  const T size = std::abs(x);
  const bool within = size <= width;
  return {within ? x * x / (2 * width) : size - width / 2, within ? x / width : x > 0 ? T(1) : T(-1)};
}

}  // namespace lumen
