// C3VD folders as they were downloaded: what the releases differ in, and what downloads lack.
#include <sys/wait.h>

#include <cstdlib>

#include "common/c3vd_camera.h"
#include "common/files.h"
#include "common/line_reader.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/sequence.h"
#include "recon/evaluation/evaluate.h"
#include "recon/training/train.h"
#include "sim/render.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::ScratchFolder;

// Frames with their truth in today's layout of C3VD v1, without anything of ours.
fs::path Rendered(const fs::path& folder, int width, int height, int frames) {
  SetQuiet(true);
  const Scene scene = ReadScene(
      LUMEN_SOURCE_FOLDER "/scenes/colon.toml",
      {"camera.width=" + std::to_string(width), "camera.height=" + std::to_string(height),
       "trajectory.frames=" + std::to_string(frames), "path.samples=1", "geometry.tolerance_mm=0.4"},
      0);
  RenderOptions options;
  options.folder = folder;
  Render(scene, options);
  for (const char* ours : {"sequence.toml", "mask.png", "mesh.ply"}) fs::remove(folder / ours);
  return folder;
}

// Five frames of a fifth of C3VD's size, with the file that says so.
const fs::path& SmallDownload() {
  static const ScratchFolder scratch;
  static const fs::path folder = [] {
    const fs::path rendered = Rendered(scratch / "small", 270, 216, 5);
    const CameraIntrinsics camera = Resized(C3vdIntrinsics(), 270, 216);
    std::string text = "; omnidirectional camera intrinsics\nwidth = 270\nheight = 216\n";
    const auto add = [&](const std::string& name, double value) {
      AppendNumber(&(text += name + " = "), value);
      text += '\n';
    };
    add("cx", camera.cx);
    add("cy", camera.cy);
    for (int i = 0; i < 5; ++i) add("a" + std::to_string(i), camera.a[i]);
    add("c", camera.stretch[0]);
    add("d", camera.stretch[1]);
    add("e", camera.stretch[2]);
    WriteFile(rendered / "camera_intrinsics.txt", text);
    return rendered;
  }();
  return folder;
}

// The files of a folder under other names; one without a name is left out.
template <class Rename>
void Download(const fs::path& from, const fs::path& folder, const Rename& rename) {
  for (const auto& entry : fs::directory_iterator(from)) {
    if (!entry.is_regular_file()) continue;
    const std::string name = rename(entry.path().filename().string());
    if (name.empty()) continue;
    CreateFolder((folder / name).parent_path());
    fs::create_symlink(entry.path(), folder / name);
  }
}

std::string AsItIs(const std::string& name) { return name; }

// A file of its own in place of the rendered one.
void Replace(const fs::path& file, const std::string& bytes) {
  fs::remove(file);
  WriteFile(file, bytes);
}

struct Outcome {
  int exit_code;
  std::string said;  // on stderr
};

Outcome Lumen(const std::string& arguments) {
  const ScratchFolder scratch;
  const std::string command =
      std::string(LUMEN_COMMAND) + " " + arguments + " >/dev/null 2>'" + (scratch / "err").string() + "'";
  const int exit_code = WEXITSTATUS(std::system(command.c_str()));
  return {exit_code, ReadFile(scratch / "err")};
}

constexpr char kFewSteps[] =
    " --iterations 10 --set sampling.rays=96 --set extract.cell_mm=4 --set grid.log2_table_size=10";

