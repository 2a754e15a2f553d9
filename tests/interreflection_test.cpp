// Light from wall to wall against closed forms: the tube, the integrating sphere, reciprocity.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/path_stage.h"

namespace lumen {
namespace {

using test::CentredPinhole;
using test::Estimate;
using test::EstimateOf;
using test::MeanOver;
using test::Stage;

const ImageF& Direct(const Film& film) { return film.direct; }
const ImageF& Indirect(const Film& film) { return film.indirect; }

// A tube about z, radius 25 mm, lit from its axis at z = 0: what its wall gets, by z alone.
class TubeByQuadrature {
 public:
  static constexpr double kRadius_mm = 25, kHalfLength_mm = 400, kStep_mm = 0.5;
  static constexpr int kNodes = 1601;

  explicit TubeByQuadrature(double spread) : direct_(kNodes), kernel_(kNodes) {
    for (int i = 0; i < kNodes; ++i) {
      const double z = i * kStep_mm - kHalfLength_mm, d = std::hypot(z, kRadius_mm);
      direct_[i] = std::exp(-spread * (1 - z / d)) / (d * d) * kRadius_mm / d;
      // What a ring of unit width sends to a place at a distance along the tube: the density of form factors
      // between rings of a cylinder (Buckley 1927; Howell, "A catalog of radiation heat transfer
      // configuration factors", C-79 differentiated).
      const double x = i * kStep_mm / (2 * kRadius_mm);
      kernel_[i] = (1 - x * (2 * x * x + 3) / (2 * std::pow(x * x + 1, 1.5))) / (2 * kRadius_mm);
    }
  }

  // Interreflected over direct radiance of `bounces` bounces, where a ray at this angle to the axis ends.
  double Ratio(double albedo, int bounces, double angle_rad) const {
    const int at =
        static_cast<int>(std::lround((kRadius_mm / std::tan(angle_rad) + kHalfLength_mm) / kStep_mm));
    std::vector<double> arriving = direct_;
    double sum = 0, share = 1;
    for (int bounce = 0; bounce < bounces; ++bounce) {
      arriving = Bounced(arriving);
      share *= albedo;
      sum += share * arriving[at];
    }
    return sum / direct_[at];
  }
  // All that leaves a ring in the middle of a long tube meets it again: the kernel's integral is 1.
  double KernelSum() const {
    double sum = kernel_[0];
    for (int i = 1; i <= kNodes / 2; ++i) sum += 2 * kernel_[i];
    return sum * kStep_mm;
  }

