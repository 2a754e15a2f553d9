// What a sequence's own files don't know of its frames' gains and of its light, estimated from the colour
// frames, the poses, the camera and the guides' places alone.
#pragma once

#include <cstdint>
#include <vector>

#include "common/sequence.h"
#include "recon/calibration/gain_fit.h"
#include "recon/calibration/places.h"
#include "recon/calibration/quick_surface.h"

namespace lumen {

struct CalibrateOptions {
  QuickSurfaceOptions surface;
  SightingOptions sightings;
  GainFitOptions fit;
  int rounds = 3;  // of bounced light and gains in turn
  // The data tell the spread or γ where its standard error is at most this part of it.
  double tells_within = 0.05;
  // Spread and γ are in doubt: gains are estimated along with those of them that the data tell.
  bool light = false;
};

// The standard error holds the scatter among places and what halves of the data (near and far, steep and
// shallow, red and the other channels) differ by.
struct Estimate {
  double value = 0;
  double standard_error = 0;
  // Half of the 95% interval.
  double Reach() const { return 1.959964 * standard_error; }
};

struct SequenceCalibration {
  std::vector<Estimate> log_gain;  // a frame; the first one's is 0
  GainFit fit;                     // behind it
  // Of the light's sources, averaged; of the response, where that is a power.
  Estimate spread, gamma;
  bool tells_spread = false, tells_gamma = false;
  // By training alone, without looking at the places: frames and log gains.
  std::vector<int> learnt_frames;
  std::vector<double> learnt_log_gain;
};

// Depth, normals, true mesh and gains of the sequence are not looked at. Throws InputError: fewer than two
// frames, frames that share too few places, whatever training throws.
SequenceCalibration Calibrate(const Sequence& sequence, const CalibrateOptions& options, uint64_t seed);

}  // namespace lumen
