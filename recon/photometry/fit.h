// Least squares of the photometric model (the paper's eq. 3) in the logarithm of radiance:
//   log Decode(code) = log gain of the frame + log albedo of the channel
//                      + contrast · log( vignetting · Σ_sources intensity · t^a · cos^b · exp(−spread·(1 −
//                      D·L)) )
// with t the distance to the source and cos that of the incidence. What light and wall do by themselves is
// a = −2, b = 1 and contrast = 1. Under a power response of assumed γ a true γ′ shows as a contrast of γ/γ′.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "recon/photometry/observations.h"

namespace lumen {

// What a fit can leave free besides the intercepts.
enum class Parameter { kTExponent, kCosExponent, kSpread, kContrast, kGainExponent };
inline constexpr int kParameters = 5;

// Values of all of them. kSpread is the mean of the sources' spreads: they keep their differences.
using ParameterValues = std::array<double, kParameters>;

struct FitOptions {
  std::vector<int> channels = {0, 1, 2};
  std::vector<Parameter> free = {Parameter::kTExponent, Parameter::kCosExponent, Parameter::kSpread};
  // Frames share an intercept, and differ by gain exponent times the logarithm of the sequence's own gains.
  bool known_gains = false;
};

// The pattern of light on a pixel's place in a channel: log of the sum above, vignetting included, and its
// derivatives by the exponents and the spread. Those by a and b are the sources' log t and log cos, averaged
// by their shares of the light.
struct Pattern {
  double log_sum;
  double by_t, by_cos, by_spread;
};

// Where the sequence's light and response put the parameters: −2, 1, the mean spread, 1, 1.
ParameterValues NominalParameters(const Calibration& calibration);

Pattern PatternAt(const Observations& observations, int64_t pixel, int channel,
                  const ParameterValues& values);

struct Fit {
  ParameterValues values;            // those that weren't free are nominal
  ParameterValues standard_error{};  // 0 where not free
  std::vector<double> log_gain;      // a used frame, about their mean; empty with known gains
  std::vector<double> log_gain_error;
  double r_squared = 0, r_squared_error = 0;  // of the scatter within frames and channels
  double residual = 0, residual_error = 0;    // root mean square, in log
  double scatter = 0;            // the same without a light model: about frames' and channels' means
  int64_t count = 0;             // pixels times channels
  std::vector<float> residuals;  // pixel by channel (3 a pixel), NaN where not used
};

// Gauss–Newton from the nominal values; linear, and so done in one step, for a single source and contrast 1.
//
// Standard errors are cluster-robust: neighbouring pixels share albedo and interreflection, so what scatters
// independently are places on the wall, not pixels. With X_k and e_k the rows and residuals of cell k,
//   cov = (XᵀX)⁻¹ (Σ_k X_kᵀ e_k e_kᵀ X_k) (XᵀX)⁻¹ · K/(K − 1) · (N − 1)/(N − P)
// (White 1980, "A heteroskedasticity-consistent covariance matrix estimator"; Liang and Zeger 1986,
// "Longitudinal data analysis using generalized linear models"; the correction for few clusters as in Cameron
// and Miller 2015, "A practitioner's guide to cluster-robust inference", eq. 12).
//
// What the model leaves out goes into the figures: interreflection flattens the exponents; noise of a
// relative variance v lowers a logarithm by v/2 in the mean, more so where it is dark; and where the albedo
// varies, leaving saturated pixels out leaves the darker ones in, which flattens the exponents where many
// are.
//
// Throws InputError where the pixels can't tell the parameters apart (all of one distance, …).
Fit FitModel(const Observations& observations, const FitOptions& options);

}  // namespace lumen
