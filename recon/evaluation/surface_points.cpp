#include "recon/evaluation/surface_points.h"

#include <algorithm>
#include <cmath>

#include "common/random.h"

namespace lumen {

std::vector<SurfacePoint> SpreadPoints(const Mesh& mesh, int count, uint64_t seed) {
  std::vector<double> area_up_to(mesh.faces.size());
  double total = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    area_up_to[f] = total += FaceArea(mesh, static_cast<int>(f));
  }
  std::vector<SurfacePoint> points(count);
  for (int i = 0; i < count; ++i) {
    const double at = total * (i + UniformDouble(RandomBits(seed, i, 0))) / count;
    // upper_bound passes over faces without area; rounding may place `at` on the total, which is the last
    // face's.
    const auto found = std::upper_bound(area_up_to.begin(), area_up_to.end(), at);
    const int face =
        static_cast<int>(std::min<int64_t>(found - area_up_to.begin(), int64_t(area_up_to.size()) - 1));
    // Uniform on the triangle: Osada et al., "Shape distributions", 2002, eq. 1.
    const double root = std::sqrt(UniformDouble(RandomBits(seed, i, 1)));
    const double v = UniformDouble(RandomBits(seed, i, 2));
    const Vec3i& corners = mesh.faces[face];
    points[i].position = (1 - root) * mesh.vertices[corners[0]] + root * (1 - v) * mesh.vertices[corners[1]] +
                         root * v * mesh.vertices[corners[2]];
    points[i].face = face;
  }
  return points;
}

}  // namespace lumen
