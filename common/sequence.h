// The sequence folder: C3VD's layout plus sequence.toml. The simulator writes it; the reconstructor and the
// evaluation read it.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/camera.h"
#include "common/error.h"
#include "common/image.h"
#include "common/light.h"
#include "common/math.h"
#include "common/response.h"

namespace lumen {

// How pixel values came about: everything but the frames themselves.
struct Calibration {
  CameraIntrinsics camera;
  Image8 mask;  // one channel, 255 = image; empty = every pixel
  Light light;
  Response response;
};

// C3VD's built-in calibration, for folders without a sequence.toml; C3VDv2's differs in the camera only
// (common/c3vd_camera.h).
Calibration C3vdCalibration();

// The octagon that C3VD's scope shows, in parts of the image: its corners are cut off along the lines
// from 15.04% of the width to 23.29% of the height (measured on the data set's official mask, 1350×1080, to
// half a pixel). One channel, 255 = image.
Image8 C3vdOctagon(int width, int height);

struct SequenceFrame {
  int number = 0;  // NNNN of its files
  Pose world_from_camera = Pose::Identity();
  std::optional<double> gain;  // nothing = unknown, to be estimated
  // Standard error of the gain's logarithm, where the gain is an estimate; nothing = known for good.
  std::optional<double> log_gain_error;
  // Files; an empty path = there is none.
  std::filesystem::path color, depth, normals, flow, occlusion;
};

// Frames that are read at a part of their files' size (common/binning.h).
struct Binning {
  int factor = 1;             // so many by so many pixels of a file are one
  int width = 0, height = 0;  // of the files, where that is more than 1
};

struct Sequence {
  std::filesystem::path folder;
  bool has_toml = false;  // false: a C3VD folder as it was downloaded
  Calibration calibration;
  Binning binning;
  std::vector<SequenceFrame> frames;
  std::filesystem::path ground_truth_mesh;  // empty = none
  std::vector<std::string> left_out;        // what of the folder is not used, and why: a line each
};

// A frame that can't be used although the sequence can: ReadOptions can leave it out.
class DamagedFrame : public InputError {
 public:
  using InputError::InputError;
};

struct ReadOptions {
  // Frames whose pose is missing or damaged, and those that are missing themselves, are left out and named in
  // left_out; otherwise they are errors.
  bool skip_damaged = false;
  bool calibration = true;  // false: calibration.toml is not read
};

// Reads sequence.toml (or falls back to C3VD's calibration), calibration.toml on top where there is one
// ([light], [response] and [frames], each in place of the sequence's own; [uncertainty] has standard errors:
// log_gain, one a gain, without which gains count as exact; spread; gamma), pose.txt, and finds the
// frames' files, in the layout of C3VD v1 or v2. Pixels are not read. A C3VD folder may be a part of a
// download: where it has more poses than colour files, a frame's number is that of its line. Throws
// InputError naming file and place: unknown or missing keys, no frame at all, a mask of another size, gains
// that don't fit the frames; DamagedFrame: a pose line short of numbers or no rotation (not orthonormal
// within 1e-3), fewer poses than colour files, or more in a folder with sequence.toml.
Sequence ReadSequence(const std::filesystem::path& folder, const ReadOptions& options = {});

// Reads the colour file of every frame and leaves out, naming them in left_out, those that are damaged or of
// another size than the camera's. Throws InputError where none is left.
void LeaveOutUnreadableFrames(Sequence* sequence);

// Writes sequence.toml, mask.png and pose.txt; frames' files are the caller's. Paths of the ground truth are
// written relative to the folder.
void WriteSequenceHeader(const Sequence& sequence);

// Which of `count` frames are taken where at most `at_most` (>= 1) are: indices, spread uniformly from the
// first to the last; of one alone, the first.
std::vector<int> UniformFrames(int count, int at_most);

// The file of frame `number` with one of C3VD's suffixes ("color.png", "depth.tiff", …):
// folder/0012_color.png.
std::filesystem::path FrameFile(const std::filesystem::path& folder, int number, const std::string& suffix);

// Colour of a frame, 8-bit RGB, checked against the camera's size, binned as the sequence says. Throws
// DamagedFrame.
Image8 ReadColor(const Sequence& sequence, const SequenceFrame& frame);

// The same row by row, from the top: row(y, rgb). Throws DamagedFrame, maybe only after the last row.
void ReadColorRows(const Sequence& sequence, const SequenceFrame& frame,
                   const std::function<void(int, const uint8_t*)>& row);

// Pixels that carry image: inside the mask and with a ray. One channel, 255 = yes.
Image8 ValidPixels(const Calibration& calibration);
// Those of a row alone. camera: the calibration's.
std::vector<uint8_t> ValidPixelsOfRow(const Calibration& calibration, const Camera<double>& camera, int y);

// C3VD's encodings. Nothing (no surface) is NaN in float images and 0 in all channels of the files.
Image16 EncodeDepth(const ImageF& z_mm);      // floor(65535·z/100); beyond 100 mm: 65535
ImageF DecodeDepth(const Image16& encoded);   // mm at the middle of the step; beyond: +infinity; nothing: NaN
Image16 EncodeNormals(const ImageF& normal);  // v = (n + 1)/2·65535, rounded
ImageF DecodeNormals(const Image16& encoded);
Image16 EncodeFlow(const ImageF& flow_px);  // v = (px + 20)/40·65535, rounded, clipped; third channel 0
ImageF DecodeFlow(const Image16& encoded);  // two channels

}  // namespace lumen
