#include "sim/imaging/defocus.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/random.h"
#include "tests/path_stage.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ErrorOf;

Vec2f RandomPair(uint64_t index) {
  return Vec2f(UniformFloat(RandomBits(11, index, 0)), UniformFloat(RandomBits(11, index, 1)));
}

// Unit directions on the axis, aside, at 90° and behind.
std::vector<Vec3f> Directions() {
  return {Vec3f(0, 0, 1), Vec3f(0.5f, -0.3f, 0.8f).normalized(), Vec3f(-0.6f, 0.8f, 0),
          Vec3f(0.7f, 0.7f, -0.2f).normalized()};
}

TEST(Defocus, ReadsItsKeys) {
  const Config config = Config::Parse("aperture_mm = 0.2\n", "scene");
  const Defocus defocus = ReadDefocus(config.root());
  config.RejectUnknown();
  EXPECT_EQ(defocus.aperture_mm, 0.2);
  EXPECT_EQ(defocus.focus_mm, 10);
  for (const std::string bad : {"aperture_mm = -0.1", "aperture_mm = 3", "focus_mm = 0", "focus_mm = inf"}) {
    const Config refused = Config::Parse(bad, "scene");
    EXPECT_NE(ErrorOf([&] { ReadDefocus(refused.root()); }).find("scene:1"), std::string::npos) << bad;
  }
}

// The samples' places at a distance d are those of the aperture, times 1 − d/focus: a disc of the closed
// form's diameter, filled to its border.
TEST(Defocus, BlurIsTheClosedFormsDisc) {
  const Defocus defocus = {0.4, 12};
  for (const Vec3f& w : Directions()) {
    for (const double d : {3.0, 12.0, 50.0}) {
      const double shrink = 1 - d / defocus.focus_mm;
      double diameter = 0;
      for (uint64_t i = 0; i < 2000; ++i) {
        const LensRay ray = ThroughLens(defocus, w, RandomPair(i));
        EXPECT_NEAR(ray.direction.norm(), 1, 1e-6);
        EXPECT_EQ(ray.origin.z(), 0);
        const Vec3d origin = ray.origin.cast<double>(), direction = ray.direction.cast<double>().normalized();
        const Vec3d place = d * w.cast<double>() + shrink * origin;
        // Rounding of unit vectors in float, d away.
        EXPECT_LT(direction.cross(place - origin).norm(), 2e-7 * d + 1e-7);
        EXPECT_GT(direction.dot(place - origin), 0);
        diameter = std::max(diameter, 2 * (place - d * w.cast<double>()).norm());
      }
      const double expected = defocus.aperture_mm * std::abs(shrink);
      EXPECT_LE(diameter, expected * (1 + 1e-6));
      EXPECT_GE(diameter, expected * 0.995);  // of 2000 samples one is in the outermost percent of the area
    }
  }
}

// What is in focus is one place for the whole aperture.
TEST(Defocus, IsSharpAtTheFocus) {
  const Defocus defocus = {1, 7};
  for (const Vec3f& w : Directions()) {
    for (uint64_t i = 0; i < 100; ++i) {
      const LensRay ray = ThroughLens(defocus, w, RandomPair(i));
      const Vec3d to_focus = 7 * w.cast<double>() - ray.origin.cast<double>();
      EXPECT_LT(ray.direction.cast<double>().cross(to_focus).norm(), 2e-6);
    }
  }
}

