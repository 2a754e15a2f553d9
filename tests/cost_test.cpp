// What accuracy costs in time: frontiers of made-up points, errors of pictures whose noise is known, and a
// small scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "common/files.h"
#include "sim/cost/knobs.h"
#include "sim/cost/render_cost.h"
#include "sim/cost/timing.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

CostPoint PointOf(const std::string& setting, double seconds, double error) {
  return {setting, seconds, 0, {error}, {0}, false};
}

CostCurves FourPoints() {
  CostCurves curves{{"error"},
                    {{"a", {PointOf("1", 1, 4), PointOf("2", 3, 2)}}, {"b", {PointOf("x", 2, 5)}}}};
  curves.curves[1].points.push_back(PointOf("y", 4, std::nan("")));
  return curves;
}

TEST(CostCurves, FrontierIsWhatNothingBeats) {
  CostCurves curves = FourPoints();
  std::vector<CostPoint> frontier = Frontier(curves, 0);
  ASSERT_EQ(frontier.size(), 2u);  // x is slower than 1 and worse, y's error isn't known
  EXPECT_EQ(frontier[0].setting, "1");
  EXPECT_EQ(frontier[1].setting, "2");
  curves.curves[1].points.push_back(PointOf("z", 1, 2));  // as fast as 1, as good as 2
  frontier = Frontier(curves, 0);
  ASSERT_EQ(frontier.size(), 1u);
  EXPECT_EQ(frontier[0].setting, "z");
}

TEST(CostCurves, CsvHasALineAPoint) {
  CostCurves curves = FourPoints();
  curves.curves[0].points[0].is_default = true;
  EXPECT_EQ(ToCsv(curves),
            "knob,setting,seconds,seconds_spread,error,error_spread,error_frontier,default\n"
            "a,1,1,0,4,0,1,1\n"
            "a,2,3,0,2,0,1,0\n"
            "b,x,2,0,5,0,0,0\n"
            "b,y,4,0,nan,0,0,0\n");
}

TEST(CostCurves, PlotRingsTheDefault) {
  CostCurves curves = FourPoints();
  curves.curves[0].points[1].is_default = true;
  const Plot plot = CostPlot(curves, 0, "s", "e");
  ASSERT_TRUE(plot.series.back().rings);
  EXPECT_EQ(plot.series.back().x, std::vector<double>{3});
  EXPECT_EQ(plot.series.back().y, std::vector<double>{2});
}

// Grey noise of a known deviation about 0.5, plus an offset.
class NoisyPictures {
 public:
  Luminance Next(double deviation, double offset) {
    ImageF radiance(kSide, kSide, 3);
    std::normal_distribution<double> noise(0.5 + offset, deviation);
    for (int i = 0; i < kSide * kSide; ++i) std::fill_n(&radiance.data[3 * i], 3, float(noise(generator_)));
    return LuminanceOf(radiance, Image8(kSide, kSide, 1, 255));
  }
  static constexpr int kSide = 256;

 private:
  std::mt19937 generator_{1};
};

TEST(CostReference, ErrorIsTheNoiseWithoutTheReferences) {
  NoisyPictures pictures;
  // Halves of 0.04 make a reference of 0.04/√2, as noisy as half of what is to be measured.
  const Reference reference(pictures.Next(0.04, 0), pictures.Next(0.04, 0));
  const double n = NoisyPictures::kSide * NoisyPictures::kSide;
  // The relative error of a variance from n differences is √(2/n); that of its root half of it. Five of them,
  // and as many for the reference's.
  const double bound = 5 * std::sqrt(0.5 / n) * 2;
  EXPECT_NEAR(reference.Noise(ErrorMeasure::kPixels) / (0.04 / std::sqrt(2) / 0.5), 1, bound);
  const Luminance noisy = pictures.Next(0.05, 0);
  EXPECT_NEAR(reference.Error(noisy, ErrorMeasure::kPixels) / (0.05 / 0.5), 1, bound);
  const double block_bound = bound * 8;  // 64 times fewer
  EXPECT_NEAR(reference.Error(noisy, ErrorMeasure::kBlocks) / (0.05 / 8 / 0.5), 1, block_bound);
  // Less than the reference knows.
  EXPECT_TRUE(std::isnan(reference.Error(pictures.Next(0.01, 0), ErrorMeasure::kPixels)));
}

TEST(CostReference, BiasHasItsStandardError) {
  NoisyPictures pictures;
  const Reference reference(pictures.Next(0.01, 0), pictures.Next(0.01, 0));
  const double n = NoisyPictures::kSide * NoisyPictures::kSide;
  const Bias none =
      reference.BiasOf({pictures.Next(0.05, 0), pictures.Next(0.05, 0), pictures.Next(0.05, 0)});
  const double expected_error = std::sqrt(0.05 * 0.05 / 3 + 0.01 * 0.01 / 2) / std::sqrt(n) / 0.5;
  // From 16 tiles × 2 degrees of freedom: within 5/√(2·32) of it.
  EXPECT_NEAR(none.standard_error / expected_error, 1, 5 / std::sqrt(64));
  EXPECT_LT(std::abs(none.value), 5 * expected_error);
  const Bias some = reference.BiasOf({pictures.Next(0.05, 0.01), pictures.Next(0.05, 0.01)});
  EXPECT_NEAR(some.value, 0.02, 5 * some.standard_error);
  EXPECT_GT(some.value, 5 * some.standard_error);
}

