#include "sim/imaging/noise.h"

#include <cmath>

#include "common/math.h"
#include "common/parallel.h"
#include "common/random.h"

namespace lumen {
namespace {

constexpr uint64_t kNoiseSeed = 0x6e6f697365ull;

// What a channel's key is mixed with for each use of randomness.
enum : uint64_t { kShot = 0, kRead = 1 };

// In (0, 1], so that it has a logarithm.
double PositiveUniform(uint64_t bits) { return 1 - UniformDouble(bits); }

// Standard normal (Box and Muller 1958).
double NormalNumber(uint64_t key) {
  const double radius = std::sqrt(-2 * std::log(PositiveUniform(RandomBits(key, 0))));
  return radius * std::cos(2 * kPi * UniformDouble(RandomBits(key, 1)));
}

double LogFactorial(double k) {
  static constexpr double kFactorials[] = {1, 1, 2, 6, 24, 120, 720, 5040, 40320, 362880};
  if (k < 10) return std::log(kFactorials[static_cast<int>(k)]);
  // Stirling's series; the first term left out, 1/(1680 k^7), is 6e-11 at 10.
  const double inverse = 1 / k, square = inverse * inverse;
  return (k + 0.5) * std::log(k) - k + 0.5 * std::log(2 * kPi) +
         inverse * (1.0 / 12 - square * (1.0 / 360 - square / 1260));
}

// Inversion: counts the unit-rate arrivals whose product of uniform numbers stays above e^−mean (Knuth).
double SmallPoisson(double mean, uint64_t key) {
  const double limit = std::exp(-mean);
  double product = 1;
  for (int count = 0;; ++count) {
    product *= PositiveUniform(RandomBits(key, static_cast<uint64_t>(count)));
    if (product <= limit) return count;
  }
}

// Transformed rejection (Hörmann 1993, "The transformed rejection method for generating Poisson random
// variables", algorithm PTRS); exact, for means from 10 on.
double LargePoisson(double mean, uint64_t key) {
  const double log_mean = std::log(mean);
  const double b = 0.931 + 2.53 * std::sqrt(mean), a = -0.059 + 0.02483 * b;
  const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4), v_r = 0.9277 - 3.6224 / (b - 2);
  for (uint64_t attempt = 0;; ++attempt) {
    const double u = UniformDouble(RandomBits(key, attempt, 0)) - 0.5;
    const double v = PositiveUniform(RandomBits(key, attempt, 1));
    const double us = 0.5 - std::abs(u);
    const double k = std::floor((2 * a / us + b) * u + mean + 0.43);
    if (us >= 0.07 && v <= v_r) return k;
    if (k < 0 || (us < 0.013 && v > us)) continue;
    if (std::log(v) + std::log(inverse_alpha) - std::log(a / (us * us) + b) <=
        k * log_mean - mean - LogFactorial(k)) {
      return k;
    }
  }
}

}  // namespace

SensorNoise ReadSensorNoise(const ConfigTable& table) {
  SensorNoise noise;
  noise.full_scale_e = table.Number("full_scale_e", noise.full_scale_e, {1, 1e12});
  noise.read_e = table.Number("read_e", noise.read_e, {0, 1e6});
  return noise;
}

double PoissonNumber(double mean, uint64_t key) {
  // From here on the distribution's skewness, mean^(−1/2), is below 3e-5, and the logarithms of the exact
  // method, some 2e10 in size, lose their digits.
  constexpr double kNormalFrom = 1e9;
  if (mean < 10) return SmallPoisson(mean, key);
  if (mean < kNormalFrom) return LargePoisson(mean, key);
  return mean + std::sqrt(mean) * NormalNumber(key);
}

ImageF NoisySignal(const SensorNoise& noise, const ImageF& radiance, const ImageF& vignetting,
                   const Image8& valid, uint64_t seed, int frame) {
  const uint64_t frame_key = RandomBits(seed, kNoiseSeed, static_cast<uint64_t>(frame));
  ImageF signal(radiance.width, radiance.height, 3);
  ParallelFor(0, radiance.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < radiance.width; ++x) {
      if (!*valid.Pixel(x, y)) continue;
      const uint64_t pixel = static_cast<uint64_t>(row) * radiance.width + static_cast<uint64_t>(x);
      for (uint64_t c = 0; c < 3; ++c) {
        const uint64_t key = RandomBits(frame_key, pixel, c);
        const double mean =
            noise.full_scale_e * double(*vignetting.Pixel(x, y)) * double(radiance.Pixel(x, y)[c]);
        const double electrons =
            PoissonNumber(mean, Mix64(key ^ kShot)) + noise.read_e * NormalNumber(Mix64(key ^ kRead));
        signal.Pixel(x, y)[c] = static_cast<float>(electrons / noise.full_scale_e);
      }
    }
  });
  return signal;
}

}  // namespace lumen
