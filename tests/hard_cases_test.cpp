// Hard geometry, each case with its reference. Optics and the sensor: hard_cases_imaging_test.cpp.
#include <gtest/gtest.h>

#include <cmath>

#include "common/files.h"
#include "common/random.h"
#include "sim/ground_truth.h"
#include "sim/scene.h"
#include "tests/path_stage.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::AddPlate;
using test::CentredPinhole;
using test::Estimate;
using test::MeanOver;
using test::PixelOf;
using test::Stage;

constexpr double kIntensity = 500;

// What a Lambertian wall that faces the normal sends to a lamp at the camera that sees it at this distance
// and cosine.
double Lambertian(double albedo, double distance_mm, double cosine) {
  return kIntensity * albedo / kPi * cosine / (distance_mm * distance_mm);
}

// At most how far a ray's end may be off in float, mm: sim/ground_truth.cpp derives it.
double Rounding_mm(const Mesh& mesh) { return 0x1p-20 * Bounds(mesh).diagonal().norm(); }

// A wall 20 mm from the middle, the camera nearer and nearer to it. The truth's depth is that in double; what
// is seen is off by twice the rounding of the distance.
TEST(HardCases, CameraOnTheWall) {
  Mesh room;
  AddPlate(&room, -20, 20, -20, 20, 20);
  AddPlate(&room, -20, 20, -20, 20, -20);
  for (const double height_mm : {0.1, 1e-3, 1e-5}) {
    Stage stage(room, CentredPinhole(24, 18, 12), kIntensity);
    stage.world_from_camera.translation() = Vec3d(3, -2, 20 - height_mm);
    const Film film = stage.Render();
    const FrameTruth truth = ComputeTruth(stage.wall, Camera<double>(stage.intrinsics), stage.valid,
                                          stage.world_from_camera, nullptr);
    const double tolerance = 4 * Rounding_mm(room) / height_mm;
    for (int y = 0; y < 18; ++y) {
      for (int x = 0; x < 24; ++x) {
        const double z = Vec3d((x - 11.5) / 12, (y - 8.5) / 12, 1).normalized().z();
        EXPECT_NEAR(*truth.z.Pixel(x, y), height_mm, 1e-6 * height_mm);
        const double expected = Lambertian(0.8, height_mm / z, z);
        if (tolerance < 0.1) {
          EXPECT_NEAR(film.radiance.Pixel(x, y)[0], expected, tolerance * expected) << height_mm;
        }
      }
    }
    stage.options = {4, 3, 1};
    stage.surface.coat.emplace(CoatOptions{});
    stage.Render(2, true);  // finite
  }
}

// On it to the last bit, light and eye: nothing has a direction, and nothing is made up of it.
TEST(HardCases, CameraInTheWall) {
  for (const bool coat : {false, true}) {
    Stage stage(test::Globe(20, 30), CentredPinhole(16, 16, 8), kIntensity);
    if (coat) stage.surface.coat.emplace(CoatOptions{});
    stage.options = {4, 3, 1};
    for (const int face : {7, 450, 1333}) {
      const Vec3i& corners = stage.mesh.faces[face];
      stage.world_from_camera.translation() =
          (stage.mesh.vertices[corners[0]] + stage.mesh.vertices[corners[1]]) / 2;
      stage.Render(3, true);  // finite
      stage.world_from_camera.translation() = stage.mesh.vertices[corners[2]];
      stage.Render(3, true);
    }
  }
}

// Light and eye over a plain, looking along it. The angle to the plain has an absolute error of a few 2⁻²⁴;
// the place met, whose barycentric coordinates are floats, one of 2⁻²³ of the triangle's size. Both count
// thrice: once in the cosine, twice in the distance.
TEST(HardCases, GrazingTo8999) {
  constexpr double kHeight_mm = 0.05;
  Mesh plain;
  AddPlate(&plain, -400, 400, -400, 400, 0);
  for (const double degrees : {80.0, 89.0, 89.9, 89.99}) {
    const double angle = degrees * kPi / 180;
    Stage stage(plain, CentredPinhole(1, 1, 1000), kIntensity);
    stage.world_from_camera =
        Eigen::Translation3d(0, 0, kHeight_mm) * Eigen::AngleAxisd(kPi - angle, Vec3d(0.6, 0.8, 0));
    const double cosine = std::cos(angle), distance_mm = kHeight_mm / cosine;
    const FrameTruth truth = ComputeTruth(stage.wall, Camera<double>(stage.intrinsics), stage.valid,
                                          stage.world_from_camera, nullptr);
    EXPECT_NEAR(*truth.distance.Pixel(0, 0), distance_mm, 1e-6 * distance_mm);
    const double expected = Lambertian(0.8, distance_mm, cosine);
    const double rounding = 3 * (4 * 0x1p-24 / cosine + 0x1p-23 * 800 / distance_mm);
    EXPECT_NEAR(stage.Render().radiance.Pixel(0, 0)[0], expected, rounding * expected) << degrees;
    stage.surface.coat.emplace(CoatOptions{});
    stage.Render();  // finite
  }
}

