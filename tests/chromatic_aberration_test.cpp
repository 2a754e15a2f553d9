#include "sim/imaging/chromatic_aberration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/error.h"

namespace lumen {
namespace {

CameraIntrinsics Intrinsics(int width, int height) {
  CameraIntrinsics camera;
  camera.width = width;
  camera.height = height;
  camera.cx = width / 2.0 - 0.3;
  camera.cy = height / 2.0 + 0.2;
  return camera;
}

// Interpolation is exact on a linear function.
TEST(ChromaticAberration, ScalesRedAndBlueAboutThePrincipalPoint) {
  const CameraIntrinsics camera = Intrinsics(80, 60);
  ImageF ramp(80, 60, 3);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      for (int c = 0; c < 3; ++c) ramp.Pixel(x, y)[c] = static_cast<float>(100 + x + 0.5 * y + 7 * c);
    }
  }
  const ChromaticAberration aberration{-0.02, 0.03};
  const ImageF image = Disperse(aberration, camera, ramp, Image8(80, 60, 1, 255));
  for (int y = 5; y < 55; ++y) {
    for (int x = 5; x < 75; ++x) {
      for (const auto& [c, k] : {std::pair(0, -0.02), std::pair(1, 0.0), std::pair(2, 0.03)}) {
        const double rx = (x - camera.cx) / (1 + k), ry = (y - camera.cy) / (1 + k);
        ASSERT_NEAR(image.Pixel(x, y)[c], 100 + camera.cx + rx + 0.5 * (camera.cy + ry) + 7 * c, 1e-4);
      }
      ASSERT_EQ(image.Pixel(x, y)[1], ramp.Pixel(x, y)[1]);
    }
  }
  EXPECT_GT(std::abs(image.Pixel(70, 30)[0] - ramp.Pixel(70, 30)[0]), 0.3);
}

// A spot's centroid moves outward by k times its distance.
TEST(ChromaticAberration, MovesASpotOutward) {
  const CameraIntrinsics camera = Intrinsics(200, 200);
  ImageF spot(200, 200, 3);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      const double squared = std::pow(x - 160.0, 2) + std::pow(y - 130.0, 2);
      for (int c = 0; c < 3; ++c) spot.Pixel(x, y)[c] = static_cast<float>(std::exp(-squared / 50));
    }
  }
  const ImageF image = Disperse({0, 0.05}, camera, spot, Image8(200, 200, 1, 255));
  double sum = 0, sum_x = 0, sum_y = 0;
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      sum += image.Pixel(x, y)[2];
      sum_x += x * image.Pixel(x, y)[2];
      sum_y += y * image.Pixel(x, y)[2];
      ASSERT_EQ(image.Pixel(x, y)[0], spot.Pixel(x, y)[0]);  // k = 0
    }
  }
  EXPECT_NEAR(sum_x / sum, camera.cx + 1.05 * (160 - camera.cx), 1e-3);
  EXPECT_NEAR(sum_y / sum, camera.cy + 1.05 * (130 - camera.cy), 1e-3);
}

TEST(ChromaticAberration, LooksAtValidPixelsOnly) {
  const CameraIntrinsics camera = Intrinsics(30, 30);
  ImageF radiance(30, 30, 3, 0.5f);
  Image8 valid(30, 30, 1, 255);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) {
      if (x >= 4 && y >= 4 && x < 26 && (x != 9 || y != 9)) continue;
      *valid.Pixel(x, y) = 0;
      std::fill_n(radiance.Pixel(x, y), 3, 1e9f);
    }
  }
  const ImageF image = Disperse({-0.1, 0.1}, camera, radiance, valid);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 30; ++x) {
      for (int c = 0; c < 3; ++c) ASSERT_EQ(image.Pixel(x, y)[c], *valid.Pixel(x, y) ? 0.5f : 1e9f);
    }
  }
}

TEST(ChromaticAberration, ReadsItsTable) {
  const auto read = [](const std::string& text) {
    return ReadChromaticAberration(Config::Parse(text, "scene.toml").root());
  };
  EXPECT_EQ(read("").blue, 0.0012);
  EXPECT_EQ(read("red = 0.01").red, 0.01);
  EXPECT_THROW(read("red = 0.2"), InputError);
}

}  // namespace
}  // namespace lumen
