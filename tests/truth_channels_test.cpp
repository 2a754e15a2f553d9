// The truth that is written on request: shading normals, flow to the frame after, visibility of faces.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <sstream>

#include "common/sequence.h"
#include "sim/face_visibility.h"
#include "sim/render.h"
#include "sim/surface_maps.h"
#include "tests/path_stage.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

using test::Exact;
using test::PixelOf;

constexpr uint64_t kSeed = 4;
constexpr double kRadius_mm = 20;

// A camera inside a sphere, and its truth with smooth normals.
struct SphereView {
  Mesh mesh;
  RayScene wall{mesh};
  std::vector<Vec3d> vertex_normals = VertexNormals(mesh);
  Camera<double> camera{Resized(C3vdIntrinsics(), 60, 48)};
  Pose world_from_camera = Pose(Eigen::Translation3d(4, -6, 3) * Eigen::AngleAxisd(1.2, Vec3d::UnitX()));
  FrameTruth truth;

  explicit SphereView(int rings) : mesh(test::Globe(kRadius_mm, rings)) {
    TruthExtras extras;
    extras.vertex_normals = &vertex_normals;
    truth = ComputeTruth(wall, camera, Image8(60, 48, 1, 255), world_from_camera, nullptr, extras);
  }
  // World axes, towards the camera, of the sphere that the triangles stand for.
  Vec3d ExactNormal(int x, int y) const { return -PixelOf(truth.position, x, y).normalized(); }
  Vec3d ToWorld(const ImageF& normals, int x, int y) const {
    return world_from_camera.linear() * PixelOf(normals, x, y);
  }
};

struct WorstNormals {
  double smooth = 0, flat = 0;
};

WorstNormals WorstOn(const SphereView& view) {
  WorstNormals worst;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 60; ++x) {
      if (std::isnan(*view.truth.z.Pixel(x, y))) continue;
      const Vec3d exact = view.ExactNormal(x, y);
      const Vec3d smooth = view.ToWorld(view.truth.smooth_normal, x, y);
      EXPECT_NEAR(smooth.norm(), 1, 1e-6);
      worst.smooth = std::max(worst.smooth, (smooth - exact).norm());
      worst.flat = std::max(worst.flat, (view.ToWorld(view.truth.normal, x, y) - exact).norm());
    }
  }
  return worst;
}

// A triangle's normal is off in proportion to its size, the interpolated one in proportion to its square.
TEST(TruthChannels, SmoothNormalConvergesToTheSmoothWalls) {
  const WorstNormals coarse = WorstOn(SphereView(40)), fine = WorstOn(SphereView(160));
  EXPECT_LT(coarse.smooth, 0.1 * coarse.flat);
  EXPECT_LT(fine.smooth, coarse.smooth / 10);
  EXPECT_GT(fine.flat, coarse.flat / 6);
}

// With a coat, the normal of the relief, whose height coat.h gives: against its finite differences.
TEST(TruthChannels, ShadingNormalFollowsTheRelief) {
  const SphereView view(160);
  const CoatOptions options{1.37, 0.2, 2, 0.2, std::nullopt};
  Surface surface;
  EXPECT_EQ(
      ShadingNormalMap(surface, kSeed, view.wall.anchor(), view.world_from_camera, view.truth).data.size(),
      view.truth.smooth_normal.data.size());
  surface.coat.emplace(options);
  const ImageF found =
      ShadingNormalMap(surface, kSeed, view.wall.anchor(), view.world_from_camera, view.truth);
  const auto height = [&](const Vec3d& place) {
    const Vec3f p = (place / options.relief_mm).cast<float>();
    return options.relief_height_mm *
           (GradientNoise(kSeed + kReliefSeeds, p) + 0.5 * GradientNoise(kSeed + kReliefSeeds + 1, 2 * p)) /
           1.5;
  };
  double tilt = 0;
  int count = 0;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 60; ++x) {
      if (std::isnan(*view.truth.z.Pixel(x, y))) continue;
      const Vec3d place = PixelOf(view.truth.position, x, y), smooth = view.ExactNormal(x, y);
      Vec3d slope;
      for (int d = 0; d < 3; ++d) {
        const Vec3d step = 0.008 * Vec3d::Unit(d);
        slope[d] = (height(place + step) - height(place - step)) / 0.016;
      }
      const Vec3d expected = (smooth - slope + slope.dot(smooth) * smooth).normalized();
      const Vec3d normal = view.ToWorld(found, x, y);
      EXPECT_LT((normal - expected).norm(), 4e-3) << x << ' ' << y;
      tilt += normal.cross(smooth).norm();
      ++count;
    }
  }
  EXPECT_GT(tilt / count, 0.05);  // the relief is there to be noticed
}