TEST(CostReference, OnlyValidPixelsCount) {
  ImageF radiance(16, 8, 3, 1.0f);
  Image8 valid(16, 8, 1, 255);
  *valid.Pixel(12, 4) = 0;
  *radiance.Pixel(12, 4) = 100;
  const Luminance luminance = LuminanceOf(radiance, valid);
  EXPECT_EQ(luminance.pixels.size(), 127u);
  EXPECT_EQ(luminance.blocks.size(), 1u);  // the other one has a hole
  EXPECT_NEAR(luminance.sum, 127, 1e-5);
}

TEST(CostTiming, MediansAndRanges) {
  EXPECT_EQ(MedianOf({3, 1, 2}), 2);
  EXPECT_EQ(MedianOf({4, 1, 2, 3}), 2.5);
  EXPECT_EQ(HalfRange({3, 1, 2}), 1);
  EXPECT_TRUE(std::isnan(HalfRange({3, std::nan(""), 2})));
}

Scene SmallScene(const ScratchFolder& scratch) {
  WriteFile(scratch / "scene.toml", R"(
[geometry]
kind = "colon"
length_mm = 60
tolerance_mm = 0.3
[trajectory]
kind = "withdrawal"
start_mm = 30
end_mm = 20
frames = 2
[camera]
preset = "c3vd"
width = 40
height = 32
[light]
model = "sls"
[[light.source]]
position = [2, 1, 0]
direction = [0, 0, 1]
spread = 2
intensity = [1000, 1000, 1000]
[response]
gamma = 2.2
[surface]
albedo = [0.5, 0.5, 0.5]
[surface.mottling]
contrast = 0.1
[path]
samples = 2
bounces = 1
[sensor.auto_gain]
[sensor.jpeg]
quality = 90
)");
  return ReadScene(scratch / "scene.toml", {}, 0);
}

TEST(RenderCost, KnobsHoldTheScenesOwnSettingOnce) {
  ScratchFolder scratch;
  const Scene scene = SmallScene(scratch);
  for (const Knob& knob : KnobsOf(scene)) {
    EXPECT_EQ(std::ranges::count(knob.settings, true, &KnobSetting::is_own), 1) << knob.name;
  }
}

TEST(RenderCost, KnobsAreTheOnesThatTheSceneKnows) {
  ScratchFolder scratch;
  Scene scene = SmallScene(scratch);
  const auto names = [&] {
    std::vector<std::string> names;
    for (const Knob& knob : KnobsOf(scene)) names.push_back(knob.name);
    return names;
  };
  EXPECT_EQ(names(), (std::vector<std::string>{"samples", "roulette_after", "shared_paths", "sampler",
                                               "packets", "precision", "bounces"}));
  scene.path.bounces = 0;
  scene.defocus = Defocus{0.3, 15};  // the plain tracer has none
  EXPECT_EQ(names(), (std::vector<std::string>{"samples", "sampler", "bounces"}));
}

TEST(RenderCost, SwitchesTakeEffectsOut) {
  ScratchFolder scratch;
  const Scene scene = SmallScene(scratch);
  Scene without = scene;
  std::vector<std::string> names;
  for (const EffectSwitch& effect : SwitchesOf(scene)) {
    names.push_back(effect.name);
    effect.switch_off(&without);
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"interreflection", "mottling", "offset_guides", "auto_gain", "jpeg"}));
  EXPECT_EQ(without.path.bounces, 0);
  EXPECT_FALSE(without.surface.mottling);
  EXPECT_FALSE(without.sensor.auto_gain);
  EXPECT_FALSE(without.sensor.jpeg);
  ASSERT_EQ(without.calibration.light.sources.size(), 1u);
  EXPECT_TRUE(without.calibration.light.sources[0].position.isZero(0));
}

TEST(RenderCost, OneBounceIsTooDarkAndOneSampleTooNoisy) {
  ScratchFolder scratch;
  const Scene scene = SmallScene(scratch);
  RenderCostOptions options;
  options.seconds = 3;
  const RenderCost cost = MeasureRenderCost(scene, options);
  ASSERT_EQ(cost.sampling.curves[0].knob, "samples");
  EXPECT_GT(cost.sampling.curves[0].points.at(0).errors[0], 0);
  ASSERT_EQ(cost.transport.curves[0].knob, "bounces");
  const auto darkest = std::ranges::find_if(
      cost.biases, [](const SettingBias& bias) { return bias.knob == "bounces" && bias.setting == "0"; });
  ASSERT_NE(darkest, cost.biases.end());
  // A closed wall of albedo 0.5 sends some half of its light on.
  EXPECT_LT(darkest->bias.value, -0.1);
  EXPECT_LT(darkest->bias.value, -5 * darkest->bias.standard_error);
  ASSERT_EQ(cost.effects.size(), 5u);
  EXPECT_GT(cost.frame_seconds, 0);
  RenderCostOptions no_such_frame;
  no_such_frame.frame = 2;
  EXPECT_NE(ErrorOf([&] { MeasureRenderCost(scene, no_such_frame); }).find("--frame 2"), std::string::npos);
}

}  // namespace
}  // namespace lumen::test
