#include "sim/ground_truth.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <variant>
#include <vector>

#include "common/parallel.h"

namespace lumen {
namespace {

CameraIntrinsics Pinhole(int width, int height, double focal_px) {
  CameraIntrinsics intrinsics;
  intrinsics.width = width;
  intrinsics.height = height;
  intrinsics.fx = intrinsics.fy = focal_px;
  intrinsics.cx = width / 2.0 - 0.27;  // no ray along a symmetry of the scenes below
  intrinsics.cy = height / 2.0 - 0.61;
  return intrinsics;
}

Image8 AllValid(const Camera<double>& camera) {
  return Image8(camera.intrinsics().width, camera.intrinsics().height, 1, 255);
}

Pose At(const Vec3d& position, const Vec3d& axis = Vec3d::UnitZ(), double angle_rad = 0) {
  return Eigen::Translation3d(position) * Eigen::AngleAxisd(angle_rad, axis.normalized());
}

// A camera at `eye` whose axis goes through `target`.
Pose LookAt(const Vec3d& eye, const Vec3d& target) {
  return Eigen::Translation3d(eye) * Eigen::Quaterniond::FromTwoVectors(Vec3d::UnitZ(), target - eye);
}

// A tube with folds around z, 80 mm long, closed by fans; normals point away from the lumen.
Mesh FoldedTube(int around, int along) {
  Mesh mesh;
  for (int i = 0; i <= along; ++i) {
    const double z = 80.0 * i / along - 40;
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * kPi * (j + 0.3 * (i % 2)) / around;
      const double radius = 14 + 5 * std::sin(0.5 * z) + std::cos(3 * angle);
      mesh.vertices.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  }
  const int ends = static_cast<int>(mesh.vertices.size());
  mesh.vertices.push_back({0.1, 0.2, -41});
  mesh.vertices.push_back({0.1, 0.2, 41});
  for (int j = 0; j < around; ++j) {
    const int next = (j + 1) % around;
    for (int i = 0; i < along; ++i) {
      const int a = i * around + j, b = i * around + next;
      mesh.faces.push_back({a, b, a + around});
      mesh.faces.push_back({b, b + around, a + around});
    }
    mesh.faces.push_back({ends, next, j});
    mesh.faces.push_back({ends + 1, along * around + j, along * around + next});
  }
  return mesh;
}

// A rectangle across z; its normal is +z (away from a camera that looks along z), or −z.
void AddPlate(Mesh* mesh, double x0, double x1, double y0, double y1, double z, bool toward_camera = false) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (const Vec3d& corner : {Vec3d(x0, y0, z), Vec3d(x1, y0, z), Vec3d(x1, y1, z), Vec3d(x0, y1, z)}) {
    mesh->vertices.push_back(corner);
  }
  for (const Vec3i& face : {Vec3i(0, 1, 2), Vec3i(0, 2, 3)}) {
    const Vec3i corners = face.array() + first;
    mesh->faces.push_back(toward_camera ? Vec3i(corners.reverse()) : corners);
  }
}

struct ExactHit {
  int face = -1;
  double distance_mm = 0;
};

// Rays against triangles in exact rational arithmetic, intersection points included.
class ExactScene {
 public:
  explicit ExactScene(const Mesh& mesh) {
    const auto point = [&](int i) { return ToPoint(mesh.vertices[i]); };
    for (const Vec3i& f : mesh.faces) triangles_.emplace_back(point(f[0]), point(f[1]), point(f[2]));
    tree_.rebuild(triangles_.begin(), triangles_.end());
  }

  ExactHit Intersect(const Vec3d& origin, const Vec3d& direction) const {
    const Kernel::Point_3 start = ToPoint(origin);
    const Kernel::Ray_3 ray(start, Kernel::Vector_3(direction.x(), direction.y(), direction.z()));
    std::vector<Tree::Intersection_and_primitive_id<Kernel::Ray_3>::Type> met;
    tree_.all_intersections(ray, std::back_inserter(met));
    ExactHit nearest;
    std::optional<Kernel::FT> least;
    for (const auto& [intersection, triangle] : met) {
      const auto* point = boost::get<Kernel::Point_3>(&intersection);
      if (!point) continue;  // within the triangle's plane
      const Kernel::FT squared = CGAL::squared_distance(start, *point);
      if (least && squared >= *least) continue;
      least = squared;
      nearest = {int(triangle - triangles_.begin()), std::sqrt(CGAL::to_double(squared))};
    }
    return nearest;
  }

