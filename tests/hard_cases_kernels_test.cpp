// The kernels of the reconstructor's loss at the edges of their range and at a million random states each:
// finite, and in float within the bound of rounding of what double gives. ε = 2⁻²⁴, a float's rounding. Its
// networks': hard_cases_network_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "recon/network/adam.h"
#include "recon/surface/shading.h"
#include "recon/surface/volume.h"
#include "recon/training/loss.h"
#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::Random;

constexpr double kRounding = 0x1p-24;
constexpr int kStates = 1000000;

// Of either sign, its size even in logarithm between two powers of ten.
double RandomSize(uint64_t& state, double low_exponent, double high_exponent) {
  const double sign = Random(state) < 0 ? -1 : 1;
  return sign * std::pow(10, low_exponent + (high_exponent - low_exponent) * (Random(state) + 1) / 2);
}

// What float makes of logΦ(s f): the product's rounding, which logΦ passes on at most whole (its slope is
// within 0…1), exp's and log1p's of at most 2 units each and the sum's, all of numbers no larger than
// |s f| + log 2.
double LogSigmoidError(double s, double f) { return kRounding * (6 * std::abs(s * f) + 6); }

struct Ray {
  static constexpr int kSamples = 10;
  float distance[kSamples], delta[kSamples];
  float sharpness;
};

// Falling through the wall, rising again, or anything, by turns.
Ray RandomRay(uint64_t& state, int turn) {
  Ray ray;
  ray.sharpness = static_cast<float>(std::abs(RandomSize(state, 0, 6)));
  const double size = std::pow(10, 3 * Random(state));
  for (int k = 0; k < Ray::kSamples; ++k) {
    const double f = turn % 3 == 0   ? 1 - 2.0 * k / Ray::kSamples
                     : turn % 3 == 1 ? 0.2 * k - 1
                                     : Random(state);
    ray.distance[k] = static_cast<float>(size * (f + 0.1 * Random(state)));
    ray.delta[k] = static_cast<float>(Random(state));
  }
  return ray;
}

// Weights and their gradient in T.
template <class T>
struct Weighted {
  T occupancy[Ray::kSamples], transmittance[Ray::kSamples], weight[Ray::kSamples], gradient[Ray::kSamples];

  explicit Weighted(const Ray& ray) {
    T distance[Ray::kSamples], delta[Ray::kSamples];
    std::copy(ray.distance, ray.distance + Ray::kSamples, distance);
    std::copy(ray.delta, ray.delta + Ray::kSamples, delta);
    const T sharpness = ray.sharpness;
    RayWeights<T>(Ray::kSamples, distance, sharpness, occupancy, transmittance, weight);
    RayWeightsBackward<T>(Ray::kSamples, distance, sharpness, occupancy, transmittance, delta, gradient);
  }
};

// A section's opacity 1 − e^ℓ is off by at most ℓ's error and two roundings; what passes i sections by the
// sum of those. A weight has two halves of a section, each with the transmittance before it. A gradient is s
// Φ(−s f) ≤ s times sums of weights and transmittances, each times a delta of at most 1; Φ itself follows the
// rounding of s f, of which it takes at most |s f| Φ(−|s f|) < 0.3.
TEST(HardCasesTraining, WeightsOfAMillionRaysAreThoseOfDouble) {
  uint64_t state = 1;
  double worst = 0, worst_phi = 0;
  for (int i = 0; i < kStates / 10; ++i) {
    const Ray ray = RandomRay(state, i);
    const Weighted<float> found(ray);
    const Weighted<double> expected(ray);
    double sum = 0, bound = 0;
    for (int k = 0; k < Ray::kSamples; ++k) {
      ASSERT_TRUE(std::isfinite(found.weight[k]) && found.weight[k] >= 0 && std::isfinite(found.gradient[k]))
          << i << " " << k;
      sum += found.weight[k];
      const double s = ray.sharpness;
      const double here = LogSigmoidError(s, ray.distance[k]);
      const double next = k + 1 < Ray::kSamples ? LogSigmoidError(s, ray.distance[k + 1]) : 0;
      bound += here + next + 4 * kRounding;
      const double most = std::min(bound, 1.0);
      ASSERT_NEAR(found.weight[k], expected.weight[k], most) << i << " " << k;
      // Φ(x) passes on no more than |x| Φ(x) of x's rounding; exp is good to 2, the sum and the division
      // round once each. Below the least normal number by that.
      const double x = std::abs(s * ray.distance[k]), phi = expected.occupancy[k];
      const double phi_most = kRounding * (x + 4 + 1e-5 * x) * phi + 0x1p-126;
      ASSERT_NEAR(found.occupancy[k], phi, phi_most) << i << " " << k;
      worst_phi = std::max(worst_phi, std::abs(found.occupancy[k] - phi) / phi_most);
      worst = std::max(worst, std::abs(found.weight[k] - expected.weight[k]) / most);
    }
    EXPECT_NEAR(sum, 1, 2 * Ray::kSamples * kRounding);
    for (int k = 0; k < Ray::kSamples; ++k) {
      const double slack = 4 * Ray::kSamples * kRounding + 4 * bound;
      ASSERT_NEAR(found.gradient[k], expected.gradient[k], ray.sharpness * std::min(slack, 4.0))
          << i << " " << k;
    }
  }
  EXPECT_LT(worst, 1);
  EXPECT_GT(worst, 1e-3);  // the bound isn't idle
  EXPECT_GT(worst_phi, 0.2);
}

