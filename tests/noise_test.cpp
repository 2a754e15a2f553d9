#include "sim/imaging/noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/error.h"
#include "common/parallel.h"
#include "common/random.h"
#include "sim/imaging/sensor.h"

namespace lumen {
namespace {

// Sum of the squared deviations from Poisson's probabilities, each in units of its standard deviation, less
// their number of degrees of freedom, in standard deviations of χ². Cells with fewer than 10 expected are
// taken together.
double ChiSquareDeviation(double tested_mean, double drawn_mean, int count) {
  std::vector<int> found(static_cast<size_t>(4 * tested_mean + 40), 0);
  for (int i = 0; i < count; ++i) {
    const double number = PoissonNumber(drawn_mean, RandomBits(11, static_cast<uint64_t>(i)));
    EXPECT_EQ(number, std::floor(number));
    ++found[static_cast<size_t>(std::min<double>(number, double(found.size()) - 1))];
  }
  double sum = 0, rest_found = count, rest_expected = count;
  int cells = 0;
  for (size_t k = 0; k < found.size(); ++k) {
    const double n = static_cast<double>(k);
    const double expected = count * std::exp(n * std::log(tested_mean) - tested_mean - std::lgamma(n + 1));
    if (expected < 10) continue;
    sum += (found[k] - expected) * (found[k] - expected) / expected;
    rest_found -= found[k];
    rest_expected -= expected;
    ++cells;
  }
  if (rest_expected > 1) {
    sum += (rest_found - rest_expected) * (rest_found - rest_expected) / rest_expected;
    ++cells;
  }
  return (sum - (cells - 1)) / std::sqrt(2.0 * (cells - 1));
}

// Both methods, on both sides of where one takes over.
TEST(Noise, CountsHavePoissonsDistribution) {
  for (const double mean : {0.02, 0.7, 4.0, 9.999, 10.0, 33.0, 700.0}) {
    EXPECT_LT(ChiSquareDeviation(mean, mean, 200000), 5) << mean;
    EXPECT_GT(ChiSquareDeviation(mean, 1.2 * mean, 200000), 20) << mean;
  }
}

TEST(Noise, CountsOfAnySizeHaveTheirMeanAndVariance) {
  EXPECT_EQ(PoissonNumber(0, 5), 0);
  for (const double mean : {1e4, 9.9e8, 1.1e9, 1e15}) {
    const int count = 100000;
    double sum = 0, squares = 0;
    for (int i = 0; i < count; ++i) {
      const double z = (PoissonNumber(mean, RandomBits(12, i)) - mean) / std::sqrt(mean);
      sum += z;
      squares += z * z;
    }
    EXPECT_LT(std::abs(sum), 5 * std::sqrt(double(count))) << mean;
    EXPECT_LT(std::abs(squares - count), 5 * std::sqrt(2.0 * count)) << mean;
  }
  EXPECT_TRUE(std::isfinite(PoissonNumber(1e12 * 3.4e38, 1)));
}

struct Moments {
  double mean = 0, variance = 0;
};

Moments MomentsOf(const ImageF& image, int channel) {
  Moments moments;
  const double count = double(image.width) * image.height;
  for (size_t i = channel; i < image.data.size(); i += 3) moments.mean += image.data[i] / count;
  for (size_t i = channel; i < image.data.size(); i += 3) {
    moments.variance += std::pow(image.data[i] - moments.mean, 2) / (count - 1);
  }
  return moments;
}

// The standard deviations of a sample's mean and variance, √(σ²/n) and σ² √(2/n + κ/n), κ <= 1/mean count of
// electrons being Poisson's excess kurtosis.
TEST(Noise, FrameHasTheMeanAndVarianceOfItsPhotons) {
  const int side = 200;
  const SensorNoise noise{2000, 7};
  const double radiance[3] = {0.5, 0.02, 0}, falloff = 0.75;
  ImageF image(side, side, 3);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<float>(radiance[i % 3]);
  const ImageF signal =
      NoisySignal(noise, image, ImageF(side, side, 1, float(falloff)), Image8(side, side, 1, 255), 3, 4);
  for (int c = 0; c < 3; ++c) {
    const double mean = falloff * radiance[c], count = double(side) * side;
    const double variance = mean / noise.full_scale_e + std::pow(noise.read_e / noise.full_scale_e, 2);
    const Moments found = MomentsOf(signal, c);
    EXPECT_LT(std::abs(found.mean - mean), 5 * std::sqrt(variance / count)) << c;
    const double kurtosis = mean > 0 ? 1 / (mean * noise.full_scale_e) : 0;
    EXPECT_LT(std::abs(found.variance - variance), 5 * variance * std::sqrt((2 + kurtosis) / count)) << c;
  }
  // Neighbours, channels and frames are uncorrelated: |r| √n is normal.
  const ImageF other =
      NoisySignal(noise, image, ImageF(side, side, 1, float(falloff)), Image8(side, side, 1, 255), 3, 5);
  const Moments first = MomentsOf(signal, 0), second = MomentsOf(signal, 1), later = MomentsOf(other, 0);
  double neighbours = 0, channels = 0, frames = 0, itself = 0;
  for (size_t i = 0; i + 3 < signal.data.size(); i += 3) {
    const double z = (signal.data[i] - first.mean) / std::sqrt(first.variance);
    itself += z * z;
    neighbours += z * (signal.data[i + 3] - first.mean) / std::sqrt(first.variance);
    channels += z * (signal.data[i + 1] - second.mean) / std::sqrt(second.variance);
    frames += z * (other.data[i] - later.mean) / std::sqrt(later.variance);
  }
  for (const double sum : {neighbours, channels, frames}) EXPECT_LT(std::abs(sum), 5 * double(side));
  EXPECT_GT(itself, 100 * double(side));
}

// The same photons amplified ten times are ten times as noisy; ten times as many photons only √10 times.
TEST(Noise, GainAmplifiesNoise) {
  const int side = 200;
  const SensorNoise noise{1e5, 0};
  Response linear;
  linear.gamma = 1;
  const ImageF flat(side, side, 1, 1.0f);
  const Image8 all(side, side, 1, 255);
  const auto spread = [&](float radiance, double gain) {
    const ImageF signal = NoisySignal(noise, ImageF(side, side, 3, radiance), flat, all, 8, 0);
    const Image8 image = Develop(linear, gain, signal, flat, all);
    ImageF levels(side, side, 3);
    for (size_t i = 0; i < levels.data.size(); ++i) levels.data[i] = image.data[i];
    return MomentsOf(levels, 1);
  };
  // 8 bits: rounding adds 1/12 to the variance of levels.
  for (const auto& [radiance, gain] :
       {std::pair(5e-4f, 1000.0), std::pair(5e-3f, 100.0), std::pair(5e-2f, 10.0)}) {
    const double variance = 255 * 255 * gain * gain * radiance / noise.full_scale_e + 1.0 / 12;
    const Moments found = spread(radiance, gain);
    EXPECT_NEAR(found.mean, 127.5, 5 * std::sqrt(variance) / side) << gain;
    EXPECT_NEAR(found.variance, variance,
                5 * variance * std::sqrt((2 + 1 / (radiance * noise.full_scale_e)) / (side * side)))
        << gain;
  }
}

TEST(Noise, IsTheSameForAnyNumberOfThreadsAndLeavesInvalidPixelsBlack) {
  const ImageF image(40, 30, 3, 0.3f), flat(40, 30, 1, 1.0f);
  Image8 valid(40, 30, 1, 255);
  *valid.Pixel(7, 5) = 0;
  SetThreadCount(1);
  const ImageF one = NoisySignal({}, image, flat, valid, 1, 0);
  SetThreadCount(2);
  const ImageF two = NoisySignal({}, image, flat, valid, 1, 0);
  SetThreadCount(0);
  EXPECT_EQ(one.data, two.data);
  EXPECT_NE(one.data, NoisySignal({}, image, flat, valid, 2, 0).data);
  for (int c = 0; c < 3; ++c) EXPECT_EQ(one.Pixel(7, 5)[c], 0);
}

TEST(Noise, ReadsItsTable) {
  const auto read = [](const std::string& text) {
    const Config config = Config::Parse(text, "scene.toml");
    const Sensor sensor = ReadSensor(config.root());
    config.RejectUnknown();
    return sensor;
  };
  EXPECT_FALSE(read("").noise);
  EXPECT_EQ(read("[noise]").noise->full_scale_e, 10000);
  EXPECT_EQ(read("[noise]").noise->read_e, 5);
  EXPECT_EQ(read("[noise]\nfull_scale_e = 3000\nread_e = 0").noise->full_scale_e, 3000);
  for (const char* text : {"[noise]\nfull_scale_e = 0", "[noise]\nread_e = -1", "[noise]\nfull_well = 1"}) {
    EXPECT_THROW(read(text), InputError) << text;
  }
}

}  // namespace
}  // namespace lumen