 private:
  using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
  using Triangles = std::vector<Kernel::Triangle_3>;
  using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
  using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
  static Kernel::Point_3 ToPoint(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }
  Triangles triangles_;
  Tree tree_;
};

struct Comparison {
  int pixels = 0, other_face = 0;
  double worst_mm = 0;      // of the distance, whichever face
  double worst_normal = 0;  // where the face is the same
};

Comparison CompareWithExact(const FrameTruth& truth, const Mesh& mesh, const Camera<double>& camera,
                            const Pose& world_from_camera) {
  const ExactScene exact(mesh);
  Comparison result;
  for (int y = 0; y < truth.z.height; ++y) {
    for (int x = 0; x < truth.z.width; ++x) {
      const Vec3d ray = *camera.Unproject(Vec2d(x, y));
      const ExactHit hit = exact.Intersect(world_from_camera.translation(), world_from_camera.linear() * ray);
      ++result.pixels;
      const Vec3d normal = world_from_camera.linear().transpose() * FaceNormal(mesh, hit.face);
      const Vec3d found = Eigen::Map<const Vec3f>(truth.normal.Pixel(x, y)).cast<double>();
      EXPECT_LT(found.dot(ray), 0);
      const double difference = std::min((found - normal).norm(), (found + normal).norm());
      result.worst_mm = std::max(result.worst_mm, std::abs(*truth.distance.Pixel(x, y) - hit.distance_mm));
      EXPECT_NEAR(*truth.z.Pixel(x, y), hit.distance_mm * ray.z(), 1e-4);
      if (difference > 1e-3) {
        ++result.other_face;
      } else {
        result.worst_normal = std::max(result.worst_normal, difference);
      }
    }
  }
  return result;
}

TEST(GroundTruth, DepthAndNormalAgreeWithExactIntersections) {
  const Mesh mesh = FoldedTube(24, 30);
  const RayScene wall(mesh);
  const Camera<double> camera(Resized(C3vdIntrinsics(), 80, 64));
  const Pose pose = At({2.1, -1.3, -20.7}, {1, 2, 0.5}, 0.3);
  const FrameTruth truth = ComputeTruth(wall, camera, AllValid(camera), pose, nullptr);
  const Comparison found = CompareWithExact(truth, mesh, camera, pose);
  EXPECT_EQ(found.pixels, 80 * 64);
  EXPECT_LE(found.other_face, 5);   // ties on an edge
  EXPECT_LT(found.worst_mm, 1e-5);  // what rounding to float leaves
  EXPECT_LT(found.worst_normal, 1e-6);
  EXPECT_TRUE(truth.flow.empty());
  EXPECT_TRUE(truth.seen_before.empty());

  // A pose off by a thousandth of a millimetre must show.
  Pose moved = pose;
  moved.translation().x() += 1e-3;
  const FrameTruth other = ComputeTruth(wall, camera, AllValid(camera), moved, nullptr);
  EXPECT_GT(std::abs(*other.distance.Pixel(70, 30) - *truth.distance.Pixel(70, 30)), 1e-4);
}

TEST(GroundTruth, NothingWhereThereIsNoSurfaceOrNoRay) {
  Mesh mesh;
  AddPlate(&mesh, -5, 5, -5, 5, 20);
  const RayScene wall(mesh);
  const Camera<double> camera(Pinhole(32, 24, 20));
  Image8 valid = AllValid(camera);
  *valid.Pixel(16, 12) = 0;
  const Pose pose = Pose::Identity();
  const FrameTruth truth = ComputeTruth(wall, camera, valid, pose, &pose);
  for (const int x : {0, 16}) {
    EXPECT_TRUE(std::isnan(*truth.z.Pixel(x, 12)));
    EXPECT_TRUE(std::isnan(truth.normal.Pixel(x, 12)[1]));
    EXPECT_TRUE(std::isnan(truth.flow.Pixel(x, 12)[0]));
    EXPECT_TRUE(std::isnan(*truth.seen_before.Pixel(x, 12)));
    EXPECT_EQ(*truth.occlusion.Pixel(x, 12), 0);
  }
  EXPECT_FLOAT_EQ(*truth.z.Pixel(17, 12), 20);
  EXPECT_FLOAT_EQ(truth.normal.Pixel(17, 12)[2], -1);
  EXPECT_EQ(*truth.seen_before.Pixel(17, 12), 1);
}

TEST(GroundTruth, FlowIsTheReprojection) {
  const Mesh mesh = FoldedTube(24, 30);
  const RayScene wall(mesh);
  const CameraIntrinsics k = Pinhole(64, 48, 30);
  const Camera<double> camera(k);
  const Pose pose = At({2, -1, -20}, {1, 2, 0.5}, 0.3), previous = At({1.5, -0.5, -18}, {1, 2, 0}, 0.33);
  const FrameTruth truth = ComputeTruth(wall, camera, AllValid(camera), pose, &previous);
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const double z = *truth.z.Pixel(x, y);
      const Eigen::Vector4d here((x - k.cx) / k.fx * z, (y - k.cy) / k.fy * z, z, 1);
      const Eigen::Vector4d there = previous.matrix().inverse() * pose.matrix() * here;
      EXPECT_NEAR((pose.matrix() * here -
                   Eigen::Map<const Vec3f>(truth.position.Pixel(x, y)).cast<double>().homogeneous())
                      .norm(),
                  0, 1e-5);
      if (there.z() <= 0) {
        EXPECT_TRUE(std::isnan(truth.flow.Pixel(x, y)[0]));
        EXPECT_EQ(*truth.seen_before.Pixel(x, y), 0);
        continue;
      }
      const double u = k.fx * there.x() / there.z() + k.cx, v = k.fy * there.y() / there.z() + k.cy;
      EXPECT_NEAR(truth.flow.Pixel(x, y)[0], u - x, 1e-5 * (1 + std::abs(u)));
      EXPECT_NEAR(truth.flow.Pixel(x, y)[1], v - y, 1e-5 * (1 + std::abs(v)));
      if (u < -0.5 || u > k.width - 0.5 || v < -0.5 || v > k.height - 0.5) {
        EXPECT_EQ(*truth.seen_before.Pixel(x, y), 0);
      }
    }
  }
}

