// A wall that moves while a frame is taken: the picture against instantaneous ones of walls that stand still
// where the wave has them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "common/parallel.h"
#include "common/random.h"
#include "sim/geometry/moving_wall.h"
#include "sim/imaging/path.h"
#include "tests/path_stage.h"
#include "tests/welch.h"

namespace lumen {
namespace {

constexpr int kFrame = 2;
// A frame is 0.1 s: over it rings travel half a wavelength.
constexpr Peristalsis kWave = {0.4, 24, 120, 10, 0.9};

struct Scenery {
  Geometry geometry = {test::Tube(12, 30, 40, 40), {Vec3d(0, 0, -30), Vec3d(0, 0, 30)}};
  PeristalticWall wave{kWave, geometry};
  MovingWall walls{geometry, {kWave, true}};
  Surface surface;
  CameraIntrinsics intrinsics = test::CentredPinhole(32, 24, 14);
  Image8 valid{32, 24, 1, 255};
  Light light;
  std::vector<Pose> poses;
  Shutter shutter;
  PathOptions options;
  std::unique_ptr<const WallMotion> wall;  // while the frame is taken

  explicit Scenery(const Shutter& shutter)
      : shutter(shutter), wall(walls.During(kFrame, shutter.Duration())) {
    surface.mottling = Mottling{0.6, 5};
    surface.vessels.emplace(VesselOptions{}, geometry.mesh, 1);
    light.sources.push_back({Vec3d(2, 1, 0), Vec3d::UnitZ(), 1, Vec3d(400, 500, 600)});
    for (int i = 0; i < 2 * kFrame; ++i) {
      poses.push_back(Pose(Eigen::Translation3d(1, 0.8 * i - 2, -10 - 1.5 * i) *
                           Eigen::AngleAxisd(0.1 * i, Vec3d(2, 1, 2) / 3)));
    }
    options.samples = 16;
    options.bounces = 2;
  }

