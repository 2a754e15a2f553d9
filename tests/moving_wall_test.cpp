// A wall that moves from frame to frame: its truth, and what a render makes of it.
#include "sim/geometry/moving_wall.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include "common/image.h"
#include "common/random.h"
#include "common/sequence.h"
#include "sim/ground_truth.h"
#include "sim/render.h"
#include "sim/surface_maps.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::WriteScene;

constexpr uint64_t kSeed = 4;
constexpr double kLength_mm = 60, kRadius_mm = 14;

// A straight tube about z from 0, closed by fans.
Geometry StraightTube(int columns, int rows) {
  Mesh mesh;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double angle = 2 * kPi * (column + 0.3) / columns;
      mesh.vertices.emplace_back(kRadius_mm * std::cos(angle), kRadius_mm * std::sin(angle),
                                 kLength_mm * row / rows);
    }
  }
  const int near = static_cast<int>(mesh.vertices.size()), top = rows * columns;
  mesh.vertices.push_back(Vec3d(0, 0, 0));
  mesh.vertices.push_back(Vec3d(0, 0, kLength_mm));
  for (int column = 0; column < columns; ++column) {
    const int next = (column + 1) % columns;
    for (int row = 0; row < rows; ++row) {
      const int a = row * columns + column, b = row * columns + next;
      mesh.faces.emplace_back(a, b, b + columns);
      mesh.faces.emplace_back(a, b + columns, a + columns);
    }
    mesh.faces.emplace_back(near, next, column);
    mesh.faces.emplace_back(near + 1, top + column, top + next);
  }
  return {std::move(mesh), {Vec3d(0, 0, 0), Vec3d(0, 0, kLength_mm)}};
}

const Peristalsis kWave = {0.45, 40, 60, 10, 0.5};

// What the contraction leaves of the radius.
double Left(double s_mm, int frame) {
  const double cosine = std::cos(
      kPi * (s_mm + kWave.speed_mm_s * frame / kWave.rate_hz) / kWave.wavelength_mm - kWave.phase_rad / 2);
  return 1 - kWave.amplitude * cosine * cosine;
}

// Where what is at a place in one frame is in another; at rest: −1.
Vec3d Follow(const Vec3d& place, int from, int to) {
  const double left = (to < 0 ? 1 : Left(place.z(), to)) / Left(place.z(), from);
  return {left * place.x(), left * place.y(), place.z()};
}

Vec3d PixelOf(const ImageF& image, int x, int y) {
  return Eigen::Map<const Vec3f>(image.Pixel(x, y)).cast<double>();
}

// The truth of frame 4 in the tube, of the frames beside it and of the wall at rest.
struct TubeView {
  Geometry geometry;
  MovingWall walls;
  Camera<double> camera{Resized(C3vdIntrinsics(), 90, 72)};
  Image8 valid{90, 72, 1, 255};
  static constexpr int kFrame = 4;
  Pose here = Pose(Eigen::Translation3d(1, -2, 8) * Eigen::AngleAxisd(0.2, Vec3d::UnitX()));
  Pose before =
      Pose(Eigen::Translation3d(0.5, -1.5, 9.5) * Eigen::AngleAxisd(0.15, Vec3d(1, 1, 0.4).normalized()));
  Pose after = Pose(Eigen::Translation3d(1.2, -2.2, 7) * Eigen::AngleAxisd(0.1, Vec3d::UnitY()));
  FrameTruth truth;

  TubeView(int columns, int rows) : geometry(StraightTube(columns, rows)), walls(geometry, {kWave}) {
    const auto wall_before = walls.At(kFrame - 1), wall = walls.At(kFrame), wall_after = walls.At(kFrame + 1);
    TruthExtras extras;
    extras.world_from_next = &after;
    extras.wall_before = &wall_before->rays;
    extras.wall_after = &wall_after->rays;
    extras.rest = &geometry.mesh;
    truth = ComputeTruth(wall->rays, camera, valid, here, &before, extras);
  }

  std::optional<Vec2d> Project(const Pose& world_from_camera, const Vec3d& place) const {
    return camera.Project(world_from_camera.inverse() * place);
  }
};