// A plate at z = 20 before a wall at z = 40, seen from two places.
TEST(GroundTruth, SeenBeforeWhereThePlateLetsThrough) {
  Mesh mesh;
  AddPlate(&mesh, -5, 5, -5, 5, 20);
  AddPlate(&mesh, -90, 90, -90, 90, 40);
  const RayScene wall(mesh);
  const CameraIntrinsics k = Pinhole(160, 120, 90);
  const Camera<double> camera(k);
  Image8 valid = AllValid(camera);
  for (int y = 0; y < 10; ++y) std::fill_n(valid.Pixel(0, y), k.width, uint8_t{0});
  const Pose pose = Pose::Identity(), previous = At({8, 0, 0});
  const FrameTruth truth = ComputeTruth(wall, camera, valid, pose, &previous);
  int hidden = 0, seen = 0, outside = 0;
  for (int y = 10; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const double across = (x - k.cx) / k.fx, down = (y - k.cy) / k.fy;
      const bool on_plate = std::abs(20 * across) < 5 && std::abs(20 * down) < 5;
      const double z = on_plate ? 20 : 40, X = across * z, Y = down * z;
      EXPECT_FLOAT_EQ(*truth.z.Pixel(x, y), float(z));
      const double u = (X - 8) / z * k.fx + k.cx, v = Y / z * k.fy + k.cy;
      const bool inside = u > -0.5 && u < k.width - 0.5 && v > 9.5 && v < k.height - 0.5;
      const bool blocked = !on_plate && std::abs((X + 8) / 2) < 5 && std::abs(Y / 2) < 5;
      EXPECT_EQ(*truth.seen_before.Pixel(x, y), inside && !blocked) << x << ' ' << y;
      ++(!inside ? outside : blocked ? hidden : seen);
    }
  }
  EXPECT_GT(hidden, 500);
  EXPECT_GT(outside, 1000);
  EXPECT_GT(seen, 5000);
}

