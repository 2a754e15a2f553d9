#include "recon/evaluation/portrait.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/parallel.h"
#include "recon/evaluation/layout.h"
#include "tests/evaluation_scenes.h"

namespace lumen {
namespace {

using test::At;

View PinholeView(int size_px) {
  View view;
  view.camera = test::PinholeSequence({}).calibration.camera;
  view.camera = Resized(view.camera, size_px, size_px);
  return view;
}

// On the axis a plate tilted by β shows its colour times 0.3 + 0.7 cos β.
TEST(Portrait, HeadlightFallsWithTheTilt) {
  for (double tilt_deg : {0.0, 30.0, 60.0}) {
    const double tilt = tilt_deg * kPi / 180;
    Mesh plate;
    test::AddPlate(Vec3d(0, 0, 20) - 10 * Vec3d(std::cos(tilt), 1, std::sin(tilt)),
                   20 * Vec3d(std::cos(tilt), 0, std::sin(tilt)), {0, 20, 0}, 5, &plate);
    const std::vector<Rgb8> colors(plate.vertices.size(), Rgb8{200, 100, 50});
    const Image8 image = Portrait(plate).Draw(PinholeView(101), colors);
    const double shade = 0.3 + 0.7 * std::cos(tilt);
    EXPECT_NEAR(image.Pixel(50, 50)[0], 200 * shade, 1.5);
    EXPECT_NEAR(image.Pixel(50, 50)[1], 100 * shade, 1.5);
    EXPECT_NEAR(image.Pixel(50, 50)[2], 50 * shade, 1.5);
  }
}

TEST(Portrait, ColoursAreInterpolated) {
  Mesh plate;
  test::AddPlate({-10, -10, 10}, {20, 0, 0}, {0, 20, 0}, 1, &plate);  // fills the image
  std::vector<Rgb8> colors;
  for (const Vec3d& v : plate.vertices) colors.push_back(v.x() < 0 ? Rgb8{0, 0, 0} : Rgb8{240, 0, 0});
  const Image8 image = Portrait(plate).Draw(PinholeView(100), colors);
  for (int x : {10, 50, 90}) {
    const double off_axis = (x - 49.5) / 50, across = (x + 0.5) / 100;
    const double down = (70 - 49.5) / 50;
    const double cosine = 1 / std::sqrt(1 + off_axis * off_axis + down * down);
    EXPECT_NEAR(image.Pixel(x, 70)[0], 240 * across * (0.3 + 0.7 * cosine), 2);
  }
}

// A plate's border at x = 0 cuts the middle column of an odd image into halves: the mean of 16 rays says so.
TEST(Portrait, EdgesAreSmoothAndTheRestIsBackground) {
  Mesh plate;
  test::AddPlate({-30, -30, 20}, {30, 0, 0}, {0, 60, 0}, 1, &plate);
  View view = PinholeView(101);
  view.background = {10, 20, 30};
  view.valid = Image8(101, 101, 1, 255);
  *view.valid.Pixel(20, 50) = 0;
  const Image8 image = Portrait(plate).Draw(view, std::vector<Rgb8>(4, Rgb8{210, 210, 210}));
  EXPECT_NEAR(image.Pixel(49, 50)[0], 210, 1);
  EXPECT_NEAR(image.Pixel(50, 50)[0], (210 + 10) / 2.0, 1);
  EXPECT_EQ(image.Pixel(51, 50)[0], 10);
  EXPECT_EQ(image.Pixel(90, 10)[2], 30);
  EXPECT_EQ(image.Pixel(20, 50)[1], 20);  // not a valid pixel
}

TEST(Portrait, OutsideViewHoldsAllPointsAndIsFilled) {
  Mesh tube = test::Tube(20, 200, 3, 30, 40);
  const Pose turned(Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()));
  for (Vec3d& vertex : tube.vertices) vertex = turned * vertex;
  const View view = OutsideView(tube.vertices, 320, 240);
  const Camera<double> camera(view.camera);
  double left = 320, right = 0;
  for (const Vec3d& vertex : tube.vertices) {
    const auto pixel = camera.Project(view.world_from_camera.inverse() * vertex);
    ASSERT_TRUE(pixel);
    EXPECT_GT(pixel->minCoeff(), 0);
    EXPECT_LT(pixel->x(), 320);
    EXPECT_LT(pixel->y(), 240);
    left = std::min(left, pixel->x());
    right = std::max(right, pixel->x());
  }
  EXPECT_GT(right - left, 0.85 * 320);  // the tube's length lies across the image
}

TEST(Colormap, ErrorsAreBlueInsideGreyAtZeroRedOutside) {
  const std::vector<Rgb8> colors = ErrorColors({-25, -10, 0, 10, 25}, 10);
  EXPECT_EQ(colors[0], colors[1]);
  EXPECT_EQ(colors[3], colors[4]);
  EXPECT_GT(colors[1][2], 100);
  EXPECT_EQ(colors[1][0], 0);
  EXPECT_EQ(colors[2][0], colors[2][1]);
  EXPECT_EQ(colors[2][1], colors[2][2]);
  EXPECT_LT(colors[2][0], 230);  // grey, not white
  EXPECT_GT(colors[3][0], 100);
  EXPECT_EQ(colors[3][2], 0);
}

TEST(Colormap, CountsAreJetFromOneToAll) {
  const std::vector<Rgb8> colors = CountColors({0, 1, 11, 21}, 21);
  EXPECT_EQ(colors[0], kUnobservedGrey);
  EXPECT_EQ(colors[1], (Rgb8{0, 0, 128}));
  EXPECT_EQ(colors[2], (Rgb8{128, 255, 128}));
  EXPECT_EQ(colors[3], (Rgb8{128, 0, 0}));
  EXPECT_EQ(CountColors({1}, 1)[0], (Rgb8{0, 0, 128}));  // one frame: no division by nothing
}

TEST(Layout, ScalingKeepsTheMean) {
  Image8 image(9, 6, 1);
  for (int i = 0; i < 54; ++i) image.data[i] = static_cast<uint8_t>(i * 4);
  EXPECT_EQ(Scaled(image, 9, 6).data, image.data);
  EXPECT_EQ(Scaled(image, 1, 1).data[0], 106);
  const Image8 half = Scaled(image, 3, 2);
  EXPECT_EQ(half.data[0], (0 + 4 + 8 + 36 + 40 + 44 + 72 + 76 + 80) / 9);
  EXPECT_NEAR(Scaled(image, 2, 6).Pixel(0, 0)[0], (0 + 4 + 8 + 12 + 16 / 2.0) / 4.5, 0.5);
}

TEST(Portrait, IsTheSameForAnyNumberOfThreads) {
  const Mesh tube = test::Tube(20, 120, 3, 40, 60);
  const Portrait portrait(tube);
  std::vector<Rgb8> colors;
  for (size_t v = 0; v < tube.vertices.size(); ++v)
    colors.push_back(Jet(0.01 * static_cast<double>(v % 100)));
  View view = PinholeView(90);
  view.world_from_camera = At(0, 0, 10);
  SetThreadCount(1);
  const Image8 one = portrait.Draw(view, colors);
  SetThreadCount(3);
  const Image8 many = portrait.Draw(view, colors);
  SetThreadCount(0);
  EXPECT_EQ(one.data, many.data);
}

}  // namespace
}  // namespace lumen
