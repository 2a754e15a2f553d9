#include "common/mesh.h"

#include <cmath>
#include <cstring>

#include "common/files.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ErrorOf;

// Reads `text` as a file of that name; answers the error without its folder.
std::string ErrorReading(const std::string& name, const std::string& text) {
  const test::ScratchFolder scratch;
  WriteFile(scratch / name, text);
  const std::string error = ErrorOf([&] { ReadMesh(scratch / name); });
  const std::string folder = scratch.path().string() + "/";
  return error.starts_with(folder) ? error.substr(folder.size()) : error;
}

// A soup: three faces at one edge, one of them twice, and numbers that need all digits of a double.
Mesh Soup() {
  Mesh mesh;
  for (int i = 0; i < 5; ++i)
    mesh.vertices.emplace_back(i / 7.0, 100 + std::sqrt(i + 2.0), -1e-9 * i * i / 3);
  mesh.faces = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {0, 1, 4}, {3, 2, 4}};
  return mesh;
}

TEST(Mesh, EveryDigitAndFaceComesBack) {
  const test::ScratchFolder scratch;
  Mesh mesh = Soup();
  for (const char* name : {"a.ply", "a.obj", "a.off", "A.PLY"}) {
    WriteMesh(scratch / name, mesh);
    const Mesh back = ReadMesh(scratch / name);
    EXPECT_EQ(back.vertices, mesh.vertices) << name;
    EXPECT_EQ(back.faces, mesh.faces) << name;
    EXPECT_TRUE(back.colors.empty());
  }
  for (int i = 0; i < 5; ++i) mesh.colors.push_back({uint8_t(i * 63), uint8_t(255 - i), uint8_t(i)});
  for (const char* name : {"c.ply", "c.obj"}) {
    WriteMesh(scratch / name, mesh);
    EXPECT_EQ(ReadMesh(scratch / name).colors, mesh.colors) << name;
  }
}

TEST(Mesh, StlMergesCornersInFloat) {
  const test::ScratchFolder scratch;
  const Mesh mesh = Soup();
  WriteMesh(scratch / "a.stl", mesh);
  EXPECT_EQ(std::filesystem::file_size(scratch / "a.stl"), 84u + 50u * mesh.faces.size());
  const Mesh back = ReadMesh(scratch / "a.stl");
  ASSERT_EQ(back.vertices.size(), mesh.vertices.size());
  ASSERT_EQ(back.faces.size(), mesh.faces.size());
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int c = 0; c < 3; ++c) {
      const Vec3f expected = mesh.vertices[mesh.faces[f][c]].cast<float>();
      EXPECT_EQ(back.vertices[back.faces[f][c]].cast<float>(), expected);
    }
  }
  WriteFile(scratch / "text.stl",
            "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
            "endfacet\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\n"
            "endfacet\nendsolid x\n");
  EXPECT_EQ(ReadMesh(scratch / "text.stl").vertices.size(), 4u);
}

// What writes and reads PLY here is held against bytes put together by hand.
TEST(Mesh, PlyOfEitherByteOrderAndAnyType) {
  const test::ScratchFolder scratch;
  const std::string header =
      "ply\nformat binary_big_endian 1.0\ncomment by hand\nelement vertex 3\nproperty float x\n"
      "property short y\nproperty double z\nproperty list uchar uchar extra\nelement edge 1\nproperty int a\n"
      "element face 1\nproperty uchar flag\nproperty list int uint vertex_index\nend_header\n";
  const char bytes[] =
      "\x3f\x80\x00\x00\xff\xfe\x40\x09\x00\x00\x00\x00\x00\x00\x02\x07\x08"  // 1, −2, 3.125, two extras
      "\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00"
      "\x00\x00\x00\x00\x00\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00"
      "\x00\x00\x00\x05"
      "\x01\x00\x00\x00\x03\x00\x00\x00\x02\x00\x00\x00\x01\x00\x00\x00\x00";
  WriteFile(scratch / "a.ply", header + std::string(bytes, sizeof bytes - 1));
  const Mesh mesh = ReadMesh(scratch / "a.ply");
  ASSERT_EQ(mesh.vertices.size(), 3u);
  EXPECT_EQ(mesh.vertices[0], Vec3d(1, -2, 3.125));
  EXPECT_EQ(mesh.vertices[2], Vec3d(0, 1, 0));
  EXPECT_EQ(mesh.faces, (std::vector<Vec3i>{{2, 1, 0}}));

  Mesh written;
  written.vertices = {{1, 0, 0}, {0, 1, 0}, {0, 0, 0.5}};
  written.faces = {{0, 1, 2}};
  WriteMesh(scratch / "b.ply", written);
  const std::string content = ReadFile(scratch / "b.ply");
  const size_t body = content.find("end_header\n") + 11;
  ASSERT_EQ(content.size(), body + 9 * 8 + 13);
  double last = 0;
  std::memcpy(&last, content.data() + body + 64, 8);
  EXPECT_EQ(last, 0.5);
  EXPECT_EQ(content.substr(body + 72), std::string("\3\0\0\0\0\1\0\0\0\2\0\0\0", 13));
}

