#include "tools/study/strips.h"

#include <algorithm>
#include <cmath>

#include "recon/evaluation/colormap.h"
#include "recon/evaluation/layout.h"
#include "recon/evaluation/portrait.h"

namespace lumen {
namespace {

constexpr int kHeight = 200, kStripsARow = 3;
constexpr double kSaturation_mm = 10;  // the paper's: fully red or blue from 1 cm on

}  // namespace

void WriteStrip(const Evaluation& evaluation, const Mesh& reconstruction, const Sequence& rendered,
                const std::filesystem::path& file) {
  const SequenceFrame& frame = rendered.frames[rendered.frames.size() / 2];
  const CameraIntrinsics& camera = rendered.calibration.camera;
  const int width = static_cast<int>(std::lround(double(kHeight) * camera.width / camera.height));
  View view;
  view.camera = Resized(camera, width, kHeight);
  view.world_from_camera = frame.world_from_camera;
  view.background = {0, 0, 0};
  if (!rendered.calibration.mask.empty()) view.valid = Scaled(rendered.calibration.mask, width, kHeight);
  const Image8 seen = Scaled(ReadColor(rendered, frame), width, kHeight);
  const Image8 wrong =
      Portrait(reconstruction).Draw(view, ErrorColors(evaluation.signed_error_mm, kSaturation_mm));
  Image8 strip(2 * width, kHeight, 3);
  for (int y = 0; y < kHeight; ++y) {
    std::copy_n(seen.Pixel(0, y), 3 * width, strip.Pixel(0, y));
    std::copy_n(wrong.Pixel(0, y), 3 * width, strip.Pixel(width, y));
  }
  WriteImage(file, strip);
}

void WriteStripSheet(const std::vector<TitledStrip>& strips, const std::filesystem::path& file) {
  std::vector<Panel> panels;
  for (const TitledStrip& strip : strips) panels.push_back({strip.title, ReadImage8(strip.file, 3)});
  const ColorBar bar = {[](double t) { return Seismic(2 * t - 1); }, "-1 cm (inside)", "0",
                        "+1 cm (outside)"};
  WriteImage(file, Compose(panels, kStripsARow, {bar}));
}

}  // namespace lumen
