#include "recon/training/hue_slope.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/parallel.h"

namespace lumen {
namespace {

constexpr int kSquaresAcross = 48;  // of a frame's width: the texture's own hues average out
constexpr int kLeastSquares = 20;   // of a frame that counts
constexpr int kSaturated = 250;
constexpr double kDarkest = 0.002;  // linear; half a step of 8 bits at γ = 2.2 is 5% there

}  // namespace

HueSlope::HueSlope(const Response& response, int width, int height,
                   const std::function<std::vector<uint8_t>(int)>& valid)
    : height_(height),
      edge_(std::max(4, width / kSquaresAcross)),
      across_(width / edge_),
      whole_(static_cast<size_t>(across_) * (height / edge_), 1),
      squares_(across_) {
  for (int code = 0; code < 256; ++code) linear_[code] = Decode(response, code / 255.0);
  ParallelFor(0, height / edge_, [&](int64_t row) {
    uint8_t* whole = &whole_[row * across_];
    for (int64_t y = row * edge_; y < (row + 1) * edge_; ++y) {
      const std::vector<uint8_t> pixels = valid(static_cast<int>(y));
      for (int x = 0; x < across_ * edge_; ++x) whole[x / edge_] &= pixels[x] != 0;
    }
  });
}

void HueSlope::AddRow(int y, const uint8_t* rgb) {
  for (int x = 0; x < across_ * edge_; ++x, rgb += 3) {
    if (std::max({rgb[0], rgb[1], rgb[2]}) >= kSaturated) continue;
    squares_[x / edge_].sum += Vec3d(linear_[rgb[0]], linear_[rgb[1]], linear_[rgb[2]]);
    ++squares_[x / edge_].count;
  }
  if ((y + 1) % edge_ == 0) EndSquares(y / edge_);
  if (y + 1 == height_) EndFrame();
}

void HueSlope::EndSquares(int row) {
  for (int i = 0; i < across_; ++i) {
    const auto& [sum, count] = squares_[i];
    const bool whole = whole_[static_cast<size_t>(row) * across_ + i] != 0;
    if (!whole || 10 * count < 9 * edge_ * edge_ || sum.minCoeff() < kDarkest * count) continue;
    logs_.push_back((sum / count).array().log());
  }
  std::ranges::fill(squares_, Square{});
}

void HueSlope::EndFrame() {
  std::ranges::fill(squares_, Square{});
  const std::vector<Vec3d> logs = std::exchange(logs_, {});
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
