#include "common/mesh.h"

#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "common/error.h"
#include "common/files.h"
#include "common/mesh_files.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// OpenMesh's own mesh holds vertices here and nothing else: it would drop every face that isn't manifold.
using Points = OpenMesh::TriMesh_ArrayKernelT<>;

class SoupImporter : public OpenMesh::IO::ImporterT<Points> {
 public:
  using ImporterT::add_face;
  using ImporterT::ImporterT;

  OpenMesh::FaceHandle add_face(const VHandles& corners) override {
    faces.emplace_back(corners[0].idx(), corners[1].idx(), corners[2].idx());
    return OpenMesh::FaceHandle();
  }

  std::vector<Vec3i> faces;
};

class SoupExporter : public OpenMesh::IO::ExporterT<Points> {
 public:
  SoupExporter(const Points& points, const Mesh& mesh) : ExporterT(points), mesh_(mesh) {}

  size_t n_faces() const override { return mesh_.faces.size(); }

  unsigned int get_vhandles(OpenMesh::FaceHandle face,
                            std::vector<OpenMesh::VertexHandle>& corners) const override {
    corners.clear();
    for (int corner : mesh_.faces[face.idx()]) corners.emplace_back(corner);
    return 3;
  }

  OpenMesh::Vec3f normal(OpenMesh::FaceHandle face) const override {
    const Vec3f normal = FaceNormal(mesh_, face.idx()).cast<float>();
    return {normal.x(), normal.y(), normal.z()};
  }

 private:
  const Mesh& mesh_;
};

// OpenMesh tells stderr what it does; errors are told by exceptions here.
void SilenceOpenMesh() {
  omlog().disable();
  omerr().disable();
}

[[noreturn]] void Fail(const fs::path& file, const std::string& problem) {
  throw InputError(file.string() + ": " + problem);
}

// A binary STL is 84 bytes and 50 a triangle; a text ends with "endsolid". OpenMesh looks at neither.
bool IsWholeStl(std::string_view bytes) {
  if (bytes.size() >= 84) {
    uint32_t triangles = 0;
    for (int i = 3; i >= 0; --i) triangles = triangles << 8 | static_cast<uint8_t>(bytes[80 + i]);
    if (bytes.size() == 84 + uint64_t{50} * triangles) return true;
  }
  return bytes.starts_with("solid") && bytes.find("endsolid") != std::string_view::npos;
}

Mesh ReadStl(const fs::path& file) {
  if (!IsWholeStl(ReadFile(file))) Fail(file, "not an STL file, or cut short");
  SilenceOpenMesh();
  Points points;
  SoupImporter importer(points);
  OpenMesh::IO::Options options;
  if (!OpenMesh::IO::IOManager().read(file.string(), importer, options)) Fail(file, "cannot be read as STL");
  Mesh mesh;
  mesh.faces = std::move(importer.faces);
  for (const auto vertex : points.vertices()) {
    const auto& point = points.point(vertex);
    mesh.vertices.emplace_back(point[0], point[1], point[2]);
    if (!mesh.vertices.back().allFinite()) {
      Fail(file, "vertex " + std::to_string(vertex.idx()) + ": a coordinate is not finite");
    }
  }
  return mesh;
}

std::string StlBytes(const Mesh& mesh) {
  SilenceOpenMesh();
  Points points;
  for (const Vec3d& vertex : mesh.vertices) {
    const Vec3f rounded = vertex.cast<float>();
    points.add_vertex({rounded.x(), rounded.y(), rounded.z()});
  }
  SoupExporter exporter(points, mesh);
  std::ostringstream stream;
  OpenMesh::IO::IOManager().write(stream, ".stl", exporter, OpenMesh::IO::Options::Binary);
  return std::move(stream).str();
}

std::string Extension(const fs::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

void CheckHasFaces(const fs::path& file, const Mesh& mesh) {
  if (mesh.faces.empty()) Fail(file, "the mesh has no faces");
}

// A defect of the caller, not of any input.
void CheckColors(const Mesh& mesh) {
  if (!mesh.colors.empty() && mesh.colors.size() != mesh.vertices.size()) {
    throw std::logic_error("a mesh must have a colour a vertex or none");
  }
}

}  // namespace