// A blocker only 0.01 mm before the wall hides a strip of 0.0075 mm, which a hundred pixels of a telescope
// show. Its far edge is there to what float rays can tell (0.0001 mm): triangle numbers or a coarse tolerance
// wouldn't see it.
TEST(GroundTruth, SeenBeforeTellsAHundredthOfAMillimetre) {
  const double gap = 0.01;
  Mesh mesh;
  AddPlate(&mesh, -40, 0, -30, 30, 40 - gap);
  AddPlate(&mesh, -40, 40, -30, 30, 40);
  const RayScene wall(mesh);
  const Camera<double> camera(Pinhole(400, 8, 5e5));
  const Pose pose = LookAt({30, 0.7, 0}, {0, 0.7, 40}), previous = LookAt({-30, 0.7, 0}, {0, 0.7, 40});
  const FrameTruth truth = ComputeTruth(wall, camera, AllValid(camera), pose, &previous);
  int hidden = 0, seen = 0;
  for (int y = 2; y < 6; ++y) {
    for (int x = 0; x < 400; ++x) {
      const Vec3d ray = pose.linear() * *camera.Unproject(Vec2d(x, y));
      const Vec3d place = pose.translation() + 40 / ray.z() * ray;
      if (pose.translation().x() + (40 - gap) / ray.z() * ray.x() < 1e-4) continue;  // on the blocker
      const double edge = gap * 30 / 40;
      if (std::abs(place.x() - edge) < 3e-4) continue;
      EXPECT_EQ(*truth.seen_before.Pixel(x, y), place.x() > edge) << place.x();
      ++(place.x() > edge ? seen : hidden);
    }
  }
  EXPECT_GT(hidden, 100);
  EXPECT_GT(seen, 100);
}

// No place hides itself, be the previous view as flat as can be: a plate of many triangles, far from the
// origin.
TEST(GroundTruth, NothingHidesItself) {
  Mesh mesh;
  const Vec3d offset(1e4, -2e4, 3e4);
  for (int i = 0; i < 40; ++i) {
    for (int j = 0; j < 40; ++j) AddPlate(&mesh, i - 20.1, i - 19.1, j - 20.2, j - 19.2, 40);
  }
  for (Vec3d& vertex : mesh.vertices) vertex += offset;
  const RayScene wall(mesh);
  CameraIntrinsics wide = Pinhole(160, 120, 80);
  const Camera<double> camera(wide);
  const Pose pose = At(offset);
  for (const double height : {20.0, 1.0, 0.05}) {
    const Pose previous = LookAt(offset + Vec3d(-60, 1, 40 - height), offset + Vec3d(0, 0, 40));
    const FrameTruth truth = ComputeTruth(wall, camera, AllValid(camera), pose, &previous);
    int seen = 0, hits = 0;
    for (int y = 0; y < wide.height; ++y) {
      for (int x = 0; x < wide.width; ++x) {
        if (std::isnan(*truth.z.Pixel(x, y))) continue;
        ++hits;
        const auto p = camera.Project(previous.inverse() *
                                      Eigen::Map<const Vec3f>(truth.position.Pixel(x, y)).cast<double>());
        if (!p || p->x() < 0 || p->y() < 0 || p->x() > wide.width - 1 || p->y() > wide.height - 1) continue;
        ++seen;
        EXPECT_EQ(*truth.seen_before.Pixel(x, y), 1) << height;
      }
    }
    EXPECT_GT(seen, hits / 2);
  }
}

