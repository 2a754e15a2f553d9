// Numbers on the faces of a mesh, as PLY knows them: scalar properties beside vertex_indices. Readers that
// don't know a property pass over it; plyfile, trimesh and MeshLab show it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "common/mesh.h"

namespace lumen {

struct FaceProperty {
  std::string name;                                               // a word
  std::variant<std::vector<int32_t>, std::vector<float>> values;  // one a face: PLY's int or float
};

// A PLY of the mesh, whole or not at all. Throws InputError; std::logic_error where a face has no value.
void WriteFaceProperties(const std::filesystem::path& file, const Mesh& mesh,
                         const std::vector<FaceProperty>& properties);

}  // namespace lumen
