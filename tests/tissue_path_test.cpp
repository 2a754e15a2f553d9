// The path tracer on tissue in which light scatters below the surface.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/config.h"
#include "common/mesh.h"
#include "common/parallel.h"
#include "common/random.h"
#include "sim/imaging/path.h"
#include "tests/path_stage.h"
#include "tests/tissue_means.h"

namespace lumen {
namespace {

using test::AddSquare;
using test::kBound;
using test::Mean;
using test::MeanOf;

Mesh Plate(double thickness_mm = 0) {
  Mesh mesh;
  AddSquare(300, 0, true, &mesh);
  if (thickness_mm > 0) AddSquare(300, -thickness_mm, false, &mesh);
  return mesh;
}

// A camera 20 mm above a plate, looking down, or in a cavity.
struct Stage {
  Mesh mesh;
  RayScene wall{mesh};
  std::vector<Vec3d> normals = VertexNormals(mesh);
  Surface surface;
  CameraIntrinsics intrinsics;
  Light light;
  Pose world_from_camera = Pose::Identity();
  PathOptions options;

  explicit Stage(const Mesh& walls, int width = 32, int height = 24) : mesh(walls) {
    intrinsics.width = width;
    intrinsics.height = height;
    intrinsics.fx = intrinsics.fy = width;
    intrinsics.cx = (width - 1) / 2.0;
    intrinsics.cy = (height - 1) / 2.0;
    world_from_camera.linear() = Eigen::AngleAxisd(kPi, Vec3d::UnitX()).toRotationMatrix();
    world_from_camera.translation() = Vec3d(3, 2, 20);
    options.samples = 32;
    surface.subsurface.emplace(test::WithAlbedos({0.9, 0.6, 0.3}, {1, 2, 0.7}));
  }
  // So far off that its light comes to all places alike, irradiance 1 on a facing patch. In camera axes.
  void LightFrom(const Vec3d& direction) {
    light.sources = {{1e5 * direction, Vec3d::UnitZ(), 0, Vec3d::Constant(1e10)}};
  }
  Film Render(bool with_parts = true, uint64_t seed = 1) const {
    const Camera<float> camera(intrinsics);
    const Image8 valid(intrinsics.width, intrinsics.height, 1, 255);
    Film film;
    const PathCount count =
        RenderFrame({&wall, &surface, 0, &normals}, {&camera, &valid, world_from_camera, &light}, options,
                    seed, 0, with_parts, &film);
    EXPECT_EQ(count.failure.count, 0);
    return film;
  }
  // Of a channel, over the pixels, which are independent where they share no paths.
  Mean Radiance(int channel) const {
    const Film film = Render(false);
    std::vector<double> values;
    for (size_t i = channel; i < film.radiance.data.size(); i += 3) values.push_back(film.radiance.data[i]);
    return MeanOf(values);
  }
  // Share of the light that comes back to places alike all over the wall.
  Mean Returns(int channel, int count) const {
    std::vector<double> weights;
    int64_t rays = 0;
    for (int i = 0; i < count; ++i) {
      const SampleStream random(99, 1, uint64_t(i)), other(99, 2, uint64_t(i));
      const uint32_t face = uint32_t(RandomBits(5, uint64_t(i)) % mesh.faces.size());
      const Vec3i& corners = mesh.faces[face];
      const Vec3d middle =
          (mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3;
      if (FaceArea(mesh, int(face)) == 0) continue;
      const Vec3f normal = FaceNormal(mesh, int(face)).cast<float>();
      const Vec3f inward = lambert::Sample(-normal, Vec2f(other.Uniform(0), other.Uniform(1)));
      weights.push_back(
          surface.subsurface->Walk(wall, {face, wall.ToLocal(middle), normal, inward}, random, &rays)
              .weight[channel]);
    }
    return MeanOf(weights);
  }
};

void ExpectNear(double found, double error, double expected, double allowance) {
  EXPECT_LT(std::abs(found - expected), kBound * error + allowance)
      << found << " ± " << error << " against " << expected;
}
void ExpectNear(const Mean& found, double expected, double allowance = 0) {
  ExpectNear(found.value(), found.error(), expected, allowance);
}

// Lit evenly, an even wall of tissue looks like Lambert's with the albedo of the closed form, however its
// surface's albedo is called; a slanting light counts by its cosine.
TEST(TissuePath, EvenWallIsLambertian) {
  Stage stage(Plate());
  for (const double cosine : {1.0, 0.5}) {
    stage.LightFrom(Vec3d(std::sqrt(1 - cosine * cosine), 0, -cosine));
    for (const Vec3d& albedo : {Vec3d(0.8, 0.3, 0.2), Vec3d(0.4, 1, 0.9)}) {
      stage.surface.albedo = albedo;
      for (int c = 0; c < 3; ++c) {
        const double expected = cosine * stage.surface.subsurface->EvenReflectance()[c] / kPi;
        ExpectNear(stage.Radiance(c), expected, 1e-3 * expected);  // the light is 1e5 mm away
      }
    }
  }
}

// A fold lit from behind glows.
TEST(TissuePath, LightComesThroughAFold) {
  Stage stage(Plate(1));
  stage.LightFrom(Vec3d(0.6, 0, 0.8));
  std::vector<double> crossing;
  int64_t rays = 0;
  for (int i = 0; i < 20000; ++i) {
    const SampleStream random(99, 1, uint64_t(i)), other(99, 2, uint64_t(i));
    const Vec3f inward = lambert::Sample(-Vec3f::UnitZ(), Vec2f(other.Uniform(0), other.Uniform(1)));
    const WalkExit exit = stage.surface.subsurface->Walk(
        stage.wall, {0, stage.wall.ToLocal(Vec3d(1, -3, 0)), Vec3f::UnitZ(), inward}, random, &rays);
    crossing.push_back(exit.normal[2] < 0 && exit.found ? exit.weight[0] : 0);
  }
  const Mean through = MeanOf(crossing), found = stage.Radiance(0);
  EXPECT_GT(through.value(), 0.1);
  ExpectNear(found.value(), std::hypot(found.error(), 0.8 / kPi * through.error()),
             0.8 / kPi * through.value(), 1e-4);
  stage.surface.subsurface.reset();
  EXPECT_EQ(stage.Radiance(0).value(), 0);
}

// In a sphere of tissue light is spread evenly by every bounce, as in a Lambertian one: what bounce k adds to
// the irradiance is ρᵏ Φ/A, with ρ what comes back of a walk and Φ the guide's light. Walks at every bounce,
// with each pixel's own paths and with shared ones.
TEST(TissuePath, IntegratingSphere) {
  constexpr double kRadius_mm = 6;
  constexpr int kBounces = 4, kFrames = 12;
  Stage stage(test::Globe(kRadius_mm, 40), 16, 16);
  stage.world_from_camera.translation() = Vec3d(0.5, -0.3, 1);
  stage.surface.subsurface.emplace(test::WithAlbedos({0.95, 0.9, 0.5}, {1.5, 1, 2}));
  stage.light.sources = {{Vec3d(0.5, 1, 0), Vec3d::UnitZ(), 0, Vec3d::Constant(100)}};
  stage.options.samples = 8;
  const double flux = 4 * kPi * 100, area = 4 * kPi * kRadius_mm * kRadius_mm;
  for (const int shared_paths : {0, 16}) {
    stage.options.shared_paths = shared_paths;
    // What bounces add, by frames of seeds of their own: their pixels may share paths. The first walks are
    // the same without them.
    std::vector<double> added[3];
    for (uint64_t seed = 1; seed <= kFrames; ++seed) {
      stage.options.bounces = kBounces;
      const Film with = stage.Render(false, seed);
      stage.options.bounces = 0;
      const Film without = stage.Render(false, seed);
      Vec3d sum = Vec3d::Zero();
      for (size_t i = 0; i < with.radiance.data.size(); ++i) {
        sum[i % 3] += 3 * (double(with.radiance.data[i]) - without.radiance.data[i]) /
                      double(with.radiance.data.size());
      }
      for (int c = 0; c < 3; ++c) added[c].push_back(sum[c]);
    }
    for (int c = 0; c < 3; ++c) {
      const Mean back = stage.Returns(c, 10000);
      double expected = 0, slope = 0;
      for (int k = 1; k <= kBounces; ++k) {
        expected += std::pow(back.value(), k + 1) * flux / area / kPi;
        slope += (k + 1) * std::pow(back.value(), k) * flux / area / kPi;
      }
      const Mean found = MeanOf(added[c]);
      // So few frames tell their own scatter to a fifth; triangles lie 0.1% within the sphere.
      ExpectNear(found.value(), 1.3 * std::hypot(found.error(), slope * back.error()), expected,
                 3e-3 * expected);
    }
  }
}

Stage Coated() {
  Stage stage(test::Globe(15, 40), 24, 16);
  stage.world_from_camera.translation() = Vec3d(1, -2, 3);
  stage.light.sources = {{Vec3d(2, 1, 0), Vec3d::UnitZ(), 1, Vec3d::Constant(500)}};
  stage.surface.coat.emplace(CoatOptions{});
  stage.surface.mottling.emplace();
  stage.surface.vessels.emplace(VesselOptions{}, stage.mesh, 1);
  stage.options.samples = 4;
  stage.options.bounces = 2;
  return stage;
}

TEST(TissuePath, PartsAddUp) {
  const Stage stage = Coated();
  const Film film = stage.Render(), whole = stage.Render(false);
  int scattered = 0, mirrored = 0, glinting = 0;
  for (size_t i = 0; i < film.radiance.data.size(); ++i) {
    const double sum = double(film.subsurface.data[i]) + film.indirect.data[i] + film.glint.data[i];
    EXPECT_EQ(film.direct.data[i], 0);  // nothing is scattered on the spot
    EXPECT_NEAR(film.radiance.data[i], sum, 3e-7 * sum);
    scattered += film.subsurface.data[i] > 0;
    mirrored += film.indirect.data[i] > 0;
    glinting += film.glint.data[i] > 0.01 * sum;
  }
  EXPECT_GT(scattered, 1000);
  EXPECT_GT(mirrored, 10);
  EXPECT_GT(glinting, 10);
  EXPECT_EQ(film.radiance.data, whole.radiance.data);
  EXPECT_TRUE(whole.subsurface.empty());
}

// Tissue leaves glints as they are: their random numbers, their coat, their shadows.
TEST(TissuePath, GlintsStayAsTheyWere) {
  Stage stage = Coated();
  stage.options.bounces = 0;
  const Film tissue = stage.Render();
  stage.surface.subsurface.reset();
  const Film lambertian = stage.Render();
  EXPECT_EQ(tissue.glint.data, lambertian.glint.data);
  EXPECT_NE(tissue.radiance.data, lambertian.radiance.data);
  EXPECT_TRUE(lambertian.subsurface.empty());
}

// A texture wide against the walks shows as on Lambert's wall, relative to its palest place; nothing is
// brighter than the tissue alone.
TEST(TissuePath, TextureDimsTheTissue) {
  Stage stage(Plate(), 48, 32);
  stage.LightFrom(Vec3d(0, 0, -1));
  stage.options.samples = 64;
  stage.surface.mottling.emplace(Mottling{0.6, 200});
  const Film textured = stage.Render(false);
  Surface bare = stage.surface;
  bare.subsurface.reset();
  std::swap(bare, stage.surface);
  const Film lambertian = stage.Render(false);
  std::swap(bare, stage.surface);
  const double even = stage.surface.subsurface->EvenReflectance()[0] / kPi;
  const double palest = PalestAlbedo(stage.surface)[0] / kPi;
  std::vector<double> surplus;
  double expected = 0;
  for (size_t i = 0; i < textured.radiance.data.size(); i += 3) {
    const double texture = lambertian.radiance.data[i] / palest;
    EXPECT_LE(texture, 1);
    surplus.push_back(textured.radiance.data[i] - even * texture);
    expected += even * texture;
  }
  expected /= double(surplus.size());
  ExpectNear(MeanOf(surplus), 0, 0.003 * expected);
  EXPECT_LT(expected, 0.95 * even);

  stage.surface.mottling.reset();
  stage.surface.albedo = Vec3d(0.5, 0, 0.5);  // a wall that is black in a channel stays black there
  const Film black = stage.Render(false);
  for (size_t i = 0; i < black.radiance.data.size(); i += 3) {
    EXPECT_EQ(black.radiance.data[i + 1], 0);
    EXPECT_GT(black.radiance.data[i], 0);
  }
}

TEST(TissuePath, SceneNamesIt) {
  const auto read = [](const char* text) {
    return ReadSurface(Config::Parse(text, "scene.toml").root(), {}, 0);
  };
  EXPECT_FALSE(read("").subsurface);
  const Surface defaults = read("[subsurface]"), other = read("[subsurface]\nabsorption_per_mm = [0, 0, 0]");
  EXPECT_LT(defaults.subsurface->EvenReflectance().maxCoeff(), 0.3);
  EXPECT_GT(other.subsurface->EvenReflectance().minCoeff(), 0.99);
}

TEST(TissuePath, AnyNumberOfThreadsGivesTheSameBytes) {
  for (const bool coated : {false, true}) {
    Stage stage = Coated();
    if (!coated) stage.surface.coat.reset();
    SetThreadCount(1);
    const Film one = stage.Render();
    SetThreadCount(5);
    const Film five = stage.Render();
    SetThreadCount(0);
    EXPECT_EQ(one.radiance.data, five.radiance.data);
    EXPECT_EQ(one.subsurface.data, five.subsurface.data);
  }
}

}  // namespace
}  // namespace lumen