// The first release, of C3VD's size: poses not transposed, cecum_t1_a's colour files without leading zeros;
// TIFFs compressed.
TEST(Download, FirstReleaseTrainsAndIsEvaluated) {
  const ScratchFolder scratch;
  const fs::path folder = scratch / "cecum_t1_a";
  const fs::path rendered = Rendered(scratch / "rendered", 1350, 1080, 3);
  Download(rendered, folder,
           [](const std::string& name) { return name.ends_with("_color.png") ? name.substr(3) : name; });
  ASSERT_TRUE(fs::exists(folder / "2_color.png"));
  std::string rows;
  const std::vector<Pose> poses = ReadPoses(rendered / "pose.txt");
  for (const Pose& pose : poses) {
    for (int i = 0; i < 16; ++i) {
      rows += std::to_string(pose.matrix()(i / 4, i % 4)) + (i < 15 ? "," : "\n");
    }
  }
  Replace(folder / "pose.txt", rows);
  const std::string depth = (folder / "0002_depth.tiff").string();
  fs::remove(depth);
  const std::string compress = "oiiotool '" + (rendered / "0002_depth.tiff").string() +
                               "' --compression lzw -o '" + depth + "' >/dev/null";
  ASSERT_EQ(std::system(compress.c_str()), 0);
  ASSERT_LT(fs::file_size(depth), fs::file_size(rendered / "0002_depth.tiff") / 2);

  const Sequence sequence = ReadSequence(folder);
  EXPECT_FALSE(sequence.has_toml);
  EXPECT_TRUE(sequence.left_out.empty());
  ASSERT_EQ(sequence.frames.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    // Six digits behind the point.
    EXPECT_TRUE(sequence.frames[i].world_from_camera.isApprox(poses[i], 1e-5));
  }
  EXPECT_EQ(ReadImage16(sequence.frames[2].depth, 1).data, ReadImage16(rendered / "0002_depth.tiff", 1).data);
  TrainRun run;
  run.folder = scratch / "run";
  EXPECT_EQ(Train(sequence,
                  ReadTrainOptions("fast", {"schedule.iterations=10", "schedule.seconds=0",
                                            "sampling.rays=96", "extract.cell_mm=4"}),
                  run)
                .iterations,
            10);
  const Evaluation evaluation =
      Evaluate(ReadMesh(run.folder / "mesh.ply"), sequence, {.completeness_points = 2000});
  EXPECT_GT(evaluation.surveyed.vertices, 100);
  EXPECT_GT(evaluation.coverage.observed_fraction, 0.1);
}

// C3VDv2's folders, and a part of the download: a line of pose.txt for every frame that was
// recorded, two frames missing at the end.
TEST(Download, Version2WithFramesMissingTrainsAndIsEvaluated) {
  const ScratchFolder scratch;
  const fs::path folder = scratch / "c1_ascending_t1_v1";
  Download(SmallDownload(), folder, [](const std::string& name) -> std::string {
    const std::string number = name.substr(0, 4);
    if (number == "0003" || number == "0004") return "";
    if (name.ends_with("_color.png")) return "rgb/" + number + ".png";
    if (name.ends_with("_depth.tiff")) return "depth/" + name;
    if (name.ends_with("_normals.tiff")) return "normals/" + name;
    if (name.ends_with("_flow.tiff")) return "optical_flow/" + name;
    if (name.ends_with("_occlusion.png")) return "occlusions/" + name;
    return name;
  });
  const Sequence sequence = ReadSequence(folder);
  ASSERT_EQ(sequence.frames.size(), 3u);
  for (const SequenceFrame& frame : sequence.frames) {
    EXPECT_FALSE(frame.depth.empty() || frame.normals.empty() || frame.occlusion.empty());
    EXPECT_EQ(frame.flow.empty(), frame.number == 0);
  }
  EXPECT_EQ(sequence.calibration.camera.width, 270);
  const std::string missing =
      (folder / "pose.txt").string() + ": 5 poses, but 3 colour files; there is none of frame 3–4";
  EXPECT_EQ(sequence.left_out, std::vector<std::string>{missing});

  const Outcome trained =
      Lumen("train '" + folder.string() + "' -o '" + (scratch / "run").string() + "'" + kFewSteps);
  EXPECT_EQ(trained.exit_code, 0);
  EXPECT_NE(trained.said.find(missing + "\n"), std::string::npos) << trained.said;
  const Outcome evaluated =
      Lumen("evaluate '" + (scratch / "run/mesh.ply").string() + "' '" + folder.string() + "'");
  EXPECT_EQ(evaluated.exit_code, 0) << evaluated.said;
  EXPECT_EQ(evaluated.said, missing + "\n");
}

