// Hard light, surfaces, sensors and frames, each case with its reference. Geometry: hard_cases_test.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "common/config.h"
#include "common/files.h"
#include "common/sequence.h"
#include "sim/ground_truth.h"
#include "sim/render.h"
#include "tests/path_stage.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::CentredPinhole;
using test::Estimate;
using test::MeanOver;
using test::Stage;

constexpr double kIntensity = 500;

TEST(HardCases, BlackWallSendsNothing) {
  for (const bool vessels : {false, true}) {
    Stage stage(test::Globe(20, 30), CentredPinhole(24, 18, 12), kIntensity);
    stage.surface.albedo.setZero();
    if (vessels) stage.surface.vessels.emplace(VesselOptions{}, stage.mesh, 1);
    stage.options = {4, 6, 0};
    for (const float value : stage.Render().radiance.data) EXPECT_EQ(value, 0);
  }
}

// Neither of a coat's lobes has a share in nothing: of index 1 it mirrors nothing either.
TEST(HardCases, BlackWallUnderACoatOfIndexOneSendsNothing) {
  for (const int shared_paths : {0, 16}) {
    Stage stage(test::Globe(20, 30), CentredPinhole(24, 18, 12), kIntensity);
    stage.surface.albedo.setZero();
    stage.surface.coat.emplace(CoatOptions{1, 0.3, 1, 0.06});
    stage.options = {4, 6, 0, shared_paths};
    Film film;
    EXPECT_EQ(stage.Render(1, true, &film).failure.count, 0) << shared_paths;
    for (const float value : film.radiance.data) EXPECT_EQ(value, 0);
  }
}

// In a white sphere every bounce sends on as much as the one before: Φ/(4πR²) each. Roulette from the first
// one on may end no path, for none has lost anything.
TEST(HardCases, WhiteWallLosesNothing) {
  constexpr int kBounces = 40;
  Stage stage(test::Globe(20, 90), CentredPinhole(16, 12, 8), kIntensity);
  stage.surface.albedo.setOnes();
  stage.world_from_camera.translation() = Vec3d(4, -6, 3);
  stage.options = {4, kBounces, 0};
  const Estimate found = MeanOver(stage, 8, [](const Film& film) -> const ImageF& { return film.indirect; });
  const double expected = kBounces * kIntensity / 400 / kPi;
  EXPECT_NEAR(found.mean, expected, 5 * found.standard_error + 1.2e-3 * expected);
  EXPECT_LT(found.standard_error, 0.01 * expected);
}

// As roughness goes, the glint becomes the light's mirror image: at the camera, all of it together is the
// irradiance of a source behind the mirror, F·I/(d + d)². GGX's tail beyond the frame's edge, 40 α from the
// middle, has 1/1600 of the half vectors; a lobe of this width sees Fresnel's reflectance at normal incidence
// vary by less.
TEST(HardCases, MirrorShowsTheLightsImage) {
  constexpr double kHeight_mm = 25;
  Mesh mirror;
  test::AddPlate(&mirror, -90, 90, -90, 90, kHeight_mm);
  for (const double roughness : {0.0, 0.02, 0.05, 0.1}) {
    for (const double beside_mm : {0.0, 3.0}) {
      const double alpha = std::max(1e-3, roughness * roughness);
      const double half_width = 2 * 40 * alpha, focal_px = 256 / (2 * half_width);
      Stage stage(mirror, CentredPinhole(256, 256, focal_px), kIntensity);
      stage.intrinsics.cx -= focal_px * beside_mm / 2 / kHeight_mm;  // the image lies half way to the guide
      stage.light.sources[0].position = Vec3d(beside_mm, 0, 0);
      stage.surface.coat.emplace(CoatOptions{1.37, roughness, 1, 0, std::nullopt});
      stage.options.samples = 4;
      const Film film = stage.Render(3, true);
      double sum = 0;
      for (int y = 0; y < 256; ++y) {
        for (int x = 0; x < 256; ++x) {
          const double u = (x - stage.intrinsics.cx) / focal_px, v = (y - stage.intrinsics.cy) / focal_px;
          sum += film.glint.Pixel(x, y)[0] / std::pow(1 + u * u + v * v, 1.5) / (focal_px * focal_px);
        }
      }
      const double d_squared = kHeight_mm * kHeight_mm * 4 + beside_mm * beside_mm;
      const double cosine = 2 * kHeight_mm / std::sqrt(d_squared);
      const double expected = kIntensity * FresnelDielectric(1.37f, float(cosine)) / d_squared;
      EXPECT_NEAR(sum, expected, 0.01 * expected) << roughness << ' ' << beside_mm;
    }
  }
}