 private:
  std::vector<double> Bounced(const std::vector<double>& leaving) const {
    std::vector<double> arriving(kNodes, 0);
    for (int i = 0; i < kNodes; ++i) {
      for (int j = 0; j < kNodes; ++j) arriving[i] += kernel_[std::abs(i - j)] * leaving[j] * kStep_mm;
    }
    return arriving;
  }
  std::vector<double> direct_, kernel_;
};

// Angles whose rays end on a node of the quadrature.
double AngleTo(double z_mm) { return std::atan2(TubeByQuadrature::kRadius_mm, z_mm); }

// At 9.9°, 45° and 75° from the axis. One wall in 400 sides: within (π/400)² = 6e-5 of round. The ratio
// bends over the window of ± 0.15° by less than 1e-4.
void ExpectTube(double spread, double albedo, int bounces) {
  const TubeByQuadrature tube(spread);
  Stage stage(test::Tube(tube.kRadius_mm, tube.kHalfLength_mm, 200, 400), CentredPinhole(8, 8, 1500));
  stage.light.sources[0].spread = spread;
  stage.surface.albedo = Vec3d::Constant(albedo);
  stage.options.samples = 64;
  stage.options.bounces = bounces;
  for (const double z : {143.0, 25.0, 6.5}) {
    stage.world_from_camera.linear() =
        (Eigen::AngleAxisd(0.377, Vec3d::UnitZ()) * Eigen::AngleAxisd(AngleTo(z), Vec3d::UnitY()))
            .toRotationMatrix();
    stage.light.sources[0].direction = stage.world_from_camera.linear().transpose() * Vec3d::UnitZ();
    const Estimate indirect = MeanOver(stage, 24, Indirect), direct = MeanOver(stage, 2, Direct);
    const double found = indirect.mean / direct.mean, error = indirect.standard_error / direct.mean;
    const double expected = tube.Ratio(albedo, bounces, AngleTo(z));
    EXPECT_NEAR(found, expected, 5 * error + 1e-3 * expected) << albedo << ' ' << z;
    EXPECT_LT(error, 0.02 * expected);  // an interval that could not fail proves nothing
  }
}

TEST(Interreflection, TubesFirstBounceIsTheQuadratures) {
  EXPECT_NEAR(TubeByQuadrature(0).KernelSum(), 1, 1e-3);
  for (const double albedo : {0.3, 0.5, 0.7}) ExpectTube(2.77, albedo, 1);
  ExpectTube(0, 0.5, 1);
}

TEST(Interreflection, TubesLaterBouncesAreTheQuadratures) { ExpectTube(2.77, 0.7, 6); }

// In a closed Lambertian sphere all bounces together add Φ/(4πR²)·ρ/(1 − ρ) to the irradiance of every
// place, wherever the light is. Only Russian roulette ends a path here.
void ExpectSphere(double albedo, int samples, double error_bound) {
  constexpr double kRadius_mm = 20, kIntensity = 500;
  Stage stage(test::Globe(kRadius_mm, 90), CentredPinhole(16, 12, 8), kIntensity);
  stage.surface.albedo = Vec3d::Constant(albedo);
  stage.world_from_camera =
      Eigen::Translation3d(4, -6, 3) * Eigen::AngleAxisd(0.4, Vec3d(1, 2, 0.5).normalized());
  stage.options = PathOptions();
  stage.options.samples = samples;
  stage.options.bounces = 10000;
  const double irradiance =
      kIntensity / (kRadius_mm * kRadius_mm) * albedo / (1 - albedo);  // Φ = 4π · intensity
  const double expected = albedo / kPi * irradiance;
  const Estimate found = MeanOver(stage, 16, Indirect);
  // The inscribed polyhedron's area is smaller by less than (π/90)² = 0.12%.
  EXPECT_NEAR(found.mean, expected, 5 * found.standard_error + 1.2e-3 * expected) << albedo;
  EXPECT_LT(found.standard_error, error_bound * expected) << albedo;
}

TEST(Interreflection, IntegratingSphereUpToNearlyWhite) {
  ExpectSphere(0.1, 8, 0.01);
  ExpectSphere(0.5, 8, 0.01);
  ExpectSphere(0.9, 8, 0.02);
  ExpectSphere(0.99, 4, 0.03);
  ExpectSphere(0.999, 1, 0.05);
}

// What arrives at `here` from all sides of an isotropic light at `there`, by way of the wall: six pinholes.
double Fluence(Stage* stage, const Vec3d& here, const Vec3d& there, uint64_t seed) {
  double sum = 0;
  const int side = stage->intrinsics.width;
  for (int face = 0; face < 6; ++face) {
    const Vec3d axis = (face % 2 ? -1.0 : 1.0) * Vec3d::Unit(face / 2);
    stage->world_from_camera =
        Eigen::Translation3d(here) * Eigen::Quaterniond::FromTwoVectors(Vec3d::UnitZ(), axis);
    stage->light.sources[0].position = stage->world_from_camera.inverse() * there;
    const Film film = stage->Render(seed * 6 + face);
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const double u = (x + 0.5) * 2 / side - 1, v = (y + 0.5) * 2 / side - 1;
        sum += film.radiance.Pixel(x, y)[0] * 4 / (side * side) / std::pow(1 + u * u + v * v, 1.5);
      }
    }
  }
  return sum;
}

// Light and eye changed places: the same fluence, where every lobe is reciprocal (Helmholtz). The room has no
// symmetry that would do it without that.
void ExpectReciprocal(const std::function<void(Stage*)>& change) {
  // A closed bag, wider at one end.
  const auto bag = [](double along, double turn) {
    const double polar = kPi * along, radius = 12 - 5 * std::cos(polar);
    return Vec3d(radius * std::sin(polar) * std::cos(turn), 0.7 * radius * std::sin(polar) * std::sin(turn),
                 -18 * std::cos(polar));
  };
  constexpr int kSide = 24;
  Stage stage(test::Lathe(60, 80, bag), CentredPinhole(kSide, kSide, kSide / 2.0));
  stage.surface.albedo = Vec3d::Constant(0.6);
  stage.options.samples = 4;
  stage.options.bounces = 3;
  change(&stage);
  const Vec3d a(5, -2, 7), b(-1, 1.5, -11);
  std::vector<double> forth, back;
  for (uint64_t seed = 0; seed < 12; ++seed) {
    forth.push_back(Fluence(&stage, a, b, seed));
    back.push_back(Fluence(&stage, b, a, 100 + seed));
  }
  const Estimate there = EstimateOf(forth), here = EstimateOf(back);
  const double error = std::hypot(there.standard_error, here.standard_error);
  // A pixel's solid angle is its middle's: off by 1/side² at most.
  EXPECT_NEAR(there.mean, here.mean, 5 * error + 0.002 * there.mean);
  EXPECT_LT(error, 0.01 * there.mean);
}

TEST(Interreflection, LightAndEyeMayChangePlaces) {
  ExpectReciprocal([](Stage*) {});
  ExpectReciprocal([](Stage* stage) {
    stage->surface.coat.emplace(CoatOptions{2, 0.7, 1, 0, std::nullopt});
  });
}

}  // namespace
}  // namespace lumen
