#include <cmath>
#include <set>

#include "recon/evaluation/colormap.h"
#include "recon/evaluation/layout.h"
#include "recon/evaluation/light_error.h"

namespace lumen {
namespace {

constexpr Rgb8 kNothing = {0, 0, 0};
constexpr int kPanelHeight = 260;

void Set(const Rgb8& color, uint8_t* pixel) { std::copy_n(color.data(), 3, pixel); }

Image8 Enlarged(const Image8& image) {
  return Scaled(image, static_cast<int>(std::lround(double(kPanelHeight) * image.width / image.height)),
                kPanelHeight);
}

// As an sRGB screen's 2.2 shows it.
Image8 AlbedoPicture(const ImageF& albedo, const Vec3d& factor) {
  Image8 picture(albedo.width, albedo.height, 3);
  for (int y = 0; y < albedo.height; ++y) {
    for (int x = 0; x < albedo.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double value = factor[c] * albedo.Pixel(x, y)[c];
        picture.Pixel(x, y)[c] =
            value > 0 ? static_cast<uint8_t>(std::lround(255 * std::pow(std::min(value, 1.0), 1 / 2.2))) : 0;
      }
    }
  }
  return Enlarged(picture);
}

Image8 SharePicture(const LightFrame& frame) {
  constexpr int kGreen = 1;
  Image8 picture(frame.direct.width, frame.direct.height, 3);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const double share = BouncedShare(frame.direct.Pixel(x, y)[kGreen], frame.indirect.Pixel(x, y)[kGreen]);
      Set(share >= 0 ? Jet(share) : kNothing, picture.Pixel(x, y));
    }
  }
  return Enlarged(picture);
}

}  // namespace

void WriteLightPicture(const LightErrors& errors, const std::vector<LightFrame>& learnt,
                       const std::vector<LightFrame>& truth, const std::vector<int>& numbers,
                       const std::filesystem::path& file) {
  std::vector<Panel> panels;
  for (const size_t i : std::set<size_t>{0, numbers.size() / 2, numbers.size() - 1}) {
    const std::string of_frame = " (frame " + std::to_string(numbers[i]) + ")";
    panels.push_back({"true albedo" + of_frame, AlbedoPicture(truth[i].albedo, Vec3d::Ones())});
    panels.push_back({"learnt", AlbedoPicture(learnt[i].albedo, errors.albedo_factor)});
    panels.push_back({"true share of bounced light, green", SharePicture(truth[i])});
    panels.push_back({"learnt", SharePicture(learnt[i])});
  }
  WriteImage(file, Compose(panels, 4, {{Jet, "0", "share of bounced light", "1"}}));
}

}  // namespace lumen
