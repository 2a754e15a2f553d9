// The long numbers were worked out apart from this code in 40-digit decimal arithmetic (Python's `decimal`).
#include "common/response.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace lumen {
namespace {

const Response kGamma22{.gamma = 2.2};
const Response kSrgb{.srgb = true};
const Response kIdentity{.gamma = 1};

template <class T>
class ResponseOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(ResponseOf, Scalars);

// x^p is right to a few units of x and p each; p = 1/γ rounded counts |log x| < 7 times.
template <class T>
constexpr double kRelative = 10 * std::numeric_limits<T>::epsilon();

TYPED_TEST(ResponseOf, GammaAgreesWithNumbersWorkedOutApart) {
  using T = TypeParam;
  const struct {
    double linear, encoded, slope;
  } examples[] = {{0.001, 0.0432876128108305834740, 19.676187641286628851827},
                  {0.18, 0.4586564468643811361444, 1.1582233506676291316778},
                  {0.5, 0.7297400528407230979206, 0.6634000480370209981097},
                  {0.9, 0.9532375475512687306030, 0.4814331048238730962641}};
  for (const auto& [linear, encoded, slope] : examples) {
    EXPECT_NEAR(Encode(kGamma22, T(linear)), encoded, encoded * kRelative<T>);
    EXPECT_NEAR(Decode(kGamma22, T(encoded)), linear, linear * kRelative<T>);
    EXPECT_NEAR(EncodeDerivative(kGamma22, T(linear)), slope, slope * kRelative<T>);
  }
}

TYPED_TEST(ResponseOf, SrgbAgreesWithNumbersWorkedOutApart) {
  using T = TypeParam;
  const struct {
    double linear, encoded;
  } examples[] = {{0.002, 0.02584},
                  {0.01, 0.0998528227341283365671},
                  {0.18, 0.4613561295004416498628},
                  {0.5, 0.7353569830524494906166},
                  {0.9, 0.9546871718858662829871},
                  {0.0030959752321981424148, 0.04},
                  {0.2140411404822324424030, 0.5},
                  {0.6038273388553374807280, 0.8}};
  for (const auto& [linear, encoded] : examples) {
    EXPECT_NEAR(Encode(kSrgb, T(linear)), encoded, encoded * kRelative<T>);
    EXPECT_NEAR(Decode(kSrgb, T(encoded)), linear, linear * kRelative<T>);
  }
  // The branches meet within the standard's own gap.
  EXPECT_NEAR(Encode(kSrgb, 0.0031308), Encode(kSrgb, std::nextafter(0.0031308, 1.0)), 1e-7);
  // A power of 2.2 must not pass for sRGB.
  EXPECT_GT(std::abs(Encode(kGamma22, 0.01) - Encode(kSrgb, 0.01)), 0.02);
}

TYPED_TEST(ResponseOf, GammaOneIsTheIdentity) {
  using T = TypeParam;
  for (int i = 0; i <= 1000; ++i) {
    const T x = T(i) / 1000;
    EXPECT_EQ(Encode(kIdentity, x), x);
    EXPECT_EQ(Decode(kIdentity, x), x);
    EXPECT_EQ(EncodeDerivative(kIdentity, x), T(1));
  }
}

TYPED_TEST(ResponseOf, DecodeUndoesEncode) {
  using T = TypeParam;
  for (const Response& response : {kGamma22, kSrgb, Response{.gamma = 0.8}}) {
    for (int i = 0; i <= 1000; ++i) {
      const T x = T(i) / 1000;
      // sRGB's two thresholds, rounded apart in the standard, let the branches differ by 1e-8 where they
      // meet.
      EXPECT_NEAR(Decode(response, Encode(response, x)), x, 3 * kRelative<T> + (response.srgb ? 2e-8 : 0));
    }
    for (int code = 0; code < 256; ++code) {
      EXPECT_EQ(Quantise(Encode(response, Decode(response, T(code) / 255))), code);
    }
  }
}

TYPED_TEST(ResponseOf, ClipsAndKeepsNaN) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  for (const Response& response : {kGamma22, kSrgb, kIdentity}) {
    EXPECT_EQ(Encode(response, T(-0.3)), T(0));
    EXPECT_NEAR(Encode(response, T(7)), 1, kRelative<T>);
    EXPECT_NEAR(Encode(response, std::numeric_limits<T>::infinity()), 1, kRelative<T>);
    EXPECT_EQ(Decode(response, T(-1)), T(0));
    EXPECT_NEAR(Decode(response, T(2)), 1, kRelative<T>);
    EXPECT_TRUE(std::isnan(Encode(response, nan)));
    EXPECT_TRUE(std::isnan(Decode(response, nan)));
    EXPECT_TRUE(std::isnan(EncodeDerivative(response, nan)));
    EXPECT_EQ(EncodeDerivative(response, T(-0.01)), T(0));
    EXPECT_EQ(EncodeDerivative(response, T(1.01)), T(0));
  }
}

