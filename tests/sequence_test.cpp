#include "common/sequence.h"

#include <cmath>

#include "common/files.h"
#include "common/pose_file.h"
#include "tests/support.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::ScratchFolder;
using test::SharedData;

// The error of reading a folder, without the folder's own name.
std::string ErrorReading(const ScratchFolder& scratch) {
  std::string error = ErrorOf([&] { ReadSequence(scratch.path()); });
  const std::string folder = scratch.path().string() + "/";
  for (size_t at = error.find(folder); at != std::string::npos; at = error.find(folder)) {
    error.erase(at, folder.size());
  }
  return error;
}

constexpr char kToml[] = R"(format  = "lumen-sequence"
version = 1
unit    = "mm"
[camera]
model = "pinhole"
width = 8
height = 6
cx = 3.5
cy = 2.5
fx = 5
fy = 5.25
[light]
model = "sls"
calibrated = false
[[light.source]]
position = [3.24, 0.55, 0]
direction = [0, 0, 2]
spread = 2.5
intensity = [3600, 3500.5, 3400]
[response]
gamma = 2.2
vignetting = 1
[frames]
gain = [1, 0.5]
)";

constexpr char kIdentity[] = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n";

void WriteColors(const ScratchFolder& scratch, const std::vector<std::string>& names) {
  for (const std::string& name : names) WriteImage(scratch / name, Image8(8, 6, 3, 100));
}

