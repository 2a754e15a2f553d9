#include "recon/evaluation/colormap.h"

#include <algorithm>
#include <cmath>

namespace lumen {
namespace {

uint8_t ToByte(double x) { return static_cast<uint8_t>(std::lround(255 * std::clamp(x, 0.0, 1.0))); }

}  // namespace

Rgb8 Seismic(double x) {
  constexpr double kGrey = 0.82, kDark = 0.55;
  const double t = std::min(std::abs(x), 1.0);
  // Half way the hue is pure; from there it darkens.
  const double other = kGrey * std::max(0.0, 1 - 2 * t);
  const double own = t < 0.5 ? kGrey + (1 - kGrey) * 2 * t : 1 - (1 - kDark) * (2 * t - 1);
  return x < 0 ? Rgb8{ToByte(other), ToByte(other), ToByte(own)}
               : Rgb8{ToByte(own), ToByte(other), ToByte(other)};
}

Rgb8 Jet(double x) {
  const double t = 4 * std::clamp(x, 0.0, 1.0);
  return {ToByte(1.5 - std::abs(t - 3)), ToByte(1.5 - std::abs(t - 2)), ToByte(1.5 - std::abs(t - 1))};
}

std::vector<Rgb8> ErrorColors(const std::vector<double>& signed_error_mm, double limit_mm) {
  std::vector<Rgb8> colors(signed_error_mm.size());
  for (size_t i = 0; i < colors.size(); ++i) colors[i] = Seismic(signed_error_mm[i] / limit_mm);
  return colors;
}

std::vector<Rgb8> CountColors(const std::vector<int>& frames_seeing, int frames) {
  std::vector<Rgb8> colors(frames_seeing.size(), kUnobservedGrey);
  for (size_t i = 0; i < colors.size(); ++i) {
    if (frames_seeing[i] > 0) colors[i] = Jet((frames_seeing[i] - 1.0) / std::max(frames - 1, 1));
  }
  return colors;
}

}  // namespace lumen
