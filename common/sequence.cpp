#include "common/sequence.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "common/c3vd_camera.h"
#include "common/calibration.h"
#include "common/config.h"
#include "common/error.h"
#include "common/files.h"
#include "common/frame_files.h"
#include "common/frame_gains.h"
#include "common/frame_lines.h"
#include "common/pose_file.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr char kTomlName[] = "sequence.toml";
constexpr char kCalibrationName[] = "calibration.toml";
constexpr char kPosesName[] = "pose.txt";
constexpr char kMaskName[] = "mask.png";
constexpr char kIntrinsicsName[] = "camera_intrinsics.txt";  // C3VDv2's
constexpr char kCoverageMeshName[] = "coverage_mesh.obj";

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

Image8 ReadMask(const fs::path& file, const CameraIntrinsics& camera) {
  Image8 mask = ReadImage8(file, 1);
  if (mask.width != camera.width || mask.height != camera.height) {
    throw InputError(file.string() + ": the mask has " + std::to_string(mask.width) + "×" +
                     std::to_string(mask.height) + " pixels, the camera " + std::to_string(camera.width) +
                     "×" + std::to_string(camera.height));
  }
  return mask;
}

void ReadToml(Sequence* sequence, FrameGains* gains) {
  const Config config = Config::Read(sequence->folder / kTomlName);
  const ConfigTable root = config.root();
  root.Choice("format", {"lumen-sequence"});
  if (root.Integer("version") != 1) root.Fail("version", "this program reads version 1 only");
  root.Choice("unit", {"mm"});
  Calibration& calibration = sequence->calibration;
  const ConfigTable camera = root.Table("camera");
  calibration.camera = ReadCamera(camera);
  if (camera.Has("mask")) {
    if (!IsFile(camera.Path("mask"))) camera.Fail("mask", "there is no file " + camera.Path("mask").string());
    calibration.mask = ReadMask(camera.Path("mask"), calibration.camera);
  }
  calibration.light = ReadLight(root.Table("light"));
  calibration.response = ReadResponse(root.Table("response"));
  gains->Read(root);
  if (const auto truth = root.Optional("ground_truth"); truth && truth->Has("mesh")) {
    sequence->ground_truth_mesh = truth->Path("mesh").lexically_normal();
    if (!IsFile(sequence->ground_truth_mesh)) {
      truth->Fail("mesh", "there is no file " + sequence->ground_truth_mesh.string());
    }
  }
  config.RejectUnknown();
}

// What `lumen calibrate` has found out: whole tables in place of the sequence's own.
void ReadCalibrationOnTop(Sequence* sequence, FrameGains* gains) {
  const fs::path file = sequence->folder / kCalibrationName;
  if (!IsFile(file)) return;
  const Config config = Config::Read(file);
  const ConfigTable root = config.root();
  root.Choice("format", "lumen-calibration", {"lumen-calibration"});
  if (root.Integer("version", 1) != 1) root.Fail("version", "this program reads version 1 only");
  if (const auto light = root.Optional("light")) sequence->calibration.light = ReadLight(*light);
  if (const auto response = root.Optional("response"))
    sequence->calibration.response = ReadResponse(*response);
  gains->Read(root);
  gains->ReadErrors(root);
  if (const auto uncertainty = root.Optional("uncertainty")) {
    for (const char* key : {"spread", "gamma"}) {
      if (uncertainty->Has(key)) uncertainty->Number(key, kNotNegative);
    }
  }
  config.RejectUnknown();
}

// A C3VD folder's: C3VDv2's layout has C3VDv2's camera, and the file that comes with the data set has the
// last word.
Calibration CalibrationOfDownload(const fs::path& folder) {
  Calibration calibration = C3vdCalibration();
  std::error_code ignored;
  if (fs::is_directory(folder / "rgb", ignored)) calibration.camera = C3vdV2Intrinsics();
  for (const fs::path& place : {folder / kIntrinsicsName, folder / ".." / kIntrinsicsName}) {
    if (!IsFile(place)) continue;
    calibration.camera = ReadC3vdIntrinsics(place);
    calibration.mask = C3vdOctagon(calibration.camera.width, calibration.camera.height);
    break;
  }
  return calibration;
}

