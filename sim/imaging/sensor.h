// From linear radiance to what the colour file holds: vignetting, noise, gain, saturation, gamma or sRGB, 8
// bits.
#pragma once

#include <optional>
#include <vector>

#include "common/camera.h"
#include "common/config.h"
#include "common/image.h"
#include "common/response.h"
#include "sim/imaging/jpeg.h"
#include "sim/imaging/noise.h"
#include "sim/imaging/shutter.h"

namespace lumen {

// Automatic brightness: a damped loop on the logarithm of the gain that follows what the frame before called
// for.
struct AutoGain {
  double target = 0.4;      // encoded brightness that it aims at
  double settling_s = 0.4;  // until within 2% of a step, for damping up to 0.8; above that slower
  double damping = 0.6;
  double frame_rate_hz = 29.97;
  int metered_every =
      1;  // frames; brightness is interpolated over those between, so that long videos are quick
};

// A gain that goes up and down from frame to frame by a known rule: what a calibration is held against.
struct GainSwing {
  double factor = 4;      // the largest gain over the smallest
  double period = 13.37;  // frames
};

struct Sensor {
  double gain = 1;
  std::optional<GainSwing> gain_swing;  // about `gain`
  std::optional<AutoGain> auto_gain;    // then `gain` doesn't count
  std::optional<SensorNoise> noise;
  std::optional<Jpeg> jpeg;
  std::optional<Shutter> shutter;
  bool record_gain = true;  // false: sequence.toml leaves the gains out
};

// Reads the scene's [sensor].
Sensor ReadSensor(const ConfigTable& sensor);

// Brightness of a frame at gain 1: the power mean of its valid pixels' luminance (Rec. 709) with exponent
// 1/γ, so that a gain times it is the brightness at that gain. radiance: linear, without vignetting.
double MeterBrightness(const Response& response, const ImageF& radiance, const Image8& valid,
                       const Camera<double>& camera);

// Gains of consecutive frames. brightness: of each, from MeterBrightness; the first frame finds the loop at
// rest. A black frame (brightness 0) calls for no change.
std::vector<double> RunAutoGain(const AutoGain& options, const Response& response,
                                const std::vector<double>& brightness);

// gain · factor^(sin(2π frame/period)/2).
double GainAt(double gain, const GainSwing& swing, int frame);

// Vignetting of every pixel, one channel; computed once a render.
ImageF VignettingMap(const Response& response, const Camera<double>& camera);

// The colour file's pixels. Pixels that aren't valid are black.
Image8 Develop(const Response& response, double gain, const ImageF& radiance, const ImageF& vignetting,
               const Image8& valid);

}  // namespace lumen