// A small sequence that reads without complaint.
void WriteGood(const ScratchFolder& scratch) {
  WriteFile(scratch / "sequence.toml", kToml);
  WriteFile(scratch / "pose.txt", std::string(kIdentity) + "0,1,0,0,-1,0,0,0,0,0,1,0,5,6,7,1\n");
  WriteColors(scratch, {"0000_color.png", "0001_color.png"});
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST(Sequence, ReadsItsOwnFormat) {
  const ScratchFolder scratch;
  WriteGood(scratch);
  WriteImage(scratch / "0001_flow.tiff", Image16(8, 6, 3));
  const Sequence sequence = ReadSequence(scratch.path());
  EXPECT_TRUE(sequence.has_toml);
  EXPECT_EQ(sequence.calibration.camera.fy, 5.25);
  EXPECT_EQ(sequence.calibration.light.sources.at(0).direction, Vec3d(0, 0, 1));
  EXPECT_EQ(sequence.calibration.light.sources.at(0).intensity, Vec3d(3600, 3500.5, 3400));
  EXPECT_FALSE(sequence.calibration.light.calibrated);
  EXPECT_EQ(sequence.calibration.response.vignetting, 1.0);
  ASSERT_EQ(sequence.frames.size(), 2u);
  EXPECT_EQ(sequence.frames[1].gain, 0.5);
  EXPECT_EQ(sequence.frames[1].color, scratch / "0001_color.png");
  EXPECT_EQ(sequence.frames[1].flow, scratch / "0001_flow.tiff");
  EXPECT_TRUE(sequence.frames[0].flow.empty());
  EXPECT_TRUE(sequence.ground_truth_mesh.empty());
  // Number 12–14 are the translation; the first three numbers are the image of the camera's x axis.
  const Pose& pose = sequence.frames[1].world_from_camera;
  EXPECT_EQ(pose.translation(), Vec3d(5, 6, 7));
  EXPECT_EQ(pose.linear() * Vec3d::UnitX(), Vec3d(0, 1, 0));
  EXPECT_EQ(ReadColor(sequence, sequence.frames[0]).data, Image8(8, 6, 3, 100).data);
  WriteImage(scratch / "0001_color.png", Image8(6, 8, 3));
  EXPECT_EQ(ErrorOf([&] { ReadColor(sequence, sequence.frames[1]); }),
            (scratch / "0001_color.png").string() + ": has 6×8 pixels, the camera 8×6");
}

Sequence Elaborate(const fs::path& folder) {
  Sequence sequence;
  sequence.folder = folder;
  sequence.has_toml = true;
  sequence.calibration.camera = C3vdIntrinsics();
  sequence.calibration.camera.width = 30;
  sequence.calibration.camera.height = 20;
  sequence.calibration.mask = Image8(30, 20, 1, 255);
  *sequence.calibration.mask.Pixel(0, 0) = 0;
  for (int i = 0; i < 3; ++i) {
    LightSource source;
    source.position = Vec3d(1, -2, 1 / 3.0) * (i + M_PI);
    source.direction = Vec3d(i / 7.0, -0.01, 1).normalized();
    source.spread = 2.767302 / (i + 1);
    source.intensity = Vec3d(1e6 / 3, 1e-7, 1e22) * (i + 1);
    sequence.calibration.light.sources.push_back(source);
  }
  sequence.calibration.response.gamma = 1 / 0.45;
  sequence.calibration.response.vignetting = 0.1;
  for (int i = 0; i < 4; ++i) {
    SequenceFrame frame;
    frame.number = i;
    frame.gain = std::exp(i - 0.5);
    frame.world_from_camera.linear() =
        Eigen::AngleAxisd(0.3 * i, Vec3d(1, i, -2).normalized()).toRotationMatrix();
    frame.world_from_camera.translation() = Vec3d(100 / 3.0, -1e-9, 1e5) * i;
    frame.color = FrameFile(folder, i, "color.png");
    sequence.frames.push_back(frame);
    WriteImage(frame.color, Image8(30, 20, 3));
  }
  sequence.ground_truth_mesh = folder / "truth \"1\".ply";
  WriteFile(sequence.ground_truth_mesh, "ply");
  return sequence;
}

TEST(Sequence, HeaderComesBackToTheLastDigit) {
  const ScratchFolder scratch;
  const Sequence wrote = Elaborate(scratch.path());
  WriteSequenceHeader(wrote);
  const Sequence read = ReadSequence(scratch.path());
  const CameraIntrinsics &a = wrote.calibration.camera, &b = read.calibration.camera;
  EXPECT_EQ(a.cx, b.cx);
  EXPECT_EQ(a.cy, b.cy);
  EXPECT_EQ(a.a, b.a);
  EXPECT_EQ(a.stretch, b.stretch);
  EXPECT_EQ(wrote.calibration.mask.data, read.calibration.mask.data);
  ASSERT_EQ(read.calibration.light.sources.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    const LightSource &from = wrote.calibration.light.sources[i], &to = read.calibration.light.sources[i];
    EXPECT_EQ(from.position, to.position);
    EXPECT_EQ(from.direction, to.direction);
    EXPECT_EQ(from.spread, to.spread);
    EXPECT_EQ(from.intensity, to.intensity);
  }
  EXPECT_EQ(wrote.calibration.response.gamma, read.calibration.response.gamma);
  EXPECT_EQ(wrote.calibration.response.vignetting, read.calibration.response.vignetting);
  ASSERT_EQ(read.frames.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(wrote.frames[i].gain, read.frames[i].gain);
    EXPECT_EQ(wrote.frames[i].world_from_camera.matrix(), read.frames[i].world_from_camera.matrix());
  }
  EXPECT_EQ(read.ground_truth_mesh, wrote.ground_truth_mesh);
  const std::string first = ReadFile(scratch / "sequence.toml");
  WriteSequenceHeader(read);
  EXPECT_EQ(ReadFile(scratch / "sequence.toml"), first);
}

TEST(Sequence, OtherCamerasAndResponsesComeBack) {
  const ScratchFolder scratch;
  Sequence wrote = Elaborate(scratch.path());
  wrote.calibration.camera = EndomapperIntrinsics();
  wrote.calibration.mask = Image8();
  wrote.calibration.response = Response{2.2, true, 0};
  wrote.ground_truth_mesh.clear();
  for (SequenceFrame& frame : wrote.frames) frame.gain.reset();
  WriteSequenceHeader(wrote);
  const Sequence read = ReadSequence(scratch.path());
  EXPECT_EQ(read.calibration.camera.model, CameraModel::kKannalaBrandt);
  EXPECT_EQ(read.calibration.camera.k, wrote.calibration.camera.k);
  EXPECT_TRUE(read.calibration.response.srgb);
  EXPECT_TRUE(read.calibration.mask.empty());
  EXPECT_FALSE(read.frames[0].gain.has_value());
  wrote.frames[1].gain = 1;
  EXPECT_THROW(WriteSequenceHeader(wrote), std::logic_error);
}

TEST(Sequence, MistakesInTheTomlAreNamedWithTheirLine) {
  const std::pair<std::string, std::string> kReplacements[] = {
      {"version = 1", "version = 2"},
      {"fx = 5\n", ""},
      {"[light]\nmodel", "[light]\nmodle"},
      {"gain = [1, 0.5]", "gain = [1]"},
      {"spread", "spraed"},
      {"fy = 5.25", "fy = 5.25\nfz = 1"},
      {"3500.5", "0"},
      {"direction = [0, 0, 2]", "direction = [0, 0, 0]"},
      {"gamma = 2.2", "gamma = 0"},
      {"gamma = 2.2", ""},
      {"gain = [1, 0.5]", "gain = [1, -0.5]"},
      {"width = 8", "width = 8.5"},
      {"\"pinhole\"", "\"fisheye\""},
      {"height = 6", "height = 6\nmask = \"none.png\""},
      {"gamma = 2.2", "gamma = 2.2\ntransfer = \"srgb\""}};
  const std::string kErrors[] = {
      "sequence.toml:2: version: this program reads version 1 only",
      "sequence.toml:4: camera.fx: missing; a number is needed",
      "sequence.toml:12: light.model: missing; one of: sls is needed (is \"modle\" a slip of the pen?)",
      "sequence.toml:24: frames.gain: has 1 elements, but there are 2 frames",
      "sequence.toml:15: light.source.0.spread: missing; a number is needed (is \"spraed\" a slip of the "
      "pen?)",
      "sequence.toml:12: camera.fz: unknown key; known here: cx, cy, fx, fy, height, mask, model, width",
      "sequence.toml:19: light.source.0.intensity.1: is 0, but must be above 0",
      "sequence.toml:17: light.source.0.direction: is zero, but must point where the source shines",
      "sequence.toml:21: response.gamma: is 0, but must be between 0.1 and 10",
      "sequence.toml:20: response.gamma: missing; a number is needed",
      "sequence.toml:24: frames.gain.1: is -0.5, but must be above 0",
      "sequence.toml:6: camera.width: is a number with a fraction, but must be an integer (no point, no "
      "exponent)",
      "sequence.toml:5: camera.model: is \"fisheye\", but must be one of: scaramuzza, kannala_brandt, "
      "pinhole",
      "sequence.toml:8: camera.mask: there is no file none.png",
      "sequence.toml:21: response.gamma: excludes transfer = \"srgb\"; keep one of them"};
  for (size_t i = 0; i < std::size(kReplacements); ++i) {
    const ScratchFolder scratch;
    WriteGood(scratch);
    WriteFile(scratch / "sequence.toml", Replaced(kToml, kReplacements[i].first, kReplacements[i].second));
    EXPECT_EQ(ErrorReading(scratch), kErrors[i]);
  }
}

TEST(Sequence, MistakesInThePosesAreNamedWithTheirLine) {
  const std::pair<std::string, std::string> kCases[] = {
      {"1,0,0,0,0,1,0,0,0,0,1,0,0,0,0\n",
       "pose.txt:2: a pose is 16 numbers, camera to world, but here are 15"},
      {"1,0,0,0,0,1,0,0,0,0,1,0,0,0,x,1\n", "pose.txt:2: number 14 is \"x\", which is no number"},
      {"1,0,0,0,0,1,0,0,0,0,1,0,0,0,nan,1\n", "pose.txt:2: number 14 is \"nan\", but must be finite"},
      {"2,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n",
       "pose.txt:2: a pose's 3×3 part is no rotation: off orthonormal by 3"},
      {"-1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n", "pose.txt:2: a pose mirrors: its 3×3 part must be a rotation"},
      {"1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2\n", "pose.txt:2: a pose's last number must be 1"},
      {"1,0,0,4,0,1,0,0,0,0,1,0,1,0,0,1\n",
       "pose.txt:2: a pose with both numbers 3, 7, 11 and 12–14 other than 0"},
      {"1,0,0,4,0,1,0,0,0,0,1,0,0,0,0,1\n1,0,0,0,0,1,0,0,0,0,1,0,4,0,0,1\n",
       "pose.txt:3: a pose is laid out otherwise (transposed) than those before"},
      {"",
       "pose.txt: 1 poses, but 2 colour files; add the missing lines or remove the frames from "
       "0001_color.png on"},
      {std::string(kIdentity) + kIdentity,
       "pose.txt: 3 poses, but 2 colour files; there is no 0002_color.png"},
  };
  for (const auto& [line, error] : kCases) {
    const ScratchFolder scratch;
    WriteGood(scratch);
    WriteFile(scratch / "pose.txt", kIdentity + line);
    EXPECT_EQ(ErrorReading(scratch), error);
  }
}

TEST(Sequence, MissingPartsAreNamed) {
  const ScratchFolder scratch;
  EXPECT_TRUE(ErrorReading(scratch).ends_with(": no frame: neither NNNN_color.png nor rgb/NNNN.png is here"));
  EXPECT_EQ(ErrorOf([] { ReadSequence("/nowhere"); }), "/nowhere: no such sequence folder");
  WriteGood(scratch);
  WriteColors(scratch, {"0003_color.png"});
  WriteFile(scratch / "pose.txt", std::string(kIdentity) + kIdentity + kIdentity + kIdentity);
  EXPECT_EQ(ErrorReading(scratch), "pose.txt: 4 poses, but 3 colour files; there is no 0002_color.png");
  fs::remove(scratch / "pose.txt");
  EXPECT_EQ(ErrorReading(scratch), "pose.txt: cannot read: No such file or directory");
  WriteColors(scratch, {"1_color.png"});
  EXPECT_EQ(ErrorReading(scratch), "1_color.png: frame 1 already has 0001_color.png; remove one of them");
  WriteFile(scratch / "sequence.toml",
            Replaced(kToml, "height = 6", "height = 6\nmask = \"0001_color.png\""));
  WriteImage(scratch / "0001_color.png", Image8(3, 3, 1));
  EXPECT_EQ(ErrorReading(scratch), "0001_color.png: the mask has 3×3 pixels, the camera 8×6");
}

TEST(Sequence, UnfinishedFilesAreNoFrames) {
  const ScratchFolder scratch;
  WriteGood(scratch);
  const PendingFile pending(scratch / "0002_color.png");
  WriteFile(pending.path(), "half");
  EXPECT_EQ(ReadSequence(scratch.path()).frames.size(), 2u);
}

TEST(Sequence, CalibrationComesOnTop) {
  const ScratchFolder scratch;
  WriteGood(scratch);
  WriteFile(scratch / "calibration.toml", "[response]\ngamma = 1.9\n[frames]\ngain = [2, 3]\n");
  const Sequence sequence = ReadSequence(scratch.path());
  EXPECT_EQ(sequence.calibration.response.gamma, 1.9);
  EXPECT_EQ(sequence.calibration.response.vignetting, 0);
  EXPECT_EQ(sequence.frames[1].gain, 3.0);
  EXPECT_EQ(sequence.calibration.light.sources[0].spread, 2.5);
  WriteFile(scratch / "calibration.toml", "[frames]\ngain = [2, 3, 4]\n");
  EXPECT_EQ(ErrorReading(scratch), "calibration.toml:2: frames.gain: has 3 elements, but there are 2 frames");
  WriteFile(scratch / "calibration.toml", "[response]\ngamma = 1.9\ngama = 2\n");
  EXPECT_EQ(ErrorReading(scratch), "calibration.toml:3: response.gama: unknown key; is \"gamma\" meant?");
}

TEST(Sequence, C3vdFirstReleaseIsNotTransposedAndHasNoLeadingZeros) {
  const ScratchFolder scratch;
  WriteFile(scratch / "pose.txt", "0,-1,0,5,1,0,0,6,0,0,1,7,0,0,0,1\n" + std::string(kIdentity) + kIdentity);
  WriteColors(scratch, {"0_color.png", "2_color.png", "10_color.png"});
  WriteImage(scratch / "0002_depth.tiff", Image16(8, 6, 1));
  WriteFile(scratch / "coverage_mesh.obj", "");
  const Sequence sequence = ReadSequence(scratch.path());
  EXPECT_FALSE(sequence.has_toml);
  ASSERT_EQ(sequence.frames.size(), 3u);
  EXPECT_EQ(sequence.frames[2].number, 10);
  EXPECT_EQ(sequence.frames[1].depth, scratch / "0002_depth.tiff");
  EXPECT_EQ(sequence.frames[0].world_from_camera.translation(), Vec3d(5, 6, 7));
  EXPECT_EQ(sequence.frames[0].world_from_camera.linear() * Vec3d::UnitX(), Vec3d(0, 1, 0));
  EXPECT_FALSE(sequence.frames[0].gain.has_value());
  EXPECT_EQ(sequence.ground_truth_mesh, scratch / "coverage_mesh.obj");
  EXPECT_EQ(sequence.calibration.camera.width, 1350);
}

TEST(Sequence, C3vdVersion2HasAFolderAKind) {
  const ScratchFolder scratch;
  for (const char* folder : {"rgb", "depth", "normals", "optical_flow", "occlusions"})
    CreateFolder(scratch / folder);
  WriteFile(scratch / "pose.txt", std::string(kIdentity) + kIdentity);
  WriteColors(scratch, {"rgb/0000.png", "rgb/0001_color.png"});
  WriteImage(scratch / "depth/0001_depth.tiff", Image16(8, 6, 1));
  WriteImage(scratch / "normals/frame_0001.tiff", Image16(8, 6, 3));
  WriteImage(scratch / "optical_flow/0001_flow.tiff", Image16(8, 6, 3));
  WriteImage(scratch / "occlusions/1.png", Image8(8, 6, 1));
  const Sequence sequence = ReadSequence(scratch.path());
  ASSERT_EQ(sequence.frames.size(), 2u);
  const SequenceFrame& frame = sequence.frames[1];
  EXPECT_EQ(frame.color, scratch / "rgb/0001_color.png");
  EXPECT_EQ(frame.depth, scratch / "depth/0001_depth.tiff");
  EXPECT_EQ(frame.normals, scratch / "normals/frame_0001.tiff");
  EXPECT_EQ(frame.flow, scratch / "optical_flow/0001_flow.tiff");
  EXPECT_EQ(frame.occlusion, scratch / "occlusions/1.png");
  EXPECT_TRUE(sequence.frames[0].depth.empty());
}

// A part of a download: the pose file has a line for every frame ever recorded.
TEST(Sequence, C3vdPosesBeyondTheFramesGoByNumber) {
  const ScratchFolder scratch;
  std::string poses;
  for (int i = 0; i < 5; ++i) poses += "1,0,0,0,0,1,0,0,0,0,1,0," + std::to_string(i) + ",0,0,1\n";
  WriteFile(scratch / "pose.txt", poses);
  WriteColors(scratch, {"0001_color.png", "0004_color.png"});
  const Sequence sequence = ReadSequence(scratch.path());
  EXPECT_EQ(sequence.frames[0].world_from_camera.translation().x(), 1);
  EXPECT_EQ(sequence.frames[1].world_from_camera.translation().x(), 4);
  WriteColors(scratch, {"0005_color.png"});
  EXPECT_EQ(ErrorReading(scratch), "pose.txt: 5 poses, but 3 colour files; 0005_color.png has no line");
}

TEST(Poses, FewDigitsBecomeTheNearestRotation) {
  const ScratchFolder scratch;
  WriteFile(scratch / "pose.txt", "0.8661,0.5,0,0,-0.5,0.866,0,0,0,0,1,0,1,2,3,1\n");
  const Pose pose = ReadPoses(scratch / "pose.txt").at(0);
  const Mat3d rotation = pose.linear();
  EXPECT_LT((rotation.transpose() * rotation - Mat3d::Identity()).norm(), 1e-14);
  EXPECT_NEAR(rotation(1, 0), 0.5, 1e-4);
  // As it was written, so it stays.
  WriteFile(scratch / "again.txt", PosesText({pose}));
  EXPECT_EQ(ReadPoses(scratch / "again.txt").at(0).matrix(), pose.matrix());
}

TEST(Poses, ReadsEveryRealTrajectory) {
  LUMEN_NEEDS_DATA("c3vd/poses");
  int files = 0;
  for (const auto& entry : fs::directory_iterator(SharedData("c3vd/poses"))) {
    const auto poses = ReadPoses(entry.path());
    const std::string text = ReadFile(entry.path());
    EXPECT_EQ(poses.size(), static_cast<size_t>(std::count(text.begin(), text.end(), '\n'))) << entry.path();
    // Withdrawals of up to 105 mm at up to some mm a frame.
    for (size_t i = 1; i < poses.size(); ++i) {
      ASSERT_LT((poses[i].translation() - poses[i - 1].translation()).norm(), 5.0)
          << entry.path() << " " << i;
    }
    ++files;
  }
  EXPECT_EQ(files, 22);
}

// Worked by hand from FORMATS: floor(65535·z/100).
TEST(C3vdEncoding, Depth) {
  ImageF z(9, 1, 1);
  z.data = {NAN, 0.0f, -3.0f, 50.0f, 12.5f, 99.9999f, 100.0f, 250.0f, INFINITY};
  EXPECT_EQ(EncodeDepth(z).data, (std::vector<uint16_t>{0, 0, 0, 32767, 8191, 65534, 65535, 65535, 65535}));
  const ImageF back = DecodeDepth(EncodeDepth(z));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(std::isnan(back.data[i]));
  EXPECT_FLOAT_EQ(back.data[3], 32767.5f * 100 / 65535);  // 50: the middle of its step
  EXPECT_TRUE(std::isinf(back.data[6]));
  // Every step comes back, and no depth is off by more than half of one.
  Image16 steps(65536, 1, 1);
  for (int i = 0; i < 65536; ++i) steps.data[i] = static_cast<uint16_t>(i);
  EXPECT_EQ(EncodeDepth(DecodeDepth(steps)).data, steps.data);
}

TEST(C3vdEncoding, Normals) {
  ImageF normal(3, 1, 3);
  normal.data = {0.0f, 1.0f, -1.0f, 0.6f, -0.8f, 0.0f, NAN, NAN, NAN};
  const Image16 encoded = EncodeNormals(normal);
  // (0 + 1)/2·65535 = 32767.5 → 32768; 0.6: 52428; −0.8: 6553.5 less what float takes from −0.8 → 6553.
  EXPECT_EQ(encoded.data, (std::vector<uint16_t>{32768, 65535, 0, 52428, 6553, 32768, 0, 0, 0}));
  const ImageF back = DecodeNormals(encoded);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(back.data[i], normal.data[i], 1.01 / 65535);
  EXPECT_TRUE(std::isnan(back.data[6]));
}

TEST(C3vdEncoding, Flow) {
  ImageF flow(5, 1, 2);
  flow.data = {0.0f, 10.0f, -20.0f, 20.0f, 1.25f, -7.5f, 300.0f, -300.0f, NAN, NAN};
  const Image16 encoded = EncodeFlow(flow);
  // 20/40 → 32767.5 → 32768; 30/40 → 49151.25; 21.25/40 → 34815.47; 12.5/40 → 20479.69.
  EXPECT_EQ(encoded.data,
            (std::vector<uint16_t>{32768, 49151, 0, 0, 65535, 0, 34815, 20480, 0, 65535, 0, 0, 0, 0, 0}));
  const ImageF back = DecodeFlow(encoded);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(back.data[i], flow.data[i], 20.01 / 65535);
  EXPECT_TRUE(std::isnan(back.data[8]));
}

TEST(Sequence, ValidPixelsAreInsideTheMaskAndHaveARay) {
  Calibration calibration;
  calibration.camera = EndomapperIntrinsics();
  const Image8 valid = ValidPixels(calibration);
  EXPECT_EQ(*valid.Pixel(734, 552), 255);
  EXPECT_EQ(*valid.Pixel(0, 0), 0);  // beyond the fold
  calibration.mask = Image8(1440, 1080, 1, 255);
  *calibration.mask.Pixel(734, 552) = 0;
  EXPECT_EQ(*ValidPixels(calibration).Pixel(734, 552), 0);
}

// One real frame with its ground truth: number 10 with the only line of pose.txt.
TEST(Sequence, ReadsTheRealFrame) {
  const std::string folder = "c3vd/trans_t4_a_frame0010";
  LUMEN_NEEDS_DATA(folder);
  const Sequence sequence = ReadSequence(SharedData(folder));
  EXPECT_FALSE(sequence.has_toml);
  ASSERT_EQ(sequence.frames.size(), 1u);
  const SequenceFrame& frame = sequence.frames[0];
  EXPECT_EQ(frame.number, 10);
  EXPECT_NEAR(frame.world_from_camera.translation().x(), 72.8462, 1e-4);
  EXPECT_EQ(ReadColor(sequence, frame).width, 1350);
  // Where there is depth the normals are unit vectors that face the camera (they were decoded from 8 bits).
  const ImageF z = DecodeDepth(ReadImage16(frame.depth, 1));
  const ImageF normal = DecodeNormals(ReadImage16(frame.normals, 3));
  const Camera<double> camera(sequence.calibration.camera);
  const Image8 valid = ValidPixels(sequence.calibration);
  int seen = 0, unit = 0, facing = 0;
  for (int y = 0; y < z.height; y += 3) {
    for (int x = 0; x < z.width; x += 3) {
      if (!*valid.Pixel(x, y) || !std::isfinite(*z.Pixel(x, y))) continue;
      const float* n = normal.Pixel(x, y);
      const Vec3d direction(n[0], n[1], n[2]);
      ++seen;
      unit += std::abs(direction.norm() - 1) < 0.02;
      facing += camera.Unproject(Vec2d(x, y))->dot(direction) < 0.02;
    }
  }
  EXPECT_GT(seen, 100000);
  EXPECT_GT(unit, 0.99 * seen);
  EXPECT_GT(facing, 0.99 * seen);
}

}  // namespace
}  // namespace lumen