// Of the linear weights a section's near share is off, beside the error of what it is made of, by the step
// between series and closed form, which float and double may take on either side: Δ³/720 at Δ = 0.2, of what
// the section takes. The closed form divides its terms by ΔΦ, which is 0.1 or more in the lumen and small
// only where the terms are as small; its derivative divides by Δ ≥ 0.2 once more.
TEST(HardCasesTraining, LinearWeightsOfAMillionRaysAreThoseOfDouble) {
  constexpr double kStep = 0.2 * 0.2 * 0.2 / 720;
  uint64_t state = 5;
  double worst = 0;
  for (int i = 0; i < kStates / 10; ++i) {
    constexpr int n = Ray::kSamples;
    const Ray ray = RandomRay(state, i);
    const float *f = ray.distance, *delta = ray.delta, s = ray.sharpness;
    double f_double[n], delta_double[n];
    std::copy_n(f, n, f_double);
    std::copy_n(delta, n, delta_double);
    float occupancy[n], transmittance[n], share[n], weight[n], gradient[n];
    double occupancy_double[n], transmittance_double[n], share_double[n], expected[n], slope[n];
    LinearRayWeights<float>(n, f, s, occupancy, transmittance, share, weight);
    LinearRayWeightsBackward<float>(n, f, s, occupancy, transmittance, share, delta, gradient);
    LinearRayWeights<double>(n, f_double, s, occupancy_double, transmittance_double, share_double, expected);
    LinearRayWeightsBackward<double>(n, f_double, s, occupancy_double, transmittance_double, share_double,
                                     delta_double, slope);
    double sum = 0, bound = 0;
    for (int k = 0; k < n; ++k) {
      ASSERT_TRUE(std::isfinite(weight[k]) && weight[k] >= 0 && std::isfinite(gradient[k])) << i << " " << k;
      sum += weight[k];
      const double next = k + 1 < n ? LogSigmoidError(s, f[k + 1]) : 0;
      bound += 11 * (LogSigmoidError(s, f[k]) + next) + kStep + 4 * kRounding;
      ASSERT_NEAR(weight[k], expected[k], std::min(bound, 1.0)) << i << " " << k;
      worst = std::max(worst, std::abs(weight[k] - expected[k]) / std::min(bound, 1.0));
    }
    EXPECT_NEAR(sum, 1, 3 * n * kRounding);
    for (int k = 0; k < n; ++k)
      ASSERT_NEAR(gradient[k], slope[k], s * std::min(20 * bound, 4.0)) << i << " " << k;
  }
  EXPECT_LT(worst, 1);
  EXPECT_GT(worst, 1e-3);
}

