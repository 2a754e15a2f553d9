// The formats behind ReadMesh and WriteMesh, one function a format. `text` is the file's content; `file`
// stands in messages. OpenMesh's own readers and writers of PLY, OBJ and OFF pass coordinates through float,
// take damaged lines in silence and deliver uninitialised faces of truncated files, so only STL, float by
// definition, goes through OpenMesh (common/mesh.cpp).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/face_properties.h"
#include "common/mesh.h"

namespace lumen {

// All throw InputError naming the line, or the element in binary files. Indices are checked, coordinates are
// finite. texture_indices, where it isn't null, gets the vt index of each face's first corner, from 1; 0 =
// none.
Mesh ReadObj(const std::filesystem::path& file, std::string_view text,
             std::vector<int>* texture_indices = nullptr);
Mesh ReadOff(const std::filesystem::path& file, std::string_view text);
Mesh ReadPly(const std::filesystem::path& file, std::string_view text);

// The content of a file. Coordinates in the shortest notation that reads back the same; PLY is binary, in
// double. OBJ: vt is 1 for the faces that are observed, 2 for the others, absent where `observed` is null.
// Colours as three numbers behind the coordinates. OFF has no colours. Only PLY's faces have properties; each
// has a value a face.
std::string ObjText(const Mesh& mesh, const std::vector<bool>* observed = nullptr);
std::string OffText(const Mesh& mesh);
std::string PlyText(const Mesh& mesh, const std::vector<FaceProperty>& properties = {});

}  // namespace lumen