std::vector<SequenceFrame> FramesWithColor(const fs::path& folder) {
  std::vector<SequenceFrame> frames;
  for (const auto& [number, files] : FindFrameFiles(folder)) {
    if (files.color.empty()) continue;
    SequenceFrame frame;
    frame.number = number;
    frame.color = files.color;
    frame.depth = files.depth;
    frame.normals = files.normals;
    frame.flow = files.flow;
    frame.occlusion = files.occlusion;
    frames.push_back(frame);
  }
  if (frames.empty()) {
    throw InputError(folder.string() + ": no frame: neither NNNN_color.png nor rgb/NNNN.png is here");
  }
  return frames;
}

// The colour file that a sequence with more poses than frames lacks: at the first gap of the numbers, or at
// the end.
int FirstMissing(const std::vector<int>& numbers) {
  for (size_t i = 1; i < numbers.size(); ++i) {
    if (numbers[i] != numbers[i - 1] + 1) return numbers[i - 1] + 1;
  }
  return numbers.back() + 1;
}

// The numbers below `count` that aren't among these.
std::vector<int> Absent(const std::vector<int>& numbers, size_t count) {
  std::vector<int> absent;
  for (int number = 0; number < static_cast<int>(count); ++number) {
    if (!std::ranges::binary_search(numbers, number)) absent.push_back(number);
  }
  return absent;
}

// Poses and gains. Frames without a pose are errors or, on request, left out; so are, in folders of our own,
// poses without a frame. C3VD's may be a part of a download.
void AssignPosesAndGains(const FrameGains& gains, const ReadOptions& options, Sequence* sequence) {
  const fs::path file = sequence->folder / kPosesName;
  const std::vector<PoseLine> poses = ReadPoseLines(file);
  for (const PoseLine& line : poses) {
    if (!line.pose && !options.skip_damaged) throw DamagedFrame(line.problem);
  }
  std::vector<SequenceFrame>& frames = sequence->frames;
  std::vector<int> numbers;
  for (const SequenceFrame& frame : frames) numbers.push_back(frame.number);
  const std::string counts = file.string() + ": " + std::to_string(poses.size()) + " poses, but " +
                             std::to_string(frames.size()) + " colour files";
  const auto lines = LinesOfFrames(numbers, poses.size());
  if (poses.size() < frames.size() && (!lines || !options.skip_damaged)) {
    const std::string problem = counts + "; add the missing lines or remove the frames from " +
                                frames[poses.size()].color.filename().string() + " on";
    if (lines) throw DamagedFrame(problem);
    throw InputError(problem);  // whose lines are missing can't be told
  }
  if (poses.size() > frames.size() && sequence->has_toml && !(lines && options.skip_damaged)) {
    const std::string problem =
        counts + "; there is no " + FrameFile("", FirstMissing(numbers), "color.png").string();
    if (lines) throw DamagedFrame(problem);
    throw InputError(problem);
  }
  if (!lines) throw InputError(counts + "; " + frames.back().color.filename().string() + " has no line");
  if (poses.size() > frames.size()) {
    sequence->left_out.push_back(counts + "; there is none of frame " +
                                 Ranges(Absent(numbers, poses.size())));
  }
  gains.Assign(*lines, poses.size(), &frames);
  std::vector<SequenceFrame> usable;
  std::vector<int> without_line;
  for (size_t i = 0; i < frames.size(); ++i) {
    const auto line = (*lines)[i];
    if (!line) {
      without_line.push_back(frames[i].number);
    } else if (poses[*line].pose) {
      usable.push_back(frames[i]);
      usable.back().world_from_camera = *poses[*line].pose;
    } else {
      sequence->left_out.push_back(poses[*line].problem + "; frame " + std::to_string(frames[i].number) +
                                   " is left out");
    }
  }
  if (!without_line.empty()) {
    sequence->left_out.push_back(counts + "; frame " + Ranges(without_line) + " is left out");
  }
  if (usable.empty()) throw InputError(file.string() + ": no frame has a pose");
  frames = usable;
}