class TruthChannelsTest : public testing::Test {
 protected:
  fs::path RenderTo(const std::string& name, const std::string& exact) {
    const Scene scene = ReadScene(test::WriteScene(scratch_), {"truth.exact=" + exact}, kSeed);
    Render(scene, {scratch_ / name, 0, -1, kSeed});
    return scratch_ / name;
  }
  test::ScratchFolder scratch_;
};

// What a pixel shows lies, in the frame after, where flow_next says: the sequence's own poses and camera.
TEST_F(TruthChannelsTest, FlowNextIsTheReprojection) {
  const fs::path folder = RenderTo("flow", R"(["position", "flow_next", "seen_after", "flow"])");
  const Sequence sequence = ReadSequence(folder);
  const Camera<double> camera(sequence.calibration.camera);
  int compared = 0, seen_after = 0;
  for (int frame = 0; frame < 2; ++frame) {
    const fs::path file = folder / "exact" / ("000" + std::to_string(frame) + ".exr");
    const ImageF position = Exact(file, "position"), flow = Exact(file, "flow_next");
    const ImageF seen = Exact(file, "seen_after");
    const Pose camera_from_world = sequence.frames[frame + 1].world_from_camera.inverse();
    const Image8 valid = ValidPixels(sequence.calibration);
    for (int y = 0; y < position.height; ++y) {
      for (int x = 0; x < position.width; ++x) {
        if (std::isnan(position.Pixel(x, y)[0])) continue;
        const auto there = camera.Project(camera_from_world * PixelOf(position, x, y));
        if (!there) continue;
        // Positions in the file are floats: some 40 mm at 2e-6 mm.
        EXPECT_NEAR(flow.Pixel(x, y)[0], there->x() - x, 1e-3);
        EXPECT_NEAR(flow.Pixel(x, y)[1], there->y() - y, 1e-3);
        const int u = int(std::lround(there->x())), v = int(std::lround(there->y()));
        if (u < 0 || v < 0 || u >= 60 || v >= 48 || !*valid.Pixel(u, v)) {
          EXPECT_EQ(*seen.Pixel(x, y), 0);
        }
        ++compared;
        seen_after += *seen.Pixel(x, y) == 1;
      }
    }
  }
  EXPECT_GT(compared, 3000);
  EXPECT_GT(seen_after, compared / 2);
  EXPECT_EQ(Exact(folder / "exact" / "0002.exr", "flow_next").channels, 0);
  EXPECT_EQ(Exact(folder / "exact" / "0002.exr", "flow").channels, 2);
}

// Flow forth from one view is flow back from it to the same other view.
TEST(TruthChannels, FlowNextMirrorsFlow) {
  const Mesh mesh = test::Globe(kRadius_mm, 30);
  const RayScene wall(mesh);
  const Camera<double> camera(Resized(C3vdIntrinsics(), 60, 48));
  const Image8 valid(60, 48, 1, 255);
  const Pose here = Pose::Identity(), there = Pose(Eigen::Translation3d(2, 1, -3));
  TruthExtras extras;
  extras.world_from_next = &there;
  const FrameTruth forth = ComputeTruth(wall, camera, valid, here, nullptr, extras);
  const FrameTruth back = ComputeTruth(wall, camera, valid, here, &there);
  ASSERT_FALSE(back.flow.empty());
  EXPECT_EQ(std::memcmp(forth.flow_next.data.data(), back.flow.data.data(), back.flow.data.size() * 4), 0);
  EXPECT_EQ(std::memcmp(forth.seen_after.data.data(), back.seen_before.data.data(),
                        back.seen_before.data.size() * 4),
            0);
  EXPECT_TRUE(forth.flow.empty() && forth.seen_before.empty() && back.flow_next.empty());
}

