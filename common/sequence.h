// The sequence folder: C3VD's layout plus sequence.toml. The simulator writes it; the reconstructor and the
// evaluation read it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/camera.h"
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

// C3VD's built-in calibration, for folders without a sequence.toml.
Calibration C3vdCalibration();

// The octagon that C3VD's scope shows, in parts of the image: its corners are cut off along the lines
// from 15.04% of the width to 23.29% of the height (measured on the data set's official mask, 1350×1080, to
// half a pixel). One channel, 255 = image.
Image8 C3vdOctagon(int width, int height);

struct SequenceFrame {
  int number = 0;  // NNNN of its files
  Pose world_from_camera = Pose::Identity();
  std::optional<double> gain;  // nothing = unknown, to be estimated
  // Files; an empty path = there is none.
  std::filesystem::path color, depth, normals, flow, occlusion;
};

struct Sequence {
  std::filesystem::path folder;
  bool has_toml = false;  // false: a C3VD folder as it was downloaded
  Calibration calibration;
  std::vector<SequenceFrame> frames;
  std::filesystem::path ground_truth_mesh;  // empty = none
};

// Reads sequence.toml (or falls back to C3VD's calibration), calibration.toml on top where there is one
// ([light], [response] and [frames] gain, each in place of the sequence's own), pose.txt, and finds the
// frames' files, in the layout of C3VD v1 or v2. Pixels are not read. Throws InputError naming file and
// place: unknown or missing keys, a pose line short of numbers or no rotation (not orthonormal within 1e-3),
// fewer poses or gains than colour files, no frame at all, a mask of another size.
Sequence ReadSequence(const std::filesystem::path& folder);

// Writes sequence.toml, mask.png and pose.txt; frames' files are the caller's. Paths of the ground truth are
// written relative to the folder.
void WriteSequenceHeader(const Sequence& sequence);

// The file of frame `number` with one of C3VD's suffixes ("color.png", "depth.tiff", …):
// folder/0012_color.png.
std::filesystem::path FrameFile(const std::filesystem::path& folder, int number, const std::string& suffix);

// Colour of a frame, 8-bit RGB, checked against the camera's size.
Image8 ReadColor(const Sequence& sequence, const SequenceFrame& frame);

// Pixels that carry image: inside the mask and with a ray. One channel, 255 = yes.
Image8 ValidPixels(const Calibration& calibration);

// C3VD's encodings. Nothing (no surface) is NaN in float images and 0 in all channels of the files.
Image16 EncodeDepth(const ImageF& z_mm);      // floor(65535·z/100); beyond 100 mm: 65535
ImageF DecodeDepth(const Image16& encoded);   // mm at the middle of the step; beyond: +infinity; nothing: NaN
Image16 EncodeNormals(const ImageF& normal);  // v = (n + 1)/2·65535, rounded
ImageF DecodeNormals(const Image16& encoded);
Image16 EncodeFlow(const ImageF& flow_px);  // v = (px + 20)/40·65535, rounded, clipped; third channel 0
ImageF DecodeFlow(const Image16& encoded);  // two channels

}  // namespace lumen