// However far brightness jumps, the gain stays a number and comes to rest where it is called for.
TEST(HardCases, GainSteps) {
  const AutoGain options;
  const Response response;
  for (const double step : {1e4, 1e-4, 1e30, 1e-30}) {
    std::vector<double> brightness(10, 0.2);
    brightness.insert(brightness.end(), 90, 0.2 * step);
    brightness.insert(brightness.end(), 90, 0.2);
    const std::vector<double> gains = RunAutoGain(options, response, brightness);
    for (const double gain : gains) EXPECT_TRUE(std::isfinite(gain) && gain > 0) << step;
    const double target = std::pow(options.target, 2.2);
    EXPECT_NEAR(gains[99] / (target / (0.2 * step)), 1, 1e-3) << step;
    EXPECT_NEAR(gains[189] / (target / 0.2), 1, 1e-3) << step;
  }
  // Black frames, first or later, call for nothing.
  EXPECT_EQ(RunAutoGain(options, response, {0, 0, 0}), (std::vector<double>{1, 1, 1}));
}

TEST(HardCases, BlackAndWhiteFrames) {
  const Image8 valid(4, 3, 1, 255);
  const ImageF vignetting(4, 3, 1, 1.0f);
  const Camera<double> camera(CentredPinhole(4, 3, 4));
  for (const bool srgb : {false, true}) {
    Response response;
    response.srgb = srgb;
    for (const double gain : {1e-4, 1.0, 1e4}) {
      const ImageF black(4, 3, 3, 0.0f), white(4, 3, 3, 1e30f);
      for (const uint8_t value : Develop(response, gain, black, vignetting, valid).data) EXPECT_EQ(value, 0);
      for (const uint8_t value : Develop(response, gain, white, vignetting, valid).data)
        EXPECT_EQ(value, 255);
    }
    EXPECT_EQ(MeterBrightness(response, ImageF(4, 3, 3, 0.0f), valid, camera), 0);
    EXPECT_NEAR(MeterBrightness(response, ImageF(4, 3, 3, 1e30f), valid, camera) / 1e30, 1, 1e-6);
  }
}

// The ends of the scale belong to themselves at every exponent; an exponent of 0 is refused by name.
TEST(HardCases, GammaAtItsEnds) {
  for (const double gamma : {0.1, 1.0, 2.2, 10.0}) {
    Response response;
    response.gamma = gamma;
    for (const float end : {0.0f, 1.0f}) {
      EXPECT_EQ(Encode(response, end), end) << gamma;
      EXPECT_EQ(Decode(response, end), end) << gamma;
      EXPECT_TRUE(std::isfinite(EncodeDerivative(response, end))) << gamma;
    }
  }
  const test::ScratchFolder scratch;
  const fs::path file = test::WriteScene(scratch);
  const std::string error = test::ErrorOf([&] { ReadScene(file, {"response.gamma=0"}, 4); });
  EXPECT_NE(error.find("gamma"), std::string::npos) << error;
  EXPECT_EQ(test::ErrorOf([&] { ReadScene(file, {"response.gamma=1"}, 4); }), "");
}

// EndoMapper's polynomial folds back at θ_d = 1.0572: the pixels beyond have no ray, no light and no truth;
// those within have all three.
TEST(HardCases, PixelsAtAndBeyondTheFold) {
  Stage stage(test::Globe(20, 30), Resized(EndomapperIntrinsics(), 180, 135), kIntensity);
  stage.options = {4, 2, 9};
  const FrameTruth truth = ComputeTruth(stage.wall, Camera<double>(stage.intrinsics), stage.valid,
                                        stage.world_from_camera, nullptr);
  const CameraIntrinsics& k = stage.intrinsics;
  stage.options.samples = 1;  // through the pixel's centre
  const Film film = stage.Render();
  int within = 0, beyond = 0;
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const double radius = std::hypot((x - k.cx) / k.fx, (y - k.cy) / k.fy);
      if (std::abs(radius - 1.0572) < 1e-3) continue;  // the constant's own digits
      const bool inside = radius < 1.0572;
      EXPECT_EQ(film.radiance.Pixel(x, y)[1] > 0, inside) << x << ' ' << y;
      EXPECT_EQ(!std::isnan(*truth.z.Pixel(x, y)), inside) << x << ' ' << y;
      ++(inside ? within : beyond);
    }
  }
  EXPECT_GT(within, 10000);
  EXPECT_GT(beyond, 100);
  // Samples spread over a pixel's square cross the fold within it.
  stage.options.samples = 16;
  stage.Render();  // finite
}

TEST(HardCases, FrameOfOnePixel) {
  const test::ScratchFolder scratch;
  const Scene scene =
      ReadScene(test::WriteScene(scratch),
                {"camera.width=1", "camera.height=1", "truth.exact=[\"z\", \"flow_next\"]"}, 4);
  const RenderResult result = Render(scene, {scratch / "out", 0, -1, 4});
  EXPECT_EQ(result.not_finite, 0);
  const Sequence sequence = ReadSequence(scratch / "out");
  ASSERT_EQ(sequence.frames.size(), 3u);
  for (const SequenceFrame& frame : sequence.frames) {
    const Image8 color = ReadColor(sequence, frame);
    EXPECT_EQ(color.data.size(), 3u);
    EXPECT_GT(color.data[0], 0);
    EXPECT_GT(*DecodeDepth(ReadImage16(frame.depth, 1)).Pixel(0, 0), 0);
  }
}

