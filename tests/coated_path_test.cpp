// The path tracer on a wall with a coat of mucus.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/mesh.h"
#include "common/parallel.h"
#include "common/random.h"
#include "sim/imaging/path.h"
#include "tests/path_stage.h"
#include "tests/seed_means.h"

namespace lumen {
namespace {

constexpr double kRadius_mm = 20;
const Vec3d kEye(3, -2, 4);
const Vec3d kGuide(3, 0.5, -0.2);  // from the eye
constexpr double kSpread = 1.5;
constexpr double kIntensity = 500;

// A camera inside a coated sphere.
struct Stage {
  Mesh mesh = test::Globe(kRadius_mm, 100);
  RayScene wall{mesh};
  std::vector<Vec3d> normals = VertexNormals(mesh);
  Surface surface;
  CameraIntrinsics intrinsics;
  Light light;
  Pose world_from_camera = Pose::Identity();
  PathOptions options;
  std::optional<Defocus> defocus;

  Stage(int width, int height, double focal_px) {
    intrinsics.width = width;
    intrinsics.height = height;
    intrinsics.fx = intrinsics.fy = focal_px;
    intrinsics.cx = (width - 1) / 2.0;
    intrinsics.cy = (height - 1) / 2.0;
    light.sources.push_back({kGuide, Vec3d::UnitZ(), kSpread, Vec3d::Constant(kIntensity)});
    world_from_camera.translation() = kEye;
    options.samples = 1;
  }
  Film Render(bool with_parts = true, uint64_t seed = 1) const {
    const Camera<float> camera(intrinsics);
    const Image8 valid(intrinsics.width, intrinsics.height, 1, 255);
    Film film;
    const PathCount count =
        RenderFrame({&wall, &surface, 0, &normals},
                    {&camera, &valid, world_from_camera, &light, nullptr, defocus ? &*defocus : nullptr},
                    options, seed, 0, with_parts, &film);
    EXPECT_EQ(count.failure.count, 0);
    return film;
  }
};

Vec3d OnSphere(const Vec3d& from, const Vec3d& direction) {
  const double b = from.dot(direction);
  return from + (-b + std::sqrt(b * b + kRadius_mm * kRadius_mm - from.squaredNorm())) * direction;
}

CoatedPlace PlaceOnSphere(const Coat& coat, const Vec3d& point, const Vec3d& toward, const Vec3f& albedo) {
  const Vec3f normal = (-point / kRadius_mm).cast<float>();
  const Vec3f outgoing = (toward - point).normalized().cast<float>();
  return {normal, albedo, outgoing, normal, coat.Reflectance(normal.dot(outgoing))};
}

// What a place sends on of the guide's light.
CoatLobes DirectLobes(const Coat& coat, const CoatedPlace& place, const Vec3d& point) {
  const Vec3d to_guide = kEye + kGuide - point, toward = to_guide.normalized();
  const double fall = kIntensity * std::exp(-kSpread * (1 + toward.z())) / to_guide.squaredNorm();
  const CoatLobes lobes = coat.Eval(place, toward.cast<float>());
  return {float(fall) * lobes.base, float(fall) * lobes.glint};
}

// On the smooth sphere, triangles apart: some 1e-3 where the lobe is wide.
TEST(CoatedPath, DirectLightAndGlintAreTheLobes) {
  Stage stage(41, 31, 20);
  stage.surface.coat.emplace(CoatOptions{1.37, 0.6, 1, 0});
  const Film film = stage.Render();
  double base_error = 0, base_sum = 0, glint_error = 0, glint_sum = 0;
  for (int y = 0; y < 31; ++y) {
    for (int x = 0; x < 41; ++x) {
      const Vec3d ray = Vec3d((x - 20) / 20.0, (y - 15) / 20.0, 1).normalized();
      const Vec3d point = OnSphere(kEye, ray);
      const CoatedPlace place =
          PlaceOnSphere(*stage.surface.coat, point, kEye, stage.surface.albedo.cast<float>());
      const CoatLobes expected = DirectLobes(*stage.surface.coat, place, point);
      base_error += std::abs(film.direct.Pixel(x, y)[0] - expected.base[0]);
      glint_error += std::abs(film.glint.Pixel(x, y)[0] - expected.glint);
      base_sum += expected.base[0];
      glint_sum += expected.glint;
      EXPECT_EQ(film.glint.Pixel(x, y)[0], film.glint.Pixel(x, y)[2]);  // as colourless as the light
    }
  }
  EXPECT_LT(base_error, 0.02 * base_sum);
  EXPECT_LT(glint_error, 0.02 * glint_sum);
  EXPECT_GT(glint_sum, 0.02 * base_sum);
}

// The parts are rounded to float one by one.
TEST(CoatedPath, PartsAddUp) {
  Stage stage(24, 18, 12);
  stage.surface.coat.emplace(CoatOptions{});
  stage.options.samples = 4;
  stage.options.bounces = 3;
  const Film film = stage.Render(), whole = stage.Render(false);
  int with_glint = 0;
  for (size_t i = 0; i < film.radiance.data.size(); ++i) {
    const double sum = double(film.direct.data[i]) + film.indirect.data[i] + film.glint.data[i];
    EXPECT_NEAR(film.radiance.data[i], sum, 2e-7 * sum);
    with_glint += film.glint.data[i] > 0.01 * film.radiance.data[i];
  }
  EXPECT_GT(with_glint, 10);
  EXPECT_EQ(film.radiance.data, whole.radiance.data);
  EXPECT_TRUE(whole.glint.empty() && whole.direct.empty());
}

// One bounce against uniform directions at the first place, on the smooth sphere: Z-test of two independent
// estimates, with 0.5% for the triangles.
TEST(CoatedPath, BounceIsTheIntegralOverTheHemisphere) {
  Stage stage(1, 1, 1);
  stage.world_from_camera.linear() = Eigen::AngleAxisd(0.9, Vec3d::UnitY()).toRotationMatrix();
  stage.surface.coat.emplace(CoatOptions{2, 0.6, 1, 0});  // a strong coat
  stage.options.bounces = 1;
  const Coat& coat = *stage.surface.coat;
  const Vec3f albedo = stage.surface.albedo.cast<float>();
  const Vec3d first = OnSphere(kEye, stage.world_from_camera.linear().col(2));
  const CoatedPlace place = PlaceOnSphere(coat, first, kEye, albedo);
  const Vec3d axis = stage.world_from_camera.linear().col(2);
  const auto direct = [&](const CoatedPlace& at, const Vec3d& point) {
    const Vec3d to_guide = stage.world_from_camera * kGuide - point, toward = to_guide.normalized();
    const double fall = kIntensity * std::exp(-kSpread * (1 + toward.dot(axis))) / to_guide.squaredNorm();
    const CoatLobes lobes = coat.Eval(at, toward.cast<float>());
    return std::pair(fall * lobes.base[1], fall * (lobes.base[1] + lobes.glint));
  };
  const int count = 400000;
  double sum = 0, squares = 0, without_glints = 0;
  for (int i = 0; i < count; ++i) {
    const double z = 2 * UniformDouble(RandomBits(1, i, 0)) - 1,
                 turn = 2 * kPi * UniformDouble(RandomBits(1, i, 1));
    const double sine = std::sqrt(1 - z * z);
    Vec3d direction(sine * std::cos(turn), sine * std::sin(turn), z);
    if (direction.dot(first) > 0) direction = -direction;
    const Vec3d second = OnSphere(first, direction);
    const CoatLobes lobes = coat.Eval(place, direction.cast<float>());
    const auto [base, whole] = direct(PlaceOnSphere(coat, second, first, albedo), second);
    const double value = 2 * kPi * (lobes.base[1] + lobes.glint) * whole;
    sum += value / count;
    squares += value * value / count;
    without_glints += 2 * kPi * lobes.base[1] * base / count;
  }
  const double error = std::sqrt((squares - sum * sum) / count);
  stage.options.samples = 1 << 16;
  // The pixel is as narrow as a ray.
  stage.intrinsics.fx = stage.intrinsics.fy = 1e4;
  const double found = stage.Render().indirect.Pixel(0, 0)[1];
  // The tracer's samples vary no more than the uniform ones.
  EXPECT_NEAR(found, sum, 5 * error * std::sqrt(1 + double(count) / (1 << 16)) + 0.005 * sum);
  EXPECT_GT(std::abs(found - without_glints), 0.1 * sum);
}

// Indirect green light of a frame: its mean, the mean's standard error and the variance of a pixel, from two
// independent renders.
struct IndirectLight {
  double mean = 0, error = 0, variance = 0;
};

IndirectLight MeasureIndirect(const Stage& stage) {
  const Film a = stage.Render(true, 1), b = stage.Render(true, 2);
  IndirectLight light;
  const double count = double(a.indirect.data.size()) / 3;
  for (size_t i = 1; i < a.indirect.data.size(); i += 3) {
    light.mean += (a.indirect.data[i] + b.indirect.data[i]) / 2 / count;
    light.variance += std::pow(a.indirect.data[i] - b.indirect.data[i], 2) / 2 / count;
  }
  light.error = std::sqrt(light.variance / 2 / count);
  return light;
}

// The second moment of what a lobe throws about goes with its peak, 1/α²: a wider one after bounces takes the
// rare bright samples away. The light that there is stays, but for what single scattering in the wider lobe
// loses: 14% of the coat's share, itself under a tenth. Through an aperture, if hardly one: a pinhole's light
// that the coat throws about is traced from the guides, who find it whatever the lobe.
TEST(CoatedPath, WiderLobeAfterBouncesKeepsTheLight) {
  Stage stage(48, 36, 24);
  stage.defocus = Defocus{1e-6, 10};
  stage.options.bounces = 2;
  stage.options.samples = 32;
  const CoatOptions sharp{1.37, 0.2, 1, 0, std::nullopt}, wide{1.37, 0.5, 1, 0, std::nullopt};
  stage.surface.coat.emplace(sharp);
  const Film unbiased = stage.Render();
  stage.surface.bounced_coat.emplace(sharp);
  EXPECT_EQ(stage.Render().radiance.data, unbiased.radiance.data);
  const IndirectLight before = MeasureIndirect(stage);
  stage.surface.bounced_coat.emplace(wide);
  const Film smooth = stage.Render();
  EXPECT_EQ(smooth.direct.data, unbiased.direct.data);
  EXPECT_EQ(smooth.glint.data, unbiased.glint.data);
  const IndirectLight after = MeasureIndirect(stage);
  EXPECT_NEAR(after.mean, before.mean, 5 * std::hypot(before.error, after.error) + 0.02 * before.mean);
  // Two estimates of one variance from so many pixels differ by chance by √2·√(2/pixels), of which 5.
  const double by_chance = 5 * 2 / std::sqrt(48.0 * 36);
  EXPECT_LT(after.variance, (1 - by_chance) * before.variance);
  stage.surface.albedo.setConstant(0.1);  // little but glints
  const IndirectLight wide_glints = MeasureIndirect(stage);
  stage.surface.bounced_coat.reset();
  const IndirectLight glints = MeasureIndirect(stage);
  EXPECT_LT(wide_glints.variance, (1 - by_chance) * glints.variance);
}

// Shared paths take each pixel's light from directions that were chosen for other pixels; a path of its own
// has none to answer for. Means of 8 × 8 pixels over seeds, Welch's test, one false alarm in 1,000.
TEST(CoatedPath, SharedPathsAgreeWithOwnOnes) {
  Stage stage(32, 24, 16);
  stage.surface.coat.emplace(CoatOptions{1.37, 0.3, 1, 0.06});
  stage.options.bounces = 4;
  const auto measure = [&](int shared_paths, int samples, double albedo) {
    stage.options.shared_paths = shared_paths;
    stage.options.samples = samples;
    stage.surface.albedo = Vec3d(0.8, albedo, 0.3);
    test::SeedMeans blocks;
    for (int seed = 0; seed < 12; ++seed) {
      blocks.Add(test::BlockMeansOf(stage.Render(true, 40 + seed + 100 * shared_paths).indirect, 8));
    }
    return blocks;
  };
  const test::SeedMeans own = measure(0, 64, 0.5), shared = measure(16, 16, 0.5);
  EXPECT_EQ(test::CountOff(shared, own, 1e-3), 0);
  EXPECT_GT(test::CountOff(measure(16, 16, 0.53), own, 1e-3), 0);  // 6% more light between walls is noticed
}

// More samples of direct light leave the light between walls as it was, and have the direct light's mean.
TEST(CoatedPath, DirectLightMayHaveMoreSamples) {
  Stage stage(24, 18, 12);
  stage.surface.coat.emplace(CoatOptions{});
  stage.options.samples = 2;
  stage.options.bounces = 2;
  const Film few = stage.Render();
  stage.options.direct_oversampling = 8;
  const Film more = stage.Render();
  EXPECT_EQ(more.indirect.data, few.indirect.data);
  stage.options = {16, 0};
  const Film many = stage.Render();
  EXPECT_EQ(more.direct.data, many.direct.data);
  EXPECT_EQ(more.glint.data, many.glint.data);
}

// An index of refraction of 1 reflects nothing: the Lambertian wall's radiance, from the same random numbers.
// By paths of the pixels' own: shared ones are chosen otherwise under a coat.
TEST(CoatedPath, CoatOfAirIsNone) {
  Stage stage(16, 12, 8);
  stage.options.shared_paths = 0;
  stage.options.samples = 4;
  stage.options.bounces = 4;
  const Film bare = stage.Render();
  stage.surface.coat.emplace(CoatOptions{1, 0.3, 0.5, 0.05});
  const Film air = stage.Render();
  for (size_t i = 0; i < bare.radiance.data.size(); ++i) {
    EXPECT_NEAR(air.direct.data[i], bare.direct.data[i], 1e-5 * bare.direct.data[i]);
    EXPECT_NEAR(air.indirect.data[i], bare.indirect.data[i], 1e-4 * bare.indirect.data[i]);
    EXPECT_EQ(air.glint.data[i], 0);
  }
  EXPECT_TRUE(bare.glint.empty());
}

// The hardest view: a mirror lit from the camera itself, seen along its normal.
TEST(CoatedPath, MirrorLitFromTheCameraStaysFinite) {
  Stage stage(9, 9, 400);
  stage.light.sources[0].position = Vec3d::Zero();
  stage.world_from_camera.translation() = Vec3d(5, 0, 0);  // to +x, away from the mesh's poles
  stage.world_from_camera.linear() = Eigen::AngleAxisd(kPi / 2, Vec3d::UnitY()).toRotationMatrix();
  stage.surface.coat.emplace(CoatOptions{1.37, 0, 1, 0});
  stage.options.bounces = 4;
  stage.options.samples = 16;
  const Film film = stage.Render();
  float most = 0;
  for (const float value : film.radiance.data) {
    EXPECT_TRUE(std::isfinite(value));
    most = std::max(most, value);
  }
  EXPECT_GT(most, 10);
}

TEST(CoatedPath, SameBytesForAnyNumberOfThreads) {
  Stage stage(20, 20, 12);
  stage.surface.coat.emplace(CoatOptions{});
  stage.options.bounces = 3;
  SetThreadCount(1);
  const Film one = stage.Render();
  SetThreadCount(2);
  const Film two = stage.Render();
  SetThreadCount(0);
  EXPECT_EQ(one.radiance.data, two.radiance.data);
  EXPECT_EQ(one.glint.data, two.glint.data);
}

}  // namespace
}  // namespace lumen
