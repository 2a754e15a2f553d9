// OBJ and OFF, the text formats.
#include <algorithm>
#include <cmath>

#include "common/line_reader.h"
#include "common/mesh_files.h"

namespace lumen {
namespace {

uint8_t ColorByte(double fraction) {
  return static_cast<uint8_t>(std::lround(255 * std::clamp(fraction, 0.0, 1.0)));
}

// One corner of an OBJ face: "v", "v/vt", "v//vn" or "v/vt/vn"; negative = counted back from the last so far.
struct Corner {
  int64_t vertex = 0;   // from 0
  int64_t texture = 0;  // from 1; 0 = none
};

Corner ParseCorner(const LineReader& reader, std::string_view word, size_t vertices, size_t textures) {
  const size_t slash = word.find('/');
  const int64_t vertex = reader.ToInteger(word.substr(0, slash), "a face's index");
  if (vertex == 0) reader.Fail("a face's index is 0, but OBJ counts from 1");
  Corner corner;
  corner.vertex = vertex > 0 ? vertex - 1 : static_cast<int64_t>(vertices) + vertex;
  if (slash != std::string_view::npos) {
    const std::string_view rest = word.substr(slash + 1);
    const std::string_view texture = rest.substr(0, rest.find('/'));
    if (!texture.empty()) corner.texture = reader.ToInteger(texture, "a face's texture index");
    if (corner.texture < 0) corner.texture += static_cast<int64_t>(textures) + 1;
  }
  return corner;
}

// Adds a polygon as a fan of triangles.
void AddFan(const std::vector<int64_t>& polygon, std::vector<Vec3i>* faces) {
  for (size_t i = 2; i < polygon.size(); ++i) {
    faces->push_back(Vec3d(polygon[0], polygon[i - 1], polygon[i]).cast<int>());
  }
}

void ReadObjVertex(LineReader* reader, Mesh* mesh) {
  const double x = reader->Number("x"), y = reader->Number("y"), z = reader->Number("z");
  mesh->vertices.emplace_back(x, y, z);
  std::vector<double> more;
  for (std::string_view word = reader->Word(); !word.empty(); word = reader->Word()) {
    more.push_back(reader->ToNumber(word, "a number behind z"));
  }
  // One more number is a weight; three or four are a colour.
  if (more.size() < 3) return;
  mesh->colors.resize(mesh->vertices.size());
  mesh->colors.back() = {ColorByte(more[0]), ColorByte(more[1]), ColorByte(more[2])};
}

void AppendVertex(std::string* text, const Vec3d& vertex) {
  for (int i = 0; i < 3; ++i) {
    if (i > 0) *text += ' ';
    AppendNumber(text, vertex[i]);
  }
}

}  // namespace

Mesh ReadObj(const std::filesystem::path& file, std::string_view text, std::vector<int>* texture_indices) {
  Mesh mesh;
  size_t textures = 0;
  std::vector<int> face_lines;
  LineReader reader(file, text);
  std::vector<int64_t> polygon;
  while (reader.NextFilledLine()) {
    const std::string_view kind = reader.Word();
    if (kind == "v") {
      ReadObjVertex(&reader, &mesh);
    } else if (kind == "vt") {
      ++textures;
    } else if (kind == "f") {
      polygon.clear();
      int64_t texture = 0;
      for (std::string_view word = reader.Word(); !word.empty(); word = reader.Word()) {
        const Corner corner = ParseCorner(reader, word, mesh.vertices.size(), textures);
        // Vertices may follow their faces, so indices can be checked only in the end; here that they fit an
        // int.
        if (corner.vertex < 0 || corner.vertex > INT32_MAX || corner.texture < 0 ||
            corner.texture > INT32_MAX) {
          reader.Fail("a face names vertex " + std::string(word) + ", which doesn't exist");
        }
        if (polygon.empty()) texture = corner.texture;
        polygon.push_back(corner.vertex);
      }
      if (polygon.size() < 3) reader.Fail("a face has " + std::to_string(polygon.size()) + " corners");
      AddFan(polygon, &mesh.faces);
      face_lines.resize(mesh.faces.size(), reader.line_number());
      if (texture_indices) texture_indices->resize(mesh.faces.size(), static_cast<int>(texture));
    }
  }
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    const int most = mesh.faces[i].maxCoeff();
    if (static_cast<size_t>(most) >= mesh.vertices.size()) {
      reader.FailAt(face_lines[i], "a face names vertex " + std::to_string(int64_t{most} + 1) +
                                       ", but there are " + std::to_string(mesh.vertices.size()));
    }
  }
  if (!mesh.colors.empty()) mesh.colors.resize(mesh.vertices.size());
  return mesh;
}

