// Triangle meshes and their files: PLY, OBJ, OFF, STL.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/math.h"

namespace lumen {

struct Mesh {
  std::vector<Vec3d> vertices;                 // mm, world axes
  std::vector<Vec3i> faces;                    // indices of vertices
  std::vector<std::array<uint8_t, 3>> colors;  // one a vertex, or none at all
};

// Any of PLY, OBJ, OFF, STL, whatever its topology (a triangle soup is read as it stands; polygons are cut
// into fans; STL's repeated corners are merged). Coordinates keep the digits that the file has, up to double.
// Throws InputError naming the file and the place: unreadable, no faces, an index out of range, a coordinate
// not finite.
Mesh ReadMesh(const std::filesystem::path& file);

// The extension chooses the format; all but STL, which is float, keep every digit. Only PLY and OBJ have
// colours. Whole or not at all. Throws InputError.
void WriteMesh(const std::filesystem::path& file, const Mesh& mesh);

// C3VD's coverage_mesh.obj: the faces' vt index is 1 = observed, 2 = unobserved. `observed` has an entry a
// face.
void WriteCoverageMesh(const std::filesystem::path& file, const Mesh& mesh,
                       const std::vector<bool>& observed);
// Empty where the file doesn't say.
Mesh ReadCoverageMesh(const std::filesystem::path& file, std::vector<bool>* observed);

// Smallest axis-aligned box around the vertices.
Eigen::AlignedBox3d Bounds(const Mesh& mesh);

// mm², double. Zero-area faces count 0.
double FaceArea(const Mesh& mesh, int face);

// Unit normal of a face by the right-hand rule; zero for a face without area.
Vec3d FaceNormal(const Mesh& mesh, int face);

// Unit normals at the vertices, the adjoining faces' weighted by their angles; zero where there is no such
// face.
std::vector<Vec3d> VertexNormals(const Mesh& mesh);

}  // namespace lumen
