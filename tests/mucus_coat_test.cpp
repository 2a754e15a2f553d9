// The reconstructor's coat of mucus: its limits, its energy, and its derivatives.
#include "recon/surface/mucus_coat.h"

#include <gtest/gtest.h>

#include <cmath>

#include "recon/surface/shading.h"
#include "sim/imaging/coat.h"
#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::Difference;
using test::Random;

// A camera and a guide that is far enough away to lie in one direction; its irradiance at the origin, facing
// it, is 1.
FrameLight<double> FromFar(const Vec3d& to_camera, const Vec3d& to_light) {
  constexpr double kFar_mm = 1e6;
  FrameLight<double> light;
  light.camera = 50 * to_camera;
  light.sources.push_back({kFar_mm * to_light, -to_light, 0, Vec3d::Constant(kFar_mm * kFar_mm)});
  return light;
}

Vec3d At(double angle, double turn = 0) {
  return {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)};
}

constexpr double kBlack = -1e4;  // an output whose albedo is 0: glints alone

double BrdfTimesCosine(const MucusCoat<double>& coat, const Vec3d& to_camera, const Vec3d& to_light,
                       double output = kBlack) {
  ByCoat<double> unused;
  return ShadeCoated<double>(coat, Vec3d::Constant(output), Vec3d::UnitZ(), FromFar(to_camera, to_light),
                             Vec3d::Zero(), Vec3d::Zero(), &unused)
      .radiance[0];
}

// Written apart from it: D and the masking of one side each as in Walter et al. 2007, joined by height as in
// Heitz 2014, and the simulator's exact Fresnel, from which Schlick's approximation differs by .0085 at the
// most at 1.33 up to 60°.
TEST(MucusCoat, IsTheSimulatorsMicrosurface) {
  const double ior = 1.33;
  for (double roughness : {0.2, 0.5, 1.0}) {
    const double alpha = roughness * roughness;
    const auto tail = [&](double cosine) {  // Λ
      const double tan_squared = 1 / (cosine * cosine) - 1;
      return (std::sqrt(1 + alpha * alpha * tan_squared) - 1) / 2;
    };
    for (double view : {0.0, 0.4, 1.1}) {
      for (double incoming : {0.1, 0.5, 1.2}) {
        for (double turn : {0.0, 0.3, 2.0}) {
          const Vec3d o = At(view), i = At(incoming, turn), h = (o + i).normalized();
          if (std::acos(h.dot(i)) > kPi / 3) continue;
          const double slope = std::tan(std::acos(h.z())) / alpha;
          const double d = 1 / (kPi * alpha * alpha * std::pow(h.z(), 4) * std::pow(1 + slope * slope, 2));
          const double shape = d / (1 + tail(o.z()) + tail(i.z())) / (4 * o.z());
          const double fresnel = FresnelDielectric(static_cast<float>(ior), static_cast<float>(h.dot(i)));
          EXPECT_NEAR(BrdfTimesCosine({1, roughness, ior}, o, i), fresnel * shape, 0.0085 * shape)
              << roughness << " " << view << " " << incoming << " " << turn;
        }
      }
    }
  }
}

// Light goes either way alike, and never does more come back than there was: not even from an index at which
// nearly all is reflected, whose narrow lobe sends back nearly all, nor from a white wall below a coat.
TEST(MucusCoat, IsReciprocalAndKeepsEnergy) {
  struct Case {
    MucusCoat<double> coat;
    double output;
  };
  for (const auto& [coat, output] : {Case{{1, 0.3, 1e4}, kBlack}, Case{{1, 1, 1e4}, kBlack},
                                     Case{{1, 0.3, 1.33}, 0}, Case{{0.5, 0.6, 1.5}, 0}}) {
    for (double view : {0.0, 0.7, 1.3}) {
      const Vec3d o = At(view), i = At(0.5, 1.1);
      const double forth = BrdfTimesCosine(coat, o, i, output) / i.z();
      EXPECT_NEAR(forth, BrdfTimesCosine(coat, i, o, output) / o.z(), 1e-9 * forth);
      double sum = 0;
      constexpr int kSteps = 200;
      for (int a = 0; a < kSteps; ++a) {
        const double angle = (a + 0.5) * kPi / 2 / kSteps;
        for (int b = 0; b < kSteps; ++b) {
          const double turn = (b + 0.5) * 2 * kPi / kSteps;
          sum += BrdfTimesCosine(coat, o, At(angle, turn), output) * std::sin(angle);
        }
      }
      sum *= kPi / 2 / kSteps * 2 * kPi / kSteps;
      EXPECT_LT(sum, 1.001) << coat.roughness << " " << view;
      if (coat.roughness == 0.3 && view < 1) {
        EXPECT_GT(sum, 0.85) << coat.ior << " " << view;
      }
    }
  }
}

