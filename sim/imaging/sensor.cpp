#include "sim/imaging/sensor.h"

#include <cmath>
#include <numeric>

#include "common/math.h"
#include "common/parallel.h"

namespace lumen {
namespace {

// The power that sRGB's two branches together follow, to within 0.034 of full scale.
constexpr double kSrgbGamma = 2.2;

AutoGain ReadAutoGain(const ConfigTable& table) {
  AutoGain options;
  options.target = table.Number("target", options.target, {0.01, 0.99});
  options.settling_s = table.Number("settling_s", options.settling_s, {1e-3, 1e3});
  options.damping = table.Number("damping", options.damping, {0.05, 10});
  options.frame_rate_hz = table.Number("frame_rate_hz", options.frame_rate_hz, {1e-2, 1e5});
  options.metered_every = static_cast<int>(table.Integer("metered_every", options.metered_every, {1, 10000}));
  return options;
}

GainSwing ReadGainSwing(const ConfigTable& table) {
  GainSwing swing;
  swing.factor = table.Number("factor", swing.factor, {1, 1e3});
  swing.period = table.Number("period", swing.period, {1, 1e6});
  return swing;
}

double PixelVignetting(const Response& response, const Camera<double>& camera, int x, int y) {
  const auto ray = camera.Unproject(Vec2d(x, y));
  return ray ? Vignetting(response, ray->z()) : 0.0;
}

// x″ = −2ζω x′ − ω² x, solved over a fixed time: (x, x′) afterwards = matrix · (x, x′) before. The matrix is
// exp(A t) with A = [[0, 1], [−ω², −2ζω]], whose eigenvalues are −ζω ± s, s² = ω²(ζ² − 1):
// exp(A t) = even · I + odd · (A + ζω I), even = e^(−ζωt) cosh(s t), odd = e^(−ζωt) sinh(s t)/s.
Eigen::Matrix2d Propagator(double omega, double damping, double time_s) {
  const double decay = damping * omega;
  const double s_squared = omega * omega * (damping * damping - 1);
  const double s = std::sqrt(std::abs(s_squared));
  double even, odd;
  if (s == 0) {
    even = std::exp(-decay * time_s);
    odd = even * time_s;
  } else if (s_squared < 0) {
    even = std::exp(-decay * time_s) * std::cos(s * time_s);
    odd = std::exp(-decay * time_s) * std::sin(s * time_s) / s;
  } else {
    const double slow = std::exp((s - decay) * time_s), fast = std::exp((-s - decay) * time_s);
    even = (slow + fast) / 2;
    odd = (slow - fast) / (2 * s);
  }
  Eigen::Matrix2d propagator;
  propagator << even + decay * odd, odd, -omega * omega * odd, even - decay * odd;
  return propagator;
}

}  // namespace

Sensor ReadSensor(const ConfigTable& table) {
  Sensor sensor;
  if (const auto auto_gain = table.Optional("auto_gain")) {
    for (const char* key : {"gain", "gain_swing"}) {
      if (table.Has(key)) table.Fail(key, "has no effect beside auto_gain; leave one of the two out");
    }
    sensor.auto_gain = ReadAutoGain(*auto_gain);
  } else {
    sensor.gain = table.Number("gain", sensor.gain, kPositive);
    if (const auto swing = table.Optional("gain_swing")) sensor.gain_swing = ReadGainSwing(*swing);
  }
  sensor.record_gain = table.Flag("record_gain", sensor.record_gain);
  if (const auto noise = table.Optional("noise")) sensor.noise = ReadSensorNoise(*noise);
  if (const auto shutter = table.Optional("shutter")) sensor.shutter = ReadShutter(*shutter);
  if (const auto jpeg = table.Optional("jpeg")) sensor.jpeg = ReadJpeg(*jpeg);
  return sensor;
}

double MeterBrightness(const Response& response, const ImageF& radiance, const Image8& valid,
                       const Camera<double>& camera) {
  const double gamma = response.srgb ? kSrgbGamma : response.gamma;
  // By rows, added up in their order: the sum doesn't depend on the threads.
  std::vector<double> sums(radiance.height, 0);
  std::vector<int64_t> counts(radiance.height, 0);
  ParallelFor(0, radiance.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < radiance.width; ++x) {
      if (!*valid.Pixel(x, y)) continue;
      const float* rgb = radiance.Pixel(x, y);
      double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
      if (response.vignetting != 0) luminance *= PixelVignetting(response, camera, x, y);
      sums[y] += std::pow(luminance, 1 / gamma);
      ++counts[y];
    }
  });
  const int64_t count = std::accumulate(counts.begin(), counts.end(), int64_t{0});
  if (count == 0) return 0;
  return std::pow(std::accumulate(sums.begin(), sums.end(), 0.0) / count, gamma);
}

std::vector<double> RunAutoGain(const AutoGain& options, const Response& response,
                                const std::vector<double>& brightness) {
  // The envelope of a step's response is e^(−ζωt): e^−4 = 1.8% is left after settling_s.
  const double omega = 4 / (options.damping * options.settling_s);
  const Eigen::Matrix2d propagator = Propagator(omega, options.damping, 1 / options.frame_rate_hz);
  const double log_target = std::log(Decode(response, options.target));

  std::vector<double> gains(brightness.size());
  double called_for = 0;        // log gain
  Eigen::Vector2d state(0, 0);  // log gain, and its change per second
  for (size_t frame = 0; frame < brightness.size(); ++frame) {
    const double metered = brightness[frame == 0 ? 0 : frame - 1];
    if (metered != 0) called_for = log_target - std::log(metered);
    const Eigen::Vector2d rest(called_for, 0);
    state = frame == 0 ? rest : Eigen::Vector2d(rest + propagator * (state - rest));
    gains[frame] = std::exp(state[0]);
  }
  return gains;
}

double GainAt(double gain, const GainSwing& swing, int frame) {
  return gain * std::pow(swing.factor, std::sin(2 * kPi * frame / swing.period) / 2);
}

ImageF VignettingMap(const Response& response, const Camera<double>& camera) {
  ImageF map(camera.intrinsics().width, camera.intrinsics().height, 1, 1.0f);
  if (response.vignetting == 0) return map;
  ParallelFor(0, map.height, [&](int64_t y) {
    for (int x = 0; x < map.width; ++x) {
      *map.Pixel(x, int(y)) = static_cast<float>(PixelVignetting(response, camera, x, int(y)));
    }
  });
  return map;
}

Image8 Develop(const Response& response, double gain, const ImageF& radiance, const ImageF& vignetting,
               const Image8& valid) {
  Image8 developed(radiance.width, radiance.height, 3);
  ParallelFor(0, radiance.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < radiance.width; ++x) {
      if (!*valid.Pixel(x, y)) continue;
      const float scale = static_cast<float>(gain) * *vignetting.Pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        developed.Pixel(x, y)[c] = Quantise(Encode(response, scale * radiance.Pixel(x, y)[c]));
      }
    }
  });
  return developed;
}

}  // namespace lumen
