// The path tracer against the plain one, which shares neither packets nor its paths with it, and computes
// places and light in double: direct light pixel by pixel, light between walls by Welch's test.
#include "sim/imaging/reference_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "sim/ground_truth.h"
#include "tests/path_stage.h"
#include "tests/seed_means.h"
#include "tests/support.h"
#include "tests/tissue_means.h"

namespace lumen::test {
namespace {

// A plate that throws shadows, in a tube or a sphere of 18 mm; three guides off the axis.
Stage StageIn(Mesh mesh) {
  AddPlate(&mesh, -4.3, 1.7, -3.1, 2.9, 9.1);
  CameraIntrinsics intrinsics = CentredPinhole(48, 40, 22);
  intrinsics.cx -= 0.27;  // no ray along an edge on purpose
  intrinsics.cy += 0.39;
  Stage stage(std::move(mesh), intrinsics);
  stage.light.sources.clear();
  for (const Vec3d& position : {Vec3d(3.24, 0.55, 0), Vec3d(-2.77, 2.66, 0), Vec3d(-1.27, -3.14, 0)}) {
    stage.light.sources.push_back({position, Vec3d(0.1, -0.2, 1).normalized(), 1.3, Vec3d(300, 400, 500)});
  }
  stage.world_from_camera =
      Eigen::Translation3d(2.1, -1.3, -3.7) * Eigen::AngleAxisd(0.21, Vec3d(1, 2, 0.5).normalized());
  return stage;
}

View ViewOf(const Stage& stage, const Camera<float>& camera) {
  return {&camera, &stage.valid, stage.world_from_camera, &stage.light};
}

template <class T>
ImageF Plain(const Stage& stage, uint64_t seed) {
  const Camera<float> camera(stage.intrinsics);
  return RenderReference<T>({&stage.wall, &stage.surface, 0, &stage.vertex_normals}, ViewOf(stage, camera),
                            stage.options, seed, 0);
}

ImageF Fast(const Stage& stage, uint64_t seed) { return stage.Render(seed).radiance; }

// How far direct light in float may be off, per channel. kRoundings rounded operations at most, each by u of
// what it works on, lie between a pixel and the place that it sees, and as many between that and its light.
// So the place is off by kRoundings · u · reach / c along the wall, reach being the largest length on the way
// to it and c the cosine of the camera's ray; and light that goes with cos · exp(−spread (1 − D·L)) / d²
// changes by (2 + spread) cos + 1 parts of exp / d² where the place moves by d.
Vec3d DirectBound(const Stage& stage, const Vec3d& place, const Vec3d& normal) {
  constexpr double kRoundings = 32, u = 0x1p-24;
  const double reach =
      place.norm() + stage.world_from_camera.translation().norm() + stage.mesh.vertices[0].norm();
  const double shift = kRoundings * u * reach / std::abs(place.normalized().dot(normal));
  Vec3d bound = Vec3d::Zero();
  for (const LightSource& source : stage.light.sources) {
    const double d = (place - source.position).norm();
    const Vec3d L = (place - source.position) / d;
    const double cosine = std::abs(L.dot(normal));
    const double fall = std::exp(-source.spread * (1 - source.direction.dot(L))) / (d * d);
    bound += fall / kPi * (((2 + source.spread) * cosine + 1) * shift / d + kRoundings * u) *
             stage.surface.albedo.cwiseProduct(source.intensity);
  }
  return bound;
}

int PixelsOff(const Stage& stage, const ImageF& found, const ImageF& expected) {
  const FrameTruth truth = ComputeTruth(stage.wall, Camera<double>(stage.intrinsics), stage.valid,
                                        stage.world_from_camera, nullptr);
  const Pose camera_from_world = stage.world_from_camera.inverse();
  int off = 0;
  for (int y = 0; y < found.height; ++y) {
    for (int x = 0; x < found.width; ++x) {
      const Vec3d bound =
          DirectBound(stage, camera_from_world * PixelOf(truth.position, x, y), PixelOf(truth.normal, x, y));
      off += ((PixelOf(found, x, y) - PixelOf(expected, x, y)).cwiseAbs() - bound).maxCoeff() > 0;
    }
  }
  return off;
}

TEST(ReferencePath, DirectLightPixelByPixel) {
  for (const Mesh& mesh : {Globe(18, 40), Tube(18, 40, 40, 60)}) {
    Stage stage = StageIn(mesh);
    const ImageF found = Fast(stage, 1);
    const ImageF expected = Plain<double>(stage, 1);
    // Where a ray meets an edge within rounding, some 1e-4 mm, or its light passes one, either answer is
    // right: that is one in 2,000 of the 1,920 rays to triangles of 1 mm.
    EXPECT_LE(PixelsOff(stage, found, expected), 6);
    EXPECT_LE(PixelsOff(stage, Plain<float>(stage, 1), expected), 6);
    stage.light.sources[0].position.z() += 0.01;  // mm
    EXPECT_GT(PixelsOff(stage, found, Plain<double>(stage, 1)), 500);
  }
}

constexpr int kBlock_px = 8, kRenders = 24;

SeedMeans MeansOf(const std::function<ImageF(uint64_t)>& render) {
  SeedMeans means;
  for (uint64_t seed = 0; seed < kRenders; ++seed) means.Add(BlockMeansOf(render(seed), kBlock_px));
  return means;
}

int BlocksOff(const SeedMeans& a, const SeedMeans& b) { return CountOff(a, b, 1e-4); }

TEST(ReferencePath, LightBetweenWallsByBlocks) {
  Stage stage = StageIn(Tube(18, 40, 20, 30));
  stage.surface.mottling = Mottling{};
  stage.surface.vessels.emplace(VesselOptions{}, stage.mesh, 1);
  stage.options = {16, 4, 1};
  const SeedMeans plain = MeansOf([&](uint64_t seed) { return Plain<double>(stage, 1000 + seed); });
  const SeedMeans single = MeansOf([&](uint64_t seed) { return Plain<float>(stage, 2000 + seed); });
  EXPECT_EQ(BlocksOff(single, plain), 0);
  for (const PathOptions& options : {PathOptions{16, 4, 1, 16}, PathOptions{16, 4, 1, 0},
                                     PathOptions{16, 4, 1, 16, Sampling::kIndependent},
                                     PathOptions{16, 4, 1, 0, Sampling::kIndependent}}) {
    stage.options = options;
    const SeedMeans fast = MeansOf([&](uint64_t seed) { return Fast(stage, seed); });
    EXPECT_EQ(BlocksOff(fast, plain), 0) << options.shared_paths;
  }
  stage.options = {16, 4, 1, 16};
  stage.surface.albedo *= 1.03;
  const SeedMeans wrong = MeansOf([&](uint64_t seed) { return Fast(stage, seed); });
  EXPECT_GT(BlocksOff(wrong, plain), 40);  // of 90
}

// A cavity in tissue under a strong coat on a relief, as narrow as walks are long, with a polyp in sight that
// light goes through. The guide shines away from what is seen, so that light between walls is nearly all.
Stage CoatedCavity() {
  Mesh mesh = Globe(6, 24), polyp = Globe(1.2, 10);
  const int first = static_cast<int>(mesh.vertices.size());
  for (const Vec3d& vertex : polyp.vertices) mesh.vertices.push_back(vertex + Vec3d(0.8, -0.5, 3));
  for (const Vec3i& face : polyp.faces) {
    mesh.faces.push_back(Vec3i(face[0], face[2], face[1]) + Vec3i::Constant(first));
  }
  Stage stage(std::move(mesh), CentredPinhole(24, 16, 12));
  stage.surface.albedo = Vec3d(0.8, 0.5, 0.3);
  stage.surface.mottling = Mottling{};
  stage.surface.coat.emplace(CoatOptions{1.9, 0.6, 1, 0.06});
  stage.surface.subsurface.emplace(WithAlbedos({0.97, 0.9, 0.7}, {0.5, 1, 2}));
  stage.light.sources[0] = {Vec3d(1, 0.5, 0), Vec3d(0.2, 0.1, -1).normalized(), 3, Vec3d(300, 400, 500)};
  stage.world_from_camera.translation() = Vec3d(-0.5, 0.3, -1);
  return stage;
}

TEST(ReferencePath, CoatOverTissueByBlocks) {
  Stage stage = CoatedCavity();
  for (const int bounces : {1, 4}) {
    stage.options = {8, bounces, 2};
    const SeedMeans plain = MeansOf([&](uint64_t seed) { return Plain<double>(stage, 1000 + seed); });
    for (const int shared_paths : {0, 16}) {
      stage.options.shared_paths = shared_paths;
      const SeedMeans fast = MeansOf([&](uint64_t seed) { return Fast(stage, seed); });
      EXPECT_EQ(BlocksOff(fast, plain), 0) << bounces << ' ' << shared_paths;
    }
    // A wall that reflects as much of even light, but on the spot.
    Stage on_the_spot = CoatedCavity();
    on_the_spot.options = stage.options;
    on_the_spot.surface.albedo = stage.surface.subsurface->EvenReflectance().cast<double>();
    on_the_spot.surface.mottling.reset();
    on_the_spot.surface.subsurface.reset();
    const SeedMeans wrong = MeansOf([&](uint64_t seed) { return Fast(on_the_spot, seed); });
    EXPECT_GT(BlocksOff(wrong, plain), 9) << bounces;  // of 18
  }
}

TEST(ReferencePath, RefusesWhatItDoesNotKnow) {
  const Stage stage = StageIn(Globe(18, 10));
  const Camera<float> camera(stage.intrinsics);
  const Defocus defocus{0.3, 10};
  View view = ViewOf(stage, camera);
  view.defocus = &defocus;
  const auto render = [&] {
    RenderReference<double>({&stage.wall, &stage.surface, 0}, view, stage.options, 0, 0);
  };
  EXPECT_NE(ErrorOf(render).find("defocus"), std::string::npos);
}

}  // namespace
}  // namespace lumen::test
