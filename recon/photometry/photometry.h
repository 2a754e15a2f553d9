// Regression of the photometric model over a sequence: every figure with its standard error.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recon/photometry/fit.h"
#include "recon/photometry/observations.h"

namespace lumen {

// A number that the data say, under the name that JSON and baselines know it by.
struct Figure {
  std::string name;
  double value = 0;
  double standard_error = 0;
  std::optional<double> expected;  // by the sequence's own calibration, where it says anything
};

// Mean of a quantity over the pixels within a range of another.
struct Bin {
  double from = 0, to = 0;
  int64_t count = 0;
  double mean = 0;
  double standard_error = 0;  // cluster-robust, with the fit's parameters taken as they are
  double rms = 0;
  double at = 0;  // mean of what the range is of
};

struct Photometry {
  Fit all;                      // the channels in common
  std::vector<int> channels;    // that have pixels enough
  std::vector<Fit> by_channel;  // as `channels`
  std::vector<Figure> figures;
  std::vector<int> frame_numbers;  // of those used
  std::vector<int> left_out;       // numbers of the others
  // Residuals (log) by distance (mm) and by incidence (degrees) of the light, empty bins left out.
  std::vector<Bin> by_distance, by_angle;
  // What the model says about one of its factors, seen alone: log radiance less all other factors, against
  // log t (t in mm), log cos and 1 − D·L.
  std::vector<Bin> factor_t, factor_cos, factor_axis;

  const Figure* Find(const std::string& name) const;
};

// "red", "green", "blue".
const char* ChannelName(int channel);
// "log_gain.0012".
std::string GainFigureName(int frame_number);

// Fits the model to all channels together and to each alone, then:
// - γ, with the exponents held at −2 and 1 and the spread free: exponents and γ can't both be free, as a
//   power of a power is a power. For a response that is a power only.
// - γ from the gains, with exponents free, where the sequence knows its gains and they differ: radiance then
//   goes up by known factors, whatever falls off with distance.
// Throws InputError.
Photometry FitPhotometry(const Observations& observations, const PhotometryOptions& options);

}  // namespace lumen
