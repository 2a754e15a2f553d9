// Frames binned: means of linear light worked out here, pixels that carry image, rays.
#include "common/binning.h"

#include <gtest/gtest.h>

#include <cmath>

#include "recon/training/training_frames.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::SmallSequence;

// The code, before rounding, of the mean of a square's linear values; a power of 2.2 each way.
double MeanCode(const Image8& color, int x, int y, int c, int factor) {
  double sum = 0;
  for (int dy = 0; dy < factor; ++dy)
    for (int dx = 0; dx < factor; ++dx)
      sum += std::pow(color.Pixel(x * factor + dx, y * factor + dy)[c] / 255.0, 2.2);
  return 255 * std::pow(sum / (factor * factor), 1 / 2.2);
}

// 90×72 pixels: 7 leaves a column of 6 and a row of 2 over.
TEST(Binning, SquaresAreMeansOfLinearLight) {
  const Sequence& whole = SmallSequence();
  ASSERT_EQ(whole.calibration.response.gamma, 2.2);
  for (const int factor : {2, 3, 7}) {
    const Sequence binned = Binned(whole, factor);
    for (size_t i : {size_t{0}, whole.frames.size() - 1}) {
      const Image8 color = ReadColor(whole, whole.frames[i]), found = ReadColor(binned, binned.frames[i]);
      ASSERT_EQ(found.width, 90 / factor);
      ASSERT_EQ(found.height, 72 / factor);
      for (int y = 0; y < found.height; ++y) {
        for (int x = 0; x < found.width; ++x) {
          for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(found.Pixel(x, y)[c], MeanCode(color, x, y, c, factor), 0.5 + 1e-9);
        }
      }
    }
  }
}

// Where the transfer is steep, a mean of codes would be far off: half black, half white.
TEST(Binning, HalfOfTheLightIsNotHalfOfTheCode) {
  const uint8_t upper[] = {0, 0, 0, 255, 255, 255}, lower[] = {255, 0, 10, 0, 255, 10};
  const auto binned = [&](const Response& response) {
    std::vector<uint8_t> square;
    const std::function<void(int, const uint8_t*)> keep = [&](int y, const uint8_t* rgb) {
      EXPECT_EQ(y, 0);
      square.assign(rgb, rgb + 3);
    };
    RowBinner binner(response, 2, 1, keep);
    binner.AddRow(0, upper);
    EXPECT_TRUE(square.empty());
    binner.AddRow(1, lower);
    return square;
  };
  // 255 · 0.5^(1/2.2) = 186.1; sRGB's of 0.5 is 187.5, 188 (IEC 61966-2-1). The third channel's mean is a
  // quarter of white, and two tens.
  EXPECT_EQ(binned({2.2, false, 0}), (std::vector<uint8_t>{186, 186, 136}));
  EXPECT_EQ(binned({2.2, true, 0})[0], 188);
  EXPECT_EQ(binned({1, false, 0}), (std::vector<uint8_t>{128, 128, 69}));
}

// A square's ray is that of the place in its middle, which lies between pixels for even factors.
TEST(Binning, TheCameraSeesTheMiddlesOfSquares) {
  const Sequence& whole = SmallSequence();
  const Camera<double> fine(whole.calibration.camera);
  for (const int factor : {2, 3, 7}) {
    const Camera<double> coarse(Binned(whole, factor).calibration.camera);
    for (const Vec2d& pixel : {Vec2d(0, 0), Vec2d(5, 9), Vec2d(90 / factor - 1, 72 / factor - 1)}) {
      const Vec2d middle = factor * pixel + Vec2d::Constant((factor - 1) / 2.0);
      EXPECT_LT((*coarse.Unproject(pixel) - *fine.Unproject(middle)).norm(), 1e-9) << factor;
    }
  }
}

TEST(Binning, ASquareCarriesImageWhereAllOfItDoes) {
  Sequence sequence = SmallSequence();
  sequence.calibration.mask = Image8(90, 72, 1, 255);
  *sequence.calibration.mask.Pixel(11, 5) = 0;  // of the square (3, 1) of 3×3
  const Sequence binned = Binned(sequence, 3), unmasked = Binned(SmallSequence(), 3);
  const Image8 valid = ValidPixels(binned.calibration), all = ValidPixels(unmasked.calibration);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 30; ++x)
      EXPECT_EQ(*valid.Pixel(x, y), x == 3 && y == 1 ? 0 : *all.Pixel(x, y)) << x << " " << y;
  const TrainOptions options = ReadTrainOptions("fast", {"binning=3"});
  const size_t fine = TrainingFrames(SmallSequence(), 6, true).pixel_rays().size();
  const size_t coarse = FramesFor(SmallSequence(), options, 0).pixel_rays().size();
  EXPECT_EQ(FramesFor(sequence, options, 0).pixel_rays().size() + 1, coarse);
  EXPECT_NEAR(double(coarse), double(fine) / 9, 0.1 * double(fine) / 9);
}

TEST(Binning, WhatCannotBeBinnedIsRefused) {
  const Sequence& whole = SmallSequence();
  EXPECT_EQ(Binned(whole, 72).calibration.camera.height, 1);
  EXPECT_NE(test::ErrorOf([&] { Binned(whole, 73); }).find("90×72 pixels can't be binned by 73"),
            std::string::npos);
  EXPECT_NE(test::ErrorOf([&] { Binned(whole, 0); }), "");
  EXPECT_NE(test::ErrorOf([&] { Binned(Binned(whole, 2), 2); }), "");
  // Files of another size than the camera's are still told, by their own size.
  Sequence other = whole;
  other.calibration.camera = Resized(other.calibration.camera, 91, 72);
  const Sequence binned = Binned(other, 2);
  const std::string error = test::ErrorOf([&] { ReadColor(binned, binned.frames[0]); });
  EXPECT_NE(error.find("has 90×72 pixels, the camera 91×72"), std::string::npos) << error;
}

}  // namespace
}  // namespace lumen
