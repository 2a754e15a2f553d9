// Whether colours tell that light goes from wall to wall, on pictures whose hues are known.
#include "recon/training/hue_slope.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/image.h"

namespace lumen {
namespace {

constexpr int kWidth = 480, kHeight = 360;

Image8 Everywhere() {
  Image8 valid(kWidth, kHeight, 1);
  std::fill(valid.data.begin(), valid.data.end(), uint8_t{1});
  return valid;
}

// Green falls from left to right to a tenth of what it is; red and blue are given as functions of it.
template <class Red, class Blue>
Image8 Picture(const Response& response, const Red& red, const Blue& blue) {
  Image8 picture(kWidth, kHeight, 3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double green = 0.3 * std::pow(10.0, -double(x) / kWidth);
      const double values[] = {red(green), green, blue(green)};
      for (int c = 0; c < 3; ++c) {
        picture.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(255 * Encode(response, values[c])));
      }
    }
  }
  return picture;
}

double SlopeOf(const Response& response, const Image8& picture, const Image8& valid) {
  HueSlope hue(response, kWidth, kHeight,
               [&](int y) { return std::vector<uint8_t>(valid.Pixel(0, y), valid.Pixel(0, y) + kWidth); });
  for (int y = 0; y < kHeight; ++y) hue.AddRow(y, picture.Pixel(0, y));
  return hue.Slope();
}

// red ∝ green^(1 + s) has slope s. Steps of 8 bits are 2% of the darkest values and fall out over squares.
TEST(HueSlope, IsThatOfPowersOfTheDarkestChannel) {
  Response response;
  response.gamma = 2.2;
  for (const double slope : {-0.4, -0.1, 0.0, 0.2}) {
    const Image8 picture = Picture(
        response, [&](double g) { return 0.6 * std::pow(g / 0.3, 1 + slope); },
        [](double g) { return 1.1 * g; });
    EXPECT_NEAR(SlopeOf(response, picture, Everywhere()), slope, 0.003) << slope;
  }
}

// A third more light of the palest channel alone, the same everywhere, shows; the wall's own hue doesn't.
TEST(HueSlope, TellsLightBetweenWallsFromTheWallsHue) {
  Response response;
  response.gamma = 2.2;
  const auto blue = [](double g) { return 0.9 * g; };
  const Image8 direct = Picture(
      response, [](double g) { return 2.5 * g; }, blue);
  EXPECT_GT(SlopeOf(response, direct, Everywhere()), kHueSlopeOfWallLight / 3);
  const Image8 mixed = Picture(
      response, [](double g) { return 2 * g + 0.03; }, blue);
  EXPECT_LT(SlopeOf(response, mixed, Everywhere()), 2 * kHueSlopeOfWallLight);
}

TEST(HueSlope, IsNothingWhereNothingTells) {
  Response response;
  response.gamma = 2.2;
  const Image8 grey = Picture(
      response, [](double g) { return g; }, [](double g) { return g; });
  EXPECT_NEAR(SlopeOf(response, grey, Everywhere()), 0, 1e-12);
  const Image8 red = Picture(
      response, [](double g) { return 2 * std::sqrt(g); }, [](double g) { return g; });
  EXPECT_EQ(SlopeOf(response, red, Image8(kWidth, kHeight, 1)), 0);  // no pixel carries image
  Image8 saturated = red;
  std::fill(saturated.data.begin(), saturated.data.end(), uint8_t{255});
  EXPECT_EQ(SlopeOf(response, saturated, Everywhere()), 0);
}

}  // namespace
}  // namespace lumen
