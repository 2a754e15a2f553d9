// How often, how steeply and how closely a sequence's frames see each face of the wall.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/mesh.h"

namespace lumen {

// One entry a face; angle and distance are NaN for a face that no frame sees.
struct FaceVisibility {
  std::vector<int32_t> frames;       // that see it
  std::vector<float> incidence_rad;  // smallest, over those frames, of the angle between the face's normal
                                     // and the direction from its centroid to the camera, 0…π/2
  std::vector<float> distance_mm;    // smallest, over those frames, from its centroid to the camera

  explicit FaceVisibility(size_t faces);
};

// Adds a frame: `seen` is 1 for the faces that it sees (MarkObserved), camera_mm where it stands, `mesh` the
// wall at its moment.
void AddFrame(const Mesh& mesh, const Vec3d& camera_mm, const std::vector<uint8_t>& seen,
              FaceVisibility* visibility);

// A PLY of the mesh whose faces have the properties frames (int), incidence_rad and distance_mm (float).
void WriteFaceVisibility(const std::filesystem::path& file, const Mesh& mesh,
                         const FaceVisibility& visibility);

}  // namespace lumen