TEST(Mesh, PolygonsBecomeFans) {
  const test::ScratchFolder scratch;
  const std::vector<Vec3i> fan = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}};
  WriteFile(scratch / "a.obj", "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n");
  EXPECT_EQ(ReadMesh(scratch / "a.obj").faces, fan);
  WriteFile(scratch / "a.off",
            "OFF # five corners\n5 1 0\n0 0 0\n1 0 0\n2 1 0\n\n1 2 0\n0 1 0\n5 0 1 2 3 4\n");
  EXPECT_EQ(ReadMesh(scratch / "a.off").faces, fan);
  WriteFile(
      scratch / "a.ply",
      "ply\r\nformat ascii 1.0\r\nelement vertex 5\r\nproperty float x\r\nproperty float y\r\nproperty float "
      "z\r\n"
      "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n0 0 0\r\n1 0 0\r\n2 1 0\r\n"
      "1 2 0\r\n0 1 0\r\n5 0 1 2 3 4\r\n");
  EXPECT_EQ(ReadMesh(scratch / "a.ply").faces, fan);
}

TEST(Mesh, ObjCountsBackAndKnowsItsVariants) {
  const test::ScratchFolder scratch;
  WriteFile(
      scratch / "a.obj",
      "o name\nv 0 0 0 1\nv +1 0 0 1.0\nv 0 1e0 0\nvt 0 0\nvn 0 0 1\nusemtl x\nf -3/1/1 -2//1 3/1 # end\n");
  const Mesh mesh = ReadMesh(scratch / "a.obj");
  EXPECT_EQ(mesh.faces, (std::vector<Vec3i>{{0, 1, 2}}));
  EXPECT_EQ(mesh.vertices[1], Vec3d(1, 0, 0));
  EXPECT_TRUE(mesh.colors.empty());
}