// χ² of the aperture's sampling over 8 rings of equal area times 16 sectors. 127 degrees of freedom: mean
// 127, standard deviation 15.9; the bounds are at ±5 of these.
TEST(Defocus, FillsTheApertureEvenly) {
  const Defocus defocus = {0.3, 10};
  constexpr int kRings = 8, kSectors = 16, kSamples = 200000;
  const auto chi_squared = [&](double skew) {
    std::vector<int> counts(kRings * kSectors, 0);
    for (uint64_t i = 0; i < kSamples; ++i) {
      Vec2f random = RandomPair(i);
      random.x() = static_cast<float>(std::pow(random.x(), skew));
      const Vec3f origin = ThroughLens(defocus, Vec3f(0, 0, 1), random).origin;
      const double area = origin.squaredNorm() / (0.15 * 0.15);
      const double turn = std::atan2(origin.y(), origin.x()) / (2 * kPi) + 0.5;
      const int ring = std::min(kRings - 1, static_cast<int>(area * kRings));
      ++counts[ring * kSectors + std::min(kSectors - 1, static_cast<int>(turn * kSectors))];
    }
    const double expected = double(kSamples) / counts.size();
    double sum = 0;
    for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
    return sum;
  };
  EXPECT_GT(chi_squared(1), 127 - 5 * 15.9);
  EXPECT_LT(chi_squared(1), 127 + 5 * 15.9);
  EXPECT_GT(chi_squared(1.1), 127 + 5 * 15.9);  // a disc a little denser in its middle is noticed
}

TEST(Defocus, NoApertureIsExactlyThePinhole) {
  for (const Vec3f& w : Directions()) {
    for (uint64_t i = 0; i < 100; ++i) {
      const LensRay ray = ThroughLens({0, 10}, w, RandomPair(i));
      EXPECT_EQ(ray.origin, Vec3f(0, 0, 0));
      EXPECT_EQ(ray.direction, w);
    }
  }
}

// The edge of a plate 8 mm away before a wall 16 mm away, which is in focus. A place (x, y) on the aperture
// sees the plate where x/2 + 8·w < 0, w being the pixel's tangent: a part of the disc that a chord cuts off.
// The wall beside the edge is lit as far as the camera's centre, where the light is, sees it, and behind it
// dark also for the places on the aperture that see past the edge.
TEST(Defocus, BlursAnEdgeAndItsShadow) {
  constexpr int kWidth = 64, kSamples = 4096;
  constexpr double kFocal_px = 400, kRadius_mm = 0.5;
  Mesh mesh;
  test::AddPlate(&mesh, -40, 0, -40, 40, 8);
  test::AddPlate(&mesh, -80, 80, -80, 80, 16);
  test::Stage stage(std::move(mesh), test::CentredPinhole(kWidth, 2, kFocal_px), 500);
  stage.surface.albedo = Vec3d::Constant(0.5);
  stage.options.samples = kSamples;
  const auto lit = [&](double z, double w) { return 500 * 0.5 / kPi / (z * z) * std::pow(1 + w * w, -1.5); };
  const auto largest_error = [&](const Film& film) {
    double largest = 0;
    for (int x = 0; x < kWidth; ++x) {
      const double w = (x - stage.intrinsics.cx) / kFocal_px;
      const double t = std::clamp(16 * w / kRadius_mm, -1.0, 1.0);
      const double plate = 0.5 - (t * std::sqrt(1 - t * t) + std::asin(t)) / kPi;
      const double expected = plate * lit(8, w) + (w > 0 ? (1 - plate) * lit(16, w) : 0);
      largest = std::max(largest, std::abs(film.radiance.Pixel(x, 0)[0] - expected) / lit(8, 0));
    }
    return largest;
  };
  Film film;
  const Defocus defocus = {2 * kRadius_mm, 16};
  stage.Render(1, false, &film, &defocus);
  // Five standard deviations of a binomial's mean, at most 0.5/√samples each; less, since samples are spread.
  EXPECT_LT(largest_error(film), 5 * 0.5 / std::sqrt(double(kSamples)));
  const Defocus another = {2 * kRadius_mm * 1.2, 16};
  stage.Render(1, false, &film, &another);
  EXPECT_GT(largest_error(film), 5 * 0.5 / std::sqrt(double(kSamples)));
  EXPECT_GT(largest_error(stage.Render()), 0.3);  // a pinhole's edge is sharp
}

}  // namespace
}  // namespace lumen