// Behind the plate at z = 20: to the left a wall at 40; to the right a wall's back side at 30, and behind it
// a wall at 50 below the axis, one beyond the range of depth above it.
TEST(GroundTruth, OcclusionIsWallBehindThatFacesTheCamera) {
  Mesh mesh;
  AddPlate(&mesh, -90, 90, -90, 90, 20);
  AddPlate(&mesh, -90, 0, -90, 90, 40);
  AddPlate(&mesh, 0, 90, -90, 90, 30, true);
  AddPlate(&mesh, 0, 190, 0, 190, 50);
  AddPlate(&mesh, 0, 190, -190, 0, kDepthRange_mm + 0.01);
  const RayScene wall(mesh);
  const CameraIntrinsics k = Pinhole(64, 48, 40);
  const Camera<double> camera(k);
  const auto expect = [&](const Mesh& scene, double upper_right) {
    const RayScene rays(scene);
    const FrameTruth truth = ComputeTruth(rays, camera, AllValid(camera), Pose::Identity(), nullptr);
    for (int y = 0; y < k.height; ++y) {
      for (int x = 0; x < k.width; ++x) {
        const int expected = x < k.cx || y > k.cy ? 255 : upper_right;
        EXPECT_EQ(*truth.occlusion.Pixel(x, y), expected) << x << ' ' << y;
      }
    }
  };
  expect(mesh, 0);
  for (Vec3d& vertex : mesh.vertices) {
    if (vertex.z() > kDepthRange_mm) vertex.z() = kDepthRange_mm - 0.01;
  }
  expect(mesh, 255);
}

// In a closed convex room nothing hides anything, however the faces join.
TEST(GroundTruth, ConvexRoomOccludesNothing) {
  Mesh mesh = FoldedTube(24, 30);
  for (Vec3d& vertex : mesh.vertices) {
    const double radius = 14 - 0.005 * vertex.z() * vertex.z();
    vertex.head<2>() *= radius / std::max(vertex.head<2>().norm(), 1e-9);
    if (std::abs(vertex.z()) > 40.5) vertex.head<2>().setZero();
  }
  const RayScene wall(mesh);
  const Camera<double> camera(Resized(C3vdIntrinsics(), 240, 192));
  const FrameTruth truth =
      ComputeTruth(wall, camera, AllValid(camera), At({1, 2, -20}, {1, 2, 0.5}, 0.3), nullptr);
  EXPECT_EQ(std::count(truth.occlusion.data.begin(), truth.occlusion.data.end(), 255), 0);
}

// Möller and Trumbore in double over all faces but one: whether one of them is met before t.
bool Blocked(const Mesh& mesh, size_t except, const Vec3d& origin, const Vec3d& direction, double before) {
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    if (face == except) continue;
    const Vec3i& f = mesh.faces[face];
    const Vec3d e1 = mesh.vertices[f[1]] - mesh.vertices[f[0]],
                e2 = mesh.vertices[f[2]] - mesh.vertices[f[0]];
    const Vec3d p = direction.cross(e2), s = origin - mesh.vertices[f[0]], q = s.cross(e1);
    const double determinant = e1.dot(p), u = s.dot(p) / determinant, v = direction.dot(q) / determinant;
    const double t = e2.dot(q) / determinant;
    if (u >= 0 && v >= 0 && u + v <= 1 && t > 0 && t < before) return true;
  }
  return false;
}

