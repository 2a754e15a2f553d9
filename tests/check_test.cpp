// `lumen check`, run as people run it.
#include <sys/wait.h>

#include <cstdlib>
#include <functional>
#include <nlohmann/json.hpp>

#include "common/files.h"
#include "common/image.h"
#include "common/mesh.h"
#include "common/sequence.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ScratchFolder;
using test::SharedData;

struct Outcome {
  int exit_code = -1;
  std::string out, err;
  nlohmann::json json;
};

Outcome Check(const std::filesystem::path& path) {
  const ScratchFolder scratch;
  const std::string command = std::string(LUMEN_COMMAND) + " check '" + path.string() + "' --json '" +
                              (scratch / "json").string() + "' >'" + (scratch / "out").string() + "' 2>'" +
                              (scratch / "err").string() + "'";
  Outcome outcome;
  outcome.exit_code = WEXITSTATUS(std::system(command.c_str()));
  outcome.out = ReadFile(scratch / "out");
  outcome.err = ReadFile(scratch / "err");
  outcome.json = nlohmann::json::parse(ReadFile(scratch / "json"));
  return outcome;
}

// Finds exactly this error, says so in one line on stderr and exits with 1.
void ExpectError(const std::filesystem::path& path, const std::string& text) {
  const Outcome outcome = Check(path);
  EXPECT_EQ(outcome.exit_code, 1) << text;
  EXPECT_NE(outcome.out.find(text), std::string::npos) << "expected: " << text << "\nfound: " << outcome.out;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_GE(outcome.json["errors"], 1);
}

Mesh Tetrahedron() {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {6, 0, 0}, {0, 6, 0}, {0, 0, 6}};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return mesh;
}

TEST(CheckMesh, AClosedMeshHasNoErrors) {
  const ScratchFolder scratch;
  WriteMesh(scratch / "a.ply", Tetrahedron());
  const Outcome outcome = Check(scratch / "a.ply");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(outcome.json["mesh"]["closed"], true);
  EXPECT_EQ(outcome.json["mesh"]["components"], 1);
  EXPECT_DOUBLE_EQ(outcome.json["mesh"]["volume_mm3"], 36);
  EXPECT_EQ(outcome.json["findings"].size(), 0u);
}

TEST(CheckMesh, EveryFaultIsFound) {
  const ScratchFolder scratch;
  const auto expect = [&](const std::function<void(Mesh*)>& damage, const std::string& text) {
    Mesh mesh = Tetrahedron();
    damage(&mesh);
    WriteMesh(scratch / "a.ply", mesh);
    ExpectError(scratch / "a.ply", text);
  };
  expect([](Mesh* m) { m->faces.pop_back(); },
         "error: " + (scratch / "a.ply").string() + ": not closed: 3 edges with one face only");
  expect([](Mesh* m) { std::swap(m->faces[0][0], m->faces[0][1]); },
         "3 edges between faces of opposite orientation");
  expect([](Mesh* m) { m->faces.push_back({0, 1, 2}); }, "3 edges with more than two faces");
  expect([](Mesh* m) { m->faces.push_back({0, 1, 2}); }, "1 face with the vertices of another");
  expect([](Mesh* m) { m->faces.push_back({0, 1, 1}); }, "1 face without area");
  expect([](Mesh* m) { m->vertices[3] = {0, 3, 0}; }, "1 face without area");
}

TEST(CheckMesh, OddThingsAreWarnings) {
  const ScratchFolder scratch;
  Mesh mesh = Tetrahedron();
  for (int i = 0; i < 4; ++i) mesh.vertices.push_back(mesh.vertices[i] + Vec3d(i == 0 ? 0.0 : 9.0, 0, 0));
  for (int i = 0; i < 4; ++i) mesh.faces.push_back((mesh.faces[i].array() + 4).matrix());
  for (Vec3i& face : mesh.faces) std::swap(face[0], face[1]);
  WriteMesh(scratch / "a.ply", mesh);
  const Outcome outcome = Check(scratch / "a.ply");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.out.find("1 vertex position used twice"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("falls into 2 components"), std::string::npos);
  EXPECT_NE(outcome.out.find("normals point inwards"), std::string::npos);
}

