#include "tests/evaluation_scenes.h"

#include <array>
#include <cmath>
#include <map>

namespace lumen::test {
namespace {

Mesh Merged(const Mesh& mesh) {
  Mesh merged;
  std::map<std::array<double, 3>, int> index;
  std::vector<int> map;
  for (const Vec3d& v : mesh.vertices) {
    const auto [it, is_new] = index.insert({{v.x(), v.y(), v.z()}, static_cast<int>(merged.vertices.size())});
    if (is_new) merged.vertices.push_back(v);
    map.push_back(it->second);
  }
  for (const Vec3i& f : mesh.faces) merged.faces.push_back({map[f[0]], map[f[1]], map[f[2]]});
  return merged;
}

}  // namespace

void AddPlate(const Vec3d& corner, const Vec3d& edge_u, const Vec3d& edge_v, int n, Mesh* mesh) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) mesh->vertices.push_back(corner + edge_u * i / n + edge_v * j / n);
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = first + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      mesh->faces.push_back({a, b, d});
      mesh->faces.push_back({a, d, c});
    }
  }
}

Mesh Cube(double half_mm, int n) {
  Mesh mesh;
  // Integer coordinates first, so that vertices on common edges are the same to the bit.
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d u = Vec3d::Zero(), v = Vec3d::Zero(), w = Vec3d::Zero();
    u[(axis + 1) % 3] = v[(axis + 2) % 3] = 2 * n;
    w[axis] = n;
    const Vec3d corner = -(u + v) / 2;
    AddPlate(corner + w, u, v, n, &mesh);
    AddPlate(corner - w, v, u, n, &mesh);
  }
  mesh = Merged(mesh);
  for (Vec3d& vertex : mesh.vertices) vertex *= half_mm / n;
  return mesh;
}

Mesh Sphere(double radius_mm, int n) {
  Mesh mesh = Cube(1, n);
  for (Vec3d& vertex : mesh.vertices) vertex = radius_mm * vertex.normalized();
  return mesh;
}

Mesh Tube(double radius_mm, double length_mm, double relief_mm, int around, int along) {
  Mesh mesh;
  for (int j = 0; j <= along; ++j) {
    const double z = length_mm * j / along;
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * kPi * i / around;
      const double radius = radius_mm + relief_mm * std::sin(4 * angle) * std::sin(2 * kPi * z / 40);
      mesh.vertices.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  }
  const auto at = [&](int i, int j) { return j * around + i % around; };
  for (int j = 0; j < along; ++j) {
    for (int i = 0; i < around; ++i) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  const int near = static_cast<int>(mesh.vertices.size()), far = near + 1;
  mesh.vertices.push_back({0, 0, 0});
  mesh.vertices.push_back({0, 0, length_mm});
  for (int i = 0; i < around; ++i) {
    mesh.faces.push_back({near, at(i + 1, 0), at(i, 0)});
    mesh.faces.push_back({far, at(i, along), at(i + 1, along)});
  }
  return mesh;
}

Mesh Soup(const Mesh& mesh) {
  Mesh soup;
  for (const Vec3i& face : mesh.faces) {
    const int first = static_cast<int>(soup.vertices.size());
    for (int corner : face) soup.vertices.push_back(mesh.vertices[corner]);
    soup.faces.push_back({first, first + 1, first + 2});
  }
  return soup;
}

Sequence PinholeSequence(const std::vector<Pose>& world_from_camera, double half_field_deg) {
  Sequence sequence;
  CameraIntrinsics& camera = sequence.calibration.camera;
  camera.model = CameraModel::kPinhole;
  camera.width = camera.height = 200;
  camera.cx = camera.cy = 99.5;
  camera.fx = camera.fy = 100 / std::tan(half_field_deg * kPi / 180);
  sequence.calibration.light.sources.resize(1);
  for (const Pose& pose : world_from_camera) {
    SequenceFrame frame;
    frame.number = static_cast<int>(sequence.frames.size());
    frame.world_from_camera = pose;
    sequence.frames.push_back(frame);
  }
  return sequence;
}

Pose At(double x_mm, double y_mm, double z_mm) { return Pose(Eigen::Translation3d(x_mm, y_mm, z_mm)); }

}  // namespace lumen::test
