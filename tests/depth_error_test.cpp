#include "recon/evaluation/depth_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/evaluation_scenes.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

// Logarithms of the ratios: −ln 2, 0, ln 2; their mean is 0, their root mean square ln 2 · √(2/3).
TEST(DepthError, AgainstOneByHand) {
  const ScaleInvariantError error = ScaleInvariantLogError({1, 2, 4}, {2, 2, 2});
  EXPECT_NEAR(error.error, std::log(2.0) * std::sqrt(2.0 / 3), 1e-15);
  EXPECT_NEAR(error.scale, 1, 1e-15);
  const ScaleInvariantError scaled = ScaleInvariantLogError({3, 6, 12}, {2, 2, 2});
  EXPECT_NEAR(scaled.error, error.error, 1e-15);
  EXPECT_NEAR(scaled.scale, 1.0 / 3, 1e-15);
  EXPECT_EQ(ScaleInvariantLogError({5, 10}, {1, 2}).error, 0);
  EXPECT_EQ(ScaleInvariantLogError({}, {}).error, 0);
}

// Seen from the middle of a cube of half-edge 10 mm, one wall stands at z = 10 throughout.
class DepthErrorOfFrame : public testing::Test {
 protected:
  DepthErrorOfFrame() {
    sequence_ = PinholeSequence({At(0, 0, 0)});
    sequence_.folder = scratch_.path();
    SequenceFrame& frame = sequence_.frames[0];
    const CameraIntrinsics& in = sequence_.calibration.camera;
    LightSource source;
    sequence_.calibration.light.sources = {source};
    sequence_.calibration.response.gamma = 1;
    frame.color = scratch_ / "0000_color.png";
    frame.depth = scratch_ / "0000_depth.tiff";
    // A slope: z grows to the right. Brightness is that of a wall whose albedo and incidence are the same
    // everywhere.
    Image8 color(in.width, in.height, 3);
    ImageF z(in.width, in.height, 1);
    const Camera<double> camera(in);
    for (int y = 0; y < in.height; ++y) {
      for (int x = 0; x < in.width; ++x) {
        const double depth = 10 + 10.0 * x / in.width;
        const double distance = depth / camera.Unproject(Vec2d(x, y)).value().z();
        *z.Pixel(x, y) = static_cast<float>(depth);
        for (int c = 0; c < 3; ++c)
          color.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(255 * 90 / (distance * distance)));
      }
    }
    WriteImage(frame.color, color);
    WriteImage(frame.depth, EncodeDepth(z));
  }
  ScratchFolder scratch_;
  Sequence sequence_;
};

TEST_F(DepthErrorOfFrame, GuessesAndReconstructionAreToldApart) {
  // A wall of constant z: its shape is the constant guess's, its scale another one.
  const std::vector<FrameDepthError> errors = DepthErrors(Cube(10, 6), sequence_);
  ASSERT_EQ(errors.size(), 1u);
  const FrameDepthError& error = errors[0];
  EXPECT_GT(error.pixels, 1000);
  EXPECT_EQ(error.missing, 0);
  // Uniform u on [1, 2): the variance of log u is 1 − 2 (ln 2)².
  const double uniform = std::sqrt(1 - 2 * std::log(2.0) * std::log(2.0));
  EXPECT_NEAR(error.constant.error, uniform, 2e-3);
  EXPECT_NEAR(error.reconstruction.error, error.constant.error, 1e-5);
  // The mean of log u is 2 ln 2 − 1.
  EXPECT_NEAR(error.reconstruction.scale, std::exp(2 * std::log(2.0) - 1), 5e-3);
  EXPECT_LT(error.brightness.error, 0.02);  // 8 bits
  EXPECT_NE(ToTable(errors).find("brightness alone"), std::string::npos);
}

TEST_F(DepthErrorOfFrame, WantsADepthFileOfTheCamerasSize) {
  sequence_.frames[0].depth.clear();
  EXPECT_NE(ErrorOf([&] { DepthErrors(Cube(10, 6), sequence_); }).find("no frame has a depth file"),
            std::string::npos);
  sequence_.frames[0].depth = scratch_ / "small.tiff";
  WriteImage(sequence_.frames[0].depth, Image16(3, 3, 1));
  EXPECT_NE(ErrorOf([&] { DepthErrors(Cube(10, 6), sequence_); }).find("has 3×3 pixels"), std::string::npos);
}

}  // namespace
}  // namespace lumen::test
