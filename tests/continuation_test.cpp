#include "recon/surface/continuation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "common/random.h"
#include "recon/surface/extract.h"

namespace lumen {
namespace {

// An elliptic tube about a middle that bends: straight along −z behind the origin, on a parabola ahead of it.
struct Tube {
  double radius_mm = 18, ellipse_mm = 2, bend_per_mm = 0.008;
  double fold_mm = 0;  // every 14 mm, all around

  Vec2d Middle(double z) const { return {2 + bend_per_mm / 2 * std::pow(std::max(z, 0.0), 2), -1}; }
  double Radius(double azimuth) const { return radius_mm + ellipse_mm * std::cos(2 * (azimuth - 0.4)); }
  double Distance(const Vec3d& place) const {
    const Vec2d off = place.head<2>() - Middle(place.z());
    return Radius(std::atan2(off.y(), off.x())) - off.norm();
  }
  Vec3d Wall(double azimuth, double z) const {
    const double fold = fold_mm * std::pow(std::max(0.0, std::cos(2 * kPi * z / 14)), 4);
    const Vec2d across = Middle(z) + (Radius(azimuth) - fold) * Vec2d(std::cos(azimuth), std::sin(azimuth));
    return {across.x(), across.y(), z};
  }
};

double Uniform(uint64_t stream, int i) { return UniformDouble(RandomBits(stream, static_cast<uint64_t>(i))); }

// What cameras of a wide view see: of each direction around, the wall from some way ahead of them on.
double FirstSeen(double azimuth) { return 4 + 3 * std::cos(azimuth) * std::cos(azimuth); }

std::vector<WallPoint> Points(const Tube& tube, double around = 2 * kPi) {
  std::vector<WallPoint> points;
  for (int i = 0; i < 6000; ++i) {
    const double azimuth = around * Uniform(1, i);
    points.push_back({tube.Wall(azimuth, FirstSeen(azimuth) + 60 * Uniform(2, i)), 1});
  }
  return points;
}

std::vector<Pose> Cameras(double turn = 0) {
  std::vector<Pose> cameras;
  for (int i = 0; i < 5; ++i) {
    Pose pose = Pose::Identity();
    pose.translation() = Vec3d(1, 0.5, 4.0 * i);
    pose.rotate(Eigen::AngleAxisd(turn * i, Vec3d::UnitX()));
    cameras.push_back(pose);
  }
  return cameras;
}

TEST(Continuation, GoesOnAsTheTubeThatIsSeen) {
  const Tube tube;
  const auto continuation = Continuation::Fit(Points(tube), Cameras());
  ASSERT_TRUE(continuation);
  double worst = 0;
  for (int i = 0; i < 2000; ++i) {
    const double azimuth = 2 * kPi * Uniform(3, i), z = -14 * Uniform(4, i), off = 10 + 20 * Uniform(5, i);
    const Vec2d middle = tube.Middle(z);
    const Vec3d place(middle.x() + off * std::cos(azimuth), middle.y() + off * std::sin(azimuth), z);
    const double distance = continuation->Blend(place, -1e3);
    if (FirstSeen(azimuth) - z < Continuation::kSeam_mm + 4)
      continue;  // the frontier's sectors are 4 mm high
    worst = std::max(worst, std::abs(distance - tube.Distance(place)));
  }
  // The pull on the bend, a hundredth beside the mean square of the points' (z / 30 mm)², 0.2 · cos², leaves
  // up to a tenth of 3.6 mm at 30 mm and as much, the other way, at 0; that on the ellipse 2% of 2 mm.
  EXPECT_LT(worst, 0.76);
  EXPECT_GT(worst, 0);
}

TEST(Continuation, FoldsAreNotTheTube) {
  Tube tube;
  tube.fold_mm = 5;
  const auto continuation = Continuation::Fit(Points(tube), Cameras());
  ASSERT_TRUE(continuation);
  double sum = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec3d wall = Tube().Wall(2 * kPi * Uniform(6, i), -8 - 6 * Uniform(7, i));
    sum += continuation->Blend(wall, 0);
  }
  // Folds stand on 0.4 of the way and take 1.9 mm in the mean; Huber's estimate takes fewer.
  EXPECT_LT(std::abs(sum / 500), 1.5);
}

TEST(Continuation, WhatIsSeenStaysAsItIsLearnt) {
  const Tube tube;
  const auto continuation = Continuation::Fit(Points(tube), Cameras());
  ASSERT_TRUE(continuation);
  for (const WallPoint& point : Points(tube)) {
    if (point.place.z() < 5) continue;  // the rearmost 0.2% may be strays
    EXPECT_EQ(continuation->Blend(point.place, 0.25), 0.25);
  }
  // Without a step where the one gives way to the other.
  double before = 0;
  for (double z = 10; z > -15; z -= 0.01) {
    const double value = continuation->Blend(Vec3d(15, 3, z), -4);
    if (z < 10) {
      EXPECT_LT(std::abs(value - before), 0.05) << z;
    }
    before = value;
  }
}

TEST(Continuation, NothingGoesOnWhereThereIsNoTube) {
  const Tube tube;
  EXPECT_TRUE(Continuation::Fit(Points(tube), Cameras()));
  EXPECT_TRUE(Continuation::Fit(Points(tube, 1.7 * kPi), Cameras())) << "a part behind a fold";
  EXPECT_FALSE(Continuation::Fit(Points(tube, kPi), Cameras())) << "half a wall";
  EXPECT_FALSE(Continuation::Fit(Points(tube), Cameras(1.5))) << "cameras that look everywhere";
  EXPECT_FALSE(Continuation::Fit({}, Cameras()));
  EXPECT_FALSE(Continuation::Fit(Points(tube), {}));
  auto outside = Cameras();
  outside.front().translation() = Vec3d(30, 0, -10);
  EXPECT_FALSE(Continuation::Fit(Points(tube), outside)) << "a camera in the wall";
}

// A field whose networks say nothing, in a box that a continued tube fits in: its surface is a tube about the
// cameras' path.
struct EmptyField {
  EmptyField(double radius_mm, double reach_mm, const std::vector<Pose>& cameras)
      : options(Options(radius_mm, reach_mm)),
        field(options, InitialSurface(options.initial, cameras, Vec3d::Zero()),
              {Vec3d(-30, -30, -45), Vec3d(30, 30, 80)}),
        nothing(field.parameter_count(), 0.0f) {}
  static FieldOptions Options(double radius_mm, double reach_mm) {
    FieldOptions options;
    options.grid.levels = 2;
    options.grid.log2_table_size = 8;
    options.initial.radius_mm = radius_mm;
    options.initial.reach_mm = reach_mm;
    return options;
  }
  Mesh Extract(const ExtractOptions& extract) const {
    return ExtractMesh(field, nothing.data(), Vec3d::Zero(), extract);
  }
  FieldOptions options;
  Field<float> field;
  std::vector<float> nothing;
};

TEST(Continuation, MeshGoesOnAndIsClosed) {
  // The field's surface is a capsule of radius 18 that ends 18 mm behind the cameras.
  const EmptyField capsule(18, 40, Cameras());
  Tube tube;
  tube.bend_per_mm = tube.ellipse_mm = 0;
  const auto continuation = Continuation::Fit(Points(tube), Cameras());
  ASSERT_TRUE(continuation);
  const auto lowest = [](const Mesh& mesh) {
    double z = 1e9;
    for (const Vec3d& vertex : mesh.vertices) z = std::min(z, vertex.z());
    return z;
  };
  ExtractOptions extract;
  extract.cell_mm = 1.5;
  const Mesh without = capsule.Extract(extract);
  extract.continuation = &*continuation;
  const Mesh with = capsule.Extract(extract);
  EXPECT_NEAR(lowest(without), -18, 1.5);
  // Seen from 4 mm on; half a ball of 18 mm after 20 mm of tube.
  EXPECT_NEAR(lowest(with), 4 - Continuation::kReach_mm - 18, 1.5);
  std::set<std::pair<int, int>> edges;
  for (const Vec3i& f : with.faces)
    for (int k = 0; k < 3; ++k) EXPECT_TRUE(edges.insert({f[k], f[(k + 1) % 3]}).second);
  for (const auto& [from, to] : edges) EXPECT_TRUE(edges.count({to, from}));
}

// A small lumen far ahead, and the tube by itself, which is larger: the one that is kept is around the places
// inside.
TEST(Continuation, MeshIsTheWallAroundThePlacesInside) {
  Pose far = Pose::Identity();
  far.translation() = Vec3d(0, 0, 60);
  const EmptyField small(6, 4, {far});
  const auto continuation = Continuation::Fit(Points(Tube()), Cameras());
  ASSERT_TRUE(continuation);
  ExtractOptions extract;
  extract.cell_mm = 1.5;
  extract.continuation = &*continuation;
  const auto middle = [&] {
    const Mesh mesh = small.Extract(extract);
    Eigen::AlignedBox3d bounds;
    for (const Vec3d& vertex : mesh.vertices) bounds.extend(vertex);
    return bounds.center().z();
  };
  EXPECT_LT(middle(), 0);  // the largest
  extract.inside = {far.translation()};
  EXPECT_NEAR(middle(), 62, 1);
  extract.inside = {Vec3d(0, 0, 30)};  // in neither: what rays meet there they would leave the wall by
  EXPECT_LT(middle(), 0);
}

}  // namespace
}  // namespace lumen
