#include "sim/geometry/clearance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/parallel.h"

namespace lumen {

Clearance::Clearance(const Mesh& mesh) : mesh_(mesh) {
  balls_.reserve(mesh.faces.size());
  for (const Vec3i& face : mesh.faces) {
    const Vec3d centre = (mesh.vertices[face[0]] + mesh.vertices[face[1]] + mesh.vertices[face[2]]) / 3;
    double radius = 0;
    for (int corner : face) radius = std::max(radius, (mesh.vertices[corner] - centre).norm());
    balls_.push_back({centre, radius});
  }
}

Clearance::Nearest Clearance::At(const Vec3d& place) const {
  Nearest nearest = {std::numeric_limits<double>::infinity(), Vec3d::Zero()};
  for (size_t f = 0; f < balls_.size(); ++f) {
    const double reach = nearest.distance_mm + balls_[f].radius_mm;
    if ((place - balls_[f].centre).squaredNorm() > reach * reach) continue;
    const Vec3i& face = mesh_.faces[f];
    const Vec3d point = NearestPointOfTriangle(place, mesh_.vertices[face[0]], mesh_.vertices[face[1]],
                                               mesh_.vertices[face[2]]);
    const double distance = (place - point).norm();
    if (distance < nearest.distance_mm) nearest = {distance, point};
  }
  return nearest;
}

bool Clearance::Encloses(const Vec3d& place) const {
  double solid_angle = 0;
  for (const Vec3i& face : mesh_.faces) {
    const Vec3d a = mesh_.vertices[face[0]] - place, b = mesh_.vertices[face[1]] - place,
                c = mesh_.vertices[face[2]] - place;
    const double na = a.norm(), nb = b.norm(), nc = c.norm();
    solid_angle +=
        2 * std::atan2(a.dot(b.cross(c)), na * nb * nc + a.dot(b) * nc + b.dot(c) * na + c.dot(a) * nb);
  }
  return std::abs(solid_angle) > 2 * kPi;  // ±4π inside, 0 outside
}

std::vector<double> Clearance::WithinBy(const std::vector<Vec3d>& path) const {
  std::vector<double> within_mm(path.size());
  ParallelFor(0, static_cast<int64_t>(path.size()),
              [&](int64_t i) { within_mm[i] = At(path[i]).distance_mm; });
  for (size_t i = 0; i < path.size(); ++i) {
    // No wall lies between a place and another that is nearer to it than the wall.
    const bool same_side = i > 0 && (path[i] - path[i - 1]).norm() < std::abs(within_mm[i - 1]);
    const bool inside = same_side ? within_mm[i - 1] > 0 : Encloses(path[i]);
    if (!inside) within_mm[i] = -within_mm[i];
  }
  return within_mm;
}

double ClearanceKey(const ConfigTable& trajectory) {
  return trajectory.Number("clearance_mm", 3, kNotNegative);
}

Vec3d NearestPointOfTriangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 > d3 ? d1 / (d1 - d3) : 0);
  const Vec3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 > d6 ? d2 / (d2 - d6) : 0);
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double along = (d4 - d3) + (d5 - d6);
    return b + (c - b) * (along > 0 ? (d4 - d3) / along : 0);
  }
  const double area = va + vb + vc;
  return a + ab * (vb / area) + ac * (vc / area);
}

}  // namespace lumen
