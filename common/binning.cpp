#include "common/binning.h"

#include <algorithm>
#include <string>

#include "common/error.h"
#include "common/parallel.h"

namespace lumen {

Sequence Binned(const Sequence& sequence, int factor) {
  const Calibration& whole = sequence.calibration;
  const int width = whole.camera.width, height = whole.camera.height;
  if (factor < 1 || factor > std::min(width, height) || sequence.binning.factor != 1) {
    throw InputError(sequence.folder.string() + ": frames of " + std::to_string(width) + "×" +
                     std::to_string(height) + " pixels can't be binned by " + std::to_string(factor));
  }
  Sequence binned = sequence;
  binned.binning = {factor, width, height};
  CameraIntrinsics& camera = binned.calibration.camera;
  camera.width = width / factor * factor;
  camera.height = height / factor * factor;
  camera = Resized(camera, width / factor, height / factor);

  Image8& mask = binned.calibration.mask;
  mask = Image8(camera.width, camera.height, 1, 255);
  const Camera<double> rays(whole.camera);
  ParallelFor(0, mask.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int of_square = 0; of_square < factor; ++of_square) {
      const std::vector<uint8_t> valid = ValidPixelsOfRow(whole, rays, y * factor + of_square);
      for (int x = 0; x < mask.width * factor; ++x) *mask.Pixel(x / factor, y) &= valid[x];
    }
  });
  for (SequenceFrame& frame : binned.frames)
    for (auto* file : {&frame.depth, &frame.normals, &frame.flow, &frame.occlusion}) file->clear();
  return binned;
}

RowBinner::RowBinner(const Response& response, int factor, int width,
                     const std::function<void(int, const uint8_t*)>& row)
    : response_(response),
      factor_(factor),
      row_(row),
      sums_(3 * static_cast<size_t>(width), 0.0),
      binned_(3 * static_cast<size_t>(width)) {
  for (int code = 0; code < 256; ++code) linear_[code] = Decode(response, code / 255.0);
}

void RowBinner::AddRow(int y, const uint8_t* rgb) {
  const size_t width = sums_.size() / 3;
  for (size_t x = 0; x < width * factor_; ++x, rgb += 3)
    for (size_t c = 0; c < 3; ++c) sums_[3 * (x / factor_) + c] += linear_[rgb[c]];
  if ((y + 1) % factor_ != 0) return;
  const double pixels = double(factor_) * factor_;
  std::ranges::transform(sums_, binned_.begin(),
                         [&](double sum) { return Quantise(Encode(response_, sum / pixels)); });
  std::ranges::fill(sums_, 0.0);
  row_(y / factor_, binned_.data());
}

}  // namespace lumen
