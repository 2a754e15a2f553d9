#include "recon/training/hue_slope.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/math.h"

namespace lumen {
namespace {

constexpr int kSquaresAcross = 48;  // of a frame's width: the texture's own hues average out
constexpr int kLeastSquares = 20;   // of a frame that counts
constexpr int kSaturated = 250;
constexpr double kDarkest = 0.002;  // linear; half a step of 8 bits at γ = 2.2 is 5% there

}  // namespace

void HueSlope::Add(const Image8& color, const Image8& valid, const Response& response) {
  std::array<double, 256> linear;
  for (int code = 0; code < 256; ++code) linear[code] = Decode(response, code / 255.0);
  const int edge = std::max(4, color.width / kSquaresAcross);
  std::vector<Vec3d> logs;
  for (int top = 0; top + edge <= color.height; top += edge) {
    for (int left = 0; left + edge <= color.width; left += edge) {
      Vec3d sum = Vec3d::Zero();
      int count = 0;
      bool whole = true;
      for (int y = top; y < top + edge; ++y) {
        for (int x = left; x < left + edge; ++x) {
          whole = whole && *valid.Pixel(x, y) != 0;
          const uint8_t* rgb = color.Pixel(x, y);
          if (std::max({rgb[0], rgb[1], rgb[2]}) >= kSaturated) continue;
          sum += Vec3d(linear[rgb[0]], linear[rgb[1]], linear[rgb[2]]);
          ++count;
        }
      }
      if (!whole || 10 * count < 9 * edge * edge || sum.minCoeff() < kDarkest * count) continue;
      logs.push_back((sum / count).array().log());
    }
  }
  if (static_cast<int>(logs.size()) < kLeastSquares) return;
  Vec3d mean = Vec3d::Zero();
  for (const Vec3d& log : logs) mean += log / static_cast<double>(logs.size());
  for (const Vec3d& log : logs) {
    const Vec3d off = log - mean;
    for (int x = 0; x < 3; ++x) {
      for (int y = 0; y < 3; ++y) {
        sums_[x][y].xx += off[y] * off[y];
        sums_[x][y].xy += off[y] * (off[x] - off[y]);
      }
      log_value_[x] += log[x];
    }
  }
}

double HueSlope::Slope() const {
  const auto most = std::ranges::max_element(log_value_) - log_value_.begin();
  const auto least = std::ranges::min_element(log_value_) - log_value_.begin();
  const Sums& sums = sums_[most][least];
  return sums.xx > 0 ? sums.xy / sums.xx : 0;
}

}  // namespace lumen
