// What of a sequence takes reading or looking at pixels.
#include "common/error.h"
#include "common/parallel.h"
#include "common/sequence.h"

namespace lumen {
namespace {

// Mask values from here on are image.
constexpr uint8_t kMaskThreshold = 128;

}  // namespace

Image8 ReadColor(const Sequence& sequence, const SequenceFrame& frame) {
  Image8 color;
  try {
    color = ReadImage8(frame.color, 3);
  } catch (const InputError& error) {
    throw DamagedFrame(error.what());
  }
  const CameraIntrinsics& camera = sequence.calibration.camera;
  if (color.width != camera.width || color.height != camera.height) {
    throw DamagedFrame(frame.color.string() + ": has " + std::to_string(color.width) + "×" +
                       std::to_string(color.height) + " pixels, the camera " + std::to_string(camera.width) +
                       "×" + std::to_string(camera.height));
  }
  return color;
}

void LeaveOutUnreadableFrames(Sequence* sequence) {
  std::vector<std::string> problem(sequence->frames.size());
  ParallelFor(0, static_cast<int64_t>(problem.size()), [&](int64_t i) {
    try {
      ReadColor(*sequence, sequence->frames[i]);
    } catch (const DamagedFrame& error) {
      problem[i] = error.what();
    }
  });
  std::vector<SequenceFrame> readable;
  for (size_t i = 0; i < problem.size(); ++i) {
    if (problem[i].empty()) {
      readable.push_back(sequence->frames[i]);
    } else {
      sequence->left_out.push_back(problem[i] + "; the frame is left out");
    }
  }
  if (readable.empty()) throw InputError(sequence->left_out.back() + ", and none is left");
  sequence->frames = readable;
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