// All its samples would take minutes: of 67 million pixels a few hundred are valid, the last one among them.
// Each has the closed form's value at its own place, so no index has wrapped; the picture's file reads back.
TEST(HardCases, FrameOf8192Squared) {
  constexpr int kSide = 8192;
  const test::ScratchFolder scratch;
  Stage stage(test::Globe(20, 300), CentredPinhole(kSide, kSide, 4096), kIntensity);
  std::fill(stage.valid.data.begin(), stage.valid.data.end(), uint8_t{0});
  std::vector<std::pair<int, int>> pixels;
  for (int y = 0; y < kSide; y += 431) {
    for (int x = 0; x < kSide; x += 431) pixels.push_back({x, y});
  }
  pixels.push_back({kSide - 1, kSide - 1});
  for (const auto& [x, y] : pixels) *stage.valid.Pixel(x, y) = 255;
  stage.world_from_camera.translation() = Vec3d(3, -2, 1);
  Film film;
  const PathCount count = stage.Render(1, false, &film);
  EXPECT_EQ(count.samples, int64_t(pixels.size()));
  EXPECT_EQ(count.failure.count, 0);
  const Vec3d eye = stage.world_from_camera.translation();
  for (const auto& [x, y] : pixels) {
    const Vec3d ray = Vec3d((x - 4095.5) / 4096, (y - 4095.5) / 4096, 1).normalized();
    const double b = eye.dot(ray), t = -b + std::sqrt(b * b + 400 - eye.squaredNorm());
    const double expected = kIntensity * 0.8 / kPi * ray.dot(eye + t * ray) / 20 / (t * t);
    EXPECT_NEAR(film.radiance.Pixel(x, y)[0], expected, 2 * kPi / 300 * expected) << x << ' ' << y;
  }
  const Image8 picture = Develop({}, 1, film.radiance, ImageF(kSide, kSide, 1, 1.0f), stage.valid);
  WriteImage(scratch / "picture.png", picture);
  EXPECT_TRUE(ReadImage8(scratch / "picture.png", 3).data == picture.data);
  EXPECT_GT(picture.data.back(), 0);
}

// What is not finite is counted, the metering included, and named with a command that, run as it stands,
// finds it again.
class NotFinite : public testing::Test {
 protected:
  // Exit code of a shell command; what it says on stderr.
  int Run(const std::string& command, std::string* said) const {
    const std::string whole = "cd '" + scratch_.path().string() + "' && " + command + " >/dev/null 2>err";
    const int status = WEXITSTATUS(std::system(whole.c_str()));
    *said = ReadFile(scratch_ / "err");
    return status;
  }
  test::ScratchFolder scratch_;
};

TEST_F(NotFinite, IsCountedAndReplayed) {
  // A guide brighter than float can tell.
  std::string scene = test::kSmallScene;
  scene.replace(scene.find("intensity = [600, 600, 600]"), 27, "intensity = [1e300, 600, 600]");
  CreateFolder(scratch_ / "it's a scene");
  WriteFile(scratch_ / "it's a scene" / "s.toml", scene);
  const std::string lumen = LUMEN_COMMAND;
  for (const std::string metered :
       {"", " --set sensor.gain=2",
        " --set sensor.gain=2 --set sensor.shutter.readout=0.3 --set peristalsis.amplitude=0.1"}) {
    std::string text = scene;
    if (!metered.empty()) text.erase(text.find("[sensor.auto_gain]"), 18);
    WriteFile(scratch_ / "it's a scene" / "s.toml", text);
    std::string said, again;
    ASSERT_EQ(Run("'" + lumen +
                      "' render \"it's a scene/s.toml\" -o out --seed 7 --frames 1:3 "
                      "--set path.samples=2" +
                      metered,
                  &said),
              0)
        << said;
    EXPECT_NE(said.find("not finite"), std::string::npos) << said;
    EXPECT_EQ(said.find("metering") != std::string::npos, metered.empty()) << said;
    EXPECT_NE(said.find(metered.empty() ? "frame 0," : "frame 1,"), std::string::npos) << said;
    const std::string marker = "replay it with: lumen ";
    const size_t at = said.find(marker);
    ASSERT_NE(at, std::string::npos) << said;
    const std::string command = said.substr(at + marker.size(), said.find('\n', at) - at - marker.size());
    ASSERT_EQ(Run("'" + lumen + "' " + command, &again), 0) << again;
    const auto first = [](const std::string& text) {
      const size_t from = text.find("the first: ");
      return text.substr(from, text.find(';', from) - from);
    };
    EXPECT_EQ(first(again), first(said));
    EXPECT_FALSE(first(said).empty());
  }
}

}  // namespace
}  // namespace lumen