// Deep in the wall Φ(x) = eˣ: a section's opacity is 1 − e^(s Δf). Far inside the lumen it is 0. Across the
// wall it is 1.
TEST(HardCasesTraining, OpacityWithBothSigmoidsSaturated) {
  for (const double s : {1.0, 1e2, 1e4, 1e6}) {
    for (const double depth_mm : {100.0, 1e3}) {
      for (const double change : {1e-3, 0.5, 3.0, 50.0}) {
        const double wall[2] = {-depth_mm, -depth_mm - change / s},
                     lumen[2] = {depth_mm, depth_mm - change / s}, across[2] = {depth_mm, -depth_mm};
        double occupied[2], passes[2], weight[2];
        RayWeights<double>(2, wall, s, occupied, passes, weight);
        // s f has the rounding of a number of that size.
        EXPECT_NEAR(passes[1], std::exp(-change), 4 * 0x1p-53 * (s * depth_mm) + 1e-15)
            << s << " " << depth_mm;
        RayWeights<double>(2, lumen, s, occupied, passes, weight);
        EXPECT_NEAR(passes[1], 1, 1e-40 + std::exp(-s * (depth_mm - change / s)));
        RayWeights<double>(2, across, s, occupied, passes, weight);
        EXPECT_LT(passes[1], 1e-40);
        EXPECT_NEAR(weight[0], 0.5, 1e-15);
      }
    }
  }
  // And its gradient there, which no epsilon dampens: ∂(1 − e^(s(f₁ − f₀)))/∂f₀ = s e^(s(f₁ − f₀)).
  const double s = 1e3, wall[2] = {-500, -500.001};
  double occupied[2], passes[2], weight[2], gradient[2];
  RayWeights<double>(2, wall, s, occupied, passes, weight);
  const double first_only[2] = {1, 0};
  RayWeightsBackward<double>(2, wall, s, occupied, passes, first_only, gradient);
  EXPECT_NEAR(gradient[0], s * std::exp(-1.0) / 2, 1e-6 * s);
  EXPECT_NEAR(gradient[1], -s * std::exp(-1.0) / 2, 1e-6 * s);
}

// pow is good to 2 units in the last place, and takes its exponent's rounding times |log x|/γ; a tangent adds
// a product and a sum.
TEST(HardCasesTraining, CompressionOfAMillionRadiancesIsThatOfDouble) {
  uint64_t state = 2;
  for (int i = 0; i < kStates; ++i) {
    const double gamma = 1 + 1.6 * (Random(state) + 1) / 2;
    const float inverse = static_cast<float>(1 / gamma);
    const float floor = static_cast<float>(std::abs(RandomSize(state, -8, 0)));
    const float x = static_cast<float>(RandomSize(state, -44, 30));  // denormals too
    const Term<float> found = Compress(x, inverse, floor);
    const Term<double> expected = Compress<double>(x, inverse, floor);
    const double base = std::max(x, floor);
    const double relative = kRounding * (8 + std::abs(std::log(base)));
    const double size = std::pow(base, inverse) + std::abs(expected.slope * (double(x) - base));
    ASSERT_TRUE(std::isfinite(found.value) && std::isfinite(found.slope)) << x;
    ASSERT_NEAR(found.value, expected.value, relative * size) << x << " " << floor;
    ASSERT_NEAR(found.slope, expected.slope, relative * expected.slope) << x << " " << floor;
  }
}

// At 0, below it and at denormals the tangent of half an 8-bit step goes on: value and slope by hand.
TEST(HardCasesTraining, CompressionAtBlackAndBelow) {
  const double gamma = 2.2, step = 0.5 / 255, floor = std::pow(step, gamma);
  const double slope = step / (gamma * floor);
  for (const double x : {0.0, -0.0, 1e-310, 5e-324, -1e-310, -1.0, -1e6, floor / 2, floor}) {
    const Term<double> found = Compress(x, 1 / gamma, floor);
    EXPECT_NEAR(found.slope, slope, 1e-12 * slope) << x;
    EXPECT_NEAR(found.value, step + slope * (x - floor), 1e-12 * (step + slope * std::abs(x - floor))) << x;
  }
  double x = 1.7 * floor;
  const auto value = [&] { return Compress(x, 1 / gamma, floor).value; };
  EXPECT_NEAR(Compress(x, 1 / gamma, floor).slope, test::Difference(value, &x, 1e-3 * floor), 1e-6 * slope);
  // Nothing hides a NaN.
  EXPECT_TRUE(std::isnan(Compress(std::nan(""), 1 / gamma, floor).value));
}

// x²/(2 w): three roundings; |x| − w/2: two, of numbers no larger than |x| + w.
TEST(HardCasesTraining, HuberOfAMillionErrorsIsThatOfDouble) {
  uint64_t state = 3;
  for (int i = 0; i < kStates; ++i) {
    const float width = static_cast<float>(std::abs(RandomSize(state, -3, 1)));
    float x = static_cast<float>(RandomSize(state, -30, 30));
    if (i % 5 == 0) x = i % 2 ? width : std::nextafter(width, 1e9f);
    const Term<float> found = HuberLoss(x, width);
    const Term<double> expected = HuberLoss<double>(x, width);
    // Below 1e-19 a float's square is denormal or 0.
    const double tolerance = 4 * kRounding * std::abs(expected.value) + 4 * kRounding * width * (x > width);
    ASSERT_NEAR(found.value, expected.value, tolerance + 1e-37 / width) << x << " " << width;
    ASSERT_NEAR(found.slope, expected.slope, 2 * kRounding * std::abs(expected.slope) + 1e-44) << x;
    ASSERT_LE(std::abs(found.slope), 1);
  }
}