// Two faces across z, centroids (1, 1, 20) and (−3, 5, 20), by hand.
TEST(TruthChannels, VisibilityHoldsTheBestOfTheFramesThatSee) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 20}, {3, 0, 20}, {0, 3, 20}, {-4, 4, 20}, {-1, 4, 20}, {-4, 7, 20}};
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  FaceVisibility visibility(2);
  AddFrame(mesh, {1, 1, 0}, {1, 0}, &visibility);   // along the normal, 20 mm
  AddFrame(mesh, {1, 16, 5}, {1, 0}, &visibility);  // at 45°, 15√2 mm
  AddFrame(mesh, {1, 2, 19}, {0, 0}, &visibility);  // near, but sees nothing
  AddFrame(mesh, {1, 1, 18}, {1, 0}, &visibility);
  EXPECT_EQ(visibility.frames, (std::vector<int32_t>{3, 0}));
  EXPECT_EQ(visibility.incidence_rad[0], 0);
  EXPECT_FLOAT_EQ(visibility.distance_mm[0], 2);
  EXPECT_TRUE(std::isnan(visibility.incidence_rad[1]) && std::isnan(visibility.distance_mm[1]));
  AddFrame(mesh, {-3, 20, 5}, {0, 1}, &visibility);
  EXPECT_FLOAT_EQ(visibility.incidence_rad[1], float(kPi / 4));
  EXPECT_FLOAT_EQ(visibility.distance_mm[1], float(15 * std::sqrt(2.0)));
}

// A reader of binary PLY from the format's description, for a file with one list, of three, and properties
// of four bytes.
struct FaceRow {
  int32_t frames;
  float incidence_rad, distance_mm;
};

std::vector<FaceRow> ReadFaceRows(const fs::path& file) {
  const std::string bytes = ReadFile(file);
  const std::string end = "end_header\n";
  const size_t header = bytes.find(end) + end.size();
  std::istringstream lines(bytes.substr(0, header));
  size_t vertices = 0, faces = 0;
  std::string faces_properties;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("element vertex ")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
    if (faces && line.starts_with("property ")) faces_properties += line.substr(9) + ";";
  }
  EXPECT_EQ(faces_properties,
            "list uchar int vertex_indices;int frames;float incidence_rad;float distance_mm;");
  const size_t row = 1 + 3 * 4 + 12, first = header + vertices * 24;
  EXPECT_EQ(bytes.size(), first + faces * row);
  std::vector<FaceRow> rows(faces);
  for (size_t i = 0; i < faces; ++i) std::memcpy(&rows[i], &bytes[first + i * row + 13], 12);
  return rows;
}

TEST_F(TruthChannelsTest, VisibilityIsWrittenOnTheMesh) {
  const fs::path folder = RenderTo("with", R"(["visibility"])"), without = RenderTo("without", R"(["z"])");
  EXPECT_FALSE(fs::exists(folder / "exact" / "0000.exr"));
  EXPECT_EQ(ReadFile(folder / "coverage_mesh.obj"), ReadFile(without / "coverage_mesh.obj"));
  const Mesh mesh = ReadMesh(folder / "exact" / "visibility.ply");
  EXPECT_EQ(mesh.vertices, ReadMesh(folder / "mesh.ply").vertices);
  const std::vector<FaceRow> rows = ReadFaceRows(folder / "exact" / "visibility.ply");
  ASSERT_EQ(rows.size(), mesh.faces.size());
  std::vector<bool> observed;
  ReadCoverageMesh(folder / "coverage_mesh.obj", &observed);
  const Sequence sequence = ReadSequence(folder);
  int by_frames[4] = {};
  for (size_t face = 0; face < rows.size(); ++face) {
    EXPECT_EQ(rows[face].frames > 0, observed[face]);
    ASSERT_LE(rows[face].frames, 3);
    ++by_frames[rows[face].frames];
    EXPECT_EQ(std::isnan(rows[face].distance_mm), rows[face].frames == 0);
    if (rows[face].frames < 3) continue;
    const Vec3i& f = mesh.faces[face];
    const Vec3d centroid = (mesh.vertices[f[0]] + mesh.vertices[f[1]] + mesh.vertices[f[2]]) / 3;
    double nearest = 1e9, widest = 0;
    for (const SequenceFrame& frame : sequence.frames) {
      const Vec3d to_camera = frame.world_from_camera.translation() - centroid;
      nearest = std::min(nearest, to_camera.norm());
      widest = std::max(widest, std::abs(to_camera.normalized().dot(FaceNormal(mesh, int(face)))));
    }
    EXPECT_NEAR(rows[face].distance_mm, nearest, 1e-4);
    EXPECT_NEAR(std::cos(rows[face].incidence_rad), widest, 1e-6);
  }
  for (const int count : by_frames) EXPECT_GT(count, 10);
  // A later render that isn't asked for it leaves none behind.
  RenderTo("with", R"(["z"])");
  EXPECT_FALSE(fs::exists(folder / "exact" / "visibility.ply"));
}

}  // namespace
}  // namespace lumen
