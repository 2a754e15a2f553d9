// The path tracer on tissue under a coat, where light between walls has a closed form or a simpler wall's.
// reference_path_test.cpp holds it against the plain tracer.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/path_stage.h"
#include "tests/tissue_means.h"

namespace lumen::test {
namespace {

constexpr double kRadius_mm = 6, kIntensity = 100;
constexpr int kSeeds = 12;
// Standard errors that means of so few frames may be off: Student's t on 11 degrees of freedom is beyond once
// in 10,000.
constexpr double kStandardErrors = 6;

// A globe of tissue whose walks are a thousandth of a mm long, under a strong coat.
Stage Globular(double albedo) {
  Stage stage(Globe(kRadius_mm, 40), CentredPinhole(24, 16, 12), kIntensity);
  stage.surface.subsurface.emplace(WithAlbedos(Vec3d::Constant(albedo), Vec3d(800, 900, 1000)));
  stage.surface.coat.emplace(CoatOptions{1.8, 0.6, 1, 0});
  stage.light.sources[0].position = Vec3d(1, 0.5, 0);
  stage.light.sources[0].spread = 0;
  stage.world_from_camera.translation() = Vec3d(-0.5, 0.3, -1);
  stage.options.samples = 4;
  return stage;
}

// Of a frame, what the bounces after the first `before` add.
Estimate Added(Stage* stage, int before, int bounces) {
  std::vector<double> added;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    double sum = 0;
    for (const int limit : {bounces, before}) {
      stage->options.bounces = limit;
      for (const float value : stage->Render(seed).radiance.data) sum += limit == bounces ? value : -value;
    }
    added.push_back(sum / (3.0 * stage->valid.width * stage->valid.height));
  }
  return EstimateOf(added);
}

// The shorter the walks, the more tissue is Lambert's wall with the albedo of the closed form.
TEST(CoatedTissue, ShortWalksAreLambertian) {
  Stage tissue = Globular(0.95), lambertian = Globular(0.95);
  const double even = tissue.surface.subsurface->EvenReflectance()[0];
  lambertian.surface.subsurface.reset();
  const auto deviation = [&](double albedo) {
    lambertian.surface.albedo.setConstant(albedo);
    const Estimate a = Added(&tissue, 0, 3), b = Added(&lambertian, 0, 3);
    return std::abs(a.mean - b.mean) / std::hypot(a.standard_error, b.standard_error);
  };
  EXPECT_LT(deviation(even), kStandardErrors);
  EXPECT_GT(deviation(0.95 * even), kStandardErrors);
}

// A furnace that is all but white: below a coat that takes nothing, the tissue's albedo ρ is 98%, and with
// the coat's mean reflectance Ē each bounce sends on A = Ē + (1 − Ē) ρ. From the third on light is spread
// evenly: bounce k adds the radiance Aᵏ⁺¹ Φ/(π area). What a direction's own reflectance differs from Ē by
// changes that by less than (1 − ρ)/10. (Where μa = 0 the walks' roulette leaves a few of great weight.)
TEST(CoatedTissue, FurnaceKeepsItsLight) {
  constexpr int kBefore = 2, kBounces = 6;
  Stage stage = Globular(0.9999);
  stage.options.shared_paths = 0;
  const Estimate added = Added(&stage, kBefore, kBounces);
  const double flux = 4 * kPi * kIntensity, area = 4 * kPi * kRadius_mm * kRadius_mm;
  const double mirrored = stage.surface.coat->mean_reflectance();
  const auto expected = [&](double albedo) {
    double radiance = 0;
    for (int k = kBefore + 1; k <= kBounces; ++k) {
      radiance += std::pow(mirrored + (1 - mirrored) * albedo, k + 1) * flux / (kPi * area);
    }
    return radiance;
  };
  const double even = stage.surface.subsurface->EvenReflectance()[0];
  // Triangles lie 0.1% within the sphere.
  const double bound = kStandardErrors * added.standard_error + (0.003 + (1 - even) / 10) * expected(even);
  EXPECT_LT(std::abs(added.mean - expected(even)), bound);
  EXPECT_GT(std::abs(added.mean - expected(even - 0.03)), bound);
}

}  // namespace
}  // namespace lumen::test