// The loss takes no derivative by the place: samples stay where they are.
TEST(MucusCoat, DerivativesMatchFiniteDifferences) {
  FrameLight<double> light;
  light.camera = Vec3d(0.2, -0.1, 0.3);
  light.sources.push_back({Vec3d(3, 0.5, 0), Vec3d(0, 0, 1), 2.7, Vec3d(900, 800, 700)});
  light.sources.push_back({Vec3d(-2, 2, 1), Vec3d(0.1, 0, 1).normalized(), 1.1, Vec3d(300, 500, 400)});
  uint64_t state = 3;
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3d point(6 * Random(state), 6 * Random(state), 20);
    Vec3d normal = (Vec3d(Random(state), Random(state), 0) - Vec3d(0.2, -0.3, 1.5)).normalized();
    Vec3d output(-0.5, -1, 0.2), ambient(0.3, 0.2, 0.1);
    MucusCoat<double> coat{0.7 + 0.3 * Random(state), 0.6 + 0.3 * Random(state), 1.4 + 0.2 * Random(state)};
    ByCoat<double> by_coat, unused;
    const auto shade = [&](ByCoat<double>* by) {
      return ShadeCoated(coat, output, normal, light, point, ambient, by);
    };
    const Shading<double> shading = shade(&by_coat);
    for (int c = 0; c < 3; ++c) {
      const auto radiance = [&] { return shade(&unused).radiance[c]; };
      for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(shading.by_normal(c, d), Difference(radiance, &normal[d]), 1e-7) << trial;
      EXPECT_NEAR(shading.by_output[c], Difference(radiance, &output[c]), 1e-8) << trial;
      EXPECT_NEAR(shading.ambient[c], ambient[c] * Difference(radiance, &ambient[c]), 1e-9) << trial;
      EXPECT_NEAR(by_coat.weight[c], Difference(radiance, &coat.weight), 1e-8) << trial;
      EXPECT_NEAR(by_coat.roughness[c], Difference(radiance, &coat.roughness), 1e-7) << trial;
      EXPECT_NEAR(by_coat.ior[c], Difference(radiance, &coat.ior), 1e-8) << trial;
    }
  }
}

// A guide's glint lies where normal and half vector agree: of three guides off the axis each has its own.
TEST(MucusCoat, EveryGuideHasItsOwnHalfVector) {
  FrameLight<double> light;
  light.camera = Vec3d::Zero();
  const Vec3d point(0, 0, 10);
  for (double x : {-4.0, 4.0}) light.sources.push_back({Vec3d(x, 0, 0), Vec3d::UnitZ(), 0, Vec3d::Ones()});
  const auto shines = [&](double tilt) {
    ByCoat<double> unused;
    return ShadeCoated<double>({1, 0.25, 1.33}, Vec3d::Constant(kBlack),
                               Vec3d(std::sin(tilt), 0, -std::cos(tilt)), light, point, Vec3d::Zero(),
                               &unused)
        .radiance[0];
  };
  const double half = std::atan(0.4) / 2;
  EXPECT_GT(shines(half), 3 * shines(0));
  EXPECT_NEAR(shines(half), shines(-half), 1e-12);
}

// Without weight exactly the diffuse wall, in float too; nor are there glints with the camera or all guides
// behind the wall.
TEST(MucusCoat, IsTheDiffuseWallWhereItDoesNothing) {
  const Vec3f point = Vec3f::Zero(), ambient(0.1f, 0.2f, 0.3f);
  struct Look {
    Vec3f radiance, diffuse;
    bool same;
  };
  const auto look = [&](float weight, const Vec3f& camera, const Vec3f& source, const Vec3f& output) {
    FrameLight<float> light;
    light.camera = camera;
    light.sources.push_back({source, Vec3f(0, 0, -1), 2.0f, Vec3f::Constant(100)});
    ByCoat<float> unused;
    const auto coated =
        ShadeCoated<float>({weight, 0.5f, 1.33f}, output, Vec3f::UnitZ(), light, point, ambient, &unused);
    const auto bare = Shade<float>(Reflectance::kLambertian, output, Vec3f::UnitZ(), light, point, ambient);
    return Look{coated.radiance, bare.radiance,
                coated.radiance == bare.radiance && coated.by_output == bare.by_output &&
                    coated.by_normal == bare.by_normal && coated.ambient == bare.ambient};
  };
  const Vec3f camera(1, 0, 9), source(2, 0, 9), output(-1, -0.5f, -2);
  EXPECT_TRUE(look(0, camera, source, output).same);
  EXPECT_FALSE(look(0.5f, camera, source, output).same);
  const Vec3f black = Vec3f::Constant(static_cast<float>(kBlack));
  EXPECT_EQ(look(1, Vec3f(1, 0, -9), source, black).radiance, Vec3f::Zero());
  EXPECT_EQ(look(1, camera, Vec3f(2, 0, -9), black).radiance, Vec3f::Zero());
  EXPECT_EQ(look(1, point, source, black).radiance, Vec3f::Zero());  // the camera on the wall
  EXPECT_EQ(look(1, camera, point, black).radiance, Vec3f::Zero());  // the guide
  EXPECT_GT(look(1, camera, source, black).radiance[0], 0);
}

