#include "common/sequence.h"

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "common/calibration.h"
#include "common/config.h"
#include "common/error.h"
#include "common/files.h"
#include "common/frame_files.h"
#include "common/line_reader.h"
#include "common/parallel.h"
#include "common/pose_file.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr char kTomlName[] = "sequence.toml";
constexpr char kCalibrationName[] = "calibration.toml";
constexpr char kPosesName[] = "pose.txt";
constexpr char kMaskName[] = "mask.png";
constexpr char kCoverageMeshName[] = "coverage_mesh.obj";
// Mask values from here on are image.
constexpr uint8_t kMaskThreshold = 128;

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

// The gains of [frames], where there are any, with the place to complain about.
struct Gains {
  std::vector<double> values;
  std::optional<ConfigTable> table;
};

void ReadGains(const ConfigTable& root, Gains* gains) {
  const auto frames = root.Optional("frames");
  if (!frames || !frames->Has("gain")) return;
  gains->values = frames->Numbers("gain", 0, kPositive);
  gains->table = frames;
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

void ReadToml(Sequence* sequence, Gains* gains) {
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
  ReadGains(root, gains);
  if (const auto truth = root.Optional("ground_truth"); truth && truth->Has("mesh")) {
    sequence->ground_truth_mesh = truth->Path("mesh").lexically_normal();
    if (!IsFile(sequence->ground_truth_mesh)) {
      truth->Fail("mesh", "there is no file " + sequence->ground_truth_mesh.string());
    }
  }
  config.RejectUnknown();
}

// What `lumen calibrate` has found out: whole tables in place of the sequence's own.
void ReadCalibrationOnTop(Sequence* sequence, Gains* gains) {
  const fs::path file = sequence->folder / kCalibrationName;
  if (!IsFile(file)) return;
  const Config config = Config::Read(file);
  const ConfigTable root = config.root();
  if (const auto light = root.Optional("light")) sequence->calibration.light = ReadLight(*light);
  if (const auto response = root.Optional("response"))
    sequence->calibration.response = ReadResponse(*response);
  ReadGains(root, gains);
  config.RejectUnknown();
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
int FirstMissing(const std::vector<SequenceFrame>& frames) {
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].number != frames[i - 1].number + 1) return frames[i - 1].number + 1;
  }
  return frames.back().number + 1;
}

// A pose file has a line for every frame that is here, in order; or, in C3VD folders, for every frame that
// was ever recorded (a part of a download, sigmoid_t1_a): then the number of the frame is that of its line.
void AssignPoses(Sequence* sequence) {
  const fs::path file = sequence->folder / kPosesName;
  const std::vector<Pose> poses = ReadPoses(file);
  std::vector<SequenceFrame>& frames = sequence->frames;
  const std::string counts =
      ": " + std::to_string(poses.size()) + " poses, but " + std::to_string(frames.size()) + " colour files";
  const bool in_order = poses.size() == frames.size();
  if (poses.size() < frames.size()) {
    throw InputError(file.string() + counts + "; add the missing lines or remove the frames from " +
                     frames[poses.size()].color.filename().string() + " on");
  }
  if (!in_order && sequence->has_toml) {
    throw InputError(file.string() + counts + "; there is no " +
                     FrameFile("", FirstMissing(frames), "color.png").string());
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    const size_t line = in_order ? i : static_cast<size_t>(frames[i].number);
    if (line >= poses.size()) {
      throw InputError(file.string() + counts + "; " + frames[i].color.filename().string() + " has no line");
    }
    frames[i].world_from_camera = poses[line];
  }
}

void AssignGains(const Gains& gains, std::vector<SequenceFrame>* frames) {
  if (!gains.table) return;
  if (gains.values.size() != frames->size()) {
    gains.table->Fail("gain", "has " + std::to_string(gains.values.size()) + " elements, but there are " +
                                  std::to_string(frames->size()) + " frames");
  }
  for (size_t i = 0; i < frames->size(); ++i) (*frames)[i].gain = gains.values[i];
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

Sequence ReadSequence(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw InputError(folder.string() + ": no such sequence folder");
  Sequence sequence;
  sequence.folder = folder;
  sequence.has_toml = IsFile(folder / kTomlName);
  Gains gains;
  if (sequence.has_toml) {
    ReadToml(&sequence, &gains);
  } else {
    sequence.calibration = C3vdCalibration();
    if (IsFile(folder / kMaskName)) {
      sequence.calibration.mask = ReadMask(folder / kMaskName, sequence.calibration.camera);
    }
  }
  ReadCalibrationOnTop(&sequence, &gains);
  sequence.frames = FramesWithColor(folder);
  AssignPoses(&sequence);
  AssignGains(gains, &sequence.frames);
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

fs::path FrameFile(const fs::path& folder, int number, const std::string& suffix) {
  char digits[16];
  std::snprintf(digits, sizeof digits, "%04d", number);
  std::string name = digits;
  name.append("_").append(suffix);
  return folder / name;
}

Image8 ReadColor(const Sequence& sequence, const SequenceFrame& frame) {
  Image8 color = ReadImage8(frame.color, 3);
  const CameraIntrinsics& camera = sequence.calibration.camera;
  if (color.width != camera.width || color.height != camera.height) {
    throw InputError(frame.color.string() + ": has " + std::to_string(color.width) + "×" +
                     std::to_string(color.height) + " pixels, the camera " + std::to_string(camera.width) +
                     "×" + std::to_string(camera.height));
  }
  return color;
}

Image8 ValidPixels(const Calibration& calibration) {
  const Camera<double> camera(calibration.camera);
  Image8 valid(calibration.camera.width, calibration.camera.height, 1);
  ParallelFor(0, valid.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < valid.width; ++x) {
      const bool masked_out = !calibration.mask.empty() && *calibration.mask.Pixel(x, y) < kMaskThreshold;
      if (!masked_out && camera.Unproject(Vec2d(x, y))) *valid.Pixel(x, y) = 255;
    }
  });
  return valid;
}

}  // namespace lumen