// A fold across a sphere, the light on its one side, the eye on its other: not a ray gets through, not even
// by way of other walls, be the fold ever so thin.
TEST(HardCases, ThinFoldsLetNothingThrough) {
  for (const double thickness_mm : {0.2, 0.05, 0.005}) {
    Mesh mesh = test::Globe(20, 40);
    AddPlate(&mesh, -25, 25, -25, 25, -thickness_mm / 2);
    AddPlate(&mesh, -25, 25, -25, 25, thickness_mm / 2);
    Stage stage(mesh, CentredPinhole(48, 36, 20), kIntensity);
    stage.options = {8, 6, 6};
    stage.world_from_camera.translation() = Vec3d(2, 1, -9);
    stage.light.sources[0].position = Vec3d(0, 0, 9 + thickness_mm / 2 + 0.3);
    const Film dark = stage.Render(5);
    for (const float value : dark.radiance.data) EXPECT_EQ(value, 0) << thickness_mm;
    // On the eye's side all of it is lit.
    stage.light.sources[0].position = Vec3d(0, 0, 5);
    const Film lit = stage.Render(5);
    for (const float value : lit.radiance.data) EXPECT_GT(value, 0);
    // Between its two sheets it is dark too.
    stage.light.sources[0].position = Vec3d(0, 0, 9);
    for (const float value : stage.Render(6).radiance.data) EXPECT_EQ(value, 0) << thickness_mm;
  }
}

// As exporters leave meshes: a face split off as a sliver a millionth of a mm wide, corners of its own for
// every face, faces without area, some twice, and fins outside that make edges of three faces.
Mesh Spoilt(const Mesh& mesh) {
  Mesh spoilt;
  const auto add = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const int first = static_cast<int>(spoilt.vertices.size());
    spoilt.vertices.insert(spoilt.vertices.end(), {a, b, c});
    spoilt.faces.push_back({first, first + 1, first + 2});
  };
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    const Vec3d &a = mesh.vertices[mesh.faces[face][0]], &b = mesh.vertices[mesh.faces[face][1]],
                &c = mesh.vertices[mesh.faces[face][2]];
    const Vec3d inside = (a + b) / 2 + 1e-6 * (c - (a + b) / 2).normalized();
    add(a, b, inside);
    add(b, c, inside);
    add(c, a, inside);
    if (face % 3 == 0) add(a, a, a);
    if (face % 3 == 1) add(a, b, (a + b) / 2);
    if (face % 7 == 0) add(a, b, c);
    if (face % 5 == 0) add(a, b, 1.2 * (a + b) / 2);
  }
  return spoilt;
}

TEST(HardCases, SliversDoublesAndFinsChangeNothing) {
  // A sphere about the origin: (a + b)/2 · 1.2 lies outside of it. No poles, whose faces have no area.
  const Mesh clean = test::Lathe(40, 80, [](double along, double turn) {
    const double polar = 0.05 + (kPi - 0.1) * along;
    return Vec3d(20 *
                 Vec3d(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar)));
  });
  const CameraIntrinsics camera = CentredPinhole(48, 36, 24);
  Stage fair(clean, camera), spoilt(Spoilt(clean), camera);
  for (Stage* stage : {&fair, &spoilt}) {
    stage->world_from_camera =
        Eigen::Translation3d(3, -2, 1) * Eigen::AngleAxisd(1.5, Vec3d(1, 0.3, 0).normalized());
    stage->light.sources[0].position = Vec3d(2, 1, 0);
  }
  const Film expected = fair.Render(), found = spoilt.Render();
  int off = 0;
  for (size_t i = 0; i < found.radiance.data.size(); ++i) {
    off += std::abs(found.radiance.data[i] - expected.radiance.data[i]) > 1e-4f * expected.radiance.data[i];
  }
  EXPECT_LE(off, 6);  // two pixels whose rays meet a sliver or an edge
  // Light from wall to wall, and the coat's normals from faces without area.
  for (Stage* stage : {&fair, &spoilt}) {
    stage->options = {4, 3, 9};
    stage->surface.coat.emplace(CoatOptions{1.37, 0.6, 1, 0, std::nullopt});
  }
  const auto indirect = [](const Film& film) -> const ImageF& { return film.indirect; };
  const Estimate there = MeanOver(fair, 12, indirect), here = MeanOver(spoilt, 12, indirect);
  EXPECT_NEAR(there.mean, here.mean, 5 * std::hypot(there.standard_error, here.standard_error));
  EXPECT_LT(there.standard_error, 0.01 * there.mean);
}

void ExpectSamePicture(const Stage& expected, const Stage& found, double tolerance) {
  const Film there = expected.Render(), here = found.Render();
  int off = 0;
  for (size_t i = 0; i < here.radiance.data.size(); ++i) {
    const float value = there.radiance.data[i];
    off += std::abs(here.radiance.data[i] - value) > tolerance * value;
  }
  EXPECT_LE(off, 6);  // two pixels that round to the other face
  EXPECT_GT(there.radiance.data[0], 0);
}