TEST(CheckMesh, UnreadableOnesAreErrors) {
  const ScratchFolder scratch;
  ExpectError("/nowhere/a.ply", "/nowhere/a.ply: cannot read: No such file or directory");
  WriteFile(scratch / "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
  ExpectError(scratch / "a.obj", "a.obj:4: a face names vertex 4, but there are 3");
}

// PROVENANCE's own figures: 200 boundary edges, 16 that aren't manifold.
TEST(CheckMesh, CountsTheCtColonsDefects) {
  const std::string file = "colon_ct/EdinGCA00020_large_intestine_merged.obj";
  LUMEN_NEEDS_DATA(file);
  const Outcome outcome = Check(SharedData(file));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(outcome.json["mesh"]["boundary_edges"], 200);
  EXPECT_EQ(outcome.json["mesh"]["non_manifold_edges"], 16);
}

// A wall at z = 20 mm, seen from two places half a millimetre apart: everything in closed form.
class CheckSequence : public testing::Test {
 protected:
  static constexpr int kWidth = 320, kHeight = 256;
  static constexpr double kFocal_px = 200, kZ_mm = 20, kStep_mm = 0.5;

  void SetUp() override {
    sequence_.folder = scratch_.path();
    CameraIntrinsics& camera = sequence_.calibration.camera;
    camera.width = kWidth;
    camera.height = kHeight;
    camera.cx = kWidth / 2;
    camera.cy = kHeight / 2;
    camera.fx = camera.fy = kFocal_px;
    sequence_.calibration.light.sources.emplace_back();
    for (int i = 0; i < 2; ++i) {
      SequenceFrame frame;
      frame.number = i;
      frame.gain = 1;
      frame.world_from_camera.translation().x() = i * kStep_mm;
      sequence_.frames.push_back(frame);
      WriteImage(File(i, "color.png"), Image8(kWidth, kHeight, 3, 90));
      WriteImage(File(i, "depth.tiff"), EncodeDepth(ImageF(kWidth, kHeight, 1, kZ_mm)));
      WriteNormals(i, {0, 0, -1});
    }
    // A point moves right in the image as one goes back to the frame before.
    WriteFlow(kFocal_px * kStep_mm / kZ_mm);
    WriteImage(File(1, "occlusion.png"), Image8(kWidth, kHeight, 1, 255));
    Mesh wall;
    wall.vertices = {{-90, -90, kZ_mm}, {90, -90, kZ_mm}, {90, 90, kZ_mm}, {-90, 90, kZ_mm}};
    wall.faces = {{0, 1, 2}, {0, 2, 3}};
    sequence_.ground_truth_mesh = scratch_ / "mesh.ply";
    WriteMesh(sequence_.ground_truth_mesh, wall);
    WriteSequenceHeader(sequence_);
  }

  std::filesystem::path File(int number, const std::string& suffix) const {
    return FrameFile(scratch_.path(), number, suffix);
  }

  void WriteNormals(int number, const Vec3f& normal) const {
    ImageF image(kWidth, kHeight, 3);
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = normal[static_cast<int>(i % 3)];
    WriteImage(File(number, "normals.tiff"), EncodeNormals(image));
  }

  void WriteFlow(double x_px) const {
    ImageF flow(kWidth, kHeight, 2);
    for (size_t i = 0; i < flow.data.size(); i += 2) flow.data[i] = static_cast<float>(x_px);
    WriteImage(File(1, "flow.tiff"), EncodeFlow(flow));
  }

  ScratchFolder scratch_;
  Sequence sequence_;
};

TEST_F(CheckSequence, AGoodOneHasNoFindings) {
  for (const auto& path : {scratch_.path(), scratch_ / "sequence.toml"}) {
    const Outcome outcome = Check(path);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_EQ(outcome.out, path.string() + ": no errors\n");
    EXPECT_EQ(outcome.json["sequence"]["frames"], 2);
  }
}

TEST_F(CheckSequence, WhatReadingFindsIsFound) {
  WriteFile(scratch_ / "pose.txt", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n");
  ExpectError(scratch_.path(), "pose.txt: 1 poses, but 2 colour files");
}

// Every damaged frame is named, and the others are looked at all the same.
TEST_F(CheckSequence, DamagedPosesAreNamedAndTheRestIsChecked) {
  std::string poses = ReadFile(scratch_ / "pose.txt");
  WriteFile(scratch_ / "pose.txt", "1,0,0\n" + poses.substr(poses.find('\n') + 1));
  WriteImage(File(1, "occlusion.png"), Image8(kWidth, kHeight, 1, 1));
  ExpectError(scratch_.path(),
              "pose.txt:1: a pose is 16 numbers, camera to world, but here are 3; frame 0 is left out");
  ExpectError(scratch_.path(), "frame 1: 81920 occlusion values are neither 0 nor 255");
}

TEST_F(CheckSequence, DamagedFilesAreNamed) {
  const std::string png = ReadFile(File(1, "color.png"));
  WriteFile(File(1, "color.png"), png.substr(0, png.size() / 2));
  ExpectError(scratch_.path(), File(1, "color.png").string() + ": damaged or cut short");
  WriteImage(File(1, "color.png"), Image8(kHeight, kWidth, 3, 90));
  ExpectError(scratch_.path(), File(1, "color.png").string() + ": has 256×320 pixels, the camera 320×256");
  WriteImage(File(1, "color.png"), Image8(kWidth, kHeight, 3, 90));
  WriteImage(File(0, "depth.tiff"), Image8(kWidth, kHeight, 1, 90));
  ExpectError(scratch_.path(), File(0, "depth.tiff").string() + ": holds uint8 values, but a 16-bit image");
}

TEST_F(CheckSequence, NormalsAreHeldAgainstCameraAndDepth) {
  WriteNormals(1, {0, 0, 1});
  ExpectError(scratch_.path(), "frame 1: 320 of 320 normals face away from the camera");
  WriteNormals(1, {0, 0, -0.9f});
  ExpectError(scratch_.path(), "frame 1: 320 of 320 normals aren't unit vectors");
  WriteNormals(1, Vec3f(0, 1, -1).normalized());
  ExpectError(scratch_.path(),
              "frame 1: normals and depths disagree by 45° in the median: is an axis turned?");
}

TEST_F(CheckSequence, FlowIsHeldAgainstDepthAndPoses) {
  WriteFlow(-kFocal_px * kStep_mm / kZ_mm);
  ExpectError(scratch_.path(), "frame 1: flow is off by 10.0 px in the median from what depth and poses say");
}

TEST_F(CheckSequence, DepthIsHeldAgainstTheMesh) {
  WriteImage(File(0, "depth.tiff"), EncodeDepth(ImageF(kWidth, kHeight, 1, 25)));
  ExpectError(scratch_.path(), "frame 0: depth is off by 5.");
  WriteImage(File(0, "depth.tiff"), Image16(kWidth, kHeight, 1));
  ExpectError(scratch_.path(), "frame 0: the depth file is empty");
}

TEST_F(CheckSequence, OcclusionIsBlackOrWhite) {
  WriteImage(File(1, "occlusion.png"), Image8(kWidth, kHeight, 1, 1));
  ExpectError(scratch_.path(), "frame 1: 81920 occlusion values are neither 0 nor 255");
}

TEST_F(CheckSequence, OddThingsAreWarnings) {
  sequence_.calibration.light.sources[0].position = {0, 0, 30};
  sequence_.calibration.light.sources[0].direction = {0, 0, -1};
  WriteSequenceHeader(sequence_);
  std::filesystem::remove(File(0, "depth.tiff"));
  WriteImage(File(0, "color.png"), Image8(kWidth, kHeight, 3, 0));
  const Outcome outcome = Check(scratch_.path());
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* text :
       {"warning: light.source.0: lies 30.0 mm from the camera", "warning: light.source.0: shines backwards",
        "warning: 1 of 2 frames have no depth file, the first being frame 0",
        "frame 0: the image is black"}) {
    EXPECT_NE(outcome.out.find(text), std::string::npos) << text << "\n" << outcome.out;
  }
}

TEST_F(CheckSequence, JumpsAreWarnings) {
  for (int i = 2; i < 8; ++i) {
    SequenceFrame frame = sequence_.frames[1];
    frame.number = i;
    frame.world_from_camera.translation().x() = kStep_mm * i + (i >= 5 ? 30 : 0);
    if (i >= 6) frame.world_from_camera.rotate(Eigen::AngleAxisd(0.5, Vec3d::UnitY()));
    sequence_.frames.push_back(frame);
    WriteImage(File(i, "color.png"), Image8(kWidth, kHeight, 3, 90));
  }
  WriteSequenceHeader(sequence_);
  const std::string out = Check(scratch_.path()).out;
  EXPECT_NE(out.find("from frame 4 to 5 the camera jumps by 30.5 mm a frame (usual: 0.50)"),
            std::string::npos)
      << out;
  EXPECT_NE(out.find("from frame 5 to 6 the camera turns by 29° a frame (usual: 0.0°)"), std::string::npos)
      << out;
}

// The real frame with the real trajectory: its flow bears out the sign, the encoding, the camera and the
// poses; and with a trajectory that is off by a frame it doesn't.
TEST(CheckRealFrame, FlowAgreesWithDepthAndTrajectory) {
  LUMEN_NEEDS_DATA("c3vd/trans_t4_a_frame0010");
  const ScratchFolder scratch;
  for (const auto& entry : std::filesystem::directory_iterator(SharedData("c3vd/trans_t4_a_frame0010"))) {
    std::filesystem::copy(entry.path(), scratch.path());
  }
  std::filesystem::copy(scratch / "0010_color.png", scratch / "0009_color.png");
  const std::string poses = ReadFile(SharedData("c3vd/poses/trans_t4_a.txt"));
  WriteFile(scratch / "pose.txt", poses);
  const Outcome outcome = Check(scratch.path());
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  // Without its first 20 lines, frames 9 and 10 get the poses of 29 and 30.
  size_t cut = 0;
  for (int line = 0; line < 20; ++line) cut = poses.find('\n', cut) + 1;
  WriteFile(scratch / "pose.txt", poses.substr(cut));
  ExpectError(scratch.path(), "frame 10: flow is off by");
}

constexpr char kScene[] = R"([camera]
preset = "c3vd"
[light]
model = "sls"
[[light.source]]
position = [0, 0, 25]
direction = [0, 0, 1]
spread = 1
intensity = [3600, 3600, 3600]
[response]
gamma = 2.2
[surface]
[geometry]
kind = "colon"
segment = "transverse"
length_mm = 60
tolerance_mm = 0.2
[trajectory]
kind = "withdrawal"
frames = 4
start_mm = 30
end_mm = 10
)";