  ImageF Render(const RayScene& wall, const std::vector<Vec3d>* vertex_normals, const Pose& pose,
                const CameraMotion* motion, const PathOptions& path, uint64_t seed) const {
    const PathScene scene = {&wall,          &surface,       0,
                             vertex_normals, &geometry.mesh, Bounds(geometry.mesh).center()};
    const Camera<float> camera(intrinsics);
    Film film;
    EXPECT_EQ(RenderFrame(scene, {&camera, &valid, pose, &light, motion}, path, seed, kFrame, false, &film)
                  .failure.count,
              0);
    return film.radiance;
  }
  ImageF Taken(uint64_t seed) const {
    const CameraMotion motion(shutter, poses, kFrame);
    return Render(wall->rays, wall->vertex_normals.data(), poses[kFrame], &motion, options, seed);
  }
  // time: in frame intervals from the frame's moment.
  ImageF InAnInstant(double time, const PathOptions& path, uint64_t seed) const {
    const Mesh mesh = wave.At(kFrame + time);
    const std::vector<Vec3d> normals = VertexNormals(mesh);
    return Render(RayScene(mesh), &normals, CameraMotion(shutter, poses, kFrame).At(time), nullptr, path,
                  seed);
  }
  // The mean of instantaneous frames, at a moment in each of as many parts of the exposure.
  ImageF Mean(uint64_t seed) const {
    constexpr int kMoments = 8;
    PathOptions few = options;
    few.samples = options.samples / kMoments;
    ImageF mean(intrinsics.width, intrinsics.height, 3);
    for (int i = 0; i < kMoments; ++i) {
      const double part = (i + UniformDouble(RandomBits(seed, i))) / kMoments;
      const ImageF one = InAnInstant(shutter.exposure * (part - 0.5), few, RandomBits(seed, i, 1));
      for (size_t k = 0; k < mean.data.size(); ++k) mean.data[k] += one.data[k] / kMoments;
    }
    return mean;
  }
};

// Halfway between two steps a vertex is farthest off its way: never more than it may be, nearly as much
// somewhere, and the stretches are as few as that asks for.
TEST(WallMotion, StretchesKeepToTheWay) {
  const Scenery scenery({1, 0});
  for (const double frames : {0.02, 0.3, 1.0}) {
    const double stretches = scenery.wave.StretchesOver(frames);
    const auto worst_mm = [&](double count) {
      double worst = 0;
      for (int i = 0; i < count; ++i) {
        const Mesh from = scenery.wave.At(frames * i / count), to = scenery.wave.At(frames * (i + 1) / count),
                   middle = scenery.wave.At(frames * (i + 0.5) / count);
        for (size_t v = 0; v < middle.vertices.size(); ++v) {
          const Vec3d chord = (from.vertices[v] + to.vertices[v]) / 2;
          worst = std::max(worst, (middle.vertices[v] - chord).norm());
        }
      }
      return worst;
    };
    EXPECT_LE(worst_mm(stretches), PeristalticWall::kOffTheWay_mm);
    if (stretches > 1) EXPECT_GT(worst_mm(stretches - 1), 0.98 * PeristalticWall::kOffTheWay_mm);
    EXPECT_EQ(scenery.walls.During(kFrame, frames)->steps.size(), stretches + 1);
  }
  EXPECT_EQ(scenery.wave.StretchesOver(0.02), 1);
  EXPECT_GT(scenery.wave.StretchesOver(1), 20);
}

// There is no motion then, and what a frame sees is its moment.
TEST(WallMotion, IsNoneWhereNothingMoves) {
  const Scenery scenery({1, 0});
  const auto steps_of = [&](const std::optional<Peristalsis>& wave, double frames) {
    const auto motion = MovingWall(scenery.geometry, {wave}).During(kFrame, frames);
    return motion ? motion->steps.size() : 0;
  };
  EXPECT_EQ(steps_of(std::nullopt, 1), 0u);
  EXPECT_EQ(steps_of(kWave, 0), 0u);
  EXPECT_EQ(steps_of(Peristalsis{0, 24, 120, 10, 0.9}, 1), 0u);
  EXPECT_EQ(steps_of(Peristalsis{0.4, 24, 0, 10, 0.9}, 1), 0u);
  EXPECT_GT(steps_of(Peristalsis{0.4, 24, -120, 10, 0.9}, 1), 20u);
}

// Of each 8 × 8 pixels and channel, over the runs.
std::vector<std::vector<double>> BlockMeans(int runs, const std::function<ImageF(uint64_t)>& render) {
  std::vector<std::vector<double>> means;
  for (int run = 0; run < runs; ++run) {
    const ImageF image = render(100 + run);
    const int across = image.width / 8, blocks = across * (image.height / 8);
    means.resize(3 * blocks, std::vector<double>(runs, 0.0));
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        for (int c = 0; c < 3; ++c) {
          means[3 * (y / 8 * across + x / 8) + c][run] += image.Pixel(x, y)[c] / 64;
        }
      }
    }
  }
  return means;
}

constexpr int kRuns = 8;

// Whether chance explains the largest difference of the means.
bool Agree(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  double least = 1;
  for (size_t i = 0; i < a.size(); ++i) {
    const test::Estimate one = test::EstimateOf(a[i]), other = test::EstimateOf(b[i]);
    least = std::min(least, test::WelchChance(one.mean - other.mean, one.standard_error * one.standard_error,
                                              other.standard_error * other.standard_error, kRuns));
  }
  return least > test::SharedOut(1e-4, static_cast<double>(a.size()));
}

void ExpectMeanOfInstants(const Scenery& scenery) {
  const auto taken = BlockMeans(kRuns, [&](uint64_t seed) { return scenery.Taken(seed); });
  const auto mean = BlockMeans(kRuns, [&](uint64_t seed) { return scenery.Mean(RandomBits(seed, 7)); });
  EXPECT_TRUE(Agree(taken, mean));
}

TEST(WallMotion, ExposureIsTheMeanOfItsInstants) {
  Scenery scenery({1, 0});
  ExpectMeanOfInstants(scenery);
  scenery.options.shared_paths = 0;
  ExpectMeanOfInstants(scenery);
}

TEST(WallMotion, ExposureUnderACoatIsTheMeanOfItsInstants) {
  Scenery scenery({1, 0});
  scenery.surface.coat.emplace(CoatOptions{1.37, 0.4, 2, 0.1});
  ExpectMeanOfInstants(scenery);
}