TEST(HardCases, FarFromTheOrigin) {
  const Mesh mesh = test::Globe(20, 40);
  const CameraIntrinsics camera = CentredPinhole(48, 36, 24);
  Stage near(mesh, camera, kIntensity);
  near.world_from_camera.translation() = Vec3d(3, -2, 1);
  near.light.sources[0].position = Vec3d(2, 1, 0);
  near.surface.vessels.emplace(VesselOptions{}, mesh, 1);  // a texture too
  const Vec3d offset(1e5, -1e5, 1e5);
  Mesh moved = mesh;
  for (Vec3d& vertex : moved.vertices) vertex += offset;
  Stage far(moved, camera, kIntensity);
  far.world_from_camera.translation() = Vec3d(3, -2, 1) + offset;
  far.light = near.light;
  far.surface = near.surface;
  ExpectSamePicture(near, far, 1e-4);
  const FrameTruth truth =
      ComputeTruth(near.wall, Camera<double>(camera), near.valid, near.world_from_camera, nullptr);
  const FrameTruth far_truth =
      ComputeTruth(far.wall, Camera<double>(camera), far.valid, far.world_from_camera, nullptr);
  for (size_t i = 0; i < truth.z.data.size(); ++i) EXPECT_NEAR(truth.z.data[i], far_truth.z.data[i], 1e-5);
}

// The same room in millimetres as metres and as micrometres would have it; the light grows with the area.
TEST(HardCases, AnyUnit) {
  const CameraIntrinsics camera = CentredPinhole(48, 36, 24);
  const auto scaled = [&](double scale) {
    auto stage = std::make_unique<Stage>(test::Globe(20 * scale, 40), camera, kIntensity * scale * scale);
    stage->world_from_camera.translation() = scale * Vec3d(3, -2, 1);
    stage->light.sources[0].position = scale * Vec3d(2, 1, 0);
    return stage;
  };
  const auto stage = scaled(1);
  const auto indirect = [](const Film& film) -> const ImageF& { return film.indirect; };
  for (const double scale : {1e-3, 1e3}) {
    const auto other = scaled(scale);
    stage->options = other->options = {1, 0, 0};
    ExpectSamePicture(*stage, *other, 1e-4);
    stage->options = other->options = {4, 3, 9};
    const Estimate there = MeanOver(*stage, 8, indirect), here = MeanOver(*other, 8, indirect);
    // Rays leave the wall of 0.02 mm some 2⁻¹⁶ mm above it: 0.1% of the radius.
    EXPECT_NEAR(there.mean, here.mean,
                5 * std::hypot(there.standard_error, here.standard_error) + 2e-3 * there.mean);
  }
}

// The second of two cameras has its guide in the wall.
TEST(HardCases, GuideInTheWallIsRefusedByFrame) {
  const test::ScratchFolder scratch;
  const std::string at_axis = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,20,1\n";
  std::string scene = test::kSmallScene;
  const size_t from = scene.find("[trajectory]"), to = scene.find("[camera]");
  scene.replace(from, to - from, "[trajectory]\nkind = \"file\"\npath = \"pose.txt\"\nclearance_mm = 0\n\n");
  const auto error_at = [&](double x_mm) {
    WriteFile(scratch / "pose.txt",
              at_axis + "1,0,0,0,0,1,0,0,0,0,1,0," + std::to_string(x_mm) + ",0,20,1\n");
    WriteFile(scratch / "scene.toml", scene);
    return test::ErrorOf([&] { ReadScene(scratch / "scene.toml", {"geometry.bend_rad=0"}, 4); });
  };
  EXPECT_EQ(error_at(1), "");
  // From the axis outwards, the wall comes between 12 and 22 mm: the guide is 3.24 mm farther out than the
  // eye.
  double x_mm = 10;
  std::string error;
  for (; error.empty() && x_mm < 30; x_mm += 0.5) error = error_at(x_mm);
  EXPECT_NE(error.find("frame 1"), std::string::npos) << error;
  EXPECT_NE(error.find("light source"), std::string::npos) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos);
}

// Five million triangles see what the smooth sphere sees, to the angle between them.
TEST(HardCases, FiveMillionTriangles) {
  constexpr int kRings = 1120;
  Stage stage(test::Globe(20, kRings), CentredPinhole(32, 24, 16), kIntensity);
  EXPECT_GT(stage.mesh.faces.size(), 5000000u);
  stage.world_from_camera.translation() = Vec3d(3, -2, 1);
  const Film film = stage.Render();
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      const Vec3d ray = Vec3d((x - 15.5) / 16, (y - 11.5) / 16, 1).normalized(), eye(3, -2, 1);
      const double b = eye.dot(ray), t = -b + std::sqrt(b * b + 400 - eye.squaredNorm());
      const double expected = Lambertian(0.8, t, ray.dot(eye + t * ray) / 20);
      EXPECT_NEAR(film.radiance.Pixel(x, y)[0], expected, 2 * kPi / kRings * expected);
    }
  }
}

}  // namespace
}  // namespace lumen
