#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "common/files.h"
#include "common/image.h"
#include "common/mesh.h"
#include "common/pose_file.h"
#include "recon/evaluation/colormap.h"
#include "recon/evaluation/evaluate.h"
#include "recon/evaluation/evaluation_json.h"
#include "tests/evaluation_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

// A sequence of three frames in a cube, with its truth, and a reconstruction that is 1 mm too small.
class EvaluateCommand : public testing::Test {
 protected:
  EvaluateCommand() {
    sequence_ = test::PinholeSequence({test::At(0, 0, 0), test::At(1, 2, 3), test::At(3, 2, 1)});
    sequence_.folder = scratch_ / "sequence";
    CreateFolder(sequence_.folder);
    for (SequenceFrame& frame : sequence_.frames) {
      frame.gain = 1.0;
      frame.color = FrameFile(sequence_.folder, frame.number, "color.png");
      WriteImage(frame.color, Image8(200, 200, 3, 90));
    }
    sequence_.ground_truth_mesh = sequence_.folder / "mesh.ply";
    WriteMesh(sequence_.ground_truth_mesh, test::Cube(20, 6));
    WriteSequenceHeader(sequence_);
    WriteMesh(scratch_ / "mesh.ply", reconstruction_);
  }

  // The exit code; what it said is in the scratch folder's out and err.
  int Run(const std::string& arguments) {
    const std::string command = std::string(LUMEN_COMMAND) + " evaluate " + arguments + " >'" +
                                (scratch_ / "out").string() + "' 2>'" + (scratch_ / "err").string() + "'";
    return WEXITSTATUS(std::system(command.c_str()));
  }
  std::string Path(const std::string& name) const { return "'" + (scratch_ / name).string() + "'"; }
  std::string Err() const { return ReadFile(scratch_ / "err"); }

  test::ScratchFolder scratch_;
  Sequence sequence_;
  Mesh reconstruction_ = test::Cube(19, 6);
};

TEST_F(EvaluateCommand, WritesTheTableTheJsonAndThePictures) {
  ASSERT_EQ(
      Run(Path("mesh.ply") + " " + Path("sequence") + " -o " + Path("result") + " --json " + Path("json")), 0)
      << Err();
  const nlohmann::json json = nlohmann::json::parse(ReadFile(scratch_ / "json"));
  EXPECT_EQ(json, ToJson(Evaluate(reconstruction_, sequence_)));
  EXPECT_EQ(json, nlohmann::json::parse(ReadFile(scratch_ / "result" / "evaluation.json")));
  EXPECT_NEAR(json["surveyed"]["mae_mm"], 1, 1e-9);
  for (const std::string name : {"error.png", "views.png", "sheet.png", "walk.png"}) {
    EXPECT_GT(ReadImage8(scratch_ / "result" / name, 3).width, 600) << name;
  }
  // 1 mm inside everywhere; of the truth's corners and middles only some are seen.
  const Mesh error = ReadMesh(scratch_ / "result" / "error.ply");
  EXPECT_EQ(error.colors, std::vector<Rgb8>(reconstruction_.vertices.size(), Seismic(-0.1)));
  const std::vector<Rgb8> views = ReadMesh(scratch_ / "result" / "views.ply").colors;
  EXPECT_EQ(views.size(), test::Cube(20, 6).vertices.size());
  EXPECT_GT(std::count(views.begin(), views.end(), kUnobservedGrey), 50);
  EXPECT_GT(std::count(views.begin(), views.end(), Jet(1)), 10);
  EXPECT_EQ(ReadMesh(scratch_ / "result" / "unseen.ply").vertices.size(), reconstruction_.vertices.size());
  EXPECT_NE(ReadFile(scratch_ / "out").find("by the reconstruction alone"), std::string::npos);
  EXPECT_NE(ReadFile(scratch_ / "out").find("surveyed         1.000    1.000    1.000"), std::string::npos);
}

// A run that is right but for where and how large its world is: the truth, and its cameras, by one
// similarity.
TEST_F(EvaluateCommand, AlignsByTheRunsPoses) {
  const Mat3d turn = Eigen::AngleAxisd(0.03, Vec3d(1, 2, -1).normalized()).toRotationMatrix();
  const auto moved = [&](const Vec3d& x) -> Vec3d { return 1.02 * (turn * x) + Vec3d(0.4, -0.2, 0.1); };
  Mesh mesh = test::Cube(20, 6);
  for (Vec3d& vertex : mesh.vertices) vertex = moved(vertex);
  std::vector<Pose> poses;
  for (const SequenceFrame& frame : sequence_.frames) {
    Pose pose = frame.world_from_camera;
    pose.linear() = turn * pose.linear();
    pose.translation() = moved(pose.translation());
    poses.push_back(pose);
  }
  CreateFolder(scratch_ / "run");
  WriteMesh(scratch_ / "run" / "mesh.ply", mesh);
  const std::string arguments =
      Path("run/mesh.ply") + " " + Path("sequence") + " --align --json " + Path("json");
  EXPECT_EQ(Run(arguments), 1);
  EXPECT_NE(Err().find("poses.refine=true"), std::string::npos) << Err();
  WriteFile(scratch_ / "run" / "pose.txt", PosesText(poses));
  ASSERT_EQ(Run(arguments), 0) << Err();
  const nlohmann::json json = nlohmann::json::parse(ReadFile(scratch_ / "json"));
  EXPECT_GT(json["surveyed"]["mae_mm"], 0.2);              // as it lies
  EXPECT_LT(json["aligned"]["surveyed"]["mae_mm"], 1e-4);  // floats in the PLY
  EXPECT_NEAR(json["aligned"]["alignment"]["scale"], 1 / 1.02, 1e-6);
  EXPECT_NEAR(json["aligned"]["alignment"]["turn_rad"], 0.03, 1e-6);
  EXPECT_LT(json["aligned"]["alignment"]["rms_mm"], 1e-6);
}

TEST_F(EvaluateCommand, NamesWhatIsWrongInOneLine) {
  const auto expect_error = [&](const std::string& arguments, const std::string& text) {
    EXPECT_EQ(Run(arguments), 1);
    const std::string said = Err();
    EXPECT_NE(said.find(text), std::string::npos) << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  };
  expect_error(Path("missing.ply") + " " + Path("sequence"), "missing.ply");
  expect_error(Path("mesh.ply") + " " + Path("nowhere"), "nowhere");

  Mesh flat = reconstruction_;
  for (Vec3d& vertex : flat.vertices) vertex.setZero();
  WriteMesh(scratch_ / "flat.ply", flat);
  expect_error(Path("flat.ply") + " " + Path("sequence"), "flat.ply has no area");

  std::filesystem::remove(sequence_.ground_truth_mesh);
  sequence_.ground_truth_mesh.clear();
  WriteSequenceHeader(sequence_);
  expect_error(Path("mesh.ply") + " " + Path("sequence"), "no ground truth");
  EXPECT_EQ(Run(Path("mesh.ply")), 2);
}

}  // namespace
}  // namespace lumen