TEST(CheckScene, AGoodOneHasNoErrorsAndOddThingsAreWarnings) {
  const ScratchFolder scratch;
  WriteFile(scratch / "scene.toml", kScene);
  const Outcome outcome = Check(scratch / "scene.toml");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.json["scene"]["frames"], 4);
  EXPECT_EQ(outcome.json["scene"]["geometry"]["closed"], true);
  EXPECT_NE(outcome.out.find("warning: light.source.0: lies 25.0 mm from the camera"), std::string::npos);
}

TEST(CheckScene, MistakesAreNamedWithTheirPlace) {
  const ScratchFolder scratch;
  WriteFile(scratch / "scene.toml", std::string(kScene) + "wobbel_mm = 1\n");
  ExpectError(scratch / "scene.toml",
              "scene.toml:23: trajectory.wobbel_mm: unknown key; is \"wobble_mm\" meant?");
  WriteFile(scratch / "scene.toml", "[camera]\npreset = \"fish\"\n");
  ExpectError(scratch / "scene.toml", "scene.toml:2: camera.preset: is \"fish\", but must be one of: ");
}

TEST(CheckUsage, WithoutAPathItIsUsage) {
  const std::string command = std::string(LUMEN_COMMAND) + " check >/dev/null 2>&1";
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 2);
}

}  // namespace
}  // namespace lumen
