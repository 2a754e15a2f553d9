// Gains from places that several frames show: the regression against values made by its own model's formula
// with everything known, and the whole against simulated frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/files.h"
#include "common/progress.h"
#include "common/random.h"
#include "recon/calibration/calibrate.h"
#include "recon/calibration/calibration_report.h"
#include "recon/training/training_frames.h"
#include "sim/render.h"
#include "tests/small_sequence.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

double Uniform(int a, int b) { return UniformDouble(RandomBits(7, a, b)); }

// Places that frames see from distances of 10 to 40 mm, with an albedo each; every 20th value is a glint.
struct Synthetic {
  static constexpr int kPlaces = 120, kFrames = 6;
  Sequence sequence;
  Sightings sightings;
  std::vector<Eigen::ArrayXXf> bounced;
  std::vector<double> gain = {1, 1.7, 0.6, 2.4, 1.1, 0.9};

  explicit Synthetic(const Eigen::Array3d& strength) {
    sequence.folder = "synthetic";
    for (int f = 0; f < kFrames; ++f) sequence.frames.emplace_back().number = f;
    const Eigen::ArrayXXf zero = Eigen::ArrayXXf::Zero(kPlaces, kFrames);
    auto& s = sightings;
    s.irradiance = s.by_spread = s.log_cosine = s.view_cosine = s.distance_mm = zero;
    bounced.assign(3, zero);
    for (auto& value : s.value) value = zero;
    for (int p = 0; p < kPlaces; ++p) {
      s.places.push_back({Vec3d(100 * Uniform(p, 0), 100 * Uniform(p, 1), 0), Vec3d::UnitZ()});
      for (int f = 0; f < kFrames; ++f) Fill(p, f, strength);
    }
  }

  void Fill(int p, int f, const Eigen::Array3d& strength) {
    auto& s = sightings;
    const double d = 10 + 30 * Uniform(p, 10 + f), cosine = 0.3 + 0.7 * Uniform(p, 20 + f);
    const double off_axis = Uniform(p, 30 + f);
    s.irradiance(p, f) = static_cast<float>(3600 * std::exp(-2.7 * off_axis) * cosine / (d * d));
    s.by_spread(p, f) = static_cast<float>(-off_axis);
    s.log_cosine(p, f) = static_cast<float>(std::log(cosine));
    s.view_cosine(p, f) = static_cast<float>(cosine);
    s.distance_mm(p, f) = static_cast<float>(d);
    for (int c = 0; c < 3; ++c) {
      const double albedo = 0.1 + 0.8 * Uniform(p, 40 + c);
      bounced[c](p, f) = static_cast<float>(gain[f] * Uniform(p, 50 + 10 * c + f));
      const double value =
          albedo * (gain[f] * double(s.irradiance(p, f)) / kPi + strength[c] * double(bounced[c](p, f)));
      const double glint = (p + 7 * f) % 20 == 0 ? 3 : 1;
      s.value[c](p, f) = static_cast<float>(glint * value);
    }
  }

  double LargestError(const Eigen::VectorXd& log_gain) const {
    double largest = 0;
    for (int f = 0; f < kFrames; ++f)
      largest = std::max(largest, std::abs(log_gain[f] - std::log(gain[f] / gain[0])));
    return largest;
  }
};

TEST(GainFit, FindsGainsPastGlints) {
  const Synthetic scene(Eigen::Array3d(0, 0, 0));
  const GainFit fit = FitGains(scene.sequence, scene.sightings, {}, {}, nullptr);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-4);
  EXPECT_EQ(fit.places, Synthetic::kPlaces);
  EXPECT_EQ(fit.wall.log_gain[0], 0);
}

TEST(GainFit, FindsBouncedLightAndIsWrongWithoutIt) {
  const Eigen::Array3d strength(0.9, 0.4, 0.3);
  const Synthetic scene(strength);
  const GainFit direct = FitGains(scene.sequence, scene.sightings, {}, {}, nullptr);
  EXPECT_GT(scene.LargestError(direct.wall.log_gain), 0.01);  // what the comparison rejects
  const GainFit fit = FitGains(scene.sequence, scene.sightings, scene.bounced, {}, &direct);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-3);
  EXPECT_LT((fit.wall.strength - strength).abs().maxCoeff(), 1e-2);
  // Where there is none, none is found.
  const Synthetic plain(Eigen::Array3d(0, 0, 0));
  const GainFit none = FitGains(plain.sequence, plain.sightings, plain.bounced, {}, nullptr);
  EXPECT_LT(none.wall.strength.maxCoeff(), 1e-3);
  EXPECT_LT(plain.LargestError(none.wall.log_gain), 1e-3);
}

TEST(GainFit, FindsSpreadAndContrast) {
  Synthetic scene(Eigen::Array3d(0, 0, 0));
  // The frames were lit with a spread larger by .2, and developed with γ 10% off.
  for (auto& value : scene.sightings.value)
    value = (value * (0.2f * scene.sightings.by_spread).exp()).pow(1.1f);
  GainFitOptions options;
  options.spread = options.contrast = true;
  const GainFit fit = FitGains(scene.sequence, scene.sightings, {}, options, nullptr);
  EXPECT_NEAR(fit.spread_off, 0.2, 1e-2);
  EXPECT_NEAR(fit.contrast, 1.1, 1e-2);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-2);
}

TEST(GainFit, TooLittleInCommonIsSaidInOneLine) {
  Synthetic scene(Eigen::Array3d(0, 0, 0));
  for (auto& value : scene.sightings.value) {
    for (int p = 10; p < Synthetic::kPlaces; ++p) value(p, 3) = NAN;
  }
  EXPECT_EQ(
      ErrorOf([&] { FitGains(scene.sequence, scene.sightings, {}, {}, nullptr); }),
      "synthetic: frame 3 shares 10 places with other frames, which is fewer than 30; its gain can't be "
      "told: add frames between, or leave it out");
}

}  // namespace
}  // namespace lumen::test