// Float against double over what training can come to. The half vector's angle to the normal is off by some 8
// roundings; the slope of the lobe's logarithm is at most 2/α. A cosine, as far from 0 as counts here, is off
// by 8/0.05.
TEST(MucusCoat, FloatIsDoubleToRounding) {
  uint64_t state = 8;
  for (int trial = 0; trial < 1000000; ++trial) {
    FrameLight<float> light;
    light.camera = Vec3f(0.1f, 0.2f, 0);
    FrameLight<double> wide;
    wide.camera = light.camera.cast<double>();
    for (int i = 0; i < 3; ++i) {
      const Vec3f place(static_cast<float>(3 * Random(state)), static_cast<float>(3 * Random(state)), 0);
      light.sources.push_back({place, Vec3f::UnitZ(), 2.7f, Vec3f::Ones()});
      wide.sources.push_back({place.cast<double>(), Vec3d::UnitZ(), double(2.7f), Vec3d::Ones()});
    }
    const double far = 5 + 40 * std::abs(Random(state));
    const Vec3f point = (far * Vec3d(Random(state), Random(state), 1)).cast<float>();
    const Vec3f normal = Vec3d(Random(state), Random(state), -0.8).normalized().cast<float>();
    double least = 1;
    for (const auto& source : light.sources)
      least = std::min(least, std::abs(double(normal.dot((source.position - point).normalized()))));
    if (least < 0.05) continue;
    const MucusCoat<float> coat{1.0f, static_cast<float>(0.575 + 0.425 * Random(state)), 1.33f};
    const Vec3f output = Vec3f::Constant(trial % 2 == 0 ? -1.0f : static_cast<float>(kBlack));
    ByCoat<float> by;
    ByCoat<double> unused;
    const Shading<float> found = ShadeCoated<float>(coat, output, normal, light, point, Vec3f::Zero(), &by);
    const Shading<double> expected =
        ShadeCoated<double>({coat.weight, coat.roughness, coat.ior}, output.cast<double>(),
                            normal.cast<double>(), wide, point.cast<double>(), Vec3d::Zero(), &unused);
    ASSERT_TRUE(found.radiance.allFinite() && found.by_normal.allFinite() && by.roughness.allFinite());
    const double alpha = double(coat.roughness) * coat.roughness;
    const double error = 1.2e-7 * (8 * 2 / alpha + 60 + 8 / 0.05);
    ASSERT_NEAR(found.radiance[0], expected.radiance[0], error * std::abs(expected.radiance[0]) + 1e-12)
        << trial;
  }
}

TEST(MucusCoat, LearntNumbersKeepTheirBoundsAndHaveTheirSlopes) {
  for (bool learn_ior : {false, true}) {
    const MucusCoatOptions options{1.37, learn_ior};
    const int count = CoatParameters(options);
    double numbers[3] = {}, gradient[3] = {};
    InitialiseCoat(options, numbers);
    const MucusCoat<double> start = LearntCoat(options, numbers);
    EXPECT_NEAR(start.weight, 0.5, 1e-12);
    EXPECT_NEAR(start.roughness, 0.5, 1e-12);
    EXPECT_NEAR(start.ior, 1.37, 1e-12);
    const MucusCoat<double> delta{0.3, -0.7, 1.9};
    LearntCoatBackward(options, numbers, delta, gradient);
    for (int i = 0; i < count; ++i) {
      const auto value = [&] {
        const MucusCoat<double> lobe = LearntCoat(options, numbers);
        return delta.weight * lobe.weight + delta.roughness * lobe.roughness + delta.ior * lobe.ior;
      };
      EXPECT_NEAR(gradient[i], Difference(value, &numbers[i]), 1e-9);
    }
    for (double extreme : {-1e4, 1e4}) {
      for (double& number : numbers) number = extreme;
      const MucusCoat<double> lobe = LearntCoat(options, numbers);
      EXPECT_EQ(lobe.weight, extreme < 0 ? 0 : 1);
      EXPECT_EQ(lobe.roughness, extreme < 0 ? 0.15 : 1);
      if (learn_ior) {
        EXPECT_EQ(lobe.ior, extreme < 0 ? 1 : 2);
      }
    }
  }
}

}  // namespace
}  // namespace lumen