// A picture cut short and a line short of numbers: refused in one line each, or left out.
TEST(Download, DamagedFramesAreRefusedOrLeftOut) {
  const ScratchFolder scratch;
  const fs::path folder = scratch / "trans_t1_a";
  Download(SmallDownload(), folder, AsItIs);
  const std::string png = ReadFile(folder / "0001_color.png");
  Replace(folder / "0001_color.png", png.substr(0, png.size() / 2));
  std::string poses = ReadFile(folder / "pose.txt");
  size_t third = 0;
  for (int line = 0; line < 3; ++line) third = poses.find('\n', third) + 1;
  const std::string in_quotes = "'" + folder.string() + "'";
  const auto train = [&](const std::string& more) {
    return Lumen("train " + in_quotes + " -o '" + (scratch / "run").string() + "'" + kFewSteps + more);
  };
  const std::string cut =
      (folder / "0001_color.png").string() + ": damaged or cut short: the PNG file has no end; ";
  EXPECT_EQ(train("").said, "lumen: " + cut + "--skip-damaged uses the other frames\n");

  poses.erase(poses.find(',', third), poses.find('\n', third) - poses.find(',', third));
  Replace(folder / "pose.txt", poses);
  const std::string short_line =
      (folder / "pose.txt").string() + ":4: a pose is 16 numbers, camera to world, but here are 1; ";
  const Outcome refused = train("");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.said, "lumen: " + short_line + "--skip-damaged uses the other frames\n");
  EXPECT_EQ(Lumen("evaluate x.ply " + in_quotes).said, refused.said);

  const Outcome trained = train(" --skip-damaged");
  EXPECT_EQ(trained.exit_code, 0);
  const std::string named = short_line + "frame 3 is left out\n" + cut + "the frame is left out\n";
  EXPECT_EQ(trained.said.substr(0, named.size()), named);
  const Outcome evaluated = Lumen("evaluate --skip-damaged '" + (scratch / "run/mesh.ply").string() + "' " +
                                  in_quotes + " -o '" + (scratch / "result").string() + "'");
  EXPECT_EQ(evaluated.exit_code, 0);
  EXPECT_EQ(evaluated.said.substr(0, named.size()), named);
}

// The gains of the frames that are left are estimated, and stay those frames' own whoever reads them.
TEST(Download, DamagedFramesAreLeftOutOfACalibration) {
  const ScratchFolder scratch;
  const fs::path folder = scratch / "trans_t1_a";
  Download(SmallDownload(), folder, AsItIs);
  const std::string png = ReadFile(folder / "0001_color.png");
  Replace(folder / "0001_color.png", png.substr(0, png.size() / 2));
  const std::string calibrate = "calibrate '" + folder.string() +
                                "' --set surface.iterations=30 --set surface.cell_mm=2 "
                                "--set places.count=300 --set places.shared=2";
  const std::string cut =
      (folder / "0001_color.png").string() + ": damaged or cut short: the PNG file has no end; ";
  const Outcome refused = Lumen(calibrate);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(refused.said, "lumen: " + cut + "--skip-damaged uses the other frames\n");
  const Outcome calibrated = Lumen(calibrate + " --skip-damaged");
  ASSERT_EQ(calibrated.exit_code, 0) << calibrated.said;
  EXPECT_EQ(calibrated.said.substr(0, cut.size()), cut);
  const std::string toml = ReadFile(folder / "calibration.toml");
  EXPECT_NE(toml.find("number = [0, 2, 3, 4]"), std::string::npos) << toml;

  // With all frames in place the one that was damaged has no gain, the others theirs.
  Replace(folder / "0001_color.png", png);
  const Sequence whole = ReadSequence(folder);
  ASSERT_EQ(whole.frames.size(), 5u);
  for (const SequenceFrame& frame : whole.frames) {
    EXPECT_EQ(frame.gain.has_value(), frame.number != 1);
    EXPECT_EQ(frame.log_gain_error.has_value(), frame.number != 1);
  }
  EXPECT_EQ(whole.frames[0].gain, 1);
  fs::remove(folder / "0001_color.png");
  const Sequence part = ReadSequence(folder, {.skip_damaged = true});
  ASSERT_EQ(part.frames.size(), 4u);
  for (const SequenceFrame& frame : part.frames)
    EXPECT_EQ(frame.gain, whole.frames[static_cast<size_t>(frame.number)].gain);
  // Training goes on from them.
  const Outcome trained = Lumen("train '" + folder.string() + "' -o '" + (scratch / "run").string() + "'" +
                                kFewSteps + " --skip-damaged");
  EXPECT_EQ(trained.exit_code, 0) << trained.said;
}

// Small folders of our own from here on.

constexpr char kToml[] = R"(format = "lumen-sequence"
version = 1
unit = "mm"
[camera]
model = "pinhole"
width = 8
height = 6
cx = 3.5
cy = 2.5
fx = 5
fy = 5
[light]
model = "sls"
calibrated = false
[[light.source]]
position = [0, 0, 0]
direction = [0, 0, 1]
spread = 2.5
intensity = [1, 1, 1]
[response]
gamma = 2.2
[frames]
gain = [1, 2, 3, 4]
)";

std::string PoseAt(int x_mm) { return "1,0,0,0,0,1,0,0,0,0,1,0," + std::to_string(x_mm) + ",0,0,1\n"; }