// A TOML string in quotes.
std::string Quoted(const std::string& text) {
  std::string quoted(1, '"');
  for (char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  quoted += '"';
  return quoted;
}

// All of the frames' gains, or none.
std::vector<double> KnownGains(const std::vector<SequenceFrame>& frames) {
  std::vector<double> gains;
  for (const SequenceFrame& frame : frames) {
    if (frame.gain) gains.push_back(*frame.gain);
  }
  if (!gains.empty() && gains.size() != frames.size()) {
    throw std::logic_error("WriteSequenceHeader: gains are known of all frames or of none");
  }
  return gains;
}

}  // namespace

Image8 C3vdOctagon(int width, int height) {
  constexpr double kCutX = 203.0 / 1350, kCutY = 251.5 / 1080;
  Image8 mask(width, height, 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double left = (x + 0.5) / width, top = (y + 0.5) / height;
      const double dx = std::min(left, 1 - left) / kCutX, dy = std::min(top, 1 - top) / kCutY;
      *mask.Pixel(x, y) = dx + dy >= 1 ? 255 : 0;
    }
  }
  return mask;
}

Calibration C3vdCalibration() {
  Calibration calibration;
  calibration.camera = C3vdIntrinsics();
  calibration.mask = C3vdOctagon(calibration.camera.width, calibration.camera.height);
  calibration.light = EndomapperLight();
  calibration.light.calibrated = false;
  return calibration;
}

Sequence ReadSequence(const fs::path& folder, const ReadOptions& options) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw InputError(folder.string() + ": no such sequence folder");
  Sequence sequence;
  sequence.folder = folder;
  sequence.has_toml = IsFile(folder / kTomlName);
  FrameGains gains;
  if (sequence.has_toml) {
    ReadToml(&sequence, &gains);
  } else {
    sequence.calibration = CalibrationOfDownload(folder);
    if (IsFile(folder / kMaskName)) {
      sequence.calibration.mask = ReadMask(folder / kMaskName, sequence.calibration.camera);
    }
  }
  if (options.calibration) ReadCalibrationOnTop(&sequence, &gains);
  sequence.frames = FramesWithColor(folder);
  AssignPosesAndGains(gains, options, &sequence);
  if (sequence.ground_truth_mesh.empty() && IsFile(folder / kCoverageMeshName)) {
    sequence.ground_truth_mesh = folder / kCoverageMeshName;
  }
  return sequence;
}

void WriteSequenceHeader(const Sequence& sequence) {
  const Calibration& calibration = sequence.calibration;
  const fs::path& folder = sequence.folder;
  std::string text =
      "format = \"lumen-sequence\"\nversion = 1\nunit = \"mm\"\n\n" + CameraText(calibration.camera);
  if (!calibration.mask.empty()) {
    text += "mask = " + Quoted(kMaskName) + "\n";
    WriteImage(folder / kMaskName, calibration.mask);
  }
  text.append("\n").append(LightText(calibration.light));
  text.append("\n").append(ResponseText(calibration.response));
  if (const auto gains = KnownGains(sequence.frames); !gains.empty()) {
    text += "\n[frames]\ngain = " + ArrayText(gains.data(), gains.size()) + "\n";
  }
  if (!sequence.ground_truth_mesh.empty()) {
    const fs::path mesh = fs::proximate(sequence.ground_truth_mesh, folder);
    text += "\n[ground_truth]\nmesh = " + Quoted(mesh.generic_string()) + "\n";
  }
  std::vector<Pose> poses;
  for (const SequenceFrame& frame : sequence.frames) poses.push_back(frame.world_from_camera);
  WriteFile(folder / kPosesName, PosesText(poses));
  WriteFile(folder / kTomlName, text);
}

std::vector<int> UniformFrames(int count, int at_most) {
  const int taken = std::min(count, at_most);
  std::vector<int> frames;
  for (int i = 0; i < taken; ++i) {
    frames.push_back(taken > 1 ? static_cast<int>(std::lround(double(i) * (count - 1) / (taken - 1))) : 0);
  }
  return frames;
}

fs::path FrameFile(const fs::path& folder, int number, const std::string& suffix) {
  char digits[16];
  std::snprintf(digits, sizeof digits, "%04d", number);
  std::string name = digits;
  name.append("_").append(suffix);
  return folder / name;
}

}  // namespace lumen