// The slope is 2(|g| − 1) along g/|g|. The norm's sum of squares is off by 3 roundings unless squares are
// below the normal numbers, |g| < 1e-18: then by 3 halves of the smallest, which the sum itself is at least
// unless it is 0: the slope is at most 2 √2.5 long, or 0, and keeps its direction.
TEST(HardCasesTraining, EikonalTermWhereTheGradientVanishes) {
  uint64_t state = 4;
  for (int i = 0; i < kStates; ++i) {
    const double size = std::abs(RandomSize(state, -44, 3));
    const Vec3f g(static_cast<float>(size * Random(state)), static_cast<float>(size * Random(state)),
                  static_cast<float>(size * Random(state)));
    Vec3f slope;
    const float loss = EikonalLoss(g, &slope);
    const double length = g.cast<double>().stableNorm();
    ASSERT_TRUE(std::isfinite(loss) && slope.allFinite()) << g.transpose();
    ASSERT_NEAR(loss, (length - 1) * (length - 1), 16 * kRounding * (1 + length) * (1 + length)) << length;
    if (length > 1e-18) {
      const Vec3d expected = 2 * (length - 1) / length * g.cast<double>();
      ASSERT_LT((slope.cast<double>() - expected).norm(), 16 * kRounding * (1 + length)) << length;
    } else {
      ASSERT_LE(slope.norm(), 2 * std::sqrt(2.5) * 1.001) << length;
    }
  }
  Vec3d slope;
  EXPECT_EQ(EikonalLoss<double>(Vec3d::Zero(), &slope), 1);
  EXPECT_EQ(slope, Vec3d::Zero());
}

FrameLight<double> TwoGuides(uint64_t& state) {
  FrameLight<double> light;
  for (const double side : {-1.0, 1.0}) {
    const Vec3d direction = Vec3d(0.2 * Random(state), 0.2 * Random(state), 1).normalized();
    light.sources.push_back({Vec3d(3 * side, Random(state), 0), direction, 2.8, Vec3d(3600, 3500, 3400)});
  }
  return light;
}

FrameLight<float> Rounded(const FrameLight<double>& light) {
  FrameLight<float> result;
  for (const auto& source : light.sources) {
    result.sources.push_back({source.position.cast<float>(), source.direction.cast<float>(),
                              static_cast<float>(source.spread), source.intensity.cast<float>()});
  }
  return result;
}
FrameLight<double> Widened(const FrameLight<float>& light) {
  FrameLight<double> result;
  for (const auto& source : light.sources) {
    result.sources.push_back({source.position.cast<double>(), source.direction.cast<double>(), source.spread,
                              source.intensity.cast<double>()});
  }
  return result;
}

// From 10⁻³ mm in front of a guide to 10⁴ mm away. The vector to the source is off by a rounding of the
// places' size over the distance d: e = 4ε(1 + 5/d) relative, which d² takes twice, the beam's exponent 2.8
// times, the cosine once, each beside a few roundings of its own; e^output takes the rounding of its
// argument.
TEST(HardCasesTraining, ShadingOfAMillionPlacesIsThatOfDouble) {
  uint64_t state = 5;
  for (int i = 0; i < kStates; ++i) {
    const FrameLight<float> light = Rounded(TwoGuides(state));
    const double d = std::abs(RandomSize(state, -3, 4));
    const Vec3d away(Random(state), Random(state), 0.2 + std::abs(Random(state)));
    const Vec3f point = light.sources[0].position + (d * away.normalized()).cast<float>();
    const Vec3f normal = Vec3d(Random(state), Random(state), Random(state) - 1).normalized().cast<float>();
    const Vec3f output(static_cast<float>(6 * Random(state)), static_cast<float>(6 * Random(state)), -1);
    const Vec3f ambient(1e-3f, 2e-3f, 0);
    const auto found = Shade<float>(Reflectance::kLambertian, output, normal, light, point, ambient);
    const auto expected =
        Shade<double>(Reflectance::kLambertian, output.cast<double>(), normal.cast<double>(), Widened(light),
                      point.cast<double>(), ambient.cast<double>());
    double facing = 0;  // what a patch that faced all sources would send
    double nearest = 1e30;
    for (const auto& source : light.sources) {
      const auto irradiance =
          IrradianceAt<double>(source.position.cast<double>(), source.direction.cast<double>(), source.spread,
                               point.cast<double>());
      facing += irradiance.per_intensity * 3600;
      nearest = std::min(nearest, (source.position - point).cast<double>().norm());
    }
    const double relative = (2 + 2.8 + 1) * 4 * kRounding * (1 + 5 / nearest) + 24 * kRounding;
    ASSERT_TRUE(found.radiance.allFinite() && found.by_output.allFinite() && found.by_normal.allFinite())
        << d;
    for (int c = 0; c < 3; ++c) {
      const double most = std::exp(double(output[c])) / kPi * (facing + ambient[c]) * relative;
      ASSERT_NEAR(found.radiance[c], expected.radiance[c], most) << d;
      // Where one of them sees a source set and the other does not, its cosine is a rounding from 0.
      const double cosine_error = (found.by_normal.row(c).cast<double>() - expected.by_normal.row(c)).norm();
      if (cosine_error > 4 * most) {
        double least = 1;
        for (const auto& source : light.sources)
          least = std::min(least, std::abs(double(normal.dot((source.position - point).normalized()))));
        ASSERT_LT(least, 8 * kRounding * (1 + 5 / nearest)) << d;
      }
    }
  }
}