// Frames 0 … 3 at x = 0 … 3, with gains 1 … 4.
class DamagedSequence : public testing::Test {
 protected:
  DamagedSequence() {
    WriteFile(scratch_ / "sequence.toml", kToml);
    WritePoses({0, 1, 2, 3});
    for (int i = 0; i < 4; ++i) WriteImage(Color(i), Image8(8, 6, 3, 100));
  }
  fs::path Color(int number) const { return FrameFile(scratch_.path(), number, "color.png"); }
  void WritePoses(const std::vector<int>& places) {
    std::string text;
    for (int x : places) text += PoseAt(x);
    WriteFile(scratch_ / "pose.txt", text);
  }
  // With --skip-damaged; its frames must stand at their numbers, with their gains.
  Sequence ReadRest() {
    Sequence sequence = ReadSequence(scratch_.path(), {.skip_damaged = true});
    LeaveOutUnreadableFrames(&sequence);
    for (const SequenceFrame& frame : sequence.frames) {
      EXPECT_EQ(frame.world_from_camera.translation().x(), frame.number);
      EXPECT_EQ(frame.gain, frame.number + 1.0);
    }
    return sequence;
  }
  std::string Refusal() const {
    try {
      ReadSequence(scratch_.path());
    } catch (const DamagedFrame& error) {
      return error.what();
    }
    return "";
  }
  std::string Poses(const std::string& problem) const { return (scratch_ / "pose.txt").string() + problem; }

  ScratchFolder scratch_;
};

TEST_F(DamagedSequence, AWholeOneLosesNothing) {
  EXPECT_EQ(ReadRest().frames.size(), 4u);
  EXPECT_TRUE(ReadRest().left_out.empty());
}

TEST_F(DamagedSequence, FramesMissingAtTheEnd) {
  fs::remove(Color(3));
  EXPECT_EQ(Refusal(), Poses(": 4 poses, but 3 colour files; there is no 0003_color.png"));
  const Sequence rest = ReadRest();
  EXPECT_EQ(rest.frames.size(), 3u);
  EXPECT_EQ(rest.left_out,
            std::vector<std::string>{Poses(": 4 poses, but 3 colour files; there is none of frame 3")});
}

TEST_F(DamagedSequence, FramesMissingInBetween) {
  fs::remove(Color(1));
  EXPECT_EQ(Refusal(), Poses(": 4 poses, but 3 colour files; there is no 0001_color.png"));
  EXPECT_EQ(ReadRest().frames.size(), 3u);
}

TEST_F(DamagedSequence, LinesMissingAtTheEnd) {
  WritePoses({0, 1});
  EXPECT_EQ(Refusal(), Poses(": 2 poses, but 4 colour files; add the missing lines or remove the frames from "
                             "0002_color.png on"));
  const Sequence rest = ReadRest();
  EXPECT_EQ(rest.frames.size(), 2u);
  EXPECT_EQ(rest.left_out,
            std::vector<std::string>{Poses(": 2 poses, but 4 colour files; frame 2–3 is left out")});
}

TEST_F(DamagedSequence, ALineCutShortAndAPictureOfAnotherSize) {
  WriteFile(scratch_ / "pose.txt", PoseAt(0) + PoseAt(1) + PoseAt(2) + "1,0,0,0,0,1,0,0,0,0,1");
  WriteImage(Color(0), Image8(6, 8, 3, 100));
  EXPECT_EQ(Refusal(), Poses(":4: a pose is 16 numbers, camera to world, but here are 11"));
  const Sequence rest = ReadRest();
  ASSERT_EQ(rest.frames.size(), 2u);
  EXPECT_EQ(rest.frames[0].number, 1);
  EXPECT_EQ(rest.left_out,
            (std::vector<std::string>{
                Poses(":4: a pose is 16 numbers, camera to world, but here are 11; frame 3 is left out"),
                Color(0).string() + ": has 6×8 pixels, the camera 8×6; the frame is left out"}));
}