Mesh ReadMesh(const fs::path& file) {
  const std::string extension = Extension(file);
  Mesh mesh;
  if (extension == ".ply") {
    mesh = ReadPly(file, ReadFile(file));
  } else if (extension == ".obj") {
    mesh = ReadObj(file, ReadFile(file));
  } else if (extension == ".off") {
    mesh = ReadOff(file, ReadFile(file));
  } else if (extension == ".stl") {
    mesh = ReadStl(file);
  } else {
    Fail(file, "unknown kind of mesh; use .ply, .obj, .off or .stl");
  }
  CheckHasFaces(file, mesh);
  return mesh;
}

void WriteMesh(const fs::path& file, const Mesh& mesh) {
  CheckColors(mesh);
  const std::string extension = Extension(file);
  if (extension == ".ply") {
    WriteFile(file, PlyText(mesh));
  } else if (extension == ".obj") {
    WriteFile(file, ObjText(mesh));
  } else if (extension == ".off") {
    WriteFile(file, OffText(mesh));
  } else if (extension == ".stl") {
    WriteFile(file, StlBytes(mesh));
  } else {
    Fail(file, "unknown kind of mesh; use .ply, .obj, .off or .stl");
  }
}

void WriteCoverageMesh(const fs::path& file, const Mesh& mesh, const std::vector<bool>& observed) {
  CheckColors(mesh);
  if (observed.size() != mesh.faces.size())
    throw std::logic_error("WriteCoverageMesh: an entry a face is needed");
  WriteFile(file, ObjText(mesh, &observed));
}

Mesh ReadCoverageMesh(const fs::path& file, std::vector<bool>* observed) {
  observed->clear();
  if (Extension(file) != ".obj") return ReadMesh(file);
  std::vector<int> texture_indices;
  Mesh mesh = ReadObj(file, ReadFile(file), &texture_indices);
  CheckHasFaces(file, mesh);
  // Other indices are a texture's.
  const bool says_it = std::all_of(texture_indices.begin(), texture_indices.end(),
                                   [](int index) { return index == 1 || index == 2; });
  if (says_it) {
    for (int index : texture_indices) observed->push_back(index == 1);
  }
  return mesh;
}

Eigen::AlignedBox3d Bounds(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vec3d& vertex : mesh.vertices) box.extend(vertex);
  return box;
}

namespace {

// Twice the area, along the normal.
Vec3d AreaVector(const Mesh& mesh, int face) {
  const Vec3i& corners = mesh.faces[face];
  const Vec3d& a = mesh.vertices[corners[0]];
  return (mesh.vertices[corners[1]] - a).cross(mesh.vertices[corners[2]] - a);
}

}  // namespace

double FaceArea(const Mesh& mesh, int face) { return AreaVector(mesh, face).norm() / 2; }

Vec3d FaceNormal(const Mesh& mesh, int face) {
  const Vec3d vector = AreaVector(mesh, face);
  const double length = vector.norm();
  return length > 0 ? Vec3d(vector / length) : Vec3d::Zero();
}

std::vector<Vec3d> VertexNormals(const Mesh& mesh) {
  std::vector<Vec3d> normals(mesh.vertices.size(), Vec3d::Zero());
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    const Vec3d normal = FaceNormal(mesh, static_cast<int>(i));
    const Vec3i& corners = mesh.faces[i];
    for (int c = 0; c < 3; ++c) {
      const Vec3d& tip = mesh.vertices[corners[c]];
      const Vec3d a = mesh.vertices[corners[(c + 1) % 3]] - tip;
      const Vec3d b = mesh.vertices[corners[(c + 2) % 3]] - tip;
      // atan2 keeps its accuracy at angles near 0 and π, and answers 0 for an edge without length.
      normals[corners[c]] += std::atan2(a.cross(b).norm(), a.dot(b)) * normal;
    }
  }
  for (Vec3d& normal : normals) {
    const double length = normal.norm();
    if (length > 0) normal /= length;
  }
  return normals;
}

}  // namespace lumen