// The tube's sides; its ends are fans of triangles, which bend between their corners.
bool OnTheSide(const Vec3d& place) { return place.z() > 0.5 && place.z() < kLength_mm - 0.5; }

// The triangles' places follow the formula but for what bends within a triangle: rings 0.1 mm and columns
// 0.042 rad apart, a quarter of the product times the radius' slope of 0.49, 5.2e-4 mm, and that over 0.55 of
// the radius on the way back to rest. In this camera of 51 px/rad, 3 mm away, that is 1.6e-2 px.
TEST(MovingWall, FlowFollowsTheMaterial) {
  const TubeView view(150, 600);
  int compared = 0;
  double worst = 0, worst_without = 0;
  for (int y = 0; y < 72; ++y) {
    for (int x = 0; x < 90; ++x) {
      const Vec3d place = PixelOf(view.truth.position, x, y);
      if (std::isnan(place.x()) || !OnTheSide(place)) continue;
      const auto check = [&](const ImageF& flow, const Pose& pose, int frame) {
        const auto expected = view.Project(pose, Follow(place, TubeView::kFrame, frame));
        const auto still = view.Project(pose, place);
        if (!expected || !still) return;
        const Vec2d found(x + flow.Pixel(x, y)[0], y + flow.Pixel(x, y)[1]);
        worst = std::max(worst, (found - *expected).norm());
        worst_without = std::max(worst_without, (*still - *expected).norm());
        ++compared;
      };
      check(view.truth.flow, view.before, TubeView::kFrame - 1);
      check(view.truth.flow_next, view.after, TubeView::kFrame + 1);
      EXPECT_LT((PixelOf(view.truth.rest_position, x, y) - Follow(place, TubeView::kFrame, -1)).norm(),
                9.4e-4);
    }
  }
  EXPECT_GT(compared, 8000);
  EXPECT_LT(worst, 1.6e-2);
  EXPECT_GT(worst_without, 1);  // the wall's own part
}

struct Meeting {
  double u, v, distance_mm;  // weights of a face's second and third corner
};
// By Cramer's rule in double; nothing where the ray misses the face.
std::optional<Meeting> Meets(const Mesh& mesh, const Vec3i& face, const Vec3d& origin,
                             const Vec3d& direction) {
  Mat3d columns;
  columns << mesh.vertices[face[1]] - mesh.vertices[face[0]], mesh.vertices[face[2]] - mesh.vertices[face[0]],
      -direction;
  if (columns.determinant() == 0) return std::nullopt;
  const Vec3d uvt = columns.inverse() * (origin - mesh.vertices[face[0]]);
  if (uvt[0] < 0 || uvt[1] < 0 || uvt[0] + uvt[1] > 1 || uvt[2] <= 0) return std::nullopt;
  return Meeting{uvt[0], uvt[1], uvt[2]};
}

Vec3d PlaceOf(const Mesh& mesh, const Vec3i& face, const Meeting& at) {
  return (1 - at.u - at.v) * mesh.vertices[face[0]] + at.u * mesh.vertices[face[1]] +
         at.v * mesh.vertices[face[2]];
}