// Central differences in double: the truncation is h²/6 · f‴, the rounding ε/h, both relative below 1e-8 for
// h = 1e-5·x.
TEST(Response, DerivativeAgreesWithFiniteDifferences) {
  for (const Response& response :
       {kGamma22, kSrgb, kIdentity, Response{.gamma = 0.8}, Response{.gamma = 3}}) {
    for (const double x : {1e-4, 0.002, 0.0032, 0.01, 0.2, 0.7, 0.99}) {
      const double h = 1e-5 * x;
      const double expected = (Encode(response, x + h) - Encode(response, x - h)) / (2 * h);
      EXPECT_NEAR(EncodeDerivative(response, x), expected, 1e-8 * expected) << response.gamma << " " << x;
    }
  }
}

TYPED_TEST(ResponseOf, DerivativeIsBoundedWherePixelsRoundToZero) {
  using T = TypeParam;
  const double bound = 806.60615281545938560037;  // (0.5/255)^(1 − 2.2)/2.2
  const double edge = 0.0000011049575980011891;   // (0.5/255)^2.2
  EXPECT_NEAR(EncodeDerivative(kGamma22, T(0)), bound, bound * kRelative<T>);
  EXPECT_EQ(EncodeDerivative(kGamma22, T(0)), EncodeDerivative(kGamma22, T(0.99 * edge)));
  EXPECT_GT(EncodeDerivative(kGamma22, T(0)), EncodeDerivative(kGamma22, T(1.01 * edge)));
  // The edge is where pixel 0 ends.
  EXPECT_EQ(Quantise(Encode(kGamma22, T(0.99 * edge))), 0);
  EXPECT_EQ(Quantise(Encode(kGamma22, T(1.01 * edge))), 1);
  // γ < 1 has no steep end.
  EXPECT_EQ(EncodeDerivative(Response{.gamma = 0.5}, T(0)), T(0));
}

TYPED_TEST(ResponseOf, VignettingIsAPowerOfTheCosine) {
  using T = TypeParam;
  const Response response{.vignetting = 1.5};
  EXPECT_EQ(Vignetting(response, T(1)), T(1));
  EXPECT_NEAR(Vignetting(response, T(0.5)), 0.3535533905932737622004, kRelative<T>);
  EXPECT_EQ(Vignetting(response, T(0)), T(0));
  EXPECT_EQ(Vignetting(response, T(-0.1)), T(0));
  EXPECT_EQ(Vignetting(Response{}, T(-0.1)), T(1));
}

TYPED_TEST(ResponseOf, QuantiseRoundsToNearest) {
  using T = TypeParam;
  EXPECT_EQ(Quantise(T(0)), 0);
  EXPECT_EQ(Quantise(T(0.499 / 255)), 0);
  EXPECT_EQ(Quantise(T(0.501 / 255)), 1);
  EXPECT_EQ(Quantise(T(254.499 / 255)), 254);
  EXPECT_EQ(Quantise(T(254.501 / 255)), 255);
  EXPECT_EQ(Quantise(T(-4)), 0);
  EXPECT_EQ(Quantise(T(4)), 255);
  EXPECT_EQ(Quantise(std::numeric_limits<T>::infinity()), 255);
  EXPECT_EQ(Quantise(std::numeric_limits<T>::quiet_NaN()), 0);
}

}  // namespace
}  // namespace lumen