// From any state that training can come to: a gradient below kLargestGradient, moments of such. The moments
// are sums of two numbers, off by 3 and 4 roundings of their size; the step takes the first's whole and half
// of the second's, which is relative, beside its own 5.
TEST(HardCasesTraining, AdamOfAMillionStatesIsThatOfDouble) {
  uint64_t state = 11;
  const double beta1 = static_cast<float>(kAdamBeta1), fresh1 = 1 - static_cast<float>(kAdamBeta1);
  for (int i = 0; i < kStates; ++i) {
    const AdamStep step(1e-2, 1 + i % 5000, 0.99, i % 2 == 0 ? kLeastAdamEpsilon : 1e-4);
    float parameter = static_cast<float>(Random(state)), before = parameter;
    float gradient = static_cast<float>(RandomSize(state, -15, 8)), g = gradient;
    float first = static_cast<float>(RandomSize(state, -15, 8)), m0 = first;
    float second = static_cast<float>(std::abs(RandomSize(state, -30, 16))), v0 = second;
    AdamUpdate(step, 1, &parameter, &gradient, &first, &second);
    const double b2 = step.beta2, m = beta1 * m0 + fresh1 * g,
                 v = b2 * v0 + double(1 - step.beta2) * g * double(g);
    const double size = std::abs(beta1 * m0) + std::abs(fresh1 * g);
    ASSERT_NEAR(first, m, 3 * kRounding * size) << i;
    ASSERT_NEAR(second, v, 4 * kRounding * v) << i;
    const double divisor = std::sqrt(v * step.second_correction) + step.epsilon,
                 rate = double(step.rate) * step.first_correction;
    const double moved = rate * m / divisor, most = rate * size / divisor;
    ASSERT_NEAR(parameter, before - moved, kRounding * (10 * most + std::abs(before) + std::abs(moved))) << i;
    ASSERT_EQ(gradient, 0);
  }
}

// Irradiance on a facing patch on the axis is exactly intensity/d²; at the source itself nothing has a
// direction and a Lambertian wall gets nothing.
TEST(HardCasesTraining, InverseSquareFromTheSourceToTenMetres) {
  FrameLight<double> light;
  light.sources.push_back({Vec3d::Zero(), Vec3d::UnitZ(), 2.8, Vec3d::Constant(3600)});
  const auto at = [&](double d) {
    return Shade<double>(Reflectance::kLambertian, Vec3d::Zero(), -Vec3d::UnitZ(), light, Vec3d(0, 0, d),
                         Vec3d::Zero());
  };
  for (const double d : {1e-100, 1e-6, 1e-3, 0.5, 1.0, 70.0, 1e4}) {
    const double expected = 3600 / kPi / (d * d);
    EXPECT_NEAR(at(d).radiance[0], expected, 1e-15 * 4 * expected) << d;
    EXPECT_NEAR(-at(d).by_normal(0, 2), expected, 1e-15 * 4 * expected) << d;
  }
  EXPECT_EQ(at(0).radiance, Vec3d::Zero());
  EXPECT_EQ(at(0).by_normal, Mat3d::Zero());
}

}  // namespace
}  // namespace lumen