// By trying every triangle of meshes whose corners the formula moved.
TEST(MovingWall, TruthIsThatOfTheMovedTriangles) {
  const TubeView view(24, 40);
  const auto moved = [&](int frame) {
    Mesh mesh = view.geometry.mesh;
    for (Vec3d& v : mesh.vertices) v = Vec3d(Left(v.z(), frame) * v.x(), Left(v.z(), frame) * v.y(), v.z());
    return mesh;
  };
  const Mesh now = moved(TubeView::kFrame), earlier = moved(TubeView::kFrame - 1);
  int hidden = 0, seen = 0, unlike = 0;
  for (int y = 0; y < 72; y += 2) {
    for (int x = 0; x < 90; x += 2) {
      const auto ray = view.camera.Unproject(Vec2d(x, y));
      if (!ray) continue;
      const Vec3d direction = view.here.linear() * *ray, origin = view.here.translation();
      Meeting nearest = {0, 0, 1e9};
      size_t face = 0;
      for (size_t f = 0; f < now.faces.size(); ++f) {
        const auto met = Meets(now, now.faces[f], origin, direction);
        if (!met || met->distance_mm >= nearest.distance_mm) continue;
        nearest = *met;
        face = f;
      }
      EXPECT_NEAR(*view.truth.distance.Pixel(x, y), nearest.distance_mm, 1e-4);
      const Vec3d at_rest = PlaceOf(view.geometry.mesh, now.faces[face], nearest);
      EXPECT_LT((PixelOf(view.truth.rest_position, x, y) - at_rest).norm(), 1e-5);
      const Vec3d place = PlaceOf(earlier, now.faces[face], nearest);
      const auto pixel = view.Project(view.before, place);
      if (pixel) {
        EXPECT_NEAR(x + view.truth.flow.Pixel(x, y)[0], pixel->x(), 1e-3);
        EXPECT_NEAR(y + view.truth.flow.Pixel(x, y)[1], pixel->y(), 1e-3);
      }
      const Vec3d from = view.before.translation();
      bool sees = pixel && pixel->x() > -0.5 && pixel->y() > -0.5 && pixel->x() < 89.5 && pixel->y() < 71.5;
      for (size_t f = 0; sees && f < earlier.faces.size(); ++f) {
        const auto met = Meets(earlier, earlier.faces[f], from, place - from);
        sees = f == face || !met || met->distance_mm > 1 - 1e-6;
      }
      unlike += *view.truth.seen_before.Pixel(x, y) != sees;
      hidden += !sees;
      seen += sees;
    }
  }
  EXPECT_GT(hidden, 50);
  EXPECT_GT(seen, 500);
  EXPECT_EQ(unlike, 0);
}

TEST(MovingWall, StandsStillWithoutAnEffect) {
  const Geometry geometry = StraightTube(12, 10);
  MovingWall still(geometry, {});
  EXPECT_FALSE(still.moves());
  EXPECT_EQ(&still.At(0)->mesh(), &geometry.mesh);
  EXPECT_EQ(still.At(0), still.At(7));
  EXPECT_TRUE(still.At(0)->vertex_normals.empty());
  MovingWall moving(geometry, {kWave, true});
  const auto wall = moving.At(3);
  EXPECT_EQ(wall->mesh().vertices, PeristalticWall(kWave, geometry).At(3).vertices);
  EXPECT_EQ(wall->vertex_normals, VertexNormals(wall->mesh()));
  moving.At(4);
  EXPECT_EQ(moving.At(3), wall);
}

class MovingWallRender : public testing::Test {
 protected:
  Scene Read(const std::vector<std::string>& settings) {
    return ReadScene(WriteScene(scratch_), settings, kSeed);
  }
  fs::path RenderTo(const std::string& name, const std::vector<std::string>& settings, int first = 0) {
    const Scene scene = Read(settings);
    Render(scene, {scratch_ / name, first, 3, kSeed});
    return scratch_ / name;
  }
  test::ScratchFolder scratch_;
};

const std::vector<std::string> kMoving = {"peristalsis.amplitude=0.3", "peristalsis.rate_hz=2"};