TEST(Mesh, DamagedFilesAreNamedWithTheirPlace) {
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_EQ(ErrorReading("a.obj", three + "f 1 2 4\n"), "a.obj:4: a face names vertex 4, but there are 3");
  EXPECT_EQ(ErrorReading("a.obj", three + "f 1 2 0\n"),
            "a.obj:4: a face's index is 0, but OBJ counts from 1");
  EXPECT_EQ(ErrorReading("a.obj", three + "f 1 2 -4\n"),
            "a.obj:4: a face names vertex -4, which doesn't exist");
  EXPECT_EQ(ErrorReading("a.obj", three + "f 1 2\n"), "a.obj:4: a face has 2 corners");
  EXPECT_EQ(ErrorReading("a.obj", three + "f 1 2 x\n"),
            "a.obj:4: a face's index is \"x\", which is no integer");
  EXPECT_EQ(ErrorReading("a.obj", "v 0 0\n"), "a.obj:1: the line ends where z should be");
  EXPECT_EQ(ErrorReading("a.obj", "v 0 nan 0\n"), "a.obj:1: y is \"nan\", but must be finite");
  EXPECT_EQ(ErrorReading("a.obj", "v 0 1e999 0\n"), "a.obj:1: y is \"1e999\", but must be finite");
  EXPECT_EQ(ErrorReading("a.obj", three), "a.obj: the mesh has no faces");
  EXPECT_EQ(ErrorReading("a.obj", ""), "a.obj: the mesh has no faces");
  EXPECT_EQ(ErrorReading("a.xyz", "1 2 3"), "a.xyz: unknown kind of mesh; use .ply, .obj, .off or .stl");

  EXPECT_EQ(ErrorReading("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n"),
            "a.off:4: the file ends before vertex 2 of 3");
  EXPECT_EQ(ErrorReading("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n"),
            "a.off:4: face 0 of 1 names vertex 1, but there are 1, counted from 0");
  EXPECT_EQ(ErrorReading("a.off", "1 2 3"), "a.off:1: not an OFF file: it should start with OFF");

  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_EQ(ErrorReading("a.ply", header + "0 0 0\n0 0 nan\n"),
            "a.ply:11: a number of vertex 1 of 3 is \"nan\", but must be finite");
  EXPECT_EQ(ErrorReading("a.ply", header + "0 0 0\n0 0\n"), "a.ply:11: vertex 1 of 3: too few numbers");
  EXPECT_EQ(ErrorReading("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n"),
            "a.ply:12: face 0 of 1: the file ends before it");
  EXPECT_EQ(ErrorReading("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
            "a.ply:13: face 0 of 1: names vertex 3, but there are 3, counted from 0");
  EXPECT_EQ(ErrorReading("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n999 0 1 3\n"),
            "a.ply:13: face 0 of 1: a list with an impossible count");
  EXPECT_EQ(ErrorReading("a.ply", "ply\nformat ascii 1.0\nelement"),
            "a.ply:3: the line ends where the number of elements should be");
  EXPECT_EQ(ErrorReading("a.ply", "nothing"), "a.ply:1: not a PLY file: it should start with ply");
  EXPECT_EQ(ErrorReading("a.stl", "solid x\nfacet normal 0 0 1\n"), "a.stl: not an STL file, or cut short");
}

TEST(Mesh, CutFilesAreErrors) {
  const test::ScratchFolder scratch;
  for (const std::string name : {"a.ply", "a.stl"}) {
    WriteMesh(scratch / name, Soup());
    const std::string bytes = ReadFile(scratch / name);
    for (size_t length = 0; length < bytes.size(); length += 3) {
      EXPECT_NE(ErrorReading(name, bytes.substr(0, length)), "") << name << " cut at " << length;
    }
  }
}

TEST(Mesh, NotFiniteInBinaryIsNamed) {
  const test::ScratchFolder scratch;
  Mesh mesh = Soup();
  mesh.vertices[3].y() = NAN;
  WriteMesh(scratch / "a.ply", mesh);
  EXPECT_EQ(ErrorOf([&] { ReadMesh(scratch / "a.ply"); }),
            (scratch / "a.ply").string() + ": vertex 3 of 5: a coordinate is not finite");
  WriteMesh(scratch / "a.stl", mesh);
  EXPECT_NE(ErrorOf([&] { ReadMesh(scratch / "a.stl"); }), "");
}

TEST(Mesh, CoverageComesBack) {
  const test::ScratchFolder scratch;
  const Mesh mesh = Soup();
  const std::vector<bool> observed = {true, false, true, true, false};
  WriteCoverageMesh(scratch / "coverage_mesh.obj", mesh, observed);
  const std::string text = ReadFile(scratch / "coverage_mesh.obj");
  EXPECT_NE(text.find("f 1/1 2/1 3/1\nf 1/2 2/2 4/2\n"), std::string::npos);
  std::vector<bool> back;
  EXPECT_EQ(ReadCoverageMesh(scratch / "coverage_mesh.obj", &back).vertices, mesh.vertices);
  EXPECT_EQ(back, observed);
  EXPECT_EQ(ReadMesh(scratch / "coverage_mesh.obj").faces, mesh.faces);
  // Neither a mesh without vt nor one with a real texture says what was observed.
  WriteMesh(scratch / "plain.obj", mesh);
  EXPECT_EQ(ReadCoverageMesh(scratch / "plain.obj", &back).faces, mesh.faces);
  EXPECT_TRUE(back.empty());
  WriteFile(scratch / "textured.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 0 0\nvt 0 0\nf 1/1 2/2 3/3\nf 1/3 2/2 3/1\n");
  ReadCoverageMesh(scratch / "textured.obj", &back);
  EXPECT_TRUE(back.empty());
}

// A cube's corner: three right angles meet, so the normal is the diagonal whatever the faces' areas.
TEST(Mesh, NormalsAndAreas) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {5, 0, 0}, {0, 1, 0}, {0, 0, 1}, {9, 9, 9}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 1, 2}};
  EXPECT_EQ(FaceArea(mesh, 0), 2.5);
  EXPECT_EQ(FaceArea(mesh, 3), 0);
  EXPECT_EQ(FaceNormal(mesh, 0), Vec3d(0, 0, 1));
  EXPECT_EQ(FaceNormal(mesh, 3), Vec3d(0, 0, 0));
  const auto normals = VertexNormals(mesh);
  EXPECT_LT((normals[0] - Vec3d::Ones().normalized()).norm(), 1e-15);
  EXPECT_EQ(normals[4], Vec3d(0, 0, 0));
  const auto box = Bounds(mesh);
  EXPECT_EQ(box.min(), Vec3d(0, 0, 0));
  EXPECT_EQ(box.max(), Vec3d(9, 9, 9));
}

// The CT colon keeps the faces that a half-edge structure would drop: its files' own counts, by grep.
TEST(Mesh, ReadsTheCtColonAsItStands) {
  using test::SharedData;
  const std::string file = "colon_ct/EdinGCA00020_large_intestine_merged.obj";
  LUMEN_NEEDS_DATA(file);
  const std::string text = ReadFile(SharedData(file));
  size_t vertices = 0, faces = 0;
  for (size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at + 1)) {
    vertices += text.compare(at + 1, 2, "v ") == 0;
    faces += text.compare(at + 1, 2, "f ") == 0;
  }
  const Mesh mesh = ReadMesh(SharedData(file));
  EXPECT_EQ(mesh.vertices.size(), vertices);
  EXPECT_EQ(mesh.faces.size(), faces);
}

}  // namespace
}  // namespace lumen
