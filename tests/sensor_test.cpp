#include "sim/imaging/sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "common/error.h"
#include "tests/support.h"

namespace lumen {
namespace {

// The principal point on the left pixel, a focal length of 1 px: pixel x is seen at the angle atan(x).
Camera<double> WidePinhole(int width, int height = 1) {
  CameraIntrinsics intrinsics;
  intrinsics.width = width;
  intrinsics.height = height;
  intrinsics.fx = intrinsics.fy = 1;
  return Camera<double>(intrinsics);
}

ImageF Grey(const std::vector<float>& values) {
  ImageF image(static_cast<int>(values.size()), 1, 3);
  for (size_t x = 0; x < values.size(); ++x) std::fill_n(image.Pixel(int(x), 0), 3, values[x]);
  return image;
}

Response Gamma(double gamma, double vignetting = 0) {
  Response response;
  response.gamma = gamma;
  response.vignetting = vignetting;
  return response;
}

std::vector<double> LogGains(const AutoGain& options, const Response& response,
                             const std::vector<double>& brightness) {
  std::vector<double> gains = RunAutoGain(options, response, brightness);
  for (double& gain : gains) gain = std::log(gain);
  return gains;
}

// Part of a step that is left at each frame after it, sampled finely; a step in brightness from 1 to 8.
std::vector<double> StepLeft(AutoGain options, double frame_rate_hz, int frames) {
  options.frame_rate_hz = frame_rate_hz;
  std::vector<double> brightness(frames + 1, 8.0);
  brightness[0] = 1;
  const std::vector<double> gains = LogGains(options, Gamma(1), brightness);
  const double last = std::log(options.target / 8), first = std::log(options.target);
  std::vector<double> left;
  for (int i = 1; i <= frames; ++i) left.push_back((gains[i] - last) / (first - last));
  return left;  // left[i] at the time i / frame_rate_hz; left[0] = 1
}

// Runge and Kutta's fourth order in steps much finer than a frame.
std::vector<double> StepLeftByRungeKutta(const AutoGain& options, double frame_rate_hz, int frames) {
  const double omega = 4 / (options.damping * options.settling_s);
  const auto slope = [&](const Eigen::Vector2d& state) {
    return Eigen::Vector2d(state[1], -2 * options.damping * omega * state[1] - omega * omega * state[0]);
  };
  const int fine = 200;
  const double step = 1 / frame_rate_hz / fine;
  Eigen::Vector2d state(1, 0);
  std::vector<double> left{1};
  for (int i = 1; i < frames * fine; ++i) {
    const Eigen::Vector2d a = slope(state), b = slope(state + step / 2 * a), c = slope(state + step / 2 * b),
                          d = slope(state + step * c);
    state += step / 6 * (a + 2 * b + 2 * c + d);
    if (i % fine == 0) left.push_back(state[0]);
  }
  return left;
}

TEST(Sensor, GainFollowsTheDampedOscillatorWhateverTheFrameRate) {
  for (const double damping : {0.3, 0.6, 1.0, 2.5}) {
    for (const double rate : {10.0, 29.97}) {
      AutoGain options;
      options.damping = damping;
      const std::vector<double> left = StepLeft(options, rate, 40);
      const std::vector<double> expected = StepLeftByRungeKutta(options, rate, 40);
      ASSERT_EQ(left.size(), expected.size());
      for (size_t i = 0; i < left.size(); ++i) EXPECT_NEAR(left[i], expected[i], 1e-6) << damping << ' ' << i;
    }
  }
}

TEST(Sensor, GainSettlesAndOvershootsAsItsDampingSays) {
  for (const double damping : {0.4, 0.6, 0.8}) {
    AutoGain options;
    options.damping = damping;
    const double rate = 1000;
    const std::vector<double> left = StepLeft(options, rate, 2000);
    const double overshoot = -*std::min_element(left.begin(), left.end());
    EXPECT_NEAR(overshoot, std::exp(-kPi * damping / std::sqrt(1 - damping * damping)), 1e-4);
    // The envelope e^(−4)/√(1 − ζ²) is the bound; 2% is met by the response itself.
    for (size_t i = static_cast<size_t>(options.settling_s * rate); i < left.size(); ++i) {
      ASSERT_LT(std::abs(left[i]), 0.02) << damping << " after " << i / rate << " s";
    }
    EXPECT_GT(std::abs(left[static_cast<size_t>(options.settling_s * rate / 3)]), 0.02);
  }
}

TEST(Sensor, GainStartsAtRestAndLagsOneFrame) {
  const AutoGain options;
  const std::vector<double> gains = RunAutoGain(options, Gamma(2.2), {0.5, 0.5, 0.1, 0.1});
  const double rest = std::pow(0.4, 2.2) / 0.5;
  EXPECT_NEAR(gains[0], rest, 1e-12);
  EXPECT_NEAR(gains[1], rest, 1e-12);
  EXPECT_NEAR(gains[2], rest, 1e-12);  // frame 1 called for the same
  EXPECT_GT(gains[3], 1.05 * rest);    // frame 2 for five times as much
  EXPECT_LT(gains[3], 5 * rest);
}

TEST(Sensor, BlackFrameCallsForNoChange) {
  const AutoGain options;
  const std::vector<double> gains = RunAutoGain(options, Gamma(2.2), {0.02, 0, 0, 0.02, 0});
  for (const double gain : gains) EXPECT_NEAR(gain, std::pow(0.4, 2.2) / 0.02, 1e-10);
  EXPECT_EQ(RunAutoGain(options, Gamma(2.2), {0, 0, 0}), (std::vector<double>{1, 1, 1}));
  EXPECT_TRUE(std::isnan(RunAutoGain(options, Gamma(2.2), {std::nan("")})[0]));
}

TEST(Sensor, BrightnessIsThePowerMeanOfLuminance) {
  const Camera<double> camera = WidePinhole(3);
  const Image8 all(3, 1, 1, 255);
  // (√0.25 + √1 + √0)² / 9 = 0.25
  EXPECT_NEAR(MeterBrightness(Gamma(2), Grey({0.25f, 1, 0}), all, camera), 0.25, 1e-9);
  EXPECT_NEAR(MeterBrightness(Gamma(2), Grey({0.75f, 3, 0}), all, camera), 0.75, 1e-9);
  Image8 some = all;
  *some.Pixel(2, 0) = 0;
  EXPECT_NEAR(MeterBrightness(Gamma(2), Grey({0.25f, 1, 99}), some, camera), 0.5625, 1e-9);
  EXPECT_EQ(MeterBrightness(Gamma(2), Grey({1, 1, 1}), Image8(3, 1, 1), camera), 0);
  ImageF red(3, 1, 3);
  for (int x = 0; x < 3; ++x) red.Pixel(x, 0)[0] = 1;
  EXPECT_NEAR(MeterBrightness(Gamma(1), red, all, camera), 0.2126, 1e-9);
  // cos² at 0°, 45° and atan 2: 1, 1/2, 1/5.
  EXPECT_NEAR(MeterBrightness(Gamma(1, 2), Grey({1, 1, 1}), all, camera), 1.7 / 3, 1e-9);
}

// A frame whose pixels differ reaches the target, on the average of what the file holds.
TEST(Sensor, RestingLoopHitsItsTarget) {
  const Camera<double> camera = WidePinhole(5);
  const Image8 all(5, 1, 1, 255);
  const ImageF radiance = Grey({0.01f, 0.02f, 0.03f, 0.07f, 0.05f});
  for (const double gamma : {1.0, 2.2}) {
    const Response response = Gamma(gamma, 0.5);
    const double brightness = MeterBrightness(response, radiance, all, camera);
    const double gain = RunAutoGain(AutoGain(), response, {brightness})[0];
    const Image8 image = Develop(response, gain, radiance, VignettingMap(response, camera), all);
    const double mean = std::accumulate(image.data.begin(), image.data.end(), 0.0) / image.data.size() / 255;
    EXPECT_NEAR(mean, 0.4, 0.5 / 255);
  }
}

TEST(Sensor, DevelopsByHand) {
  const Image8 all(4, 1, 1, 255);
  const ImageF flat(4, 1, 1, 1.0f);
  const auto developed = [&](const Response& response, double gain, const std::vector<float>& values) {
    const Image8 image = Develop(response, gain, Grey(values), flat, all);
    std::vector<int> red;
    for (int x = 0; x < 4; ++x) red.push_back(image.Pixel(x, 0)[0]);
    return red;
  };
  // 0.25^(1/2.2) · 255 = 135.8; 1 and above saturate.
  EXPECT_EQ(developed(Gamma(2.2), 2, {0.125f, 0.5f, 0.6f, 1e30f}), (std::vector<int>{136, 255, 255, 255}));
  EXPECT_EQ(developed(Gamma(1), 1, {0, 0.5f, 0.0019f, 0.0020f}), (std::vector<int>{0, 128, 0, 1}));
  Response srgb;
  srgb.srgb = true;
  EXPECT_EQ(developed(srgb, 1, {0, 0.5f, 0.002f, 1}), (std::vector<int>{0, 188, 7, 255}));
}

TEST(Sensor, KeepsChannelsApartAndInvalidPixelsBlack) {
  ImageF radiance(2, 1, 3, 0.5f);
  radiance.Pixel(0, 0)[0] = 0.2f;
  radiance.Pixel(0, 0)[1] = 0.4f;
  radiance.Pixel(0, 0)[2] = 0.6f;
  Image8 valid(2, 1, 1, 255);
  *valid.Pixel(1, 0) = 0;
  const Image8 image = Develop(Gamma(1), 1, radiance, ImageF(2, 1, 1, 1.0f), valid);
  EXPECT_EQ(image.data, (std::vector<uint8_t>{51, 102, 153, 0, 0, 0}));
}

TEST(Sensor, VignettesByThePowerOfTheCosine) {
  const Camera<double> camera = WidePinhole(3);
  const ImageF map = VignettingMap(Gamma(2.2, 2), camera);
  EXPECT_FLOAT_EQ(*map.Pixel(0, 0), 1);
  EXPECT_FLOAT_EQ(*map.Pixel(1, 0), 0.5f);
  EXPECT_FLOAT_EQ(*map.Pixel(2, 0), 0.2f);
  EXPECT_EQ(VignettingMap(Gamma(2.2), camera).data, (std::vector<float>{1, 1, 1}));
  const Image8 image = Develop(Gamma(1), 1, Grey({1, 1, 1}), map, Image8(3, 1, 1, 255));
  EXPECT_EQ(image.Pixel(1, 0)[1], 128);
  EXPECT_EQ(image.Pixel(2, 0)[1], 51);
}

Sensor Read(const std::string& text) {
  const Config config = Config::Parse(text, "scene.toml");
  const Sensor sensor = ReadSensor(config.root());
  config.RejectUnknown();
  return sensor;
}

// Up by the root of the factor a quarter of the period on, down by it after three.
TEST(Sensor, GainSwingsByItsFactor) {
  const Sensor sensor = Read("gain = 3\n[gain_swing]\nfactor = 4\nperiod = 8");
  ASSERT_TRUE(sensor.gain_swing);
  EXPECT_NEAR(GainAt(sensor.gain, *sensor.gain_swing, 0), 3, 1e-15);
  EXPECT_NEAR(GainAt(sensor.gain, *sensor.gain_swing, 2), 6, 1e-14);
  EXPECT_NEAR(GainAt(sensor.gain, *sensor.gain_swing, 6), 1.5, 1e-14);
  EXPECT_FALSE(Read("gain = 3").gain_swing);
  EXPECT_NE(test::ErrorOf([] { Read("[gain_swing]\n[auto_gain]"); }).find("gain_swing: has no effect beside"),
            std::string::npos);
}

TEST(Sensor, ReadsItsTable) {
  EXPECT_EQ(Read("").gain, 1);
  EXPECT_FALSE(Read("").auto_gain);
  EXPECT_TRUE(Read("").record_gain);
  EXPECT_EQ(Read("gain = 2.5\nrecord_gain = false").gain, 2.5);
  EXPECT_FALSE(Read("record_gain = false").record_gain);
  const Sensor automatic =
      Read("[auto_gain]\ntarget = 0.3\nsettling_s = 0.5\ndamping = 0.7\nframe_rate_hz = 25");
  ASSERT_TRUE(automatic.auto_gain);
  EXPECT_EQ(automatic.auto_gain->target, 0.3);
  EXPECT_EQ(automatic.auto_gain->settling_s, 0.5);
  EXPECT_EQ(automatic.auto_gain->damping, 0.7);
  EXPECT_EQ(automatic.auto_gain->frame_rate_hz, 25);
}

TEST(Sensor, RefusesWhatNoSensorHas) {
  for (const char* text : {"gain = 0", "gain = -1", "gain = 1\n[auto_gain]", "[auto_gain]\ntarget = 1",
                           "[auto_gain]\nsettling_s = 0", "[auto_gain]\ndamping = 0",
                           "[auto_gain]\nspeed = 1", "[auto_gain]\nframe_rate_hz = 0"}) {
    try {
      Read(text);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find("scene.toml:"), 0u) << error.what();
    }
  }
}

}  // namespace
}  // namespace lumen