TEST_F(MovingWallRender, WritesTheWallOfEachFrame) {
  std::vector<std::string> settings = kMoving;
  settings.push_back("truth.exact=[\"mesh\"]");
  const fs::path folder = RenderTo("moving", settings);
  const Scene scene = Read(settings);
  EXPECT_EQ(std::count(scene.effects.begin(), scene.effects.end(), "peristalsis"), 1);
  const PeristalticWall wall(*scene.peristalsis, scene.geometry);
  for (int i = 0; i < 3; ++i) {
    const Mesh mesh = ReadMesh(folder / "exact" / ("000" + std::to_string(i) + "_mesh.ply"));
    EXPECT_EQ(mesh.vertices, wall.At(i).vertices);
    EXPECT_EQ(mesh.faces, scene.geometry.mesh.faces);
    EXPECT_NE(mesh.vertices, scene.geometry.mesh.vertices);
  }
  EXPECT_EQ(ReadMesh(folder / "mesh.ply").vertices, scene.geometry.mesh.vertices);
  // Faces are observed where they are when a frame is taken.
  std::vector<uint8_t> seen(scene.geometry.mesh.faces.size(), 0);
  const Camera<double> camera(scene.calibration.camera);
  for (int i = 0; i < 3; ++i) {
    const Mesh mesh = wall.At(i);
    MarkObserved(RayScene(mesh), camera, ValidPixels(scene.calibration), scene.world_from_camera[i], &seen);
  }
  std::vector<bool> observed;
  ReadCoverageMesh(folder / "coverage_mesh.obj", &observed);
  EXPECT_EQ(observed, std::vector<bool>(seen.begin(), seen.end()));
  // Another render takes the meshes away with it.
  RenderTo("moving", kMoving);
  EXPECT_FALSE(fs::exists(folder / "exact" / "0000_mesh.ply"));
}

// Neither truth nor gains depend on which other frames are rendered.
TEST_F(MovingWallRender, FramesStandAlone) {
  const fs::path all = RenderTo("all", kMoving), last = RenderTo("last", kMoving, 2);
  for (const std::string name : {"0002_color.png", "0002_depth.tiff", "0002_flow.tiff", "0002_occlusion.png"})
    EXPECT_EQ(ReadFile(all / name), ReadFile(last / name)) << name;
}

// Of no amplitude the truth is that of a wall at rest; of some it is not, and gains follow.
TEST_F(MovingWallRender, ChangesWhatMoves) {
  const fs::path without = RenderTo("without", {}), none = RenderTo("none", {"peristalsis.amplitude=0"});
  const fs::path with = RenderTo("with", kMoving);
  for (const std::string name : {"0001_depth.tiff", "0001_normals.tiff", "0001_flow.tiff"}) {
    EXPECT_EQ(ReadFile(without / name), ReadFile(none / name)) << name;
    EXPECT_NE(ReadFile(without / name), ReadFile(with / name)) << name;
  }
  EXPECT_EQ(ReadFile(without / "mesh.ply"), ReadFile(with / "mesh.ply"));
  EXPECT_NE(ReadSequence(without).frames[1].gain, ReadSequence(with).frames[1].gain);
}

