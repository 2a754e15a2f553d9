#include "common/jpeg.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "common/error.h"
#include "common/random.h"
#include "sim/imaging/jpeg.h"

namespace lumen {
namespace {

// A grey image is one coefficient a block, 8 (v − 128), rounded to a step of ITU-T T.81's table K.1: 16 at
// quality 50, times (5000/q)% below.
TEST(Jpeg, QuantisesGreyByTheStandardsTable) {
  for (const auto& [quality, step] : {std::pair(50, 16), std::pair(25, 32), std::pair(10, 80)}) {
    int changed = 0;
    for (int grey = 0; grey < 256; ++grey) {
      const double coefficient = 8.0 * (grey - 128) / step;
      if (std::abs(coefficient - std::floor(coefficient) - 0.5) < 1e-9)
        continue;  // either neighbour is right
      const double expected = std::clamp(128 + std::round(coefficient) * step / 8, 0.0, 255.0);
      const Image8 decoded = ThroughJpeg(Image8(16, 16, 3, static_cast<uint8_t>(grey)), quality);
      for (const uint8_t value : decoded.data) ASSERT_EQ(value, expected) << quality << ' ' << grey;
      changed += expected != grey;
    }
    EXPECT_EQ(changed > 0, step > 16) << quality;  // steps of 2: only ties move
  }
}

Image8 Noise(int width, int height, uint64_t seed) {
  Image8 image(width, height, 3);
  for (size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<uint8_t>(RandomBits(seed, i / 3) >> 58) + 96;
  return image;
}

double RootMeanSquareChange(const Image8& a, const Image8& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) sum += std::pow(double(a.data[i]) - b.data[i], 2);
  return std::sqrt(sum / double(a.data.size()));
}

TEST(Jpeg, LosesLessTheBetterItsQuality) {
  const Image8 image = Noise(67, 45, 3);  // no multiple of a block
  double last = 1e9;
  for (const int quality : {5, 30, 60, 85, 95, 100}) {
    const double change = RootMeanSquareChange(image, ThroughJpeg(image, quality));
    EXPECT_LT(change, last) << quality;
    last = change;
  }
  EXPECT_LT(last, 1);  // rounding only
  EXPECT_EQ(ThroughJpeg(image, 85).data, ThroughJpeg(image, 85).data);
}

// Columns in turn of two colours with the same luma: at half the resolution they are one colour.
TEST(Jpeg, HalvesTheColoursResolution) {
  Image8 image(32, 32, 3);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      // Luma .299 R + .587 G + .114 B = 100 twice.
      const int colors[2][3] = {{160, 78, 57}, {40, 131, 97}};
      for (int c = 0; c < 3; ++c) image.Pixel(x, y)[c] = static_cast<uint8_t>(colors[x % 2][c]);
    }
  }
  const Image8 decoded = ThroughJpeg(image, 100);
  EXPECT_LT(std::abs(decoded.Pixel(14, 16)[0] - decoded.Pixel(15, 16)[0]), 8);
  EXPECT_NEAR(decoded.Pixel(14, 16)[0], 100, 8);
}

TEST(Jpeg, ReadsItsTable) {
  const auto read = [](const std::string& text) {
    return ReadJpeg(Config::Parse(text, "scene.toml").root()).quality;
  };
  EXPECT_EQ(read(""), 85);
  EXPECT_EQ(read("quality = 40"), 40);
  EXPECT_THROW(read("quality = 0"), InputError);
  EXPECT_THROW(read("quality = 101"), InputError);
}

}  // namespace
}  // namespace lumen