// Gains by frame number hold whichever frames and lines are here; the others' are unknown.
TEST_F(DamagedSequence, GainsOfSomeFrames) {
  const auto with_gains = [&](const std::string& frames) {
    const std::string toml = kToml;
    WriteFile(scratch_ / "sequence.toml", toml.substr(0, toml.find("[frames]")) + "[frames]\n" + frames);
  };
  with_gains("number = [0, 2, 7]\ngain = [1, 3, 9]\n");
  for (const bool whole : {true, false}) {
    if (!whole) fs::remove(Color(1));
    for (const SequenceFrame& frame : ReadSequence(scratch_.path(), {.skip_damaged = true}).frames) {
      EXPECT_EQ(frame.gain.has_value(), frame.number % 2 == 0);
      EXPECT_EQ(frame.gain.value_or(0), frame.number % 2 == 0 ? frame.number + 1 : 0);
    }
  }
  const auto complaint = [&](const std::string& frames) {
    with_gains(frames);
    return ErrorOf([&] { ReadSequence(scratch_.path(), {.skip_damaged = true}); });
  };
  EXPECT_NE(complaint("number = [2, 0]\ngain = [1, 2]\n").find("whole numbers in ascending order"),
            std::string::npos);
  EXPECT_NE(complaint("number = [0, 1.5]\ngain = [1, 2]\n").find("whole numbers in ascending order"),
            std::string::npos);
  EXPECT_NE(complaint("number = [0]\ngain = [1, 2]\n"), "");
  EXPECT_NE(complaint("number = [8, 9]\ngain = [1, 2]\n").find("none of these frames is here"),
            std::string::npos);
}

// Where it can't be told which pose is whose, nothing is guessed.
TEST_F(DamagedSequence, AmbiguousOnesAreRefusedAllTheSame) {
  const auto refused = [&] {
    return ErrorOf([&] { ReadSequence(scratch_.path(), {.skip_damaged = true}); });
  };
  fs::remove(Color(1));
  WritePoses({0, 1});
  EXPECT_NE(refused().find("2 poses, but 3 colour files"), std::string::npos) << refused();
  for (int i : {0, 2}) fs::rename(Color(i), Color(i + 10));
  fs::rename(Color(3), Color(13));
  WritePoses({10, 11, 12, 13});
  EXPECT_NE(refused().find("4 poses, but 3 colour files"), std::string::npos) << refused();
}

TEST_F(DamagedSequence, NothingLeftIsRefused) {
  for (int i = 0; i < 4; ++i) WriteFile(Color(i), "");
  EXPECT_NE(ErrorOf([&] { ReadRest(); }).find("none is left"), std::string::npos);
  WriteFile(scratch_ / "pose.txt", "x\nx\nx\nx\n");
  EXPECT_EQ(ErrorOf([&] { ReadRest(); }), Poses(": no frame has a pose"));
}

// C3VDv2's camera comes with the data set.
TEST(C3vdIntrinsics, AreReadFromTheirFile) {
  const ScratchFolder scratch;
  const std::string good =
      "; omnidirectional camera intrinsics\nwidth = 20\nheight = 10\ncx = 9.5\ncy = 4.5\na0 = 7.5\na1 = 0.0\n"
      "a2 = -1e-3\na3 = 0\na4 = 0\nc = 0.9999\nd = 1.10e-4\ne = -1.83e-4\n";
  const fs::path file = scratch / "camera_intrinsics.txt";
  WriteFile(file, good);
  CreateFolder(scratch / "video/rgb");
  WriteImage(scratch / "video/rgb/0000.png", Image8(20, 10, 3));
  WriteFile(scratch / "video/pose.txt", PoseAt(0));
  CameraIntrinsics camera = ReadSequence(scratch / "video").calibration.camera;
  EXPECT_EQ(camera.width, 20);
  EXPECT_EQ(camera.a[2], -1e-3);
  EXPECT_EQ(camera.stretch[2], -1.83e-4);
  // Where the file hasn't come along, the folder's layout tells the camera.
  fs::remove(file);
  camera = ReadSequence(scratch / "video").calibration.camera;
  EXPECT_EQ(camera.cx, 677.739464094188);
  EXPECT_EQ(camera.a[0], C3vdV2Intrinsics().a[0]);
  const auto error_with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    WriteFile(file, text.replace(text.find(from), from.size(), to));
    return ErrorOf([&] { ReadC3vdIntrinsics(file); }).substr(file.string().size());
  };
  EXPECT_EQ(error_with("a4 = 0\n", ""), ": says nothing of a4");
  EXPECT_EQ(error_with("cx = 9.5", "cx = x"), ":4: cx is \"x\", which is no number");
  EXPECT_EQ(error_with("a1", "b1"), ":7: \"b1\" is no number of the camera, or stands here twice");
  EXPECT_EQ(error_with("a3 = 0", "a3 0"), ":9: \"a3 = number\" is needed");
  EXPECT_EQ(error_with("a0 = 7.5", "a0 = -7.5"),
            ": camera: a[0] must be positive (z points forward), not -7.500000");
}

}  // namespace
}  // namespace lumen
