#include "recon/network/adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/random.h"

namespace lumen {
namespace {

constexpr double kRate = 0.01, kBeta2 = 0.99;
constexpr size_t kCount = 37;
constexpr int kSteps = 50;

// Of parameter i: from 1e-12 to 1e3, as tables and networks have them.
float Gradient(int step, size_t i) {
  const double size = std::pow(10.0, -12 + 15 * double(i) / (kCount - 1));
  return static_cast<float>(size * (2 * UniformDouble(RandomBits(5, step, i)) - 0.7));
}

// Algorithm 1 of Kingma and Ba, 2015, in double.
std::vector<double> Reference(double epsilon) {
  std::vector<double> parameter(kCount), first(kCount), second(kCount);
  for (int step = 1; step <= kSteps; ++step) {
    for (size_t i = 0; i < kCount; ++i) {
      const double g = Gradient(step, i);
      first[i] = kAdamBeta1 * first[i] + (1 - kAdamBeta1) * g;
      second[i] = kBeta2 * second[i] + (1 - kBeta2) * g * g;
      const double m = first[i] / (1 - std::pow(kAdamBeta1, step)),
                   v = second[i] / (1 - std::pow(kBeta2, step));
      parameter[i] -= kRate * m / (std::sqrt(v) + epsilon);
    }
  }
  return parameter;
}

std::vector<float> Kernel(double epsilon) {
  std::vector<float> parameter(kCount), gradient(kCount), first(kCount), second(kCount);
  for (int step = 1; step <= kSteps; ++step) {
    for (size_t i = 0; i < kCount; ++i) gradient[i] = Gradient(step, i);
    AdamUpdate(AdamStep(kRate, step, kBeta2, epsilon), kCount, parameter.data(), gradient.data(),
               first.data(), second.data());
    for (float g : gradient) EXPECT_EQ(g, 0);
  }
  return parameter;
}

double Difference(const std::vector<float>& kernel, const std::vector<double>& reference) {
  double worst = 0;
  for (size_t i = 0; i < kCount; ++i) worst = std::max(worst, std::abs(double(kernel[i]) - reference[i]));
  return worst;
}

TEST(Adam, IsThePublishedOne) {
  // A step of at most 1.5 rates comes out of a dozen roundings, and a moment keeps those of the steps before.
  const double bound = kSteps * 1.5 * kRate * 24 * std::ldexp(1.0, -24);
  for (double epsilon : {kLeastAdamEpsilon, 1e-4}) {
    EXPECT_LT(Difference(Kernel(epsilon), Reference(epsilon)), bound) << epsilon;
  }
  EXPECT_GT(Difference(Kernel(1e-4), Reference(1.1e-4)), bound);
  EXPECT_GT(Difference(Kernel(1e-4), Reference(kLeastAdamEpsilon)), bound);
}

TEST(Adam, EpsilonHoldsWhatHardlyARayTellsOf) {
  const std::vector<float> free = Kernel(kLeastAdamEpsilon), held = Kernel(1e-4);
  // Without it gradients of 1e-12 take a parameter as far as those of 1e3; with it by their part of it.
  EXPECT_GT(std::abs(free[0]), 10 * kRate);
  EXPECT_LT(std::abs(held[0]), kSteps * kRate * 1e-12 / 1e-4);
  EXPECT_NEAR(held[kCount - 1], free[kCount - 1], 1e-6);
}

TEST(Adam, MomentsOfNothingAreNothing) {
  float parameter = 1, gradient = 1e-25f, first = 0, second = 0;
  AdamUpdate(AdamStep(kRate, 1, kBeta2), 1, &parameter, &gradient, &first, &second);
  EXPECT_EQ(second, 0);  // 1e-52 has no float
  EXPECT_GT(first, 0);
  EXPECT_NEAR(parameter, 1, kRate * 1.0001e-10);  // 1e-25 / kLeastAdamEpsilon
  for (int step = 2; step < 400; ++step)
    AdamUpdate(AdamStep(kRate, step, kBeta2), 1, &parameter, &gradient, &first, &second);
  EXPECT_EQ(first, 0);  // before it decays below the least normal float
}

}  // namespace
}  // namespace lumen
