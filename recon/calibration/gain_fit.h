// The regression that gains are read from: a place of the wall that several frames show differs between them
// by gain and by light only.
#pragma once

#include <array>
#include <vector>

#include "common/config.h"
#include "recon/calibration/bounced_light.h"
#include "recon/calibration/places.h"

namespace lumen {

struct GainFitOptions {
  // What is estimated besides gains, the places' albedo (of each channel) and, where `bounced` light is
  // given, its strength.
  bool spread = false;    // by how much all guides' spreads are off
  bool contrast = false;  // exponent of all of the light: γ of the response over the true one
  // Of view and of incidence; and distances from the camera: nearer, a mm of error of the surface is too
  // much.
  Range cosine = {0.2, 1};
  Range distance_mm = {3, 1e3};
  std::array<bool, 3> channels{true, true, true};  // that count
  double cell_mm = 8;   // side of the cubes in the world whose places may err together
  int min_places = 30;  // that a frame must share with others
};

struct GainFit {
  WallModel wall;                  // frame 0's gain is 1; values
  Eigen::VectorXd log_gain_error;  // standard errors; 0 for frame 0
  double spread_off = 0, contrast = 1;
  double spread_error = 0, contrast_error = 0;
  double residual = 0;       // robust standard deviation in log
  int64_t observations = 0;  // of a place in a frame and a channel
  int places = 0;            // that count
};

// log value = albedo(place, channel) + contrast · log(gain · irradiance/π · exp(spread_off · by_spread) +
// strength · bounced) + residual, by Gauss–Newton with Tukey's biweight, which glints fall to; errors are
// cluster-robust over cells of the wall. The cosine's exponent isn't free: on a surface that errs it would be
// diluted, and the gains with it. bounced: a table a channel, or none. start: null, or where to start from.
// Throws InputError naming the first frame that shares too few places with others.
GainFit FitGains(const Sequence& sequence, const Sightings& sightings,
                 const std::vector<Eigen::ArrayXXf>& bounced, const GainFitOptions& options,
                 const GainFit* start = nullptr);

}  // namespace lumen
