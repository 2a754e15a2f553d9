#include "sim/face_visibility.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/face_properties.h"
#include "common/parallel.h"

namespace lumen {

FaceVisibility::FaceVisibility(size_t faces)
    : frames(faces, 0),
      incidence_rad(faces, std::numeric_limits<float>::quiet_NaN()),
      distance_mm(faces, std::numeric_limits<float>::quiet_NaN()) {}

void AddFrame(const Mesh& mesh, const Vec3d& camera_mm, const std::vector<uint8_t>& seen,
              FaceVisibility* visibility) {
  ParallelChunks(0, static_cast<int64_t>(mesh.faces.size()), 4096, [&](int64_t first, int64_t last) {
    for (int64_t face = first; face < last; ++face) {
      if (!seen[face]) continue;
      const Vec3i& corners = mesh.faces[face];
      const Vec3d centroid =
          (mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3;
      const Vec3d to_camera = camera_mm - centroid, normal = FaceNormal(mesh, static_cast<int>(face));
      // By its tangent: the cosine alone has no digits left where the camera looks along the normal.
      const double angle = std::atan2(normal.cross(to_camera).norm(), std::abs(normal.dot(to_camera)));
      float& incidence = visibility->incidence_rad[face];
      float& distance = visibility->distance_mm[face];
      // fmin takes the number where the other is NaN.
      incidence = std::fmin(incidence, static_cast<float>(angle));
      distance = std::fmin(distance, static_cast<float>(to_camera.norm()));
      ++visibility->frames[face];
    }
  });
}

void WriteFaceVisibility(const std::filesystem::path& file, const Mesh& mesh,
                         const FaceVisibility& visibility) {
  WriteFaceProperties(file, mesh,
                      {{"frames", visibility.frames},
                       {"incidence_rad", visibility.incidence_rad},
                       {"distance_mm", visibility.distance_mm}});
}

}  // namespace lumen