// The wall is lit where it is and wears the texture of where it was: a pixel's centre ray, light at the
// camera.
TEST_F(MovingWallRender, TextureTravelsWithTheWall) {
  const std::vector<std::string> settings = {
      kMoving[0],
      kMoving[1],
      "light.source.0.position=[0, 0, 0]",
      "path.samples=1",
      "path.bounces=0",
      "sensor.gain=1",
      "truth.exact=[\"radiance\", \"albedo\", \"distance\", \"normal\", \"position\"]"};
  const fs::path scene_file = scratch_ / "plain.toml";
  std::string text = test::kSmallScene;
  text.erase(text.find("[sensor.auto_gain]"), std::string("[sensor.auto_gain]").size());
  WriteFile(scene_file, text);
  const Scene scene = ReadScene(scene_file, settings, kSeed);
  Render(scene, {scratch_ / "out", 0, 3, kSeed});
  const Camera<double> camera(scene.calibration.camera);
  const Vec3d anchor = Bounds(scene.geometry.mesh).center();
  double worst = 0, worst_standing = 0;
  int compared = 0;
  for (int frame = 0; frame < 3; ++frame) {
    std::vector<std::string> names;
    const ImageF all = ReadExr(scratch_ / "out" / "exact" / ("000" + std::to_string(frame) + ".exr"), &names);
    const auto at = [&](const std::string& name, int x, int y) {
      return double(all.Pixel(x, y)[std::find(names.begin(), names.end(), name) - names.begin()]);
    };
    for (int y = 0; y < all.height; ++y) {
      for (int x = 0; x < all.width; ++x) {
        const double distance = at("distance", x, y);
        if (std::isnan(distance)) continue;
        const Vec3d ray = *camera.Unproject(Vec2d(x, y));
        const double cosine =
            -ray.dot(Vec3d(at("normal.X", x, y), at("normal.Y", x, y), at("normal.Z", x, y)));
        double irradiance = 0;
        for (const LightSource& source : scene.calibration.light.sources) {
          irradiance += source.intensity.x() * std::exp(-source.spread * (1 - ray.z())) * cosine /
                        (distance * distance);
        }
        const double found = at("radiance.R", x, y) * kPi / irradiance;
        const Vec3d place(at("position.X", x, y), at("position.Y", x, y), at("position.Z", x, y));
        const Vec3f standing =
            AlbedoAt(scene.surface, RandomBits(kSeed, 0x77616c6cull), Vec3f((place - anchor).cast<float>()));
        // Where the light falls at a glance, rounding of the normal shows.
        if (cosine < 0.05) continue;
        worst = std::max(worst, std::abs(found - at("albedo.R", x, y)));
        worst_standing = std::max(worst_standing, std::abs(found - standing.x()));
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 4000);
  EXPECT_LT(worst, 1e-3);
  EXPECT_GT(worst_standing, 0.05);
}

TEST_F(MovingWallRender, RefusesAFrameThatTheWallPasses) {
  const std::string light = ErrorOf([&] { Read({"peristalsis.amplitude=0.9", "peristalsis.phase_rad=3"}); });
  EXPECT_NE(light.find("frame 0: a light source lies behind the wall"), std::string::npos)
      << "said: " << light;
  const std::vector<std::string> aside = {"trajectory.wobble_mm=30", "light.source.0.position=[0, 0, 0]"};
  EXPECT_EQ(ErrorOf([&] { Read(aside); }), "");
  std::vector<std::string> squeezed = aside;
  squeezed.push_back("peristalsis.amplitude=0.6");
  const std::string camera = ErrorOf([&] { Read(squeezed); });
  EXPECT_NE(camera.find(": the contracted wall has passed the camera"), std::string::npos)
      << "said: " << camera;
  EXPECT_NE(camera.find("frame "), std::string::npos) << camera;
}

// A ring a wavelength on in each frame: at the frames' moments the camera is clear of them all, in between it
// isn't.
TEST_F(MovingWallRender, RefusesAFrameThatTheWallPassesWhileItIsTaken) {
  const auto settings = [](const std::string& phase, const std::string& exposure) {
    return std::vector<std::string>{"peristalsis.amplitude=0.9", "peristalsis.speed_mm_s=50",
                                    "peristalsis.rate_hz=1", "peristalsis.phase_rad=" + phase,
                                    "sensor.shutter.exposure=" + exposure};
  };
  EXPECT_EQ(ErrorOf([&] { Read(settings("-0.7", "0.1")); }), "");
  const std::string light = ErrorOf([&] { Read(settings("-0.7", "1")); });
  EXPECT_NE(light.find("frame 0: while it is taken a light source lies behind the wall"), std::string::npos)
      << "said: " << light;
  std::vector<std::string> aside = settings("-0.7", "1");
  aside.insert(aside.end(), {"trajectory.wobble_mm=30", "light.source.0.position=[0, 0, 0]"});
  const std::string camera = ErrorOf([&] { Read(aside); });
  EXPECT_NE(camera.find("while it is taken the contracted wall passes the camera"), std::string::npos)
      << "said: " << camera;
}

TEST_F(MovingWallRender, RefusesRingsThatAreTooFastForTheShutter) {
  const std::vector<std::string> fast = {"peristalsis.speed_mm_s=1000", "peristalsis.rate_hz=2"};
  EXPECT_EQ(ErrorOf([&] { Read(fast); }), "");
  std::vector<std::string> taken = fast;
  taken.push_back("sensor.shutter.exposure=0.5");
  const std::string said = ErrorOf([&] { Read(taken); });
  EXPECT_NE(said.find("scene.toml: peristalsis: its rings travel 250 mm"), std::string::npos) << said;
  EXPECT_NE(said.find("lower peristalsis.speed_mm_s"), std::string::npos) << said;
}

}  // namespace
}  // namespace lumen