std::vector<uint8_t> ObservedByBruteForce(const Mesh& mesh, const CameraIntrinsics& k, const Pose& pose) {
  const ExactScene exact(mesh);
  std::vector<uint8_t> observed(mesh.faces.size(), 0);
  for (int y = 0; y < k.height; ++y) {
    for (int x = 0; x < k.width; ++x) {
      const Vec3d ray((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1);
      observed[exact.Intersect(pose.translation(), pose.linear() * ray).face] = 1;
    }
  }
  for (size_t face = 0; face < mesh.faces.size(); ++face) {
    Vec3d corners[4];
    corners[3] = Vec3d::Zero();
    for (int i = 0; i < 3; ++i) corners[3] += mesh.vertices[mesh.faces[face][i]] / 3;
    for (int i = 0; i < 3; ++i) corners[i] = mesh.vertices[mesh.faces[face][i]] * 0.999 + corners[3] * 0.001;
    for (const Vec3d& place : corners) {
      const Vec3d local = pose.inverse() * place;
      if (local.z() <= 0) continue;
      const double u = k.fx * local.x() / local.z() + k.cx, v = k.fy * local.y() / local.z() + k.cy;
      if (u < -0.5 || u > k.width - 0.5 || v < -0.5 || v > k.height - 0.5) continue;
      if (!Blocked(mesh, face, pose.translation(), place - pose.translation(), 1)) observed[face] = 1;
    }
  }
  return observed;
}

TEST(GroundTruth, ObservedFacesAgreeWithBruteForce) {
  const Mesh mesh = FoldedTube(24, 30);
  const RayScene wall(mesh);
  const CameraIntrinsics k = Pinhole(48, 36, 30);
  const Camera<double> camera(k);
  const Pose pose = At({2, -1, -20}, {1, 2, 0.5}, 0.2);
  std::vector<uint8_t> observed(mesh.faces.size(), 0);
  MarkObserved(wall, camera, AllValid(camera), pose, &observed);
  const std::vector<uint8_t> expected = ObservedByBruteForce(mesh, k, pose);
  EXPECT_EQ(observed, expected);
  const auto count = std::count(observed.begin(), observed.end(), 1);
  EXPECT_GT(count, 200);
  EXPECT_LT(count, 1200);
  // The comparison tells views apart.
  EXPECT_NE(observed, ObservedByBruteForce(mesh, k, At({2, -1, 5}, {1, 2, 0.5}, 0.2)));

  // A second view adds, an image without valid pixels nothing.
  std::vector<uint8_t> both = observed;
  MarkObserved(wall, camera, Image8(k.width, k.height, 1), At({0, 0, 10}), &both);
  EXPECT_EQ(both, observed);
  MarkObserved(wall, camera, AllValid(camera), At({0, 0, 10}), &both);
  EXPECT_GT(std::count(both.begin(), both.end(), 1), count);
}

template <class T>
bool SameBytes(const Image<T>& a, const Image<T>& b) {
  return a.data.size() == b.data.size() &&
         std::memcmp(a.data.data(), b.data.data(), a.data.size() * sizeof(T)) == 0;
}

TEST(GroundTruth, SameForAnyNumberOfThreads) {
  const Mesh mesh = FoldedTube(48, 60);
  const RayScene wall(mesh);
  const Camera<double> camera(Resized(C3vdIntrinsics(), 120, 96));
  const Pose pose = At({2, -1, -20}, {1, 2, 0.5}, 0.3), previous = At({1.5, -0.5, -18}, {1, 2, 0}, 0.33);
  FrameTruth truth[2];
  std::vector<uint8_t> observed[2];
  for (const int i : {0, 1}) {
    SetThreadCount(i + 1);
    truth[i] = ComputeTruth(wall, camera, AllValid(camera), pose, &previous);
    observed[i].resize(mesh.faces.size());
    MarkObserved(wall, camera, AllValid(camera), pose, &observed[i]);
  }
  SetThreadCount(0);
  EXPECT_TRUE(SameBytes(truth[0].z, truth[1].z));
  EXPECT_TRUE(SameBytes(truth[0].normal, truth[1].normal));
  EXPECT_TRUE(SameBytes(truth[0].position, truth[1].position));
  EXPECT_TRUE(SameBytes(truth[0].flow, truth[1].flow));
  EXPECT_TRUE(SameBytes(truth[0].seen_before, truth[1].seen_before));
  EXPECT_TRUE(SameBytes(truth[0].occlusion, truth[1].occlusion));
  EXPECT_FALSE(SameBytes(truth[0].z, truth[1].distance));
  EXPECT_EQ(observed[0], observed[1]);
}

}  // namespace
}  // namespace lumen