Mesh ReadOff(const std::filesystem::path& file, std::string_view text) {
  LineReader reader(file, text);
  if (!reader.NextFilledLine()) reader.Fail("empty, but should start with OFF");
  std::string_view kind = reader.Word();
  if (!kind.ends_with("OFF")) reader.Fail("not an OFF file: it should start with OFF");
  if (kind.find_first_of("4n") != std::string_view::npos) reader.Fail("OFF in other than 3 dimensions");
  if (reader.rest().find_first_not_of(" \t\r") == std::string_view::npos && !reader.NextFilledLine()) {
    reader.Fail("the file ends before its counts");
  }
  const int64_t vertices = reader.Integer("the number of vertices");
  const int64_t faces = reader.Integer("the number of faces");
  if (vertices < 0 || faces < 0) reader.Fail("a negative count");
  Mesh mesh;
  for (int64_t i = 0; i < vertices; ++i) {
    const std::string place = "vertex " + std::to_string(i) + " of " + std::to_string(vertices);
    if (!reader.NextFilledLine()) reader.Fail("the file ends before " + place);
    const double x = reader.Number("x"), y = reader.Number("y"), z = reader.Number("z");
    mesh.vertices.emplace_back(x, y, z);
  }
  std::vector<int64_t> polygon;
  for (int64_t i = 0; i < faces; ++i) {
    const std::string place = "face " + std::to_string(i) + " of " + std::to_string(faces);
    if (!reader.NextFilledLine()) reader.Fail("the file ends before " + place);
    const int64_t corners = reader.Integer("the number of corners");
    if (corners < 3) reader.Fail(place + " has " + std::to_string(corners) + " corners");
    polygon.clear();
    for (int64_t c = 0; c < corners; ++c) {
      const int64_t index = reader.Integer("a face's index");
      if (index < 0 || index >= vertices) {
        reader.Fail(place + " names vertex " + std::to_string(index) + ", but there are " +
                    std::to_string(vertices) + ", counted from 0");
      }
      polygon.push_back(index);
    }
    AddFan(polygon, &mesh.faces);
  }
  return mesh;
}

std::string ObjText(const Mesh& mesh, const std::vector<bool>* observed) {
  std::string text;
  text.reserve(mesh.vertices.size() * 60 + mesh.faces.size() * 30);
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    text += "v ";
    AppendVertex(&text, mesh.vertices[i]);
    if (!mesh.colors.empty()) {
      for (uint8_t channel : mesh.colors[i]) {
        text += ' ';
        AppendNumber(&text, channel / 255.0);
      }
    }
    text += '\n';
  }
  if (observed) text += "vt 0.25 0.5\nvt 0.75 0.5\n";
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    text += 'f';
    for (int corner : mesh.faces[i]) {
      text += ' ' + std::to_string(corner + 1);
      if (observed) text += (*observed)[i] ? "/1" : "/2";
    }
    text += '\n';
  }
  return text;
}

std::string OffText(const Mesh& mesh) {
  std::string text =
      "OFF\n" + std::to_string(mesh.vertices.size()) + ' ' + std::to_string(mesh.faces.size()) + " 0\n";
  for (const Vec3d& vertex : mesh.vertices) {
    AppendVertex(&text, vertex);
    text += '\n';
  }
  for (const Vec3i& face : mesh.faces) {
    text += '3';
    for (int corner : face) text += ' ' + std::to_string(corner);
    text += '\n';
  }
  return text;
}

}  // namespace lumen
