#include "sim/cost/reference.h"

#include <cmath>
#include <limits>

namespace lumen {
namespace {

constexpr int kBlock_px = 8, kTile_px = 64;

double MeanSquare(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return a.empty() ? 0 : sum / static_cast<double>(a.size());
}

// Variance of the mean of the pictures' sums: tiles are independent of each other.
double VarianceOfMeanSum(const std::vector<Luminance>& pictures) {
  const double n = static_cast<double>(pictures.size());
  double variance = 0;
  for (size_t tile = 0; tile < pictures[0].tile_sums.size(); ++tile) {
    double mean = 0, squares = 0;
    for (const Luminance& picture : pictures) mean += picture.tile_sums[tile] / n;
    for (const Luminance& picture : pictures) squares += std::pow(picture.tile_sums[tile] - mean, 2);
    variance += squares / (n - 1) / n;
  }
  return variance;
}

}  // namespace

Luminance LuminanceOf(const ImageF& radiance, const Image8& valid) {
  Luminance luminance;
  const int width = radiance.width, height = radiance.height;
  const int tile_columns = (width + kTile_px - 1) / kTile_px, tile_rows = (height + kTile_px - 1) / kTile_px;
  const int block_columns = width / kBlock_px, block_rows = height / kBlock_px;
  luminance.tile_sums.assign(size_t(tile_columns) * tile_rows, 0);
  std::vector<double> block_sums(size_t(block_columns) * block_rows, 0);
  std::vector<int> block_pixels(block_sums.size(), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (!*valid.Pixel(x, y)) continue;
      const float* rgb = radiance.Pixel(x, y);
      const double value = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
      luminance.pixels.push_back(value);
      luminance.sum += value;
      luminance.tile_sums[size_t(y / kTile_px) * tile_columns + x / kTile_px] += value;
      if (x / kBlock_px >= block_columns || y / kBlock_px >= block_rows) continue;
      const size_t block = size_t(y / kBlock_px) * block_columns + x / kBlock_px;
      block_sums[block] += value;
      ++block_pixels[block];
    }
  }
  for (size_t block = 0; block < block_sums.size(); ++block) {
    if (block_pixels[block] == kBlock_px * kBlock_px)
      luminance.blocks.push_back(block_sums[block] / (kBlock_px * kBlock_px));
  }
  return luminance;
}

Reference::Reference(Luminance first, Luminance second) {
  const auto merge = [](const std::vector<double>& a, const std::vector<double>& b) {
    Part part{a, MeanSquare(a, b) / 4};
    for (size_t i = 0; i < a.size(); ++i) part.mean[i] = (a[i] + b[i]) / 2;
    return part;
  };
  pixels_ = merge(first.pixels, second.pixels);
  blocks_ = merge(first.blocks, second.blocks);
  sum_ = (first.sum + second.sum) / 2;
  mean_ = sum_ / static_cast<double>(pixels_.mean.size());
  sum_variance_ = VarianceOfMeanSum({std::move(first), std::move(second)});
}

double Reference::Noise(ErrorMeasure measure) const { return std::sqrt(Of(measure).variance) / mean_; }

double Reference::MeanError() const { return std::sqrt(sum_variance_) / sum_; }

double Reference::Error(const Luminance& picture, ErrorMeasure measure) const {
  const Part& own = Of(measure);
  const double square =
      MeanSquare(measure == ErrorMeasure::kPixels ? picture.pixels : picture.blocks, own.mean);
  return square >= 2 * own.variance ? std::sqrt(square - own.variance) / mean_
                                    : std::numeric_limits<double>::quiet_NaN();
}

Bias Reference::BiasOf(const std::vector<Luminance>& pictures) const {
  double sum = 0;
  for (const Luminance& picture : pictures) sum += picture.sum / static_cast<double>(pictures.size());
  return {(sum - sum_) / sum_, std::sqrt(VarianceOfMeanSum(pictures) + sum_variance_) / sum_};
}

}  // namespace lumen