TEST(WallMotion, ExposureOfTissueIsTheMeanOfItsInstants) {
  Scenery scenery({1, 0});
  scenery.surface.subsurface.emplace(SubsurfaceOptions{});
  ExpectMeanOfInstants(scenery);
}

// What the comparison must tell: the wall at the frame's moment while the camera moves; the camera at the
// frame's moment while the wall moves; a wall that takes one straight step.
TEST(WallMotion, ComparisonTellsWhatStandsStill) {
  Scenery scenery({1, 0});
  const auto mean = BlockMeans(kRuns, [&](uint64_t seed) { return scenery.Mean(RandomBits(seed, 7)); });
  const CameraMotion motion(scenery.shutter, scenery.poses, kFrame),
      no_motion(scenery.shutter, {scenery.poses[kFrame]}, 0);
  const auto agrees = [&](const RayScene& wall, const std::vector<Vec3d>* normals,
                          const CameraMotion& camera) {
    return Agree(mean, BlockMeans(kRuns, [&](uint64_t seed) {
                   return scenery.Render(wall, normals, scenery.poses[kFrame], &camera, scenery.options,
                                         seed);
                 }));
  };
  const auto standing = scenery.walls.At(kFrame);
  EXPECT_FALSE(agrees(standing->rays, &standing->vertex_normals, motion));
  EXPECT_FALSE(agrees(scenery.wall->rays, scenery.wall->vertex_normals.data(), no_motion));
  const WallMotion one_step({scenery.wave.At(kFrame - 0.5), scenery.wave.At(kFrame + 0.5)});
  EXPECT_FALSE(agrees(one_step.rays, nullptr, motion));
}

// Four rows at a time see what an instantaneous picture of the moment sees. The moments are steps of the
// motion, so that only what rounds differs: a ray at an edge may meet either face.
TEST(WallMotion, RowsAreReadOneAfterTheOther) {
  Scenery scenery({0, 0.9});
  scenery.options.bounces = 0;
  scenery.surface.coat.emplace(CoatOptions{1.37, 0.4, 2, 0.1});
  std::vector<Mesh> steps;
  for (int i = 0; i <= 12; ++i) steps.push_back(scenery.wave.At(kFrame + 0.9 * (i / 12.0 - 0.5)));
  WallMotion wall(std::move(steps));
  for (const Mesh& mesh : wall.steps) wall.vertex_normals.push_back(VertexNormals(mesh));
  const CameraMotion motion(scenery.shutter, scenery.poses, kFrame);
  const ImageF rolling = scenery.Render(wall.rays, wall.vertex_normals.data(), scenery.poses[kFrame], &motion,
                                        scenery.options, 3);
  int unlike = 0, unlike_backwards = 0;
  for (int row = 0; row < 24; row += 4) {
    const double time = motion.Time((row + 2) / 24.0, 0.5);
    const ImageF instant = scenery.InAnInstant(time, scenery.options, 3);
    const ImageF backwards = scenery.InAnInstant(-time, scenery.options, 3);
    for (int y = row; y < row + 4; ++y) {
      for (int x = 0; x < 32; ++x) {
        const float found = rolling.Pixel(x, y)[0];
        unlike += std::abs(instant.Pixel(x, y)[0] - found) > 1e-4f * found;
        unlike_backwards += std::abs(backwards.Pixel(x, y)[0] - found) > 1e-4f * found;
      }
    }
  }
  EXPECT_LE(unlike, 2);
  EXPECT_GT(unlike_backwards, 600);
}

TEST(WallMotion, ThreadsChangeNoByte) {
  Scenery scenery({0.6, -0.4});
  scenery.options.samples = 4;
  scenery.surface.coat.emplace(CoatOptions{1.37, 0.4, 2, 0.1});
  scenery.surface.subsurface.emplace(SubsurfaceOptions{});
  SetThreadCount(1);
  const ImageF one = scenery.Taken(5);
  SetThreadCount(2);
  const ImageF two = scenery.Taken(5);
  SetThreadCount(0);
  EXPECT_EQ(one.data, two.data);
}

}  // namespace
}  // namespace lumen
