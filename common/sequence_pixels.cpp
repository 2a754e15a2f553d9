// What of a sequence takes reading or looking at pixels.
#include <algorithm>

#include "common/binning.h"
#include "common/error.h"
#include "common/parallel.h"
#include "common/sequence.h"

namespace lumen {
namespace {

// Mask values from here on are image.
constexpr uint8_t kMaskThreshold = 128;

// row: as many as the image is wide.
void MarkValidOfRow(const Calibration& calibration, const Camera<double>& camera, int y, uint8_t* row) {
  for (int x = 0; x < calibration.camera.width; ++x) {
    const bool masked_out = !calibration.mask.empty() && *calibration.mask.Pixel(x, y) < kMaskThreshold;
    row[x] = !masked_out && camera.Unproject(Vec2d(x, y)) ? 255 : 0;
  }
}

}  // namespace

Image8 ReadColor(const Sequence& sequence, const SequenceFrame& frame) {
  Image8 color(sequence.calibration.camera.width, sequence.calibration.camera.height, 3);
  ReadColorRows(sequence, frame, [&](int y, const uint8_t* rgb) {
    std::copy_n(rgb, 3 * static_cast<size_t>(color.width), color.Pixel(0, y));
  });
  return color;
}

void ReadColorRows(const Sequence& sequence, const SequenceFrame& frame,
                   const std::function<void(int, const uint8_t*)>& row) {
  const CameraIntrinsics& camera = sequence.calibration.camera;
  const auto [factor, file_width, file_height] =
      sequence.binning.factor > 1 ? sequence.binning : Binning{1, camera.width, camera.height};
  try {
    int width = 0, height = 0;
    ReadImageSize(frame.color, &width, &height);
    if (width != file_width || height != file_height) {
      throw DamagedFrame(frame.color.string() + ": has " + std::to_string(width) + "×" +
                         std::to_string(height) + " pixels, the camera " + std::to_string(file_width) + "×" +
                         std::to_string(file_height));
    }
    if (factor == 1) return ReadImage8Rows(frame.color, 3, row);
    RowBinner binner(sequence.calibration.response, factor, camera.width, row);
    ReadImage8Rows(frame.color, 3, [&](int y, const uint8_t* rgb) { binner.AddRow(y, rgb); });
  } catch (const DamagedFrame&) {
    throw;
  } catch (const InputError& error) {
    throw DamagedFrame(error.what());
  }
}

void LeaveOutUnreadableFrames(Sequence* sequence) {
  std::vector<std::string> problem(sequence->frames.size());
  ParallelFor(0, static_cast<int64_t>(problem.size()), [&](int64_t i) {
    try {
      ReadColorRows(*sequence, sequence->frames[i], [](int, const uint8_t*) {});
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
    MarkValidOfRow(calibration, camera, y, valid.Pixel(0, y));
  });
  return valid;
}

std::vector<uint8_t> ValidPixelsOfRow(const Calibration& calibration, const Camera<double>& camera, int y) {
  std::vector<uint8_t> row(static_cast<size_t>(calibration.camera.width));
  MarkValidOfRow(calibration, camera, y, row.data());
  return row;
}

}  // namespace lumen
